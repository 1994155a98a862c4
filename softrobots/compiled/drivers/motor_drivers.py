"""Load estimation and inverse kinematics on top of the straight-line code; kernel language, see `equilibrium_drivers`.

First Newton's method on all unknowns at once. Where that fails a search follows: the springs settle by descent at every step,
and the force or the motors take damped steps (Levenberg-Marquardt) that are kept only if the error decreases.
"""

from __future__ import annotations

from softrobots.compiled.drivers.equilibrium_drivers import descend, go_to_start, is_usable
from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array
from softrobots.compiled.settings import *


def look(w: Array, varied: int) -> None:
    """Evaluate a search for the motors (`varied` is 0) or for the force (`varied` is its place)."""
    if varied == 0:
        look_for_target(w)
    else:
        look_for_force(w)


def missing_square(w: Array, varied: int) -> float:
    """Return the squared distance or torque that a search decreases; of poses with the angle times the lever."""
    if varied == 0:
        return w[MISSING] + LEVER * LEVER * REACH * REACH * w[TURNED]
    return w[MISSING]


def squared_tolerance(w: Array, varied: int) -> float:
    """Return the squared distance or torque at which a search ends."""
    if varied == 0:
        return w[TOLERATED] * w[TOLERATED]
    size = LEAST_SIZE * LEAST_SIZE
    total = 0.0
    for i in range(N_MOTORS):
        total += w[TORQUES + i] * w[TORQUES + i]
    if total > LARGEST_SIZE * LARGEST_SIZE:
        return -1.0  # never
    if total > size:
        size = total
    return TOLERANCE * TOLERANCE * size


def is_found(w: Array, varied: int) -> bool:
    """Tell whether a search is at its end: within the tolerances."""
    if varied == 0 and w[TURNED] > ANGLE_TOLERANCE * ANGLE_TOLERANCE:
        return False
    return w[MISSING] <= squared_tolerance(w, varied)


def step_within_limits(w: Array, varied: int, count: int) -> None:
    """Store the point and take the damped step; motors stop at their limits."""
    for i in range(count):
        w[PREVIOUS + i] = w[varied + i]
        w[varied + i] = w[NEXT_POINT + i]
        if varied == 0:
            if w[i] < LOWER[i]:
                w[i] = LOWER[i]
            if w[i] > UPPER[i]:
                w[i] = UPPER[i]
    for i in range(N):
        w[PREVIOUS + N_VARIED + i] = w[UNKNOWN + i]
        w[UNKNOWN + i] = w[NEXT_POINT + N_VARIED + i]


def keep_point(w: Array) -> None:
    """Store motors and unknowns as the previous point."""
    for i in range(N_MOTORS):
        w[PREVIOUS + i] = w[i]
    for i in range(N):
        w[PREVIOUS + N_VARIED + i] = w[UNKNOWN + i]


def take_step(w: Array) -> None:
    """Take the last step to a target."""
    for i in range(N_MOTORS):
        w[i] = w[NEXT_POINT + i]
    for i in range(N):
        w[UNKNOWN + i] = w[NEXT_POINT + N_VARIED + i]


def go_back(w: Array, varied: int, count: int) -> None:
    """Return to the previous point."""
    for i in range(count):
        w[varied + i] = w[PREVIOUS + i]
    for i in range(N):
        w[UNKNOWN + i] = w[PREVIOUS + N_VARIED + i]


def within_limits(w: Array, varied: int) -> int:
    """Return the status of motors that were searched for."""
    if varied == 0:
        for i in range(N_MOTORS):
            if w[i] < LOWER[i] - 1e-9 or w[i] > UPPER[i] + 1e-9:
                return BEYOND_LIMITS
    return CERTIFIED


def estimated(w: Array) -> int:
    """Return the status of a force that explains the motor torques."""
    if w[OBSERVED] < OBSERVABLE * OBSERVABLE * REACH * REACH:
        return UNOBSERVABLE
    return CERTIFIED


def search(w: Array, varied: int, count: int) -> int:
    """Search for the force or the motors from the point in the workspace; return the status."""
    prepare(w)
    status = descend(w)
    if varied > 0:
        prepare_force(w)
    damping = 0.03 * REACH
    least = 0.0
    for _ in range(SEARCH_STEPS):
        w[DAMPING] = damping
        look(w, varied)
        if status > UNSTABLE or is_found(w, varied) or damping > 1e3 * REACH:
            break
        if w[OBSERVED] < OBSERVABLE * OBSERVABLE * REACH * REACH:
            least = OBSERVABLE * REACH
        missing = missing_square(w, varied)
        step_within_limits(w, varied, count)
        prepare(w)
        status = descend(w)
        look(w, varied)
        if status == CERTIFIED and missing_square(w, varied) < missing:
            damping *= 0.1
            if damping < 1e-7 * REACH:
                damping = 0.0
            if damping < least:
                damping = least
        else:
            go_back(w, varied, count)
            prepare(w)
            status = descend(w)
            damping *= 10.0
            if damping < 1e-6 * REACH:
                damping = 1e-6 * REACH
    if status != CERTIFIED:
        return status
    if (
        varied > 0
        and estimated(w) != CERTIFIED
        and w[MISSING] * TOLERANCE * TOLERANCE <= HIDDEN * HIDDEN * squared_tolerance(w, varied)
    ):
        return UNOBSERVABLE
    if not is_found(w, varied):
        return NOT_REACHED
    return within_limits(w, varied)


def estimate(w: Array) -> int:
    """Find the force that explains the motor torques in the workspace; return the status."""
    for i in range(3):
        w[FORCE + i] = 0.0
    if not is_usable(w):
        return NOT_A_NUMBER
    first_force_pass(w)
    for _ in range(FORCE_PASSES):
        if w[MODE] > 0.5:
            break
        force_pass(w)
    if w[MODE] > 0.5 and w[MODE] < 1.5:
        return estimated(w)
    for i in range(3):
        w[FORCE + i] = 0.0
    prepare(w)
    go_to_start(w)
    return search(w, FORCE, 3)


def step_to_target(w: Array) -> bool:
    """Newton's method towards the target; tell whether it arrived. `NEXT_POINT` becomes the step to the next target."""
    w[MODE] = 0.0
    for _ in range(PASSES):
        target_step(w)
        if w[MODE] > 0.5:
            break
        take_step(w)
    return w[MODE] > 0.5 and w[MODE] < 1.5 and within_limits(w, 0) == CERTIFIED


def reach(w: Array) -> int:
    """Find motors that put the tip at the target, from the motors in the workspace; return the status."""
    if not is_usable(w):
        return NOT_A_NUMBER
    keep_point(w)
    for i in range(TARGET_SIZE):
        w[NEXT_TARGET + i] = w[TARGET + i]
    if step_to_target(w):
        return CERTIFIED
    go_back(w, 0, N_MOTORS)
    return search(w, 0, N_MOTORS)
