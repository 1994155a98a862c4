"""A text with all that the kernel language has, and texts run by Python."""

from __future__ import annotations

import inspect
from typing import Any

from softrobots.compiled.drivers import intrinsics, trigonometry
from softrobots.compiled.program.generated_module import functions_of

TRIGONOMETRY = "\n\n".join(map(inspect.getsource, functions_of(trigonometry)))
EVERYTHING = f'''"""All that the language has.

It's the arm's /* module */ really??/
"""

N = 6
SHIFT = -1.25e-3
SCALE = 1e+22
TABLE = (1.0, -2.5, 3e-5, 0.1)
PLACES = (3, -1, 0, 2, 5)
NEVER_USED = 3.0

{TRIGONOMETRY}

def never_called(w: Array) -> None:
    """Left out of the file."""
    w[0] = NEVER_USED


def nothing() -> None:
    pass


def norm(w: Array, first: int) -> float:
    """Length of a vector."""
    return sqrt(w[first] * w[first] + w[first + 1] * w[first + 1] + w[first + 2] * w[first + 2])


def add(w: Array, to: int, other: Array) -> int:
    """Write, and say where to go on."""
    w[to] += other[0]
    w[to + 1] -= other[1] * 2
    w[to + 2] *= SHIFT
    w[to + 3] /= 3
    return to + 4


def is_large(x: float) -> bool:
    """Compare."""
    return fabs(x) > 1


def whole(w: Array, count: int) -> int:
    """Arithmetic of ints; their quotient is a float."""
    k = 0
    for a in range(-7, 8):
        w[k] = a / 3
        w[k + 1] = 7 / (a * a + 1) + a / 3 - 2
        k += 2
    k -= -count
    k *= 2
    for a in range(5):
        k += a * PLACES[a]
    for a in range(N):
        k = k + a
    for a in range(3, N + k):
        k -= a
    n = 3
    for a in range(n):
        n -= 1
        k += n
    return k


def locals_and_loops(w: Array, count: int, unused: float) -> None:
    """Names that C declares in different places."""
    twice = 2.0
    first = True
    turn = 0
    for i in range(count):
        x = w[i]
        if first:
            previous = x
            first = False
        else:
            w[i] = x - previous
            previous = x
        if turn == 0:
            both = 1.0
            turn = 1
        elif turn == 1 and not first:
            both = twice * x
            turn = 2
        else:
            turn = 0
            pass
        w[i] += both + where(x > 0.0, i, -i)
        ignored = x
    tries = 0
    while True:
        tries += 1
        if tries > 3 or is_large(w[tries]) and w[0] < 1e9:
            break
    w[count] = tries
    total = 0.0
    total = total + tries
    for i in range(4):
        total += TABLE[i]
    w[count + 1] = total
    nothing()
    is_large(total)


def operators(w: Array, x: float, y: float, n: int) -> None:
    """Parentheses that matter and those that do not."""
    w[0] = x - (y - 1.0) - x * (y * 3.0) / (x * x + 1.0)
    w[1] = -(-x) - -y - (-x * -2.0)
    w[2] = x + (y + SCALE) - SCALE
    w[3] = where(x < y and not (x < 0.0 or y < 0.0), x, y) * where(n != 0, 1, 0)
    flag = x == y or (x != y and x <= y) or not x >= 0
    w[4] = where(flag, n / 2, TABLE[1])
    w[5] = where(flag, x, y) - where(n > 2, 1, where(n > 1, 2, 3))
    w[6] = floor(x * 10) + floor(-y) + fabs(x - y)
    w[7] = (x + y) * (x - y) - (x + y) / (1.0 + (x - y) * (x - y))
    w[8] = 2 * n - 1 + x * 3 + N * TABLE[PLACES[0]] + 1 / 4
    w[9] = n / 2 * 3 + n - (n - 1) / -2
    w[10] = 1.7976931348623157e+308 / 1e300 + 5e-324 + 0.1 + 123456789.123456789
    place = add(w, 11, w)
    w[place] = norm(w, 0)
    w[place + 1] = sine(x) + cosine(y)
    while not is_large(x) and n < 20:
        x *= 2
        n = n + 1
    w[place + 2] = x + n


def chosen(n: int, least: float) -> int:
    """A return on every way."""
    if n > 3:
        return n
    elif n > least:
        return 2 * n
    else:
        while n < 5:
            n += 2
        return -n


def over(w: Array, count: int, which: int) -> None:
    """An intrinsic of each of `count` numbers."""
    for i in range(count):
        x = w[i]
        if which == 0:
            w[i] = sqrt(x)
        elif which == 1:
            w[i] = floor(x)
        elif which == 2:
            w[i] = fabs(x)
        elif which == 3:
            w[i] = sine(x)
        else:
            w[i] = cosine(x)
'''
EXPORTED = ["whole", "locals_and_loops", "operators", "chosen", "over", "is_large", "N"]
"""Names in it that a file shows."""


def in_python(text: str) -> dict[str, Any]:
    """Run a text by Python; return its names."""
    names: dict[str, Any] = dict(vars(intrinsics))
    exec(text, names)
    return names


PYTHON = in_python(EVERYTHING)
"""All of it."""
