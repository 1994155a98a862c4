r"""Stability of an equilibrium: whether a small disturbance stays small.

About an equilibrium the robot vibrates by :math:`M \ddot y + K_t y = 0`, with the mass matrix `M` of the elastic coordinates at
held motors, and the tangent stiffness `K_t`. Motions :math:`e^{s t}` have :math:`s^2 = -\lambda` for the eigenvalues
:math:`\lambda` of :math:`M^{-1} K_t`, which no change of units or coordinates changes. Damping is left out.

A load with a potential has a symmetric `K_t`: all eigenvalues are real, and positive just where `K_t` is positive definite,
whatever the masses are. A moment that is fixed in the world has none, and complex eigenvalues may come of it (Bolotin,
Nonconservative Problems of the Theory of Elastic Stability, 1963, chapter 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from eigenpy import LDLT

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.summary import Part, Summarised, facts, field_facts
from softrobots.model.coordinates import Point
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.certificate import softest_motion
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, largest_residual, positive
from softrobots.statics.loads import Load

STABLE = "stable"
"""All eigenvalues are real and positive: a disturbance stays small."""

NEUTRAL = "neutral"
"""One is zero within rounding, and the others are positive: the robot can be moved aside without a force. Also where two are so
close that rounding decides whether they are real."""

DIVERGENT = "divergent"
"""One is real and negative: the robot moves away, ever faster."""

FLUTTER = "flutter"
"""Some are complex, none is real and negative: vibrations grow, unless damping takes more than the moment feeds."""

UNKNOWN = "unknown"
"""The load has a moment, and the description of the robot no masses; or a section is out of range."""

_ROUNDING = 1e-15  # of an eigenvalue, relative to the largest; measured: 1e-16 for chains of 160 coordinates
_LIGHT = 1e-13  # least eigenvalue of a mass matrix over its largest, in coordinates of equal stiffness; 2e-8 for those chains


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Summarised):
    """What becomes of a small disturbance of an equilibrium at held motors, without damping."""

    kind: str
    """`STABLE`, `NEUTRAL`, `DIVERGENT`, `FLUTTER` or `UNKNOWN`."""
    eigenvalues: Any
    r"""Eigenvalues of :math:`M^{-1} K_t`, complex, by real part, shape (n_springs,) [1/s^2].

    Those of a stable equilibrium are its squared natural frequencies. Empty if the description has no masses.
    """

    def summary_parts(self) -> list[Part]:
        """Return the kind, and how fast a disturbance grows."""
        return [facts(field_facts(self, "kind", "growth_rate"))]

    @property
    def growth_rate(self) -> float:
        """Rate at which the fastest growing motion grows, without damping [1/s]; 0 if none grows exponentially."""
        if self.kind in (STABLE, NEUTRAL):
            return 0.0
        return float(np.sqrt(-self.eigenvalues).real.max(initial=0.0))


def is_stable(model: SoftModel, load: Load, state: ElasticState, tolerance: float = TOLERANCE) -> bool:
    """Whether a state in equilibrium is stable, see `stability`.

    Args:
        model: The robot.
        load: The load; for one with a potential the masses are not needed.
        state: The state; one whose tangent stiffness is not finite is not stable.
        tolerance: Relative residual that counts as none; a contact force that loads the springs by less holds nothing.
    """
    if state.touch is not None:
        allowed = largest_residual(model, state.scale, tolerance)
        return softest_motion(state.tangent, model.stiffness, state.touch, model.reach, allowed)[0] > POSITIVE
    if load.conservative:
        return is_positive(model, state.tangent)
    return stability(model, state.point, state.q, state.tangent).kind == STABLE


def is_positive(model: SoftModel, tangent: FloatArray, factors: Any = None, *, times: float = 1.0) -> bool:
    """Whether every eigenvalue of a symmetric tangent stiffness is above `times POSITIVE` of the springs' own stiffness.

    Eigenvalues are meant in coordinates scaled by the springs' own stiffness, independent of units and of the ratio of stiff to
    soft springs. Positive pivots are the certificate. The factorisation `L D L^T` is Eigen's: for four rows it takes a ninth of
    the time of NumPy's Cholesky, and one thread. Eigen takes a NaN for positive.
    """
    factors = LDLT(len(tangent)) if factors is None else factors
    return math.isfinite(np.vdot(tangent, tangent)) and positive(factors, tangent - times * model.springs.least_tangent)


def stability(
    model: SoftModel, point: Point, q: FloatArray, tangent: FloatArray, motions: FloatArray | None = None
) -> Stability:
    """Return the stability of an equilibrium.

    Args:
        model: The robot.
        point: The robot at its actuator and elastic coordinates.
        q: Pinocchio's configuration there, shape (nq,).
        tangent: Tangent stiffness there, shape (n_springs, n_springs).
        motions: Motions of the springs that contacts leave, shape (n_springs, n); all by default.
    """
    if not (point.valid and math.isfinite(np.vdot(tangent, tangent))):
        return Stability(UNKNOWN, read_only(np.zeros(0, dtype=np.complex128)))
    with one_blas_thread(len(tangent)):
        matrices = tangent, mass_matrix(model, point, q), np.diag(model.stiffness)
        return stability_of(*(one if motions is None else motions.T @ one @ motions for one in matrices))


def mass_matrix(model: SoftModel, point: Point, q: FloatArray) -> FloatArray:
    r"""Mass matrix of the elastic coordinates at held actuators, :math:`Q^T M_q Q` with :math:`Q = dq/dy`, shape (n, n)."""
    rows = point.columns(model.data.mass_matrix(q))[1]
    return point.columns(np.ascontiguousarray(rows.T))[1]


def stability_of(tangent: FloatArray, mass: FloatArray, springs: FloatArray) -> Stability:
    """Return the stability of linear vibrations; see the module.

    Whether an eigenvalue is zero is judged in coordinates in which the springs have stiffness 1, with `POSITIVE` for rounding:
    the same in all units and coordinates.

    Args:
        tangent: Tangent stiffness, shape (n, n).
        mass: Mass matrix, symmetric, shape (n, n).
        springs: Stiffness of the springs at rest, symmetric and positive definite, shape (n, n).
    """
    unit = np.linalg.inv(np.linalg.cholesky(springs))
    relative, inertia = unit @ tangent @ unit.T, unit @ mass @ unit.T
    masses, modes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    symmetric = np.linalg.norm(relative - relative.T) <= POSITIVE
    eigenvalues: Callable[[Any], Any] = np.linalg.eigvalsh if symmetric else np.linalg.eigvals
    softest = eigenvalues(relative)
    values = np.zeros(0)
    if np.all(masses > _LIGHT * masses.max(initial=0.0)):
        values = eigenvalues((modes.T @ relative @ modes) / np.sqrt(masses[:, None] * masses))
    kind = UNKNOWN if len(values) < len(softest) and not symmetric else _kind(softest, softest if symmetric else values)
    ordered: Any = np.sort_complex(values)
    return Stability(kind, read_only(ordered))


def _kind(relative: Any, values: Any) -> str:
    """The kind of eigenvalues `values`, of which as many are zero as of those relative to the springs."""
    sizes = np.abs(values)
    zeros = int((np.abs(relative) <= POSITIVE).sum())
    rest = values[np.argsort(sizes)[zeros:]]
    rounding = POSITIVE * np.abs(rest) + _ROUNDING * sizes.max(initial=0.0)
    oscillates = np.abs(rest.imag) > rounding
    if (~oscillates & (rest.real < -rounding)).any():
        return DIVERGENT
    if oscillates.any():
        return FLUTTER
    return NEUTRAL if zeros or (rest.imag != 0.0).any() or (rest.real <= rounding).any() else STABLE
