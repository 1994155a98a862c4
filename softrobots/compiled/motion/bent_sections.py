"""The joints of sections at both stages of a step, traced for several sections at once: numbers side by side.

They follow from the coordinates of a section alone, so they do not wait for the sections before it, and are more than half of
the work of an evaluation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from softrobots.compiled.motion.moving_joints import JointState, SectionState
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression, Scalar

TOGETHER = 4
"""Number of sections whose joints are found at once."""

_EACH = [f"{name}_{one}" for one in range(TOGETHER) for name in ("row", "q")]
COLUMNS = ("BENT_KIND", "BENT_AT", *(f"BENT_{name.upper()}" for name in _EACH))
"""Tables of what is found at once: kind of the sections, place of their numbers, row and first unknown of each."""


class BentSections:
    """Functions of the sections of a kind: `take` copies the coordinates of some, `bend` finds their joints."""

    def __init__(self, number: int) -> None:
        """Begin without numbers."""
        self.take = Block(f"take_{number}", "Copy the coordinates of sections.", ("at", *_EACH), loop=("stage", 2))
        self.bend = Block(f"bend_{number}", "Joints of sections.", ("at",), loop=("eight", 2 * TOGETHER))
        self._count = 0

    @property
    def size(self) -> int:
        """Number of places of those that are bent at once."""
        return 2 * TOGETHER * self._count

    def state(self, out: Block, *given: Any) -> SectionState:
        """Return a section as `out` reads it from `bent` on.

        Given are coordinates, velocities and accelerations, four each, and the rest length, as `out` has them, and which of the
        coordinates move.
        """
        *taken, moving = given
        state, kept = SectionState(*(self._each(one, self._taken) for one in taken)), dict[int, int]()

        def found(value: Expression) -> Scalar:
            if value.number not in kept:
                kept[value.number] = self._next()
                self.bend.store(kept[value.number], value, self.bend.each("at"))
            return out.load(kept[value.number], out.each("bent"))

        state.joints = [JointState(*self._each(joint, found)) for joint in state.joints]
        state.slopes[:, moving] = self._each(state.slopes[:, moving], found)
        state.screw.position, state.screw.rotation = (
            self._each(one, found) for one in (state.screw.position, state.screw.rotation)
        )
        return state

    def _each(self, values: Any, change: Callable[[Expression], Scalar]) -> Any:
        """Return what stands for numbers; constants stay, and of a number and its opposite one is kept."""

        def changed(value: Any) -> Any:
            if isinstance(value, Expression) and value.operation == "neg":
                return -changed(value.arguments[0])
            return change(value) if isinstance(value, Expression) else value

        array = np.asarray(values, dtype=object)
        return np.array([changed(one) for one in array.ravel()], dtype=object).reshape(array.shape)[()]

    def _taken(self, value: Expression) -> Expression:
        (array, base, offset), place = value.arguments, self._next()
        for one in range(TOGETHER):
            own = base.replace("q", f"q_{one}").replace("row", f"row_{one}")
            self.take.store(place + 2 * one, self.take.trace.load(array, own, offset), self.take.each("at"))
        return self.bend.load(place, self.bend.each("at"))

    def _next(self) -> int:
        self._count += 1
        return 2 * TOGETHER * (self._count - 1)
