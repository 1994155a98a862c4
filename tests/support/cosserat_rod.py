"""A Cosserat rod that moves in space: finite differences along the rod, SciPy in time. Shares nothing with softrobots.

The staggered grid of [Lang, Linn, Arnold 2011, Multibody System Dynamics 25]: positions at the ends of the cells, rotations in
their middle, as quaternions w, x, y, z. Shear and stretch of a cell are `R^T dx/h - e3`; bending and twist between cells are
twice the vector part of their relative quaternion over their distance, so forces and moments are exact slopes of one energy.
Second order in the size of a cell. The rod is clamped at the origin, straight along +z at rest; forces and moments are dead, in
world axes; SI units.
"""

from __future__ import annotations

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
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True)
def _turned(q, v, sign):  # type: ignore[no-untyped-def]
    """A vector turned by a unit quaternion, or back with sign -1."""
    t = 2.0 * _cross(q[1:], v)
    return v + sign * q[0] * t + _cross(q[1:], t)


@njit(cache=True)
def _rates(y, wrench, gravity, h, stiff, mass, inertia, tau, drag):  # type: ignore[no-untyped-def]
    """Time derivative of a state (cells, 13): position and velocity of the far end of each cell, its quaternion and body rate.

    `stiff` are shear, shear and axial stiffness [N], then both of bending and torsion [N m^2]; `inertia` is that of a cell.
    """
    cells = len(y)
    rate, pull, torque = np.zeros_like(y), np.zeros_like(y[:, :3]), np.zeros_like(y[:, :3])
    x, v, q, w = np.zeros_like(y[0, :3]), np.zeros_like(y[0, :3]), np.zeros_like(y[0, :4]), np.zeros_like(y[0, :3])
    q[0] = 1.0
    for j in range(cells):
        q_j, w_j = y[j, 6:10], y[j, 10:]
        u = q_j / np.sqrt(np.sum(q_j * q_j))
        edge = _turned(u, (y[j, :3] - x) / h, -1.0)
        edge_rate = _turned(u, (y[j, 3:6] - v) / h, -1.0) - _cross(w_j, edge)
        strain = edge + tau * edge_rate
        strain[2] -= 1.0
        inner = stiff[:3] * strain
        pull[j] = _turned(u, inner, 1.0)
        s = np.sum(q * u)  # relative quaternion (s, b) of this cell to the one before, or to the clamp
        b = q[0] * u[1:] - u[0] * q[1:] - _cross(q[1:], u[1:])
        b_rate = 0.5 * (s * (w_j - w) + _cross(b, w + w_j))
        moment = (2.0 / h if j else 4.0 / h) * stiff[3:] * (b + tau * b_rate)
        torque[j] += h * _cross(edge, inner) - s * moment - _cross(moment, b)
        if j:
            torque[j - 1] += s * moment + _cross(b, moment)
        rate[j, 6] = -0.5 * np.sum(q_j[1:] * w_j)
        rate[j, 7:10] = 0.5 * (q_j[0] * w_j + _cross(q_j[1:], w_j))
        x, v, q, w = y[j, :3], y[j, 3:6], u, w_j
    for j in range(cells):
        rate[j, :3] = y[j, 3:6]
        beyond = pull[j + 1] if j + 1 < cells else pull[j] * 0.0 + wrench[:3]
        rate[j, 3:6] = (beyond - pull[j]) / (mass if j + 1 < cells else mass / 2.0) + gravity - drag * y[j, 3:6]
        w_j = y[j, 10:]
        if j + 1 == cells:
            u = y[j, 6:10] / np.sqrt(np.sum(y[j, 6:10] * y[j, 6:10]))
            torque[j] += _turned(u, torque[j] * 0.0 + wrench[3:], -1.0)
        rate[j, 10:] = (torque[j] - _cross(w_j, inertia * w_j)) / inertia - drag * w_j
    return rate


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
        loads = np.asarray(wrench, dtype=float), np.array(self.gravity)
        return _rates(state.reshape(-1, 13), *loads, h, stiff, mass, inertia, self.retardation, drag).ravel()

    def slopes(self, state: np.ndarray, wrench: Any = NO_LOAD, drag: float = 0.0) -> csc_matrix:
        """Jacobian of `rates`, by complex steps: each cell knows its neighbours only, so that 39 columns give it."""
        index = np.arange(13 * self.cells)
        steps = 1e-20j * (index % 39 == np.arange(39)[:, None])
        found = np.array([self.rates(state + step, wrench, drag).imag for step in steps]).T / 1e-20
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
