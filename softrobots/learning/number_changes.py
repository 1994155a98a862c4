"""Numbers of the compiled code of a robot at given parameters, and their derivatives by the parameters.

Derivatives are differences, see `softrobots.identification.model_change`. They are taken once for each new value of the
parameters, not for each case.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from softrobots.compiled.run.responses import Responses
from softrobots.compiled.trace.numbers import NumberInputs, numbers_of
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.identification.model_change import number_slopes
from softrobots.identification.parameters import ParameterSet
from softrobots.learning.recorded_chains import many_numbers, many_slopes
from softrobots.model.numbers import Numbers


class NumberChanges:
    """Numbers of a robot by its parameters, and the compiled code that takes them."""

    def __init__(self, parameters: ParameterSet, backend: str, *, weight: bool) -> None:
        """Generate the code.

        Raises:
            ParameterError: If derivatives of the robot are not compiled.
        """
        self._parameters, self._backend, self._weight = parameters, backend, weight
        self._chain = parameters.present.chain()
        self.numbers, self.slopes = lru_cache(maxsize=1 << 12)(self._numbers), lru_cache(maxsize=4)(self._slopes)
        present = tuple(parameters.values.tolist())
        constant = numbers_of(self._chain)
        self._inputs = NumberInputs(constant, ~np.isin(constant, (0.0, 1.0, -1.0)) | np.any(self.slopes(present), axis=1))
        self._responses = Responses(self._chain, backend, self._inputs, weight=weight)
        self._read: dict[tuple[float, ...], tuple[FloatArray, FloatArray]] = {}

    def read(self, each: Sequence[tuple[float, ...]], *, slopes: bool) -> None:
        """Check many robots and read their numbers at once, or their derivatives, too; `code` is then asked for each."""
        different, given = list(dict.fromkeys(each)), self._parameters
        rows, changes = np.array(different), np.zeros((len(different), 0, 0))
        if slopes:
            numbers, changes = many_slopes(given, rows, self.numbers)
        else:
            for values in different:
                given.robot(values, described=False)
            numbers = many_numbers(given, rows, self.numbers)
        known = np.isfinite(numbers).all(axis=1) & np.isfinite(changes).all(axis=(1, 2))
        self._read = {different[row]: (numbers[row], changes[row]) for row in np.flatnonzero(known).tolist()}

    def code(self, values: tuple[float, ...], *, slopes: bool = False) -> tuple[Responses, FloatArray, FloatArray]:
        """Return code that takes the numbers at values of the parameters; it is made anew if other numbers vary there.

        Args:
            values: The values, P of them.
            slopes: Whether the derivatives of the numbers are needed.

        Returns:
            The code, its numbers, shape (1, k), and their derivatives, shape (k, P), empty if not needed.

        Raises:
            ParameterError: If the robot refuses the values, or has other joints with them.
            DescriptionError: If the robot cannot be described with them.
        """
        numbers, by_parameter = self._read.get(values) or (self.numbers(values), np.zeros((0, 0)))
        if not by_parameter.size:
            by_parameter = self.slopes(values) if slopes else np.zeros((len(numbers), 0))
        varied = self._inputs.varied | (numbers != self._inputs.constant) | np.any(by_parameter, axis=1)
        if np.any(varied != self._inputs.varied):
            self._inputs = NumberInputs(self._inputs.constant, varied)
            self._responses = Responses(self._chain, self._backend, self._inputs, weight=self._weight)
        return self._responses, numbers[None, varied], by_parameter[varied]

    def _numbers(self, values: tuple[float, ...]) -> FloatArray:
        """Return the numbers at values of the parameters, shape (n,)."""
        chain = self._parameters.model(values).chain() if np.any(self._parameters.of_model) else self._chain
        numbers = numbers_of(chain)
        if [one.name for one in chain.elements] != [one.name for one in self._chain.elements]:
            raise ParameterError("parameters", values, "values with which the robot has the same joints")
        return numbers

    def _slopes(self, values: tuple[float, ...]) -> FloatArray:
        """Return the derivatives of the numbers by the parameters, shape (n, P); zero of those that do not change the model."""
        told: FloatArray = many_slopes(self._parameters, np.array([values]), self.numbers)[1][0]
        if np.isfinite(told).all():
            return told
        base = self._named(np.array(values))
        slopes: FloatArray = np.zeros((base["numbers"].size, len(values)))
        for place, _, slope in number_slopes(self._parameters, np.array(values), self._named, base):
            slopes[:, place] = slope
        return slopes

    def _named(self, values: FloatArray) -> Numbers:
        return {"numbers": self.numbers(tuple(values.tolist()))}
