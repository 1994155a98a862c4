"""Contacts that pass from link to link in small steps, and obstacles that a step must not jump over."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.statics.contact import quasi_static
from tests.support.planar_robots import joint, robot

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


def bar(kind: str, radius: float) -> sr.Environment:
    """A bar along y, 0.4 m under the base and before the end of the arm."""
    place, corner = (0.95, 0.0, -0.4), np.array([radius, 1.5, radius])
    corners = corner * [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    made = {
        "capsule": lambda: sr.Capsule(radius, 3.0, place, ACROSS),
        "cylinder": lambda: sr.Cylinder(radius, 3.0, place, ACROSS),
        "box": lambda: sr.Box(2.0 * corner, place),
        "mesh": lambda: sr.Mesh(corners, place),
    }
    return sr.Environment([made[kind]()])


@pytest.mark.study
@pytest.mark.parametrize(
    ("kind", "radius", "rows"),
    [
        *(("capsule", radius, rows) for radius, rows in ((0.1, 2), (0.1, 5), (0.03, 2), (0.03, 3), (0.03, 7))),
        *((kind, 0.03, 2) for kind in ("cylinder", "box", "mesh")),
    ],
)
def test_an_arm_swings_onto_a_bar_at_the_angle_of_the_straight_one(
    arm: sr.SoftModel, kind: str, radius: float, rows: int
) -> None:
    """However few rows: it touches where its line is both radii from the axis of the bar, and stays above it.

    Contact is made within the last 1/128 of a row, and at the edge of a box as on a bar that is less than sqrt(2) thicker.
    """
    motors = np.linspace(0.3, -0.7, rows)
    path = sr.follow_contact(arm, np.outer(motors, (0, 1, 0)), environment=bar(kind, radius))
    distance, below = np.hypot(0.95, 0.4), np.arctan2(-0.4, 0.95)
    touches = [
        below + np.arcsin((0.055 + thick * radius) / distance)
        for thick in (1.0, np.sqrt(2.0) if kind in ("box", "mesh") else 1.0)
    ]
    (made,) = path.events
    turned = np.interp(made.parameter, np.arange(rows), motors)
    assert touches[0] - 1.0 / (rows - 1) / 128 <= turned <= touches[1]
    assert made.kind == "made"
    assert not path.jumps
    (contact,) = path.contacts[-1]
    assert contact.normal[2] > 0.5
    check_balance(path, np.zeros(3))
    twice = sr.follow_contact(arm, np.outer(np.linspace(0.3, -0.7, 11), (0, 1, 0)), environment=bar(kind, radius))
    assert path.equilibria[-1].q_springs == pytest.approx(twice.equilibria[-1].q_springs, abs=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("radius", [0.1, 0.03])
def test_a_ball_is_driven_against_an_arm_that_snaps_past_it_in_any_number_of_rows(arm: sr.SoftModel, radius: float) -> None:
    """Above the arm by 0.4575 m it touches when it has gone that far less both radii; where it snaps is the same, too."""
    ball = sr.Environment([sr.Sphere(radius, (0.8, 0, 0.4575), pose=lambda s: moved(z=-s))])
    snaps = []
    for rows in (2, 7):
        path = sr.follow_contact(arm, (0, 0, 0), environment=ball, parameters=np.linspace(0, 1.2, rows))
        made, lost = path.events
        assert (made.kind, lost.kind) == ("made", "lost")
        assert 0.0 <= made.parameter - (0.4575 - radius - 0.055) <= 1.2 / (rows - 1) / 128
        (snap,) = path.jumps
        snaps.append(snap.parameter)
        assert path.tip_positions[-1, 2] == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(snaps) < 1e-4  # the smallest step, 1.2 / 2^14


@pytest.mark.study
@pytest.mark.parametrize(
    ("pose", "told"),
    [
        (lambda s: moved(x=0.0 if s < 0.5 else -0.8), "'cart' and 'ball' move by 0.8 m against each other at once"),
        (lambda s: moved(x=-s), "'cart' is at 'ball': move robot or obstacle less far"),
    ],
)
def test_what_cannot_be_followed_is_named(pose: Any, told: str) -> None:
    """A ball that is elsewhere at once, and one that is driven into a cart that no spring moves."""
    joints = [joint("push", "prismatic", "base", "cart", "1 0 0"), joint("along", "prismatic", "cart", "tip", "1 0 0", 100.0)]
    model = robot(("base", "cart", "tip"), joints, [("cart", "0 0 1", "0 0 1", 0.1), ("tip", "0 0 2", "0 0 2", 0.1)])
    ball = sr.Environment([sr.Sphere(0.1, (0.5, 0, 1), name="ball", pose=pose)])
    with pytest.raises(sr.EquilibriumNotFound, match=f"between rows 1 and 2, at parameter .*{told}"):
        sr.follow_contact(model, [0.0], environment=ball, parameters=[-0.1, 0.0, 1.0])


STONE = """20 29 245, -52 9 218, 18 20 216, -58 24 210, -27 9 252, -13 51 189, -37 70 213, -1 44 242, -20 45 263, 10 32 185,
-26 -20 149, -28 -28 228, -44 -12 193, 0 13 290, 20 -32 211"""


@pytest.mark.study
def test_a_thin_tube_slips_off_a_stone_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its sections hardly stretch: a bend that is far was none beside the mean of all springs.

    Motion off an unstable place then went to and fro, in thousands of steps. It ends free: where the free tube is.
    """
    settle, asked = quasi_static.settle, list[float]()

    def counted(*args: Any, **options: Any) -> Any:
        asked.append(0.0)
        return settle(*args, **options)

    monkeypatch.setattr(quasi_static, "settle", counted)
    tube = sr.load_model(sr.HelixTube(length=0.4, contraction=0.99, angle=0.0, elastic_sections=4, bending_stiffness=0.02))
    corners = np.array(STONE.replace(",", " ").split(), dtype=float).reshape(-1, 3)
    stone = sr.Environment([sr.Mesh(corners, scale=1e-3, hull=True)])
    forces = np.array([[-0.37, -0.02, -0.09], [-0.35, 0.11, -0.02]])
    path = sr.follow_contact(tube, (), forces, environment=stone)
    assert len(asked) < 600  # 294
    assert [one.kind for one in path.events][-1] == "lost"
    free = sr.solve_equilibrium(tube, (), forces[-1], q_springs0=path.equilibria[-1].q_springs)
    assert path.tip_positions[-1] == pytest.approx(free.tip_position, abs=1e-8)


@pytest.mark.study
def test_a_link_that_swings_against_another_one_stays_on_its_side_in_any_number_of_rows() -> None:
    """The third link of a folded arm would swing through the first; they touch at the angle of rigid links.

    Pressed on, it gives way to one side of its plane or, as rounding decides, to the other: every second spring turns the other
    way in the mirror image.
    """
    model = sr.load_model(
        sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3), hinge_offset=0.03, radius=0.03, stiffness=100.0, pressure=50e3)
    )
    joint = 0.4 * np.sin(2.5)  # height of the last joint above the first link, along which the motors lie
    touches = -2.5 - np.arcsin((joint - 0.06) / 0.3)  # the tip is then two radii above it
    folded = sr.Environment([], self_contact=True)
    ends = []
    for rows in (2, 3):
        motors = np.linspace(-2.5, -3.6, rows)
        path = sr.follow_contact(model, np.array([(0, 0, 2.5, one) for one in motors]), environment=folded)
        (made,) = path.events
        assert -1.1 / (rows - 1) / 128 <= np.interp(made.parameter, np.arange(rows), motors) - touches <= 0.0
        springs = path.equilibria[-1].q_springs
        ends.append(springs * np.tile([np.sign(springs[2]), 1.0], 3))
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
