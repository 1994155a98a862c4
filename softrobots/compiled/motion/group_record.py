"""What a group of elements keeps of one pass of its motion for later ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.complex_numbers import ComplexScalar
from softrobots.compiled.trace.expressions import Expression, Scalar


class GroupRecord:
    """Values of a group for later passes, in the workspace from `at` on, of a function with a loop at all `stages`."""

    def __init__(self, stages: int, first: int = 0) -> None:
        """Begin without values, behind the first places."""
        self.size = first
        self._stages = stages
        self._kept: dict[tuple[str, int], Expression] = {}

    def keep(self, block: Block, values: Any) -> Any:
        """Write values at the end of a function; return what reads them, of the same shape. Constants stay constants."""
        array = np.asarray(values, dtype=object)
        kept = array.copy()
        for index in np.ndindex(*array.shape):
            kept[index] = self._one(block, array.item(*index))
        return kept

    def _one(self, block: Block, value: Scalar) -> Scalar:
        if isinstance(value, ComplexScalar):
            return ComplexScalar(self._one(block, value.re), self._one(block, value.im))
        if not isinstance(value, Expression):
            return value
        if value.operation == "neg":
            return -self._one(block, value.arguments[0])
        negative = -value
        if isinstance(negative, Expression) and (block.name, negative.number) in self._kept:
            return -self._kept[block.name, negative.number]
        if (block.name, value.number) not in self._kept:
            block.store(self.size, value, block.each("at"))
            self._kept[block.name, value.number] = block.load(self.size, block.each("at"))
            self.size += 1 if block.loop is None else self._stages
        return self._kept[block.name, value.number]

    def at(self, block: Block, values: Any, stage: int) -> Any:
        """Return what reads values that have been kept at all stages, at one of them."""
        return np.vectorize(lambda value: self._at(block, value, stage), otypes=[object])(values)

    def _at(self, block: Block, value: Scalar, stage: int) -> Scalar:
        if not isinstance(value, Expression) or self._stages == 1:
            return value
        if value.operation == "neg":
            return -self._at(block, value.arguments[0], stage)
        return block.load(value.arguments[2] + stage, "at")
