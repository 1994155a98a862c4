"""Springs: energy, torque and tangent of the elastic coordinates, linear or with the plateau of a wrinkled inflated link."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.urdf_tags import InflatedLinkTag

POSITIVE = 1e-9
"""Smallest eigenvalue of a tangent stiffness that counts as positive, relative to the springs' own stiffness."""


SpringState = tuple[float, FloatArray, FloatArray]
"""Springs at given coordinates: elastic energy [J]; the load they carry, its derivative, shape (n,) [N m or N]; and the tangent
stiffness, the derivative of that, shape (n, n), read-only."""


class SpringLaw(Protocol):
    """What the statics asks of springs.

    The residual, the tangent stiffness and the energy of `softrobots.statics.elastostatics` use `at` only; the paper's
    recursions, and the scales and first steps of the solvers, use `stiffness` and `rest`.
    """

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness near rest, shape (n,) [N m/rad or N/m]."""

    @property
    def rest(self) -> FloatArray:
        """Relaxed coordinates, shape (n,) [rad or m]."""

    @property
    def least_tangent(self) -> FloatArray:
        """`stiffness` times `POSITIVE` as a diagonal matrix, shape (n, n), read-only: what a stable tangent exceeds."""

    def at(self, y: FloatArray) -> SpringState:
        """Energy, torque and tangent at coordinates `y`, shape (n,) [rad or m]."""

    def saturated(self, y: FloatArray) -> frozenset[int]:
        """Places of the springs that are on a plateau at `y`."""


@dataclass(frozen=True)
class LinearSprings:
    """Independent linear springs, `torque = stiffness (y - rest)`, [Troise 2021] (2)."""

    stiffness: FloatArray
    """Stiffness, shape (n,) [N m/rad or N/m]."""
    rest: FloatArray
    """Relaxed coordinates, shape (n,) [rad or m]."""

    def at(self, y: FloatArray) -> SpringState:
        """Energy `sum k (y - rest)^2 / 2`, torque `k (y - rest)` and tangent at coordinates `y`, shape (n,) [rad or m]."""
        stretch = y - self.rest
        torque = self.stiffness * stretch
        return 0.5 * float(torque.dot(stretch)), torque, self._tangent

    @cached_property
    def _tangent(self) -> FloatArray:
        return read_only(np.diag(self.stiffness))

    @cached_property
    def least_tangent(self) -> FloatArray:
        """`stiffness` times `POSITIVE` as a diagonal matrix, shape (n, n), read-only: what a stable tangent exceeds."""
        return read_only(POSITIVE * self._tangent)

    def saturated(self, y: FloatArray) -> frozenset[int]:
        """Places of the springs that are on a plateau: none."""
        return frozenset()


class SaturatingLink(NamedTuple):
    """The springs of an inflated link whose moment has a plateau."""

    places: tuple[int, ...]
    """Places of the springs among the elastic coordinates."""
    stiffness: float
    """Stiffness of each of them [N m/rad]."""
    max_moment: float
    """Moment of the plateau [N m]."""


@dataclass(frozen=True)
class SaturatingSprings:
    r"""Linear springs, some of them springs of inflated links that go limp beyond a moment.

    The moment of such a link is the law of `inflated_beam.moment` along the direction in which it is bent, the same in all
    directions as a round tube is: with the angles `s = y - rest` of its springs and :math:`\rho = |s|`,

    .. math:: \tau = \min(k \rho, M) \, s / \rho

    The energy grows as :math:`M \rho` beyond :math:`\rho = M / k`; there the tangent is zero along `s`, and :math:`M / \rho`
    across. It jumps at the knee; torque and energy do not.
    """

    linear: LinearSprings
    """The springs without plateau."""
    links: tuple[SaturatingLink, ...]
    """The links with one."""

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness near rest, shape (n,) [N m/rad or N/m]."""
        return self.linear.stiffness

    @property
    def rest(self) -> FloatArray:
        """Relaxed coordinates, shape (n,) [rad or m]."""
        return self.linear.rest

    @property
    def least_tangent(self) -> FloatArray:
        """`stiffness` times `POSITIVE` as a diagonal matrix, shape (n, n), read-only: what a stable tangent exceeds."""
        return self.linear.least_tangent

    def at(self, y: FloatArray) -> SpringState:
        """Energy, torque and tangent at coordinates `y`, shape (n,) [rad or m]."""
        energy, torque, tangent = self.linear.at(y)
        beyond = self._beyond_knee(y)
        if beyond:
            tangent = tangent.copy()
        for link, angles, bend in beyond:
            energy -= 0.5 * link.stiffness * (bend - link.max_moment / link.stiffness) ** 2
            across = link.max_moment / bend
            for row, one in zip(link.places, angles, strict=True):
                torque[row] = link.max_moment * (one / bend)
                tangent[row, row] += across - link.stiffness
                for column, other in zip(link.places, angles, strict=True):
                    tangent[row, column] -= across / (bend * bend) * (one * other)
        return energy, torque, read_only(tangent)

    def saturated(self, y: FloatArray) -> frozenset[int]:
        """Places of the springs whose link is on its plateau at coordinates `y`, shape (n,)."""
        return frozenset(place for link, _, _ in self._beyond_knee(y) for place in link.places)

    def _beyond_knee(self, y: FloatArray) -> list[tuple[SaturatingLink, list[float], float]]:
        """The links on their plateau, with the angles of their springs and the norm of those."""
        found = []
        for link in self.links:
            angles = [float(y[place] - self.rest[place]) for place in link.places]
            bend = math.hypot(*angles)
            if link.stiffness * bend > link.max_moment:
                found.append((link, angles, bend))
        return found


def spring_law(
    linear: LinearSprings, names: Sequence[str], joints: Collection[str], tags: Sequence[InflatedLinkTag]
) -> SpringLaw:
    """The law of the springs of a robot: linear, unless a link has a largest moment.

    Args:
        linear: Stiffness and rest of the elastic coordinates.
        names: Their names.
        joints: The spring joints of the robot.
        tags: Its inflated links. One whose springs the caller has left out altogether does not count.

    Returns:
        The law.

    Raises:
        DescriptionError: If the springs of a link with a largest moment differ in stiffness, or are not all elastic coordinates
            by themselves (sections of constant strain, and hinges that muscle lengths hold, are not).
    """
    links = []
    for tag in tags:
        if tag.max_moment is None or not any(name in names or name in joints for name in tag.springs):
            continue
        told = f"the inflated_link of {' '.join(tag.springs)} has max_moment {tag.max_moment} N m"
        if not all(name in names and name in joints for name in tag.springs):
            raise DescriptionError(
                f"{told}; its springs must be joints with a spring each, that no muscle length holds; these are: "
                f"{', '.join(name for name in names if name in joints) or 'none'}"
            )
        places = tuple(names.index(name) for name in tag.springs)
        if len({float(linear.stiffness[place]) for place in places}) != 1:
            raise DescriptionError(
                f"{told}, the same in all directions; its springs must have the same stiffness, not "
                f"{', '.join(str(float(linear.stiffness[place])) for place in places)} N m/rad"
            )
        links.append(SaturatingLink(places, float(linear.stiffness[places[0]]), tag.max_moment))
    return SaturatingSprings(linear, tuple(links)) if links else linear
