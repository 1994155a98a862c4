"""Derivatives of equilibria in contact by parameters, actuators and loads: solved equilibria nearby, and a beam on a prop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, HalfSpace, Sphere
from softrobots.identification.sensitivity import Sensitivity

MOTORS, FORCE = np.array([0.1, 0.9, -0.4]), np.array([0.0, 1.0, -20.0])
WALL = Environment([HalfSpace((-1, 0, 0), -1.0, name="wall")])
AROUND = {
    "wall": WALL,
    "ball": Environment([Sphere(0.3, (1.25, 0.02, 0.75))]),
    "edge": Environment([Box((0.3, 0.3, 0.3), (0.75, 0.02, 0.47))]),
    "two": Environment([HalfSpace((-1, 0, 0), -1.0), HalfSpace((0, -1, 0), -0.16)]),
}
NAMES = (
    "link[2].stiffness",
    "rest_up",
    "link[1].link_lengths",
    "link[2].radius",
    "motor[1]",
    "motor[2].offset",
    "base.position",
    "base.rotation",
    "force",
)


def told(found: sr.Equilibrium) -> np.ndarray:
    """What is differentiated, in one row."""
    pressed = [contact.normal_force for contact in found.contacts]
    return np.concatenate([found.tip_position, found.q_springs, found.motor_torques, pressed])


def solved(at: Sensitivity, place: int, value: float) -> np.ndarray:
    """The same of the equilibrium that is solved with another value of a parameter; obstacles move where the base does."""
    one, found = at.parameters.parameters[place], at.equilibrium
    values = np.array(at.parameters.values)
    values[place] = value
    parts, kind = list(one.place.parts), one.place.kind
    motors, force, motion = found.q_motors.copy(), found.load.wrenches["tip"][:3].copy(), np.zeros(6)
    if kind in ("motor", "offset"):
        motors[parts] += value - (at.parameters.values[place] if kind == "motor" else 0.0)
    elif kind == "force":
        force[parts] += value - at.parameters.values[place]
    elif kind == "base":
        motion[parts[0] + (3 if one.place.names[0] == "rotation" else 0)] = value
    base, around = pin.SE3(pin.exp3(motion[3:]), motion[:3]), found.environment
    for name in around.names if motion.any() else ():
        around = around.moved(name, base.inverse())
    options: Any = {"environment": around, "q_springs0": found.q_springs, "tolerance": 1e-13}
    row = told(sr.solve_equilibrium(at.parameters.model(values), motors, base.rotation.T @ force, **options))
    row[:3] = base.act(row[:3])
    return row


def require_differences(at: Sensitivity, step: float = 1e-4) -> None:
    """Derivatives are those of central differences of fourth order to 1e-7: steps of 1e-4, forces solved to 1e-13."""
    exact = np.concatenate([at.tip_position, at.q_springs, at.motor_torques, at.normal_forces])
    for place, name in enumerate(at.names):
        value = at.parameters.values[place]
        h = step * max(abs(value), 0.1)
        rows = [solved(at, place, value + share * h) for share in (-2, -1, 1, 2)]
        slopes = np.array([1.0, -8.0, 8.0, -1.0]) @ rows / (12.0 * h)
        assert np.abs(exact[:, place] - slopes).max() < 1e-7 * np.abs(slopes).max(), name


@pytest.mark.study
@pytest.mark.parametrize("around", AROUND.values(), ids=AROUND)
def test_derivatives_in_contact_are_those_of_solved_equilibria(around: Environment) -> None:
    arm = sr.load_model(sr.InflatableArm())
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=around)
    assert found.stable
    assert len(found.contacts) == len(around)
    at = sr.sensitivity(arm, found, NAMES)
    require_differences(at)
    weights = np.array([0.3, -0.5, 0.8])
    assert at.gradient(weights) == pytest.approx(weights @ at.tip_position, rel=1e-9, abs=1e-12)


def test_motors_are_those_of_the_elastostatic_jacobian() -> None:
    arm = sr.load_model(sr.InflatableArm())
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=WALL)
    at = sr.sensitivity(arm, found, ("motor[*]", "force"))
    assert at.tip_position[:, :3] == pytest.approx(sr.elastostatic_jacobian(arm, found), rel=1e-9, abs=1e-12)
    assert at.tip_position[:, 3:] == pytest.approx(sr.compliance(arm, found)[:3, :3], rel=1e-9, abs=1e-12)
    contact = sr.contact_sensitivity(arm, found)
    assert at.normal_forces == pytest.approx(np.hstack([contact.by_motors, contact.by_wrench[:, :3]]), rel=1e-9, abs=1e-12)


@pytest.mark.study
def test_a_rod_of_sections_with_muscles_leans_on_a_wall() -> None:
    """Elastic coordinates that are no joints, and actuators along the body."""
    arm = sr.load_model(sr.PccArm(elastic_sections=4), muscles="forces")
    pulled, force = np.array([20.0, 0.0, 0.0, 0.0, 0.0, 0.0]), (0.3, 0.1, 0.05)
    free = sr.solve_equilibrium(arm, pulled, (0.3, 0, 0))
    wall = Environment([HalfSpace((-1, 0, 0), -0.8 * free.tip_position[0] - 0.05)])
    found = sr.solve_equilibrium(arm, pulled, force, environment=wall)
    assert [contact.strict for contact in found.contacts] == [True]
    require_differences(sr.sensitivity(arm, found, ("segment_lengths[1]", "radius", "motor[1]", "force")))


@pytest.mark.study
@pytest.mark.parametrize("name", ["gravity.x", "segment_lengths"])
def test_a_prop_carries_more_of_a_heavier_and_of_a_longer_beam(name: str) -> None:
    r"""`R = w (6 L^2 - 4 L a + a^2) / (8 a)` for a prop at `a`, `3 w L / 8` at the end, and its derivatives by `w` and `L`.

    Second order in the number of sections: of 5 and 15, with the prop at a quarter of one, the extrapolated derivative. By the
    length the prop moves over a section, too, which leaves a part of first order.
    """
    length, a, density, ball, radius, bending = 1.0, 0.65, 0.6, 0.02, 0.01, 2.0
    weight = 8.0 * bending * 1e-4 / length**3  # bends by 1e-4 of the length: its square is the error of the linear theory
    found = []
    for sections in (5, 15):
        robot = sr.PccArm(
            segment_lengths=(length,), muscle_azimuths=(), elastic_sections=sections, radius=radius,
            bending_stiffness=bending, linear_density=density,
        )  # fmt: skip
        rod = sr.load_model(robot)
        prop = Environment([Capsule(ball, 0.2, (-radius - ball, 0.0, a), ((1, 0, 0), (0, 0, -1), (0, 1, 0)))])
        state = sr.solve_equilibrium(rod, (), gravity=(-weight / density, 0.0, 0.0), environment=prop)
        found.append(float(sr.sensitivity(rod, state, name).normal_forces[0, 0]))
    by_length = weight * (12.0 * length - 4.0 * a) / (8.0 * a)
    by_gravity = -density * (6.0 * length**2 - 4.0 * length * a + a**2) / (8.0 * a)
    extrapolated = found[1] + (found[1] - found[0]) / 8.0
    assert extrapolated == pytest.approx(by_gravity if name == "gravity.x" else by_length, rel=5e-3)


def test_what_has_no_derivative_in_contact_is_refused_by_name() -> None:
    arm = sr.load_model(sr.InflatableArm())
    tip = sr.solve_equilibrium(arm, (0, 0, 0)).tip_position
    resting = Environment([HalfSpace((0, 0, 1), float(tip[2]) - 0.055)])
    found = sr.solve_equilibrium(arm, (0, 0, 0), environment=resting)
    assert [contact.strict for contact in found.contacts] == [False] * len(found.contacts) != []
    with pytest.raises(sr.ParameterError, match="without force one opens or presses"):
        sr.sensitivity(arm, found, "stiffness")
    twice = Environment([HalfSpace((-1, 0, 0), -1.0, name="wall"), HalfSpace((-1, 0, 0), -1.0, name="same")])
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=twice)
    with pytest.raises(sr.ParameterError, match="forces are not unique"):
        sr.sensitivity(arm, found, "stiffness")
    path = sr.follow_contact(arm, MOTORS, [FORCE, 1.1 * FORCE], environment=WALL, friction=0.3)
    with pytest.raises(sr.ParameterError, match="friction"):
        sr.sensitivity(arm, path.equilibria[-1], "stiffness")
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=WALL)
    with pytest.raises(sr.ParameterError, match="frequencies"):
        sr.sensitivity(arm, found, "stiffness").frequencies(sr.vibration_modes(arm, found))
