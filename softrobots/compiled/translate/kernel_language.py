"""The kernel language: the subset of Python that generated solvers are written in, read from its text.

A module is its docstring, constants (`N = 3`, `X = -1.5e-3`, `TABLE = (1.0, 2.0)`: a table has floats or ints) and functions
`def name(w: Array, i: int, x: float) -> None | bool | int | float`, each defined before it is used. Inside a function:

- `name = value`, `name += value`, `w[index] = value`, `w[index] += value` (also with - * /), calls, `pass`, `return`;
- `if`, `while`, `for i in range(start, stop)`, `break`;
- `+ - * /`, unary `-`, `== != < <= > >=`, `and`, `or`, `not`, elements of arrays and tables, calls of functions of the module
  and of `floor`, `fabs`, `sqrt` and `where(c, a, b)`.

A name in a function has one type, that of its first assignment in the text: an int is what comes of ints (not by `/`), a bool
what comes of a comparison; everything else is a float, which takes ints, too. `where` gives a float. A statement that calls a
function which writes an array accesses arrays in the arguments of the call only: C does not say what it computes first. The
variable of a `for` is used in its loops only. Ints have 32 bits; in plain Python they do not overflow.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn, TypeAlias

from softrobots.core.errors import ParameterError

Number: TypeAlias = "float | int"

INTRINSICS: Mapping[str, tuple[str, ...]] = {
    "floor": ("float",),
    "fabs": ("float",),
    "sqrt": ("float",),
    "where": ("bool", "float", "float"),
}
"""Functions that the language has built in, and the types of their arguments."""
WORDS = (*INTRINSICS, "zeros", "range", "Array", "int", "float", "bool")
"""Names with a meaning of their own, that a module cannot give away."""
LARGEST_INT = 2**31 - 1
"""Ints are 32 bits wide in C."""
_WALKED = (ast.expr, ast.stmt)


@dataclass(frozen=True)
class Parameter:
    """A parameter of a function."""

    name: str
    """Its name."""
    kind: str
    """`array`, `int` or `float`."""
    written: bool
    """Whether the function writes elements of it."""


@dataclass(frozen=True)
class Function:
    """A function of a module, before its statements are looked at."""

    name: str
    """Its name."""
    parameters: tuple[Parameter, ...]
    """Its parameters."""
    returns: str
    """What it returns: `none`, `int`, `float` or `bool`."""
    docstring: str
    """Its docstring, without indentation; empty if it has none."""
    body: tuple[ast.stmt, ...]
    """Its statements, without the docstring."""
    node: ast.FunctionDef
    """Where it stands."""


@dataclass(frozen=True)
class Module:
    """A text in the kernel language."""

    text: str
    """The text."""
    docstring: str = ""
    """Its docstring; empty if it has none."""
    constants: dict[str, Number | tuple[Number, ...]] = field(default_factory=dict)
    """Numbers and tables by name, in the order of the text."""
    functions: dict[str, Function] = field(default_factory=dict)
    """Functions by name, in the order of the text."""

    def refuse(self, node: ast.AST, requirement: str) -> NoReturn:
        """Say which line of the text is not in the kernel language, and what would be.

        Raises:
            ParameterError: Always.
        """
        line = getattr(node, "lineno", 1)
        shown = self.text.splitlines()[line - 1].strip()
        raise ParameterError("text", f"line {line}: {shown}", f"in the kernel language: {requirement}")

    def literal(self, node: ast.expr) -> Number | None:
        """Return the number that a literal stands for, or None if the node is none.

        Raises:
            ParameterError: If it is an int of more than 32 bits, or an infinite float.
        """
        if not isinstance(node, ast.Constant) or isinstance(node.value, bool) or not isinstance(node.value, int | float):
            return None
        value: Number = node.value
        if isinstance(value, int) and value > LARGEST_INT:
            self.refuse(node, f"an int is at most {LARGEST_INT}")
        if not math.isfinite(value):
            self.refuse(node, "a float is finite")
        return value


def read_module(text: str) -> Module:
    """Read a module; statements and expressions inside its functions are read later, by who translates them.

    Raises:
        ParameterError: If the text is not Python, or something at the level of the module is outside the language.
    """
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError) as error:
        where = f"line {getattr(error, 'lineno', None) or 1}: {error}"
        raise ParameterError("text", where, "in the kernel language, a subset of Python") from error
    module = Module(text, ast.get_docstring(tree) or "")
    for node in tree.body[1 if module.docstring else 0 :]:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.FunctionDef(name=name):
                if name in module.constants or name in module.functions or name in WORDS:
                    module.refuse(node, f"a module defines each name once, and none of {', '.join(WORDS)}")
            case _:
                module.refuse(node, "a module holds constants (NAME = number or tuple) and functions only")
        if isinstance(node, ast.FunctionDef):
            module.functions[name] = _function(module, node)
        else:
            module.constants[name] = _constant(module, node.value)
    return module


def rounds_apart(node: ast.For) -> int:
    """Return the number of rounds of a loop of which no round reads what another one writes; 0 of other loops.

    Those are the loops of `softrobots.compiled.trace.blocks` over both stages of a step, of several sections, and over twelve
    components.
    """
    match node:
        case ast.For(
            target=ast.Name(id="stage" | "eight" | "part" as name), iter=ast.Call(args=[ast.Constant(value=2 | 8 | 12)])
        ):
            if all(isinstance(one, ast.Assign) for one in node.body):
                return {"stage": 2, "eight": 8, "part": 12}[name]
    return 0


def _constant(module: Module, node: ast.expr) -> Number | tuple[Number, ...]:
    values = tuple(_number(module, one) for one in (node.elts if isinstance(node, ast.Tuple) else [node]))
    if len({type(value) for value in values}) != 1:
        module.refuse(node, "a table is a tuple of floats or a tuple of ints, of at least one")
    return values if isinstance(node, ast.Tuple) else values[0]


def _number(module: Module, node: ast.expr) -> Number:
    negative = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
    value = module.literal(node.operand if isinstance(node, ast.UnaryOp) and negative else node)
    if value is None:
        module.refuse(node, "a constant is a number or a tuple of numbers, written out")
    return -value if negative else value


def _function(module: Module, node: ast.FunctionDef) -> Function:
    given = node.args
    plain = not (given.posonlyargs or given.kwonlyargs or given.vararg or given.kwarg or given.defaults)
    if not plain or node.decorator_list:
        module.refuse(node, "a function has parameters name: kind, without defaults, and no decorators")
    written = _written(node, module.functions)
    parameters = []
    for argument in given.args:
        kind = _kind(argument.annotation, ("Array", "int", "float"))
        if kind is None:
            module.refuse(argument, "a parameter is annotated Array, int or float")
        parameters.append(Parameter(argument.arg, kind, argument.arg in written))
    returns = _kind(node.returns, ("None", "int", "float", "bool"))
    if returns is None:
        module.refuse(node, "a function is annotated -> None, int, float or bool")
    docstring = ast.get_docstring(node) or ""
    return Function(node.name, tuple(parameters), returns, docstring, tuple(node.body[1 if docstring else 0 :]), node)


def _kind(annotation: ast.expr | None, allowed: tuple[str, ...]) -> str | None:
    shown = "" if annotation is None else ast.unparse(annotation)
    return shown.lower() if shown in allowed else None


def walk(node: Any) -> list[Any]:
    """Return a node and all below it, as `ast.walk`, without operators and contexts; found once and kept with the node."""
    if not hasattr(node, "walked"):
        node.walked = [node]
        for one in node.walked:  # to which it adds
            for name in one._fields:
                value = getattr(one, name, None)
                below = value if isinstance(value, list) else (value,)
                node.walked += [part for part in below if isinstance(part, _WALKED)]
    found: list[Any] = node.walked
    return found


def _written(node: ast.FunctionDef, earlier: Mapping[str, Function]) -> set[str]:
    """Names of arrays that a function writes: itself, or through a function that it calls."""
    found = set()
    for inner in (one for statement in node.body for one in walk(statement)):
        match inner:
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store()):
                found.add(name)
            case ast.Call(func=ast.Name(id=called), args=arguments) if called in earlier:
                pairs = zip(arguments, earlier[called].parameters, strict=False)  # their number is checked with the call
                found |= {given.id for given, wanted in pairs if wanted.written and isinstance(given, ast.Name)}
    return found
