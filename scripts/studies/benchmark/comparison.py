"""Workloads that are timed in turn and compared in rows; those that cannot run are listed with the reason."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from studies.benchmark.measurement import Clock, Workload, interleaved, ratio, spread
from studies.benchmark.results import Curve, Row


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    rounds: int = 9
    """Rounds of every comparison."""
    batch: int = 100_000
    """Cases of a batch."""
    singles: int = 200
    """Cases that are solved one by one."""
    waypoints: int = 200
    """Waypoints of the trajectory."""
    sections: int = 50
    """Sections of the rod."""
    memory: int = 1_000_000
    """Cases of the batch whose memory is measured."""
    starts: int = 5
    """Fresh processes."""
    sizes: tuple[int, ...] = (2, 5, 10, 20, 50)
    """Sections of the rods in the picture."""
    batches: tuple[int, ...] = (1, 10, 100, 1000, 10_000, 100_000)
    """Batches in the picture."""
    shortest: float = 0.02
    """Least time of a turn [s]."""
    quick: bool = False
    """Whether these are small sizes for a test run."""
    progress: bool = False
    """Whether to show bars on stderr."""


def quick_settings(rounds: int, progress: bool) -> Settings:
    """Small sizes, to test that everything runs; the figures are meaningless."""
    return Settings(
        rounds, batch=200, singles=5, waypoints=20, sections=3, memory=20_000, starts=1, sizes=(2, 3), batches=(1, 50),
        shortest=0.0, quick=True, progress=progress,
    )  # fmt: skip


class Outcome(NamedTuple):
    """Results of a job."""

    rows: Sequence[Row] = ()
    """The comparisons."""
    curves: Sequence[Curve] = ()
    """The curves."""
    notes: Sequence[str] = ()
    """Remarks for the page."""


@dataclass
class Comparison:
    """Workloads that are timed in turn, and their times."""

    settings: Settings
    """How much is measured."""
    label: str
    """Label of the progress bar."""
    clock: Clock = time.process_time
    """The clock."""
    workloads: dict[str, Workload] = field(default_factory=dict)
    """By name."""
    absent: dict[str, str] = field(default_factory=dict)
    """Reason by name of a workload that cannot run."""
    seconds: Mapping[str, FloatArray] = field(default_factory=dict)
    """Seconds a case by name, shape (rounds,), after `run`."""

    def add(self, name: str, make: Callable[[], Workload]) -> None:
        """Add a workload, or note why it cannot run: an extra is missing, or its answers are wrong."""
        try:
            self.workloads[name] = make()
        except SoftRobotsError as error:
            self.absent[name] = str(error)

    def run(self) -> Comparison:
        """Time the workloads."""
        progress: Any = self.label if self.settings.progress else False
        self.seconds = interleaved(
            self.workloads, self.settings.rounds, clock=self.clock, shortest=self.settings.shortest, progress=progress
        )
        return self

    def cost(self, name: str) -> float | None:
        """Return the median seconds a case, or None if it was not timed."""
        return spread(self.seconds[name]).median if name in self.seconds else None

    def cheaper(self, job: str, ours: str, baseline: str, bound: str = "", target: float | None = None) -> Row:
        """Return the row of how many times cheaper `ours` is."""
        return self._row(job, ours, baseline, "times cheaper", bound, target, inverse=False)

    def costlier(self, job: str, ours: str, baseline: str, bound: str = "", target: float | None = None) -> Row:
        """Return the row of how many times as much `ours` costs."""
        return self._row(job, ours, baseline, "times as costly", bound, target, inverse=True)

    def _row(self, job: str, ours: str, baseline: str, unit: str, bound: str, target: float | None, *, inverse: bool) -> Row:
        reasons = [f"{name}: {self.absent[name]}" for name in (ours, baseline) if name in self.absent]
        figures: tuple[float | None, float | None, float | None] = (None, None, None)
        if not reasons:
            above, below = (ours, baseline) if inverse else (baseline, ours)
            figures = tuple(ratio(self.seconds[above], self.seconds[below]))  # type: ignore[assignment]
        wall = "wall" if self.clock is time.perf_counter else "CPU"
        return Row(
            job, ours, baseline, unit, *figures, bound, target, self.cost(ours), self.cost(baseline), wall, "; ".join(reasons)
        )


def figure(job: str, ours: str, unit: str, values: FloatArray | str, bound: str, target: float) -> Row:
    """Return a row without baseline: a time or a size.

    Args:
        job: What is done.
        ours: By what.
        unit: "s" or "bytes".
        values: What was measured, shape (n,), or why it was not.
        bound: `AT_LEAST` or `AT_MOST`.
        target: The target.
    """
    if isinstance(values, str):
        return Row(job, ours, "", unit, None, None, None, bound, target, None, None, "wall", values)
    summary = spread(np.asarray(values))
    return Row(job, ours, "", unit, *summary, bound, target, summary.median if unit == "s" else None, None, "wall")


def curve(picture: str, label: str, costs: Mapping[int, float | None]) -> Curve | None:
    """Return a curve of the measured costs, or None if there are none.

    Args:
        picture: Which picture it belongs to.
        label: Label of the curve.
        costs: Seconds a case by size.
    """
    known = {size: cost for size, cost in costs.items() if cost is not None}
    return Curve(picture, label, tuple(known), tuple(known.values())) if known else None
