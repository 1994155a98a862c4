"""Robots that grasp: fingers around an object, a helix around the paper's cylinder, and robots that touch themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

import softrobots as sr
from softrobots.environment.gaps import Surroundings
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


# --- Robots that touch themselves


def test_turns_of_a_chain_are_as_far_apart_as_those_of_the_helix() -> None:
    """Against `helix.self_contact`, of two turns at their local minimum: second order in the length of a section.

    Both chords of a pair are nearer to the axis than the arcs, by their sagitta, and miss its direction of least distance.
    """
    angle, contraction = np.radians(5.0), 0.45
    shape = sr.helix.forward(contraction, angle, 0.0331)
    length = 4.0 * np.pi * np.hypot(shape.outer_radius, shape.pitch) * np.cos(angle)  # two turns
    errors = []
    for sections in (12, 24):
        tube = sr.HelixTube(length=float(length), contraction=contraction, angle=angle, elastic_sections=sections)
        model = sr.load_model(tube)
        gaps = Surroundings(model, sr.Environment([], self_contact=True)).at(model.configuration([], model.rest), 0.1)
        errors.append(float(gaps.values.min() - tube.contact.turn_clearance))
    sagitta = (1.0 - np.cos(0.5 * tube.strains[1] * tube.centre_length / sections)) / tube.strains[1]
    assert abs(errors[1]) < sagitta
    assert 3.0 < errors[0] / errors[1] < 6.0


def test_a_folded_arm_rests_with_its_tip_on_its_base() -> None:
    """Three links in a plane, folded until the last end is within both radii of the base: the least energy of three springs
    whose chain keeps the distance, by SciPy (its tolerance, 1e-9), and the force along the line between them."""
    robot = sr.InflatableArm(link_lengths=(0.6, 0.6, 0.6), stiffness=150.0)
    found = sr.solve_equilibrium(
        sr.load_model(robot), (0.0, 0.5, -2.0, -2.0), environment=sr.Environment([], self_contact=True)
    )

    def end(bends: np.ndarray) -> np.ndarray:
        angles = np.array([0.0, bends[0], bends[0] - 2.0, bends[0] + bends[1] - 2.0, bends[:2].sum() - 4.0, bends.sum() - 4.0])
        pieces = np.tile([0.03, 0.57], 3)
        return np.array([pieces @ np.cos(angles), pieces @ np.sin(angles)])

    reach = {"type": "ineq", "fun": lambda bends: np.linalg.norm(end(bends)) - 0.11}
    best = minimize(lambda bends: 75.0 * bends @ bends, np.zeros(3), constraints=[reach], options={"ftol": 1e-16})
    (contact,) = found.contacts
    assert (contact.link, contact.obstacle) == ("link_3", "link_1_root")
    bends = found.q_springs.reshape(3, 2)  # sideways and up, of each link
    assert np.abs(bends).max(axis=0) == pytest.approx(np.abs(best.x).max() * np.array([0.0, 1.0]), abs=1e-8)
    assert sorted(np.abs(bends[:, 1])) == pytest.approx(sorted(np.abs(best.x)), abs=1e-8)
    slope = np.array([(reach["fun"](best.x + step) - reach["fun"](best.x - step)) / 2e-6 for step in 1e-6 * np.eye(3)])
    assert contact.normal_force == pytest.approx(150.0 * (best.x @ slope) / (slope @ slope), rel=1e-6)
    assert abs(contact.gap) < 1e-12
    assert found.stable
    motors = (0.0, 0.5, -2.0, -2.0)
    (rubs,) = sr.follow_contact(found.model, motors, environment=found.environment, friction=0.3, start=found).equilibria
    assert [(one.link, one.obstacle, one.with_itself) for one in (contact, *rubs.contacts)] == [
        ("link_3", "link_1_root", True)
    ] * 2


def test_a_fold_through_the_arm_itself_is_left_or_named() -> None:
    """Cores that cross have no normal and no second derivative; the solver passes through, and ends outside or says where."""
    model, environment = sr.load_model(sr.InflatableArm(link_lengths=(0.6, 0.6, 0.6))), sr.Environment([], self_contact=True)
    for bend in (2.1, 2.2):
        try:
            found = sr.solve_equilibrium(model, (0.0, 0.5, -bend, -bend), environment=environment)
        except sr.EquilibriumNotFound as error:
            assert "inside of 'link_1'" in str(error)
        else:
            assert all(abs(contact.gap) < 1e-9 for contact in found.contacts)
