"""The continuous body of a robot with sections: its backbone and its surface, for pictures and measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from softrobots.constant_curvature.screws import Screw
from softrobots.core.checks import FloatArray, positive_integer
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import backbone


@dataclass(frozen=True, eq=False)
class SegmentBody:
    """One segment of a body."""

    number: int
    """Number of the segment, from 1."""
    poses: FloatArray
    """Frames along the backbone, z along it, from the start to the end of the segment, shape (n, 4, 4) [m], world axes."""
    radius: float
    """Radius of the body [m]."""
    lines: dict[str, FloatArray]
    """Points along each line that is only drawn, by name, shape (n, 3) [m]."""

    @property
    def backbone(self) -> FloatArray:
        """Points along the backbone, shape (n, 3) [m]."""
        return np.asarray(self.poses[:, :3, 3])

    def surface(self, sides: int = 24) -> tuple[FloatArray, FloatArray]:
        """Return the triangles of the tube around the backbone, closed at both ends.

        Args:
            sides: Corners of its cross-section.

        Returns:
            Corners, shape (n sides + 2, 3) [m], and the corners of each triangle, shape (m, 3), integers, seen from outside
            anticlockwise.
        """
        return tube(self.poses[:, :3, :3], self.backbone, self.radius, sides)

    def thinned(self, spacing: float) -> SegmentBody:
        """Return the body without frames that follow another within less than a spacing [m]; the last one is kept."""
        steps = np.linalg.norm(np.diff(self.backbone, axis=0), axis=1)
        kept, run = [0], 0.0
        for number, step in enumerate(steps.tolist(), start=1):
            run += step
            if run >= spacing:
                kept.append(number)
                run = 0.0
        if kept[-1] != len(steps):  # the last frame replaces the one before it, unless that is the first
            kept[max(len(kept) - 1, 1) :] = [len(steps)]
        return SegmentBody(self.number, self.poses[kept], self.radius, {n: p[kept] for n, p in self.lines.items()})

    def dome(self) -> tuple[FloatArray, FloatArray]:
        """Return the triangles of a hemisphere on the end of the tube, for the tip of an everting tube, as in `surface`."""
        angle = 0.5 * np.pi * np.arange(7) / 6.5  # not to the pole, where a ring would be a point
        poses = np.tile(self.poses[-1], (7, 1, 1))
        poses[:, :3, 3] += self.radius * np.sin(angle)[:, None] * poses[:, :3, 2]
        return tube(poses[:, :3, :3], poses[:, :3, 3], self.radius * np.cos(angle), 24)


def tube(rotations: FloatArray, centres: FloatArray, radius: FloatArray | float, sides: int) -> tuple[FloatArray, FloatArray]:
    """Return the triangles of a closed tube.

    Args:
        rotations: Axes of each cross-section, which lies in x and y, shape (n, 3, 3).
        centres: Centre of each, shape (n, 3) [m].
        radius: Radius of all, or of each, shape (n,) [m].
        sides: Corners of a cross-section.

    Returns:
        Corners, shape (n sides + 2, 3) [m], and the corners of each triangle, shape (m, 3), integers, seen from outside
        anticlockwise.
    """
    rings, angle = len(centres), 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    sizes = np.broadcast_to(radius, rings)
    corners = np.einsum("n,nij,sj->nsi", sizes, rotations, ring) + centres[:, None, :]
    start = sides * np.repeat(np.arange(rings - 1), sides)
    here, there = np.tile(np.arange(sides), rings - 1), np.tile((np.arange(sides) + 1) % sides, rings - 1)
    low = np.column_stack([start + here, start + there, start + sides + there])
    high = np.column_stack([start + here, start + sides + there, start + sides + here])
    around, after = np.arange(sides), (np.arange(sides) + 1) % sides
    first, last, top = rings * sides, rings * sides + 1, (rings - 1) * sides
    caps = [np.column_stack([after, around, np.full(sides, first)])]
    caps.append(np.column_stack([top + around, top + after, np.full(sides, last)]))
    return np.concatenate([corners.reshape(-1, 3), centres[[0, -1]]]), np.concatenate([low, high, *caps])


def robot_line(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, points: int = 12) -> FloatArray:
    """Points along a robot: the backbone of its body, see `body_at`, or the origins of its joints, shape (n, 3) [m]."""
    segments = body_at(model, q_motors, q_springs, points)
    if segments:
        return np.concatenate([segment.backbone for segment in segments])
    return backbone(model, model.configuration(q_motors, q_springs))


def body_at(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, points: int = 12) -> tuple[SegmentBody, ...]:
    """Return the shape of the body at given coordinates: screw motions along the sections of each segment.

    Exact for sections of constant strain. For a lumped chain it is the smooth body that the chain approximates, to the order
    of the discretisation.

    Args:
        model: The robot.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa].
        q_springs: Elastic coordinates, shape (n_springs,) [rad or m].
        points: Points for each section, besides the start of the segment.

    Returns:
        The segments, base to tip; empty for a robot without sections.

    Raises:
        ParameterError: If `points` is not positive.
    """
    return BentSections(model, q_motors, q_springs).segments(points)


class BentSections:
    """The sections of a robot at given coordinates, each a screw motion: the frames of its body anywhere along it."""

    def __init__(self, model: SoftModel, q_motors: FloatArray, q_springs: FloatArray) -> None:
        """Place the sections; arguments as in `body_at`."""
        structure = self._structure = model.structure
        self._table = structure.section_table
        self.segment_numbers = tuple(dict.fromkeys(section.segment for section in self._table))
        """Numbers of the segments, base to tip."""
        self.length = sum(section.length for section in self._table)
        """Rest length of all sections [m]."""
        if not self._table:
            return
        pin_model, data = model.workspace(None)
        pin.forwardKinematics(pin_model, data, model.embed(model.coordinates.at(q_motors, q_springs).joints))
        self._coordinates = structure.section_coordinates(q_motors, q_springs)
        self._lengths = np.array([section.length for section in self._table])
        ends = Screw(self._coordinates, self._lengths).pose()
        starts: list[FloatArray] = []
        for row, section in enumerate(self._table):
            if row == 0 or section.segment != self._table[row - 1].segment:
                starts.append(_start(model, data, row))
            else:
                starts.append(starts[-1] @ ends[row - 1])
        self._starts = np.array(starts)

    def rows(self, segment: int) -> list[int]:
        """Places of the sections of a segment in the table of sections."""
        return [row for row, section in enumerate(self._table) if section.segment == segment]

    def bounds(self, segment: int) -> FloatArray:
        """Rest lengths from the start of a segment to its start and to the end of each section, shape (n_sections + 1,) [m]."""
        return np.concatenate([[0.0], np.cumsum(self._lengths[self.rows(segment)])])

    def radius(self, segment: int) -> float:
        """Radius of the body of a segment [m]."""
        return self._table[self.rows(segment)[0]].radius

    def frames(self, segment: int, at: FloatArray) -> FloatArray:
        """Return the frames at rest lengths from the start of a segment, shape (n,) [m], shape (n, 4, 4) [m], world axes."""
        rows, bounds = np.array(self.rows(segment)), self.bounds(segment)
        place = np.clip(np.searchsorted(bounds, at) - 1, 0, len(rows) - 1)
        row = rows[place]
        share = (at - bounds[place]) / self._lengths[row]
        along = Screw(share[:, None] * self._coordinates[row], share * self._lengths[row])
        return np.asarray(self._starts[row] @ along.pose())

    def segments(self, points: int) -> tuple[SegmentBody, ...]:
        """Return the bodies of the segments; see `body_at`.

        Raises:
            ParameterError: If `points` is not positive.
        """
        shares = np.arange(1, positive_integer("points", points, 10_000) + 1) / points
        bodies = []
        for number in self.segment_numbers:
            bounds = self.bounds(number)
            frames = self.frames(number, np.append(0.0, bounds[:-1, None] + shares * np.diff(bounds)[:, None]))
            lines = {
                tag.name: frames[:, :3, 3] + tag.distance * outwards(frames, np.full(len(frames), tag.azimuth))
                for tag in self._structure.lines
                if tag.segment == number
            }
            frames[:, :3, 3] += frames[:, :3, :2] @ self._table[self.rows(number)[0]].middle
            bodies.append(SegmentBody(number, frames, self.radius(number), lines))
        return tuple(bodies)


def outwards(frames: FloatArray, azimuth: FloatArray) -> FloatArray:
    """Return unit vectors at azimuths in the cross-sections of frames, shape (n,) [rad], shape (n, 3)."""
    return np.asarray(np.cos(azimuth)[:, None] * frames[:, :3, 0] + np.sin(azimuth)[:, None] * frames[:, :3, 1])


def _start(model: SoftModel, data: object, row: int) -> FloatArray:
    """Frame at the start of a section, (4, 4), after forward kinematics."""
    pin_model, section = model.pinocchio, model.structure.section_table[row]
    joints = [pin_model.getJointId(name) for name in section.joint_names]
    first = min(joints)
    before = data.oMi[pin_model.parents[first]] * pin_model.jointPlacements[first]  # type: ignore[attr-defined]
    rigid = Screw(section.to_joints, section.hinge)  # of a lumped section
    back = pin.SE3(pin.rpy.rpyToMatrix(-section.rest_joints[0], 0.0, 0.0), np.zeros(3))
    return np.array((before * back * pin.SE3(rigid.rotation, rigid.position).inverse()).homogeneous)
