"""Measure motor paths and controllers of the inflatable arm in simulated motion.

- A move of 0.5 s under weight, bare and with each input shaper for the modes of the pose where it ends: vibration that is left.
- The path that stands for that of Troise et al. 2021, followed under its load by motors that move by their torque: by PD
  control with the angles of the rigid arm and those of solve_ik, with elastostatic feed-forward, and by the paper's closed
  loop; then under a larger load than they assume.

Prints Markdown tables; about a minute.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.view.figures import canvas
from studies.control import report, shaper_picture, shaping, tracking
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, write_record

PAGE = "motion.md"


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if no motion is found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = "write the tables into docs/motion.md, the numbers into docs/validation, and pictures, of a checkout (this)"
    parser.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    arguments = parser.parse_args(argv)

    def run() -> None:
        names = ("input_shaping", "controllers")
        if arguments.docs is not None:
            canvas.require_matplotlib()
            for name in names:
                check_page(arguments.docs, name, page=PAGE)
        shaped, followed = shaping.study(), tracking.study()
        rows = [one.row() for one in followed]
        tables = dict(zip(names, (report.shaping_table(shaped), report.tracking_table(rows)), strict=True))
        print("\n\n".join(tables.values()))
        if arguments.docs is None:
            return
        images = arguments.docs / "docs" / "images"
        canvas.write_png(shaper_picture.sensitivity(3.5, 0.06), images / "shaper_sensitivity.png", overwrite=True)
        canvas.write_png(report.tracking_figure(followed), images / "controllers.png", overwrite=True)
        for name, result in zip(names, (shaped, rows), strict=True):
            command = "python scripts/controllers.py"
            write_record(arguments.docs, name, tables[name], {"rows": result}, command=command, page=PAGE)

    return exit_status(run)


if __name__ == "__main__":
    sys.exit(main())
