"""Every script runs, writes what it says, and refuses bad input without leaving anything behind."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.trajectory import METHODS
from tests.conftest import CHECKOUT, load_script
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study


@pytest.mark.parametrize("method", METHODS)
def test_ik_trajectory_with_every_method(method: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    plots = [] if method == "newton" else ["--no-plots"]
    assert run_script("ik_trajectory", ["--output", str(folder), "--method", method, "--steps", "24", *plots]) == 0
    names = {path.name for path in folder.iterdir()}
    drawn = {"poses.png", "motor_angles.png", "tip_errors.png", "link_moments.png"}
    assert names == {
        "trajectory.npz", "rigid.npz", "uncompensated.npz", "paper.npz", "trajectory.csv", "summary.json", "scene.html",
    } | (drawn if method == "newton" else set())  # fmt: skip
    saved = sr.load_result(folder / "trajectory.npz")
    summary = json.loads((folder / "summary.json").read_text())
    assert saved.method == method
    assert summary["tip_error_compensated_m"] == saved.tip_error.max()
    assert summary["tip_error_uncompensated_m"] > 0.1
    assert (saved.tip_error.max() <= 1e-9) == (method != "paper")
    out, err = capsys.readouterr()
    assert "largest moment at link 1" in out
    assert str(folder) in out
    assert "24/24" in err  # a progress bar


def test_ik_trajectory_turns_a_hand_on_a_wrist(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Poses, compensated to 1e-9 m and 1e-9 rad, also of equilibria solved anew (to 1e-10 themselves); and from a file."""
    folder = tmp_path / "out"
    assert run_script("ik_trajectory", ["--wrist", "--output", str(folder), "--steps", "16", "--gravity"]) == 0
    names = {path.name for path in folder.iterdir()}
    drawn = {"poses.png", "motor_angles.png", "tip_errors.png", "orientation_errors.png", "link_moments.png"}
    results = {"trajectory.npz", "rigid.npz", "uncompensated.npz", "trajectory.csv", "summary.json", "scene.html"}
    assert names == results | drawn
    saved, summary = sr.load_result(folder / "trajectory.npz"), json.loads((folder / "summary.json").read_text())
    assert saved.model.n_motors == 6
    assert saved.orientations.shape == (17, 3, 3)
    assert summary["verified_tip_error_m"] < 1.1e-9
    assert summary["verified_orientation_error_rad"] < 1.1e-9
    assert summary["orientation_error_uncompensated_rad"] > 0.05
    assert "largest angle, rigid IK on the flexible arm" in capsys.readouterr().out
    again = ["--wrist", "0", "0.2", "--csv", str(folder / "trajectory.csv"), "--gravity", "--no-plots"]
    assert run_script("ik_trajectory", [*again, "--output", str(tmp_path / "again")]) == 0
    assert sr.load_result(tmp_path / "again" / "trajectory.npz").orientation_error.max() < 1e-9
    with pytest.raises(SystemExit):
        run_script("ik_trajectory", ["--wrist", "a"])


def test_ik_trajectory_reads_waypoints_gravity_and_parameters(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    waypoints = tmp_path / "path.csv"
    waypoints.write_text("t,x,y,z\n0,0.8,0,0.2\n1,0.8,0.1,0.2\n2,0.8,0.2,0.3\n", encoding="utf-8")
    folder = tmp_path / "out"
    arguments = ["--csv", str(waypoints), "--gravity", "--force", "0", "0", "-5", "--stiffness", "200", "--pressure", "5000"]
    assert run_script("ik_trajectory", [*arguments, "--elbow", "down", "--no-plots", "--output", str(folder)]) == 0
    saved = sr.load_result(folder / "trajectory.npz")
    assert saved.targets.tolist() == [[0.8, 0.0, 0.2], [0.8, 0.1, 0.2], [0.8, 0.2, 0.3]]
    assert saved.equilibria[0].load.gravity == sr.EARTH_GRAVITY
    assert saved.model.stiffness.tolist() == [200.0] * 4
    assert saved.model.spring_groups[0].pressure == 5000.0
    assert "WARNING: a link wrinkles" in capsys.readouterr().out


def test_ik_trajectory_serves_until_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    from softrobots.view.viewer import Viewer

    served: list[bool] = []
    monkeypatch.setattr(Viewer, "wait", lambda self: served.append(self.serving))
    assert run_script("ik_trajectory", ["--output", str(tmp_path / "a"), "--no-plots", "--steps", "5", "--meshcat"]) == 0
    assert served == [True]
    out = capsys.readouterr().out
    assert "serving http://127.0.0.1:" in out
    assert "ssh -L" in out


@each_row(
    ("arguments", "status", "message"),
    [
        (["--end", "3", "0", "0"], 1, "waypoint .* cannot reach"),
        (["--start", "3", "0", "0"], 1, "cannot reach"),
        (["--duration", "-1"], 2, "duration"),
        (["--steps", "0"], 2, "steps"),
        (["--stiffness", "-5"], 2, "stiffness"),
        (["--pressure", "-5"], 2, "pressure"),
        (["--pressure", "0"], 2, "pressure"),
        (["--csv", "path.csv", "--start", "1", "0", "0"], 2, "given without --start"),
        (["--force", "nan", "0", "0"], 2, "force"),
        (["--gravity", "1", "2"], 2, "gravity"),
        (["--gain", "0"], 2, "gain"),
        (["--csv", "missing.csv"], 2, "missing.csv"),
        (["--wrist", "0.1"], 2, "wrist"),
        (["--end-rpy", "0", "1", "0"], 2, "given with --wrist"),
        (["--wrist", "--method", "paper"], 2, "method"),
    ],
)
def test_ik_trajectory_refuses_bad_input_and_leaves_nothing(
    arguments: list[str], status: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert (
        run_script(
            "ik_trajectory",
            [*arguments, "--output", str(folder), *(() if "--csv" in arguments else ("--steps", "20")), *arguments],
        )
        == status
    )
    out, err = capsys.readouterr()
    assert re.search(f"error: .*{message}", err)
    assert out == ""
    assert not folder.exists()


def test_ik_trajectory_refuses_a_folder_that_is_not_empty(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
    assert run_script("ik_trajectory", ["--output", str(tmp_path), "--no-plots"]) == 2
    assert "is not empty (it contains mine.txt)" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    for folder in (tmp_path / "mine.txt", tmp_path / "mine.txt" / "below"):
        assert run_script("ik_trajectory", ["--output", str(folder), "--no-plots"]) == 2
        assert "mine.txt is a file" in capsys.readouterr().err


@pytest.mark.parametrize("name", sorted(file.stem for file in (CHECKOUT / "scripts").glob("*.py")))
def test_every_script_explains_itself(name: str, capsys: pytest.CaptureFixture) -> None:
    for arguments, status in ((["--help"], 0), (["--no-such-option"], 2)):
        with pytest.raises(SystemExit) as ended:
            run_script(name, arguments)
        assert ended.value.code == status
    out, err = capsys.readouterr()
    purpose = load_script(name).__doc__.partition("\n")[0]
    assert " ".join(purpose.split()) in " ".join(out.split())
    assert "--no-such-option" in err


def test_generate_urdf_checks_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert run_script("generate_urdf", ["--check"]) == 0
    assert run_script("generate_urdf", ["--check", "--output", str(tmp_path)]) == 1
    assert list(tmp_path.iterdir()) == []
    assert run_script("generate_urdf", ["--output", str(tmp_path)]) == 0
    assert run_script("generate_urdf", ["--check", "--output", str(tmp_path)]) == 0
    file = tmp_path / "inflatable_arm.urdf"
    file.write_text(file.read_text(encoding="utf-8").replace("172.71", "172.72"), encoding="utf-8")
    assert run_script("generate_urdf", ["--check", "--output", str(tmp_path)]) == 1
    assert "differs" in capsys.readouterr().out


def test_solver_rates_prints_both_tables(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "rates.json"
    arguments = ["--cases", "40", "--loads", "18", "200", "--estimation-loads", "18", "--json", str(file)]
    assert run_script("solver_rates", arguments) == 0
    out = capsys.readouterr().out
    assert "| newton | 100.00 | 100.00 |" in out
    assert "loads beyond wrinkling test the solvers, not the robot" in out
    rates = json.loads(file.read_text(encoding="utf-8"))
    assert rates["equilibrium"]["fixed_point"]["200.0"] < 70.0
    assert run_script("solver_rates", arguments) == 2  # the file is there


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("solver_rates", ["--cases", "0"], "0 is not a positive number of cases"),
        ("solver_rates", ["--loads", "nan"], "nan is not a positive, finite force"),
        ("generate_urdf", ["--output", __file__], "is a file; a folder is required"),
    ],
)
def test_scripts_refuse_bad_arguments(name: str, arguments: list[str], message: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        run_script(name, arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


def test_make_pictures_photographs_the_arm(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    from PIL import Image

    from studies.shared.browser import find_chromium
    from tests.conftest import missing

    try:
        find_chromium()
    except sr.ViewerError as error:
        missing(str(error))
    assert run_script("make_pictures", ["--output", str(tmp_path), "--only", "inflatable_arm"]) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["inflatable_arm.png"]
    picture = np.asarray(Image.open(tmp_path / "inflatable_arm.png").convert("RGB")).astype(int)
    assert picture.shape == (621, 1110, 3)
    assert np.count_nonzero(picture[..., 0] - picture[..., 2] > 60) > 5000  # the warm colours of the links


def test_plots_show_what_they_say(arm: sr.SoftModel) -> None:
    """Lines, axis labels with units, legends: read back from the figures."""
    from studies.papers import trajectory_pictures

    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 12)
    loaded = sr.follow_trajectory(arm, path.positions, (0, 10, -15), times=path.times, elbow="up")
    rigid = sr.follow_trajectory(arm, path.positions, times=path.times, elbow="up")
    angles = trajectory_pictures.motor_angles(loaded, rigid).axes[0]
    assert len(angles.lines) == 6
    assert np.array_equal(angles.lines[0].get_ydata(), loaded.q_motors[:, 0])
    assert np.array_equal(angles.lines[1].get_ydata(), rigid.q_motors[:, 0])
    assert angles.get_ylabel() == "motor angle [rad]"
    moments = trajectory_pictures.link_moments(loaded).axes[0]
    assert moments.get_ylim()[1] > arm.spring_groups[0].wrinkling_moment
    scene = trajectory_pictures.poses(loaded).axes[0]
    ends = np.array(scene.lines[1].get_data_3d())[:, -1]
    assert np.allclose(ends, loaded.tip_positions[0], atol=1e-12)
    errors = trajectory_pictures.tip_errors({"a": loaded.tip_error}, loaded.times).axes[0]
    assert errors.get_yscale() == "log"
    with pytest.raises(sr.ParameterError, match="a Trajectory"):
        trajectory_pictures.poses(None)
    with pytest.raises(sr.ParameterError, match="shown"):
        trajectory_pictures.poses(loaded, shown=-2)
    with pytest.raises(sr.ParameterError, match="errors"):
        trajectory_pictures.tip_errors({"a": loaded.tip_error[:3]}, loaded.times)
    with pytest.raises(sr.ParameterError, match="13 waypoints"):
        trajectory_pictures.motor_angles(loaded, sr.follow_trajectory(arm, path.positions[:3]))
    plain = sr.load_model(arm.urdf, springs=dict.fromkeys(arm.spring_joints) | {"spring_1_up": 100.0}, motors=arm.motor_joints)
    with pytest.raises(sr.ParameterError, match="with inflated links"):
        trajectory_pictures.link_moments(sr.follow_trajectory(plain, path.positions[:2]))


def test_identification_errors_counts_intervals_and_chooses_poses(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Small: two fits of each noise, five of 60 candidates. The record has the tables that are printed."""
    monkeypatch.setattr("studies.identification.choice.CANDIDATES", 60)
    monkeypatch.setattr("studies.identification.choice.NUMBERS", (5,))
    names = ("identification_coverage", "informative_poses")
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "validation.md"
    page.write_text("".join(f"<!-- {name}:begin -->\n<!-- {name}:end -->\n" for name in names))
    assert run_script("identification_errors", ["--fits", "2", "--seed", "3", "--docs", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    found, chosen = (json.loads((tmp_path / "docs" / "validation" / f"{name}.json").read_text()) for name in names)
    assert all(table.strip() in page.read_text() for table in printed.split("\n\n"))
    assert found["command"] == "python scripts/identification_errors.py --fits 2 --seed 3"
    for rows in found["noises"].values():
        assert len(rows) == 9
        for row in rows:  # a fit of 120 rows is near the truth
            assert row["mean"] == pytest.approx(row["truth"], rel=0.5, abs=0.002)
            assert {row["rows"], row["blocks"]} <= {0.0, 0.5, 1.0}
    assert 0.1 < chosen["rows"][0]["random"] < 1.0
    assert run_script("identification_errors", ["--fits", "1"]) == 2
