"""Newton steps in a time proportional to the length of a chain: against dense matrices, and against Pinocchio's."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled.chain.elements import constants
from softrobots.compiled.chain.elimination import Eliminated, Outboard, eliminate, eliminate_multipliers
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.small_systems import inverse_small, smallest_square, solve_small
from softrobots.compiled.chain.tip_motion import step_with_motors, tip_motion
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import Evaluation, evaluate, solve_again
from softrobots.compiled.program.generated_module import make_program
from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.backends import Run
from softrobots.compiled.settings import SMALL_PIVOT_SHIFT as FLOOR
from softrobots.compiled.trace.blocks import Block
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load
from tests.support.routed_arms import actuator, routed
from tests.support.serial_chains import ROBOTS, drawn
from tests.support.traced import functions, values


def floats(array: Any) -> np.ndarray:
    return np.asarray(array, dtype=np.float64)


# --- Elimination of random matrices whose blocks off the diagonal have rank three


@dataclass
class Part:
    """An element: turn per coordinate (3, k), bends (3, k), stiffness (k, k), right-hand sides (sides, k), scales (k)."""

    twists: np.ndarray
    bends: np.ndarray
    stiffness: np.ndarray
    sides: np.ndarray
    scales: np.ndarray


def parts_of(rng: np.random.Generator, sizes: Sequence[int], stiff: float, sides: int = 1) -> list[Part]:
    made = []
    for k in sizes:
        half = rng.normal(size=(k, k))
        scales = rng.uniform(0.5, 2.0, k)
        stiffness = half + half.T + np.diag(stiff * scales)
        made.append(Part(rng.normal(size=(3, k)), rng.normal(size=(3, k)), stiffness, rng.normal(size=(sides, k)), scales))
    return made


def dense(parts: Sequence[Part]) -> np.ndarray:
    """The matrix: a coordinate couples with every one nearer to the base by `- twist . bend`."""
    starts = np.cumsum([0, *(len(part.scales) for part in parts)])
    made = np.zeros((starts[-1], starts[-1]))
    for j, beyond in enumerate(parts):
        columns = slice(starts[j], starts[j + 1])
        made[columns, columns] = beyond.stiffness
        for i in range(j):
            rows = slice(starts[i], starts[i + 1])
            made[rows, columns] = -parts[i].twists.T @ beyond.bends
            made[columns, rows] = made[rows, columns].T
    return made


def go_back(parts: Sequence[Part], pivot_shift: float = 0.0) -> tuple[list[Eliminated], Outboard]:
    """Eliminate from the tip to the base."""
    beyond, made = Outboard.tip(len(parts[0].sides)), []
    for part in reversed(parts):
        one, beyond = eliminate(
            beyond,
            constants(part.twists),
            constants(part.bends),
            constants(part.stiffness),
            part.sides.tolist(),
            part.scales.tolist(),
            pivot_shift=pivot_shift,
        )
        made.append(one)
    return made[::-1], beyond


def steps_of(parts: Sequence[Part], eliminated: Sequence[Eliminated], side: int) -> np.ndarray:
    """Go out again with the turn of all nearer to the base."""
    turn, made = constants(np.zeros(3)), []
    for part, one in zip(parts, eliminated, strict=True):
        made.append(one.steps(side, turn))
        turn = turn + constants(part.twists) @ made[-1]
    return floats(np.concatenate(made))


def pivots_from_the_tip(matrix: np.ndarray, sizes: Sequence[int]) -> np.ndarray:
    """Of `L D L^T` in the order of elimination: elements from the tip, coordinates of each in order."""
    ends = np.cumsum(sizes)
    order = [row for end, size in list(zip(ends, sizes, strict=True))[::-1] for row in range(end - size, end)]
    work, made = matrix[np.ix_(order, order)].copy(), np.zeros(len(order))
    for row in range(len(order)):
        made[order[row]] = work[row, row]
        work[row + 1 :, row + 1 :] -= np.outer(work[row + 1 :, row], work[row, row + 1 :]) / work[row, row]
    return made


sizes_ = st.lists(st.integers(1, 4), min_size=1, max_size=7)
seeds_ = st.integers(0, 2**32 - 1)


@given(sizes_, seeds_, st.sampled_from((0.0, 3.0, 20.0)))
@settings(max_examples=80)
def test_elimination_solves_the_dense_system(sizes: list[int], seed: int, stiff: float) -> None:
    """Steps of three right-hand sides, the smallest pivot, and signs of pivots as of eigenvalues (Sylvester)."""
    parts = parts_of(np.random.default_rng(seed), sizes, stiff, sides=3)
    matrix = dense(parts)
    eliminated, beyond = go_back(parts)
    pivots, scales = pivots_from_the_tip(matrix, sizes), np.concatenate([part.scales for part in parts])
    # No pivot is exchanged: rounding grows as the pivots shrink, those of an indefinite matrix without limit.
    growth = np.abs(matrix).max() ** 2 / np.abs(pivots).min() ** 2
    for side in range(3):
        right = np.concatenate([part.sides[side] for part in parts])
        found = steps_of(parts, eliminated, side)
        residual = matrix @ found + right
        assert np.abs(residual).max() < 1e-14 * (1.0 + growth) * (1.0 + np.abs(matrix).max() * np.abs(found).max())
    min_pivot = min(1.0, float(np.abs(pivots / scales).min()))
    assert float(beyond.min_pivot) == pytest.approx(min_pivot, rel=1e-12 * (1.0 + growth))
    values_ = np.linalg.eigvalsh(matrix)
    if np.abs(values_).min() > 1e-9:
        assert beyond.n_negative_pivots == np.sum(values_ < 0.0)


@given(sizes_, seeds_, st.sampled_from((0.0, 3.0, 20.0)))
@settings(max_examples=60)
def test_guarded_steps_go_downhill(sizes: list[int], seed: int, stiff: float) -> None:
    """The matrix that they invert is positive definite; where all pivots are large enough anyway, it is the same matrix."""
    parts = parts_of(np.random.default_rng(seed), sizes, stiff)
    gradient = np.concatenate([part.sides[0] for part in parts])
    eliminated, beyond = go_back(parts, pivot_shift=FLOOR)
    plain, same = go_back(parts)
    for one, part in zip(eliminated, parts, strict=True):
        assert np.all(floats(one.inverse_pivots) > 0.0)
        assert np.all(floats(one.inverse_pivots) * part.scales * FLOOR <= 1.0 + 1e-12)
    found = steps_of(parts, eliminated, 0)
    assert np.all(np.isfinite(found))
    assert gradient @ found < 0.0
    if same.n_negative_pivots == 0.0 and float(same.min_pivot) > FLOOR:
        assert found.tolist() == steps_of(parts, plain, 0).tolist()
        assert beyond.min_pivot == same.min_pivot
    else:
        assert beyond.n_negative_pivots > 0.0 or float(beyond.min_pivot) <= FLOOR  # the state of the matrix is told as it is


def test_a_zero_pivot_is_guarded() -> None:
    part = Part(np.zeros((3, 1)), np.zeros((3, 1)), np.zeros((1, 1)), np.ones((1, 1)), np.full(1, 5.0))
    (one,), beyond = go_back([part], pivot_shift=FLOOR)
    assert one.inverse_pivots == [1.0 / (5.0 * FLOOR)]
    assert (beyond.min_pivot, beyond.n_negative_pivots) == (0.0, 0.0)


def with_multipliers(beyond: Outboard, count: int) -> Outboard:
    """What is handed on, with components that nothing is coupled with yet."""
    n = len(beyond.matrix)
    matrix = constants(np.zeros((n + count, n + count)))
    matrix[:n, :n] = beyond.matrix
    columns = [np.concatenate([one, constants(np.zeros(count))]) for one in beyond.columns]
    return replace(beyond, matrix=matrix, columns=columns)


@given(st.lists(st.integers(2, 4), min_size=2, max_size=4), seeds_, st.sampled_from((0.0, 1.0)))
@settings(max_examples=60)
def test_held_sums_are_those_of_the_dense_system_with_multipliers(sizes: list[int], seed: int, pivot_shift: float) -> None:
    """Sums of the first two coordinates of all elements of a segment are held; one element stands before and behind it.

    A sum that is not where it should be is put there by the first step.
    """
    rng = np.random.default_rng(seed)
    parts = parts_of(rng, [2, *sizes, 3], 12.0)
    inside = range(1, len(sizes) + 1)
    matrix, gradient = dense(parts), np.concatenate([part.sides[0] for part in parts])
    starts = np.cumsum([0, *(len(part.scales) for part in parts)])
    holds = np.zeros((2, len(gradient)))
    for row in inside:
        holds[[0, 1], [starts[row], starts[row] + 1]] = 1.0
    softness, gaps = [0.7, 1.3], rng.normal(size=2) * (pivot_shift == 0.0)
    beyond, made, released = Outboard.tip(1), {}, None
    for row in reversed(range(len(parts))):
        part = parts[row]
        if row == inside[-1]:
            beyond = with_multipliers(beyond, 2)
        held = np.zeros((len(beyond.matrix) - 3, len(part.scales)))
        if row in inside:
            held[[0, 1], [0, 1]] = -1.0
        made[row], beyond = eliminate(
            beyond,
            constants(np.concatenate([part.twists, 0.0 * held])),
            constants(np.concatenate([part.bends, held])),
            constants(part.stiffness),
            part.sides.tolist(),
            part.scales.tolist(),
            pivot_shift=pivot_shift,
        )
        if row == inside[0]:
            released, beyond = eliminate_multipliers(beyond, gaps, softness)
    assert released is not None
    turn, steps, multipliers = constants(np.zeros(3)), [], np.zeros(2)
    for row, part in enumerate(parts):
        if row == inside[0]:
            multipliers = floats(released.steps(0, turn))
            turn = np.concatenate([turn, constants(multipliers)])
        steps.append(made[row].steps(0, turn))
        turn = turn + constants(np.concatenate([part.twists, np.zeros((len(turn) - 3, len(part.scales)))])) @ steps[-1]
        if row == inside[-1]:
            turn = turn[:3]
    step = floats(np.concatenate(steps))
    size = 1.0 + np.abs(step).max()
    assert np.abs(holds @ step + gaps).max() < 1e-9 * size
    whole = np.block([[matrix, holds.T], [holds, np.zeros((2, 2))]])
    if pivot_shift == 0.0:
        residual = whole @ np.concatenate([step, multipliers]) + np.concatenate([gradient, gaps])
        smallest = float(beyond.min_pivot)
        # As above: no pivot is exchanged.
        assert np.abs(residual).max() < 1e-11 * size * (1.0 + 1.0 / smallest**2)
        signs = np.linalg.eigvalsh(whole)
        if np.abs(signs).min() > 1e-9:
            assert beyond.n_negative_pivots == np.sum(signs < 0.0)
    else:
        assert gradient @ step < 0.0
        assert np.all(floats(released.inverse_pivots) < 0.0)  # never guarded


@given(sizes_, seeds_)
@settings(max_examples=30)
def test_another_right_hand_side_uses_the_same_factors(sizes: list[int], seed: int) -> None:
    parts = parts_of(np.random.default_rng(seed), sizes, 20.0, sides=2)
    for part, one in zip(parts[-1:], go_back(parts)[0][-1:], strict=True):  # at the tip nothing is beyond
        assert np.allclose(floats(one.reduced(part.sides[1].tolist())), floats(one.columns[1]), rtol=1e-13, atol=1e-13)


# --- Every robot


@functools.cache
def robot(kind: str) -> SoftModel:
    return ROBOTS[kind]()


def program_at(
    model: SoftModel, motors: np.ndarray, force: np.ndarray, gravity: np.ndarray | None, locked: tuple[str, ...] = ()
) -> tuple[Any, dict[str, Any], Actuation, list[float]]:
    """The generated code of a robot, and a workspace with motors and load."""
    unknowns = Unknowns(model.chain(), locked)
    program = make_program(unknowns, weight=gravity is not None)
    actuation = Actuation(model, unknowns)
    weight = {} if gravity is None else {"gravity": gravity}
    w = actuation.workspace(Run(program, None), motors, force=force, **weight).tolist()
    return program, functions(program.text), actuation, w


def evaluated(
    run: tuple[Any, dict[str, Any], Actuation, list[float]],
    unknown: np.ndarray,
    pivot_shift: float = 0.0,
    multipliers: Sequence[float] = (),
) -> Any:
    """Step, energy and the other numbers of a point, with the multipliers of the muscle lengths from which tensions follow."""
    program, code, _, before = run
    w, layout = list(before), program.layout
    w[layout.unknown : layout.unknown + layout.unknowns] = unknown.tolist()
    w[layout.single("pivot_shift")] = pivot_shift
    code["prepare"](w)
    w[layout.held : layout.held + len(multipliers)] = multipliers
    code["evaluate"](w)
    numbers = {
        name: w[layout.single(name)]
        for name in ("energy", "slope", "error", "length", "min_pivot", "n_negative_pivots", "range_margin")
    }
    return SimpleNamespace(
        step=np.array(w[layout.step : layout.step + layout.unknowns]), tip=np.array(w[layout.tip : layout.tip + 3]), **numbers
    )


def held_loads(model: SoftModel, loads: np.ndarray, start: np.ndarray) -> list[float]:
    """Multipliers of the sums beyond those of the start, from the tensions: `A^T t + k (start - rest)` of one strain a sum."""
    chain = model.chain()
    if chain.routed and model.muscle_input == "lengths":  # the tensions themselves
        return list(loads[chain.n_motors :])
    first = [group[0] for group in chain.constrained]
    by_tension = loads[chain.n_motors :] @ chain.muscle_paths.matrix[:, first] if first else np.zeros(0)
    return list(by_tension + chain.stiffness[first] * (start[first] - chain.rest[first]) if first else by_tension)


def compare_with_pinocchio(model: SoftModel, gravity: np.ndarray | None, rng: np.random.Generator, size: float = 3.0) -> None:
    """Newton step, energy, residual, tip and signs of pivots at random points."""
    motors, _ = drawn(model, rng)
    force = rng.normal(size=3) * size
    load = Load.of(model, force, gravity=gravity)
    run = program_at(model, motors, force, gravity)
    actuation = run[2]
    offsets = []
    for _ in range(3):
        springs = model.rest + 0.3 * (drawn(model, rng)[1] - model.rest)
        state = elastic_state(model, motors, springs, load)
        unknown = actuation.unknowns(motors, springs)
        multipliers = held_loads(model, state.load.motors, np.array(run[3][run[0].layout.start :]))
        found, held = evaluated(run, unknown, multipliers=multipliers), len(multipliers)
        step = np.linalg.solve(state.tangent, -state.residual)
        assert np.linalg.norm(model.chain().elastic @ found.step - step) < 1e-10 * np.linalg.norm(step)
        # The residual as numbers of forces on all coordinates, rounding of springs' torques.
        assert found.slope == pytest.approx(float(state.residual @ step), rel=1e-9)
        if not held:
            assert found.error == pytest.approx(float(state.residual @ state.residual), rel=1e-9)
            assert found.length == pytest.approx(float(step @ step), rel=1e-9)
        assert found.n_negative_pivots == held + np.sum(np.linalg.eigvalsh(state.tangent) < 0.0)
        assert found.range_margin > 0.0
        assert np.abs(found.tip - frame_placement(model, state.q, model.tip).translation).max() < 1e-13
        offsets.append((found.energy - state.energy, abs(state.energy) + 1.0))
        shifted = evaluated(run, unknown, FLOOR, multipliers)
        assert shifted.slope < 0.0
        # With multipliers, stable springs may have negative pivots.
        if shifted.n_negative_pivots == held and shifted.min_pivot > FLOOR:
            assert shifted.step.tolist() == found.step.tolist()
    # Energies differ by a constant, that of what does not move.
    assert all(abs(offset - offsets[0][0]) < 1e-12 * scale for offset, scale in offsets)


GRAVITY = np.array([0.5, -1.0, -9.6])


MORE = ("helix_lumped", "helix", "odd", "pcc_forces", "stacked", "tendons")
QUICK = (("uneven", False), ("arm", True), ("coils", True))


@pytest.mark.parametrize(
    ("kind", "weight"), [*QUICK, *(pytest.param(kind, kind != "helix_lumped", marks=pytest.mark.study) for kind in MORE)]
)
def test_the_step_is_that_of_the_dense_tangent(kind: str, weight: bool, rng: np.random.Generator) -> None:
    compare_with_pinocchio(robot(kind), GRAVITY if weight else None, rng)


def test_steps_to_given_lengths_go_down(rng: np.random.Generator) -> None:
    """Near an equilibrium, off the given lengths: the step leads back, and its slope is twice the energy that it saves."""
    model = robot("coils")
    motors = model.relaxed_motors * (1.0 + rng.uniform(-0.03, 0.03, model.n_motors))
    force = 0.3 * rng.normal(size=3)
    settled = sr.solve_equilibrium(model, motors, force)
    run = program_at(model, motors, force, None)
    unknown, tensions = run[2].unknowns(motors, settled.q_springs), settled.motor_torques.tolist()
    here = evaluated(run, unknown, multipliers=tensions)
    for _ in range(3):
        off = 1e-5 * rng.normal(size=len(unknown))
        there = evaluated(run, unknown + off, multipliers=tensions)
        assert np.linalg.norm(there.step + off) < 1e-3 * np.linalg.norm(off)
        assert there.energy - here.energy == pytest.approx(-0.5 * there.slope, rel=1e-2)


def test_a_route_that_folds_is_out_of_range() -> None:
    """On the inner side of a bend by `b` at a quarter of a metre: 0.5 m - 0.25 m b is left of half a metre."""
    wide = actuator("wide", (1, (0.0, 0.5), (0.25, 0.25), (0.0, 0.0)), kind="elastic", stiffness=100.0, pretension=1.0)
    model = routed(wide, segment_lengths=(0.5,), elastic_sections=1)
    run = program_at(model, model.relaxed_motors, np.zeros(3), None)
    margins = [evaluated(run, np.array([0.0, bend, 0.0, 0.0])).range_margin for bend in (1.9, 1.99, 2.01)]
    assert margins == pytest.approx([0.5 * (1.0 - 1e-3) - 0.25 * bend for bend in (1.9, 1.99, 2.01)], abs=1e-12)


@pytest.mark.parametrize("gravity", [None, GRAVITY], ids=["weightless", "gravity"])
def test_the_step_of_an_arm_of_three_links_that_differ(
    odd_arm: SoftModel, gravity: np.ndarray | None, rng: np.random.Generator
) -> None:
    compare_with_pinocchio(odd_arm, gravity, rng, size=100.0)


@pytest.mark.study
@pytest.mark.parametrize("kind", ["arm", "odd", "odd_arm"])
def test_loops_compute_what_the_straight_line_does(
    kind: str, odd_arm: SoftModel, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    """The code of a long chain, made for a short one."""
    model = odd_arm if kind == "odd_arm" else robot(kind)
    motors, springs = drawn(model, rng)
    force = rng.normal(size=3) * 50.0
    for gravity in (None, GRAVITY):
        runs = [program_at(model, motors, force, gravity)]
        with monkeypatch.context() as patch:
            patch.setattr("softrobots.compiled.chain.unknowns.MAX_UNROLLED_JOINTS", 0)
            runs.append(program_at(model, motors, force, gravity))
        assert ["outward_all" in code for _, code, _, _ in runs] == [False, True]
        for pivot_shift in (0.0, 1.0):
            line, loops = (vars(evaluated(run, springs, pivot_shift)) for run in runs)
            for name, value in line.items():
                # The same formulas; rounding of other sums.
                assert np.allclose(loops[name], value, rtol=1e-10, atol=1e-13), name
        for job in ("settle", "settle_from"):
            statuses, answers = [], []
            for program, code, _, before in runs:
                w = list(before)
                statuses.append(code[job](w))
                answers.append(w[program.layout.unknown : program.layout.unknown + program.layout.unknowns])
            assert statuses == [0, 0]
            assert np.allclose(answers[0], answers[1], rtol=0.0, atol=1e-11)


@pytest.mark.study
@pytest.mark.parametrize(
    ("kind", "locked"),
    [
        ("pcc_forces", ("twist", "stretch")),
        ("pcc_forces", ("bend_x",)),
        ("helix", ("twist",)),
        ("helix", ("twist", "stretch")),
    ],
)
def test_locked_strains_are_rows_that_are_left_out(kind: str, locked: tuple[str, ...], rng: np.random.Generator) -> None:
    model = robot(kind)
    motors, springs = drawn(model, rng)
    springs = model.rest + 0.3 * (springs - model.rest)
    kept = list(Unknowns(model.chain(), locked).strains)
    others = [row for row in range(model.n_springs) if row not in kept]
    assert len(others) == len(locked) * sum(hasattr(element, "length") for element in model.chain().elements)
    springs[others] = model.rest[others]
    force = rng.normal(size=3)
    for gravity in (None, GRAVITY):
        run = program_at(model, motors, force, gravity, locked)
        found = evaluated(run, springs[kept])
        state = elastic_state(model, motors, springs, Load.of(model, force, gravity=gravity))
        step = np.linalg.solve(state.tangent[np.ix_(kept, kept)], -state.residual[kept])
        assert np.linalg.norm(found.step - step) < 1e-10 * np.linalg.norm(step)


# --- Systems of up to three


shapes_ = st.tuples(st.integers(1, 6), st.integers(1, 6)).filter(lambda shape: min(shape) <= 3)


def matrix_of(shape: tuple[int, int], seed: int, spread: float) -> np.ndarray:
    """A matrix with given singular values: 1 down to `10^-spread`."""
    rng = np.random.default_rng(seed)
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for n in shape)
    n = min(shape)
    return np.asarray(left[:, :n] * 10.0 ** (-spread * np.linspace(0.0, 1.0, n) if n > 1 else 0.0) @ right[:n])


@given(shapes_, seeds_, st.floats(0.0, 3.0))
@settings(max_examples=80)
def test_small_systems_are_solved_as_by_numpy(shape: tuple[int, int], seed: int, spread: float) -> None:
    """Exactly, by least squares, or with the smallest solution; normal equations square the condition number."""
    made = matrix_of(shape, seed, spread)
    right = np.random.default_rng(seed).normal(size=shape[0])
    found = floats(solve_small(constants(made), constants(right)))
    expected = np.linalg.lstsq(made, right, rcond=None)[0]
    condition = 10.0 ** (spread if shape[0] == shape[1] else 2.0 * spread)
    assert np.abs(found - expected).max() < 1e-14 * condition * (1.0 + np.abs(expected).max())
    assert np.allclose(found, np.linalg.pinv(made) @ right, rtol=0.0, atol=1e-13 * condition * 10.0**spread)


@given(st.integers(1, 3), seeds_, st.floats(0.0, 3.0))
@settings(max_examples=40)
def test_small_inverses(n: int, seed: int, spread: float) -> None:
    made = matrix_of((n, n), seed, spread)
    inverse = floats(inverse_small(constants(made)))
    assert np.abs(inverse @ made - np.eye(n)).max() < 1e-14 * 10.0 ** (2.0 * spread)


@given(shapes_, seeds_, st.floats(0.0, 4.0), st.floats(1e-3, 1e3))
@settings(max_examples=80)
def test_the_smallest_singular_value_is_bounded(shape: tuple[int, int], seed: int, spread: float, size: float) -> None:
    """Newton from zero stays below the root of a polynomial with real roots only.

    It goes at least one n-th of the way in each of its five steps: (2/3)^5 < 0.14 is missing at most.
    """
    made = matrix_of(shape, seed, spread) * size
    truth = float(np.linalg.svd(made, compute_uv=False)[-1]) ** 2
    found = float(smallest_square(constants(made)))
    rounding = 1e-14 * size**2 * (10.0 ** (2.0 * spread) if min(shape) == 3 else 1.0) ** 0.5
    assert 0.86 * truth - rounding <= found <= truth * (1.0 + 1e-9) + rounding


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (3, 3), (2, 3), (4, 3)])
def test_a_matrix_without_full_rank_has_no_smallest_singular_value(shape: tuple[int, int], rng: np.random.Generator) -> None:
    made = rng.normal(size=shape)
    made[:, -1] = 0.0 if shape[1] == 1 else made[:, 0]
    if shape[0] < shape[1]:
        made[-1] = made[0]
    assert abs(float(smallest_square(constants(made)))) < 1e-13
    assert float(smallest_square(constants(np.zeros(shape)))) == 0.0


# --- How the tip follows the motors


def traced_at(model: SoftModel, gravity: bool) -> tuple[Unknowns, Block, Evaluation]:
    unknowns = Unknowns(model.chain())
    block = Block("compute", "Compute.")
    return unknowns, block, evaluate(Plan(unknowns, gravity), block, tip_columns=3)


def workspace(model: SoftModel, motors: np.ndarray, springs: np.ndarray, force: np.ndarray, gravity: Any) -> list[float]:
    layout = Layout(model.n_motors, model.n_springs)
    w = np.zeros(layout.prepared)
    w[: model.n_motors] = motors
    w[layout.force : layout.force + 3] = force
    w[layout.gravity : layout.gravity + 3] = 0.0 if gravity is None else gravity
    w[layout.unknown : layout.unknown + model.n_springs] = springs
    return w.tolist()


@pytest.fixture(params=["arm", "odd_arm", "odd", "between"])
def moved_by_motors(request: pytest.FixtureRequest, arm: SoftModel, odd_arm: SoftModel) -> SoftModel:
    """Robots with motors before, between and behind the springs."""
    if request.param == "between":
        table = {"spring_1_side": (90.0, 0.1), "spring_2_up": (60.0, 0.0)}
        names = [name for name in [*arm.motor_joints, *arm.spring_joints] if name not in table]
        return sr.load_model(arm.urdf, springs=dict.fromkeys(arm.spring_joints) | table, motors=tuple(names))
    return {"arm": arm, "odd_arm": odd_arm, "odd": robot("odd")}[request.param]


@pytest.mark.parametrize("gravity", [None, GRAVITY], ids=["weightless", "gravity"])
def test_the_tip_follows_the_motors(moved_by_motors: SoftModel, gravity: Any, rng: np.random.Generator) -> None:
    """Anywhere, the changes that a Newton step makes; in equilibrium, the Jacobian and the torques of the Pinocchio path."""
    model = moved_by_motors
    unknowns, block, point = traced_at(model, gravity is not None)
    motion = tip_motion(unknowns, point)
    axes = point.base_axes
    change = rng.normal(size=model.n_motors)
    outputs = [*(axes @ motion.jacobian).ravel(), *motion.motor_torques, *motion.torque_change, *(axes @ motion.tip_change)]
    outputs += step_with_motors(unknowns, point, constants(change))
    ends = np.cumsum([3 * model.n_motors, model.n_motors, model.n_motors, 3])
    motors, springs = drawn(model, rng)
    force = rng.normal(size=3) * 10.0
    load = Load.of(model, force, gravity=gravity)

    state = elastic_state(model, motors, springs, load)
    found = np.array(values(block, outputs, workspace(model, motors, springs, force, gravity)))
    _, torques, torque_change, tip_change, moved = np.split(found, ends)
    step = np.linalg.solve(state.tangent, -state.residual)
    _, columns = state.point.columns(frame_jacobian(model, state.q, model.tip)[:3])
    assert np.allclose(torques, state.load.motors, rtol=1e-10, atol=1e-11)
    assert np.allclose(torque_change, state.load.coupling.T @ step, rtol=1e-10, atol=1e-10)
    assert np.allclose(tip_change, columns @ step, rtol=1e-10, atol=1e-11)
    again = np.linalg.solve(state.tangent, -state.residual + state.load.coupling @ change)
    assert np.allclose(moved, again, rtol=1e-10, atol=1e-10)

    settled = sr.solve_equilibrium(model, motors, force, gravity=gravity, tolerance=1e-13)
    found = np.array(values(block, outputs, workspace(model, motors, settled.q_springs, force, gravity)))
    jacobian_, torques, torque_change, tip_change, _ = np.split(found, ends)
    assert np.allclose(jacobian_.reshape(3, -1), sr.elastostatic_jacobian(model, settled), rtol=1e-9, atol=1e-10)
    assert np.allclose(torques, settled.motor_torques, rtol=1e-10, atol=1e-11)
    assert np.abs(tip_change).max() < 1e-11


def test_another_right_hand_side_of_a_chain(odd_arm: SoftModel, rng: np.random.Generator) -> None:
    unknowns, block, point = traced_at(odd_arm, gravity=False)
    motors, springs = drawn(odd_arm, rng)
    force, right = rng.normal(size=3) * 20.0, rng.normal(size=odd_arm.n_springs)
    sides = [
        [float(right[unknowns.place[strain]]) for strain in unknowns.moving(row)] for row in range(len(point.inward_passes))
    ]
    found = values(block, solve_again(unknowns, point, sides), workspace(odd_arm, motors, springs, force, None))
    tangent = elastic_state(odd_arm, motors, springs, Load.of(odd_arm, force)).tangent
    assert np.allclose(found, -np.linalg.solve(tangent, right), rtol=1e-10, atol=1e-12)
