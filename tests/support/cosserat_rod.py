"""A Cosserat rod that moves in space: finite differences along the rod, SciPy in time. Shares nothing with softrobots.

The staggered grid of [Lang, Linn, Arnold 2011, Multibody System Dynamics 25]: positions at the ends of the cells, rotations in
their middle, as quaternions w, x, y, z. Shear and stretch of a cell are `R^T dx/h - e3`; bending and twist between cells are
twice the vector part of their relative quaternion over their distance, so forces and moments are exact slopes of one energy.
Second order in the size of a cell. The rod is clamped at the origin, straight along +z at rest; forces and moments are dead, in
world axes; SI units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.sparse import csc_matrix

from tests.support.round_rods import RoundRod

NO_LOAD = (0.0,) * 6


@njit(cache=True)
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _turned(q, v, sign):  # type: ignore[no-untyped-def]
    """A vector turned by a unit quaternion, or back with sign -1."""
    axis = q[1], q[2], q[3]
    t = _cross(axis, v)
    c = _cross(axis, t)
    w = sign * q[0]
    return v[0] + 2.0 * (w * t[0] + c[0]), v[1] + 2.0 * (w * t[1] + c[1]), v[2] + 2.0 * (w * t[2] + c[2])


@njit(cache=True)
def _three(y, j, k):  # type: ignore[no-untyped-def]
    return y[j, k], y[j, k + 1], y[j, k + 2]


@njit(cache=True)
def _rates(y, rate, wrench, gravity, h, stiff, mass, inertia, tau, drag):  # type: ignore[no-untyped-def]
    """Time derivative of a state (cells, 13): position and velocity of the far end of each cell, its quaternion and body rate.

    `stiff` are shear, shear and axial stiffness [N], then both of bending and torsion [N m^2]; `inertia` is that of a cell.
    Vectors are tuples: numba compiles these in a tenth of the time.
    """
    cells = len(y)
    pull, torque = np.zeros((cells, 3)), np.zeros((cells, 3))
    x, v, w, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    for j in range(cells):
        a, end, speed, w_j = y[j, 6], _three(y, j, 0), _three(y, j, 3), _three(y, j, 10)
        axis = _three(y, j, 7)
        size = math.sqrt(a * a + axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
        u = a / size, axis[0] / size, axis[1] / size, axis[2] / size
        edge = _turned(u, ((end[0] - x[0]) / h, (end[1] - x[1]) / h, (end[2] - x[2]) / h), -1.0)
        moved = _turned(u, ((speed[0] - v[0]) / h, (speed[1] - v[1]) / h, (speed[2] - v[2]) / h), -1.0)
        spin = _cross(w_j, edge)
        inner = (
            stiff[0] * (edge[0] + tau * (moved[0] - spin[0])),
            stiff[1] * (edge[1] + tau * (moved[1] - spin[1])),
            stiff[2] * (edge[2] + tau * (moved[2] - spin[2]) - 1.0),
        )
        outer = _turned(u, inner, 1.0)
        s = q[0] * u[0] + q[1] * u[1] + q[2] * u[2] + q[3] * u[3]  # relative quaternion (s, b) to the cell before, or the clamp
        c = _cross((q[1], q[2], q[3]), (u[1], u[2], u[3]))
        b = q[0] * u[1] - u[0] * q[1] - c[0], q[0] * u[2] - u[0] * q[2] - c[1], q[0] * u[3] - u[0] * q[3] - c[2]
        c = _cross(b, (w[0] + w_j[0], w[1] + w_j[1], w[2] + w_j[2]))
        m = 2.0 / h if j else 4.0 / h
        moment = (
            m * stiff[3] * (b[0] + 0.5 * tau * (s * (w_j[0] - w[0]) + c[0])),
            m * stiff[4] * (b[1] + 0.5 * tau * (s * (w_j[1] - w[1]) + c[1])),
            m * stiff[5] * (b[2] + 0.5 * tau * (s * (w_j[2] - w[2]) + c[2])),
        )
        lever, c, turn = _cross(edge, inner), _cross(b, moment), _cross(axis, w_j)
        for k in range(3):
            pull[j, k] = outer[k]
            torque[j, k] += h * lever[k] - s * moment[k] + c[k]
            if j:
                torque[j - 1, k] += s * moment[k] + c[k]
            rate[j, k] = speed[k]
            rate[j, 7 + k] = 0.5 * (a * w_j[k] + turn[k])
        rate[j, 6] = -0.5 * (axis[0] * w_j[0] + axis[1] * w_j[1] + axis[2] * w_j[2])
        x, v, q, w = end, speed, u, w_j
    last = _turned(q, (wrench[3], wrench[4], wrench[5]), -1.0)
    for j in range(cells):
        w_j, tip = _three(y, j, 10), j + 1 == cells
        gyro = _cross(w_j, (inertia[0] * w_j[0], inertia[1] * w_j[1], inertia[2] * w_j[2]))
        for k in range(3):
            beyond = wrench[k] if tip else pull[j + 1, k]
            rate[j, 3 + k] = (beyond - pull[j, k]) / (mass / 2.0 if tip else mass) + gravity[k] - drag * y[j, 3 + k]
            carried = torque[j, k] + (last[k] if tip else 0.0)
            rate[j, 10 + k] = (carried - gyro[k]) / inertia[k] - drag * w_j[k]


@dataclass(frozen=True)
class CosseratRod(RoundRod):
    """A round rod, and its discretisation.

    Attributes:
        cells: of the grid.
        poisson: Poisson's ratio, of the torsional stiffness.
        shear: shear stiffness over axial stiffness; a large one makes a rod that does not shear.
        stretch: axial stiffness over E A; a large one makes an inextensible rod.
        retardation: of Kelvin and Voigt, damping over stiffness of every strain [s].
        gravity: [m/s^2].
    """

    cells: int
    poisson: float = 0.5
    shear: float = 100.0
    stretch: float = 1.0
    retardation: float = 0.0
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def torsion(self) -> float:
        """GJ [N m^2]."""
        return self.bending / (1.0 + self.poisson)

    @property
    def axial(self) -> float:
        """EA [N]."""
        return self.young * self.area * self.stretch

    @property
    def slow(self) -> float:
        """First bending frequency of the slender rod [rad/s]."""
        return float(3.5160153 * np.sqrt(self.bending / (self.density * self.area)) / self.length**2)

    @property
    def straight(self) -> np.ndarray:
        """The state of the unloaded rod at rest."""
        full = np.zeros((self.cells, 13))
        full[:, 2], full[:, 6] = self.length / self.cells * np.arange(1, self.cells + 1), 1.0
        return full.ravel()

    def rates(self, state: np.ndarray, wrench: Any = NO_LOAD, drag: float = 0.0) -> np.ndarray:
        """Time derivative of a state under a wrench at the tip (force, moment), with a drag of all momenta [1/s]."""
        h = self.length / self.cells
        stiff = np.array([self.shear * self.axial] * 2 + [self.axial] + [self.bending] * 2 + [self.torsion])
        mass = self.density * self.area * h
        inertia = mass * self.radius**2 * np.array([0.25, 0.25, 0.5])
        loads, found = (np.asarray(wrench, dtype=float), np.array(self.gravity)), np.zeros((self.cells, 13))
        _rates(state.reshape(-1, 13), found, *loads, h, stiff, mass, inertia, self.retardation, drag)
        return found.ravel()

    def slopes(self, state: np.ndarray, wrench: Any = NO_LOAD, drag: float = 0.0) -> csc_matrix:
        """Jacobian of `rates`, by central differences: each cell knows its neighbours only, so that 39 columns give it."""
        index = np.arange(13 * self.cells)
        steps = 1e-6 * (index % 39 == np.arange(39)[:, None])
        both = ([self.rates(one, wrench, drag) for one in (state + step, state - step)] for step in steps)
        found = np.array([(ahead - behind) / 2e-6 for ahead, behind in both]).T
        row = np.repeat(index, 39)
        column = 13 * (row // 13 - 1) + np.tile(np.arange(39), index.size)
        inside = (column >= 0) & (column < index.size)
        row, column = row[inside], column[inside]
        return csc_matrix((found[row, column % 39], (row, column)), shape=(index.size,) * 2)

    def motion(
        self, start: np.ndarray, times: np.ndarray, wrench: Any = NO_LOAD, *, tolerance: float = 1e-6, drag: float = 0.0,
        method: str = "DOP853",
    ) -> np.ndarray:  # fmt: skip
        """States at some times, shape (n, 13 cells), from a state at time 0; the tolerance is relative to the length.

        The wrench may be a function of time. `Radau` or `DOP853` for undamped rods, `BDF` for damped ones, which are stiff.
        """
        load = wrench if callable(wrench) else lambda t: wrench
        slopes: dict[str, Any] = {} if method == "DOP853" else {"jac": lambda t, y: self.slopes(y, load(t), drag)}
        solution = solve_ivp(
            lambda t, y: self.rates(y, load(t), drag), (0.0, times[-1]), start, method, times,
            rtol=tolerance, atol=tolerance * self.length, **slopes,
        )  # fmt: skip
        assert solution.success, solution.message
        return solution.y.T

    def equilibrium(self, wrench: Any = NO_LOAD) -> np.ndarray:
        """The state at rest under a wrench at the tip, where a motion with much damping ends that begins straight."""
        damped = replace(self, retardation=1.0 / self.slow)
        times = np.array([60.0 / self.slow])
        return damped.motion(self.straight, times, wrench, tolerance=1e-8, drag=self.slow, method="BDF")[-1]

    def tips(self, states: np.ndarray) -> np.ndarray:
        """Position of the tip of states (n, 13 cells), shape (n, 3) [m]."""
        return states[:, -13:-10]

    def frequencies(self) -> np.ndarray:
        """Of small vibrations of the undamped rod about the straight rest, ascending [rad/s]."""
        found = np.sort(np.linalg.eigvals(self.slopes(self.straight).toarray()).imag)
        return found[found > 1e-3]
