"""Generate the committed URDF files from xacro, or check that they are up to date."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_bytes
from softrobots.description.paths import urdf_folder
from softrobots.robots import ROBOTS


def main(argv: list[str] | None = None) -> int:
    """Write every robot of `softrobots.ROBOTS` with its default parameters; with --check, only compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; exit with status 1 if a file differs")
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="folder of the files (urdf/ of the project)")
    arguments = parser.parse_args(argv)
    folder = arguments.output or urdf_folder()
    if folder.exists() and not folder.is_dir():
        parser.error(f"--output {folder} is a file; a folder is required")
    return exit_status(lambda: not (update(folder, check=arguments.check) and arguments.check))


def update(folder: Path, *, check: bool) -> int:
    """Write or compare the files in a folder; return how many differed."""
    stale = 0
    for name, robot in ROBOTS.items():
        path, content = folder / f"{name}.urdf", robot().urdf().encode("utf-8")
        same = path.is_file() and path.read_bytes() == content
        if not check and not same:
            make_folder(folder)
            write_bytes(path, content, overwrite=True)
        stale += not same
        print(f"{path}: {'up to date' if same else 'differs' if check else 'written'}")
    return stale


if __name__ == "__main__":
    sys.exit(main())
