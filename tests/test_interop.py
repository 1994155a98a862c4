"""The shipped URDF in other tools: every link is where Pinocchio puts it, and nothing of mass or springs is lost."""

from __future__ import annotations

import logging
import math
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.cli.tools.kinematics import compare_kinematics, pose_error
from softrobots.description.paths import urdf_folder
from softrobots.description.tag_reader import read_tags
from softrobots.description.third_party import UR5, robot_file
from softrobots.robots import HelixTube, InflatableArm, PccArm, Robot
from studies.interop import tools
from studies.interop.kinematics import compare_tools
from studies.interop.tools import TOOLS, find_tool, installed_tools
from tests.conftest import missing, skip_without_bullet_wheels
from tests.support.foreign import BRANCHED, INERTIAL, joint
from tests.support.mujoco_balance import assert_mujoco_balances
from tests.support.tables import each_row

pytestmark = pytest.mark.study

FILE = urdf_folder() / "inflatable_arm.urdf"
FILES = [urdf_folder() / f"{name}.urdf" for name in sr.ROBOTS]
DOUBLE = ("yourdfpy", "MuJoCo", "Drake", "urchin", "ikpy", "roboticstoolbox", "viser")
"""Tools that compute in double precision."""

TUBE_MASS = 920.0 * np.pi * 0.0331 * 1e-4 * 1.5  # wall of the helical tube
LINK_MASS = 1300.0 * 2 * np.pi * 0.055 * 0.0005 * 0.6 + 2 * 0.1  # wall of an inflated link, two caps
MASSES = dict.fromkeys(("inflatable_arm", "inflatable_arm_two_hinges"), (2.0, 2 * LINK_MASS))
MASSES |= {"pcc_arm": (2.0, 1.048 * 0.6), "pcc_arm_lumped": (2.0, 1.048 * 0.6)}
MASSES |= dict.fromkeys(("tendon_arm", "tendon_arm_lumped"), (2.0, 0.05))
MASSES |= {"helix_tube": (0.5, TUBE_MASS), "helix_tube_lumped": (0.5, TUBE_MASS)}
"""Mass of the base and of what moves [kg]."""


def needed(name: str) -> str:
    """The name of a tool that is installed; otherwise the test fails in CI and is skipped elsewhere."""
    if name == "PyBullet":
        skip_without_bullet_wheels()
    if name not in installed_tools():
        missing(f"{name} is not installed")
    return name


# --- Kinematics


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
@pytest.mark.parametrize("name", TOOLS)
def test_every_link_of_a_shipped_file_is_where_pinocchio_has_it(name: str, file: Path) -> None:
    """At 5 configurations within the limits; 1e-9 in tools of double precision (1e-14 measured), 1e-5 in PyBullet (6e-7)."""
    (row,) = compare_tools(file, [needed(name)], count=5)
    model = pin.buildModelFromUrdf(str(file))
    tolerance = 1e-9 if name in DOUBLE else 1e-5
    assert row.problem == ""
    assert row.lost_links == ()
    assert row.links == len(ElementTree.parse(file).getroot().findall("link"))
    assert row.joints == row.joints_in_file == model.nq
    assert row.position_error < tolerance
    assert row.rotation_error < tolerance
    assert row.agrees
    assert (row.tool, row.file, row.version) == (name, file.stem, TOOLS[name].version)


def test_the_table_holds_the_tools_of_the_issue() -> None:
    assert set(TOOLS) == {*DOUBLE, "PyBullet"}
    assert {tool.precision for name, tool in TOOLS.items() if name in DOUBLE} == {1e-9}
    assert TOOLS["PyBullet"].precision == 1e-5


def chain(*joints: str) -> str:
    """A robot on the link `base`."""
    return f'<robot name="chain"><link name="base">{INERTIAL}</link>{"".join(joints)}</robot>'


ELBOW = chain(joint("elbow", "base", "upper", "0 2 0"), joint("wrist", "upper", "hand", "1 0 0"))
FORK = chain(joint("left", "base", "a", "0 1 0"), joint("right", "base", "b", "0 0 1"))
MIMIC = chain(
    joint("one", "base", "a", "0 1 0"),
    joint("two", "a", "b", "0 0 1").replace("</joint>", '<mimic joint="one" multiplier="-0.5" offset="0.2"/></joint>'),
)
TWICE = MIMIC.replace(
    "</robot>",
    joint("three", "b", "c", "1 0 0").replace("</joint>", '<mimic joint="two" multiplier="2"/></joint>') + "</robot>",
)
LIGHT = ELBOW.replace("0 2 0", "0 1 0").replace('<mass value="0.5"/>', '<mass value="0"/>')


@each_row(
    ("name", "urdf", "what"),
    [
        ("ikpy", ELBOW, "position_error"),  # an axis that is no unit vector
        ("ikpy", FORK, "lost_links"),  # one serial chain
        ("yourdfpy", TWICE, "rotation_error"),  # a mimic of a mimic
        ("urchin", TWICE, "rotation_error"),
        ("MuJoCo", LIGHT, "problem"),
    ],
)
def test_a_tool_that_errs_does_not_agree(name: str, urdf: str, what: str) -> None:
    """Errors that are known of the tools, so that the comparison is seen to find them."""
    (row,) = compare_tools(urdf, [needed(name)])
    assert not row.agrees
    found = getattr(row, what)
    assert found > 0.01 if isinstance(found, float) else found
    assert row.limits == TOOLS[name].limits


def test_a_tool_that_refuses_a_file_says_why() -> None:
    (row,) = compare_tools(LIGHT, [needed("MuJoCo")])
    assert "mass and inertia of moving bodies must be larger than mjMINVAL" in row.problem
    assert (row.joints, row.links, row.lost_links) == (0, 0, ("base", "upper", "hand"))


def long_chain(movable: int, fixed: int) -> str:
    """A chain of joints that turn about y and z in turn, and fixed ones at its end."""
    kinds = ["revolute"] * movable + ["fixed"] * fixed
    links = ["base", *(f"link_{i}" for i in range(len(kinds)))]
    axes = ("0 1 0", "0 0 1")
    return chain(*("\n" + joint(f"j{i}", links[i], links[i + 1], axes[i % 2], k, "0.1 0 0") for i, k in enumerate(kinds)))


@pytest.mark.parametrize(("movable", "fixed", "agrees"), [(122, 5, True), (123, 0, False), (100, 27, True), (100, 28, False)])
def test_how_many_joints_pybullet_takes(movable: int, fixed: int, agrees: bool) -> None:
    """It loads 123, but the last one stays at zero without a word."""
    (row,) = compare_tools(long_chain(movable, fixed), [needed("PyBullet")], count=2)
    assert row.joints_in_file == movable
    assert row.agrees == agrees
    assert TOOLS["PyBullet"].limits.startswith("at most 122 movable joints, and 127 with the fixed ones")


def test_pybullet_breaks_lines_of_8192_characters() -> None:
    """Where the break falls into a word, `va|lue`, the file is refused."""
    for start, agrees in ((8173, False), (8000, True)):
        text = FORK.replace(INERTIAL, " " * (start - FORK.index(INERTIAL)) + INERTIAL, 1)
        assert text[start + 16 :].startswith("value")
        (row,) = compare_tools(text, [needed("PyBullet")], count=2)
        assert row.agrees == agrees


@pytest.mark.parametrize("name", TOOLS)
def test_branches_sliders_and_wheels_are_compared_too(name: str) -> None:
    """ikpy follows one branch, MuJoCo knows the root as its world: the joints and links that are there are in place."""
    (row,) = compare_tools(BRANCHED, [needed(name)], count=5)
    assert row.joints == (4 if name == "ikpy" else 5)
    assert set(row.lost_links) == {"ikpy": {"side"}, "MuJoCo": {"base"}}.get(name, set())
    assert max(row.position_error, row.rotation_error) < row.precision


@pytest.mark.parametrize("name", [name for name in TOOLS if name != "Drake"])
def test_mimicking_joints_follow(name: str) -> None:
    """In the tools that couple them, and set by hand in those that do not."""
    (row,) = compare_tools(MIMIC, [needed(name)], count=5)
    assert max(row.position_error, row.rotation_error) < row.precision
    assert row.joints == 2


def test_the_angle_between_poses_is_that_of_the_logarithm(rng: np.random.Generator) -> None:
    for size in (0.0, 1e-12, 1e-5, 0.3, 3.1):
        axis = rng.normal(size=3)
        one, turn = pin.SE3.Random(), pin.exp3(size * axis / np.linalg.norm(axis))
        other = pin.SE3(one.rotation @ turn, one.translation + [3.0, 0.0, 4.0])
        distance, angle = pose_error(one.homogeneous, other.homogeneous)
        assert distance == pytest.approx(5.0, rel=1e-15)
        assert angle == pytest.approx(size, abs=1e-15, rel=1e-12)  # rounding of entries near 1; near pi the arcsine is steep


def test_the_draw_keeps_the_limits_and_can_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    from softrobots.cli.tools import kinematics

    drawn: list[dict[str, float]] = []
    original = kinematics._pinocchio_poses

    def spy(*words: object) -> object:
        truth = original(*words)
        drawn.extend(truth.values)
        return truth

    monkeypatch.setattr(kinematics, "_pinocchio_poses", spy)
    for seed in (1, 1, 2):
        compare_kinematics(FILE, count=7, seed=seed)
    assert drawn[:7] == drawn[7:14]
    assert drawn[:7] != drawn[14:]
    model = pin.buildModelFromUrdf(str(FILE))
    values = np.array([[row[name] for name in list(model.names)[1:]] for row in drawn])
    assert np.all((model.lowerPositionLimit < values) & (values < model.upperPositionLimit))
    assert np.all(values.std(axis=0) > 0.3)


@each_row(
    ("source", "options", "error", "message"),
    [
        (FILE, {"tools": ["Gazebo"]}, sr.NameNotFound, "no tool is called 'Gazebo'; available: yourdfpy, MuJoCo"),
        (FILE, {"count": 0}, sr.ParameterError, "count"),
        (3, {}, sr.ParameterError, "a robot, a path"),
        (FILE.with_name("nothing.urdf"), {}, sr.DescriptionError, "cannot read"),
        (ELBOW.replace('type="revolute"', 'type="planar"'), {}, sr.DescriptionError, "not revolute.*: elbow, wrist"),
        (chain(), {}, sr.DescriptionError, "chain has 0 movable joints"),
        (ELBOW.replace("<limit", "<no"), {}, sr.DescriptionError, "Pinocchio refuses"),
    ],
)
def test_what_cannot_be_compared_is_refused(source: object, options: dict, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        compare_tools(source, **options)


def test_a_tool_that_is_missing_or_broken_is_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> ModuleType:
        raise ImportError(f"no {name}")

    monkeypatch.setattr(tools.importlib, "import_module", broken)
    with pytest.raises(sr.SoftRobotsError, match=r"yourdfpy .* cannot be imported: no yourdfpy"):
        compare_tools(FILE, ["yourdfpy"])
    monkeypatch.setattr(tools, "installed_version", lambda package: None)
    with pytest.raises(sr.MissingDependency, match=r"ikpy is not installed.*softrobots\[interop-kinematics\]"):
        compare_tools(FILE, ["ikpy"])
    with pytest.raises(sr.MissingDependency, match=r"drake is not installed.*softrobots\[interop\]"):
        find_tool("Drake").load()
    assert compare_tools(FILE) == ()  # by default what is installed


# --- Parsers that check


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_check_urdf_and_yourdfpy_find_nothing_to_complain_about(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    import yourdfpy

    program = Path(sys.executable).parent / "check_urdf"  # of urdfdom, which Pinocchio brings along
    done = subprocess.run([str(program), str(file)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Successfully Parsed XML" in done.stdout
    with caplog.at_level(logging.WARNING):
        robot = yourdfpy.URDF.load(str(file))
        assert robot.validate()
    assert robot.errors == []
    assert caplog.records == []


def sdformat() -> str:
    """Name of the newest libsdformat that pkg-config knows; without one the test fails in CI and is skipped elsewhere."""
    for program in ("g++", "pkg-config"):
        if not shutil.which(program):
            missing(f"{program} is not installed")
    for version in range(16, 11, -1):
        if subprocess.run(["pkg-config", "--exists", f"sdformat{version}"], check=False).returncode == 0:
            return f"sdformat{version}"
    missing("libsdformat is not installed (Debian: apt-get install libsdformat-dev g++ pkg-config)")
    raise AssertionError


def test_gazebos_parser_keeps_every_link_joint_spring_and_mass(tmp_path: Path) -> None:
    """But the flange `segment_<i>_start` of a lumped segment becomes one with the link that it is fixed to.

    The converter is compiled once (3 s), for all files. libsdformat prints 16 digits: rounding is at most 5e-16 of a number.
    """
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", sdformat()], capture_output=True, text=True, check=True)
    source, program = Path(__file__).parent / "support" / "urdf_to_sdf.cc", tmp_path / "urdf_to_sdf"
    subprocess.run(["g++", "-std=c++17", str(source), "-o", str(program), *flags.stdout.split()], check=True)
    copies = [Path(shutil.copy(file, tmp_path)) for file in FILES]
    done = subprocess.run([str(program), *map(str, copies)], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    for file in copies:
        root, sdf = ElementTree.parse(file).getroot(), ElementTree.parse(file.with_suffix(".sdf")).getroot().find("model")
        links = {link.get("name") for link in root.findall("link")} - {"world", *(f"segment_{i}_start" for i in (1, 2, 3))}
        assert {link.get("name") for link in sdf.findall("link")} == links
        joints = {element.get("name"): element for element in sdf.findall("joint")}
        moving = [element for element in root.findall("joint") if element.get("type") != "fixed"]
        assert {name for name, element in joints.items() if element.get("type") != "fixed"} == {e.get("name") for e in moving}
        assert {joints["base_fixed"].findtext("child"), joints["tip_fixed"].findtext("child")} == {"base_link", "tip"}
        springs = read_tags(file.read_text(encoding="utf-8")).springs
        assert (len(springs) > 0) == ("lumped" in file.stem or "inflatable" in file.stem)
        for element in moving:
            name, axis = element.get("name"), joints[element.get("name")].find("axis")
            stiffness, rest = (springs[name].stiffness, springs[name].rest) if name in springs else (0.0, 0.0)
            assert float(axis.findtext("dynamics/spring_stiffness")) == pytest.approx(stiffness, rel=5e-16)
            assert float(axis.findtext("dynamics/spring_reference")) == pytest.approx(rest, rel=5e-16)
            for key in ("lower", "upper", "effort", "velocity"):
                assert float(axis.findtext(f"limit/{key}")) == pytest.approx(float(element.find("limit").get(key)), rel=5e-16)
        masses = [float(mass.text) for mass in sdf.findall("link/inertial/mass")]
        assert sum(masses) == pytest.approx(sum(MASSES[file.stem]), rel=1e-12)


# --- Masses


def mass_in_mujoco(file: Path) -> float:
    import mujoco

    return float(mujoco.MjModel.from_xml_path(str(file)).body_mass.sum())


def mass_in_drake(file: Path) -> float:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(file))
    plant.Finalize()
    return float(plant.CalcTotalMass(plant.CreateDefaultContext()))


def mass_in_pybullet(file: Path) -> float:
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        links = range(pybullet.getNumJoints(robot, physicsClientId=client))  # not the world
        return math.fsum(pybullet.getDynamicsInfo(robot, link, physicsClientId=client)[0] for link in links)
    finally:
        pybullet.disconnect(client)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
@pytest.mark.parametrize(
    ("name", "mass", "tolerance"),
    [("MuJoCo", mass_in_mujoco, 1e-12), ("Drake", mass_in_drake, 1e-12), ("PyBullet", mass_in_pybullet, 1e-6)],
)
def test_nothing_of_the_mass_is_lost(name: str, mass: Callable[[Path], float], tolerance: float, file: Path) -> None:
    """Closed forms of wall, caps and base. PyBullet computes in single precision."""
    needed(name)
    assert mass(file) == pytest.approx(sum(MASSES[file.stem]), rel=tolerance)


# --- Any robot

sizes = st.floats(0.1, 1.5)
link_ = st.fixed_dictionaries(
    {
        "link_lengths": sizes,
        "hinge_offset": st.floats(0.01, 0.2),
        "radius": st.floats(0.01, 0.1),
        "wall_thickness": st.floats(1e-5, 1e-3),
        "stiffness": st.floats(0.1, 1e4),
        "rest_side": st.floats(-1.5, 1.5, allow_subnormal=False),
        "rest_up": st.floats(-1.5, 1.5, allow_subnormal=False),
        "cap_mass": st.floats(0.0, 1.0, allow_subnormal=False),
    }
)
segment_ = st.fixed_dictionaries(
    {
        "segment_lengths": sizes,
        "muscle_distance": st.floats(0.005, 0.1),
        "muscle_force": st.floats(1.0, 1e3),
        "bending_stiffness": st.floats(0.01, 100.0),
        "linear_density": st.floats(1e-4, 2.0),
        "radius": st.floats(0.01, 0.1),
        "offset": st.floats(-3.0, 3.0, allow_subnormal=False),
    }
)
tube_ = st.fixed_dictionaries(
    {
        "length": sizes,
        "diameter": st.floats(0.02, 0.1),
        "contraction": st.floats(0.3, 1.0),
        "angle": st.floats(0.0, 1.2, allow_subnormal=False),
        "handedness": st.sampled_from(["right", "left"]),
        "wall_thickness": st.floats(1e-5, 4e-4),
        "upright": st.sampled_from(["tube", "axis"]),
        "elastic_sections": st.integers(3, 8),
        "hinges": st.integers(1, 8),
        "chain": st.sampled_from(["sections", "lumped"]),
    }
)
pcc_ = st.fixed_dictionaries(
    {
        "muscle_azimuths": st.one_of(
            st.just(()), st.integers(3, 5).map(lambda count: tuple(np.arange(count) * 2 * np.pi / count))
        ),
        "elastic_sections": st.integers(1, 3),
        "hinges": st.integers(1, 5),
        "chain": st.sampled_from(["sections", "lumped"]),
        "torsion": st.booleans(),
        "extension": st.booleans(),
    }
)


def columns(rows: list[dict]) -> dict[str, list]:
    return {name: [row[name] for row in rows] for name in rows[0]}


ROBOTS_ = {
    InflatableArm: st.lists(link_, min_size=1, max_size=4).map(columns),
    PccArm: st.tuples(st.lists(segment_, min_size=1, max_size=3), pcc_).map(lambda both: columns(both[0]) | both[1]),
    HelixTube: tube_,
}


@pytest.mark.parametrize("kind", ROBOTS_)
@given(data=st.data())
@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
def test_any_robot_is_refused_with_a_reason_or_the_same_in_every_tool(
    tool: Callable[[str], ModuleType], kind: type, data: st.DataObject
) -> None:
    """Pinocchio, yourdfpy and MuJoCo: every link at five configurations, and the mass.

    What is refused is refused by an error of ours, e.g. a link too light for its hinge; nothing else comes out of it.
    """
    mujoco, fields = tool("mujoco"), data.draw(ROBOTS_[kind])
    try:
        robot: Robot = kind(**fields)
        urdf = robot.urdf()
    except sr.SoftRobotsError as error:
        assert isinstance(error, sr.ParameterError | sr.SelfIntersection | sr.DescriptionError)
        assert len(str(error)) > 20
        return
    for row in compare_tools(robot, ["yourdfpy", "MuJoCo"], count=5):
        assert row.agrees, row
    written = math.fsum(float(mass.get("value")) for mass in ElementTree.fromstring(urdf).iter("mass"))
    assert sum(inertia.mass for inertia in pin.buildModelFromXML(urdf).inertias) == pytest.approx(written, rel=1e-12)
    assert mujoco.MjModel.from_xml_string(urdf).body_mass.sum() == pytest.approx(written, rel=1e-12)


# --- Static balance in MuJoCo, and a robot of somebody else


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


@pytest.mark.parametrize(
    "parameters", [{}, {"torsion": False, "extension": False}, {"radius": 0.02, "hinge_rule": "midpoint"}], ids=str
)
def test_mujoco_agrees_with_the_equilibrium_of_a_lumped_arm(tool: Callable[[str], ModuleType], parameters: dict) -> None:
    """Without muscles."""
    robot = sr.robots.PccArm(muscle_azimuths=(), chain="lumped", hinges=7, **parameters)
    found = assert_mujoco_balances(tool("mujoco"), robot, np.array([3.0, -4.5, 1.3]), np.array(sr.EARTH_GRAVITY))
    assert np.hypot(*found.tip_position[:2]) > 0.3  # bent in earnest


def test_a_third_party_robot_with_springs_said_by_the_caller() -> None:
    """The UR5 of example-robot-data, with a soft wrist: kinematics as in yourdfpy, springs in balance."""
    import yourdfpy

    try:
        file = robot_file(UR5)
    except sr.MissingDependency as error:
        missing(str(error))
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
