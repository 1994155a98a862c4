"""Shared libraries of generated C."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from tests.conftest import missing

FLAGS = [
    *("-std=c99", "-O2", "-ffreestanding", "-nostdlib", "-shared", "-fPIC", "-ffp-contract=off"),
    *("-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wmissing-prototypes", "-Werror"),
]


def build_library(folder: Path, text: str, name: str) -> Path:
    """A shared library of a C file, without the C library."""
    if not shutil.which("gcc"):
        missing("gcc is not installed (Debian: apt-get install gcc)")
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    source.write_text(text, encoding="ascii")
    done = subprocess.run(["gcc", *FLAGS, str(source), "-o", str(library)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, ""), f"{done.stderr}\n{text}"
    return library
