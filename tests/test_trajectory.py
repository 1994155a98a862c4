"""Trajectories: the time law's calculus, every waypoint reached, the paper's method as the paper's theory predicts it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.trajectory import METHODS
from tests.support.free_bodies import bisector
from tests.support.oracles import paper_closed_loop
from tests.support.tables import each_row

FORCE = (0.0, 10.0, -15.0)
PATH = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 100)


def test_quintic_starts_and_ends_at_rest_without_acceleration() -> None:
    """The only quintic with s = 0, 1 and two vanishing derivatives at both ends, solved from those conditions."""
    conditions = [[float(t**k) for k in range(6)] for t in (0, 1)]
    conditions += [[k * float(t) ** max(k - 1, 0) for k in range(6)] for t in (0, 1)]
    conditions += [[k * (k - 1) * float(t) ** max(k - 2, 0) for k in range(6)] for t in (0, 1)]
    coefficients = np.linalg.solve(np.array(conditions), [0, 1, 0, 0, 0, 0])
    share = np.linspace(0, 1, 57)
    assert np.allclose(sr.quintic(share), np.polynomial.polynomial.polyval(share, coefficients), atol=1e-12)


def test_straight_line_is_straight_and_its_speed_peaks_at_15_eighths() -> None:
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 3.0, 4000)
    span = np.array([0.6, 0.7, -0.4])
    assert np.allclose(np.cross(path.positions - path.positions[0], span), 0.0, atol=1e-15)
    assert np.allclose(path.positions[[0, -1]], [[0.4, -0.5, 0.6], [1.0, 0.2, 0.2]], atol=1e-15)
    fastest = np.abs(np.gradient(path.positions, path.times, axis=0)).max(0)
    assert fastest == pytest.approx(1.875 * np.abs(span) / 3.0, rel=1e-6)  # 4000 steps: (1 / 4000)^2


@pytest.mark.study
def test_methods_agree_on_the_motor_angles(arm: sr.SoftModel) -> None:
    """The paper's method with small steps and a high gain approaches the exact answer in proportion to 1 / gain."""
    exact = sr.follow_trajectory(arm, PATH.positions, FORCE, elbow="up")
    fine = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 1600)
    errors = []
    for gain in (100.0, 200.0):
        paper = sr.follow_trajectory(arm, fine.positions, FORCE, elbow="up", method="paper", times=fine.times, gain=gain)
        errors.append(np.abs(paper.q_motors[::16] - exact.q_motors).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    assert errors[1] < 0.02


@pytest.mark.study
def test_the_papers_method_lags_as_measured(arm: sr.SoftModel) -> None:
    """On a 0.5 m move in 1 s the largest error falls from centimetres to millimetres over gains 5 to 100."""
    path = sr.straight_line((0.9, -0.2, 0.1), (0.6, 0.2, 0.1), 1.0, 400)
    largest = []
    for gain in (5, 10, 50, 100):
        found = sr.follow_trajectory(arm, path.positions, FORCE, method="paper", times=path.times, gain=gain, elbow="up")
        largest.append(1e3 * found.tip_error.max())
    assert largest == sorted(largest, reverse=True)
    assert 50 < largest[0] < 200
    assert 2 < largest[-1] < 15


@pytest.mark.study
def test_the_papers_method_is_the_one_written_on_the_dh_table(arm: sr.SoftModel) -> None:
    """Position rows: the same tips, step by step. All six rows, as the paper prints it: it loses the path by half a metre."""
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 200)
    found = sr.follow_trajectory(arm, path.positions, FORCE, method="paper", times=path.times, gain=50.0, elbow="up")
    start, force = np.array(found.q_motors[0]), np.array(FORCE)
    three = paper_closed_loop(start, path.positions, path.times, force, 50.0, rows=3)
    assert np.abs(found.tip_positions - three).max() < 1e-8  # springs settle to 1e-10 of 22 N m at each of 200 steps
    for gain in (5.0, 50.0):
        six = paper_closed_loop(start, path.positions[:100], path.times[:100], force, gain, rows=6)
        assert np.linalg.norm(six - path.positions[:100], axis=1).max() > 0.5


@pytest.mark.study
def test_moments_pressure_and_margin(arm: sr.SoftModel) -> None:
    """The default trajectory of the script: link 1 within 10 % of the paper's 17.51 N m, and 50 kPa as in the paper."""
    found = sr.follow_trajectory(arm, PATH.positions, FORCE, elbow="up")
    largest = found.link_moments.max(axis=0)
    assert largest[0] == pytest.approx(17.51, rel=0.1)
    axial = np.array([bisector(arm, state, 1) @ FORCE for state in found.equilibria])  # weightless: the force along the link
    moments, tension = found.link_moments[:, 0], 50e3 * np.pi * 0.055**2 + axial
    assert found.required_pressure == pytest.approx(
        ((4 * moments / (np.pi * 0.055) - axial) / (np.pi * 0.055**2)).max(), rel=1e-12
    )
    assert found.least_margin("wrinkling_margins") == pytest.approx(
        (1 - moments / (np.pi / 4 * 0.055 * tension)).min(), rel=1e-12
    )
    assert sr.inflated_beam.required_tabulated_pressure(largest[0], 0.055) == 50e3
    assert [state.wrinkled for state in found.equilibria] == [False] * 101


def test_a_robot_without_inflated_links_has_no_moments(arm: sr.SoftModel) -> None:
    plain = sr.load_model(arm.urdf, springs=dict.fromkeys(arm.spring_joints) | {"spring_1_up": 100.0}, motors=arm.motor_joints)
    found = sr.follow_trajectory(plain, PATH.positions[:5], FORCE)
    assert (found.link_moments, found.required_pressure, found.least_margin("wrinkling_margins")) == (None, None, None)


@pytest.mark.study
def test_the_unloaded_trajectory_is_rigid_inverse_kinematics(arm: sr.SoftModel) -> None:
    from tests.support.oracles import rigid_table

    found = sr.follow_trajectory(arm, PATH.positions, elbow="up")
    assert np.abs(found.q_springs).max() == 0.0
    for motors, target in zip(found.q_motors, PATH.positions, strict=True):
        assert np.allclose(rigid_table(motors)[:3, 3], target, atol=1e-9)


@pytest.mark.study
def test_a_long_step_is_bridged(arm: sr.SoftModel) -> None:
    found = sr.follow_trajectory(arm, PATH.positions[[0, -1]], FORCE, elbow="up")
    near = sr.follow_trajectory(arm, PATH.positions, FORCE, elbow="up")
    assert np.allclose(found.q_motors[-1], near.q_motors[-1], atol=1e-7)


@pytest.mark.study
def test_an_unreachable_waypoint_is_named(arm: sr.SoftModel) -> None:
    path = sr.straight_line((0.9, 0.0, 0.1), (1.6, 0.0, 0.1), 1.0, 10)
    with pytest.raises(sr.TargetUnreachable, match=r"waypoint 6 of 11: the tip cannot reach .* comes within"):
        sr.follow_trajectory(arm, path.positions, FORCE)
    with pytest.raises(sr.TargetUnreachable, match=r"waypoint 1 of 11: the tip cannot reach"):
        sr.follow_trajectory(arm, path.positions[::-1], FORCE)


@pytest.mark.study
@pytest.mark.parametrize("elbow", [None, "up", "down"])
def test_a_wide_circle_starts_from_the_shoulder_that_can_go_round(arm: sr.SoftModel, elbow: str | None) -> None:
    """From -2.9 to 2.9 rad about the base: the solution nearest to zero, over the shoulder, would meet the limit of motor 1."""
    turn = np.linspace(-2.9, 2.9, 120)
    circle = np.c_[0.72 * np.cos(turn), 0.72 * np.sin(turn), np.full(120, 0.24)]
    found = sr.follow_trajectory(arm, circle, elbow=elbow)
    assert found.tip_error.max() <= 1e-9
    assert np.abs(np.diff(found.q_motors, axis=0)).max() < 0.1
    assert found.q_motors[:, 0] == pytest.approx(turn, abs=1e-7)


@pytest.mark.study
def test_a_jump_is_refused_unless_allowed() -> None:
    """Motors within +-1 rad: the way on from the last reachable waypoint is blocked by motor 1; no other branch helps."""
    arm = sr.load_model(sr.InflatableArm(motor_limit=2.0))
    turn = np.linspace(0.0, 2.6, 40)
    circle = np.c_[0.7 * np.cos(turn), 0.7 * np.sin(turn), np.full(40, 0.3)]
    with pytest.raises(sr.TargetUnreachable, match=r"waypoint \d+ of 40: no continuous motion.*allow_jumps=True") as caught:
        sr.follow_trajectory(arm, circle, elbow="up")
    assert caught.value.best.error <= 1e-9  # the other branch is a solution, over the shoulder
    found = sr.follow_trajectory(arm, circle, elbow="up", allow_jumps=True)
    assert found.tip_error.max() <= 1e-9
    assert np.abs(found.q_motors).max() <= 2.0
    assert np.abs(np.diff(found.q_motors, axis=0)).max() > 1.0


@pytest.mark.study
def test_fixed_point_that_fails_on_the_way_is_an_error_that_names_the_waypoint(arm: sr.SoftModel) -> None:
    """The pull grows along the path's lever: at 90 N it fails in the middle, not at the first waypoint."""
    with pytest.raises(sr.EquilibriumNotFound, match=r"waypoint \d+ of 101: the fixed point of method='paper'") as caught:
        sr.follow_trajectory(arm, PATH.positions, (140.0, 0, 0), method="paper", times=PATH.times, elbow="up")
    assert not caught.value.best.converged


@pytest.mark.study
def test_a_coarse_path_does_not_make_the_papers_method_unstable(arm: sr.SoftModel) -> None:
    """Explicit Euler explodes at gain times step > 2; long intervals are integrated in parts instead."""
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 10)
    found = sr.follow_trajectory(arm, path.positions, FORCE, method="paper", times=path.times, gain=50.0, elbow="up")
    assert found.tip_error.max() < 0.03


def test_progress_goes_to_stderr(arm: sr.SoftModel, capsys: pytest.CaptureFixture) -> None:
    sr.follow_trajectory(arm, PATH.positions[:6], FORCE, progress=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "waypoints (newton)" in err
    assert "5/5" in err


@pytest.mark.parametrize("method", METHODS)
def test_bad_input_is_refused(arm: sr.SoftModel, method: str) -> None:
    good = {"targets": PATH.positions[:4], "times": PATH.times[:4], "method": method}
    for change, message in (
        ({"targets": np.zeros((0, 3))}, "at least one target"),
        ({"targets": PATH.positions[:4, :2]}, "targets"),
        ({"targets": np.full((4, 3), np.nan)}, "targets"),
        ({"times": PATH.times[:3]}, "times"),
        ({"times": PATH.times[:4][::-1]}, "increasing"),
        ({"gain": 0.0}, "gain"),
        ({"force": (1,)}, "force"),
        ({"q_motors0": (9, 9, 9)}, "q_motors0"),
        ({"elbow": "sideways"}, "elbow"),
        ({"method": "pink"}, "method"),
    ):
        with pytest.raises(sr.ParameterError, match=message):
            sr.follow_trajectory(arm, **(good | change))
    if method == "paper":
        with pytest.raises(sr.ParameterError, match=r"times.*given for method='paper'"):
            sr.follow_trajectory(arm, PATH.positions[:4], method="paper")


@each_row(
    ("call", "message"),
    [
        (lambda: sr.quintic(1.5), "share"),
        (lambda: sr.quintic([0.1, float("nan")]), "share"),
        (lambda: sr.straight_line((0, 0), (1, 1, 1), 1.0), "start"),
        (lambda: sr.straight_line((0, 0, 0), (1, 1, float("inf")), 1.0), "end"),
        (lambda: sr.straight_line((0, 0, 0), (1, 1, 1), 0.0), "duration"),
        (lambda: sr.straight_line((0, 0, 0), (1, 1, 1), 1.0, 0), "steps"),
        (lambda: sr.straight_line((0, 0, 0), (1, 1, 1), 1.0, 2**63), "steps"),
        (lambda: sr.waypoints([(0, 0, 0)], [0.0]), "at least two"),
        (lambda: sr.waypoints(np.zeros((3, 3)), [0, 2, 1]), "increasing"),
        (lambda: sr.waypoints(np.zeros((3, 3)), [0, 1]), "times"),
    ],
)
def test_bad_paths_are_refused(call, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        call()


def test_waypoints_are_read_from_csv(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("\ufefft, x, y, z, note\n0,0.5,0.1,0.2,a\n0.5,0.6,0.1,0.2,b\n1.5,0.9,0.1,0.2,c\n", encoding="utf-8")
    path = sr.read_waypoints(file)
    assert path.times.tolist() == [0.0, 0.5, 1.5]
    assert path.positions[:, 0].tolist() == [0.5, 0.6, 0.9]
    file.write_text("x,y,z\n0,0,0\n1,1,1\n", encoding="utf-8")
    assert sr.read_waypoints(file).times.tolist() == [0.0, 0.05]


@each_row(
    ("text", "message"),
    [
        ("", r"line 1: it names nothing; x, y, z are required"),
        ("a,b\n1,2\n", "line 1: it names a, b; x, y, z are required"),
        ("x,y,z\n1,2,3\n1,two,3\n", "line 3: y = 'two'"),
        ("x,y,z\n1,2,3\n1,2\n", "line 3: 2 cells; 3 are required"),
        ("x,y,z\n1,2,nan\n1,2,3\n", "line 2: z = 'nan'"),
        ("x,y,z\n1,2,inf\n", "z = 'inf'"),
        ("x,y,z\n1,2,3\n", r"path\.csv: .*at least two waypoints"),
        ("t,x,y,z\n1,1,2,3\n0,1,2,3\n", r"path\.csv: .*increasing"),
    ],
)
def test_bad_csv_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=message):
        sr.read_waypoints(file)


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.FileFormatError, match=r"cannot read .*: "):
        sr.read_waypoints(tmp_path / "missing.csv")
    (tmp_path / "binary.csv").write_bytes(bytes(range(128, 256)))
    with pytest.raises(sr.FileFormatError, match=r"cannot read .*: "):
        sr.read_waypoints(tmp_path / "binary.csv")
