"""Finished blocks of a long job in a folder, so that a run that was interrupted, even killed, goes on from there.

The folder holds `case.json`, which says what the job is, and `block_<number>.npz` (no pickle) for each finished block. Each
file appears whole or not at all. A block is used only if it belongs to the same case and has the arrays that are asked for: one
that is damaged is computed again. Several runs of one case may share a folder; they write the same bytes.
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
"""The file that says what the job is."""

_FORMAT = 1
_LARGEST_CASE = 100_000  # bytes
_SHOWN = 60  # characters of a text of it in an error
_NAMED = 5  # things in an error that only another case has
_LONG = 400  # characters of what a case says; of more its hash stands in the file


class Checkpoint:
    """The folder of the finished blocks of one job; made when the first block is kept."""

    def __init__(self, folder: str | os.PathLike[str], case: Mapping[str, Any]) -> None:
        """Look at the folder.

        Args:
            folder: A folder of a run of the same case, an empty one, or one that does not exist.
            case: What the answers depend on, by name: numbers, texts, None, and lists of these.

        Raises:
            ParameterError: If `folder` is no path, or its blocks belong to another case; the message says what differs.
            FileFormatError: If it says unreadably what its case is.
            OutputExists: If it is a file, or holds anything else.
            OutputError: If it cannot be looked at.
        """
        self._folder = as_path("checkpoint", folder)
        self._case = {"format": str(_FORMAT), **{name: _text(value) for name, value in case.items()}}
        self._mark = hashlib.sha256(json.dumps(self._case, sort_keys=True).encode()).hexdigest()
        self._made = _holds_case(self._folder)
        if self._made:
            self._check_same(_read_case(self._folder / CASE))

    @property
    def folder(self) -> Path:
        """Where the blocks are."""
        return self._folder

    def block(self, number: int, arrays: Mapping[str, tuple[type, tuple[int, ...]]]) -> dict[str, Any] | None:
        """The arrays of a finished block.

        Args:
            number: Number of the block.
            arrays: Name, type of numbers and shape of each of its arrays.

        Returns:
            The arrays by name; None if the block is not finished, or is damaged.
        """
        if not self._made:
            return None
        try:
            held = read_arrays(self._file(number))
        except FileFormatError:
            return None
        if str(held.pop("mark", "")) != f"{self._mark} {number}" or held.keys() != arrays.keys():
            return None
        fits = all(held[name].dtype == kind and held[name].shape == shape for name, (kind, shape) in arrays.items())
        return held if fits else None

    def keep(self, number: int, arrays: Mapping[str, Any]) -> None:
        """Write a finished block.

        Raises:
            OutputError: If it cannot be written; the blocks before it stay.
            ParameterError: If a run of another case has begun in the folder since it was looked at.
            FileFormatError: If that run says unreadably what its case is.
        """
        if not self._made:
            make_folder(self._folder)
            try:
                write_text(self._folder / CASE, json.dumps(self._case, indent=1) + "\n", overwrite=False)
            except OutputExists:  # another run was first
                self._check_same(_read_case(self._folder / CASE))
            self._made = True
        content = {"mark": np.array(f"{self._mark} {number}"), **arrays}
        write_atomically(self._file(number), lambda file: np.savez(file, **content))

    def _file(self, number: int) -> Path:
        return self._folder / f"block_{number:06d}.npz"

    def _check_same(self, theirs: Mapping[str, str]) -> None:
        if theirs == self._case:
            return
        ours = [name for name in self._case if theirs.get(name) != self._case[name]]
        others = sorted(theirs.keys() - self._case.keys())
        names = [*ours, *others[:_NAMED]]
        found = [f"{_short(name)} was {_short(theirs.get(name))} and is {_short(self._case.get(name))}" for name in names]
        told = "; ".join(found)
        if len(others) > _NAMED:
            told += f"; and {len(others) - _NAMED} more"
        raise ParameterError(
            "checkpoint", str(self._folder), f"a new folder, or one with blocks of the same case; there {told} now"
        )


def discard(folder: str | os.PathLike[str]) -> None:
    """Delete a folder of finished blocks; other files in it stay, and then so does the folder.

    Raises:
        ParameterError: If it is no path.
        OutputError: If a file cannot be deleted.
    """
    place = as_path("checkpoint", folder)
    try:
        if (place / CASE).is_file():
            for file in [*place.glob("block_*.npz"), *place.glob(".*.part")]:
                file.unlink()
            (place / CASE).unlink()  # last: until then the folder says what it is
            if not any(place.iterdir()):
                place.rmdir()
    except OSError as error:
        raise OutputError(f"cannot delete the blocks in {place}: {error}") from error


def _holds_case(folder: Path) -> bool:
    """Whether a folder has blocks; refuse one that holds anything else.

    Raises:
        OutputExists: If it is a file, or not empty and without a case.
        OutputError: If it cannot be looked at.
    """
    try:
        if not folder.exists():
            return False
        if not folder.is_dir():
            raise OutputExists(f"{folder} is a file; a folder is required for finished blocks")
        names = sorted(path.name for path in folder.iterdir() if not (path.name[0] == "." and path.suffix == ".part"))
    except OutputError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot look at {folder}: {error}") from error
    if names and CASE not in names:
        raise OutputExists(f"{folder} holds {names[0]} and no {CASE}; a folder for finished blocks must be new or empty")
    return bool(names)


def _read_case(file: Path) -> dict[str, str]:
    found = read_json(file, _LARGEST_CASE)
    if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
        raise FileFormatError(f"{file} does not say of which case the blocks beside it are")
    return found


def _text(value: Any) -> str:
    """What stands in the file for a value: all its digits, or a hash of them."""
    text = json.dumps(value)
    return text if len(text) <= _LONG else f"sha256:{hashlib.sha256(text.encode()).hexdigest()} of {len(text)} characters"


def _short(text: str | None) -> str:
    """A text of a file as an error shows it: printable, and not long."""
    if text is None:
        return "nothing"
    shown = text if text.isprintable() else repr(text)
    return shown if len(shown) <= _SHOWN else shown[: _SHOWN - 3] + "..."
