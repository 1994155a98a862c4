r"""Muscle kinematics of a segment: muscle lengths from an arc, and the arc from muscle lengths.

Muscle `i` runs parallel to the backbone at the distance `d` and the azimuth `phi_i` of the cross-section, so that it bends with
the radius `r - d cos(alpha - phi_i)`:

.. math:: l_i = l - \theta d \cos(\alpha - \phi_i)

[PCC paper] (20)-(22). This is linear in the backbone length and the bending vector: three muscles determine an arc, more than
three overdetermine it. The backbone is extensible. The paper does not publish `d`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.constant_curvature.arcs import Arc, arc_from_strains, checked_arc
from softrobots.core.checks import FloatArray, common_shape, finite_array, non_negative_number, positive_array
from softrobots.core.errors import ParameterError
from softrobots.core.suspicion import question

AZIMUTHS = (0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0)
"""Azimuths of the three muscles of [PCC paper], figure 9 [rad]."""

_FOUR_TURNS = 8.0 * math.pi
_SLENDER = 500.0  # times the distance of its muscles, from which on a segment is hardly in the same unit
SAME_AZIMUTH = 1e-9  # [rad]
LARGEST_CONDITION = 1e6  # condition number of the map from arc to muscle lengths; beyond, more than six digits are lost


def muscles_from_arc(arc: Arc, distance: Any, azimuths: Any = AZIMUTHS) -> FloatArray:
    """Return the lengths of the muscles of a segment: `l_i = l - theta d cos(alpha - phi_i)`, [PCC paper] (20)-(22).

    Args:
        arc: Arc of shape (...).
        distance: Distance `d` of the muscles from the backbone [m], positive, any shape that broadcasts with (...).
        azimuths: Azimuths `phi_i` of the muscles in the base frame of the segment [rad], shape (N,), N >= 3.

    Returns:
        Lengths [m], shape (..., N).

    Raises:
        ParameterError: If `arc` is not an `Arc`, the distance is not positive, two azimuths are equal (modulo a turn), there
            are fewer than three or they are too close together, shapes do not broadcast, or the arc is bent so sharply that a
            muscle length is not positive.
    """
    arc = checked_arc(arc)
    distance = positive_array("distance", distance, "m")
    azimuths = _checked_azimuths(azimuths)
    common_shape("distance", arc.shape, distance.shape)
    reach = (arc.bending * distance)[..., None]
    lengths: FloatArray = arc.length[..., None] - reach * np.cos(arc.azimuth[..., None] - azimuths)
    if np.any(lengths <= 0.0):
        raise ParameterError("arc", arc, f"one whose muscles have positive lengths (the shortest has {lengths.min():.6g} m)")
    return lengths


def strains_from_muscles(lengths: Any, distance: Any, azimuths: Any = AZIMUTHS, tolerance: float = 1e-6) -> FloatArray:
    """Return the section coordinates of a segment from its muscle lengths: bending vector and backbone length.

    Least-squares solution of `l_i = l + d (kx h sin(phi_i) - ky h cos(phi_i))`, exact for three muscles. It uses the
    differences `l_i - l_1`, so that no digits are lost near the straight configuration.

    Args:
        lengths: Muscle lengths [m], positive, shape (..., N).
        distance: Distance `d` of the muscles from the backbone [m], positive, any shape that broadcasts with (...).
        azimuths: Azimuths of the muscles in the base frame of the segment [rad], shape (N,), N >= 3.
        tolerance: Largest `muscle_residual` of more than three muscles [m]; three always determine an arc.

    Returns:
        `(kx h, ky h, 0, l)` as in `strains_from_arc`, shape (..., 4) [rad, rad, rad, m].

    Raises:
        ParameterError: If lengths or distance are not positive, azimuths are wrong as in `muscles_from_arc`, counts or shapes
            differ, no arc fits the lengths within the tolerance, or its backbone length would not be positive.
    """
    lengths, distance, azimuths = _checked_muscles(lengths, distance, azimuths)
    tolerance = non_negative_number("tolerance", tolerance, "m")
    differences, fitted = _fit(lengths, azimuths)
    worst = float(np.max(_residual(differences, fitted, azimuths), initial=0.0)) if len(azimuths) > 3 else 0.0
    if worst > tolerance:
        raise ParameterError("lengths", lengths, f"those of an arc within {tolerance:g} m (they miss it by {worst:.6g} m)")
    backbone = lengths[..., 0] + fitted[..., 2]
    if np.any(backbone <= 0.0):
        raise ParameterError("lengths", lengths, f"those of a backbone of positive length (it has {backbone.min():.6g} m)")
    strains = np.zeros((*np.broadcast_shapes(backbone.shape, distance.shape), 4))
    strains[..., 0] = fitted[..., 0] / distance
    strains[..., 1] = fitted[..., 1] / distance
    strains[..., 3] = backbone
    return strains


def arc_from_muscles(lengths: Any, distance: Any, azimuths: Any = AZIMUTHS, tolerance: float = 1e-6) -> Arc:
    """Return the arc of the muscle lengths; with the default azimuths [PCC paper] (34), (39) and (41).

    For the paper's three muscles `l = (l1 + l2 + l3)/3`, `theta = hypot(l2 + l3 - 2 l1, sqrt(3) (l2 - l3)) / (3 d)` and
    `alpha = atan2(sqrt(3) (l2 - l3), l2 + l3 - 2 l1)`. The paper's (34) prints a plain arctangent, which loses the quadrant.
    Its (41) takes the root of `l1^2 + l2^2 + l3^2 - l1 l2 - l1 l3 - l2 l3`, the same number, but that sum of large terms
    cancels near the straight configuration and loses half the digits or all; the differences above lose none.

    More than four turns of a segment longer than 500 distances, as lengths in centimetres and a distance in m give, issue a
    `SuspiciousInputWarning`.

    Args:
        lengths: Muscle lengths [m], positive, shape (..., N).
        distance: Distance `d` of the muscles from the backbone [m], positive, any shape that broadcasts with (...).
        azimuths: Azimuths of the muscles in the base frame of the segment [rad], shape (N,), N >= 3.
        tolerance: Largest `muscle_residual` of more than three muscles [m]; three always determine an arc.

    Returns:
        Arc of shape (...), azimuth in (-pi, pi], 0 when straight.

    Raises:
        ParameterError: As `strains_from_muscles`.
    """
    arc = arc_from_strains(strains_from_muscles(lengths, distance, azimuths, tolerance))
    most = float(arc.bending.max(initial=0.0))
    if most > _FOUR_TURNS and np.any(arc.length > _SLENDER * np.asarray(distance)):
        turns = most / (2.0 * math.pi)
        question(f"lengths bend a segment by {most:.4g} rad, {turns:.3g} turns: are lengths and distance in m?")
    return arc


def muscle_residual(lengths: Any, distance: Any, azimuths: Any = AZIMUTHS) -> FloatArray:
    """Return the largest difference between the muscle lengths and those of the least-squares arc.

    It measures the consistency of the lengths of more than three muscles; for three it is zero up to rounding. It does not
    depend on the distance, which is only checked.

    Args:
        lengths: Muscle lengths [m], positive, shape (..., N).
        distance: Distance of the muscles from the backbone [m], positive, any shape that broadcasts with (...).
        azimuths: Azimuths of the muscles in the base frame of the segment [rad], shape (N,), N >= 3.

    Returns:
        The difference [m], shape (...).

    Raises:
        ParameterError: If lengths or distance are not positive, azimuths are wrong as in `muscles_from_arc`, or counts or
            shapes differ.
    """
    lengths, distance, azimuths = _checked_muscles(lengths, distance, azimuths)
    residual = _residual(*_fit(lengths, azimuths), azimuths)
    return np.array(np.broadcast_to(residual, np.broadcast_shapes(residual.shape, distance.shape)))


def strains_per_muscle(distance: Any, azimuths: Any) -> FloatArray:
    """Return the constant Jacobian of `strains_from_muscles` in the lengths, shape (..., 4, N) [rad/m, rad/m, rad/m, -]."""
    distance = positive_array("distance", distance, "m")[..., None]
    weights = _weights(_checked_azimuths(azimuths))
    matrix = np.zeros((*distance.shape[:-1], 4, weights.shape[1]))
    matrix[..., 0, :] = weights[0] / distance
    matrix[..., 1, :] = weights[1] / distance
    matrix[..., 3, :] = weights[2]
    return matrix


def _checked_azimuths(azimuths: Any) -> FloatArray:
    """Return the azimuths, shape (N,), if muscles there determine an arc."""
    checked = finite_array("azimuths", azimuths, (None,), "rad")
    if len(checked) < 3:
        raise ParameterError("azimuths", azimuths, "at least three")
    ordered = np.sort(np.mod(checked, 2.0 * np.pi))
    gaps = np.append(np.diff(ordered), ordered[0] + 2.0 * np.pi - ordered[-1])
    if np.any(gaps < SAME_AZIMUTH):
        raise ParameterError("azimuths", azimuths, "distinct modulo a turn")
    condition = float(np.linalg.cond(_design(checked)))
    if condition > LARGEST_CONDITION:
        raise ParameterError("azimuths", azimuths, f"spread further around the backbone (condition number {condition:.3g})")
    return checked


def _checked_muscles(lengths: Any, distance: Any, azimuths: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return lengths (..., N), distance and azimuths (N,), if they determine an arc and the shapes broadcast."""
    azimuths = _checked_azimuths(azimuths)
    distance = positive_array("distance", distance, "m")
    checked = positive_array("lengths", lengths, "m")
    if checked.ndim == 0 or checked.shape[-1] != len(azimuths):
        raise ParameterError("lengths", lengths, f"of shape (..., {len(azimuths)}), one a muscle (not {checked.shape})")
    common_shape("distance", checked.shape[:-1], distance.shape)
    return checked, distance, azimuths


def _design(azimuths: FloatArray) -> FloatArray:
    """Matrix from `(d kx h, d ky h, l)` to the muscle lengths, shape (N, 3)."""
    return np.stack([np.sin(azimuths), -np.cos(azimuths), np.ones_like(azimuths)], axis=-1)


def _weights(azimuths: FloatArray) -> FloatArray:
    """Matrix from the muscle lengths to `(d kx h, d ky h, l)`, shape (3, N): least squares, or the paper's closed form."""
    if np.array_equal(azimuths, AZIMUTHS):
        slant = math.sqrt(3.0)
        return np.array([[0.0, -slant, slant], [-2.0, 1.0, 1.0], [1.0, 1.0, 1.0]]) / 3.0
    return np.asarray(np.linalg.pinv(_design(azimuths)))


def _fit(lengths: FloatArray, azimuths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Differences to the first muscle, shape (..., N), and their fit `(d kx h, d ky h, l - l_1)`, shape (..., 3)."""
    differences = lengths - lengths[..., :1]
    return differences, _mapped(_weights(azimuths), differences)


def _mapped(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    """Product of a matrix, shape (m, n), and vectors, shape (..., n): (..., m).

    Products first, then the sum: a fused multiply-add would give a small azimuth where two lengths are equal. Summed over whole
    columns: a NumPy sum over a last axis of three takes three times as long.
    """
    result = matrix[:, 0] * vectors[..., :1]
    for column in range(1, matrix.shape[1]):
        result += matrix[:, column] * vectors[..., column, None]
    return result


def _residual(differences: FloatArray, fitted: FloatArray, azimuths: FloatArray) -> FloatArray:
    missed = differences - _mapped(_design(azimuths), fitted)
    return np.asarray(np.max(np.abs(missed), axis=-1))
