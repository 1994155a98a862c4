"""Fit the parameters of a real tendon-driven arm to its recordings, and predict recordings of other movements.

The recordings are in docs/examples/tdcr_v4 (source and licence there). Which parameters are fitted is chosen by leaving out
families of movements of train (--compare, a fit for each family and set of parameters); then they are fitted to all of train,
and validation is predicted. `softrobots identify` does the same fit; its command is printed.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder
from softrobots.view.figures import canvas
from studies.measured_arm.fit_tables import compared_table, fit_table
from studies.measured_arm.fitted import command, compare, fit
from studies.measured_arm.pictures import drawn
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, write_record

PAGE = "measured_arm.md"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--compare", action="store_true", help="compare sets of parameters on families left out, instead")
    options.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    help_text = "write the tables of docs/measured_arm.md, docs/validation/ and the pictures of a checkout (this one)"
    options.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return options


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    name = "measured_families" if arguments.compare else "measured_fit"
    if arguments.docs is not None:
        check_page(arguments.docs, name, page=PAGE)
        canvas.require_matplotlib()
    if arguments.compare:
        record, compared = compare(progress=True), []
    else:
        record, compared = fit(progress=True)
    table = compared_table(record) if arguments.compare else fit_table(record)
    print(json.dumps(record, indent=1, allow_nan=False) if arguments.json else f"{table}\n\n{command()}")
    if arguments.docs is not None:
        if compared:
            images = make_folder(arguments.docs / "docs" / "images")
            for picture, figure in drawn(compared).items():
                canvas.write_png(figure, images / f"fitted_{picture}.png", overwrite=True)
        typed = f"python scripts/measured_arm_fit.py{' --compare' if arguments.compare else ''}"
        write_record(arguments.docs, name, table, record, command=typed, page=PAGE)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    return exit_status(partial(run, parser().parse_args(argv)))


if __name__ == "__main__":
    sys.exit(main())
