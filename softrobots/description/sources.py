"""Sources of a description: a robot of this package, a file, or text; in URDF, MJCF or SDF."""

from __future__ import annotations

import re
import warnings
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


def read_source(source: Any, field: str = "source") -> tuple[str, str]:
    """Return a description as URDF text, and its origin for errors.

    MJCF and SDF are translated (`softrobots.description.readers`). Relative paths of meshes are made absolute; an `<inertial>`
    without `<inertia>`, a point mass, gets zeros, with a warning.

    Args:
        source: A robot of this package, a path (`Path` or text), or the text itself (starting with `<`).
        field: Name of the parameter, for the error.

    Raises:
        ParameterError: If it is something else.
        DescriptionError: If the file cannot be read, is of another kind, or has features that cannot be translated.
        MissingDependency: If it is MJCF or SDF and the package that reads that is not installed.
    """
    if not isinstance(source, type) and callable(getattr(source, "urdf", None)):
        return str(source.urdf()), type(source).__name__
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return _with_point_masses(to_urdf(as_unicode(source), "the text"), "the text"), "the text"
    if not isinstance(source, str | Path):
        raise ParameterError(field, source, "a robot, a path, or URDF text (or that of MJCF or SDF)")
    try:
        text = read_xml(Path(source))
    except DescriptionError as error:
        raise DescriptionError(f"{error}; a path of a URDF, MJCF or SDF file or its text is required") from error
    urdf = to_urdf(with_absolute_paths(text, Path(source).parent), str(source), Path(source))
    return _with_point_masses(urdf, str(source)), str(source)


def _with_point_masses(urdf: str, label: str) -> str:
    """The same robot with zeros where a mass has no moments of inertia: Pinocchio's parser assumes them, and complains."""
    whole, count = _POINT_MASS.subn(rf"\1{_NO_INERTIA}</inertial>", urdf)
    if count:
        warnings.warn(f"{count} links of {label} have a mass and no <inertia>: point masses", stacklevel=4)
    return whole
