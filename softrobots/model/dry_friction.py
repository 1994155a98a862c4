r"""Dry friction of sections that bend and of actuators in their guides, as the minimum of an energy from the last state.

Friction does not depend on the rate: a step from a remembered state to the next equilibrium minimises the potential energy plus
what friction dissipates on the way. Both frictions are a spring in line with a slider, of stiffness `limit / stick`: the
*stick* is small, and only makes the minimum smooth. With the displacement `x` from the slider the step adds

.. math:: L\,H(|x|), \qquad H(x) = \begin{cases} x^2 / (2 s) & x \le s \\ x - s/2 & x > s \end{cases}

- *Bending of a section*: `L` is the moment of its friction [N m], `x` the vector of its bending less that of the slider [rad].
- *Guides*: where an actuator turns by the angle :math:`\theta` in its guides, the tension beyond changes by the capstan's
  factor :math:`e^{-\mu\theta}` in the direction of slip. `x` is the slip of the actuator towards its motor, i.e. how much the
  length beyond has shrunk, and :math:`L = T (1 - e^{-\mu\theta\sigma}) / \sigma`, with the tension `T` before the guide and the
  direction of slip :math:`\sigma = H'(x)` in [-1, 1]; the minimum is found for given `L`, until `L` stays the same.

A guide stands at each point of a route (`softrobots.description.route_points`), all along the body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.checks import FloatArray, read_only
from softrobots.description.route_points import RoutePoint, route_points
from softrobots.description.urdf_tags import ActuatorTag, FrictionTag
from softrobots.model.actuator_laws import ROUNDING
from softrobots.model.muscle_paths import MusclePaths
from softrobots.model.sections import SectionRow

BENDING_STICK = 1e-4
"""Stick of a section that bends [rad]."""

_STILL = 1.0 + 1e-6  # of a stick, up to which nothing slips
_GUIDE_STICK = 1e-5  # of an actuator, relative to its length at rest


class FrictionMemory(NamedTuple):
    """What friction remembers of the last state."""

    bending: FloatArray
    """Bending of the sliders of the sections with friction, shape (n_sections, 2) [rad]."""
    slip: FloatArray
    """Displacement of the actuators from the sliders of their guides, towards the motors, shape (n_guides,) [m]."""
    pieces: FloatArray
    """Length of each piece of the actuators, shape (n_guides,) [m]."""


class DryFriction:
    """The dry friction of a robot, as a function of its strains."""

    def __init__(
        self,
        friction: Sequence[FrictionTag],
        sections: Sequence[SectionRow],
        tags: Sequence[ActuatorTag],
        paths: MusclePaths,
        relaxed: FloatArray,
    ) -> None:
        """Take the friction of segments, all sections, the actuators with their paths, and the relaxed strains, (count,)."""
        bending = {tag.segment: tag.bending for tag in friction if tag.bending > 0.0}
        guides = {tag.segment: tag.guides for tag in friction if tag.guides > 0.0}
        rubbing = [row for row in sections if row.segment in bending]
        self.limit = read_only(np.array([bending[row.segment] for row in rubbing]))
        """Moment of the friction of each section that has some, shape (n_sections,) [N m]."""
        self.places = np.array([[row.places[name] for name in STRAINS[:2]] for row in rubbing], dtype=np.intp).reshape(-1, 2)
        """Places of its bending among the strains, shape (n_sections, 2)."""
        self._paths, self._count, self._relaxed = paths, len(relaxed), relaxed
        self.guided = bool(tags) and bool(guides)
        """Whether an actuator rubs in its guides."""
        self.rounding = rounding_of(self.limit)
        """Rounding of the moments of friction [N m]."""
        self.coefficient = np.zeros(0)
        """Coefficient of friction of each guide, shape (n_guides,) [-]."""
        self.n_guides = len(paths.muscle) if self.guided else 0
        """Number of guides, one a path; 0 if there is no friction in guides."""
        if self.guided:
            self.stick = _GUIDE_STICK * np.array([tag.rest_length for tag in tags])[paths.muscle]
            """Stick of each guide, shape (n_guides,) [m]."""
            same = paths.muscle[:, None] == paths.muscle
            self._beyond = np.triu(same, 1) + 0.5 * np.eye(self.n_guides)  # lengths beyond a guide by pieces
            self._before = np.tril(same, -1).astype(np.float64)
            spans = [(row.segment, row.length) for row in sections]
            pairs = [(point, sections[point.section]) for tag in tags for point in route_points(tag.route, spans)]
            self.coefficient = np.array([guides.get(row.segment, 0.0) for _, row in pairs])
            turns = [_turn(point, row) for point, row in pairs]
            self.turns = tuple(np.array(part) for part in zip(*turns, strict=True))
            """Turn of the body and tangent at each guide at zero strains, (n_guides, 2, 3), and by strains, (..., 4)."""

    @property
    def untouched(self) -> FrictionMemory:
        """The memory of a robot at rest that nothing has moved yet."""
        pieces = self._paths.at(self._relaxed).pieces if self.guided else np.zeros(0)
        return FrictionMemory(self._relaxed[self.places], np.zeros(self.n_guides), pieces)

    def after(self, strains: FloatArray, memory: FrictionMemory, place: FloatArray | None = None) -> FrictionMemory:
        """Return the memory after a step to strains, shape (count,); if they are `place` in truth, the sliders move along."""
        place = strains if place is None else place
        apart = strains[self.places] - memory.bending
        share = np.minimum(1.0, BENDING_STICK / np.maximum(np.linalg.norm(apart, axis=1), BENDING_STICK))
        bending = place[self.places] - apart * share[:, None]
        if not self.guided:
            return FrictionMemory(bending, memory.slip, memory.pieces)
        slip = np.clip(self._slipped(self._paths.at(strains).pieces, memory), -self.stick, self.stick)
        pieces = self._paths.at(place).pieces
        return FrictionMemory(read_only(bending), read_only(slip), read_only(pieces))

    def grip(self, strains: FloatArray, tensions: FloatArray, memory: FrictionMemory) -> FloatArray:
        """Return the friction `L` of each guide that slips, shape (n_guides,) [N], at tensions of the motors, (n_muscles,)."""
        if not self.guided:
            return np.zeros(0)
        z = np.append(strains, 0.0)[self._paths.places]
        rest, slope = self.turns
        turning, tangent = np.swapaxes(rest + (slope @ z[:, None, :, None])[..., 0], 0, 1)
        angles = np.linalg.norm(np.cross(turning, tangent), axis=1) / np.linalg.norm(tangent, axis=1)
        slips = self._slipped(self._paths.at(strains).pieces, memory) / self.stick
        exponent = self.coefficient * angles
        along = exponent * np.clip(slips, -1.0, 1.0)
        before = np.abs(tensions)[self._paths.muscle] * np.exp(-self._before @ along)
        small = np.abs(along) < 1e-8
        return np.asarray(before * exponent * np.where(small, 1.0, -np.expm1(-along) / np.where(small, 1.0, along)))

    def at(self, strains: FloatArray, memory: FrictionMemory, grip: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return what a step adds to the energy [J], the torque on the strains, shape (count,), and their stiffness."""
        apart = strains[self.places] - memory.bending
        size = np.linalg.norm(apart, axis=1)
        reach = np.maximum(size, BENDING_STICK)
        energy = float(self.limit @ _dissipated(size, BENDING_STICK))
        torque, stiffness = np.zeros(self._count), np.zeros((self._count, self._count))
        torque[self.places] = apart * (self.limit / reach)[:, None]
        along = apart / reach[:, None] * (size > BENDING_STICK)[:, None]
        blocks = (np.eye(2) - along[:, :, None] * along[:, None, :]) * (self.limit / reach)[:, None, None]
        stiffness[self.places[:, :, None], self.places[:, None, :]] = blocks
        if self.guided:
            paths = self._paths.at(strains)
            slip = self._slipped(paths.pieces, memory)
            pull = -(grip * np.clip(slip / self.stick, -1.0, 1.0)) @ self._beyond  # what friction adds to the tension
            arms = paths.piece_arms
            slips = self._beyond @ arms
            sticking = np.where(np.abs(slip) <= self.stick, grip / self.stick, 0.0)
            energy += float(grip @ _dissipated(np.abs(slip), self.stick))
            torque += pull @ arms
            stiffness += paths.stiffening(pull) + slips.T @ (sticking[:, None] * slips)
        return energy, torque, stiffness

    def parts(self, strains: FloatArray, memory: FrictionMemory, grip: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the friction of each part over its limit, and the torque on the strains at the limit.

        Parts are both ways of bending of the sections, then guides. Shapes (2 n_sections + n_guides,) and (same, count).
        """
        apart = strains[self.places] - memory.bending
        shares = (apart / np.maximum(np.linalg.norm(apart, axis=1), BENDING_STICK)[:, None]).ravel()
        torques: FloatArray = np.repeat(self.limit, 2)[:, None] * np.eye(self._count)[self.places.ravel()]
        if not self.guided:
            return shares, torques
        paths = self._paths.at(strains)
        slips = np.clip(self._slipped(paths.pieces, memory) / self.stick, -1.0, 1.0)
        pulls = -grip[:, None] * self._beyond @ paths.piece_arms
        return np.concatenate([shares, slips]), np.concatenate([torques, pulls])

    def sticks(self, strains: FloatArray, memory: FrictionMemory) -> bool:
        """Return whether nothing slips at strains, shape (count,); what has slipped and stands still does not."""
        apart = np.linalg.norm(strains[self.places] - memory.bending, axis=1)
        if self.guided and np.any(np.abs(self._slipped(self._paths.at(strains).pieces, memory)) > _STILL * self.stick):
            return False
        return not np.any(apart > _STILL * BENDING_STICK)

    def first_turn(self, strains: FloatArray, others: FloatArray, memory: FrictionMemory) -> float:
        """Return the share of the way to other strains, shape (count,), at which a section that slips first turns round."""
        apart, way = strains[self.places] - memory.bending, (others - strains)[self.places]
        share = -(apart * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300)
        least, now = (np.linalg.norm(one, axis=1) for one in (apart + share[:, None] * way, apart))
        turns = (now > _STILL * BENDING_STICK) & (least < BENDING_STICK) & (share > 0.0)
        return float(share[turns].min(initial=1.0))

    @property
    def beyond_at_rest(self) -> FloatArray:
        """Length beyond each guide at rest, beyond that where all strains are zero, shape (n_guides,) [m]."""
        return np.asarray(self._beyond @ (self.untouched.pieces - self._paths.length))

    def anchors(self, memory: FrictionMemory) -> FloatArray:
        """Return the length beyond each guide at which its slider stands, beyond that at rest, shape (n_guides,) [m]."""
        return self._slipped(self.untouched.pieces, memory) if self.guided else np.zeros(0)

    def _slipped(self, pieces: FloatArray, memory: FrictionMemory) -> FloatArray:
        """Displacement of the actuators from the sliders of their guides, shape (n_guides,) [m]."""
        return np.asarray(memory.slip + self._beyond @ (memory.pieces - pieces))


def rounding_of(limits: Any) -> float:
    """Return the rounding of moments of friction of sections [N m]: that of an angle times the stiffness of the stick."""
    return ROUNDING * math.pi * float(np.linalg.norm(limits)) / BENDING_STICK


def _dissipated(size: FloatArray, stick: FloatArray | float) -> FloatArray:
    """`H`, see the module."""
    return np.where(size <= stick, size**2 / (2.0 * stick), size - 0.5 * stick)


def _turn(point: RoutePoint, row: SectionRow) -> tuple[FloatArray, FloatArray]:
    """Turn of the body along a piece of a route, and its tangent, in radial, circumferential and axial components.

    Returns:
        Both where all strains are zero, shape (2, 3), and their derivatives by the section coordinates, shape (2, 3, 4).
    """
    share, sine, cosine = point.weight / row.length, np.sin(point.azimuth), np.cos(point.azimuth)
    slope = np.zeros((2, 3, len(STRAINS)))
    slope[0] = share * np.array([[cosine, sine, 0.0, 0.0], [-sine, cosine, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    slope[1, 1, 2] = share * point.distance
    slope[1, 2] = share * np.array([point.distance * sine, -point.distance * cosine, 0.0, 1.0])
    rest = point.weight * np.array(
        [[0.0, 0.0, point.winding], [point.widening, point.distance * point.winding, 1.0]]
    ) + slope @ np.asarray(row.origin)
    return rest, slope
