"""`scripts/contact.py`: paths in contact are followed, told, drawn and saved."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from studies.contact import examples
from tests.support.scripts import run_script
from tests.support.tables import each_row


@pytest.mark.study
def test_an_arm_braces_against_the_wall(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """On the wall it carries more than twice of what it carries free."""
    folder = tmp_path / "out"
    assert run_script("contact", ["--only", "brace", "--steps", "5", "--output", str(folder)]) == 0
    files = {"brace.npz", "brace.html", *(f"brace_{word}.png" for word in ("forces", "shape", "margins"))}
    assert {path.name for path in folder.iterdir()} == files
    out = capsys.readouterr().out
    carried = re.search(r"carries ([\d.]+) times", out)
    assert carried is not None
    assert float(carried[1]) > 2.0
    last = sr.load_result(folder / "brace.npz")
    assert last.stable
    assert not last.wrinkled
    assert [contact.obstacle for contact in last.contacts] == ["wall"]
    free = sr.solve_equilibrium(last.model, examples.LEANING, (0, 0, -41))
    assert free.wrinkled
    page = (folder / "brace.html").read_text(encoding="utf-8")
    assert "wall presses with 0 to 46.5 N" in page


@pytest.mark.study
def test_with_friction_the_events_are_told(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    words = ["--only", "brace", "--steps", "3", "--friction", "0.3", "--no-plots", "--output", str(folder)]
    assert run_script("contact", words) == 0
    assert {path.name for path in folder.iterdir()} == {"brace.html"}
    assert "changes of contacts: 1 made" in capsys.readouterr().out


@pytest.mark.study
def test_smooth_pegs_push_across_their_axes_and_in_turn_to_either_side() -> None:
    """Nothing else moves the rod than its pull: without pegs it is straight."""
    last = examples.snake(np.linspace(0.0, 0.004, 3)).equilibria[-1]
    assert {contact.obstacle for contact in last.contacts} == {"peg_1", "peg_2", "peg_3"}
    assert np.abs([contact.force[1] for contact in last.contacts]).max() < 1e-9
    signs = {contact.obstacle: np.sign(contact.force[0]) for contact in last.contacts}
    assert signs == {"peg_1": 1.0, "peg_2": -1.0, "peg_3": 1.0}
    assert last.stable


@each_row(
    ("words", "told"),
    [
        (["--steps", "1"], "--steps must be two or more"),
        (["--friction", "-0.1"], "--friction"),
        (["--duration", "0"], "--duration must be positive"),
    ],
)
def test_bad_words_are_refused(words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert run_script("contact", [*words, "--output", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
