"""Quasi-static steps from place to place, halved where they do not converge and where contacts change."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Protocol

from softrobots.statics.contact.contact_path import LOST, MADE, ContactEvent
from softrobots.statics.contact.quasi_static import Rest

SMALLEST = 2.0**-14
"""Smallest step, a share of the way from one place to the next."""

EVENT = 2.0**-7
"""Largest step in which a contact is made or lost or begins to slip or stick, likewise."""

PATIENT = 2.0**-4
"""Largest step that is tried again where Newton's method does not converge at once: halving a larger one takes less."""

_LONGEST_PAUSE = 16


class Way(Protocol):
    """What a robot follows: places 0, 1, 2, ... and all between two."""

    def parameter(self, place: float) -> float:
        """Parameter at a place."""

    def step(self, place: float, here: Rest, small: bool = True) -> Rest | None:
        """Go to a place; None if there is no equilibrium that holds near the last one, or it is too far for a step so large."""

    def blocked(self, place: float, here: Rest) -> Rest | None:
        """Go to a place that the smallest step does not reach; None: the way ends."""


class ContactWalk:
    """Steps along a way, with what happens to the contacts."""

    def __init__(self, way: Way) -> None:
        """Take the way."""
        self._way, self._share, self._least, self._taken = way, 0.25, SMALLEST, PATIENT
        self._waits, self._pause = 0, 1  # steps taken before a larger one is tried, now and after the next that fails
        self.events: list[ContactEvent] = []
        self.work = 0.0
        """Work against friction so far [J]."""

    def rows(self, first: Rest, count: int) -> Iterator[Rest]:
        """Go from the first of `count` places to the last; ends early where the way ends."""
        here: Rest | None = first
        yield first
        for row in range(1, count):
            here = self.go(here, row - 1)  # type: ignore[arg-type]
            if here is None:
                return
            yield here

    def go(self, here: Rest, place: float) -> Rest | None:
        """Go from one place to the next whole number; None where the way ends."""
        end, changed = place + 1.0, math.inf
        while place < end:
            aim = min(place + self._share, end)
            if aim >= changed:  # statuses are known to be others there
                aim = 0.5 * (place + changed) if changed - place > EVENT else changed
            there = self._way.step(aim, here, aim - place <= PATIENT)
            if there is None and aim - place <= self._least:
                there = self._way.blocked(aim, here)
                if there is None:
                    return None
                self._least = min(2.0 * self._least, PATIENT)  # where one place after the other is blocked
                self._share = self._least
            elif there is None:
                self._share = max(0.5 * (aim - place), self._least)
                self._waits, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
                continue
            else:
                self._least = SMALLEST
            if aim - place > max(EVENT, self._least) and there.statuses != here.statuses:
                changed = aim
                continue
            self._tell(here.statuses, there.statuses, self._way.parameter(aim))
            self.work += there.work
            if there.statuses != here.statuses:
                self._share, changed, self._waits, self._pause = 2.0 * (aim - place), math.inf, 0, 1
            else:
                if aim >= changed:  # in a smaller step from here they stay
                    changed = math.inf
                if self._waits:
                    self._waits -= 1
                else:
                    self._share = min(2.0 * self._share, 1.0)
                if aim - place > self._taken:
                    self._pause = 1
            here, place, self._taken = there, aim, aim - place
        return here

    def _tell(self, before: dict[tuple[str, str], str], after: dict[tuple[str, str], str], parameter: float) -> None:
        """Note which contacts have changed."""
        for pair in {**before, **after}:
            kind = MADE if pair not in before else after.get(pair, LOST)
            if kind != before.get(pair):
                self.events.append(ContactEvent(parameter, kind, *pair))
