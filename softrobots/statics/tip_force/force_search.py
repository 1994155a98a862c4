"""Levenberg-Marquardt search for the tip force in its observable directions; independent of the solver."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.statics.elastic_state import MOMENT_FLOOR, TOLERANCE

OBSERVABLE = 1e-3
"""A direction counts as unobservable when its singular value is below this share of the reach."""

HIDDEN = 0.05
"""Share of the motor torques that may stay unexplained where a direction of the force is unobservable."""

FIRST_DAMPING = 0.03
"""Damping of the first step, relative to the reach: keeps the force small where it is barely observable."""

LAST_DAMPING = 1e-7
"""Least damping above none."""

State = TypeVar("State")
"""A robot in equilibrium, as the solver represents it."""


ANY = read_only(np.eye(3))
"""The directions of a force that may have any."""


class Directions(NamedTuple):
    """Singular value decomposition of the torque slope `d tau_m / d f`, shape (n_motors, k), over k directions of the force."""

    left: FloatArray
    """Directions of the motor torques, in columns, shape (n_motors, n_motors)."""
    values: FloatArray
    """Singular values, descending, shape (at most k,) [m]."""
    right: FloatArray
    """Directions of the force, in rows, shape (k, 3)."""
    observable: Any
    """Which directions are observable by their singular value, truth values."""

    @classmethod
    def of(cls, slope: FloatArray, reach: float, span: FloatArray = ANY) -> Directions:
        """Decompose the torque slope of a robot, shape (n_motors, 3), with a given reach [m] over orthonormal directions."""
        left, values, right = np.linalg.svd(slope @ span.T)
        return cls(left, values, right @ span, values > OBSERVABLE * reach)


class Measurement(Protocol[State]):
    """Measured motor torques, and a robot on which forces are tried."""

    def equilibrium(self, force: FloatArray, near: State) -> State | None:
        """Solve for the equilibrium under a force, from a nearby state; None if it does not converge."""

    def unexplained(self, state: State) -> FloatArray:
        """Return measured torques minus those of a state, shape (n_motors,)."""

    def directions(self, state: State) -> Directions:
        """Decompose the derivative of the torques with respect to the force."""


def torque_tolerance(torques: FloatArray) -> float:
    """Return the norm of motor torques that may stay unexplained [N m]."""
    return TOLERANCE * max(float(np.linalg.norm(torques)), MOMENT_FLOOR)


def search_force(
    problem: Measurement[State],
    state: State,
    most: int,
    *,
    reach: float,
    tolerance: float,
    start: FloatArray | None = None,
) -> tuple[FloatArray, State, int]:
    """Levenberg-Marquardt on the torque equation, in the observable directions of each step.

    Args:
        problem: The measurement.
        state: The robot where the search begins.
        most: Most steps.
        reach: Scale of lengths [m].
        tolerance: Largest part of the torques that may stay unexplained [N m].
        start: Force where the search begins, shape (3,) [N]; none by default.

    Returns:
        The force, shape (3,) [N], the robot under it, and the number of steps.
    """
    force = np.zeros(3) if start is None else start
    damping, spent = FIRST_DAMPING * reach, 0
    while spent < most:
        left, values, right, keep = problem.directions(state)
        missing = left[:, : len(values)].T @ problem.unexplained(state)
        size = float(np.linalg.norm(missing[keep]))
        if size <= tolerance:
            break
        step = right[: len(values)][keep].T @ (missing[keep] * values[keep] / (values[keep] ** 2 + damping**2))
        trial = problem.equilibrium(force + step, state)
        spent += 1
        if trial is not None:
            left_over = left[:, : len(values)].T @ problem.unexplained(trial)
            if float(np.linalg.norm(left_over[keep])) < size:
                force, state = force + step, trial
                damping = 0.1 * damping if damping > LAST_DAMPING * reach else 0.0
                continue
        damping = max(10.0 * damping, 10.0 * LAST_DAMPING * reach)
    return force, state, spent


def sphere(count: int) -> FloatArray:
    """Return unit directions spread evenly over a sphere (Fibonacci's lattice), shape (count, 3)."""
    place = np.arange(count) + 0.5
    height, turn = 1.0 - 2.0 * place / count, np.pi * (1.0 + math.sqrt(5.0)) * place
    width = np.sqrt(1.0 - height**2)
    return np.stack([width * np.cos(turn), width * np.sin(turn), height], axis=1)
