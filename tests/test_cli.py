"""The command `softrobots`: what it writes, what it checks, and every way to call it wrongly."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import softrobots as sr
from softrobots.cli import main
from softrobots.commands import COMMANDS
from softrobots.commands.robot_parameters import make_robot, robot_parameters, xacro_parameters
from softrobots.description import expand
from softrobots.interop import packages
from softrobots.interop.packages import PACKAGES, Package, PackageState
from softrobots.interop.tools import TOOLS
from softrobots.interop.urdf_rules import RULES
from softrobots.kernels.machines import available_backend, cache_folder
from softrobots.paths import urdf_folder, xacro_folder
from tests.conftest import CHECKOUT, missing
from tests.foreign import BRANCHED, SPRINGS

ARM = urdf_folder() / "inflatable_arm.urdf"


@pytest.fixture
def told(capsys: pytest.CaptureFixture):
    """Run the command and return its status, what it printed, and what it said on stderr."""

    def run(*words: str) -> tuple[int, str, str]:
        status = main(words)
        return status, *capsys.readouterr()

    return run


# --- The command


def test_help_lists_every_command_with_a_line(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    for command in COMMANDS:
        name = command.__name__.rpartition(".")[2]
        assert re.search(rf"^    {name} +\w+", out, re.M), name
        with pytest.raises(SystemExit) as ended:
            main([name, "--help"])
        assert ended.value.code == 0
        assert f"usage: softrobots {name}" in capsys.readouterr().out


def test_version(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"softrobots {sr.__version__}\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "required: COMMAND"),
        (["nothing"], "invalid choice: 'nothing'"),
        (["urdf", "inflatable_arm", "--nothing"], "unrecognized arguments: --nothing"),
        (["urdf", "inflatable_arm", "-o"], "expected one argument"),
        (["urdf", "inflatable_arm", "--check", "three"], "unrecognized arguments: three"),
        (["doctor", "--nothing"], "unrecognized arguments: --nothing"),
        (["doctor", "radius=3"], "unrecognized arguments: radius=3"),
    ],
)
def test_words_that_argparse_refuses(words: list[str], message: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


COMMAND_LINES = {"command": [str(Path(sys.executable).parent / "softrobots")], "module": [sys.executable, "-m", "softrobots"]}


@pytest.mark.parametrize("way", COMMAND_LINES)
def test_the_installed_command_and_the_module_run(way: str, tmp_path: Path) -> None:
    """From another folder."""
    command = COMMAND_LINES[way]
    if not Path(command[0]).is_file():
        missing("the command softrobots is not installed; pip install -e . does that")
    done = subprocess.run([*command, "urdf", "inflatable_arm"], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout == ARM.read_text(encoding="utf-8")
    assert done.stderr == ""
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


def test_the_command_imports_no_tool_before_it_needs_it() -> None:
    code = "import softrobots.cli, sys; softrobots.cli.parser(); print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    heavy = {"matplotlib", "trimesh", "xacro", "tqdm", "meshcat", "scipy"} | {tool.module for tool in TOOLS.values()}
    assert not loaded & heavy


# --- softrobots urdf


@pytest.mark.parametrize("name", sr.ROBOTS)
def test_urdf_prints_what_is_shipped(name: str, told) -> None:
    assert told("urdf", name) == (0, (urdf_folder() / f"{name}.urdf").read_text(encoding="utf-8"), "")


def test_urdf_takes_parameters_before_and_behind_options(told, tmp_path: Path) -> None:
    file = tmp_path / "new" / "arm.urdf"
    words = ("urdf", "inflatable_arm", "link_lengths=[0.5,0.4]", "-o", str(file), "stiffness=(200, 150)", "rest_up:=-0.1")
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
    assert "    Largest pull or push of a muscle [N]. Assumed." in lines


@pytest.mark.parametrize("name", sr.ROBOTS)
def test_listed_defaults_are_those_of_the_robot_and_units_those_of_the_xacro_file(name: str) -> None:
    """Typed back, every default gives the same robot; units are written twice, in the class and in the xacro file."""
    listed = robot_parameters(name)
    assert make_robot(name, [f"{parameter.name}={parameter.default}" for parameter in listed]) == sr.ROBOTS[name]()
    in_xacro = {row.name: row.unit for row in xacro_parameters(xacro_folder() / sr.ROBOTS[name]().XACRO)}
    for parameter in listed:
        assert parameter.text
        if parameter.name in in_xacro:
            assert (parameter.unit or "-").replace("^", "") == in_xacro[parameter.name], parameter


def test_urdf_expands_any_xacro_file(told, tmp_path: Path) -> None:
    file = xacro_folder() / "inflatable_arm.urdf.xacro"
    assert told("urdf", str(file), "radius=0.05") == (0, expand(file, {"radius": "0.05"}), "")
    status, out, _ = told("urdf", str(file), "--list")
    assert status == 0
    assert "stiffness=172.71\n" in out
    assert "[N m/rad]" in out
    status, out, err = told("urdf", str(file), "radios=0.05")
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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "ROBOT must be one of inflatable_arm, pcc_arm, pcc_arm_lumped, helix_tube, helix_tube_lumped, or a file"),
        (["inflatable_leg"], "no robot or file is called 'inflatable_leg' (did you mean 'inflatable_arm'?)"),
        (["inflatable_arm", "radius"], "of the form field=value"),
        (["inflatable_arm", "=3"], "of the form field=value"),
        (["inflatable_arm", "radios=3"], "no parameter of inflatable_arm is called 'radios' (did you mean 'radius'?)"),
        (["inflatable_arm", "radios=3"], "\n  stiffness=172.71 [N m/rad]\n"),
        (["inflatable_arm", "radios=3"], "\n  link_lengths=[0.6,0.6] [m]\n"),
        (["inflatable_arm", "radius=0.05", "radius=0.04"], "radius must be given once"),
        (["inflatable_arm", "radius=-1"], "above 0.0 [m]"),
        (["inflatable_arm", "radius=wide"], "a number or a list of numbers [m]"),
        (["inflatable_arm", "radius=[0.05,0.04,0.03]"], "one for each of the 2 links"),
        (["inflatable_arm", "radius=" + "(" * 300], "radius"),
        (["pcc_arm", "chain=rope"], "one of 'sections', 'lumped'"),
        (["pcc_arm", "torsion=2"], "True or False"),
        (["helix_tube", "contraction=0.5", "angle=0.02"], "the tube runs into itself"),
        (["inflatable_arm", "hinge_offset=1e-5"], "too light"),
        ([FILE], "a URDF file can only be checked, with --check"),
        ([FILE, "-o", "x.urdf"], "a URDF file can only be checked, with --check"),
        ([FILE, "-o", "x.urdf", "--check"], "a URDF file can only be checked, with --check"),
        ([FILE, "radius=0.05", "--check"], "is no xacro file"),
        (["inflatable_arm", "--overwrite"], "given together with -o FILE"),
        (["inflatable_arm", "--list", "--check"], "--list must be given without"),
        (["inflatable_arm", "radius=0.05", "--list"], "--list must be given without"),
        (["inflatable_arm", "-o", "x.urdf", "--list"], "--list must be given without"),
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


# --- softrobots doctor


@pytest.mark.parametrize("words", [["urdf", "--check"], ["export", "-o", "made.xml"]])
@pytest.mark.parametrize("name", ["robot.urdf", "robot.urdf.xacro"])
def test_files_that_are_no_text_are_refused(
    words: list[str], name: str, told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(b"solid \xff\xfe")
    status, out, err = told(words[0], name, *words[1:])
    assert (status, out) == (2, "")
    assert err.startswith("error: cannot read")
    assert name in err


def test_doctor_finds_this_installation_well(told) -> None:
    status, out, err = told("doctor")
    assert status == 0
    assert out.endswith("\nall well\n")
    assert f"softrobots {sr.__version__}, Python " in out
    assert f"  xacro    {xacro_folder()}\n" in out
    assert f"  cache    {cache_folder()} (compiled solvers, by {available_backend()})\n" in out
    for name in sr.ROBOTS:
        assert re.search(rf"^  {name}\.urdf +the same$", out, re.M)
        assert re.search(rf"^  {name} +yourdfpy +\S+ +\d\.\de-1\d m +\d\.\de-1\d rad", out, re.M)
    assert "MuJoCo" not in out
    assert "5/5" in err  # a progress bar


def test_doctor_asks_every_tool_if_told(told, monkeypatch: pytest.MonkeyPatch) -> None:
    """On one file, which is enough to see that they are asked; all of them are in tests/test_interop.py."""
    monkeypatch.setattr("softrobots.commands.doctor.ROBOTS", {"inflatable_arm": sr.InflatableArm})
    status, out, _ = told("doctor", "--all")
    assert status == 0
    for name, tool in TOOLS.items():
        if tool.version is not None:
            assert re.search(rf"^  inflatable_arm +{name} +{re.escape(tool.version)} ", out, re.M), name


def test_doctor_tells_what_is_missing_and_what_to_type(told, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing package of an extra is no trouble; a required one that is missing or too old is."""
    versions = {"meshcat": None, "numpy": "1.26.4", "mujoco": None, "scipy": "1.2"}
    original = packages.installed_version
    monkeypatch.setattr(packages, "installed_version", lambda name: versions[name] if name in versions else original(name))
    status, out, _ = told("doctor")
    assert status == 1
    assert "missing: pip install 'meshcat>=0.3.2'" in out
    assert "1.26.4 is older than 2.0: pip install -U 'numpy>=2.0'" in out
    assert "missing: pip install 'softrobots[interop]'" in out
    assert "1.2 is older than 1.13: pip install -U 'softrobots[helix]'" in out
    wrong = out[out.index("\nwrong:\n") :]
    assert "numpy" in wrong
    assert "meshcat" in wrong
    assert "mujoco" not in wrong
    assert "scipy" not in wrong


def test_doctor_sees_files_that_differ_and_kinematics_that_do_not_agree(
    told, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for file in urdf_folder().glob("*.urdf"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    text = ARM.read_text(encoding="utf-8")
    (tmp_path / ARM.name).write_text(text.replace('xyz="0.0 -1.0 0.0"', 'xyz="0.0 -2.0 0.0"'), encoding="utf-8")
    (tmp_path / "pcc_arm.urdf").write_text("<robot", encoding="utf-8")
    monkeypatch.setattr("softrobots.commands.doctor.urdf_folder", lambda: tmp_path)
    monkeypatch.setattr("softrobots.commands.doctor.installed_tools", lambda: ("ikpy",))
    some = {name: sr.ROBOTS[name] for name in ("inflatable_arm", "pcc_arm")}  # the others agree, as the tests above see
    monkeypatch.setattr("softrobots.commands.doctor.ROBOTS", some)
    status, out, _ = told("doctor", "--all")
    assert status == 1
    assert re.search(r"inflatable_arm\.urdf +differs", out)
    wrong = out[out.index("\nwrong:\n") :]
    assert "inflatable_arm.urdf is not what xacro generates" in wrong
    assert "pcc_arm.urdf is not well-formed XML" in wrong
    assert re.search(r"inflatable_arm: ikpy is within \d\.\de\+?-?\d+ m", wrong)  # it takes the axis as it stands


def test_doctor_goes_on_without_browser_and_stops_without_folders(told, monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> Path:
        raise sr.DescriptionError("softrobots was installed without its folder urdf/; install it again")

    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("softrobots.commands.doctor.ROBOTS", {"inflatable_arm": sr.InflatableArm})
    status, out, _ = told("doctor")
    assert status == 0
    assert "browser  none, so no pictures of the viewer: no browser found" in out
    monkeypatch.setattr("softrobots.commands.doctor.urdf_folder", nowhere)
    status, out, _ = told("doctor")
    assert status == 1
    assert "Packages" in out
    assert "kinematics at" not in out
    assert "without its folder urdf/" in out


def test_the_packages_are_those_of_pyproject() -> None:
    """Required ones and those of each extra, with the same oldest versions."""
    text = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    listed, place = {}, ""
    for line in text[text.index("dependencies = [") : text.index("[project.scripts]")].splitlines():
        place = re.match(r"([\w-]+) = \[", line)[1] if re.match(r"([\w-]+) = \[", line) else place
        for name, least in re.findall(r'"([\w-]+)(?:\[\w+\])?>=([\d.]+)', line):
            listed[name] = ("" if place == "dependencies" else place, least)
    ours = {package.name: (package.extra, package.minimum) for package in PACKAGES}
    assert {name: ours[name] for name in ours} == {name: listed[name] for name in ours}
    used_in_development = {"build", "hatchling", "hypothesis", "mpmath", "mypy", "pillow", "pytest", "pytest-xdist", "ruff"}
    assert set(listed) - set(ours) <= used_in_development


@pytest.mark.parametrize(
    ("version", "minimum", "ok"),
    [("2.0", "2.0", True), ("2.10.1", "2.9", True), ("1.26.4", "2.0", False), ("2.0rc1", "2.0", True), (None, "1", False)],
)
def test_versions_are_compared_by_their_numbers(version: str | None, minimum: str, ok: bool) -> None:
    state = PackageState(Package("p", minimum, "", ""), version)
    assert state.ok == ok
    assert bool(state.advice) != ok


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


@pytest.mark.parametrize("word", ["wrist", "wrist=", "wrist=soft", "=20", "wrist=20,far"])
def test_export_refuses_words_that_are_no_spring(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["export", "arm.urdf", "--spring", word, "-o", "arm.xml"])
    assert "JOINT=K" in capsys.readouterr().err


def test_export_tells_what_it_wrote_of_sections(told, tmp_path: Path) -> None:
    status, out, _ = told("export", "pcc_arm", "-o", str(tmp_path / "arm.json"))
    assert status == 0
    assert "8 sections, 0 springs, 6 actuators" in out
