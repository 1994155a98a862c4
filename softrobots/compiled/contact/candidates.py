"""Candidates of contact, as `softrobots.environment.candidates`, in functions that numba compiles."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.contact.joints import act
from softrobots.compiled.contact.surfaces import BORDERS, FOUND, HALF_SPACE, core_candidates, surface

MERGED = 1e-9
"""Distance within which points are one, by the reach."""


def find_candidates(
    chain: Any, capsules: Any, bodies: Any, frames: Any, margin: Any, table: Any, places: Any, features: Any
) -> Any:
    """Write the candidates of contact: pair and feature, and point, distance less radius, normal; -1 if there are too many."""
    carrier, starts, stops, radii, lengths, end_of, ends, base_of = capsules
    reach, found, work, x = chain[8][0], np.zeros(FOUND), np.zeros(48), np.zeros(3)
    begin, span = np.zeros(3), np.zeros(3)
    hits, count = np.zeros((BORDERS + 1, 8)), 0
    for e in range(len(ends)):
        capsule, feature = ends[e, 0], ends[e, 1]
        act(frames[carrier[capsule]], stops[capsule] if feature else starts[capsule], x)
        for o in range(len(bodies)):
            surface(bodies[o], x, 0.0, found)
            for i in range(4):
                table[e, o, i] = found[i]
            table[e, o, 4], table[e, o, 5], table[e, o, 6] = x[0], x[1], x[2]
    for e in range(len(ends)):
        capsule, base = ends[e, 0], base_of[e]
        for o in range(len(bodies)):
            gap = table[e, o, 0] - radii[capsule]
            if gap > margin or (base >= 0 and table[base, o, 0] < radii[ends[base, 0]]):
                continue
            if count == len(places):
                return -1
            features[count, 0], features[count, 1], features[count, 2] = capsule, o, ends[e, 1]
            for i in range(3):
                places[count, i], places[count, 4 + i] = table[e, o, 4 + i], table[e, o, 1 + i]
            places[count, 3] = gap
            count += 1
    for capsule in range(len(radii)):
        first, last = end_of[capsule, 0], end_of[capsule, 1]
        limit = margin + radii[capsule]
        for o in range(len(bodies)):
            if lengths[capsule] == 0.0 or bodies[o, 0] == HALF_SPACE:
                continue
            if table[first, o, 0] + table[last, o, 0] > 2.0 * limit + lengths[capsule]:
                continue
            for i in range(3):
                begin[i] = table[first, o, 4 + i]
                span[i] = table[last, o, 4 + i] - begin[i]
            length, at_first, at_last = lengths[capsule], table[first, o], table[last, o]
            new = core_candidates(bodies[o], begin, span, length, at_first, at_last, limit, MERGED * reach, hits, found, work)
            for row in range(new):
                if hits[row, 0] < 0.0:
                    continue
                if count == len(places):
                    return -1
                features[count, 0], features[count, 1], features[count, 2] = capsule, o, int(hits[row, 0])
                for i in range(3):
                    places[count, i], places[count, 4 + i] = hits[row, 1 + i], hits[row, 5 + i]
                places[count, 3] = hits[row, 4] - radii[capsule]
                count += 1
    return count


def carry_forces(old: Any, old_forces: Any, change: Any, share: Any, new: Any, places: Any, forces: Any) -> None:
    """Carry forces to the same candidates, else to the nearest one of the same pair; `softrobots.statics.contact.touch`."""
    for i in range(len(new)):
        forces[i] = 0.0
    for i in range(len(old)):
        force = old_forces[i] + share * (change[i] - old_forces[i])
        if force == 0.0:
            continue
        best = -1
        for j in range(len(new)):
            if new[j, 0] != old[i, 0] or new[j, 1] != old[i, 1]:
                continue
            if new[j, 2] == old[i, 2]:
                best = j
                break
            if best < 0 or places[j, 3] < places[best, 3]:
                best = j
        if best >= 0:
            forces[best] += force
