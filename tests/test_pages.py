"""The pages and the moving picture of the documentation: self-contained, alive in a real Chromium, and up to date."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from contextlib import nullcontext
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softrobots as sr
from softrobots.robots import HelixTube
from softrobots.view.meshcat_page.page_commands import RESOLUTION, packed, read_page, tidied
from softrobots.view.meshcat_page.page_text import page_text
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.viewer import view
from studies.gallery.moving_picture import take_animation
from studies.gallery.scenes import EXHIBITS
from studies.shared import browser as view_browser
from studies.shared.browser import show_share
from tests.conftest import CHECKOUT
from tests.support.packed_pages import scene_of, unpacked
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

FOLDER = CHECKOUT / "docs" / "pages"
LIMITS = {"helix_growth": 3e6, "pcc_arm": 2e6, "inflatable_arm": 0.5e6, "wrist": 0.5e6, "ur5_bench": 2e6}
"""Pages, and how many bytes each may have: they are committed."""
BODIES = {"helix_growth": (2.0, 10.0), "pcc_arm": (0.3, 3.0)}
"""Pages that draw one body after the other, and how much more of it there may be at the end than at a quarter of the time."""


def opened(browser: object, file: Path, messages: list[str], size: tuple[int, int]) -> object:
    """A tab with a page, which has drawn its scene; `messages` gets errors and every request but that for the page."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.on("console", lambda message: messages.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", lambda request: messages.append(request.url) if request.url != file.as_uri() else None)
    page.goto(file.as_uri())
    page.wait_for_function("() => window.viewer")
    return page


def shot(page: object) -> np.ndarray:
    """Red, green, blue of the window with a white legend, shape (height, width, 3)."""
    from PIL import Image

    picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
    legend = {side: int(size) for side, size in page.locator("#softrobots-legend").bounding_box().items()}
    picture[: legend["y"] + legend["height"] + 1, : legend["x"] + legend["width"] + 1] = 255
    return picture[:-40]  # nor the line at the bottom


def coloured(picture: np.ndarray, name: str) -> np.ndarray:
    """Pixels in a robot's own colours, shape (height, width); background and floor are greys."""
    red, green, blue = (picture[..., channel] for channel in range(3))
    warm_or_purple = (red - blue > 60) | ((red + blue - 2 * green > 60) & (red > 40))
    return {
        "helix_growth": (blue - red > 30) & (green < 150) | (red - blue > 25),  # actuator, and the wall
        "pcc_arm": np.abs(blue - red) > 80,  # muscles that pull, and that push
        "inflatable_arm": warm_or_purple,
        "wrist": warm_or_purple,
        "ur5_bench": warm_or_purple | (picture.max(axis=2) < 60),  # the link, and the UR5's joints
    }[name]


def changed(one: np.ndarray, other: np.ndarray) -> int:
    return int(np.count_nonzero(np.abs(one - other).max(axis=2) > 30))


def check_phone(page: object, name: str) -> None:
    """Nothing sticks out of a narrow window, and the controls leave the legend alone."""
    page.set_viewport_size({"width": 390, "height": 844})
    show_share(page, 0.6)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390
    legend, controls = (page.locator(which).bounding_box() for which in ("#softrobots-legend", ".close-button"))
    assert legend["y"] >= controls["y"] + controls["height"]
    assert legend["x"] + legend["width"] <= 390
    below = int(legend["y"] + legend["height"])
    robot = np.nonzero(coloured(shot(page)[below:], name).any(axis=0))[0]
    assert 3 < robot.min() < robot.max() < 387


def check_controls(page: object) -> None:
    """A page that plays stops where one clicks."""
    page.evaluate("() => viewer.animator.play()")
    page.get_by_text("Open Controls").click()
    page.get_by_text("pause", exact=True).click()
    box = page.locator("li.has-slider").filter(has=page.get_by_text("time", exact=True)).locator(".slider").bounding_box()
    for share in (0.8, 0.2):
        page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        time, whole, playing = page.evaluate("() => { const a = viewer.animator; return [a.time, a.duration, a.playing]; }")
        assert not playing
        assert abs(time / whole - share) < 0.03  # a click hits a slider of a hundred pixels to within three
    page.get_by_text("Close Controls").click()


@pytest.mark.parametrize("name", LIMITS)
def test_a_page_lives(browser: object, name: str) -> None:
    """It asks for nothing and complains of nothing, the robot is there and plays by itself."""
    messages: list[str] = []
    page = opened(browser, FOLDER / f"{name}.html", messages, (800, 600))
    first = page.evaluate("() => viewer.animator.time")
    page.wait_for_function("first => viewer.animator.time > first + 0.3", arg=first)  # nobody pushed it
    show_share(page, 0.25)
    early = shot(page)
    covered = np.count_nonzero(coloured(early, name))
    assert covered > 400
    show_share(page, 0.95)
    late = shot(page)
    assert changed(early, late) > 800
    if name in BODIES:  # one at a time, not all that were shown so far; and a tube that grows is more of it
        least, most = BODIES[name]
        assert least < np.count_nonzero(coloured(late, name)) / covered < most
    show_share(page, 0.25)
    assert changed(early, shot(page)) == 0  # the same pose, the same picture
    if name == "inflatable_arm":  # the same script in all of them
        check_controls(page)
    check_phone(page, name)
    page.close()
    assert messages == []


def test_an_old_browser_says_what_is_missing(browser: object) -> None:
    page = browser.new_page()
    page.add_init_script("delete window.DecompressionStream")
    page.goto((FOLDER / "inflatable_arm.html").as_uri())
    page.get_by_text("This page needs WebGL and a browser of 2023 or newer").wait_for()
    page.close()


@lru_cache
def scene_on(name: str) -> tuple[str, list[bytes]]:
    """Script and commands of a committed page, unpacked once."""
    return scene_of((FOLDER / f"{name}.html").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", LIMITS)
def test_a_page_is_of_today(name: str) -> None:
    """Title, version and size of the committed page, and no name of an object that tells of a time or a machine."""
    page = (FOLDER / f"{name}.html").read_text(encoding="utf-8")
    title = EXHIBITS["wrinkling_arm" if name == "inflatable_arm" else name].title
    assert f"<title>{title}</title>" in page
    assert f'<meta name="generator" content="softrobots {sr.__version__}">' in page
    assert len(page) < LIMITS[name]
    script, commands = scene_on(name)
    assert "MeshCat" in script
    names = {match for command in commands for match in re.findall(rb"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}", command)}
    assert names
    assert all(name.startswith(b"00000000-0000-0000-0000-") for name in names)
    assert b"set_animation" in commands[-1]


def drawn_shapes(name: str) -> set[str]:
    """Names of the shapes of the deformed robot on a committed page."""
    import umsgpack

    commands = [umsgpack.unpackb(command) for command in scene_on(name)[1] if b"set_object" in command]
    drawn = (command["path"] for command in commands if command["type"] == "set_object")
    found = (re.match("/meshcat/softrobots/deformed/([^/]+)/", path) for path in drawn)
    return {match[1] for match in found if match}


def test_the_pages_show_the_robots_of_today() -> None:
    """What is drawn there are the shapes that the descriptions have now."""
    wristed = sr.InflatableArm(wrist=(0.08, 0.12))
    for name, robot in (("inflatable_arm", sr.InflatableArm()), ("wrist", wristed), ("pcc_arm", sr.PccArm())):
        assert drawn_shapes(name) == {shape.name for shape in RobotShapes(sr.load_model(robot)).shapes}
    assert {"forearm_link_0", "wrist_3_link_0"} <= drawn_shapes("ur5_bench")
    tube = HelixTube(length=2.0, elastic_sections=32, upright="axis")
    sections = {re.match("section_[0-9]+_[0-9]+", shape)[0] for shape in drawn_shapes("helix_growth") if "section" in shape}
    assert len(sections) == tube.n_sections


def test_a_page_made_again_is_the_committed_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same text around the scene, and the same commands.

    Numbers may differ by two steps of rounding, and packed bytes by the version of zlib, between two machines.
    """
    assert run_script("make_pages", ["--only", "inflatable_arm", "--output", str(tmp_path)]) == 0
    assert "inflatable_arm.html (0.3" in capsys.readouterr().out
    again, kept = ((folder / "inflatable_arm.html").read_text(encoding="utf-8") for folder in (tmp_path, FOLDER))
    assert without_scene(again) == without_scene(kept)
    (script, now), (other, then) = scene_of(again), scene_of(kept)
    assert script == other
    assert len(now) == len(then)
    for one, two in zip(now, then, strict=True):
        assert same(decoded(one), decoded(two))


def without_scene(page: str) -> str:
    return re.sub(r'type="text/plain">[^<]*<', "><", page)


def decoded(command: bytes) -> object:
    import umsgpack

    return umsgpack.unpackb(command)


def same(one: object, two: object) -> bool:
    """Whether decoded commands are equal, numbers within two steps of rounding."""
    if isinstance(one, dict):
        return isinstance(two, dict) and one.keys() == two.keys() and all(same(one[key], two[key]) for key in one)
    if isinstance(one, list):
        return isinstance(two, list) and len(one) == len(two) and all(map(same, one, two))
    if isinstance(one, float):
        return abs(one - two) <= 2.0 * RESOLUTION
    if hasattr(one, "data") and one.type == 0x17:
        return np.allclose(*(np.frombuffer(side.data, "<f4") for side in (one, two)), rtol=0.0, atol=2.0 * RESOLUTION)
    return one == two


def test_a_scene_gives_the_same_bytes_twice(arm: sr.SoftModel) -> None:
    loaded = sr.solve_equilibrium(arm, (0.1, 0.6, -0.8), (0, 10, -15))
    texts = []
    for _ in range(2):
        with view(arm, loaded) as viewer:
            texts.append(viewer.html("An arm & its load"))
    assert texts[0] == texts[1]
    assert "An arm &amp; its load" in texts[0]
    assert '"viewport"' in texts[0]  # a phone shows it in its own size


def test_commands_survive_packing() -> None:
    """Read back with another copy of msgpack's rules; arrays that several commands share are packed once."""
    import umsgpack

    corners = np.linspace(-1.0, 1.0, 3000, dtype="<f4") / 3.0
    random = b"6f1b3c5e-9a2d-11ef-8f21-0242ac120002"

    def command(place: str) -> bytes:
        array = umsgpack.Ext(0x17, corners.tobytes())
        return umsgpack.packb({"type": "set_object", "path": place, "uuid": random.decode(), "array": array, "size": 0.1234567})

    played = umsgpack.packb({"type": "set_animation", "path": "", "keys": [{"time": 1, "value": [0.1, -1e-9]}]})
    before = [played, command("/a"), command("/b")]
    after = tidied(before)
    text = packed("let a = '</' + 'script>';", after)
    assert len(text) < 1.5 * len(corners.tobytes())  # base64 of one array, not of two
    script, commands = unpacked(text)
    assert script == "let a = '</' + 'script>';"
    assert commands == after
    first, second, last = map(umsgpack.unpackb, commands)
    assert (first["path"], second["path"], last["type"]) == ("/a", "/b", "set_animation")  # what moves is there first
    assert first["uuid"] == second["uuid"] == "00000000-0000-0000-0000-000000000000"
    assert abs(first["size"] - 0.1234567) <= 0.5 * RESOLUTION
    assert np.abs(np.frombuffer(first["array"].data, "<f4") - corners).max() <= 0.5 * RESOLUTION + 2.0**-24  # and its float32
    assert last["keys"] == [{"time": 1, "value": [round(0.1 / RESOLUTION) * RESOLUTION, 0.0]}]


@each_row(
    ("call", "message"),
    [
        (lambda: read_page("<html></html>"), "holds no script or no commands"),
        (lambda: read_page("<script>/*! meshcat */</script>"), "holds no script or no commands"),
        (lambda: page_text("<html></html>", "a", []), "holds no script or no commands"),
    ],
)
def test_what_is_no_page_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(sr.ViewerError, match=message):
        call()


def test_a_moving_picture_moves_and_repeats(browser: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL import Image

    monkeypatch.setattr(view_browser, "open_browser", lambda: nullcontext(browser))
    page = FOLDER / "inflatable_arm.html"
    file = take_animation(page, tmp_path / "a.gif", width=320, height=240, seconds=0.9, frames=3)
    with Image.open(file) as picture:
        assert (picture.n_frames, picture.size, picture.info["loop"], picture.info["duration"]) == (3, (320, 240), 0, 300)
        frames = []
        for number in range(3):
            picture.seek(number)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
    assert all(changed(frames[number], frames[number - 1]) > 500 for number in range(3))
    for options, message in (({"frames": 1}, "frames"), ({"seconds": 0.0}, "seconds")):
        with pytest.raises(sr.ParameterError, match=message):
            take_animation(page, tmp_path / "b.gif", **options)
    with pytest.raises(sr.ViewerError, match="is no file"):
        take_animation(tmp_path / "missing.html", tmp_path / "b.gif")
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


def test_the_moving_picture_of_the_readme(tool: Callable[[str], ModuleType]) -> None:
    """Small enough for a first screen, some seconds long, and the end goes over into the start."""
    tool("PIL")
    from PIL import Image

    file = CHECKOUT / "docs" / "images" / "inflatable_arm.gif"
    assert file.stat().st_size < 1.5e6
    with Image.open(file) as picture:
        assert 640 <= picture.width <= 800
        assert 4.0 <= picture.n_frames * picture.info["duration"] / 1000.0 <= 6.0
        frames = []
        for number in (0, 1, picture.n_frames // 2, picture.n_frames - 1):
            picture.seek(number)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
    first, second, middle, last = frames
    assert changed(first, middle) > 3.0 * changed(first, second)
    assert changed(first, last) < 2.0 * changed(first, second)  # no jump


def test_a_folder_that_is_a_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("keep", encoding="utf-8")
    assert run_script("make_pages", ["--only", "inflatable_arm", "--output", str(tmp_path / "file")]) == 2
    assert "error: " in capsys.readouterr().err
    assert (tmp_path / "file").read_text(encoding="utf-8") == "keep"
