"""Colours of plots and pages stay apart for colour-blind people and in grey, or styles and markers tell what they tell.

The oracle is the published simulation of [Machado 2009] at full severity, and CIE L*a*b*; the project holds neither.
"""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from softrobots.view.appearance import (
    CONTACT_COLOUR,
    FORCE_COLOUR,
    LINE_COLOUR,
    OBSTACLE_COLOUR,
    PATH_COLOUR,
    RIGID_COLOUR,
    TAIL_COLOUR,
    TUBE_COLOUR,
)
from softrobots.view.figures import canvas, workspaces
from softrobots.view.scene import WRINKLING_COLOURS
from softrobots.view.tension_scale import tension_colour
from studies.papers import helix_sheet, trajectory_pictures
from tests.conftest import CHECKOUT

# G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, A physiologically-based model for simulation of color vision deficiency,
# IEEE Trans. Vis. Comput. Graph. 15(6), 2009: severity 1.0, on linear RGB.
SIMULATIONS = {
    "normal": np.eye(3),
    "protanopia": np.array([
        [0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998],
    ]),
    "deuteranopia": np.array([
        [0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881],
    ]),
}  # fmt: skip
TO_XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])

APART = 10.0
"""Distance in CIE L*a*b* that is seen at a glance; 2.3 is just noticeable side by side."""
APART_IN_GREY = 7.0
"""Steps of lightness L*, from 0 to 100, that are told apart as areas."""


def rgb(colour: object) -> np.ndarray:
    """Red, green, blue in [0, 1] of what the package writes: HTML text, a number as in HTML, or a tuple."""
    if isinstance(colour, str):
        colour = int(colour.removeprefix("#"), 16)
    if isinstance(colour, int):
        colour = (colour >> 16 & 255, colour >> 8 & 255, colour & 255)
        return np.array(colour) / 255.0
    return np.array(colour[:3], dtype=float)


def lab(colour: object, simulation: str = "normal") -> np.ndarray:
    """CIE L*a*b* of an sRGB colour under daylight (D65), as someone with a deficiency sees it."""
    value = rgb(colour)
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    seen = np.clip(SIMULATIONS[simulation] @ linear, 0.0, 1.0)
    ratio = (TO_XYZ @ seen) / TO_XYZ.sum(axis=1)
    root = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


def nearest(colours: list[object], simulation: str) -> float:
    return min(float(np.linalg.norm(lab(a, simulation) - lab(b, simulation))) for a, b in combinations(colours, 2))


def lightness(colours: list[object]) -> list[float]:
    return [float(lab(colour)[0]) for colour in colours]


WRINKLING = [colour for _, colour in WRINKLING_COLOURS]
TENSIONS = [tension_colour(share, 1.0) for share in (-1.0, -0.5, -0.01, 0.0, 0.01, 0.5, 1.0)]
PALETTES = {
    "lines": list(canvas.COLOURS),
    "wrinkling": WRINKLING,
    "page of a muscle arm": [*TENSIONS, TUBE_COLOUR, PATH_COLOUR, FORCE_COLOUR, CONTACT_COLOUR, OBSTACLE_COLOUR],
    "page of a leaning arm": [*WRINKLING, RIGID_COLOUR, PATH_COLOUR, FORCE_COLOUR, CONTACT_COLOUR, OBSTACLE_COLOUR],
    "page of a growing tube": [LINE_COLOUR, TUBE_COLOUR, TAIL_COLOUR],
    "maps": list(workspaces.SHADES),
    "helices": [helix_sheet.WALL, helix_sheet.WALL_IN_CONTACT, helix_sheet.ACTUATOR, helix_sheet.OPPOSITE],
}


@pytest.mark.parametrize("simulation", SIMULATIONS)
@pytest.mark.parametrize("palette", PALETTES)
def test_colours_stay_apart(palette: str, simulation: str) -> None:
    assert nearest(PALETTES[palette], simulation) > APART


def test_the_oracle_knows_red_from_green() -> None:
    """Published numbers of CIE L*a*b*, and a pair that people with deuteranopia mix up."""
    assert np.allclose(lab((1.0, 1.0, 1.0)), [100.0, 0.0, 0.0], atol=0.02)  # the matrix has seven digits
    assert np.allclose(lab((1.0, 0.0, 0.0)), [53.24, 80.09, 67.20], atol=0.02)
    mixed = ["#a05000", "#5a7a00"]
    assert nearest(mixed, "normal") > 3 * APART
    assert nearest(mixed, "deuteranopia") < APART


def test_wrinkling_goes_from_light_to_dark() -> None:
    """In grey a link near wrinkling is darker than one that is not, and wrinkled is darkest."""
    steps = -np.diff(lightness(WRINKLING))
    assert steps.min() > APART_IN_GREY


def test_tensions_go_from_light_to_dark() -> None:
    """In grey a stronger pull is darker, and so is a stronger push."""
    for side in (TENSIONS[2::-1], TENSIONS[4:]):
        assert (-np.diff(lightness(side))).min() > APART_IN_GREY


def test_areas_of_maps_and_helices_differ_in_grey() -> None:
    for areas in (PALETTES["maps"], PALETTES["helices"]):
        assert min(b - a for a, b in pairwise(sorted(lightness(areas)))) > APART_IN_GREY


def test_lines_that_look_alike_in_grey_differ_in_style_and_marker() -> None:
    """Six colours cannot be six greys: every line has a style and a marker of its own, over one round of the colours."""
    styles = [canvas.line_style(number) for number in range(len(canvas.COLOURS))]
    alike = [pair for pair in combinations(styles, 2) if abs(lab(pair[0]["color"])[0] - lab(pair[1]["color"])[0]) < 15.0]
    assert alike
    for one, other in alike:
        assert one["ls"] != other["ls"]
        assert one["marker"] != other["marker"]
    assert canvas.line_style(len(canvas.COLOURS)) == styles[0] | {"mfc": "white"}


def test_lines_are_drawn_in_these_styles() -> None:
    """Read back from figures: no two lines of one plot share colour, style and marker."""
    times = np.linspace(0.0, 1.0, 30)
    figure = trajectory_pictures.tip_errors({f"method {number}": np.full(30, 10.0**-number) for number in range(6)}, times)
    drawn = {(line.get_color(), str(line.get_linestyle()), line.get_marker()) for line in figure.axes[0].lines}
    assert len(drawn) == 6
    assert len({marker for _, _, marker in drawn}) == 6


def test_no_figure_is_wider_or_has_smaller_print_than_can_be_read() -> None:
    """Nine points in a figure of seven inches are seven pixels where it is shown 400 pixels wide."""
    assert canvas.SMALL * 400.0 / (72.0 * canvas.WIDTH) >= 7.0
    files = [*Path(canvas.__file__).parent.glob("*.py"), *(CHECKOUT / "scripts").rglob("*.py")]
    files = [file for file in files if file.name not in ("helix_sheet.py", "draw_architecture.py")]  # sheets to scale
    assert len(files) > 100
    for file in files:
        text = file.read_text(encoding="utf-8")
        for size in re.findall(r"(?:font|label)size\"?[=:] ?(\d[\d.]*)", text):
            assert float(size) >= canvas.SMALL, file.name
        for width in re.findall(r"(?:new_(?:figure|plot|space)\(|figsize=)\(\s*(\d[\d.]*)", text):
            assert float(width) <= canvas.WIDTH, file.name
