"""The tables of the guide of the helical tube are what the code computes."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import softrobots as sr
from softrobots import helix
from tests.conftest import CHECKOUT

pytestmark = pytest.mark.system

GUIDE = (CHECKOUT / "docs" / "helix.md").read_text(encoding="utf-8")
DIAMETER = 0.0331


def rows(first_cell: str) -> list[list[str]]:
    """Cells of the rows of the table whose heading starts with a cell."""
    table = re.search(rf"^\| {re.escape(first_cell)} \|.*?\n\|[-|]+\n((?:\|.*\n)+)", GUIDE, flags=re.MULTILINE)
    assert table is not None, first_cell
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.group(1).splitlines()]


def test_the_table_of_contraction_limits_is_current() -> None:
    table = rows("theta")
    assert len(table) == 3
    for angle, exact, simple in table:
        theta = math.radians(float(angle.removesuffix(" deg")))
        assert exact == f"{helix.contraction_limit(theta, DIAMETER):.4f}"
        assert simple == f"{helix.simple_contraction_limit(theta):.4f}"


def test_the_table_of_pattern_errors_is_current() -> None:
    table = rows("spacing")
    assert len(table) == 3
    for spacing, largest, radius, rise in table:
        period = 1e-3 * float(spacing.removesuffix(" mm"))
        turns = float(helix.turns(helix.forward(0.66, math.radians(5.0), DIAMETER), math.radians(5.0), 1.0))
        design = helix.HelixDesign(0.66, math.radians(5.0), DIAMETER, turns)
        error = helix.shape_error(helix.pinch_pattern(design, period))
        assert largest == f"{1e3 * error.largest_aligned:.2f} mm"
        assert radius == f"{1e3 * error.centre_radius_error:.3f} mm"
        assert rise == f"{1e3 * error.turn_height_error:.2f} mm"


def test_the_table_of_grasp_forces_is_current() -> None:
    table = rows("deflection")
    assert len(table) == 3
    for deflection, *forces in table:
        found = helix.grasp_force(
            10e3,
            object_radius=0.020,
            deflection=1e-3 * float(deflection.removesuffix(" mm")),
            turn_height=0.080,
            turns=1.5,
            diameter=DIAMETER,
            gap=0.003,
        )
        expected = (found.unwrapping, found.contact, found.force)
        assert [float(force.removesuffix(" N")) for force in forces] == [pytest.approx(float(f), abs=0.005) for f in expected]


def test_the_angle_from_which_the_tube_folds_is_current() -> None:
    """Beyond 50.65 degrees the limit is -cos 2theta, below it is more."""
    for angle, folds in ((50.64, False), (50.66, True)):
        theta = math.radians(angle)
        limit = float(helix.contraction_limit(theta, DIAMETER))
        assert (abs(limit + math.cos(2.0 * theta)) < 1e-9) == folds


def test_the_table_of_sags_is_current() -> None:
    table = rows("chain")
    assert [row[0] for row in table] == ["sections", "lumped"]
    for chain, *sags in table:
        for count, sag in zip((10, 20), sags, strict=True):
            model = sr.load_model(sr.HelixTube(chain=chain, elastic_sections=count, hinges=count))
            tips = [sr.solve_equilibrium(model, (), gravity=gravity).tip_position for gravity in (None, sr.EARTH_GRAVITY)]
            assert sag == f"{1e3 * np.linalg.norm(tips[1] - tips[0]):.2f} mm"
