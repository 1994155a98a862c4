"""Independent verdicts on stability: tangent stiffness and mass matrix by central differences of plain statics."""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray
from studies.soak.plain_statics import Case, PlainStatics

_STEP = 1e-5  # of central differences, [rad or m]; leaves 1e-10 of the load

CLOSE = 1e-3
"""Distance of two eigenvalues, relative to their size, at which differences may change real ones to complex ones."""


def tangent(statics: PlainStatics, case: Case, springs: FloatArray) -> FloatArray:
    """Tangent stiffness of one case, a batch of one, at elastic coordinates, shape (n,); shape (n, n)."""
    count = len(springs)
    residual = statics.balance(case.repeated(2 * count), _around(springs)).residual
    return np.asarray((residual[:count] - residual[count:]).T / (2.0 * _STEP))


def mass_matrix(statics: PlainStatics, case: Case, springs: FloatArray) -> FloatArray:
    """Mass matrix of one case, a batch of one, from the motion of every body; shapes as in `tangent`."""
    count, motors = len(springs), np.repeat(case.motors, 2 * len(springs), axis=0)
    turns, centres = statics.bodies(motors, _around(springs))
    moved = (centres[:count] - centres[count:]) / (2.0 * _STEP)
    spin = np.einsum("nbij,nbkj->nbik", turns[:count], turns[count:]) / (2.0 * _STEP)
    turned = 0.5 * np.stack([spin[..., k, j] - spin[..., j, k] for j, k in ((1, 2), (2, 0), (0, 1))], axis=-1)
    here, result = statics.bodies(case.motors, springs[None])[0][0], np.zeros((count, count))
    for number, (mass, inertia) in enumerate(statics.inertias):
        about = here[number] @ inertia @ here[number].T
        result += mass * moved[:, number] @ moved[:, number].T + turned[:, number] @ about @ turned[:, number].T
    return result


def least_eigenvalue(statics: PlainStatics, case: Case, springs: FloatArray) -> tuple[float, float]:
    """Least eigenvalue of the tangent stiffness of a case without moments, relative to the springs, and how exact it is."""
    scaled, error = _scaled(tangent(statics, case, springs), statics, case, springs)
    return float(np.linalg.eigvals(scaled).real.min()), error


def growth(statics: PlainStatics, case: Case, springs: FloatArray) -> float | None:
    """Largest growth rate of a vibration over its own frequency: 0 if all are stable, 1 if one diverges.

    None where differences cannot tell: an eigenvalue is nearly zero, or two are closer than `CLOSE`.
    """
    stiffness = tangent(statics, case, springs)
    scaled, error = _scaled(stiffness, statics, case, springs)
    values = np.linalg.eigvals(np.linalg.solve(mass_matrix(statics, case, springs), stiffness))
    rate = float((np.sqrt(-values.astype(complex)).real / np.sqrt(np.abs(values))).max())
    gaps = np.abs(values[:, None] - values) + np.diag(np.full(len(values), np.inf))
    close = (gaps <= CLOSE * np.abs(values)).any()
    return None if close or np.abs(np.linalg.eigvals(scaled)).min() <= error else rate


def _around(springs: FloatArray) -> FloatArray:
    steps = _STEP * np.eye(len(springs))
    return np.concatenate([springs + steps, springs - steps])


def _scaled(stiffness: FloatArray, statics: PlainStatics, case: Case, springs: FloatArray) -> tuple[FloatArray, float]:
    """Tangent stiffness relative to the springs, and how exact it is."""
    softness = 1.0 / np.sqrt(statics.stiffness)
    size = float(statics.balance(case, springs[None]).size[0])
    error = 1e-9 * (1.0 + size / float(statics.stiffness.min())) * len(springs)
    return softness[:, None] * stiffness * softness, error
