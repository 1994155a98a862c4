"""A robot at given muscle lengths: its load and its motion, reduced to the free coordinates.

The equations are in `softrobots.model.muscle_lengths`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.coordinates import ReducedLoad
from softrobots.model.joint_loads import JointLoad
from softrobots.model.muscles import MusclePoint


@dataclass(frozen=True, eq=False)
class MuscleLengthPoint(MusclePoint):
    """A robot at given muscle lengths."""

    held: Any
    """The constraint, a `softrobots.model.muscle_lengths.MuscleLengths`."""
    sums: FloatArray
    """Sums of its strains."""
    given: FloatArray
    """The same without twist."""
    strains: FloatArray
    """Its strains."""
    solved: bool
    """Whether these lengths are possible with the free coordinates."""

    @property
    def valid(self) -> bool:
        """Whether every section and every muscle is within its range, and the twist leaves the lengths possible."""
        return self.solved and super().valid

    @cached_property
    def _sum_slopes(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the sums with respect to the lengths and to the free coordinates."""
        held, paths = self.held, self.paths
        by_lengths = np.asarray(np.linalg.solve(held.gap_slope(paths), held.slopes), dtype=np.float64)
        return by_lengths, -by_lengths @ (paths.slopes @ held.free)

    @property
    def strain_slopes(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the strains by the lengths, shape (n_strains, n_muscles), and by the free coordinates."""
        by_lengths, by_free = self._sum_slopes
        return self.held.shares @ by_lengths, self.held.free + self.held.shares @ by_free

    def reduce(self, joints: JointLoad) -> ReducedLoad:
        """Transform to lengths and free coordinates; the load on a muscle is its tension, that of the springs included.

        The energy of the sums is that beyond the state without twist. The tensions of winding muscles count in the scale.
        """
        load, held, paths = self.inner.reduce(joints), self.held, self.paths
        by_lengths, by_free = self._sum_slopes
        to_lengths, to_free = self.strain_slopes
        stiffness, tensions = held.sum_stiffness, self._tensions(load.elastic)
        half = to_free.T @ (load.derivative - paths.curvature(tensions))
        stiff = stiffness[:, None] * by_free
        change, middle = self.sums - self.given, 0.5 * (self.sums + self.given) - held.sum_rest
        return ReducedLoad(
            np.concatenate([load.motors, tensions]),
            (load.elastic - tensions @ paths.slopes) @ held.free,
            half @ to_free - by_free.T @ stiff,
            np.concatenate([to_free.T @ load.coupling, half @ to_lengths - stiff.T @ by_lengths], axis=1),
            load.potential + float(stiffness @ (change * middle)),
            load.scale + (0.0 if held.groups else float(np.abs(tensions).sum())),
        )

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns per motor and length, and per free coordinate."""
        motors, elastic = self.inner.columns(jacobian)
        by_lengths, by_free = self._sum_slopes
        by_sums = elastic @ self.held.shares
        return np.concatenate([motors, by_sums @ by_lengths], axis=1), elastic @ self.held.free + by_sums @ by_free

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        r"""Derivatives of the loads on motors and of the tensions, by motors and lengths and by free coordinates.

        That of the tensions is :math:`-z_l^T (K - w_z + \sum t_m l_m'') (z_l, z_y)`.
        """
        inner, held, paths = self.inner.reduce(load), self.held, self.paths
        by_motors, by_strains = self.inner.motor_derivatives(load)
        to_lengths, to_free = self.strain_slopes
        stiffness = np.diag(held.strain_springs.stiffness)
        stiffening = to_lengths.T @ (inner.derivative - paths.curvature(self._tensions(inner.elastic)) - stiffness)
        return (
            np.block([[by_motors, by_strains @ to_lengths], [to_lengths.T @ inner.coupling, stiffening @ to_lengths]]),
            np.concatenate([by_strains @ to_free, stiffening @ to_free]),
        )

    def _tensions(self, strains: FloatArray) -> FloatArray:
        """Tension of each muscle under a load on the strains of the robot without muscles, shape (n_muscles,) [N]."""
        springs = self.held.strain_springs
        carried = strains - springs.stiffness * (self.strains - springs.rest)
        return np.asarray(carried @ self.held.shares @ self._sum_slopes[0])

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Loads on motors and lengths, and on the free coordinates, see `reduce`."""
        motors, strains = self.inner.loads(torque)
        tensions = self._tensions(strains)
        return np.concatenate([motors, tensions]), (strains - tensions @ self.paths.slopes) @ self.held.free

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint rates at rates of motors, lengths and free coordinates."""
        return self.inner.velocity(*self._inner_rates(motors, elastic))

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint accelerations, with those of the sums that keep the rates of the lengths, `A Sdd = -P zd^T c_zz zd`."""
        inner, rates = self._inner_rates(motors, elastic)
        strains = -self.held.shares @ (self._sum_slopes[0] @ self.paths.second(rates))
        return self.inner.velocity_product(inner, rates) + self.inner.velocity(np.zeros_like(inner), strains)

    def _inner_rates(self, motors: FloatArray, elastic: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates of the motors and of the strains."""
        count = len(motors) - self.held.slopes.shape[1]
        by_lengths, by_free = self._sum_slopes
        strains = self.held.free @ elastic + self.held.shares @ (by_lengths @ motors[count:] + by_free @ elastic)
        return motors[:count], strains
