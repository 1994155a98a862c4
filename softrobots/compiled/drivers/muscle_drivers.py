"""Muscle inputs, for callers of the C code; kernel language, see `softrobots.compiled.drivers.equilibrium_drivers`.

The Python solvers use matrices instead, in `softrobots.compiled.run.actuation`.
"""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array


def put_muscles(w: Array, muscles: Array) -> None:
    """Write the effect of `N_MUSCLES` muscle lengths [m] or tensions [N], base to tip; call it before `settle`."""
    for i in range(N_MUSCLE_ROWS):
        total = MUSCLE_BASE[i]
        for j in range(N_MUSCLES):
            total += MUSCLE_SLOPE[N_MUSCLES * i + j] * (muscles[j] - MUSCLE_REST[j])
        w[MUSCLE_PLACE + i] = total
