"""Comparison of the generated URDF files of the project with what xacro generates from the robots."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from softrobots.robots import ROBOTS


class GeneratedFile(NamedTuple):
    """A file and its required content."""

    path: Path
    """Path of the file, which may not exist."""
    content: bytes
    """What xacro generates."""
    up_to_date: bool
    """Whether the file exists with this content, byte for byte."""


def generated_files(folder: Path) -> Iterator[GeneratedFile]:
    """Compare the file `<robot>.urdf` of every robot of `ROBOTS` in a folder with what xacro generates.

    Raises:
        DescriptionError: If xacro refuses a robot.
    """
    for name, robot in ROBOTS.items():
        path, content = folder / f"{name}.urdf", robot().urdf().encode("utf-8")
        yield GeneratedFile(path, content, path.is_file() and path.read_bytes() == content)
