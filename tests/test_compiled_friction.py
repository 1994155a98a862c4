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
    given = {
        "segment_lengths": (LENGTH,),
        "tendon_azimuths": (0.0,),
        "tendon_distance": DISTANCE,
        "kind": "tension",
        "bending_stiffness": EI,
        "elastic_sections": 4,
        "bending_friction": MOMENT,
    }
    return sr.TendonArm(**(given | fields))


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


@pytest.mark.parametrize("locked", [(), pytest.param(("bend_x", "twist", "stretch"), marks=pytest.mark.study)], ids=str)
def test_a_tendon_in_its_guides_follows_the_capstan(locked: tuple[str, ...]) -> None:
    r"""`EI theta' = T d exp(-mu theta)`, so :math:`\theta = \log(1 + \mu T d s / EI) / \mu`; let go, with the other sign."""
    errors = []
    for sections in (4, 8):
        robot = one_segment(elastic_sections=sections, bending_friction=0.0, guide_friction=0.4)
        fast = compiled(robot, locked_strains=locked)
        pulled = fast.equilibrium([6.0])
        let_go = fast.equilibrium([1.8], previous=pulled)
        for found, tension, mu in ((pulled, 6.0, 0.4), (let_go, 1.8, -0.4)):
            expected = np.log1p(mu * tension * DISTANCE * LENGTH / EI) / mu
            errors.append(found.q_springs.reshape(sections, 4)[:, 1].sum() / expected - 1.0)
            frictionless = tension * DISTANCE * LENGTH / EI
            assert abs(frictionless / expected - 1.0) > 60.0 * abs(errors[-1])
    assert np.divide(errors[:2], errors[2:]) == pytest.approx([4.0, 4.0], abs=0.2)  # second order in the sections
    assert np.abs(errors[2:]).max() < 2e-4


def test_guides_slip_where_their_friction_is_whole() -> None:
    """Complementarity at each guide to 1e-9 of the stick, with lengths from the strains.

    A slider moves only where the length beyond it is a stick away, and towards it.
    """
    fast = compiled(sr.TendonArm(segment_lengths=(0.06, 0.07), kind="tension", guide_friction=0.2, elastic_sections=2))
    paths, rng = fast.model.structure.muscle_paths, np.random.default_rng(2)
    rest = paths.at(fast.model.rest).pieces
    sticks = 1e-5 * np.array([tag.rest_length for tag in fast.model.muscles])[paths.muscle]
    last, before, moved_at_all, stuck_at_all = None, np.zeros(len(sticks)), 0, 0
    tensions = np.full(6, 1.0)
    for size in (0.9, 0.003, 0.1, 0.01, 0.3):  # [N]: small steps do not turn all guides round
        tensions = tensions + size * rng.uniform(-1.0, 1.0, 6)
        last = fast.equilibrium(tensions, (0.01, 0.02, 0.0), previous=last)
        change = paths.at(last.q_springs).pieces - rest
        beyond = np.array(
            [change[g + 1 :][paths.muscle[g + 1 :] == muscle].sum() + 0.5 * change[g] for g, muscle in enumerate(paths.muscle)]
        )
        share, moved = (last.friction_slip - beyond) / sticks, (last.friction_slip - before) / sticks
        assert np.abs(share).max() < 1.0 + 1e-9
        slips = np.abs(moved) > 1e-6
        assert np.abs(share[slips] + np.sign(moved[slips])).max(initial=0.0) < 1e-9
        before, moved_at_all, stuck_at_all = last.friction_slip, moved_at_all + slips.sum(), stuck_at_all + (~slips).sum()
    assert moved_at_all > 10
    assert stuck_at_all > 10


AROUND = [sr.Route(at=(0.0, 0.2), azimuth=(a, a + 4.7), distance=0.0045) for a in (0.0, 2.0944, 4.1888)]
CONES = [sr.Route(at=(0.0, 0.15), azimuth=(a, a + 0.5), distance=(0.008, 0.003)) for a in (0.0, 2.0944, 4.1888)]

ROBOTS: dict[str, tuple[Any, float, float]] = {
    "both": (sr.TendonArm(kind="tension", bending_friction=1e-3, guide_friction=0.1, elastic_sections=2), 0.8, 0.05),
    "guides_lengths": (sr.PccArm(guide_friction=0.1, elastic_sections=2), 0.02, 1.0),
    "guides_and_hinges": (sr.PccArm(guide_friction=0.1, chain="lumped", elastic_sections=2), 0.02, 1.0),
    "guides_of_one_segment": (sr.TendonArm(segment_lengths=(0.06, 0.07), guide_friction=(0.0, 0.2)), 2e-3, 0.05),
    "guides_around": (
        sr.TendonArm(segment_lengths=(0.2,), elastic_sections=3, kind="tension", guide_friction=0.2, routing=AROUND),
        0.8,
        0.05,
    ),
    "guides_of_cones": (
        sr.TendonArm(segment_lengths=(0.2,), elastic_sections=4, guide_friction=0.2, routing=CONES),
        2e-3,
        0.05,
    ),
    "guides_of_bent": (sr.TendonArm(rest_bend_x=0.7, rest_twist=0.4, guide_friction=0.2, elastic_sections=2), 2e-3, 0.05),
    "guides_mixed": (sr.TendonArm(kind=("elastic", "tension", "elastic"), guide_friction=0.1, elastic_sections=2), 1e-3, 0.05),
    "tensions": (sr.TendonArm(kind="tension", bending_friction=1e-3, elastic_sections=2), 0.8, 0.05),
    "from_base": (sr.PccArm(bending_friction=0.3, routing="base"), 5e-3, 1.0),
    "hinges": (sr.PccArm(bending_friction=0.3, chain="lumped", elastic_sections=2), 0.02, 1.0),
    "hinges_and_tensions": (sr.TendonArm(kind="tension", bending_friction=1e-3, chain="lumped", elastic_sections=1), 0.8, 0.05),
    "one_segment_moved": (sr.TendonArm(segment_lengths=(0.06, 0.07), bending_friction=(0.0, 1e-3)), 2e-3, 0.05),
}
"""Robots, how far their actuators go [N or m], and the size of forces [N]."""


def ways(model: sr.SoftModel, change: float, force: float, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random actuators and forces, one step after the other; each second step is small, so that parts stick."""
    rng, found = np.random.default_rng(7), list[tuple[np.ndarray, np.ndarray]]()
    tense = np.array([unit == "N" for unit in model.actuators.units])
    change = np.where(tense, max(change, 0.8), change)
    for number in range(count):
        moved, push = rng.uniform(-1.0, 1.0, model.n_motors) * change, rng.normal(size=3) * force
        if number % 2:
            moved, push = found[-1][0] - model.relaxed_motors + 0.02 * moved, found[-1][1] + 0.02 * push
        found.append((model.relaxed_motors + np.where(tense, np.abs(moved), moved), push))
    return found


@pytest.mark.study
def test_strong_friction_of_given_lengths_settles() -> None:
    """Steps of lengths whose guides rub by 0.3: at the last one a descent can go to and fro between two points for ever.

    One has less energy, the other less residual. The tip is that of the general solver, to 1e-9 of the reach.
    """
    fast = compiled(sr.PccArm(guide_friction=0.3))
    model, slow = fast.model, None
    for moved, force in (
        ((-0.0084, 0.0085, -0.0071, -0.0071, 0.0002, -0.029), (4.148, -2.874, -5.866)),
        ((-0.0034, -0.0174, 0.0243, -0.029, -0.0118, 0.0299), (0.225, 4.401, -5.696)),
        ((0.0184, 0.0078, -0.0082, 0.0156, -0.0284, -0.0032), (-13.556, 0.209, -8.087)),
    ):
        motors = model.relaxed_motors + moved
        quick = fast.equilibrium(motors, force, gravity=sr.EARTH_GRAVITY, previous=slow)
        slow = sr.solve_equilibrium(model, motors, force, gravity=sr.EARTH_GRAVITY, previous=slow)
        assert np.abs(quick.tip_position - slow.tip_position).max() < 1e-9 * model.reach


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_steps_are_those_of_the_general_solver(name: str) -> None:
    """A way of random steps in space, alone and as a batch of one: the tip to 1e-9 of the reach."""
    robot, change, force = ROBOTS[name]
    fast = compiled(robot)
    model = fast.model
    slow = alone = batch = None
    for motors, push in ways(model, change, force, 4):
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


@pytest.mark.parametrize("fields", [{"bending_friction": 5e-4}, {"guide_friction": 0.1}], ids=["bending", "guides"])
def test_a_force_comes_back_from_the_tensions_and_the_state_before(fields: dict[str, float]) -> None:
    fast = compiled(sr.TendonArm(segment_lengths=(0.06, 0.07), elastic_sections=1, **fields))
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
    rows = fast.equilibria([motors, motors, np.full(6, np.nan)], [np.zeros(3), force, np.zeros(3)])
    batch = fast.estimate_loads(motors, touched.motor_torques, previous=rows)
    assert batch.status.tolist() == [Status.CERTIFIED, Status.CERTIFIED, Status.NOT_A_NUMBER]
    alone = fast.estimate_load(motors, touched.motor_torques, previous=fast.equilibrium(motors, force))
    assert batch.forces[:2] == pytest.approx(np.array([force, alone.force]), abs=1e-7)
    assert fast.estimate_loads(motors, touched.motor_torques).forces[0] == pytest.approx(without.force, abs=1e-9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
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
        (
            lambda fast: fast.inverse_kinematics([[0.0, 0.0, 0.05]], previous=fast.equilibria(np.ones((2, 1)), np.zeros(3))),
            "one equilibrium",
        ),
        (lambda fast: fast.follow([[0.0, 0.0, 0.05]], previous=1), "an Equilibrium of the model"),
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


RUBBING = ({"bending_friction": MOMENT}, {"bending_friction": 0.0, "guide_friction": 0.2})


@pytest.mark.study
def test_numba_takes_the_same_steps(tool: Callable[[str], Any]) -> None:
    """Both frictions, alone and in lanes, ten robots at a time: springs of the Python back end to 1e-9 rad or m."""
    tool("numba")
    quick, plain = (compiled(one_segment(guide_friction=0.2), one) for one in ("numba", "python"))
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
@pytest.mark.parametrize("fields", RUBBING, ids=["bending", "guides"])
def test_c_code_takes_the_same_steps(fields: dict[str, float], tmp_path: Path) -> None:
    """From the last unknowns and sliders, as a control loop does."""
    last, loop, fast = None, [1.0, 3.0, 2.0, 0.2], compiled(one_segment(**fields))
    in_c = Controller(fast, tmp_path, name="segment")
    in_c.clear()
    for tension in loop:
        last = fast.equilibrium([tension], previous=last)
        in_c.put("ACTUATORS", np.array([tension]))
        assert in_c.call("settle_from") == Status.CERTIFIED
        in_c.put("SLIDERS", in_c.get("SLID", 16))
        if "ANCHORS" in in_c.place:
            in_c.put("ANCHORS", in_c.get("ANCHORED", 4))
        assert in_c.get("UNKNOWN", 16) == pytest.approx(last.q_springs, abs=1e-12)


@pytest.mark.study
@pytest.mark.parametrize(
    "fields", [{"kind": "tension", "bending_friction": 1e-3}, {"bending_friction": 3e-4, "guide_friction": 0.1}], ids=str
)
def test_motors_are_found_from_a_state_before(fields: dict[str, Any]) -> None:
    """The general solver, stepping to these motors from the same state, has the tip at the targets, to their tolerance."""
    fast = compiled(sr.TendonArm(elastic_sections=2, **fields))
    model = fast.model
    first = np.full(9, 1.0) if "kind" in fields else model.relaxed_motors - 1e-3
    before = sr.solve_equilibrium(model, first)
    targets = before.tip_position + np.array([0.3, 0.8, 0.3])[:, None] * (0.02, 0.01, -0.003)
    found = fast.inverse_kinematics(targets[0], q_motors0=first, previous=before)
    assert found.certified.all()
    there = sr.solve_equilibrium(model, found.q_motors[0], previous=before)
    assert np.linalg.norm(there.tip_position - targets[0]) < 2e-9
    path = fast.follow(targets, q_motors0=first, previous=before)
    assert path.certified.all()
    last = before
    for motors, target in zip(path.q_motors, targets, strict=True):
        last = sr.solve_equilibrium(model, motors, previous=last)
        assert np.linalg.norm(last.tip_position - target) < 2e-9
    assert np.abs((path.q_motors[2] - path.q_motors[0]) / model.motor_scale).max() > 1e-3  # the way back is another one


@pytest.mark.study
def test_strong_friction_in_guides_settles() -> None:
    """Coefficient 1 and nine tensions up to 40 N: without friction the arm coils up, which must not decide what friction is.

    Both engines search on their own, in other steps, and agree; the spring in line with each slider settles them to 1e-6 rad.
    """
    robot, rng = sr.TendonArm(kind="tension", guide_friction=1.0), np.random.default_rng(1)
    model, fast = sr.load_model(robot), compiled(robot)
    general = mine = None
    for _ in range(2):
        tensions = rng.uniform(0.0, 40.0, 9)
        general = sr.solve_equilibrium(model, tensions, previous=general)
        mine = fast.equilibrium(tensions, previous=mine)
        assert mine.q_springs == pytest.approx(general.q_springs, abs=1e-6)
