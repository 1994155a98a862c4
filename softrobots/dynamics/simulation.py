"""Simulation of a robot: its motion under motors, loads and weight."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, choice, finite_array, non_negative_number, positive_number
from softrobots.core.errors import NotConverged, ParameterError
from softrobots.core.progress import with_progress
from softrobots.dynamics.damping import damping_matrix
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.midpoint import MidpointRule, State
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.motor_torque import MotorTorque
from softrobots.dynamics.recorder import Recorder
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.equilibrium import Equilibrium

MOTORS = ("prescribed", "torque")
"""How motors move."""

_ROWS = 200  # of a motion, if no output step is given
_HALVINGS = 30  # of a step that fails


def simulate(
    model: SoftModel,
    duration: Any,
    q_motors: Any,
    *,
    start: Any = None,
    force: Any = None,
    wrench: Any = None,
    gravity: Any = None,
    damping_time: Any = None,
    mass_damping: Any = 0.0,
    time_step: Any = None,
    output_step: Any = None,
    tolerance: Any = None,
    motors: str = "prescribed",
    torque: Any = None,
    sample_time: Any = None,
    progress: bool | str = False,
) -> Motion:
    """Simulate the motion of a robot by the implicit midpoint rule (`softrobots.dynamics.midpoint`).

    Args:
        model: The robot.
        duration: Time to simulate [s].
        q_motors: Actuators, shape (n_motors,) [rad, m or N]: constants; a `Trajectory`, whose waypoints a cubic spline connects
            from rest to rest; or a function of time.
        start: An `Equilibrium` (with another load than its own: released), a `Motion`, whose end is taken, or a `MotionState`;
            by default relaxed springs at rest.
        force: Force on the tip, shape (3,) [N], world axes: constant, a table `(times (n,), values (n, 3))`, linear between its
            rows, or a function of time.
        wrench: Wrench at the tip, shape (6,) [N, N m], force first, or `{frame: (6,)}`; constant, tables or functions of time.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        damping_time: Damping of the elastic coordinates over their stiffness [s]; None: the damping of the description.
        mass_damping: Rayleigh's factor of the mass [1/s].
        time_step: Length of each step [s]; by default 1 ms.
        output_step: Time between two rows of the result [s]; by default 200 rows or a few more.
        tolerance: Largest error of the tip [m]; not used by fixed steps.
        motors: "prescribed": they move as `q_motors` says; "torque": motor joints move by `torque`, from where `start` has
            them, or else from where `q_motors` begins; it may be None after a start. Muscles follow `q_motors`.
        torque: Controller for motors="torque": a function of time, and positions and velocities of the motor joints, each shape
            (n,), that returns their torques, shape (n,) [N m or N], e.g. `softrobots.PD`; or constant torques. The motors have
            rotor inertia, friction and largest torque of the file (`softrobots.dynamics.motor_torque`), and no end stops.
        sample_time: Time between two evaluations of `torque`, which is held in between [s]; None: it acts continuously.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The motion; the first row is the start, the last one the end.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        NameNotFound: If a frame does not exist.
        NotConverged: If no step from a state succeeds, however small; `best` is the motion up to there.
    """
    check_model(model)
    end = positive_number("duration", duration, "s")
    choice("motors", motors, MOTORS)
    drive = MotorTorque(model, torque, sample_time) if motors == "torque" else None
    for name, value in (("torque", torque), ("sample_time", sample_time)):
        if drive is None and value is not None:
            raise ParameterError(name, value, "left out unless motors='torque'")
    if drive is not None and q_motors is None and isinstance(start, Equilibrium | Motion | MotionState):
        q_motors = start.end.q_motors if isinstance(start, Motion) else start.q_motors
    path, load = MotorPath(model, q_motors, end), TimeLoad(model, force, wrench, end)
    weight = None if gravity is None else tuple(finite_array("gravity", gravity, (3,), "m/s^2").tolist())
    alpha = non_negative_number("mass_damping", mass_damping, "1/s")
    beta = None if damping_time is None else non_negative_number("damping_time", damping_time, "s")
    first = _first_state(model, start, path, 0 if drive is None else drive.count)
    h = 1e-3 if time_step is None else positive_number("time_step", time_step, "s")
    grid = np.append(h * np.arange(math.ceil(end / h - 1e-9)), end)
    if drive is not None:
        grid = drive.with_samples(grid)
    between = h * math.ceil(end / h / _ROWS) if output_step is None else positive_number("output_step", output_step, "s")
    rows = np.append(between * np.arange(math.ceil(end / between - 1e-9)), end)
    with one_blas_thread(model.n_springs):
        drives = None if drive is None else model.actuators.drives
        equations = EquationsOfMotion(model, weight, damping_matrix(model, beta, alpha), drives)
        rule = MidpointRule(equations, path, load, drive)
        recorder = Recorder(rule, first, rows)
        interrupted = False
        try:
            for _ in with_progress(_follow(rule, recorder, grid), progress, label="motion", unit="row", total=len(rows)):
                pass
        except KeyboardInterrupt:
            interrupted = True
        except _NoStep as error:
            raise NotConverged(
                str(error), best=recorder.motion(damping_time=beta), residual=math.inf, iterations=len(recorder.times) - 1
            ) from None
        return recorder.motion(damping_time=beta, interrupted=interrupted)


class _NoStep(Exception):
    """No step succeeds from a state."""


def _follow(rule: MidpointRule, recorder: Recorder, grid: FloatArray) -> Iterator[int]:
    """Step through a grid of times; yield after each row of the output."""
    done = 0
    for time in grid[1:].tolist():
        targets = [time]
        while targets:
            step = rule.step(recorder.state, targets[-1])
            if step is not None:
                recorder.add(step)
                targets.pop()
            elif len(targets) > _HALVINGS:
                now, least = recorder.state.time, targets[-1] - recorder.state.time
                raise _NoStep(f"no step from t = {now:.6g} s succeeds, down to {least:.3g} s")
            else:
                rule.forget()
                targets.append(0.5 * (recorder.state.time + targets[-1]))
        yield from range(done, recorder.rows)
        done = recorder.rows


def _first_state(model: SoftModel, start: Any, path: MotorPath, free: int) -> State:
    """The state at time zero; the first `free` actuators are where `start` has them, the others where the path begins."""
    motors, springs, rates = path(0.0), model.rest, np.zeros(model.n_motors + model.n_springs)
    if start is not None:
        if isinstance(start, Motion):
            start = start.end
        if not isinstance(start, Equilibrium | MotionState):
            raise ParameterError("start", start, "an Equilibrium, a Motion, a MotionState, or None (relaxed, at rest)")
        if start.model != model:
            raise ParameterError("start", start.model, f"a state of the model given, {model!r}")
        springs, motors = start.q_springs, np.concatenate([start.q_motors[:free], motors[free:]])
        if isinstance(start, MotionState):
            rates[:free] = start.motor_velocities[:free]
            rates[model.n_motors :] = start.velocities
    return State(0.0, np.concatenate([motors, springs]), rates)
