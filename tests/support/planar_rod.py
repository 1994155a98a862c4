"""A rod that moves in a plane, to many digits over long times: polynomials along the rod, Runge and Kutta's method in time.

The angle of the centre line is `theta(s, t) = sum a_k(t) s P_k(s)`, its stretch `sum b_k(t) P_k(s)`, with Legendre polynomials,
so that the clamp at s = 0 holds and the free end follows from the principle of virtual work; integrals are sums over Gauss
points. The error falls exponentially with their number where the motion is smooth. No shear; the section turns with
the centre line and has its rotary inertia. The rod is clamped at the origin, along +z at rest; SI units. Nothing here is of
softrobots.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import root

from tests.support.round_rods import RoundRod


@njit(cache=True)
def _out_of_balance(y, v, force, grid, constants, matrix, forces, tip):  # type: ignore[no-untyped-def]
    """Mass matrix, and generalized forces less those of the acceleration that coordinates with constant rates have; the tip.

    Loops, no matrix products: numba compiles these in a second, and calls of BLAS take longer than such small products.
    """
    w, running, bend, stretch, turning, stiffness = grid
    density, inertia, retardation, gravity_x, gravity_z = constants
    bends, count, wide = bend.shape[1], y.size, 2 * y.size + 2
    columns = np.zeros((w.size, wide))  # slopes of x and of z by the coordinates, accelerations at constant rates
    tip[0] = tip[1] = 0.0
    for k in range(count):
        forces[k] = 0.0
        for j in range(count):
            forces[k] -= stiffness[k, j] * (y[j] + retardation * v[j])
            matrix[k, j] = inertia * turning[k, j] if k < bends and j < bends else 0.0
    for i in range(w.size):
        angle, rate, length, lengthening = 0.0, 0.0, 1.0, 0.0
        for k in range(bends):
            angle, rate = angle + bend[i, k] * y[k], rate + bend[i, k] * v[k]
        for k in range(count - bends):
            length, lengthening = length + stretch[i, k] * y[bends + k], lengthening + stretch[i, k] * v[bends + k]
        sine, cosine, centripetal = math.sin(angle), math.cos(angle), length * rate * rate
        for k in range(bends):
            columns[i, k], columns[i, count + k] = length * cosine * bend[i, k], -length * sine * bend[i, k]
        for k in range(bends, count):
            columns[i, k], columns[i, count + k] = sine * stretch[i, k - bends], cosine * stretch[i, k - bends]
        columns[i, 2 * count] = 2.0 * lengthening * rate * cosine - centripetal * sine
        columns[i, 2 * count + 1] = -2.0 * lengthening * rate * sine - centripetal * cosine
        tip[0] += w[i] * length * sine
        tip[1] += w[i] * length * cosine
        for k in range(count):
            forces[k] += w[i] * (force[0] * columns[i, k] + force[1] * columns[i, count + k])
    row = np.zeros(wide)
    for i in range(w.size):
        for k in range(wide):
            row[k] = 0.0
        for j in range(w.size):
            for k in range(wide):
                row[k] += running[i, j] * columns[j, k]
        mass = density * w[i]
        for k in range(count):
            x, z = mass * row[k], mass * row[count + k]
            forces[k] += x * (gravity_x - row[2 * count]) + z * (gravity_z - row[2 * count + 1])
            for j in range(count):
                matrix[k, j] += x * row[j] + z * row[count + j]


@njit(cache=True)
def _solve(matrix, forces):  # type: ignore[no-untyped-def]
    """Accelerations in place of the forces, by Cholesky's decomposition in place of the matrix."""
    for i in range(forces.size):
        for j in range(i + 1):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(matrix[i, i]) if i == j else matrix[i, j] / matrix[j, j]
        for k in range(i):
            forces[i] -= matrix[i, k] * forces[k]
        forces[i] /= matrix[i, i]
    for i in range(forces.size - 1, -1, -1):
        for k in range(i + 1, forces.size):
            forces[i] -= matrix[k, i] * forces[k]
        forces[i] /= matrix[i, i]


@njit(cache=True)
def _runge_kutta(start, force, grid, constants, step, steps, stride):  # type: ignore[no-untyped-def]
    """Path of the tip from rest every `stride` steps, by the classical method of order 4."""
    count, tips, tip = start.size, np.zeros((steps // stride + 1, 2)), np.zeros(2)
    matrix, a, at, rate = np.zeros((count, count)), np.zeros(count), np.zeros(count), np.zeros(count)
    states = np.zeros((4, count))  # coordinates and rates of this row and of the next one
    for k in range(count):
        states[0, k] = states[2, k] = start[k]
    for number in range(steps + 1):
        for stage in range(4):
            part = 0.0 if stage == 0 else step if stage == 3 else 0.5 * step
            share = step / 6.0 if stage == 0 or stage == 3 else step / 3.0
            for k in range(count):
                at[k], rate[k] = states[0, k] + part * rate[k], states[1, k] + part * a[k]
            _out_of_balance(at, rate, force, grid, constants, matrix, a, tip)
            _solve(matrix, a)
            if stage == 0 and number % stride == 0:
                tips[number // stride, 0], tips[number // stride, 1] = tip[0], tip[1]
            for k in range(count):
                states[2, k] += share * rate[k]
                states[3, k] += share * a[k]
        for k in range(count):
            states[0, k], states[1, k] = states[2, k], states[3, k]
    return tips


@dataclass(frozen=True)
class PlanarRod(RoundRod):
    """A round rod, and its discretisation.

    Attributes:
        bends: polynomials of the angle.
        stretches: polynomials of the stretch; none for an inextensible rod.
        retardation: of Kelvin and Voigt, damping over stiffness [s].
        gravity: along x and z [m/s^2].
    """

    bends: int = 12
    stretches: int = 0
    retardation: float = 0.0
    gravity: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def _grid(self) -> tuple[np.ndarray, ...]:
        """Weights and running integral at the Gauss points, values of both sets of polynomials there, stiffness."""
        count = self.bends + 10
        points, weights = legendre.leggauss(count)
        s, half = 0.5 * (points + 1.0), 0.5 * self.length
        values = legendre.legvander(points, count - 1)
        fit = np.linalg.inv(values)  # coefficients of the polynomial through values at the points
        integrals = np.stack([legendre.legval(points, legendre.legint(row, lbnd=-1)) for row in np.eye(count)], 1)
        bend = s[:, None] * values[:, : self.bends]
        curvature = np.stack([legendre.legval(points, legendre.legder(fit @ column)) for column in bend.T], 1) / half
        stretch = values[:, : self.stretches]
        stiffness = np.zeros((self.bends + self.stretches,) * 2)
        w = half * weights
        axial = self.young * self.area
        stiffness[: self.bends, : self.bends] = self.bending * curvature.T @ (w[:, None] * curvature)
        stiffness[self.bends :, self.bends :] = axial * stretch.T @ (w[:, None] * stretch)
        turning = bend.T @ (w[:, None] * bend)  # squares of the rate of the angle
        return w, half * integrals @ fit, np.ascontiguousarray(bend), np.ascontiguousarray(stretch), turning, stiffness

    def _at(self, y: np.ndarray, v: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        matrix, forces, tip = np.zeros((y.size, y.size)), np.zeros(y.size), np.zeros(2)
        _out_of_balance(y, v, np.asarray(force, dtype=float), self._grid, self._constants, matrix, forces, tip)
        return matrix, forces, tip

    @property
    def _constants(self) -> tuple[float, ...]:
        per_length = self.density * self.area
        return per_length, per_length * self.radius**2 / 4.0, self.retardation, *map(float, self.gravity)

    def tip(self, y: np.ndarray) -> np.ndarray:
        """Where the tip is, x and z, shape (2,) [m]."""
        return self._at(y, 0.0 * y, np.zeros(2))[2]

    def frequencies(self) -> np.ndarray:
        """Of small vibrations of the straight weightless rod [rad/s]."""
        rest = np.zeros(self.bends + self.stretches)
        return np.asarray(np.sqrt(eigh(self._grid[-1], self._at(rest, rest, np.zeros(2))[0], eigvals_only=True)))

    def equilibrium(self, force: tuple[float, float]) -> np.ndarray:
        """Coordinates at rest under a force on the tip along x and z [N]: SciPy's root from the straight rod, in steps."""
        y = np.zeros(self.bends + self.stretches)
        scale = np.diag(self._grid[-1])
        for part in np.linspace(0.1, 1.0, 10):
            y = root(lambda y, f: self._at(y, 0.0 * y, f)[1] / scale, y, (part * np.array(force),), tol=1e-13).x
        return y

    def tips(self, start: np.ndarray, duration: float, rows: int, per_row: int) -> np.ndarray:
        """Path of the tip from rest at coordinates `start`, shape (rows + 1, 2) [m], with `per_row` steps between two rows."""
        arguments = np.zeros(2), self._grid, self._constants, duration / (rows * per_row), rows * per_row, per_row
        path: np.ndarray = _runge_kutta(start, *arguments)
        return path
