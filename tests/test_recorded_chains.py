"""Robots whose parameters differ from row to row: numbers from recorded expansions, derivatives of equilibria."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled.trace.numbers import numbers_of
from softrobots.identification.parameters import ParameterSet
from softrobots.learning.differentiable import Differentiable
from softrobots.learning.number_changes import NumberChanges
from softrobots.learning.recorded_chains import many_numbers

DOWN = (0.0, 0.0, -9.81)
OPTIONS: dict[str, Any] = dict(backend="python", threads=1, failed="raise")
ARM = sr.InflatableArm(rest_up=0.1, payload=0.3)
SLACK = sr.InflatableArm(link_model="two_hinges", moment_law="slack_wall", pressure=3e4)
ARMS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "arm": (ARM, ("link[*].stiffness", "hinge_offset", "link[*].wall_thickness", "link[*].radius", "link_lengths")),
    "two hinges": (sr.InflatableArm(link_model="two_hinges", torsion=True), ("radius", "density", "young_modulus")),
    "slack wall": (SLACK, ("radius", "pressure", "density")),
    "given spring": (sr.load_model(ARM, springs={"spring_1_up": 77.0}), ("stiffness", "hinge_offset")),
    "joint springs": (ARM, ("joint[*].stiffness", "joint[spring_1_up].rest", "radius")),
    "file": (sr.load_model(ARM.urdf()), ("joint[*].stiffness", "joint[*].rest")),
    "wrist": (sr.InflatableArm(wrist=(0.05, 0.1)), ("stiffness", "wrist_mass", "rest_side", "base_mass")),
}


@pytest.mark.parametrize("name", ARMS)
def test_numbers_of_many_robots_are_those_of_each_loaded_alone(name: str) -> None:
    """By Pinocchio's parser and composition, also where a comparison in the xacro file comes out otherwise than for others."""
    robot, names = ARMS[name]
    given = ParameterSet.of(robot, [one for one in names if one != "young_modulus"])
    random = np.random.default_rng(4)
    rows = given.values + random.uniform(-0.2, 0.2, (40, len(given.names))) * np.where(given.values == 0.0, 1.0, given.values)
    asked: list[tuple[float, ...]] = []

    def loaded(values: tuple[float, ...]) -> np.ndarray:
        asked.append(values)
        return numbers_of(given.model(values).chain())

    found = many_numbers(given, rows, loaded)
    assert np.isfinite(found).all()
    assert len(asked) <= 8  # the present robot, and one for each way that comparisons come out
    for row, numbers in zip(rows, found, strict=True):
        assert numbers == pytest.approx(loaded(tuple(row.tolist())), rel=1e-12, abs=1e-15)


def test_joint_springs_of_a_slack_wall_are_loaded() -> None:
    """They are to be alike at each hinge, which the loader checks."""
    given = ParameterSet.of(
        sr.InflatableArm(moment_law="slack_wall", pressure=3e4), "joint[spring_1_side,spring_1_up].stiffness"
    )
    rows = given.values * np.array([[1.01], [0.99]])
    assert np.isnan(many_numbers(given, rows, lambda at: numbers_of(given.model(at).chain()))).all()
    with pytest.raises(sr.ParameterError, match="structure of the robot"):
        Differentiable("equilibrium", given.present, "joint[spring_1_up].stiffness", gravity=None, **OPTIONS)


def test_a_joint_spring_that_is_not_positive_is_refused() -> None:
    """It is a number of the chain, which nothing else looks at."""
    solver = Differentiable("equilibrium", sr.load_model(ARM.urdf()), "joint[spring_1_up].stiffness", gravity=None, **OPTIONS)
    for bad in (0.0, -90.0, np.nan):
        with pytest.raises(sr.ParameterError, match=r"spring_1_up|finite"):
            solver.solve(np.zeros(3), np.zeros(3), np.array([[90.0], [bad], [100.0]]))


@pytest.mark.parametrize("name", ["arm", "slack wall", "joint springs", "file", "wrist"])
def test_derivatives_by_parameters_of_each_row_are_differences_of_its_robot(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In both modes, which are transposes of each other; few robots are loaded for them."""
    robot, names = ARMS[name]
    solver = Differentiable(
        "equilibrium", robot, (*names, "motor[2].offset"), gravity=DOWN, backend="python", threads=1, failed="raise"
    )
    random, count, size = np.random.default_rng(5), 6, len(solver.names)
    present = np.where(solver.present == 0.0, 0.1, solver.present)
    rows = solver.present + random.uniform(-0.05, 0.05, (count, size)) * present
    motors, forces = random.uniform(-1.0, 1.0, (count, solver.model.n_motors)), 3.0 * random.normal(size=(count, 3))
    inputs = [motors, forces, rows]
    results = solver.solve(*inputs)
    loads: list[object] = []
    load = NumberChanges._numbers
    monkeypatch.setattr(NumberChanges, "_numbers", lambda self, values: loads.append(values) or load(self, values))
    solver._changes.numbers = lambda values: NumberChanges._numbers(solver._changes, values)  # type: ignore[union-attr]

    rates = random.normal(size=rows.shape) * present
    pushed = solver.push(inputs, results, [None, None, rates])
    weights = [random.normal(size=one.shape) for one in results]
    pulled = np.asarray(solver.pull(inputs, results, weights, [None, None, (count,)])[2])
    assert len(loads) <= 12

    def solved(row: int, along: float) -> np.ndarray:
        values = rows[row] + along * rates[row]
        found = sr.solve_equilibrium(
            solver._set.model(values),
            motors[row] + solver._set.motor_offsets(values),
            forces[row],
            gravity=DOWN,
            tolerance=1e-13,
        )
        return np.concatenate([found.q_springs, found.tip_position])

    step = 3e-4
    for row in range(count):
        near, far = (solved(row, one * step) - solved(row, -one * step) for one in (1.0, 2.0))
        slope = (8.0 * near - far) / (12.0 * step)
        own = np.concatenate([one[row] for one in pushed])
        assert own == pytest.approx(slope, abs=1e-8 * np.abs(slope).max() + 1e-10)
        weighted = np.concatenate([one[row] for one in weights]) @ own
        assert pulled[row] @ rates[row] == pytest.approx(weighted, rel=1e-10, abs=1e-12)


def test_rows_of_parameters_that_a_robot_refuses_are_told() -> None:
    """As for one row: the check of the robot comes before its numbers."""
    solver = Differentiable("equilibrium", ARM, "wall_thickness", gravity=None, **OPTIONS)
    with pytest.raises(sr.ParameterError, match="wall_thickness"):
        solver.solve(np.zeros(3), np.zeros(3), np.array([[3e-4], [-1e-4], [2e-4]]))


def test_a_parameter_at_its_bound_has_derivatives_to_one_side() -> None:
    """Read from the tape as for rows beside it."""
    solver = Differentiable(
        "equilibrium", replace(ARM, cap_mass=0.1), "cap_mass", gravity=DOWN, backend="python", threads=1, failed="raise"
    )
    inputs = [np.array([0.3, 0.6, -0.8]), np.zeros(3), np.array([[0.0], [0.1], [0.2]])]
    results = solver.solve(*inputs)
    slopes = solver.push(inputs, results, [None, None, np.ones((3, 1))])[1][:, 2]
    tips = [solver.solve(*inputs[:2], np.array([value]))[1][2] for value in (0.0, 1e-3, 2e-3)]
    assert slopes[0] == pytest.approx((4.0 * tips[1] - tips[2] - 3.0 * tips[0]) / 2e-3, rel=1e-6)
    assert np.isfinite(slopes).all()
