"""Simulation of a robot: its motion under motors, loads and weight."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, choice, non_negative_number, positive_number
from softrobots.core.errors import NotConverged, ParameterError
from softrobots.core.progress import with_progress
from softrobots.dynamics.damping import damping_matrix
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.midpoint import MidpointRule
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.motor_torque import MOTORS, MotorTorque
from softrobots.dynamics.recorder import Recorder
from softrobots.dynamics.starting import first_kick, first_state
from softrobots.dynamics.step_control import RULES, STALLED, NoStep, error_share, follow, halved, order_of_steps, stopped_at
from softrobots.dynamics.time_grid import SAME_TIME, first_grid, grid_with_stops, merged_times, steps_and_rows
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load

MOST_STEPS = 400_000
"""Most steps of one run that is refined for a tolerance."""


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
    order: Any = None,
    motors: str = "prescribed",
    torque: Any = None,
    sample_time: Any = None,
    progress: bool | str = False,
) -> Motion:
    """Simulate the motion of a robot by implicit steps of time that damp nothing.

    Args:
        model: The robot.
        duration: Time to simulate [s].
        q_motors: Actuators, shape (n_motors,) [rad, m or N]: constants; a `Trajectory`, whose waypoints a cubic spline connects
            from rest to rest; or a function of time.
        start: An `Equilibrium` (with another load than its own: released), a `Motion`, whose end is taken, or a `MotionState`;
            by default relaxed springs at rest. Dry friction remembers what it does there.
        force: Force on the tip, shape (3,) [N], world axes: constant, a table `(times (n,), values (n, 3))`, linear between its
            rows, or a function of time. Functions are looked at a thousand times: pulses shorter than that are to be tables.
        wrench: Wrench at the tip, shape (6,) [N, N m], force first, or `{frame: (6,)}`; constant, tables or functions of time.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        damping_time: Damping of the elastic coordinates over their stiffness [s]; None: the damping of the description.
        mass_damping: Rayleigh's factor of the mass matrix, which is that of the relaxed robot at all times [1/s].
        time_step: Length of each step [s]; None: chosen so that the tip stays within the tolerance, see
            `softrobots.dynamics.step_control`.
        output_step: Time between two rows of the result [s]; by default 200 rows or a few less.
        tolerance: Largest error of the tip at any time of the run [m], by default 5e-4 of the robot's reach. It is measured:
            the run is repeated with every step halved until the difference says that it is met, see `Motion.tip_error`.
        order: Order of the error in the length of the steps: 2 is the implicit midpoint rule (`softrobots.dynamics.midpoint`),
            4 the method of Gauss with two stages (`softrobots.dynamics.gauss`), for motors and loads that stand still. None: 2
            with a given `time_step`, where motors or loads move, where springs have plateaus and with dry friction, else 4.
        motors: "prescribed": they move as `q_motors` says; "torque": motor joints move by `torque`, from where `start` has
            them, or else from where `q_motors` begins; it may be None after a start. Muscles follow `q_motors`.
        torque: Controller for motors="torque": a function of time, and positions and velocities of the motor joints, each shape
            (n,), that returns their torques, shape (n,) [N m or N], e.g. `softrobots.PD`; or constant torques. The motors have
            rotor inertia, friction and largest torque of the file (`softrobots.dynamics.motor_torque`), and no end stops.
        sample_time: Time between two evaluations of `torque`, which is held in between [s]; None: it acts continuously.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The motion; the first row is the start, the last one the end. Ctrl-C ends the simulation early with what there is
        (`Motion.interrupted`).

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        NameNotFound: If a frame does not exist.
        NotConverged: If no step from a state succeeds, however short, a function fails after the first step or returns what it
            must not, or the tolerance cannot be met; `best` is the motion that was reached.
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
    weight = Load.of(model, gravity=gravity).gravity
    beta = None if damping_time is None else non_negative_number("damping_time", damping_time, "s")
    damping = {"damping_time": beta, "mass_damping": non_negative_number("mass_damping", mass_damping, "1/s")}
    first = first_state(model, start, path, 0 if drive is None else drive.count)
    h, largest, rows = steps_and_rows(end, model.reach, time_step, output_step, tolerance)
    scheme = order_of_steps(order, h, model, path.constant and load.constant and drive is None)
    with one_blas_thread(model.n_springs):
        drives = None if drive is None else model.actuators.drives
        equations = EquationsOfMotion(model, weight, damping_matrix(model, beta, mass_damping), drives)

        def new_run() -> Recorder:
            """A run from the first state, whose velocities take those with which prescribed motors begin."""
            controller = None if drive is None else MotorTorque(model, torque, sample_time)
            rule = RULES[scheme](equations, path, load, controller)
            change = first_kick(path, first.rates[: model.n_motors])
            return Recorder(rule, first if change is None else rule.kicked(first, change), rows)

        breaks = path.kick_times, path.breaks, load.breaks
        grid = merged_times(SAME_TIME * end, end, *breaks) if h is None else grid_with_stops(end, h, *breaks)
        if drive is not None:
            grid = drive.with_samples(grid)
        if h is not None:
            return _within(None, new_run, grid, damping, progress)
        return _within(largest, new_run, first_grid(rows, [grid], scheme), damping, progress)


def _within(
    tolerance: float | None,
    new_run: Callable[[], Recorder],
    grid: FloatArray,
    damping: Mapping[str, Any],
    progress: bool | str,
) -> Motion:
    """Motion with the steps of a grid, and with shorter ones until the tip is within a tolerance [m]; None: any."""
    facts: dict[str, Any] = {**damping, "tolerance": tolerance, "tip_error": None}
    run, history, last = new_run(), [math.inf], math.inf
    order = run.rule.order
    try:
        knees = tolerance is not None and order == MidpointRule.order
        _take(run, follow(run, grid, to_knees=knees), facts, progress, "motion")
        while tolerance is not None:
            finer = new_run()
            grid = halved(np.array(run.times))
            _take(finer, follow(finer, grid), facts | {"tip_error": None}, progress, f"motion, {len(grid) - 1} steps")
            places = np.searchsorted(finer.times, run.times)  # a step that fails has more parts
            errors = np.linalg.norm(np.array(run.tips) - np.array(finer.tips)[places], axis=1)
            before, last = last, float(errors.max())
            errors *= error_share(before, last, order)
            history.append(float(errors.max()))
            facts["tip_error"] = history[-1]
            if history[-1] <= tolerance:
                return finer.motion(**facts)
            if len(history) > STALLED and history[-1] > 0.5 * history[-1 - STALLED]:
                why = "halving the steps brings the runs no closer, as in chaotic motion"
            elif (needed := len(finer.times) * 2 ** math.ceil(math.log2(history[-1] / tolerance) / order)) > MOST_STEPS:
                why = f"about {needed} would be needed, {MOST_STEPS} are the most"
            else:
                run = finer
                continue
            within = float(run.times[int(np.argmax(errors > tolerance)) - 1])
            raise NotConverged(
                f"the tip is known to {history[-1]:.3g} m, required {tolerance:.3g} m, with {len(finer.times) - 1} steps: "
                f"{why}. It is within the tolerance until t = {within:.4g} s of {run.duration:.4g} s. A shorter duration, a "
                f"larger tolerance or more damping may help, or a given time_step; `best` is the last run",
                best=finer.motion(**facts),
                residual=history[-1],
                iterations=len(history),
            )
        return run.motion(**facts)
    except KeyboardInterrupt:
        return run.motion(**facts, interrupted=True)


def _take(run: Recorder, steps: Iterable[int], facts: dict[str, Any], progress: bool | str, label: str) -> None:
    """Take all steps of a run, whose motion has other fields `facts`.

    Raises:
        NotConverged: If no step from a state succeeds, or a function of the caller fails after the first one; `best` is the
            motion up to there.
    """
    try:
        for _ in with_progress(steps, progress, label=label, unit="row", total=run.count):
            pass
    except Exception as error:  # of a controller, a load or a path: anything
        count = len(run.times) - 1
        if count == 0 and not isinstance(error, NoStep):
            raise
        cause = None if isinstance(error, NoStep) else error
        why = stopped_at(run.state.time, run.duration, cause) if cause else str(error)
        why += "; `best` is the motion until there"
        raise NotConverged(why, best=run.motion(**facts), residual=math.inf, iterations=count) from cause
