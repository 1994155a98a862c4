"""Robots in the formats of simulators: MuJoCo and Drake read what we write, and balance where our statics says.

Oracles are MuJoCo's and Drake's own kinematics, mass matrices and static torques, and Pinocchio's.
"""

from __future__ import annotations

import importlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.description.third_party import UR5, robot_file
from softrobots.export import FORMATS, export_model, to_mjcf, to_sdf
from softrobots.export.meshes import mujoco_reads
from tests.conftest import missing
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint, mass_error

Tool = Callable[[str], ModuleType]

WRIST = (
    f'<robot name="massless"><link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>'
    '<joint name="turn" type="continuous"><parent link="base"/><child link="wrist"/>'
    '<origin xyz="0 0.1 0.2" rpy="0.4 0.5 0.6"/><axis xyz="1 2 2"/><limit effort="10" velocity="3"/></joint>'
    '<link name="wrist"><collision><origin xyz="0 0 -0.05"/><geometry><sphere radius="0.2"/></geometry></collision></link>'
    '<joint name="a" type="fixed"><origin xyz="0.01 0.1 0.2" rpy="0.4 0.5 0.6"/><parent link="wrist"/>'
    '<child link="hand"/></joint>'
    '<link name="hand"><inertial><origin xyz="0.1 0.02 0" rpy="0.3 0.2 0.1"/><mass value="0.7"/>'
    '<inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>'
    '<joint name="b" type="fixed"><origin xyz="0.02 0 0.2" rpy="-0.4 0.5 0.6"/><parent link="wrist"/>'
    '<child link="thumb"/></joint>'
    f'<link name="thumb">{INERTIAL}</link>'
    '<joint name="c" type="fixed"><origin xyz="0.03 0.1 0" rpy="0.4 -0.5 0.6"/><parent link="hand"/>'
    '<child link="tool"/></joint>'
    '<link name="tool"/>' + joint("slide", "tool", "finger", "0 1 2", "prismatic") + "</robot>"
)
"""A base and links without mass, fixed to others with mass; shapes that overlap."""


@dataclass(frozen=True)
class Case:
    """A robot, actuator coordinates, a tip force and gravity."""

    model: sr.SoftModel
    motors: tuple[float, ...]
    force: tuple[float, float, float]
    gravity: tuple[float, float, float] | None


def _pcc(**options: Any) -> sr.SoftModel:
    return sr.load_model(sr.PccArm(chain="lumped", hinges=5), **options)


CASES: Mapping[str, Callable[[], Case]] = {
    "arm": lambda: Case(sr.load_model(sr.InflatableArm()), (0.3, 0.6, -0.8), (0, 10, -15), sr.EARTH_GRAVITY),
    "wrist": lambda: Case(
        sr.load_model(sr.InflatableArm(wrist=(0.08, 0.12))), (0.3, 0.6, -0.8, 0.4, 0.5, 0.6), (0, 10, -15), sr.EARTH_GRAVITY
    ),
    "rest angles": lambda: Case(
        sr.load_model(sr.InflatableArm(rest_side=(0.2, -0.1), rest_up=(-0.3, 0.05))), (1.0, -0.4, 0.9), (4, -6, 9), None
    ),
    "tensions": lambda: Case(_pcc(muscles="forces"), (20, 5, -10, 30, 3, 0), (3, -2, 1), sr.EARTH_GRAVITY),
    "helix": lambda: Case(sr.load_model(sr.HelixTube(chain="lumped", hinges=9)), (), (0.01, -0.02, -0.03), sr.EARTH_GRAVITY),
    "branched": lambda: Case(
        sr.load_model(BRANCHED, springs=SPRINGS, motors=["shoulder", "elbow"], tip="finger"),
        (2.5, -0.7),
        (3, -4, 5),
        (1.0, 2.0, -9.0),
    ),
    "massless": lambda: Case(
        sr.load_model(WRIST, springs={"turn": (30.0, 0.2), "slide": 500.0}, tip="finger"), (), (3, -4, 5), sr.EARTH_GRAVITY
    ),
}


@cache
def case_of(name: str) -> Case:
    return CASES[name]()


@pytest.fixture(params=list(CASES))
def case(request: pytest.FixtureRequest) -> Case:
    return case_of(request.param)


def joint_values(model: sr.SoftModel, q: np.ndarray) -> dict[str, float]:
    """Coordinate by joint of a Pinocchio configuration."""
    made = {}
    for number in range(1, model.pinocchio.njoints):
        at, kind = model.pinocchio.joints[number].idx_q, model.pinocchio.joints[number]
        made[model.pinocchio.names[number]] = float(q[at] if kind.nq == 1 else np.arctan2(q[at + 1], q[at]))
    return made


def random_configurations(model: sr.SoftModel, count: int = 5) -> list[np.ndarray]:
    rng = np.random.default_rng(11)
    spread = np.array([0.02 if name.startswith("JointModelP") else 1.2 for name in kinds(model)])
    return [model.embed(spread * rng.uniform(-1, 1, model.pinocchio.nv)) for _ in range(count)]


def kinds(model: sr.SoftModel) -> list[str]:
    return [model.pinocchio.joints[number].shortname() for number in range(1, model.pinocchio.njoints)]


def bodies_of(model: sr.SoftModel) -> list[str]:
    return [frame.name for frame in model.pinocchio.frames if frame.type == pin.FrameType.BODY and frame.name != "universe"]


def pinocchio_poses(model: sr.SoftModel, q: np.ndarray) -> dict[str, np.ndarray]:
    data = model.pinocchio.createData()
    pin.framesForwardKinematics(model.pinocchio, data, q)
    return {name: data.oMf[model.frame_id(name)].homogeneous.copy() for name in bodies_of(model)}


def pinocchio_mass(model: sr.SoftModel, q: np.ndarray) -> np.ndarray:
    return pin.crba(model.pinocchio, model.pinocchio.createData(), q)


class InMujoco:
    """An exported robot in MuJoCo."""

    def __init__(self, mujoco: ModuleType, text: str) -> None:
        self.mujoco, self.model = mujoco, mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)

    def put(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            if mujoco_has(self, name):
                self.data.qpos[self.model.joint(name).qposadr[0]] = value
        self.mujoco.mj_forward(self.model, self.data)

    def dofs(self, names: list[str]) -> list[int]:
        return [int(self.model.joint(name).dofadr[0]) for name in names]

    def mass(self) -> np.ndarray:
        made = np.zeros((self.model.nv, self.model.nv))
        for column, unit in zip(made, np.eye(self.model.nv), strict=True):  # mj_fullM is called otherwise in MuJoCo 3
            self.mujoco.mj_mulM(self.model, self.data, column, unit)
        return made

    def pose(self, name: str) -> np.ndarray:
        body, made = self.data.body(name), np.eye(4)
        made[:3, :3], made[:3, 3] = body.xmat.reshape(3, 3), body.xpos
        return made

    def jacobian(self, name: str) -> np.ndarray:
        made = np.zeros((3, self.model.nv))
        self.mujoco.mj_jacBody(self.model, self.data, made, None, self.model.body(name).id)
        return made

    def settle(self, seconds: float) -> None:
        self.mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        self.mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))


def mujoco_has(robot: InMujoco, name: str) -> bool:
    return robot.mujoco.mj_name2id(robot.model, robot.mujoco.mjtObj.mjOBJ_JOINT, name) >= 0


class InDrake:
    """An exported robot in Drake."""

    def __init__(self, text: str, gravity: tuple[float, float, float] | None = None) -> None:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
        from pydrake.systems.framework import DiagramBuilder

        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
        Parser(self.plant).AddModelsFromString(text, "sdf")
        self.plant.mutable_gravity_field().set_gravity_vector(np.zeros(3) if gravity is None else gravity)
        self.plant.Finalize()
        self._diagram = builder.Build()
        self._root = self._diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self._root)

    def put(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            if self.plant.HasJointNamed(name) and self.plant.GetJointByName(name).num_velocities():
                found = self.plant.GetJointByName(name)
                (found.set_angle if hasattr(found, "set_angle") else found.set_translation)(self.context, value)

    def dofs(self, names: list[str]) -> list[int]:
        return [self.plant.GetJointByName(name).velocity_start() for name in names]

    def mass(self) -> np.ndarray:
        return np.asarray(self.plant.CalcMassMatrix(self.context))

    def pose(self, name: str) -> np.ndarray:
        return np.asarray(self.plant.GetFrameByName(name).CalcPoseInWorld(self.context).GetAsMatrix4())

    def balance(self, name: str, force: np.ndarray) -> np.ndarray:
        from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

        plant, forces = self.plant, MultibodyForces(self.plant)
        plant.CalcForceElementsContribution(self.context, forces)  # springs and gravity
        world = plant.world_frame()
        jacobian = plant.CalcJacobianTranslationalVelocity(
            self.context, JacobianWrtVariable.kV, plant.GetFrameByName(name), np.zeros(3), world, world
        )
        return np.asarray(
            jacobian.T @ force - plant.CalcInverseDynamics(self.context, np.zeros(plant.num_velocities()), forces)
        )

    def contacts(self) -> int:
        query = self.plant.get_geometry_query_input_port().Eval(self.context)
        return len(query.ComputePointPairPenetration())


def equilibrium(case: Case) -> sr.Equilibrium:
    return sr.solve_equilibrium(case.model, case.motors, case.force, gravity=case.gravity)


def spring_load(case: Case, found: sr.Equilibrium) -> float:
    """Largest torque of a spring [N m or N], the size of the balance."""
    return float(np.abs(found.spring_torques).max()) + float(np.abs(found.motor_torques).max(initial=0.0))


# --- Geometry and masses


@pytest.mark.study
def test_mjcf_has_the_kinematics_and_the_mass_matrix_of_the_robot(tool: Tool, case: Case) -> None:
    robot = InMujoco(tool("mujoco"), to_mjcf(case.model) if not case.model.muscles else welded_mjcf(case))
    names = list(case.model.pinocchio.names)[1:]
    dofs = robot.dofs(names)
    assert robot.model.nv == case.model.pinocchio.nv
    for q in random_configurations(case.model):
        robot.put(joint_values(case.model, q))
        for name, pose in pinocchio_poses(case.model, q).items():
            if name != "world":
                assert np.abs(robot.pose(name) - pose).max() < 1e-12  # rounding of a chain of a hundred joints
        mass = pinocchio_mass(case.model, q)
        assert np.abs(robot.mass()[np.ix_(dofs, dofs)] - mass).max() <= mass_error(robot.mujoco) * np.abs(mass).max()


def test_sdf_has_the_kinematics_and_the_mass_matrix_of_the_robot(tool: Tool, case: Case) -> None:
    tool("pydrake")
    robot = InDrake(to_sdf(case.model) if not case.model.muscles else welded_sdf(case))
    dofs = robot.dofs(list(case.model.pinocchio.names)[1:])
    assert robot.plant.num_velocities() == case.model.pinocchio.nv
    for q in random_configurations(case.model, 3):
        robot.put(joint_values(case.model, q))
        for name, pose in pinocchio_poses(case.model, q).items():
            if name != "world":
                assert np.abs(robot.pose(name) - pose).max() < 1e-12
        mass = pinocchio_mass(case.model, q)
        assert np.abs(robot.mass()[np.ix_(dofs, dofs)] - mass).max() <= 1e-12 * np.abs(mass).max()


def test_nothing_of_the_mass_is_lost(tool: Tool) -> None:
    """The base counts, too, which Pinocchio leaves out as it does not move."""
    for name in ("arm", "tensions", "helix"):
        case = case_of(name)
        said = sum(float(mass) for mass in re.findall(r'<mass value="([^"]+)"', case.model.urdf))
        robot = InMujoco(tool("mujoco"), welded_mjcf(case))
        assert robot.model.body_mass.sum() == pytest.approx(said, rel=1e-12)


def welded_mjcf(case: Case, **options: Any) -> str:
    return to_mjcf(case.model, case.motors, actuators="welded", gravity=case.gravity, **options)


def welded_sdf(case: Case, **options: Any) -> str:
    return to_sdf(case.model, case.motors, actuators="welded", **options)


# --- Statics


def test_mujoco_is_in_balance_where_our_statics_says(tool: Tool, case: Case) -> None:
    """1e-9 of the largest torque: our solver stops at 1e-10 of the load."""
    found, force = equilibrium(case), np.array(case.force)
    robot = InMujoco(tool("mujoco"), welded_mjcf(case))
    robot.put(joint_values(case.model, found.q))
    balance = robot.jacobian(case.model.tip).T @ force + robot.data.qfrc_passive - robot.data.qfrc_bias
    assert len(balance) == len(case.model.spring_joints)
    assert np.abs(balance).max() < 1e-9 * spring_load(case, found)
    assert np.abs(robot.pose(case.model.tip)[:3, 3] - found.tip_position).max() < 1e-12
    assert np.array_equal(robot.data.site(case.model.tip).xpos, robot.pose(case.model.tip)[:3, 3])
    assert robot.data.ncon == 0
    assert robot.data.nefc == 0  # no limit is touched either


def test_drake_is_in_balance_where_our_statics_says(tool: Tool, case: Case) -> None:
    tool("pydrake")
    found = equilibrium(case)
    robot = InDrake(welded_sdf(case), case.gravity)
    robot.put(joint_values(case.model, found.q))
    balance = robot.balance(case.model.tip, np.array(case.force))
    assert len(balance) == len(case.model.spring_joints)
    assert np.abs(balance).max() < 1e-9 * spring_load(case, found)
    assert np.abs(robot.pose(case.model.tip)[:3, 3] - found.tip_position).max() < 1e-12
    assert robot.contacts() == 0
    assert robot.plant.num_actuators() == 0


def test_driven_motors_settle_where_our_statics_says(tool: Tool) -> None:
    """A servo gives way: at the angles that it reaches, springs and torques are those of the statics.

    After a step of a radian that saturates them. 1e-9: what 8 s leave of modes that decay at 12/s or faster.
    """
    case = case_of("arm")
    robot = InMujoco(tool("mujoco"), to_mjcf(case.model, case.motors, damping="critical", gravity=case.gravity))
    robot.mujoco.mj_resetDataKeyframe(robot.model, robot.data, 0)
    home = robot.data.qpos[robot.dofs(list(case.model.motor_joints))]
    assert home.tolist() == list(case.motors) == robot.data.ctrl.tolist()
    robot.data.ctrl[:] = (1.3, -0.5, 0.6)
    robot.mujoco.mj_step(robot.model, robot.data, 4000)
    reached = robot.data.qpos[robot.dofs(list(case.model.motor_joints))]
    found = sr.solve_equilibrium(case.model, reached, gravity=case.gravity)
    springs = robot.data.qpos[robot.dofs(list(case.model.spring_joints))]
    assert np.abs(springs - found.q_springs).max() < 1e-9
    assert np.abs(robot.data.actuator_force + found.motor_torques).max() < 1e-6
    assert 1e-5 < np.abs(reached - robot.data.ctrl).max() < 1e-2 * np.abs(found.motor_torques).max() / 50.0 * 1.001


# --- Numbers


def test_springs_in_the_files_are_those_of_the_model_bit_for_bit(case: Case) -> None:
    driven = not case.model.muscles
    mjcf = ElementTree.fromstring(to_mjcf(case.model, actuators="driven"))
    sdf = ElementTree.fromstring(to_sdf(case.model, actuators="driven" if driven else "welded"))
    told = {
        element.get("name"): (float(element.get("stiffness", "nan")), float(element.get("springref", "nan")))
        for element in mjcf.iter("joint")
        if element.get("stiffness")
    }
    assert told == case.model.spring_table
    told = {
        element.get("name"): (
            float(element.findtext("axis/dynamics/spring_stiffness", "nan")),
            float(element.findtext("axis/dynamics/spring_reference", "nan")),
        )
        for element in sdf.iter("joint")
        if element.find("axis/dynamics/spring_stiffness") is not None
    }
    assert told == case.model.spring_table
    assert any(rest != 0.0 for _, rest in told.values()) == (
        case in (case_of("rest angles"), case_of("branched"), case_of("massless"))
    )


def test_mujoco_keeps_every_digit(tool: Tool) -> None:
    case = case_of("rest angles")
    robot = InMujoco(tool("mujoco"), to_mjcf(case.model))
    for name, (stiffness, rest) in case.model.spring_table.items():
        found = robot.model.joint(name)
        assert np.ravel(found.stiffness)[0] == stiffness
        assert robot.model.qpos_spring[found.qposadr[0]] == rest
        assert found.range.tolist() == [-np.pi / 2, np.pi / 2]
    assert np.array_equal(robot.model.opt.gravity, np.zeros(3))
    weighed = InMujoco(tool("mujoco"), to_mjcf(case.model, gravity=(0.1, 0.2, -9.80665)))
    assert weighed.model.opt.gravity.tolist() == [0.1, 0.2, -9.80665]


def test_limits_and_continuous_joints(tool: Tool) -> None:
    case, arm = case_of("branched"), case_of("arm")
    robot = InMujoco(tool("mujoco"), to_mjcf(case.model))
    limited = {name: bool(robot.model.joint(name).id >= 0 and robot.model.jnt_limited[robot.model.joint(name).id])
               for name in ("shoulder", "elbow", "wrist", "slider")}  # fmt: skip
    assert limited == {"shoulder": False, "elbow": True, "wrist": True, "slider": True}
    assert not mujoco_has(robot, "gripper")  # neither motor nor spring: locked at zero
    free = InMujoco(tool("mujoco"), to_mjcf(arm.model, limits=False))
    assert {name: bool(free.model.jnt_limited[free.model.joint(name).id]) for name in ("motor_1", "spring_1_up")} == {
        "motor_1": True,
        "spring_1_up": False,
    }
    kind = {e.get("name"): e.get("type") for e in ElementTree.fromstring(to_sdf(arm.model, limits=False)).iter("joint")}
    assert (kind["motor_1"], kind["spring_1_up"]) == ("revolute", "continuous")


def test_sdf_gives_actuators_to_motors_alone(tool: Tool) -> None:
    tool("pydrake")
    robot = InDrake(to_sdf(case_of("arm").model))
    assert robot.plant.num_actuators() == 3
    for name in ("motor_1", "motor_2", "motor_3"):
        actuator = next(robot.plant.get_joint_actuator(i) for i in robot.plant.GetJointActuatorIndices()
                        if robot.plant.get_joint_actuator(i).joint().name() == name)  # fmt: skip
        assert actuator.effort_limit() == 50.0


def test_the_text_is_always_the_same() -> None:
    for name in ("arm", "helix"):
        case = case_of(name)
        again = sr.load_model(case.model.urdf)
        assert to_mjcf(case.model, case.motors) == to_mjcf(again, case.motors)
        assert to_sdf(case.model, case.motors) == to_sdf(again, case.motors)


def test_a_file_says_what_it_is() -> None:
    case = case_of("tensions")
    head = re.sub(r"\s+", " ", to_mjcf(case.model, case.motors, actuators="welded", damping="critical").split("-->")[0])
    frequency = re.search(r"w1 = (\S+) rad/s", head)
    assert frequency is not None
    assert "pcc_arm, for MuJoCo" in head
    assert "Muscles and tendons are welded: they are springs" in head
    assert "muscle_1_3 -10.0" in head
    arm = re.sub(r"\s+", " ", to_sdf(case_of("arm").model).split("-->")[0])
    assert "Motors are driven" in arm
    assert "that of the description" in arm
    assert "wrinkle" in arm
    assert "Gravity is not in this file" in arm
    assert "Damping of the springs is 0.25 s times their stiffness" in to_mjcf(case_of("arm").model, damping=0.25)
    odd = sr.load_model(BRANCHED.replace('name="foreign"', 'name="a--b"'), springs=SPRINGS, tip="finger")
    for text in (to_mjcf(odd), to_sdf(odd)):
        assert ElementTree.fromstring(text) is not None  # a comment may not hold two hyphens


# --- Vibration


def slopes(balance: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Derivative of forces, column by column: central differences of sixth order, 1e-12 of the largest by steps of 0.01."""

    def column(way: np.ndarray) -> np.ndarray:
        parts = ((45.0, 1), (-9.0, 2), (1.0, 3))
        return sum(c * (balance(at + n * way) - balance(at - n * way)) for c, n in parts) / 60.0

    return np.array([column(0.01 * unit) / 0.01 for unit in np.eye(len(at))]).T


def assert_same_modes(
    modes: sr.VibrationModes, mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, *, rounding: float
) -> None:
    """Frequencies, and eigenvalues of the damped motion, of another tool's matrices in the order of our springs, to 1e-8.

    `rounding` is the relative error of the tool's mass matrix.
    """
    eigh = importlib.import_module("scipy.linalg").eigh
    squares = eigh(0.5 * (stiffness + stiffness.T), mass, eigvals_only=True)
    assert np.allclose(2.0 * np.pi * modes.frequencies, np.sqrt(squares), rtol=1e-8, atol=0)
    assert np.allclose(modes.mass_matrix, mass, rtol=0, atol=rounding * np.abs(mass).max())
    assert np.allclose(modes.stiffness_matrix, stiffness, rtol=0, atol=1e-8 * np.abs(stiffness).max())
    count = len(mass)
    motion = np.block([
        [np.zeros((count, count)), np.eye(count)],
        [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
    ])  # fmt: skip
    theirs, ours = np.linalg.eigvals(motion), modes.eigenvalues
    if count < 10:  # eigenvalues of larger matrices like this one are less exact
        assert max(np.abs(theirs - one).min() / abs(one) for one in ours) < 1e-8


def test_mujocos_linearisation_has_the_same_modes(tool: Tool, case: Case) -> None:
    """Its mass matrix, differences of its forces and its damping."""
    robot, found = InMujoco(tool("mujoco"), welded_mjcf(case)), equilibrium(case)
    names = list(case.model.spring_joints)
    dofs, force = robot.dofs(names), np.array(case.force, dtype=float)

    def balance(springs: np.ndarray) -> np.ndarray:
        robot.put(dict(zip(names, springs.tolist(), strict=True)))
        forces = robot.data.qfrc_bias - robot.data.qfrc_passive - robot.jacobian(case.model.tip).T @ force
        return np.asarray(forces[dofs])

    stiffness = slopes(balance, found.q_springs)
    balance(found.q_springs)
    damping = np.diag(robot.model.dof_damping[dofs])
    mass, modes = robot.mass()[np.ix_(dofs, dofs)], sr.vibration_modes(case.model, found)
    assert_same_modes(modes, mass, stiffness, damping, rounding=mass_error(robot.mujoco))


@pytest.mark.parametrize("name", ["arm", "tensions"])
def test_drakes_linearisation_has_the_same_modes(tool: Tool, name: str) -> None:
    tool("pydrake")
    case = case_of(name)
    robot, found = InDrake(welded_sdf(case), case.gravity), equilibrium(case)
    names = list(case.model.spring_joints)
    dofs, force = robot.dofs(names), np.array(case.force, dtype=float)

    def balance(springs: np.ndarray) -> np.ndarray:
        robot.put(dict(zip(names, springs.tolist(), strict=True)))
        return -robot.balance(case.model.tip, force)[dofs]

    stiffness = slopes(balance, found.q_springs)
    balance(found.q_springs)
    damping = np.diag([float(robot.plant.GetJointByName(joint).default_damping_vector()[0]) for joint in names])
    mass, modes = robot.mass()[np.ix_(dofs, dofs)], sr.vibration_modes(case.model, found)
    assert_same_modes(modes, mass, stiffness, damping, rounding=1e-12)


# --- Damping


@pytest.mark.parametrize("name", ["arm", "rest angles", "tensions", "helix"])
def test_the_slowest_mode_is_critically_damped_and_none_is_slower_than_half_of_it(tool: Tool, name: str) -> None:
    """The frequencies with MuJoCo's mass matrix and SciPy; the decay from the eigenvalues of the damped motion itself."""
    eigh = tool("scipy.linalg").eigh
    case = case_of(name)
    robot = InMujoco(tool("mujoco"), welded_mjcf(case, damping="critical"))
    robot.put({joint: rest for joint, (_, rest) in case.model.spring_table.items()})
    mass, stiffness = robot.mass(), np.ravel(robot.model.jnt_stiffness.reshape(robot.model.njnt, -1)[:, 0])
    lowest = float(np.sqrt(eigh(np.diag(stiffness), mass, eigvals_only=True)[0]))
    damping = robot.model.dof_damping
    # 1e-9: the smallest of up to 96 eigenvalues, against the largest of their inverses
    assert np.allclose(damping, 2.0 * stiffness / lowest, rtol=1e-9, atol=0)
    count = len(stiffness)
    motion = np.block([
        [np.zeros((count, count)), np.eye(count)],
        [-np.linalg.solve(mass, np.diag(stiffness)), -np.linalg.solve(mass, np.diag(damping))],
    ])  # fmt: skip
    rates = np.linalg.eigvals(motion)
    slow = rates[np.abs(rates) < 3.0 * lowest]
    assert slow.real.max() < -0.5 * lowest
    assert np.abs(slow + lowest).min() < 1e-4 * lowest  # the double root at -w1, which rounding splits by its square root
    assert np.abs(slow.imag).max() < 1e-4 * lowest


def test_damping_of_a_pendulum_in_closed_form() -> None:
    """One body on one spring: w = sqrt(k / I) about the joint, I by Steiner; a slider, w = sqrt(k / m)."""
    urdf = (f'<robot name="pendulum"><link name="base"/>{joint("turn", "base", "end", "0 0 1")}</robot>').replace(
        INERTIAL, INERTIAL.replace("<inertial>", '<inertial><origin xyz="0.3 0 0.1"/>')
    )
    for kind, stiffness, inertia in (("revolute", 7.0, 0.01 + 0.5 * 0.3**2), ("prismatic", 7.0, 0.5)):
        model = sr.load_model(urdf.replace('"revolute"', f'"{kind}"'), springs={"turn": stiffness})
        element = next(ElementTree.fromstring(to_mjcf(model, damping="critical")).iter("joint"))
        assert float(element.get("damping", "nan")) == pytest.approx(2.0 * np.sqrt(stiffness * inertia), rel=1e-14)


def test_damping_of_the_description(tool: Tool) -> None:
    model = sr.load_model(sr.InflatableArm(spring_damping=(0.7, 0.9)))
    robot = InMujoco(tool("mujoco"), to_mjcf(model))
    told = {name: float(robot.model.dof_damping[robot.dofs([name])[0]]) for name in (*model.motor_joints, *model.spring_joints)}
    assert told == {"motor_1": 0, "motor_2": 0, "motor_3": 0, "spring_1_side": 0.7, "spring_1_up": 0.7,
                    "spring_2_side": 0.9, "spring_2_up": 0.9}  # fmt: skip
    timed = InMujoco(tool("mujoco"), to_mjcf(model, damping=0.01))
    springs = timed.dofs(list(model.spring_joints))
    assert np.allclose(timed.model.dof_damping[springs], 0.01 * model.stiffness, rtol=1e-15, atol=0)
    by_time = InMujoco(tool("mujoco"), to_mjcf(sr.load_model(sr.InflatableArm(damping_time=0.01))))
    assert np.allclose(by_time.model.dof_damping, timed.model.dof_damping, rtol=1e-15, atol=0)


def test_servos_by_their_rule(tool: Tool) -> None:
    """All the torque at 0.01 rad; damped critically with what the motor carries, from MuJoCo's mass matrix at home."""
    case = case_of("arm")
    robot = InMujoco(tool("mujoco"), to_mjcf(case.model, case.motors, damping="critical"))
    robot.mujoco.mj_resetDataKeyframe(robot.model, robot.data, 0)
    robot.mujoco.mj_forward(robot.model, robot.data)
    dofs = robot.dofs(list(case.model.motor_joints))
    carried = np.diag(robot.mass())[dofs]
    assert np.allclose(robot.model.actuator_gainprm[:, 0], 50.0 / 0.01, rtol=1e-15, atol=0)
    assert np.allclose(-robot.model.actuator_biasprm[:, 2], 2.0 * np.sqrt(5000.0 * carried), rtol=1e-12, atol=0)
    assert robot.model.dof_damping[dofs].tolist() == [25.0] * 3  # 50 N m at 2 rad/s
    assert robot.model.actuator_forcerange.tolist() == [[-50.0, 50.0]] * 3
    unlimited = sr.load_model(BRANCHED.replace('effort="10"', 'effort="0"'), springs=SPRINGS, tip="finger")
    robot = InMujoco(tool("mujoco"), to_mjcf(unlimited))
    assert set(robot.model.actuator_gainprm[:, 0]) == {20e3}  # 1000 times the stiffest turning spring
    assert not robot.model.actuator_forcelimited.any()


# --- Contact


def test_neighbours_across_a_tiny_body_do_not_collide(tool: Tool) -> None:
    """The shapes of base and wrist overlap; so they would without what we write: MuJoCo's filter spares a base that stands."""
    case = case_of("massless")
    text = welded_mjcf(case)
    mujoco = tool("mujoco")
    for said, expected in ((text, False), (re.sub(r"<contact>.*</contact>", "", text, flags=re.S), True)):
        robot = InMujoco(mujoco, said)
        robot.put({"turn": 0.2})
        assert (robot.data.ncon > 0) == expected
    wide = sr.InflatableArm().urdf().replace('<cylinder length="0.4599999999999999" radius="0.055"/>',
                                             '<cylinder length="0.9" radius="0.055"/>')  # fmt: skip
    text = to_mjcf(sr.load_model(wide))
    assert InMujoco(mujoco, text.replace('<exclude body1="link_1" body2="link_2" />', "")).model.nexclude == 0
    for said, expected in ((text, False), (text.replace('<exclude body1="link_1" body2="link_2" />', ""), True)):
        robot = InMujoco(mujoco, said)
        robot.put({})
        assert (robot.data.ncon > 0) == expected
    tool("pydrake")
    text = to_sdf(sr.load_model(wide))
    filtered = re.compile(r"<drake:collision_filter_group.*</drake:collision_filter_group>", re.S)
    assert (InDrake(text).contacts() > 0, InDrake(filtered.sub("", text)).contacts() > 0) == (False, True)


def test_bodies_further_apart_do_collide(tool: Tool) -> None:
    """Only neighbours are spared: an arm folded back onto its base link hits it."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.5, 0.5)))
    robot = InMujoco(tool("mujoco"), to_mjcf(model, (0, 0, 2.1, 2.1), actuators="welded"))
    robot.put({})
    touching = {
        frozenset(robot.model.body(robot.model.geom_bodyid[geom]).name for geom in (contact.geom1, contact.geom2))
        for contact in robot.data.contact
    }
    assert touching == {frozenset(("link_1", "link_3"))}


@pytest.mark.parametrize("name", ["arm", "tensions", "helix"])
def test_nothing_touches_at_rest(tool: Tool, name: str) -> None:
    robot = InMujoco(tool("mujoco"), to_mjcf(case_of(name).model))
    robot.mujoco.mj_resetDataKeyframe(robot.model, robot.data, 0)
    robot.mujoco.mj_forward(robot.model, robot.data)
    assert robot.data.ncon == 0


# --- Shapes


def test_shapes_keep_place_size_and_colour(tool: Tool) -> None:
    """Against MuJoCo's own reading of the URDF."""
    mujoco, arm = tool("mujoco"), sr.InflatableArm()
    ours = InMujoco(mujoco, to_mjcf(sr.load_model(arm))).model
    theirs = mujoco.MjModel.from_xml_string(arm.urdf())
    assert ours.ngeom == theirs.ngeom > 0

    def shapes(model: Any) -> list[tuple[Any, ...]]:
        colour = np.where(model.geom_contype[:, None] > 0, 0.0, model.geom_rgba)  # a URDF gives collision shapes none
        rows = np.c_[model.geom_type, model.geom_contype, model.geom_size, model.geom_pos, model.geom_quat, colour]
        names = [model.body(body).name for body in model.geom_bodyid]
        return sorted((name, *np.round(row, 7).tolist()) for name, row in zip(names, rows, strict=True))

    assert shapes(ours) == shapes(theirs)


def test_a_world_with_shapes_and_a_box(tool: Tool) -> None:
    tool("pydrake")
    box = "".join(f'<{kind}><geometry><box size="1 2 0.1"/></geometry></{kind}>' for kind in ("visual", "collision"))
    urdf = (f'<robot name="table"><link name="world">{box}</link>{joint("turn", "world", "end", "0 0 1")}</robot>').replace(
        INERTIAL, INERTIAL + '<collision><geometry><sphere radius="0.4"/></geometry></collision>'
    )
    model = sr.load_model(urdf, springs={"turn": 3.0})
    robot = InMujoco(tool("mujoco"), to_mjcf(model))
    robot.put({})
    assert robot.model.geom_size[robot.model.geom_bodyid == 0].tolist() == [[0.5, 1.0, 0.05]] * 2
    assert robot.data.ncon == 0
    drake = InDrake(to_sdf(model))
    assert np.array_equal(drake.pose("world_shapes"), np.eye(4))
    assert drake.contacts() == 0


def ur5() -> sr.SoftModel:
    try:
        file = robot_file(UR5)
    except sr.MissingDependency:
        missing("example-robot-data is not installed")
    return sr.load_model(file, springs={"wrist_1_joint": 400.0, "wrist_3_joint": (250.0, 0.1)}, tip="tool0")


def test_meshes_of_a_real_arm(tool: Tool) -> None:
    """MuJoCo reads the STL of the UR5, not its DAE; Drake collides with neither."""
    mujoco = tool("mujoco")
    model = ur5()
    text = to_mjcf(model)
    assert "Meshes left out: 7" in text
    robot = InMujoco(mujoco, text)
    assert (robot.model.nmesh, robot.model.geom_group.tolist().count(2)) == (7, 7)
    robot.put({})
    assert robot.data.ncon == 0
    tool("pydrake")
    text = to_sdf(model)
    assert text.count(".dae</uri>") == 7
    drake = InDrake(text)
    q = model.configuration((0.4, -1.0, 0.7, 0.2), (0.1, -0.3))
    drake.put(joint_values(model, q))
    assert np.abs(drake.pose("tool0") - pinocchio_poses(model, q)["tool0"]).max() < 1e-12


def test_meshes_that_are_not_there(tmp_path: Path) -> None:
    urdf = BRANCHED.replace(
        INERTIAL, INERTIAL + '<visual><geometry><mesh filename="package://no/such.stl"/></geometry></visual>', 1
    )
    text = to_mjcf(sr.load_model(urdf, springs=SPRINGS, tip="finger"))
    assert "Meshes left out: 1" in text
    assert "<mesh" not in text
    for name, content, readable in (
        ("a.stl", b"solid a\nendsolid a\n", False),
        ("b.stl", bytes(80) + (1).to_bytes(4, "little") + bytes(50), True),
        ("c.stl", bytes(80) + (200_001).to_bytes(4, "little"), False),
        ("d.OBJ", b"v 0 0 0", True),
        ("e.dae", b"<COLLADA/>", False),
    ):
        (tmp_path / name).write_bytes(content)
        assert mujoco_reads(tmp_path / name) == readable


# --- Files and refusals


def test_export_model_writes_a_file_in_the_format_of_its_suffix(tmp_path: Path, arm: sr.SoftModel) -> None:
    path = export_model(arm, tmp_path / "new" / "arm.xml", q_motors=(0.1, 0.2, 0.3), actuators="welded")
    assert path.read_text(encoding="utf-8") == to_mjcf(arm, (0.1, 0.2, 0.3), actuators="welded")
    path = export_model(sr.InflatableArm(), tmp_path / "arm.SDF", damping="critical")
    assert path.read_text(encoding="utf-8") == to_sdf(arm, damping="critical")
    path = export_model(arm.urdf, tmp_path / "arm.txt", "mjcf", limits=False)
    assert path.read_text(encoding="utf-8") == to_mjcf(arm, limits=False)
    with pytest.raises(sr.OutputExists):
        export_model(arm, path, "sdf")
    assert export_model(arm, path, "sdf", overwrite=True).read_text(encoding="utf-8") == to_sdf(arm)


@pytest.mark.parametrize("name", list(FORMATS))
def test_every_format_is_written(tmp_path: Path, name: str, arm: sr.SoftModel) -> None:
    path = export_model(arm, tmp_path / f"arm{FORMATS[name].suffix}", name)
    assert "spring_2_up" in path.read_text(encoding="utf-8")


def test_what_cannot_be_exported_is_refused(tmp_path: Path, arm: sr.SoftModel) -> None:
    for refused in (sr.PccArm(), sr.HelixTube()):
        for write in (to_mjcf, to_sdf):
            with pytest.raises(sr.ParameterError, match='chain="lumped"'):
                write(sr.load_model(refused))
    saturating = sr.load_model(sr.InflatableArm(max_moment=20.0))
    for write in (to_mjcf, to_sdf):
        with pytest.raises(sr.ParameterError, match="linear springs, without max_moment"):
            write(saturating)
        with pytest.raises(sr.ParameterError, match="SoftModel"):
            write(sr.InflatableArm())
        with pytest.raises(sr.ParameterError, match="one of 'driven', 'welded'"):
            write(arm, actuators="free")
        with pytest.raises(sr.ParameterError, match=r"'file' or 'critical', or a damping time \[s\]"):
            write(arm, damping="none")
        with pytest.raises(sr.ParameterError, match="zero or positive"):
            write(arm, damping=-0.1)
        with pytest.raises(sr.ParameterError, match=r"shape \(3,\)"):
            write(arm, (0.1, 0.2))
        with pytest.raises(sr.ParameterError, match="finite"):
            write(arm, (0.1, np.nan, 0.2))
        with pytest.raises(sr.ParameterError, match='limits of motor_2, or actuators="welded"'):
            write(arm, (0.1, 3.2, 0.2))
        assert write(arm, (0.1, 3.2, 0.2), actuators="welded")
        with pytest.raises(sr.ParameterError, match='muscles="forces"'):
            write(_pcc(), actuators="welded")
        with pytest.raises(sr.DescriptionError, match=r"without mass \(end\)"):
            write(sr.load_model(f'<robot name="a"><link name="base"/>{joint("turn", "base", "end", "0 0 1")}</robot>'
                                .replace(INERTIAL, ""), springs={"turn": 1.0}))  # fmt: skip
    with pytest.raises(sr.ParameterError, match="gravity"):
        to_mjcf(arm, gravity=(0, 0, np.inf))
    with pytest.raises(sr.ParameterError, match=r"welded.*which SDF lacks"):
        to_sdf(_pcc(muscles="forces"))
    twin = BRANCHED.replace('"wrist"', '"lower"')
    with pytest.raises(sr.DescriptionError, match="a link and a joint named lower"):
        to_sdf(sr.load_model(twin, springs={"lower": 1.0}, tip="finger"))
    with pytest.raises(sr.ParameterError, match="one of mjcf"):
        export_model(arm, tmp_path / "a.xml", "usd")
    with pytest.raises(sr.ParameterError, match="pybullet, pinocchio"):
        export_model(arm, tmp_path / "a.py")
    with pytest.raises(sr.ParameterError, match="only one format has; else give --format"):
        export_model(arm, tmp_path / "a")
    with pytest.raises(sr.ParameterError, match="formats that have it: mjcf"):
        export_model(arm, tmp_path / "a.sdf", gravity=sr.EARTH_GRAVITY)
    with pytest.raises(sr.ParameterError, match="formats that have it: none"):
        export_model(arm, tmp_path / "a.sdf", colour="red")
    with pytest.raises(sr.ParameterError, match="a path"):
        export_model(arm, 3.0)
    assert not list(tmp_path.iterdir())


def test_a_spring_that_moves_no_mass_is_refused() -> None:
    """A body whose inertia about the axis is zero swings at no frequency."""
    urdf = f'<robot name="a"><link name="base"/>{joint("turn", "base", "end", "0 0 1")}</robot>'
    point = '<inertial><mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    with pytest.raises(sr.DescriptionError, match="move no mass"):
        to_mjcf(sr.load_model(urdf.replace(INERTIAL, point), springs={"turn": 1.0}), damping="critical")


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], arm: sr.SoftModel) -> None:
    target = tmp_path / "arm.xml"
    words = ["export", "inflatable_arm", "-o", str(target), "--motors", "0.1", "-0.2", "0.3", "--welded", "--gravity"]
    assert cli.main(words) == 0
    assert target.read_text(encoding="utf-8") == to_mjcf(arm, (0.1, -0.2, 0.3), actuators="welded", gravity=sr.EARTH_GRAVITY)
    assert capsys.readouterr().out.startswith(f"{target}: inflatable_arm, 4 springs, 3 welded actuators; mjcf")
    assert cli.main(words) == 2
    assert "exists" in capsys.readouterr().err
    assert cli.main([*words, "--overwrite"]) == 0
    made = tmp_path / "made.urdf"
    made.write_text(sr.InflatableArm(stiffness=200).urdf(), encoding="utf-8")
    assert cli.main(["export", str(made), "--format", "sdf", "-o", str(tmp_path / "a"), "--damping", "critical"]) == 0
    assert (tmp_path / "a").read_text(encoding="utf-8") == to_sdf(sr.load_model(made), damping="critical")
    changed = ["--set", "stiffness=200"]
    assert cli.main(["export", "inflatable_arm", *changed, "-o", str(tmp_path / "b.sdf"), "--damping", "critical"]) == 0
    assert (tmp_path / "b.sdf").read_bytes() == (tmp_path / "a").read_bytes()
    for refused, told in (
        (["helix_tube", "-o", "h.xml"], 'chain="lumped"'),
        (["inflatable_arm", "-o", "h.py"], "--output must be a name that only one format has; else give --format"),
        (["no_such_robot", "-o", "h.xml"], "no robot or file"),
        (["inflatable_arm", "-o", "h.sdf", "--gravity"], "formats that have it"),
        (["inflatable_arm", "-o", "h.xml", "--motors", "1"], "it has shape (1,)): motor_1 [rad]"),
    ):
        assert cli.main(["export", *refused[:2], str(tmp_path / refused[2]), *refused[3:]]) == 2
        assert told in capsys.readouterr().err
        assert not (tmp_path / refused[2]).exists()


def test_the_tip_may_be_named_by_its_joint(tool: Tool) -> None:
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="slider")
    robot = InMujoco(tool("mujoco"), to_mjcf(model))
    robot.put({})
    assert np.array_equal(robot.data.site("finger").xpos, robot.pose("finger")[:3, 3])
