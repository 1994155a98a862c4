"""Newton passes, and descent on the energy for the cases that they do not solve.

Functions in the kernel language. Their text goes into every generated module behind its constants and straight-line functions
(`generated_names`); the same text is run by Python, compiled for single cases and for lanes, and translated to C.
"""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, sqrt
from softrobots.compiled.settings import *


def is_usable(w: Array) -> bool:
    """Tell whether motors and load are finite and not too large to compute with, and actuators take their inputs."""
    for i in range(N_MOTORS):
        if not fabs(w[i]) <= LARGEST_POSITION:
            return False
    for i in range(N_INPUTS):
        if not (w[ACTUATORS + i] >= LEAST_INPUT[i] and w[ACTUATORS + i] <= LARGEST_NUMBER):
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


def is_above(w: Array, least: float) -> bool:
    """Tell whether all pivots of springs are larger than the least, and those of the constraints are negative."""
    return w[MIN_PIVOT] > least and w[N_NEGATIVE_PIVOTS] - N_CONSTRAINTS < 0.5 and N_CONSTRAINTS - w[N_NEGATIVE_PIVOTS] < 0.5


def is_stable(w: Array) -> bool:
    """Tell whether all pivots of springs are positive."""
    return is_above(w, POSITIVE_PIVOT)


def is_neutral(w: Array) -> bool:
    """Tell whether a pivot of a spring is zero, and none is negative."""
    return w[MIN_PIVOT] <= POSITIVE_PIVOT and is_above(w, -1.0)


def move(w: Array, share: float) -> None:
    """Move the unknowns a share of the way along a line search."""
    for i in range(N):
        w[UNKNOWN + i] = w[LINE_ORIGIN + i] + share * w[LINE_DIRECTION + i]


def keep(w: Array) -> None:
    """Store the unknowns and their step as origin and direction of a line search."""
    for i in range(N):
        w[LINE_ORIGIN + i] = w[UNKNOWN + i]
        w[LINE_DIRECTION + i] = w[STEP + i]


def leave_saddle(w: Array) -> None:
    """Move away from an unstable equilibrium in an asymmetric direction, soft springs more, at constant constrained sums."""
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
        return NOT_A_NUMBER  # also infinite: every residual is small beside an infinite load
    if w[RANGE_MARGIN] < 0.0:
        return OUT_OF_RANGE
    if not is_settled(w, TOLERANCE):
        return UNSETTLED
    if is_neutral(w):
        return NEUTRAL
    if not is_stable(w):
        return UNSTABLE
    return CERTIFIED


def search_line(w: Array, longest: float, error: float) -> bool:
    """Search along the step for a lower energy (Armijo); tell whether it or the residual decreased.

    The step is doubled while the energy falls and it stays shorter than `longest`. With given muscle lengths the energy counts
    their gap to second order only, and near the equilibrium its own decrease is smaller than that: there a Newton step at a
    stable point is taken, too, if it halves the residual, whose square `error` is.
    """
    halved = 0.0
    if N_CONSTRAINTS > 0 and is_stable(w):
        halved = 0.25 * error
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
    while not w[ENERGY] <= energy + ARMIJO * slope + rounding and not w[ERROR] < halved and share > 1e-12 * largest:
        share *= 0.5
        slope *= 0.5
        move(w, share)
        evaluate(w)
    if w[ERROR] < halved:
        return True
    if not w[ENERGY] <= energy + rounding or (-slope < rounding and not w[ERROR] < error):
        move(w, 0.0)  # no progress
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
    """Take a step with shifted pivots if it lowers the residual: a full one leaves the bottom of a curved valley again."""
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

    Pivots that are not positive are shifted: by turns to a small value, which is fast near a neutral equilibrium, and to
    several times the springs' own stiffness, since pivots behind a tiny one are huge. A step that does not lower the energy
    is halved; a short step with shifted pivots is doubled while that lowers the energy, since it hardly leaves a saddle. A
    point that is not stable and makes no progress is left like a saddle. The descent ends in a stable or neutral equilibrium
    unless there is none, a section comes to the end of its range, or the largest number of steps is reached. Where it is
    nearly neutral the residual is made as small as it can be: the least pivot is as far from its value as that from zero. At
    the kinks of dry friction the residual may rise again and again: there the least one so far counts.
    """
    error = 1e300
    saddles = 0
    refined = 0
    strong = 0
    w[PIVOT_SHIFT] = 0.0
    w[ITERATIONS] = 0.0
    evaluate(w)
    for _ in range(DESCENT_STEPS):
        w[ITERATIONS] += 1.0
        stable = is_stable(w)
        if is_settled(w, NEWTON_TOLERANCE):
            if is_above(w, CLEARLY_POSITIVE_PIVOT) or saddles == 3:
                break
            if refined < 3 and w[MIN_PIVOT] <= CLEARLY_POSITIVE_PIVOT and cross_valley(w):
                refined += 1
            elif stable or is_neutral(w):
                break
            else:
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
            if N_SLIDERS + N_GUIDES == 0 or w[ERROR] < error:
                error = w[ERROR]
            if not search_line(w, longest, error):
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
    """Set the unknowns to rest, or to `START` where muscle lengths constrain sums of them, or rest is an input."""
    for i in range(N):
        if N_STARTS > 0:
            w[UNKNOWN + i] = w[START + i]
        else:
            w[UNKNOWN + i] = REST[i]
    for i in range(N_CONSTRAINTS):
        w[HELD + i] = 0.0


def settle_from(w: Array) -> int:
    """Find the equilibrium by descent from the unknowns in the workspace; return the status."""
    if not is_usable(w):
        return NOT_A_NUMBER
    prepare(w)
    return descend(w)


def settle(w: Array) -> int:
    """Find the equilibrium from rest by Newton passes, or by descent where they fail; return the status."""
    if not is_usable(w):
        return NOT_A_NUMBER
    if N_CONSTRAINTS + N_SLIDERS > 0:
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
