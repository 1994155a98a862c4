"""Folders of output of the scripts: new ones, and blocks of a long run that are no longer needed."""

from __future__ import annotations

import os
from pathlib import Path

from softrobots.core.checkpoint import CASE
from softrobots.core.errors import OutputError, OutputExists
from softrobots.core.files import as_path, check_writable


def free_folder(path: str | os.PathLike[str]) -> Path:
    """Return `path` if it can be used as an output folder; nothing is created yet.

    Args:
        path: A folder that does not exist or is empty.

    Raises:
        ParameterError: If it is not a path.
        OutputExists: If it or one of its parents is a file, or if it is not empty.
        OutputError: If it cannot be read or written to.
    """
    target = as_path("path", path)
    try:
        blocking = next((p for p in (target, *target.parents) if p.exists() and not p.is_dir()), None)
        existing = next((p for p in (target, *target.parents) if p.is_dir()), None)
        names = sorted(p.name for p in target.iterdir()) if target.is_dir() else []
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot read the folder {target}: {error}") from error
    if blocking is not None:
        raise OutputExists(f"{blocking} is a file; an output folder must be new or empty")
    if names:
        content = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
        raise OutputExists(f"{target} is not empty (it contains {content}); an output folder must be new or empty")
    if existing is not None:
        check_writable(existing)
    return target


def discard(folder: str | os.PathLike[str]) -> None:
    """Delete a folder of finished blocks; a folder with other files stays, with those files.

    Raises:
        ParameterError: If it is not a path.
        OutputError: If a file cannot be deleted.
    """
    place = as_path("checkpoint", folder)
    try:
        if (place / CASE).is_file():
            for file in [*place.glob("block_*.npz"), *place.glob(".*.part")]:
                file.unlink()
            (place / CASE).unlink()  # last: until then the folder is known as a checkpoint
            if not any(place.iterdir()):
                place.rmdir()
    except OSError as error:
        raise OutputError(f"cannot delete the blocks in {place}: {error}") from error
