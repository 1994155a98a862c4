"""`softrobots simulate`: the same motions as the library, in files, pictures and pages; bad words are refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.main import main
from softrobots.dynamics.midpoint import MidpointRule
from tests.support.saved_files import same
from tests.support.tables import each_row

ARM = ["simulate", "inflatable_arm"]
SHORT = ["--time-step", "0.01", "--output-step", "0.02"]
FIXED = {"time_step": 0.01, "output_step": 0.02}


def answer(words: list[str], capsys: pytest.CaptureFixture) -> dict[str, Any]:
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.study
def test_a_release_is_that_of_the_library(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """Every file holds the same motion; the text names what a person wants to know."""
    file, motors = tmp_path / "m.npz", (0.3, 0.6, -0.8)
    held = sr.solve_equilibrium(arm, motors, (1, 10, -15), gravity=sr.EARTH_GRAVITY)
    want = sr.simulate(arm, 0.1, motors, start=held, force=(1, 0, 0), gravity=sr.EARTH_GRAVITY, damping_time=0.01, **FIXED)
    words = [*ARM, "--motors", "0.3", "0.6", "-0.8", "--duration", "0.1", "--force", "1", "0", "0", "--gravity", *SHORT]
    words += ["--release", "0", "10", "-15", "--damping-time", "0.01"]
    drawn = ["plot", "energies", "strobe"]
    pictures = [word for name in drawn for word in (f"--{name}", str(tmp_path / f"{name}.png"))]
    assert main([*words, "-o", str(file), *pictures]) == 0
    out, err = capsys.readouterr()
    for told in ("load on tip", "tip error", "energy balance", "10, of 0.01 to 0.01 s", "spring_2_up"):
        assert told in out
    assert "motion" in err  # the bar
    same(want, sr.load_result(file))
    assert all((tmp_path / f"{name}.png").stat().st_size > 10_000 for name in drawn)
    assert main([*words, "-o", str(tmp_path / "m.csv")]) == 0
    assert (tmp_path / "m.csv").read_text().startswith("time [s],motor_1 [rad]")
    assert main([*words, "-o", str(file)]) == 2  # it is there
    capsys.readouterr()
    told = answer(words, capsys)
    assert told["tip_position"] == want.tip_position.tolist()
    assert told["energy"]["balance"] == want.energy.balance.tolist()
    assert told["units"]["velocities"] == "rad/s"


def test_motors_follow_tables_and_trajectories(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A trajectory saved as NPZ and as CSV gives one motion; the duration is theirs."""
    path = sr.straight_line((0.8, 0.0, 0.3), (0.8, 0.3, 0.3), 0.2, 8)
    followed = sr.follow_trajectory(arm, path.positions, gravity=sr.EARTH_GRAVITY, times=path.times)
    start = sr.solve_equilibrium(arm, followed.q_motors[0], gravity=sr.EARTH_GRAVITY)
    want = sr.simulate(arm, 0.2, followed, start=start, gravity=sr.EARTH_GRAVITY, **FIXED)
    table, saved = sr.save_csv(followed, tmp_path / "a.csv"), sr.save_result(followed, tmp_path / "a.npz")
    for file in (table, saved):
        told = answer([*ARM, "--trajectory", str(file), "--gravity", "--start", "equilibrium", *SHORT], capsys)
        assert np.allclose(told["q_motors"], want.q_motors, rtol=0, atol=1e-9)  # targets are reached within 1e-9 m
        assert np.allclose(told["tip_position"], want.tip_position, rtol=0, atol=1e-7)
    longer = answer([*ARM, "--trajectory", str(table), "--duration", "0.3", *SHORT], capsys)
    assert np.allclose(longer["q_motors"][-1], followed.q_motors[-1], rtol=0, atol=1e-12)


def test_a_table_of_forces_and_a_saved_start(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    gust = tmp_path / "gust.csv"
    gust.write_text("t,fx,fy,fz\n0,0,0,-2\n0.04,0,0,-8\n0.1,0,0,0\n")
    table = (np.array([0.0, 0.04, 0.1]), np.array([(0, 0, -2.0), (0, 0, -8.0), (0, 0, 0)]))
    held = sr.solve_equilibrium(arm, (0, 0, 0), (0, 3, -2))
    want = sr.simulate(arm, 0.1, (0, 0, 0), start=held, force=table, wrench=(0, 3, 0, 0, 0, 0), **FIXED)
    words = [*ARM, "--duration", "0.1", "--force", "0", "3", "0", "--force-table", str(gust), *SHORT]
    told = answer([*words, "--start", "equilibrium"], capsys)
    assert told["tip_position"] == want.tip_position.tolist()
    assert np.allclose(np.array(told["forces"])[:, 1], 3.0)
    assert np.allclose(np.array(told["forces"])[2], (0, 3, -8))  # at 0.04 s
    on = sr.simulate(arm, 0.04, (0, 0, 0), start=want, **FIXED)
    file = sr.save_result(want, tmp_path / "m.npz")
    assert answer([*ARM, "--duration", "0.04", "--start", str(file), *SHORT], capsys)["q_springs"] == on.q_springs.tolist()


def test_an_interrupted_motion_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    steps, whole = [], MidpointRule.step

    def step(self: MidpointRule, *arguments: Any) -> Any:
        steps.append(0)
        if len(steps) > 6:
            raise KeyboardInterrupt
        return whole(self, *arguments)

    monkeypatch.setattr(MidpointRule, "step", step)
    file = tmp_path / "m.npz"
    assert main([*ARM, "--duration", "1", "--gravity", *SHORT, "-o", str(file)]) == 130
    kept = sr.load_result(file)
    assert kept.interrupted
    assert 0.04 <= kept.time[-1] <= 0.06
    out, err = capsys.readouterr()
    assert "INTERRUPTED" in out
    assert err.endswith("interrupted\n")


def test_a_saved_motion_is_shown_at_any_speed(arm: sr.SoftModel, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    motion = sr.simulate(arm, 0.1, (0, 0, 0), gravity=sr.EARTH_GRAVITY, **FIXED)
    file = str(sr.save_result(motion, tmp_path / "m.npz"))
    assert main(["view", "--result", file, "--speed", "0.1", "--html", str(tmp_path / "a.html")]) == 0
    assert "a motion of 0.1 s" in capsys.readouterr().out
    for words, told in ((["--live", "keyboard"], "nothing that moves"), (["--speed", "0"], "speed")):
        assert main(["view", "--result", file, *words]) == 2
        assert told in capsys.readouterr().err
    assert main(["view", "inflatable_arm", "--speed", "2"]) == 2
    assert "--result" in capsys.readouterr().err


@each_row(
    ("words", "told"),
    [
        ("", "--duration must be given"),
        ("--duration -1", "--duration must be positive"),
        ("--duration 1 --time-step 0", "--time-step must be positive"),
        ("--duration 1 --time-step 0.01 --tolerance 1e-3", "given with no --time-step"),
        ("--duration 1 --output-step 0", "--output-step must be positive"),
        ("--duration 1 --damping-time -1", "--damping-time must be zero or positive"),
        ("--duration 1 --mass-damping -1", "--mass-damping must be zero or positive"),
        ("--duration 1 --start relaxed --release 0 0 1", "given with no --start"),
        ("--duration 1 --release nan 0 0", "--release"),
        ("--duration 1 --start no.npz", "cannot read a result from no.npz"),
        ("--duration 1 --motors 1", "(it has shape (1,)): motor_1 [rad]"),
        ("--duration 1 --plot a.jpg", "ends in .png"),
        ("--duration 1 --energies a.jpg", "ends in .png"),
        ("--duration 1 -o a.txt", "ends in .npz or .json or .csv"),
        ("--trajectory bad.csv", "t, motor_1, motor_2, motor_3 are required"),
        ("--trajectory one.csv", "at least two are required"),
        ("--trajectory back.csv", "increasing"),
        ("--duration 1 --force-table back.csv", "not before the row above"),
        ("--duration 1 --force-table empty.csv", "at least one"),
        ("--duration nan --trajectory turn.csv", "--duration must be a finite number"),
        ("--duration 1 --frame nowhere", "nowhere"),
    ],
)
def test_bad_words_are_refused(
    words: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    one = "t,motor_1,motor_2,motor_3\n0,0,0,0\n"
    back = "t,fx,fy,fz,motor_1,motor_2,motor_3\n1,0,0,0,0,0,0\n0,0,0,0,0,0,0\n"
    texts = {"bad": "t,x\n0,1\n", "one": one, "turn": f"{one}1,1,1,1\n", "back": back, "empty": "t,fx,fy,fz\n"}
    for name, text in texts.items():
        Path(f"{name}.csv").write_text(text)
    assert main([*ARM, *words.split()]) == 2
    out, err = capsys.readouterr()
    assert told in err
    assert out == ""
    assert len(list(tmp_path.iterdir())) == len(texts)
