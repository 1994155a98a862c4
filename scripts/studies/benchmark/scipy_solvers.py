"""Equilibria by SciPy's general solver over Pinocchio, with the exact derivative."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import optimize

from softrobots.core.checks import FloatArray
from studies.benchmark.pinocchio_solvers import TOLERANCE, PinocchioArm, Solver, residual_and_slope


def scipy_root() -> Solver:
    """Return `scipy.optimize.root` (Powell's hybrid method, MINPACK) from relaxed springs, weightless."""

    def solve(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
        q = arm.start(q_motors)

        def residual(springs: FloatArray) -> tuple[FloatArray, Any]:
            trial = np.array(q)
            trial[arm.springs] = springs
            return residual_and_slope(arm, trial, force)

        q[arm.springs] = optimize.root(residual, q[arm.springs], jac=True, options={"xtol": TOLERANCE}).x
        return q

    return solve
