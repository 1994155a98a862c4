"""Tables of the numbers in which things differ that share their code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar


class TableColumns:
    """Numbers of the elements of a kind: equal ones are constants, others go into a table."""

    def __init__(self, block: Block, name: str, count: int) -> None:
        """Begin a table for `count` elements."""
        self._block, self._name, self._count = block, name, count
        self._columns: list[tuple[float, ...]] = []

    def entry(self, values: Sequence[Any]) -> Scalar:
        """Return a number of an element: a constant, or a table entry for the row of the element."""
        if len(set(values)) == 1:
            return float(values[0])
        column = tuple(float(value) for value in values)
        if column not in self._columns:
            self._columns.append(column)
        return self._block.table(self._name, self._columns.index(column), "row")

    def entries(self, values: Any) -> Any:
        """Return the same for arrays, shape (count, ...)."""
        array = np.asarray(values, dtype=np.float64)
        entries = np.zeros(array.shape[1:]).astype(object)
        for index in np.ndindex(*array.shape[1:]):
            entries[index] = self.entry(array[(slice(None), *index)].tolist())
        return entries

    @property
    def width(self) -> int:
        """Count of numbers for one element."""
        return len(self._columns)

    @property
    def numbers(self) -> list[float]:
        """The table, element by element."""
        return [column[row] for row in range(self._count) for column in self._columns]
