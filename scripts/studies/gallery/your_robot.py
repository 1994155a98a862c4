"""Figures and page of docs/your_robot.md, from its measurements."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.view.figures import experiments, identifications
from softrobots.view.identification_page import IdentificationPage

FOLDER = Path(__file__).resolve().parents[3] / "docs" / "examples" / "your_robot"
"""The measurements and their columns."""
PLACE = ("base.position", "base.rotation", "marker.ball.offset")
"""What places robot and ball, as on the page."""
UNKNOWN = ("link[*].stiffness", "motor[2].offset", "motor[3].offset", *PLACE)
"""What is fitted."""
RULER = {"marker.ball.offset": ((0.015, 0.0, 0.040), 0.001)}
"""What a ruler told [m]."""
ARM = sr.InflatableArm(stiffness=171.76)
"""Where the fit starts."""


@cache
def first_fit() -> tuple[sr.Measurements, sr.Identification]:
    """All rows, and the fit in which outliers count less."""
    rows = sr.Measurements.from_csv(FOLDER / "poses.csv", FOLDER / "columns.yaml")
    return rows, sr.identify(ARM, rows, UNKNOWN, priors=RULER, loss="soft_l1")


@cache
def good_rows() -> sr.Measurements:
    """The rows without the outlier."""
    rows, fit = first_fit()
    return rows[np.setdiff1d(np.arange(len(rows)), fit.outliers)]


@cache
def second_fit(validation: str | None = None) -> sr.Identification:
    """The fit of the good rows."""
    return sr.identify(ARM, good_rows(), UNKNOWN, priors=RULER, validation=validation)


def your_robot_residuals() -> Any:
    """Residuals with the outlier."""
    return identifications.residuals(first_fit()[1])


def your_robot_values() -> Any:
    """Values before and after."""
    return identifications.values(second_fit())


def your_robot_ellipses() -> Any:
    """What is known together."""
    return identifications.ellipses(second_fit())


def your_robot_predicted() -> Any:
    """Predicted over measured, a session kept aside."""
    return identifications.predicted(second_fit("session4_*"))


def your_robot_sets() -> Any:
    """Sets of parameters compared."""
    sets = {
        "place only": PLACE,
        "one stiffness": ("stiffness", *PLACE),
        "one a link": ("link[*].stiffness", *PLACE),
        "and motors": UNKNOWN,
        "and a bend at rest": ("rest_up", *UNKNOWN),
    }
    return experiments.cross_validation(sr.cross_validate(ARM, good_rows(), sets, r"session\d", priors=RULER))


def your_robot_poses() -> Any:
    """Which poses are worth measuring."""
    angles = np.radians(np.stack(np.meshgrid([-60, -20, 20, 60], [-25, 0, 30, 60], [-75, -45, 0, 30]), axis=-1).reshape(-1, 3))
    loads: dict[str, Any] = {"mass": np.ones(64), "gravity": (0, 0, -9.81), "markers": {"ball": "tip"}}
    std = {"positions.ball": 0.8e-3}
    return experiments.informative(sr.informative_poses(second_fit().robot, UNKNOWN, angles, 8, std=std, priors=RULER, **loads))


def measured_poses() -> sr.Viewer:
    """The fitted arm in the measured poses."""
    viewer = IdentificationPage(first_fit()[1], most_rows=60)
    viewer.look_from((0.25, -1.55, 0.75), (0.35, -0.15, 0.2))
    return viewer
