"""Compiled motion: every step satisfies the implicit midpoint rule on Pinocchio's inverse dynamics, in every back end."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run.backends import make_run
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement
from tests.support.serial_chains import ROBOTS

GRAVITY = np.array([0.7, -0.4, -9.7])


def out_of_balance(
    model: SoftModel,
    path: np.ndarray,
    y0: np.ndarray,
    v0: np.ndarray,
    a: np.ndarray,
    h: float,
    force: np.ndarray,
    damping: np.ndarray,
) -> np.ndarray:
    """The residual of a step of length h by Pinocchio; `path`: motors at its beginning, middle and end, shape (3, m)."""
    whole, data = model.workspace(tuple(GRAVITY.tolist()))
    y, v = y0 + h / 2 * v0 + h**2 / 4 * a, v0 + h / 2 * a
    columns = [model.pinocchio.joints[model.pinocchio.getJointId(name)].idx_v for name in model.structure.motor_joints]
    springs = model.structure.spring_indices

    def joints(motors: np.ndarray, strains: np.ndarray) -> np.ndarray:
        values = np.zeros(model.pinocchio.nv)
        values[columns], values[springs] = motors, strains
        return values

    q = model.configuration(path[1], y)
    rates, changes = (path[2] - path[0]) / h, 4 * (path[2] - 2 * path[1] + path[0]) / h**2
    torques = pin.rnea(whole, data, q, joints(rates, v), joints(changes, a))
    tip = model.frame_id(model.tip)
    jacobian = pin.computeFrameJacobian(whole, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
    return (torques - jacobian.T @ force)[springs] + model.springs.at(y)[1] + damping @ v


@pytest.mark.parametrize("full", [False, True], ids=["diagonal", "full"])
@pytest.mark.parametrize("kind", ["arm", "two_hinges", "odd", "slack"])
def test_a_step_is_the_implicit_midpoint_rule(kind: str, full: bool, rng: np.random.Generator) -> None:
    slack = sr.InflatableArm(link_model="two_hinges", moment_law="slack_wall")
    model = sr.load_model(slack) if kind == "slack" else ROBOTS[kind]()
    run: Any = make_run(make_motion_program(Unknowns(model.chain()), full_damping=full), "python")
    layout, n, m, h = run.layout, model.n_springs, model.n_motors, 2e-3
    for _ in range(5):
        w = run.workspace()
        y0, v0 = model.rest + rng.normal(size=n) * 0.1, rng.normal(size=n)
        path = rng.normal(size=m) + np.array([[0.0], [h / 2], [h]]) * rng.normal(size=m) + h * h * rng.normal(size=(3, m))
        force, factor = rng.normal(size=3) * 5.0, rng.normal(size=(n, n)) * 0.1
        D = factor @ factor.T if full else np.diag(rng.uniform(size=n))
        numbers = {"position": y0, "velocity": v0, "force": force, "gravity": GRAVITY, "time_step": np.array([h])}
        numbers |= dict(zip(("motors_begin", "motors_middle", "motors_end"), path, strict=True))
        for name, values in (numbers | {"damping": D.ravel() if full else np.diag(D)}).items():
            run.put(w, getattr(layout, name), values)
        assert run.motion_step(w) == 0
        y1, v1, a = (np.array(w[place : place + n]) for place in (layout.position, layout.velocity, layout.acceleration))
        np.testing.assert_allclose(y1, y0 + h * v0 + h**2 / 2 * a, rtol=0, atol=1e-15)  # rounding
        np.testing.assert_allclose(v1, v0 + h * a, rtol=1e-15, atol=1e-15)
        # A change of 1e-13 in the middle is one of K 1e-13 + M 1e-13 / (h^2 / 4) in the torques.
        error = out_of_balance(model, path, y0, v0, a, h, force, D)
        assert np.abs(error).max() < 1e-13 * (model.stiffness.max() + 10.0 * 4 / h**2)
        assert run.place_at(w, 1.0) is None
        q = model.configuration(path[2], y1)
        np.testing.assert_allclose(w[layout.tip : layout.tip + 3], frame_placement(model, q, model.tip).translation, atol=1e-12)
