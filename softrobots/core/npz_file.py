"""Read arrays from untrusted NPZ files: no pickle, and no more memory than a limit.

The directory of the archive is compared with the headers of its members before anything is unpacked, so that a small file
cannot fill the memory.
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
"""Default limit of the size of all arrays of a file together [bytes]."""

_MOST_ARRAYS = 64
_LARGEST_DIRECTORY = 65536  # bytes; the directory is the list of members at the end of an archive
_LARGEST_HEADER = 1000  # characters; headers of arrays without fields have about a hundred
_END, _END_64 = b"PK\x05\x06", b"PK\x06\x07"
_END_SIZE, _END_64_SIZE = 22, 20
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\.npy")
_KINDS = "biufU"  # booleans, integers, floats, text


def read_arrays(path: Path, *, only: Sequence[str] | None = None, largest: int | None = None) -> dict[str, NDArray[Any]]:
    """Read an NPZ file of numbers, booleans and text.

    Args:
        path: The file.
        only: Names of the arrays to read, as far as they are present; None for all.
        largest: Limit of the size of all arrays of the file together [bytes]; `LARGEST` by default.

    Returns:
        The arrays by name.

    Raises:
        FileFormatError: If the file cannot be read, is not an archive as NumPy writes it, is damaged, or contains objects
            (pickles) or more than `largest` bytes of arrays.
    """
    most = LARGEST if largest is None else largest
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise FileFormatError("it is not a file")
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
    except Exception as error:  # zipfile, zlib and NumPy raise many kinds of errors for a damaged archive
        raise FileFormatError(str(error)) from error


def check_size(arrays: Mapping[str, Any], largest: int) -> None:
    """Raise ParameterError for a result whose arrays together are larger than a reader takes [bytes]."""
    size = sum(np.asarray(value).nbytes + _LARGEST_HEADER for value in arrays.values())
    if size > largest:
        raise ParameterError("result", f"{size} bytes of arrays", f"of at most {largest} bytes, the most that is read again")


def _check_end(file: IO[bytes]) -> None:
    """Check the end of an archive, before the directory is read: as NumPy writes it, and of a short directory."""
    size = file.seek(0, 2)
    file.seek(max(0, size - _END_SIZE - _END_64_SIZE))
    end = file.read()
    last = end[-_END_SIZE:]
    if size < _END_SIZE or last[:4] != _END or last[-2:] != b"\0\0":
        raise FileFormatError("it is not an NPZ archive")
    count, listed = int.from_bytes(last[10:12], "little"), int.from_bytes(last[12:16], "little")
    if end[:4] == _END_64 or count > _MOST_ARRAYS or listed > _LARGEST_DIRECTORY:
        raise FileFormatError(f"it has more than {_MOST_ARRAYS} arrays, or is too large")
    file.seek(0)


def _check_members(members: list[zipfile.ZipInfo], largest: int) -> None:
    """Check names, compression and size of the members as stated in the directory."""
    names = [member.filename for member in members]
    for member in members:
        if not _NAME.fullmatch(member.filename) or names.count(member.filename) > 1:
            raise FileFormatError(f"its member {member.filename[:60]!r} is not an array, or occurs twice")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or member.flag_bits & 1:
            raise FileFormatError(f"{member.filename} is encrypted, or not compressed by deflation")
    size = sum(member.file_size for member in members)
    if size > largest:
        raise FileFormatError(f"its arrays have {size} bytes; at most {largest} are read")


def _check_header(member: zipfile.ZipInfo, content: IO[bytes]) -> None:
    """Check that the header of an array agrees with the size of its member, and its type."""
    version = np.lib.format.read_magic(content)
    if version not in ((1, 0), (2, 0)):
        raise FileFormatError(f"{member.filename} is in version {version} of NPY; 1.0 or 2.0 is required")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(content, max_header_size=_LARGEST_HEADER)
    if dtype.kind not in _KINDS or dtype.hasobject or not dtype.itemsize:  # empty texts take no bytes, however many
        raise FileFormatError(f"{member.filename} holds {dtype}; numbers, booleans or text are required")
    if min(shape, default=0) < 0 or content.tell() + math.prod(shape) * dtype.itemsize != member.file_size:
        raise FileFormatError(f"the size of {member.filename} is not that of an array of shape {shape} of {dtype}")


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """Unpack an array; zipfile compares the checksum at the end."""
    with archive.open(member) as content:
        array = np.lib.format.read_array(content, allow_pickle=False, max_header_size=_LARGEST_HEADER)
        if content.read(1):
            raise FileFormatError(f"{member.filename} continues after its array")
        return np.asarray(array)
