"""Derivatives of compiled equilibria and load estimates: differences of robots that Pinocchio solves."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.learning.differentiable import Differentiable

DOWN = (0.0, 0.0, -9.81)
OPTIONS: dict[str, Any] = dict(backend="python", threads=1, failed="raise")
STEP = 1e-3
"""Of differences of fourth order, relative to the numbers; their error is about its fourth power."""
TOLERANCE = 1e-8
ROBOTS: dict[str, tuple[sr.InflatableArm, dict[str, float], Any]] = {
    "paper": (sr.InflatableArm(payload=0.3), {"stiffness": 180.0, "hinge_offset": 0.03, "wall_thickness": 4e-4}, DOWN),
    "weightless": (sr.InflatableArm(), {"stiffness": 180.0, "rest_up": 0.1}, None),
    "two hinges": (sr.InflatableArm(link_model="two_hinges", torsion=True), {"radius": 0.05, "density": 1300.0}, DOWN),
    "slack wall": (
        sr.InflatableArm(link_model="two_hinges", moment_law="slack_wall", pressure=3e4),
        {"pressure": 3e4, "radius": 0.05},
        DOWN,
    ),
    "wrist": (sr.InflatableArm(wrist=(0.05, 0.1)), {"stiffness": 180.0, "hinge_offset": 0.03}, DOWN),
}
"""A robot, values of its parameters, and gravity."""


def differences(solve: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Differences of fourth order by each number, shape (results, numbers)."""
    columns = []
    for place, value in enumerate(at):
        step = np.zeros(len(at))
        step[place] = STEP * (abs(value) or 1.0)
        near, far = solve(at + step) - solve(at - step), solve(at + 2.0 * step) - solve(at - 2.0 * step)
        columns.append((8.0 * near - far) / (12.0 * step[place]))
    return np.array(columns).T


def check(solver: Differentiable, inputs: list[FloatArray], solve: Callable[..., FloatArray], error: float = 1e-10) -> None:
    """Compare both modes with differences, by numbers relative to their size; a second case makes it a batch.

    `error` is that of what is solved: of equilibria 1e-12 of their load.
    """
    tolerance = max(TOLERANCE, error / STEP)
    sizes = np.concatenate([np.where(one == 0.0, 1.0, np.abs(one)) for one in inputs])
    ends = np.cumsum([len(one) for one in inputs])[:-1]
    slopes = differences(lambda x: solve(*np.split(x, ends)), np.concatenate(inputs)) * sizes
    scale = np.abs(slopes).max()
    rows = [np.stack([inputs[0], 0.5 * inputs[0]]), inputs[1], inputs[2]]
    results = solver.solve(*rows)
    assert np.concatenate([one[0] for one in results]) == pytest.approx(solve(*inputs), abs=10.0 * error)
    random = np.random.default_rng(7)
    rates = random.normal(size=len(sizes))
    pushed = solver.push(rows, results, np.split(rates * sizes, ends))
    assert np.concatenate([one[0] for one in pushed]) == pytest.approx(slopes @ rates, abs=tolerance * scale)
    weights = [np.array([random.normal(size=one.shape[1]), np.zeros(one.shape[1])]) for one in results]
    shapes: list[tuple[int, ...]] = [(2,), (2,), ()]
    pulled = solver.pull(rows, results, weights, shapes)
    own = np.concatenate([one if one.ndim == 1 else one[0] for one in map(np.asarray, pulled)]) * sizes
    assert own == pytest.approx(np.concatenate([one[0] for one in weights]) @ slopes, abs=tolerance * scale)
    # The sums over a batch are those of both cases: forward and reverse mode are transposes of each other.
    weights = [random.normal(size=one.shape) for one in results]
    pulled = solver.pull(rows, results, weights, [(2,), (), ()])
    forward = sum(float((a * b).sum()) for a, b in zip(weights, pushed, strict=True))
    parts = zip(pulled, np.split(rates * sizes, ends), strict=True)
    assert forward == pytest.approx(sum(float((np.asarray(a) * b).sum()) for a, b in parts), rel=1e-11)


@pytest.mark.study
@pytest.mark.parametrize("name", ["paper", "slack wall", "wrist"])
def test_derivatives_of_equilibria_are_differences_of_solved_robots(name: str) -> None:
    """By motors, force and parameters of the robot, in both modes."""
    robot, values, gravity = ROBOTS[name]
    solver = Differentiable("equilibrium", replace(robot, **values), list(values), gravity=gravity, **OPTIONS)

    def solve(motors: FloatArray, force: FloatArray, parameters: FloatArray) -> FloatArray:
        model = sr.load_model(replace(robot, **dict(zip(values, parameters.tolist(), strict=True))))
        found = sr.solve_equilibrium(model, motors, force, gravity=gravity)
        return np.concatenate([found.q_springs, found.tip_position])

    motors = np.array([0.4, 0.7, -0.8, 0.3, -0.5, 0.2])[: solver.model.n_motors]
    check(solver, [motors, np.array([2.0, 4.0, -5.0]), np.array(list(values.values()))], solve)


@pytest.mark.study
@pytest.mark.parametrize("name", ["paper", "wrist"])
def test_derivatives_of_load_estimates_are_differences_of_estimates(name: str) -> None:
    """With three motors, and with six whose torques no force explains: the force is that of least squares."""
    robot, values, gravity = ROBOTS[name]
    changed = replace(robot, **values)
    model = sr.load_model(changed)
    motors = np.array([0.4, 0.7, -0.8, 0.3, -0.5, 0.2])[: model.n_motors]
    felt = sr.solve_equilibrium(model, motors, (2.0, 4.0, -5.0), gravity=gravity).motor_torques
    torques = felt + np.array([0.05, -0.1, 0.08, 0.02, -0.06, 0.1])[: model.n_motors]
    solver = Differentiable("estimate", changed, list(values), gravity=gravity, **OPTIONS)

    def solve(motors: FloatArray, torques: FloatArray, parameters: FloatArray) -> FloatArray:
        model = sr.load_model(replace(robot, **dict(zip(values, parameters.tolist(), strict=True))))
        found = sr.estimate_load(model, motors, torques, gravity=gravity)
        return np.concatenate([found.equilibrium.q_springs, found.equilibrium.tip_position, found.force])

    # Least squares converge linearly.
    check(solver, [motors, torques, np.array(list(values.values()))], solve, 1e-10 if name == "paper" else 1e-8)


def test_rows_without_a_result_are_named_or_marked() -> None:
    """A row that fails changes no other; its gradient is zero."""
    names = ("stiffness", "motor[2].offset")
    motors, force = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]), np.array([1.0, 2.0, -3.0])
    broken = motors.copy()
    broken[1, 2] = np.nan
    strict = Differentiable("equilibrium", sr.InflatableArm(), names, gravity=None, **OPTIONS)
    with pytest.raises(sr.ParameterError, match=r"rows = \[1\].*finite motors"):
        strict.solve(broken, force, strict.present)
    marking = Differentiable("equilibrium", sr.InflatableArm(), names, gravity=None, **(OPTIONS | {"failed": "nan"}))
    whole, part = marking.solve(motors, force, strict.present), marking.solve(broken, force, strict.present)
    for a, b in zip(whole, part, strict=True):
        assert np.isnan(b[1]).all()
        assert np.array_equal(a[::2], b[::2])
    weights, inputs = [np.ones((3, 4)), np.ones((3, 3))], [broken, force, strict.present]
    found = marking.pull(inputs, part, weights, [(3,), (3,), ()])
    rest = strict.pull(
        [motors[::2], force, strict.present], [one[::2] for one in whole], [one[::2] for one in weights], [(2,), (2,), ()]
    )
    for a, b in zip(found[:2], rest[:2], strict=True):
        assert np.array_equal(np.asarray(a)[::2], b)
        assert np.array_equal(np.asarray(a)[1], np.zeros(3))
    assert found[2] == pytest.approx(np.asarray(rest[2]), rel=1e-13)
    assert np.isnan(marking.push(inputs, part, [np.ones(3), None, None])[1][1]).all()


def test_rows_of_parameters_are_robots_of_their_own() -> None:
    """Their order and repetition do not matter, and each has the answers of `softrobots.compile` of that robot."""
    solver = Differentiable("equilibrium", sr.InflatableArm(), "stiffness", gravity=None, **OPTIONS)
    motors, force = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]), np.array([1.0, 2.0, -3.0])
    stiffness = np.array([150.0, 200.0, 150.0])[:, None, None]
    springs, tips = solver.solve(motors, force, stiffness)
    assert springs.shape == (3, 2, 4)
    for row, value in enumerate(stiffness.ravel()):
        batch = sr.compile(sr.load_model(sr.InflatableArm(stiffness=value)), backend="python").equilibria(motors, force)
        assert springs[row] == pytest.approx(batch.q_springs, abs=1e-14)
        assert tips[row] == pytest.approx(batch.tip_positions, abs=1e-14)


def test_equal_rows_of_parameters_are_one_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those that are mapped over; each row of parameters has a gradient of its own."""
    solver = Differentiable("equilibrium", sr.InflatableArm(), "stiffness", gravity=None, **OPTIONS)
    asked: list[tuple[float, ...]] = []
    code = solver._changes.code
    monkeypatch.setattr(solver._changes, "code", lambda values, **more: asked.append(values) or code(values, **more))
    random = np.random.default_rng(3)
    motors, force = random.uniform(-1.0, 1.0, (4, 3)), np.array([1.0, 2.0, -3.0])
    stiffness = np.array([150.0, 200.0, 150.0, 150.0])[:, None]
    results = solver.solve(motors, force, stiffness)
    rates = solver.push([motors, force, stiffness], results, [None, None, np.ones((4, 1))])
    assert sorted(asked) == [(150.0,), (150.0,), (200.0,), (200.0,)]
    weights = [np.zeros((4, 4)), np.ones((4, 3))]
    pulled = solver.pull([motors, force, stiffness], results, weights, [None, None, (4,)])[2]
    assert pulled == pytest.approx(rates[1].sum(axis=1, keepdims=True), rel=1e-11)


def test_cases_that_the_passes_do_not_solve_start_at_the_rest_of_their_robot() -> None:
    """An arm with angles of rest that are parameters has the answers of `softrobots.compile` of that robot, under any load."""
    arm = sr.InflatableArm(rest_up=0.2)
    solver = Differentiable("equilibrium", arm, "rest_up", gravity=None, **(OPTIONS | {"failed": "nan"}))
    random = np.random.default_rng(3)
    motors, forces = random.uniform(-3.0, 3.0, (300, 3)), random.normal(size=(300, 3)) * 80.0
    springs, _ = solver.solve(motors, forces, np.array([-0.4]))
    batch = sr.compile(sr.load_model(replace(arm, rest_up=-0.4)), backend="python").equilibria(motors, forces)
    assert np.array_equal(batch.certified, np.isfinite(springs[:, 0]))
    assert springs[batch.certified] == pytest.approx(batch.q_springs[batch.certified], abs=1e-9)
    assert batch.certified.mean() > 0.9


def test_a_cantilever_without_motors_has_the_slopes_of_its_closed_form() -> None:
    """Small loads on hinges that share a stiffness: the tip moves by force over stiffness, whatever else there is."""
    rod = sr.PccArm(
        segment_lengths=(0.5,),
        muscle_azimuths=(),
        bending_stiffness=2.0,
        chain="lumped",
        hinges=4,
        torsion=False,
        extension=False,
    )
    solver = Differentiable("equilibrium", rod, "bending_stiffness", gravity=None, **OPTIONS)
    force = np.array([1e-6, 0.0, 0.0])
    inputs = [np.zeros(0), force, solver.present]
    results = solver.solve(*inputs)
    (by_force,) = (
        one
        for one in solver.pull(inputs, results, [np.zeros(8), np.array([1.0, 0.0, 0.0])], [None, (), None])
        if one is not None
    )
    sag = results[1][0]
    assert by_force[0] == pytest.approx(sag / 1e-6, rel=1e-9)
    _, _, by_stiffness = solver.pull(inputs, results, [np.zeros(8), np.array([1.0, 0.0, 0.0])], [None, None, ()])
    assert by_stiffness == pytest.approx([-sag / 2.0], rel=1e-9)


def test_what_has_no_compiled_derivatives_is_refused_by_name() -> None:
    options = OPTIONS | {"gravity": None}
    with pytest.raises(sr.ParameterError, match=r"pcc_arm.*without sections and muscles"):
        Differentiable("equilibrium", sr.PccArm(), (), **options)
    with pytest.raises(sr.ParameterError, match=r"force.*actuators and loads are arguments of their own"):
        Differentiable("equilibrium", sr.InflatableArm(), "force", **options)
    with pytest.raises(sr.NameNotFound, match="stifness"):
        Differentiable("equilibrium", sr.InflatableArm(), "stifness", **options)
    with pytest.raises(sr.ParameterError, match="three motors"):
        Differentiable("estimate", sr.InflatableArm(link_lengths=(0.6,)), (), **options)


@pytest.mark.study
@pytest.mark.shortened(250, 100_000)
def test_derivatives_of_random_cases(cases: int) -> None:
    """All inputs change at once, in a random direction: rates are differences of batches, and both modes are transposes.

    Where a wall begins to go slack within a step, differences are worse than derivatives; those of two steps say so.
    """
    random, checked = np.random.default_rng(23), 0
    for robot, values, gravity in ROBOTS.values():
        options = OPTIONS | {"failed": "nan"}
        solver = Differentiable("equilibrium", replace(robot, **values), list(values), gravity=gravity, **options)
        slack = robot.moment_law == "slack_wall"
        count, drawn = min(2000, cases // len(ROBOTS)), 0
        while drawn < cases // len(ROBOTS):
            drawn += count
            parameters = np.array(list(values.values())) * random.uniform(0.9, 1.1, len(values))
            motors, forces = random.uniform(-1.0, 1.0, (count, solver.model.n_motors)), random.normal(size=(count, 3)) * 5.0
            rates = [random.normal(size=motors.shape), random.normal(size=forces.shape)]
            rates.append(parameters * random.normal(size=len(values)))
            step, doubts = (0.1 * STEP, 1e3) if slack else (STEP, 0.0)
            checked += check_random(solver, [motors, forces, parameters], rates, random, step, TOLERANCE, doubts)
    assert checked > 0.95 * cases


@pytest.mark.study
@pytest.mark.timeout(1800)
@pytest.mark.shortened(50, 25_000)
@pytest.mark.parametrize("kind", [name for name in ROBOTS if name != "wrist"])
def test_derivatives_of_random_load_estimates(kind: str, cases: int) -> None:
    """The same of load estimates, from the torques of random forces; of robots with three motors, which feel every force.

    Where the motors hardly feel a force differences are worse, several forces explain the torques (rows whose neighbours are
    explained by another one are not compared), and the force that is found, where derivatives are taken, misses the true one.
    Many cases are estimated by numba, if it is there: the code has the same text.
    """
    robot, values, gravity = ROBOTS[kind]
    random, checked = np.random.default_rng(29 + list(ROBOTS).index(kind)), 0
    options = OPTIONS | {"failed": "nan"} | ({"backend": None} if cases > 1000 else {})
    solver = Differentiable("estimate", replace(robot, **values), list(values), gravity=gravity, **options)
    parameters = np.array(list(values.values()))
    motors, forces = random.uniform(-1.0, 1.0, (cases, 3)), random.normal(size=(cases, 3)) * 5.0
    torques = np.full(motors.shape, np.nan)
    for row, (at, force) in enumerate(zip(motors, forces, strict=True)):
        with contextlib.suppress(sr.EquilibriumNotFound):
            torques[row] = sr.solve_equilibrium(solver.model, at, force, gravity=gravity).motor_torques
    rates = [random.normal(size=motors.shape), random.normal(size=motors.shape), parameters * random.normal(size=len(values))]
    for first in range(0, cases, 2000):
        rows = slice(first, first + 2000)
        inputs, moving = [motors[rows], torques[rows], parameters], [rates[0][rows], rates[1][rows], rates[2]]
        checked += check_random(solver, inputs, moving, random, 0.1 * STEP, 1e-7, 1e3, forces[rows])
    assert checked > 0.8 * cases


def check_random(
    solver: Differentiable,
    inputs: list[FloatArray],
    rates: list[FloatArray],
    random: np.random.Generator,
    step: float,
    tolerance: float,
    doubts: float,
    forces: FloatArray | None = None,
) -> int:
    """Compare rates of a batch with differences; return how many rows have both. `doubts`: how far those of two steps count."""

    def moved(by: float) -> FloatArray:
        return np.concatenate(solver.solve(*(one + by * rate for one, rate in zip(inputs, rates, strict=True))), axis=1)

    results = solver.solve(*inputs)
    slopes = np.concatenate(solver.push(inputs, results, rates), axis=1)
    ends = [moved(place * step) for place in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)]
    wide, near = (
        (8.0 * (b - a) - (d - c)) / (12.0 * apart)
        for a, b, c, d, apart in (
            (ends[1], ends[4], ends[0], ends[5], step),
            (ends[2], ends[3], ends[1], ends[4], 0.5 * step),
        )
    )
    error, doubt = (np.abs(one).max(axis=1) for one in (near - slopes, near - wide))
    middle = 0.5 * (ends[2] + ends[3]) - np.concatenate(results, axis=1)  # of second order, but where another force is found
    good = np.isfinite(doubt) & (np.abs(middle).max(axis=1) <= step * (1.0 + np.abs(slopes).max(axis=1)))
    tolerated = tolerance * (1.0 + np.abs(slopes).max(axis=1))
    assert np.mean(error[good] <= tolerated[good]) > 0.9
    missed = 0.0 if forces is None else 1e3 * np.abs(results[2] - forces).max(axis=1) * (1.0 + np.abs(slopes).max(axis=1))
    assert np.all(error[good] <= (tolerated + doubts * doubt + missed)[good])
    weights = [random.normal(size=one.shape) for one in results]
    pulled = solver.pull(inputs, results, weights, [(len(error),), (len(error),), ()])
    backward = sum(float((np.nan_to_num(a) * b).sum()) for a, b in zip(map(np.asarray, pulled), rates, strict=True))
    assert np.nansum(np.concatenate(weights, axis=1) * slopes) == pytest.approx(backward, rel=1e-9)
    return int(good.sum())


@pytest.mark.parametrize("lead", [((0,), (0,), ()), ((0,), (0,), (0,)), ((), (), (0,)), ((2, 0), (0,), (2, 0))])
def test_an_empty_batch_has_empty_results_and_zero_gradients(lead: tuple[tuple[int, ...], ...]) -> None:
    """Of compiled code and of robots that are solved one by one."""
    for robot, name in ((sr.InflatableArm(), "stiffness"), (sr.PccArm(elastic_sections=1), "bending_stiffness")):
        solver = Differentiable("equilibrium", robot, name, gravity=None, backend=None, threads=1, failed="raise")
        inputs = [np.ones((*shape, size)) for shape, size in zip(lead, solver.inputs, strict=True)]
        whole = np.broadcast_shapes(*lead)
        results = solver.solve(*inputs)
        assert [one.shape for one in results] == [(*whole, size) for size in solver.results]
        assert [one.shape for one in solver.push(inputs, results, inputs)] == [one.shape for one in results]
        pulled = solver.pull(inputs, results, results, [*lead[:2], None])
        assert pulled[2] is None
        assert [np.shape(one) for one in pulled[:2]] == [one.shape for one in inputs[:2]]
        assert not any(np.any(one) for one in pulled[:2])


def test_parameters_that_are_no_numbers_and_shapes_that_do_not_fit_are_refused() -> None:
    """Also with failed="nan", and of offsets, which no robot looks at: those too large to compute with as well."""
    for names in (("stiffness",), ("motor[1].offset",)):
        solver = Differentiable("equilibrium", sr.InflatableArm(), names, gravity=None, **(OPTIONS | {"failed": "nan"}))
        for bad in (np.nan, np.inf, 1e308):
            for rows in ([bad], [[0.1], [bad]]):
                with pytest.raises(sr.ParameterError):
                    solver.solve(np.zeros((2, 3)), np.zeros(3), np.array(rows))
        with pytest.raises(sr.ParameterError, match="leading dimensions"):
            solver.solve(np.zeros((2, 3)), np.zeros((3, 3)), solver.present)
