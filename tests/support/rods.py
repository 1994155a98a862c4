"""Independent answers for slender elastic rods: the elastica in closed form, Kirchhoff rods as a boundary-value problem.

Nothing here knows of softrobots, of rigid segments or of springs: only NumPy, SciPy and the equations of the rod. Every
rod is clamped at the origin, straight along +z when unloaded, with the identity as its base frame. All loads are dead:
their components in the world axes do not change when the rod moves. SI units, angles in radians.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from scipy.special import elliprd, elliprf

CLOSE_ANGLE = np.deg2rad(0.25)  # how well random_wrenches meets the angle it drew
COARSE_NODES = 400  # at most, on the way to the full load and in random_wrenches
COARSE_TOL = 1e-4  # there
LARGEST_CHANGE = 0.8  # of the moment map in one load step, see _Branch
LARGEST_TURN = 0.5  # of any section in one load step [rad]
MAX_NODES = 20_000
SMALLEST_ANGLE = np.deg2rad(10.0)
SMALLEST_MAP = 0.1  # singular value of the moment map in random_wrenches: not too close to the end of a branch
SMALLEST_STEP = 1e-5  # of the load factor


def elastica_tip(bending_stiffness: float, length: float, force: float) -> tuple[float, float, float]:
    """Tip of an inextensible planar cantilever along +z under a dead force along +x at the tip (Bisshopp and Drucker, 1945).

    With alpha = L sqrt(F / EI), tip angle t and modulus k^2 = (1 + sin t) / 2, sin(a) = 1 / (k sqrt(2)):
    alpha = K(k) - F(a, k), x = L - 2 sqrt(EI / F) (E(k) - E(a, k)), z = sqrt(2 EI sin(t) / F). The differences of
    Legendre integrals are written as one integral each, from 0 to b with tan(b) = 1 / (tan(a) sqrt(1 - k^2)), and evaluated
    in Carlson's form, so that nothing cancels for a small or a large force. The unknown is log(sin t / (1 - sin t)).

    Args:
        bending_stiffness: EI [N m^2].
        length: L [m].
        force: along +x, of either sign, up to 1e5 EI / L^2; 0 gives the straight rod exactly [N].

    Returns:
        x, z: position of the tip [m].
        angle: rotation of the tip about +y [rad].
    """
    if force == 0.0:
        return 0.0, float(length), 0.0
    alpha = length * np.sqrt(abs(force) / bending_stiffness)

    def integrals(log_ratio: float) -> tuple[float, float, float, float, float]:
        """F(b, k); b's sine; Carlson's second integral; k; the ratio sin t / (1 - sin t)."""
        ratio = np.exp(log_ratio)
        small = 0.5 / (1.0 + ratio)  # 1 - k^2
        sine = np.sqrt(ratio / (1.0 + ratio) / (1.0 - small))
        arguments = (small / (1.0 - small), 2.0 * small, 1.0)  # cos(b)^2 and 1 - k^2 sin(b)^2
        return sine * elliprf(*arguments), sine, elliprd(*arguments), np.sqrt(1.0 - small), ratio

    bracket = 2.0 * np.log(alpha) - 3.0, 2.0 * alpha + 5.0
    solution = brentq(lambda v: np.log(integrals(v)[0] / alpha), *bracket, xtol=1e-15, rtol=4 * np.finfo(float).eps)
    first, sine, carlson, modulus, ratio = integrals(solution)
    second = first - modulus**2 / 3.0 * sine**3 * carlson  # E(b, k)
    scale = length / alpha
    x = scale * (first - 2.0 * second + np.sqrt(2.0) * modulus * sine)
    z = scale * np.sqrt(2.0 * ratio / (1.0 + ratio))
    angle = np.arctan2(ratio, np.sqrt(1.0 + 2.0 * ratio))
    sign = np.sign(force)
    return float(sign * x), float(z), float(sign * angle)


def elastica_moment_tip(bending_stiffness: float, length: float, moment: float) -> tuple[float, float, float]:
    """Tip of the same cantilever under a moment about +y at the tip alone: an arc of a circle.

    Args:
        bending_stiffness: EI [N m^2].
        length: L [m].
        moment: about +y [N m].

    Returns:
        x, z: position of the tip [m].
        angle: rotation of the tip about +y [rad].
    """
    angle = moment * length / bending_stiffness
    half = 0.5 * angle
    x = length * half * np.sinc(half / np.pi) ** 2
    return float(x), float(length * np.sinc(angle / np.pi)), float(angle)


def cantilever_frequencies(tip_mass: float) -> np.ndarray:
    """First three bending frequencies of a clamped Euler-Bernoulli rod with a point mass at its tip.

    Squares of the zeros of 1 + cos x cosh x + mu x (cos x sinh x - sin x cosh x), with mu the mass over that of the rod
    [Blevins, Formulas for Natural Frequency and Mode Shape, 1979, tables 8-1 and 8-8]; it is divided by cosh x here.

    Args:
        tip_mass: over the mass of the rod.

    Returns:
        Angular frequencies in the unit sqrt(EI / (rho A L^4)), ascending, shape (3,).
    """

    def characteristic(x: float) -> float:
        return float(1.0 / np.cosh(x) + np.cos(x) + tip_mass * x * (np.cos(x) * np.tanh(x) - np.sin(x)))

    x = np.linspace(0.2, 9.0, 200)
    values = [characteristic(one) for one in x]
    changes = [i for i in range(len(x) - 1) if values[i] * values[i + 1] < 0.0]
    return np.array([brentq(characteristic, x[i], x[i + 1], xtol=1e-14) for i in changes[:3]]) ** 2


@dataclass(frozen=True)
class Rod:
    """A uniform straight rod with equal bending stiffnesses, without shear.

    Attributes:
        length: unloaded [m].
        bending_stiffness: EI, about both axes of the section [N m^2].
        torsional_stiffness: GJ [N m^2].
        axial_stiffness: EA [N]; None for an inextensible rod.
    """

    length: float
    bending_stiffness: float
    torsional_stiffness: float
    axial_stiffness: float | None = None


def steel_rod(length: float = 0.6, radius: float = 0.8e-3, young: float = 207e9, poisson: float = 0.3) -> Rod:
    """A round rod of spring steel.

    Args:
        length: [m].
        radius: [m].
        young: Young's modulus E [Pa].
        poisson: Poisson's ratio.

    Returns:
        The rod, with EI = E pi r^4 / 4, GJ = E / (2 (1 + nu)) pi r^4 / 2 and EA = E pi r^2.
    """
    area = np.pi * radius**2
    bending = young * area * radius**2 / 4.0
    return Rod(length, float(bending), float(bending / (1.0 + poisson)), float(young * area))


@dataclass(frozen=True)
class RodSolution:
    """A rod in equilibrium; arc lengths are those of the unloaded rod.

    Attributes:
        length: of the unloaded rod [m].
        moment_unit: EI / L, the unit of moment in `states` [N m].
        ends: arc lengths over L at which the pieces start and end, shape (pieces + 1,).
        states: the spline of `solve_bvp` on [0, 1]: for every piece position / L (3), quaternion w, x, y, z of any length
            (4) and internal moment in world axes (3), stacked.
        nodes: how many nodes `solve_bvp` ended with.
        residual: the largest relative residual that `solve_bvp` reports.
    """

    length: float
    moment_unit: float
    ends: np.ndarray
    states: Any
    nodes: int
    residual: float

    def at(self, s: ArrayLike) -> np.ndarray:
        """The state at arc lengths s (n,) [m], shape (10, n); at the middle wrench, just after it."""
        s = np.asarray(s, dtype=float).reshape(-1) / self.length
        if np.any((s < -1e-12) | (s > 1.0 + 1e-12)):
            raise ValueError("arc lengths must lie between 0 and the length of the rod")
        piece = np.clip(np.searchsorted(self.ends, s, side="right") - 1, 0, len(self.ends) - 2)
        x = np.clip((s - self.ends[piece]) / np.diff(self.ends)[piece], 0.0, 1.0)
        stacked = self.states(x).reshape(-1, 10, len(s))
        return stacked[piece, :, np.arange(len(s))].T

    def positions(self, s: ArrayLike) -> np.ndarray:
        """Points of the centre line at arc lengths s (n,) [m], shape (n, 3) [m]."""
        return self.length * self.at(s)[:3].T

    def rotations(self, s: ArrayLike) -> np.ndarray:
        """Frames of the sections, columns in world axes, third column the tangent; shape (n, 3, 3)."""
        return quaternion_rotation(self.at(s)[3:7].T)

    def moments(self, s: ArrayLike) -> np.ndarray:
        """Internal moment in world axes, of the part after s on the part before it, shape (n, 3) [N m]."""
        return self.moment_unit * self.at(s)[7:].T


def quaternion_rotation(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions (n, 4) in the order w, x, y, z, of any length but 0."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


class _Problem:
    """The boundary-value problem in units of L, EI / L^2 and EI / L, at a load factor.

    A piece has 10 states: position p, quaternion q, internal moment m in world axes. The internal force n in world axes is
    known in advance, as the loads are dead: the sum of all forces further out. With the tangent t, Kirchhoff's equations are

        p' = (1 + n.t / EA) t,    m' = -p' x n,    q' = (0, w) q / 2 with w = R K^-1 R^T m = m / EI + (1 / GJ - 1 / EI) (t.m) t.

    t comes from q / |q|, so that the length of q, which drifts by the discretisation error, has no influence on anything.
    """

    def __init__(
        self, rod: Rod, tip_wrench: ArrayLike, mid_wrench: ArrayLike | None, mid: float, gravity_load: ArrayLike | None
    ) -> None:
        if mid_wrench is not None and not 0.0 < mid < 1.0:
            raise ValueError("the middle wrench must act between the ends of the rod: 0 < mid < 1")
        length, stiffness = rod.length, rod.bending_stiffness
        units = np.repeat([stiffness / length**2, stiffness / length], 3)
        wrenches = np.zeros((2, 6))  # middle, tip
        for wrench, given in zip(wrenches, (mid_wrench, tip_wrench), strict=True):
            wrench[:] = 0.0 if given is None else np.asarray(given, dtype=float).reshape(6) / units
        self.tip, self.middle = wrenches[1], wrenches[0]
        self.weight = np.zeros(3) if gravity_load is None else np.asarray(gravity_load, dtype=float) * length**3 / stiffness
        self.ends = np.array([0.0, 1.0]) if mid_wrench is None else np.array([0.0, mid, 1.0])
        self.pieces, self.spans = len(self.ends) - 1, np.diff(self.ends)[:, None]
        self.rod, self.moment_unit = rod, units[5]
        self.twist = stiffness / rod.torsional_stiffness - 1.0
        self.stretch = 0.0 if rod.axial_stiffness is None else units[0] / rod.axial_stiffness
        # A guess of the largest rotation under the full load, as if the rod stayed straight [rad].
        bending = [np.linalg.norm(w[:3]) / 2 + np.linalg.norm(w[3:]) * max(1.0, 1.0 + self.twist) for w in wrenches]
        self.rotation = float(sum(bending) + np.linalg.norm(self.weight) / 6)

    def forces(self, factor: float, x: np.ndarray) -> np.ndarray:
        """Internal force at x (n,) on each piece: all that acts further out, shape (pieces, 3, n)."""
        s = self.ends[:-1, None] + self.spans * x
        applied = np.array([self.tip[:3] + (self.middle[:3] if i + 1 < self.pieces else 0.0) for i in range(self.pieces)])
        return factor * (applied[:, :, None] + self.weight[:, None] * (1.0 - s)[:, None, :])

    def rates(self, factor: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Derivatives of the stacked states y (10 pieces, n) with respect to x (n,)."""
        y = y.reshape(self.pieces, 10, -1)
        q, m, n = y[:, 3:7], y[:, 7:], self.forces(factor, x)
        t = _tangents(q)
        turn = m + self.twist * np.sum(t * m, axis=1, keepdims=True) * t
        dp = (1.0 + self.stretch * np.sum(t * n, axis=1, keepdims=True)) * t
        w, v = q[:, :1], q[:, 1:]
        dq = [-0.5 * np.sum(turn * v, axis=1, keepdims=True), 0.5 * (w * turn + np.cross(turn, v, axis=1))]
        derivatives = np.concatenate([dp, *dq, np.cross(n, dp, axis=1)], axis=1)
        return (self.spans[:, :, None] * derivatives).reshape(10 * self.pieces, -1)

    def jacobian(self, factor: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Derivatives of `rates` with respect to the states, shape (10 pieces, 10 pieces, n)."""
        y, twist, stretch = y.reshape(self.pieces, 10, -1), self.twist, self.stretch
        out = np.zeros((10 * self.pieces, 10 * self.pieces, len(x)))
        for i, (state, n) in enumerate(zip(y, self.forces(factor, x), strict=True)):
            block = out[10 * i : 10 * i + 10, 10 * i : 10 * i + 10]
            q, m, t = state[3:7], state[7:], _tangents(state[None, 3:7])[0]
            dt, tm, tn = _tangent_derivatives(q, t), np.sum(t * m, axis=0), np.sum(t * n, axis=0)
            turn = m + twist * tm * t
            d_turn_q = twist * (np.einsum("in,jn->ijn", t, np.einsum("kn,kjn->jn", m, dt)) + tm * dt)
            d_turn_m = np.eye(3)[:, :, None] + twist * np.einsum("in,jn->ijn", t, t)
            dp = stretch * np.einsum("in,jn->ijn", t, np.einsum("kn,kjn->jn", n, dt)) + (1.0 + stretch * tn) * dt
            left = 0.5 * _left_factor(q)  # q' = left(q) turn, and is also linear in q
            block[:3, 3:7] = dp
            block[3:7, 3:7] = np.einsum("ikn,kjn->ijn", left, d_turn_q) + 0.5 * _turn_matrix(turn)
            block[3:7, 7:] = np.einsum("ikn,kjn->ijn", left, d_turn_m)
            block[7:, 3:7] = np.cross(n[:, None, :], dp, axis=0)
            block *= self.spans[i]
        return out

    def conditions(self, factor: float, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Clamped base; the pieces joined, with the jump of the middle moment; the tip moment; zero where they hold."""
        a, b = a.reshape(self.pieces, 10), b.reshape(self.pieces, 10)
        parts = [a[0, :7] - [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], b[-1, 7:] - factor * self.tip[3:]]
        if self.pieces == 2:
            parts += [a[1, :7] - b[0, :7], a[1, 7:] + factor * self.middle[3:] - b[0, 7:]]
        return np.concatenate(parts)

    def solve(self, factor: float, x: np.ndarray, guess: np.ndarray, tol: float, max_nodes: int = MAX_NODES) -> Any:
        """`solve_bvp` at a load factor, from values `guess` (10 pieces, n) at nodes x (n,)."""
        functions = (partial(f, factor) for f in (self.rates, self.conditions))
        jacobian = partial(self.jacobian, factor)
        return solve_bvp(*functions, x, guess, fun_jac=jacobian, tol=tol, bc_tol=1e-12, max_nodes=max_nodes)

    def moment_map(self, factor: float, spline: Any, x: np.ndarray) -> np.ndarray:
        """How the tip moment of the equations started at the base follows the moment there, (3, 3); Runge-Kutta over x (n,)."""
        points = np.sort(np.concatenate([x, 0.5 * (x[1:] + x[:-1])]))
        a = np.moveaxis(self.jacobian(factor, points, spline(points)), 2, 0)
        h, a0, a1, a2, one = np.diff(x)[:, None, None], a[:-1:2], a[1::2], a[2::2], np.eye(a.shape[1])
        k2 = a1 @ (one + 0.5 * h * a0)
        k3 = a1 @ (one + 0.5 * h * k2)
        steps = one + h / 6.0 * (a0 + 2.0 * k2 + 2.0 * k3 + a2 @ (one + h * k3))
        whole = reduce(lambda before, step: step @ before, steps, one)  # block-diagonal: one block for each piece
        blocks = [whole[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] for i in range(self.pieces)]
        return reduce(lambda inner, outer: outer @ inner, blocks)[7:, 7:]

    def straight(self, x: np.ndarray) -> np.ndarray:
        """The unloaded rod at nodes x (n,), shape (10 pieces, n)."""
        y = np.zeros((self.pieces, 10, len(x)))
        y[:, 2] = self.ends[:-1, None] + self.spans * x
        y[:, 3] = 1.0
        return y.reshape(10 * self.pieces, -1)

    def packed(self, solution: Any) -> RodSolution:
        """For the user."""
        residual = float(np.max(solution.rms_residuals))
        return RodSolution(self.rod.length, self.moment_unit, self.ends, solution.sol, len(solution.x), residual)


def _tangents(q: np.ndarray) -> np.ndarray:
    """Third columns of the rotations of quaternions (pieces, 4, n) of any length, shape (pieces, 3, n)."""
    w, x, y, z = np.moveaxis(q, 1, 0)
    columns = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z], axis=1)
    return columns / np.sum(q * q, axis=1, keepdims=True)


def _tangent_derivatives(q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Derivatives (3, 4, n) of the tangents t (3, n) with respect to the quaternions q (4, n)."""
    w, x, y, z = q
    columns = 2 * np.array([[y, z, w, x], [-x, -w, z, y], [w, -x, -y, z]])
    return (columns - 2 * np.einsum("in,jn->ijn", t, q)) / np.sum(q * q, axis=0)


def _left_factor(q: np.ndarray) -> np.ndarray:
    """Matrices (4, 3, n) with (0, v) q = matrix v for vectors v (3,) and quaternions q (4, n)."""
    w, x, y, z = q
    return np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])


def _turn_matrix(v: np.ndarray) -> np.ndarray:
    """Matrices (4, 4, n) with (0, v) q = matrix q for vectors v (3, n) and quaternions q (4,)."""
    (a, b, c), o = v, np.zeros(v.shape[1])
    return np.array([[o, -a, -b, -c], [a, o, -c, b], [b, c, o, -a], [c, -b, a, o]])


class _Branch:
    """The equilibria that start at the unloaded rod, followed in steps of the load factor; coarse solutions.

    A step is refused, and tried again with half its length, if it turns a section by more than LARGEST_TURN, or if with the
    moment maps J before and J' after it (`_Problem.moment_map`) an eigenvalue of J^-1 J' differs from 1 by more than
    LARGEST_CHANGE. J is the identity for the unloaded rod and singular where equilibria meet. On the branch all eigenvalues
    tend to 1 as the step shrinks; a jump past a buckling load, to an equilibrium that does not continue the last one, has
    one or two near -1, however short it is.
    """

    nodes = np.linspace(0.0, 1.0, 13)

    def __init__(self, problem: _Problem) -> None:
        self.problem, self.factor = problem, 0.0
        self.y = problem.straight(self.nodes)
        self.map = np.eye(3)
        self.slope: np.ndarray = np.zeros_like(self.y)  # of y with respect to the factor, from the last two
        self.largest = 1.0 / max(problem.rotation, 1e-3)  # first step: 1 rad if the rod stayed straight
        self.message = ""

    def turn(self, spline: Any) -> float:
        """Largest angle by which a section turns between the state now and another [rad]."""
        p, q = (y.reshape(self.problem.pieces, 10, -1)[:, 3:7] for y in (self.y, spline(self.nodes)))
        p, q = (a / np.linalg.norm(a, axis=1, keepdims=True) for a in (p, q))
        gap = np.minimum(np.linalg.norm(p - q, axis=1), np.linalg.norm(p + q, axis=1))
        return float(np.max(4.0 * np.arcsin(np.minimum(0.5 * gap, 1.0))))

    def check(self, to: float, found: Any) -> tuple[str, np.ndarray]:
        """Why what `solve_bvp` found at a load factor is not the next equilibrium, empty if it is; and its moment map."""
        if not found.success:
            return found.message, self.map
        moment_map = self.problem.moment_map(to, found.sol, found.x)
        if self.turn(found.sol) > LARGEST_TURN:
            return f"a section turned by more than {LARGEST_TURN} rad", moment_map
        change = np.max(np.abs(np.linalg.eigvals(np.linalg.solve(self.map, moment_map)) - 1.0))
        return "the branch ends, or the equilibrium found is not on it" if change > LARGEST_CHANGE else "", moment_map

    def step(self, to: float) -> bool:
        """Try to go to a load factor; False, and nothing changed but the message, if the step is refused."""
        guess = self.y + (to - self.factor) * self.slope
        found = self.problem.solve(to, self.nodes, guess, COARSE_TOL, COARSE_NODES)
        self.message, moment_map = self.check(to, found)
        if self.message:
            return False
        y, step = found.sol(self.nodes), to - self.factor
        self.largest = step * np.clip(0.8 * LARGEST_TURN / max(self.turn(found.sol), 1e-9), 0.5, 2.0)
        self.slope = (y - self.y) / step
        self.factor, self.y, self.map = to, y, moment_map
        return True

    def advance(self, limit: float) -> bool:
        """One step towards a load factor, as long as it can be; False at a fold or where `solve_bvp` fails."""
        step = min(self.largest, limit - self.factor)
        while not self.step(limit if step == limit - self.factor else self.factor + step):
            step *= 0.5
            if step < SMALLEST_STEP * max(1.0, limit):
                return False
        return True

    def tilt(self) -> float:
        """Largest angle between a tangent and the base tangent [rad]."""
        t = _tangents(self.y.reshape(self.problem.pieces, 10, -1)[:, 3:7])
        return float(np.max(np.arctan2(np.hypot(t[:, 0], t[:, 1]), t[:, 2])))


def solve_rod(
    rod: Rod,
    tip_wrench: ArrayLike,
    mid_wrench: ArrayLike | None = None,
    mid: float = 0.5,
    gravity_load: ArrayLike | None = None,
    tol: float = 1e-9,
) -> RodSolution:
    """Equilibrium of a rod under dead wrenches, on the branch that starts at the unloaded rod.

    All loads grow together from zero with coarse solutions, each the start of the next, in steps short enough to stay on the
    branch (`_Branch`); then the full load is solved to `tol`. The branch of a rod that is just off its axis is followed
    through its buckling load, smoothly, to the bent rod. Where the branch ends (a fold, or a perfect buckling load, such as a
    push exactly along the axis) there is no answer but an error. Under dead forces alone every answer is therefore a stable
    equilibrium; dead moments have no potential, and of them it can only be said that no equilibrium was jumped to.

    Args:
        rod: the rod; body rates u = K^-1 R^T m with K = diag(EI, EI, GJ), stretch 1 + (R^T n)_z / EA.
        tip_wrench: force [N], then moment [N m], at the tip in world axes, (6,).
        mid_wrench: the same at the fraction `mid` of the length, (6,); None for no wrench there.
        mid: 0 < mid < 1.
        gravity_load: force per unloaded length, (3,) [N/m].
        tol: relative residual for `solve_bvp`.

    Returns:
        The solution.

    Raises:
        RuntimeError: `solve_bvp` failed, or the branch ends before the full load.
        ValueError: `mid` is not inside the rod.
    """
    problem = _Problem(rod, tip_wrench, mid_wrench, mid, gravity_load)
    branch = _Branch(problem)
    while branch.factor < 1.0:
        if not branch.advance(1.0):
            raise RuntimeError(f"no equilibrium found beyond {branch.factor:.4f} of the load: {branch.message}")
    nodes, y = branch.nodes, branch.y
    for level in sorted({max(1e-6, tol), tol}, reverse=True):
        found = problem.solve(1.0, nodes, y, level)
        if not found.success:
            raise RuntimeError(f"solve_bvp at tol {level:g}: {found.message}")
        nodes, y = found.x, found.y
    message, _ = branch.check(1.0, found)
    if message:
        raise RuntimeError(f"the fine solution is not the one that the load steps led to: {message}")
    return problem.packed(found)


def rod_tip(
    rod: Rod,
    tip_wrench: ArrayLike,
    mid_wrench: ArrayLike | None = None,
    mid: float = 0.5,
    gravity_load: ArrayLike | None = None,
    tol: float = 1e-9,
) -> tuple[np.ndarray, np.ndarray]:
    """Tip of a rod under dead wrenches; arguments and errors of `solve_rod`.

    Returns:
        position: (3,) [m].
        rotation: (3, 3), columns in world axes, third column the tangent.
    """
    solution = solve_rod(rod, tip_wrench, mid_wrench, mid, gravity_load, tol)
    return solution.positions(rod.length)[0], solution.rotations(rod.length)[0]


def random_wrenches(
    rng: np.random.Generator, rod: Rod, count: int, bend: float = np.pi / 2, mid: float = 0.5
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random dead wrenches at the tip and at the middle under which a rod bends by angles spread evenly up to `bend`.

    Each pair is made so: two forces and two moments with uniform directions and with magnitudes uniform in 0.2 ... 1 times
    EI / L^2 and EI / L; and an angle uniform in 10 degrees ... `bend`. The whole pair is then scaled by one factor, so that
    the largest angle between a tangent of the rod in equilibrium and the base tangent is the drawn one: the factor grows from
    zero along the branch of the unloaded rod, with the coarse non-linear solutions of `solve_rod`, until the angle is passed
    for the first time; bisection and false position, again with the non-linear rod, then find the factor to 0.25 degrees.
    Directions are drawn again if the factor exceeds 5 (loads that mostly pull or twist), or if the branch ends first or soon
    after (a small singular value of the moment map, see `_Branch`).

    Args:
        rng: the only source of chance: the same generator state gives the same wrenches.
        rod: the rod.
        count: how many pairs.
        bend: the largest angle [rad].
        mid: where the middle wrench acts, as a fraction of the length.

    Returns:
        `count` pairs of tip and middle wrench, each (6,): force [N], then moment [N m], in world axes.
    """
    units = np.repeat([rod.bending_stiffness / rod.length**2, rod.bending_stiffness / rod.length], 3)
    pairs: list[tuple[np.ndarray, np.ndarray]] = []
    while len(pairs) < count:
        target = rng.uniform(SMALLEST_ANGLE, bend)
        factor = None
        while factor is None:
            vectors = rng.normal(size=(4, 3))
            vectors *= (rng.uniform(0.2, 1.0, size=4) / np.linalg.norm(vectors, axis=1))[:, None]
            tip, middle = vectors.reshape(2, 6) * units
            factor = _factor_for_tilt(_Problem(rod, tip, middle, mid, None), target)
        pairs.append((factor * tip, factor * middle))
    return pairs


def _factor_for_tilt(problem: _Problem, target: float, largest: float = 5.0) -> float | None:
    """The first load factor at which the largest tangent angle is the target [rad]; None to draw again."""
    branch = low = _Branch(problem)
    while branch.tilt() < target:
        low = copy(branch)
        if branch.factor >= largest or not branch.advance(largest):
            return None
    high = branch
    for trial in range(40):
        if high.tilt() - target < CLOSE_ANGLE:
            return high.factor if np.linalg.norm(high.map, -2) > SMALLEST_MAP else None
        share = 0.5 if trial % 3 == 2 else (target - low.tilt()) / (high.tilt() - low.tilt())
        between = copy(low)
        between.slope = (high.y - low.y) / (high.factor - low.factor)
        if not between.step(low.factor + share * (high.factor - low.factor)):
            return None
        if between.tilt() < target - CLOSE_ANGLE:
            low = between
        else:
            high = between
    return None
