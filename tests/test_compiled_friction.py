"""Compiled steps of robots with dry friction: the play operator, `solve_equilibrium` step by step, and what remembers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.support.c_libraries import Controller

EI, LENGTH, DISTANCE = 2e-3, 0.06, 0.0045
MOMENT = 2e-3  # of friction [N m]
STICK = 1e-4  # [rad] that a section bends before its friction is whole, see `dry_friction`


def one_segment(**fields: Any) -> sr.TendonArm:
    return sr.TendonArm(
        segment_lengths=(LENGTH,),
        tendon_azimuths=(0.0,),
        tendon_distance=DISTANCE,
        kind="tension",
        bending_stiffness=EI,
        elastic_sections=4,
        bending_friction=MOMENT,
        **fields,
    )


@pytest.fixture(scope="module")
def fast() -> CompiledModel:
    return compiled(one_segment())


def compiled(robot: Any, backend: str = "python", **options: Any) -> CompiledModel:
    return sr.compile(sr.load_model(robot), backend=backend, **options)


def played(tensions: Sequence[float]) -> list[float]:
    """Curvature under a tendon, which bends a segment by the constant moment `T d`: a play operator [rad/m]."""
    held, curvatures = 0.0, []
    for tension in tensions:
        free = tension * DISTANCE / EI
        held = min(max(held, free - MOMENT / EI), free + MOMENT / EI)
        curvatures.append(held)
    return curvatures


def curvature(springs: np.ndarray) -> np.ndarray:
    """Curvature of each section towards the tendon, shape (..., 4) [rad/m]."""
    return springs.reshape(*springs.shape[:-1], 4, 4)[..., 1] / (LENGTH / 4)


PLAY = 2.02 * STICK / (LENGTH / 4)  # between whole friction one way and the other a section gives way by two sticks


def test_loops_in_a_batch_play_between_two_lines(fast: CompiledModel) -> None:
    """Three robots side by side, each with its own loop; the last result is where all come from."""
    loops = np.array(
        [
            [0.2, 0.4, 1.0, 2.0, 1.9, 1.5, 0.5, 0.0, 0.1, 2.0, 3.0],
            [3.0, 0.0, 3.0, 0.0, 1.0, 0.9, 1.1, 1.0, 0.2, 2.5, 2.4],
            [0.0, 0.3, 0.1, 0.2, 0.4, 0.3, 1.4, 1.3, 1.2, 0.9, 0.4],
        ]
    )
    last, found = None, []
    for tensions in loops.T:
        last = fast.equilibria(tensions[:, None], np.zeros(3), previous=last)
        assert last.certified.all()
        found.append(curvature(last.q_springs))
    for robot, loop in enumerate(loops):
        for sections, expected in zip(found, played(loop), strict=True):
            assert sections[robot] == pytest.approx(np.full(4, expected), abs=PLAY)


ROBOTS: dict[str, tuple[Any, float, float]] = {
    "tensions": (sr.TendonArm(kind="tension", bending_friction=1e-3, elastic_sections=2), 0.8, 0.05),
    "elastic": (sr.TendonArm(bending_friction=1e-3, elastic_sections=2), 2e-3, 0.05),
    "lengths": (sr.PccArm(bending_friction=0.3), 0.02, 1.0),
    "from_base": (sr.PccArm(bending_friction=0.3, routing="base"), 5e-3, 1.0),
    "hinges": (sr.PccArm(bending_friction=0.3, chain="lumped", elastic_sections=2), 0.02, 1.0),
    "hinges_and_tensions": (sr.TendonArm(kind="tension", bending_friction=1e-3, chain="lumped", elastic_sections=1), 0.8, 0.05),
    "one_segment_moved": (sr.TendonArm(segment_lengths=(0.06, 0.07), bending_friction=(0.0, 1e-3)), 2e-3, 0.05),
}
"""Robots, how far their actuators go [N or m], and the size of forces [N]."""


def ways(model: sr.SoftModel, change: float, force: float, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random actuators and forces, one step after the other."""
    rng = np.random.default_rng(7)
    tense = model.actuators.units[0] == "N"
    moved = [rng.uniform(-1.0, 1.0, model.n_motors) * change for _ in range(count)]
    return [(model.relaxed_motors + (np.abs(one) if tense else one), rng.normal(size=3) * force) for one in moved]


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_steps_are_those_of_the_general_solver(name: str) -> None:
    """A way of random steps in space, alone and as a batch of one: the tip to 1e-9 of the reach."""
    robot, change, force = ROBOTS[name]
    fast = compiled(robot)
    model = fast.model
    slow = alone = batch = None
    for motors, push in ways(model, change, force, 6):
        slow = sr.solve_equilibrium(model, motors, push, gravity=sr.EARTH_GRAVITY, previous=slow)
        alone = fast.equilibrium(motors, push, gravity=sr.EARTH_GRAVITY, previous=alone)
        batch = fast.equilibria(motors, push, gravity=sr.EARTH_GRAVITY, previous=batch)
        assert batch.certified.all()
        assert np.abs(alone.tip_position - slow.tip_position).max() < 1e-9 * model.reach
        assert np.abs(batch.tip_positions - slow.tip_position).max() < 1e-9 * model.reach
    fresh = fast.equilibrium(motors, push, gravity=sr.EARTH_GRAVITY)
    assert np.abs(fresh.tip_position - slow.tip_position).max() > 1e-5 * model.reach  # the way matters


def test_every_kind_of_result_is_a_state_before(fast: CompiledModel) -> None:
    """Equilibria of both solvers, a sequence of them, and a batch: the same next step."""
    slow = sr.solve_equilibrium(fast.model, [2.0])
    quick, batch = fast.equilibrium([2.0]), fast.equilibria([[2.0], [0.1]], np.zeros(3))
    expected = sr.solve_equilibrium(fast.model, [1.0], previous=slow).q_springs
    after = fast.equilibria([1.0], np.zeros(3), previous=[slow, quick])
    again = fast.equilibria([1.0], np.zeros(3), previous=batch)
    for springs in (
        fast.equilibrium([1.0], previous=slow).q_springs,
        fast.equilibrium([1.0], previous=quick).q_springs,
        *after.q_springs,
        again.q_springs[0],
    ):
        assert springs == pytest.approx(expected, abs=1e-12)  # rad
    assert np.abs(again.q_springs[1] - expected).max() > 1e-3
    assert quick.friction_bending == pytest.approx(batch.friction_bending[0], abs=1e-12)


def test_the_slider_follows_at_a_stick(fast: CompiledModel) -> None:
    """Pulled on and on, the sliders stand one stick short of the bending of their sections."""
    pulled = fast.equilibrium([3.0])
    assert pulled.friction_bending.shape == (4, 2)
    assert pulled.friction_bending[:, 1] == pytest.approx(curvature(pulled.q_springs) * LENGTH / 4 - STICK, abs=1e-12)
    stuck = fast.equilibrium([2.9], previous=pulled)  # by 4.5e-4 N m of 2 MOMENT: nothing slips
    assert np.abs(stuck.friction_bending - pulled.friction_bending).max() < 1e-12


def test_locked_strains_do_not_rub() -> None:
    """A segment that bends in one plane only: the play operator there."""
    fast = compiled(one_segment(), locked_strains=("bend_x", "twist", "stretch"))
    last, loop = None, [1.0, 3.0, 2.0, 0.2]
    for tension, expected in zip(loop, played(loop), strict=True):
        last = fast.equilibrium([tension], previous=last)
        assert curvature(last.q_springs) == pytest.approx(np.full(4, expected), abs=PLAY)


def test_a_row_without_a_state_before_keeps_its_status(fast: CompiledModel) -> None:
    last = fast.equilibria([[2.0], [np.nan], [1.0]], np.zeros(3))
    after = fast.equilibria([[1.0], [1.0], [0.5]], np.zeros(3), previous=last)
    assert after.status.tolist() == [Status.CERTIFIED, Status.NOT_A_NUMBER, Status.CERTIFIED]
    alone = fast.equilibrium([0.5], previous=fast.equilibrium([1.0]))
    assert after.q_springs[2] == pytest.approx(alone.q_springs, abs=1e-12)
    assert np.isfinite(after.friction_bending).all()


def test_a_force_comes_back_from_the_tensions_and_the_state_before() -> None:
    fast = compiled(sr.TendonArm(segment_lengths=(0.06, 0.07), bending_friction=5e-4, elastic_sections=1))
    motors = fast.model.relaxed_motors - (1e-3, 0.0, 0.0, 0.0, 0.0, 0.0)
    before, force = fast.equilibrium(motors), np.array([0.05, 0.1, 0.0])
    slow = sr.solve_equilibrium(fast.model, motors)
    touched = sr.solve_equilibrium(fast.model, motors, force, previous=slow)
    for previous in (before, slow):
        found = fast.estimate_load(motors, touched.motor_torques, previous=previous)
        assert found.force == pytest.approx(force, abs=1e-7)
        assert fast.equilibrium(motors, previous=found).friction_bending is not None
    without = fast.estimate_load(motors, touched.motor_torques)
    assert np.abs(without.force - force).max() > 1e-3


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda fast: fast.simulate(0.1, [1.0]), "without dry friction, for compiled motion; simulate has it"),
        (lambda fast: fast.c_source(motion=True), "without dry friction, for compiled motion"),
        (lambda fast: fast.js_source(), "without dry friction, for solvers on pages"),
        (lambda fast: fast.inverse_kinematics([[0.0, 0.0, 0.05]]), "without dry friction, for compiled inverse kinematics"),
        (lambda fast: fast.follow([[0.0, 0.0, 0.05]]), "without dry friction, for compiled paths"),
        (lambda fast: fast.equilibrium([1.0], environment=sr.Environment([])), "without dry friction, for compiled contact"),
        (lambda fast: fast.equilibrium([1.0], previous=1), "an Equilibrium of the model"),
        (lambda fast: fast.equilibria([1.0], np.zeros(3), previous=[]), "at least one state"),
        (
            lambda fast: fast.equilibria(np.ones((3, 1)), np.zeros(3), previous=fast.equilibria(np.ones((0, 1)), np.zeros(3))),
            "as many rows as the others have",
        ),
        (lambda fast: fast.equilibrium([1.0], previous=fast.equilibria([[1.0], [2.0]], np.zeros(3))), "one equilibrium"),
        (
            lambda fast: fast.equilibria(np.ones((3, 1)), np.zeros(3), previous=[fast.equilibrium([1.0])] * 2),
            "as many rows as the others have",
        ),
        (
            lambda fast: fast.equilibrium([1.0], previous=compiled(one_segment(rest_bend_x=1.0)).equilibrium([1.0])),
            "of the model given",
        ),
        (lambda _: compiled(one_segment(guide_friction=0.1)), "without friction in guides, to be compiled"),
    ],
)
def test_what_makes_no_sense_is_refused(fast: CompiledModel, call: Callable[[CompiledModel], Any], words: str) -> None:
    with pytest.raises(sr.ParameterError, match=words):
        call(fast)


def test_a_robot_without_friction_remembers_nothing() -> None:
    fast = compiled(sr.TendonArm(segment_lengths=(LENGTH,), elastic_sections=1))
    found = fast.equilibrium(fast.model.relaxed_motors)
    assert found.friction_bending is None
    with pytest.raises(sr.ParameterError, match="None for a robot without dry friction"):
        fast.equilibrium(fast.model.relaxed_motors, previous=found)
    with pytest.raises(sr.ParameterError, match="without dry friction, for compiled batches of estimates"):
        compiled(sr.TendonArm(segment_lengths=(LENGTH,), elastic_sections=1, bending_friction=MOMENT)).estimate_loads(
            np.full(3, LENGTH), np.zeros(3)
        )


@pytest.mark.study
def test_numba_takes_the_same_steps(tool: Callable[[str], Any]) -> None:
    """Alone and in lanes, ten robots at a time: springs of the Python back end to 1e-9 rad or m."""
    tool("numba")
    quick, plain = compiled(one_segment(), "numba"), compiled(one_segment())
    loops = np.random.default_rng(3).uniform(0.0, 3.0, (6, 10, 1))
    last = before = alone = None
    for tensions in loops:
        last = quick.equilibria(tensions, (0.02, 0.01, 0.0), previous=last)
        before = plain.equilibria(tensions, (0.02, 0.01, 0.0), previous=before)
        alone = quick.equilibrium(tensions[4], np.array([0.02, 0.01, 0.0]), previous=alone)
        assert last.certified.all()
        assert np.abs(last.q_springs - before.q_springs).max() < 1e-9
        assert np.abs(alone.q_springs - before.q_springs[4]).max() < 1e-9


@pytest.mark.system
def test_c_code_takes_the_same_steps(fast: CompiledModel, tmp_path: Path) -> None:
    """From the last unknowns and sliders, as a control loop does."""
    last, loop = None, [1.0, 3.0, 2.0, 0.2]
    in_c = Controller(fast, tmp_path, name="segment")
    in_c.clear()
    for tension in loop:
        last = fast.equilibrium([tension], previous=last)
        in_c.put("ACTUATORS", np.array([tension]))
        assert in_c.call("settle_from") == Status.CERTIFIED
        in_c.put("SLIDERS", in_c.get("SLID", 16))
        assert in_c.get("UNKNOWN", 16) == pytest.approx(last.q_springs, abs=1e-12)
