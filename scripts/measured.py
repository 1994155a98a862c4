"""Compare models of the package with measurements that others have published.

Each comparison has its measurements, with source and licence, in docs/examples or in the package, predicts them with the
robots of the package, and tells the errors: an inflated link, tubes of kites, a long boom, a fly rod, strips of laminate, a
silicone arm under pressure. The tendon-driven arm has scripts of its own, measured_arm.py and measured_arm_fit.py.

Prints Markdown tables; under a minute for all.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path
from typing import Any

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_text
from softrobots.view.figures import canvas
from studies.measured.boom import BOOM
from studies.measured.comparison import Comparison, overview_table
from studies.measured.composite_strip import COMPOSITE_STRIP
from studies.measured.fly_rod import FLY_ROD
from studies.measured.inflated_link import INFLATED_LINK
from studies.measured.kite_tubes import KITE_TUBES
from studies.measured.recorded_arm import arm_rows, read_record
from studies.measured.soft_arm import SOFT_ARM
from studies.shared.checkout import CHECKOUT
from studies.shared.folders import free_folder
from studies.shared.markdown import marked
from studies.shared.recorded_run import check_page, write_record

PAGE = "measured.md"
COMPARISONS: dict[str, Comparison] = {
    "inflated_link": INFLATED_LINK,
    "kite_tubes": KITE_TUBES,
    "boom": BOOM,
    "fly_rod": FLY_ROD,
    "composite_strip": COMPOSITE_STRIP,
    "soft_arm": SOFT_ARM,
}
"""By name, in the order of the page."""
BEGIN, END = "<!-- measured_overview:begin -->", "<!-- measured_overview:end -->"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"what to compare: {', '.join(COMPARISONS)} (all)"
    choices = [*COMPARISONS, []]  # none given is checked as a choice of its own
    options.add_argument("names", nargs="*", choices=choices, default=[], metavar="NAME", help=help_text)
    options.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    help_text = "new or empty folder for tables (Markdown), numbers (JSON) and pictures (PNG)"
    options.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    options.add_argument("--no-plots", action="store_true", help="with --output: do without pictures, which need matplotlib")
    help_text = "write tables of docs/measured.md, numbers in docs/validation and pictures of a checkout (this one)"
    options.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return options


def overview(checkout: Path) -> str:
    """The table over all comparisons, from the recorded runs of a checkout.

    Raises:
        FileFormatError: If a run is not recorded.
    """
    rows = [one.overview(read_record(checkout, f"measured_{name}")) for name, one in COMPARISONS.items()]
    return overview_table([*rows, *arm_rows(checkout)])


def write_docs(checkout: Path, name: str, record: dict[str, Any]) -> list[Path]:
    """Write one comparison into a checkout."""
    one = COMPARISONS[name]
    picture = make_folder(checkout / "docs" / "images") / f"measured_{name}.png"
    files = [canvas.write_png(one.picture(record), picture, overwrite=True)]
    command = f"python scripts/measured.py {name}"
    return [*files, *write_record(checkout, f"measured_{name}", one.table(record), record, command=command, page=PAGE)]


def write_overview(checkout: Path) -> None:
    """Write the table over all comparisons into the page of a checkout."""
    page = checkout / "docs" / PAGE
    text = marked(page.read_text(encoding="utf-8"), PAGE, BEGIN, END, overview(checkout))
    write_text(page, text, overwrite=True)


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    names = arguments.names or list(COMPARISONS)
    if arguments.docs is not None:
        for name in names:
            check_page(arguments.docs, f"measured_{name}", page=PAGE)
    if arguments.docs is not None or (arguments.output is not None and not arguments.no_plots):
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    records, files = {}, []
    for name in names:
        records[name] = COMPARISONS[name].run()
        if not arguments.json:
            print(f"### {name}\n\n{COMPARISONS[name].table(records[name])}\n", flush=True)
        if arguments.docs is not None:
            files += write_docs(arguments.docs, name, records[name])
    if arguments.json:
        print(json.dumps(records, indent=1, allow_nan=False))
    if arguments.docs is not None:
        write_overview(arguments.docs)
    if folder is not None:
        make_folder(folder)
        for name, record in records.items():
            files.append(write_text(folder / f"{name}.json", json.dumps(record, indent=1) + "\n", overwrite=False))
            files.append(write_text(folder / f"{name}.md", COMPARISONS[name].table(record) + "\n", overwrite=False))
            if not arguments.no_plots:
                figure = COMPARISONS[name].picture(record)
                files.append(canvas.write_png(figure, folder / f"{name}.png", overwrite=False))
    if files and not arguments.json:
        print(f"written: {', '.join(map(str, files))}")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(partial(run, arguments))


if __name__ == "__main__":
    sys.exit(main())
