"""The script that validates the geometry of the helical tube: what it counts, writes, refuses, and that it can fail."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from studies.helix_validation import comparison
from studies.helix_validation.tubes import committed, grid
from tests.support.helix_rods import actuator_frames
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study


def test_it_validates_the_shipped_files_and_random_tubes(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert (
        run_script(
            "helix_validation", ["--no-grid", "--cases", "1", "--output", str(tmp_path), "--docs", str(tmp_path / "docs")]
        )
        == 0
    )
    result = json.loads((tmp_path / "helix_validation.json").read_text(encoding="utf-8"))
    assert result["passed"]
    lines = {(line["set"], line["chain"]): line for line in result["table"]}
    assert list(lines) == [
        ("committed file", "sections"), ("committed file", "lumped"),
        ("random", "sections"), ("random", "lumped"), ("random", "lumped, midpoint"),
    ]  # fmt: skip
    for line in lines.values():
        assert 0.0 < line["largest_distance_m"] < 1e-12
        assert 0.0 < line["largest_angle_rad"] < 1e-12
    counts = [lines["committed file", form]["boundaries"] for form in ("sections", "lumped")]
    assert counts == [sr.HelixTube().elastic_sections + 2, sr.HelixTube().hinges + 2]  # with segment_1 and tip
    assert lines["random", "lumped"]["tubes"] == 1
    rows = list(csv.DictReader((tmp_path / "helix_validation.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 2 + 3
    assert max(float(row["largest_distance_m"]) for row in rows) == max(line["largest_distance_m"] for line in lines.values())
    pictures = [(folder / "helix_validation.png").read_bytes() for folder in (tmp_path, tmp_path / "docs")]
    assert pictures[0] == pictures[1]
    assert len(pictures[0]) > 20_000
    out, err = capsys.readouterr()
    assert f"| committed file | lumped | 1 | {counts[1]} |" in out
    assert "\npassed\n" in out
    assert "5/5" in err  # a progress bar


def test_it_fails_where_an_error_exceeds_the_tolerance(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    told = ["--no-grid", "--cases", "0", "--no-plots", "--output", str(tmp_path)]
    assert run_script("helix_validation", [*told, "--tolerance", "1e-17"]) == 1
    assert "FAILED: an error exceeds the tolerance" in capsys.readouterr().out


@pytest.mark.parametrize(("moved", "turned"), [((3e-9, 0.0, 0.0), 0.0), ((0.0, 0.0, 0.0), 2e-9)])
def test_it_sees_a_frame_that_is_off(moved: tuple, turned: float, monkeypatch: pytest.MonkeyPatch) -> None:
    (case, _), exact = committed(), comparison.chain_frames

    def bent(model: sr.SoftModel, names: list) -> np.ndarray:
        frames = exact(model, names)
        frames[5, :3, 3] += moved
        turn = np.array([[1.0, -turned, 0.0], [turned, 1.0, 0.0], [0.0, 0.0, 1.0]])
        frames[5, :3, :3] = frames[5, :3, :3] @ turn
        return frames

    monkeypatch.setattr(comparison, "chain_frames", bent)
    row = comparison.measure(case)
    assert row.distance == pytest.approx(3e-9 if turned == 0.0 else 0.0, rel=1e-5, abs=1e-14)
    assert row.angle == pytest.approx(turned, rel=1e-5, abs=1e-13)


def test_its_closed_form_is_the_helix_and_its_grid_is_the_papers() -> None:
    """docs/theory.md 3.1 in 50 digits; 2.5, 5, 10 degrees, contractions 0.5 to 0.9, the paper's diameter, 2.5 times it."""
    cases = list(grid())
    assert len(cases) == 2 * 120
    assert {round(np.degrees(case.tube.angle), 9) for case in cases} == {2.5, 5.0, 10.0}
    assert {case.tube.contraction for case in cases} == {0.5, 0.6, 0.7, 0.8, 0.9}
    assert {case.tube.diameter for case in cases} == {0.0331, 0.08275}
    assert {(case.tube.handedness, round(case.tube.turns, 9), case.tube.upright) for case in cases} > {
        ("right", 1.0, "tube"), ("left", 4.0, "axis"),
    }  # fmt: skip
    for case in cases[::37]:
        tube, places = case.tube, np.array(list(comparison.boundaries(case.tube).values()))
        sign = 1 if tube.handedness == "right" else -1
        given = (tube.contraction, tube.angle, tube.diameter, sign)
        exact = actuator_frames(*given, places, from_base=tube.upright == "tube")
        assert np.allclose(comparison.analytic(tube, places), exact, atol=1e-13, rtol=0)


@each_row(
    ("arguments", "message"),
    [
        (["--cases", "-1"], "--cases"),
        (["--seed", "-1"], "--seed"),
        (["--tolerance", "0"], "--tolerance"),
        (["--tolerance", "nan"], "--tolerance"),
        (["--tolerance", "inf"], "--tolerance"),
        (["--docs", "--no-plots"], "--docs"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script("helix_validation", [*arguments, "--output", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert re.search(f"error: .*{message}", err)
    assert out == ""
    assert not folder.exists()


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "mine.csv").write_text("mine", encoding="utf-8")
    assert run_script("helix_validation", ["--no-grid", "--cases", "0", "--no-plots", "--output", str(tmp_path)]) == 2
    assert "not empty" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["mine.csv"]
