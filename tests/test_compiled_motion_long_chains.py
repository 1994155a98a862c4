"""Compiled motion of long chains: the midpoint rule on Pinocchio's equations of motion, and runs of simulate."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status, motion_settings
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.motion.motion_groups import motion_groups
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run import motion_runs
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.motion_course import Course
from softrobots.compiled.run.motion_runs import take_one
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.motion import MotionState
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement
from tests.conftest import missing
from tests.support.c_libraries import Controller
from tests.support.serial_chains import ROBOTS, pcc

GRAVITY = (0.7, -0.4, -9.7)


def rod(**options: Any) -> SoftModel:
    return sr.load_model(sr.PccArm(segment_lengths=(0.6,), muscle_azimuths=(), **options))


def foreign() -> SoftModel:
    """Revolute springs about z in turn with y, one behind the other, with motors in between: no two joints at a point."""
    links = "".join(
        f'<link name="l{k}"><inertial><origin xyz="0.02 0.01 {0.01 * (k % 3)}"/><mass value="{0.1 + 0.01 * k}"/>'
        f'<inertia ixx="1e-4" iyy="{2e-4 if k % 2 else 1e-4}" izz="3e-4" ixy="{1e-5 * (k % 2)}" ixz="0" iyz="0"/>'
        "</inertial></link>"
        for k in range(19)
    )
    joints = "".join(
        f'<joint name="j{k}" type="{"prismatic" if k == 11 else "revolute"}"><origin xyz="0.1 0 0" rpy="{0.2 * (k % 4)} 0 0"/>'
        f'<parent link="l{k}"/><child link="l{k + 1}"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        for k in range(18)
    )
    springs = {f"j{k}": (20.0 + k, 0.1) for k in range(18) if k not in (0, 7, 12)}
    return sr.load_model(f'<robot name="foreign">{links}{joints}</robot>', springs=springs)


LONG: dict[str, Callable[[], SoftModel]] = {
    "rod": lambda: rod(chain="lumped", hinges=5, torsion=True),
    "foreign": foreign,
    "helix_lumped": lambda: sr.load_model(sr.HelixTube(chain="lumped", hinges=6, torsion=True)),
    "motors between": lambda: sr.load_model(
        sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(chain="lumped", muscle_azimuths=()))
    ),
    "sections": lambda: rod(elastic_sections=3),
    "flexures": lambda: rod(chain="flexures", hinges=3, extension=False),
    "helix": ROBOTS["helix"],
    "tensions": ROBOTS["pcc_forces"],
    "lumped tensions": lambda: pcc(chain="lumped", hinges=3, muscles="forces"),
}


def started(
    model: SoftModel, run: Any, rng: np.random.Generator, h: float
) -> tuple[Any, np.ndarray, np.ndarray, dict[str, Any]]:
    """A workspace at a random state near rest: it, the path of the motors over a step, the damping, and the state."""
    n, m = model.n_springs, model.n_motors
    path = 0.3 * rng.normal(size=m) + np.array([[0.0], [h / 2], [h]]) * rng.normal(size=m) + h * h * rng.normal(size=(3, m))
    damping = rng.uniform(size=n) * 1e-3 * model.chain().stiffness
    state = {"position": model.chain().rest + rng.normal(size=n) * 3e-3, "velocity": rng.normal(size=n) * 0.05}
    given = {"force": rng.normal(size=3) * 0.2, "gravity": np.array(GRAVITY), "time_step": np.array([h]), "damping": damping}
    given |= dict(zip(("motors_begin", "motors_middle", "motors_end"), path, strict=True))
    w = run.workspace()
    for name, values in (state | given).items():
        run.put(w, getattr(run.layout, name), values)
    return w, path, damping, state | given


@pytest.mark.study
@pytest.mark.parametrize("kind", list(LONG))
def test_a_step_of_a_long_chain_is_the_implicit_midpoint_rule(kind: str, rng: np.random.Generator) -> None:
    model = LONG[kind]()
    unknowns = Unknowns(model.chain())
    assert not unknowns.is_unrolled
    run: Any = make_run(make_motion_program(unknowns), "python")
    layout, n, m, h = run.layout, model.n_springs, model.n_motors, 1e-3
    w, path, damping, given = started(model, run, rng, h)
    y0, v0 = given["position"], given["velocity"]
    assert run.motion_step(w) == 0
    y1, a = (np.array(w[place : place + n]) for place in (layout.position, layout.acceleration))
    np.testing.assert_allclose(y1, y0 + h * v0 + h**2 / 2 * a, rtol=0, atol=1e-15)  # in one step; rounding
    equations = EquationsOfMotion(model, GRAVITY, np.diag(damping))
    x = np.concatenate([path[1], y0 + h / 2 * v0 + h**2 / 4 * a])
    rates = np.concatenate([(path[2] - path[0]) / h, v0 + h / 2 * a])
    changes = np.concatenate([4 * (path[2] - 2 * path[1] + path[0]) / h**2, a])
    wrench = {model.tip: np.concatenate([given["force"], np.zeros(3)])}
    error = equations.balance(x, rates, changes, wrench)[m:]
    # A change of 1e-13 in the middle is one of K 1e-13 + M 1e-13 / (h^2 / 4) in the torques.
    size = model.chain().stiffness.max() + np.abs(equations.mass_matrix(x)).max() * 4 / h**2
    assert np.abs(error).max() < 1e-12 * size
    run.place_at(w, 1.0)
    q = model.configuration(path[2], y1)
    np.testing.assert_allclose(w[layout.tip : layout.tip + 3], frame_placement(model, q, model.tip).translation, atol=1e-12)


@pytest.mark.parametrize("kind", ["rod", "sections", "tensions"])
def test_a_run_is_that_of_simulate_at_the_same_steps(kind: str, rng: np.random.Generator) -> None:
    model, duration, steps = LONG[kind](), 0.05, 20
    run: Any = make_run(make_motion_program(Unknowns(model.chain())), "python")
    n, motors = model.n_springs, rng.uniform(1.0, 5.0, model.n_motors)
    force, times = rng.normal(size=3) * 0.1, np.linspace(0.0, duration, 11)
    slow = sr.simulate(
        model,
        duration,
        motors,
        force=force,
        gravity=GRAVITY,
        damping_time=0.01,
        time_step=duration / steps,
        output_step=duration / 10,
    )
    w = run.workspace()
    start = {"position": model.rest, "gravity": np.array(GRAVITY), "damping": 0.01 * model.chain().stiffness}
    for name, values in start.items():
        run.put(w, getattr(run.layout, name), values)
    out = run.array(len(times) * (2 * n + 3))
    grid = run.flat(np.linspace(0.0, duration, steps + 1))
    path = run.flat(motors), 1, run.flat(force), 1
    assert run.motion_run(w, *path, grid, steps, run.flat(times), len(times), out) == 0
    rows = np.reshape(out, (len(times), -1))
    np.testing.assert_allclose(rows[:, 2 * n :], slow.tip_position, rtol=0, atol=1e-9 * model.reach)
    np.testing.assert_allclose(rows[:, :n], slow.q_springs, rtol=0, atol=1e-9 * np.abs(slow.q_springs).max())
    # A change of 1e-13 in the middle of a step is one of 2e-13 / h in the velocity at its end.
    left = 1e-9 * np.abs(slow.velocities).max() + steps * 2e-13 / (duration / steps)
    np.testing.assert_allclose(rows[:, n : 2 * n], slow.velocities, rtol=0, atol=left)


@pytest.mark.parametrize("kind", ["rod", "helix_lumped"])
def test_small_motions_are_those_of_simulate(kind: str) -> None:
    """Steps are solved to an absolute accuracy; where all moves by milliradians, that leaves 1e-9 of the motion, too."""
    model, rng = LONG[kind](), np.random.default_rng(5)
    springs, rates = model.rest + 2e-3 * rng.normal(size=model.n_springs), 0.02 * rng.normal(size=model.n_springs)
    start, motors = MotionState(model, 0.0, np.zeros(0), np.zeros(0), springs, rates), np.zeros(0)
    given = {"start": start, "force": (0.1, -0.1, 0.2), "gravity": GRAVITY, "damping_time": 5e-3, "time_step": 1e-3}
    slow, fast = sr.simulate(model, 0.04, motors, **given), sr.compile(model, backend="python").simulate(0.04, motors, **given)
    np.testing.assert_allclose(fast.q_springs, slow.q_springs, rtol=0, atol=1e-9 * np.abs(slow.q_springs).max())


def test_locked_strains_stay_at_rest(rng: np.random.Generator) -> None:
    """Bending alone: the step is that of a rod whose twist and stretch are a million times as stiff."""
    model = rod(elastic_sections=3)
    run: Any = make_run(make_motion_program(Unknowns(model.chain(), ("twist", "stretch"))), "python")
    stiff = rod(elastic_sections=3, torsional_stiffness=1e7, axial_stiffness=1e11)
    whole: Any = make_run(make_motion_program(Unknowns(stiff.chain())), "python")
    moving = np.concatenate([4 * np.arange(3)[:, None] + [0, 1]]).ravel()
    ends = []
    for one, rows in ((run, np.arange(6)), (whole, moving)):
        w = one.workspace()
        position = np.zeros(one.layout.unknowns)
        position[rows] = 0.1 * np.arange(1, 7)
        for name, values in (("position", position), ("gravity", np.array(GRAVITY)), ("time_step", np.array([1e-3]))):
            one.put(w, getattr(one.layout, name), values)
        for _ in range(5):
            assert one.motion_step(w) == 0
        ends.append(np.array(w[one.layout.position : one.layout.position + one.layout.unknowns])[rows])
    assert np.abs(ends[0] - 0.1 * np.arange(1, 7)).max() > 1e-4  # it moves
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-6)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["rod", "tensions"])
def test_a_batch_has_the_motions_of_its_cases(kind: str, rng: np.random.Generator) -> None:
    model = LONG[kind]()
    solver = sr.compile(model, backend="python")
    given = {"gravity": GRAVITY, "damping_time": 0.01, "time_step": 1e-3, "output_step": 2e-3}
    motors, forces = rng.uniform(1.0, 5.0, (3, model.n_motors)), rng.normal(size=(3, 3)) * 0.1
    batch = solver.simulations(0.01, motors, forces=forces, **given)
    for row in range(3):
        one = solver.simulate(0.01, motors[row], force=forces[row], **given)
        np.testing.assert_allclose(batch.tip_position[row], one.tip_position, rtol=0, atol=1e-10)


@pytest.mark.system
@pytest.mark.parametrize("kind", ["rod", "sections", "flexures"])
def test_the_c_file_takes_the_same_steps(kind: str, tmp_path: Path) -> None:
    """Through ctypes."""
    model, force, h = LONG[kind](), (0.2, -0.1, 0.05), 1e-3
    solver = sr.compile(model, backend="python")
    given = {"gravity": GRAVITY, "damping_time": 0.01, "time_step": h}
    expected = solver.simulate(0.02, (), force=force, output_step=h, **given)
    controller = Controller(solver, tmp_path, name="rod", motion=True)
    numbers = {"GRAVITY": GRAVITY, "DAMPING": 0.01 * model.stiffness, "TIME_STEP": [h], "FORCE": force, "POSITION": model.rest}
    for name, values in numbers.items():
        controller.put(name, values)
    for row in range(20):
        assert controller.call("motion_step") == 0
        np.testing.assert_allclose(controller.get("POSITION", model.n_springs), expected.q_springs[row + 1], rtol=0, atol=1e-11)


def test_a_section_does_not_leave_its_range() -> None:
    """A section bent by 160 degrees and turning further: simulate on Pinocchio and the compiled model stop at half a turn."""
    model = rod(elastic_sections=2)
    run: Any = make_run(make_motion_program(Unknowns(model.chain())), "python")
    w, bent = run.workspace(), np.zeros(8)
    bent[0] = np.deg2rad(160.0)
    state = {"position": bent, "velocity": np.eye(8)[0] * 2e3, "time_step": np.array([1e-3])}
    for name, values in state.items():
        run.put(w, getattr(run.layout, name), values)
    assert run.motion_step(w) == Status.UNSETTLED
    state["velocity"] = -np.eye(8)[0] * 2e3
    for name, values in state.items():
        run.put(w, getattr(run.layout, name), values)
    assert run.motion_step(w) == Status.CERTIFIED


def test_hinges_at_one_point_are_one_group() -> None:
    """Cost is proportional to groups: 30 hinges of bending and twist are 30."""
    unknowns = Unknowns(rod(chain="lumped", hinges=30, torsion=True, extension=False).chain())
    assert [len(group) for group in motion_groups(unknowns)] == [3] * 30


@pytest.mark.parametrize(("kind", "order"), [("rod", 2), ("sections", 4)])
def test_rayleigh_damping_of_long_chains_is_that_of_simulate(kind: str, order: int) -> None:
    """The mass term alone, large enough to halve velocities within the run, in steps of both kinds."""
    model, steps, h = LONG[kind](), 8, 2e-3
    given = {"force": (0.3, -0.2, 0.0), "damping_time": 0.0, "mass_damping": 40.0, "time_step": h, "order": order}
    slow = sr.simulate(model, steps * h, np.zeros(0), **given)
    fast = sr.compile(model, backend="python").simulate(steps * h, np.zeros(0), **given)
    assert np.abs(slow.energy.dissipated).max() > 0.1 * slow.energy.kinetic.max()
    # Steps are solved to 1e-13 rad.
    np.testing.assert_allclose(fast.q_springs, slow.q_springs, rtol=0, atol=1e-9 * np.abs(slow.q_springs).max() + 1e-12)


@pytest.mark.parametrize("kind", ["rod", "foreign", "helix_lumped", "sections"])
def test_both_matrices_of_a_step_of_fourth_order_have_one_solution(kind: str) -> None:
    """Equations do not depend on the matrix that solves them: the ends are those of `simulate`, to its 1e-13 a step."""
    model, rng, h, steps = LONG[kind](), np.random.default_rng(4), 2e-3, 3
    springs, rates = model.rest + 5e-3 * rng.normal(size=model.n_springs), 0.05 * rng.normal(size=model.n_springs)
    motors, force = 0.2 * rng.normal(size=model.n_motors), (0.1, -0.2, 0.1)
    start = MotionState(model, 0.0, motors, np.zeros(model.n_motors), springs, rates)
    given = {"gravity": GRAVITY, "damping_time": 1e-3, "time_step": h, "order": 4}
    expected = sr.simulate(model, steps * h, motors, start=start, force=force, **given).q_springs[-1]
    run: Any = make_run(make_motion_program(Unknowns(model.chain()), order=4), "python")
    for coupled in (0.0, 1.0):
        w, layout = run.workspace(), run.layout
        values = {"position": springs, "velocity": rates, "damping": 1e-3 * model.chain().stiffness, "force": np.array(force)}
        values |= {"gravity": np.array(GRAVITY), "time_step": np.array([h]), "coupled": np.array([coupled])}
        values |= {f"motors_{when}": motors for when in ("begin", "middle", "end")}
        for name, value in values.items():
            run.put(w, getattr(layout, name), value)
        for _ in range(steps):
            assert run.motion_step(w) == Status.CERTIFIED
        found = np.array(w[layout.position : layout.position + layout.unknowns])
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


def aside(hinges: int, newton: float) -> tuple[SoftModel, sr.Equilibrium]:
    """A steel rod that is held aside, in no plane of its hinges."""
    bending, mass = 200e9 * np.pi * 0.8e-3**4 / 4.0, 7850.0 * np.pi * 0.8e-3**2
    shape = {"radius": 0.8e-3, "linear_density": mass, "bending_stiffness": bending, "torsional_stiffness": bending / 1.5}
    model = rod(chain="lumped", hinges=hinges, torsion=True, extension=False, **shape)
    force = newton * np.array((np.cos(0.7), np.sin(0.7), 0.0))
    return model, sr.solve_equilibrium(model, (), force=force, gravity=(0.0, 0.0, -9.81))


@pytest.mark.parametrize("mass_damping", [0.0, 2.0])
def test_stages_of_a_rod_that_twists_as_it_swings_have_matrices_of_their_own(mass_damping: float) -> None:
    """With that of the second stage the corrections shrink slowly here; no step is halved, and all are those of `simulate`."""
    (model, start), h, steps = aside(6, 0.15), 2.5e-3, 20
    given: dict[str, Any] = {"start": start, "gravity": (0.0, 0.0, -9.81), "damping_time": 0.0, "time_step": h, "order": 4}
    slow = sr.simulate(model, steps * h, (), mass_damping=mass_damping, **given)
    solver, seen = sr.compile(model, backend="python"), []
    run, _, _ = solver._motion_code(None, 0.0, mass_damping, 4)
    workspace = run.workspace
    run.workspace = lambda: seen.append(workspace()) or seen[-1]
    fast = solver.simulate(steps * h, (), mass_damping=mass_damping, **given)
    (w,) = seen
    assert w[run.layout.coupled] == 1.0
    assert w[run.layout.parts] == steps
    np.testing.assert_allclose(fast.q_springs, slow.q_springs, rtol=0, atol=1e-9 * np.abs(slow.q_springs).max())


def test_small_errors_of_undamped_steps_do_not_add_up() -> None:
    """A rod of many stiff pairs in no plane of its hinges, whose corrections shrink, grow a little, and shrink on.

    Steps that take growth below 1e-9 for rounding, or expect too much of the next correction, leave 5e-10 rad after 60.
    """
    shape = {"radius": 4.3e-3, "linear_density": 0.083, "bending_stiffness": 0.021, "torsional_stiffness": 0.017}
    model = rod(chain="lumped", hinges=17, torsion=True, extension=False, **shape)
    gravity = (1.0, -2.0, -9.0)
    start = sr.solve_equilibrium(model, (), force=(0.05, 0.03, 0.01), gravity=gravity)
    given: dict[str, Any] = {"start": start, "gravity": gravity, "damping_time": 0.0, "time_step": 2.5e-3, "order": 4}
    slow, fast = sr.simulate(model, 0.15, (), **given), sr.compile(model).simulate(0.15, (), **given)
    np.testing.assert_allclose(fast.q_springs, slow.q_springs, rtol=0, atol=1e-10 * np.abs(slow.q_springs).max())


def test_a_run_that_is_compared_ends_where_its_steps_have_too_many_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """At exactly as many as it may have it goes on; with given steps, which are not compared, it goes on with any number."""
    (model, start), grid = aside(3, 1.4), np.array([0.0, 0.1])
    solver = sr.compile(model, backend="python")
    run, given, _ = solver._motion_code((0.0, 0.0, -9.81), 0.0, 0.0, 4)
    course = Course(MotorPath(model, (), 0.1), TimeLoad(model, None, None, 0.1), solver._spring_kicks)
    state, counted = (start.q_springs, np.zeros(model.n_springs)), run.workspace()
    for place, values in [*given, (run.layout.position, state[0]), (run.layout.time_step, grid[1:])]:
        run.put(counted, place, values)
    assert run.motion_step(counted) == Status.CERTIFIED
    parts = counted[run.layout.parts]
    assert parts > 1.0
    for allowed, compared, status in ((parts, True, 0), (parts - 1.0, True, Status.UNSETTLED), (1.0, False, 0)):
        monkeypatch.setattr(motion_runs, "_PARTS_A_STEP", allowed / len(grid))
        assert take_one(run, state, given, course, grid, grid, compared=compared).status[0] == status


def test_cases_that_are_done_one_by_one_are_those_of_lanes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the workspaces of all lanes together are too large, as for long rods; both solve a step to 1e-13."""
    if importlib.util.find_spec("numba") is None:
        missing("numba is not installed")
    model, start = aside(3, 0.15)
    starts = start.q_springs * np.linspace(0.5, 1.0, 3)[:, None]
    found = []
    for memory in (0, 1 << 30):
        monkeypatch.setattr(motion_settings, "LANE_CACHE", memory)
        solver = sr.compile(model, backend="numba")
        assert f"ALONE = {int(memory == 0)}\n" in solver._motion_code(None, 0.0, 0.0, 4)[0].program.text
        batch = solver.simulations(0.05, np.zeros((3, 0)), starts=starts, damping_time=0.0, time_step=2.5e-3, order=4)
        assert not np.any(batch.status)
        found.append(batch.q_springs)
    np.testing.assert_allclose(*found, rtol=0, atol=1e-9 * np.abs(starts).max())
