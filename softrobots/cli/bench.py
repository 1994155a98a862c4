"""`softrobots bench`: what the solvers cost on this machine, compiled against Pinocchio from Python."""

from __future__ import annotations

import argparse
import json
import math
import platform
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from softrobots.cli.reports.answers import add_json, aligned, tell
from softrobots.compiled.run.compiled_model import compile_model
from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file, write_text
from softrobots.core.progress import with_progress
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.inverse_kinematics import solve_ik
from softrobots.statics.load_estimation import estimate_load
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.statics.trajectory import follow_trajectory
from softrobots.version import __version__

JOBS = ("equilibrium", "gravity", "estimation", "trajectory", "batch")
_CASES, _QUICK_CASES = 100, 5
_FORCE = 18.027756377319946  # [N], the size of the paper's load (0, 10, -15) N
_SHORTEST = 0.02  # [s], least time of a timed run
_EXAMPLES = f"""examples:
  softrobots bench                                   every job, a quarter of a minute
  softrobots bench --only estimation trajectory      some jobs
  softrobots bench -o mine.json                      also as a file

Jobs for --only: {", ".join(JOBS)}.

Each row times the inflatable arm with the public functions on Pinocchio and with `softrobots.compile`, in turn and on one
thread, with random motor angles and forces of {_FORCE:.1f} N. Costs are CPU seconds of a case, medians over the rounds; the
ratio is taken within each round. The first run compiles for some seconds; the code is kept (`softrobots doctor` tells where).
Other baselines (MuJoCo, SciPy, Pink, C++), long chains, start-up and memory are in scripts/benchmark.py of the repository.
"""


class Row(NamedTuple):
    """One job, measured."""

    job: str
    """Its name, one of `JOBS`."""
    compiled_seconds: float
    """CPU time of a case by the compiled solver, median over the rounds [s]."""
    pinocchio_seconds: float
    """The same on Pinocchio from Python [s]."""
    ratio: float
    """How many times the compiled solver is faster: median over the rounds of the ratio within a round."""
    low: float
    """The smallest ratio of a round."""
    high: float
    """The largest."""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "bench",
        help="measure how fast the solvers are on this machine",
        description="Time equilibria, load estimation and inverse kinematics of the inflatable arm, compiled and on Pinocchio.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("--only", nargs="+", choices=JOBS, default=JOBS, metavar="JOB", help="run these jobs (all)")
    parser.add_argument("--quick", action="store_true", help=f"{_QUICK_CASES} cases instead of {_CASES}: a trial run")
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="rounds of each job [-] (5)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="also write the results to a new file (none)")
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure and tell."""
    if arguments.rounds < 1:
        raise ParameterError("--rounds", arguments.rounds, "at least 1")
    if arguments.output is not None:
        new_file(arguments.output, overwrite=arguments.overwrite)  # refused before the work
    model = load_model(InflatableArm())
    compiled = compile_model(model)
    solvers = _solvers(model, compiled, _QUICK_CASES if arguments.quick else _CASES)
    chosen = [job for job in JOBS if job in arguments.only]
    rows = [_measure(job, *solvers[job], arguments.rounds) for job in with_progress(chosen, True, label="jobs", unit="job")]
    machine = {"softrobots": __version__, "python": platform.python_version(), "platform": platform.platform()}
    answer = {"machine": machine | {"backend": compiled.backend}, "rows": [row._asdict() for row in rows]}
    lines = [f"{', '.join(f'{name} {text}' for name, text in machine.items())}; compiled by {compiled.backend}", ""]
    table: list[tuple[str, ...]] = [("job", "compiled [us a case]", "on Pinocchio [us a case]", "times faster (rounds)")]
    for row in rows:
        costs = (f"{1e6 * seconds:.3g}" for seconds in (row.compiled_seconds, row.pinocchio_seconds))
        table.append((row.job, *costs, f"{row.ratio:.3g} ({row.low:.3g} to {row.high:.3g})"))
    lines += aligned(table)
    if arguments.output is not None:
        text = json.dumps(answer, indent=1) + "\n"
        lines += ["", f"{write_text(arguments.output, text, overwrite=arguments.overwrite)}: written"]
    tell(arguments, answer, lines)


def _solvers(model: SoftModel, compiled: Any, count: int) -> Mapping[str, tuple[int, Callable[[], Any], Callable[[], Any]]]:
    """By job: how many cases a run has, the compiled run, and the run on Pinocchio."""
    random = np.random.default_rng(0)
    motors = random.uniform(-np.pi, np.pi, (count, model.n_motors))
    forces = random.normal(size=(count, 3))
    forces *= _FORCE / np.linalg.norm(forces, axis=1, keepdims=True)
    torques = np.array([solve_equilibrium(model, *case).motor_torques for case in zip(motors, forces, strict=True)])
    force = np.array([0.0, 10.0, -15.0])
    targets = np.linspace((0.9, 0.3, 0.2), (0.9, -0.2, 0.1), count)
    start = solve_ik(model, targets[0], force, elbow="up").q_motors

    def each(solve: Callable[..., Any], rows: Any, **options: Any) -> Callable[[], Any]:
        return lambda: [solve(*case, **options) for case in zip(motors, rows, strict=True)]

    def on_pinocchio(solve: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *case, **options: solve(model, *case, **options)

    equilibrium, estimate = on_pinocchio(solve_equilibrium), on_pinocchio(estimate_load)
    return {
        "equilibrium": (count, each(compiled.equilibrium, forces), each(equilibrium, forces)),
        "gravity": (
            count,
            each(compiled.equilibrium, forces, gravity=EARTH_GRAVITY),
            each(equilibrium, forces, gravity=EARTH_GRAVITY),
        ),
        "estimation": (count, each(compiled.estimate_load, torques), each(estimate, torques)),
        "trajectory": (
            count,
            lambda: compiled.follow(targets, force, q_motors0=start),
            lambda: follow_trajectory(model, targets, force, q_motors0=start),
        ),
        "batch": (count, lambda: compiled.equilibria(motors, forces, threads=1), each(equilibrium, forces)),
    }


def _measure(job: str, cases: int, compiled: Callable[[], Any], pinocchio: Callable[[], Any], rounds: int) -> Row:
    """Time two runs in turn, round after round, on one thread; each is run once before to warm up."""
    seconds = np.zeros((rounds, 2))
    with threadpool_limits(limits=1, user_api="blas"):
        repeats = [math.ceil(_SHORTEST / max(_cpu_seconds(call, 1), 1e-7)) for call in (compiled, pinocchio) if call()]
        for row in seconds:
            row[:] = [_cpu_seconds(*pair) for pair in zip((compiled, pinocchio), repeats, strict=True)]
    ratios = seconds[:, 1] / seconds[:, 0]
    ours, theirs = (float(value) / cases for value in np.median(seconds, axis=0))
    return Row(job, ours, theirs, *(float(pick(ratios)) for pick in (np.median, np.min, np.max)))


def _cpu_seconds(call: Callable[[], Any], repeats: int) -> float:
    """CPU time of one call, over some repeats [s]."""
    began = time.process_time()
    for _ in range(repeats):
        call()
    return max(time.process_time() - began, 1e-9) / repeats
