"""Where something touches an arm, from motor torques: against pushes at known places."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.tip_force.contact_place import ContactPlace
from tests.support.laws import law
from tests.support.tables import each_row

MOTORS = np.array([0.3, 0.6, -0.8])


def pushed(arm: sr.SoftModel, link: str, along: float, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Motor torques under a force across a link, at a distance along it; and the force without its part along the link."""
    marked = sr.with_points(arm, {"touched": (link, (along, 0.0, 0.0))})
    for _ in range(30):
        found = sr.solve_equilibrium(marked, MOTORS, force, frame="touched", gravity=sr.EARTH_GRAVITY, tolerance=1e-13)
        axis = frame_placement(marked, found.q, link).rotation[:, 0]
        if abs(axis @ force) < 1e-13:
            break
        force = force - axis * (axis @ force)
    return found.motor_torques, force


@law("locate_contact", "statics.tip_force.contact_place.ContactPlace")
@given(along=st.floats(0.05, 0.55), turn=st.floats(0.0, 6.28), size=st.floats(5.0, 15.0))
@settings(max_examples=3)
def test_a_push_beyond_all_motors_is_found_with_its_place(along: float, turn: float, size: float) -> None:
    """Two force components and the place from three torques without noise: the true place explains them, others do not."""
    arm = sr.load_model(sr.InflatableArm())
    torques, force = pushed(arm, "link_2", along, size * np.array([0.0, np.cos(turn), np.sin(turn)]))
    points = [(x, 0.0, 0.0) for x in (along - 0.04, along, along + 0.04)]
    options: dict[str, Any] = {"torque_std": 1e-3, "gravity": sr.EARTH_GRAVITY}
    best, *others = sr.locate_contact(arm, MOTORS, torques, places={"link_2": (points, (1.0, 0.0, 0.0))}, **options)
    assert isinstance(best, ContactPlace)
    assert (best.link, best.point.tolist()) == ("link_2", [along, 0.0, 0.0])
    assert best.misfit < 1e-6
    assert np.abs(best.estimate.force - force).max() < 1e-6 * size
    assert len(others) == 2
    assert sum(one.probability for one in (best, *others)) == pytest.approx(1.0, abs=1e-12)


def test_the_probability_is_where_the_push_is() -> None:
    """With noise of 0.05 N m a push on the second link is known to about a tenth of its length: a posterior of Gauss.

    The likelihood is recomputed here from the torques that each candidate leaves.
    """
    arm = sr.load_model(sr.InflatableArm())
    torques, force = pushed(arm, "link_2", 0.35, np.array([0.0, 8.0, -6.0]))
    found = sr.locate_contact(arm, MOTORS, torques, torque_std=0.05, gravity=sr.EARTH_GRAVITY)
    near = sum(one.probability for one in found if one.link == "link_2" and abs(one.point[0] - 0.35) < 0.06)
    assert near > 0.98
    assert np.linalg.norm(found[0].estimate.force - force) < 0.05 * np.linalg.norm(force)
    assert not any(one.link == "link_2" and one.point[0] > 0.56 for one in found)  # the end would have to be pulled
    links = {one.link: 0.57 / 8 if one.link in ("link_1", "link_2") else 0.03 / 8 for one in found}  # lengths of the pieces
    left = [np.sum((torques - one.estimate.equilibrium.motor_torques) ** 2) / 0.05**2 for one in found]
    likely = np.array([links[one.link] for one in found]) * np.exp(-0.5 * (np.array(left) - min(left)))
    assert np.allclose([one.probability for one in found], likely / likely.sum(), rtol=1e-6, atol=1e-12)
    assert [one.misfit for one in found] == pytest.approx(left, rel=1e-6, abs=1e-9)


def test_a_push_on_the_end_is_found_there(arm: sr.SoftModel) -> None:
    """The arm leans on a wall with the round end of its body: the force has a part along the link, as at no other place."""
    wall = sr.Environment([sr.HalfSpace((-1.0, 0.2, -0.1), -1.0)])
    leaning = sr.solve_equilibrium(arm, (0.3, 0.4, -0.3), gravity=sr.EARTH_GRAVITY, environment=wall)
    (contact,) = leaning.contacts
    options: dict[str, Any] = {"torque_std": 0.02, "gravity": sr.EARTH_GRAVITY, "count": 4}
    best, *others = sr.locate_contact(arm, leaning.q_motors, leaning.motor_torques, **options)
    assert best.link == "link_2"
    assert np.allclose(best.point, (0.57, 0.0, 0.0), atol=1e-12)  # of a link of 0.6 m, behind its hinge
    assert best.probability > 0.8 > 0.2 > max(one.probability for one in others)
    assert best.misfit < 1e-6
    assert np.abs(best.estimate.force - contact.force).max() < 1e-6 * contact.normal_force


def test_a_push_on_the_first_link_may_be_anywhere_on_it() -> None:
    """Only two motors feel it: every place on that link explains the torques, and none on the next."""
    arm = sr.load_model(sr.InflatableArm())
    torques, _ = pushed(arm, "link_1", 0.3, np.array([0.0, 8.0, -6.0]))
    found = sr.locate_contact(arm, MOTORS, torques, torque_std=0.05, gravity=sr.EARTH_GRAVITY, count=4)
    by_link = {link: [one.probability for one in found if one.link == link] for link in ("link_1", "link_2")}
    assert max(by_link["link_1"]) - min(by_link["link_1"]) < 1e-3
    assert sum(by_link["link_1"]) > 0.9
    assert sum(by_link["link_2"]) < 1e-6


@each_row(
    ("options", "error", "message"),
    [
        ({"torque_std": 0.0}, sr.ParameterError, "torque_std"),
        ({"torque_std": (0.1, 0.1)}, sr.ParameterError, "torque_std"),
        ({"motor_torques": (1.0, 2.0)}, sr.ParameterError, "motor_torques"),
        ({"places": [((0, 0, 0), (1, 0, 0))]}, sr.ParameterError, "places.*mapping"),
        ({"places": {}}, sr.ParameterError, "places.*mapping"),
        ({"places": {"link_1": (0, 0, 0)}}, sr.ParameterError, "points, axis"),
        ({"places": {"link_1": ([(0, 0)], (1, 0, 0))}}, sr.ParameterError, "places"),
        ({"places": {"link_1": ([(0, 0, 0)], (0, 0, 0))}}, sr.ParameterError, "different from zero"),
        ({"places": {"link_7": ([(0, 0, 0)], (1, 0, 0))}}, sr.NameNotFound, "link_7"),
        ({"count": 0}, sr.ParameterError, "count"),
    ],
)
def test_bad_input_is_refused(options: dict, error: type, message: str, arm: sr.SoftModel) -> None:
    given: dict[str, Any] = {"motor_torques": (1.0, -2.0, 0.5), "torque_std": 0.1} | options
    with pytest.raises(error, match=re.compile(message)):
        sr.locate_contact(arm, MOTORS, **given)


def test_a_robot_with_one_motor_is_refused() -> None:
    with pytest.raises(sr.ParameterError, match="at least two motors"):
        sr.locate_contact(sr.load_model(sr.InflatableArm(), motors=["motor_1"]), (0.1,), (1.0,), torque_std=0.1)
