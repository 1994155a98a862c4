"""Derivatives of the equilibria of a looped chain by compiled code, in both modes, for many cases.

Rates and weights of actuators along the body are those of what the code knows: of the sums that given lengths constrain, or of
the loads on the strains by tensions. See `softrobots.compiled.chain.looped_response`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.run.batches import solve_batch
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.settings import CHUNK
from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.actuator_derivatives import ActuatorStates
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.model_change import numbers_of
from softrobots.identification.residual_rates import ResidualRates


class ChainEquilibria(NamedTuple):
    """N equilibria of a chain."""

    motors: FloatArray
    """Actuators, shape (N, n_motors)."""
    force: FloatArray
    """Force on the tip, shape (N, 3) [N]."""
    elastic: FloatArray
    """Elastic coordinates, shape (N, n_springs) [rad or m]."""
    strains: FloatArray
    """Strains, shape (N, n_strains) [rad or m]."""
    gravity: FloatArray
    """Gravity, shape (3,) [m/s^2]."""


class _Response(NamedTuple):
    """Response of N cases to given rates."""

    strains: FloatArray
    """Rates of the strains, shape (N, n_strains); zero of locked ones."""
    tip: FloatArray
    """Rate of the tip, shape (N, 3)."""
    motors: FloatArray
    """Rates of the loads on motor joints, shape (N, n)."""
    sums: FloatArray
    """Rates of the loads on the sums that lengths constrain, shape (N, h)."""
    held: FloatArray
    """These loads themselves, beyond those of the start, shape (N, h)."""
    torques: FloatArray
    """The loads on motor joints themselves, shape (N, n)."""


class Pulled(NamedTuple):
    """Weights of the inputs of N cases."""

    motors: FloatArray
    """Weights of the actuators, shape (N, n_motors)."""
    force: FloatArray
    """Weights of the force, shape (N, 3)."""
    strains: FloatArray
    """Virtual rates of the strains, shape (N, n_strains); see `softrobots.identification.residual_derivatives`."""
    torques: FloatArray
    """Loads on the motor joints in balance, shape (N, n_joint_motors)."""
    tensions: FloatArray
    """Loads on the actuators along the body in balance, shape (N, n_muscles)."""


class ChainResponses:
    """Code of a looped chain that has derivatives."""

    def __init__(self, compiled: CompiledModel, *, weight: bool) -> None:
        """Generate and load the code."""
        self._model, self._unknowns, self._weight = compiled.model, compiled.unknowns, weight
        self._chain, self._strains = self._unknowns.chain, list(self._unknowns.strains)
        self._actuation, self._run = compiled.actuation, compiled.given_run(weight)
        self._slope = np.eye(self._unknowns.n_constraints) if self._unknowns.held_lengths else self._chain.constrained_slope

    def at(self, motors: FloatArray, force: FloatArray, elastic: FloatArray, gravity: FloatArray | None) -> ChainEquilibria:
        """Return the equilibria at actuators, under forces on the tip, with elastic coordinates, N rows each."""
        count = len(motors)
        if self._unknowns.held_lengths:
            held: Any = self._model.structure.muscle_lengths
            strains = held.strains_of_many(motors, elastic)
        else:
            strains = np.tile(self._chain.rest, (count, 1))
            strains[:, self._strains] = self._actuation.of_elastic(motors, elastic)
        return ChainEquilibria(motors, force, elastic, strains, np.zeros(3) if gravity is None else gravity)

    @property
    def holds(self) -> bool:
        """Whether lengths of actuators are given, whose tensions only the balance tells."""
        return self._unknowns.n_constraints > 0

    def states(self, at: ChainEquilibria, tensions: FloatArray) -> States:
        """Return the equilibria for the derivatives by parameters, with the tensions of actuators of given length."""
        loads = {self._model.tip: np.pad(at.force, ((0, 0), (0, 3)))}
        if self._weight:
            loads[""] = np.tile(at.gravity, (len(at.force), 1))
        torques, nothing = np.pad(tensions, ((0, 0), (self._chain.n_motors, 0))), np.zeros(0)
        return States(at.motors, at.elastic, loads, torques, nothing, nothing, at.strains)

    def pull(self, at: ChainEquilibria, springs: FloatArray, tips: FloatArray, threads: int) -> Pulled:
        """Return weights of the inputs from those of elastic coordinates, shape (N, n_springs), and tips, (N, 3)."""
        return self._pulled(at, self._respond(at, springs @ self._chain.elastic, tips, None, None, threads))

    def pull_loads(self, at: ChainEquilibria, weights: FloatArray, threads: int) -> Pulled:
        """Return weights of the inputs from those of the loads on the actuators, shape (N, n_motors)."""
        chain = self._chain
        joints, along = weights[:, : chain.n_motors], weights[:, chain.n_motors :]
        loads, sums, direct = np.zeros((1, len(chain.stiffness))), None, along
        if self.holds:
            sums, direct = along @ self._slope.T, np.zeros_like(along)
        elif len(chain.actuators):
            actuators = self._actuators(at)
            still = np.zeros((len(along), 1, len(chain.stiffness)))
            loads = actuators.slopes(np.zeros_like(along)[:, None], along[:, None], still)[0][:, 0]
            direct = along * actuators.by_input
        pulled = self._pulled(at, self._respond(at, loads, np.zeros((1, 3)), joints, sums, threads))
        return pulled._replace(motors=pulled.motors + np.pad(direct, ((0, 0), (chain.n_motors, 0))))

    def feel(self, at: ChainEquilibria, threads: int) -> tuple[FloatArray, FloatArray]:
        """Return the loads on the actuators, shape (N, n_motors), and their derivatives by the force, (N, n_motors, 3)."""
        chain, columns = self._chain, []
        for direction in np.eye(3):
            found = self._respond(at, np.zeros((1, len(chain.stiffness))), direction[None], None, None, threads)
            pulled = self._pulled(at, found)
            if len(chain.actuators) and not self.holds:  # a tension by law is not conjugate to its input
                actuators = self._actuators(at)
                along = actuators.arms(found.strains[:, None])[:, 0] * actuators.by_length
                pulled.motors[:, chain.n_motors :] = along
            columns.append(pulled.motors)
        return np.concatenate([pulled.torques, pulled.tensions], axis=1), np.stack(columns, axis=2)

    def _pulled(self, at: ChainEquilibria, found: _Response) -> Pulled:
        along = tensions = np.zeros((len(at.motors), 0))
        if self.holds:
            along, tensions = found.sums @ self._slope, self._actuation.held(at.motors, found.held)
        elif len(self._chain.actuators):
            actuators = self._actuators(at)
            along, tensions = -actuators.arms(found.strains[:, None])[:, 0] * actuators.by_input, actuators.pulls
        motors = np.concatenate([found.motors, along], axis=1)
        return Pulled(motors, found.tip, found.strains, found.torques, tensions)

    def push(
        self,
        at: ChainEquilibria,
        motors: FloatArray,
        force: FloatArray,
        threads: int,
        moved: ResidualRates | None = None,
    ) -> list[FloatArray]:
        """Return rates of elastic coordinates and tips.

        Args:
            at: The equilibria.
            motors: Rates of the actuators, shape (N, n_motors).
            force: Rates of the force, shape (N, 3).
            threads: Number of threads.
            moved: What parameters change at fixed strains.
        """
        joints, along = motors[:, : self._chain.n_motors], motors[:, self._chain.n_motors :]
        loads, sums = np.zeros((1, len(self._chain.stiffness))), None
        if self.holds:
            sums = (along if moved is None else along - moved.lengths) @ self._slope.T
        elif len(self._chain.actuators):
            actuators = self._actuators(at)
            tensions, still = (along * actuators.by_input)[:, None], np.zeros((len(at.motors), 1, len(self._chain.stiffness)))
            loads = -actuators.slopes(tensions, np.zeros_like(tensions), still)[0][:, 0]
        found = self._respond(at, loads if moved is None else loads + moved.strains, force, joints, sums, threads)
        return [found.strains @ self._chain.elastic.T, found.tip if moved is None else found.tip + moved.point]

    def _actuators(self, at: ChainEquilibria) -> ActuatorStates:
        """Return the actuators along the body, without their tensions, which derivatives by their inputs do not need."""
        inputs = at.motors[:, self._chain.n_motors :]
        return ActuatorStates(self._model, numbers_of(self._model), at.strains, inputs, np.zeros_like(inputs))

    def _respond(
        self,
        at: ChainEquilibria,
        loads: FloatArray,
        force: FloatArray,
        joints: FloatArray | None,
        sums: FloatArray | None,
        threads: int,
    ) -> _Response:
        """Run the code; rates that are None are zero, as in a new workspace."""
        layout, tip, count = self._run.layout, self._run.program.tip, len(at.motors)
        inputs = [*self._actuation.rows(at.motors, layout), (layout.force, at.force), (layout.gravity, at.gravity[None])]
        inputs += [(layout.unknown, at.strains[:, self._strains]), (tip.loads, loads[:, self._strains]), (tip.force, force)]
        inputs += [(place, rates) for place, rates in ((tip.motions, joints), (tip.sums, sums)) if rates is not None]
        results = [(tip.tip_columns, tip.unknowns), (tip.moved, 3), (tip.jacobian, tip.motors)]
        results += [(place, tip.n_constraints) for place in (tip.constraint_columns, layout.held)]
        results.append((tip.motor_torques, tip.motors))
        nothing = np.zeros((count // CHUNK + 1, 0))
        found, _ = solve_batch(self._run.respond_batch, inputs, results, count, threads, nothing)
        strains = np.zeros((count, len(self._chain.stiffness)))
        strains[:, self._strains] = found[0]
        return _Response(strains, *found[1:])
