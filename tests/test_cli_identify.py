"""The command `softrobots identify`: from a CSV file to a folder with report, numbers, table and a robot for other commands."""

from __future__ import annotations

import csv
import dataclasses
import importlib.util
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import softrobots as sr
from softrobots.cli import identify as command
from softrobots.identification.fit import INTERRUPTED
from softrobots.identification.measurement_columns import read_columns
from softrobots.robots.parameter_file import read_robot
from tests.support.tables import each_row

Told = Callable[..., tuple[int, str, str]]
STIFFNESS = 150.0
COLUMNS = """actuators: {columns: [m1, m2, m3], unit: deg}
mass: {columns: hung, unit: g}
gravity: [0, 0, -9.81]
positions: {tip: {columns: [x, y, z], unit: mm, std: 0.001}}
labels: day
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Twelve rows on three days, of an arm with another stiffness and its base 0.1 m away, to a hundredth of a micrometre."""
    arm = sr.load_model(sr.InflatableArm(stiffness=STIFFNESS))
    rows = ["m1,m2,m3,hung,x,y,z,day"]
    for k, motors in enumerate(np.random.default_rng(1).uniform(-30.0, 30.0, (12, 3)).round(2)):
        mass = 500 * (k % 3)
        tip = sr.solve_equilibrium(arm, np.radians(motors), (0, 0, -9.81e-3 * mass), gravity=(0, 0, -9.81)).tip_position
        rows.append(",".join(map(str, (*motors, mass, *(1e3 * tip + (100, 0, 0)).round(5), f"day{k // 4 + 1}"))))
    (tmp_path / "poses.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (tmp_path / "columns.yaml").write_text(COLUMNS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


WORDS = ("identify", "poses.csv", "--robot", "inflatable_arm", "--columns", "columns.yaml")
FIT = ("--fit", "stiffness, base.position")


@pytest.mark.study
@pytest.mark.filterwarnings("default:base and markers:UserWarning")
def test_a_folder_holds_the_fit_and_a_robot_for_other_commands(folder: Path, told: Told) -> None:
    status, out, err = told(*WORDS, *FIT, "--hold-out", "day3", "-o", "fit", "--json")
    assert status == 0, err
    answer = json.loads(out)
    found = answer["parameters"]
    # rows are rounded to 1e-8 m: of 0.1 m sag that is 1e-7 of the stiffness
    assert found["stiffness"]["value"] == pytest.approx(STIFFNESS, rel=1e-6)
    assert found["base.position.x"]["value"] == pytest.approx(0.1, abs=1e-7)
    assert [found[name]["unit"] for name in ("stiffness", "base.position.x")] == ["N m/rad", "m"]
    low, high = found["stiffness"]["interval"]
    assert low < STIFFNESS < high
    assert (answer["message"], answer["fitted"]["rows"], answer["validation"]["rows"]) == ("converged", 8, 4)
    assert answer["validation"]["errors"]["positions.tip"]["root_mean_square"] < 1e-7
    assert np.shape(answer["covariance"]) == (4, 4)
    names = ["identification.npz", "predictions.csv", "robot.yaml", "report.txt", "identification.json"]
    pictures = [f"{name}.png" for name in ("residuals", "predicted", "values", "correlation", "ellipses")]
    drawn = pictures if importlib.util.find_spec("matplotlib") else []
    assert [Path(file).name for file in answer["files"]] == [*names, *drawn, "page.html"]
    assert json.loads((folder / "fit" / "identification.json").read_text(encoding="utf-8")) == {
        key: value for key, value in answer.items() if key != "files"
    }
    report = (folder / "fit" / "report.txt").read_text(encoding="utf-8")
    assert "base.position.x" in report
    assert "hint" not in report

    robot = read_robot(folder / "fit" / "robot.yaml")
    assert robot.stiffness == (found["stiffness"]["value"],) * 2  # type: ignore[attr-defined]
    loaded = sr.load_result(folder / "fit" / "identification.npz")
    assert loaded.values["stiffness"] == found["stiffness"]["value"]
    motors = ("--motors", "0.3", "0.6", "-0.8", "--gravity", "--json")
    status, out, err = told("solve", "fit/robot.yaml", *motors)
    assert status == 0, err
    same = sr.solve_equilibrium(sr.load_model(robot), (0.3, 0.6, -0.8), gravity=(0, 0, -9.81))
    base = [found[f"base.position.{axis}"]["value"] for axis in "xyz"]  # the file has it: the tip is told as it was measured
    np.testing.assert_allclose(json.loads(out)["tip_position"], same.tip_position + base, rtol=1e-12)
    assert told("solve", "inflatable_arm", "--parameters", "fit/robot.yaml", *motors)[1] == out

    with (folder / "fit" / "predictions.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["set"] for row in rows] == ["fitted"] * 8 + ["validation"] * 4
    assert [row["row"] for row in rows] == [f"line {line}" for line in range(2, 14)]
    for row in rows:
        x, predicted, left = (float(row[f"{what} positions.tip x [m]"]) for what in ("measured", "predicted", "residual"))
        assert x - predicted == pytest.approx(left, abs=1e-15)

    status, out, err = told(*WORDS, *FIT, "-o", "fit")
    assert (status, out) == (2, "")
    assert "report.txt exists" in err
    status, out, err = told(*WORDS, *FIT, "-o", "fit", "--overwrite")
    assert status == 0, err
    assert "not in robot.yaml" not in out
    status, out, err = told("identify", "poses.csv", "--robot", "fit/robot.yaml", *WORDS[4:], *FIT, "--json")
    assert "base and markers of fit/robot.yaml are left out" in err
    assert json.loads(out)["parameters"]["base.position.x"]["value"] == pytest.approx(0.1, abs=1e-7), err


@pytest.mark.study
@pytest.mark.filterwarnings("default::UserWarning")
def test_without_matplotlib_all_but_the_pictures_is_written(folder: Path, told: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    status, _, err = told(*WORDS, "--fit", "stiffness,base.position", "-o", "fit")
    assert status == 0
    assert "not all is drawn" in err
    assert "softrobots[plot]" in err
    assert {file.suffix for file in (folder / "fit").iterdir()} == {".txt", ".json", ".npz", ".csv", ".yaml", ".html"}


def test_labels_held_out_of_a_comparison_still_happen_where_the_robot_rubs(folder: Path, told: Told) -> None:
    """Rows without noise are predicted where those that are held out in their midst are rolled out, too; else 0.02 mm off."""
    words = ("tendon_arm", "--set", "segment_lengths=[0.06]", "elastic_sections=1", "bending_friction=0.002")
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1, bending_friction=2e-3))
    names, now = [f"m{k}" for k in range(arm.n_motors)], None
    rows = [",".join([*names, "x", "y", "z", "day"])]
    for k, pull in enumerate(np.random.default_rng(1).uniform(-1e-3, 4e-3, (24, arm.n_motors)).round(6)):
        now = sr.solve_equilibrium(arm, arm.relaxed_motors - pull, previous=now, tolerance=1e-12)
        rows.append(",".join(map(str, (*now.q_motors, *now.tip_position, f"day{k // 6}"))))
    (folder / "pulls.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    columns = f"actuators: {{columns: {names}, unit: m}}\npositions: {{tip: {{columns: [x, y, z], unit: m}}}}\nlabels: day\n"
    (folder / "pulls.yaml").write_text(columns.replace("'", ""), encoding="utf-8")
    fit = ("--fit", "bending_friction", "--families", "day[0-9]", "--hold-out", "day1", "--json")
    status, out, err = told("identify", "pulls.csv", "--robot", *words, "--columns", "pulls.yaml", *fit)
    assert status == 0, err
    assert np.max(json.loads(out)["cross_validation"]["errors"]) < 1e-6  # [m]; searches leave a share of the cost


@pytest.mark.study
def test_sets_of_parameters_are_compared_on_families_left_out(folder: Path, told: Told) -> None:
    status, out, err = told(*WORDS, *FIT, "--fit", "stiffness", "--families", "day[0-9]", "--json")
    assert status == 0, err
    compared = json.loads(out)["cross_validation"]
    assert compared["families"] == ["day1", "day2", "day3"]
    assert compared["best"] == "stiffness, base.position"
    assert compared["means"][0] < 1e-7 < 1e-3 < compared["means"][1]  # the base is 0.1 m away


@pytest.mark.filterwarnings("default:positions.tip spreads")
def test_a_unit_that_is_wrong_is_told_before_and_after_the_fit(folder: Path, told: Told) -> None:
    (folder / "columns.yaml").write_text(COLUMNS.replace("unit: mm", "unit: m"), encoding="utf-8")
    _, out, err = told(*WORDS, "--fit", "base.position")
    assert "warning: positions.tip spreads over" in err
    assert "hint: positions.tip: dividing it by 1000 (mm (N mm, g) taken for m (N m, kg)" in out


def test_a_prior_may_be_around_the_value_that_the_robot_has(folder: Path, told: Told) -> None:
    """As with the mean written out; of a standard deviation of 10 % that of the mean."""
    set_to = ("--set", "stiffness=[140, 160]")
    for short, long in (("2.5", "2.5"), ("5%", "7")):
        words = (*set_to, "--fit", "link[*].stiffness, base.position", "--prior", f"link[*].stiffness={short}", "--json")
        status, out, err = told(*WORDS, *words)
        assert status == 0, err
        found = json.loads(out)["parameters"]
        assert found["link[1].stiffness"]["prior"] == pytest.approx([140.0, float(long)], rel=1e-12)
        assert found["link[2].stiffness"]["prior"] == pytest.approx([160.0, 8.0 if "%" in short else 2.5], rel=1e-12)


@pytest.mark.study
def test_errors_are_told_also_without_their_mean(folder: Path, told: Told) -> None:
    """Of a base that is 0.1 m away and not fitted, the mean of the differences takes all but the bend of another stiffness."""
    _, out, _ = told(*WORDS, "--fit", "hinge_offset", "--hold-out", "day3", "-o", "fit", "--json")
    answer = json.loads(out)
    with (folder / "fit" / "predictions.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name in ("fitted", "validation"):
        left = np.array([[row[f"residual positions.tip {axis} [m]"] for axis in "xyz"] for row in rows if row["set"] == name])
        each = left.astype(float) - left.astype(float).mean(axis=0)
        error = answer[name]["without_mean"]["positions.tip"]
        assert error == pytest.approx(float(np.sqrt(np.mean(np.sum(each**2, axis=1)))), rel=1e-9)
        assert error < answer[name]["errors"]["positions.tip"]["root_mean_square"]
    report = (folder / "fit" / "report.txt").read_text(encoding="utf-8")
    assert f"positions.tip, without the mean of kept aside rows: {error:.4g} m" in report
    assert "times the standard deviation that was given" in report


@pytest.mark.study
@each_row(("message", "status"), [(INTERRUPTED, 130), ("at most 100 steps", 1)])
def test_a_fit_that_ends_early_is_kept(
    message: str, status: int, folder: Path, told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = command.identify
    monkeypatch.setattr(command, "identify", lambda *args, **kwargs: dataclasses.replace(fit(*args, **kwargs), message=message))
    assert told(*WORDS, *FIT, "-o", message)[0] == status
    assert message in (folder / message / "report.txt").read_text(encoding="utf-8")


@pytest.mark.study
def test_springs_of_a_foreign_file_are_options_of_other_commands(folder: Path, told: Told) -> None:
    Path("arm.urdf").write_text(sr.InflatableArm().urdf(), encoding="utf-8")
    words = ("identify", "poses.csv", "--robot", "arm.urdf", "--columns", "columns.yaml")
    fitted = ("base.position", "joint[spring_1_up].stiffness", "joint[spring_2_up].stiffness")
    status, out, err = told(*words, "--fit", ",".join(fitted), "-o", "fit")
    assert status == 0, err
    assert "--spring spring_1_side=172.71,0 --spring spring_1_up=150,0" in out
    assert not Path("fit/robot.yaml").exists()


BAD: list[tuple[tuple[Any, ...], str]] = [
    ((*FIT, "--loss", "square"), "invalid choice: 'square'"),
    ((*FIT, "--starts", "0"), "--starts = 0"),
    ((*FIT, "--prior", "stiffness"), "NAME=MEAN,STD or NAME=STD is required"),
    ((*FIT, "--prior", "stiffness=1,2,3"), "NAME=MEAN,STD or NAME=STD is required"),
    ((*FIT, "--prior", "stiffness=1,-1"), "--prior"),
    ((*FIT, "--prior", "base.position=10%"), "--prior must be positive"),
    ((*FIT, "--prior", "stifness=10%"), "did you mean 'stiffness'"),
    ((*FIT, "--prior", "stiffness=1,1", "--prior", "stiffness=1,2"), "given once for each parameter"),
    ((*FIT, "--prior", "radius=1,1"), "no fitted parameter is called 'radius'"),
    (("--fit", "stifness"), "did you mean 'stiffness'"),
    (("--fit", "stiffness,link[1].stiffness"), "--fit = "),
    ((*FIT, "--hold-out", "day9"), "no label is called 'day9'"),
    ((*FIT, "--hold-out", "day*"), "--hold-out"),
    ((*FIT, "--validate", "nothing.csv"), "cannot read nothing.csv"),
    ((*FIT, "--columns", "nothing.yaml"), "nothing.yaml"),
    ((*FIT, "--robot", "columns.yaml"), "actuators"),
    ((*FIT, "--robot", "nothing.yaml"), "no robot or file is called 'nothing.yaml'"),
    ((*FIT, "--robot", "pcc_arm"), "of 6 columns"),
    ((*FIT, "--families", "("), "--families"),
]


@each_row(("words", "message"), BAD)
def test_bad_input_is_refused_with_status_2(words: tuple[str, ...], message: str, folder: Path, told: Told) -> None:
    status, out, err = told(*WORDS, *words)
    assert (status, out) == (2, "")
    assert message in err


def test_a_table_without_a_mapping_shows_its_columns_and_how_a_mapping_looks(folder: Path, told: Told) -> None:
    words = [word for word in WORDS if word not in ("--columns", "columns.yaml")]
    status, out, err = told(*words, *FIT)
    assert (status, out) == (2, "")
    first_line = Path(words[1]).read_text(encoding="utf-8").splitlines()[0]
    assert first_line[:100] in err
    assert "--columns FILE" in err
    read_columns(yaml.safe_load(err[err.index("{") :]))  # the example that it gives is a mapping
