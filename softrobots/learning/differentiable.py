"""Equilibria and load estimates as functions of actuators, loads and parameters, with derivatives; in NumPy."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.run.backends import BACKENDS, available_backend
from softrobots.compiled.run.batches import gravity_vector, unusable, without
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.responses import Cases
from softrobots.compiled.settings import LARGEST_POSITION
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, choice, positive_integer
from softrobots.core.errors import DescriptionError, EquilibriumNotFound, LoadNotFound, ParameterError
from softrobots.identification.parameters import OF_MODEL, ParameterSet
from softrobots.learning.general_solver import GeneralSolver
from softrobots.learning.number_changes import NumberChanges
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.statics.load_estimation import check_feels

Kind = Literal["equilibrium", "estimate"]
GENERAL = "pinocchio"
"""Name of the back end that solves every robot without dry friction; see `softrobots.learning.general_solver`."""

_AT_ONCE = 1 << 8  # robots whose numbers are read at once
_ADVICE = '; failed="nan" marks such rows instead'


class Differentiable:
    """A batch solver of a robot as a function `(q_motors, load, parameters) -> results` of arrays, with derivatives.

    The load is the force on the tip, or for estimates the loads on the motors; the results are elastic coordinates and tip,
    and for estimates the force. Leading dimensions are those of NumPy's broadcasting; all results have all of them.
    """

    def __init__(
        self,
        kind: Kind,
        robot: Any,
        parameters: str | Sequence[str],
        *,
        gravity: Any,
        backend: str | None,
        threads: int,
        failed: str,
    ) -> None:
        """Check the arguments, and generate the code; see `softrobots.jax.equilibrium`."""
        self.kind = kind
        self._gravity = gravity_vector(gravity)
        self._threads, self._failed = positive_integer("threads", threads), choice("failed", failed, ("raise", "nan"))
        given = robot.model if isinstance(robot, CompiledModel) else robot
        if backend is not None:
            choice("backend", backend, (*BACKENDS, GENERAL))
        names = [parameters] if isinstance(parameters, str) else list(parameters)
        model = given if isinstance(given, SoftModel) or names else load_model(given)
        self._set = ParameterSet.of(given, names) if names else ParameterSet(model, (), {})
        for one in self._set.parameters:
            if one.place.kind not in (*OF_MODEL, "offset"):
                requirement = "parameters of the robot or offsets of motors; actuators and loads are arguments of their own"
                raise ParameterError("parameters", one.name, requirement)
        self.model = self._set.present
        check_frictionless(self.model, "derivatives of batches")
        if kind == "estimate":
            check_feels(self.model)
            if self.model.n_motors < 3:
                raise ParameterError(
                    "robot", self.model.pinocchio.name, "one with three motors at least, which feel every force"
                )
        chosen = backend or (available_backend() if _is_unrolled(self.model) else GENERAL)
        if chosen != GENERAL:
            self._changes: NumberChanges | GeneralSolver = NumberChanges(self._set, chosen, weight=gravity is not None)
        else:
            compiled = robot if isinstance(robot, CompiledModel) and backend != GENERAL else None
            self._changes = GeneralSolver(self._set, weight=gravity is not None, compiled=compiled)
            felt = int(self.model.actuators.feels.sum())
            if kind == "estimate" and felt < 3:
                requirement = f"a robot of which three actuators at least feel the load ({felt} do)"
                raise ParameterError("robot", self.model.pinocchio.name, requirement)
        self.names, self.present = self._set.names, self._set.values
        m, n = self.model.n_motors, self.model.n_springs
        self.inputs = (m, m if kind == "estimate" else 3, len(self.present))
        """Components of motors, load and parameters."""
        self.results = (n, 3, 3) if kind == "estimate" else (n, 3)
        """Components of elastic coordinates, tip and, of estimates, force."""

    def solve(self, *inputs: Any) -> tuple[FloatArray, ...]:
        """Find the results.

        Args:
            *inputs: Motors, load and parameters, shapes (..., k).

        Returns:
            The results, shapes (..., k); NaN in rows that failed, if that was asked for.

        Raises:
            ParameterError: If a row is not finite or too large, a parameter is not finite, or the robot refuses them.
            EquilibriumNotFound: If rows have no stable equilibrium; names them.
            LoadNotFound: If no unique force explains the torques of rows.
        """
        lead = lead_of(inputs)
        count = math.prod(lead)
        if not count:
            return tuple(np.zeros((*lead, size)) for size in self.results)
        values = np.asarray(inputs[2], dtype=np.float64)
        if not np.isfinite(values).all() or np.abs(values @ self._set.offset_slopes.T).max(initial=0.0) > LARGEST_POSITION:
            raise ParameterError("parameters", values, "finite values, and offsets of motors that are not too large")
        motors, loads = (_flat(one, lead) for one in inputs[:2])
        bad = unusable(motors) | unusable(loads)
        if motors.size and not (motors.min() >= -LARGEST_POSITION and motors.max() <= LARGEST_POSITION):
            bad = bad | (np.abs(motors).max(axis=1) > LARGEST_POSITION)
        if np.any(bad):
            if self._failed == "raise":
                requirement = f"finite motors and loads, not too large to compute with{_ADVICE}"
                raise ParameterError("rows", np.flatnonzero(bad)[:8].tolist(), requirement)
            bad = np.broadcast_to(bad, count)
            motors = without(motors, bad[: len(motors)], self.model.relaxed_motors)
            loads = without(loads, bad[: len(loads)])
        found = _Parts(count)
        for rows, at in self._groups(values, lead):
            code, numbers, _ = self._changes.code(at)
            solver = code.equilibria if self.kind == "equilibrium" else code.estimates
            given = self._true(_picked(motors, rows), at), _picked(loads, rows)
            found.put(rows, solver(*given, self._gravity, numbers, self._threads, len(np.arange(count)[rows])))
        *results, residuals, statuses = found.arrays
        failed = (statuses != Status.CERTIFIED) | bad
        if np.any(failed):
            self._refuse(statuses, failed, residuals)
            for result in results:
                result[failed] = np.nan
        return tuple(result.reshape(*lead, -1) for result in results)

    def push(self, inputs: Sequence[Any], results: Sequence[Any], rates: Sequence[Any]) -> tuple[FloatArray, ...]:
        """Return the rates of the results from those of the inputs, None for zero; NaN in rows that failed."""
        given = [np.zeros(size) if rate is None else rate for size, rate in zip(self.inputs, rates, strict=True)]
        lead = lead_of([*inputs, *results, *given])
        if not math.prod(lead):
            return tuple(np.zeros((*lead, size)) for size in self.results)
        of_motors, of_load, of_parameters = (_flat(one, lead) for one in given)
        of_motors = of_motors + of_parameters @ self._set.offset_slopes.T
        found = _Parts(math.prod(lead), np.nan)
        for rows, count, values, cases in self._cases(inputs, results, lead, slopes=rates[2] is not None):
            code, numbers, slopes = self._changes.code(values, slopes=rates[2] is not None)
            of_numbers = _picked(of_parameters, rows) @ slopes.T if slopes.size else np.zeros_like(numbers)
            whole = _picked(of_motors, rows), _picked(of_load, rows), of_numbers
            found.put(rows, code.push(self.kind, cases, self._gravity, numbers, whole, self._threads, count))
        return tuple(part.reshape(*lead, -1) for part in found.arrays)

    def pull(
        self,
        inputs: Sequence[Any],
        results: Sequence[Any],
        weights: Sequence[Any],
        shapes: Sequence[tuple[int, ...] | None],
    ) -> tuple[FloatArray | None, ...]:
        """Return the weights of the inputs from those of the results (gradients).

        Args:
            inputs: Motors, load and parameters.
            results: What `solve` found for them.
            weights: Weights of the results.
            shapes: Leading dimensions of the weights of each input, to which they are summed; None for those not needed.

        Returns:
            The weights; None for those not needed. Rows that failed add nothing.
        """
        lead = lead_of([*inputs, *results, *weights])
        if not math.prod(lead):
            return tuple(None if one is None else np.zeros((*one, k)) for one, k in zip(shapes, self.inputs, strict=True))
        given = [_flat(one, lead) for one in weights]
        each = () if shapes[2] is None else shapes[2]
        values_of = np.broadcast_to(inputs[2], (*np.broadcast_shapes(np.shape(inputs[2])[:-1], each), len(self.present)))
        sums = np.zeros(values_of.shape)
        by_group = sums.reshape(math.prod(sums.shape[:-1]), -1)
        found = _Parts(math.prod(lead))
        each_case = self._cases([*inputs[:2], values_of], results, lead, apart=True, slopes=shapes[2] is not None)
        for group, (rows, count, values, cases) in enumerate(each_case):
            code, numbers, slopes = self._changes.code(values, slopes=shapes[2] is not None)
            picked = [_picked(one, rows) for one in given]
            *pulled, of_numbers = code.pull(self.kind, cases, self._gravity, numbers, picked, self._threads, count)
            found.put(rows, pulled)
            if shapes[2] is not None:
                by_group[group] = of_numbers @ slopes + pulled[0].sum(axis=0) @ self._set.offset_slopes
        wide = [*(one.reshape(*lead, -1) for one in found.arrays), sums]
        return tuple(
            None if shape is None else _summed(one, (*shape, one.shape[-1])) for one, shape in zip(wide, shapes, strict=True)
        )

    def _true(self, motors: FloatArray, values: tuple[float, ...]) -> FloatArray:
        return motors + self._set.motor_offsets(np.array(values))

    def _cases(
        self, inputs: Sequence[Any], results: Sequence[Any], lead: tuple[int, ...], *, apart: bool = False, slopes: bool
    ) -> Iterator[tuple[Any, int, tuple[float, ...], Cases]]:
        """Yield rows, without those that failed, their number, values of the parameters, and the cases."""
        motors, load = (_flat(one, lead) for one in inputs[:2])
        springs, _, *force = (_flat(one, lead) for one in results)
        solved = np.ones(math.prod(lead), dtype=bool)
        if not np.isfinite(springs.sum()):
            solved &= np.all(np.isfinite(springs), axis=1)
        for rows, values in self._groups(inputs[2], lead, apart=apart, slopes=slopes):
            if not np.all(solved[rows]):
                rows = np.arange(len(solved))[rows][solved[rows]]
            torques = _picked(load, rows) if force else np.zeros((1, self.model.n_motors))
            at = self._true(_picked(motors, rows), values)
            cases = Cases(at, _picked(force[0] if force else load, rows), torques, _picked(springs, rows))
            yield rows, len(solved[rows]), values, cases

    def _groups(
        self, parameters: Any, lead: tuple[int, ...], *, apart: bool = False, slopes: bool = False
    ) -> Iterator[tuple[Any, tuple[float, ...]]]:
        """Yield the rows that share values of the parameters, and these; or, `apart`, those of each row of parameters."""
        values = np.asarray(parameters, dtype=np.float64)
        each = values.reshape(math.prod(values.shape[:-1]), values.shape[-1])
        place = np.arange(len(each))
        if len(each) > 1 and not apart:
            each, place = np.unique(each, axis=0, return_inverse=True)
        if len(each) == 1:
            yield slice(None), tuple(each[0].tolist())
            return
        group = np.broadcast_to(place.reshape(values.shape[:-1]), lead).ravel()
        members = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group, minlength=len(each)))[:-1])
        every = list(map(tuple, each.tolist()))
        for number, rows in enumerate(members):
            if number % _AT_ONCE == 0:
                self._changes.read(every[number : number + _AT_ONCE], slopes=slopes)
            yield rows, every[number]

    def _refuse(self, statuses: Any, failed: Any, residuals: FloatArray) -> None:
        """Refuse rows without a result."""
        if self._failed == "nan":
            return
        rows = np.flatnonzero(failed)
        named = ", ".join(map(str, rows[:8].tolist())) + (", ..." if len(rows) > 8 else "")
        reasons = "; ".join(Status(int(one)).explanation for one in np.unique(statuses[rows]))
        error = EquilibriumNotFound if self.kind == "equilibrium" else LoadNotFound
        message = f"{len(rows)} of {len(failed)} rows have no certified result (row {named}): {reasons}{_ADVICE}"
        raise error(message, best=rows, residual=float(residuals[rows].max()), iterations=0)


class _Parts:
    """Arrays with one row a case, put together from parts."""

    def __init__(self, count: int, missing: float = 0.0) -> None:
        self._count, self._missing = count, missing
        self.arrays: list[Any] = []

    def put(self, rows: Any, parts: Sequence[Any]) -> None:
        """Add some rows of each array; all rows at once without a copy."""
        if isinstance(rows, slice):
            self.arrays = list(parts)
            return
        if not self.arrays:
            self.arrays = [np.full((self._count, *part.shape[1:]), self._missing, dtype=part.dtype) for part in parts]
        for array, part in zip(self.arrays, parts, strict=True):
            array[rows] = part


def _is_unrolled(model: SoftModel) -> bool:
    """Whether compiled code has derivatives of the robot."""
    try:
        return Unknowns(model.chain()).is_unrolled
    except DescriptionError:
        return False


def lead_of(arrays: Sequence[Any]) -> tuple[int, ...]:
    """Return the common leading dimensions of arrays; refuse those that have none."""
    try:
        return np.broadcast_shapes(*(np.shape(one)[:-1] for one in arrays))
    except ValueError:
        raise ParameterError("shapes", [np.shape(one) for one in arrays], "those whose leading dimensions fit") from None


def _flat(array: Any, lead: tuple[int, ...]) -> FloatArray:
    """Return an array, shape (..., k), as rows: one row for all, shape (1, k), or one each."""
    given = np.asarray(array, dtype=np.float64)
    if math.prod(given.shape[:-1]) != 1:
        given = np.broadcast_to(given, (*lead, given.shape[-1]))
    return np.ascontiguousarray(given).reshape(-1 if given.shape[-1] else 1, given.shape[-1])


def _picked(array: FloatArray, rows: Any) -> FloatArray:
    """Return some rows of an array; the one that is for all."""
    return array if len(array) == 1 else array[rows]


def _summed(array: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Sum over the dimensions that broadcasting added to a shape."""
    if array.shape == shape:
        return array
    summed = array.sum(axis=tuple(range(array.ndim - len(shape))))
    repeated = tuple(axis for axis, size in enumerate(shape) if size == 1 and summed.shape[axis] != 1)
    return np.asarray(summed.sum(axis=repeated, keepdims=True))
