"""The helical tube as a description: on the analytic helix, with the mass of the tube, portable, and refused where it is none.

The helix is written anew in `tests.helix_rods` (complex form, 50 digits); nothing here asks softrobots.helix where it is.
"""

from __future__ import annotations

import dataclasses
import functools
import io
import itertools
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.expansion import expand
from softrobots.description.paths import urdf_folder, xacro_folder
from softrobots.description.tag_reader import read_tags
from softrobots.robots import HelixTube
from softrobots.statics.kinematics import frame_placement
from softrobots.view.body import body_at
from tests.support.helix_rods import actuator_frames, gauss
from tests.support.hinge_places import hinge_places
from tests.support.laws import law
from tests.support.tables import each_row
from tests.support.urdf_reading import changed, check_portable, edited, gazebo_numbers, link_masses, link_poses, within_joint

DEG = math.pi / 180.0
XACRO = xacro_folder() / HelixTube.XACRO
FILES = {"helix_tube": HelixTube(), "helix_tube_lumped": HelixTube(chain="lumped")}
TOLERANCE = 1e-12  # the promise [m]; orientations likewise, per entry. Rounding of a hundred products is about 1e-14.

HELICES: dict[str, dict[str, Any]] = {
    "paper": {},
    "2.5 times": {"diameter": 0.08275, "length": 3.75, "wall_thickness": 2.5e-4},
    "10 degrees": {"angle": 10 * DEG, "contraction": 0.9},
    "lambda = 1": {"contraction": 1.0, "angle": 0.3, "length": 0.9},
    "nearly 1": {"contraction": 1.0 - 1e-9, "angle": 0.2},
    "theta = 0": {"angle": 0.0, "contraction": 0.8, "length": 0.7},
    "nearly 0": {"angle": 1e-9, "contraction": 0.8, "length": 0.7},
    "straight": {"angle": 0.0, "contraction": 1.0},
    "nearly straight": {"angle": 1e-7, "contraction": 1.0 - 1e-8},
    "small lambda": {"contraction": 1e-3, "angle": 0.2, "length": 0.4, "wall_thickness": 1e-3},
    "Ri < 0": {"contraction": 0.97, "angle": 25 * DEG, "length": 0.6},
    "Ri = 0": {"contraction": math.cos(30 * DEG), "angle": 15 * DEG, "length": 0.6},
    "beyond 45 degrees": {"contraction": 0.7, "angle": 65 * DEG, "length": 0.1, "wall_thickness": 1e-3},
    "self-contact": {"contraction": 0.3, "angle": 2 * DEG, "length": 0.8},
}
FORMS: dict[str, dict[str, Any]] = {
    "sections": {"elastic_sections": 6},
    "corrected": {"chain": "lumped", "hinges": 5},
    "midpoint": {"chain": "lumped", "hinges": 4, "hinge_rule": "midpoint", "torsion": False, "extension": False},
}
TURNED = {"handedness": "left", "upright": "axis"}
AWAY = ("straight", "nearly straight", "nearly 0")


CASES = [
    pytest.param(helix, form, turned, id=f"{helix}-{form}-{'left, axis' if turned else 'right, tube'}")
    for row, helix in enumerate(HELICES)
    for column, form in enumerate(FORMS)
    if row % {"sections": 1, "corrected": 2, "midpoint": 3}[form] == 0
    # Where there is no axis, or one many kilometres away, nothing can stand upright in 16 digits. One of both elsewhere.
    for turned in ((False,) if helix in AWAY else (False, True) if helix == "paper" else ((row + column) % 2 == 1,))
]


@functools.cache
def tube(helix: str, form: str, turned: bool = False) -> HelixTube:
    return HelixTube(**HELICES[helix], **FORMS[form], **(TURNED if turned else {}), allow_self_contact=True)


@functools.cache
def model_of(helix: str, form: str, turned: bool = False) -> sr.SoftModel:
    return sr.load_model(tube(helix, form, turned))


# --- Oracles


def centre_length(robot: HelixTube) -> Any:
    """The outer line keeps its length Lt / cos(theta), the centre line winds beside it: |1 + z| / 2 of that; 50 digits."""
    with mp.workdps(50):
        zeta = mp.mpf(robot.contraction) * mp.expj(2 * mp.mpf(robot.angle))
        return mp.mpf(robot.length) * abs(1 + zeta) / (2 * mp.cos(mp.mpf(robot.angle)))


def places(robot: HelixTube) -> dict[str, Any]:
    """How far along the centre line each frame stands: at ends of sections, or hinges."""
    whole = centre_length(robot)
    count = robot.elastic_sections if robot.chain == "sections" else robot.hinges
    with mp.workdps(50):
        if robot.chain == "sections":
            shares = [mp.mpf(j) for j in range(1, count + 1)]
        else:
            shares = [mp.mpf(place) for place in hinge_places(count, robot.hinge_rule).tolist()]
        made = {f"section_1_{j}": share * whole / count for j, share in enumerate(shares, start=1)}
    return made | {"segment_1": whole, "tip": whole}


def exact_frames(robot: HelixTube, lengths: Any) -> np.ndarray:
    sign = 1 if robot.handedness == "right" else -1
    given_ = (robot.contraction, robot.angle, robot.diameter)
    return actuator_frames(*given_, sign, lengths, from_base=robot.upright == "tube")


def worst(robot: HelixTube, pose_of: Callable[[str], np.ndarray]) -> tuple[float, float]:
    """Largest distance [m] and largest difference of an entry of the orientation, over all frames of the chain."""
    there = places(robot)
    exact = exact_frames(robot, list(there.values()))
    found = np.array([pose_of(name) for name in there])
    apart = np.linalg.norm(found[:, :3, 3] - exact[:, :3, 3], axis=1)
    return float(apart.max()), float(np.abs(found[:, :3, :3] - exact[:, :3, :3]).max())


def mean_of_helix(robot: HelixTube) -> np.ndarray:
    """Mean of the centre line, closed form: (R sin(a)/a, R (1 - cos a)/a, b a/2) in the frame of the helix; 50 digits."""
    with mp.workdps(50):
        zeta = mp.mpf(robot.contraction) * mp.expj(2 * mp.mpf(robot.angle))
        if zeta == 1:
            return np.array([0.0, 0.0, 0.5 * robot.length])
        place, sign = mp.mpf(robot.diameter) * (1 + zeta) / (2 * (1 - zeta)), 1 if robot.handedness == "right" else -1
        radius, pitch, size = place.real, place.imag, abs(place)
        a = centre_length(robot) / size
        mean = [radius * mp.sin(a) / a, sign * radius * (1 - mp.cos(a)) / a, pitch * a / 2]
        if robot.upright == "axis":
            return np.array(mean, dtype=float)
        # Axes of the base: x towards the axis of the helix, z along the tube.
        z = [mp.mpf(0), sign * radius / size, pitch / size]
        y = [mp.mpf(0), -z[2], z[1]]
        from_base = [mean[0] - radius, mean[1], mean[2]]
        return np.array([-from_base[0], *(sum(axis[i] * from_base[i] for i in range(3)) for axis in (y, z))], dtype=float)


# --- Geometry


@pytest.mark.study
@pytest.mark.parametrize(("helix", "form", "turned"), CASES)
def test_every_boundary_of_the_sections_lies_on_the_helix(helix: str, form: str, turned: bool) -> None:
    robot, model = tube(helix, form, turned), model_of(helix, form, turned)
    q = model.configuration([])
    assert np.abs(q).max() < 1e-15
    apart, askew = worst(robot, lambda name: frame_placement(model, q, name).homogeneous)
    assert apart < TOLERANCE
    assert askew < TOLERANCE


def test_the_straight_tube_stands_on_the_origin_whatever_is_upright() -> None:
    for upright in ("tube", "axis"):
        robot = HelixTube(contraction=1.0, angle=0.0, upright=upright, elastic_sections=2)
        poses = link_poses(ElementTree.fromstring(robot.urdf()), {})
        assert np.allclose(poses["tip"][:3, 3], [0.0, 0.0, 1.5], atol=1e-15)
        assert np.allclose(poses["tip"][:3, 2], [0.0, 0.0, 1.0], atol=1e-15)


def test_at_contraction_1_the_tube_is_straight_and_its_frames_follow_the_actuator_around_it() -> None:
    """The actuator runs around a cylinder of circumference pi D: an angle of 2 Lt tan(theta) / D."""
    robot = HelixTube(contraction=1.0, angle=0.3, length=0.5, elastic_sections=5)
    tip = link_poses(ElementTree.fromstring(robot.urdf()), {})["tip"]
    turn = 2 * 0.5 * math.tan(0.3) / 0.0331
    expected = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    assert np.allclose(tip[:3, :3], expected, atol=1e-13)
    assert np.allclose(tip[:3, 3], [0, 0, 0.5], atol=1e-14)


def test_at_angle_0_the_tube_is_an_arc_in_its_plane() -> None:
    """Inner and outer line are 0.8 and 1 of the length at D apart: radius of the centre line D (1 + 0.8) / (2 (1 - 0.8))."""
    robot = HelixTube(contraction=0.8, angle=0.0, length=0.4, elastic_sections=5)
    radius, bend = 0.0331 * 1.8 / 0.4, 0.4 * (1 - 0.8) / 0.0331
    tip = link_poses(ElementTree.fromstring(robot.urdf()), {})["tip"]
    assert np.allclose(tip[:3, 3], [radius * (1 - math.cos(bend)), 0.0, radius * math.sin(bend)], atol=1e-14)


def test_the_reference_case_of_the_theory() -> None:
    """docs/theory.md 3, ten digits: Ro, Ri and b of theta = 5 degrees, lambda = 0.66; the tip against them, axis upright."""
    outer, inner, pitch = 0.0854078008, 0.0523078008, 0.0279647090
    robot = HelixTube(upright="axis", elastic_sections=6)
    turn = 1.5 / (math.cos(5 * DEG) * math.hypot(outer, pitch))
    radius = 0.5 * (outer + inner)
    tip = link_poses(ElementTree.fromstring(robot.urdf()), {})["tip"]
    # Digits of 1e-10 m, and of 17 rad times as much over the radius.
    assert np.allclose(tip[:3, 3], [radius * math.cos(turn), radius * math.sin(turn), pitch * turn], atol=5e-9)
    assert robot.turns == pytest.approx(turn / (2 * math.pi), rel=1e-8)
    assert robot.centre_length == pytest.approx(0.830133 * 1.5, abs=1e-6)
    assert robot.strains == pytest.approx([0.0, 12.466512, 5.062932, 1.0], abs=6e-7)
    assert HelixTube(handedness="left").strains[2] == -robot.strains[2]


@pytest.mark.parametrize("share", [0.01, 0.3, 0.77, 1.0, 1.1])
@pytest.mark.parametrize("handedness", ["right", "left"])
def test_sections_that_all_grow_alike_stay_on_the_same_helix(share: float, handedness: str) -> None:
    """Growth as section coordinates: z = (0, kappa g / n, tau g / n, (g - Lc) / n) is the helix of length g; rounding."""
    robot = HelixTube(elastic_sections=6, handedness=handedness)
    model, count, whole = sr.load_model(robot), 6, float(centre_length(robot))
    zeta = robot.contraction * np.exp(2j * robot.angle)
    size, sign = robot.diameter * abs(1 + zeta) ** 2, 1 if handedness == "right" else -1
    curvature, torsion = 2 * (1 - robot.contraction**2) / size, sign * 4 * robot.contraction * math.sin(2 * robot.angle) / size
    grown = share * whole
    z = np.tile([0.0, curvature * grown / count, torsion * grown / count, (grown - whole) / count], count)
    q = model.configuration([], z)
    exact = exact_frames(robot, [grown * j / count for j in range(1, count + 1)])
    found = [frame_placement(model, q, f"section_1_{j}").homogeneous for j in range(1, count + 1)]
    assert np.allclose(found, exact, atol=TOLERANCE, rtol=0)


# --- The files that are shipped


def zero_in_pinocchio(file: Path, _: Callable) -> Callable[[str], np.ndarray]:
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    return lambda name: data.oMf[model.getFrameId(name)].homogeneous


def zero_in_yourdfpy(file: Path, _: Callable) -> Callable[[str], np.ndarray]:
    import yourdfpy

    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    steps = ["world", *places(FILES[file.stem])]  # one from the other: from the world it takes seconds
    poses = itertools.accumulate((robot.get_transform(b, a) for a, b in itertools.pairwise(steps)), np.matmul)
    return dict(zip(steps[1:], poses, strict=True)).__getitem__


def zero_by_the_text(file: Path, _: Callable) -> Callable[[str], np.ndarray]:
    return link_poses(ElementTree.parse(file).getroot(), {}).__getitem__


def zero_in_mujoco(file: Path, tool: Callable) -> Callable[[str], np.ndarray]:
    mujoco = tool("mujoco")
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return lambda name: np.r_[
        np.c_[data.body(name).xmat.reshape(3, 3), data.body(name).xpos], [[0.0, 0.0, 0.0, 1.0]]
    ]  # fmt: skip


def zero_in_drake(file: Path, tool: Callable) -> Callable[[str], np.ndarray]:
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(file))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    return lambda name: plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(name)).GetAsMatrix4()


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("reader", [zero_by_the_text, zero_in_pinocchio, zero_in_yourdfpy, zero_in_mujoco, zero_in_drake])
def test_the_shipped_file_is_on_the_helix_in_every_tool(tool: Callable[[str], ModuleType], file: str, reader: Callable) -> None:
    """MuJoCo and Drake make rotations in their own ways: still rounding. For PyBullet see tests/test_interop.py."""
    robot = FILES[file]
    assert (robot.length, robot.contraction, robot.angle, robot.diameter) == (1.5, 0.66, 5 * DEG, 0.0331)
    apart, askew = worst(robot, reader(urdf_folder() / f"{file}.urdf", tool))
    assert apart < TOLERANCE
    assert askew < TOLERANCE


# --- Tubes anywhere

tubes_ = st.fixed_dictionaries(
    {
        "contraction": st.one_of(st.floats(0.15, 1.0), st.floats(-12.0, -1.0).map(lambda x: 1.0 - 10.0**x), st.just(1.0)),
        "angle": st.one_of(
            st.floats(0.0, 0.4, allow_subnormal=False),
            st.floats(0.4, 1.4),
            st.floats(-9.0, -2.0).map(lambda x: 10.0**x),
            st.just(0.0),
        ),
        "diameter": st.floats(0.01, 0.3),
        "handedness": st.sampled_from(["right", "left"]),
        "upright": st.sampled_from(["tube", "axis"]),
        "pressure": st.just(0.0) | st.floats(200.0, 1e5),
        "young_modulus": st.floats(1e6, 1e10),
        "poisson_ratio": st.floats(-0.9, 0.5, allow_subnormal=False),
        "density": st.floats(500.0, 5000.0),
        "actuator_density": st.one_of(st.just(0.0), st.floats(0.0, 1.0, allow_subnormal=False)),
        "bending_stiffness": st.one_of(st.none(), st.floats(1e-4, 1e4)),
        "torsional_stiffness": st.one_of(st.none(), st.floats(1e-4, 1e4)),
        "axial_stiffness": st.one_of(st.none(), st.floats(1.0, 1e8)),
        "chain": st.sampled_from(["sections", "lumped"]),
        "hinge_rule": st.sampled_from(["corrected", "midpoint"]),
        "torsion": st.booleans(),
        "extension": st.booleans(),
        "rgba": st.tuples(*[st.floats(0.0, 1.0).map(lambda share: round(share, 6))] * 4),  # MuJoCo reads single precision
        "damping_time": st.floats(0.0, 10.0, allow_subnormal=False),
        "base_mass": st.floats(1e-3, 100.0),
    }
)


@pytest.mark.study
@law("HelixTube", "load_model")
@given(tubes_, st.floats(0.02, 2.8), st.floats(0.004, 0.05), st.integers(0, 3))
@settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
def test_any_tube_is_on_its_helix_has_its_mass_and_obeys_the_rules_of_portable_urdf(
    tool: Callable[[str], ModuleType], fields: dict, turns: float, thickness: float, more: int
) -> None:
    """Design, section 5; up to 16 radians or 200 diameters; Pinocchio, yourdfpy and MuJoCo accept it with every joint."""
    zeta, diameter = fields["contraction"] * np.exp(2j * fields["angle"]), fields["diameter"]
    assume(abs(1 - zeta) > 1e-3 or fields["upright"] == "tube")  # an axis within reach
    around = 2 * math.pi * turns * math.cos(fields["angle"]) * diameter / max(abs(1 - zeta), 1e-12)  # length of so many turns
    length = min(around, 200 * diameter)
    turn = length / (math.cos(fields["angle"]) * diameter) * abs(1 - zeta)  # about the axis of the helix [rad]
    count = math.ceil(turn / 2.2) + more  # at most 126 degrees a section
    wall = {"wall_thickness": thickness * diameter, "allow_self_contact": True}
    per_length = fields["density"] * math.pi * diameter * thickness * diameter + fields["actuator_density"]
    assume(0 < count < 9 and per_length * length / count > 4.1e-5)
    robot = HelixTube(length=length, elastic_sections=count, hinges=count, **fields, **wall)
    urdf = robot.urdf()
    movable = check_portable(urdf)
    model = sr.load_model(robot)
    assert len(movable) == robot.n_joints
    assert set(list(model.pinocchio.names)[1:]) == movable
    apart, askew = worst(robot, lambda name: frame_placement(model, pin.neutral(model.pinocchio), name).homogeneous)
    assert apart < TOLERANCE * max(1.0, diameter / abs(1 - zeta) if fields["upright"] == "axis" else length)
    assert askew < TOLERANCE
    mass, centre, _ = link_masses(urdf, {})
    assert mass == pytest.approx(per_length * length, rel=1e-12)
    if abs(1 - zeta) > 1e-3:
        assert np.allclose(centre, mean_of_helix(robot), atol=1e-12 * max(length, diameter / abs(1 - zeta)), rtol=0)
    other = tool("yourdfpy").URDF.load(io.StringIO(urdf), load_meshes=False, build_collision_scene_graph=False)
    assert other.validate()
    assert set(other.actuated_joint_names) == movable
    third = tool("mujoco").MjModel.from_xml_string(urdf)
    assert {third.joint(i).name for i in range(third.njnt)} == movable


# --- Mass


@pytest.mark.study
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize(
    "form",
    [
        {"actuator_density": 0.05},  # tiny links of 0.1 g
        {},  # tiny links of 5 per cent of half a section
        {"chain": "lumped"},
        {"chain": "lumped", "hinge_rule": "midpoint", "torsion": False},
        {"chain": "lumped", "actuator_density": 0.05, "extension": False},
    ],
    ids=str,
)
def test_a_chain_at_rest_has_the_mass_and_the_centre_of_the_helix(form: dict, count: int) -> None:
    """For any number of sections: every link has its centre where its piece of helix has it. Wall and actuator as they say."""
    robot = HelixTube(length=0.24, elastic_sections=count, hinges=count, **form)
    mass, centre, _ = link_masses(robot.urdf(), {})
    assert mass == pytest.approx((920 * math.pi * 0.0331 * 1e-4 + form.get("actuator_density", 0.0)) * 0.24, rel=1e-13)
    assert np.allclose(centre, mean_of_helix(robot), atol=1e-15, rtol=0)


@pytest.mark.study
@pytest.mark.parametrize(("helix", "form", "turned"), CASES)
def test_the_centre_of_mass_is_the_mean_of_the_helix(helix: str, form: str, turned: bool) -> None:
    robot = tube(helix, form, turned)
    mass, centre, _ = link_masses(model_of(helix, form, turned).urdf, {})
    assert mass == pytest.approx(920 * math.pi * robot.diameter * robot.wall_thickness * robot.length, rel=1e-13)
    assert np.allclose(centre, mean_of_helix(robot), atol=1e-13, rtol=0)


def test_halves_of_a_section_have_the_centres_of_the_halves_of_the_helix() -> None:
    """So that gravity bends each section as it should: both sides of the sliding joint by themselves."""
    robot = HelixTube(length=0.24, elastic_sections=2)
    root = ElementTree.fromstring(robot.urdf())
    poses, whole = link_poses(root, {}), float(centre_length(robot))
    for section, parts, tail in ((1, ("ball_1", "ball_2", ""), ()), (2, ("ball_1", "ball_2", ""), ("segment_1", "tip"))):
        first = [f"section_1_{section}_{name}" for name in ("yoke", "lower")]
        second = [f"section_1_{section}_{name}".rstrip("_") for name in ("upper", *parts)] + list(tail)
        for half, names in enumerate((first, second)):
            points, masses = [], []
            for name in names:
                inertial = root.find(f"link[@name='{name}']/inertial")
                point = [*map(float, inertial.find("origin").get("xyz").split()), 1.0]
                points.append((poses[name] @ point)[:3])
                masses.append(float(inertial.find("mass").get("value")))
            start = whole * (2 * (section - 1) + half) / 4
            s, weights = gauss(start, start + whole / 4)
            mean = weights @ exact_frames(robot, s)[:, :3, 3] / weights.sum()
            assert np.allclose(np.array(masses) @ points / sum(masses), mean, atol=1e-15, rtol=0)
            assert sum(masses) == pytest.approx(920 * math.pi * 0.0331 * 1e-4 * 0.24 / 4, rel=1e-13)


@pytest.mark.parametrize("form", ["sections", "corrected"])
def test_the_inertia_at_rest_converges_to_that_of_the_bent_tube(form: str) -> None:
    """Thin rings along the helix, by quadrature; second order in the number of sections (1.8: room for the next order)."""
    errors = []
    for count in (3, 6, 12):
        robot = HelixTube(**(FORMS[form] | {"elastic_sections": count, "hinges": count, "length": 0.5}))
        mass, _, tensor = link_masses(robot.urdf(), {})
        points, weights = gauss(0.0, float(centre_length(robot)), 60)
        frames, shares = exact_frames(robot, points), weights / weights.sum()
        arms = frames[:, :3, 3] - mean_of_helix(robot)
        axes = frames[:, :3, 2]
        ring = 0.5 * (0.0331 / 2) ** 2 * (np.eye(3) + np.einsum("ni,nj->nij", axes, axes))
        spread = np.einsum("ni,ni->n", arms, arms)[:, None, None] * np.eye(3) - np.einsum("ni,nj->nij", arms, arms)
        errors.append(np.linalg.norm(tensor / mass - np.einsum("n,nij->ij", shares, ring + spread)))
    assert np.log2(np.array(errors)[:-1] / errors[1:]).min() > 1.8
    assert errors[-1] < 0.01 * np.linalg.norm(tensor / mass)


# --- Stiffness and wrinkling


def gazebo_stiffness(robot: HelixTube) -> dict[str, float]:
    copies = gazebo_numbers(ElementTree.fromstring(robot.urdf()))
    assert {rest for _, rest in copies.values()} == {0.0}
    return {name: stiffness for name, (stiffness, _) in copies.items()}


@pytest.mark.parametrize("given_", [{}, {"bending_stiffness": 0.4}, {"torsional_stiffness": 0.3}, {"axial_stiffness": 900.0}])
@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_stiffness_of_the_inflated_wall_or_as_given(chain: str, given_: dict) -> None:
    """EI = (E + P/S) pi r^3 t with P/S the cap force over the wall, GJ = E / (2 (1 + nu)) 2 pi r^3 t, EA = E 2 pi r t."""
    r, t, modulus, pressure, ratio = 0.02, 3e-4, 1.7e8, 3e4, 0.3
    robot = HelixTube(
        diameter=2 * r, wall_thickness=t, young_modulus=modulus, pressure=pressure, poisson_ratio=ratio, chain=chain,
        elastic_sections=2, hinges=2, length=0.4, **given_,
    )  # fmt: skip
    cap = pressure * math.pi * r**2 / (2 * math.pi * r * t)
    bend = given_.get("bending_stiffness", (modulus + cap) * math.pi * r**3 * t)
    twist = given_.get("torsional_stiffness", modulus / (2 * (1 + ratio)) * 2 * math.pi * r**3 * t)
    pull = given_.get("axial_stiffness", modulus * 2 * math.pi * r * t)
    model, each = sr.load_model(robot), float(centre_length(robot)) / 2
    assert model.n_springs == 8
    rigidity = {"bend_x": bend, "bend_y": bend, "twist": twist, "stretch": pull}
    expected = {f"section_1_{j}_{name}": value / each for j in (1, 2) for name, value in rigidity.items()}
    assert dict(zip(model.spring_joints, model.stiffness, strict=True)) == pytest.approx(expected, rel=1e-14)
    if chain == "lumped":
        assert model.spring_table == {name: (float(k), 0.0) for name, k in gazebo_stiffness(robot).items()}
        assert np.array_equal(model.rest, np.zeros(8))
    groups = model.spring_groups
    assert len(groups) == 2
    for group in groups:  # the first wrinkle, [Troise 2021] (3)
        assert group.wrinkling_moment == pytest.approx(math.pi**2 / 4 * pressure * r**3, rel=1e-14)


# --- Growth as a robot of its own


@pytest.mark.parametrize(("form", "length"), [("sections", 0.05), ("sections", 1.9), ("corrected", 0.6), ("midpoint", 1.9)])
def test_a_grown_tube_stands_on_the_same_helix(form: str, length: float) -> None:
    robot = tube("paper", form)
    grown = robot.grown(length)
    assert grown.length == length
    assert grown.n_sections == math.ceil(robot.n_sections * length / robot.length)
    unchanged = {f.name for f in dataclasses.fields(robot)} - {"length", "elastic_sections", "hinges"}
    assert all(getattr(grown, name) == getattr(robot, name) for name in unchanged)
    model = sr.load_model(grown.urdf())
    q = model.configuration([])
    frames = {name: frame_placement(model, q, name).homogeneous for name in places(grown)}
    exact = exact_frames(robot, list(places(grown).values()))  # of the old tube, further along or less far
    assert np.allclose(list(frames.values()), exact, atol=TOLERANCE, rtol=0)
    mass, _, _ = link_masses(grown.urdf(), {})
    assert mass == pytest.approx(920 * math.pi * 0.0331 * 1e-4 * length, rel=1e-13)


def test_a_tube_that_grows_has_the_text_that_xacro_writes() -> None:
    """Digit for digit, at lengths of as many hinges and of fewer."""
    robot = HelixTube(chain="lumped", hinges=8)
    for length in (1.45, 1.46, 0.73):
        grown = robot.grown(length)
        assert grown.urdf() == expand(xacro_folder() / grown.XACRO, grown.xacro_arguments())


def test_sections_of_a_grown_tube_are_not_longer_than_before() -> None:
    """So the chain that carried the tube carries it at every length; and there is no section more than that takes."""
    for count in (6, 7, 11, 24):  # six are the fewest for this tube
        robot = HelixTube(elastic_sections=count, hinges=count)
        for share in np.linspace(0.01, 2.0, 40):
            grown = robot.grown(share * 1.5)
            assert grown.length / grown.elastic_sections <= 1.5 / count * (1 + 1e-9)
            assert grown.elastic_sections == grown.hinges
            assert grown.elastic_sections < share * count + 1
    assert HelixTube().grown(1.5) == HelixTube()
    assert HelixTube(elastic_sections=24).grown(0.5).elastic_sections == 8


@each_row(
    ("robot", "length", "field"),
    [
        (HelixTube(), 0.0, "length"),
        (HelixTube(), -0.5, "length"),
        (HelixTube(), float("nan"), "length"),
        (HelixTube(), float("inf"), "length"),
        (HelixTube(), "1", "length"),
        (HelixTube(), None, "length"),
        (HelixTube(elastic_sections=500), 3.1, "length"),
        (HelixTube(chain="lumped", hinges=500), 3.1, "length"),
    ],
)
def test_lengths_that_a_tube_cannot_grow_to_are_refused(robot: HelixTube, length: Any, field: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        robot.grown(length)
    assert caught.value.field == field


def test_only_the_sections_of_the_chain_limit_the_growth() -> None:
    assert HelixTube(chain="lumped", hinges=10, elastic_sections=900).grown(3.0).hinges == 20
    assert HelixTube(hinges=900, elastic_sections=10).grown(3.0).elastic_sections == 20


def test_a_tube_that_would_grow_into_itself_is_refused() -> None:
    """theta = 5 degrees, lambda = 0.3 is below the limit of 0.3739 (self-contact); a piece of half a turn touches nothing."""
    piece = HelixTube(contraction=0.3, length=0.15)
    assert piece.turns < 1
    with pytest.raises(sr.SelfIntersection):
        piece.grown(1.5)


# --- Parameters

NAN, INF = float("nan"), float("inf")


BAD_PARAMETERS: list[tuple[dict[str, object], str]] = [
    ({"length": 0.0}, "length"),
    ({"length": -1.5}, "length"),
    ({"length": NAN}, "length"),
    ({"length": "1.5"}, "length"),
    ({"length": (1.5, 1.5)}, "length"),
    ({"length": None}, "length"),
    ({"length": 400.0}, "length"),  # 1000 sections are too few
    ({"diameter": 0.0}, "diameter"),
    ({"diameter": -0.03}, "diameter"),
    ({"diameter": INF}, "diameter"),
    ({"diameter": True}, "diameter"),
    ({"contraction": 0.0}, "contraction"),
    ({"contraction": -0.5}, "contraction"),
    ({"contraction": 1.0 + 2.0**-52}, "contraction"),
    ({"contraction": NAN}, "contraction"),
    ({"angle": -1e-9}, "angle"),
    ({"angle": math.pi / 2}, "angle"),
    ({"angle": 5.0}, "angle"),
    ({"angle": NAN}, "angle"),
    ({"handedness": "Right"}, "handedness"),
    ({"handedness": 1}, "handedness"),
    ({"handedness": None}, "handedness"),
    ({"upright": "base"}, "upright"),
    ({"upright": None}, "upright"),
    ({"upright": "axis", "angle": 0.0, "contraction": 1.0 - 1e-9}, "upright"),  # an axis 33000 km away
    ({"actuator": "wound"}, "actuator"),
    ({"actuator": "length", "chain": "lumped"}, "chain"),
    ({"actuator": "elastic", "upright": "axis"}, "upright"),
    ({"actuator": "elastic", "elastic_sections": 4}, "elastic_sections"),
    ({"pressure": -1.0}, "pressure"),
    ({"pressure": NAN}, "pressure"),
    ({"wall_thickness": 0.0}, "wall_thickness"),
    ({"wall_thickness": 0.0017}, "wall_thickness"),
    ({"young_modulus": 0.0}, "young_modulus"),
    ({"young_modulus": INF}, "young_modulus"),
    ({"poisson_ratio": -1.0}, "poisson_ratio"),
    ({"poisson_ratio": 0.51}, "poisson_ratio"),
    ({"density": 0.0}, "density"),
    ({"actuator_density": -0.01}, "actuator_density"),
    ({"bending_stiffness": 0.0}, "bending_stiffness"),
    ({"bending_stiffness": "stiff"}, "bending_stiffness"),
    ({"torsional_stiffness": -1.0}, "torsional_stiffness"),
    ({"torsional_stiffness": NAN}, "torsional_stiffness"),
    ({"axial_stiffness": INF}, "axial_stiffness"),
    ({"axial_stiffness": False}, "axial_stiffness"),
    ({"chain": "rigid"}, "chain"),
    ({"chain": None}, "chain"),
    ({"elastic_sections": 0}, "elastic_sections"),
    ({"elastic_sections": 12.0}, "elastic_sections"),
    ({"elastic_sections": 1001}, "elastic_sections"),
    ({"elastic_sections": 4}, "elastic_sections"),  # too few for 2.7 turns
    ({"hinges": -3}, "hinges"),
    ({"hinges": "24"}, "hinges"),
    ({"hinges": 1001}, "hinges"),
    ({"hinge_rule": "start"}, "hinge_rule"),
    ({"torsion": 1}, "torsion"),
    ({"extension": "false"}, "extension"),
    ({"rgba": (1.0, 0.0, 0.0)}, "rgba"),
    ({"rgba": (1.0, 0.0, 0.0, 1.1)}, "rgba"),
    ({"rgba": "blue"}, "rgba"),
    ({"damping_time": -0.1}, "damping_time"),
    ({"base_mass": 0.0}, "base_mass"),
    ({"allow_self_contact": 1}, "allow_self_contact"),
    ({"allow_self_contact": None}, "allow_self_contact"),
]


@pytest.mark.filterwarnings("ignore::softrobots.SuspiciousInputWarning")  # one of 400 m is asked about, too
@each_row(("parameters", "field"), BAD_PARAMETERS)
def test_bad_parameters_of_the_tube_are_refused(parameters: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        HelixTube(**parameters)
    assert caught.value.field == field


def test_every_field_is_tested_with_bad_values() -> None:
    assert {field for _, field in BAD_PARAMETERS} == {field.name for field in dataclasses.fields(HelixTube)}


@each_row(
    ("arguments", "message"),
    [
        ({"lenght": "1.5"}, "no argument 'lenght'; declared: length, diameter"),
        ({"allow_self_contact": "true"}, "no argument 'allow_self_contact'"),
        ({"length": 1.5}, "xacro arguments are text"),
        ({"length": "0"}, "length .* required > 0"),
        ({"length": "[1.0,2.0]"}, "length has 2 values"),
        ({"length": "long"}, "could not convert"),
        ({"diameter": "-1"}, "diameter .* required > 0"),
        ({"diameter": "nan"}, "finite numbers are required"),
        ({"contraction": "0"}, "contraction .* required > 0"),
        ({"contraction": "1.001"}, "contraction = 1.001 : required <= 1"),
        ({"angle": "-0.1"}, "angle .* required >= 0"),
        ({"angle": "1.5707963267948966"}, "angle = .* : required < pi / 2"),
        ({"handedness": "up"}, "handedness = up : one of"),
        ({"upright": "base"}, "upright = base : one of"),
        ({"actuator": "wound"}, "actuator = wound : one of"),
        ({"actuator": "length", "chain": "lumped"}, "actuator = length : chain = sections and upright = tube"),
        ({"pressure": "-1"}, "pressure .* required >= 0"),
        ({"wall_thickness": "0"}, "wall_thickness .* required > 0"),
        ({"wall_thickness": "0.002"}, "wall_thickness = .* a tenth of the radius"),
        ({"young_modulus": "0"}, "young_modulus .* required > 0"),
        ({"poisson_ratio": "-1"}, "poisson_ratio .* required > -1"),
        ({"poisson_ratio": "0.6"}, "poisson_ratio = 0.6 : required <= 0.5"),
        ({"density": "0"}, "density .* required > 0"),
        ({"density": "1"}, "too light to cut tiny links from"),
        ({"actuator_density": "-1"}, "actuator_density .* required >= 0"),
        ({"bending_stiffness": "0"}, "bending_stiffness .* required > 0"),
        ({"torsional_stiffness": "x"}, "could not convert"),
        ({"axial_stiffness": "inf"}, "finite numbers are required"),
        ({"chain": "rigid"}, "chain = rigid : one of"),
        ({"elastic_sections": "0"}, "elastic_sections = 0 : a whole number"),
        ({"elastic_sections": "1001"}, "elastic_sections = 1001 : a whole number"),
        ({"elastic_sections": "4"}, "elastic_sections = 4 : too few, each would bend by 3.88"),
        ({"elastic_sections": "1", "contraction": "1.0", "angle": "0.3", "length": "0.2"}, "too few, .* twist by 3.7"),
        ({"hinges": "2.5"}, "hinges = 2.5 : a whole number"),
        ({"hinge_rule": "end"}, "hinge_rule = end : one of"),
        ({"torsion": "True"}, "torsion = True : true or false"),
        ({"extension": "1"}, "extension = 1 : true or false"),
        ({"rgba": "1 0 0"}, "red, green, blue and opacity"),
        ({"rgba": "1 0 0 1, 0 1 0 1"}, "rgba has 2 colours"),
        ({"damping_time": "-1"}, "damping_time .* required >= 0"),
        ({"base_mass": "1e-6"}, "base_mass .* required >"),
    ],
)
def test_bad_arguments_of_the_xacro_file_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        expand(XACRO, arguments)


@pytest.mark.parametrize(
    "helix",
    [
        {},
        {"contraction": 1.0, "angle": 0.3, "length": 0.7},
        {"angle": 0.0, "contraction": 0.7, "length": 0.8},
        {"contraction": 0.8, "angle": 50 * DEG, "length": 0.3, "handedness": "left"},
    ],
    ids=["paper", "twist alone", "bending alone", "both"],
)
def test_the_fewest_sections_of_the_dataclass_are_those_of_the_xacro_file_and_work(helix: dict) -> None:
    with pytest.raises(sr.ParameterError, match="at least") as caught:
        HelixTube(elastic_sections=1, allow_self_contact=True, **helix)
    fewest = int(str(caught.value).split("at least ")[1].split()[0])
    assert fewest > 1
    robot = HelixTube(elastic_sections=fewest, allow_self_contact=True, wall_thickness=3e-4, **helix)
    assert sr.solve_equilibrium(sr.load_model(robot), (), (0.0, 0.0, -1e-3)).stable
    with pytest.raises(sr.DescriptionError, match=f"elastic_sections = {fewest - 1} : too few"):
        expand(XACRO, robot.xacro_arguments() | {"elastic_sections": str(fewest - 1)})


def test_sections_too_light_for_tiny_links_are_refused() -> None:
    """5 per cent of half a section must be more than 1e-6 kg: 0.0096 kg/m of wall, so 240 sections and no more for 1 m."""
    robot = HelixTube(length=0.024, elastic_sections=6, hinges=5)
    with pytest.raises(sr.DescriptionError, match="too light to cut tiny links from"):
        robot.urdf()
    assert check_portable(dataclasses.replace(robot, elastic_sections=5).urdf())
    assert check_portable(dataclasses.replace(robot, chain="lumped").urdf())


def test_parameters_are_frozen_keyword_only_and_plain() -> None:
    with pytest.raises(TypeError):
        HelixTube(1.5)  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        HelixTube().length = 2.0  # type: ignore[misc]
    robot = HelixTube(length=np.float64(1.2), diameter=np.array(0.04), elastic_sections=np.int64(12), bending_stiffness=1)
    assert [type(getattr(robot, name)) for name in ("length", "diameter", "elastic_sections")] == [float, float, int]
    assert robot.urdf() == HelixTube(length=1.2, diameter=0.04, elastic_sections=12, bending_stiffness=1.0).urdf()


def test_what_the_tube_says_of_itself() -> None:
    assert HelixTube(elastic_sections=9).n_joints == 54
    assert HelixTube(chain="lumped", hinges=9).n_joints == 36
    assert HelixTube(chain="lumped", hinges=9, torsion=False, extension=False).n_joints == 18
    assert HelixTube().radius == 0.01655
    assert HelixTube(actuator_density=0.01).mass == pytest.approx((920 * math.pi * 0.0331 * 1e-4 + 0.01) * 1.5, rel=1e-14)
    straight = HelixTube(contraction=1.0, angle=0.0)
    assert (straight.shape, straight.contact, straight.turns, straight.centre_length) == (None, None, 0.0, 1.5)
    assert np.array_equal(straight.strains, [0.0, 0.0, 0.0, 1.0])
    assert HelixTube(contraction=1.0, angle=0.3).turns == pytest.approx(1.5 * math.tan(0.3) / (math.pi * 0.0331))


# --- Self-contact


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"contraction": 0.37}, "neighbouring turns"),  # the limit at 5 degrees is 0.3739, docs/theory.md 3
        ({"angle": 0.0, "contraction": 0.8, "length": 1.5}, "neighbouring turns"),
        ({"angle": 60 * DEG, "contraction": 0.4, "length": 0.1}, "bends with a radius"),  # lambda + cos 2 theta < 0
    ],
)
def test_a_tube_that_runs_into_itself_is_refused_unless_allowed(fields: dict, why: str) -> None:
    with pytest.raises(sr.SelfIntersection, match=why) as caught:
        HelixTube(**fields)
    assert caught.value.contact.touches
    allowed = HelixTube(**fields, allow_self_contact=True)
    assert allowed.contact.touches
    assert str(allowed.contact) in str(caught.value)
    assert "allow_self_contact" not in allowed.xacro_arguments()


@pytest.mark.parametrize("fields", [{"contraction": 0.375}, {"contraction": 0.37, "length": 0.2}, {"contraction": 1.0}])
def test_a_tube_that_does_not_is_accepted(fields: dict) -> None:
    assert not HelixTube(**fields).contact.touches


# --- Tags and loading

SECTION = "section_1_1"


@functools.cache
def one_section() -> str:
    return HelixTube(length=0.2, elastic_sections=1).urdf()


@functools.cache
def two_hinges() -> str:
    return HelixTube(length=0.2, chain="lumped", hinges=2).urdf()


MOVED = [
    (within_joint(f"{SECTION}_u2", "origin", xyz="0.0 0.0 1e-6"), f"{SECTION}_u2 .* not where the rest shape"),
    (within_joint(f"{SECTION}_u2", "origin", rpy="0.0 0.0 0.0"), f"{SECTION}_u2 .* not where the rest shape"),
    (within_joint(f"{SECTION}_c", "origin", xyz="0.0 0.0 0.166"), f"{SECTION}_c .* not where the rest shape"),
    (within_joint(f"{SECTION}_r1", "origin", rpy="0.0 0.0 0.0"), f"{SECTION}_r1 .* not where the rest shape"),
    (within_joint(f"{SECTION}_r2", "origin", rpy="0.0 0.0 0.0"), f"{SECTION}_r2 .* not where the rest shape"),
    (within_joint(f"{SECTION}_r3", "origin", rpy="0.0 0.0 0.0"), f"{SECTION}_r3 .* not where the rest shape"),
    (changed("section", SECTION, length="0.1"), "not where the rest shape"),
    (changed("section", SECTION, rest="0.0 0.0 0.0 1.0"), "not where the rest shape"),
    (changed("section", SECTION, rest="0.0 12.46 5.063 1.0"), "not where the rest shape"),
    (changed("section", SECTION, rest="0.0 12.466511970014 -5.062932238586 1.0"), "not where the rest shape"),
]


@each_row(("change", "message"), MOVED)
def test_files_whose_joints_are_not_at_the_rest_shape_are_refused(change: Callable, message: str) -> None:
    sr.load_model(one_section())
    with pytest.raises(sr.DescriptionError, match=message):
        sr.load_model(edited(one_section(), change))


@each_row(
    ("text", "change", "message"),
    [
        (one_section, changed("section", SECTION, rest="0 12 5"), "a positive stretch are required"),
        (two_hinges, changed("lumped_section", SECTION, rest=None), "a positive stretch are required"),
        (two_hinges, changed("lumped_section", SECTION, rest="0 inf 5 1"), "a positive stretch are required"),
        (two_hinges, changed("lumped_section", SECTION, hinge="0"), "has hinge 0.0; a positive number"),
        (two_hinges, changed("lumped_section", SECTION, hinge=None), "has hinge = None; a finite number"),
        (two_hinges, changed("line", "actuator", segment="2"), "line 'actuator' .* runs along segment 2"),
        (two_hinges, changed("line", "actuator", distance="0"), "has distance 0.0; a positive number"),
    ],
)
def test_malformed_tags_are_refused(text: Callable[[], str], change: Callable, message: str) -> None:
    read_tags(text())
    with pytest.raises(sr.DescriptionError, match=message):
        read_tags(edited(text(), change))


def test_an_inflated_section_that_does_not_exist_is_refused() -> None:
    text = one_section().replace(f'springs="{SECTION}_bend_x {SECTION}_bend_y"', f'springs="{SECTION}_bend_x {SECTION}_bend_z"')
    assert text != one_section()
    with pytest.raises(sr.DescriptionError, match=f"names the springs {SECTION}_bend_x {SECTION}_bend_z"):
        sr.load_model(text)


@pytest.mark.parametrize(
    "change", [{"pressure": 9e3}, {"handedness": "left"}, {"upright": "axis"}, {"density": 900.0}], ids=str
)
def test_tubes_that_differ_are_other_models(change: dict) -> None:
    """Down to what only the tags say (the pressure)."""
    given_ = {"length": 0.2, "elastic_sections": 1}
    assert sr.load_model(HelixTube(**given_, **change)) != sr.load_model(HelixTube(**given_))


# --- The body


@pytest.mark.study
@pytest.mark.parametrize(("helix", "form", "turned"), CASES)
def test_points_of_the_body_lie_on_the_helix_and_the_actuator_on_the_inner_path(helix: str, form: str, turned: bool) -> None:
    """The body starts at the base whatever the hinges; the inner path is p(s) = (Ri cos s, +- Ri sin s, b s)."""
    robot, model = tube(helix, form, turned), model_of(helix, form, turned)
    count, points = robot.n_sections, 3
    (segment,) = body_at(model, np.zeros(0), model.rest, points)
    whole = centre_length(robot)
    lengths = [whole * k / (count * points) for k in range(count * points + 1)]
    assert np.allclose(segment.poses, exact_frames(robot, lengths), atol=TOLERANCE, rtol=0)
    assert segment.radius == 0.5 * robot.diameter
    if turned:
        zeta = robot.contraction * np.exp(2j * robot.angle)
        inner, centre = robot.diameter * zeta / (1 - zeta), robot.diameter * (1 + zeta) / (2 * (1 - zeta))
        s = np.array(lengths, dtype=float) / abs(centre)
        expected = np.stack([inner.real * np.cos(s), -inner.real * np.sin(s), inner.imag * s], axis=-1)
        assert np.allclose(segment.lines["actuator"], expected, atol=TOLERANCE, rtol=0)
