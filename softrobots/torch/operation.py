"""A solver as an operation of PyTorch: its value, and its derivatives in both modes, for batches."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from softrobots.core.errors import ParameterError
from softrobots.learning.differentiable import Differentiable


class Function:
    """A solver as a function of PyTorch."""

    def __init__(self, solver: Differentiable) -> None:
        self._solver = solver
        self.parameters, self.values = solver.names, torch.tensor(solver.present)

    def __call__(self, q_motors: Any, load: Any, parameters: Any = None) -> tuple[Any, ...]:
        """Return the results; see `softrobots.torch.equilibrium`."""
        given = [q_motors, load, self.values if parameters is None else parameters]
        for name, tensor, size in zip(("q_motors", "load", "parameters"), given, self._solver.inputs, strict=True):
            if not isinstance(tensor, torch.Tensor) or tensor.dtype != torch.float64 or tensor.device.type != "cpu":
                raise ParameterError(name, tensor, "a tensor of torch.float64 on the CPU")
            if tensor.ndim == 0 or tensor.shape[-1] != size:
                raise ParameterError(name, tuple(tensor.shape), f"a tensor of shape (..., {size})")
        return tuple(Solve.apply(self._solver, *given))


class Solve(torch.autograd.Function):  # type: ignore[misc]
    """The operation: inputs are motors, load and parameters, shapes (..., k)."""

    @staticmethod
    def forward(solver: Differentiable, *inputs: Any) -> tuple[Any, ...]:
        """Solve."""
        return tuple(torch.from_numpy(one) for one in solver.solve(*(one.detach().numpy() for one in inputs)))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep what derivatives need."""
        ctx.solver = inputs[0]
        ctx.save_for_backward(*inputs[1:], *output)
        ctx.save_for_forward(*inputs[1:], *output)

    @staticmethod
    def backward(ctx: Any, *weights: Any) -> tuple[Any, ...]:
        """Return the weights of the inputs from those of the results."""
        inputs = ctx.saved_tensors[:3]
        needed = ctx.needs_input_grad[1:]
        shapes = tuple(tuple(one.shape[:-1]) if need else None for one, need in zip(inputs, needed, strict=True))
        found = iter(Respond.apply(ctx.solver, "pull", shapes, *ctx.saved_tensors, *weights))
        return (None, *(next(found) if need else None for need in needed))

    @staticmethod
    def jvp(ctx: Any, _: Any, *rates: Any) -> tuple[Any, ...]:
        """Return the rates of the results from those of the inputs."""
        moving = tuple(None if one is None else () for one in rates)
        given = [one for one in rates if one is not None]
        return tuple(Respond.apply(ctx.solver, "push", moving, *ctx.saved_tensors, *given))

    @staticmethod
    def vmap(info: Any, in_dims: Any, solver: Differentiable, *inputs: Any) -> tuple[Any, Any]:
        """Solve a batch."""
        found = Solve.apply(solver, *_moved(inputs, in_dims[1:]))
        return found, (0,) * len(found)


class Respond(torch.autograd.Function):  # type: ignore[misc]
    """Rates of the results from those of the inputs ("push"), or weights of the inputs from those of the results ("pull").

    The tensors are inputs, results, and then rates or weights. `shapes` are the leading dimensions of the weights of each input
    that is needed; of rates it tells which are not zero.
    """

    @staticmethod
    def forward(solver: Differentiable, way: str, shapes: Any, *tensors: Any) -> tuple[Any, ...]:
        """Compute rates or weights."""
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
        """Keep nothing."""

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        """Refuse second derivatives."""
        raise NotImplementedError("equilibria and load estimates have first derivatives only")

    @staticmethod
    def vmap(info: Any, in_dims: Any, solver: Differentiable, way: str, shapes: Any, *tensors: Any) -> tuple[Any, Any]:
        """Compute those of a batch."""
        moved = _moved(tensors, in_dims[3:])
        if way == "push":
            found = Respond.apply(solver, way, shapes, *moved)
            return found, (0,) * len(found)
        rank = moved[0].ndim - 2  # a weight for each of the batch
        wide = [None if shape is None else (info.batch_size, *[1] * (rank - len(shape)), *shape) for shape in shapes]
        found = Respond.apply(solver, way, wide, *moved)
        needed = [shape for shape in shapes if shape is not None]
        flat = (one.reshape(info.batch_size, *shape, -1) for one, shape in zip(found, needed, strict=True))
        return tuple(flat), (0,) * len(found)


def _moved(tensors: Any, dims: Any) -> list[Any]:
    """Return tensors with the dimension of a batch first, and as many dimensions each."""
    moved = [one.unsqueeze(0) if dim is None else one.movedim(dim, 0) for one, dim in zip(tensors, dims, strict=True)]
    rank = max(one.ndim for one in moved)
    return [one.reshape(one.shape[0], *[1] * (rank - one.ndim), *one.shape[1:]) for one in moved]
