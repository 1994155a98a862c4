"""Muscles beside an element of a chain, traced: lengths beyond their linear part, with derivatives.

The equations are in `softrobots.model.muscle_paths`. Tensions act on an element with the slopes and curvatures of the lengths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import constants, outer, vector
from softrobots.compiled.trace.expressions import Scalar, smaller, square_root

SHORTEST = 1e-3
"""Length of a muscle along a section without twist at the end of its range, relative to the rest length of the section."""


@dataclass
class ElementMuscle:
    """A muscle beside an element; numbers are constants or table entries."""

    number: int
    """Its number in its segment."""
    arms: list[Scalar]
    """Derivative of its length without twist by each coordinate of the element [m/rad or -]."""
    distance: Scalar
    """Distance from the backbone [m]."""
    length: Scalar
    """Rest length of the section [m]."""
    twist: Scalar
    """Twist of a lumped section where the coordinate is zero [rad]."""
    twists: bool
    """Whether the element has the twist of the section among its coordinates."""
    shares: list[Scalar]
    """Derivative of the constrained sums of the segment by its length; empty if its tension is given."""


@dataclass
class Pulls:
    """What the muscles do to an element of `k` coordinates in a segment with `n` constrained sums."""

    energy: Scalar
    """Energy of given tensions; with given lengths minus that of the preload on the excess [J]."""
    load: Any
    """Derivative of that by the coordinates, shape (k,)."""
    curvature: Any
    """Second derivative of the lengths times the tensions, shape (k, k)."""
    constrained: Any
    """What twist adds to the derivative of the constrained sums, shape (n, k)."""
    excess: Any
    """What twist adds to the constrained sums, shape (n,)."""
    margin: Scalar | None
    """Distance from the end of the range of the muscles, positive within [m]; None for joints."""


def pulls_on(
    muscles: Sequence[ElementMuscle],
    coordinates: Sequence[Scalar],
    tensions: Sequence[Scalar],
    preload: Sequence[Scalar],
    constraints: int,
) -> Pulls:
    """Trace the muscles beside a section, or beside a joint of a lumped one.

    With given lengths the multipliers carry the tensions, and the springs are measured from the start: then the energy and the
    load are those of the preload, the tension that the start of the springs accounts for, on the excess alone.

    Args:
        muscles: The muscles.
        coordinates: The coordinates of the element [rad or m].
        tensions: Tension of each muscle of the segment [N].
        preload: Part of it that the start accounts for, with given lengths [N].
        constraints: Number of constrained sums.
    """
    size = len(coordinates)
    load, curvature = constants(np.zeros(size)), constants(np.zeros((size, size)))
    pulls = Pulls(0.0, load, curvature, constants(np.zeros((constraints, size))), constants(np.zeros(constraints)), None)
    for muscle in muscles:
        path = _section_path(muscle, coordinates) if size == 4 else _joint_path(muscle, coordinates[0])
        tension, arms = tensions[muscle.number], vector(muscle.arms)
        if path.margin is not None:
            pulls.margin = path.margin if pulls.margin is None else smaller(pulls.margin, path.margin)
        slopes = arms * path.stretch_slope + path.twist_arms * path.twist_slope
        if muscle.shares:
            pulls.energy = pulls.energy - preload[muscle.number] * path.excess
            pulls.load = pulls.load - slopes * preload[muscle.number]
        else:
            pulls.energy = pulls.energy + tension * (arms @ vector(coordinates) + path.excess)
            pulls.load = (
                pulls.load + arms * (tension * (path.stretch_slope + 1.0)) + path.twist_arms * (tension * path.twist_slope)
            )
        for sum_, share in enumerate(muscle.shares):
            pulls.constrained[sum_] = pulls.constrained[sum_] + slopes * share
            pulls.excess[sum_] = pulls.excess[sum_] + path.excess * share
        pulls.curvature = pulls.curvature + path.curvature(tension, arms)
    return pulls


@dataclass
class _Path:
    """A muscle beside an element; its excess depends on stretch along the arms and on twist."""

    excess: Scalar
    """Length beyond the linear part [m]."""
    stretch_slope: Scalar
    """Derivative of the excess by the linear part."""
    twist_slope: Scalar
    """Derivative by the twist times the twist arms."""
    twist_arms: Any
    """Distance at the place of the twist, zeros elsewhere, shape (k,)."""
    back: Scalar
    """One over the length, or zero without curvature [1/m]."""
    margin: Scalar | None
    """Distance from the end of the range [m]."""

    def curvature(self, tension: Scalar, arms: Any) -> Any:
        """Second derivative of the length times a tension, shape (k, k); the tension first, so that little is kept."""
        pull = tension * self.back
        sine, cosine = self.twist_slope, self.stretch_slope + 1.0
        mixed = outer(arms, self.twist_arms) * (pull * sine * cosine)
        twisting = outer(self.twist_arms, self.twist_arms) * (pull * cosine * cosine)
        return outer(arms, arms) * (pull * sine * sine) - mixed - mixed.T + twisting


def _section_path(muscle: ElementMuscle, z: Sequence[Scalar]) -> _Path:
    """The helix beside a section: with `A` along it and `d t` around it, the length is their hypotenuse."""
    along = muscle.length + vector(muscle.arms) @ vector(z)
    margin = along - muscle.length * SHORTEST
    if isinstance(z[2], float) and z[2] == 0.0:  # the twist is locked
        return _Path(0.0, 0.0, 0.0, constants(np.zeros(4)), 0.0, margin)
    across = muscle.distance * z[2]
    size = square_root(along * along + across * across)
    back = 1.0 / size
    excess = across * across / (size + along)
    arms = vector([0.0, 0.0, muscle.distance, 0.0])
    return _Path(excess, -excess * back, across * back, arms, back, margin)


def _joint_path(muscle: ElementMuscle, coordinate: Scalar) -> _Path:
    """The muscle beside a joint of a lumped section: the excess is that of its twist, to second order."""
    if not muscle.twists:
        return _Path(0.0, 0.0, 0.0, constants([0.0]), 0.0, None)
    across, back = (coordinate + muscle.twist) * muscle.distance, 1.0 / muscle.length
    rest = muscle.twist * muscle.distance
    return _Path((across * across - rest * rest) * back * 0.5, 0.0, across * back, vector([muscle.distance]), back, None)
