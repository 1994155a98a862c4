"""Expressions of the kernel language in C, with their types; every compound operand stands in parentheses."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from softrobots.compiled.c.kernel_language import INTRINSICS, Function, Module, literal_number

_ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_ON_INTS: dict[type[ast.operator], str] = {ast.FloorDiv: "int_quotient", ast.Mod: "int_remainder"}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


class Part(NamedTuple):
    """An expression in C."""

    text: str
    """Its text."""
    kind: str
    """`int`, `float`, `bool` or `none`."""
    operator: str = ""
    """Its outermost operator; empty for names, literals, elements and calls."""

    def operand(self, chained: str = "") -> str:
        """Return its text as an operand, bare if it is a chain of the operator `chained` or has no operator."""
        return self.text if self.operator in ("", chained) else f"({self.text})"


@dataclass
class Scope:
    """Names known at some place of a function, and the names of the module that the function has used so far."""

    module: Module
    """The module."""
    earlier: dict[str, Function]
    """Functions that are defined before this one."""
    prefix: str
    """Prefix of the names at the level of the file."""
    kinds: dict[str, str] = field(default_factory=dict)
    """Types of parameters and locals so far: `int`, `float`, `bool` or `array`."""
    sizes: dict[str, int] = field(default_factory=dict)
    """Lengths of local arrays."""
    local_names: set[str] = field(default_factory=set)
    """All parameters and locals; in the function they hide names of the module."""
    needs: set[str] = field(default_factory=set)
    """Functions, constants and intrinsics that the function uses."""

    def global_name(self, name: str) -> str:
        """Return the name in C of something at the level of the file, and note that it is needed."""
        self.needs.add(name)
        return self.prefix + name

    def value(self, node: ast.expr) -> Part:
        """Translate an expression that has a value.

        Raises:
            ParameterError: If it is outside the kernel language.
        """
        literal = literal_number(self.module.text, node)
        if literal is not None:
            return Part(repr(literal), type(literal).__name__)
        match node:
            case ast.Constant(value=bool() as truth):
                return Part(str(int(truth)), "bool")
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Subscript():
                return self.element(node)
            case ast.Call():
                called = self.call(node)
                if called.kind == "none":
                    self.module.refuse(node, "a function that returns None is called as a statement of its own")
                return called
            case ast.BinOp(left=left, op=operator, right=right):
                return self.arithmetic(node, self.value(left), operator, self.value(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                negated = self._number(operand)
                return Part(f"-{negated.operand()}", negated.kind, "negation")
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Part(f"!{self.condition(operand).operand()}", "bool", "!")
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISONS:
                sign = _COMPARISONS[type(operator)]
                one, other = _alike(self._number(left), self._number(right))
                return Part(f"{one.operand()} {sign} {other.operand()}", "bool", sign)
            case ast.BoolOp(op=operation, values=values):
                parts = [self.value(value) for value in values]
                if any(part.kind != "bool" for part in parts):
                    self.module.refuse(node, "`and` and `or` join comparisons and other bools")
                return _joined(operation, iter(parts))
            case ast.IfExp(test=test, body=body, orelse=otherwise):
                chosen = self.condition(test).operand()
                one, other = _alike(self.value(body), self.value(otherwise))
                if "bool" in (one.kind, other.kind) and one.kind != other.kind:
                    self.module.refuse(node, "`a if c else b` gives a number, or a bool")
                return Part(f"{chosen} ? {one.operand()} : {other.operand()}", one.kind, "?")
        self.module.refuse(
            node,
            "numbers, names, array[index], calls by position, + - * / // % on numbers, one comparison at a time, and, or, not, "
            "`a if c else b`",
        )

    def condition(self, node: ast.expr) -> Part:
        """Translate the condition of a branch or a loop: a bool, or an int that may be zero."""
        if isinstance(node, ast.BoolOp):
            return _joined(node.op, map(self.condition, node.values))
        part = self.value(node)
        if part.kind not in ("bool", "int"):
            self.module.refuse(node, "a condition is a comparison, a bool or an int")
        return part

    def arithmetic(self, node: ast.AST, left: Part, operator: ast.operator, right: Part) -> Part:
        """Translate an operation on two numbers; `node` is its place in the text."""
        if "bool" in (left.kind, right.kind):
            self.module.refuse(node, "arithmetic is on numbers; where(condition, a, b) makes a number of a bool")
        ints = left.kind == right.kind == "int"
        if type(operator) in _ON_INTS:
            if not ints:
                self.module.refuse(node, "// and % are for ints; floor(x / y) serves for floats")
            return Part(f"{self.global_name(_ON_INTS[type(operator)])}({left.text}, {right.text})", "int")
        if type(operator) not in _ARITHMETIC:
            self.module.refuse(node, "operations on numbers are + - * /, on ints also // and %")
        sign = _ARITHMETIC[type(operator)]
        if ints and sign == "/":
            ints, left = False, Part(f"(double){left.operand()}", "float", "cast")
        if not ints:
            left, right = as_float(left), as_float(right)
        return Part(f"{left.operand(sign)} {sign} {right.operand()}", "int" if ints else "float", sign)

    def element(self, node: ast.Subscript, *, store: bool = False) -> Part:
        """Translate an element of an array or a table."""
        if not isinstance(node.value, ast.Name):
            self.module.refuse(node, "an element is name[index]")
        name = node.value.id
        table = self.module.constants.get(name)
        if self.kinds.get(name) == "array":
            size, kind, shown = self.sizes.get(name), "float", name
        elif name not in self.local_names and isinstance(table, tuple) and not store:
            size, kind, shown = len(table), type(table[0]).__name__, self.global_name(name)
        else:
            self.module.refuse(node, f"an element of an array{'' if store else ' or a table'}; {name!r} is none here")
        index = self.value(node.slice)
        if index.kind != "int":
            self.module.refuse(node, "an index is an int")
        known = self.known_int(node.slice)
        if known is not None and not 0 <= known < (known + 1 if size is None else size):
            self.module.refuse(node, "an index is not negative" + (f" and below {size}" if size is not None else ""))
        return Part(f"{shown}[{index.text}]", kind)

    def call(self, node: ast.Call) -> Part:
        """Translate a call of a function of the module or of an intrinsic."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if node.keywords or name in self.local_names or (name not in self.earlier and name not in INTRINSICS):
            known = ", ".join((*INTRINSICS, *self.earlier))
            self.module.refuse(node, f"a call, by position, of a function that is defined above; here: {known}")
        if name in INTRINSICS:
            condition = 1 if name == "where" else 0
            self._count(node, name, INTRINSICS[name])
            shown = [self.condition(argument).text for argument in node.args[:condition]]
            shown += [as_float(self._number(argument)).text for argument in node.args[condition:]]
            return Part(f"{self.global_name(name)}({', '.join(shown)})", "float")
        function = self.earlier[name]
        self._count(node, name, len(function.parameters))
        shown = []
        for argument, parameter in zip(node.args, function.parameters, strict=True):
            if parameter.kind == "array":
                if not isinstance(argument, ast.Name) or self.kinds.get(argument.id) != "array":
                    self.module.refuse(node, f"for {parameter.name} of {name} the name of an array")
                shown.append(argument.id)
            else:
                shown.append(self.fitting(argument, self.value(argument), parameter.kind, parameter.name).text)
        return Part(f"{self.global_name(name)}({', '.join(shown)})", function.returns)

    def fitting(self, node: ast.AST, part: Part, kind: str, name: str) -> Part:
        """Return the part as a value of type `kind`, for `name`.

        Raises:
            ParameterError: If it is of another type; a float takes ints, an int takes bools.
        """
        if kind == "float" and part.kind == "int":
            return as_float(part)
        if part.kind != kind and (kind, part.kind) != ("int", "bool"):
            self.module.refuse(node, f"{name} has one type, here {kind}; this is of type {part.kind}")
        return part

    def known_int(self, node: ast.expr) -> int | None:
        """Return the value of an expression of int literals and constants; None for others."""
        match node:
            case ast.Constant(value=value) if type(value) is int:
                return value
            case ast.Name(id=name) if name not in self.local_names:
                named = self.module.constants.get(name)
                return named if isinstance(named, int) else None
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.known_int(operand)
                return None if inner is None else -inner
            case ast.BinOp(left=left, op=operator, right=right):
                one, other = self.known_int(left), self.known_int(right)
                if one is not None and other is not None:
                    match operator:
                        case ast.Add():
                            return one + other
                        case ast.Sub():
                            return one - other
                        case ast.Mult():
                            return one * other
        return None

    def _name(self, node: ast.expr, name: str) -> Part:
        constant = self.module.constants.get(name)
        if self.kinds.get(name, "array") != "array":
            return Part(name, self.kinds[name])
        if name not in self.local_names and constant is not None and not isinstance(constant, tuple):
            return Part(self.global_name(name), type(constant).__name__)
        self.module.refuse(node, f"a number that is given above in the text; {name!r} is none here")

    def _number(self, node: ast.expr) -> Part:
        part = self.value(node)
        if part.kind == "bool":
            self.module.refuse(node, "a number; where(condition, a, b) makes one of a bool")
        return part

    def _count(self, node: ast.Call, name: str, count: int) -> None:
        if len(node.args) != count or any(isinstance(argument, ast.Starred) for argument in node.args):
            self.module.refuse(node, f"{name} takes {count} argument{'' if count == 1 else 's'}")


def _joined(operation: ast.boolop, parts: Iterator[Part]) -> Part:
    sign = "&&" if isinstance(operation, ast.And) else "||"
    return Part(f" {sign} ".join(part.operand() for part in parts), "bool", sign)


def as_float(part: Part) -> Part:
    """Return the part where C wants a double: an int literal as a float literal; C converts other ints by itself."""
    return Part(f"{part.text}.0", "float") if part.text.isdigit() else part


def _alike(one: Part, other: Part) -> tuple[Part, Part]:
    """Return two numbers as C compares or chooses them: both floats if one of them is."""
    if one.kind == other.kind:
        return one, other
    one, other = (as_float(part)._replace(kind="float") if part.kind == "int" else part for part in (one, other))
    return one, other
