r"""Elastostatic Jacobian of an unrolled chain, traced; for load estimation and inverse kinematics.

With the tip's columns `X = K^-1 J_k^T` of an evaluation, the elastostatic Jacobian of [Troise 2021] (see
`softrobots.elastostatic_jacobian`) is `E = J_m - X^T H_km`. The second derivatives `H_km` of the energy couple a motor `m` with
a strain `k` beyond it by `-omega_m . c_k` and nearer to the base by `-omega_k . c_m`, so that sums over the strains give

.. math:: E_m = J_m + \omega_m \cdot \sum_{k\,beyond} c_k X_k + c_m \cdot \varphi_m

The same holds for the turn of the tip, with three more columns and :math:`\omega_m` in place of :math:`J_m`.

Its transpose maps a change of the force on the tip to changes of the motor torques.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import Evaluation, solve_again
from softrobots.compiled.trace.expressions import Scalar


@dataclass
class TipMotion:
    """Response of tip and motors at an evaluated point, in the axes behind the leading motors."""

    jacobian: Any
    """Elastostatic Jacobian, shape (3 or 6, n_motors): position, then turn of the tip [m/rad or m/m; rad/rad or rad/m]."""
    motor_torques: Vector
    """Load on the motors, shape (n_motors,) [N m or N]."""
    torque_change: Vector
    """Its change by the Newton step of the unknowns, shape (n_motors,)."""
    tip_change: Vector
    """Change of the tip by that step, shape (3 or 6,) [m; rad]."""


def tip_motion(unknowns: Unknowns, point: Evaluation) -> TipMotion:
    """Return the response of tip and motors at a point, an evaluation with tip columns."""
    count = unknowns.chain.n_motors
    conditions = len(point.beyond.columns) - 1
    jacobian = constants(np.zeros((conditions, count)))
    torques, changes, tip = constants(np.zeros(count)), constants(np.zeros(count)), constants(np.zeros(conditions))
    beyond = [constants(np.zeros(3)) for _ in point.beyond.columns]  # sums of c x over the strains beyond, per right-hand side
    for row in reversed(range(len(point.inward_passes))):
        one, motor = point.inward_passes[row], unknowns.motor(row)
        moves = np.concatenate([one.motion.moves, one.motion.twists])[:conditions]
        if motor is None:
            beyond = [total + one.motion.bends @ step for total, step in zip(beyond, point.steps[row], strict=True)]
            tip = tip + moves @ point.steps[row][0]
            continue
        twist, bend = one.motion.twists[:, 0], one.motion.bends[:, 0]
        follow = [twist @ total + bend @ turn[:3] for total, turn in zip(beyond, point.turns[row], strict=True)]
        jacobian[:, motor] = moves[:, 0] + np.array(follow[1:], dtype=object)
        torques[motor] = one.motion.torque[0]
        changes[motor] = follow[0]
    return TipMotion(jacobian, torques, changes, tip)


def step_with_motors(unknowns: Unknowns, point: Evaluation, motors: Vector) -> list[Scalar]:
    """Return the Newton step of the unknowns when the motors move as well, by `motors`, shape (n_motors,)."""
    moved = {row: motors[motor] for row in range(len(point.inward_passes)) if (motor := unknowns.motor(row)) is not None}
    bends = constants(np.zeros(3))  # of the motors beyond
    for row, by in moved.items():
        bends = bends + point.inward_passes[row].motion.bends[:, 0] * by
    turn = constants(np.zeros(3))  # of the motors nearer to the base
    sides: list[list[Scalar]] = []
    for row, one in enumerate(point.inward_passes):
        if row in moved:
            turn = turn + one.motion.twists[:, 0] * moved[row]
            bends = bends - one.motion.bends[:, 0] * moved[row]
            sides.append([])
        else:
            coupling = one.motion.bends.T @ turn + one.motion.twists.T @ bends
            sides.append([value - by for value, by in zip(one.gradient, coupling, strict=True)])
    return solve_again(unknowns, point, sides)
