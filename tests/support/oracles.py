"""Independent answers: the paper's Denavit-Hartenberg tables and printed numbers, point clouds, central differences."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np

# docs/theory.md 1.4: reference values of the equilibrium at k = 172.71 N m/rad, f = (0, 10, -15) N, five digits.
REFERENCE_EQUILIBRIA = [
    ((0.0, 0.0, 0.0), (0.06696, -0.10022, 0.03264, -0.04858), (1.18654, 0.09618, -0.14450)),
    ((0.3, 0.6, -0.8), (0.05339, -0.09228, 0.03172, -0.04214), (1.01935, 0.38587, 0.09712)),
    ((1.0, 1.2, -2.0), (0.00966, -0.05706, 0.01722, -0.01067), (0.33278, 0.54150, 0.08904)),
]

# [Troise 2021] Table 3, column M_w [N m], printed with two decimals.
PRINTED_WRINKLING_MOMENTS = {10e3: 4.11, 20e3: 8.21, 30e3: 12.32, 40e3: 16.42, 50e3: 20.53, 60e3: 24.63}


def denavit_hartenberg(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """Standard transform Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]])


def flexible_table(angles: np.ndarray, l1: float = 0.03, l2: float = 0.57) -> list[np.ndarray]:
    """[Troise 2021] Table 2: transforms of frames 0 ... 7 to the base, at seven joint angles."""
    half = np.pi / 2
    rows = [(0.0, half), (l1, -half), (0.0, half), (l2, 0.0), (l1, -half), (0.0, half), (l2, 0.0)]
    transforms = [np.eye(4)]
    for theta, (a, alpha) in zip(angles, rows, strict=True):
        transforms.append(transforms[-1] @ denavit_hartenberg(theta, 0.0, a, alpha))
    return transforms


def flexible_jacobian(angles: np.ndarray, l1: float = 0.03, l2: float = 0.57) -> np.ndarray:
    """[Troise 2021] (4): column i is [z_{i-1} x (p_e - p_{i-1}); z_{i-1}], shape (6, 7)."""
    frames = flexible_table(angles, l1, l2)
    tip = frames[-1][:3, 3]
    return np.array([np.r_[np.cross(T[:3, 2], tip - T[:3, 3]), T[:3, 2]] for T in frames[:-1]]).T


def rigid_table(angles: np.ndarray, length: float = 0.6) -> np.ndarray:
    """[Troise 2021] Table 1: transform of the tip to the base, at three motor angles."""
    transform = np.eye(4)
    for theta, (a, alpha) in zip(angles, [(0.0, np.pi / 2), (length, 0.0), (length, 0.0)], strict=True):
        transform = transform @ denavit_hartenberg(theta, 0.0, a, alpha)
    return transform


def arm_energy(motors: np.ndarray, springs: np.ndarray, force: np.ndarray, stiffness: float) -> float:
    """Energy of the weightless paper's arm from the DH table alone [J]."""
    angles = np.array([motors[0], motors[1], springs[0], springs[1], motors[2], springs[2], springs[3]])
    return 0.5 * stiffness * float(springs @ springs) - float(force @ flexible_table(angles)[-1][:3, 3])


def tube_points(length: float, radius: float, mass: float, cap_mass: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """A capped thin tube along x as point masses: positions (n, 3) [m] and masses (n,) [kg]."""
    x = (np.arange(count) + 0.5) / count * length
    phi = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    wall = np.array([(xi, radius * np.cos(p), radius * np.sin(p)) for xi in x for p in phi])
    rings = radius * np.sqrt((np.arange(count) + 0.5) / count)
    cap = np.array([(0.0, r * np.cos(p), r * np.sin(p)) for r in rings for p in phi])
    points = np.vstack([wall, cap, cap + [length, 0.0, 0.0]])
    masses = np.r_[np.full(len(wall), mass / len(wall)), np.full(2 * len(cap), cap_mass / len(cap))]
    return points, masses


def central_difference(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Derivative of a vector function, column by column, shape (m, n)."""
    columns = []
    for place in range(len(at)):
        shift = np.zeros(len(at))
        shift[place] = step
        columns.append((np.asarray(function(at + shift)) - np.asarray(function(at - shift))) / (2.0 * step))
    return np.array(columns).T


def paper_closed_loop(
    motors: np.ndarray, positions: np.ndarray, times: np.ndarray, force: np.ndarray, gain: float, rows: int
) -> np.ndarray:
    """[Troise 2021] Figure 6 on the DH table: tip positions, shape (n, 3), with the first `rows` rows of the Jacobian."""

    def angles(q: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.array([q[0], q[1], y[0], y[1], q[2], y[2], y[3]])

    def settle(q: np.ndarray, y: np.ndarray) -> np.ndarray:
        for _ in range(100):
            before, y = y, flexible_jacobian(angles(q, y))[:3, [2, 3, 5, 6]].T @ force / 172.71
            if np.abs(y - before).max() < 1e-15:
                break
        return y

    springs = settle(motors, np.zeros(4))
    tips = [flexible_table(angles(motors, springs))[-1][:3, 3]]
    for place in range(1, len(times)):
        interval = times[place] - times[place - 1]
        command = np.zeros(rows)
        command[:3] = (positions[place] - positions[place - 1]) / interval + gain * (positions[place - 1] - tips[-1])
        jacobian = flexible_jacobian(angles(motors, springs))[:rows]
        motors = motors + interval * (np.linalg.pinv(jacobian)[[0, 1, 4]] @ command)
        springs = settle(motors, springs)
        tips.append(flexible_table(angles(motors, springs))[-1][:3, 3])
    return np.array(tips)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows, shape (n, 3); `np.cross` takes five times as long for few rows."""
    return a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]


def arm_balance(
    motors: np.ndarray, springs: np.ndarray, forces: np.ndarray, stiffness: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residual (n, 4), tangent stiffness (n, 4, 4) and tip (n, 3) of the weightless paper's arm, for n cases.

    docs/theory.md 1.4 on the DH table: r = k q - J_k^T f, entries f . (z_i x (z_j x (p_e - p_j))), i <= j, of d(J_k^T f)/dq.
    """
    angles = np.array([motors[:, 0], motors[:, 1], springs[:, 0], springs[:, 1], motors[:, 2], springs[:, 2], springs[:, 3]])
    half = np.pi / 2
    rows = [(0.0, half), (0.03, -half), (0.0, half), (0.57, 0.0), (0.03, -half), (0.0, half), (0.57, 0.0)]
    turn, position = np.tile(np.eye(3), (len(motors), 1, 1)), np.zeros((len(motors), 3))
    axes, origins = [], []
    for theta, (a, alpha) in zip(angles, rows, strict=True):
        axes.append(turn[:, :, 2])
        origins.append(position)
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        zero = np.zeros_like(c)
        link = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, zero + sa, zero + ca]]
        position = position + a * (turn @ np.array([c, s, zero]).T[:, :, None])[:, :, 0]
        turn = turn @ np.moveaxis(np.array(link), 2, 0)
    columns = {j: _cross(axes[j], position - origins[j]) for j in (2, 3, 5, 6)}
    residual = stiffness * springs - np.stack([np.sum(column * forces, axis=1) for column in columns.values()], axis=1)
    tangent = np.tile(stiffness * np.eye(4), (len(motors), 1, 1))
    for (row, i), (column, j) in combinations_with_replacement(enumerate(columns), 2):
        curvature = np.sum(forces * _cross(axes[i], columns[j]), axis=1)
        tangent[:, row, column] -= curvature
        if row != column:
            tangent[:, column, row] -= curvature
    return residual, tangent, position
