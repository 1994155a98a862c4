"""Sections of a robot, of constant strain or lumped into joints, as its model knows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray


class SectionRow(NamedTuple):
    """A section, of constant strain or lumped."""

    name: str
    """Name of the section."""
    segment: int
    """Number of its segment, from 1."""
    length: float
    """Rest length [m]."""
    radius: float
    """Radius of the body, for pictures [m]."""
    hinge: float
    """Rest length of the piece from its start to its joints [m]."""
    bends: float
    """Rest length of the part of it that bends, between straight rigid ones; 0 if it is lumped [m]."""
    joint_names: tuple[str, ...]
    """Its joints."""
    rest_joints: FloatArray
    """Joint positions that the joint origins carry, shape (6,); zeros if lumped."""
    rest: FloatArray
    """Section coordinates where every joint is at zero, shape (4,) [rad, rad, rad, m]."""
    places: Mapping[str, int]
    """Place among the strains of each section coordinate that can change."""
    middle: tuple[float, float] = (0.0, 0.0)
    """Middle of the body beside the backbone, x and y in the section, for pictures [m]."""

    @property
    def lumped(self) -> bool:
        """Whether its coordinates are those of spring joints."""
        return self.bends == 0.0

    @property
    def origin(self) -> FloatArray:
        """Section coordinates where all its strains are zero, shape (4,) [rad, rad, rad, m]."""
        return self.rest if self.lumped else np.zeros(4)

    @property
    def to_joints(self) -> FloatArray:
        """Section coordinates at rest of the piece from its start to its joints, shape (4,)."""
        return self.rest * (self.hinge / self.length)


Segments = Mapping[int, Mapping[str, Sequence[int]]]
"""By segment and section coordinate (`strain_chain.STRAINS`), the places of that coordinate among the strains."""


def places_by_segment(rows: Sequence[SectionRow]) -> Segments:
    """Return the places of the section coordinates of each segment."""
    segments: dict[int, dict[str, list[int]]] = {}
    for row in rows:
        for name, place in row.places.items():
            segments.setdefault(row.segment, {}).setdefault(name, []).append(place)
    return segments
