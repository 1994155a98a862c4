"""Numbers that remember how they were computed, so that an expansion of a xacro file can be repeated for other numbers.

An expansion takes 0.01 to 0.1 s, nearly all of it for work on text. Numbers that vary pass through it as `TracedNumber`: each
operation on one is written down on a `Tape`, and its text is a mark for its place there. The tape then gives the text for
other numbers by the same operations in the same order, so digit for digit what xacro would write.

What is not a float is a fact: the result of a comparison, a whole number, a truth value, and the digits of a number that a
function without a rule here looks at. Where a fact comes out otherwise, the tape has no text, and the file is expanded anew.
The text of a number is taken as a whole: an expression that counts its characters, or compares it with a word, is not noticed.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray

_MARK = re.compile("\ue000([0-9]+)\ue001")  # private characters, which XML allows and no robot has


class Tape:
    """The operations on some numbers, in the order in which they were done.

    Args:
        numbers: The numbers that vary.
    """

    def __init__(self, numbers: Sequence[float]) -> None:
        self._values: list[Any] = list(numbers)  # then constants and results, each once
        self._count = len(numbers)
        self._places: dict[Any, int] = {}
        self._steps: list[tuple[int, Callable[..., Any], tuple[int, ...], type]] = []
        self._texts: list[tuple[list[str], list[int]]] = []

    @property
    def numbers(self) -> list[TracedNumber]:
        """The numbers that vary, as objects that write on the tape."""
        return [TracedNumber(self, place, value) for place, value in enumerate(self._values[: self._count])]

    def functions(self) -> dict[str, Callable[..., Any]]:
        """Return the functions on numbers that expressions call, by name, as ones that write on the tape."""
        functions = {name: self._traced(own) for name, own in vars(math).items() if callable(own)}
        of_all = {name: self._traced(own, of_all=True) for name, own in _OF_ALL.items()}
        return functions | of_all | {"float": self._float}

    def literal(self, text: Any) -> TracedNumber | None:
        """Return the number whose mark the whole text is, or None."""
        mark = _MARK.fullmatch(text) if isinstance(text, str) else None
        return TracedNumber(self, int(mark[1]), self._values[int(mark[1])]) if mark else None

    def record(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Return the result of a function: traced if it is a float, else as it is."""
        traced = [item for item in arguments if isinstance(item, TracedNumber)]
        value = function(*(item.value if isinstance(item, TracedNumber) else item for item in arguments))
        if type(value) not in (float, int, bool, str):  # a complex number or a pair
            for item in traced:
                self.record(repr, item)
            return value
        places = tuple(item.place if isinstance(item, TracedNumber) else self._constant(item) for item in arguments)
        if (function, places) not in self._places:
            self._steps.append((len(self._values), function, places, type(value)))
        place = self._place((function, places), value)
        return TracedNumber(self, place, value) if type(value) is float else value

    def keep(self, *texts: str) -> bool:
        """Keep texts with the marks of traced numbers, the first as `marked`; return whether all marks are whole."""
        self.marked, parts = texts[0], [_MARK.split(text) for text in texts]
        self._texts = [(part, [int(place) for place in part[1::2]]) for part in parts]
        return not any(sign in piece for part in parts for piece in part[::2] for sign in "\ue000\ue001")

    def texts(self, numbers: Sequence[float]) -> list[str] | None:
        """Return those texts for other numbers; None if a fact comes out otherwise."""
        values = self._values.copy()
        values[: self._count] = numbers
        try:
            for place, function, arguments, kind in self._steps:
                value = function(*[values[item] for item in arguments])
                if type(value) is not kind or (kind is not float and value != values[place]):
                    return None
                values[place] = value
        except (ArithmeticError, ValueError, TypeError):  # xacro would refuse these numbers
            return None
        digits = {place: repr(values[place]) for _, places in self._texts for place in places}
        texts = []
        for pieces, places in self._texts:
            filled = pieces.copy()
            filled[1::2] = [digits[place] for place in places]
            texts.append("".join(filled))
        return texts

    def read_many(self, numbers: FloatArray) -> tuple[Any, Callable[[str], FloatArray]]:
        """Return in which rows of numbers, (N, n), facts are as taped, and what reads words of `marked`, (N or 1, words)."""
        values, same = self._values.copy(), np.ones(len(numbers), dtype=bool)
        values[: self._count] = numbers.T
        with np.errstate(all="ignore"):
            for place, function, arguments, kind in self._steps:
                many: Any = _OF_ROWS.get(function) or getattr(np, function.__name__, None)
                if function not in _OF_ROWS and (not isinstance(many, np.ufunc) or many.nin != len(arguments)):
                    many = function if function.__module__ == "_operator" else np.vectorize(function)
                value = many(*[values[item] for item in arguments])
                same &= np.isfinite(value) if kind is float else value == values[place]
                values[place] = value if kind is float else values[place]

        def read(words: str) -> FloatArray:
            marks = [(_MARK.fullmatch(word), word) for word in words.split()]
            given = [values[int(mark[1])] if mark else float(word) for mark, word in marks]
            return np.stack(np.broadcast_arrays(*map(np.atleast_1d, given)), axis=1)

        return same, read

    def _constant(self, value: Any) -> int:
        return self._place((type(value), repr(value)), value)

    def _place(self, key: Any, value: Any) -> int:
        place = self._places.setdefault(key, len(self._values))
        if place == len(self._values):
            self._values.append(value)
        return place

    def _traced(self, function: Callable[..., Any], *, of_all: bool = False) -> Callable[..., Any]:
        def traced(*arguments: Any, **named: Any) -> Any:
            items = tuple(arguments[0]) if of_all and len(arguments) == 1 else arguments
            if not named and any(isinstance(item, TracedNumber) for item in items):
                return self.record(function, *items)
            return function(*items, **named)

        return traced

    def _float(self, value: Any = 0.0) -> Any:
        traced = value if isinstance(value, TracedNumber) else self.literal(str(value).strip())
        return float(value) if traced is None else traced


def _operation(function: Callable[..., Any], *, turned: bool = False) -> Any:
    def operation(self: Any, *others: Any) -> Any:
        if any(not isinstance(other, TracedNumber | int | float | complex) for other in others):
            return NotImplemented
        return self.tape.record(function, *(*others, self) if turned else (self, *others))

    return operation


class TracedNumber:
    """A float that writes what is done with it on a tape.

    It is no subclass of float: functions in C would read the number of one and leave nothing on the tape. They ask this one by
    `__float__`, which makes its digits a fact.
    """

    __slots__ = ("place", "tape", "value")

    def __init__(self, tape: Tape, place: int, value: float) -> None:
        self.tape, self.place, self.value = tape, place, value

    def __str__(self) -> str:
        return f"\ue000{self.place}\ue001"

    __repr__ = __str__

    def __format__(self, form: str) -> str:
        return str(self.tape.record(format, self, form)) if form else str(self)

    def __float__(self) -> float:
        self.tape.record(repr, self)
        return self.value

    def __hash__(self) -> int:
        return hash(float(self))

    def __getattr__(self, name: str) -> Any:
        return getattr(float(self), name)

    __add__, __radd__ = _operation(operator.add), _operation(operator.add, turned=True)
    __sub__, __rsub__ = _operation(operator.sub), _operation(operator.sub, turned=True)
    __mul__, __rmul__ = _operation(operator.mul), _operation(operator.mul, turned=True)
    __truediv__, __rtruediv__ = _operation(operator.truediv), _operation(operator.truediv, turned=True)
    __floordiv__, __rfloordiv__ = _operation(operator.floordiv), _operation(operator.floordiv, turned=True)
    __mod__, __rmod__ = _operation(operator.mod), _operation(operator.mod, turned=True)
    __divmod__, __rdivmod__ = _operation(divmod), _operation(divmod, turned=True)
    __pow__, __rpow__ = _operation(operator.pow), _operation(operator.pow, turned=True)
    __neg__, __pos__, __abs__ = _operation(operator.neg), _operation(operator.pos), _operation(abs)
    __lt__, __le__, __gt__ = _operation(operator.lt), _operation(operator.le), _operation(operator.gt)
    __ge__, __eq__, __ne__ = _operation(operator.ge), _operation(operator.eq), _operation(operator.ne)
    __bool__, __int__, __round__ = _operation(bool), _operation(int), _operation(round)
    __trunc__, __floor__, __ceil__ = _operation(math.trunc), _operation(math.floor), _operation(math.ceil)


def _of_all(function: Callable[..., Any], *items: Any, **named: Any) -> Any:
    return function(items, **named)


_OF_ALL = {name: partial(_of_all, function) for name, function in (("min", min), ("max", max), ("fsum", math.fsum))}
_REDUCED = (("min", partial(reduce, np.minimum)), ("max", partial(reduce, np.maximum)), ("fsum", sum))
_OF_ROWS: dict[Any, Any] = {_OF_ALL[name]: partial(_of_all, function) for name, function in _REDUCED}
