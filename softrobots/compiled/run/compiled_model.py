"""Compiled load estimation and inverse kinematics of a robot, on top of its equilibria and motion; `softrobots.compile`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from softrobots.compiled.run.backends import chosen_backend
from softrobots.compiled.run.batches import batch_rows, fail, flat_targets, gravity_vector, unusable, without
from softrobots.compiled.run.compiled_dynamics import CompiledDynamics
from softrobots.compiled.run.compiled_statics import DOUBLE, NO_FORCE
from softrobots.compiled.run.friction_states import StatesBefore
from softrobots.compiled.run.looped_search import LoopedSearch
from softrobots.compiled.run.results import CompiledLoadEstimate, LoadBatch, MotorBatch
from softrobots.compiled.run.unrolled_search import UnrolledSearch
from softrobots.compiled.statuses import Status
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.checks import finite_array, positive_integer, positive_number
from softrobots.core.errors import LoadNotFound, ParameterError, TargetUnreachable
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.inverse_kinematics import solve_ik, start_motors
from softrobots.statics.load_estimation import check_feels
from softrobots.statics.tip_search import POSITION_TOLERANCE

_SEED = 20210312  # of the motors that searches of a batch start from


def compile_model(model: SoftModel, *, backend: str | None = None, locked_strains: tuple[str, ...] = ()) -> CompiledModel:
    """Compile the statics and the motion of a robot.

    Args:
        model: A robot that is one serial chain from base to tip, with linear springs, sections of constant strain, or both.
        backend: "numba" (extra `fast`) or "python", which needs nothing else; by default numba if it is installed.
        locked_strains: Strains of sections that keep their rest values, of "bend_x", "bend_y", "twist", "stretch":
            `("twist", "stretch")` leaves bending only.

    Returns:
        Its solvers. numba compiles each of them on its first call.

    Raises:
        ParameterError: If the model is not a SoftModel, the back end is unknown, or strains cannot be locked.
        NameNotFound: If a strain to lock does not exist.
        DescriptionError: If the robot is not a serial chain with linear springs.
        MissingDependency: If `backend` is "numba" and numba is not installed.
    """
    check_model(model)
    chosen = chosen_backend(backend)
    if isinstance(locked_strains, str) or not isinstance(locked_strains, Iterable):
        raise ParameterError("locked_strains", locked_strains, f"a tuple of names, of {', '.join(STRAINS)}")
    return CompiledModel(model, chosen, tuple(locked_strains))


class CompiledModel(CompiledDynamics):
    """Compiled solvers of a robot, for single cases and for batches; made by `softrobots.compile`.

    Loads are a dead force on the tip and gravity, in world axes. Angles, signs and tolerances are those of
    `softrobots.solve_equilibrium`; of several equilibria the result is the one that descent from rest reaches, or with dry
    friction from the state before. Safe to share between threads.
    """

    def __init__(self, *given: Any) -> None:
        """Read the robot, see `CompiledStatics`; call `softrobots.compile` instead."""
        super().__init__(*given)
        self._plain_estimate = self._plain and self._unknowns.moved_by_motors

    def estimate_load(
        self, q_motors: Any, motor_torques: Any, *, gravity: Any = None, previous: Any = None
    ) -> CompiledLoadEstimate:
        """Find the force on the tip from the motor torques.

        Near poses in which one direction of the force is hardly observable, several forces can explain the same torques, and
        the result differs from that of `softrobots.estimate_load` in a few cases of a thousand; see its `observability`.

        Args:
            q_motors: Motor coordinates, shape (n_motors,) [rad or m].
            motor_torques: Load on each motor, shape (n_motors,) [N m or N], with the sign of `Equilibrium.motor_torques`.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            previous: Where a robot with dry friction comes from, see `equilibrium`.

        Returns:
            The force, and the robot in equilibrium under it.

        Raises:
            ParameterError: If a shape differs, a number is not finite, the robot has no actuators or muscles of given
                tension, or no shape of it has these muscle lengths.
            LoadNotFound: If no force is found that explains the torques, or a direction of it is unobservable.
        """
        if (
            self._plain_estimate
            and gravity is None
            and previous is None
            and type(q_motors) is np.ndarray
            and type(motor_torques) is np.ndarray
            and q_motors.dtype is DOUBLE
            and motor_torques.dtype is DOUBLE
            and q_motors.shape == self._shape
            and motor_torques.shape == self._shape
        ):
            _, estimate, size, layout = self._light
            w = np.zeros(size)
            w[: self._motors] = q_motors
            w[layout.torques : layout.torques + self._motors] = motor_torques
            if estimate(w) == 0:
                return CompiledLoadEstimate(w, layout, self._actuation)
        return self._checked_estimate(q_motors, motor_torques, gravity, previous)

    def _checked_estimate(self, q_motors: Any, motor_torques: Any, gravity: Any, previous: Any) -> CompiledLoadEstimate:
        check_feels(self._model)
        run = self._run(gravity is not None)
        motors = self._actuation.checked(q_motors)
        torques = self._model.actuators.checked_loads(motor_torques, "motor_torques")
        search = self._search(run, self._before(previous, single=True))
        status, w = search.estimate(motors, torques, gravity_vector(gravity))
        estimate = CompiledLoadEstimate(w, run.layout, self._actuation, motors, Status(status))
        if status != Status.CERTIFIED:
            raise LoadNotFound(
                f"no unique force explains the motor torques {torques.tolist()}: {Status(status).explanation}; "
                f"{estimate.unexplained:.3g} {self._model.actuators.load_unit} "
                "remain (softrobots.estimate_load returns the unobservable directions)",
                best=estimate,
                residual=estimate.unexplained,
                iterations=int(w[run.layout.single("iterations")]),
            )
        return estimate

    def estimate_loads(
        self, q_motors: Any, motor_torques: Any, *, gravity: Any = None, threads: int = 1, previous: Any = None
    ) -> LoadBatch:
        """Find the forces of many cases from their motor torques.

        Args:
            q_motors: Motor coordinates, shape (n, n_motors), or (n_motors,) for all cases [rad or m].
            motor_torques: Load on each motor, shape (n, n_motors) [N m or N].
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            threads: Number of threads; more than one speeds up numba only.
            previous: Where robots with dry friction come from, as in `equilibria`, which under the forces found tells where
                they are then.

        Returns:
            One row a case.

        Raises:
            ParameterError: If a shape differs, gravity is not finite, or the robot has no actuators or muscles of given
                tension.
        """
        check_feels(self._model)
        run, before = self._run(gravity is not None), self._before(previous)
        named = self._model.actuators.in_order
        motors, torques, *_ = batch_rows(
            q_motors=(named(q_motors, "q_motors"), self._motors),
            motor_torques=(named(motor_torques, "motor_torques"), self._motors),
            **({} if before is None else before.rows),
        )
        down = gravity_vector(gravity)
        bad = unusable(motors, torques) | self._actuation.unsuited(motors)
        motors, torques = without(motors, bad, self._model.relaxed_motors), without(torques, bad)
        search = self._search(run, before)
        statuses, unknowns, forces, residuals, unexplained, observed = search.estimate_batch(motors, torques, down, threads)
        if before is not None:
            statuses = np.where(before.lost, before.status, statuses).astype(np.uint8)
        fail(statuses, bad, [residuals, unexplained], [unknowns, forces, observed])
        return LoadBatch(self._actuation.elastic(unknowns), statuses, residuals, forces, unexplained, observed)

    def inverse_kinematics(
        self,
        targets: Any,
        forces: Any = NO_FORCE,
        *,
        q_motors0: Any = None,
        q_springs0: Any = None,
        gravity: Any = None,
        tolerance: float = POSITION_TOLERANCE,
        threads: int = 1,
        starts: int = 1,
        previous: Any = None,
    ) -> MotorBatch:
        """Find motors that put the loaded tip at targets, each case from its own start.

        A search from one start finds a solution near it, or none; from a far one it reaches about every third pose of an arm
        with a wrist. `softrobots.solve_ik` chooses among the solutions from many starts.

        Args:
            targets: Targets of the tip, world axes: positions, shape (n, 3) [m], or poses, shape (n, 4, 4).
            forces: Force on the tip, shape (n, 3), or (3,) for all cases [N], world axes.
            q_motors0: Motors to start from, shape (n, n_motors), or (n_motors,) for all [rad or m]; at zero by default.
            q_springs0: Elastic coordinates to start from, shape (n, n_springs) [rad or m]; at rest by default.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            tolerance: Largest distance of the tip from its target [m].
            threads: Number of threads; more than one speeds up numba only.
            starts: Number of searches of a target, until it is reached: the first from `q_motors0`, the others from motors
                drawn within the limits, always the same ones.
            previous: Where a robot with dry friction comes from, one equilibrium for all targets, see `equilibrium`; the same
                step by `equilibrium` from there to the motors found tells what friction remembers after it.

        Returns:
            One row a target.

        Raises:
            ParameterError: If a shape differs, a pose has no rotation, gravity, tolerance or a count is out of range, or the
                robot has no actuators; for poses also if it has less than six motors, sections, muscles or a
                long chain.
        """
        relaxed, before = start_motors(self._model, None), self._before(previous, single=True)
        goals, poses = flat_targets(targets)
        run = self._run(gravity is not None, poses)
        positive_number("tolerance", tolerance, "m")
        begin = relaxed if q_motors0 is None else self._model.actuators.in_order(q_motors0, "q_motors0")
        springs = (self._model.rest if before is None else before.springs[0]) if q_springs0 is None else q_springs0
        points, loads, motors, unknowns = batch_rows(
            targets=(goals, run.layout.target_size),
            forces=(forces, 3),
            q_motors0=(begin, self._motors),
            q_springs0=(springs, self._model.n_springs),
        )
        down = gravity_vector(gravity)
        bad = unusable(points, loads, motors, unknowns) | self._actuation.unsuited(motors)
        points, loads, motors = without(points, bad), without(loads, bad), without(motors, bad, relaxed)
        unknowns = self._actuation.of_elastic(motors, without(unknowns, bad))
        search, random = self._search(run, before), np.random.default_rng(_SEED)
        found = search.reach_batch(points, loads, down, motors, unknowns, tolerance, threads)
        for _ in range(positive_integer("starts", starts, 10_000) - 1):
            left = np.flatnonzero((found[0] != Status.CERTIFIED) & ~bad)
            drawn = [self._model.actuators.draw(random) for _ in left]
            begins = np.array([relaxed if one is None else one for one in drawn]).reshape(-1, self._motors)
            rest = self._actuation.of_elastic(begins, np.tile(self._model.rest, (len(left), 1)))
            again = search.reach_batch(points[left], loads[left], down, begins, rest, tolerance, threads)
            reached = again[0] == Status.CERTIFIED
            for kept, new in zip(found, again, strict=True):
                kept[left[reached]] = new[reached]
        statuses, motors, unknowns, residuals, errors, angles = found
        fail(statuses, bad, [residuals, errors, angles], [unknowns, motors])
        springs = self._actuation.elastic(unknowns)
        return MotorBatch(springs, statuses, residuals, motors, errors, angles if poses else None)

    def follow(
        self,
        targets: Any,
        force: Any = NO_FORCE,
        *,
        q_motors0: Any = None,
        gravity: Any = None,
        tolerance: float = POSITION_TOLERANCE,
        previous: Any = None,
    ) -> MotorBatch:
        """Move the loaded tip through targets, each step from the last; one row a waypoint.

        Args:
            targets: Target positions, shape (n, 3) [m], or poses, shape (n, 4, 4), world axes.
            force: Force on the tip, shape (3,) [N], constant over the path, world axes.
            q_motors0: Motors near the first waypoint, shape (n_motors,) [rad or m]; by default those of `softrobots.solve_ik`,
                which takes some milliseconds.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            tolerance: Largest distance of the tip from a target [m].
            previous: Where a robot with dry friction comes from, see `equilibrium`; each waypoint is a step from the last.

        Returns:
            Motors, elastic coordinates and errors of the waypoints; see the status of each.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or the robot has no actuators, or cannot
                have poses; see `inverse_kinematics`.
            TargetUnreachable: If the first waypoint cannot be reached; from `solve_ik` if no start is given.
        """
        start_motors(self._model, None)
        before = self._before(previous, single=True)
        goals, poses = flat_targets(targets)
        run = self._run(gravity is not None, poses)
        (points,) = batch_rows(targets=(goals, run.layout.target_size))
        if np.any(unusable(points)):
            raise ParameterError("targets", targets, "finite positions [m]")
        load = finite_array("force", force, (3,), "N")
        positive_number("tolerance", tolerance, "m")
        if len(points) == 0:
            raise ParameterError("targets", targets, "at least one target position [m]")
        if q_motors0 is None:
            turned = points[0, 3:].reshape(3, 3) if poses else None
            options: Any = {"orientation": turned, "gravity": gravity, "tolerance": tolerance}
            motors = solve_ik(self._model, points[0, :3], load, **options).q_motors
        else:
            motors = self._actuation.checked(q_motors0, "q_motors0")
        batch, iterations = self._search(run, before).follow(points, load, gravity_vector(gravity), motors, tolerance)
        if batch.status[0] != Status.CERTIFIED:
            raise TargetUnreachable(
                f"waypoint 1 of {len(points)} is not reached from motors {motors.tolist()}: the tip comes within "
                f"{batch.tip_error[0]:.3g} m of it ({Status(batch.status[0]).name})",
                best=batch.q_motors[0],
                residual=float(batch.tip_error[0]),
                iterations=iterations,
            )
        return batch

    def _search(self, run: Any, before: StatesBefore | None = None) -> UnrolledSearch | LoopedSearch:
        """Return the searches for forces and motors: generated code, or Python on top of it, from a state before."""
        if self._unknowns.is_unrolled:
            return UnrolledSearch(self._model, self._actuation, run)
        return LoopedSearch(self._model, self._actuation, run, before)
