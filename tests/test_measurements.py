"""Measured rows: what is accepted and refused, units, tables and files that come back to the last bit, and selections."""

from __future__ import annotations

import copy
import json
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.core.units import UNITS
from softrobots.identification.measured_robot import frame_of, wrenches_on
from softrobots.identification.measurement_columns import read_columns
from tests.conftest import CHECKOUT
from tests.support.laws import law
from tests.support.tables import each_row

RECORDINGS = CHECKOUT / "docs" / "examples" / "tdcr_v4"
COLUMNS: dict[str, Any] = {
    "actuators": {"columns": ["q1", "q2", "q3"], "unit": "deg"},
    "mass": {"columns": "hung", "unit": "g"},
    "gravity": [0, 0, -9.81],
    "positions": {"tip": {"columns": ["x", "y", "z"], "unit": "mm", "std": 1.5}},
    "labels": "set",
}
FILE = "q1,q2,q3,hung,x,y,z,set\n# a comment\n90,0,-45,500,1,2,3,a\n\n0,0,0,0,,5,6,b\n"

IN_SI = {
    "m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "rad": 1.0, "mrad": 0.001, "deg": 0.017453292519943295,
    "turn": 6.283185307179586, "N": 1.0, "mN": 0.001, "kN": 1000.0, "kgf": 9.80665, "lbf": 4.4482216152605, "N m": 1.0,
    "N cm": 0.01, "N mm": 0.001, "mN m": 0.001, "kg": 1.0, "g": 0.001, "lb": 0.45359237, "Pa": 1.0, "kPa": 1e3, "MPa": 1e6,
    "bar": 1e5, "mbar": 100.0, "psi": 6894.757293168361, "m/s^2": 1.0, "mm/s^2": 0.001, "Hz": 1.0,
    "rad/s": 0.15915494309189535, "s": 1.0, "ms": 0.001, "us": 1e-6, "min": 60.0, "1": 1.0, "%": 0.01,
}  # fmt: skip
"""One of each unit in SI units, as the Bureau International des Poids et Mesures and NIST SP 811 print them."""


def written(folder: Path, text: str = FILE) -> Path:
    file = folder / "data.csv"
    file.write_text(text, encoding="utf-8")
    return file


def changed(path: str, value: Any) -> dict[str, Any]:
    """The mapping of columns with one entry changed, by its path."""
    mapping = copy.deepcopy(COLUMNS)
    *above, last = path.split(".")
    entry = mapping
    for key in above:
        entry = entry[key]
    entry[last] = value
    return mapping


def rows_of(measurements: sr.Measurements) -> dict[str, Any]:
    """Everything in it, by name."""
    arrays = {"q_motors": measurements.q_motors, "mask": measurements.mask, **measurements.loads, **measurements.measured}
    arrays |= {f"std {name}": values for name, values in measurements.std.items()}
    arrays |= {"labels": measurements.labels, "markers": dict(measurements.markers), "relative": measurements.relative}
    return arrays | {"actuators": measurements.actuators}


def assert_same(first: sr.Measurements, second: sr.Measurements) -> None:
    """To the last bit."""
    mine, others = rows_of(first), rows_of(second)
    assert mine.keys() == others.keys()
    for name, value in mine.items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, others[name], err_msg=name, strict=True)
        else:
            assert value == others[name], name


def test_units_are_those_of_a_closed_table() -> None:
    ours = {unit: factor for units in UNITS.values() for unit, factor in units.items()}
    assert sum(map(len, UNITS.values())) == len(ours)  # no unit means two things
    assert ours == pytest.approx(IN_SI, rel=1e-15)  # rounding of a quotient


def test_a_file_is_read_in_si_units_with_gaps_comments_and_lines(tmp_path: Path) -> None:
    found = sr.Measurements.from_csv(written(tmp_path), COLUMNS)
    np.testing.assert_allclose(found.q_motors, [[math.pi / 2, 0, -math.pi / 4], [0, 0, 0]], rtol=1e-15)
    np.testing.assert_allclose(found.measured["positions.tip"], [[1e-3, 2e-3, 3e-3], [np.nan, 5e-3, 6e-3]], rtol=1e-15)
    np.testing.assert_allclose(found.std["positions.tip"], [[1.5e-3] * 3, [1.0, 1.5e-3, 1.5e-3]], rtol=1e-15)
    np.testing.assert_array_equal(found.loads["mass"], [0.5, 0.0])
    np.testing.assert_array_equal(found.loads["gravity"], [[0, 0, -9.81]] * 2)
    assert found.labels == ("a", "b")
    assert found.lines is not None
    assert found.lines.tolist() == [3, 5]
    assert repr(found) == "Measurements(2 rows of 3 actuators: positions.tip)"
    (tmp_path / "columns.yaml").write_text(yaml.safe_dump(COLUMNS), encoding="utf-8")
    assert_same(found, sr.Measurements.from_csv(tmp_path / "data.csv", tmp_path / "columns.yaml"))


def test_turns_of_poses_are_those_of_their_formulas(tmp_path: Path) -> None:
    """Quaternion, fixed axes and rotation vector of a quarter turn about z; unit and form of each."""
    expected = np.array([[0.0, -1.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
    half = math.sqrt(0.5)
    forms = {"quaternion": [half, 0, 0, half], "roll_pitch_yaw": [0, 0, 90], "rotation_vector": [0, 0, 90]}
    forms["matrix"] = expected[:3, :3].ravel().tolist()
    for form, numbers in forms.items():
        table = {"q": [1.0], **{f"p{k}": [10.0 * (k + 1)] for k in range(3)}, **{f"r{k}": [v] for k, v in enumerate(numbers)}}
        pose = {"columns": ["p0", "p1", "p2"], "unit": "cm", form: [f"r{k}" for k in range(len(numbers))], "std": [0.1, 2.0]}
        pose |= {"angle_unit": "deg"}
        mapping = {"actuators": {"columns": "q", "unit": "m"}, "poses": {"wrist": pose}}
        found = sr.Measurements.from_dataframe(table, mapping)
        np.testing.assert_allclose(found.measured["poses.wrist"][0], expected, atol=1e-15)
        np.testing.assert_allclose(found.std["poses.wrist"][0], np.repeat([1e-3, math.radians(2.0)], 3), rtol=1e-15)
    roll, pitch, yaw = 0.3, -0.4, 0.5  # Rz(yaw) Ry(pitch) Rx(roll), written out
    table |= {"r0": [roll], "r1": [pitch], "r2": [yaw]}
    pose = {"columns": ["p0", "p1", "p2"], "unit": "m", "roll_pitch_yaw": ["r0", "r1", "r2"]}
    turn = sr.Measurements.from_dataframe(table, mapping | {"poses": {"wrist": pose}}).measured["poses.wrist"][0]
    assert turn[2, 0] == pytest.approx(-math.sin(pitch), rel=1e-14)
    assert math.atan2(turn[1, 0], turn[0, 0]) == pytest.approx(yaw, rel=1e-14)
    assert math.atan2(turn[2, 1], turn[2, 2]) == pytest.approx(roll, rel=1e-14)


def test_scales_units_for_each_column_and_standard_deviations_from_columns() -> None:
    table = {"a": [90.0, 0.0], "b": [5.0, 1.0], "f": [1.0, 2.0], "s": [0.1, 0.2], "count": [1, 0]}
    mapping = {
        "actuators": {"columns": ["a", "b"], "unit": ["deg", "mm"], "scale": [-1, 2]},
        "motor_torques": {"columns": ["f", "b"], "unit": ["N mm", "kN"], "std": ["s", 0.5], "scale": [-1, 3]},
        "mask": "count",
    }
    found = sr.Measurements.from_dataframe(table, mapping)
    np.testing.assert_allclose(found.q_motors, [[-math.pi / 2, 0.01], [0.0, 0.002]], rtol=1e-15)
    np.testing.assert_allclose(found.measured["motor_torques"], [[-1e-3, 15e3], [-2e-3, 3e3]], rtol=1e-15)
    np.testing.assert_allclose(found.std["motor_torques"], [[1e-4, 1500.0], [2e-4, 1500.0]], rtol=1e-15)
    assert found.mask.tolist() == [True, False]


def test_a_pandas_table_is_taken_with_its_missing_cells(tool: Callable[[str], ModuleType]) -> None:
    pandas = tool("pandas")
    table = pandas.DataFrame({"q": [1, 2], "x": [1.0, None], "y": pandas.array([1, None], dtype="Int64"), "z": [0.0, 1.0]})
    mapping = {"actuators": {"columns": "q", "unit": "SI"}, "positions": {"a": {"columns": ["x", "y", "z"], "unit": "cm"}}}
    found = sr.Measurements.from_dataframe(table, mapping).measured["positions.a"]
    np.testing.assert_array_equal(found, [[0.01, 0.01, 0.0], [np.nan, np.nan, 0.01]])


@law("identification.measurement_columns.read_columns")
@settings(max_examples=20)
@given(data=st.data())
def test_a_file_of_columns_says_what_a_dictionary_says(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """In YAML and JSON; factors are those of the closed table, times the scale."""
    units = [data.draw(st.sampled_from(sorted(UNITS[kind]))) for kind in ("angle", "length", "force")]
    scale = data.draw(st.floats(0.1, 10.0))
    names = data.draw(st.lists(st.text("abcxyz 19.#:", min_size=1), min_size=4, max_size=4, unique=True))
    mapping = {
        "actuators": {"columns": names[:2], "unit": units[:2], "scale": scale},
        "tensions": {"columns": names[2], "unit": units[2], "std": names[3]},
    }
    file = tmp_path_factory.mktemp("columns") / data.draw(st.sampled_from(["a.yaml", "a.json"]))
    file.write_text(json.dumps(mapping) if file.suffix == ".json" else yaml.safe_dump(mapping), encoding="utf-8")
    for layout in (read_columns(mapping), read_columns(file)):
        assert layout.numbers == tuple(names)
        assert layout.gaps == set(names[2:])
        found = layout.arguments(lambda _: np.ones(2), lambda _: [])
        np.testing.assert_allclose(found["q_motors"], [[IN_SI[unit] * scale for unit in units[:2]]] * 2, rtol=1e-15)
        np.testing.assert_allclose(found["std"]["tensions"], [[IN_SI[units[2]]]] * 2, rtol=1e-15)


# --- What is refused

BAD_COLUMNS: list[tuple[str, Any, str]] = [
    ("actuators.unit", "mils", "columns.actuators.unit = 'mils'.*of SI, rad, mrad, deg"),
    ("actuators.unit", None, "columns.actuators.unit"),
    ("actuators.unit", ["deg", "deg"], "one unit, or one for each column"),
    ("positions.tip.unit", "N", "of SI, m, cm, mm, um, in"),
    ("positions.tip.columns", ["x", "y"], "names of 3 columns"),
    ("positions.tip.columns", ["x", "x", "y"], "each once"),
    ("positions.tip.columns", ["x", "y", 3], "names of 3 columns"),
    ("positions.tip.std", [1.0, 2.0], "a number or column, one or 3"),
    ("positions.tip.stdd", 1.0, "no entry of columns.positions.tip is called 'stdd' .did you mean 'std'"),
    ("positions", [1], "columns.positions.*a mapping"),
    ("postions", {}, "did you mean 'positions'"),
    ("mass.scale", 0.0, "different from zero"),
    ("actuators", None, "entry 'actuators'"),
    ("positions.tip.std", True, "a number or column"),
    ("mass.relative", True, "no entry of columns.mass"),
    ("actuators.relative", "yes", "true or false"),
    ("gravity", [0, 0], "columns.gravity"),
    ("labels", {"columns": "set"}, "did you mean 'column'"),
    ("mask", 3, "columns.mask"),
    ("poses", {"tip": {"columns": ["x", "y", "z"], "unit": "m"}}, "one of matrix, quaternion, roll_pitch_yaw"),
]


@each_row(("path", "value", "message"), BAD_COLUMNS)
def test_mappings_that_are_refused(path: str, value: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises((sr.ParameterError, sr.NameNotFound), match=message):
        sr.Measurements.from_csv(written(tmp_path), changed(path, value))
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(changed(path, value)), encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=r"cannot read columns from .*map\.yaml"):
        sr.Measurements.from_csv(tmp_path / "data.csv", tmp_path / "map.yaml")


BAD_FILES = [
    (FILE.replace("90,0", "9O,0"), r"data\.csv, line 3: q1 = '9O'; a finite number"),
    (FILE.replace("90,0", ",0"), r"data\.csv, line 3: q1 = ''; a finite number"),
    (FILE.replace("0,0,0,0,,5,6", "0,0,0,0,inf,5,6"), r"data\.csv, line 5: x = 'inf'; a finite number"),
    (FILE.replace("0,0,0,0,,5", "0,0,0,0,5"), r"data\.csv, line 5: 7 cells; 8 are required"),
    (FILE.replace("500", "-500"), r"data\.csv: mass \(line 3\) = -0\.5: .*zero or positive"),
    (FILE.replace("6,b", "6,"), r"data\.csv: labels \(line 5\) = ''.*a word of 1 to 200"),
    (FILE.replace("hung", "hang"), r"data\.csv, line 1: it names q1, q2, q3, hang.*each once"),
    ("# nothing\n\n" + FILE.replace("x", "q1"), r"data\.csv, line 3: it names"),
    (FILE.replace(",", ";"), r"data\.csv, line 1: its cells are parted by semicolons; commas are required"),
    ("q1,q2,q3,hung,x,y,z,set\n", "has no rows of numbers"),
    ("", "it names nothing"),
    ("q1,q2,q3,hung,x,y,z,set\n1,2,3,4,,,,a\n", "at least one number of positions"),
]


@each_row(("text", "message"), BAD_FILES)
def test_files_that_are_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(sr.FileFormatError, match=message):
        sr.Measurements.from_csv(written(tmp_path, text), COLUMNS)


def test_files_that_tell_no_columns_are_refused(tmp_path: Path) -> None:
    for text in (FILE, "# columns: [1, 2\n" + FILE, "# columns: !!python/object:os.system {}\n" + FILE):
        with pytest.raises(sr.FileFormatError, match=r"data\.csv"):
            sr.Measurements.from_csv(written(tmp_path, text))


TIPS = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
POSES = np.tile(np.eye(4), (2, 1, 1))


def pose(row: int, column: int, value: float) -> Any:
    poses = POSES.copy()
    poses[1, row, column] = value
    return {"poses": {"tip": poses}}


BAD_ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({}, "at least one number of positions"),
    ({"q_motors": np.zeros((0, 3)), "tip_position": np.zeros((0, 3))}, "at least one row"),
    ({"q_motors": [[1.0, math.nan]], "tip_position": TIPS[:1]}, "q_motors"),
    ({"tip_position": TIPS[:1]}, r"positions\.tip = .*shape \(2, 3\)"),
    ({"tip_position": [[math.inf, 0, 0], [0, 0, 0]]}, "positions.tip"),
    ({"tip_position": TIPS, "positions": {"tip": TIPS}}, "left out where positions has a 'tip'"),
    ({"positions": {3: TIPS}}, "positions.* = 3"),
    ({"positions": TIPS}, "a mapping by name"),
    ({"tip_position": TIPS, "force": [[0, 0, math.nan]] * 2}, "force"),
    ({"tip_position": TIPS, "wrench": {"tip": np.zeros((2, 3))}}, r"wrench\.tip"),
    ({"tip_position": TIPS, "mass": [1.0, 2.0]}, "given together with gravity"),
    ({"tip_position": TIPS, "mass": [1.0, -2.0], "gravity": (0, 0, -9.81)}, r"mass \(row 1\) = -2.0"),
    ({"tip_position": TIPS, "gravity": (0, 0)}, "gravity"),
    ({"motor_torques": np.zeros((2, 3))}, r"motor_torques = .*shape \(2, 2\)"),
    ({"damping_ratios": [[0.0], [1.0]]}, r"damping_ratios \(row 1\) = \[1.0\].*below 1"),
    ({"frequencies": [[1.0], [0.0]]}, r"frequencies \(row 1\) = \[0.0\].*positive"),
    (pose(3, 3, 2.0), r"poses\.tip \(row 1\).*last row"),
    (pose(0, 0, -1.0), r"poses\.tip \(row 1\).*rotation matrix"),
    (pose(0, 0, math.nan), r"poses\.tip \(row 1\).*missing as a whole"),
    ({"tip_position": TIPS, "std": 0.0}, r"std.* \(row 0\).*positive"),
    ({"tip_position": TIPS, "std": [1.0, 2.0]}, r"one number, one for each component, or of shape \(2, 3\)"),
    ({"tip_position": TIPS, "std": {"tip": 1.0}}, "no measured quantity is called 'tip'.*positions.tip"),
    ({"tip_position": TIPS, "motor_torques": np.ones((2, 2)), "std": 1.0}, "given by name, as several"),
    ({"tip_position": TIPS, "labels": ["a"]}, "a list of 2 words"),
    ({"tip_position": TIPS, "labels": ["a", "b\n"]}, r"labels \(row 1\)"),
    ({"tip_position": TIPS, "labels": "ab"}, "a list of 2 words"),
    ({"tip_position": TIPS, "mask": [1, 0]}, "truth values"),
    ({"tip_position": TIPS, "markers": {"tip": 3}}, "markers"),
    ({"tip_position": TIPS, "relative": 1}, "relative"),
]


@each_row(("arguments", "message"), BAD_ARGUMENTS)
def test_arrays_that_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises((sr.ParameterError, sr.NameNotFound), match=message):
        sr.Measurements(**{"q_motors": np.zeros((2, 2)), **arguments})


def test_tables_that_are_refused() -> None:
    table = {"q1": [1.0], "q2": [2.0], "q3": [3.0], "x": [0.0], "y": [0.0], "z": [0.0], "set": ["a"], "hung": [1.0]}
    with pytest.raises(sr.ParameterError, match=r"q3.*a column of numbers"):
        sr.Measurements.from_dataframe(table | {"q3": ["three"]}, COLUMNS)
    with pytest.raises(sr.NameNotFound, match="no column is called 'hung'"):
        sr.Measurements.from_dataframe({name: column for name, column in table.items() if name != "hung"}, COLUMNS)


# --- A robot

BAD_FOR_ROBOT: list[tuple[dict[str, Any], str]] = [
    ({"q_motors": np.zeros((2, 2))}, r"of 3 columns: motor_1 \[rad\], motor_2 \[rad\], motor_3 \[rad\]"),
    ({"positions": {"tipp": TIPS}}, "no frame is called 'tipp'"),
    ({"positions": {"ball": TIPS}, "markers": {"ball": "bal"}}, "no frame is called 'bal'"),
    ({"wrench": {"nowhere": np.zeros((2, 6))}}, "no frame is called 'nowhere'"),
    ({"relative": True}, "not all of these are muscles with a length"),
    ({"tensions": np.ones((2, 1))}, "tensions = .*of 0 columns, one a muscle"),
    ({"damping_ratios": np.full((2, 5), 0.1)}, "damping_ratios = .*at most 4 columns"),
    ({"frequencies": np.ones((2, 5))}, "frequencies = .*at most 4 columns"),
]


@each_row(("arguments", "message"), BAD_FOR_ROBOT)
def test_measurements_that_cannot_be_those_of_a_robot(arguments: dict[str, Any], message: str, arm: sr.SoftModel) -> None:
    sr.Measurements(np.zeros((2, 3)), tip_position=TIPS).check(arm)
    with pytest.raises((sr.ParameterError, sr.NameNotFound), match=message):
        sr.Measurements(**{"q_motors": np.zeros((2, 3)), "tip_position": TIPS, **arguments}).check(arm)


def test_coordinates_that_a_robot_cannot_have_are_named_by_their_row() -> None:
    pcc = sr.load_model(sr.PccArm(segment_lengths=(0.4,)))
    pulls = np.zeros((4, 3))
    pulls[2, 1] = 1.0  # longer than the muscle is
    with pytest.raises(sr.ParameterError, match=r"q_motors \(line 9\).*are unit and sign right\?"):
        sr.Measurements(pulls, tip_position=np.ones((4, 3)), relative=True, lines=[2, 4, 9, 10]).check(pcc)


def test_pulls_loads_and_markers_on_a_robot(arm: sr.SoftModel) -> None:
    """Relaxed length minus pull; force, wrench and mass of one frame in one wrench; a marker sits on its frame."""
    tendons = sr.load_model(sr.TendonArm())
    pulled = sr.Measurements(np.full((1, 9), 0.002), tip_position=[[0, 0, 0.1]], relative=True)
    pulled.check(tendons)
    np.testing.assert_allclose(pulled.motor_coordinates(tendons)[0], tendons.relaxed_motors - 0.002, rtol=1e-15)
    loaded = sr.Measurements(
        np.zeros((1, 3)), force=[[1, 2, 3]], mass=[0.5], gravity=(0, 0, -10), positions={"ball": [[1, 0, 0]]},
        wrench={"tip": [[0, 0, 1, 4, 5, 6]], "base_link": [[7, 0, 0, 0, 0, 0]]}, markers={"ball": "tip"},
    )  # fmt: skip
    loaded.check(arm)
    assert frame_of(arm, "ball", loaded.markers) == "tip"
    wrenches = wrenches_on(arm, loaded.loads)
    assert {frame: wrench.tolist() for frame, wrench in wrenches.items()} == {
        "tip": [[1.0, 2.0, -1.0, 4.0, 5.0, 6.0]],
        "base_link": [[7.0, 0.0, 0.0, 0.0, 0.0, 0.0]],
    }


def test_the_recordings_load_with_their_columns() -> None:
    """Order of the servos against the labels of single pulls; counts and millimetres against the raw text."""
    found = {
        name: sr.Measurements.from_csv(RECORDINGS / f"{name}.csv", RECORDINGS / "columns.yaml") for name in ("train", "val")
    }
    assert [len(rows) for rows in found.values()] == [1620, 443]
    single = sr.Measurements.from_csv(RECORDINGS / "tendon_pull.csv", RECORDINGS / "columns.yaml")
    assert single.labels is not None
    for k in range(9):
        label = next(label for label in single.labels if f"tendon{k}_" in label)
        mean = single.of_labels(label).q_motors.max(axis=0)
        assert int(np.argmax(mean)) == k
    assert single.relative
    first = (RECORDINGS / "val.csv").read_text(encoding="utf-8").splitlines()[1].split(",")
    np.testing.assert_allclose(
        found["val"].measured["positions.tip"][0], [1e-3 * float(cell) for cell in first[-3:]], rtol=1e-15
    )
    assert not any(label.endswith("_hold") for label in found["train"].labels or ())
    found["train"][::100].check(sr.load_model(sr.TendonArm()))


# --- Tables, files and selections

numbers = st.floats(-1e6, 1e6)
gaps = st.one_of(numbers, st.just(math.nan))


@st.composite
def measured(draw: st.DrawFn, n: int | None = None) -> sr.Measurements:
    """Any measurements of a robot with two actuators; in no row is everything missing."""
    n = draw(st.integers(1, 5)) if n is None else n

    def rows(width: int, values: st.SearchStrategy[float] = numbers) -> Any:
        return np.array(draw(st.lists(st.lists(values, min_size=width, max_size=width), min_size=n, max_size=n)))

    angle = rows(1, st.floats(-3, 3))[:, 0]
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(angle)
    poses[:, 1, 0], poses[:, 0, 1] = np.sin(angle), -np.sin(angle)
    poses[:, :3, 3] = rows(3, gaps)
    poses[draw(st.integers(0, n - 1)), :3, :3] = np.nan
    places = rows(3, gaps)
    places[:, 0] = 1.0
    choice = draw(
        st.fixed_dictionaries({name: st.booleans() for name in ("loads", "poses", "torques", "labels", "markers", "names")})
    )
    arguments: dict[str, Any] = {"positions": {"elbow, left": places, "tip": rows(3, gaps)}, "relative": draw(st.booleans())}
    std: dict[str, Any] = {"positions.tip": 0.1 + rows(3) ** 2}
    if choice["loads"]:
        arguments |= {"force": rows(3), "wrench": {"tip": rows(6)}, "mass": rows(1)[:, 0] ** 2, "gravity": (0, 1, -9.81)}
    if choice["poses"]:
        arguments, std = arguments | {"poses": {"tip": poses}}, std | {"poses.tip": (0.001, 0.02)}
    if choice["torques"]:
        arguments |= {"motor_torques": rows(2, gaps), "tensions": rows(1, gaps), "frequencies": 1.0 + rows(3) ** 2}
        arguments |= {"damping_ratios": 0.5 + 0.4 * np.tanh(rows(2, gaps))}
    if choice["labels"]:
        words = st.text(st.characters(categories=["L", "N", "P", "Zs"]), min_size=1, max_size=9).filter(str.isprintable)
        words = words.map(str.strip).filter(bool)
        arguments |= {"labels": draw(st.lists(words, min_size=n, max_size=n)), "mask": rows(1)[:, 0] > 0.0}
    if choice["markers"]:
        arguments |= {"markers": {"elbow, left": "link_1"}}
    if choice["names"]:
        arguments |= {"actuators": draw(st.permutations(("motor_1", "motor_2")))}
    return sr.Measurements(rows(2), std=std, **arguments)


@pytest.mark.study
@law("Measurements")
@settings(max_examples=40)
@given(rows=measured())
def test_files_and_copies_hold_the_same_to_the_last_bit(
    rows: sr.Measurements, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("rows")
    assert_same(rows, sr.Measurements.from_csv(rows.to_csv(folder / "a.csv")))
    assert_same(rows, sr.load_result(sr.save_result(rows, folder / "a.npz")))
    assert_same(rows, pickle.loads(pickle.dumps(rows)))
    with pytest.raises(sr.OutputExists):
        rows.to_csv(folder / "a.csv")


ARM = sr.InflatableArm(stiffness=150.0)


@settings(max_examples=20, deadline=None)
@given(order=st.permutations(range(3)), seed=st.integers(0, 99))
def test_actuators_by_name_are_those_of_the_robot_in_any_order(order: list[int], seed: int) -> None:
    """Columns by name, rows by name, and an array with names are the same rows as in the order of the robot."""
    random, model = np.random.default_rng(seed), sr.load_model(ARM)
    q, torques, std = random.normal(size=(3, 4, 3))
    others = {"tip_position": random.normal(size=(4, 3)), "force": np.ones((4, 3))}
    plain = sr.Measurements(q, motor_torques=torques, std={"motor_torques": std**2}, **others)
    names = [model.actuator_names[place] for place in order]
    columns, loads = ({name: table[:, place] for name, place in zip(names, order, strict=True)} for table in (q, torques))
    rows = [{name: column[row] for name, column in columns.items()} for row in range(4)]
    mixed = {"std": {"motor_torques": std[:, order] ** 2}, **others}
    for named in (
        sr.Measurements(columns, motor_torques=dict(reversed(loads.items())), **mixed),
        sr.Measurements(rows, motor_torques=loads, **mixed),
        sr.Measurements(q[:, order], motor_torques=torques[:, order], actuators=names, **mixed),
    ):
        assert named.actuators == tuple(names)
        named.check(model)
        assert_same(named.in_order_of(model), plain)


def test_a_fit_and_candidates_take_actuators_by_name() -> None:
    """The same digits, measured and chosen, as with columns in the order of the robot."""
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (6, 3))
    tips = np.array([sr.solve_equilibrium(sr.load_model(sr.InflatableArm()), row, (0, 0, -9)).tip_position for row in q])
    force = np.tile((0.0, 0.0, -9.0), (6, 1))
    names = ("motor_3", "motor_1", "motor_2")
    columns = dict(zip(names, q[:, [2, 0, 1]].T, strict=True))
    fits = [sr.identify(ARM, sr.Measurements(one, tip_position=tips, force=force), "stiffness") for one in (q, columns)]
    assert fits[0].solution.tolist() == fits[1].solution.tolist()
    named = sr.identify("inflatable_arm", sr.Measurements(q, tip_position=tips, force=force), "stiffness")
    assert named.parameters[0].name == "stiffness"
    chosen = [sr.informative_poses(ARM, "stiffness", one, 2, force=force).indices.tolist() for one in (q, columns)]
    assert chosen[0] == chosen[1]
    for wrong, kind, text in (
        ({"motor_1": [0.1], "motor_2": [0.2]}, sr.ParameterError, "motor_3 missing"),
        ({"motor_1": [0.1], "elbow": [0.2], "motor_3": [0.1]}, sr.NameNotFound, "no actuator is called 'elbow'"),
        ({"motor_1": [0.1, 0.2], "motor_2": [0.2] * 3}, sr.ParameterError, "as many for one as for another"),
        ({"motor_1": ["a"]}, sr.ParameterError, "a column of numbers"),
    ):
        with pytest.raises(kind, match=text):
            sr.Measurements(wrong, tip_position=tips[:1]).check(sr.load_model(ARM))
    with pytest.raises(sr.NameNotFound, match="no actuator of q_motors is called 'motor_3'"):
        sr.Measurements(q, motor_torques=columns)


@settings(max_examples=40)
@given(data=st.data(), n=st.integers(2, 6))
def test_parts_joined_are_the_whole(data: st.DataObject, n: int) -> None:
    rows = data.draw(measured(n))
    cut = data.draw(st.integers(1, n - 1))
    first, second = rows[:cut], rows[np.arange(n) >= cut]
    assert (len(first), len(second)) == (cut, n - cut)
    assert_same(first + second, rows)
    order = data.draw(st.permutations(range(n)))
    assert_same(rows[order][np.argsort(order)], rows)


def test_rows_are_selected_by_label_and_joined_only_in_one_form() -> None:
    rows = sr.Measurements(
        np.arange(8.0).reshape(4, 2), tip_position=np.ones((4, 3)), labels=["rep1_a", "rep1_b", "rep2_a", "c"]
    )
    assert rows.of_labels("rep1_*").labels == ("rep1_a", "rep1_b")
    with pytest.raises(sr.NameNotFound, match=r"no label is called 'rep3_\*'.*rep1_a"):
        rows.of_labels("rep3_*")
    for bad in (np.zeros(4, dtype=bool), 2, [9], [True], "a", np.array([0.5])):
        with pytest.raises(sr.ParameterError, match=r"select at least one row|of 4 rows"):
            rows[bad]
    others: list[dict[str, Any]] = [
        {"gravity": (0, 0, -9.81)},
        {"motor_torques": np.ones((4, 2))},
        {"relative": True},
        {"std": 1.0},
    ]
    for more in others:
        with pytest.raises(sr.ParameterError, match="of the form of"):
            rows + sr.Measurements(rows.q_motors, tip_position=np.ones((4, 3)), labels=rows.labels, **more)
    with pytest.raises(TypeError):
        rows + 1  # type: ignore[operator]
    with pytest.raises(ValueError, match="read-only"):
        rows.q_motors[0, 0] = 1.0
