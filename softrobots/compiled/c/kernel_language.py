"""The kernel language: the subset of Python that generated solvers are written in, read from its text.

A module is its docstring, constants (`N = 3`, `X = -1.5e-3`, `TABLE = (1.0, 2.0)`: a table has floats or ints) and functions
`def name(w: Array, i: int, x: float) -> None | bool | int | float`, each defined before it is used. Inside a function:

- `name = value`, `name += value`, `w[index] = value`, `w[index] += value` (also with - * /, and // % on ints),
  `name = zeros(N)` with a constant N (a local array), calls, `pass`, `return`;
- `if`, `while`, `for i in range(start, stop, step)` with a constant step, `break`, `continue`;
- `+ - * /`, on ints also `//` and `%`, unary `-`, `== != < <= > >=`, `and`, `or`, `not`, `a if c else b`, elements of arrays
  and tables, calls of functions of the module and of `floor`, `fabs`, `sqrt` and `where(c, a, b)`.

A name in a function has one type, that of its first assignment in the text: an int is what comes of ints (not by `/`), a bool
what comes of a comparison; everything else is a float, which takes ints, too. `where` gives a float. A statement that calls a
function which writes an array accesses arrays in the arguments of the call only: C does not say what it computes first. The
variable of a `for` is used in its loops only. Ints have 32 bits; in plain Python they do not overflow.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn, TypeAlias

from softrobots.core.errors import ParameterError

Number: TypeAlias = "float | int"

INTRINSICS: Mapping[str, int] = {"floor": 1, "fabs": 1, "sqrt": 1, "where": 3}
"""Functions that the language has built in, and how many arguments they take."""
WORDS = (*INTRINSICS, "zeros", "range", "Array", "int", "float", "bool")
"""Names with a meaning of their own, that a module cannot give away."""
LARGEST_INT = 2**31 - 1
"""Ints are 32 bits wide in C."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a function."""

    name: str
    """Its name."""
    kind: str
    """`array`, `int`, `float` or `bool`."""
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

    @property
    def writes(self) -> bool:
        """Whether a call of it changes an array."""
        return any(parameter.written for parameter in self.parameters)


@dataclass(frozen=True)
class Module:
    """A text in the kernel language."""

    text: str
    """The text."""
    docstring: str
    """Its docstring; empty if it has none."""
    constants: Mapping[str, Number | tuple[Number, ...]]
    """Numbers and tables by name, in the order of the text."""
    functions: Mapping[str, Function]
    """Functions by name, in the order of the text."""

    def refuse(self, node: ast.AST, requirement: str) -> NoReturn:
        """Raise the error about a piece of the text."""
        refuse(self.text, node, requirement)


def refuse(text: str, node: ast.AST, requirement: str) -> NoReturn:
    """Say which line of a text is not in the kernel language, and what would be.

    Raises:
        ParameterError: Always.
    """
    line = getattr(node, "lineno", 1)
    shown = text.splitlines()[line - 1].strip() if text.strip() else ""
    raise ParameterError("text", f"line {line}: {shown}", f"in the kernel language: {requirement}")


def read_module(text: str) -> Module:
    """Read a module; statements and expressions inside its functions are read later, by who translates them.

    Args:
        text: Text in the kernel language.

    Returns:
        Its constants and functions.

    Raises:
        ParameterError: If the text is not Python, or something at the level of the module is outside the language.
    """
    if not isinstance(text, str):
        raise ParameterError("text", text, "text in the kernel language")
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError) as error:
        where = f"line {getattr(error, 'lineno', None) or 1}: {error}"
        raise ParameterError("text", where, "in the kernel language, a subset of Python") from error
    constants: dict[str, Number | tuple[Number, ...]] = {}
    functions: dict[str, Function] = {}
    for place, node in enumerate(tree.body):
        if place == 0 and _is_docstring(node):
            continue
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                made: Number | tuple[Number, ...] | Function = _constant(text, value)
            case ast.FunctionDef(name=name):
                made = _function(text, node, functions)
            case _:
                refuse(text, node, "a module holds constants (NAME = number or tuple) and functions only")
        if name in constants or name in functions or name in WORDS:
            refuse(text, node, f"a module defines each name once, and none of {', '.join(WORDS)}")
        if isinstance(made, Function):
            functions[name] = made
        else:
            constants[name] = made
    return Module(text, ast.get_docstring(tree) or "", constants, functions)


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _constant(text: str, node: ast.expr) -> Number | tuple[Number, ...]:
    if isinstance(node, ast.Tuple):
        values = tuple(_number(text, element) for element in node.elts)
        if len({type(value) for value in values}) != 1:
            refuse(text, node, "a table is a tuple of floats or a tuple of ints, of at least one")
        return values
    return _number(text, node)


def _number(text: str, node: ast.expr) -> Number:
    negative = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)
    literal = node.operand if isinstance(node, ast.UnaryOp) and negative else node
    value = literal_number(text, literal)
    if value is None:
        refuse(text, node, "a constant is a number or a tuple of numbers, written out")
    return -value if negative else value


def literal_number(text: str, node: ast.expr) -> Number | None:
    """Return the number that a literal stands for, or None if the node is none.

    Raises:
        ParameterError: If it is an int of more than 32 bits, or an infinite float.
    """
    if not isinstance(node, ast.Constant) or isinstance(node.value, bool) or not isinstance(node.value, int | float):
        return None
    value: Number = node.value
    if isinstance(value, int) and value > LARGEST_INT:
        refuse(text, node, f"an int is at most {LARGEST_INT}")
    if not math.isfinite(value):
        refuse(text, node, "a float is finite")
    return value


def _function(text: str, node: ast.FunctionDef, earlier: Mapping[str, Function]) -> Function:
    given = node.args
    plain = not (given.posonlyargs or given.kwonlyargs or given.vararg or given.kwarg or given.defaults)
    if not plain or node.decorator_list:
        refuse(text, node, "a function has parameters name: kind, without defaults, and no decorators")
    written = _written(node, earlier)
    parameters = []
    for argument in given.args:
        kind = _kind(argument.annotation, ("Array", "int", "float", "bool"))
        if kind is None or argument.arg in WORDS:
            refuse(text, argument, f"a parameter is annotated Array, int, float or bool, and not called {', '.join(WORDS)}")
        parameters.append(Parameter(argument.arg, kind, argument.arg in written))
    returns = _kind(node.returns, ("None", "int", "float", "bool"))
    if returns is None:
        refuse(text, node, "a function is annotated -> None, int, float or bool")
    body = tuple(node.body[1:] if _is_docstring(node.body[0]) else node.body)
    return Function(node.name, tuple(parameters), returns, ast.get_docstring(node) or "", body, node)


def _kind(annotation: ast.expr | None, allowed: tuple[str, ...]) -> str | None:
    match annotation:
        case ast.Name(id=name) if name in allowed:
            return name.lower()
        case ast.Constant(value=None) if "None" in allowed:
            return "none"
    return None


def _written(node: ast.FunctionDef, earlier: Mapping[str, Function]) -> set[str]:
    """Names of arrays that a function writes: itself, or through a function that it calls."""
    found = set()
    for inner in ast.walk(node):
        match inner:
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store()):
                found.add(name)
            case ast.Call(func=ast.Name(id=called), args=arguments) if called in earlier:
                pairs = zip(arguments, earlier[called].parameters, strict=False)  # their number is checked with the call
                found |= {given.id for given, wanted in pairs if wanted.written and isinstance(given, ast.Name)}
    return found
