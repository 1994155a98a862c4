"""Given lengths in motion, traced and in loops: the strains that have them; see `softrobots.compiled.motion.held_motion`."""

from __future__ import annotations

from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.motion_routes import MotionRoutes, sparse
from softrobots.compiled.routes.motion_border import factor_blocks
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import absolute, smaller

_CLOSED = 1e-12  # largest gap of the lengths [m], as in `softrobots.model.muscle_lengths`
_CLOSINGS = 4  # of Newton's method, from the last strains; one is exact for lengths that are linear

LENGTHS = '''def combine_strains_SUFFIX(w: Array, to: int, coordinates: int, sums: int) -> None:
    """Combine free coordinates, held sums, or their rates, to strains."""
    for i in range(N_STRAINS):
        clear_number_SUFFIX(w, to + i)
        for k in range(FREE_FIRST[i], FREE_FIRST[i + 1]):
            add_free_SUFFIX(w, to + i, coordinates + FREE_PLACE[k], k)
        for k in range(SHARED_FIRST[i], SHARED_FIRST[i + 1]):
            add_shared_SUFFIX(w, to + i, sums + SHARED_PLACE[k], k)


def follow_lengths_SUFFIX(w: Array, stage: int) -> None:
    """Find the strains, their lengths and the gaps, and factor the derivative of the gaps by the sums."""
    arms = ARMS + N_BORDER * N_STRAINS * stage
    closing = N_BORDER * N_BORDER * stage
    combine_strains_SUFFIX(w, STRAIN, UNKNOWN, SUMS)
    start_routes_SUFFIX(w)
    follow_all_SUFFIX(w)
    for m in range(N_BORDER):
        clear_number_SUFFIX(w, GAPS + m)
        for k in range(HELD_FIRST[m], HELD_FIRST[m + 1]):
            add_gap_SUFFIX(w, m, HELD_PLACE[k], k)
        for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
            clear_number_SUFFIX(w, arms + N_STRAINS * m + i)
            for k in range(HELD_FIRST[m], HELD_FIRST[m + 1]):
                add_held_SUFFIX(w, arms + N_STRAINS * m + i, LENGTH_SLOPES + N_STRAINS * ROW_OF_MUSCLE[HELD_PLACE[k]] + i, k)
        for n in range(N_BORDER):
            clear_number_SUFFIX(w, CLOSING + closing + N_BORDER * m + n)
        for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
            for k in range(SHARED_FIRST[i], SHARED_FIRST[i + 1]):
                add_shared_SUFFIX(w, CLOSING + closing + N_BORDER * m + SHARED_PLACE[k], arms + N_STRAINS * m + i, k)
    factor_closing_SUFFIX(w, closing)


def close_lengths_SUFFIX(w: Array, stage: int) -> None:
    """Find the strains that have the given lengths."""
    for step in range(N_CLOSINGS):
        follow_lengths_SUFFIX(w, stage)
        solve_closing_SUFFIX(w, N_BORDER * N_BORDER * stage)
        for m in range(N_BORDER):
            close_gap_SUFFIX(w, m)
    follow_lengths_SUFFIX(w, stage)
    for m in range(N_BORDER):
        judge_gap_SUFFIX(w, m)


def hold_lengths_SUFFIX(w: Array, to: int, coordinates: int, given: int, stage: int) -> None:
    """Combine strains from rates of the free coordinates and of the lengths."""
    for m in range(N_BORDER):
        clear_number_SUFFIX(w, GAPS + m)
    combine_strains_SUFFIX(w, to, coordinates, GAPS)
    for m in range(N_BORDER):
        for k in range(HELD_FIRST[m], HELD_FIRST[m + 1]):
            add_held_SUFFIX(w, GAPS + m, given + HELD_PLACE[k], k)
        for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
            take_product_SUFFIX(w, GAPS + m, ARMS + N_STRAINS * (N_BORDER * stage + m) + i, to + i)
    solve_closing_SUFFIX(w, N_BORDER * N_BORDER * stage)
    for i in range(N_STRAINS):
        for k in range(SHARED_FIRST[i], SHARED_FIRST[i + 1]):
            add_shared_SUFFIX(w, to + i, GAPS + SHARED_PLACE[k], k)


def follow_actuators_SUFFIX(w: Array, stage: int) -> None:
    """Find strains, rates and accelerations that have the given lengths."""
    close_lengths_SUFFIX(w, stage)
    for i in range(N_STRAINS):
        clear_pull_SUFFIX(w, i)
    bar_SUFFIX(w)
    hold_lengths_SUFFIX(w, STRAIN_RATE, RATE, MOTOR_VELOCITIES + N_JOINTS, stage)
    clear_swerving_SUFFIX(w)
    swerve_all_SUFFIX(w)
    for m in range(N_LENGTHS):
        steady_SUFFIX(w, m)
    hold_lengths_SUFFIX(w, STRAIN_CHANGE, ACCELERATION, SWERVES, stage)


def find_dampers_SUFFIX(w: Array, stage: int) -> None:
    """Find the torques of the dampers on the free coordinates."""
    for i in range(N):
        clear_number_SUFFIX(w, DAMPERS + N_STAGES * i + stage)
    for i in range(N_STRAINS):
        clear_number_SUFFIX(w, DAMPER)
        for k in range(FREE_FIRST[i], FREE_FIRST[i + 1]):
            add_free_SUFFIX(w, DAMPER, RATES + N_STAGES * FREE_PLACE[k] + stage, k)
        find_damper_SUFFIX(w, i)
        for k in range(FREE_FIRST[i], FREE_FIRST[i + 1]):
            add_free_SUFFIX(w, DAMPERS + N_STAGES * FREE_PLACE[k] + stage, DAMPER, k)


def find_multipliers_SUFFIX(w: Array, stage: int) -> None:
    """Find what holds the lengths: it leaves no torque on the held sums."""
    closing = N_BORDER * N_BORDER * stage
    for m in range(N_BORDER):
        clear_number_SUFFIX(w, GAPS + m)
    for i in range(N_STRAINS):
        for k in range(SHARED_FIRST[i], SHARED_FIRST[i + 1]):
            add_shared_SUFFIX(w, GAPS + SHARED_PLACE[k], TORQUES + N_STAGES * i + stage, k)
    for m in range(N_BORDER):
        for j in range(m):
            reduce_closing_SUFFIX(w, m, closing + N_BORDER * j + m, j)
        scale_closing_SUFFIX(w, m, closing + (N_BORDER + 1) * m)
    for k in range(N_BORDER):
        row = N_BORDER - 1 - k
        for j in range(row + 1, N_BORDER):
            reduce_closing_SUFFIX(w, row, closing + N_BORDER * j + row, j)


def find_pulls_SUFFIX(w: Array) -> None:
    """Find the tensions of the actuators from the multipliers."""
    for m in range(N_LENGTHS):
        clear_number_SUFFIX(w, PULLED + m)
    for m in range(N_BORDER):
        for k in range(HELD_FIRST[m], HELD_FIRST[m + 1]):
            add_held_SUFFIX(w, PULLED + HELD_PLACE[k], GAPS + m, k)


def free_torques_SUFFIX(w: Array, stage: int) -> None:
    """Take what holds the lengths from the torques out of balance, and add those of the dampers."""
    arms = ARMS + N_BORDER * N_STRAINS * stage
    find_multipliers_SUFFIX(w, stage)
    for m in range(N_BORDER):
        for i in range(BORDER_FIRST[m], BORDER_LAST[m]):
            take_product_SUFFIX(w, TORQUES + N_STAGES * i + stage, arms + N_STRAINS * m + i, GAPS + m)
    for i in range(N):
        for k in range(ELASTIC_FIRST[i], ELASTIC_FIRST[i + 1]):
            add_elastic_SUFFIX(w, TORQUES + N_STAGES * ELASTIC_PLACE[k] + stage, DAMPERS + N_STAGES * i + stage, k)


def free_corrections_SUFFIX(w: Array) -> None:
    """Find the corrections of the free coordinates from those of the strains."""
    for stage in range(N_STAGES):
        for i in range(N):
            clear_number_SUFFIX(w, CORRECTION + N * stage + i)
            for k in range(ELASTIC_FIRST[i], ELASTIC_FIRST[i + 1]):
                add_elastic_SUFFIX(w, CORRECTION + N * stage + i, STRAIN_CORRECTION + N_STRAINS * stage + ELASTIC_PLACE[k], k)


'''
"""Loops over strains, sums and lengths."""


def length_tables(plan: MotionPlan, routes: MotionRoutes) -> dict[str, object]:
    """Return the tables and places of `LENGTHS`."""
    given, chain = routes.lengths, plan.unknowns.chain
    tables = sparse("FREE", given.free) | sparse("SHARED", given.shares) | sparse("HELD", given.slopes)
    tables |= sparse("ELASTIC", given.elastic)
    names = (
        "strain",
        "strain_rate",
        "strain_change",
        "damper",
        "dampers",
        "sums",
        "gaps",
        "closing",
        "swerves",
        "arms",
    )
    tables |= {name.upper(): getattr(routes, name) for name in names}
    return tables | {
        "ROW_OF_MUSCLE": tuple(routes.stretched.index(one) for one in range(len(chain.actuators))),
        "PULLED": routes.routes.pulled,
        "LENGTH_REST": tuple(chain.muscle_paths.rest.tolist()),
        "LENGTH_SLOPES": routes.slopes,
        "TORQUES": routes.torques,
        "STRAIN_CORRECTION": routes.correction,
        "N_CLOSINGS": 1 if given.linear else _CLOSINGS,
        "N_LENGTHS": len(chain.actuators),
        "N_JOINTS": chain.n_motors,
    }


def keep_swerves(routes: MotionRoutes, number: int, segment: Segment) -> Block:
    """Trace the function at the tip of the segment of this number: accelerations of its lengths at constant rates."""
    block = Block(f"keep_swerves_{number}", "Keep the accelerations of the lengths of a segment.")
    for place, muscle in enumerate(segment.muscles):
        block.store(routes.swerves + muscle, block.load(routes.swerving + place))
        block.store(routes.swerving + place, 0.0)
    return block


def held_blocks(plan: MotionPlan, routes: MotionRoutes) -> list[Block]:
    """Trace the functions that `LENGTHS` calls."""
    layout, chain = plan.layout, plan.unknowns.chain
    clear = Block("clear_number", "Clear a number.", ("at",))
    clear.store(0, 0.0, "at")
    adding = []
    for name in ("free", "shared", "held", "elastic"):
        add = Block(f"add_{name}", "Add a number times an entry of a matrix.", ("to", "source", "row"))
        add.store(0, add.load(0, "to") + add.load(0, "source") * add.table(name.upper(), 0, "row"), "to")
        adding.append(add)
    gap = Block("add_gap", "Add what a length misses.", ("m", "muscle", "row"))
    rest = gap.table("LENGTH_REST", 0, "muscle")
    missed = gap.load(routes.routes.changes, "muscle") - (gap.load(chain.n_motors, "muscle") - rest)
    gap.store(routes.gaps, gap.load(routes.gaps, "m") + missed * gap.table("HELD", 0, "row"), "m")
    close = Block("close_gap", "Correct a held sum.", ("m",))
    close.store(routes.sums, close.load(routes.sums, "m") - close.load(routes.gaps, "m"), "m")
    judge = Block("judge_gap", "Let a step fail whose lengths the robot cannot have.", ("m",))
    margin = routes.routes.margin
    judge.store(margin, smaller(judge.load(margin), _CLOSED - absolute(judge.load(routes.gaps, "m"))))
    product = Block("take_product", "Subtract the product of two numbers.", ("to", "one", "other"))
    product.store(0, product.load(0, "to") - product.load(0, "one") * product.load(0, "other"), "to")
    begin = Block("clear_swerving", "Begin at the base.")
    begin.store_all(routes.swerving, [0.0] * max(len(one.muscles) for one in routes.routes.segments))
    steady = Block("steady", "Take the acceleration at constant rates from that of a given length.", ("m",))
    acceleration = steady.load(layout.motor_accelerations + chain.n_motors, "m")
    steady.store(routes.swerves, acceleration - steady.load(routes.swerves, "m"), "m")
    damper = Block("find_damper", "Find the torque of a damper from the rate of its strain.", ("i",))
    damper.store(routes.damper, damper.load(layout.damping, "i") * damper.load(routes.damper))
    closing = factor_blocks("closing", routes.closing, routes.gaps, routes.rows)
    return [clear, *adding, gap, close, judge, product, begin, steady, damper, *closing]
