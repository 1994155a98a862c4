"""Fit a synthetic inflatable arm a thousand times, and choose its poses: what the errors of identified parameters are worth.

- Tips measured with independent noise, and with noise that rows of a block have in common: how often the 95 % intervals of
  each parameter, from rows and from blocks, hold the true value.
- Intervals to expect with poses chosen by informative_poses, and with random ones.

Prints Markdown tables; some minutes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.errors import ParameterError
from studies.identification import choice, coverage
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, command_of, write_record

NAMES = ("identification_coverage", "informative_poses")


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--fits", type=int, default=1000, metavar="N", help="fits for each kind of noise (%(default)s)")
    result.add_argument("--seed", type=int, default=2026, metavar="N", help="seed of postures and noise (%(default)s)")
    help_text = "how many work on it; the result does not depend on it (%(default)s)"
    result.add_argument("--processes", type=int, default=2, metavar="N", help=help_text)
    help_text = "write the tables into docs/validation.md and the numbers into docs/validation of a checkout (this one)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    for option, value, least in (
        ("--fits", arguments.fits, 2),
        ("--seed", arguments.seed, 0),
        ("--processes", arguments.processes, 1),
    ):
        if value < least:
            raise ParameterError(option, value, f"at least {least}")
    if arguments.docs is not None:
        for name in NAMES:
            check_page(arguments.docs, name)
    results = (coverage.study(arguments.fits, arguments.seed, arguments.processes), choice.study(arguments.seed))
    tables = (coverage.table(results[0]), choice.table(results[1]))
    print("\n\n".join(tables))
    if arguments.docs is not None:
        command = command_of("identification_errors", parser(), arguments, "fits", "seed")
        for name, rows, numbers in zip(NAMES, tables, results, strict=True):
            write_record(arguments.docs, name, rows, numbers, command=command)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
