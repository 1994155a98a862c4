"""Results of compiled motion of one case, and the errors of motions that are not whole."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.run.motion_runs import StepsTaken
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import NotConverged
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.dynamics.step_control import stopped_at


@dataclass(frozen=True, eq=False, init=False, repr=False)
class CompiledMotion(Motion):
    """A `Motion` whose torques and energies are computed when they are asked for, from all steps of the same motion again."""

    def __init__(self, replay: Callable[[FloatArray, FloatArray], Motion], **known: Any) -> None:
        """Take the other fields of a `Motion`, and a function of its steps and rows that returns it with all of them."""
        vars(self).update(
            {name: read_only(value) if isinstance(value, np.ndarray) else value for name, value in known.items()},
            _replay=replay,
        )

    @cached_property
    def _whole(self) -> Motion:
        replay: Callable[[FloatArray, FloatArray], Motion] = vars(self)["_replay"]
        return replay(self.steps, self.time)

    @cached_property  # type: ignore[misc]
    def motor_torques(self) -> FloatArray:
        """Load that each motor carries, with that of the accelerated masses, shape (n, n_motors) [N m or N]."""
        return self._whole.motor_torques

    @cached_property  # type: ignore[misc]
    def energy(self) -> MotionEnergy:
        """Energies and their balance."""
        return self._whole.energy

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as a `Motion`."""
        return Motion, tuple(getattr(self, field.name) for field in fields(Motion))


class StepEnd(NamedTuple):
    """State at the end of a step of time."""

    q_springs: FloatArray
    """Elastic coordinates, shape (n_springs,) [rad or m]."""
    velocities: FloatArray
    """Their rates, shape (n_springs,) [rad/s or m/s]."""
    tip_position: FloatArray
    """The tip, shape (3,) [m], world axes."""


def check_motion(motion: Motion, taken: StepsTaken, duration: float) -> None:
    """Refuse a motion that is not whole, unless Ctrl-C ended it.

    Raises:
        NotConverged: If a function or a step failed, or its tolerance is not met; `best` is the motion.
    """
    if taken.interrupted or (taken.status[0] == Status.CERTIFIED and taken.is_within):
        return
    cause, steps = None, len(taken.grid) - 1
    if taken.status[0] == Status.CERTIFIED:
        why = (
            f"the tip is known to {motion.tip_error:.3g} m, required {motion.tolerance:.3g} m, with {steps} steps; a shorter "
            "duration, a larger tolerance or more damping may help, or a given time_step"
        )
    else:
        why = f"no step from t = {motion.time[-1]:.6g} s succeeds, however short"
        if taken.failure is not None:
            time, cause = taken.failure
            why = stopped_at(time, duration, cause)
        why += "; `best` is the motion until there"
    residual = math.inf if motion.tip_error is None else motion.tip_error
    raise NotConverged(why, best=motion, residual=residual, iterations=steps) from cause


def check_batch(batch: MotionBatch, taken: StepsTaken, failures: Mapping[int, tuple[float, Exception]]) -> None:
    """Refuse a batch with a function that failed, at which time [s] by case, or whose tolerance is not met.

    Raises:
        NotConverged: If so; `best` is the batch, with all other cases.
    """
    steps = len(taken.grid) - 1
    for case, (time, cause) in sorted(failures.items()):
        why = f"case {case}: {stopped_at(time, float(batch.time[-1]), cause)}; `best` is the batch, with the other cases"
        raise NotConverged(why, best=batch, residual=math.inf, iterations=steps) from cause
    if not taken.is_within:
        raise NotConverged(
            f"the tips are not known to {batch.tolerance:.3g} m after a run with {steps} steps; a shorter duration or more "
            "damping may help, or a time_step",
            best=batch,
            residual=math.inf if taken.errors is None else float(taken.errors.max(initial=0.0)),
            iterations=steps,
        )
