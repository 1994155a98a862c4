"""The commands of the closed forms, `softrobots pcc` and `softrobots helix`, and `softrobots bench`."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.cli import bench
from softrobots.cli.main import main
from softrobots.compiled.run.backends import available_backend
from tests.support.tables import each_row

LENGTHS = ("0.50", "0.53", "0.55", "0.54", "0.51", "0.52")
"""Muscle lengths of docs/theory.md 2.3; distance 0.04 m is the default."""
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture
def answer(told):
    """Run the command with --json and return the object that it prints."""

    def run(*words: str) -> dict[str, Any]:
        status, out, err = told(*words, "--json")
        assert (status, err) == (0, "")
        return json.loads(out)

    return run


def words_of(numbers: object) -> list[str]:
    return [repr(float(number)) for number in np.ravel(numbers)]


def numeric(value: object) -> bool:
    entries = np.ravel(np.array(value, dtype=object)).tolist()
    return all(isinstance(entry, int | float) and not isinstance(entry, bool) for entry in entries)


# --- softrobots pcc


@pytest.mark.parametrize(
    ("frame", "tip"),
    [
        ("bending_plane", (0.41771528, -0.30235950, 0.87444230)),
        ("torsion_free", (0.44957382, -0.31544214, 0.84384418)),
    ],
)
def test_pcc_forward_gives_the_reference(frame: str, tip: tuple, answer) -> None:
    found = answer("pcc", "forward", *LENGTHS, "--frame", frame)
    assert found["arc_bending"][0] == pytest.approx(0.726483157, abs=5e-10)  # docs/theory.md 2.3
    assert found["arc_azimuth"][0] == pytest.approx(-0.408637855, abs=5e-10)
    assert np.allclose(found["tip_position"], tip, rtol=0.0, atol=5.1e-9)
    assert np.array(found["muscle_lengths"]).ravel().tolist() == [float(word) for word in LENGTHS]
    assert found["muscle_extension"][0][0] == pytest.approx(0.50 / 0.524 - 1.0, rel=1e-12)
    assert found["frame"] == frame


def test_pcc_tells_a_person_the_same(told) -> None:
    status, out, err = told("pcc", "forward", *LENGTHS)
    assert (status, err) == (0, "")
    assert re.search(r"^1 +0\.526667 +0\.726483 +-0\.408638$", out, re.M)
    assert re.search(r"^1 +0\.500000 \(-4\.6 %\)", out, re.M)
    pose = [[float(word) for word in line.split()] for line in out.splitlines()[-4:]]
    assert np.allclose(np.array(pose)[:3, 3], (0.44957382, -0.31544214, 0.84384418), rtol=0.0, atol=5.1e-7)
    assert max(map(len, out.splitlines())) <= 80


@given(
    st.lists(
        st.tuples(st.floats(0.3, 0.8), st.floats(0.0, 2.0), st.floats(-3.0, 3.0), st.floats(-2.0, 2.0), st.floats(0.02, 0.06)),
        min_size=1,
        max_size=4,
    ),
    st.integers(3, 5),
)
@settings(max_examples=12)
def test_pcc_inverse_and_forward_are_each_others_inverse_and_screw_motions(segments: list, count: int) -> None:
    """The pose of a segment without twist is the exponential of its constant strain: by SciPy."""
    from scipy import linalg

    azimuths = 0.3 + 2.0 * np.pi * np.arange(count) / count
    offsets, distance = ([segment[place] for segment in segments] for place in (3, 4))
    common = ["--azimuths", *words_of(azimuths), "--offsets", *words_of(offsets), "--distance", *words_of(distance)]
    arcs = [word for length, bending, azimuth, *_ in segments for word in ("--arc", *words_of((length, bending, azimuth)))]
    with pytest.MonkeyPatch.context() as patch:
        made = _json_of(patch, ["pcc", "inverse", *arcs, *common])
        back = _json_of(patch, ["pcc", "forward", *words_of(made["muscle_lengths"]), *common])
    pose = np.eye(4)
    for length, bending, azimuth, offset, _ in segments:
        pose[:3, :2] = pose[:3, :2] @ [[math.cos(offset), -math.sin(offset)], [math.sin(offset), math.cos(offset)]]
        x, y = -bending * math.sin(azimuth), bending * math.cos(azimuth)
        pose = pose @ linalg.expm(np.array([[0, 0, y, 0], [0, 0, -x, 0], [-y, x, 0, length], [0, 0, 0, 0]], dtype=float))
    for found in (made, back):
        assert np.allclose(found["transforms"][-1], pose, rtol=0.0, atol=1e-12)
    assert np.allclose(back["arc_bending"], made["arc_bending"], rtol=0.0, atol=1e-13)  # rounding of lengths over distance
    assert np.allclose(back["arc_length"], made["arc_length"], rtol=1e-13)
    for (length, bending, azimuth, _, apart), lengths in zip(segments, made["muscle_lengths"], strict=True):
        assert np.allclose(lengths, length - bending * apart * np.cos(azimuth - azimuths), rtol=0.0, atol=1e-15)  # (20-22)


def _json_of(patch: pytest.MonkeyPatch, words: list[str]) -> dict[str, Any]:
    """What the command prints with --json, where fixtures of a function do not reach."""
    import io

    stream = io.StringIO()
    patch.setattr("sys.stdout", stream)
    assert main([*words, "--json"]) == 0
    return json.loads(stream.getvalue())


def test_pcc_fits_more_than_three_muscles_within_a_tolerance(told) -> None:
    words = ["pcc", "forward", "0.5", "0.52", "0.501", "0.48", "--azimuths", "0", "1.5708", "3.1416", "-1.5708"]
    status, out, err = told(*words)
    assert (status, out) == (2, "")
    assert "those of an arc within 1e-06 m" in err
    status, out, err = told(*words, "--tolerance", "1e-3")
    assert (status, err) == (0, "")
    # around a square the misses of an arc are all the same: a quarter of (l1 - l2 + l3 - l4)
    assert "miss those of the arcs by up to 0.00025" in out


@each_row(
    ("words", "message"),
    [
        (["forward", "0.5", "0.5"], "L must be a multiple of 3 numbers"),
        (["forward", "0.5", "0.5", "-0.5"], "positive"),
        (["forward", "0.5", "0.5", "nan"], "error: L = "),
        (["forward", "0.1", "0.1", "5", "--distance", "0"], "positive"),
        (["forward", *LENGTHS, "--distance", "0.04", "0.04", "0.04"], "one for each of the 2 segments"),
        (["forward", *LENGTHS, "--offsets", "0"], "offsets"),
        (["forward", *LENGTHS, "--rest", "0.5", "0.5", "0.5"], "one for each of the 2 segments"),
        (["forward", *LENGTHS, "--rest", "-1"], "--rest"),
        (["forward", *LENGTHS, "--azimuths", "0", "1"], "at least three"),
        (["forward", *LENGTHS, "--azimuths", "0", "1", "6.283185307179586"], "distinct modulo a turn"),
        (["forward", *LENGTHS, "--tolerance", "-1"], "tolerance"),
        (["inverse", "--arc", "-0.5", "1", "0"], "--arc = [[-0.5, 1.0, 0.0]]: --arc must be"),
        (["inverse", "--arc", "0.5", "-1", "0"], "--arc must"),
        (["inverse", "--arc", "0.5", "1", "inf"], "--arc must"),
        (["inverse", "--arc", "0.01", "3", "0"], "positive lengths"),
    ],
)
def test_pcc_refuses(words: list[str], message: str, told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = told("pcc", *words)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert list(tmp_path.iterdir()) == []


@each_row(
    ("words", "message"),
    [
        (["pcc"], "required: FORM"),
        (["pcc", "sideways"], "invalid choice: 'sideways'"),
        (["pcc", "inverse"], "--arc"),
        (["pcc", "inverse", "--arc", "1", "2"], "expected 3 arguments"),
        (["pcc", "forward", "long"], "invalid float value: 'long'"),
        (["pcc", "forward", "1", "--frame", "world"], "invalid choice: 'world'"),
        (["helix"], "required: FORM"),
        (["helix", "inverse", "--outer-radius", "1", "--inner-radius", "0.5"], "--pitch --turn-height is required"),
        (["helix", "inverse", "--outer-radius", "1", "--pitch", "1"], "--inner-radius"),
        (["helix", "design"], "one of the arguments --antenna --grasp is required"),
        (["helix", "design", "--antenna", "1", "1", "1", "--grasp", "1", "1", "1"], "not allowed with"),
        (["helix", "forward", "--handedness", "both"], "invalid choice: 'both'"),
        (["bench", "--only", "nothing"], "invalid choice: 'nothing'"),
        (["bench", "--rounds", "many"], "invalid int value: 'many'"),
    ],
)
def test_words_that_argparse_refuses(words: list[str], message: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


@pytest.mark.study
def test_plots_are_written_once(told, tmp_path: Path) -> None:
    picture, words = tmp_path / "new" / "picture.png", ("solve", "inflatable_arm")
    status, out, err = told(*words, "--plot", str(picture))
    assert (status, err) == (0, "")
    assert out.endswith(f"\n{picture}: written\n")
    assert picture.read_bytes().startswith(PNG)
    picture.write_bytes(b"mine")
    status, out, err = told(*words, "--plot", str(picture))
    assert (status, out) == (2, "")
    assert "exists; choose another name or allow overwriting" in err
    assert picture.read_bytes() == b"mine"


def test_plots_replace_a_file_if_told_and_say_what_is_missing(answer, told, tmp_path: Path, monkeypatch) -> None:
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"mine")
    words = ["solve", "inflatable_arm", "--overwrite", "--plot", str(picture)]
    assert answer(*words)["files"] == [str(picture)]
    assert picture.read_bytes().startswith(PNG)
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    status, out, err = told(*words)
    assert (status, out) == (2, "")
    assert "pip install 'softrobots[plot]'" in err


# --- softrobots helix


def test_helix_forward_gives_the_reference(answer) -> None:
    """docs/theory.md 3: 5 degrees, 0.66, 33.1 mm, which are the defaults."""
    found = answer("helix", "forward")
    assert found["angle"] == pytest.approx(math.radians(5.0), rel=1e-15)
    assert found["outer_radius"] == pytest.approx(0.0854078008, abs=5e-11)
    assert found["inner_radius"] == pytest.approx(0.0523078008, abs=5e-11)
    assert found["pitch"] == pytest.approx(0.0279647090, abs=5e-11)
    assert found["centre_curvature"] == pytest.approx(12.466512, abs=5e-7)
    assert found["centre_torsion"] == pytest.approx(5.062932, abs=5e-7)
    assert found["material_twist"] == pytest.approx(-1.0834, abs=5e-5)
    assert found["centre_length"] / found["length"] == pytest.approx(0.830133, abs=5e-7)
    assert found["contraction_limit"] == pytest.approx(0.3739, abs=5e-5)
    assert found["touches"] is False
    outer = 2.0 * math.pi * math.hypot(found["outer_radius"], found["pitch"])  # a turn of the line that keeps its length
    assert found["turns"] == pytest.approx(found["length"] / (math.cos(found["angle"]) * outer), rel=1e-12)
    assert found["height"] == pytest.approx(found["turns"] * 2.0 * math.pi * found["pitch"], rel=1e-12)
    left = answer("helix", "forward", "--handedness", "left")
    assert left["centre_torsion"] == -found["centre_torsion"]
    assert left["centre_curvature"] == found["centre_curvature"]


def test_helix_tells_a_person_the_same(told) -> None:
    status, out, err = told("helix", "forward", "--pressure", "2e4")
    assert (status, err) == (0, "")
    assert re.search(r"^outer radius of the helix +0\.0854078 m$", out, re.M)
    assert re.search(r"^pitch +0\.0279647 m/rad$", out, re.M)
    assert re.search(r"^runs into itself +no$", out, re.M)
    assert re.search(r"^turns +2\.66658$", out, re.M)


def test_helix_tension_is_the_work_of_the_pressure(answer) -> None:
    """T = P dV/dLa by central differences over the contraction, La = contraction times length / cos(angle)."""
    step = 1e-5
    volumes = [answer("helix", "forward", "--contraction", repr(0.66 + sign * step))["volume"] for sign in (1.0, -1.0)]
    way = 2.0 * step * 1.5 / math.cos(math.radians(5.0))
    expected = 1e4 * (volumes[0] - volumes[1]) / way
    assert answer("helix", "forward")["actuator_tension"] == pytest.approx(expected, rel=1e-8)  # second order in the step


@pytest.mark.parametrize("rise", ["--pitch", "--turn-height"])
def test_helix_inverse_finds_the_actuator(rise: str, answer) -> None:
    shape = ["--outer-radius", "0.0854078008", "--inner-radius", "0.0523078008"]
    height = 0.0279647090 * (2.0 * math.pi if rise == "--turn-height" else 1.0)
    found = answer("helix", "inverse", *shape, rise, repr(height))
    # ten digits of the shape; the angle is more sensitive
    assert found["contraction"] == pytest.approx(0.66, abs=1e-8)
    assert found["angle"] == pytest.approx(math.radians(5.0), abs=1e-8)
    assert found["diameter"] == pytest.approx(0.0331, abs=1e-12)


@pytest.mark.parametrize("turns", [1.0, 0.5])
def test_helix_measure_finds_shape_and_actuator(turns: float, answer) -> None:
    """Arcs of a path of radius R are 2 pi sqrt(R^2 + b^2) a turn."""
    outer, inner = (turns * 2.0 * math.pi * math.hypot(radius, 0.0279647090) for radius in (0.0854078008, 0.0523078008))
    found = answer("helix", "measure", "--outer-arc", repr(outer), "--inner-arc", repr(inner), "--turns", repr(turns))
    assert found["outer_radius"] == pytest.approx(0.0854078008, abs=1e-10)
    assert found["pitch"] == pytest.approx(0.0279647090, abs=1e-9)
    assert found["contraction"] == pytest.approx(0.66, abs=1e-8)


def test_helix_design_of_an_antenna_is_written_and_makes_it(answer, told, tmp_path: Path) -> None:
    files = {"-o": tmp_path / "antenna.json", "--template": tmp_path / "antenna.svg"}
    words = [word for name, path in files.items() for word in (name, str(path))]
    wish = ["helix", "design", "--antenna", "0.07", "0.18", "3", "--handedness", "left"]
    found = answer(*wish, *words)
    assert found["centre_radius"] == pytest.approx(0.07, rel=1e-12)
    assert found["height"] == pytest.approx(0.54, rel=1e-12)
    assert (found["radius_deviation"], found["turn_height_deviation"]) == (0.0, 0.0)
    # what it says of the actuator makes that helix
    again = answer("helix", "forward", *("--contraction", repr(found["contraction"])), "--angle", repr(found["angle"]))
    assert again["centre_radius"] == pytest.approx(0.07, rel=1e-12)
    assert again["turn_height"] == pytest.approx(0.18, rel=1e-12)
    design = sr.load_result(files["-o"])
    assert (design.handedness, design.turns) == ("left", 3.0)
    assert design.tube_length == found["length"]
    assert ElementTree.parse(files["--template"]).getroot().get("width", "").endswith("mm")
    assert found["files"] == [str(files["-o"]), str(files["--template"])]
    assert found["pinches"] * found["spacing"] == pytest.approx(found["length"] / math.cos(found["angle"]), rel=1e-12)
    for name in files:
        status, out, err = told(*wish, name, str(files[name]))
        assert (status, out) == (2, "")
        assert "exists; choose another name" in err


def test_helix_design_of_a_grasp_and_the_nearest_that_can_be_made(answer, told) -> None:
    held = answer("helix", "design", "--grasp", "0.02", "0.08", "1.5", "--squeeze", "0.002")
    assert held["inner_radius"] == pytest.approx(0.018, rel=1e-12)
    assert held["turn_height"] == pytest.approx(0.08, rel=1e-12)
    wish = ["helix", "design", "--antenna", "0.07", "0.01", "1.5"]
    status, out, err = told(*wish)
    assert (status, out) == (2, "")
    assert "runs into itself" in err
    assert "--nearest takes" in err
    found = answer(*wish, "--nearest")
    assert found["touches"] is False
    assert found["turn_height"] > 0.03  # about a diameter of 33.1 mm, where the wish is 10 mm
    assert found["turn_height_deviation"] == pytest.approx(found["turn_height"] - 0.01, abs=1e-12)


def test_helix_tells_the_contraction_at_which_it_touches_itself(answer) -> None:
    for angle, limit in zip(words_of(np.radians((2.5, 5.0, 10.0))), (0.4882, 0.3739, 0.2689), strict=True):
        exact = answer("helix", "forward", "--angle", angle)["contraction_limit"]
        assert exact == pytest.approx(limit, abs=5.1e-5)
        sides = [answer("helix", "forward", "--angle", angle, "--contraction", repr(exact + off)) for off in (1e-6, -1e-6)]
        assert [side["touches"] for side in sides] == [False, True]


@each_row(
    ("words", "message"),
    [
        (["forward", "--contraction", "1.2"], "contraction"),
        (["forward", "--contraction", "0"], "contraction"),
        (["forward", "--contraction", "1", "--angle", "0"], "straight"),
        (["forward", "--angle", "1.6"], "[0, pi/2) rad"),
        (["forward", "--angle", "-0.1"], "[0, pi/2) rad"),
        (["forward", "--diameter", "nan"], "diameter"),
        (["forward", "--length", "0"], "length"),
        (["forward", "--pressure", "-1"], "pressure"),
        (["inverse", "--outer-radius", "0.05", "--inner-radius", "0.06", "--pitch", "0.02"], "--inner-radius must"),
        (["inverse", "--outer-radius", "0.05", "--inner-radius", "0.02", "--pitch", "-0.02"], "pitch"),
        (["inverse", "--outer-radius", "0.05", "--inner-radius", "0.02", "--turn-height", "inf"], "pitch"),
        (["measure", "--outer-arc", "0.3", "--inner-arc", "0.4"], "at most the outer arc"),
        (["measure", "--outer-arc", "0.56", "--inner-arc", "0.37", "--turns", "0"], "turns"),
        (["measure", "--outer-arc", "5", "--inner-arc", "0.1"], "--outer-arc must"),
        (["design", "--antenna", "-1", "0.18", "3"], "radius"),
        (["design", "--antenna", "0.07", "0.18", "0"], "turns"),
        (["design", "--antenna", "0.07", "0.18", "3", "--squeeze", "0.001"], "--squeeze must be left out without --grasp"),
        (["design", "--grasp", "0.02", "0.08", "1", "--squeeze", "0.03"], "less than the radius of the object"),
        (["design", "--antenna", "0.07", "0.18", "3", "--template", "a.svg", "--spacing", "0"], "spacing"),
    ],
)
def test_helix_refuses(words: list[str], message: str, told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = told("helix", *words)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert message in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words",
    [
        ["pcc", "forward", *LENGTHS],
        ["helix", "forward"],
        ["helix", "forward", "--contraction", "1"],  # a straight tube has no neighbouring turns
        ["helix", "design", "--antenna", "0.07", "0.18", "3"],
    ],
)
def test_every_number_in_json_has_a_unit(words: list[str], answer) -> None:
    found = answer(*words)
    units = found.pop("units")
    assert found.pop("files", []) == []
    assert set(units) == {name for name, value in found.items() if numeric(value)}
    assert all(units.values())


def test_defaults_are_those_of_the_robots(answer) -> None:
    found, tube = answer("helix", "forward"), sr.HelixTube()
    assert [found[name] for name in ("contraction", "angle", "diameter", "length", "handedness", "pressure")] == [
        getattr(tube, name) for name in ("contraction", "angle", "diameter", "length", "handedness", "pressure")
    ]
    assert found["turns"] == pytest.approx(tube.turns, rel=1e-15)
    arm = sr.PccArm()
    model = sr.load_model(arm)
    bent = sr.solve_equilibrium(model, [float(word) for word in LENGTHS])  # weightless: arcs of constant curvature
    found = answer("pcc", "forward", *LENGTHS)
    assert np.allclose(found["tip_position"], bent.tip_position, rtol=0.0, atol=1e-9)


# --- softrobots bench


@pytest.mark.study
def test_bench_times_every_job(told) -> None:
    words = ["bench", "--quick", "--rounds", "2"]
    status, out, err = told(*words, "--json")
    assert status == 0
    assert "/5 [" in err  # a progress bar
    results = json.loads(out)
    assert results["machine"]["softrobots"] == sr.__version__
    assert results["machine"]["backend"] == available_backend()
    assert [row["job"] for row in results["rows"]] == list(bench.JOBS)
    for row in results["rows"]:
        assert row["compiled_seconds"] > 0.0
        assert row["pinocchio_seconds"] > 0.0
        assert row["low"] <= row["ratio"] <= row["high"]
    status, out, _ = told(*words, "--only", "batch", "gravity")
    assert status == 0
    assert re.findall(r"^([a-z]+) +\S+ +\S+ +\S+ \(\S+ to \S+\)$", out, re.M) == ["gravity", "batch"]


@pytest.mark.study
def test_bench_solves_the_same_cases_twice() -> None:
    """Every job, compiled and on Pinocchio: springs, loads and motors agree."""
    model = sr.load_model(sr.InflatableArm())
    jobs = bench.prepare_jobs(model, sr.compile(model), 4)
    assert tuple(jobs) == bench.JOBS
    for name, job in jobs.items():
        compiled, pinocchio = job.compiled(), job.pinocchio()
        attribute = {"estimation": "force", "trajectory": "q_motors"}.get(name, "q_springs")
        pair = [
            getattr(rows, attribute) if hasattr(rows, attribute) else [getattr(row, attribute) for row in rows]
            for rows in (compiled, pinocchio)
        ]
        assert len(pair[0]) == job.cases == 4
        assert np.allclose(*pair, rtol=0.0, atol=1e-6), name


def test_bench_takes_each_ratio_within_its_round(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that slows down from round to round does not change the ratio."""
    seconds = {"compiled": iter([1.0, 1e-3, 2e-3, 9e-3]), "pinocchio": iter([1.0, 4e-3, 8e-3, 36e-3])}  # the first: how often
    monkeypatch.setattr(bench, "_cpu_seconds", lambda solve, repeats: next(seconds[solve()]))
    row = bench.measure("batch", bench.Job(10, lambda: "compiled", lambda: "pinocchio"), 3)
    assert row == bench.Row("batch", 2e-4, 8e-4, pytest.approx(4.0), pytest.approx(4.0), pytest.approx(4.0))


def test_bench_refuses_no_rounds(told, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "measure", None)  # nothing is measured before
    status, out, err = told("bench", "--rounds", "0")
    assert (status, out) == (2, "")
    assert "--rounds must be at least 1" in err


def test_bench_help_names_the_jobs_and_the_other_benchmark(capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        main(["bench", "--help"])
    help_text = " ".join(capsys.readouterr().out.split())
    assert "scripts/benchmark.py" in help_text
    assert all(job in help_text for job in bench.JOBS)
