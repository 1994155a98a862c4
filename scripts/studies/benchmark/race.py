"""A race: contenders added by name, timed in turn, compared in rows; who cannot take part is named with the reason."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from studies.benchmark.measurement import Clock, Contender, interleaved, ratio, spread
from studies.benchmark.results import Curve, Row


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    rounds: int = 9
    """Rounds of every race."""
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
    """Whether these are small sizes that say nothing of speed."""
    progress: bool = False
    """Whether to show bars on stderr."""
    cpp: bool = False
    """Whether to compile C++."""


def short_settings(rounds: int, progress: bool) -> Settings:
    """Sizes that are done in seconds, and yet say how fast this machine is."""
    return Settings(
        rounds, batch=20_000, singles=50, waypoints=50, sections=20, memory=200_000, starts=2, sizes=(2, 5, 10),
        batches=(1, 100, 10_000), progress=progress,
    )  # fmt: skip


def quick_settings(rounds: int, progress: bool, cpp: bool) -> Settings:
    """Small sizes that run through everything; the figures mean nothing."""
    return Settings(
        rounds, batch=200, singles=5, waypoints=20, sections=3, memory=20_000, starts=1, sizes=(2, 3), batches=(1, 50),
        shortest=0.0, quick=True, progress=progress, cpp=cpp,
    )  # fmt: skip


@dataclass
class Race:
    """Contenders, then their times."""

    settings: Settings
    """How much is measured."""
    label: str
    """What the progress bar says."""
    clock: Clock = time.process_time
    """What to time with."""
    contenders: dict[str, Contender] = field(default_factory=dict)
    """Who takes part."""
    absent: dict[str, str] = field(default_factory=dict)
    """Who does not, and why."""
    seconds: Mapping[str, FloatArray] = field(default_factory=dict)
    """Seconds a case by name, shape (rounds,), after `run`."""

    def add(self, name: str, make: Callable[[], Contender]) -> None:
        """Let a contender take part, or note why not: an extra is missing, there is no compiler, its answers are wrong."""
        try:
            self.contenders[name] = make()
        except SoftRobotsError as error:
            self.absent[name] = str(error)

    def leave_out(self, name: str, reason: str) -> None:
        """Note a contender that is not asked to take part."""
        self.absent[name] = reason

    def run(self) -> Race:
        """Time everybody who takes part."""
        progress: Any = self.label if self.settings.progress else False
        self.seconds = interleaved(
            self.contenders, self.settings.rounds, clock=self.clock, shortest=self.settings.shortest, progress=progress
        )
        return self

    def cost(self, name: str) -> float | None:
        """Median seconds a case, or None."""
        return spread(self.seconds[name]).median if name in self.seconds else None

    def cheaper(self, job: str, ours: str, baseline: str, bound: str = "", target: float | None = None) -> Row:
        """How many times cheaper ours is."""
        return self._row(job, ours, baseline, "times cheaper", bound, target, inverse=False)

    def costlier(self, job: str, ours: str, baseline: str, bound: str = "", target: float | None = None) -> Row:
        """How many times as much ours costs."""
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
    """A row against nothing: a time or a size.

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
    found = spread(np.asarray(values))
    return Row(job, ours, "", unit, *found, bound, target, found.median if unit == "s" else None, None, "wall")


def curve(picture: str, label: str, costs: Mapping[int, float | None]) -> Curve | None:
    """A curve of the costs that were measured, or None if there are none.

    Args:
        picture: Which picture it belongs to.
        label: What it is the cost of.
        costs: Seconds a case by size.
    """
    known = {size: cost for size, cost in costs.items() if cost is not None}
    return Curve(picture, label, tuple(known), tuple(known.values())) if known else None
