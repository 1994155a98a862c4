"""Where each tool places the links of a URDF file: one adapter per tool, a function of its module and the file."""

from __future__ import annotations

import contextlib
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from softrobots.cli.tools.kinematics import LoadedRobot, Poses, carriers, in_yourdfpy, mimicking, poses_along_tree
from softrobots.core.checks import FloatArray
from studies.interop.tools import Tool


def open_in(tool: Tool, file: Path) -> LoadedRobot:
    """Load a URDF file in a tool.

    Raises:
        MissingDependency: If the tool is not installed.
        Exception: Whatever it raises if it refuses the file.
    """
    return _ADAPTERS[tool.name](tool.load(), file)


def _homogeneous(rotation: Any, translation: Any) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.reshape(rotation, (3, 3)), translation
    return pose


def _urchin(urchin: Any, file: Path) -> LoadedRobot:
    robot = urchin.URDF.load(str(file), lazy_load_meshes=True)
    names = tuple(joint.name for joint in robot.actuated_joints)

    def poses(values: Mapping[str, float]) -> Poses:
        placed = robot.link_fk(cfg={name: values[name] for name in names if name in values}, use_names=True)
        return {str(name): np.asarray(pose) for name, pose in placed.items()}

    return LoadedRobot((*names, *mimicking(file)), poses)


def _viser(extras: Any, file: Path) -> LoadedRobot:
    """Record what `ViserUrdf` would send to a server: no port is opened, and shapes are dropped."""
    import pinocchio as pin

    frames: dict[str, Any] = {}

    def add_frame(name: str, **_: Any) -> Any:
        frame = frames[name.rpartition("/")[2]] = SimpleNamespace(wxyz=(1.0, 0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0))
        return frame

    scene = SimpleNamespace(add_frame=add_frame, add_mesh_trimesh=lambda name, mesh: None)
    robot = extras.ViserUrdf(SimpleNamespace(scene=scene), file)
    names = robot.get_actuated_joint_names()

    def in_parent(child: str, parent: str) -> FloatArray:
        w, x, y, z = frames[child].wxyz
        return _homogeneous(pin.Quaternion(w, x, y, z).toRotationMatrix(), frames[child].position)

    def poses(values: Mapping[str, float]) -> Poses:
        robot.update_cfg(np.array([values.get(name, 0.0) for name in names]))
        return poses_along_tree(file, in_parent)

    return LoadedRobot((*names, *mimicking(file)), poses)


def _mujoco(mujoco: Any, file: Path) -> LoadedRobot:
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    places = {model.joint(i).name: model.jnt_qposadr[i] for i in range(model.njnt)}
    bodies = {model.body(i).name: i for i in range(model.nbody)}

    def poses(values: Mapping[str, float]) -> Poses:
        for name, place in places.items():
            data.qpos[place] = values.get(name, 0.0)
        mujoco.mj_kinematics(model, data)
        return {name: _homogeneous(data.xmat[i], data.xpos[i]) for name, i in bodies.items()}

    return LoadedRobot(tuple(places), poses)


def _drake(_: Any, file: Path) -> LoadedRobot:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import BodyIndex

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(file)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    places = {joint.name(): joint.position_start() for joint in joints if joint.num_positions() == 1}
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]

    def poses(values: Mapping[str, float]) -> Poses:
        q = plant.GetPositions(context)
        for name, place in places.items():
            q[place] = values.get(name, 0.0)
        plant.SetPositions(context, q)
        return {body.name(): plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4() for body in bodies}

    return LoadedRobot(tuple(places), poses)


def _pybullet(pybullet: Any, file: Path) -> LoadedRobot:
    with contextlib.ExitStack() as stack:
        client = pybullet.connect(pybullet.DIRECT)
        stack.callback(pybullet.disconnect, client)
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)  # or a path keeps its first content
        robot = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        count = pybullet.getNumJoints(robot, physicsClientId=client)
        info = [pybullet.getJointInfo(robot, i, physicsClientId=client) for i in range(count)]
        moving = {row[1].decode(): row[0] for row in info if row[2] in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC)}
        links = {row[12].decode(): row[0] for row in info}
        root = pybullet.getBodyInfo(robot, physicsClientId=client)[0].decode()

        def poses(values: Mapping[str, float]) -> Poses:
            for name, place in moving.items():
                pybullet.resetJointState(robot, place, values.get(name, 0.0), physicsClientId=client)
            placed = {root: np.eye(4)}
            for name, place in links.items():
                state = pybullet.getLinkState(robot, place, computeForwardKinematics=True, physicsClientId=client)
                placed[name] = _homogeneous(pybullet.getMatrixFromQuaternion(state[5]), state[4])
            return placed

        return LoadedRobot(tuple(moving), poses, stack.pop_all().close)


def _ikpy(chains: Any, file: Path) -> LoadedRobot:
    """The first chain from the root to an end: ikpy follows the first joint of the file at a branch."""
    carrier_of = carriers(file)
    root = next(link.get("name", "") for link in ElementTree.parse(file).iter("link") if link.get("name") not in carrier_of)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Link .* is of type 'fixed'")  # a hint for inverse kinematics
        chain = chains.Chain.from_urdf_file(str(file), base_elements=[root])
    link_of = {joint.get("name", ""): link for link, joint in carrier_of.items()}
    names = [link.name for link in chain.links[1:]]  # the first is the root; its links are the joints of the file

    def poses(values: Mapping[str, float]) -> Poses:
        coordinates = [0.0, *(values.get(name, 0.0) for name in names)]
        placed = chain.forward_kinematics(coordinates, full_kinematics=True)
        return dict(zip((root, *(link_of[name] for name in names)), placed, strict=True))

    return LoadedRobot(tuple(link.name for link in chain.links[1:] if link.joint_type != "fixed"), poses)


def _roboticstoolbox(roboticstoolbox: Any, file: Path) -> LoadedRobot:
    from roboticstoolbox.models.URDF.URDFRobot import URDF_read

    links, name, _ = URDF_read(file.resolve())
    robot = roboticstoolbox.Robot(links, name=name)
    carrier_of = carriers(file)
    joints = {carrier_of[link.name].get("name", ""): link.jindex for link in robot.links if link.isjoint}

    def poses(values: Mapping[str, float]) -> Poses:
        q = np.zeros(robot.n)
        for joint, place in joints.items():
            q[place] = values.get(joint, 0.0)
        placed = robot.fkine_all(q)
        return {link.name: placed[link.number].A for link in robot.links}

    return LoadedRobot(tuple(joints), poses)


_ADAPTERS: Mapping[str, Callable[[Any, Path], LoadedRobot]] = {
    "yourdfpy": lambda _, file: in_yourdfpy(file),
    "MuJoCo": _mujoco,
    "Drake": _drake,
    "PyBullet": _pybullet,
    "urchin": _urchin,
    "ikpy": _ikpy,
    "roboticstoolbox": _roboticstoolbox,
    "viser": _viser,
}
