r"""Muscles of given lengths: the constrained and the free coordinates of a robot.

Without twist the lengths fix the sums `S` of bending and elongation over a segment (three muscles exactly, more in the sense of
least squares). Free are the differences between its sections, and twist: the strains are `z = W S + F y`. `W` distributes the
sums in inverse proportion to stiffness, so that `W^T K F = 0` and the stiffness of `y` is diagonal. With the excess `c(z)` of
the lengths by twist (`softrobots.model.muscle_paths`) and `P` from lengths to sums, `S` is the solution of

.. math:: S + P c(W S + F y) = P (l - l_0)

With its derivative `A = 1 + P c_z W`, the load `w` on the strains, that of the springs included, and the tensions
:math:`t = P^T A^{-T} W^T w`,

.. math:: z_y = F - W A^{-1} P c_z F, \quad z_l = W A^{-1} P, \quad
          \mathrm d^2 U = z_y^T \Bigl(K - w_z + \sum t_m l_m''\Bigr) z_y
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import LARGEST_BENDING
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.coordinates import Coordinates
from softrobots.model.muscle_length_point import MuscleLengthPoint
from softrobots.model.muscle_paths import MUSCLE_STRAINS, MusclePaths, MusclePathsAt, muscle_arms
from softrobots.model.sections import SectionRow, places_by_segment
from softrobots.model.springs import Springs

CONSISTENT = 1e-6
"""Largest accepted difference of the muscle lengths of a segment from those of the nearest arc [m]."""

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

        Raises:
            DescriptionError: If the muscles of a segment do not fix its bending and elongation.
        """
        self._segments = segments = places_by_segment(sections)
        self._section_lengths = {row.segment: row.length for row in sections}
        self._largest_bending = np.pi / 2 if paths.lumped else LARGEST_BENDING
        self.inner, self.strain_springs, self.paths, self._tags = inner, springs, paths, tuple(tags)
        count = len(springs.names)
        shares: list[FloatArray] = []
        self._misfit = np.zeros((len(tags), len(tags)))
        groups, slopes, modes, names, turning = [], [], [], [], []
        self._bent: list[tuple[int, Any, Any]] = []
        for segment in sorted({tag.segments[0] for tag in tags}):
            about_x, about_y = (np.array(segments[segment][key], dtype=int) for key in ("bend_x", "bend_y"))
            self._bent.append((segment, about_x, about_y))
            rows = [row for row, tag in enumerate(tags) if tag.segments[0] == segment]
            places = {key: list(segments[segment][key]) for key in MUSCLE_STRAINS if key in segments[segment]}
            arms = muscle_arms([tags[row] for row in rows])[:, [MUSCLE_STRAINS.index(key) for key in places]]
            if np.linalg.matrix_rank(arms, tol=1e-9 * float(np.abs(arms).max())) < len(places):
                raise DescriptionError(
                    f"the {len(rows)} muscles of segment {segment} do not fix its bending and elongation; "
                    f"three or more at different azimuths are required, or their tensions, load_model(..., muscles='forces')"
                )
            inverse = np.linalg.pinv(arms)
            self._misfit[np.ix_(rows, rows)] = np.eye(len(rows)) - arms @ inverse
            for key, row_of_inverse in zip(places, inverse, strict=True):
                softness = 1.0 / springs.stiffness[places[key]]
                shares.append(np.zeros(count))
                shares[-1][places[key]] = softness / softness.sum()
                slope = np.zeros(len(tags))
                slope[rows] = row_of_inverse
                groups.append(tuple(places[key]))
                slopes.append(slope)
                basis = _differences(springs.stiffness[places[key]])
                for number, mode in enumerate(basis.T, start=1):
                    column = np.zeros(count)
                    column[places[key]] = mode
                    modes.append(column)
                    names.append(f"segment_{segment}_{key}_mode_{number}")
                    turning.append(key != "stretch")
        constrained = {place for group in groups for place in group}
        free = [place for place in range(count) if place not in constrained]
        self.groups = tuple(groups)
        """Elastic coordinates of the robot without muscles whose sum the lengths constrain, group by group."""
        self.slopes = read_only(np.array(slopes).reshape(-1, len(tags)))
        """Derivative of those sums with respect to the lengths, shape (n_groups, n_muscles) [rad/m or -]."""
        self.shares = read_only(np.array(shares).reshape(-1, count).T)
        """Elastic coordinates of the robot without muscles by those sums, shape (count, n_groups)."""
        self.spread = read_only(self.shares @ self.slopes)
        """The same by change of the lengths without twist, shape (count, n_muscles)."""
        self.sum_stiffness = read_only(np.einsum("ik,i,ik->k", self.shares, springs.stiffness, self.shares))
        """Stiffness of the sums, shape (n_groups,) [N m/rad or N/m]."""
        self.sum_rest = read_only(np.array([springs.rest[list(group)].sum() for group in groups]))
        """Relaxed sums, shape (n_groups,) [rad or m]."""
        self.free = read_only(np.concatenate([np.eye(count)[free], np.array(modes).reshape(-1, count)]).T)
        """The same by free coordinates, shape (count, n)."""
        stiffness = read_only(np.einsum("ik,i,ik->k", self.free, springs.stiffness, self.free))
        rest = read_only(np.asarray((springs.stiffness * springs.rest) @ self.free / stiffness))
        self.elastic = read_only((self.free * springs.stiffness[:, None]).T / stiffness[:, None])
        """Free coordinates by those without muscles, shape (n, count): `elastic @ free = 1`, `elastic @ spread = 0`."""
        angles = np.array([*(springs.turning[place] for place in free), *turning], dtype=bool)
        self.springs = Springs((*(springs.names[place] for place in free), *names), stiffness, rest, angles)
        """Springs of the free coordinates."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> MuscleLengthPoint:
        """Return the robot at given coordinates."""
        sums, strains, paths, solved = self._solve(motors, elastic)
        inner = self.inner.at(motors[: len(motors) - len(self._tags)], strains)
        return MuscleLengthPoint(inner, paths, self, sums, self.slopes @ self._change(motors), strains, solved)

    def strains(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Elastic coordinates of the robot without muscles at given motors, lengths and free coordinates."""
        return self._solve(motors, elastic)[1]

    def _solve(self, motors: FloatArray, elastic: FloatArray) -> tuple[FloatArray, FloatArray, MusclePathsAt, bool]:
        """Sums of the strains at given lengths and free coordinates, the strains, the paths, and whether lengths are met."""
        free, given = self.free @ elastic, self.slopes @ self._change(motors)
        sums, worst = given, np.inf
        for _ in range(_STEPS):
            strains = self.shares @ sums + free
            paths = self.paths.at(strains)
            if not paths.valid:
                break
            gap = sums - given + self.slopes @ paths.excess
            worst = float(np.abs(gap).max())
            if worst <= _ROUNDING:
                break
            sums = sums - np.linalg.solve(self.gap_slope(paths), gap)
        return sums, strains, paths, paths.valid and worst <= _CLOSED

    def gap_slope(self, paths: MusclePathsAt) -> FloatArray:
        """Derivative `A` of the constraint with respect to the sums, shape (n_groups, n_groups)."""
        return np.asarray(np.eye(len(self.groups)) + self.slopes @ (paths.slopes @ self.shares))

    def _change(self, motors: FloatArray) -> FloatArray:
        """Change of the muscle lengths from rest, shape (n_muscles,) [m]."""
        return np.asarray(motors[len(motors) - len(self._tags) :] - self.paths.rest)

    def consistent(self, motors: FloatArray) -> FloatArray:
        """Return motors and the nearest lengths of arcs, shape (n_motors,)."""
        nearest = np.array(motors)
        nearest[len(motors) - len(self._tags) :] -= self._misfit @ self._change(motors)
        return nearest

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

        They are positive, one arc explains those of a segment, and no section bends beyond its range or loses its length.
        """
        if np.any(motors[len(motors) - len(self._tags) :] <= 0.0):
            return "positive muscle lengths [m]"
        change = self._change(motors)
        misfit = np.abs(self._misfit @ change)
        if misfit.max() > CONSISTENT:
            segment = self._tags[int(np.argmax(misfit))].segments[0]
            stretch = "" if "stretch" in self._segments[segment] else ", without elongation (this chain has no stretch joints)"
            return (
                f"muscle lengths that one arc a segment explains{stretch}; those of segment {segment} miss the nearest arc by "
                f"{misfit.max():.3g} m, allowed {CONSISTENT:g} m"
            )
        spread = self.spread @ change
        for segment, bending, _ in self._bendings(motors):
            stretches = self._segments[segment].get("stretch")
            length = self._section_lengths[segment]
            if stretches is not None and length + float(spread[list(stretches)].min()) <= _LEAST_LENGTH * length:
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
        limited = np.array(motors)
        first = len(motors) - len(self._tags)
        for segment, bending, _ in self._bendings(motors):
            if bending > self._largest_bending:
                rows = [first + row for row, tag in enumerate(self._tags) if tag.segments[0] == segment]
                arms = muscle_arms([tag for tag in self._tags if tag.segments[0] == segment])
                rest = self.paths.rest[[row - first for row in rows]]
                sums = np.linalg.lstsq(arms, limited[rows] - rest, rcond=None)[0]
                limited[rows] -= arms[:, :2] @ sums[:2] * (1.0 - self._largest_bending / bending)
        return limited

    def reached_range(self, motors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the bending of segments at the limit of their sections; see `Actuators.active_limits`."""
        slopes, bends = [], []
        count = len(motors)
        for _, bending, (x, y) in self._bendings(motors):
            if bending >= self._largest_bending * (1.0 - 1e-9):
                spread = self.spread[[x, y]] @ self._change(motors)
                along, across = np.zeros(count), np.zeros(count)
                along[count - len(self._tags) :] = (spread[0] * self.spread[x] + spread[1] * self.spread[y]) / bending
                across[count - len(self._tags) :] = (spread[0] * self.spread[y] - spread[1] * self.spread[x]) / bending
                slopes.append(along)
                bends.append(across / np.sqrt(bending))
        return np.array(slopes).reshape(-1, count), np.array(bends).reshape(-1, count)

    def _bendings(self, motors: FloatArray) -> list[tuple[int, float, tuple[int, int]]]:
        """Each segment with muscles: number, largest bending of a section [rad], places of the two bendings of that section."""
        spread = self.spread @ self._change(motors)
        bendings = []
        for segment, about_x, about_y in self._bent:
            sizes = np.hypot(spread[about_x], spread[about_y])
            most = int(sizes.argmax())
            bendings.append((segment, float(sizes[most]), (int(about_x[most]), int(about_y[most]))))
        return bendings


def _differences(stiffness: FloatArray) -> FloatArray:
    """Orthonormal columns of sum zero, shape (n, n - 1), that diagonalise the stiffness; cosines where it is uniform."""
    n = len(stiffness)
    places = (np.arange(n) + 0.5)[:, None]
    cosines = np.sqrt(2.0 / n) * np.cos(np.pi * places * np.arange(1, n) / n)
    if np.ptp(stiffness) <= 1e-12 * float(stiffness.max()):
        return np.asarray(cosines)
    vectors: Any = np.linalg.eigh(cosines.T @ (stiffness[:, None] * cosines))[1]
    return np.asarray(cosines @ vectors)
