"""Equilibria in MuJoCo, from MJCF text: where its own generalised forces balance, and where its simulation comes to rest."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged, ParameterError
from studies.interop.newton import balance_point
from studies.interop.outcomes import ITSELF, SECONDS, Outcome, Question
from studies.interop.tools import find_tool

REFRESH = 50
"""Steps after which the load is written anew (0.1 s at MuJoCo's default time step)."""


def static_equilibrium(question: Question) -> Outcome:
    """Find where MuJoCo's passive forces, bias forces and the force at the tip are in balance, from the relaxed springs.

    In balance is `qfrc_passive - qfrc_bias + J^T f = 0` at rest: springs, weight and load. Contacts are counted, not felt.

    Args:
        question: An MJCF file, which has its own gravity, and the load.

    Returns:
        The equilibrium.

    Raises:
        MissingDependency: If MuJoCo is not installed.
        NotConverged: If the forces do not come into balance.
    """
    mujoco, model, data, body = _loaded(question)
    jacobian, force = np.zeros((3, model.nv)), np.array(question.force)

    def balance(q: FloatArray) -> FloatArray:
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_jacBody(model, data, jacobian, None, body)
        return np.asarray(data.qfrc_passive - data.qfrc_bias + jacobian.T @ force)

    began = time.perf_counter()
    q, iterations = balance_point(balance, model.qpos_spring.copy())
    elapsed = time.perf_counter() - began
    balance(q)
    return Outcome(_joints(model, q), 0.0, int(data.ncon), iterations, elapsed)


def simulate(question: Question, seconds: float = SECONDS) -> Outcome:
    """Simulate with the settings of the file from the relaxed springs at rest, contacts on.

    The load is `xfrc_applied`, which acts at the centre of mass of the body: a moment moves the force to the body's origin, and
    is written anew as the body turns, every `REFRESH` steps.

    Args:
        question: An MJCF file, which has its own gravity, and the load.
        seconds: How long [s].

    Returns:
        Where it ends.

    Raises:
        MissingDependency: If MuJoCo is not installed.
        NotConverged: If MuJoCo found the simulation unstable, which it then starts anew.
    """
    mujoco, model, data, body = _loaded(question)
    data.qpos[:] = model.qpos_spring
    mujoco.mj_forward(model, data)
    total, done, contacts, force = round(seconds / model.opt.timestep), 0, 0, np.array(question.force)
    began = time.perf_counter()
    while done < total:
        arm = data.xpos[body] - data.xipos[body]
        data.xfrc_applied[body] = np.concatenate([force, np.cross(arm, force)])
        count = min(REFRESH, total - done)
        mujoco.mj_step(model, data, nstep=count)
        done += count
        contacts = max(contacts, int(data.ncon))
    elapsed = time.perf_counter() - began
    kinds = mujoco.mjtWarning
    bad = [data.warning[int(kind)].number for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)]
    if any(bad):
        message = f"MuJoCo found its simulation unstable {sum(bad)} times in {seconds:g} s and started it anew"
        raise NotConverged(message, best=_joints(model, data.qpos), residual=float("inf"), iterations=done)
    forces = obstacle_forces(mujoco, model, data)
    return Outcome(_joints(model, data.qpos), float(np.abs(data.qvel).max(initial=0.0)), contacts, done, elapsed, forces)


def obstacle_forces(mujoco: Any, model: Any, data: Any) -> dict[str, FloatArray]:
    """Return the forces of what touches the robot, see `Outcome.forces`; obstacles are the geoms with names."""
    forces: dict[str, FloatArray] = {}
    pressed = np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        mujoco.mj_contactForce(model, data, number, pressed)
        on_second = contact.frame.reshape(3, 3).T @ pressed[:3]  # of the pair of geoms
        first, second = (model.geom(geom).name for geom in contact.geom.tolist())
        force = on_second if first else -on_second if second else pressed[:1]
        forces[first or second or ITSELF] = forces.get(first or second or ITSELF, 0.0) + np.array(force)
    return forces


def tip_pose(question: Question, joints: Mapping[str, float]) -> FloatArray:
    """Where MuJoCo has the tip, by its own kinematics.

    Args:
        question: An MJCF file; its load does not matter.
        joints: Coordinate of every joint by its name [rad or m], as of an `Outcome`.

    Returns:
        Pose of the tip in the world, shape (4, 4) [m].

    Raises:
        MissingDependency: If MuJoCo is not installed.
        ParameterError: If the joints are not those of the file.
    """
    mujoco, model, data, body = _loaded(question)
    names = [model.joint(i).name for i in range(model.njnt)]
    if sorted(names) != sorted(joints):
        raise ParameterError("joints", sorted(joints), f"the joints of the file, {', '.join(names)}")
    for name, value in joints.items():
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
    mujoco.mj_kinematics(model, data)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return pose


def _loaded(question: Question) -> tuple[Any, Any, Any, int]:
    mujoco = find_tool("MuJoCo").load()
    model = mujoco.MjModel.from_xml_string(question.text)
    return mujoco, model, mujoco.MjData(model), int(model.body(question.tip).id)


def _joints(model: Any, qpos: FloatArray) -> dict[str, float]:
    return {model.joint(i).name: float(qpos[model.jnt_qposadr[i]]) for i in range(model.njnt)}
