"""One contact of an equilibrium: where robot and obstacle touch, and the force between them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.statics.contact.certificate import ActiveContacts
from softrobots.statics.contact.touch import Touch

PRESSED = "pressed"
"""Without friction, and a force."""

TOUCHING = "touching"
"""The surfaces touch, and there is no force."""

STICKS = "sticks"
"""The force is within the cone of friction: the point stays where it is."""

SLIPS = "slips"
"""The force is on the cone of friction, against the slip."""

_ONE_PLACE = 5e-5  # over the reach: a ball of that radius leaves a plane by 1.25e-9 there, more than surfaces that touch


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact between a link of the robot and an obstacle (or another link); vectors in world axes."""

    link: str
    """Link of the robot that touches."""
    obstacle: str
    """Name of the obstacle; of the other link, where the robot touches itself."""
    point: FloatArray
    """Point on the robot's surface, shape (3,) [m]."""
    obstacle_point: FloatArray
    """Point on the obstacle's surface, shape (3,) [m]."""
    normal: FloatArray
    """Unit normal from the obstacle to the robot, shape (3,)."""
    normal_force: float
    """Force along the normal, zero or more [N]."""
    force: FloatArray
    """Force that the obstacle applies to the robot, shape (3,) [N]."""
    gap: float
    """Distance of the surfaces, negative where they penetrate [m]."""
    strict: bool
    """Whether it is pressed with a force clear of rounding; the certificate of stability counts such contacts as held."""
    status: str
    """`PRESSED` or `TOUCHING` without friction, `STICKS` or `SLIPS` with it."""
    slip: FloatArray
    """Slip of the robot's point over the obstacle in this step, shape (3,) [m]; zero without friction."""
    with_itself: bool = False
    """Whether `obstacle` is a link of the robot itself."""
    cone_share: float = 0.0
    """Friction over the largest that the cone holds [-]: below 1 where it sticks, 1 where it slips, 0 without friction."""

    def __repr__(self) -> str:
        """Bodies, status, force and place in one line."""
        place = ", ".join(f"{number + 0.0:.4g}" for number in self.point.round(6))
        return f"Contact({self.link} on {self.obstacle}: {self.status}, {self.normal_force:.6g} N at ({place}) m)"

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.point, self.obstacle_point, self.normal, self.force, self.slip):
            read_only(array)


def contacts_of(touch: Touch, active: ActiveContacts) -> tuple[Contact, ...]:
    """Return the touching candidates of a state as contacts without friction."""
    pressed, nothing = set(active.pressed.tolist()), np.zeros(3)
    found = [
        contact_at(touch.surroundings, touch.gaps, place, force, nothing, PRESSED if place in pressed else TOUCHING, nothing)
        for place, force in zip(active.touching.tolist(), touch.forces[active.touching].tolist(), strict=True)
    ]
    return each_once(found, touch.gaps.reach) if len(active.weak) else tuple(found)


def each_once(contacts: Sequence[Contact], reach: float) -> tuple[Contact, ...]:
    """Leave out what only touches where another contact of the same obstacle is: beside it gaps are zero within the tolerance.

    Where two capsules of the robot meet, those are the ends of both beside the nearest point of one.
    """
    kept = [one for one in contacts if one.strict]
    for one in contacts:
        same = (other for other in kept if one.obstacle == other.obstacle or (one.with_itself and other.with_itself))
        if not one.strict and all(math.dist(one.point, other.point) > _ONE_PLACE * reach for other in same):
            kept.append(one)
    return tuple(one for one in contacts if one in kept)


def contact_at(
    surroundings: Surroundings, gaps: Gaps, place: int, normal_force: float, friction: FloatArray, status: str, slip: FloatArray
) -> Contact:
    """Return the contact of a candidate, with its normal force [N], friction, shape (3,) [N], status and slip."""
    link, obstacle, with_itself = surroundings.pair(gaps, place)
    plain = gaps.row(place)
    core, distance, normal = np.array(plain[0]), plain[1], np.array(plain[2])
    return Contact(
        link=link,
        obstacle=obstacle,
        point=core - gaps.capsule_radii[gaps.keys[place][0]] * normal,
        obstacle_point=core - distance * normal,
        normal=normal,
        normal_force=normal_force,
        force=normal_force * normal + friction,
        gap=float(gaps.values[place]),
        strict=status != TOUCHING,
        status=status,
        slip=slip.copy(),
        with_itself=with_itself,
    )


def with_contacts(wrenches: Mapping[str, FloatArray], contacts: Iterable[Contact]) -> dict[str, FloatArray]:
    """Return wrenches by frame, shape (6,) [N, N m], with the forces of contacts added; their moments are left out."""
    total = dict(wrenches)
    for contact in contacts:
        force = np.concatenate([contact.force, np.zeros(3)])
        total[contact.link] = total.get(contact.link, 0.0) + force
        if contact.with_itself:
            total[contact.obstacle] = total.get(contact.obstacle, 0.0) - force
    return total
