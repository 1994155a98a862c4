"""The characterisation bench: geometry of the test in closed form, the UR5 that pushes, and the script."""

from __future__ import annotations

import csv
import json
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.description import third_party
from softrobots.inflated_beam import TABLE_3, BendingTest
from softrobots.statics.kinematics import frame_placement
from studies.ur5.bench import PROBE, TOUCH, UR5_JOINTS, UR5Bench
from studies.ur5.bench_run import BenchRun, push_link
from tests.conftest import missing
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

ROW = TABLE_3[4]  # 50 kPa


@pytest.fixture(scope="module")
def bench() -> UR5Bench:
    try:
        third_party.robot_file(third_party.UR5)
    except sr.MissingDependency as error:
        missing(str(error))
    return UR5Bench(link=link_of(ROW))


@pytest.fixture(scope="module")
def push(bench: UR5Bench) -> BenchRun:
    return push_link(bench, np.linspace(0.0, bench.push_end(1.6), 31))


def link_of(row: inflated_beam.CharacterisationRow) -> sr.InflatableArm:
    return sr.InflatableArm(
        link_lengths=(0.6,), stiffness=row.stiffness, pressure=row.pressure, max_moment=row.max_moment
    )  # fmt: skip


# the geometry of the test

GEOMETRY = {"probe_distance": st.floats(0.3, 0.6), "hinge_offset": st.floats(0.0, 0.1), "offset": st.floats(0.0, 0.15)}


@given(angle=st.floats(-0.2, 1.2), **GEOMETRY)
def test_angle_and_displacement_are_inverse_and_work_is_work(angle: float, **numbers: float) -> None:
    """`F dv = tau dtheta`: the moment of a unit force is the slope of the displacement, by a central difference (1e-6)."""
    test = BendingTest(**numbers)
    way = test.displacement(angle)
    assert float(test.angle(way)) == pytest.approx(angle, abs=1e-13)
    slope = float(test.displacement(angle + 1e-6) - test.displacement(angle - 1e-6)) / 2e-6
    assert float(test.moment(way, 1.0)) == pytest.approx(slope, rel=1e-7)
    assert float(test.moment(way, 3.0)) == pytest.approx(3.0 * slope, rel=1e-7)


@given(angle=st.floats(0.0, 1.2), **GEOMETRY)
def test_the_probe_is_beside_the_bent_axis_where_it_says(angle: float, **numbers: float) -> None:
    """Centre of the ball in the plane: on its line, at its distance from the axis, at its place along it."""
    test = BendingTest(**numbers)
    centre = np.array([test.arm, float(test.displacement(angle)) - test.offset])  # from the hinge
    axis = np.array([np.cos(angle), np.sin(angle)])
    assert float(axis @ centre) == pytest.approx(float(test.contact(angle)), abs=1e-12)
    assert float(axis[1] * centre[0] - axis[0] * centre[1]) == pytest.approx(test.offset, abs=1e-12)


def test_for_small_angles_it_is_the_evaluation_of_the_paper() -> None:
    """Differences are of the first order in angle times offset, of the second without it."""
    for offset, order in ((0.0, 2), (0.065, 1)):
        test = BendingTest(offset=offset)
        errors = []
        for angle in (0.02, 0.01):
            way = test.displacement(angle)
            small, moment = test.small_angles(way, 10.0)
            errors.append([float(small) / angle - 1.0, float(moment) / float(test.moment(way, 10.0)) - 1.0])
        assert np.allclose(np.abs(errors[0]) / np.abs(errors[1]), 2.0**order, rtol=0.1)


def test_what_other_evaluations_would_make_of_the_data_is_as_documented() -> None:
    """Of the exact data of the five rows with a plateau; the numbers of the docstring of `BendingTest`, to their last digit."""
    test = BendingTest(offset=0.065)
    by_small, by_point = [], []
    for row in TABLE_3[:5]:
        angles = np.linspace(0.0, 1.6 * row.max_moment / row.stiffness, 41)
        ways = test.displacement(angles)
        moments = inflated_beam.moment(angles, stiffness=row.stiffness, max_moment=row.max_moment)
        forces = moments / test.moment(ways, np.ones(41))
        turned = np.arcsin(ways / test.arm)
        for found, data in (
            (by_small, test.small_angles(ways, forces)),
            (by_point, (turned, forces * test.arm * np.cos(turned))),
        ):
            fit = inflated_beam.fit_characterisation(*data, pressure=row.pressure, radius=0.055, angle_offset=0.0)
            found.append([abs(fit.stiffness / row.stiffness - 1.0), abs(fit.max_moment / row.max_moment - 1.0)])
    assert np.allclose(np.max(by_small, axis=0), [0.008, 0.006], rtol=0.0, atol=5e-4)
    assert np.allclose(np.max(by_point, axis=0), [0.005, 0.020], rtol=0.0, atol=5e-4)


@each_row(
    ("numbers", "field"),
    [
        ({"probe_distance": 0.0}, "probe_distance"),
        ({"hinge_offset": 0.5}, "hinge_offset"),
        ({"hinge_offset": -0.1}, "hinge_offset"),
        ({"offset": 0.47}, "offset"),
        ({"offset": np.nan}, "offset"),
    ],
)
def test_a_geometry_that_is_none_is_refused(numbers: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field):
        BendingTest(**numbers)


def test_data_that_are_none_are_refused() -> None:
    test = BendingTest()
    for call in (
        lambda: test.displacement(np.pi / 2),
        lambda: test.contact(-2.0),
        lambda: test.angle(np.inf),
        lambda: test.moment([0.1, 0.2], [1.0, 2.0, 3.0]),
        lambda: test.small_angles([0.1, 0.2], [1.0, 2.0, 3.0]),
    ):
        with pytest.raises(sr.ParameterError):
            call()


# the bench


def test_one_model_holds_both_robots(bench: UR5Bench) -> None:
    model = bench.model
    assert model.motor_joints == UR5_JOINTS
    assert model.spring_joints == ("soft_spring_1_side", "soft_spring_1_up")
    assert [group.max_moment for group in model.spring_groups] == [ROW.max_moment]
    assert model.tip == PROBE
    q = model.configuration(np.zeros(6))
    touch, hinge, clamp = (frame_placement(model, q, name) for name in (TOUCH, "soft_link_1", "soft_base_link"))
    assert np.allclose(touch.translation, bench.touch_position, rtol=0.0, atol=1e-12)
    assert clamp.actInv(touch.translation)[0] == pytest.approx(0.5, abs=1e-12)  # h
    assert clamp.actInv(hinge.translation)[0] == pytest.approx(0.03, abs=1e-12)  # l1


def test_the_ur5_moves_the_probe_straight_and_does_not_turn_it(bench: UR5Bench, push: BenchRun) -> None:
    """To the tolerance of the inverse kinematics, and the displacement that counts is that of the forward kinematics."""
    assert push.ik_error.max() < 1e-9
    assert push.ik_orientation_error.max() < 1e-9
    poses = [frame_placement(bench.model, state.q, PROBE) for state in push.states]
    start = np.array(bench.touch_position)
    for pose, way in zip(poses, push.displacement, strict=True):
        assert np.allclose(pose.translation, start + [way, 0.0, 0.0], rtol=0.0, atol=1e-9)
        assert np.allclose(pose.rotation, poses[0].rotation, rtol=0.0, atol=1e-9)
        assert np.allclose(pose.rotation[:, 2], [1.0, 0.0, 0.0], rtol=0.0, atol=1e-9)
    assert np.abs(np.diff(push.q_ur5, axis=0)).max() < 0.05  # one arm all the way
    limits = bench.model.motor_limits
    assert np.all((push.q_ur5 > limits[:, 0]) & (push.q_ur5 < limits[:, 1]))


def test_the_ball_touches_the_tube_and_pushes_square_to_it(bench: UR5Bench, push: BenchRun) -> None:
    """From the poses of both robots in the one model: the ball rests on the wall at every step."""
    for state in push.states:
        ball = frame_placement(bench.model, state.q, PROBE).translation
        hinge = frame_placement(bench.model, state.q, "soft_link_1")
        x, y, z = hinge.actInv(ball)
        assert (y, z) == pytest.approx((0.055 + 0.01, 0.0), abs=1e-9)
        assert 0.0 < x < 0.57
        assert abs(state.force @ hinge.rotation[:, 0]) < 1e-9
        moment = np.cross(ball - hinge.translation, state.force)
        assert np.linalg.norm(moment) == pytest.approx(state.equilibrium.link_moments[0], abs=1e-7)
        assert state.stable


def test_the_fit_recovers_the_true_link(push: BenchRun) -> None:
    """Without noise; a relative error of 1e-6 is asked for, about 1e-11 (residual over moment) is there."""
    read = push.measure()
    fit = inflated_beam.fit_characterisation(read.angle, read.moment, pressure=ROW.pressure, radius=0.055)
    assert fit.stiffness == pytest.approx(ROW.stiffness, rel=1e-9)
    assert fit.max_moment == pytest.approx(ROW.max_moment, rel=1e-9)
    assert fit.wrinkling_moment == pytest.approx(20.53, abs=0.005)  # printed in Table 3
    assert np.array_equal(read.force, push.force)
    assert push.stable


def test_the_fit_recovers_it_from_noise_within_three_standard_errors(push: BenchRun) -> None:
    """100 noisy readings, in standard errors: less than 5 % exceed 3 (Student's t of 10 freedoms: 1.3 %), their mean is zero
    within three of its standard errors, 0.1, and their spread that of Student's t, 1.12, within 0.25."""
    pulls = []
    for seed in range(100):
        read = push.measure(force_std=0.3, angle_std=3e-4, seed=seed)
        fit = inflated_beam.fit_characterisation(read.angle, read.moment, pressure=ROW.pressure, radius=0.055)
        plateau_std = 0.3 * 0.47 / np.sqrt(fit.n_saturated)
        pulls.append([(fit.stiffness - ROW.stiffness) / fit.stiffness_std, (fit.max_moment - ROW.max_moment) / plateau_std])
    assert np.all(np.mean(np.abs(pulls) < 3.0, axis=0) > 0.95)
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.3)
    assert np.all(np.abs(np.std(pulls, axis=0) - (1.12, 1.0)) < 0.25)
    first, again, other = (push.measure(force_std=0.3, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(first.force, again.force)
    assert not np.array_equal(first.force, other.force)
    assert np.array_equal(first.angle, push.measure().angle)


def test_the_torques_of_the_ur5_are_those_of_the_reaction(bench: UR5Bench, push: BenchRun) -> None:
    """Virtual work: minus the force on the link times how far each joint moves the probe (central difference, 1e-6 rad)."""
    state = push.states[-1]
    moved = []
    for joint in range(6):
        step = 1e-6 * np.eye(6)[joint]
        ends = [
            frame_placement(bench.model, bench.model.configuration(state.equilibrium.q_motors + sign * step), PROBE).translation
            for sign in (1.0, -1.0)
        ]
        moved.append((ends[0] - ends[1]) / 2e-6)
    assert np.allclose(push.ur5_torques[-1], -np.array(moved) @ state.force, rtol=0.0, atol=1e-7)
    assert push.ur5_effort.tolist() == [150.0, 150.0, 150.0, 28.0, 28.0, 28.0]  # of the UR5's file
    assert np.all(np.abs(push.ur5_torques) < push.ur5_effort)


def test_the_push_is_a_trajectory_for_the_viewer(bench: UR5Bench, push: BenchRun, tmp_path: Path) -> None:
    shown = push.trajectory(duration=3.0)
    assert shown.model is bench.model
    assert len(shown.equilibria) == len(push.states) - 1  # the first step has no force
    assert (shown.times[0] > 0.0, shown.times[-1]) == (True, 3.0)
    assert shown.tip_error.max() < 1e-9
    with pytest.raises(sr.ParameterError, match="equilibria under one load"):  # a file of a trajectory holds one
        sr.save_result(shown, tmp_path / "push.npz")
    assert not list(tmp_path.iterdir())
    again = sr.load_result(sr.save_result(push.states[-1], tmp_path / "last.npz"))
    assert np.array_equal(again.q_springs, shown.q_springs[-1])


def test_a_link_without_a_largest_moment_stays_linear(bench: UR5Bench) -> None:
    """60 kPa: the push ends below the wrinkling moment, and the fit finds no plateau."""
    row = TABLE_3[5]
    linear = UR5Bench(link=link_of(row))
    end = linear.push_end()
    assert float(linear.test.angle(end)) * row.stiffness == pytest.approx(0.95 * 24.63, abs=0.005)
    run = push_link(linear, np.linspace(0.0, end, 9))
    read = run.measure()
    fit = inflated_beam.fit_characterisation(read.angle, read.moment, pressure=row.pressure, radius=0.055)
    assert fit.stiffness == pytest.approx(row.stiffness, rel=1e-9)
    assert (fit.max_moment, fit.n_saturated) == (None, 0)
    assert not any(state.equilibrium.wrinkled for state in run.states)


@each_row(
    ("options", "field"),
    [
        ({"link": sr.InflatableArm()}, "link"),
        ({"link": "arm"}, "link"),
        ({"probe_distance": 0.6}, "probe_distance"),
        ({"probe_length": 0.0}, "probe_length"),
        ({"ball_radius": -0.01}, "ball_radius"),
        ({"ball_radius": 0.5}, "offset"),
        ({"touch_position": (0.5, 0.1)}, "touch_position"),
        ({"touch_position": (0.5, 0.1, 0.1)}, "touch_position"),
    ],
)
def test_a_bench_that_is_none_is_refused(options: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field):
        UR5Bench(**({"link": link_of(ROW)} | options))


def test_pushes_that_cannot_be_are_refused(bench: UR5Bench, push: BenchRun) -> None:
    most = float(bench.test.displacement(bench.largest_angle))
    assert float(bench.test.contact(bench.largest_angle)) == pytest.approx(0.57, abs=1e-9)
    for ways in ([], [-0.01], [0.0, np.nan], [most], 0.1):
        with pytest.raises(sr.ParameterError, match="displacements"):
            push_link(bench, ways)
    with pytest.raises(sr.TargetUnreachable):
        push_link(UR5Bench(link=link_of(ROW), touch_position=(1.2, 0.15, 0.35)), [0.0])
    for noise in ({"force_std": -1.0}, {"angle_std": np.inf}, {"seed": -1}, {"seed": 0.5}, {"seed": True}):
        with pytest.raises(sr.ParameterError, match=next(iter(noise))):
            push.measure(**noise)
    with pytest.raises(sr.ParameterError, match="duration"):
        push.trajectory(0.0)
    with pytest.raises(sr.ParameterError, match="the probe pushes"):
        BenchRun(bench, push.states[:1], push.ik_error[:1], push.ik_orientation_error[:1]).trajectory()
    for beyond in (1.0, np.nan, 6.0):
        with pytest.raises(sr.ParameterError, match="beyond"):
            bench.push_end(beyond)


def test_the_camera_goes_where_it_is_told(bench: UR5Bench, arm: sr.SoftModel) -> None:
    with sr.view(arm) as viewer:
        viewer.look_from(*bench.camera)
        for eye, centre, field in (
            ((0, 0, 0), (0, 0, 0), "eye"),
            ((1, 0), (0, 0, 0), "eye"),
            ((1, 0, 0), (0, np.nan, 0), "centre"),
        ):
            with pytest.raises(sr.ParameterError, match=field):
                viewer.look_from(eye, centre)


# the script


def test_the_script_recovers_table_3_and_writes_what_it_says(
    bench: UR5Bench, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script("ur5_bench", ["--pressures", "20", "60", "--steps", "20", "--output", str(folder)]) == 0
    names = {path.name for path in folder.iterdir()}
    assert names == {"raw.csv", "results.json", "force_displacement.png", "moment_angle.png", "scene.html"}
    results = json.loads((folder / "results.json").read_text())["results"]
    assert [result["pressure_Pa"] for result in results] == [20e3, 60e3]
    for result in results:
        assert result["fit_stiffness"] == pytest.approx(result["table_stiffness_N_m_rad"], rel=1e-6)
        assert result["largest_ik_error_m"] < 1e-9
        assert result["all_stable_while_held"]
        assert np.all(np.array(result["ur5_largest_torques_N_m"]) < result["ur5_effort_N_m"])
    assert results[0]["fit_max_moment"] == pytest.approx(9.45, rel=1e-6)
    assert results[1]["fit_max_moment"] is None
    with (folder / "raw.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 21
    moments = np.array([[float(row["true_angle_rad"]), float(row["true_moment_N_m"])] for row in rows[:21]])
    expected = inflated_beam.moment(moments[:, 0], stiffness=187.30, max_moment=9.45)
    assert np.allclose(moments[:, 1], expected, rtol=0.0, atol=1e-9)
    out, err = capsys.readouterr()
    assert "187.30" in out
    assert "shoulder_pan" in out
    assert "20 kPa" in err  # a progress bar
    assert "UR5 pushes the inflated link at 60 kPa" in (folder / "scene.html").read_text(encoding="utf-8")


def test_without_robot_data_the_script_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def nothing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", nothing)
    assert run_script("ur5_bench", ["--output", str(tmp_path / "out")]) == 2
    assert "pip install 'softrobots[robots]'" in capsys.readouterr().err


@each_row(
    ("arguments", "told"),
    [
        (["--pressures", "15"], "pressures of Table 3"),
        (["--pressures", "10", "10"], "each once"),
        (["--steps", "9"], "at least 10"),
        (["--steps", "0"], "--steps"),
        (["--scene-pressure", "20", "--pressures", "10"], "--scene-pressure"),
        (["--beyond", "1"], "beyond"),
        (["--beyond", "20", "--pressures", "50"], "where the ball leaves the end of the link"),
        (["--noise", "-1", "0", "--pressures", "10", "--steps", "10"], "--noise"),
    ],
)
def test_the_script_refuses_bad_input_and_leaves_nothing(
    arguments: list[str], told: str, bench: UR5Bench, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script("ur5_bench", [*arguments, "--output", str(folder)]) == 2
    assert told in capsys.readouterr().err
    assert not folder.exists()


def test_the_bench_refuses_a_link_that_is_bent_at_rest() -> None:
    with pytest.raises(sr.ParameterError, match="straight"):
        UR5Bench(link=sr.InflatableArm(link_lengths=(0.6,), rest_side=0.1))
