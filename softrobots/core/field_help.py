"""Help on the fields of a class: meaning, unit and default of each, in `help()`.

The texts stand below the fields in the source, where Python drops them; they are read from there when somebody asks.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import inspect
import re
import textwrap
from typing import Any, TypeVar

Class = TypeVar("Class", bound=type)

_UNIT = re.compile(r"\[(?![^\]]*(?:\d{4}|paper))([^\[\]]*)\]")  # brackets that are no citation


@functools.cache
def field_texts(cls: type) -> dict[str, str]:
    """Return the text of each field and property of a class and its bases, by name; without source those in metadata."""
    fields = getattr(cls, "__dataclass_fields__", {})
    texts = {name: field.metadata["facts"].description for name, field in fields.items() if "facts" in field.metadata}
    if fields and len(texts) == len(fields):
        return texts
    for one in reversed(cls.__mro__):
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(one))).body
        except (OSError, TypeError):  # built in, or without source
            continue
        body = getattr(tree, "body", [])
        for line, text in zip(body, [*body[1:], None], strict=False):
            if isinstance(line, ast.FunctionDef):
                texts[line.name] = ast.get_docstring(line) or ""
            if isinstance(line, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                texts[ast.unparse(line.target)] = inspect.cleandoc(str(text.value.value))
    return texts


def field_unit(cls: type, name: str) -> str:
    """Return the unit that the text of a field states in brackets; empty if it states none."""
    found = _UNIT.search(field_texts(cls).get(name, ""))
    return found[1] if found else ""


class _ClassText:
    """Docstring of a class with its fields, put together when it is asked for."""

    def __init__(self, text: str) -> None:
        self._text = inspect.cleandoc(text)

    def __get__(self, instance: object, cls: type) -> str:
        if "__match_args__" not in vars(cls):  # `dataclass` looks at it, too, before the class is ready
            return self._text
        fields, texts = getattr(cls, "__dataclass_fields__", {}), field_texts(cls)
        lines = []
        for name in (one for one in fields or vars(cls)["_fields"] if not one.startswith("_")):
            default = getattr(fields.get(name), "default", dataclasses.MISSING)
            default_text = "" if default is dataclasses.MISSING else f" Default: {default!r}."
            text = textwrap.indent(f"{name}: {texts.get(name, '')}{default_text}", " " * 8).strip()
            lines.append(f"    {text}")
        return "\n".join([self._text, "", "Attributes:", *lines])


def with_field_help(cls: Class) -> Class:
    """Let the docstring of a class end with its fields, and return the class."""
    text: Any = vars(cls).get("__doc__")
    if isinstance(text, str):
        type.__setattr__(cls, "__doc__", _ClassText(text))
    return cls


class FieldHelp:
    """Base of dataclasses whose fields stand in `help()`."""

    __slots__ = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        with_field_help(cls)
