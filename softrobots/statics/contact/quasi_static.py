r"""Quasi-static steps in contact with friction from one equilibrium to the next, and overdamped motion where none is near.

A step is solved from the last state by `softrobots.statics.contact.coulomb`. It is taken if the state found is near, and stable
against motions that the contacts do not hold; else it is halved. Where even the smallest step is
not taken, the last state has lost its stability or ceased to exist. Then the robot moves like one whose springs are braked by a
viscous fluid, :math:`c\, K_0\, \dot y = -r + G^T \lambda_n + T^T \lambda_t`, in implicit steps of time, with the same law
of friction, until it rests. That motion only lowers the energy, and stops at equilibria alone.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.environment.gaps import Surroundings
from softrobots.environment.swept import may_pass
from softrobots.model.friction_coordinates import MOST_ROUNDS, SAME_FRICTION, GuideFriction, after_step
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact_laws import Balance
from softrobots.statics.contact.coulomb import GAP, solve_step
from softrobots.statics.contact.last_state import MARGIN, Given, Sliding, forces_of
from softrobots.statics.contact.sliding import SlidingRobot
from softrobots.statics.equilibrium_result import Equilibrium

FAR = 0.04
"""Change of the springs that is no small step [rad]; a loss of stability that is over within less is not seen."""

_FAR_MOVING = 0.2  # the same in a step of overdamped motion, soft springs counted like stiff ones: these move most there

_MOST_MOMENTS = 400  # steps of the overdamped motion
_STRONGEST = 1e6  # brake that is given up at, over the stiffness of the springs
_STANDS, _PUSH = 1e-8, 1e-3  # change of the springs that is none, and that of a push [rad]
_OPENS = 1e-6  # of the normal force, by which it is drawn to begin with
_NEARLY_AT_REST = 0.02  # change of the springs in a unit of time below which the motion may have arrived


class Rest(NamedTuple):
    """A robot at rest after a step."""

    robot: SlidingRobot
    """The robot."""
    found: Balance
    """Its coordinates and forces."""
    work: float
    """Work against friction in the step [J]."""
    iterations: int
    """Evaluations."""

    @property
    def given(self) -> Given:
        """What is given, to go on from there: for a robot with dry friction of its own, with what that remembers."""
        given = self.robot.given
        return given._replace(model=after_step(given.model, given.q_motors, self.q_springs))

    @property
    def q_motors(self) -> FloatArray:
        """Motor coordinates, shape (n_motors,)."""
        return self.robot.given.q_motors

    @property
    def q_springs(self) -> FloatArray:
        """Elastic coordinates, shape (n_springs,)."""
        return self.found.q_springs

    @property
    def sliding(self) -> Sliding:
        """What friction remembers of it."""
        return self.robot.after(self.found)

    @property
    def statuses(self) -> dict[tuple[str, str], str]:
        """Of each pair of link and obstacle that press: whether they slip, stick or, without friction, are pressed."""
        pressed = [one for one in self.robot.touches(self.found) if one.strict]
        return {(one.link, one.obstacle): one.status for one in sorted(pressed, key=lambda one: one.status == "slips")}

    def equilibrium(self) -> Equilibrium:
        """Return it as a result."""
        return self.robot.equilibrium(self.found, self.iterations)


def settle(
    given: Given, last: Sliding, start: FloatArray, brake: float = 0.0, *, patient: bool = True, forced: float = GAP
) -> Rest | None:
    """Solve one step from elastic coordinates, shape (n_springs,); None if it does not converge to a state that holds.

    Friction of guides is found in rounds, with the step anew in each. For `patient` and `forced` see `coulomb.solve_step`.
    """
    rounds, spent = GuideFriction(), 0
    with one_blas_thread(given.model.n_springs):
        for _ in range(MOST_ROUNDS):  # the friction of guides follows the tensions
            robot = SlidingRobot(given, last, brake)
            found, more = solve_step(robot, start, last.friction, patient=patient, forced=forced)
            spent += more
            if found is None or not robot.holds(found):
                return None
            off = 0.0
            if given.model.structure.guided:
                pulls = robot.at.point.reduce(robot.joint_load(found.normal, found.friction)).motors
                model, off = rounds.after(given.model, given.q_motors, found.q_springs, pulls)
                given, start = given._replace(model=model), start if brake else found.q_springs  # a brake counts from the start
            if off <= SAME_FRICTION:
                return Rest(robot, found, robot.work(found), spent)
            if math.isinf(off):
                return None
        return None


def at_rest(given: Given, start: Equilibrium, friction: float) -> Rest | None:
    """Return an equilibrium, whose contacts keep their forces, as the rest from which friction counts; None if it is none."""
    gaps = given.surroundings.at(start.q, MARGIN * given.model.reach)
    if given.model.structure.friction is not None:
        given = given._replace(model=after_step(start.model, start.q_motors, start.q_springs))
    return settle(given, Sliding(friction, gaps, forces_of(gaps, start.contacts)), start.q_springs)


def step(given: Given, last: Rest, *, patient: bool = True) -> Rest | None:
    """Go on to what is given at the next place; None if there is no equilibrium that holds near the last one.

    One that full Newton steps do not find is looked for only with `patient`.
    """
    sliding, start = carried_over(given, last)
    there = settle(remembering_rest(given, last), sliding, start, patient=patient)
    if there is None or change(given.model, there.q_springs, start) > FAR or may_have_passed(there.robot, last):
        return None
    return there


def may_have_passed(now: SlidingRobot, last: Rest) -> tuple[int, int, float] | None:
    """Find what of the robot, where it was asked last, may have passed through an obstacle since a rest; None if nothing."""
    before, surfaces = last.robot, now.last.gaps
    return may_pass(
        surfaces,
        now.at.gaps,
        now.given.environment,
        lambda margin: before.given.surroundings.at(before.at.q, margin),
    )


def move_to_rest(given: Given, last: Rest) -> Rest | None:
    """Follow overdamped motion from the last state until it rests; None if it does not.

    Returns:
        The state, with the work against friction of the whole motion.
    """
    (sliding, here), state, brake, work = carried_over(given, last), last, 1.0, 0.0
    for _ in range(_MOST_MOMENTS):
        given = remembering_rest(given, state)
        there = settle(given, sliding, here, brake, patient=False)
        there = there or settle(given, let_go(sliding), here, brake, patient=False)
        moved = math.inf if there is None else float(np.linalg.norm(there.q_springs - here))
        if there is None or moved > _FAR_MOVING or may_have_passed(there.robot, state):
            brake *= 4.0
            if brake > _STRONGEST:
                return None
            continue
        work += there.work
        sliding, here, state = there.sliding, there.q_springs, there
        if moved < _NEARLY_AT_REST:
            slow = max(brake, 1.0) * moved < _NEARLY_AT_REST  # without the brake it would hardly move farther
            rest = settle(remembering_rest(given, state), sliding, here) if slow else None
            if rest is not None and float(np.linalg.norm(rest.q_springs - here)) < _NEARLY_AT_REST:
                return rest._replace(work=work + rest.work)
            if moved < _STANDS:  # on an equilibrium that does not hold: a small push along its softest motion
                here, brake = here + _PUSH * there.robot.softest(there.found)[1], 1.0
            brake *= 0.5
    return None


def obstructed(given: Given, last: Rest) -> str:
    """What keeps a robot from following what is given from a rest, in words, after a semicolon; empty if nothing is near."""
    sliding, start = carried_over(given, last)
    robot = SlidingRobot(given, sliding)
    if robot.contacts(start) is None:
        return ""
    gaps, surroundings = robot.at.gaps, given.surroundings
    passed = may_have_passed(robot, last)
    if passed is not None:
        capsule, obstacle, way = passed
        name = (*given.environment.names, "the robot itself")[obstacle]
        what = f"{surroundings.link(capsule)!r} and {name!r} move by {way:.3g} m against each other at once"
        return f"; {what}: motors and poses must lead there in smaller steps, or give more rows"
    if not len(gaps):
        return ""
    link, other, _ = surroundings.pair(gaps, int(gaps.values.argmin()))
    return f"; {link!r} is at {other!r}: move robot or obstacle less far, or by another way"


def let_go(last: Sliding) -> Sliding:
    """Return the same with contacts that are taken as open at first.

    Where friction closes a gap by more than the normal force opens it, nothing but free space follows the edge of the cone
    (docs/theory.md, 9.5).
    """
    return replace(last, forces={key: (-_OPENS * force, np.zeros(3)) for key, (force, _) in last.forces.items()})


def energy_drop(given: Given, last: Rest, rest: Rest) -> float:
    """Return the potential energy of the last state at what is given, less that of another one and friction's work [J]."""
    if not given.load.conservative:
        return float("nan")
    sliding, start = carried_over(given, last)
    before = SlidingRobot(given, sliding)
    before.contacts(start)
    return before.energy() - rest.robot.energy() - rest.work


def change(model: SoftModel, there: FloatArray, here: FloatArray) -> float:
    """Return the size of a change of springs, relative to the mean stiffness of the springs."""
    return float(np.linalg.norm(np.sqrt(model.stiffness / model.stiffness.mean()) * (there - here)))


def remembering_rest(given: Given, last: Rest) -> Given:
    """Return what is given, for a robot with dry friction of its own with what that remembers of a rest."""
    return given if given.model.structure.friction is None else given._replace(model=last.given.model)


def carried_over(given: Given, last: Rest) -> tuple[Sliding, FloatArray]:
    """Return what friction remembers and the elastic coordinates in the robot given, which may have grown since.

    What has everted does not move along the tube: each place of the longer robot keeps the strains that it had, measured from
    the base; what is new at its tip is at rest. Forces stay where they press: on the candidate that is nearest now.
    """
    model, before = given.model, last.robot.model
    if model == before:
        return last.sliding, last.q_springs
    springs = last.q_springs if model.n_springs == before.n_springs else grown_springs(model, before, last.q_springs)
    given_before = last.robot.given
    joints = model.coordinates.at(given_before.q_motors, springs).joints
    there = Surroundings(model, given_before.environment).at(model.embed(joints), MARGIN * model.reach)
    return Sliding(last.sliding.friction, there, forces_of(there, last.robot.touches(last.found))), springs


def grown_springs(model: SoftModel, before: SoftModel, q_springs: FloatArray) -> FloatArray:
    """Return the elastic coordinates of a robot of sections in the shape of another one, longer or shorter.

    Args:
        model: The robot.
        before: The same robot at another length.
        q_springs: Elastic coordinates of that, shape (n,).

    Raises:
        ParameterError: If the robots have other elastic coordinates than those of sections, or other motors.
    """
    rows, old_rows = model.structure.section_table, before.structure.section_table
    if model.n_motors != before.n_motors or any(
        len(table.rest) != sum(len(row.places) for row in table.structure.section_table) for table in (model, before)
    ):
        raise ParameterError("model", model, f"of the same coordinates along the path, or of sections alone; was {before!r}")
    ends, old_ends = (np.concatenate([[0.0], np.cumsum([row.length for row in table])]) for table in (rows, old_rows))
    springs = np.array(model.rest)
    for name in rows[0].places:
        places, old_places = ([row.places[name] for row in table] for table in (rows, old_rows))
        turned = np.concatenate([[0.0], np.cumsum((q_springs - before.rest)[old_places])])
        springs[places] += np.diff(np.interp(ends, old_ends, turned))
    return springs
