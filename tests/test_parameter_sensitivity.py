"""`sensitivity`: derivatives by robots, springs, actuators, loads, base and markers; of estimates and frequencies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.identification.parameters import ParameterSet
from softrobots.model.friction_coordinates import memory_of, remembering
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from tests.support.law_robots import ROBOTS, Case, cases, model
from tests.support.laws import law

ARM = (0.3, 0.6, -0.8)
LOAD = {"force": (0.0, 10.0, -15.0), "gravity": sr.EARTH_GRAVITY}
TOLERANCE = {"tolerance": 1e-13}


def turn_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Rotation vector from one rotation to another, world axes."""
    return np.asarray(pin.log3(other @ one.T))


@pytest.mark.study
@law("sensitivity", "Sensitivity")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(0.5), way=st.integers(0, 2**32 - 1))
@settings(max_examples=2)
def test_sensitivities_are_those_of_equilibria_nearby(kind: str, case: Case, way: int) -> None:
    """Along a way through springs, actuators, loads and the pose of the base at once, by differences of solved equilibria."""
    robot, random = model(kind), np.random.default_rng(way)
    motors, force, gravity = case.motors(robot), case.force(kind), np.array(case.gravity or (0.0, 0.0, 0.0))
    assume(robot.actuators.admit(motors))
    found = sr.solve_equilibrium(robot, motors, force, gravity=gravity, **TOLERANCE)
    softness = np.sqrt(robot.stiffness)
    assume(found.stable and np.linalg.eigvalsh(found.tangent_stiffness / np.outer(softness, softness)).min() > 0.05)
    assume(np.all(np.abs(robot.springs.beyond_plateaus(found.q_springs)) > 1e-2))
    names = ["force", "gravity", "base.position", "base.rotation"] + ["motor[*]"] * (robot.n_motors > 0)
    if robot.spring_joints[: len(robot.structure.spring_joints)] and not robot.spring_groups:
        names += ["joint[*].stiffness", "joint[*].rest"]
    slopes = sr.sensitivity(robot, found, names)
    assert isinstance(slopes, sr.Sensitivity)
    assert len(slopes.names) == len(slopes.units) == slopes.q_springs.shape[1]
    scales = np.concatenate([np.full(3, np.linalg.norm(force) + 0.1), np.ones(9), robot.motor_scale])
    table = np.array(list(robot.spring_table.values())).reshape(-1, 2)
    joints = table if "joint[*].rest" in names else table[:0]
    scales = np.concatenate([scales, joints[:, 0], np.full(len(joints), 0.1)])
    along = random.normal(size=len(scales)) * scales
    pull, weight, position, turn, motor, rest = np.split(along, np.cumsum([3, 3, 3, 3, robot.n_motors]))
    steps, held = [], robot.structure.muscle_lengths
    for number in (-2, -1, 1, 2):
        step = 1e-4 * number
        base = pin.exp3(step * turn)
        changed = zip(robot.spring_table, joints + step * rest.reshape(2, len(joints)).T, strict=False)
        springs = {name: (stiffness, at) for name, (stiffness, at) in changed}
        near = sr.solve_equilibrium(
            sr.with_springs(robot, springs),
            motors + step * motor,
            base.T @ (force + step * pull),
            gravity=base.T @ (gravity + step * weight),
            q_springs0=found.q_springs,
            **TOLERANCE,
        )
        pose = near.transform_tip_to_world
        moved = turn_between(found.transform_tip_to_world.rotation, base @ pose.rotation)
        elastic = near.q_springs if held is None else held.elastic @ near.model.structure.strains(near.q_motors, near.q_springs)
        steps.append(np.concatenate([step * position + base @ pose.translation, moved, elastic, near.motor_torques]))
    expected = np.array([1.0, -8.0, 8.0, -1.0]) @ steps / 12e-4
    mine = np.concatenate([slopes.tip_pose, slopes.q_springs, slopes.motor_torques]) @ along
    sizes = np.split(np.abs(expected), [6, 6 + robot.n_springs])
    each = np.repeat([max(float(size.max(initial=0.0)), 1e-3) for size in sizes], [len(size) for size in sizes])
    # the solver's 1e-13 over the step of 1e-4, over the least stiffness of 0.05; given lengths may be 1e-6 m from consistent
    assert np.all(np.abs(mine - expected) <= 1e-7 * each)
    weights = random.normal(size=6)
    np.testing.assert_allclose(slopes.gradient(weights), weights @ slopes.tip_pose, atol=1e-12 * np.abs(slopes.tip_pose).max())


@pytest.mark.study
def test_frequencies_are_those_of_solved_robots() -> None:
    """Of a robot with four different frequencies; by fields, a spring, a motor, the load and the base, also with servos."""
    robot = sr.InflatableArm(link_lengths=(0.5, 0.4), stiffness=(200.0, 150.0))
    names = (
        "link[1].stiffness",
        "link_lengths[2]",
        "density",
        "joint[spring_2_up].rest",
        "motor[3]",
        "force.y",
        "base.rotation.x",
    )
    parameters = ParameterSet.of(robot, names)
    base = parameters.present
    for servos in (None, (4000.0, 3000.0, 2000.0)):
        options = {"servo_stiffness": servos}
        found = sr.solve_equilibrium(base, ARM, **LOAD, **TOLERANCE)
        slopes = sr.sensitivity(base, found, parameters).frequencies(sr.vibration_modes(base, found, **options))
        for place in range(len(names)):

            def frequencies(step: float, place: int = place, options: dict = options) -> np.ndarray:
                shift = np.zeros(len(names))
                shift[place] = step
                turn = pin.exp3(np.array([shift[6], 0.0, 0.0])).T
                motors = np.array(ARM) + np.array([0.0, 0.0, shift[4]])
                force = turn @ (np.array(LOAD["force"]) + (0.0, shift[5], 0.0))
                model = parameters.model(parameters.values + shift)
                load = {"gravity": turn @ np.array(sr.EARTH_GRAVITY), **TOLERANCE}
                return sr.vibration_modes(model, sr.solve_equilibrium(model, motors, force, **load), **options).frequencies

            step = 1e-3 * max(abs(parameters.values[place]), 1.0)
            weights = {-2: 1.0, -1: -8.0, 1: 8.0, 2: -1.0}
            expected = sum(weight * frequencies(number * step) for number, weight in weights.items()) / (12.0 * step)
            slow, size = slice(4), np.abs(expected[:4]).max()  # those of servos are exact to 1e-10 Hz only
            np.testing.assert_allclose(slopes[slow, place], expected[slow], rtol=0.0, atol=1e-8 * size, err_msg=names[place])


PENDULUM = """<robot name="pendulum"><link name="base"/>
<link name="cross"/>
<link name="tip"><inertial><origin xyz="0 0 0.5"/><mass value="2.0"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="revolute"><parent link="base"/><child link="cross"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="y" type="revolute"><parent link="cross"/><child link="tip"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def test_frequencies_of_a_round_robot_part_with_their_own_slopes() -> None:
    """A point mass on two springs that cross, of which one becomes stiffer: one frequency stays, the other has `f / 2k`."""
    model = sr.load_model(PENDULUM, springs={"x": 8.0, "y": 8.0})
    found = sr.solve_equilibrium(model, ())
    modes = sr.vibration_modes(model, found)
    np.testing.assert_allclose(modes.frequencies, np.sqrt(8.0 / (2.0 * 0.5**2)) / (2.0 * np.pi), rtol=1e-12)
    each = modes.frequencies[0] / 16.0
    for name, expected in (("joint[x].stiffness", (0.0, each)), ("joint[x,y].stiffness", (each, each))):
        slopes = sr.sensitivity(model, found, name).frequencies(modes)[:, 0]
        np.testing.assert_allclose(slopes, expected, rtol=1e-9, atol=1e-9 * each)


def test_an_estimated_force_follows_the_parameters() -> None:
    """At the same measured torques, against estimates of robots with other values; what the motors feel stays."""
    names = ("link[2].stiffness", "density", "motor[2]", "gravity.x")
    parameters = ParameterSet.of(sr.InflatableArm(), names)
    base, gravity = parameters.present, np.array(sr.EARTH_GRAVITY)
    torques = sr.solve_equilibrium(base, ARM, **LOAD, **TOLERANCE).motor_torques
    options = {"gravity": gravity, "restart": False}
    found = sr.estimate_load(base, ARM, torques, **options)
    slopes = sr.sensitivity(base, found, parameters)
    for place, value in enumerate(parameters.values.tolist()):
        step = 1e-4 * (abs(value) or 1.0)

        def force(number: int, place: int = place, step: float = step) -> np.ndarray:
            shift = np.zeros(len(names))
            shift[place] = number * step
            model, motors = parameters.model(parameters.values + shift), np.array(ARM) + (0.0, shift[2], 0.0)
            turned = options | {"gravity": gravity + (shift[3], 0.0, 0.0)}
            again = sr.estimate_load(model, motors, torques, **turned)
            return again.force

        expected = (8.0 * (force(1) - force(-1)) - force(2) + force(-2)) / (12.0 * step)
        # estimates leave 1e-10 of the torques, which the step enlarges
        np.testing.assert_allclose(slopes.force[:, place], expected, rtol=0.0, atol=1e-5 * np.abs(expected).max() + 1e-5)
    assert np.abs(slopes.motor_torques).max() < 1e-9 * np.abs(torques).max() / 1e-3


@pytest.mark.study
def test_friction_slips_or_sticks_while_parameters_change() -> None:
    """From rest, which changes with its parameters, and after a step, of which the memory stays; two segments slip or stick."""
    names = ("segment[*].bending_friction", "segment[1].bending_stiffness", "linear_density", "motor[2]")
    robot = sr.PccArm(segment_lengths=(0.3, 0.25), elastic_sections=2, kind="tension", bending_friction=(0.15, 0.02))
    parameters = ParameterSet.of(robot, names)
    model, motors = parameters.present, np.array([5.0, 20.0, 0.0, 10.0, 0.0, 3.0])
    first = sr.solve_equilibrium(model, motors, gravity=sr.EARTH_GRAVITY, **TOLERANCE)
    second = sr.solve_equilibrium(model, 0.9 * motors, gravity=sr.EARTH_GRAVITY, previous=first, **TOLERANCE)
    for found in (first, second):
        slopes = sr.sensitivity(model, found, parameters)
        for place, value in enumerate(parameters.values.tolist()):
            step = 1e-5 * (abs(value) or 10.0)

            def tip(number: int, place: int = place, step: float = step, found: sr.Equilibrium = found) -> np.ndarray:
                shift = np.zeros(len(parameters.names))
                shift[place] = number * step
                other = parameters.model(parameters.values + shift)
                if found is second:
                    other = remembering(other, memory_of(second.model))
                moved = found.q_motors + np.array([0.0, shift[-1], 0.0, 0.0, 0.0, 0.0])
                load = Load.of(other, gravity=sr.EARTH_GRAVITY)
                state = balanced_state(other, moved, load, found.q_springs, tolerance=1e-13)
                assert state is not None
                return np.array(frame_placement(other, state.q, other.tip).translation)

            expected = (8.0 * (tip(1) - tip(-1)) - tip(2) + tip(-2)) / (12.0 * step)
            size = max(float(np.abs(expected).max()), 1e-4 / (abs(value) or 10.0))
            np.testing.assert_allclose(slopes.tip_position[:, place], expected, rtol=0.0, atol=1e-7 * size)


def test_a_marker_moves_with_its_frame_and_its_offset() -> None:
    model = sr.load_model(sr.InflatableArm())
    found = sr.solve_equilibrium(model, ARM, **LOAD)
    parameters = ParameterSet.of(model, ("stiffness", "marker.dot.offset"), {"dot": "link_1"})
    slopes = sr.sensitivity(model, found, parameters)
    np.testing.assert_array_equal(slopes.frame("dot")[:, 0], slopes.frame("link_1")[:, 0])
    number = model.frame_id("link_1")
    data = model.pinocchio.createData()
    pin.framesForwardKinematics(model.pinocchio, data, found.q)
    np.testing.assert_allclose(slopes.frame("dot")[:3, 1:], data.oMf[number].rotation, atol=1e-12)
    assert not np.any(slopes.frame("link_1")[:, 1:])


def test_what_has_no_derivative_is_refused() -> None:
    model = sr.load_model(sr.InflatableArm(stiffness=(150.0, 200.0)))
    found = sr.solve_equilibrium(model, ARM, **LOAD)
    with pytest.raises(sr.ParameterError, match="ties them"):
        sr.sensitivity(model, found, "stiffness")
    with pytest.raises(sr.NameNotFound):
        sr.sensitivity(model, found, "stifness")
    with pytest.raises(sr.ParameterError, match="model"):
        sr.sensitivity(sr.load_model(sr.InflatableArm()), found, "density")
    slopes = sr.sensitivity(model, found, ["density"])
    with pytest.raises(sr.ParameterError, match="LoadEstimate"):
        _ = slopes.force
    with pytest.raises(sr.ParameterError, match="weights"):
        slopes.gradient((1.0, 2.0))
    other = sr.solve_equilibrium(model, ARM, gravity=sr.EARTH_GRAVITY)
    with pytest.raises(sr.ParameterError, match="modes"):
        slopes.frequencies(sr.vibration_modes(model, other))
    still = sr.load_model(sr.PccArm(segment_lengths=(0.3,), elastic_sections=2))
    with pytest.raises(sr.ParameterError, match="structure"):  # friction that begins
        sr.sensitivity(still, sr.solve_equilibrium(still, still.relaxed_motors), "bending_friction")
    buckling = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))
    size = float(buckling.stiffness[0]) / 0.57
    neutral = sr.solve_equilibrium(buckling, (0.0, 0.0), (-size, 0.0, 0.0), method="fixed_point")
    with pytest.raises(sr.NeutralEquilibrium):
        sr.sensitivity(buckling, neutral, "stiffness")


def test_what_nearly_cancels_is_still_exact() -> None:
    """Weight and stiffness of a tube change alike with its wall: the sag feels it by what pressure carries, a thousandth."""
    parameters = ParameterSet.of(sr.HelixTube(length=0.3, elastic_sections=5, pressure=1e3), "wall_thickness")
    load, thickness = {"gravity": (0.0, 0.0, -981.0), "tolerance": 1e-15}, parameters.values[0]

    def tip(share: float) -> np.ndarray:
        robot = parameters.model([thickness * (1.0 + share)])
        return np.array(sr.solve_equilibrium(robot, [], **load).tip_position)

    found = sr.sensitivity(parameters.present, sr.solve_equilibrium(parameters.present, [], **load), parameters)
    central = [(tip(0.01 * number) - tip(-0.01 * number)) / (0.02 * number) for number in (1, 2, 3, 4)]
    eighth_order = np.array([56.0, -28.0, 8.0, -1.0]) @ central / 35.0
    slope = found.tip_position[:, 0] * thickness
    # differences of other steps agree to 3e-9; with numbers of second order the sensitivity is 3e-8 off
    np.testing.assert_allclose(slope, eighth_order, rtol=0, atol=1e-8 * np.linalg.norm(slope))
