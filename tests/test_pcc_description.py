"""The PCC arm as a description: on the arc, with the mass of a rod, portable, and refused where it makes no robot."""

from __future__ import annotations

import functools
import io
import itertools
import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import NAMESPACE
from softrobots.robots import PccArm
from softrobots.statics.kinematics import frame_placement
from softrobots.view.actuator_curves import actuator_curves
from softrobots.view.body import BentSections, body_at
from tests.support.laws import law
from tests.support.tables import each_row
from tests.support.urdf_reading import (
    Mass,
    changed,
    check_portable,
    edited,
    gazebo_numbers,
    link_masses,
    link_poses,
    numbers,
    spring_numbers,
    together,
    within_joint,
)

XACRO = xacro_folder() / PccArm.XACRO
SHAPES: tuple[dict[str, Any], ...] = (
    {"segment_lengths": (0.524,)},
    {"segment_lengths": (0.5, 0.3), "offset": (0.4, -1.1), "elastic_sections": 3},
    {"segment_lengths": (0.5, 0.35, 0.2), "offset": math.pi / 3},
    {"segment_lengths": (0.2, 0.4, 0.3, 0.25), "offset": (-0.7, 1.0, 2.0, 0.3), "elastic_sections": 2},
)
UNEVEN: dict[str, Any] = {
    "segment_lengths": (0.5, 0.3),
    "offset": (0.3, 0.8),
    "bending_stiffness": (2.0, 0.7),
    "torsional_stiffness": (1.1, 0.4),
    "axial_stiffness": (2000.0, 900.0),
    "linear_density": (0.7, 0.4),
    "radius": (0.05, 0.03),
    "muscle_azimuths": (),
}
TOTAL = np.array([1.1, -1.6, 0.8, 0.05])  # bending about x, y and twist [rad], elongation [m] of a whole segment of 0.5 m
COORDINATES = ("bend_x", "bend_y", "twist", "stretch")


# --- Oracles: nothing here calls the package


def turned(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def screw(z: Sequence[float], h: float) -> np.ndarray:
    """Motion of a section of rest length h: rotation about x, y and twist [rad], elongation [m]."""
    x, y, twist, stretch = z
    return expm(np.array([[0, -twist, y, 0], [twist, 0, -x, 0], [-y, x, 0, h + stretch], [0, 0, 0, 0]]))


def rod_frames(robot: PccArm, z: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """The frames of an arm with `count` sections a segment: turn by the offset, then one screw after another."""
    pose, frames, rows = np.eye(4), {}, iter(z)
    for s, (length, offset) in enumerate(zip(robot.segment_lengths, robot.offset, strict=True), start=1):
        pose = pose @ turned(offset)
        for i in range(1, count + 1):
            pose = pose @ screw(next(rows), length / count)
            frames[f"section_{s}_{i}"] = pose
        frames[f"segment_{s}"] = pose
    return frames | {"tip": pose}


def straight_rods(robot: PccArm) -> Mass:
    """Solid cylinders on top of one another, closed form."""
    bodies, height = [], 0.0
    for length, density, radius in zip(robot.segment_lengths, robot.linear_density, robot.radius, strict=True):
        mass = density * length
        across = mass * (3 * radius**2 + length**2) / 12
        bodies.append((mass, np.array([0, 0, height + length / 2]), np.diag([across, across, mass * radius**2 / 2])))
        height += length
    return together(bodies)


def bent_rod(length: float, density: float, radius: float, total: np.ndarray) -> Mass:
    """Thin discs along a screw of constant strain, 40 Gauss points: exact to rounding for a radian or two of bending."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    bodies = []
    for share, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
        pose, mass = screw(share * total, share * length), weight * density * length
        disc = mass * radius**2 * np.diag([0.25, 0.25, 0.5])
        bodies.append((mass, pose[:3, 3], pose[:3, :3] @ disc @ pose[:3, :3].T))
    return together(bodies)


# --- Helpers


@functools.cache
def shaped(number: int) -> tuple[PccArm, sr.SoftModel]:
    robot = PccArm(**SHAPES[number], muscle_azimuths=())
    return robot, sr.load_model(robot)


@functools.cache
def lumped(hinges: int, rule: str = "corrected", torsion: bool = True, extension: bool = True) -> tuple[PccArm, sr.SoftModel]:
    robot = PccArm(
        segment_lengths=(0.5,),
        muscle_azimuths=(),
        chain="lumped",
        hinges=hinges,
        hinge_rule=rule,
        torsion=torsion,
        extension=extension,
    )
    return robot, sr.load_model(robot)


def shares(model: sr.SoftModel, total: np.ndarray, count: int) -> np.ndarray:
    """Elastic coordinates of one segment of `count` sections, each of which takes its share of the strain."""
    share = dict(zip(COORDINATES, total / count, strict=True))
    return np.array([next(share[key] for key in COORDINATES if name.endswith(key)) for name in model.spring_joints])


def joint_values(model: sr.SoftModel, springs: np.ndarray) -> dict[str, float]:
    return dict(zip(list(model.pinocchio.names)[1:], model.configuration([], springs), strict=True))


def pose_error(found: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Distance [m] and angle [rad]."""
    turn = Rotation.from_matrix(found[:3, :3].T @ exact[:3, :3])
    return float(np.linalg.norm(found[:3, 3] - exact[:3, 3])), float(turn.magnitude())


def orders(errors: Sequence[Sequence[float]]) -> np.ndarray:
    """Observed order of each column between successive halvings."""
    return np.log2(np.array(errors)[:-1] / np.array(errors)[1:])


# --- Geometry


@pytest.mark.parametrize("number", range(len(SHAPES)))
def test_every_boundary_of_the_sections_lies_on_the_arc(number: int, rng: np.random.Generator) -> None:
    """Also at straight. 1e-12 m is the rounding of a hundred products."""
    robot, model = shaped(number)
    count = robot.elastic_sections
    assert model.n_springs == 4 * count * robot.n_segments
    for round_ in range(6):
        z = np.c_[rng.uniform(-1.2, 1.2, (count * robot.n_segments, 3)), rng.uniform(-0.02, 0.03, count * robot.n_segments)]
        z *= round_ > 0
        q = model.configuration([], z.ravel())
        frames = rod_frames(robot, z, count)
        assert len(frames) == count * robot.n_segments + robot.n_segments + 1
        for name, exact in frames.items():
            assert np.allclose(frame_placement(model, q, name).homogeneous, exact, atol=1e-12, rtol=0), name


@given(
    st.lists(st.floats(-1.4, 1.4, allow_subnormal=False), min_size=24, max_size=24),
    st.lists(st.floats(-0.05, 0.1, allow_subnormal=False), min_size=6, max_size=6),
)
@settings(max_examples=40)
def test_any_strains_put_the_tip_on_the_arc(angles: list[float], stretches: list[float]) -> None:
    robot, model = shaped(1)
    z = np.c_[np.reshape(angles[:18], (6, 3)), stretches]
    frame = frame_placement(model, model.configuration([], z.ravel()), "tip").homogeneous
    assert np.allclose(frame, rod_frames(robot, z, 3)["tip"], atol=1e-12, rtol=0)


def test_muscle_lengths_of_the_theory_put_the_tip_where_it_says() -> None:
    """docs/theory.md 2.3: d = 0.04 m, torsion-free frames; printed with eight decimals."""
    model = sr.load_model(PccArm())
    lengths = (0.50, 0.53, 0.55, 0.54, 0.51, 0.52)
    tip = frame_placement(model, model.configuration(lengths, np.zeros(model.n_springs)), "tip")
    assert np.allclose(tip.translation, (0.44957382, -0.31544214, 0.84384418), atol=6e-9)


@pytest.mark.study
@pytest.mark.parametrize(("rule", "counts"), [("corrected", (4, 8, 16)), ("midpoint", (4, 8, 16))])
def test_lumped_chain_converges_at_second_order(rule: str, counts: tuple[int, ...]) -> None:
    """Position *and* orientation of the tip under an imposed strain with twist and stretch.

    docs/theory.md 2.4: pairs in one order all along, and equal links with a hinge at each start, are first order only (in
    orientation, in position). Asymptotically 2; 1.8 leaves room for the next order.
    """
    exact = screw(TOTAL, 0.5)
    errors = []
    for hinges in counts:
        _, model = lumped(hinges, rule)
        tip = frame_placement(model, model.configuration([], shares(model, TOTAL, hinges)), "tip")
        errors.append(pose_error(tip.homogeneous, exact))
    assert orders(errors).min() > 1.8
    assert max(errors[-1]) < 0.5 / counts[-1] ** 2  # in metres and radians, of a rod of 0.5 m bent by 1.9 rad


@pytest.mark.parametrize(("torsion", "extension"), [(False, False), (True, False), (False, True)])
def test_lumped_chains_with_fewer_springs_converge_too(torsion: bool, extension: bool) -> None:
    total = TOTAL * [1.0, 1.0, torsion, extension]
    errors = []
    for hinges in (4, 8):
        _, model = lumped(hinges, "corrected", torsion, extension)
        assert model.n_springs == (2 + torsion + extension) * hinges
        tip = frame_placement(model, model.configuration([], shares(model, total, hinges)), "tip")
        errors.append(pose_error(tip.homogeneous, screw(total, 0.5)))
    assert orders(errors).min() > 1.8


# --- Springs and places of the hinges


@pytest.mark.parametrize("hinges", [1, 5])
def test_stiffness_of_the_hinges(hinges: int) -> None:
    """EI n / l, EI n / l, GJ n / l and EA n / l, in both copies; one division of rounding."""
    robot = PccArm(**UNEVEN, chain="lumped", hinges=hinges)
    root = ElementTree.fromstring(robot.urdf())
    springs = spring_numbers(root)
    assert springs == gazebo_numbers(root)
    expected = {}
    for s, (length, bend, twist, pull) in enumerate(
        zip(robot.segment_lengths, robot.bending_stiffness, robot.torsional_stiffness, robot.axial_stiffness, strict=True), 1
    ):
        for i in range(1, hinges + 1):
            for key, rigidity in zip(COORDINATES, (bend, bend, twist, pull), strict=True):
                expected[f"section_{s}_{i}_{key}"] = rigidity * hinges / length
    assert {name: k for name, (k, _) in springs.items()} == pytest.approx(expected, rel=1e-15)
    assert {rest for _, rest in springs.values()} == {0.0}
    model = sr.load_model(robot)
    assert dict(zip(model.spring_joints, model.stiffness, strict=True)) == pytest.approx(expected, rel=1e-15)


def test_stiffness_of_the_sections() -> None:
    robot = PccArm(**UNEVEN, elastic_sections=3)
    model = sr.load_model(robot)
    expected = {}
    for s, (length, bend, twist, pull) in enumerate(
        zip(robot.segment_lengths, robot.bending_stiffness, robot.torsional_stiffness, robot.axial_stiffness, strict=True), 1
    ):
        for i, (key, rigidity) in itertools.product(range(1, 4), zip(COORDINATES, (bend, bend, twist, pull), strict=True)):
            expected[f"section_{s}_{i}_{key}"] = rigidity * 3 / length
    assert dict(zip(model.spring_joints, model.stiffness, strict=True)) == pytest.approx(expected, rel=1e-15)
    root = ElementTree.fromstring(robot.urdf())
    assert spring_numbers(root) == gazebo_numbers(root) == {}  # a joint of a section has no spring of its own


def between_hinges(robot: PccArm, segment: int) -> list[float]:
    """Lengths of the sub-links of a segment, in sections: heights of the hinges in the links before them, and the end."""
    root = ElementTree.fromstring(robot.urdf())

    def height(name: str) -> float:
        origin = numbers(root.find(f"joint[@name='{name}']/origin").get("xyz"))
        assert np.array_equal(origin[:2], [0.0, 0.0])
        return float(origin[2])

    names = [joint.get("name") for joint in root.findall("joint")]
    gaps = [
        math.fsum(height(name) for name in names if name.startswith(f"section_{segment}_{i}_"))
        for i in range(1, robot.hinges + 1)
    ]
    section = robot.segment_lengths[segment - 1] / robot.hinges
    return [gap / section for gap in (*gaps, height(f"segment_{segment}_fixed"))]


OUTER, NEXT = (47 - math.sqrt(671)) / 48, 2 * math.sqrt(671) / 48
THIRD = 2.5 - OUTER - NEXT
"""From an end to the first hinge, to the second and to the third [sections]: (47 -+ sqrt(671)) / 48 and 5/2."""


@pytest.mark.parametrize(
    ("rule", "hinges", "expected"),
    [
        ("midpoint", 1, [1 / 2, 1 / 2]),
        ("midpoint", 2, [1 / 2, 1, 1 / 2]),
        ("midpoint", 5, [1 / 2, 1, 1, 1, 1, 1 / 2]),
        ("corrected", 1, [1 / 2, 1 / 2]),
        ("corrected", 2, [11 / 24, 26 / 24, 11 / 24]),
        ("corrected", 3, [11 / 24, 25 / 24, 25 / 24, 11 / 24]),
        ("corrected", 4, [OUTER, NEXT, 4 - 2 * (OUTER + NEXT), NEXT, OUTER]),
        ("corrected", 5, [OUTER, NEXT, THIRD, THIRD, NEXT, OUTER]),
        ("corrected", 6, [OUTER, NEXT, THIRD, 1, THIRD, NEXT, OUTER]),
    ],
)
def test_lengths_of_the_sub_links(rule: str, hinges: int, expected: list[float]) -> None:
    robot = PccArm(**UNEVEN, chain="lumped", hinges=hinges, hinge_rule=rule)
    for segment in (1, 2):
        assert between_hinges(robot, segment) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("torsion", "extension"), [(True, True), (False, False), (True, False), (False, True)])
def test_order_of_the_joints(torsion: bool, extension: bool) -> None:
    """1 2 2 1, and on across the segments."""
    model = sr.load_model(PccArm(**UNEVEN, chain="lumped", hinges=3, torsion=torsion, extension=extension))
    forward = ["bend_x", "bend_y", *["twist"] * torsion, *["stretch"] * extension]
    expected = []
    for number, (s, i) in enumerate(itertools.product((1, 2), (1, 2, 3))):
        order = forward if number % 4 in (0, 3) else forward[::-1]
        expected += [f"section_{s}_{i}_{key}" for key in order]
    assert list(model.spring_joints) == expected
    assert list(model.pinocchio.names)[1:] == expected


# --- Mass

FORMS = [
    {"elastic_sections": 1},
    {"elastic_sections": 4},
    {"chain": "lumped", "hinges": 1},
    {"chain": "lumped", "hinges": 5, "hinge_rule": "midpoint"},
    {"chain": "lumped", "hinges": 5},
    {"chain": "lumped", "hinges": 4, "torsion": False, "extension": False},
    {"linear_density": (0.004, 0.7), "elastic_sections": 3},  # tiny links of less than 0.1 g
    {"linear_density": (0.004, 0.7), "chain": "lumped", "hinges": 3},
]


@pytest.mark.parametrize("form", FORMS)
def test_straight_chain_has_the_mass_of_the_rod(form: dict) -> None:
    """Tiny links are slices of the rod: total, centre and inertia are those of solid cylinders, to rounding."""
    robot = PccArm(**(UNEVEN | form))
    mass, centre, inertia = link_masses(robot.urdf(), {})
    total, middle, tensor = straight_rods(robot)
    assert mass == pytest.approx(total, rel=1e-12)
    assert np.allclose(centre, middle, atol=1e-12 * middle[2], rtol=0)
    assert np.allclose(inertia, tensor, atol=1e-12 * tensor[0, 0], rtol=0)


def test_pinocchio_sees_the_same_masses() -> None:
    """What does not move at the base of the lumped chain is part of Pinocchio's universe; with sections everything moves."""
    robot = PccArm(**UNEVEN)
    model = sr.load_model(robot).pinocchio
    data = model.createData()
    pin.ccrba(model, data, pin.neutral(model), np.zeros(model.nv))
    total, middle, tensor = straight_rods(robot)
    assert sum(body.mass for body in model.inertias[1:]) == pytest.approx(total, rel=1e-12)
    assert np.allclose(data.com[0], middle, atol=1e-12, rtol=0)
    assert np.allclose(np.array(data.Ig.inertia), tensor, atol=1e-12 * tensor[0, 0], rtol=0)


@pytest.mark.parametrize("chain", ["sections", "corrected", "midpoint"])
def test_bent_chain_converges_to_the_mass_of_the_bent_rod(chain: str) -> None:
    """Second order, as the points of the chain (1.8: room for the next order); 2 % of the rod's inertia at 16 sections."""
    errors = []
    for count in (4, 8, 16):
        if chain == "sections":
            robot = PccArm(segment_lengths=(0.5,), muscle_azimuths=(), elastic_sections=count)
            model = sr.load_model(robot)
        else:
            robot, model = lumped(count, chain)
        mass, centre, inertia = link_masses(robot.urdf(), joint_values(model, shares(model, TOTAL, count)))
        total, middle, tensor = bent_rod(0.5, 0.6, 0.05, TOTAL)
        assert mass == pytest.approx(total, rel=1e-12)
        errors.append((float(np.linalg.norm(centre - middle)), float(np.linalg.norm(inertia - tensor))))
    assert orders(errors).min() > 1.8
    assert errors[-1][1] < 0.02 * np.linalg.norm(tensor)


# --- Rules of portable URDF

segment_ = st.fixed_dictionaries(
    {
        "segment_lengths": st.floats(0.05, 3.0),
        "offset": st.floats(-4.0, 4.0, allow_subnormal=False),
        "muscle_distance": st.floats(1e-3, 0.3),
        "muscle_contraction": st.floats(0.01, 0.99),
        "muscle_extension": st.floats(0.01, 3.0),
        "muscle_force": st.floats(0.1, 1e5),
        "bending_stiffness": st.floats(1e-6, 1e5),
        "torsional_stiffness": st.floats(1e-6, 1e5),
        "axial_stiffness": st.floats(1e-2, 1e8),
        "linear_density": st.floats(1e-3, 50.0),
        "radius": st.floats(1e-3, 0.3),
        "rgba": st.tuples(*[st.floats(0.0, 1.0).map(lambda share: round(share, 6))] * 4),  # MuJoCo reads single precision
    }
)
whole_ = st.fixed_dictionaries(
    {
        "muscle_azimuths": st.sampled_from([(), (0.0, 2.0, 4.0), (0.1, 1.3, 2.4, -1.0, -2.2)]),
        "chain": st.sampled_from(["sections", "lumped"]),
        "elastic_sections": st.integers(1, 3),
        "hinges": st.integers(1, 4),
        "hinge_rule": st.sampled_from(["corrected", "midpoint"]),
        "torsion": st.booleans(),
        "extension": st.booleans(),
        "damping_time": st.floats(0.0, 10.0, allow_subnormal=False),  # MuJoCo 3 reads no such numbers
        "base_mass": st.floats(1e-3, 100.0),
    }
)


@pytest.mark.study
@law("PccArm", "load_model")
@given(st.lists(segment_, min_size=1, max_size=3), whole_)
@settings(max_examples=10, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
def test_any_valid_arm_obeys_the_rules_of_portable_urdf(
    tool: Callable[[str], ModuleType], segments: list[dict], whole: dict
) -> None:
    """Design, section 5; and Pinocchio, yourdfpy and MuJoCo accept it with every joint."""
    count = whole["elastic_sections"] if whole["chain"] == "sections" else whole["hinges"]
    assume(min(item["linear_density"] * item["segment_lengths"] for item in segments) / count > 4.1e-5)
    robot = PccArm(**{name: [item[name] for item in segments] for name in segments[0]}, **whole)
    urdf = robot.urdf()
    movable = check_portable(urdf)
    model = sr.load_model(robot)
    assert set(list(model.pinocchio.names)[1:]) == movable
    assert model.n_motors == robot.n_actuators
    other = tool("yourdfpy").URDF.load(io.StringIO(urdf), load_meshes=False, build_collision_scene_graph=False)
    assert other.validate()
    assert set(other.actuated_joint_names) == movable
    mujoco = tool("mujoco")
    third = mujoco.MjModel.from_xml_string(urdf)
    assert {third.joint(i).name for i in range(third.njnt)} == movable
    length = math.fsum(robot.segment_lengths)
    tip = frame_placement(model, pin.neutral(model.pinocchio), "tip")
    assert np.allclose(tip.translation, [0, 0, length], atol=1e-12 * length)


def test_collision_shapes_across_a_hinge_do_not_touch() -> None:
    """Sub-links longer than 2.5 radii have shapes; with 0.4 rad in every hinge, no pair is nearer than 1 cm."""
    robot = PccArm(segment_lengths=(1.0,), radius=0.03, chain="lumped", hinges=4, muscle_azimuths=())
    model = sr.load_model(robot)
    geometry = pin.buildGeomFromUrdfString(model.pinocchio, model.urdf, pin.GeometryType.COLLISION)
    assert geometry.ngeoms == 5
    geometry.addAllCollisionPairs()
    q = model.configuration([], [0.4 if "bend" in name else 0.0 for name in model.spring_joints])
    data = geometry.createData()
    pin.computeDistances(model.pinocchio, model.pinocchio.createData(), geometry, data, q)
    assert len(data.distanceResults) > 0
    assert min(result.min_distance for result in data.distanceResults) > 0.01


@pytest.mark.parametrize(
    ("form", "joints"),
    [({"elastic_sections": 1}, 6), ({"chain": "lumped", "hinges": 1}, 4), ({"elastic_sections": 40}, 240)],
)
def test_few_and_many_sections_expand(form: dict, joints: int) -> None:
    """Recursion by halves: a linear one dies at about 300 (measured)."""
    model = sr.load_model(PccArm(segment_lengths=(0.5,), muscle_azimuths=(), **form))
    assert model.pinocchio.nv == joints
    poses = link_poses(ElementTree.fromstring(model.urdf), {})  # Pinocchio's workspace would take seconds
    assert np.allclose(poses["tip"][:3, 3], [0, 0, 0.5], atol=1e-14)


# --- Parameters


def test_one_number_stands_for_every_segment() -> None:
    robot = PccArm(segment_lengths=(0.5, 0.3, 0.2), radius=0.03)
    assert robot.radius == (0.03,) * 3
    assert robot.offset == (0.0, math.pi / 3, math.pi / 3)
    assert PccArm(segment_lengths=(0.5,), offset=1.0).offset == (0.0,)
    assert PccArm(segment_lengths=(0.5,), offset=(1.0,)).offset == (1.0,)
    assert (robot.n_segments, robot.n_actuators) == (3, 9)
    assert PccArm(muscle_azimuths=np.array([])).n_actuators == 0


@pytest.mark.parametrize("form", [{"elastic_sections": 2}, {"chain": "lumped", "hinges": 3}])
def test_a_measured_arm_answers_as_it_was_measured(form: dict) -> None:
    """A bench: moment, torque and pull at the end of each clamped segment by itself give angle, twist and elongation.

    1e-9: the solver stops at 1e-10 of the load.
    """
    lengths, bending, torsion, axial = (0.5, 0.25), (4.0, 7.0), 2.0, (900.0, 1500.0)
    robot = PccArm.measured(bending=bending, torsion=torsion, axial=axial, segment_lengths=lengths, muscle_azimuths=(), **form)
    assert robot.bending_stiffness == pytest.approx((2.0, 1.75))
    for length, bend, pull in zip(lengths, bending, axial, strict=True):
        alone = PccArm.measured(
            bending=bend, torsion=torsion, axial=pull, segment_lengths=(length,), muscle_azimuths=(), **form
        )
        model = sr.load_model(alone)
        rotations, elongation = [], 0.0
        for place in range(2, 6):
            wrench = np.zeros(6)
            wrench[place] = 0.8
            tip = sr.solve_equilibrium(model, [], wrench=wrench).transform_tip_to_world
            if place == 2:
                elongation = tip.translation[2] - length
            else:
                rotations.append(Rotation.from_matrix(tip.rotation).as_rotvec()[place - 3])
        assert elongation == pytest.approx(0.8 / pull, rel=1e-9)
        assert rotations == pytest.approx([0.8 / bend, 0.8 / bend, 0.8 / torsion], rel=1e-9)


NAN, INF = float("nan"), float("inf")


@each_row(
    ("parameters", "field"),
    [
        ({"segment_lengths": ()}, "segment_lengths"),
        ({"segment_lengths": 0.5}, "segment_lengths"),
        ({"segment_lengths": (0.5, -0.1)}, "segment_lengths"),
        ({"segment_lengths": (0.5, 0.0)}, "segment_lengths"),
        ({"segment_lengths": (0.5, NAN)}, "segment_lengths"),
        ({"segment_lengths": "0.5"}, "segment_lengths"),
        ({"offset": (0.0, 1.0, 2.0)}, "offset"),
        ({"offset": NAN}, "offset"),
        ({"offset": "1"}, "offset"),
        ({"offset": None}, "offset"),
        ({"muscle_azimuths": (0.0, 2.0)}, "muscle_azimuths"),
        ({"muscle_azimuths": (0.0,)}, "muscle_azimuths"),
        ({"muscle_azimuths": 0.5}, "muscle_azimuths"),
        ({"muscle_azimuths": (0.0, 2.0, 2.0)}, "muscle_azimuths"),
        ({"muscle_azimuths": (0.0, 2.0, 2.0 * math.pi)}, "muscle_azimuths"),
        ({"muscle_azimuths": (0.0, 2.0, INF)}, "muscle_azimuths"),
        ({"muscle_azimuths": "abc"}, "muscle_azimuths"),
        ({"muscle_azimuths": None}, "muscle_azimuths"),
        ({"muscle_distance": 0.0}, "muscle_distance"),
        ({"muscle_distance": (0.04, 0.04, 0.04)}, "muscle_distance"),
        ({"muscle_contraction": 0.0}, "muscle_contraction"),
        ({"muscle_contraction": 1.0}, "muscle_contraction"),
        ({"muscle_extension": -0.1}, "muscle_extension"),
        ({"muscle_force": 0.0}, "muscle_force"),
        ({"bending_stiffness": 0.0}, "bending_stiffness"),
        ({"bending_stiffness": (1.0, -1.0)}, "bending_stiffness"),
        ({"torsional_stiffness": NAN}, "torsional_stiffness"),
        ({"axial_stiffness": INF}, "axial_stiffness"),
        ({"linear_density": 0.0}, "linear_density"),
        ({"radius": -0.05}, "radius"),
        ({"radius": None}, "radius"),
        ({"chain": "rigid"}, "chain"),
        ({"chain": None}, "chain"),
        ({"hinge_rule": "start"}, "hinge_rule"),
        ({"elastic_sections": 0}, "elastic_sections"),
        ({"elastic_sections": 2.0}, "elastic_sections"),
        ({"elastic_sections": True}, "elastic_sections"),
        ({"elastic_sections": 1001}, "elastic_sections"),
        ({"hinges": -1}, "hinges"),
        ({"hinges": "12"}, "hinges"),
        ({"torsion": 1}, "torsion"),
        ({"torsion": "true"}, "torsion"),
        ({"extension": None}, "extension"),
        ({"rgba": (1.0, 0.0, 0.0)}, "rgba"),
        ({"rgba": (1.0, 0.0, 0.0, 2.0)}, "rgba"),
        ({"rgba": "red"}, "rgba"),
        ({"damping_time": -0.1}, "damping_time"),
        ({"base_mass": 0.0}, "base_mass"),
        ({"base_mass": 1e-6}, "base_mass"),
    ],
)
def test_bad_parameters_of_the_arm_are_refused(parameters: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        PccArm(**parameters)
    assert caught.value.field == field


@each_row(
    ("parameters", "field"),
    [
        ({"bending": 0.0}, "bending"),
        ({"bending": (1.0, 2.0, 3.0)}, "bending"),
        ({"torsion": NAN}, "torsion"),
        ({"axial": -1.0}, "axial"),
        ({"segment_lengths": "0.5"}, "segment_lengths"),
        ({"segment_lengths": (-0.5, 0.5)}, "segment_lengths"),
        ({"radius": 0.0}, "radius"),
    ],
)
def test_bad_measurements_are_refused(parameters: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        PccArm.measured(**({"bending": 1.0, "torsion": 1.0, "axial": 1.0} | parameters))
    assert caught.value.field == field


def test_sections_too_light_for_tiny_links_are_refused() -> None:
    """Five per cent of half a section must be more than 1e-6 kg."""
    with pytest.raises(sr.DescriptionError, match="too light to cut tiny links from"):
        PccArm(linear_density=2e-4, segment_lengths=(0.5,), elastic_sections=4).urdf()
    assert check_portable(PccArm(linear_density=4e-4, segment_lengths=(0.5,), elastic_sections=4).urdf())


@each_row(
    ("arguments", "message"),
    [
        ({"lengths": "[0.5]"}, "no argument 'lengths'; declared: segment_lengths, offset"),
        ({"radius": 0.05}, "xacro arguments are text"),
        ({"segment_lengths": "[0.5,0]"}, "segment_lengths .* required > 0"),
        ({"segment_lengths": "[]"}, "could not convert"),
        ({"segment_lengths": "nan"}, "finite numbers are required"),
        ({"offset": "[0,1,2]"}, "offset has 3 values"),
        ({"offset": "half"}, "could not convert"),
        ({"muscle_azimuths": "[0.0,1.0]"}, "three or more that differ"),
        ({"muscle_azimuths": "[0.0,1.0,1.0]"}, "three or more that differ"),
        ({"muscle_azimuths": "[0.0,1.0,6.283185307179586]"}, "three or more that differ"),
        ({"muscle_distance": "0"}, "muscle_distance .* required > 0"),
        ({"muscle_distance": "[0.1,0.1,0.1]"}, "muscle_distance has 3 values"),
        ({"muscle_contraction": "1"}, "muscle_contraction .* required < 1"),
        ({"muscle_extension": "-0.1"}, "muscle_extension .* required > 0"),
        ({"muscle_force": "0"}, "muscle_force .* required > 0"),
        ({"bending_stiffness": "-1"}, "bending_stiffness .* required > 0"),
        ({"torsional_stiffness": "0"}, "torsional_stiffness .* required > 0"),
        ({"axial_stiffness": "inf"}, "finite numbers are required"),
        ({"linear_density": "0"}, "linear_density .* required > 0"),
        ({"linear_density": "1e-5"}, "too light to cut tiny links from"),
        ({"radius": "abc"}, "could not convert"),
        ({"radius": "0"}, "radius .* required > 0"),
        ({"chain": "rigid"}, "chain = rigid : one of .* is required"),
        ({"elastic_sections": "0"}, "elastic_sections = 0 : a whole number"),
        ({"elastic_sections": "2.5"}, "elastic_sections = 2.5 : a whole number"),
        ({"elastic_sections": "1001"}, "elastic_sections = 1001 : a whole number"),
        ({"hinges": "-3"}, "hinges = -3 : a whole number"),
        ({"hinge_rule": "start"}, "hinge_rule = start : one of"),
        ({"torsion": "True"}, "torsion = True : true or false"),
        ({"extension": "1"}, "extension = 1 : true or false"),
        ({"rgba": "1 0 0"}, "red, green, blue and opacity"),
        ({"rgba": "1 0 0 1, 0 1 0 1, 0 0 1 1"}, "rgba has 3 colours"),
        ({"damping_time": "-1"}, "damping_time .* required >= 0"),
        ({"base_mass": "1e-6"}, "base_mass .* required >"),
        ({"base_mass": "[1,2]"}, "base_mass has 2 values"),
    ],
)
def test_bad_arguments_of_the_xacro_file_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        expand(XACRO, arguments)


@pytest.mark.parametrize("contraction", [0.999, 0.9995])
def test_what_the_dataclass_accepts_xacro_accepts(contraction: float) -> None:
    """A contraction below 1 is valid, however near."""
    assert "muscle_1_1" in PccArm(segment_lengths=(0.5,), elastic_sections=1, muscle_contraction=contraction).urdf()


# --- Tags


@functools.cache
def one_section() -> str:
    return PccArm(segment_lengths=(0.3,), elastic_sections=1).urdf()


@functools.cache
def two_sections() -> str:
    return PccArm(segment_lengths=(0.3,), elastic_sections=2).urdf()


@functools.cache
def two_hinges() -> str:
    return PccArm(segment_lengths=(0.3,), chain="lumped", hinges=2).urdf()


def muscles_of_before(text: str) -> str:
    """A description of straight actuators of given length along one segment each, by the tags that described them before."""
    root = ElementTree.fromstring(text)
    for place, element in [(place, element) for place, element in enumerate(root) if element.tag == f"{{{NAMESPACE}}}actuator"]:
        (piece,) = element
        kept = ("name", "rest_length", "shortest", "longest", "strongest")
        numbers = {name: piece.get(name).split()[0] for name in ("azimuth", "distance")}
        attributes = {name: element.get(name) for name in kept} | numbers | {"segment": piece.get("segment")}
        root[place] = ElementTree.Element(f"{{{NAMESPACE}}}muscle", attributes)
    return ElementTree.tostring(root, encoding="unicode")


@functools.cache
def one_section_before() -> str:
    return muscles_of_before(one_section())


def without(element: str, *names: str) -> Callable[[ElementTree.Element], None]:
    def change(root: ElementTree.Element) -> None:
        for name in names:
            root.remove(root.find(f"{{{NAMESPACE}}}{element}[@name='{name}']"))

    return change


def with_mimic(name: str, master: str) -> Callable[[ElementTree.Element], None]:
    def change(root: ElementTree.Element) -> None:
        ElementTree.SubElement(root.find(f"joint[@name='{name}']"), "mimic", {"joint": master})

    return change


JOINTS_ = "section_1_1_u1 section_1_1_u2 section_1_1_c section_1_1_r1 section_1_1_r2 section_1_1_r3"
FIVE = JOINTS_.rsplit(" ", 1)[0]
ROLE = f"{{{NAMESPACE}}}role"

TAGS = [
    (one_section, changed("section", "section_1_1", joints=FIVE), "six joints with the role 'section' are required"),
    (one_section, changed("section", "section_1_1", joints=None), r"names the joints \(none\); six joints"),
    (one_section, changed("section", "section_1_1", joints=FIVE + " elbow"), "six joints with the role 'section'"),
    (one_section, changed("section", "section_1_1", joints=f"{FIVE} section_1_1_u1"), "joint of a section name twice"),
    (one_section, within_joint("section_1_1_u1", ROLE, value="motor"), "six joints with the role 'section' are required"),
    (one_section, within_joint("section_1_1_u1", ROLE, value="spring"), "role 'spring' and no spring"),
    (one_section, changed("section", "section_1_1", rest="0 0 0"), "a positive stretch are required"),
    (one_section, changed("section", "section_1_1", rest="0 0 0 0"), "a positive stretch are required"),
    (one_section, changed("section", "section_1_1", rest="0 nan 0 1"), "a positive stretch are required"),
    (one_section, changed("section", "section_1_1", rest="0 x 0 1"), "a positive stretch are required"),
    (one_section, changed("section", "section_1_1", rest=None), "a positive stretch are required"),
    (one_section, changed("section", "section_1_1", length="0"), "has length 0.0; a positive number"),
    (one_section, changed("section", "section_1_1", EI="-1"), "has EI -1.0; a positive number"),
    (one_section, changed("section", "section_1_1", GJ="nan"), "has GJ = 'nan'; a finite number"),
    (one_section, changed("section", "section_1_1", EA=None), "has EA = None; a finite number"),
    (one_section, changed("section", "section_1_1", radius="0"), "has radius 0.0; a positive number"),
    (one_section, changed("section", "section_1_1", segment="0"), "has segment = '0'; a number from 1"),
    (one_section, changed("section", "section_1_1", segment="-1"), "a number from 1"),
    (one_section, changed("section", "section_1_1", segment="1.0"), "a number from 1"),
    (one_section, changed("section", "section_1_1", segment="²"), "a number from 1"),
    (one_section, changed("section", "section_1_1", segment="10000"), "a number from 1"),
    (one_section, changed("section", "section_1_1", segment=None), "a number from 1"),
    (one_section, changed("section", "section_1_1", name=""), "section name twice or an empty one"),
    (two_sections, changed("section", "section_1_2", name="section_1_1"), "a section name twice.*section_1_1"),
    (two_sections, changed("section", "section_1_2", joints=JOINTS_), "joint of a section name twice"),
    (two_sections, without("section", "section_1_2"), "role 'section' that no section names: section_1_2_u1"),
    (two_hinges, changed("lumped_section", "section_1_1", bend_x=""), "different spring joints bend_x"),
    (two_hinges, changed("lumped_section", "section_1_1", bend_y=None), "different spring joints bend_x"),
    (two_hinges, changed("lumped_section", "section_1_1", bend_y="section_1_1_bend_x"), "different spring joints bend_x"),
    (two_hinges, changed("lumped_section", "section_1_1", twist="segment_1_fixed"), "different spring joints bend_x"),
    (two_hinges, changed("lumped_section", "section_1_1", stretch="section_1_2_stretch"), "joint of a section name twice"),
    (two_hinges, changed("lumped_section", "section_1_1", length="-0.1"), "has length -0.1; a positive number"),
    (two_hinges, changed("lumped_section", "section_1_1", radius="0"), "has radius 0.0; a positive number"),
    (two_hinges, changed("lumped_section", "section_1_1", segment="one"), "a number from 1"),
    (two_hinges, changed("lumped_section", "section_1_2", name="section_1_1"), "a section name twice"),
    (one_section_before, changed("muscle", "muscle_1_1", distance="0"), "has distance 0.0; a positive number"),
    (one_section_before, changed("muscle", "muscle_1_1", azimuth="nan"), "has azimuth = 'nan'; a finite number"),
    (one_section_before, changed("muscle", "muscle_1_1", azimuth=None), "has azimuth = None; a finite number"),
    (one_section_before, changed("muscle", "muscle_1_1", rest_length="-1"), "has rest_length -1.0; a positive number"),
    (one_section_before, changed("muscle", "muscle_1_1", shortest="9"), "shortest at 9.0 and longest at"),
    (one_section_before, changed("muscle", "muscle_1_1", longest="inf"), "has longest = 'inf'; a finite number"),
    (one_section_before, changed("muscle", "muscle_1_1", strongest="0"), "has strongest 0.0; a positive number"),
    (one_section_before, changed("muscle", "muscle_1_1", segment="2"), "runs along segment 2; available: 1"),
    (one_section_before, changed("muscle", "muscle_1_1", segment="a"), "a number from 1"),
    (one_section_before, changed("muscle", "muscle_1_1", name="muscle_1_2"), "a muscle name twice.*muscle_1_2"),
    (one_section_before, changed("muscle", "muscle_1_1", name=""), "a muscle name twice or an empty one"),
    (one_section_before, changed("muscle", "muscle_1_1", name="section_1_1_c"), "both a joint and an actuator.*section_1_1_c"),
]


@each_row(("text", "change", "message"), TAGS)
def test_malformed_tags_are_refused(text: Callable[[], str], change: Callable, message: str) -> None:
    read_tags(text())
    with pytest.raises(sr.DescriptionError, match=message):
        read_tags(edited(text(), change))


def order_of(*names: str) -> Callable[[ElementTree.Element], None]:
    return changed("section", "section_1_1", joints=" ".join(f"section_1_1_{name}" for name in names))


CHAINS_ = [
    (within_joint("section_1_1_u1", "axis", xyz="0 1 0"), "section_1_1_u1 .* a JointModelRY, required: JointModelRX"),
    (within_joint("section_1_1_u2", "axis", xyz="1 0 0"), "section_1_1_u2 .* a JointModelRX, required: JointModelRY"),
    (within_joint("section_1_1_c", "axis", xyz="0 0.6 0.8"), "section_1_1_c .* required: JointModelPZ"),
    (within_joint("section_1_1_r3", "axis", xyz="0 0 -1"), "section_1_1_r3 .* required: JointModelRZ"),
    (within_joint("section_1_1_c", ".", type="revolute"), "section_1_1_c .* required: JointModelPZ"),
    (within_joint("section_1_1_r3", ".", type="continuous"), "section_1_1_r3 .* required: JointModelRZ"),
    (order_of("u2", "u1", "c", "r1", "r2", "r3"), "required: JointModelRX"),
    (order_of("r1", "u2", "c", "u1", "r2", "r3"), "section_1_1_u2 .* not a child of joint section_1_1_r1"),
    (within_joint("section_1_1_u2", "origin", xyz="0 0 1e-6"), "section_1_1_u2 .* not where the rest shape"),
    (within_joint("section_1_1_c", "origin", xyz="0 0 0.31"), "section_1_1_c .* not where the rest shape"),
    (within_joint("section_1_1_c", "origin", xyz="0 0 0.3", rpy="0 0 0.1"), "section_1_1_c .* not where the rest shape"),
    (within_joint("section_1_1_r1", "origin", rpy="0.01 0 0"), "section_1_1_r1 .* not where the rest shape"),
    (within_joint("section_1_1_r2", "origin", xyz="0.01 0 0"), "section_1_1_r2 .* not where the rest shape"),
    (changed("section", "section_1_1", length="0.4"), "section_1_1_c .* not where the rest shape"),
    (changed("section", "section_1_1", rest="0.5 0.0 0.0 1.0"), "not where the rest shape"),
    (changed("section", "section_1_1", rest="0.0 0.0 0.5 1.0"), "section_1_1_r3 .* not where the rest shape"),
    (changed("section", "section_1_1", rest="0.0 0.0 0.0 1.1"), "section_1_1_c .* not where the rest shape"),
    (within_joint("section_1_1_r2", ".", type="fixed"), "spring or a section on section_1_1_r2, which cannot move"),
    (with_mimic("section_1_1_r2", "section_1_1_u2"), "joints that mimic others"),
]


@each_row(("change", "message"), CHAINS_)
def test_joints_that_are_not_the_chain_of_their_section_are_refused(change: Callable, message: str) -> None:
    sr.load_model(one_section())
    with pytest.raises(sr.DescriptionError, match=message):
        sr.load_model(edited(one_section(), change))


@pytest.mark.parametrize("rest", [(0.9, -1.4, 0.7, 1.05), (0.0, 2.0, 0.0, 1.0), (0.0, 0.0, 3.0, 0.9)])
def test_a_section_with_a_rest_shape_is_accepted_where_it_says(rest: tuple) -> None:
    """Origins set by hand from docs/theory.md 2.4: at zero the end stands at the screw of the rest strains."""
    exact = screw(0.3 * (np.array(rest) - [0, 0, 0, 1]), 0.3)
    p, chord = exact[:3, 3], float(np.linalg.norm(exact[:3, 3]))
    u1, u2 = math.atan2(-p[1], p[2]), math.atan2(p[0], math.hypot(p[1], p[2]))
    spherical = Rotation.from_euler("XY", [u1, u2]).inv() * Rotation.from_matrix(exact[:3, :3])
    r1, r2, r3 = spherical.as_euler("XYZ")
    angles = {"u1": (u1, 0, 0), "u2": (0, u2, 0), "r1": (r1, 0, 0), "r2": (0, r2, 0), "r3": (0, 0, r3)}
    root = ElementTree.fromstring(one_section())
    for name, rpy in angles.items():
        root.find(f"joint[@name='section_1_1_{name}']/origin").set("rpy", " ".join(map(repr, map(float, rpy))))
    root.find("joint[@name='section_1_1_c']/origin").set("xyz", f"0 0 {chord!r}")
    without("actuator", "muscle_1_1", "muscle_1_2", "muscle_1_3")(root)
    section = root.find(f"{{{NAMESPACE}}}section")
    section.set("rest", " ".join(map(repr, rest)))
    del section.attrib["relaxed"]  # as files had it before: without load where it is at rest
    model = sr.load_model(ElementTree.tostring(root, encoding="unicode"))
    q = model.configuration([])
    assert np.allclose(q, 0.0, atol=1e-15)
    assert np.allclose(frame_placement(model, q, "tip").homogeneous, exact, atol=1e-13)
    z = np.array([0.3, -0.4, 0.2, 0.03])
    moved = frame_placement(model, model.configuration([], z), "tip").homogeneous
    assert np.allclose(moved, screw(z, 0.3), atol=1e-13)
    assert np.allclose(model.rest, 0.3 * (np.array(rest) - [0, 0, 0, 1]), atol=1e-15)
    (segment,) = body_at(model, np.zeros(0), z)
    assert np.allclose(segment.poses[0], np.eye(4), atol=1e-13)
    assert np.allclose(segment.poses[-1], moved, atol=1e-13)


@each_row(
    ("options", "error", "message"),
    [
        ({"muscles": "tensions"}, sr.ParameterError, "muscles.*'lengths', 'forces'"),
        ({"springs": {"section_1_1_u1": 10.0}}, sr.NameNotFound, "no movable joint is called 'section_1_1_u1'"),
        ({"motors": ["section_1_1_c"]}, sr.NameNotFound, "no movable joint is called 'section_1_1_c'"),
        ({"tip": "segment_2"}, sr.NameNotFound, "no frame is called 'segment_2'.*did you mean 'segment_1'"),
    ],
)
def test_options_that_do_not_fit_are_refused(options: dict, error: type, message: str) -> None:
    with pytest.raises(error, match=message):
        sr.load_model(one_section(), **options)


def test_muscles_along_hinges_without_springs_are_refused() -> None:
    with pytest.raises(sr.DescriptionError, match="muscles along lumped sections; each joint of those needs a spring"):
        sr.load_model(two_hinges(), springs={})


# --- Loading


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_a_file_from_before_is_the_same_robot(chain: str) -> None:
    """Muscles were tags with a segment, an azimuth and a distance; all that a model holds of them is equal."""
    robot = PccArm(segment_lengths=(0.4, 0.3), chain=chain, elastic_sections=2, hinges=3)
    before, now = sr.load_model(muscles_of_before(robot.urdf())), sr.load_model(robot)
    assert ":muscle " in before.urdf
    assert before.muscles == now.muscles
    assert before.motor_joints == now.motor_joints
    lengths = now.relaxed_motors * [1.02, 0.99, 1.0, 0.98, 1.01, 1.0]
    force, weight = (1.0, 2.0, -0.5), sr.EARTH_GRAVITY
    one, two = (sr.solve_equilibrium(model, now.checked_motors(lengths), force, gravity=weight) for model in (before, now))
    assert np.array_equal(one.q, two.q)


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_robot_and_its_text_give_equal_models(chain: str) -> None:
    robot = PccArm(segment_lengths=(0.4, 0.3), chain=chain, elastic_sections=2, hinges=3)
    model, twin = sr.load_model(robot), sr.load_model(robot.urdf())
    assert model == twin
    assert hash(model) == hash(twin)
    assert model.motor_joints == ("muscle_1_1", "muscle_1_2", "muscle_1_3", "muscle_2_1", "muscle_2_2", "muscle_2_3")
    pulled = sr.load_model(robot, muscles="forces")
    assert pulled != model
    assert pulled.muscle_input == "forces"
    strains = 2 * (4 * 2 if chain == "sections" else 4 * 3)
    assert (model.n_springs, pulled.n_springs) == (strains - 6, strains)  # lengths fix three sums a segment
    assert model != sr.load_model(PccArm(segment_lengths=(0.4, 0.3), chain=chain, elastic_sections=2, hinges=3, radius=0.04))


# --- The body

LENGTHS = np.array([0.50, 0.53, 0.55, 0.54, 0.51, 0.52])


@pytest.mark.parametrize("number", range(len(SHAPES)))
def test_points_of_the_body_lie_on_the_arc(number: int, rng: np.random.Generator) -> None:
    robot, model = shaped(number)
    count, points = robot.elastic_sections, 5
    z = np.c_[rng.uniform(-1, 1, (count * robot.n_segments, 3)), rng.uniform(-0.02, 0.03, count * robot.n_segments)]
    segments = body_at(model, np.zeros(0), z.ravel(), points)
    assert [segment.number for segment in segments] == list(range(1, robot.n_segments + 1))
    pose, rows = np.eye(4), iter(z)
    for segment, length, offset in zip(segments, robot.segment_lengths, robot.offset, strict=True):
        pose = pose @ turned(offset)
        expected = [pose]
        for _ in range(count):
            row = next(rows)
            expected += [pose @ screw(k / points * row, k / points * length / count) for k in range(1, points + 1)]
            pose = expected[-1]
        assert segment.poses.shape == (count * points + 1, 4, 4)
        assert np.allclose(segment.poses, expected, atol=1e-12, rtol=0)
        assert np.array_equal(segment.backbone, segment.poses[:, :3, 3])


@pytest.mark.parametrize("rule", ["corrected", "midpoint"])
@pytest.mark.parametrize("hinges", [1, 4])
def test_body_of_a_lumped_arm_is_the_smooth_rod(rule: str, hinges: int) -> None:
    """It starts at the base, where the rod is clamped, whatever the hinges do; its poses are those of the screw."""
    robot, model = lumped(hinges, rule)
    (segment,) = body_at(model, np.zeros(0), shares(model, TOTAL, hinges), 3)
    expected = [screw(share * TOTAL, share * 0.5) for share in np.linspace(0, 1, 3 * hinges + 1)]
    assert np.allclose(segment.poses, expected, atol=1e-12, rtol=0)
    assert segment.radius == robot.radius[0]


def test_bodies_of_a_straight_lumped_arm_join() -> None:
    model = sr.load_model(PccArm(**UNEVEN, chain="lumped", hinges=3))
    first, second = body_at(model, np.zeros(0), np.zeros(model.n_springs))
    assert np.allclose(first.backbone[[0, -1]], [[0, 0, 0], [0, 0, 0.5]], atol=1e-14)
    assert np.allclose(second.backbone[[0, -1]], [[0, 0, 0.5], [0, 0, 0.8]], atol=1e-14)


def test_curves_of_the_muscles_are_as_long_as_the_muscles() -> None:
    """Untwisted: polylines of an arc fall short by (bending between points)^2 / 24, second order in their number."""
    model = sr.load_model(PccArm())
    errors = []
    for points in (4, 8, 16):
        curves = actuator_curves(BentSections(model, LENGTHS, np.zeros(model.n_springs)), model.muscles, points)
        assert tuple(curve.name for curve in curves) == model.motor_joints
        lengths = np.array([np.linalg.norm(np.diff(curve.points, axis=0), axis=1).sum() for curve in curves])
        assert np.all(lengths < LENGTHS)
        errors.append(LENGTHS - lengths)
    assert np.allclose(orders(errors), 2.0, atol=0.01)
    assert np.max(errors[-1]) < 1e-4


def test_body_of_an_equilibrium() -> None:
    """Drawn where the statics says: its end is the tip."""
    model = sr.load_model(PccArm())
    found = sr.solve_equilibrium(model, LENGTHS, (1.0, -2.0, 0.5))
    segments = body_at(found.model, found.q_motors, found.q_springs)
    assert np.allclose(segments[-1].poses[-1], found.transform_tip_to_world.homogeneous, atol=1e-12)
    assert np.allclose(segments[0].poses[-1][:3, 3], segments[1].poses[0][:3, 3], atol=1e-12)


def volume_of(corners: np.ndarray, triangles: np.ndarray) -> float:
    """Divergence theorem; positive if the triangles are anticlockwise from outside."""
    a, b, c = (corners[triangles[:, place]] for place in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("sides", [3, 8, 24])
def test_surface_of_the_body_is_closed(sides: int) -> None:
    """Every edge belongs to two triangles, once in each direction, and corners - edges + triangles = 2: a sphere."""
    model = sr.load_model(PccArm())
    for segment in body_at(model, LENGTHS, np.zeros(model.n_springs), 6):
        corners, triangles = segment.surface(sides)
        edges = Counter((int(row[i]), int(row[(i + 1) % 3])) for row in triangles for i in range(3))
        assert set(edges.values()) == {1}
        assert all((b, a) in edges for a, b in edges)
        assert len(corners) - len(edges) // 2 + len(triangles) == 2
        assert set(triangles.ravel().tolist()) == set(range(len(corners)))


def test_volume_of_the_body_is_that_of_the_tube() -> None:
    """Pappus: the area of the cross-section times the length of the backbone, whatever its bending; second order in both."""
    model = sr.load_model(PccArm())
    radius, backbone = 0.05, LENGTHS[:3].mean()
    errors = []
    for fineness in (1, 2, 4):
        segment = body_at(model, LENGTHS, np.zeros(model.n_springs), 4 * fineness)[0]
        errors.append([math.pi * radius**2 * backbone - volume_of(*segment.surface(12 * fineness))])
    assert np.allclose(orders(errors), 2.0, atol=0.05)
    assert 0 < errors[-1][0] < 0.01 * math.pi * radius**2 * backbone


def test_a_robot_without_sections_has_no_body(arm: sr.SoftModel) -> None:
    assert body_at(arm, np.zeros(3), np.zeros(4)) == ()
    with pytest.raises(sr.ParameterError, match="points"):
        body_at(arm, np.zeros(3), np.zeros(4), 0)
