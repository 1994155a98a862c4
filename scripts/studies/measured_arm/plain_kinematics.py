"""The baseline without forces: segments of constant curvature whose tendons have exactly the commanded lengths."""

from __future__ import annotations

import numpy as np

from softrobots.constant_curvature import Arc, arc_from_muscles, chain_transform, muscles_from_arc
from softrobots.core.checks import FloatArray


def constant_curvature_tips(
    pulls: FloatArray, segment_lengths: FloatArray, distance: float, azimuths: FloatArray
) -> FloatArray:
    """Tips of segments of constant curvature and constant length whose tendons pull and push without giving way.

    From the base on: what the segments below take of a tendon's command is subtracted, the three tendons that end at a segment
    then give its bending. Their common change of length is left out; it would stretch or compress the backbone.

    Args:
        pulls: By how much each tendon is pulled in, tendons by segment, shape (n, 3 segments) [m].
        segment_lengths: Shape (segments,) [m].
        distance: Distance of the tendons from the backbone [m].
        azimuths: Azimuths of the tendons, from the x axis of the base, shape (segments, 3) [rad].

    Returns:
        Shape (n, 3) [m], in the frame of the base.
    """
    arcs: list[Arc] = []
    for number, (length, angles) in enumerate(zip(segment_lengths, azimuths, strict=True)):
        left = -pulls[:, 3 * number : 3 * number + 3]
        for arc, below in zip(arcs, segment_lengths, strict=False):
            left = left - (muscles_from_arc(arc, distance, angles) - below)
        bent = arc_from_muscles(length + left, distance, angles)
        arcs.append(Arc(np.full(len(pulls), length), bent.bending, bent.azimuth))
    return np.asarray(chain_transform(arcs, np.zeros(len(arcs)))[:, :3, 3])
