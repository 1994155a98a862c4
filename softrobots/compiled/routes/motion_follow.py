"""Actuators along a chain in motion, traced and in loops: their lengths and slopes, tensions, and torques on the strains."""

from __future__ import annotations

from softrobots.compiled.chain.elements import upper_triangle
from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.motion.motion_groups import OUT_OF_RANGE
from softrobots.compiled.motion.motion_routes import MotionRoutes
from softrobots.compiled.routes.ends import law_numbers, tension
from softrobots.compiled.routes.terms import Form
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, if_less

FOLLOW = '''def follow_actuators_SUFFIX(w: Array, stage: int) -> None:
    """Find lengths and slopes of the actuators, and what they do to the strains."""
    start_routes_SUFFIX(w)
    for i in range(N_STRAINS):
        clear_pull_SUFFIX(w, i)
    follow_all_SUFFIX(w)
    pull_all_SUFFIX(w)
    bar_SUFFIX(w)


'''
"""Lengths first, then tensions."""


def arms_text(form: str) -> str:
    """Return the loop that keeps the slopes beside an element of a form, as part of the rows of the border."""
    return f'''def keep_arms_{form}_SUFFIX(w: Array, element: int, q: int) -> None:
    """Keep the slopes beside an element."""
    for m in range(N_PAST[element]):
        keep_arm_{form}_SUFFIX(w, SLOPES[element] + STRIDE * m, N_STRAINS * (ROW_OF[element] + m) + q)'''


SWERVE = '''def swerve_FORM(w: Array, element: int, q: int) -> None:
    """Add an element to the accelerations of the lengths at constant rates."""
    for r in range(FIRST_BESIDE[element], FIRST_BESIDE[element + 1]):
        for p in range(FIRST_POINT[r], FIRST_POINT[r + 1]):
            add_swerve_FORM(w, POINT_WIDTH * p, q, NUMBER[r], POINTS + POINT_RECORD * p)'''
"""Only with given lengths."""


def frame_blocks(routes: MotionRoutes, count: int) -> list[Block]:
    """Trace the functions before and after the loops over the elements, of `count` steps."""
    start = Block("start_routes", "Start at the base.")
    longest = max(len(one.muscles) for one in routes.routes.segments)
    start.store(routes.bound, float(count))
    start.store(routes.routes.margin, 1.0)
    start.store_all(routes.routes.lengths, [0.0] * longest)
    clear = Block("clear_pull", "Clear the torque of the actuators on a strain.", ("i",))
    clear.store(routes.pulls, 0.0, "i")
    bar = Block("bar", "Let a step fail that takes a route out of its range.")
    first = routes.pulls + min(
        routes.unknowns.place[one] for row in routes.routes.beside for one in routes.unknowns.moving(row)
    )
    beyond = if_less(0.0, bar.load(routes.routes.margin), 0.0, OUT_OF_RANGE)
    bar.store(first, bar.load(first) + beyond)
    return [start, clear, bar]


def form_blocks(routes: MotionRoutes, name: str, form: Form) -> list[Block]:
    """Trace the functions of an element: keep the slopes of an actuator, and the torques of all."""
    k, own = len(form.moving), routes.routes
    keep = Block(f"keep_arm_{name}", "Keep the slopes of an actuator beside an element.", ("at", "to"))
    keep.store_all(routes.slopes if routes.held else routes.arms, keep.loads(0, k, "at"), "to")
    give = Block(f"give_pulls_{name}", "Keep the torques of the actuators on an element.", ("q",))
    give.store_all(routes.pulls, give.loads(own.load, k), "q")
    for number, (i, j) in enumerate(upper_triangle(k)) if not routes.held else ():
        give.store(routes.curvatures + len(routes.unknowns.strains) * j + i, give.load(own.curvature + number), "q")
    return [keep, give]


def find_tensions(routes: MotionRoutes, number: int, segment: Segment) -> Block:
    """Trace the function at the tip of the segment of this number: tensions from the lengths."""
    chain, own = routes.unknowns.chain, routes.routes
    block = Block(f"find_tensions_{number}", "Find the tensions of the actuators of a segment.")
    for place, muscle in enumerate(segment.muscles):
        beyond: Scalar = block.load(own.changes + muscle) + float(chain.muscle_paths.straightened[muscle])
        tag = chain.actuators[muscle]
        pull = tension(tag.kind, law_numbers(tag), block.load(chain.n_motors + muscle), beyond)
        block.store(own.tensions + place, pull.value)
        block.store(own.pulled + muscle, pull.value)
        if muscle in segment.stretched:
            block.store(routes.stiffness + routes.stretched.index(muscle), pull.slope)
    return block
