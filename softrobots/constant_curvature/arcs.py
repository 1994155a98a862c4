"""Arc parameters of a segment of constant curvature, and its section coordinates (bending vector and length).

A segment is an arc of a circle: backbone length `l`, bending angle `theta` and azimuth `alpha` of the bending plane, measured
from x towards y. The backbone starts at the base along +z. The polar pair `(theta, alpha)` is not differentiable at the
straight configuration; the bending vector `theta (-sin alpha, cos alpha)` is, and all derivatives use it.

References:
    [PCC paper]: the kinematic model of a two-segment continuum robot with three pneumatic muscles a segment. Its figures 3 to 5
        draw the azimuth 0 in the y-z plane; its formula (9) puts it in the x-z plane, which holds here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, common_shape, finite_array, instance_of, read_only
from softrobots.core.errors import ParameterError


@dataclass(frozen=True, eq=False)
class Arc:
    """Parameters of one arc, or of several: three read-only arrays of one shape.

    Numbers and arrays are accepted; they are broadcast to their common shape.

    Raises:
        ParameterError: If a number is not finite, a length or a bending angle is negative, or the shapes do not broadcast.
    """

    length: FloatArray
    """Length `l` of the backbone [m], zero or positive."""
    bending: FloatArray
    """Angle `theta` between the tangents at both ends [rad], zero or positive."""
    azimuth: FloatArray
    """Direction `alpha` in which the tip leans, from x towards y [rad]."""

    def __post_init__(self) -> None:
        """Check, broadcast and freeze the three arrays."""
        length = finite_array("length", self.length, None, "m")
        bending = finite_array("bending", self.bending, None, "rad")
        azimuth = finite_array("azimuth", self.azimuth, None, "rad")
        for name, values in (("length", length), ("bending", bending)):
            if np.any(values < 0.0):
                raise ParameterError(name, values, "zero or positive")
        shape = common_shape("azimuth", length.shape, bending.shape, azimuth.shape)
        for name, values in (("length", length), ("bending", bending), ("azimuth", azimuth)):
            object.__setattr__(self, name, read_only(np.array(np.broadcast_to(values, shape))))

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the three arrays; () for one arc."""
        return self.length.shape


def strains_from_arc(arc: Arc) -> FloatArray:
    """Return the section coordinates of an arc: its strains integrated over the segment.

    `(kx h, ky h, tau h, stretch h) = (-theta sin(alpha), theta cos(alpha), 0, l)` with the rest length `h`: the bending vector,
    which is the rotation vector from base to tip in base axes, no twist, and the backbone length. The segment is the screw
    motion `exp([kx h, ky h, 0; 0, 0, l])`.

    Args:
        arc: Arc of shape (...).

    Returns:
        Shape (..., 4) [rad, rad, rad, m].

    Raises:
        ParameterError: If `arc` is not an `Arc`.
    """
    arc = checked_arc(arc)
    x = -arc.bending * np.sin(arc.azimuth)
    y = arc.bending * np.cos(arc.azimuth)
    return np.stack([x, y, np.zeros_like(x), arc.length], axis=-1)


def arc_from_strains(strains: Any) -> Arc:
    """Return the arc of the section coordinates `(kx h, ky h, tau h, stretch h)`; inverse of `strains_from_arc`.

    `theta = hypot(kx h, ky h)` and `alpha = atan2(-kx h, ky h)`, in (-pi, pi]; 0 when straight.

    Args:
        strains: Shape (..., 4) [rad, rad, rad, m]; twist zero, length zero or positive.

    Returns:
        Arc of shape (...).

    Raises:
        ParameterError: If the shape is not (..., 4), a number is not finite, a twist is not zero (an arc has none), or a length
            is negative.
    """
    strains = checked_strains(strains)
    bending = np.hypot(strains[..., 0], strains[..., 1])
    azimuth = np.arctan2(0.0 - strains[..., 0], strains[..., 1])  # a negative zero would give -pi instead of pi
    return Arc(strains[..., 3], bending, np.where(bending > 0.0, azimuth, 0.0))


def checked_strains(strains: Any) -> FloatArray:
    """Return section coordinates without twist, shape (..., 4), or raise ParameterError."""
    checked = finite_array("strains", strains, None)
    if checked.ndim == 0 or checked.shape[-1] != 4:
        raise ParameterError("strains", strains, f"of shape (..., 4) (it has shape {checked.shape})")
    if np.any(checked[..., 2] != 0.0):
        raise ParameterError("strains", strains, "without twist: zero in the third column")
    if np.any(checked[..., 3] < 0.0):
        raise ParameterError("strains", strains, "of zero or positive length [m], the fourth column")
    return checked


def checked_arc(arc: Arc) -> Arc:
    """Return `arc` if it is an `Arc`, or raise ParameterError."""
    return instance_of("arc", arc, Arc, "an Arc")


def stack_arcs(arcs: Arc | Sequence[Arc]) -> Arc:
    """Return the arcs of a chain, one a segment from base to tip, as one `Arc` of shape (..., S), or raise ParameterError."""
    if isinstance(arcs, Arc):
        if not arcs.shape or arcs.shape[-1] == 0:
            raise ParameterError("arcs", arcs, f"an Arc whose last axis is the segment (it has shape {arcs.shape})")
        return arcs
    if not isinstance(arcs, Sequence) or not arcs or not all(isinstance(arc, Arc) for arc in arcs):
        raise ParameterError("arcs", arcs, "an Arc whose last axis is the segment, or a sequence of one Arc a segment")
    shape = common_shape("arcs", *(arc.shape for arc in arcs))
    columns = [(arc.length, arc.bending, arc.azimuth) for arc in arcs]
    return Arc(*(np.stack([np.broadcast_to(part, shape) for part in parts], axis=-1) for parts in zip(*columns, strict=True)))
