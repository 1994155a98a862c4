"""Equilibria and load estimates as functions of JAX, with exact derivatives by actuators, loads and parameters.

The functions take and return arrays of float64, and work under `jax.jit`, `jax.vmap`, `jax.grad`, `jax.vjp`, `jax.jvp`,
`jax.jacfwd` and `jax.jacrev`; they run on the CPU. There are no second derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from softrobots.core.errors import MissingDependency
from softrobots.learning.differentiable import Differentiable, Kind

__all__ = ["equilibrium", "load_estimate"]


def equilibrium(
    robot: Any,
    parameters: str | Sequence[str] = (),
    *,
    gravity: Any = None,
    backend: str | None = None,
    threads: int = 1,
    failed: str = "raise",
) -> Callable[..., Any]:
    """Return the equilibrium of a robot as a function of JAX.

    Args:
        robot: The robot: a dataclass of parameters, a `SoftModel`, or what `softrobots.compile` returns.
        parameters: Names of parameters of the robot, as for `softrobots.sensitivity`, and offsets of motors.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        backend: "numba" or "python", as for `softrobots.compile`: short chains of joints, inflatable arms among them, in
            microseconds a case; or "pinocchio": every robot without dry friction, solved from rest as by `solve_equilibrium`,
            in tenths of a millisecond to milliseconds. By default compiled code where it has derivatives. Of what
            `softrobots.compile` returns, results come from its batch solver, at other values of the parameters by a second code
            that is made when they are first asked for, and derivatives are compiled, too.
        threads: Number of threads of compiled code.
        failed: What becomes of rows without a stable equilibrium: "raise" raises an error that names them (JAX wraps it
            in one of its own under its transformations), "nan" makes their results NaN and their gradients zero.

    Returns:
        The function `f(q_motors, force, parameters) -> (q_springs, tip)`. Shapes are (..., n_motors) [rad or m], (..., 3) [N],
        (P,) or (..., P), (..., n_springs) [rad or m] and (..., 3) [m], world axes; leading dimensions are broadcast. Without
        parameters they have their present values. `f.parameters` are their names, `f.values` those values.

    Raises:
        ParameterError: If an argument is invalid, the robot has dry friction, or `backend` has no derivatives of it.
        NameNotFound: If the robot has no such parameter.
        DescriptionError: If the robot cannot be loaded.
        MissingDependency: If JAX is not installed.
    """
    options: dict[str, Any] = dict(gravity=gravity, backend=backend, threads=threads, failed=failed)
    return _function("equilibrium", robot, parameters, options)


def load_estimate(
    robot: Any,
    parameters: str | Sequence[str] = (),
    *,
    gravity: Any = None,
    backend: str | None = None,
    threads: int = 1,
    failed: str = "raise",
) -> Callable[..., Any]:
    """Return the force on the tip that explains the loads on the motors as a function of JAX.

    Args:
        robot: See `equilibrium`; at least three of its actuators feel loads.
        parameters: See `equilibrium`.
        gravity: See `equilibrium`.
        backend: See `equilibrium`.
        threads: See `equilibrium`.
        failed: See `equilibrium`.

    Returns:
        The function `f(q_motors, motor_torques, parameters) -> (q_springs, tip, force)`. With more than three motors the force
        is that of least squares. Shapes as for `equilibrium`, and (..., n_motors) [N m or N] of the loads on the motors.

    Raises:
        ParameterError: If an argument is invalid, the robot has dry friction, or `backend` has no derivatives of it.
        NameNotFound: If the robot has no such parameter.
        DescriptionError: If the robot cannot be loaded.
        MissingDependency: If JAX is not installed.
    """
    options: dict[str, Any] = dict(gravity=gravity, backend=backend, threads=threads, failed=failed)
    return _function("estimate", robot, parameters, options)


def _function(kind: Kind, robot: Any, parameters: str | Sequence[str], options: dict[str, Any]) -> Callable[..., Any]:
    with MissingDependency.of_imports("jax", "jax"):
        from softrobots.jax.operation import Function
    return Function(Differentiable(kind, robot, parameters, **options))
