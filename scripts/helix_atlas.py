"""Plots and tables of helices: shapes by contraction and actuator angle, realisability, and grasp forces.

Without options it covers the tests of [Blumenschein 2018]: tubes of 3.31 cm, actuator angles of 2.5, 5 and 10 degrees,
contractions of 0.9 to 0.5, and a grasped cylinder of 4.0 cm. Writes pictures after its Figures 5, 7 and 9 and tables (CSV) into
a new folder, and prints the tables. Grasp forces are those of our model (see softrobots.helix.grasping), not measurements.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import helix
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import positive_number
from softrobots.core.files import csv_text, make_folder, write_text
from softrobots.view.figures import canvas
from studies.papers import helices, helix_grid
from studies.papers.grasp_picture import grasp
from studies.shared.folders import free_folder

DOCS = Path(__file__).resolve().parent.parent / "docs" / "images"
PICTURES = ("helix_grid", "helix_shapes", "helix_grasp")
"""Names of the pictures; the guide shows the first two."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    test = helix.PAPER_CYLINDER
    angles = [float(f"{degrees:.12g}") for degrees in np.degrees(helix_grid.PAPER_ANGLES)]

    def numbers(option: str, default: Sequence[float], help_text: str) -> None:
        shown = " ".join(f"{number:g}" for number in default)
        options.add_argument(option, type=float, nargs="+", metavar="X", default=list(default), help=f"{help_text} ({shown})")

    numbers("--angles", angles, "of the actuator to the axis of the tube, up to three [degrees]")
    numbers("--contractions", helix_grid.PAPER_CONTRACTIONS[::-1], "contracted over original length of the actuator, in (0, 1]")
    options.add_argument("--diameter", type=float, default=helix_grid.PAPER_DIAMETER, help="of the tube [m] (%(default)s)")
    options.add_argument("--length", type=float, default=1.0, help="of the uninflated tubes in the picture [m] (%(default)s)")
    numbers("--deflections", test.deflections, "radius of the grasped object minus the natural inner radius of the helix [m]")
    options.add_argument("--pressure", type=float, default=10e3, help="largest gauge pressure of the grasp [Pa] (%(default)g)")
    options.add_argument("--object-radius", type=float, default=test.object_radius, help="of the object [m] (%(default)s)")
    options.add_argument("--gap", type=float, default=test.gap, help="between the halves of the object [m] (%(default)s)")
    options.add_argument("--rise", type=float, default=test.turn_height, help="of the grasp per turn [m] (%(default)s)")
    options.add_argument("--turns", type=float, default=test.turns, help="of the grasp (%(default)s)")
    options.add_argument("--output", type=Path, metavar="FOLDER", help="new or empty folder (output/helix_atlas_<time>)")
    options.add_argument("--no-plots", action="store_true", help="leave out the pictures, which need matplotlib")
    help_text = "only write the two pictures of the guide into this folder (docs/images), replacing them"
    options.add_argument("--docs", type=Path, nargs="?", const=DOCS, metavar="FOLDER", help=help_text)
    return options


def run(arguments: argparse.Namespace) -> None:
    """Compute, draw and write all results."""
    if not arguments.no_plots:
        canvas.require_matplotlib()  # raises at once if it is missing
    if arguments.docs is not None and (arguments.output is not None or arguments.no_plots):
        raise sr.ParameterError("--docs", arguments.docs, "given without --output and --no-plots")
    angles, pressure = np.radians(arguments.angles), positive_number("pressure", arguments.pressure, "Pa")
    deflections = tuple(arguments.deflections)
    test = helix.GraspTest(
        arguments.object_radius, arguments.rise, arguments.turns, deflections, arguments.diameter, arguments.gap
    )
    output = arguments.output or Path("output") / f"helix_atlas_{datetime.now():%Y%m%d_%H%M%S}"
    folder = arguments.docs or free_folder(output)
    shapes = shape_table(arguments.contractions, angles, arguments.diameter)
    limits = limit_table(angles)
    forces = force_table(test, pressure)
    figures: list[Any] = []
    if not arguments.no_plots:  # the quick ones first, so that errors appear at once
        lines, forces_of = helices.radius_and_pitch(angles, arguments.diameter), grasp(test, pressure)
        figures = [helices.grid(arguments.contractions, angles, arguments.diameter, arguments.length), lines, forces_of]
    make_folder(folder)
    if arguments.docs is not None:
        for name, figure in zip(PICTURES[:2], figures, strict=False):
            print(canvas.write_png(figure, folder / f"{name}.png", overwrite=True))
        return
    for name, figure in zip(PICTURES, figures, strict=False):
        canvas.write_png(figure, folder / f"{name}.png", overwrite=False)
    shapes.write_csv(folder / "shapes.csv")
    write_text(folder / "contraction_limits.csv", csv_text(LIMIT_COLUMNS, limits), overwrite=False)
    write_text(folder / "grasp_forces.csv", csv_text(FORCE_COLUMNS, forces), overwrite=False)
    print(f"\nShapes\n\n{table(SHAPE_COLUMNS, map(cells_of, shapes.rows))}")
    print("Smallest contraction without self-contact, of tubes of any diameter\n")
    print(
        table(("angle [deg]", "exact", "2 pi b >= D"), ((f"{np.degrees(a):.4g}", f"{e:.4f}", f"{s:.4f}") for a, e, s in limits))
    )
    print(f"Grasp force of our model, not data of the paper, at {pressure / 1e3:g} kPa (linear in the pressure)\n")
    names = ("deflection [mm]", "unwrapping (a) [N]", "contact (b) [N]", "force [N]")
    rows = [[f"{1e3 * d:.3g}", f"{a:.2f}", f"{b:.2f}", f"{f:.2f}"] for p, d, a, b, f in forces if p == pressure]
    print(table(names, rows))
    print(f"written to {folder}: {', '.join(sorted(p.name for p in folder.iterdir()))}")


def shape_table(contractions: Sequence[float], angles: Any, diameter: float) -> helix_grid.ShapeTable:
    """Helices of the grid; for the grid of the paper also its helix in two sizes."""
    same_angles = np.array_equal(np.round(angles, 12), np.round(helix_grid.PAPER_ANGLES, 12))
    if same_angles and diameter == helix_grid.PAPER_DIAMETER and sorted(contractions) == sorted(helix_grid.PAPER_CONTRACTIONS):
        return helix_grid.paper_grid()
    return helix_grid.shape_table(contractions, np.asarray(angles)[:, None], diameter)


SHAPE_COLUMNS = (
    "angle [deg]", "contraction", "D [m]", "Ro [m]", "Ri [m]", "b [m/rad]", "turn distance [m]", "realisable", "2 pi b >= D",
)  # fmt: skip
LIMIT_COLUMNS = ("angle [rad]", "contraction_limit [-]", "simple_contraction_limit [-]")
FORCE_COLUMNS = ("pressure [Pa]", "deflection [m]", "unwrapping [N]", "contact [N]", "force [N]")


def limit_table(angles: Any) -> list[tuple[float, ...]]:
    """Angle, exact limit and limit of the simple rule."""
    columns = (angles, helix.contraction_limit(angles), helix.simple_contraction_limit(angles))
    return list(zip(*(np.asarray(column).tolist() for column in columns), strict=True))


def force_table(test: helix.GraspTest, pressure: float) -> list[tuple[float, ...]]:
    """Pressure, deflection, both bounds and the force, for five pressures up to the largest."""
    forces = test.force((np.arange(6) / 5.0 * pressure)[:, None])
    columns = (forces.pressure, forces.deflection, forces.unwrapping, forces.contact, forces.force)
    return list(zip(*(column.ravel().tolist() for column in columns), strict=True))


def cells_of(row: helix_grid.ShapeRow) -> list[str]:
    """Return the cells of a helix for `SHAPE_COLUMNS`, rounded."""
    lengths = [f"{length:.5f}" for length in (row.diameter, row.outer_radius, row.inner_radius, row.pitch)]
    distance = "none" if row.turn_distance is None else f"{row.turn_distance:.5f}"
    answers = ["yes" if answer else "no" for answer in (row.realisable, row.realisable_by_simple_rule)]
    return [f"{np.degrees(row.angle):.4g}", f"{row.contraction:.4g}", *lengths, distance, *answers]


def table(names: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [names, ["---"] * len(names), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
