"""The JSON beside a URDF: it suffices to load the robot again, and every source leads to the number that it stands beside."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.expansion import argument_notes
from softrobots.description.paths import urdf_folder
from softrobots.export import export_model, to_json
from softrobots.inflated_beam import wrinkling_moment
from softrobots.robots import XacroRobot
from softrobots.robots.fields import facts_of
from tests.support.foreign import BRANCHED, SPRINGS

NAMES = {name: getattr(math, name) for name in ("pi", "sqrt", "sin", "cos")} | {"__builtins__": {}}
PARTS = ("joints", "inflated_links", "sections", "lumped_sections", "muscles", "lines")

ROBOTS: dict[str, XacroRobot] = {
    "arm": sr.InflatableArm(),
    "odd arm": sr.InflatableArm(
        link_lengths=(0.5, 0.4, 0.3), radius=(0.06, 0.05, 0.04), rest_up=(-0.1, 0.03, 0.06), pressure=6e4, max_moment=20.0
    ),
    "arm of two hinges": sr.InflatableArm(link_model="two_hinges", rest_up=0.1, radius=(0.055, 0.05)),
    "arm of two hinges that twist": sr.InflatableArm(link_model="two_hinges", torsion=True, stiffness=140.0),
    "arm of a wall": sr.InflatableArm(young_modulus=(1.2e8, 1.4e8), shear_modulus=1e7),
    "pcc": sr.PccArm(elastic_sections=3),
    "lumped pcc": sr.PccArm(
        chain="lumped",
        hinges=2,
        segment_lengths=(0.5, 0.3, 0.2),
        bending_stiffness=(2.0, 1.5, 1.0),
        muscle_azimuths=(0.0, 1.5, 3.0, 4.5),
        muscle_distance=(0.05, 0.04, 0.03),
    ),
    "midpoint pcc": sr.PccArm(chain="lumped", hinges=3, hinge_rule="midpoint", torsion=False, extension=False),
    "one hinge": sr.PccArm(chain="lumped", hinges=1),
    "flexures": sr.PccArm(chain="flexures", hinges=4, muscle_azimuths=(), rest_bend_x=0.2),
    "three flexures": sr.PccArm(chain="flexures", hinges=3, muscle_azimuths=(), segment_lengths=(0.4, 0.3), damping_time=0.01),
    "flexures of one length": sr.PccArm(chain="flexures", hinges=2, muscle_azimuths=(), extension=False),
    "chambers": sr.PccArm(kind=("pressure", "mckibben"), elastic_sections=2, muscle_azimuths=(0.0, 2.0, 4.0)),
    "muscles from the base": sr.PccArm(
        segment_lengths=(0.5, 0.3, 0.2),
        offset=(0.1, 0.4, -0.7),
        routing=("segment", "base", 2),
        kind="elastic",
        elastic_sections=1,
    ),
    "tendons": sr.TendonArm(elastic_sections=2, offset=0.3),
    "measured tendons": sr.TendonArm(chain="lumped", hinges=2, bending_stiffness=(3e-3, 2e-3, 1e-3), kind="tension"),
    "helix": sr.HelixTube(length=0.6, elastic_sections=4),
    "lumped helix": sr.HelixTube(chain="lumped", hinges=4, handedness="left", torsional_stiffness=0.01),
    "straight tube": sr.HelixTube(contraction=1.0, angle=0.0, elastic_sections=4),
    "tube with an actuator": sr.HelixTube(length=0.6, elastic_sections=4, actuator="length", handedness="left"),
    "tube with an elastic actuator": sr.HelixTube(length=0.6, elastic_sections=4, actuator="elastic", bending_stiffness=0.01),
}


def read(text: str) -> Any:
    """JSON without the words that are no JSON."""

    def refuse(word: str) -> None:
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def numbers(content: Any) -> Iterator[dict[str, Any]]:
    """Everything that has a value."""
    if isinstance(content, Mapping) and "value" in content:
        assert content.keys() == {"value", "unit", "source"}
        yield dict(content)
    elif isinstance(content, Mapping | list):
        for part in content.values() if isinstance(content, Mapping) else content:
            yield from numbers(part)


def assert_sources_lead_to_numbers(robot: XacroRobot) -> int:
    """Evaluate every source in terms of the parameters. 1e-12: the xacro macros do the same sums in another order."""
    content = read(to_json(sr.load_model(robot), robot))
    names = NAMES | {name: entry["value"] for kind in ("parameters", "derived") for name, entry in content[kind].items()}
    for derived in content["derived"].values():
        first = derived["value"][0] if isinstance(derived["value"], list) else derived["value"]
        assert eval(derived["source"], names) == pytest.approx(first, rel=1e-12, abs=1e-15)
    count = 0
    for number in numbers([content[part] for part in PARTS]):
        found = eval(number["source"], names)
        assert found == pytest.approx(number["value"], rel=1e-12, abs=1e-15), number
        count += 1
    return count


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_every_source_leads_to_its_number(name: str) -> None:
    robot = ROBOTS[name]
    assert assert_sources_lead_to_numbers(robot) > 3 * robot.n_joints  # limits and damping of each


lengths = st.lists(st.floats(0.1, 1.0), min_size=1, max_size=2)


@settings(max_examples=5)
@given(
    lengths=lengths, hinges=st.integers(1, 6), rule=st.sampled_from(["corrected", "midpoint"]), stiffness=st.floats(0.1, 9.0)
)
def test_sources_of_other_lumped_arms(lengths: list[float], hinges: int, rule: str, stiffness: float) -> None:
    robot = sr.PccArm(
        segment_lengths=lengths, hinges=hinges, hinge_rule=rule, chain="lumped", bending_stiffness=stiffness, muscle_azimuths=()
    )
    assert_sources_lead_to_numbers(robot)


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_the_file_and_the_urdf_are_enough_to_load_the_robot(name: str) -> None:
    """The same equilibrium, to the last bit: the numbers are whole."""
    robot = ROBOTS[name]
    muscles = "forces" if getattr(robot, "muscle_azimuths", ()) and robot.chain == "lumped" else "lengths"
    model = sr.load_model(robot, muscles=muscles)
    content = read(to_json(model, robot))
    again = reloaded(content, robot.urdf())
    assert again == model
    case: dict[str, Any] = {"force": (0.1, 0.2, -0.1), "gravity": sr.EARTH_GRAVITY}
    one, two = (sr.solve_equilibrium(each, model.relaxed_motors, **case) for each in (model, again))
    assert np.array_equal(one.q, two.q)


def reloaded(content: Any, urdf: str) -> sr.SoftModel:
    joints = content["joints"]
    springs = {row["name"]: (row["stiffness"]["value"], row["rest"]["value"]) for row in joints if row["role"] == "spring"}
    motors = [row["name"] for row in joints if row["role"] == "motor"]
    return sr.load_model(urdf, springs=springs, motors=motors, tip=content["tip"], muscles=content["muscle_input"])


def test_a_foreign_robot() -> None:
    """What the caller said is not in the URDF, and the file says so."""
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger", motors=["shoulder", "elbow"])
    content = read(to_json(model))
    rows = {row["name"]: row for row in content["joints"]}
    assert {name: row["role"] for name, row in rows.items()} == {
        "shoulder": "motor", "elbow": "motor", "wrist": "spring", "slider": "spring", "gripper": "locked"
    }  # fmt: skip
    assert rows["wrist"]["stiffness"] == {"value": 20.0, "unit": "N m/rad", "source": "given by the caller"}
    assert rows["wrist"]["rest"] == {"value": 0.1, "unit": "rad", "source": "given by the caller"}
    assert rows["slider"]["stiffness"] == {"value": 800.0, "unit": "N/m", "source": "given by the caller"}
    assert rows["slider"]["lower"] == {"value": -2.0, "unit": "m", "source": "<limit> of the URDF"}
    assert rows["elbow"]["damping"] == {"value": 0.0, "unit": "N m s/rad", "source": "<dynamics> of the URDF"}
    assert not rows["shoulder"].keys() & {"lower", "upper", "stiffness"}  # continuous
    assert not content.keys() & {"parameters", "derived", "made_by"}
    again = reloaded(content, BRANCHED)
    assert again == model


def test_a_file_of_ours_without_its_parameters() -> None:
    model = sr.load_model(urdf_folder() / "pcc_arm_lumped.urdf", muscles="forces")
    content = read(to_json(model))
    sources = {number["source"] for number in numbers(content["muscles"])}
    assert sources == {"<softrobots:actuator> of the URDF", "<softrobots:route> of the URDF"}
    assert {number["source"] for number in numbers(content["lumped_sections"])} == {"<softrobots:lumped_section> of the URDF"}
    arms = content["muscles"][1]["arms"]
    assert len(arms) == 36  # two bendings and the stretch of twelve hinges
    assert arms["section_1_3_bend_x"] == pytest.approx(0.04 * math.sin(-2 * math.pi / 3), rel=1e-14)
    assert arms["section_1_3_bend_y"] == pytest.approx(-0.04 * math.cos(-2 * math.pi / 3), rel=1e-14)
    assert arms["section_1_3_stretch"] == 1.0


def test_springs_of_the_caller_beside_those_of_a_robot() -> None:
    robot = sr.InflatableArm()
    table = sr.load_model(robot).spring_table | {"spring_1_up": (100.0, 0.0)}
    rows = {row["name"]: row for row in read(to_json(sr.load_model(robot, springs=table), robot))["joints"]}
    assert rows["spring_1_up"]["stiffness"] == {"value": 100.0, "unit": "N m/rad", "source": "given by the caller"}
    assert rows["spring_2_up"]["stiffness"]["source"] == "spring_stiffness[1]"


def test_yourdfpy_finds_every_joint_by_the_file_alone(tmp_path: Path) -> None:
    import yourdfpy

    for robot in (ROBOTS["odd arm"], ROBOTS["lumped pcc"]):
        (tmp_path / "robot.urdf").write_text(robot.urdf(), encoding="utf-8")
        content = read(to_json(sr.load_model(robot), robot))
        tree = yourdfpy.URDF.load(str(tmp_path / "robot.urdf"), load_meshes=False, build_collision_scene_graph=False)
        assert {row["name"] for row in content["joints"]} == set(tree.actuated_joint_names)
        for row in content["joints"]:
            joint = tree.joint_map[row["name"]]
            assert (row["type"], row["parent"], row["child"]) == (joint.type, joint.parent, joint.child)
            assert (row["lower"]["value"], row["upper"]["value"]) == (joint.limit.lower, joint.limit.upper)
            assert row["damping"]["value"] == float(joint.dynamics.damping)  # yourdfpy keeps the text
        assert content["tip"] in tree.link_map
        for muscle in content["muscles"]:
            assert muscle["arms"].keys() <= set(tree.joint_map)


def test_a_foreign_link_with_one_hinge_keeps_its_twist() -> None:
    text = ROBOTS["arm of two hinges that twist"].urdf().replace('hinges="2"', 'hinges="1"')
    links = read(to_json(sr.load_model(text)))["inflated_links"]
    assert [(link.get("hinges", 1), link["twist"]) for link in links] == [(1, "spring_1_twist"), (1, "spring_2_twist")]


def test_inflated_links() -> None:
    robot = ROBOTS["odd arm"]
    links = read(to_json(sr.load_model(robot), robot))["inflated_links"]
    assert [link["springs"] for link in links] == [[f"spring_{i}_side", f"spring_{i}_up"] for i in (1, 2, 3)]
    assert [link["wrinkling_moment"]["value"] for link in links] == [wrinkling_moment(6e4, r) for r in (0.06, 0.05, 0.04)]
    assert [link["max_moment"]["value"] for link in links] == [20.0] * 3
    assert not {"max_moment", "moment_law"} & read(to_json(sr.load_model(sr.InflatableArm())))["inflated_links"][0].keys()
    slack = read(to_json(sr.load_model(sr.InflatableArm(moment_law="slack_wall"))))
    assert [link["moment_law"] for link in slack["inflated_links"]] == ["slack_wall"] * 2
    assert "slack_wall" in slack["conventions"]["moment_law"]


# --- Parameters


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_parameters_and_their_sources(name: str) -> None:
    """One a field; a value that would be the same without being given has the source of its default."""
    robot = ROBOTS[name]
    entries = read(to_json(sr.load_model(robot), robot))["parameters"]
    notes = facts_of(robot)
    given = {
        "odd arm": {"link_lengths", "radius", "rest_up", "pressure", "max_moment"},
        "arm": set(),
        "pcc": {"elastic_sections"},
    }
    given |= {"one hinge": {"chain", "hinges"}, "straight tube": {"contraction", "angle", "elastic_sections"}}
    given |= {"helix": {"length", "elastic_sections"}, "lumped helix": {"chain", "hinges", "handedness", "torsional_stiffness"}}
    for parameter, entry in entries.items():
        value = getattr(robot, parameter)
        assert entry["value"] == json.loads(json.dumps(value))
        if parameter in given.get(name, set()):
            assert entry["source"].startswith("given by the caller (default ")
            assert entry["source"].endswith(f": {notes[parameter].source})")
        elif name in given:
            assert entry["source"] == notes[parameter].source
    assert entries.keys() == robot.xacro_arguments().keys()


def test_a_default_that_does_not_go_with_the_rest_was_not_given() -> None:
    """The default hinge offset, 0.03 m, is longer than these links."""
    robot = sr.InflatableArm(link_lengths=(0.025,), hinge_offset=0.01, wall_thickness=1e-3)
    entry = read(to_json(sr.load_model(robot), robot))["parameters"]["hinge_offset"]
    assert entry["source"] == "given by the caller (default 0.03: Troise 2021, section 4 (first wrinkle at 0.030))"


def test_notes_of_other_files(tmp_path: Path) -> None:
    file = tmp_path / "a.xacro"
    file.write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n<!-- A file. -->\n'
        "<!-- Where it is; [] for\n  nowhere [m], perhaps. Source: a book. Page 3. -->\n"
        '<xacro:arg name="place" default=""/>\n<xacro:arg name="bare" default="1"/>\n'
        '<!-- A colour. Source: chosen. -->\n<xacro:arg name="unitless" default="1"/>\n'
        '<!-- Mass [kg]. -->\n<xacro:arg name="unsourced" default="1"/>\n'
        '<!-- Mass [kg]. Source: chosen. --><link name="a"/><xacro:arg name="apart" default="1"/></robot>',
        encoding="utf-8",
    )
    assert argument_notes(file) == {"place": ("Where it is; [] for nowhere, perhaps", "m", "a book. Page 3")}
    file.write_text("<robot>", encoding="utf-8")
    with pytest.raises(sr.DescriptionError, match=r"a\.xacro is not well-formed XML"):
        argument_notes(file)
    with pytest.raises(sr.DescriptionError, match="cannot read"):
        argument_notes(tmp_path / "b.xacro")


# --- Files and refusals


def test_export_model_knows_the_robot(tmp_path: Path) -> None:
    robot = sr.InflatableArm(stiffness=150.0)
    model = sr.load_model(robot)
    path = export_model(robot, tmp_path / "arm.json")
    assert path.read_text(encoding="utf-8") == to_json(model, robot)
    path = export_model(model, tmp_path / "plain.json")
    assert path.read_text(encoding="utf-8") == to_json(model)
    path = export_model(model, tmp_path / "said.json", robot=robot)
    assert path.read_text(encoding="utf-8") == to_json(model, robot)
    assert read(path.read_text(encoding="utf-8"))["format"] == "softrobots sidecar"


def test_what_does_not_belong_together_is_refused() -> None:
    model = sr.load_model(sr.InflatableArm())
    with pytest.raises(sr.ParameterError, match="the robot that the model was loaded from"):
        to_json(model, sr.InflatableArm(stiffness=150.0))
    with pytest.raises(sr.ParameterError, match="a robot of this package"):
        to_json(model, model)
    with pytest.raises(sr.ParameterError, match="SoftModel"):
        to_json(sr.InflatableArm())
