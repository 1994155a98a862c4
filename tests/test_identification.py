"""Fits of parameters: robots give their own parameters back, and results say how well they are known."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

import softrobots as sr
from softrobots.identification.identify import LOSSES
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.identification.weights import rho
from softrobots.robots.parameter_file import read_robot, write_parameters
from tests.conftest import CHECKOUT
from tests.support.laws import law

GRAVITY = np.array(sr.EARTH_GRAVITY)
MARKERS = {"led": "tip"}


def measured(
    parameters: ParameterSet, values: Any, commanded: Any, forces: Any, *, std: float = 0.0, seed: int = 0, **more: Any
) -> sr.Measurements:
    """What a camera and torque sensors see of a robot with these values, by `solve_equilibrium`, with noise."""
    values, random = np.asarray(values, dtype=float), np.random.default_rng(seed)
    model = parameters.model(values)
    position, turn = parameters.base(values)
    rotation, offset = pin.exp3(turn), parameters.marker_offset(values, "led")
    tips, leds, poses, torques = [], [], [], []
    for motors, force in zip(commanded, forces, strict=True):
        at = np.asarray(motors) + parameters.motor_offsets(values)
        found = sr.solve_equilibrium(model, at, rotation.T @ force, gravity=rotation.T @ GRAVITY, tolerance=1e-13)
        tip = found.transform_tip_to_world
        tips.append(rotation @ tip.translation + position)
        leds.append(rotation @ (tip.translation + tip.rotation @ offset) + position)
        poses.append(pin.SE3(rotation @ tip.rotation, tips[-1]).homogeneous)
        torques.append(found.motor_torques)
    noise = [np.array(one) + std * random.standard_normal(np.shape(one)) for one in (tips, leds, torques)]
    seen = {
        "tip_position": noise[0],
        "positions": {"led": noise[1]},
        "motor_torques": noise[2],
        "poses": {"tip": np.array(poses)},
    }
    kept = more.pop("seen", tuple(seen))
    given = {"force": forces, "gravity": GRAVITY, "markers": MARKERS} | more
    return sr.Measurements(commanded, **given, **{name: seen[name] for name in kept})


def rows(n: int, limits: Sequence[float], force: float, seed: int = 1) -> tuple[Any, Any]:
    """Random commands within plus and minus limits, and forces."""
    random = np.random.default_rng(seed)
    return random.uniform(-1.0, 1.0, (n, len(limits))) * np.array(limits), random.normal(0.0, force, (n, 3))


ARM = sr.InflatableArm(stiffness=170.0)
FOREIGN = sr.load_model(ARM.urdf())
PCC = sr.PccArm(kind="tension", elastic_sections=1)
TENDON = sr.TendonArm(elastic_sections=1, segment_lengths=(0.08, 0.09))
TUBE = sr.HelixTube(length=0.3, elastic_sections=5, actuator="elastic")

OWN = {
    "arm": (
        ARM,
        ("link[*].stiffness", "link[*].link_lengths", "hinge_offset", "base.position", "base.rotation", "marker.led.offset",
         "motor[2,3].offset"),
        [130.0, 210.0, 0.66, 0.52, 0.04, 0.1, -0.2, 0.05, 0.05, -0.1, 0.3, 0.02, 0.03, -0.04, 0.03],
        *rows(10, (0.9, 0.9, 0.9), 6.0),
    ),
    "pcc": (
        PCC,
        ("segment[*].bending_stiffness", "torsional_stiffness", "segment[2].segment_lengths", "muscle_distance", "offset"),
        [2.6, 1.4, 1.7, 0.45, 0.05, 1.2],
        *rows(10, (12.0,) * 6, 1.0),
    ),
    "tendons": (
        TENDON,
        ("young_modulus", "tendon_stiffness", "tendon[2].tendon_pretension", "tendon_distance", "base.rotation.z",
         "linear_density"),
        [40e9, 6e3, 2.7, 0.0055, 0.2, 0.35],
        *rows(6, (4e-4,) * 6, 0.02),
    ),
    "tube": (
        TUBE,
        ("bending_stiffness", "diameter", "density"),
        [0.03, 0.04, 1200.0],
        *rows(4, (1e-4, 1e-4, 0.0), 0.05),
    ),
    "foreign": (
        FOREIGN,
        ("joint[*].stiffness", "joint[spring_1_up].rest", "base.position.z"),
        [140.0, 200.0, 150.0, 220.0, 0.05, 0.1],
        *rows(8, (0.9, 0.9, 0.9), 6.0),
    ),
}  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize("name", OWN)
def test_a_robot_gives_its_own_parameters_back(name: str) -> None:
    robot, names, true, commanded, forces = OWN[name]
    if name == "tube":
        robot = replace(robot, bending_stiffness=0.025)
    chosen = ParameterSet.of(robot, names, MARKERS)
    if name in ("tendons", "tube"):
        commanded = sr.load_model(robot).relaxed_motors + commanded
    seen = ("positions", "motor_torques") if name == "arm" else ("tip_position", "poses")
    data = measured(chosen, true, commanded, forces, std=0.0, seen=seen if name != "pcc" else ("tip_position",))
    found = sr.identify(robot, data, names)
    scale = np.where(chosen.logarithmic, np.abs(true), 1.0)
    assert found.message == "converged"
    np.testing.assert_allclose((found.solution - true) / scale, 0.0, atol=1e-9)  # the promise of the guide
    assert found.unidentifiable == ()
    assert found.model == chosen.model(found.solution)


@pytest.mark.study
@law("identify", "Identification")
@settings(max_examples=4)
@given(
    true=st.tuples(st.floats(90.0, 290.0), st.floats(90.0, 290.0), st.floats(0.45, 0.75), st.floats(-0.1, 0.1)),
    seed=st.integers(0, 99),
)
def test_any_arm_gives_its_own_parameters_back(true: tuple[float, ...], seed: int) -> None:
    names = ("link[*].stiffness", "link[1].link_lengths", "motor[1].offset")
    commanded, forces = rows(6, (0.9, 0.9, 0.9), 6.0, seed)
    data = measured(ParameterSet.of(ARM, names), true, commanded, forces, seen=("tip_position", "motor_torques"))
    found = sr.identify(ARM, data, names)
    assert isinstance(found, sr.Identification)
    np.testing.assert_allclose(found.solution, true, rtol=1e-9, atol=1e-9)
    assert all(low <= value <= high for value, (low, high) in zip(found.solution, found.intervals.values(), strict=True))
    assert found.robot.stiffness == pytest.approx(true[:2], rel=1e-9)


@pytest.mark.study
def test_what_twelve_tips_tell_weakly_comes_back_too() -> None:
    """Masses of caps and fabric under small loads: a valley of the cost that is narrow, 1 to 5000, and bends."""
    names, true = ("link[*].stiffness", "hinge_offset", "cap_mass", "density"), [130.0, 210.0, 0.04, 0.3, 1300.0]
    data = measured(ParameterSet.of(ARM, names), true, *rows(12, (0.9, 0.9, 0.9), 1.0), seen=("tip_position",))
    found = sr.identify(ARM, data, names)
    assert found.message == "converged"
    np.testing.assert_allclose(found.solution, true, rtol=1e-9)


@pytest.mark.parametrize("count", [40, 120])
def test_masses_that_are_told_only_together_end_at_the_lowest_point_within_their_bounds(count: int) -> None:
    """A valley that bends in the logarithm of the density; along it the cap would lose more than it weighs, with few rows.

    Of more than a hundred rows a few are fitted first, and full steps of all of them begin there.
    """
    names, true = ("stiffness", "density", "cap_mass"), [150.0, 1500.0, 0.13]
    data = measured(
        ParameterSet.of(ARM, names), true, *rows(count, (0.9, 0.9, 0.9), 3.0), std=1e-3, seed=4, seen=("tip_position",)
    )
    found = sr.identify(ARM, data, names)
    assert found.message == "converged"
    chosen = ParameterSet.of(ARM, names)

    def residuals(values: Any) -> Any:  # without our derivatives
        return Predictor(chosen, data).at(values * true).differences()["positions.tip"].ravel() * 1e3

    at = np.append(found.solution[:2], max(found.solution[2], 1e-9)) / true
    theirs = least_squares(residuals, at, bounds=(0.0, np.inf), xtol=1e-12, ftol=1e-12, gtol=1e-12, x_scale=1e-3)
    assert count > 40 or found.solution[2] == pytest.approx(0.0, abs=1e-9)
    assert np.sum(residuals(found.solution / true) ** 2) <= 2.0 * theirs.cost * (1.0 + 1e-6)  # 1e-8 is where fits end


LINKS = ("joint[spring_1_side,spring_1_up].stiffness", "joint[spring_2_side,spring_2_up].stiffness")
SOME = ("link[*].stiffness", "base.position", "base.rotation", "marker.led.offset", "motor[2].offset")
TRUE = [150.0, 200.0, 0.1, -0.2, 0.05, 0.05, -0.1, 0.3, 0.02, 0.03, -0.04, 0.03]


def test_derivatives_of_everything_measured_are_those_of_differences() -> None:
    chosen = ParameterSet.of(ARM, SOME, MARKERS)
    data = measured(chosen, TRUE, *rows(3, (0.9, 0.9, 0.9), 6.0))
    values = np.array(TRUE) + 0.01
    predictor = Predictor(chosen, data)
    predictor.refresh(values)
    slopes = predictor.at(values).slopes()
    assert set(slopes) == {"positions.tip", "positions.led", "poses.tip", "motor_torques"}
    for number, value in enumerate(values):
        step = 1e-5 * max(abs(value), 1.0)
        ends = [predictor.at(values + sign * step * np.eye(len(values))[number]).differences() for sign in (1.0, -1.0)]
        for key, one in slopes.items():
            central = (ends[0][key] - ends[1][key]) / (2.0 * step)
            np.testing.assert_allclose(one[..., number], central, rtol=1e-7, atol=2e-7, err_msg=f"{key} {number}")  # rounding


def test_pulls_are_measured_from_the_relaxed_length_that_is_fitted() -> None:
    names = ("segment[2].segment_lengths", "young_modulus")
    chosen, (pulls, forces) = ParameterSet.of(TENDON, names), rows(6, (4e-4,) * 6, 0.02)
    true = [0.07, 40e9]
    lengths = chosen.model(true).relaxed_motors - pulls
    given = measured(chosen, true, lengths, forces, seen=("tip_position",))
    data = sr.Measurements(pulls, relative=True, force=forces, gravity=GRAVITY, tip_position=given.measured["positions.tip"])
    np.testing.assert_allclose(sr.identify(TENDON, data, names).solution, true, rtol=1e-9)


@pytest.mark.study
def test_rows_of_a_robot_with_dry_friction_come_in_order() -> None:
    robot = replace(TENDON, bending_friction=4e-3)
    names, true = ("young_modulus", "bending_friction"), [40e9, 6e-3]
    chosen = ParameterSet.of(robot, names)
    model, pulls = chosen.model(true), np.outer([0.0, 1.0, 2.0, 1.0, 0.0, -1.0, 0.0], [8e-4, -4e-4, -4e-4] * 2)
    commanded, tips, before = model.relaxed_motors - pulls, [], None
    for motors in commanded:
        before = sr.solve_equilibrium(model, motors, previous=before, tolerance=1e-12)
        tips.append(before.tip_position)
    assert np.linalg.norm(tips[4] - tips[0]) > 1e-3  # it remembers
    data = sr.Measurements(commanded, tip_position=tips)
    found = sr.identify(robot, data, names, validation=np.arange(7) == 5)
    np.testing.assert_allclose(found.solution, true, rtol=1e-8)
    assert found.validation is not None
    assert found.validation.errors["positions.tip"][0] < 1e-10
    assert found.fitted.n_counted == 6


@pytest.fixture(scope="module")
def noisy() -> sr.Measurements:
    """Twenty rows of an arm with a millimetre of noise, in five blocks."""
    chosen = ParameterSet.of(FOREIGN, (*LINKS, "motor[2].offset"))
    commanded, forces = rows(20, (0.9, 0.9, 0.9), 8.0)
    labels = [f"block {row // 4}" for row in range(20)]
    return measured(chosen, [150.0, 200.0, 0.02], commanded, forces, std=1e-3, seen=("tip_position",), labels=labels)


def test_unknown_noise_is_found_from_the_residuals(noisy: sr.Measurements) -> None:
    names = (*LINKS, "motor[2].offset")
    known = {key: value for key, value in noisy.arguments().items() if key != "std"}
    unknown = sr.identify(FOREIGN, noisy, names)
    told = sr.identify(FOREIGN, sr.Measurements(**known, std={"tip_position": 1e-3}), names)
    np.testing.assert_allclose(unknown.solution, told.solution, rtol=1e-5)  # one quantity: its weight does not matter
    squares = float(np.nansum(told.residuals["positions.tip"] ** 2))
    np.testing.assert_allclose(unknown.covariance, told.covariance * squares / (60 - 3) / 1e-6, rtol=1e-4)
    assert unknown.by_rows.freedoms == pytest.approx(57.0)
    assert told.by_rows.freedoms == np.inf
    for name, value in ((LINKS[0], 150.0), (LINKS[1], 200.0), ("motor[2].offset", 0.02)):
        low, high = told.intervals[name]
        assert low < told.values[name] < high
        assert low < value < high  # with this noise; scripts/studies count how often
    assert told.block_covariance is not None
    assert told.fitted.errors["positions.tip"][0] == pytest.approx(np.sqrt(3) * 1e-3, rel=0.2)


@pytest.mark.study
def test_a_robust_loss_is_not_led_by_outliers_and_tells_them(noisy: sr.Measurements) -> None:
    arguments = noisy.arguments() | {"std": {"positions.tip": 1e-3}}
    tips = np.array(arguments["positions"]["tip"])
    tips[[3, 11]] += (0.2, -0.1, 0.15)
    data = sr.Measurements(**(arguments | {"positions": {"tip": tips}}))
    names = (*LINKS, "motor[2].offset")
    clean = sr.identify(FOREIGN, noisy, names).solution
    fits = {loss: sr.identify(FOREIGN, data, names, loss=loss) for loss in ("linear", "huber", "cauchy")}
    errors = {loss: np.abs(found.solution / clean - 1.0).max() for loss, found in fits.items()}
    assert errors["huber"] < 0.2 * errors["linear"]
    assert errors["cauchy"] < 0.05 * errors["linear"]
    found = fits["cauchy"]
    assert set(found.outliers) == {3, 11}
    assert "outliers (2 rows): row" in found.summary()


def test_losses_are_those_of_scipy() -> None:
    from scipy.optimize import least_squares

    random = np.random.default_rng(3)
    matrix, right = random.standard_normal((30, 2)), 3.0 * random.standard_normal(30)
    for loss in LOSSES:
        own, theirs = (
            least_squares(lambda x: matrix @ x - right, np.zeros(2), lambda x: matrix, loss=one, xtol=1e-12)
            for one in (lambda z, loss=loss: rho(loss, z), loss)
        )
        np.testing.assert_allclose(own.x, theirs.x, rtol=1e-9)
        assert own.cost == pytest.approx(theirs.cost, rel=1e-12)


def test_priors_hold_what_the_measurements_do_not_tell(noisy: sr.Measurements) -> None:
    names = ("stiffness", "cap_mass", "base.position")
    weightless = {key: value for key, value in noisy.arguments().items() if key != "gravity"}
    data = sr.Measurements(**weightless)
    found = sr.identify(ARM, data, names, priors={"cap_mass": (0.2, 0.01), "base.position": (0.0, [1e-9, 1e-9, 1e9])})
    assert found.values["cap_mass"] == pytest.approx(0.2, abs=1e-9)
    np.testing.assert_allclose(found.solution[2:4], 0.0, atol=1e-6)
    assert abs(found.values["base.position.z"]) > 1e-5
    low, high = found.intervals["cap_mass"]
    assert (high - low) / 2.0 == pytest.approx(0.01 * 1.96, rel=0.1)  # Student's t with many freedoms
    assert found.held == 0
    assert "0.2 +- 0.01" in found.summary()


def test_what_cannot_be_told_apart_keeps_its_start_and_is_named() -> None:
    names = ("stiffness", "base.rotation.z", "motor[1].offset", "cap_mass")
    chosen, (commanded, forces) = ParameterSet.of(ARM, ("stiffness",)), rows(8, (0.9, 0.9, 0.9), 0.0)
    forces[:, 2] = np.linspace(-9.0, 9.0, 8)
    true = measured(chosen, [210.0], commanded, forces, seen=("tip_position",))
    tips = true.measured["positions.tip"] @ pin.exp3(np.array([0.0, 0.0, 0.1])).T
    data = sr.Measurements(commanded, force=forces, tip_position=tips, gravity=GRAVITY)
    found = sr.identify(ARM, data, names)
    assert found.values["stiffness"] == pytest.approx(210.0, rel=1e-9)
    assert found.values["cap_mass"] == pytest.approx(0.1, rel=1e-8)
    assert found.held == 1
    # forces along z are the same however the base is turned: the yaw splits evenly, the least change
    np.testing.assert_allclose([found.values["base.rotation.z"], found.values["motor[1].offset"]], 0.05, atol=1e-9)
    (text,) = found.unidentifiable
    assert "base.rotation.z" in text
    assert "motor[1].offset" in text
    assert found.intervals["base.rotation.z"] == (-np.inf, np.inf)
    assert "not determined" in found.summary()


def test_rows_kept_aside_are_told_apart(noisy: sr.Measurements) -> None:
    names, aside = LINKS, np.arange(20) >= 12
    by_mask, by_label, by_other = (
        sr.identify(FOREIGN, data, names, validation=validation)
        for data, validation in ((noisy, aside), (noisy, ["block 3", "block 4"]), (noisy[~aside], noisy[aside]))
    )
    for one in (by_label, by_other):
        np.testing.assert_array_equal(one.solution, by_mask.solution)
        assert one.validation is not None
        assert one.validation.errors == by_mask.validation.errors  # type: ignore[union-attr]
    assert len(by_mask.fitted.measurements) == 12
    tips = [sr.solve_equilibrium(by_mask.model, q, f, gravity=GRAVITY).tip_position
            for q, f in zip(noisy.q_motors[aside], noisy.loads["force"][aside], strict=True)]  # fmt: skip
    np.testing.assert_allclose(by_mask.validation.predicted["positions.tip"], tips, atol=1e-10)  # type: ignore[union-attr]
    assert "8 rows kept aside" in by_mask.summary()
    masked = sr.Measurements(**(noisy.arguments() | {"mask": ~aside}))
    np.testing.assert_array_equal(sr.identify(FOREIGN, masked, names).solution, by_mask.solution)


@pytest.mark.study
def test_the_best_of_several_starts_counts(noisy: sr.Measurements) -> None:
    one, several = (sr.identify(FOREIGN, noisy, LINKS, starts=starts, seed=2) for starts in (1, 3))
    np.testing.assert_allclose(one.solution, several.solution, rtol=1e-4)
    assert several.history.cost[-1] <= one.history.cost[-1] * (1.0 + 1e-8)


def test_an_interrupted_fit_gives_what_there_is(noisy: sr.Measurements, monkeypatch: pytest.MonkeyPatch) -> None:
    calls, solve = [0], Predictor.refresh

    def interrupted(self: Predictor, values: Any) -> None:
        calls[0] += 1
        if calls[0] == 3:
            raise KeyboardInterrupt
        solve(self, values)

    monkeypatch.setattr(Predictor, "refresh", interrupted)
    found = sr.identify(FOREIGN, noisy, LINKS)
    assert found.message.startswith("interrupted")
    assert found.history.cost[-1] < found.history.cost[0]
    assert np.isfinite(found.covariance).all()


def test_a_fit_is_saved_and_loaded(noisy: sr.Measurements, tmp_path: Path) -> None:
    names = ("link[*].stiffness", "base.rotation.z", "cap_mass")
    found = sr.identify(ARM, noisy, names, validation=["block 4"], priors={"cap_mass": (0.1, 0.02)})
    for name in ("a.npz", "a.json"):
        file = sr.save_result(found, tmp_path / name)
        again = sr.load_result(file)
        assert again.robot == found.robot
        assert again.model == found.model
        assert again.summary() == found.summary()
        assert again.parameters == found.parameters
        np.testing.assert_array_equal(again.covariance, found.covariance)
        np.testing.assert_array_equal(again.history.values, found.history.values)
    foreign = sr.identify(FOREIGN, noisy, "joint[spring_1_up].stiffness")
    assert sr.load_result(sr.save_result(foreign, tmp_path / "b.npz")).robot is None


def test_the_fitted_robot_is_written_as_a_file_of_parameters(noisy: sr.Measurements, tmp_path: Path) -> None:
    found = sr.identify(ARM, noisy, "link[*].stiffness")
    write_parameters(tmp_path / "robot.yaml", "inflatable_arm", dataclasses.asdict(found.robot))
    assert read_robot(tmp_path / "robot.yaml") == found.robot


@pytest.mark.parametrize(
    ("names", "more", "kind", "words"),
    [
        ("force", {}, sr.ParameterError, "measurements give those"),
        ("motor[1]", {}, sr.ParameterError, "measurements give those"),
        ("stiffness", {"loss": "l1"}, sr.ParameterError, "soft_l1"),
        ("stiffness", {"priors": {"radius": (0.05, 0.01)}}, sr.NameNotFound, "stiffness"),
        ("stiffness", {"priors": {"stiffness": 170.0}}, sr.ParameterError, "mean and standard deviation"),
        ("stiffness", {"priors": {"stiffness": (170.0, 0.0)}}, sr.ParameterError, r"positive \[N m/rad\]"),
        ("wrist_mass", {}, sr.ParameterError, r"so that it has derivatives \(wrist_mass = .* without a wrist"),
        ("base.position", {"priors": {"base.position": ([0.0, 1.0], 1.0)}}, sr.ParameterError, r"shape \(3,\)"),
        ("base.position", {"priors": {"base.position": (0, 1), "base.position.x": (0, 1)}}, sr.ParameterError, "one for each"),
        ("stiffness", {"validation": np.ones(3, bool)}, sr.ParameterError, "mask of shape"),
        ("stiffness", {"validation": np.ones(20, bool)}, sr.ParameterError, "rows on both sides"),
        ("stiffness", {"validation": "block 9"}, sr.NameNotFound, "block 4"),
        ("stiffness", {"starts": 0}, sr.ParameterError, "positive integer"),
    ],
)
def test_what_cannot_be_fitted_is_refused(
    noisy: sr.Measurements, names: Any, more: dict[str, Any], kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        sr.identify(ARM, noisy, names, **more)


def test_intervals_cover_as_often_as_they_say() -> None:
    """The record of `scripts/identification_errors.py`: 95 %, within what chance leaves of a thousand fits."""
    recorded = json.loads((CHECKOUT / "docs" / "validation" / "identification_coverage.json").read_text(encoding="utf-8"))
    assert recorded["fits"] == 1000
    independent, in_blocks = recorded["noises"].values()
    for row in independent:
        assert 0.93 <= min(row["rows"], row["blocks"]) <= max(row["rows"], row["blocks"]) <= 0.97, row
    for row in in_blocks:
        assert row["rows"] < 0.9 < 0.93 <= row["blocks"] <= 0.97, row


def test_a_combination_that_has_moved_is_not_said_to_have_kept_its_start() -> None:
    """Under forces of the wrong sign the stiffness grows until they have no effect."""
    random, arm = np.random.default_rng(4), sr.load_model(sr.InflatableArm(stiffness=190.0))
    motors, forces = random.uniform(-0.6, 0.6, (15, 3)), random.normal(size=(15, 3))
    tips = [sr.solve_equilibrium(arm, q, force).tip_position for q, force in zip(motors, forces, strict=True)]
    found = sr.identify(
        sr.InflatableArm(stiffness=170.0), sr.Measurements(motors, force=-forces, tip_position=tips), "stiffness"
    )
    assert found.values["stiffness"] > 1700.0
    assert found.unidentifiable
    assert found.held == 0
    assert "kept their start" not in found.summary()


def test_errors_of_positions_with_missing_cells_are_those_of_what_is_there(noisy: sr.Measurements) -> None:
    """Cells that are missing at random leave the error as it is, within chance; a column that is missing adds nothing."""
    found = sr.identify(ARM, noisy, "stiffness")
    left = found.residuals["positions.tip"]
    whole = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    assert found.fitted.errors["positions.tip"][0] == pytest.approx(whole, rel=1e-12)
    random, few = np.random.default_rng(1), []
    for _ in range(400):
        gaps = np.where(random.uniform(size=left.shape) < 0.4, np.nan, left)
        few.append(found.fitted._replace(residuals={"positions.tip": gaps}).errors["positions.tip"][0] ** 2)
    assert np.mean(few) == pytest.approx(whole**2, rel=4.0 * np.std(few) / np.mean(few) / 20.0)
    gaps = left * [1.0, np.nan, 1.0]
    only = found.fitted._replace(residuals={"positions.tip": gaps}).errors["positions.tip"][0]
    assert only == pytest.approx(float(np.sqrt(np.mean(np.sum(left[:, [0, 2]] ** 2, axis=1)))), rel=1e-12)


def test_no_loss_warns_of_numbers_too_large_to_square_or_infinite() -> None:
    """pytest turns warnings into errors."""
    for loss in ("linear", "soft_l1", "huber", "cauchy", "arctan"):
        values = rho(loss, np.array([0.0, 1.0, 1e100, 1e200, np.inf]))
        assert not np.isnan(values).any()
        assert np.all(np.diff(values[0]) >= 0.0)


def test_one_row_tells_three_combinations_and_the_rest_keeps_its_start() -> None:
    data = sr.Measurements([[0.3, 0.4, -0.5]], force=[[1.0, 8.0, -9.0]], tip_position=[[0.9, 0.35, 0.02]])
    names = ("link[*].stiffness", "base.position", "motor[2].offset")
    found = sr.identify(ARM, data, names)
    assert found.held == 3
    assert np.abs(found.residuals["positions.tip"]).max() < 1e-9
    assert all(np.isinf(high) for _, high in found.intervals.values())
    assert found.by_blocks is None
    assert "not determined" in found.summary()
    with pytest.raises(sr.ParameterError, match="at least one number"):
        sr.identify(ARM, sr.Measurements(np.zeros((2, 3)), tip_position=[[np.nan] * 3, [1.0] * 3], mask=[True, False]), names)


def test_a_search_does_not_run_off_along_what_noise_hides() -> None:
    """Six noisy tips prefer an infinite torsional stiffness by less than noise: it stays near the start, and is named."""
    random, model = np.random.default_rng(1), sr.load_model(PCC)
    commanded, forces = random.uniform(0.0, 12.0, (6, 6)), random.normal(0.0, 0.5, (6, 3))
    every = [sr.solve_equilibrium(model, *one, gravity=GRAVITY) for one in zip(commanded, forces, strict=True)]
    tips = np.array([one.tip_position for one in every]) + 1e-3 * random.standard_normal((6, 3))
    data = sr.Measurements(commanded, force=forces, gravity=GRAVITY, tip_position=tips, std=1e-3)
    found = sr.identify(PCC, data, ("torsional_stiffness", "bending_stiffness"))
    start, (low, high) = PCC.torsional_stiffness[0], found.intervals["torsional_stiffness"]
    assert start / 3.0 < found.values["torsional_stiffness"] < 3.0 * start
    assert low == 0.0
    assert start < high < 100.0 * start
    assert [text for text in found.unidentifiable if text.startswith("torsional_stiffness: almost no effect")]
    assert found.history.cost[-1] < found.history.cost.min() + 2.0  # two standard deviations


def test_a_length_that_may_be_zero_has_an_interval_from_zero_on() -> None:
    """A hinge at 2 mm, told to some 50 mm: the interval of its logarithm would reach from 1e-5 to 22 m."""
    true = replace(ARM, hinge_offset=0.002)
    commanded, forces = rows(8, (0.8, 0.8, 0.8), 5.0)
    data = measured(ParameterSet.of(true, "stiffness"), [170.0], commanded, forces, seen=("tip_position",))
    noisy = np.array(data.measured["positions.tip"]) + 2e-3 * np.random.default_rng(0).standard_normal((8, 3))
    again = sr.Measurements(commanded, force=forces, gravity=GRAVITY, tip_position=noisy, std=2e-3)
    low, high = sr.identify(replace(true, hinge_offset=0.04), again, ("stiffness", "hinge_offset")).intervals["hinge_offset"]
    assert 0.0 <= low < 0.002 < high < 0.3


def test_a_robot_without_actuators_gives_its_stiffness_back_from_a_file(tmp_path: Path) -> None:
    rod = sr.HelixTube(bending_stiffness=0.03, elastic_sections=6)
    commanded, forces = np.zeros((3, 0)), rows(3, (1.0,), 0.03)[1]
    chosen = ParameterSet.of(replace(rod, bending_stiffness=0.04), "bending_stiffness")
    data = measured(chosen, [0.03], commanded, forces, seen=("tip_position",))
    read = sr.Measurements.from_csv(data.to_csv(tmp_path / "rod.csv"))
    assert read.q_motors.shape == (3, 0)
    assert sr.identify(chosen.present.robot, read, "bending_stiffness").solution == pytest.approx([0.03], rel=1e-9)
    sensitivity = sr.sensitivity(chosen.present, sr.solve_equilibrium(chosen.present, (), forces[0]), "bending_stiffness")
    assert np.all(sensitivity.tip_position != 0.0)


def test_a_fit_that_starts_at_the_truth_has_no_outliers() -> None:
    """Differences of rounding alone are no standard deviation."""
    commanded, forces = rows(12, (0.8, 0.8, 0.8), 5.0)
    data = measured(ParameterSet.of(ARM, "stiffness"), [170.0], commanded, forces, seen=("tip_position",))
    found = sr.identify(ARM, data, ("stiffness", "base.rotation"))
    assert found.outliers == ()
    assert np.ptp(found.intervals["base.rotation.x"]) < 1e-9


def test_rows_without_an_equilibrium_are_named() -> None:
    arm = sr.InflatableArm(stiffness=170.0, max_moment=10.0)
    data = sr.Measurements(np.zeros((3, 3)), wrench=[[0.0] * 6, [0, 0, 0, 0, 90.0, 0], [0.0] * 6], tip_position=np.ones((3, 3)))
    with pytest.raises(sr.ParameterError, match=r"not row 1.*mask"):
        sr.identify(arm, data, "stiffness")


def test_a_row_kept_aside_without_an_equilibrium_is_told_and_ends_no_fit(tmp_path: Path) -> None:
    """The others are predicted as if it were not there; nor does a file of the fit lose it."""
    arm = sr.InflatableArm(stiffness=170.0, max_moment=10.0)
    model, motors = sr.load_model(arm), np.array([[0.1, 0.3, -0.2], [0.5, 0.2, 0.4], [0.0, -0.4, 0.3], [0.3, 0.1, 0.1]])
    tips = [sr.solve_equilibrium(model, one, (0.0, 0.0, -2.0)).tip_position for one in motors]
    loads = np.tile((0.0, 0.0, -2.0, 0.0, 0.0, 0.0), (4, 1))
    rows = sr.Measurements(motors, wrench=loads, tip_position=tips, std=1e-3)
    loads[1] = (0.0, 0.0, 0.0, 0.0, 90.0, 0.0)  # beyond the largest moment of the springs
    aside = sr.Measurements(motors, wrench=loads, tip_position=np.add(tips, 0.001), std=1e-3)
    fit = sr.identify(sr.InflatableArm(stiffness=150.0, max_moment=10.0), rows, "stiffness", validation=aside)
    alike = sr.identify(sr.InflatableArm(stiffness=150.0, max_moment=10.0), rows, "stiffness", validation=aside[[0, 2, 3]])
    assert fit.validation is not None
    assert alike.validation is not None
    assert (fit.validation.lost, fit.validation.n_counted, alike.validation.lost) == ([1], 3, [])
    assert fit.validation.errors["positions.tip"][0] == pytest.approx(alike.validation.errors["positions.tip"][0], rel=1e-9)
    assert "kept aside, without an equilibrium: row 1" in fit.summary(None)
    assert sr.load_result(sr.save_result(fit, tmp_path / "fit.npz")).validation.lost == [1]
