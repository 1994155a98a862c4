"""Batches without a compiler: the passes on blocks of cases, every element of the workspace a NumPy array.

The straight-line functions are those of single cases, with NumPy's intrinsics. Cases that the passes do not solve go through
the drivers one by one, in plain floats.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from softrobots.compiled.drivers.lane_drivers import Places, Rows
from softrobots.compiled.program.generated_module import Program
from softrobots.compiled.settings import CHUNK, FORCE_PASSES, OBSERVABLE, PASSES
from softrobots.compiled.statuses import Status

BLOCK = 4096
"""Cases in a block: their workspace stays in the cache of a core."""


class NumpyBatches:
    """The batch functions of `softrobots.compiled.drivers.lane_drivers` for NumPy."""

    def __init__(self, module: ModuleType, vectorised: ModuleType, program: Program) -> None:
        """Run the straight-line functions of a program on arrays by `vectorised`, and single cases by `module`."""
        self._module, self._vectorised = module, vectorised
        self._layout, self._size = program.layout, program.size
        self._low, self._high = np.array(module.LOWER), np.array(module.UPPER)

    def settle_batch(self, *batch: Any) -> None:
        """Find equilibria; see `lane_drivers`."""
        for w, statuses, _ in self._blocks(*batch):
            for lane in self._run(w, statuses, "first_pass", "newton_pass"):
                statuses[lane] = self._alone(w, lane, self._module.settle)

    def estimate_batch(self, *batch: Any) -> None:
        """Estimate forces; see `lane_drivers`."""
        for w, statuses, _ in self._blocks(*batch):
            for lane in self._run(w, statuses, "first_force_pass", "force_pass", FORCE_PASSES):
                statuses[lane] = self._alone(w, lane, self._module.estimate)
            weak = np.sqrt(np.abs(w[self._layout.single("observed")])) < OBSERVABLE * self._module.REACH
            statuses[(statuses == Status.CERTIFIED) & weak] = Status.UNOBSERVABLE

    def reach_batch(self, *batch: Any) -> None:
        """Put the tips at their targets; see `lane_drivers`."""
        for w, statuses, given in self._blocks(*batch):
            unsolved = self._run(w, statuses, "target_pass", "target_pass")
            motors = np.reshape(w[: self._layout.motors], (self._layout.motors, -1)).T
            outside = np.any((motors < self._low - 1e-9) | (motors > self._high + 1e-9), axis=1)
            for lane in np.union1d(unsolved, np.flatnonzero(outside)):
                for place, values in given.items():
                    w[place][lane] = values[lane]
                statuses[lane] = self._alone(w, lane, self._module.reach)

    def respond_batch(self, name: str, *batch: Any) -> None:
        """Compute rates or weights by a straight-line function; see `response_drivers`."""
        *given, sums, first, last = batch
        unused: Any = np.zeros(last)
        for w, _, _ in self._blocks(*(*given, unused, first, last)):
            getattr(self._vectorised, name)(w)
            count = np.size(w[0])
            weights = w[self._module.NUMBER_WEIGHTS :][: sums.shape[1]]
            sums[first // CHUNK] += [np.sum(np.broadcast_to(one, count)) for one in weights]

    def _blocks(
        self, inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
    ) -> Iterator[tuple[list[Any], Any, dict[int, Any]]]:
        """Yield workspace, statuses and inputs by place of a block of cases, then store its results."""
        for begin in range(first, last, BLOCK):
            rows = slice(begin, min(begin + BLOCK, last))
            count = rows.stop - begin
            given: dict[int, Any] = {}
            for place, values in zip(places, inputs, strict=True):
                columns = (values[rows] if len(values) > 1 else values).T
                given |= {place + k: np.array(np.broadcast_to(column, count)) for k, column in enumerate(columns)}
            w = [given[place] if place in given else np.zeros(count) for place in range(self._size)]
            yield w, statuses[rows], given
            for place, values in zip(result_places, outputs, strict=True):
                for column in range(values.shape[1]):
                    values[rows, column] = w[place + column]

    def _run(self, w: list[Any], statuses: Any, first: str, then: str, most: int = PASSES) -> Any:
        """Do the passes; return the lanes that they do not solve."""
        mode = self._layout.single("mode")
        with np.errstate(all="ignore"):  # cases that overflow have infinite numbers
            getattr(self._vectorised, first)(w)
            for _ in range(most):
                if not np.any(w[mode] < 0.5):
                    break
                getattr(self._vectorised, then)(w)
        statuses[:] = Status.CERTIFIED
        w[:] = [np.array(np.broadcast_to(one, len(statuses))) for one in w]  # constants are written once
        return np.flatnonzero(~((w[mode] > 0.5) & (w[mode] < 1.5)))

    def _alone(self, w: list[Any], lane: int, function: Any) -> int:
        """Run one case in plain floats and put it back."""
        case = [float(one[lane]) for one in w]
        status = int(function(case))
        for one, value in zip(w, case, strict=True):
            one[lane] = value
        return status
