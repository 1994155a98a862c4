"""Where the hinges of a lumped segment stand, from the conditions that their places meet."""

from __future__ import annotations

import numpy as np


def hinge_places(count: int, rule: str) -> np.ndarray:
    """Places of the hinges along a segment in lengths of its `count` sections, shape (count,).

    Corrected, from four hinges on: two are moved at each end so that the sum over the hinges of any number of sections is the
    integral for 1, s, s^2 and s^3. By symmetry that is one condition for each number n, linear in the sum S and the sum of
    squares Q of the two distances from an end: 2 Q - 2 n S + 2 n^2 + (those between) = n^3 / 3. Those of 4 and 5 give both.
    With two or three, one is moved at each end by the boundary term of Euler and Maclaurin's formula, 1/24.
    """
    places = np.arange(count) + 0.5
    if rule == "midpoint" or count == 1:
        return places
    moved = np.array([11 / 24])
    if count >= 4:
        numbers = np.array([4.0, 5.0])
        between = np.array([0.0, 2.5**2])
        total, squares = np.linalg.solve(
            np.stack([-2 * numbers, [2.0, 2.0]], axis=1), numbers**3 / 3 - 2 * numbers**2 - between
        )
        moved = total / 2 + np.array([-1.0, 1.0]) * np.sqrt(squares / 2 - total**2 / 4)
    places[: len(moved)] = moved
    places[count - len(moved) :] = count - moved[::-1]
    return places
