r"""Lengths of the steps of a simulation: given, or chosen so that the tip stays within a tolerance over the whole run.

*The first grid.* Steps of second order are 200 or more, of equal length between the times where loads jump or motors stop, and
also end where a spring is at a knee of its law; those of fourth order are 100 or more, and end at the rows.

*The certificate.* The run is repeated with every step halved, again and again. Where halving shrinks the distance between the
tip paths of successive runs by the factor r, the finer one has the distance over r - 1 as its error: a third for a smooth
motion in steps of second order, a seventh at least in those of fourth, whose r is believed up to 8 only, and all of it for
r = 2, which is assumed of the first two runs. (A released rod is not smooth: all its modes ring.) That is an estimate, which
random runs of arms exceeded by up to 12 %; the error that is stated is 1.2 times as large. The last run is the first whose
stated error is within the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError, SoftRobotsError
from softrobots.dynamics.gauss import GaussRule
from softrobots.dynamics.midpoint import MidpointRule, Step
from softrobots.dynamics.recorder import Recorder
from softrobots.model.soft_model import SoftModel

_HALVINGS = 30  # of a step that fails
_SMOOTH = {2: 4.0, 4: 8.0}  # largest r that is believed, for each order
_LEAST = 1e-300  # distance that two runs have at least [m]

RULES: dict[int, type[MidpointRule]] = {2: MidpointRule, 4: GaussRule}
"""The scheme of each order."""
STALLED = 5
"""Runs in which the error of the tip is to halve at least once."""
SAFETY = 1.2
"""Error that is stated over the one that is estimated from halved steps [-]."""


class NoStep(SoftRobotsError):
    """No step from a state succeeds, however short."""


def stopped_at(time: float, duration: float, error: Exception) -> str:
    """Say that a function of the caller ended a motion, at which time [s], and why."""
    why = error if isinstance(error, SoftRobotsError) else f"{type(error).__name__}: {error}"
    return f"the motion ends at t = {time:.6g} s of {duration:.6g} s: {why}"


def follow(recorder: Recorder, grid: FloatArray, *, to_knees: bool = False) -> Iterator[int]:
    """Step through a grid of times, on demand to the knees of springs, too; yield once for each row.

    A step that fails begins anew without a guess from the steps before, and is halved if that fails, too.

    Raises:
        NoStep: If no step succeeds.
    """
    for end in grid[1:].tolist():
        targets = [end]
        shortest = max((end - recorder.state.time) * 0.5**_HALVINGS, 4.0 * math.ulp(end))  # down to where times differ
        while targets:
            step = recorder.rule.step(recorder.state, targets[-1])
            knee = _first_knee(recorder, step) if to_knees and step is not None else None
            if step is not None and knee is None:
                yield from range(recorder.add(step))
                targets.pop()
                if step.end.time in recorder.rule.path.kicks and step.end.time < recorder.duration:
                    recorder.kick(recorder.rule.path.kicks[step.end.time])
            elif targets[-1] - (now := recorder.state.time) <= shortest:
                length = targets[-1] - now
                raise NoStep(f"no step from t = {now:.6g} s succeeds, down to a length of {length:.3g} s{_range_end(recorder)}")
            elif knee is not None:
                targets.append(knee)
            elif not recorder.rule.forget():  # else its guess may have been worse than none
                targets.append(0.5 * (recorder.state.time + targets[-1]))


def halved(grid: FloatArray) -> FloatArray:
    """The grid with the middle of each step added, shape (2 n - 1,)."""
    finer: FloatArray = np.zeros(2 * len(grid) - 1)
    finer[::2], finer[1::2] = grid, 0.5 * (grid[1:] + grid[:-1])
    return finer


def order_of_steps(order: Any, time_step: float | None, model: SoftModel, still: bool) -> int:
    """Return the order of the scheme, 2 or 4: that asked for, or 4 where steps are chosen and the motion is smooth.

    Args:
        order: What is asked for, or None.
        time_step: Length of given steps [s]; None: they are chosen.
        model: The robot.
        still: Whether motors and loads stand still.

    Raises:
        ParameterError: If it is neither, or 4 where motors or loads move, or of a robot with dry friction.
    """
    if order is None:
        smooth = still and model.structure.friction is None and len(model.springs.beyond_plateaus(model.rest)) == 0
        return GaussRule.order if smooth and time_step is None else MidpointRule.order
    if isinstance(order, bool) or np.ndim(order) or order not in RULES:
        raise ParameterError("order", order, "2, 4 or None")
    if order == GaussRule.order and model.structure.friction is not None:
        raise ParameterError("order", order, "2 or None of a robot with dry friction")
    if order == GaussRule.order and not still:
        raise ParameterError("order", order, "2 or None where motors or loads change over time")
    return int(order)


def error_share(before: float, now: float, order: int) -> float:
    """Error that is stated of the finer of two runs over the distance of their tips, `SAFETY / (r - 1)`; see the module.

    Args:
        before: Distance of the tips of the two runs before [m]; infinite if there are none.
        now: Distance of the tips of the two runs [m].
        order: Order of the scheme.
    """
    shrinking = before / max(now, _LEAST) if math.isfinite(before) else 2.0
    return SAFETY / (min(max(shrinking, 2.0), _SMOOTH[order]) - 1.0)


def _range_end(recorder: Recorder) -> str:
    """Why no step succeeds, if a section is the reason."""
    model, x = recorder.rule.equations.model, recorder.state.x
    ends = model.structure.at_range_end(x[: model.n_motors], x[model.n_motors :])
    where = "at the end of the range of sections (see strain_chain.in_range), more of which bend further"
    return f": {', '.join(ends)} {where}" if ends else ""


def _first_knee(recorder: Recorder, step: Step) -> float | None:
    """First time well within a step at which a spring reaches or leaves the plateau of its law [s]; None: none does."""
    equations = recorder.rule.equations
    springs, m = equations.model.springs, equations.n_motors
    before, after = (springs.beyond_plateaus(state.x[m:]) for state in (step.start, step.end))
    times = [step.end.time]
    for hinge in np.flatnonzero((before < 0.0) != (after < 0.0)).tolist():
        low, high = step.start.time, step.end.time
        while high - low > 1e-3 * step.length:
            middle = 0.5 * (low + high)
            same = (springs.beyond_plateaus(step.at(middle)[0][m:])[hinge] < 0.0) == (before[hinge] < 0.0)
            low, high = (middle, high) if same else (low, middle)
        if low > step.start.time + 0.01 * step.length:
            times.append(high)
    first = min(times)
    return first if first < step.end.time - 0.01 * step.length else None
