"""Balance of our answers in MuJoCo, and MuJoCo's own equilibria."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import softrobots as sr
from softrobots.robots import Robot


def assert_mujoco_balances(mujoco: ModuleType, robot: Robot, force: np.ndarray, gravity: np.ndarray) -> sr.Equilibrium:
    """Under its weight and a tip force, with the stiffness set by hand: MuJoCo's static torques vanish at our answer.

    1e-8 N m: the solver stops at 1e-10 of some newton metres, MuJoCo's bias forces round at 1e-15 of each of 56 joints.
    """
    ours = sr.load_model(robot)
    found = sr.solve_equilibrium(ours, [], force, gravity=gravity)
    model = mujoco.MjModel.from_xml_string(robot.urdf())
    data = mujoco.MjData(model)
    assert {model.joint(i).name for i in range(model.njnt)} == set(ours.spring_joints)
    model.opt.gravity[:] = gravity
    for name, value in zip(ours.spring_joints, found.q_springs, strict=True):
        joint = model.joint(name)
        model.jnt_stiffness[joint.id], model.qpos_spring[joint.qposadr[0]] = ours.spring_table[name]
        data.qpos[joint.qposadr[0]] = value
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body("tip").id)
    balance = jacobian.T @ force + data.qfrc_passive - data.qfrc_bias
    assert np.abs(balance).max() < 1e-8
    assert np.allclose(data.body("tip").xpos, found.tip_position, atol=1e-12)
    assert data.ncon == 0
    return found


def mujoco_equilibrium(mujoco: ModuleType, text: str, ctrl: ArrayLike, force: ArrayLike, start: ArrayLike = 0.0) -> Any:
    """Where MuJoCo's generalised forces balance under a dead force at the tip, by Newton's method from `start`: its data there.

    Contacts are off. The derivative is that of central differences, taken again where steps do not become ten times smaller.
    """
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data.ctrl[:], tip = ctrl, model.body("tip").id

    def balance(q: np.ndarray) -> np.ndarray:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, jacobian, None, tip)
        return np.asarray(jacobian.T @ force + data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias)

    q, changes, last, inverse = np.zeros(model.nv) + start, 1e-6 * np.eye(model.nv), 0.0, np.zeros((model.nv, model.nv))
    for _ in range(40):
        step = -inverse @ balance(q)
        if not np.abs(step).max() < 0.1 * last:
            inverse = np.linalg.inv(np.array([balance(q + change) - balance(q - change) for change in changes]).T / 2e-6)
            step = -inverse @ balance(q)
        last = float(np.abs(step).max())
        q = q + step * min(1.0, 0.2 / last)
        if last < 1e-8:
            balance(q)
            return data
    raise AssertionError(f"MuJoCo does not balance: the last step is {last}")
