r"""Post-buckling: branch switching at the critical load, and numerical continuation of every branch of equilibria.

At the critical force `F_c` of a push along `d` the tangent stiffness `K_t` of the path from zero force (the *fundamental*
path) is singular: `K_t v = 0`. Other equilibria leave it along the buckling modes `v`. They are found at a small distance
`a` from it by Newton on

.. math:: r(y) - F J^T d = 0, \quad v^T (y - y_c) = a

for `y` and `F`, on both sides of every mode, and followed by pseudo-arclength continuation, whether the force grows or falls.
One mode makes a pitchfork: the fundamental path and two branches. Where two modes have the same critical force (side and up
springs of equal stiffness) branches may leave in any direction of their plane: where the torque *across* that direction
vanishes at distance `a`. It vanishes in some directions only if the robot is not round (two springs of a universal joint, in
fourth order: eight branches), and in all of them if it is (a section of constant strain). Then the buckled equilibria form a
*ring*: each can be moved to the next without a force; it is neutral, not stable (`EquilibriumBranch.neutral`).

The same is done wherever another path crosses the fundamental one later, or crosses a branch (a *secondary* crossing): there
the number of negative eigenvalues changes although the force does not turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.soft_model import SoftModel
from softrobots.statics.buckling.critical_load import CriticalPoint, critical_point
from softrobots.statics.buckling.equilibrium_branch import FUNDAMENTAL, RING, EquilibriumBranch
from softrobots.statics.buckling.force_path import ZERO_EIGENVALUE, FollowedPath, ForcePath, PathPoint
from softrobots.statics.elastic_state import scaled
from softrobots.statics.equilibrium import equilibrium_from_state

BEYOND = 1.25
"""Default limit of the force on branches, relative to the critical force."""

_NEAR = 1e-3  # largest change of a spring at which a branch along one mode is sought [rad or m]
_AWAY = 0.03  # the same in a plane of modes, where directions differ in fourth order only
_DIRECTIONS = 48  # of a plane of modes in which branches are sought
_ROUND = 1e-6  # torque across a direction that counts as zero, relative to the springs' at that distance
_TIE = 0.99  # share of the largest change from which a spring is part of the label
Found = TypeVar("Found")


def post_buckling_branches(
    model: SoftModel,
    q_motors: Any,
    direction: Any,
    *,
    frame: str | None = None,
    gravity: Any = None,
    max_force: float | None = None,
    largest_step: float = 0.05,
) -> tuple[EquilibriumBranch, ...]:
    """Follow the equilibrium path under a growing force, every branch that leaves it, and the branches that leave those.

    At a limit point nothing branches off: the path itself turns back, and is followed to its end. Branches continue beyond the
    knee of a link with a largest moment.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        direction: Direction of the force, shape (3,), any length but zero, world axes.
        frame: Frame that is pushed; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless. It stays constant.
        max_force: Force at which branches end [N]; by default `BEYOND` times the critical force.
        largest_step: Largest distance between two points of a branch [rad]; a change of the force by the critical one counts
            as much as a radian.

    Returns:
        The fundamental path first, then the branches in the order of the crossings at which they were found, by label.

    Raises:
        ParameterError: If an argument is out of range, the model has no springs, or it is unstable under gravity alone.
        NameNotFound: If the frame does not exist.
        NoCriticalLoad: If the path is stable up to `max_force`, or as far as it could be followed.
        NeutralEquilibrium: If more than two modes buckle at the critical force, or a branch cannot be found where it begins
            there. At later crossings only those that are found are followed.
    """
    positive_number("largest_step", largest_step, "rad")
    critical = critical_point(ForcePath.of(model, q_motors, direction, frame=frame, gravity=gravity), gravity, max_force)
    path = critical.path
    most = BEYOND * path.force if max_force is None else float(max_force)
    with one_blas_thread(model.n_springs):
        origin = path.point(critical.origin, 0.0)
        followed = path.follow([origin], path.direction(origin), most, largest_step)
        count = max([1, *(crossing.modes for crossing in followed.crossings[:1])])
        modes = _modes(path, count) if critical.crosses else np.zeros((0, model.n_springs))
        found = [_branch(FUNDAMENTAL, path, modes, followed)]
        if critical.crosses:
            found += _leaving_branches(found, found[0], path, modes, most, largest_step)
        for branch in found:  # those that leave it are added at the end
            for crossing, count in _crossings(branch, critical):
                try:
                    found += _leaving_branches(found, branch, crossing, _modes(crossing, count), most, largest_step)
                except NeutralEquilibrium:
                    continue  # the crossing is named
        return tuple(_result(branch) for branch in found)


class _Branch(NamedTuple):
    """A branch as it is found."""

    label: str
    path: ForcePath
    """Its reference point is where the branch begins; the critical point of the fundamental path."""
    modes: FloatArray
    """Buckling modes there, shape (0 to 2, n_springs)."""
    followed: FollowedPath
    crossings: list[PathPoint]
    """The last point before each of its crossings."""


def _branch(label: str, path: ForcePath, modes: FloatArray, followed: FollowedPath) -> _Branch:
    crossings = [path.before_change(crossing.before, crossing.after, -ZERO_EIGENVALUE) for crossing in followed.crossings]
    return _Branch(label, path, modes, followed, crossings)


def _modes(path: ForcePath, count: int) -> FloatArray:
    """Buckling modes at the reference point, orthonormal: `count`, or all that are neutral, shape (1 or 2, n_springs).

    Raises:
        NeutralEquilibrium: If there are more than two.
    """
    stiffness = path.model.stiffness
    values, vectors = np.linalg.eigh(scaled(path.point(path.springs, path.force).state.tangent, stiffness))
    order = np.argsort(np.abs(values))[: max(count, int((np.abs(values) <= ZERO_EIGENVALUE).sum()))]
    if len(order) > 2:
        raise NeutralEquilibrium(f"{len(order)} modes buckle at {path.force:.6g} N; branches are sought where one or two do")
    return np.asarray(np.linalg.qr(vectors[:, order] / np.sqrt(stiffness)[:, None])[0].T)


def _crossings(branch: _Branch, critical: CriticalPoint) -> Iterator[tuple[ForcePath, int]]:
    """Paths with their reference point where others cross a branch, beyond the critical point, and the number of modes."""
    if branch.label == RING:
        return
    known = int(branch.label == FUNDAMENTAL and critical.crosses)
    for last, crossing in list(zip(branch.crossings, branch.followed.crossings, strict=True))[known:]:
        if np.abs(branch.path.eigenvalues(last)).min() <= 2.0 * ZERO_EIGENVALUE:  # else a link comes onto its plateau
            yield replace(branch.path, springs=last.springs, force=last.force), crossing.modes


def _leaving_branches(
    known: list[_Branch], parent: _Branch, path: ForcePath, modes: FloatArray, largest_force: float, largest_step: float
) -> list[_Branch]:
    """The branches, not known yet, that leave a path at its reference point."""
    here = path.point(path.springs, path.force)
    new: list[_Branch] = []
    for name, there in sorted(_leaving(path, modes), key=lambda one: one[0]):
        if any(branch.path.passes(branch.followed.points, there) for branch in known + new):
            continue
        name = name if parent.label == FUNDAMENTAL else f"{parent.label} > {name}"
        namesakes = sum(branch.label.partition(" (")[0] == name for branch in known + new)
        label = f"{name} ({namesakes + 1})" if namesakes else name
        new.append(_branch(label, path, modes, path.follow([here, there], path.place(there), largest_force, largest_step)))
    return new


def _leaving(path: ForcePath, modes: FloatArray) -> list[tuple[str, PathPoint]]:
    """The first point of each branch that leaves the critical point, with its label."""
    if len(modes) < 2:
        ways = [sign * mode for mode in modes for sign in (-1.0, 1.0)]
        points = [(way, _at_distance(path, way)) for way in ways]
        return _all_found(path, len(ways), [(_name(path.model, way), point) for way, point in points if point is not None])

    def at(angle: float) -> tuple[FloatArray, PathPoint | None]:
        along = np.cos(angle) * modes[0] + np.sin(angle) * modes[1]
        return along, _at_distance(path, along, np.cos(angle) * modes[1] - np.sin(angle) * modes[0])

    def across(angle: float) -> float:
        point = at(angle)[1]
        return math.nan if point is None else point.across

    between = 2.0 * np.pi / _DIRECTIONS
    around = [(angle, *at(angle)) for angle in (between * (np.arange(_DIRECTIONS) + 0.5)).tolist()]
    known = [(angle, along, point) for angle, along, point in around if point is not None]
    _all_found(path, len(around), known)
    crossings = (
        at(_zero(across, low, low + (high - low) % (2.0 * np.pi)))
        for (low, _, one), (high, _, other) in zip(known, [*known[1:], *known[:1]], strict=True)
        if one.across * other.across < 0.0 and (high - low) % (2.0 * np.pi) < 1.5 * between
    )
    torques = [np.linalg.norm(path.model.stiffness * along) * _distance(path.model, along) for _, along, _ in known]
    if all(abs(point.across) <= _ROUND * torque for (_, _, point), torque in zip(known, torques, strict=True)):
        # Nearly round: a point without torque across.
        balanced = (point for _, _, point in known if point.across == 0.0)
        found = next(balanced, None) or next((point for _, point in crossings if point is not None), None)
        return [(RING, known[0][2] if found is None else found)]
    return _all_found(path, 4, [(_name(path.model, along), point) for along, point in crossings if point is not None])


def _all_found(path: ForcePath, least: int, found: list[Found]) -> list[Found]:
    """Check the number of branches: two at a crossing, at least four in a plane of modes.

    Raises:
        NeutralEquilibrium: If there are fewer.
    """
    if len(found) < least:
        raise NeutralEquilibrium(f"not all branches that leave the path at {path.force:.6g} N could be found")
    return found


def _distance(model: SoftModel, along: FloatArray, largest: float = _AWAY) -> float:
    """Distance along a unit vector at which branches are sought: where every link is linear."""
    stiffness = model.stiffness
    linear = [(group.linear_up_to, float(stiffness[group.springs[0]])) for group in model.spring_groups]
    knees = [moment / own for moment, own in linear if moment is not None]
    return min([largest, *(0.5 * knee for knee in knees)]) / float(np.abs(along).max())


def _at_distance(path: ForcePath, along: FloatArray, across: FloatArray | None = None) -> PathPoint | None:
    """The equilibrium at a distance from the critical point, with a torque along `across` if given."""
    guides = np.zeros((0, len(along))) if across is None else across[None]
    rows = np.concatenate([along[None], guides])
    aims = np.zeros(len(rows))
    aims[0] = _distance(path.model, along, _NEAR if across is None else _AWAY)
    return path.newton(np.append(aims[0] * along, 0.0), np.column_stack([rows, np.zeros(len(rows))]), aims, guides)


def _result(branch: _Branch) -> EquilibriumBranch:
    path, points = branch.path, branch.followed.points
    equilibria = tuple(
        equilibrium_from_state(path.model, path.motors, path.load(point.force), point.state, method="newton", iterations=number)
        for number, point in enumerate(points)
    )
    amplitude = np.array([float(np.linalg.norm(branch.modes @ (point.springs - path.springs))) for point in points])
    crossings = np.array([point.force for point in branch.crossings])
    forces, energy = np.array([(point.force, point.state.energy) for point in points]).T
    return EquilibriumBranch(branch.label, equilibria, forces, amplitude, energy, crossings, branch.followed.ended)


def _name(model: SoftModel, along: FloatArray) -> str:
    """The springs that move most along a direction, with their signs."""
    largest = float(np.abs(along).max())
    names = zip(model.spring_joints, along.tolist(), strict=True)
    return " ".join(f"{'+' if value > 0.0 else '-'}{name}" for name, value in names if abs(value) >= _TIE * largest)


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Bisect a sign change."""
    sign = function(low) > 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if (function(middle) > 0.0) == sign else (low, middle)
    return 0.5 * (low + high)
