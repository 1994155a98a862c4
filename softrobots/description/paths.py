"""The folders xacro/ and urdf/ of the robot descriptions, in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from softrobots.core.errors import DescriptionError

_PACKAGE = Path(__file__).resolve().parent.parent


def _folder(name: str) -> Path:
    """Find a data folder of the project.

    In a wheel the folder is inside the package, in a checkout (also after `pip install -e`) beside it; `pyproject.toml`
    distinguishes a checkout from site-packages, where a folder called `xacro` is another package.
    """
    if (_PACKAGE / name).is_dir():
        return _PACKAGE / name
    if (_PACKAGE.parent / "pyproject.toml").is_file() and (_PACKAGE.parent / name).is_dir():
        return _PACKAGE.parent / name
    raise DescriptionError(f"softrobots was installed without its folder {name}/; install it again")


def xacro_folder() -> Path:
    """Return the folder of the xacro sources.

    Raises:
        DescriptionError: If the installation lacks it.
    """
    return _folder("xacro")


def urdf_folder() -> Path:
    """Return the folder of the generated URDF files.

    Raises:
        DescriptionError: If the installation lacks it.
    """
    return _folder("urdf")
