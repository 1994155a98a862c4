"""The examples of docs/own_robot.md: their files are those of the page, and they do what closed forms say."""

from __future__ import annotations

import math
import re
import runpy
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.tools.checks import check_description
from softrobots.description import expansion as description
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from tests.conftest import CHECKOUT

pytestmark = pytest.mark.system

EXAMPLES = CHECKOUT / "docs" / "examples"
PAGE = (CHECKOUT / "docs" / "own_robot.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def finger() -> Any:
    return runpy.run_path(str(EXAMPLES / "soft_finger.py"))["SoftFinger"]()


@pytest.fixture(scope="module")
def model(finger: Any) -> sr.SoftModel:
    return sr.load_model(finger)


def closing_angle(equilibrium: sr.Equilibrium) -> float:
    rotation = equilibrium.transform_tip_to_world.rotation
    return math.atan2(rotation[0, 2], rotation[2, 2])


def test_the_page_shows_every_example_as_it_is() -> None:
    shown = dict(re.findall(r"^<!-- file: (\S+) -->\n```\w+\n(.*?)^```$", PAGE, flags=re.DOTALL | re.MULTILINE))
    assert shown == {file.name: file.read_text(encoding="utf-8") for file in EXAMPLES.iterdir() if file.is_file()}


# --- Files outside of the package, with the macros of the package


def test_a_file_anywhere_finds_the_macros(tmp_path: Path) -> None:
    folder = tmp_path / "my robots [1]"
    folder.mkdir()
    shutil.copy(EXAMPLES / "tool_arm.urdf.xacro", folder)
    assert expand(folder / "tool_arm.urdf.xacro") == expand(EXAMPLES / "tool_arm.urdf.xacro")


def test_the_package_may_be_in_a_folder_that_looks_like_a_pattern(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """xacro takes brackets in the name of an included file for a pattern."""
    expected = expand(EXAMPLES / "tool_arm.urdf.xacro")
    moved = tmp_path / "site [packages]"
    shutil.copytree(xacro_folder(), moved)
    monkeypatch.setattr(description, "xacro_folder", lambda: moved)
    assert expand(EXAMPLES / "tool_arm.urdf.xacro") == expected


def test_another_folder_of_macros_counts_if_it_is_given(tmp_path: Path) -> None:
    file = EXAMPLES / "tool_arm.urdf.xacro"
    assert expand(file, {"softrobots": str(xacro_folder())}) == expand(file)
    with pytest.raises(sr.DescriptionError, match="nowhere"):
        expand(file, {"softrobots": str(tmp_path / "nowhere")})


def test_a_file_that_does_not_ask_gets_no_folder() -> None:
    with pytest.raises(sr.DescriptionError, match="has no argument 'softrobots'"):
        expand(xacro_folder() / "pcc_arm.urdf.xacro", {"softrobots": "/"})


@pytest.mark.parametrize("name", ["tool_arm", "soft_finger"])
def test_the_examples_obey_every_rule(name: str) -> None:
    findings = check_description(expand(EXAMPLES / f"{name}.urdf.xacro"))
    assert len(findings) > 10
    assert not [(finding.what, finding.problems) for finding in findings if not finding.ok]


def test_links_of_the_arm_are_those_of_its_arguments() -> None:
    """Against the beam and the stretched length, which know nothing of the file."""
    arm = sr.load_model(expand(EXAMPLES / "tool_arm.urdf.xacro", {"link_lengths": "[0.6,0.5,0.4]"}))
    straight = sr.solve_equilibrium(arm, (0, 0, 0, 0))
    assert straight.tip_position == pytest.approx([1.5 + 0.08, 0.0, 0.0], abs=1e-15)  # rounding of a sum of lengths
    moments = [group.wrinkling_moment for group in arm.spring_groups]
    assert moments == [inflated_beam.wrinkling_moment(p, r) for p, r in ((60e3, 0.07), (50e3, 0.055), (40e3, 0.04))]
    assert arm.spring_table["tool_spring"] == (40.0, 0.0)


@pytest.mark.parametrize("arguments", [{"tool_stiffness": "-1"}, {"link_lengths": "[0.5,0.4]"}, {"tool_stifness": "1"}])
def test_the_arm_refuses_bad_arguments(arguments: dict[str, str]) -> None:
    with pytest.raises(sr.DescriptionError, match=next(iter(arguments))):
        expand(EXAMPLES / "tool_arm.urdf.xacro", arguments)


# --- The finger


@pytest.mark.parametrize("pressure", [0.0, 5e3, 40e3, 80e3])
def test_the_free_finger_closes_and_stretches_as_a_rod_does(pressure: float, finger: Any, model: sr.SoftModel) -> None:
    """Moment and thrust are the same in every section, so hinges and rod agree exactly, up to the tolerance of the solver."""
    free = sr.solve_equilibrium(model, (pressure,))
    thrust = pressure * finger.chamber_area
    angle = thrust * finger.chamber_distance * finger.length / finger.bending_stiffness
    stretched = finger.length * (1.0 + thrust / finger.axial_stiffness)
    assert closing_angle(free) == pytest.approx(angle, abs=1e-9)
    assert finger.closing_angle(pressure) == pytest.approx(angle, rel=1e-15)
    assert free.muscle_lengths[0] == pytest.approx(stretched + finger.chamber_distance * angle, abs=1e-10)
    assert free.stable


def test_the_grip_is_that_of_a_cantilever_when_small(finger: Any, model: sr.SoftModel) -> None:
    """3 M / 2 L; eight hinges in the middle of their sections are off by about 1 / (4 n^2)."""
    way = sr.solve_equilibrium(model, (100.0,)).tip_position[0]
    held = sr.solve_imposed_displacement(model, (100.0,), way, direction=(-1, 0, 0))
    assert held.reaction == pytest.approx(1.5 * 100.0 * 1.5e-4 * 0.008 / 0.1, rel=5e-3)
    assert held.stable


def test_mujoco_closes_the_finger_as_far(finger: Any, model: sr.SoftModel, tool: Callable[[str], ModuleType]) -> None:
    mujoco = tool("mujoco")
    free = sr.solve_equilibrium(model, (30e3,))
    theirs = mujoco.MjModel.from_xml_string(sr.export.to_mjcf(model, free.q_motors, actuators="welded"))
    data = mujoco.MjData(theirs)
    names = [mujoco.mj_id2name(theirs, mujoco.mjtObj.mjOBJ_JOINT, number) for number in range(theirs.njnt)]
    data.qpos[:] = [free.q_springs[model.spring_joints.index(name)] for name in names]
    mujoco.mj_forward(theirs, data)
    assert np.abs(data.qfrc_passive).max() < 1e-12  # N m or N: springs in balance, to rounding of 0.036 N m and 4.5 N


@pytest.mark.parametrize("field", ["length", "chamber_area", "hinges"])
def test_the_finger_refuses_bad_parameters(field: str, finger: Any) -> None:
    with pytest.raises(sr.ParameterError, match=field):
        type(finger)(**{field: -1})


def test_three_fingers_reach_the_cylinder(finger: Any, model: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """The grip of a finger alone, turned three ways, puts every fingertip of the hand on the cylinder."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example = runpy.run_path(str(EXAMPLES / "three_fingers.py"))
    sys.modules.pop("soft_finger")
    pressure = 50e3
    way = example["way_to_close"](finger, sr.solve_equilibrium(model, (pressure,)).tip_position[0])
    force = sr.solve_imposed_displacement(model, (pressure,), way, direction=(-1, 0, 0)).reaction
    assert force > 0.0
    text = example["three_fingers"](finger)
    for name, angle in example["FINGERS"].items():
        hand = sr.load_model(text, tip=f"{name}tip")
        pushed = (force * math.cos(angle), force * math.sin(angle), 0.0)
        tip = sr.solve_equilibrium(hand, (pressure,) * 3, pushed).tip_position
        expected = 0.015 + finger.radius
        assert tip[:2] == pytest.approx([expected * math.cos(angle), expected * math.sin(angle)], abs=1e-9)  # reach is 0.1 m


# --- Muscles whose lengths do not fix a shape


def test_a_single_muscle_loads_with_its_length_too(finger: Any) -> None:
    """One length holds one combination of strains; the rest is free, and without load the muscle carries nothing."""
    text = re.sub(r' kind="pressure"| area="[^"]*"| max_pressure="[^"]*"', "", finger.urdf())
    text = text.replace("<softrobots:actuator ", '<softrobots:actuator kind="length" ')
    model = sr.load_model(text)
    found = sr.solve_equilibrium(model, model.relaxed_motors)
    assert model.n_springs == sr.load_model(finger).n_springs - 1
    assert found.muscle_forces == pytest.approx(0.0, abs=1e-12)
    told = {finding.what: finding for finding in check_description(text)}["softrobots"]
    assert told.ok
    assert told.remarks[0].startswith("loads: 1 motors")


def test_the_check_still_tells_what_tensions_do_not_mend(finger: Any) -> None:
    fixed = finger.urdf().replace('name="section_1_1_bend_x" type="revolute"', 'name="section_1_1_bend_x" type="fixed"')
    told = {finding.what: finding for finding in check_description(fixed)}["softrobots"]
    assert not told.ok
    assert "section_1_1_bend_x, which cannot move" in told.problems[0]
