r"""Muscles of given lengths: the constrained and the free coordinates of a robot.

Straight muscles along segments fix, without twist, the sums `S` of bending and elongation over each segment (three muscles
exactly, more in the sense of least squares). Free are the differences between its sections, and twist: the strains are
`z = W S + F y`. `W` distributes the sums in inverse proportion to stiffness, so that `W^T K F = 0` and the stiffness of `y` is
diagonal. On other routes `S` are other combinations of strains (`softrobots.model.held_directions`). With the excess `c(z)` of
the lengths over their linear part (`softrobots.model.muscle_paths`) and `P` from lengths to sums, `S` is the solution of

.. math:: S + P c(W S + F y) = P (l - l_0)

With its derivative `A = 1 + P c_z W`, the load `w` on the strains, that of the springs included, and the tensions
:math:`t = P^T A^{-T} W^T w`,

.. math:: z_y = F - W A^{-1} P c_z F, \quad z_l = W A^{-1} P, \quad
          \mathrm d^2 U = z_y^T \Bigl(K - w_z + \sum t_m l_m''\Bigr) z_y
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softrobots.constant_curvature.strain_chain import LARGEST_BENDING
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.suspicion import MOST_STRETCH, stretched_too_far
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import ROUNDING
from softrobots.model.coordinates import Coordinates
from softrobots.model.held_directions import held_directions
from softrobots.model.muscle_length_point import MuscleLengthPoint
from softrobots.model.muscle_paths import MusclePaths, MusclePathsAt
from softrobots.model.sections import SectionRow, places_by_segment
from softrobots.model.springs import Springs

CONSISTENT = 1e-6
"""Largest accepted difference of muscle lengths from those of the nearest shape, an arc a segment [m]."""

_LEAST_LENGTH = 0.01  # of a section, relative to its rest length
_CLOSED = 1e-12  # largest remaining difference of the sums [rad or m]
_ROUNDING = 1e-15  # of the same, below which no step is of use
_STEPS = 30  # of Newton's method, that takes two or three


class MuscleLengths:
    """Coordinates of a robot with given muscle lengths: motors, then lengths, are given; the rest of the strains is free."""

    def __init__(
        self,
        inner: Coordinates,
        tags: Sequence[ActuatorTag],
        sections: Sequence[SectionRow],
        springs: Springs,
        paths: MusclePaths,
    ) -> None:
        """Compute the free coordinates.

        Args:
            inner: The robot without muscles.
            tags: The muscles.
            sections: Its sections.
            springs: Springs of its elastic coordinates.
            paths: The paths of the muscles.
        """
        self._segments = segments = places_by_segment(sections)
        self._section_lengths = {row.segment: row.length for row in sections}
        self._largest_bending = np.pi / 2 if paths.lumped else LARGEST_BENDING
        self.inner, self.strain_springs, self.paths, self._tags = inner, springs, paths, tuple(tags)
        self._longest = MOST_STRETCH * np.asarray(paths.rest)
        touched = sorted({segment for tag in tags for segment in tag.segments})
        bends = [[np.array(segments[number][key], dtype=int) for key in ("bend_x", "bend_y")] for number in touched]
        self._bent = [(number, about_x, about_y) for number, (about_x, about_y) in zip(touched, bends, strict=True)]
        held = held_directions(paths, springs, segments, touched)
        self.groups = held.groups
        """Elastic coordinates of the robot without muscles whose sum the lengths hold, group by group.

        Empty where the lengths hold other combinations of them, see `softrobots.model.held_directions`.
        """
        self.slopes = read_only(held.slopes)
        """Derivative of the held sums with respect to the lengths, shape (n_held, n_muscles) [rad/m or -]."""
        self.shares = read_only(held.shares)
        """Elastic coordinates of the robot without muscles by those sums, shape (count, n_held)."""
        self.spread = read_only(self.shares @ self.slopes)
        """The same by change of the lengths without twist, shape (count, n_muscles)."""
        self._misfit = np.eye(len(tags)) - paths.matrix @ self.spread
        self.sum_stiffness = read_only(np.einsum("ik,i,ik->k", self.shares, springs.stiffness, self.shares))
        """Stiffness of the sums, shape (n_held,) [N m/rad or N/m]."""
        self.rounding = 0.0 if held.groups else ROUNDING * float(np.linalg.norm(self.sum_stiffness) * np.max(paths.rest))
        """Rounding of the loads that hold winding lengths [N]; 0 where the lengths are linear without twist."""
        self.sum_rest = read_only(self.slopes @ (paths.matrix @ springs.rest))
        """Relaxed sums, shape (n_held,) [rad or m]."""
        self.free = read_only(held.free)
        """Elastic coordinates of the robot without muscles by free coordinates, shape (count, n)."""
        stiffness = read_only(np.einsum("ik,i,ik->k", self.free, springs.stiffness, self.free))
        rest = read_only(np.asarray((springs.stiffness * springs.rest) @ self.free / stiffness))
        self.elastic = read_only((self.free * springs.stiffness[:, None]).T / stiffness[:, None])
        """Free coordinates by those without muscles, shape (n, count): `elastic @ free = 1`, `elastic @ spread = 0`."""
        self.springs = Springs(held.names, stiffness, rest, np.array(held.turning, dtype=bool))
        """Springs of the free coordinates."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> MuscleLengthPoint:
        """Return the robot at given coordinates."""
        sums, strains, paths, solved = self._solve(motors, elastic)
        inner = self.inner.at(motors[: len(motors) - len(self._tags)], strains)
        return MuscleLengthPoint(inner, paths, self, sums, self.slopes @ self._change(motors), strains, solved)

    def strains(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Elastic coordinates of the robot without muscles at given motors, lengths and free coordinates."""
        return self._solve(motors, elastic)[1]

    def held(self, motors: FloatArray, strains: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return actuators and free coordinates, shapes (n_motors,) and (n,), at motors without muscles and strains."""
        return np.concatenate([motors, self.paths.rest + self.paths.at(strains).change]), self.elastic @ strains

    def strains_of_many(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """The same, shape (N, count), of N rows of motors and free coordinates in which lengths are met without a fold."""
        given = (motors[:, -len(self._tags) :] - self.paths.rest) @ self.slopes.T
        free, sums, worst = elastic @ self.free.T, given, np.inf
        for _ in range(_STEPS):
            strains = sums @ self.shares.T + free
            paths = self.paths.at(strains)
            gap = sums - given + paths.excess @ self.slopes.T
            last, worst = worst, float(np.abs(gap).max(initial=0.0))
            if worst <= _ROUNDING or (last <= _CLOSED and worst >= last):
                break
            sums = sums - np.linalg.solve(self.gap_slope(paths), gap[..., None])[..., 0]
        return np.asarray(strains)

    def _solve(self, motors: FloatArray, elastic: FloatArray) -> tuple[FloatArray, FloatArray, MusclePathsAt, bool]:
        """Sums of the strains at given lengths and free coordinates, the strains, the paths, and whether lengths are met."""
        free, given = self.free @ elastic, self.slopes @ self._change(motors)
        sums, worst, enough = given, np.inf, _ROUNDING if self.groups else 0.0
        for _ in range(_STEPS):
            strains = self.shares @ sums + free
            paths = self.paths.at(strains)
            if not paths.valid:
                break
            gap = sums - given + self.slopes @ paths.excess
            last, worst = worst, float(np.abs(gap).max())
            if worst <= enough or (last <= _CLOSED and worst >= last):
                break
            sums = sums - np.linalg.solve(self.gap_slope(paths), gap)
        return sums, strains, paths, paths.valid and worst <= _CLOSED

    def gap_slope(self, paths: MusclePathsAt) -> FloatArray:
        """Derivative `A` of the constraint with respect to the sums, shape (..., n_held, n_held)."""
        return np.asarray(np.eye(len(self.slopes)) + self.slopes @ (paths.slopes @ self.shares))

    def _change(self, motors: FloatArray) -> FloatArray:
        """Change of the muscle lengths from rest, shape (n_muscles,) [m]."""
        return np.asarray(motors[len(motors) - len(self._tags) :] - self.paths.rest)

    def consistent(self, motors: FloatArray) -> FloatArray:
        """Return motors and the nearest lengths of a shape, shape (n_motors,)."""
        nearest = np.array(motors)
        nearest[len(motors) - len(self._tags) :] -= self._shape(motors)[1]
        return nearest

    def _shape(self, motors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Strains of the robot at rest under lengths, and what the lengths miss them by; NaN if it can have none.

        Shapes (count,) and (n_muscles,) [m]. Straight routes along segments are linear in the strains without twist.
        """
        change = self._change(motors)
        if self.groups:
            return self.spread @ change, self._misfit @ change
        _, strains, paths, solved = self._solve(motors, self.springs.rest)
        return strains, change - paths.change if solved else np.full(len(change), np.nan)

    def basis(self, scale: FloatArray) -> FloatArray:
        """Return independent changes of motors and lengths, of size `scale`, shape (n_motors, n)."""
        count = len(scale) - len(self._tags)
        consistent = np.eye(len(self._tags)) - self._misfit
        if not np.any(np.abs(self._misfit) > 1e-12):
            return np.diag(scale)
        values, vectors = np.linalg.eigh(consistent)
        directions = np.asarray(vectors[:, values > 0.5])
        basis = np.zeros((len(scale), count + directions.shape[1]))
        basis[:count, :count] = np.diag(scale[:count])
        basis[count:, count:] = scale[count:, None] * directions
        return basis

    def refusal(self, motors: FloatArray) -> str | None:
        """Return the requirement that muscle lengths fail; None if the robot can have them.

        They are positive, one shape explains them, and no section bends beyond its range or loses its length.
        """
        lengths = motors[len(motors) - len(self._tags) :]
        if np.any(lengths <= 0.0):
            return "positive muscle lengths [m]"
        if np.any(lengths > self._longest):
            return stretched_too_far([tag.name for tag in self._tags], lengths.tolist(), self.paths.rest.tolist())
        strains, gap = self._shape(motors)
        if np.isnan(gap).any():
            return "muscle lengths that a shape of the robot has"
        misfit = np.abs(gap)
        if misfit.max() > CONSISTENT:
            tag = self._tags[int(np.argmax(misfit))]
            if not self.groups or len(tag.segments) > 1:
                return (
                    f"muscle lengths that one shape of the robot explains; that of {tag.name} misses the nearest shape by "
                    f"{misfit.max():.3g} m, allowed {CONSISTENT:g} m"
                )
            stretch = (
                ""
                if "stretch" in self._segments[tag.segments[0]]
                else ", without elongation (this chain has no stretch joints)"
            )
            return (
                f"muscle lengths that one arc a segment explains{stretch}; those of segment {tag.segments[0]} miss the nearest "
                f"arc by {misfit.max():.3g} m, allowed {CONSISTENT:g} m"
            )
        for segment, bending, _ in self._bendings(strains):
            stretches = self._segments[segment].get("stretch")
            length = self._section_lengths[segment]
            if stretches is not None and length + float(strains[list(stretches)].min()) <= _LEAST_LENGTH * length:
                return (
                    f"long enough to leave segment {segment} a length: sections of {length:.4g} m would be pressed to nothing"
                )
            if bending > self._largest_bending * (1.0 + 1e-9):
                return (
                    f"within the chain's range: segment {segment} would bend by {bending:.4g} rad a section, allowed "
                    f"{self._largest_bending:.4g} rad (more sections a segment allow more)"
                )
        return None

    def within_range(self, motors: FloatArray) -> FloatArray:
        """Return actuators with the bending of each segment limited, its mean length unchanged, shape (n_motors,)."""
        limited, strains = np.array(motors), self._shape(motors)[0]
        for row, (_, bending, _) in enumerate(self._bendings(strains)):
            if bending > self._largest_bending:
                bends = np.concatenate(self._bent[row][1:])
                arms = self.paths.matrix[:, bends]
                limited[len(motors) - len(self._tags) :] -= arms @ strains[bends] * (1.0 - self._largest_bending / bending)
        return limited

    def reached_range(self, motors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the bending of segments at the limit of their sections; see `Actuators.active_limits`."""
        slopes, bends = [], []
        count, strains = len(motors), self._shape(motors)[0]
        for _, bending, (x, y) in self._bendings(strains):
            if bending >= self._largest_bending * (1.0 - 1e-9):
                spread = strains[[x, y]]
                along, across = np.zeros(count), np.zeros(count)
                along[count - len(self._tags) :] = (spread[0] * self.spread[x] + spread[1] * self.spread[y]) / bending
                across[count - len(self._tags) :] = (spread[0] * self.spread[y] - spread[1] * self.spread[x]) / bending
                slopes.append(along)
                bends.append(across / np.sqrt(bending))
        return np.array(slopes).reshape(-1, count), np.array(bends).reshape(-1, count)

    def _bendings(self, strains: FloatArray) -> list[tuple[int, float, tuple[int, int]]]:
        """Each segment with muscles: number, largest bending of a section [rad], places of the two bendings of that section."""
        bendings = []
        for segment, about_x, about_y in self._bent:
            sizes = np.hypot(strains[about_x], strains[about_y])
            most = int(sizes.argmax())
            bendings.append((segment, float(sizes[most]), (int(about_x[most]), int(about_y[most]))))
        return bendings
