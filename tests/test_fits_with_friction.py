"""Fits of robots that remember: derivatives through the sliders of dry friction, rows in order, and where the base stands."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.identification import identify as fits
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.identification.suspicions import hints
from softrobots.statics import elastostatics
from softrobots.view.identification_page import IdentificationPage

ARM = {"segment_lengths": (0.06, 0.05), "elastic_sections": 1, "bending_friction": (2e-3, 1e-3)}


def wandering(rng: np.random.Generator, rows: int, **fields: Any) -> tuple[sr.TendonArm, sr.Measurements]:
    """An arm, and its tip at random pulls, each from where the last one left it."""
    arm = sr.TendonArm(**{**ARM, **fields})
    model = sr.load_model(arm)
    pulls = rng.uniform(-2e-3, 5e-3, (rows, model.n_motors))
    at, tips = None, []
    for pull in pulls:
        at = sr.solve_equilibrium(model, model.relaxed_motors - pull, previous=at, tolerance=1e-12)
        tips.append(at.tip_position)
    labels = [f"path {row // 10}" for row in range(rows)]
    return arm, sr.Measurements(pulls, tip_position=tips, relative=True, labels=labels, markers={"tip": "tip"})


NAMES = (
    "base.rotation", "marker.tip.offset", "offset[2]", "segment[*].bending_stiffness", "axial_stiffness", "motor[2].offset",
    "tendon[1,2].tendon_stiffness", "tendon[3].tendon_distance", "segment[1].rest_bend_x", "bending_friction",
)  # fmt: skip


@pytest.mark.study
def test_derivatives_go_through_what_friction_remembers(rng: np.random.Generator) -> None:
    """Central differences of whole paths; sliders turn within a stick of 1e-4 rad, which steps of 1e-6 see: about 1e-4."""
    arm, measured = wandering(rng, 20, bending_friction=2e-3, rest_bend_y=0.05)
    parameters = ParameterSet.of(arm, NAMES, measured.markers)
    predictor, values = Predictor(parameters, measured), np.array(parameters.values)
    predictor.refresh(values)
    slopes = predictor.at(values).slopes()["positions.tip"]
    for place, value in enumerate(values):
        step = 1e-6 * (abs(value) or 0.3)
        ends = [predictor.at(values + sign * step * np.eye(len(values))[place]).differences() for sign in (1, -1)]
        expected = (ends[0]["positions.tip"] - ends[1]["positions.tip"]) / (2.0 * step)
        assert np.abs(slopes[..., place] - expected).max() < 1e-3 * np.abs(expected).max(), parameters.names[place]
    loose = sr.TendonArm(**{**ARM, "bending_friction": 0.0})
    without = Predictor(ParameterSet.of(loose, NAMES[:-1], measured.markers), measured)
    without.refresh(values[:-1])
    missed = np.abs(without.at(values[:-1]).slopes()["positions.tip"] - slopes[..., :-1]).max(axis=(0, 1))
    assert np.any(missed > 0.1 * np.abs(slopes[..., :-1]).max(axis=(0, 1)))  # they are others without friction


def test_rows_that_stuck_are_found_at_once_at_other_values(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Movements there and back, values 1 % off: the same equilibria as from rest, where some rows are searched one by one."""
    arm, ramp = sr.TendonArm(**{**ARM, "bending_friction": 1e-2}), np.r_[0.0:1.0:6j, 1.0:0.0:6j]
    pulls = np.concatenate([np.outer(ramp, pull) for pull in rng.uniform(-2e-3, 8e-3, (4, 6))])
    measured = sr.Measurements(pulls, tip_position=np.zeros((48, 3)), relative=True, markers={"tip": "tip"})
    parameters, spent = ParameterSet.of(arm, NAMES, measured.markers), list[int]()
    values = parameters.values * (1.0 + 0.01 * rng.standard_normal(len(parameters.values)))
    search = elastostatics.solve_springs

    def counted(*arguments: Any, **options: Any) -> Any:
        found = search(*arguments, **options)
        spent.append(found[1])
        return found

    predictor = Predictor(parameters, measured)
    predictor.at(parameters.values)
    monkeypatch.setattr(elastostatics, "solve_springs", counted)
    found = predictor.at(values).at.strains
    assert not spent
    assert np.abs(found - Predictor(parameters, measured).at(values).at.strains).max() < 1e-8
    assert 0 < len(spent) <= 48


def test_a_robot_without_its_friction_has_the_parameters_but_those_change_nothing(rng: np.random.Generator) -> None:
    """Its rows are those of a robot that is described without friction, whatever the value of the friction."""
    arm, measured = wandering(rng, 5)
    names = ("segment[*].bending_friction", "segment[2].bending_stiffness", "base.position")
    calm = ParameterSet.of(arm, names, measured.markers).frictionless()
    loose = ParameterSet.of(sr.TendonArm(**{**ARM, "bending_friction": 0.0}), names[1:], measured.markers)
    assert calm.frictionless() is calm
    assert calm.names[:2] == ("segment[1].bending_friction", "segment[2].bending_friction")
    values = calm.values * np.array([3.0, 0.5, 1.1, 1.0, 1.0, 1.0])
    ours, theirs = Predictor(calm, measured), Predictor(loose, measured)
    seen = [one.at(some) for one, some in ((ours, values), (theirs, values[2:]))]
    np.testing.assert_allclose(*(one.differences()["positions.tip"] for one in seen), rtol=0.0, atol=1e-12)
    ours.refresh(values)
    assert not np.any(seen[0].slopes()["positions.tip"][..., :2])


@pytest.mark.study
def test_friction_is_fitted_to_rows_in_order(rng: np.random.Generator) -> None:
    """Without noise the moments of friction and the stiffness come back; rows kept aside are predicted where they stand."""
    arm, measured = wandering(rng, 40)
    names = ("segment[*].bending_friction", "segment[2].bending_stiffness", "motor[3].offset")
    start = sr.TendonArm(**{**ARM, "bending_friction": 1.2e-3})
    aside = np.array([label == "path 2" for label in measured.labels or ()])
    fit = sr.identify(start, measured, names, validation=aside)
    assert fit.values["segment[1].bending_friction"] == pytest.approx(2e-3, rel=1e-3)
    assert fit.values["segment[2].bending_friction"] == pytest.approx(1e-3, rel=1e-3)
    assert fit.values["segment[2].bending_stiffness"] == pytest.approx(arm.bending_in_force[1], rel=1e-3)
    assert fit.validation is not None
    assert fit.validation.residuals["positions.tip"].shape == (10, 3)
    assert np.abs(fit.validation.residuals["positions.tip"]).max() < 2e-5


def test_rows_kept_aside_are_shown_where_they_stand_and_masked_ones_arouse_no_suspicion(
    rng: np.random.Generator, tmp_path: Path
) -> None:
    """All rows happen, one after the other; a position that is masked is a metre off."""
    arm, measured = wandering(rng, 30)
    tips, mask = np.array(measured.measured["positions.tip"]), np.arange(30) != 4
    tips[~mask] += 1.0
    rows = sr.Measurements(**measured.arguments() | {"tip_position": tips, "positions": None, "mask": mask})
    fit = sr.identify(arm, rows, "segment[2].bending_stiffness", validation="path 1", max_iterations=3)
    assert hints(fit) == []
    robot, now = fit.model, None
    assert fit.validation is not None
    for row, pull in enumerate(rows.q_motors[:20]):
        now = sr.solve_equilibrium(robot, robot.relaxed_motors - pull, previous=now, tolerance=1e-12)
        if row >= 10:  # the rounding of the moments of friction over the softest direction
            assert np.abs(fit.validation.states.q_springs[row - 10] - now.q_springs).max() < 1e-8
    sr.save_result(fit, tmp_path / "fit.npz")
    with pytest.raises(sr.ParameterError, match=r"aside.*came before"):
        IdentificationPage(sr.load_result(tmp_path / "fit.npz"), aside=True)


def test_rows_without_an_equilibrium_are_told_and_the_others_follow_one_another(rng: np.random.Generator) -> None:
    """Tendons on both sides are pulled in by half the length of the arm; what comes after comes from the last row before."""
    arm, measured = wandering(rng, 6)
    model, pulls = sr.load_model(arm), np.array(measured.q_motors)
    pulls[3] = np.resize([0.05, -0.05], model.n_motors)
    rows = sr.Measurements(**measured.arguments() | {"q_motors": pulls})
    with pytest.raises(sr.ParameterError, match=r"not row 3\): start elsewhere, or leave these out;"):
        sr.identify(arm, rows, "axial_stiffness")
    fit = sr.identify(arm, measured, "axial_stiffness", validation=rows, max_iterations=1)
    assert fit.validation is not None
    assert fit.validation.lost == [3]
    np.testing.assert_array_equal(fit.validation.states.q_springs[3], fit.model.rest)
    others = np.delete(np.arange(6), 3)
    one = Predictor(ParameterSet.of(fit.model, "base.position", {}), measured[others]).at(np.zeros(3))
    np.testing.assert_allclose(fit.validation.states.q_springs[others], one.at.strains, rtol=0.0, atol=1e-8)


@pytest.mark.study
def test_a_search_begins_anew_where_that_without_friction_has_gone_too_far(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without friction twice the stiffness is told, of which the robot with friction has no equilibria."""
    arm, measured = wandering(rng, 20)
    true = arm.bending_in_force[1]
    start = sr.TendonArm(**ARM, bending_stiffness=(arm.bending_in_force[0], 1.1 * true))
    solved, searched = Predictor._solve, fits._best

    def solve(predictor: Predictor, model: sr.SoftModel, values: np.ndarray) -> Any:
        if predictor.in_order and values[0] > 1.5 * true:
            raise sr.ParameterError("measurements", values, "rows with an equilibrium")
        return solved(predictor, model, values)

    def search(predictor: Predictor, *others: Any) -> Any:
        found = searched(predictor, *others)
        if not predictor.in_order:
            found.course.append((found.cost, np.array([2.0 * true])))
        return found

    monkeypatch.setattr(Predictor, "_solve", solve)
    monkeypatch.setattr(fits, "_best", search)
    found = sr.identify(start, measured, "segment[2].bending_stiffness")
    assert found.values["segment[2].bending_stiffness"] == pytest.approx(true, rel=1e-3)  # kinks where rows begin to slip


@pytest.mark.study
def test_a_robot_that_stands_turned_away_is_found(rng: np.random.Generator) -> None:
    """Half a turn from where the fit begins, least squares alone end beside the best."""
    _, measured = wandering(rng, 15, bending_friction=0.0)
    pose = Rotation.from_rotvec((0.2, -0.1, 3.0))
    shift = np.array([0.1, -0.2, 0.3])
    seen = pose.apply(np.array(measured.measured["positions.tip"])) + shift
    other = sr.Measurements(measured.q_motors, tip_position=seen, relative=True)
    start = sr.TendonArm(**{**ARM, "bending_friction": 0.0}, bending_stiffness=2e-3)
    fit = sr.identify(start, other, ("base.position", "base.rotation", "bending_stiffness"))
    values = fit.values
    turn = Rotation.from_rotvec([values[f"base.rotation.{axis}"] for axis in "xyz"])
    assert (turn * pose.inv()).magnitude() < 1e-6
    assert np.allclose([values[f"base.position.{axis}"] for axis in "xyz"], shift, atol=1e-7)
    assert values["bending_stiffness"] == pytest.approx(50e9 * math.pi * 0.0005**4 / 4.0, rel=1e-5)
