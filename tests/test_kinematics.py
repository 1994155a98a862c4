"""Geometry of the arm against the paper's Denavit-Hartenberg tables and against yourdfpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.description.paths import urdf_folder
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from tests.support.oracles import flexible_jacobian, flexible_table, rigid_table

# The last DH frame has its z axis along -y of the arm; the tip frame of the URDF has z up.
TIP_TO_DH = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
ROUNDING = 1e-12  # required; seven rotations and 1.2 m give about 1e-15


def angles_of(motors: np.ndarray, springs: np.ndarray) -> np.ndarray:
    """Seven DH angles: motors are joints 1, 2, 5 and springs 3, 4, 6, 7 of Table 2."""
    return np.array([motors[0], motors[1], springs[0], springs[1], motors[2], springs[2], springs[3]])


def test_joints_are_named_and_ordered_base_to_tip(arm: sr.SoftModel) -> None:
    assert arm.motor_joints == ("motor_1", "motor_2", "motor_3")
    assert arm.spring_joints == ("spring_1_side", "spring_1_up", "spring_2_side", "spring_2_up")
    assert arm.reach == pytest.approx(1.2, rel=1e-15)


def test_tip_pose_is_that_of_table_2(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for _ in range(100):
        motors, springs = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-1.5, 1.5, 4)
        found = frame_placement(arm, arm.configuration(motors, springs), "tip").homogeneous
        assert np.abs(found @ TIP_TO_DH - flexible_table(angles_of(motors, springs))[-1]).max() < ROUNDING


def test_results_have_the_pose_of_the_tip_as_matrices_and_as_se3(arm: sr.SoftModel) -> None:
    """That of Table 2 at their joint angles, at each waypoint too."""
    path = sr.follow_trajectory(arm, [(0.9, 0.1, 0.2), (0.9, 0.2, 0.2), (0.8, 0.2, 0.3)], (0.0, 5.0, -10.0))
    for held in path.equilibria:
        pose = held.tip_pose
        assert np.abs(pose @ TIP_TO_DH - flexible_table(angles_of(held.q_motors, held.q_springs))[-1]).max() < ROUNDING
        assert np.array_equal(held.tip_pose[:3, 3], held.tip_position)
        assert not held.tip_pose.flags.writeable
        assert held.transform_tip_to_world == pin.SE3(pose)
    solution = sr.solve_ik(arm, (0.9, 0.1, 0.2), (0.0, 5.0, -10.0))
    assert np.array_equal(solution.tip_pose, solution.equilibrium.tip_pose)


def test_tip_pose_with_springs_at_zero_is_that_of_table_1(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for _ in range(100):
        motors = rng.uniform(-np.pi, np.pi, 3)
        found = frame_placement(arm, arm.configuration(motors, np.zeros(4)), "tip").homogeneous
        assert np.abs(found @ TIP_TO_DH - rigid_table(motors)).max() < ROUNDING


def test_jacobian_is_that_of_equation_4(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    columns = [0, 1, 4, 2, 3, 5, 6]  # motors, then springs, among the DH joints
    for _ in range(100):
        motors, springs = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-1.5, 1.5, 4)
        found = frame_jacobian(arm, arm.configuration(motors, springs), "tip")
        found = found[:, np.r_[arm.motor_indices, arm.spring_indices]]
        assert np.abs(found - flexible_jacobian(angles_of(motors, springs))[:, columns]).max() < ROUNDING


@pytest.mark.parametrize("frame", [None, "link_1", "tip"])
def test_the_jacobian_of_an_equilibrium_is_that_of_differences(arm: sr.SoftModel, frame: str | None) -> None:
    """Central differences of 1e-6 rad of Pinocchio's placements: second derivatives cancel, rounding leaves 1e-10."""
    held = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15), gravity=sr.EARTH_GRAVITY)
    found, step = held.frame_jacobian(frame), 1e-6
    rotation = frame_placement(arm, held.q, frame or "tip").rotation
    for column in range(arm.pinocchio.nv):
        turn = np.eye(arm.pinocchio.nv)[column] * step
        before, after = (frame_placement(arm, held.q + sign * turn, frame or "tip") for sign in (-1.0, 1.0))
        assert (after.translation - before.translation) / (2 * step) == pytest.approx(found[:3, column], abs=1e-9)
        twist = (after.rotation - before.rotation) / (2 * step) @ rotation.T
        assert np.array([twist[2, 1], twist[0, 2], twist[1, 0]]) == pytest.approx(found[3:, column], abs=1e-9)
    with pytest.raises(sr.NameNotFound, match="elbow"):
        held.frame_jacobian("elbow")


def test_yourdfpy_places_every_link_where_pinocchio_does(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    import yourdfpy

    robot = yourdfpy.URDF.load(str(urdf_folder() / "inflatable_arm.urdf"))
    for _ in range(20):
        motors, springs = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-1.5, 1.5, 4)
        q = arm.configuration(motors, springs)
        names = (*arm.motor_joints, *arm.spring_joints)
        robot.update_cfg(dict(zip(names, np.r_[motors, springs], strict=True)))
        for link in robot.link_map:
            theirs = robot.get_transform(link, "world")
            assert np.abs(frame_placement(arm, q, link).homogeneous - theirs).max() < 1e-12, link


def test_file_text_and_robot_load_to_the_same_model(arm: sr.SoftModel, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(sr.InflatableArm().urdf(), encoding="utf-8")
    for source in (path, str(path), path.read_text(encoding="utf-8")):
        model = sr.load_model(source)
        assert model.pinocchio == arm.pinocchio
        assert model.spring_table == arm.spring_table
        assert model.spring_groups == arm.spring_groups
        assert (model.motor_joints, model.tip) == (arm.motor_joints, arm.tip)
