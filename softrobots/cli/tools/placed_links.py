"""Where each tool places the links of a URDF file: one adapter per tool, a function of its module and the file."""

from __future__ import annotations

import contextlib
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from softrobots.cli.tools.known_tools import Tool
from softrobots.core.checks import FloatArray
from softrobots.description.rigid_tree_urdf import link_at

Poses = Mapping[str, FloatArray]
"""Pose of each link in the world by its name, each (4, 4) [m]."""


class LoadedRobot(NamedTuple):
    """A robot in a tool."""

    joints: tuple[str, ...]
    """Movable joints that the tool knows and that can be set."""
    poses: Callable[[Mapping[str, float]], Poses]
    """Poses of all links that the tool keeps, for coordinates by joint name [rad or m]; other names are ignored."""
    close: Callable[[], object] = lambda: None
    """Gives back what the tool holds."""


@contextlib.contextmanager
def open_in(tool: Tool, file: Path) -> Iterator[LoadedRobot]:
    """Load a URDF file in a tool; what the tool holds is given back at the end.

    Raises:
        MissingDependency: If the tool is not installed.
        Exception: Whatever it raises if it refuses the file.
    """
    robot = _ADAPTERS[tool.name](tool.load(), file)
    try:
        yield robot
    finally:
        robot.close()


def _carriers(file: Path) -> dict[str, ElementTree.Element]:
    """The joint that carries each link of a URDF file, by the name of the link."""
    return {link_at(joint, "child"): joint for joint in ElementTree.parse(file).getroot().findall("joint")}


def _mimicking(file: Path) -> tuple[str, ...]:
    """Joints that mimic others; yourdfpy and urchin move them by themselves."""
    return tuple(joint.get("name", "") for joint in _carriers(file).values() if joint.find("mimic") is not None)


def _along_the_tree(file: Path, steps: Callable[[str, str], FloatArray]) -> dict[str, FloatArray]:
    """Poses of all links from the pose of each in its parent, `steps(child, parent)`."""
    carriers = _carriers(file)
    poses: dict[str, FloatArray] = {}
    for link in carriers:
        path = [link]
        while path[-1] in carriers and path[-1] not in poses:
            path.append(link_at(carriers[path[-1]], "parent"))
        poses.setdefault(path[-1], np.eye(4))
        for child, parent in zip(path[-2::-1], path[:0:-1], strict=True):
            poses[child] = poses[parent] @ steps(child, parent)
    return poses


def _homogeneous(rotation: Any, translation: Any) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.reshape(rotation, (3, 3)), translation
    return pose


def _yourdfpy(yourdfpy: Any, file: Path) -> LoadedRobot:
    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    names = tuple(robot.actuated_joint_names)

    def poses(values: Mapping[str, float]) -> Poses:
        robot.update_cfg({name: values[name] for name in names if name in values})
        return _along_the_tree(file, robot.get_transform)  # from link to link: from the world it is quadratic in their number

    return LoadedRobot((*names, *_mimicking(file)), poses)


def _urchin(urchin: Any, file: Path) -> LoadedRobot:
    robot = urchin.URDF.load(str(file), lazy_load_meshes=True)
    names = tuple(joint.name for joint in robot.actuated_joints)

    def poses(values: Mapping[str, float]) -> Poses:
        placed = robot.link_fk(cfg={name: values[name] for name in names if name in values}, use_names=True)
        return {str(name): np.asarray(pose) for name, pose in placed.items()}

    return LoadedRobot((*names, *_mimicking(file)), poses)


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
        return _along_the_tree(file, in_parent)

    return LoadedRobot((*names, *_mimicking(file)), poses)


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
    carriers = _carriers(file)
    root = next(link.get("name", "") for link in ElementTree.parse(file).iter("link") if link.get("name") not in carriers)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Link .* is of type 'fixed'")  # a hint for inverse kinematics
        chain = chains.Chain.from_urdf_file(str(file), base_elements=[root])
    link_of = {joint.get("name", ""): link for link, joint in carriers.items()}
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
    carriers = _carriers(file)
    joints = {carriers[link.name].get("name", ""): link.jindex for link in robot.links if link.isjoint}

    def poses(values: Mapping[str, float]) -> Poses:
        q = np.zeros(robot.n)
        for joint, place in joints.items():
            q[place] = values.get(joint, 0.0)
        placed = robot.fkine_all(q)
        return {link.name: placed[link.number].A for link in robot.links}

    return LoadedRobot(tuple(joints), poses)


_ADAPTERS: Mapping[str, Callable[[Any, Path], LoadedRobot]] = {
    "yourdfpy": _yourdfpy,
    "MuJoCo": _mujoco,
    "Drake": _drake,
    "PyBullet": _pybullet,
    "urchin": _urchin,
    "ikpy": _ikpy,
    "roboticstoolbox": _roboticstoolbox,
    "viser": _viser,
}
