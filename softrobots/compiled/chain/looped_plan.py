"""Inputs of the functions that trace a looped chain."""

from __future__ import annotations

from dataclasses import dataclass

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.recursion_layout import RecursionLayout, TipLayout
from softrobots.compiled.chain.unknowns import Unknowns


@dataclass(frozen=True)
class LoopedPlan:
    """A looped chain and its places in the workspace."""

    unknowns: Unknowns
    """The chain."""
    layout: Layout
    """Places of the numbers of a case."""
    recursion: RecursionLayout
    """Places of the sums that elements hand on."""
    weight: bool
    """Whether there is gravity."""
    tip: TipLayout | None = None
    """Places of the response of the tip, in code that traces it."""

    @property
    def infix(self) -> str:
        """Part of the names of functions that tells those of the response of the tip from others."""
        return "" if self.tip is None else "tip_"
