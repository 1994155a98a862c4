"""Load estimation and inverse kinematics of long chains and of those with muscles: against Pinocchio's path and differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.looped_search import LoopedSearch
from tests.support.oracles import central_difference

GRAVITY = (0.4, -1.0, -9.7)  # [m/s^2]
EIGHT_LINKS: dict[str, Any] = {"link_lengths": (0.15,) * 8, "hinge_offset": 0.01, "rest_side": 0.02, "rest_up": -0.01}


def pcc(**options: Any) -> sr.SoftModel:
    muscles = {"muscles": options.pop("muscles")} if "muscles" in options else {}
    return sr.load_model(sr.PccArm(segment_lengths=(0.5, 0.4), bending_stiffness=(1.9, 1.2), **options), **muscles)


ROBOTS: dict[str, Callable[[], sr.SoftModel]] = {
    "sections": lambda: pcc(elastic_sections=2),
    "lumped": lambda: pcc(chain="lumped", hinges=2),
    "tensions": lambda: pcc(elastic_sections=2, muscles="forces"),
    "lumped_tensions": lambda: pcc(chain="lumped", hinges=2, muscles="forces"),
    "on_an_arm": lambda: sr.load_model(sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(elastic_sections=2))),
    "motors_between": lambda: sr.load_model(sr.InflatableArm(**EIGHT_LINKS)),
    "tube_on_an_arm": lambda: sr.load_model(
        sr.mount(sr.InflatableArm(link_lengths=(0.6,)).urdf(), "tip", sr.HelixTube(elastic_sections=6))
    ),
}
EITHER = list(zip(ROBOTS, (None, GRAVITY) * len(ROBOTS), strict=False))
"""Every robot, weightless or heavy in turn: chains of both are compared in test_compiled_long_chains."""
FEELING = [name for name in ROBOTS if "tensions" not in name]


@cache
def robot(name: str) -> sr.SoftModel:
    return ROBOTS[name]()


@cache
def solver(name: str) -> CompiledModel:
    return sr.compile(robot(name), backend="python")


@cache
def searching(name: str, locked: tuple[str, ...] = (), *, gravity: bool = False) -> LoopedSearch:
    """The searches of a robot, with the code that its solver has already."""
    c = sr.compile(robot(name), backend="python", locked_strains=locked) if locked else solver(name)
    return c._search(c._run(gravity))


def drawn(model: sr.SoftModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Actuators a third of the way to somewhere in their range, tensions a tenth; and a force."""
    share = 0.1 if model.muscles and model.muscle_input == "forces" else 0.3
    motors = None
    while motors is None:
        motors = model.actuators.draw(rng)
    return model.relaxed_motors + share * (motors - model.relaxed_motors), rng.normal(size=3)


def nearby(model: sr.SoftModel, motors: np.ndarray, rng: np.random.Generator, size: float = 0.1) -> np.ndarray:
    change = model.actuators.basis @ rng.normal(scale=size, size=model.actuators.basis.shape[1])
    return np.clip(motors + change, *model.motor_limits.T)


# --- How the tip follows


@pytest.mark.study
@pytest.mark.parametrize(("name", "gravity"), EITHER)
def test_jacobian_and_loads_are_those_of_the_pinocchio_path(name: str, gravity: Any, rng: np.random.Generator) -> None:
    """The same equilibrium on both sides: 1e-9 relative leaves room for the condition of the tangent stiffness."""
    model = robot(name)
    search, down = searching(name, gravity=gravity is not None), np.zeros(3) if gravity is None else np.array(gravity)
    for _ in range(2):
        motors, force = drawn(model, rng)
        status, state = search.settle(motors, force, down, model.rest)
        assert status == Status.CERTIFIED
        at = sr.solve_equilibrium(model, motors, force, gravity=gravity, q_springs0=state.q_springs)
        expected = sr.elastostatic_jacobian(model, at)
        assert np.abs(search.jacobian(state.w) - expected).max() <= 1e-9 * np.abs(expected).max()
        if name in FEELING:
            loads = search.actuation.loads(search.run, state.w)
            assert np.abs(loads - at.motor_torques).max() <= 1e-9 * np.abs(at.motor_torques).max()


@pytest.mark.study
@pytest.mark.parametrize("locked", [("twist",), ("twist", "stretch")])
@pytest.mark.parametrize("name", ["tensions", "on_an_arm", "tube_on_an_arm"])
def test_locked_strains_stay_where_they_are(name: str, locked: tuple[str, ...], rng: np.random.Generator) -> None:
    """The Jacobian by differences of the tip; and that loads follow the force by its transpose."""
    model = robot(name)
    if name == "on_an_arm":
        locked = ("twist",)  # lengths hold the elongation
    search, down = searching(name, locked, gravity=True), np.array(GRAVITY)
    motors, force = drawn(model, rng)
    _, here = search.settle(motors, force, down, model.rest)
    jacobian, scale = search.jacobian(here.w), model.motor_scale

    def tip(change: np.ndarray) -> np.ndarray:
        _, state = search.settle(motors + scale * change, force, down, here.q_springs)
        return search.tip(state.w)

    # Differences over 1e-5 rad of what settles to 1e-12 of the load: 1e-8 relative is typical.
    differences = central_difference(tip, np.zeros(model.n_motors), 1e-5)
    assert np.abs(jacobian * scale - differences).max() < 1e-6 * np.abs(differences).max()
    if name in FEELING:

        def loads(more: np.ndarray) -> np.ndarray:
            _, state = search.settle(motors, force + more, down, here.q_springs)
            search.run.look_at_tip(state.w)
            return search.actuation.loads(search.run, state.w)

        slope = central_difference(loads, np.zeros(3), 1e-4)
        assert np.abs(slope - jacobian.T).max() < 1e-6 * np.abs(jacobian).max()


def test_locking_all_strains_of_sections_is_refused() -> None:
    with pytest.raises(sr.ParameterError, match="locked_strains"):
        sr.compile(robot("tube_on_an_arm"), locked_strains=("bend_x", "bend_y", "twist", "stretch"))


# --- Load estimation


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, GRAVITY])
@pytest.mark.parametrize("name", FEELING)
def test_a_force_that_made_the_torques_is_found(name: str, gravity: Any, rng: np.random.Generator) -> None:
    model = robot(name)
    motors, force = drawn(model, rng)
    torques = sr.solve_equilibrium(model, motors, force, gravity=gravity, tolerance=1e-13).motor_torques
    expected = sr.estimate_load(model, motors, torques, gravity=gravity)
    if name == "tube_on_an_arm":  # two motors never feel all of a force
        found = solver(name).estimate_loads(motors, torques, gravity=gravity)
        assert found.counts() == {Status.UNOBSERVABLE: 1}
        assert found.observability[0] == 0.0
        assert np.abs(found.forces[0] - expected.force).max() < 1e-6  # that of the same search
        with pytest.raises(sr.LoadNotFound, match="do not feel every direction") as caught:
            solver(name).estimate_load(motors, torques, gravity=gravity)
        assert np.array_equal(caught.value.best.force, found.forces[0])
        return
    one = solver(name).estimate_load(motors, torques, gravity=gravity)
    # Torques to 1e-10, divided by the smallest singular value; the Pinocchio path stops at the same residual.
    allowed = 1e-9 * (np.linalg.norm(torques) + 1.0) / expected.singular_values[-1]
    assert np.abs(one.force - force).max() < allowed
    assert np.abs(one.q_springs - expected.equilibrium.q_springs).max() < allowed
    assert abs(one.observability - expected.singular_values[-1]) < 1e-6 * expected.singular_values[0]
    assert one.unexplained <= 1e-9 * (1.0 + np.linalg.norm(torques))


@pytest.mark.study
def test_no_estimate_touches_another(rng: np.random.Generator) -> None:
    model, c = robot("sections"), solver("sections")
    cases = [drawn(model, rng) for _ in range(6)]
    motors = np.array([one for one, _ in cases])
    torques = np.array([sr.solve_equilibrium(model, *case).motor_torques for case in cases])
    clean = c.estimate_loads(motors, torques)
    assert clean.counts() == {Status.CERTIFIED: 6}
    evil, far = torques.copy(), motors.copy()
    evil[1, 2] = np.nan
    evil[3] *= 1e3
    far[4, 0] += 2.0  # [m]; would bend the segment beyond its range
    far[5, 0] = -1.0
    found = c.estimate_loads(far, evil, threads=2)
    assert found.status[[0, 2]].tolist() == [Status.CERTIFIED] * 2
    assert np.array_equal(found.forces[[0, 2]], clean.forces[[0, 2]])
    assert found.status[[1, 4, 5]].tolist() == [Status.NOT_A_NUMBER] * 3
    assert found.status[3] == Status.NOT_REACHED  # and `softrobots.estimate_load` raises, after a second
    assert found.unexplained[3] > 1.0
    for value in (found.forces, found.q_springs, found.observability):
        assert np.all(np.isfinite(value))
    assert not np.any(np.isnan(found.unexplained) | np.isnan(found.residual))


def test_given_tensions_feel_no_load_and_a_tube_has_nothing_that_does() -> None:
    for name, words in (("tensions", "given forces feel no load"), ("tube", "at least one motor")):
        model = robot(name) if name in ROBOTS else sr.load_model(sr.HelixTube(elastic_sections=6))
        c = sr.compile(model, backend="python")
        nothing = np.zeros(model.n_motors)
        for call in (c.estimate_load, c.estimate_loads, lambda q, t, model=model: sr.estimate_load(model, q, t)):
            with pytest.raises(sr.ParameterError, match=words):
                call(nothing, nothing)
    with pytest.raises(sr.ParameterError, match="at least one motor or muscle"):
        c.inverse_kinematics(np.zeros((1, 3)))
    with pytest.raises(sr.ParameterError, match="at least one motor or muscle"):
        c.follow(np.zeros((1, 3)))


def test_bad_input_of_an_estimate() -> None:
    c, relaxed = solver("sections"), robot("sections").relaxed_motors
    for motors, torques, words in (
        (relaxed[:4], np.zeros(6), "q_motors"),
        (relaxed - 1.0, np.zeros(6), "positive muscle lengths"),
        (relaxed, np.zeros(5), "motor_torques"),
        (relaxed, np.full(6, np.nan), "motor_torques"),
    ):
        with pytest.raises(sr.ParameterError, match=words):
            c.estimate_load(motors, torques)


# --- Inverse kinematics


@pytest.mark.study
@pytest.mark.parametrize(("name", "gravity"), EITHER)
def test_searches_end_where_the_pinocchio_path_ends(name: str, gravity: Any, rng: np.random.Generator) -> None:
    """One search on two engines: the same motors, to what a redundant robot leaves on its way home (1e-6 of a radian)."""
    model, c = robot(name), solver(name)
    motors, force = drawn(model, rng)
    way = np.linspace(motors, nearby(model, motors, rng), 5)
    path = np.array([sr.solve_equilibrium(model, one, force, gravity=gravity).tip_position for one in way])
    expected = sr.solve_ik(model, path[-1], force, gravity=gravity, q_motors0=motors, starts=1)
    found = c.inverse_kinematics(path[-1], force, gravity=gravity, q_motors0=motors)
    assert found.counts() == {Status.CERTIFIED: 1}
    assert found.tip_error[0] <= 1e-9
    assert np.abs((found.q_motors[0] - expected.q_motors) / model.motor_scale).max() < 3e-6
    settled = sr.solve_equilibrium(
        model, found.q_motors[0], force, gravity=gravity, q_springs0=found.q_springs[0], tolerance=1e-9
    )
    assert np.linalg.norm(settled.tip_position - path[-1]) < 2e-9
    trajectory = sr.follow_trajectory(model, path, force, gravity=gravity, q_motors0=motors)
    followed = c.follow(path, force, gravity=gravity, q_motors0=motors)
    assert followed.counts() == {Status.CERTIFIED: 5}
    assert followed.tip_error.max() <= 1e-9
    assert np.abs((followed.q_motors - trajectory.q_motors) / model.motor_scale).max() < 1e-5  # 3e-6, adding up
    assert np.abs(followed.q_springs - trajectory.q_springs).max() < 1e-5


def test_no_target_touches_another(rng: np.random.Generator) -> None:
    model, c = robot("sections"), solver("sections")
    motors, force = drawn(model, rng)
    tip = sr.solve_equilibrium(model, motors, force).tip_position
    targets = tip + rng.uniform(-0.02, 0.02, (5, 3))
    clean = c.inverse_kinematics(targets, force, q_motors0=motors)
    assert clean.counts() == {Status.CERTIFIED: 5}
    evil, starts = targets.copy(), np.tile(motors, (5, 1))
    evil[1] = 0.0, 0.0, 5.0
    evil[2, 0] = np.inf
    starts[3, 0] = -1.0
    found = c.inverse_kinematics(evil, force, q_motors0=starts, threads=2)
    assert found.status.tolist() == [0, Status.NOT_REACHED, Status.NOT_A_NUMBER, Status.NOT_A_NUMBER, 0]
    assert np.array_equal(found.q_motors[[0, 4]], clean.q_motors[[0, 4]])
    assert found.tip_error[1] > 3.0
    assert np.all(np.isinf(found.tip_error[2:4]))
    low, high = model.motor_limits.T
    assert np.all((found.q_motors >= low) & (found.q_motors <= high))


def test_a_start_beyond_the_limits_is_taken_back_to_them(rng: np.random.Generator) -> None:
    model = robot("motors_between")
    motors, force = drawn(model, rng)
    target = sr.solve_equilibrium(model, motors, force).tip_position
    found = solver("motors_between").inverse_kinematics(target, force, q_motors0=motors + 7.0)
    assert found.q_motors.max() <= model.motor_limits[:, 1].max()
    assert found.status[0] in (Status.CERTIFIED, Status.NOT_REACHED)


def test_a_start_chooses_the_springs(rng: np.random.Generator) -> None:
    """Elastic coordinates to start from are used: at the answer, the search has nothing left to do."""
    model, c = robot("on_an_arm"), solver("on_an_arm")
    motors, force = drawn(model, rng)
    at = sr.solve_equilibrium(model, motors, force, tolerance=1e-12)
    found = c.inverse_kinematics(at.tip_position, force, q_motors0=motors, q_springs0=at.q_springs)
    assert found.certified[0]
    assert np.abs(found.q_motors[0] - motors).max() < 1e-9


# --- Paths


@pytest.mark.study
def test_a_waypoint_out_of_reach_marks_only_itself(rng: np.random.Generator) -> None:
    model, c = robot("sections"), solver("sections")
    motors, force = drawn(model, rng)
    tip = sr.solve_equilibrium(model, motors, force).tip_position
    path = tip + np.linspace(0.0, 0.02, 5)[:, None]
    torn = np.insert(path, 2, (0.0, 0.0, 5.0), axis=0)
    whole, found = (c.follow(points, force, q_motors0=motors) for points in (path, torn))
    assert found.status.tolist() == [0, 0, Status.NOT_REACHED, 0, 0, 0]
    assert np.array_equal(np.delete(found.q_motors, 2, axis=0), whole.q_motors)
    assert np.isclose(found.tip_error[2], np.linalg.norm(torn[2] - path[1]), atol=1e-8)  # it stays at the last waypoint


def test_a_first_waypoint_out_of_reach() -> None:
    model = robot("sections")
    with pytest.raises(sr.TargetUnreachable, match="waypoint 1 of 2") as caught:
        solver("sections").follow([(0.0, 0.0, 5.0), (0.0, 0.0, 1.0)], q_motors0=model.relaxed_motors)
    assert caught.value.residual > 3.0
    assert caught.value.best.shape == (6,)


def test_a_path_starts_where_solve_ik_says() -> None:
    model = robot("sections")
    path = np.linspace((0.2, 0.1, 0.75), (0.2, 0.0, 0.78), 3)
    found = solver("sections").follow(path, (0.0, 1.0, 0.0))
    first = sr.solve_ik(model, path[0], (0.0, 1.0, 0.0))
    assert found.certified.all()
    assert np.abs((found.q_motors[0] - first.q_motors) / model.motor_scale).max() < 3e-6


@pytest.mark.parametrize("name", ROBOTS)
def test_a_batch_without_cases(name: str) -> None:
    """Muscles of given length are checked row by row: no rows, no check."""
    model, c = robot(name), solver(name)
    nothing, force = np.zeros((0, model.n_motors)), np.zeros((0, 3))
    assert c.equilibria(nothing, force).q_springs.shape == (0, model.n_springs)
    assert c.inverse_kinematics(force, q_motors0=nothing).q_motors.shape == nothing.shape
    if name in FEELING:
        assert c.estimate_loads(nothing, nothing).forces.shape == (0, 3)
