"""Hints at wrong units, axes, rows and commands: each mistake is found with its numbers, and nothing else is."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.refits import reversed_actuators
from softrobots.identification.suspicions import doubtful_sizes, hints, suspicions
from softrobots.statics.kinematics import frame_placement
from tests.conftest import CHECKOUT
from tests.support.tables import each_row

RNG = np.random.default_rng(5)
MOTORS = RNG.uniform(-0.4, 0.4, (40, 3))


@pytest.fixture(scope="module")
def tips() -> Any:
    """Tip of an arm whose three motors differ in what they move, bent by gravity."""
    arm = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.3)))
    return np.array([sr.solve_equilibrium(arm, q, gravity=(0, 0, -9.81)).tip_position for q in MOTORS])


MISTAKES: dict[str, tuple[Callable[[Any], Any], str]] = {
    "mm for m": (lambda x: 1e3 * x, r"dividing it by 1000 \(mm"),
    "m for mm": (lambda x: 1e-3 * x, r"dividing it by 0\.001 \(m"),
    "cm for m": (lambda x: 1e2 * x, r"dividing it by 100 \(cm taken for m;"),
    "degrees": (lambda x: x * 180 / math.pi, r"dividing it by 57\.3 \(degrees taken for radians"),
    "radians": (lambda x: x * math.pi / 180, r"dividing it by 0\.01745 \(radians taken for degrees"),
    "inches": (lambda x: x / 0.0254, r"dividing it by 39\.37 \(inches taken for m;"),
    "swapped axes": (lambda x: x[:, [1, 0, 2]], "taking its x, y, z for y, x, z leaves"),
    "mirrored axis": (lambda x: x * (1, 1, -1), "taking its x, y, z for x, y, -z leaves"),
    "turned camera": (lambda x: x[:, [2, 0, 1]] * (1, -1, 1), "taking its x, y, z for z, -x, y leaves"),
    "mm and axes": (lambda x: 1e3 * x[:, [2, 1, 0]], r"dividing it by 1000 .* and taking its x, y, z for z, y, x leaves"),
    "late rows": (lambda x: np.roll(x, 1, axis=0), "comparing each row with the row before"),
    "early rows": (lambda x: np.roll(x, -1, axis=0), "comparing each row with the row after"),
}


@each_row("name", MISTAKES)
def test_a_mistake_is_found_and_nothing_else_said(name: str, tips: Any) -> None:
    """With noise of 5 % of the motion, a stiffness that is off by a tenth of the motion, an offset, and missing cells."""
    mistake, words = MISTAKES[name]
    noise = 0.05 * tips.std() * np.random.default_rng(7).normal(size=tips.shape)
    measured = mistake(tips + noise) + 0.3
    measured[::13, 1] = np.nan
    predicted = tips + 0.1 * (tips - tips.mean(axis=0))
    found = suspicions(measured, predicted, name="positions.tip")
    assert len(found) == 1
    assert re.match(f"positions.tip: {words}", found[0])
    told = re.search(r"leaves ([\d.]+) % of", found[0])
    assert told is not None
    assert 0.0 < float(told[1]) < 25.0  # noise and stiffness: (0.05^2 to 0.1^2) of the motion, more of a still axis


def test_commands_of_another_order_or_sign_are_told(tips: Any) -> None:
    """The robot was moved with motors 1 and 2 exchanged, the third mirrored; the prediction is that of the columns."""
    arm = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.3)))
    true = MOTORS[:, [1, 0, 2]] * (1, 1, -1)
    measured = np.array([sr.solve_equilibrium(arm, q, gravity=(0, 0, -9.81)).tip_position for q in true])
    found = suspicions(measured, tips, MOTORS)
    assert [text for text in found if "taking the actuators as 2, 1, -3" in text]
    assert not suspicions(tips, tips, MOTORS)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.6), rows=st.integers(3, 30))
def test_noise_alone_is_no_suspicion(seed: int, share: float, rows: int) -> None:
    """Independent columns with errors up to six tenths of the motion: no unit, axis or row explains them better."""
    rng = np.random.default_rng(seed)
    predicted = rng.normal(size=(rows, 3))
    assert suspicions(predicted + share * rng.normal(size=(rows, 3)), predicted, rng.normal(size=(rows, 2))) == []


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_best_order_and_signs_are_those_of_a_search_through_all(seed: int) -> None:
    """All 48 signed orders of three columns, written out."""
    rng = np.random.default_rng(seed)
    m, p = rng.normal(size=(2, 12, 3))
    m = p[:, rng.permutation(3)] * rng.choice([-1.0, 1.0], 3) + 0.3 * m
    m, p = m - m.mean(axis=0), p - p.mean(axis=0)

    def left(order: Any, signs: Any) -> float:
        return float(np.sum((m - p[:, list(order)] * signs) ** 2) / np.sum(m**2))

    choices = itertools.product(itertools.permutations(range(3)), itertools.product([1.0, -1.0], repeat=3))
    order, signs = min(choices, key=lambda one: left(*one))
    found = [text for text in suspicions(m, p) if "taking its" in text]
    before, after = left((0, 1, 2), 1.0), left(order, signs)
    words = ", ".join(f"{'-' if sign < 0 else ''}{'xyz'[place]}" for place, sign in zip(order, signs, strict=True))
    if before > 0.02 and after < 0.25 * before:
        assert f"for {words} leaves {100 * after:.2g} % of the variance unexplained instead of {100 * before:.2g} %" in found[0]
    else:
        assert found == []


def test_sizes_are_doubted_before_a_fit(tips: Any) -> None:
    arm = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.3)))
    good = sr.Measurements(MOTORS, tip_position=tips, gravity=(0, 0, -9.81))
    assert doubtful_sizes(good, arm) == []
    bad = sr.Measurements(np.degrees(MOTORS), tip_position=1e3 * tips, gravity=(0, 0, -9810.0))
    said = "\n".join(doubtful_sizes(bad, arm))
    assert re.search(r"positions\.tip spreads over \d+ m, but the robot has a reach of \d", said)
    assert re.search(r"motor_1 goes from -2\d\.\d+ to 2\d\.\d+ rad", said)
    assert "gravity is 9810 m/s^2, on the ground 9.81" in said
    assert "spreads over 0.000976 m" in doubtful_sizes(sr.Measurements(MOTORS, tip_position=1e-3 * tips), arm)[0]


def test_a_frame_that_is_not_the_one_measured_is_told() -> None:
    """The ball sat at the hinge of the second link, and was told to be at the tip."""
    arm = sr.load_model(sr.InflatableArm())
    held = [sr.solve_equilibrium(arm, q, gravity=(0, 0, -9.81)) for q in MOTORS[:12]]
    seen = np.array([frame_placement(arm, one.q, "link_2").translation for one in held])
    wrong = sr.Measurements(MOTORS[:12], tip_position=seen, gravity=(0, 0, -9.81))
    found = hints(sr.identify(arm, wrong, "base.position"))
    assert [text for text in found if re.match("positions.tip: taking it for the frame (hinge_2|link_2) leaves .* % of", text)]
    right = sr.Measurements(MOTORS[:12], positions={"link_2": seen}, gravity=(0, 0, -9.81))
    assert hints(sr.identify(arm, right, "base.position")) == []


def test_a_value_far_from_its_prior_is_told(tips: Any) -> None:
    """A stiffness that the tips tell: four standard deviations from a prior is far, three is not."""
    rows = sr.Measurements(MOTORS, gravity=(0, 0, -9.81), tip_position=tips, std={"tip_position": 1e-4})
    robot, name = sr.InflatableArm(link_lengths=(0.5, 0.3)), "link[1].stiffness"
    true = float(sr.load_model(robot).stiffness[0])
    for sizes, told in ((4.0, 1), (-4.0, 1), (3.0, 0)):
        found = hints(sr.identify(robot, rows, name, priors={name: (true - sizes * 10.0, 10.0)}))
        assert len(found) == told, found
        assert not told or f"{name} {sizes:+.2g};" in found[0]


def test_positions_that_nothing_explains_are_told_with_their_share(tips: Any) -> None:
    """Rows in another order than the commands, far beyond the standard deviation that was given."""
    arm = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.3)))
    rows = sr.Measurements(MOTORS, tip_position=RNG.permutation(tips), gravity=(0, 0, -9.81), std=0.02)
    fit = sr.identify(arm, rows, "base.position")
    unexplained, far = hints(fit)
    left, measured = fit.residuals["positions.tip"], rows.measured["positions.tip"]
    share = 100.0 * np.var(left, axis=0).sum() / np.var(measured, axis=0).sum()  # by its definition
    assert f"positions.tip: {share:.2g} % of the variance are left unexplained" in unexplained
    size = float(re.search(r"is ([\d.]+) times the standard deviation that was given", far)[1])  # type: ignore[index]
    assert size == pytest.approx(left.std() / 0.02, rel=0.5)  # the median of 120 numbers that are not quite normal


def test_rows_far_off_are_told_as_outliers_and_not_as_wrong_actuators(tips: Any) -> None:
    arm, seen = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.3))), tips + 1e-3 * RNG.standard_normal(tips.shape)
    seen[3] += 3.0
    rows = sr.Measurements(MOTORS, tip_position=seen, gravity=(0, 0, -9.81))
    (found,) = hints(sr.identify(arm, rows, "base.position"))
    assert found.startswith("positions.tip: outliers leave ")
    assert hints(sr.identify(arm, rows, "base.position", loss="cauchy")) == []


def test_the_recordings_are_not_doubted() -> None:
    folder = CHECKOUT / "docs" / "examples" / "tdcr_v4"
    rows = sr.Measurements.from_csv(folder / "train.csv", folder / "columns.yaml")
    assert doubtful_sizes(rows, sr.load_model(sr.TendonArm())) == []


ROUGHLY = sr.InflatableArm(stiffness=170.0)
FITTED = ("stiffness", "base.position", "base.rotation", "motor[2].offset")


def seen_from_anywhere(seed: int, rows: int, noise: float, stiffness: float = 180.0) -> sr.Measurements:
    """Tips of a stiffer arm on a turned base, moved by 0.2 rad, with noise."""
    random = np.random.default_rng(seed)
    base, turn = random.normal(0.0, 0.2, 3), pin.exp3(random.normal(0.0, 0.4, 3))
    motors, forces = random.uniform(-0.2, 0.2, (rows, 3)), random.normal(0.0, 3.0, (rows, 3))
    arm, gravity = sr.load_model(sr.InflatableArm(stiffness=stiffness)), np.array(sr.EARTH_GRAVITY)
    tips = [
        sr.solve_equilibrium(arm, q, turn.T @ f, gravity=turn.T @ gravity).tip_position
        for q, f in zip(motors, forces, strict=True)
    ]
    seen = np.array(tips) @ turn.T + base + noise * random.standard_normal((rows, 3))
    return sr.Measurements(motors, force=forces, gravity=gravity, tip_position=seen)


@pytest.fixture(scope="module")
def weighed() -> sr.Measurements:
    """Tips of a stiffer arm under masses, with noise of 0.2 mm."""
    random, arm = np.random.default_rng(4), sr.load_model(sr.InflatableArm(stiffness=190.0))
    motors, masses = random.uniform(-0.6, 0.6, (15, 3)), random.uniform(0.0, 0.5, 15)
    tips = [
        sr.solve_equilibrium(arm, q, (0, 0, -9.80665 * mass), gravity=sr.EARTH_GRAVITY).tip_position
        for q, mass in zip(motors, masses, strict=True)
    ]
    seen = np.array(tips) + 2e-4 * random.standard_normal((15, 3))
    return sr.Measurements(motors, mass=masses, gravity=sr.EARTH_GRAVITY, tip_position=seen)


@pytest.mark.study
def test_the_unit_of_loads_beside_the_weight_of_the_robot_is_told_by_another_fit(weighed: sr.Measurements) -> None:
    robot, given = sr.InflatableArm(stiffness=170.0), weighed.arguments()
    for factor, words in ((1e3, r"dividing the loads by 1000 \(g or mN taken for kg or N\), and fitting again"), (1.0, "")):
        fit = sr.identify(robot, sr.Measurements(**given | {"mass": factor * weighed.loads["mass"]}), "stiffness")
        told = hints(fit)
        assert (any(re.search(words, text) for text in told)) if words else told == []


@pytest.mark.study
def test_the_unit_of_loads_that_a_stiffness_absorbs_is_told_by_its_ratio() -> None:
    """Of a robot without weight the stiffness absorbs all of it."""
    random, robot = np.random.default_rng(1), sr.InflatableArm(stiffness=180.0)
    arm, forces = sr.load_model(sr.InflatableArm(stiffness=190.0)), random.normal(size=(8, 3))
    tips = [sr.solve_equilibrium(arm, q, force).tip_position for q, force in zip(MOTORS, forces, strict=False)]
    for factor, words in ((1e3, "about 1000, the ratio of g or mN"), (9.80665, "about 9.807, the ratio of N to kg"), (1.0, "")):
        rows = sr.Measurements(MOTORS[:8], force=factor * forces, tip_position=np.array(tips))
        told = hints(sr.identify(robot, rows, "stiffness"))
        assert ([words in text for text in told] == [True]) if words else told == []


@pytest.mark.study
@each_row(("field", "right"), (("stiffness", 190.0), ("cap_mass", 0.1), ("density", 1300.0)))
def test_a_value_that_was_given_in_another_unit_is_told(field: str, right: float, weighed: sr.Measurements) -> None:
    """A start a thousand times too large, or too small where the robot takes that; one at a third is nothing to tell."""
    for factor, doubted in ((1e3, True), (1e-3, True), (3.0, False)):
        if field != "density" or factor > 1.0:  # a wall of a thousandth of the mass is refused
            fit = sr.identify(replace(sr.InflatableArm(stiffness=190.0), **{field: factor * right}), weighed, field)
            assert fit.message == "converged"
            assert [text.startswith(f"{field}: ") and "right unit" in text for text in hints(fit)] == [True] * doubted


@pytest.mark.study
@pytest.mark.parametrize("loads", ["gravity", "force"])
def test_loads_of_wrong_sign_that_a_stiffness_absorbs_are_told(weighed: sr.Measurements, loads: str) -> None:
    """The stiffness grows until the wrong load has no effect; what is left is a small part of the motion by the motors."""
    given = weighed.arguments()
    weights = given.pop("mass")[:, None] * np.array(sr.EARTH_GRAVITY)
    given |= {"force": weights} | ({"gravity": None} if loads == "force" else {})
    if loads == "force":
        arm = sr.load_model(sr.InflatableArm(stiffness=190.0))
        pairs = zip(given["q_motors"], weights, strict=True)
        given["positions"] = {"tip": np.array([sr.solve_equilibrium(arm, q, force).tip_position for q, force in pairs])}
    robot = sr.InflatableArm(stiffness=170.0)
    wrong = given | {loads: -given[loads]} | ({"force": None} if loads == "gravity" else {})
    right = given | ({"force": None} if loads == "gravity" else {})
    words = "changing the sign of gravity" if loads == "gravity" else "changing the sign of forces"
    assert any(words in text for text in hints(sr.identify(robot, sr.Measurements(**wrong), "stiffness")))
    assert not any("changing" in text for text in hints(sr.identify(robot, sr.Measurements(**right), "stiffness")))


def test_one_value_for_links_that_had_several_and_a_missing_weight_are_told() -> None:
    """Rows of a heavy arm without the gravity under which they were measured, and one length for links of 0.6 and 0.4 m."""
    arm = sr.InflatableArm(link_lengths=(0.6, 0.4), stiffness=100.0)
    model, motors = sr.load_model(arm), np.random.default_rng(4).uniform(-1.0, 1.0, (12, 3))
    tips = [sr.solve_equilibrium(model, one, gravity=sr.EARTH_GRAVITY).tip_position for one in motors]
    rows = sr.Measurements(motors, tip_position=tips, gravity=sr.EARTH_GRAVITY, std=1e-3)
    blind = sr.Measurements(motors, tip_position=tips, std=1e-3)
    for names, measured, told in (
        ("link_lengths", rows, "link_lengths: one value for parts that had 0.6, 0.4: [*] in its name fits one for each"),
        ("link_lengths[*]", blind, "as its weight, since gravity is not given"),
    ):
        texts = hints(sr.identify(arm, measured, names))
        assert any(told in text for text in texts), texts
    assert hints(sr.identify(arm, rows, "link_lengths[*]")) == []


@pytest.mark.study
@pytest.mark.parametrize(("axes", "words"), [([1, 0, 2], "y, x, z"), ([0, 2, 1], "x, z, y")])
def test_swapped_axes_that_a_fitted_base_hides_are_told(axes: list[int], words: str) -> None:
    """The base turns until a swap looks like a mirrored flat motion; noise is a quarter to a third of what is left."""
    rows = seen_from_anywhere(3, 20, 0.006)
    swapped = sr.Measurements(**rows.arguments() | {"positions": {"tip": rows.measured["positions.tip"][:, axes]}})
    fit = sr.identify(ROUGHLY, swapped, FITTED)
    assert 0.2 < 0.006 * math.sqrt(60) / np.linalg.norm(fit.residuals["positions.tip"]) < 0.4
    (found,) = hints(fit)
    assert f"taking its x, y, z for {words}, and fitting again, leaves residuals of 0." in found
    assert hints(sr.identify(ROUGHLY, rows, FITTED)) == []


@pytest.mark.study
def test_reversed_actuators_that_other_parameters_hide_are_told() -> None:
    """Two of six tendons are counted the other way; distances, azimuths and zeros make up for a part of it."""
    arm, random = sr.load_model(sr.TendonArm(segment_lengths=(0.09, 0.11), elastic_sections=1)), np.random.default_rng(2)
    moves = random.uniform(-2e-3, 2e-3, (40, 6))
    tips = np.array([sr.solve_equilibrium(arm, arm.relaxed_motors + move).tip_position for move in moves])
    seen = tips @ pin.exp3(np.array([0.1, 0.2, 1.0])).T + 5e-4 * random.standard_normal((40, 3))
    spread = {"motor[*].offset": 1e-3, "tendon[*].tendon_distance": 1e-3, "tendon[*].tendon_azimuth_deviation": 0.3}
    names = ("base.position", "base.rotation", *spread)
    priors = {name: (4.5e-3 * name.endswith("distance"), std) for name, std in spread.items()}
    for signs in ((1, 1, 1, 1, 1, 1), (1, 1, -1, 1, 1, 1)):
        rows = sr.Measurements(arm.relaxed_motors + moves * signs, tip_position=seen, std=5e-4)
        fit = sr.identify(arm, rows, names, priors=priors)
        told = [text for text in hints(fit) if "taking the actuators as" in text]
        assert len(told) == (min(signs) < 0), hints(fit)
        assert all("as 1, 2, -3, 4, 5, 6 leaves" in text for text in told)


@pytest.mark.study
def test_a_reversed_segment_and_all_reversed_tendons_are_told_behind_a_free_base() -> None:
    """Reversed tendons of a segment are half a turn of it until tendons go slack; one step of the fit is enough to tell."""
    arm, random = sr.load_model(sr.TendonArm(segment_lengths=(0.09, 0.11), elastic_sections=1)), np.random.default_rng(2)
    moves = random.uniform(-2e-3, 2e-3, (20, 6))
    tips = np.array([sr.solve_equilibrium(arm, arm.relaxed_motors + move).tip_position for move in moves])
    for signs, words in (((-1, -1, -1, 1, 1, 1), "-1, -2, -3, 4, 5, 6"), ((-1,) * 6, "-1, -2, -3, -4, -5, -6")):
        rows = sr.Measurements(arm.relaxed_motors + moves * signs, tip_position=tips, std=5e-4)
        fit = sr.identify(arm, rows, ("base.position", "base.rotation"), max_iterations=1)
        told, after, before = reversed_actuators(fit, "positions.tip", slice(None), False)
        assert (told, after < 1e-3 * before) == (words, True)


@pytest.mark.study
def test_a_reversed_tendon_of_nine_is_told_that_offsets_and_stiffness_hide() -> None:
    """Without a base to fit; the search ends among slack tendons, where steps gain nothing, before its hundred steps."""
    robot, random = sr.TendonArm(elastic_sections=1), np.random.default_rng(3)
    names = ("tendon_stiffness", "axial_stiffness", "motor[*].offset")
    chosen, pulls = ParameterSet.of(robot, names), random.uniform(-3e-3, 3e-3, (50, 9))
    model = chosen.model([8e3, 5e3, *3e-4 * random.standard_normal(9)])
    tips = np.array([sr.solve_equilibrium(model, model.relaxed_motors - pull).tip_position for pull in pulls])
    rows = sr.Measurements(pulls * np.where(np.arange(9) == 4, -1.0, 1.0), relative=True, tip_position=tips)
    fit = sr.identify(robot, rows, names)
    assert len(fit.history.cost) < 100
    assert any("taking the actuators as 1, 2, 3, 4, -5, 6, 7, 8, 9 leaves" in text for text in hints(fit))


@pytest.mark.study
@pytest.mark.shortened(2, 200)
def test_a_noisy_fit_is_not_called_mirrored(cases: int) -> None:
    """Noise of 10 to 30 % of the motion; every other arm has links of other lengths than those told."""
    tried = 0
    for seed in range(cases):
        random = np.random.default_rng(seed)
        rows = seen_from_anywhere(seed, int(random.integers(8, 24)), random.uniform(0.01, 0.03), random.uniform(120.0, 260.0))
        robot = replace(ROUGHLY, link_lengths=(0.6, 0.6 + 0.1 * (seed % 2)))
        fit = sr.identify(robot, rows, FITTED)
        left, tips = fit.residuals["positions.tip"], rows.measured["positions.tip"]
        tried += bool(np.sum(left**2) > 0.02 * np.sum((tips - tips.mean(axis=0)) ** 2))
        assert not [text for text in hints(fit) if "fitting again" in text or "taken for" in text], seed
    assert tried > 0.3 * cases  # fits so bad that axes are suspected


def test_a_stiffness_that_only_has_a_bound_is_told(rng: np.random.Generator) -> None:
    """A rod of 39 kN stretches by 0.01 mm under its tendons, where the tip is seen to 0.3 mm; 1 kN would show."""
    arm = sr.TendonArm(segment_lengths=(0.1,), elastic_sections=1)
    model, pulls = sr.load_model(arm), rng.uniform(-1e-3, 2e-3, (12, 3))
    tips = np.array([sr.solve_equilibrium(model, model.relaxed_motors - pull).tip_position for pull in pulls])
    seen, known = tips + 3e-4 * rng.standard_normal(tips.shape), {"positions.tip": 3e-4}
    rows = sr.Measurements(pulls, tip_position=seen, std=known, relative=True, markers={"tip": "tip"})
    start = sr.TendonArm(segment_lengths=(0.1,), elastic_sections=1, axial_stiffness=1e3)
    told = hints(sr.identify(start, rows, ("axial_stiffness", "tendon_pretension")))
    assert any(
        text.startswith("axial_stiffness has gone from 1000 to") and "only tell that it is large" in text for text in told
    )
    fixed = sr.identify(start, rows, "axial_stiffness", priors={"axial_stiffness": (4e4, 1e4)})
    assert not any("has gone from" in text for text in hints(fixed))


def test_friction_of_guides_in_many_rows_is_warned_of() -> None:
    """Its derivatives are differences of the whole course."""
    for count, guides, told in ((201, 0.3, 1), (201, 0.0, 0), (20, 0.3, 0)):
        arm = sr.TendonArm(segment_lengths=(0.1,), elastic_sections=1, guide_friction=guides)
        rows = sr.Measurements(np.zeros((count, 3)), relative=True, motor_torques=np.zeros((count, 3)))
        assert sum("guide_friction" in text for text in doubtful_sizes(rows, sr.load_model(arm))) == told
