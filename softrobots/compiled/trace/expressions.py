"""Traced scalar expressions: constants are folded, equal expressions shared, derivatives exact.

A `Trace` creates the inputs; arithmetic on them creates `Expression` objects, each at most once. A constant is a plain float,
so that ordinary code (also on NumPy arrays of objects, with `@`) computes with constants and expressions alike: zeros and ones
of a robot cost nothing in the code that `softrobots.compiled.trace.blocks` writes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

Scalar: TypeAlias = "Expression | float"
"""An expression, or a constant."""

COMMUTATIVE = ("+", "*")
"""Commutative operations."""


def scalar(value: Any) -> Scalar:
    """Return an expression as it is, and any other number as a plain float."""
    return value if isinstance(value, Expression) else float(value)


class Trace:
    """Expressions of one piece of code."""

    def __init__(self) -> None:
        """Begin without expressions."""
        self._expressions: dict[tuple[Any, ...], Expression] = {}

    def load(self, array: str, base: str, offset: int) -> Expression:
        """Return element `base + offset` of an array; `base` is the name of an integer parameter, or empty."""
        return self.make("load", array, base, offset)

    def make(self, operation: str, *arguments: Any) -> Expression:
        """Return the expression of an operation, a new one only if there is no equal one."""
        if operation in COMMUTATIVE and _order(arguments[1]) < _order(arguments[0]):
            arguments = arguments[::-1]
        key = (operation, *[id(one) if isinstance(one, Expression) else one for one in arguments])
        expression = self._expressions.get(key)
        if expression is None:
            expression = self._expressions[key] = Expression(self, operation, arguments, len(self._expressions))
        return expression


class Expression:
    """A number that is known only when the generated code runs."""

    __slots__ = ("arguments", "number", "operands", "operation", "trace")

    def __init__(self, trace: Trace, operation: str, arguments: tuple[Any, ...], number: int) -> None:
        """Store operation and arguments; called by `Trace.make`."""
        self.trace = trace
        self.operation = operation
        self.arguments = arguments
        self.operands = [one for one in arguments if isinstance(one, Expression)]
        self.number = number

    def __repr__(self) -> str:
        """Operation and arguments, one level deep."""
        shown = (f"#{one.number}" if isinstance(one, Expression) else repr(one) for one in self.arguments)
        return f"#{self.number} = {self.operation}({', '.join(shown)})"

    def __neg__(self) -> Scalar:
        if self.operation == "neg":
            return _part(self)
        if self.operation == "-":
            return self.trace.make("-", self.arguments[1], self.arguments[0])
        return self.trace.make("neg", self)

    def __add__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            other = float(other)
            return self if other == 0.0 else self.trace.make("+", self, other)
        if other.operation == "neg":
            return self - _part(other)
        if self.operation == "neg":
            return other - _part(self)
        return self.trace.make("+", self, other)

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            return self + (-float(other))
        if other is self:
            return 0.0
        if other.operation == "neg":
            return self + _part(other)
        return self.trace.make("-", self, other)

    def __rsub__(self, other: float) -> Scalar:
        return -self if other == 0.0 else self.trace.make("-", float(other), self)

    def __mul__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            other = float(other)
            if other == 0.0:
                return 0.0
            if other == 1.0:
                return self
            if other == -1.0:
                return -self
            if self.operation == "neg":
                return _part(self) * -other
            return self.trace.make("*", self, other)
        if self.operation == "neg":
            return -(_part(self) * other)
        if other.operation == "neg":
            return -(self * _part(other))
        return self.trace.make("*", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Scalar:
        if not isinstance(other, Expression):
            return self * (1.0 / float(other))
        return self.trace.make("/", self, other)

    def __rtruediv__(self, other: float) -> Scalar:
        return 0.0 if other == 0.0 else self.trace.make("/", float(other), self)


def _part(negated: Expression) -> Expression:
    """Return the argument of a negation."""
    part: Expression = negated.arguments[0]
    return part


def _order(argument: Any) -> int:
    """Return the sort key of an argument of a commutative operation: constants first, then by age."""
    return argument.number if isinstance(argument, Expression) else -1


def sine(angle: Scalar) -> Scalar:
    """Return the sine of an angle [rad]."""
    return angle.trace.make("sine", angle) if isinstance(angle, Expression) else math.sin(angle)


def cosine(angle: Scalar) -> Scalar:
    """Return the cosine of an angle [rad]."""
    return angle.trace.make("cosine", angle) if isinstance(angle, Expression) else math.cos(angle)


def square_root(value: Scalar) -> Scalar:
    """Return the square root."""
    return value.trace.make("sqrt", value) if isinstance(value, Expression) else math.sqrt(value)


def inverse_cube_root(value: Scalar) -> Scalar:
    """Return the power -1/3 of a number from 1 to 1e12, to 2e-6 of itself.

    Square roots give 1/4 + 1/16 + 1/64 + 1/256 of the exponent, and two Newton steps the rest.
    """
    inverse = 1.0 / value
    root: Scalar = 1.0
    quarter = inverse
    for _ in range(4):
        quarter = square_root(square_root(quarter))
        root = root * quarter
    for _ in range(2):
        root = (root * 2.0 + inverse / (root * root)) * (1.0 / 3.0)
    return root


def absolute(value: Scalar) -> Scalar:
    """Return the absolute value."""
    return value.trace.make("fabs", value) if isinstance(value, Expression) else abs(value)


def if_less(one: Scalar, other: Scalar, then: Scalar, otherwise: Scalar) -> Scalar:
    """Return `then` where `one < other`, else (also for NaN) `otherwise`; both are computed."""
    for side in (one, other):
        if isinstance(side, Expression):
            return side.trace.make("if_less", one, other, then, otherwise)
    return then if float(one) < float(other) else otherwise  # type: ignore[arg-type]


def smaller(one: Scalar, other: Scalar) -> Scalar:
    """Return the smaller of two numbers."""
    return if_less(one, other, one, other)


def larger(one: Scalar, other: Scalar) -> Scalar:
    """Return the larger of two numbers."""
    return if_less(other, one, one, other)


def in_order(roots: Sequence[Scalar]) -> list[Expression]:
    """Return `roots` and all expressions below them, each after its arguments."""
    seen: set[int] = set()
    ordered: list[Expression] = []
    pending: list[tuple[Expression, bool]] = [(root, False) for root in reversed(roots) if isinstance(root, Expression)]
    while pending:
        expression, ready = pending.pop()
        if ready:
            ordered.append(expression)
        elif expression.number not in seen:
            seen.add(expression.number)
            pending.append((expression, True))
            pending += [(one, False) for one in reversed(expression.operands)]
    return ordered


def gradient(value: Scalar, variables: Sequence[Expression]) -> list[Scalar]:
    """Return the derivatives of an expression with respect to expressions below it."""
    return pull_back([value], [1.0], variables)


def pull_back(values: Sequence[Scalar], weights: Sequence[Scalar], variables: Sequence[Expression]) -> list[Scalar]:
    """Return the derivatives of the weighted sum of values by expressions below them, at constant weights (reverse mode)."""
    slopes: dict[int, Scalar] = {}
    for value, weight in zip(values, weights, strict=True):
        if isinstance(value, Expression):
            slopes[value.number] = slopes.get(value.number, 0.0) + weight
    kept = {one.number for one in variables}
    for expression in reversed(in_order(values)):
        slope = slopes.get(expression.number, 0.0)
        if expression.number not in kept and not (isinstance(slope, float) and slope == 0.0):
            for one, share in _shares(expression):
                slopes[one.number] = slopes.get(one.number, 0.0) + slope * share
    return [slopes.get(one.number, 0.0) for one in variables]


def push_forward(values: Sequence[Scalar], variables: Sequence[Expression], rates: Sequence[Scalar]) -> list[Scalar]:
    """Return the rates of change of values from those of expressions below them (forward mode)."""
    known: dict[int, Scalar] = {one.number: rate for one, rate in zip(variables, rates, strict=True)}
    for expression in in_order(values):
        if expression.number not in known:
            shares = _shares(expression)
            known[expression.number] = sum((share * known[one.number] for one, share in shares), 0.0)
    return [known[one.number] if isinstance(one, Expression) else 0.0 for one in values]


def _shares(expression: Expression) -> list[tuple[Expression, Scalar]]:
    """Return the derivative of an operation with respect to each argument that is an expression."""
    arguments = expression.arguments
    one, two = arguments[0], arguments[1] if len(arguments) > 1 else 0.0
    shares: tuple[Scalar, ...]
    match expression.operation:
        case "load":
            return []
        case "neg":
            shares = (-1.0,)
        case "+":
            shares = (1.0, 1.0)
        case "-":
            shares = (1.0, -1.0)
        case "*":
            shares = (two, one)
        case "/":
            shares = (1.0 / two, -(expression / two))
        case "sqrt":
            shares = (0.5 / expression,)
        case "sine":
            shares = (cosine(one),)
        case "cosine":
            shares = (-sine(one),)
        case "fabs":
            shares = (if_less(one, 0.0, -1.0, 1.0),)
        case _:  # if_less
            shares = (0.0, 0.0, if_less(one, two, 1.0, 0.0), if_less(one, two, 0.0, 1.0))
    return [(argument, share) for argument, share in zip(arguments, shares, strict=True) if isinstance(argument, Expression)]
