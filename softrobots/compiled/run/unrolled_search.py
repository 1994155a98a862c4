"""Load estimation and inverse kinematics of unrolled chains: Newton's method on all unknowns, as straight-line code."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.batches import root, solve_batch
from softrobots.compiled.run.results import MotorBatch
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel


class UnrolledSearch:
    """Searches of unrolled chains, by the functions of `motor_drivers` and `path_drivers`; see `LoopedSearch`."""

    def __init__(self, model: SoftModel, actuation: Actuation, run: Any) -> None:
        """Use the functions of a program that has generated searches."""
        self._model, self._actuation, self._run = model, actuation, run

    def estimate(self, q_motors: FloatArray, torques: FloatArray, gravity: FloatArray) -> tuple[Status, Any]:
        """Find the force that explains motor torques; see `LoopedSearch.estimate`."""
        w = self._actuation.workspace(self._run, q_motors, torques=torques, gravity=gravity)
        return Status(self._run.estimate(w)), w

    def estimate_batch(
        self, motors: FloatArray, torques: FloatArray, gravity: FloatArray, threads: int
    ) -> tuple[Any, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Find the forces of many cases; see `LoopedSearch.estimate_batch`."""
        run, layout = self._run, self._run.layout
        inputs = [(0, motors), (layout.torques, torques), (layout.gravity, gravity[None])]
        squares = [(layout.single(name), 1) for name in ("error", "unexplained", "observed")]
        results = [(layout.unknown, layout.unknowns), (layout.force, 3), *squares]
        (unknowns, forces, error, unexplained, observed), statuses = solve_batch(
            run.estimate_batch, inputs, results, len(motors), threads
        )
        return statuses, unknowns, forces, root(error), root(unexplained), root(observed)

    def reach_batch(
        self,
        targets: FloatArray,
        forces: FloatArray,
        gravity: FloatArray,
        motors: FloatArray,
        unknowns: FloatArray,
        tolerance: float,
        threads: int,
    ) -> tuple[Any, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Put the tips at their targets; see `LoopedSearch.reach_batch`."""
        run, layout = self._run, self._run.layout
        inputs = [
            (0, motors),
            (layout.unknown, unknowns),
            (layout.force, forces),
            (layout.gravity, gravity[None]),
            (layout.target, targets),
            (layout.single("tolerated"), np.full((1, 1), float(tolerance))),
        ]
        squares = [(layout.single(name), 1) for name in ("error", "missing", "turned")]
        results = [(0, layout.motors), (layout.unknown, layout.unknowns), *squares]
        found, statuses = solve_batch(run.reach_batch, inputs, results, len(motors), threads)
        motors, unknowns, error, missing, turned = found
        return statuses, motors, unknowns, root(error), root(missing), _angles(turned[:, 0])

    def follow(
        self, targets: FloatArray, force: FloatArray, gravity: FloatArray, q_motors: FloatArray, tolerance: float
    ) -> tuple[MotorBatch, int]:
        """Move the tip through targets, shape (n, 3 or 12) [m], each step from the last; see `LoopedSearch.follow`."""
        run, layout, count = self._run, self._run.layout, len(targets)
        start = self._actuation.unknowns(q_motors, self._model.rest)
        w = self._actuation.workspace(run, q_motors, force=force, gravity=gravity, unknown=start)
        w[layout.single("tolerated")] = float(tolerance)
        motors, unknowns = run.array(count * len(q_motors)), run.array(count * layout.unknowns)
        kinds = layout.conditions // 3
        residuals, errors, statuses = run.array(count), run.array(count * kinds), run.array(count)
        run.follow(w, run.flat(targets), count, motors, unknowns, residuals, errors, statuses)
        missing = np.reshape(errors, (count, kinds))
        batch = MotorBatch(
            self._actuation.elastic(np.reshape(unknowns, (count, layout.unknowns))),
            np.asarray(statuses, dtype=np.uint8),
            np.sqrt(residuals),
            np.reshape(motors, (count, len(q_motors))),
            np.sqrt(missing[:, 0]),
            _angles(missing[:, 1]) if kinds == 2 else None,
        )
        return batch, int(w[layout.single("iterations")])


def _angles(turned: FloatArray) -> FloatArray:
    """Return the angles, shape (n,) [rad], of the measure that generated code has of them; see `motor_program`."""
    small = np.arcsin(np.sqrt(np.clip(turned, 0.0, 1.0)))
    return np.asarray(np.where(turned < 1.0, small, np.arccos(np.clip(1.0 - turned, -1.0, 1.0))))
