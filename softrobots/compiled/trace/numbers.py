"""The numbers of a chain on which its statics depends, and those of them that are inputs of generated code.

In code of unrolled chains numbers that are not 0, 1 or -1 are inputs, so that one code serves all robots of a structure,
whatever their parameters; in code of looped chains those that differ between robots that it is made for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.compiled.trace.blocks import width_of
from softrobots.compiled.trace.expressions import Scalar
from softrobots.core.checks import FloatArray
from softrobots.model.serial_chain import ChainBody, ChainJoint, Element, SerialChain


def numbers_of(chain: SerialChain) -> FloatArray:
    """Return all numbers of joints and links on which equilibria depend, flat, in the order of `with_numbers`."""
    parts: list[FloatArray] = []

    def collect(values: Any) -> Any:
        parts.append(np.asarray(values, dtype=np.float64).ravel())
        return values

    _mapped(chain, collect)
    return np.concatenate(parts)


def with_numbers(chain: SerialChain, numbers: Sequence[Any]) -> SerialChain:
    """Return the chain with other numbers, floats or expressions."""
    left = iter(numbers)

    def put(values: Any) -> Any:
        shape = np.shape(values)
        changed = np.zeros(shape, dtype=object)
        for index in np.ndindex(*shape):
            changed[index] = next(left)
        return changed if shape else changed.item()

    return _mapped(chain, put)


def _mapped(chain: SerialChain, change: Callable[[Any], Any]) -> SerialChain:
    """Return the chain with every array or number that counts changed; masses last, which count under gravity only."""
    elements: list[Element] = [
        replace(one, rotation=change(one.rotation), translation=change(one.translation)) for one in chain.elements
    ]
    hinges = tuple((inner, outer, change(moment)) for inner, outer, moment in chain.slack_hinges)
    changed = replace(
        chain,
        slack_hinges=hinges,
        tip_translation=change(chain.tip_translation),
        stiffness=change(chain.stiffness),
        rest=change(chain.rest),
    )
    for row, one in enumerate(elements):
        if isinstance(one, ChainJoint):
            elements[row] = replace(one, body=_weighed(one.body, change))
        else:
            bodies = tuple(_weighed(body, change) for body in one.bodies)
            elements[row] = replace(one, length=change(one.length), bodies=bodies)
    return replace(changed, elements=tuple(elements))


def _weighed(body: ChainBody, change: Callable[[Any], Any]) -> ChainBody:
    return body._replace(mass=change(body.mass), first_moment=change(body.first_moment))


@dataclass(frozen=True, eq=False)
class NumberInputs:
    """The numbers of a chain that are inputs of its code."""

    constant: FloatArray
    """All numbers of the chain that the code was made for, shape (n,)."""
    varied: Any
    """Mask of those that are inputs, shape (n,)."""

    @cached_property
    def count(self) -> int:
        """Number of inputs."""
        return int(self.varied.sum())

    def traced(self, chain: SerialChain, inputs: Sequence[Scalar]) -> SerialChain:
        """Return the chain with expressions instead of the inputs."""
        left = iter(inputs)
        numbers = [next(left) if varied else value for value, varied in zip(self.constant.tolist(), self.varied, strict=True)]
        return with_numbers(chain, numbers)


@dataclass(frozen=True, eq=False)
class TableInputs:
    """The numbers of a looped chain that are inputs of its code: whole tables in which one differs between some chains."""

    seen: tuple[Mapping[str, FloatArray], ...]
    """The tables of each of these chains by name, shape (rows, numbers); see `ChainNumbers`."""

    @cached_property
    def columns(self) -> dict[str, tuple[int, list[int | None]]]:
        """By table that is an input: its first place, and the column of each number; None of constants."""
        found, first = {}, 0
        for name, table in self.seen[0].items():
            each = np.stack([one[name] for one in self.seen])
            if not np.all(_same(each, table)):
                places: dict[bytes, int] = {}
                own = [
                    None if np.all(_same(one, one.flat[0])) else places.setdefault(one.tobytes(), len(places))
                    for one in np.moveaxis(each, 2, 0)
                ]
                found[name] = first, own
                first += len(table) * len(places)
        return found

    @property
    def count(self) -> int:
        """Number of inputs."""
        return sum(len(self.seen[0][name]) * width_of(own) for name, (_, own) in self.columns.items())

    def values(self, tables: Mapping[str, FloatArray]) -> FloatArray | None:
        """Return the inputs of a chain, shape (count,), from its tables; None if another number differs there."""
        parts = [np.zeros(0)]
        for name, given in self.seen[0].items():
            own, table = self.columns.get(name, (0, [None] * given.shape[1]))[1], tables[name]
            varied = np.array([one is not None for one in own], dtype=bool)
            part, places = np.zeros((len(table), width_of(own))), [one for one in own if one is not None]
            part[:, places] = table[:, varied]
            expected = given.copy()
            expected[:, varied] = part[:, places]
            if not np.all(_same(table, expected)):
                return None
            parts.append(part.ravel())
        return np.concatenate(parts)


def _same(one: Any, other: Any) -> Any:
    """Whether numbers differ by no more than the rounding of a description."""
    return np.abs(one - other) <= 1e-13 * np.abs(other) + 1e-17
