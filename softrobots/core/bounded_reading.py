"""Read untrusted files up to a size limit.

The limit does not rely on the size that the file system reports: for devices, pipes and files of the kernel there is none, and
a file may grow while it is read.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from softrobots.core.errors import FileFormatError

_PART = 1 << 20  # bytes read at a time


def read_bytes(path: Path, largest: int) -> bytes:
    """Return the content of a file of at most `largest` bytes; a pipe without a writer is empty, another is read to its end.

    Raises:
        FileFormatError: If the file cannot be read, or is larger.
    """
    parts, size = [], 0
    with opened(path) as file:
        while part := file.read(min(_PART, largest + 1 - size)):
            parts.append(part)
            size += len(part)
            if size > largest:
                raise FileFormatError(f"{path} has more than {largest} bytes; at most {largest} are read")
    return b"".join(parts)


def read_text(path: Path, largest: int) -> str:
    """Return the text of a UTF-8 file of at most `largest` bytes, with or without a byte order mark.

    Raises:
        FileFormatError: If the file cannot be read, is larger, or is not UTF-8.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not text in UTF-8: {error}") from error


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a binary file for reading, as a context manager that turns errors of the system into `FileFormatError`.

    Raises:
        FileFormatError: If it cannot be opened or read, e.g. because it is a folder.
    """
    try:
        with open(path, "rb", opener=_open) as file:
            yield file
    except FileFormatError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL in it, or text that is not UTF-8
        raise FileFormatError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from error


def _open(name: str, flags: int) -> int:
    """Opener that does not wait for a writer: a pipe without one is empty."""
    descriptor = os.open(name, flags | getattr(os, "O_NONBLOCK", 0))
    os.set_blocking(descriptor, True)
    return descriptor
