"""Arrays out of NPZ files that somebody else made: no pickle, and no more memory than a limit.

What an archive says of its members is compared with what their headers say before anything is unpacked, so that a small file
cannot become a large one.
"""

from __future__ import annotations

import math
import re
import stat
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.bounded_reading import opened
from softrobots.core.errors import FileFormatError, ParameterError

LARGEST = 2**30
"""Bytes of all arrays of a file together, if nothing else is said."""

_MOST_ARRAYS = 64
_LARGEST_DIRECTORY = 65536  # bytes, of the list of members at the end of an archive
_LARGEST_HEADER = 1000  # characters; those of arrays without fields have a hundred
_END, _END_64 = b"PK\x05\x06", b"PK\x06\x07"
_END_SIZE, _END_64_SIZE = 22, 20
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\.npy")
_KINDS = {"b": "truth values", "i": "integers", "u": "integers", "f": "numbers", "U": "text"}


def read_arrays(path: Path, *, only: Sequence[str] | None = None, largest: int | None = None) -> dict[str, NDArray[Any]]:
    """Read an NPZ file of numbers, truth values and texts.

    Args:
        path: The file.
        only: Names of arrays, for those of them alone that are there; None: all.
        largest: How many bytes all arrays of the file may have together; `LARGEST` by default.

    Returns:
        The arrays by name.

    Raises:
        FileFormatError: If the file cannot be read, is no archive as NumPy writes it, is damaged, holds objects (they would be
            pickles), or more than `largest` bytes of arrays.
    """
    most = LARGEST if largest is None else largest
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileFormatError("it is no file")
        with opened(path) as file:
            _check_end(file)
            with zipfile.ZipFile(file) as archive:
                members = archive.infolist()
                _check_members(members, most)
                for member in members:
                    with archive.open(member) as content:
                        _check_header(member, content)
                named = {member.filename.removesuffix(".npy"): member for member in members}
                return {name: _read(archive, member) for name, member in named.items() if only is None or name in only}
    except FileFormatError:
        raise
    except OSError as error:
        raise FileFormatError(error.strerror or str(error)) from error
    except Exception as error:  # a damaged archive raises whatever zipfile, zlib and NumPy come upon
        raise FileFormatError(str(error)) from error


def check_size(name: str, arrays: Mapping[str, Any], largest: int) -> None:
    """Refuse arrays that could be written, but not read again.

    Args:
        name: What they are, for the error.
        arrays: The arrays by name.
        largest: How many bytes are read again.

    Raises:
        ParameterError: If they have more bytes together.
    """
    size = sum(np.asarray(value).nbytes + _LARGEST_HEADER for value in arrays.values())
    if size > largest:
        raise ParameterError(name, f"{size} bytes of arrays", f"of at most {largest} bytes, the most that is read again")


def _check_end(file: IO[bytes]) -> None:
    """Refuse what does not end as NumPy ends an archive, or has a long list of members, before that list is read."""
    size = file.seek(0, 2)
    file.seek(max(0, size - _END_SIZE - _END_64_SIZE))
    end = file.read()
    last = end[-_END_SIZE:]
    if size < _END_SIZE or last[:4] != _END or last[-2:] != b"\0\0":
        raise FileFormatError("it is no NPZ archive")
    count, listed = int.from_bytes(last[10:12], "little"), int.from_bytes(last[12:16], "little")
    if end[:4] == _END_64 or count > _MOST_ARRAYS or listed > _LARGEST_DIRECTORY:
        raise FileFormatError(f"it has more than {_MOST_ARRAYS} arrays, or is too large")
    file.seek(0)


def _check_members(members: list[zipfile.ZipInfo], largest: int) -> None:
    """Refuse members that no array of ours makes, by what the archive says of them."""
    names = [member.filename for member in members]
    for member in members:
        if not _NAME.fullmatch(member.filename) or names.count(member.filename) > 1:
            raise FileFormatError(f"it has a member called {member.filename[:60]!r}, or two; arrays with names are required")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or member.flag_bits & 1:
            raise FileFormatError(f"{member.filename} is encrypted, or packed otherwise than by deflation")
    size = sum(member.file_size for member in members)
    if size > largest:
        raise FileFormatError(f"its arrays have {size} bytes; at most {largest} are read")


def _check_header(member: zipfile.ZipInfo, content: IO[bytes]) -> None:
    """Refuse an array that is not as long as its member, or is of a kind that no result has."""
    version = np.lib.format.read_magic(content)
    if version not in ((1, 0), (2, 0)):
        raise FileFormatError(f"{member.filename} is in version {version} of NPY; 1.0 and 2.0 are known")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(content, max_header_size=_LARGEST_HEADER)
    if dtype.kind not in _KINDS or dtype.hasobject or not dtype.itemsize:  # any number of empty texts has no bytes
        raise FileFormatError(f"{member.filename} holds {dtype}; numbers, truth values or texts are required")
    if min(shape, default=0) < 0 or content.tell() + math.prod(shape) * dtype.itemsize != member.file_size:
        raise FileFormatError(f"{member.filename} has not the size of an array of shape {shape} of {dtype}")


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """Unpack an array; the archive checks its sum at the end."""
    with archive.open(member) as content:
        made = np.lib.format.read_array(content, allow_pickle=False, max_header_size=_LARGEST_HEADER)
        if content.read(1):
            raise FileFormatError(f"{member.filename} goes on after its array")
        return np.asarray(made)
