"""Robots followed in contact with friction, against balances by hand."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.environment.standing import standing_among
from softrobots.model.friction_coordinates import grip_of, memory_of
from softrobots.statics.contact.last_state import Given, Sliding
from softrobots.statics.contact.quasi_static import settle
from softrobots.statics.loads import Load
from tests.support.laws import law
from tests.support.planar_robots import block, ladder, rail, rope

FLOOR = sr.Environment([sr.HalfSpace((0, 0, 1))])


@law("follow_contact", "ContactPath")
@settings(max_examples=8)
@given(
    stiffness=st.floats(20.0, 500.0),
    friction=st.floats(0.05, 1.5),
    weight=st.floats(0.5, 30.0),
    motors=st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=4),
)
def test_a_pushed_block_is_where_the_slider_is(stiffness: float, friction: float, weight: float, motors: list[float]) -> None:
    """A spring and a slider in series, along any way of the motor."""
    down, largest = np.array([0.0, 0.0, -weight]), friction * weight / stiffness
    path = sr.follow_contact(
        block(stiffness), np.array([[0.0], *([one] for one in motors)]), down, environment=FLOOR, friction=friction
    )
    assert isinstance(path, sr.ContactPath)
    place = dissipated = 0.0
    for motor, tip, work, found in zip(
        motors, path.tip_positions[1:, 0], path.dissipation[1:], path.equilibria[1:], strict=True
    ):
        moved = np.clip(place, motor - largest, motor + largest)
        dissipated += friction * weight * abs(moved - place)
        place = moved
        assert tip == pytest.approx(place, abs=1e-10)
        assert work == pytest.approx(
            dissipated, abs=1e-9 + 0.01 * largest * friction * weight
        )  # slip begins within a small step
        assert found.stable
        assert found.converged


def test_a_block_sticks_and_slips_as_a_spring_and_a_slider_in_series() -> None:
    """Sticks until the spring reaches mu N, then slips at mu N; a cycle dissipates 4 mu N (A - mu N / k)."""
    stiffness, weight, friction, amplitude = 100.0, 10.0, 0.3, 0.1
    turns = np.concatenate([np.linspace(0, amplitude, 6), np.linspace(amplitude, -amplitude, 11)[1:]])
    pushed = np.concatenate([turns, np.linspace(-amplitude, amplitude, 11)[1:]])
    down = np.array([0.0, 0.0, -weight])
    loaded = sr.follow_contact(block(stiffness), [0.0], [(0, 0, 0), down], environment=FLOOR, friction=friction)
    path = sr.follow_contact(
        block(stiffness), pushed[:, None], down, environment=FLOOR, friction=friction, start=loaded.equilibria[-1]
    )
    place, expected = 0.0, []  # the slider: it follows where the spring would pull more than mu N
    for motor in pushed:
        place = np.clip(place, motor - friction * weight / stiffness, motor + friction * weight / stiffness)
        expected.append(place)
    rounding = 1e-11  # of positions, 1e-12 m of a reach of 0.1 m in each of some 100 steps
    assert path.tip_positions[:, 0] == pytest.approx(np.array(expected), abs=rounding)
    assert path.forces[:, 0] == pytest.approx(stiffness * (np.array(expected) - pushed), abs=1e-9)
    cycle = path.dissipation[-1] - path.dissipation[5]
    assert cycle == pytest.approx(4 * friction * weight * (amplitude - friction * weight / stiffness), rel=1e-9)
    # work of the motor (its load is linear between rows, except where slip begins: those rows are given) = energy + friction
    torques, ways = np.array([e.motor_torques[0] for e in path.equilibria]), np.diff(pushed)
    work = -np.sum(0.5 * (torques[1:] + torques[:-1]) * ways)
    energy = [0.5 * e.q_springs @ (e.model.stiffness * e.q_springs) - down @ e.tip_position for e in path.equilibria]
    begins = 0.5 * friction * weight * np.abs(ways[0])  # half a row in the mean between stick and slip, known by hand
    assert work == pytest.approx(energy[-1] - energy[0] + path.dissipation[-1], abs=3 * begins)
    assert {event.kind for event in path.events} == {"sticks", "slips"}
    assert not path.jumps
    assert path.contacts[-1][0].status == "slips"


def test_a_ladder_on_two_walls_slips_at_the_pull_of_the_closed_form() -> None:
    """Both cones reached: N2 = W c / (2 (s + mu c)) at the wall, N1 = W - mu N2 at the floor, pull P = mu N1 - N2."""
    length, angle, weight, friction, radius = 2.0, np.radians(65.0), 10.0, 0.25, 1e-5
    model = ladder(length, angle, radius, 100.0)  # springs at rest: they carry nothing until it slips
    s, c = np.sin(angle), np.cos(angle)
    wall = sr.HalfSpace((-1, 0, 0), -(length * c + radius), name="wall")
    room = sr.Environment([sr.HalfSpace((0, 0, 1), name="floor"), wall])
    on_wall = weight * c / (2 * (s + friction * c))
    limit = friction * (weight - friction * on_wall) - on_wall
    assert limit > 0.0  # it stands by itself
    pulls = np.array([0.0, 0.999, 1.0, 1.002]) * limit
    wrenches = {"middle": (0, 0, -weight, 0, 0, 0), "foot": np.outer(pulls, (-1, 0, 0, 0, 0, 0))}
    path = sr.follow_contact(model, [], wrench=wrenches, environment=room, friction=friction)
    for pull, found in zip(pulls[:2], path.equilibria, strict=False):
        assert np.abs(found.q_springs).max() < 1e-9  # the ladder stands
        floor, side = (next(one for one in found.contacts if one.obstacle == name) for name in ("floor", "wall"))
        assert floor.force + side.force == pytest.approx([pull, 0, weight], abs=1e-6)
        turning = np.cross(side.point, side.force) + np.cross(floor.point, floor.force)  # about the origin
        turning += np.cross((0.5 * length * c, 0, radius + 0.5 * length * s), (0, 0, -weight))
        assert turning + np.cross((0, 0, radius), (-pull, 0, 0)) == pytest.approx(np.zeros(3), abs=1e-6)
        for one in (floor, side):
            assert np.linalg.norm(one.force - one.normal_force * one.normal) <= friction * one.normal_force * (1 + 1e-9)
    assert [one.status for one in path.contacts[3]] == ["slips", "slips"]
    first = min(event.parameter for event in path.events if event.kind == "slips")
    assert first == pytest.approx(2.0, abs=0.05)  # radius over length, 1e-5, of a pull that changes by 1e-3, and the last step


@pytest.mark.study
def test_what_friction_wedges_against_the_floor_springs_off_it() -> None:
    """A ball on an inclined rail with mu > tan(angle): past the cone no sliding opposes its friction, only free space is left.

    With the compliance W of the springs that is W_zz < mu W_xz: friction that acts down the rail closes the gap by more than
    the normal force opens it.
    """
    angle, friction, pushed = 0.3, 0.6, 0.1
    ways = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    stiffness = ways.T @ np.diag([50.0, 5000.0]) @ ways  # of the tip along x and z
    compliance = np.linalg.inv(stiffness)
    assert compliance[1, 1] < friction * compliance[0, 1]
    limit = (stiffness[0, 1] + stiffness[0, 0] / friction) * -pushed  # pull along z at which it leaves the cone
    assert limit > 0.0  # it is held down by friction alone
    pulls = np.array([-10.0, -10.0, 0.9 * limit, 1.1 * limit])
    path = sr.follow_contact(
        rail(angle, 50.0, 5000.0),
        [[0.0], [pushed], [pushed], [pushed]],
        np.outer(pulls, (0, 0, 1)),
        environment=FLOOR,
        friction=friction,
    )
    assert [[one.status for one in row] for row in path.contacts] == [["sticks"], ["sticks"], ["sticks"], []]
    (jump,) = path.jumps
    assert jump.parameter == pytest.approx(2.5, abs=2.0**-13)
    free = compliance @ (0.0, limit) + (pushed, 0.1)
    assert jump.after.tip_position[[0, 2]] == pytest.approx(
        free, rel=1e-4
    )  # of the last step, 2^-14 of a row that changes the pull by a fifth
    away = free - (0.0, 0.1)
    assert jump.energy_lost == pytest.approx(0.5 * away @ stiffness @ away, rel=1e-3)


@pytest.mark.study
@settings(max_examples=4)
@given(angle=st.floats(-0.2, 0.2), ways=st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=4))
def test_a_floor_that_moves_is_a_base_that_moves_back(angle: float, ways: list[float]) -> None:
    """Objectivity: contact forces, springs and work of friction only know the motion of robot and floor to each other."""
    model, places, down = rail(angle, 50.0, 500.0), np.array([0.0, *ways]), (0, 0, -10.0)
    still = sr.Environment([sr.Box((9, 9, 1), position=(0, 0, -0.5))])

    def sideways(parameter: float) -> np.ndarray:
        pose = np.eye(4)
        pose[0, 3] = -np.interp(parameter, np.arange(len(places)), places)
        return pose

    carried = sr.Environment([sr.Box((9, 9, 1), position=(0, 0, -0.5), pose=sideways)])
    pushed = sr.follow_contact(model, places[:, None], down, environment=still, friction=0.4)
    moved = sr.follow_contact(model, [0.0], down, environment=carried, friction=0.4, parameters=np.arange(len(places)))
    for one, other in zip(pushed.equilibria, moved.equilibria, strict=True):
        assert one.q_springs == pytest.approx(other.q_springs, abs=1e-9)
        assert [contact.status for contact in one.contacts] == [contact.status for contact in other.contacts]
        for here, there in zip(one.contacts, other.contacts, strict=True):
            assert here.force == pytest.approx(there.force, abs=1e-6)
    assert pushed.dissipation == pytest.approx(moved.dissipation, abs=1e-9)
    assert pushed.dissipation[-1] >= 0.0


@pytest.mark.study
def test_finer_steps_converge(arm: sr.SoftModel) -> None:
    """Friction is implicit in time: of first order in the step where the direction of sliding turns."""
    floor = sr.Environment([sr.HalfSpace((0, 0, 1), -0.1)])

    def end(steps: int) -> np.ndarray:
        angle = np.linspace(0.0, np.pi, steps + 1)
        motors = np.column_stack([0.15 * np.sin(angle), 0.1 - 0.1 * np.cos(angle), np.full_like(angle, -0.5)])
        path = sr.follow_contact(arm, motors, (0, 0, -15), environment=floor, friction=0.3)
        assert path.contacts[-1][0].status == "slips"
        return path.equilibria[-1].q_springs

    ends = [end(steps) for steps in (12, 24, 48, 96)]
    changes = [np.abs(finer - coarser).max() for coarser, finer in pairwise(ends)]
    assert changes[0] > 1e-6
    assert changes[1] < 0.65 * changes[0]
    assert changes[2] < 0.65 * changes[1]


@pytest.mark.study
def test_a_rope_around_a_cylinder_pulls_as_the_capstan() -> None:
    """T2 / T1 -> exp(mu phi) between vertices that slip, with an error of second order in the angle of a link.

    Forces of the rope at its vertices follow from the contacts beyond; their directions enclose phi.
    """
    friction, radius, thickness, wrapped = 0.3, 0.1, 1e-4, 0.5 * np.pi
    errors = []
    for links in (5, 10):
        model = rope(links, wrapped, radius, thickness, 1e-3, 5000.0)
        lying = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        drum = sr.Environment([sr.Cylinder(radius, 1.0, position=(0, 0, -radius - thickness), rotation=lying)])
        leaving = wrapped + 0.5 * wrapped / links
        pull = 2.0 * np.array([np.cos(leaving), 0.0, -np.sin(leaving)])
        path = sr.follow_contact(model, [], [(0, 0, 0), pull], environment=drum, friction=friction)
        slips = [one for one in path.contacts[-1] if one.status == "slips"]
        assert len(slips) >= links - 1
        forces = np.array([pull + sum((one.force for one in slips[first:]), np.zeros(3)) for first in range(1, len(slips))])
        start, end = forces[0], forces[-1]
        angle = np.arccos(start @ end / np.linalg.norm(start) / np.linalg.norm(end))
        errors.append(np.log(np.linalg.norm(end) / np.linalg.norm(start)) / (friction * angle) - 1.0)
    assert np.abs(errors[1]) < 0.01
    assert np.abs(errors[1]) < 0.4 * np.abs(errors[0])  # a quarter at second order


def test_little_friction_is_nearly_none(arm: sr.SoftModel) -> None:
    """With mu -> 0 the path ends in the certified equilibrium without friction, linearly in mu."""
    floor = sr.Environment([sr.HalfSpace((0, 0, 1), -0.1)])
    motors, forces = (0.3, -0.2, 0.3), np.outer((0.0, 0.5, 1.0), (0.0, 2.0, -20.0))
    still = sr.solve_equilibrium(arm, motors, forces[-1], environment=floor)

    def apart(friction: float) -> float:
        path = sr.follow_contact(arm, motors, forces, environment=floor, friction=friction)
        return float(np.abs(path.equilibria[-1].q_springs - still.q_springs).max())

    assert apart(0.0) < 1e-9  # of the tolerance of the residual
    assert apart(1e-5) == pytest.approx(0.01 * apart(1e-3), rel=0.02)


def lifted(parameter: float) -> np.ndarray:
    """A pose: down along z by the parameter."""
    pose = np.eye(4)
    pose[2, 3] = -parameter
    return pose


@pytest.mark.study
def test_an_arm_that_slips_off_a_ball_jumps_and_loses_the_energy_that_it_had(arm: sr.SoftModel) -> None:
    """A ball moves down through an arm; the arm snaps aside, and energy, work of the ball and loss balance."""
    motors = (0.0, 0.3, -0.3)
    tip = sr.solve_equilibrium(arm, motors).tip_position
    ball = sr.Environment([sr.Sphere(0.05, position=tip + (0.02, 0.0, 0.12), pose=lifted)])
    path = sr.follow_contact(arm, motors, environment=ball, parameters=np.linspace(0.0, 0.3, 16))
    (jump,) = path.jumps
    assert jump.energy_lost > 0.0
    assert jump.distance > 0.1
    assert {event.kind for event in path.events} == {"made", "lost"}
    assert not path.contacts[-1]
    assert np.abs(path.equilibria[-1].q_springs).max() < 1e-9  # back at rest: all the work of the ball is lost
    places, pushes = list(path.parameters), list(path.forces[:, 2])
    at = int(np.searchsorted(places, jump.parameter))
    places[at:at] = [jump.parameter, jump.parameter]
    pushes[at:at] = [sum(one.force[2] for one in found.contacts) for found in (jump.before, jump.after)]
    for event in path.events:  # without a force where the contact is made or lost
        at = int(np.searchsorted(places, event.parameter))
        places.insert(at, event.parameter)
        pushes.insert(at, 0.0)
    work = -np.trapezoid(pushes, places)
    assert work == pytest.approx(jump.energy_lost, rel=0.1)  # rows of 2 cm; work done and given back is ten times the loss
    stopped = sr.follow_contact(
        arm, motors, environment=ball, parameters=np.linspace(0.0, 0.3, 4), allow_jumps=False, progress="ball"
    )
    assert "leaves its equilibrium" in stopped.ended
    assert len(stopped.equilibria) == 2
    assert not stopped.jumps


def test_an_obstacle_that_moves_drags_what_sticks(arm: sr.SoftModel) -> None:
    """A floor that moves sideways under a pressed arm takes its surface along until mu N, then holds it back by mu N."""

    def sideways(parameter: float) -> np.ndarray:
        pose = np.eye(4)
        pose[1, 3] = parameter
        return pose

    slab = sr.Environment([sr.Box((4, 4, 0.2), position=(2.2, 0, -0.15), pose=sideways)])
    path = sr.follow_contact(
        arm, (0.0, 0.0, 0.0), (0, 0, -10.0), environment=slab, friction=0.4, parameters=np.linspace(0.0, 0.1, 6)
    )
    for parameter, row in zip(path.parameters, path.contacts, strict=True):
        sideways_force = sum(one.force[1] for one in row)
        limit = 0.4 * sum(one.normal_force for one in row)
        assert abs(sideways_force) <= limit * (1 + 1e-9)
        if all(one.status == "sticks" for one in row) and parameter > 0.0:
            assert path.tip_positions[round(parameter / 0.02), 1] > 0.9 * parameter
    assert path.dissipation[-1] > 0.0
    assert np.all(np.diff(path.dissipation) >= 0.0)


@pytest.mark.study
def test_a_tube_grows_past_an_obstacle() -> None:
    """Growth carries the shape along: without forces the tube keeps its strains, and beside a ball it leans on it."""
    tube = sr.HelixTube(length=0.4, contraction=0.99, angle=0.0, elastic_sections=4, bending_stiffness=0.02)

    def grown(length: float) -> sr.SoftModel:
        return sr.load_model(tube.grown(length))

    middle = sr.solve_equilibrium(grown(0.48), []).tip_position
    ball = sr.Environment([sr.Sphere(0.03, position=middle + (0.0, 0.035, 0.03))])
    lengths = np.array([0.4, 0.5])
    path = sr.follow_contact(grown, [], environment=ball, friction=0.2, parameters=lengths)
    assert [len(one.q_springs) for one in path.equilibria] == [16, 20]
    free = [sr.solve_equilibrium(grown(length), []) for length in lengths]
    assert path.tip_positions[0] == pytest.approx(free[0].tip_position, abs=1e-12)
    (contact, *_) = path.contacts[1]
    assert contact.normal_force > 0.0
    assert (path.tip_positions[1] - free[1].tip_position) @ contact.normal > 1e-4  # pushed aside
    assert any(event.kind == "made" for event in path.events)


@pytest.mark.study
def test_a_tube_that_grows_while_it_presses_keeps_its_forces() -> None:
    """Sections of the longer tube have other ends: forces go over to them, or every step would have to find them anew.

    Then steps were halved without end as the force rose: they are counted by the lengths that are asked.
    """
    tube, asked = sr.HelixTube(length=0.5, elastic_sections=10), list[float]()

    def grown(length: float) -> sr.SoftModel:
        asked.append(length)
        return sr.load_model(tube.grown(length))

    middle = sr.solve_equilibrium(grown(0.56), []).tip_position
    ball = sr.Environment([sr.Sphere(0.02, position=middle + (0.0, 0.0, 0.04))])
    start = sr.solve_equilibrium(grown(0.605), [], environment=ball)
    path = sr.follow_contact(grown, [], environment=ball, friction=0.3, parameters=[0.605, 0.615, 0.62], start=start)
    assert not path.jumps
    assert len(asked) < 60  # 21
    assert np.all(np.diff(path.dissipation) >= 0.0)
    for state in path.equilibria:
        (contact,) = (one for one in state.contacts if one.strict)
        assert abs(contact.gap) < 1e-9 * state.model.reach
        across = contact.force - contact.normal_force * contact.normal
        assert np.linalg.norm(across) <= 0.3 * contact.normal_force * (1 + 1e-8)  # CONE of the solver, and rounding
        assert state.residual <= state.tolerance


def test_a_path_is_saved_and_loaded_with_its_friction(tmp_path: Path) -> None:
    path = sr.follow_contact(block(), [[0.0], [0.1], [0.05]], (0, 0, -10.0), environment=FLOOR, friction=0.3)
    for suffix in ("npz", "json"):
        read = sr.load_result(sr.save_result(path, tmp_path / f"path.{suffix}"))
        assert read.summary() == path.summary()
        assert len(repr(read)) < 120
        assert repr(read.contacts[0][0]) == repr(path.contacts[0][0])
        assert read.forces == pytest.approx(path.forces, abs=1e-12)
        assert [[one.status for one in row] for row in read.contacts] == [["sticks"], ["slips"], ["sticks"]]
    lines = sr.save_csv(path, tmp_path / "path.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("parameter,dissipation_J,tip_x_m")
    with pytest.raises(sr.ParameterError, match="a ContactPath is saved with its friction"):
        sr.save_result(path.equilibria[-1], tmp_path / "one.npz")


def test_an_elbow_that_two_springs_cannot_keep_in_place_is_turned_on_a_table(arm: sr.SoftModel) -> None:
    """Three conditions of sticking on two springs: the elbow follows the motor once friction gives way, mu N against it."""
    table = sr.Environment([sr.HalfSpace((0, 0, 1), -0.1)])
    motors = np.column_stack([np.linspace(0.0, 0.2, 9), np.full(9, -0.1), np.full(9, 0.15)])
    path = sr.follow_contact(arm, motors, (0, 0, -15), environment=table, friction=0.4)
    (elbow,) = path.contacts[-1]
    assert elbow.status == "slips"
    assert abs(elbow.gap) < 1e-9
    across = elbow.force - elbow.normal_force * elbow.normal
    assert np.linalg.norm(across) == pytest.approx(0.4 * elbow.normal_force, rel=1e-9)
    assert across[1] < 0.0  # it is dragged along +y
    assert all(found.residual <= found.tolerance for found in path.equilibria)


def test_contact_under_a_moment_fixed_in_the_world_is_balanced(arm: sr.SoftModel) -> None:
    """Such a load has no energy: torques of springs, load and contact are reckoned here from Pinocchio's Jacobian."""
    wrench, motors = np.array([0.0, 0.0, -20.0, 3.0, 2.0, -4.0]), (0.3, 0.2, -0.5)
    path = sr.follow_contact(arm, motors, wrench=wrench, environment=sr.Environment([sr.HalfSpace((0, 0, 1), -0.1)]))
    found = path.equilibria[-1]
    (contact,) = found.contacts
    assert not found.conservative
    assert contact.normal_force > 1.0
    robot, data = arm.pinocchio, arm.pinocchio.createData()
    jacobian = pin.computeFrameJacobian(robot, data, found.q, arm.frame_id(arm.tip), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    lever = contact.point - found.tip_position  # the contact is on the link that carries the tip
    assert contact.link == "link_2"
    pressed = np.concatenate([contact.force, np.cross(lever, contact.force)])
    torque = (jacobian.T @ (wrench + pressed))[arm.structure.spring_indices]
    assert found.spring_torques == pytest.approx(torque, abs=1e-8)


REFUSED = {
    "rows": (lambda: sr.follow_contact(block(), [[0.0], [1.0]], np.zeros((3, 3)), environment=FLOOR), "one row, or 3"),
    "environment": (lambda: sr.follow_contact(block(), [0.0], environment=None), "an Environment"),
    "friction": (lambda: sr.follow_contact(block(), [0.0], environment=FLOOR, friction=-0.1), "friction"),
    "parameters": (lambda: sr.follow_contact(block(), [0.0], environment=FLOOR, parameters=[1, 0]), "increasing"),
    "grown": (lambda: sr.follow_contact(lambda length: block(), [0.0], environment=FLOOR), "a function of them"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_says_why(case: str) -> None:
    call, words = REFUSED[case]
    with pytest.raises(sr.ParameterError, match=words):
        call()


@pytest.mark.study
def test_a_contact_that_sticks_only_in_small_steps_holds_nothing_up(arm: sr.SoftModel) -> None:
    """A tip is pulled down a wall into a second one: a large step tells another status than the small one that ends there."""
    corner = sr.Environment([sr.HalfSpace((-1, 0, 0), -1.0), sr.HalfSpace((0, -1, 0), -0.1)])
    pulls = np.outer(np.linspace(0.0, 1.0, 8), (0.0, 2.0, -30.0))
    path = sr.follow_contact(arm, (0.1, 0.9, -0.4), pulls, environment=corner, friction=2.0)
    assert len(path.equilibria) == len(pulls)
    assert [contact.status for contact in path.equilibria[-1].contacts] == ["sticks", "sticks"]


@pytest.mark.study
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_bar_with_dry_friction_of_its_own_remembers_both(friction: float) -> None:
    """A ball bends a bar of one section and goes back: the ball's work is what the bar stores and what both frictions take.

    Dry friction takes its moment times the bending, whichever way; let go, the bar stays where its spring carries that moment.
    """
    stiffness, moment = 2e-3 / 0.06, 4e-3
    model = sr.load_model(
        sr.TendonArm(
            segment_lengths=(0.06,),
            tendon_azimuths=(),
            bending_stiffness=2e-3,
            elastic_sections=1,
            bending_friction=moment,
        )
    )

    def pose(parameter: float) -> np.ndarray:
        there = np.eye(4)
        there[0, 3] = 0.012 * (1.0 - abs(1.0 - parameter))  # and back
        return there

    ball = sr.Environment([sr.Sphere(0.01, position=(-0.0175, 0.0, 0.05), pose=pose, name="ball")])
    parameters = np.linspace(0.0, 2.0, 41)
    path = sr.follow_contact(model, [], environment=ball, friction=friction, parameters=parameters)
    angle = np.array([row.q_springs[1] for row in path.equilibria])
    pushed = np.array([sum((one.force[0] for one in row.contacts), 0.0) for row in path.equilibria])
    first = int(np.flatnonzero(pushed)[0])
    for begin, end, way in ((first, 20, 1.0), (22, int(np.flatnonzero(pushed)[-1]), -1.0)):  # it turns round in between
        rows = slice(begin, end + 1)
        work = float(np.trapezoid(pushed[rows], [pose(one)[0, 3] for one in parameters[rows].tolist()]))
        stored = 0.5 * stiffness * (angle[end] ** 2 - angle[begin] ** 2)
        taken = way * moment * (angle[end] - angle[begin]) + path.dissipation[end] - path.dissipation[begin]
        # Trapezoids between rows; the slight shortening of the bar stores next to nothing.
        assert work == pytest.approx(stored + taken, abs=2e-3 * stiffness * angle.max() ** 2)
    assert angle[-1] == pytest.approx(moment / stiffness, abs=1e-6)
    if friction == 0.0:
        last = None
        for row, parameter in zip(path.equilibria, parameters.tolist(), strict=True):
            last = sr.solve_equilibrium(model, [], environment=ball.at(parameter), previous=last)
            assert row.q_springs == pytest.approx(last.q_springs, abs=1e-9)
    again = sr.follow_contact(
        model, [], environment=ball, friction=friction, parameters=parameters[:5], start=path.equilibria[0]
    )
    assert again.equilibria[-1].q_springs == pytest.approx(path.equilibria[4].q_springs, abs=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_an_arm_with_friction_in_guides_leans_on_a_wall_and_comes_back(friction: float) -> None:
    """The friction of every guide is the capstan's at the tensions found; without that of the wall it is a row of equilibria.

    That of the wall stays within its cone. At the same tensions the wall is pressed more on the way back.
    """
    arm = sr.TendonArm(
        segment_lengths=(0.06, 0.0625), kind="tension", elastic_sections=2, bending_friction=3e-4, guide_friction=0.2
    )
    model, wall = sr.load_model(arm), sr.Environment([sr.HalfSpace((-1, 0, 0), offset=-0.03, name="wall")])
    pulls = np.array([[one, 0.5, 0.5, 0.5 * one, 0.3, 0.3] for one in (1.0, 2.5, 4.0, 2.5)])
    path = sr.follow_contact(model, pulls, environment=wall, friction=friction)
    assert not path.jumps
    for found in path.equilibria:
        assert found.stable
        assert found.converged
        memory = memory_of(found.model)
        strains = model.structure.strains(found.q_motors, found.q_springs)
        grip = model.structure.friction.grip(strains, found.muscle_forces, memory)
        assert grip_of(found.model) == pytest.approx(grip, abs=1e-9)
        assert all(one.cone_share <= 1.0 + 1e-6 for one in found.contacts)
    pressed = [sum(one.normal_force for one in found.contacts) for found in path.equilibria]
    if friction == 0.0:
        last, ways = path.equilibria[0], np.linspace(0.0, 1.0, 17)[1:, None]
        for before, after, found in zip(pulls, pulls[1:], path.equilibria[1:], strict=False):
            for row in before + ways * (after - before):
                last = sr.solve_equilibrium(model, row, environment=wall, previous=last)
            # Steps of other lengths: 1e-4 of the reach
            assert found.tip_position == pytest.approx(last.tip_position, abs=1e-4 * model.reach)
    assert pressed[3] > pressed[1] > 0.0


@settings(max_examples=20)
@given(side=st.floats(-0.9, 0.9), start=st.floats(0.01, 0.5), sign=st.sampled_from([-1.0, 1.0]))
def test_a_bar_that_sticks_is_found_from_slips_of_either_sign(side: float, start: float, sign: float) -> None:
    """Under a load that friction holds Newton's steps end at the stick, from which the next one is exact but for curvature.

    Without that end they go to and fro between slips of either sign for ever.
    """
    moment = 4e-3
    bar = sr.TendonArm(
        segment_lengths=(0.06,), tendon_azimuths=(), bending_stiffness=2e-3, elastic_sections=1, bending_friction=moment
    )
    model, nothing = sr.load_model(bar), sr.Environment([])
    load = Load.of(model, (2.0 * side * moment / 0.06, 0.0, 0.0))  # an arc moves its tip by half the turn times its length
    given_there = Given(model, np.zeros(0), load, nothing, standing_among(model, nothing))
    gaps = given_there.surroundings.at(model.embed(model.coordinates.at(np.zeros(0), model.rest).joints), 0.01)
    rest = settle(given_there, Sliding(0.0, gaps), model.rest + sign * start * np.eye(model.n_springs)[1], patient=False)
    assert rest is not None
    stuck = side * moment / (moment / 1e-4 + 2e-3 / 0.06)  # the spring of the stick beside that of the section
    assert rest.q_springs[1] == pytest.approx(stuck, rel=1e-3)  # a turn of 1e-4 rad moves the tip by its square
    assert rest.iterations <= 6
