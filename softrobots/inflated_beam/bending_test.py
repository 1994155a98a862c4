"""Bending test of a clamped inflated link, [Troise 2021] section 3: from probe and load cell to hinge angle and moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, common_shape, finite_array, non_negative_number, positive_number, refuse_where
from softrobots.core.errors import ParameterError


@dataclass(frozen=True, kw_only=True)
class BendingTest:
    r"""Geometry of a probe that pushes a clamped link, orthogonally to its axis at rest.

    The link is the pseudo-rigid body of [Troise 2021] Figure 2: rigid on both sides of its hinge at `l1`. The probe moves on a
    straight line at the distance `h` from the clamp and slides along the link without friction. With `a = h - l1`, the distance
    `c` of the probe's centre from the axis of the link, and the hinge angle :math:`\theta`, the centre has moved by

    .. math:: v = a \tan\theta - c \left( 1 / \cos\theta - 1 \right)

    and a load cell along the line reads the force `F` that carries the moment, by virtual work,

    .. math:: \tau = F \, dv/d\theta = F \left( a - c \sin\theta \right) / \cos^2\theta

    The paper evaluates both for small angles, :math:`\theta = v / a` and :math:`\tau = F a`, see `small_angles`; for its
    prototype, pushed 1.6 times as far as the knee with `c` = 65 mm, that changes fitted stiffnesses by up to 0.8 % and
    plateaus by up to 0.6 %. For a probe fixed to a point of the link, :math:`v = a \sin\theta` and
    :math:`\tau = F a \cos\theta`, they change by up to 0.5 % and 2.0 %.

    Raises:
        ParameterError: If a number is out of range.
    """

    probe_distance: float = 0.5
    """Distance `h` of the probe's line from the clamp [m]. Troise 2021, section 4."""
    hinge_offset: float = 0.03
    """Distance `l1` of the hinge from the clamp [m], below `probe_distance`. Troise 2021, section 4."""
    offset: float = 0.0
    """Distance `c` of the probe's centre from the axis of the link [m]: radius of the link and of the probe's ball together;
    below `h - l1`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "probe_distance", positive_number("probe_distance", self.probe_distance, "m"))
        for name in ("hinge_offset", "offset"):
            object.__setattr__(self, name, non_negative_number(name, getattr(self, name), "m"))
        if self.hinge_offset >= self.probe_distance:
            raise ParameterError("hinge_offset", self.hinge_offset, f"below the distance of the probe, {self.probe_distance} m")
        if self.offset >= self.arm:
            raise ParameterError("offset", self.offset, f"below the distance of the probe from the hinge, {self.arm} m")

    @property
    def arm(self) -> float:
        """Distance of the probe's line from the hinge, `a = h - l1` [m]."""
        return self.probe_distance - self.hinge_offset

    def displacement(self, angle: Any) -> Any:
        """Return the displacement of the probe at a hinge angle.

        Args:
            angle: Hinge angles [rad], any shape, within +-pi/2 (both excluded).

        Returns:
            Displacements [m].

        Raises:
            ParameterError: If an angle is not finite or out of range.
        """
        theta = _bent(angle)
        return self.arm * np.tan(theta) - self.offset * (1.0 / np.cos(theta) - 1.0)

    def angle(self, displacement: Any) -> Any:
        """Return the hinge angle at a displacement of the probe: the inverse of `displacement`.

        Args:
            displacement: Displacements [m], any shape.

        Returns:
            Angles [rad].

        Raises:
            ParameterError: If a number is not finite.
        """
        centre = finite_array("displacement", displacement, None, "m") - self.offset  # from the axis at rest
        return np.arctan2(centre, self.arm) + np.arcsin(self.offset / np.hypot(self.arm, centre))

    def contact(self, angle: Any) -> Any:
        """Return the distance of the contact point from the hinge along the bent axis: `a / cos(angle) - c tan(angle)`.

        Args:
            angle: Hinge angles [rad], any shape, within +-pi/2 (both excluded).

        Returns:
            Distances [m].

        Raises:
            ParameterError: If an angle is not finite or out of range.
        """
        theta = _bent(angle)
        return (self.arm - self.offset * np.sin(theta)) / np.cos(theta)

    def moment(self, displacement: Any, force: Any) -> Any:
        """Return the moment at the hinge from displacement and force.

        Args:
            displacement: Displacements [m], any shape.
            force: Forces on the link along the probe's line [N], a shape that broadcasts with it.

        Returns:
            Moments [N m].

        Raises:
            ParameterError: If a number is not finite or the shapes do not broadcast.
        """
        theta, loads = self.angle(displacement), finite_array("force", force, None, "N")
        common_shape("force", theta.shape, loads.shape)
        return loads * (self.arm - self.offset * np.sin(theta)) / np.cos(theta) ** 2

    def small_angles(self, displacement: Any, force: Any) -> tuple[Any, Any]:
        """Return hinge angle `v / a` and moment `F a`, the paper's evaluation.

        Args:
            displacement: Displacements [m], any shape.
            force: Forces on the link along the probe's line [N], a shape that broadcasts with it.

        Returns:
            Angles [rad], shape of `displacement`, and moments [N m], shape of `force`.

        Raises:
            ParameterError: If a number is not finite or the shapes do not broadcast.
        """
        moved, loads = finite_array("displacement", displacement, None, "m"), finite_array("force", force, None, "N")
        common_shape("force", moved.shape, loads.shape)
        return moved / self.arm, self.arm * loads


def _bent(value: Any) -> FloatArray:
    angles = finite_array("angle", value, None, "rad")
    refuse_where("angle", value, np.abs(angles) >= 0.5 * np.pi, "within +-pi/2 rad, both excluded")
    return angles
