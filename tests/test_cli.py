"""The command `softrobots`: what it writes, what it checks, and every way to call it wrongly."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import re
import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.cli.main import COMMANDS, main, parser
from softrobots.cli.options.robot_parameters import make_robot, robot_parameters, xacro_parameters
from softrobots.description.expansion import expand
from softrobots.description.paths import urdf_folder, xacro_folder
from softrobots.description.urdf_rules import RULES
from studies.interop.tools import TOOLS
from tests.conftest import missing
from tests.support.foreign import BRANCHED, SPRINGS
from tests.support.tables import each_row

ARM = urdf_folder() / "inflatable_arm.urdf"


# --- The command


def test_help_lists_every_command_with_a_line(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    for command in COMMANDS:
        name = command.__name__.rpartition(".")[2]
        assert re.search(rf"^    {name}\s+\w+", out, re.M), name
        with pytest.raises(SystemExit) as ended:
            main([name, "--help"])
        assert ended.value.code == 0
        assert f"usage: softrobots {name}" in capsys.readouterr().out


def actions(parser: argparse.ArgumentParser) -> Iterator[tuple[argparse.Action, bool]]:
    """Arguments of a parser and of its subcommands, and whether they, or one of several, must be given."""
    needed = [action for group in parser._mutually_exclusive_groups if group.required for action in group._group_actions]
    for action in parser._actions:
        yield action, action.required or action in needed
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from actions(inner)


def test_every_option_tells_what_it_is_with_unit_and_default() -> None:
    """A number has its unit in square brackets; what may be left out has its default in round ones."""
    numbers = 0
    for action, required in actions(parser()):
        words = (action.option_strings, action.dest)
        if isinstance(action, argparse._SubParsersAction):
            continue
        assert action.help, words
        if action.type is float:
            numbers += 1
            assert re.search(r"\[[^\]]+\]", action.help), words
        takes_values = action.nargs != 0 and action.option_strings and not required
        if takes_values and (action.type in (int, float) or action.choices):
            assert re.search(r"\(.+\)", action.help) or "by default" in action.help.lower(), words
    assert numbers > 30


def test_version(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"softrobots {sr.__version__}\n"


@each_row(
    ("words", "message"),
    [
        (["nothing"], "invalid choice: 'nothing'; choose from urdf, export, solve, branches, load, "),
        (["slove"], "invalid choice: 'slove' (did you mean 'solve'?)"),
        (["solve", "inflatable_arm", "--method", "newtn"], "invalid choice: 'newtn' (did you mean 'newton'?)"),
        (["urdf", "inflatable_arm", "--nothing"], "unrecognized arguments: --nothing"),
        (["urdf", "inflatable_arm", "-o"], "expected one argument"),
        (["urdf", "inflatable_arm", "--check", "three"], "arguments: three; softrobots urdf --help explains\n"),
        (["urdf", "inflatable_arm", "--chekc"], "unrecognized arguments: --chekc (did you mean '--check'?)"),
        (["urdf", "inflatable_arm", "--over"], "unrecognized arguments: --over"),  # options in full
        (["urdf", "inflatable_arm", "radius=3"], "radius=3; parameters of the robot follow --set: --set NAME=VALUE"),
        (["export", "inflatable_arm", "-o", "arm.xml", "radius=3"], "follow --set"),
        (["urdf", "inflatable_arm", "--set", "radius"], "'radius': NAME=VALUE is required"),
        (["urdf", "--set", "radius=3", "inflatable_arm"], "'inflatable_arm': NAME=VALUE is required, and ROBOT before --set"),
        (["urdf", "inflatable_arm", "--set", "=3"], "'=3': NAME=VALUE is required"),
        (["urdf", "inflatable_arm", "--set"], "expected at least one argument"),
        (["doctor", "--nothing"], "unrecognized arguments: --nothing"),
        (["doctor", "radius=3"], "error: unrecognized arguments: radius=3; softrobots doctor --help explains\n"),
    ],
)
def test_words_that_argparse_refuses(words: list[str], message: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1  # without the usage, which would hide it


COMMAND_LINES = {"command": [str(Path(sys.executable).parent / "softrobots")], "module": [sys.executable, "-m", "softrobots"]}


def test_the_installed_command_and_the_module_run(tmp_path: Path) -> None:
    """From another folder."""
    command, module = COMMAND_LINES.values()
    if not Path(command[0]).is_file():
        missing("the command softrobots is not installed; pip install -e . does that")
    done = subprocess.run([*module, "urdf", "inflatable_arm"], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert (done.stdout, done.stderr) == (ARM.read_text(encoding="utf-8"), "")
    bad = subprocess.run([*command, "urdf", "nobody"], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr.startswith("error: no robot or file is called 'nobody'")


def test_output_may_be_cut_off_by_whoever_reads_it() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [*COMMAND_LINES["module"], "urdf", "inflatable_arm"]
    cut = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (cut.returncode, cut.stderr) == (141, "")  # as after SIGPIPE


@pytest.mark.study
@pytest.mark.parametrize("words", [["urdf", "inflatable_arm"], ["urdf", "--list", "--json"]], ids=" ".join)
def test_a_full_disk_behind_the_output_is_an_error_without_a_traceback(words: list[str]) -> None:
    if not Path("/dev/full").exists():
        missing("/dev/full is needed")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = subprocess.run([*COMMAND_LINES["module"], *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "error: cannot write the answer: [Errno 28] No space left on device\n")


@pytest.mark.study
def test_closed_streams_are_no_reason_to_fail() -> None:
    command = " ".join(map(shlex.quote, COMMAND_LINES["module"]))
    script = f"{command} urdf --list >&-; echo $?; {command} urdf nobody 2>&-; echo $?"
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("0\n2\n", "")


@pytest.mark.parametrize("command", [command.__name__.rpartition(".")[2] for command in COMMANDS])
def test_help_fits_80_columns_and_its_examples_stay_the_same_commands(
    command: str, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = {}
    for columns in ("80", "300"):
        monkeypatch.setenv("COLUMNS", columns)
        with pytest.raises(SystemExit):
            main([command, "--help"])
        text = capsys.readouterr().out
        if columns == "80":
            assert max(map(len, text.splitlines())) <= 80
        examples = text.partition("\nexamples:\n")[2].partition("\n\n")[0]
        lines = [re.split(r" {3,}", line.strip())[0] for line in re.sub(r"\\\n +", "", examples).splitlines()]
        told[columns] = [shlex.split(" ".join(line.split())) for line in lines if not line.startswith("#")]
    assert command == "doctor" or told["80"]
    assert told["80"] == told["300"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["branches", "inflatable_arm", "--direction", "0", "0", "0"], "--direction must be different from zero"),
        (["solve", "inflatable_arm", "--moment", "nan", "0", "0"], "--moment must be an array"),
        (["solve", "inflatable_arm", "--wrench", "tip", *"00000", "inf"], "--wrench must be an array"),
        (["solve", "inflatable_arm", "--tolerance", "0"], "--tolerance must be"),
        (["solve", "inflatable_arm", "--spring", "spring_1_up=nan"], "--spring must be a finite number"),
        (["solve", "inflatable_arm", "--set", "stiffness=-1"], "stiffness must be above 0"),  # a parameter, no option
        (["ik", "inflatable_arm", "--target", "nan", "0", "0"], "--target must be an array"),
        (["load", "inflatable_arm", "--torques", "nan", "0", "0"], "--torques must be an array"),
        (["load", "helix_tube", "--torques", "1"], "ROBOT = 'helix_tube': ROBOT must be a robot with at least one motor"),
    ],
)
def test_errors_name_the_option_that_was_typed(words: list[str], message: str, told) -> None:
    status, out, err = told(*words)
    assert (status, out) == (2, "")
    assert message in err


def test_the_command_imports_no_tool_before_it_needs_it() -> None:
    code = "import softrobots.cli.main, sys; softrobots.cli.main.parser(); print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    heavy = {"matplotlib", "trimesh", "xacro", "tqdm", "meshcat", "scipy", "shtab"} | {tool.module for tool in TOOLS.values()}
    assert not loaded & heavy


# --- softrobots urdf


@pytest.mark.parametrize("name", ["inflatable_arm", "tendon_arm_lumped"])
def test_urdf_prints_what_is_shipped(name: str, told) -> None:
    assert told("urdf", name) == (0, (urdf_folder() / f"{name}.urdf").read_text(encoding="utf-8"), "")


def test_urdf_takes_parameters_in_several_places(told, tmp_path: Path) -> None:
    file = tmp_path / "new" / "arm.urdf"
    sets = (("--set", "link_lengths=[0.5,0.4]"), ("--set", "stiffness=(200, 150)", "rest_up:=-0.1"))
    words = ("urdf", "inflatable_arm", *sets[0], "-o", str(file), *sets[1])
    assert told(*words) == (0, f"{file}: written\n", "")
    expected = sr.InflatableArm(link_lengths=(0.5, 0.4), stiffness=(200.0, 150.0), rest_up=-0.1)
    assert file.read_text(encoding="utf-8") == expected.urdf()
    status, out, err = told(*words)
    assert (status, out) == (2, "")
    assert "exists; choose another name or allow overwriting" in err
    assert told("urdf", "inflatable_arm", "-o", str(file), "--overwrite")[0] == 0
    assert file.read_bytes() == ARM.read_bytes()


@pytest.mark.parametrize(
    ("words", "robot"),
    [
        (["pcc_arm", "chain=lumped", "torsion=false", "hinges=3"], sr.PccArm(chain="lumped", torsion=False, hinges=3)),
        (["pcc_arm", "torsion=True", "muscle_azimuths=[]", "rgba=[0,0,1,1]"], sr.PccArm(muscle_azimuths=(), rgba=(0, 0, 1, 1))),
        (["helix_tube_lumped"], sr.HelixTube(chain="lumped")),
        (["helix_tube_lumped", "chain=sections"], sr.HelixTube()),
        (["helix_tube", "bending_stiffness=none", "axial_stiffness=", "handedness=left"], sr.HelixTube(handedness="left")),
        (["helix_tube", "length= 0.4", "allow_self_contact=true"], sr.HelixTube(length=0.4, allow_self_contact=True)),
    ],
)
def test_values_are_numbers_lists_truths_and_words(words: list[str], robot: object) -> None:
    assert make_robot(words[0], words[1:]) == robot


def test_urdf_lists_robots_and_parameters_with_unit_and_default(told) -> None:
    status, out, _ = told("urdf", "--list")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == list(sr.ROBOTS)
    status, out, _ = told("urdf", "pcc_arm_lumped", "--list")
    assert status == 0
    lines = out.splitlines()
    assert [line.partition("=")[0] for line in lines[::2]] == list(sr.PccArm().xacro_arguments())
    assert "chain=lumped" in lines
    assert "muscle_force=400.0" in lines
    assert "    Largest pull or push of a muscle [N], above 0. Assumed." in lines


@pytest.mark.parametrize("name", sr.ROBOTS)
def test_listed_defaults_are_those_of_the_robot(name: str) -> None:
    """Typed back, every default gives the same robot."""
    listed = robot_parameters(name)
    assert make_robot(name, [f"{parameter.name}={parameter.default}" for parameter in listed]) == sr.ROBOTS[name]()


def test_a_warning_is_one_line_that_comes_once(told) -> None:
    """On stderr, without path and source: of an arm whose springs are the paper's and whose links are not."""
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        status, out, err = told("solve", "inflatable_arm", "--set", "pressure=3e4", "radius=[0.05,0.04]", "--json")
    assert status == 0
    assert json.loads(out)["stable"]
    assert err.startswith(
        "warning: radius = (0.05, 0.04), pressure = (30000.0, 30000.0): the springs are still those of the paper's"
    )
    assert err.count("\n") == 1
    assert told("solve", "inflatable_arm", "--set", "pressure=3e4", "young_modulus=1.4e8", "--json")[2] == ""


def test_words_and_truth_values_are_parameters(told) -> None:
    """Listed with their defaults; given as words; refused by name with what is allowed."""
    status, out, _ = told("urdf", "inflatable_arm", "--list")
    assert status == 0
    assert "link_model=paper\n    Where a link bends: paper (at one hinge" in out
    assert "torsion=false\n    Whether a link twists" in out
    same = sr.InflatableArm(link_model="two_hinges", torsion=True, payload=(0.2, 0.0, 0.0, 0.1)).urdf()
    words = ("link_model=two_hinges", "torsion=true", "payload=[0.2,0,0,0.1]")
    assert told("urdf", "inflatable_arm", "--set", *words) == (0, same, "")
    assert told("urdf", "inflatable_arm_two_hinges", "--set", *words[1:]) == (0, same, "")
    assert "link_model must be one of 'paper', 'two_hinges'" in told("urdf", "inflatable_arm", "--set", "link_model=three")[2]
    assert "torsion must be True or False" in told("urdf", "inflatable_arm", "--set", "torsion=2")[2]


def test_urdf_expands_any_xacro_file(told, tmp_path: Path) -> None:
    file = xacro_folder() / "inflatable_arm.urdf.xacro"
    assert told("urdf", str(file), "--set", "radius=0.05") == (0, expand(file, {"radius": "0.05"}), "")
    status, out, _ = told("urdf", str(file), "--list")
    assert status == 0
    assert "pressure=50000.0\n" in out
    assert "[N m/rad]" in out
    status, out, err = told("urdf", str(file), "--set", "radios=0.05")
    assert status == 2
    assert "(did you mean 'radius'?)" in err
    assert "\n  motor_effort=50.0 [N m]" in err
    bare = tmp_path / "bare.xacro"
    bare.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="a"/><link name="l"/></robot>')
    assert [tuple(row) for row in xacro_parameters(bare)] == [("a", "", "", "")]


def test_urdf_translates_mjcf(told, tool, tmp_path: Path) -> None:
    """The translation itself is tested with the readers: here that it is reached."""
    tool("mujoco")
    file = tmp_path / "swing.xml"
    body = '<body name="b"><joint name="j" axis="0 1 0" stiffness="3"/><geom size="0.1"/></body>'
    file.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>", encoding="utf-8")
    status, out, err = told("urdf", str(file))
    assert (status, err) == (0, "")
    assert sr.load_model(out).spring_table["j"][0] == pytest.approx(3.0)


@pytest.mark.parametrize("write", [sr.export.to_mjcf, sr.export.to_sdf])
def test_translations_follow_the_rules_that_files_of_ours_follow(write, arm: sr.SoftModel, told, tool, tmp_path: Path) -> None:
    for name in ("mujoco", "pydrake"):
        tool(name)
    file = tmp_path / "robot.xml"
    file.write_text(write(arm), encoding="utf-8")
    status, out, err = told("urdf", str(file), "--check")
    assert (status, err) == (0, ""), out


def test_urdf_answers_machines(told, tmp_path: Path) -> None:
    status, out, _ = told("urdf", "--list", "--json")
    assert status == 0
    assert list(json.loads(out)["robots"]) == list(sr.ROBOTS)
    status, out, _ = told("urdf", "helix_tube", "--list", "--json")
    assert status == 0
    listed = json.loads(out)
    assert listed["robot"] == "helix_tube"
    assert [row["name"] for row in listed["parameters"]] == [field.name for field in dataclasses.fields(sr.HelixTube)]
    assert all(row.keys() == {"name", "default", "unit", "text"} for row in listed["parameters"])
    made = tmp_path / "arm.urdf"
    status, out, _ = told("urdf", "inflatable_arm", "--check", "-o", str(made), "--json")
    assert status == 0
    answer = json.loads(out)
    assert (answer["ok"], answer["files"]) == (True, [str(made)])
    assert [row["what"] for row in answer["findings"]][1 : 1 + len(RULES)] == list(RULES)
    broken = tmp_path / "broken.urdf"
    broken.write_text(made.read_text(encoding="utf-8").replace('mass value="', 'mass value="-'), encoding="utf-8")
    status, out, _ = told("urdf", str(broken), "--check", "--json")
    assert status == 1
    answer = json.loads(out)
    assert not answer["ok"]
    assert any("mass -" in text for row in answer["findings"] for text in row["problems"])


def test_urdf_checks_files_robots_and_xacro_files(told) -> None:
    for words in ([str(ARM)], ["inflatable_arm"], [str(xacro_folder() / "inflatable_arm.urdf.xacro")]):
        status, out, err = told("urdf", *words, "--check")
        assert (status, err) == (0, "")
        lines = out.splitlines()
        assert all(line.startswith("ok     ") for line in lines)
        assert [line[7:].partition(":")[0] for line in lines[1 : 1 + len(RULES)]] == list(RULES)
        assert "3 motors, 4 springs, 2 inflated links" in lines[0]
        assert re.search(r"yourdfpy's kinematics: within \d.\de-16 m and \d.\de-16 rad of Pinocchio, 7 of 7 joints", out)


def test_urdf_check_tells_what_is_wrong_and_writes_nothing(told, tmp_path: Path) -> None:
    file, made = tmp_path / "broken.urdf.xacro", tmp_path / "made.urdf"
    text = ARM.read_text(encoding="utf-8")
    file.write_text(re.sub(r'<mass value="[^"]*"/>', '<mass value="0.0"/>', text), encoding="utf-8")
    status, out, err = told("urdf", str(file), "--check", "-o", str(made))
    assert (status, err) == (1, "")
    assert "wrong  mass and inertia of every link: link shoulder has the mass 0.0 kg; more than 1e-06 kg is required\n" in out
    assert "       1 more like these\n" in out  # of nine links; eight lines are shown
    assert "ok     colours\n" in out
    assert not made.exists()


def test_urdf_check_also_writes_what_is_right(told, tmp_path: Path) -> None:
    made = tmp_path / "made.urdf"
    status, out, _ = told("urdf", "inflatable_arm", "--check", "-o", str(made))
    assert status == 0
    assert out.endswith(f"{made}: written\n")
    assert made.read_bytes() == ARM.read_bytes()


FILE = "FILE"  # stands for a URDF file


@each_row(
    ("words", "message"),
    [
        ([], f"ROBOT must be one of {', '.join(sr.ROBOTS)}, or a file"),
        (["inflatable_leg"], "no robot or file is called 'inflatable_leg' (did you mean 'inflatable_arm'?)"),
        (["inflatable_arm", "--set", "radios=3"], "no parameter of inflatable_arm is called 'radios' (did you mean 'radius'?)"),
        (["inflatable_arm", "--set", "radios=3"], "\n  pressure=50000.0 [Pa]\n"),
        (["inflatable_arm", "--set", "radios=3"], "\n  link_lengths=[0.6,0.6] [m]\n"),
        (["inflatable_arm", "--set", "radius=0.05", "radius=0.04"], "radius must be given once"),
        (["inflatable_arm", "--set", "radius=-1"], "above 0 [m]"),
        (["inflatable_arm", "--set", "radius=wide"], "a number or a list of numbers [m]"),
        (["inflatable_arm", "--set", "radius=[0.05,0.04,0.03]"], "one for each of the 2 links"),
        (["inflatable_arm", "--set", "radius=" + "(" * 300], "radius"),
        (["pcc_arm", "--set", "chain=rope"], "one of 'sections', 'lumped'"),
        (["pcc_arm", "--set", "torsion=2"], "True or False"),
        (["helix_tube", "--set", "contraction=0.5", "angle=0.02"], "the tube runs into itself"),
        (["inflatable_arm", "--set", "hinge_offset=1e-5"], "too light"),
        ([FILE], "a URDF file can only be checked, with --check"),
        ([FILE, "-o", "x.urdf"], "a URDF file can only be checked, with --check"),
        ([FILE, "-o", "x.urdf", "--check"], "a URDF file can only be checked, with --check"),
        ([FILE, "--set", "radius=0.05", "--check"], "is no xacro file"),
        (["inflatable_arm", "--json"], "--json must be given with --list, --check or -o FILE"),
        (["inflatable_arm", "--overwrite"], "given together with -o FILE"),
        (["inflatable_arm", "--list", "--check"], "--list must be given without --set, --parameters, "),
        (["inflatable_arm", "--set", "radius=0.05", "--list"], "--list must be given without --set, --parameters, "),
        (["inflatable_arm", "-o", "x.urdf", "--list"], "--list must be given without --set, --parameters, "),
        (["nobody", "--list"], "no robot or file is called 'nobody'"),
        (["inflatable_arm", "-o", "."], "is a folder; a file name is required"),
    ],
)
def test_urdf_refuses(words: list[str], message: str, told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = told("urdf", *(str(ARM) if word is FILE else word for word in words))
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert list(tmp_path.iterdir()) == []


def test_urdf_refuses_files_that_are_no_robot(told, tmp_path: Path) -> None:
    for name, text in (("a.urdf", "<robot"), ("b.xml", "<html/>"), ("c.xacro", "<robot/>")):
        (tmp_path / name).write_text(text, encoding="utf-8")
        status, out, err = told("urdf", str(tmp_path / name), "--check")
        assert (status, out) == (2, "")
        assert err.startswith("error: ")


@each_row("words", [["urdf", "--check"], ["export", "-o", "made.xml"]])
@each_row("name", ["robot.urdf", "robot.urdf.xacro"])
def test_files_that_are_no_text_are_refused(
    words: list[str], name: str, told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(b"solid \xff\xfe")
    status, out, err = told(words[0], name, *words[1:])
    assert (status, out) == (2, "")
    assert err.startswith("error: cannot read")
    assert name in err


# --- softrobots export


def test_export_takes_springs_of_somebodys_robot(told, tmp_path: Path) -> None:
    file, made = tmp_path / "branched.urdf", tmp_path / "branched.sdf"
    file.write_text(BRANCHED, encoding="utf-8")
    springs = ["--spring", "wrist=20,0.1", "--spring", "slider=800"]
    status, out, err = told("export", str(file), *springs, "--tip", "finger", "-o", str(made))
    assert (status, err) == (0, "")
    assert "2 springs, 3 actuators" in out
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    assert made.read_text(encoding="utf-8") == sr.export.to_sdf(model)


def test_export_answers_machines(told, tmp_path: Path) -> None:
    made = tmp_path / "pcc.xml"
    words = ("pcc_arm_lumped", "--set", "hinges=2", "--muscles", "forces", "--motors", *"200001", "--welded")
    status, out, _ = told("export", *words, "-o", str(made), "--json")
    assert status == 0
    counts = {"sections": 0, "springs": 16, "actuators": 6, "welded": True}  # two segments of two hinges, four springs each
    assert json.loads(out) == {"files": [str(made)], "robot": "pcc_arm", "format": "mjcf", "obstacles": [], **counts}


@each_row(
    ("words", "message"),
    [
        (["inflatable_arm", "--motors", "1", "2"], "(it has shape (2,)): motor_1 [rad] (-3.142 to 3.142), motor_2 [rad] "),
        (["pcc_arm", "--motors", "1"], "(it has shape (1,)): muscle_1_1 [m] (0.4454 to 0.6026), "),
        (["helix_tube", "--motors", "1"], "(it has shape (1,)): the robot has no actuators"),
        (["inflatable_arm", "--motors", "0", "0", "nan"], "finite numbers (entry 2, motor_3 [rad] (-3.142 to 3.142), is nan)"),
        (["inflatable_arm", "--spring", "motor_1=3", "--spring", "motor_1=4"], "--spring must be given once for each joint"),
        (["a" * 5000], "no robot or file is called"),
    ],
)
def test_export_refuses(words: list[str], message: str, told, tmp_path: Path) -> None:
    status, out, err = told("export", *words, "-o", str(tmp_path / "made.json"))
    assert (status, out) == (2, "")
    assert message in err
    assert list(tmp_path.iterdir()) == []


@each_row("word", ["wrist", "wrist=", "wrist=soft", "=20", "wrist=20,far"])
def test_export_refuses_words_that_are_no_spring(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["export", "arm.urdf", "--spring", word, "-o", "arm.xml"])
    assert "JOINT=K" in capsys.readouterr().err


def test_export_tells_what_it_wrote_of_sections(told, tmp_path: Path) -> None:
    status, out, _ = told("export", "pcc_arm", "-o", str(tmp_path / "arm.json"))
    assert status == 0
    assert "8 sections, 0 springs, 6 actuators" in out
