"""Grids of target positions: a plane through the axis of motor 1, or a box around the base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, increasing, positive_integer, positive_number, read_only


@dataclass(frozen=True, eq=False)
class TargetGrid:
    """Target positions at all combinations of three coordinates, the last one fastest.

    Raises:
        ParameterError: If a list of coordinates is empty, not finite, or does not increase.
    """

    x: FloatArray
    """First coordinates, shape (nx,) [m]; in a plane the distance from the axis of motor 1."""
    y: FloatArray
    """Second coordinates, shape (ny,) [m]; in a plane only 0."""
    z: FloatArray
    """Heights, shape (nz,) [m]."""

    def __post_init__(self) -> None:
        """Check the coordinates and keep read-only copies."""
        for name in ("x", "y", "z"):
            values = increasing(name, finite_array(name, getattr(self, name), (None,), "m"), "m")
            positive_integer(f"number of coordinates {name}", len(values), 100_000)
            object.__setattr__(self, name, read_only(values))

    @classmethod
    def plane(cls, reach: Any, cells: Any) -> TargetGrid:
        """Centres of square cells in the half plane y = 0, x > 0: radius by height.

        An arm whose motor 1 turns about the vertical reaches the same in every such half plane under vertical loads.

        Args:
            reach: Radius of the plane, and half its height [m].
            cells: Number of cells along the radius; there are twice as many along the height.

        Returns:
            The grid.

        Raises:
            ParameterError: If an argument is not positive.
        """
        across = _centres(positive_number("reach", reach, "m"), positive_integer("cells", cells, 10_000))
        return cls(across[len(across) // 2 :], np.zeros(1), across)

    @classmethod
    def box(cls, reach: Any, cells: Any) -> TargetGrid:
        """Centres of cubic cells in a box around the base.

        Args:
            reach: Half the width of the box [m].
            cells: Number of cells along half the width.

        Returns:
            The grid.

        Raises:
            ParameterError: If an argument is not positive.
        """
        across = _centres(positive_number("reach", reach, "m"), positive_integer("cells", cells, 500))
        return cls(across, across, across)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of coordinates along each axis."""
        return len(self.x), len(self.y), len(self.z)

    @property
    def targets(self) -> FloatArray:
        """All target positions, shape (nx * ny * nz, 3) [m]."""
        return np.stack(np.meshgrid(self.x, self.y, self.z, indexing="ij"), axis=-1).reshape(-1, 3)


def _centres(reach: float, cells: int) -> FloatArray:
    """Centres of `2 * cells` cells between `-reach` and `reach`; none is zero, and they are exactly symmetric."""
    half = (np.arange(cells) + 0.5) * (reach / cells)
    return np.concatenate([-half[::-1], half])
