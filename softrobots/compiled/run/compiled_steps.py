"""Code of the motion of a robot, its state at time zero, and single steps of time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.compiled.motion.held_motion import moving_coordinates
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.batches import gravity_vector, without_dust
from softrobots.compiled.run.compiled_statics import NO_FORCE, CompiledStatics
from softrobots.compiled.run.friction_states import StatesBefore, remembered
from softrobots.compiled.run.motion_course import Course, SpringKicks
from softrobots.compiled.run.motion_damping import MotionDamping
from softrobots.compiled.run.motion_results import RubbingStepEnd, StepEnd
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, finite_array, non_negative_number, positive_number, read_only
from softrobots.core.errors import NotConverged
from softrobots.dynamics.midpoint import State
from softrobots.dynamics.starting import first_kick, first_state
from softrobots.dynamics.step_control import order_of_steps
from softrobots.model.soft_model import SoftModel


class CompiledSteps(CompiledStatics):
    """Compiled steps of time of a robot; `softrobots.compiled.run.compiled_dynamics` takes many."""

    def __init__(self, *given: Any) -> None:
        """Generate and load the code, see `CompiledStatics`; call `softrobots.compile` instead."""
        super().__init__(*given)
        self._motion_runs: dict[tuple[bool, int], Any] = {}
        self._moving = list(moving_coordinates(self._unknowns))
        self._damping = MotionDamping(self._model, self._unknowns.strains, self._moving)
        self._spring_kicks = SpringKicks(self._model, self._moving, self._unknowns.strains)

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
        friction_bending: Any = None,
    ) -> StepEnd | RubbingStepEnd:
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
            friction_bending: Bending that dry friction remembers, as the end of the last step has it, shape (n_sections, 2)
                [rad]; None: nothing has moved the robot yet.

        Returns:
            The state at the end, of a robot with dry friction with what that remembers.

        Raises:
            ParameterError: If an argument has the wrong shape, is not finite or out of range, or its actuators are refused.
            NotConverged: If the step fails, even in small parts; `best` is None.
        """
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
        if layout.rubbing:
            rest = self._actuation.rest_bending
            bending = (
                rest if friction_bending is None else finite_array("friction_bending", friction_bending, rest.shape, "rad")
            )
            speeds = (4.0 * path[1] - 3.0 * path[0] - path[2]) / time_step
            at = path[0], state[0][moving], speeds, state[1][moving]
            run.put(w, layout.sliders, self._spring_kicks.carried(self._actuation.sliders(bending[None])[0], *at))
        status = Status(run.motion_step(w))
        if status != Status.CERTIFIED:
            why = f"the step of {time_step} s fails, even in small parts: {status.explanation}"
            raise NotConverged(why, best=None, residual=math.inf, iterations=1)
        run.place_at(w, 1.0)
        springs, rates = self._elastic_state(np.array(w[layout.position : layout.position + 2 * layout.unknowns]))
        end = read_only(springs), read_only(rates), read_only(np.array(w[layout.tip : layout.tip + 3]))
        if not layout.rubbing:
            return StepEnd(*end)
        slid = np.array([w[layout.sliders : layout.strain_begin]])
        return RubbingStepEnd(*end, read_only(self._actuation.bending(slid)[0]))

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

    def _first_state(self, course: Course, start: Any) -> State:
        """Return the state at time zero, after the motors have begun to move."""
        first, m = first_state(self._model, start, course.path), self._motors
        places = m + np.array(self._moving, dtype=np.intp)
        first.x[m:], first.rates[m:] = without_dust(first.x[m:]), without_dust(first.rates[m:])
        change = first_kick(course.path, first.rates[:m])
        if change is not None:
            first.rates[places] += course.spring_kicks.at(first.x[:m], first.x[places], change)
            first.rates[:m] += change
        return first

    def _remembering(self, sliders: FloatArray | None) -> SoftModel:
        """Return the robot with what friction remembers of sliders, shape (1, N); the robot itself without friction."""
        if sliders is None:
            return self._model
        before = StatesBefore(sliders, sliders, np.zeros((1, 0)), None)
        return remembered(self._actuation, before)

    def _elastic_state(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return elastic coordinates and rates, each shape (..., n_springs), from unknowns and their rates."""
        n, count = state.shape[-1] // 2, self._model.n_springs
        if n == count:
            return state[..., :n].copy(), state[..., n:].copy()
        springs, rates = np.tile(self._model.rest, (*state.shape[:-1], 1)), np.zeros((*state.shape[:-1], count))
        springs[..., self._moving], rates[..., self._moving] = state[..., :n], state[..., n:]
        return springs, rates
