r"""Error of the capsules of a robot: how far its body is from them.

The body is the tube of radius `r` around a centre line. Along a section of constant strain that line is a helix: with the
rotation `w` over the section and its velocity `v` in its own axes, both constant, it turns by `|w|` about an axis, at the
distance `|w x v| / |w|^2` from it. Farthest from its chord is its middle, at the distance (a sagitta; `l tan(theta / 4) / 2` on
a chord `l` of an arc that bends by `theta`)

.. math:: f = \frac{|w \times v|}{|w|^2} \left( 1 - \cos \frac{|w|}{2} \right)

The capsules lie along that chord, as long as it was at rest. Where it has become longer by `s`, they leave a hole, and the
error is :math:`\sqrt{(r + f)^2 + s^2 / 4} - r`; see Theory, Contact, for bodies beside the chain and for lumped sections.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.constant_curvature.screws import Screw
from softrobots.constant_curvature.strain_chain import joint_positions, universal
from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel, check_model


def capsule_error(model: SoftModel, q_motors: Any, q_springs: Any | None = None) -> FloatArray:
    """Return bounds of the distance between the body of a robot and its capsules, one a section.

    No point of the tube around the centre line is farther than that outside of the capsules, and no point of the capsules
    outside of the tube: no gap to an obstacle beside the robot differs by more. It is attained along sections of constant
    strain whose body is around the chain, unless their chord is shorter than half of that at rest. The body of a lumped
    section, and of one with a flexure, is the arc that touches its two pieces at their ends. Straight links are exact between
    their hinges.

    At both ends of the chain, beyond the first and the last link, the capsules have caps, by which they are a radius longer
    than a tube with flat ends. That is not in the bounds: a gap to an obstacle before the tip may be smaller than that of a
    flat end by a radius more.

    Args:
        model: The robot, with the capsules of the descriptions of this package.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa].
        q_springs: Elastic coordinates, shape (n_springs,) [rad or m]; relaxed by default.

    Returns:
        The bounds, shape (n_sections,) [m], in the order of `model.structure.section_table`; empty without sections,
        as of an arm of straight links.

    Raises:
        ParameterError: If `model` is not a `SoftModel`, a shape differs, a number is not finite, or a section is bent or
            twisted beyond its range.
    """
    motors = check_model(model).checked_motors(q_motors)
    model.configuration(motors, q_springs)  # refuses bad coordinates
    rows = model.structure.section_table
    if not rows:
        return np.zeros(0)
    elastic = model.rest if q_springs is None else np.asarray(q_springs, dtype=np.float64)
    z = model.structure.section_coordinates(motors, elastic)
    rest, lengths = np.array([row.rest for row in rows]), np.array([row.length for row in rows])
    radius = np.array([row.radius for row in rows])
    hinges, numbers = np.array([row.hinge + 0.5 * row.bends for row in rows]), np.array([row.segment for row in rows])
    of_hinges = _of_lumped(z - rest, rest, lengths, radius, hinges, np.diff(numbers) == 0)
    if not model.structure.constant_strain:
        return of_hinges
    of_sections = _of_sections(z, rest, lengths, radius, np.array([[*row.middle, 0.0] for row in rows]))
    return np.where([row.bends < row.length for row in rows], of_hinges, of_sections)


def _sagitta(turn: FloatArray, velocity: FloatArray) -> FloatArray:
    """Largest distance of a piece of a helix from its chord, shape (n,): its rotation and velocity, shape (n, 3) [rad, m]."""
    quarter = 0.25 * np.linalg.norm(turn, axis=-1)
    return np.asarray(np.linalg.norm(np.cross(turn, velocity), axis=-1) / 8.0 * np.sinc(quarter / np.pi) ** 2)


def _of_sections(z: FloatArray, rest: FloatArray, lengths: FloatArray, radius: FloatArray, middle: FloatArray) -> FloatArray:
    ends = []
    for coordinates in (rest, z):
        joints = joint_positions(coordinates, lengths)
        to_chord = np.swapaxes(universal(joints[:, 0], joints[:, 1]), -1, -2)
        start = (to_chord @ middle[..., None])[..., 0]  # of the centre line, in axes of the chord of the chain
        end = (to_chord @ Screw(coordinates, lengths).rotation @ middle[..., None])[..., 0]
        ends.append((start, end, joints[:, 2]))
    (start0, end0, chord0), (start, end, chord) = ends
    line = end - start + chord[:, None] * (0.0, 0.0, 1.0)
    length = np.linalg.norm(line, axis=1)
    line /= length[:, None]
    turn, velocity = z[:, :3], np.cross(z[:, :3], middle)
    velocity[:, 2] += lengths + z[:, 3]
    longer = 0.5 * (chord - chord0)
    shifts = np.stack([start - start0, end - end0])  # of the capsules from the centre line, at both ends
    along = (shifts * line).sum(axis=2)
    across = np.linalg.norm(shifts - along[..., None] * line, axis=2).max(axis=0)
    across += np.abs(longer) * np.hypot(line[:, 0], line[:, 1]) + _sagitta(turn, velocity)
    beyond = -longer * line[:, 2] - 0.5 * length + 0.5 * np.abs(along.sum(axis=0))  # a half that passes the other end
    beyond = np.maximum(np.abs(along).max(axis=0), beyond)
    angle = np.linalg.norm(turn, axis=1)
    wide = (angle > np.pi) & np.any(middle, axis=1)  # a helix beside the chain may pass the ends of its chord
    spread = np.linalg.norm(np.cross(turn, velocity), axis=1) / np.where(wide, angle, 1.0) ** 2
    beyond += np.where(wide, spread * (1.0 - np.sin(0.5 * angle)), 0.0)
    hole = np.maximum(longer, 0.0) * line[:, 2]
    return np.asarray(np.maximum(np.hypot(radius + across, hole) - radius, np.hypot(across, beyond)))


def _of_lumped(
    z: FloatArray, rest: FloatArray, lengths: FloatArray, radius: FloatArray, hinges: FloatArray, together: FloatArray
) -> FloatArray:
    angle = np.arccos(np.clip(np.cos(z[:, 0]) * np.cos(z[:, 1]), -1.0, 1.0))
    across = np.maximum(hinges, lengths - hinges) * np.tan(0.25 * angle)
    behind, before = lengths - hinges, hinges.copy()  # the whole sub-links, from hinge to hinge of a segment
    behind[:-1] += together * hinges[1:]
    before[1:] += together * (lengths - hinges)[:-1]
    piece = np.maximum(behind, before)[:, None]
    across += _sagitta(rest[:, :3] / lengths[:, None] * piece, piece * (0.0, 0.0, 1.0))
    hole = 0.5 * np.maximum(z[:, 3], 0.0)
    folded = np.maximum(-z[:, 3], 0.0) * np.sin(np.minimum(angle, 0.5 * np.pi))
    return np.asarray(np.maximum(np.hypot(radius + across, hole) - radius, across + folded))
