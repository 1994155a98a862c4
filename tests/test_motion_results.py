"""What users do with a motion: files, tables, figures, animation."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.view.animation_frames import motion_frames, playing_time
from softrobots.view.figures import motions
from softrobots.view.scene import SceneBuilder
from tests.support.saved_files import altered

PUSH = (0.0, 10.0, -15.0)


def gust(time: float) -> np.ndarray:
    """Half a sine of 4 N downwards in the second tenth of a second."""
    return np.array([0.0, 0.0, -4.0 * np.sin(10.0 * np.pi * (time - 0.1)) if 0.1 < time < 0.2 else 0.0])


@pytest.fixture(scope="module")
def released(arm: sr.SoftModel) -> sr.Motion:
    """The arm, released from a load into a gust."""
    motors = (0.3, 0.6, -0.8)
    held = sr.solve_equilibrium(arm, motors, PUSH, gravity=sr.EARTH_GRAVITY)
    options = {"start": held, "gravity": sr.EARTH_GRAVITY, "damping_time": 0.005, "time_step": 5e-3, "output_step": 0.01}
    return sr.simulate(arm, 0.3, motors, force=gust, **options)


@pytest.fixture(scope="module")
def bending() -> sr.Motion:
    """An arm of muscles, let fall aside."""
    model = sr.load_model(sr.PccArm(elastic_sections=2))
    return sr.simulate(model, 0.1, model.relaxed_motors, force=(3, 0, 0), time_step=0.01, output_step=0.02)


def test_a_simulation_goes_on_from_a_saved_motion(released: sr.Motion, tmp_path: Path) -> None:
    """The same as from the motion itself, to the last bit."""
    again = sr.load_result(sr.save_result(released, tmp_path / "a.npz"))
    one, other = (sr.simulate(start.model, 0.02, (0.3, 0.6, -0.8), start=start, time_step=0.01) for start in (released, again))
    assert np.array_equal(one.q_springs, other.q_springs)


def test_a_motion_keeps_the_damping_that_was_asked_for(arm: sr.SoftModel, tmp_path: Path) -> None:
    """Damping by mass, too: in both engines, in what is saved, and in words."""
    asked = {"damping_time": 0.01, "mass_damping": 2.5}
    for simulate in (lambda *a, **k: sr.simulate(arm, *a, **k), sr.compile(arm, backend="python").simulate):
        motion = simulate(0.02, (0.3, 0.6, -0.8), time_step=0.01, **asked)
        again = sr.load_result(sr.save_result(motion, tmp_path / "a.npz", overwrite=True))
        assert {name: getattr(motion, name) for name in asked} == asked == {name: getattr(again, name) for name in asked}
        assert "0.01 s times stiffness, and 2.5 /s times mass" in str(again.summary())


def test_motions_that_are_none_are_refused(released: sr.Motion, tmp_path: Path) -> None:
    file, n = sr.save_result(released, tmp_path / "a.npz"), len(released.time)
    for changes, words in (
        ({"time": released.time[::-1]}, "time must be increasing"),
        ({"time": released.time[:0]}, "at least one instant"),
        ({"time": released.time[:-1]}, "q_motors"),
        ({"q_springs": released.q_springs[:, :-1]}, "q_springs"),
        ({"velocities": np.full((n, 4), np.nan)}, "velocities"),
        ({"kinetic": released.energy.kinetic[:-1]}, "kinetic"),
        ({"tip_error": np.array(np.inf)}, "tip_error"),
        ({"mass_damping": np.array(-1.0)}, "mass_damping must be zero or positive"),
        ({"interrupted": np.array(1)}, "interrupted"),
        ({"forces": np.zeros((n, 2))}, "forces"),
        ({"steps": np.array([0.0, 0.0])}, "steps must be increasing"),
        ({"load": np.array('{"wrenches": {}, "gravity": [0, 0]}')}, "gravity"),
    ):
        with pytest.raises(sr.FileFormatError, match=words):
            sr.load_result(altered(file, tmp_path / "b.npz", **changes))


def test_the_table_of_a_motion_names_its_units_and_keeps_its_digits(released: sr.Motion, tmp_path: Path) -> None:
    with sr.save_csv(released, tmp_path / "a.csv").open(newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == len(released.time)
    for name, values in {
        "time [s]": released.time,
        "motor_2 [rad]": released.q_motors[:, 1],
        "spring_1_up [rad]": released.q_springs[:, 1],
        "spring_1_up velocity [rad/s]": released.velocities[:, 1],
        "motor_3 load [N m]": released.motor_torques[:, 2],
        "tip z [m]": released.tip_position[:, 2],
        "force z [N]": released.forces[:, 2],
        "load work [J]": released.energy.load_work,
    }.items():
        assert [float(row[name]) for row in rows] == values.tolist()
    assert len(rows[0]) == 1 + 3 * 3 + 2 * 4 + 3 + 3 + 6


def test_figures_show_what_moves(released: sr.Motion, bending: sr.Motion) -> None:
    """Lines hold the numbers of the motion; a strobe has equal axes and the robot at the times asked for."""
    tip = motions.tip_over_time({"a": released, "b": released})
    assert [axes.get_ylabel() for axes in tip.axes] == ["tip x [mm]", "tip y [mm]", "tip z [mm]"]
    assert np.array_equal(tip.axes[2].lines[1].get_ydata(), 1e3 * released.tip_position[:, 2])
    aside = motions.tip_over_time(bending)
    assert aside.axes[0].get_ylabel() == "tip x [mm]"
    energies = motions.energies(released)
    shown = {line.get_label(): line.get_ydata() for line in energies.axes[0].lines}
    assert "work of motors" not in shown  # they stay where they are
    total = shown["kinetic"] + shown["elastic"] + shown["gravity"] + shown["dissipated"] - shown["work of loads"]
    assert np.allclose(1e3 * (total - total[0]), energies.axes[1].lines[0].get_ydata(), rtol=0, atol=1e-9)
    picture = motions.strobe(released, shown=3, between=(0.0, 0.1)).axes[0]
    robots = [line for line in picture.lines if line.get_linewidth() == 2.5]
    assert len(robots) == 3
    assert (picture.get_xlabel(), picture.get_ylabel(), picture.get_aspect()) == ("x [m]", "z [m]", 1.0)
    assert np.allclose(robots[-1].get_xydata()[-1], released.tip_position[10, [0, 2]], rtol=0, atol=1e-12)
    assert robots[0].get_color() > robots[-1].get_color()  # later is darker
    assert "force, 4 N at 0.15 s" in [text.get_text() for text in motions.strobe(released).legends[0].texts]
    assert motions.strobe(bending).axes[0].lines


def test_figures_of_something_else_are_refused(released: sr.Motion) -> None:
    for call, words in (
        (lambda: motions.tip_over_time({}), "at least one"),
        (lambda: motions.tip_over_time({"a": None}), "a Motion"),
        (lambda: motions.energies(None), "a Motion"),
        (lambda: motions.strobe("x"), "a Motion"),
        (lambda: motions.strobe(released, shown=0), "shown"),
        (lambda: motions.strobe(released, between=(0.0, 2.0)), "from 0 to 0.3 s"),
    ):
        with pytest.raises(sr.ParameterError, match=words):
            call()


def test_frames_follow_the_cubics_of_the_motion(released: sr.Motion) -> None:
    """At 30 frames a second of playing; between rows as far from SciPy's cubic as rounding, at rows the row itself."""
    from scipy.interpolate import BPoly

    frames = motion_frames(released, playing_time(released.model, released, None, 0.1))
    assert [frame.number for frame in frames] == list(range(91))  # 3 s
    table = np.stack([released.q_springs, released.velocities], axis=1)
    cubic = BPoly.from_derivatives(released.time, table)
    for frame in frames:
        assert np.allclose(frame.q_springs, cubic(0.3 * frame.number / 90), rtol=0, atol=1e-12)
    assert np.allclose(frames[-1].q_springs, released.q_springs[-1], rtol=0, atol=1e-15)
    assert len(motion_frames(released, 1e4)) == 600


def test_bodies_have_fewer_frames_and_muscles_their_tension(bending: sr.Motion) -> None:
    frames = motion_frames(bending, 1e3)
    assert len(frames) == 50
    assert np.allclose(frames[-1].tensions, bending.motor_torques[-1])
    scene = SceneBuilder(bending.model).movement(bending, 0.1)[0]
    assert scene.arrows["tip"].force == 3.0
    assert [actuator.tension for actuator in scene.actuators] == bending.motor_torques[0].tolist()
    assert [actuator.curve.name for actuator in scene.actuators] == [muscle.name for muscle in bending.model.muscles]


def test_arrows_of_a_motion_are_as_long_as_the_force(released: sr.Motion) -> None:
    """The largest is drawn; the scale of each frame is its share of it, and nothing before the gust."""
    with sr.Viewer(released.model) as viewer:
        viewer.animate(released)
        moved = viewer._robot.animate(viewer._scenes.movement(released, 0.3))
        page = viewer.html()
    assert "force" in page
    scales = next(clip.tracks["scale"] for path, clip in moved.clips.items() if path.lower().endswith("load/tip"))
    times = 0.3 * np.array(scales.frames) / scales.frames[-1]
    forces = np.interp(times, released.time, np.linalg.norm(released.forces, axis=1))
    assert np.allclose(np.array(scales.values)[:, 0], np.maximum(forces / forces.max(), 1e-6), rtol=1e-9)


def test_links_are_limited_in_motion_as_at_rest(arm: sr.SoftModel, bending: sr.Motion) -> None:
    """A robot that stays in its equilibrium has the limits of that; what wrinkles at rest is said to wrinkle in motion."""
    motors = (0.3, 0.6, -0.8)
    for force in ((0.0, 3.0, -5.0), (0.0, 10.0, -18.0)):
        held = sr.solve_equilibrium(arm, motors, force, gravity=sr.EARTH_GRAVITY)
        still = sr.simulate(arm, 0.02, motors, start=held, force=force, gravity=sr.EARTH_GRAVITY, time_step=0.01)
        for mine, theirs in zip(still.link_limits(-1), held.link_limits, strict=True):
            assert np.allclose(mine, theirs, rtol=1e-9)  # the equilibrium itself is in balance to 1e-10
        assert still.wrinkled.tolist() == [held.wrinkled] * 3
    assert held.wrinkled
    assert not bending.wrinkled.any()  # no inflated links


def test_what_cannot_be_played_is_refused(released: sr.Motion, odd_arm: sr.SoftModel) -> None:
    other = dataclasses.replace(released, model=odd_arm)
    with sr.Viewer(released.model) as viewer:
        for call, words in (
            (lambda: viewer.animate(released, speed=0.0), "speed"),
            (lambda: viewer.animate(released, speed=1.0, duration=2.0), "left out where a duration"),
            (lambda: viewer.animate(other), "of the model given"),
        ):
            with pytest.raises(sr.ParameterError, match=words):
                call()
