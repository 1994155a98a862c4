"""A copy of the checkout with an environment of its own, for proofs that need other packages than those installed here."""

from __future__ import annotations

import filecmp
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from softrobots.core.errors import MissingDependency, OutputError


def find_uv() -> str:
    """Where uv is, which makes environments and installs into them.

    Raises:
        MissingDependency: If it is not installed.
    """
    try:
        from uv import find_uv_bin
    except ImportError as error:
        raise MissingDependency("uv", "dev") from error
    return str(find_uv_bin())


def copy_checkout(checkout: Path, folder: Path) -> None:
    """Copy the files of a checkout that git knows, or would; those that are the same in the copy already are left alone.

    Of an earlier copy, files that the checkout does not have any more go from the folders that it has.

    Args:
        checkout: Folder of the project.
        folder: The copy; a new folder, or an earlier copy.

    Raises:
        OutputError: If the checkout is not one of git, or a file cannot be copied.
    """
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(command, cwd=checkout, check=True, capture_output=True).stdout.decode().split("\0")
        names = {name for name in listed if (checkout / name).is_file() and folder not in (checkout / name).parents}
        for name in names:
            ours, copied = checkout / name, folder / name
            if not (copied.is_file() and filecmp.cmp(ours, copied, shallow=False)):
                copied.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ours, copied)  # with a time of its own: mutmut tells by it what has changed
        for top in {folder / name.partition("/")[0] for name in names if "/" in name}:
            for file in top.rglob("*"):
                if file.is_file() and file.relative_to(folder).as_posix() not in names and "__pycache__" not in file.parts:
                    file.unlink()
    except (OSError, subprocess.CalledProcessError) as error:
        raise OutputError(f"cannot copy {checkout} to {folder}: {error}") from error


def make_environment(copy: Path, python: str | Path, packages: Sequence[str], output: IO[str], *, lowest: bool = False) -> Path:
    """Make the environment `.venv` in a copy of the checkout.

    Args:
        copy: The copy.
        python: An interpreter, for uv.
        packages: What is installed, as pip takes it, e.g. "-e", ".[test]".
        output: File for what uv says.
        lowest: Whether everything that pyproject.toml names comes in its lowest version.

    Returns:
        The interpreter of the environment.

    Raises:
        MissingDependency: If uv is not installed.
        OutputError: If the environment cannot be made; the file says why.
    """
    result = copy / ".venv" / "bin" / "python"
    resolution = ["--resolution", "lowest-direct"] if lowest else []
    install = ["pip", "install", "-q", "--compile-bytecode", "--python", str(result), *resolution, *packages]
    for words in (["venv", "-q", "--python", str(python), str(result.parent.parent)], install):
        command = [find_uv(), *words]
        if status := subprocess.run(command, cwd=copy, stdout=output, stderr=output, check=False).returncode:
            raise OutputError(f"{' '.join(command)} failed with status {status}; see {output.name}")
    return result
