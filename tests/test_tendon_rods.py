"""Robots with tendons along any path against the coupled rod and string model of Rucker and Webster, solved by shooting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm

import softrobots as sr
from tests.support.rods import Rod, elastica_moment_tip, elastica_tip, rod_tip
from tests.support.routed_arms import actuator, routed
from tests.support.tendon_rod import Piece, Springy, String, TendonRod, solve_tendon_rod

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


# --- The package against the oracle


@dataclass(frozen=True)
class Case:
    """A rod of pieces that turn against each other, with tendons and loads."""

    pieces: tuple[Piece, ...]
    strings: tuple[String, ...]
    tensions: tuple[float, ...]
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moment: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: tuple[float, ...] = (0.0,)

    @property
    def length(self) -> float:
        return sum(piece.length for piece in self.pieces)

    @property
    def wrench(self) -> np.ndarray:
        return np.array([*self.force, *self.moment])

    def solution(self, laws: Sequence[Springy] | None = None) -> TendonRod:
        return solve_tendon_rod(
            self.pieces, self.strings, laws or self.tensions, force=self.force, moment=self.moment, gravity=self.gravity
        )

    def routes(self, string: String) -> list[tuple[int, tuple, tuple, tuple]]:
        """The path of a string by segments, whose azimuths are counted in their own turned frames."""
        made, start, turn = [], 0.0, 0.0
        for number, (piece, more) in enumerate(zip(self.pieces, self.turns, strict=True), start=1):
            turn += more
            low, high = max(start, string.at[0]), min(start + piece.length, string.at[-1])
            if high > low + 1e-9:
                at = [low, *(s for s in string.at if low + 1e-9 < s < high - 1e-9), high]
                azimuths = np.interp(at, string.at, string.azimuth) - turn
                made.append(
                    (number, tuple(np.array(at) - start), tuple(np.interp(at, string.at, string.distance)), tuple(azimuths))
                )
            start += piece.length
        return made

    def model(self, count: int, chain: str = "sections", **attributes: Any) -> sr.SoftModel:
        kind = {"kind": "tension"} | attributes
        tags = [actuator(f"tendon_{i}", *self.routes(string), **kind) for i, string in enumerate(self.strings)]
        return routed(
            *tags,
            segment_lengths=tuple(piece.length for piece in self.pieces),
            offset=self.turns,
            bending_stiffness=tuple(piece.bending_stiffness for piece in self.pieces),
            torsional_stiffness=tuple(piece.torsional_stiffness for piece in self.pieces),
            axial_stiffness=tuple(piece.axial_stiffness for piece in self.pieces),
            linear_density=tuple(piece.density for piece in self.pieces),
            radius=1e-3,
            chain=chain,
            elastic_sections=count,
            hinges=count,
        )

    def misses(self, count: int, right: TendonRod, chain: str = "sections") -> np.ndarray:
        """Errors of tip and lengths of tendons, relative to the length of the rod, and of the direction of the tip [rad]."""
        found = sr.solve_equilibrium(self.model(count, chain), self.tensions, wrench=self.wrench, gravity=self.gravity)
        assert found.stability.kind in ("stable", "flutter")
        back = rotation_about_z(-sum(self.turns))
        turn = found.transform_tip_to_world.rotation @ back @ right.rotation.T
        return np.array(
            [
                np.linalg.norm(found.tip_position - right.position) / self.length,
                np.abs(found.muscle_lengths - right.lengths).max() / self.length,
                np.linalg.norm(pin.log3(turn)),
            ]
        )


def rotation_about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


ARM = tuple(
    Piece(length, stiff * BEND, stiff * TWIST, AXIAL, 0.3) for length, stiff in ((0.060, 1.0), (0.0625, 1.0), (0.064, 0.5))
)
GRAVITY = (2.0, 0.0, -9.81)
CASES = {
    "straight": Case(tuple(ROD), (String.straight(LENGTH, DISTANCE, 0.7),), (3.0,), (0.05, -0.03, -0.02), gravity=GRAVITY),
    "helical": Case(
        tuple(ROD),
        (String((0.0, LENGTH), (DISTANCE,) * 2, (0.3, 7.0)),),
        (5.0,),
        (0.04, 0.02, 0.05),
        (1e-3, 0.0, 2e-3),
        GRAVITY,
    ),
    "corners": Case(
        tuple(ROD),
        (
            String((0.05, 0.1, LENGTH), (DISTANCE, 0.5 * DISTANCE, DISTANCE), (0.0, 1.0, 3.0)),
            String((0.0, 0.15), (DISTANCE, 2.0 * DISTANCE), (2.0, 2.0)),
        ),
        (4.0, 2.0),
        (0.03, 0.05, 0.02),
    ),
    "three segments": Case(
        ARM,
        tuple(
            String.straight(end, DISTANCE, azimuth)
            for end, first in ((0.060, 0.0), (0.1225, 0.4), (0.1865, 0.8))
            for azimuth in first + np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
        ),
        (1.2, 0.5, 0.0, 0.5, 1.6, 0.8, 0.0, 0.5, 1.0),
        (0.02, 0.01, 0.02),
        (0.0, 5e-4, 5e-4),
        GRAVITY,
        (0.3, 0.4, -0.7),
    ),
}


@cache
def right(case: str) -> TendonRod:
    return CASES[case].solution()


@pytest.mark.study
@pytest.mark.parametrize("case", CASES)
def test_sections_converge_to_rucker_and_webster(case: str) -> None:
    """Tip, lengths of the tendons and direction: second order in the number of sections of a rod that bends by 1 to 2.5 rad."""
    counts = {"helical": (8, 16), "three segments": (2, 4)}.get(case, (4, 8))
    errors = np.array([CASES[case].misses(count, right(case)) for count in counts])
    assert np.log2(errors[0] / errors[1]).min() > 1.8
    assert errors[1, :2].max() < 4e-3


@pytest.mark.study
@pytest.mark.parametrize("case", CASES)
def test_48_sections_are_right_to_1e_4_of_the_length(case: str) -> None:
    """Of the whole arm; lumped chains of as many hinges to 1e-3, with half as many about four times worse."""
    each = 48 // len(CASES[case].pieces)
    assert CASES[case].misses(each, right(case))[:2].max() < 1e-4
    lumped, before = (CASES[case].misses(count, right(case), "lumped") for count in (each, each // 2))
    assert lumped[:2].max() < 1e-3
    assert np.log2(before[0] / lumped[0]) > 1.6


MOTORS = np.repeat([0.060, 0.1225, 0.1865], 3) - 4e-4 * np.array([9.0, -3.0, -5.0, 4.0, 8.0, -14.0, -11.0, -3.0, 9.0])
SPRINGY = {"kind": "elastic", "stiffness": 8000.0, "pretension": 0.5}


@pytest.mark.study
def test_elastic_tendons_converge_to_the_strings_and_go_slack_with_them() -> None:
    """Lengths of the motors given: second order in tip and tensions, and the same tendons slack."""
    case = CASES["three segments"]
    exact = case.solution([Springy(motor, SPRINGY["stiffness"], SPRINGY["pretension"]) for motor in MOTORS])
    slack = exact.tensions < 1e-9
    assert slack.sum() == 3
    errors = []
    for count in (2, 4):
        found = sr.solve_equilibrium(case.model(count, **SPRINGY), MOTORS, wrench=case.wrench, gravity=case.gravity)
        assert np.array_equal(found.motor_torques == 0.0, slack)
        far = np.linalg.norm(found.tip_position - exact.position) / case.length
        errors.append([far, np.abs(found.motor_torques - exact.tensions).max() / exact.tensions.max()])
    ratios = np.array(errors[0]) / errors[1]
    assert np.log2(ratios).min() > 1.8
    assert max(errors[1]) < 5e-3


@pytest.mark.study
def test_the_arm_with_tendons_is_the_rod_that_its_parameters_say() -> None:
    """The default robot, motors moved by up to 5 mm, weight, a tip force: 1.4e-3 of the length at its four sections."""
    lengths, radius = (0.060, 0.0625, 0.064), 0.0005
    bend, axial = 50e9 * np.pi * radius**4 / 4.0, 50e9 * np.pi * radius**2
    pieces = [Piece(length, bend, bend / 1.3, axial, 0.05 / 0.1865) for length in lengths]
    azimuths = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    strings = [String.straight(end, DISTANCE, azimuth) for end in np.cumsum(lengths) for azimuth in azimuths]
    motors = np.repeat(np.cumsum(lengths), 3) + 1e-3 * np.array([-1.0, 0.5, 0.5, 1.0, -2.0, 1.0, -3.0, 5.0, -2.0])
    force, gravity = (0.1, 0.05, 0.0), (0.0, 0.0, -9.81)
    exact = solve_tendon_rod(pieces, strings, [Springy(motor, 8e3, 2.0) for motor in motors], force=force, gravity=gravity)
    errors = []
    for count in (4, 8):
        found = sr.solve_equilibrium(sr.load_model(sr.TendonArm(elastic_sections=count)), motors, force, gravity=gravity)
        tensions = np.abs(found.motor_torques - exact.tensions).max() / exact.tensions.max()
        errors.append([np.linalg.norm(found.tip_position - exact.position) / sum(lengths), tensions])
    assert np.log2(np.array(errors[0]) / errors[1]).min() > 1.9
    assert max(errors[0]) < 2e-3


@pytest.mark.study
def test_given_lengths_of_strings_find_their_tensions() -> None:
    """Along routes with corners, from the middle of the rod: second order in tip and tensions."""
    case, exact, errors = CASES["corners"], right("corners"), []
    for count in (8, 16):
        model = case.model(count, kind="length")
        found = sr.solve_equilibrium(model, exact.lengths, wrench=case.wrench, gravity=case.gravity)
        tensions = np.abs(found.motor_torques - exact.tensions).max() / exact.tensions.max()
        errors.append([np.linalg.norm(found.tip_position - exact.position) / case.length, tensions])
    assert np.log2(np.array(errors[0]) / errors[1]).min() > 1.8
    assert max(errors[1]) < 1e-2


# --- Closed forms


@pytest.mark.study
def test_a_tendon_and_a_force_across_are_an_elastica_with_a_moment_at_its_end() -> None:
    """Of an inextensible rod: a straight tendon exerts a moment T d at its end, and a push that changes nothing."""
    piece, tension, force = Piece(LENGTH, BEND, TWIST, 1e7, 0.3), 4.0, (0.05, 0.0, 0.03)
    case = Case((piece,), (String.straight(LENGTH, DISTANCE, 0.0),), (tension,), force)
    rod = Rod(length=LENGTH, bending_stiffness=BEND, torsional_stiffness=TWIST)
    tip, _ = rod_tip(rod, [*force, 0.0, tension * DISTANCE, 0.0], tol=1e-7)
    found = [sr.solve_equilibrium(case.model(count), [tension], wrench=case.wrench).tip_position for count in (8, 16)]
    errors = [np.linalg.norm(one - tip) / LENGTH for one in found]
    assert np.log2(errors[0] / errors[1]) > 1.9
    assert np.linalg.norm((4.0 * found[1] - found[0]) / 3.0 - tip) < 2e-6 * LENGTH  # fourth order remains


@pytest.mark.parametrize("count", [1, 5])
def test_one_tendon_bends_any_number_of_sections_into_its_arc(count: int) -> None:
    """Moment and push are the same everywhere: exact, with the length `l (1 - T / EA) - d theta`; to the solver's tolerance."""
    tension, azimuth = 5.0, 0.7
    case = Case(tuple(ROD), (String.straight(LENGTH, DISTANCE, azimuth),), (tension,))
    found = sr.solve_equilibrium(case.model(count), [tension])
    theta, along = tension * DISTANCE * LENGTH / BEND, LENGTH * (1.0 - tension / AXIAL)
    x, z, _ = elastica_moment_tip(1.0, 1.0, theta)
    assert found.tip_position == pytest.approx(along * np.array([x * np.cos(azimuth), x * np.sin(azimuth), z]), abs=1e-9)
    assert found.muscle_lengths == pytest.approx([along - DISTANCE * theta], abs=1e-10)


def test_a_helical_tendon_makes_a_helix_of_a_stiff_rod() -> None:
    """At small tension T curvature `T d cos(b) / EI` turns with the tendon and twist is `-T d sin(b) / GJ`: an even helix.

    Its pitch angle b is that at rest to 1e-4. Sections of 0.5 rad of winding average the curvature over it: 1 - 0.5^2 / 24.
    """
    winding, tension, count = 40.0, 0.01, 16
    case = Case(tuple(ROD), (String((0.0, LENGTH), (DISTANCE,) * 2, (0.0, winding * LENGTH)),), (tension,))
    strains = sr.solve_equilibrium(case.model(count), [tension]).strains
    middle = winding * LENGTH * (np.arange(count) + 0.5) / count
    pitch = np.arctan(DISTANCE * winding)
    bending = tension * DISTANCE * np.cos(pitch) / BEND
    assert strains[:, 0] == pytest.approx(-bending * np.sin(middle), abs=0.012 * bending)
    assert strains[:, 1] == pytest.approx(bending * np.cos(middle), abs=0.012 * bending)
    assert strains[:, 2] == pytest.approx(-tension * DISTANCE * np.sin(pitch) / TWIST, rel=3e-4)
