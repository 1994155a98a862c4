"""Geometric Jacobians of arcs and chains: from arcs, strains and muscle lengths to the velocity of the tip.

All have six rows in the axes of the base: the velocity of the tip point [m], then the angular velocity [rad], each for a unit
rate of the coordinate. Those with respect to strains and muscle lengths use the bending vector and are smooth at the straight
configuration in the torsion-free frame. In the bending-plane frame the tip rotates about the backbone with the azimuth, which
is not differentiable with respect to the bending vector there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.constant_curvature.arcs import Arc, arc_from_strains, checked_arc, checked_strains, stack_arcs
from softrobots.constant_curvature.muscles import AZIMUTHS, strains_from_muscles, strains_per_muscle
from softrobots.constant_curvature.poses import FRAMES, cardinal_sine, chain_frames
from softrobots.constant_curvature.stumpff import stumpff
from softrobots.core.checks import FloatArray, choice, finite_array
from softrobots.core.errors import ParameterError


def arc_jacobian(arc: Arc, frame: str = "torsion_free") -> FloatArray:
    """Return the Jacobian of `transform` with respect to `(length, bending, azimuth)`.

    With `c_k` the Stumpff functions of `theta^2` and `n = (cos alpha, sin alpha, 0)`, `t = (-sin alpha, cos alpha, 0)`, the
    linear columns are `theta c_2 n + c_1 z`, `l ((c_1 - c_2) n + theta (c_3 - c_2) z)` and `l theta c_2 t`. The angular columns
    are 0, `t` and `z` in the bending-plane frame, where `R = Rz(alpha) Ry(theta)`; in the torsion-free frame the last is
    `z - R z`. These coordinates are polar: for a straight arc both frames have all three columns, but one or two of them are
    zero or depend on the azimuth.

    Args:
        arc: Arc of shape (...).
        frame: "torsion_free" or "bending_plane".

    Returns:
        Shape (..., 6, 3): linear rows [m/m, m/rad, m/rad], then angular rows [rad/m, -, -].

    Raises:
        ParameterError: If `arc` is not an `Arc` or the frame is unknown.
    """
    arc = checked_arc(arc)
    choice("frame", frame, FRAMES)
    theta, cosine, sine = arc.bending, np.cos(arc.azimuth), np.sin(arc.azimuth)
    c1, c2, c3, _ = _stumpff_1_to_4(theta)
    jacobian = np.zeros((*arc.shape, 6, 3))
    for row, part in ((0, cosine), (1, sine)):
        jacobian[..., row, 0] = theta * c2 * part
        jacobian[..., row, 1] = arc.length * (c1 - c2) * part
    jacobian[..., 2, 0] = c1
    jacobian[..., 2, 1] = arc.length * theta * (c3 - c2)
    jacobian[..., 0, 2], jacobian[..., 1, 2] = -arc.length * theta * c2 * sine, arc.length * theta * c2 * cosine
    jacobian[..., 3, 1], jacobian[..., 4, 1] = -sine, cosine
    if frame == "bending_plane":
        jacobian[..., 5, 2] = 1.0
    else:
        bend = np.sin(theta)
        jacobian[..., 3, 2], jacobian[..., 4, 2] = -bend * cosine, -bend * sine
        jacobian[..., 5, 2] = 2.0 * np.sin(theta / 2.0) ** 2
    return jacobian


def strain_jacobian(strains: Any) -> FloatArray:
    """Return the Jacobian of the torsion-free pose with respect to the section coordinates `(kx h, ky h, tau h, stretch h)`.

    With `w` the bending vector in base axes, the angular columns are those of `I + c_2 [w] + c_3 [w]^2`, the left Jacobian of
    the rotation group, and the linear ones are the derivatives of `p = l (c_1 z + c_2 w x z)`. Smooth everywhere. The twist
    column is the derivative at zero twist; its linear part is `l c_3 w`.

    Args:
        strains: As in `strains_from_arc`, shape (..., 4) [rad, rad, rad, m], twist zero.

    Returns:
        Shape (..., 6, 4): linear rows [m/rad, m/rad, m/rad, m/m], then angular rows [-, -, -, rad/m].

    Raises:
        ParameterError: If the shape is not (..., 4), a number is not finite, a twist is not zero, or a length is negative.
    """
    strains = checked_strains(strains)
    x, y, length = strains[..., 0], strains[..., 1], strains[..., 3]
    c1, c2, c3, c4 = _stumpff_1_to_4(np.hypot(x, y))
    slope = 2.0 * c4 - c3  # twice the derivative of c_2 with respect to theta^2
    jacobian = np.zeros((*x.shape, 6, 4))
    jacobian[..., 0, 0], jacobian[..., 0, 1] = length * slope * x * y, length * (c2 + slope * y**2)
    jacobian[..., 1, 0], jacobian[..., 1, 1] = -length * (c2 + slope * x**2), -length * slope * x * y
    jacobian[..., 2, 0], jacobian[..., 2, 1] = length * (c3 - c2) * x, length * (c3 - c2) * y
    jacobian[..., 0, 2], jacobian[..., 1, 2] = length * c3 * x, length * c3 * y
    jacobian[..., 0, 3], jacobian[..., 1, 3], jacobian[..., 2, 3] = c2 * y, -c2 * x, c1
    # 1 - c_3 y^2 = c_1 + c_3 x^2 etc.: sums instead of differences
    jacobian[..., 3, 0], jacobian[..., 4, 1], jacobian[..., 5, 2] = c1 + c3 * x**2, c1 + c3 * y**2, c1
    jacobian[..., 3, 1] = jacobian[..., 4, 0] = c3 * x * y
    jacobian[..., 3, 2], jacobian[..., 4, 2] = c2 * y, -c2 * x
    jacobian[..., 5, 0], jacobian[..., 5, 1] = -c2 * y, c2 * x
    return jacobian


def muscle_jacobian(
    lengths: Any, distance: Any, azimuths: Any = AZIMUTHS, frame: str = "torsion_free", tolerance: float = 1e-6
) -> FloatArray:
    """Return the Jacobian of the pose of a segment with respect to its muscle lengths.

    It is smooth at the straight configuration in the torsion-free frame. For more than three muscles it is that of the
    least-squares arc.

    Args:
        lengths: Muscle lengths [m], positive, shape (..., N).
        distance: Distance of the muscles from the backbone [m], positive, any shape that broadcasts with (...).
        azimuths: Azimuths of the muscles in the base frame of the segment [rad], shape (N,), N >= 3.
        frame: "torsion_free" or "bending_plane".
        tolerance: Largest `muscle_residual` of more than three muscles [m].

    Returns:
        Shape (..., 6, N): linear rows [m/m], then angular rows [rad/m].

    Raises:
        ParameterError: As `strains_from_muscles`; if the frame is unknown, or it is the bending-plane frame and a segment is
            straight.
    """
    return _muscle_columns(lengths, distance, azimuths, frame, tolerance)[1]


def chain_arc_jacobian(arcs: Arc | Sequence[Arc], offsets: Any = None, frame: str = "torsion_free") -> FloatArray:
    """Return the Jacobian of `chain_transform` with respect to `(length, bending, azimuth)` of each segment, base to tip.

    Args:
        arcs: One `Arc` a segment, base to tip, of shapes that broadcast to (...); or one `Arc` of shape (..., S).
        offsets: Angle about z before each segment [rad], shape (S,). Default: the paper's, 0 and then 60 degrees each.
        frame: "torsion_free" or "bending_plane".

    Returns:
        Shape (..., 6, 3 S), units as in `arc_jacobian`.

    Raises:
        ParameterError: As `chain_transforms`.
    """
    stacked = stack_arcs(arcs)
    return _at_tip(arc_jacobian(stacked, frame), *chain_frames(stacked, offsets, frame))


def chain_muscle_jacobian(
    lengths: Any,
    distance: Any,
    azimuths: Any = AZIMUTHS,
    offsets: Any = None,
    frame: str = "torsion_free",
    tolerance: float = 1e-6,
) -> FloatArray:
    """Return the Jacobian of the tip pose of a chain with respect to the muscle lengths of each segment, base to tip.

    Args:
        lengths: Muscle lengths [m], positive, shape (..., S, N).
        distance: Distance of the muscles from the backbone [m], positive, a number, one a segment, shape (S,), or any shape
            that broadcasts with (..., S).
        azimuths: Azimuths of the muscles, each segment's in its own base frame after the offset [rad], shape (N,), N >= 3.
        offsets: Angle about z before each segment [rad], shape (S,). Default: the paper's, 0 and then 60 degrees each.
        frame: "torsion_free" or "bending_plane".
        tolerance: Largest `muscle_residual` of more than three muscles [m].

    Returns:
        Shape (..., 6, S N): linear rows [m/m], then angular rows [rad/m].

    Raises:
        ParameterError: As `muscle_jacobian` and `chain_transforms`; if the lengths have no segment axis.
    """
    if finite_array("lengths", lengths, None, "m").ndim < 2:
        raise ParameterError("lengths", lengths, "of shape (..., S, N), one row a segment")
    arc, local = _muscle_columns(lengths, distance, azimuths, frame, tolerance)
    return _at_tip(local, *chain_frames(arc, offsets, frame))


def _stumpff_1_to_4(bending: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """`c_1` to `c_4` of the squared angle, the first two from sines: exact to rounding even where they vanish."""
    higher = stumpff(bending**2, 4)
    return cardinal_sine(bending), cardinal_sine(bending / 2.0) ** 2 / 2.0, higher[3], higher[4]


def _muscle_columns(lengths: Any, distance: Any, azimuths: Any, frame: str, tolerance: float) -> tuple[Arc, FloatArray]:
    """Arcs (...) and their muscle Jacobians (..., 6, N)."""
    choice("frame", frame, FRAMES)
    strains = strains_from_muscles(lengths, distance, azimuths, tolerance)
    arc = arc_from_strains(strains)
    jacobian, per_muscle = strain_jacobian(strains), strains_per_muscle(distance, azimuths)
    if frame == "torsion_free":
        return arc, jacobian @ per_muscle
    if np.any(arc.bending == 0.0):
        raise ParameterError(
            "lengths",
            lengths,
            "of bent segments in the bending-plane frame: the azimuth of a straight one has no derivative (use 'torsion_free')",
        )
    # The linear rows of both frames are the same. The angular rows are t d(theta) + z d(alpha), as in `arc_jacobian`; the twist
    # column does not matter, because muscles do not twist.
    cosine, sine = np.cos(arc.azimuth), np.sin(arc.azimuth)
    jacobian[..., 3, 0], jacobian[..., 4, 1] = sine**2, cosine**2
    jacobian[..., 3, 1] = jacobian[..., 4, 0] = -sine * cosine
    jacobian[..., 5, 0], jacobian[..., 5, 1] = -cosine / arc.bending, -sine / arc.bending
    return arc, jacobian @ per_muscle


def _at_tip(local: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Transform the Jacobians of the segments (..., S, 6, n) to base axes and to the tip point: shape (..., 6, S n)."""
    axes = starts[..., :3, :3]
    linear, angular = axes @ local[..., :3, :], axes @ local[..., 3:, :]
    lever = ends[..., -1:, :3, 3] - ends[..., :3, 3]
    linear = linear + np.cross(angular, lever[..., None], axis=-2)
    columns = np.moveaxis(np.concatenate([linear, angular], axis=-2), -3, -2)
    return columns.reshape(*columns.shape[:-2], columns.shape[-2] * columns.shape[-1])
