"""A round uniform rod of one material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RoundRod:
    """Its size and material.

    Attributes:
        length: [m].
        radius: [m].
        young: Young's modulus [Pa].
        density: [kg/m^3].
    """

    length: float
    radius: float
    young: float
    density: float

    @property
    def area(self) -> float:
        """[m^2]."""
        return float(np.pi * self.radius**2)

    @property
    def bending(self) -> float:
        """EI [N m^2]."""
        return self.young * self.area * self.radius**2 / 4.0
