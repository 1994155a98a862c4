"""`scripts/motion.py`: every motion is simulated, saved and drawn; shaping takes the swing away."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from tests.support.scripts import run_script
from tests.support.tables import each_row

SHOWN = {"energies", "strobe", "tip_over_time"}


@pytest.mark.study
def test_motions_are_simulated_saved_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """The free swing goes on about the rest position; a shaped turn leaves little of the swing."""
    folder = tmp_path / "out"
    assert run_script("motion", ["--output", str(folder)]) == 0
    names = {"release", "turn_unshaped", "turn_zv", "turn_ei", "gust"}
    files = {f"{name}.{ending}" for name in names for ending in ("npz", "csv", "html")} | {"turn_tip.png"}
    assert {path.name for path in folder.iterdir()} == files | {f"{name}_{what}.png" for name in names for what in SHOWN}
    out = capsys.readouterr().out
    swings = {name: float(number) for name, number in re.findall(r"(turn_\w+) .* ([\d.]+) mm +\S+ J", out)}
    assert swings["turn_zv"] < 0.1 * swings["turn_unshaped"]
    assert swings["turn_ei"] < 0.02 * swings["turn_unshaped"]
    released = sr.load_result(folder / "release.npz")
    rest = sr.solve_equilibrium(released.model, released.q_motors[-1], gravity=released.gravity).tip_position
    assert np.linalg.norm(released.tip_position[-1] - rest) < 0.1 * np.linalg.norm(released.tip_position[0] - rest)
    assert released.tip_error <= released.tolerance == pytest.approx(5e-4 * released.model.reach)


@pytest.mark.study
def test_one_short_motion_without_pictures(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    words = ["--only", "release", "--duration", "0.05", "--no-plots", "--output", str(folder)]
    assert run_script("motion", words) == 0
    assert {path.name for path in folder.iterdir()} == {"release.npz", "release.csv", "release.html"}
    assert "release" in capsys.readouterr().out
    assert run_script("motion", words) == 2  # the folder is not empty


@each_row(
    ("words", "told"),
    [(["--duration", "0"], "--duration must be positive"), (["--speed", "-1"], "--speed must be positive")],
)
def test_bad_words_are_refused(words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert run_script("motion", [*words, "--output", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
