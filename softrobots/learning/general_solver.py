r"""Equilibria and load estimates of every robot without dry friction, with the derivatives of those of `sensitivity`.

The counterpart of `number_changes` and compiled code, with the same calls: each row is found as by `solve_equilibrium` or
`estimate_load`, from rest; those of a compiled chain by its batch solvers (`varied_chains`). Derivatives are the closed forms
of `softrobots.identification.residual_derivatives` and `residual_rates` for many rows at once, one right-hand side a case in
either mode, whatever the number of parameters and results. The numbers of the robot are here its parameters themselves.

Given lengths leave combinations `y = E z` of the strains `z` free; `E` changes with the parameters, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.responses import Cases
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.identification.model_change import ModelChange, model_change
from softrobots.identification.parameters import ParameterSet
from softrobots.learning.chain_responses import ChainResponses
from softrobots.learning.equilibrium_points import ChainPoints, ChangingRobot, EquilibriumPoints, PinocchioPoints
from softrobots.learning.force_condition import ForceCondition
from softrobots.learning.recorded_models import RecordedModels
from softrobots.learning.row_solver import RowSolver
from softrobots.learning.varied_chains import VariedChains
from softrobots.model.soft_model import SoftModel

_AT_ONCE = 16  # robots whose derivatives are found at once
_KEPT = 1 << 10  # robots that stay loaded from values to gradient, of some 0.4 MB each
_SIZE = 1 << 20  # numbers of the twists of a chunk of cases


class GeneralSolver:
    """A robot by values of its parameters; see `number_changes.NumberChanges`."""

    def __init__(self, parameters: ParameterSet, *, weight: bool, compiled: CompiledModel | None = None) -> None:
        """Take the parameters, and compiled solvers for the equilibria of the robot as it is."""
        self._parameters, self._weight, self._compiled = parameters, weight, compiled
        self._varied = None if compiled is None or compiled.unknowns.is_unrolled else VariedChains(compiled, parameters)
        self._at = lru_cache(maxsize=_KEPT)(self._model)
        self._recorded, self._changes = RecordedModels(parameters), dict[tuple[float, ...], ModelChange]()
        self._alone = lru_cache(maxsize=4)(self._change)

    def read(self, each: Sequence[tuple[float, ...]], *, slopes: bool) -> None:
        """Find derivatives of many robots at once, if they are needed; `code` is then asked for each."""
        self._changes = {}
        for first in range(0, len(each) * slopes, _AT_ONCE):
            some = each[first : first + _AT_ONCE]
            self._changes |= self._recorded.changes(some, [self._at(values)[0] for values in some])

    def code(self, values: tuple[float, ...], *, slopes: bool = False) -> tuple[GeneralResponses, FloatArray, FloatArray]:
        """Return the solver at values of the parameters, these as its numbers, shape (1, P), and their derivatives.

        Raises:
            ParameterError: If the robot refuses the values, or has other joints or actuators with them.
            DescriptionError: If the robot cannot be described with them.
        """
        size = len(values)
        model, compiled, chain = self._at(values)
        change = ModelChange(size, {})
        if slopes:
            change = self._changes.get(values) or self._alone(values)
        robot = ChangingRobot(model, change, dict(zip(self._parameters.names, values, strict=True)), None)
        responses = GeneralResponses(robot, self._weight, compiled, chain)
        return responses, np.array(values).reshape(1, size), np.eye(size) if slopes else np.zeros((size, 0))

    def _change(self, values: tuple[float, ...]) -> ModelChange:
        """Return how the robot at values of the parameters changes with them."""
        model = self._at(values)[0]
        return self._recorded.changes([values], [model]).get(values) or model_change(self._parameters, values, model=model)

    def _model(self, values: tuple[float, ...]) -> tuple[SoftModel, CompiledModel | None, ChainResponses | None]:
        """Return the robot, its compiled solvers, and their derivatives; None where there are none."""
        present = self._parameters.present
        model = self._parameters.model(values) if np.any(self._parameters.of_model) else present
        if (model.springs.names, model.n_motors) != (present.springs.names, present.n_motors):
            raise ParameterError("parameters", values, "values with which the robot has the same joints and actuators")
        compiled = self._compiled
        if compiled is not None and compiled.model != model:
            compiled = None if self._varied is None else self._varied.at(model)
        chain = None if self._varied is None or compiled is None else ChainResponses(compiled, weight=self._weight)
        return model, compiled, chain


class GeneralResponses(RowSolver):
    """Solvers of a robot at values of its parameters; see `softrobots.compiled.run.responses.Responses`."""

    def __init__(
        self, robot: ChangingRobot, weight: bool, compiled: CompiledModel | None, chain: ChainResponses | None
    ) -> None:
        super().__init__(robot.model, weight, compiled, chain)
        self._robot = robot

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
        model = self._robot.model
        motors, load = np.zeros((count, model.n_motors)), np.zeros((count, 3 if kind == "equilibrium" else model.n_motors))
        sums = np.zeros(numbers.shape[1])
        for rows, at in self._chunks(cases, gravity, threads, count):
            springs, tips, *of_force = (one if len(one) == 1 else one[rows] for one in weights)
            found = at.results(springs, tips)
            motors[rows], force = found.by_motors[:, 0], found.by_force[:, 0]
            sums += found.by_parameters.sum(axis=(0, 1))
            if kind == "equilibrium":
                load[rows] = force
                continue
            condition = ForceCondition(at, np.broadcast_to(cases.torques, load.shape)[rows])
            of_motors, load[rows], of_parameters = condition.pull(force + of_force[0])
            motors[rows] += of_motors
            sums += of_parameters.sum(axis=0)
        return motors, load, sums

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
        n_results = 2 if kind == "equilibrium" else 3
        found = [[np.zeros((0, size)) for size in (self._robot.model.n_springs, 3, 3)[:n_results]]]
        for rows, at in self._chunks(cases, gravity, threads, count):
            motors, load, parameters = (one if len(one) == 1 else one[rows] for one in rates)
            if kind == "equilibrium":
                found.append(at.rates(motors, load, parameters))
                continue
            measured = np.broadcast_to(cases.torques, (count, load.shape[1]))[rows]
            force = ForceCondition(at, measured).push(motors, load, parameters)
            found.append([*at.rates(motors, force, parameters), force])
        return [np.concatenate(parts) for parts in zip(*found, strict=True)]

    def _chunks(self, cases: Cases, gravity: FloatArray, threads: int, count: int) -> Iterator[tuple[slice, EquilibriumPoints]]:
        """Yield some of the cases after another, and the robot at them; all at once where code alone differentiates."""
        robot = self._robot._replace(gravity=gravity if self._weight else None)
        given = [np.broadcast_to(one, (count, one.shape[1])) for one in (cases.motors, cases.force, cases.unknown)]
        whole = self._chain is not None and not robot.change.by_number
        step = max(1, count) if whole else max(1, _SIZE // (6 * max(1, robot.model.pinocchio.nv)))
        for first in range(0, count, step):
            rows = slice(first, min(first + step, count))
            some = [one[rows] for one in given]
            points = PinocchioPoints(robot, *some) if self._chain is None else ChainPoints(self._chain, threads, robot, *some)
            yield rows, points
