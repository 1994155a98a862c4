"""Reading of files that somebody else made: never more than a limit, whatever the file system says of their size.

The size that a file system tells is none for devices, pipes and files of the kernel, and may have grown since it was told.
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
    """The content of a file.

    Args:
        path: The file. Of a pipe, what is written to it until it is closed; one that nobody writes to is empty.
        largest: How many bytes it may have.

    Returns:
        The bytes.

    Raises:
        FileFormatError: If the file cannot be read, or is larger.
    """
    parts, size = [], 0
    with opened(path) as file:
        while part := file.read(min(_PART, largest + 1 - size)):
            parts.append(part)
            size += len(part)
            if size > largest:
                raise FileFormatError(f"{path} has more than {largest} bytes, which is the most that is read")
    return b"".join(parts)


def read_text(path: Path, largest: int) -> str:
    """The text of a file in UTF-8, with or without a byte order mark.

    Args:
        path: The file.
        largest: How many bytes it may have.

    Returns:
        The text.

    Raises:
        FileFormatError: If the file cannot be read, is larger, or is no UTF-8.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is no text in UTF-8: {error}") from error


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for reading; what goes wrong with it is an error of ours.

    Args:
        path: The file.

    Yields:
        The binary file.

    Raises:
        FileFormatError: If it cannot be opened or read, e.g. because it is a folder.
    """
    try:
        with open(path, "rb", opener=_open) as file:
            yield file
    except FileFormatError:
        raise
    except OSError as error:
        raise FileFormatError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:  # a name with a NUL in it, or text that is no UTF-8
        raise FileFormatError(f"cannot read {path}: {error}") from error


def _open(name: str, flags: int) -> int:
    """Open without waiting for somebody to write: a pipe that nobody has open is empty."""
    descriptor = os.open(name, flags | getattr(os, "O_NONBLOCK", 0))
    os.set_blocking(descriptor, True)
    return descriptor
