"""A rod that moves in a plane, to many digits over long times: polynomials along the rod, Runge and Kutta's method in time.

The angle of the centre line is `theta(s, t) = sum a_k(t) s P_k(s)`, its stretch `sum b_k(t) P_k(s)`, with Legendre polynomials,
so that the clamp at s = 0 holds and the free end follows from the principle of virtual work; integrals are sums over Gauss
points. The error falls exponentially with their number where the motion is smooth. No shear; the section turns with
the centre line and has its rotary inertia. The rod is clamped at the origin, along +z at rest; SI units. Nothing here is of
softrobots.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.polynomial import legendre
from scipy.linalg import eigh
from scipy.optimize import root

from tests.support.round_rods import RoundRod


@njit(cache=True)
def _out_of_balance(y, v, force, grid, constants):  # type: ignore[no-untyped-def]
    """Mass matrix, and generalized forces less those of the acceleration that coordinates with constant rates have; the tip."""
    w, running, bend, stretch, turning, stiffness = grid
    density, inertia, retardation, gravity_x, gravity_z = constants
    bends, count = bend.shape[1], y.size
    angle, rate = bend @ y[:bends], bend @ v[:bends]
    length, lengthening = 1.0 + stretch @ y[bends:], stretch @ v[bends:]
    sine, cosine = np.sin(angle), np.cos(angle)
    columns = np.zeros((w.size, 2 * count + 2))  # slopes of x and of z by the coordinates, accelerations at constant rates
    for i in range(w.size):
        for k in range(bends):
            columns[i, k], columns[i, count + k] = length[i] * cosine[i] * bend[i, k], -length[i] * sine[i] * bend[i, k]
        for k in range(bends, count):
            columns[i, k], columns[i, count + k] = sine[i] * stretch[i, k - bends], cosine[i] * stretch[i, k - bends]
        centripetal = length[i] * rate[i] ** 2
        columns[i, -2] = 2.0 * lengthening[i] * rate[i] * cosine[i] - centripetal * sine[i]
        columns[i, -1] = -2.0 * lengthening[i] * rate[i] * sine[i] - centripetal * cosine[i]
    forces = -(stiffness @ (y + retardation * v))
    if force[0] != 0.0 or force[1] != 0.0:
        ends = w @ columns
        forces += force[0] * ends[:count] + force[1] * ends[count : 2 * count]
    columns = running @ columns
    both = np.zeros((2 * w.size, count))  # the slopes of x above those of z, times the root of the mass
    acceleration = np.zeros(2 * w.size)
    for i in range(w.size):
        weight = np.sqrt(density * w[i])
        acceleration[i] = weight * (gravity_x - columns[i, -2])
        acceleration[w.size + i] = weight * (gravity_z - columns[i, -1])
        for k in range(count):
            both[i, k], both[w.size + i, k] = weight * columns[i, k], weight * columns[i, count + k]
    forces += acceleration @ both
    matrix = both.T @ both
    matrix[:bends, :bends] += inertia * turning
    return matrix, forces, np.array([np.sum(w * length * sine), np.sum(w * length * cosine)])


@njit(cache=True)
def _runge_kutta(y, v, force, grid, constants, step, steps, stride):  # type: ignore[no-untyped-def]
    """Path of the tip every `stride` steps, by the classical method of order 4."""
    tips = np.zeros((steps // stride + 1, 2))
    for number in range(steps + 1):
        matrix, forces, tip = _out_of_balance(y, v, force, grid, constants)
        if number % stride == 0:
            tips[number // stride] = tip
        a1 = np.linalg.solve(matrix, forces)
        matrix, forces, tip = _out_of_balance(y + 0.5 * step * v, v + 0.5 * step * a1, force, grid, constants)
        a2 = np.linalg.solve(matrix, forces)
        middle = v + 0.5 * step * a1
        matrix, forces, tip = _out_of_balance(y + 0.5 * step * middle, v + 0.5 * step * a2, force, grid, constants)
        a3 = np.linalg.solve(matrix, forces)
        end = v + 0.5 * step * a2
        matrix, forces, tip = _out_of_balance(y + step * end, v + step * a3, force, grid, constants)
        a4 = np.linalg.solve(matrix, forces)
        y = y + step / 6.0 * (v + 2.0 * middle + 2.0 * end + v + step * a3)
        v = v + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
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
        count = 2 * self.bends + 16
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
        return _out_of_balance(y, v, np.asarray(force, dtype=float), self._grid, self._constants)

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
        return np.sqrt(eigh(self._grid[-1], self._at(rest, rest, np.zeros(2))[0], eigvals_only=True))

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
        return _runge_kutta(start, 0.0 * start, *arguments)
