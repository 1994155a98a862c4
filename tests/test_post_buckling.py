"""Branches beyond buckling: closed forms of one hinge and of two in a point, rings, paths that turn back, and labels."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import softrobots as sr
from softrobots.statics.buckling import force_path, post_buckling
from softrobots.statics.buckling.critical_load import CriticalPoint, critical_point
from softrobots.statics.buckling.equilibrium_branch import FUNDAMENTAL, RING
from softrobots.statics.buckling.force_path import ForcePath
from softrobots.view.figures import equilibria
from tests.support.laws import law
from tests.support.oracles import arm_balance
from tests.support.tables import each_row

PUSH = (-1, 0, 0)
LEVER, OFFSET = 0.57, 0.03  # from the hinge to the tip, and to the motor [m]
FOLDED = (2.41, -0.95, -1.57), np.array([-0.40, -0.88, 1.47])  # motors, and a push under which it snaps
ONE_LINK = sr.InflatableArm(link_lengths=(0.6,))


@cache
def link(side: float | None, up: float | None) -> sr.SoftModel:
    """One link with a spring, or two, at one point [N m/rad]; a joint without one is locked."""
    given = {"spring_1_side": side, "spring_1_up": up}
    return sr.load_model(ONE_LINK.urdf(), springs=given, motors=("motor_1", "motor_2"))


def by_label(branches: tuple[sr.EquilibriumBranch, ...]) -> dict[str, sr.EquilibriumBranch]:
    made = {branch.label: branch for branch in branches}
    assert len(made) == len(branches)
    assert branches[0].label == FUNDAMENTAL
    return made


def springs_of(branch: sr.EquilibriumBranch) -> np.ndarray:
    return np.array([one.q_springs for one in branch.equilibria])


@pytest.mark.study
@law("post_buckling_branches", "EquilibriumBranch")
@given(st.floats(0.0, 3.0), st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(1.05, 4.0))
@settings(max_examples=10)
def test_one_hinge_bows_to_either_side_as_its_closed_form_says(power: float, turn: float, lift: float, beyond: float) -> None:
    """k theta = F L sin theta: a pitchfork at F = k / L, wherever the link points and however stiff it is."""
    stiffness = 10.0**power
    model = sr.with_springs(link(None, 1.0), {"spring_1_up": stiffness})
    along = np.array([np.cos(turn) * np.cos(lift), np.sin(turn) * np.cos(lift), np.sin(lift)])
    critical = stiffness / LEVER
    found = by_label(sr.post_buckling_branches(model, (turn, lift), -along, max_force=beyond * critical, largest_step=0.2))
    assert sorted(found) == ["+spring_1_up", "-spring_1_up", FUNDAMENTAL]
    for label, branch in found.items():
        assert isinstance(branch, sr.EquilibriumBranch)
        angles, forces = springs_of(branch)[:, 0], branch.forces
        assert branch.ended == "largest force"
        assert forces[-1] == pytest.approx(beyond * critical, rel=1e-12)
        # Energy: 1/2 k theta^2 and the work against the push over l1 + L cos theta.
        energy = 0.5 * stiffness * angles**2 + forces * (OFFSET + LEVER * np.cos(angles))
        assert branch.energy == pytest.approx(energy, rel=1e-12)
        softest = 1.0 - forces * LEVER * np.cos(angles) / stiffness
        assert branch.softest == pytest.approx(softest, abs=1e-11)
        if label == FUNDAMENTAL:
            assert np.abs(angles).max() < 1e-9  # rounding of the direction over eigenvalues of 1e-5 beside the crossing
            assert branch.stable.tolist() == (forces < critical * (1.0 - 1e-8)).tolist()
        else:
            assert forces[0] == pytest.approx(critical, rel=1e-12)
            assert branch.neutral.tolist() == [True] + [False] * (len(forces) - 1)
            assert branch.stable[1:].all()
            assert np.all(np.sign(angles[1:]) == (1.0 if label[0] == "+" else -1.0))
            assert angles[1:] / np.sin(angles[1:]) == pytest.approx(forces[1:] * LEVER / stiffness, rel=1e-10)
            assert np.all(np.diff(branch.amplitude) > 0.0)
    assert springs_of(found["+spring_1_up"]) == pytest.approx(-springs_of(found["-spring_1_up"]), abs=1e-10)


def test_the_softer_of_two_hinges_buckles() -> None:
    found = by_label(sr.post_buckling_branches(link(150.0, 200.0), (0, 0), PUSH))
    assert sorted(found) == ["+spring_1_side", "-spring_1_side", FUNDAMENTAL]
    assert np.abs(springs_of(found["+spring_1_side"])[:, 1]).max() < 1e-12


def test_two_equal_hinges_have_eight_branches_four_of_them_stable() -> None:
    """Not a circle: E = k (a^2 + b^2)/2 + F L cos a cos b tells directions apart in fourth order.

    Along a hinge k a = F L sin a, stable; between them a = b with k a = F L sin a cos a, unstable: the eigenvalue k - F L.
    """
    stiffness = 172.71
    found = by_label(sr.post_buckling_branches(link(stiffness, stiffness), (0, 0), PUSH))
    axes = {f"{sign}spring_1_{name}" for sign in "+-" for name in ("side", "up")}
    between = {f"{one}spring_1_side {other}spring_1_up" for one in "+-" for other in "+-"}
    assert set(found) == {FUNDAMENTAL} | axes | between
    for label in axes:
        angles = springs_of(found[label])[1:]
        a, other = angles[:, int("up" in label)], angles[:, 1 - int("up" in label)]
        assert np.abs(other).max() < 1e-9
        assert a / np.sin(a) == pytest.approx(found[label].forces[1:] * LEVER / stiffness, rel=1e-9)
        assert found[label].stable[1:].all()
    for label in between:
        angles = springs_of(found[label])[1:]
        assert np.abs(angles[:, 0]) == pytest.approx(np.abs(angles[:, 1]), rel=1e-7)
        a = np.abs(angles[:, 0])
        assert a / (np.sin(a) * np.cos(a)) == pytest.approx(found[label].forces[1:] * LEVER / stiffness, rel=1e-7)
        assert not found[label].stable.any()
        assert found[label].softest[1:] == pytest.approx(1.0 - found[label].forces[1:] * LEVER / stiffness, rel=1e-6)
    # The stable ones lie lowest, those between them below the straight link.
    last = {label: branch.energy[-1] for label, branch in found.items()}
    assert max(last[label] for label in axes) < min(last[label] for label in between)
    assert max(last[label] for label in between) < last[FUNDAMENTAL]


@pytest.mark.study
def test_the_arm_of_two_links_on_every_branch_by_the_dh_table(arm: sr.SoftModel) -> None:
    """Balance and stability of every point by [Troise 2021]'s transforms; descent finds one of the branches."""
    stiffness = float(arm.stiffness[0])
    found = by_label(sr.post_buckling_branches(arm, (0, 0, 0), PUSH, max_force=150.0))
    assert len(found) == 9
    assert found[FUNDAMENTAL].forces[0] == 0.0
    for label, branch in found.items():
        forces = branch.forces[:, None] * np.array(PUSH)
        residual, tangent, tips = arm_balance(np.zeros((len(forces), 3)), springs_of(branch), forces, stiffness)
        assert np.linalg.norm(residual, axis=1).max() <= 1e-11 * 150.0 * 1.2
        least = np.linalg.eigvalsh(tangent)[:, 0] / stiffness
        assert branch.softest == pytest.approx(least, abs=1e-11)
        assert [one.tip_position for one in branch.equilibria] == pytest.approx(tips, abs=1e-12)
        if label != FUNDAMENTAL:
            assert branch.forces[0] == pytest.approx(sr.critical_load(arm, (0, 0, 0), PUSH), rel=1e-12)
            assert branch.stable[1:].all() == (" " not in label)
    descended = sr.solve_equilibrium(arm, (0, 0, 0), (-150, 0, 0)).q_springs
    stable = [springs_of(branch)[-1] for branch in found.values() if branch.stable[-1]]
    assert len(stable) == 4
    assert min(np.abs(one - descended).max() for one in stable) < 1e-9


def stable_minima(stiffness: np.ndarray, force: float, rng: np.random.Generator, starts: int) -> list[np.ndarray]:
    """Minima of the energy of the arm of two links under an axial push, by descent on the DH table from many starts."""
    springs = rng.uniform(-2.5, 2.5, (starts, 4))
    straight, pushes = np.zeros((starts, 3)), np.tile([-force, 0.0, 0.0], (starts, 1))
    for _ in range(120):
        residual, tangent, _ = arm_balance(straight, springs, pushes, stiffness)
        lift = np.maximum(0.0, 0.05 * stiffness.min() - np.linalg.eigvalsh(tangent)[:, 0])
        step = -np.linalg.solve(tangent + lift[:, None, None] * np.eye(4), residual[..., None])[..., 0]
        springs = springs + step * np.minimum(1.0, 0.2 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
    residual, tangent, _ = arm_balance(straight, springs, pushes, stiffness)
    settled = np.linalg.norm(residual, axis=1) < 1e-8 * stiffness.max()
    lowest = settled & (np.linalg.eigvalsh(tangent)[:, 0] > 1e-6 * stiffness.min())
    found: list[np.ndarray] = []
    for point in springs[lowest]:
        if all(np.abs(point - other).max() > 1e-5 for other in found):
            found.append(point)
    return found


def compare_with_minima(stiffness: np.ndarray, beyond: float, rng: np.random.Generator, starts: int) -> int:
    """The stable ends of the branches are the minima, no more and no fewer; their number."""
    names = ("spring_1_side", "spring_1_up", "spring_2_side", "spring_2_up")
    model = sr.load_model(sr.InflatableArm().urdf(), springs=dict(zip(names, stiffness.tolist(), strict=True)))
    force = beyond * sr.critical_load(model, (0, 0, 0), PUSH)
    found = by_label(sr.post_buckling_branches(model, (0, 0, 0), PUSH, max_force=force))
    assert {branch.ended for branch in found.values()} == {"largest force"}
    ends = [springs_of(branch)[-1] for branch in found.values() if branch.stable[-1]]
    minima = stable_minima(stiffness, force, rng, starts)
    for some, others in ((ends, minima), (minima, ends)):
        for one in some:
            assert min(np.abs(one - other).max() for other in others) < 1e-5
    return len(ends)


@pytest.mark.study
@pytest.mark.parametrize("difference", [1e-2, 3e-5, 1e-8])
def test_springs_that_are_nearly_equal_have_all_four_stable_branches(difference: float, rng: np.random.Generator) -> None:
    """Also where the second branches leave the path a little later, unstable, and become stable where they are crossed."""
    stiffness = 172.71 * np.array([1.0, 1.0 + difference, 1.0, 1.0 + difference])
    assert compare_with_minima(stiffness, 1.2, rng, 40) == 4


@pytest.mark.study
@pytest.mark.shortened(3, 50)
@pytest.mark.parametrize("seed", range(4))
def test_no_stable_branch_of_a_random_arm_is_missed(seed: int, cases: int) -> None:
    """200 arms; in every other one the springs of a link are nearly equal."""
    rng = np.random.default_rng(seed)
    for case in range(cases):
        stiffness = 172.71 * np.exp(rng.uniform(-0.7, 0.7, 4))
        if case % 2:
            stiffness[1::2] = stiffness[::2] * (1.0 + 10.0 ** rng.uniform(-9.0, -2.0, 2))
        compare_with_minima(stiffness, rng.uniform(1.02, 1.6), rng, 150)


def test_branches_that_leave_branches_are_named_after_them() -> None:
    """The branches of the stiffer direction become stable where saddles leave them; each is found once."""
    found = by_label(sr.post_buckling_branches(link(172.71, 172.9), (0, 0), PUSH))
    axes = {f"{sign}spring_1_{name}" for sign in "+-" for name in ("side", "up")}
    saddles = {f"{up}spring_1_up > {side}spring_1_side" for up in "+-" for side in "+-"}
    assert set(found) == {FUNDAMENTAL} | axes | saddles
    assert found[FUNDAMENTAL].crossings == pytest.approx([172.71 / LEVER, 172.9 / LEVER], rel=1e-6)
    for label in saddles:
        parent = found[label.partition(" > ")[0]]
        assert parent.crossings == pytest.approx(found[label].forces[:1], rel=1e-4)
        assert parent.stable[-1]
        assert not found[label].stable.any()


def test_a_later_crossing_of_too_many_modes_is_named_and_the_rest_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    modes_at = post_buckling._modes

    def refusing(path: ForcePath, count: int) -> np.ndarray:
        if path.force > 172.8 / LEVER:
            raise sr.NeutralEquilibrium("3 modes")
        return modes_at(path, count)

    monkeypatch.setattr(post_buckling, "_modes", refusing)
    found = by_label(sr.post_buckling_branches(link(172.71, 172.9), (0, 0), PUSH))
    assert set(found) == {FUNDAMENTAL, "+spring_1_side", "-spring_1_side"}
    assert found[FUNDAMENTAL].crossings == pytest.approx([172.71 / LEVER, 172.9 / LEVER], rel=1e-6)


@pytest.fixture(scope="module")
def rod() -> sr.SoftModel:
    """A passive rod of three sections along z."""
    return sr.load_model(sr.PccArm(segment_lengths=(0.5,), elastic_sections=3, muscle_azimuths=()))


@pytest.mark.study
def test_a_round_rod_buckles_into_a_ring_and_is_said_to_be_neutral(rod: sr.SoftModel) -> None:
    found = by_label(sr.post_buckling_branches(rod, (), (0, 0, -1)))
    assert set(found) == {FUNDAMENTAL, RING}
    ring = found[RING]
    assert ring.neutral.all()
    heavy = by_label(sr.post_buckling_branches(rod, (), (0, 0, -1), gravity=sr.EARTH_GRAVITY))
    assert set(heavy) == {FUNDAMENTAL, RING}
    assert heavy[RING].neutral.all()
    assert not heavy[RING].stable.any()
    assert {one.stability.kind for one in ring.equilibria} == {"neutral"}
    assert all(one.converged for branch in (*found.values(), *heavy.values()) for one in branch.equilibria)
    assert not ring.stable.any()
    assert ring.amplitude[-1] > 0.5
    # Turned about the axis of the rod by any angle it is in balance as it stands: no step is needed.
    last = ring.equilibria[-1]
    for angle in (0.3, 2.0, 4.5):
        z = last.q_springs.reshape(-1, 4).copy()
        c, s = np.cos(angle), np.sin(angle)
        z[:, :2] = z[:, :2] @ np.array([[c, s], [-s, c]])
        turned = sr.solve_equilibrium(rod, (), (0, 0, -ring.forces[-1]), q_springs0=z.ravel())
        assert turned.q_springs == pytest.approx(z.ravel(), abs=1e-12)
        assert not turned.stable


def test_a_rod_that_is_not_round_has_two_stable_branches() -> None:
    """The lumped rod under its weight, its hinges about x stiffer: it bows about y; later, unstable, about x."""
    lumped = sr.load_model(sr.PccArm(segment_lengths=(0.5,), chain="lumped", hinges=2, muscle_azimuths=()))
    table = {name: (k * (1.2 if "bend_x" in name else 1.0), rest) for name, (k, rest) in lumped.spring_table.items()}
    stiff = sr.load_model(lumped.urdf, springs=table)
    found = by_label(sr.post_buckling_branches(stiff, (), (0, 0, -1), gravity=sr.EARTH_GRAVITY))
    soft, hard = ([branch for label, branch in found.items() if f"bend_{axis}" in label] for axis in "yx")
    assert len(found) == 5
    assert len(soft) == len(hard) == 2
    assert all(branch.stable[1:].all() for branch in soft)
    assert not any(branch.stable.any() for branch in hard)
    assert hard[0].forces[0] > 1.1 * soft[0].forces[0]


def test_at_a_limit_point_the_path_itself_turns_back(arm: sr.SoftModel) -> None:
    """A folded arm snaps: nothing branches off, and on the way back it is unstable."""
    motors, direction = FOLDED
    (path,) = sr.post_buckling_branches(arm, motors, direction)
    limit = sr.critical_load(arm, motors, direction)
    top = int(np.argmax(np.diff(path.forces) < 0.0))  # the last point before the force falls
    assert path.label == FUNDAMENTAL
    assert path.forces[: top + 1].max() <= limit * (1.0 + 1e-12)
    assert path.forces[top] == pytest.approx(limit, rel=1e-2)  # points stand up to 0.05 rad apart
    assert np.diff(path.forces).min() < 0.0
    assert path.stable[: top - 1].all()
    falling = np.flatnonzero(np.diff(path.forces) < 0.0)[1:-1]
    assert not path.stable[falling].any()
    unit = direction / np.linalg.norm(direction)
    for one, force in zip(path.equilibria[::5], path.forces[::5].tolist(), strict=True):
        residual, _, _ = arm_balance(np.array([motors]), one.q_springs[None], force * unit[None], float(arm.stiffness[0]))
        assert np.abs(residual).max() < 1e-9
    assert np.all(path.amplitude == 0.0)


@pytest.mark.study
@pytest.mark.parametrize("plateau", [3.0, 12.0])
def test_a_branch_goes_on_where_the_link_comes_onto_its_plateau(plateau: float) -> None:
    """k a = F L sin a up to the moment M of the plateau, then M = F L sin a: it falls, unstable, to a = pi / 2.

    There the link bends on against -F L cos a; across it has M / a more.
    """
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), max_moment=plateau))
    stiffness = float(model.stiffness[0])
    found = by_label(sr.post_buckling_branches(model, (0, 0), PUSH))
    assert len(found) == 9
    for label in ("+spring_1_up", "-spring_1_side"):
        branch = found[label]
        a, forces = np.abs(springs_of(branch)).max(axis=1)[1:], branch.forces[1:]
        assert branch.ended == "largest force"
        assert np.abs(springs_of(branch)).min(axis=1).max() < 1e-9
        assert forces * LEVER * np.sin(a) == pytest.approx(np.minimum(stiffness * a, plateau), rel=1e-9)
        beyond = stiffness * a > plateau
        assert branch.stable[1:].tolist() == (~beyond | (a > np.pi / 2)).tolist()
        assert branch.softest[1:][beyond] == pytest.approx(-(forces * LEVER * np.cos(a))[beyond] / stiffness, abs=1e-9)


PLATEAUS = (*np.linspace(3.0, 25.0, 20).tolist(), 14.99, 21.76)
"""Largest moments of a link [N m]; the last two are [Troise 2021]'s Table 3 at two pressures."""


def check_branches_at_a_plateau(links: int, plateau: float) -> None:
    """Wherever the points of a branch lie before its links come onto their plateaus, it goes on to the largest force."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6, 0.6, 0.5)[:links], max_moment=plateau))
    found = by_label(sr.post_buckling_branches(model, (0,) * model.n_motors, PUSH, largest_step=0.1))
    assert len(found) == 9
    for branch in found.values():
        assert branch.ended == "largest force"
        assert all(one.converged for one in branch.equilibria)
        assert np.linalg.norm(np.diff(springs_of(branch), axis=0), axis=1).max() <= 0.1 / 0.95 + 1e-9  # no jump


@pytest.mark.study
@pytest.mark.shortened(2, len(PLATEAUS))
@pytest.mark.parametrize("links", [1, 2, 3])
def test_no_branch_is_lost_at_any_plateau(links: int, cases: int) -> None:
    for plateau in PLATEAUS[:: -round(len(PLATEAUS) / cases)]:
        check_branches_at_a_plateau(links, plateau)


@pytest.mark.study
@pytest.mark.parametrize("plateau", [*PLATEAUS[::12], 14.99])
def test_an_arm_of_two_links_folds_at_its_plateau_as_its_plane_says(plateau: float) -> None:
    """Two hinges in a plane, the first on its plateau M: M = F (0.6 sin a + 0.57 sin(a + b)), k b = F 0.57 sin(a + b)."""
    model = sr.load_model(sr.InflatableArm(max_moment=plateau))
    stiffness = float(model.stiffness[0])
    branch = by_label(sr.post_buckling_branches(model, (0, 0, 0), PUSH))["+spring_1_up"]
    a, b = springs_of(branch)[:, 1], springs_of(branch)[:, 3]
    folded = stiffness * a > plateau
    assert a[folded].min() < 0.2 < 2.8 < a[folded].max()
    for angle, other, force in zip(a[folded].tolist(), b[folded].tolist(), branch.forces[folded].tolist(), strict=True):

        def unbalanced(second: float, first: float = angle) -> float:
            lever = LEVER * np.sin(first + second)
            return stiffness * second * (0.6 * np.sin(first) + lever) - plateau * lever

        balanced = brentq(unbalanced, 0.0, plateau / stiffness, xtol=1e-15)
        assert other == pytest.approx(balanced, abs=1e-9)
        assert force == pytest.approx(plateau / (0.6 * np.sin(angle) + LEVER * np.sin(angle + balanced)), rel=1e-8)


@pytest.mark.study
@pytest.mark.parametrize("largest_step", [0.1, 0.03])
def test_a_path_does_not_turn_back_at_a_knee(largest_step: float) -> None:
    """At 17.3 N the second link comes off its plateau and springs back: beyond, the first link bends on, to the largest force.

    A step from a hair before that knee found the path on which it had come. Planar: with the second link relaxed again,
    20 N m = F (0.6 sin a + 0.57 sin(a + b)).
    """
    for stiffness, plateaus in (((127.32, 313.46), (20.0, 9.77)), ((127.319182, 313.461050), (19.9973111, 9.7678682))):
        model = sr.load_model(sr.InflatableArm(stiffness=stiffness, max_moment=plateaus))
        found = sr.post_buckling_branches(model, (0, 0, 0), PUSH, max_force=115.0, largest_step=largest_step)[1]
        first, second = springs_of(found)[-1, ::2]
        assert (found.label, found.ended) == ("+spring_1_side", "largest force")
        assert first > 2.9
        assert plateaus[0] == pytest.approx(115.0 * (0.6 * np.sin(first) + LEVER * np.sin(first + second)), rel=1e-8)
        assert stiffness[1] * second == pytest.approx(115.0 * LEVER * np.sin(first + second), rel=1e-8)


@pytest.mark.study
def test_two_knees_that_are_nearly_one_are_passed_one_after_the_other() -> None:
    """When the second link comes onto its plateau, the first is 5e-5 rad before its own."""
    model = sr.load_model(sr.InflatableArm(stiffness=(338.4153290, 187.1467356), max_moment=(20.0559514, 13.5996616)))
    found = by_label(sr.post_buckling_branches(model, (0, 0, 0), PUSH, max_force=198.8))
    assert len(found) == 9
    assert {branch.ended for branch in found.values()} == {"largest force"}


@pytest.mark.study
def test_branches_are_found_before_a_plateau_that_begins_early() -> None:
    """At 0.017 rad; they end in balance."""
    model = sr.load_model(sr.InflatableArm(max_moment=3.0))
    found = by_label(sr.post_buckling_branches(model, (0, 0, 0), PUSH))
    assert len(found) == 9
    assert all(branch.equilibria[-1].converged for branch in found.values())


def test_a_knee_at_which_stability_is_lost_is_no_crossing() -> None:
    """The tangent stiffness jumps there; under a larger force there is no equilibrium nearby."""
    model = sr.load_model(sr.InflatableArm(max_moment=(12.0, 3.0)))
    motors, direction = (0, 0, 0.20753406386703446), (-1.0, -0.08838592885714874, 0.017351505102718986)
    critical = critical_point(ForcePath.of(model, motors, direction, frame=None, gravity=None))
    assert not critical.crosses
    (path,) = sr.post_buckling_branches(model, motors, direction)
    top = int(np.argmax(np.diff(path.forces) < 0.0))
    assert path.forces[top] == pytest.approx(critical.path.force, rel=1e-3)
    assert path.stable[: top + 1].all()
    assert not path.stable[top + 1]


@pytest.mark.study
def test_a_branch_tells_why_it_ends(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    bent = sr.load_model(sr.PccArm(segment_lengths=(0.5,), elastic_sections=1, muscle_azimuths=()))  # to half a turn at most
    far = by_label(sr.post_buckling_branches(bent, (), (0, 0, -1), max_force=200.0, largest_step=0.2))
    assert far[RING].ended == "end of range"
    assert far[RING].forces[-1] < 200.0
    known: dict[sr.SoftModel, CriticalPoint] = {}
    monkeypatch.setattr(force_path, "_MOST_POINTS", 100)
    few = by_label(sr.post_buckling_branches(link(None, 172.71), (0, 0), PUSH, largest_step=1e-3))
    assert {branch.ended for branch in few.values()} == {"points"}
    assert {len(branch.equilibria) for branch in few.values()} == {100}
    monkeypatch.undo()
    for model, motors, push in ((arm, *FOLDED), (link(None, 172.71), (0, 0), PUSH)):
        known[model] = critical_point(ForcePath.of(model, motors, push, frame=None, gravity=None))
    monkeypatch.setattr(post_buckling, "critical_point", lambda path, *_: known[path.model])
    monkeypatch.setattr(force_path, "_NEWTON_STEPS", 1)
    (lost,) = sr.post_buckling_branches(arm, *FOLDED)
    assert lost.ended == "lost"
    with pytest.raises(sr.NeutralEquilibrium, match=r"not all branches that leave the path at 303 N"):
        sr.post_buckling_branches(link(None, 172.71), (0, 0), PUSH)


def test_more_than_two_modes_at_once_are_refused(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(post_buckling, "ZERO_EIGENVALUE", 2.0)
    with pytest.raises(sr.NeutralEquilibrium, match=r"4 modes buckle at 114\.066 N"):
        sr.post_buckling_branches(arm, (0, 0, 0), PUSH)


@each_row(
    ("options", "error", "words"),
    [
        ({"direction": (1, 0, 0), "max_force": 300.0}, sr.NoCriticalLoad, "stays stable up to 300 N"),
        ({"direction": (0, 0, 0)}, sr.ParameterError, "different from zero"),
        ({"largest_step": 0.0}, sr.ParameterError, "largest_step"),
        ({"q_motors": (0,)}, sr.ParameterError, "q_motors"),
        ({"frame": "top"}, sr.NameNotFound, "'top'"),
        ({"gravity": (1, 2)}, sr.ParameterError, "gravity"),
        ({"max_force": -1.0}, sr.ParameterError, "max_force"),
    ],
)
def test_bad_input_is_refused(arm: sr.SoftModel, options: dict, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        sr.post_buckling_branches(arm, **({"q_motors": (0, 0, 0), "direction": PUSH} | options))


def test_the_figure_shows_what_is_stable_and_what_is_not(tool: Callable[[str], ModuleType]) -> None:
    tool("matplotlib")
    found = sr.post_buckling_branches(link(None, 172.71), (0, 0), PUSH)
    figure = equilibria.branches(found, (0, 0, 2))
    left, right = figure.axes
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [branch.label for branch in found]
    for row, branch in enumerate(found):
        whole, dashed = (np.asarray(line.get_ydata(), dtype=float) for line in left.lines[2 * row : 2 * row + 2])
        ways = 1e3 * np.array([one.tip_position[2] for one in branch.equilibria])
        assert whole[branch.stable] == pytest.approx(ways[branch.stable], abs=1e-9)
        assert np.isnan(whole[~branch.stable]).all()
        assert dashed[~branch.stable] == pytest.approx(ways[~branch.stable], abs=1e-9)
        assert np.asarray(right.lines[2 * row].get_ydata())[branch.stable] == pytest.approx(branch.softest[branch.stable])
    for wrong in ((), [1], 5):
        with pytest.raises(sr.ParameterError, match="EquilibriumBranch"):
            equilibria.branches(wrong, (0, 0, 1))
    with pytest.raises(sr.ParameterError, match="across"):
        equilibria.branches(found, (0, 0, 0))
