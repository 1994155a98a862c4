"""What the robots share: fields as arguments of a xacro file, which generates the URDF."""

from __future__ import annotations

from dataclasses import Field, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.robots.fields import facts_of


@dataclass(frozen=True, kw_only=True)
class XacroRobot:
    """Base of a frozen dataclass whose fields (`softrobots.robots.fields.parameter`) are the arguments of a xacro file."""

    XACRO: ClassVar[str | Path]
    """The file that describes the robot: a name in xacro/, or a path."""

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain; above 300 Pinocchio's workspace is refused."""
        raise NotImplementedError

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        arguments = {}
        for name, facts in facts_of(self).items():
            value = getattr(self, name)
            if facts.form == "colour":
                arguments[name] = ",".join(" ".join(map(repr, colour)) for colour in value)
            elif facts.in_xacro:
                arguments[name] = argument_text(value)
        return arguments

    def urdf(self) -> str:
        """Return the robot as URDF text, with its springs, sections and muscles inside.

        Raises:
            DescriptionError: If xacro refuses the parameters, e.g. parts too light to cut tiny links from them.
        """
        return _expanded(self.XACRO, tuple(self.xacro_arguments().items()))

    def _each(self, name: str) -> tuple[Any, ...]:
        """Values of a field, one a part."""
        values: tuple[Any, ...] = getattr(self, name)
        return values


@lru_cache(maxsize=64)
def _expanded(xacro_file: str | Path, arguments: tuple[tuple[str, str], ...]) -> str:
    return expand(xacro_folder() / xacro_file, dict(arguments))


def default_text(field: Field[Any]) -> str:
    """Return the default of a field as the text of a xacro argument."""
    default: Any = field.default
    return " ".join(map(repr, default)) if field.metadata["facts"].form == "colour" else argument_text(default)


def argument_text(value: Any) -> str:
    """Return a value as the text of a xacro argument, full precision; None is empty."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return "[" + ",".join(map(repr, value)) + "]" if isinstance(value, tuple) else repr(value)
