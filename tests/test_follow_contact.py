"""Robots followed in contact with friction, against balances by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from tests.support.laws import law
from tests.support.planar_robots import block, ladder

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
