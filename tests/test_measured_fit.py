"""The robot that is fitted to the recordings of a real arm: its equilibria anew, by hand, and the page that shows the run."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.robots.parameter_file import read_robot
from studies.measured_arm.fit_tables import compared_table, fit_table
from studies.measured_arm.fitted import PRIORS, SETS, command, rows_of, start
from studies.measured_arm.recordings import FOLDER
from tests.conftest import CHECKOUT

LENGTHS = np.array([0.060, 0.0625, 0.064])
STICK = 1e-4  # rad


def recorded(name: str) -> Any:
    return json.loads((CHECKOUT / "docs" / "validation" / f"measured_{name}.json").read_text(encoding="utf-8"))


def tips_by_least_energy(values: dict[str, float], pulls: np.ndarray) -> np.ndarray:
    """Tips along pulls, (n, 3) [m], each from where the last one left it: bending towards x and y and elongation of three arcs.

    The energy of a step is that of bending, of elongation, of tendons that pull, and what friction dissipates from the last
    bending on, which is a spring up to a stick; Newton's method with the Hessian of that, halved until the energy falls.
    """

    def each(form: str, count: int) -> np.ndarray:
        return np.array([values[form.format(k + 1)] for k in range(count)])

    bending = np.array([50e9 * math.pi * 0.0005**4 / 4.0, *(values[f"segment[{k}].bending_stiffness"] for k in (2, 3))])
    stiffness = np.stack([bending, bending, np.full(3, values["axial_stiffness"])], axis=1) / LENGTHS[:, None]
    rest = np.stack([each("segment[{}].rest_bend_x", 3), each("segment[{}].rest_bend_y", 3), np.zeros(3)], axis=1)
    turns = np.array([0.0, values["offset[2]"], values["offset[2]"] + values["offset[3]"]])
    around = np.repeat(turns, 3) + np.tile(np.radians([0.0, 120.0, 240.0]), 3) + each("tendon[{}].tendon_azimuth_deviation", 9)
    slopes = np.zeros((9, 3, 3))
    for k, distance in enumerate(each("tendon[{}].tendon_distance", 9)):
        for segment in range(k // 3 + 1):
            local = around[k] - turns[segment]
            slopes[k, segment] = distance * math.sin(local), -distance * math.cos(local), 1.0
    slopes, springs = slopes.reshape(9, 9), each("tendon[{}].tendon_stiffness", 9)
    limit, z, tips = values["bending_friction"], rest.ravel().copy(), []
    sliders = rest[:, :2].copy()
    turn = Rotation.from_rotvec([values[f"base.rotation.{axis}"] for axis in "xyz"])
    for pull in pulls - each("motor[{}].offset", 9):

        def tensions(z: np.ndarray, pull: np.ndarray = pull) -> np.ndarray:
            return np.maximum(0.0, 2.0 + springs * (slopes @ z + pull))

        def energy(z: np.ndarray, sliders: np.ndarray = sliders) -> float:
            size = np.linalg.norm(z.reshape(3, 3)[:, :2] - sliders, axis=1)
            lost = np.where(size <= STICK, size**2 / (2 * STICK), size - STICK / 2).sum()
            beyond = z - rest.ravel()
            return 0.5 * stiffness.ravel() @ beyond**2 + np.sum(tensions(z) ** 2 / springs) / 2 + limit * lost

        for _ in range(200):
            tension, apart = tensions(z), z.reshape(3, 3)[:, :2] - sliders
            gradient = stiffness.ravel() * (z - rest.ravel()) + slopes.T @ tension
            taut = slopes[tension > 0.0]
            hessian = np.diag(stiffness.ravel()) + taut.T @ (springs[tension > 0.0, None] * taut)
            for segment, x in enumerate(apart):
                size, places = float(np.linalg.norm(x)), slice(3 * segment, 3 * segment + 2)
                along = np.outer(x, x) / size**2 if size > STICK else np.zeros((2, 2))
                gradient[places] += limit * x / max(size, STICK)
                hessian[places, places] += limit / max(size, STICK) * (np.eye(2) - along)
            step = -np.linalg.solve(hessian, gradient)
            if np.abs(step).max() < 1e-11:
                break
            share = 1.0
            while energy(z + share * step) > energy(z) + 1e-4 * share * gradient @ step and share > 1e-8:
                share /= 2.0
            z = z + share * step
        apart = z.reshape(3, 3)[:, :2] - sliders
        size = np.linalg.norm(apart, axis=1)[:, None]
        sliders = z.reshape(3, 3)[:, :2] - apart * np.minimum(1.0, STICK / np.maximum(size, STICK))
        pose = np.eye(4)
        for (a, b, e), length, about in zip(z.reshape(3, 3), LENGTHS, np.diff(turns, prepend=0.0), strict=True):
            pose = pose @ expm(np.array([[0, -about, 0, 0], [about, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0.0]]))
            pose = pose @ expm(np.array([[0, 0, b, 0], [0, 0, -a, 0], [-b, a, 0, length + e], [0, 0, 0, 0.0]]))
        marker = [values[f"marker.tip.offset.{axis}"] for axis in "xyz"]
        tips.append(turn.apply(pose[:3, :3] @ marker + pose[:3, 3]) + [values[f"base.position.{axis}"] for axis in "xyz"])
    return np.array(tips)


def test_the_fitted_robot_follows_its_commands_as_least_energy_says() -> None:
    """Sticks, slips and slack tendons in the first rows of validation; settled to 1e-10 of moments over 0.04 N m/rad."""
    values = {name: one["value"] for name, one in recorded("fit")["values"].items()}
    rows = rows_of("val")[np.arange(16)]
    parameters = ParameterSet.of(start(rubs=True), list(SETS.values())[-1], rows.markers)
    assert list(parameters.names) == list(values)
    seen = Predictor(parameters, rows).at(np.array(list(values.values()))).seen["positions.tip"].values
    assert np.allclose(seen, tips_by_least_energy(values, rows.q_motors), atol=1e-7)


def test_the_record_keeps_what_was_asked() -> None:
    """At most 6 mm on movements that the fit has not seen; the set of parameters has the least error on families left out."""
    fit, families = recorded("fit"), recorded("families")["sets"]
    assert fit["sets"]["val"]["offset_m"] <= 6.0e-3
    assert fit["message"] == "converged"
    assert fit["n_parameters"] == len(fit["values"]) == list(families.values())[-1]["parameters"]
    assert min(families, key=lambda name: families[name]["rms_m"]) == list(SETS)[-1]
    assert {name for name, *_ in PRIORS.items()} <= set(list(SETS.values())[-1])


@pytest.mark.parametrize(("name", "table"), [("fit", fit_table), ("families", compared_table)])
def test_the_page_shows_the_record(name: str, table: Any) -> None:
    page = (CHECKOUT / "docs" / "measured_arm.md").read_text(encoding="utf-8")
    assert f"\n\n{table(recorded(name))}\n\n<!-- measured_{name}:end -->\n" in page
    assert f"```sh\n{command()}\n```" in page
    assert (CHECKOUT / "docs" / "images" / "fitted_axes.png").stat().st_size > 10_000


def test_the_fit_starts_from_the_robot_of_the_folder() -> None:
    robot = read_robot(FOLDER / "robot.yaml")
    assert isinstance(robot, sr.TendonArm)
    assert robot == sr.TendonArm(elastic_sections=1, bending_friction=1e-3)
    assert start(rubs=False) == sr.TendonArm(elastic_sections=1)
