"""Equilibria: the reference values, SciPy on the DH energy, and certificates on many random cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

import softrobots as sr
from softrobots.statics.elastostatics import METHODS
from tests.support.oracles import REFERENCE_EQUILIBRIA, arm_energy
from tests.support.tables import each_row

FORCE = np.array([0.0, 10.0, -15.0])


def random_case(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    direction = rng.normal(size=3)
    return rng.uniform(-np.pi, np.pi, 3), size * direction / np.linalg.norm(direction)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("motors", "springs", "tip"), REFERENCE_EQUILIBRIA)
def test_reference_values(arm: sr.SoftModel, method: str, motors: tuple, springs: tuple, tip: tuple) -> None:
    found = sr.solve_equilibrium(arm, motors, FORCE, method=method)
    assert np.abs(found.q_springs - springs).max() < 6e-6  # five digits are printed
    assert np.abs(found.tip_position - tip).max() < 6e-6
    assert found.residual <= 1e-10 * np.linalg.norm(FORCE) * 1.2 * (1 + 1e-12)
    assert found.stable
    assert found.within_limits


@pytest.mark.parametrize("size", [5.0, 18.0, 60.0])
def test_energy_is_minimal_by_scipy_on_the_dh_table(arm: sr.SoftModel, size: float, rng: np.random.Generator) -> None:
    """SciPy's BFGS on the energy written with Table 2; it stops at gradients of 1e-6 N m, so 1e-6 / 100 N m/rad."""
    for _ in range(5):
        motors, force = random_case(rng, size)
        found = sr.solve_equilibrium(arm, motors, force)
        best = minimize(lambda y, m=motors, f=force: arm_energy(m, y, f, 172.71), np.zeros(4), options={"gtol": 1e-7})
        assert np.abs(found.q_springs - best.x).max() < 1e-6
        assert found.iterations < 15


def test_torques_balance(odd_arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """Spring torques are k (q - rest), and all joint torques together are those of inverse dynamics at rest."""
    import pinocchio as pin

    motors, force = rng.uniform(-2, 2, 4), 10 * rng.normal(size=3)
    found = sr.solve_equilibrium(odd_arm, motors, force, gravity=sr.EARTH_GRAVITY)
    model = odd_arm.pinocchio.copy()
    model.gravity.linear = np.array(sr.EARTH_GRAVITY)
    data = model.createData()
    tip = model.getFrameId("tip")
    pin.framesForwardKinematics(model, data, found.q)
    joint = model.frames[tip].parentJoint
    arm_to_tip = data.oMf[tip].translation - data.oMi[joint].translation
    local = data.oMi[joint].rotation.T
    at_joint = pin.Force(local @ force, local @ np.cross(arm_to_tip, force))
    outside = [pin.Force.Zero() for _ in range(model.njoints)]
    outside[joint] = at_joint
    torque = pin.rnea(model, data, found.q, np.zeros(model.nv), np.zeros(model.nv), outside)
    assert np.allclose(-torque[odd_arm.spring_indices], found.spring_torques, atol=1e-8)
    assert np.allclose(-torque[odd_arm.motor_indices], found.motor_torques, atol=1e-10)
    assert np.allclose(found.spring_torques, odd_arm.stiffness * (found.q_springs - odd_arm.rest))


def test_a_load_at_the_elbow_bends_only_what_carries_it(arm: sr.SoftModel) -> None:
    found = sr.solve_equilibrium(arm, (0.2, 0.3, -0.4), (3, 5, -10), frame="link_2_root")
    assert np.abs(found.q_springs[2:]).max() == 0.0
    assert np.abs(found.q_springs[:2]).max() > 1e-4


def test_several_wrenches_superpose_for_small_loads(arm: sr.SoftModel) -> None:
    """Linear to first order: the sum of small answers is the answer to the sum, up to the square of the angle (1e-3)."""
    one = sr.solve_equilibrium(arm, (0.2, 0.3, -0.4), (0, 0.05, 0))
    other = sr.solve_equilibrium(arm, (0.2, 0.3, -0.4), wrench={"link_1": (0, 0, -0.1, 0, 0, 0)})
    both = sr.solve_equilibrium(arm, (0.2, 0.3, -0.4), (0, 0.05, 0), wrench={"link_1": (0, 0, -0.1, 0, 0, 0)})
    assert np.allclose(both.q_springs, one.q_springs + other.q_springs, atol=1e-6)


def test_a_moment_about_the_axis_of_one_spring(arm: sr.SoftModel) -> None:
    """Closed form: one link, moment about y at the tip: only the up springs turn, each by -mu / k."""
    found = sr.solve_equilibrium(arm, (0, 0, 0), wrench=(0, 0, 0, 0, 7.0, 0))
    assert np.allclose(found.q_springs, [0, -7.0 / 172.71, 0, -7.0 / 172.71], atol=1e-13)


@pytest.mark.study
@pytest.mark.parametrize(("size", "cases"), [(18, 10_000), (50, 10_000), (100, 10_000), (150, 10_000), (200, 10_000)])
def test_every_random_case_ends_certified_stable(arm: sr.SoftModel, size: float, cases: int) -> None:
    """Every case is solved to 1e-10 and certified; an independent eigenvalue solver agrees with the certificate.

    Loads beyond about 20 N wrinkle the robot: they test the solver.
    """
    rng = np.random.default_rng(int(size))
    worst, softest = 0.0, np.inf
    for number in range(cases):
        motors, force = random_case(rng, size)
        found = sr.solve_equilibrium(arm, motors, force)  # raises if it does not converge
        assert found.stable
        worst = max(worst, found.residual / (size * 1.2))
        if number % 20 == 0:
            softest = min(softest, np.linalg.eigvals(found.tangent_stiffness).real.min())
    assert worst <= 1e-10 * (1 + 1e-12)
    assert softest > 0.0


@pytest.mark.study
@pytest.mark.parametrize(("size", "share"), [(50, 1.0), (150, 0.69), (200, 0.34)])
def test_the_papers_fixed_point_converges_as_often_as_measured(arm: sr.SoftModel, size: float, share: float) -> None:
    """docs/theory.md 1.4: 100, 70, 34 %; of 250 cases the standard deviation is 3 %, three of them are allowed."""
    rng, found = np.random.default_rng(7), 0
    for _ in range(250):
        motors, force = random_case(rng, size)
        try:
            found += sr.solve_equilibrium(arm, motors, force, method="fixed_point").converged
        except sr.EquilibriumNotFound as error:
            assert error.best.residual == error.residual > error.best.tolerance
            assert error.iterations == 1000
            assert np.isfinite(error.best.q_springs).all()
    assert found / 250 == pytest.approx(share, abs=0.09 if share < 1 else 0.0)


def test_energy_never_rises_and_a_buckled_arm_leaves_the_straight_state(arm: sr.SoftModel) -> None:
    """Pushed beyond buckling the straight arm balances but is unstable; the solver must leave it, to one side."""
    found = sr.solve_equilibrium(arm, (0, 0, 0), (-160, 0, 0))
    assert found.stable
    assert np.abs(found.q_springs).max() > 0.5
    bent = arm_energy(np.zeros(3), found.q_springs, np.array([-160.0, 0, 0]), 172.71)
    assert bent < arm_energy(np.zeros(3), np.zeros(4), np.array([-160.0, 0, 0]), 172.71)


def test_axial_tension_is_stable_where_the_fixed_point_diverges(arm: sr.SoftModel) -> None:
    force = (300.0, 1.0, 0.0)
    assert sr.solve_equilibrium(arm, (0, 0, 0), force).stable
    with pytest.raises(sr.EquilibriumNotFound, match="method='newton' converges for larger loads"):
        sr.solve_equilibrium(arm, (0, 0, 0), force, method="fixed_point")


def test_no_convergence_carries_the_best_iterate(arm: sr.SoftModel) -> None:
    with pytest.raises(sr.EquilibriumNotFound, match=r"2 iterations: residual .* required") as caught:
        sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 100, -150), max_iterations=2)
    assert caught.value.best.residual == caught.value.residual > caught.value.best.tolerance
    assert not caught.value.best.converged


def test_wrinkling_is_reported(arm: sr.SoftModel) -> None:
    fine = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), FORCE)
    assert fine.wrinkled is False
    assert fine.link_moments == pytest.approx([np.hypot(*fine.spring_torques[:2]), np.hypot(*fine.spring_torques[2:])])
    assert sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), 2 * FORCE).wrinkled is True
    beyond = sr.solve_equilibrium(arm, (0, 0, 0), (-800, 0, 1))
    assert beyond.within_limits is False


def test_a_moment_is_solved_from_any_start(arm: sr.SoftModel) -> None:
    wrench = (0, 10, -15, 0, 0, 1.0)
    relaxed = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), wrench=wrench)
    away = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), wrench=wrench, q_springs0=np.full(4, 0.3))
    assert np.allclose(away.q_springs, relaxed.q_springs, atol=1e-9)


@pytest.mark.parametrize("ratio", [1e-5, 1e-3, 1e3, 1e5])
def test_soft_and_stiff_springs_together(arm: sr.SoftModel, ratio: float) -> None:
    """Buckling pushes on an arm whose first link is much stiffer or softer than its second: always certified, few steps."""
    table = {name: (172.71 * (ratio if "_1_" in name else 1.0), 0.0) for name in arm.spring_joints}
    model = sr.load_model(arm.urdf, springs=table)
    for force in ((-400, 0, 1), (-50, 3, 1), (0, 10, -15)):
        found = sr.solve_equilibrium(model, (0, 0, 0), force)
        assert found.stable
        assert found.iterations < 60


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 1.0])
def test_stiff_springs_with_rest_angles_under_tiny_loads(size: float) -> None:
    """k (y - rest) of 1e6 N m/rad is exact to 1e-10 N m only; the residual is measured against that too."""
    model = sr.load_model(sr.InflatableArm(stiffness=1e6, rest_up=-0.3, rest_side=0.7))
    found = sr.solve_equilibrium(model, (0.1, 0.2, 0.3), (0, 0, -size))
    assert found.stable
    assert found.residual < 1e-8


def test_a_robot_without_joints_does_not_crash() -> None:
    rigid = sr.load_model(sr.InflatableArm(), springs={}, motors=[])
    found = sr.solve_equilibrium(rigid, [], (1, 2, 3), gravity=sr.EARTH_GRAVITY)
    assert found.tip_position == pytest.approx([1.2, 0, 0])
    assert sr.compliance(rigid, found).tolist() == np.zeros((6, 6)).tolist()


def test_results_are_read_only_and_know_their_inputs(arm: sr.SoftModel) -> None:
    found = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), FORCE)
    assert found.model is arm
    assert found.load.wrenches["tip"][:3].tolist() == FORCE.tolist()
    for array in (found.q, found.q_motors, found.q_springs, found.spring_torques, found.tangent_stiffness):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 1.0
    assert np.array_equal(found.eigenvalues, np.sort(found.eigenvalues))


@each_row(
    ("options", "message"),
    [
        ({"q_motors": (0, 0)}, "q_motors"),
        ({"q_motors": (0, 0, float("nan"))}, "q_motors"),
        ({"method": "magic"}, "method = 'magic'.*'newton', 'fixed_point'"),
        ({"q_springs0": (0, 0)}, "q_springs0"),
        ({"q_springs0": (0, 0, 0, float("inf"))}, "q_springs0"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"max_iterations": 2.5}, "max_iterations"),
        ({"force": (1e308, 0, 0)}, "force.*at most 1e.30 in size"),
        ({"force": ("0", "10", "-15")}, "force"),
        ({"force": (True, False, True)}, "force"),
        ({"force": (1j, 0, 0)}, "force"),
        ({"force": (10**400, 0, 0)}, "force"),
        ({"q_motors": [[0], [0, 0]]}, "q_motors"),
        ({"method": np.array(["newton"])}, "method"),
    ],
)
def test_bad_input_is_refused(arm: sr.SoftModel, options: dict, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.solve_equilibrium(arm, **({"q_motors": (0, 0, 0), "force": FORCE} | options))
