r"""Shape error of a tube that is pinched at discrete places: a chain of screw motions against the smooth helix.

Between the pinches the tube is straight, contraction 1; at a pinch the contraction is 0, in the limit. The line opposite the
actuator is not wrinkled: it keeps its length and has no kink. So the pieces are joined by the frames of this *outer* path, x
along its normal, towards the actuator. With (15) of [Blumenschein 2018] each piece is a screw motion:

.. math:: \text{between:}\; \kappa_o = \frac{1 - \cos 2\theta}{D},\; \tau_o = \frac{\sin 2\theta}{D}, \qquad
   \text{pinch:}\; \kappa_o = \frac1D,\; \tau_o = 0

over the lengths :math:`\lambda d` and :math:`(1 - \lambda) d`. As (15) is linear in the contraction, their mean is the
curvature and torsion of the smooth helix, and the tube tends to it as `d` goes to 0. The centre line is `D/2` along the normal:
straight between, an arc of the radius `D/2` in a pinch. All of this is ours.

Joined by the frames of the centre line instead, the same pieces would tend to another helix, whose rise is an eighth too small
at contraction 0.66 and 5 degrees: a pinch folds square to the actuator, not to the tube, so the tangent of the centre line
rotates by `theta` about the normal where a pinch begins, and back where it ends.

The errors of radius and rise of the helix through the periods fall with the square of the spacing; so do those of the ends of
the periods, if the tube starts with half a straight piece. Within a period the centre line deviates to the side of the smooth
one by an amount proportional to the spacing, small with `theta` and 0 at angle 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softrobots.constant_curvature.screws import Screw
from softrobots.core.checks import FloatArray, positive_integer, read_only
from softrobots.core.summary import Summarised
from softrobots.helix.paths import actuator_curvature_torsion
from softrobots.helix.pattern import Pattern, checked_pattern
from softrobots.helix.shapes import length_ratio, turning_sign

_MOST_POINTS = 500_000


class DiscreteCentreLine(NamedTuple):
    """Centre line of a pinched tube, m points from base to tip; read-only arrays."""

    points: FloatArray
    """Positions in the frame of the base of the smooth helix: z along its centre line, x towards its axis, shape (m, 3) [m]."""
    centre_arc: FloatArray
    """Length of this centre line up to each point, shape (m,) [m]."""
    line_arc: FloatArray
    """Arc length along the uninflated actuator line of the corresponding point of the smooth helix, shape (m,) [m].

    Ends of periods correspond as material points, the points between them by equal shares of the centre line.
    """


@dataclass(frozen=True, repr=False)
class ShapeError(Summarised):
    """Deviation of a pinched tube from the smooth helix."""

    largest: float
    """Largest distance of corresponding points of the centre lines, with the outer lines starting in the same frame [m]."""
    rms: float
    """Root mean square of these distances over the length [m]."""
    tip: float
    """Distance at the tip [m]."""
    largest_aligned: float
    """Largest distance after the rigid motion that minimises `rms_aligned` (Kabsch) [m]."""
    rms_aligned: float
    """Root mean square distance after that motion [m]."""
    centre_radius: float
    """Mean distance of the centre line from the axis of the helix through the periods [m]."""
    pitch: float
    """Rise per turn angle of that helix, exact [m/rad]."""
    centre_radius_error: float
    """`centre_radius` minus that of the smooth helix [m]."""
    turn_height_error: float
    """Rise of a turn minus that of the smooth helix [m]."""


def discrete_centre_line(pattern: Pattern, samples: int = 8) -> DiscreteCentreLine:
    """Return the centre line of the pinched tube, composed of exact screw motions; see the module.

    Args:
        pattern: The plan.
        samples: Number of points on each straight piece and in each pinch; a period has three such pieces.

    Returns:
        The centre line.

    Raises:
        ParameterError: If `pattern` is not a `Pattern`, or `samples` is not a positive integer or gives more than 500000
            points.
    """
    plan = checked_pattern(pattern)
    most = max(_MOST_POINTS // (3 * plan.count), 1)
    share = np.arange(1, positive_integer("samples", samples, most) + 1) / samples
    poses, lengths = _period(plan, share)
    pose, middle = _outer_in_base(plan), np.array([0.5 * plan.diameter, 0.0, 0.0, 1.0])
    points, arcs, matched = [(pose @ middle)[None]], [np.zeros(1)], [np.zeros(1)]
    for number in range(plan.count):
        points.append((pose @ poses) @ middle)
        arcs.append(arcs[-1][-1] + lengths)
        matched.append(plan.spacing * (number + lengths / lengths[-1]))
        pose = pose @ poses[-1]
    return DiscreteCentreLine(*(read_only(np.concatenate(values)) for values in ([p[:, :3] for p in points], arcs, matched)))


def shape_error(pattern: Pattern, samples: int = 8) -> ShapeError:
    """Compare the pinched tube with the smooth helix; see the module.

    Args:
        pattern: The plan.
        samples: Number of points on each straight piece and in each pinch.

    Returns:
        Distances of the centre lines, and errors of radius and rise.

    Raises:
        ParameterError: As in `discrete_centre_line`.
    """
    plan, shape, line = checked_pattern(pattern), pattern.shape, discrete_centre_line(pattern, samples)
    smooth = _smooth(plan, line.line_arc)
    steps = np.diff(line.centre_arc)
    weights = 0.5 * (np.append(0.0, steps) + np.append(steps, 0.0)) / line.centre_arc[-1]
    distances = np.linalg.norm(line.points - smooth, axis=-1)
    aligned_distances = np.linalg.norm(_aligned(line.points, smooth, weights) - smooth, axis=-1)
    radius, pitch = _helix_of_periods(plan, samples)
    return ShapeError(
        largest=float(distances.max()),
        rms=float(np.sqrt(weights @ distances**2)),
        tip=float(distances[-1]),
        largest_aligned=float(aligned_distances.max()),
        rms_aligned=float(np.sqrt(weights @ aligned_distances**2)),
        centre_radius=radius,
        pitch=pitch,
        centre_radius_error=radius - float(shape.centre_radius),
        turn_height_error=2.0 * np.pi * (pitch - float(shape.pitch)),
    )


def _period(plan: Pattern, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Poses along the outer path of a period, and lengths of the centre line there."""
    curvature, torsion = (
        float(value) for value in actuator_curvature_torsion(1.0, plan.angle, plan.diameter, "outer", plan.handedness)
    )
    straight, stays = 0.5 * plan.remaining_length * share, 0.5 * np.cos(plan.angle) * plan.remaining_length * share
    half = _motions(curvature, torsion, straight)
    bent = half[-1] @ _motions(1.0 / plan.diameter, 0.0, plan.pinch_length * share)
    pinched = stays[-1] + 0.5 * plan.pinch_length * share
    return np.concatenate([half, bent, bent[-1] @ half]), np.concatenate([stays, pinched, pinched[-1] + stays])


def _motions(curvature: float, torsion: float, lengths: FloatArray) -> FloatArray:
    """Poses along a path of constant curvature and torsion, shape (m, 4, 4)."""
    zero = np.zeros_like(lengths)
    return Screw(np.stack([zero, curvature * lengths, torsion * lengths, zero], axis=-1), lengths).pose()


def _outer_in_base(plan: Pattern) -> FloatArray:
    """Pose of the outer path at the base in the frame of the smooth centre line: rotation by `arg(1 + zeta)` about x."""
    contraction, twice = plan.contraction, 2.0 * plan.angle
    turn = turning_sign(plan.handedness) * np.arctan2(contraction * np.sin(twice), 1.0 + contraction * np.cos(twice))
    pose = np.eye(4)
    pose[1:3, 1:3] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    pose[0, 3] = -0.5 * plan.diameter
    return pose


def _smooth(plan: Pattern, arc: FloatArray) -> FloatArray:
    """Points of the smooth centre line in the frame of its base, by arc length of the actuator line."""
    contraction, angle = np.asarray(plan.contraction), np.asarray(plan.angle)
    curvature, torsion = actuator_curvature_torsion(contraction, angle, plan.diameter, "centre", plan.handedness)
    return _motions(float(curvature), float(torsion), 0.5 * length_ratio(contraction, angle) * arc)[:, :3, 3]


def _aligned(moved: FloatArray, reference: FloatArray, weights: FloatArray) -> FloatArray:
    """Points after the rigid motion onto others with the least mean square distance (Kabsch)."""
    centre, target = weights @ moved, weights @ reference
    u, _, vt = np.linalg.svd((weights[:, None] * (moved - centre)).T @ (reference - target))
    u[:, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((moved - centre) @ (u @ vt) + target)


def _helix_of_periods(plan: Pattern, samples: int) -> tuple[float, float]:
    """Mean centre radius and pitch of the helix generated by the screw motion of a period."""
    poses, lengths = _period(plan, np.arange(1, samples + 1) / samples)
    turn, shift = poses[-1, :3, :3], poses[-1, :3, 3]
    axis = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = float(np.linalg.norm(axis))
    angle, axis = float(np.arctan2(sine, 0.5 * (np.trace(turn) - 1.0))), axis / sine
    rise = float(axis @ shift)
    across = shift - rise * axis
    foot = 0.5 * (across + np.cross(axis, across) / np.tan(0.5 * angle))  # on the axis of the screw
    start = np.eye(4)[None]
    centres = (np.concatenate([start, poses]) @ np.array([0.5 * plan.diameter, 0.0, 0.0, 1.0]))[:, :3] - foot
    distances = np.linalg.norm(centres - (centres @ axis)[:, None] * axis, axis=-1)
    steps = np.diff(lengths, prepend=0.0)
    return float(steps @ (0.5 * (distances[:-1] + distances[1:])) / lengths[-1]), abs(rise) / angle
