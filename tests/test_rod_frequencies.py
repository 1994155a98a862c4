"""Frequencies of a clamped rod, with and without a mass at its tip, against the roots of the characteristic equation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from tests.support.rods import cantilever_frequencies


class Rod(NamedTuple):
    """A round rod."""

    length: float
    """[m]."""
    radius: float
    """[m]."""
    stiffness: float
    """EI [N m^2]."""
    density: float
    """[kg/m]."""

    @property
    def rate(self) -> float:
        """Unit of its frequencies [rad/s]."""
        return float(np.sqrt(self.stiffness / (self.density * self.length**4)))


STEEL = Rod(0.6, 0.8e-3, 200e9 * np.pi * 0.8e-3**4 / 4, 7850 * np.pi * 0.8e-3**2)
THIN = Rod(1.0, 1e-4, 1.0, 1.0)
"""Slender, without inertia about a diameter to speak of; heavy, so that the tiny links between its joints are short."""
HINGES = {"chain": "lumped", "torsion": False, "extension": False}


def errors(rod: Rod, count: int, tip: float, **fields: object) -> np.ndarray:
    """Relative errors of the first three frequencies of a chain of `count` hinges or sections; each bends in two planes."""
    robot = sr.PccArm(
        segment_lengths=(rod.length,), muscle_azimuths=(), bending_stiffness=rod.stiffness, linear_density=rod.density,
        torsional_stiffness=rod.stiffness / 1.3, axial_stiffness=4 * rod.stiffness / rod.radius**2, radius=rod.radius,
        hinges=count, elastic_sections=count, **fields,
    )  # fmt: skip
    model = sr.load_model(robot)
    if tip:
        frame = model.pinocchio.frames[model.frame_id("tip")]
        mass = pin.Inertia(tip * rod.density * rod.length, np.zeros(3), np.zeros((3, 3)))
        model.pinocchio.inertias[frame.parentJoint] += frame.placement.act(mass)
    squares = sr.solve_equilibrium(model, ()).stability.eigenvalues
    return np.sqrt(np.sort(squares.real))[:6:2] / (cantilever_frequencies(tip) * rod.rate) - 1


def test_the_closed_form_has_the_known_roots() -> None:
    """Tabulated for a clamped rod without a mass, e.g. Blevins, Formulas for natural frequency and mode shape, table 8-1."""
    assert np.sqrt(cantilever_frequencies(0.0)) == pytest.approx([1.87510407, 4.69409113, 7.85475744], rel=1e-8)
    assert np.all(cantilever_frequencies(0.5) <= cantilever_frequencies(0.0))  # a mass makes it slower


@pytest.mark.parametrize("tip", [0.0, 0.5, 3.0])
def test_sixteen_hinges_have_three_frequencies_to_a_thousandth(tip: float) -> None:
    assert np.abs(errors(STEEL, 16, tip, chain="lumped")).max() < 1e-3


@pytest.mark.study
@pytest.mark.parametrize("chain", [HINGES, {"chain": "flexures"}], ids=["hinges", "flexures"])
@pytest.mark.parametrize("tip", [0.0, 0.5, 3.0])
def test_frequencies_of_hinges_and_flexures_are_of_fourth_order(tip: float, chain: dict[str, object]) -> None:
    """3.8: room for the next order. With a mass at the tip, errors of modes 2 and 3 change sign, and are smaller."""
    coarse, fine = (errors(THIN, count, tip, **chain) for count in (16, 32))
    shown = slice(1 if tip else 3)
    assert np.log2(coarse[shown] / fine[shown]).min() > 3.8
    assert np.abs(fine).max() < 2e-5


@pytest.mark.parametrize("count", [4, 5, 9])
def test_hinges_bend_exactly_under_an_end_load_and_their_own_weight(count: int) -> None:
    """L^3 / 3 EI, L^2 / 2 EI and L / EI; w L^4 / 8 EI. Rounding; of the weight, the tiny links between the joints, 1e-4 L each,
    turn about the hinge that they stand before. With one moved hinge it is 0.7 % at four hinges.
    """
    robot = sr.PccArm(
        segment_lengths=(1.0,),
        muscle_azimuths=(),
        bending_stiffness=1.0,
        linear_density=1.0,
        radius=1e-4,
        hinges=count,
        **HINGES,
    )
    model = sr.load_model(robot)
    soft = sr.compliance(model, sr.solve_equilibrium(model, ()))
    assert soft[np.ix_([0, 4], [0, 4])] == pytest.approx(np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]), rel=1e-13)
    sag = sr.solve_equilibrium(model, (), gravity=(1e-5, 0.0, 0.0)).tip_position[0]
    assert sag == pytest.approx(1e-5 / 8, rel=1e-4)


def test_frequencies_of_sections_are_of_second_order() -> None:
    """The curvature of a section is constant: 0.05, 0.96 and 2.8 % at sixteen. 0.1: room for the next order."""
    coarse, fine = (errors(THIN, count, 0.0, chain="sections") for count in (8, 16))
    assert np.log2(coarse / fine) == pytest.approx([2.0, 2.0, 2.0], abs=0.1)
    assert fine == pytest.approx([0.0005, 0.0096, 0.028], rel=0.06)
