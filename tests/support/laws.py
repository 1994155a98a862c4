"""Which hypothesis test is the law of which public name; `test_laws_cover` checks that every name has one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

Test = TypeVar("Test", bound=Callable[..., object])

REGISTERED: dict[str, list[Callable[..., object]]] = {}
"""Tests by the public name they are a law of, as seen from `softrobots`: "solve_equilibrium", "helix.forward"."""


def law(*public_names: str) -> Callable[[Test], Test]:
    """Register a hypothesis test as a law of public names; stands above the other decorators."""

    def register(test: Test) -> Test:
        for name in public_names:
            REGISTERED.setdefault(name, []).append(test)
        return test

    return register
