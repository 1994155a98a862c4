"""Joints of a chain in space, and torques and gradients on them, in functions that numba compiles."""

from __future__ import annotations

from math import cos, sin
from typing import Any


def place(chain: Any, motors: Any, springs: Any, frames: Any) -> None:
    """Write axes and origin of each joint to rows of 12 numbers."""
    rotation, translation, slides, motor_of, spring_of = chain[:5]
    for k in range(len(slides)):
        value = springs[spring_of[k]] if spring_of[k] >= 0 else motors[motor_of[k]]
        here = frames[k]
        for i in range(3):
            for j in range(3):
                if k > 0:
                    total = 0.0
                    for m in range(3):
                        total += frames[k - 1, 3 * i + m] * rotation[k, 3 * m + j]
                    here[3 * i + j] = total
                else:
                    here[3 * i + j] = rotation[0, 3 * i + j]
            total = translation[k, i]
            if k > 0:
                total = frames[k - 1, 9 + i]
                for m in range(3):
                    total += frames[k - 1, 3 * i + m] * translation[k, m]
            here[9 + i] = total + (here[3 * i + 2] * value if slides[k] else 0.0)
        if not slides[k]:
            c, s = cos(value), sin(value)
            for i in range(3):
                a, b = here[3 * i], here[3 * i + 1]
                here[3 * i], here[3 * i + 1] = a * c + b * s, b * c - a * s


def act(frame: Any, point: Any, x: Any) -> None:
    """Write the place of a point of a joint."""
    for i in range(3):
        x[i] = frame[9 + i] + frame[3 * i] * point[0] + frame[3 * i + 1] * point[1] + frame[3 * i + 2] * point[2]


def add_force(total: Any, x: Any, force: Any) -> None:
    """Add a force at a point to force and moments."""
    for i in range(3):
        total[i] += force[i]
        for j in range(3):
            total[3 + 3 * i + j] += x[i] * force[j]


def torque(frame: Any, slides: Any, total: Any) -> Any:
    """Torque of a joint."""
    z, o = (frame[2], frame[5], frame[8]), (frame[9], frame[10], frame[11])
    f, s = total[:3], total[3:]
    if slides:
        return z[0] * f[0] + z[1] * f[1] + z[2] * f[2]
    n = (
        s[5] - s[7] - o[1] * f[2] + o[2] * f[1],
        s[6] - s[2] - o[2] * f[0] + o[0] * f[2],
        s[1] - s[3] - o[0] * f[1] + o[1] * f[0],
    )
    return z[0] * n[0] + z[1] * n[1] + z[2] * n[2]


def suffix(total: Any) -> None:
    """Sum from the tip to the base."""
    for k in range(len(total) - 2, -1, -1):
        for i in range(12):
            total[k, i] += total[k + 1, i]


def gradient(chain: Any, frames: Any, carrier: Any, place: Any, row: Any) -> None:
    """Write the derivatives of a gap by the springs."""
    slides, spring_of = chain[2], chain[4]
    x0, x1, x2, n0, n1, n2 = place[0], place[1], place[2], place[4], place[5], place[6]
    for i in range(len(row)):
        row[i] = 0.0
    m0, m1, m2 = x1 * n2 - x2 * n1, x2 * n0 - x0 * n2, x0 * n1 - x1 * n0
    for k in range(carrier + 1):
        i = spring_of[k]
        if i < 0:
            continue
        z0, z1, z2 = frames[k, 2], frames[k, 5], frames[k, 8]
        if slides[k]:
            row[i] = z0 * n0 + z1 * n1 + z2 * n2
            continue
        o0, o1, o2 = frames[k, 9], frames[k, 10], frames[k, 11]
        row[i] = z0 * (m0 - o1 * n2 + o2 * n1) + z1 * (m1 - o2 * n0 + o0 * n2) + z2 * (m2 - o0 * n1 + o1 * n0)
