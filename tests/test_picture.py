"""`plot`: a picture of a pose of any robot, which tells what it shows, to scale; the small one of notebooks; other figures."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.core.result_file import KINDS
from softrobots.description.third_party import robot_file
from softrobots.statics.kinematics import backbone
from softrobots.view.figures import canvas
from softrobots.view.figures.inline import inline_picture
from softrobots.view.figures.pose import DrawnPose
from softrobots.view.mesh_triangles import triangles
from softrobots.view.robot_shapes import RobotShapes
from tests.support.figures import READABLE, smallest_text
from tests.support.hostile_data import results
from tests.support.laws import law

ARM = sr.load_model(sr.InflatableArm())
ANGLE, PUSH = st.floats(-1.0, 1.0), st.tuples(*[st.floats(-9.0, 9.0)] * 3)


@pytest.fixture(autouse=True)
def matplotlib(tool: Callable[[str], ModuleType]) -> None:
    tool("matplotlib")


def words(figure: Any) -> set[str]:
    """What the legend tells."""
    return {text.get_text() for text in figure.legends[0].get_texts()}


def ends_of(axes: Any) -> list[np.ndarray]:
    """Points of every line, each shape (n, 3)."""
    return [np.array(line.get_data_3d()).T for line in axes.lines]


def check_scales(axes: Any) -> None:
    """A metre is as long along x, y and z, and every line is within the axes."""
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    metre = axes._box_aspect / np.ptp(limits, axis=1)
    assert np.ptp(metre) <= 1e-12 * max(metre)
    points = np.concatenate(ends_of(axes))
    assert np.all((limits[:, 0] <= points) & (points <= limits[:, 1]))
    assert all("[m]" in label for label in (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()))


@pytest.mark.study
@law("plot")
@settings(max_examples=3)
@given(st.tuples(ANGLE, ANGLE, ANGLE), PUSH)
def test_tip_force_and_rigid_arm_are_where_they_are(motors: tuple[float, ...], push: tuple[float, ...]) -> None:
    """The rigid arm as the textbook writes it, the newtons of the force, and an arrow along it, a fifth of the arm long."""
    held = sr.solve_equilibrium(ARM, motors, push)
    figure = sr.plot(held)
    (axes,) = figure.axes
    check_scales(axes)
    x, y, z = held.tip_position
    assert f"tip ({round(x, 4) + 0.0:.4f}, {round(y, 4) + 0.0:.4f}, {round(z, 4) + 0.0:.4f}) m" in words(figure)
    turn, first, second = motors[0], motors[1], motors[1] + motors[2]
    out = 0.6 * (np.cos(first) + np.cos(second))
    rigid = (np.cos(turn) * out, np.sin(turn) * out, 0.6 * (np.sin(first) + np.sin(second)))
    assert any(np.allclose(points[-1], rigid, rtol=0.0, atol=1e-12) for points in ends_of(axes))
    size = float(np.linalg.norm(push))
    arrows = [np.array(one._segments3d[0]) for one in axes.collections if hasattr(one, "_segments3d")]
    if size > 1e-12:
        assert f"force {size:.3g} N" in words(figure)
        (shaft,) = arrows
        assert np.allclose(np.ptp(shaft, axis=0), np.abs(0.24 / size * np.array(push)), rtol=0.0, atol=1e-12)
    else:
        assert arrows == []


ROBOTS = {
    "pcc": sr.PccArm(),
    "tendon": sr.TendonArm(elastic_sections=2),
    "lumped": sr.TendonArm(chain="lumped", elastic_sections=2),
    "helix": sr.HelixTube(),
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.study] * (name != "pcc")) for name in ROBOTS])
def test_any_robot_is_drawn_with_its_body_and_actuators(name: str) -> None:
    model = sr.load_model(ROBOTS[name])
    held = sr.solve_equilibrium(model, model.relaxed_motors, (0.02, 0.01, 0.0), gravity=sr.EARTH_GRAVITY)
    figure = sr.plot(held, title="A $ robot")
    (axes,) = figure.axes
    check_scales(axes)
    assert {"body", "backbone"} <= words(figure)
    assert sum(text.startswith(("muscle", "tendon")) for text in words(figure)) == len(model.muscles)
    assert any(np.allclose(points[-1], held.tip_position, rtol=0.0, atol=1e-9) for points in ends_of(axes))
    assert figure.get_suptitle() == r"A \$ robot"


def test_a_picture_is_readable_at_400_pixels_and_shown_by_notebooks() -> None:
    figure = sr.plot(sr.solve_equilibrium(ARM, (0.3, 0.6, -0.8), (0, 10, -15)))
    assert smallest_text(figure) >= READABLE
    assert figure._repr_png_().startswith(b"\x89PNG")
    for axis in (figure.axes[0].xaxis, figure.axes[0].yaxis, figure.axes[0].zaxis):  # nothing is cut off at the edge
        box = axis.get_tightbbox(figure._get_renderer())
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1


def test_a_robot_given_as_parameters_is_drawn_at_rest_and_summarised() -> None:
    robot = sr.InflatableArm()
    tip = (sum(robot.link_lengths), 0.0, 0.0)
    assert any(np.allclose(points[-1], tip, rtol=0.0, atol=1e-9) for points in ends_of(sr.plot(robot).axes[0]))
    assert "stiffness" in robot.summary()
    assert "0.6  0.6 m" in robot.summary()
    assert "<svg" in robot._repr_html_()
    with pytest.raises(sr.ParameterError, match="a robot, a SoftModel"):
        sr.plot(sr.InflatableArm)


@pytest.mark.study
def test_models_solutions_and_movements_are_drawn() -> None:
    (axes,) = sr.plot(ARM).axes
    assert any(np.allclose(points, backbone(ARM, ARM.configuration(np.zeros(3))), atol=1e-12) for points in ends_of(axes))
    solution = sr.solve_ik(ARM, (0.8, 0.2, 0.4), (0, 0, -8))
    figure = sr.plot(solution)
    assert "target (cross)" in words(figure)
    assert any(np.allclose(points, [(0.8, 0.2, 0.4)], atol=1e-12) for points in ends_of(figure.axes[0]))
    path = sr.follow_trajectory(ARM, [(0.8, 0.2, 0.4), (0.8, 0.1, 0.4), (0.8, 0.0, 0.4)], (0, 0, -8))
    motion = sr.simulate(ARM, 0.02, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    floor = sr.Environment([sr.HalfSpace((0, 0, 1), offset=-0.2)])
    pressed = sr.follow_contact(ARM, [(0, -0.1 * step, 0) for step in range(3)], environment=floor)
    paths = (path, path.tip_positions), (motion, motion.tip_position), (pressed, pressed.tip_positions)
    for movement, tips in paths:
        figure = sr.plot(movement)
        check_scales(figure.axes[0])
        assert "path of the tip" in words(figure)
        assert any(points.shape == tips.shape and np.allclose(points, tips, atol=1e-12) for points in ends_of(figure.axes[0]))
    with pytest.raises(sr.ParameterError, match="a SoftModel, a Trajectory"):
        sr.plot(3)  # type: ignore[arg-type]


UNDRAWN = {"characterisation", "helix_design", "linear_model", "measurements", "motion_batch"}
"""Kinds of results that have no figure of their own: that of a characterisation needs its data, that of a design a tube."""


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_result_is_drawn_or_refused_with_those_that_are(kind: str) -> None:
    if kind in UNDRAWN:
        with pytest.raises(sr.ParameterError, match=r"a SoftModel, .* VibrationModes, Workspace, WorkspaceMap"):
            sr.plot(results()[kind])
    elif kind == "workspace_map":  # of one height, which is no area
        with pytest.raises(sr.ParameterError, match="at least two coordinates"):
            sr.plot(results()[kind])
    else:
        figure = sr.plot(results()[kind], title="A $ title")
        assert figure.get_suptitle() == r"A \$ title"
        assert smallest_text(figure) >= READABLE
        assert figure._repr_png_().startswith(b"\x89PNG")


NUMBER = r"-?\d+(?:\.\d+)?"


def small_picture(result: Any) -> tuple[str, np.ndarray, float]:
    """The picture in what a notebook shows of a result, the place of its tip [px], and its scale [px/m]."""
    page = result._repr_html_()
    svg = page[page.index("<svg") : page.index("</svg>")]
    bar, label = re.search(rf"h({NUMBER})\" stroke", svg), re.search(r">([\d.e-]+) m</text>", svg)
    *_, tip = re.findall(rf'cx="({NUMBER})" cy="({NUMBER})"', svg)
    assert bar is not None
    assert label is not None
    return svg, np.array(tip, dtype=float), float(bar[1]) / float(label[1])


@settings(max_examples=8)
@given(st.tuples(ANGLE, ANGLE, ANGLE), PUSH)
def test_a_notebook_shows_a_small_picture_to_scale(motors: tuple[float, ...], push: tuple[float, ...]) -> None:
    """The way from the base to the tip, as the eye sees it, in the lengths of the bar; all within the picture."""
    held = sr.solve_equilibrium(ARM, motors, push)
    svg, tip, scale = small_picture(held)
    assert len(svg) < 30_000
    (line,) = re.findall(r'<path d="M([^"]*)" fill="none" stroke="#1a1a1a" stroke-width="1.1"', svg)
    places = np.array([pair.split() for pair in line.split("L")], dtype=float)
    back = DrawnPose.of(held).eye / np.linalg.norm(DrawnPose.of(held).eye)
    way = held.tip_position - backbone(ARM, held.q)[0]
    seen = np.linalg.norm(way - back * (back @ way))
    assert np.linalg.norm(tip - places[0]) == pytest.approx(scale * seen, abs=0.25)  # places are told to 0.1 px
    assert np.all((places >= 0.0) & (places <= (340.0, 240.0)))
    x, y, z = np.round(held.tip_position, 4) + 0.0
    assert f"<title>inflatable_arm, tip at ({x:g}, {y:g}, {z:g}) m" in svg


@pytest.mark.study
def test_every_robot_and_pose_has_a_small_picture_and_meshes_have_none() -> None:
    for robot in ROBOTS.values():
        assert len(small_picture(sr.load_model(robot))[0]) < 30_000
    for kind in ("ik_solution", "imposed_displacement", "load_estimate", "trajectory", "contact_path", "motion"):
        assert len(small_picture(results()[kind])[0]) < 30_000
    motors = [f"panda_joint{number}" for number in (1, 2, 3, 5, 6, 7)]
    file = robot_file("panda_description/urdf/panda.urdf")
    panda = sr.load_model(file, springs={"panda_joint4": 200.0}, motors=motors, tip="panda_hand_tcp")
    assert inline_picture(panda) == ""


@pytest.mark.study
def test_meshes_are_drawn_within_a_hundredth_of_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Panda of example-robot-data, 130 000 triangles: corners move by less than half a diagonal of the grid."""
    motors = [f"panda_joint{number}" for number in (1, 2, 3, 5, 6, 7)]
    file = robot_file("panda_description/urdf/panda.urdf")
    model = sr.load_model(file, springs={"panda_joint4": 200.0}, motors=motors, tip="panda_hand_tcp")
    held = sr.solve_equilibrium(model, np.full(6, 0.02), (0, 0, -30))
    (axes,) = sr.plot(held).axes
    check_scales(axes)
    drawn = np.concatenate([one._faces for one in axes.collections if hasattr(one, "_faces")]).reshape(-1, 3)
    shapes = RobotShapes(model)
    placed = [
        triangles(shape.geometry)[0] @ pose[:3, :3].T + pose[:3, 3]
        for shape, pose in zip(shapes.shapes, shapes.transforms(held.q), strict=True)
    ]
    corners = np.concatenate(placed)
    assert np.allclose(drawn.min(axis=0), corners.min(axis=0), rtol=0.0, atol=0.012)
    assert np.allclose(drawn.max(axis=0), corners.max(axis=0), rtol=0.0, atol=0.012)
    assert canvas.png(axes.figure)
