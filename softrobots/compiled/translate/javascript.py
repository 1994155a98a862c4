"""A module in the kernel language as JavaScript, for a page.

Arithmetic is done in the order of the text, on the same 64-bit numbers, so that results are those of plain Python to the last
bit. Arrays are `Float64Array`; ints are plain numbers, and never minus zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from softrobots.compiled.translate.dialect import Dialect, Part, bare
from softrobots.compiled.translate.functions import Translated, translated
from softrobots.compiled.translate.kernel_language import Function

_INTRINSICS = {"floor": "(Math.floor({}) + 0.0)", "fabs": "Math.abs({})", "sqrt": "Math.sqrt({})", "where": "({} ? {} : {})"}


class JavaScript(Dialect):
    """JavaScript, strict mode."""

    prefix = "$"  # no name in Python has it
    reserved = """
arguments await break case catch class const continue debugger default delete do else enum eval export extends false finally for
function if implements import in instanceof interface let new null package private protected public return static super switch
this throw true try typeof var void while with yield undefined NaN Infinity Math Float64Array Int32Array
""".split()  # noqa: SIM905 (readable)

    def head(self, function: Function, *, external: bool) -> str:
        """Return name and parameters."""
        return f"function {self.prefix}{function.name}({', '.join(one.name for one in function.parameters)})"

    def declaration(self, kind: str, *, constant: bool = False) -> str:
        """Return `const` or `let`."""
        return "const " if constant else "let "

    def truth(self, value: bool) -> str:
        """Return a bool."""
        return str(value).lower()

    def negated(self, part: Part) -> Part:
        """Return minus a number; of an int never minus zero."""
        if part.kind == "int" and not part.text.strip("0").isdigit():
            return Part(f"0 - {part.operand()}", "int", "-")
        return Part(f"-{part.operand()}", part.kind, "negation")

    def arithmetic(self, left: Part, sign: str, right: Part) -> Part:
        """Return an operation on two ints."""
        if sign == "*":
            return Part(f"Math.imul({left.text}, {right.text})", "int")
        return bare(left, sign, right, "float" if sign == "/" else "int")

    def intrinsic(self, name: str, arguments: Sequence[str]) -> Part:
        """Return what the language has for it."""
        return Part(_INTRINSICS[name].format(*arguments), "float")

    def ignored(self, text: str) -> str:
        """Return the call."""
        return text


def to_javascript(text: str, *, exported: Sequence[str]) -> str:
    """Translate a module in the kernel language (see `softrobots.compiled.translate.kernel_language`) into JavaScript.

    Args:
        text: The module.
        exported: Functions and constants to translate, with all that they use.

    Returns:
        Declarations of constants and functions; their names begin with `$`.

    Raises:
        ParameterError: If the text is outside the kernel language; the error names the line.
    """
    whole = translated(text, JavaScript(), exported)
    return "\n\n".join(["\n".join(_constants(whole)), *whole.bodies]) + "\n"


def _constants(whole: Translated) -> Iterable[str]:
    for name, value in whole.module.constants.items():
        if name in whole.needed:
            shown = str(value)
            if isinstance(value, tuple):
                shown = f"{'Int32' if isinstance(value[0], int) else 'Float64'}Array.of({', '.join(map(repr, value))})"
            yield f"const {JavaScript.prefix}{name} = {shown};"
