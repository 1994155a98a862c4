"""Contacts that pass from link to link in small steps, and obstacles that a step must not jump over."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr

PRESS = np.array([0.0, 0.0, -15.0])
ACROSS = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]  # axes of a peg along y
PLACES = np.array([0.55, 0.58, 0.59, 0.61, 0.65])  # the joint between two links is at 0.6
RELATIVE = 1e-7  # of forces: residuals of 1e-9 N m on levers of 0.1 m and more, over 10 N


def moved(x: float = 0.0, z: float = 0.0) -> np.ndarray:
    """A pose: along x and z."""
    pose = np.eye(4)
    pose[0, 3], pose[2, 3] = x, z
    return pose


def peg(height: float, way: float = 1.0) -> sr.Environment:
    """A peg along y under the arm, at the parameter along x, or at its opposite."""
    return sr.Environment([sr.Capsule(0.05, 1.0, (0, 0, height), ACROSS, pose=lambda s: moved(x=way * s))])


def check_balance(path: sr.ContactPath, force: np.ndarray) -> None:
    """Torques of the springs are those of the load and the contacts, by Pinocchio's Jacobians; friction keeps Coulomb's law."""
    for found in path.equilibria:
        robot, data, torque = found.model.pinocchio, found.model.pinocchio.createData(), np.zeros(found.model.pinocchio.nv)
        pin.computeJointJacobians(robot, data, found.q)
        pin.updateFramePlacements(robot, data)
        forces = [(found.model.tip, found.tip_position, force)]
        for link, point, pull in [*forces, *((one.link, one.point, one.force) for one in found.contacts)]:
            frame = found.model.frame_id(link)
            jacobian = pin.getFrameJacobian(robot, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            torque += jacobian.T @ np.concatenate([pull, np.cross(point - data.oMf[frame].translation, pull)])
        assert found.spring_torques == pytest.approx(torque[found.model.structure.spring_indices], abs=1e-8)
        for one in found.contacts:
            along, largest = one.force - one.normal_force * one.normal, path.friction * one.normal_force
            assert np.linalg.norm(along) <= largest + RELATIVE
            if one.status == "slips":  # as forced: the rigid arm does not give way along itself
                assert along == pytest.approx(-largest * one.slip / np.linalg.norm(one.slip), abs=RELATIVE * largest)


@pytest.mark.parametrize(
    ("height", "way", "elbow"), [(-0.1, 1.0, 0.0), (-0.1, 1.0, 0.05), (-0.1, -1.0, 0.0), (-0.12, 1.0, 0.0)]
)
def test_without_friction_a_contact_passes_a_joint_as_single_equilibria_do(
    arm: sr.SoftModel, height: float, way: float, elbow: float
) -> None:
    """At every place it is what the search for the least energy finds, which knows nothing of the way."""
    environment, motors, places = peg(height, way), (0.0, 0.0, elbow), np.sort(way * PLACES)
    path = sr.follow_contact(arm, motors, PRESS, environment=environment, parameters=places)
    assert not path.jumps
    for place, found in zip(places, path.equilibria, strict=True):
        single = sr.solve_equilibrium(arm, motors, PRESS, environment=environment.at(place))
        assert [one.link for one in found.contacts if one.strict] == [one.link for one in single.contacts if one.strict]
        assert found.q_springs == pytest.approx(single.q_springs, abs=1e-9)
        total = sum(one.normal_force for one in single.contacts)
        assert sum(one.normal_force for one in found.contacts) == pytest.approx(total, rel=RELATIVE)


@pytest.mark.study
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_with_friction_a_contact_passes_a_joint_and_slips_by_coulombs_law(arm: sr.SoftModel, way: float) -> None:
    path = sr.follow_contact(arm, (0, 0, 0), PRESS, environment=peg(-0.12, way), parameters=np.sort(way * PLACES), friction=0.3)
    assert not path.jumps
    assert [found.contacts[0].status for found in path.equilibria[1:]] == ["slips"] * 4
    check_balance(path, PRESS)


@pytest.mark.parametrize("place", [0.6, 0.601, 0.605])
def test_a_ball_pressed_on_a_joint_is_held_by_one_of_its_links(arm: sr.SoftModel, place: float) -> None:
    ball = sr.Environment([sr.Sphere(0.1, (place, 0, 0.3), pose=lambda s: moved(z=-s))])
    path = sr.follow_contact(arm, (0, 0, 0), environment=ball, parameters=np.linspace(0.0, 0.3, 4), friction=0.3)
    assert len([one for one in path.contacts[-1] if one.strict]) == 1
    check_balance(path, np.zeros(3))


def test_a_rigid_link_that_is_drawn_along_slips_with_all_its_friction() -> None:
    """No spring lets the arm follow the peg: the friction is mu N from the first step on, however small that is."""
    model = sr.load_model(sr.InflatableArm(link_model="two_hinges"))
    path = sr.follow_contact(
        model, (0, 0, 0), (0, 0, -10), environment=peg(-0.1), parameters=np.linspace(0.3, 0.9, 13), friction=0.3
    )
    assert all(one.status == "slips" for found in path.equilibria[1:] for one in found.contacts)
    check_balance(path, np.array([0.0, 0.0, -10.0]))
