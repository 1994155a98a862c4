r"""Friction of guides in steps of time of `rubbing_motion_drivers`; kernel language.

Friction acts where the strains are displaced to, :math:`Z`, see `softrobots.dynamics.friction_steps`; a guide `g` that sticks,
of friction `L` and stick `s`, adds to the matrix `A` of a step the square of the slopes `b_g` of the length beyond it,

.. math:: A + \sum_g \kappa_g b_g b_g^T, \quad \kappa_g = 4\,\tfrac{h^2}{4} \tfrac{L}{s}, \qquad
    E \leftarrow E - \frac{E b_g\, (E b_g)^T}{1 / \kappa_g + b_g^T E b_g}

where `E` is the inverse, at first that of `A` (Sherman and Morrison 1950; Golub and Van Loan, Matrix Computations, 2013,
section 2.1.4). What friction adds by the curvature of lengths is left out of the matrix, as its change with tensions is.
"""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.guide_drivers import angle_at, mean_decay, turn_at
from softrobots.compiled.drivers.intrinsics import Array, fabs, sqrt


def piece_at(w: Array, place: int, guide: int) -> float:
    """Return by how much the piece of an actuator at a guide is longer than at zero strains [m]; write its slopes."""
    x = turn_at(w, place, guide, 6)
    y = turn_at(w, place, guide, 7)
    z = turn_at(w, place, guide, 8)
    along = GUIDE_LUMPED[guide]
    size = along
    length = z
    if along > 0.0:
        length += 0.5 * (x * x + y * y) / size
    else:
        along = z
        size = sqrt(x * x + y * y + z * z)
        length = size
    for i in range(4):
        at = 45 * guide + 31 + i
        slope = x * GUIDE_TURN[at] + y * GUIDE_TURN[at + 5] + along * GUIDE_TURN[at + 10]
        w[GUIDE_SLOPE + 4 * guide + i] = slope / size
    return length - GUIDE_LENGTH[guide]


def slide(w: Array, place: int, ends: float) -> None:
    """Find the share of the friction of each guide at strains from `place` on; or where the sliders stay at the end."""
    for m in range(N_RUBBING):
        beyond = 0.0
        for k in range(FIRST_GUIDE[m + 1] - FIRST_GUIDE[m]):
            guide = FIRST_GUIDE[m + 1] - 1 - k
            piece = piece_at(w, place, guide)
            here = beyond + 0.5 * piece - GUIDE_REST[guide]
            beyond += piece
            if ends > 0.5:
                w[ANCHORS + guide] = here + GUIDE_STICK[guide] * w[SHARES + guide]
            else:
                slip = (w[ANCHORS + guide] - here) / GUIDE_STICK[guide]
                if fabs(slip) > 1.0:
                    slip = slip / fabs(slip)
                w[SHARES + guide] = slip


def displace(w: Array) -> None:
    """Find the share of the friction of each guide from where strains are displaced to in a step."""
    for i in range(N_STRAINS):
        w[DISPLACED + i] = 4.0 * w[MIDDLE + i] - (w[BEYOND + i] - w[SLIDERS + i])
    slide(w, DISPLACED, 0.0)


def grip_guides(w: Array) -> None:
    """Find the friction of the guides that slip by the tensions of the actuators."""
    for m in range(N_RUBBING):
        before = fabs(w[PULLED + m])
        for guide in range(FIRST_GUIDE[m], FIRST_GUIDE[m + 1]):
            exponent = GUIDE_COEFFICIENT[guide] * angle_at(w, DISPLACED, guide)
            along = exponent * w[SHARES + guide]
            mean = mean_decay(along)
            w[GRIPS + guide] = before * exponent * mean
            before *= 1.0 - along * mean


def rub_guides(w: Array, times: float) -> None:
    """Add the friction of the guides, times a number, to the torques out of balance."""
    for m in range(N_RUBBING):
        pull = 0.0
        for guide in range(FIRST_GUIDE[m], FIRST_GUIDE[m + 1]):
            half = 0.5 * times * w[GRIPS + guide] * w[SHARES + guide]
            for i in range(4):
                w[TORQUES + GUIDE_STRAIN[4 * guide + i]] += (pull - half) * w[GUIDE_SLOPE + 4 * guide + i]
            pull -= 2.0 * half


def add_slopes(w: Array, guide: int) -> None:
    """Add half the slopes of a piece to those of the length beyond, which are the right-hand side."""
    for i in range(4):
        w[SIDES + GUIDE_STRAIN[4 * guide + i]] += 0.5 * w[GUIDE_SLOPE + 4 * guide + i]


def solve_held(w: Array) -> None:
    """Write the correction for a right-hand side with that inverse."""
    for i in range(N_STRAINS):
        w[STRAIN_CORRECTION + i] = 0.0
        for j in range(N_STRAINS):
            w[STRAIN_CORRECTION + i] -= w[INVERSE + N_STRAINS * i + j] * w[SIDES + j]


def hold_guides(w: Array) -> None:
    """Find the inverse of the matrix of a step with the guides that stick."""
    for i in range(N_STRAINS):
        for j in range(N_STRAINS):
            w[SIDES + j] = 0.0
        w[SIDES + i] = 1.0
        start_reduce(w)
        reduce_all(w)
        correct_all(w)
        for j in range(N_STRAINS):
            w[INVERSE + N_STRAINS * i + j] = -w[STRAIN_CORRECTION + j]
    for m in range(N_RUBBING):
        for i in range(N_STRAINS):
            w[SIDES + i] = 0.0
        for k in range(FIRST_GUIDE[m + 1] - FIRST_GUIDE[m]):
            guide = FIRST_GUIDE[m + 1] - 1 - k
            add_slopes(w, guide)
            if fabs(w[SHARES + guide]) < 1.0 and w[GRIPS + guide] > 0.0:
                yields = GUIDE_STICK[guide] / (w[TIME_STEP] * w[TIME_STEP] * w[GRIPS + guide])
                solve_held(w)
                for i in range(N_STRAINS):
                    yields -= w[STRAIN_CORRECTION + i] * w[SIDES + i]
                for i in range(N_STRAINS):
                    for j in range(N_STRAINS):
                        w[INVERSE + N_STRAINS * i + j] -= w[STRAIN_CORRECTION + i] * w[STRAIN_CORRECTION + j] / yields
            add_slopes(w, guide)
