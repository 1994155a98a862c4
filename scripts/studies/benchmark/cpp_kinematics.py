"""Forward kinematics with Pinocchio in C++, compiled against the headers of the wheel and called in this process.

Needs g++ and Eigen (Debian: g++, libeigen3-dev); takes a minute to compile. The loop over configurations is in C++.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.model.soft_model import SoftModel
from studies.benchmark.aligned_joints import aligned_joints

SOURCE = Path(__file__).with_name("forward_kinematics.cc")
"""What is compiled."""

EIGEN = Path("/usr/include/eigen3")
"""Where Debian keeps the headers of Eigen."""

# Boost's preprocessed lists end at 20 joint types, and a native build needs calls of up to 10 arguments.
_FLAGS = (
    "-O3", "-march=native", "-DNDEBUG", "-std=c++17", "-shared", "-fPIC", "-w",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
)  # fmt: skip


def missing_tools() -> list[str]:
    """What the compilation needs and this machine does not have, in words; empty if it can start."""
    headers = pinocchio_headers()
    return [
        *([] if shutil.which("g++") else ["g++"]),
        *([] if EIGEN.is_dir() else [f"Eigen in {EIGEN} (Debian: libeigen3-dev)"]),
        *([] if headers is not None and headers.is_dir() else ["Pinocchio's headers, which the package pin brings along"]),
    ]


def pinocchio_headers() -> Path | None:
    """Folder of Pinocchio's headers in the wheel, or None if it was not installed from one."""
    for package in ("libpinocchio", "pin"):
        try:
            found = Path(str(metadata.distribution(package).locate_file("cmeel.prefix/include")))
        except metadata.PackageNotFoundError:
            continue
        if (found / "pinocchio").is_dir():
            return found.resolve()
    return None


def build() -> Any:
    """Compile and load the library.

    Raises:
        SoftRobotsError: If a tool is missing, or the compiler refuses.
    """
    lacking = missing_tools()
    if lacking:
        raise SoftRobotsError(f"C++ kinematics needs {', '.join(lacking)}")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "forward_kinematics.so"
        command = ["g++", *_FLAGS, f"-I{pinocchio_headers()}", f"-isystem{EIGEN}", str(SOURCE), "-o", str(library)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            told = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr[-300:])
            raise SoftRobotsError(f"g++ refuses {SOURCE.name}: {told}")
        return ctypes.CDLL(str(library))


class CppChain:
    """A robot in C++."""

    def __init__(self, model: SoftModel, library: Any) -> None:
        """Hand the joints over.

        Args:
            model: The robot, a chain of joints.
            library: What `build` returned.

        Raises:
            ParameterError: If the robot has branches.
        """
        joints = aligned_joints(model)
        self._joints, self._library, self._size = joints, library, len(joints.slides)
        placements = np.concatenate([joints.rotations.reshape(-1, 9), joints.translations], axis=1)
        slides = (ctypes.c_int * self._size)(*joints.slides)
        library.chain_new.restype = ctypes.c_void_p
        library.chain_new.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
        library.chain_forward.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p]
        library.chain_delete.argtypes = [ctypes.c_void_p]
        self._handle = library.chain_new(self._size, slides, np.ascontiguousarray(placements).ctypes.data)

    def last_joints(self, q: FloatArray) -> FloatArray:
        """Run `forwardKinematics` for each configuration.

        Args:
            q: Configurations, shape (n, nv) [rad or m].

        Returns:
            Origin of the last joint, shape (n, 3) [m].
        """
        given = np.ascontiguousarray(q)
        made = np.zeros((len(given), 3))
        self._library.chain_forward(self._handle, len(given), given.ctypes.data, made.ctypes.data)
        return made

    def __del__(self) -> None:
        """Free the memory in C++."""
        if not sys.is_finalizing() and getattr(self, "_handle", None):
            self._library.chain_delete(self._handle)
