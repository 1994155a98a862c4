"""The generated URDF files of the project: whether they are what xacro makes of the robots today."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from softrobots.robots import ROBOTS


class GeneratedFile(NamedTuple):
    """A file, and what it should hold."""

    path: Path
    """Where it is, or would be."""
    content: bytes
    """What xacro generates."""
    up_to_date: bool
    """Whether it is there and holds that, byte for byte."""


def generated_files(folder: Path) -> Iterator[GeneratedFile]:
    """Compare the file of every robot of `ROBOTS` in a folder with what xacro generates, one after the other.

    Args:
        folder: The folder of the files `<robot>.urdf`.

    Raises:
        DescriptionError: If xacro refuses a robot.
    """
    for name, robot in ROBOTS.items():
        path, content = folder / f"{name}.urdf", robot().urdf().encode("utf-8")
        yield GeneratedFile(path, content, path.is_file() and path.read_bytes() == content)
