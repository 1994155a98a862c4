"""Batches without a compiler: the passes on blocks of cases, every element of the workspace a NumPy array.

The text of the straight-line functions is the one that runs single cases; only its intrinsics are NumPy's. Cases that the
passes do not settle go through the drivers one by one, in plain floats.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from softrobots.checks import FloatArray
from softrobots.kernels.program import Program
from softrobots.kernels.settings import OBSERVABLE, PASSES

BLOCK = 4096
"""Cases in a block: their workspace stays in the cache of a core."""


class NumpyBatches:
    """The batch functions of `softrobots.kernels.lane_drivers` for NumPy."""

    def __init__(self, module: ModuleType, program: Program) -> None:
        """Run the straight-line functions of a program on arrays; `module` runs single cases."""
        self._module, self._layout, self._size = module, program.layout, program.size
        self._low, self._high = np.array(module.LOWER), np.array(module.UPPER)
        self._functions: dict[str, Any] = dict(
            where=np.where, sine=np.sin, cosine=np.cos, sqrt=np.sqrt, fabs=np.abs, floor=np.floor
        )
        self._functions |= {"Array": list, "zeros": None}
        exec(compile(program.text, "<softrobots generated code>", "exec"), self._functions)
        self._functions.update(sine=np.sin, cosine=np.cos)

    def settle_batch(
        self,
        motors: FloatArray,
        forces: FloatArray,
        gravity: FloatArray,
        pulls: FloatArray,
        starts: FloatArray,
        unknowns: FloatArray,
        residuals: FloatArray,
        tips: FloatArray,
        statuses: Any,
        first: int,
        last: int,
    ) -> None:
        """See `lane_drivers.settle_batch`."""
        layout = self._layout
        for rows in self._blocks(first, last):
            count = rows.stop - rows.start
            w = self._workspace(count, [(0, motors[rows]), (layout.force, forces[rows]), (layout.gravity, gravity)])
            if len(pulls):
                self._put(w, layout.pull, pulls[rows])
            if len(starts):
                self._put(w, layout.start, starts[rows])
                self._put(w, layout.unknown, starts[rows])
            for lane in self._run(w, rows, statuses, "first_pass", "newton_pass"):
                statuses[rows.start + lane] = self._alone(w, lane, self._module.settle)
            unknowns[rows] = self._taken(w, layout.unknown, unknowns.shape[1], count)
            tips[rows] = self._taken(w, layout.tip, 3, count)
            residuals[rows] = self._root(w, "error", count)

    def estimate_batch(
        self,
        motors: FloatArray,
        torques: FloatArray,
        gravity: FloatArray,
        forces: FloatArray,
        unknowns: FloatArray,
        residuals: FloatArray,
        unexplained: FloatArray,
        observed: FloatArray,
        statuses: Any,
        first: int,
        last: int,
    ) -> None:
        """See `lane_drivers.estimate_batch`."""
        layout = self._layout
        for rows in self._blocks(first, last):
            count = rows.stop - rows.start
            w = self._workspace(count, [(0, motors[rows]), (layout.torques, torques[rows]), (layout.gravity, gravity)])
            for lane in self._run(w, rows, statuses, "first_force_pass", "force_pass"):
                statuses[rows.start + lane] = self._alone(w, lane, self._module.estimate)
            observed[rows] = self._root(w, "observed", count)
            hidden = (statuses[rows] == 0) & (observed[rows] < OBSERVABLE * self._module.REACH)
            statuses[rows][hidden] = 5
            unknowns[rows] = self._taken(w, layout.unknown, unknowns.shape[1], count)
            forces[rows] = self._taken(w, layout.force, 3, count)
            residuals[rows] = self._root(w, "error", count)
            unexplained[rows] = self._root(w, "unexplained", count)

    def reach_batch(
        self,
        targets: FloatArray,
        forces: FloatArray,
        gravity: FloatArray,
        motors: FloatArray,
        unknowns: FloatArray,
        residuals: FloatArray,
        errors: FloatArray,
        statuses: Any,
        tolerance: float,
        first: int,
        last: int,
    ) -> None:
        """See `lane_drivers.reach_batch`."""
        layout = self._layout
        for rows in self._blocks(first, last):
            count = rows.stop - rows.start
            given = [(0, motors[rows]), (layout.unknown, unknowns[rows]), (layout.force, forces[rows])]
            w = self._workspace(count, [*given, (layout.gravity, gravity), (layout.target, targets[rows])])
            w[layout.single("tolerated")] = np.full(count, tolerance)
            left = self._run(w, rows, statuses, "target_pass", "target_pass")
            found = self._taken(w, 0, layout.motors, count)
            outside = np.any((found < self._low - 1e-9) | (found > self._high + 1e-9), axis=1)
            for lane in np.union1d(left, np.flatnonzero(outside)):
                for place, values in ((0, motors), (layout.unknown, unknowns)):
                    self._put(w, place, values[rows], lane)
                statuses[rows.start + lane] = self._alone(w, lane, self._module.reach)
            motors[rows] = self._taken(w, 0, layout.motors, count)
            unknowns[rows] = self._taken(w, layout.unknown, unknowns.shape[1], count)
            residuals[rows] = self._root(w, "error", count)
            errors[rows] = self._root(w, "missing", count)

    def _blocks(self, first: int, last: int) -> list[slice]:
        return [slice(begin, min(begin + BLOCK, last)) for begin in range(first, last, BLOCK)]

    def _workspace(self, count: int, given: list[tuple[int, FloatArray]]) -> list[Any]:
        w: list[Any] = [np.zeros(count) for _ in range(self._size)]
        for place, values in given:
            self._put(w, place, np.broadcast_to(values, (count, values.shape[-1])))
        return w

    def _put(self, w: list[Any], place: int, values: FloatArray, lane: int | None = None) -> None:
        """Write columns into the workspace, of all cases or of one."""
        for column in range(values.shape[1]):
            if lane is None:
                w[place + column] = np.array(values[:, column])
            else:
                w[place + column][lane] = values[lane, column]

    def _run(self, w: list[Any], rows: slice, statuses: Any, first: str, then: str) -> Any:
        """Do the passes; return the lanes that they do not settle."""
        mode = self._layout.single("mode")
        with np.errstate(all="ignore"):  # cases that overflow are told by their numbers
            self._functions[first](w)
            for _ in range(PASSES):
                if not np.any(w[mode] < 0.5):
                    break
                self._functions[then](w)
        statuses[rows] = 0
        count = rows.stop - rows.start
        w[:] = [np.array(np.broadcast_to(one, count)) for one in w]  # what is the same for all was written once
        return np.flatnonzero(~((w[mode] > 0.5) & (w[mode] < 1.5)))

    def _alone(self, w: list[Any], lane: int, function: Any) -> int:
        """Run one case in plain floats and put it back."""
        case = [float(one[lane]) for one in w]
        status = int(function(case))
        for one, value in zip(w, case, strict=True):
            one[lane] = value
        return status

    def _taken(self, w: list[Any], place: int, columns: int, count: int) -> FloatArray:
        return np.array(w[place : place + columns], dtype=np.float64).reshape(columns, count).T

    def _root(self, w: list[Any], name: str, count: int) -> FloatArray:
        return np.asarray(np.sqrt(np.abs(w[self._layout.single(name)])).reshape(count))
