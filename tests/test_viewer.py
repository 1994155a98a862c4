"""The browser view: loopback only, ends with its parent, and really draws the robot in a real Chromium."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.scene import WRINKLING_COLOURS, wrinkling_level
from softrobots.view.viewer import Viewer, view
from studies.shared.browser import find_chromium, show_share, take_picture
from tests.conftest import PATIENCE
from tests.support.packed_pages import scene_of
from tests.support.pictures import coloured, listening, pictures_of, pixels

FORCE = (0.0, 10.0, -15.0)


@pytest.fixture(scope="module")
def trajectory(arm: sr.SoftModel) -> sr.Trajectory:
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 1.0, 20)
    return sr.follow_trajectory(arm, path.positions, FORCE, times=path.times, elbow="up")


@pytest.mark.study
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_server_listens_on_loopback_only_and_ends(arm: sr.SoftModel) -> None:
    with Viewer(arm) as viewer:
        process = viewer._server.process
        assert listening(process.pid) == {"127.0.0.1"}
        assert viewer.url == f"http://127.0.0.1:{viewer.port}/static/"
        assert viewer.tunnel.startswith(f"ssh -L {viewer.port}:127.0.0.1:{viewer.port} ")
    assert process.poll() is not None


@pytest.mark.study
def test_two_viewers_take_two_ports(arm: sr.SoftModel) -> None:
    with Viewer(arm) as one, Viewer(arm) as other:
        assert one.port != other.port
        one.show(sr.solve_equilibrium(arm, (0, 0.5, -0.5), FORCE))
        other.show(sr.solve_equilibrium(arm, (0, 0.1, -0.5), FORCE))


@pytest.mark.study
def test_a_server_keeps_the_last_value_of_a_property_only(arm: sr.SoftModel) -> None:
    """Or every new browser were told every colour of a long live session."""
    with Viewer(arm) as viewer:
        sizes = []
        for _ in range(3):
            for motors in ((0.0, 0.0, 0.0), (0.0, 0.6, -0.8)):
                viewer.show(sr.solve_equilibrium(arm, motors, (0, 0, -15)))
                viewer.look_at(np.array([1.0, 0.0, 0.0]))
            sizes.append(len(viewer._page.static_html()))
    assert sizes[1] == sizes[2]


@pytest.mark.study
@pytest.mark.skipif(sys.platform != "linux", reason="needs SIGSTOP")
def test_a_server_that_does_not_answer_is_an_error_of_ours(arm: sr.SoftModel) -> None:
    with Viewer(arm) as viewer:
        viewer._page.window.zmq_socket.rcvtimeo = 200  # [ms], for 30 s
        viewer._server.process.send_signal(signal.SIGSTOP)
        with pytest.raises(sr.ViewerError, match="does not answer"):
            viewer.trace([(0, 0, 0)])
        viewer._server.process.send_signal(signal.SIGCONT)


@pytest.mark.study
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_server_ends_when_its_parent_is_killed(how: int) -> None:
    code = (
        "import softrobots as sr, time; from softrobots.view.viewer import Viewer\n"
        "v = Viewer(sr.load_model(sr.InflatableArm())); print(v._server.process.pid, flush=True); time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        child = int(parent.stdout.readline())
        parent.send_signal(how)
        parent.wait(PATIENCE)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        if Path(f"/proc/{child}/stat").read_text().split()[2] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the server outlives its parent")


@pytest.mark.study
def test_html_is_self_contained(arm: sr.SoftModel, trajectory: sr.Trajectory, tmp_path: Path) -> None:
    with view(arm, trajectory) as viewer:
        file = viewer.write_html(tmp_path / "a.html", title="An <arm>")
        with pytest.raises(sr.OutputExists):
            viewer.write_html(file)
    text = file.read_text(encoding="utf-8")
    assert "An &lt;arm&gt;" in text
    assert "wrinkled" in text
    assert 'src="http' not in text
    assert 'href="http' not in text
    assert any(b"set_animation" in command for command in scene_of(text)[1])


def test_the_page_draws_the_robot_and_the_animation_moves_it(
    browser: object, arm: sr.SoftModel, trajectory: sr.Trajectory, tmp_path: Path
) -> None:
    with view(arm, trajectory) as viewer:
        address = viewer.write_html(tmp_path / "a.html").as_uri()
    start, end, again = pictures_of(browser, address, 0.0, 1.0, 0.0)
    assert coloured(start) > 3000
    assert coloured(end) > 3000
    assert np.array_equal(start, again)  # the same pose gives the same picture
    assert np.count_nonzero(np.abs(start - end).max(axis=2) > 30) > 5000
    reddest = [int((shot[200:, :, 0] - shot[200:, :, 1]).max()) for shot in (start, end)]
    assert reddest[1] > reddest[0] + 30  # link 1 comes nearer to wrinkling on the way and turns from orange to red


def test_page_and_websocket_work_through_a_forwarded_port(browser: object, arm: sr.SoftModel) -> None:
    """As an SSH tunnel does: another loopback port carries bytes to the server and back; live updates and legends arrive."""
    with Viewer(arm) as viewer, forwarded(viewer.port) as port:
        page = browser.new_page(viewport={"width": 800, "height": 600})
        sockets: list[object] = []
        page.on("websocket", lambda opened: sockets.append(opened))
        requests: list[str] = []
        page.on("request", lambda request: requests.append(request.url))
        page.goto(f"http://127.0.0.1:{port}/static/")
        viewer.show(sr.solve_equilibrium(arm, (0.0, 0.6, -0.8), FORCE))
        show_share(page, 0.0)
        first = pixels(page.screenshot())
        legend = page.locator("#softrobots-legend").inner_text().splitlines()
        assert legend[:3] == ["inflatable_arm", "rigid arm, same motor angles", "force 18 N"]
        assert legend[-1] == "wrinkled"
        viewer.show(sr.solve_equilibrium(arm, (0.0, 1.4, -1.8)))
        viewer.mark((0.4, 0.2, 0.1))
        page.wait_for_timeout(500)
        show_share(page, 0.0)
        second = pixels(page.screenshot())
        rows = page.locator("#softrobots-legend").inner_text().splitlines()
        assert rows == [*(text for text in legend[:2]), "target (cross)", *legend[3:]]  # no force, a mark
        assert requests == [f"http://127.0.0.1:{port}/static/", f"http://127.0.0.1:{port}/static/main.min.js"]
        page.reload()  # a browser that comes later is told what holds now
        page.get_by_text("target (cross)").wait_for()
        assert {opened.url for opened in sockets} == {f"ws://127.0.0.1:{port}/"}
        assert coloured(first) > 3000
        assert np.count_nonzero(np.abs(first - second).max(axis=2) > 30) > 5000


class forwarded:
    """Carry bytes between a new loopback port and another one."""

    def __init__(self, port: int) -> None:
        self.target = port
        self.listener = socket.create_server(("127.0.0.1", 0))

    def __enter__(self) -> int:
        threading.Thread(target=self._accept, daemon=True).start()
        return self.listener.getsockname()[1]

    def __exit__(self, *_: object) -> None:
        self.listener.close()

    def _accept(self) -> None:
        while True:
            try:
                one, _ = self.listener.accept()
            except OSError:
                return
            other = socket.create_connection(("127.0.0.1", self.target))
            for a, b in ((one, other), (other, one)):
                threading.Thread(target=self._carry, args=(a, b), daemon=True).start()

    @staticmethod
    def _carry(source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(65536):
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
        except OSError:
            pass
        finally:
            source.close()


def test_cylinders_start_and_end_at_the_joints(arm: sr.SoftModel) -> None:
    """The far end of the last cylinder is the tip; the first shape of link 1 starts at its motor."""
    scene = RobotShapes(arm)
    q = arm.configuration((0.3, 0.6, -0.8), (0.05, -0.1, 0.03, -0.04))
    poses = dict(zip((shape.name for shape in scene.shapes), scene.transforms(q), strict=True))
    last = poses["link_2_0"]
    end = last[:3, 3] + last[:3, 2] * 0.57 / 2
    assert np.allclose(end, frame_placement(arm, q, "tip").translation, atol=1e-12)
    first = poses["link_1_root_1"]
    start = first[:3, 3] - first[:3, 2] * 0.03 / 2
    assert np.allclose(start, 0.0, atol=1e-12)


def test_links_are_coloured_by_what_is_left_of_the_wrinkling_moment(arm: sr.SoftModel) -> None:
    limit = arm.spring_groups[0].wrinkling_moment
    seen = []
    for moment in np.linspace(0.01, 1.2 * limit, 40):
        state = sr.solve_equilibrium(arm, (0, 0, 0), wrench=(0, 0, 0, 0, moment, 0))  # the moment of both links
        left = 1 - state.link_moments[0] / limit
        level = wrinkling_level(state, 0)
        assert left >= WRINKLING_COLOURS[level][0]
        assert level == 0 or left < WRINKLING_COLOURS[level - 1][0]
        assert (level == len(WRINKLING_COLOURS) - 1) == state.wrinkled
        seen.append(level)
    assert sorted(set(seen)) == list(range(len(WRINKLING_COLOURS)))


@pytest.mark.study
def test_bad_input_is_refused(arm: sr.SoftModel, odd_arm: sr.SoftModel, trajectory: sr.Trajectory) -> None:
    foreign = sr.solve_equilibrium(odd_arm, (0, 0, 0, 0))
    with Viewer(arm) as viewer:
        for call, message in (
            (lambda: viewer.show(foreign), "an equilibrium of the model given"),
            (lambda: viewer.show(None), "an Equilibrium"),
            (lambda: viewer.animate(foreign), "a Trajectory"),
            (lambda: viewer.animate(trajectory, duration=0.0), "duration"),
            (lambda: viewer.trace([(0, 0)]), "points"),
            (lambda: view(arm, "x"), "an Equilibrium"),
        ):
            with pytest.raises(sr.ParameterError, match=message):
                call()
    for late in (lambda: viewer.show(trajectory.equilibria[0]), lambda: viewer.html(), lambda: viewer.trace([(0, 0, 0)])):
        with pytest.raises(sr.ViewerError, match="closed"):
            late()


def test_pictures_of_missing_pages_are_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.ViewerError, match="is no file"):
        take_picture(tmp_path / "missing.html", tmp_path / "sub" / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_browser_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(sr.ViewerError, match="apt-get install chromium"):
        find_chromium()
