"""The tube with a real actuator against the closed form of the helix, the limit of a wall that wrinkles without resistance.

An actuator contracts to lambda of its length, its frames without twist, and the line opposite keeps its length. Then the
actuator has, per length at contraction 1, the curvature (cos 2 theta - lambda) / D and the twist sin 2 theta / D: the tangent
of the line opposite is (-sin 2 theta, cos 2 theta) in its frames. That is (15) of [Blumenschein 2018] times lambda.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from softrobots.view.body import body_at
from tests.support.helix_rods import helix_frames
from tests.support.routed_arms import actuator, routed

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


@pytest.mark.study
@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"elastic_sections": 9, "handedness": "left"},
        {"contraction": 0.5, "angle": np.radians(20.0), "elastic_sections": 4},
    ],
    ids=str,
)
def test_the_closed_form_is_the_limit_of_a_wall_without_bending_stiffness(fields: dict[str, Any]) -> None:
    """Lengths of the actuator and of the line opposite given: first order in EI over GJ.

    Nothing changes along the tube: sections of constant strain carry it exactly, whatever their number.
    """
    sign = -1 if "handedness" in fields else 1
    helix = {name: fields[name] for name in ("contraction", "angle") if name in fields}
    found = [solved(actuator="length", bending_stiffness=stiffness, **fields) for stiffness in (1e-4, 1e-5)]
    assert all(one.stable for one in found)
    errors = np.array([error(one, sign, **helix) for one in found])
    assert errors[:-1] / errors[1:] == pytest.approx(10.0, rel=0.02)
    assert errors[-1] < 3e-5 * LENGTH


def test_without_an_angle_the_tube_is_an_arc_at_any_stiffness() -> None:
    """Nothing twists it; to the solver's tolerance."""
    found = solved(actuator="length", bending_stiffness=0.3, contraction=0.9, angle=0.0)
    assert error(found, contraction=0.9, angle=0.0) < 1e-10


def test_a_chain_along_the_centre_line_tends_to_another_helix() -> None:
    """Both lines wind around it; sections normal to the centre line, without twist of the wall, bend to A = 1 and A_i.

    A_i^2 + tan^2(theta) = (lambda / cos theta)^2 at the actuator: the stretch is (1 + A_i) / 2, D times curvature 1 - A_i.
    That is 8 % of the length from (12): it is not twisting the actuator's frames that makes the closed form.
    """
    half, length, stiffness = 0.5 * DIAMETER, 0.3, 1e-4
    turn, line = np.tan(ANGLE) * length / half, length / np.cos(ANGLE)
    around = [(1, (0.0, length), (half, half), (start, start + turn)) for start in (0.0, np.pi)]
    model = routed(
        *(actuator(name, piece, kind="length") for name, piece in zip(("actuator", "wall"), around, strict=True)),
        segment_lengths=(length,),
        bending_stiffness=stiffness,
        torsional_stiffness=0.2,
        axial_stiffness=2.0 * stiffness / half**2,
        elastic_sections=12,
    )
    found = sr.solve_equilibrium(model, [CONTRACTION * line, line])
    inner = np.sqrt(CONTRACTION**2 - np.sin(ANGLE) ** 2) / np.cos(ANGLE)
    stretch = 0.5 * (1.0 + inner)
    other = helix_frames((1.0 - inner) / DIAMETER / stretch, np.tan(ANGLE) / half / stretch, [stretch * length])[0, :3, 3]
    zeta = CONTRACTION * np.exp(2j * ANGLE)
    place = DIAMETER * (1.0 + zeta) / (2.0 * (1.0 - zeta))
    centre = length * abs(1.0 + zeta) / (2.0 * np.cos(ANGLE))
    closed = helix_frames(place.real / abs(place) ** 2, place.imag / abs(place) ** 2, [centre])[0, :3, 3]
    assert np.linalg.norm(found.tip_position - other) < 2e-3 * length
    assert np.linalg.norm(found.tip_position - closed) > 0.07 * length


@pytest.mark.study
def test_under_pressure_the_tension_tends_to_the_closed_form_at_first_order() -> None:
    """T = P dV/dLa plus what the wall resists, in proportion to EI; the shape is (12) but for the strain of the wall, 1e-6."""
    zeta = CONTRACTION * np.exp(2j * ANGLE)
    closed = PRESSURE * np.pi * DIAMETER**2 / 4 * (CONTRACTION + np.cos(2 * ANGLE)) / (2 * abs(1 + zeta))
    excess = []
    for stiffness in (1e-4, 1e-5):
        found = solved(actuator="elastic", young_modulus=INEXTENSIBLE, bending_stiffness=stiffness)
        assert found.stable
        assert error(found) < 2e-6 * LENGTH
        excess.append(found.motor_torques[0] - closed)
    assert np.array(excess[:-1]) / excess[1:] == pytest.approx(10.0, rel=0.01)
    assert excess[-1] < 0.01 * closed


def test_pressure_untwists_the_tube_in_proportion_to_the_softness_of_its_wall() -> None:
    """Whatever EI: with a modulus ten times less the error is ten times more."""
    errors = [error(solved(actuator="elastic", young_modulus=modulus, bending_stiffness=1e-4)) for modulus in (2e9, 2e10)]
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(10.0, rel=0.1)
    assert errors[0] < 4e-4 * LENGTH


# --- The robot at rest, and its picture


@pytest.mark.study
@pytest.mark.parametrize("hand", ["right", "left"])
def test_at_rest_the_tube_is_straight_beside_the_chain(hand: str) -> None:
    """Body, masses and tip are on the axis of the tube; the chain is the line of the actuator around it."""
    tube = sr.HelixTube(length=LENGTH, actuator="elastic", elastic_sections=6, handedness=hand)
    model = sr.load_model(tube)
    found = sr.solve_equilibrium(model, [1.0, 1.0, 0.0])
    assert found.motor_torques == pytest.approx([0.0, 0.0, 0.0])
    body = body_at(model, found.q_motors, found.q_springs, 8)[0]
    assert body.backbone == pytest.approx(np.outer(np.linspace(0.0, LENGTH, 49), [0.0, 0.0, 1.0]), abs=1e-12)
    tip = found.transform_tip_to_world
    assert tip.homogeneous[:, 2:] == pytest.approx(np.array([[0.0, 0.0], [0.0, 0.0], [1.0, LENGTH], [0.0, 1.0]]), abs=1e-12)
    turn = 2.0 * np.tan(ANGLE) * LENGTH / DIAMETER * (1.0 if hand == "right" else -1.0)
    end = frame_placement(model, found.q, "section_1_6").translation
    assert end == pytest.approx([0.5 * DIAMETER * np.cos(turn), 0.5 * DIAMETER * np.sin(turn), LENGTH], abs=1e-12)
    mass, centre = masses(model, found.q)
    assert mass == pytest.approx(tube.mass, abs=2e-4)  # a tiny link stands where the chain starts
    assert centre == pytest.approx([0.0, 0.0, 0.5 * LENGTH], abs=2e-3 * LENGTH)


def masses(model: sr.SoftModel, q: np.ndarray) -> tuple[float, np.ndarray]:
    """Mass of the moving links and where its centre is, at rest."""
    rigid, data = model.workspace(None)
    pin.centerOfMass(rigid, data, model.embed(q) if len(q) != rigid.nq else q)
    return float(data.mass[0]), np.array(data.com[0])


def test_the_bent_tube_is_drawn_on_the_centre_line_of_the_helix() -> None:
    """All points keep the centre line's distance from one axis, with its pitch: chords of the closed form."""
    found = solved(actuator="elastic", young_modulus=INEXTENSIBLE, bending_stiffness=1e-4)
    points = body_at(found.model, found.q_motors, found.q_springs, 8)[0].backbone
    zeta = CONTRACTION * np.exp(2j * ANGLE)
    place = DIAMETER * (1.0 + zeta) / (2.0 * (1.0 - zeta))
    turn = CONTRACTION * LENGTH / np.cos(ANGLE) / 48 / abs(DIAMETER * zeta / (1.0 - zeta))
    for step in (1, 10, 48):
        chords = np.linalg.norm(points[step:] - points[:-step], axis=1)
        exact = np.hypot(2.0 * place.real * np.sin(0.5 * step * turn), place.imag * step * turn)
        assert chords == pytest.approx(exact, rel=2e-5)


@pytest.mark.parametrize(
    ("middle", "message"), [("0.1", "2 to 1000 finite numbers"), ("0 0 0", "3 numbers as its middle; x and y")]
)
def test_a_middle_that_is_no_point_is_refused(middle: str, message: str) -> None:
    urdf = sr.HelixTube(length=LENGTH, actuator="elastic", elastic_sections=6).urdf()
    with pytest.raises(sr.DescriptionError, match=message):
        sr.load_model(urdf.replace('middle="-0.01655 0.0"', f'middle="{middle}"', 1))


def test_a_tube_with_a_real_actuator_has_no_growth_on_the_helix() -> None:
    with pytest.raises(sr.ParameterError, match='a HelixTube with actuator="drawn"'):
        sr.grown_coordinates(sr.HelixTube(actuator="elastic"), 1.0)
