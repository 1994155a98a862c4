"""The ends of a segment whose muscle lengths are given: its multipliers come in at its tip and are eliminated at its base."""

from __future__ import annotations

from softrobots.compiled.chain.elements import vector
from softrobots.compiled.chain.elimination import release
from softrobots.compiled.chain.passing import Passing, TipPlaces, load_beyond, sides, store_beyond
from softrobots.compiled.chain.unknowns import Unknowns, softness_of
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar


def segment_blocks(unknowns: Unknowns, passing: Passing, segment: int, tip: TipPlaces | None = None) -> tuple[list[Block], int]:
    """Trace what happens at the ends of a segment whose sums are held.

    Args:
        unknowns: The chain.
        passing: Places of what elements pass on.
        segment: Its number.
        tip: For a look at the tip: the places of what that passes on and finds.

    Returns:
        `hold` at its tip, `release` at its base on the way back, `let_go` there on the way out; and the size of the record.
    """
    softness, look = softness_of(unknowns, segment), "" if tip is None else "tip_"
    count = len(softness)
    column_places = sides(passing.column, None if tip is None else tip.column)
    turn_places = sides(passing.turn, None if tip is None else tip.turn)
    hold = Block(f"hold_{look}{segment}", "Begin with the multipliers of a segment: nothing is coupled with them yet.")
    hold.store_all(passing.matrix + 6, [0.0] * (count * (count + 7) // 2))
    if tip is None:
        hold.store_all(passing.gaps, [0.0] * count)
        hold.store_all(passing.held_torques, [0.0] * count)
    for place in column_places:
        hold.store_all(place + 3, [0.0] * count)
    back = Block(f"release_{look}{segment}", "Eliminate the multipliers of a segment.", ("at",))
    given, state = load_beyond(back, passing, 3 + count, tip)
    gaps: list[Scalar] = [0.0] * count
    if tip is None:
        arrived = back.loads(passing.gaps, count)
        state = [*state, *arrived]
        gaps = [*arrived]
    made, beyond = release(given, gaps, softness)
    store_beyond(back, passing, beyond, tip)
    back.store_all(passing.sums + 3, [beyond.softest, beyond.negatives])
    out = Block(f"let_go_{look}{segment}", "Find the multipliers of a segment.", ("at",), back.trace)
    turns = [out.loads(place, 3) for place in turn_places]
    groups = [row for row, one in enumerate(unknowns.segment_of_group) if one == segment]
    sums = out.loads(passing.steps, 3)
    if tip is None:
        totals = back.loads(passing.held_torques, count)
        error: Scalar = sums[1]
        for place, (group, total, gap, soft) in enumerate(zip(groups, totals, gaps, softness, strict=True)):
            out.store(passing.held_torques + place, total * (1.0 / len(unknowns.chain.held[group])))
            torque = gap * (1.0 / soft)  # what closing the gap takes
            error = error + torque * torque
        out.store(passing.steps + 1, error)
        state = [*state, *totals]
    for side, (place, turn) in enumerate(zip(turn_places, turns, strict=True)):
        multipliers = made.steps(side, vector(turn)).tolist()
        out.store_all(place + 3, multipliers)
        if tip is not None:
            found = tip.held_loads if side == 0 else tip.held_columns + (side - 1) * tip.held
            for group, value in zip(groups, multipliers, strict=True):
                out.store(found + group, value)
    arriving = [*(one for turn in turns for one in turn), *sums]
    size = hoist([out], back, arriving, 0, "at", overwritten=state)
    return [hold, back, out], size
