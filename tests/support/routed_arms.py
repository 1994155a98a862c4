"""Arms with actuators on any routes, and the lengths of those routes written anew."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.special import roots_legendre

import softrobots as sr

Piece = tuple[int, Sequence[float], Sequence[float], Sequence[float]]
"""Segment, places along it [m], distances [m], azimuths [rad]."""


def actuator(name: str, *pieces: Piece, **attributes: object) -> str:
    """The tag of an actuator."""
    words = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    tables = [(segment, *(" ".join(map(repr, map(float, row))) for row in rows)) for segment, *rows in pieces]
    routes = "".join(
        f'<softrobots:route segment="{segment}" at="{at}" distance="{distance}" azimuth="{azimuth}"/>'
        for segment, at, distance, azimuth in tables
    )
    return f'<softrobots:actuator name="{name}" {words}>{routes}</softrobots:actuator>'


def routed(*actuators: str, muscles: str | None = None, **fields: Any) -> sr.SoftModel:
    """An arm of the PCC family whose actuators are these."""
    return sr.load_model(_bare(**fields).replace("</robot>", "".join(actuators) + "</robot>"), muscles=muscles)


@cache
def _bare(**fields: Any) -> str:
    return sr.PccArm(muscle_azimuths=(), **fields).urdf()


def curve_length(pieces: Sequence[Piece], sections: Sequence[tuple[int, float]], z: np.ndarray) -> Any:
    """Length of a curve in a body by the norm of its tangent, also for complex strains.

    The tangent is that of a point fixed in the cross-section of a Cosserat rod: `nu e_z + (kx, ky, tau) x o + o'`.

    Args:
        pieces: The route.
        sections: Segment and rest length of each section [m].
        z: Bending about x and y, twist, elongation of each section, shape (n, 4).
    """
    nodes, weights = roots_legendre(40)
    total: Any = 0.0
    for segment, at, distances, azimuths in pieces:
        start = 0.0
        for (number, length), (a, b, t, e) in zip(sections, z, strict=True):
            if number != segment:
                continue
            ends = [max(at[0], start), *(s for s in at if start < s < start + length), min(at[-1], start + length)]
            for low, high in itertools.pairwise(ends):
                if high - low <= 0.0:
                    continue
                s = low + (high - low) * 0.5 * (nodes + 1.0)
                row = min(int(np.searchsorted(at, 0.5 * (low + high))), len(at) - 1)
                step = at[row] - at[row - 1]
                d_rate = (distances[row] - distances[row - 1]) / step
                phi_rate = (azimuths[row] - azimuths[row - 1]) / step
                d = distances[row - 1] + (s - at[row - 1]) * d_rate
                phi = azimuths[row - 1] + (s - at[row - 1]) * phi_rate
                x, y = d * np.cos(phi), d * np.sin(phi)
                x_rate = d_rate * np.cos(phi) - y * phi_rate
                y_rate = d_rate * np.sin(phi) + x * phi_rate
                kx, ky, twist = a / length, b / length, t / length
                tangent = (x_rate - twist * y, y_rate + twist * x, 1.0 + e / length + kx * y - ky * x)
                total = total + 0.5 * (high - low) * (weights @ np.sqrt(sum(part**2 for part in tangent)))
            start += length
    return total
