r"""Whether a step may have led a robot through an obstacle that it touches neither before nor after.

A core that begins at a distance of at least its radius `r` from an obstacle is not beyond it after a motion, relative to the
obstacle, that is shorter than `r` and the radius `R` of a ball inside the obstacle. So in a step nothing may move by more than
a share of :math:`r + R`, or by more than the gap that there was before (conservative advancement: B. Mirtich, Impulse-based
Dynamic Simulation of Rigid Body Systems, thesis, Berkeley 1996). A straight way of that share whose ends are outside of a ball
of the radius :math:`r + R` is within it by less than :math:`0.008\,(r + R)`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from softrobots.environment.convex_mesh import Mesh, hull_of
from softrobots.environment.gaps import Gaps
from softrobots.environment.obstacles import Box, Capsule, Cylinder, Obstacle, Sphere

_SHARE = 0.25


def may_pass(
    before: Gaps, now: Gaps, obstacles: Iterable[Obstacle], near: Callable[[float], Gaps]
) -> tuple[int, int, float] | None:
    """Find what may have passed through an obstacle, or through the robot itself, on a straight way.

    One that grows cannot: it is on the way that it went.

    Args:
        before: The robot before the step.
        now: The robot, of as many capsules, and the obstacles after the step.
        obstacles: The obstacles.
        near: The candidates before the step, of gaps up to that given [m].

    Returns:
        Capsule, obstacle (their number, where it is the robot itself) and way [m] of what moves farthest of all that may have
        passed; None if nothing may.
    """
    radii, ends = now.capsule_radii, before.places.ends
    rooms = _SHARE * (np.array([inner_radius(one) for one in obstacles])[:, None] + radii)
    moves = now.transforms @ np.linalg.inv(before.transforms)  # of the obstacles
    carried = ends @ moves[:, :3, :3].swapaxes(1, 2)[:, None] + moves[:, None, None, :3, 3]
    ways = np.linalg.norm(now.places.ends - carried, axis=3).max(axis=2, initial=0.0)  # by obstacle and capsule
    if now.with_itself:  # as an obstacle that moves the other way
        way = np.linalg.norm(now.places.ends - ends, axis=2).max(axis=1, initial=0.0)
        ways, rooms = np.vstack([ways, way + way.max()]), np.vstack([rooms, _SHARE * (radii + radii.min())])
    far = ways > rooms
    if not far.any():
        return None
    candidates, gaps = near(float(ways[far].max())), np.full(len(ways), np.inf)
    np.minimum.at(gaps, np.minimum(candidates.obstacles, len(ways) - 1), candidates.values)
    passing = np.where(far & (ways > gaps[:, None]), ways, 0.0)
    obstacle, capsule = divmod(int(passing.argmax()), passing.shape[1])
    return (capsule, obstacle, float(passing.max())) if passing.any() else None


def inner_radius(obstacle: Obstacle) -> float:
    """Radius of a ball that is inside of an obstacle [m]; infinite in a half-space."""
    if isinstance(obstacle, Box):
        return 0.5 * float(obstacle.size.min())
    if isinstance(obstacle, Cylinder):
        return min(obstacle.radius, 0.5 * obstacle.length)
    if isinstance(obstacle, Mesh):
        hull = hull_of(obstacle.vertices.tobytes())
        return float((hull.offsets - hull.normals @ hull.corners.mean(axis=0)).min())
    return obstacle.radius if isinstance(obstacle, Sphere | Capsule) else np.inf
