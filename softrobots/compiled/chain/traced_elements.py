"""Elements of a chain for a trace: numbers that are constants, table entries or elements of the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from softrobots.compiled.chain.dry_friction import Rubbing
from softrobots.compiled.chain.elimination import RouteSums
from softrobots.compiled.chain.muscle_terms import ElementMuscle
from softrobots.compiled.trace.expressions import Scalar


class SpringLaw(NamedTuple):
    """A spring of a hinge with two, one behind the other, whose torque depends on both angles; at given angles."""

    torque: Scalar
    """Load that it carries [N m]."""
    stiffness: Scalar
    """Its derivative with respect to the angle of the spring [N m/rad]."""
    energy: Scalar
    """Energy; the outer spring counts that of both [J]."""
    coupling: Scalar | None
    """Derivative of the torque with respect to the angle of the inner spring [N m/rad]; None for the inner one."""


@dataclass
class TracedElement:
    """Numbers of an element: constants where they are known when the code is generated, otherwise table entries."""

    kind: str
    """`turn`, `slide`, `section` or `hinge`."""
    rotation: Any
    """Axes of its frame in those of the element before, shape (3, 3)."""
    translation: Any
    """Its origin there, shape (3,) [m]."""
    bodies: list[tuple[Scalar, Any]]
    """Mass and first moment of its bodies."""
    mass_beyond: Scalar
    """Mass beyond it, without its own [kg]."""
    coordinates: list[Scalar]
    """Joint position; section coordinates, locked ones included [rad or m]."""
    moving: tuple[int, ...]
    """Indices of the unknown coordinates; none for a motor."""
    stiffness: list[Scalar]
    """Stiffness of the unknown ones [N m/rad or N/m]."""
    rest: list[Scalar]
    """Rest values of those [rad or m]."""
    muscles: list[ElementMuscle]
    """The muscles beside it."""
    constraints: tuple[int | None, ...]
    """Number of the multiplier of the segment that constrains each unknown coordinate, or None."""
    length: Scalar = 0.0
    """Rest length of a section [m]."""
    law: SpringLaw | None = None
    """Law of its spring if that is not linear by itself."""
    tensions: Sequence[Scalar] = ()
    """Tension of each muscle of its segment [N]."""
    preload: Sequence[Scalar] = ()
    """Part of it that the start of the springs accounts for; with given lengths [N]."""
    routes: RouteSums | None = None
    """What actuators on routes add."""
    rubbing: Rubbing | None = None
    """Its dry friction."""
    members: Sequence[TracedElement] = ()
    """The joints of a `hinge`, base to tip."""


def hinge(members: Sequence[TracedElement]) -> TracedElement:
    """Return spring joints, one behind the other, as one element."""

    def each(values: str) -> list[Scalar]:
        return [one for member in members for one in getattr(member, values)]

    return replace(
        members[0],
        kind="hinge",
        bodies=[],
        mass_beyond=members[-1].mass_beyond,
        coordinates=each("coordinates"),
        moving=tuple(range(len(members))),
        stiffness=each("stiffness"),
        rest=each("rest"),
        constraints=(None,) * len(members),
        members=tuple(members),
    )
