"""How fast the compiled solvers are, each job against what one would use instead.

All alternatives of a job run in turn, round after round, in one process and on one thread; costs are CPU time where nothing
else is said, ratios are taken within a round, and what is printed are medians. Answers are compared with those of
solve_equilibrium and its like before anything is timed. What needs a package that is not installed is named as skipped.
Nothing fails because it is slow: the table says which targets are met.

Takes minutes.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, new_file, write_text
from softrobots.view.figures import canvas
from studies.benchmark.comparison import Settings, quick_settings
from studies.benchmark.jobs import JOBS, measure
from studies.benchmark.pictures import PICTURES, picture
from studies.benchmark.results import Results, as_json, machine_text, read_results, require_whole, table
from studies.shared.markdown import marked

CHECKOUT = Path(__file__).resolve().parent.parent
BEGIN, END = "<!-- benchmark:begin -->", "<!-- benchmark:end -->"
"""The lines of the page between which the table stands."""
PAGE = "docs/compiled.md"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"jobs to run, of {', '.join(JOBS)} (all)"
    result.add_argument("--only", nargs="+", choices=list(JOBS), default=list(JOBS), metavar="JOB", help=help_text)
    result.add_argument("--rounds", type=int, default=9, help="rounds of each comparison (%(default)s)")
    result.add_argument(
        "--quick", action="store_true", help="small sizes, to see that everything runs; the figures mean nothing"
    )
    help_text = "make tables and pictures of saved results instead"
    result.add_argument("--from", type=Path, dest="saved", metavar="FILE", help=help_text)
    result.add_argument("--json", type=Path, metavar="FILE", help="also write the results to a new file")
    result.add_argument("--plots", type=Path, metavar="FOLDER", help="draw the curves into a folder (jobs sizes and batches)")
    help_text = "write docs/benchmark.json, docs/images/benchmark_*.png and the table in docs/compiled.md"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def document(results: Results) -> str:
    """What the page shows of the results: machine, table and notes."""
    notes = "\n".join(f"- {note}" for note in results.notes)
    return "\n\n".join(part for part in (machine_text(results), table(results.rows), notes) if part)


def write_pictures(results: Results, folder: Path, *, overwrite: bool) -> list[Path]:
    """Draw what there are curves for; return the files."""
    names = [name for name in PICTURES if any(curve.picture == name for curve in results.curves)]
    make_folder(folder)
    return [canvas.write_png(picture(results, name), folder / f"benchmark_{name}.png", overwrite=overwrite) for name in names]


def page_with(checkout: Path, text: str) -> str:
    """The page of a checkout with a text between its two marks.

    Raises:
        FileFormatError: If the page cannot be read, or does not have each mark once, in order.
    """
    try:
        page = (checkout / PAGE).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise sr.FileFormatError(f"cannot read {checkout / PAGE}: {error}") from error
    return marked(page, PAGE, BEGIN, END, text)


def write_docs(results: Results, checkout: Path) -> list[Path]:
    """Write results, pictures and table into a checkout; return the files."""
    require_whole(results, list(JOBS))
    page = page_with(checkout, document(results))
    files = write_pictures(results, checkout / "docs" / "images", overwrite=True)
    files.append(write_text(checkout / "docs" / "benchmark.json", as_json(results), overwrite=True))
    return [*files, write_text(checkout / PAGE, page, overwrite=True)]


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    settings = Settings(arguments.rounds, progress=True)
    if arguments.quick:
        settings = quick_settings(arguments.rounds, progress=True)
    if arguments.rounds < 1:
        raise sr.ParameterError("--rounds", arguments.rounds, "at least 1")
    if arguments.plots is not None or arguments.docs is not None:
        canvas.require_matplotlib()  # tells at once what is missing
    if arguments.json is not None:
        new_file(arguments.json, overwrite=False)
    if arguments.docs is not None and arguments.saved is None:  # tells at once what keeps the page from being written
        if arguments.quick or set(arguments.only) != set(JOBS):
            raise sr.ParameterError("--docs", str(arguments.docs), "given for all jobs, without --quick")
        page_with(arguments.docs, "")
    results = measure(settings, arguments.only) if arguments.saved is None else read_results(arguments.saved)
    print(f"\n{document(results)}")
    written = []
    if arguments.json is not None:
        written.append(write_text(arguments.json, as_json(results), overwrite=False))
    if arguments.plots is not None:
        written += write_pictures(results, arguments.plots, overwrite=False)
    if arguments.docs is not None:
        written += write_docs(results, make_folder(arguments.docs))
    if written:
        print(f"\nwritten: {', '.join(map(str, written))}")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, slowness does not."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
