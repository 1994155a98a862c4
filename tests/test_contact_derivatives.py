"""Derivatives of equilibria in contact: bordered systems by hand and by dense inversion."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.sensitivity import inverse_in_contact, inverse_stiffness

# A few products of well-conditioned 4 x 4 matrices: rounding stays below 1e-13 of the largest entry.
ROUNDING = 1e-12


@pytest.fixture(scope="module")
def two_springs() -> sr.SoftModel:
    """One link with its side and its up spring, of 2 and 3 N m/rad."""
    text = sr.InflatableArm(link_lengths=(0.5,), stiffness=2.0).urdf()
    return sr.load_model(text, springs={"spring_1_side": 2.0, "spring_1_up": 3.0})


def test_two_springs_on_one_wall_by_hand(two_springs: sr.SoftModel) -> None:
    """A wall that both springs lean on, `g = d - a y1 - b y2`: three numbers by hand.

    Only the motion along (-b, a) is left, with the stiffness `k1 b^2 + k2 a^2`. A wall that comes nearer meets both springs in
    series: the force grows by `1 / (a^2 / k1 + b^2 / k2)`, and each spring gives way by its share.
    """
    (k1, k2), (a, b) = two_springs.stiffness, (0.3, -0.7)
    assert (k1, k2) == (2.0, 3.0)
    found = inverse_in_contact(two_springs, np.diag([k1, k2]), np.array([[-a, -b]]))
    along = np.array([-b, a])
    series = 1.0 / (a**2 / k1 + b**2 / k2)
    aside = -series * np.array([a / k1, b / k2])
    assert np.allclose(found.springs_by_load, np.outer(along, along) / (k1 * b**2 + k2 * a**2), rtol=ROUNDING, atol=ROUNDING)
    assert np.allclose(found.springs_by_gap[:, 0], aside, rtol=ROUNDING)
    assert np.allclose(found.forces_by_load[0], -aside, rtol=ROUNDING)  # a push to the wall (against the gap) presses harder
    assert np.allclose(found.forces_by_gap, [[series]], rtol=ROUNDING)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 4])
def test_the_bordered_matrix_is_inverted(arm: sr.SoftModel, rng: np.random.Generator, count: int) -> None:
    """All blocks against the dense inverse of the bordered matrix, also of a tangent without a potential."""
    n = arm.n_springs
    springs = np.diag(arm.stiffness)
    for symmetric in (True, False):
        tangent = springs + 0.2 * springs @ rng.uniform(-0.5, 0.5, (n, n))
        tangent = 0.5 * (tangent + tangent.T) if symmetric else tangent
        gradients = rng.normal(size=(count, n))
        found = inverse_in_contact(arm, tangent, gradients)
        inverse = np.linalg.inv(np.block([[tangent, gradients.T], [gradients, np.zeros((count, count))]]))
        blocks = ((inverse[:n, :n], found.springs_by_load), (inverse[:n, n:], found.springs_by_gap))
        blocks += ((-inverse[n:, :n], found.forces_by_load), (-inverse[n:, n:], found.forces_by_gap))
        for expected, block in blocks:
            assert np.abs(block - expected).max(initial=0.0) <= ROUNDING * max(np.abs(expected).max(initial=0.0), 1.0)
    if count == 0:
        assert np.allclose(found.springs_by_load, inverse_stiffness(arm, tangent), rtol=ROUNDING, atol=1e-16)


def test_a_wall_makes_an_unstable_spring_determinate(two_springs: sr.SoftModel) -> None:
    """A tangent that is singular alone has derivatives where the contact holds its direction, and none where it does not."""
    singular = np.diag([0.0, 3.0])
    found = inverse_in_contact(two_springs, singular, np.array([[0.5, 0.0]]))
    assert np.allclose(found.springs_by_load, [[0.0, 0.0], [0.0, 1.0 / 3.0]], atol=ROUNDING)
    assert np.allclose(found.forces_by_gap, 0.0, atol=ROUNDING)  # the spring that holds the gap has no stiffness
    with pytest.raises(sr.NeutralEquilibrium, match="beside the contacts"):
        inverse_in_contact(two_springs, singular, np.array([[0.0, 0.5]]))


def test_contacts_that_depend_on_each_other_share_the_force(two_springs: sr.SoftModel) -> None:
    """Two equal walls: the springs move as at one, and each wall takes half of the force."""
    tangent, row = np.diag([2.0, 3.0]), np.array([[0.3, -0.7]])
    one, two = (inverse_in_contact(two_springs, tangent, rows) for rows in (row, np.concatenate([row, row])))
    assert np.allclose(two.springs_by_load, one.springs_by_load, atol=ROUNDING)
    assert np.allclose(two.forces_by_load, 0.5 * one.forces_by_load, atol=ROUNDING)
