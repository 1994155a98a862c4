"""What is given in a small step with friction, and what friction remembers of the last state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact import Contact
from softrobots.statics.loads import Load

MARGIN = 0.05
"""Gaps below this, relative to the reach, are looked at."""


class Given(NamedTuple):
    """What is given at a place of a path."""

    model: SoftModel
    """The robot."""
    q_motors: FloatArray
    """Motor coordinates, shape (n_motors,)."""
    load: Load
    """The load."""
    environment: Environment
    """The obstacles, fixed where they are."""
    surroundings: Surroundings
    """The surfaces of robot and obstacles."""


@dataclass(frozen=True, eq=False)
class Sliding:
    """What friction remembers of the last state."""

    friction: float
    """Friction coefficient."""
    gaps: Gaps
    """The surfaces in that state."""
    forces: Mapping[Any, tuple[float, FloatArray]] = field(default_factory=dict)
    """Normal force [N] and friction, shape (3,) [N], of the candidates that pressed, by their keys."""


def forces_of(gaps: Gaps, contacts: tuple[Contact, ...]) -> dict[Any, tuple[float, FloatArray]]:
    """Return `Sliding.forces` of the contacts of an equilibrium, on the nearest candidates, if there are any."""
    forces: dict[Any, tuple[float, FloatArray]] = {}
    for one in contacts if len(gaps) else ():
        key = gaps.keys[int(np.linalg.norm(gaps.points - one.point, axis=1).argmin())]
        normal, friction = forces.get(key, (0.0, np.zeros(3)))
        forces[key] = normal + one.normal_force, friction + one.force - one.normal_force * one.normal
    return forces


def world(tangents: FloatArray, parts: FloatArray) -> FloatArray:
    """Return vectors of tangent planes, shape (m, 2), in world axes, shape (m, 3)."""
    return np.asarray(np.einsum("mki,mk->mi", tangents, parts))


def forces_by_key(keys: Any, normal: FloatArray, friction: FloatArray) -> dict[Any, tuple[float, FloatArray]]:
    """Return `Sliding.forces` of normal forces, shape (m,), and friction in world axes, shape (m, 3)."""
    return dict(zip(keys, zip(normal.tolist(), friction, strict=True), strict=True))
