"""The atlas of helices: files, numbers in them against closed forms, refusals, and what its pictures show."""

from __future__ import annotations

import csv
import importlib.util
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softrobots import helix
from softrobots.core.errors import ParameterError, StraightTube
from studies.papers import helices
from studies.papers.grasp_picture import grasp
from studies.papers.helix_sheet import draw
from tests.conftest import missing
from tests.support.figures import READABLE, smallest_text
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

PICTURES = {"helix_grid.png", "helix_shapes.png", "helix_grasp.png"}
TABLES = {"shapes.csv", "contraction_limits.csv", "grasp_forces.csv"}
D = 0.0331
ANGLES = np.radians([2.5, 5.0, 10.0])


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if importlib.util.find_spec("matplotlib") is None:
        missing("matplotlib is not installed")
    made = tmp_path_factory.mktemp("atlas") / "out"
    assert run_script("helix_atlas", ["--output", str(made)]) == 0
    return made


# --- Files


def test_pictures_and_tables_are_written(folder: Path) -> None:
    from PIL import Image

    assert {path.name for path in folder.iterdir()} == PICTURES | TABLES
    for name in PICTURES:
        assert (folder / name).stat().st_size < 300_000
        picture = np.asarray(Image.open(folder / name).convert("L"))
        assert min(picture.shape) > 500
        assert 0.005 < np.mean(picture < 200) < 0.5  # drawn, and not all over


def test_shapes_are_those_of_the_papers_formulas(folder: Path) -> None:
    """(12) written out; the grid first, then one helix in two sizes, whose numbers docs/theory.md prints."""
    rows = rows_of(folder / "shapes.csv")
    assert len(rows) == 17
    for row in rows:
        angle, share, size = (float(row[name]) for name in ("angle [rad]", "contraction [-]", "diameter [m]"))
        below = 1.0 + share**2 - 2.0 * share * math.cos(2.0 * angle)
        # Two digits cancel in `below` at contraction 0.9.
        assert float(row["outer_radius [m]"]) == pytest.approx(size * (1 - share * math.cos(2 * angle)) / below, rel=1e-13)
        assert float(row["pitch [m/rad]"]) == pytest.approx(size * share * math.sin(2 * angle) / below, rel=1e-13)
        assert (row["realisable"], row["realisable_by_simple_rule"]) == ("true", "true")  # limits are below 0.5
    grid = {(round(math.degrees(float(row["angle [rad]"])), 9), float(row["contraction [-]"])) for row in rows[:15]}
    assert grid == {(angle, share) for angle in (2.5, 5.0, 10.0) for share in (0.5, 0.6, 0.7, 0.8, 0.9)}
    printed = {"outer_radius [m]": 0.0854078008, "inner_radius [m]": 0.0523078008, "pitch [m/rad]": 0.0279647090}
    for name, number in printed.items():
        assert float(rows[15][name]) == pytest.approx(number, abs=5e-11)  # printed digits
        assert float(rows[16][name]) == pytest.approx(2.5 * number, abs=1.25e-10)


def test_contraction_limits_are_those_of_theory(folder: Path) -> None:
    rows = rows_of(folder / "contraction_limits.csv")
    assert [float(row["angle [rad]"]) for row in rows] == pytest.approx(ANGLES, rel=1e-15)
    exact = [float(row["contraction_limit [-]"]) for row in rows]
    simple = [float(row["simple_contraction_limit [-]"]) for row in rows]
    assert exact == pytest.approx([0.4882, 0.3739, 0.2689], abs=5e-5)  # printed digits
    assert simple == pytest.approx([0.4871, 0.3719, 0.2658], abs=5e-5)


def test_grasp_forces_are_those_of_theory(folder: Path) -> None:
    rows = rows_of(folder / "grasp_forces.csv")
    assert len(rows) == 18
    last = [row for row in rows if float(row["pressure [Pa]"]) == 10e3]
    assert [float(row["deflection [m]"]) for row in last] == [0.0, 0.002, 0.004]
    assert [float(row["unwrapping [N]"]) for row in last] == pytest.approx([11.19] * 3, abs=5e-3)  # printed digits
    assert [float(row["contact [N]"]) for row in last] == pytest.approx([8.15, 13.89, 17.37], abs=5e-3)
    for row in rows:
        share = float(row["pressure [Pa]"]) / 10e3
        full = next(other for other in last if other["deflection [m]"] == row["deflection [m]"])
        assert float(row["force [N]"]) == pytest.approx(share * float(full["force [N]"]), rel=1e-14)  # linear in the pressure
        assert float(row["force [N]"]) == min(float(row["unwrapping [N]"]), float(row["contact [N]"]))


# --- The command line


def test_tables_are_printed_too(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    assert run_script("helix_atlas", ["--no-plots", "--output", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == TABLES
    out = capsys.readouterr().out
    assert "| 2.5 | 0.5 | 0.03310 | 0.06546 | 0.03236 | 0.00568 | 0.03547 | yes | yes |" in out
    assert "| 5 | 0.66 | 0.03310 | 0.08541 | 0.05231 | 0.02796 |" in out
    assert out.count("| none |") == 8
    assert "| 2.5 | 0.4882 | 0.4871 |" in out
    assert "| 4 | 11.19 | 17.37 | 11.19 |" in out
    assert "our model, not data of the paper" in out
    assert str(folder) in out


def test_options_change_what_is_tabulated(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = tmp_path / "out"
    options = ["--angles", "5", "--contractions", "0.3", "0.6", "--diameter", "0.05", "--pressure", "2000", "--turns", "1"]
    grasped = ["--deflections", "0.001", "--object-radius", "0.03", "--rise", "0.1", "--gap", "0"]
    assert run_script("helix_atlas", [*options, *grasped, "--no-plots", "--output", str(folder)]) == 0
    rows = rows_of(folder / "shapes.csv")
    assert [(row["contraction [-]"], row["realisable"]) for row in rows] == [("0.3", "false"), ("0.6", "true")]
    assert {row["diameter [m]"] for row in rows} == {"0.05"}
    forces = rows_of(folder / "grasp_forces.csv")
    assert [float(row["pressure [Pa]"]) for row in forces] == [0.0, 400.0, 800.0, 1200.0, 1600.0, 2000.0]
    # Contact bound by hand: 2 N P w sqrt(R^2 + b^2), w = 2 sqrt(delta (D - delta)).
    by_hand = 2 * 2000.0 * 2 * math.sqrt(0.001 * 0.049) * math.hypot(0.03, 0.1 / (2 * math.pi))
    assert float(forces[-1]["contact [N]"]) == pytest.approx(by_hand, rel=1e-14)
    assert "at 2 kPa" in capsys.readouterr().out


def test_pictures_of_the_guide_are_replaced(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "helix_grid.png").write_bytes(b"old")
    (tmp_path / "other.png").write_bytes(b"mine")
    assert run_script("helix_atlas", ["--docs", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"helix_grid.png", "helix_shapes.png", "other.png"}
    assert (tmp_path / "helix_grid.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "other.png").read_bytes() == b"mine"
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_a_folder_that_is_not_empty_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run_script("helix_atlas", ["--output", str(folder), "--no-plots"]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
    assert run_script("helix_atlas", ["--output", str(tmp_path / "mine.txt"), "--no-plots"]) == 2
    assert "mine.txt is a file" in capsys.readouterr().err
    assert run_script("helix_atlas", ["--docs", str(tmp_path / "mine.txt")]) == 2
    assert "cannot create the folder" in capsys.readouterr().err
    assert [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()] == ["keep"]


@each_row(
    ("arguments", "message"),
    [
        (["--contractions", "0"], "contraction"),
        (["--contractions", "0.5", "1.2"], "contraction"),
        (["--contractions", "nan"], "contraction"),
        (["--angles", "90"], "angle"),
        (["--angles", "-5"], "angle"),
        (["--angles", "0", "--contractions", "1"], "straight"),
        (["--angles", "1", "2", "3", "4"], "up to 3 angles"),
        (["--angles", "0"], "above 0"),
        (["--angles", "50"], "at most pi/4"),
        (["--diameter", "0"], "diameter"),
        (["--length", "-1"], "length"),
        (["--length", "4"], "at most 100 diameters"),
        (["--contractions", *["0.5"] * 21], "at most 60 helices"),
        (["--pressure", "0"], "pressure"),
        (["--pressure", "-1"], "pressure"),
        (["--object-radius", "0"], "object_radius"),
        (["--deflections", "0.02"], "deflection"),
        (["--deflections", *["0.001"] * 7], "from one to 6 numbers"),
        (["--rise", "0.01"], "turn_height"),
        (["--turns", "0"], "turns"),
        (["--docs"], "given without --output"),
    ],
)
def test_bad_input_is_refused_and_leaves_nothing(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "out"
    assert run_script("helix_atlas", [*arguments, "--output", str(folder)]) == 2
    out, err = capsys.readouterr()
    assert re.search(f"error: .*{message}", err)
    assert out == ""
    assert not folder.exists()


# --- What the pictures show, read back from the figures


def test_tubes_of_the_grid_have_one_scale() -> None:
    """Widths and heights on the sheet against extents from the points: seen 25 degrees from above, and the bar of the scale."""
    contractions, length = (0.9, 0.6), 0.7
    figure = helices.grid(contractions, ANGLES, D, length)
    (axes,) = figure.axes
    bar = axes.lines[0].get_xdata()
    told = next(text.get_text() for text in axes.texts if re.fullmatch(r"[\d.]+ cm", text.get_text()))
    scale = (bar[1] - bar[0]) / (0.01 * float(told.split()[0]))
    # One inch of the sheet is one inch of the picture, both ways.
    assert (axes.get_xlim()[1], axes.get_ylim()[1]) == pytest.approx(tuple(figure.get_size_inches()), rel=1e-12)
    assert len(axes.collections) == 6
    for place, painted in enumerate(axes.collections):
        angle, share = ANGLES[place // 2], contractions[place % 2]
        shape = helix.forward(share, angle, D)
        turns = float(helix.turns(shape, angle, length))
        centre = helix.points(shape, np.linspace(-np.pi * turns, np.pi * turns, 2000))
        tilt = math.radians(25.0)
        across, up = -centre[:, 1], math.cos(tilt) * centre[:, 2] - math.sin(tilt) * centre[:, 0]
        corners = np.concatenate([path.vertices for path in painted.get_paths()])
        # A ball of the tube's radius about each point reaches as far as the tube or, at its flat ends, farther.
        for line, seen in ((across, corners[:, 0]), (up, corners[:, 1])):
            assert np.ptp(line) - 1e-9 <= np.ptp(seen) / scale <= np.ptp(line) + D + 1e-9
        assert np.ptp(corners, axis=0).max() / scale > max(np.ptp(across), np.ptp(up)) + 0.3 * D


def test_front_of_the_tube_hides_its_back() -> None:
    """Triangles are painted from far to near, and only those that face the viewer: of a straight tube a half."""
    tube = draw(1.0, math.radians(20.0), D, 0.3, "right")
    assert tube.size == pytest.approx([D, 0.3 * math.cos(math.radians(25)) + D * math.sin(math.radians(25))], rel=0.01)
    (x1, y1), (x2, y2) = (tube.faces[:, corner].T - tube.faces[:, 0].T for corner in (1, 2))
    doubled = x1 * y2 - x2 * y1
    assert np.all(doubled > 0.0)  # anticlockwise on the screen
    # Their areas make up the outline: a rectangle and, at the top, an ellipse.
    outline = D * 0.3 * math.cos(math.radians(25)) + math.pi / 4 * D**2 * math.sin(math.radians(25))
    assert 0.5 * np.sum(doubled) == pytest.approx(outline, rel=0.02)  # of 24 sides


@pytest.mark.parametrize(("handedness", "sign"), [("right", 1.0), ("left", -1.0)])
def test_the_drawn_helix_winds_the_right_way(handedness: str, sign: float) -> None:
    """In front, a right-handed helix rises to the right."""
    tube = draw(0.9, math.radians(5.0), D, 0.3, handedness)
    middles = tube.faces.mean(1)
    right = middles[:, 0] > tube.low[0] + 0.5 * tube.size[0]
    assert sign * (middles[right, 1].mean() - middles[~right, 1].mean()) > 0.0


def test_self_contact_is_marked() -> None:
    """At 5 degrees turns touch below 0.3739 (docs/theory.md 3)."""
    figure = helices.grid([0.38, 0.36], [math.radians(5.0)], D, 1.0)
    captions = [text.get_text() for text in figure.axes[0].texts if "turns" in text.get_text()]
    assert ["in contact" in caption for caption in captions] == [False, True]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()][-1] == "in contact: the tube runs into itself"
    free, touching = (painted.get_facecolor()[:, 2].mean() for painted in figure.axes[0].collections)
    assert touching < 0.7 * free  # yellow, not grey
    without = helices.grid([0.38], [math.radians(5.0)], D, 1.0)
    assert len(without.axes[0].get_legend().get_texts()) == 2
    for sheet, title in (
        (figure, "Tubes 3.31 cm thick, 1 m long before they contract, to one scale"),
        (without, "A tube 3.31 cm thick, 1 m long before it contracts"),
    ):
        assert title in [text.get_text() for text in sheet.axes[0].texts]


def test_captions_tell_the_shape() -> None:
    figure = helices.grid([0.66], [math.radians(5.0)], D, 1.0)
    caption = next(text.get_text() for text in figure.axes[0].texts if "turns" in text.get_text())
    assert caption.startswith("$R_o$ = 8.54 cm\n$b$ = 2.8 cm/rad\n")  # docs/theory.md 3: 0.0854078008, 0.0279647090 m
    turns = 1.0 / (math.cos(math.radians(5.0)) * 2 * math.pi * math.hypot(0.0854078008, 0.0279647090))
    assert caption.endswith(f"{turns:.2f} turns")
    assert smallest_text(figure) >= READABLE
    assert smallest_text(helices.grid([0.9, 0.7, 0.5, 0.38, 0.36], ANGLES, D, 1.0)) >= READABLE


def test_radius_and_pitch_run_from_start_to_end_and_change_style_at_contact() -> None:
    figure = helices.radius_and_pitch(ANGLES, D)
    radius, pitch, close = figure.axes
    limits = [0.4882, 0.3739, 0.2689]  # docs/theory.md 3
    for axes in (radius, pitch, close):
        solid = [line for line in axes.lines if line.get_linewidth() == 2.2]
        dotted = [line for line in axes.lines if line.get_linewidth() == 1.2]
        assert [line.get_xdata()[0] for line in solid] == pytest.approx(limits, abs=5e-5)  # printed digits
        assert [line.get_xdata()[-1] for line in dotted] == pytest.approx(limits, abs=5e-5)
        assert len({line.get_linestyle() for line in solid}) == 3
    # The paper: Ro starts at D/2 and ends at D; b starts at D/(2 tan theta) and ends at 0.
    for axes, starts, end in ((radius, [50 * D] * 3, 100 * D), (pitch, 50 * D / np.tan(ANGLES), 0.0)):
        ends = [line for line in axes.lines if line.get_marker() == "o"]
        assert [line.get_ydata()[0] for line in ends] == pytest.approx(starts, rel=1e-12)
        assert [line.get_ydata()[1] for line in ends] == pytest.approx([end] * 3, abs=1e-12)
        assert all(line.get_xdata().tolist() == [1.0, 0.0] for line in map(_as_arrays, ends))
    for axes in (pitch, close):
        crosses = [line for line in axes.lines if line.get_marker() == "x"]
        assert [line.get_ydata()[0] for line in crosses] == pytest.approx([100 * D / (2 * math.pi)] * 3, rel=1e-12)
        assert [line.get_xdata()[0] for line in crosses] == pytest.approx([0.4871, 0.3719, 0.2658], abs=5e-5)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["outer radius $R_o$ [cm]", "normalised pitch $b$ [cm/rad]", "$b$ [cm/rad]"]
    (legend,) = figure.legends
    assert "simple rule: 0.4871" in legend.get_texts()[0].get_text()


def _as_arrays(line: Any) -> Any:
    line.set_data(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))
    return line


def test_grasp_says_that_it_is_a_model() -> None:
    figure = grasp()
    left, right = figure.axes
    assert "our model, not data of the paper" in figure.get_suptitle()
    forces = [line for line in left.lines if str(line.get_label()).startswith("force")]
    assert [line.get_label() for line in forces] == [f"force, deflected by {mm} mm" for mm in (0, 2, 4)]
    assert [line.get_ydata()[-1] for line in forces] == pytest.approx([8.15, 11.19, 11.19], abs=5e-3)  # docs/theory.md 3
    assert len({line.get_marker() for line in forces}) == 3
    bounds = {line.get_label(): line.get_ydata() for line in right.lines}
    assert np.array_equal(
        bounds["force, the smaller bound"],
        np.minimum(bounds["bound (a): the tube unwraps"], bounds["bound (b): the wall flattens"]),
    )
    assert left.get_xlabel() == "gauge pressure [kPa]"
    assert left.get_ylabel() == "grasp force [N]"


NAN = float("nan")


@each_row(
    ("call", "field"),
    [
        (lambda: helices.grid([], ANGLES, D, 1.0), "contractions"),
        (lambda: helices.grid(0.5, ANGLES, D, 1.0), "contractions"),
        (lambda: helices.grid([0.5, NAN], ANGLES, D, 1.0), "contractions"),
        (lambda: helices.grid([0.5, 0.0], ANGLES, D, 1.0), "contraction"),
        (lambda: helices.grid([0.5] * 21, ANGLES, D, 1.0), "contractions"),
        (lambda: helices.grid([0.5], [], D, 1.0), "angles"),
        (lambda: helices.grid([0.5], [np.pi / 2], D, 1.0), "angle"),
        (lambda: helices.grid([0.5], ANGLES, 0.0, 1.0), "diameter"),
        (lambda: helices.grid([0.5], ANGLES, D, 0.0), "length"),
        (lambda: helices.grid([0.5], ANGLES, D, 101 * D), "length"),
        (lambda: helices.grid([0.99], [1.55], D, 100 * D), "length"),  # 4850 windings
        (lambda: helices.grid([0.5], ANGLES, D, 1.0, "up"), "handedness"),
        (lambda: helices.radius_and_pitch([], D), "angles"),
        (lambda: helices.radius_and_pitch([0.0, 0.1], D), "angles"),
        (lambda: helices.radius_and_pitch([0.8], D), "angles"),
        (lambda: helices.radius_and_pitch([0.1, 0.2, 0.3, 0.4], D), "angles"),
        (lambda: helices.radius_and_pitch([0.1], -D), "diameter"),
        (lambda: grasp((0.02, 0.08, 1.5, (0.0,), D)), "test"),
        (lambda: grasp(pressure=0.0), "pressure"),
        (lambda: grasp(helix.PAPER_CYLINDER._replace(deflections=())), "deflections"),
        (lambda: grasp(helix.PAPER_CYLINDER._replace(deflections=(0.001,) * 7)), "deflections"),
        (lambda: grasp(helix.PAPER_CYLINDER._replace(deflections=(0.02,))), "deflection"),
        (lambda: grasp(helix.PAPER_CYLINDER._replace(diameter="thick")), "diameter"),
        (lambda: grasp(helix.PAPER_CYLINDER._replace(object_radius=NAN)), "object_radius"),
    ],
)
def test_figures_refuse_bad_input(call: Callable[[], Any], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        call()
    assert caught.value.field == field


def test_the_straight_tube_is_refused() -> None:
    with pytest.raises(StraightTube):
        helices.grid([0.5, 1.0], [0.0, 0.1], D, 1.0)
