r"""Energy, balance and tangent stiffness of a chain of joints under loads and contact forces.

With the moments :math:`S_k = \sum x f^T` and forces :math:`F_k = \sum f` beyond joint `k`, one pass gives its torque and
:math:`A_k = \sum v_k(x) \times f`; the stiffness is :math:`K_{ij} = k_i \delta_{ij} - w_i \cdot A_j` for `i` before `j`;
`softrobots.model.joint_loads` and `softrobots.environment.gaps` have the equations.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from softrobots.compiled.contact.candidates import find_candidates
from softrobots.compiled.contact.joints import act, add_force, gradient, place, suffix, torque
from softrobots.compiled.contact.surfaces import FOUND, HALF_SPACE, INSIDE, bent_along, surface

ENERGY, SCALE, PENETRATION, ERROR, FORCES, STORED, NUMBERS = 0, 1, 2, 3, 4, 5, 6
TOLERANCE, MOMENT_FLOOR, EXACT = 1e-10, 1e-3, 1e-12
"""Those of `softrobots.statics.elastic_state`, and of a closed gap by the reach."""


def curve(chain: Any, capsules: Any, bodies: Any, frames: Any, feature: Any, place: Any, force: Any, tangent: Any) -> None:
    """Take the curvature of a gap under a force from the tangent stiffness; `Gaps.curvature`."""
    slides, spring_of = chain[2], chain[4]
    carrier, n, body = capsules[0][feature[0]], len(tangent), bodies[feature[1]]
    found, ends, span = np.zeros(FOUND), np.zeros((2, 3)), np.zeros(3)
    surface(body, place[:3], 1.0, found)
    act(frames[carrier], capsules[1][feature[0]], ends[0])
    act(frames[carrier], capsules[2][feature[0]], ends[1])
    for i in range(3):
        span[i] = ends[1, i] - ends[0, i]
    bend = bent_along(found, span) if feature[2] == INSIDE else 0.0
    velocity, bent, pull = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n)
    t, h, m = span, found[4:13], found[1:4]
    for k in range(carrier + 1):
        i = spring_of[k]
        if i < 0:
            continue
        z0, z1, z2 = frames[k, 2], frames[k, 5], frames[k, 8]
        v = velocity[i]
        if slides[k]:
            v[0], v[1], v[2] = z0, z1, z2
        else:
            r0, r1, r2 = place[0] - frames[k, 9], place[1] - frames[k, 10], place[2] - frames[k, 11]
            v[0], v[1], v[2] = z1 * r2 - z2 * r1, z2 * r0 - z0 * r2, z0 * r1 - z1 * r0
            pull[i] = z0 * (t[1] * m[2] - t[2] * m[1]) + z1 * (t[2] * m[0] - t[0] * m[2]) + z2 * (t[0] * m[1] - t[1] * m[0])
        for a in range(3):
            bent[i, a] = h[3 * a] * v[0] + h[3 * a + 1] * v[1] + h[3 * a + 2] * v[2]
            pull[i] += t[a] * bent[i, a]
    for i in range(n):
        slide = pull[i] / bend if bend > 0.0 else 0.0
        for j in range(n):
            along = velocity[j, 0] * bent[i, 0] + velocity[j, 1] * bent[i, 1] + velocity[j, 2] * bent[i, 2]
            tangent[i, j] -= force * (along - slide * pull[j])


def look(world: Any, states: Any, at: Any, seen: Any, table: Any) -> Any:
    """Place the joints of one of two states, and find its candidates of contact; whether there is room for them."""
    chain, capsules, bodies, motors, _ = world
    springs, frames, features, places, counts = states[:5]
    place(chain, motors, springs[at], frames[at])
    counts[at] = find_candidates(chain, capsules, bodies, frames[at], seen * chain[8][0], table, places[at], features[at])
    return counts[at] >= 0


def balance(world: Any, states: Any, at: Any) -> None:
    """Write residual without contact forces, tangent stiffness with them, gap gradients, energy and error of a state."""
    chain, capsules, bodies, _, loads = world
    springs, frames, features, places, count = states[0][at], states[1][at], states[2][at], states[3][at], states[4][at]
    forces, rows, load, tangent, numbers = states[5][at], states[6][at], states[7][at], states[8][at], states[9][at]
    _, _, slides, _, spring_of, mass, tip, stiffness, sizes, rest = chain
    joints, n, reach, x, push = len(slides), len(rest), sizes[0], np.zeros(3), np.zeros(3)
    total, weight = np.zeros((joints, 12)), 0.0
    energy, scale = 0.0, sqrt(loads[0] ** 2 + loads[1] ** 2 + loads[2] ** 2) * reach
    if loads[3] != 0.0 or loads[4] != 0.0 or loads[5] != 0.0:
        for k in range(joints):
            for i in range(3):
                x[i] = mass[k, 0] * frames[k, 9 + i]
                for m in range(3):
                    x[i] += frames[k, 3 * i + m] * mass[k, 1 + m]
            for i in range(3):
                total[k, i] += mass[k, 0] * loads[3 + i]
                energy -= x[i] * loads[3 + i]
                for j in range(3):
                    total[k, 3 + 3 * i + j] += x[i] * loads[3 + j]
        suffix(total)
        for k in range(joints):
            weight += torque(frames[k], slides[k], total[k]) ** 2
        scale += sqrt(weight)
    act(frames[joints - 1], tip, x)
    for i in range(3):
        energy -= x[i] * loads[i]
    beyond = np.zeros((joints, 12))
    add_force(beyond[joints - 1], x, loads[:3])
    suffix(beyond)
    for k in range(joints):
        for i in range(12):
            total[k, i] += beyond[k, i]
            beyond[k, i] = 0.0
    stored = 0.0
    for i in range(n):
        load[i] = stiffness[i] * (springs[i] - rest[i])
        energy += 0.5 * load[i] * (springs[i] - rest[i])
        stored += stiffness[i] * springs[i] * springs[i]
    for k in range(joints):
        if spring_of[k] >= 0:
            load[spring_of[k]] -= torque(frames[k], slides[k], total[k])
    deepest, open_gap, pressed = 0.0, 0.0, 0.0
    for c in range(count):
        carrier = capsules[0][features[c, 0]]
        gradient(chain, frames, carrier, places[c], rows[c])
        deepest = max(deepest, -places[c, 3])
        if forces[c] > 0.0:
            open_gap, pressed = max(open_gap, places[c, 3]), pressed + forces[c]
            for i in range(3):
                push[i] = forces[c] * places[c, 4 + i]
            add_force(beyond[carrier], places[c, :3], push)
    suffix(beyond)
    for k in range(joints):
        for i in range(12):
            total[k, i] += beyond[k, i]
    for b in range(joints):
        j = spring_of[b]
        if j < 0:
            continue
        f, s = total[b, :3], total[b, 3:]
        z, o = (frames[b, 2], frames[b, 5], frames[b, 8]), (frames[b, 9], frames[b, 10], frames[b, 11])
        if slides[b]:
            a0, a1, a2 = z[1] * f[2] - z[2] * f[1], z[2] * f[0] - z[0] * f[2], z[0] * f[1] - z[1] * f[0]
        else:
            along = z[0] * f[0] + z[1] * f[1] + z[2] * f[2]
            trace = s[0] + s[4] + s[8] - o[0] * f[0] - o[1] * f[1] - o[2] * f[2]
            a0 = s[0] * z[0] + s[1] * z[1] + s[2] * z[2] - o[0] * along - z[0] * trace
            a1 = s[3] * z[0] + s[4] * z[1] + s[5] * z[2] - o[1] * along - z[1] * trace
            a2 = s[6] * z[0] + s[7] * z[1] + s[8] * z[2] - o[2] * along - z[2] * trace
        for a in range(b + 1):
            i = spring_of[a]
            if i >= 0:
                value = 0.0 if slides[a] else -(frames[a, 2] * a0 + frames[a, 5] * a1 + frames[a, 8] * a2)
                tangent[i, j] = tangent[j, i] = value
        tangent[j, j] += stiffness[j]
    square = 0.0
    for c in range(count):
        if forces[c] > 0.0 and bodies[features[c, 1], 0] != HALF_SPACE:
            curve(chain, capsules, bodies, frames, features[c], places[c], forces[c], tangent)
    for i in range(n):
        out = load[i]
        for c in range(count):
            if forces[c] > 0.0:
                out -= forces[c] * rows[c, i]
        square += out * out
    scale += reach * pressed
    allowed = max(TOLERANCE * max(scale, MOMENT_FLOOR), sizes[1])
    numbers[ENERGY], numbers[SCALE], numbers[PENETRATION], numbers[FORCES] = energy, scale, deepest, pressed
    numbers[ERROR] = max(sqrt(square) / allowed, max(deepest, open_gap) / (EXACT * reach))
    numbers[STORED] = stored
