"""Running traced code: texts in the kernel language as plain Python, with floats or with mpmath's numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mpmath as mp

from softrobots.compiled.drivers import intrinsics
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, in_order

NAMES = ("Array", "fabs", "floor", "sqrt", "where", "zeros")
MANY_DIGITS = {"sine": mp.sin, "cosine": mp.cos, "sqrt": mp.sqrt, "fabs": mp.fabs}
"""The functions of generated code for mpmath's numbers; constants in the code stay as they are."""


def functions(text: str, **others: Any) -> dict[str, Any]:
    """What a text defines: functions and constants, with libm's sine and cosine or with the functions given."""
    given = {name: getattr(intrinsics, name) for name in NAMES} | {"sine": math.sin, "cosine": math.cos} | others
    made = dict(given)
    exec(text, made)
    return made | given  # as back ends do; the text may bring its own sine and cosine


def values(block: Block, outputs: Sequence[Scalar], inputs: Sequence[Any], **others: Any) -> list[Any]:
    """Outputs of traced expressions, whose inputs are the first elements of the workspace."""
    made = Block("compute", "Compute.", (), block.trace)
    made.store_all(len(inputs), list(outputs))
    w = [*inputs, *outputs]
    functions(made.text(), **others)["compute"](w)
    return w[len(inputs) :]


def operations(block: Block) -> int:
    """Number of arithmetic operations."""
    return sum(one.operation != "load" for one in in_order([value for _, _, value in block.stores]))
