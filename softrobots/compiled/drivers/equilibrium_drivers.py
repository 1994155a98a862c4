"""What generated code does with its evaluations: Newton passes, and descent on the energy for cases that they do not settle.

Functions in the kernel language. Their text goes into every generated module as it stands here, behind the constants and
functions that are declared first; so one text is run by Python, compiled for single cases and for lanes, and translated to C.
"""

from __future__ import annotations

from collections.abc import Callable

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, sqrt
from softrobots.compiled.settings import *


def is_usable(w: Array) -> bool:
    """Tell whether motors and load are numbers that can be computed with."""
    for i in range(N_MOTORS):
        if not fabs(w[i]) <= LARGEST_POSITION:
            return False
    for i in range(3):
        if not fabs(w[FORCE + i]) <= LARGEST_NUMBER:
            return False
        if not fabs(w[GRAVITY + i]) <= LARGEST_NUMBER:
            return False
    return True


def is_settled(w: Array, tolerance: float) -> bool:
    """Tell whether the residual is within a relative tolerance, or within the rounding of the spring torques."""
    return w[ERROR] <= tolerance * tolerance * w[SIZE] or w[ERROR] <= SPRING_ROUNDING * SPRING_ROUNDING


def is_stable(w: Array) -> bool:
    """Tell whether all pivots of springs are clearly positive, and those of the multipliers negative: one for each."""
    return (
        w[MIN_PIVOT] > POSITIVE_PIVOT
        and w[N_NEGATIVE_PIVOTS] - N_CONSTRAINTS < 0.5
        and N_CONSTRAINTS - w[N_NEGATIVE_PIVOTS] < 0.5
    )


def move(w: Array, share: float) -> None:
    """Go a share of the way from where a line search started."""
    for i in range(N):
        w[UNKNOWN + i] = w[LINE_ORIGIN + i] + share * w[LINE_DIRECTION + i]


def keep(w: Array) -> None:
    """Remember the unknowns and their step, for a line search."""
    for i in range(N):
        w[LINE_ORIGIN + i] = w[UNKNOWN + i]
        w[LINE_DIRECTION + i] = w[STEP + i]


def leave_saddle(w: Array) -> None:
    """Go away from an unstable equilibrium in a direction of no symmetry, soft springs more, without changing held sums."""
    keep(w)
    for i in range(N):
        w[LINE_DIRECTION + i] = 0.1 * SOFTNESS[i] * (1.0 + 0.3 * i / N)
    for group in range(N_CONSTRAINTS):
        total = 0.0
        count = 0
        for i in range(N):
            if GROUP[i] == group:
                total += w[LINE_DIRECTION + i]
                count += 1
        for i in range(N):
            if GROUP[i] == group:
                w[LINE_DIRECTION + i] -= total / count
    move(w, 1.0)


def outcome(w: Array) -> int:
    """Return the status of the point that was evaluated last."""
    if w[ENERGY] - w[ENERGY] != 0.0 or not w[SIZE] < 1e300:
        return NOT_A_NUMBER  # infinite, too: of a load whose square is infinite every residual is a small part
    if w[RANGE_MARGIN] < 0.0:
        return OUT_OF_RANGE
    if not is_settled(w, TOLERANCE):
        return UNSETTLED
    if not is_stable(w):
        return UNSTABLE
    return CERTIFIED


def search_line(w: Array, longest: float) -> bool:
    """Go along the step as far as the energy falls (Armijo); tell whether anything is gained by it.

    And go on, twice as far each time, while it goes on falling and the way is shorter than `longest`.
    """
    keep(w)
    energy = w[ENERGY]
    slope = w[SLOPE]
    error = w[ERROR]
    rounding = w[ROUNDING]
    length = sqrt(w[LENGTH])
    share = 1.0
    if length > LARGEST_STEP:
        share = LARGEST_STEP / length
    slope *= share
    largest = share
    move(w, share)
    evaluate(w)
    while not w[ENERGY] <= energy + ARMIJO * slope + rounding and share > 1e-12 * largest:
        share *= 0.5
        slope *= 0.5
        move(w, share)
        evaluate(w)
    if not w[ENERGY] <= energy + rounding or (-slope < rounding and not w[ERROR] < error):
        move(w, 0.0)  # nothing is gained
        evaluate(w)
        return False
    while 2.0 * share * length < longest:
        reached = w[ENERGY]
        move(w, 2.0 * share)
        evaluate(w)
        if not w[ENERGY] < reached - rounding:
            move(w, share)
            evaluate(w)
            break
        share *= 2.0
    return True


def cross_valley(w: Array) -> bool:
    """Take a guarded step for the residual alone: at the bottom of a curved valley a whole one leads out of it again."""
    error = w[ERROR]
    w[PIVOT_SHIFT] = SMALL_PIVOT_SHIFT
    evaluate(w)
    w[PIVOT_SHIFT] = 0.0
    keep(w)
    move(w, 1.0)
    evaluate(w)
    if w[ERROR] < error:
        return True
    move(w, 0.0)
    evaluate(w)
    return False


def descend(w: Array) -> int:
    """Newton descent on the energy from the unknowns in the workspace; return the status.

    Where pivots are not positive they are made so: by turns hardly, which is quick near a neutral equilibrium, and by the
    springs' own stiffness, as pivots behind a tiny one are huge. A step that does not lower the energy is halved; a
    short one with pivots made positive is doubled while that lowers the energy, as beside a saddle it leads hardly away.
    Where nothing is gained any more although it is not stable, the saddle is left like one that it has settled on. It ends
    in a stable equilibrium unless there is none, a section comes to the end of its range, or the steps are spent.
    """
    saddles = 0
    strong = 0
    w[PIVOT_SHIFT] = 0.0
    w[ITERATIONS] = 0.0
    evaluate(w)
    for _ in range(DESCENT_STEPS):
        w[ITERATIONS] += 1.0
        stable = is_stable(w)
        if is_settled(w, NEWTON_TOLERANCE):
            if stable or saddles == 3:
                break
            saddles += 1
            leave_saddle(w)
            evaluate(w)
        else:
            longest = 0.0
            if not stable:
                w[PIVOT_SHIFT] = SMALL_PIVOT_SHIFT
                if strong > 0:
                    w[PIVOT_SHIFT] = LARGE_PIVOT_SHIFT
                strong = 1 - strong
                evaluate(w)
                w[PIVOT_SHIFT] = 0.0
                if w[LENGTH] < SHORT_STEP * SHORT_STEP:
                    longest = LARGEST_STEP
            if not search_line(w, longest):
                if stable:
                    if not cross_valley(w):
                        break
                elif saddles == 3:
                    break
                else:
                    saddles += 1
                    leave_saddle(w)
                    evaluate(w)
    return outcome(w)


def go_to_start(w: Array) -> None:
    """Put the unknowns where the springs are relaxed, or as given where muscle lengths hold sums of them."""
    for i in range(N):
        if N_CONSTRAINTS > 0:
            w[UNKNOWN + i] = w[START + i]
        else:
            w[UNKNOWN + i] = REST[i]


def settle_from(w: Array) -> int:
    """Descend from given unknowns."""
    if not is_usable(w):
        return NOT_A_NUMBER
    prepare(w)
    return descend(w)


def settle(w: Array) -> int:
    """Find the equilibrium from rest: Newton passes while they go well, else descent from rest; return the status."""
    if not is_usable(w):
        return NOT_A_NUMBER
    if N_CONSTRAINTS > 0:
        go_to_start(w)
    first_pass(w)
    for _ in range(PASSES):
        if w[MODE] > 0.5:
            break
        newton_pass(w)
    if w[MODE] > 0.5 and w[MODE] < 1.5:
        return CERTIFIED
    go_to_start(w)
    return descend(w)


FUNCTIONS: tuple[Callable[..., object], ...] = (
    is_usable,
    is_settled,
    is_stable,
    move,
    keep,
    leave_saddle,
    outcome,
    search_line,
    cross_valley,
    descend,
    go_to_start,
    settle_from,
    settle,
)
"""All of them, each behind those that it uses."""
