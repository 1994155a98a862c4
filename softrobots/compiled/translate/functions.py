"""Translated functions of the kernel language: statements, declarations and the order of evaluation.

Python has one scope in a function, C and JavaScript have one in each block: a local is declared with its first assignment if
that stands in the function's own block, else at the top, as zero.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from softrobots.compiled.translate.dialect import Dialect, Part
from softrobots.compiled.translate.expressions import Scope
from softrobots.compiled.translate.kernel_language import WORDS, Function, Module, Parameter, read_module, rounds_apart, walk
from softrobots.compiled.translate.lines import INDENT, comment


class FunctionWriter:
    """Writes one function."""

    def __init__(self, function: Function, scope: Scope) -> None:
        """Prepare to write `function`; `scope` is that of the module, with all that is defined before the function."""
        self.function, self.scope, self._module, self._dialect = function, scope, scope.module, scope.dialect
        self._at_top: list[str] = []  # locals to declare there
        self._lines: list[str] = []
        self._bounds = 0  # of loops, so far
        parameters = [parameter.name for parameter in function.parameters]
        names = _names(function.body)
        self._stored = Counter(node.id for node in names if isinstance(node.ctx, ast.Store))
        self._read = {node.id for node in names if isinstance(node.ctx, ast.Load)}
        self._check_loops(parameters)
        for name in (*parameters, *self._stored):
            self._check_name(name)
        scope.kinds.update({parameter.name: parameter.kind for parameter in function.parameters})

    def text(self, *, external: bool) -> str:
        """Return the translated function; `external`: it can be called from other files.

        Raises:
            ParameterError: If a statement is outside the kernel language.
        """
        function, kinds = self.function, self.scope.kinds
        self._block(function.body, INDENT)
        if function.returns != "none" and not _ends(function.body):
            self._module.refuse(function.node, f"{function.name} returns a value on every way through it")
        lines = comment(function.docstring.splitlines()).splitlines() if function.docstring else []
        declared = [
            f"{INDENT}{self._dialect.declaration(kinds[name])}{name} = {'0.0' if kinds[name] == 'float' else '0'};"
            for name in self._at_top
        ]
        local = [*(parameter.name for parameter in function.parameters), *self._at_top]
        unused = [INDENT + line for line in self._dialect.unused([name for name in local if name not in self._read])]
        text = (self._dialect.head(function, external=external), "{", *declared, *unused, *self._lines, "}")
        return "\n".join([*lines, *(short for line in text for short in self._dialect.lines(line))])

    def _check_name(self, name: str) -> None:
        prefix = self._dialect.prefix
        taken = name in (*WORDS, *self._dialect.reserved, *self._module.constants, *self._module.functions)
        if taken or not name.isascii() or re.match(rf"_[_A-Z]|stop_|{re.escape(prefix)}", name):
            self._module.refuse(
                self.function.node,
                "a parameter or local has an ASCII name that is no keyword, no word of the language, no other name of the "
                f"module, and does not begin with _A, __, stop_ or {prefix}; {name} does not fit",
            )

    def _check_loops(self, parameters: Sequence[str]) -> None:
        """Refuse variables of `for` that are used outside of their loops, or assigned in them: C counts on after the last."""
        inside: Counter[str] = Counter()
        loops = [node for statement in self.function.body for node in walk(statement) if isinstance(node, ast.For)]
        for loop in loops:
            if isinstance(loop.target, ast.Name):
                name = loop.target.id
                stored = any(node.id == name and isinstance(node.ctx, ast.Store) for node in _names(loop.body))
                if stored or name in parameters or _counts([loop.iter])[name]:
                    self._module.refuse(loop, f"{name} counts this loop, and is neither a parameter nor assigned in it")
                inside[name] += _counts([loop])[name]
        counts = _counts(self.function.body)
        for loop in loops:
            if isinstance(loop.target, ast.Name) and inside[loop.target.id] != counts[loop.target.id]:
                self._module.refuse(loop, f"{loop.target.id} counts this loop, and is used in such loops only")

    def _block(self, block: Sequence[ast.stmt], indent: str) -> None:
        for statement in block:
            self._statement(statement, indent)

    def _statement(self, node: ast.stmt, indent: str) -> None:
        match node:
            case ast.Pass():
                pass
            case ast.Break():
                self._lines.append(f"{indent}break;")
            case ast.Return(value=value):
                self._return(node, value, indent)
            case ast.Expr(value=ast.Call() as called):
                self._ordered(node)
                part = self.scope.call(called)
                self._lines.append(f"{indent}{part.text if part.kind == 'none' else self._dialect.ignored(part.text)};")
            case ast.Assign(targets=[ast.Name() | ast.Subscript() as target], value=value):
                self._ordered(node)
                self._assign(node, target, self.scope.value(value), indent)
            case ast.AugAssign(target=ast.Name() | ast.Subscript() as target, op=operation, value=value):
                self._ordered(node)
                part = self.scope.arithmetic(node, self.scope.value(target), operation, self.scope.value(value))
                self._assign(node, target, part, indent)
            case ast.If():
                self._branch(node, indent, "if")
            case ast.While(test=test, body=body, orelse=[]):
                self._ordered(test)
                self._lines.append(f"{indent}while ({self.scope.condition(test).text}) {{")
                self._block(body, indent + INDENT)
                self._lines.append(f"{indent}}}")
            case ast.For(
                target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=limits, keywords=[]), orelse=[]
            ):
                self._for(node, name, limits, indent)
            case _:
                self._module.refuse(
                    node,
                    "statements are name = value, array[index] = value, += -= *= /=, calls, if, while, for name in range(...), "
                    "break, return and pass",
                )

    def _return(self, node: ast.stmt, value: ast.expr | None, indent: str) -> None:
        wanted = self.function.returns
        if (value is None) != (wanted == "none"):
            self._module.refuse(
                node, f"{self.function.name} returns {'nothing' if wanted == 'none' else f'a value ({wanted})'}"
            )
        if value is None:
            self._lines.append(f"{indent}return;")
            return
        self._ordered(node)
        part = self.scope.fitting(node, self.scope.value(value), wanted, f"the value of {self.function.name}")
        self._lines.append(f"{indent}return {part.text};")

    def _assign(self, node: ast.stmt, target: ast.Name | ast.Subscript, part: Part, indent: str) -> None:
        if isinstance(target, ast.Subscript):
            element = self.scope.element(target, store=True)
            fitting = self.scope.fitting(node, part, "float", element.text)
            self._lines.append(f"{indent}{element.text} = {fitting.text};")
            return
        name, declaration = target.id, ""
        fitting = self.scope.fitting(node, part, self.scope.kinds.get(name, part.kind), name)
        if name not in self.scope.kinds:
            self.scope.kinds[name] = part.kind
            if indent == INDENT and name in self._read:
                declaration = self._dialect.declaration(part.kind, constant=self._stored[name] == 1)
            else:
                self._at_top.append(name)
        self._lines.append(f"{indent}{declaration}{name} = {fitting.text};")

    def _branch(self, node: ast.If, indent: str, word: str) -> None:
        self._ordered(node.test)
        self._lines.append(f"{indent}{word} ({self.scope.condition(node.test).text}) {{")
        self._block(node.body, indent + INDENT)
        match node.orelse:
            case []:
                self._lines.append(f"{indent}}}")
            case [ast.If() as other]:
                self._branch(other, indent, "} else if")
            case _:
                self._lines.append(f"{indent}}} else {{")
                self._block(node.orelse, indent + INDENT)
                self._lines.append(f"{indent}}}")

    def _for(self, node: ast.For, name: str, limits: Sequence[ast.expr], indent: str) -> None:
        if not 1 <= len(limits) <= 2:
            self._module.refuse(node, "a range has one or two ints")
        parts = [self.scope.value(limit) for limit in limits]
        if any(part.kind != "int" for part in parts):
            self._module.refuse(node, "a range is of ints")
        start, bound = ("0" if len(parts) == 1 else parts[0].text), parts[-1].text
        if self.scope.known_int(limits[-1]) is None:  # Python looks at it once
            self._bounds += 1
            bound = f"stop_{self._bounds}"
            self._lines.append(f"{indent}{self._dialect.declaration('int', constant=True)}{bound} = {parts[-1].text};")
        self.scope.kinds[name] = "int"
        if rounds_apart(node):
            self._lines.extend(f"{indent}{line}" for line in self._dialect.rounds_apart.splitlines())
        self._lines.append(
            f"{indent}for ({self._dialect.declaration('int')}{name} = {start}; {name} < {bound}; {name} += 1) {{"
        )
        self._block(node.body, indent + INDENT)
        self._lines.append(f"{indent}}}")

    def _ordered(self, node: ast.AST) -> None:
        """Refuse what depends on the order of computation: Python goes from left to right, C as it likes.

        An array that a call changes may be read by the same statement in the arguments of the call only.
        """
        if isinstance(node, ast.BoolOp):  # `and` and `or` go from left to right in C, too
            for value in node.values:
                self._ordered(value)
            return
        parts = walk(node)
        calls = [part for part in parts if isinstance(part, ast.Call) and any(one.written for one in self._parameters(part))]
        if not calls:
            return
        inside = {id(part) for part in walk(calls[0])}
        for part in parts:
            reads = isinstance(part, ast.Subscript) and isinstance(part.ctx, ast.Load)
            reads = reads or any(one.kind == "array" for one in self._parameters(part))
            reads = reads or (isinstance(part, ast.AugAssign) and isinstance(part.target, ast.Subscript))
            if len(calls) > 1 or (reads and id(part) not in inside):
                self._module.refuse(calls[0], "a call that writes an array stands in a statement without other array accesses")

    def _parameters(self, node: ast.AST) -> tuple[Parameter, ...]:
        """Return the parameters of the function that is called here, if any is."""
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in self.scope.earlier:
                return self.scope.earlier[name].parameters
        return ()


def _ends(block: Sequence[ast.stmt]) -> bool:
    """Whether every way through a block ends in a return."""
    match block[-1] if block else None:
        case ast.Return():
            return True
        case ast.If(body=body, orelse=otherwise):
            return _ends(body) and _ends(otherwise)
    return False


def _names(block: Sequence[ast.AST]) -> list[ast.Name]:
    return [node for part in block for node in walk(part) if isinstance(node, ast.Name)]


def _counts(block: Sequence[ast.AST]) -> Counter[str]:
    """Return how often each name stands in a piece of the text."""
    return Counter(node.id for node in _names(block))


class Translated(NamedTuple):
    """A translated module."""

    module: Module
    """The module."""
    bodies: list[str]
    """Text of each function that is needed, in the order of the module."""
    needed: set[str]
    """Names of functions, constants and intrinsics that are exported, or used by what is."""


def translated(text: str, dialect: Dialect, exported: Sequence[str]) -> Translated:
    """Translate what the exported functions of a module need.

    Raises:
        ParameterError: If any of the text is outside the kernel language; the error names the line.
    """
    module = read_module(text)
    scopes: dict[str, Scope] = {}
    bodies = {}
    for name, function in module.functions.items():
        earlier = {other: module.functions[other] for other in scopes}
        scopes[name] = Scope(module, earlier, dialect)
        try:
            bodies[name] = FunctionWriter(function, scopes[name]).text(external=name in exported)
        except RecursionError:
            module.refuse(function.node, "expressions and blocks are not as deep as here: name some parts")
    needed = set(exported)
    for name in reversed(scopes):  # whatever a function calls stands before it
        if name in needed:
            needed |= scopes[name].needs
    return Translated(module, [body for name, body in bodies.items() if name in needed], needed)
