"""Robots of every kind, and their chains of joints written out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.model.soft_model import SoftModel
from tests.support.foreign import INERTIAL, joint
from tests.support.routed_arms import Piece, actuator, routed
from tests.support.screw_motions import rotation, screw_matrix

HEAVY = INERTIAL.replace("<inertial>", '<inertial><origin xyz="0.02 -0.03 0.05" rpy="0.3 0 0"/>')  # off its link's origin


# An odd axis, a slide on a slanted one, a continuous joint about -y, and fixed links with mass in between.
ODD = (
    f'<robot name="odd"><link name="base">{INERTIAL}</link>'
    + joint("plinth", "base", "column", "0 0 1", "fixed", "0.1 0 0.2", "0 0 1")
    + joint("turn", "column", "arm", "1 2 3")
    + joint("plate", "arm", "side", "0 0 1", "fixed", "0 0.1 0", "1 0 0")
    + joint("slide", "side", "sledge", "0 -0.6 0.8", "prismatic", "0.2 0.1 0")
    + joint("box", "sledge", "case", "0 0 1", "fixed", "0 0 0.1", "0 1 0")
    + joint("wheel", "case", "fork", "0 -1 0", "continuous", "0.1 0 0.1", f"{math.pi / 2} 0 {-math.pi / 2}")
    + joint("nose", "fork", "end", "-3 0 1", "revolute", "0.2 0 0")
    + joint("cap", "end", "tool", "0 0 1", "fixed", "0.05 0.02 -0.1", "0.2 0.4 0.6")
    + "</robot>"
).replace(INERTIAL, HEAVY)


def odd() -> SoftModel:
    return sr.load_model(ODD, springs={"slide": (900.0, 0.02), "nose": (30.0, -0.1)})


def pcc(**options: object) -> SoftModel:
    muscles = {"muscles": options.pop("muscles")} if "muscles" in options else {}
    return sr.load_model(sr.PccArm(segment_lengths=(0.5, 0.4), bending_stiffness=(1.9, 1.2), **options), **muscles)


def uneven() -> SoftModel:
    """Hinges of one segment that differ in stiffness."""
    alike = pcc(chain="lumped", hinges=3)
    table = {name: ((1.0 + place / 5) * k, rest) for place, (name, (k, rest)) in enumerate(alike.spring_table.items())}
    return sr.load_model(alike.urdf, springs=table)


LENGTHS = (0.5, 0.4)
ARM: dict[str, Any] = {"segment_lengths": LENGTHS, "elastic_sections": 1, "offset": 0.0}
LUMPED: dict[str, Any] = {"segment_lengths": LENGTHS, "chain": "lumped", "offset": 0.0}
LAWS: dict[str, dict[str, float]] = {
    "elastic": {"stiffness": 9e3, "pretension": 3.0},
    "mckibben": {"diameter": 0.008, "braid_angle": 0.5},
    "pressure": {"area": 1e-4},
    "tension": {},
}
ROUTES: dict[str, list[Piece]] = {
    "elastic": [(1, (0.0, 0.5), (0.04, 0.04), (0.0, 1.0)), (2, (0.0, 0.25), (0.04, 0.04), (1.0, 0.4))],
    "mckibben": [(1, (0.1, 0.3, 0.4), (0.04, 0.05, 0.03), (2.0, 2.0, 2.6))],
    "pressure": [(1, (0.2, 0.5), (0.03, 0.03), (4.2, 4.2)), (2, (0.0, 0.4), (0.03, 0.03), (4.2, 4.2))],
    "tension": [(2, (0.1, 0.4), (0.03, 0.04), (5.0, 3.5))],
}
"""A helix through both segments, a cone within the first, a straight chamber from its middle on, and a helical cone."""

HALF_STRAIGHT = ROUTES | {
    "elastic": [(1, (0.0, 0.5), (0.04, 0.04), (0.0, 0.0)), *ROUTES["elastic"][1:]],
    "mckibben": [(1, (0.1, 0.4), (0.04, 0.04), (2.0, 2.0))],
}
"""The same, straight along the first segment."""


def coil(azimuth: float) -> str:
    """A muscle of given length that winds through one and a half segments and comes nearer to the backbone."""
    on, back = (azimuth, azimuth + 0.6), (azimuth + 0.6, azimuth)
    return actuator(f"coil_{azimuth}", (1, (0.1, 0.5), (0.04, 0.04), on), (2, (0.0, 0.3), (0.04, 0.03), back), kind="length")


ROBOTS: dict[str, Callable[[], SoftModel]] = {
    "arm": lambda: sr.load_model(sr.InflatableArm()),
    "two_hinges": lambda: sr.load_model(sr.InflatableArm(link_model="two_hinges", torsion=True)),
    "pcc": lambda: pcc(elastic_sections=2),
    "pcc_forces": lambda: pcc(elastic_sections=2, muscles="forces"),
    "pcc_lumped": lambda: pcc(chain="lumped", hinges=2),
    "flexures": lambda: sr.load_model(sr.PccArm(chain="flexures", muscle_azimuths=(), hinges=2, extension=False)),
    "helix": lambda: sr.load_model(sr.HelixTube(elastic_sections=6)),
    "helix_lumped": lambda: sr.load_model(sr.HelixTube(chain="lumped", hinges=6)),
    "odd": odd,
    "stacked": lambda: sr.load_model(sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(elastic_sections=2))),
    "uneven": uneven,
    "tendons": lambda: sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.0625), elastic_sections=2)),
    "winding": lambda: routed(*(actuator(kind, *ROUTES[kind], kind=kind, **law) for kind, law in LAWS.items()), **ARM),
    "coils": lambda: routed(*(coil(place) for place in (0.0, 2.0, 4.0)), **ARM),
    "lumped_winding": lambda: routed(
        *(actuator(kind, *HALF_STRAIGHT[kind], kind=kind, **law) for kind, law in LAWS.items()),
        **LUMPED,
        hinges=2,
    ),
    "lumped_coils": lambda: routed(*(coil(place) for place in (0.0, 2.0, 4.0)), **LUMPED, hinges=1),
}


def placed(turn: np.ndarray, position: np.ndarray) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = turn, position
    return made


def moved_by(slides: bool, amount: float) -> np.ndarray:
    return placed(np.eye(3), np.array([0.0, 0.0, amount])) if slides else rotation(2, amount)


def section_frames(z: np.ndarray, length: float) -> list[np.ndarray]:
    """Frames behind the six joints of a section, in its start; the last is SciPy's exponential of the strain."""
    end = screw_matrix(z, length)
    x, y, along = end[:3, 3]
    first = rotation(0, math.atan2(-y, along))
    second = first @ rotation(1, math.atan2(x, math.hypot(y, along)))
    third = second @ moved_by(True, math.hypot(x, y, along))
    about_x, about_y, _ = Rotation.from_matrix(second[:3, :3].T @ end[:3, :3]).as_euler("XYZ")
    fourth = third @ rotation(0, about_x)
    return [first, second, third, fourth, fourth @ rotation(1, about_y), end]


def drawn(model: SoftModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random actuators within their limits, and elastic coordinates up to half a radian or 3 cm from rest."""
    motors = None
    while motors is None:
        motors = model.actuators.draw(rng)
    size = np.where(model.springs.turning, 0.5, 0.03)
    return motors, model.rest + size * rng.uniform(-1.0, 1.0, model.n_springs)
