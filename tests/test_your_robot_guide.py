"""The synthetic measurements of docs/your_robot.md are those that their script makes, and the page tells its truth."""

from __future__ import annotations

import ast
import re
import runpy

import numpy as np

from tests.conftest import CHECKOUT

FOLDER = CHECKOUT / "docs" / "examples" / "your_robot"
SCRIPT = runpy.run_path(str(FOLDER / "measure.py"))
PAGE = (CHECKOUT / "docs" / "your_robot.md").read_text(encoding="utf-8")


def test_the_measurements_are_those_of_the_script() -> None:
    """To the last digit that is written: another machine may round it the other way."""
    committed = (FOLDER / "poses.csv").read_text(encoding="utf-8").splitlines()
    made = SCRIPT["measured_rows"]()
    assert committed[0] == made[0]
    labels, numbers = ([line.split(",", 1)[place] for line in (*committed[1:], *made[1:])] for place in (0, 1))
    assert labels[:60] == labels[60:]
    cells = np.array([line.split(",") for line in numbers], dtype=float)
    np.testing.assert_allclose(cells[:60], cells[60:], atol=0.1001)
    assert len(committed) == 61


def test_the_page_tells_the_truth_of_the_script() -> None:
    told = ast.literal_eval(re.findall(r"^truth = (\(.*\))$", PAGE, flags=re.MULTILINE)[0])
    place = (*SCRIPT["BASE_POSITION"], *SCRIPT["BASE_ROTATION"], *SCRIPT["BALL"])
    assert told == (*SCRIPT["TRUE_ARM"].stiffness, *SCRIPT["MOTOR_OFFSETS"][1:], *place)
