"""What only a process of its own can show: the first answer after a start, and the memory of a large batch."""

from __future__ import annotations

import ctypes
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.errors import SoftRobotsError
from studies.benchmark.cases import arm, standard_cases
from studies.benchmark.compiled_solvers import compiled

FIRST_ANSWER = """
import time
began = time.perf_counter()
import softrobots
imported = time.perf_counter()
model = softrobots.load_model(softrobots.InflatableArm())
loaded = time.perf_counter()
solver = softrobots.compile(model, backend="python")
compiled = time.perf_counter()
solver.equilibrium((0.3, 0.6, -0.8), (0.0, 10.0, -15.0))
solved = time.perf_counter()
import json, sys
stages = {"import": imported - began, "load": loaded - imported, "compile": compiled - loaded, "solve": solved - compiled}
print(json.dumps({"stages": stages, "numba": "numba" in sys.modules}))
"""
"""A program that needs nothing but the required packages, and says where its time goes."""

_STATUS = Path("/proc/self/status")
_SCRIPTS = Path(__file__).resolve().parents[2]


def first_answer() -> dict[str, float]:
    """Start a Python that solves one equilibrium without numba.

    Returns:
        Wall clock in all ("total") and of each stage [s]; "start" is the interpreter's.

    Raises:
        SoftRobotsError: If it fails, or imports numba.
    """
    began = time.perf_counter()
    text = _run(FIRST_ANSWER)
    total = time.perf_counter() - began
    if text["numba"]:
        raise SoftRobotsError("the first answer without the extra `fast` imports numba")
    stages: dict[str, float] = text["stages"]
    return {"total": total, "start": total - sum(stages.values()), **stages}


def bytes_per_case(count: int, backend: str) -> float:
    """Memory of a batch beyond its inputs and outputs, in a process of its own [bytes a case].

    Args:
        count: Number of cases.
        backend: The back end.

    Raises:
        SoftRobotsError: If the process fails.
    """
    call = f"from studies.benchmark.processes import peak_bytes; print(peak_bytes({count}, {backend!r}))"
    return float(_run(f"import json; {call}")) / count


def peak_bytes(count: int, backend: str) -> int:
    """Solve a batch here; how far memory rises above its level before, outputs not counted [bytes].

    The solver is made and used once before, so that code and its compiler do not count.
    """
    solver, cases = compiled(arm(), backend), standard_cases(count)
    solver.equilibria(*cases.first(64))
    before = _reset_peak()
    result = solver.equilibria(*cases)
    risen = _peak() - before
    outputs = (result.q_springs, result.status, result.residual, result.tip_positions)
    return max(0, risen - sum(np.asarray(array).nbytes for array in outputs))


def _reset_peak() -> int:
    """Give freed memory back and forget the peak so far, where Linux lets one; return the present level [bytes]."""
    try:
        ctypes.CDLL(None).malloc_trim(0)  # of glibc, which keeps what was freed for the next array
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    except (OSError, AttributeError):
        return _peak()
    return _status("VmRSS")


def _peak() -> int:
    """Largest resident memory so far [bytes]."""
    if _STATUS.is_file():
        return _status("VmHWM")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _status(field: str) -> int:
    (line,) = (line for line in _STATUS.read_text(encoding="utf-8").splitlines() if line.startswith(f"{field}:"))
    return int(line.split()[1]) * 1024


def _run(code: str) -> Any:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(_SCRIPTS)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # or every start compiles the package anew
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        last = done.stderr.strip().splitlines()[-1:] or ["no message"]
        raise SoftRobotsError(f"a process of the benchmark failed: {last[0]}")
    return json.loads(done.stdout)
