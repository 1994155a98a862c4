"""`softrobots bench`: time the compiled solvers against those on Pinocchio, on this machine."""

from __future__ import annotations

import argparse
import functools
import math
import platform
import time
import timeit
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.compiled.run.compiled_model import CompiledModel, compile_model
from softrobots.core.errors import ParameterError
from softrobots.core.progress import with_progress
from softrobots.core.summary import aligned
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
"""What is timed: equilibria one by one, weightless or under gravity, load estimates, a path, a batch of equilibria."""

_CASES, _QUICK_CASES = 100, 5
_FORCE = math.hypot(10.0, 15.0)  # [N], magnitude of the paper's load (0, 10, -15) N
_LEAST_TIME = 0.02  # [s], a run is repeated until it takes this long
_EXAMPLES = f"""examples:
  softrobots bench                                   every job, a quarter of a minute
  softrobots bench --only estimation trajectory      some jobs
  softrobots bench --json > mine.json                for a machine

Jobs for --only: {", ".join(JOBS)}.

Each row times the inflatable arm with the public functions on Pinocchio and with `softrobots.compile`, in turn and on one
thread, with random motor angles and forces of {_FORCE:.1f} N. Costs are CPU time per case, medians over the rounds; the
ratio is taken within each round. The first run compiles for some seconds; the code is cached (`softrobots doctor` shows where).
Other baselines (MuJoCo, SciPy, Pink, C++), long chains, start-up and memory are in scripts/benchmark.py of the repository.
"""


class Job(NamedTuple):
    """The same cases for both solvers."""

    cases: int
    """Number of cases in one run."""
    compiled: Callable[[], object]
    """Solves all cases with the compiled solver."""
    pinocchio: Callable[[], object]
    """Solves all cases with the public functions on Pinocchio."""


class Row(NamedTuple):
    """The measurement of one job."""

    job: str
    """Its name, one of `JOBS`."""
    compiled_seconds: float
    """CPU time per case of the compiled solver, median over the rounds [s]."""
    pinocchio_seconds: float
    """The same on Pinocchio from Python [s]."""
    ratio: float
    """Speed-up of the compiled solver: median over the rounds of the ratio within a round."""
    low: float
    """The smallest ratio of a round."""
    high: float
    """The largest ratio of a round."""


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
    parser.add_argument("--rounds", type=int, default=5, metavar="N", help="rounds of each job [-] (%(default)s)")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure the jobs and print the table."""
    if arguments.rounds < 1:
        raise ParameterError("--rounds", arguments.rounds, "at least 1")
    model = load_model(InflatableArm())
    compiled = compile_model(model)
    jobs = prepare_jobs(model, compiled, _QUICK_CASES if arguments.quick else _CASES)
    chosen = [name for name in JOBS if name in arguments.only]
    rows = [measure(name, jobs[name], arguments.rounds) for name in with_progress(chosen, True, label="jobs", unit="job")]
    machine = {"softrobots": __version__, "python": platform.python_version(), "platform": platform.platform()}
    answer = {"machine": machine | {"backend": compiled.backend}, "rows": [row._asdict() for row in rows]}
    table = [("job", "compiled [us/case]", "on Pinocchio [us/case]", "speed-up (range over the rounds)")]
    for row in rows:
        costs = (f"{1e6 * row.compiled_seconds:.3g}", f"{1e6 * row.pinocchio_seconds:.3g}")
        table.append((row.job, *costs, f"{row.ratio:.3g} ({row.low:.3g} to {row.high:.3g})"))
    head = f"{', '.join(f'{name} {value}' for name, value in machine.items())}; compiled by {compiled.backend}"
    print_answer(arguments, answer, [head, "", *aligned(table)])


def prepare_jobs(model: SoftModel, compiled: CompiledModel, count: int) -> Mapping[str, Job]:
    """Return every job by name, with that many cases, or waypoints, for a model and the same model compiled."""
    random = np.random.default_rng(0)
    motors = random.uniform(-np.pi, np.pi, (count, model.n_motors))
    forces = random.normal(size=(count, 3))
    forces *= _FORCE / np.linalg.norm(forces, axis=1, keepdims=True)
    torques = np.array([solve_equilibrium(model, *case).motor_torques for case in zip(motors, forces, strict=True)])
    force = np.array([0.0, 10.0, -15.0])
    targets = np.linspace((0.9, 0.3, 0.2), (0.9, -0.2, 0.1), count)
    start = solve_ik(model, targets[0], force, elbow="up").q_motors

    on_pinocchio, heavy = functools.partial(solve_equilibrium, model), {"gravity": EARTH_GRAVITY}

    def each(solve: Callable[..., object], inputs: Any, **options: Any) -> Callable[[], object]:
        """Solve one case after the other."""
        return lambda: [solve(*case, **options) for case in zip(motors, inputs, strict=True)]

    return {
        "equilibrium": Job(count, each(compiled.equilibrium, forces), each(on_pinocchio, forces)),
        "gravity": Job(count, each(compiled.equilibrium, forces, **heavy), each(on_pinocchio, forces, **heavy)),
        "estimation": Job(
            count, each(compiled.estimate_load, torques), each(functools.partial(estimate_load, model, restart=False), torques)
        ),
        "trajectory": Job(
            count,
            lambda: compiled.follow(targets, force, q_motors0=start),
            lambda: follow_trajectory(model, targets, force, q_motors0=start),
        ),
        "batch": Job(count, lambda: compiled.equilibria(motors, forces, threads=1), each(on_pinocchio, forces)),
    }


def measure(name: str, job: Job, rounds: int) -> Row:
    """Time both solvers in turn, round after round, on one thread; each runs once before, to compile and to warm up."""
    solvers = (job.compiled, job.pinocchio)
    seconds = np.zeros((rounds, 2))
    with threadpool_limits(limits=1, user_api="blas"):
        for solve in solvers:
            solve()
        repeats = [_repeats(solve) for solve in solvers]
        for row in seconds:
            row[:] = [_cpu_seconds(*pair) for pair in zip(solvers, repeats, strict=True)]
    ratios = seconds[:, 1] / seconds[:, 0]
    costs = np.median(seconds, axis=0) / job.cases
    return Row(name, *costs.tolist(), *(float(statistic(ratios)) for statistic in (np.median, np.min, np.max)))


def _repeats(solve: Callable[[], object]) -> int:
    """How often a job runs to take `_LEAST_TIME`: doubled until it does, because the clock may be too coarse for one run."""
    count = 1
    while _cpu_seconds(solve, count) * count < _LEAST_TIME:
        count *= 2
    return count


def _cpu_seconds(solve: Callable[[], object], repeats: int) -> float:
    """CPU time of one run, averaged over repeats [s]."""
    return max(timeit.timeit(solve, timer=time.process_time, number=repeats), 1e-9) / repeats
