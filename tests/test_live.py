"""The live view: its grammar, what it shows, and where its commands come from: a pipe, a file, the keys of a terminal."""

from __future__ import annotations

import io
import os
import pty
import select
import signal
import termios
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import softrobots as sr
from softrobots.view import warm_start
from softrobots.view.live import input as live_input
from softrobots.view.live.commands import Wanted, changed, read_commands
from softrobots.view.live.input import Lines, Terminal, WatchedFile, commands_from
from softrobots.view.live.keys import KeyMoves
from softrobots.view.live.loop import LiveView, follow, state_line, tip_force
from softrobots.view.warm_start import next_equilibrium, next_solution
from tests.conftest import PATIENCE
from tests.support.tables import each_row

START = Wanted(np.array([0.0, 0.5, -0.5]), None, np.array([0.0, 0.0, -1.0]), None)
NOW = Wanted(np.array([0.1, 0.2, 0.3]), np.array([0.8, 0.1, 0.2]), np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, -9.81]))


class FakePage:
    """Remembers what it was told to show."""

    def __init__(self) -> None:
        self.serving = True
        self.shown: list[sr.Equilibrium] = []
        self.marks: list[object] = []

    def show(self, equilibrium: sr.Equilibrium) -> None:
        self.shown.append(equilibrium)

    def mark(self, target: object) -> None:
        self.marks.append(target)


def as_lists(wanted: Wanted) -> list[object]:
    """As plain lists, which compare."""
    return [None if value is None else np.asarray(value).tolist() for value in wanted[:4]] + [wanted.done]


def live_arm(arm: sr.SoftModel, force: tuple[float, float, float] = (0, 0, -1)) -> LiveView:
    return LiveView(FakePage(), sr.solve_equilibrium(arm, (0.0, 0.5, -0.5), force))


# --- The grammar


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("target 0.9 0.3 -2e-1", NOW._replace(target=[0.9, 0.3, -0.2])),
        ("  force 0 10 -15  ", NOW._replace(force=[0.0, 10.0, -15.0])),
        ("motors 1 2", NOW._replace(motors=[1.0, 2.0], target=None)),  # how many, the robot knows
        ("gravity on", NOW),
        ("gravity off", NOW._replace(gravity=None)),
        ("gravity 0 0 1.62", NOW._replace(gravity=[0.0, 0.0, 1.62])),
        ("reset", START),
        ("quit", NOW._replace(done=True)),
        ("", NOW),
        ("# target 1 2 3", NOW),
        ('{"target": [1, 2, 3], "gravity": false}', NOW._replace(target=[1.0, 2.0, 3.0], gravity=None)),
        (
            '{"motors": [1], "gravity": true, "force": [0, 0, 1]}',
            NOW._replace(motors=[1.0], target=None, force=[0.0, 0.0, 1.0]),
        ),
        ('{"gravity": [0, 0, -1.62]}', NOW._replace(gravity=[0.0, 0.0, -1.62])),
        ('{"gravity": null}', NOW._replace(gravity=None)),
        ("{}", NOW),
    ],
)
def test_lines_and_objects_say_what_is_wanted(line: str, expected: Wanted) -> None:
    assert as_lists(changed(line, NOW, START)) == as_lists(expected)


@each_row(
    ("line", "message"),
    [
        ("targte 1 2 3", "no command is called 'targte' .did you mean 'target'"),
        ("target 1 2", r"target .*shape \(3,\).*\[m\]"),
        ("target 1 2 3 4", "target"),
        ("target", "target"),
        ("force 1 2 x", "force = '1 2 x': force must be given in numbers"),
        ("force nan 0 0", "finite"),
        ("force 1e40 0 0", "at most"),
        ("gravity", "gravity"),
        ("gravity up", "on, off or three numbers"),
        ("gravity 1 2", "gravity"),
        ("reset 3", "without anything else"),
        ("quit now", "without anything else"),
        ('{"target": [1, 2, 3]', "no JSON object"),
        ('{"target": [1, 2, NaN]}', "NaN is not a number"),
        ('{"target": "far"}', "target"),
        ('{"target": ["1", "2", "x"]}', "finite numbers"),
        ('{"target": [1, "2", null]}', "target"),
        ('{"force": null}', "force"),
        ('{"reset": true}', "no command is called 'reset'"),
        ('{"tip": [1, 2, 3]}', "available: target, motors, force, gravity"),
        ('{"motors": [1, 2, 3], "target": [1, 2, 3]}', "left out where a target is given"),
        ('{"a": ' + "[" * 100_000, "no JSON object"),
    ],
)
def test_lines_that_are_refused(line: str, message: str) -> None:
    with pytest.raises(sr.SoftRobotsError, match=message):
        changed(line, NOW, START)


def test_a_file_says_all_that_differs_from_the_start() -> None:
    lines = read_commands("# how it stands\nforce 0 0 -5\n\ngravity on\nforce 0 0 -6\n", START)
    assert as_lists(lines) == [[0.0, 0.5, -0.5], None, [0.0, 0.0, -6.0], [0.0, 0.0, -9.81], False]
    assert as_lists(read_commands('\n{"force": [0, 0, -6],\n "gravity": true}\n', START)) == as_lists(lines)
    assert read_commands("", START) is START
    with pytest.raises(sr.NameNotFound):
        read_commands("force 0 0 -5\nfroce 1 2 3\n", START)


# --- From one equilibrium to the next


def test_a_buckled_arm_stays_on_its_side_until_it_is_pushed_through(arm: sr.SoftModel) -> None:
    """Pressed along its axis beyond the critical load, the straight arm has two bows; a light push against one leaves it."""
    straight = (0.0, 0.0, 0.0)
    # One link on its spring buckles at k / l = 172.71 / 0.57 = 303 N; two of them, one on the other, at less.
    press = -1000.0  # three times as much
    up = sr.solve_equilibrium(arm, straight, (press, 0.0, 1.0))
    after = next_equilibrium(up, straight, (press, 0.0, -1.0))
    fresh = sr.solve_equilibrium(arm, straight, (press, 0.0, -1.0))
    assert up.tip_position[2] > 0.1
    assert fresh.tip_position[2] < -0.1
    assert after.tip_position[2] > 0.1
    assert after.stable
    assert after.residual <= after.tolerance


def test_without_a_way_from_the_last_springs_the_relaxed_ones_are_tried(
    arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lengths that the last bend does not fit together with, and a search that fails, both end in the cold answer."""
    last = sr.solve_equilibrium(arm, (0.0, 0.5, -0.5), (0, 0, -1))
    cold = sr.solve_equilibrium(arm, (0.2, 0.5, -0.5), (0, 3, 0))

    def fails_warm(*arguments: object, **options: object) -> sr.Equilibrium:
        if options.get("previous") is not None:
            raise sr.EquilibriumNotFound("none", best=None, residual=1.0, iterations=1)
        return sr.solve_equilibrium(*arguments, **options)

    monkeypatch.setattr(warm_start, "solve_equilibrium", fails_warm)
    assert np.array_equal(next_equilibrium(last, (0.2, 0.5, -0.5), (0, 3, 0)).q_springs, cold.q_springs)


def test_friction_remembers_from_one_command_to_the_next() -> None:
    """A tendon bends a segment by the constant moment `T d`, with friction a play operator: it gives way between two lines."""
    stiffness, distance, length, moment = 2e-3, 0.0045, 0.06, 2e-3
    fields = {"bending_stiffness": stiffness, "tendon_distance": distance, "bending_friction": moment, "elastic_sections": 2}
    rod = sr.load_model(sr.TendonArm(segment_lengths=(length,), tendon_azimuths=(0.0,), kind="tension", **fields))
    last, bend = sr.solve_equilibrium(rod, (0.0,)), 0.0
    for tension in (2.0, 4.0, 3.5, 1.0, 0.0, 3.0):
        last = next_equilibrium(last, (tension,))
        bend = min(max(bend, tension * distance - moment), tension * distance + moment)
        assert last.q_springs[1::4].sum() == pytest.approx(bend * length / stiffness, abs=4.04e-4)  # two sticks a section
    back = sr.solve_equilibrium(rod, (1.5,), previous=last)  # beyond the play, 2 moment / distance
    found = next_solution(last, back.tip_position)
    assert found.q_motors == pytest.approx([1.5], abs=1e-6)  # one that nothing has moved has the tip there at 2.4 N
    assert found.equilibrium.q_springs == pytest.approx(back.q_springs, abs=1e-8)


def test_a_solution_follows_on_from_the_last_one_also_beyond_the_limits(arm: sr.SoftModel) -> None:
    last = sr.solve_equilibrium(arm, (0.2, 0.5, -1.0), (0, 0, -3))
    near = next_solution(last, last.tip_position + (0.0, 0.01, 0.0), (0, 0, -3))
    # 1 cm of the tip at 1 m: the motors turn by about a hundredth; another solution would turn the elbow over.
    assert np.abs(near.q_motors - last.q_motors).max() < 0.05
    beyond = sr.solve_equilibrium(arm, (3.5, 0.5, -1.0), (0, 0, -3))
    assert not beyond.within_limits
    again = next_solution(beyond, last.tip_position, (0, 0, -3))
    assert np.linalg.norm(again.equilibrium.tip_position - last.tip_position) <= 1e-9  # the tolerance of solve_ik
    with pytest.raises(sr.TargetUnreachable):
        next_solution(last, (3.0, 0.0, 0.0))


# --- The view


def test_the_tip_stays_at_its_target_when_the_load_changes(arm: sr.SoftModel) -> None:
    live = live_arm(arm)
    for line in ("target 0.9 0.3 0.2", "force 0 10 -15", "gravity on", "force 5 0 3"):
        found = live.apply(changed(line, live.wanted, live.start))
        assert np.linalg.norm(found.tip_position - (0.9, 0.3, 0.2)) <= 1e-9  # the tolerance of solve_ik
        assert live.page.shown[-1] is found
        assert live.page.marks[-1].tolist() == [0.9, 0.3, 0.2]
    assert found.load.gravity == sr.EARTH_GRAVITY
    free = live.apply(changed("motors 0.1 0.4 -0.6", live.wanted, live.start))
    assert free.q_motors.tolist() == [0.1, 0.4, -0.6]
    assert live.page.marks[-1] is None
    back = live.apply(changed("reset", live.wanted, live.start))
    assert np.array_equal(back.q, sr.solve_equilibrium(arm, (0.0, 0.5, -0.5), (0, 0, -1)).q)


def test_what_cannot_be_followed_is_told_and_leaves_all_as_it_is(arm: sr.SoftModel) -> None:
    live = live_arm(arm)
    reader, writer = os.pipe()
    os.write(writer, b"target 3 0 0\nmotors 1 2\nforce 0 0\nfor\xff 1\nforce 0 0 -4")
    os.close(writer)
    lines: list[str] = []
    errors: list[str] = []
    follow(live, Lines(reader, lines.append), lines.append, errors.append)
    os.close(reader)
    expected = sr.solve_equilibrium(arm, (0.0, 0.5, -0.5), (0, 0, -4))
    assert [word in error for word, error in zip(("cannot reach", "q_motors", "force", "no command"), errors, strict=True)] == [
        True
    ] * 4
    assert lines == [state_line(live.equilibrium)]
    assert np.allclose(live.page.shown[-1].q_springs, expected.q_springs, atol=1e-9)  # residual 1e-9 of 1 N m on 100 N m/rad
    assert len(live.page.shown) == 1


def test_the_view_ends_with_its_page(arm: sr.SoftModel) -> None:
    live = live_arm(arm)
    live.page.serving = False
    follow(live, None, print, print)  # reads nothing

    def closed(_: object) -> None:
        raise sr.ViewerError("closed")

    live.page.serving, live.page.show = True, closed
    reader, writer = os.pipe()
    os.write(writer, b"force 0 0 -2\n")
    with pytest.raises(sr.ViewerError, match="closed"):
        follow(live, Lines(reader, print), print, print)
    os.close(reader)
    os.close(writer)


def test_a_view_begins_with_a_solution_and_refuses_other_loads(arm: sr.SoftModel) -> None:
    solution = sr.solve_ik(arm, (0.9, 0.3, 0.2), (0, 0, -3), gravity=sr.EARTH_GRAVITY)
    live = LiveView(FakePage(), solution)
    assert as_lists(live.start) == [solution.q_motors.tolist(), [0.9, 0.3, 0.2], [0.0, 0.0, -3.0], [0.0, 0.0, -9.81], False]
    assert tip_force(sr.solve_equilibrium(arm, (0, 0, 0))).tolist() == [0.0, 0.0, 0.0]
    for load in ({"wrench": (0, 0, 0, 0, 1, 0)}, {"force": (0, 0, 1), "frame": "link_1"}):
        with pytest.raises(sr.ParameterError, match="a force on the tip and gravity only"):
            LiveView(FakePage(), sr.solve_equilibrium(arm, (0, 0, 0), **load))


def test_the_line_tells_where_the_tip_is_and_what_is_wrong(arm: sr.SoftModel) -> None:
    calm = state_line(sr.solve_equilibrium(arm, (0, 0, 0)))
    assert calm.startswith("tip 1.2000 0.0000 0.0000 m, motors 0.0000 0.0000 0.0000, stable, not wrinkled, residual ")
    assert "-0.0000" not in state_line(sr.solve_equilibrium(arm, (-1e-9, 0, 0)))
    bent = sr.solve_equilibrium(arm, (0, 0, 0), (0, 0, -40.0))  # 40 N x 1.14 m: far beyond the wrinkling moment
    assert ", stable, wrinkled, residual" in state_line(bent)
    tube = sr.load_model(sr.PccArm(segment_lengths=(0.3,), muscle_azimuths=()))
    assert "motors" not in state_line(sr.solve_equilibrium(tube, ()))
    assert "wrinkled" not in state_line(sr.solve_equilibrium(tube, ()))
    tendons = sr.load_model(sr.TendonArm(elastic_sections=1))
    loose = sr.solve_equilibrium(tendons, tendons.relaxed_motors + [0, 0, 0, 0, 0, 0, 0, 0, 0.003])
    newtons = " ".join(f"{force:.4f}" for force in loose.muscle_forces)
    assert f", tensions {newtons} N, slack tendon_3_3, stable, residual" in state_line(loose)
    assert "motors 3.5000 0.0000 0.0000 (beyond limits)" in state_line(sr.solve_equilibrium(arm, (3.5, 0, 0)))


# --- Lines of a pipe


def test_lines_arrive_in_pieces_and_end_with_the_pipe(arm: sr.SoftModel) -> None:
    live, told_lines = live_arm(arm), []
    reader, writer = os.pipe()
    lines = Lines(reader, told_lines.append)
    os.write(writer, b"force 0 0 -2\nfor")
    assert lines.read(live).force.tolist() == [0.0, 0.0, -2.0]
    assert lines.read(live) is None  # half a line
    os.write(writer, b"ce 0 0 -3\n\nhelp\n")
    assert lines.read(live).force.tolist() == [0.0, 0.0, -3.0]
    assert lines.read(live) is None
    assert lines.read(live) is None
    assert "target X Y Z" in told_lines[0]
    os.write(writer, b"force 0 0 -4")
    os.close(writer)
    assert lines.read(live) is None
    assert lines.read(live).force.tolist() == [0.0, 0.0, -4.0]
    assert lines.read(live).done
    os.close(reader)


def test_what_never_ends_a_line_is_refused(arm: sr.SoftModel) -> None:
    live = live_arm(arm)
    with Path("/dev/zero").open("rb") as zeros:
        lines = Lines(zeros.fileno(), print)
        assert [lines.read(live) for _ in range(15)] == [None] * 15  # 64 KiB each: 983040 bytes
        with pytest.raises(sr.FileFormatError, match="at most 1000000 bytes"):
            lines.read(live)


# --- A watched file


@pytest.fixture
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_input, "_PERIOD", 0.0)


def test_a_file_is_read_when_it_says_something_new(quickly: None, arm: sr.SoftModel, tmp_path: Path) -> None:
    live, remarks = live_arm(arm), []
    file = tmp_path / "wanted.json"
    watched = WatchedFile(file, remarks.append)
    assert [watched.read(live), watched.read(live)] == [None, None]
    assert len(remarks) == 1  # said once
    assert "waiting for" in remarks[0]
    file.write_text('{"force": [0, 0, -2]}')
    assert watched.read(live).force.tolist() == [0.0, 0.0, -2.0]
    assert watched.read(live) is None
    file.write_text('{"force": [0, 0')  # somebody is writing
    with pytest.raises(sr.FileFormatError, match="no JSON object"):
        watched.read(live)
    assert watched.read(live) is None  # told once
    file.write_text('{"force": [0, 0, -3]}')
    assert watched.read(live).force.tolist() == [0.0, 0.0, -3.0]
    # Replaced in one move by a file of the same length and the same time.
    other = tmp_path / "next.json"
    other.write_text('{"force": [0, 0, -4]}')
    before = file.stat()
    os.utime(other, ns=(before.st_atime_ns, before.st_mtime_ns))
    other.replace(file)
    assert watched.read(live).force.tolist() == [0.0, 0.0, -4.0]
    # Written again within one tick of the clock of the file system: same length, same time, same file.
    at = file.stat()
    file.write_text('{"force": [0, 0, -5]}')
    os.utime(file, ns=(at.st_atime_ns, at.st_mtime_ns))
    assert watched.read(live).force.tolist() == [0.0, 0.0, -5.0]
    file.unlink()
    assert watched.read(live) is None
    assert len(remarks) == 2
    file.write_text("gravity on\nquit\n")
    assert watched.read(live).done


def test_files_that_cannot_be_commands(quickly: None, arm: sr.SoftModel, tmp_path: Path) -> None:
    live = live_arm(arm)
    with pytest.raises(sr.ParameterError, match="a file, or the word keyboard"):
        WatchedFile(tmp_path, print)
    file = tmp_path / "wanted"
    watched = WatchedFile(file, print)
    for content, message in ((b"\xff\xfe", "is no text"), (b"#" * 1_000_001, "at most 1000000 bytes"), (b"force 1", "force")):
        file.write_bytes(content)
        with pytest.raises(sr.SoftRobotsError, match=message):
            watched.read(live)
    file.unlink()
    os.mkfifo(file)  # reading it would block
    with pytest.raises(sr.FileFormatError, match="must be a file"):
        watched.read(live)
    assert watched.read(live) is None


def test_a_file_is_looked_at_ten_times_a_second(arm: sr.SoftModel, tmp_path: Path) -> None:
    watched = WatchedFile(tmp_path / "wanted", lambda _: None)
    live, begin = live_arm(arm), time.monotonic()
    for _ in range(4):
        watched.read(live)
    assert time.monotonic() - begin >= 0.3  # the first one at once


# --- Keys


def test_keys_move_what_they_say(arm: sr.SoftModel) -> None:
    live = live_arm(arm)
    keys, tip = KeyMoves(live.equilibrium), live.equilibrium.tip_position

    def pressed(*names: str) -> Wanted:
        wanted = live.wanted
        for name in names:
            wanted = keys.press(name, wanted, live.start, live.equilibrium)
        return wanted

    # 2 % of the reach of 1.2 m, rounded to 1, 2 or 5 times a power of ten
    assert np.allclose(pressed("right", "right", "x", "up", "page down").target - tip, (0.06, -0.02, 0.02))
    assert np.allclose(pressed("left", "X", "down", "Z", "z", "y", "Y", "page up").target - tip, (-0.04, 0.02, -0.02))
    assert np.allclose(pressed("<", "right").target - tip, (0.01, 0.0, 0.0))
    assert np.allclose(pressed(">", "right").target - tip, (0.02, 0.0, 0.0))
    assert pressed("2", "+", "+").motors.tolist() == pytest.approx([0.0, 0.6, -0.5])
    assert pressed("3", "-").motors.tolist() == pytest.approx([0.0, 0.5, -0.55])
    assert pressed("up", "+").target is None
    assert pressed("g").gravity.tolist() == [0.0, 0.0, -9.81]
    assert pressed("g", "g").gravity is None
    assert pressed("up", "r") is live.start
    assert pressed("t") is live.wanted
    pressed("f")
    moved = pressed("down").force - live.wanted.force
    assert moved[:2].tolist() == [0.0, 0.0]
    # A step of the force bends the arm about as far as a hundredth of its reach, within what rounding to 1, 2, 5 changes.
    sag = next_equilibrium(live.equilibrium, live.wanted.motors, live.wanted.force + moved).tip_position - tip
    assert 0.3 * 0.012 < np.linalg.norm(sag) < 2.0 * 0.012
    for name, kind in (("k", sr.NameNotFound), ("9", sr.ParameterError)):
        with pytest.raises(kind):
            pressed(name)


def test_a_robot_without_actuators_has_its_force_moved() -> None:
    tube = sr.load_model(sr.PccArm(segment_lengths=(0.3,), muscle_azimuths=()))
    state = sr.solve_equilibrium(tube, ())
    live, keys = LiveView(FakePage(), state), KeyMoves(state)
    assert "force" in keys.hint
    assert keys.press("x", live.wanted, live.start, state).force[0] > 0.0
    for key in ("t", "1", "+"):
        with pytest.raises(sr.ParameterError):
            keys.press(key, live.wanted, live.start, state)
    with pytest.raises(sr.ParameterError):
        live.apply(changed("target 0 0 0.2", live.wanted, live.start))


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> object:
    """A terminal as standard input; `keys` presses keys on it."""
    keyboard, screen = pty.openpty()
    monkeypatch.setattr("sys.stdin", SimpleNamespace(fileno=lambda: screen, closed=False))
    yield SimpleNamespace(keys=lambda text: os.write(keyboard, text), screen=screen, mode=lambda: termios.tcgetattr(screen))
    os.close(keyboard)
    os.close(screen)


def test_single_keys_of_a_terminal(terminal: SimpleNamespace, arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout", io.StringIO())
    live, remarks = live_arm(arm), []
    tip, before = live.equilibrium.tip_position, terminal.mode()
    with commands_from("keyboard", live, remarks.append) as keys:
        assert not terminal.mode()[3] & (termios.ICANON | termios.ECHO)
        assert terminal.mode()[3] & termios.ISIG  # Ctrl-C still interrupts
        assert "arrows move the target by 0.02 m" in remarks[-1]
        assert keys.read(live) is None  # nothing pressed
        terminal.keys(b"\x1b[A\x1bOC\x1b[5~x")  # up, right as in application mode, page up, x: one change
        assert np.allclose(keys.read(live).target - tip, (0.04, 0.02, 0.02))
        terminal.keys(b"\x1b[")
        assert select.select([terminal.screen], [], [], 1.0)[0]
        later = threading.Timer(0.03, terminal.keys, (b"B",))  # the rest of an arrow is late, as over a network
        later.start()
        assert np.allclose(keys.read(live).target - tip, (0.0, 0.0, -0.02))
        later.join()
        terminal.keys(b"\x1b")  # Escape alone does nothing
        assert keys.read(live) is None
        terminal.keys(b"?f\n")
        assert keys.read(live) is None
        assert "choose an actuator" in remarks[-2]
        assert "arrows move the force by" in remarks[-1]
        terminal.keys(b":force 0 0 -7\nf")
        assert keys.read(live).force.tolist() == [0.0, 0.0, -7.0]
        terminal.keys(b":help\n")
        assert keys.read(live) is None
        assert "target X Y Z" in remarks[-1]
        for text, message in (
            (b"k", "no key is called 'k'"),
            (b"\x1b[H", "no key"),
            (b":targ 1\n", "no command"),
            (b"9", "actuator"),
        ):
            terminal.keys(text)
            with pytest.raises(sr.SoftRobotsError, match=message):
                keys.read(live)
        terminal.keys(b"r")
        assert keys.read(live) is None  # as at the start already
        live.apply(live.wanted._replace(force=np.array([0.0, 0.0, -7.0])))
        terminal.keys(b"r")
        assert keys.read(live) is live.start
        assert not terminal.mode()[3] & termios.ICANON  # after the typed line, too
        terminal.keys(b"q")
        assert keys.read(live).done
    assert terminal.mode() == before


@pytest.mark.parametrize("way", ["error", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGINT"])
def test_the_terminal_is_as_before_on_every_way_out(way: str, terminal: SimpleNamespace) -> None:
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals reach the main thread only")
    before, handlers = terminal.mode(), [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGCONT)]

    def leave() -> None:
        with Terminal(terminal.screen):
            assert terminal.mode() != before
            termios.tcsetattr(terminal.screen, termios.TCSADRAIN, before)  # as a shell does when the program is stopped
            signal.raise_signal(signal.SIGCONT)
            assert not terminal.mode()[3] & termios.ICANON
            if way == "error":
                raise ZeroDivisionError
            signal.raise_signal(getattr(signal, way))
            time.sleep(PATIENCE)

    with pytest.raises((SystemExit, KeyboardInterrupt, ZeroDivisionError)) as ended:
        leave()
    if way.startswith("SIG") and way != "SIGINT":
        assert ended.value.code == 128 + getattr(signal, way)
    assert terminal.mode() == before
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGCONT)] == handlers


def test_no_standard_input(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(sr.ParameterError, match="no standard input"), commands_from("keyboard", live_arm(arm), print):
        pass
