"""Springs: energy, torque and tangent of the elastic coordinates, linear or by the law of an inflated link beyond wrinkling."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.urdf_tags import InflatedLinkTag
from softrobots.inflated_beam.membrane_tube import softening, softening_start

POSITIVE = 1e-9
"""Smallest eigenvalue of a tangent stiffness that counts as positive, relative to the springs' own stiffness."""

SpringState = tuple[float, FloatArray, FloatArray]
"""Springs at given coordinates: elastic energy [J]; the load they carry, its derivative, shape (n,) [N m or N]; and the tangent
stiffness, the derivative of that, shape (n, n), read-only."""


@dataclass(frozen=True)
class SpringGroup:
    """The springs that stand for one inflated link, at one hinge or more."""

    springs: tuple[int, ...]
    """Places in `SoftModel.spring_joints` of those that bend it, hinge after hinge."""
    radius: float
    """Tube radius [m]."""
    pressure: float
    """Gauge pressure [Pa]."""
    segment: int | None = None
    """Number of the segment, if the group is one of its sections."""
    max_moment: float | None = None
    """Moment of the plateau, beyond wrinkling [N m]; None: there is none."""
    n_hinges: int = 1
    """Number of hinges, each with as many of the springs."""
    twist: int | None = None
    """Place of the spring that twists it, or None."""
    slack_wall: bool = False
    """Whether the moment follows the wall as it goes slack, `inflated_beam.slack_wall_moment`."""

    @property
    def hinges(self) -> tuple[tuple[int, ...], ...]:
        """The places by hinge, base to tip."""
        each = len(self.springs) // self.n_hinges
        return tuple(self.springs[first : first + each] for first in range(0, len(self.springs), each))

    def moments(self, torques: FloatArray) -> FloatArray:
        """Return the moment at each hinge, the Euclidean norm over its springs.

        Args:
            torques: Load carried by each spring of the robot, shape (..., n_springs) [N m].

        Returns:
            Moments, shape (..., n_hinges) [N m].
        """
        return np.stack([np.linalg.norm(torques[..., list(hinge)], axis=-1) for hinge in self.hinges], axis=-1)

    @cached_property
    def slack_moment(self) -> float:
        """Moment at which the first fibre of the wall goes slack, without axial force [N m]."""
        return float(inflated_beam.moment_limits(self.pressure, self.radius).slack)

    @property
    def linear_up_to(self) -> float | None:
        """Moment up to which the law is linear: the plateau, or that of the first slack fibre [N m]; None: it always is."""
        return self.slack_moment if self.slack_wall else self.max_moment

    @property
    def largest_moment(self) -> float | None:
        """Moment that no bend exceeds: the plateau, or collapse with a slack wall, `pi p r^3` [N m]; None if linear."""
        return 2.0 * self.slack_moment if self.slack_wall else self.max_moment

    @property
    def wrinkling_moment(self) -> float:
        """Moment of the first wrinkle [N m], [Troise 2021] (3); an upper bound for a section of a helical tube.

        It is that of a straight tube; the wall along an actuator is slack before any load.
        """
        return float(inflated_beam.wrinkling_moment(self.pressure, self.radius))


class _Softened(NamedTuple):
    """A hinge of an inflated link beyond the linear part of its law."""

    places: tuple[int, ...]
    """Places of its springs among the elastic coordinates."""
    stiffness: float
    """Stiffness of each of them near rest [N m/rad]."""
    angles: list[float]
    """Angle of each spring from rest [rad]."""
    bend: float
    """Norm of the angles [rad]."""
    moment: float
    """Moment along the bend [N m]."""
    tangent: float
    """Its derivative with respect to the bend [N m/rad]."""
    missing: float
    """What linear springs would store more [J]."""


@dataclass(frozen=True, eq=False)
class Springs:
    r"""Springs of the elastic coordinates: independent and linear, but for inflated links with another law of their moment.

    A linear spring has :math:`\tau = k (y - y_0)`, [Troise 2021] (2). The moment of an inflated link is, at each of its hinges,
    a law of the angle along the direction in which it is bent, the same in all directions because the tube is round: with the
    angles `s = y - rest` of the springs of a hinge and :math:`\rho = |s|`,

    .. math:: \tau = M(\rho) \, s / \rho, \qquad U = \int_0^\rho M \, d\rho

    and the tangent is `dM/drho` along `s` and :math:`M / \rho` across. A *plateau* has :math:`M = \min(k \rho, M_{max})`,
    `inflated_beam.moment`: its tangent jumps at the knee; torque and energy do not. A *slack wall* is
    `inflated_beam.slack_wall_moment`: torque and tangent are continuous, and the tangent is positive.
    """

    names: tuple[str, ...]
    """Name of each coordinate."""
    stiffness: FloatArray
    """Stiffness near rest, shape (n,) [N m/rad or N/m]."""
    rest: FloatArray
    """Relaxed coordinates, shape (n,) [rad or m]."""
    turning: Any
    """Which coordinates are angles rather than distances, shape (n,), truth values."""
    groups: tuple[SpringGroup, ...] = ()
    """The springs of each inflated link, with the law of their moment."""

    @cached_property
    def linear(self) -> bool:
        """Whether the moment of every link is linear."""
        return all(group.linear_up_to is None for group in self.groups)

    def at(self, y: FloatArray) -> SpringState:
        """Return energy, torque and tangent at coordinates `y`, shape (n,) [rad or m]."""
        stretch = y - self.rest
        torque = self.stiffness * stretch
        energy, tangent = 0.5 * float(torque.dot(stretch)), self._tangent
        if self.linear:
            return energy, torque, tangent
        softened = self._softened(y)
        if softened:
            tangent = tangent.copy()
        for hinge in softened:
            energy -= hinge.missing
            across = hinge.moment / hinge.bend
            bending = (hinge.tangent - across) / (hinge.bend * hinge.bend)
            for row, one in zip(hinge.places, hinge.angles, strict=True):
                torque[row] = hinge.moment * (one / hinge.bend)
                tangent[row, row] += across - hinge.stiffness
                for column, other in zip(hinge.places, hinge.angles, strict=True):
                    tangent[row, column] += bending * (one * other)
        return energy, torque, read_only(tangent)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each elastic coordinate, rad or m."""
        return tuple("rad" if turns else "m" for turns in self.turning.tolist())

    def saturated(self, y: FloatArray) -> frozenset[int]:
        """Return the places of the springs whose hinge is on its plateau at coordinates `y`, shape (n,)."""
        return frozenset(place for hinge in self._softened(y) if hinge.tangent == 0.0 for place in hinge.places)

    def beyond_plateaus(self, y: FloatArray) -> FloatArray:
        """Return how far each hinge with a plateau is bent beyond its knee, negative before it, shape (n_hinges,) [rad]."""
        return np.array(
            [
                math.hypot(*(float(y[place] - self.rest[place]) for place in hinge))
                - group.max_moment / self.stiffness[hinge[0]]
                for group in self.groups
                if group.max_moment is not None
                for hinge in group.hinges
            ]
        )

    def torques(self, y: FloatArray) -> FloatArray:
        """Return the load that the springs carry at many coordinates `y`, shape (..., n) [N m or N]."""
        stretch = y - self.rest
        torques: FloatArray = self.stiffness * stretch
        for group in self.groups:
            for hinge in group.hinges if group.largest_moment is not None else ():
                places, stiffness = list(hinge), float(self.stiffness[hinge[0]])
                bend = np.linalg.norm(stretch[..., places], axis=-1)
                if group.slack_wall:
                    moment = inflated_beam.slack_wall_moment(bend, stiffness=stiffness, slack_moment=group.slack_moment).moment
                else:
                    moment = inflated_beam.moment(bend, stiffness=stiffness, max_moment=group.max_moment)
                share = np.where(bend > 0.0, moment / np.where(bend > 0.0, stiffness * bend, 1.0), 1.0)
                torques[..., places] *= share[..., None]
        return torques

    @cached_property
    def least_tangent(self) -> FloatArray:
        """`stiffness` times `POSITIVE` as a diagonal matrix, shape (n, n), read-only: what a stable tangent exceeds."""
        return read_only(POSITIVE * self._tangent)

    @cached_property
    def _tangent(self) -> FloatArray:
        return read_only(np.diag(self.stiffness))

    def _softened(self, y: FloatArray) -> list[_Softened]:
        """The hinges beyond the linear part of their law at coordinates `y`."""
        softened = []
        for group in self.groups:
            first = group.linear_up_to
            if first is None:
                continue
            stiffness = float(self.stiffness[group.springs[0]])
            for hinge in group.hinges:
                angles = [float(y[place] - self.rest[place]) for place in hinge]
                bend = math.hypot(*angles)
                if stiffness * bend <= first:
                    continue
                law = first, 0.0, 0.5 * stiffness * (bend - first / stiffness) ** 2  # a plateau
                if group.slack_wall:
                    ratio = stiffness * bend / first
                    moment, tangent, energy, _ = softening(ratio, *softening_start(ratio))
                    law = first * moment, stiffness * tangent, first**2 / stiffness * (0.5 * ratio**2 - energy)
                softened.append(_Softened(hinge, stiffness, angles, bend, *law))
        return softened


def spring_groups(
    links: Sequence[InflatedLinkTag], springs: Springs, joints: Collection[str], segments: Mapping[str, int]
) -> tuple[SpringGroup, ...]:
    """Group the springs of each inflated link.

    Args:
        links: The inflated links. One that lacks a spring, because the caller has taken it away, has no group.
        springs: The springs of the elastic coordinates.
        joints: The spring joints of the robot.
        segments: Number of the segment by joint and section coordinate, for those of sections.

    Returns:
        The groups, in the order of the links.

    Raises:
        DescriptionError: If the springs of a link whose moment is not linear differ in stiffness, or are not all elastic
            coordinates by themselves (sections of constant strain, and hinges that muscle lengths constrain, are not).
    """
    groups, names = [], springs.names
    for link in links:
        places = tuple(names.index(name) for name in link.springs if name in names)
        if (link.slack_wall or link.max_moment is not None) and (places or any(name in joints for name in link.springs)):
            _check_springs(link, springs, joints)
        if len(places) == len(link.springs):
            twist = names.index(link.twist) if link.twist in names else None
            segment = segments.get(link.springs[0])
            law = link.max_moment, link.hinges, twist, link.slack_wall
            groups.append(SpringGroup(places, link.radius, link.pressure, segment, *law))
    return tuple(groups)


def _check_springs(link: InflatedLinkTag, springs: Springs, joints: Collection[str]) -> None:
    law = "moment_law slack_wall" if link.max_moment is None else f"max_moment {link.max_moment} N m"
    subject = f"the inflated_link of {' '.join(link.springs)} has {law}"
    names = [name for name in springs.names if name in joints]
    for name in link.springs:
        if name not in names:
            what = f"{name} is {'constrained by muscle lengths' if name in joints else 'none'}"
            available = ", ".join(names) or "none"
            raise DescriptionError(f"{subject}; its springs must be joints with a spring each; {what}; available: {available}")
    stiffness = [float(springs.stiffness[springs.names.index(name)]) for name in link.springs]
    if len(set(stiffness)) != 1:
        raise DescriptionError(
            f"{subject}, the same in all directions; its springs must have the same stiffness, not "
            f"{', '.join(map(str, stiffness))} N m/rad"
        )
