"""Where a camera is that sees everything, whatever the shape of the window."""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray

_FIELD = np.tan(0.5 * np.deg2rad(75.0))  # of meshcat's camera: height of the half picture at unit distance
WIDTH = 1.4
"""Width of a picture over its height in which `whole_view` has all; in narrower windows `fit.js` makes everything smaller."""
_FILLED = 0.9  # share of the picture that may be filled


def whole_view(points: FloatArray, away: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a camera that has all points in its picture.

    A point at depth `d` towards the camera and `u` across is in the picture of a camera at distance `D` if
    `u <= (D - d) tan(field / 2)`, so the nearest camera is at the largest `d + u / tan(field / 2)`, with the width of the
    picture for points beside.

    Args:
        points: Points, shape (n, 3) [m].
        away: Vector from the middle of the points to a camera that is near enough, shape (3,) [m], not vertical; the camera is
            in this direction, and farther where it must be.

    Returns:
        Its place and the point that it looks at, shape (3,) [m].
    """
    middle, distance = 0.5 * (points.min(axis=0) + points.max(axis=0)), float(np.linalg.norm(away))
    depth, wide, high = picture_axes(away) @ (points - middle).T
    needed = depth + np.maximum(np.abs(high), np.abs(wide) / WIDTH) / (_FIELD * _FILLED)
    return middle + max(distance, float(needed.max())) / distance * away, middle


def narrowest(points: FloatArray, eye: FloatArray, middle: FloatArray) -> float:
    """Return the least width over height of a picture of a camera of `whole_view` that has all points in it."""
    depth, wide, _ = picture_axes(eye - middle) @ (points - eye).T
    return float(np.max(np.abs(wide) / np.maximum(-depth, 1e-9)) / (_FIELD * _FILLED))


def picture_axes(away: FloatArray) -> FloatArray:
    """Return unit vectors towards a camera in a direction, shape (3,), not vertical, and across and up its picture, in rows."""
    back = away / np.linalg.norm(away)
    aside = np.cross((0.0, 0.0, 1.0), back) / np.linalg.norm(back[:2])
    return np.stack([back, aside, np.cross(back, aside)])


def box_corners(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the eight corners of a box between two of them, shape (3,) [m], shape (8, 3) [m]."""
    return np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
