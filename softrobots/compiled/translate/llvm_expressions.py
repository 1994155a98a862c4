"""Expressions of the kernel language as text for LLVM, with their types, as `softrobots.compiled.translate.llvm` needs them."""

from __future__ import annotations

import ast
import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from llvmlite import ir

from softrobots.compiled.translate.kernel_language import INTRINSICS, Function, walk

FASTMATH = ("contract", "arcp", "nsz")
"""What LLVM may do with floating-point operations: nothing that changes an answer by more than a rounding."""

TYPES: Mapping[str, ir.Type] = {
    "float": ir.DoubleType(),
    "int": ir.IntType(64),
    "bool": ir.IntType(1),
    "none": ir.VoidType(),
    "array": ir.DoubleType().as_pointer(),
    "pair": ir.VectorType(ir.DoubleType(), 2),
    "pair of bools": ir.VectorType(ir.IntType(1), 2),
    "eight": ir.VectorType(ir.DoubleType(), 8),
    "row": ir.VectorType(ir.DoubleType(), 12),
}
"""Types of LLVM by those of the kernel language, of pairs, eights and rows."""

NAMES = {kind: str(of) for kind, of in TYPES.items()}
"""Their names."""
POINTERS = {kind: str(of.as_pointer()) for kind, of in TYPES.items() if kind != "none"}
"""Names of the types of pointers to them; newer versions of LLVM have one for all."""
PAIRED = {"float": "pair", "bool": "pair of bools"}
"""Types of pairs."""

_FLAGS = " ".join(FASTMATH)
_ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
_COMPARISONS: dict[type[ast.cmpop], tuple[str, str]] = {  # of ints, of floats
    ast.Eq: ("eq", "oeq"),
    ast.NotEq: ("ne", "une"),
    ast.Lt: ("slt", "olt"),
    ast.LtE: ("sle", "ole"),
    ast.Gt: ("sgt", "ogt"),
    ast.GtE: ("sge", "oge"),
}


class Value(NamedTuple):
    """A number, a bool, a pair of either, or eight or a row of numbers."""

    text: str
    """Its name or literal."""
    kind: str
    """Its type."""

    def __str__(self) -> str:
        """Type and text."""
        return f"{NAMES[self.kind]} {self.text}"


class Symbols:
    """Functions and tables of a text that have been needed so far."""

    def __init__(self, functions: Mapping[str, Function], constants: Mapping[str, Any], prefix: str) -> None:
        """Begin without any; their symbols begin with the prefix."""
        self.functions, self.constants, self._prefix = functions, constants, prefix
        self.needed: dict[str, tuple[str, bool]] = {}
        """Names of functions by symbol, and whether they are of pairs."""
        self.declared: dict[str, str] = {}
        """Lines that declare tables and functions of LLVM, by symbol."""
        self._tables: dict[str, tuple[str, str, str]] = {}

    def function(self, name: str, *, paired: bool) -> str:
        """Return the symbol of a function, of numbers or of pairs."""
        symbol = f'@"{self._prefix}{name}{".pairs" if paired else ""}"'
        self.needed[symbol] = name, paired
        return symbol

    def table(self, name: str) -> tuple[str, str, str]:
        """Return symbol, type and kind of numbers of a table."""
        if name not in self._tables:
            symbol, values = f'@"{self._prefix}{name}"', [literal(value) for value in self.constants[name]]
            shape = f"[{len(values)} x {NAMES[values[0].kind]}]"
            self.declared[symbol] = f"{symbol} = linkonce_odr constant {shape} [{', '.join(map(str, values))}]"
            self._tables[name] = symbol, shape, values[0].kind
        return self._tables[name]

    def intrinsic(self, name: str, kind: str) -> str:
        """Return the symbol of a function of LLVM."""
        symbol = f"@llvm.{name}.{'' if kind == 'float' else f'v{TYPES[kind].count}'}f64"
        self.declared[symbol] = f"declare {NAMES[kind]} {symbol}({NAMES[kind]})"
        return symbol


def literal(value: float | bool) -> Value:
    """Return a number or a bool that is known."""
    if isinstance(value, bool):
        return Value(str(value).lower(), "bool")
    if isinstance(value, int):
        return Value(str(value), "int")
    return Value(f"0x{struct.pack('>d', value).hex()}", "float")


class ExpressionWriter:
    """Writes expressions, line by line."""

    def __init__(self, symbols: Symbols, stored: Mapping[str, int]) -> None:
        """Begin a function; `stored`: how often each of its names is assigned, parameters once more."""
        self.symbols = symbols
        self.lines: list[str] = []
        """Lines so far."""
        self.at_top: list[str] = []
        """Lines that stand before them."""
        self.values: dict[str, Value] = {}
        """Names that are assigned once."""
        self.apart = "", ""
        """Variable of the loop whose rounds are done at once, and the type of the elements of all of them."""
        self._count = 0  # of names and labels
        self._places: dict[str, Value] = {}  # of names that are assigned more than once
        self._stored = stored

    def labels(self, *names: str) -> list[str]:
        """Return new labels."""
        self._count += 1
        return [f"{name}.{self._count}" for name in names]

    def begin(self, label: str) -> None:
        """Begin the block of a label."""
        self.lines.append(f"{label}:")

    def jump(self, label: str, other: str = "", condition: Value | None = None) -> None:
        """End a block: go to a label, or to another one if a condition does not hold."""
        self.lines.append(f"br label %{label}" if condition is None else f"br {condition}, label %{label}, label %{other}")

    def keep(self, name: str, value: Value) -> None:
        """Assign to a name; it keeps the type of its first value."""
        if self._stored[name] == 1:
            self.values[name] = value
            return
        if name not in self._places:
            self._places[name] = Value(f"%place.{name}", value.kind)
            self.at_top.append(f"%place.{name} = alloca {NAMES[value.kind]}")
        place = self._places[name]
        self.lines.append(f"store {self.cast(place.kind, value)}, {POINTERS[place.kind]} {place.text}")

    def new(self, operation: str, kind: str) -> Value:
        """Name the result of an operation."""
        self._count += 1
        self.lines.append(f"%.{self._count} = {operation}")
        return Value(f"%.{self._count}", kind)

    def value(self, node: ast.expr) -> Value:
        """Write an expression."""
        match node:
            case ast.Name(id=name):
                return self.name(name)
            case ast.Subscript():
                place, kind = self.element(node)
                return self.new(f"load {NAMES[kind]}, {place}, align 8", kind)
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return self._call(name, [self.value(one) for one in arguments])
            case ast.BinOp(left=left, op=operation, right=right):
                return self.arithmetic(operation, self.value(left), self.value(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                value = self.value(operand)
                return self.new(f"sub nsw i64 0, {value.text}" if value.kind == "int" else f"fneg {_FLAGS} {value}", value.kind)
            case ast.UnaryOp(operand=operand):
                return self.new(f"xor {self.value(operand)}, true", "bool")
            case ast.Compare(left=left, ops=[comparison], comparators=[right]):
                return self._comparison(comparison, self.value(left), self.value(right))
            case ast.BoolOp(op=operation, values=values):
                return self._together(values, isinstance(operation, ast.And))
        return literal(node.value)  # type: ignore[attr-defined]

    def name(self, name: str) -> Value:
        """Read a local, a parameter or a constant."""
        if name in self._places:
            place = self._places[name]
            return self.new(f"load {NAMES[place.kind]}, {POINTERS[place.kind]} {place.text}", place.kind)
        return self.values[name] if name in self.values else literal(self.symbols.constants[name])

    def element(self, node: ast.Subscript) -> tuple[str, str]:
        """Return pointer to, and kind of, an element of an array or a table, or of both stages of one."""
        name, index = node.value.id, self.value(node.slice)  # type: ignore[attr-defined]
        if name not in self.values:
            symbol, shape, kind = self.symbols.table(name)
            pointer = POINTERS[kind].replace(NAMES[kind], shape)
            place = self.new(f"getelementptr inbounds {shape}, {pointer} {symbol}, i64 0, {index}", kind)
            return f"{POINTERS[kind]} {place.text}", kind
        place = self.new(f"getelementptr inbounds double, {self.values[name]}, {index}", "array")
        variable, kind = self.apart
        if kind and any(isinstance(one, ast.Name) and one.id == variable for one in walk(node.slice)):
            place = self.new(f"bitcast {place} to {POINTERS[kind]}", "array")
            return f"{POINTERS[kind]} {place.text}", kind
        return str(place), "float"

    def _together(self, conditions: Sequence[ast.expr], are_all: bool) -> Value:
        """Return whether all conditions hold, or any; those behind the one that decides are not looked at."""
        (end,), decided = self.labels("end"), []
        for condition in conditions:
            found, (here, behind) = self.value(condition), self.labels("here", "behind")
            self.jump(here)
            self.begin(here)
            decided.append(f"[{found.text}, %{here}]")
            self.jump(*((behind, end) if are_all else (end, behind)), found)
            self.begin(behind)
        decided.append(f"[{str(are_all).lower()}, %{behind}]")
        self.jump(end)
        self.begin(end)
        return self.new(f"phi i1 {', '.join(decided)}", "bool")

    def cast(self, kind: str, value: Value) -> Value:
        """Return a value as one of another kind: an int as a float, a number as a pair or row of equal ones."""
        if value.kind == kind:
            return value
        if value.kind == "int":
            known = value.text.isdigit()
            value = literal(float(value.text)) if known else self.new(f"sitofp {value} to double", "float")
        if kind == "float":
            return value
        single, count = self.new(f"insertelement {NAMES[kind]} undef, {value}, i32 0", kind), TYPES[kind].count
        return self.new(f"shufflevector {single}, {NAMES[kind]} undef, <{count} x i32> zeroinitializer", kind)

    def _alike(self, *values: Value) -> tuple[list[Value], str]:
        kind = next((one.kind for one in values if one.kind in ("pair", "eight", "row")), "float")
        return [self.cast(kind, one) for one in values], kind

    def arithmetic(self, operation: ast.operator, one: Value, other: Value) -> Value:
        """Write an operation on two numbers."""
        name = _ARITHMETIC[type(operation)]
        if one.kind == other.kind == "int" and name != "div":
            return self.new(f"{name} nsw {one}, {other.text}", "int")
        (one, other), kind = self._alike(one, other)
        return self.new(f"f{name} {_FLAGS} {one}, {other.text}", kind)

    def _comparison(self, comparison: ast.cmpop, one: Value, other: Value) -> Value:
        of_ints, of_floats = _COMPARISONS[type(comparison)]
        if one.kind == other.kind == "int":
            return self.new(f"icmp {of_ints} {one}, {other.text}", "bool")
        (one, other), kind = self._alike(one, other)
        return self.new(f"fcmp {_FLAGS} {of_floats} {one}, {other.text}", PAIRED["bool"] if kind == "pair" else "bool")

    def _call(self, name: str, given: Sequence[Value]) -> Value:
        paired = any(one.kind in PAIRED.values() for one in given)
        if name == "where":
            ways = [self.cast("pair" if paired else "float", one) for one in given[1:]]
            return self.new(f"select {given[0]}, {ways[0]}, {ways[1]}", ways[0].kind)
        if name in INTRINSICS:
            (value,), kind = self._alike(*given)
            return self.new(f"call {_FLAGS} {NAMES[kind]} {self.symbols.intrinsic(name, kind)}({value})", kind)
        function, kinds = self.symbols.functions[name], PAIRED if paired else {}
        returns = kinds.get(function.returns, function.returns)
        parameters = zip(function.parameters, given, strict=True)
        passed = ", ".join(str(self.cast(kinds.get(one.kind, one.kind), value)) for one, value in parameters)
        called = f"{NAMES[returns]} {self.symbols.function(name, paired=paired)}({passed})"
        if returns == "none":
            self.lines.append(f"call {called}")
            return Value("", returns)
        return self.new(f"call {called}", returns)
