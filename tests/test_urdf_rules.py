"""The rules of portable URDF: our files keep them; a change that breaks a tool breaks the rule that says so, and no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.cli.tools.checks import check_description
from softrobots.description.paths import urdf_folder
from softrobots.description.urdf_rules import RULES, check_rules
from softrobots.robots import Robot
from tests.support.foreign import BRANCHED, INERTIAL
from tests.support.tables import each_row

FILES = sorted(urdf_folder().glob("*.urdf"))
ARM = (urdf_folder() / "inflatable_arm.urdf").read_text(encoding="utf-8")
LUMPED = (urdf_folder() / "pcc_arm_lumped.urdf").read_text(encoding="utf-8")
SHAPE = "<collision><origin xyz='{} 0 0' rpy='0 0 0'/><geometry><sphere radius='0.05'/></geometry></collision>"


def broken(urdf: str) -> dict[str, tuple[str, ...]]:
    """The rules that are broken, and how."""
    return {finding.what: finding.problems for finding in check_rules(urdf) if not finding.ok}


@pytest.mark.study
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_shipped_files_keep_every_rule(file: Path) -> None:
    findings = check_description(file)
    assert [finding.what for finding in findings[1 : 1 + len(RULES)]] == list(RULES)
    assert not [finding for finding in findings if not finding.ok]
    assert re.search(r"within \d\.\de-1[5-7] m and \d\.\de-1[5-7] rad of Pinocchio", findings[-1].remarks[0])


def inside(link: str, text: str) -> tuple[str, str]:
    """Put text into a link of the arm."""
    return f'<link name="{link}">', f'<link name="{link}">{text}'


def fixed_link(parent: str, inertial: str = "") -> str:
    """The end of a file, with one more link."""
    joint = f'<joint name="fixed_end" type="fixed"><parent link="{parent}"/><child link="end"/></joint>'
    return f'{joint}<link name="end">{inertial}</link></robot>'


ROLE = '<softrobots:role value="motor"/>'
NAMES, ROOT, MASSES, JOINTS, MIMICS, SHAPES, COLOURS, COLLISIONS, SPRINGS, HINTS, ORDER = RULES

CHANGES = [
    (NAMES, '<robot name="inflatable_arm"', "<robot", "has no name"),
    (NAMES, '<robot name="inflatable_arm"', '<robot name="a" version="1.0"', 'version="1.0"'),
    (NAMES, '<link name="world"/>', '<link name="world"><s:x xmlns:s="s"/></link>', "declared below <robot>"),
    (NAMES, '"motor_1"', '"shoulder"', "'shoulder' is used 2 times"),
    (NAMES, '"shoulder"', '"Schulterst\u00fcck"', "'Schulterst\u00fcck' is not of ASCII"),
    (ROOT, '<link name="world"/>', f'<link name="world">{INERTIAL}</link>', "has a mass"),
    (ROOT, '"world"', '"earth"', "the root is earth"),
    (ROOT, "</robot>", fixed_link("world", INERTIAL), "one fixed joint is required"),
    (MASSES, '<mass value="0.0001"/>', '<mass value="1e-6"/>', "shoulder has the mass 1e-06 kg"),
    (MASSES, '<mass value="0.0001"/>', "<mass/>", "shoulder has the mass nan kg"),
    (MASSES, '<mass value="0.0001"/>', '<mass value="inf"/>', "shoulder has the mass inf kg"),
    (MASSES, 'ixx="3.025e-07"', 'ixx="1e-16"', "shoulder has the moment of inertia"),
    (MASSES, 'ixx="3.025e-07"', 'ixx="3.1e-07"', "above the sum of the others"),
    (MASSES, 'ixx="3.025e-07"', 'ixx="x"', "moment of inertia nan"),
    (MASSES, "</robot>", fixed_link("base_link"), "link end has no mass and inertia"),
    (JOINTS, 'name="motor_2" type="revolute"', 'name="motor_2" type="continuous"', "motor_2 is continuous"),
    (JOINTS, 'lower="-3.141592653589793"', "", "motor_1 has no finite lower"),
    (JOINTS, 'effort="50.0"', 'effort="inf"', "motor_1 has no finite effort"),
    (JOINTS, 'effort="50.0"', 'effort="0.0"', "effort > 0 and velocity > 0"),
    (JOINTS, 'velocity="2.0"', 'velocity="-2.0"', "effort > 0 and velocity > 0"),
    (JOINTS, 'lower="-3.141592653589793"', 'lower="4"', "lower < upper"),
    (JOINTS, 'axis xyz="0.0 -1.0 0.0"', 'axis xyz="0.0 -2.0 0.0"', "a unit vector is required"),
    (JOINTS, 'axis xyz="0.0 -1.0 0.0"', 'axis xyz="0.0 -1.0"', "a unit vector is required"),
    (JOINTS, '<dynamics damping="0.0" friction="0.0"/>', '<dynamics damping="0.0"/>', "motor_1 has no <dynamics>"),
    (JOINTS, 'damping="0.0" friction="0.0"', 'damping="-1.0" friction="0.0"', "motor_1 has no <dynamics>"),
    (MIMICS, ROLE, f'<mimic joint="motor_3"/>{ROLE}', "not on its path"),
    (MIMICS, ROLE, f'<mimic joint="nothing"/>{ROLE}', "mimics 'nothing'"),
    (SHAPES, '<cylinder length="0.11" radius="0.07150000000000001"/>', '<capsule length="0.1" radius="0.1"/>', "is capsule"),
    (SHAPES, '<cylinder length="0.11" radius="0.07150000000000001"/>', '<mesh filename="a.stl"/>', "is mesh"),
    (SHAPES, '<cylinder length="0.11" radius="0.07150000000000001"/>', "", "is nothing"),
    (SHAPES, '<cylinder length="0.11" radius="0.07150000000000001"/>', '<cylinder length="0.0" radius="1"/>', "of the sizes"),
    (SHAPES, '<cylinder length="0.11" radius="0.07150000000000001"/>', '<cylinder length="0.1"/>', "of the sizes []"),
    (COLOURS, '<color rgba="0.95 0.62 0.22 1.0"/>', "", "a name and a <color> inside are required"),
    (COLOURS, '"inflatable_2"', '"motor_grey"', "'motor_grey' has the colours"),
    (COLLISIONS, *inside("link_1_root", SHAPE.format(0.1)), "link_1_root and link_1 overlap"),
    (SPRINGS, ROLE, "", "spring_1_up has no <softrobots:role>"),
    (SPRINGS, "<springStiffness>172.71<", "<springStiffness>172.7<", "('172.71', '0.0') and the copy ('172.7', '0.0')"),
    (SPRINGS, '<gazebo reference="spring_1_up">', '<gazebo reference="tip_fixed">', "tip_fixed, which does not move"),
    (HINTS, 'fusestatic="false"', "", 'fusestatic="false"/></mujoco> is missing'),
    (HINTS, "<mujoco>", "<mujoco_>", "discardvisual"),
    (HINTS, "<preserveFixedJoint>true", "<preserveFixedJoint>false", 'reference="tip_fixed"'),
    (HINTS, '"tip"', '"end"', "there is no link tip"),
]  # fmt: skip


@each_row(("rule", "before", "after", "message"), CHANGES)
def test_a_change_breaks_the_rule_that_it_should(rule: str, before: str, after: str, message: str) -> None:
    found = broken(changed(rule, before, after))
    assert list(found) == [rule]
    assert any(message in text for text in found[rule]), found


def changed(rule: str, before: str, after: str) -> str:
    """The arm with a change: everywhere if it is a name, once if it is a number or a tag."""
    assert before in ARM
    if before == ROLE and rule == SPRINGS:  # of a spring: a motor without would be foreign
        start = ARM.index('name="spring_1_up"')
        return ARM[:start] + re.sub(r'<softrobots:role value="spring"/>', "", ARM[start:], count=1)
    if "mujoco" in before:
        return ARM.replace("<mujoco>", "<mujoco_>").replace("</mujoco>", "</mujoco_>")
    everywhere = before.startswith('"') and before not in ('"motor_1"', '"inflatable_2"')
    return ARM.replace(before, after) if everywhere else ARM.replace(before, after, 1)


def test_every_rule_has_a_change_that_breaks_it() -> None:
    assert {change[0] for change in CHANGES} | {ORDER} == set(RULES)


def test_mimics_of_mimics_are_refused_and_others_are_not() -> None:
    """Masters before followers: the spring joints of one link, bound to the first motor."""
    follower = '<mimic joint="motor_1"/><softrobots:role value="spring"/>'
    once = ARM.replace('<softrobots:role value="spring"/>', follower, 1)
    assert not broken(once)
    twice = follower.replace("motor_1", "spring_1_side").join(once.rsplit('<softrobots:role value="spring"/>', 1))
    assert broken(twice) == {
        MIMICS: ("joint spring_2_up mimics 'spring_1_side'; a movable joint that mimics none is required",)
    }


def test_hinges_in_one_order_are_refused() -> None:
    """Swapping the names bend_x and bend_y in all sections that bend about y first makes every hinge bend about x first."""
    text = LUMPED
    for i in (2, 3, 6, 7, 10, 11):
        for s in (1, 2):
            text = re.sub(
                f'bend_x="section_{s}_{i}_bend_x" bend_y="section_{s}_{i}_bend_y"',
                f'bend_x="section_{s}_{i}_bend_y" bend_y="section_{s}_{i}_bend_x"',
                text,
            )
    (problem,) = broken(text)[ORDER]
    assert problem.startswith("24 sections bend about x first, 0 about y")


def test_collision_shapes_of_neighbours_may_overlap() -> None:
    """Parent and child are exempt in every simulator; a shape on the tiny link between makes neighbours of them."""
    before, after = inside("hinge_1", SHAPE.format(0.06))
    assert not broken(ARM.replace(before, after))


def test_a_robot_of_somebody_else_is_held_to_the_rules_that_it_can_know() -> None:
    """Without tags of ours no role and no hint is asked for; the rest is."""
    found = broken(BRANCHED)
    assert set(found) == {ROOT, JOINTS}
    assert found[ROOT] == ("the root is base; a link world without mass is required",)
    findings = {finding.what: finding for finding in check_description(BRANCHED)}
    assert findings["softrobots"].remarks == ("no springs; load_model needs springs={joint: stiffness}",)
    assert findings["yourdfpy's kinematics"].ok


def test_what_carries_a_robot_of_ours_is_not_ours() -> None:
    """A light link of the carrier is a remark, the same on the mounted robot is wrong."""
    light = BRANCHED.replace('<mass value="0.5"/>', '<mass value="0.0"/>', 1).replace('"base"', '"bottom"')
    whole = mounted_by_hand(light)
    findings = {finding.what: finding for finding in check_rules(whole)}
    assert all(finding.ok for finding in findings.values()), findings
    assert "the root is bottom; a link world without mass is required (third-party)" in findings[ROOT].remarks
    assert "joint shoulder is continuous; revolute, prismatic or fixed is required (third-party)" in findings[JOINTS].remarks
    hinge = re.search(r'<link name="hinge_1">.*?<mass value="([^"]*)"', whole, re.S)
    spoiled = whole[: hinge.start(1)] + "0.0" + whole[hinge.end(1) :]
    assert broken(spoiled) == {MASSES: ("link hinge_1 has the mass 0.0 kg; more than 1e-06 kg is required",)}


def mounted_by_hand(carrier: str) -> str:
    """The inflatable arm on the link `finger` of another robot."""
    arm = ARM.replace('<link name="world"/>', "").replace('<parent link="world"/>', '<parent link="finger"/>')
    arm = arm.replace('name="inflatable_arm"', 'name="both"')
    return arm.replace("</robot>", carrier.split(">", 1)[1])


@each_row(
    ("source", "message"),
    [
        ("<robots/>", "root tag <robots>"),
        ('<robot name="r"', "not well-formed"),
        ('<robot name="r"><s:x/></robot>', "unbound prefix"),
        ("/nowhere/robot.urdf", "cannot read"),
    ],
)
def test_what_is_no_urdf_is_refused(source: str, message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        check_description(source)


@each_row(
    ("before", "after", "what", "message"),
    [
        ('stiffness="172.71"', 'stiffness="-1"', "tags of softrobots", "a positive number is required"),
        ('stiffness="172.71"', 'stiffness="-1"', "softrobots", "a positive number is required"),
        ('name="motor_1" type="revolute"', 'name="motor_1" type="planar"', "softrobots", "revolute, continuous and prismatic"),
        ('name="motor_1" type="revolute"', 'name="motor_1" type="planar"', "yourdfpy's kinematics", "not revolute"),
        ("<limit ", "<limits ", "Pinocchio", ""),
        ('<robot name="inflatable_arm" ', "<robot ", "Pinocchio", ""),
    ],
)
def test_what_cannot_be_loaded_is_said(before: str, after: str, what: str, message: str) -> None:
    findings = {finding.what: finding for finding in check_description(ARM.replace(before, after))}
    assert not findings[what].ok
    assert message in findings[what].problems[0]
    if what == "Pinocchio":
        assert "yourdfpy" not in findings


def test_a_robot_that_is_too_large_to_be_compared_is_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit of Pinocchio's workspace, as everywhere, is told at once. Here it is small, for a long arm takes seconds."""
    monkeypatch.setattr("softrobots.cli.tools.kinematics.MAX_DOF", 6)
    findings = {finding.what: finding for finding in check_description(sr.InflatableArm())}
    assert findings["yourdfpy's kinematics"].problems == ("inflatable_arm has 7 movable joints; from 1 to 6 can be compared",)
    assert [what for what, finding in findings.items() if not finding.ok] == ["yourdfpy's kinematics"]


def test_robots_paths_and_text_are_checked_alike(tmp_path: Path) -> None:
    robot: Robot = sr.InflatableArm()
    (tmp_path / "arm.urdf").write_text(robot.urdf(), encoding="utf-8")
    found = [check_description(source) for source in (robot, robot.urdf(), tmp_path / "arm.urdf", str(tmp_path / "arm.urdf"))]
    assert found[0] == found[1] == found[2] == found[3]
    with pytest.raises(sr.ParameterError, match="a robot, a path, or URDF text"):
        check_description(3)
