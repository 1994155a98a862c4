"""Values of single actuators, and segments that are bent where they carry nothing: balance by hand, closed forms, URDF."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import softrobots as sr
from softrobots.robots.field_values import numbers
from softrobots.robots.fields import facts_of, per_actuator
from tests.support.laws import law
from tests.support.tables import each_row

LENGTHS = (0.060, 0.0625, 0.064)
OFFSET = (-3.0, 0.5, 0.4)


def own_values(rng: np.random.Generator) -> dict[str, list[float]]:
    """Values of nine tendons and of three segments, all different."""
    by_tendon = {"distance": (4e-3, 5e-3), "azimuth_deviation": (-0.2, 0.2), "stiffness": (5e3, 12e3), "pretension": (0.0, 3.0)}
    values = {f"tendon_{name}": rng.uniform(*bounds, 9).tolist() for name, bounds in by_tendon.items()}
    return values | {f"rest_bend_{axis}": rng.uniform(-0.3, 0.3, 3).tolist() for axis in "xy"}


@pytest.mark.study
@law("TendonArm")
@settings(max_examples=4)
@given(st.integers(0, 2**31))
def test_every_segment_is_in_balance_with_tendons_of_their_own(seed: int) -> None:
    """Moment and axial force of a segment are those of the tendons through it, with the lengths of straight tendons along arcs.

    Without weight the moment of straight tendons is constant along a segment: one section is exact. An equilibrium is
    settled to 1e-10 of the moments, some N mm.
    """
    rng = np.random.default_rng(seed)
    values, pulls = own_values(rng), rng.uniform(-0.008, 0.008, 9)
    arm = sr.TendonArm(segment_lengths=LENGTHS, offset=OFFSET, elastic_sections=1, axial_stiffness=5e3, **values)
    model = sr.load_model(arm)
    found = sr.solve_equilibrium(model, [tag.rest_length for tag in model.muscles] - pulls)
    bend_x, bend_y, twist, stretch = found.q_springs.reshape(3, 4).T
    assert np.allclose(twist, 0.0, atol=1e-12)
    turns = np.cumsum(OFFSET)
    moments, force = np.zeros((3, 2)), np.zeros(3)
    for tendon in range(9):
        owner, distance = tendon // 3, values["tendon_distance"][tendon]
        azimuth = turns[owner] + 2.0 * math.pi / 3.0 * (tendon % 3) + values["tendon_azimuth_deviation"][tendon]
        local = azimuth - turns[: owner + 1]
        arms = np.stack([distance * np.sin(local), -distance * np.cos(local)], axis=1)
        longer = np.sum(arms[:, 0] * bend_x[: owner + 1] + arms[:, 1] * bend_y[: owner + 1] + stretch[: owner + 1])
        tension = values["tendon_pretension"][tendon] + values["tendon_stiffness"][tendon] * (longer + pulls[tendon])
        assert found.muscle_forces[tendon] == pytest.approx(max(0.0, tension), abs=1e-6)
        moments[: owner + 1] -= max(0.0, tension) * arms
        force[: owner + 1] -= max(0.0, tension)
    bending = 50e9 * math.pi * 0.0005**4 / 4.0 / np.array(LENGTHS)
    beyond = np.stack([bend_x - values["rest_bend_x"], bend_y - values["rest_bend_y"]], axis=1)
    assert np.allclose(bending[:, None] * beyond, moments, atol=1e-8)
    assert np.allclose(5e3 / np.array(LENGTHS) * stretch, force, atol=1e-6)


@pytest.mark.study
@pytest.mark.parametrize(("chain", "tolerance"), [("sections", 1e-12), ("lumped", 5e-4)])
def test_a_rod_that_carries_nothing_has_the_shape_of_rest(chain: str, tolerance: float) -> None:
    """A screw of 0.4, -0.3 and 0.5 rad along 1 m, then one of -0.2 rad; ten hinges err by about (0.7 / 10)^2 / 10 of it."""
    fields = {"rest_bend_x": (0.4, -0.2), "rest_bend_y": (-0.3, 0.0), "rest_twist": (0.5, 0.0)}
    robot = sr.PccArm(segment_lengths=(1.0, 0.5), offset=(0.0, 0.7), muscle_azimuths=(), chain=chain, hinges=10, **fields)
    found = sr.solve_equilibrium(sr.load_model(robot), [])
    pose = np.eye(4)
    for length, turn, (a, b, c) in zip((1.0, 0.5), (0.0, 0.7), zip(*fields.values(), strict=True), strict=True):
        pose = pose @ expm(np.array([[0, -turn, 0, 0], [turn, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0.0]]))
        pose = pose @ expm(np.array([[0, -c, b, 0], [c, 0, -a, 0], [-b, a, 0, length], [0, 0, 0, 0.0]]))
    assert np.allclose(found.tip_position, pose[:3, 3], atol=tolerance)
    assert np.allclose(np.array(found.transform_tip_to_world.rotation), pose[:3, :3], atol=5.0 * tolerance)


def test_muscles_of_given_length_bend_as_their_own_places_say() -> None:
    """Lengths of three muscles along one arc, by hand, give back the arc."""
    distance, deviation, bend, azimuth = (0.03, 0.04, 0.05), (0.1, -0.2, 0.3), 0.6, 1.1
    robot = sr.PccArm(segment_lengths=(0.5,), offset=0.0, muscle_distance=distance, muscle_azimuth_deviation=deviation)
    around = np.array(robot.muscle_azimuths) + deviation
    model = sr.load_model(robot)
    found = sr.solve_equilibrium(model, 0.5 - bend * np.array(distance) * np.cos(around - azimuth))
    reach, height = 0.5 * (1.0 - math.cos(bend)) / bend, 0.5 * math.sin(bend) / bend
    expected = (reach * math.cos(azimuth), reach * math.sin(azimuth), height)
    assert np.allclose(found.tip_position, expected, atol=1e-10)


@pytest.mark.study
@pytest.mark.parametrize("kind", [sr.TendonArm, sr.PccArm])
def test_one_value_a_segment_is_that_of_each_of_its_actuators(kind: type) -> None:
    """The text is the same by segment and by actuator; a file of before, without relaxed strains, is the same robot."""
    parts = {"segment_lengths": (0.1, 0.1), "elastic_sections": 1, "kind": "elastic"}
    word = kind.ACTUATOR
    names = [name for name, facts in facts_of(kind).items() if facts.form == "per_actuator"]
    assert {f"{word}_{name}" for name in ("stiffness", "pretension", "distance", "azimuth_deviation", "force")} <= set(names)
    values = {f"{word}_stiffness": (5e3, 7e3), f"{word}_pretension": (1.0, 3.0), f"{word}_distance": (0.004, 0.005)}
    by_segment = kind(**parts, **values)
    by_actuator = kind(**parts, **{name: np.repeat(value, 3) for name, value in values.items()})
    assert by_actuator.urdf() == by_segment.urdf()
    for name in names:
        if getattr(by_segment, name) is not None:
            assert (
                by_actuator.by_actuator(name) == by_segment.by_actuator(name) == tuple(np.repeat(getattr(by_segment, name), 3))
            )
    assert by_segment.actuator_segments == (0, 0, 0, 1, 1, 1)
    old = re.sub(r' relaxed="[^"]*"', "", by_segment.urdf())
    motors = sr.load_model(old).relaxed_motors - 1e-3 * np.arange(6)
    one, two = (sr.solve_equilibrium(sr.load_model(text), motors).tip_position for text in (old, by_segment.urdf()))
    assert np.array_equal(one, two)


def test_actuators_on_listed_routes_have_values_of_their_own() -> None:
    routes = [
        {"at": (0.0, end), "azimuth": azimuth, "distance": 0.004} for end, azimuth in ((0.2, 0.0), (0.1, 2.0), (0.2, 4.0))
    ]
    arm = sr.TendonArm(
        segment_lengths=(0.1, 0.1), routing=routes, tendon_pretension=(1.0, 2.0, 3.0), tendon_stiffness=(5e3, 6e3)
    )
    assert arm.actuator_segments == (1, 0, 1)
    tags = sr.load_model(arm).muscles
    assert [tag.pretension for tag in tags] == [1.0, 2.0, 3.0]
    assert [tag.stiffness for tag in tags] == list(arm.by_actuator("tendon_stiffness")) == [6e3, 5e3, 6e3]


@each_row(
    ("fields", "told"),
    [
        ({"tendon_stiffness": (1e3,) * 4}, "one number, or one for each of the 3 segments or of the 9 actuators"),
        ({"tendon_stiffness": [1e3] * 8 + [0.0]}, "tendon_stiffness must be above 0"),
        ({"tendon_azimuth_deviation": 0.6}, "at most 0.5"),
        ({"rest_bend_x": (0.1, 0.2)}, "one number, or one for each of the 3 segments"),
        ({"rest_bend_y": 2.0}, r"at most 1.5708 \[rad\]"),
        ({"tendon_force": [60.0] * 8 + [1.0], "tendon_least_tension": 1.0}, "tendon_least_tension must be below tendon_force"),
        (
            {"routing": [{"at": (0.0, 0.1), "azimuth": 0.0, "distance": 0.004}], "tendon_azimuth_deviation": 0.1},
            "left out where routing lists the routes",
        ),
    ],
)
def test_values_of_other_number_or_size_are_refused(fields: dict, told: str) -> None:
    with pytest.raises(sr.ParameterError, match=told):
        sr.TendonArm(**fields)


@pytest.mark.study
@law("robots.fields.per_actuator")
@given(default=st.floats(0.0, 1e3))
def test_a_field_by_actuator_is_a_tuple_of_either_length(default: float) -> None:
    field = per_actuator(default, "N", "Tension", above=0.0)
    assert field.default == default
    assert field.metadata["facts"].form == "per_actuator"
    assert numbers("a", 2.0, 2, "N", "segments", 6) == (2.0, 2.0)
    assert numbers("a", range(6), 2, "N", "segments", 6) == tuple(map(float, range(6)))
    arm = sr.TendonArm(tendon_pretension=range(9))
    assert dataclasses.replace(arm, tendon_stiffness=9e3 + default).tendon_pretension == tuple(map(float, range(9)))


def test_the_reader_refuses_relaxed_strains_that_are_none() -> None:
    text = sr.TendonArm(elastic_sections=1).urdf()
    for wrong in ("0 0 0", "0 0 nan 1", "0 0 0 -1", "inf 0 0 1"):
        with pytest.raises(sr.DescriptionError, match=r"relaxed = .*a positive stretch"):
            sr.load_model(text.replace('relaxed="0.0 0.0 0.0 1.0"', f'relaxed="{wrong}"', 1))


@pytest.mark.study
def test_the_stiffness_of_a_backbone_is_what_a_fit_starts_from() -> None:
    """A robot whose fields hold what its backbone has is the same robot; measured values stand as they are."""
    arm = sr.TendonArm(backbone_radius=(4e-4, 5e-4, 6e-4), elastic_sections=1)
    kinds = ("bending", "torsional", "axial")
    told = {f"{kind}_stiffness": getattr(arm, f"{kind}_in_force") for kind in kinds}
    assert told["axial_stiffness"] == pytest.approx([50e9 * math.pi * radius**2 for radius in arm.backbone_radius])
    measured = dataclasses.replace(arm, **told)
    assert {f"{kind}_stiffness": getattr(measured, f"{kind}_in_force") for kind in kinds} == told
    springs = sr.load_model(arm).stiffness
    assert np.allclose(sr.load_model(measured).stiffness, springs, rtol=1e-15)
