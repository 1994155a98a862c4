"""Docstrings for the site: their mathematics as Markdown instead of reStructuredText, and units that are no links."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import griffe

BLOCK = re.compile(r"^([ ]*)\.\. math::(.*\n(?:(?:\1[ ]+\S.*)?\n)*)", re.MULTILINE)
INLINE = re.compile(r":math:`([^`]+)`")
UNIT = re.compile(r"`[^`]*`|\](\s+)\[")
"""Code, or the place between two brackets: Markdown takes `in [0, length] [m]` for a link to `m`."""


def as_markdown(text: str) -> str:
    """A docstring with `.. math::` blocks as fences of `math`, `:math:` roles between dollar signs, and units escaped."""

    def block(match: re.Match[str]) -> str:
        first, _, rest = match[2].partition("\n")
        lines = f"{first.strip()}\n{textwrap.dedent(rest)}".strip()
        fenced = "\n".join(["", "```math", lines, "```", "", ""])
        return textwrap.indent(fenced, match[1], lambda line: bool(line.strip()))

    plain = UNIT.sub(lambda match: match[0] if match[1] is None else rf"]{match[1]}\[", text)
    return INLINE.sub(r"$\1$", BLOCK.sub(block, plain + "\n")).rstrip()


class MathInDocstrings(griffe.Extension):
    """Rewrites every docstring as it is loaded."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Rewrite one."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)
