"""Robots that grasp: fingers around an object, a helix around the paper's cylinder, and robots that touch themselves."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.elastic_state import ElasticProblem
from studies.contact.helix_grip import CYLINDER, HelixGrip

pytestmark = pytest.mark.study  # chains of many sections, in seconds each

PALM = """<robot name="palm"><link name="palm"><inertial><mass value="0.2"/>
<inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="2e-4"/></inertial></link></robot>"""
FINGER = sr.TendonArm(segment_lengths=(0.12,), tendon_azimuths=(0.0,), kind="tension", elastic_sections=3)
BALL = sr.Environment([sr.Sphere(radius=0.015, position=(0.0, 0.0, 0.11), name="ball")])


def mounted(urdf: str, finger: int, count: int) -> str:
    """A finger on a palm, 5 cm from its axis, that bends towards the axis; one of `count` around it."""
    angle = 2.0 * np.pi * finger / count
    place = (0.05 * np.cos(angle), 0.05 * np.sin(angle), 0.0)
    return sr.mount(urdf, "palm", FINGER, prefix=f"finger_{finger}_", xyz=place, rpy=(0.0, 0.0, angle + np.pi), name="hand")


@pytest.fixture(scope="module")
def fingers() -> list[sr.Equilibrium]:
    """Three fingers, each a robot of its own, around one ball."""
    models = [sr.load_model(mounted(PALM, finger, 3)) for finger in range(3)]
    return [sr.solve_equilibrium(model, [3.0], environment=BALL) for model in models]


def test_fingers_that_are_robots_of_their_own_hold_one_ball(fingers: list[sr.Equilibrium]) -> None:
    """By symmetry they press alike, and together turn the ball nowhere; the closed forms of equal fingers follow."""
    contacts = [contact for finger in fingers for contact in finger.contacts]
    forces = [contact.normal_force for contact in contacts]
    assert len(contacts) == 3
    assert min(forces) > 0.03
    assert forces == pytest.approx([forces[0]] * 3, rel=1e-9)
    assert {contact.obstacle for contact in contacts} == {"ball"}
    wrench, one = sr.contact_wrench(contacts, (0.0, 0.0, 0.11)), sr.contact_wrench(contacts[:1], (0.0, 0.0, 0.11))
    assert np.allclose(wrench[[0, 1, 3, 4, 5]], 0.0, rtol=0.0, atol=1e-9 * forces[0])
    assert wrench[2] == pytest.approx(3.0 * one[2], rel=1e-9)  # they push it along the axis, too: it is held there
    assert np.allclose(one[3:], 0.0, rtol=0.0, atol=1e-12)  # without friction every force is through the middle of the ball
    assert not sr.is_force_closure(contacts, 0.0)
    assert sr.is_force_closure(contacts, 0.5)
    tilt = -contacts[0].normal[2]  # sine of the slope of the inward normals
    for way in (1.0, -1.0):  # friction along the meridians: mu N cos(slope) each
        pull = sr.pull_out_force(contacts, 0.5, (0.0, 0.0, way))
        assert pull.force == pytest.approx(0.5 * sum(forces) * np.sqrt(1.0 - tilt**2), rel=1e-6)


def test_fingers_of_one_hand_touch_as_fingers_of_their_own(fingers: list[sr.Equilibrium]) -> None:
    urdf = PALM
    for finger in range(3):
        urdf = mounted(urdf, finger, 3)
    together = sr.solve_equilibrium(sr.load_model(urdf), [3.0] * 3, environment=BALL).contacts
    for contact, finger in zip(sorted(together, key=lambda one: one.link), fingers, strict=True):
        (alone,) = finger.contacts
        assert contact.link == alone.link
        assert np.allclose(contact.point, alone.point, rtol=0.0, atol=1e-9)
        assert np.allclose(contact.force, alone.force, rtol=0.0, atol=1e-8)


def test_a_helix_grips_the_cylinder_with_the_slope_of_its_energy_by_the_gap() -> None:
    """F dL = dE, the virtual work behind (18) of [Blumenschein 2018], with all the energy of the chain: air, wall and actuator.
    Central differences by 20 um. Every contact presses, none penetrates; a wall of 0.01 N m^2 stays below the closed form."""
    fields = {"contraction": 0.33, "angle": np.radians(7.8), "length": 0.95, "bending_stiffness": 0.01}
    grip = HelixGrip.of(sr.HelixTube(actuator="elastic", elastic_sections=16, **fields))
    step, cut = 2e-5, 0.3
    closer, found, wider = grip.around((0.003 - step, 0.003, 0.003 + step), cut)
    energies = [ElasticProblem(one.model, one.q_motors, one.load).state(one.q_springs).energy for one in (closer, wider)]
    force = float(np.mean(grip.force(found, cut)))
    assert (energies[1] - energies[0]) / (2.0 * step) == pytest.approx(force, rel=2e-6)  # the truncation, 1e-6 at 20 um
    assert found.stable
    assert len(found.contacts) >= 8
    assert all(contact.normal_force >= 0.0 and abs(contact.gap) < 1e-12 for contact in found.contacts)
    assert {contact.obstacle for contact in found.contacts} == {"left", "right"}
    bounds = CYLINDER.force(10e3, CYLINDER.object_radius - grip.inner_radius)
    assert 5.0 < force < bounds.force < bounds.contact
