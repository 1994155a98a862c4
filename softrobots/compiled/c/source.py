"""A module in the kernel language as one freestanding C99 file, for a control loop on a small computer.

The file needs no library: no allocation, no libm, nothing of the C library, no variable at the level of the file. Arithmetic is
done in the order of the text, so that the numbers are those of plain Python to the last bit, as long as the compiler does not
contract a * b + c (gcc: `-ffp-contract=off`, or any `-std=c99`). With `-ffreestanding` gcc makes no calls of memset or
memcpy out of loops.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softrobots.compiled.c.expressions import Scope
from softrobots.compiled.c.functions import C_TYPES, FunctionWriter, prototype
from softrobots.compiled.c.intrinsics import NEEDS_WIDE_INTEGERS, c_intrinsics
from softrobots.compiled.c.kernel_language import Module, read_module
from softrobots.compiled.c.lines import comment, wrapped

_CHECKS = """\
#if INT_MAX < 2147483647
#error "int must have 32 bits"
#endif
#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024
#error "double must be an IEEE 754 number of 64 bits"
#endif
#if defined(__FAST_MATH__)
#error "rearranged arithmetic (-ffast-math) makes sine and cosine wrong"
#endif"""


def to_c(text: str, *, prefix: str, exported: Sequence[str]) -> str:
    """Translate a module in the kernel language (see `softrobots.compiled.c.kernel_language`) into C99.

    Args:
        text: The module.
        prefix: What the names at the level of the file begin with, e.g. "arm_".
        exported: Functions that other files call, and int constants that they need, e.g. sizes of arrays. All else is static,
            and left out if no exported function uses it.

    Returns:
        Text of a C file. The comment at its top has the declarations and docstrings of what is exported.

    Raises:
        ParameterError: If the text is outside the kernel language; the error names the line.
    """
    module = read_module(text)
    functions = [name for name in module.functions if name in exported]
    scopes: dict[str, Scope] = {}
    bodies = {}
    for name, function in module.functions.items():
        earlier = {other: module.functions[other] for other in scopes}
        scopes[name] = Scope(module, earlier, prefix)
        try:
            bodies[name] = FunctionWriter(function, scopes[name]).text(external=name in functions)
        except RecursionError:
            module.refuse(function.node, "expressions and blocks are not as deep as here: name some parts")
    needed = set(exported)
    for name in reversed(scopes):  # whatever a function calls stands before it
        if name in needed:
            needed |= scopes[name].needs
    heads = {name: prototype(module.functions[name], prefix) for name in functions}
    pieces = [
        _about(module, prefix, exported, heads),
        "#include <float.h>\n#include <limits.h>"
        + ("\n#include <stdint.h>" if needed.intersection(NEEDS_WIDE_INTEGERS) else ""),
        _CHECKS,
        "\n".join(_constants(module, prefix, needed)),
        "\n".join(line for head in heads.values() for line in wrapped(f"{head};")),
        *(function.replace("PREFIX_", prefix) for name, function in c_intrinsics().items() if name in needed),
        *(body for name, body in bodies.items() if name in needed),
    ]
    return "\n\n".join(piece for piece in pieces if piece) + "\n"


def _about(module: Module, prefix: str, exported: Iterable[str], heads: dict[str, str]) -> str:
    """The comment at the top."""
    lines = [*module.docstring.splitlines(), ""] if module.docstring else []
    lines += ["Written by softrobots. Freestanding C99: no library, no allocation, no variables outside of functions.", ""]
    lines += ["Arrays belong to the caller. To use the functions, declare:", ""]
    sizes = [f"    enum {{ {prefix}{name} = {module.constants[name]} }};" for name in exported if name in module.constants]
    lines += [*sizes, ""] if sizes else []
    for name, head in heads.items():
        lines += [
            *wrapped(f"    {head};"),
            *(f"        {line}" if line else "" for line in module.functions[name].docstring.splitlines()),
            "",
        ]
    return comment(lines[:-1])


def _constants(module: Module, prefix: str, needed: set[str]) -> Iterable[str]:
    for name, value in module.constants.items():
        if name in needed:
            shown = prefix + name
            if isinstance(value, tuple):
                kind = C_TYPES[type(value[0]).__name__]
                yield from wrapped(f"static const {kind} {shown}[{len(value)}] = {{ {', '.join(map(repr, value))} }};")
            elif isinstance(value, int):
                yield f"enum {{ {shown} = {value} }};"
            else:
                yield f"static const double {shown} = {value!r};"
