"""Actuator tables: SciPy's interpolators and root finder, derivatives by differences, and files that are not tables."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softrobots import helix
from softrobots.core.errors import FileFormatError, ParameterError, StraightTube
from softrobots.helix import ActuatorTable
from tests.support.laws import law
from tests.support.tables import each_row

PRESSURES = (0.0, 10e3, 25e3, 40e3, 60e3)
LENGTHENING = (0.50, 0.58, 0.71, 0.80, 0.86)  # an inverse pneumatic muscle; invented numbers
CONTRACTING = (1.0, 0.93, 0.80, 0.74, 0.70)


@pytest.mark.parametrize("shares", [LENGTHENING, CONTRACTING])
def test_every_row_is_reproduced_and_the_limits_are_are_its_ends(shares: tuple[float, ...]) -> None:
    table = ActuatorTable(PRESSURES, shares)
    np.testing.assert_allclose(table.contraction_at(PRESSURES), shares, rtol=0.0, atol=2e-16)
    np.testing.assert_allclose(table.pressure_for(shares), PRESSURES, rtol=1e-13, atol=1e-10)
    assert table.pressure_limits == (0.0, 60e3)
    assert table.contraction_limits == (min(shares), max(shares))


@pytest.mark.parametrize("shares", [LENGTHENING, CONTRACTING])
def test_a_linear_table_lies_on_the_chords(shares: tuple[float, ...]) -> None:
    table = ActuatorTable(PRESSURES, shares)
    for i in range(4):
        share = np.linspace(0.0, 1.0, 7)
        between = (1.0 - share) * PRESSURES[i] + share * PRESSURES[i + 1]
        expected = (1.0 - share) * shares[i] + share * shares[i + 1]
        np.testing.assert_allclose(table.contraction_at(between), expected, rtol=0.0, atol=5e-16)  # a few roundings


@law("helix.ActuatorTable")
@settings(max_examples=60, deadline=None)
@given(
    steps=st.lists(st.tuples(st.floats(1e-3, 1e5), st.floats(1e-3, 1.0)), min_size=1, max_size=8),
    falling=st.booleans(),
    share=st.floats(0.0, 1.0),
)
def test_any_table_is_monotone_and_inverted(steps: list[tuple[float, float]], falling: bool, share: float) -> None:
    pressures = np.cumsum([-5e3, *(step[0] for step in steps)])
    levels = np.cumsum([1e-3, *(step[1] for step in steps)])
    levels /= levels[-1]
    table = ActuatorTable(pressures, levels[::-1] if falling else levels)
    low, high = table.contraction_limits
    wanted = min(max(low + share * (high - low), low), high)
    found = table.pressure_for(wanted)
    # The pressure carries a rounding or two; the slope is at most the steepest chord.
    steepest = float(np.max(np.abs(np.diff(table.contraction) / np.diff(pressures))))
    assert table.contraction_at(found) == pytest.approx(wanted, abs=4.0 * steepest * np.spacing(1e4 + pressures[-1]) + 1e-15)
    many = table.contraction_at(np.clip(np.linspace(*table.pressure_limits, 200), *table.pressure_limits))
    assert np.all(np.diff(many) <= 1e-15 if falling else np.diff(many) >= -1e-15)
    assert low <= many.min() <= many.max() <= high


def test_the_helix_at_a_pressure() -> None:
    table = ActuatorTable([0.0, 50e3], [0.61, 0.71])
    shape = helix.forward(table.contraction_at([25e3, 50e3]), np.radians(5.0), 0.0331)
    # docs/theory.md 3: the reference helix at contraction 0.66
    assert shape.outer_radius[0] == pytest.approx(0.0854078008, abs=1e-10)
    assert shape.inner_radius[0] == pytest.approx(0.0523078008, abs=1e-10)
    assert shape.pitch[0] == pytest.approx(0.0279647090, abs=1e-10)
    assert shape.shape == (2,)
    assert shape.inner_radius[1] > shape.inner_radius[0]  # the muscle lengthens, the helix opens


def test_shapes_follow_the_argument() -> None:
    table = ActuatorTable(PRESSURES, LENGTHENING)
    assert table.contraction_at(5e3).shape == ()
    assert table.pressure_for(np.full((2, 3), 0.6)).shape == (2, 3)
    assert table.contraction_at([]).shape == (0,)


def test_a_table_is_frozen() -> None:
    given_ = np.array(PRESSURES)
    table = ActuatorTable(given_, LENGTHENING)
    given_[0] = -1.0
    assert table.pressure_limits == (0.0, 60e3)
    with pytest.raises(ValueError, match="read-only"):
        table.contraction[0] = 0.3
    with pytest.raises(FrozenInstanceError):
        table.contraction = LENGTHENING
    assert pickle.loads(pickle.dumps(table)).contraction_at(10e3) == 0.58


# --- Files


def test_what_spreadsheets_add_is_read(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_bytes(b'\xef\xbb\xbfrun, contraction ,pressure_Pa\r\n1,0.5,0\r\n\r\n"two", 0.75 ,1e4\r\n,,\r\n')
    table = ActuatorTable.read_csv(str(path))
    assert table.pressure.tolist() == [0.0, 1e4]
    assert table.contraction.tolist() == [0.5, 0.75]


HEAD = "pressure_Pa,contraction\n"


@each_row(
    ("text", "message"),
    [
        ("", "line 1: it names nothing"),
        ("pressure,contraction\n0,0.5\n", "line 1: it names pressure, contraction"),
        ("pressure_Pa,contraction,contraction\n0,0.5,0.5\n", "line 1.*each once"),
        (HEAD, "has 0 rows"),
        (HEAD + "0,0.5\n", "has 1 rows"),
        (HEAD + "0,0.5\n1e4\n", "line 3: 1 cells; 2 are required"),
        (HEAD + "0,0.5\n1e4,0.6,0.7\n", "line 3: 3 cells; 2 are required"),
        (HEAD + "0,0.5\n1e4,\n", "line 3: contraction = ''"),
        (HEAD + "0,0.5\n\nten,0.6\n", "line 4: pressure_Pa = 'ten'"),
        (HEAD + "0,nan\n", "line 2: contraction = 'nan'"),
        (HEAD + "0,0.5\ninf,0.6\n", "line 3: pressure_Pa = 'inf'"),
        (HEAD + "0,0.5\n0,0.6\n", "line 3: pressure_Pa = 0.0; more than 0.0"),
        (HEAD + "0,0.5\n1,0.6\n2,1.1\n", r"line 4: contraction = 1.1; a number in \(0, 1\]"),
        (HEAD + "0,0\n1,0.6\n", "line 2: contraction = 0.0"),
        (HEAD + "0,0.5\n1,0.5\n", "line 3: contraction = 0.5 as in the row before"),
        (HEAD + "0,0.5\n1,0.6\n2,0.55\n", "line 4: contraction = 0.55 turns back"),
        (HEAD + "0,0.5\n1,0.4\n2,0.55\n", "line 4: contraction = 0.55 turns back"),
        (HEAD + "0,0.5\n1e300,0.6\n", "pressure = .*finite numbers"),
        (HEAD + "0,0.5\n1," + "0" * 200_000 + "\n", "line 3: .*field"),
    ],
)
def test_a_file_that_is_no_table_says_where(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message) as caught:
        ActuatorTable.read_csv(path)
    assert str(path) in str(caught.value)


def test_a_file_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"cannot read .*none\.csv: No such file"):
        ActuatorTable.read_csv(tmp_path / "none.csv")
    with pytest.raises(FileFormatError, match=r"cannot read .*: Is a directory"):
        ActuatorTable.read_csv(tmp_path)
    (tmp_path / "image.csv").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(FileFormatError, match=r"cannot read .*image\.csv: 'utf-8' codec"):
        ActuatorTable.read_csv(tmp_path / "image.csv")
    with (tmp_path / "huge.csv").open("wb") as file:
        file.truncate(10_000_001)
    with pytest.raises(FileFormatError, match="a line of more than 1000000 characters"):
        ActuatorTable.read_csv(tmp_path / "huge.csv")


# --- Bad input


@each_row(
    ("method", "value", "field", "named"),
    [
        ("contraction_at", 60e3 + 1e-6, "pressure", "0.0 to 60000.0"),
        ("contraction_at", [1e3, -1e-6], "pressure", "0.0 to 60000.0"),
        ("pressure_for", 0.4999, "contraction", "0.5 to 0.86"),
        ("pressure_for", [0.6, 0.8601], "contraction", "0.5 to 0.86"),
        ("contraction_at", float("nan"), "pressure", "finite"),
        ("pressure_for", float("inf"), "contraction", "finite"),
        ("contraction_at", "low", "pressure", "finite"),
    ],
)
def test_beyond_the_table_nothing_is_said(method: str, value: object, field: str, named: str) -> None:
    table = ActuatorTable(PRESSURES, LENGTHENING)
    with pytest.raises(ParameterError, match=named) as caught:
        getattr(table, method)(value)
    assert caught.value.field == field


@each_row(
    ("pressure", "contraction", "field"),
    [
        ([0.0], [0.5], "pressure"),
        ([], [], "pressure"),
        (0.0, 0.5, "pressure"),
        ([0.0, 1.0, 2.0], [0.5, 0.6], "contraction"),
        ([0.0, 1.0], [[0.5, 0.6]], "contraction"),
        ([0.0, 0.0], [0.5, 0.6], "pressure"),
        ([1.0, 0.0], [0.5, 0.6], "pressure"),
        ([0.0, 5e-324], [0.5, 0.6], "pressure"),  # its slope would overflow
        ([0.0, float("nan")], [0.5, 0.6], "pressure"),
        ([0.0, 1.0], [0.0, 0.6], "contraction"),
        ([0.0, 1.0], [-0.1, 0.6], "contraction"),
        ([0.0, 1.0], [0.5, 1.0 + 1e-15], "contraction"),
        ([0.0, 1.0], [0.5, float("inf")], "contraction"),
        ([0.0, 1.0, 2.0], [0.5, 0.6, 0.6], "contraction"),
        ([0.0, 1.0, 2.0], [0.5, 0.6, 0.55], "contraction"),
    ],
)
def test_bad_tables_are_refused(pressure: object, contraction: object, field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        ActuatorTable(pressure, contraction)
    assert caught.value.field == field


def test_bad_paths_are_refused() -> None:
    with pytest.raises(ParameterError, match="path"):
        ActuatorTable.read_csv(3)


def test_a_straight_tube_has_no_helix() -> None:
    with pytest.raises(StraightTube):
        helix.forward(ActuatorTable(PRESSURES, CONTRACTING).contraction_at(0.0), 0.0, 0.0331)
