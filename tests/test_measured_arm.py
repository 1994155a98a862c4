"""Recordings of a real tendon-driven arm: how they are read, what is made of them, and that the page shows the recorded run."""

from __future__ import annotations

import csv
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import softrobots as sr
from studies.measured_arm.errors import best_pose, offset_errors, repeatability, rms
from studies.measured_arm.nominal import Nominal, predict
from studies.measured_arm.plain_kinematics import constant_curvature_tips
from studies.measured_arm.recordings import FOLDER, Recording, family_of, read_recording, servos_by_tendon
from studies.measured_arm.tables import table
from tests.conftest import CHECKOUT
from tests.support.scripts import run_script
from tests.support.tables import each_row

TURNS = (-3.0589, -2.5615, -2.0506)
"""Azimuth of the first tendon of each segment in the source's configuration [rad]."""
LENGTHS = (0.060, 0.0625, 0.064)
DISTANCE = 0.0045


def made_up(pulls: np.ndarray, tips: np.ndarray, blocks: list[str]) -> Recording:
    return Recording("made up", np.arange(float(len(pulls))), tuple(blocks), pulls, tips)


# --- Reading


def test_the_recordings_are_those_of_the_source_in_metres_by_tendon() -> None:
    """Counts of the source; the first row as its text has it: servos 4, 3, 9, 5, 2, 8, 6, 1, 7 pull the tendons 0 to 8."""
    assert servos_by_tendon() == (4, 3, 9, 5, 2, 8, 6, 1, 7)
    train, val, pull = (read_recording(name) for name in ("train", "val", "tendon_pull"))
    assert [len(one.tips) for one in (train, val, pull)] == [1620, 443, 134]
    assert np.array_equal(train.pulls[:134], pull.pulls)
    assert train.patterns[0] == "rep1_tendon0_id4_pull"
    assert np.allclose(1e3 * train.tips[0], (-2.085078, 8.168024, 187.961009), atol=1e-12)
    assert np.allclose(1e3 * train.pulls[2, :3], (0.214757, -6.181943, -6.197283), atol=1e-12)
    assert train.times[0] == 0.0
    assert train.times[1] == pytest.approx(0.644597, abs=1e-6)
    assert set(train.families) | set(val.families) == {
        "one tendon", "one segment", "one segment, circle", "two segments, same way", "two segments, opposite",
        "three segments, same way", "three segments, S", "three segments, spiral",
    }  # fmt: skip
    assert set(train.families).isdisjoint(val.families)  # validation is of other movements
    assert [len(train.thinned(40).tips), train.thinned(40).patterns[1]] == [41, train.patterns[40]]


def test_every_tendon_pulls_the_tip_to_where_it_runs() -> None:
    """In single pulls the tip goes towards the azimuth of the tendon, within 25 degrees, further the lower its segment is."""
    pull, reach = read_recording("tendon_pull"), []
    for tendon in range(9):
        rows = [row for row, label in enumerate(pull.patterns) if label.startswith(f"rep1_tendon{tendon}_")]
        taut = [row for row in rows if pull.pulls[row, tendon] > 0.0]
        least, most = min(taut, key=lambda row: pull.pulls[row, tendon]), max(taut, key=lambda row: pull.pulls[row, tendon])
        assert np.argmax(pull.pulls[most]) == tendon
        moved = (pull.tips[most] - pull.tips[least])[:2]
        azimuth = TURNS[tendon // 3] + math.radians(120.0 * (tendon % 3))
        assert abs((math.atan2(moved[1], moved[0]) - azimuth + math.pi) % (2 * math.pi) - math.pi) < math.radians(25.0)
        reach.append(np.linalg.norm(moved) / (pull.pulls[most, tendon] - pull.pulls[least, tendon]))
    means = np.array(reach).reshape(3, 3).mean(axis=1)
    assert means[0] > means[1] > means[2]


HEAD = "timestamp,pattern_label," + ",".join(f"servo_{k}_mm" for k in (4, 3, 9, 5, 2, 8, 6, 1, 7)) + ",tip_x,tip_y,tip_z"
ROW = "1.0,rep1_seg1_dir0,0,0,0,0,0,0,0,0,0,1,2,3"


@each_row(
    ("text", "told"),
    [
        ("", "the columns must be timestamp, pattern_label, 9 servo_<id>_mm, tip_x, tip_y, tip_z; they are none"),
        (HEAD, "has no rows"),
        (f"{HEAD.replace('servo_4_mm', 'motor_4')}\n{ROW}", "the columns must be"),
        (f"{HEAD.replace('servo_4_mm,', '')}\n{ROW}", "the columns must be"),
        (f"{HEAD.replace('servo_4_mm', 'servo_3_mm')}\n{ROW}", "the columns must be"),
        (f"{HEAD.replace('servo_4_mm', 'servo_12_mm')}\n{ROW}", "has no columns servo_4_mm"),
        (f"{HEAD}\n{ROW[:-2]}", r"csv:2: 13 cells; 14 are required"),
        (f"{HEAD}\n{ROW}\n{ROW.replace('1.0', 'soon')}", r"csv:3: could not convert"),
        (f"{HEAD}\n{ROW[:-1]}nan", r"csv:2: a number is not finite"),
        (f"{HEAD}\n{ROW}\n{ROW}", "times must ascend; row 2 does not"),
    ],
)
def test_other_files_are_refused(text: str, told: str, tmp_path: Path) -> None:
    shutil.copy(FOLDER / "tendon_pull.csv", tmp_path)
    (tmp_path / "train.csv").write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=told):
        read_recording("train", tmp_path)


@each_row(
    ("old", "new", "told"),
    [
        ("rep1_tendon3_id5_pull", "rep1_seg1_dir0", "is not of the form"),
        ("rep1_tendon3_id5_pull", "rep1_tendon3_id7_pull", "one of its own is required for each of 0 to 8"),
        ("rep1_tendon3_id5_pull", "rep1_tendon2_id5_pull", "tendon 2 has the servos 9 and 5"),
        ("rep1_tendon8_id7_pull", "rep1_tendon9_id7_pull", "one of its own is required"),
    ],
)
def test_labels_that_do_not_map_the_motors_are_refused(old: str, new: str, told: str, tmp_path: Path) -> None:
    text = (FOLDER / "tendon_pull.csv").read_text(encoding="utf-8")
    (tmp_path / "tendon_pull.csv").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=told):
        servos_by_tendon(tmp_path)
    with pytest.raises(sr.FileFormatError, match="cannot read"):
        read_recording("train", tmp_path / "nowhere")


def test_a_movement_of_no_known_family_is_refused() -> None:
    with pytest.raises(sr.FileFormatError, match="'rep1_dance' is of no known family: one tendon"):
        family_of("rep1_dance")


# --- Errors


def test_the_pose_of_the_base_is_found_and_never_a_mirror(rng: np.random.Generator) -> None:
    points = rng.normal(size=(30, 3)) * (1.0, 1.0, 0.01)  # nearly flat: a mirror would fit as well
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    shift = np.array([0.3, -0.2, 0.1])
    pose = best_pose(points, points @ turn.T + shift)
    assert np.allclose(pose.rotation, turn, atol=1e-12)
    assert np.allclose(pose.translation, shift, atol=1e-12)
    assert np.allclose(pose.moved(points), points @ turn.T + shift, atol=1e-12)
    mirrored = best_pose(points, points * (1.0, 1.0, -1.0))
    assert np.linalg.det(mirrored.rotation) == pytest.approx(1.0, abs=1e-12)


def test_the_metric_of_the_source_knows_no_offset(rng: np.random.Generator) -> None:
    measured, predicted = rng.normal(size=(2, 50, 3))
    apart = predicted - measured
    assert rms(offset_errors(predicted + (1.0, 2.0, 3.0), measured)) == pytest.approx(
        math.sqrt(apart.var(axis=0).sum()), rel=1e-12
    )


def test_the_floor_is_the_scatter_of_a_robot_that_repeats_its_commands(rng: np.random.Generator) -> None:
    """Every command in ten movements, with a scatter of 2 mm an axis: 2 sqrt(3) mm, within 3 standard errors."""
    commands = rng.uniform(0.0, 1e-2, (40, 9))
    tips = rng.normal(scale=2e-3, size=(400, 3)) + np.tile(commands[:, :3], (10, 1))
    blocks = [f"rep1_seg1_dir{block}" for block in range(10) for _ in range(40)]
    found = repeatability([made_up(np.tile(commands, (10, 1)), tips, blocks)], 1e-4)
    assert (len(found.distances), found.pairs) == (400, 40 * 45)
    assert rms(found.distances) == pytest.approx(2e-3 * math.sqrt(3.0), rel=3.0 / math.sqrt(2 * 3 * 360))
    same = repeatability([made_up(np.tile(commands, (10, 1)), tips, blocks)], 1e-4, same_history=True)
    assert (len(same.distances), same.pairs) == (390, 39 * 45)  # the first of a movement has no history
    alone = made_up(np.tile(commands, (10, 1)), tips, ["rep1_seg1_dir0"] * 400)
    assert repeatability([alone], 1e-4).pairs == 0  # within one movement nothing is repeated
    assert repeatability([made_up(0.0 * np.tile(commands, (10, 1)), tips, blocks)], 1e-4, moved=1e-3).pairs == 0


def bent_segments(bending: np.ndarray, azimuth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commands of tendons of exact lengths, (9,) [m], and the tip, (3,) [m], by many small turns."""
    around = np.array(TURNS)[:, None] + np.radians([0.0, 120.0, 240.0])
    pulls = [
        DISTANCE * sum(bending[lower] * math.cos(azimuth[lower] - around[segment, k]) for lower in range(segment + 1))
        for segment in range(3)
        for k in range(3)
    ]
    frame, place, steps = np.eye(3), np.zeros(3), 4000
    for length, angle, way in zip(LENGTHS, bending, azimuth, strict=True):
        axis = np.array([-math.sin(way), math.cos(way), 0.0])
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        half, whole = (
            np.eye(3) + math.sin(a) * cross + (1 - math.cos(a)) * cross @ cross for a in (angle / steps / 2, angle / steps)
        )
        for _ in range(steps):
            place = place + frame @ half[:, 2] * length / steps
            frame = frame @ whole
    return np.array(pulls), place


def test_constant_curvature_without_forces_is_three_arcs(rng: np.random.Generator) -> None:
    """Midpoints of 4000 steps err by (1.2/4000)^2/24 of a length, 1e-9 m; the common part of commands has no effect."""
    bending, azimuth = rng.uniform(0.1, 1.2, 3), rng.uniform(-3.0, 3.0, 3)
    pulls, tip = bent_segments(bending, azimuth)
    around = np.array(TURNS)[:, None] + np.radians([0.0, 120.0, 240.0])
    together = np.repeat((1e-3, -2e-3, 5e-4), 3)
    found = constant_curvature_tips(np.array([pulls, pulls + together, 0.0 * pulls]), np.array(LENGTHS), DISTANCE, around)
    assert np.allclose(found[:2], tip, atol=1e-9)
    assert np.allclose(found[2], (0.0, 0.0, sum(LENGTHS)), atol=1e-15)


def test_the_files_stand_beside_their_source_and_licence() -> None:
    files = {"LICENSE", "README.md", "columns.yaml", "robot.yaml", "tendon_pull.csv", "train.csv", "val.csv"}
    assert {path.name for path in FOLDER.iterdir()} == files
    assert "Copyright (c) 2026 Continuum Robotics Lab" in (FOLDER / "LICENSE").read_text(encoding="utf-8")
    assert "github.com/ContinuumRoboticsLab/opencr-mujoco" in (FOLDER / "README.md").read_text(encoding="utf-8")
    with (FOLDER / "val.csv").open(encoding="utf-8", newline="") as stream:
        assert next(csv.reader(stream)) == HEAD.split(",")


# --- Predictions


def arcs_with_elastic_tendons(pulls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tips, (n, 3) [m], and tensions, (n, 9) [N], by the least energy of three arcs, which a robot without weight bends to.

    Straight tendons exert a constant moment along a segment, so that bending (towards x and y) and elongation `e` are constant
    there. The energy `1/2 z K z + sum max(0, T)^2 / 2 k` is convex and quadratic where the same tendons are taut: Newton's
    method with the tendons that are taut ends in finitely many steps.
    """
    bending, axial = 50e9 * math.pi * 0.0005**4 / 4.0, 50e9 * math.pi * 0.0005**2
    around = np.array(TURNS)[:, None] + np.radians([0.0, 120.0, 240.0])
    slopes, stiffness = np.zeros((9, 9)), np.zeros(9)
    for segment in range(3):
        stiffness[3 * segment : 3 * segment + 3] = np.array([bending, bending, axial]) / LENGTHS[segment]
        for k in range(3):
            angle = around[segment, k]
            row = (-DISTANCE * math.cos(angle), -DISTANCE * math.sin(angle), 1.0)
            slopes[3 * segment + k, : 3 * segment + 3] = np.tile(row, segment + 1)
    tips, tensions = [], []
    for pulled in pulls:

        def energy(z: np.ndarray, pulled: np.ndarray = pulled) -> float:
            return 0.5 * stiffness @ z**2 + np.sum(np.maximum(0.0, 1.0 + 7e3 * (slopes @ z + pulled)) ** 2) / 14e3

        z = np.zeros(9)
        for _ in range(100):
            tension = 1.0 + 7e3 * (slopes @ z + pulled)
            taut = slopes[tension > 0.0]
            slope = stiffness * z + taut.T @ tension[tension > 0.0]
            if np.abs(slope).max() < 1e-11:
                break
            step = -np.linalg.solve(np.diag(stiffness) + 7e3 * taut.T @ taut, slope)
            while energy(z + step) > energy(z) + 1e-4 * float(slope @ step) and np.abs(step).max() > 1e-9:
                step = 0.5 * step
            z = z + step
        place, frame = np.zeros(3), np.eye(3)
        for (x, y, elongation), length in zip(z.reshape(3, 3), LENGTHS, strict=True):
            angle, whole = math.hypot(x, y), length + elongation
            half = np.array([x, y]) / angle * math.sin(angle / 2.0) if angle > 0.0 else np.zeros(2)
            chord = whole * math.sin(angle / 2.0) / (angle / 2.0) if angle > 0.0 else whole
            place = place + frame @ np.array([*(chord * half), chord * math.cos(angle / 2.0)])
            cross = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
            frame = frame @ expm(cross)
        tips.append(place)
        tensions.append(np.maximum(0.0, tension))
    return np.array(tips), np.array(tensions)


@pytest.mark.parametrize(("name", "every"), [("train", 160), ("val", 110)])
def test_predictions_are_equilibria_of_three_arcs_with_elastic_tendons(name: str, every: int) -> None:
    """Without weight four sections a segment are one arc; equilibria are settled to 1e-10 of the moments, over 0.04 N m/rad."""
    recording = read_recording(name).thinned(every)
    found, (tips, tensions) = predict(recording, Nominal()), arcs_with_elastic_tendons(recording.pulls)
    assert found.stable.all()
    assert np.allclose(found.tips, tips, atol=1e-7)
    assert np.allclose(np.maximum(0.0, found.tensions), tensions, atol=1e-4)
    assert found.counts()["slack_tendons"] == np.sum(tensions == 0.0) > 0


def recorded() -> dict:
    return json.loads((CHECKOUT / "docs" / "validation" / "measured_arm.json").read_text(encoding="utf-8"))


def test_the_page_shows_the_record() -> None:
    page = (CHECKOUT / "docs" / "measured_arm.md").read_text(encoding="utf-8")
    assert f"\n\n{table(recorded())}\n\n<!-- measured_arm:end -->\n" in page


@pytest.mark.study
def test_the_record_is_what_least_energy_says() -> None:
    """All 2063 rows anew by least energy, in both metrics."""
    record = recorded()
    sets = {name: read_recording(name) for name in ("train", "val")}
    tips = {name: arcs_with_elastic_tendons(one.pulls)[0] for name, one in sets.items()}
    pose = best_pose(tips["train"], sets["train"].tips)
    ours, _, published, floor = record["models"]
    for name, one in sets.items():
        apart = tips[name] - one.tips
        assert ours[name]["offset_m"] == pytest.approx(math.sqrt(apart.var(axis=0).sum()), abs=1e-7)
        assert ours[name]["raw_m"] == pytest.approx(rms(np.linalg.norm(apart, axis=1)), abs=1e-7)
        assert ours[name]["posed_m"] == pytest.approx(rms(np.linalg.norm(pose.moved(tips[name]) - one.tips, axis=1)), abs=1e-7)
        assert record["sets"][name]["stable"] == record["sets"][name]["rows"] == len(one.tips)
        assert floor[name]["offset_m"] == pytest.approx(rms(repeatability([one], 2e-4).distances), rel=1e-12)
        assert floor[name]["offset_m"] < ours[name]["posed_m"] < published[name]["offset_m"]


# --- The script


def test_the_script_writes_tables_rows_and_refuses_to_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    arguments = ["--every", "150", "--no-others", "--no-plots", "--output", str(folder)]
    assert run_script("measured_arm", arguments) == 0
    out, err = capsys.readouterr()
    assert "| elastic tendons, nominal | nothing here; turns by the source | " in out
    assert "/11 [" in err  # a progress bar
    assert {path.name for path in folder.iterdir()} == {"measured_arm.json", "measured_arm.md", "measured_arm.csv"}
    record = json.loads((folder / "measured_arm.json").read_text(encoding="utf-8"))
    rows = list(csv.DictReader((folder / "measured_arm.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 11 + 3 == sum(one["rows"] for one in record["sets"].values())
    errors = np.array([float(row["error_m"]) for row in rows if row["set"] == "train"])
    assert rms(errors) == pytest.approx(record["models"][0]["train"]["posed_m"], rel=1e-12)
    assert run_script("measured_arm", arguments) == 2
    assert "not empty" in capsys.readouterr().err


@each_row(
    ("arguments", "told"),
    [
        (["--stiffness", "0"], "--stiffness"),
        (["--stiffness", "nan"], "--stiffness"),
        (["--mass", "-1"], "--mass"),
        (["--pretension", "-1"], "--pretension"),
        (["--every", "0"], "--every"),
        (["--data", "nowhere"], "cannot read nowhere"),
        (["--docs", "--every", "2"], "given without --every"),
        (["--docs", "--no-others"], "given without --no-others"),
    ],
)
def test_bad_input_is_refused_before_work(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert run_script("measured_arm", [*arguments, "--output", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    assert told in err
    assert (out, list(tmp_path.iterdir())) == ("", [])


@pytest.mark.study
def test_pictures_and_the_page_are_written(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert run_script("measured_arm", ["--every", "60", "--no-others", "--json", "--output", str(tmp_path / "out")]) == 0
    assert json.loads(capsys.readouterr().out)["sets"]["train"]["rows"] == 27
    for name in ("axes", "errors", "tips", "paths", "families"):
        assert (tmp_path / "out" / f"measured_{name}.png").stat().st_size > 10_000
        assert (CHECKOUT / "docs" / "images" / f"measured_{name}.png").stat().st_size > 10_000
