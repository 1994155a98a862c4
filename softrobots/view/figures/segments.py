"""Figure of segments of constant curvature in closed form: backbone, muscles, frame. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.constant_curvature import AZIMUTHS, Arc, transform
from softrobots.constant_curvature.arcs import stack_arcs
from softrobots.constant_curvature.poses import chain_frames
from softrobots.core.checks import finite_array, positive_array
from softrobots.core.errors import ParameterError
from softrobots.view.figures.canvas import COLOURS, LINES, equal_box, new_space

_POINTS = 41  # of a segment


def arm(
    arcs: Arc | Sequence[Arc], distance: Any = 0.04, azimuths: Any = AZIMUTHS, offsets: Any = None, frame: str = "torsion_free"
) -> Any:
    """Smooth backbone of a chain of segments with its muscles, the plates at the ends of segments, and the frame at the tip.

    A muscle runs parallel to the backbone, `distance` from it, in the direction that its azimuth has at the base of its
    segment; the body does not twist on the way, whatever the frame.

    Args:
        arcs: One `Arc` a segment, base to tip, or one `Arc` of shape (S,).
        distance: Distance of the muscles from the backbone [m], positive, one number or one a segment.
        azimuths: Azimuths of the muscles in the base frame of their segment [rad], shape (N,).
        offsets: Angle about z before each segment [rad], shape (S,). Default: the paper's, 0 and then 60 degrees each.
        frame: "torsion_free" or "bending_plane": in which frame one segment stands on the other.

    Returns:
        The figure.

    Raises:
        ParameterError: If the arcs are those of several chains, an argument is out of range, or shapes differ.
        MissingDependency: If matplotlib is not installed.
    """
    stacked = stack_arcs(arcs)
    if len(stacked.shape) != 1:
        raise ParameterError("arcs", arcs, f"those of one chain, shape (S,) (they have shape {stacked.shape})")
    apart = positive_array("distance", distance, "m")
    if apart.shape not in ((), (1,), stacked.shape):
        raise ParameterError("distance", distance, f"one number, or one for each of {stacked.shape[0]} segments")
    directions = finite_array("azimuths", azimuths, (None,), "rad")
    starts, ends = chain_frames(stacked, offsets, frame)
    figure, axes = new_space((7.0, 7.0), f"Constant curvature in closed form, {frame.replace('_', '-')} frames")
    share, drawn = np.linspace(0.0, 1.0, _POINTS), []
    for segment, reach in enumerate(np.broadcast_to(apart, stacked.shape)):
        first = segment == 0
        length, bending, azimuth = (part[segment] for part in (stacked.length, stacked.bending, stacked.azimuth))
        poses = starts[segment] @ transform(Arc(length * share, bending * share, azimuth))
        axes.plot(*poses[:, :3, 3].T, color="0.1", lw=3.0, label="backbone" if first else None)
        plate = reach * np.stack([np.cos(directions), np.sin(directions), np.zeros_like(directions)])
        muscles = poses[:, :3, 3, None] + poses[:, :3, :3] @ plate  # point, axis, muscle
        for number in range(len(directions)):
            style = {"color": COLOURS[number % len(COLOURS)], "ls": LINES[number % len(LINES)], "lw": 1.6}
            axes.plot(*muscles[:, :, number].T, label=f"muscle {number + 1}" if first else None, **style)
        around = np.append(np.argsort(np.mod(directions, 2.0 * np.pi)), np.argmin(np.mod(directions, 2.0 * np.pi)))
        for place in (0, -1):
            label = "ends of a segment" if first and place == 0 else None
            axes.plot(*muscles[place][:, around], color="0.45", lw=1.4, label=label)
        drawn += [poses[:, :3, 3], muscles.transpose(0, 2, 1).reshape(-1, 3)]
    points = np.concatenate(drawn)
    tip, size = ends[-1], 0.15 * float(np.ptp(points, axis=0).max())
    for axis, name in enumerate("xyz"):
        end = tip[:3, 3] + size * tip[:3, axis]
        axes.plot(*np.stack([tip[:3, 3], end]).T, color="0.1", lw=1.0)
        axes.text(*(end + 0.2 * size * tip[:3, axis]), name, fontsize=10, ha="center", va="center")
        points = np.vstack([points, end])
    equal_box(axes, points)
    axes.legend(loc="upper left", fontsize=9)
    return figure
