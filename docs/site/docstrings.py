"""Docstrings for the site: mathematics as Markdown, and fields of robots described by their facts."""

from __future__ import annotations

import dataclasses
import importlib
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


class SiteDocstrings(griffe.Extension):
    """Rewrites the mathematics of docstrings, and writes those of fields with facts."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Rewrite the mathematics of one docstring."""
        if obj.docstring is not None and ("math::" in obj.docstring.value or ":math:" in obj.docstring.value):
            obj.docstring.value = as_markdown(obj.docstring.value)

    def on_class(self, *, cls: Any, **_: Any) -> None:
        """Describe the fields of a robot: meaning, unit, bounds and source; show their defaults as values."""
        if "parameter(" not in cls.source and "per_part(" not in cls.source:
            return
        kind = getattr(importlib.import_module(cls.module.path), cls.name)
        for field in dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ():
            if "facts" in field.metadata and field.name in cls.members:
                cls.members[field.name].docstring = griffe.Docstring(field.metadata["facts"].description, parent=cls)
                cls.members[field.name].value = repr(field.default)
