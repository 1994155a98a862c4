"""A solver as an operation of JAX: its value, and its derivatives in both modes, for batches."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from softrobots.core.errors import ParameterError
from softrobots.learning.differentiable import Differentiable, lead_of


class Function:
    """A solver as a function of JAX."""

    def __init__(self, solver: Differentiable) -> None:
        self._solver = solver
        self.parameters, self.values = solver.names, solver.present
        self._call = jax.custom_jvp(self._solve)
        self._call.defjvp(self._rates, symbolic_zeros=True)

    def __call__(self, q_motors: Any, load: Any, parameters: Any = None) -> tuple[Any, ...]:
        """Return the results; see `softrobots.jax.equilibrium`."""
        if not jax.config.jax_enable_x64:
            raise ParameterError("jax_enable_x64", False, 'True: jax.config.update("jax_enable_x64", True) before any array')
        given = [q_motors, load, self.values if parameters is None else parameters]
        arrays = [jnp.asarray(one, dtype=jnp.float64) for one in given]
        for name, array, size in zip(("q_motors", "load", "parameters"), arrays, self._solver.inputs, strict=True):
            if array.ndim == 0 or array.shape[-1] != size:
                raise ParameterError(name, array.shape, f"an array of shape (..., {size})")
        lead_of(arrays)
        rank = max(array.ndim for array in arrays)
        arrays = [array.reshape((1,) * (rank - array.ndim) + array.shape) for array in arrays]
        if not any(isinstance(one, jax.core.Tracer) for one in arrays):  # errors are then our own
            return tuple(map(jnp.asarray, self._solver.solve(*arrays)))
        return tuple(self._call(*arrays))

    def _solve(self, *inputs: Any) -> tuple[Any, ...]:
        lead = jnp.broadcast_shapes(*(one.shape[:-1] for one in inputs))
        shapes = tuple(jax.ShapeDtypeStruct((*lead, size), np.float64) for size in self._solver.results)
        return tuple(jax.pure_callback(self._solver.solve, shapes, *inputs, vmap_method="expand_dims"))

    def _rates(self, inputs: Any, rates: Any) -> tuple[Any, Any]:
        results = self._call(*inputs)
        moving = tuple(not isinstance(one, jax.custom_derivatives.SymbolicZero) for one in rates)
        given = [one for one, moves in zip(rates, moving, strict=True) if moves]
        shapes = tuple(one.shape[:-1] for one in given)
        pushed = _response.bind(*inputs, *results, *given, solver=self._solver, moving=moving, pulls=False, shapes=shapes)
        return results, tuple(pushed)


# A linear function: rates of the results from those of the moving inputs, or its transpose, weights of those inputs from those
# of the results. The operands before those are inputs and results; all have as many dimensions.
_response = Primitive("softrobots_response")
_response.multiple_results = True


def _residuals(solver: Differentiable) -> int:
    return 3 + len(solver.results)


def _shapes(*operands: Any, solver: Differentiable, moving: Any, pulls: bool, shapes: Any) -> list[tuple[int, ...]]:
    if pulls:
        sizes = [size for size, moves in zip(solver.inputs, moving, strict=True) if moves]
        return [(*shape, size) for shape, size in zip(shapes, sizes, strict=True)]
    lead = np.broadcast_shapes(*(one.shape[:-1] for one in operands))
    return [(*lead, size) for size in solver.results]


def _respond(solver: Differentiable, moving: Any, pulls: bool, shapes: Any, *operands: Any) -> list[Any]:
    arrays = [np.asarray(one) for one in operands]
    count = _residuals(solver)
    inputs, results, given = arrays[:3], arrays[3:count], iter(arrays[count:])
    if not pulls:
        return list(solver.push(inputs, results, [next(given) if moves else None for moves in moving]))
    left = iter(shapes)
    found = solver.pull(inputs, results, list(given), [next(left) if moves else None for moves in moving])
    return [one for one in found if one is not None]


def _lowered(*operands: Any, solver: Differentiable, moving: Any, pulls: bool, shapes: Any) -> Any:
    found = _shapes(*operands, solver=solver, moving=moving, pulls=pulls, shapes=shapes)
    outputs = [jax.ShapeDtypeStruct(shape, np.float64) for shape in found]
    return jax.pure_callback(partial(_respond, solver, moving, pulls, shapes), outputs, *operands)


def _batched(operands: Any, axes: Any, *, pulls: bool, shapes: Any, **options: Any) -> Any:
    size = next(one.shape[axis] for one, axis in zip(operands, axes, strict=True) if axis is not None)
    moved = [
        jnp.expand_dims(one, 0) if axis is None else jnp.moveaxis(one, axis, 0)
        for one, axis in zip(operands, axes, strict=True)
    ]
    if pulls:  # a weight for each of the batch
        shapes = tuple((size, *shape) for shape in shapes)
    else:
        shapes = tuple(one.shape[:-1] for one in moved[len(moved) - len(shapes) :])
    found = _response.bind(*moved, pulls=pulls, shapes=shapes, **options)
    return found, [0] * len(found)


def _transposed(weights: Any, *operands: Any, solver: Differentiable, moving: Any, pulls: bool, shapes: Any) -> Any:
    count = _residuals(solver)
    given = [ad.instantiate_zeros(one) for one in weights]
    options: dict[str, Any] = dict(solver=solver, moving=moving, pulls=not pulls)
    found = _response.bind(*operands[:count], *given, shapes=shapes, **options)
    if pulls:
        found = [_summed(one, operand.aval.shape) for one, operand in zip(found, operands[count:], strict=True)]
    return [*[None] * count, *found]


def _summed(array: Any, shape: tuple[int, ...]) -> Any:
    return array.sum(axis=tuple(axis for axis, size in enumerate(shape) if array.shape[axis] != size), keepdims=True)


def _no_second_derivatives(primals: Any, tangents: Any, *, solver: Differentiable, **options: Any) -> Any:
    count = _residuals(solver)
    if any(not isinstance(one, ad.Zero) for one in tangents[:count]):
        raise NotImplementedError("equilibria and load estimates have first derivatives only")
    given = [ad.instantiate_zeros(one) for one in tangents[count:]]
    rates = _response.bind(*primals[:count], *given, solver=solver, **options)
    return _response.bind(*primals, solver=solver, **options), rates


def _abstract(*operands: Any, **options: Any) -> list[Any]:
    return [jax.core.ShapedArray(shape, np.dtype(np.float64)) for shape in _shapes(*operands, **options)]


_response.def_impl(partial(jax.jit(_lowered, static_argnames=("solver", "moving", "pulls", "shapes"))))
_response.def_abstract_eval(_abstract)
mlir.register_lowering(_response, mlir.lower_fun(_lowered, multiple_results=True))
batching.primitive_batchers[_response] = _batched
ad.primitive_transposes[_response] = _transposed
ad.primitive_jvps[_response] = _no_second_derivatives
