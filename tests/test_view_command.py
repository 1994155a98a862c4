"""`softrobots view` as a process: what it serves and to whom, how it ends, and that it follows commands in a real Chromium."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import queue
import re
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.main import main
from softrobots.view import animation_frames, slider_page
from softrobots.view.live.loop import state_line
from studies.shared.browser import show_share
from tests.conftest import PATIENCE
from tests.support.pictures import coloured, listening, pixels
from tests.support.tables import each_row

COMMAND = [sys.executable, "-m", "softrobots", "view"]
# A terminal of its own, so that Ctrl-C reaches it.
IN_TERMINAL = (
    "import fcntl, os, sys, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"
)

linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


class Process:
    """A running `softrobots view`; a context manager that kills what is left of it."""

    def __init__(self, *words: str, command: list[str] = COMMAND, stdin: int = subprocess.PIPE) -> None:
        self.popen = subprocess.Popen(
            [*command, *words],
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=stdin == -1,
        )
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        with contextlib.suppress(ValueError):  # closed at the end
            for line in self.popen.stdout:
                self.lines.put(line.rstrip("\n"))

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self.popen.kill()
        self.popen.wait()
        for stream in (self.popen.stdin, self.popen.stdout, self.popen.stderr):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):
                    stream.close()

    def until(self, word: str) -> str:
        """The next printed line that holds a word."""
        deadline = time.monotonic() + PATIENCE
        seen = []
        while time.monotonic() < deadline:
            with contextlib.suppress(queue.Empty):
                seen.append(self.lines.get(timeout=0.5))
                if word in seen[-1]:
                    return seen[-1]
            if self.popen.poll() is not None and self.lines.empty():
                break
        pytest.fail(f"no line with {word!r}; {seen}, {self.popen.poll()}")

    def url(self) -> str:
        return self.until("serving").split()[1]

    def type(self, line: str) -> None:
        self.popen.stdin.write(line + "\n")
        self.popen.stdin.flush()

    def children(self) -> list[int]:
        pid = self.popen.pid
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def ended(self) -> tuple[int, str]:
        """Exit status and what was said on stderr."""
        status = self.popen.wait(PATIENCE)
        return status, self.popen.stderr.read()


def gone(pid: int) -> bool:
    """Whether a process is no more, soon."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.05)
    return False


# --- A process that serves


@pytest.mark.study
@linux
def test_it_serves_loopback_only_until_interrupted_beside_another_one() -> None:
    with Process("inflatable_arm", "--force", "0", "10", "-15") as one, Process("inflatable_arm", "--json") as other:
        state = one.until("tip ")
        url, tunnel = one.url(), one.until("another machine")
        port = url.split(":")[2].split("/")[0]
        assert "stable, wrinkled, residual" in state
        assert tunnel.startswith(f"from another machine: ssh -L {port}:127.0.0.1:{port} ")
        served = [json.loads("".join(other.until("") for _ in range(5)))]
        assert served[0]["url"] != url
        assert served[0]["url"] == f"http://127.0.0.1:{served[0]['port']}/static/"
        assert served[0]["tunnel"].startswith(f"ssh -L {served[0]['port']}:")
        tree = [one.popen.pid, *one.children()]
        assert len(tree) == 2
        assert set().union(*map(listening, tree)) == {"127.0.0.1"}
        os.killpg(one.popen.pid, signal.SIGINT)  # as Ctrl-C in a terminal: the server gets it, too
        assert one.ended() == (0, "")
        second = other.children()
        other.popen.send_signal(signal.SIGINT)  # the command alone
        assert other.ended() == (0, "")
        assert all(gone(pid) for pid in (*tree, *second))


@pytest.mark.study
@linux
def test_it_follows_lines_of_a_pipe(arm: sr.SoftModel) -> None:
    with Process("inflatable_arm", "--live", "keyboard", "--motors", "0", "0.5", "-0.5") as process:
        process.url()
        server = process.children()
        process.type("target 0.9 0.3 0.2")
        assert process.until("tip ").startswith("tip 0.9000 0.3000 0.2000 m, motors ")
        process.type("target 9 0 0")
        process.type("motors 0.3 0.6 -0.8")
        process.type('{"force": [0, 10, -15]}')
        process.until("motors 0.3000 0.6000 -0.8000")
        loaded = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15))
        spelled = " ".join(f"{value:.4f}" for value in loaded.tip_position)
        assert process.until("motors 0.3000 0.6000 -0.8000").startswith(f"tip {spelled} m")
        process.popen.stdin.close()
        status, errors = process.ended()
        assert status == 0
        assert errors.startswith("error: the tip cannot reach [9.0, 0.0, 0.0] m")
        assert errors.count("\n") == 1
        assert all(gone(pid) for pid in server)


@pytest.mark.study
def test_it_takes_keys_of_a_terminal_and_puts_it_back() -> None:
    keyboard, screen = pty.openpty()
    before = termios.tcgetattr(screen)
    words = ["-c", IN_TERMINAL, *COMMAND]
    with Process("inflatable_arm", "--live", "keyboard", command=[sys.executable, *words], stdin=screen) as process:
        process.until("? lists the keys")
        assert termios.tcgetattr(screen) != before
        os.write(keyboard, b"\x1b[D")
        assert process.until("tip ").startswith("tip 1.1800 0.0000 0.0000 m")
        os.write(keyboard, b"\x03")  # Ctrl-C
        assert process.ended() == (0, "")
        assert termios.tcgetattr(screen) == before
    os.close(keyboard)
    os.close(screen)


def test_a_file_changes_the_picture_in_the_browser(browser: object, tmp_path: Path) -> None:
    file = tmp_path / "wanted.json"
    file.write_text('{"motors": [0.0, 0.6, -0.8], "force": [0, 10, -15]}')
    with Process("inflatable_arm", "--live", str(file)) as process:
        url = process.url()
        process.until("motors 0.0000 0.6000 -0.8000")
        page = browser.new_page(viewport={"width": 800, "height": 600})
        messages: list[str] = []
        page.on("console", lambda message: messages.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.goto(url)

        def shot() -> np.ndarray:
            show_share(page, 0.0)
            return pixels(page.screenshot())

        first, again = shot(), shot()
        assert coloured(first) > 3000
        assert np.array_equal(first, again)
        file.write_text('{"motors": [0.0, 1.4')
        assert "no JSON object" in process.popen.stderr.readline()
        assert np.array_equal(shot(), first)  # the last good state stays
        ready = tmp_path / "next.json"
        ready.write_text('{"target": [0.5, 0.5, 0.1], "force": [0, 10, -15], "gravity": true}')
        ready.replace(file)
        process.until("tip 0.5000 0.5000 0.1000 m")
        second = shot()
        assert coloured(second) > 3000
        assert np.count_nonzero(np.abs(first - second).max(axis=2) > 30) > 5000
        assert messages == []
        page.close()
        process.popen.send_signal(signal.SIGINT)
        assert process.ended() == (0, "")


def test_a_viewer_shows_itself_in_a_notebook(browser: object, arm: sr.SoftModel, tmp_path: Path) -> None:
    """As the last expression of a cell: an iframe in somebody else's page, without any request."""
    with sr.view(arm, sr.solve_equilibrium(arm, (0.0, 0.6, -0.8), (0, 10, -15))) as viewer:
        cell, low = viewer._repr_html_(), viewer.inline(height=300, title="An <arm>")
        for height in (0, -3, 20_000, 300.5):
            with pytest.raises(sr.ParameterError, match="height"):
                viewer.inline(height=height)
    assert "height:300px" in low._repr_html_()
    assert len(repr(low)) < 100
    file = tmp_path / "notebook.html"
    file.write_text(f"<!DOCTYPE html><html><body><p>In [1]:</p>{cell}{low._repr_html_()}</body></html>", encoding="utf-8")
    page = browser.new_page(viewport={"width": 800, "height": 600})
    messages: list[str] = []
    requests: list[str] = []
    page.on("console", lambda message: messages.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.on("request", lambda request: None if request.url.startswith(("data:", "about:")) else requests.append(request.url))
    page.goto(file.as_uri())
    frames = page.query_selector_all("iframe")
    assert [(frame.bounding_box()["width"] > 700, frame.bounding_box()["height"]) for frame in frames] == [
        (True, 480),
        (True, 300),
    ]
    assert [frame.content_frame().title() for frame in frames] == ["softrobots", "An <arm>"]
    show_share(frames[0].content_frame(), 0.0)
    assert coloured(pixels(frames[0].screenshot())) > 3000
    assert messages == []
    assert requests == [file.as_uri()]
    page.close()
    with pytest.raises(sr.ViewerError, match="closed"):
        viewer._repr_html_()


# --- Pages and pictures


@pytest.mark.study
def test_a_saved_result_becomes_a_page(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    path = sr.straight_line((0.8, -0.2, 0.3), (0.9, 0.2, 0.2), 1.0, 5)
    results = {
        "equilibrium": sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15)),
        "solution": sr.solve_ik(arm, (0.9, 0.3, 0.2), gravity=sr.EARTH_GRAVITY),
        "trajectory": sr.follow_trajectory(arm, path.positions, (0, 0, -3), times=path.times),
    }
    legends = {"equilibrium": "force 18 N", "solution": "target (cross)", "trajectory": "path of the tip"}
    for name, result in results.items():
        sr.save_result(result, tmp_path / f"{name}.npz")
        page = tmp_path / f"{name}.html"
        assert main(["view", "--result", str(tmp_path / f"{name}.npz"), "--html", str(page)]) == 0
        out, err = capsys.readouterr()
        assert out.splitlines()[1:] == [f"{page}: written"]
        text = page.read_text(encoding="utf-8")
        assert "<title>inflatable_arm</title>" in text
        assert [word for word in legends.values() if f"</span>{word}<" in text] == [legends[name]]
        assert ("</span>force 3 N<" in text) == (name == "trajectory")
    first = page.read_bytes()
    assert main(["view", "--result", str(tmp_path / "solution.npz"), "--html", str(page)]) == 2
    assert page.read_bytes() == first
    assert main(["view", "--result", str(tmp_path / "solution.npz"), "--html", str(page), "--overwrite", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {"files": [str(page)]}
    assert "exists" in err
    assert page.read_bytes() != first


@pytest.mark.study
def test_a_page_of_a_tube_that_grows_is_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(animation_frames, "_MOST_BODIES", 6)  # of 60: a lighter page
    page = tmp_path / "grown.html"
    assert main(["view", "helix_tube", "--set", "elastic_sections=6", "--growth", "--html", str(page)]) == 0
    assert "wall that has not come out" in page.read_text(encoding="utf-8")
    assert capsys.readouterr().out.splitlines()[-1] == f"{page}: written"


def test_sliders_begin_with_the_loaded_robot(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    """The page itself: tests/test_slider_page.py."""
    calls = []

    class Page:
        url, port, tunnel = "http://127.0.0.1:8123/", 8123, "ssh"

        def __init__(self, model: sr.SoftModel, **options: object) -> None:
            calls.append((model.pinocchio.name, {name: np.asarray(value).tolist() for name, value in options.items()}))

        def __enter__(self) -> Page:
            return self

        def __exit__(self, *_: object) -> None:
            calls.append("closed")

        def wait(self) -> None:
            raise KeyboardInterrupt

    monkeypatch.setattr(slider_page, "SliderPage", Page)
    words = "view inflatable_arm --sliders --motors 0 0.5 -0.5 --force 0 0 -3 --gravity --port 8123"
    assert main(words.split()) == 0
    options = {"q_motors": [0.0, 0.5, -0.5], "force": [0.0, 0.0, -3.0], "gravity": [0.0, 0.0, -9.81], "port": 8123}
    options |= {"environment": None}
    assert calls == [("inflatable_arm", options), "closed"]
    assert "serving http://127.0.0.1:8123/ (Ctrl-C ends)" in capsys.readouterr().out


@pytest.mark.study
def test_the_browser_of_the_machine_is_opened_on_demand(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url))  # as where there is none
    monkeypatch.setattr(sr.Viewer, "wait", lambda self: None)
    assert main(["view", "inflatable_arm", "--open"]) == 0
    out, err = capsys.readouterr()
    assert f"serving {opened[0]} " in out
    assert err == "no browser of this machine could be opened\n"


BAD = {
    "view": "ROBOT = '(nothing)'",
    "view nobody": "no robot or file is called 'nobody'",
    "view inflatable_arm --motors 1 2": "(it has shape (2,)): motor_1 [rad]",
    "view inflatable_arm --result x.npz": "--result must be given without ROBOT",
    "view --result x.npz --gravity --target 1 2 3": "without --target, a load",
    "view --result nowhere.npz": "cannot read a result",
    "view inflatable_arm --growth": "helix_tube, with chain=sections, for --growth",
    "view helix_tube_lumped --growth --html a.html": "helix_tube, with chain=sections",
    "view helix_tube --growth --force 0 0 1": "--growth must be given without a load",
    "view helix_tube --growth --live keyboard": "--growth must be given without --live",
    "view inflatable_arm --html a.html --live keyboard --port 8000": "without --live, --port",
    "view inflatable_arm --html a.html --open": "without --open",
    "view inflatable_arm --sliders --live keyboard": "--sliders must be given without --live",
    "view inflatable_arm --live keyboard --json": "--live must be given without --json",
    "view inflatable_arm --overwrite": "together with --html or --interactive",
    "view inflatable_arm --port 0": "from 1 to 65535",
    "view inflatable_arm --target nan 0 0": "finite",
    "view inflatable_arm --live .": "a file, or the word keyboard",
    "view inflatable_arm --moment 0 1 0 --live keyboard": "a force on the tip and gravity only",
}


@pytest.mark.study
@each_row("words", BAD)
def test_bad_words_are_refused(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words.split()) == 2
    assert BAD[words] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_results_that_cannot_be_shown_or_moved(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    sr.save_result(sr.sample_workspace(arm, 5), tmp_path / "workspace.npz")
    assert main(["view", "--result", str(tmp_path / "workspace.npz")]) == 2
    assert "not a Workspace" in capsys.readouterr().err
    sr.save_result(sr.follow_trajectory(arm, [(0.8, 0.1, 0.2), (0.8, 0.2, 0.2)]), tmp_path / "path.npz")
    for option in (["--live", "keyboard"], ["--sliders"]):
        assert main(["view", "--result", str(tmp_path / "path.npz"), *option]) == 2
        assert "nothing that moves with" in capsys.readouterr().err


@pytest.mark.study
def test_a_branch_is_shown_at_its_last_stable_point(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """One link that buckles: the fundamental path is stable below the critical force, a bow to its end."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), stiffness=100.0))
    table = {"spring_1_up": 60.0}
    model = sr.with_springs(model, table)
    found = {one.label: one for one in sr.post_buckling_branches(model, (0, 0), (-1, 0, 0), largest_step=0.2)}
    file, page = tmp_path / "branches.npz", tmp_path / "page.html"
    sr.save_result(tuple(found.values()), file)
    for label, place in (("fundamental", np.flatnonzero(found["fundamental"].stable)[-1]), ("+spring_1_up", -1)):
        words = ["view", "--result", str(file), f"--branch={label}", "--html", str(page), "--overwrite"]
        assert main(words) == 0
        shown = state_line(found[label].equilibria[place])
        assert capsys.readouterr().out.splitlines()[0] == shown
    for words, told in (
        ([], r"--result = .*branches.npz.* given with --branch=LABEL; available: fundamental, .*spring_1_up"),
        (["--branch=side"], "--branch = 'side'.*fundamental"),
    ):
        assert main(["view", "--result", str(file), *words, "--html", str(tmp_path / "other.html")]) == 2
        assert re.search(told, capsys.readouterr().err)
    sr.save_result(found["fundamental"].equilibria[0], tmp_path / "one.npz")
    assert main(["view", "--result", str(tmp_path / "one.npz"), "--branch=side"]) == 2
    assert "the result has no branches" in capsys.readouterr().err
    assert main(["view", "inflatable_arm", "--branch=side"]) == 2
    assert "given together with --result" in capsys.readouterr().err


@pytest.mark.study
def test_no_answer_ends_with_status_one(capsys: pytest.CaptureFixture) -> None:
    assert main(["view", "inflatable_arm", "--target", "3", "0", "0"]) == 1
    assert "cannot reach" in capsys.readouterr().err


@pytest.mark.study
def test_a_port_is_taken_or_refused(arm: sr.SoftModel, capsys: pytest.CaptureFixture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        wish = free.getsockname()[1]
    with sr.Viewer(arm, port=wish) as viewer:
        assert viewer.url == f"http://127.0.0.1:{wish}/static/"
        assert main(["view", "inflatable_arm", "--port", str(wish)]) == 2
        assert f"port {wish}: Address already in use" in capsys.readouterr().err
    for port in (0, 70_000, "7000"):
        with pytest.raises(sr.ParameterError, match="port"):
            sr.Viewer(arm, port=port)
