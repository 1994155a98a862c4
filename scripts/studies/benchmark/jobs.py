"""Every job of the benchmark, by the name that scripts/benchmark.py knows it by."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.core.progress import with_progress
from studies.benchmark import arm_jobs, contact_jobs, gradient_jobs, motion_jobs, motor_jobs, rod_jobs, tendon_jobs
from studies.benchmark.comparison import Outcome, Settings, figure
from studies.benchmark.processes import bytes_per_case, first_answer
from studies.benchmark.results import AT_MOST, Results
from studies.shared.machine import machine


def _fresh(settings: Settings) -> Outcome:
    """The first answer of a process."""
    name, job = "compiled, python", "first answer in a fresh process without numba"
    try:
        starts = with_progress(range(settings.starts), settings.progress and "fresh processes", label="", unit="start")
        answers = [first_answer() for _ in starts]
    except SoftRobotsError as error:
        return Outcome([figure(job, name, "s", str(error), AT_MOST, 1.0)])
    stages = ", ".join(f"{stage} {np.median([start[stage] for start in answers]):.3f} s" for stage in answers[0])
    row = figure(job, name, "s", np.array([start["total"] for start in answers]), AT_MOST, 1.0)
    return Outcome([row], notes=[f"first answer, medians: {stages}"])


def _memory(settings: Settings) -> Outcome:
    """Memory of a large batch."""
    job = f"memory a case of {settings.memory}, beyond inputs and outputs"
    values: FloatArray | str
    try:
        values = np.array([bytes_per_case(settings.memory, "numba")])
    except SoftRobotsError as error:
        values = str(error)
    return Outcome([figure(job, "compiled, numba, batch", "bytes", values, AT_MOST, 200.0)])


JOBS: Mapping[str, Callable[[Settings], Outcome]] = {
    "equilibrium": arm_jobs.equilibria,
    "threads": arm_jobs.two_threads,
    "gravity": arm_jobs.under_gravity,
    "estimation": motor_jobs.load_estimation,
    "trajectory": motor_jobs.trajectory,
    "rod": rod_jobs.rods,
    "fresh": _fresh,
    "memory": _memory,
    "sizes": rod_jobs.sizes,
    "batches": arm_jobs.batches,
    "motion": motion_jobs.motion,
    "tendons": tendon_jobs.tendons,
    "gradients": gradient_jobs.gradients,
    "contact": contact_jobs.contact,
}
"""The jobs."""


def measure(settings: Settings, jobs: Sequence[str]) -> Results:
    """Run jobs.

    Args:
        settings: How much is measured.
        jobs: Names in `JOBS`; they run in the order of that table.

    Returns:
        The results; what cannot be measured on this machine is a row with the reason.
    """
    chosen = [name for name in JOBS if name in jobs]
    outcomes = [JOBS[name](settings) for name in chosen]
    rows = tuple(row for outcome in outcomes for row in outcome.rows)
    curves = tuple(curve for outcome in outcomes for curve in outcome.curves)
    notes = tuple(note for outcome in outcomes for note in outcome.notes)
    return Results(machine(), dataclasses.asdict(settings) | {"jobs": chosen}, rows, curves, notes)
