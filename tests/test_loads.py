"""What a load does in joint coordinates: derivatives by differences, work and energy, other libraries."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.model.joint_loads import Entries, JointLoad
from softrobots.statics.loads import AppliedLoad, Load
from tests.support.foreign import BRANCHED, LIMIT, SPRINGS
from tests.support.oracles import central_difference, flexible_jacobian
from tests.support.tables import each_row

MODELS = {
    "one link": sr.load_model(sr.InflatableArm(link_lengths=(0.6,))),
    "two links": sr.load_model(sr.InflatableArm()),
    "three links": sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3), hinge_offset=(0.03, 0.05, 0.02))),
    "slider and branch": sr.load_model(
        BRANCHED.replace('"continuous"><', f'"revolute">{LIMIT}<'), springs=SPRINGS, tip="finger"
    ),
}


def generalised_load(model: sr.SoftModel, q: np.ndarray, load: Load) -> JointLoad:
    return AppliedLoad(model, load).at(q)


def random_load(model: sr.SoftModel, rng: np.random.Generator, *, moments: bool) -> Load:
    mask = np.r_[np.ones(3), np.full(3, float(moments))]
    wrench = {name: 20 * rng.normal(size=6) * mask for name in (model.tip, model.pinocchio.names[2])}
    return Load.of(model, wrench=wrench, gravity=10 * rng.normal(size=3))


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("moments", [False, True])
def test_derivative_matches_central_differences(model: sr.SoftModel, moments: bool, rng: np.random.Generator) -> None:
    for _ in range(10):
        load, q = random_load(model, rng, moments=moments), rng.uniform(-1.5, 1.5, model.pinocchio.nq)
        every = np.arange(model.pinocchio.nv)
        found = generalised_load(model, q, load).derivative(Entries.of(every, every, len(every)))
        expected = central_difference(lambda at, load=load: generalised_load(model, at, load).torque, q)
        assert np.abs(found - expected).max() < 1e-7  # step 1e-6: truncation 1e-11, rounding 1e-14 / 1e-6 times 50 N m
        if not moments:  # a world-fixed moment has no potential, and no symmetric derivative
            assert np.allclose(found, found.T, atol=1e-12)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_torque_is_minus_the_slope_of_the_potential(model: sr.SoftModel, rng: np.random.Generator) -> None:
    for _ in range(10):
        load, q = random_load(model, rng, moments=False), rng.uniform(-1.5, 1.5, model.pinocchio.nq)
        slope = central_difference(lambda at, load=load: np.array([generalised_load(model, at, load).potential]), q)[0]
        assert np.abs(generalised_load(model, q, load).torque + slope).max() < 1e-7


def test_torque_is_the_papers_jacobian_transposed(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for _ in range(20):
        wrench, angles = rng.normal(size=6), rng.uniform(-1.5, 1.5, 7)
        q = arm.configuration(angles[[0, 1, 4]], angles[[2, 3, 5, 6]])
        found = generalised_load(arm, q, Load.of(arm, wrench=wrench)).torque
        order = np.r_[arm.motor_indices, arm.spring_indices]
        assert np.allclose(found[order], (flexible_jacobian(angles).T @ wrench)[[0, 1, 4, 2, 3, 5, 6]], atol=1e-13)


def test_gravity_torque_is_that_of_inverse_dynamics_at_rest(odd_arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """Pinocchio's recursive Newton-Euler is another algorithm than its generalised gravity."""
    gravity = rng.normal(size=3)
    model = odd_arm.pinocchio.copy()
    model.gravity.linear = gravity
    for _ in range(10):
        q = rng.uniform(-1.5, 1.5, model.nq)
        expected = -pin.rnea(model, model.createData(), q, np.zeros(model.nv), np.zeros(model.nv))
        found = generalised_load(odd_arm, q, Load.of(odd_arm, gravity=gravity)).torque
        assert np.allclose(found, expected, atol=1e-13)


def test_force_and_wrench_at_one_frame_add_up(arm: sr.SoftModel) -> None:
    load = Load.of(arm, (1, 2, 3), wrench={"tip": (1, 1, 1, 4, 5, 6), "link_1": np.ones(6)})
    assert load.wrenches["tip"].tolist() == [2, 3, 4, 4, 5, 6]
    assert load.wrenches["link_1"].tolist() == [1] * 6
    assert not load.conservative
    assert Load.of(arm, (1, 2, 3), gravity=sr.EARTH_GRAVITY).conservative


@each_row(
    ("options", "error", "message"),
    [
        (
            {"force": (0, 1)},
            sr.ParameterError,
            r"force = \(0, 1\).*shape \(3,\) of finite numbers \[N\] \(it has shape \(2,\)\)",
        ),
        ({"force": (0, 1, float("nan"))}, sr.ParameterError, "force.*finite"),
        ({"force": "up"}, sr.ParameterError, "force"),
        ({"wrench": (0, 1, 2)}, sr.ParameterError, "wrench"),
        ({"wrench": {"tip": (0, 1, 2)}}, sr.ParameterError, r"wrench\['tip'\]"),
        ({"wrench": {"hand": np.ones(6)}}, sr.NameNotFound, "'hand'"),
        ({"force": (0, 0, 1), "frame": "hand"}, sr.NameNotFound, "'hand'"),
        ({"gravity": -9.81}, sr.ParameterError, "gravity"),
        ({"gravity": (0, 0, float("inf"))}, sr.ParameterError, "gravity"),
    ],
)
def test_bad_loads_are_refused(arm: sr.SoftModel, options: dict, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        Load.of(arm, **options)
    with pytest.raises(error, match=message):
        sr.solve_equilibrium(arm, (0, 0, 0), **options)
