"""How many joint springs of a file arrive in a simulator: joints are displaced, and those that push back are counted."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice
from studies.interop.tools import find_tool

FORMATS: Mapping[str, str] = {"URDF": "urdf", "MJCF": "xml", "SDF": "sdf"}
"""File formats, and the ending by which tools know them."""

_DISPLACEMENT = 0.1  # [rad or m]


def springs_read(tool: str, text: str, file_format: str) -> int | None:
    """Count the joints that push back when they are displaced, without gravity.

    Args:
        tool: "MuJoCo", "Drake" or "PyBullet".
        text: The file.
        file_format: One of `FORMATS`.

    Returns:
        How many; None if the tool refuses the file.

    Raises:
        ParameterError: If tool or format are others.
        MissingDependency: If the tool is not installed.
    """
    choice("tool", tool, list(_PUSHES))
    ending = FORMATS[choice("file_format", file_format, list(FORMATS))]
    module = find_tool(tool).load()
    with tempfile.TemporaryDirectory(prefix="softrobots-") as folder, _silence():
        file = Path(folder) / f"robot.{ending}"
        file.write_text(text, encoding="utf-8")
        try:
            pushes = _PUSHES[tool](module, file)
        except Exception:  # a tool raises what it likes if it refuses a file
            return None
    return int(np.count_nonzero(pushes))


def _mujoco(mujoco: Any, file: Path) -> FloatArray:
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0 + _DISPLACEMENT
    mujoco.mj_forward(model, data)
    return np.array(data.qfrc_passive)


def _drake(_: Any, file: Path) -> FloatArray:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(file))
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    plant.SetPositions(context, plant.GetPositions(context) + _DISPLACEMENT)
    plant.CalcForceElementsContribution(context, forces)
    return np.array(forces.generalized_forces())


def _pybullet(pybullet: Any, file: Path) -> FloatArray:
    """PyBullet tells no torques of its own, but what pushes back has a speed after a step."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        load = {".urdf": pybullet.loadURDF, ".xml": pybullet.loadMJCF, ".sdf": pybullet.loadSDF}[file.suffix]
        loaded = load(str(file), physicsClientId=client)
        joints = [
            (robot, joint)
            for robot in ((loaded,) if isinstance(loaded, int) else loaded)
            for joint in range(pybullet.getNumJoints(robot, physicsClientId=client))
            if pybullet.getJointInfo(robot, joint, physicsClientId=client)[2] != pybullet.JOINT_FIXED
        ]
        for robot, joint in joints:
            pybullet.resetJointState(robot, joint, _DISPLACEMENT, physicsClientId=client)
            pybullet.setJointMotorControl2(robot, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)
        pybullet.stepSimulation(physicsClientId=client)
        return np.array([pybullet.getJointState(robot, joint, physicsClientId=client)[1] for robot, joint in joints])
    finally:
        pybullet.disconnect(client)


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Send what a tool prints by itself, past Python, to nowhere."""
    kept = [(number, os.dup(number)) for number in (1, 2)]
    try:
        with Path(os.devnull).open("wb") as nowhere:
            for number, _ in kept:
                os.dup2(nowhere.fileno(), number)
        yield
    finally:
        for number, copy in kept:
            os.dup2(copy, number)
            os.close(copy)


_PUSHES: Mapping[str, Callable[[Any, Path], FloatArray]] = {"MuJoCo": _mujoco, "Drake": _drake, "PyBullet": _pybullet}
