"""Pairs of floats for numba: numbers at both stages of a step, on which the vector instructions of a processor work at once.

Loops over both stages in generated code (`softrobots.compiled.trace.blocks`) become straight-line code with pairs. LLVM itself
vectorises few of them: it does not know that the places that a function reads and writes are different ones, and two rounds
are too few to look.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.cgutils import get_or_insert_function
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

FASTMATH = ("contract", "arcp", "nsz")
"""What LLVM may do with floating-point operations: nothing that changes an answer by more than a rounding."""

_VECTOR, _TRUTHS = ir.VectorType(ir.DoubleType(), 2), ir.VectorType(ir.IntType(1), 2)
_UNDEFINED = ir.Constant(_VECTOR, ir.Undefined)


def in_pairs(functions: str) -> str:
    """Return the text of functions with pairs instead of loops over both stages."""
    lines: list[str] = []
    depth: int | None = None  # indent of the loop
    for line in functions.split("\n"):
        indent = len(line) - len(line.lstrip())  # none of an empty line
        if depth is not None and indent <= depth:
            depth = None
        if re.match(r" +for stage in range\(2\):$", line):
            depth = indent
        elif depth is None:
            lines.append(line)
        else:
            target, value = line[4:].split(" = ", 1)
            read = re.sub(_AT_STAGE, lambda found: f"load_pair(w, {_first(found[1])})", value)
            written = re.match(rf"( +){_AT_STAGE}$", target)
            lines.append(f"{written[1]}store_pair(w, {_first(written[2])}, {read})" if written else f"{target} = {read}")
    return "\n".join(lines)


_AT_STAGE = r"\bw\[([^\]]*\bstage\b[^\]]*)\]"


def _first(index: str) -> str:
    """Return the index of the first number of a pair."""
    return re.sub(r"\bstage\b", "0", index)


class Pair(types.Type):
    """Type of two floats."""

    def __init__(self) -> None:
        """Name it."""
        super().__init__(name="Pair")


class Truths(types.Type):
    """Type of what a comparison of pairs tells."""

    def __init__(self) -> None:
        """Name it."""
        super().__init__(name="Truths")


PAIR, TRUTHS = Pair(), Truths()


def _model(vector: ir.VectorType) -> type:
    class Model(models.PrimitiveModel):
        """A vector of LLVM."""

        def __init__(self, manager: Any, kind: types.Type) -> None:
            super().__init__(manager, kind, vector)  # type: ignore[no-untyped-call]

    return Model


register_model(Pair)(_model(_VECTOR))
register_model(Truths)(_model(_TRUTHS))


def _spread(context: Any, builder: ir.IRBuilder, value: ir.Value, kind: types.Type) -> ir.Value:
    """Return a pair as it is, and another number as a pair of equal ones."""
    if kind == PAIR:
        return value
    number = context.cast(builder, value, kind, types.float64)
    single = builder.insert_element(_UNDEFINED, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(single, _UNDEFINED, ir.Constant(ir.VectorType(ir.IntType(32), 2), [0, 0]))


def _define(operation: Any, result: types.Type, build: Callable[..., ir.Value]) -> None:
    """Define an operation on two pairs, or on a pair and a number."""

    class Template(AbstractTemplate):
        def generic(self, args: tuple[types.Type, ...], kws: dict[str, Any]) -> Any:
            """Return the signature, if one of the arguments is a pair."""
            fits = len(args) == 2 and PAIR in args and all(isinstance(one, (Pair, types.Number)) for one in args)
            return signature(result, *args) if fits else None

    infer_global(operation)(Template)

    def lower(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
        return build(builder, *(_spread(context, builder, *one) for one in zip(values, called.args, strict=True)))

    for kinds in ((Pair, Pair), (Pair, types.Number), (types.Number, Pair)):
        lower_builtin(operation, *kinds)(lower)


for _operation, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):
    _define(_operation, PAIR, lambda builder, a, b, name=_name: getattr(builder, name)(a, b, flags=FASTMATH))
for _operation, _name in ((operator.lt, "<"), (operator.gt, ">")):
    _define(_operation, TRUTHS, lambda builder, a, b, name=_name: builder.fcmp_ordered(name, a, b))


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, args: tuple[types.Type, ...], kws: dict[str, Any]) -> Any:
        """Return the signature, if the argument is a pair."""
        return signature(PAIR, PAIR) if args == (PAIR,) else None


@lower_builtin(operator.neg, Pair)  # type: ignore[untyped-decorator]
def _negative(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
    return builder.fneg(values[0], flags=FASTMATH)


def _function(name: str) -> Any:
    """Return a function of LLVM, of a float or of a pair."""

    def typed(context: Any, x: types.Type) -> Any:
        kind, value, end = (PAIR, _VECTOR, "v2f64") if x == PAIR else (types.float64, ir.DoubleType(), "f64")

        def build(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
            function = get_or_insert_function(builder.module, ir.FunctionType(value, [value]), f"llvm.{name}.{end}")
            return builder.call(function, values)

        return kind(kind), build

    return intrinsic(typed)


fabs, floor, sqrt = _function("fabs"), _function("floor"), _function("sqrt")


@intrinsic
def where(context: Any, condition: types.Type, a: types.Type, b: types.Type) -> Any:
    """Return `a` where the condition holds, else `b`: a select from the start, which can be vectorised, unlike a branch."""
    if condition == TRUTHS:

        def build(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
            ways = [_spread(context, builder, *one) for one in zip(values[1:], called.args[1:], strict=True)]
            return builder.select(values[0], *ways)

        return PAIR(TRUTHS, a, b), build
    single = types.float64(types.boolean, types.float64, types.float64)
    return single, lambda context, builder, called, values: builder.select(*values)


@intrinsic
def load_pair(context: Any, w: types.Type, first: types.Type) -> Any:
    """Read two numbers of an array."""

    def build(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
        read = builder.load(_pointer(context, builder, called, values))
        read.align = 8
        return read

    return PAIR(w, types.intp), build


@intrinsic
def store_pair(context: Any, w: types.Type, first: types.Type, value: types.Type) -> Any:
    """Write two numbers of an array."""

    def build(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
        pair = _spread(context, builder, values[2], called.args[2])
        builder.store(pair, _pointer(context, builder, called, values)).align = 8
        return context.get_dummy_value()

    return types.void(w, types.intp, value), build


def _pointer(context: Any, builder: ir.IRBuilder, called: Any, values: tuple[ir.Value, ...]) -> ir.Value:
    """Return the pointer to two numbers of an array."""
    array = context.make_array(called.args[0])(context, builder, values[0])
    return builder.bitcast(builder.gep(array.data, [values[1]]), _VECTOR.as_pointer())
