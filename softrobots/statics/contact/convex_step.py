r"""Step of the search in contact: the quadratic programme of the energy over linearised gaps.

.. math:: \min_p \tfrac12 p^T H p + r^T p \quad\text{with}\quad g + G p \ge 0

with the Hessian of the Lagrangian :math:`H = K_t - \sum_i \lambda_i\, d^2 g_i/dy^2` (Nocedal and Wright, Numerical
Optimization, 2006, equation 18.11), in coordinates in which the springs have stiffness 1. Its multipliers are the normal
forces. daqp solves it (Arnstrom, Bemporad, Axehill: A dual active-set solver for embedded quadratic programming, 2022).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.elastic_state import norm, positive, scaled

_LEAST = 1e-3  # least curvature along which a step is taken, relative to the springs
_TIGHT = {"primal_tol": 1e-13, "dual_tol": 1e-13}
_FREE = 1e30  # bound that does not bind
_SOLVED, _EQUALITY = 1, 5  # exit flag and kind of constraint of daqp


class Step(NamedTuple):
    """A step of the elastic coordinates, and the forces that it needs."""

    step: FloatArray
    """Change of the elastic coordinates, shape (n_springs,)."""
    forces: FloatArray
    """Normal forces of the candidates, shape (m,) [N]."""
    exact: bool
    """Whether it is Newton's step of the equations of contact: no curvature was changed, and the gaps can be kept."""


def contact_step(
    hessian: FloatArray,
    load: FloatArray,
    gaps: FloatArray,
    rows: FloatArray,
    held: Any,
    stiffness: FloatArray,
    damping: float,
    factors: Any,
) -> Step | None:
    """Solve the quadratic programme of a step; where gaps cannot be kept, the deepest penetration shrinks as far as it can.

    Args:
        hessian: Hessian of the Lagrangian, shape (n, n).
        load: Residual without contact forces, shape (n,).
        gaps: Gaps, shape (m,) [m].
        rows: Their gradients, shape (m, n).
        held: Which are taken to be pressed, shape (m,), truth values; the Hessian is made positive beside them.
        stiffness: Stiffness of the springs, shape (n,).
        damping: Stiffness that is added to shorten the step, relative to the springs.
        factors: An `eigenpy.LDLT` of size n.

    Returns:
        The step; None if the solver fails.
    """
    soft = 1.0 / np.sqrt(stiffness)
    gradients = rows * soft
    pull = soft * load
    relative = scaled(hessian, stiffness)
    if damping:
        relative = relative + damping * np.eye(len(soft))
    convex, shift, exact = _convex(relative, gaps, gradients, held, factors)
    found = _solve(convex, pull + shift, gradients, -gaps)
    if found is not None and shift.any() and not np.array_equal(found[1] > 0.0, held):  # other contacts are pressed
        exact, found = False, _solve(convex, pull, gradients, -gaps)
    if found is None:
        exact, found = False, _least_penetration(convex, pull, gradients, gaps)
    if found is None or not np.isfinite(found[0]).all():
        return None
    return Step(soft * found[0], found[1], exact and damping == 0.0)


def nearest_step(
    wanted: FloatArray, gaps: FloatArray, rows: FloatArray, stiffness: FloatArray, closed: Any = None
) -> FloatArray | None:
    """Return the step nearest to one that is wanted, in the measure of the springs, that keeps the linearised gaps.

    Those of `closed`, shape (m,), truth values, become zero; None if no step does that.
    """
    soft = 1.0 / np.sqrt(stiffness)
    found = _solve(np.eye(len(soft)), -wanted / soft, rows * soft, -gaps, closed)
    return None if found is None else np.asarray(soft * found[0])


def _solve(
    hessian: FloatArray, pull: FloatArray, gradients: FloatArray, bounds: FloatArray, equal: Any = None
) -> tuple[FloatArray, ...] | None:
    """Minimise `s^T H s / 2 + f^T s` with `A s >= b`, and `A s = b` in some rows; the solution and its multipliers, or None."""
    import daqp

    m = len(bounds)
    if m == 0:
        return np.asarray(np.linalg.solve(hessian, -pull)), np.zeros(0)
    above, sense = np.full(m, _FREE), np.zeros(m, dtype=np.int32)
    if equal is not None:
        above[equal], sense[equal] = bounds[equal], _EQUALITY
    matrices = (np.ascontiguousarray(one) for one in (hessian, pull, gradients))
    solution, _, flag, info = daqp.solve(*matrices, above, bounds, sense, **_TIGHT)
    return (np.array(solution), np.maximum(-np.array(info["lam"]), 0.0)) if flag == _SOLVED else None


def _least_penetration(
    hessian: FloatArray, pull: FloatArray, gradients: FloatArray, gaps: FloatArray
) -> tuple[FloatArray, ...] | None:
    """The same with one more unknown, the penetration that is left, at a price above all forces."""
    m, n = gradients.shape
    depth = max(-float(gaps.min()), 1e-300)
    wider = np.zeros((n + 1, n + 1))
    wider[:n, :n], wider[n, n] = hessian, 1.0
    price = 1e3 * (norm(pull) * depth + 1.0)
    constraints = np.zeros((m + 1, n + 1))
    constraints[:m, :n], constraints[:m, n], constraints[m, n] = (
        gradients,
        depth,
        1.0,
    )  # the last unknown is a share of the depth
    found = _solve(wider, np.append(pull, price), constraints, np.append(-gaps, 0.0))
    return None if found is None else (found[0][:n], found[1][:m])


def _convex(
    hessian: FloatArray, gaps: FloatArray, gradients: FloatArray, held: Any, factors: Any
) -> tuple[FloatArray, FloatArray, bool]:
    """Make the Hessian positive.

    Where it is positive on the null space of the held gradients, curvature is added across them only; elsewhere eigenvalues on
    the null space are made positive, too.

    Returns:
        The Hessian; what to add to the linear term so that a step that closes the held gaps is still Newton's; and whether the
        null space was left as it is.
    """
    shift = np.zeros(len(hessian))
    if positive(factors, hessian):
        return hessian, shift, True
    _, sizes, right = np.linalg.svd(gradients[held])
    rank = int(np.sum(sizes > 1e-9 * sizes.max(initial=0.0)))
    across, along = right[:rank].T, right[rank:].T
    values, vectors = np.linalg.eigh(along.T @ hessian @ along)
    exact = bool(values.min(initial=np.inf) > 0.0)
    curved = values if exact else np.maximum(np.abs(values), _LEAST)
    along = along @ vectors
    mixed = along.T @ hessian @ across
    convex = hessian + (along * (curved - values)) @ along.T
    if rank:
        left = across.T @ hessian @ across - mixed.T @ (mixed / curved[:, None])
        least = float(np.linalg.eigvalsh(0.5 * (left + left.T))[0])
        added = max(0.0, 1.0 - least)
        closes = across.T @ np.linalg.lstsq(gradients[held], -gaps[held], rcond=1e-9)[0]
        convex = convex + added * across @ across.T
        shift = -added * across @ closes
    return convex, shift, exact
