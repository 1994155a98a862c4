"""Joint springs: energy, torque and tangent of the elastic coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from softrobots.checks import FloatArray


@dataclass(frozen=True)
class LinearSprings:
    """Independent linear springs, `torque = stiffness (y - rest)`, [Troise 2021] (2).

    The residual, the tangent stiffness and the energy of `softrobots.elastostatics` use the three methods only; the paper's
    recursions, and the scales and first steps of the solvers, use `stiffness` and `rest`.
    """

    stiffness: FloatArray
    """Stiffness, shape (n,) [N m/rad or N/m]."""
    rest: FloatArray
    """Relaxed coordinates, shape (n,) [rad or m]."""

    def energy(self, y: FloatArray) -> float:
        """Elastic energy at coordinates `y`, shape (n,) [rad or m]: `sum k (y - rest)^2 / 2` [J]."""
        stretch = y - self.rest
        return 0.5 * float(self.stiffness @ (stretch * stretch))

    def torque(self, y: FloatArray) -> FloatArray:
        """Load carried at coordinates `y`, shape (n,) [N m or N]: the derivative of the energy."""
        return self.stiffness * (y - self.rest)

    def tangent(self, y: FloatArray) -> FloatArray:
        """Diagonal of the second derivative of the energy at `y`, shape (n,) [N m/rad or N/m]."""
        return self.stiffness
