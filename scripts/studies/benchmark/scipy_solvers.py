"""Equilibria by SciPy's general solvers over Pinocchio, with the exact derivative. Needs SciPy (extra `helix`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import MissingDependency
from studies.benchmark.pinocchio_solvers import TOLERANCE, PinocchioArm, Solver, residual_and_slope


def solvers() -> dict[str, Solver]:
    """The solvers by name; arguments and answer of each are those of `pinocchio_solvers.fixed_point`, weightless.

    `root` is Powell's hybrid method (MINPACK), `least_squares` the trust-region method, both from relaxed springs.

    Raises:
        MissingDependency: If SciPy is not installed.
    """
    try:
        from scipy import optimize
    except ImportError as error:
        raise MissingDependency("scipy", "helix") from error

    def root(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
        q = arm.start(q_motors)
        found = optimize.root(_function(arm, q, force), q[arm.springs], jac=True, options={"xtol": TOLERANCE})
        q[arm.springs] = found.x
        return q

    def least_squares(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
        q = arm.start(q_motors)
        function = _function(arm, q, force)
        tight = dict.fromkeys(("ftol", "xtol", "gtol"), 1e-12)
        found = optimize.least_squares(lambda y: function(y)[0], q[arm.springs], lambda y: function(y)[1], **tight)
        q[arm.springs] = found.x
        return q

    return {"root": root, "least_squares": least_squares}


def _function(arm: PinocchioArm, q: FloatArray, force: FloatArray) -> Callable[[FloatArray], tuple[FloatArray, Any]]:
    def function(springs: FloatArray) -> tuple[FloatArray, Any]:
        at = np.array(q)
        at[arm.springs] = springs
        return residual_and_slope(arm, at, force)

    return function
