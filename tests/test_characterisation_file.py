"""Raw data of a bending test as CSV, the command that fits them, and its picture."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.inflated_beam.characterisation import COLUMNS
from tests.support.laws import law
from tests.support.tables import each_row

TUBE = {"pressure": 50e3, "radius": 0.055}
IN_SI = {"rad": 1.0, "mrad": 0.001, "deg": 0.017453292519943295, "N m": 1.0, "Nm": 1.0, "N mm": 0.001, "Nmm": 0.001}
IN_SI |= {"m": 1.0, "mm": 0.001, "N": 1.0}


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """The link of Table 3 at 50 kPa, pushed by a probe: a zero error of 1.5 mm, and noise of 3 % of the force."""
    random, test, angle = np.random.default_rng(3), inflated_beam.BendingTest(), np.linspace(0.005, 0.2, 40)
    moved = test.displacement(angle)
    moment = inflated_beam.moment(angle, stiffness=169.44, max_moment=21.76) * (1.0 + 0.03 * random.normal(size=40))
    rows = [f"{1e3 * v + 1.5:.2f},{f:.2f}" for v, f in zip(moved, moment / test.moment(moved, 1.0), strict=True)]
    file = tmp_path / "probe.csv"
    file.write_text("\n".join(["displacement [mm],force [N]", *rows, ""]), encoding="utf-8")
    return file


def words(file: Path) -> tuple[str, ...]:
    return ("characterise", str(file), "--pressure", "50e3", "--radius", "0.055")


def column(name: str) -> tuple[str, float]:
    """Quantity and factor of a column, by the words of its name."""
    quantity, unit = name.rstrip("]").replace(" [", "_").split("_")
    return quantity, IN_SI[unit]


@law("inflated_beam.read_characterisation", "inflated_beam.BendingData")
@settings(max_examples=30)
@given(data=st.data())
def test_points_are_those_of_the_file_in_any_unit(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    """To the last digit but two: written as shortest decimals in the unit of the column, in any order of columns."""
    pair = data.draw(st.sampled_from([("angle", "moment"), ("displacement", "force")]))
    names = [data.draw(st.sampled_from([name for name in COLUMNS if column(name)[0] == one])) for one in pair]
    values = [data.draw(st.lists(st.floats(-0.4, 0.4), min_size=5, max_size=5)) for _ in names]
    order = data.draw(st.permutations([0, 1, 2]))
    cells = [[names[0], *(repr(v / column(names[0])[1]) for v in values[0])]]
    cells += [[names[1], *(repr(v / column(names[1])[1]) for v in values[1])], ["note", *"abcde"]]
    file = tmp_path_factory.mktemp("points") / "a.csv"
    file.write_text("\n".join(",".join(cells[k][row] for k in order) for row in range(6)) + "\n", encoding="utf-8")
    test = inflated_beam.BendingTest(probe_distance=0.6, hinge_offset=0.05, offset=0.04)
    found = inflated_beam.read_characterisation(file, test)
    assert isinstance(found, inflated_beam.BendingData)
    if pair[0] == "displacement":
        values = [test.angle(values[0]), test.moment(*values)]
    assert np.allclose(found, values, rtol=1e-14, atol=1e-15)


@each_row(
    ("text", "message"),
    [
        ("", "line 1: it names nothing of a bending test; 'angle' and 'moment', or 'displacement' and 'force' are required"),
        ("angle,moment\n1,2\n", "each once and with its unit: angle [rad]"),
        ("angle [deg],force [N]\n1,2\n", "it names angle [deg], force [N] of a bending test; 'angle' and 'moment'"),
        ("angle [deg],angle [rad],moment [N m]\n1,1,2\n", "each once and with its unit"),
        ("angle [deg],angle [deg],moment [N m]\n1,1,2\n", "moment_Nmm, displacement [m], displacement_m, displacement [mm]"),
        ("angle [deg],moment [N m]\n1,2\n2,4\n", "has 2 rows of numbers; at least 3 are required"),
        ("angle [deg],moment [N m]\n1,2\n\n2,x\n3,6\n", "line 4: moment [N m] = 'x'; a finite number is required"),
        ("angle [deg],moment [N m]\n1,2\n2,4,\n3,6\n", "line 3: 3 cells; 2 are required"),
        ("angle [deg];moment [N m]\n1,5;2\n", "line 1: its cells are parted by semicolons"),
        ("angle [rad],moment [N m]\n1,2\n\n-7.2,4\n3,6\n", "line 4: the link is bent by -7.2 rad; less than a right angle"),
        ("displacement [m],force [N]\n0.1,2\n1e31,4\n0.3,6\n", "line 3: displacement [m] must be at most 1e+30 in size"),
    ],
)
def test_files_that_are_no_bending_test_are_refused_with_their_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError) as caught:
        inflated_beam.read_characterisation(file)
    assert message in str(caught.value)
    assert str(file) in str(caught.value)


def test_the_link_of_the_table_comes_back(probe: Path) -> None:
    """169.44 N m/rad, 21.76 N m and the zero error of 1.5 mm at 470 mm, within three standard errors."""
    fit = inflated_beam.fit_characterisation(*inflated_beam.read_characterisation(probe), **TUBE)
    assert fit.stiffness == pytest.approx(169.44, abs=3.0 * fit.stiffness_std)
    assert fit.angle_offset == pytest.approx(1.5 / 470.0, abs=3.0 * fit.angle_offset_std)
    assert fit.max_moment == pytest.approx(21.76, abs=3.0 * 0.03 * 21.76 / np.sqrt(fit.n_saturated))


def test_the_command_names_what_it_requires_and_no_unit_of_nothing(told, tmp_path: Path) -> None:
    file = tmp_path / "line.csv"
    file.write_text("angle [rad],moment [N m]\n" + "".join(f"{0.01 * n},{1.7 * n}\n" for n in range(8)), encoding="utf-8")
    assert re.search(r"^plateau M_max +none$", told(*words(file))[1], re.M)
    told_error = told(*words(file), "--pressure", "nan")[2]
    assert "--pressure = nan: --pressure must be a finite number [Pa]" in told_error


def test_the_command_prints_saves_and_draws_the_fit(probe: Path, told, tool, tmp_path: Path) -> None:
    tool("matplotlib")
    file, picture = tmp_path / "fit.npz", tmp_path / "fit.png"
    status, out, _ = told(*words(probe), "--json", "-o", str(file), "--plot", str(picture))
    found = json.loads(out)
    fit = sr.load_result(file)
    assert status == 0
    assert fit == inflated_beam.fit_characterisation(*inflated_beam.read_characterisation(probe), **TUBE)
    for name in (
        "stiffness",
        "stiffness_std",
        "angle_offset",
        "angle_offset_std",
        "max_moment",
        "wrinkling_moment",
        "n_linear",
    ):
        assert found[name] == getattr(fit, name)
    assert found["stiffness_interval"] == list(fit.stiffness_interval)
    assert found["units"]["stiffness"] == "N m/rad"
    assert found["files"] == [str(file), str(picture)]
    assert picture.stat().st_size > 10_000
    status, out, _ = told(*words(probe))
    assert status == 0
    assert f"softrobots solve inflatable_arm --set stiffness={fit.stiffness:.6g} max_moment={fit.max_moment:.6g}" in out
    assert "wrinkling (3) at         20.5257 N m" in out


def test_the_command_takes_a_known_zero_and_the_geometry_of_the_probe(probe: Path, told) -> None:
    test = inflated_beam.BendingTest(probe_distance=0.51, hinge_offset=0.02, offset=0.06)
    data = inflated_beam.read_characterisation(probe, test)
    fit = inflated_beam.fit_characterisation(*data, **TUBE, angle_offset=0.003)
    rig = ("--probe-distance", "0.51", "--hinge-offset", "0.02", "--offset", "0.06")
    _, out, _ = told(*words(probe), "--json", "--angle-offset", "0.003", *rig)
    assert json.loads(out)["stiffness"] == fit.stiffness
    assert json.loads(out)["angle_offset"] == 0.003


@each_row(
    ("given", "message"),
    [
        (("--pressure", "-1"), "--pressure must be"),
        (("--radius", "0"), "--radius must be positive [m]"),
        (("--hinge-offset", "0.6"), "--hinge-offset must be below the distance of the probe"),
        (("--offset", "0.6"), "--offset must be below the distance of the probe from the hinge"),
        (("-o", "fit.json"), "-o must be"),
        (("--plot", "fit.pdf"), "--plot must be"),
    ],
)
def test_bad_words_are_refused_by_the_name_of_their_option(given: tuple[str, str], message: str, probe: Path, told) -> None:
    status, out, error = told(*words(probe), *given)
    assert (status, out) == (2, "")
    assert message in error


def test_the_picture_has_points_law_and_limits(probe: Path, tool) -> None:
    tool("matplotlib")
    from softrobots.view.figures.inflated_link import characterisation

    data = inflated_beam.read_characterisation(probe)
    fit = inflated_beam.fit_characterisation(*data, **TUBE)
    (axes,) = characterisation(data, fit, **TUBE).axes
    slope, beyond, law_drawn, slack, wrinkling = axes.lines
    assert (len(slope.get_xdata()), len(beyond.get_xdata())) == (fit.n_linear, 40 - fit.n_linear)
    assert np.allclose(np.sort(np.concatenate([slope.get_xdata(), beyond.get_xdata()])), np.sort(data.angle))
    angles, moments = law_drawn.get_data()
    assert np.allclose(moments, np.minimum(fit.stiffness * (angles - fit.angle_offset), fit.max_moment))
    assert (slack.get_ydata()[0], wrinkling.get_ydata()[0]) == pytest.approx((13.067, 20.526), abs=1e-3)
    linear = inflated_beam.BendingData(0.5 * data.angle, 0.5 * data.angle * 170.0)
    (axes,) = characterisation(linear, inflated_beam.fit_characterisation(*linear, **TUBE), **TUBE).axes
    assert not any("beyond" in text.get_text() for text in axes.get_legend().get_texts())
