"""Compiled motion of a robot, single and in batches, without Pinocchio in the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.compiled.run.batches import fail, gravity_vector
from softrobots.compiled.run.compiled_steps import CompiledSteps
from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.run.motion_cases import MotionCases
from softrobots.compiled.run.motion_course import Course
from softrobots.compiled.run.motion_replay import replay
from softrobots.compiled.run.motion_results import CompiledMotion, check_batch, check_motion
from softrobots.compiled.run.motion_runs import StepsTaken, first_grid, halve_to_tolerance, take_batch, take_one
from softrobots.core.checks import FloatArray, positive_integer, positive_number
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.step_control import order_of_steps
from softrobots.dynamics.time_grid import grid_with_stops, steps_and_rows
from softrobots.dynamics.time_inputs import MOST_KINKS, MotorPath, TimeLoad

_COMPARED = 401  # times at which tips of two runs are compared, besides those of the rows


class CompiledDynamics(CompiledSteps):
    """Compiled motion of a robot, for single cases and for batches.

    See `softrobots.compiled.run.compiled_model.CompiledModel`, which adds load estimation and inverse kinematics.
    """

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
        facts: dict[str, Any] = {
            "damping_time": None if damping_time is None else float(damping_time),
            "tolerance": None if h is not None else largest,
            "tip_error": None,
        }
        first = self._first_state(course, start)
        elastic = first.x[self._motors :], first.rates[self._motors :]
        state = elastic[0][self._moving], elastic[1][self._moving]
        if first.memory is not None:
            at = (first.x[: self._motors], state[0], first.rates[: self._motors], state[1])
            given.append(
                (run.layout.sliders, self._spring_kicks.carried(self._actuation.sliders(first.memory.bending[None])[0], *at))
            )
        times = rows if h is not None else np.union1d(rows, np.linspace(0.0, end, _COMPARED))

        def take(grid: FloatArray) -> StepsTaken:
            return take_one(run, state, given, course, grid, times, progress, h is None)

        if h is not None:
            taken = take(grid_with_stops(end, h, *course.breaks))
        else:
            taken = halve_to_tolerance(take, first_grid(rows, course.breaks, scheme), largest, scheme)
            facts["tip_error"] = None if taken.errors is None or taken.status[0] else float(taken.errors[0])
        at_rows = taken if times is rows else replace(taken, rows=taken.rows[:, np.searchsorted(times, rows)])
        down = None if gravity is None else tuple(gravity_vector(gravity).tolist())

        def again(steps: FloatArray, row_times: FloatArray) -> Motion:
            ends = take_one(run, state, given, course, steps, steps)
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
        motion = CompiledMotion(again, model=self._remembering(taken.sliders), q_springs=springs, velocities=rates, **known)
        check_motion(motion, taken, end)
        return motion

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
            values.insert(2, (run.layout.sliders, cases.carried(spring_kicks, self._actuation, springs, rates)))
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
        rubbing = taken.sliders if run.layout.rubbing else None
        bending = None if rubbing is None else self._actuation.bending(np.nan_to_num(rubbing))
        batch = MotionBatch(
            rows, springs, rates, tips, taken.status, taken.grid, taken.errors, asked, taken.interrupted, bending
        )
        check_batch(batch, taken, cases.failures)
        return batch
