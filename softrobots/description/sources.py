"""Sources of a description: a robot of this package, a file, or text; in URDF, MJCF or SDF."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.core.xml_input import as_unicode, read_xml
from softrobots.description.mesh_files import with_absolute_paths
from softrobots.description.readers import to_urdf


class Robot(Protocol):
    """Object with a URDF description."""

    def urdf(self) -> str:
        """Return the robot as URDF text."""


def read_source(source: Any, field: str = "source") -> tuple[str, str]:
    """Return a description as URDF text, and its origin for errors.

    MJCF and SDF are translated (`softrobots.description.readers`). Relative paths of meshes are made absolute.

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
        return to_urdf(as_unicode(source), "the text"), "the text"
    if not isinstance(source, str | Path):
        raise ParameterError(field, source, "a robot, a path, or URDF text (or that of MJCF or SDF)")
    try:
        text = read_xml(Path(source))
    except DescriptionError as error:
        raise DescriptionError(f"{error}; a path of a URDF, MJCF or SDF file or its text is required") from error
    return to_urdf(with_absolute_paths(text, Path(source).parent), str(source), Path(source)), str(source)
