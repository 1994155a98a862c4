"""Contact forces of solve_equilibrium against MuJoCo and Drake, which settle in the same surroundings.

Robots are pressed on obstacles by weight and a force on the tip; the simulators get the files that softrobots exports, with the
obstacles in them, and damped critically come to rest. Compared are the force of each obstacle on the robot and the place of the
tip. Prints the table; takes seconds. Ends with status 1 if a simulator does not agree.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.progress import with_progress
from studies.contact_forces.cases import CASES
from studies.contact_forces.comparison import SIMULATORS, as_data, compare, table
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, write_record

NAME, PAGE = "contact_forces", "other_tools.md"


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0 if all agree, 1 if not, 2 after bad input."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"write the table into docs/{PAGE} and the numbers into docs/validation/{NAME}.json of a checkout (this)"
    parser.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    arguments = parser.parse_args(argv)

    def run() -> bool:
        if arguments.docs is not None:
            check_page(arguments.docs, NAME, page=PAGE)
        pairs = [(name, simulator) for name in CASES for simulator in SIMULATORS]
        rows = [
            compare(name, CASES[name](), simulator)
            for name, simulator in with_progress(pairs, True, label="settling", unit="case")
        ]
        print(table(rows))
        if arguments.docs is not None:
            write_record(
                arguments.docs, NAME, table(rows), as_data(rows), command="python scripts/contact_forces.py", page=PAGE
            )
        return all(row.agrees for row in rows)

    return exit_status(run)


if __name__ == "__main__":
    sys.exit(main())
