"""Search for equilibria in contact: `softrobots.statics.contact.descent` in functions that numba compiles.

What is not settled plainly is left to `softrobots.solve_equilibrium`: no way out of an obstacle to first order, gradients that
depend on each other, a tangent stiffness that is not clearly positive at the end.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from softrobots.compiled.contact.balance import ENERGY, ERROR, NUMBERS, PENETRATION, SCALE, STORED, balance, look
from softrobots.compiled.contact.candidates import carry_forces
from softrobots.compiled.contact.joints import act
from softrobots.compiled.contact.programme import DEPENDENT, dot, factorise, programme, scale_rows, stiffened

LARGEST_STEP, ARMIJO, DEEP, SHORTEST, ROUNDING, POSITIVE = 0.5, 1e-4, 1e-2, 1e-6, 1e-14, 1e-9
TOUCHING = 1e-9
FIRST_SEEN, LEAST_SEEN, MOST_SEEN, CAPACITY, MOST = 0.1, 0.01, 0.2, 256, 100
"""Gaps that are seen, by the reach; room for candidates; limit of evaluations."""


def deepest_after(gaps: Any, rows: Any, step: Any, share: Any) -> Any:
    """Deepest penetration behind a share of a step, to first order."""
    deepest = 0.0
    for c in range(len(gaps)):
        deepest = max(deepest, -gaps[c] - share * dot(rows[c], step))
    return deepest


def repair(world: Any, states: Any, table: Any, soft: Any, work: Any) -> Any:
    """Bring a start that is inside of obstacles out of them by the least bending; which state it is, -1 if there is no way."""
    at, places, counts, rows, numbers = states[0], states[3], states[4], states[6], states[9]
    matrix, scaled, widths, wanted, step = work
    longest, deepest, promised, n = LARGEST_STEP, -1.0, 0.0, len(soft)
    here = 0 * n  # no constant, for which numba would compile all again
    for _ in range(MOST):
        if not look(world, states, here, FIRST_SEEN, table):
            return -1
        balance(world, states, here)
        deep = numbers[here, PENETRATION]
        if deepest >= 0.0 and deepest - deep < 0.1 * promised:
            here, longest, deep = 1 - here, 0.25 * longest, deepest
        if deep <= DEEP * world[0][8][0]:
            return here
        count, deepest = counts[here], deep
        for i in range(n):
            for j in range(i + 1):
                matrix[i, j] = 1.0 if i == j else 0.0
        scale_rows(rows[here, :count], soft, scaled, widths)
        for c in range(count):
            wanted[c] = 0.0
        if not programme(matrix, np.zeros(n), places[here, :count, 3], scaled, widths, wanted, step):
            return -1
        largest = 1e-300
        for i in range(n):
            step[i] *= soft[i]
            largest = max(largest, abs(step[i]))
        share = min(1.0, longest / largest)
        for i in range(n):
            at[1 - here, i] = at[here, i] + share * step[i]
        promised = deep - deepest_after(places[here, :count, 3], rows[here], step, share)
        if promised < 1e-3 * deep:
            return -1
        here = 1 - here
    return -1


def settle(
    chain: Any, capsules: Any, bodies: Any, motors: Any, loads: Any, springs: Any, tip: Any, pushes: Any, told: Any
) -> Any:
    """Find an equilibrium from the springs given; whether it is certified. Writes springs, tip, forces by obstacle, numbers."""
    stiffness, reach, n, joints = chain[7], chain[8][0], len(springs), len(chain[2])
    table, at, frames = np.zeros((len(capsules[6]), len(bodies), 7)), np.zeros((2, n)), np.zeros((2, joints, 12))
    features, places, forces = np.zeros((2, CAPACITY, 3), dtype=np.int64), np.zeros((2, CAPACITY, 7)), np.zeros((2, CAPACITY))
    rows, load, tangent = np.zeros((2, CAPACITY, n)), np.zeros((2, n)), np.zeros((2, n, n))
    numbers, counts = np.zeros((2, NUMBERS)), np.zeros(2, dtype=np.int64)
    matrix, soft, step, pull = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    scaled, widths, wanted = np.zeros((CAPACITY, n)), np.zeros(CAPACITY), np.zeros(CAPACITY)
    world = chain, capsules, bodies, motors, loads
    states = at, frames, features, places, counts, forces, rows, load, tangent, numbers
    for i in range(n):
        soft[i], at[0, i] = 1.0 / sqrt(stiffness[i]), springs[i]
    here, price, spent = repair(world, states, table, soft, (matrix, scaled, widths, wanted, step)), 0.0, 0
    if here < 0:
        return False
    while numbers[here, ERROR] > 1.0:
        count, shift, error, deep = counts[here], 0.0, numbers[here, ERROR], numbers[here, PENETRATION]
        gaps = places[here, :count, 3]
        while not stiffened(tangent[here], soft, shift, matrix):
            shift = max(0.02, 4.0 * shift)
            if shift > 1e6:
                return False
        scale_rows(rows[here, :count], soft, scaled, widths)
        for c in range(count):
            wanted[c] = forces[here, c]
        for i in range(n):
            pull[i] = soft[i] * load[here, i]
        if not programme(matrix, pull, gaps, scaled, widths, wanted, step):
            return False
        for i in range(n):
            step[i] *= soft[i]
        length, pressing, bent = sqrt(dot(step, step)), 0.0, 0.0
        whole = min(1.0, LARGEST_STEP / max(length, 1e-300))
        for i in range(n):
            bent += 0.5 * whole * whole * step[i] * dot(tangent[here, i], step)
        for c in range(count):
            pressing += wanted[c]
        downhill = whole * dot(load[here], step)
        closes = deep - deepest_after(gaps, rows[here], step, whole) if deep > 0.0 else 0.0
        price = max(2.0 * pressing, 0.5 * price, 2.0 * downhill / closes if closes > 0.0 else 0.0)
        predicted = downhill - price * closes
        terms = numbers[here, SCALE] + numbers[here, STORED] + abs(numbers[here, ENERGY])
        rounding = ROUNDING * terms + 1e-15 * price * reach
        if predicted > -rounding:
            predicted = min(0.0, bent)
        below, exact, share, found = predicted > -rounding, shift == 0.0 and whole == 1.0, 1.0, False
        seen = min(MOST_SEEN, max(LEAST_SEEN, 2.0 * whole * length * sqrt(float(n))))
        there = 1 - here
        while not found:
            for i in range(n):
                at[there, i] = at[here, i] + share * whole * step[i]
            spent += 1
            if spent == MOST or share < SHORTEST or not look(world, states, there, seen, table):
                return False
            old, new = features[here, :count], features[there, : counts[there]]
            carry_forces(old, forces[here], wanted, share * whole, new, places[there], forces[there])
            balance(world, states, there)
            if numbers[there, PENETRATION] <= max(deep, DEEP * reach):
                if below or (exact and share == 1.0 and numbers[there, ERROR] <= 0.5 * error):
                    found = numbers[there, ERROR] < error
                else:
                    merit = numbers[there, ENERGY] + price * numbers[there, PENETRATION]
                    found = merit <= numbers[here, ENERGY] + price * deep + ARMIJO * share * predicted + rounding
            if below and not found:
                return False
            share *= 0.5
        here = there
    if not stiffened(tangent[here], soft, -2.0 * POSITIVE, matrix):
        return False
    act(frames[here, joints - 1], chain[6], tip)
    for i in range(n):
        springs[i] = at[here, i]
    touching, out = 0, load[here]
    for c in range(counts[here]):
        force = forces[here, c]
        if force > 0.0 or places[here, c, 3] <= TOUCHING * reach:
            if touching == n:
                return False
            for i in range(n):
                out[i] -= force * rows[here, c, i]
                scaled[touching, i] = rows[here, c, i]
            for i in range(3):
                pushes[3 * features[here, c, 1] + i] += force * places[here, c, 4 + i]
            touching += 1
            for b in range(touching):
                matrix[touching - 1, b] = dot(rows[here, c], scaled[b])
    told[0], told[1] = sqrt(dot(out, out)), numbers[here, PENETRATION]
    return factorise(matrix, touching, DEPENDENT)


def settle_batch(
    chain: Any, capsules: Any, bodies: Any, motors: Any, loads: Any, springs: Any, tips: Any, pushes: Any, told: Any, done: Any,
    first: Any, last: Any,
) -> None:  # fmt: skip
    """Settle many cases; `bodies` are of one surrounding for all of them or of one a case."""
    for case in range(first, last):
        around = bodies[case if len(bodies) > 1 else 0]
        done[case] = settle(
            chain, capsules, around, motors[case], loads[case], springs[case], tips[case], pushes[case], told[case]
        )
