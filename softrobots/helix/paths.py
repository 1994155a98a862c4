r"""Curves of a helix: points, Frenet frames, curvature and torsion of the inner, centre and outer path.

In the frame of the helix, z along its axis, a path of radius `R` is

.. math:: p(s) = (R\cos s,\; \sigma R\sin s,\; b\,s), \qquad \sigma = +1 \text{ right-handed}, -1 \text{ left-handed}

with the turn angle `s`: equal `s` on the three paths is one cross-section of the tube. (The parametrisation (1) of
[Blumenschein 2018], `(R sin s, R cos s, b s)`, is left-handed, although its torsion (13) is printed positive.) Frames have x
along the normal, towards the axis as seen from the outer path, y along the binormal, z along the tangent. Curvature and torsion
are signed to match: `T' = kappa N`, `B' = -tau N`. So the curvature of an inner path beyond the axis is negative, and so is the
torsion of a left-handed helix.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, common_shape, finite_array
from softrobots.helix.shapes import PATHS, HelixShape, checked_actuator, checked_shape, length_ratio, turning_sign


def curvature_torsion(shape: HelixShape, path: str = "centre", handedness: str = "right") -> tuple[FloatArray, FloatArray]:
    r"""Return curvature and torsion of a path: [Blumenschein 2018] (13), with signs (see the module).

    .. math:: \kappa = R/(R^2 + b^2), \qquad \tau = \sigma\,b/(R^2 + b^2)

    Args:
        shape: The helix, shape (...).
        path: "inner", "centre" or "outer".
        handedness: "right" or "left".

    Returns:
        Curvature and torsion, each shape (...) [1/m].

    Raises:
        ParameterError: If `shape` is not a `HelixShape`, or path or handedness is unknown.
    """
    shape = checked_shape(shape)
    radius, sign = shape.radius(path), turning_sign(handedness)
    size = np.hypot(radius, shape.pitch)
    return np.asarray(radius / size / size), np.asarray(sign * (shape.pitch / size / size))


def actuator_curvature_torsion(
    contraction: Any, angle: Any, diameter: Any, path: str = "centre", handedness: str = "right"
) -> tuple[FloatArray, FloatArray]:
    r"""Return curvature and torsion of a path from the actuator: [Blumenschein 2018] (15), extended to the centre line.

    .. math:: \kappa_o = \frac{1 - \lambda\cos 2\theta}{D}, \; \tau_o = \frac{\lambda\sin 2\theta}{D}, \quad
       \kappa_i = \frac{\cos 2\theta - \lambda}{D\lambda}, \; \tau_i = \frac{\sin 2\theta}{D\lambda}, \quad
       \kappa_c = \frac{2(1 - \lambda^2)}{D|1 + \zeta|^2}, \; \tau_c = \frac{4\lambda\sin 2\theta}{D|1 + \zeta|^2}

    They hold for the straight tube too, which has no helix radius: (0, 0) at contraction 1 and angle 0.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        path: "inner", "centre" or "outer".
        handedness: "right" or "left".

    Returns:
        Curvature and torsion, each of the common shape of the arguments [1/m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    contractions, angles, diameters = checked_actuator(contraction, angle, diameter)
    choice("path", path, PATHS)
    shrink, twice = 1.0 - contractions, 2.0 * np.sin(angles) ** 2  # 1 - lambda and 1 - cos(2 theta), without cancellation
    sine = turning_sign(handedness) * np.sin(2.0 * angles)
    if path == "outer":
        return np.asarray((shrink + contractions * twice) / diameters), np.asarray(contractions * sine / diameters)
    if path == "inner":
        return np.asarray((shrink - twice) / (diameters * contractions)), np.asarray(sine / (diameters * contractions))
    scale = diameters * length_ratio(contractions, angles) ** 2
    return np.asarray(2.0 * shrink * (1.0 + contractions) / scale), np.asarray(4.0 * contractions * sine / scale)


def points(shape: HelixShape, s: Any, path: str = "centre", handedness: str = "right") -> FloatArray:
    """Return points of a path in the frame of the helix, z along its axis; see the module.

    Args:
        shape: The helix, shape (...).
        s: Turn angle, of a shape that broadcasts with that of the helix, e.g. (n,) for one helix [rad].
        path: "inner", "centre" or "outer".
        handedness: "right" or "left".

    Returns:
        Positions, the common shape and 3 [m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    shape, angles, radius, sign = _checked(shape, s, path, handedness)
    entries = (radius * np.cos(angles), sign * radius * np.sin(angles), shape.pitch * angles)
    return np.stack(np.broadcast_arrays(*entries), axis=-1)


def tangents(shape: HelixShape, s: Any, path: str = "centre", handedness: str = "right") -> FloatArray:
    """Return unit tangents of a path, rising; arguments, shapes and errors as in `points`."""
    return np.asarray(frames(shape, s, path, handedness)[..., :3, 2])


def normals(shape: HelixShape, s: Any, path: str = "centre", handedness: str = "right") -> FloatArray:
    """Return unit normals of a path, from the outer path towards the axis; arguments, shapes and errors as in `points`."""
    return np.asarray(frames(shape, s, path, handedness)[..., :3, 0])


def binormals(shape: HelixShape, s: Any, path: str = "centre", handedness: str = "right") -> FloatArray:
    """Return unit binormals of a path, tangent x normal; arguments, shapes and errors as in `points`."""
    return np.asarray(frames(shape, s, path, handedness)[..., :3, 1])


def frames(shape: HelixShape, s: Any, path: str = "centre", handedness: str = "right") -> FloatArray:
    """Return the Frenet frames of a path in the frame of the helix: x normal, y binormal, z tangent.

    The frames of the centre line are those of the sections of the equivalent chain. They follow the actuator, not the wall of
    the tube: see `material_twist`.

    Args:
        shape: The helix, shape (...).
        s: Turn angle, of a shape that broadcasts with that of the helix [rad].
        path: "inner", "centre" or "outer".
        handedness: "right" or "left".

    Returns:
        Poses, the common shape and (4, 4) [m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    shape, angles, radius, sign = _checked(shape, s, path, handedness)
    size = np.hypot(radius, shape.pitch)
    along, across = shape.pitch / size, radius / size
    sine, cosine = np.sin(angles), np.cos(angles)
    columns = (
        (-cosine, -sign * sine, 0.0),
        (sign * along * sine, -along * cosine, sign * across),  # T x N
        (-across * sine, sign * across * cosine, along),
        (radius * cosine, sign * radius * sine, shape.pitch * angles),
    )
    poses = np.zeros((*np.broadcast_shapes(angles.shape, shape.shape), 4, 4))
    for column, entries in enumerate(columns):
        for row, entry in enumerate(entries):
            poses[..., row, column] = entry
    poses[..., 3, 3] = 1.0
    return poses


def transform_base_to_axis(shape: HelixShape, handedness: str = "right") -> FloatArray:
    """Return the pose of the base of the tube in the frame of the helix: the frame of the centre line at turn angle 0.

    Args:
        shape: The helix, shape (...).
        handedness: "right" or "left".

    Returns:
        Pose, shape (..., 4, 4) [m]: z along the tube, x towards the axis of the helix.

    Raises:
        ParameterError: If `shape` is not a `HelixShape`, or the handedness is unknown.
    """
    return frames(shape, 0.0, "centre", handedness)


def turn_angle(shape: HelixShape, arc_length: Any, path: str = "centre") -> FloatArray:
    """Return the turn angle at an arc length of a path, `s = length / sqrt(R^2 + b^2)`.

    Args:
        shape: The helix, shape (...).
        arc_length: Length along the path, of a shape that broadcasts with that of the helix [m].
        path: "inner", "centre" or "outer".

    Returns:
        Turn angle, the common shape [rad].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    shape, lengths, radius, _ = _checked(shape, arc_length, path, "right", "arc_length")
    return np.asarray(lengths / np.hypot(radius, shape.pitch))


def _checked(
    shape: Any, parameter: Any, path: str, handedness: str, name: str = "s"
) -> tuple[HelixShape, FloatArray, FloatArray, float]:
    """The helix, turn angle or length, radius of the path, and sign of the turning."""
    shape = checked_shape(shape)
    values = finite_array(name, parameter, None, "m" if name == "arc_length" else "rad")
    common_shape(name, values.shape, shape.shape)
    return shape, values, shape.radius(path), turning_sign(handedness)
