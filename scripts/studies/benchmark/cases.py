"""What the solvers are timed on: the standard set of load cases of the inflatable arm, a path, and rods of many sections."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm, PccArm
from softrobots.statics.time_law import straight_line
from studies.papers.arm_path import DURATION, END, START

FORCE = 18.03
"""Size of the force of the standard set [N], that of (0, 10, -15) N."""

ROD_LENGTH, ROD_STIFFNESS = 0.524, 1.92
"""Length [m] and bending stiffness [N m^2] of the rods; under `ROD_STIFFNESS / ROD_LENGTH^2` f L^2/EI is 1."""


class LoadCases(NamedTuple):
    """Motor angles and forces on the tip."""

    q_motors: FloatArray
    """Motor angles, shape (n, n_motors) [rad]."""
    forces: FloatArray
    """Forces, world axes, shape (n, 3) [N]."""

    def first(self, count: int) -> LoadCases:
        """The first of them."""
        return LoadCases(self.q_motors[:count], self.forces[:count])


def random_forces(count: int, size: float, seed: int = 0) -> FloatArray:
    """Forces of one size in random directions, uniform on the sphere, shape (count, 3) [N]."""
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return read_only(directions * (size / np.linalg.norm(directions, axis=1, keepdims=True)))


def standard_cases(count: int, seed: int = 0) -> LoadCases:
    """The standard set: `FORCE` in random directions, motor angles of the inflatable arm uniform in [-pi, pi]."""
    motors = np.random.default_rng(seed + 1).uniform(-np.pi, np.pi, (count, 3))
    return LoadCases(read_only(motors), random_forces(count, FORCE, seed))


def path_targets(count: int) -> FloatArray:
    """Waypoints on the line of `studies.papers.arm_path`, shape (count, 3) [m]."""
    return straight_line(START, END, DURATION, count - 1).positions


@lru_cache(maxsize=1)
def arm() -> SoftModel:
    """The inflatable arm: three motors, four springs."""
    return load_model(InflatableArm())


@lru_cache(maxsize=16)
def rod(sections: int, chain: str = "sections") -> SoftModel:
    """A passive rod of sections of constant strain, or of pairs of orthogonal hinges with chain="lumped"."""
    return load_model(
        PccArm(
            segment_lengths=(ROD_LENGTH,), bending_stiffness=ROD_STIFFNESS, muscle_azimuths=(), chain=chain,
            elastic_sections=sections, hinges=sections, torsion=False, extension=False,
        )
    )  # fmt: skip


def rod_forces(count: int) -> FloatArray:
    """Forces on the tip of a rod with f L^2/EI = 1, in random directions, shape (count, 3) [N]."""
    return random_forces(count, ROD_STIFFNESS / ROD_LENGTH**2)
