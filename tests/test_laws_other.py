"""Laws of what the models are made of: checks, paths in time, grids, screws, sections, springs, muscles, growth, names."""

from __future__ import annotations

import csv
import io
import itertools
import math
import pickle
import re
import tempfile
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from xml.dom import minidom

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.compiled.sweeps import TargetGrid
from softrobots.constant_curvature.screws import Screw
from softrobots.constant_curvature.strain_chain import in_range, joint_positions
from softrobots.constant_curvature.stumpff import stumpff
from softrobots.core import checks, errors
from softrobots.core.files import csv_text, write_text
from softrobots.core.vectors import skew
from softrobots.description.renaming import prefix_names, shift_segments, used_names
from softrobots.model.actuators import Actuators
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.springs import SpringGroup, Springs
from softrobots.statics.displacement_control import Probe, face_normal, touch
from softrobots.statics.workspace_map import required_pressures
from studies.shared.markdown import marked
from tests.support.law_robots import muscle_lengths
from tests.support.laws import law

numbers_ = st.floats(-1e3, 1e3)


def without_traces(numbers: np.ndarray) -> np.ndarray:
    """Numbers whose squares do not vanish in rounding, or zero: scaling changes no digit of them."""
    return np.where(np.abs(numbers) < 1e-100, 0.0, numbers)


triples_ = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)
seeds_ = st.integers(0, 2**32 - 1)


# --- Checks


NUMBER_CHECKS = {
    checks.finite_number: (-checks.LARGEST, checks.LARGEST),
    checks.positive_number: (1.0 / checks.LARGEST, checks.LARGEST),
    checks.non_negative_number: (0.0, checks.LARGEST),
}
ARRAY_CHECKS = {
    checks.positive_array: NUMBER_CHECKS[checks.positive_number],
    checks.non_negative_array: NUMBER_CHECKS[checks.non_negative_number],
}


@settings(max_examples=60)
@given(st.one_of(st.floats(), st.integers(), st.fractions(), st.sampled_from([1e30, -1e30, 1e-30, 5e-324, -0.0, 10**400])))
def test_a_number_comes_back_as_it_is_or_is_refused(value: float | Fraction) -> None:
    """Each check takes what is in its range, alone or in an array, and nothing else."""
    for check, (low, high) in NUMBER_CHECKS.items():
        if low <= value <= high:
            assert check("length", value, "m") == float(value)
        else:
            with pytest.raises(sr.ParameterError, match=r"^length = "):
                check("length", value, "m")
    if isinstance(value, Fraction) or (isinstance(value, int) and abs(value) >= 2**63):
        return  # NumPy has no such numbers
    for check, (low, high) in ARRAY_CHECKS.items():
        if low <= value <= high:
            found = check("length", [[value, 1.0]], "m")
            assert found.dtype == np.float64
            assert found.tolist() == [[float(value), 1.0]]
        else:
            with pytest.raises(sr.ParameterError, match=r"^length = "):
                check("length", [[value, 1.0]], "m")


@settings(max_examples=30)
@given(st.lists(numbers_, max_size=4), st.lists(st.one_of(st.none(), st.integers(0, 4)), max_size=3).map(tuple))
def test_an_array_comes_back_with_its_shape_or_is_refused(values: list[float], shape: tuple[int | None, ...]) -> None:
    given_ = np.array(values)
    fits = len(shape) == 1 and shape[0] in (None, len(values))
    if fits:
        found = checks.finite_array("x", given_, shape)
        assert np.array_equal(found, given_)
        assert not np.shares_memory(found, given_)
    else:
        with pytest.raises(sr.ParameterError, match=r"it has shape"):
            checks.finite_array("x", given_, shape)
    rises = bool(np.all(np.diff(given_) > 0.0))
    if rises:
        assert checks.increasing("x", given_, "m") is given_
    else:
        with pytest.raises(sr.ParameterError, match="increasing"):
            checks.increasing("x", given_, "m")


@settings(max_examples=30)
@given(triples_)
def test_a_direction_has_length_one_and_no_other_direction(vector: np.ndarray) -> None:
    if not vector.any():
        with pytest.raises(sr.ParameterError, match="different from zero"):
            checks.unit_vector("direction", vector)
        return
    assume(np.abs(vector).max() > 1e-150)  # below, a square is lost
    unit = checks.unit_vector("direction", vector)
    assert np.linalg.norm(unit) == pytest.approx(1.0, rel=1e-15)
    assert np.allclose(np.cross(unit, vector), 0.0, rtol=0.0, atol=1e-15 * np.abs(vector).max())
    assert unit @ vector > 0.0


ERRORS = [name for name in sr.__all__ if name in vars(errors)]


@pytest.mark.study
@law(*ERRORS)
@settings(max_examples=8)
@given(st.text())
def test_an_error_crosses_to_another_process_as_it_is(text: str) -> None:
    """Message, kind and facts; and whatever text is in it, it can be told."""
    plain = (
        *(sr.SoftRobotsError, sr.DescriptionError, sr.StraightTube, sr.NeutralEquilibrium, sr.OutputError, sr.OutputExists),
        *(sr.FileFormatError, sr.ClusterError, sr.ViewerError),
    )
    unsolved = (sr.NotConverged, sr.EquilibriumNotFound, sr.LoadNotFound, sr.TargetUnreachable)
    made = [
        *(kind(text) for kind in plain),
        *(kind(text, best=None, residual=0.1, iterations=3) for kind in unsolved),
        sr.ParameterError("radius", text, "positive"),
        sr.NameNotFound("frame", text, ("tip", "base")),
        sr.FieldNotFound("field of InflatableArm", text, ("radius",)),
        sr.SelfIntersection(text, contact=None),
        sr.NoCriticalLoad(text, max_force=1.0),
        sr.MissingDependency(text, "plot"),
    ]
    assert {type(error).__name__ for error in made} == set(ERRORS)
    for error in made:
        assert isinstance(error, sr.SoftRobotsError)
        other = pickle.loads(pickle.dumps(error))
        assert type(other) is type(error)
        assert (str(other), other.args, vars(other)) == (str(error), error.args, vars(error))


@law("core.errors.short")
@given(st.one_of(st.text(), st.binary(), st.lists(st.floats()), st.dictionaries(st.text(), st.integers())), st.integers(8, 90))
def test_a_shortened_value_is_one_line_of_bounded_length(value: object, longest: int) -> None:
    text, whole = errors.short(value, longest), repr(value)
    assert "\n" not in text
    assert text == whole if len(whole) <= longest else whole.startswith(text.removesuffix("...")) and len(text) == longest


# --- Time and space


@law("quintic")
@settings(max_examples=40)
@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_quintic_is_symmetric_rises_and_starts_gently(share: float, other: float) -> None:
    """`q(1 - s) = 1 - q(s)`; its slope is `30 s^2 (1 - s)^2`, between 0 and 15/8."""
    value = float(sr.quintic(share))
    rounding = 4e-15  # of three terms up to 15
    assert float(sr.quintic(1.0 - share)) == pytest.approx(1.0 - value, abs=rounding)
    low, high = sorted((share, other))
    way = float(sr.quintic(high) - sr.quintic(low))
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact for a slope of degree 4
    s = 0.5 * (low + high) + 0.5 * (high - low) * nodes
    assert way == pytest.approx(0.5 * (high - low) * float(weights @ (30.0 * s**2 * (1.0 - s) ** 2)), abs=rounding)
    assert -rounding <= way <= 15.0 / 8.0 * (high - low) + rounding


@law("straight_line", "Path3D")
@settings(max_examples=30)
@given(triples_, triples_, st.floats(0.1, 100.0), st.integers(1, 50))
def test_a_straight_line_is_walked_the_same_both_ways(start: np.ndarray, end: np.ndarray, duration: float, steps: int) -> None:
    there, back = sr.straight_line(start, end, duration, steps), sr.straight_line(end, start, duration, steps)
    assert isinstance(there, sr.Path3D)
    assert there.positions.shape == (steps + 1, 3)
    assert np.array_equal(there.positions[0], start)
    assert np.allclose(there.positions[-1], end, rtol=0.0, atol=1e-15)
    assert np.allclose(there.positions, back.positions[::-1], rtol=0.0, atol=2e-14)
    assert np.allclose(np.cross(there.positions - start, end - start), 0.0, rtol=0.0, atol=2e-14)  # of a way of up to 7 m
    assert (there.times[0], there.times[-1]) == (0.0, duration)
    assert np.all(np.diff(there.times) > 0.0)


@law("waypoints", "read_waypoints")
@settings(max_examples=20)
@given(
    st.lists(triples_, min_size=2, max_size=6), st.lists(st.floats(1e-3, 10.0), min_size=6, max_size=6), st.permutations("txyz")
)
def test_waypoints_come_back_from_a_file_whatever_its_columns(points: list, steps: list[float], order: list[str]) -> None:
    times = np.cumsum(steps)[: len(points)]
    path = sr.waypoints(points, times)
    table = dict(zip("txyz", np.column_stack([path.times, path.positions]).T.tolist(), strict=True))
    text = csv_text([*order, "other"], zip(*(table[name] for name in order), itertools.repeat("7", len(points)), strict=True))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "way.csv"
        file.write_text(text, encoding="utf-8")
        read = sr.read_waypoints(file)
    assert np.array_equal(read.positions, points)
    assert np.array_equal(read.times, times)


@settings(max_examples=20)
@given(
    st.lists(
        st.tuples(numbers_, st.text(st.characters(exclude_characters="\r\n\x00", categories=["L", "N", "S", "Z", "P", "Cs"])))
    )
)
def test_a_table_comes_back_from_its_text(rows: list[tuple[float, str]]) -> None:
    """Unless half of a surrogate pair is in it, which no file can hold: an error of ours, and no file."""
    written = csv_text(("one", "two"), rows)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.csv"
        if any("\ud800" <= letter <= "\udfff" for letter in written):
            with pytest.raises(sr.OutputError, match="cannot write"):
                write_text(file, written, overwrite=False)
            assert not any(file.parent.iterdir())
            return
        read = write_text(file, written, overwrite=False).read_bytes().decode("utf-8")
    names, *lines = list(csv.reader(io.StringIO(read, newline="")))
    assert names == ["one", "two"]
    assert [(float(one), two) for one, two in lines] == rows


@law("compiled.sweeps.TargetGrid")
@settings(max_examples=20)
@given(st.floats(1e-3, 1e3), st.integers(1, 12))
def test_cells_of_a_grid_fill_it_once(reach: float, cells: int) -> None:
    plane, box = TargetGrid.plane(reach, cells), TargetGrid.box(reach, min(cells, 5))
    for grid in (plane, box):
        width = 2.0 * float(grid.z[-1]) / (len(grid.z) - 1)  # from the first to the last centre
        assert np.array_equal(grid.z, -grid.z[::-1])
        assert float(grid.z[-1]) + 0.5 * width == pytest.approx(reach, rel=1e-14)
        assert np.allclose(np.diff(grid.z), width, rtol=1e-12)
        assert grid.targets.shape == (math.prod(grid.shape), 3)
        assert np.array_equal(grid.targets.reshape(*grid.shape, 3)[0, 0, :, 2], grid.z)
        assert len(np.unique(grid.targets, axis=0)) == len(grid.targets)
    assert np.array_equal(plane.x, plane.z[cells:])
    again = TargetGrid(*(np.unique(box.targets[:, axis]) for axis in range(3)))
    assert np.array_equal(again.targets, box.targets)


# --- Screws and sections


@settings(max_examples=40)
@given(st.floats(0.0, 1e4), st.integers(1, 7))
def test_stumpff_functions_are_sine_and_cosine_and_their_remainders(x: float, highest: int) -> None:
    """`c_k = 1/k! - x c_{k+2}`, and every one is between 0 and 1/k! from the second on."""
    found = stumpff(np.array([x, 0.0]), highest)
    angle = math.sqrt(x)
    assert found[0, 0] == pytest.approx(math.cos(angle), abs=1e-14)
    assert angle * found[1, 0] == pytest.approx(math.sin(angle), abs=1e-13)
    for k in range(highest - 1):
        assert found[k, 0] == pytest.approx(1.0 / math.factorial(k) - x * found[k + 2, 0], abs=1e-13)
    for k in range(2, highest + 1):
        assert 0.0 <= found[k, 0] <= 1.0 / math.factorial(k)
        assert found[k, 1] == 1.0 / math.factorial(k)


sections_ = st.tuples(*[st.floats(-2.0, 2.0)] * 3, st.floats(-0.3, 1.0)).map(np.array).map(without_traces)


@settings(max_examples=40)
@given(sections_, st.floats(0.5, 2.0), st.floats(0.05, 0.95), triples_)
def test_parts_of_a_screw_make_the_screw(z: np.ndarray, h: float, cut: float, spin: np.ndarray) -> None:
    """A section cut anywhere is the same; turned about its own axis, so is its end; sizes scale."""

    def pose(coordinates: np.ndarray, rest: float) -> np.ndarray:
        end = Screw(coordinates, rest)
        made = np.eye(4)
        made[:3, :3], made[:3, 3] = end.rotation, end.position
        return made

    whole = pose(z, h)
    close = {"rtol": 0.0, "atol": 1e-14 * (1.0 + h + z[3])}
    assert np.allclose(pose(cut * z, cut * h) @ pose((1.0 - cut) * z, (1.0 - cut) * h), whole, **close)
    turn = np.eye(4)
    turn[:2, :2] = [[math.cos(spin[0]), -math.sin(spin[0])], [math.sin(spin[0]), math.cos(spin[0])]]
    turned = np.concatenate([turn[:3, :3] @ z[:3], z[3:]])
    assert np.allclose(turn @ whole @ turn.T, pose(turned, h), **close)
    large = pose(np.array([*z[:3], 4.0 * z[3]]), 4.0 * h)
    assert np.array_equal(large[:3, :3], whole[:3, :3])
    assert np.array_equal(large[:3, 3], 4.0 * whole[:3, 3])
    assert np.allclose(skew(spin) @ z[:3], np.cross(spin, z[:3]), rtol=0.0, atol=1e-15)


@settings(max_examples=40)
@given(sections_, st.floats(0.5, 2.0))
def test_joints_of_a_section_are_similar_and_mirrored(z: np.ndarray, h: float) -> None:
    """In the plane y-z the section bends the other way: about y and z the other sign; larger ones have a longer chord only."""
    assume(in_range(z, h))
    joints = joint_positions(z, h)
    mirrored, large = z * [1.0, -1.0, -1.0, 1.0], z * [1.0, 1.0, 1.0, 8.0]
    assert in_range(mirrored, h)
    assert np.allclose(joint_positions(mirrored, h), joints * [1.0, -1.0, 1.0, 1.0, -1.0, -1.0], rtol=0.0, atol=1e-12)
    assert in_range(large, 8.0 * h)
    assert np.array_equal(joint_positions(large, 8.0 * h), joints * [1.0, 1.0, 8.0, 1.0, 1.0, 1.0])
    assert 0.0 < joints[2] <= h + z[3] + 1e-15  # the chord is no longer than the section


# --- Springs


@settings(max_examples=40)
@given(seeds_, st.floats(0.1, 10.0), st.integers(-8, 8).map(lambda power: 2.0**power))
def test_springs_scale_and_are_no_harder_on_a_plateau(seed: int, bend: float, factor: float) -> None:
    """Stiffness and plateau times a factor, so energy and torque; energies of a limp link are below those of a linear one."""
    random = np.random.default_rng(seed)
    linear = Springs(tuple("abcd"), random.uniform(10.0, 200.0, 4), random.uniform(-0.1, 0.1, 4), np.ones(4, dtype=bool))
    k, most = float(linear.stiffness[1]), 0.3 * float(linear.stiffness[1])
    linear.stiffness[2] = k
    y = linear.rest + bend * random.uniform(-1.0, 1.0, 4)
    limp = replace(linear, groups=(SpringGroup((1, 2), 0.05, 1e4, None, most),))
    harder = replace(linear, stiffness=factor * linear.stiffness)
    stiff = replace(harder, groups=(SpringGroup((1, 2), 0.05, 1e4, None, factor * most),))
    for law_, other in ((linear, harder), (limp, stiff)):
        for one, two in zip(law_.at(y), other.at(y), strict=True):
            assert np.allclose(np.multiply(factor, one), two, rtol=1e-15, atol=0.0)
        assert law_.saturated(y) == other.saturated(y)
    (energy, torque, tangent), (all_, pull, full) = limp.at(y), linear.at(y)
    assert energy <= all_ * (1.0 + 1e-15)
    assert math.hypot(torque[1], torque[2]) <= most * (1.0 + 1e-15) or not limp.saturated(y)
    assert np.array_equal(torque[[0, 3]], pull[[0, 3]])
    assert np.linalg.eigvalsh(tangent).min() >= -1e-12 * k
    assert np.linalg.eigvalsh(full - tangent).min() >= -1e-12 * k
    assert limp.saturated(y) == (frozenset({1, 2}) if k * math.hypot(*(y - linear.rest)[1:3]) > most else frozenset())


@cache
def paper_arm() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm())


@settings(max_examples=20)
@given(st.lists(st.floats(-0.3, 0.3), min_size=4, max_size=4), st.floats(0.1, 3.0))
def test_a_link_needs_the_pressure_of_its_moment(springs: list[float], factor: float) -> None:
    """Both springs of a link together, in whatever direction it is bent; in proportion to the bending."""
    arm, q = paper_arm(), np.array(springs)
    found = required_pressures(arm, q[None])[0]
    for group, pressure in zip(arm.spring_groups, found, strict=True):
        moment = math.hypot(*(arm.stiffness[place] * q[place] for place in group.springs))
        assert pressure == pytest.approx(inflated_beam.required_pressure(moment, group.radius), rel=1e-14)
    assert np.allclose(required_pressures(arm, factor * q[None])[0], factor * found, rtol=1e-14)


# --- Muscles


@cache
def four_muscles() -> sr.SoftModel:
    """Two segments, four muscles each, so that their lengths must fit together."""
    return sr.load_model(sr.PccArm(segment_lengths=(0.5, 0.4), muscle_azimuths=(0.0, 1.4, 3.2, 4.9), elastic_sections=2))


@settings(max_examples=25)
@given(seeds_)
def test_muscle_lengths_are_held_whatever_moves_freely(seed: int) -> None:
    """Sums over a segment are what the lengths say, in whatever way its sections share them; the springs see no difference."""
    robot, random = four_muscles(), np.random.default_rng(seed)
    held = robot.structure.muscle_lengths
    assert isinstance(held, MuscleLengths)
    rest = np.array([tag.rest_length for tag in robot.muscles])
    lengths = held.consistent(rest + random.uniform(-0.03, 0.03, len(rest)))
    assert np.allclose(held.consistent(lengths), lengths, rtol=0.0, atol=1e-15)
    strains = held.strains(lengths, random.uniform(-0.2, 0.2, robot.n_springs))
    arms = robot.structure.muscle_paths.matrix
    assert np.abs(muscle_lengths(robot, strains) - rest - arms @ strains).max() > 1e-6  # it is twisted
    assert np.allclose(arms.T @ (muscle_lengths(robot, strains) - lengths), 0.0, rtol=0.0, atol=1e-14)  # least squares
    assert np.allclose(arms @ held.free, 0.0, rtol=0.0, atol=1e-15)
    law_ = robot.structure.strain_springs
    mixed = held.free.T @ (law_.stiffness[:, None] * held.free)
    assert np.allclose(mixed, np.diag(held.springs.stiffness), rtol=0.0, atol=1e-12 * law_.stiffness.max())
    spread = held.spread @ held.basis(np.ones(len(rest)))
    assert np.allclose(held.free.T @ (law_.stiffness[:, None] * spread), 0.0, rtol=0.0, atol=1e-10 * law_.stiffness.max())


@settings(max_examples=25)
@given(st.sampled_from([four_muscles, paper_arm]), seeds_, st.floats(0.0, 3.0))
def test_actuators_go_no_further_than_they_can(robot: Callable[[], sr.SoftModel], seed: int, far: float) -> None:
    """Drawn positions are within limits and fit together; a step keeps both, and goes the whole way where it can."""
    actuators, random = robot().actuators, np.random.default_rng(seed)
    assert isinstance(actuators, Actuators)
    drawn = actuators.draw(random)
    assume(drawn is not None)
    low, high = actuators.limits.T
    step = far * actuators.basis @ random.uniform(-1.0, 1.0, actuators.basis.shape[1])
    moved = actuators.go(drawn, step)
    for motors in (drawn, moved):
        assert np.all((motors >= low - 1e-12) & (motors <= high + 1e-12))
        assert actuators.admit(motors)
        assert np.array_equal(actuators.checked(motors, "q_motors"), motors)
    ahead = drawn + step
    if np.all((ahead >= low) & (ahead <= high)) and actuators.admit(ahead):
        assert np.allclose(moved, ahead, rtol=0.0, atol=1e-12)
        assert len(actuators.active_limits(moved)[0]) == np.count_nonzero((moved <= low + 1e-13) | (moved >= high - 1e-13))
    assert np.linalg.norm(moved - drawn) <= np.linalg.norm(step) * (1.0 + 1e-9) + 1e-12


# --- Growth


@cache
def tube(handedness: str = "right") -> sr.HelixTube:
    return sr.HelixTube(elastic_sections=8, length=0.8, handedness=handedness)


@law("grown_coordinates", "HelixTube")
@settings(max_examples=30)
@given(st.floats(0.002, 1.0), st.floats(0.0, 1.0), st.one_of(st.floats(0.0, 2.0), st.sampled_from([5e-324, 1e-300, 1e30])))
def test_growth_takes_out_what_it_says(share: float, less: float, front: float) -> None:
    """All that is out is as long as its contraction makes it; wall that is out stays; mirrored tubes grow mirrored."""
    robot = tube()
    grown = sr.grown_coordinates(robot, share * robot.length, front)
    lengths = grown[:, 3] + robot.centre_length / 8
    low, high = (float(sr.helix.centre_length(c, robot.angle, share * robot.length)) for c in (robot.contraction, 1.0))
    assert low * (1.0 - 1e-12) <= lengths.sum() <= high * (1.0 + 1e-12)
    assert np.all(lengths > 0.0)
    assert np.all(np.isfinite(grown))
    curvature, torsion = sr.helix.actuator_curvature_torsion(robot.contraction, robot.angle, robot.diameter)
    # A straight tube has no curvature, and its frame turns with the actuator.
    assert np.all((grown[:, 1] >= 0.0) & (grown[:, 1] <= float(curvature) * lengths * (1.0 + 1e-12)))
    assert not grown[:, 0].any()
    if front == 0.0:
        assert lengths.sum() == pytest.approx(low, rel=1e-12)
        assert np.allclose(grown[:, 2], float(torsion) * lengths, rtol=1e-12, atol=0.0)
        shorter = sr.grown_coordinates(robot, max(less * share, 0.002) * robot.length)
        assert np.all(shorter[:, 3] <= grown[:, 3] + 1e-15)
        assert share < 1.0 or np.allclose(grown[:, 3], 0.0, rtol=0.0, atol=1e-15)  # the whole tube is as long as at rest
    mirrored = sr.grown_coordinates(tube("left"), share * robot.length, front)
    assert np.array_equal(mirrored, grown * [1.0, 1.0, -1.0, 1.0])


# --- Probes


@settings(max_examples=40)
@given(triples_, triples_, triples_, triples_, triples_, st.booleans())
def test_a_probe_moves_as_its_gradient_says(
    turn: np.ndarray, point: np.ndarray, line: np.ndarray, moved: np.ndarray, along: np.ndarray, slides: bool
) -> None:
    """A free body, its six velocities as coordinates: displacement by central differences; and the work of the wrench."""
    assume(min(np.linalg.norm(line), np.linalg.norm(along), np.linalg.norm(np.cross(line, along))) > 0.3)
    line, along = line / np.linalg.norm(line), along / np.linalg.norm(along)
    pose = pin.SE3(pin.exp3(turn), moved)
    normal = None
    if slides:
        normal = face_normal(pose.rotation.T @ line, pose.rotation.T @ along, "x")
        assert np.linalg.norm(normal) == pytest.approx(1.0, rel=1e-15)
        assert normal @ (pose.rotation.T @ along) == pytest.approx(0.0, abs=1e-14)
        # Of all normals across the axis it is nearest to the line.
        assert normal @ (pose.rotation.T @ line) == pytest.approx(np.linalg.norm(np.cross(line, along)), rel=1e-12)
    probe = Probe("tip", point, line, np.array([0.1, -0.2, 0.3]), normal)
    assert probe.same_as(Probe("tip", point + 1e-12, line, probe.origin, normal))
    assert not probe.same_as(Probe("tip", point + 1e-6, line, probe.origin, normal))
    here = touch(probe, pose, np.eye(6))
    differences = []
    for unit in 1e-6 * np.eye(6):
        there, back = (
            touch(probe, pin.SE3(pin.exp3(sign * unit[3:]) @ pose.rotation, pose.translation + sign * unit[:3]), np.eye(6))
            for sign in (1.0, -1.0)
        )
        differences.append((there.displacement - back.displacement) / 2e-6)
    assert np.allclose(here.gradient, differences, rtol=0.0, atol=1e-6)  # second-order error; slopes of a face up to 1/0.15^3
    assert np.array_equal(here.wrench, here.gradient)  # 1 N along the line does the work of the displacement
    assert np.allclose(here.place, probe.origin + here.displacement * line) or not slides


# --- Names and text


NAMES_ = st.text("abcdef_", min_size=1, max_size=4)


@cache
def description() -> str:
    return sr.PccArm(segment_lengths=(0.4,), elastic_sections=1).urdf()


@settings(max_examples=8)
@given(NAMES_, NAMES_, st.integers(0, 20), st.integers(0, 20))
def test_prefixes_and_shifts_add_up(one: str, two: str, first: int, second: int) -> None:
    twice, once = minidom.parseString(description()), minidom.parseString(description())
    before = used_names(once.documentElement)
    prefix_names(twice.documentElement, one)
    prefix_names(twice.documentElement, two)
    prefix_names(once.documentElement, two + one)
    assert twice.toxml() == once.toxml()
    after = used_names(once.documentElement)
    for kind, names in before.items():
        assert list(after[kind]) == [two + one + name for name in names]
    for shift in (first, second):
        shift_segments(twice.documentElement, shift)
    shift_segments(once.documentElement, first + second)
    assert twice.toxml() == once.toxml()
    found, was = (re.findall(r'segment="(\d+)"', text) for text in (once.toxml(), description()))
    assert [int(number) for number in found] == [int(number) + first + second for number in was]


lines_ = st.text(st.characters(exclude_characters="<>", exclude_categories=("Cs",)))


@settings(max_examples=30)
@given(lines_, lines_, lines_, lines_, lines_)
def test_a_marked_part_is_replaced_and_nothing_else(before: str, after: str, old: str, one: str, two: str) -> None:
    begin, end = "<!-- table:begin -->", "<!-- table:end -->"
    page = f"{before}{begin}\n{old}{end}\n{after}"
    made = marked(page, "page.md", begin, end, one)
    assert made == f"{before}{begin}\n\n{one}\n\n{end}\n{after}"
    assert marked(made, "page.md", begin, end, two) == marked(page, "page.md", begin, end, two)
    for wrong in (before + after, page + page, f"{end}\n{begin}\n"):
        with pytest.raises(sr.FileFormatError, match=r"^page\.md must have the lines"):
            marked(wrong, "page.md", begin, end, one)
