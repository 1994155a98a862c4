"""A module in the kernel language as one freestanding C99 file, for a control loop on a small computer.

The file needs no library: no allocation, no libm, nothing of the C library, no variable at the level of the file. Arithmetic is
done in the order of the text, so that the numbers are those of plain Python to the last bit, as long as the compiler does not
contract a * b + c (gcc: `-ffp-contract=off`, or any `-std=c99`). With `-ffreestanding` gcc makes no calls of memset or
memcpy out of loops.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

from softrobots.compiled.translate.dialect import Dialect, Part, bare
from softrobots.compiled.translate.functions import translated
from softrobots.compiled.translate.kernel_language import Function, Module
from softrobots.compiled.translate.lines import comment, wrapped

_TYPES = {"none": "void", "int": "int", "bool": "int", "float": "double"}
_NEED_WIDE_INTEGERS = ("floor", "sqrt")  # intrinsics that need <stdint.h>

_CHECKS = """\
#if INT_MAX < 2147483647
#error "int must have 32 bits"
#endif
#if FLT_RADIX != 2 || DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024
#error "double must be an IEEE 754 number of 64 bits"
#endif
#if defined(__FAST_MATH__)
#error "rearranged arithmetic (-ffast-math) makes sine and cosine wrong"
#endif
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ == 12
/* GCC 12.2 reads wrong places in short loops whose induction variables it merges; GCC 11 and Clang 14 do not. */
#pragma GCC optimize("no-ivopts")
#endif"""

_APART = """\
/* Rounds of such a loop have places of their own: none reads what another one writes. */
#if defined(__GNUC__) && !defined(__clang__)
#define ROUNDS_APART _Pragma("GCC ivdep")
#else
#define ROUNDS_APART
#endif"""


class C(Dialect):
    """C99."""

    rounds_apart = "ROUNDS_APART"
    reserved = """
auto break case char const continue default do double else enum extern float for goto if inline int long register restrict
return short signed sizeof static struct switch typedef union unsigned void volatile while asm typeof linux unix
""".split()  # noqa: SIM905 (readable)

    def __init__(self, prefix: str) -> None:
        """Write C whose names at the level of the file have a prefix."""
        self.prefix = prefix

    def head(self, function: Function, *, external: bool) -> str:
        """Return the prototype of a function."""
        shown = []
        for parameter in function.parameters:
            array = f"{'' if parameter.written else 'const '}double *{parameter.name}"
            shown.append(array if parameter.kind == "array" else f"{_TYPES[parameter.kind]} {parameter.name}")
        head = f"{_TYPES[function.returns]} {self.prefix}{function.name}({', '.join(shown) or 'void'})"
        return head if external else f"static {head}"

    def declaration(self, kind: str, *, constant: bool = False) -> str:
        """Return the type."""
        return f"{'const ' if constant else ''}{_TYPES[kind]} "

    def truth(self, value: bool) -> str:
        """Return an int."""
        return str(int(value))

    def negated(self, part: Part) -> Part:
        """Return minus a number."""
        return Part(f"-{part.operand()}", part.kind, "negation")

    def arithmetic(self, left: Part, sign: str, right: Part) -> Part:
        """Return an operation on two ints; their quotient is a double."""
        if sign == "/":
            return bare(Part(f"(double){left.operand()}", "float", "cast"), sign, right.as_float())
        return bare(left, sign, right, "int")

    def intrinsic(self, name: str, arguments: Sequence[str]) -> Part:
        """Return a call of a function of `intrinsics.c`."""
        return Part(f"{self.prefix}{name}({', '.join(arguments)})", "float")

    def ignored(self, text: str) -> str:
        """Return a call whose value is not used."""
        return f"(void){text}"

    def unused(self, names: Sequence[str]) -> list[str]:
        """Return statements that keep compilers from warning."""
        return [f"(void){name};" for name in names]

    def lines(self, line: str) -> list[str]:
        """Return lines that are not too long."""
        return wrapped(line)


def to_c(text: str, *, prefix: str, exported: Sequence[str]) -> str:
    """Translate a module in the kernel language (see `softrobots.compiled.translate.kernel_language`) into C99.

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
    dialect = C(prefix)
    module, bodies, needed = translated(text, dialect, exported)
    heads = {name: dialect.head(one, external=True) for name, one in module.functions.items() if name in exported}
    pieces = [
        _about(module, prefix, exported, heads),
        "#include <float.h>\n#include <limits.h>"
        + ("\n#include <stdint.h>" if needed.intersection(_NEED_WIDE_INTEGERS) else ""),
        _CHECKS,
        _APART if any(C.rounds_apart in body for body in bodies) else "",
        "\n".join(_constants(module, prefix, needed)),
        "\n".join(line for head in heads.values() for line in wrapped(f"{head};")),
        *(function.replace("PREFIX_", prefix) for name, function in _intrinsics().items() if name in needed),
        *bodies,
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
                kind = _TYPES[type(value[0]).__name__]
                yield from wrapped(f"static const {kind} {shown}[{len(value)}] = {{ {', '.join(map(repr, value))} }};")
            elif isinstance(value, int):
                yield f"enum {{ {shown} = {value} }};"
            else:
                yield f"static const double {shown} = {value!r};"


@cache
def _intrinsics() -> dict[str, str]:
    """Return the text of each static function by its name, with `PREFIX_` before it, in the order of the file."""
    _, *functions = Path(__file__).with_name("intrinsics.c").read_text(encoding="utf-8").strip().split("\n\n")
    return {re.findall(r"PREFIX_(\w+)\(", function)[0]: function for function in functions}
