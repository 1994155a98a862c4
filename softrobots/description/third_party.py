"""Files of third-party robots in the package example-robot-data."""

from __future__ import annotations

from pathlib import Path

from softrobots.core.errors import MissingDependency, NameNotFound

UR5 = "ur_description/urdf/ur5_robot.urdf"
"""The UR5 of Universal Robots."""

_SHARE = "cmeel.prefix/share"  # the data folder of the wheel, which has no Python module


def robot_file(name: str) -> Path:
    """Return the path of a robot description of example-robot-data.

    Args:
        name: Path below its folder `robots`, e.g. `UR5`.

    Raises:
        MissingDependency: If example-robot-data is not installed (extra `robots`).
        NameNotFound: If it has no such file.
    """
    folder = _share() / "example-robot-data" / "robots"
    path = folder / name
    if not path.is_file():
        raise NameNotFound("robot file", name, sorted(str(file.relative_to(folder)) for file in folder.rglob("*.urdf")))
    return path


def package_folders() -> list[str]:
    """Return the folders of `package://` paths of mesh files; empty without example-robot-data."""
    try:
        return [str(_share())]
    except MissingDependency:
        return []


def _share() -> Path:
    from importlib import metadata  # slow to import

    try:
        distribution = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError as error:
        raise MissingDependency("example-robot-data", "robots") from error
    return Path(str(distribution.locate_file(_SHARE))).resolve()
