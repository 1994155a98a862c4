"""The result of a slow proof on a page of the documentation: the table, what made it, when, and on which machine.

Proofs that take minutes (a million random solves, mutants, the suite on every Python) are scripts. Their last run stands in
`docs/validation/<name>.json` and, as a table, between the lines `<!-- <name>:begin -->` and `<!-- <name>:end -->` of a page.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import make_folder, write_text
from studies.shared.machine import machine
from studies.shared.markdown import marked

FOLDER = Path("docs") / "validation"
"""Where the results of all runs are, in a checkout."""

VALIDATION = "validation.md"
"""The page that says how each promise is tested."""


def check_page(checkout: Path, name: str, *, page: str = VALIDATION) -> None:
    """Find out before a long run whether its result can be recorded.

    Args:
        checkout: Folder of the project.
        name: Name of the proof.
        page: Page in `docs`.

    Raises:
        FileFormatError: If the page cannot be read or does not have the marks of this proof.
    """
    _with_record(checkout, name, page, "")


def command_of(script: str, parser: argparse.ArgumentParser, arguments: argparse.Namespace, *options: str) -> str:
    """What a reader types to run a script as it was run.

    Args:
        script: Its name, e.g. "soak".
        parser: Its command line.
        arguments: The options of the run.
        options: Names of those of one value that the result depends on; told where they are not what they are by default.
    """
    given = [(name, getattr(arguments, name)) for name in options]
    text = [f"--{name} {value}" for name, value in given if value != parser.get_default(name)]
    return " ".join([f"python scripts/{script}.py", *text])


def write_record(
    checkout: Path, name: str, table: str, result: Mapping[str, Any], *, command: str, page: str = VALIDATION
) -> list[Path]:
    """Write the result of a run into a checkout.

    Args:
        checkout: Folder of the project.
        name: Name of the proof, e.g. "soak".
        table: What the page shows, in Markdown.
        result: The numbers behind it, as JSON has them.
        command: What a reader types to see the same, e.g. "python scripts/soak.py".
        page: Page in `docs`.

    Returns:
        The files: the page and the JSON.

    Raises:
        ParameterError: If the result holds a number that is not finite.
        FileFormatError: If the page cannot be read or does not have the marks of this proof.
        OutputError: If a file cannot be written.
    """
    today = f"{datetime.now(timezone.utc):%Y-%m-%d}"
    facts = machine()
    versions = ", ".join(f"{package} {facts[package]}" for package in ("Python", "pin", "numpy"))
    line = f"*Run on {today} by `{command}`: {versions}, {facts['cores']} cores.*"
    text = _with_record(checkout, name, page, f"{line}\n\n{table.strip()}")
    try:
        numbers = json.dumps({"date": today, "command": command, "machine": facts, **result}, indent=1, allow_nan=False)
    except ValueError as error:
        raise ParameterError("result", dict(result), "finite numbers") from error
    make_folder(checkout / FOLDER)
    files = [write_text(checkout / FOLDER / f"{name}.json", numbers + "\n", overwrite=True)]
    return [write_text(checkout / "docs" / page, text, overwrite=True), *files]


def _with_record(checkout: Path, name: str, page: str, inside: str) -> str:
    """The text of the page with something else between the marks of a proof."""
    path = checkout / "docs" / page
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise FileFormatError(f"cannot read {path}: {error}") from error
    return marked(text, page, f"<!-- {name}:begin -->", f"<!-- {name}:end -->", inside)
