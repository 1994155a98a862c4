"""The formats by name, and the function that writes a robot into a file."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.errors import ParameterError
from softrobots.core.files import as_path, new_file, write_text
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.export.meshes import MeshFolder
from softrobots.export.mjcf import to_mjcf
from softrobots.export.sdf import to_sdf
from softrobots.export.sidecar import to_json
from softrobots.export.snippets import to_pinocchio, to_pybullet
from softrobots.export.urdf import to_urdf
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import XacroRobot


class Format(NamedTuple):
    """A file format."""

    suffix: str
    """Suffix of its files."""
    write: Callable[..., str]
    """Returns the text from the model, for some formats `q_motors`, and options."""
    meaning: str
    """Tools that read it."""

    @property
    def options(self) -> tuple[str, ...]:
        """Names of the arguments of `write` besides the model."""
        return tuple(inspect.signature(self.write).parameters)[1:]


FORMATS: Mapping[str, Format] = {
    "mjcf": Format(".xml", to_mjcf, "MuJoCo"),
    "sdf": Format(".sdf", to_sdf, "Drake and Gazebo"),
    "urdf": Format(".urdf", to_urdf, "whatever reads URDF, with mesh files; springs are tags there"),
    "pybullet": Format(".py", to_pybullet, "PyBullet, as Python with springs as torques"),
    "pinocchio": Format(".py", to_pinocchio, "Pinocchio, as Python with springs and a solver"),
    "json": Format(".json", to_json, "any other tool, as a table of what URDF readers miss"),
}
"""The formats by name."""


def export_model(
    source: Any, path: str | os.PathLike[str], format: str | None = None, *, overwrite: bool = False, **options: Any
) -> Path:
    """Write a robot into a file of another tool's format.

    Args:
        source: A model, or what `load_model` takes: a robot, a path, or text.
        path: The file.
        format: Name of the format, one of `FORMATS`; by default from the suffix of the file, if only one format has it.
        overwrite: Whether a file that exists may be replaced.
        options: For the exporter: `q_motors`, `actuators`, `damping`, `gravity`, `limits`, `environment`, `friction`,
            `mesh_folder`, `robot`; see `to_mjcf` ... Meshes copied to `mesh_folder` are named relative to the file, so that
            both can be moved together.

    Returns:
        The path.

    Raises:
        ParameterError: If the format is unknown or not determined by the suffix, it has no such option, or the exporter
            refuses an argument or the robot.
        DescriptionError: If the source cannot be loaded or the exporter refuses the robot.
        NameNotFound: As `load_model`.
        OutputExists: If the file exists and `overwrite` is false, or is a folder.
        OutputError: If it cannot be written.
    """
    name = format if format is not None else guess_format(path)
    if not isinstance(name, str) or name not in FORMATS:
        raise ParameterError("format", name, f"one of {', '.join(FORMATS)}")
    chosen = FORMATS[name]
    for option, value in options.items():
        if option not in chosen.options:
            available = ", ".join(other for other, row in FORMATS.items() if option in row.options)
            raise ParameterError(option, value, f"left out for {name}; formats that have it: {available or 'none'}")
    new_file(path, overwrite=overwrite)
    model = source if isinstance(source, SoftModel) else load_model(source)
    if "robot" in chosen.options and isinstance(source, XacroRobot):
        options = {"robot": source} | options
    beside = Path(path).absolute().parent
    if options.get("mesh_folder") is not None:
        place = as_path("mesh_folder", options["mesh_folder"]).absolute()
        options |= {"mesh_folder": MeshFolder(place, Path(os.path.relpath(place, beside)))}
    elif chosen.write is to_sdf and any(isinstance(obstacle, Mesh) for obstacle in _obstacles(options.get("environment"))):
        options |= {"mesh_folder": beside}
    return write_text(path, chosen.write(model, **options), overwrite=overwrite)


def _obstacles(environment: Any) -> tuple[Any, ...]:
    return tuple(environment) if isinstance(environment, Environment) else ()  # the exporter refuses anything else


def guess_format(path: str | os.PathLike[str]) -> str:
    """Return the format that has the suffix of a file.

    Raises:
        ParameterError: If no format or several have it, or `path` is no path.
    """
    suffix = as_path("path", path).suffix.lower()
    names = [name for name, row in FORMATS.items() if row.suffix == suffix]
    if len(names) != 1:
        candidates = ", ".join(names) or ", ".join(f"{name} ({row.suffix})" for name, row in FORMATS.items())
        raise ParameterError("path", str(path), f"a name that only one format has; else give --format or format=: {candidates}")
    return names[0]
