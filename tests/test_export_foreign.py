"""Robots of others that no exporter or reader may spoil: plates, points, names, limits without end, odd actuators."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_rules import check_rules
from softrobots.export import to_json, to_mjcf, to_pinocchio, to_sdf
from tests.support.foreign import mass_error
from tests.support.tables import each_row

Tool = Callable[[str], Any]
BALL = "0.01 0.01 0.01"
BOUNDS = '<limit lower="-1" upper="1" effort="3" velocity="1"/>'


def inertial(moments: str = BALL, rpy: str = "0 0 0") -> str:
    xx, yy, zz = moments.split()
    rest = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    return f'<inertial><origin xyz="0 0 0.1" rpy="{rpy}"/><mass value="0.1"/>{rest}'


def two_links(
    end: str = inertial(), root: str = "base", inner: str = "l1", second: str = "f", more: str = "", **first: str
) -> str:
    kind, bounds = first.get("kind", "revolute"), first.get("bounds", BOUNDS)
    return f"""<robot name="r"><link name="{root}"/><link name="{inner}">{inertial()}</link><link name="l2">{end}</link>
    <joint name="j" type="{kind}"><parent link="{root}"/><child link="{inner}"/><axis xyz="0 1 0"/>{bounds}</joint>
    <joint name="{second}" type="revolute"><origin xyz="0 0 0.2"/><parent link="{inner}"/><child link="l2"/><axis xyz="1 0 0"/>
    {BOUNDS}</joint>{more}</robot>"""


def loaded(urdf: str, second: str = "f", **options: Any) -> sr.SoftModel:
    return sr.load_model(urdf, springs={"j": 2.0, second: 3.0}, **options)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("share", [1.0, 0.9])
def test_a_flat_plate_in_turned_axes_is_a_body(tool: Tool, seed: int, share: float) -> None:
    """Its moments fulfil a + b = c, which rounding breaks in half of the files; MuJoCo allows nothing."""
    mujoco, random = tool("mujoco"), np.random.default_rng(seed)
    a, b = random.uniform(1e-4, 1e-2, 2).tolist()
    rpy = " ".join(map(repr, random.uniform(-3.0, 3.0, 3).tolist()))
    model = loaded(two_links(inertial(f"{a!r} {b!r} {max(a, b, share * (a + b))!r}", rpy)))
    there = mujoco.MjModel.from_xml_string(to_mjcf(model))
    data, q = mujoco.MjData(there), random.uniform(-1.0, 1.0, 2)
    data.qpos[:] = q
    mujoco.mj_forward(there, data)
    ours, theirs = pin.crba(model.pinocchio, model.pinocchio.createData(), q), np.zeros((2, 2))
    for column in range(2):
        mujoco.mj_mulM(there, data, theirs[column], np.eye(2)[column])
    # Of 0.02 kg m^2.
    assert np.triu(theirs) == pytest.approx(np.triu(ours), abs=max(1e-14, 1e-2 * mass_error(mujoco)))


def test_a_point_mass_that_is_fixed_is_carried(tool: Tool) -> None:
    point = (
        '<link name="point"><inertial><mass value="0.2"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    more = point + '</link><joint name="g" type="fixed"><parent link="l2"/><child link="point"/></joint>'
    there = tool("mujoco").MjModel.from_xml_string(to_mjcf(loaded(two_links(more=more))))
    assert there.body("point").mass[0] == 0.2


@pytest.mark.parametrize(
    ("moments", "reason"),
    [("0 0 0", "without moments"), *((text, "MuJoCo refuses") for text in ("0.05 0.01 0.01", "-0.01 0.01 0.01"))],
)
def test_inertia_that_mujoco_refuses_is_refused_with_the_link(moments: str, reason: str) -> None:
    with pytest.raises(sr.DescriptionError, match=rf"(?s)l2.*{reason}|{reason}.*l2"):
        to_mjcf(loaded(two_links(inertial(moments))))


def test_names_of_the_exporter_give_way(tool: Tool) -> None:
    for text in (two_links(second="base_to_world"), two_links(root="world", inner="world_shapes", second="base_to_world")):
        parser = tool("pydrake.multibody.parsing").Parser
        plant = tool("pydrake.multibody.plant").MultibodyPlant(0.0)
        parser(plant).AddModelsFromString(to_sdf(loaded(text, "base_to_world")), "sdf")
        plant.Finalize()
        assert plant.num_positions() == 2


@each_row(("name", "write"), [("world", to_mjcf), ("world", to_sdf), ("a::b", to_sdf), ("__a__", to_sdf)])
def test_names_that_a_format_keeps_for_itself_are_refused(name: str, write: Any) -> None:
    with pytest.raises(sr.DescriptionError, match=name):
        write(loaded(two_links(inner=name)))


def test_a_slide_without_end_has_no_limits_in_json() -> None:
    model = loaded(two_links(kind="prismatic", bounds='<limit lower="-1e30" upper="0.5" effort="3" velocity="1"/>'))
    joint = json.loads(to_json(model))["joints"][0]
    assert "lower" not in joint
    assert joint["upper"]["value"] == 0.5


@pytest.mark.parametrize("where", ["", "inside"])
def test_colours_by_name(where: str) -> None:
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    box = '<visual><geometry><box size="1 1 1"/></geometry>{}</visual>'
    end = inertial() + (box.format(red) if where else "") + box.format('<material name="red"/>')
    tree = read_rigid_tree(two_links(end, more="" if where else red))
    assert [shape.rgba for shape in tree.body("l2").visuals] == [(1.0, 0.0, 0.0, 1.0)] * (2 if where else 1)


@pytest.mark.parametrize(
    "actuator",
    [
        '<motor joint="j" ctrlrange="1 2"/>',
        '<motor joint="j" forcerange="1 2"/>',
        '<general joint="j" dyntype="integrator" actlimited="true" actrange="1 2"/>',
    ],
)
def test_an_actuator_whose_range_leaves_out_zero_pulls(tool: Tool, actuator: str) -> None:
    mujoco = tool("mujoco")
    body = '<body name="a"><joint name="j" stiffness="3" damping="1"/><geom size="0.1" pos="0.2 0 0"/></body>'
    text = f'<mujoco><option gravity="0 0 0"/><worldbody>{body}</worldbody><actuator>{actuator}</actuator></mujoco>'
    there = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(there)
    mujoco.mj_step(there, data, nstep=100)
    assert data.qpos[0] > 1e-3  # it does
    with pytest.raises(sr.DescriptionError, match="force of their own"):
        sr.load_model(text)


def test_a_made_up_name_that_is_taken_is_told(tool: Tool) -> None:
    tool("mujoco")
    inner = '<body><joint name="k" stiffness="1"/><geom size="0.1"/></body>'
    text = f'<mujoco><worldbody><body name="body_2"><joint stiffness="1"/><geom size="0.1"/>{inner}</body></worldbody></mujoco>'
    with pytest.raises(sr.DescriptionError, match="body_2"):
        sr.load_model(text)


def test_two_springs_for_gazebo_on_one_joint_are_found() -> None:
    urdf = sr.InflatableArm().urdf()
    start = urdf.index("<gazebo reference")
    copy = urdf[start : urdf.index("</gazebo>", start) + len("</gazebo>")]
    other = copy.replace("172.71", "9.0")
    assert other != copy
    broken = [problem for finding in check_rules(urdf.replace(copy, other + copy)) for problem in finding.problems]
    assert any("2 springs for Gazebo" in problem for problem in broken)


@pytest.mark.parametrize(("stiffness", "told"), [(0.1, "unstable"), (9.0, "")])
def test_the_file_on_pinocchio_says_that_an_equilibrium_is_unstable(
    stiffness: float, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model = sr.load_model(two_links(), springs={"j": stiffness, "f": stiffness})
    names: dict[str, Any] = {"__name__": "robot"}
    exec(compile(to_pinocchio(model, gravity=(0.0, 0.0, -9.81)), "robot.py", "exec"), names)
    names["main"]()
    assert ("unstable" in capsys.readouterr().out) == bool(told)
    assert names["stable"](names["REST"], gravity=(0.0, 0.0, -9.81)) == (not told)


def test_shapes_that_overlap_beyond_the_next_are_found() -> None:
    """No simulator leaves that pair out: MuJoCo then rests 0.03 rad off."""
    ball = '<collision><origin xyz="-0.5 0 0"/><geometry><sphere radius="0.08"/></geometry></collision>'
    urdf = sr.InflatableArm(link_lengths=(0.3, 0.3, 0.3)).urdf()
    broken = urdf.replace('<link name="link_3">', '<link name="link_3">' + ball)
    assert not [problem for finding in check_rules(urdf) for problem in finding.problems]
    assert [p for finding in check_rules(broken) for p in finding.problems if "link_1 and link_3 overlap" in p]
