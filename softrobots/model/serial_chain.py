"""A robot as a serial chain, base to tip: the input of the compiled solvers.

Plain data without Pinocchio. Every joint turns about, or slides along, the z axis of its own frame; axes, fixed links and
welded bodies of the description are part of the constant placements between them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.dry_friction import DryFriction
from softrobots.model.muscle_paths import MusclePaths


class ChainBody(NamedTuple):
    """A rigid body fixed to a frame of the chain."""

    mass: float
    """Mass [kg]."""
    first_moment: FloatArray
    """Mass times centre of mass, in the axes of the frame and from its origin, shape (3,) [kg m]."""
    inertia: FloatArray
    """Rotational inertia in the axes of the frame and about its origin, shape (3, 3) [kg m^2]."""


@dataclass(frozen=True, eq=False)
class ChainJoint:
    """A joint that turns about, or slides along, the z axis of its frame."""

    name: str
    """Name of the joint."""
    rotation: FloatArray
    """Axes of its frame at zero in those of the element before (the world's for the first), shape (3, 3)."""
    translation: FloatArray
    """Origin of its frame at zero in the frame of the element before, shape (3,) [m]."""
    slides: bool
    """Whether it slides rather than turns."""
    motor: int | None
    """Its place among the motor joints; None for a spring."""
    strain: int | None
    """Its place among the strains (see `SerialChain.stiffness`); None for a motor."""
    body: ChainBody
    """The mass fixed to its frame."""
    axes: FloatArray
    """Axes of its frame in Pinocchio's frame of the joint, shape (3, 3)."""


@dataclass(frozen=True, eq=False)
class ChainSection:
    """A section of constant strain; see `softrobots.constant_curvature.strain_chain`."""

    name: str
    """Name of the section."""
    rotation: FloatArray
    """Axes of its start in those of the element before, shape (3, 3)."""
    translation: FloatArray
    """Its start in the frame of the element before, shape (3,) [m]."""
    length: float
    """Rest length [m]."""
    strain: int
    """Place of the first of its section coordinates among the strains."""
    n_strains: int
    """Number of them: four, or three without stretch."""
    bodies: tuple[ChainBody, ...]
    """The masses fixed to the frames behind its six joints `strain_chain.JOINTS`, in the axes that result from those joints and
    the axes of the start; the last is the end of the section."""


@dataclass(frozen=True, eq=False)
class ChainHinge:
    """The joints of a lumped section, base to tip, as one element: the length of a winding route depends on all of them."""

    joints: tuple[ChainJoint, ...]
    """The joints."""
    masses_beyond: tuple[float, ...]
    """Mass beyond each [kg]."""


Element: TypeAlias = ChainJoint | ChainSection
"""Joint or section."""

_LUMPED = (ChainJoint, ChainHinge)


@dataclass(frozen=True, eq=False)
class SerialChain:
    """The elements from base to tip, with springs and muscles.

    Strains are the coordinates of spring joints, base to tip, and then of sections, without muscles. Given muscle
    lengths constrain sums of strains, and the elastic coordinates are combinations of the strains; otherwise they are the
    strains.
    """

    name: str
    """Name of the robot."""
    elements: tuple[Element, ...]
    """Joints and sections, base to tip."""
    tip_rotation: FloatArray
    """Axes of the tip in those of the last element, shape (3, 3)."""
    tip_translation: FloatArray
    """The tip in the frame of the last element, shape (3,) [m]."""
    stiffness: FloatArray
    """Stiffness of the strains, shape (n_strains,) [N m/rad or N/m]."""
    rest: FloatArray
    """Relaxed strains, shape (n_strains,) [rad or m]."""
    reach: float
    """Scale of residuals, `SoftModel.reach` [m]."""
    n_motors: int
    """Number of motor joints, without muscles."""
    limits: FloatArray
    """Lower and upper limit of the actuators, motor joints and then muscles, shape (n_actuators, 2) [rad, m, N or Pa]."""
    muscle_input: str
    """See `SoftModel.muscle_input`."""
    actuators: tuple[ActuatorTag, ...]
    """The muscles."""
    muscle_paths: MusclePaths
    """The muscle lengths as functions of the strains."""
    constrained: tuple[tuple[int, ...], ...]
    """Groups of strains whose sum the given muscle lengths constrain without twist, base to tip; empty without given lengths.

    With twist the excess of the lengths, times `constrained_slope`, counts in each sum.
    """
    constrained_slope: FloatArray
    """Derivative of those sums with respect to the muscle lengths, shape (n_groups, n_muscles)."""
    elastic: FloatArray
    """Elastic coordinates by strains, shape (n_springs, n_strains); the identity without given lengths."""
    spread: FloatArray
    """Part of the strains that muscle lengths prescribe without twist, by their change from rest, (n_strains, n_muscles)."""
    free: FloatArray
    """Part of the strains by elastic coordinates, shape (n_strains, n_springs)."""
    slack_hinges: tuple[tuple[int, int, float], ...] = ()
    """The two strains, base to tip, of each hinge of an inflated link whose wall goes slack, and the moment of that [N m]."""
    wound: tuple[tuple[int, int], ...] = ()
    """First and last joint of each lumped section that has dry friction or along which an actuator winds, base to tip."""
    friction: tuple[tuple[int, int, float], ...] = ()
    """The two strains of bending of each section with dry friction, and the moment of that [N m]."""
    guides: DryFriction | None = None
    """The dry friction of actuators in their guides, one a path; None without it."""

    @cached_property
    def joined(self) -> SerialChain:
        """The chain with the joints of each of `wound` as one element, a `ChainHinge`; itself if there is none."""
        elements: list[Any] = list(self.elements)
        for first, last in reversed(self.wound):
            rows = slice(first, last + 1)
            elements[rows] = [ChainHinge(self.elements[rows], self.masses_beyond[rows])]  # type: ignore[arg-type]
        return replace(self, elements=tuple(elements), wound=()) if self.wound else self

    @cached_property
    def overlapping(self) -> list[list[int]]:
        """Muscles of each segment, tip to base, those that end nearest to the tip first."""
        merged: list[list[int]] = []
        for muscle in sorted(range(len(self.spans)), key=lambda one: (-self.spans[one][1], one)):
            if merged and self.spans[muscle][1] >= min(self.spans[one][0] for one in merged[-1]):
                merged[-1].append(muscle)
            else:
                merged.append([muscle])
        return merged

    @cached_property
    def routed(self) -> bool:
        """Whether an actuator is not of given length or tension, winds, or passes other sections than those it overlaps.

        Also where lengths constrain other combinations of strains than sums, or guides or lumped sections have dry friction.
        """
        if self.guides is not None:
            return True
        if self.actuators and any(isinstance(self.elements[self.element_of[one]], _LUMPED) for one, *_ in self.friction):
            return True
        if any(one.kind not in ("length", "tension") or not one.straight for one in self.actuators):
            return True
        if self.actuators and self.muscle_input == "lengths" and not self.constrained:
            return True
        paths, shared = self.muscle_paths, False
        for muscles in self.overlapping:
            own = np.isin(paths.muscle, muscles)
            shared |= int(own.sum()) != len(muscles) * len(np.unique(paths.places[own], axis=0))
        return shared

    @cached_property
    def spans(self) -> list[tuple[int, int]]:
        """First and last element beside each muscle."""
        paths = self.muscle_paths
        spans = []
        for muscle in range(len(paths.rest)):
            places = paths.places[paths.muscle == muscle].ravel().tolist()
            rows = [self.element_of[place] for place in places if place < paths.count]
            spans.append((min(rows), max(rows)))
        return spans

    @cached_property
    def masses_beyond(self) -> tuple[float, ...]:
        """Mass beyond each element, without its own [kg]."""
        own = [sum(body.mass for body in bodies_of(element)) for element in self.elements]
        return tuple(sum(own[row + 1 :], 0.0) for row in range(len(own)))

    @cached_property
    def element_of(self) -> dict[int, int]:
        """Element of each strain."""
        return {strain: row for row, element in enumerate(self.elements) for strain in strains_of(element)}


def bodies_of(element: Element | ChainHinge) -> tuple[ChainBody, ...]:
    """Return the bodies of an element."""
    if isinstance(element, ChainHinge):
        return tuple(joint.body for joint in element.joints)
    return element.bodies if isinstance(element, ChainSection) else (element.body,)


def strains_of(element: Element | ChainHinge) -> tuple[int, ...]:
    """Return the indices of the strains of an element; none for a motor."""
    if isinstance(element, ChainHinge):
        return tuple(strain for joint in element.joints for strain in strains_of(joint))
    if isinstance(element, ChainSection):
        return tuple(element.strain + place for place in range(element.n_strains))
    return () if element.strain is None else (element.strain,)
