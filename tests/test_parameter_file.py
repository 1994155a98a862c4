"""Files of parameters: what is written is read back digit by digit, by us and by PyYAML; what is refused says why."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.robots.parameter_file import ParameterFile, read_parameters, read_robot, write_parameters
from tests.support.laws import law
from tests.support.tables import each_row

NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True).filter(lambda name: name != "robot")
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**40), 10**40)
    | st.floats(-1e299, 1e299)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
    | st.sampled_from(
        ["no", "Yes", "on", "null", "~", "1e3", "0x10", "010", "1:30", "# no comment", "a: b", "- a", "2001-01-01"]
    )
)
VALUES = (
    SCALARS
    | st.lists(SCALARS, max_size=4).map(tuple)
    | st.lists(st.lists(SCALARS, max_size=3).map(tuple), max_size=3).map(tuple)
)


def lists(value: Any) -> Any:
    """A value with lists for tuples, and numbers by their kind."""
    return [lists(item) for item in value] if isinstance(value, tuple | list) else (type(value).__name__, value)


@law("robots.parameter_file.write_parameters", "robots.parameter_file.read_parameters")
@settings(max_examples=30)
@given(values=st.dictionaries(NAMES, VALUES, max_size=5), ending=st.sampled_from([".yaml", ".json"]))
def test_what_is_written_is_read_back(values: dict[str, Any], ending: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    """By this package, and by another reader of YAML 1.1 or of JSON."""
    file = tmp_path_factory.getbasetemp() / f"parameters{ending}"
    write_parameters(file, "inflatable_arm", values, units={name: "m" for name in values}, overwrite=True)
    read = read_parameters(file)
    assert read.robot == "inflatable_arm"
    assert lists(list(read.values.items())) == lists(list(values.items()))
    text = file.read_text(encoding="utf-8")
    theirs = json.loads(text) if ending == ".json" else yaml.safe_load(text)
    said = {"robot": "inflatable_arm", **values}
    assert list(theirs) == list(said)
    assert lists(list(theirs.values())) == lists(list(said.values()))


@law("robots.parameter_file.read_robot")
@settings(max_examples=20)
@given(
    lengths=st.lists(st.floats(0.2, 1.0), min_size=1, max_size=4),
    stiffness=st.floats(1.0, 1e5),
    moment=st.none() | st.floats(1.0, 1e3),
    ending=st.sampled_from([".yaml", ".json"]),
)
def test_any_robot_comes_back_from_its_file(
    lengths: list[float], stiffness: float, moment: float | None, ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    robot = sr.InflatableArm(link_lengths=tuple(lengths), stiffness=stiffness, max_moment=moment)
    file = tmp_path_factory.getbasetemp() / f"robot{ending}"
    write_parameters(file, "inflatable_arm", dataclasses.asdict(robot), overwrite=True)
    assert read_robot(file) == robot
    assert read_robot(file, "inflatable_arm") == robot


@pytest.mark.study
@pytest.mark.parametrize("name", sr.ROBOTS)
@pytest.mark.parametrize("ending", ["yaml", "json"])
def test_a_robot_comes_back_from_its_file(name: str, ending: str, told, tmp_path: Path) -> None:
    file = tmp_path / f"robot.{ending}"
    status, out, _ = told("urdf", name, "--set", "rgba=[0.1,0.2,0.3,1]", "--save-parameters", str(file))
    assert (status, out) == (0, f"{file}: written\n")
    robot = read_robot(file)
    made = sr.ROBOTS[name]
    assert robot == dataclasses.replace(made(), rgba=(0.1, 0.2, 0.3, 1.0))
    assert read_robot(file, name) == robot
    assert told("urdf", str(file))[1] == robot.urdf()
    if ending == "yaml":
        assert "base_mass: " in file.read_text(encoding="utf-8")
        assert "  # kg\n" in file.read_text(encoding="utf-8")


def test_one_value_stands_for_parts_that_have_the_same(told, tmp_path: Path) -> None:
    """So that other lengths can be given for a saved robot; the lengths themselves stay a list."""
    file = tmp_path / "arm.yaml"
    assert told("urdf", "inflatable_arm", "--set", "radius=[0.06,0.05]", "--save-parameters", str(file))[0] == 0
    values = read_parameters(file).values
    assert (values["link_lengths"], values["radius"], values["pressure"]) == ((0.6, 0.6), (0.06, 0.05), 50e3)


def test_a_file_stands_for_its_robot_in_commands(told, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    write_parameters(file, "inflatable_arm", {"stiffness": 150.0})
    assert told("urdf", str(file), "--set", "radius=0.05")[1] == sr.InflatableArm(stiffness=150.0, radius=0.05).urdf()
    assert "no robot or file is called" in told("urdf", str(tmp_path / "other.yaml"))[2]
    file.write_text("stiffness: 150.0\n", encoding="utf-8")
    status, out, err = told("urdf", str(file))
    assert (status, out) == (2, "")
    assert "a file of parameters with a line robot: NAME, of inflatable_arm" in err


def test_words_mean_what_they_mean_in_yaml_1_2(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    words = ["1e3", "010", "no", "1:30", ".5", "-3.", "+7", "1_000", "~", "", "TRUE", "'5'", ">\n  two\n  words", "0x10"]
    file.write_text("".join(f"p{place}: {word}\n" for place, word in enumerate(words)), encoding="utf-8")
    values = read_parameters(file).values
    assert lists(list(values.values())) == lists(
        [1000.0, 10, "no", "1:30", 0.5, -3.0, 7, "1_000", None, None, True, "5", "two words\n", "0x10"]
    )


def test_blocks_braces_and_the_end_of_lines_say_the_same(tmp_path: Path) -> None:
    texts = [
        "robot: pcc_arm\nradius: 0.06\noffset: [0.0, 1.0]\n",
        "robot: pcc_arm\r\nradius: 0.06\r\noffset:\r\n- 0.0\r\n- 1.0\r\n",
        "\ufeff---\n{robot: pcc_arm, radius: 0.06, offset: [0.0, 1.0]}\n...\n",
        '{"robot": "pcc_arm", "radius": 0.06, "offset": [0.0, 1.0]}',
    ]
    for place, text in enumerate(texts):
        file = tmp_path / f"{place}.yaml"
        file.write_bytes(text.encode())
        assert read_parameters(file) == ParameterFile("pcc_arm", {"radius": 0.06, "offset": (0.0, 1.0)})
    assert read_robot(file) == sr.PccArm(radius=0.06, offset=(0.0, 1.0))


def test_the_command_line_wins(told, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text("link_lengths: [0.5, 0.4]\nstiffness: 200\npressure: 40e3\n", encoding="utf-8")
    status, out, _ = told("urdf", "inflatable_arm", "--set", "stiffness=250", "--parameters", str(file))
    assert status == 0
    assert out == sr.InflatableArm(link_lengths=(0.5, 0.4), stiffness=250, pressure=40e3).urdf()


def test_every_command_that_takes_a_robot_takes_a_file(told, tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text("robot: inflatable_arm\nstiffness: 1e6\n", encoding="utf-8")
    ours = ("inflatable_arm", "--parameters", str(file), "--json")
    model = sr.load_model(sr.InflatableArm(stiffness=1e6))
    status, out, _ = told("solve", *ours, "--motors", "0.3", "0.6", "-0.8", "--force", "0", "10", "-15")
    assert status == 0
    tip = sr.solve_equilibrium(model, (0.3, 0.6, -0.8), (0.0, 10.0, -15.0)).tip_position
    assert f"{tip[0]:.9f}"[:9] in out  # nearly rigid: another arm than the default one
    assert told("load", *ours, "--motors", "0.3", "0.6", "-0.8", "--torques", "0", "0", "0")[0] == 0
    assert told("ik", *ours, "--target", "0.9", "0.3", "0.2")[0] == 0
    assert told("export", *ours, "-o", str(tmp_path / "arm.xml"))[0] == 0
    assert told("view", *ours, "--html", str(tmp_path / "arm.html"))[0] == 0


def test_arguments_of_a_xacro_file_come_from_a_file_too(told, tmp_path: Path) -> None:
    robot = tmp_path / "leg.urdf.xacro"
    robot.write_text(
        '<robot name="leg" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="length" default="1"/>'
        '<xacro:arg name="sizes" default="[1,2]"/><link name="l$(arg length)_${$(arg sizes)[1]}"/></robot>',
        encoding="utf-8",
    )
    file = tmp_path / "leg.yaml"
    file.write_text("robot: leg.urdf.xacro\nlength: 7\nsizes: [3, 4]\n", encoding="utf-8")
    status, out, err = told("urdf", str(robot), "--parameters", str(file))
    assert (status, '"l7_4"' in out) == (0, True), err
    file.write_text("lenght: 7\n", encoding="utf-8")
    status, _, err = told("urdf", str(robot), "--parameters", str(file))
    assert (status, "did you mean 'length'" in err) == (2, True)


@each_row(
    ("text", "words", "message"),
    [
        (
            "stiffnes: 3\n",
            ["inflatable_arm"],
            "no parameter of inflatable_arm is called 'stiffnes' (did you mean 'stiffness'?)",
        ),
        ("robot: pcc_arm\nradius: 0.05\n", ["inflatable_arm"], "ROBOT must be pcc_arm, for which"),
        ("stiffness: -3\n", ["inflatable_arm"], "stiffness must be above 0"),
        ("stiffness: many\n", ["inflatable_arm"], "stiffness must be"),
        ("stiffness: [1\n", ["inflatable_arm"], "cannot read parameters from a.yaml: line 2:"),
        ("radius: 0.05\n", ["robot.urdf", "--check"], "--parameters must be left out: robot.urdf is no xacro file"),
        ("radius: 0.05\n", ["inflatable_arm", "--list"], "--list must be given without --set, --parameters"),
        ("radius: 0.05\n", ["inflatable_arm", "--save-parameters", "a.yaml"], "a.yaml exists"),
        ("radius: 0.05\n", ["inflatable_arm", "--save-parameters", "b.yaml", "-o", "a.yaml"], "a.yaml exists"),
    ],
)
def test_the_command_refuses(
    text: str, words: list[str], message: str, told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.yaml").write_text(text, encoding="utf-8")
    Path("robot.urdf").write_text("<robot name='r'><link name='a'/></robot>", encoding="utf-8")
    status, out, err = told("urdf", words[0], "--parameters", "a.yaml", *words[1:])
    assert (status, out) == (2, "")
    assert message in err
    assert not Path("b.yaml").exists()


def test_only_parameters_of_our_robots_are_saved(told, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text("<robot name='r'><link name='a'/></robot>", encoding="utf-8")
    status, _, err = told("urdf", str(tmp_path / "robot.urdf"), "--check", "--save-parameters", str(tmp_path / "b.yaml"))
    assert (status, "--save-parameters must be given for one of inflatable_arm" in err) == (2, True)


def test_results_come_with_their_robot(told, tmp_path: Path) -> None:
    status, _, err = told("view", "--result", "a.npz", "--parameters", "a.yaml")
    assert (status, "--result must be given without --parameters" in err) == (2, True)


@each_row(
    ("text", "robot", "message"),
    [
        ("radius: 0.05\n", None, "given here or in the file: inflatable_arm, "),
        ("robot: inflatable_arms\n", None, "did you mean 'inflatable_arm'"),
        ("robot: pcc_arm\n", "helix_tube", "must be pcc_arm, for which the file is"),
        ("robot: pcc_arm\nradios: 0.05\n", None, "no parameter of pcc_arm is called 'radios' (did you mean 'radius'?)"),
        ("robot: pcc_arm\nradius: -0.05\n", None, "radius must be above 0"),
        ("robot: pcc_arm_lumped\nsegment_lengths: 0.5\n", None, "segment_lengths"),
    ],
)
def test_robots_that_a_file_does_not_make(text: str, robot: str | None, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(sr.SoftRobotsError) as caught:
        read_robot(tmp_path / "a.yaml", robot)
    assert message in str(caught.value)


@each_row(
    "values",
    [
        {"a": math.nan},
        {"a": [math.inf]},
        {"a": {"b": 1}},
        {"a": object()},
        {"a b": 1},
        {"a": b"x"},
        {"": 1},
        {"a": [[[1]]]},
        {"a": 10**301},
    ],
)
def test_what_no_file_can_hold_is_not_written(values: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(sr.ParameterError, match="what a file of parameters can hold"):
        write_parameters(tmp_path / "a.yaml", "pcc_arm", values)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("call", [read_parameters, read_robot, lambda path: write_parameters(path, "pcc_arm", {})])
def test_paths_that_are_none(call: Any) -> None:
    with pytest.raises(sr.ParameterError, match="a path"):
        call(3)
