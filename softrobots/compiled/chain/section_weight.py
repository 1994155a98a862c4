"""The weight of a section's own bodies.

They are fixed to the frames behind the six rigid joints of the section (`softrobots.constant_curvature.strain_chain`). These
frames follow from the end of the section without any angle: the chord frame `Rx(u1) Ry(u2)` has the chord as its z axis, and
the frames of the spherical joint divide the turn from there to the end. Derivatives are those of the trace.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.trace.expressions import Expression, Scalar, gradient, square_root


class OwnWeight(NamedTuple):
    """First moment of mass of a section about its start, in the axes of the start."""

    moment: Any
    """Sum of mass times position, shape (3,) [kg m]."""
    slopes: Any
    """Its derivative with respect to the section coordinates, shape (3, 4)."""
    curvature: Any
    """Second derivative of `gravity . moment`, shape (4, 4)."""


def weight_moment(z: Sequence[Scalar], screw: Any, bodies: Sequence[tuple[Scalar, Any]], gravity: Any) -> OwnWeight:
    """Return the first moment of the bodies of a section.

    Args:
        z: Section coordinates.
        screw: The section at these coordinates, with `rotation` and `position` of its end in the axes of its start.
        bodies: Mass [kg] and first moment [kg m] of the body behind each of the six joints, in the axes there.
        gravity: Gravity in the axes of the start [m/s^2].

    Returns:
        The moment with its derivatives.
    """
    chord = _chord_axes(screw.position)
    about_x, about_y, end = _spherical_axes(chord, screw.rotation)
    first = chord.copy()  # Rx(u1): the chord frame before it turns about its y
    across = square_root(screw.position[1] * screw.position[1] + screw.position[2] * screw.position[2])
    first[:, 0] = np.array([1.0, 0.0, 0.0], dtype=object)
    first[:, 2] = np.array([0.0, screw.position[1] / across, screw.position[2] / across], dtype=object)
    moment = screw.position * sum(mass for mass, _ in bodies[2:])
    for axes, (_, lever) in zip((first, chord, chord, about_x, about_y, end), bodies, strict=True):
        moment = moment + axes @ lever
    variables = [one for one in z if isinstance(one, Expression)]

    def spread(slopes: Sequence[Scalar]) -> list[Scalar]:
        """Insert zeros for coordinates that are constants."""
        values = iter(slopes)
        return [next(values) if isinstance(one, Expression) else 0.0 for one in z]

    slopes = np.array([spread(gradient(one, variables)) for one in moment], dtype=object)
    work = spread(gradient(gravity @ moment, variables))
    curvature = np.array([spread(gradient(one, variables)) for one in work], dtype=object)
    return OwnWeight(moment, slopes, curvature)


def _chord_axes(position: Any) -> Any:
    """Return `Rx(u1) Ry(u2)`: z along the chord, y across it without a component along x."""
    x, y, z = position
    across = square_root(y * y + z * z)
    length = square_root(x * x + y * y + z * z)
    sx, cx, sy, cy = -y / across, z / across, x / length, across / length
    return np.array([[cy, 0.0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]], dtype=object)


def _spherical_axes(chord: Any, rotation: Any) -> tuple[Any, Any, Any]:
    """Return the axes behind `Rx(r1)`, `Ry(r2)` and `Rz(r3)`."""
    turn = chord.T @ rotation
    across = square_root(turn[1, 2] * turn[1, 2] + turn[2, 2] * turn[2, 2])
    sx, cx = -turn[1, 2] / across, turn[2, 2] / across
    sy, cy = turn[0, 2], across
    about_x = chord @ np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]], dtype=object)
    about_y = about_x @ np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]], dtype=object)
    return about_x, about_y, rotation
