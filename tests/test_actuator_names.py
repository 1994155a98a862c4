"""Actuator coordinates given by name: the same as in order wherever they go; errors tell every actuator with its unit."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.environment.capsule_error import capsule_error
from tests.support import law_robots
from tests.support.tables import each_row

ARM, MOUNTED = law_robots.model("arm"), law_robots.model("mounted")
MOTORS, TORQUES = np.array([0.3, 0.6, -0.8]), np.array([10.193, -16.605, -7.675])
POSTURE = np.array([0.3, 0.6, -0.8, 0.41, 0.42, 0.40])
DOWN = (0.0, 0.0, -1.0)


def by_name(model: sr.SoftModel, values: Any) -> dict[str, Any]:
    """A mapping by actuator, its last actuator first."""
    return dict(list(zip(model.motor_joints, np.moveaxis(np.asarray(values), -1, 0), strict=True))[::-1])


PATH = np.linspace([0.9, 0.3, 0.2], [0.9, 0.2, 0.3], 3)
FLOOR = sr.Environment([sr.HalfSpace(normal=(0.0, 0.0, 1.0), offset=-2.0)])
CALLS: dict[str, Callable[[Any], Any]] = {
    "configuration": lambda q: ARM.configuration(q(MOTORS)),
    "solve_equilibrium": lambda q: sr.solve_equilibrium(ARM, q(MOTORS), (0, 10, -15)).q,
    "solve_equilibrium, fixed point": lambda q: sr.solve_equilibrium(ARM, q(MOTORS), (0, 1, -5), method="fixed_point").q,
    "solve_imposed_displacement": lambda q: sr.solve_imposed_displacement(ARM, q(MOTORS), 0.02, direction=DOWN).force,
    "estimate_load": lambda q: sr.estimate_load(ARM, q(MOTORS), q(TORQUES)).force,
    "critical_load": lambda q: sr.critical_load(ARM, q(0.0 * MOTORS), (-1.0, 0.0, 0.0)),
    "solve_ik": lambda q: sr.solve_ik(ARM, (0.9, 0.3, 0.2), q_motors0=q(MOTORS), starts=1).q_motors,
    "follow_trajectory": lambda q: sr.follow_trajectory(ARM, PATH, q_motors0=q(MOTORS)).q_motors,
    "follow_contact": lambda q: [
        row.q_springs for row in sr.follow_contact(ARM, q(np.array([MOTORS, MOTORS + 0.01])), environment=FLOOR).equilibria
    ],
    "simulate": lambda q: sr.simulate(ARM, 0.002, q(MOTORS), force=(0, 0, -1)).q_springs,
    "simulate over time": lambda q: sr.simulate(ARM, 0.002, lambda t: q(MOTORS + t), force=(0, 0, -1)).q_springs,
    "PD": lambda q: sr.simulate(ARM, 0.002, MOTORS, motors="torque", torque=sr.PD(ARM, q(MOTORS), 50.0, 1.0)).q_springs,
    "PD over time": lambda q: (
        sr.simulate(ARM, 0.002, MOTORS, motors="torque", torque=sr.PD(ARM, lambda t: q(MOTORS + t), 50.0, 1.0)).q_springs
    ),
    "to_mjcf": lambda q: [float(word) for word in re.findall(r'ctrl="([^"]*)"', sr.export.to_mjcf(ARM, q(MOTORS)))[0].split()],
    "mounted": lambda q: sr.solve_equilibrium(MOUNTED, q(POSTURE), DOWN).q,
    "capsule_error": lambda q: capsule_error(MOUNTED, q(POSTURE)),
}
"""A public function of each kind with `q_motors`, in the form that `q` gives it."""


@settings(max_examples=3)
@given(st.permutations(range(6)), st.integers(0, 2**31))
def test_names_in_any_order_are_the_actuators(order: list[int], seed: int) -> None:
    """Whatever their order, and in any kind of mapping, numbers by name are those of the actuators, bit for bit."""
    values = POSTURE + np.random.default_rng(seed).uniform(-0.01, 0.01, 6)
    names = MOUNTED.actuator_names
    named = MappingProxyType({names[place]: values[place] for place in order})
    assert np.array_equal(MOUNTED.actuators.in_order(named, "q_motors"), values)
    assert MOUNTED.actuator_units == ("rad",) * 3 + ("m",) * 3


@pytest.mark.study
@each_row("call", CALLS)
def test_every_function_takes_names(call: str) -> None:
    model = ARM if len(MOTORS) == 3 and call not in ("mounted", "capsule_error") else MOUNTED
    named = CALLS[call](lambda values: by_name(model, values))
    assert np.array_equal(np.asarray(named), np.asarray(CALLS[call](lambda values: values)))


COMPILED: dict[str, Callable[[Any, Any], Any]] = {
    "equilibrium": lambda solver, q: solver.equilibrium(q(MOTORS), DOWN).q_springs,
    "equilibria": lambda solver, q: solver.equilibria(q(np.array([MOTORS, 0.5 * MOTORS])), DOWN).q_springs,
    "estimate_load": lambda solver, q: solver.estimate_load(q(MOTORS), q(TORQUES)).force,
    "estimate_loads": lambda solver, q: solver.estimate_loads(q(np.tile(MOTORS, (2, 1))), q(np.tile(TORQUES, (2, 1)))).forces,
    "inverse_kinematics": lambda solver, q: solver.inverse_kinematics(PATH, q_motors0=q(MOTORS)).q_motors,
    "follow": lambda solver, q: solver.follow(PATH, q_motors0=q(solver.follow(PATH).q_motors[0])).q_motors,
}


@pytest.mark.study
@each_row("call", COMPILED)
def test_compiled_solvers_take_names(call: str) -> None:
    solver = sr.compile(ARM, backend="python")
    named = COMPILED[call](solver, lambda values: by_name(ARM, values))
    assert np.array_equal(named, COMPILED[call](solver, lambda values: values))


def test_a_row_of_a_table_goes_by_its_names_and_one_without_names_by_its_order(tool: Callable[[str], ModuleType]) -> None:
    pandas = tool("pandas")
    table = pandas.DataFrame({"motor_3": [-0.8], "motor_1": [0.3], "motor_2": [0.6]})
    assert np.array_equal(ARM.checked_motors(table.iloc[0]), MOTORS)
    assert np.array_equal(ARM.checked_motors(pandas.Series(MOTORS)), MOTORS)


def seventeen() -> sr.SoftModel:
    """Eight motors, in rad, and nine muscles, in m."""
    arm = sr.InflatableArm(link_lengths=(0.3,) * 7)
    return sr.load_model(sr.mount(arm, "tip", sr.PccArm(segment_lengths=(0.4,) * 3, offset=(0.0,) * 3, elastic_sections=1)))


def test_every_refusal_tells_all_seventeen_actuators() -> None:
    model = seventeen()
    rows = zip(model.actuator_names, model.actuator_units, model.motor_limits, strict=True)
    told = [f"{name} [{unit}] ({low:.4g} to {high:.4g})" for name, unit, (low, high) in rows]
    assert [row.count("[rad]") for row in told] == [1] * 8 + [0] * 9
    relaxed = by_name(model, model.relaxed_motors)
    motor, muscle = model.actuator_names[1], model.actuator_names[9]
    refused: list[tuple[Any, type[sr.SoftRobotsError], str, str]] = [
        ([0.0] * 3, sr.ParameterError, "(it has shape (3,))", ", "),
        ({name: 0.0 for name in relaxed if name != muscle}, sr.ParameterError, f"{muscle} missing", ", "),
        (relaxed | {"motor_99": 0.0}, sr.NameNotFound, "no actuator is called 'motor_99' (did you mean", "\n  "),
    ]
    for value, kind, text, between in refused:
        with pytest.raises(kind) as caught:
            sr.solve_equilibrium(model, value)
        assert text in str(caught.value)
        assert between.join(told) in str(caught.value)
    for name, unit in ((motor, "rad"), (muscle, "m")):
        with pytest.raises(sr.ParameterError, match=re.escape(f", {name} [{unit}] (")):
            sr.solve_equilibrium(model, relaxed | {name: np.nan})


@each_row(
    ("value", "text"),
    [
        ({"motor_1": [1.0, 2.0], "motor_2": [1.0, 2.0, 3.0], "motor_3": 0.0}, "as many for one as for another"),
        ({"motor_1": [1.0, 2.0], "motor_2": 0.0, "motor_3": 0.0}, "(it has shape (2, 3))"),
        ({"motor_1": "1", "motor_2": 0.0, "motor_3": 0.0}, "motor_1'] must be a number: motor_1 [rad]"),
        ({0: 0.1, 1: 0.2, 2: 0.3}, "no actuator is called"),
        ({}, "motor_1, motor_2, motor_3 missing"),
    ],
)
def test_other_mappings_are_refused(value: Any, text: str) -> None:
    with pytest.raises(sr.SoftRobotsError) as caught:
        sr.solve_equilibrium(ARM, value)
    assert text in str(caught.value)


def test_torques_that_are_none_are_told_with_actuator_and_unit() -> None:
    with pytest.raises(sr.ParameterError, match=re.escape("motor_2 [N m], is nan")):
        sr.estimate_load(ARM, MOTORS, [1.0, np.nan, 2.0])
    with pytest.raises(sr.NameNotFound, match="no actuator is called 'motor_4'"):
        sr.estimate_load(ARM, MOTORS, {"motor_4": 1.0})


def test_a_robot_without_actuators_takes_none() -> None:
    tube = law_robots.model("helix")
    assert tube.checked_motors({}).shape == (0,)
    with pytest.raises(sr.ParameterError, match="the robot has no actuators"):
        sr.solve_equilibrium(tube, [1.0])
