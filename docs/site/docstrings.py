"""Docstrings for the site: their mathematics, written as reStructuredText wants it, as Markdown wants it."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import griffe

BLOCK = re.compile(r"^([ ]*)\.\. math::(.*\n(?:(?:\1[ ]+\S.*)?\n)*)", re.MULTILINE)
INLINE = re.compile(r":math:`([^`]+)`")


def as_markdown(text: str) -> str:
    """A docstring whose `.. math::` blocks are fences of `math`, and whose `:math:` roles stand between dollar signs."""

    def block(found: re.Match[str]) -> str:
        first, _, rest = found[2].partition("\n")
        lines = f"{first.strip()}\n{textwrap.dedent(rest)}".strip()
        fenced = "\n".join(["", "```math", lines, "```", "", ""])
        return textwrap.indent(fenced, found[1], lambda line: bool(line.strip()))

    return INLINE.sub(r"$\1$", BLOCK.sub(block, text + "\n")).rstrip()


class MathInDocstrings(griffe.Extension):
    """Rewrites every docstring as it is loaded."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Rewrite one."""
        if obj.docstring is not None and ("math::" in obj.docstring.value or ":math:" in obj.docstring.value):
            obj.docstring.value = as_markdown(obj.docstring.value)
