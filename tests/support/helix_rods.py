"""Independent answers for a rod that is a helix at rest: the curve in closed form, the loaded rod in two ways, its compliance.

Nothing here knows of softrobots. A rod is clamped at the origin with the identity as its base frame: z along the rod, x towards
the axis of its helix. All loads are dead. SI units, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_bvp

from tests.support.rods import quaternion_rotation

NODES_A_RADIAN = 6  # of the first mesh of a rod
LOAD_STEP = 0.25  # of the load factor; each solution is the guess of the next


@dataclass(frozen=True)
class HelixRod:
    """A uniform rod with equal bending stiffnesses and without shear, at rest a helix.

    Attributes:
        length: at rest [m].
        curvature: at rest, about y of its frames [1/m]; positive.
        torsion: at rest, about z of its frames; negative for a left-handed helix [1/m].
        bending_stiffness: EI [N m^2].
        torsional_stiffness: GJ [N m^2].
        axial_stiffness: EA [N]; None for an inextensible rod.
    """

    length: float
    curvature: float
    torsion: float
    bending_stiffness: float
    torsional_stiffness: float
    axial_stiffness: float | None = None

    @property
    def softness(self) -> np.ndarray:
        """1 / EI, 1 / EI, 1 / GJ, 1 / EA (0 if inextensible), shape (4,)."""
        bend, twist = 1.0 / self.bending_stiffness, 1.0 / self.torsional_stiffness
        return np.array([bend, bend, twist, 0.0 if self.axial_stiffness is None else 1.0 / self.axial_stiffness])

    def frames(self, s: ArrayLike) -> np.ndarray:
        """Frames at rest at arc lengths s (n,), shape (n, 4, 4); see `helix_frames`."""
        return helix_frames(self.curvature, self.torsion, s)


def actuated_rod(
    contraction: float,
    angle: float,
    diameter: float,
    *,
    length: float,
    sign: int,
    bending_stiffness: float,
    torsional_stiffness: float,
    axial_stiffness: float | None = None,
) -> HelixRod:
    """The tube that an actuator bends, as a rod, by the complex form zeta = lambda exp(2 i theta).

    Args:
        contraction: lambda.
        angle: theta [rad].
        diameter: D [m].
        length: of the uninflated tube [m].
        sign: +1 for a right-handed helix, -1 for a left-handed one.
        bending_stiffness: EI [N m^2].
        torsional_stiffness: GJ [N m^2].
        axial_stiffness: EA [N]; None for an inextensible rod.
    """
    zeta = contraction * np.exp(2j * angle)
    size = diameter * abs(1 + zeta) ** 2
    return HelixRod(
        float(length * abs(1 + zeta) / (2 * np.cos(angle))),
        float(2 * (1 - contraction**2) / size),
        float(sign * 4 * contraction * np.sin(2 * angle) / size),
        bending_stiffness,
        torsional_stiffness,
        axial_stiffness,
    )


def helix_frames(curvature: float, torsion: float, s: ArrayLike) -> np.ndarray:
    """Frenet frames of a helix at arc lengths s (n,), in the first one: x normal, y binormal, z tangent; shape (n, 4, 4) [m].

    In the frame of the helix, p = (R cos a, R sin a, b a) with R + i b = (curvature + i torsion) / (curvature^2 + torsion^2); a
    negative b is a left-handed helix that runs down.
    """
    size = np.hypot(curvature, torsion)
    along, across, radius = torsion / size, curvature / size, curvature / size**2
    a = np.r_[0.0, np.asarray(s, dtype=float).reshape(-1)] * size
    zero, one = np.zeros_like(a), np.ones_like(a)
    rows = [
        [-np.cos(a), along * np.sin(a), -across * np.sin(a), radius * np.cos(a)],
        [-np.sin(a), -along * np.cos(a), across * np.cos(a), radius * np.sin(a)],
        [zero, across * one, along * one, along / size * a],
        [zero, zero, zero, one],
    ]
    frames = np.moveaxis(np.array(rows), 2, 0)
    return np.asarray(np.linalg.inv(frames[0]) @ frames[1:])


def actuator_frames(
    contraction: float, angle: float, diameter: float, sign: int, s: ArrayLike, *, from_base: bool = True
) -> np.ndarray:
    """Frames of the centre line of a tube that an actuator bends, at lengths s (n,) along it, to the last digit; (n, 4, 4) [m].

    Rc + i b = D (1 + z) / (2 (1 - z)) with z = lambda exp(2 i theta), 50 digits: nothing is lost near straight.

    Args:
        contraction: lambda.
        angle: theta [rad].
        diameter: D [m].
        sign: +1 for a right-handed helix, -1 for a left-handed one.
        s: lengths [m].
        from_base: in the first frame; else in that of the helix, z along its axis.
    """
    with mp.workdps(50):
        zeta = mp.mpf(contraction) * mp.expj(2 * mp.mpf(angle))
        if zeta == 1:  # the straight tube
            poses = np.tile(np.eye(4), (len(np.atleast_1d(s)), 1, 1))
            poses[:, 2, 3] = s
            return poses
        place = mp.mpf(diameter) * (1 + zeta) / (2 * (1 - zeta))
        radius, pitch, size = place.real, place.imag, abs(place)

        def frame(length: Any) -> Any:
            cosine, sine = mp.cos(length / size), mp.sin(length / size)
            tangent = [-radius * sine / size, sign * radius * cosine / size, pitch / size]
            normal = [-cosine, -sign * sine, mp.mpf(0)]
            binormal = [
                tangent[1] * normal[2] - tangent[2] * normal[1],
                tangent[2] * normal[0] - tangent[0] * normal[2],
                tangent[0] * normal[1] - tangent[1] * normal[0],
            ]
            point = [radius * cosine, sign * radius * sine, pitch * length / size]
            return mp.matrix([*([normal[i], binormal[i], tangent[i], point[i]] for i in range(3)), [0, 0, 0, 1]])

        back = frame(mp.mpf(0)) ** -1 if from_base else mp.eye(4)
        return np.array([(back * frame(mp.mpf(length))).tolist() for length in np.atleast_1d(s)], dtype=float)


def gauss(low: float, high: float, count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre points and weights on an interval."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    half = 0.5 * (high - low)
    return low + half * (nodes + 1.0), half * weights


def load_carried(rod: HelixRod, s: ArrayLike) -> np.ndarray:
    """Bending moments about x and y, torque and tension at s (n,) per wrench on the tip, shape (n, 4, 6); at rest.

    Wrench: force, then moment, world axes. The moment at p(s) is m + (p(L) - p(s)) x f.
    """
    frames, tip = rod.frames(s), rod.frames([rod.length])[0, :3, 3]
    made = np.zeros((len(frames), 4, 6))
    for row, frame in enumerate(frames):
        x, y, z = tip - frame[:3, 3]
        made[row, :3, :3] = frame[:3, :3].T @ [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        made[row, :3, 3:] = frame[:3, :3].T
        made[row, 3, :3] = frame[:3, 2]
    return made


def tip_compliance(rod: HelixRod) -> np.ndarray:
    """Castigliano at no load: tip displacement and rotation per force and moment on the tip, shape (6, 6), by quadrature."""
    pieces = np.linspace(0.0, rod.length, 2 + int(rod.length * np.hypot(rod.curvature, rod.torsion)))
    total = np.zeros((6, 6))
    for low, high in pairwise(pieces):
        points, weights = gauss(low, high)
        carried = load_carried(rod, points)
        total += np.einsum("n,nai,a,naj->ij", weights, carried, rod.softness, carried)
    return total


@dataclass(frozen=True)
class AxialWrench:
    """A wrench along the axis of a helix, under which the rod is another helix: Love's exact solution.

    Attributes:
        wrench: at the tip, force [N], then moment [N m], world axes, (6,).
        strains: of the loaded rod: curvature, torsion per rest length [1/m], and stretch [-].
        moment: bending moment, the same everywhere [N m].
        torque: the same everywhere [N m].
    """

    wrench: np.ndarray
    strains: np.ndarray
    moment: float
    torque: float


def axial_wrench(rod: HelixRod, curvature: float, torsion: float) -> AxialWrench:
    """The wrench along the axis of the loaded helix that makes a rod of given curvature and torsion per rest length.

    With the lead angle a, tan a = torsion / curvature: force F along the axis and couple C about it carry the bending moment
    C cos a - F R sin a, the torque C sin a + F R cos a and the tension F sin a. The first two are EI and GJ times the change of
    curvature and torsion; R = n curvature / (curvature^2 + torsion^2), stretch n = 1 + F sin a / EA.
    """
    size = float(np.hypot(curvature, torsion))
    sine, cosine = torsion / size, curvature / size
    moment = rod.bending_stiffness * (curvature - rod.curvature)
    torque = rod.torsional_stiffness * (torsion - rod.torsion)
    couple, arm = moment * cosine + torque * sine, (torque * cosine - moment * sine) * size / cosine  # arm: F n
    soft = 0.0 if rod.axial_stiffness is None else sine / rod.axial_stiffness
    force = 2.0 * arm / (1.0 + np.sqrt(1.0 + 4.0 * soft * arm))
    stretch = 1.0 + soft * force
    tip = helix_frames(curvature / stretch, torsion / stretch, [stretch * rod.length])[0]
    normal, binormal, tangent = tip[:3, :3].T
    axis, centre = cosine * binormal + sine * tangent, tip[:3, 3] + stretch * cosine / size * normal
    at_tip = couple * axis + np.cross(centre - tip[:3, 3], force * axis)
    return AxialWrench(np.r_[force * axis, at_tip], np.array([curvature, torsion, stretch]), moment, torque)


def solve_helix_rod(
    rod: HelixRod, tip_wrench: ArrayLike | None = None, load: ArrayLike | None = None, *, factor: float = 1.0, tol: float = 1e-8
) -> tuple[np.ndarray, np.ndarray, Any]:
    """Equilibrium of a helical rod under dead loads, on the branch that starts at rest, by `solve_bvp`.

    Kirchhoff's equations for the position p, a quaternion q of the section and the moment m in world axes, by rest length:
    with the force n(s) = F + f (L - s) and R of q, p' = (1 + n.t / EA) t, q' = q (0, u) / 2 with
    u = (0, curvature, torsion) + K^-1 R^T m, m' = n x p'; p(0) = 0, q(0) = 1, m(L) = M.

    Args:
        rod: the rod.
        tip_wrench: force [N], then moment [N m], at the tip, world axes, (6,).
        load: force per rest length, world axes, (3,) [N/m].
        factor: of all loads.
        tol: relative residual.

    Returns:
        position (3,) [m] and rotation (3, 3) of the tip, and the solution of `solve_bvp` on [0, L].
    """
    wrench = np.zeros(6) if tip_wrench is None else np.asarray(tip_wrench, dtype=float)
    spread = np.zeros(3) if load is None else np.asarray(load, dtype=float)
    rest, softness = np.array([[0.0], [rod.curvature], [rod.torsion]]), rod.softness

    def rates(share: float, s: np.ndarray, y: np.ndarray) -> np.ndarray:
        q, m = y[3:7], y[7:]
        rotations = quaternion_rotation(q.T)
        n = share * (wrench[:3, None] + spread[:, None] * (rod.length - s))
        tangents = rotations[:, :, 2].T
        u = rest + softness[:3, None] * np.einsum("nji,jn->in", rotations, m)
        dp = (1.0 + softness[3] * np.sum(tangents * n, axis=0)) * tangents
        dq = 0.5 * np.vstack([-np.sum(q[1:] * u, axis=0), q[0] * u + np.cross(q[1:], u, axis=0)])
        return np.vstack([dp, dq, np.cross(n, dp, axis=0)])

    def ends(share: float, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.r_[a[:3], a[3:7] - [1.0, 0.0, 0.0, 0.0], b[7:] - share * wrench[3:]]

    size = float(np.hypot(rod.curvature, rod.torsion))
    mesh = np.linspace(0.0, rod.length, 2 + int(NODES_A_RADIAN * size * rod.length))
    frames = rod.frames(mesh)
    half = 0.5 * size * mesh  # the frames turn about one direction: (0, curvature, torsion)
    turning = np.outer([0.0, rod.curvature, rod.torsion], np.sin(half)) / size
    y = np.vstack([frames[:, :3, 3].T, np.cos(half)[None], turning, np.zeros((3, len(mesh)))])
    shares = factor * np.linspace(0.0, 1.0, 1 + int(np.ceil(1.0 / LOAD_STEP)))[1:]
    for share in shares:
        level = tol if share == shares[-1] else 1e-4
        found = solve_bvp(partial(rates, share), partial(ends, share), mesh, y, tol=level, bc_tol=1e-11, max_nodes=20_000)
        if not found.success:
            raise RuntimeError(f"solve_bvp at {share:g} of the load: {found.message}")
        y = found.sol(mesh)
    final = found.sol(rod.length)
    return final[:3], quaternion_rotation(final[None, 3:7])[0], found
