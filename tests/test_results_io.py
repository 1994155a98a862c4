"""Saved results come back equal, old files survive, foreign and altered files are refused."""

from __future__ import annotations

import csv
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.core.files import write_atomically
from tests.support.saved_files import altered, same

FORCE = (0.0, 10.0, -15.0)


@pytest.fixture(scope="module")
def results(arm: sr.SoftModel) -> dict[str, object]:
    motors = (0.3, 0.6, -0.8)
    state = sr.solve_equilibrium(arm, motors, FORCE, wrench={"link_1": (1, 0, 0, 0, 0, 0.5)}, gravity=sr.EARTH_GRAVITY)
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 8)
    return {
        "equilibrium": state,
        "ik_solution": sr.solve_ik(arm, (0.7, 0.2, 0.4), FORCE),
        "load_estimate": sr.estimate_load(arm, motors, sr.solve_equilibrium(arm, motors, FORCE).motor_torques, torque_std=0.1),
        "trajectory": sr.follow_trajectory(arm, path.positions, FORCE, times=path.times),
        "branches": sr.post_buckling_branches(arm, (0, 0, 0), (-1, 0, 0), largest_step=0.2),
    }


def test_json_that_is_no_table_of_arrays_is_refused(results: dict, tmp_path: Path) -> None:
    """Of the right kind, the words say what is wrong; a number that JSON does not have is refused before it is written."""
    good = json.loads(sr.save_result(results["equilibrium"], tmp_path / "a.json").read_text(encoding="utf-8"))
    row = good["residual"]
    for change, words in (
        ([1, 2], "is no array, which has type"),
        ({"type": "object", "shape": [], "values": [1]}, "is no array, which has type"),
        (row | {"values": ["1"]}, "entries that are no number"),
        (row | {"values": [True]}, "entries that are no number"),
        (row | {"shape": [-1]}, "which is not its shape"),
        (row | {"shape": [2]}, "which is not its shape"),
    ):
        file = tmp_path / "b.json"
        file.write_text(json.dumps(good | {"residual": change}), encoding="utf-8")
        with pytest.raises(sr.FileFormatError, match=words):
            sr.load_result(file)
    file.write_text("[]", encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match="no object of arrays"):
        sr.load_result(file)
    with pytest.raises(sr.ParameterError, match="finite to be JSON"):
        sr.save_result(replace(results["equilibrium"], residual=float("inf")), tmp_path / "c.json")


def test_springs_said_by_the_caller_come_back(tmp_path: Path) -> None:
    from tests.support.foreign import BRANCHED, SPRINGS

    model = sr.load_model(BRANCHED, springs=SPRINGS, motors=["elbow"], tip="finger")
    state = sr.solve_equilibrium(model, (0.3,), (0, 0, -2))
    same(state, sr.load_result(sr.save_result(state, tmp_path / "a.npz")))


def test_springs_taken_away_by_the_caller_stay_away(tmp_path: Path) -> None:
    """The text that is saved still has them; also in files of before, which hold the springs that there are, too."""
    model = sr.load_model(
        sr.InflatableArm(), springs={"spring_1_side": None, "spring_2_up": 90.0}, motors=["motor_1", "motor_2"]
    )
    state = sr.solve_equilibrium(model, (0.3, 0.2), (0, 1, -2))
    again = sr.load_result(sr.save_result(state, tmp_path / "a.npz"))
    same(state, again)
    assert again.model == model
    assert again.model.joint_roles == model.joint_roles
    assert again.model.joint_roles["spring_1_side"] == again.model.joint_roles["motor_3"] == "locked"


def test_branches_that_are_not_what_they_claim_are_refused(results: dict, tmp_path: Path) -> None:
    fields = dict(np.load(sr.save_result(results["branches"], tmp_path / "a.npz")))
    assert len(fields["labels"]) > 1
    for number, (name, change, words) in enumerate(
        [
            ("pushes", 1.01, "claims a residual"),
            ("forces", 1.01, "forces are not those of its loads"),
            ("q_springs", 1.001, "claims a residual"),
            ("points", 2, "one row for each branch"),
            ("crossings", np.nan, "crossings"),
        ]
    ):
        path = tmp_path / f"b{number}.npz"
        np.savez(path, **(fields | {name: fields[name] * change}))
        with pytest.raises(sr.FileFormatError, match=words):
            sr.load_result(path)
    for wrong in ((), (1, 2), list(results["branches"])):
        with pytest.raises(sr.ParameterError, match="tuple of EquilibriumBranch"):
            sr.save_result(wrong, tmp_path / "c.npz")


def test_nothing_is_overwritten_silently(results: dict, tmp_path: Path) -> None:
    file = sr.save_result(results["equilibrium"], tmp_path / "a.npz")
    before = file.read_bytes()
    with pytest.raises(sr.OutputExists, match=r"a\.npz exists"):
        sr.save_result(results["trajectory"], file)
    assert file.read_bytes() == before
    sr.save_result(results["trajectory"], file, overwrite=True)
    assert isinstance(sr.load_result(file), sr.Trajectory)
    with pytest.raises(sr.OutputExists, match="is a folder"):
        sr.save_result(results["trajectory"], tmp_path)
    table = sr.save_csv(results["trajectory"], tmp_path / "a.csv")
    with pytest.raises(sr.OutputExists, match=r"a\.csv exists"):
        sr.save_csv(results["trajectory"], table)


def test_a_table_is_not_saved_as_an_archive_of_its_name(results: dict, tmp_path: Path) -> None:
    with pytest.raises(sr.ParameterError, match="save_csv writes tables"):
        sr.save_result(results["equilibrium"], tmp_path / "held.CSV")
    assert not list(tmp_path.iterdir())


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_bytes(b"old")

    def interrupted(handle) -> None:
        handle.write(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(file, interrupted)
    assert file.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_csv_holds_the_trajectory_in_full_precision(results: dict, tmp_path: Path) -> None:
    trajectory = results["trajectory"]
    file = sr.save_csv(trajectory, tmp_path / "new" / "a.csv")
    with file.open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == 9
    assert [float(row["motor_2"]) for row in rows] == trajectory.q_motors[:, 1].tolist()
    assert [float(row["moment_1"]) for row in rows] == trajectory.link_moments[:, 0].tolist()
    assert np.array_equal(sr.read_waypoints(file).positions, trajectory.targets)  # readable as waypoints


def test_joints_called_like_columns_do_not_hide_the_targets(tmp_path: Path) -> None:
    from tests.support.foreign import BRANCHED

    model = sr.load_model(BRANCHED.replace('"elbow"', '"x"'), springs={"wrist": 20.0}, motors=["shoulder", "x"], tip="finger")
    target = sr.solve_equilibrium(model, (0.3, 0.4)).tip_position
    found = sr.follow_trajectory(model, [target, target], tolerance=1e-6)
    file = sr.save_csv(found, tmp_path / "a.csv")
    assert np.array_equal(sr.read_waypoints(file).positions, found.targets)
    assert "joint_x" in file.read_text(encoding="utf-8").splitlines()[0]


def test_files_that_do_not_hold_what_they_claim_are_refused(results: dict, tmp_path: Path) -> None:
    file = sr.save_result(results["equilibrium"], tmp_path / "a.npz")
    with np.load(file) as data:
        springs = data["q_springs"]
    bad = tmp_path / "bad.npz"
    for changes, message in (
        ({"q_springs": springs + 1e-3}, "claims a residual"),
        ({"q_springs": springs * np.nan}, "finite"),
        ({"q_springs": springs[:, :2]}, "q_springs"),
        ({"kind": np.array("banana")}, "holds 'banana'"),
        ({"format": np.array(99)}, "format 99"),
        ({"urdf": np.array("<robot/>")}, "cannot read a result"),
        ({"model": np.array("{")}, "cannot read a result"),
        ({"load": np.array('{"wrenches": {"nowhere": [0,0,0,0,0,0]}, "gravity": null}')}, "nowhere"),
        ({"q_motors": np.array([{"a": 1}], dtype=object)}, "cannot read a result"),  # pickle inside
    ):
        with pytest.raises(sr.FileFormatError, match=message):
            sr.load_result(altered(file, bad, **changes))


@pytest.mark.study
@pytest.mark.parametrize("kind", ["equilibrium", "load_estimate", "trajectory"])
def test_damaged_files_are_refused_or_harmless(results: dict, kind: str, tmp_path: Path) -> None:
    """Bytes flipped at random: an error of ours, or the right answer (the byte was padding)."""
    good = sr.save_result(results[kind], tmp_path / "a.npz").read_bytes()
    bad, rng = tmp_path / "bad.npz", np.random.default_rng(0)
    refused = 0
    for _ in range(150):
        damaged = bytearray(good)
        for place in rng.integers(0, len(good), rng.integers(1, 4)):
            damaged[place] ^= int(rng.integers(1, 256))
        bad.write_bytes(bytes(damaged))
        try:
            same(results[kind], sr.load_result(bad))
        except sr.FileFormatError:
            refused += 1
    assert refused > 100
    bad.write_bytes(good[: len(good) // 2])
    with pytest.raises(sr.FileFormatError, match="it is not an NPZ archive") as caught:
        sr.load_result(bad)
    assert "pickle" not in str(caught.value)  # NumPy's advice for such a file


@pytest.mark.study
def test_an_estimate_comes_back_with_its_errors_and_its_alternatives(tmp_path: Path) -> None:
    """The second force, too; one that is none is refused. A file from before without both loads."""
    limp, motors = sr.load_model(sr.InflatableArm(max_moment=12.0)), (0.3, 0.9, -1.4)
    torques = sr.solve_equilibrium(limp, motors, (2, 8, -12), gravity=sr.EARTH_GRAVITY).motor_torques
    errors = {"torque_std": 0.1, "stiffness_std": 0.03, "motor_angle_std": (0.01, 0.02, 0.01)}
    found = sr.estimate_load(limp, motors, torques, gravity=sr.EARTH_GRAVITY, **errors)
    assert len(found.alternatives) >= 1
    file = sr.save_result(found, tmp_path / "a.npz")
    again = sr.load_result(file)
    assert np.array_equal(again.covariance, found.covariance)
    assert [one.force.tolist() for one in again.alternatives] == [one.force.tolist() for one in found.alternatives]
    assert np.array_equal(again.alternatives[0].equilibrium.q_springs, found.alternatives[0].equilibrium.q_springs)
    others = np.array([one.force for one in found.alternatives])
    for changes, message in (
        ({"other_forces": others + 1.0}, "other_forces"),
        ({"other_forces": others[:, :2]}, "other_forces"),
        ({"other_springs": np.zeros((7, 4))}, "other_springs"),
        ({"stiffness_std": np.zeros(4)}, "stiffness_std must be positive"),
    ):
        with pytest.raises(sr.FileFormatError, match=message):
            sr.load_result(altered(file, tmp_path / "b.npz", **changes))
    fields = dict(np.load(file))
    for name in ("other_forces", "other_springs", "stiffness_std", "motor_angle_std"):
        del fields[name]
    np.savez(tmp_path / "old.npz", **fields)
    old = sr.load_result(tmp_path / "old.npz")
    assert (old.alternatives, old.stiffness_std, set(old.covariance_parts)) == ((), None, {"torques"})
    assert np.array_equal(old.covariance, found.covariance_parts["torques"])


def test_an_estimate_whose_force_was_changed_is_refused(results: dict, tmp_path: Path) -> None:
    file = sr.save_result(results["load_estimate"], tmp_path / "a.npz")
    with pytest.raises(sr.FileFormatError, match="force"):
        sr.load_result(altered(file, tmp_path / "b.npz", force=np.array([1.0, 2.0, 3.0])))


def test_rows_and_times_must_fit(results: dict, tmp_path: Path) -> None:
    file = sr.save_result(results["trajectory"], tmp_path / "a.npz")
    with np.load(file) as data:
        fields = dict(data)
    for changes, message in (
        ({name: fields[name][:0] for name in fields if fields[name].shape[:1] == (9,)}, "at least one configuration"),
        ({"solver": fields["solver"][:2]}, "one row for each"),
        ({"times": fields["times"][::-1]}, "increasing"),
    ):
        with pytest.raises(sr.FileFormatError, match=message):
            sr.load_result(altered(file, tmp_path / "b.npz", **changes))


def test_places_that_cannot_be_written_are_an_error_of_ours(results: dict, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x", encoding="utf-8")
    for path in (tmp_path / "file" / "a.npz", "/proc/nowhere/a.npz"):
        with pytest.raises(sr.OutputError, match="cannot write"):
            sr.save_result(results["equilibrium"], path)
    for function in (lambda p: sr.save_result(results["equilibrium"], p), sr.load_result, sr.read_waypoints):
        with pytest.raises(sr.ParameterError, match="a path"):
            function(None)


def test_a_full_disk_is_an_error_that_loses_nothing(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_bytes(b"old")

    def full(handle) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(sr.OutputError, match="No space left"):
        write_atomically(file, full)
    assert file.read_bytes() == b"old"
    assert len(list(tmp_path.iterdir())) == 1


def test_files_that_are_not_ours_are_refused(tmp_path: Path) -> None:
    for name, content in (("a.npz", b""), ("b.npz", b"not a zip"), ("c.npz", b"PK\x03\x04" + bytes(100))):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(sr.FileFormatError):
            sr.load_result(tmp_path / name)
    with zipfile.ZipFile(tmp_path / "d.npz", "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(sr.FileFormatError):
        sr.load_result(tmp_path / "d.npz")
    np.save(tmp_path / "e.npy", np.zeros(3))
    with pytest.raises(sr.FileFormatError):
        sr.load_result(tmp_path / "e.npy")
    with pytest.raises(sr.FileFormatError, match="cannot read"):
        sr.load_result(tmp_path / "missing.npz")


def test_other_objects_are_refused(arm: sr.SoftModel, results: dict, tmp_path: Path) -> None:
    with pytest.raises(
        sr.ParameterError,
        match="ImposedDisplacement, LoadEstimate, Trajectory, Workspace, WorkspaceMap, tuple of EquilibriumBranch",
    ):
        sr.save_result(arm, tmp_path / "a.npz")
    with pytest.raises(sr.ParameterError, match="Trajectory, Workspace, WorkspaceMap, tuple of EquilibriumBranch"):
        sr.save_csv(arm, tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []
