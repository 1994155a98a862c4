"""Predict the tip of a real tendon-driven arm, and compare it with what was measured.

The recordings in docs/examples/tdcr_v4 (source and licence there) have 2063 rows: commands of nine motors, and the place of
the tip by motion capture. Each row is one equilibrium of the arm with nominal parameters: three segments, nine elastic
tendons that only pull. Nothing of the robot is fitted. Errors are told by the source's metric (root mean square of the
distance after the mean offset of the set is subtracted) and after the pose of the base, found on train alone. Beside them
stand constant curvature without forces, the source's own simulator, and the repeatability of the robot.

Prints Markdown tables; some minutes with the other assumptions, one without (--no-others).
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import csv_text, make_folder, write_text
from softrobots.view.figures import canvas
from studies.measured_arm.nominal import PRETENSION, STIFFNESS, WEIGHTS, Nominal
from studies.measured_arm.pictures import pictures
from studies.measured_arm.recordings import FOLDER, SETS, read_recording
from studies.measured_arm.study import Study, study
from studies.measured_arm.tables import table
from studies.shared.checkout import CHECKOUT
from studies.shared.folders import free_folder
from studies.shared.recorded_run import check_page, command_of, write_record

NAME, PAGE = "measured_arm", "measured_arm.md"
OPTIONS = ("stiffness", "pretension", "weight", "mass", "every")


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = "folder of train.csv, val.csv and tendon_pull.csv (docs/examples/tdcr_v4)"
    options.add_argument("--data", type=Path, default=FOLDER, metavar="FOLDER", help=help_text)
    help_text = "stiffness of a tendon with its motor [N/m] (%(default)g)"
    options.add_argument("--stiffness", type=float, default=STIFFNESS, help=help_text)
    help_text = "tension of each tendon at zero commands [N] (%(default)g)"
    options.add_argument("--pretension", type=float, default=PRETENSION, help=help_text)
    help_text = "how the arm is mounted, or none for an arm without weight, as the source has it (%(default)s)"
    options.add_argument("--weight", choices=list(WEIGHTS), default="none", help=help_text)
    options.add_argument("--mass", type=float, default=0.05, help="mass of the arm, if it has weight [kg] (%(default)g)")
    options.add_argument("--every", type=int, default=1, help="take each so many-th row only, for a first look (%(default)s)")
    options.add_argument("--no-others", action="store_true", help="do without the table of other assumptions")
    options.add_argument("--no-plots", action="store_true", help="with --output: do without pictures, which need matplotlib")
    options.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    help_text = "new or empty folder for tables (Markdown, JSON), every row (CSV) and pictures (PNG)"
    options.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = (
        "write the tables of docs/measured_arm.md, docs/validation/measured_arm.json and the pictures of a checkout (this one)"
    )
    options.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return options


def rows_as_csv(found: Study) -> str:
    """Every row: what was measured and predicted, and the error."""
    names = ["set", "row", "pattern_label", *(f"{what}_{axis}_m" for what in ("tip", "predicted") for axis in "xyz"), "error_m"]
    lines = [
        [one.recording.name, number + 1, pattern, *measured, *predicted, error]
        for one in found.compared
        for number, (pattern, measured, predicted, error) in enumerate(
            zip(one.recording.patterns, one.recording.tips.tolist(), one.posed.tolist(), one.errors.tolist(), strict=True)
        )
    ]
    return csv_text(names, lines)


def write_results(found: Study, folder: Path, plots: bool) -> list[Path]:
    """Write tables, rows and pictures into a folder."""
    make_folder(folder)
    files = [write_text(folder / f"{NAME}.json", as_json(found) + "\n", overwrite=False)]
    files.append(write_text(folder / f"{NAME}.md", table(found.record) + "\n", overwrite=False))
    files.append(write_text(folder / f"{NAME}.csv", rows_as_csv(found), overwrite=False))
    return [*files, *(draw(found, folder, overwrite=False) if plots else [])]


def draw(found: Study, folder: Path, *, overwrite: bool) -> list[Path]:
    """Write the pictures into a folder."""
    drawn = pictures(found.compared, found.plain, found.floor).items()
    return [canvas.write_png(figure, folder / f"measured_{name}.png", overwrite=overwrite) for name, figure in drawn]


def as_json(found: Study) -> str:
    """The numbers as text."""
    return json.dumps(found.record, indent=1, allow_nan=False)


def checked(arguments: argparse.Namespace) -> Nominal:
    """The assumptions of the command line.

    Raises:
        ParameterError: If a value is out of range.
    """
    for option, value, least in (
        ("--stiffness", arguments.stiffness, 0.0),
        ("--mass", arguments.mass, 0.0),
    ):
        if not (np.isfinite(value) and value > least):
            raise sr.ParameterError(option, value, "positive")
    if not (np.isfinite(arguments.pretension) and arguments.pretension >= 0.0):
        raise sr.ParameterError("--pretension", arguments.pretension, "zero or positive [N]")
    if arguments.every < 1:
        raise sr.ParameterError("--every", arguments.every, "at least 1")
    return Nominal(arguments.stiffness, arguments.pretension, arguments.weight, arguments.mass)


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    nominal = checked(arguments)
    if arguments.docs is not None:
        told = [name for name in (*OPTIONS, "data", "no_others") if getattr(arguments, name) != parser().get_default(name)]
        if told:
            raise sr.ParameterError("--docs", str(arguments.docs), f"given without --{told[0].replace('_', '-')}")
        check_page(arguments.docs, NAME, page=PAGE)
    if arguments.docs is not None or (arguments.output is not None and not arguments.no_plots):
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    recordings = {name: read_recording(name, arguments.data) for name in SETS}

    def bar(steps: Any, label: str) -> Any:
        return tqdm(steps, desc=label, unit="row", leave=False)

    found = study(recordings, nominal, not arguments.no_others, bar, arguments.every)
    print(as_json(found) if arguments.json else table(found.record))
    files = [] if folder is None else write_results(found, folder, not arguments.no_plots)
    if arguments.docs is not None:
        files += draw(found, make_folder(arguments.docs / "docs" / "images"), overwrite=True)
        command = command_of(NAME, parser(), arguments, *OPTIONS)
        files += write_record(arguments.docs, NAME, table(found.record), found.record, command=command, page=PAGE)
    if files and not arguments.json:
        print(f"\nwritten: {', '.join(map(str, files))}")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(partial(run, arguments))


if __name__ == "__main__":
    sys.exit(main())
