"""How a simulation begins; the same for both engines."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.dynamics.midpoint import State
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.time_inputs import MotorPath
from softrobots.model.friction_coordinates import after_step, memory_of, untouched
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import check_no_contact

_APART = 1e-6  # largest distance of motors from where the start has them [rad or m]


def first_state(model: SoftModel, start: Any, path: MotorPath, free: int = 0) -> State:
    """Return the state at time zero; the first `free` actuators are where `start` has them, the others where the path begins.

    Raises:
        ParameterError: If `start` is of another kind or robot, has obstacles, or has the actuators elsewhere.
    """
    motors, springs, rates = path(0.0), model.rest, np.zeros(model.n_motors + model.n_springs)
    before = untouched(model)
    if start is not None:
        if isinstance(start, Motion):
            start = start.end
        if not isinstance(start, Equilibrium | MotionState):
            raise ParameterError("start", start, "an Equilibrium, a Motion, a MotionState, or None (relaxed, at rest)")
        check_start(model, start, motors, free)
        before = start.model if isinstance(start, MotionState) else after_step(start.model, start.q_motors, start.q_springs)
        springs, motors = start.q_springs, np.concatenate([start.q_motors[:free], motors[free:]])
        if isinstance(start, MotionState):
            rates[: model.n_motors] = start.motor_velocities
            rates[model.n_motors :] = start.velocities
    memory = None if model.structure.friction is None else memory_of(before)
    return State(0.0, np.concatenate([motors, springs]), rates, memory)


def check_start(model: SoftModel, start: Equilibrium | MotionState, motors: FloatArray, free: int = 0) -> None:
    """Check that a motion can start where the motors are at time zero, shape (n_motors,), or (n, n_motors) of several motions.

    Raises:
        ParameterError: If the start is of another robot, has obstacles, or has actuators but the first `free` elsewhere.
    """
    if isinstance(start, Equilibrium):
        check_no_contact(start, "a simulation (export the robot with its obstacles to MuJoCo or Drake)")
    if start.model != model:
        raise ParameterError("start", start.model, f"a state of the model given, {model!r}")
    distances = np.abs(motors - start.q_motors)[..., free : model.actuators.n_placed]
    apart = np.fmax.reduce(distances, axis=None, initial=0.0)
    if apart > _APART:
        text = f"at {start.q_motors.tolist()} at t = 0, where `start` has the actuators (it is {apart:.3g} rad or m away)"
        raise ParameterError("q_motors", motors, text)


def first_kick(path: MotorPath, rates: FloatArray) -> FloatArray | None:
    """Return the jump of the velocities of prescribed motors at time zero, shape (n_motors,), or None if there is none.

    Args:
        path: The motors over time.
        rates: Their velocities before, shape (n_motors,).
    """
    if not path.kicks and not rates.any():
        return None
    change: FloatArray = path.kicks.get(0.0, np.zeros(len(rates))) - rates
    slight = _APART * float(np.abs(rates).max(initial=_APART))
    return change if np.abs(change).max(initial=0.0) > slight else None
