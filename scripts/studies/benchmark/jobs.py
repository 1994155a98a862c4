"""Every job of the benchmark, by the name that scripts/benchmark.py and `softrobots bench` know it by."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.core.progress import with_progress
from studies.benchmark import arm_jobs, motor_jobs, rod_jobs
from studies.benchmark.processes import bytes_per_case, first_answer
from studies.benchmark.race import Settings, figure
from studies.benchmark.results import AT_MOST, Curve, Results, Row
from studies.shared.machine import machine

Outcome = tuple[list[Row], list[Curve], list[str]]
"""Rows, curves and notes of a job."""


def _rows(job: Callable[[Settings], tuple[list[Row], list[str]]]) -> Callable[[Settings], Outcome]:
    def run(settings: Settings) -> Outcome:
        rows, notes = job(settings)
        return rows, [], notes

    return run


def _sizes(settings: Settings) -> Outcome:
    rows, curves = rod_jobs.sizes(settings)
    return rows, curves, []


def _batches(settings: Settings) -> Outcome:
    curves, notes = arm_jobs.batches(settings)
    return [], curves, notes


def _fresh(settings: Settings) -> Outcome:
    """The first answer of a process."""
    name, job = "compiled, python", "first answer in a fresh process without numba"
    try:
        starts = with_progress(range(settings.starts), settings.progress and "fresh processes", label="", unit="start")
        found = [first_answer() for _ in starts]
    except SoftRobotsError as error:
        return [figure(job, name, "s", str(error), AT_MOST, 1.0)], [], []
    stages = ", ".join(f"{stage} {np.median([start[stage] for start in found]):.3f} s" for stage in found[0])
    return (
        [figure(job, name, "s", np.array([start["total"] for start in found]), AT_MOST, 1.0)],
        [],
        [f"first answer, medians: {stages}"],
    )


def _memory(settings: Settings) -> Outcome:
    """Memory of a large batch."""
    job = f"memory a case of {settings.memory}, beyond inputs and outputs"
    values: FloatArray | str
    try:
        values = np.array([bytes_per_case(settings.memory, "numba")])
    except SoftRobotsError as error:
        values = str(error)
    return [figure(job, "compiled, numba, batch", "bytes", values, AT_MOST, 200.0)], [], []


JOBS: Mapping[str, Callable[[Settings], Outcome]] = {
    "equilibrium": _rows(arm_jobs.equilibria),
    "threads": _rows(arm_jobs.two_threads),
    "gravity": _rows(arm_jobs.under_gravity),
    "estimation": _rows(motor_jobs.load_estimation),
    "trajectory": _rows(motor_jobs.trajectory),
    "rod": _rows(rod_jobs.rods),
    "fresh": _fresh,
    "memory": _memory,
    "sizes": _sizes,
    "batches": _batches,
}
"""The jobs."""

PLAIN = "plain"
"""The job of `softrobots bench` if nothing is said: equilibria, short, against baselines that need no extras."""


def measure(settings: Settings, jobs: Sequence[str]) -> Results:
    """Run jobs, in their order.

    Args:
        settings: How much is measured.
        jobs: Names of the jobs, of `JOBS`, or `PLAIN`.

    Returns:
        The results; what cannot be measured here is in them, with the reason.
    """
    rows: list[Row] = []
    curves: list[Curve] = []
    notes: list[str] = []
    every = {PLAIN: _rows(arm_jobs.without_extras), **JOBS}
    chosen = [name for name in every if name in jobs]
    for name in chosen:
        more = every[name](settings)
        rows, curves, notes = rows + more[0], curves + more[1], notes + more[2]
    told = dataclasses.asdict(settings) | {"jobs": chosen}
    return Results(machine(), told, tuple(rows), tuple(curves), tuple(notes))
