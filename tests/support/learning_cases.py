"""Robots whose equilibria are differentiated, with their parameters and random loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.learning.differentiable import Differentiable
from tests.support.foreign import BRANCHED, SPRINGS

OPTIONS: dict[str, Any] = dict(gravity=sr.EARTH_GRAVITY, backend=None, threads=1, failed="raise")
STEP = 3e-4
"""Of differences of fourth order, relative to changes of a hundredth to a tenth; their error is about its fourth power."""


class Case(NamedTuple):
    """A robot, its actuators, their rates, a force, and parameters."""

    robot: Any
    motors: tuple[float, ...]
    rate: float
    force: tuple[float, float, float]
    names: tuple[str, ...]


LENGTHS = (0.28, 0.32, 0.3, 0.26, 0.24, 0.25)
PCC: dict[str, Any] = {"segment_lengths": (0.3, 0.25), "elastic_sections": 2}
CASES: Mapping[str, Callable[[], Case]] = {
    "given lengths": lambda: Case(
        sr.PccArm(**PCC),
        LENGTHS,
        0.01,
        (0.5, 1.0, -1.0),
        ("muscle_distance", "segment_lengths[1]", "axial_stiffness", "bending_stiffness", "motor[2].offset"),
    ),
    "tensions": lambda: Case(
        sr.PccArm(**PCC, kind="tension"), (5, 20, 0, 10, 0, 3), 1.0, (0.5, 1.0, -1.0), ("offset[2]", "torsional_stiffness")
    ),
    "tendons": lambda: Case(
        sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=2),
        (0.058, 0.064, 0.062, 0.12, 0.118, 0.123),  # the second is slack
        1e-4,
        (0.2, 0.1, -0.1),
        ("tendon_pretension", "tendon_stiffness", "tendon_distance", "segment[1].young_modulus", "motor[1].offset"),
    ),
    "helix": lambda: Case(
        sr.HelixTube(length=0.3, elastic_sections=3), (), 0.0, (0.5, 1.0, -1.0), ("contraction", "diameter", "length")
    ),
    "flexures": lambda: Case(
        sr.PccArm(segment_lengths=(0.3, 0.25), muscle_azimuths=(), chain="flexures", hinges=2, extension=False),
        (),
        0.0,
        (0.5, 1.0, -1.0),
        ("segment_lengths[1]", "offset[2]", "bending_stiffness", "torsional_stiffness"),
    ),
    "side branches": lambda: Case(
        sr.load_model(BRANCHED, springs=SPRINGS, tip="finger"),
        (0.3, 0.6, -0.2),
        0.1,
        (0.0, 10.0, -11.0),
        ("joint[*].stiffness", "joint[*].rest"),
    ),
    "plateau": lambda: Case(
        sr.InflatableArm(max_moment=12.0), (0.3, 0.6, -0.8), 0.1, (0.0, 10.0, -11.0), ("max_moment", "link[2].stiffness")
    ),
    "winding lengths": lambda: Case(
        sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=2, kind="length"),
        (0.06, 0.0605, 0.0598, 0.12, 0.1201, 0.1199),
        1e-4,
        (0.2, 0.1, -0.1),
        ("backbone_radius", "segment_lengths[2]", "tendon_distance"),
    ),
}  # fmt: skip


def balanced(solver: Differentiable, inputs: list[FloatArray], start: Any = None) -> sr.Equilibrium:
    """The equilibrium by `solve_equilibrium`."""
    parameters = solver._set
    model = parameters.model(inputs[2])
    motors = inputs[0] + parameters.motor_offsets(inputs[2])
    return sr.solve_equilibrium(model, motors, inputs[1], gravity=sr.EARTH_GRAVITY, q_springs0=start, tolerance=1e-13)


def solved(solver: Differentiable, inputs: list[FloatArray], start: Any = None) -> FloatArray:
    """Elastic coordinates and tip by `solve_equilibrium`."""
    found = balanced(solver, inputs, start)
    return np.concatenate([found.q_springs, found.tip_position])


def changes(case: Case, solver: Differentiable) -> list[FloatArray]:
    """A random change of all inputs."""
    random = np.random.default_rng(11)
    of_parameters = 0.1 * np.where(solver.present == 0.0, 0.1, solver.present)
    return [
        case.rate * random.normal(size=len(case.motors)),
        random.normal(size=3) * np.abs(case.force).max(),
        of_parameters * random.choice([-1.0, 1.0], len(of_parameters)),
    ]
