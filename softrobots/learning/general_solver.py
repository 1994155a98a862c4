r"""Equilibria and load estimates of every robot without dry friction, with the derivatives of those of `sensitivity`.

The counterpart of `number_changes` and compiled code, with the same calls: each row is found as by `solve_equilibrium` or
`estimate_load`, from rest; equilibria of the robot that code was compiled of by its batch solver. Derivatives are the closed
forms of `softrobots.identification.residual_derivatives` for many rows at once: in reverse one adjoint row a case, whatever the
number of parameters; forwards one for each component of the results.
The numbers of the robot are here its parameters themselves.

A load estimate holds three felt loads `tau` at what was measured by the force `f`:

.. math:: df = \Bigl(\frac{d\tau}{df}\Bigr)^{-1} \Bigl(d\tau - \frac{d\tau}{dq_m} dq_m - \frac{d\tau}{dp} dp\Bigr)

Given lengths leave combinations `y = E z` of the strains `z` free; `E` changes with the parameters, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.responses import Cases
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.model_change import ModelChange, model_change
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.identification.residual_rates import ResidualRates, residual_rates
from softrobots.learning.chain_responses import ChainResponses
from softrobots.learning.row_solver import RowSolver
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import elastic_state

_SIZE = 1 << 20  # numbers of the twists of a chunk of cases
_JUMPS = 1e4  # change of a coefficient of `E` over the relative change of a parameter, above which it jumps


class GeneralSolver:
    """A robot by values of its parameters; see `number_changes.NumberChanges`."""

    def __init__(self, parameters: ParameterSet, *, weight: bool, compiled: CompiledModel | None = None) -> None:
        """Take the parameters, and compiled solvers for the equilibria of the robot as it is."""
        self._parameters, self._weight, self._compiled = parameters, weight, compiled
        self._at, self._change = lru_cache(maxsize=16)(self._model), lru_cache(maxsize=4)(self._model_change)

    def code(self, values: tuple[float, ...], *, slopes: bool = False) -> tuple[GeneralResponses, FloatArray, FloatArray]:
        """Return the solver at values of the parameters, these as its numbers, shape (1, P), and their derivatives.

        Raises:
            ParameterError: If the robot refuses the values, or has other joints or actuators with them.
            DescriptionError: If the robot cannot be described with them.
        """
        size = len(values)
        change = self._change(values) if slopes else ModelChange(size, {})
        sizes = dict(zip(self._parameters.names, values, strict=True))
        model, compiled = self._at(values), self._compiled
        same = compiled is not None and compiled.model == model
        responses = GeneralResponses(
            model, change, sizes, self._weight, compiled if same else None, self._chain_responses if same else None
        )
        return responses, np.array(values).reshape(1, size), np.eye(size) if slopes else np.zeros((size, 0))

    @cached_property
    def _chain_responses(self) -> ChainResponses | None:
        """The compiled derivatives of the robot as it is; None of chains that are not looped."""
        compiled = self._compiled
        if compiled is None or compiled.unknowns.is_unrolled:
            return None
        return ChainResponses(compiled, weight=self._weight)

    def _model(self, values: tuple[float, ...]) -> SoftModel:
        present = self._parameters.present
        model = self._parameters.model(values) if np.any(self._parameters.of_model) else present
        if (model.springs.names, model.n_motors) != (present.springs.names, present.n_motors):
            raise ParameterError("parameters", values, "values with which the robot has the same joints and actuators")
        return model

    def _model_change(self, values: tuple[float, ...]) -> ModelChange:
        return model_change(self._parameters, values)


class _Slopes(NamedTuple):
    """Derivatives of outputs, shapes (N, L, ...)."""

    by_motors: FloatArray
    by_force: FloatArray
    by_parameters: FloatArray


class GeneralResponses(RowSolver):
    """Solvers of a robot at values of its parameters; see `softrobots.compiled.run.responses.Responses`."""

    def __init__(
        self,
        model: SoftModel,
        change: ModelChange,
        values: Mapping[str, float],
        weight: bool,
        compiled: CompiledModel | None,
        chain: ChainResponses | None,
    ) -> None:
        super().__init__(model, weight, compiled)
        self._change, self._values, self._chain = change, values, chain

    def pull(
        self,
        kind: str,
        cases: Cases,
        gravity: FloatArray,
        numbers: FloatArray,
        weights: Sequence[FloatArray],
        threads: int,
        count: int,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return weights of motors and load, and of the parameters, summed; see `Responses.pull`."""
        model = self._model
        motors, load = np.zeros((count, model.n_motors)), np.zeros((count, 3 if kind == "equilibrium" else model.n_motors))
        sums = np.zeros(self._change.n_parameters)
        weights = [np.broadcast_to(one, (count, one.shape[1])) for one in weights]
        if kind == "equilibrium" and self._chain is not None:
            return self._pull_compiled(self._chain, cases, gravity, weights, threads)
        for rows, at in self._chunks(cases, gravity, count, 1):
            springs, tips, *forces = (one[rows, None] for one in weights)
            found = self._of_results(at, springs, tips)
            if forces:
                felt = self._felt(at)
                explained = np.linalg.solve(
                    np.swapaxes(felt.by_force, 1, 2), np.swapaxes(found.by_force + forces[0], 1, 2)
                ).swapaxes(1, 2)
                found = _Slopes(*(one - explained @ other for one, other in zip(found, felt, strict=True)))
                load[rows, model.actuators.feels] = explained[:, 0]
            else:
                load[rows] = found.by_force[:, 0]
            motors[rows] = found.by_motors[:, 0]
            sums += found.by_parameters.sum(axis=(0, 1))
        return motors, load, sums

    def _pull_compiled(
        self, chain: ChainResponses, cases: Cases, gravity: FloatArray, weights: Sequence[FloatArray], threads: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pull by compiled code, and the parameters by the virtual motion that it finds."""
        solved = chain.at(cases, gravity, len(weights[0]))
        pulled = chain.pull(solved, weights[0], weights[1], threads)
        sums = np.zeros(self._change.n_parameters)
        for rows in self._parts(len(weights[0]), 1) if self._change.by_number else ():
            known = pulled.motors[rows, None], pulled.strains[rows, None]
            at = EquilibriumDerivatives(self._model, chain.states(solved, pulled.tensions, rows))
            springs = weights[0][rows, None]
            adjoint = AdjointRows(at, self._results(springs, weights[1][rows, None]), known)
            sums += (adjoint.by_numbers(self._change) + self._by_coordinates(at, springs)).sum(axis=(0, 1))
        return pulled.motors, pulled.force, sums

    def push(
        self,
        kind: str,
        cases: Cases,
        gravity: FloatArray,
        numbers: FloatArray,
        rates: Sequence[FloatArray],
        threads: int,
        count: int,
    ) -> list[FloatArray]:
        """Return rates of the results from those of motors, load and parameters; see `Responses.push`."""
        if kind == "equilibrium" and self._chain is not None:
            return self._push_compiled(self._chain, cases, gravity, rates, threads, count)
        moved: list[list[FloatArray]] = []
        for rows, at in self._chunks(cases, gravity, count, 1):
            motors, load, parameters = (one if len(one) == 1 else one[rows] for one in rates)
            if kind == "estimate":
                felt = self._felt(at)
                known = (felt.by_motors @ motors[..., None] + felt.by_parameters @ parameters[..., None])[..., 0]
                load = np.linalg.solve(felt.by_force, (load[:, self._model.actuators.feels] - known)[..., None])[..., 0]
            found = self._equilibrium_rates(at, motors, load, parameters)
            moved.append([*found, load] if kind == "estimate" else found)
        return [np.concatenate(parts) for parts in zip(*moved, strict=True)]

    def _push_compiled(
        self, chain: ChainResponses, cases: Cases, gravity: FloatArray, rates: Sequence[FloatArray], threads: int, count: int
    ) -> list[FloatArray]:
        """Push by compiled code, with what the parameters change at fixed strains as its right-hand side."""
        solved = chain.at(cases, gravity, count)
        of_motors, of_force = (np.broadcast_to(one, (count, one.shape[1])) for one in rates[:2])
        if not (np.any(rates[2]) and self._change.by_number):
            return chain.push(solved, of_motors, of_force, threads)
        held, parts = chain.tensions(solved, threads), []
        for rows in self._parts(count, 1):
            at = EquilibriumDerivatives(self._model, chain.states(solved, held, rows))
            of_parameters = rates[2] if len(rates[2]) == 1 else rates[2][rows]
            parts.append(residual_rates(at, self._change, of_parameters, self._model.tip))
        moved = ResidualRates(*(np.concatenate(part) for part in zip(*parts, strict=True)))
        springs, tips = chain.push(solved, of_motors, of_force, threads, moved)
        return [springs + self._moved_coordinates(solved.strains, rates[2]), tips]

    def _equilibrium_rates(
        self, at: EquilibriumDerivatives, motors: FloatArray, force: FloatArray, parameters: FloatArray
    ) -> list[FloatArray]:
        """Rates of elastic coordinates and tip, one row a case or one for all."""
        model, tree = self._model, at.tree
        moved = residual_rates(at, self._change, parameters, model.tip)
        loads = tree.load_rates({model.tip: force}, None, None)[:, None]
        strains = moved.strains + at.on_strains(loads)[1][:, 0]
        inputs = np.tile(motors, (len(strains) // len(motors), 1))
        if at.slopes is None:
            springs = strains = _times(at.compliance, strains + _times(at.states.coupling, inputs))
        else:
            by_lengths, by_free = at.slopes
            inputs[:, at.n_joint_motors :] -= moved.lengths
            free = _times(np.swapaxes(by_free, 1, 2), strains) + _times(at.states.coupling, inputs)
            strains = _times(by_lengths, inputs[:, at.n_joint_motors :]) + _times(by_free, _times(at.compliance, free))
            springs = strains @ self._model.structure.muscle_lengths.elastic.T + self._moved_coordinates(at.strains, parameters)
        twists = tree.motion(at.joint_rates(inputs[:, None, : at.n_joint_motors], strains[:, None])[:, 0], None)
        return [springs, tree.point_speed(model.tip, twists, None) + moved.point]

    def _moved_coordinates(self, strains: FloatArray, parameters: FloatArray) -> FloatArray | float:
        """Rates of the elastic coordinates at strains, shape (N, n_springs), through what they mean."""
        if "held_elastic" not in self._change.by_number:
            return 0.0
        self._check_coordinates()
        slopes = parameters @ self._change.by_number["held_elastic"].T
        return _times(slopes.reshape(len(parameters), -1, strains.shape[1]), strains)

    def _of_results(self, at: EquilibriumDerivatives, springs: FloatArray, tips: FloatArray) -> _Slopes:
        """Derivatives of weighted elastic coordinates and tips, shapes (N, L, ...)."""
        found = self._slopes(at, self._results(springs, tips))
        return found._replace(by_parameters=found.by_parameters + self._by_coordinates(at, springs))

    def _results(self, springs: FloatArray, tips: FloatArray) -> Outputs:
        """Weighted elastic coordinates and tips as outputs."""
        held = self._model.structure.muscle_lengths
        weights: FloatArray = springs if held is None else np.asarray(springs @ held.elastic)
        return Outputs(frame=self._model.tip, pose=np.concatenate([tips, np.zeros_like(tips)], axis=-1), strains=weights)

    def _by_coordinates(self, at: EquilibriumDerivatives, springs: FloatArray) -> FloatArray | float:
        """Derivatives of weighted elastic coordinates through what they mean, shape (N, L, P)."""
        if self._model.structure.muscle_lengths is None or not np.any(springs):
            return 0.0
        self._check_coordinates()
        return self._change.along("held_elastic", springs[..., None] * at.strains[:, None, None])

    def _check_coordinates(self) -> None:
        """Refuse parameters with which the elastic coordinates of given lengths jump, as those of equal sections may."""
        slopes = self._change.by_number.get("held_elastic", np.zeros((1, len(self._values))))
        for (name, value), slope in zip(self._values.items(), np.abs(slopes).max(axis=0), strict=True):
            if slope * abs(value) > _JUMPS:
                requirement = "a value about which the elastic coordinates do not jump, or gradients of the tip alone"
                raise ParameterError(name, value, requirement)

    def _felt(self, at: EquilibriumDerivatives) -> _Slopes:
        """Derivatives of the loads that actuators feel."""
        weights = np.eye(self._model.n_motors)[self._model.actuators.feels]
        return self._slopes(at, Outputs(loads=np.tile(weights, (len(at.strains), 1, 1))))

    def _slopes(self, at: EquilibriumDerivatives, outputs: Outputs) -> _Slopes:
        rows = AdjointRows(at, outputs)
        return _Slopes(rows.by_actuators, rows.by_loads()[self._model.tip][..., :3], rows.by_numbers(self._change))

    def _chunks(
        self, cases: Cases, gravity: FloatArray, count: int, outputs: int
    ) -> Iterator[tuple[slice, EquilibriumDerivatives]]:
        """Yield some of the cases after another, and the robot at them."""
        model = self._model
        motors, force, springs = (
            np.broadcast_to(one, (count, one.shape[1])) for one in (cases.motors, cases.force, cases.unknown)
        )
        for rows in self._parts(count, outputs):
            states = [
                elastic_state(model, at, here, self._load(push, gravity))
                for at, push, here in zip(motors[rows], force[rows], springs[rows], strict=True)
            ]
            loads = {model.tip: np.concatenate([force[rows], np.zeros((len(states), 3))], axis=1)}
            if self._weight:
                loads[""] = np.tile(gravity, (len(states), 1))
            of_actuators, coupling = (np.array([getattr(one.load, name) for one in states]) for name in ("motors", "coupling"))
            tangent = np.array([one.tangent for one in states])
            yield (
                rows,
                EquilibriumDerivatives(model, States(motors[rows], springs[rows], loads, of_actuators, tangent, coupling)),
            )

    def _parts(self, count: int, outputs: int) -> Iterator[slice]:
        """Yield the rows of one chunk of cases after another."""
        step = max(1, _SIZE // (6 * outputs * max(1, self._model.pinocchio.nv)))
        for first in range(0, count, step):
            yield slice(first, min(first + step, count))


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Products of matrices and vectors, one a row."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
