"""Files for the bench: the template of a pinched tube to print to scale, on one sheet or on pages, and its table."""

from __future__ import annotations

import math
import os
from pathlib import Path

from softrobots.core.checks import positive_number
from softrobots.core.errors import ParameterError
from softrobots.core.files import as_path, new_file, write_text
from softrobots.helix.pattern import Pattern, checked_pattern
from softrobots.helix.template import Window, svg_text, table_text

_ROUNDING = 1e-9  # of a page
_THINNEST, _THICKEST, _LONGEST = 1e-3, 10.0, 200.0  # tubes that are drawn [m]
_MOST_PAGES = 500


def write_template(pattern: Pattern, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw the unrolled tube to scale, on one sheet: see `softrobots.helix.template`.

    Args:
        pattern: The plan.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If `pattern` is no `Pattern`, the path is none, or the tube is thinner than 1 mm, thicker than 10 m or
            longer than 200 m.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    _check_drawable(checked_pattern(pattern))
    return write_text(path, svg_text(pattern, Window(0.0, 1e3 * pattern.tube_length)), overwrite=overwrite)


def write_template_pages(
    pattern: Pattern,
    path: str | os.PathLike[str],
    page_length: float = 0.25,
    overlap: float = 0.02,
    *,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Draw the unrolled tube to scale, on pages that are glued together; neighbours overlap and share a join line.

    Args:
        pattern: The plan.
        path: Name of the files, to which the page number is added: `tube.svg` gives `tube-1.svg`, `tube-2.svg`, ...
        page_length: Length of the tube on a page; 0.25 m fits A4 lying [m].
        overlap: How much of it is on the next page again, at most half [m].
        overwrite: Replace existing files.

    Returns:
        The paths of the files.

    Raises:
        ParameterError: If `pattern` is no `Pattern`, the path is none, a length is out of range, there would be more than 500
            pages, or the tube is as in `write_template`.
        OutputExists: If one of the files exists and `overwrite` is false; then none is written.
        OutputError: If a file cannot be written.
    """
    page, common = 1e3 * positive_number("page_length", page_length, "m"), 1e3 * positive_number("overlap", overlap, "m")
    _check_drawable(checked_pattern(pattern))
    length = 1e3 * pattern.tube_length
    if common > 0.5 * page:
        raise ParameterError("overlap", overlap, f"at most half the page length {page_length} m")
    step, base = page - common, as_path("path", path)
    if not base.name:
        raise ParameterError("path", path, "a file name, to which page numbers are added")
    if length > step * _MOST_PAGES:
        raise ParameterError(
            "page_length", page_length, f"such that {_MOST_PAGES} pages are enough for {pattern.tube_length} m"
        )
    count = max(1, math.ceil((length - common) / step - _ROUNDING))
    digits = len(str(count))
    targets = [
        new_file(base.with_name(f"{base.stem}-{n + 1:0{digits}}{base.suffix}"), overwrite=overwrite) for n in range(count)
    ]
    joins = [step * n + 0.5 * common for n in range(1, count)]  # in the middle of what two pages share
    for n, target in enumerate(targets):
        window = Window(step * n, min(step * n + page, length), n + 1, count, tuple(joins[max(n - 1, 0) : n + 1]))
        write_text(target, svg_text(pattern, window), overwrite=overwrite)
    return tuple(targets)


def write_template_table(pattern: Pattern, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """List what to mark along the actuator line, in millimetres.

    Columns: `number`; `kind` ("pinch", "tape", "gap" or "stopper"); `start_mm`, `end_mm`, `length_mm` along the line of the
    uninflated tube; and for start and end `x_mm` along the tube, `y_mm` around it and `wrap`, as in `SheetPoints`.

    Args:
        pattern: The plan.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If `pattern` is no `Pattern`, or the path is none.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    return write_text(path, table_text(checked_pattern(pattern)), overwrite=overwrite)


def _check_drawable(pattern: Pattern) -> None:
    """Refuse a tube that is no tube on a bench."""
    if not _THINNEST <= pattern.diameter <= _THICKEST:
        raise ParameterError("diameter", pattern.diameter, f"from {_THINNEST} to {_THICKEST} m for a drawing")
    if pattern.tube_length > _LONGEST:
        raise ParameterError("tube_length", pattern.tube_length, f"at most {_LONGEST} m for a drawing")
