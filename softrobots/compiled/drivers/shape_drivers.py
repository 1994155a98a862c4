"""Placements of a found equilibrium, for drawing; kernel language, see `softrobots.compiled.drivers.equilibrium_drivers`."""

from __future__ import annotations

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array


def look_at_shape(w: Array) -> None:
    """Write strains, loads of their springs, elastic coordinates, and placements of joints and of points along sections.

    A placement is a rotation matrix, row by row, and a position, in the world. That of a joint is Pinocchio's.
    """
    for i in range(N_STRAINS):
        w[STRAINS + i] = STRAIN_REST[i]
    for i in range(N):
        w[STRAINS + UNKNOWN_STRAIN[i]] = w[UNKNOWN + i]
    for i in range(N_STRAINS):
        w[LOADS + i] = STRAIN_STIFFNESS[i] * (w[STRAINS + i] - STRAIN_REST[i])
    bend_slack_walls(w)
    for i in range(N_SPRINGS):
        w[SPRINGS + i] = 0.0
    for i in range(N_ELASTIC):
        w[SPRINGS + ELASTIC_ROW[i]] += ELASTIC_SHARE[i] * w[STRAINS + ELASTIC_STRAIN[i]]
    for i in range(12):
        w[PLACEMENTS + i] = 0.0
    for i in range(3):
        w[PLACEMENTS + 4 * i] = 1.0  # the world, before the first element
    at = PLACEMENTS
    for i in range(N_PLACED):
        if PLACED_KIND[i] == 0:
            place_turn(w, at + 12, 21 * i, at, PLACED_COORDINATE[i], 0)
            at += 12
        elif PLACED_KIND[i] == 1:
            place_slide(w, at + 12, 21 * i, at, PLACED_COORDINATE[i], 0)
            at += 12
        else:
            for k in range(N_POINTS):
                place_section(w, at + 12 + 12 * k, 21 * i, at, PLACED_COORDINATE[i], k)
            at += 12 * N_POINTS
