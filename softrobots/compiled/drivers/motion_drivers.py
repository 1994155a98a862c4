"""Steps of time by the implicit midpoint rule or of fourth order, and runs of many.

Functions in the kernel language, see `softrobots.compiled.drivers.equilibrium_drivers`; the equations of a step are in
`softrobots.compiled.motion.time_step` and `softrobots.compiled.program.motion_parts`.
"""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, where
from softrobots.compiled.motion_settings import *


def settle_middle(w: Array) -> bool:
    """Find the accelerations of a step; tell whether the corrections converge.

    The first correction takes the factors of the step before: those of the extrapolated point would have its forces, which are
    wrong where stiff springs ring. Those of a point that was coasted to are nearly right.
    """
    choose_order(w)
    for i in range(N):
        guess_unknown(w, i)
    if w[COASTS] > 0.5:
        motion_coast(w)
        for i in range(N):
            apply_correction(w, i)
    if w[N_HISTORY] < 0.5 or w[COASTS] > 0.5:
        motion_factor(w)
    else:
        motion_correct(w)
    w[LAST_CHANGE] = 1e300
    for step in range(MOTION_CORRECTIONS):
        w[CHANGE] = 0.0
        for i in range(N):
            apply_correction(w, i)
        judge_corrections(w)
        if w[SETTLED] > 0.5:
            return True
        if w[CHANGE] > 1e3 * w[LAST_CHANGE]:
            return False
        slow = w[CHANGE] > RENEW_SHARE * w[LAST_CHANGE]
        w[LAST_CHANGE] = w[CHANGE]
        w[COUPLED] = where(slow, 1.0, w[COUPLED])
        if slow or (step == 0 and w[COASTS] < 0.5):
            motion_factor(w)
        else:
            motion_correct(w)
    return w[CHANGE] < MOTION_LEFT


def finish_step(w: Array) -> None:
    """Go to the end of a step."""
    for i in range(N):
        finish_unknown(w, i)


def motion_step(w: Array) -> int:
    """Move the robot by one step of time: POSITION and VELOCITY become those at its end.

    MOTORS_BEGIN, MOTORS_MIDDLE and MOTORS_END are the motors at its beginning,
    in its middle and at its end; FORCE acts in its middle. A step whose corrections do
    not converge begins anew without a guess, then halved, and again. Returns the status.
    """
    whole = w[TIME_STEP]
    w[WHOLE_STEP] = whole
    for i in range(N):
        w[BEGIN_POSITION + i] = w[POSITION + i]
        w[BEGIN_VELOCITY + i] = w[VELOCITY + i]
    done = 0.0
    part = 1.0
    while done < 1.0:
        w[PARTS] += 1.0
        w[TIME_STEP] = part * whole
        w[SHARE] = done + 0.5 * part
        for i in range(N_MOTORS):
            place_motor(w, i)
        motion_prepare(w)
        if fabs(w[TIME_STEP] - w[LAST_STEP]) > 1e-9 * w[TIME_STEP]:
            w[N_HISTORY] = 0.0
            w[LAST_STEP] = w[TIME_STEP]
        if settle_middle(w):
            finish_step(w)
            w[N_HISTORY] += 1.0
            done += part
        else:
            if w[N_HISTORY] < 0.5:  # else a worse guess than none may have made it fail
                part *= 0.5
            w[N_HISTORY] = 0.0
            w[FAILED] = 1.0
            if part < LEAST_PART:
                w[TIME_STEP] = whole
                return UNSETTLED
    w[TIME_STEP] = whole
    return CERTIFIED


def place_at(w: Array, share: float) -> None:
    """Write UNKNOWN, RATE, motors and TIP at a share of the step that was taken last."""
    w[SHARE] = share
    for i in range(N):
        interpolate_unknown(w, i)
    for i in range(N_MOTORS):
        place_motor(w, i)
    motion_tip(w)


def motion_run(
    w: Array,
    motors: Array,
    motor_rows: int,
    forces: Array,
    force_rows: int,
    grid: Array,
    n_steps: int,
    times: Array,
    n_times: int,
    out: Array,
) -> int:
    """Take many steps, and write the motion at given times; return the status of the last step.

    grid: the ends of the steps, the first included, (n_steps + 1);
    motors: motors at the beginning, in the middle and at the end of the steps, one row
        after the other, (2 n_steps + 1, N_MOTORS), or one row, if motor_rows is 1;
    forces: forces in the middles, (n_steps, 3), or one row, if force_rows is 1;
    times: ascending, within the grid, (n_times);
    out: a row is UNKNOWN, RATE and TIP at one of them, (n_times, 2 N + 3).
    """
    by_step = 0
    if motor_rows > 1:
        by_step = N_MOTORS
    row = 0
    for step in range(n_steps):
        for i in range(N_MOTORS):
            w[MOTORS_BEGIN + i] = motors[2 * step * by_step + i]
            w[MOTORS_MIDDLE + i] = motors[(2 * step + 1) * by_step + i]
            w[MOTORS_END + i] = motors[(2 * step + 2) * by_step + i]
        if force_rows > 1 or step == 0:
            for i in range(3):
                w[FORCE + i] = forces[3 * step + i]
        length = grid[step + 1] - grid[step]
        w[TIME_STEP] = length
        status = motion_step(w)
        if status != CERTIFIED:
            return status
        if w[MOST_PARTS] > 0.0 and w[PARTS] > w[MOST_PARTS]:
            return UNSETTLED
        while row < n_times and (times[row] <= grid[step + 1] or step == n_steps - 1):
            share = (times[row] - grid[step]) / length
            if share > 1.0 - 1e-9:
                share = 1.0
            place_at(w, share)
            for i in range(N):
                out[row * (2 * N + 3) + i] = w[UNKNOWN + i]
                out[row * (2 * N + 3) + N + i] = w[RATE + i]
            for i in range(3):
                out[row * (2 * N + 3) + 2 * N + i] = w[TIP + i]
            row += 1
    return CERTIFIED
