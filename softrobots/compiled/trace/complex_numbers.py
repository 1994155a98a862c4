"""Complex numbers of traced expressions, for the same code as real ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.compiled.trace.expressions import Expression, Scalar


class ComplexScalar(Expression):
    """A complex number, of two traced parts.

    It is a kind of expression only so that Python asks it first for operations of an expression with it.
    """

    __slots__ = ("im", "re")

    def __init__(self, re: Scalar, im: Scalar) -> None:
        """Take real and imaginary part."""
        self.re, self.im = re, im

    def __repr__(self) -> str:
        return f"({self.re!r}) + i ({self.im!r})"

    def __neg__(self) -> Any:
        return ComplexScalar(-self.re, -self.im)

    def __add__(self, other: Scalar) -> Any:
        re, im = _parts(other)
        return ComplexScalar(self.re + re, self.im + im)

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Any:
        re, im = _parts(other)
        return ComplexScalar(self.re - re, self.im - im)

    def __rsub__(self, other: Scalar) -> Any:
        return -self + other

    def __mul__(self, other: Scalar) -> Any:
        if not isinstance(other, ComplexScalar):
            return 0.0 if isinstance(other, float) and other == 0.0 else ComplexScalar(self.re * other, self.im * other)
        return ComplexScalar(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Any:
        return self * (1.0 / other)

    def __rtruediv__(self, other: Scalar) -> Any:
        inverse = 1.0 / (self.re * self.re + self.im * self.im)
        return ComplexScalar(self.re * inverse, -self.im * inverse) * other


def real_part(value: Scalar) -> Scalar:
    """Return the real part of a number."""
    return _parts(value)[0]


def symmetric_form(value: Scalar) -> Any:
    """Return the symmetric matrix from real and imaginary part of a number to those of its product, the last one negated."""
    re, im = _parts(value)
    return np.array([[re, -im], [-im, -re]], dtype=object)


def parts_of(values: Sequence[Scalar]) -> list[Scalar]:
    """Return the real parts of numbers, then their imaginary parts."""
    return [part for side in zip(*map(_parts, values), strict=True) for part in side]


def of_parts(values: Sequence[Scalar]) -> list[Scalar]:
    """Return the numbers of which `values` are the real parts, then the imaginary parts."""
    half = len(values) // 2
    return [ComplexScalar(re, im) for re, im in zip(values[:half], values[half:], strict=True)]


def _parts(value: Scalar) -> tuple[Scalar, Scalar]:
    return (value.re, value.im) if isinstance(value, ComplexScalar) else (value, 0.0)
