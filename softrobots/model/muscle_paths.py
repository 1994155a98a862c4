r"""Paths of muscles along a segment, and their lengths as functions of the strains.

In a section of constant strain a muscle at distance `d` and azimuth `phi` runs on a helix around the backbone. With the section
coordinates `(a, b, t, e)` (bending about x and y, twist, elongation) and the rest length `h` of each section `i` it has the
length (theory 4.3)

.. math:: l = l_0 + \sum_i \Bigl(\sqrt{A_i^2 + (d\,t_i)^2} - h_i\Bigr), \qquad
          A_i = h_i + e_i + d \sin\phi\,a_i - d \cos\phi\,b_i

Without twist that is [PCC paper] (20-22), linear in the section coordinates. The *excess* over that linear part gives tension a
torsional stiffness: :math:`\partial^2 l/\partial t_i^2 = d^2 / A_i` at `t = 0`, so that a rod of torsional stiffness `GJ`
under tensions `T` has :math:`GJ + \sum T d^2` to first order, and a push above `GJ / d^2` buckles it in torsion. A lumped
section is a set of joint springs in every tool; its excess is the separable second-order part, :math:`(d\,t_i)^2 / (2 h_i)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.checks import FloatArray, read_only
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.sections import SectionRow

MUSCLE_STRAINS = ("bend_x", "bend_y", "stretch")
"""The section coordinates whose sums over a segment give the muscle lengths without twist."""

_SHORTEST = 1e-3  # length of a muscle along a section without twist, relative to the rest length of the section
_TWIST = STRAINS.index("twist")


def muscle_arms(tags: Sequence[ActuatorTag]) -> FloatArray:
    """Derivative of the lengths with respect to the sums of bending and elongation, shape (n, 3) [m/rad, m/rad, -]."""
    return np.array([(tag.distance * np.sin(tag.azimuth), -tag.distance * np.cos(tag.azimuth), 1.0) for tag in tags])


class MusclePaths:
    """The muscles of a robot, each along the sections of its segment."""

    def __init__(self, tags: Sequence[ActuatorTag], sections: Sequence[SectionRow], count: int) -> None:
        """Take the muscles, all sections of the robot, and the number of its strains."""
        pairs = [(m, tag, row) for m, tag in enumerate(tags) for row in sections if row.segment in tag.segments]
        self.sections = tuple(row.name for *_, row in pairs)
        """Name of the section of each path, (n_paths)."""
        self.rest = read_only(np.array([tag.rest_length for tag in tags]))
        """Muscle lengths where all strains are zero, shape (n_muscles,) [m]."""
        self.lumped = any(row.lumped for row in sections)
        """Whether the sections are lumped."""
        self.count = count
        """Number of strains."""
        self.muscle = np.array([m for m, _, _ in pairs], dtype=np.intp)
        """Muscle of each path along a section, shape (n_paths,)."""
        self.starts = np.flatnonzero(np.diff(self.muscle, prepend=-1))
        """First path of each muscle, shape (n_muscles,)."""
        self.places = np.array([[row.places.get(key, count) for key in STRAINS] for *_, row in pairs], dtype=np.intp)
        """Places of the four section coordinates of each path among the strains, `count` if locked, shape (n_paths, 4)."""
        self.places = self.places.reshape(-1, len(STRAINS))
        arms = muscle_arms([tag for _, tag, _ in pairs]).reshape(-1, 3)
        self.arms = read_only(np.insert(arms, _TWIST, 0.0, axis=1))
        """Derivative of `A` of each path with respect to those, shape (n_paths, 4) [m/rad, m/rad, m/rad, -]."""
        self.distance = read_only(np.array([tag.distance for _, tag, _ in pairs]))
        """Distance from the backbone, shape (n_paths,) [m]."""
        self.length = read_only(np.array([row.length for *_, row in pairs]))
        """Rest length of the section, shape (n_paths,) [m]."""
        self.origin = read_only(np.array([row.origin for *_, row in pairs]).reshape(-1, 4))
        """Section coordinates where all strains are zero, shape (n_paths, 4) [rad, rad, rad, m]."""
        matrix = np.zeros((len(tags), count + 1))
        matrix[self.muscle[:, None], self.places] = self.arms
        self.matrix = read_only(matrix[:, :count])
        """Derivative of the lengths without twist with respect to the strains, shape (n_muscles, count)."""

    def at(self, strains: FloatArray) -> MusclePathsAt:
        """Return the lengths at strains, shape (count,)."""
        return MusclePathsAt(self, strains)


class MusclePathsAt:
    """Muscle lengths of a robot at given strains, with derivatives; `excess` also for many rows of strains."""

    def __init__(self, paths: MusclePaths, strains: FloatArray) -> None:
        """Evaluate the paths along all sections."""
        self._paths, self._strains = paths, strains
        z = np.concatenate([strains, np.zeros((*strains.shape[:-1], 1))], axis=-1)[..., paths.places] + paths.origin
        self._across = paths.distance * z[..., _TWIST]
        self._along = paths.length + (z * paths.arms).sum(axis=-1)
        self._folds = (self._along <= _SHORTEST * paths.length) & (not paths.lumped)
        self.valid = not self._folds.any()
        """Whether no muscle folds within a section; otherwise lengths and derivatives have no meaning."""
        self._size = paths.length if paths.lumped else np.hypot(self._along, self._across)

    @property
    def folded(self) -> frozenset[str]:
        """Names of the sections in which a muscle folds."""
        return frozenset(name for name, folds in zip(self._paths.sections, self._folds.tolist(), strict=True) if folds)

    @cached_property
    def excess(self) -> FloatArray:
        """Lengths beyond their linear part `matrix @ strains`, shape (..., n_muscles) [m]."""
        paths, size = self._paths, self._size
        each = self._across**2 / (size + (size if paths.lumped else np.maximum(self._along, 0.0)))
        if paths.lumped:
            each = each - (paths.distance * paths.origin[:, _TWIST]) ** 2 / (2.0 * size)
        return np.add.reduceat(each, paths.starts, axis=-1) if len(paths.starts) else np.zeros((*each.shape[:-1], 0))

    @property
    def change(self) -> FloatArray:
        """Lengths minus those where all strains are zero, shape (n_muscles,) [m]."""
        return np.asarray(self._paths.matrix @ self._strains + self.excess)

    @property
    def arms(self) -> FloatArray:
        """Derivative of the lengths with respect to the strains, shape (n_muscles, count)."""
        return np.asarray(self._paths.matrix + self.slopes)

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivative of the excess with respect to the strains, shape (n_muscles, count)."""
        paths, size = self._paths, self._size
        slopes = np.zeros((len(paths.rest), paths.count + 1))
        each = np.zeros_like(paths.arms)
        if not paths.lumped:
            each = paths.arms * (-(self._across**2) / (size * (size + self._along)))[:, None]
        each[:, _TWIST] = paths.distance * self._across / size
        slopes[paths.muscle[:, None], paths.places] = each
        return slopes[:, : paths.count]

    def curvature(self, tensions: FloatArray) -> FloatArray:
        r"""Return the weighted sum of the second derivatives of the lengths, `sum_m tensions_m d^2 l_m`, shape (count, count).

        That of one path is the square of the change of `(A, d t)` across the path, over its length.
        """
        paths, across = self._paths, self._turning
        blocks = across[:, :, None] * (across * (tensions[paths.muscle] / self._size)[:, None])[:, None, :]
        total = np.zeros((paths.count + 1, paths.count + 1))
        np.add.at(total, (paths.places[:, :, None], paths.places[:, None, :]), blocks)
        return total[: paths.count, : paths.count]

    def second(self, rates: FloatArray) -> FloatArray:
        """Return the second derivatives of the lengths along rates of the strains, shape (count,), shape (n_muscles,)."""
        paths = self._paths
        each = (self._turning * np.append(rates, 0.0)[paths.places]).sum(axis=-1) ** 2 / self._size
        return np.asarray(np.add.reduceat(each, paths.starts)) if len(paths.starts) else np.zeros(0)

    @property
    def _turning(self) -> FloatArray:
        """Change of `(A, d t)` across each path per section coordinate, shape (n_paths, 4)."""
        paths, size = self._paths, self._size
        across = np.zeros_like(paths.arms) if paths.lumped else paths.arms * (-self._across / size)[:, None]
        across[:, _TWIST] = paths.distance * (1.0 if paths.lumped else self._along / size)
        return across
