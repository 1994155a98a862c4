"""Robots with tendons along any path against the coupled rod and string model of Rucker and Webster, solved by shooting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from tests.support.rods import Rod, elastica_moment_tip, elastica_tip, rod_tip
from tests.support.tendon_rod import Piece, String, solve_tendon_rod

LENGTH, BEND, TWIST, AXIAL = 0.2, 2.45e-3, 1.9e-3, 4e4
"""A backbone of nitinol of radius 0.5 mm."""
ROD = [Piece(LENGTH, BEND, TWIST, AXIAL, 0.3)]
DISTANCE = 4.5e-3


# --- The oracle against what is known


def test_without_tendons_the_oracle_is_the_elastica_and_the_rod_in_space() -> None:
    """1e-9 m: the integration's 1e-10 of the length, and the elastica's missing stretch, F L / EA = 5e-7 of the length."""
    x, z, angle = elastica_tip(BEND, LENGTH, 0.2)
    found = solve_tendon_rod([Piece(LENGTH, BEND, TWIST, 1e12)], [], [], force=(0.2, 0.0, 0.0))
    assert found.position == pytest.approx([x, 0.0, z], abs=1e-9)
    assert np.arctan2(found.rotation[0, 2], found.rotation[2, 2]) == pytest.approx(angle, abs=1e-8)
    force, moment, gravity = (0.1, -0.05, 0.2), (1e-3, 2e-3, -1e-3), np.array([2.0, 0.0, -9.81])
    found = solve_tendon_rod(ROD, [], [], force=force, moment=moment, gravity=gravity)
    rod = Rod(length=LENGTH, bending_stiffness=BEND, torsional_stiffness=TWIST, axial_stiffness=AXIAL)
    position, rotation = rod_tip(rod, np.r_[force, moment], gravity_load=0.3 * gravity)
    assert found.position == pytest.approx(position, abs=1e-8)
    assert found.rotation == pytest.approx(rotation, abs=1e-7)


def test_a_straight_tendon_bends_the_oracle_into_an_arc() -> None:
    """Moment T d and push T everywhere: curvature T d / EI, stretch 1 - T / EA, and the tendon's length in closed form."""
    tension, azimuth = 5.0, 0.7
    found = solve_tendon_rod(ROD, [String.straight(LENGTH, DISTANCE, azimuth)], [tension])
    curvature, stretch = tension * DISTANCE / BEND, 1.0 - tension / AXIAL
    x, z, _ = elastica_moment_tip(1.0, LENGTH, curvature)
    assert found.position == pytest.approx(stretch * np.array([x * np.cos(azimuth), x * np.sin(azimuth), z]), abs=1e-11)
    assert found.lengths == pytest.approx([LENGTH * (stretch - DISTANCE * curvature)], abs=1e-12)
    assert np.abs(found.unbalanced).max() < 1e-10


def test_a_tendon_at_constant_pitch_bends_and_twists_the_oracle_evenly() -> None:
    r"""Strains are constant in frames that turn with the tendon; at small tension, with pitch angle b, tan(b) = d phi':

    bending `T d cos(b) / EI` towards it, twist `-T d sin(b) / GJ`, stretch `-T cos(b) / EA`.
    The tip is where a screw leads, turned back.
    """
    winding = 40.0
    string, pitch = String((0.0, LENGTH), (DISTANCE,) * 2, (0.0, winding * LENGTH)), np.arctan(DISTANCE * winding)
    for tension in (0.01, 10.0):
        found = solve_tendon_rod(ROD, [string], [tension])
        kx, ky, twist, stretch = found.strains
        if tension < 1.0:  # bending of 0.02 1/m changes the pitch by 1e-4 of itself
            expected = tension * DISTANCE * np.cos(pitch) / BEND, -tension * DISTANCE * np.sin(pitch) / TWIST
            assert (ky, twist) == pytest.approx(expected, rel=3e-4)
            assert (kx, stretch) == pytest.approx(
                (0.0, -tension * np.cos(pitch) / AXIAL), abs=1e-7
            )  # the moment's 1e-10 N m over EI
        screw = np.zeros((4, 4))  # of the frames that turn with the tendon
        screw[:3, :3] = [[0.0, -twist - winding, ky], [twist + winding, 0.0, -kx], [-ky, kx, 0.0]]
        screw[2, 3] = 1.0 + stretch
        tip, turn = expm(LENGTH * screw), winding * LENGTH
        back = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        assert found.position == pytest.approx(tip[:3, 3], abs=1e-9)
        assert found.rotation == pytest.approx(tip[:3, :3] @ back, abs=1e-8)
        assert found.lengths == pytest.approx([LENGTH * np.hypot(1.0 + stretch - DISTANCE * ky, DISTANCE * (twist + winding))])
