"""Pages show the whole robot in windows of every shape, and are used with a keyboard; in a real Chromium."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.third_party import robot_file
from softrobots.view.camera import narrowest, whole_view
from studies.shared.browser import show_share

WINDOWS = (1200, 500), (800, 600), (380, 760)
"""Wide, as a screen, and as a phone [px]."""

ON_SCREEN = """() => {
  viewer.render();
  const found = [Infinity, Infinity, -Infinity, -Infinity], corner = new MeshCat.THREE.Vector3();
  const robot = viewer.scene_tree.find(["meshcat", "softrobots"]), floor = robot.children["floor"].object;
  const drawn = one => one === floor ? null : (one.isMesh && visit(one), one.children.forEach(drawn));
  const visit = mesh => {
    const places = mesh.geometry.attributes.position;
    for (let n = 0; n < places.count; n++) {
      corner.fromBufferAttribute(places, n).applyMatrix4(mesh.matrixWorld).project(viewer.camera);
      for (const [axis, at] of [corner.x, corner.y].entries()) {
        found[axis] = Math.min(found[axis], at);
        found[axis + 2] = Math.max(found[axis + 2], at);
      }
    }
  };
  drawn(robot.object);
  return found;
}"""
"""Smallest and largest place of every corner of every mesh on the screen, which reaches from -1 to 1 across and up."""


def panda() -> sr.Equilibrium:
    motors = [f"panda_joint{number}" for number in (1, 2, 3, 5, 6, 7)]
    file = robot_file("panda_description/urdf/panda.urdf")
    model = sr.load_model(file, springs={"panda_joint4": 200.0}, motors=motors, tip="panda_hand_tcp")
    return sr.solve_equilibrium(model, np.full(6, 0.02), (0, 0, -30))


def loaded(robot: Any, force: tuple[float, float, float]) -> sr.Equilibrium:
    model = sr.load_model(robot)
    return sr.solve_equilibrium(model, model.relaxed_motors, force, gravity=sr.EARTH_GRAVITY)


ROBOTS: dict[str, Callable[[], sr.Equilibrium]] = {
    "arm": lambda: loaded(sr.InflatableArm(), (0, 10, -15)),
    "pcc": lambda: loaded(sr.PccArm(), (6, 4, -3)),
    "helix": lambda: loaded(sr.HelixTube(), (0, 0, -0.2)),
    "panda": panda,
}


def opened(browser: Any, file: Path, size: tuple[int, int]) -> Any:
    page = browser.new_page(viewport=dict(zip(("width", "height"), size, strict=True)))
    page.goto(file.as_uri())
    show_share(page, 0.0)
    return page


@pytest.mark.parametrize("name", ROBOTS)
def test_the_whole_robot_is_in_every_window(
    browser: object, name: str, tool: Callable[[str], ModuleType], tmp_path: Path
) -> None:
    """Corners that three.js projects, those of arrows too; and the robot takes a fifth of the window or more one way."""
    held = ROBOTS[name]()
    with sr.view(held.model, held) as viewer:
        file = viewer.write_html(tmp_path / "page.html")
    for size in WINDOWS if name != "panda" else WINDOWS[-1:]:  # all its meshes take seconds a window
        page = opened(browser, file, size)
        places = np.array(page.evaluate(ON_SCREEN))
        assert page.get_by_text("force", exact=False).first.is_visible() == (size[0] > 640)  # a legend folds on a phone
        page.close()
        assert np.abs(places).max() <= 1.0, size
        assert np.max(places[2:] - places[:2]) > 0.4, size
        assert name != "pcc" or places[3] - places[1] > 1.2, "an upright robot is as high in narrow windows"


def test_keys_turn_zoom_and_pause(browser: object, tmp_path: Path) -> None:
    """An arrow key turns by 0.1 rad about the middle, plus comes nearer by a tenth, and what has the focus has a frame."""
    arm = sr.load_model(sr.InflatableArm())
    path = sr.follow_trajectory(arm, [(0.8, 0.2, 0.4), (0.8, -0.2, 0.4)], (0, 0, -8), times=(0.0, 1.0))
    with sr.view(arm, path) as viewer:
        file = viewer.write_html(tmp_path / "page.html", title="An arm")
    page = opened(browser, file, (800, 600))

    def place() -> np.ndarray:
        return np.array(page.evaluate("() => viewer.camera.position.toArray()"))

    page.keyboard.press("Tab")
    scene = page.get_by_role("application", name="An arm")
    assert page.evaluate("() => document.activeElement.id") == "meshcat-pane"
    assert scene.evaluate("one => getComputedStyle(one).outlineStyle") == "solid"
    first = place()
    page.keyboard.press("ArrowRight")
    turned = place()
    cosine = first[[0, 2]] @ turned[[0, 2]] / np.prod(np.linalg.norm([first[[0, 2]], turned[[0, 2]]], axis=1))  # y is up
    assert np.arccos(cosine) == pytest.approx(0.1, abs=1e-6)
    assert turned[1] == pytest.approx(first[1], abs=1e-9)
    page.keyboard.press("ArrowUp")
    assert place()[1] > first[1]
    distance = np.linalg.norm(place())
    page.keyboard.press("+")
    assert np.linalg.norm(place()) == pytest.approx(0.9 * distance, rel=1e-6)
    page.keyboard.press("-")
    assert np.linalg.norm(place()) == pytest.approx(distance, rel=1e-6)
    playing = page.evaluate("() => viewer.animator.playing")
    page.keyboard.press(" ")
    assert page.evaluate("() => viewer.animator.playing") != playing
    assert "arrow keys" in page.locator("#softrobots-hint").inner_text()
    page.close()


POINT = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


@settings(max_examples=100)
@given(st.lists(POINT, min_size=2, max_size=8), st.tuples(st.floats(0.1, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)))
def test_no_point_is_outside_of_the_picture(points: list[tuple[float, ...]], away: tuple[float, ...]) -> None:
    """Seen in a pyramid of 75 degrees from below to above, whose base is 1.4 times as wide as high."""
    corners = np.array(points)
    eye, middle = whole_view(corners, np.array(away))
    back = (eye - middle) / np.linalg.norm(eye - middle)
    assert np.allclose(back, np.array(away) / np.linalg.norm(away), atol=1e-9)
    assert np.linalg.norm(eye - middle) >= np.linalg.norm(away) * (1.0 - 1e-12)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    depth, half = (eye - corners) @ back, np.tan(np.deg2rad(37.5))
    rounding = 1e-12
    assert np.all(np.abs((corners - eye) @ np.cross(back, right)) <= half * depth + rounding)
    assert np.all(np.abs((corners - eye) @ right) <= 1.4 * half * depth + rounding)
    least = narrowest(corners, eye, middle)
    assert least <= 1.4 + 1e-6
    slopes = np.abs((corners - eye) @ right) / np.maximum(depth, 1e-9)  # a point may be at the eye
    assert np.max(slopes) == pytest.approx(0.9 * least * half, abs=1e-6)  # a tenth is left
