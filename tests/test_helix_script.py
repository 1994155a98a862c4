"""The script of the helical tube, as a user runs it."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.view import animation_frames
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study


@pytest.fixture(autouse=True)
def light_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """A growth of few pictures."""
    monkeypatch.setattr(animation_frames, "_MOST_BODIES", 6)


def test_an_actuator_becomes_design_template_robots_and_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    told = ["--gravity", "--upright", "tube", "--sections", "10", "--length", "0.8", "--pressure", "20e3"]
    assert run_script("helix_tube", [*told, "--output", str(folder)]) == 0
    names = {path.name for path in folder.iterdir()}
    expected = {"design.json", "equilibrium.npz", "growth.html", "helix_tube.urdf", "helix_tube_lumped.urdf", "scene.html"}
    assert names == expected | {"shape.png", "summary.json", "template.csv", "template.svg"}
    printed = capsys.readouterr().out
    summary = json.loads((folder / "summary.json").read_text())
    # docs/theory.md 3: 5 degrees, 0.66, 33.1 mm
    assert summary["outer_radius_m"] == pytest.approx(0.0854078008, abs=1e-10)
    assert summary["inner_radius_m"] == pytest.approx(0.0523078008, abs=1e-10)
    assert summary["turn_height_m"] == pytest.approx(2 * np.pi * 0.0279647090, abs=1e-9)
    assert summary["weight_N"] == pytest.approx(920 * np.pi * 0.0331 * 1e-4 * 0.8 * 9.81, rel=1e-12)
    assert summary["wrinkling_moment_N_m"] == pytest.approx(np.pi**2 / 4 * 20e3 * 0.01655**3, rel=1e-12)
    assert "certified stable  yes" in printed
    # Both robots load, and hang like the saved answer: exactly, and to second order.
    saved = sr.load_result(folder / "equilibrium.npz")
    assert np.allclose(saved.tip_position, summary["tip_m"], rtol=0.0, atol=1e-12)
    unloaded = {}
    for name in ("helix_tube", "helix_tube_lumped"):
        model = sr.load_model(folder / f"{name}.urdf")
        unloaded[name] = sr.solve_equilibrium(model, ()).tip_position
        tip = sr.solve_equilibrium(model, (), gravity=sr.EARTH_GRAVITY).tip_position
        assert np.linalg.norm(tip - saved.tip_position) < 0.1 * summary["sag_m"]
    assert np.allclose(*unloaded.values(), rtol=0.0, atol=1e-12)
    assert summary["sag_m"] == pytest.approx(np.linalg.norm(saved.tip_position - unloaded["helix_tube"]), rel=1e-9)
    assert sr.load_result(folder / "design.json").tube_length == pytest.approx(0.8, rel=1e-12)
    assert ElementTree.parse(folder / "template.svg").getroot().get("width").endswith("mm")  # type: ignore[union-attr]
    for page in ("scene.html", "growth.html"):
        assert "meshcat" in (folder / page).read_text(encoding="utf-8").lower()


def test_an_antenna_has_the_wanted_radius_rise_and_turns(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    wish = ["--antenna", "0.07", "0.18", "1.5", "--handedness", "left", "--no-plots", "--sections", "6"]
    assert run_script("helix_tube", [*wish, "--output", str(folder)]) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["centre_radius_m"] == pytest.approx(0.07, rel=1e-12)
    assert summary["height_m"] == pytest.approx(0.27, rel=1e-12)
    # Without load the tip is on a left-handed helix: from (R, 0, 0), a turn and a half clockwise and up.
    assert np.allclose(summary["tip_m"], (-0.07, 0.0, 0.27), rtol=0.0, atol=1e-12)
    design = sr.load_result(folder / "design.json")  # the saved design gives the same tube
    tube = sr.HelixTube.from_design(design, elastic_sections=6, hinges=6, upright="axis")
    assert (folder / "helix_tube.urdf").read_text(encoding="utf-8") == tube.urdf()


def test_a_wish_that_cannot_be_made_is_refused_or_moved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wish = ["--antenna", "0.07", "0.01", "1.2", "--no-plots", "--sections", "4", "--output", str(tmp_path / "out")]
    assert run_script("helix_tube", wish) == 2
    err = capsys.readouterr().err
    assert "runs into itself" in err
    assert "--nearest takes" in err
    assert "on_unrealisable" not in err
    assert not (tmp_path / "out").exists()
    assert run_script("helix_tube", [*wish, "--nearest"]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["turn_height_m"] > 0.033  # turns a diameter apart, nearly above each other


@each_row(
    ("options", "message"),
    [
        (["--contraction", "1.2"], "contraction"),
        (["--contraction", "1", "--angle", "0"], "straight"),
        (["--angle", "90"], "angle"),
        (["--diameter", "-1"], "diameter"),
        (["--squeeze", "0.001"], "--squeeze"),
        (["--antenna", "0.07", "0.18", "3", "--contraction", "0.7"], "--contraction"),
        (["--antenna", "0.07", "0.18", "3", "--length", "1"], "--length"),
        (["--design", "nowhere.json"], "nowhere.json"),
        (["--design", "nowhere.json", "--diameter", "0.04"], "--diameter"),
        (["--nearest"], "--nearest"),
        (["--sections", "51"], "--sections"),
        (["--sections", "1"], "elastic_sections"),
        (["--spacing", "0"], "spacing"),
        (["--gravity", "1", "2"], "gravity"),
    ],
)
def test_bad_options_end_with_status_2(
    options: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_script("helix_tube", [*options, "--no-plots"]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert run_script("helix_tube", ["--no-plots", "--sections", "8", "--output", str(tmp_path)]) == 2
    assert "not empty" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
