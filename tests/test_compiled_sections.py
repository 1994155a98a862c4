"""Sections of constant strain in the kernels: against SciPy's and mpmath's exponential, and Pinocchio's energy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled.chain.elements import Load, Screw, constants, vector
from softrobots.compiled.chain.section_weight import OwnWeight, weight_moment
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression, gradient
from softrobots.compiled.trace.stumpff_series import LARGEST, stumpff
from softrobots.model.serial_chain import ChainSection
from softrobots.model.soft_model import SoftModel
from tests.support.oracles import central_difference
from tests.support.screw_motions import H, exact_screw, exact_stumpff, screw_matrix
from tests.support.serial_chains import section_frames
from tests.support.traced import functions, operations, values

angles_ = st.floats(-1.5, 1.5)
sections_ = st.tuples(angles_, angles_, angles_, st.floats(-0.04, 0.1))
# Straight, nearly straight, bent in a plane, and bent and twisted by nearly half a turn.
POINTS = (
    (0.0, 0.0, 0.0, 0.0),
    (1e-12, -1e-9, 1e-10, 0.01),
    (1e-5, 2e-5, -1e-5, 0.0),
    (0.7, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.9, -0.02),
    (0.8, -0.5, 0.6, 0.03),
    (-2.0, 1.5, 1.2, 0.05),
)


def floats(array: Any) -> np.ndarray:
    return np.asarray(array, dtype=np.float64)


def loads_of(rng: np.random.Generator) -> list[Load]:
    """A force on a tip beyond, and gravity on masses beyond."""
    return [Load(constants(rng.normal(size=3)), constants(rng.normal(size=3)), share) for share in (1.0, 0.7)]


def no_bodies() -> list[tuple[float, Any]]:
    return [(0.0, constants(np.zeros(3)))] * 6


def lever(z: np.ndarray, load: Load) -> np.ndarray:
    """Where the section carries a lever: its share of the end, and the lever turned; by SciPy's exponential."""
    end = screw_matrix(z, H)
    return end[:3, 3] * load.share + end[:3, :3] @ floats(load.lever)


# --- Stumpff functions


def test_stumpff_functions_up_to_half_a_turn_of_bending_and_of_twist() -> None:
    """Against 100 digits; rounding is magnified on the way down by x / ((k + 1)(k + 2)): ten for c_0, which nobody uses."""
    for x in [0.0, 1e-24, 1e-12, 1e-6, *np.linspace(0.01, LARGEST, 25).tolist()]:
        for k in range(8):
            exact = exact_stumpff(k, x)
            for found in (stumpff(x, highest)[k] for highest in (6, 7) if k <= highest):
                assert k == 0 or abs(found - exact) < 1e-15, (k, x)
                # Relative to the value at zero, which is what the sum starts from.
                assert abs(found - exact) < 4.5e-16 * (1.0 + x / ((k + 1) * (k + 2))) / math.factorial(k), (k, x)


def test_the_series_has_no_more_terms_than_it_needs() -> None:
    """One term less would be seen at the end of the range."""
    left_out = LARGEST**14 / math.factorial(28 + 6) * math.factorial(6)  # relative to c_6(0)
    assert left_out < 1e-16 < left_out * 28 * 34 / LARGEST


# --- The screw motion


@pytest.mark.parametrize("z", POINTS)
def test_the_end_of_a_section_is_the_exponential(z: tuple[float, ...]) -> None:
    """Of mpmath, to ten units in the last place."""
    screw = Screw(z, H)
    with mp.workdps(50):
        exact = np.array(exact_screw(*map(mp.mpf, z)).tolist(), dtype=np.float64)
    assert np.abs(floats(screw.rotation) - exact[:3, :3]).max() < 2e-15
    assert np.abs(floats(screw.position) - exact[:3, 3]).max() < 2e-15 * H


@given(sections_, st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_motion_of_what_is_beyond(z: tuple[float, ...], seed: int) -> None:
    """Levers, moves, turns, torques and bends in slanted reference axes, from SciPy's exponential by central differences."""
    rng = np.random.default_rng(seed)
    loads = loads_of(rng)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes *= np.linalg.det(axes)
    end = axes @ screw_matrix(np.array(z), H)[:3, :3]
    turned = [Load(load.force, constants(end @ floats(load.lever)), load.share) for load in loads]
    motion, levers = Screw(z, H).motion(turned, no_bodies(), constants(axes))
    moves = []
    for load, found in zip(loads, levers, strict=True):
        assert np.allclose(floats(found), axes @ lever(np.array(z), load), rtol=0.0, atol=1e-14)
        moves.append(axes @ central_difference(lambda at, load=load: lever(at, load), np.array(z)))
    # Central differences of step 1e-6: rounding 1e-16 / 1e-6.
    assert np.allclose(floats(motion.moves), moves[0], rtol=0.0, atol=3e-9)
    torques = [floats(load.force) @ move for load, move in zip(loads, moves, strict=True)]
    assert np.allclose(floats(motion.torque), torques[0] + torques[1], rtol=0.0, atol=1e-8)
    assert np.allclose(floats(motion.weight), torques[1], rtol=0.0, atol=1e-8)
    bends = sum(np.cross(move, floats(load.force), axis=0) for load, move in zip(loads, moves, strict=True))
    assert np.allclose(floats(motion.bends), bends, rtol=0.0, atol=1e-8)
    turning = central_difference(lambda at: screw_matrix(at, H)[:3, :3].ravel(), np.array(z)).reshape(3, 3, 4)
    spins = np.einsum("ijc,kj->cik", turning, screw_matrix(np.array(z), H)[:3, :3])  # of the end, in the axes of the start
    twists = axes @ np.array([spins[:, 2, 1], spins[:, 0, 2], spins[:, 1, 0]])
    assert np.allclose(floats(motion.twists), twists, rtol=0.0, atol=3e-9)
    assert np.all(floats(motion.twists)[:, 3] == 0.0)


def traced_curvature(z: tuple[float, ...], loads: list[Load]) -> np.ndarray:
    """Of loads with levers in the axes of the end; the coordinates as elements of the workspace: a constant zero is locked."""
    block = Block("compute", "Compute.")
    screw = Screw(block.loads(0, 4), H)
    ends = [Load(load.force, screw.rotation @ load.lever, load.share) for load in loads]
    motion, _ = screw.motion(ends, no_bodies(), constants(np.eye(3)))
    return np.reshape(values(block, motion.curvature.ravel(), z), (4, 4))


@pytest.mark.parametrize("z", POINTS)
def test_curvature_is_the_second_derivative_of_the_work(z: tuple[float, ...], rng: np.random.Generator) -> None:
    """Written in closed form; against the slopes of the slopes of the traced work, which know nothing of it."""
    loads = loads_of(rng)
    block = Block("compute", "Compute.")
    at = block.loads(0, 4)
    screw = Screw(at, H)
    work = sum(load.force @ (screw.position * load.share + screw.rotation @ load.lever) for load in loads)
    second = [one for slope in gradient(work, at) for one in gradient(slope, at)]
    expected = np.reshape(values(block, second, z), (4, 4))
    # Some hundred roundings of numbers of the size of forces times levers.
    assert np.abs(traced_curvature(z, loads) - expected).max() < 1e-14


@pytest.mark.parametrize("z", [POINTS[0], POINTS[5]])
def test_curvature_at_straight_and_bent_against_60_digits(z: tuple[float, ...]) -> None:
    """Central differences of step 1e-15 of mpmath's exponential: truncation 1e-30."""
    force, arm, share = (0.3, -1.1, 0.8), (0.2, 0.5, -0.4), 1.0
    with mp.workdps(60):
        step = mp.mpf(10) ** -15

        def work(moved: tuple[int, ...]) -> Any:
            end = exact_screw(*(mp.mpf(one) + count * step for one, count in zip(z, moved, strict=True)))
            return sum(force[i] * (share * end[i, 3] + sum(end[i, j] * arm[j] for j in range(3))) for i in range(3))

        exact = np.zeros((4, 4))
        for i, j in itertools.combinations_with_replacement(range(4), 2):
            corners = {}
            for one, other in itertools.product((1, -1), repeat=2):
                moved = [0, 0, 0, 0]
                moved[i] += one
                moved[j] += other
                corners[one, other] = work(tuple(moved))
            found = corners[1, 1] - corners[1, -1] - corners[-1, 1] + corners[-1, -1]
            exact[i, j] = exact[j, i] = float(found / (4 * step**2))
    found = traced_curvature(z, [Load(constants(force), constants(arm), share)])
    assert np.abs(found - exact).max() < 5e-15


def test_bending_alone_is_the_general_motion_without_twist(rng: np.random.Generator) -> None:
    """A twist that is known to be zero leaves terms out; one of 1e-300 computes them all."""
    loads, bodies = loads_of(rng), [(rng.uniform(0.1, 1.0), constants(rng.normal(size=3))) for _ in range(6)]
    rows = [0, 1, 3]
    block = Block("compute", "Compute.")
    outputs, counts = [], []
    for twist in (0.0, block.load(2)):
        screw = Screw([block.load(0), block.load(1), twist, block.load(3)], H)
        motion, levers = screw.motion(loads, bodies, constants(np.eye(3)))
        parts = [motion.twists[:, rows], motion.bends[:, rows], motion.moves[:, rows], motion.curvature[np.ix_(rows, rows)]]
        outputs.append([*(one for part in parts for one in part.ravel()), *levers[0], *levers[1]])
        outputs[-1] += [motion.torque[row] for row in rows] + [motion.weight[row] for row in rows]
        weightless, _ = screw.motion(loads[:1], no_bodies(), constants(np.eye(3)))
        count = Block("compute", "Compute.", (), block.trace)
        count.store_all(4, weightless.curvature[np.ix_(rows, rows)].ravel().tolist())
        counts.append(operations(count))
    assert counts[0] < 0.9 * counts[1]
    for x, y, stretch in [(0.0, 0.0, 0.0), (1e-9, 2e-9, 0.01), *rng.uniform((-2, -2, -0.04), (2, 2, 0.1), (5, 3)).tolist()]:
        found = values(block, outputs[0] + outputs[1], [x, y, 1e-300, stretch])
        locked, general = np.array(found[: len(outputs[0])]), np.array(found[len(outputs[0]) :])
        # Stumpff functions from a shorter series: some roundings, magnified by a chord that turns across.
        assert np.abs(locked - general).max() < 1e-13 * np.abs(general).max()


# --- Weight


def traced_weight(length: float, bodies: list[tuple[float, Any]], gravity: np.ndarray) -> tuple[Block, OwnWeight]:
    block = Block("compute", "Compute.")
    z = block.loads(0, 4)
    return block, weight_moment(z, Screw(z, length), bodies, constants(gravity))


def test_weight_of_bodies_behind_every_joint(rng: np.random.Generator) -> None:
    """The moment against SciPy's frames of the six joints, its slopes against differences of that."""
    bodies, gravity = [(rng.uniform(0.1, 1.0), rng.normal(size=3)) for _ in range(6)], rng.normal(size=3)

    def moment(at: np.ndarray) -> np.ndarray:
        frames = section_frames(at, H)
        return sum(mass * frame[:3, 3] + frame[:3, :3] @ first for frame, (mass, first) in zip(frames, bodies, strict=True))  # type: ignore[return-value]

    block, own = traced_weight(H, [(mass, constants(first)) for mass, first in bodies], gravity)
    block.store_all(4, [*own.moment, *own.slopes.ravel(), *own.curvature.ravel()])
    compute = functions(block.text())["compute"]

    def found_at(at: np.ndarray) -> np.ndarray:
        w = [*at.tolist(), *[0.0] * 31]
        compute(w)
        return np.array(w[4:])

    for z in [np.array(one) for one in POINTS] + list(rng.uniform((-1.5, -1.5, -1.5, -0.04), (1.5, 1.5, 1.5, 0.1), (20, 4))):
        found = found_at(z)
        assert np.allclose(found[:3], moment(z), rtol=0.0, atol=2e-14)
        # Differences of step 1e-6 of numbers up to ten, whose third derivatives grow as the chord turns across.
        assert np.allclose(found[3:15].reshape(3, 4), central_difference(moment, z), rtol=1e-8, atol=1e-7)
        torque = central_difference(lambda at: gravity @ found_at(at)[3:15].reshape(3, 4), z)
        assert np.allclose(found[15:].reshape(4, 4), torque, rtol=1e-7, atol=1e-6)


def test_locked_strains_have_no_slopes(rng: np.random.Generator) -> None:
    block = Block("compute", "Compute.")
    z = [block.load(0), 0.2, block.load(2), 0.01]
    bodies = [(0.3, constants(rng.normal(size=3))) for _ in range(6)]
    own = weight_moment(z, Screw(z, H), bodies, constants(rng.normal(size=3)))
    general, whole = traced_weight(H, bodies, np.zeros(3))
    assert np.all(own.slopes[:, [1, 3]] == 0.0)
    assert np.all(own.curvature[[1, 3]] == 0.0)
    assert np.all(own.curvature[:, [1, 3]] == 0.0)
    at = [0.5, 0.2, -0.3, 0.01]
    moving = values(block, own.slopes[:, [0, 2]].ravel(), at)
    assert np.allclose(moving, values(general, whole.slopes[:, [0, 2]].ravel(), at), rtol=0.0, atol=1e-14)


@pytest.fixture(scope="module")
def single() -> SoftModel:
    """One section that carries a disc, moved by the tensions of three muscles."""
    robot = sr.PccArm(segment_lengths=(0.4,), bending_stiffness=(1.9,), elastic_sections=1)
    return sr.load_model(robot, muscles="forces")


@pytest.mark.parametrize("z", POINTS[:6])
def test_weight_of_a_section_is_that_of_pinocchio(single: SoftModel, z: tuple[float, ...], rng: np.random.Generator) -> None:
    """Potential energy, and its derivatives by central differences of Pinocchio's energy."""
    gravity = rng.normal(size=3) * 9.81
    (section,) = single.chain().elements
    assert isinstance(section, ChainSection)
    assert sum(body.mass for body in section.bodies) > 0.01
    whole, data = single.workspace(tuple(gravity.tolist()))
    motors = np.zeros(single.n_motors)

    def energy(at: np.ndarray) -> float:
        return float(pin.computePotentialEnergy(whole, data, single.configuration(motors, at)))

    local = section.rotation.T @ gravity
    bodies = [(body.mass, constants(body.first_moment)) for body in section.bodies]
    block, own = traced_weight(section.length, bodies, local)
    work = constants(local) @ own.moment
    at_rest = values(block, [work], [0.0] * 4)[0]
    found = np.array(values(block, [work, *(constants(local) @ own.slopes), *own.curvature.ravel()], z))
    size = float(np.linalg.norm(gravity)) * sum(body.mass for body in section.bodies) * section.length
    here = np.array(z)
    assert abs(found[0] - at_rest + energy(here) - energy(np.zeros(4))) < 1e-14 * max(size, 1.0)
    slope = central_difference(lambda at: np.array([-energy(at)]), here)[0]
    assert np.allclose(found[1:5], slope, rtol=0.0, atol=1e-8 * max(size, 1.0))
    second = central_difference(
        lambda one: central_difference(lambda at: np.array([-energy(at)]), one, step=1e-4)[0], here, step=1e-4
    )
    # Step 1e-4: rounding 1e-16 / 1e-8, truncation 1e-8 times fourth derivatives of forces times lengths.
    assert np.allclose(found[5:].reshape(4, 4), second, rtol=0.0, atol=3e-7 * max(size, 1.0))


def test_the_oracles_of_a_section_agree(rng: np.random.Generator) -> None:
    """The last of SciPy's frames is SciPy's exponential, and a vector of expressions is no vector of floats."""
    z = np.array([0.4, -0.3, 0.2, 0.01])
    assert np.abs(section_frames(z, H)[-1] - screw_matrix(z, H)).max() < 1e-15
    made = vector([Block("compute", "Compute.").load(0), 1.0])
    assert made.dtype == object
    assert isinstance(made[0], Expression)
    assert isinstance(made[1], float)
