"""The scripts of the PCC arm, its workspace and its figures: what they write is what the library says."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots import constant_curvature
from softrobots.statics.workspace import workspace_at
from softrobots.view.actuator_curves import actuator_curves
from softrobots.view.body import BentSections
from softrobots.view.figures import workspaces
from tests.conftest import CHECKOUT
from tests.support.oracles import central_difference
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

LENGTHS = (0.50, 0.53, 0.55, 0.54, 0.51, 0.52)


@pytest.fixture(scope="module")
def pcc() -> sr.SoftModel:
    return sr.load_model(sr.PccArm())


def test_lengths_in_pose_table_and_pictures_out(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    assert run_script("pcc_arm", ["--lengths", *map(str, LENGTHS), "--output", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {"equilibrium.npz", "summary.json", "shape.png", "scene.html"}
    summary = json.loads((folder / "summary.json").read_text())
    # docs/theory.md 2.3: torsion-free frames, eight decimals.
    assert np.allclose(summary["tip_m"], (0.44957382, -0.31544214, 0.84384418), atol=5e-9)
    assert np.allclose(summary["tip_without_load_m"], summary["tip_m"], atol=1e-12)
    assert summary["arc_bending_deg"][0] == pytest.approx(np.degrees(0.726483157), abs=1e-7)
    saved = sr.load_result(folder / "equilibrium.npz")
    assert np.array_equal(saved.muscle_lengths, summary["muscle_lengths_m"])
    out = capsys.readouterr().out
    assert "0.449574  -0.315442  0.843844" in out
    assert "muscle_2_3" in out


def test_target_in_lengths_out(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    arguments = ["--target", "0.3", "0.2", "0.85", "--direction", "1", "0", "0.5", "--force", "5", "3", "-4", "--no-plots"]
    assert run_script("pcc_arm", [*arguments, "--output", str(folder)]) == 0
    solution = sr.load_result(folder / "ik_solution.npz")
    assert np.allclose(solution.equilibrium.tip_position, (0.3, 0.2, 0.85), atol=1e-9)
    along = np.array(solution.equilibrium.transform_tip_to_world.rotation)[:, 2]
    assert np.allclose(along, np.array([1.0, 0.0, 0.5]) / np.hypot(1.0, 0.5), atol=1e-8)
    assert not (folder / "shape.png").exists()


def test_waypoints_and_the_lumped_chain(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    waypoints = tmp_path / "path.csv"
    waypoints.write_text("t,x,y,z\n0,0.3,0.2,0.8\n1,0.32,0.15,0.82\n2,0.35,0.1,0.8\n", encoding="utf-8")
    folder = tmp_path / "out"
    options = ["--chain", "lumped", "--hinges", "4", "--gravity", "--no-plots", "--output", str(folder)]
    assert run_script("pcc_arm", ["--csv", str(waypoints), *options]) == 0
    saved = sr.load_result(folder / "trajectory.npz")
    assert saved.tip_error.max() <= 1e-9
    assert saved.equilibria[0].load.gravity == sr.EARTH_GRAVITY
    assert len((folder / "trajectory.csv").read_text().splitlines()) == 4
    assert "largest tip error on the way" in capsys.readouterr().out


@each_row(
    ("arguments", "status", "message"),
    [
        (["--target", "0", "0", "3"], 1, "cannot reach"),
        (["--lengths", "0.5", "0.5"], 2, "shape \\(6,\\)"),
        (["--lengths", "0.5", "0.5", "0.5", "0.5", "0.5", "-0.5"], 2, "positive muscle lengths"),
        (["--lengths", "0.01", "1.2", "1.2", "0.5", "0.5", "0.5"], 2, "would bend by"),
        (["--direction", "1", "0", "0"], 2, "given with --target"),
        (["--segments", "0"], 2, "--segments"),
        (["--distance", "0"], 2, "muscle_distance"),
        (["--force", "nan", "0", "0"], 2, "force"),
        (["--csv", "missing.csv"], 2, "missing.csv"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    arguments: list[str], status: int, message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script("pcc_arm", [*arguments, "--no-plots", "--output", str(folder)]) == status
    out, err = capsys.readouterr()
    assert re.search(f"error: .*{message}", err)
    assert out == ""
    assert not folder.exists()


def test_workspace_script_writes_what_can_be_loaded(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    assert run_script("pcc_workspace", ["--samples", "150", "--output", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {"workspace.npz", "workspace.png"}
    saved = sr.load_result(folder / "workspace.npz")
    assert len(saved.tip_positions) + saved.refused == 150
    out, err = capsys.readouterr()
    assert f"{len(saved.tip_positions)}" in out
    assert "150/150" in err  # a progress bar
    assert run_script("pcc_workspace", ["--samples", "0", "--output", str(tmp_path / "b")]) == 2
    assert run_script("pcc_workspace", ["--segments", "0", "--output", str(tmp_path / "b")]) == 2
    assert run_script("pcc_workspace", ["--samples", "5", "--output", str(folder)]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert not (tmp_path / "b").exists()


def test_unloaded_workspace_is_that_of_the_closed_form(pcc: sr.SoftModel) -> None:
    """Tips by constant_curvature; manipulability from its Jacobian, each length over the distance 0.04 m."""
    found = sr.sample_workspace(pcc, 60, seed=3)
    assert found.refused == 0
    lengths = found.q_motors.reshape(-1, 2, 3)
    low, high = pcc.motor_limits.T
    assert np.all((found.q_motors >= low) & (found.q_motors <= high))
    arcs = constant_curvature.arc_from_muscles(lengths, 0.04)
    assert np.allclose(found.tip_positions, constant_curvature.chain_transform(arcs)[:, :3, 3], atol=1e-12)
    jacobian = 0.04 * constant_curvature.chain_muscle_jacobian(lengths, 0.04)[:, :3]
    expected = np.sqrt(np.linalg.det(jacobian @ np.swapaxes(jacobian, 1, 2)))
    assert np.allclose(found.manipulability, expected, rtol=1e-9)
    again = sr.sample_workspace(pcc, 60, seed=3)
    assert np.array_equal(found.tip_positions, again.tip_positions)


def test_loaded_workspace_is_made_of_stable_equilibria(pcc: sr.SoftModel) -> None:
    found = sr.sample_workspace(pcc, 12, force=(0, 4, -2), gravity=sr.EARTH_GRAVITY, seed=1)
    for motors, tip in zip(found.q_motors, found.tip_positions, strict=True):
        solved = sr.solve_equilibrium(pcc, motors, (0, 4, -2), gravity=sr.EARTH_GRAVITY)
        assert solved.stable
        assert np.allclose(solved.tip_position, tip, atol=1e-9)  # residuals of 1e-10 over the softest stiffness of about 1

    def tip_at(motors: np.ndarray) -> np.ndarray:
        return sr.solve_equilibrium(pcc, motors, (0, 4, -2), gravity=sr.EARTH_GRAVITY, tolerance=1e-13).tip_position

    slope = 0.04 * central_difference(tip_at, found.q_motors[0], 1e-5)
    measure = np.prod(np.linalg.svd(slope, compute_uv=False))
    assert found.manipulability[0] == pytest.approx(measure, rel=1e-5)


def test_workspace_of_an_arm_with_motors(arm: sr.SoftModel) -> None:
    """Without load the tip of the straight-linked arm stays within its length, and |det J| is the manipulability."""
    found = sr.sample_workspace(arm, 40)
    assert np.linalg.norm(found.tip_positions, axis=1).max() <= 1.2 + 1e-12
    for motors, measure in zip(found.q_motors[:5], found.manipulability[:5], strict=True):
        jacobian = sr.elastostatic_jacobian(arm, sr.solve_equilibrium(arm, motors))
        assert measure == pytest.approx(abs(np.linalg.det(jacobian)), rel=1e-9, abs=1e-12)


def test_workspace_refuses_bad_input(pcc: sr.SoftModel, tmp_path: Path) -> None:
    rod = sr.load_model(sr.PccArm(muscle_azimuths=()))
    for call, field in (
        (lambda: sr.sample_workspace(rod, 5), "model"),
        (lambda: sr.sample_workspace(pcc, 0), "samples"),
        (lambda: sr.sample_workspace(pcc, 5, seed=-1), "seed"),
        (lambda: sr.sample_workspace(pcc, 5, force=(1, 2)), "force"),
    ):
        with pytest.raises(sr.ParameterError) as caught:
            call()
        assert caught.value.field == field
    with pytest.raises(sr.NameNotFound):
        sr.sample_workspace(pcc, 5, force=(1, 2, 3), frame="elbow")
    found = sr.sample_workspace(pcc, 5)
    moved = found.tip_positions + 1e-6
    with pytest.raises(sr.ParameterError, match="tip_positions"):
        workspace_at(pcc, found.load, found.q_motors, found.q_springs, moved, found.manipulability, 0)
    with pytest.raises(sr.ParameterError, match="manipulability"):
        workspace_at(pcc, found.load, found.q_motors, found.q_springs, found.tip_positions, found.manipulability[:3], 0)
    path = sr.save_result(found, tmp_path / "w")
    fields = dict(np.load(path))
    np.savez(tmp_path / "bad.npz", **(fields | {"tip_positions": moved}))
    with pytest.raises(sr.FileFormatError, match="tip_positions"):
        sr.load_result(tmp_path / "bad.npz")


def test_figures_show_what_they_say(pcc: sr.SoftModel) -> None:
    loaded = sr.solve_equilibrium(pcc, LENGTHS, (6, 4, -3))
    axes = sr.plot(loaded).axes[0]
    lines = [np.array(line.get_data_3d()) for line in axes.lines]
    ends = [line[:, -1] for line in lines]
    assert any(np.allclose(end, loaded.tip_position, atol=1e-12) for end in ends)
    for curve in actuator_curves(BentSections(pcc, loaded.q_motors, loaded.q_springs), pcc.muscles):
        points = curve.points.T
        assert any(line.shape == points.shape and np.allclose(line, points, atol=1e-12) for line in lines)
    assert (axes.get_xlabel(), axes.get_zlabel()) == ("x [m]", "z [m]")
    texts = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert {"backbone", "body", "without load, same muscle lengths"} <= set(texts)
    found = sr.sample_workspace(pcc, 30)
    views = workspaces.workspace(found).axes
    dots = views[0].collections[0].get_offsets()
    assert sorted(map(tuple, dots)) == sorted(map(tuple, found.tip_positions[:, [0, 2]]))
    assert "manipulability" in views[3].get_ylabel()
    with pytest.raises(sr.ParameterError, match="a Workspace"):
        workspaces.workspace(loaded)


def test_the_second_robot_in_the_readme_runs() -> None:
    """Its code, with its imports, as it stands there."""
    readme = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```py\n(.*?)```", readme, flags=re.DOTALL) if "PccArm" in block)
    names: dict[str, object] = {"sr": sr, "print": lambda *_: None}
    exec(compile(code, "README.md", "exec"), names)
    assert names["held"].stable
    assert np.allclose(names["held"].muscle_lengths, (0.50, 0.53, 0.55, 0.54, 0.51, 0.52), atol=1e-12)
