r"""How far a tube that is pinched at some places is from the smooth helix.

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
turns by `theta` about the normal where a pinch begins, and back where it ends.

Radius and rise of the helix that the periods make are wrong by an amount that falls with the square of the spacing; so are the
ends of the periods, if the tube starts with half a straight piece. Within a period the centre line swings to the side of the
smooth one by an amount proportional to the spacing, small with `theta` and 0 at angle 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softrobots.constant_curvature.screws import Screw
from softrobots.core.checks import FloatArray, positive_integer, read_only
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
    """Arc length along the actuator line, before inflation, of the point of the smooth helix that is compared, shape (m,) [m].

    The ends of periods and plain pieces correspond by material; between them, equal shares of the centre line do.
    """


@dataclass(frozen=True)
class ShapeError:
    """How far a pinched tube is from the smooth helix that is wanted."""

    largest: float
    """Largest distance of corresponding points of the centre lines, if the outer lines start in the same frame [m]."""
    rms: float
    """Root of the mean square of these distances, over the length [m]."""
    tip: float
    """That distance at the tip [m]."""
    largest_aligned: float
    """Largest distance after the turn and shift that make `rms_aligned` smallest (Kabsch) [m]."""
    rms_aligned: float
    """Root of the mean square after it [m]."""
    centre_radius: float
    """Mean distance of the centre line from the axis of the helix that the periods make [m]; plain ends do not count."""
    pitch: float
    """Rise per turn angle of that helix, exact [m/rad]."""
    centre_radius_error: float
    """`centre_radius` less that of the smooth helix [m]."""
    turn_height_error: float
    """Rise of a turn less that of the smooth helix [m]."""


def discrete_centre_line(pattern: Pattern, samples: int = 8) -> DiscreteCentreLine:
    """Centre line of the pinched tube, composed of exact screw motions; see the module.

    Args:
        pattern: The plan.
        samples: Points on each straight piece and in each pinch; a period has three pieces.

    Returns:
        The centre line.

    Raises:
        ParameterError: If `pattern` is not a `Pattern`, or `samples` is not a positive integer or so large that there would be
            more than 500000 points.
    """
    plan = checked_pattern(pattern)
    most = max(_MOST_POINTS // (3 * plan.count), 1)
    share = np.arange(1, positive_integer("samples", samples, most) + 1) / samples
    start, period, end = _pieces(plan, share)
    pose, arc, middle = _outer_in_base(plan), 0.0, np.array([0.5 * plan.diameter, 0.0, 0.0, 1.0])
    found, arcs, matched = [(pose @ middle)[None]], [np.zeros(1)], [np.zeros(1)]
    for poses, lengths, outer in (
        *([start] if plan.plain_start else []),
        *[period] * plan.count,
        *([end] if plan.plain_end else []),
    ):
        found.append((pose @ poses) @ middle)
        arcs.append(arcs[-1][-1] + lengths)
        matched.append(arc + outer * lengths / lengths[-1])
        pose, arc = pose @ poses[-1], arc + outer
    return DiscreteCentreLine(*(read_only(np.concatenate(values)) for values in ([p[:, :3] for p in found], arcs, matched)))


def shape_error(pattern: Pattern, samples: int = 8) -> ShapeError:
    """How far the pinched tube is from the smooth helix; see the module.

    Args:
        pattern: The plan.
        samples: Points on each straight piece and in each pinch.

    Returns:
        The distances and the errors of radius and rise.

    Raises:
        ParameterError: As in `discrete_centre_line`.
    """
    plan, shape, line = checked_pattern(pattern), pattern.shape, discrete_centre_line(pattern, samples)
    wanted = _smooth(plan, line.line_arc)
    steps = np.diff(line.centre_arc)
    weights = 0.5 * (np.append(0.0, steps) + np.append(steps, 0.0)) / line.centre_arc[-1]
    apart = np.linalg.norm(line.points - wanted, axis=-1)
    aligned = np.linalg.norm(_aligned(line.points, wanted, weights) - wanted, axis=-1)
    radius, pitch = _helix_of_periods(plan, samples)
    return ShapeError(
        largest=float(apart.max()),
        rms=float(np.sqrt(weights @ apart**2)),
        tip=float(apart[-1]),
        largest_aligned=float(aligned.max()),
        rms_aligned=float(np.sqrt(weights @ aligned**2)),
        centre_radius=radius,
        pitch=pitch,
        centre_radius_error=radius - float(shape.centre_radius),
        turn_height_error=2.0 * np.pi * (pitch - float(shape.pitch)),
    )


def _pieces(plan: Pattern, share: FloatArray) -> list[tuple[FloatArray, FloatArray, float]]:
    """Plain start, period and plain end: poses along the outer path, lengths of the centre line to them, and of the path."""
    curvature, torsion = (
        float(value) for value in actuator_curvature_torsion(1.0, plan.angle, plan.diameter, "outer", plan.handedness)
    )
    cosine = np.cos(plan.angle)

    def straight(length: float) -> tuple[FloatArray, FloatArray]:
        return _motions(curvature, torsion, length * share), cosine * length * share

    half, half_lengths = straight(0.5 * plan.remaining_length)
    pinch, pinch_lengths = _motions(1.0 / plan.diameter, 0.0, plan.pinch_length * share), 0.5 * plan.pinch_length * share
    bent = half[-1] @ pinch
    poses = np.concatenate([half, bent, bent[-1] @ half])
    lengths = np.concatenate(
        [half_lengths, half_lengths[-1] + pinch_lengths, half_lengths[-1] + pinch_lengths[-1] + half_lengths]
    )
    return [
        (*straight(plan.plain_start), plan.plain_start),
        (poses, lengths, plan.spacing),
        (*straight(plan.plain_end), plan.plain_end),
    ]


def _motions(curvature: float, torsion: float, lengths: FloatArray) -> FloatArray:
    """Poses along a path of constant curvature and torsion, shape (m, 4, 4)."""
    zero = np.zeros_like(lengths)
    screw = Screw(np.stack([zero, curvature * lengths, torsion * lengths, zero], axis=-1), lengths)
    made = np.zeros((len(lengths), 4, 4))
    made[:, :3, :3], made[:, :3, 3], made[:, 3, 3] = screw.rotation, screw.position, 1.0
    return made


def _outer_in_base(plan: Pattern) -> FloatArray:
    """Frame of the outer path at the base, in that of the centre line of the smooth helix: `arg(1 + zeta)` about x."""
    share, twice = plan.contraction, 2.0 * plan.angle
    turned = turning_sign(plan.handedness) * np.arctan2(share * np.sin(twice), 1.0 + share * np.cos(twice))
    made = np.eye(4)
    made[1:3, 1:3] = [[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]]
    made[0, 3] = -0.5 * plan.diameter
    return made


def _smooth(plan: Pattern, arc: FloatArray) -> FloatArray:
    """Points of the smooth centre line in the frame of its base, by arc length of the actuator line."""
    contraction, angle = np.asarray(plan.contraction), np.asarray(plan.angle)
    curvature, torsion = actuator_curvature_torsion(contraction, angle, plan.diameter, "centre", plan.handedness)
    return _motions(float(curvature), float(torsion), 0.5 * length_ratio(contraction, angle) * arc)[:, :3, 3]


def _aligned(moved: FloatArray, wanted: FloatArray, weights: FloatArray) -> FloatArray:
    """Points turned and shifted onto others, with the least mean square distance (Kabsch)."""
    centre, target = weights @ moved, weights @ wanted
    u, _, vt = np.linalg.svd((weights[:, None] * (moved - centre)).T @ (wanted - target))
    u[:, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((moved - centre) @ (u @ vt) + target)


def _helix_of_periods(plan: Pattern, samples: int) -> tuple[float, float]:
    """Mean centre radius and pitch of the helix that the screw motion of a period makes."""
    poses, lengths, _ = _pieces(plan, np.arange(1, samples + 1) / samples)[1]
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
