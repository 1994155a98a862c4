"""Compiled solvers of a looped chain at other values of its parameters: one code, with numbers of the robot as inputs.

Inputs are the tables of numbers in which robots differ that the code was made for: the one that was compiled, one for each
parameter with another value, and those whose other numbers differed later, for which it was made anew.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.looped_numbers import chain_numbers
from softrobots.compiled.run.compiled_code import SharedCode
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.trace.numbers import TableInputs
from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.identification.parameters import ParameterSet
from softrobots.model.soft_model import SoftModel

_STEP = 1e-3  # change of a parameter that tells which numbers it changes, relative to its value or 1


class VariedChains:
    """The compiled solvers by robot."""

    def __init__(self, compiled: CompiledModel, parameters: ParameterSet) -> None:
        """Take the solvers of the robot as it is, whose chain is looped, and the parameters that change it."""
        self._compiled, self._parameters = compiled, parameters
        self._structure, tables = chain_numbers(compiled.unknowns)
        self._inputs = TableInputs((tables,))
        self._runs: dict[Any, Any] = {}

    def at(self, model: SoftModel) -> CompiledModel | None:
        """Return the solvers of a robot; None if it has another structure, and so other code."""
        base, tables = self._compiled, self._tables(model)
        if tables is None:
            return None
        numbers = self._inputs.values(tables)
        if numbers is None:
            tried = [] if self._runs else [self._tables(one) for one in self._changed()]
            self._inputs = TableInputs((*self._inputs.seen, *(one for one in tried if one is not None), tables))
            self._runs = {}
            return self.at(model)
        shared = SharedCode(base.unknowns, self._inputs, numbers, self._runs)
        return CompiledModel(model, base.backend, base.unknowns.locked, shared)

    def _tables(self, model: SoftModel) -> Mapping[str, FloatArray] | None:
        """Return the numbers of a robot; None if it has another structure."""
        found = chain_numbers(Unknowns(model.chain(), self._compiled.unknowns.locked))
        return found.tables if found.structure == self._structure else None

    def _changed(self) -> Iterator[SoftModel]:
        """Yield robots in which one parameter has another value."""
        given = self._parameters
        for place in np.flatnonzero(given.of_model).tolist():
            for step in (_STEP, -_STEP):
                values = given.values.copy()
                values[place] += step * (abs(values[place]) or 1.0)
                with suppress(SoftRobotsError):
                    yield given.model(values)
                    break
