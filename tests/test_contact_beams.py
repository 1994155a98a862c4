"""Beams on props and between plates: chains in contact against closed forms and boundary-value problems."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp

import softrobots as sr
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import HalfSpace, Sphere

BENDING, AXIAL, LENGTH, RADIUS, GAP = 2.0, 2000.0, 1.0, 0.01, 1e-5


def beam(sections: int) -> sr.SoftModel:
    """A straight beam along z, without weight and without muscle forces."""
    robot = sr.PccArm(
        segment_lengths=(LENGTH,), elastic_sections=sections, radius=RADIUS, bending_stiffness=BENDING, axial_stiffness=AXIAL
    )
    return sr.load_model(robot, muscles="forces")


def prop_force(sections: int, load: float) -> float:
    """Reaction of a ball under the end of a beam that carries a uniform load across [N/m]."""
    model, ball = beam(sections), 0.02
    environment = Environment([Sphere(ball, (-RADIUS - ball, 0.0, LENGTH))])
    wrench = sr.distributed_force(model, (-load, 0.0, 0.0))
    found = sr.solve_equilibrium(model, model.relaxed_motors, wrench=wrench, environment=environment)
    (contact,) = [contact for contact in found.contacts if contact.strict]
    assert found.stable
    assert contact.link.endswith(f"{sections}_upper")
    return contact.normal_force


def test_a_propped_cantilever_carries_three_eighths_of_its_load_on_the_prop() -> None:
    """`R = 3 w L / 8` of a clamped beam with a prop at its end, at second order in the number of sections.

    The load bends the beam by 1e-4 of its length only, and its square is the error of the linear theory. What remains is
    `c / n^2` with one c: three numbers of sections, and the extrapolated force.
    """
    load = 8.0 * BENDING * 1e-4 / LENGTH**3
    forces = np.array([prop_force(sections, load) for sections in (4, 8, 16)])
    errors = forces / (3.0 * load * LENGTH / 8.0) - 1.0
    orders = np.log2(errors[:-1] / errors[1:])
    assert np.abs(orders - 2.0).max() < 0.03
    assert abs(errors[2] + (errors[2] - errors[1]) / 3.0) < 1e-5  # Richardson


def elastica(thrust: float, plate: float) -> tuple[float, float]:
    """Reaction of a plate at the free end of a clamped elastica under thrust, and the height of the end, by SciPy.

    Along the arc: `x' = (1 + e) sin a`, `z' = (1 + e) cos a`, `a' = m / EI`, with the end force `(R, -thrust)`, the stretch
    `e = N / EA` and `m' = -(1 + e) (shear force)`; at the end `m = 0`, `x = plate`.
    """

    def slopes(s: np.ndarray, y: np.ndarray, unknown: np.ndarray) -> np.ndarray:
        _, _, angle, moment = y
        side = unknown[0]
        axial = side * np.sin(angle) - thrust * np.cos(angle)
        across = side * np.cos(angle) + thrust * np.sin(angle)
        long = 1.0 + axial / AXIAL
        return np.array([long * np.sin(angle), long * np.cos(angle), moment / BENDING, -long * across])

    def ends(base: np.ndarray, tip: np.ndarray, unknown: np.ndarray) -> np.ndarray:
        return np.array([base[0], base[1], base[2], tip[3], tip[0] - plate])

    s = np.linspace(0.0, LENGTH, 41)
    guess = np.array([plate * (1 - np.cos(0.5 * np.pi * s)), s, plate * np.sin(0.5 * np.pi * s), 2.0 * (1.0 - s)])
    found = solve_bvp(slopes, ends, s, guess, p=[-1.0], tol=1e-9, max_nodes=20000)
    assert found.success
    return float(found.p[0]), float(found.y[1, -1])


@pytest.mark.study
def test_an_elastica_between_two_plates_presses_its_end_on_one() -> None:
    """Thrust beyond Euler's load squeezes a clamped beam between plates: its end touches one, at the reaction of the elastica.

    Second order in the number of sections; the boundary-value problem is exact to 1e-8. A second pair of plates keeps the beam
    in the plane, all but 1e-5 of its length: the elastica in the plane alone is a saddle. That bends the forces by 1e-8.
    """
    thrust, plate = 1.6 * BENDING * (0.5 * np.pi / LENGTH) ** 2, 0.25
    reaction, height = elastica(thrust, plate)
    assert reaction < -0.5
    errors = []
    for sections in (6, 12):
        model = beam(sections)
        plates = [HalfSpace((-1, 0, 0), -plate - RADIUS, name="right"), HalfSpace((1, 0, 0), -plate - RADIUS, name="left")]
        plates += [HalfSpace((0, side, 0), -RADIUS - GAP) for side in (-1, 1)]
        start = np.zeros(model.n_springs)
        start[1::4] = 0.01  # bent to the right: without it the straight beam is left to a side of its own choice
        found = sr.solve_equilibrium(
            model, model.relaxed_motors, (0, 0, -thrust), environment=Environment(plates), q_springs0=start
        )
        (contact,) = [one for one in found.contacts if one.obstacle == "right"]
        assert (contact.status, found.stable) == ("pressed", True)
        assert found.tip_position[0] == pytest.approx(plate, abs=1e-12)
        errors.append([contact.normal_force + reaction, found.tip_position[2] - height])
    ratios = np.abs(errors[0]) / np.abs(errors[1])
    assert (np.abs(ratios - 4.0) < 0.25).all()  # the next term of the error is some percent here
    assert abs(errors[1][0] / reaction) < 0.004


def test_a_straight_beam_under_thrust_leaves_its_saddle_to_a_plate() -> None:
    """The straight equilibrium is a saddle; the beam buckles aside until a plate holds it, whichever."""
    model = beam(4)
    plates = [HalfSpace((side, 0, 0), -0.2) for side in (-1, 1)] + [HalfSpace((0, side, 0), -0.2) for side in (-1, 1)]
    found = sr.solve_equilibrium(model, model.relaxed_motors, (0, 0, -8.0), environment=Environment(plates))
    assert found.stable
    assert found.contacts
    assert np.hypot(*found.tip_position[:2]) > 0.15
