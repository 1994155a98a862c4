"""The tubes to validate: committed files, a grid of actuators, and random actuators."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from softrobots import helix
from softrobots.description.paths import urdf_folder
from softrobots.robots import HelixTube

ANGLES = (2.5, 5.0, 10.0)
CONTRACTIONS = (0.5, 0.6, 0.7, 0.8, 0.9)
DIAMETERS = (0.0331, 0.08275)
TURNS = (1.0, 4.0)
SECTIONS_A_TURN = 3
"""Sections or hinges a turn in the grid; for a turn by 120 degrees a section is long."""
FORMS: Mapping[str, Mapping[str, Any]] = {
    "sections": {"chain": "sections"},
    "lumped": {"chain": "lumped"},
    "lumped, midpoint": {"chain": "lumped", "hinge_rule": "midpoint"},
}
"""Forms of the chain."""
FILES = ("helix_tube", "helix_tube_lumped")
"""The committed URDF files."""


class Case(NamedTuple):
    """A tube to validate."""

    group: str
    """The set that it is part of."""
    form: str
    """Key of `FORMS`."""
    tube: HelixTube
    """Its parameters."""
    file: Path | None = None
    """Its URDF; None: written afresh."""


def committed() -> Iterator[Case]:
    """The tubes of the committed files."""
    for name, form in zip(FILES, ("sections", "lumped"), strict=True):
        tube = sr.ROBOTS[name]()
        if isinstance(tube, HelixTube):
            yield Case("committed file", form, tube, urdf_folder() / f"{name}.urdf")


def grid() -> Iterator[Case]:
    """The tubes of the grid; which end stands upright alternates."""
    actuators = itertools.product(ANGLES, CONTRACTIONS, DIAMETERS, helix.HANDEDNESS, TURNS)
    for number, (degrees, contraction, diameter, handedness, turns) in enumerate(actuators):
        angle = math.radians(degrees)
        length = float(helix.length_for_turns(helix.forward(contraction, angle, diameter), angle, turns))
        count = math.ceil(SECTIONS_A_TURN * turns)
        for form in ("sections", "lumped"):
            tube = HelixTube(
                length=length, diameter=diameter, contraction=contraction, angle=angle, handedness=handedness,
                upright=("tube", "axis")[number % 2], elastic_sections=count, hinges=count, **FORMS[form],
            )  # fmt: skip
            yield Case("grid", form, tube)


def drawn(cases: int, seed: int) -> Iterator[Case]:
    """Random tubes, self-contact or not, in every form: angle up to 60 degrees, contraction from 0.2, up to 4 turns."""
    rng = np.random.default_rng(seed)
    for _ in range(cases):
        angle, contraction = math.radians(rng.uniform(0.5, 60.0)), float(rng.uniform(0.2, 0.999))
        diameter, turns = float(10.0 ** rng.uniform(-2.0, -0.5)), float(rng.uniform(0.1, 4.0))
        length = float(helix.length_for_turns(helix.forward(contraction, angle, diameter), angle, turns))
        handedness, upright = (str(rng.choice(options)) for options in (helix.HANDEDNESS, ("tube", "axis")))
        count = math.ceil(SECTIONS_A_TURN * turns) + int(rng.integers(6))
        for form, fields in FORMS.items():
            tube = HelixTube(
                length=length, diameter=diameter, contraction=contraction, angle=angle, handedness=handedness, upright=upright,
                wall_thickness=0.01 * diameter, actuator_density=0.1 / length, allow_self_contact=True,
                elastic_sections=count, hinges=count, **fields,
            )  # fmt: skip
            yield Case("random", form, tube)
