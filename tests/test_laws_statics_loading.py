"""Laws of loading a robot: work and stored energy, reciprocity, moments without a potential, derivatives, buckling."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

import softrobots as sr
from tests.support.law_robots import (
    PUSHES,
    ROBOTS,
    Case,
    cases,
    directions,
    load_energy,
    model,
    scaled,
    stored_energy,
    triples,
    turned,
    turns,
)
from tests.support.laws import law
from tests.support.oracles import central_difference

LOADED = tuple(kind for kind in ROBOTS if kind != "limp")
"""Robots whose equilibria are smooth in the load."""


def well_inside(found: sr.Equilibrium, share: float = 0.2) -> bool:
    """Whether an equilibrium is stable and not near buckling: relative to the springs' own stiffness."""
    softness = 1.0 / np.sqrt(found.model.stiffness)
    symmetric = 0.5 * (found.tangent_stiffness + found.tangent_stiffness.T)
    return bool(np.linalg.eigvalsh(softness[:, None] * symmetric * softness)[0] > share)


# --- Work


@law("solve_equilibrium")
@pytest.mark.parametrize("kind", LOADED)
@given(case=cases(0.5))
@settings(max_examples=4)
def test_the_work_of_a_force_that_grows_slowly_is_the_energy_stored(kind: str, case: Case) -> None:
    """From zero to the full force, under gravity and with tensions given too: by 12 points of Gauss.

    Integrated by parts, the work is `f . x` at the end less the integral of `x` over the force. Bound: the points are exact for
    polynomials of degree 23.
    """
    robot, force = model(kind), case.force(kind)
    motors = case.motors(robot)
    points, weights = np.polynomial.legendre.leggauss(12)
    states, springs = [], None
    for share in (0.0, *(0.5 + 0.5 * points), 1.0):
        found = sr.solve_equilibrium(robot, motors, share * force, gravity=case.gravity, q_springs0=springs, tolerance=1e-12)
        assume(well_inside(found))
        springs = found.q_springs
        states.append(found)
    if kind == "slack":  # where the wall of a link goes slack the path has a kink, which no polynomial has
        assume(len({tuple(found.link_limits.slack_margins > 0.0) for found in states}) == 1)
    tips = np.array([found.tip_position for found in states])
    work = force @ (tips[-1] - 0.5 * weights @ tips[1:-1])
    stored = [
        stored_energy(robot, motors, found.q_springs) + load_energy(robot, motors, found.q_springs, np.zeros(3), case.gravity)
        for found in (states[0], states[-1])
    ]
    lifted = np.linalg.norm(force) * np.abs(tips).max()
    assert work == pytest.approx(stored[1] - stored[0], rel=1e-7, abs=1e-11 * lifted + 1e-13 * (1.0 + abs(stored[0])))


@law("solve_imposed_displacement")
@pytest.mark.parametrize("kind", ["arm", "pcc", "pulled", "pcc_lumped", "helix", "foreign"])
@given(case=cases(0.5), size=st.floats(0.01, 0.4))
@settings(max_examples=3)
def test_the_work_of_a_probe_is_the_energy_stored(kind: str, case: Case, size: float) -> None:
    """The reaction over the way, by 8 points of Gauss; and the reaction is the force that would have moved it so far."""
    robot, motors = model(kind), case.motors(model(kind))
    free = sr.solve_equilibrium(robot, motors, gravity=case.gravity)
    assume(well_inside(free))
    softness = float(case.direction @ sr.compliance(robot, free)[:3, :3] @ case.direction)
    assume(softness > 1e-3 * robot.reach / PUSHES[kind])
    way = size * softness * PUSHES[kind]
    points, weights = np.polynomial.legendre.leggauss(8)
    held, reactions = None, []
    for share in (*(0.5 + 0.5 * points), 1.0):
        held = sr.solve_imposed_displacement(
            robot, motors, share * way, direction=case.direction, gravity=case.gravity, start=held, tolerance=1e-12
        )
        assume(well_inside(held.equilibrium))
        reactions.append(held.reaction)
    stored = [
        stored_energy(robot, motors, y) + load_energy(robot, motors, y, np.zeros(3), case.gravity)
        for y in (free.q_springs, held.q_springs)
    ]
    assert way * 0.5 * weights @ reactions[:-1] == pytest.approx(stored[1] - stored[0], rel=1e-6, abs=1e-12)
    pushed = sr.solve_equilibrium(robot, motors, held.force, gravity=case.gravity, q_springs0=held.q_springs, tolerance=1e-12)
    assert case.direction @ (pushed.tip_position - free.tip_position) == pytest.approx(way, rel=1e-8)
    assert np.allclose(held.force, held.reaction * case.direction, rtol=1e-14)
    assert held.stable


# --- Reciprocity


@law("compliance")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(3.0), moment=st.one_of(st.just(0.0), st.floats(-12.0, 0.0).map(lambda power: 10.0**power)), axis=directions)
@settings(max_examples=6)
def test_compliance_is_reciprocal_but_for_what_a_moment_makes_of_it(
    kind: str, case: Case, moment: float, axis: np.ndarray
) -> None:
    """Maxwell-Betti, and its failure: a moment `mu` fixed in the world leaves `C - C^T = C_m [mu] C_m^T`.

    `C_m` are the columns of the moments: the slope of `z_i . mu` along spring j is `mu . (z_j x z_i)` if j comes first, else 0
    (docs/theory.md 1.4), so `K - K^T` is `mu . (z_i x z_j)`. The code knows what has a potential: moments of zero have.
    """
    robot, force = model(kind), case.force(kind)
    mu = 0.3 * PUSHES[kind] * robot.reach * moment * axis
    wrench = np.r_[force, mu]
    try:
        found = sr.solve_equilibrium(robot, case.motors(robot), wrench=wrench, gravity=case.gravity)
    except sr.EquilibriumNotFound:
        assume(False)  # a large moment may have none
    assume(well_inside(found, 1e-3))
    assert found.conservative == (moment == 0.0)
    motion = sr.compliance(robot, found)
    expected = motion[:, 3:] @ pin.skew(mu) @ motion[:, 3:].T
    size = np.sqrt(np.outer(np.diag(motion), np.diag(motion)).clip(0.0)) + 1e-9 * np.abs(motion).max()
    assert (np.abs(motion - motion.T - expected) < 1e-9 * size).all()
    tangent = found.tangent_stiffness
    assert moment > 0.0 or (np.abs(tangent - tangent.T) <= 1e-12 * np.abs(tangent).max()).all()


@law("elastostatic_jacobian")
@pytest.mark.parametrize("kind", [kind for kind in LOADED if "helix" not in kind])
@given(case=cases(1.0))
@settings(max_examples=4)
def test_actuators_and_tip_are_reciprocal(kind: str, case: Case) -> None:
    """What a motor does to the tip, a force on the tip does to the motor: `dx/dq_m` is `(d tau_m / df)^T`, by differences.

    What a tension does to the tip, a force does to the length of that muscle, the other way.
    """
    robot, force = model(kind), case.force(kind)
    motors = case.motors(robot)
    found = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, tolerance=1e-13)
    assume(well_inside(found))

    def felt(change: np.ndarray) -> np.ndarray:
        options = {"gravity": case.gravity, "q_springs0": found.q_springs, "tolerance": 1e-13}
        near = sr.solve_equilibrium(robot, motors, force + change, **options)
        return -near.muscle_lengths if kind == "pulled" else near.motor_torques

    slope = sr.elastostatic_jacobian(robot, found)
    expected = central_difference(felt, np.zeros(3), 1e-4 * PUSHES[kind]).T
    assert np.abs(slope - expected).max() < 1e-6 * np.abs(slope).max()  # the third derivative, 1e-8, and rounding


@law("elastostatic_jacobian", "compliance")
@pytest.mark.parametrize("kind", LOADED)
@given(case=cases(1.0), moment=triples, way=st.integers(0, 2**32 - 1))
@settings(max_examples=4)
def test_slopes_are_those_of_equilibria_nearby(kind: str, case: Case, moment: tuple, way: int) -> None:
    """Along a way through motors, forces and moments at once, by central differences of solved equilibria."""
    robot, random = model(kind), np.random.default_rng(way)
    motors, wrench = case.motors(robot), np.r_[case.force(kind), 0.02 * PUSHES[kind] * robot.reach * np.array(moment)]
    found = sr.solve_equilibrium(robot, motors, wrench=wrench, gravity=case.gravity, tolerance=1e-13)
    assume(well_inside(found))
    by_motors = 1e-4 * robot.motor_scale * random.normal(size=robot.n_motors)
    by_wrench = 1e-4 * PUSHES[kind] * np.r_[random.normal(size=3), robot.reach * random.normal(size=3)]

    def pose(step: np.ndarray) -> np.ndarray:
        near = sr.solve_equilibrium(
            robot,
            motors + step[0] * by_motors,
            wrench=wrench + step[1] * by_wrench,
            gravity=case.gravity,
            q_springs0=found.q_springs,
            tolerance=1e-13,
        )
        turn = near.transform_tip_to_world.rotation @ found.transform_tip_to_world.rotation.T
        return np.r_[near.tip_position, pin.log3(turn)]

    expected = central_difference(pose, np.zeros(2), 1.0)
    slopes = sr.elastostatic_jacobian(robot, found) @ by_motors, sr.compliance(robot, found) @ by_wrench
    assert np.abs(slopes[0] - expected[:3, 0]).max() < 1e-5 * np.abs(expected[:, 0]).max() + 1e-10
    assert np.abs(slopes[1] - expected[:, 1]).max() < 1e-5 * np.abs(expected[:, 1]).max() + 1e-10


# --- Buckling


def in_a_plane(lengths: tuple[float, float], hinge: float, stiffness: np.ndarray) -> sr.SoftModel:
    """Two straight links that bend in one plane, without motors."""
    text = sr.InflatableArm(link_lengths=lengths, hinge_offset=hinge * np.array(lengths)).urdf()
    springs = dict(zip(("spring_1_up", "spring_2_up"), stiffness.tolist(), strict=True))
    springs |= dict.fromkeys(("spring_1_side", "spring_2_side"))
    return sr.load_model(text, springs=springs, motors=[])


@law("critical_load")
@given(
    lengths=st.tuples(st.floats(0.2, 1.5), st.floats(0.2, 1.5)),
    hinge=st.floats(0.05, 0.6),
    powers=st.tuples(st.floats(-3.0, 6.0), st.floats(-3.0, 6.0)),
    size=st.floats(1e-6, 1e6),
)
@settings(max_examples=10)
def test_two_links_buckle_where_their_eigenvalue_says(lengths: tuple, hinge: float, powers: tuple, size: float) -> None:
    """Springs of 1e-3 to 1e6 N m/rad: the smallest F with `det(K - F G) = 0`, `G = [[a, c], [c, c]]`: docs/theory.md 1.4."""
    far, near = lengths[0] * (1.0 - hinge) + lengths[1], lengths[1] * (1.0 - hinge)
    stiffness = 10.0 ** np.array(powers)
    robot = in_a_plane(lengths, hinge, stiffness)
    expected = 1.0 / eigh(np.array([[far, near], [near, near]]), np.diag(stiffness), eigvals_only=True)[-1]
    found = sr.critical_load(robot, (), (-size, 0.0, 0.0))
    assert found == pytest.approx(expected, rel=1e-7)
    for share, stable in ((0.999, True), (1.001, False)):
        at = sr.solve_equilibrium(robot, (), (-share * found, 0.0, 0.0), method="fixed_point")  # stays on the straight path
        assert at.stable == stable


@law("post_buckling_branches", "EquilibriumBranch")
@given(
    lengths=st.tuples(st.floats(0.3, 1.0), st.floats(0.3, 1.0)), powers=st.tuples(st.floats(-1.0, 3.0), st.floats(-1.0, 3.0))
)
@settings(max_examples=4)
def test_a_pitchfork_has_two_branches_that_are_mirror_images(lengths: tuple, powers: tuple) -> None:
    """Equal forces, opposite angles; a branch is stable where its force grows as it begins; energies by hand."""
    stiffness, push = 10.0 ** np.array(powers), np.array([-1.0, 0.0, 0.0])
    robot = in_a_plane(lengths, 0.05, stiffness)
    straight, *sides = sr.post_buckling_branches(robot, (), push, largest_step=0.1)
    limit = sr.critical_load(robot, (), push)
    assert not straight.amplitude.any()
    assert np.array_equal(straight.stable, straight.forces < limit * (1.0 - 1e-12))
    assert len(sides) == 2
    one, other = sides
    assert isinstance(one, sr.EquilibriumBranch)
    assert {one.label[0], other.label[0]} == {"+", "-"}
    assert one.label[1:].replace("-", "+") == other.label[1:].replace("-", "+")
    assert np.allclose(one.forces, other.forces, rtol=1e-9)
    assert one.forces[0] == pytest.approx(limit, rel=1e-9)
    for here, there in zip(one.equilibria, other.equilibria, strict=True):
        assert np.allclose(here.q_springs, -there.q_springs, rtol=0.0, atol=1e-7)
        assert here.converged
    assert one.stable[1] == (one.forces[1] > one.forces[0])
    for branch in (straight, *sides):
        for at, force, told in zip(branch.equilibria, branch.forces, branch.energy, strict=True):
            stored = stored_energy(robot, np.zeros(0), at.q_springs)
            assert told == pytest.approx(stored + load_energy(robot, np.zeros(0), at.q_springs, force * push, None), rel=1e-12)


@law("critical_load")
@pytest.mark.parametrize("kind", ["arm", "limp", "pcc_lumped"])
@given(case=cases(), rpy=turns, power=st.floats(-3.0, 3.0), aside=st.booleans())
@settings(max_examples=3)
def test_buckling_turns_with_the_base_and_scales_with_the_stiffness(
    kind: str, case: Case, rpy: tuple, power: float, aside: bool
) -> None:
    """A straight robot pushed along itself or from aside: the same on a turned base, so much larger if so much stiffer.

    Along it there always is a limit; gravity pulls the same way.
    """
    robot, factor, turn = model(kind), 10.0**power, pin.rpy.rpyToMatrix(*rpy)
    motors = robot.relaxed_motors if kind == "pcc_lumped" else np.r_[case.motors(robot)[:2], 0.0]
    along = sr.solve_equilibrium(robot, motors).tip_position
    push = case.direction if aside else -along / np.linalg.norm(along)
    gravity = 0.5 * push

    def limit(each: sr.SoftModel, direction: np.ndarray, down: np.ndarray, most: float) -> float | None:
        try:
            return sr.critical_load(each, motors, direction, gravity=down, max_force=most)
        except sr.NoCriticalLoad:
            return None

    most = 50.0 * PUSHES[kind]
    one = limit(robot, push, gravity, most)
    turning = limit(turned(robot, rpy), turn @ push, turn @ gravity, most)
    harder = limit(scaled(robot, factor), push, factor * gravity, factor * most)
    assert aside or one is not None
    if one is None:
        assert turning is None
        assert harder is None
    else:
        assert turning == pytest.approx(one, rel=1e-6)
        assert harder / factor == pytest.approx(one, rel=1e-6)
