"""Poses of arcs and of chains of arcs, exact and smooth at the straight configuration.

There are two conventions for the frame at the tip of a segment, both with z along the backbone:

- "torsion_free": `R = Rz(alpha) Ry(theta) Rz(-alpha)`, the rotation by `theta` about `(-sin alpha, cos alpha, 0)`: that of the
  material of a body without twist.
- "bending_plane": `R = Rz(alpha) Ry(theta)`, [PCC paper] (13) and (14). Its x axis lies in the bending plane, so that it
  rotates about the backbone with the azimuth, even when straight; the next segment's azimuth is measured from that plane.

The tip of a chain of two segments differs by centimetres between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.constant_curvature.arcs import Arc, checked_arc, stack_arcs
from softrobots.core.checks import FloatArray, choice, finite_array
from softrobots.core.errors import ParameterError

FRAMES = ("torsion_free", "bending_plane")
OFFSET = np.pi / 3.0
"""Angle about the backbone from one segment of [PCC paper] to the next [rad]."""


def transform(arc: Arc, frame: str = "torsion_free") -> FloatArray:
    """Return the pose of the tip of an arc in its base, [PCC paper] (9), (13), (14).

    Position `r ((1 - cos theta) cos alpha, (1 - cos theta) sin alpha, sin theta)` with `r = l / theta`, computed without
    division by `theta`. The paper's (8) prints `r sin alpha` for the height; its (9) and (14) have `r sin theta`, as here. The
    rotation depends on the frame; see the module.

    Args:
        arc: Arc of shape (...).
        frame: "torsion_free" or "bending_plane" (the paper's).

    Returns:
        Transform from tip to base, shape (..., 4, 4), translation in metres.

    Raises:
        ParameterError: If `arc` is not an `Arc` or the frame is unknown.
    """
    arc = checked_arc(arc)
    choice("frame", frame, FRAMES)
    pose = np.zeros((*arc.shape, 4, 4))
    cosine, sine = np.cos(arc.azimuth), np.sin(arc.azimuth)
    bend, rise = np.sin(arc.bending), np.cos(arc.bending)
    if frame == "bending_plane":
        pose[..., 0, 0], pose[..., 0, 1] = cosine * rise, -sine
        pose[..., 1, 0], pose[..., 1, 1] = sine * rise, cosine
        pose[..., 2, 0] = -bend
    else:
        pose[..., 0, 0], pose[..., 1, 1] = rise * cosine**2 + sine**2, rise * sine**2 + cosine**2
        pose[..., 0, 1] = pose[..., 1, 0] = -2.0 * np.sin(arc.bending / 2.0) ** 2 * cosine * sine
        pose[..., 2, 0], pose[..., 2, 1] = -bend * cosine, -bend * sine
    pose[..., 0, 2], pose[..., 1, 2], pose[..., 2, 2] = bend * cosine, bend * sine, rise
    pose[..., :3, 3] = _tip(arc.length, arc.bending, arc.azimuth)
    pose[..., 3, 3] = 1.0
    return pose


def backbone(arc: Arc, s: Any) -> FloatArray:
    """Return points on the backbone of an arc: [PCC paper] (9) for a part of the arc.

    Args:
        arc: Arc of shape (...).
        s: Fractions of the length [-], within [0, 1], shape (m,).

    Returns:
        Points in the base frame [m], shape (..., m, 3).

    Raises:
        ParameterError: If `arc` is not an `Arc`, or `s` has another shape or is not within [0, 1].
    """
    arc = checked_arc(arc)
    fractions = finite_array("s", s, (None,), "-")
    if np.any((fractions < 0.0) | (fractions > 1.0)):
        raise ParameterError("s", s, "within [0, 1], fractions of the length")
    return _tip(arc.length[..., None] * fractions, arc.bending[..., None] * fractions, arc.azimuth[..., None])


def chain_transforms(arcs: Arc | Sequence[Arc], offsets: Any = None, frame: str = "torsion_free") -> FloatArray:
    """Return the poses of the ends of all segments of a chain: `T = prod_i Rz(offset_i) T_i` up to each segment.

    The product is the definition. The paper writes `T_2` with `alpha_2 + pi/3` instead, (16), which is the same in its
    bending-plane frame only. Its (16) prints wrong translations, and so does its closed form of the tip, (17)-(19): (19) ends
    in `cos theta_1 cos theta_2` instead of `cos theta_1 sin theta_2`. The product is correct.

    Args:
        arcs: One `Arc` a segment, base to tip, of shapes that broadcast to (...); or one `Arc` of shape (..., S). The azimuth
            of each is measured in the base frame of its own segment, after the offset.
        offsets: Angle about z before each segment [rad], shape (S,). Default: the paper's, 0 and then 60 degrees each.
        frame: "torsion_free" or "bending_plane" (the paper's).

    Returns:
        Transforms from the end of each segment to the base of the chain, shape (..., S, 4, 4), translation in metres.

    Raises:
        ParameterError: If `arcs` is neither, there is no segment, shapes or counts differ, an offset is not finite, or the
            frame is unknown.
    """
    return chain_frames(arcs, offsets, frame)[1]


def chain_transform(arcs: Arc | Sequence[Arc], offsets: Any = None, frame: str = "torsion_free") -> FloatArray:
    """Return the pose of the tip of a chain: the last of `chain_transforms`.

    Args:
        arcs: One `Arc` a segment, base to tip, or one `Arc` of shape (..., S).
        offsets: Angle about z before each segment [rad], shape (S,). Default: the paper's, 0 and then 60 degrees each.
        frame: "torsion_free" or "bending_plane" (the paper's).

    Returns:
        Transform from tip to base, shape (..., 4, 4), translation in metres.

    Raises:
        ParameterError: As `chain_transforms`.
    """
    return chain_transforms(arcs, offsets, frame)[..., -1, :, :]


def chain_frames(arcs: Arc | Sequence[Arc], offsets: Any, frame: str) -> tuple[FloatArray, FloatArray]:
    """Return the poses of the start (after the offset) and the end of all segments, (..., S, 4, 4); see `chain_transforms`."""
    local = transform(stack_arcs(arcs), frame)
    count = local.shape[-3]
    if offsets is None:
        offsets = (0.0,) + (OFFSET,) * (count - 1)
    angles = finite_array("offsets", offsets, (count,), "rad")
    turns = np.zeros((count, 4, 4)) + np.eye(4)
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0], turns[:, 0, 1] = np.sin(angles), -np.sin(angles)
    starts, ends = np.zeros_like(local), np.zeros_like(local)
    pose: FloatArray = np.eye(4)
    for segment in range(count):
        starts[..., segment, :, :] = pose @ turns[segment]
        pose = starts[..., segment, :, :] @ local[..., segment, :, :]
        ends[..., segment, :, :] = pose
    return starts, ends


def cardinal_sine(angle: FloatArray) -> FloatArray:
    """Return `sin(angle) / angle`, 1 at zero, exact to rounding everywhere."""
    return np.divide(np.sin(angle), angle, out=np.ones_like(angle), where=angle != 0.0)


def _tip(length: FloatArray, bending: FloatArray, azimuth: FloatArray) -> FloatArray:
    """Position of the tip [m], shape (..., 3); `(1 - cos theta) / theta = sin(theta/2) * sin(theta/2) / (theta/2)`."""
    aside = length * np.sin(bending / 2.0) * cardinal_sine(bending / 2.0)
    return np.stack([aside * np.cos(azimuth), aside * np.sin(azimuth), length * cardinal_sine(bending)], axis=-1)
