"""Numbers that are allowed but look like those of another unit: degrees, centimetres, millimetres or kilopascals."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Sequence

MOST_STRETCH = 10.0
"""Times its rest length that a muscle can have; what stretches most, soft silicone, tears below that."""
NEXT_TO_NO_PRESSURE = 200.0
"""Pressure or modulus [Pa] below which a number is likelier one in kPa, bar or MPa."""
_MILLIMETRES = 300.0  # times what is usual, from which on millimetres are likelier than centimetres


class SuspiciousInputWarning(UserWarning):
    """A number looks as if it were in another unit: degrees for radians, centimetres for metres, kPa for Pa."""


def question(text: str) -> None:
    """Issue a `SuspiciousInputWarning` for the line outside this package from which it was called."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("softrobots."):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, SuspiciousInputWarning, stacklevel=level)


def question_angle(name: str, angle: float) -> None:
    """Ask whether an angle [rad] is one in degrees."""
    degrees = f"{name} = {angle:.6g} rad is {math.degrees(angle):.4g} degrees"
    question(f"{degrees}; it looks like degrees (did you mean radians({angle:.6g}) = {math.radians(angle):.4g}?)")


def question_length(name: str, length: float, usual: float) -> None:
    """Ask whether a length [m] that is many times the usual one is one in centimetres or millimetres."""
    question(f"{name} = {length:.6g} m is {other_length(length, usual)}")


def question_pressure(name: str, pressure: float) -> None:
    """Ask whether a pressure or modulus [Pa] that is next to nothing is one in kPa, bar or MPa."""
    question(f"{name} = {pressure:.6g} Pa is next to nothing; it looks like kPa, bar or MPa (50 kPa = 0.5 bar = 50e3 Pa)")


def stretched_too_far(names: Sequence[str], lengths: Sequence[float], rest: Sequence[float]) -> str | None:
    """Return what muscle lengths [m] must be instead of more than `MOST_STRETCH` times those at rest; None if none is."""
    for name, length, usual in zip(names, lengths, rest, strict=True):
        if length > MOST_STRETCH * usual:
            return f"of lengths that a muscle can have: {name} = {length:.6g} m is {other_length(length, usual)}"
    return None


def other_length(length: float, usual: float) -> str:
    """Return in words how many times a usual length a length is, and what it would be in a smaller unit [m]."""
    unit, share = ("centimetres", 0.01) if length < _MILLIMETRES * usual else ("millimetres", 0.001)
    return f"{length / usual:.3g} times the usual {usual:.6g} m; it looks like {unit} (did you mean {length * share:.6g} m?)"
