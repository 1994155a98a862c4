"""Equilibria of the straight arm of two links under an axial push, without the package: brute force and continuation.

Everything comes from the Denavit-Hartenberg table (`arm_balance`) and the law of the springs written again. Equilibria are
sought by Newton and by descent from many starts, and followed both ways by Gauss-Newton steps along the null vector of
`[K_t, dr/dF]`, many at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.support.oracles import arm_balance

LONGEST, SHORTEST = 0.04, 1e-6
"""Steps of a path; a change of the force by the critical one counts as a radian."""

KINK = 1e-3
"""Step below which a path may turn by any angle, as it does at the knee of a link [rad]."""

MEETING = 2e-3
"""Distance of two paths that meet."""


@dataclass(frozen=True, eq=False)
class PushedArm:
    """The arm with the stiffness of its four springs [N m/rad], and the largest moment of each link [N m]."""

    stiffness: np.ndarray
    plateaus: tuple[float, float]
    unit: float
    """Force that counts as a radian [N]."""

    def balance(self, springs: np.ndarray, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual (n, 4), tangent stiffness (n, 4, 4) and derivative of the residual by the force (n, 4)."""
        unit = np.tile([-1.0, 0.0, 0.0], (len(springs), 1))
        by_force, curvature, _ = arm_balance(np.zeros((len(springs), 3)), springs, unit, 0.0)  # both are linear in the force
        residual = forces[:, None] * by_force + self.stiffness * springs
        tangent = forces[:, None, None] * curvature + np.diag(self.stiffness)
        for places, largest in zip(([0, 1], [2, 3]), self.plateaus, strict=True):
            angles, stiffness = springs[:, places], self.stiffness[places[0]]
            bend = np.linalg.norm(angles, axis=1)
            flat = np.flatnonzero(stiffness * bend > largest)
            way = angles[flat] / bend[flat, None]
            residual[flat[:, None], places] += (largest - stiffness * bend[flat])[:, None] * way
            across = (largest / bend[flat])[:, None, None] * (np.eye(2) - way[:, :, None] * way[:, None, :])
            tangent[np.ix_(flat, places, places)] += across - stiffness * np.eye(2)
        return residual, tangent, by_force

    def equilibria(self, force: float, rng: np.random.Generator, starts: int) -> np.ndarray:
        """Equilibria at a force, from many starts: half by Newton, which ends on saddles too, half by descent."""
        springs, forces = rng.uniform(-2.2, 2.2, (starts, 4)), np.full(starts, force)
        springs[::3] *= 10.0 ** rng.uniform(-2.0, 0.0, (len(springs[::3]), 1))
        descends = np.arange(starts) < starts // 2
        for _ in range(80):
            residual, tangent, _ = self.balance(springs, forces)
            lift = np.maximum(0.0, 0.05 * self.stiffness.min() - np.linalg.eigvalsh(tangent)[:, 0]) * descends
            lift = np.where(np.abs(np.linalg.det(tangent)) < 1e-12, 1e-6 * self.stiffness.min(), lift)
            step = -np.linalg.solve(tangent + lift[:, None, None] * np.eye(4), residual[..., None])[..., 0]
            springs = springs + step * np.minimum(1.0, 0.2 / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-300))
        settled = np.linalg.norm(self.balance(springs, forces)[0], axis=1) < 1e-9 * self.stiffness.max()
        found: list[np.ndarray] = []
        for point in springs[settled & (np.abs(springs).max(axis=1) < np.pi)]:
            if all(np.abs(point - other).max() > 1e-5 for other in found):
                found.append(point)
        return np.array(found).reshape(-1, 4)

    def paths(self, springs: np.ndarray, force: float, largest: float, most: int = 400) -> list[np.ndarray]:
        """The path through each equilibrium, shape (n, 4), both ways, to force 0 or the largest: places, shape (points, 5).

        A place is the springs and the force over `unit`. A path ends where its steps become too short.
        """
        count = len(springs)
        here = np.tile(np.column_stack([springs, np.full(count, force / self.unit)]), (2, 1))
        along = null_vectors(self._augmented(here)[1])
        along[count:] *= -1.0
        step, alive = np.full(2 * count, 0.01), np.ones(2 * count, dtype=bool)
        points = [[place] for place in here]
        for _ in range(most):
            rows = np.flatnonzero(alive)
            if not len(rows):
                break
            there = here[rows] + step[rows, None] * along[rows]
            for _ in range(6):
                residual, jacobian = self._augmented(there)
                gram = jacobian @ np.swapaxes(jacobian, 1, 2) + 1e-14 * np.eye(4)
                there = there - (np.swapaxes(jacobian, 1, 2) @ np.linalg.solve(gram, residual[..., None]))[..., 0]
            residual, jacobian = self._augmented(there)
            moved, settled = there - here[rows], np.linalg.norm(residual, axis=1) < 1e-9
            length = np.linalg.norm(moved, axis=1)
            ahead = null_vectors(jacobian)
            short = step[rows] <= KINK
            # Beyond the knee of a link the force may fall at once, but the robot bends on.
            onward = np.where(short, (ahead[:, :4] * moved[:, :4]).sum(axis=1), (ahead * moved).sum(axis=1))
            ahead *= np.where(onward < 0.0, -1.0, 1.0)[:, None]
            straight = (ahead * along[rows]).sum(axis=1) > 0.97
            good = settled & (length < 2.0 * step[rows]) & (length > 0.3 * step[rows]) & (straight | short)
            taken, left = rows[good], rows[~good]
            here[taken], along[taken] = there[good], ahead[good]
            step[taken] = np.minimum(1.3 * step[taken], LONGEST)
            step[left] *= 0.5
            for row in taken:
                points[row].append(here[row].copy())
            alive[rows] &= (step[rows] > SHORTEST) & (here[rows, 4] > 0.0) & (here[rows, 4] * self.unit < largest)
        return [np.array(points[count + row][::-1] + points[row][1:]) for row in range(count)]

    def _augmented(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual (n, 4) and its derivative by the place (n, 4, 5), in units of the stiffness."""
        residual, tangent, by_force = self.balance(places[:, :4], places[:, 4] * self.unit)
        jacobian = np.concatenate([tangent, self.unit * by_force[..., None]], axis=2)
        return residual / self.stiffness, jacobian / self.stiffness[:, None]


def null_vectors(jacobian: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 5) that matrices (n, 4, 5) take to zero."""
    return np.linalg.svd(jacobian)[2][:, -1].copy()


def distance(polyline: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Distance of places, shape (n, 5), from a polyline."""
    ways = np.diff(polyline, axis=0)
    shares = ((places[:, None] - polyline[:-1]) * ways).sum(axis=2) / np.maximum((ways**2).sum(axis=1), 1e-300)
    nearest = polyline[:-1] + np.clip(shares, 0.0, 1.0)[..., None] * ways
    return np.linalg.norm(nearest - places[:, None], axis=2).min(axis=1)


def meets(path: np.ndarray, others: list[np.ndarray]) -> bool:
    """Whether a path comes within `MEETING` of another one."""
    for other in others:
        near = np.flatnonzero(distance(other, path) < 2.0 * LONGEST) if len(other) > 1 else []
        for row in near:
            ends = path[max(row - 1, 0)], path[min(row + 1, len(path) - 1)]
            fine = np.concatenate([np.linspace(path[row], end, 31) for end in ends])
            if (distance(other, fine) < MEETING).any():
                return True
    return False
