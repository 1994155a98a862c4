"""The figures of the guides show what closed forms say, and refuse what they cannot draw."""

from __future__ import annotations

import math
import runpy
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots import inflated_beam
from softrobots.inflated_beam import TABLE_3, CharacterisationRow
from studies.gallery import load_plots
from studies.papers import link_pictures
from tests.conftest import CHECKOUT
from tests.support.figures import READABLE, smallest_text
from tests.support.tables import each_row

pytestmark = pytest.mark.study

TUBE = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005}


@pytest.fixture(autouse=True)
def matplotlib(tool: Callable[[str], ModuleType]) -> None:
    tool("matplotlib")


def lines(axes: Any) -> dict[str, np.ndarray]:
    """Points of each line by its label."""
    return {str(line.get_label()): np.asarray(line.get_xydata(), dtype=float) for line in axes.lines}


def check_axes(figure: Any) -> None:
    """Every axis has a unit, every plot a legend, lines differ in more than colour, and the smallest print is readable."""
    assert smallest_text(figure) >= READABLE
    for axes in figure.axes:
        assert "[" in axes.get_xlabel()
        assert "[" in axes.get_ylabel()
        assert axes.get_legend() is not None
        looks = [(line.get_linestyle(), line.get_marker()) for line in axes.lines if len(line.get_xydata()) > 2]
        assert len(set(looks)) >= min(len(looks), 2)


def test_the_bent_link_ends_where_closed_forms_say() -> None:
    """Bending F l^3 / 3, the printed sign twice that, shear F l / (P + j G S), the hinge F l2^2 / k."""
    figure = link_pictures.deflection(10.0, stiffness=172.71, hinge_offset=0.03, pressure=50e3, **TUBE)
    check_axes(figure)
    modulus = inflated_beam.young_modulus_from_stiffness(172.71, pressure=50e3, **TUBE)
    cap, wall, second = 50e3 * math.pi * 0.055**2, 2 * math.pi * 0.055 * 0.0005, math.pi * 0.055**3 * 0.0005
    bending = 10.0 * 0.6**3 / 3 / ((modulus + cap / wall) * second)
    shear = 10.0 * 0.6 / (cap + 0.5 * modulus / 2.6 * wall)
    ends = [points[-1] for points in lines(figure.axes[0]).values()]
    expected = [bending + shear, bending, 10.0 * 0.57**2 / 172.71, 2 * bending + shear]
    assert np.array(ends) == pytest.approx(np.column_stack([np.full(4, 600.0), 1e3 * np.array(expected)]), rel=1e-9)


def test_laws_have_their_slope_their_plateau_and_their_wrinkling_moment() -> None:
    figure = link_pictures.moment_angle_laws(TABLE_3, 0.055)
    check_axes(figure)
    drawn = lines(figure.axes[0])
    for row in TABLE_3:
        (points,) = (points for label, points in drawn.items() if label.startswith(f"{row.pressure / 1e3:g} kPa"))
        assert points[1, 1] / points[1, 0] == pytest.approx(row.stiffness)
        top = math.pi**2 / 4 * row.pressure * 0.055**3 if row.max_moment is None else row.max_moment
        assert points[:, 1].max() == pytest.approx(top, rel=1e-12)
    marked = np.array([points[0] for label, points in drawn.items() if label.startswith("_") and len(points) == 1])
    assert marked[:, 1] == pytest.approx([4.11, 8.21, 12.32, 16.42, 20.53, 24.63], abs=0.005)  # as Table 3 prints them


def test_measured_plateaus_lie_between_wrinkling_and_the_upper_bound() -> None:
    figure = link_pictures.pressure_effects(TABLE_3, young_modulus=138e6, **TUBE)
    check_axes(figure)
    left, right = (lines(axes) for axes in figure.axes)
    labels = ("upper bound, pi p r^3", "largest moment, measured", "wrinkling moment (3)")
    upper, measured, lower = (right[label] for label in labels)
    assert upper[-1, 1] == pytest.approx(math.pi * 66e3 * 0.055**3)
    assert len(measured) == 5
    for pressure, moment in measured:
        assert np.interp(pressure, *lower.T) < moment < np.interp(pressure, *upper.T)
    beam = left["beam (1), E = 138 MPa"]
    assert beam[0, 1] == pytest.approx(inflated_beam.stiffness_from_young_modulus(138e6, pressure=0.0, **TUBE))
    assert figure.axes[0].get_ylim()[1] > 187.30 + 1.48  # the highest error bar is not cut off


@pytest.fixture(scope="module")
def pushed() -> dict[str, list[sr.Equilibrium]]:
    arm = sr.load_model(sr.InflatableArm())
    sides = {f"{side} N": side for side in (0, 1)}
    return {
        label: [sr.solve_equilibrium(arm, (0, 0, 0), (-force, side, 0)) for force in (0, 40, 80, 110)]
        for label, side in sides.items()
    }


def test_the_straight_arm_loses_its_stiffness_in_proportion(pushed: dict[str, list[sr.Equilibrium]]) -> None:
    """k - F ((a + c)/2 + sqrt((a - c)^2/4 + c^2)), with the levers a and c of the two hinges."""
    figure = load_plots.growing_load(pushed, (-2, 0, 0), critical=114.0657)
    check_axes(figure)
    left, right = (lines(axes) for axes in figure.axes)
    slope = (1.17 + 0.57) / 2 + math.hypot((1.17 - 0.57) / 2, 0.57)
    forces = np.array([0.0, 40.0, 80.0, 110.0])
    assert right["0 N"] == pytest.approx(np.column_stack([forces, 172.71 - forces * slope]), abs=1e-9)
    assert left["0 N"] == pytest.approx(np.column_stack([forces, np.zeros(4)]), abs=1e-9)
    assert left["1 N"][0, 1] == 0.0  # counted from the first of the branch
    assert np.all(np.diff(left["1 N"][:, 1]) > 0.0)


def test_markers_tell_what_only_the_probe_holds() -> None:
    row = TABLE_3[0]
    link = sr.load_model(
        sr.InflatableArm(link_lengths=(0.6,), stiffness=row.stiffness, pressure=row.pressure, max_moment=row.max_moment)
    )
    ways, run, held = (0.005, 0.02), [], None
    for way in ways:
        held = sr.solve_imposed_displacement(
            link, (0, 0), way, direction=(0, 1, 0), frame="link_1", point=(0.47, 0, 0), along=(1, 0, 0), start=held
        )
        run.append(held)
    figure = load_plots.reaction({"10 kPa": run})
    check_axes(figure)
    test = inflated_beam.BendingTest()
    angles = [float(test.angle(way)) for way in ways]
    forces = [min(row.stiffness * angle, 4.99) * math.cos(angle) ** 2 / 0.47 for angle in angles]
    assert lines(figure.axes[0])["10 kPa"] == pytest.approx(np.column_stack([1e3 * np.array(ways), forces]), rel=1e-9)
    filled, empty = (line for line in figure.axes[0].lines[1:3])
    assert (filled.get_xydata()[:, 0].tolist(), empty.get_xydata()[:, 0].tolist()) == ([5.0], [20.0])
    assert empty.get_markerfacecolor() == "white"


@each_row(
    ("make", "name"),
    [
        (lambda: link_pictures.deflection(10.0, stiffness=172.71, hinge_offset=0.6, pressure=50e3, **TUBE), "hinge_offset"),
        (lambda: link_pictures.deflection(math.nan, stiffness=172.71, hinge_offset=0.03, pressure=50e3, **TUBE), "force"),
        (lambda: link_pictures.moment_angle_laws((), 0.055), "rows"),
        (lambda: link_pictures.moment_angle_laws("10", 0.055), "rows"),
        (lambda: link_pictures.moment_angle_laws([(10e3, 180.0)], 0.055), "rows"),  # type: ignore[list-item]
        (lambda: link_pictures.moment_angle_laws([CharacterisationRow(1e4, -1.0, 0.0, None)], 0.055), "stiffness"),
        (lambda: link_pictures.moment_angle_laws([CharacterisationRow(1e4, 170.0, 0.0, 0.0)], 0.055), "max_moment"),
        (lambda: link_pictures.moment_angle_laws(TABLE_3, 0.0), "radius"),
        (lambda: link_pictures.pressure_effects(TABLE_3, young_modulus=0.0, **TUBE), "young_modulus"),
        (lambda: load_plots.growing_load({}, (1, 0, 0)), "lines"),
        (lambda: load_plots.growing_load({"a": []}, (1, 0, 0)), "lines"),
        (lambda: load_plots.reaction({"a": [1]}), "lines"),  # type: ignore[list-item]
    ],
)
def test_what_cannot_be_drawn_is_refused(make: Any, name: str) -> None:
    with pytest.raises(sr.ParameterError, match=name):
        make()


def test_directions_critical_loads_and_rigid_robots_are_refused(pushed: dict[str, list[sr.Equilibrium]]) -> None:
    with pytest.raises(sr.ParameterError, match="direction"):
        load_plots.growing_load(pushed, (0, 0, 0))
    with pytest.raises(sr.ParameterError, match="critical"):
        load_plots.growing_load(pushed, (1, 0, 0), critical=-1.0)
    rigid = sr.solve_equilibrium(sr.load_model(sr.InflatableArm(), springs={}), np.zeros(7))
    with pytest.raises(sr.ParameterError, match="springs"):
        load_plots.growing_load({"rigid": [rigid]}, (1, 0, 0))


def test_the_script_makes_what_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = runpy.run_path(str(CHECKOUT / "scripts" / "make_figures.py"))
    assert script["main"](["--only", "link_deflection", "--output", str(tmp_path)]) == 0
    assert [file.name for file in tmp_path.iterdir()] == ["link_deflection.png"]
    assert capsys.readouterr().out == f"{tmp_path / 'link_deflection.png'}\n"
    with pytest.raises(SystemExit) as ended:
        script["main"](["--only", "no_such_figure"])
    assert ended.value.code == 2
    names = {*script["FIGURES"], *script["SCENES"]}
    guides = "".join(
        (CHECKOUT / "docs" / page).read_text(encoding="utf-8")
        for page in (
            "actuators.md",
            "contact.md",
            "inflatable_arm.md",
            "own_robot.md",
            "motion.md",
            "your_robot.md",
            "watch.md",
        )
    )
    for name in names:
        assert f"images/{name}.png" in guides
        assert (CHECKOUT / "docs" / "images" / f"{name}.png").is_file()
