"""Motion against answers that are not ours: rods of the tests' own (a Cosserat rod, a planar rod to many digits) and MuJoCo."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.export import to_mjcf
from tests.support import law_robots
from tests.support.cosserat_rod import CosseratRod
from tests.support.planar_rod import PlanarRod
from tests.support.rods import cantilever_frequencies, elastica_tip
from tests.support.round_rods import RoundRod

STEEL = PlanarRod(0.6, 0.8e-3, 200e9, 7850.0, gravity=(0.0, -9.81))
TPU = PlanarRod(0.4, 5e-3, 70e6, 1200.0, stretches=6, gravity=(0.0, -9.81))
SOFT = CosseratRod(0.4, 0.02, 1e6, 1000.0, 24, gravity=(0.0, 0.0, -3.0))


def chain(rod: RoundRod, count: int, form: str = "sections", **options: Any) -> sr.SoftModel:
    """Our model of a rod."""
    return sr.load_model(
        sr.PccArm(
            segment_lengths=(rod.length,), muscle_azimuths=(), radius=rod.radius, linear_density=rod.density * rod.area,
            bending_stiffness=rod.bending, torsional_stiffness=rod.bending / 1.5, axial_stiffness=rod.young * rod.area,
            chain=form, elastic_sections=count, hinges=count, **options,
        )
    )  # fmt: skip


@pytest.mark.study
def test_the_planar_rod_is_right() -> None:
    """Closed forms to rounding of the solvers; free vibration to the same path with more polynomials and shorter steps."""
    slender = dataclasses.replace(TPU, radius=1e-5, stretches=0, bends=13)
    speed = np.sqrt(TPU.young / TPU.density)
    closed = cantilever_frequencies(0.0) * speed * slender.radius / 2.0 / TPU.length**2
    assert np.allclose(slender.frequencies()[:3], closed, rtol=1e-7)  # rotary inertia of a radius of 1e-5 m: 1e-9
    axial = dataclasses.replace(TPU, gravity=(0.0, 0.0)).frequencies() / (speed * np.pi / 2.0 / TPU.length)
    assert np.abs(axial - 1.0).min() < 1e-7
    assert np.abs(axial - 3.0).min() < 1e-4
    weightless = dataclasses.replace(STEEL, gravity=(0.0, 0.0), bends=13)
    x, z, _ = elastica_tip(STEEL.bending, STEEL.length, 0.6)
    assert np.allclose(weightless.tip(weightless.equilibrium((0.6, 0.0))), [x, z], atol=1e-10)
    paths = [_path(dataclasses.replace(STEEL, bends=bends), 0.6, 0.5, 10, steps) for bends, steps in ((9, 500), (10, 1000))]
    assert np.linalg.norm(paths[0] - paths[1], axis=1).mean() < 1e-4  # of tips 0.5 m apart


def _path(rod: PlanarRod, force: float, duration: float, rows: int, steps: int) -> np.ndarray:
    return rod.tips(rod.equilibrium((force, 0.0)), duration, rows, steps)


@pytest.mark.study
def test_the_cosserat_rod_is_right() -> None:
    """Frequencies and elastica in closed form, vibration of the planar rod, all to second order in the cells."""
    speed, errors = np.sqrt(SOFT.young / SOFT.density) * np.pi / 2.0 / SOFT.length, []
    planar = PlanarRod(SOFT.length, SOFT.radius, SOFT.young, SOFT.density, bends=10, stretches=4, gravity=(0.0, -3.0))
    bending = dataclasses.replace(planar, stretches=0).frequencies()[0]
    force, times = 3.0 * SOFT.bending / SOFT.length**2, np.linspace(0.0, 0.2, 3)
    tip = elastica_tip(SOFT.bending, SOFT.length, force)
    path = planar.tips(planar.equilibrium((force, 0.0)), 0.2, 2, 2000)
    for cells in (8, 16):
        rod = dataclasses.replace(SOFT, cells=cells)
        found = rod.frequencies()
        rates = [np.abs(found / rate - 1.0).min() for rate in (speed, speed / np.sqrt(3.0), bending)]
        stiff = dataclasses.replace(rod, shear=1e3, stretch=1e3, gravity=(0.0, 0.0, 0.0))
        at_rest = np.linalg.norm(stiff.tips(stiff.equilibrium((force, 0, 0, 0, 0, 0))[None])[0] - [tip[0], 0.0, tip[1]])
        moved = rod.tips(rod.motion(rod.equilibrium((force, 0, 0, 0, 0, 0)), times))[:, [0, 2]]
        errors.append([*rates, at_rest, np.linalg.norm(moved - path, axis=1).max()])
    ratios = np.array(errors[0]) / np.array(errors[1])
    assert np.all((ratios > 2.8) & (ratios < 5.0)), (ratios, errors)
    assert max(errors[1]) < 6e-3


@pytest.mark.study
def test_sections_move_as_a_cosserat_rod_to_second_order() -> None:
    """Bent in two planes, twisted and stretched by a wrench that comes and goes within a tenth of a second, then free as long.

    The reference is the method of lines with SciPy's Radau, extrapolated from two grids of second order.
    """
    counts, push = (4, 8), 0.1
    bend, twist = SOFT.bending / SOFT.length**2, SOFT.torsion / SOFT.length
    largest, times = np.array([6.0 * bend, 3.0 * bend, 40.0, 0.0, 0.0, 1.5 * twist]), np.linspace(0.0, 2.0 * push, 9)

    def wrench(t: float) -> np.ndarray:
        return largest * np.sin(np.pi * t / push) ** 2 * (t < push)

    coarse, fine = (
        rod.tips(rod.motion(rod.straight, times, wrench, tolerance=1e-5, method="Radau"))
        for rod in (dataclasses.replace(SOFT, cells=cells) for cells in (12, 24))
    )
    path, errors = (4.0 * fine - coarse) / 3.0, []
    assert np.abs(fine - path).max() < 2e-3
    for count in counts:
        options: dict[str, Any] = {"wrench": wrench, "gravity": SOFT.gravity, "damping_time": 0.0, "time_step": 1e-3}
        moved = sr.simulate(chain(SOFT, count), 2.0 * push, (), output_step=0.25 * push, **options)
        errors.append(np.abs(moved.tip_position - path).max())
    assert 2.8 < errors[0] / errors[1] < 5.5, errors  # the time step is 1e-4 m of them
    assert errors[1] < 0.2 / counts[1] ** 2
    assert np.ptp(path, axis=0).max() > 0.1


@pytest.mark.study
@pytest.mark.parametrize("twists", [False, True])
def test_free_vibration_is_that_of_mujoco(twists: bool, tool: Callable[[str], ModuleType]) -> None:
    """Runge and Kutta's method of MuJoCo, refined until nothing changes: our error is of second order in time."""
    mujoco = tool("mujoco")
    model = chain(SOFT, 6, "lumped", torsion=twists, extension=twists)
    bend, twist, gravity = SOFT.bending / SOFT.length**2, SOFT.torsion / SOFT.length, (0.0, -4.0, -6.0)
    start = sr.solve_equilibrium(model, (), wrench=(2.0 * bend, 0, 0, 0, 0, twist if twists else 0.0), gravity=gravity)
    other = mujoco.MjModel.from_xml_string(to_mjcf(model, damping=0.0, limits=False))
    other.opt.gravity[:], other.opt.integrator = gravity, mujoco.mjtIntegrator.mjINT_RK4
    other.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    paths = []
    for per_row in (100, 200):
        data, other.opt.timestep, path = mujoco.MjData(other), 0.02 / per_row, []
        data.qpos[[int(other.joint(name).qposadr[0]) for name in model.spring_joints]] = start.q_springs
        for _ in range(16):
            mujoco.mj_forward(other, data)
            path.append(np.array(data.body(model.tip).xpos))
            mujoco.mj_step(other, data, nstep=per_row)
        paths.append(np.array(path))
    assert np.abs(paths[0] - paths[1]).max() < 1e-6
    options: dict[str, Any] = {"start": start, "gravity": gravity, "damping_time": 0.0, "output_step": 0.02}
    errors = [
        np.abs(sr.simulate(model, 0.3, (), time_step=step, **options).tip_position - paths[1]).max()
        for step in (5e-4, 2.5e-4, 1.25e-4)
    ]
    assert 3.2 < errors[0] / errors[1] < 4.8, errors
    assert 3.6 < errors[1] / errors[2] < 4.4, errors
    assert errors[2] < 2e-4  # the tip moves by 0.5 m


@pytest.mark.study
def test_flexures_reach_as_far_as_the_rod() -> None:
    """The elastica in closed form, of a tip that turns by 45 and 64 degrees: flexures are of fourth order, hinges of second.

    3.3: twice the stretch of the rod, 1e-7 of its length, is in the finer error, and room for the next order.
    """
    for load in (2.0, 4.0):
        force = load * STEEL.bending / STEEL.length**2
        x, z, _ = elastica_tip(STEEL.bending, STEEL.length, force)
        errors = {}
        for form, count in (("flexures", 8), ("flexures", 16), ("lumped", 16)):
            found = sr.solve_equilibrium(chain(STEEL, count, form), (), force=(force, 0.0, 0.0)).tip_position
            errors[form, count] = np.linalg.norm(found - (x, 0.0, z))
        assert np.log2(errors["flexures", 8] / errors["flexures", 16]) > 3.3, errors
        assert 10.0 * errors["flexures", 16] < errors["lumped", 16], errors


def test_bent_flexures_are_round() -> None:
    """Turning the bend of every section about its axis by one angle changes no height; the mass is that of the rod."""
    model, rng = chain(TPU, 6, "flexures"), np.random.default_rng(3)
    bend, heights, parts = rng.normal(size=6) * 0.3, [], list(model.pinocchio.inertias)
    for azimuth in np.linspace(0.0, 2.0, 5):
        z = np.zeros((6, 4))
        z[:, 0], z[:, 1] = bend * np.cos(azimuth), bend * np.sin(azimuth)
        data = model.pinocchio.createData()
        heights.append(pin.centerOfMass(model.pinocchio, data, model.configuration((), z.ravel()))[2])
    assert np.ptp(heights) < 1e-14
    assert sum(one.mass for one in parts) - 2.0 == pytest.approx(TPU.density * TPU.area * TPU.length, rel=1e-12)  # base: 2 kg


def test_flexures_carry_no_actuators() -> None:
    with pytest.raises(sr.ParameterError, match="an arm with actuators"):
        sr.PccArm(chain="flexures")


@pytest.mark.study
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("rod", "form", "force", "bends", "steps", "duration"),
    [(TPU, "lumped", 0.1, 10, 500, 10.0), (TPU, "flexures", 0.3, 11, 600, 2.0), (STEEL, "flexures", 0.6, 12, 1300, 4.0)],
    ids=["pairs", "flexures", "steel"],
)
def test_ten_seconds_of_free_vibration_are_half_a_millimetre_off(
    rod: PlanarRod, form: str, force: float, bends: int, steps: int, duration: float
) -> None:
    """30 pairs of hinges or flexures, undamped, released upright from a sideways force, with steps by default.

    Periods that differ drift apart in proportion to time: two seconds have a fifth of the error of ten, four two fifths. The
    reference is five times as good, by one with a polynomial and a fifth of the steps in 0.05 s less.
    """
    rows, allowed = round(20.0 * duration), 5e-4 * duration / 10.0
    fine = _path(dataclasses.replace(rod, bends=bends), force, duration, rows, steps)
    coarse = _path(dataclasses.replace(rod, bends=bends - 1), force, duration, rows, 4 * steps // 5)
    assert np.linalg.norm(fine - coarse, axis=1).mean() < 0.2 * allowed
    model = chain(rod, 30, form, extension=rod.stretches > 0)
    start = sr.solve_equilibrium(model, (), force=(force, 0.0, 0.0), gravity=(0.0, 0.0, -9.81))
    moved = sr.compile(model).simulate(duration, (), start=start, gravity=(0.0, 0.0, -9.81), damping_time=0.0, output_step=0.05)
    assert np.linalg.norm(moved.tip_position[:, [0, 2]] - fine, axis=1).mean() < allowed


@pytest.mark.study
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "engine",
    [
        pytest.param("general", marks=pytest.mark.shortened(2, 50)),
        pytest.param("compiled", marks=pytest.mark.shortened(20, 1600)),
    ],
)
def test_random_runs_end_with_numbers(engine: str, cases: int) -> None:
    """More than ten thousand with random loads, motors, damping and steps, most of them compiled: each ends, with numbers."""
    rng, failed, runs = np.random.default_rng(21), 0, 0
    for kind in law_robots.ROBOTS:
        model = law_robots.model(kind)
        simulate: Any = partial(sr.simulate, model)
        if engine == "compiled":
            if kind in ("limp", "foreign"):
                continue  # plateaus and side branches are refused there
            simulate = sr.compile(model, backend=None if cases > 100 else "python").simulate  # numba compiles each for seconds
        for _ in range(cases):
            runs += 1
            push = law_robots.PUSHES[kind] * 10.0 ** rng.uniform(-2.0, 0.5) * rng.normal(size=3)
            step = 10.0 ** rng.uniform(-4.0, -1.5)
            motors = model.relaxed_motors * (1.0 + 0.1 * rng.uniform(-1.0, 1.0, model.n_motors))
            options = {"force": push, "damping_time": rng.choice([0.0, 1e-3, 0.1]), "gravity": rng.normal(size=3) * 6.0}
            try:
                moved = simulate(3.0 * step, motors, time_step=step, **options)
                energies = engine == "general" or runs % 20 == 0  # Pinocchio computes those of compiled motion, slowly
                balance = moved.energy.balance if energies else 0.0
            except sr.NotConverged:
                failed += 1
                continue
            assert all(
                np.all(np.isfinite(values)) for values in (moved.q_springs, moved.velocities, moved.tip_position, balance)
            )
    assert failed < runs / 100, (failed, runs)


@pytest.mark.study
@pytest.mark.timeout(1800)
@pytest.mark.shortened(3, 200)
def test_random_pulses_and_moving_motors_keep_their_energy(cases: int) -> None:
    """Loads that jump at round times, motors that move, steps that are chosen, both engines: the tip agrees, energy is kept."""
    rng, model = np.random.default_rng(8), sr.load_model(sr.InflatableArm())
    fast = sr.compile(model)
    for case in range(cases):
        duration, (begin, end) = (
            float(rng.choice([0.5, 1.0, 2.0])),
            np.sort(rng.choice(np.arange(1, 20), 2, replace=False)) / 20.0,
        )
        push, swing, rate = rng.normal(size=3) * 4.0, rng.normal(size=3) * 0.2, rng.integers(1, 6)

        def force(t: float, span: Any = (begin * duration, end * duration), push: np.ndarray = push) -> np.ndarray:
            return push * (span[0] < t < span[1])

        def path(t: float, swing: np.ndarray = swing, rate: Any = rate) -> np.ndarray:
            return swing * np.sin(rate * t) ** 2

        options: dict[str, Any] = {"force": force, "damping_time": float(rng.choice([1e-3, 1e-2])), "gravity": sr.EARTH_GRAVITY}
        moved = [engine(duration, path, **options) for engine in (partial(sr.simulate, model), fast.simulate)]
        for motion in moved:
            assert np.diff(motion.steps).min() > 1e-9 * duration, case
            work = np.abs(motion.energy.load_work).max() + np.abs(motion.energy.motor_work).max()
            assert np.abs(motion.energy.balance).max() < 0.02 * work, case  # the tip is known to 5e-4 of the reach
        tips = np.linalg.norm(moved[0].tip_position - moved[1].tip_position, axis=1)
        assert tips.max() < 2.0 * 5e-4 * model.reach, case
