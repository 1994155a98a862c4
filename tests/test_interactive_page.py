"""The page that solves by itself, in a real Chromium, from a file, without a network: its answers, drawing and controls."""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.view.body import body_at
from softrobots.view.interactive.robot_data import robot_data
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.slider_ranges import visible_force
from studies.gallery.live_pages import LIVE_PAGES
from tests.conftest import CHECKOUT

ROBOTS: dict[str, Callable[[], Any]] = {
    "arm": sr.InflatableArm,
    "pcc": sr.PccArm,
    "tendon": sr.TendonArm,
    "helix": sr.HelixTube,
    "lumped": lambda: sr.PccArm(chain="lumped"),
}
RUBBING = sr.TendonArm(
    segment_lengths=(0.08,), kind="tension", elastic_sections=3, bending_friction=1e-3, guide_friction=0.2, tendon_force=20.0
)
"""Dry friction of both kinds: what this one shows depends on the way there."""
STARTS = {"arm": {"q_motors": (0.3, 0.6, -0.8), "force": (0, 10, -15)}, "helix": {"gravity": sr.EARTH_GRAVITY}}
SIZES = {"wide": (760, 460), "phone": (390, 844), "frame": (400, 460)}


class Tab:
    """A page in the browser, and what it complains about or requests."""

    def __init__(self, browser: Any, file: Path, size: str = "wide", state: str = "") -> None:
        width, height = SIZES[size]
        self.context = browser.new_context(viewport={"width": width, "height": height}, has_touch=True)
        self.page = self.context.new_page()
        self.errors: list[str] = []
        self.requests: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda line: self.errors.append(line.text) if line.type == "error" else None)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.context.set_offline(True)
        self.page.goto(file.as_uri() + state)
        self.page.evaluate("softrobots.ready.then(() => true)")

    def run(self, script: str, value: Any = None) -> Any:
        """Run a function in the page."""
        return self.page.evaluate(script, value)

    def shown(self, wanted: Callable[[dict[str, Any]], bool] = lambda _: True) -> dict[str, Any]:
        """What is shown, once it is as wanted."""
        for _ in range(200):
            shown = self.run("softrobots.shown")
            if wanted(shown):
                return shown
            self.page.wait_for_timeout(25)
        raise AssertionError(f"the page still shows {shown}")


@pytest.fixture(scope="module")
def models() -> dict[str, sr.SoftModel]:
    return {name: sr.load_model(robot()) for name, robot in ROBOTS.items()} | {"rubbing": sr.load_model(RUBBING)}


@pytest.fixture(scope="module")
def files(models: dict[str, sr.SoftModel], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    return {
        name: sr.interactive(model, **STARTS.get(name, {})).write_html(folder / f"{name}.html")
        for name, model in models.items()
    }


@pytest.fixture
def open_tab(browser: Any, files: dict[str, Path]) -> Iterator[Callable[..., Tab]]:
    tabs: list[Tab] = []

    def opened(name: str, size: str = "wide", state: str = "") -> Tab:
        tabs.append(Tab(browser, files[name], size, state))
        return tabs[-1]

    yield opened
    for tab in tabs:
        tab.context.close()
        assert tab.errors == []
        assert [url for url in tab.requests if not url.startswith("file:")] == []
        assert len(tab.requests) == 1


def loaded(model: sr.SoftModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Actuators within a third of their limits, and a force that bends the robot visibly."""
    motors = model.relaxed_motors
    if model.n_motors:
        motors = motors + 0.3 * (np.array(model.actuators.draw(rng)) - motors)
    return motors, 0.3 * visible_force(model) * rng.normal(size=3)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_page_solves_and_draws_what_python_solves(
    name: str, open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel], rng: np.random.Generator
) -> None:
    """Newton's method on Pinocchio and the generated code in the browser; both leave at most 1e-10 of the load."""
    model, tab = models[name], open_tab(name)
    shapes = RobotShapes(model)
    for gravity in (None, sr.EARTH_GRAVITY, (3.0, 0.0, -5.0)):
        motors, force = loaded(model, rng)
        expected = sr.solve_equilibrium(model, motors, force, gravity=gravity)
        given = {"motors": motors.tolist(), "force": force.tolist(), "gravity": gravity}
        found = tab.run("given => { const a = softrobots.solve(given); return {...a, springs: [...a.springs]}; }", given)
        assert (found["status"], found["statusText"]) == (0, "certified stable")
        np.testing.assert_allclose(found["tip"], expected.tip_position, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found["springs"], expected.q_springs, rtol=0, atol=1e-9)
        drawn = tab.run(
            """given => {
            softrobots.set(given);
            const {view} = softrobots, words = document.getElementById("links").innerText;
            return {tip: softrobots.shown.drawnTip, words, poses: view.solids.map(({mesh}) => mesh.matrix.elements),
              rings: view.tubes.map(({drawn: {geometry, rings, sides}}) => {
                const at = geometry.attributes.position.array, points = [];
                for (let ring = 0; ring < rings; ring++) {
                  const sum = [0, 0, 0];
                  for (let k = 0; k < sides; k++) for (let a = 0; a < 3; a++) sum[a] += at[3 * (ring * sides + k) + a] / sides;
                  points.push(sum);
                }
                return points;
              })};
            }""",
            given,
        )
        np.testing.assert_allclose(drawn["tip"], expected.tip_position, rtol=0, atol=1e-9)
        poses = [np.reshape(pose, (4, 4)).T for pose in drawn["poses"]]
        everything = np.array(shapes.transforms(model.embed(model.coordinates.at(motors, expected.q_springs).joints)))
        for pose in poses:  # the page leaves out pieces of the chain in sections; 1e-7 m is what is rounded in the file
            assert np.abs(everything - pose).max(axis=(1, 2)).min() < 3e-7
        if model.structure.section_table:
            points = np.concatenate([segment.backbone for segment in body_at(model, expected.q_motors, expected.q_springs)])
            # corners are numbers of 32 bits; lumped sections end near the smooth body, a fifth of its radius
            near = 3e-7 if model.structure.constant_strain else 0.2 * model.structure.section_table[0].radius
            assert drawn["rings"]
            for ring in np.concatenate(drawn["rings"]):
                assert np.linalg.norm(points - ring, axis=1).min() < near
        words = tab.page.locator("#motors .row > span:first-child").all_inner_texts()[-len(expected.muscle_forces) or None :]
        for row, tension, slack in zip(words, expected.muscle_forces, expected.muscle_slack, strict=False):
            assert ("slack" if slack else f"{'pulls' if tension > 0 else 'pushes'} {abs(tension):.3g} N") in row
        margins = expected.link_limits.wrinkling_margins
        if len(margins):
            shown = [int(number) for number in re.findall(r"(-?\d+) % left", drawn["words"])]
            wanted = margins if len(margins) <= 4 else [margins.min()]
            np.testing.assert_allclose(shown, 100 * np.array(wanted), atol=0.51)


def test_a_wrinkled_link_is_told_beside_the_certificate(open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel]) -> None:
    """Stable, but the springs of a wrinkled link are softer than the model's: the badge is not the green one."""
    tab = open_tab("arm")
    case = {"motors": [0.3, 0.6, -0.8], "force": [0, 12, -18]}
    assert sr.solve_equilibrium(models["arm"], case["motors"], case["force"]).wrinkled
    told = "() => { const box = document.getElementById('status'); return [box.className, box.innerText.trim()]; }"
    assert [link["name"] for link in tab.run("given => softrobots.set(given).links", case)] == ["link 1", "link 2"]
    assert tab.run(told) == ["neutral", "certified stable, but wrinkled"]
    tab.run("given => { softrobots.set(given); }", case | {"force": [0, 10, -15]})
    assert tab.run(told) == ["good", "certified stable"]


def test_sliders_numbers_and_gravity_change_what_is_shown(
    open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel]
) -> None:
    tab = open_tab("arm")
    page = tab.page
    page.get_by_role("slider", name="motor_2").focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    raised = tab.shown(lambda shown: shown["motors"][1] > 0.69)
    assert raised["motors"][0] == 0.3
    page.get_by_role("spinbutton", name="force z").fill("-3.25")
    pulled = tab.shown(lambda shown: shown["force"] == [0, 10, -3.25])
    page.get_by_label("gravity").select_option(label="down, 9.81 m/s²")
    heavy = tab.shown(lambda shown: shown["gravity"] is not None)
    for state in (raised, pulled, heavy):
        expected = sr.solve_equilibrium(models["arm"], state["motors"], state["force"], gravity=state["gravity"])
        np.testing.assert_allclose(state["drawnTip"], expected.tip_position, rtol=0, atol=1e-9)
    assert page.get_by_text("beyond its limits").count() == 0
    page.get_by_role("spinbutton", name="motor_1").fill("17")
    tab.shown(lambda shown: shown["motors"][0] == 17)
    assert page.get_by_text("974° beyond its limits").count() == 1
    page.get_by_role("button", name="Reset").click()
    tab.shown(lambda shown: shown["force"] == [0, 10, -15] and shown["gravity"] is None and shown["motors"] == [0.3, 0.6, -0.8])


@pytest.mark.parametrize("name", ["arm", "pcc", "helix"])
def test_dragging_the_tip_pulls_it(name: str, open_tab: Callable[..., Tab]) -> None:
    tab = open_tab(name)
    before = tab.shown()
    drag(tab, 60, -40)
    after = tab.shown(lambda shown: shown["force"] != before["force"])
    assert after["motors"] == before["motors"]
    pull, moved = np.subtract(after["force"], before["force"]), np.subtract(after["tip"], before["tip"])
    assert pull @ moved > 0  # of a stable robot under a dead force
    right, up, _ = (np.array(list(axis.values())) for axis in tab.run("softrobots.view.axes().map(({x, y, z}) => ({x, y, z}))"))
    assert pull @ right > 0
    assert pull @ up > 0


@pytest.mark.parametrize("name", ["arm", "pcc"])
def test_dragging_the_tip_moves_the_motors(name: str, open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel]) -> None:
    tab = open_tab(name)
    before = tab.shown()
    tab.page.get_by_label("moves the").check()
    target = drag(tab, -50, -30)
    after = tab.shown(lambda shown: shown["motors"] != before["motors"])
    assert after["force"] == before["force"]
    x, y = tab.run("softrobots.view.onScreen(softrobots.view.tip)")
    assert np.hypot(x - target[0], y - target[1]) < 12  # pixels; it was 58 away
    low, high = models[name].motor_limits.T
    assert np.all((np.array(after["motors"]) >= low) & (np.array(after["motors"]) <= high))


def drag(tab: Tab, right: float, down: float) -> tuple[float, float]:
    """Drag the tip by pixels; where the pointer is then, if it took the tip in its middle."""
    box = tab.page.locator("#tip").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    tab.page.mouse.move(x + right, y + down, steps=6)
    tab.page.wait_for_timeout(600)
    tab.page.mouse.up()
    return x + right, y + down


def test_keys_pull_the_tip_and_turn_the_picture(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("helix")
    page = tab.page
    page.locator("#tip").focus()
    page.keyboard.press("ArrowUp")
    assert tab.shown(lambda shown: any(shown["force"]))["force"][2] > 0
    page.locator("#canvas").focus()
    before = tab.run("softrobots.view.view.turn")
    page.keyboard.press("ArrowLeft")
    assert tab.run("softrobots.view.view.turn") != before


def test_the_camera_follows_a_robot_that_leaves_the_picture_until_it_is_turned(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("arm")
    outside = """() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(
      softrobots.view.points().some(one => {
        const {x, y} = one.project(softrobots.view.camera);
        return Math.max(Math.abs(x), Math.abs(y)) > 1.01;
      })
    ))))"""
    away = tab.run("softrobots.view.view.distance")
    tab.run("() => { softrobots.set({motors: [0.3, 0.62, -0.8]}); }")
    assert not tab.run(outside)
    assert tab.run("softrobots.view.view.distance") == away  # it stays where nothing leaves
    tab.run("() => { softrobots.set({motors: [-2.6, 1.2, 0.3]}); }")
    assert not tab.run(outside)
    tab.page.locator("#canvas").focus()
    for _ in range(8):
        tab.page.keyboard.press("+")
    assert tab.run(outside)


def test_bad_input_is_refused_and_says_what_is_required(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("arm")
    before = tab.shown()
    for given, words in (
        ("{motors: [0, 1]}", r"\[0, 1\].*3 finite numbers"),
        ("{motors: [0, 1, NaN]}", r"NaN.*3 finite numbers"),
        ("{motors: {motor_9: 1}}", "motor_9.*motor_1"),
        ("{force: 3}", "3.*3 finite numbers"),
        ("{force: [0, 0, '1']}", "3 finite numbers"),
        ("{gravity: [0, 0, Infinity]}", "Infinity.*3 finite numbers"),
        ("{mass: 1}", "mass.*motors, force, gravity"),
        ("7", "7.*an object"),
    ):
        for call in ("solve", "set"):
            script = (
                f"() => {{ try {{ softrobots.{call}({given}); return null; }} catch (e) {{ return [e.name, e.message]; }} }}"
            )
            name, message = tab.run(script)
            assert name == "TypeError"
            assert re.search(words, message), message
    assert tab.shown() == before
    assert tab.run("softrobots.set({motors: {motor_2: 0.1}}).status") == 0
    assert tab.shown()["motors"] == [0.3, 0.1, -0.8]  # the others stay
    tab.run("softrobots.set({motors: [0, 0, 0], force: [0, -1e-6, 0]})")
    assert -5e-5 < tab.shown()["tip"][1] < 0.0
    assert "1.2000  0.0000  0.0000" in re.sub(r"[^\S\n]+", "  ", tab.page.inner_text("#facts"))  # no sign on zero
    words = open_tab("helix").run("() => { try { softrobots.solve({motors: [1]}); } catch (e) { return e.message; } }")
    assert words == "motors: [1] came; required: [], the robot has no motors"


def test_a_pose_stays_where_there_is_no_equilibrium_and_the_page_says_why(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("pcc")
    before = tab.shown()
    found = tab.run("softrobots.set({force: [1e5, 0, 0]})")
    assert found["status"] not in (0, 8)
    after = tab.shown()
    assert after["tip"] == before["tip"]
    assert after["failed"] == found["statusText"]
    assert found["statusText"] in tab.page.inner_text("#status")
    assert "last certified pose" in tab.page.inner_text("#status")
    tab.run("softrobots.set({force: [0, 0, 0]})")
    assert tab.shown()["failed"] == ""


@pytest.mark.parametrize("size", ["phone", "frame"])
def test_a_narrow_window_shows_robot_and_controls(size: str, open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("arm", size)
    width, height = SIZES[size]
    assert tab.run("document.documentElement.scrollWidth") <= width
    toggle = tab.page.locator("#toggle")
    if size == "frame":
        assert not tab.page.locator("#panel").is_visible()
        toggle.tap()
    slider = tab.page.get_by_role("slider", name="motor_1")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= width
    assert box["y"] + box["height"] <= height
    points = tab.run(
        """() => { const {view} = softrobots; return view.solids.map(({mesh}) => {
          const at = view.tip.clone().setFromMatrixPosition(mesh.matrix); return view.onScreen(at); }); }"""
    )
    across, down = np.array(points).T
    assert across.min() > 0
    assert across.max() < width
    assert down.min() > 0
    assert down.max() < tab.page.locator("#canvas").bounding_box()["height"]
    toggle.tap()
    assert not tab.page.locator("#panel").is_visible()


def test_the_address_holds_the_state(open_tab: Callable[..., Tab]) -> None:
    tab = open_tab("arm")
    tab.run("softrobots.set({motors: [0.1, 0.2, 0.3], force: [1, 2, -3], gravity: [0, 0, -1.62]})")
    state = "#" + tab.page.url.partition("#")[2]
    again = open_tab("arm", "wide", state).shown()
    assert {name: again[name] for name in ("motors", "force", "gravity")} == {
        "motors": [0.1, 0.2, 0.3],
        "force": [1, 2, -3],
        "gravity": [0, 0, -1.62],
    }


def walked(model: sr.SoftModel, last: sr.Equilibrium | None, wanted: dict[str, Any], at: dict[str, Any]) -> sr.Equilibrium:
    """Go where the page goes, with the general solver: a step is at most a fiftieth of a slider, here of each tension."""
    ways = {name: np.subtract(wanted[name], at[name]) for name in ("motors", "force")}
    full = 2.0 * visible_force(model)
    longest = max(np.abs(ways["motors"]).max() / 20.0, np.abs(ways["force"]).max() / full)
    steps = max(1, int(np.ceil(50.0 * longest - 1e-9)))
    for step in range(1, steps + 1):
        motors, force = (np.array(at[name]) + ways[name] * step / steps for name in ("motors", "force"))
        last = sr.solve_equilibrium(model, motors, force, previous=last)
    assert last is not None
    return last


@pytest.mark.study
def test_a_slider_draws_the_loop_of_friction(open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel]) -> None:
    """Up and down by the slider, and with a force beside it: each pose is that of `solve_equilibrium(previous=)` in the same
    steps, to 1e-9, as above. Reset forgets, and a link leads from rest to its state."""
    model, tab = models["rubbing"], open_tab("rubbing")
    slider, facts = tab.page.get_by_role("slider", name="tendon_1_1"), tab.page.locator("#friction")
    assert facts.is_visible()
    assert "Dry friction" in facts.inner_text()
    assert not tab.page.locator("#mode").is_visible()  # a tip that is dragged is pulled
    at, last, loop = tab.shown(), None, []
    start = at["tip"]
    for pull in (6.0, 12.0, 11.8, 6.0, 0.0, 6.0, 12.0):
        slider.fill(str(pull))
        shown = tab.shown(lambda shown, pull=pull: shown["motors"][0] == pull)
        last = walked(model, last, shown, at)
        np.testing.assert_allclose(shown["drawnTip"], last.tip_position, rtol=0, atol=1e-9)
        at, loop = shown, [*loop, shown["tip"][0]]
    up, top, back, down, zero, again, closed = loop
    assert top - back < 2e-3 * top  # it sticks
    assert down - up > 0.1 * top  # the other side of the loop
    assert zero > 1e-3
    np.testing.assert_allclose((again, closed), (up, top), rtol=1e-6)  # the loop closes: what slips all the way forgets
    force = (0.1 * visible_force(model) * np.array([1.0, 2.0, 0.0])).tolist()
    tab.run("given => { softrobots.set(given); }", {"motors": [4.0, 3.0, 0.0], "force": force})
    shown = tab.shown()
    last = walked(model, last, shown, at)
    np.testing.assert_allclose(shown["tip"], last.tip_position, rtol=0, atol=1e-9)
    state = "#" + tab.page.url.partition("#")[2]
    linked, origin = open_tab("rubbing", "wide", state).shown(), {"motors": np.zeros(3), "force": np.zeros(3)}
    np.testing.assert_allclose(linked["tip"], walked(model, None, linked, origin).tip_position, rtol=0, atol=1e-9)
    assert np.abs(np.subtract(linked["tip"], shown["tip"])).max() > 1e-3
    tab.page.get_by_role("button", name="Reset").click()
    np.testing.assert_allclose(tab.shown(lambda shown: shown["motors"] == [0.0] * 3)["tip"], start, rtol=0, atol=1e-12)
    slider.fill("6")
    np.testing.assert_allclose(tab.shown(lambda shown: shown["motors"][0] == 6.0)["tip"][0], up, rtol=0, atol=1e-12)


@pytest.mark.study
def test_a_way_with_friction_ends_where_it_leads_no_further(
    open_tab: Callable[..., Tab], models: dict[str, sr.SoftModel]
) -> None:
    """What is shown is the last certified pose on the way, from which the next change goes on; a tip that was pulled stays."""
    tab = open_tab("rubbing")
    before = tab.shown()
    found = tab.run("softrobots.set({motors: [200, 0, 0]})")
    stopped = tab.shown()
    assert found["statusText"] == stopped["failed"] == "a section is at the end of its range"
    assert "last certified pose" in tab.page.inner_text("#status")
    assert 50.0 < stopped["motors"][0] < 100.0
    tab.run("softrobots.set({motors: [60, 0, 0]})")
    model, here = models["rubbing"], sr.solve_equilibrium(models["rubbing"], (40.0, 0.0, 0.0))
    for way in (stopped["motors"][0], 60.0):  # of one tendon steps of any size lead to the same
        for pull in np.linspace(here.q_motors[0], way, 12)[1:]:
            here = sr.solve_equilibrium(model, (pull, 0.0, 0.0), previous=here)
    np.testing.assert_allclose(tab.shown()["tip"], here.tip_position, rtol=0, atol=1e-9)
    tab.page.get_by_role("button", name="Reset").click()
    tab.shown(lambda shown: shown["failed"] == "" and shown["tip"] == before["tip"])
    drag(tab, 60, -40)
    pulled = tab.shown(lambda shown: shown["force"] != before["force"])
    tab.page.get_by_role("button", name="No force").click()
    let_go = tab.shown(lambda shown: shown["force"] == [0, 0, 0])
    moved, left = (np.subtract(one["tip"], before["tip"]) for one in (pulled, let_go))
    assert pulled["force"] @ moved > 0.0
    assert 0.01 * np.linalg.norm(moved) < np.linalg.norm(left) < np.linalg.norm(moved)


def test_the_page_works_in_the_frame_of_a_notebook(browser: Any, models: dict[str, sr.SoftModel]) -> None:
    inline = sr.interactive(models["arm"], q_motors={"motor_1": 0.0, "motor_2": 0.5, "motor_3": -0.5})
    tab = browser.new_page(viewport={"width": 800, "height": 640})
    tab.set_content(f"<body>{inline._repr_html_()}</body>")
    frame = tab.frames[1]
    frame.wait_for_function("window.softrobots?.shown?.tip")
    assert frame.evaluate("softrobots.shown.motors") == [0.0, 0.5, -0.5]
    tab.close()


def test_the_example_of_the_guide_talks_to_the_page_in_its_frame(browser: Any, files: dict[str, Path]) -> None:
    guide = (CHECKOUT / "docs" / "watch.md").read_text(encoding="utf-8")
    example = guide.split("```html\n")[1].split("```")[0]
    texts = {"http://arm.test/": example, "http://arm.test/live_arm.html": files["arm"].read_text(encoding="utf-8")}
    tab, messages = browser.new_page(viewport={"width": 800, "height": 640}), []
    tab.on("pageerror", lambda error: messages.append(str(error)))
    tab.route("**/*", lambda route: route.fulfill(body=texts.get(route.request.url, ""), content_type="text/html"))
    tab.goto("http://arm.test/")
    frame = tab.frames[1]
    frame.wait_for_function("window.softrobots?.shown?.gravity")
    assert frame.evaluate("softrobots.shown.motors") == [0.3, 0.2, -0.8]
    assert messages == []
    tab.close()


@pytest.mark.study
def test_pages_are_small_and_the_same_again(arm: sr.SoftModel, tmp_path: Path) -> None:
    page = sr.interactive(arm, title="<Arm> & co")
    file = page.write_html(tmp_path / "arm.html")
    text = file.read_text(encoding="utf-8")
    assert len(text) < 1_000_000
    assert "<title>&lt;Arm&gt; &amp; co</title>" in text
    assert sr.interactive(arm, title="<Arm> & co").page == text
    assert not re.search(r"(?:src|href)=\"https?:", text)
    with pytest.raises(sr.OutputExists, match="exists"):
        page.write_html(file)
    with pytest.raises(sr.ParameterError, match="force"):
        sr.interactive(arm, force=(0, 0, np.nan))
    with pytest.raises(sr.DescriptionError, match="compiled solvers"):
        sr.interactive(sr.load_model(sr.InflatableArm(moment_law="plateau", max_moment=20.0)))


@pytest.mark.study
def test_pages_of_long_robots_are_small(files: dict[str, Path]) -> None:
    assert max(file.stat().st_size for file in files.values()) < 2_500_000


@pytest.mark.study
@pytest.mark.parametrize("name", LIVE_PAGES)
def test_pages_of_the_documentation_are_up_to_date(name: str, tmp_path: Path) -> None:
    again = LIVE_PAGES[name].write(tmp_path / "page.html").read_bytes()
    same = again == (CHECKOUT / "docs" / "pages" / f"{name}.html").read_bytes()  # pytest would compare megabytes for minutes
    assert same, "python scripts/make_pages.py makes them again"


@pytest.mark.study
def test_guides_begin_with_a_page_which_the_site_shows() -> None:
    hook = runpy.run_path(str(CHECKOUT / "docs" / "site" / "embedded_pages.py"))["on_page_content"]
    pages = {"inflatable_arm": "inflatable_arm", "pcc_arm": "pcc_arm", "actuators": "tendon_arm", "helix": "helix_tube"}
    for guide, name in pages.items():
        text = (CHECKOUT / "docs" / f"{guide}.md").read_text(encoding="utf-8")
        ((words, picture, page),) = re.findall(
            r"^\[!\[(.+)\]\((images/\w+\.png)\)\]\((pages/live_\w+\.html)\)$", text, re.MULTILINE
        )
        assert page == f"pages/live_{name}.html"
        shown = hook(f'<p><a href="{page}"><img alt="{words}" src="{picture}" /></a></p>')
        assert f'<iframe class="live" src="{page}" title="{words}" loading="lazy"></iframe>' in shown
        assert "<img" not in shown


def test_the_tube_of_flexures_ends_at_the_tip() -> None:
    """The rigid piece behind the last flexure is drawn, too."""
    rod = sr.load_model(sr.PccArm(segment_lengths=(0.4,), muscle_azimuths=(), chain="flexures", hinges=4))
    placed = robot_data(sr.solve_equilibrium(rod, ()), 1.0)["placed"]
    assert np.allclose(np.reshape(placed[-1]["pose"], (4, 4))[:3, 3], (0.0, 0.0, 0.4), atol=1e-9)
