"""Straight-line functions of load estimation and inverse kinematics.

Newton's method on all unknowns at once: the springs in balance, `r = 0`, and either the motor torques equal to those measured,
with unknown force, or the tip at its target, a position or a pose, with unknown motors. Elimination of the strains
(`softrobots.compiled.chain.elimination`) leaves three equations, or six, with the elastostatic Jacobian
(`softrobots.compiled.chain.tip_motion`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, vector
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.small_systems import smallest_square, solve_small
from softrobots.compiled.chain.tip_motion import TipMotion, step_with_motors, tip_motion
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import Evaluation, evaluate
from softrobots.compiled.program.passes import go_on
from softrobots.compiled.program.unrolled_program import numbers, store_tip
from softrobots.compiled.settings import (
    ANGLE_TOLERANCE,
    LARGEST_SIZE,
    LARGEST_STEP,
    LEAST_SIZE,
    LEVER,
    NEWTON_TOLERANCE,
    POSITIVE_PIVOT,
    RANK_TOLERANCE,
)
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger, square_root


def force_blocks(plan: Plan, first: int) -> tuple[list[Block], int]:
    """Trace the functions of load estimation; return them and the next free place in the workspace, from `first` on."""
    layout = plan.layout
    prepare = Block("prepare_force", "Compute what depends on motors and torques only.")
    trace = prepare.trace
    force_pass = Block("force_pass", "Evaluate the point, and take a Newton step with another force.", trace=trace)
    _force_step(plan, force_pass, evaluate(plan, force_pass, tip_columns=3))
    look = Block("look_for_force", "Evaluate an equilibrium, and the end of a damped step of the force.", trace=trace)
    _look_for_force(plan, look, evaluate(plan, look, tip_columns=3))
    singles = [look.load(layout.single(one)) for one in ("mode", "damping")]
    varying = [*look.loads(layout.unknown, layout.unknowns), *look.loads(layout.force, 3), *singles]
    count = hoist([force_pass, look], prepare, varying, first)
    start = Block("first_force_pass", "Prepare, evaluate the relaxed robot without force, and take a Newton step.", trace=trace)
    start.stores = list(prepare.stores)
    _force_step(plan, start, evaluate(plan, start, at_rest=True, forceless=True, tip_columns=3), starts=True)
    return [prepare, start, force_pass, look], first + count


def target_blocks(plan: Plan) -> list[Block]:
    """Trace the functions of inverse kinematics."""
    step = Block("target_step", "Evaluate the point, and the end of a step to the target, or from the target to the next one.")
    point = evaluate(plan, step, tip_columns=plan.layout.conditions)
    lane = Block("target_pass", "Evaluate the point, and take a Newton step to the target.", trace=step.trace)
    _target_step(plan, step, lane, point)
    look = Block("look_for_target", "Evaluate an equilibrium, and the end of a damped step to the target.", trace=step.trace)
    _look_for_target(plan, look, point)
    return [step, lane, look]


def _force_step(plan: Plan, block: Block, point: Evaluation, *, starts: bool = False) -> None:
    unknowns, layout = plan.unknowns, plan.layout
    motion = tip_motion(unknowns, point)
    measured = vector(block.loads(layout.torques, layout.motors))
    felt = motion.jacobian.T
    left = measured - motion.motor_torques
    change = solve_small(felt, left - motion.torque_change)
    missing = _explainable(felt, left - motion.torque_change, unknowns)
    step = _with_columns(unknowns, point, change)
    values = numbers(plan, block, point)
    size = measured @ measured
    settled_to = if_less(size, LARGEST_SIZE**2, larger(size, LEAST_SIZE**2) * NEWTON_TOLERANCE**2, -1.0)
    settled = if_less(missing @ missing, settled_to, _balanced(values, unknowns), 0.0)
    mode, share = _mode(plan, block, values, settled, step, starts=starts)
    force = constants(np.zeros(3)) if starts else vector(block.loads(layout.force, 3))
    go_on(block, layout.unknown, point.unknown, step, mode, share)
    go_on(block, layout.force, force, point.base_axes @ change, mode, share)
    _store_torques(layout, block, motion, left, missing)
    store_tip(plan, block, point)


def _look_for_force(plan: Plan, block: Block, point: Evaluation) -> None:
    unknowns, layout = plan.unknowns, plan.layout
    motion = tip_motion(unknowns, point)
    left = vector(block.loads(layout.torques, layout.motors)) - motion.motor_torques
    felt = motion.jacobian.T
    damped = _damped(felt, block.load(layout.single("damping")), left)
    force, unknown = vector(block.loads(layout.force, 3)), vector(point.unknown)
    strains = vector(_with_columns(unknowns, point, damped))
    _store_next(layout, block, force + point.base_axes @ damped, unknown + strains)
    _store_torques(layout, block, motion, left, _explainable(felt, left, unknowns))


def _explainable(felt: Any, torques: Vector, unknowns: Unknowns) -> Vector:
    """Return the part of torques that a force can explain: all for up to three motors."""
    if len(torques) <= 3:
        return torques
    return felt @ _damped(felt, RANK_TOLERANCE * float(unknowns.chain.reach), torques)


def _store_next(layout: Layout, block: Block, varied: Vector, unknown: Vector) -> None:
    """Write the end of a step: motors or force, and unknowns."""
    block.store_all(layout.next_point, varied.tolist())
    block.store_all(layout.next_point + layout.varied, unknown.tolist())


def _store_torques(layout: Layout, block: Block, motion: TipMotion, left: Vector, missing: Vector) -> None:
    """Write the unexplained torques and the observability of the force; it is never observable with fewer than three motors."""
    block.store(layout.single("missing"), missing @ missing)
    block.store(layout.single("unexplained"), left @ left)
    block.store(layout.single("observed"), smallest_square(motion.jacobian) if layout.motors >= 3 else 0.0)


def _target_step(plan: Plan, step: Block, lane: Block, point: Evaluation) -> None:
    unknowns, layout = plan.unknowns, plan.layout
    motion = tip_motion(unknowns, point)
    missing, next_missing = (_missing(plan, step, place, point) for place in (layout.target, layout.next_target))
    values = numbers(plan, step, point)
    tolerated = step.load(layout.single("tolerated"))
    there = if_less(ANGLE_TOLERANCE**2, missing.turned, 0.0, _balanced(values, unknowns))
    settled = if_less(tolerated * tolerated, missing.distance, 0.0, there)
    weights = _weights(plan)
    for block in (step, lane):
        # The step leads to the next target once this one is reached; a lane has only one.
        wanted = (
            missing.way
            if block is lane
            else vector([if_less(0.5, settled, a, b) for a, b in zip(next_missing.way, missing.way, strict=True)])
        )
        motors = solve_small(motion.jacobian * weights[:, None], wanted - motion.tip_change * weights)
        strains = step_with_motors(unknowns, point, motors)
        mode, share = _mode(plan, block, values, settled, [*strains, *motors])
        joints, unknown = vector(block.loads(0, layout.motors)), vector(point.unknown)
        if block is lane:
            go_on(block, 0, joints, motors, mode, share)
            go_on(block, layout.unknown, unknown, strains, mode, share)
        else:
            _store_next(layout, block, joints + motors * share, unknown + vector(strains) * share)
        missing.store(layout, block)
        store_tip(plan, block, point)


def _look_for_target(plan: Plan, block: Block, point: Evaluation) -> None:
    unknowns, layout = plan.unknowns, plan.layout
    slope = tip_motion(unknowns, point).jacobian * _weights(plan)[:, None]
    missing = _missing(plan, block, layout.target, point)
    motors = _damped(slope, block.load(layout.single("damping")), missing.way)
    strains = vector(step_with_motors(unknowns, point, motors))
    _store_next(layout, block, vector(block.loads(0, layout.motors)) + motors, vector(point.unknown) + strains)
    missing.store(layout, block)
    block.store(layout.single("observed"), smallest_square(slope))


class _Missing(NamedTuple):
    """What is missing to a target."""

    way: Vector
    """From the tip to the target in the axes behind the leading motors, rotations times the lever, shape (3 or 6,) [m]."""
    distance: Scalar
    """Squared distance [m^2]."""
    turned: Scalar
    """Squared sine of the angle [-], beyond a quarter turn one minus its cosine: it grows up to half a turn."""

    def store(self, layout: Layout, block: Block) -> None:
        """Write distance and angle."""
        block.store(layout.single("missing"), self.distance)
        block.store(layout.single("turned"), self.turned)


def _missing(plan: Plan, block: Block, place: int, point: Evaluation) -> _Missing:
    """Return what is missing to the target at a place.

    With the axes `r_i` of the tip and `g_i` of the target, the sum of `r_i x g_i / 2` is the axis of the turn between them
    times the sine of its angle: exact where it is small, and without a branch where it is zero.
    """
    way = point.base_axes.T @ (vector(block.loads(place, 3)) - point.base) - point.tip
    if not plan.poses:
        return _Missing(way, way @ way, 0.0)
    goal = point.base_axes.T @ vector(block.loads(place + 3, 9)).reshape(3, 3)
    sine = sum((cross(point.tip_axes[:, i], goal[:, i]) for i in range(3)), constants(np.zeros(3))) * 0.5
    angle_cosine = ((point.tip_axes * goal).sum() - 1.0) * 0.5
    turn = sine * (2.0 / (larger(angle_cosine, 0.0) + 1.0))
    turned = if_less(0.0, angle_cosine, sine @ sine, 1.0 - angle_cosine)
    return _Missing(np.concatenate([way, turn * (LEVER * float(plan.unknowns.chain.reach))]), way @ way, turned)


def _weights(plan: Plan) -> Any:
    """Return the weight of each condition: 1 for a position, the lever for a turn [m]."""
    return constants([1.0] * 3 + [LEVER * float(plan.unknowns.chain.reach)] * (plan.layout.conditions - 3))


def _damped(matrix: object, damping: Scalar, right: Vector) -> Vector:
    """Levenberg-Marquardt step `M^T (M M^T + damping^2)^-1 right`, in the smaller of its two forms."""
    m = np.asarray(matrix, dtype=object)
    rows, columns = m.shape
    square = constants(np.eye(min(rows, columns))) * (damping * damping)
    if rows <= columns:
        return m.T @ solve_small(m @ m.T + square, right)
    return solve_small(m.T @ m + square, m.T @ right)


def _with_columns(unknowns: Unknowns, point: Evaluation, force: Vector) -> list[Scalar]:
    """Return the Newton step of the unknowns when the force changes as well."""
    by_element = [
        [own[0][place] + sum((own[1 + axis][place] * force[axis] for axis in range(3)), 0.0) for place in range(len(own[0]))]
        for own in point.steps
    ]
    return unknowns.in_order(by_element)


def _balanced(values: dict[str, Scalar], unknowns: Unknowns) -> Scalar:
    """Return 1 where the springs are in balance, else 0."""
    return if_less(values["error"], larger(values["size"] * NEWTON_TOLERANCE**2, unknowns.spring_rounding**2), 1.0, 0.0)


def _mode(
    plan: Plan, block: Block, values: dict[str, Scalar], settled: Scalar, step: Sequence[Scalar], *, starts: bool = False
) -> tuple[Scalar, Scalar]:
    """Write the new mode of a case; return it and the share of the step; see `softrobots.compiled.program.passes`."""
    layout = plan.layout
    signs = if_less(absolute(values["n_negative_pivots"]), 0.5, 1.0, 0.0)
    stable = if_less(POSITIVE_PIVOT, values["min_pivot"], signs, 0.0)
    length = sum((one * one for one in step), 0.0)
    going = if_less(length, 1e6, 2.0 - 2.0 * stable, 2.0)
    mode: Scalar = if_less(0.5, settled, 2.0 - stable, going)
    if not starts:
        mode = if_less(1.5, block.load(layout.single("mode")), 2.0, mode)
    block.store(layout.single("mode"), mode)
    block.store(layout.single("error"), values["error"])
    return mode, LARGEST_STEP / square_root(larger(length, LARGEST_STEP**2))
