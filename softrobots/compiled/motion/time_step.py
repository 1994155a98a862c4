r"""The implicit midpoint rule, traced: functions of one unknown or one motor, and the test of convergence.

With the acceleration `a` in the middle of a step of length `h`

.. math:: y_m = y_0 + \tfrac h 2 v_0 + \tfrac{h^2}{4} a, \quad v_m = v_0 + \tfrac h 2 a, \quad
    y_1 = y_0 + h v_0 + \tfrac{h^2}{2} a, \quad v_1 = v_0 + h a

Motors move along the parabola through their positions at the beginning, in the middle and at the end of the whole step.
"""

from __future__ import annotations

from softrobots.compiled.motion.extrapolation import beyond_history, choose_order, compare_change, keep_history
from softrobots.compiled.motion.gauss_step import gauss_blocks
from softrobots.compiled.motion.motion_layout import MotionLayout
from softrobots.compiled.motion_settings import MOTION_NEXT, MOTION_ROUNDING, MOTION_TOLERANCE
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, if_less, larger


def step_blocks(layout: MotionLayout) -> list[Block]:
    """Return the functions of an unknown `i`, that of a motor `i`, and the test of convergence."""
    guess, apply, finish = gauss_blocks(layout) if layout.in_stages else _midpoint_blocks(layout)
    return [
        choose_order(layout),
        guess,
        apply,
        _judge(layout, Block("judge_corrections", "Write `SETTLED`: whether the corrections of a step have converged.")),
        finish,
        _interpolate(layout, Block("interpolate_unknown", "Place an unknown at `SHARE` of the step taken last.", ("i",))),
        _place_motor(layout, Block("place_motor", "Place a motor at `SHARE` of the whole step.", ("i",))),
    ]


def _midpoint_blocks(layout: MotionLayout) -> tuple[Block, Block, Block]:
    return (
        _guess(layout, Block("guess_unknown", "Extrapolate the middle of an unknown, and its acceleration.", ("i",))),
        _apply(layout, Block("apply_correction", "Correct an acceleration, and its unknown in the middle.", ("i",))),
        _finish(layout, Block("finish_unknown", "Go to the end of the step, and remember the middle.", ("i",))),
    )


def _guess(layout: MotionLayout, block: Block) -> Block:
    """Extrapolate the middle: accelerations of stiff springs change their sign from step to step, middles hardly change."""
    h, velocity = block.load(layout.time_step), block.load(layout.velocity, "i")
    coasting = block.load(layout.position, "i") + h * 0.5 * velocity
    acceleration = beyond_history(layout, block, 0, coasting) * 4.0 / (h * h)
    block.store(layout.acceleration, acceleration, "i")
    return _place_middle(layout, block, acceleration)


def _apply(layout: MotionLayout, block: Block) -> Block:
    correction, h = block.load(layout.correction, "i"), block.load(layout.time_step)
    acceleration = block.load(layout.acceleration, "i") + correction
    block.store(layout.acceleration, acceleration, "i")
    compare_change(layout, block, [correction * (h * h * 0.25)])
    return _place_middle(layout, block, acceleration)


def _place_middle(layout: MotionLayout, block: Block, acceleration: Scalar) -> Block:
    half, velocity = block.load(layout.time_step) * 0.5, block.load(layout.velocity, "i")
    rate = velocity + half * acceleration
    block.store(layout.rate, rate, "i")
    middle = block.load(layout.position, "i") + half * (velocity + half * acceleration)
    block.store(layout.unknown, middle, "i")
    return block


def _judge(layout: MotionLayout, block: Block) -> Block:
    """By the last correction, by what the next would be, or as far as rounding lets.

    The next one is expected to shrink as the last one did, and up to ten times less, as that one may have had other factors.
    Where two have shrunk to a tenth or less, it is expected to shrink as the worse of them. None shrinks by more than 1000:
    a guess may be near by chance.
    """
    change, last, before = (block.load(place) for place in (layout.change, layout.last_change, layout.change_before))
    as_before = if_less(before, 1.0, if_less(change * last, MOTION_NEXT * before, 1.0, 0.1), 0.1)
    known = if_less(last, 0.1 * before, as_before, 0.1)
    next_is_small = if_less(known * MOTION_NEXT * last, change * change, 0.0, 1.0)
    next_is_small = if_less(change, 1e3 * MOTION_NEXT, next_is_small, 0.0)
    shrinking = if_less(change, 0.01 * last, if_less(last, 1.0, next_is_small, 0.0), 0.0)
    rounded = if_less(0.5 * last, change, if_less(MOTION_ROUNDING, change, 0.0, 1.0), 0.0)
    block.store(layout.change_before, last)
    block.store(layout.settled, if_less(MOTION_TOLERANCE, change, larger(shrinking, rounded), 1.0))
    return block


def _finish(layout: MotionLayout, block: Block) -> Block:
    h = block.load(layout.time_step)
    position, velocity, acceleration = (
        block.load(place, "i") for place in (layout.position, layout.velocity, layout.acceleration)
    )
    block.store(layout.position, position + h * (velocity + h * 0.5 * acceleration), "i")
    block.store(layout.velocity, velocity + h * acceleration, "i")
    keep_history(layout, block, [block.load(layout.unknown, "i")])
    return block


def _interpolate(layout: MotionLayout, block: Block) -> Block:
    """By the cubic of Hermite, with s and r = 1 - s."""
    s, h = block.load(layout.share), block.load(layout.whole_step)
    r = 1.0 - s
    y0, y1 = block.load(layout.begin_position, "i"), block.load(layout.position, "i")
    v0, v1 = block.load(layout.begin_velocity, "i"), block.load(layout.velocity, "i")
    ends = y0 * (r * r * (1.0 + 2.0 * s)) + y1 * (s * s * (1.0 + 2.0 * r))
    block.store(layout.unknown, ends + h * s * r * (r * v0 - s * v1), "i")
    slopes = v0 * (r * (r - 2.0 * s)) + v1 * (s * (s - 2.0 * r))
    block.store(layout.rate, slopes + (y1 - y0) * (6.0 * s * r / h), "i")
    return block


def _place_motor(layout: MotionLayout, block: Block) -> Block:
    h, offset = block.load(layout.whole_step), block.load(layout.share) - 0.5
    begin, middle, end = (block.load(place, "i") for place in (layout.motors_begin, layout.motors_middle, layout.motors_end))
    speed, bend = end - begin, (begin + end - middle * 2.0) * 4.0
    block.store(0, middle + offset * (speed + offset * 0.5 * bend), "i")
    block.store(layout.motor_velocities, (speed + offset * bend) / h, "i")
    block.store(layout.motor_accelerations, bend / (h * h), "i")
    return block
