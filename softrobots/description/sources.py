"""Sources of a description: a robot of this package, a file, or text; in URDF, MJCF or SDF."""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.core.xml_input import as_unicode, read_xml
from softrobots.description.mesh_files import with_absolute_paths
from softrobots.description.readers import to_urdf

_POINT_MASS = re.compile(
    r"(<inertial\b[^<>/]*>(?:(?!</?inertial\b|<inertia\b).)*<mass\b(?:(?!</?inertial\b|<inertia\b).)*)</inertial>", re.S
)
_NO_INERTIA = "<inertia " + " ".join(f'{entry}="0"' for entry in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")) + "/>"


class Robot(Protocol):
    """Object with a URDF description."""

    def urdf(self) -> str:
        """Return the robot as URDF text."""


NAMED: dict[str, Callable[[], Robot]] = {}
"""Constructors of the robots of this package by name; `softrobots.robots` enters them."""

_SUFFIXES = {".urdf", ".xml", ".mjcf", ".sdf"}


def named_robot(source: Any) -> Any:
    """Return the robot of this package that a text names, with its default parameters; anything else as it came.

    The name wins over a file of that name, which `Path(name)` or "./name" means.
    """
    return NAMED[source]() if isinstance(source, str) and source in NAMED else source


def read_source(source: Any, field: str = "source") -> tuple[str, str]:
    """Return a description as URDF text, and its origin for errors.

    MJCF and SDF are translated (`softrobots.description.readers`). Relative paths of meshes are made absolute; an `<inertial>`
    without `<inertia>`, a point mass, gets zeros, with a warning.

    Args:
        source: A robot of this package or its name, a path (`Path` or text), or the text itself (starting with `<`).
        field: Name of the parameter, for the error.

    Raises:
        ParameterError: If it is something else.
        DescriptionError: If the file cannot be read, is of another kind, or has features that cannot be translated.
        MissingDependency: If it is MJCF or SDF and the package that reads that is not installed.
    """
    source = named_robot(source)
    if not isinstance(source, type) and callable(getattr(source, "urdf", None)):
        return str(source.urdf()), type(source).__name__
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return _with_point_masses(to_urdf(as_unicode(source), "the text"), "the text"), "the text"
    if not isinstance(source, str | Path):
        if isinstance(source, type):
            raise ParameterError(field, source, f"a robot, not its class: {source.__name__}(), with parentheses")
        raise ParameterError(field, source, "a robot, a path, or URDF text (or that of MJCF or SDF), or the name of a robot")
    try:
        text = read_xml(Path(source))
    except DescriptionError as error:
        required = "a path of a URDF, MJCF or SDF file, its text, or the name of a robot is required"
        raise DescriptionError(f"{error}; {required}: {_present(Path(source))}") from error
    urdf = to_urdf(with_absolute_paths(text, Path(source).parent), str(source), Path(source))
    return _with_point_masses(urdf, str(source)), str(source)


def _with_point_masses(urdf: str, label: str) -> str:
    """The same robot with zeros where a mass has no moments of inertia: Pinocchio's parser assumes them, and complains."""
    whole, count = _POINT_MASS.subn(rf"\1{_NO_INERTIA}</inertial>", urdf)
    if count:
        warnings.warn(f"{count} links of {label} have a mass and no <inertia>: point masses", stacklevel=4)
    return whole


def _present(path: Path) -> str:
    """Return the names of robots, the nearest one first, and of the first ten descriptions in the folder of a path."""
    near = difflib.get_close_matches(path.name, NAMED, n=1)
    names = ", ".join([*near, *(name for name in NAMED if name not in near)])
    try:
        files = sorted(file.name for file in path.parent.iterdir() if file.suffix.lower() in _SUFFIXES)
    except OSError:
        files = []
    shown = ", ".join(files[:10]) + (", ..." if len(files) > 10 else "")
    return names + (f"; files in {path.parent}: {shown}" if files else "")
