"""The curves of the papers' figures as tables (CSV), full precision."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softrobots import helix, inflated_beam
from softrobots.core.files import csv_text, write_text
from softrobots.core.result_file import save_csv
from softrobots.inflated_beam import TABLE_3
from studies.papers.arm_path import movement
from studies.papers.helix_grid import PAPER_ANGLES, PAPER_DIAMETER, paper_grid


def write_curves(name: str, folder: Path) -> list[Path]:
    """Write the curves of a paper into a folder.

    Args:
        name: The paper, of `studies.papers.PAPERS`.
        folder: The folder, which exists.

    Returns:
        The files; none of a paper without curves.

    Raises:
        OutputExists: If a file exists.
        OutputError: If one cannot be written.
    """
    if name == "inflatable_arm":
        return [
            write_text(folder / "arm_law.csv", _moment_angle_law(), overwrite=False),
            save_csv(movement().loaded, folder / "arm_path_loaded.csv"),
            save_csv(movement().rigid, folder / "arm_path_rigid.csv"),
        ]
    if name == "helical_actuation":
        return [
            paper_grid().write_csv(folder / "helix_grid.csv"),
            write_text(folder / "helix_curves.csv", _radius_and_pitch(), overwrite=False),
            write_text(folder / "helix_grasp.csv", _grasp(), overwrite=False),
        ]
    return []


def _moment_angle_law() -> str:
    """[Troise 2021] Figure 9: moment over angle, one column a pressure with a largest moment."""
    rows = [row for row in TABLE_3 if row.max_moment is not None]
    angle = np.linspace(0.0, 0.16, 161)
    columns = [
        inflated_beam.moment(angle, stiffness=row.stiffness, max_moment=row.max_moment) for row in rows if row.max_moment
    ]
    names = ["angle [rad]", *(f"moment at {row.pressure / 1e3:g} kPa [N m]" for row in rows)]
    return csv_text(names, np.column_stack([angle, *columns]).tolist())


def _radius_and_pitch() -> str:
    """[Blumenschein 2018] Figure 7: outer radius and pitch over contraction, two columns an angle."""
    share = np.linspace(0.01, 1.0, 100)
    names, columns = ["contraction [-]"], [share]
    for angle in PAPER_ANGLES:
        shape = helix.forward(share, angle, PAPER_DIAMETER)
        names += [f"{name} at {np.degrees(angle):.4g} degrees [{unit}]" for name, unit in (("Ro", "m"), ("b", "m/rad"))]
        columns += [shape.outer_radius, shape.pitch]
    return csv_text(names, np.column_stack(columns).tolist())


def _grasp() -> str:
    """[Blumenschein 2018] Figure 9, our model: force over pressure, one column a deflection."""
    test, pressure = helix.PAPER_CYLINDER, np.linspace(0.0, 10e3, 11)
    found = test.force(pressure[:, None])
    names = ["pressure [Pa]", *(f"force at {1e3 * depth:g} mm [N]" for depth in test.deflections)]
    return csv_text(names, np.column_stack([pressure, found.force]).tolist())
