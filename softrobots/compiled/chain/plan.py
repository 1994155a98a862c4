"""Inputs of the functions that trace a chain."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.recursion_layout import RecursionLayout, TipLayout
from softrobots.compiled.chain.unknowns import Unknowns


@dataclass(frozen=True)
class Plan:
    """A chain and its places in the workspace."""

    unknowns: Unknowns
    """The chain."""
    weight: bool
    """Whether there is gravity."""
    tip: TipLayout | None = None
    """Places of the response of the tip, in code of looped chains that traces it."""

    @cached_property
    def layout(self) -> Layout:
        """Places of the numbers of a case."""
        return Layout(self.unknowns.chain.n_motors, len(self.unknowns.strains))

    @cached_property
    def recursion(self) -> RecursionLayout:
        """Places of the sums that elements of a looped chain hand on."""
        return RecursionLayout(self.layout.prepared)

    @property
    def infix(self) -> str:
        """Part of the names of functions that tells those of the response of the tip from others."""
        return "" if self.tip is None else "tip_"
