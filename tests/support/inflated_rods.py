"""Inflated beams end to end as geometrically exact rods that bend, shear, stretch and twist: a boundary-value problem.

Nothing here knows of softrobots, of hinges or of springs: only NumPy, SciPy and the equations of the rod. A chain of rods is
clamped at the origin; each rod is straight along the +x of its base frame when unloaded. All loads are dead. SI units, radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp

from tests.support.rods import quaternion_rotation

NODES = 9  # of the first mesh
STATES = 10  # of a rod: position 3, quaternion w, x, y, z 4, moment in world axes 3
STEP = 3.0  # largest F L^2 / B by which the load grows at once, L the whole length


@dataclass(frozen=True)
class InflatedRod:
    """A uniform straight rod. None stands for infinitely stiff.

    Attributes:
        length: [m].
        bending: B, about both axes of the section [N m^2].
        shear: A, force per shear angle [N].
        twisting: C [N m^2].
        stretching: D [N].
    """

    length: float
    bending: float
    shear: float | None = None
    twisting: float | None = None
    stretching: float | None = None

    @classmethod
    def tube(
        cls,
        *,
        length: float,
        radius: float,
        wall_thickness: float,
        pressure: float,
        young_modulus: float,
        poisson_ratio: float = 0.3,
    ) -> InflatedRod:
        """A thin inflated tube as [Troise 2021] (1) has it: B = (E + P/S) I, A = P + G S / 2. D = E S, C = 2 (G + P/S) I: the
        tension of the wall pulls twisted fibres straight."""
        cap, wall = pressure * np.pi * radius**2, 2.0 * np.pi * radius * wall_thickness
        second, shear = np.pi * radius**3 * wall_thickness, young_modulus / (2.0 * (1.0 + poisson_ratio))
        bending = (young_modulus + cap / wall) * second
        return cls(length, bending, cap + 0.5 * shear * wall, 2.0 * (shear + cap / wall) * second, young_modulus * wall)

    def planar(self) -> InflatedRod:
        """The same rod with what (1) has, bending and shear: it neither twists nor stretches."""
        return replace(self, twisting=None, stretching=None)


@dataclass(frozen=True)
class InflatedChain:
    """Rods in equilibrium.

    Attributes:
        position: of the tip (3,) [m].
        rotation: of the tip's section, columns in world axes, first column its normal (3, 3).
        bending_moments: largest in each rod (n,) [N m].
        shape: points of the centre line at `s`, of each rod one after the other (m, 3) [m].
        nodes: how many nodes `solve_bvp` ended with.
    """

    position: np.ndarray
    rotation: np.ndarray
    bending_moments: np.ndarray
    shape: np.ndarray
    nodes: int


def turned(axis: ArrayLike, angle: float) -> np.ndarray:
    """The quaternion (4,) of a turn about a unit vector (3,)."""
    return np.r_[np.cos(0.5 * angle), np.sin(0.5 * angle) * np.asarray(axis, dtype=float)]


def solve_inflated_chain(
    rods: Sequence[InflatedRod],
    turns: Sequence[ArrayLike],
    force: ArrayLike,
    moment: ArrayLike = (0.0, 0.0, 0.0),
    *,
    tol: float = 1e-8,
) -> InflatedChain:
    """Equilibrium under a dead force [N] and moment [N m] at the tip, on the branch that starts without load, by `solve_bvp`.

    Simo and Reissner's rod: with the rotation R of the quaternion q and the force n, which is that at the tip everywhere,

        p' = R (e_x + diag(1/D, 1/A, 1/A) R^T n),  q' = q (0, diag(1/C, 1/B, 1/B) R^T m) / 2,  m' = n x p'

    and m at the tip given. The shear angle is between the normal of the section and the centre line: the wall's pull P by the
    pressure follows the line, the push P of the gas the normal, which is where the P in A comes from.

    Args:
        rods: from the clamp to the tip.
        turns: unit quaternion (4,) by which each rod is turned from the end of the one before; the first from the world.
        force: at the tip, world axes (3,) [N].
        moment: at the tip, world axes (3,) [N m].
        tol: relative residual.
    """
    count, n, at_tip = len(rods), np.asarray(force, dtype=float)[:, None], np.asarray(moment, dtype=float)
    lengths = np.array([one.length for one in rods])
    soft = np.array([[_soft(value) for value in (one.stretching, one.shear, one.shear)] for one in rods])
    flexible = np.array([[_soft(value) for value in (one.twisting, one.bending, one.bending)] for one in rods])

    def rates(share: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        made = []
        for length, give, bend, state in zip(lengths, soft, flexible, y.reshape(count, STATES, -1), strict=True):
            q, m = state[3:7], state[7:]
            rotations = np.moveaxis(quaternion_rotation(q.T), 0, 2)
            strain = give[:, None] * np.einsum("jin,jk->in", rotations, share * n)
            strain[0] += 1.0
            u = bend[:, None] * np.einsum("jin,jn->in", rotations, m)
            dp = np.einsum("ijn,jn->in", rotations, strain)
            dq = 0.5 * np.vstack([-np.sum(q[1:] * u, axis=0), q[0] * u + np.cross(q[1:], u, axis=0)])
            made.append(length * np.vstack([dp, dq, np.cross(share * n, dp, axis=0)]))
        return np.vstack(made)

    def ends(share: float, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        a, b = a.reshape(count, STATES), b.reshape(count, STATES)
        before, parts = np.r_[np.zeros(3), 1.0, np.zeros(3)], []
        for turn, start, end in zip(turns, a, b, strict=True):
            parts.append(start[:7] - np.r_[before[:3], product(before[3:], np.asarray(turn, dtype=float))])
            before = end[:7]
        parts += [end[7:] - start[7:] for end, start in zip(b, a[1:], strict=False)]
        return np.concatenate([*parts, b[-1, 7:] - share * at_tip])

    whole, softest = lengths.sum(), min(one.bending for one in rods)
    size = np.linalg.norm(n) * whole**2 / softest + np.linalg.norm(at_tip) * whole / softest
    x = np.linspace(0.0, 1.0, NODES)
    y = _straight(lengths, turns, n[:, 0], at_tip, x)
    steps = int(np.ceil(size / STEP)) or 1
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        level = tol if share == 1.0 else 1e-4
        found = solve_bvp(partial(rates, share), partial(ends, share), x, y, tol=level, bc_tol=1e-11, max_nodes=20_000)
        if not found.success:
            raise RuntimeError(f"solve_bvp at {share:g} of the load: {found.message}")
        x, y = found.x, found.y
    return _packed(found, count)


def _soft(stiffness: float | None) -> float:
    return 0.0 if stiffness is None else 1.0 / stiffness


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of two quaternions: turn a, then b about its own axes."""
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]


def _straight(
    lengths: np.ndarray, turns: Sequence[ArrayLike], force: np.ndarray, moment: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """States (10 n, nodes) of rods that are rigid, with the moments that they carry."""
    made, point, turn = [], np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for length, by in zip(lengths, turns, strict=True):
        turn = product(turn, np.asarray(by, dtype=float))
        line = point[:, None] + np.outer(quaternion_rotation(turn[None])[0][:, 0], length * x)
        made.append(np.vstack([line, np.repeat(turn[:, None], len(x), axis=1)]))
        point = line[:, -1]
    carried = [np.cross(point[:, None] - one[:3], force[:, None], axis=0) + moment[:, None] for one in made]
    return np.vstack([np.vstack(parts) for parts in zip(made, carried, strict=True)])


def _packed(found: Any, count: int) -> InflatedChain:
    states = found.y.reshape(count, STATES, -1)
    largest = []
    for state in states:
        normals, m = quaternion_rotation(state[3:7].T)[:, :, 0], state[7:].T
        bending = m - np.sum(m * normals, axis=1, keepdims=True) * normals
        largest.append(np.linalg.norm(bending, axis=1).max())
    last = states[-1, :, -1]
    points = found.sol(np.linspace(0.0, 1.0, 21)).reshape(count, STATES, -1)[:, :3]
    shape = np.concatenate([one.T for one in points])
    return InflatedChain(last[:3], quaternion_rotation(last[None, 3:7])[0], np.array(largest), shape, len(found.x))
