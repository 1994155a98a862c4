r"""Step of the search in contact: the quadratic programme of the energy over linearised gaps.

.. math:: \min_p \tfrac12 p^T H p + r^T p \quad\text{with}\quad g + G p \ge 0

with the Hessian of the Lagrangian :math:`H = K_t - \sum_i \lambda_i\, d^2 g_i/dy^2` (Nocedal and Wright, Numerical
Optimization, 2006, equation 18.11), in coordinates in which the springs have stiffness 1. Its multipliers are the normal
forces.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.contact.quadratic_programme import solve_guessed, solve_programme
from softrobots.statics.elastic_state import norm, positive

_LEAST = 1e-3  # least curvature along which a step is taken, relative to the springs
_PRICE = 1e3  # of penetration in a step that cannot repair all of it, over usual energies in the box


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
    soft: FloatArray,
    limits: tuple[float, float],
    factors: Any,
) -> Step | None:
    """Solve the quadratic programme of a step; where gaps cannot be kept, the deepest penetration shrinks as far as it can.

    Args:
        hessian: Hessian of the Lagrangian, shape (n, n).
        load: Residual without contact forces, shape (n,).
        gaps: Gaps, shape (m,) [m].
        rows: Their gradients, shape (m, n).
        held: Which are taken to be pressed, shape (m,), truth values; the Hessian is made positive beside them.
        soft: One over the square root of the stiffness of the springs, shape (n,).
        limits: Length of a step beyond which its components are limited to that, each by itself; and stiffness that is added
            to shorten it, relative to the springs.
        factors: An `eigenpy.LDLT` of size n.

    Returns:
        The step; None if the solver fails.
    """
    longest, damping = limits
    if damping:
        hessian = hessian + np.diag(damping / (soft * soft))
    guessed = solve_guessed(factors, load, rows, -gaps, held) if positive(factors, hessian) else None
    if guessed is not None and norm(guessed[0]) <= longest:
        return Step(*guessed, damping == 0.0)
    gradients, pull = rows * soft, soft * load
    convex, shift, exact = _convex(soft[:, None] * hessian * soft, gaps, gradients, held, factors)
    found = solve_programme(convex, pull if shift is None else pull + shift, gradients, -gaps)
    if found is not None and shift is not None and shift.any():
        lost = 2.0 * float(found[1].sum()) * max(-float(gaps.min(initial=0.0)), 0.0)
        if not np.array_equal(found[1] > 0.0, held) or float(pull @ found[0]) > lost:  # other contacts are pressed, or uphill
            exact, found = False, solve_programme(convex, pull, gradients, -gaps)
    if found is not None:
        step = soft * found[0]
        if norm(step) <= longest:
            return Step(step, found[1], exact and damping == 0.0)
    found = _within(convex, pull, gradients, gaps, longest / soft)
    return None if found is None or not np.isfinite(found[0]).all() else Step(soft * found[0], found[1], False)


def nearest_step(
    wanted: FloatArray, gaps: FloatArray, rows: FloatArray, soft: FloatArray, closed: Any = None
) -> FloatArray | None:
    """Return the step nearest to one that is wanted, in the measure of the springs, that keeps the linearised gaps.

    Those of `closed`, shape (m,), truth values, become zero; None if no step does that.
    """
    found = solve_programme(np.eye(len(soft)), -wanted / soft, rows * soft, -gaps, closed)
    return None if found is None else np.asarray(soft * found[0])


def repairing_step(gaps: FloatArray, rows: FloatArray, soft: FloatArray, longest: float) -> FloatArray | None:
    """Return the shortest step, in the measure of the springs, that opens linearised penetrations as far as can be.

    No component is larger than `longest`.
    """
    found = _within(np.eye(len(soft)), np.zeros(len(soft)), rows * soft, gaps, longest / soft)
    return None if found is None else np.asarray(soft * found[0])


def _within(
    hessian: FloatArray, pull: FloatArray, gradients: FloatArray, gaps: FloatArray, box: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """The same within a box, with one more unknown where gaps cannot be kept: the share of the penetration that is left.

    Its price is far above any energy in the box.
    """
    found = solve_programme(hessian, pull, gradients, -gaps, box=box)
    if found is not None or not len(gaps) or gaps.min() >= 0.0:
        return found
    n, usual = len(pull), float(box @ box + abs(pull) @ box)
    wider = np.diag(np.full(n + 1, usual))
    wider[:n, :n] = hessian
    constraints = np.column_stack([gradients, np.full(len(gaps), -gaps.min())])
    found = solve_programme(wider, np.append(pull, _PRICE * usual), constraints, -gaps, box=np.append(box, 1.0))
    return None if found is None else (found[0][:n], found[1])


def _convex(
    hessian: FloatArray, gaps: FloatArray, gradients: FloatArray, held: Any, factors: Any
) -> tuple[FloatArray, FloatArray | None, bool]:
    """Make the Hessian positive.

    Where it is positive on the null space of the held gradients, curvature is added across them only; elsewhere eigenvalues on
    the null space are made positive, too.

    Returns:
        The Hessian; what to add to the linear term so that a step that closes the held gaps is still Newton's, or None;
        and whether the null space was left as it is.
    """
    if positive(factors, hessian):
        return hessian, None, True
    shift = None
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
