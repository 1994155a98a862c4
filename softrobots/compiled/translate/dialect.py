"""What differs between the languages that the kernel language is translated to."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from softrobots.compiled.translate.kernel_language import Function


class Part(NamedTuple):
    """A translated expression."""

    text: str
    """Its text."""
    kind: str
    """`int`, `float`, `bool` or `none`."""
    operator: str = ""
    """Its outermost operator; empty for names, literals, elements and calls."""

    def operand(self, chained: str = "") -> str:
        """Return its text as an operand, bare if it is a chain of the operator `chained` or has no operator."""
        return self.text if self.operator in ("", chained) else f"({self.text})"

    def as_float(self) -> Part:
        """Return it where C wants a double: an int literal as a float literal; C converts other ints by itself."""
        return Part(f"{self.text}.0", "float") if self.text.isdigit() else self


class Dialect(ABC):
    """A language that functions are written in; statements and operators that are the same in C and JavaScript are not here."""

    prefix: str
    """Prefix of the names at the level of the file."""
    reserved: Sequence[str]
    """Keywords, which no parameter or local may be."""
    rounds_apart = ""
    """What stands before a loop over both stages of a step, whose rounds read nothing that the other one writes."""

    @abstractmethod
    def head(self, function: Function, *, external: bool) -> str:
        """Return the declaration of a function, without what ends it; `external`: it can be called from other files."""

    @abstractmethod
    def declaration(self, kind: str, *, constant: bool = False) -> str:
        """Return what stands before the name of a local variable of this kind where it is declared."""

    @abstractmethod
    def truth(self, value: bool) -> str:
        """Return the literal of a bool."""

    @abstractmethod
    def negated(self, part: Part) -> Part:
        """Return minus a number."""

    @abstractmethod
    def arithmetic(self, left: Part, sign: str, right: Part) -> Part:
        """Return an operation on two ints."""

    @abstractmethod
    def intrinsic(self, name: str, arguments: Sequence[str]) -> Part:
        """Return a call of an intrinsic of the kernel language."""

    @abstractmethod
    def ignored(self, text: str) -> str:
        """Return an expression as a statement, without the semicolon."""

    def unused(self, names: Sequence[str]) -> list[str]:
        """Return statements for parameters and locals that are not read."""
        return []

    def lines(self, line: str) -> list[str]:
        """Return a line of code, cut if the language allows that anywhere."""
        return [line]


def bare(left: Part, sign: str, right: Part, kind: str = "float") -> Part:
    """Return an operation, with parentheses around compound operands."""
    return Part(f"{left.operand(sign)} {sign} {right.operand()}", kind, sign)
