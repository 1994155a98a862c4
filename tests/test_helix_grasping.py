"""Grasp force: volumes of triangulated tubes, the perimeter of two half cylinders, forces summed over the wall."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from softrobots import helix
from softrobots.core.errors import ParameterError
from softrobots.helix import PAPER_CYLINDER, GraspForce, grasp_force
from tests.support.laws import law
from tests.support.tables import each_row

PAPER: dict[str, Any] = {
    "object_radius": PAPER_CYLINDER.object_radius,
    "turn_height": PAPER_CYLINDER.turn_height,
    "turns": PAPER_CYLINDER.turns,
    "diameter": PAPER_CYLINDER.diameter,
}
"""The paper's cylinder closed, without its gap."""
CASES = [
    PAPER,
    PAPER | {"object_radius": 0.035, "turns": 2.25, "diameter": 0.05},
    PAPER | {"turn_height": 0.0, "turns": 0.7},  # a hook in a plane
    PAPER | {"turn_height": 0.25},  # so steep that opening gains volume
]


# --- Oracles: nothing here calls the package


def meshed_volume(radius: float, pitch: float, turn_angle: float, diameter: float, rings: int, corners: int) -> float:
    """Volume of a tube around the helix of this inner radius: signed tetrahedra over the triangles of a closed surface."""
    s = np.linspace(0.0, turn_angle, rings)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    along = radius + 0.5 * diameter
    zero = np.zeros_like(s)
    centre = np.stack([along * np.cos(s), along * np.sin(s), pitch * s], axis=-1)
    normal = np.stack([-np.cos(s), -np.sin(s), zero], axis=-1)
    tangent = np.stack([-along * np.sin(s), along * np.cos(s), pitch + zero], axis=-1) / np.hypot(along, pitch)
    circle = np.cos(phi)[:, None] * normal + np.sin(phi)[:, None] * np.cross(tangent, normal)
    wall = centre + 0.5 * diameter * circle  # (rings, corners, 3)
    after = np.roll(wall, -1, axis=1)

    def tetrahedra(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        return float(np.sum(a * np.cross(b, c))) / 6.0

    sides = tetrahedra(wall[:-1], after[:-1], wall[1:]) + tetrahedra(after[:-1], after[1:], wall[1:])
    ends = tetrahedra(after[0], wall[0], np.broadcast_to(centre[0], wall[0].shape))
    ends += tetrahedra(wall[-1], after[-1], np.broadcast_to(centre[-1], wall[-1].shape))
    return abs(sides + ends)


def volume(radius: float, pitch: float, turn_angle: float, diameter: float) -> float:
    """The same with the quadratic error of the mesh taken out."""
    coarse = meshed_volume(radius, pitch, turn_angle, diameter, 201, 64)
    return (4.0 * meshed_volume(radius, pitch, turn_angle, diameter, 401, 128) - coarse) / 3.0


def volume_at_gap(gap: float, case: dict[str, Any], tested: float = 0.0) -> float:
    """Volume when the halves are that far apart: same inner length and pitch, the radius of a circle with their perimeter.

    The turns are those around the halves at the gap `tested`.
    """
    pitch = case["turn_height"] / (2.0 * np.pi)
    # two half circles and two straight ways between them
    radius, at_test = ((np.pi * case["object_radius"] + apart) / np.pi for apart in (gap, tested))
    inner_length = 2.0 * np.pi * case["turns"] * np.hypot(at_test, pitch)
    return volume(radius, pitch, inner_length / np.hypot(radius, pitch), case["diameter"])


# --- The paper's cylinder


def test_numbers_of_theory() -> None:
    grasp = grasp_force(10e3, deflection=PAPER_CYLINDER.deflections, **PAPER)
    np.testing.assert_allclose(grasp.volume, 313.9e-6, atol=0.05e-6)  # printed digits
    np.testing.assert_allclose(grasp.unwrapping, 11.17, atol=0.005)
    np.testing.assert_allclose(grasp.contact, [0.0, 11.22, 15.35], atol=0.005)
    np.testing.assert_allclose(grasp.force, [0.0, 11.17, 11.17], atol=0.005)
    opened = grasp_force(10e3, deflection=PAPER_CYLINDER.deflections, gap=0.003, **PAPER)
    assert np.array_equal(PAPER_CYLINDER.force(10e3).force, opened.force)
    assert PAPER_CYLINDER.force(10e3, 0.002).force == opened.force[1]
    np.testing.assert_allclose(opened.unwrapping, 11.19, atol=0.005)
    np.testing.assert_allclose(opened.contact, [8.15, 13.89, 17.37], atol=0.005)
    np.testing.assert_allclose(opened.force, [8.15, 11.19, 11.19], atol=0.005)
    assert PAPER_CYLINDER.force(10.72e3).force.max() < 12.0 < PAPER_CYLINDER.force(10.73e3).force.max()  # the sensor's range


def test_the_papers_cylinder() -> None:
    assert (2.0 * PAPER_CYLINDER.object_radius, PAPER_CYLINDER.turn_height, PAPER_CYLINDER.turns) == (0.040, 0.080, 1.5)
    assert (PAPER_CYLINDER.deflections, PAPER_CYLINDER.gap) == ((0.0, 0.002, 0.004), 0.003)


def test_volume_is_that_of_the_tube_that_an_actuator_makes() -> None:
    """The helix with the object's radius as inner radius, through the inverse solution and the volume of the tube."""
    pitch = PAPER["turn_height"] / (2.0 * np.pi)
    shape = helix.HelixShape(PAPER["object_radius"] + PAPER["diameter"], PAPER["object_radius"], pitch)
    contraction, angle, diameter = helix.inverse(shape)
    length = helix.length_for_turns(shape, angle, PAPER["turns"])
    expected = helix.volume(contraction, angle, diameter, length)
    assert grasp_force(1e4, deflection=0.0, **PAPER).volume == pytest.approx(float(expected), rel=1e-13)


# --- Virtual work


@pytest.mark.parametrize("case", CASES)
def test_volume_is_that_of_a_triangulated_tube(case: dict[str, Any]) -> None:
    pitch = case["turn_height"] / (2.0 * np.pi)
    expected = volume(case["object_radius"], pitch, 2.0 * np.pi * case["turns"], case["diameter"])
    # Left of the mesh after extrapolation: (2 pi / 64)^4 / 100 = 1e-6
    assert grasp_force(1e4, deflection=0.0, **case).volume == pytest.approx(expected, rel=2e-6)


@pytest.mark.parametrize("case", CASES)
def test_unwrapping_is_the_virtual_work_of_opening_the_cylinder(case: dict[str, Any]) -> None:
    step = 1e-5
    slope = (volume_at_gap(step, case) - volume_at_gap(-step, case)) / (2.0 * step)
    found = grasp_force(20e3, deflection=0.0, **case)
    # Truncation (step / radius)^2 = 3e-7; the errors of the mesh, 1e-6 of the volume, nearly cancel in the difference.
    assert found.volume_slope == pytest.approx(slope, rel=1e-4)
    assert found.unwrapping == pytest.approx(max(-20e3 * slope, 0.0), rel=1e-4)


@pytest.mark.parametrize("gap", [0.003, 0.01])
def test_unwrapping_at_a_gap_is_the_virtual_work_of_opening_further(gap: float) -> None:
    step = 1e-5
    slope = (volume_at_gap(gap + step, PAPER, gap) - volume_at_gap(gap - step, PAPER, gap)) / (2.0 * step)
    found = grasp_force(20e3, deflection=0.0, gap=gap, **PAPER)
    assert found.volume_slope == pytest.approx(slope, rel=1e-4)  # as above
    assert found.volume == pytest.approx(volume_at_gap(gap, PAPER, gap), rel=2e-6)


def test_a_steep_helix_is_not_held_by_unwrapping() -> None:
    """The volume is stationary at b^2 = R (R + D/2); beyond, opening gains volume."""
    radius, diameter = PAPER["object_radius"], PAPER["diameter"]
    limit = 2.0 * np.pi * np.sqrt(radius * (radius + diameter / 2.0))
    flat, steep = grasp_force(1e4, deflection=0.004, **(PAPER | {"turn_height": [0.999 * limit, 1.001 * limit]})).force
    assert steep == 0.0 < flat < 0.05


# --- Contact


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("deflection", [0.0005, 0.002, 0.009])
def test_contact_is_the_pressure_on_the_flattened_strip(case: dict[str, Any], deflection: float) -> None:
    """Force across the cut, summed along the strip, mean of both halves and of all directions of the cut."""
    pitch, radius = case["turn_height"] / (2.0 * np.pi), 0.5 * case["diameter"]
    edge = np.arccos((radius - deflection) / radius)  # where the section enters the object
    width = 2.0 * radius * np.sin(edge)
    per_angle = 15e3 * width * np.hypot(case["object_radius"], pitch)
    end = 2.0 * np.pi * case["turns"]
    cuts = np.linspace(0.0, np.pi, 20, endpoint=False)
    across = [quad(lambda s, cut=cut: abs(np.sin(s - cut)), 0.0, end, limit=200, epsabs=1e-7)[0] for cut in cuts]
    expected = 0.5 * per_angle * float(np.mean(across))  # half of it on each half
    found = grasp_force(15e3, deflection=deflection, **case)
    assert found.contact_width == pytest.approx(width, rel=1e-12)
    assert found.contact == pytest.approx(expected, rel=2e-3)  # the mean of 20 directions of a function with kinks: 1/20^2


@pytest.mark.parametrize(("deflection", "share"), [(0.0, 1.0509), (0.002, 0.9870), (0.004, 0.9725)])
def test_contact_across_a_gap_is_nearly_that_of_the_strip_on_two_half_circles(deflection: float, share: float) -> None:
    """Each moved out by half the gap, and the wall pressed in by what that makes of it at each place.

    At no deflection and next to no gap the strip is wider by `int cos^1.5 / (2 sqrt(2/pi))`, 9.5 %; then the halves are shorter
    than the circle of their perimeter.
    """
    gap, radius = PAPER_CYLINDER.gap, PAPER["object_radius"]
    rise = radius * PAPER["turn_height"] / (2.0 * np.pi * radius + 2.0 * gap)  # per angle on a half circle

    def across(angle: float) -> float:
        depth = np.hypot(0.5 * gap + radius * np.cos(angle), radius * np.sin(angle)) - (radius - deflection)
        return 2.0 * np.sqrt(depth * (PAPER["diameter"] - depth)) * np.cos(angle) * np.hypot(radius, rise)

    expected = 10e3 * PAPER["turns"] * quad(across, -np.pi / 2, np.pi / 2)[0]
    found = PAPER_CYLINDER.force(10e3, deflection)
    assert found.contact == pytest.approx(expected, rel=0.06)
    assert expected / found.contact == pytest.approx(share, abs=1e-4)  # 8.57 over 8.15 N, as the module says


# --- Laws


@law("helix.grasp_force")
@settings(max_examples=50, deadline=None)
@given(
    pressure=st.floats(0.0, 1e5),
    radius=st.floats(0.005, 0.2),
    share=st.floats(0.0, 1.0),
    rise=st.floats(1.0, 8.0),
    turns=st.floats(0.1, 9.0),
    diameter=st.floats(0.005, 0.2),
)
def test_force_is_linear_in_the_pressure_and_does_not_fall_with_the_deflection(
    pressure: float, radius: float, share: float, rise: float, turns: float, diameter: float
) -> None:
    case = {"object_radius": radius, "turn_height": rise * diameter, "turns": turns, "diameter": diameter}
    most = min(0.5 * diameter, radius)
    depths = most * np.linspace(0.0, share, 5)
    grasp, double = (grasp_force(p, deflection=depths, **case) for p in (pressure, 2.0 * pressure))
    np.testing.assert_allclose(double.force, 2.0 * grasp.force, rtol=1e-13)
    assert grasp.force[0] == 0.0
    assert np.all(np.diff(grasp.force) >= 0.0)
    assert np.all(np.diff(grasp.contact) > 0.0) or pressure * share * most < 1e-6
    assert np.all(grasp.force <= grasp.unwrapping)
    assert np.all((grasp.force == grasp.contact) | (grasp.force == grasp.unwrapping))
    assert np.all(np.isfinite(grasp.volume))


def test_force_rises_strictly_until_the_tube_would_rather_unwrap() -> None:
    grasp = grasp_force(1e4, deflection=np.linspace(0.0, 0.004, 401), **PAPER)
    rising = grasp.contact < grasp.unwrapping
    assert np.all(np.diff(grasp.force[rising]) > 0.0)
    assert np.ptp(grasp.force[~rising]) == 0.0
    assert grasp.deflection[rising][-1] == pytest.approx(0.00198, abs=1e-5)  # so 2 and 4 mm give one force


def test_arguments_broadcast() -> None:
    table = grasp_force(np.linspace(0.0, 2e4, 5)[:, None], deflection=PAPER_CYLINDER.deflections, **PAPER)
    assert table.force.shape == table.volume.shape == table.pressure.shape == (5, 3)
    assert grasp_force(1e4, deflection=0.002, **PAPER).force.shape == ()
    one = grasp_force(1.5e4, deflection=0.002, **PAPER)
    assert table.force[3, 1] == one.force


def test_the_result_keeps_what_was_asked() -> None:
    asked = {
        "object_radius": [0.02, 0.03],
        "deflection": 0.002,
        "turn_height": 0.08,
        "turns": 2,
        "diameter": 0.03,
        "gap": 0.001,
    }
    grasp = grasp_force(10_000, **asked)
    for name, value in (asked | {"pressure": 10_000}).items():
        kept = getattr(grasp, name)
        assert kept.tolist() == np.broadcast_to(value, 2).tolist()
        assert kept.dtype == np.float64
    assert {array.dtype for array in vars(GraspForce(*range(13))).values()} == {np.dtype(np.float64)}


def test_one_turn_may_be_flat() -> None:
    """Only the next turn collides with it."""
    assert grasp_force(1e4, **(PAPER | {"deflection": 0.002, "turn_height": 0.01, "turns": 1.0})).force > 0.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"deflection": 0.0166}, "from 0 to 0.01655 m"),
        ({"deflection": 0.011, "object_radius": 0.01}, "from 0 to 0.01 m"),
        ({"deflection": -0.0011, "gap": 0.001 * np.pi}, "from -0.001 to 0.01555 m"),
        ({"deflection": 0.0156, "gap": 0.001 * np.pi}, "from -0.001 to 0.01555 m"),
    ],
)
def test_the_largest_deflection_is_told(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ParameterError, match=f"{told}, the radius of the tube or that of the object"):
        grasp_force(**({"pressure": 1e4, **PAPER} | change))


def test_a_gap_wider_than_the_tube_is_blamed_itself() -> None:
    with pytest.raises(ParameterError, match=r"below pi times the radius of the tube, less the deflection, 0\.0457") as caught:
        grasp_force(1e4, deflection=0.002, gap=[0.001, 1e3], **PAPER)
    assert caught.value.field == "gap"


def test_the_result_is_frozen() -> None:
    grasp = grasp_force(1e4, deflection=[0.0, 0.002], **PAPER)
    with pytest.raises(ValueError, match="read-only"):
        grasp.force[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        grasp.force = 1.0


@each_row(
    ("change", "field"),
    [
        ({"pressure": -1.0}, "pressure"),
        ({"pressure": float("nan")}, "pressure"),
        ({"pressure": "high"}, "pressure"),
        ({"object_radius": 0.0}, "object_radius"),
        ({"object_radius": [0.02, -0.02]}, "object_radius"),
        ({"deflection": -1e-6}, "deflection"),
        ({"deflection": 0.0166}, "deflection"),  # more than the radius of the tube
        ({"deflection": 0.011, "object_radius": 0.01}, "deflection"),  # more than the radius of the object
        ({"deflection": float("inf")}, "deflection"),
        ({"turn_height": -0.01}, "turn_height"),
        ({"turn_height": 0.0330}, "turn_height"),  # the turns collide
        ({"turns": 0.0}, "turns"),
        ({"turns": float("nan")}, "turns"),
        ({"diameter": 0.0}, "diameter"),
        ({"gap": -0.001}, "gap"),
        ({"pressure": [1.0, 2.0], "deflection": [0.0, 0.001, 0.002]}, "diameter"),  # shapes do not broadcast
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        grasp_force(**({"pressure": 1e4, "deflection": 0.002, **PAPER} | change))
    assert caught.value.field == field
