"""Translated expressions of the kernel language, with their types; every compound operand stands in parentheses."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from dataclasses import dataclass, field

from softrobots.compiled.translate.dialect import Dialect, Part, bare
from softrobots.compiled.translate.kernel_language import INTRINSICS, Function, Module, walk

_ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_ON_KNOWN: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


@dataclass
class Scope:
    """Names known at some place of a function, and the names of the module that the function has used so far."""

    module: Module
    """The module."""
    earlier: dict[str, Function]
    """Functions that are defined before this one."""
    dialect: Dialect
    """The language that it is translated to."""
    kinds: dict[str, str] = field(default_factory=dict)
    """Types of parameters and locals so far: `int`, `float`, `bool` or `array`."""
    needs: set[str] = field(default_factory=set)
    """Functions, constants and intrinsics that the function uses."""

    def global_name(self, name: str) -> str:
        """Return the translated name of something at the level of the file, and note that it is needed."""
        self.needs.add(name)
        return self.dialect.prefix + name

    def value(self, node: ast.expr) -> Part:
        """Translate an expression that has a value.

        Raises:
            ParameterError: If it is outside the kernel language.
        """
        literal = self.module.literal(node)
        if literal is not None:
            return Part(repr(literal), type(literal).__name__)
        match node:
            case ast.Constant(value=bool() as truth):
                return Part(self.dialect.truth(truth), "bool")
            case ast.Name(id=name):
                return self._name(node, name)
            case ast.Subscript():
                return self.element(node)
            case ast.Call():
                called = self.call(node)
                if called.kind == "none":
                    self.module.refuse(node, "a function that returns None is called as a statement of its own")
                return called
            case ast.BinOp(left=left, op=operation, right=right):
                return self.arithmetic(node, self.value(left), operation, self.value(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.dialect.negated(self._number(operand))
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Part(f"!{self.condition(operand).operand()}", "bool", "!")
            case ast.Compare(left=left, ops=[comparison], comparators=[right]) if type(comparison) in _COMPARISONS:
                sign = _COMPARISONS[type(comparison)]
                one, other = self._number(left), self._number(right)
                if one.kind != other.kind:
                    one, other = one.as_float(), other.as_float()
                return Part(f"{one.operand()} {sign} {other.operand()}", "bool", sign)
            case ast.BoolOp(op=operation, values=values):
                sign = "&&" if isinstance(operation, ast.And) else "||"
                return Part(f" {sign} ".join(self.condition(value).operand() for value in values), "bool", sign)
        self.module.refuse(
            node, "numbers, names, array[index], calls by position, + - * / on numbers, one comparison at a time, and, or, not"
        )

    def condition(self, node: ast.expr) -> Part:
        """Translate a condition."""
        part = self.value(node)
        if part.kind != "bool":
            self.module.refuse(node, "a condition is a comparison or another bool")
        return part

    def arithmetic(self, node: ast.AST, left: Part, operation: ast.operator, right: Part) -> Part:
        """Translate an operation on two numbers; `node` is its place in the text."""
        if "bool" in (left.kind, right.kind):
            self.module.refuse(node, "arithmetic is on numbers; where(condition, a, b) makes a number of a bool")
        if type(operation) not in _ARITHMETIC:
            self.module.refuse(node, "operations on numbers are + - * /")
        sign = _ARITHMETIC[type(operation)]
        if left.kind == right.kind == "int":
            return self.dialect.arithmetic(left, sign, right)
        return bare(left.as_float(), sign, right.as_float())

    def element(self, node: ast.Subscript, *, store: bool = False) -> Part:
        """Translate an element of an array or a table."""
        if not isinstance(node.value, ast.Name):
            self.module.refuse(node, "an element is name[index]")
        name, size = node.value.id, None
        table = self.module.constants.get(name)
        if self.kinds.get(name) == "array":
            kind, shown = "float", name
        elif isinstance(table, tuple) and not store:
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
        function = self.earlier.get(name)
        if node.keywords or (function is None and name not in INTRINSICS):
            known = ", ".join((*INTRINSICS, *self.earlier))
            self.module.refuse(node, f"a call, by position, of a function that is defined above; here: {known}")
        kinds = INTRINSICS[name] if function is None else [parameter.kind for parameter in function.parameters]
        if len(node.args) != len(kinds) or any(isinstance(argument, ast.Starred) for argument in node.args):
            self.module.refuse(node, f"{name} takes {len(kinds)} argument{'' if len(kinds) == 1 else 's'}")
        shown = [self._argument(argument, kind, name) for argument, kind in zip(node.args, kinds, strict=True)]
        if function is None:
            called = (getattr(one.func, "id", "") for one in walk(node) if isinstance(one, ast.Call))
            inside = [parameter for one in called if one in self.earlier for parameter in self.earlier[one].parameters]
            if any(parameter.written for parameter in inside):
                self.module.refuse(node, f"a call that writes an array stands outside of {name}")
            self.needs.add(name)
            return self.dialect.intrinsic(name, shown)
        return Part(f"{self.global_name(name)}({', '.join(shown)})", function.returns)

    def fitting(self, node: ast.AST, part: Part, kind: str, name: str) -> Part:
        """Return the part as a value of type `kind`, for `name`.

        Raises:
            ParameterError: If it is of another type; a float takes ints.
        """
        if kind == "float" and part.kind == "int":
            return part.as_float()
        if part.kind != kind:
            self.module.refuse(node, f"{name} has one type, here {kind}; this is of type {part.kind}")
        return part

    def known_int(self, node: ast.expr) -> int | None:
        """Return the value of an expression of int literals and constants; None for others."""
        match node:
            case ast.Constant(value=value) if type(value) is int:
                return value
            case ast.Name(id=name):
                named = self.module.constants.get(name)
                return named if isinstance(named, int) else None
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                inner = self.known_int(operand)
                return None if inner is None else -inner
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _ON_KNOWN:
                one, other = self.known_int(left), self.known_int(right)
                return None if one is None or other is None else _ON_KNOWN[type(operation)](one, other)
        return None

    def _argument(self, node: ast.expr, kind: str, name: str) -> str:
        """Return an argument of type `kind` of the function `name`."""
        if kind == "bool":
            return self.condition(node).text
        if kind != "array":
            return self.fitting(node, self.value(node), kind, f"an argument of {name}").text
        if not isinstance(node, ast.Name) or self.kinds.get(node.id) != "array":
            self.module.refuse(node, f"{name} takes the name of an array")
        return node.id

    def _name(self, node: ast.expr, name: str) -> Part:
        constant = self.module.constants.get(name)
        if self.kinds.get(name, "array") != "array":
            return Part(name, self.kinds[name])
        if constant is not None and not isinstance(constant, tuple):
            return Part(self.global_name(name), type(constant).__name__)
        self.module.refuse(node, f"a number that is given above in the text; {name!r} is none here")

    def _number(self, node: ast.expr) -> Part:
        part = self.value(node)
        if part.kind == "bool":
            self.module.refuse(node, "a number; where(condition, a, b) makes one of a bool")
        return part
