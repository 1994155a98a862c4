"""Compiled equilibria of a robot without Pinocchio in the loop."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.batches import batch_rows, fail, gravity_vector, root, solve_batch, unusable, without
from softrobots.compiled.run.compiled_code import CompiledCode, SharedCode
from softrobots.compiled.run.contact_batches import ContactSolver
from softrobots.compiled.run.friction_states import StatesBefore, states_before
from softrobots.compiled.run.results import CompiledEquilibrium, EquilibriumBatch
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.environment.environment import Environment
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel

NO_FORCE = read_only(np.zeros(3))
"""No force on the tip [N]."""
DOUBLE = np.dtype(np.float64)
"""Type of the numbers of generated code."""
_THREE = (3,)


def certified(equilibrium: CompiledEquilibrium) -> CompiledEquilibrium:
    """Return an equilibrium that is stable or neutral.

    Raises:
        EquilibriumNotFound: If its status says that it is not; carries it.
    """
    status = equilibrium.status
    if status in (Status.CERTIFIED, Status.NEUTRAL):
        return equilibrium
    raise EquilibriumNotFound(
        f"no certified equilibrium at motors {equilibrium.q_motors.tolist()} under {equilibrium.force.tolist()} N: "
        f"{status.explanation}; {equilibrium.residual:.3g} N m are out of balance",
        best=equilibrium,
        residual=equilibrium.residual,
        iterations=equilibrium.iterations,
    )


class CompiledStatics(CompiledCode):
    """Compiled equilibria of a robot, for single cases and for batches.

    See `softrobots.compiled.run.compiled_model.CompiledModel`, which adds load estimation and inverse kinematics.
    """

    def __init__(
        self, model: SoftModel, backend: str, locked_strains: tuple[str, ...], shared: SharedCode | None = None
    ) -> None:
        """Read the robot; its code is generated on first use. Call `softrobots.compile` instead."""
        super().__init__(model, backend, locked_strains, shared)
        self._actuation = Actuation(model, self._unknowns, None if shared is None else shared.numbers)
        self._shape = (model.n_motors,)
        self._motors = model.n_motors
        self._touching: ContactSolver | None = None  # the solver in contact, once it is made
        self._known_gravity: tuple[Any, FloatArray | None] = (None, None)
        # Float64 arrays of the right shape go straight into the generated code; everything else is checked first.
        self._rubs = bool(self._chain.friction) or self._chain.guides is not None
        self._plain = not (self._unknowns.n_constraints or self._rubs or self._inputs is not None) and backend == "numba"
        self._joints = self._chain.n_motors

    @property
    def actuation(self) -> Actuation:
        """Maps between actuator and elastic coordinates and the workspace of the code."""
        return self._actuation

    def equilibrium(
        self,
        q_motors: Any,
        force: Any = NO_FORCE,
        *,
        gravity: Any = None,
        q_springs0: Any = None,
        previous: Any = None,
        environment: Environment | None = None,
    ) -> CompiledEquilibrium:
        """Find the equilibrium under a force on the tip.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N]; fastest as an array of float64.
            force: Force on the tip, shape (3,) [N], world axes.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            q_springs0: Start of the search, shape (n_springs,) [rad or m]; by default `previous`, or at rest.
            previous: Where a robot with dry friction comes from: an equilibrium of this or the general solver. None: nothing
                has moved it yet.
            environment: Obstacles that the robot touches without friction, as in `equilibria`, from rest.

        Returns:
            The equilibrium (in contact a `ContactEquilibrium`), `stable` or neutral as by `solve_equilibrium`: see `status`.

        Raises:
            ParameterError: If a shape differs, a number is not finite, no shape has these muscle lengths, or as `equilibria`.
            EquilibriumNotFound: If no stable or neutral equilibrium is found; the error carries the best point.
        """
        if environment is not None:
            if q_springs0 is not None:
                raise ParameterError("q_springs0", q_springs0, "None in contact: the search starts from rest")
            solve = self._solver_in_contact().equilibrium
            return certified(solve(self._actuation, self._run(False), q_motors, force, gravity, environment))
        if (
            self._plain
            and q_springs0 is None
            and previous is None
            and type(q_motors) is np.ndarray
            and type(force) is np.ndarray
            and q_motors.dtype is DOUBLE
            and force.dtype is DOUBLE
            and q_motors.shape == self._shape
            and force.shape == _THREE
        ):
            joints, down = self._joints, None if gravity is None else self._plain_gravity(gravity)
            if gravity is None or down is not None:
                settle, _, size, layout = self._light if gravity is None else self._heavy
                w = np.zeros(size)
                if joints == self._motors:
                    w[:joints] = q_motors
                else:
                    w[:joints] = q_motors[:joints]
                    w[layout.actuators : layout.actuators + layout.muscles] = q_motors[joints:]
                w[joints : joints + 3] = force
                if down is not None:
                    w[joints + 3 : joints + 6] = down
                if settle(w) == 0:
                    return CompiledEquilibrium(w, layout, self._actuation)
        return self._checked_equilibrium(q_motors, force, gravity, q_springs0, previous)

    @cached_property
    def _light(self) -> Any:
        """What single equilibria take of the code without weight, which is made when it is first asked for."""
        return self._single(False)

    @cached_property
    def _heavy(self) -> Any:
        """The same of the code with weight."""
        return self._single(True)

    def _single(self, weight: bool) -> Any:
        run = self._run(weight)
        return run.settle, run.estimate, run.program.size, run.layout

    def _plain_gravity(self, gravity: Any) -> FloatArray | None:
        """Return gravity that needs no check but that of the generated code: an array, or the tuple of the last call."""
        known, vector = self._known_gravity
        if gravity is known:
            return vector
        if type(gravity) is np.ndarray and gravity.dtype is DOUBLE and gravity.shape == _THREE:
            return gravity
        if type(gravity) is tuple and all(type(one) is float for one in gravity):
            vector = gravity_vector(gravity)
            self._known_gravity = gravity, vector
            return vector
        return None

    def _checked_equilibrium(
        self, q_motors: Any, force: Any, gravity: Any, q_springs0: Any, previous: Any
    ) -> CompiledEquilibrium:
        run = self._run(gravity is not None)
        motors = self._actuation.checked(q_motors)
        load = finite_array("force", force, (3,), "N")
        w = self._actuation.workspace(run, motors, force=load, gravity=gravity_vector(gravity))
        springs = None if q_springs0 is None else finite_array("q_springs0", q_springs0, (self._model.n_springs,), "rad")
        before = self._before(previous, single=True)
        if before is not None:
            run.put(w, run.layout.sliders, before.sliders[0])
            run.put(w, run.layout.anchors, before.anchors[0])
            springs = before.springs[0] if springs is None else springs
        if springs is None:
            status = Status(run.settle(w))
        else:
            run.put(w, run.layout.unknown, self._actuation.unknowns(motors, springs))
            status = Status(run.settle_from(w))
        return certified(CompiledEquilibrium(w, run.layout, self._actuation, motors, status))

    def _before(self, previous: Any, *, single: bool = False) -> StatesBefore | None:
        """Return the states before a step, see `states_before`; None for a robot without dry friction."""
        if self._rubs:
            before = states_before(self._actuation, previous)
            if single and (len(before.springs) != 1 or before.lost[0]):
                raise ParameterError("previous", previous, "one equilibrium")
            return before
        if previous is not None:
            raise ParameterError("previous", previous, "None for a robot without dry friction, which remembers nothing")
        return None

    def _solver_in_contact(self) -> ContactSolver:
        check_frictionless(self._model, "compiled contact")
        self._touching = self._touching or ContactSolver(self._model, self._unknowns, self._backend)
        return self._touching

    def equilibria(
        self,
        q_motors: Any,
        forces: Any,
        *,
        gravity: Any = None,
        threads: int = 1,
        previous: Any = None,
        environment: Any = None,
    ) -> EquilibriumBatch:
        """Find the equilibria of many cases, each from rest or, with dry friction, from the state before.

        Args:
            q_motors: Actuator coordinates, shape (n, n_motors), or (n_motors,) for all cases [rad, m or N].
            forces: Force on the tip, shape (n, 3), or (3,) for all cases [N], world axes.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
            threads: Number of threads; more than one speeds up numba only.
            previous: Where robots with dry friction come from: the result of the last step of as many robots, a sequence of
                equilibria, or one for all, see `equilibrium`. A row whose state before is no equilibrium keeps its status.
            environment: Obstacles that the robot touches without friction, or a sequence of environments, one a case, as
                `[env.at(way) for way in ways]`. For robots of joints with linear springs, without meshes and self-contact.

        Returns:
            One row a case. The status tells which cases failed; a failed case does not affect others. With an environment it
            is a `ContactBatch`.

        Raises:
            ParameterError: If a shape differs, gravity is not finite, the number of threads is not positive, or robot or
                obstacles are not compiled.
            DescriptionError: If the robot has nothing to touch obstacles with.
        """
        run = self._run(gravity is not None)
        rows = self._model.actuators.in_order(q_motors, "q_motors")
        before = self._before(previous)
        counted = {} if before is None else before.rows
        motors, loads, *_ = batch_rows(q_motors=(rows, self._model.n_motors), forces=(forces, 3), **counted)
        down = gravity_vector(gravity)
        bad = unusable(motors, loads) | self._actuation.unsuited(motors)
        motors, loads = without(motors, bad, self._model.relaxed_motors), without(loads, bad)
        if environment is not None:
            wrenches = np.hstack([loads, np.tile(down, (len(loads), 1))])
            return self._solver_in_contact().settle(motors, wrenches, bad, environment, threads)
        layout = run.layout
        inputs = [(layout.force, loads), (layout.gravity, down[None]), *self._actuation.rows(motors, layout)]
        results = [(layout.unknown, layout.unknowns), (layout.tip, 3), (layout.single("error"), 1)]
        if before is not None:
            springs = np.broadcast_to(before.springs, (len(motors), self._model.n_springs))
            inputs += [(layout.sliders, before.sliders), (layout.unknown, self._actuation.of_elastic(motors, springs))]
            inputs.append((layout.anchors, before.anchors))
            results += [(layout.slid, layout.unknowns), (layout.anchored, layout.guides)]
        (unknowns, tips, squares, *slid), statuses = solve_batch(run.settle_batch, inputs, results, len(motors), threads)
        residuals = root(squares)
        fail(statuses, bad, [residuals], [unknowns, tips, *slid])
        springs = self._actuation.elastic(unknowns)
        if before is None:
            return EquilibriumBatch(springs, statuses, residuals, tips)
        statuses = np.where(before.lost, before.status, statuses).astype(np.uint8)
        remembered = {"friction_bending": self._actuation.bending(slid[0]), "friction_slip": slid[1]}
        return EquilibriumBatch(springs, statuses, residuals, tips, **remembered)
