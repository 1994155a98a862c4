"""Equilibria of a robot and the derivatives of what depends on them, on Pinocchio and by compiled code."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.model_change import ModelChange
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.identification.residual_rates import residual_rates
from softrobots.learning.chain_responses import ChainResponses, Pulled
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.loads import Load

_JUMPS = 1e4  # change of a coefficient of `E` over the relative change of a parameter, above which it jumps


class Slopes(NamedTuple):
    """Derivatives of L outputs of N equilibria, shapes (N, L, ...)."""

    by_motors: FloatArray
    by_force: FloatArray
    by_parameters: FloatArray


class ChangingRobot(NamedTuple):
    """A robot and how its numbers change with parameters."""

    model: SoftModel
    """The robot at values of the parameters."""
    change: ModelChange
    """The change."""
    values: Mapping[str, float]
    """Values of the parameters by name."""
    gravity: FloatArray | None
    """Gravity, shape (3,) [m/s^2]; None: weightless."""

    def coordinate_slopes(self) -> FloatArray | None:
        """Return the change of the elastic coordinates, shape (n_springs, n_strains, P), by parameters; None if there is none.

        Raises:
            ParameterError: If they jump with a parameter, as those of given lengths with equal sections may.
        """
        slopes = self.change.by_number.get("held_elastic")
        if slopes is None:
            return None
        for (name, value), slope in zip(self.values.items(), np.abs(slopes).max(axis=0), strict=True):
            if slope * abs(value) > _JUMPS:
                requirement = "a value about which the elastic coordinates do not jump, or gradients of the tip alone"
                raise ParameterError(name, value, requirement)
        return slopes.reshape(self.model.n_springs, -1, len(self.values))


class EquilibriumPoints(ABC):
    """N equilibria of a robot under a force on its tip."""

    def __init__(self, robot: ChangingRobot, motors: FloatArray, force: FloatArray, springs: FloatArray) -> None:
        """Take the robot, actuators, shape (N, n_motors), force, (N, 3) [N], and elastic coordinates, (N, n_springs)."""
        self.robot, self.motors, self.force, self.springs = robot, motors, force, springs

    @abstractmethod
    def near(self, force: FloatArray, springs: FloatArray) -> EquilibriumPoints:
        """Return the equilibria under other forces."""

    @abstractmethod
    def feel(self) -> tuple[FloatArray, FloatArray]:
        """Return the loads on the actuators, shape (N, n_motors), and their derivatives by the force, (N, n_motors, 3)."""

    @abstractmethod
    def results(self, springs: FloatArray, tips: FloatArray) -> Slopes:
        """Differentiate weighted elastic coordinates and tips, shapes (N, n_springs) and (N, 3); L is 1."""

    @abstractmethod
    def loads(self, weights: FloatArray, *, parameters: bool = True) -> Slopes:
        """Differentiate weighted loads on the actuators, shape (N, L, n_motors); by the parameters if that is asked for."""

    @abstractmethod
    def rates(self, motors: FloatArray, force: FloatArray, parameters: FloatArray) -> list[FloatArray]:
        """Return the rates of elastic coordinates and tips from those of actuators, force and parameters, (1, ...) for all."""

    def _weighted(self, springs: FloatArray, tips: FloatArray) -> Outputs:
        """Weighted elastic coordinates and tips as outputs."""
        model = self.robot.model
        held = model.structure.muscle_lengths
        weights: FloatArray = springs if held is None else np.asarray(springs @ held.elastic)
        pose = np.concatenate([tips, np.zeros_like(tips)], axis=-1)
        return Outputs(frame=model.tip, pose=pose[:, None], strains=weights[:, None])

    def _by_coordinates(self, springs: FloatArray, strains: FloatArray) -> FloatArray | float:
        """Derivatives of weighted elastic coordinates by the parameters through what they mean, shape (N, 1, P)."""
        slopes = self.robot.coordinate_slopes() if np.any(springs) else None
        return 0.0 if slopes is None else np.einsum("ni,ijp,nj->np", springs, slopes, strains, optimize=True)[:, None]

    def _moved_coordinates(self, strains: FloatArray, parameters: FloatArray) -> FloatArray | float:
        """Rates of the elastic coordinates at strains, shape (N, n_springs), through what they mean."""
        slopes = self.robot.coordinate_slopes() if np.any(parameters) else None
        return 0.0 if slopes is None else _times(np.einsum("ijp,np->nij", slopes, parameters), strains)


class PinocchioPoints(EquilibriumPoints):
    """Equilibria with the closed forms of `softrobots.identification.residual_derivatives`."""

    def near(self, force: FloatArray, springs: FloatArray) -> PinocchioPoints:
        """Return the equilibria under other forces."""
        return PinocchioPoints(self.robot, self.motors, force, springs)

    @cached_property
    def _at(self) -> EquilibriumDerivatives:
        model, gravity, count = self.robot.model, self.robot.gravity, len(self.motors)
        wrenches, down = np.pad(self.force, ((0, 0), (0, 3))), None if gravity is None else tuple(gravity.tolist())
        states = [
            elastic_state(model, motors, springs, Load({model.tip: wrench}, down))
            for motors, wrench, springs in zip(self.motors, wrenches, self.springs, strict=True)
        ]
        loads = {model.tip: wrenches} | ({} if gravity is None else {"": np.tile(gravity, (count, 1))})
        of_actuators, coupling = (np.array([getattr(one.load, name) for one in states]) for name in ("motors", "coupling"))
        tangent = np.array([one.tangent for one in states])
        return EquilibriumDerivatives(model, States(self.motors, self.springs, loads, of_actuators, tangent, coupling))

    def feel(self) -> tuple[FloatArray, FloatArray]:
        """Return the loads on the actuators, and their derivatives by the force."""
        each = np.tile(np.eye(self.motors.shape[1]), (len(self.motors), 1, 1))
        return self._at.states.actuator_loads, self._slopes(Outputs(loads=each), parameters=False).by_force

    def results(self, springs: FloatArray, tips: FloatArray) -> Slopes:
        """Differentiate weighted elastic coordinates and tips."""
        found = self._slopes(self._weighted(springs, tips))
        return found._replace(by_parameters=found.by_parameters + self._by_coordinates(springs, self._at.strains))

    def loads(self, weights: FloatArray, *, parameters: bool = True) -> Slopes:
        """Differentiate weighted loads on the actuators."""
        return self._slopes(Outputs(loads=weights), parameters=parameters)

    def _slopes(self, outputs: Outputs, *, parameters: bool = True) -> Slopes:
        rows, model = AdjointRows(self._at, outputs), self.robot.model
        by_parameters = np.zeros((*rows.virtual.shape[:2], self.robot.change.n_parameters))
        if parameters:
            by_parameters = rows.by_numbers(self.robot.change)
        return Slopes(rows.by_actuators, rows.by_loads()[model.tip][..., :3], by_parameters)

    def rates(self, motors: FloatArray, force: FloatArray, parameters: FloatArray) -> list[FloatArray]:
        """Return the rates of elastic coordinates and tips."""
        at, tree, model = self._at, self._at.tree, self.robot.model
        moved = residual_rates(at, self.robot.change, parameters, model.tip)
        strains = moved.strains + at.on_strains(tree.load_rates({model.tip: force}, None, None)[:, None])[1][:, 0]
        inputs = np.array(np.broadcast_to(motors, self.motors.shape))
        if at.slopes is None:
            springs = strains = _times(at.compliance, strains + _times(at.states.coupling, inputs))
        else:
            by_lengths, by_free = at.slopes
            inputs[:, at.n_joint_motors :] -= moved.lengths
            free = _times(np.swapaxes(by_free, 1, 2), strains) + _times(at.states.coupling, inputs)
            strains = _times(by_lengths, inputs[:, at.n_joint_motors :]) + _times(by_free, _times(at.compliance, free))
            held: Any = model.structure.muscle_lengths
            springs = strains @ held.elastic.T + self._moved_coordinates(at.strains, parameters)
        twists = tree.motion(at.joint_rates(inputs[:, None, : at.n_joint_motors], strains[:, None])[:, 0], None)
        return [springs, tree.point_speed(model.tip, twists, None) + moved.point]


class ChainPoints(EquilibriumPoints):
    """Equilibria of a looped chain: compiled code, and closed forms by parameters at the virtual motion that it finds."""

    def __init__(self, chain: ChainResponses, threads: int, *given: Any) -> None:
        """Take the code, the number of threads, and what `EquilibriumPoints` does."""
        super().__init__(*given)
        self._chain, self._threads = chain, threads
        self._solved = chain.at(self.motors, self.force, self.springs, self.robot.gravity)

    def near(self, force: FloatArray, springs: FloatArray) -> ChainPoints:
        """Return the equilibria under other forces."""
        return ChainPoints(self._chain, self._threads, self.robot, self.motors, force, springs)

    @cached_property
    def _tensions(self) -> FloatArray:
        """Tensions of actuators of given length in balance, shape (N, n_muscles); of laws the closed forms know them."""
        if not self._chain.holds:
            return np.zeros((len(self.motors), len(self.robot.model.muscles)))
        nothing = np.zeros((1, len(self.robot.model.springs.names)))
        return self._chain.pull(self._solved, nothing, np.zeros((1, 3)), self._threads).tensions

    @cached_property
    def _at(self) -> EquilibriumDerivatives:
        return EquilibriumDerivatives(self.robot.model, self._chain.states(self._solved, self._tensions))

    def feel(self) -> tuple[FloatArray, FloatArray]:
        """Return the loads on the actuators, and their derivatives by the force."""
        return self._chain.feel(self._solved, self._threads)

    def results(self, springs: FloatArray, tips: FloatArray) -> Slopes:
        """Differentiate weighted elastic coordinates and tips."""
        pulled = self._chain.pull(self._solved, springs, tips, self._threads)
        vars(self).setdefault("_tensions", pulled.tensions)
        found = self._slopes([pulled], self._weighted(springs, tips))
        return found._replace(by_parameters=found.by_parameters + self._by_coordinates(springs, self._solved.strains))

    def loads(self, weights: FloatArray, *, parameters: bool = True) -> Slopes:
        """Differentiate weighted loads on the actuators."""
        pulled = [self._chain.pull_loads(self._solved, one, self._threads) for one in np.swapaxes(weights, 0, 1)]
        vars(self).setdefault("_tensions", pulled[0].tensions)
        return self._slopes(pulled, Outputs(loads=weights), parameters=parameters)

    def _slopes(self, pulled: Sequence[Pulled], outputs: Outputs, *, parameters: bool = True) -> Slopes:
        motors, force, strains = (
            np.stack([getattr(one, name) for one in pulled], axis=1) for name in ("motors", "force", "strains")
        )
        change = self.robot.change
        by_parameters = np.zeros((len(motors), motors.shape[1], change.n_parameters))
        if parameters and change.by_number:
            by_parameters = AdjointRows(self._at, outputs, (motors, strains)).by_numbers(change)
        return Slopes(motors, force, by_parameters)

    def rates(self, motors: FloatArray, force: FloatArray, parameters: FloatArray) -> list[FloatArray]:
        """Return the rates of elastic coordinates and tips."""
        moved = None
        if np.any(parameters) and self.robot.change.by_number:
            moved = residual_rates(self._at, self.robot.change, parameters, self.robot.model.tip)
        motors = np.broadcast_to(motors, self.motors.shape)
        springs, tips = self._chain.push(self._solved, motors, force, self._threads, moved)
        return [springs + self._moved_coordinates(self._solved.strains, parameters), tips]


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Products of matrices and vectors, one a row."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
