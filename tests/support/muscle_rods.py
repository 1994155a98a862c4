"""An arm of segments with muscles of given length: Kirchhoff rods end to end, with the tensions of the muscles unknown.

Nothing here knows of softrobots. The arm is clamped at the origin, straight along +z at rest, with the identity as its base
frame. All loads are dead. SI units, angles in radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp

from tests.support.rods import quaternion_rotation

LOAD_STEP = 0.25  # of the load factor; each solution is the guess of the next
NODES = 17  # of the first mesh
STATES = 13  # of a segment: position 3, quaternion 4, moment 3, bending about x and y and elongation so far


@dataclass(frozen=True)
class MuscleSegment:
    """A uniform rod whose three muscles have given lengths, but not how bending and elongation spread along it.

    A muscle runs beside the rod as a guided tendon, a helix where the rod twists (Rucker and Webster 2011).

    Attributes:
        length: at rest [m].
        turn: about z before the segment [rad].
        bend: whole bending about x and y without twist, the integral of both curvatures, (2,) [rad].
        elongation: the integral of the stretch without twist [m].
        bending_stiffness: EI [N m^2].
        torsional_stiffness: GJ [N m^2].
        axial_stiffness: EA [N].
        density: mass per rest length [kg/m].
        distance: of the muscles at 0, -120 and 120 degrees from the rod [m]; 0: too near to feel its twist.
    """

    length: float
    turn: float
    bend: tuple[float, float]
    elongation: float
    bending_stiffness: float
    torsional_stiffness: float
    axial_stiffness: float
    density: float = 0.0
    distance: float = 0.0

    @classmethod
    def of_three(cls, lengths: ArrayLike, distance: float, **fields: Any) -> MuscleSegment:
        """The segment whose three muscles at azimuths 0, -120 and 120 degrees have given lengths [m].

        The elongation is the mean change. Bending t towards azimuth a has t cos(a) = (l2 + l3 - 2 l1) / 3d and
        t sin(a) = (l2 - l3) / (sqrt(3) d); it turns by -t sin(a) about x and by t cos(a) about y.
        """
        one, two, three = np.asarray(lengths, dtype=float)
        along, across = (two + three - 2.0 * one) / (3.0 * distance), (two - three) / (np.sqrt(3.0) * distance)
        mean = (one + two + three) / 3.0
        return cls(bend=(-across, along), elongation=mean - fields["length"], distance=distance, **fields)

    @property
    def stiffness(self) -> np.ndarray:
        """EI, EI, GJ, EA: of bending about x and y [N m^2], twist [N m^2] and stretch [N]."""
        return np.array([self.bending_stiffness] * 2 + [self.torsional_stiffness, self.axial_stiffness])

    @property
    def arms(self) -> np.ndarray:
        """Derivative of the rate along each muscle without twist with respect to the strains, (3, 4)."""
        angles, d = np.array([0.0, -2.0, 2.0]) * np.pi / 3.0, self.distance
        return np.stack([d * np.sin(angles), -d * np.cos(angles), 0.0 * angles, 1.0 + 0.0 * angles], axis=1)

    def rates(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates of the muscles along the rod and around it at strains (4, n), (3, n) each; their norm is that of the length."""
        return 1.0 + self.arms @ x, np.tile(self.distance * x[2], (3, 1))

    def pulled(self, moment: np.ndarray, push: np.ndarray, tensions: np.ndarray) -> np.ndarray:
        """Strains (x, y, t, e) from the internal loads and the tensions, (4, n), by Newton's method.

        They minimise EI/2 (x^2 + y^2) + GJ/2 t^2 + EA/2 e^2 + sum T_i |path_i| - moment . (x, y, t) - push e.
        """
        stiff, loads = self.stiffness, np.vstack([moment, push])
        arms, around = self.arms, np.array([0.0, 0.0, self.distance, 0.0])
        x = (loads - (tensions @ arms)[:, None]) / stiff[:, None]
        for _ in range(7):
            along, across = self.rates(x)
            size = np.hypot(along, across)
            slopes = np.einsum("ij,in->ijn", arms, along / size) + np.einsum("j,in->ijn", around, across / size)
            normals = np.einsum("j,in->ijn", around, along / size) - np.einsum("ij,in->ijn", arms, across / size)
            gradient = stiff[:, None] * x - loads + np.einsum("i,ijn->jn", tensions, slopes)
            tangent = np.diag(stiff) + np.einsum("i,in,ijn,ikn->njk", tensions, 1.0 / size, normals, normals)
            x = x - np.linalg.solve(tangent, gradient.T[..., None])[..., 0].T
        return x

    def strains(self, moment: np.ndarray, push: np.ndarray, pulls: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Strains from the internal loads, (4, n), and the rates of the sums, (3, n).

        The tensions are - P^T pulls, with P from the lengths to the sums as in `of_three`.
        """
        if self.distance == 0.0:
            loads = np.vstack([moment, push]) + np.array([pulls[0], pulls[1], 0.0, pulls[2]])[:, None]
            x = loads / self.stiffness[:, None]
            return x, x[[0, 1, 3]]
        sums = np.linalg.inv(self.arms[:, [0, 1, 3]])
        x = self.pulled(moment, push, -sums.T @ pulls)
        return x, sums @ (np.hypot(*self.rates(x)) - 1.0)


@dataclass(frozen=True)
class MuscleArm:
    """An arm in equilibrium.

    Attributes:
        pose: of the tip, (4, 4) [m].
        pulls: what the muscles of each segment exert on its sections: moments about x and y [N m] and push along z [N], (n, 3).
        nodes: how many nodes `solve_bvp` ended with.
    """

    pose: np.ndarray
    pulls: np.ndarray
    nodes: int


def solve_muscle_arm(
    segments: Sequence[MuscleSegment], force: ArrayLike, gravity: ArrayLike = (0.0, 0.0, 0.0), *, tol: float = 1e-8
) -> MuscleArm:
    """Equilibrium under a dead tip force [N] and gravity [m/s^2], on the branch that starts without load, by `solve_bvp`.

    A muscle that slides freely beside the rod pulls alike all along it; its tension is what keeps its length. By rest length,
    with R of the quaternion q, the force n and the moment m carried, and the pulls of the segment (`MuscleSegment.strains`):

        u, e = strains(R^T m, t.n, pulls),  p' = (1 + e) t,  q' = q (0, u) / 2,  m' = n x p'

    and the integrals of the rates of the sums over the segment are given. m = 0 at the tip.
    """
    count, pull, fall = len(segments), np.asarray(force, dtype=float), np.asarray(gravity, dtype=float)
    lengths = np.array([one.length for one in segments])
    masses = lengths * [one.density for one in segments]

    def rates(share: float, x: np.ndarray, y: np.ndarray, pulls: np.ndarray) -> np.ndarray:
        made = []
        for i, (state, push) in enumerate(zip(y.reshape(count, STATES, -1), pulls.reshape(count, 3), strict=True)):
            q, m = state[3:7], state[7:10]
            beyond = masses[i] * (1.0 - x) + masses[i + 1 :].sum()
            n = share * (pull[:, None] + fall[:, None] * beyond)
            rotations = quaternion_rotation(q.T)
            t = rotations[:, :, 2].T
            strains, sums = segments[i].strains(np.einsum("nji,jn->in", rotations, m), np.sum(t * n, axis=0), push)
            u, dp = strains[:3], (1.0 + strains[3]) * t
            dq = 0.5 * np.vstack([-np.sum(q[1:] * u, axis=0), q[0] * u + np.cross(q[1:], u, axis=0)])
            made.append(lengths[i] * np.vstack([dp, dq, np.cross(n, dp, axis=0), sums]))
        return np.vstack(made)

    def ends(share: float, a: np.ndarray, b: np.ndarray, pulls: np.ndarray) -> np.ndarray:
        a, b = a.reshape(count, STATES), b.reshape(count, STATES)
        before, parts = np.r_[np.zeros(3), 1.0, np.zeros(3)], []
        for one, start, end in zip(segments, a, b, strict=True):
            parts += [start[:7] - np.r_[before[:3], _turned(before[3:], one.turn)], start[10:]]
            parts.append(end[10:] - [*one.bend, one.elongation])
            before = end[:7]
        parts += [end[7:10] - start[7:10] for end, start in zip(b, a[1:], strict=False)]
        return np.concatenate([*parts, b[-1, 7:10]])

    x = np.linspace(0.0, 1.0, NODES)
    y, pulls = _arcs(segments, x)
    for share in np.linspace(0.0, 1.0, 1 + int(np.ceil(1.0 / LOAD_STEP)))[1:]:
        level = tol if share == 1.0 else 1e-4
        found = solve_bvp(partial(rates, share), partial(ends, share), x, y, pulls, tol=level, bc_tol=1e-11, max_nodes=20_000)
        if not found.success:
            raise RuntimeError(f"solve_bvp at {share:g} of the load: {found.message}")
        x, y, pulls = found.x, found.y, found.p
    pose, last = np.eye(4), y[-STATES:, -1]
    pose[:3, :3], pose[:3, 3] = quaternion_rotation(last[None, 3:7])[0], last[:3]
    return MuscleArm(pose, pulls.reshape(count, 3), len(x))


def _turned(q: np.ndarray, angle: float) -> np.ndarray:
    """A quaternion, then a turn about z."""
    w, x, y, z = q
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return np.array([w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s])


def _arcs(segments: Sequence[MuscleSegment], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States without load, arcs of circles, shape (13 n, nodes), and the pulls that hold them, shape (3 n,)."""
    states, pulls, point, turn = [], [], np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for one in segments:
        turn = _turned(turn, one.turn)
        axis, angle = np.array([*one.bend, 0.0]), np.hypot(*one.bend)
        axis = axis / angle if angle > 0.0 else axis
        half, long = 0.5 * angle * x, one.length + one.elongation
        w, v = np.cos(half), axis[:, None] * np.sin(half)
        q = np.vstack([turn[0] * w - turn[1:] @ v, turn[0] * v + turn[1:, None] * w + np.cross(turn[1:, None], v, axis=0)])
        chord = long * x * np.sinc(half / np.pi)  # along the tangent half way
        across = np.cross(axis, [0.0, 0.0, 1.0])
        local = chord * (np.outer([0.0, 0.0, 1.0], np.cos(half)) + np.outer(across, np.sin(half)))
        p = point[:, None] + quaternion_rotation(turn[None])[0] @ local
        so_far = np.outer([*one.bend, one.elongation], x)
        states.append(np.vstack([p, q, np.zeros((3, len(x))), so_far]))
        stiff = np.array([one.bending_stiffness, one.bending_stiffness, one.axial_stiffness])
        pulls.append(stiff / one.length * [*one.bend, one.elongation])
        point, turn = p[:, -1], q[:, -1]
    return np.vstack(states), np.concatenate(pulls)
