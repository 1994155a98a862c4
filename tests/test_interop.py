"""The shipped URDF in other tools: every link is where Pinocchio puts it, and nothing of the mass is lost."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softrobots as sr
from softrobots.kinematics import frame_placement
from softrobots.paths import urdf_folder
from tests.conftest import missing

FILE = urdf_folder() / "inflatable_arm.urdf"


@pytest.fixture
def configurations(arm: sr.SoftModel) -> Iterator[tuple[dict[str, float], np.ndarray]]:
    rng = np.random.default_rng(5)
    names = (*arm.motor_joints, *arm.spring_joints)
    return [
        (dict(zip(names, values, strict=True)), arm.configuration(values[:3], values[3:]))
        for values in np.c_[rng.uniform(-3, 3, (20, 3)), rng.uniform(-1.5, 1.5, (20, 4))]
    ]


LINKS = ("base_link", "shoulder", "link_1_root", "hinge_1", "link_1", "link_2_root", "hinge_2", "link_2", "tip")


def test_mujoco(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    mujoco = tool("mujoco")
    model = mujoco.MjModel.from_xml_path(str(FILE))
    data = mujoco.MjData(model)
    assert model.nq == 7
    assert model.body_mass.sum() == pytest.approx(2.0 + sum(i.mass for i in arm.pinocchio.inertias[1:]), rel=1e-12)
    for values, q in configurations:
        for name, value in values.items():
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        for link in LINKS:
            ours = frame_placement(arm, q, link)
            assert np.allclose(data.body(link).xpos, ours.translation, atol=1e-9)
            assert np.allclose(data.body(link).xmat.reshape(3, 3), ours.rotation, atol=1e-9)


def test_mujoco_reaches_the_same_equilibrium_when_told_the_stiffness(
    tool: Callable[[str], ModuleType], arm: sr.SoftModel
) -> None:
    """MuJoCo drops the springs of a URDF, so they are set by hand; its own static torques then vanish at our answer."""
    mujoco = tool("mujoco")
    model = mujoco.MjModel.from_xml_path(str(FILE))
    for name, (stiffness, rest) in arm.spring_table.items():
        joint = model.joint(name)
        model.jnt_stiffness[joint.id] = stiffness
        model.qpos_spring[joint.qposadr[0]] = rest
    model.opt.gravity[:] = sr.EARTH_GRAVITY
    data = mujoco.MjData(model)
    motors, force = (0.3, 0.6, -0.8), np.array([0.0, 10.0, -15.0])
    found = sr.solve_equilibrium(arm, motors, force, gravity=sr.EARTH_GRAVITY)
    for name, value in zip((*arm.motor_joints, *arm.spring_joints), (*found.q_motors, *found.q_springs), strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body("tip").id)
    balance = jacobian.T @ force + data.qfrc_passive - data.qfrc_bias
    springs = [model.joint(name).dofadr[0] for name in arm.spring_joints]
    assert np.abs(balance[springs]).max() < 1e-8
    assert data.ncon == 0  # no collision shapes touch across a hinge


def test_drake(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(FILE))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.num_positions() == 7
    for values, q in configurations:
        for name, value in values.items():
            plant.GetJointByName(name).set_angle(context, value)
        for link in LINKS:
            pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(link)).GetAsMatrix4()
            assert np.allclose(pose, frame_placement(arm, q, link).homogeneous, atol=1e-9)


def test_pybullet(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    """Single precision inside: 1e-5."""
    if sys.version_info >= (3, 12):
        pytest.skip("pybullet has no wheels above Python 3.11")
    pybullet = tool("pybullet")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(FILE), useFixedBase=True, physicsClientId=client)
        info = [pybullet.getJointInfo(robot, i, physicsClientId=client) for i in range(pybullet.getNumJoints(robot, client))]
        places = {row[1].decode(): row[0] for row in info}
        links = {row[12].decode(): row[0] for row in info}
        for values, q in configurations:
            for name, value in values.items():
                pybullet.resetJointState(robot, places[name], value, physicsClientId=client)
            for link in LINKS:
                state = pybullet.getLinkState(robot, links[link], computeForwardKinematics=True, physicsClientId=client)
                assert np.allclose(state[4], frame_placement(arm, q, link).translation, atol=1e-5)
        masses = [pybullet.getDynamicsInfo(robot, place, physicsClientId=client)[0] for place in links.values()]
        assert sum(masses) == pytest.approx(2.0 + sum(i.mass for i in arm.pinocchio.inertias[1:]), rel=1e-6)
    finally:
        pybullet.disconnect(client)


def test_a_third_party_robot_with_springs_said_by_the_caller() -> None:
    """The UR5 of example-robot-data, with a soft wrist: kinematics as in yourdfpy, springs in balance."""
    import yourdfpy

    try:
        distribution = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        missing("example-robot-data is not installed")
    place = "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
    file = Path(distribution.locate_file(place)).resolve()
    model = sr.load_model(file, springs={"wrist_1_joint": 40.0, "wrist_3_joint": (25.0, 0.1)}, tip="tool0")
    assert model.motor_joints == ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_2_joint")
    motors = (0.3, -1.0, 1.2, 0.4)
    found = sr.solve_equilibrium(model, motors, (3, 5, -10), gravity=sr.EARTH_GRAVITY)
    assert found.stable
    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    names = (*model.motor_joints, *model.spring_joints)
    robot.update_cfg(dict(zip(names, (*found.q_motors, *found.q_springs), strict=True)))
    assert np.allclose(robot.get_transform("tool0", "world"), found.transform_tip_to_world.homogeneous, atol=1e-12)
    reached = sr.solve_ik(model, found.tip_position, (3, 5, -10), gravity=sr.EARTH_GRAVITY, q_motors0=motors, starts=4)
    assert reached.error <= 1e-9
