"""Writing files and folders: nothing is overwritten silently, and a file appears whole or not at all.

Everything that the package and its scripts write goes through here.
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
import secrets
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any

from softrobots.core.errors import OutputError, OutputExists, ParameterError

_NAME = 60  # characters of a name that its draft keeps: with all of them it may be longer than a name can be


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
        OutputExists: If it exists and `overwrite` is false, or is a folder, a device or a pipe.
        OutputError: If its folder cannot be made or written to, or the file is write-protected.
    """
    target = as_path("path", path)
    try:
        place = _place(target)
        held = place.stat() if place.exists() else None
        if held is not None and stat.S_ISDIR(held.st_mode):
            raise OutputExists(f"{target} is a folder; a file name is required")
        if held is not None and not stat.S_ISREG(held.st_mode):  # to move a file there would replace the device
            raise OutputExists(f"{target} is a device or a pipe; the name of a file is required")
        if (held is not None or target.is_symlink()) and not overwrite:
            raise OutputExists(f"{target} exists; choose another name or allow overwriting")
        if held is not None and not held.st_mode & 0o222:
            raise OutputError(f"cannot write {target}: it is write-protected")
        place.parent.mkdir(parents=True, exist_ok=True)
        _check_writable(place.parent)
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
        OutputError: If it cannot be looked at or written to.
    """
    target = as_path("path", path)
    try:
        blocking = next((p for p in (target, *target.parents) if p.exists() and not p.is_dir()), None)
        existing = next((p for p in (target, *target.parents) if p.is_dir()), None)
        names = sorted(p.name for p in target.iterdir()) if target.is_dir() else []
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot look at {target}: {error}") from error
    if blocking is not None:
        raise OutputExists(f"{blocking} is a file; an output folder must be new or empty")
    if names:
        held = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        raise OutputExists(f"{target} is not empty (it holds {held}); an output folder must be new or empty")
    if existing is not None:
        _check_writable(existing)
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


def write_atomically(target: Path, write: Callable[[IO[bytes]], object], *, overwrite: bool = True) -> None:
    """Write a file beside its place and move it there; an interruption leaves the old file, or none.

    The content is on the disk before the file gets its name. A file that is replaced hands its permissions on; through a
    symbolic link the file is replaced that it points to. Of several writers of one file the last wins, or with
    `overwrite=False` the first, and the file is whole. A process that is killed may leave a hidden file `.NAME.*.part`;
    nothing reads it again.

    Args:
        target: The file; its folder exists.
        write: Writes the content into an open binary file.
        overwrite: Replace a file that is there by now.

    Raises:
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written, e.g. because the disk is full.
    """
    part = None
    try:
        place = _place(target)
        draft = place.with_name(f".{target.name[:_NAME]}.{secrets.token_hex(6)}.part")
        with draft.open("xb") as file:
            part = draft
            if overwrite and place.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(place.stat().st_mode))
            write(file)
            file.flush()
            os.fsync(file.fileno())
        if overwrite:
            part.replace(place)
        else:
            _move_to_free_name(part, place)
        _sync_folder(place.parent)
    except OutputError:
        _remove(part)
        raise
    except OSError as error:
        _remove(part)
        raise OutputError(f"cannot write {target}: {error}") from error
    except BaseException:
        _remove(part)
        raise


def write_bytes(path: str | os.PathLike[str], content: bytes, *, overwrite: bool) -> Path:
    """Write a file of bytes and return its path.

    Raises:
        ParameterError: If the path is none.
        OutputExists: If the file exists and `overwrite` is false, or is a folder, a device or a pipe.
        OutputError: If the file cannot be written.
    """
    target = new_file(path, overwrite=overwrite)
    write_atomically(target, lambda file: file.write(content), overwrite=overwrite)
    return target


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool) -> Path:
    """Write a text file in UTF-8 and return its path.

    Raises:
        ParameterError: If the path is none.
        OutputExists: If the file exists and `overwrite` is false, or is a folder, a device or a pipe.
        OutputError: If the file cannot be written, or the text has no UTF-8.
    """
    try:
        content = text.encode("utf-8")
    except UnicodeEncodeError as error:  # half of a pair, as in a file name that is no text
        raise OutputError(f"cannot write {path}: {error}") from error
    return write_bytes(path, content, overwrite=overwrite)


def csv_text(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV: a line of names, then one a row; floats with all their digits."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(names)
    writer.writerows(rows)  # writes repr() of a float
    return stream.getvalue()


def _place(target: Path) -> Path:
    """Where a path leads to: through symbolic links, if there are any.

    Raises:
        OutputError: If links lead round in circles.
    """
    try:
        place = target.resolve() if target.is_symlink() else target
    except (OSError, RuntimeError) as error:  # RuntimeError: Python before 3.13
        raise OutputError(f"cannot write {target}: {error}") from error
    if place.is_symlink():  # Python 3.13 stops in the circle, and says nothing
        raise OutputError(f"cannot write {target}: symbolic links lead round in circles")
    return place


def _check_writable(folder: Path) -> None:
    """Refuse a folder in which no file can be made, before hours of work.

    Raises:
        OutputError: If permissions, or a disk that can only be read, are against it.
    """
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        raise OutputError(f"cannot write in {folder}: no permission, or a disk that can only be read")


def _move_to_free_name(part: Path, place: Path) -> None:
    """Give a finished file its name, unless another one has got it.

    Raises:
        OutputExists: If another file has it.
        OSError: If it cannot be moved.
    """
    taken = OutputExists(f"{place} exists; choose another name or allow overwriting")
    try:
        os.link(part, place)  # unlike a renaming, this replaces nothing
    except FileExistsError as error:
        raise taken from error
    except OSError as error:  # a file system without hard links
        if os.path.lexists(place):
            raise taken from error
        part.replace(place)
    else:
        part.unlink()


def _sync_folder(folder: Path) -> None:
    """Have the new name on the disk, too, where the file system does that."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _remove(part: Path | None) -> None:
    if part is not None:
        with contextlib.suppress(OSError):
            part.unlink()
