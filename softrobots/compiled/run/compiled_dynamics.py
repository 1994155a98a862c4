"""Compiled motion of a robot, single and in batches, without Pinocchio in the loop."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.compiled.motion.held_motion import moving_coordinates
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.batches import fail, gravity_vector
from softrobots.compiled.run.compiled_statics import NO_FORCE, CompiledStatics
from softrobots.compiled.run.friction_states import apart, with_sliders
from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.run.motion_cases import MotionCases
from softrobots.compiled.run.motion_course import Course, SpringKicks
from softrobots.compiled.run.motion_damping import MotionDamping
from softrobots.compiled.run.motion_replay import replay
from softrobots.compiled.run.motion_results import CompiledMotion, StepEnd, check_batch, check_motion
from softrobots.compiled.run.motion_runs import StepsTaken, halve_to_tolerance, take_batch, take_one
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, finite_array, non_negative_number, positive_integer, positive_number, read_only
from softrobots.core.errors import NotConverged
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.step_control import order_of_steps
from softrobots.dynamics.time_grid import first_grid, grid_with_stops, steps_and_rows
from softrobots.dynamics.time_inputs import MOST_KINKS, MotorPath, TimeLoad
from softrobots.model.friction_coordinates import check_frictionless

_COMPARED = 401  # times at which tips of two runs are compared, besides those of the rows


class CompiledDynamics(CompiledStatics):
    """Compiled motion of a robot, for single cases and for batches.

    See `softrobots.compiled.run.compiled_model.CompiledModel`, which adds load estimation and inverse kinematics.
    """

    def __init__(self, *given: Any) -> None:
        """Read the robot, see `CompiledStatics`; call `softrobots.compile` instead."""
        super().__init__(*given)
        self._motion_runs: dict[tuple[bool, int], Any] = {}
        self._moving = list(moving_coordinates(self._unknowns))
        self._damping = MotionDamping(self._model, self._unknowns.strains, self._moving)
        self._spring_kicks = SpringKicks(self._model, self._moving, self._unknowns.strains, self._actuation)

    def simulate(
        self,
        duration: Any,
        q_motors: Any,
        *,
        start: Any = None,
        force: Any = None,
        gravity: Any = None,
        damping_time: Any = None,
        mass_damping: Any = 0.0,
        time_step: Any = None,
        output_step: Any = None,
        tolerance: Any = None,
        order: Any = None,
        progress: bool | str = False,
    ) -> Motion:
        """Simulate the motion of the robot as `softrobots.simulate` does, with the same answer at the same steps.

        Args:
            duration: Time to simulate [s].
            q_motors: Actuators, shape (n_motors,) [rad, m or N]: constants, a `Trajectory` or a function of time.
            start: An `Equilibrium`, a `Motion` or a `MotionState`; by default relaxed springs at rest.
            force: Force on the tip, shape (3,) [N], world axes: constant, a table or a function of time.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            damping_time: Damping of the elastic coordinates over their stiffness [s]; None: the damping of the description.
            mass_damping: Rayleigh's factor of the mass matrix, which is that of the relaxed robot at all times [1/s].
            time_step: Length of each step [s]; by default steps are halved until the tip is within the tolerance.
            output_step: Time between two rows of the result [s]; by default 200 rows, or fewer with given steps.
            tolerance: Largest error of the tip [m], measured with steps twice as long; by default 5e-4 of the reach.
            order: Order of the error in the length of the steps, 2 or 4, as in `softrobots.simulate`.
            progress: Show a progress bar of parts of 2000 steps on stderr; a text is its label.

        Returns:
            The motion; its torques and energies are computed when they are first asked for, by Pinocchio. Ctrl-C ends it early
            with what there is (`Motion.interrupted`).

        Raises:
            ParameterError: If an argument has the wrong shape, is not finite or out of range, or its actuators are refused.
            NotConverged: If a step fails, however short, a function fails after the first step or returns what it must not, or
                the tolerance is not met; `best` is the motion so far.
        """
        end = positive_number("duration", duration, "s")
        path, load = MotorPath(self._model, q_motors, end), TimeLoad(self._model, force, None, end)
        course = Course(path, load, self._spring_kicks)
        h, largest, rows = steps_and_rows(end, self._model.reach, time_step, output_step, tolerance)
        scheme = order_of_steps(order, h, self._model, path.constant and load.constant)
        run, given, damping = self._motion_code(gravity, damping_time, mass_damping, scheme)
        beta, asked = None if damping_time is None else float(damping_time), None if h is not None else largest
        facts = {"damping_time": beta, "mass_damping": float(mass_damping), "tolerance": asked, "tip_error": None}
        first = course.first_state(self._model, start)
        (u, y), (du, dy) = ((one[: self._motors], one[self._motors :][self._moving]) for one in (first.x, first.rates))
        if first.memory is not None and (friction := self._model.structure.friction) is not None:
            bending, anchors = first.memory.bending, friction.anchors(first.memory)
            given.append((run.layout.anchors, self._spring_kicks.carried(bending, anchors, u, y, du, dy)))
        times = rows if h is not None else np.union1d(rows, np.linspace(0.0, end, _COMPARED))

        def take(grid: FloatArray) -> StepsTaken:
            return take_one(run, (y, dy), given, course, grid, times, progress, h is None)

        if h is not None:
            taken = take(grid_with_stops(end, h, *course.breaks))
        else:
            taken = halve_to_tolerance(take, first_grid(rows, course.breaks, scheme), largest, scheme)
            facts["tip_error"] = None if taken.errors is None or taken.status[0] else float(taken.errors[0])
        at_rows = taken if times is rows else replace(taken, rows=taken.rows[:, np.searchsorted(times, rows)])
        down = None if gravity is None else tuple(gravity_vector(gravity).tolist())

        def again(steps: FloatArray, row_times: FloatArray) -> Motion:
            ends = take_one(run, (y, dy), given, course, steps, steps)
            if ends.interrupted:
                raise KeyboardInterrupt
            if ends.failure is not None:
                raise ends.failure[1]
            ends = replace(ends, rows=np.concatenate(self._elastic_state(ends.rows[..., :-3]), axis=-1))
            return replay(EquationsOfMotion(self._model, down, damping), course, ends, row_times, facts, scheme, first)

        found = at_rows.rows[0][np.isfinite(at_rows.rows[0, :, -1])]
        springs, rates = self._elastic_state(found[:, :-3])
        known = course.inputs_at(rows[: len(found)], taken.grid) | facts | {"gravity": down, "interrupted": taken.interrupted}
        if path.constant and len(found) == len(rows):
            known["tip_position"] = np.ascontiguousarray(found[:, -3:])
        known["model"] = with_sliders(self._actuation, taken.sliders)
        motion = CompiledMotion(again, q_springs=springs, velocities=rates, **known)
        check_motion(motion, taken, end)
        return motion

    def step(
        self,
        q_springs: Any,
        velocities: Any,
        q_motors: Any,
        force: Any = NO_FORCE,
        *,
        time_step: Any = 1e-3,
        gravity: Any = None,
        damping_time: Any = None,
        mass_damping: Any = 0.0,
        order: Any = 2,
    ) -> StepEnd:
        """Take one step of time from a state, for an observer or a controller; `c_source(motion=True)` has it in C.

        Args:
            q_springs: Elastic coordinates at the beginning, shape (n_springs,) [rad or m].
            velocities: Their rates, shape (n_springs,) [rad/s or m/s].
            q_motors: Actuators, shape (n_motors,) [rad, m or N] if they stand still, or (3, n_motors): at the beginning, in the
                middle and at the end of the step.
            force: Force on the tip in the middle of the step, shape (3,) [N], world axes.
            time_step: Length of the step [s].
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            damping_time: Damping of the elastic coordinates over their stiffness [s]; None: the damping of the description.
            mass_damping: Rayleigh's factor of the mass matrix, which is that of the relaxed robot at all times [1/s].
            order: Order of the error in the length of the step: 2, or 4 for motors that stand still.

        Returns:
            The state at the end.

        Raises:
            ParameterError: If an argument has the wrong shape, is not finite or out of range, or its actuators are refused.
            NotConverged: If the step fails, even in small parts; `best` is None.
        """
        check_frictionless(self._model, "single steps (simulate and C code take it)")
        scheme = order_of_steps(order, time_step, self._model, np.ndim(q_motors) < 2)
        run, given, _ = self._motion_code(gravity, damping_time, mass_damping, scheme)
        layout, n, moving = run.layout, self._model.n_springs, self._moving
        q_motors = self._model.actuators.in_order(q_motors, "q_motors")
        path: Any = [q_motors] * 3 if np.ndim(q_motors) < 2 else finite_array("q_motors", q_motors, (3, self._motors), "rad")
        path = [self._actuation.checked(one) for one in path]
        state = finite_array("q_springs", q_springs, (n,), "rad"), finite_array("velocities", velocities, (n,), "rad/s")
        w = run.workspace()
        for place, values in [
            *given,
            (layout.position, state[0][moving]),
            (layout.velocity, state[1][moving]),
            (layout.force, finite_array("force", force, (3,), "N")),
            (layout.time_step, np.array([positive_number("time_step", time_step, "s")])),
            (layout.motors_begin, np.concatenate(path)),
        ]:
            run.put(w, place, values)
        status = Status(run.motion_step(w))
        if status != Status.CERTIFIED:
            why = f"the step of {time_step} s fails, even in small parts: {status.explanation}"
            raise NotConverged(why, best=None, residual=math.inf, iterations=1)
        run.place_at(w, 1.0)
        springs, rates = self._elastic_state(np.array(w[layout.position : layout.position + 2 * layout.unknowns]))
        return StepEnd(read_only(springs), read_only(rates), read_only(np.array(w[layout.tip : layout.tip + 3])))

    def simulations(
        self,
        duration: Any,
        q_motors: Any,
        *,
        starts: Any = None,
        forces: Any = None,
        gravity: Any = None,
        damping_time: Any = None,
        mass_damping: Any = 0.0,
        time_step: Any = None,
        output_step: Any = None,
        tolerance: Any = None,
        order: Any = None,
        threads: int = 1,
        progress: bool | str = False,
    ) -> MotionBatch:
        """Simulate many cases side by side, all with the same steps.

        Args:
            duration: Time to simulate [s].
            q_motors: Actuators that stand still, shape (n, n_motors), or (n_motors,) for all cases [rad, m or N]; a
                `Trajectory` or a function of time for all cases; or a list of those.
            starts: Elastic coordinates at rest, shape (n, n_springs) or (n_springs,) [rad or m]; a pair of those and their
                rates; an `Equilibrium` for all cases; a `MotionBatch`, whose last rows are taken, or an `EquilibriumBatch`; by
                default relaxed springs.
            forces: Force on the tip, shape (n, 3), or (3,) for all cases [N], world axes; a table or a function of time for all
                cases; or a list of those.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            damping_time: Damping of the elastic coordinates over their stiffness [s]; None: the damping of the description.
            mass_damping: Rayleigh's factor of the mass matrix, which is that of the relaxed robot at all times [1/s].
            time_step: Length of each step [s]; by default steps are halved until all tips are within the tolerance.
            output_step: Time between two rows of the result [s]; by default 200 rows, or fewer with given steps.
            tolerance: Largest error of the tip in a row [m], measured with steps twice as long; by default 5e-4 of the reach.
            order: Order of the error in the length of the steps, 2 or 4, as in `softrobots.simulate`.
            threads: Number of threads; more than one speeds up numba only.
            progress: Show a progress bar of blocks of cases on stderr; a text is its label.

        Returns:
            One motion a case. The status tells which cases failed; a failed case does not affect others. Ctrl-C ends it early
            with the cases that are done (`MotionBatch.interrupted`).

        Raises:
            ParameterError: If an argument has the wrong shape or is out of range, or its actuators are refused.
            NotConverged: If the tolerance is not met, or the function of a case fails on the way, when the others are done;
                `best` is the batch.
        """
        end = positive_number("duration", duration, "s")
        positive_integer("threads", threads)
        h, largest, rows = steps_and_rows(end, self._model.reach, time_step, output_step, tolerance)
        cases = MotionCases(self._model, self._actuation, end, q_motors, forces, starts)
        scheme = order_of_steps(order, h, self._model, cases.stand_still)
        run, given, _ = self._motion_code(gravity, damping_time, mass_damping, scheme)
        spring_kicks = self._spring_kicks
        springs, rates = (np.array(one[:, self._moving]) for one in cases.state)
        cases.kick(spring_kicks, 0.0, slice(None), springs, rates)
        values = [(run.layout.position, springs), (run.layout.velocity, rates), *((place, one[None]) for place, one in given)]
        if run.layout.rubbing:
            values.insert(2, (run.layout.anchors, cases.carried(spring_kicks, springs, rates)))
        times = rows if h is not None else np.union1d(rows, np.linspace(0.0, end, _COMPARED))

        def take(grid: FloatArray) -> StepsTaken:
            return take_batch(run, values, cases, spring_kicks, grid, times, threads, progress, h is None)

        if h is not None:
            few = sum(map(len, cases.breaks)) <= MOST_KINKS
            taken = take(grid_with_stops(end, h, *(cases.breaks if few else [cases.kicks])))
        else:
            taken = halve_to_tolerance(take, first_grid(rows, cases.breaks, scheme), largest, scheme, cases.bad)
        found = taken.rows[:, np.searchsorted(times, rows)]
        fail(taken.status, cases.bad, [], [found])
        tips, asked = np.ascontiguousarray(found[..., -3:]), None if h is not None else largest
        springs, rates = self._elastic_state(found[..., :-3])
        slip, sliders = apart(self._actuation, taken.sliders)
        bending = None if sliders is None else self._actuation.bending(sliders)
        facts = taken.status, taken.grid, taken.errors, asked, taken.interrupted, bending, slip
        batch = MotionBatch(rows, springs, rates, tips, *facts)
        check_batch(batch, taken, cases.failures)
        return batch

    def _motion_code(self, gravity: Any, damping_time: Any, mass_damping: Any, order: int) -> tuple[Any, Any, FloatArray]:
        """Return the code, what stands in its workspace of gravity and damping, and the damping of the elastic coordinates."""
        down = gravity_vector(gravity)
        alpha = non_negative_number("mass_damping", mass_damping, "1/s")
        beta = None if damping_time is None else non_negative_number("damping_time", damping_time, "s")
        full = alpha > 0.0
        if (full, order) not in self._motion_runs:
            program = make_motion_program(self._unknowns, full_damping=full, order=order)
            self._motion_runs[full, order] = make_run(program, self._backend)
        run = self._motion_runs[full, order]
        given = [*self._damping.inputs(run.layout, beta, alpha), (run.layout.gravity, down)]
        return run, given, self._damping.matrix(beta, alpha)

    def _elastic_state(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return elastic coordinates and rates, each shape (..., n_springs), from unknowns and their rates."""
        n, count = state.shape[-1] // 2, self._model.n_springs
        if n == count:
            return state[..., :n].copy(), state[..., n:].copy()
        springs, rates = np.tile(self._model.rest, (*state.shape[:-1], 1)), np.zeros((*state.shape[:-1], count))
        springs[..., self._moving], rates[..., self._moving] = state[..., :n], state[..., n:]
        return springs, rates
