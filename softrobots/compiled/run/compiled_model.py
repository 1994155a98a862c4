"""Compiled solvers of a robot: equilibria, loads and inverse kinematics without Pinocchio in the loop.

`softrobots.compile(model)` traces the robot's own placements into straight-line code (`CompiledModel.source` prints it). It is
opt-in: nothing else calls it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.generated_module import make_program
from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.backends import BACKENDS, available_backend, make_run
from softrobots.compiled.run.batches import batch_rows, fail, gravity_vector, root, solve_batch, statuses_of, unusable, without
from softrobots.compiled.run.looped_search import LoopedSearch
from softrobots.compiled.run.results import CompiledEquilibrium, CompiledLoadEstimate, EquilibriumBatch, LoadBatch, MotorBatch
from softrobots.compiled.run.unrolled_search import UnrolledSearch
from softrobots.compiled.statuses import Status
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.checks import choice, finite_array, positive_number, read_only
from softrobots.core.errors import EquilibriumNotFound, LoadNotFound, ParameterError, TargetUnreachable
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.inverse_kinematics import solve_ik, start_motors
from softrobots.statics.load_estimation import check_feels
from softrobots.statics.tip_search import POSITION_TOLERANCE

_NO_FORCE = read_only(np.zeros(3))
_DOUBLE = np.dtype(np.float64)
_THREE = (3,)


def compile_model(model: SoftModel, *, backend: str | None = None, locked_strains: tuple[str, ...] = ()) -> CompiledModel:
    """Compile the statics of a robot.

    Args:
        model: A robot that is one serial chain from base to tip, with linear springs, sections of constant strain, or both.
        backend: "numba" (extra `fast`) or "python", which needs nothing else; by default numba if it is installed.
        locked_strains: Strains of sections that stay as they are at rest, of "bend_x", "bend_y", "twist", "stretch":
            `("twist", "stretch")` leaves bending only.

    Returns:
        Its solvers. Code is made for each job when it is first asked for.

    Raises:
        ParameterError: If the model is none, the back end is unknown, or strains cannot be locked.
        NameNotFound: If a strain to lock is none.
        DescriptionError: If the robot is no serial chain with linear springs.
        MissingDependency: If numba is asked for and not installed.
    """
    check_model(model)
    chosen = available_backend() if backend is None else choice("backend", backend, BACKENDS)
    if isinstance(locked_strains, str) or not isinstance(locked_strains, Iterable):
        raise ParameterError("locked_strains", locked_strains, f"a tuple of names, of {', '.join(STRAINS)}")
    return CompiledModel(model, chosen, tuple(locked_strains))


class CompiledModel:
    """Compiled solvers of a robot, for single cases and for batches; made by `softrobots.compile`.

    Loads are a dead force on the tip and gravity, in world axes. All angles, signs and tolerances are those of
    `softrobots.solve_equilibrium`, and so are the answers; of several equilibria it is the one that descent from rest finds.
    Safe to share between threads.
    """

    def __init__(self, model: SoftModel, backend: str, locked_strains: tuple[str, ...]) -> None:
        """Prepare the solvers; call `softrobots.compile` instead."""
        self._model, self._backend = model, backend
        self._chain = model.chain()
        self._unknowns = Unknowns(self._chain, locked_strains)
        self._actuation = Actuation(model, self._unknowns)
        self._runs: dict[bool, Any] = {}
        self._shape = (model.n_motors,)
        self._motors = model.n_motors
        run = self._run(False)
        self._settle, self._estimate = run.settle, run.estimate
        self._size, self._layout, self._torques = run.program.size, run.layout, run.layout.torques
        # What arrays of the right kind go straight into; everything else is checked first.
        self._plain = len(self._chain.muscle_rest) == 0 and backend == "numba"
        self._feels = self._plain and self._unknowns.moved_by_motors

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as the robot and what was said about it; the other process compiles it again, or finds what is kept."""
        return CompiledModel, (self._model, self._backend, self._unknowns.locked)

    def __repr__(self) -> str:
        """The robot and the back end."""
        return f"CompiledModel({self._chain.name!r}, backend={self._backend!r})"

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self._model

    @property
    def backend(self) -> str:
        """The back end: "numba" or "python"."""
        return self._backend

    def source(self, *, gravity: bool = False, lanes: bool = False) -> str:
        """The generated code, as Python runs it.

        Args:
            gravity: That for robots with weight.
            lanes: What is added to work on many cases side by side, too.
        """
        program = self._run(gravity).program
        return str(program.text + ("\n\n" + program.lane_text if lanes else ""))

    def c_source(self, *, gravity: bool = False, prefix: str = "softrobots") -> str:
        """The generated code as freestanding C99: one file without libraries, allocation or state, for a control loop.

        Every function works on an array of doubles that the caller owns; the head of the file is its manual: what comes in and
        out, where it stands, in which unit, and what a status says. Equilibria are there for every robot; `estimate`, `reach`
        and `follow` for chains that are traced in one straight line.

        Args:
            gravity: That for robots with weight.
            prefix: Begins every name, with an underscore behind it.

        Raises:
            ParameterError: If the prefix is no name.
        """
        from softrobots.compiled.c.source import to_c

        if not isinstance(prefix, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", prefix):
            raise ParameterError("prefix", prefix, "ASCII letters, digits and underscores, a letter first")
        program = self._run(gravity).program
        return to_c(program.text, prefix=f"{prefix}_", exported=program.entry_points)

    def equilibrium(
        self, q_motors: Any, force: Any = _NO_FORCE, *, gravity: Any = None, q_springs0: Any = None
    ) -> CompiledEquilibrium:
        """Find the equilibrium under a force on the tip.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N]; quickest as an array of float64.
            force: Force on the tip, shape (3,) [N], world axes.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            q_springs0: Where to start, shape (n_springs,) [rad or m]; at rest by default.

        Returns:
            The equilibrium, certified stable.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or no shape of the robot has such muscle lengths.
            EquilibriumNotFound: If no stable equilibrium is found; carries the best point.
        """
        if (
            self._plain
            and gravity is None
            and q_springs0 is None
            and type(q_motors) is np.ndarray
            and type(force) is np.ndarray
            and q_motors.dtype is _DOUBLE
            and force.dtype is _DOUBLE
            and q_motors.shape == self._shape
            and force.shape == _THREE
        ):
            w = np.zeros(self._size)
            w[: self._motors] = q_motors
            w[self._motors : self._motors + 3] = force
            if self._settle(w) == 0:
                return CompiledEquilibrium(w, self._layout, self._actuation)
        return self._checked_equilibrium(q_motors, force, gravity, q_springs0)

    def _checked_equilibrium(self, q_motors: Any, force: Any, gravity: Any, q_springs0: Any) -> CompiledEquilibrium:
        run = self._run(gravity is not None)
        motors = self._actuation.checked(q_motors)
        w = run.workspace()
        run.put(w, run.layout.force, finite_array("force", force, (3,), "N"))
        run.put(w, run.layout.gravity, gravity_vector(gravity))
        self._actuation.put(run, w, motors)
        if q_springs0 is None:
            status = run.settle(w)
        else:
            springs = finite_array("q_springs0", q_springs0, (self._model.n_springs,), "rad")
            run.put(w, run.layout.unknown, self._actuation.unknowns(motors, springs))
            status = run.settle_from(w)
        found = CompiledEquilibrium(w, run.layout, self._actuation, motors)
        if status != Status.CERTIFIED:
            raise EquilibriumNotFound(
                f"no certified equilibrium at motors {motors.tolist()} under {found.force.tolist()} N: "
                f"{Status(status).explanation}; {found.residual:.3g} N m are out of balance",
                best=found,
                residual=found.residual,
                iterations=int(w[run.layout.single("iterations")]),
            )
        return found

    def equilibria(self, q_motors: Any, forces: Any, *, gravity: Any = None, threads: int = 1) -> EquilibriumBatch:
        """Find the equilibria of many cases, each from rest.

        Args:
            q_motors: Actuator coordinates, shape (n, n_motors), or (n_motors,) for all cases [rad, m or N].
            forces: Force on the tip, shape (n, 3), or (3,) for all cases [N], world axes.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            threads: Threads to use; more than one help numba only.

        Returns:
            One row a case. A case that fails says so in its status and touches no other.

        Raises:
            ParameterError: If a shape differs, gravity is not finite, or the number of threads is not positive.
        """
        run = self._run(gravity is not None)
        motors, loads = batch_rows(q_motors=(q_motors, self._model.n_motors), forces=(forces, 3))
        down = gravity_vector(gravity)
        bad = unusable(motors, loads) | self._actuation.unsuited(motors)
        motors, loads = without(motors, bad, self._model.relaxed_motors), without(loads, bad)
        layout = run.layout
        inputs = [(layout.force, loads), (layout.gravity, down[None]), *self._actuation.rows(motors, layout)]
        results = [(layout.unknown, layout.unknowns), (layout.tip, 3), (layout.single("error"), 1)]
        (found, tips, squares), statuses = solve_batch(run.settle_batch, inputs, results, len(motors), threads)
        residuals = root(squares)
        fail(statuses, bad, [residuals], [found, tips])
        return EquilibriumBatch(
            read_only(self._actuation.elastic(found)), statuses_of(statuses), read_only(residuals), read_only(tips)
        )

    def estimate_load(self, q_motors: Any, motor_torques: Any, *, gravity: Any = None) -> CompiledLoadEstimate:
        """Find the force on the tip from the motor torques.

        Near poses in which the motors hardly feel one direction of the force, several forces can explain the same torques, and
        this finds another one than `softrobots.estimate_load` in a few cases of a thousand; see `observability` of the answer.

        Args:
            q_motors: Motor coordinates, shape (n_motors,) [rad or m].
            motor_torques: Load on each motor, shape (n_motors,) [N m or N], with the sign of `Equilibrium.motor_torques`.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

        Returns:
            The force, and the robot in equilibrium under it.

        Raises:
            ParameterError: If a shape differs, a number is not finite, the robot has no actuators or muscles of given
                tension, or no shape of it has such muscle lengths.
            LoadNotFound: If no force is found that explains the torques, or the motors do not feel every direction of it.
        """
        if (
            self._feels
            and gravity is None
            and type(q_motors) is np.ndarray
            and type(motor_torques) is np.ndarray
            and q_motors.dtype is _DOUBLE
            and motor_torques.dtype is _DOUBLE
            and q_motors.shape == self._shape
            and motor_torques.shape == self._shape
        ):
            w = np.zeros(self._size)
            w[: self._motors] = q_motors
            w[self._torques : self._torques + self._motors] = motor_torques
            if self._estimate(w) == 0:
                return CompiledLoadEstimate(w, self._layout, self._actuation)
        return self._checked_estimate(q_motors, motor_torques, gravity)

    def _checked_estimate(self, q_motors: Any, motor_torques: Any, gravity: Any) -> CompiledLoadEstimate:
        check_feels(self._model)
        run = self._run(gravity is not None)
        motors = self._actuation.checked(q_motors)
        torques = finite_array("motor_torques", motor_torques, self._shape, "N m")
        status, w = self._search(run).estimate(motors, torques, gravity_vector(gravity))
        found = CompiledLoadEstimate(w, run.layout, self._actuation, motors)
        if status != Status.CERTIFIED:
            raise LoadNotFound(
                f"no unique force explains the motor torques {torques.tolist()} N m: {Status(status).explanation}; "
                f"{found.unexplained:.3g} N m remain (softrobots.estimate_load tells which directions are not felt)",
                best=found,
                residual=found.unexplained,
                iterations=int(w[run.layout.single("iterations")]),
            )
        return found

    def estimate_loads(self, q_motors: Any, motor_torques: Any, *, gravity: Any = None, threads: int = 1) -> LoadBatch:
        """Find the forces of many cases from their motor torques.

        Args:
            q_motors: Motor coordinates, shape (n, n_motors), or (n_motors,) for all cases [rad or m].
            motor_torques: Load on each motor, shape (n, n_motors) [N m or N].
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            threads: Threads to use; more than one help numba only.

        Returns:
            One row a case.

        Raises:
            ParameterError: If a shape differs, gravity is not finite, or the robot has no actuators or muscles of given
                tension.
        """
        check_feels(self._model)
        run = self._run(gravity is not None)
        motors, torques = batch_rows(q_motors=(q_motors, self._motors), motor_torques=(motor_torques, self._motors))
        down = gravity_vector(gravity)
        bad = unusable(motors, torques) | self._actuation.unsuited(motors)
        motors, torques = without(motors, bad, self._model.relaxed_motors), without(torques, bad)
        search = self._search(run)
        statuses, unknowns, forces, residuals, unexplained, observed = search.estimate_batch(motors, torques, down, threads)
        fail(statuses, bad, [residuals, unexplained], [unknowns, forces, observed])
        return LoadBatch(
            read_only(self._actuation.elastic(unknowns)),
            statuses_of(statuses),
            read_only(residuals),
            read_only(forces),
            read_only(unexplained),
            read_only(observed),
        )

    def inverse_kinematics(
        self,
        targets: Any,
        forces: Any = _NO_FORCE,
        *,
        q_motors0: Any = None,
        q_springs0: Any = None,
        gravity: Any = None,
        tolerance: float = POSITION_TOLERANCE,
        threads: int = 1,
    ) -> MotorBatch:
        """Find motors that put the loaded tip at targets, each case from its own start.

        A search from one start finds a solution near it, or none; `softrobots.solve_ik` looks everywhere.

        Args:
            targets: Targets of the tip, shape (n, 3) [m], world axes.
            forces: Force on the tip, shape (n, 3), or (3,) for all cases [N], world axes.
            q_motors0: Motors to start from, shape (n, n_motors), or (n_motors,) for all [rad or m]; at zero by default.
            q_springs0: Elastic coordinates to start from, shape (n, n_springs) [rad or m]; at rest by default.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            tolerance: Largest distance of the tip from its target [m].
            threads: Threads to use; more than one help numba only.

        Returns:
            One row a target.

        Raises:
            ParameterError: If a shape differs, gravity or tolerance is out of range, or the robot has no actuators.
        """
        relaxed = start_motors(self._model, None)
        run = self._run(gravity is not None)
        positive_number("tolerance", tolerance, "m")
        begin = relaxed if q_motors0 is None else q_motors0
        springs = self._model.rest if q_springs0 is None else q_springs0
        points, loads, motors, unknowns = batch_rows(
            targets=(targets, 3),
            forces=(forces, 3),
            q_motors0=(begin, self._motors),
            q_springs0=(springs, self._model.n_springs),
        )
        down = gravity_vector(gravity)
        bad = unusable(points, loads, motors, unknowns) | self._actuation.unsuited(motors)
        points, loads, motors = without(points, bad), without(loads, bad), without(motors, bad, relaxed)
        unknowns = self._actuation.of_elastic(motors, without(unknowns, bad))
        statuses, motors, unknowns, residuals, errors = self._search(run).reach_batch(
            points, loads, down, motors, unknowns, tolerance, threads
        )
        fail(statuses, bad, [residuals, errors], [unknowns, motors])
        return MotorBatch(
            read_only(self._actuation.elastic(unknowns)),
            statuses_of(statuses),
            read_only(residuals),
            read_only(motors),
            read_only(errors),
        )

    def follow(
        self,
        targets: Any,
        force: Any = _NO_FORCE,
        *,
        q_motors0: Any = None,
        gravity: Any = None,
        tolerance: float = POSITION_TOLERANCE,
    ) -> MotorBatch:
        """Move the loaded tip through targets, each step from the last; one row a waypoint.

        Args:
            targets: Target positions, shape (n, 3) [m], world axes.
            force: Force on the tip, shape (3,) [N], constant over the path, world axes.
            q_motors0: Motors near the first waypoint, shape (n_motors,) [rad or m]; by default those of `softrobots.solve_ik`,
                which takes some milliseconds.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            tolerance: Largest distance of the tip from a target [m].

        Returns:
            Motors, elastic coordinates and errors of the waypoints; see the status of each.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or the robot has no actuators.
            TargetUnreachable: If the first waypoint cannot be reached; from `solve_ik` if no start is given.
        """
        start_motors(self._model, None)
        run = self._run(gravity is not None)
        (points,) = batch_rows(targets=(targets, 3))
        if np.any(unusable(points)):
            raise ParameterError("targets", targets, "finite positions [m]")
        load = finite_array("force", force, (3,), "N")
        positive_number("tolerance", tolerance, "m")
        if len(points) == 0:
            raise ParameterError("targets", targets, "at least one target position [m]")
        if q_motors0 is None:
            motors = solve_ik(self._model, points[0], load, gravity=gravity, tolerance=tolerance).q_motors
        else:
            motors = self._actuation.checked(q_motors0, "q_motors0")
        batch, iterations = self._search(run).follow(points, load, gravity_vector(gravity), motors, tolerance)
        if batch.status[0] != Status.CERTIFIED:
            raise TargetUnreachable(
                f"waypoint 1 of {len(points)} is not reached from motors {motors.tolist()}: the tip comes within "
                f"{batch.tip_error[0]:.3g} m of it ({Status(batch.status[0]).name})",
                best=batch.q_motors[0],
                residual=float(batch.tip_error[0]),
                iterations=iterations,
            )
        return batch

    def _search(self, run: Any) -> UnrolledSearch | LoopedSearch:
        """Who does load estimation and inverse kinematics: generated code, or searches in Python on top of it."""
        kind = UnrolledSearch if self._unknowns.is_unrolled else LoopedSearch
        return kind(self._model, self._actuation, run)

    def _run(self, weight: bool) -> Any:
        run = self._runs.get(weight)
        if run is None:
            run = self._runs[weight] = make_run(make_program(self._unknowns, weight=weight), self._backend)
        return run
