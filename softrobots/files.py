"""Writing files and folders: nothing is overwritten silently, and a file appears whole or not at all."""

from __future__ import annotations

import csv
import io
import os
import secrets
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any

from softrobots.errors import OutputError, OutputExists, ParameterError


def as_path(name: str, value: Any) -> Path:
    """Return `value` as a path.

    Args:
        name: Name of the parameter, for the error.
        value: Text or a path.

    Raises:
        ParameterError: If it is neither.
    """
    if not isinstance(value, str | os.PathLike) or not str(value):
        raise ParameterError(name, value, "a path")
    return Path(value)


def new_file(path: str | os.PathLike[str], *, overwrite: bool) -> Path:
    """Return `path` if a file may be written there, making its parent folders.

    Raises:
        ParameterError: If it is no path.
        OutputExists: If it exists and `overwrite` is false, or is a folder.
        OutputError: If its folder cannot be made.
    """
    target = as_path("path", path)
    try:
        if target.is_dir():
            raise OutputExists(f"{target} is a folder; a file name is required")
        if target.exists() and not overwrite:
            raise OutputExists(f"{target} exists; choose another name or allow overwriting")
        target.parent.mkdir(parents=True, exist_ok=True)
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write {target}: {error}") from error
    return target


def free_folder(path: str | os.PathLike[str]) -> Path:
    """Return `path` if it can become a folder of results; nothing is made yet.

    Args:
        path: A folder that does not exist or is empty.

    Raises:
        ParameterError: If it is no path.
        OutputExists: If it, or a folder that it would be in, is a file, or if it holds anything.
        OutputError: If it cannot be looked at.
    """
    target = as_path("path", path)
    try:
        blocking = next((p for p in (target, *target.parents) if p.exists() and not p.is_dir()), None)
        names = sorted(p.name for p in target.iterdir()) if target.is_dir() else []
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot look at {target}: {error}") from error
    if blocking is not None:
        raise OutputExists(f"{blocking} is a file; an output folder must be new or empty")
    if names:
        held = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        raise OutputExists(f"{target} is not empty (it holds {held}); an output folder must be new or empty")
    return target


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Make a folder and those that it is in, if they are not there, and return its path.

    Raises:
        ParameterError: If it is no path.
        OutputError: If it cannot be made, e.g. because a file is in the way.
    """
    target = as_path("path", path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot make the folder {target}: {error}") from error
    return target


def write_atomically(target: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file beside its place and move it there; an interruption leaves the old file, or none.

    Args:
        target: The file; its folder exists.
        write: Writes the content into an open binary file.

    Raises:
        OutputError: If the file cannot be written, e.g. because the disk is full.
    """
    part = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    try:
        with part.open("xb") as file:
            write(file)
        part.replace(target)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"cannot write {target}: {error}") from error
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool) -> Path:
    """Write a text file in UTF-8 and return its path.

    Raises:
        ParameterError: If the path is none.
        OutputExists: If the file exists and `overwrite` is false, or is a folder.
        OutputError: If the file cannot be written.
    """
    target = new_file(path, overwrite=overwrite)
    write_atomically(target, lambda file: file.write(text.encode("utf-8")))
    return target


def csv_text(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV: a line of names, then one a row; floats with all their digits."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(names)
    writer.writerows(rows)  # writes repr() of a float
    return stream.getvalue()
