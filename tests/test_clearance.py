"""Distance from obstacles: closed forms, and the contact solver, which touches exactly when an obstacle has come that far."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr

RADIUS = 0.055  # of the arm [m]
MOTORS = (0.2, 0.5, -0.4)
NEAR = 1e-6  # [m], how far beyond and short of touching; gaps are exact to rounding


def test_the_distance_of_a_straight_arm_in_closed_form(arm: sr.SoftModel) -> None:
    """Weightless it lies along x; a ball above link 2, a wall beside the arm."""
    straight = sr.solve_equilibrium(arm, (0, 0, 0))
    ball = sr.Sphere(0.1, (0.9, 0.0, 0.5), name="ball")
    near = straight.clearance(sr.Environment([ball, sr.HalfSpace((0, 1, 0), -0.4, name="wall")]))
    assert near.distance == pytest.approx(0.4 - RADIUS, abs=1e-12)
    assert near.obstacle == "wall"
    near = straight.clearance(sr.Environment([ball]))
    assert (near.link, near.obstacle) == ("link_2", "ball")
    assert near.distance == pytest.approx(0.5 - 0.1 - RADIUS, abs=1e-12)
    assert near.point == pytest.approx([0.9, 0.0, RADIUS], abs=1e-9)
    assert near.obstacle_point == pytest.approx([0.9, 0.0, 0.4], abs=1e-9)


@pytest.mark.parametrize("normal", [(0, 0, -1), (-1, 0, 0), (-1, 0.2, -0.3)])
def test_an_obstacle_touches_when_it_has_come_that_far(arm: sr.SoftModel, normal: tuple[float, ...]) -> None:
    held = sr.solve_equilibrium(arm, MOTORS, (0, 2, -3), gravity=sr.EARTH_GRAVITY)
    unit = np.array(normal) / np.linalg.norm(normal)
    away = held.clearance(sr.Environment([sr.HalfSpace(unit, -3.0)]))
    assert away.distance > 0.1
    assert unit @ (away.point - away.obstacle_point) == pytest.approx(away.distance, abs=1e-9)
    for beyond, touching in ((-NEAR, 0), (NEAR, 1)):
        wall = sr.Environment([sr.HalfSpace(unit, -3.0 + away.distance + beyond)])
        assert held.clearance(wall).distance == pytest.approx(-beyond, abs=1e-9)
        met = sr.solve_equilibrium(arm, MOTORS, (0, 2, -3), gravity=sr.EARTH_GRAVITY, environment=wall)
        assert len([one for one in met.contacts if one.strict]) == touching


def test_a_helix_has_a_clearance_from_the_rod_inside() -> None:
    tube = sr.HelixTube(length=1.0, upright="axis", elastic_sections=20)
    rest = sr.solve_equilibrium(sr.load_model(tube), ())
    thin, thick = (rest.clearance(sr.Environment([sr.Capsule(radius, 0.2, (0, 0, 0.24))])).distance for radius in (0.01, 0.03))
    assert thin - thick == pytest.approx(0.02, abs=1e-9)
    # chords of 20 sections lie inside of the smooth tube by at most `capsule_error`, which is what a gap may be wrong by
    most = float(sr.capsule_error(rest.model, ()).max())
    assert abs(thin - (float(tube.shape.inner_radius) - 0.01)) <= most + 1e-12


def test_what_has_no_distance_is_refused(arm: sr.SoftModel) -> None:
    straight = sr.solve_equilibrium(arm, (0, 0, 0))
    with pytest.raises(sr.ParameterError, match=r"environment.*an Environment"):
        straight.clearance(sr.Sphere(0.1))
    with pytest.raises(sr.ParameterError, match=r"environment.*stand still"):
        straight.clearance(sr.Environment([sr.Sphere(0.1, name="ball", pose=lambda way: np.eye(4))]))
    with pytest.raises(sr.ParameterError, match=r"environment.*can touch"):
        straight.clearance(sr.Environment([]))
