"""Two robots put together: each stands where it stands alone, nothing is lost, and what does not fit is refused."""

from __future__ import annotations

import io
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.description.tag_reader import read_tags
from softrobots.statics.kinematics import frame_placement
from studies.shared.held_motors import with_motors_held
from tests.conftest import missing
from tests.support.foreign import INERTIAL, joint
from tests.support.tables import each_row

XYZ, RPY = (0.02, -0.03, 0.05), (0.3, -1.1, 0.7)
SMALL: dict[str, Callable[[], object]] = {
    "arm": sr.InflatableArm,
    "pcc": lambda: sr.PccArm(elastic_sections=1),
    "pcc_lumped": lambda: sr.PccArm(chain="lumped", hinges=2),
    "helix": lambda: sr.HelixTube(elastic_sections=6),
    "helix_lumped": lambda: sr.HelixTube(chain="lumped", hinges=6),
}
"""Robots of every kind, with few joints."""


def stand(xyz: str = "0.1 0.2 0.3", rpy: str = "0.4 -0.5 0.6", more: str = "") -> str:
    """A carrier that cannot move."""
    return (
        f'<robot name="stand"><link name="floor"/><joint name="leg" type="fixed"><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<parent link="floor"/><child link="top"/></joint><link name="top">{INERTIAL}</link>{more}</robot>'
    )


def placements(urdf: str, values: dict[str, float]) -> dict[str, pin.SE3]:
    """Pose of every link in the root of a URDF, by Pinocchio, every joint by itself."""
    model = pin.buildModelFromXML(urdf)
    data, q = model.createData(), pin.neutral(model)
    for name, value in values.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return {f.name: pin.SE3(data.oMf[i]) for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}


def drawn(urdf: str, rng: np.random.Generator) -> dict[str, float]:
    """Random positions of the joints, within a radian and 5 cm."""
    model = pin.buildModelFromXML(urdf)
    sizes = {name: 0.05 if "JointModelP" in model.joints[i].shortname() else 1.0 for i, name in enumerate(model.names) if i}
    return {name: float(rng.uniform(-size, size)) for name, size in sizes.items()}


def masses(urdf: str) -> list[float]:
    return sorted(float(mass.get("value")) for mass in ElementTree.fromstring(urdf).iter("mass"))


@pytest.mark.parametrize("kind", SMALL)
def test_every_link_stands_where_both_robots_alone_say(kind: str, ur5: Path, rng: np.random.Generator, tool: Callable) -> None:
    """Pose in the whole = pose of the flange, mount pose, pose in the mounted robot: in Pinocchio and in yourdfpy."""
    yourdfpy = tool("yourdfpy")
    carrier, child = ur5.read_text(), SMALL[kind]().urdf()
    whole = sr.mount(ur5, "tool0", SMALL[kind](), xyz=XYZ, rpy=RPY)
    mounted = pin.SE3(pin.rpy.rpyToMatrix(*RPY), np.array(XYZ))
    file = yourdfpy.URDF.load(io.BytesIO(whole.encode()), load_meshes=False, build_collision_scene_graph=False)
    for _ in range(3):
        above, below = drawn(carrier, rng), drawn(child, rng)
        flange, inside = placements(carrier, above), placements(child, below)
        values = above | {f"soft_{name}": value for name, value in below.items()}
        found = placements(whole, values)
        assert set(found) == set(flange) | {f"soft_{name}" for name in inside if name != "world"}
        file.update_cfg({name: values[name] for name in file.actuated_joint_names})
        for name, pose in found.items():
            expected = flange[name] if name in flange else flange["tool0"] * mounted * inside[name.removeprefix("soft_")]
            assert np.allclose(pose.homogeneous, expected.homogeneous, rtol=0.0, atol=1e-12)  # rounding of metres
        for name in ("soft_base_link", "soft_tip", "tool0"):
            assert np.allclose(file.get_transform(name, "world"), found[name].homogeneous, rtol=0.0, atol=1e-12)
    assert masses(whole) == sorted(masses(carrier) + masses(child))


@pytest.mark.parametrize("kind", SMALL)
def test_the_carrier_stays_and_the_robot_keeps_its_elasticity(kind: str, ur5: Path) -> None:
    robot = SMALL[kind]()
    alone, whole = sr.load_model(robot), sr.load_model(sr.mount(ur5, "tool0", robot))
    assert whole.tip == "soft_tip"
    assert whole.motor_joints == (
        *(f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")),
        *(f"soft_{name}" for name in alone.motor_joints),
    )
    assert np.array_equal(whole.stiffness, alone.stiffness)
    assert np.array_equal(whole.rest, alone.rest)
    assert len(whole.spring_groups) == len(alone.spring_groups)
    kept, text = ElementTree.parse(ur5).getroot(), ElementTree.fromstring(whole.urdf)
    for mine, its in zip(kept, text, strict=False):  # the carrier comes first, element by element
        assert ElementTree.canonicalize(ElementTree.tostring(mine), strip_text=True) == ElementTree.canonicalize(
            ElementTree.tostring(its), strip_text=True
        )


@pytest.mark.parametrize("kind", SMALL)
def test_equilibrium_is_that_of_the_robot_alone_with_the_load_in_its_own_axes(kind: str) -> None:
    """Mounted on a tilted stand, the springs settle as those of the robot alone under turned gravity and a turned force."""
    robot = SMALL[kind]()
    alone, whole = sr.load_model(robot), sr.load_model(sr.mount(stand(), "top", robot, xyz=XYZ, rpy=RPY))
    base = frame_placement(whole, whole.configuration(whole.relaxed_motors), "soft_base_link")
    turn = np.array(base.rotation)
    motors = np.array([0.3, 0.6, -0.8]) if kind == "arm" else alone.relaxed_motors
    force, gravity = np.array([0.01, 0.02, -0.03]), np.array(sr.EARTH_GRAVITY) * (1.0 if kind == "arm" else 0.05)
    one = sr.solve_equilibrium(alone, motors, turn.T @ force, gravity=turn.T @ gravity)
    other = sr.solve_equilibrium(whole, motors, force, gravity=gravity)
    # Both solve to a residual of 1e-10 of the load; the softest spring of a helix turns that into 1e-9 rad.
    assert np.allclose(other.q_springs, one.q_springs, rtol=0.0, atol=1e-8)
    assert np.allclose(other.motor_torques, one.motor_torques, rtol=0.0, atol=1e-8)
    assert np.allclose(other.tip_position, base.act(one.tip_position), rtol=0.0, atol=1e-8)
    assert one.stable
    assert other.stable


def test_two_arms_of_muscles_are_one_arm_of_twice_the_segments() -> None:
    """The base of the second arm has a mass but no length: without gravity the whole is an arm of four segments."""
    two = {"segment_lengths": (0.5, 0.4), "elastic_sections": 2, "offset": 0.4}
    half = sr.PccArm(**two)
    whole = sr.load_model(sr.mount(half, "tip", half, rpy=(0.0, 0.0, 0.4), prefix="upper_"))
    one = sr.load_model(sr.PccArm(**(two | {"segment_lengths": (0.5, 0.4, 0.5, 0.4)})))
    assert [tag.segments[0] for tag in read_tags(whole.urdf).muscles] == sorted([1, 2, 3, 4] * 3)
    assert whole.motor_joints == (*(m.name for m in half_muscles(half)), *(f"upper_{m.name}" for m in half_muscles(half)))
    lengths = one.relaxed_motors * np.linspace(0.96, 1.03, 12)
    found, expected = (sr.solve_equilibrium(model, lengths, (1.0, -2.0, 0.5)) for model in (whole, one))
    # Residuals of 1e-10 of the load over stiffness of some N m/rad.
    assert np.allclose(found.tip_position, expected.tip_position, rtol=0.0, atol=1e-9)
    assert np.allclose(found.muscle_forces, expected.muscle_forces, rtol=0.0, atol=1e-6)
    assert np.allclose(found.strains, expected.strains, rtol=0.0, atol=1e-8)


def half_muscles(robot: sr.PccArm) -> tuple:
    return read_tags(robot.urdf()).muscles


def test_soft_on_soft_keeps_both_inflated() -> None:
    arm = sr.InflatableArm()
    whole = sr.load_model(sr.mount(arm, "tip", arm, rpy=(0.0, 0.0, 0.3)))
    assert (whole.tip, whole.n_motors, whole.n_springs, len(whole.spring_groups)) == ("soft_tip", 6, 8, 4)
    twice = sr.mount(whole.urdf, "soft_tip", sr.HelixTube(elastic_sections=6), prefix="end_")
    tags = read_tags(twice)
    assert tags.tip == "end_tip"  # of what was mounted last
    assert tags.inflated_links[-1].springs == ("end_section_1_6_bend_x", "end_section_1_6_bend_y")


def test_ik_with_the_joints_of_the_carrier_compensates_the_sag(ur5: Path, tool: Callable) -> None:
    """The tip that yourdfpy computes for the compensated robot is where the unloaded one was."""
    yourdfpy = tool("yourdfpy")
    arm = with_motors_held(sr.InflatableArm().urdf(), {"motor_1": 0.2, "motor_2": 1.2, "motor_3": -0.4})
    model = sr.load_model(sr.mount(ur5, "tool0", arm, xyz=(0.0, 0.0, 0.165)))
    assert model.n_motors == 6
    start = (0.3, -2.1, 1.9, 0.2, 1.5, 0.1)
    target = sr.solve_equilibrium(model, start).tip_position
    load = {"force": (0.0, 0.0, -5.0), "gravity": sr.EARTH_GRAVITY}
    sagging = sr.solve_equilibrium(model, start, **load)
    assert np.linalg.norm(sagging.tip_position - target) > 0.05
    found = sr.solve_ik(model, target, q_motors0=start, starts=1, **load)
    file = yourdfpy.URDF.load(io.BytesIO(model.urdf.encode()), load_meshes=False)
    names = (*model.motor_joints, *model.spring_joints)
    file.update_cfg(dict(zip(names, (*found.q_motors, *found.equilibrium.q_springs), strict=True)))
    assert np.linalg.norm(file.get_transform("soft_tip", "world")[:3, 3] - target) < 1e-9
    assert found.equilibrium.stable


def test_motors_held_by_the_scripts_stand_where_they_were(rng: np.random.Generator) -> None:
    text = sr.InflatableArm().urdf()
    held = {"motor_1": 0.7, "motor_2": -0.4, "motor_3": 0.0}
    fixed = with_motors_held(text, held)
    springs = {name: value for name, value in drawn(text, rng).items() if name.startswith("spring")}
    before, after = placements(text, springs | held), placements(fixed, springs)
    assert before.keys() == after.keys()
    for name, pose in before.items():
        assert np.allclose(after[name].homogeneous, pose.homogeneous, rtol=0.0, atol=1e-14)
    assert sr.load_model(fixed).motor_joints == ()


def test_every_reference_gets_the_prefix() -> None:
    """Mimic, gazebo, transmission, plugin text, MuJoCo's and Drake's tags; what only looks like a name stays."""
    child = (
        f'<robot name="child" xmlns:drake="http://drake.mit.edu"><material name="red"><color rgba="1 0 0 1"/></material>'
        f'<link name="base"><visual><geometry><box size="1 1 1"/></geometry><material name="red"/></visual>{INERTIAL}</link>'
        + joint("a", "base", "la", "0 0 1")
        + joint("b", "la", "lb", "0 0 1").replace("<limit", '<mimic joint="a" multiplier="2"/><limit')
        + '<gazebo reference="a"><springStiffness>3</springStiffness></gazebo>'
        '<gazebo><plugin name="p" filename="a"><joint_name> b </joint_name><kind>red wine</kind></plugin></gazebo>'
        '<transmission name="t"><type>a</type><joint name="a"><mode>x</mode></joint><actuator name="m"/></transmission>'
        '<drake:collision_filter_group name="g"><drake:member link="la"/></drake:collision_filter_group></robot>'
    )
    root = ElementTree.fromstring(sr.mount(stand(), "top", child, prefix="x_", name="both"))
    assert root.get("name") == "both"
    assert root.find("joint[@name='x_b']/mimic").get("joint") == "x_a"
    assert [tag.get("reference") for tag in root.findall("gazebo")] == ["x_a", None]
    plugin = root.find("gazebo/plugin")
    assert (plugin.get("filename"), plugin.find("joint_name").text, plugin.find("kind").text) == ("a", "x_b", "red wine")
    transmission = root.find("transmission")
    assert [transmission.get("name"), transmission.find("joint").get("name")] == ["x_t", "x_a"]
    assert transmission.find("actuator").get("name") == "x_m"
    group = root.find("{http://drake.mit.edu}collision_filter_group")
    assert (group.get("name"), group[0].get("link")) == ("x_g", "x_la")
    assert {tag.get("name") for tag in root.iter("material")} == {"x_red"}
    assert root.find("joint[@name='x_mount']/child").get("link") == "x_base"  # no root world: a joint of its own


def test_text_that_xacro_would_evaluate_stays_as_it_is() -> None:
    odd = ["${1 + 1}", "$(find nothing)", "$$", "$", "$${x}", "a $5 b ${", "$(", "100 $$$(y)"]
    more = "<!-- xacro:eval-comments --><!-- ${1/0} -->" + "".join(
        f'<gazebo><plugin name="p{i}" filename="{text}">{text}</plugin></gazebo>' for i, text in enumerate(odd)
    )
    root = ElementTree.fromstring(sr.mount(stand(more=more), "top", sr.InflatableArm()))
    plugins = root.findall("gazebo/plugin")
    assert [plugin.get("filename") for plugin in plugins] == odd
    assert [plugin.text for plugin in plugins] == odd


def test_letters_beyond_ascii_and_odd_folders_survive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "a [b] $(c) é"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    file = folder / "träger.urdf"
    file.write_text(stand().replace("top", "Träger"), encoding="utf-8")
    assert '<parent link="Träger"/>' in sr.mount(file, "Träger", sr.InflatableArm())
    assert list(folder.iterdir()) == [file]


def test_mujoco_tags_are_not_doubled() -> None:
    arm = sr.InflatableArm()
    assert sr.mount(stand(), "top", arm).count("<mujoco>") == 1
    own = sr.mount(stand(more='<mujoco><compiler meshdir="m"/></mujoco>'), "top", arm)
    assert own.count("<mujoco>") == 1
    assert 'meshdir="m"' in own


def test_the_pose_of_a_base_on_world_counts() -> None:
    """A robot whose description lifts it above its world is lifted above the link."""
    robot = sr.InflatableArm().urdf()
    origin = '<origin rpy="0.0 0.0 0.0" xyz="0.0 0.0 0.0"/>\n    <parent link="world"/>'
    assert origin in robot
    lifted = robot.replace(origin, '<origin rpy="0.1 0.2 0.3" xyz="0.0 0.1 0.5"/><parent link="world"/>')
    found = placements(sr.mount(stand(), "top", lifted, xyz=XYZ, rpy=RPY), {})
    inside = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.0, 0.1, 0.5]))
    expected = found["top"] * pin.SE3(pin.rpy.rpyToMatrix(*RPY), np.array(XYZ)) * inside
    assert np.allclose(found["soft_base_link"].homogeneous, expected.homogeneous, rtol=0.0, atol=1e-14)


def test_a_world_that_carries_several_things_stays() -> None:
    hands = "".join(joint(name, "world", f"l{name}", "0 0 1") for name in "ab")
    text = f'<robot name="pair"><link name="world"/>{hands}</robot>'
    whole = sr.mount(stand(), "top", text)
    assert {"soft_world", "soft_la", "soft_lb"} <= placements(whole, {}).keys()
    assert read_tags(whole).tip is None  # two ends, none called tip: nothing is said of the tip
    carrier = sr.mount(stand(), "top", sr.InflatableArm())
    assert read_tags(sr.mount(carrier, "soft_tip", text, prefix="hand_")).tip == "soft_tip"


def test_a_tip_in_the_file_is_the_default_and_is_checked() -> None:
    text = sr.mount(stand(), "top", sr.InflatableArm())
    assert sr.load_model(text, tip="top").tip == "top"
    for bad in ('<softrobots:tip link="soft_tipp"/>', '<softrobots:tip link="soft_tip"/><softrobots:tip link="top"/>'):
        with pytest.raises(sr.DescriptionError, match="names the tips"):
            sr.load_model(text.replace('<softrobots:tip link="soft_tip"/>', bad))


def test_check_urdf_accepts_it(ur5: Path, tmp_path: Path) -> None:
    program = Path(sys.executable).parent / "check_urdf"
    if not program.exists():
        missing("check_urdf is not installed")
    file = tmp_path / "whole.urdf"
    file.write_text(sr.mount(ur5, "tool0", sr.PccArm(elastic_sections=1)), encoding="utf-8")
    ended = subprocess.run([str(program), str(file)], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "soft_base_link" in ended.stdout


ARM = sr.InflatableArm()
SECTIONS, LUMPED = SMALL["pcc"](), SMALL["pcc_lumped"]()


@each_row(
    ("arguments", "options", "error", "message"),
    [
        ((stand(), "topp", ARM), {}, sr.NameNotFound, r"'topp' \(did you mean 'top'\?\); available: floor, top"),
        ((stand(), "leg", ARM), {}, sr.NameNotFound, "no link is called 'leg'"),
        ((stand(), None, ARM), {}, sr.NameNotFound, "no link is called 'None'"),
        ((42, "top", ARM), {}, sr.ParameterError, "parent_urdf"),
        ((stand(), "top", sr.InflatableArm), {}, sr.ParameterError, "robot = "),
        (("<mesh/>", "top", ARM), {}, sr.DescriptionError, "mesh"),
        ((stand(), "top", "no/such/file.urdf"), {}, sr.DescriptionError, "cannot read"),
        (("<robot name='a'><link name='top'", "top", ARM), {}, sr.DescriptionError, "not well-formed"),
        ((stand(more="<link name='top'/>"), "top", ARM), {}, sr.DescriptionError, "several that are called 'top'"),
        ((stand(more="<link/>"), "top", ARM), {}, sr.DescriptionError, "without a name"),
        ((stand(more="<link name='loose'/>"), "top", ARM), {}, sr.DescriptionError, "floor, loose"),
        ((stand(more="<joint name='soft_motor_1' type='fixed'><parent link='top'/><child link='l'/></joint><link name='l'/>"),
          "top", ARM), {}, sr.DescriptionError, "already has a link or joint called 'soft_motor_1'"),
        ((ARM, "tip", ARM), {"prefix": ""}, sr.DescriptionError, "has a link or joint called 'base_link'.*another prefix"),
        ((stand(more="<material name='soft_motor_grey'><color rgba='0 0 0 1'/></material>"), "top", ARM), {},
         sr.DescriptionError, "a material of another colour called 'soft_motor_grey'"),
        ((stand().replace("<robot", "<robot xmlns:softrobots='urn:other'"), "top", ARM), {}, sr.DescriptionError, "urn:other"),
        ((SECTIONS, "tip", LUMPED), {}, sr.DescriptionError, "one kind: make both with chain"),
        ((LUMPED, "tip", SECTIONS), {}, sr.DescriptionError, "one kind: make both with chain"),
        ((stand(), "top", ARM), {"prefix": "soft arm"}, sr.ParameterError, "prefix"),
        ((stand(), "top", ARM), {"prefix": None}, sr.ParameterError, "prefix"),
        ((stand(), "top", ARM), {"name": ""}, sr.ParameterError, "name"),
        ((stand(), "top", ARM), {"xyz": (0, 0)}, sr.ParameterError, "xyz"),
        ((stand(), "top", ARM), {"rpy": (0, 0, np.nan)}, sr.ParameterError, "rpy"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(arguments: tuple, options: dict, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        sr.mount(*arguments, **options)


ON_WORLD = '<link name="world"/>' + joint("base_fixed", "world", "base", "0 0 1", "fixed")


def test_references_to_the_joint_on_the_world_get_its_new_name() -> None:
    tags = '<gazebo reference="world"><static>1</static></gazebo><gazebo reference="base_fixed"><a>1</a></gazebo>'
    whole = sr.mount(sr.InflatableArm(), "tip", f'<robot name="r">{ON_WORLD}{tags}</robot>')
    assert '<gazebo reference="soft_base_fixed">' in whole
    assert '<gazebo reference="base_fixed">' not in whole
    assert '<gazebo reference="world">' not in whole


def test_a_world_that_is_the_tip_stays() -> None:
    tag = '<softrobots:tip xmlns:softrobots="urn:softrobots:urdf" link="world"/>'
    model = sr.load_model(sr.mount(sr.InflatableArm(), "tip", f'<robot name="r">{ON_WORLD}{tag}</robot>'))
    assert model.tip == "soft_world"
