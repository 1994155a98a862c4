"""The kernel language as text for LLVM: machine code without numba's search for types, which takes most of its time.

Loops over both stages of a step, over those of four sections, or over twelve components (`softrobots.compiled.trace.blocks`)
become straight-line code with pairs, eights or rows of numbers, on which the vector instructions of a processor work at once.
LLVM itself vectorises few of them: it does not know that the places that a function reads and writes are different ones, and
few rounds are too few to look.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from softrobots.compiled.translate.kernel_language import Function, read_module, rounds_apart, walk
from softrobots.compiled.translate.llvm_expressions import NAMES, PAIRED, ExpressionWriter, Symbols, Value, literal


@lru_cache(maxsize=4)
def functions_of_text(text: str) -> dict[str, Function]:
    """Return the functions of a text by name."""
    return read_module(text).functions


def to_llvm(text: str, constants: Mapping[str, Any], name: str, prefix: str) -> str:
    """Return a function, and all that it needs, for LLVM.

    Args:
        text: Functions in the kernel language.
        constants: Numbers and tables by name.
        name: The function; only it can be called from other texts.
        prefix: What the names of functions and tables begin with there.
    """
    symbols, functions = Symbols(functions_of_text(text), constants, prefix), dict[str, str]()
    first = symbols.function(name, paired=False)
    while symbols.needed.keys() > functions.keys():
        symbol = next(one for one in symbols.needed if one not in functions)
        needed, paired = symbols.needed[symbol]
        functions[symbol] = _FunctionWriter(symbols, symbols.functions[needed], paired=paired).text(symbol)
    functions[first] = functions[first].replace("define linkonce_odr", "define", 1)
    return "\n".join([*symbols.declared.values(), *functions.values()])


class _FunctionWriter(ExpressionWriter):
    """Writes a function; what comes behind a jump stands in a block that nothing reaches."""

    def __init__(self, symbols: Symbols, function: Function, *, paired: bool) -> None:
        names = [node for one in function.body for node in walk(one) if isinstance(node, ast.Name)]
        stored = Counter(node.id for node in names if isinstance(node.ctx, ast.Store))
        stored.update(parameter.name for parameter in function.parameters)
        super().__init__(symbols, stored)
        self._function, self._ends = function, list[str]()  # labels behind the loops around
        self._kinds = PAIRED if paired else {}
        self._returns = self._kinds.get(function.returns, function.returns)

    def text(self, symbol: str) -> str:
        """Return the text of the function."""
        parameters = [Value(f"%{one.name}", self._kinds.get(one.kind, one.kind)) for one in self._function.parameters]
        for one in parameters:
            self.keep(one.text[1:], one)
        self._block(self._function.body)
        head = f"define linkonce_odr {NAMES[self._returns]} {symbol}({', '.join(map(str, parameters))}) {{"
        end = "ret void" if self._returns == "none" else "unreachable"
        return "\n".join([head, *self.at_top, *self.lines, end, "}"])

    def _block(self, statements: Iterable[ast.stmt]) -> None:
        for statement in statements:
            self._statement(statement)

    def _statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Break():
                self.jump(self._ends[-1])
                self.begin(*self.labels("behind"))
            case ast.Return(value=value):
                self.lines.append("ret void" if value is None else f"ret {self.cast(self._returns, self.value(value))}")
                self.begin(*self.labels("behind"))
            case ast.Expr(value=value):
                self.value(value)
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                self.keep(name, self.value(value))
            case ast.Assign(targets=[ast.Subscript() as target], value=value):
                found, (place, kind) = self.value(value), self.element(target)
                self.lines.append(f"store {self.cast(kind, found)}, {place}, align 8")
            case ast.AugAssign(target=ast.Name(id=name), op=operation, value=value):
                self.keep(name, self.arithmetic(operation, self.name(name), self.value(value)))
            case ast.AugAssign(target=ast.Subscript() as target, op=operation, value=value):
                place, kind = self.element(target)
                before = self.new(f"load {NAMES[kind]}, {place}, align 8", kind)
                changed = self.arithmetic(operation, before, self.value(value))
                self.lines.append(f"store {self.cast(kind, changed)}, {place}, align 8")
            case ast.If(test=test, body=body, orelse=otherwise):
                then, other, end = self.labels("then", "else", "end")
                self.jump(then, other, self.value(test))
                for label, statements in ((then, body), (other, otherwise)):
                    self.begin(label)
                    self._block(statements)
                    self.jump(end)
                self.begin(end)
            case ast.While(test=test, body=body):
                head, inside, end = self.labels("while", "do", "end")
                self.jump(head)
                self.begin(head)
                self.jump(inside, end, self.value(test))
                self._round(inside, body, head, end)
                self.begin(end)
            case ast.For(target=ast.Name(id=name), body=body) if count := rounds_apart(node):
                self.values[name], self.apart = literal(0), (name, {2: "pair", 8: "eight", 12: "row"}[count])
                self._block(body)
                self.apart = "", ""
            case ast.For(target=ast.Name(id=name), iter=ast.Call(args=limits), body=body):
                self._count_up(name, [literal(0), *map(self.value, limits)][-2:], body)

    def _count_up(self, name: str, limits: Sequence[Value], body: Iterable[ast.stmt]) -> None:
        before, head, inside, after, end = self.labels("before", "for", "do", "next", "end")
        following = Value(f"%value.{after}", "int")
        for label in (before, head):
            self.jump(label)
            self.begin(label)
        value = self.new(f"phi i64 [{limits[0].text}, %{before}], [{following.text}, %{after}]", "int")
        self.values[name] = value
        self.jump(inside, end, self.new(f"icmp slt {value}, {limits[1].text}", "bool"))
        self._round(inside, body, after, end)
        self.begin(after)
        self.lines.append(f"{following.text} = add nsw {value}, 1")
        self.jump(head)
        self.begin(end)

    def _round(self, inside: str, body: Iterable[ast.stmt], after: str, end: str) -> None:
        self.begin(inside)
        self._ends.append(end)
        self._block(body)
        self._ends.pop()
        self.jump(after)
