"""The script that lets a UR5 carry a soft arm: its numbers, its files and its refusals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = [pytest.mark.study, pytest.mark.usefixtures("ur5")]

NAME = "ur5_with_soft_arm"


def test_the_default_brings_the_loaded_tip_back(tmp_path: Path, ur5: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    assert run_script(NAME, ["--steps", "4", "--output", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {
        "ur5_with_inflatable_arm.urdf", "result.npz", "result.csv", "summary.json", "table.txt", "scene.html", "poses.png",
    }  # fmt: skip
    summary = json.loads((folder / "summary.json").read_text())
    saved = sr.load_result(folder / "result.npz")
    assert saved.model == sr.load_model(folder / "ur5_with_inflatable_arm.urdf")
    assert saved.tip_error[0] == summary["tip_error_before_m"] == pytest.approx(summary["sag_m"], rel=1e-12)
    assert saved.tip_error[-1] == summary["tip_error_after_m"] < 1e-9
    assert 0.05 < summary["sag_m"] < 0.3
    assert 0.0 < summary["wrinkling_margin"] < 1.0
    assert summary["all_stable"]
    assert summary["within_limits"]
    assert summary["effort_limit_N_m"] == [150.0] * 3 + [28.0] * 3
    arm = pin.buildModelFromXML(sr.InflatableArm().urdf(), pin.JointModelFreeFlyer())
    assert summary["carried_mass_kg"] == pytest.approx(pin.computeTotalMass(arm) + 1.0, rel=1e-12)
    assert np.all(np.array(summary["largest_torque_after_N_m"]) < summary["effort_limit_N_m"])

    # The torque of the shoulder: moment of all weights about its axis, from masses and centres alone.
    last, model = saved.equilibria[-1], saved.model.pinocchio
    data = model.createData()
    pin.forwardKinematics(model, data, last.q)
    number = model.getJointId("shoulder_lift_joint")
    weights = [(inertia.mass, data.oMi[i].act(inertia.lever)) for i, inertia in enumerate(model.inertias) if i >= number]
    weights.append((summary["payload_kg"], last.tip_position))
    axis = data.oMi[number].rotation[:, 1]
    moment = sum(np.cross(at - data.oMi[number].translation, [0.0, 0.0, -9.81 * mass]) for mass, at in weights)
    assert last.motor_torques[1] == pytest.approx(axis @ moment, rel=1e-9)

    out = capsys.readouterr().out
    assert "sag of the tip against the rigid arm" in out
    assert re.search(r"wrist_1_joint .* 28 N m", out)
    assert "WARNING" not in out


def test_a_line_is_followed_with_the_loaded_tip(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    arguments = ["--to", "1.2", "0.3", "0.6", "--payload", "2", "--steps", "3", "--duration", "0.1", "--no-plots"]
    assert run_script(NAME, [*arguments, "--output", str(tmp_path / "out")]) == 0
    saved = sr.load_result(tmp_path / "out" / "result.npz")
    assert np.allclose(saved.targets[-1], (1.2, 0.3, 0.6), rtol=0.0, atol=1e-15)
    assert saved.tip_error.max() < 1e-9
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["tip_error_before_m"] > 0.1
    assert "WARNING: a link wrinkles" in capsys.readouterr().out


@pytest.mark.parametrize("robot", ["helix_tube", "pcc_arm"])
def test_other_arms_are_carried_and_orientation_comes_back(robot: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    arguments = ["--robot", robot, "--keep-orientation", "--payload", "0.001", "--gravity", "0", "0", "-1", "--no-plots"]
    assert run_script(NAME, [*arguments, "--steps", "1", "--duration", "0.1", "--output", str(tmp_path / "out")]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["tip_error_after_m"] < 1e-9
    assert summary["tip_turned_after_rad"] < 1e-8 < summary["tip_turned_before_rad"]
    assert (summary["wrinkling_margin"] is None) == (robot == "pcc_arm")
    assert "margin" in capsys.readouterr().out or robot == "pcc_arm"


@each_row(
    ("arguments", "status", "message"),
    [
        (["--payload", "-1"], 2, "--payload"),
        (["--pressure", "-1"], 2, "pressure"),
        (["--steps", "0"], 2, "--steps"),
        (["--duration", "0"], 2, "--duration"),
        (["--pose", "nan", "0", "0", "0", "0", "0"], 2, "--pose"),
        (["--pose", "9", "0", "0", "0", "0", "0"], 2, "--pose must be within the limits"),
        (["--gravity", "0", "0", "inf"], 2, "--gravity"),
        (["--arm-angles", "0", "4", "0"], 2, "--arm-angles must be within the limits"),
        (["--robot", "helix_tube", "--arm-angles", "0", "0", "0"], 2, "has no motors"),
        (["--robot", "pcc_arm", "--pressure", "1e4"], 2, "not inflated"),
        (["--keep-orientation", "--to", "1", "0", "0"], 2, "left out with --to"),
        (["--to", "9", "0", "0"], 1, "cannot reach"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    arguments: list[str], status: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script(NAME, ["--output", str(folder), "--no-plots", "--steps", "2", *arguments]) == status
    out, err = capsys.readouterr()
    assert re.search(f"error: .*{message}", err)
    assert out == ""
    assert not folder.exists()
