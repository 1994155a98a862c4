"""Shared libraries of generated C, and a controller that calls one."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel
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


class Controller:
    """What a control loop does with the file: an array of its own, and the places that the head of the file tells."""

    def __init__(self, solver: CompiledModel, folder: Path, *, name: str, **options: Any) -> None:
        text = solver.c_source(prefix=name, **options)
        self.path = build_library(folder, text, name)
        self.place = {key: int(value) for key, value in re.findall(rf"^enum {{ {name}_(\w+) = (\d+) }};$", text, re.MULTILINE)}
        self._library, self._name = ctypes.CDLL(str(self.path)), name
        self.w = (ctypes.c_double * self.place["WORKSPACE_SIZE"])()

    def put(self, name: str, values: Any) -> None:
        first = self.place[name]
        self.w[first : first + len(values)] = [float(value) for value in values]

    def get(self, name: str, count: int) -> np.ndarray:
        first = self.place[name]
        return np.array(self.w[first : first + count])

    def call(self, name: str, *rest: Any) -> int:
        function = getattr(self._library, f"{self._name}_{name}")
        function.restype = ctypes.c_int
        return int(function(self.w, *rest))

    def clear(self) -> None:
        ctypes.memset(self.w, 0, ctypes.sizeof(self.w))
