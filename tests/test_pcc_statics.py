"""The PCC arm under load: closed forms, an energy written without the package, rods by a boundary-value solve, differences."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import expm, null_space
from scipy.optimize import brentq

import softrobots as sr
from softrobots.constant_curvature import arc_from_muscles, chain_transform
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from tests.support.hinge_places import hinge_places
from tests.support.oracles import central_difference
from tests.support.rods import Rod, elastica_moment_tip, elastica_tip, random_wrenches, rod_tip, steel_rod
from tests.support.tables import each_row

LENGTHS = np.array([0.50, 0.53, 0.55, 0.54, 0.51, 0.52])  # docs/theory.md 2.3, d = 0.04 m
REFERENCE_TIP = (0.44957382, -0.31544214, 0.84384418)
FORCE = np.array([1.0, 2.0, -3.0])
ODD = {
    "segment_lengths": (0.35, 0.25),
    "offset": (0.2, -0.7),
    "muscle_distance": (0.04, 0.03),
    "bending_stiffness": (2.0, 1.3),
    "torsional_stiffness": (1.4, 0.8),
    "axial_stiffness": (2400.0, 1500.0),
    "linear_density": (0.7, 0.4),
}
"""Two segments that differ in everything."""


@cache
def model(muscles: str = "lengths", **fields) -> sr.SoftModel:
    return sr.load_model(sr.PccArm(**fields), muscles=muscles)


def random_lengths(rng: np.random.Generator, arm: sr.PccArm, size: float = 0.06) -> np.ndarray:
    """Lengths of three muscles a segment, each within `size` of its rest length, relative."""
    rest = np.repeat(arm.segment_lengths, len(arm.muscle_azimuths))
    return rest * (1.0 + rng.uniform(-size, size, len(rest)))


def rotation_angle(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(pin.log3(one @ other.T)))


def turn(angle: float, i: int, j: int) -> np.ndarray:
    """Elementary rotation that takes axis i towards axis j, (4, 4)."""
    made = np.eye(4)
    made[i, i] = made[j, j] = np.cos(angle)
    made[j, i], made[i, j] = np.sin(angle), -np.sin(angle)
    return made


def turn_z(angle: float) -> np.ndarray:
    return turn(angle, 0, 1)[:3, :3]


# ---------------------------------------------------------------------------------------------------------------------------
# The arm once more, from its parameters alone: no URDF, no Pinocchio, no map from strains to joints.


class Oracle:
    """Energy of a PCC arm over its section coordinates, shape (sections, 4): rotations about x, y, z [rad], elongation [m].

    Sections are matrix exponentials. Their weight sits at a quarter and three quarters of the rest length along the chord, as
    two rigid halves of a rod have it. Lumped chains are products of elementary turns and rods of rigid links.
    """

    def __init__(self, arm: sr.PccArm) -> None:
        self.arm = arm
        self.n = arm.elastic_sections if arm.chain == "sections" else arm.hinges
        self.h = np.repeat(np.array(arm.segment_lengths) / self.n, self.n)
        stiffness = [
            np.repeat(values, self.n)
            for values in (arm.bending_stiffness, arm.bending_stiffness, arm.torsional_stiffness, arm.axial_stiffness)
        ]
        self.stiffness = np.array(stiffness).T / self.h[:, None]
        rows = []
        for segment, distance in enumerate(arm.muscle_distance):
            for azimuth in arm.muscle_azimuths:  # (20-22): l = l0 + e - d cos(azimuth) b + d sin(azimuth) a
                row = np.zeros((arm.n_segments, self.n, 4))
                row[segment] = (distance * np.sin(azimuth), -distance * np.cos(azimuth), 0.0, 1.0)
                rows.append(row.ravel())
        self.muscles = np.array(rows).reshape(arm.n_actuators, -1)

    def lengths(self, z: np.ndarray) -> np.ndarray:
        """Helices around the backbone; those of hinges to second order in the twist, without the strains beside it."""
        made = []
        for segment, distance in enumerate(self.arm.muscle_distance):
            rows = slice(segment * self.n, (segment + 1) * self.n)
            (a, b, t, e), h = z.reshape(-1, 4)[rows].T, self.h[rows]
            for azimuth in self.arm.muscle_azimuths:
                along, across = h + e + distance * (np.sin(azimuth) * a - np.cos(azimuth) * b), distance * t
                each = along + across**2 / (2.0 * h) if self.arm.chain == "lumped" else np.hypot(along, across)
                made.append(each.sum())
        return np.array(made)

    def poses(self, z: np.ndarray) -> tuple[dict[str, np.ndarray], list[tuple[float, np.ndarray]]]:
        """Frames at the ends of the segments, and (mass, point)s."""
        return self._screws(z) if self.arm.chain == "sections" else self._hinges(z)

    def _screws(self, z: np.ndarray) -> tuple[dict[str, np.ndarray], list[tuple[float, np.ndarray]]]:
        twist = np.zeros((len(z), 4, 4))
        a, b, t = z[:, :3].T
        twist[:, 0, 1], twist[:, 0, 2], twist[:, 1, 0], twist[:, 1, 2], twist[:, 2, 0], twist[:, 2, 1] = -t, b, t, -a, -b, a
        twist[:, 2, 3] = self.h + z[:, 3]
        pose, frames, weights = np.eye(4), {}, []
        for row, motion in enumerate(expm(twist)):
            segment, place = divmod(row, self.n)
            if place == 0:
                pose[:3, :3] = pose[:3, :3] @ turn_z(self.arm.offset[segment])
            start, pose = pose, pose @ motion
            along = (pose - start)[:3, 3] / np.linalg.norm((pose - start)[:3, 3]) * self.h[row] / 4
            mass = self.arm.linear_density[segment] * self.h[row] / 2
            weights += [(mass, start[:3, 3] + along), (mass, pose[:3, 3] - along)]
            if place == self.n - 1:
                frames[f"segment_{segment + 1}"] = pose
        return frames | {"tip": pose}, weights

    def _hinges(self, z: np.ndarray) -> tuple[dict[str, np.ndarray], list[tuple[float, np.ndarray]]]:
        def link(pose: np.ndarray, length: float, segment: int) -> np.ndarray:
            weights.append((self.arm.linear_density[segment] * length, pose[:3, 3] + 0.5 * length * pose[:3, 2]))
            end = pose.copy()
            end[:3, 3] += length * pose[:3, 2]
            return end

        pose, frames, weights = np.eye(4), {}, []
        for segment in range(self.arm.n_segments):
            pose = pose.copy()
            pose[:3, :3] = pose[:3, :3] @ turn_z(self.arm.offset[segment])
            h = self.arm.segment_lengths[segment] / self.n
            heights = h * hinge_places(self.n, self.arm.hinge_rule)
            ends = [*heights[1:], self.arm.segment_lengths[segment]]
            pose = link(pose, heights[0], segment)
            for place in range(self.n):
                row = segment * self.n + place
                a, b, t, e = z[row]
                steps = [turn(a, 1, 2), turn(b, 2, 0), turn(t, 0, 1), np.eye(4)]
                steps[3][2, 3] = e
                for step in steps[::-1] if row % 4 in (1, 2) else steps:
                    pose = pose @ step
                pose = link(pose, ends[place] - heights[place], segment)
            frames[f"segment_{segment + 1}"] = pose
        return frames | {"tip": pose}, weights

    def elastic(self, z: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.stiffness * z * z))

    def energy(self, z: np.ndarray, forces: Mapping[str, np.ndarray], gravity: tuple | None, tensions=None) -> float:
        """Elastic energy, potential of dead forces by frame, of gravity, and of given muscle tensions [J]."""
        frames, weights = self.poses(z)
        total = self.elastic(z) - sum(float(np.dot(force, frames[name][:3, 3])) for name, force in forces.items())
        if gravity is not None:
            total -= sum(mass * float(np.dot(gravity, point)) for mass, point in weights)
        if tensions is not None:
            total += float(tensions @ self.lengths(z))
        return total


def coordinates(found: sr.Equilibrium, oracle: Oracle) -> np.ndarray:
    """Section coordinates of an equilibrium from the strains that it reports."""
    return oracle.h[:, None] * (found.strains - (0.0, 0.0, 0.0, 1.0))


def strains_at(arm: sr.SoftModel, motors: np.ndarray, springs: np.ndarray) -> np.ndarray:
    return arm.structure.section_coordinates(motors, springs)


def test_the_oracle_is_right_about_arcs() -> None:
    """Sections of equal strain are one arc, (9): the oracle against the closed form, to rounding."""
    oracle = Oracle(sr.PccArm())
    arc = arc_from_muscles(LENGTHS.reshape(2, 3), 0.04)
    z = np.zeros((2, 4, 4))
    z[..., 0] = -(arc.bending * np.sin(arc.azimuth) / 4)[:, None]
    z[..., 1] = (arc.bending * np.cos(arc.azimuth) / 4)[:, None]
    z[..., 3] = ((arc.length - 0.524) / 4)[:, None]
    assert np.allclose(oracle.poses(z.reshape(8, 4))[0]["tip"], chain_transform(arc), atol=1e-14)
    assert np.allclose(oracle.lengths(z), LENGTHS, atol=1e-15)


# ---------------------------------------------------------------------------------------------------------------------------
# Without load


def test_reference_tip_without_load() -> None:
    found = sr.solve_equilibrium(model(), LENGTHS)
    assert np.abs(found.tip_position - REFERENCE_TIP).max() < 6e-9  # eight digits are printed
    assert found.stable
    assert found.within_limits


@pytest.mark.parametrize("fields", [{}, {"elastic_sections": 1}, {"elastic_sections": 3, **ODD}])
def test_without_load_lengths_give_the_closed_form_poses(fields: dict, rng: np.random.Generator) -> None:
    arm, robot = model(**fields), sr.PccArm(**fields)
    for _ in range(10):
        lengths = random_lengths(rng, robot, 0.1)
        found = sr.solve_equilibrium(arm, lengths)
        arcs = arc_from_muscles(lengths.reshape(2, 3), np.array(robot.muscle_distance))
        assert np.abs(found.transform_tip_to_world.homogeneous - chain_transform(arcs, robot.offset)).max() < 1e-13  # rounding
        middle = frame_placement(arm, found.q, "segment_1").homogeneous
        first = arc_from_muscles(lengths[:3], robot.muscle_distance[0])
        assert np.abs(middle - chain_transform([first], robot.offset[:1])).max() < 1e-13
        assert np.abs(found.muscle_lengths - lengths).max() < 1e-15
        assert np.abs(found.strains[:, 2]).max() < 1e-15  # no twist


@pytest.mark.parametrize(("rule", "hinges"), [("corrected", (4, 8)), ("midpoint", (4, 8))])
def test_lumped_lengths_give_the_closed_form_pose_in_second_order(rule: str, hinges: tuple, rng: np.random.Generator) -> None:
    """Multiples of four: then the orders of the joints of all hinges cancel."""
    arms = [model(chain="lumped", hinges=n, hinge_rule=rule) for n in hinges]
    for _ in range(2):
        lengths = random_lengths(rng, sr.PccArm(), 0.08)
        exact = chain_transform(arc_from_muscles(lengths.reshape(2, 3), 0.04))
        poses = [sr.solve_equilibrium(arm, lengths).transform_tip_to_world for arm in arms]
        places = np.array([np.linalg.norm(pose.translation - exact[:3, 3]) for pose in poses])
        angles = np.array([rotation_angle(pose.rotation, exact[:3, :3]) for pose in poses])
        assert places[-1] < 1.048 / hinges[-1] ** 2
        assert np.log2(places[:-1] / places[1:]).min() > 1.8
        assert np.log2(angles[:-1] / angles[1:]).min() > 1.8


@pytest.mark.parametrize("fields", [{"elastic_sections": 3}, {"chain": "lumped", "hinges": 3}])
def test_muscle_forces_without_load_in_closed_form(fields: dict, rng: np.random.Generator) -> None:
    """Tension = - d/dl of U = EI/(2 L) theta^2 + EA/(2 L) e^2, with M M^T of three muscles at 120 degrees inverted by hand:

    t_i = - 2 EI / (3 L d^2) (change_i - mean) - EA / (3 L) mean.
    """
    stiffness = {"bending_stiffness": (2.5, 1.1), "axial_stiffness": (1800.0, 900.0), "muscle_distance": (0.04, 0.03)}
    arm = model(**fields, **stiffness)
    for _ in range(5):
        lengths = random_lengths(rng, sr.PccArm(), 0.08)
        change = lengths.reshape(2, 3) - 0.524
        mean = change.mean(axis=1, keepdims=True)
        bending, axial, distance = (np.array(stiffness[name])[:, None] for name in stiffness)
        expected = -2 * bending / (3 * 0.524 * distance**2) * (change - mean) - axial / (3 * 0.524) * mean
        found = sr.solve_equilibrium(arm, lengths)
        assert np.allclose(found.muscle_forces, expected.ravel(), rtol=0, atol=1e-10)  # rounding of 1e3 N/m times 0.04 m
        assert np.array_equal(found.muscle_forces, found.motor_torques)


@pytest.mark.parametrize("azimuths", [(0.3, 1.1, 2.9, -1.4), (0.0, 1.2, 2.5, 3.9, 5.1)])
def test_many_muscles_balance_the_elastic_energy(azimuths: tuple) -> None:
    """More than three tensions are not unique, but A^T t = -K z holds; so does the closed form of the pose."""
    robot = sr.PccArm(muscle_azimuths=azimuths, **ODD)
    arm, oracle = model(muscle_azimuths=azimuths, **ODD), Oracle(robot)
    z = np.tile([0.05, -0.08, 0.0, 0.003], (8, 1)) * np.repeat([1.0, -0.7], 4)[:, None]
    lengths = oracle.lengths(z)
    found = sr.solve_equilibrium(arm, lengths)
    assert np.allclose(coordinates(found, oracle), z, atol=1e-14)
    assert np.allclose(found.muscle_forces @ oracle.muscles, -(oracle.stiffness * z).ravel(), atol=1e-11)
    assert np.allclose(found.transform_tip_to_world.homogeneous, oracle.poses(z)[0]["tip"], atol=1e-13)


# ---------------------------------------------------------------------------------------------------------------------------
# The energy and its derivatives

CASES = [
    ("lengths", {"elastic_sections": 2, **ODD}),
    ("forces", {"elastic_sections": 2, **ODD}),
    ("lengths", {"chain": "lumped", "hinges": 3, **ODD}),
    ("forces", {"chain": "lumped", "hinges": 3, **ODD}),
    ("lengths", {"chain": "lumped", "hinges": 5, "hinge_rule": "midpoint", "torsion": False, **ODD}),
]
NAMES = ["sections-lengths", "sections-forces", "lumped-lengths", "lumped-forces", "midpoint-lengths-no-torsion"]
MID, TIP = np.array([1.5, -2.0, 1.0]), np.array([-1.0, 2.5, -2.0])
POINT_FORCES = {"segment_1": np.r_[MID, np.zeros(3)], "tip": np.r_[TIP, np.zeros(3)]}


def motors_of(rng: np.random.Generator, arm: sr.SoftModel, oracle: Oracle) -> np.ndarray:
    if arm.muscle_input == "forces":
        return rng.uniform(-20, 20, 6)
    lengths: np.ndarray = random_lengths(rng, oracle.arm, 0.05)
    return lengths


@pytest.mark.study
@pytest.mark.parametrize(("muscles", "fields"), CASES, ids=NAMES)
@pytest.mark.parametrize("gravity", [None, (0.5, -1.0, -9.0)])
def test_residual_is_the_derivative_of_an_energy_written_without_the_package(
    muscles: str, fields: dict, gravity: tuple | None, rng: np.random.Generator
) -> None:
    """Away from equilibrium. Differences over 2e-5 rad or m of an energy of about 10 J: rounding 1e-10, truncation less.

    With gravity the slices that tiny links are made of, 1e-4 kg of 2e-4 m each, stand across a joint at places of their own:
    1e-4 kg 10 m/s^2 2e-4 m = 2e-7 N m each, up to seven a section; and up to three of them, 1e-3 N each, on the other side of
    the stretch joint of a lumped hinge."""
    arm, oracle = model(muscles, **fields), Oracle(sr.PccArm(**fields))
    load = Load.of(arm, wrench=POINT_FORCES, gravity=gravity)
    for _ in range(2):
        motors = motors_of(rng, arm, oracle)
        springs = rng.uniform(-0.1, 0.1, arm.n_springs) * np.where(arm.springs.turning, 1.0, 0.02)
        tensions = motors if muscles == "forces" else None

        def energy(y: np.ndarray, motors=motors, tensions=tensions) -> np.ndarray:
            z = strains_at(arm, motors, y)
            return np.array([oracle.energy(z, {"segment_1": MID, "tip": TIP}, gravity, tensions)])

        if muscles == "lengths":  # the free coordinates leave the lengths alone
            assert np.abs(oracle.lengths(strains_at(arm, motors, springs)) - motors).max() < 1e-15
        found = elastic_state(arm, motors, springs, load).residual
        expected = central_difference(energy, springs, 1e-5)[0]
        assert np.abs(expected).max() > 0.1
        stretch = 5e-3 if oracle.arm.chain == "lumped" else 3e-6
        slices = 0.0 if gravity is None else np.where(arm.springs.turning, 3e-6, stretch)
        assert np.all(np.abs(found - expected) < 2e-8 + slices)


@pytest.mark.parametrize(("muscles", "fields"), CASES, ids=NAMES)
def test_tangent_and_coupling_are_derivatives_of_the_residual(muscles: str, fields: dict, rng: np.random.Generator) -> None:
    """Several forces, moments and gravity, away from equilibrium; step 1e-6 of a residual of about 100 N: rounding 1e-8."""
    arm, oracle = model(muscles, **fields), Oracle(sr.PccArm(**fields))
    moments = {"segment_1": np.r_[MID, 0.3, -0.2, 0.4], "tip": np.r_[TIP, -0.2, 0.5, 0.3]}
    for wrench, gravity in ((POINT_FORCES, None), (moments, (0.5, -1.0, -9.0))):
        load = Load.of(arm, wrench=wrench, gravity=gravity)
        motors = motors_of(rng, arm, oracle)
        springs = rng.uniform(-0.1, 0.1, arm.n_springs) * np.where(arm.springs.turning, 1.0, 0.02)
        state = elastic_state(arm, motors, springs, load)
        tangent = central_difference(lambda y, u=motors, w=load: elastic_state(arm, u, y, w).residual, springs)
        coupling = -central_difference(lambda u, y=springs, w=load: elastic_state(arm, u, y, w).residual, motors)
        assert np.abs(state.tangent - tangent).max() < 2e-8 * np.abs(tangent).max()
        assert np.abs(state.load.coupling - coupling).max() < 1e-6 * max(1.0, np.abs(coupling).max())
        assert (np.abs(state.tangent - state.tangent.T).max() < 1e-12 * np.abs(tangent).max()) == load.conservative


@pytest.mark.parametrize("fields", [{"elastic_sections": 2, **ODD}, {"chain": "lumped", "hinges": 3, **ODD}])
def test_tension_is_minus_the_derivative_of_the_total_energy_by_the_length(fields: dict, rng: np.random.Generator) -> None:
    """Castigliano: over solved equilibria, elastic energy and potential of the forces by the oracle. Step 1e-5 m: truncation
    about 1e-5^2 times the third derivative, rounding 1e-15 J / 1e-5 m = 1e-10 N."""
    arm, oracle = model(**fields), Oracle(sr.PccArm(**fields))
    lengths = random_lengths(rng, oracle.arm, 0.05)

    def energy(held: np.ndarray) -> np.ndarray:
        found = sr.solve_equilibrium(arm, held, wrench=POINT_FORCES, tolerance=1e-13)
        return np.array([oracle.energy(coordinates(found, oracle), {"segment_1": MID, "tip": TIP}, None)])

    found = sr.solve_equilibrium(arm, lengths, wrench=POINT_FORCES, tolerance=1e-13)
    assert found.stable
    expected = -central_difference(energy, lengths, 1e-5)[0]
    assert np.abs(found.muscle_forces - expected).max() < 1e-6 * np.abs(expected).max()


def test_forces_in_lengths_out_lengths_in_give_the_same_state_and_tensions(rng: np.random.Generator) -> None:
    """One equilibrium seen from both sides; solved to 1e-13 of about 10 N m, the softest stiffness about 0.3 N m/rad."""
    for fields in ({}, {"chain": "lumped", "hinges": 4, "hinge_rule": "midpoint"}, ODD):
        for _ in range(3):
            tensions, force = rng.uniform(-25, 25, 6), rng.uniform(-1.0, 1.0, 3)
            options = {"wrench": {"segment_1": (0.5, -0.4, 0.3, 0, 0, 0)}, "gravity": (0, 0, 9.81), "tolerance": 1e-13}
            pulled = sr.solve_equilibrium(model("forces", **fields), tensions, force, **options)
            assert pulled.stable
            assert np.array_equal(pulled.muscle_forces, tensions)
            held = sr.solve_equilibrium(model(**fields), pulled.muscle_lengths, force, **options)
            assert np.abs(held.muscle_forces - tensions).max() < 1e-9
            assert np.abs(held.strains - pulled.strains).max() < 1e-10
            assert np.abs(held.q - pulled.q).max() < 1e-11
            assert held.stable  # what is stable under forces is stable with less freedom


def test_held_lengths_are_stable_where_held_forces_are_not() -> None:
    """Pushed down at 10 N, above pi^2 EI / (4 L^2) = 4.3 N of the free column and below pi^2 EI / L_s^2 = 69 N of held ones."""
    free = sr.solve_equilibrium(model("forces"), np.zeros(6), (0, 0, -10.0))
    held = sr.solve_equilibrium(model(), np.full(6, 0.524), (0, 0, -10.0))
    assert held.stable
    assert np.hypot(*held.tip_position[:2]) < 1e-12
    assert np.hypot(*free.tip_position[:2]) > 0.3  # it has left the straight state
    state = elastic_state(model("forces"), np.zeros(6), np.zeros(32), Load.of(model("forces"), (0, 0, -10.0)))
    assert np.linalg.eigvalsh(state.tangent)[0] < 0.0


# ---------------------------------------------------------------------------------------------------------------------------
# Sensitivities


@pytest.mark.parametrize("muscles", ["lengths", "forces"])
def test_maxwell_reciprocity_between_two_places(muscles: str) -> None:
    """What a force at segment 1 along a does to the tip along b, the same force at the tip along b does there along a."""
    arm = model(muscles, **ODD)
    motors = np.array([0.34, 0.355, 0.36, 0.24, 0.26, 0.25]) if muscles == "lengths" else np.array([5.0, -3, 2, -6, 4, 1])

    def places(extra: np.ndarray) -> np.ndarray:
        wrench = {"segment_1": np.r_[MID + extra[:3], 0, 0, 0], "tip": np.r_[TIP + extra[3:], 0, 0, 0]}
        found = sr.solve_equilibrium(arm, motors, wrench=wrench, gravity=sr.EARTH_GRAVITY, tolerance=1e-13)
        return np.r_[frame_placement(arm, found.q, "segment_1").translation, found.tip_position]

    found = central_difference(places, np.zeros(6), 1e-3)
    cross = np.abs(found[:3, 3:]).max()
    assert cross > 1e-4
    assert np.abs(found - found.T).max() < 1e-6 * cross  # differences, as above


# ---------------------------------------------------------------------------------------------------------------------------
# Slender rods

STRAIGHT = {"muscle_azimuths": (), "segment_lengths": (1.0,), "bending_stiffness": 1.0, "torsional_stiffness": 0.8}
ROD = Rod(1.0, 1.0, 0.8, 1e4)


def orders(errors: list[float] | np.ndarray) -> np.ndarray:
    return np.log2(np.asarray(errors)[:-1] / np.asarray(errors)[1:])


def planar_errors(fields: dict, sizes: tuple, expected: tuple, **load) -> tuple[np.ndarray, np.ndarray]:
    """Error of the tip [m] and of its angle [rad] in the x-z plane, for each number of sections or hinges."""
    name, places, angles = "hinges" if fields.get("chain") == "lumped" else "elastic_sections", [], []
    for n in sizes:
        arm = model(**STRAIGHT, **fields, **{name: n})
        pose = sr.solve_equilibrium(arm, (), **load).transform_tip_to_world
        assert abs(pose.translation[1]) < 1e-12  # it stays in its plane
        places.append(np.hypot(pose.translation[0] - expected[0], pose.translation[2] - expected[1]))
        angles.append(abs(np.arctan2(pose.rotation[0, 2], pose.rotation[2, 2]) - expected[2]))
    return np.array(places), np.array(angles)


SECTIONS = {"axial_stiffness": 1e9}  # stretches by 1e-8 of the length: nothing beside the errors below
HINGES = {"chain": "lumped", "torsion": False, "extension": False}


@pytest.mark.study
@pytest.mark.parametrize("force", [2.0, -6.0])
def test_elastica(force: float) -> None:
    """Passive rods converge to Bisshopp and Drucker's elastica in second order; moving the end hinges lowers the error."""
    expected, load = elastica_tip(1.0, 1.0, force), {"force": (force, 0, 0)}
    cases = {"sections": SECTIONS, "midpoint": {**HINGES, "hinge_rule": "midpoint"}, "corrected": HINGES}
    errors = {name: planar_errors(fields, (2, 4, 8, 16), expected, **load) for name, fields in cases.items()}
    for name in ("sections", "midpoint"):
        for error in errors[name]:
            assert orders(error).min() > 1.9, name
    assert np.all(errors["corrected"][0][1:] < errors["midpoint"][0][1:])
    assert orders(errors["corrected"][0]).min() > 1.9
    assert errors["sections"][0][-1] < 1e-3


def test_a_tip_moment_bends_sections_into_an_exact_circle() -> None:
    """Constant strain is the exact solution: one section already has it; hinges have the angle exactly, the place not."""
    expected, load = elastica_moment_tip(1.0, 1.0, 1.5), {"wrench": (0, 0, 0, 0, 1.5, 0)}
    places, angles = planar_errors(SECTIONS, (1, 2, 4), expected, **load)
    assert places.max() < 1e-12
    assert angles.max() < 1e-12
    places, angles = planar_errors({**HINGES, "hinge_rule": "midpoint"}, (2, 4, 8, 16), expected, **load)
    assert orders(places).min() > 1.9
    assert angles.max() < 1e-12


def test_twist_and_stretch_in_closed_form() -> None:
    """Pull and twist along the axis: elongation F L / EA, angle M L / GJ, exactly, for both chains."""
    for fields in ({"elastic_sections": 3}, {"chain": "lumped", "hinges": 4}):
        arm = model(**STRAIGHT, **fields, axial_stiffness=2000.0)
        pose = sr.solve_equilibrium(arm, (), wrench=(0, 0, 30.0, 0, 0, 0.6)).transform_tip_to_world
        assert np.abs(pose.translation - [0, 0, 1.0 + 30.0 / 2000.0]).max() < 1e-12
        assert rotation_angle(pose.rotation, turn_z(0.6 / 0.8)) < 1e-12


SPATIAL = {
    "sections": {},
    "lumped": {"chain": "lumped"},
}


def two_segments(rod: Rod, count: int, **fields) -> sr.SoftModel:
    """A rod as two segments of `count` sections or hinges, so that `segment_1` is its middle."""
    name = "hinges" if fields.get("chain") == "lumped" else "elastic_sections"
    return model(
        segment_lengths=(rod.length / 2,) * 2,
        offset=0.0,
        muscle_azimuths=(),
        bending_stiffness=rod.bending_stiffness,
        torsional_stiffness=rod.torsional_stiffness,
        axial_stiffness=rod.axial_stiffness,
        **fields,
        **{name: count},
    )


@cache
def spatial_answers() -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    pairs = random_wrenches(np.random.default_rng(11), ROD, 3)
    return [(tip, middle, *rod_tip(ROD, tip, middle)) for tip, middle in pairs]


@pytest.mark.study
@pytest.mark.parametrize("name", SPATIAL)
def test_a_rod_in_space_under_forces_and_moments_converges_in_second_order(name: str) -> None:
    """Tip and middle wrench, bending, torsion and stretch against Kirchhoff's equations, bends of up to 90 degrees.

    Orders of the root mean square over the loads: in a single one terms of second order may nearly cancel."""
    places, angles = np.zeros((2, 3)), np.zeros((2, 3))
    for row, n in enumerate((8, 16)):
        arm = two_segments(ROD, n, **SPATIAL[name])
        for column, (tip, middle, position, rotation) in enumerate(spatial_answers()):
            found = sr.solve_equilibrium(arm, (), wrench={"segment_1": middle, "tip": tip})
            pose = found.transform_tip_to_world
            places[row, column] = np.linalg.norm(pose.translation - position)
            angles[row, column] = rotation_angle(pose.rotation, rotation)
            assert abs(pin.log3(rotation)[2]) > 0.02  # there is torsion in it
    assert orders(np.sqrt((places**2).mean(axis=1)))[0] > 1.8
    assert orders(np.sqrt((angles**2).mean(axis=1)))[0] > 1.8
    assert places[1].max() < 2e-3
    assert angles[1].max() < 4e-3


@pytest.mark.study
@pytest.mark.parametrize(("gravity", "tilt"), [((0, 0, -9.81), 0.3), ((6.0, -3.0, 0.0), 0.0)])
@pytest.mark.parametrize("name", SPATIAL)
def test_self_weight_is_that_of_a_heavy_rod(name: str, gravity: tuple, tilt: float) -> None:
    """Linear density times gravity as a load per length, with a small side force."""
    force, density = np.array([tilt, 0.5 * tilt, 0, 0, 0, 0]), 0.6
    position, rotation = rod_tip(ROD, force, gravity_load=density * np.array(gravity))
    places, angles = [], []
    for n in (4, 8):
        arm = two_segments(ROD, n, **SPATIAL[name])
        pose = sr.solve_equilibrium(arm, (), wrench=force, gravity=gravity).transform_tip_to_world
        places.append(np.linalg.norm(pose.translation - position))
        angles.append(rotation_angle(pose.rotation, rotation))
    assert np.linalg.norm(position - [0, 0, 1.0]) > 0.1
    assert places[1] < 1.5e-3
    assert orders(places)[0] > 1.8
    assert orders(angles)[0] > 1.8


@pytest.mark.study
def test_a_steel_rod_of_50_links_is_right_to_a_tenth_of_a_millimetre() -> None:
    """A spring-steel rod of 0.6 m, bent by up to 90 degrees; 50 sub-links lumped, or 30 sections."""
    rod = steel_rod()
    pairs = random_wrenches(np.random.default_rng(2026), rod, 4)
    exact = [rod_tip(rod, tip, middle, tol=1e-7)[0] for tip, middle in pairs]  # right to 1e-9 m
    for count, fields in ((25, {"chain": "lumped", "extension": False}), (15, {})):
        arm = two_segments(rod, count, **fields, radius=0.8e-3)
        errors = []
        for (tip, middle), position in zip(pairs, exact, strict=True):
            found = sr.solve_equilibrium(arm, (), wrench={"segment_1": middle, "tip": tip})
            assert found.stability.kind in ("stable", "flutter")
            errors.append(np.linalg.norm(found.tip_position - position))
        assert np.mean(errors) <= 1e-4
        assert np.max(errors) < 3e-4


# ---------------------------------------------------------------------------------------------------------------------------
# Buckling


@pytest.mark.study
@pytest.mark.parametrize(
    "fields", [{"axial_stiffness": 1e7}, {"chain": "lumped", "hinge_rule": "midpoint", "extension": False}]
)
def test_euler_buckling(fields: dict) -> None:
    """A clamped free column buckles at pi^2 EI / (4 L^2); EA = 1e7 N changes that by 2.5e-7. Second order in n."""
    name = "hinges" if "chain" in fields else "elastic_sections"
    expected, errors = np.pi**2 / 4, []
    for n in (3, 6, 12):
        arm = model(**(STRAIGHT | fields | {name: n}))
        errors.append(abs(sr.critical_load(arm, (), (0, 0, -1), max_force=5.0) / expected - 1.0))
    assert errors[-1] < 1 / 12**2
    assert orders(errors).min() > 1.9


def test_compressible_column_buckles_where_engesser_says() -> None:
    """Extensible elastica: P (1 - P / EA) = pi^2 EI / (4 L^2); at EA = 50 N the push shortens the column by 5 %."""
    arm = model(**STRAIGHT, elastic_sections=8, axial_stiffness=50.0)
    expected = 25.0 * (1.0 - np.sqrt(1.0 - np.pi**2 / 50.0))
    found = sr.critical_load(arm, (), (0, 0, -1), max_force=5.0)
    assert found == pytest.approx(expected, rel=5e-3)  # 1/(3 n^2)
    assert abs(found - np.pi**2 / 4) > 10 * abs(found - expected)


def test_held_muscles_buckle_later() -> None:
    """Held lengths hold the angle between the ends of a segment: clamped and guided, pi^2 EI / L^2, four times as much."""
    arm = {"segment_lengths": (0.5,), "axial_stiffness": 1e7}
    passive = sr.critical_load(model(**arm, muscle_azimuths=()), (), (0, 0, -1), max_force=100.0)
    errors = []
    for n in (4, 8):
        held = sr.critical_load(model(**arm, elastic_sections=n), np.full(3, 0.5), (0, 0, -1), max_force=200.0)
        errors.append(abs(held / (np.pi**2 * 1.92 / 0.5**2) - 1.0))
        assert held > 3.5 * passive
    assert errors[1] < 2e-2
    assert orders(errors)[0] > 1.9


# ---------------------------------------------------------------------------------------------------------------------------
# Invariance


@pytest.mark.parametrize("gravity", [None, (0, 0, 9.81)])
@pytest.mark.parametrize("muscles", ["lengths", "forces"])
def test_turning_the_load_by_the_symmetry_of_the_muscles_turns_the_answer(
    muscles: str, gravity: tuple | None, rng: np.random.Generator
) -> None:
    """+120 degrees about z: the muscle at 0 takes the place of the third, the third that of the second, that of the first.

    To the solver's 1e-13."""
    arm, turning, after, allowed = model(muscles), turn_z(2 * np.pi / 3), [1, 2, 0, 4, 5, 3], 1e-10
    for _ in range(3):
        motors = random_lengths(rng, sr.PccArm(), 0.05) if muscles == "lengths" else rng.uniform(-20, 20, 6)
        mid, tip = rng.uniform(-1, 1, 6) * (1, 1, 1, 0.1, 0.1, 0.1), rng.uniform(-1, 1, 6) * (1, 1, 1, 0.1, 0.1, 0.1)
        both = np.kron(np.eye(2), turning)
        options = {"gravity": gravity, "tolerance": 1e-13}
        one = sr.solve_equilibrium(arm, motors, wrench={"segment_1": mid, "tip": tip}, **options)
        other = sr.solve_equilibrium(arm, motors[after], wrench={"segment_1": both @ mid, "tip": both @ tip}, **options)
        pose, turned = one.transform_tip_to_world, other.transform_tip_to_world
        assert one.stability.kind in ("stable", "flutter")
        assert np.abs(turned.translation - turning @ pose.translation).max() < allowed
        assert np.abs(turned.rotation - turning @ pose.rotation @ turning.T).max() < allowed
        assert np.abs(other.muscle_forces - one.muscle_forces[after]).max() < 100 * allowed  # about 100 N/m
        assert np.abs(other.muscle_lengths - one.muscle_lengths[after]).max() < allowed


def test_one_section_a_segment_leaves_only_twist() -> None:
    """Pure constant curvature: a force in the plane moves nothing; a torque about the axis twists by M L / GJ."""
    arm = model(elastic_sections=1)
    assert arm.spring_joints == ("section_1_1_twist", "section_2_1_twist")
    assert arm.stiffness == pytest.approx([1.28 / 0.524] * 2)
    rest = np.full(6, 0.524)
    assert sr.solve_equilibrium(arm, rest, (3.0, 2.0, 5.0)).tip_position == pytest.approx([0, 0, 1.048], abs=1e-15)
    twisted = sr.solve_equilibrium(arm, rest, wrench=(0, 0, 0, 0, 0, 0.5))

    def torque(rate: float) -> float:  # the muscles become helices, and compress the backbone to nu
        nu = np.sqrt(1.0 - (0.04 * rate) ** 2)
        return float(1.28 * rate + 2400.0 * (1.0 - nu) * 0.04**2 * rate / nu)

    rate = brentq(lambda rate: torque(rate) - 0.5, 0.0, 1.0, xtol=1e-15)
    assert twisted.q_springs == pytest.approx([rate * 0.524] * 2, rel=1e-12)
    assert rate < 0.5 / 1.28 * (1.0 - 1e-4)
    bent = sr.solve_equilibrium(arm, LENGTHS, FORCE)
    around = 0.04 * 0.524 * bent.strains[:, 2:3]
    arcs = arc_from_muscles(np.sqrt(LENGTHS.reshape(2, 3) ** 2 - around**2), 0.04)
    assert np.abs(bent.strains[:, 0] * 0.524 + arcs.bending * np.sin(arcs.azimuth)).max() < 1e-13
    assert np.abs(bent.strains[:, 1] * 0.524 - arcs.bending * np.cos(arcs.azimuth)).max() < 1e-13
    assert np.abs(bent.strains[:, 3] * 0.524 - arcs.length).max() < 1e-13
    assert np.abs(bent.strains[:, 2]).max() > 0.01


# ---------------------------------------------------------------------------------------------------------------------------
# Load estimation and files


@pytest.mark.study
def test_noise_of_the_tensions_spreads_as_the_covariance_says(rng: np.random.Generator) -> None:
    """60 noisy measurements; the scatter of a standard deviation over 60 is 9 %, five times that is allowed."""
    arm, std = model(elastic_sections=2), 0.02
    truth = sr.solve_equilibrium(arm, LENGTHS, FORCE, tolerance=1e-13)
    noisy = [truth.muscle_forces + std * rng.normal(size=6) for _ in range(60)]
    estimates = [sr.estimate_load(arm, LENGTHS, tensions, torque_std=std, restart=False) for tensions in noisy]
    spread = np.array([estimate.force - FORCE for estimate in estimates])
    whitened = spread @ np.linalg.inv(np.linalg.cholesky(estimates[0].covariance)).T
    assert np.abs(whitened.std(axis=0) - 1.0).max() < 0.45


def test_given_forces_feel_no_load() -> None:
    with pytest.raises(sr.ParameterError, match="muscles of given length"):
        sr.estimate_load(model("forces"), np.zeros(6), np.zeros(6))


@pytest.mark.parametrize("change", [1e-6, 0.01])
def test_a_tampered_muscle_length_is_refused(change: float, tmp_path: Path) -> None:
    file = sr.save_result(sr.solve_equilibrium(model(), LENGTHS, FORCE), tmp_path / "a.npz")
    with np.load(file) as data:
        fields = dict(data)
    fields["q_motors"] = fields["q_motors"] + [change, 0, 0, 0, 0, 0]
    np.savez(tmp_path / "b.npz", **fields)
    with pytest.raises(sr.FileFormatError, match="claims a residual"):
        sr.load_result(tmp_path / "b.npz")


def test_inconsistent_lengths_in_a_file_are_refused(tmp_path: Path) -> None:
    arm = model(muscle_azimuths=(0.0, 1.2, 2.5, 4.0))
    file = sr.save_result(sr.solve_equilibrium(arm, np.full(8, 0.52)), tmp_path / "a.npz")
    with np.load(file) as data:
        fields = dict(data)
    fields["q_motors"] = fields["q_motors"] + [[0.01, 0, 0, 0, 0, 0, 0, 0]]
    np.savez(tmp_path / "b.npz", **fields)
    with pytest.raises(sr.FileFormatError, match="segment 1"):
        sr.load_result(tmp_path / "b.npz")


# ---------------------------------------------------------------------------------------------------------------------------
# What is refused


@pytest.mark.parametrize("azimuths", [(0.0, np.pi / 2, np.pi, -np.pi / 2), (0.1, 1.0, 2.2, 3.7, 5.0)])
@pytest.mark.parametrize("segment", [1, 2])
def test_lengths_that_no_arc_explains_name_their_segment(azimuths: tuple, segment: int) -> None:
    """More than three muscles: 1e-6 m beside an arc is allowed, more is not. The misfit here is along the null space of the
    arms, computed afresh, so that all of it misses."""
    arm, count = model(muscle_azimuths=azimuths), len(azimuths)
    oracle = Oracle(sr.PccArm(muscle_azimuths=azimuths))
    z = np.tile([0.03, 0.05, 0.0, -0.002], (8, 1))
    lengths = oracle.lengths(z)
    arms = np.column_stack([np.sin(azimuths), np.cos(azimuths), np.ones(count)])
    beside = null_space(arms.T)[:, 0]
    beside /= np.abs(beside).max()
    miss = np.zeros(2 * count)
    miss[(segment - 1) * count : segment * count] = beside
    assert sr.solve_equilibrium(arm, lengths + 0.9e-6 * miss).stable
    with pytest.raises(sr.ParameterError, match=f"segment {segment} miss the nearest arc by 1.1e-06 m") as caught:
        sr.solve_equilibrium(arm, lengths + 1.1e-6 * miss)
    assert caught.value.field == "q_motors"


@each_row(
    ("motors", "message"),
    [
        (LENGTHS[:5], r"q_motors.*shape \(5,\)"),
        (np.r_[LENGTHS, 0.5], r"q_motors.*shape \(7,\)"),
        (LENGTHS.reshape(2, 3), "q_motors"),
        (np.r_[LENGTHS[:5], np.nan], "q_motors.*finite"),
        (np.r_[LENGTHS[:5], 0.0], r"q_motors.*positive muscle lengths \[m\]"),
        (np.r_[-0.5, LENGTHS[1:]], "q_motors.*positive muscle lengths"),
        # theta = 2 change / (3 d) for one muscle: 12.5 and 13.3 rad, over four sections more than 170 degrees each
        (np.r_[0.05, 0.8, 0.8, LENGTHS[3:]], "q_motors.*segment 1 would bend by .* rad a section"),
        (np.r_[LENGTHS[:3], 1.0, 1.0, 0.2], "q_motors.*segment 2 would bend by .* rad a section"),
    ],
)
def test_bad_lengths_are_refused(motors: np.ndarray, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.solve_equilibrium(model(), motors)


def test_the_largest_bending_is_170_degrees_a_section() -> None:
    """Three muscles, one longer by c and two shorter by c / 2: theta = c / d over the segment."""
    shape, arm = np.array([1.0, -0.5, -0.5]), model(elastic_sections=1)
    change = 0.04 * np.deg2rad(170.0)
    for factor, fine in ((0.999, True), (1.001, False)):
        lengths = np.r_[0.524 + factor * change * shape, 0.524, 0.524, 0.524]
        if fine:
            found = sr.solve_equilibrium(arm, lengths)
            assert np.hypot(*found.strains[0, :2]) * 0.524 == pytest.approx(factor * np.deg2rad(170.0))
        else:
            with pytest.raises(sr.ParameterError, match=r"by 2\.97 rad a section, allowed 2\.967 rad"):
                sr.solve_equilibrium(arm, lengths)
    assert sr.solve_equilibrium(model(), np.r_[0.524 + 1.001 * change * shape, 0.524, 0.524, 0.524]).stable  # four sections may


@each_row("motors", [np.zeros(5), np.zeros(7), np.full(6, np.inf), None])
def test_bad_forces_are_refused(motors: np.ndarray | None) -> None:
    with pytest.raises(sr.ParameterError, match="q_motors"):
        sr.solve_equilibrium(model("forces"), motors)


def test_a_chain_without_stretch_refuses_lengths_that_need_it() -> None:
    arm = model(chain="lumped", hinges=3, extension=False)
    bent = np.array([0.524 - 0.01, 0.524 + 0.004, 0.524 + 0.006, 0.524, 0.524, 0.524])  # the mean stays
    found = sr.solve_equilibrium(arm, bent, FORCE)
    assert found.stable
    longer = (
        0.04**2 * (0.524 / 3) * (found.strains[:, 2] ** 2).reshape(2, 3).sum(axis=1) / 2
    )  # all three, and nothing gives way
    assert found.muscle_lengths == pytest.approx(bent + np.repeat(longer, 3), abs=1e-14)
    assert np.abs(found.strains[:, 3] - 1.0).max() == 0.0
    with pytest.raises(sr.ParameterError, match=r"without elongation.*segment 2 miss the nearest arc by 0\.002 m"):
        sr.solve_equilibrium(arm, bent + [0, 0, 0, 0.002, 0.002, 0.002])


@each_row("choice", ["pressure", "", True, 1])
def test_an_unknown_choice_of_muscles_is_refused(choice: object) -> None:
    with pytest.raises(sr.ParameterError, match=r"muscles.*'lengths', 'forces'"):
        sr.load_model(sr.PccArm(), muscles=choice)
