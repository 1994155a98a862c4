r"""A robot in a small step with friction: gaps, sliding since the last state, and the balance of its elastic coordinates.

Sliding is counted on surfaces. The material point of the robot that touches at `p` was at :math:`T_0 T^{-1} p` in the last
state, with the poses :math:`T_0` and `T` of its joint, and that of the obstacle likewise. The part of their difference in the
tangent plane is the sliding in the step. So what rolls slides by the third order of the step only, a tube that turns about its
own axis slides along its skin, and an obstacle that moves takes along what sticks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.vectors import axes_along
from softrobots.environment.gaps import Gaps
from softrobots.environment.turning import turning
from softrobots.model.coordinates import Point
from softrobots.model.friction_coordinates import memory_of
from softrobots.model.joint_loads import JointLoad
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.certificate import null_space
from softrobots.statics.contact.contact import PRESSED, SLIPS, STICKS, TOUCHING, Contact, contact_at, each_once
from softrobots.statics.contact.contact_laws import Balance, NearContacts
from softrobots.statics.contact.last_state import MARGIN, Given, Sliding, forces_by_key, world
from softrobots.statics.contact.newton_in_contact import ByMotors
from softrobots.statics.contact.touch import joined
from softrobots.statics.elastic_state import TOLERANCE, largest_residual
from softrobots.statics.equilibrium_result import Equilibrium
from softrobots.statics.loads import AppliedLoad

_TOUCHES = 1e-9  # largest gap of a contact without force, relative to the reach
_BESIDE = 1e-2  # largest distance between candidates of one contact, relative to the reach
_SLIPS = 1e-10  # sliding in a step that is none, relative to the reach
_STRICT = 1e-9  # least force of a contact that counts as held, relative to the largest


class _Place:
    """The robot at given elastic coordinates."""

    def __init__(self, point: Point, q: FloatArray, gaps: Gaps, applied: JointLoad) -> None:
        self.point, self.q, self.gaps, self.applied = point, q, gaps, applied
        self.tangents = axes_along(gaps.normals)[:, :, :2].swapaxes(1, 2)
        """Two unit vectors of each tangent plane, shape (m, 2, 3)."""


class SlidingRobot:
    """A robot at given motors and load in a step from a last state; a `contact_laws.Step`."""

    def __init__(self, given: Given, last: Sliding, brake: float = 0.0) -> None:
        """Take what is given in the step.

        Args:
            given: The robot, its motors, its load and the surfaces around it.
            last: The last state.
            brake: Torque against the way of each spring from the first coordinates asked, over its stiffness and that way [-].
        """
        self.model, self.given, self.last, self._brake = given.model, given, last, brake
        self.stiffness, self.reach = given.model.stiffness, given.model.reach
        self._applied = AppliedLoad(given.model, given.load)
        self._forces: dict[Any, tuple[float, FloatArray]] = {}
        self._start = np.array(given.model.rest)
        self._places: tuple[_Place | None, _Place | None] = None, None

    def contacts(self, q_springs: FloatArray) -> NearContacts | None:
        """Return the near contacts at elastic coordinates, shape (n_springs,); None out of the range of a section."""
        model = self.model
        point = model.coordinates.at(self.given.q_motors, q_springs)
        if not point.valid:
            return None
        q = model.embed(point.joints)
        gaps = self.given.surroundings.at(q, MARGIN * self.reach)
        place = _Place(point, q, gaps, self._applied.nothing or self._applied.at(q))
        rows = np.arange(len(gaps))
        on_robot, on_obstacle = self.last.gaps.places_of(gaps.material(rows))
        slid = (gaps.points - on_robot) - (gaps.obstacle_points - on_obstacle)
        moves = place.tangents @ gaps.point_jacobian(rows, gaps.points)
        columns = point.columns(moves.reshape(-1, moves.shape[2]))[1].reshape(len(gaps), 2, model.n_springs)
        if self._places[1] is None:
            self._start = q_springs
        self._places, self.q_springs = (self._places[1], place), q_springs
        return NearContacts(gaps.values, point.columns(gaps.jacobian)[1], (place.tangents @ slid[:, :, None])[:, :, 0], columns)

    @property
    def at(self) -> _Place:
        """The place asked last; there must have been one."""
        return self._places[1]  # type: ignore[return-value]

    def first_turn(self, q_springs: FloatArray, change: FloatArray) -> float:
        """Return the share of a change of the elastic coordinates, shape (n_springs,), at which a slip first turns round.

        That is 1, unless a section with dry friction of its own that slips would stick on the way, and slip back.
        """
        friction, model, motors = self.model.structure.friction, self.model, self.given.q_motors
        if friction is None:
            return 1.0
        here, there = (model.structure.strains(motors, y) for y in (q_springs, q_springs + change))
        return friction.first_turn(here, there, memory_of(model))

    def mark(self) -> _Place | None:
        """Return the place asked last."""
        return self._places[1]

    def return_to(self, mark: _Place | None) -> None:
        """Carry forces from another place on."""
        self._places = None, mark

    def carried(self, normal: FloatArray, friction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the forces of the contacts asked before on those asked last, shapes (m,) and (m, 2) [N]."""
        before, place = self._places[0], self.at
        if before is None:
            self._forces = dict(self.last.forces)
        else:
            self._forces = forces_by_key(before.gaps.keys, normal, world(before.tangents, friction))
        self._pass_on(self.last.gaps if before is None else before.gaps, place.gaps)
        forces = [self._forces.get(key, (0.0, np.zeros(3))) for key in place.gaps.keys]
        along = np.array([force for _, force in forces]).reshape(-1, 3, 1)
        turned = (place.tangents @ along)[:, :, 0]
        kept = np.linalg.norm(along[:, :, 0], axis=1) / np.maximum(np.linalg.norm(turned, axis=1), 1e-300)
        return np.array([force for force, _ in forces]), turned * np.where(kept < 2.0, kept, 1.0)[:, None]

    def _pass_on(self, before: Gaps, now: Gaps) -> None:
        """Give the force of a candidate that is no more, as of a nearest point that has passed an end, to the one beside it."""
        keys = set(now.keys)
        for row, key in enumerate(before.keys):
            if key in keys or self._forces.get(key, (0.0,))[0] <= 0.0:
                continue
            apart = np.linalg.norm(now.points - before.points[row], axis=1)
            apart[now.obstacles != before.obstacles[row]] = np.inf
            beside = int(apart.argmin()) if len(apart) else 0
            if len(apart) and apart[beside] <= _BESIDE * self.reach:
                normal, friction = self._forces.get(now.keys[beside], (0.0, np.zeros(3)))
                self._forces[now.keys[beside]] = normal + self._forces[key][0], friction + self._forces[key][1]

    def residual(self, normal: FloatArray, friction: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return torque out of balance, its derivative, and the torque that counts as none, at the coordinates asked last."""
        load = self.joint_load(normal, friction)
        reduced = self.at.point.reduce(load)
        _, torques, stiffness = self.model.springs.at(self.q_springs)
        residual, tangent = torques - reduced.elastic, stiffness - reduced.derivative
        if self._brake > 0.0:
            residual = residual + self._brake * self.stiffness * (self.q_springs - self._start)
            tangent = tangent + self._brake * np.diag(self.stiffness)
        return residual, tangent, largest_residual(self.model, load.scale + reduced.scale * self.reach, TOLERANCE)

    def joint_load(self, normal: FloatArray, friction: FloatArray) -> JointLoad:
        """Return applied load, contact and friction on the joints, at the coordinates asked last."""
        place = self.at
        load = joined(place.applied, place.gaps.load(normal))
        if not friction.any():
            return load
        forces = world(place.tangents, friction)
        load, more = joined(load, place.gaps.load(forces)), self._turning(place.gaps, forces)
        gravity = load.gravity_derivative
        return load._replace(gravity_derivative=more if gravity is None else gravity + more)

    def by_motors(self, found: Balance) -> ByMotors:
        """Return the derivatives of load, gaps and sliding by the actuators at the coordinates asked last."""
        place = self.at
        moves = place.tangents @ place.gaps.point_jacobian(np.arange(len(place.gaps)), place.gaps.points)
        columns = place.point.columns(moves.reshape(-1, moves.shape[2]))[0].reshape(len(place.gaps), 2, self.model.n_motors)
        load = self.joint_load(found.normal, found.friction)
        return ByMotors(place.point.reduce(load).coupling, place.point.columns(place.gaps.jacobian)[0], columns)

    def _turning(self, gaps: Gaps, forces: FloatArray) -> FloatArray:
        """Derivative of the torque of friction, shape (m, 3) [N], as it turns with the normal and moves over the surface.

        What stands in the load is that of dead forces at material points.
        """
        rows = np.flatnonzero(forces.any(axis=1))
        normals, points = turning(gaps, rows)
        moved = points - gaps.point_jacobian(rows, gaps.points[rows])
        angular = gaps.places.jacobian[3:] * gaps.moves[rows][:, None, :]
        couples = np.cross(moved, forces[rows, :, None], axis=1)
        tilts = (forces[rows][:, None, :] @ normals)[:, 0]
        return np.asarray((np.swapaxes(angular, 1, 2) @ couples).sum(axis=0) - gaps.jacobian[rows].T @ tilts)

    def energy(self) -> float:
        """Return the elastic energy and the potential of the load at the coordinates asked last [J]."""
        place = self.at
        return float(
            self.model.springs.at(self.q_springs)[0] + place.applied.potential + place.point.reduce(place.applied).potential
        )

    def holds(self, found: Balance) -> bool:
        """Whether the stiffness is positive for motions that the contacts do not hold, see `held_rows`.

        That is sufficient: no small motion that keeps them releases energy. What a contact that slips might do by its friction
        changing with the normal force is beyond it.
        """
        return self.softest(found)[0] > POSITIVE

    def softest(self, found: Balance) -> tuple[float, FloatArray]:
        """Return the least stiffness of such motions, relative to the springs, and the motion; infinite if none is left.

        Of two signs it is the one with the positive largest component, so that results repeat.
        """
        root = np.sqrt(self.stiffness)
        free = null_space(self.held_rows(found) / root)
        stiffness = free.T @ (found.tangent / root / root[:, None]) @ free
        if not len(stiffness):
            return np.inf, np.zeros_like(root)
        values, vectors = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
        motion = free @ vectors[:, 0] / root
        return float(values[0]), motion / motion[np.argmax(np.abs(motion))]

    def held_rows(self, found: Balance) -> FloatArray:
        """Return what contacts keep at zero: gaps that are pressed, sliding that sticks, and sliding across that which slips.

        The friction of a contact that slips turns against any motion across, so that this cannot begin by itself. Shape
        (k, n_springs).
        """
        near, pressed = found.contacts, self.pressed(found)
        sticks, slips = pressed & found.laws.sticks, pressed & found.laws.slips
        across = np.stack([-found.laws.way[slips, 1], found.laws.way[slips, 0]], axis=1)[:, None, :] @ near.jacobian[slips]
        n = len(self.stiffness)
        return np.concatenate([near.gradients[pressed], near.jacobian[sticks].reshape(-1, n), across.reshape(-1, n)])

    def pressed(self, found: Balance) -> Any:
        """Return which contacts press with a force clear of rounding, shape (m,), bool."""
        return found.normal > _STRICT * found.normal.max(initial=0.0)

    def after(self, found: Balance) -> Sliding:
        """Return what friction remembers of the state found."""
        place, pressed = self.at, found.normal > 0.0
        keys = [key for key, one in zip(place.gaps.keys, pressed, strict=True) if one]
        forces = forces_by_key(keys, found.normal[pressed], world(place.tangents, found.friction)[pressed])
        return Sliding(self.last.friction, place.gaps, forces)

    def work(self, found: Balance) -> float:
        """Return the work against friction in the step, by the mean of the normal forces at its two ends [J]."""
        slips = np.flatnonzero(self.pressed(found) & ~found.laws.sticks)
        slid = np.linalg.norm(found.contacts.sliding[slips], axis=1)
        now = found.normal[slips].tolist()
        before = [self.last.forces.get(self.at.gaps.keys[row], (force,))[0] for row, force in zip(slips, now, strict=True)]
        return float(0.5 * self.last.friction * ((found.normal[slips] + before) * slid).sum())

    def touches(self, found: Balance) -> tuple[Contact, ...]:
        """Return the contacts of the state found, pressed or touching."""
        gaps, pressed = self.at.gaps, self.pressed(found)
        slid = world(self.at.tangents, found.contacts.sliding)
        along = world(self.at.tangents, found.friction)
        if self.last.friction == 0.0:
            slid = np.zeros_like(slid)
        contacts = []
        for row in np.flatnonzero(pressed | (np.abs(gaps.values) <= _TOUCHES * self.reach)).tolist():
            slips = np.linalg.norm(slid[row]) > _SLIPS * self.reach
            status = TOUCHING if not pressed[row] else PRESSED if self.last.friction == 0.0 else SLIPS if slips else STICKS
            force, mu = float(found.normal[row]), self.last.friction
            one = contact_at(self.given.surroundings, gaps, row, force, along[row], status, slid[row])
            share = float(np.linalg.norm(along[row])) / (mu * force) if status in (STICKS, SLIPS) else 0.0
            contacts.append(replace(one, cone_share=share))
        return each_once(contacts, self.reach)

    def equilibrium(self, found: Balance, iterations: int) -> Equilibrium:
        """Return the state found, at the coordinates asked last, as a result."""
        reduced = self.at.point.reduce(self.joint_load(found.normal, found.friction))
        residual, tangent, allowed = self.residual(found.normal, found.friction)
        return Equilibrium(
            model=self.model,
            load=self.given.load,
            method="newton",
            q_motors=read_only(self.given.q_motors),
            q_springs=read_only(found.q_springs),
            q=read_only(self.at.q),
            spring_torques=read_only(self.model.springs.at(found.q_springs)[1]),
            motor_torques=read_only(reduced.motors),
            tangent_stiffness=read_only(tangent),
            coupling=read_only(reduced.coupling),
            residual=float(np.linalg.norm(residual)),
            tolerance=allowed,
            iterations=iterations,
            stable=self.holds(found),
            contacts=self.touches(found),
            contact_gradients=read_only(self.held_rows(found)),
        )
