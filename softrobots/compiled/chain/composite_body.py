"""Rigid bodies that move as one, traced or of plain numbers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Vector, outer
from softrobots.compiled.trace.expressions import Scalar


class CompositeBody(NamedTuple):
    """A rigid body, or several that move as one, seen from a frame."""

    mass: Scalar
    """Mass [kg]."""
    moment: Vector
    """First moment, shape (3,) [kg m]."""
    inertia: Any
    """Rotational inertia about the origin, shape (3, 3) [kg m^2]."""

    def __add__(self, other: Any) -> CompositeBody:
        return CompositeBody(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)

    def seen_from(self, axes: Any, origin: Vector) -> CompositeBody:
        """Return the bodies in the frame in which theirs has given axes, shape (3, 3), and origin, shape (3,) [m].

        With `c` the first moment and `p` the origin, `I' = R I R^T - p^ c^ - c^ p^ - m p^ p^`, where `v^ w = v x w`.
        """
        moment, inertia = axes @ self.moment, axes @ self.inertia @ axes.T
        shifted = 2.0 * (origin @ moment) + self.mass * (origin @ origin)
        mixed = outer(origin, moment + origin * (self.mass * 0.5))
        inertia = inertia + np.eye(3) * shifted - mixed - mixed.T
        return CompositeBody(self.mass, moment + origin * self.mass, inertia)
