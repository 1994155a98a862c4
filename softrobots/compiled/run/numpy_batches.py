"""Batches without a compiler, statics and motion: the passes on blocks of cases, every element of the workspace a NumPy array.

The straight-line functions are those of single cases, with NumPy's intrinsics. Cases that the passes do not solve go through
the drivers one by one, in plain floats.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from softrobots.compiled.drivers.lane_drivers import Places, Rows
from softrobots.compiled.motion_settings import MOTION_CORRECTIONS, RENEW_SHARE
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
        self._low, self._high = (np.array(getattr(module, name, ())) for name in ("LOWER", "UPPER"))

    def settle_batch(self, *batch: Any) -> None:
        """Find equilibria; see `lane_drivers`."""
        for w, statuses, given in self._blocks(*batch):
            if self._module.N_GUIDES:
                statuses[:] = [self._alone(w, lane, self._module.settle_from) for lane in range(len(statuses))]
                continue
            for lane in self._run(w, statuses, "first_pass", "newton_pass"):
                if self._module.N_SLIDERS:
                    statuses[lane] = self._again(w, lane, given, self._module.settle_from)
                else:
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
                statuses[lane] = self._again(w, lane, given, self._module.reach)

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

    def _again(self, w: list[Any], lane: int, given: dict[int, Any], function: Any) -> int:
        """Run one case from its inputs, see `_alone`."""
        for place, values in given.items():
            w[place][lane] = values[lane]
        return self._alone(w, lane, function)

    def _alone(self, w: list[Any], lane: int, function: Any) -> int:
        """Run one case in plain floats and put it back."""
        case = [float(one[lane]) for one in w]
        status = int(function(case))
        for one, value in zip(w, case, strict=True):
            one[lane] = value
        return status


class MotionBatches:
    """The batch function of `softrobots.compiled.drivers.motion_lane_drivers` for NumPy."""

    def __init__(self, module: ModuleType, vectorised: ModuleType, program: Program) -> None:
        """Run the straight-line functions of a program on arrays by `vectorised`, and single cases by `module`."""
        self._alone, self._functions, self._layout, self._size = module, vectorised, program.layout, program.size

    def motion_batch(
        self,
        inputs: Rows,
        places: Places,
        motors: Any,
        forces: Any,
        grid: Any,
        times: Any,
        out: Any,
        statuses: Any,
        first: int,
        last: int,
    ) -> None:
        """Take the steps of many cases; see `motion_lane_drivers`."""
        for begin in range(first, last, BLOCK):
            rows = slice(begin, min(begin + BLOCK, last))
            own = [values[rows] if len(values) > 1 else values for values in (*inputs, motors, forces)]
            alone = self._layout.rubbing
            failed = (
                np.ones(len(out[rows])) if alone else self._block(own[:-2], places, own[-2], own[-1], grid, times, out[rows])
            )
            statuses[rows] = Status.CERTIFIED
            for lane in np.flatnonzero(failed):
                case = [0.0] * self._size
                picked = [values[min(lane, len(values) - 1)] for values in own]
                for place, values in zip(places, picked[:-2], strict=True):
                    case[place : place + len(values)] = values.tolist()
                paths = picked[-2].ravel().tolist(), len(picked[-2]), picked[-1].ravel().tolist(), len(picked[-1])
                found = [0.0] * out[begin].size
                end = grid.tolist(), len(grid) - 1, times.tolist(), len(times), found
                statuses[begin + lane] = self._alone.motion_run(case, *paths, *end)
                out[begin + lane] = np.reshape(found, out[begin].shape)
                if alone:
                    own[2][lane] = case[places[2] : places[2] + own[2].shape[1]]

    def _block(self, inputs: Any, places: Places, motors: Any, forces: Any, grid: Any, times: Any, out: Any) -> Any:
        """Take the steps of a block of cases; return the mask of those that fail."""
        layout, functions, count = self._layout, self._functions, len(out)
        n, m = layout.unknowns, layout.motors
        w: list[Any] = [0.0] * self._size
        w[layout.position : layout.velocity + n] = np.zeros((2 * n, count))
        w[layout.history : layout.weights] = np.zeros((layout.weights - layout.history, count))
        for place, values in zip(places, inputs, strict=True):
            w[place : place + values.shape[1]] = list(values.T)
        failed = np.zeros(count, dtype=bool)
        n_history = row = 0
        with np.errstate(all="ignore"):
            for step, length in enumerate(np.diff(grid).tolist()):
                if step and abs(length - (grid[step] - grid[step - 1])) > 1e-9 * length:
                    n_history = 0
                w[layout.time_step], w[layout.whole_step], w[layout.share] = length, length, 0.5
                w[layout.n_history] = n_history
                for k, place in enumerate((layout.motors_begin, layout.motors_middle, layout.motors_end)):
                    w[place : place + m] = list(motors[:, min(2 * step + k, motors.shape[1] - 1)].T)
                w[layout.force : layout.force + 3] = list(forces[:, min(step, forces.shape[1] - 1)].T)
                w[layout.begin_position : layout.begin_velocity + n] = w[layout.position : layout.velocity + n]
                failed |= ~self._step(w, failed, n_history)
                n_history += 1
                while row < len(times) and (times[row] <= grid[step + 1] or step == len(grid) - 2):
                    share = (times[row] - grid[step]) / length
                    w[layout.share] = 1.0 if share > 1.0 - 1e-9 else share
                    for i in range(n):
                        functions.interpolate_unknown(w, i)
                    for i in range(m):
                        functions.place_motor(w, i)
                    functions.motion_tip(w)
                    found = [*w[layout.unknown : layout.unknown + 2 * n], *w[layout.tip : layout.tip + 3]]
                    out[:, row] = np.stack([np.broadcast_to(one, count) for one in found], axis=1)
                    row += 1
        return failed

    def _step(self, w: list[Any], failed: Any, n_history: int) -> Any:
        """Take a step; return the mask of the cases whose corrections have converged."""
        layout, functions = self._layout, self._functions
        for i in range(layout.motors):
            functions.place_motor(w, i)
        functions.motion_prepare(w)
        functions.choose_order(w)
        for i in range(layout.unknowns):
            functions.guess_unknown(w, i)
        w[layout.last_change] = np.full(len(failed), 1e300)
        slow = False
        for correction in range(MOTION_CORRECTIONS):
            w[layout.coupled] = 1.0 if slow else w[layout.coupled]
            if correction == 1 or correction + n_history == 0 or slow:
                functions.motion_factor(w)
            else:
                functions.motion_correct(w)
            w[layout.change] = np.zeros(len(failed))
            for i in range(layout.unknowns):
                functions.apply_correction(w, i)
            functions.judge_corrections(w)
            settled = w[layout.settled] > 0.5
            if np.all(settled | failed):
                break
            slow = bool(np.any((w[layout.change] > RENEW_SHARE * w[layout.last_change]) & ~settled & ~failed))
            w[layout.last_change] = w[layout.change]
        for i in range(layout.unknowns):
            functions.finish_unknown(w, i)
        return settled
