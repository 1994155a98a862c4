"""The helix in 50 digits, and actuators of every kind."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
from hypothesis import strategies as st

DEG = math.pi / 180.0
D = 0.0331
LAST = 1.0 - 2.0**-53  # the largest number below 1
CONTRACTIONS = (1e-30, 1e-17, 1e-8, 1e-3, 0.1, 0.3, 0.5, 0.66, 0.9, 0.999, 1 - 1e-6, 1 - 1e-10, 1 - 1e-14, LAST, 1.0)
ANGLES = (0.0, 1e-15, 1e-10, 1e-5, 0.01, 5 * DEG, 0.4, 45 * DEG, 1.0, 1.5, math.pi / 2 - 1e-5, math.pi / 2 - 1e-9)


contractions_ = st.one_of(
    st.floats(1e-3, 1.0), st.floats(-30.0, 0.0).map(lambda x: 10.0**x), st.floats(-15.0, 0.0).map(lambda x: 1.0 - 0.9 * 10.0**x)
)


angles_ = st.one_of(
    st.floats(0.0, 1.5, allow_subnormal=False),
    st.floats(-15.0, 0.0).map(lambda x: 10.0**x),
    st.floats(-9.0, 0.0).map(lambda x: math.pi / 2 - 10.0**x),
)


diameters_ = st.floats(-3.0, 3.0).map(lambda x: 10.0**x)


# Required: 1e-12 times the condition number. Every map here is a dozen operations, each to half a unit in the last
# place (1.1e-16) and sines to one: measured, 6e-16 to 1.2e-15. So the tests ask for a hundred times more than that.
TOLERANCE = 1e-14


def exact_forward(contraction: Any, angle: Any, diameter: Any) -> tuple[Any, Any, Any]:
    """[Blumenschein 2018] (12) as printed: outer radius, inner radius, pitch."""
    share, size, cosine = mp.mpf(contraction), mp.mpf(diameter), mp.cos(2 * mp.mpf(angle))
    below = 1 + share**2 - 2 * share * cosine
    sine = mp.sin(2 * mp.mpf(angle))
    return size * (1 - share * cosine) / below, size * share * (cosine - share) / below, size * share * sine / below


def assert_close(found: Any, exact: Any, allowed: Any) -> None:
    assert abs(mp.mpf(float(found)) - exact) <= allowed, (float(found), mp.nstr(exact, 17), mp.nstr(allowed, 3))


def length_by_chords(curve: Callable[[np.ndarray], np.ndarray], start: float, end: float) -> float:
    """Length of a curve from its points alone: chords, whose error goes with even powers of the step, by Romberg's rule."""
    table = [np.sum(np.linalg.norm(np.diff(curve(np.linspace(start, end, 2**k + 1)), axis=0), axis=1)) for k in range(4, 11)]
    for order in range(1, len(table)):
        table = [fine + (fine - coarse) / (4.0**order - 1.0) for coarse, fine in itertools.pairwise(table)]
    return float(table[0])
