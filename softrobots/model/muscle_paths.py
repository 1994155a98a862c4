r"""Lengths of the routes of actuators as functions of the strains.

The tangent of a route is affine in the section coordinates `z = (a, b, t, e)` (bending about x and y, twist, elongation), at
each of its points `p` (`softrobots.description.route_points`): in axes along and across the tangent of the unstrained body,

.. math:: l = l_0 + \sum_p \Bigl(\sqrt{A_p^2 + |B_p|^2} - h_p\Bigr), \qquad A_p = h_p + a_p \cdot z, \quad B_p = b_p z

A straight route at distance `d` and azimuth `phi` has one point in a section of rest length `h` (theory 4.3):

.. math:: A = h + e + d \sin\phi\,a - d \cos\phi\,b, \qquad B = (d\,t, 0)

Without twist that is [PCC paper] (20-22), linear in the section coordinates. The *excess* over the linear part gives tension a
torsional stiffness: :math:`\partial^2 l/\partial t_i^2 = d^2 / A_i` at `t = 0`, so that a rod of torsional stiffness `GJ`
under tensions `T` has :math:`GJ + \sum T d^2` to first order, and a push above `GJ / d^2` buckles it in torsion. A lumped
section is a set of joint springs in every tool; along it the excess of a straight route is the separable second-order part,
:math:`(d\,t_i)^2 / (2 h_i)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.checks import FloatArray, read_only
from softrobots.description.route_points import RoutePoint, route_points
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.sections import SectionRow

MUSCLE_STRAINS = ("bend_x", "bend_y", "stretch")
"""The section coordinates whose sums over a segment give the muscle lengths without twist."""

_SHORTEST = 1e-3  # length of a muscle along its tangent at rest, relative to its length there
_TWIST = STRAINS.index("twist")


class MusclePaths:
    """The actuators of a robot along the sections that they pass; a *path* is a point of a route for part of a section."""

    def __init__(self, tags: Sequence[ActuatorTag], sections: Sequence[SectionRow], count: int) -> None:
        """Take the actuators, all sections of the robot, base to tip, and the number of its strains."""
        spans = [(row.segment, row.length) for row in sections]
        pairs = [(m, point, sections[point.section]) for m, tag in enumerate(tags) for point in route_points(tag.route, spans)]
        self.sections = tuple(row.name for *_, row in pairs)
        """Name of the section of each path, (n_paths)."""
        self.lumped = any(row.lumped for row in sections)
        """Whether the sections are lumped."""
        self.count = count
        """Number of strains."""
        self.muscle = np.array([m for m, *_ in pairs], dtype=np.intp)
        """Actuator of each path, shape (n_paths,)."""
        self.starts = np.flatnonzero(np.diff(self.muscle, prepend=-1))
        """First path of each actuator, shape (n_muscles,)."""
        self.places = np.array([[row.places.get(key, count) for key in STRAINS] for *_, row in pairs], dtype=np.intp)
        """Places of the four section coordinates of each path among the strains, `count` if locked, shape (n_paths, 4)."""
        self.places = self.places.reshape(-1, len(STRAINS))
        winding = np.array([point.widening != 0.0 or point.winding != 0.0 for _, point, _ in pairs], dtype=bool)
        self.straight = not winding.any()
        """Whether all run straight."""
        self.separable = ~winding & self.lumped
        """Whether the path is straight along a lumped section, shape (n_paths,)."""
        frames = [_tangent(point, row) for _, point, row in pairs]
        self.length = read_only(np.array([length for length, _ in frames]))
        """Length of each path where all strains are zero, shape (n_paths,) [m]."""
        slopes = np.array([slope for _, slope in frames]).reshape(-1, 3, len(STRAINS))
        self.arms = read_only(slopes[:, 2])
        """Derivative of `A` of each path with respect to the section coordinates, shape (n_paths, 4) [m/rad or -]."""
        self.across = read_only(slopes[:, 1::-1])
        """Derivative of `B` with respect to them, shape (n_paths, 2, 4); its second row is zero at constant distance."""
        self.distance = read_only(self.across[:, 0, _TWIST])
        """Of straight paths: distance from the backbone times the share of the section, shape (n_paths,) [m]."""
        origin = np.array([row.origin for *_, row in pairs]).reshape(-1, len(STRAINS))
        self.origin = read_only(origin)
        """Section coordinates where all strains are zero, shape (n_paths, 4) [rad, rad, rad, m]."""
        self.turned = read_only(np.where(self.separable, self.distance * origin[:, _TWIST], 0.0))
        """First component of `B` there, shape (n_paths,) [m]."""
        self.conical = bool(np.any(self.across[:, 1]))
        """Whether the distance of a route varies."""
        matrix = np.zeros((len(tags), count + 1))
        np.add.at(matrix, (self.muscle[:, None], self.places), self.arms)
        self.matrix = read_only(matrix[:, :count])
        """Linear part of the lengths: their derivative by the strains without twist, shape (n_muscles, count)."""
        relaxed = np.zeros(count + 1)
        for row in sections:
            relaxed[[row.places.get(key, count) for key in STRAINS]] = row.rest - row.origin
        at_rest = np.array([tag.rest_length for tag in tags])
        self.straightened = read_only(-self.at(relaxed[:count]).change if len(tags) else at_rest)
        """Lengths where all strains are zero beyond those at rest, shape (n_muscles,) [m]."""
        self.rest = read_only(at_rest + self.straightened)
        """Lengths where all strains are zero, shape (n_muscles,) [m]."""

    def at(self, strains: FloatArray) -> MusclePathsAt:
        """Return the lengths at strains, shape (count,)."""
        return MusclePathsAt(self, strains)


def _tangent(point: RoutePoint, row: SectionRow) -> tuple[float, FloatArray]:
    """Length of a path at zero strains, and the derivative of its tangent in axes of which the last is along it, shape (3, 4).

    Straight paths have radial, circumferential and axial components.
    """
    bend_x, bend_y, twist, stretch = row.origin / row.length
    share = point.weight / row.length
    aside = point.distance * np.array([np.sin(point.azimuth), -np.cos(point.azimuth)])
    slope = np.zeros((3, len(STRAINS)))
    slope[1, _TWIST] = share * point.distance
    slope[2] = share * np.array([aside[0], aside[1], 0.0, 1.0])
    if point.widening == 0.0 and point.winding == 0.0:
        return point.weight, slope
    along = 1.0 + stretch + aside[0] * bend_x + aside[1] * bend_y
    tangent = np.array([point.widening, point.distance * (point.winding + twist), along])
    size = float(np.linalg.norm(tangent))
    tangent /= size
    radial = np.array([1.0, 0.0, 0.0]) - tangent[0] * tangent
    radial /= np.linalg.norm(radial)
    return point.weight * size, np.array([radial, np.cross(tangent, radial), tangent]) @ slope


class MusclePathsAt:
    """Lengths of the actuators at given strains, with derivatives; `excess` and `slopes` also for many rows of strains."""

    def __init__(self, paths: MusclePaths, strains: FloatArray) -> None:
        """Evaluate the paths along all sections."""
        self._paths, self._strains = paths, strains
        z = np.concatenate([strains, np.zeros((*strains.shape[:-1], 1))], axis=-1)[..., paths.places]
        self._around = paths.turned + (z * paths.across[:, 0]).sum(axis=-1)
        self._radial = (z * paths.across[:, 1]).sum(axis=-1) if paths.conical else 0.0
        self._across = np.hypot(self._around, self._radial) if paths.conical else np.abs(self._around)
        self._along = paths.length + (z * paths.arms).sum(axis=-1)
        self._folds = (self._along <= _SHORTEST * paths.length) & ~paths.separable
        self.valid = not self._folds.any()
        """Whether no route folds within a section; otherwise lengths and derivatives have no meaning."""
        self._size = np.where(paths.separable, paths.length, np.hypot(self._along, self._across))

    @property
    def folded(self) -> frozenset[str]:
        """Names of the sections in which a route folds."""
        return frozenset(name for name, folds in zip(self._paths.sections, self._folds.tolist(), strict=True) if folds)

    @cached_property
    def excess(self) -> FloatArray:
        """Lengths beyond their linear part `matrix @ strains`, shape (..., n_muscles) [m]."""
        starts, each = self._paths.starts, self._excess_of_paths
        return np.add.reduceat(each, starts, axis=-1) if len(starts) else np.zeros((*each.shape[:-1], 0))

    @property
    def _excess_of_paths(self) -> FloatArray:
        paths, size = self._paths, self._size
        each = self._across**2 / (size + np.where(paths.separable, size, np.maximum(self._along, 0.0)))
        return np.asarray(each - paths.turned**2 / (2.0 * paths.length))

    @property
    def pieces(self) -> FloatArray:
        """Length of each path, shape (n_paths,) [m]."""
        return np.asarray(self._along + self._excess_of_paths)

    @property
    def change(self) -> FloatArray:
        """Lengths minus those where all strains are zero, shape (n_muscles,) [m]."""
        return np.asarray(self._paths.matrix @ self._strains + self.excess)

    @property
    def elongation(self) -> FloatArray:
        """Lengths minus those at rest, shape (n_muscles,) [m]."""
        return np.asarray(self._paths.straightened + self.change)

    @property
    def arms(self) -> FloatArray:
        """Derivative of the lengths with respect to the strains, shape (n_muscles, count)."""
        return np.asarray(self._paths.matrix + self.slopes)

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivative of the excess with respect to the strains, shape (..., n_muscles, count)."""
        paths, each = self._paths, self._slopes_of_paths
        slopes = np.zeros((*each.shape[:-2], len(paths.rest), paths.count + 1))
        places: Any = (..., paths.muscle[:, None], paths.places)
        np.add.at(slopes, places, each)
        return slopes[..., : paths.count]

    @property
    def _slopes_of_paths(self) -> FloatArray:
        """Derivative of the excess of each path with respect to the section coordinates, shape (..., n_paths, 4)."""
        paths, size = self._paths, self._size
        back = np.where(paths.separable, 0.0, -(self._across**2) / (size * (size + self._along)))
        each = paths.arms * back[..., None] + paths.across[:, 0] * (self._around / size)[..., None]
        if paths.conical:
            each += paths.across[:, 1] * (self._radial / size)[..., None]
        return np.asarray(each)

    @property
    def piece_arms(self) -> FloatArray:
        """Derivative of `pieces` with respect to the strains, shape (n_paths, count)."""
        paths = self._paths
        arms = np.zeros((len(paths.muscle), paths.count + 1))
        arms[np.arange(len(arms))[:, None], paths.places] = paths.arms + self._slopes_of_paths
        return arms[:, : paths.count]

    def curvature(self, tensions: FloatArray) -> FloatArray:
        """Return the second derivatives of the lengths times tensions, `sum_m tensions_m d^2 l_m`, shape (count, count)."""
        return self.stiffening(tensions[self._paths.muscle])

    def stiffening(self, pulls: FloatArray) -> FloatArray:
        """Return the same for the tension in each path, shape (n_paths,) [N].

        The second derivative of one path is the square of the change of its tangent across the path, over its length.
        """
        paths, across = self._paths, self._turning
        weighted = across * (pulls / self._size)[:, None, None]
        blocks = np.swapaxes(across, -1, -2) @ weighted
        total = np.zeros((paths.count + 1, paths.count + 1))
        np.add.at(total, (paths.places[:, :, None], paths.places[:, None, :]), blocks)
        return total[: paths.count, : paths.count]

    def second(self, rates: FloatArray) -> FloatArray:
        """Return the second derivatives of the lengths along rates of the strains, shape (count,), shape (n_muscles,)."""
        paths = self._paths
        turned = (self._turning * np.append(rates, 0.0)[paths.places][:, None, :]).sum(axis=-1)
        each = (turned**2).sum(axis=-1) / self._size
        return np.asarray(np.add.reduceat(each, paths.starts)) if len(paths.starts) else np.zeros(0)

    @property
    def _turning(self) -> FloatArray:
        """Change of each tangent across itself per section coordinate, along one axis or two, shape (n_paths, 1 or 2, 4)."""
        paths, size = self._paths, self._size
        if not paths.conical:
            around, back = self._around, paths.across[:, 0]
        else:
            still = self._across == 0.0
            share = 1.0 / np.where(still, 1.0, self._across)
            cosine, sine = np.where(still, 1.0, self._around * share), self._radial * share
            around = self._across
            back = paths.across[:, 0] * cosine[:, None] + paths.across[:, 1] * sine[:, None]
            aside = paths.across[:, 1] * cosine[:, None] - paths.across[:, 0] * sine[:, None]
        turning = back * np.where(paths.separable, 1.0, self._along / size)[:, None]
        turning -= paths.arms * np.where(paths.separable, 0.0, around / size)[:, None]
        return turning[:, None] if not paths.conical else np.stack([turning, aside], axis=1)
