"""Balance of our answers in MuJoCo."""

from __future__ import annotations

from types import ModuleType

import numpy as np

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
