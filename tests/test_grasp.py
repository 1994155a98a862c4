"""Grasps: force closure and pull-out against textbook answers, hulls of wrenches by Qhull, and linear programs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import softrobots as sr
from tests.support.laws import law


class Touch(NamedTuple):
    """A contact as `Equilibrium.contacts` has them."""

    point: np.ndarray
    normal: np.ndarray
    force: np.ndarray


def touch(point: Any, inward: Any, force: Any = None) -> Touch:
    """A contact that pushes inward; the force on the object is that of one newton along its inward normal if not given."""
    normal = -np.array(inward, dtype=float)
    return Touch(np.array(point, dtype=float), normal, normal if force is None else -np.array(force, dtype=float))


def ring(count: int, radius: float = 0.02) -> list[Touch]:
    """Equal fingers around a cylinder along z."""
    angles = np.arange(count) * 2.0 * np.pi / count
    ways = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    return [touch(radius * way, -way) for way in ways]


def random_grasp(rng: np.random.Generator, count: int) -> list[Touch]:
    """Contacts on a body that is about convex, pressed by 0.5 to 2 N, with some friction of a coefficient below 0.2."""
    points, ways = rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
    inward = 0.6 * ways - points
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    across = np.cross(inward, rng.normal(size=(count, 3)))
    across *= 0.2 * rng.uniform(size=(count, 1)) / np.linalg.norm(across, axis=1, keepdims=True)
    pressed = rng.uniform(0.5, 2.0, size=(count, 1))
    return [touch(*row) for row in zip(points, inward, pressed * (inward + across), strict=True)]


def cone_edges(contacts: list[Touch], friction: float, edges: int, outside: bool) -> np.ndarray:
    """Wrenches on the object about the origin of the edges of pyramids in or around the cones, shape (k, edges, 6)."""
    angles = np.arange(edges) * 2.0 * np.pi / edges
    reach = friction / np.cos(np.pi / edges) if outside else friction
    wrenches = []
    for contact in contacts:
        base = np.linalg.svd(contact.normal[np.newaxis])[2][1:]
        forces = -contact.normal + reach * np.column_stack([np.cos(angles), np.sin(angles)]) @ base
        wrenches.append(np.hstack([forces, np.cross(contact.point, forces)]))
    return np.array(wrenches)


def surrounds_zero(wrenches: np.ndarray) -> bool:
    """Whether the convex hull of wrenches of about one has zero inside, by Qhull, which joggles them by 1e-10."""
    return bool(np.all(ConvexHull(wrenches, qhull_options="QJ Pp").equations[:, -1] < -1e-8))


def test_the_wrench_on_the_object_is_opposite_to_the_forces_on_the_robot() -> None:
    """A force of (0, 0, 3) N on the object at x = 0.2 m turns it by -0.6 N m about y through the origin."""
    contacts = [touch((0.2, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 3.0))]
    assert sr.contact_wrench(contacts).tolist() == pytest.approx([0.0, 0.0, 3.0, 0.0, -0.6, 0.0], abs=1e-15)
    assert sr.contact_wrench(contacts, (0.2, 0.0, 7.0)).tolist() == pytest.approx([0.0, 0.0, 3.0, 0.0, 0.0, 0.0], abs=1e-15)
    assert sr.contact_wrench([]).tolist() == [0.0] * 6


@pytest.mark.parametrize("beside", [0.0, 0.2, 0.39, 0.41, 0.9])
def test_two_fingers_hold_a_disc_in_its_plane_if_their_line_is_in_both_cones(beside: float) -> None:
    """Nguyen's antipodal grasp: the second finger stands `2 beside` off the opposite place, so the line between them makes the
    angle `beside` with both normals. The best squeeze is along it: margin `cos - sin / mu` over `cos`."""
    angle, friction = np.pi - 2.0 * beside, np.tan(0.4)
    contacts = [touch((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))]
    contacts.append(touch((np.cos(angle), np.sin(angle), 0.0), (-np.cos(angle), -np.sin(angle), 0.0)))
    found = sr.is_force_closure(contacts, friction, plane=(0.0, 0.0, 1.0))
    assert bool(found) == found.closed == (beside < 0.4)
    assert found.margin == pytest.approx(max(1.0 - np.tan(beside) / friction, 0.0), abs=1e-8)  # the bounds end as close
    in_space = sr.is_force_closure(contacts, friction)
    assert (bool(in_space), in_space.rank) == (False, 5)  # nothing resists a turn about the line


def test_four_frictionless_contacts_hold_a_square_if_they_turn_it_both_ways() -> None:
    """Two pairs that turn it left and right [Reuleaux 1876]; at the middles of the sides, or all turning left, they do not."""
    ways = [Rotation.from_euler("z", 90 * side, degrees=True) for side in range(4)]

    def grasp(shifts: tuple[float, ...]) -> Any:
        contacts = [touch(way.apply((1.0, s, 0.0)), way.apply((-1.0, 0.0, 0.0))) for way, s in zip(ways, shifts, strict=True)]
        return sr.is_force_closure(contacts, 0.0, plane=(0.0, 0.0, 1.0))

    assert grasp((0.5, -0.5, 0.5, -0.5)).closed
    assert not grasp((0.5, 0.5, 0.5, 0.5)).closed
    middles = grasp((0.0, 0.0, 0.0, 0.0))
    assert (middles.closed, middles.rank) == (False, 2)


def test_a_sphere_is_held_by_friction_alone() -> None:
    """Nothing resists its turns without friction; with any, four contacts along a tetrahedron close, by an equal squeeze."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    contacts = [touch(corner, -corner) for corner in corners]
    smooth, rough = sr.is_force_closure(contacts, 0.0), sr.is_force_closure(contacts, 0.01)
    assert (smooth.closed, smooth.rank) == (False, 3)
    assert (rough.closed, rough.rank) == (True, 6)
    assert rough.margin == pytest.approx(1.0, abs=1e-8)
    assert not sr.is_force_closure(contacts[:1], 5.0)  # one finger pushes only
    assert not sr.is_force_closure([], 1.0)


@pytest.mark.study
@pytest.mark.parametrize("count", [7, 14])
def test_a_box_without_friction_is_held_as_the_hull_of_its_wrenches_says(count: int) -> None:
    """Contacts at random on all six sides; less than seven never do [Somov 1900]."""
    rng = np.random.default_rng(count)
    sides = np.vstack([np.eye(3), -np.eye(3)])[np.resize(np.arange(6), count)]
    answers = []
    for _ in range(25):
        points = sides + np.where(sides == 0.0, rng.uniform(-1.0, 1.0, (count, 3)), 0.0)
        contacts = [touch(*row) for row in zip(points, -sides, strict=True)]
        answers.append(sr.is_force_closure(contacts, 0.0).closed)
        assert answers[-1] == surrounds_zero(cone_edges(contacts, 0.0, 1, False)[:, 0])
        assert not sr.is_force_closure(contacts[:6], 0.0)
    assert set(answers) == {True, False}


@pytest.mark.study
def test_force_closure_is_between_pyramids_in_and_around_the_cones() -> None:
    """Qhull: zero within the hull of inscribed pyramids is sufficient, within that of circumscribed ones necessary. The squeeze
    that is told balances itself, and has the margin that is told."""
    rng = np.random.default_rng(1)
    answers = []
    for count in (3, 4, 5) * 12:
        contacts, friction = random_grasp(rng, count), float(rng.uniform(0.2, 1.0))
        found = sr.is_force_closure(contacts, friction)
        inner, outer = (surrounds_zero(cone_edges(contacts, friction, 16, way).reshape(-1, 6)) for way in (False, True))
        assert inner <= found.closed <= outer
        answers.append((inner, outer))
        inward = -np.array([contact.normal for contact in contacts])
        normal = np.sum(found.forces * inward, axis=1)
        rubbing = np.linalg.norm(found.forces - normal[:, np.newaxis] * inward, axis=1)
        held = sr.contact_wrench([touch(c.point, -c.normal, f) for c, f in zip(contacts, found.forces, strict=True)])
        assert np.abs(held).max() < 1e-13  # of forces of about one
        assert np.min(normal - rubbing / friction) == pytest.approx(found.margin, abs=1e-13)
        assert found.margin <= found.largest_margin <= found.margin + 2e-8  # the two bounds end at 1e-8
    assert {(False, False), (True, True)} <= set(answers)
    assert sum(inner == outer for inner, outer in answers) >= 30


@pytest.mark.study
def test_what_is_closed_balances_random_wrenches_and_what_is_not_does_not() -> None:
    """By brute force: a linear program for each wrench; of an open grasp one of a wrench and its opposite fails often."""
    rng = np.random.default_rng(2)
    seen = set()
    for _ in range(12):
        contacts = random_grasp(rng, 4)
        edges = cone_edges(contacts, 0.5, 12, False).reshape(-1, 6).T
        wrenches = rng.normal(size=(12, 6))
        balanced = [linprog(np.ones(edges.shape[1]), A_eq=edges, b_eq=-w).success for w in np.vstack([wrenches, -wrenches])]
        seen.add(all(balanced))
        assert all(balanced) == sr.is_force_closure(contacts, 0.5).closed
    assert seen == {True, False}


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_cylinder_slides_out_of_equal_fingers_at_their_whole_friction(count: int) -> None:
    """`mu k N` along its axis, less or more what the fingers carry already; across, each contact rubs along its own tangent:
    `mu N` times the sum of the sines, where that is balanced (three fingers: square root of 3)."""
    friction = 0.3
    found = sr.pull_out_force(ring(count), friction, (0.0, 0.0, -2.0))
    assert found.force == pytest.approx(friction * count, rel=1e-7)  # bounds end at 1e-8 of the sum of the normal forces
    assert found.force <= found.largest_force <= found.force + 1e-8 * count * 1.01
    assert found.slips == (True,) * count
    assert np.allclose(found.contact_forces[:, 2], friction, rtol=0.0, atol=1e-7)
    carrying = [touch(c.point, -c.normal, -c.normal + (0.0, 0.0, 0.1)) for c in ring(count)]
    assert sr.pull_out_force(carrying, friction, (0.0, 0.0, -1.0)).force == pytest.approx((friction - 0.1) * count, rel=1e-7)
    assert sr.pull_out_force(carrying, friction, (0.0, 0.0, 1.0)).force == pytest.approx((friction + 0.1) * count, rel=1e-7)
    if count == 3:
        assert sr.pull_out_force(ring(3), friction, (1.0, 0.0, 0.0)).force == pytest.approx(3.0**0.5 * friction, rel=1e-7)


def test_a_pull_beside_the_axis_loads_one_finger_more() -> None:
    """Levers: two fingers at `x = +-R` share a pull along z at `x = e` as `(1 +- e / R) / 2`: `2 mu N / (1 + e / R)`."""
    for beside in (0.0, 0.01, 0.05):
        found = sr.pull_out_force(ring(2), 0.3, (0.0, 0.0, 1.0), point=(beside, 0.0, 0.0))
        assert found.force == pytest.approx(0.6 / (1.0 + beside / 0.02), rel=1e-7)


def test_a_finger_that_may_press_harder_holds_a_pull_against_it() -> None:
    """Along their line two fingers hold nothing by friction, and up to what one may press with if the other lets go."""
    assert sr.pull_out_force(ring(2), 0.3, (1.0, 0.0, 0.0)).force == 0.0
    assert sr.pull_out_force(ring(2), 0.3, (1.0, 0.0, 0.0), largest_normal_force=2.5).force == pytest.approx(2.5, rel=1e-7)
    pull = {"contacts": ring(2), "friction": 0.3, "direction": (0.0, 0.0, 1.0)}
    assert sr.pull_out_force(**pull, largest_normal_force=2.5).force == pytest.approx(2 * 0.3 * 2.5, rel=1e-7)
    assert sr.pull_out_force(**pull, largest_normal_force=1.0).force == pytest.approx(0.6, rel=1e-7)  # as they press


@pytest.mark.parametrize("limit", [None, 3.0])
def test_the_pull_is_between_linear_programs_of_fine_pyramids(limit: float | None) -> None:
    """With 48 edges in and around the cones, in other unknowns: the forces along the edges, or Cartesian forces."""
    rng = np.random.default_rng(3)
    for count in (2, 4, 6):
        contacts, friction, pull, point = random_grasp(rng, count), 0.5, *rng.normal(size=(2, 3))
        found = sr.pull_out_force(contacts, friction, pull, point=point, largest_normal_force=limit)
        arm = np.append(pull, np.cross(point, pull)) / np.linalg.norm(pull)
        pressed = np.array([contact.normal @ contact.force for contact in contacts])
        bounds = []
        for outside in (False, True):
            edges = cone_edges(contacts, friction, 48, outside).reshape(-1, 6).T
            sums = np.hstack([np.repeat(np.eye(count), 48, axis=1), np.zeros((count, 1))])
            equal, right = np.column_stack([edges, arm]), sr.contact_wrench(contacts)
            above = {"A_ub": sums, "b_ub": np.full(count, limit)} if limit else {}
            if limit is None:
                equal, right = np.vstack([equal, sums]), np.append(right, pressed)
            result = linprog(np.append(np.zeros(edges.shape[1]), -1.0), A_eq=equal, b_eq=right, **above)
            bounds.append(-result.fun)
        inner, outer = bounds
        assert inner - 1e-6 <= found.force <= found.largest_force + 1e-12
        assert found.largest_force <= outer + 1e-6  # the programs' own accuracy
        moved = [touch(c.point, -c.normal, f) for c, f in zip(contacts, found.contact_forces, strict=True)]
        assert np.allclose(sr.contact_wrench(moved) + found.force * arm, sr.contact_wrench(contacts), rtol=0.0, atol=1e-12)


@pytest.mark.study
@law("contact_wrench", "is_force_closure", "pull_out_force")
@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5), st.floats(0.01, 100.0), st.floats(0.01, 100.0))
def test_a_grasp_is_the_same_wherever_it_is_and_in_any_units(seed: int, count: int, size: float, strength: float) -> None:
    """Turned, moved, scaled and pressed harder: the margin stays, forces grow with the pressure, moments also with the size."""
    rng = np.random.default_rng(seed)
    contacts, pull, point, shift = random_grasp(rng, count), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    turn = Rotation.from_rotvec(rng.normal(size=3))

    def moved(place: np.ndarray) -> np.ndarray:
        return np.asarray(size * (turn.apply(place) + shift))

    others = [Touch(moved(c.point), turn.apply(c.normal), strength * turn.apply(c.force)) for c in contacts]
    wrench, other = (one.reshape(2, 3) for one in (sr.contact_wrench(contacts, point), sr.contact_wrench(others, moved(point))))
    expected = strength * turn.apply(wrench) * [[1.0], [size]]
    assert np.allclose(other, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max() * max(1.0, size))
    closure, closure_other = sr.is_force_closure(contacts, 0.6), sr.is_force_closure(others, 0.6)
    assert closure.margin == pytest.approx(closure_other.margin, abs=2e-8)  # each within 1e-8 of the largest
    assert closure.closed == closure_other.closed or closure.margin < 1e-7
    held = sr.pull_out_force(contacts, 0.6, pull, point=point)
    held_other = sr.pull_out_force(others, 0.6, turn.apply(pull), point=moved(point))
    squeeze = sum(float(contact.normal @ contact.force) for contact in contacts)
    assert held_other.force == pytest.approx(strength * held.force, abs=4e-8 * strength * squeeze)
    more = sr.pull_out_force(contacts, 0.7, pull, point=point)
    assert more.largest_force >= held.force - 1e-8 * squeeze  # more friction never holds less


@pytest.mark.study
@pytest.mark.parametrize("friction", [1e-6, 1e-3, 30.0])
def test_bounds_meet_whatever_the_sizes(friction: float) -> None:
    """Contacts in one point, on a line, in a plane; lengths and forces over many decades: within 1e-6 of the squeeze."""
    rng = np.random.default_rng(6)
    for trial in range(8):
        count = int(rng.integers(1, 8))
        points, ways = 10.0 ** rng.uniform(-6, 3) * rng.normal(size=(count, 3)), rng.normal(size=(count, 3))
        points = [points, 0.0 * points + points[0], np.outer(points[:, 0], points[0]), points * (1.0, 1.0, 0.0)][trial % 4]
        pressed = 10.0 ** rng.uniform(-9, 6, count) if trial > 3 else np.ones(count)
        contacts = [touch(p, way, f * way / np.linalg.norm(way)) for p, way, f in zip(points, ways, pressed, strict=True)]
        closure, pull = sr.is_force_closure(contacts, friction), sr.pull_out_force(contacts, friction, rng.normal(size=3))
        assert 0.0 <= closure.margin <= closure.largest_margin <= closure.margin + 1e-6
        assert 0.0 <= pull.force <= pull.largest_force <= pull.force + 1e-6 * pressed.sum()


def test_bad_grasps_are_refused_by_name() -> None:
    good = ring(3)
    refused = [
        (lambda: sr.is_force_closure(7, 0.3), "contacts"),
        (lambda: sr.is_force_closure([object()], 0.3), "contacts, each with its point"),
        (lambda: sr.is_force_closure([touch((0, 0, 0), (0, 0, 0))], 0.3), "normals different from zero"),
        (lambda: sr.is_force_closure(good, -0.1), "friction"),
        (lambda: sr.is_force_closure(good, (0.1, 0.2)), "friction"),
        (lambda: sr.is_force_closure(good, np.nan), "friction"),
        (lambda: sr.is_force_closure(good, 0.3, plane=(1.0, 0.0, 0.0)), "perpendicular"),
        (lambda: sr.is_force_closure([Touch(np.full(3, np.nan), good[0].normal, good[0].force)], 0.3), r"contacts\[0\].point"),
        (lambda: sr.pull_out_force(good, 0.3, (0.0, 0.0, 0.0)), "direction"),
        (lambda: sr.pull_out_force(good, 0.3, (0.0, 0.0, 1.0), point=(0.0, 0.0)), "point"),
        (lambda: sr.pull_out_force(good, 0.3, (0.0, 0.0, 1.0), largest_normal_force=0.5), "presses with now"),
        (lambda: sr.pull_out_force([touch((0, 0, 0), (0, 0, 1), (0, 0, -1))], 0.3, (0.0, 0.0, 1.0)), "pressing"),
        (lambda: sr.pull_out_force([touch((0, 0, 0), (0, 0, 1), (1, 0, 2))], 0.3, (0.0, 0.0, 1.0)), "at least 0.5"),
        (lambda: sr.contact_wrench(good, (0.0, 0.0)), "point"),
    ]
    for call, words in refused:
        with pytest.raises(sr.ParameterError, match=words):
            call()
    idle = sr.pull_out_force([touch((0, 0, 0), (0, 0, 1), (0, 0, 0))], 0.3, (0.0, 0.0, 1.0))
    assert (idle.force, idle.largest_force) == (0.0, 0.0)
