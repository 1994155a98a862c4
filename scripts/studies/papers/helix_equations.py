"""Equations of [Blumenschein 2018] as printed: helices, their constraints, the closed form and what is measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray


class Shape(NamedTuple):
    """Outer and inner radius and normalised pitch of helices, arrays of one shape."""

    outer: FloatArray
    """`Ro` [m]."""
    inner: FloatArray
    """`Ri` [m]."""
    pitch: FloatArray
    """`b` [m/rad]."""


def path(radius: FloatArray, pitch: FloatArray, s: FloatArray) -> FloatArray:
    """(1), (3), (4): `(R sin s, R cos s, b s)`, shape (n, 3) [m]."""
    return np.stack([radius * np.sin(s), radius * np.cos(s), pitch * s], axis=-1)


def tangent(radius: FloatArray, pitch: FloatArray, s: FloatArray) -> FloatArray:
    """(8): unit tangent, shape (n, 3)."""
    size = np.sqrt(pitch**2 + radius**2)
    return np.stack([radius * np.cos(s), -radius * np.sin(s), pitch * np.ones_like(s)], axis=-1) / size[..., None]


def normal(s: FloatArray) -> FloatArray:
    """(9): unit normal, shape (n, 3)."""
    return np.stack([-np.sin(s), -np.cos(s), np.zeros_like(s)], axis=-1)


def actuator_angle(diameter: FloatArray, pitch: FloatArray) -> FloatArray:
    """(2): angle of an actuator of normalised pitch `b_a` on a tube, `arctan(D / (2 b_a))` [rad]."""
    return np.asarray(np.arctan(diameter / (2 * pitch)))


def contraction(shape: Shape) -> FloatArray:
    """(6): `lambda`."""
    return np.asarray(np.sqrt(shape.pitch**2 + shape.inner**2) / np.sqrt(shape.pitch**2 + shape.outer**2))


def diameter(shape: Shape) -> FloatArray:
    """(7): `D` [m]."""
    return np.asarray(shape.outer - shape.inner)


def cosine(shape: Shape) -> FloatArray:
    """(11): `cos 2 theta`."""
    sizes = np.sqrt(shape.pitch**2 + shape.inner**2) * np.sqrt(shape.pitch**2 + shape.outer**2)
    return np.asarray((shape.inner * shape.outer + shape.pitch**2) / sizes)


def forward(share: FloatArray, angle: FloatArray, tube: FloatArray) -> Shape:
    """(12): the shape that an actuator makes."""
    below = 1 + share**2 - 2 * share * np.cos(2 * angle)
    outer = tube * (1 - share * np.cos(2 * angle)) / below
    return Shape(outer, tube * share * (np.cos(2 * angle) - share) / below, tube * share * np.sin(2 * angle) / below)


def curvature_torsion(radius: FloatArray, pitch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(13): curvature and torsion of a path [1/m, rad/m]."""
    return np.asarray(radius / (pitch**2 + radius**2)), np.asarray(pitch / (pitch**2 + radius**2))


def curvatures_torsions(share: FloatArray, angle: FloatArray, tube: FloatArray) -> tuple[FloatArray, ...]:
    """(15): `kappa_o`, `tau_o`, `kappa_i`, `tau_i` [1/m, rad/m]."""
    cosine, sine = np.cos(2 * angle), np.sin(2 * angle)
    outer = (1 - share * cosine) / tube, share * sine / tube
    return (*outer, (cosine - share) / (tube * share), sine / (tube * share))


def from_arcs(outer_arc: float, inner_arc: float, tube: float) -> Shape:
    """(16): the shape from the arcs of a turn, with `Ro = m - D/2` and `Ri = m - 3 D/2`."""
    middle = (outer_arc**2 - inner_arc**2) / (8 * np.pi**2 * tube)
    outer = middle - tube / 2
    return Shape(
        np.asarray(outer), np.asarray(middle - 3 * tube / 2), np.sqrt(np.asarray(outer_arc**2 / (4 * np.pi**2) - outer**2))
    )


def turn_length(radius: FloatArray, pitch: FloatArray) -> FloatArray:
    """(17): length of a turn of a path [m]."""
    return np.asarray(np.sqrt((2 * np.pi * radius) ** 2 + (2 * np.pi * pitch) ** 2))
