"""Results of compiled motion of one case."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.dynamics.motion import Motion, MotionEnergy


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
