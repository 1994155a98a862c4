"""Compiled solvers of long chains: against Pinocchio's path, and beyond its size against elastic rods in closed form."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.support.rods import Rod, rod_tip

GRAVITY = np.array(sr.EARTH_GRAVITY)
EI, LENGTH = 1.5, 1.0
UNEVEN = {"segment_lengths": (0.5, 0.4), "bending_stiffness": (1.9, 1.2)}
ROBOTS: dict[str, Callable[[], sr.SoftModel]] = {
    "sections": lambda: sr.load_model(sr.PccArm(**UNEVEN, elastic_sections=3)),
    "sections_forces": lambda: sr.load_model(sr.PccArm(**UNEVEN, elastic_sections=3), muscles="forces"),
    "lumped_forces": lambda: sr.load_model(sr.PccArm(**UNEVEN, chain="lumped", hinges=5), muscles="forces"),
    "helix": lambda: sr.load_model(sr.HelixTube(elastic_sections=8)),
    "helix_lumped": lambda: sr.load_model(sr.HelixTube(chain="lumped", hinges=8)),
    "stiff_and_soft": lambda: sr.load_model(
        sr.PccArm(
            segment_lengths=(0.3, 0.3, 0.3),
            bending_stiffness=(300.0, 0.5, 20.0),
            torsional_stiffness=(200.0, 0.4, 20.0),
            axial_stiffness=(1e5, 500.0, 1e4),
            elastic_sections=2,
        ),
        muscles="forces",
    ),
    "arm_and_sections": lambda: sr.load_model(sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(elastic_sections=2))),
}


@cache
def compiled(name: str) -> CompiledModel:
    return sr.compile(ROBOTS[name](), backend="python")


def actuated(model: sr.SoftModel, rng: np.random.Generator, count: int) -> np.ndarray:
    """Motors up to a radian; muscles up to 8 % longer or shorter, or up to 40 N."""
    motors = np.tile(np.array(model.relaxed_motors), (count, 1))
    muscles, joints = len(model.muscles), model.n_motors - len(model.muscles)
    motors[:, :joints] = rng.uniform(-1.0, 1.0, (count, joints))
    if model.muscle_input == "forces":
        motors[:, joints:] = rng.uniform(0.0, 40.0, (count, muscles))
    else:
        motors[:, joints:] *= 1.0 + rng.uniform(-0.08, 0.08, (count, muscles))
    return motors


def forces_of(rng: np.random.Generator, count: int, largest: float) -> np.ndarray:
    forces = rng.normal(size=(count, 3))
    return np.asarray(forces * rng.uniform(0.02, 1.0, (count, 1)) * largest / np.linalg.norm(forces, axis=1)[:, None])


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, GRAVITY], ids=["weightless", "heavy"])
@pytest.mark.parametrize("name", ROBOTS)
def test_long_chains_equal_the_pinocchio_path(name: str, gravity: Any, rng: np.random.Generator) -> None:
    solver, count = compiled(name), 2
    motors = actuated(solver.model, rng, count)
    forces = forces_of(rng, count, 0.3 if name.startswith("helix") else 6.0)
    found = solver.equilibria(motors, forces, gravity=gravity)
    for row in range(count):
        expected = sr.solve_equilibrium(solver.model, motors[row], forces[row], gravity=gravity, tolerance=1e-13)
        assert found.certified[row] == expected.stable
        size = np.linalg.norm(expected.q_springs)
        # 1e-10 of the load is what an answer promises; soft springs beside stiff ones make ten times that of it.
        assert np.linalg.norm(found.q_springs[row] - expected.q_springs) < 1e-9 * size
        assert np.linalg.norm(found.tip_positions[row] - expected.tip_position) < 1e-9
        single = solver.equilibrium(motors[row], forces[row], gravity=gravity)
        assert np.linalg.norm(single.q_springs - found.q_springs[row]) < 1e-9 * size
        assert np.linalg.norm(single.tip_position - found.tip_positions[row]) < 1e-9


@pytest.mark.study
@pytest.mark.parametrize("name", ["sections", "sections_forces", "arm_and_sections"])
def test_no_failure_touches_another(name: str, rng: np.random.Generator) -> None:
    solver = compiled(name)
    motors, forces = actuated(solver.model, rng, 30), forces_of(rng, 30, 6.0)
    clean = solver.equilibria(motors, forces)
    evil_motors, evil_forces = motors.copy(), forces.copy()
    evil_motors[[0, 4], -1] = np.nan, 1e40
    evil_forces[[7, 29], 1] = np.inf, np.nan
    evil_forces[11], evil_forces[12] = 1e5, -1e20
    found = solver.equilibria(evil_motors, evil_forces)
    good = np.setdiff1d(np.arange(30), [0, 4, 7, 11, 12, 29])
    for field, value in vars(found).items():
        if value is None:  # what friction remembers
            continue
        assert np.array_equal(np.asarray(value)[good], np.asarray(getattr(clean, field))[good]), field
        assert not np.any(np.isnan(np.asarray(value, dtype=float))), field
        assert not value.flags.writeable
    assert np.all(found.status[[0, 4, 7, 29]] == Status.NOT_A_NUMBER)
    assert found.status[12] != Status.CERTIFIED
    order = rng.permutation(30)
    shuffled = solver.equilibria(motors[order], forces[order])
    assert np.array_equal(shuffled.q_springs, clean.q_springs[order])


def test_muscle_lengths_that_no_shape_has() -> None:
    solver = compiled("sections")
    with pytest.raises(sr.ParameterError):
        solver.equilibrium(np.full(6, -1.0))
    motors = np.tile(np.array(solver.model.relaxed_motors), (3, 1))
    motors[1] = -1.0
    found = solver.equilibria(motors, (0.0, 0.5, 0.0))
    assert found.status.tolist() == [Status.CERTIFIED, Status.NOT_A_NUMBER, Status.CERTIFIED]


@pytest.mark.parametrize("name", ["sections", "sections_forces"])
def test_pushed_straight(name: str) -> None:
    """EI of 1.9 and 1.2 N m^2 over 0.9 m buckle below 5 N, unless muscles hold them straight; what is certified is stable."""
    solver = compiled(name)
    model = solver.model
    for push in (1.0, 8.0, 20.0):
        force = np.array([0.0, 0.0, -push])
        found = solver.equilibria(model.relaxed_motors, force[None])
        checked = sr.solve_equilibrium(model, model.relaxed_motors, force, q_springs0=found.q_springs[0], tolerance=1e-9)
        assert checked.iterations <= 3  # none, but to refine what is nearly neutral
        assert np.allclose(checked.tip_position, found.tip_positions[0], rtol=0.0, atol=1e-12)
        assert found.status[0] == {"stable": Status.CERTIFIED, "neutral": Status.NEUTRAL}[checked.stability.kind]
        # A bow of an arm that is equally soft in all directions can turn freely: neutral, so not certified.
        bowed = name == "sections_forces" and push > 5.0
        assert (found.status[0] == Status.NEUTRAL) == bowed
        assert (np.linalg.norm(found.tip_positions[0, :2]) > 0.1) == bowed
        if bowed:
            one = solver.equilibrium(model.relaxed_motors, force)
            assert (one.status, one.stable) == (Status.NEUTRAL, False)
            assert np.all(np.isfinite(one.q_springs))


# --- Rods


@cache
def rod(count: int, chain: str, locked: tuple[str, ...] = (), stiff: float = 1.0) -> CompiledModel:
    """A cantilever of sections or hinges, straight along z."""
    arm = sr.PccArm(
        segment_lengths=(LENGTH,),
        offset=0.0,
        bending_stiffness=EI,
        torsional_stiffness=1.1 * stiff,
        axial_stiffness=800.0 * stiff,
        chain=chain,
        **({"elastic_sections": count} if chain == "sections" else {"hinges": count, "torsion": False, "extension": False}),
    )
    return sr.compile(sr.load_model(arm, muscles="forces"), backend="python", locked_strains=locked)


@pytest.mark.study
def test_convergence_to_a_rod_in_space() -> None:
    """Bent, twisted and stretched by its weight and a force aside: Kirchhoff's equations as a boundary-value problem."""
    force, weight = np.array([0.9, 0.7, -0.4]), np.array([0.6 * 1.2, 0.0, 0.6 * -2.0])  # 0.6 kg/m
    expected, _ = rod_tip(Rod(LENGTH, EI, 1.1, 800.0), np.r_[force, 0.0, 0.0, 0.0], gravity_load=weight)
    errors = []
    for count in (8, 16):
        solver = rod(count, "sections")
        found = solver.equilibrium(solver.model.relaxed_motors, force, gravity=weight / 0.6)
        errors.append(np.linalg.norm(found.tip_position - expected))
    assert errors[1] < 8e-4
    assert 3.5 < errors[0] / errors[1] < 4.5  # second order


@pytest.mark.study
def test_locked_strains_are_the_limit_of_stiff_ones() -> None:
    """Twist and stretch a million times as stiff move a millionth as much."""
    bending, stiff, soft = rod(15, "sections", ("twist", "stretch")), rod(15, "sections", stiff=1e6), rod(15, "sections")
    force = (1.0, 2.0, -1.0)
    tips = [one.equilibrium(one.model.relaxed_motors, force).tip_position for one in (bending, stiff, soft)]
    assert np.linalg.norm(tips[0] - tips[1]) < 3e-6 * np.linalg.norm(tips[0] - tips[2]) + 1e-9
    assert np.linalg.norm(tips[0] - tips[2]) > 1e-4
    springs = bending.equilibrium(bending.model.relaxed_motors, force).q_springs.reshape(15, -1)
    assert np.all(np.count_nonzero(springs, axis=1) == 2)  # twist and elongation stay at rest


def test_strains_that_lengths_hold_cannot_be_locked() -> None:
    with pytest.raises(sr.ParameterError, match="muscle lengths constrain"):
        sr.compile(compiled("sections").model, locked_strains=("stretch",))
    sr.compile(compiled("sections").model, locked_strains=("twist",))
