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


class SiteDocstrings(griffe.Extension):
    """Rewrites docstrings as Markdown, and writes those of fields with facts."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Rewrite one docstring as Markdown."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)

    def on_class(self, *, cls: Any, **_: Any) -> None:
        """Describe the fields of a robot: meaning, unit, bounds and source; show their defaults as values."""
        if "parameter(" not in cls.source and "per_part(" not in cls.source and "per_actuator(" not in cls.source:
            return
        kind = getattr(importlib.import_module(cls.module.path), cls.name)
        for field in dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ():
            if "facts" in field.metadata and field.name in cls.members:
                cls.members[field.name].docstring = griffe.Docstring(field.metadata["facts"].description, parent=cls)
                cls.members[field.name].value = repr(field.default)
