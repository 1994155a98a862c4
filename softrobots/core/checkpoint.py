"""Checkpoints of a long job: finished blocks in a folder, from which an interrupted or killed run continues.

The folder contains `case.json` with the inputs of the job, and `block_<number>.npz` (no pickle) for each finished block. Files
are written atomically. A block is used only if it belongs to the same case and has the requested arrays; a damaged one is
computed again. Several runs of one case may share a folder; they write the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.errors import FileFormatError, OutputError, OutputExists, ParameterError
from softrobots.core.files import as_path, make_folder, write_atomically, write_text
from softrobots.core.json_text import read_json
from softrobots.core.npz_file import read_arrays

CASE = "case.json"
"""The file with the inputs of the job."""

_FORMAT = 1
_LARGEST_CASE = 100_000  # bytes
_SHOWN = 60  # characters of an input in an error
_NAMED = 5  # inputs in an error that only the other case has
_LONG = 400  # characters of an input; a longer one is replaced by its hash


class Checkpoint:
    """Folder of the finished blocks of one job; created with the first block."""

    def __init__(self, folder: str | os.PathLike[str], case: Mapping[str, Any]) -> None:
        """Check that the folder can be used for this job.

        Args:
            folder: A folder of a run of the same case, an empty one, or one that does not exist.
            case: Inputs that the results depend on, by name: numbers, texts, None, and lists of these.

        Raises:
            ParameterError: If `folder` is not a path, or its blocks belong to another case; the message lists the differences.
            FileFormatError: If its `case.json` cannot be read.
            OutputExists: If it is a file, or contains other files.
            OutputError: If it cannot be read.
        """
        self._folder = as_path("checkpoint", folder)
        self._case = {"format": str(_FORMAT), **{name: _text(value) for name, value in case.items()}}
        self._mark = hashlib.sha256(json.dumps(self._case, sort_keys=True).encode()).hexdigest()
        self._exists = _has_case(self._folder)
        if self._exists:
            self._check_same()

    def block(self, number: int, arrays: Mapping[str, tuple[type, tuple[int, ...]]]) -> dict[str, Any] | None:
        """Return the arrays of a finished block by name; None if it is damaged or its names, types or shapes differ."""
        if not self._exists:
            return None
        try:
            content = read_arrays(self._file(number))
        except FileFormatError:
            return None
        if str(content.pop("mark", "")) != f"{self._mark} {number}" or content.keys() != arrays.keys():
            return None
        fits = all(content[name].dtype == kind and content[name].shape == shape for name, (kind, shape) in arrays.items())
        return content if fits else None

    def keep(self, number: int, arrays: Mapping[str, Any]) -> None:
        """Write a finished block.

        Raises:
            OutputError: If it cannot be written; the blocks before it stay.
            ParameterError: If a run of another case has started in the folder since the checkpoint was opened.
            FileFormatError: If the `case.json` of that run cannot be read.
        """
        if not self._exists:
            make_folder(self._folder)
            try:
                write_text(self._folder / CASE, json.dumps(self._case, indent=1) + "\n", overwrite=False)
            except OutputExists:  # another run was first
                self._check_same()
            self._exists = True
        content = {"mark": np.array(f"{self._mark} {number}"), **arrays}
        write_atomically(self._file(number), lambda file: np.savez(file, **content))

    def _file(self, number: int) -> Path:
        return self._folder / f"block_{number:06d}.npz"

    def _check_same(self) -> None:
        file = self._folder / CASE
        theirs = read_json(file, _LARGEST_CASE)
        if not isinstance(theirs, dict) or not all(isinstance(value, str) for value in theirs.values()):
            raise FileFormatError(f"{file} is not the description of a case: an object of texts is required")
        if theirs == self._case:
            return
        changed = [name for name in self._case if theirs.get(name) != self._case[name]]
        others = sorted(theirs.keys() - self._case.keys())
        names = [*changed, *others[:_NAMED]]
        differences = [f"{_short(name)} was {_short(theirs.get(name))} and is {_short(self._case.get(name))}" for name in names]
        if len(others) > _NAMED:
            differences.append(f"and {len(others) - _NAMED} more")
        requirement = f"a new folder, or one with blocks of the same case; there {'; '.join(differences)} now"
        raise ParameterError("checkpoint", str(self._folder), requirement)


def _has_case(folder: Path) -> bool:
    """Whether a folder is a checkpoint rather than new or empty; raise OutputExists if it is neither."""
    try:
        if not folder.exists():
            return False
        if not folder.is_dir():
            raise OutputExists(f"{folder} is a file; a folder is required for finished blocks")
        names = sorted(path.name for path in folder.iterdir() if not (path.name[0] == "." and path.suffix == ".part"))
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot read the folder {folder}: {error}") from error
    if names and CASE not in names:
        raise OutputExists(f"{folder} contains {names[0]} and no {CASE}; a folder for finished blocks must be new or empty")
    return bool(names)


def _text(value: Any) -> str:
    """Return an input as JSON in full precision, or the hash of that."""
    text = json.dumps(value)
    return text if len(text) <= _LONG else f"sha256:{hashlib.sha256(text.encode()).hexdigest()} of {len(text)} characters"


def _short(text: str | None) -> str:
    """Return a printable text of limited length for an error."""
    if text is None:
        return "nothing"
    printable = text if text.isprintable() else repr(text)
    return printable if len(printable) <= _SHOWN else printable[: _SHOWN - 3] + "..."
