"""Translation of a whole module: its functions, and which of its names the exported ones need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from softrobots.compiled.translate.dialect import Dialect
from softrobots.compiled.translate.expressions import Scope
from softrobots.compiled.translate.functions import FunctionWriter
from softrobots.compiled.translate.kernel_language import Module, read_module


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
