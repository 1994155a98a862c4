"""Path following with the tip, waypoint by waypoint; kernel language, see `equilibrium_drivers`."""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, where
from softrobots.compiled.drivers.motor_drivers import go_back, keep_point, reach, step_to_target


def is_near(w: Array, place: int) -> bool:
    """Tell whether all motors are within a radian of those at a place: another elbow or turn would be farther."""
    furthest = 0.0
    for i in range(N_MOTORS):
        if fabs(w[i] - w[place + i]) > furthest:
            furthest = fabs(w[i] - w[place + i])
    return furthest <= 1.0


def predict(w: Array) -> None:
    """Predict the next waypoint: the last step plus the correction of the step before, accurate to third order."""
    for i in range(N_MOTORS):
        w[PREDICTED + i] = w[NEXT_POINT + i]
        w[i] = w[NEXT_POINT + i] + w[CORRECTION + i]
    for i in range(N):
        w[PREDICTED + N_VARIED + i] = w[NEXT_POINT + N_VARIED + i]
        w[UNKNOWN + i] = w[NEXT_POINT + N_VARIED + i] + w[CORRECTION + N_VARIED + i]


def correct(w: Array, share: float) -> None:
    """Store a share of the prediction error as correction of the next step."""
    for i in range(N_MOTORS):
        w[CORRECTION + i] = share * (w[i] - w[PREDICTED + i])
    for i in range(N):
        w[CORRECTION + N_VARIED + i] = share * (w[UNKNOWN + i] - w[PREDICTED + N_VARIED + i])


def step_in_parts(w: Array, targets: Array, last: int, row: int) -> bool:
    """Move from the last reached waypoint to this one through intermediate points; tell whether it arrived.

    `PREDICTED` keeps the motors at the last intermediate point.
    """
    for doubling in range(1, 7):
        parts = 1
        for _ in range(doubling):
            parts *= 2
        go_back(w, 0, N_MOTORS)
        for i in range(N_MOTORS):
            w[PREDICTED + i] = w[i]
        arrived = True
        for part in range(1, parts + 1):
            for i in range(
                TARGET_SIZE
            ):  # axes between two orientations lead to the turn halfway, though they are not of length 1
                begin = targets[TARGET_SIZE * last + i]
                w[TARGET + i] = begin + (targets[TARGET_SIZE * row + i] - begin) * part / parts
                w[NEXT_TARGET + i] = w[TARGET + i]
            if not step_to_target(w) or not is_near(w, PREDICTED):
                arrived = False
                break
            for i in range(N_MOTORS):
                w[PREDICTED + i] = w[i]
        if arrived:
            return True
    return False


def follow(
    w: Array, targets: Array, count: int, motors: Array, unknowns: Array, residuals: Array, errors: Array, statuses: Array
) -> int:
    """Move the tip through `count` targets, each from the last; return how many it reached.

    Motors and unknowns in the workspace are the start; a target is `TARGET_SIZE` numbers.
    Results of each waypoint go into the arrays: `N_MOTORS` motors, `N` unknowns,
    the squared residual, the squared distance from the target (and of poses TURNED), the status.
    """
    reached = 0
    last = 0
    predicted = 0
    for row in range(count):
        following = row + 1
        if following == count:
            following = row
        for i in range(TARGET_SIZE):
            w[TARGET + i] = targets[TARGET_SIZE * row + i]
            w[NEXT_TARGET + i] = targets[TARGET_SIZE * following + i]
        if row == 0:
            status = reach(w)
            target_step(w)
            correct(w, 0.0)
        else:
            status = CERTIFIED
            if step_to_target(w) and is_near(w, PREVIOUS):
                correct(w, where(predicted > 1, 1.0, 0.0))
            else:
                correct(w, 0.0)
                if not step_in_parts(w, targets, last, row):
                    predicted = 0
                    status = NOT_REACHED
                    go_back(w, 0, N_MOTORS)
                for i in range(TARGET_SIZE):
                    w[TARGET + i] = targets[TARGET_SIZE * row + i]
                    w[NEXT_TARGET + i] = targets[TARGET_SIZE * following + i]
                w[MODE] = 0.0
                target_step(w)
        for i in range(N_MOTORS):
            motors[N_MOTORS * row + i] = w[i]
        for i in range(N):
            unknowns[N * row + i] = w[UNKNOWN + i]
        residuals[row] = w[ERROR]
        errors[N_ERRORS * row] = w[MISSING]
        if N_ERRORS == 2:
            errors[N_ERRORS * row + 1] = w[TURNED]
        statuses[row] = status
        if status == CERTIFIED:
            reached += 1
            predicted += 1
            last = row
            keep_point(w)
            predict(w)
    return reached
