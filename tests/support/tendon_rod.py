"""The coupled rod and string model of tendon-driven robots [Rucker and Webster 2011], by shooting. Knows nothing of softrobots.

D. C. Rucker, R. J. Webster III, IEEE Transactions on Robotics 27(6), 2011, doi:10.1109/TRO.2011.2160469. A Cosserat rod
bends, twists and stretches; it does not shear. Frictionless strings, of one tension each, run in it along any path. The rod is
clamped at the origin, straight along +z at rest, and its frames do not turn between its pieces. All loads are dead, in world
axes. SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from tests.support.rods import quaternion_rotation

STATES = 13  # position 3, quaternion 4, force in the rod 3, curvatures 2 and twist; the lengths of the strings follow
PRECISION = 1e-10  # of the integration
COARSE = 1e-6  # on the way
E3 = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Piece:
    """A uniform piece of the rod: rest length [m], EI, GJ [N m^2], EA [N], mass per rest length [kg/m]."""

    length: float
    bending_stiffness: float
    torsional_stiffness: float
    axial_stiffness: float
    density: float = 0.0

    @property
    def stiffness(self) -> np.ndarray:
        """EI, EI, GJ."""
        return np.array([self.bending_stiffness, self.bending_stiffness, self.torsional_stiffness])


@dataclass(frozen=True)
class String:
    """The path of a tendon: distance from the rod and azimuth at rest arc lengths `at`, linear between them.

    It is fixed to the rod at its first and last point (where the first is the base, to the base).
    """

    at: tuple[float, ...]
    distance: tuple[float, ...]
    azimuth: tuple[float, ...]

    @classmethod
    def straight(cls, end: float, distance: float, azimuth: float, start: float = 0.0) -> String:
        """One parallel to the rod."""
        return cls((start, end), (distance, distance), (azimuth, azimuth))

    def passes(self, low: float, high: float) -> bool:
        """Whether it runs along the whole of an interval between two of the breaks of a rod."""
        return self.at[0] <= low and high <= self.at[-1]

    def around(self, low: float, high: float) -> np.ndarray:
        """Distance and azimuth at `low`, and their slopes, along an interval without corner, (4,)."""
        k = int(np.clip(np.searchsorted(self.at, 0.5 * (low + high)) - 1, 0, len(self.at) - 2))
        span = self.at[k + 1] - self.at[k]
        flare, winding = ((v[k + 1] - v[k]) / span for v in (self.distance, self.azimuth))
        into = low - self.at[k]
        return np.array([self.distance[k] + flare * into, self.azimuth[k] + winding * into, flare, winding])


@dataclass(frozen=True)
class Springy:
    """Tension of an elastic tendon at length l: max(0, pretension + stiffness (l - motor)) [N, N/m, m]."""

    motor: float
    stiffness: float
    pretension: float = 0.0


@dataclass(frozen=True)
class TendonRod:
    """An equilibrium.

    Attributes:
        position: of the tip, (3,) [m].
        rotation: of the tip, (3, 3).
        lengths: of the strings, (n,) [m].
        tensions: of the strings, (n,) [N].
        moment: of rod and strings together on the base, (3,) [N m].
        unbalanced: force and moment left at the tip, (6,) [N, N m].
        strains: bending about x and y, twist [rad/m] and stretch where the rod starts, (4,).
    """

    position: np.ndarray
    rotation: np.ndarray
    lengths: np.ndarray
    tensions: np.ndarray
    moment: np.ndarray
    unbalanced: np.ndarray
    strains: np.ndarray


def _hat(v: np.ndarray) -> np.ndarray:
    """Cross product matrices of vectors (..., 3), (..., 3, 3)."""
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(row, axis=-1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))], axis=-2)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (..., 3); NumPy's own takes ten times as long for a few of them."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


class _Strings:
    """The strings along one interval without breaks, at m states at once; tensions (n, m)."""

    def __init__(self, strings: Sequence[String], low: float, high: float) -> None:
        self.low, self.high = low, high
        self.active = [i for i, string in enumerate(strings) if string.passes(low, high)]
        rows = np.array([strings[i].around(low, high) for i in self.active]).reshape(-1, 4)
        self.distance, self.azimuth, self.flare, self.winding = rows.T

    def at(self, s: float, u: np.ndarray, nu: np.ndarray, tensions: np.ndarray) -> tuple[np.ndarray, ...]:
        """Offsets and derivatives (n, 3), unit tangents t (n, m, 3), rates |w| (n, m), T (1 - t t^T) / |w| (n, m, 3, 3)."""
        d, a = self.distance + self.flare * (s - self.low), self.azimuth + self.winding * (s - self.low)
        out = np.stack([np.cos(a), np.sin(a), 0.0 * a], axis=1)
        side = np.stack([-out[:, 1], out[:, 0], 0.0 * a], axis=1)
        r, dr = d[:, None] * out, self.flare[:, None] * out + (d * self.winding)[:, None] * side
        ddr = 2.0 * (self.flare * self.winding)[:, None] * side - (d * self.winding**2)[:, None] * out
        w = _cross(u, r[:, None]) + nu[:, None] * E3 + dr[:, None]
        size = np.linalg.norm(w, axis=-1)
        t = w / size[..., None]
        across = (np.eye(3) - t[..., :, None] * t[..., None, :]) * (tensions[self.active] / size)[..., None, None]
        return r, dr, ddr, t, size, across


class _Shot:
    """The initial value problem from the base to the tip, for m columns of unknowns at once."""

    def __init__(self, pieces: Sequence[Piece], strings: Sequence[String], gravity: np.ndarray, precision: float) -> None:
        self.strings, self.gravity, self.precision = strings, gravity, precision
        ends = np.r_[0.0, np.cumsum([piece.length for piece in pieces])]
        corners = {min(float(at), float(ends[-1])) for string in strings for at in string.at}
        breaks = sorted(corners | set(ends.tolist()))
        breaks = [a for a, b in zip(breaks, [*breaks[1:], np.inf], strict=True) if b - a > 1e-9 * ends[-1]]
        self.intervals = []
        for low, high in pairwise(breaks):
            piece = pieces[min(int(np.searchsorted(ends, 0.5 * (low + high))) - 1, len(pieces) - 1)]
            self.intervals.append((piece, _Strings(strings, low, high)))
        self.weight = sum(piece.density * piece.length for piece in pieces) * gravity

    def wrench(self, piece: Piece, along: _Strings, s: float, y: np.ndarray, tensions: np.ndarray) -> np.ndarray:
        """Force and moment of rod and strings together across a section, in its axes, (m, 6)."""
        u, nu = y[10:13].T, 1.0 + y[9] / piece.axial_stiffness
        r, _, _, t, _, _ = along.at(s, u, nu, tensions)
        pull = tensions[along.active][..., None] * t
        force = y[7:10].T + pull.sum(axis=0)
        return np.concatenate([force, piece.stiffness * u + _cross(r[:, None], pull).sum(axis=0)], axis=1)

    def enter(self, piece: Piece, along: _Strings, s: float, total: np.ndarray, tensions: np.ndarray) -> np.ndarray:
        """Force in the rod and strains that carry a total wrench (m, 6) where an interval begins, (6, m), by Newton's method.

        What strings that end there, begin, or have a corner exert on the rod are point loads; the sum goes on.
        """
        stiff, x = np.r_[piece.stiffness, piece.axial_stiffness], np.zeros((len(total), 4))
        for _ in range(20):
            r, _, _, t, _, across = along.at(s, x[:, :3], 1.0 + x[:, 3], tensions)
            pull = tensions[along.active][..., None] * t
            force, moment = pull.sum(axis=0), _cross(r[:, None], pull).sum(axis=0)
            slope = np.concatenate([-_hat(r), np.tile(E3, (len(r), 1))[..., None]], axis=2)  # dw / d(u, nu)
            tangent = np.diag(stiff) + np.einsum("nia,nmij,njb->mab", slope, across, slope)
            left = stiff * x + np.concatenate([moment, force[:, 2:]], axis=1) - total[:, [3, 4, 5, 2]]
            x = x - np.linalg.solve(tangent, left[..., None])[..., 0]
            if (np.abs(left) <= 1e-13 * (1.0 + np.abs(tensions).sum()) * np.array([1e-2, 1e-2, 1e-2, 1.0])).all():
                break
        else:
            raise RuntimeError("no strains carry the wrench where an interval begins")
        return np.concatenate([total[:, :3] - force, x[:, :3]], axis=1).T

    def rates(self, piece: Piece, along: _Strings, s: float, y: np.ndarray, tensions: np.ndarray) -> np.ndarray:
        """Derivatives of states (13 + n, m) by rest arc length: Rucker and Webster's six linear equations for the strains.

        n' + f + sum T t' = 0 and m' + p' x n + sum r x T t' = 0, in axes of the section, n and m those of the rod alone.
        """
        q, u, n, nu = y[3:7], y[10:13].T, y[7:10].T, 1.0 + y[9] / piece.axial_stiffness
        turns, stiff = quaternion_rotation(q.T), piece.stiffness
        r, dr, ddr, t, size, across = along.at(s, u, nu, tensions)
        cross_r = _hat(r)[:, None]
        known = tensions[along.active][..., None] * _cross(u, t)
        known = known + (across @ (_cross(u, dr[:, None]) + ddr[:, None])[..., None])[..., 0]
        twisted = across @ cross_r
        left = np.zeros((len(u), 6, 6))
        left[:, 0, 0] = left[:, 1, 1] = 1.0
        left[:, :3, 2] = across[..., 2].sum(axis=0) / piece.axial_stiffness + E3
        left[:, :3, 3:] = -twisted.sum(axis=0)
        left[:, 3:, 2] = (cross_r @ across[..., 2:]).sum(axis=0)[..., 0] / piece.axial_stiffness
        left[:, 3:, 3:] = np.diag(stiff) - (cross_r @ twisted).sum(axis=0)
        weight = np.einsum("mji,j->mi", turns, piece.density * self.gravity)
        force = _cross(u, n) + known.sum(axis=0) + weight
        moment = _cross(u, stiff * u) + _cross(nu[:, None] * E3, n) + (cross_r @ known[..., None]).sum(axis=0)[..., 0]
        strains = np.linalg.solve(left, -np.concatenate([force, moment], axis=1)[..., None])[..., 0].T
        lengths = np.zeros((len(self.strings), len(u)))
        lengths[along.active] = size
        dq = 0.5 * np.vstack([-np.sum(q[1:] * u.T, axis=0), q[0] * u.T + _cross(q[1:].T, u).T])
        return np.vstack([nu * turns[:, :, 2].T, dq, strains[:2], strains[2:3], strains[3:], lengths])

    def __call__(self, base: np.ndarray, tensions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Final states (13 + n, m), wrench there in world axes (m, 6), and first strains, from wrenches at the base (m, 6)."""
        count, total, first = len(base), base, np.zeros(0)
        y = np.zeros((STATES + len(self.strings), count))
        y[3] = 1.0
        for piece, along in self.intervals:
            y[7:13] = self.enter(piece, along, along.low, total, tensions)
            first = first if first.size else np.vstack([y[10:13], y[9:10] / piece.axial_stiffness])
            found = solve_ivp(
                lambda s, z, piece=piece, along=along: self.rates(piece, along, s, z.reshape(-1, count), tensions).ravel(),
                (along.low, along.high),
                y.ravel(),
                "DOP853",
                rtol=self.precision,
                atol=self.precision * along.high,
            )
            if not found.success:
                raise RuntimeError(f"the integration stopped: {found.message}")
            y = found.y[:, -1].reshape(-1, count)
            total = self.wrench(piece, along, along.high, y, tensions)
        turns = quaternion_rotation(y[3:7].T)
        world = np.concatenate([(turns @ part[..., None])[..., 0] for part in (total[:, :3], total[:, 3:])], axis=1)
        return y, world, first


def solve_tendon_rod(
    pieces: Sequence[Piece],
    strings: Sequence[String],
    tensions: ArrayLike | Sequence[Springy],
    *,
    force: ArrayLike = (0.0, 0.0, 0.0),
    moment: ArrayLike = (0.0, 0.0, 0.0),
    gravity: ArrayLike = (0.0, 0.0, 0.0),
) -> TendonRod:
    """Equilibrium under tensions or elastic tendons, a tip force and moment, and weight, by shooting from the base.

    Dead loads fix the force at the base; the moment there, and the tensions of elastic tendons, are found by Newton's method
    with forward differences, in steps of the loads, each the start of the next.

    Args:
        pieces: of the rod, base to tip.
        strings: paths of the tendons.
        tensions: one number each [N], or one `Springy` each.
        force: on the tip [N].
        moment: on the tip [N m].
        gravity: [m/s^2].
    """
    elastic = [law for law in tensions if isinstance(law, Springy)]  # type: ignore[union-attr]
    given = np.zeros(len(strings)) if elastic else np.asarray(tensions, dtype=float)
    pull, turn, fall = (np.asarray(v, dtype=float) for v in (force, moment, gravity))
    motors, stiff, pre = (np.array([getattr(law, name) for law in elastic]) for name in ("motor", "stiffness", "pretension"))
    reach = sum(piece.length for piece in pieces)
    unit = np.r_[np.full(3, pieces[0].bending_stiffness / reach), np.maximum(pre, 1.0)]
    x = np.r_[np.zeros(3), pre]

    def left(columns: np.ndarray, share: float, precision: float) -> tuple[np.ndarray, Any]:
        shot = _Shot(pieces, strings, share * fall, precision)
        base = np.concatenate([np.tile(share * pull + shot.weight, (len(columns), 1)), columns[:, :3]], axis=1)
        tight = columns[:, 3:].T if elastic else np.tile(given[:, None], (1, len(columns)))
        y, world, first = shot(base, tight)
        off = world[:, 3:] - share * turn
        if elastic:
            asked = np.maximum(0.0, pre + stiff * (y[STATES:].T - motors))
            off = np.concatenate([off, columns[:, 3:] - asked], axis=1)
        return off, (y, world, first, tight)

    def newton(x: np.ndarray, share: float) -> tuple[np.ndarray, Any] | None:
        precision, last, h = COARSE, np.inf, 1e-5 * unit
        for _ in range(9):
            off, made = left(np.vstack([x, x + np.diag(h)]), share, precision)
            size = np.abs(off[0] / unit).max()
            if (size < 1e-8 and precision == PRECISION) or (size < 1e-3 and share < 1.0):
                return x, made
            if size > max(last, 1e-3):
                return None
            x = x - np.linalg.solve(((off[1:] - off[0]) / h[:, None]).T, off[0])
            last, precision = size, PRECISION if share == 1.0 and size < 1e-2 else COARSE
        return None

    share, step, slope = 0.0, 0.5, np.zeros_like(x)
    while share < 1.0:
        found = newton(x + slope * step, share + step)
        if found is None:
            step *= 0.5
            if step < 1e-3:
                raise RuntimeError(f"no equilibrium found beyond {share:g} of the loads")
            continue
        slope, x, share, made = (found[0] - x) / step if share > 0.0 else slope, found[0], share + step, found[1]
        step = min(1.5 * step, 1.0 - share)
    y, world, first, tight = made
    return TendonRod(
        y[:3, 0],
        quaternion_rotation(y[3:7, 0][None])[0],
        y[STATES:, 0],
        tight[:, 0],
        x[:3],
        world[0] - np.r_[pull, turn],
        first[:, 0],
    )
