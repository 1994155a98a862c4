"""Write files and folders: atomically, and without overwriting silently.

The package and its scripts write all their files with these functions.
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

_NAME = 60  # characters of a file name that its draft keeps; all of them and the suffix could exceed the limit of a name


def as_path(name: str, value: Any) -> Path:
    """Return `value`, text or a path, as a path, or raise ParameterError for the parameter of that name."""
    if not isinstance(value, str | os.PathLike) or not str(value):
        raise ParameterError(name, value, "a path")
    return Path(value)


def new_file(path: str | os.PathLike[str], *, overwrite: bool) -> Path:
    """Return `path` if a file can be written there; create its parent folders.

    Raises:
        ParameterError: If it is not a path.
        OutputExists: If it exists and `overwrite` is false, or is a folder, a device or a pipe.
        OutputError: If its folder cannot be created or written to, or the file is write-protected.
    """
    target = as_path("path", path)
    try:
        place = _place(target)
        mode = place.stat().st_mode if place.exists() else None
        if mode is not None and stat.S_ISDIR(mode):
            raise OutputExists(f"{target} is a folder; a file name is required")
        if mode is not None and not stat.S_ISREG(mode):  # moving a file there would replace the device
            raise OutputExists(f"{target} is a device or a pipe; the name of a file is required")
        if (mode is not None or target.is_symlink()) and not overwrite:
            raise OutputExists(f"{target} exists; choose another name or allow overwriting")
        if mode is not None and not mode & 0o222:
            raise OutputError(f"cannot write {target}: it is write-protected")
        place.parent.mkdir(parents=True, exist_ok=True)
        check_writable(place.parent)
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write {target}: {error}") from error
    return target


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Create a folder and its parents unless they exist, and return its path.

    Raises:
        ParameterError: If it is not a path.
        OutputError: If it cannot be created, e.g. because a file has its name.
    """
    target = as_path("path", path)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot create the folder {target}: {error}") from error
    return target


def write_atomically(target: Path, write: Callable[[IO[bytes]], object], *, overwrite: bool = True) -> None:
    """Write a file atomically: after an interruption the old file is there, or none.

    The content is written and synced to a draft in the same folder, which is then renamed. A replaced file keeps its
    permissions; of a symbolic link the file that it points to is replaced. Of several writers of one file the last wins, or
    the first with `overwrite=False`. A process that is killed may leave a hidden file `.NAME.*.part`, which is never read.

    Args:
        target: The file; its folder must exist.
        write: Function that writes the content to an open binary file.
        overwrite: Replace an existing file.

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
    except BaseException as error:
        if part is not None:
            with contextlib.suppress(OSError):
                part.unlink()
        if isinstance(error, OSError) and not isinstance(error, OutputError):
            raise OutputError(f"cannot write {target}: {error}") from error
        raise


def write_bytes(path: str | os.PathLike[str], content: bytes, *, overwrite: bool) -> Path:
    """Write a file of bytes and return its path; errors are those of `new_file` and `write_atomically`."""
    target = new_file(path, overwrite=overwrite)
    write_atomically(target, lambda file: file.write(content), overwrite=overwrite)
    return target


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool) -> Path:
    """Write a text file as `write_bytes` in UTF-8; raise OutputError if the text cannot be encoded in it, too."""
    try:
        content = text.encode("utf-8")
    except UnicodeEncodeError as error:  # a lone surrogate, as in file names that are not text
        raise OutputError(f"cannot write {path}: {error}") from error
    return write_bytes(path, content, overwrite=overwrite)


def csv_text(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV: a line of column names, then one line a row; floats in full precision."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(names)
    writer.writerows(rows)  # writes repr() of a float
    return stream.getvalue()


def _place(target: Path) -> Path:
    """Resolve symbolic links; raise OutputError for a loop."""
    try:
        place = target.resolve() if target.is_symlink() else target
    except (OSError, RuntimeError) as error:  # RuntimeError: Python before 3.13
        raise OutputError(f"cannot write {target}: {error}") from error
    if place.is_symlink():  # Python 3.13 stops in a loop without an error
        raise OutputError(f"cannot write {target}: its symbolic links form a loop")
    return place


def check_writable(folder: Path) -> None:
    """Raise OutputError if no files can be created in a folder, before hours of work."""
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        raise OutputError(f"cannot write in {folder}: no permission, or a read-only disk")


def _move_to_free_name(part: Path, place: Path) -> None:
    """Rename a finished draft; raise OutputExists rather than replace another file."""
    taken = OutputExists(f"{place} exists; choose another name or allow overwriting")
    try:
        os.link(part, place)  # unlike a rename, this never replaces a file
    except FileExistsError as error:
        raise taken from error
    except OSError as error:  # a file system without hard links
        if os.path.lexists(place):
            raise taken from error
        part.replace(place)
    else:
        part.unlink()


def _sync_folder(folder: Path) -> None:
    """Sync the new name to the disk, where the file system supports it."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
