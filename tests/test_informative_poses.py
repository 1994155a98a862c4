"""D-optimal choices against closed forms and all subsets; expected intervals against those of fits."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.identification.informative_poses import d_optimal
from tests.support.laws import law

seeds_ = st.integers(0, 2**32 - 1)


def log_det(rows: np.ndarray, some: object, known: np.ndarray) -> float:
    inside = rows[list(some)].reshape(-1, rows.shape[-1])  # type: ignore[call-overload]
    return float(np.linalg.slogdet(inside.T @ inside + known)[1])


# --- The choice


@pytest.mark.parametrize(("degree", "best"), [(1, {-1.0, 1.0}), (2, {-1.0, 0.0, 1.0}), (3, {-1.0, -0.447, 0.447, 1.0})])
def test_a_polynomial_is_measured_at_fejers_points(degree: int, best: set[float]) -> None:
    """The D-optimal points of a polynomial on [-1, 1] are -1, 1 and the zeros of Legendre's derivative (Fejer 1932)."""
    x = np.round(np.linspace(-1.0, 1.0, 2001), 3)
    chosen = d_optimal(np.vander(x, degree + 1)[:, None, :], degree + 1, np.zeros((degree + 1, degree + 1)))
    assert set(x[chosen].tolist()) == best


@given(seeds_)
@settings(max_examples=15, deadline=None)
def test_the_choice_is_nearly_the_best_of_all_subsets(seed: int) -> None:
    """Of 210 subsets; exchange ends in a local maximum. 0.2 of the logarithm is 2.5 % of a standard deviation."""
    rng = np.random.default_rng(seed)
    rows, known = rng.standard_normal((10, 2, 4)) * [1.0, 100.0, 0.01, 1.0], np.diag([0.1, 1e4, 1e-5, 0.0])
    chosen = d_optimal(rows, 4, known)
    assert len(set(chosen.tolist())) == 4
    found = log_det(rows, chosen, known)
    assert found > max(log_det(rows, some, known) for some in itertools.combinations(range(10), 4)) - 0.2
    for out, into in itertools.product(chosen.tolist(), set(range(10)) - set(chosen.tolist())):
        assert log_det(rows, [*(set(chosen.tolist()) - {out}), into], known) <= found + 1e-6  # no exchange helps
    for count in (1, 2, 3):  # the next is the one that helps most
        first = chosen[:count].tolist()
        assert chosen[count] == max(set(chosen.tolist()) - set(first), key=lambda one: log_det(rows, [*first, one], known))


def test_what_is_known_is_not_measured_again() -> None:
    rows = np.array([[[1.0, 0.0]], [[2.0, 0.0]], [[0.0, 1.0]], [[0.0, 0.5]]])
    assert d_optimal(rows, 2, np.diag([100.0, 0.0])).tolist() == [2, 3]
    assert d_optimal(rows, 2, np.diag([0.0, 100.0])).tolist() == [1, 0]
    assert sorted(d_optimal(rows, 2, np.zeros((2, 2))).tolist()) == [1, 2]


# --- Poses of robots

ARM = sr.InflatableArm(link_lengths=(0.5,), stiffness=150.0, hinge_offset=0.05, density=900.0)
NAMES = ("stiffness", "base.position.z", "motor[2].offset")
GRAVITY = (0.0, 0.0, -9.81)


def slopes(q_motors: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Derivatives of the tip by the logarithm of the stiffness, z of the base and the second motor, by central differences."""
    found = np.zeros((len(q_motors), 3, 3))
    for row, (motors, mass) in enumerate(zip(q_motors, masses, strict=True)):
        for number, h in enumerate((1e-4, 0.0, 1e-4)):
            tips = []
            for sign in (1.0, -1.0):
                model = sr.load_model(replace(ARM, stiffness=150.0 * np.exp(sign * h))) if number == 0 else sr.load_model(ARM)
                turned = motors + [0.0, sign * h if number == 2 else 0.0]
                tips.append(sr.solve_equilibrium(model, turned, (0.0, 0.0, -9.81 * mass), gravity=GRAVITY).tip_position)
            found[row, :, number] = (tips[0] - tips[1]) / (2.0 * h) if h else (0.0, 0.0, 1.0)
    return found


@pytest.mark.study
@law("informative_poses", "InformativePoses")
@given(seeds_)
@settings(max_examples=2, deadline=None)
def test_expected_intervals_are_those_of_central_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q_motors, masses = rng.uniform(-1.0, 1.0, (8, 2)), rng.uniform(0.5, 2.0, 8)
    given_loads = {"mass": masses, "gravity": GRAVITY}
    found = sr.informative_poses(ARM, NAMES, q_motors, 3, std={"tip_position": 2e-3}, **given_loads)
    assert isinstance(found, sr.InformativePoses)
    rows = slopes(q_motors, masses) / 2e-3
    for name, some in (("chosen", found.indices), ("all", np.arange(8))):
        inside = rows[some].reshape(-1, 3)
        std = np.sqrt(np.diag(np.linalg.inv(inside.T @ inside)))
        assert found.margins[name] == pytest.approx(1.959964 * std, rel=1e-4)  # 1e-8 of the differences, times a condition
    assert found.log_det == pytest.approx(log_det(rows, found.indices, np.zeros((3, 3))), abs=1e-4)
    assert found.log_det >= log_det(rows, range(3), np.zeros((3, 3))) - 1e-6
    low, high = found.intervals.T
    assert np.sqrt(low[0] * high[0]) == pytest.approx(150.0)  # of a logarithm
    assert high[1:] == pytest.approx(found.margins["chosen"][1:] + found.values[1:])
    order = rng.permutation(8)
    again = sr.informative_poses(
        ARM, NAMES, q_motors[order], 3, std={"tip_position": 4e-3}, mass=masses[order], gravity=GRAVITY
    )
    assert order[again.indices].tolist() == found.indices.tolist()
    assert again.margins["all"] == pytest.approx(2.0 * found.margins["all"], rel=1e-9)


def test_what_was_measured_and_what_is_known_counts() -> None:
    rng = np.random.default_rng(8)
    q_motors, masses = rng.uniform(-1.0, 1.0, (10, 2)), rng.uniform(0.5, 2.0, 10)
    rows = sr.Measurements(
        q_motors, mass=masses, gravity=GRAVITY, tip_position=np.zeros((10, 3)), motor_torques=np.zeros((10, 2)),
        std={"tip_position": 1e-3, "motor_torques": 0.1}, mask=np.arange(10) != 3,
    )  # fmt: skip
    priors = {"stiffness": (150.0, 15.0)}
    found = sr.informative_poses(ARM, NAMES, rows[[0, 1, 2, 3, 4]], 4, measured=rows[5:], priors=priors)
    assert set(found.indices.tolist()) == {0, 1, 2, 4}  # the mask leaves 3 out
    everything = sr.informative_poses(ARM, NAMES, rows, 9, priors=priors)
    assert found.margins["all"] == pytest.approx(everything.margins["all"], rel=1e-9)
    assert found.log_det == pytest.approx(everything.log_det, rel=1e-9)
    held = sr.informative_poses(ARM, NAMES, rows, 9, priors={"stiffness": (150.0, 1.5e-6)})
    assert held.margins["chosen"][0] == pytest.approx(1.959964e-8, rel=1e-6)  # relative, as the parameter is logarithmic
    text = everything.summary()
    assert text.count("%") == 4
    assert "random, twice as many" in text


def test_poses_of_frames_are_candidates_whatever_their_rotation() -> None:
    rng = np.random.default_rng(9)
    q_motors = rng.uniform(-1.0, 1.0, (6, 2))
    measured = {"poses.tip": (1e-3, 2e-3), "positions.link_1": 1e-3}
    found = sr.informative_poses(ARM, NAMES, q_motors, 2, std=measured, force=rng.uniform(-20.0, 20.0, (6, 3)), markers={})
    assert np.all(np.isfinite(found.intervals))


@pytest.mark.parametrize(("guide", "quantity"), [(0.0, "positions"), (0.1, "poses")])
def test_rows_that_a_mask_leaves_out_happen_where_the_robot_rubs(guide: float, quantity: str) -> None:
    """Intervals of all rows that count, from differences of the whole course; angles are as good as unknown."""
    names, random = ("young_modulus", "bending_friction"), np.random.default_rng(0)
    arm = sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1, bending_friction=1e-3, guide_friction=guide)
    robot, mask, tips = sr.load_model(arm), ~np.isin(np.arange(8), (2, 5)), []
    motors = robot.relaxed_motors - random.uniform(-1e-3, 4e-3, (8, robot.n_motors))
    for name in names:
        for factor in (1.0 + 1e-6, 1.0 - 1e-6):
            other, now = sr.load_model(replace(arm, **{name: (factor * np.array(getattr(arm, name))).tolist()})), None
            for q in motors:
                now = sr.solve_equilibrium(other, q, previous=now, tolerance=1e-12)
                tips.append(now.tip_position)
    ends = np.reshape(tips, (2, 2, 8, 3))[:, :, mask]
    inside = ((ends[:, 0] - ends[:, 1]) / 2e-6 / 1e-3).reshape(2, -1).T  # by relative changes, in standard deviations
    seen, std = (np.tile(np.eye(4), (8, 1, 1)), (1e-3, 1e3)) if quantity == "poses" else (np.zeros((8, 3)), 1e-3)
    rows = sr.Measurements(motors, **{quantity: {"tip": seen}}, std={f"{quantity}.tip": std}, mask=mask)
    found = sr.informative_poses(arm, names, rows, 6)
    expected = 1.959964 * np.sqrt(np.diag(np.linalg.inv(inside.T @ inside))) * [1.0, 1e-3]  # of a logarithm, of a value
    assert found.margins["all"] == pytest.approx(expected, rel=1e-3)  # sliders turn within a stick, which the steps see


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"n": 7}, sr.ParameterError, "at most the number of candidates, 6"),
        ({"n": 0}, sr.ParameterError, "positive integer"),
        ({"std": {"tip_velocity": 1.0}}, sr.NameNotFound, "tip_position"),
        ({"std": {}}, sr.ParameterError, "at least one number of positions"),
        ({"candidates": [[np.nan, 0.0]]}, sr.ParameterError, "finite numbers"),
        ({"parameters": ("stiffness", "tail")}, sr.NameNotFound, "stiffness"),
        ({"mass": None}, sr.ParameterError, "tell them apart; not so stiffness"),
        (
            {"parameters": ("base.rotation.z", "motor[1].offset")},
            sr.ParameterError,
            "orientation of the base (its yaw, say) against angles",
        ),
    ],
)
def test_what_cannot_be_chosen_is_refused(change: dict[str, Any], error: type[Exception], message: str) -> None:
    q_motors = np.random.default_rng(10).uniform(-1.0, 1.0, (6, 2))
    arguments = {"robot": ARM, "parameters": NAMES, "candidates": q_motors, "n": 3}
    arguments |= {"std": {"tip_position": 1e-3}, "mass": np.ones(6), "gravity": GRAVITY, **change}
    if "mass" in change:
        arguments["gravity"] = None
    with pytest.raises(error, match=re.escape(message)):
        sr.informative_poses(**arguments)


def test_by_default_the_tip_is_measured() -> None:
    arm, angles = sr.InflatableArm(stiffness=170.0), np.random.default_rng(4).uniform(-0.8, 0.8, (12, 3))
    chosen, told = (
        sr.informative_poses(
            arm, ("stiffness", "hinge_offset"), angles, 3, gravity=sr.EARTH_GRAVITY, force=[[5.0, 3.0, -9.0]] * 12, std=std
        )
        for std in (None, {"tip_position": 1e-3})
    )
    np.testing.assert_array_equal(chosen.intervals, told.intervals)


def test_measurements_have_their_own_loads_and_deviations() -> None:
    rows = sr.Measurements(np.zeros((2, 2)), tip_position=np.zeros((2, 3)))
    with pytest.raises(sr.ParameterError, match=r"lacks positions\.tip"):
        sr.informative_poses(ARM, ("base.position",), rows, 1)
    with pytest.raises(sr.ParameterError, match="where std or loads are given"):
        sr.informative_poses(ARM, ("base.position",), rows, 1, std={"tip_position": 1.0})
