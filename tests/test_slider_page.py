"""The page with sliders: what is drawn and solved, its server, and the page itself in a real Chromium."""

from __future__ import annotations

import builtins
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator

import coal
import numpy as np
import pytest

import softrobots as sr
from softrobots.view import slider_page
from softrobots.view.body import body_at
from softrobots.view.mesh_triangles import triangles
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.scene import WRINKLING_COLOURS, wrinkling_level
from softrobots.view.slider_page import SliderPage
from softrobots.view.slider_ranges import slider_grid
from softrobots.view.tension_scale import round_down, round_up, scale_end, tension_colour
from tests.conftest import PATIENCE
from tests.support.pictures import listening, pixels

HELD = (0.47, 0.53, 0.55, 0.50, 0.55, 0.53)


@pytest.fixture(autouse=True)
def viser(tool: Callable[[str], object]) -> object:
    return tool("viser")


@pytest.fixture
def page(arm: sr.SoftModel) -> Iterator[SliderPage]:
    with SliderPage(arm) as opened:
        yield opened


def wait_for(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)


def panel_html(page: SliderPage) -> str:
    """The text of the panel, as HTML."""
    return page._panel._text.content


# What is solved


def same(shown: sr.Equilibrium, direct: sr.Equilibrium) -> bool:
    """Two ways to one equilibrium: both within the tolerance of the residual, so within about as much of each other."""
    return np.allclose(shown.q, direct.q, rtol=0.0, atol=1e-8) and shown.load.same_as(direct.load)


def test_what_is_shown_is_the_equilibrium_of_what_is_set(arm: sr.SoftModel) -> None:
    with SliderPage(arm, q_motors=(0.1, 0.2, -0.3), force=(1.0, 2.0, 3.0), gravity=sr.EARTH_GRAVITY) as page:
        assert same(page.equilibrium, sr.solve_equilibrium(arm, (0.1, 0.2, -0.3), (1, 2, 3), gravity=sr.EARTH_GRAVITY))
        assert same(page.set(gravity=False), sr.solve_equilibrium(arm, (0.1, 0.2, -0.3), (1, 2, 3)))
        assert same(page.set(q_motors=(0.3, 0.6, -0.8)), sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (1, 2, 3)))
        shown = page.set(force=(0, 10, -15))
        assert same(shown, sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15)))
        assert page.equilibrium is shown
        x, y, z = shown.tip_position
        assert f"{x:.4f}  {y:.4f}  {z:.4f}" in panel_html(page)
        left = 1.0 - shown.link_moments[1] / arm.spring_groups[1].wrinkling_moment
        assert f"link 2: {100 * left:.0f} %" in panel_html(page)


def test_an_arm_leans_on_the_obstacles_that_are_given(arm: sr.SoftModel) -> None:
    """A wall at 1 m stops the tip where its link of 55 mm touches; without the load nothing touches."""
    wall = sr.Environment([sr.HalfSpace((-1, 0, 0), offset=-1.0, name="wall")])
    with SliderPage(arm, q_motors=(0.0, 0.9, -0.4), full_force=30.0, environment=wall) as page:
        assert {"obstacles/0"} == {name for name in page._drawing.handles if name.startswith(("obstacles", "contacts"))}
        leaning = page.set(force=(0, 0, -20))
        assert leaning.tip_position[0] == pytest.approx(0.945, abs=1e-9)
        (contact,) = leaning.contacts
        assert f"wall presses with {contact.normal_force:.3g} N" in panel_html(page)
        drawn = page._drawing.handles[f"contacts/{contact.link}/wall/0"]
        assert np.allclose(drawn.position, contact.point, atol=1e-6)
        assert page.set(force=(0, 0, 0)).contacts == ()
        assert "wall presses" not in panel_html(page)


def test_muscles_and_robots_without_motors() -> None:
    pcc = sr.load_model(sr.PccArm())
    with SliderPage(pcc, q_motors=HELD) as page:
        assert same(page.set(force=(1, 2, -3)), sr.solve_equilibrium(pcc, HELD, (1, 2, -3)))
    rods = sr.load_model(sr.PccArm(muscle_azimuths=(), segment_lengths=(0.524,)))
    with SliderPage(rods, gravity=sr.EARTH_GRAVITY) as page:
        assert same(page.set(q_motors=()), sr.solve_equilibrium(rods, (), (0, 0, 0), gravity=sr.EARTH_GRAVITY))


def test_a_slider_of_one_of_four_muscles_takes_the_others_along() -> None:
    model = sr.load_model(sr.PccArm(muscle_azimuths=tuple(np.arange(4) * np.pi / 2), segment_lengths=(0.524,)))
    with SliderPage(model) as page:
        page._panel._motors[1].value = 0.54  # as the server does when a browser tells
        wait_for(lambda: page.equilibrium.q_motors[1] != 0.524)
        lengths = page.equilibrium.q_motors
        assert lengths[1] == pytest.approx(0.54, abs=1e-12)
        # Four muscles a quarter turn apart around one backbone: opposite ones have the same mean.
        assert lengths[0] + lengths[2] == pytest.approx(lengths[1] + lengths[3], abs=1e-9)
        assert page._panel.setting.q_motors == pytest.approx(tuple(lengths), abs=1e-12)


@pytest.fixture(scope="module")
def rod() -> sr.SoftModel:
    """An upright rod of one section: buckles at 21 N, and is pressed to the end of its range by 100 N."""
    return sr.load_model(sr.PccArm(muscle_azimuths=(), segment_lengths=(0.524,), elastic_sections=1))


def test_a_buckled_robot_stays_on_its_side_until_it_is_reset(rod: sr.SoftModel) -> None:
    """Above the critical load the rod leans to any side; a side force decides, and nothing brings it back when that is gone."""
    down = 1.2 * sr.critical_load(rod, (), (0, 0, -1))
    with SliderPage(rod, force=(0, 0, -down), full_force=2 * down) as page:
        start = page.equilibrium
        for side in (1.0, -1.0):
            page.set(force=(side, 0, -down))
            held = page.set(force=(0, 0, -down))
            assert held.tip_position[0] * side > 0.1
            assert held.tip_position[2] == pytest.approx(start.tip_position[2], abs=1e-6)  # by symmetry
        page._panel._reset = True
        page._wake.set()
        wait_for(lambda: same(page.equilibrium, start))


def test_without_equilibrium_the_last_one_stays_and_the_page_says_so(rod: sr.SoftModel) -> None:
    with SliderPage(rod, full_force=200.0) as page:
        last = page.set(force=(1, 0, -10))
        assert "NO EQUILIBRIUM" not in panel_html(page)
        for _ in range(2):
            with pytest.raises(sr.EquilibriumNotFound, match="end of its range"):
                page.set(force=(1, 0, -100))
            assert page.equilibrium is last
        assert "NO EQUILIBRIUM" in panel_html(page)
        assert "end of its range" in panel_html(page)
        page._panel._force[2].value = -150.0  # as from a browser: nobody is there to catch an error
        wait_for(lambda: page._last.force[2] == -150.0)
        assert same(page.set(force=(1, 0, -10)), last)
        assert "NO EQUILIBRIUM" not in panel_html(page)
        page._panel._force[2].value = -5.0  # the thread that follows the sliders is still there
        wait_for(lambda: page.equilibrium.load.wrenches["tip"][2] == -5.0)
    with pytest.raises(sr.EquilibriumNotFound):
        SliderPage(rod, force=(1, 0, -100))


def test_of_many_changes_the_newest_is_solved(page: SliderPage, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = []

    def slowly(*arguments: object, **options: object) -> sr.Equilibrium:
        solved.append(arguments)
        time.sleep(0.05)
        return original(*arguments, **options)

    original = slider_page.next_equilibrium
    monkeypatch.setattr(slider_page, "next_equilibrium", slowly)
    start = time.monotonic()
    for value in np.linspace(0.01, 0.5, 50).tolist():
        page._panel._motors[1].value = value
        time.sleep(0.002)
    changing = time.monotonic() - start
    wait_for(lambda: page.equilibrium.q_motors[1] == 0.5)
    # 0.05 s each, while changes come, and perhaps two of what has come by then; fifty would be a queue.
    assert 2 <= len(solved) <= changing / 0.05 + 3


def test_steps_are_round_numbers_within_the_limits() -> None:
    for low, high in ((-np.pi, np.pi), (0.4454, 0.6026), (-20.0, 20.0), (-6.28318530718, 6.28318530718), (0.0, 3e-4)):
        first, last, step = slider_grid(low, high)
        assert low - 1e-12 <= first < last <= high + 1e-12
        assert first - low < step * (1 + 1e-6)
        assert high - last < step * (1 + 1e-6)
        assert 400 <= (high - low) / step * (1 + 1e-6) < 1001
        digits = f"{step:e}"
        assert digits[0] in "125"
        assert float(f"{digits[0]}e{digits.split('e')[1]}") == step
        assert abs(first / step - round(first / step)) < 1e-9
    assert slider_grid(0.3, 0.3) == (0.3, 0.3, 1.0)
    assert [round_down(x) for x in (1.0, 0.99, 29.0, 5e-4, 0.3)] == [1.0, 0.5, 20.0, 5e-4, 0.2]
    assert [round_up(x) for x in (1.0, 0.99, 29.0, 5e-4, 0.3)] == [1.0, 1.0, 50.0, 5e-4, 0.5]


# What is drawn


def drawn_boxes(page: SliderPage, below: str) -> dict[str, np.ndarray]:
    """Corners of the box around each object that viser shows below a path, in the world, shape (2, 3) [m]."""
    import viser.transforms

    found = {}
    for path, handle in page._drawing.handles.copy().items():  # the page draws in a thread of its own
        if path.startswith(f"{below}/"):
            turn = viser.transforms.SO3(np.asarray(handle.wxyz)).as_matrix()
            points = np.asarray(handle.vertices, dtype=float) @ turn.T + np.asarray(handle.position)
            found[path.split("/")[1]] = np.array([points.min(axis=0), points.max(axis=0)])
    return found


def mounted() -> sr.SoftModel:
    """A soft arm on a foreign robot: a box, a ball and a turned cylinder."""
    parent = """<robot name="desk"><link name="world"/><link name="desk">
      <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><geometry><box size="0.3 0.2 0.1"/></geometry></visual>
      <visual><origin xyz="0 0 0.4"/><geometry><sphere radius="0.05"/></geometry></visual>
      <visual><origin xyz="0 0 0.2" rpy="0.5 0 0"/><geometry><cylinder radius="0.03" length="0.4"/></geometry></visual></link>
      <joint name="lift" type="prismatic"><parent link="world"/><child link="desk"/><axis xyz="0 0 1"/>
      <limit lower="0" upper="0.5" effort="1" velocity="1"/></joint></robot>"""
    return sr.load_model(sr.mount(parent, "desk", sr.InflatableArm()))


def test_everything_is_drawn_where_pinocchio_has_it() -> None:
    model = mounted()
    assert model.actuators.units == ("m", "rad", "rad", "rad")
    with SliderPage(model, q_motors=(0.2, 0.3, -0.6, 0.8)) as page:
        shown = page.set(force=(5, 5, -10))
        scene = RobotShapes(model)
        for group, q in (("deformed", shown.q), ("rigid", model.configuration(shown.q_motors))):
            boxes = drawn_boxes(page, group)
            assert len(boxes) >= 4
            for shape, pose in zip(scene.shapes, scene.transforms(q), strict=True):
                if group == "deformed" or shape.elastic:
                    expected = _box_around(shape.geometry, pose)
                    # A circle is drawn with 32 corners: half a per cent of the radius, here at most 0.06 m, less; so are both
                    # the meridians and the circles of latitude of a ball.
                    less = 0.01 if isinstance(shape.geometry, coal.Sphere) else 0.005
                    assert np.abs(boxes[shape.name] - expected).max() < less * 0.06, shape.name


def _box_around(shape: object, pose: np.ndarray) -> np.ndarray:
    """Box around a shape in closed form, shape (2, 3) [m]."""
    turn, centre = pose[:3, :3], pose[:3, 3]
    if isinstance(shape, coal.Sphere):
        half = np.full(3, shape.radius)
    elif isinstance(shape, coal.Box):
        half = np.abs(turn) @ np.asarray(shape.halfSide).ravel()
    else:
        axis = turn[:, 2]
        half = shape.halfLength * np.abs(axis) + shape.radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    return np.array([centre - half, centre + half])


def test_colours_are_those_of_wrinkling(page: SliderPage, arm: sr.SoftModel) -> None:
    for down in (0.0, 8.0, 14.0, 20.0):
        shown = page.set(force=(0, 0, -down))
        drawn = [handle for path, handle in page._drawing.handles.items() if "link_2_0" in path and "deformed" in path]
        rgb = WRINKLING_COLOURS[wrinkling_level(shown, 1)][1]
        assert np.allclose(np.array(drawn[0].color) / 255, rgb, atol=0.5 / 255)


def test_a_body_bends_without_becoming_another_object() -> None:
    pcc = sr.load_model(sr.PccArm(segment_lengths=(0.524,)))
    with SliderPage(pcc) as page:
        tube = page._drawing.handles["body/segment_1/tube"]
        shown = page.set(q_motors=(0.47, 0.53, 0.55))
        assert page._drawing.handles["body/segment_1/tube"] is tube
        corners, _ = body_at(shown.model, shown.q_motors, shown.q_springs)[0].surface()
        assert np.allclose(tube.vertices, corners, atol=1e-6)  # viser holds single precision
        forces = shown.muscle_forces.tolist()
        for name, force in zip(pcc.motor_joints, forces, strict=True):
            expected = np.array(tension_colour(force, scale_end(forces))[:3])
            assert np.allclose(np.array(page._drawing.handles[f"body/actuators/{name}"].color) / 255, expected, atol=0.5 / 255)
            assert f"{name}: {'pulls' if force > 0.0 else 'pushes'} {abs(force):.3g} N" in panel_html(page)


def test_tendons_become_dashed_and_whole_again() -> None:
    arm = sr.load_model(sr.TendonArm(elastic_sections=2))
    loose = arm.relaxed_motors.copy()
    loose[8] += 0.003
    with SliderPage(arm) as page:
        for motors, slack in ((arm.relaxed_motors, False), (loose, True), (arm.relaxed_motors, False)):
            assert page.set(q_motors=motors).muscle_slack[8] == slack
            assert ("body/actuators/tendon_3_3/slack" in page._drawing.handles) == slack
            assert ("body/actuators/tendon_3_3" in page._drawing.handles) != slack
            assert ("tendon_3_3: slack" in panel_html(page)) == slack


@pytest.mark.parametrize(("shape", "volume"), [
    # A prism of 32 sides; a ball of 16 rings of them has 3 per cent less than a round one.
    (coal.Box(0.1, 0.2, 0.3), pytest.approx(0.006, rel=1e-9)),
    (coal.Cylinder(0.1, 0.5), pytest.approx(16 * np.sin(2 * np.pi / 32) * 0.1**2 * 0.5, rel=1e-9)),
    (coal.Sphere(0.1), pytest.approx(4 / 3 * np.pi * 1e-3, rel=0.03)),
], ids=["box", "cylinder", "ball"])  # fmt: skip
def test_shapes_are_closed_and_seen_from_outside(shape: object, volume: object) -> None:
    """Gauss: the volume inside a closed surface, positive if its triangles turn anticlockwise seen from outside."""
    corners, faces, _ = triangles(shape)
    assert enclosed(corners, faces) == volume


def enclosed(corners: np.ndarray, faces: np.ndarray) -> float:
    """Volume inside triangles [m^3]."""
    a, b, c = (corners[faces[:, place]] for place in range(3))
    return float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6.0


def test_an_arrow_starts_at_the_tip_along_the_force_and_is_in_proportion(page: SliderPage) -> None:
    """A prism of 32 sides and a pyramid of as many on it, 7 times as high as the shaft is thick and 2.5 times as wide."""
    size, unit = page._scenes.extent.size, 0.5 * page._full
    for force in ((0.0, 0.0, -4.0), (3.0, 0.0, 4.0)):
        shown = page.set(force=force)
        handle = page._drawing.handles["load/tip"]
        (box,) = drawn_boxes(page, "load").values()
        width, length = 0.009 * size, 0.2 * size * np.linalg.norm(force) / unit
        assert np.allclose(handle.position, shown.tip_position)
        end = shown.tip_position + np.array(force) / np.linalg.norm(force) * (length + 7.0 * width)
        assert np.all((box[0] - 1e-6 <= end) & (end <= box[1] + 1e-6))
        volume = 16 * np.sin(2 * np.pi / 32) * width**2 * (length + 2.5**2 * 7.0 * width / 3.0)
        assert enclosed(np.asarray(handle.vertices, dtype=float), handle.faces) == pytest.approx(volume, rel=1e-4)
    page.set(force=(0, 0, 0))
    assert "load/tip" not in page._drawing.handles


def test_other_shapes_are_refused() -> None:
    for shape in (coal.Ellipsoid(1, 2, 3), coal.Capsule(0.1, 0.2), "a box"):
        with pytest.raises(sr.ViewerError, match="cannot be drawn; boxes, cylinders, spheres and meshes can"):
            triangles(shape)


# The server


@pytest.mark.study
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_server_listens_on_loopback_only_says_nothing_and_ends_with_ctrl_c() -> None:
    code = (
        "import softrobots as sr\nfrom softrobots.view.slider_page import SliderPage\n"
        "with SliderPage(sr.load_model(sr.InflatableArm())) as p:\n    print(p.port, flush=True)\n    p.wait()\nprint('end')"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        port = int(process.stdout.readline())
        assert listening(process.pid) == {"127.0.0.1"}
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE) as answer:
            assert b"<!doctype html>" in answer.read(100).lower()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err) == (0, "end\n", "")


def test_pages_take_ports_of_their_own_and_close(page: SliderPage, arm: sr.SoftModel, capfd: pytest.CaptureFixture) -> None:
    threads = set(threading.enumerate())
    with SliderPage(arm) as other:
        assert other.port != page.port
        assert other.url == f"http://127.0.0.1:{other.port}/"
        assert other.tunnel.startswith(f"ssh -L {other.port}:127.0.0.1:{other.port} ")
        other.set(force=(0, 0, -5))
    with pytest.raises(sr.ViewerError, match=f"port {page.port} of 127.0.0.1 cannot be had"):
        SliderPage(arm, port=page.port)
    with urllib.request.urlopen(page.url, timeout=PATIENCE) as answer:
        assert answer.status == 200
    assert page.set(force=(0, 0, -5)).stable
    other.close()  # once more does nothing
    other.wait()  # is over
    assert set(threading.enumerate()) == threads
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", other.port), timeout=5)
    with pytest.raises(sr.ViewerError, match="closed"):
        other.set(force=(0, 0, -5))
    with SliderPage(arm, port=other.port) as again:
        assert again.port == other.port
    assert capfd.readouterr().out == ""


def test_nobody_can_share_the_page(page: SliderPage, monkeypatch: pytest.MonkeyPatch) -> None:
    """A browser may ask for a public tunnel, whatever buttons it shows; viser answers with this method."""
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *_: pytest.fail("a tunnel to the outside"))
    assert page._server.request_share_url() is None


def test_bad_input_is_refused(arm: sr.SoftModel, page: SliderPage) -> None:
    for options, message in (
        ({"q_motors": (0, 0)}, "q_motors"),
        ({"q_motors": (0, 4.0, 0)}, "within the limits"),
        ({"force": (0, 0)}, "force"),
        ({"force": (0, 0, 30.0), "full_force": 20.0}, "within the ends of its sliders"),
        ({"gravity": True}, "gravity"),
        ({"full_force": 0.0}, "full_force"),
        ({"port": 70000}, "port"),
        ({"port": 0}, "port"),
    ):
        with pytest.raises(sr.ParameterError, match=message):
            SliderPage(arm, **options)
    with pytest.raises(sr.ParameterError, match="a SoftModel"):
        SliderPage(sr.InflatableArm())
    before = page.equilibrium
    for options in ({"q_motors": (0, 4.0, 0)}, {"force": (0, 0, 1e3)}, {"force": "x"}, {"gravity": sr.EARTH_GRAVITY}):
        with pytest.raises(sr.ParameterError):
            page.set(**options)
    assert page.equilibrium is before


def test_a_missing_viser_says_what_to_install(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    original = builtins.__import__

    def without(name: str, *rest: object, **options: object) -> object:
        if name.startswith("viser"):
            raise ImportError(name)
        return original(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(sr.MissingDependency, match=r"viser is not installed.*softrobots\[viser\]"):
        SliderPage(arm)


# The page


def test_sliders_in_the_browser_move_the_arm(browser: object, arm: sr.SoftModel) -> None:
    messages, requests, sockets = [], [], []
    with SliderPage(arm, q_motors=(0.0, 0.5, -0.5), force=(0, 0, -5)) as page:
        tab = browser.new_page(viewport={"width": 800, "height": 600})
        # Errors only. Viser logs its connection, and warns of a part of three.js that is to go: neither says that anything
        # is wrong with the page.
        tab.on("console", lambda message: messages.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: messages.append(str(error)))
        tab.on("request", lambda request: requests.append(request.url))
        tab.on("websocket", lambda opened: sockets.append(opened.url))
        tab.goto(f"{page.url}?fixedDpr=1")  # or viser draws in less detail where it is slow
        tab.wait_for_selector("#softrobots-state")

        def picture(wanted: Callable[[np.ndarray], bool]) -> np.ndarray:
            """The picture of the robot, once it is as wanted and stays so: software draws a few frames a second."""
            last, deadline = np.zeros(0), time.monotonic() + PATIENCE
            while time.monotonic() < deadline:
                shot = pixels(tab.screenshot(clip={"x": 0, "y": 150, "width": 460, "height": 450}))
                if np.array_equal(shot, last) and wanted(shot):
                    return shot
                last = shot
                tab.wait_for_timeout(300)
            raise AssertionError("the picture did not become what it should")

        start = picture(lambda shot: warm(shot) > 3000)
        sliders = tab.get_by_role("slider")
        assert sliders.count() == 6

        def drag(number: int, pixels_to_the_right: int) -> float:
            """Pull a slider; where it is then, by what it tells people who do not see it."""
            thumb = sliders.nth(number).bounding_box()
            x, y = thumb["x"] + thumb["width"] / 2, thumb["y"] + thumb["height"] / 2
            tab.mouse.move(x, y)
            tab.mouse.down()
            tab.mouse.move(x + pixels_to_the_right, y, steps=10)
            tab.mouse.up()
            return float(sliders.nth(number).get_attribute("aria-valuenow"))

        value = drag(1, -12)  # motor 2 (by mouse: arrow keys turn viser's camera, too)
        assert value < 0.2
        wait_for(lambda: page.equilibrium.q_motors.tolist() == [0.0, value, -0.5])
        turned = picture(lambda shot: differing(shot, start) > 3000 and warm(shot) > 3000)

        pull = drag(5, -30)  # force along z
        wait_for(lambda: page.equilibrium.load.wrenches["tip"][2] == pull)
        force = page.equilibrium.load.wrenches["tip"][:3]
        assert force[2] < -10.0
        assert same(page.equilibrium, sr.solve_equilibrium(arm, page.equilibrium.q_motors, force))
        rigid = sr.solve_equilibrium(arm, page.equilibrium.q_motors).tip_position
        assert page.equilibrium.tip_position[2] < rigid[2] - 0.05
        picture(lambda shot: differing(shot, turned) > 3000 and warm(shot) > 3000)
        z = page.equilibrium.tip_position[2]
        assert f"{z:.4f}" in tab.inner_text("#softrobots-state")

        tab.get_by_role("button", name="reset").click()
        wait_for(lambda: page.equilibrium.q_motors.tolist() == [0.0, 0.5, -0.5])
        assert page.equilibrium.load.wrenches["tip"].tolist() == [0.0, 0.0, -5.0, 0.0, 0.0, 0.0]
        picture(lambda shot: differing(shot, start) == 0)  # the same pose and load, the same picture
        assert tab.get_by_text("Share").count() == 0
        page.set(q_motors=(0.0, 0.123456, 0.0))  # between two steps: nothing comes back rounded
        wait_for(lambda: sliders.nth(1).get_attribute("aria-valuenow") == "0.123456")
        tab.wait_for_timeout(200)
        assert page.equilibrium.q_motors[1] == 0.123456
        port = page.port
    tab.close()
    assert messages == []
    assert {request for request in requests if not request.startswith(("data:", "blob:"))} == {
        f"http://127.0.0.1:{port}/?fixedDpr=1"
    }
    assert set(sockets) <= {f"ws://127.0.0.1:{port}", f"ws://127.0.0.1:{port}/"}


def warm(picture: np.ndarray) -> int:
    """How many pixels have the colours of inflated links: red well above blue."""
    return int(np.count_nonzero(picture[..., 0] - picture[..., 2] > 60))


def differing(one: np.ndarray, other: np.ndarray) -> int:
    """How many pixels differ clearly."""
    return int(np.count_nonzero(np.abs(one - other).max(axis=2) > 30))
