"""A description as plain bodies and joints: nothing is lost on the way in, nor on the way out."""

from __future__ import annotations

import dataclasses
import math
import re
from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.paths import urdf_folder
from softrobots.description.rigid_tree import Placement, RigidTree
from softrobots.description.rigid_tree_urdf import read_rigid_tree, write_rigid_tree
from softrobots.description.third_party import UR5, package_folders, robot_file
from softrobots.description.urdf_tags import SpringTag
from tests.conftest import missing
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS
from tests.support.tables import each_row

SHIPPED = [urdf_folder() / f"{name}.urdf" for name in sr.ROBOTS]


def with_springs(tree: RigidTree, springs: dict[str, tuple[float, float]]) -> RigidTree:
    return dataclasses.replace(tree, springs={name: SpringTag(*numbers) for name, numbers in springs.items()})


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_bodies_and_joints_are_those_of_yourdfpy(file: Path) -> None:
    import yourdfpy

    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_scene_graph=False).robot
    tree = read_rigid_tree(file.read_text())
    assert tree.name == robot.name
    assert tree.root == "world"
    assert {body.name for body in tree.bodies} == {link.name for link in robot.links}
    for link in robot.links:
        body = tree.body(link.name)
        assert len(body.visuals) == len(link.visuals)
        assert len(body.collisions) == len(link.collisions)
        if link.inertial is not None:
            assert body.mass == link.inertial.mass
            assert np.array_equal(body.inertia, link.inertial.inertia)
            assert np.allclose(body.centre.position, link.inertial.origin[:3, 3], rtol=0, atol=0)
    for theirs in robot.joints:
        ours = next(joint for joint in tree.joints if joint.name == theirs.name)
        assert (ours.kind, ours.parent, ours.child) == (theirs.type, theirs.parent, theirs.child)
        assert np.allclose(ours.placement.position, theirs.origin[:3, 3], rtol=0, atol=0)
        assert np.allclose(ours.placement.rotation, theirs.origin[:3, :3], rtol=0, atol=1e-15)  # both round a product of sines
        if ours.movable:
            assert np.array_equal(ours.axis, theirs.axis)
            assert ours.limits == (theirs.limit.lower, theirs.limit.upper)
            assert (ours.effort, ours.velocity) == (theirs.limit.effort, theirs.limit.velocity)
            assert ours.damping == float(theirs.dynamics.damping)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_parents_stand_before_their_children(file: Path) -> None:
    tree = read_rigid_tree(file.read_text())
    places = {body.name: place for place, body in enumerate(tree.bodies)}
    assert all(places[joint.parent] < places[joint.child] for joint in tree.joints)
    assert sum(len(tree.joints_of(body.name)) for body in tree.bodies) == len(tree.bodies) - 1


@pytest.mark.parametrize("name", ["inflatable_arm", "pcc_arm_lumped", "helix_tube_lumped"])
def test_what_is_written_is_the_same_robot(name: str, rng: np.random.Generator) -> None:
    """Kinematics, mass matrix, springs; 1e-12: a rotation goes through roll, pitch and yaw."""
    ours = sr.load_model(urdf_folder() / f"{name}.urdf")
    again = sr.load_model(write_rigid_tree(with_springs(read_rigid_tree(ours.urdf), ours.spring_table)))
    assert again.spring_table == ours.spring_table
    assert again.motor_joints[: ours.n_motors] == ours.motor_joints[: again.n_motors]
    for _ in range(3):
        q = rng.uniform(-1.0, 1.0, ours.pinocchio.nq)
        one, other = ours.pinocchio.createData(), again.pinocchio.createData()
        mass = pin.crba(ours.pinocchio, one, q)
        assert np.allclose(pin.crba(again.pinocchio, other, q), mass, rtol=0, atol=1e-12 * np.abs(mass).max())
        pin.framesForwardKinematics(ours.pinocchio, one, q)
        pin.framesForwardKinematics(again.pinocchio, other, q)
        tip = one.oMf[ours.frame_id("tip")].homogeneous
        assert np.allclose(other.oMf[again.frame_id("tip")].homogeneous, tip, rtol=0, atol=1e-12)


def test_shapes_survive(arm: sr.SoftModel) -> None:
    tree = read_rigid_tree(arm.urdf)
    again = read_rigid_tree(write_rigid_tree(with_springs(tree, arm.spring_table)))
    for body in tree.bodies:
        for kind in ("visuals", "collisions"):
            for one, other in zip(getattr(body, kind), getattr(again.body(body.name), kind), strict=True):
                assert (one.kind, one.size, one.rgba) == (other.kind, other.size, other.rgba)
                assert np.allclose(one.placement.position, other.placement.position, rtol=0, atol=0)
                assert np.allclose(one.placement.rotation, other.placement.rotation, rtol=0, atol=1e-15)


def test_a_branched_robot_of_somebody_keeps_its_equilibrium() -> None:
    """A continuous joint, a slider, skew placements, a side branch."""
    options = {"tip": "finger"}
    ours = sr.load_model(BRANCHED, springs=SPRINGS, **options)
    again = sr.load_model(write_rigid_tree(with_springs(read_rigid_tree(BRANCHED), ours.spring_table)), **options)
    assert again.motor_joints == ours.motor_joints
    motors, force = (0.3, -0.4, 0.2), (3.0, 5.0, -8.0)
    one = sr.solve_equilibrium(ours, motors, force, gravity=sr.EARTH_GRAVITY)
    other = sr.solve_equilibrium(again, motors, force, gravity=sr.EARTH_GRAVITY)
    assert np.allclose(one.q_springs, other.q_springs, rtol=0, atol=1e-9)  # the solver stops at 1e-10 of the load


angles = st.floats(-math.pi, math.pi)


@given(angles, st.sampled_from([-1.0, 1.0]), st.floats(0.0, 1e-3), angles)
def test_roll_pitch_yaw_give_the_rotation_back_near_the_pole(roll: float, sign: float, off: float, yaw: float) -> None:
    """Where pitch is 90 degrees, roll and yaw are not determined one by one; their rotation is, to rounding."""
    rotation = np.asarray(pin.rpy.rpyToMatrix(roll, sign * (math.pi / 2 - off), yaw))
    again = pin.rpy.rpyToMatrix(*Placement(np.zeros(3), rotation).rpy)
    assert np.allclose(again, rotation, rtol=0, atol=4e-15)


@given(angles, angles, angles)
def test_quaternions_turn_vectors_as_the_rotation_does(roll: float, pitch: float, yaw: float) -> None:
    rotation = np.asarray(pin.rpy.rpyToMatrix(roll, pitch, yaw))
    w, *v = Placement(np.zeros(3), rotation).quaternion
    x = np.array([0.3, -0.7, 1.1])
    turned = x + 2.0 * w * np.cross(v, x) + 2.0 * np.cross(v, np.cross(v, x))
    assert np.allclose(turned, rotation @ x, rtol=0, atol=4e-15)


def test_a_slider_without_limits_can_slide() -> None:
    tree = read_rigid_tree(BRANCHED)
    joints = [dataclasses.replace(j, limits=(-math.inf, math.inf)) if j.name == "slider" else j for j in tree.joints]
    model = sr.load_model(write_rigid_tree(dataclasses.replace(tree, joints=tuple(joints))), springs={}, tip="finger")
    place = model.motor_joints.index("slider")
    assert model.motor_limits[place][0] <= -1e6
    assert model.motor_limits[place][1] >= 1e6


@each_row(
    ("text", "told"),
    [
        ("<robot name='a'>", "not well-formed"),
        ("<mujoco/>", "root"),
        ("<robot name='a'/>", "root links"),
        (f"<robot name='a'><link name='a'>{INERTIAL}</link><link name='b'/></robot>", "a, b"),
        (f"<robot name='a'><link name='a'>{INERTIAL.replace('0.5', 'heavy')}</link></robot>", "heavy"),
        ("<robot name='a'><link name='a'><visual><geometry/></visual></link></robot>", "shape"),
        ("<robot name='a'><link name='a'><visual><geometry><capsule/></geometry></visual></link></robot>", "capsule"),
        (BRANCHED.replace('<child link="hand"/>', '<child link="hnad"/>'), "hand"),
        (BRANCHED.replace('<origin xyz="0.3 0 0"', '<origin xyz="0.3 0"', 1), "0.3 0"),
    ],
)
def test_what_is_no_tree_is_refused(text: str, told: str) -> None:
    with pytest.raises(sr.DescriptionError, match=told):
        read_rigid_tree(text)


def test_robot_files_of_other_people_are_found_or_refused() -> None:
    try:
        file = robot_file(UR5)
    except sr.MissingDependency as error:
        missing(str(error))
    assert read_rigid_tree(file.read_text()).name == "ur5"
    mesh = re.search(r'package://([^"]+)', file.read_text())
    assert mesh is not None
    assert any((Path(folder) / mesh[1]).is_file() for folder in package_folders())
    with pytest.raises(sr.NameNotFound, match="ur5_robot"):
        robot_file("ur_description/urdf/ur50_robot.urdf")


def test_without_example_robot_data_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", nothing)
    with pytest.raises(sr.MissingDependency, match=r"softrobots\[robots\]"):
        robot_file(UR5)
    assert package_folders() == []
