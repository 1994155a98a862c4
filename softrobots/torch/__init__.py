"""Equilibria and load estimates as functions of PyTorch, with exact derivatives by actuators, loads and parameters.

The functions take and return tensors of float64 on the CPU, and work with `backward`, `torch.autograd.grad`, `torch.func.vjp`,
`torch.func.jvp`, `torch.func.grad` and `torch.func.vmap`. There are no second derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softrobots.core.errors import MissingDependency, ParameterError
from softrobots.learning.differentiable import Differentiable

try:
    import torch
except ImportError as error:
    raise MissingDependency("torch", "torch") from error

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
    """Return the equilibrium of a robot as a function of PyTorch.

    Args:
        robot: The robot: a dataclass of parameters, a `SoftModel`, or what `softrobots.compile` returns.
        parameters: Names of parameters of the robot, as for `softrobots.sensitivity`, and offsets of motors.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        backend: "numba" or "python", as for `softrobots.compile`.
        threads: Number of threads.
        failed: What becomes of rows without a stable equilibrium: "raise" raises an error that names them, "nan" makes their
            results NaN and their gradients zero.

    Returns:
        The function `f(q_motors, force, parameters) -> (q_springs, tip)`. Shapes are (..., n_motors) [rad or m], (..., 3) [N],
        (P,) or (..., P), (..., n_springs) [rad or m] and (..., 3) [m], world axes; leading dimensions are broadcast. Without
        parameters they have their present values. `f.parameters` are their names, `f.values` those values. Every other row of
        values of the parameters loads the robot once more.

    Raises:
        ParameterError: If an argument is invalid, or derivatives of this robot are not compiled.
        NameNotFound: If the robot has no such parameter.
        DescriptionError: If the robot cannot be loaded.
    """
    options: dict[str, Any] = dict(gravity=gravity, backend=backend, threads=threads, failed=failed)
    return _Function(Differentiable("equilibrium", robot, parameters, **options))


def load_estimate(
    robot: Any,
    parameters: str | Sequence[str] = (),
    *,
    gravity: Any = None,
    backend: str | None = None,
    threads: int = 1,
    failed: str = "raise",
) -> Callable[..., Any]:
    """Return the force on the tip that explains the loads on the motors as a function of PyTorch.

    Args:
        robot: See `equilibrium`; with three motor joints at least.
        parameters: See `equilibrium`.
        gravity: See `equilibrium`.
        backend: See `equilibrium`.
        threads: See `equilibrium`.
        failed: See `equilibrium`.

    Returns:
        The function `f(q_motors, motor_torques, parameters) -> (q_springs, tip, force)`. With more than three motors the force
        is that of least squares. Shapes as for `equilibrium`, and (..., n_motors) [N m or N] of the loads on the motors.

    Raises:
        ParameterError: If an argument is invalid, or derivatives of this robot are not compiled.
        NameNotFound: If the robot has no such parameter.
        DescriptionError: If the robot cannot be loaded.
    """
    options: dict[str, Any] = dict(gravity=gravity, backend=backend, threads=threads, failed=failed)
    return _Function(Differentiable("estimate", robot, parameters, **options))


class _Function:
    """A solver as a function of PyTorch."""

    def __init__(self, solver: Differentiable) -> None:
        self._solver = solver
        self.parameters, self.values = solver.names, torch.tensor(solver.present)

    def __call__(self, q_motors: Any, load: Any, parameters: Any = None) -> tuple[Any, ...]:
        given = [q_motors, load, self.values if parameters is None else parameters]
        for name, tensor, size in zip(("q_motors", "load", "parameters"), given, self._solver.inputs, strict=True):
            if not isinstance(tensor, torch.Tensor) or tensor.dtype != torch.float64 or tensor.device.type != "cpu":
                raise ParameterError(name, tensor, "a tensor of torch.float64 on the CPU")
            if tensor.ndim == 0 or tensor.shape[-1] != size:
                raise ParameterError(name, tuple(tensor.shape), f"a tensor of shape (..., {size})")
        return tuple(_Solve.apply(self._solver, *given))


class _Solve(torch.autograd.Function):
    """The operation: inputs are motors, load and parameters, shapes (..., k)."""

    @staticmethod
    def forward(solver: Differentiable, *inputs: Any) -> tuple[Any, ...]:
        return tuple(torch.from_numpy(one) for one in solver.solve(*(one.detach().numpy() for one in inputs)))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        ctx.solver = inputs[0]
        ctx.save_for_backward(*inputs[1:], *output)
        ctx.save_for_forward(*inputs[1:], *output)

    @staticmethod
    def backward(ctx: Any, *weights: Any) -> tuple[Any, ...]:
        inputs = ctx.saved_tensors[:3]
        needed = ctx.needs_input_grad[1:]
        shapes = tuple(tuple(one.shape[:-1]) if need else None for one, need in zip(inputs, needed, strict=True))
        found = iter(_Respond.apply(ctx.solver, "pull", shapes, *ctx.saved_tensors, *weights))
        return (None, *(next(found) if need else None for need in needed))

    @staticmethod
    def jvp(ctx: Any, _: Any, *rates: Any) -> tuple[Any, ...]:
        moving = tuple(None if one is None else () for one in rates)
        given = [one for one in rates if one is not None]
        return tuple(_Respond.apply(ctx.solver, "push", moving, *ctx.saved_tensors, *given))

    @staticmethod
    def vmap(info: Any, in_dims: Any, solver: Differentiable, *inputs: Any) -> tuple[Any, Any]:
        found = _Solve.apply(solver, *_moved(inputs, in_dims[1:]))
        return found, (0,) * len(found)


class _Respond(torch.autograd.Function):
    """Rates of the results from those of the inputs ("push"), or weights of the inputs from those of the results ("pull").

    The tensors are inputs, results, and then rates or weights. `shapes` are the leading dimensions of the weights of each input
    that is needed; of rates it tells which are not zero.
    """

    @staticmethod
    def forward(solver: Differentiable, way: str, shapes: Any, *tensors: Any) -> tuple[Any, ...]:
        arrays = [one.detach().numpy() for one in tensors]
        inputs, results, given = arrays[:3], arrays[3 : 3 + len(solver.results)], arrays[3 + len(solver.results) :]
        if way == "pull":
            found = [one for one in solver.pull(inputs, results, given, shapes) if one is not None]
        else:
            left = iter(given)
            found = list(solver.push(inputs, results, [None if one is None else next(left) for one in shapes]))
        return tuple(torch.from_numpy(np.ascontiguousarray(one)) for one in found)

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise NotImplementedError("equilibria and load estimates have first derivatives only")

    @staticmethod
    def vmap(info: Any, in_dims: Any, solver: Differentiable, way: str, shapes: Any, *tensors: Any) -> tuple[Any, Any]:
        moved = _moved(tensors, in_dims[3:])
        if way == "push":
            found = _Respond.apply(solver, way, shapes, *moved)
            return found, (0,) * len(found)
        rank = moved[0].ndim - 2  # a weight for each of the batch
        wide = [None if shape is None else (info.batch_size, *[1] * (rank - len(shape)), *shape) for shape in shapes]
        found = _Respond.apply(solver, way, wide, *moved)
        needed = [shape for shape in shapes if shape is not None]
        flat = (one.reshape(info.batch_size, *shape, -1) for one, shape in zip(found, needed, strict=True))
        return tuple(flat), (0,) * len(found)


def _moved(tensors: Any, dims: Any) -> list[Any]:
    """Return tensors with the dimension of a batch first, and as many dimensions each."""
    moved = [one.unsqueeze(0) if dim is None else one.movedim(dim, 0) for one, dim in zip(tensors, dims, strict=True)]
    rank = max(one.ndim for one in moved)
    return [one.reshape(one.shape[0], *[1] * (rank - one.ndim), *one.shape[1:]) for one in moved]
