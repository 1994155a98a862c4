"""Inputs of the functions that trace a chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import symmetric, upper_triangle, vector
from softrobots.compiled.chain.elimination import Outboard
from softrobots.compiled.chain.layout import Layout, RecursionLayout, TipLayout
from softrobots.compiled.chain.routes import Routes
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.compiled.trace.expressions import Expression, Scalar
from softrobots.compiled.trace.numbers import NumberInputs, TableInputs
from softrobots.model.serial_chain import SerialChain


@dataclass(frozen=True)
class Plan:
    """A chain and its places in the workspace."""

    unknowns: Unknowns
    """The chain."""
    weight: bool
    """Whether there is gravity."""
    poses: bool = False
    """Whether targets of the tip are poses."""
    tip: TipLayout | None = None
    """Places of the response of the tip, or to given loads and motions, in code of looped chains that traces it."""
    inputs: NumberInputs | TableInputs | None = None
    """The numbers of the chain that are inputs of the code; None if all are constants."""
    tables: dict[str, TableColumns] = field(default_factory=dict)
    """The tables of numbers so far, of a looped chain."""

    def __post_init__(self) -> None:
        """Join the joints of sections along which actuators wind."""
        object.__setattr__(self, "unknowns", replace(self.unknowns, chain=self.unknowns.chain.joined))

    def numbers_in(self, block: Block) -> SerialChain:
        """Return the chain with expressions of a block instead of the numbers that are inputs."""
        chain, inputs = self.unknowns.chain, self.inputs
        if not isinstance(inputs, NumberInputs):
            return chain
        return inputs.traced(chain, block.loads(self.layout.numbers, inputs.count))

    def table(self, block: Block, name: str, count: int, base: str = "row") -> TableColumns:
        """Begin a table of numbers of `count` elements of a looped chain, an input if one of the numbers is."""
        columns = self.tables[name] = TableColumns(block, name, count, base)
        if isinstance(self.inputs, TableInputs) and name in self.inputs.columns:
            first, own = self.inputs.columns[name]
            columns.given = [None if one is None else self.layout.numbers + first + one for one in own]
        return columns

    def numbers(self, block: Block, name: str, values: Any) -> Any:
        """Return numbers of a looped chain, of any shape, as constants and inputs."""
        return self.table(block, name, 1, "").entries(np.asarray(values)[None])

    @cached_property
    def layout(self) -> Layout:
        """Places of the numbers of a case."""
        unknowns, conditions = self.unknowns, 6 if self.poses else 3
        counts = unknowns.n_tensions, unknowns.n_constraints, 0 if self.inputs is None else self.inputs.count
        guides = 0 if unknowns.chain.guides is None else unknowns.chain.guides.n_guides
        rubbing = len(unknowns.strains) if unknowns.chain.friction or guides else 0
        return Layout(unknowns.chain.n_motors, len(unknowns.strains), conditions, *counts, rubbing, guides)

    @cached_property
    def recursion(self) -> RecursionLayout:
        """Places of the sums that elements of a looped chain hand on."""
        return RecursionLayout(self.layout.prepared, self.unknowns.most_muscles)

    @cached_property
    def routes(self) -> Routes:
        """Routes of actuators that are looped over; before their places stand the share of the step and the bounds of loops."""
        return Routes(self.unknowns, self.recursion.end + 3)

    @property
    def infix(self) -> str:
        """Part of the names of functions that tells those of the response of the tip from others."""
        return "" if self.tip is None or self.tip.given else "tip_"

    @property
    def columns(self) -> list[int]:
        """Place of `s` of the elimination for each right-hand side: of the balance, and of those of the tip."""
        return [self.recursion.column, *(() if self.tip is None else self.tip.each(self.tip.column, 6))]

    @property
    def turns(self) -> list[int]:
        """Place of the turn of all elements nearer to the base, and of the multipliers, for each right-hand side."""
        return [self.recursion.turn, *(() if self.tip is None else self.tip.each(self.tip.turn, 6))]

    def given_gaps(self, block: Block, sums: Sequence[int]) -> list[list[Scalar]]:
        """Return the gaps of constrained sums in the right-hand side that is given; empty if there is none."""
        return [[-block.load(self.tip.sums + one) for one in sums]] if self.tip is not None and self.tip.given else []

    def load_outboard(self, block: Block, n: int) -> tuple[Outboard, list[Expression]]:
        """Read the sums of the outboard elements, with `n` components; return them and the elements of matrix and columns."""
        upper = block.loads(self.recursion.matrix, n * (n + 1) // 2)
        columns = [block.loads(place, n) for place in self.columns]
        min_pivot, n_negative_pivots = block.loads(self.recursion.sums + 3, 2)
        outboard = Outboard(symmetric(upper, n), [vector(column) for column in columns], min_pivot, n_negative_pivots)
        return outboard, [*upper, *(one for column in columns for one in column)]

    def store_outboard(self, block: Block, outboard: Outboard) -> None:
        """Write the sums that an element hands on."""
        block.store_all(self.recursion.matrix, [outboard.matrix[index] for index in upper_triangle(len(outboard.matrix))])
        for place, column in zip(self.columns, outboard.columns, strict=True):
            block.store_all(place, column.tolist())
