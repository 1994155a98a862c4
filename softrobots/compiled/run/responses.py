"""Equilibria and load estimates of many cases with the numbers of the robot as an input, and their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.generated_module import make_program
from softrobots.compiled.program.response_program import ResponsePlaces
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.batches import root, solve_batch
from softrobots.compiled.settings import CHUNK, MAX_UNROLLED_JOINTS
from softrobots.compiled.trace.numbers import NumberInputs
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.serial_chain import SerialChain


class Cases(NamedTuple):
    """Cases with their results, one row each."""

    motors: FloatArray
    """Motor joints, shape (n, n_motors) [rad or m]."""
    force: FloatArray
    """Force on the tip, shape (n, 3) [N]; of load estimates the one that is found."""
    torques: FloatArray
    """Measured load on each motor, shape (n, n_motors) [N m or N]; of equilibria not used."""
    unknown: FloatArray
    """Elastic coordinates, shape (n, n_springs) [rad or m]."""


class Responses:
    """Code of an unrolled chain whose numbers are inputs, and that has derivatives."""

    def __init__(self, chain: SerialChain, backend: str, inputs: NumberInputs, *, weight: bool) -> None:
        """Generate and load the code.

        Raises:
            ParameterError: If the chain is not unrolled.
        """
        unknowns = Unknowns(chain)
        if not unknowns.is_unrolled:
            kind = f"joints with springs and motors, at most {MAX_UNROLLED_JOINTS}, without sections and muscles"
            raise ParameterError("robot", chain.name, f"a chain of {kind}, for compiled derivatives (softrobots.sensitivity)")
        self._run: Any = make_run(make_program(unknowns, weight=weight, inputs=inputs), backend)
        self._layout = self._run.layout
        self._places: ResponsePlaces = self._run.program.responses  # type: ignore[assignment]

    def equilibria(
        self, motors: FloatArray, force: FloatArray, gravity: FloatArray, numbers: FloatArray, threads: int, count: int
    ) -> list[Any]:
        """Find equilibria from rest, for `count` rows of motors and force, or with one row for all.

        Returns:
            Elastic coordinates, shape (n, n_springs) [rad or m], tip, (n, 3) [m], norm of the residual, (n,) [N m], statuses.
        """
        layout = self._layout
        inputs = [(0, motors), (layout.force, force), (layout.gravity, gravity[None]), (layout.numbers, numbers)]
        results = [(layout.unknown, layout.unknowns), (layout.tip, 3), (layout.single("error"), 1)]
        (*found, error), statuses = solve_batch(self._run.settle_batch, inputs, results, count, threads)
        return [*found, root(error), statuses]

    def estimates(
        self, motors: FloatArray, torques: FloatArray, gravity: FloatArray, numbers: FloatArray, threads: int, count: int
    ) -> list[Any]:
        """Find forces on the tip from the loads on the motors.

        Returns:
            Elastic coordinates, tip, force, shape (n, 3) [N], norm of the torques not explained, (n,) [N m], statuses.
        """
        layout = self._layout
        inputs = [(0, motors), (layout.torques, torques), (layout.gravity, gravity[None]), (layout.numbers, numbers)]
        results = [(layout.unknown, layout.unknowns), (layout.tip, 3), (layout.force, 3), (layout.single("unexplained"), 1)]
        (*found, unexplained), statuses = solve_batch(self._run.estimate_batch, inputs, results, count, threads)
        return [*found, root(unexplained), statuses]

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
        """Return weights of the inputs from those of the results (reverse mode).

        Args:
            kind: "equilibrium" or "estimate".
            cases: The cases with their results.
            gravity: Gravity, shape (3,) [m/s^2].
            numbers: Numbers of the robot, shape (1, k).
            weights: Weights of elastic coordinates, tip and, of load estimates, force, one row a case.
            threads: Number of threads.
            count: Number of cases.

        Returns:
            Weights of motors and load, one row a case, and of the numbers, summed over the cases, shape (k,).
        """
        places = self._places
        inputs = [*self._inputs(cases, gravity, numbers), *zip(places.of_results, weights, strict=False)]
        sums = np.zeros((count // CHUNK + 1, places.numbers))
        function, results = getattr(self._run, f"pull_{kind}_batch"), [(0, places.motors), places.load(kind)]
        results = [(places.first + place, size) for place, size in results]
        (motors, load), sums = solve_batch(function, inputs, results, count, threads, sums)
        return motors, load, sums.sum(axis=0)

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
        """Return rates of the results from those of the inputs, motors, load and numbers (forward mode); see `pull`."""
        places = self._places
        begin = [places.first, places.first + places.load(kind)[0], places.number]
        inputs = [*self._inputs(cases, gravity, numbers), *zip(begin, rates, strict=True)]
        results = list(zip(places.of_results, (places.unknowns, 3, 3), strict=True))[: 2 if kind == "equilibrium" else 3]
        function, sums = getattr(self._run, f"push_{kind}_batch"), np.zeros((count // CHUNK + 1, 0))
        return solve_batch(function, inputs, results, count, threads, sums)[0]

    def _inputs(self, cases: Cases, gravity: FloatArray, numbers: FloatArray) -> list[tuple[int, FloatArray]]:
        layout = self._layout
        places = (0, layout.force, layout.torques, layout.unknown, layout.gravity, layout.numbers)
        return list(zip(places, (*cases, gravity[None], numbers), strict=True))
