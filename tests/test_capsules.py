"""The capsules of robots: they hold the body, follow its numbers and its mounting, and bad ones are refused."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.description.tag_reader import read_tags
from softrobots.environment.capsules import robot_capsules
from softrobots.identification.parameters import ParameterSet
from softrobots.robots import XacroRobot
from tests.support.laws import law

ROBOTS: dict[str, Callable[[], XacroRobot]] = {
    "arm": lambda: sr.InflatableArm(link_lengths=(0.5, 0.7), radius=(0.06, 0.05), wrist=(0.05, 0.2), stiffness=150.0),
    "two hinges": lambda: sr.InflatableArm(link_model="two_hinges"),
    "twisting": lambda: sr.InflatableArm(link_model="two_hinges", torsion=True, wrist=(0.0, 0.3)),
    "sections": lambda: sr.PccArm(radius=(0.05, 0.04)),
    "lumped": lambda: sr.PccArm(chain="lumped", hinges=5, muscle_azimuths=()),
    "tendons": lambda: sr.TendonArm(elastic_sections=2),
    "helix": lambda: sr.HelixTube(length=0.6),
    "lumped helix": lambda: sr.HelixTube(length=0.6, chain="lumped", hinges=12, handedness="left"),
    "tube with an actuator": lambda: sr.HelixTube(length=0.6, elastic_sections=4, actuator="length", handedness="left"),
    "elastic actuator": lambda: sr.HelixTube(length=0.6, elastic_sections=4, actuator="elastic"),
}


def cores(model: sr.SoftModel, q: FloatArray | None = None) -> list[tuple[FloatArray, FloatArray, float]]:
    """Start and end of the core of every capsule in the world, and its radius."""
    data = model.pinocchio.createData()
    pin.forwardKinematics(model.pinocchio, data, pin.neutral(model.pinocchio) if q is None else q)
    return [(data.oMi[one.joint].act(one.start), data.oMi[one.joint].act(one.end), one.radius) for one in robot_capsules(model)]


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_capsules_join_from_the_base_to_the_tip(name: str, rng: np.random.Generator) -> None:
    """At rest, and bent where every capsule is a piece of a link; 1e-12: rounding over 60 joints."""
    robot = ROBOTS[name]()
    model = sr.load_model(robot)
    states = [pin.neutral(model.pinocchio)]
    if not model.structure.section_joints:  # without stretching, which draws neighbours apart
        bent = rng.uniform(-0.1, 0.1, model.n_springs) * [not name.endswith("stretch") for name in model.spring_joints]
        states.append(model.configuration(model.relaxed_motors + (0.0 if model.muscles else 0.4), bent))
    for q in states:
        chain = cores(model, q)
        for (_, end, _), (start, _, _) in pairwise(chain):
            np.testing.assert_allclose(end, start, atol=1e-12)
        data = model.pinocchio.createData()
        pin.framesForwardKinematics(model.pinocchio, data, q)
        tip = data.oMf[model.frame_id(model.tip)].translation
        np.testing.assert_allclose(chain[-1][1], tip, atol=1e-12)


def test_capsules_of_an_arm_have_the_lengths_and_radii_of_its_links() -> None:
    robot = sr.InflatableArm(link_lengths=(0.5, 0.7), radius=(0.06, 0.05), hinge_offset=(0.04, 0.03), stiffness=150.0)
    found = [(np.linalg.norm(end - start), radius) for start, end, radius in cores(sr.load_model(robot))]
    np.testing.assert_allclose(found, [(0.04, 0.06), (0.46, 0.06), (0.03, 0.05), (0.67, 0.05)], rtol=1e-12)


@pytest.mark.parametrize("upright", ["tube", "axis"])
def test_the_straight_halves_of_a_helix_lie_along_its_chords(upright: str) -> None:
    """The centre line from its strains by a differential equation; 1e-8: its tolerance."""
    robot = sr.HelixTube(length=0.5, elastic_sections=6, upright=upright)
    model = sr.load_model(robot)
    (_, curvature, torsion, _), whole = robot.rest_chain[0], robot.rest_chain[1]
    w = np.array([[0, -torsion, curvature], [torsion, 0, 0], [-curvature, 0, 0]])  # cross product with (0, curvature, torsion)

    def rate(_: float, state: FloatArray) -> FloatArray:
        rotation = state[3:].reshape(3, 3)
        return np.concatenate([rotation[:, 2], (rotation @ w).ravel()])

    data = model.pinocchio.createData()
    pin.framesForwardKinematics(model.pinocchio, data, pin.neutral(model.pinocchio))
    base = data.oMf[model.frame_id("base_link")]
    ends = np.linspace(0.0, whole, 7)
    start = np.concatenate([base.translation, base.rotation.ravel()])
    line = solve_ivp(rate, (0.0, whole), start, t_eval=ends, rtol=1e-11, atol=1e-11).y[:3].T
    halves = cores(model)
    for section in range(6):
        (one, middle, _), (again, other, _) = halves[2 * section : 2 * section + 2]
        np.testing.assert_allclose([one, other], line[section : section + 2], atol=1e-8)
        np.testing.assert_allclose([middle, again], [line[section : section + 2].mean(axis=0)] * 2, atol=1e-8)


def test_a_tube_beside_its_actuator_is_held_along_its_own_straight_axis() -> None:
    """At rest the tube is straight, its actuator winds around it; 1e-12: rounding."""
    robot = sr.HelixTube(length=0.6, elastic_sections=5, actuator="length")
    points = np.array([point for start, end, _ in cores(sr.load_model(robot)) for point in (start, end)])
    np.testing.assert_allclose(points[:, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(points[:, 2], np.repeat(np.linspace(0.0, 0.6, 11), 2)[1:-1], atol=1e-12)
    assert all(capsule.radius == robot.radius for capsule in robot_capsules(sr.load_model(robot)))


def test_mounted_capsules_move_with_their_carrier() -> None:
    """At the flange of another arm; both robots keep theirs."""
    carrier, child = sr.InflatableArm(), sr.HelixTube(length=0.4, elastic_sections=3)
    whole = sr.load_model(sr.mount(carrier, "tip", child, xyz=(0.1, 0.0, 0.0), rpy=(0.0, 0.3, 0.2)))
    own, mounted = (read_tags(robot.urdf()).capsules for robot in (carrier, child))
    tags = whole.structure.tags.capsules
    assert tags == (*own, *(replace(tag, link=f"soft_{tag.link}") for tag in mounted))
    tip = pin.SE3(np.eye(3), np.array([1.2, 0.0, 0.0])) * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.3, 0.2), np.array([0.1, 0, 0]))
    expected = [(tip.act(start), tip.act(end)) for start, end, _ in cores(sr.load_model(child))]
    found = [(start, end) for start, end, _ in cores(whole)[len(own) :]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_capsules_survive_pickling_other_springs_and_locked_joints() -> None:
    arm = sr.load_model(sr.InflatableArm())
    twin, soft = pickle.loads(pickle.dumps(arm)), sr.with_springs(arm, {"spring_1_up": 100.0})
    locked = sr.load_model(sr.InflatableArm(), motors=["motor_1"])
    names = ("link_1_root", "link_1", "link_2_root", "link_2")
    for model in (arm, twin, soft, locked):
        assert tuple(capsule.link for capsule in robot_capsules(model)) == names
        np.testing.assert_array_equal([np.hstack(core) for core in cores(model)], [np.hstack(core) for core in cores(arm)])
    assert robot_capsules(locked)[0].joint == robot_capsules(arm)[0].joint - 1  # motor_2 is fixed


def test_other_numbers_make_other_capsules() -> None:
    base = sr.InflatableArm()
    long = sr.load_model(replace(base, link_lengths=(0.6, 0.8), radius=(0.055, 0.07), stiffness=172.0))
    assert robot_capsules(long)[3].end[0] - robot_capsules(sr.load_model(base))[3].end[0] == pytest.approx(0.2, rel=1e-12)
    assert robot_capsules(long)[3].radius == 0.07


def test_a_model_that_is_fitted_has_the_capsules_of_its_numbers() -> None:
    """The last link is as much longer, its root as much shorter."""
    fitted = ParameterSet.of(
        sr.InflatableArm(stiffness=170.0), ("link[2].link_lengths", "link[1].hinge_offset", "link[2].radius")
    )
    found = cores(fitted.model(np.array([0.7, 0.05, 0.06])))
    lengths = [np.linalg.norm(end - start) for start, end, _ in found]
    np.testing.assert_allclose(lengths, [0.05, 0.55, 0.03, 0.67], rtol=1e-12)
    assert [radius for _, _, radius in found] == [0.055, 0.055, 0.06, 0.06]


PLAIN = """<robot name="plain"><link name="base"/>
  <link name="bar"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{0}</link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="bar"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
CYLINDER = (
    '<collision><origin xyz="0.1 0 0" rpy="0 {0} 0"/><geometry><cylinder radius="0.2" length="0.6"/></geometry></collision>'
)
SPHERE = '<collision><origin xyz="0 0 0.5"/><geometry><sphere radius="0.1"/></geometry></collision>'
BOX = '<collision><geometry><box size="1 1 1"/></geometry></collision>'


def plain(shapes: str) -> sr.SoftModel:
    """A bar with collision shapes and no tags."""
    return sr.load_model(PLAIN.format(shapes), springs={"hinge": 5.0})


def test_round_collision_shapes_count_without_capsules() -> None:
    """With the axis of the cylinder turned from z to x."""
    found = robot_capsules(plain(CYLINDER.format(math.pi / 2) + SPHERE + BOX))
    assert [(capsule.link, capsule.joint, capsule.radius) for capsule in found] == [("bar", 1, 0.2), ("bar", 1, 0.1)]
    np.testing.assert_allclose([found[0].start, found[0].end], [(-0.2, 0, 0), (0.4, 0, 0)], atol=1e-15)
    np.testing.assert_array_equal([found[1].start, found[1].end], [(0, 0, 0.5)] * 2)


def test_without_round_shapes_the_others_are_named() -> None:
    with pytest.raises(sr.DescriptionError, match=r"plain has no capsules.*its collision shapes: a box of link bar"):
        robot_capsules(plain(BOX))
    with pytest.raises(sr.DescriptionError, match="its collision shapes: none"):
        robot_capsules(plain(""))
    with pytest.raises(sr.ParameterError, match="model"):
        robot_capsules(sr.InflatableArm())  # type: ignore[arg-type]


ARM = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="arm" pos="0 0 1">
<joint name="j" axis="0 1 0" stiffness="5"/>
<geom type="capsule" fromto="0.1 0 0 0.5 0 0" size=".05"/><geom type="cylinder" size=".1 .2" pos="0 0 .3"/>
<geom type="box" size=".1 .2 .3"/><geom type="sphere" size=".9" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
BALL_ARM = """<sdf version="1.9"><model name="m"><link name="arm"><pose>0 0 1 0 0 0</pose>
<collision name="c"><pose>0.3 0 0 0 TURN 0</pose>
<geometry><capsule><radius>0.05</radius><length>0.4</length></capsule></geometry></collision>
<collision name="d"><pose>0 0 .3 0 0 0</pose><geometry><cylinder><radius>.1</radius><length>.4</length></cylinder></geometry>
</collision></link><joint name="j" type="revolute"><parent>world</parent><child>arm</child><axis><xyz>0 1 0</xyz><dynamics>
<spring_stiffness>5</spring_stiffness></dynamics></axis></joint></model></sdf>""".replace("TURN", repr(math.pi / 2))


@pytest.mark.parametrize(("package", "text"), [("mujoco", ARM), ("pydrake", BALL_ARM)])
def test_round_collision_shapes_of_mjcf_and_sdf_are_capsules(package: str, text: str, tool: Callable) -> None:
    """In the axes of the joint, which is at the origin of the link; 1e-12: rounding of quaternions."""
    tool(package)
    found = robot_capsules(sr.load_model(text))
    assert [(one.link, one.joint, one.radius) for one in found] == [("arm", 1, 0.05), ("arm", 1, 0.1)]
    ends = [sorted([tuple(one.start.round(12) + 0.0), tuple(one.end.round(12) + 0.0)]) for one in found]
    assert ends == [[(0.1, 0, 0), (0.5, 0, 0)], [(0, 0, 0.1), (0, 0, 0.5)]]


def tagged(**attributes: str | None) -> str:
    """The bar with a capsule of which some attributes differ."""
    good: dict[str, Any] = {"link": "bar", "start": "0 0 0", "end": "0 0 1", "radius": "0.1"}
    words = " ".join(f'{name}="{value}"' for name, value in (good | attributes).items() if value is not None)
    return PLAIN.format("").replace("</robot>", f'<s:capsule xmlns:s="urn:softrobots:urdf" {words}/></robot>')


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"link": "arm"}, "a capsule of a link 'arm'; a link that exists is required: base, bar"),
        ({"link": None}, "a capsule of a link ''"),
        ({"start": "0 0"}, "2 numbers as its start; x, y and z are required"),
        ({"start": "0 0 nan"}, "start = '0 0 nan'"),
        ({"end": "0 0 inf"}, "end = '0 0 inf'"),
        ({"end": "0 0 1e31"}, "end = '0 0 1e31'"),
        ({"end": None}, "end = ''"),
        ({"radius": "0"}, "radius 0.0; a positive number"),
        ({"radius": "-0.1"}, "radius -0.1; a positive number"),
        ({"radius": "wide"}, "radius = 'wide'; a finite number"),
        ({"radius": None}, "radius = None; a finite number"),
    ],
)
def test_bad_capsules_are_refused(attributes: dict[str, str | None], message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        sr.load_model(tagged(**attributes), springs={"hinge": 5.0})


def test_equal_capsules_are_refused_and_points_are_spheres() -> None:
    model = sr.load_model(tagged(end="0 0 0"), springs={"hinge": 5.0})
    np.testing.assert_array_equal(robot_capsules(model)[0].end, np.zeros(3))
    twice = tagged().replace(
        "</robot>", '<s:capsule xmlns:s="urn:softrobots:urdf" link="bar" start="0 0 0.0" end="0 0 1" radius="1e-1"/></robot>'
    )
    with pytest.raises(sr.DescriptionError, match="2 equal capsules of link bar"):
        read_tags(twice)


# --- How far the body is from its capsules


def distance(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of points, shape (n, 3), from a segment, shape (n,)."""
    along = end - start
    share = np.clip((points - start) @ along / max(along @ along, 1e-30), 0.0, 1.0)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1)


def largest_error(line: FloatArray, segments: list[tuple[FloatArray, FloatArray]], radius: float) -> float:
    """Largest distance of balls around a sampled line from capsules around segments, and the other way, by brute force."""
    axis, turn = np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False))
    across = np.sqrt(1.0 - axis**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), axis], axis=-1).reshape(-1, 3)
    surface = (line[:, None] + radius * directions).reshape(-1, 3)
    outside = np.min([distance(surface, *segment) for segment in segments], axis=0).max() - radius
    core = np.concatenate([start + np.linspace(0.0, 1.0, 50)[:, None] * (end - start) for start, end in segments])
    pieces = np.min([distance(core, *piece) for piece in pairwise(line)], axis=0).max()
    return max(float(outside), float(pieces))


def section_errors(model: sr.SoftModel, q_motors: FloatArray, q_springs: FloatArray) -> list[float]:
    """The errors of sections of constant strain: screws of Pinocchio against the capsules where the joints put them."""
    data = model.pinocchio.createData()
    pin.framesForwardKinematics(model.pinocchio, data, model.configuration(q_motors, q_springs))
    capsules, z = robot_capsules(model), model.structure.section_coordinates(q_motors, q_springs)
    shares, errors = np.linspace(0.0, 1.0, 61), []
    for row, section in enumerate(model.structure.section_table):
        first = model.pinocchio.getJointId(section.joint_names[0])
        before = data.oMi[model.pinocchio.parents[first]] * model.pinocchio.jointPlacements[first]
        start = before * pin.SE3(pin.rpy.rpyToMatrix(-section.rest_joints[0], 0.0, 0.0), np.zeros(3))
        motion = np.array([0.0, 0.0, section.length + z[row, 3], *z[row, :3]])
        line = np.array([(start * pin.exp6(share * motion)).act(np.array([*section.middle, 0.0])) for share in shares])
        own = [one for one in capsules if one.link in (f"{section.name}_lower", f"{section.name}_upper")]
        segments = [(data.oMi[one.joint].act(one.start), data.oMi[one.joint].act(one.end)) for one in own]
        errors.append(largest_error(line, segments, own[0].radius))
    return errors


sides = st.floats(-1.2, 1.2)


@law("capsule_error")
@given(bends=st.tuples(sides, sides), twist=st.floats(-1.5, 1.5), stretch=st.floats(-0.04, 0.1))
@settings(max_examples=6)
@example(bends=(0.0, 0.0), twist=0.0, stretch=0.08)
@example(bends=(0.0, 0.0), twist=0.0, stretch=-0.12)  # each half passes the other end
def test_the_error_around_a_chain_is_the_largest_distance(bends: tuple[float, float], twist: float, stretch: float) -> None:
    """Attained: the largest sampled distance is never above, and below by what the samples miss, directions up to 4 degrees."""
    robot = sr.PccArm(segment_lengths=(0.2,), elastic_sections=1, muscle_azimuths=(), radius=0.03)
    model = sr.load_model(robot)
    q_springs = np.array([*bends, twist, stretch])
    (bound,), (found,) = sr.capsule_error(model, [], q_springs), section_errors(model, np.zeros(0), q_springs)
    assert bound - 5e-3 * (bound + robot.radius[0]) <= found <= bound + 1e-12


@pytest.mark.parametrize("actuator", ["drawn", "length", "elastic"])
def test_the_error_of_a_helix_bounds_the_distance(actuator: str, rng: np.random.Generator) -> None:
    """Around the chain, attained; beside it, the bound is at most twice the distance here."""
    robot = sr.HelixTube(length=0.3, elastic_sections=3, actuator=actuator)
    model = sr.load_model(robot)
    motors = model.relaxed_motors
    for size in (0.0, 0.3):
        y = model.rest + size * rng.uniform(-1.0, 1.0, model.n_springs) * np.where(model.springs.turning, 1.0, 0.02)
        bounds, found = sr.capsule_error(model, motors, y), np.array(section_errors(model, motors, y))
        assert np.all(found <= bounds + 1e-12)
        if actuator == "drawn":
            assert np.all(found >= bounds - 2.5e-3 * (bounds + robot.radius))
        elif size:
            assert np.all(found >= 0.5 * bounds)


@given(bends=st.tuples(sides, sides), stretch=st.floats(-0.05, 0.1))
@settings(max_examples=6)
def test_the_error_of_a_hinge_is_that_of_the_arc_between_its_pieces(bends: tuple[float, float], stretch: float) -> None:
    """The arc that touches both pieces at their ends, half a section from the hinge; 1e-5: its 60 points make a polygon."""
    robot = sr.PccArm(segment_lengths=(0.2,), chain="lumped", hinges=1, muscle_azimuths=(), radius=0.03)
    model = sr.load_model(robot)
    y = [{"bend_x": bends[0], "bend_y": bends[1], "stretch": stretch}.get(n[12:], 0.0) for n in model.spring_joints]
    (first, second) = [(start, end) for start, end, _ in cores(model, model.configuration([], y))]
    corner, touching = first[1], 0.1 + min(stretch, 0.0)  # the second piece stretches, behind the bends
    back, ahead = (first[0] - corner) / 0.1, (second[1] - second[0]) / 0.1
    angle, line = np.arctan2(np.linalg.norm(np.cross(back, ahead)), -back @ ahead), [first[0]]
    if angle > 1e-6:
        inwards, across = ((way / np.linalg.norm(way)) for way in (back + ahead, ahead - back))
        centre, bow = corner + touching / np.sin(angle / 2) * inwards, touching / np.tan(angle / 2)
        turns = np.linspace(-0.5, 0.5, 60)[:, None] * angle
        line += list(centre - bow * (np.cos(turns) * inwards - np.sin(turns) * across))
    (bound,) = sr.capsule_error(model, [], y)
    found = largest_error(np.array([*line, second[1]]), [first, second], 0.03)
    assert touching * np.tan(angle / 4) - 2.5e-3 * (bound + 0.03) <= found <= bound + 1e-5


def test_straight_links_are_exact_and_bad_coordinates_refused(arm: sr.SoftModel) -> None:
    assert sr.capsule_error(arm, np.zeros(3)).shape == (0,)
    with pytest.raises(sr.ParameterError, match="q_motors"):
        sr.capsule_error(arm, [0.0])
    bent = sr.load_model(sr.PccArm(elastic_sections=1, muscle_azimuths=()))
    with pytest.raises(sr.ParameterError, match="range of every section"):
        sr.capsule_error(bent, [], np.full(bent.n_springs, 3.0))


@pytest.mark.study
@pytest.mark.parametrize("sections", [4, 20])
@pytest.mark.parametrize("floor", [sr.HalfSpace((0, 0, 1)), sr.Box((4, 4, 1), (0, 0, -0.5))])
def test_a_robot_stands_on_a_floor_without_touching_it(sections: int, floor: object) -> None:
    """Its base has a flat end where the capsule has a cap; capsules of a radius 3 times as long as them, too."""
    model = sr.load_model(sr.PccArm(elastic_sections=sections, muscle_azimuths=(), radius=0.05))
    free = sr.solve_equilibrium(model, [], (2.0, 1.0, 0.0))
    found = sr.solve_equilibrium(model, [], (2.0, 1.0, 0.0), environment=sr.Environment([floor]))
    assert not found.contacts
    np.testing.assert_allclose(found.q_springs, free.q_springs, atol=1e-9)


def test_a_tube_beside_its_actuator_stands_on_a_floor() -> None:
    """The start of its centre line nearly stays, and is beside the first joint."""
    model = sr.load_model(sr.HelixTube(length=0.4, elastic_sections=6, actuator="length"))
    floor = sr.Environment([sr.HalfSpace((0, 0, 1))])
    free, found = (sr.solve_equilibrium(model, model.relaxed_motors, (0.01, 0, 0), environment=one) for one in (None, floor))
    assert not found.contacts
    np.testing.assert_allclose(found.q_springs, free.q_springs, atol=1e-9)


def test_a_robot_that_is_pressed_to_its_floor_lies_on_it() -> None:
    """Its tip is a radius above, and the floor carries part of the load; 1e-9 of the reach, the tolerance of gaps."""
    model = sr.load_model(sr.PccArm(elastic_sections=8, muscle_azimuths=(), radius=0.05))
    found = sr.solve_equilibrium(model, [], (3.0, 0.0, -28.0), environment=sr.Environment([sr.HalfSpace((0, 0, 1))]))
    (contact,) = found.contacts
    assert found.stable
    assert contact.link == "section_2_8_upper"
    assert 0.0 < contact.normal_force < 28.0
    assert found.tip_position[2] == pytest.approx(0.05, abs=1e-9 * model.reach)
