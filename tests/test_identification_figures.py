"""Figures and the page of a fit show measured and solved numbers, and what confidence regions are drawn as holds."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.view.figures import experiments, identifications
from softrobots.view.identification_page import IdentificationPage
from tests.support.packed_pages import scene_of

ROWS, WRONG = 16, 6
MOTORS = np.random.default_rng(4).uniform(-0.8, 0.8, (ROWS, 3))
FORCES = np.random.default_rng(5).uniform(-12.0, 12.0, (ROWS, 3))
BASE = np.array([0.03, -0.02, 0.01])
TURN = 0.05


def tips(robot: sr.InflatableArm, base: np.ndarray, turn: float) -> np.ndarray:
    """Where a camera sees the tip of a robot that stands at `base`, turned about z, poses as (n, 4, 4)."""
    arm, rotation = sr.load_model(robot), pin.exp3(np.array([0.0, 0.0, turn]))
    states = [sr.solve_equilibrium(arm, *row) for row in zip(MOTORS, FORCES @ rotation, strict=True)]
    placed = pin.SE3(rotation, base)
    return np.array([(placed * state.transform_tip_to_world).homogeneous for state in states])


@pytest.fixture(scope="module")
def measured() -> np.ndarray:
    poses = tips(sr.InflatableArm(stiffness=150.0), BASE, TURN)
    random = np.random.default_rng(6)
    poses[:, :3, 3] += random.normal(0.0, 1e-3, (ROWS, 3))
    poses[:, :3, :3] = [pin.exp3(turn) for turn in random.normal(0.0, 2e-3, (ROWS, 3))] @ poses[:, :3, :3]
    poses[WRONG, 1, 3] += 0.03
    return poses


@pytest.fixture(scope="module")
def fit(measured: np.ndarray) -> sr.Identification:
    poses = measured.copy()
    poses[3, :3, :3] = np.nan  # the camera saw the place and not the turn
    rows = sr.Measurements(
        MOTORS,
        force=FORCES,
        poses={"tip": poses},
        std={"poses.tip": [1e-3, 2e-3]},
        labels=[f"day{row // 4}" for row in range(ROWS)],
    )
    names = ("stiffness", "base.position", "base.rotation.z")
    priors = {"stiffness": (160.0, 20.0)}
    return sr.identify(sr.InflatableArm(stiffness=170.0), rows, names, loss="soft_l1", priors=priors, validation="day3")


@pytest.fixture(autouse=True)
def matplotlib(tool: Callable[[str], ModuleType]) -> None:
    tool("matplotlib")


def solved(fit: sr.Identification) -> np.ndarray:
    """The poses that the fitted robot has."""
    base = [fit.values[f"base.position.{axis}"] for axis in "xyz"]
    return tips(fit.robot, np.array(base), fit.values["base.rotation.z"])


def test_residuals_are_measured_minus_solved(fit: sr.Identification, measured: np.ndarray) -> None:
    figure = identifications.residuals(fit)
    places, turns = figure.axes
    shown = np.array([line.get_ydata() for line in places.lines[:3]]).T
    expected = 1e3 * (measured - solved(fit))[:12, :3, 3]
    assert shown == pytest.approx(expected, abs=1e-6)  # [mm], settled to 1e-12
    assert places.get_ylabel() == "residual [mm]"
    assert turns.get_ylabel() == "residual [mrad]"
    assert np.isnan([line.get_ydata()[3] for line in turns.lines[:3]]).all()
    assert [text.get_text() for text in places.texts] == [f"row {WRONG}"]  # the outlier is told
    shaded = [patch.get_x() for patch in places.patches]
    assert shaded == [3.5]  # day1 of day0, day1, day2


def test_predicted_lies_over_measured(fit: sr.Identification, measured: np.ndarray) -> None:
    figure = identifications.predicted(fit)
    expected = np.stack([measured, solved(fit)])[:, :, :3, 3]
    for axis, axes in enumerate(figure.axes):
        fitted, aside = (line.get_xydata().T for line in axes.lines[1:])
        assert fitted == pytest.approx(expected[:, :12, axis], abs=1e-9)
        assert aside == pytest.approx(expected[:, 12:, axis], abs=1e-9)


def test_95_percent_of_estimates_lie_in_a_confidence_region(fit: sr.Identification) -> None:
    """Estimates of known standard deviations scatter normally in the fitted coordinates; 3 standard errors of 20,000 draws."""
    from matplotlib.path import Path

    figure = identifications.ellipses(fit)
    names = {f"{one.name} [{one.unit}]": number for number, one in enumerate(fit.parameters)}
    middle = np.where([one.logarithmic for one in fit.parameters], np.log(np.abs(fit.solution)), fit.solution)
    draws = np.random.default_rng(7).multivariate_normal(middle, fit.by_rows.covariance, 20_000)
    assert len(figure.axes) == 6
    for axes in figure.axes:
        pair = [names[axes.get_xlabel()], names[axes.get_ylabel()]]
        points = draws[:, pair]
        points = np.where([fit.parameters[one].logarithmic for one in pair], np.exp(points), points)
        region = np.asarray(axes.lines[0].get_xydata())
        low, size = region.min(axis=0), np.ptp(region, axis=0)
        inside = Path((region - low) / size).contains_points((points - low) / size)
        assert inside.mean() == pytest.approx(0.95, abs=0.006)  # 0.0046, and 0.001 for the 120 corners


def test_values_and_correlations_are_those_of_the_fit(fit: sr.Identification) -> None:
    figure = identifications.values(fit)
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_yticklabels()] == list(fit.names)
    for text, name in zip(axes.texts, fit.names, strict=True):
        value, low, high = map(float, re.findall(r"-?\d[\d.e-]*\d", text.get_text())[:3])
        assert [value, low, high] == pytest.approx([fit.values[name], *fit.intervals[name]], rel=1e-3)
    shown = np.asarray(identifications.correlation(fit).axes[0].images[0].get_array())
    spread = np.sqrt(np.diag(fit.covariance))
    assert shown == pytest.approx(fit.covariance / np.outer(spread, spread), abs=1e-12)


def test_every_figure_is_there_or_has_nothing_to_show(fit: sr.Identification, measured: np.ndarray) -> None:
    assert list(identifications.identification_figures(fit)) == ["residuals", "predicted", "values", "correlation", "ellipses"]
    rows = sr.Measurements(MOTORS, force=FORCES, tip_position=measured[:, :3, 3])
    single = sr.identify(sr.InflatableArm(stiffness=170.0), rows, "stiffness", max_iterations=1)
    assert list(identifications.identification_figures(single)) == ["residuals", "predicted", "values"]
    for draw in (identifications.residuals, identifications.values, identifications.ellipses, IdentificationPage):
        with pytest.raises(sr.ParameterError, match="result"):
            draw(3)


def tracks(page: str) -> dict[str, dict[str, list]]:
    """Keys of the animation of a page, by node and property."""
    import umsgpack

    (played,) = (umsgpack.unpackb(command) for command in scene_of(page)[1] if b"set_animation" in command)
    return {one["path"]: {track["name"]: track["keys"] for track in one["clip"]["tracks"]} for one in played["animations"]}


def test_the_page_shows_measured_and_solved_poses_in_the_frame_of_the_base(
    fit: sr.Identification, measured: np.ndarray
) -> None:
    with IdentificationPage(fit) as page:
        text = page.html()
    base = pin.SE3(pin.exp3(np.array([0.0, 0.0, fit.values["base.rotation.z"]])), fit.solution[1:4])
    for name, poses in (("measured", measured), ("predicted", solved(fit))):
        node = next(keys for path, keys in tracks(text).items() if path.endswith(f"poses.tip/{name}"))
        places = np.array([key["value"] for key in node[".position"]])[::2]
        expected = (np.array(base.inverse().homogeneous) @ poses[:12])[:, :3, 3]
        assert places == pytest.approx(expected, abs=5e-6)  # numbers of a page are multiples of 4 um
        axes = next(keys for path, keys in tracks(text).items() if path.endswith(f"poses.tip/{name}/axes"))
        assert [key["value"] for key in axes[".visible"]][::2] == [row != 3 for row in range(12)]
    off = 1e3 * np.linalg.norm((measured - solved(fit))[WRONG, :3, 3])
    assert f"at {WRONG} s: row {WRONG}, {off:.1f} mm off" in text


def test_a_page_of_few_rows_has_the_worst(fit: sr.Identification) -> None:
    with IdentificationPage(fit, most_rows=6) as page:
        text = page.html()
    node = next(keys for path, keys in tracks(text).items() if path.endswith("poses.tip/measured"))
    assert len(node[".position"]) == 12
    assert f"row {WRONG}, " in text
    with IdentificationPage(fit, aside=True) as page:
        assert "row 3, " in page.html()
    with pytest.raises(sr.ParameterError, match="positions or poses"):
        IdentificationPage(sr.identify(fit.model, sr.Measurements(MOTORS, motor_torques=0.0 * MOTORS), "base.rotation.x"))


def test_choices_are_drawn_with_their_numbers() -> None:
    errors = np.array([[2e-3, 3e-3], [1e-3, 1.2e-3]])
    compared = sr.CrossValidation({"one": ("a",), "two": ("a", "b")}, ("day0", "day1"), errors, "m")
    (axes,) = experiments.cross_validation(compared).axes
    assert [patch.get_width() for patch in axes.patches[:2]] == pytest.approx([2.5, 1.1])  # mm
    assert [text.get_text() for text in axes.get_yticklabels()] == ["one (1)", "two (2)"]
    dots = [line.get_xdata() for line in axes.lines if len(line.get_xdata()) == 2 and line.get_marker() == "o"]
    assert np.array(dots) == pytest.approx(1e3 * errors)
    best = sr.informative_poses(
        sr.InflatableArm(stiffness=170.0), ("stiffness", "base.position"), MOTORS, 4, std={"tip_position": 1e-3}, force=FORCES
    )
    (axes,) = experiments.informative(best).axes
    shown = {line.get_label(): line.get_xdata() for line in axes.lines}
    assert shown["chosen (4)"] == pytest.approx(np.ones(4))
    assert shown["all"] == pytest.approx(best.margins["all"] / best.margins["chosen"])
    for draw in (experiments.cross_validation, experiments.informative):
        with pytest.raises(sr.ParameterError, match="result"):
            draw(errors)
