"""The readers of files that are tried, their valid files, and how these are damaged."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from studies.shared.checkout import test_support

data, descriptions, damages = (test_support(name) for name in ("hostile_data", "hostile_descriptions", "hostile"))


class Reader(NamedTuple):
    """A reader of files, and how it is tried."""

    corpus: Callable[[], list[bytes]]
    """Makes the valid files; every one must be read without an error."""
    damage: Callable[[bytes, np.random.Generator], bytes]
    """Makes a damaged file of a valid one."""
    read: Callable[[Path], object]
    """Reads a file. It raises a SoftRobotsError where it refuses one, and another exception where what it has read is wrong."""
    suffix: str
    """What the names of such files end with."""
    seconds: float = 1.0
    """CPU time that a file may take [s]."""
    megabytes: float = 200.0
    """Memory that it may take in addition [MB]."""


READERS: dict[str, Reader] = {
    "URDF": Reader(descriptions.urdf_corpus, damages.damaged_xml, descriptions.read_description, ".urdf"),
    "URDF text": Reader(descriptions.urdf_corpus, damages.damaged_xml, descriptions.read_text, ".txt"),
    "MJCF": Reader(descriptions.mjcf_corpus, damages.damaged_xml, descriptions.read_description, ".xml"),
    "SDF": Reader(descriptions.sdf_corpus, damages.damaged_xml, descriptions.read_description, ".sdf"),
    "world URDF": Reader(descriptions.world_corpus, damages.damaged_xml, descriptions.read_world, ".urdf"),
    "world MJCF": Reader(descriptions.mjcf_world_corpus, damages.damaged_xml, descriptions.read_world, ".xml"),
    "world SDF": Reader(descriptions.sdf_world_corpus, damages.damaged_xml, descriptions.read_world, ".sdf"),
    # A xacro file is a program, which ends after so many steps; the robot that others are mounted on goes through one, too.
    "xacro": Reader(descriptions.xacro_corpus, damages.damaged_xml, descriptions.read_xacro, ".xacro", 5.0, 300.0),
    "mount": Reader(descriptions.mounted_corpus, damages.damaged_xml, descriptions.read_mounted, ".urdf", 5.0, 300.0),
    "STL": Reader(descriptions.stl, damages.damaged_bytes, descriptions.read_mesh, ".stl"),
    "OBJ": Reader(descriptions.obj, damages.damaged_bytes, descriptions.read_mesh, ".obj"),
    "DAE": Reader(descriptions.dae, damages.damaged_xml, descriptions.read_mesh, ".dae"),
    **{name: Reader(*parts) for name, parts in data.READERS.items()},
}
"""Every reader of files, by name."""


def case(reader: str, number: int, seed: int) -> bytes:
    """The file of a case; the first cases are the valid files themselves.

    Args:
        reader: Name in `READERS`.
        number: Number of the case, from 0.
        seed: Seed of the campaign.
    """
    valid = READERS[reader].corpus()
    if number < len(valid):
        return valid[number]
    rng = np.random.default_rng([seed, zlib.crc32(reader.encode()), number])
    return READERS[reader].damage(valid[int(rng.integers(len(valid)))], rng)
