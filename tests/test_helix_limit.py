"""The tube with a real actuator against the closed form of the helix, the limit of a wall that wrinkles without resistance.

An actuator contracts to lambda of its length, its frames without twist, and the line opposite keeps its length. Then the
actuator has, per length at contraction 1, the curvature (cos 2 theta - lambda) / D and the twist sin 2 theta / D: the tangent
of the line opposite is (-sin 2 theta, cos 2 theta) in its frames. That is (15) of [Blumenschein 2018] times lambda.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from tests.support.helix_rods import helix_frames

ANGLE, CONTRACTION, DIAMETER, LENGTH, PRESSURE = np.radians(5.0), 0.66, 0.0331, 0.5, 1e4
INEXTENSIBLE = 2e12
"""Modulus of a wall that hardly stretches or shears: ten thousand times that of the default [Pa]."""


def solved(**fields: Any) -> sr.Equilibrium:
    tube = sr.HelixTube(length=LENGTH, **({"elastic_sections": 6} | fields))
    return sr.solve_equilibrium(sr.load_model(tube), tube.q_motors)


def helix_of_actuator(sign: int, contraction: float = CONTRACTION, angle: float = ANGLE) -> tuple[float, float]:
    """Curvature and torsion of the actuator's path, from Ri + i b = D z / (1 - z) with z = lambda exp(2 i theta)."""
    zeta = contraction * np.exp(2j * angle)
    place = DIAMETER * zeta / (1.0 - zeta)
    return place.real / abs(place) ** 2, sign * place.imag / abs(place) ** 2


def error(found: sr.Equilibrium, sign: int = 1, contraction: float = CONTRACTION, angle: float = ANGLE) -> float:
    """Largest distance of the ends of the sections from the path of the actuator, in the frame where it starts [m]."""
    count = len(found.strains)
    places = np.arange(1, count + 1) / count * contraction * LENGTH / np.cos(angle)
    exact = helix_frames(*helix_of_actuator(sign, contraction, angle), places)
    poses = [frame_placement(found.model, found.q, name).homogeneous for name in ("segment_1_start", *SECTIONS[:count])]
    return float(np.linalg.norm((np.linalg.inv(poses[0]) @ poses[1:] - exact)[:, :3, 3], axis=1).max())


SECTIONS = tuple(f"section_1_{number}" for number in range(1, 51))


def test_under_pressure_the_tension_tends_to_the_closed_form_at_first_order() -> None:
    """T = P dV/dLa plus what the wall resists, in proportion to EI; the shape is (12) but for the strain of the wall, 1e-6."""
    zeta = CONTRACTION * np.exp(2j * ANGLE)
    closed = PRESSURE * np.pi * DIAMETER**2 / 4 * (CONTRACTION + np.cos(2 * ANGLE)) / (2 * abs(1 + zeta))
    excess = []
    for stiffness in (1e-3, 1e-4, 1e-5):
        found = solved(actuator="elastic", young_modulus=INEXTENSIBLE, bending_stiffness=stiffness)
        assert found.stable
        assert error(found) < 2e-6 * LENGTH
        excess.append(found.motor_torques[0] - closed)
    assert np.array(excess[:-1]) / excess[1:] == pytest.approx(10.0, rel=0.01)
    assert excess[-1] < 0.01 * closed


def test_pressure_untwists_the_tube_in_proportion_to_the_softness_of_its_wall() -> None:
    """Whatever EI: with a modulus ten times less the error is ten times more."""
    errors = [error(solved(actuator="elastic", young_modulus=modulus, bending_stiffness=1e-4)) for modulus in (2e9, 2e10, 2e11)]
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(10.0, rel=0.1)
    assert errors[0] < 4e-4 * LENGTH
