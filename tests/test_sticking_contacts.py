"""Derivatives and modes of robots whose contacts stick: against steps of `follow_contact`, and beams that are pinned."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import HalfSpace, Sphere
from softrobots.statics.contact.held import held_stiffness

MOTORS, FORCE, FRICTION = np.array([0.3, 0.4, -0.3]), np.array([6.0, 1.0, -19.0]), 0.9
ARM = {"wall": HalfSpace((-1.0, 0.2, -0.1), -1.0), "sphere": Sphere(0.1, (1.03, 0.335, -0.045))}


def rod(hinges: int, **fields: Any) -> sr.SoftModel:
    """A rod of length 1, bending stiffness 1 and mass 1, in lumped sections, clamped and upright."""
    lumped = {"muscle_azimuths": (), "chain": "lumped", "torsion": False, "hinges": hinges}
    return sr.load_model(sr.PccArm(segment_lengths=(1.0,), bending_stiffness=1.0, linear_density=1.0, **lumped, **fields))


@cache
def stuck(name: str) -> tuple[sr.Equilibrium, dict[str, Any]]:
    """A robot whose contact sticks, with what `follow_contact` needs to go on from it."""
    if name == "rod":  # its round end rolls on the wall under a friction across the plane in which it bends
        model, motors, force = rod(8, extension=False, radius=0.02), np.zeros(0), np.array([1.0, 0.8, 0.3])
        options: dict[str, Any] = {"environment": Environment([HalfSpace((-1.0, 0.0, 0.0), -0.04)]), "friction": FRICTION}
        before = [1.0, 0.0, 0.0]
    else:
        model, motors, force, before = sr.load_model(sr.InflatableArm()), MOTORS, FORCE, [0.0, 0.0, 0.0]
        options = {"environment": Environment([ARM[name]]), "friction": FRICTION, "gravity": sr.EARTH_GRAVITY}
    found = sr.follow_contact(model, motors, [before, [*force]], **options).equilibria[-1]
    (contact,) = found.contacts
    normal = contact.force @ contact.normal
    assert (contact.status, contact.strict) == ("sticks", True)
    assert contact.cone_share == pytest.approx(np.linalg.norm(contact.force - normal * contact.normal) / (FRICTION * normal))
    assert 0.2 < contact.cone_share < 1.0
    return found, options


def change(name: str, motors: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Motion of the tip, then the normal force and the forces of the motors, after a step that adds motors and wrench."""
    found, options = stuck(name)
    start = found.q_motors, found.load.wrenches[found.model.tip]
    rows = {"wrench": [start[1], start[1] + wrench], "start": found}
    after = sr.follow_contact(found.model, [start[0], start[0] + motors], **rows, **options).equilibria[-1]
    assert after.contacts[0].status == "sticks"
    turn = pin.log3(after.tip_pose[:3, :3] @ found.tip_pose[:3, :3].T)
    return np.concatenate(
        [after.tip_position - found.tip_position, turn, [after.contacts[0].normal_force], after.motor_torques]
    )


@pytest.mark.study
@pytest.mark.parametrize("name", ["wall", "sphere", "rod"])
def test_compliance_and_contact_forces_are_those_of_steps_that_stick(name: str) -> None:
    """Central differences of 1e-4 N and N m; the residual of a step, 1e-10 of the load, over them leaves 1e-6."""
    found, _ = stuck(name)
    model, size, none = found.model, 1e-4, np.zeros(found.model.n_motors)
    steps = [(change(name, none, wrench) - change(name, none, -wrench)) / (2.0 * size) for wrench in size * np.eye(6)]
    compliance, forces = np.array(steps)[:, :6].T, np.array(steps)[:, 6]
    expected, by_wrench = sr.compliance(model, found), sr.contact_sensitivity(model, found).by_wrench
    assert np.abs(expected - compliance).max() < 2e-6 * np.abs(compliance).max()
    assert np.abs(by_wrench[0] - forces).max() < 2e-6 * np.abs(forces).max()
    assert by_wrench.shape == (1, 6)


@pytest.mark.parametrize("name", ["wall", "sphere"])
def test_tip_forces_and_stiffness_follow_the_motors_as_in_steps_that_stick(name: str) -> None:
    """Central differences of 1e-5 rad, to 1e-7; the torques also by the bordered stiffness that modes with servos take."""
    found, _ = stuck(name)
    model, size, none = found.model, 1e-5, np.zeros(6)
    steps = np.array([(change(name, turn, none) - change(name, -turn, none)) / (2.0 * size) for turn in size * np.eye(3)]).T
    assert np.abs(sr.elastostatic_jacobian(model, found) - steps[:3]).max() < 1e-8
    assert sr.contact_sensitivity(model, found).by_motors[0] == pytest.approx(steps[6], rel=1e-7, abs=1e-6)
    whole, held = held_stiffness(found, "a test")
    assert held is not None
    rows, n = np.concatenate([held.by_motors, held.by_springs], axis=1), model.n_springs
    bordered = np.block([[whole[3:, 3:], -rows[:, 3:].T], [rows[:, 3:], np.zeros((3, 3))]])
    moved = np.linalg.solve(bordered, -np.concatenate([whole[3:, :3], rows[:, :3]]))
    torques = whole[:3, :3] + whole[:3, 3:] @ moved[:n] - rows[:, :3].T @ moved[n:]
    assert np.abs(torques + steps[7:]).max() < 1e-6 * np.abs(torques).max()


@pytest.mark.parametrize(("slope", "across"), [(0.0, 0.0), (0.35, 0.2)])
def test_a_rod_whose_tip_sticks_has_the_frequencies_of_a_pinned_beam(slope: float, across: float) -> None:
    """Clamped and pinned, 3.9266^2 and 7.0686^2 (Blevins, table 8-1) in both planes, also on an oblique wall and held across.

    Without friction the rod swings along the wall as a cantilever, at 3.516. Sixteen hinges leave 1.3e-4; eight 5e-3.
    """
    model, normal = rod(16, radius=1e-4), np.array([-np.cos(slope), 0.0, -np.sin(slope)])
    wall = Environment([HalfSpace(tuple(normal), normal[2] - 1e-4 - 1e-6)])
    forces = 6e-6 * np.array([[1.0, 0.0, 0.0], [1.0, across, 0.0]])
    found = sr.follow_contact(model, (), forces, environment=wall, friction=FRICTION).equilibria[-1]
    assert abs(found.contacts[0].force[1]) == pytest.approx(across * 6e-6, rel=1e-3, abs=1e-10)
    modes = sr.vibration_modes(model, found)
    assert len(modes.frequencies) == model.n_springs - 3
    exact = np.repeat(np.array([3.92660231, 7.06858275]) ** 2, 2)
    assert 2.0 * np.pi * modes.frequencies[:4] == pytest.approx(exact, rel=3e-4)
    assert np.abs(found.contact_gradients @ modes.shapes).max() < 1e-9


def test_what_slips_or_would_have_to_is_refused_by_name() -> None:
    found, options = stuck("wall")
    dragged = sr.follow_contact(found.model, MOTORS, FORCE, **options | {"friction": 0.05}).equilibria[-1]
    assert dragged.contacts[0].status == "slips"
    assert dragged.contacts[0].cone_share == pytest.approx(1.0, abs=1e-8)
    for call in (sr.compliance, sr.elastostatic_jacobian, sr.contact_sensitivity, sr.vibration_modes):
        with pytest.raises(sr.ParameterError, match=f"{dragged.contacts[0].link} on half_space_1, which slips"):
            call(dragged.model, dragged)
    link = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))  # two springs cannot follow a point in three directions
    wall = Environment([HalfSpace((-0.8, -0.6, 0.0), -0.5)])
    held = sr.follow_contact(link, (0.2, 0.1), (10.0, 5.0, -5.0), environment=wall, friction=0.9).equilibria[-1]
    assert [one.status for one in held.contacts] == ["sticks"]
    assert np.abs(sr.compliance(link, held)).max() < 1e-12
    with pytest.raises(sr.ParameterError, match="something must slip"):
        sr.elastostatic_jacobian(link, held)
