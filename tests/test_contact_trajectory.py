"""Motors for a tip that moves in contact with friction, against balances by hand and the robot that they drive."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.statics.contact import contact_walk
from tests.support.laws import law
from tests.support.planar_robots import block

FLOOR = sr.Environment([sr.HalfSpace((0, 0, 1))])
WALL = sr.Environment([sr.HalfSpace((-1, 0, 0), offset=-1.0, name="wall")])
WEIGHT = np.array([0.0, 0.0, -20.0])


@pytest.mark.study
@law("follow_trajectory")
@settings(max_examples=6)
@given(
    stiffness=st.floats(20.0, 500.0),
    friction=st.floats(0.05, 1.5),
    weight=st.floats(0.5, 30.0),
    places=st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=4),
)
def test_a_dragged_block_is_pulled_by_a_spring_and_a_slider(
    stiffness: float, friction: float, weight: float, places: list[float]
) -> None:
    """The spring carries mu N against the way of the block, which takes mu N times the way."""
    way = np.array([0.0, *places])
    height = 0.1
    path = sr.follow_trajectory(
        block(stiffness),
        np.column_stack([way, np.zeros_like(way), np.full_like(way, height)]),
        (0.0, 0.0, -weight),
        environment=FLOOR,
        friction=friction,
        tolerance=1e-12,
    )
    moves = np.diff(way)
    stretched = 0.0
    for at, moved, motors in zip(way[1:], moves, path.q_motors[1:, 0], strict=True):
        stretched = np.sign(moved) * friction * weight / stiffness if abs(moved) > 1e-9 else stretched
        assert motors == pytest.approx(at + stretched, abs=1e-8)
    assert path.contact_path is not None
    assert path.contact_path.dissipation[1:] == pytest.approx(friction * weight * np.cumsum(np.abs(moves)), abs=1e-8)


@pytest.fixture(scope="module")
def start(arm: sr.SoftModel) -> sr.Equilibrium:
    """The arm that leans on a wall."""
    return sr.solve_equilibrium(arm, (0, 0.9, -0.4), WEIGHT, environment=WALL)


def along_the_wall(start: sr.Equilibrium, heights: np.ndarray, friction: float) -> sr.Trajectory:
    """The tip slides up and down the wall."""
    targets = start.tip_position + heights[:, None] * (0.0, 0.0, 1.0)
    return sr.follow_trajectory(start.model, targets, WEIGHT, environment=WALL, friction=friction, q_motors0=start.q_motors)


@pytest.mark.study
def test_an_arm_is_dragged_down_and_up_a_wall(start: sr.Equilibrium, tmp_path: Path) -> None:
    """Work of load and motors becomes elastic energy and work of friction; the motors drive the robot along the same way."""
    heights = np.concatenate([np.linspace(0.0, 0.02, 5), np.linspace(0.02, 0.0, 5)[1:]])
    path = along_the_wall(start, heights, 0.1)
    assert path.tip_error.max() < 1e-9
    for found, way in zip(path.equilibria[1:], np.diff(heights), strict=True):
        (contact,) = found.contacts
        assert contact.status == "slips"
        assert contact.force[2] == pytest.approx(-0.1 * np.sign(way) * contact.normal_force, rel=1e-9)
        assert found.stable
        assert found.converged
    driven = sr.follow_contact(start.model, path.q_motors, WEIGHT, environment=WALL, friction=0.1, start=path.equilibria[0])
    assert driven.tip_positions == pytest.approx(path.tip_positions, abs=1e-9)  # in a plane it does not depend on the steps
    worked = path.contact_path
    assert worked is not None
    middle = len(heights) // 2  # from the first slip to the top, and from the slip back to the end: no change of direction

    def energy(found: sr.Equilibrium) -> float:
        return float(0.5 * found.q_springs @ (found.model.stiffness * found.q_springs) - WEIGHT @ found.tip_position)

    for first, last in ((1, middle), (middle + 1, len(heights) - 1)):
        torques, turns = path.motor_torques[first : last + 1], np.diff(path.q_motors[first : last + 1], axis=0)
        work = -float(np.sum(0.5 * (torques[1:] + torques[:-1]) * turns))
        stored = energy(path.equilibria[last]) - energy(path.equilibria[first])
        # the rule of the trapezoid between rows: a third of a step of 5 mm squared over the arm's length, and its curvature
        assert work == pytest.approx(stored + worked.dissipation[last] - worked.dissipation[first], rel=1e-3)
    sr.save_result(path, tmp_path / "dragged.npz")
    again = sr.load_result(tmp_path / "dragged.npz")
    assert isinstance(again, sr.Trajectory)
    assert again.contact_path is not None
    assert np.array_equal(again.q_motors, path.q_motors)
    assert np.array_equal(again.contact_path.dissipation, worked.dissipation)
    assert again.contact_path.events == worked.events
    assert [one.status for one in again.contact_path.contacts[-1]] == ["slips"]
    assert "work of friction" in str(again)


@pytest.mark.study
def test_little_friction_is_nearly_none(start: sr.Equilibrium) -> None:
    """With friction of 1e-9 the motors are those of the path without; beside it a row of steps drifts by their length."""
    targets = np.linspace(0.0, 0.01, 9)
    smooth, rough = (along_the_wall(start, targets, friction) for friction in (0.0, 1e-9))
    coarse = along_the_wall(start, targets[::4], 0.0)
    steps = np.abs(coarse.q_motors[-1] - smooth.q_motors[-1]).max()
    assert rough.q_motors[-1] == pytest.approx(smooth.q_motors[-1], abs=max(steps, 1e-6))
    assert rough.contact_path is not None
    assert rough.contact_path.dissipation[-1] < 1e-8


def test_what_sticks_is_a_pin(arm: sr.SoftModel) -> None:
    """With a friction coefficient of 50 a link that lies on a ball does not slide on it while the tip is lifted by 1 mm."""
    ball = sr.Environment([sr.Sphere(0.1, (0.4936, 0.0, -0.024))])
    held = sr.solve_equilibrium(arm, (0, 0.3, -0.6), WEIGHT, environment=ball)
    targets = held.tip_position + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]])
    path = sr.follow_trajectory(arm, targets, WEIGHT, environment=ball, friction=50.0, q_motors0=held.q_motors)
    assert path.contact_path is not None
    assert path.contact_path.dissipation[-1] == 0.0
    slips = [np.linalg.norm(one.slip) for row in path.contact_path.contacts for one in row]
    assert max(slips) < 1e-5  # a stiff link leaves a rest along its axis that no spring prevents; the tip moves by 1e-3
    assert path.tip_error.max() < 1e-9


@pytest.mark.study
def test_a_segment_with_dry_friction_is_dragged_over_a_ball_and_back() -> None:
    """Work of the muscles becomes elastic energy, work of the contact, and the moment of dry friction times the way of bending.

    Without friction of the contact the motors are those of the path that needs none of its memory. Motors found drive the robot
    along the same way by themselves: trials of the search leave no memory.
    """
    moment, length, mu = 0.5, 0.3, 0.3
    model = sr.load_model(sr.PccArm(segment_lengths=(length,), bending_friction=moment, elastic_sections=2))
    ball = sr.Environment([sr.Sphere(0.05, (0.095, 0.0, 0.16))])
    lean = sr.solve_equilibrium(model, (0.28, 0.31, 0.31), environment=ball)
    ways = np.concatenate([np.linspace(0.0, 0.01, 5), np.linspace(0.01, 0.0, 5)[1:]])
    targets = lean.tip_position + ways[:, None] * (0.5, 0.0, -1.0)
    smooth, little, path = (
        sr.follow_trajectory(model, targets, environment=ball, friction=one, q_motors0=lean.q_motors) for one in (0.0, 1e-9, mu)
    )
    assert little.q_motors == pytest.approx(smooth.q_motors, abs=1e-7)  # the balance of a step is good to 1e-10 of the load
    worked = path.contact_path
    assert worked is not None
    bodies = [model.structure.section_coordinates(found.q_motors, found.q_springs) for found in path.equilibria]
    stiffness = 2 / length * np.array([1.92, 1.92, 1.28, 2400.0])
    stored = 0.5 * np.sum(np.array(bodies) ** 2 * stiffness, axis=(1, 2))
    rubbed = moment * np.abs(np.diff(np.array(bodies)[:, :, 1], axis=0)).sum(axis=1)
    pulls = 0.5 * (path.motor_torques[1:] + path.motor_torques[:-1])
    given = -np.sum(pulls * np.diff(path.q_motors, axis=0), axis=1)
    for first, last in ((1, 4), (6, 8)):  # where the contact slips
        assert {one.status for row in path.equilibria[first : last + 1] for one in row.contacts} == {"slips"}
        taken = worked.dissipation[last] - worked.dissipation[first] + rubbed[first:last].sum()
        assert taken > 0.1 * abs(given[first:last].sum())
        # the rule of the trapezoid between rows: a fourth in four times as many, half of it with half the steps
        assert given[first:last].sum() == pytest.approx(stored[last] - stored[first] + taken, rel=1e-3)
    assert np.abs(path.q_motors[3] - path.q_motors[5]).max() > 1e-4  # the same tip, forth and back
    driven = sr.follow_contact(model, path.q_motors, environment=ball, friction=mu, start=path.equilibria[0])
    assert driven.tip_positions == pytest.approx(path.tip_positions, abs=1e-6)  # what slips turns a little with the steps


@pytest.mark.parametrize(("thick", "rows"), [(0.02, 2), (0.02, 3), (0.2, 2)])
def test_a_tip_stops_before_a_plate_in_any_number_of_rows(thick: float, rows: int) -> None:
    """A ball on a spring that nothing else touches: from 0 to 1 m there is a plate in the middle.

    It ends a radius of 0.1 m before that, less the smallest step, 2^-14 of a row.
    """
    way, plate = np.linspace(0.0, 1.0, rows), sr.Environment([sr.Box((thick, 1.0, 1.0), (0.5, 0.0, 0.5), name="plate")])
    targets = np.column_stack([way, np.zeros(rows), np.full(rows, 0.1)])
    with pytest.raises(sr.TargetUnreachable, match="'tip' is at 'plate'") as caught:
        sr.follow_trajectory(block(), targets, environment=plate, friction=0.3)
    left = 0.5 - 0.5 * thick - 0.1 - caught.value.best.tip_position[0]
    assert -1e-9 <= left <= 2.0**-14 / (rows - 1) + 1e-9


@pytest.mark.parametrize("rows", [2, 3])
def test_without_friction_no_tip_passes_through_a_plate_between_waypoints(rows: int) -> None:
    """The same ball; it goes on behind the plate where a jump is allowed, and over a plate that leaves room for its radius."""
    way = np.linspace(0.0, 1.0, rows + rows % 2)  # no waypoint in the plate
    targets = np.column_stack([way, np.zeros(len(way)), np.full(len(way), 0.1)])
    plate, low = (sr.Environment([sr.Box((0.02, 1.0, 1.0), (0.5, 0.0, z), name="plate")]) for z in (0.5, -0.501))
    with pytest.raises(sr.TargetUnreachable, match="no continuous motion"):
        sr.follow_trajectory(block(), targets, environment=plate)
    free = sr.follow_trajectory(block(), targets)
    for environment, jumps in ((plate, True), (low, False)):
        found = sr.follow_trajectory(block(), targets, environment=environment, allow_jumps=jumps)
        assert found.q_motors == pytest.approx(free.q_motors, abs=1e-9)


def test_friction_of_guides_is_refused_beside_that_of_contacts() -> None:
    model = sr.load_model(sr.PccArm(guide_friction=0.1))
    with pytest.raises(sr.ParameterError, match="without dry friction, for targets in contact with friction in guides"):
        sr.follow_trajectory(model, [(0.0, 0.0, 1.0)], environment=FLOOR, friction=0.1)


def test_what_friction_cannot_have_is_refused(arm: sr.SoftModel) -> None:
    for options in ({}, {"environment": WALL, "allow_jumps": True}):
        with pytest.raises(sr.ParameterError, match="friction"):
            sr.follow_trajectory(arm, [(0.9, 0.0, 0.7)], friction=0.3, **options)


@pytest.mark.study
def test_a_tip_that_jams_on_a_wall_is_let_press_less(start: sr.Equilibrium) -> None:
    """Any place of the wall has a solution, with less force if not with more; it is one of the free robot under that force."""
    friction = 1.0
    path = along_the_wall(start, np.linspace(0.0, 0.02, 5), friction)
    assert path.tip_error.max() < 1e-9
    for found in path.equilibria[1:]:
        for contact in found.contacts:
            along = contact.force - contact.normal_force * contact.normal
            assert np.linalg.norm(along) <= friction * contact.normal_force * (1.0 + 1e-6) + 1e-9
        free = sr.solve_equilibrium(found.model, found.q_motors, WEIGHT + sum(one.force for one in found.contacts))
        lever = 0.055 * sum(np.linalg.norm(one.force) for one in found.contacts)  # it acts on the tip's cap
        assert free.tip_position == pytest.approx(found.tip_position, abs=1e-9 + 0.01 * lever)


def test_an_interrupted_path_ends_where_it_was(start: sr.Equilibrium, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C at the third waypoint leaves the two before it."""
    rows = contact_walk.ContactWalk.rows

    def interrupted(walk: contact_walk.ContactWalk, first: Any, count: int) -> Iterator[Any]:
        yield from itertools.islice(rows(walk, first, count), 2)
        raise KeyboardInterrupt

    monkeypatch.setattr(contact_walk.ContactWalk, "rows", interrupted)
    path = along_the_wall(start, np.linspace(0.0, 0.02, 5), 0.1)
    assert len(path.equilibria) == len(path.times) == len(path.targets) == 2
    assert path.tip_error.max() < 1e-9
    assert path.contact_path is not None
    assert path.contact_path.ended == "interrupted"


def test_a_start_with_other_motors_is_refused(start: sr.Equilibrium) -> None:
    with pytest.raises(sr.ParameterError, match="the motors of the first row"):
        sr.follow_contact(start.model, [[0, 0.8, -0.4]] * 2, WEIGHT, environment=WALL, friction=0.1, start=start)


def test_a_start_under_another_load_is_refused(start: sr.Equilibrium) -> None:
    """Also one among other obstacles: the first row would be another equilibrium, with friction that nothing explains."""
    moved = sr.Environment([sr.HalfSpace((-1, 0, 0), offset=-1.01, name="wall")])
    for load, environment in (((0, 0, -25), WALL), (WEIGHT, moved)):
        with pytest.raises(sr.ParameterError, match="in balance under the load"):
            sr.follow_contact(start.model, start.q_motors, load, environment=environment, friction=0.1, start=start)
