"""Compute again what the three papers print, and compare: numbers, equations and curves, as far as their text allows.

Prints a table a paper: where it stands, what it is, the paper's value, ours, the difference, a verdict and a note. What
cannot be computed, because data are measured or not published, is listed with the reason. The last line counts; the exit
status is 1 if a row that must agree does not, or an erratum is none.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_text
from softrobots.core.progress import with_progress
from softrobots.view.figures import canvas
from studies.papers import rendering
from studies.papers.curves import write_curves
from studies.papers.pictures import PICTURES
from studies.papers.reproduction import PAPERS, reproduce
from studies.shared.command_line import tell_written
from studies.shared.folders import free_folder
from studies.shared.markdown import marked

CHECKOUT = Path(__file__).resolve().parent.parent
PAGE = Path("docs") / "reproduction.md"
MARKS = {part: (f"<!-- {part}:begin -->", f"<!-- {part}:end -->") for part in ("reproduction", "reproduction-figures")}
"""Between these lines of the page stand the table and the figures."""
PREFIX = "reproduction_"
"""What the names of pictures in docs/images begin with."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"papers, of {', '.join(PAPERS)} (all)"
    result.add_argument("--paper", nargs="+", choices=list(PAPERS), default=list(PAPERS), metavar="PAPER", help=help_text)
    help_text = "also write figures (PNG), curves (CSV) and the table (CSV, JSON) into this new or empty folder"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    result.add_argument("--no-plots", action="store_true", help="with --output: do without the figures, which need matplotlib")
    result.add_argument("--json", action="store_true", help="print the table as one JSON object and nothing else")
    help_text = f"write table and figures of {PAGE} and docs/images/{PREFIX}*.png in a checkout (this one)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def document(found: rendering.Rows) -> dict[str, str]:
    """What stands between the marks of the page."""
    figures = []
    for name, paper in PAPERS.items():
        figures.append(f"### Figures: {paper.title}")
        for short, picture in PICTURES[name].items():
            file = picture.elsewhere or f"{PREFIX}{short}.png"
            figures += [f"![{picture.caption.partition('. ')[0].rstrip('.')}](images/{file})", f"*{picture.caption}*"]
    return {"reproduction": rendering.markdown(found), "reproduction-figures": "\n\n".join(figures)}


def write_docs(found: rendering.Rows, checkout: Path, *, progress: bool) -> list[Path]:
    """Write page and pictures into a checkout; return the files."""
    page = checkout / PAGE
    text = _page(checkout)
    for part, inside in document(found).items():
        text = marked(text, PAGE.name, *MARKS[part], inside)
    files = [write_text(page, text, overwrite=True)]
    names = [(paper, name) for paper in PAPERS for name, picture in PICTURES[paper].items() if not picture.elsewhere]
    make_folder(page.parent / "images")
    for paper, name in with_progress(names, progress, label="figures", unit="figure"):
        target = page.parent / "images" / f"{PREFIX}{name}.png"
        files.append(canvas.write_png(PICTURES[paper][name].draw(), target, overwrite=True))
    return files


def write_folder(found: rendering.Rows, folder: Path, *, figures: bool, progress: bool) -> None:
    """Write table, curves and figures into a folder."""
    make_folder(folder)
    write_text(folder / "reproduction.csv", rendering.csv(found), overwrite=False)
    write_text(folder / "reproduction.json", rendering.as_json(found), overwrite=False)
    for paper in found:
        write_curves(paper, folder)
    names = [(paper, name) for paper in found for name in PICTURES[paper]] if figures else []
    for paper, name in with_progress(names, progress and figures, label="figures", unit="figure"):
        canvas.write_png(PICTURES[paper][name].draw(), folder / f"{name}.png", overwrite=False)


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; tell whether every claim holds."""
    figures = arguments.output is not None and not arguments.no_plots
    if figures or arguments.docs is not None:
        canvas.require_matplotlib()  # tells at once what is missing
    folder = None if arguments.output is None else free_folder(arguments.output)
    if arguments.docs is not None:
        if set(arguments.paper) != set(PAPERS):
            raise sr.ParameterError("--docs", str(arguments.docs), "given for all papers, without --paper")
        for begin, end in MARKS.values():
            marked(_page(arguments.docs), PAGE.name, begin, end, "")
    progress = not arguments.json
    found = reproduce(arguments.paper, progress=progress)
    print(rendering.as_json(found) if arguments.json else f"\n{rendering.text(found)}", end="" if arguments.json else "\n")
    holds = not rendering.failed(found)
    if folder is not None:
        write_folder(found, folder, figures=figures, progress=progress)
        if not arguments.json:
            tell_written(folder)
    if arguments.docs is not None:
        if not holds:
            raise sr.ParameterError("--docs", str(arguments.docs), "given while every claim holds; see the rows in capitals")
        files = write_docs(found, arguments.docs, progress=progress)
        if not arguments.json:
            print(f"\nwritten: {', '.join(map(str, files))}")
    return holds


def _page(checkout: Path) -> str:
    """The text of the page."""
    try:
        return (checkout / PAGE).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise sr.FileFormatError(f"cannot read {checkout / PAGE}: {error}") from error


def main(argv: list[str] | None = None) -> int:
    """Run from the command line: 1 if a claim does not hold, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
