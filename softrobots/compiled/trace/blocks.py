"""Straight-line code from traced expressions: functions without branches, in the kernel language.

A `Block` is a function `name(w: Array, ...)` that reads elements of the workspace `w` and of tables, and writes at its end.
Back ends vectorise it: the text is the same for one case (`w[7]`), for a NumPy array per element, and for lanes
(`w[7 * LANES + lane]` within a loop over `lane`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softrobots.compiled.trace.expressions import Expression, Scalar, Trace, in_order

WORKSPACE = "w"
"""Name of the workspace in generated code."""

_WIDEST = 88  # characters of an expression, beyond which it gets a name
_STRENGTH = {"+": 1, "-": 1, "*": 2, "/": 2, "neg": 3}  # how strongly an operation binds; calls and names most


@dataclass
class Block:
    """A traced function without branches."""

    name: str
    """Name of the function."""
    purpose: str
    """Its docstring."""
    parameters: tuple[str, ...] = ()
    """Names of integer parameters after the workspace."""
    trace: Trace = field(default_factory=Trace)
    """Its expressions."""
    stores: list[tuple[str, int, Scalar]] = field(default_factory=list)
    """Its results: base, offset, value."""
    loop: tuple[str, int] | None = None
    """Name and number of the rounds of a loop over all that depends on bases with this name; None: all is done once."""

    def each(self, base: str = "") -> str:
        """Return the base of numbers that each round of the loop has, side by side from another base on."""
        return base if self.loop is None else f"{base} + {self.loop[0]}" if base else self.loop[0]

    def load(self, offset: int, base: str = "") -> Expression:
        """Return an element of the workspace."""
        return self.trace.load(WORKSPACE, base, offset)

    def loads(self, offset: int, count: int, base: str = "") -> list[Expression]:
        """Return consecutive elements of the workspace."""
        return self.spaced(offset, count, 1, base)

    def spaced(self, offset: int, count: int, spacing: int, base: str = "") -> list[Expression]:
        """Return elements of the workspace at equal distances."""
        return [self.load(offset + spacing * place, base) for place in range(count)]

    def table(self, table: str, offset: int, base: str) -> Expression:
        """Return an element of a table."""
        return self.trace.load(table, base, offset)

    def store(self, offset: int, value: Scalar, base: str = "") -> None:
        """Write an element of the workspace at the end of the function."""
        self.stores.append((base, offset, value))

    def store_all(self, offset: int, values: Sequence[Scalar], base: str = "") -> None:
        """Write consecutive elements."""
        self.store_spaced(offset, values, 1, base)

    def store_spaced(self, offset: int, values: Sequence[Scalar], spacing: int, base: str = "") -> None:
        """Write elements at equal distances."""
        for place, value in enumerate(values):
            self.store(offset + spacing * place, value, base)

    def text(self, *, lanes: bool = False) -> str:
        """Return the text of the function, or of one for many cases: a loop over `LANES` numbers of each element."""
        head = ", ".join([f"{WORKSPACE}: Array", *(f"{name}: int" for name in self.parameters)])
        indent = "    "
        lines = [f"def {self.name}({head}) -> None:", f'{indent}"""{self.purpose}"""']
        statements = list(_statements(self.stores, lanes, "" if self.loop is None or lanes else self.loop[0]))
        lines += [f"{indent}{line}" for line, repeated in statements if not repeated]
        for index, count in ((self.loop or ("", 0)), ("lane", "LANES" if lanes else 0)):
            if count:
                lines.append(f"{indent}for {index} in range({count}):")
                indent += "    "
        body = [f"{indent}{line}" for line, repeated in statements if repeated]
        return "\n".join([*lines, *(body or [f"{indent}pass"])])


def hoist(
    blocks: Sequence[Block],
    before: Block,
    varying: Sequence[Expression],
    first: int,
    base: str = "",
    overwritten: Sequence[Expression] = (),
) -> int:
    """Move computations that do not depend on the `varying` elements out of blocks, into one that runs before them.

    Args:
        blocks: The blocks, of one trace; changed to read the values instead.
        before: The block that computes and stores them, of the same trace.
        varying: The elements of the workspace that change between two runs of the blocks.
        first: Place in the workspace of the first kept value.
        base: Name of an integer parameter to which that place is relative, or empty.
        overwritten: Elements that `before` reads and that have other values when the blocks run.

    Returns:
        The number of kept values.
    """
    trace = before.trace
    expressions = in_order([value for block in blocks for _, _, value in block.stores])
    moving = {one.number for one in varying}
    for one in expressions:
        if any(argument.number in moving for argument in one.operands):
            moving.add(one.number)
    kept: dict[int, Expression] = {}
    overwritten_numbers = {one.number for one in overwritten}

    def standing(value: Expression) -> Expression:
        """Return the value itself if it varies or is an element anyway, else the element that keeps it."""
        if value.number in moving or (value.operation == "load" and value.number not in overwritten_numbers):
            return value
        if value.operation == "neg":  # no work; keep its argument
            return trace.make("neg", standing(value.arguments[0]))
        if value.number not in kept:
            before.store(first + len(kept), value, base)
            kept[value.number] = trace.load(WORKSPACE, base, first + len(kept))
        return kept[value.number]

    replaced: dict[int, Expression] = {}

    def changed(value: Scalar) -> Scalar:
        if not isinstance(value, Expression):
            return value
        return replaced[value.number] if value.number in replaced else standing(value)

    for one in expressions:
        if one.number in moving and one.operation != "load":
            replaced[one.number] = trace.make(one.operation, *(changed(argument) for argument in one.arguments))
    for block in blocks:
        block.stores = [(place, offset, changed(value)) for place, offset, value in block.stores]
    return len(kept)


def _statements(stores: Sequence[tuple[str, int, Scalar]], lanes: bool, base: str = "") -> Iterator[tuple[str, bool]]:
    """Return statements, and whether they depend on a base; all do if it is empty. Others have names."""
    expressions = in_order([value for _, _, value in stores])
    standing: set[int] = set()
    for one in expressions if base else ():
        loops = one.operation == "load" and base in one.arguments[1]
        if not loops and all(operand.number in standing for operand in one.operands):
            standing.add(one.number)
    uses = Counter(one.number for expression in expressions for one in expression.operands)
    uses.update(value.number for _, _, value in stores if isinstance(value, Expression))
    texts: dict[int, tuple[str, int]] = {}  # by number: text and how strongly it binds
    written = {(place, offset) for place, offset, _ in stores}
    names = 0
    for expression in expressions:
        text, strength = _text(expression, texts, lanes)
        # An element that is written at the end must be read before.
        changed = (
            expression.operation == "load" and expression.arguments[0] == WORKSPACE and expression.arguments[1:] in written
        )
        shared = uses[expression.number] > 1 and expression.operation != "neg"
        if changed or shared or len(text) > _WIDEST or expression.number in standing:
            yield f"x{names} = {text}", expression.number not in standing
            text, strength = f"x{names}", 4
            names += 1
        texts[expression.number] = (text, strength)
    for place, offset, value in stores:
        text = texts[value.number][0] if isinstance(value, Expression) else repr(float(value))
        yield f"{_element(WORKSPACE, place, offset, lanes)} = {text}", True


def _text(expression: Expression, texts: dict[int, tuple[str, int]], lanes: bool) -> tuple[str, int]:
    """Return the text of an expression from the texts of its arguments, and how strongly it binds."""
    operation, arguments = expression.operation, expression.arguments
    if operation == "load":
        array, base, offset = arguments
        return _element(array, base, offset, lanes), 4

    def part(argument: Scalar, strength: int) -> str:
        text, binds = texts[argument.number] if isinstance(argument, Expression) else _constant(argument)
        return text if binds >= strength else f"({text})"

    if operation == "if_less":
        one, other, then, otherwise = (part(argument, 0) for argument in arguments)
        return f"where({one} < {other}, {then}, {otherwise})", 4
    strength = _STRENGTH.get(operation)
    if strength is None:
        return f"{operation}({part(arguments[0], 0)})", 4
    if operation == "neg":
        return f"-{part(arguments[0], 4)}", strength
    stronger = strength + (operation in ("-", "/"))
    return f"{part(arguments[0], strength)} {operation} {part(arguments[1], stronger)}", strength


def _constant(value: float) -> tuple[str, int]:
    return repr(float(value)), 4 if value >= 0.0 else 3


def _element(array: str, base: str, offset: int, lanes: bool) -> str:
    index = str(offset) if not base else base if offset == 0 else f"{base} + {offset}"
    if lanes and array == WORKSPACE:
        index = f"({index}) * LANES + lane" if " " in index else f"{index} * LANES + lane"
    return f"{array}[{index}]"


def width_of(places: Sequence[int | None]) -> int:
    """Return how many inputs numbers of an element are, from the place of each; None of constants."""
    return len({one for one in places if one is not None})


class TableColumns:
    """Numbers of the elements of a kind: equal ones are constants, others go into a table.

    Of tables that are inputs (`softrobots.compiled.trace.numbers.TableInputs`) they stand in the workspace.
    """

    def __init__(self, block: Block, name: str, count: int, base: str = "row") -> None:
        """Begin a table for `count` elements; `base` is the name of the place of the row of an element."""
        self._block, self._name, self._count, self._base = block, name, count, base
        self._columns: list[tuple[float, ...]] = []
        self.given: list[int | None] | None = None
        """Of a table that is an input: the place of each number in the first row in the workspace; None for constants."""
        self.seen: list[tuple[float, ...]] = []
        """The numbers so far, each of all elements."""

    def entry(self, values: Sequence[Any]) -> Scalar:
        """Return a number of an element: a constant, or a table entry for the row of the element."""
        column = tuple(float(value) for value in values)
        self.seen.append(column)
        if self.given is not None:
            place = self.given[len(self.seen) - 1]
            return column[0] if place is None else self._block.load(place, self._base)
        if len(set(column)) == 1:
            return column[0]
        if column not in self._columns:
            self._columns.append(column)
        return self._block.table(self._name, self._columns.index(column), self._base)

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
        return len(self._columns) if self.given is None else width_of(self.given)

    @property
    def numbers(self) -> list[float]:
        """The table, element by element."""
        return [column[row] for row in range(self._count) for column in self._columns]
