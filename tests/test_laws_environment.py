"""Laws of obstacles and environments: what moving, naming, pickling and plain data leave alone, distances that move along."""

from __future__ import annotations

import itertools
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.environment.obstacle_fields import obstacle_fields
from tests.support.laws import law

lengths = st.floats(0.05, 2.0)
vectors = st.tuples(*(st.floats(-1.0, 1.0),) * 3).map(np.array)
rotations = vectors.map(lambda vector: Rotation.from_rotvec(3.0 * vector).as_matrix())
transforms = st.builds(pin.SE3, rotations, vectors)
OBSTACLES: dict[str, st.SearchStrategy[Any]] = {
    "half_space": st.builds(sr.HalfSpace, vectors.filter(lambda v: np.linalg.norm(v) > 0.1), st.floats(-1.0, 1.0)),
    "sphere": st.builds(sr.Sphere, lengths, vectors),
    "box": st.builds(sr.Box, st.tuples(lengths, lengths, lengths), vectors, rotations),
    "cylinder": st.builds(sr.Cylinder, lengths, lengths, vectors, rotations),
    "capsule": st.builds(sr.Capsule, lengths, lengths, vectors, rotations),
    "mesh": st.builds(
        lambda size, *place: sr.Mesh(np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size, *place),
        st.tuples(lengths, lengths, lengths),
        vectors,
        rotations,
    ),
}


def swing(parameter: float) -> pin.SE3:
    """A pose that turns about z and rises."""
    return pin.SE3(Rotation.from_rotvec([0.0, 0.0, parameter]).as_matrix(), np.array([0.0, 0.0, 0.3 * parameter]))


def distance(obstacle: Any, point: np.ndarray) -> float:
    ((field, _),) = obstacle_fields(sr.Environment([obstacle]))
    return float(field.at(point[None], np.zeros(1, dtype=np.intp))[0][0])


@law("HalfSpace", "Sphere", "Box", "Cylinder", "Capsule", "Mesh")
@pytest.mark.parametrize("kind", OBSTACLES)
@given(data=st.data(), transform=transforms, point=vectors)
@settings(max_examples=5)
def test_a_moved_obstacle_is_as_far_from_a_moved_point(
    kind: str, data: st.DataObject, transform: pin.SE3, point: np.ndarray
) -> None:
    """By a fixed transform, by a pose, and by a pose on top of a fixed one; rounding."""
    obstacle = data.draw(OBSTACLES[kind])
    assert isinstance(obstacle, (sr.HalfSpace, sr.Sphere, sr.Box, sr.Cylinder, sr.Capsule, sr.Mesh))
    before = distance(obstacle, point)
    moved = obstacle.moved(transform)
    assert distance(moved, transform.act(point)) == pytest.approx(before, abs=1e-12)
    twice = moved.moved(swing(0.4).homogeneous)
    assert distance(twice, swing(0.4).act(transform.act(point))) == pytest.approx(before, abs=1e-12)


@law("HalfSpace", "Sphere", "Box", "Cylinder", "Capsule", "Mesh")
@pytest.mark.parametrize("kind", OBSTACLES)
@given(data=st.data(), point=vectors, other=vectors, share=st.floats(0.0, 1.0))
@settings(max_examples=5)
def test_signed_distance_is_convex_and_changes_no_faster_than_the_point(
    kind: str, data: st.DataObject, point: np.ndarray, other: np.ndarray, share: float
) -> None:
    """Both hold for every convex body, inside, too."""
    obstacle = data.draw(OBSTACLES[kind])
    assert isinstance(obstacle, (sr.HalfSpace, sr.Sphere, sr.Box, sr.Cylinder, sr.Capsule, sr.Mesh))
    one, two, between = (distance(obstacle, x) for x in (point, other, (1.0 - share) * point + share * other))
    assert abs(one - two) <= np.linalg.norm(point - other) + 1e-12
    assert between <= (1.0 - share) * one + share * two + 1e-12


@law("Environment")
@given(data=st.data(), transform=transforms, parameter=st.floats(-2.0, 2.0))
@settings(max_examples=10)
def test_environments_keep_their_content(data: st.DataObject, transform: pin.SE3, parameter: float) -> None:
    kinds = data.draw(st.lists(st.sampled_from(sorted(OBSTACLES)), min_size=1, max_size=4))
    obstacles = [data.draw(OBSTACLES[kind]) for kind in kinds]
    one, two = (sr.Environment(obstacles, self_contact=True) for _ in range(2))
    assert one == two
    assert hash(one) == hash(two)
    assert one != sr.Environment(obstacles)
    assert len(set(one.names)) == len(one) == len(kinds)
    assert [type(one[name]) for name in one.names] == [type(each) for each in obstacles]
    assert pickle.loads(pickle.dumps(one)) == one
    assert sr.Environment.from_dict(json.loads(json.dumps(one.to_dict()))) == one
    name = data.draw(st.sampled_from(one.names))
    there = one.moved(name, transform)
    assert sr.Environment.from_dict(json.loads(json.dumps(there.to_dict()))) == there
    assert there.moved(name, pin.SE3.Identity()) == there
    assert [each for each in there if each.name != name] == [each for each in one if each.name != name]

    moving = sr.Environment([sr.Sphere(0.1, (0.5, 0.0, 0.0), name="ball", pose=swing), *obstacles])
    assert pickle.loads(pickle.dumps(moving)) == moving
    fixed = moving.at(parameter)
    assert fixed == sr.Environment([sr.Sphere(0.1, (0.5, 0.0, 0.0), name="ball"), *obstacles]).moved("ball", swing(parameter))


WALL = sr.Environment([sr.HalfSpace((0, 0, 1)), sr.Sphere(0.1, pose=swing)])
CUBE = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
REFUSED = {
    "no direction": (lambda: sr.HalfSpace((0, 0, 0)), sr.ParameterError, "normal must be different from zero"),
    "negative radius": (lambda: sr.Sphere(-0.1), sr.ParameterError, "radius must be positive"),
    "flat box": (lambda: sr.Box((1, 1, 0)), sr.ParameterError, "size must be positive"),
    "two edges": (lambda: sr.Box((1, 1)), sr.ParameterError, "shape (3,)"),
    "mirror": (lambda: sr.Cylinder(0.1, 1.0, rotation=-np.eye(3)), sr.ParameterError, "a rotation matrix"),
    "stretch": (lambda: sr.Capsule(0.1, 1.0, rotation=2.0 * np.eye(3)), sr.ParameterError, "a rotation matrix"),
    "empty name": (lambda: sr.Sphere(0.1, name=" "), sr.ParameterError, "name must be a text"),
    "no pose": (lambda: sr.Sphere(0.1, pose=np.eye(3)), sr.ParameterError, "shape (4, 4)"),
    "pose without a pose": (
        lambda: sr.Environment([sr.Sphere(0.1, pose=lambda t: None)]).at(0.5),
        sr.ParameterError,
        "pose(0.5) of sphere_1 must be",
    ),
    "one obstacle": (lambda: sr.Environment(sr.Sphere(0.1)), sr.ParameterError, "a list of obstacles"),
    "a number": (lambda: sr.Environment([0.1]), sr.ParameterError, "obstacles[0] must be an obstacle"),
    "the same name": (lambda: sr.Environment([sr.Sphere(0.1, name="a")] * 2), sr.ParameterError, "'a' comes more than once"),
    "unknown name": (lambda: WALL["half_space"], sr.NameNotFound, "did you mean 'half_space_1'"),
    "moved unknown": (lambda: WALL.moved("wall", np.eye(4)), sr.NameNotFound, "available: half_space_1, sphere_1"),
    "moved and moving": (lambda: WALL.moved("sphere_1", np.eye(4)), sr.ParameterError, "Environment.at fixes it"),
    "moved by a stretch": (lambda: WALL.moved("half_space_1", 2.0 * np.eye(4)), sr.ParameterError, "a rotation matrix"),
    "moving as data": (WALL.to_dict, sr.ParameterError, "Environment.at fixes it"),
    "at no number": (lambda: WALL.at(float("nan")), sr.ParameterError, "a finite number"),
    "other data": (lambda: sr.Environment.from_dict({"walls": []}), sr.ParameterError, "Environment.to_dict"),
    "unknown kind": (
        lambda: sr.Environment.from_dict({"obstacles": [{"kind": "cone"}]}),
        sr.NameNotFound,
        "half_space, sphere",
    ),
    "unknown field": (
        lambda: sr.Environment.from_dict({"obstacles": [{"kind": "sphere", "radios": 1}]}),
        sr.NameNotFound,
        "'radius'",
    ),
    "no radius": (lambda: sr.Environment.from_dict({"obstacles": [{"kind": "sphere"}]}), sr.ParameterError, "'radius'"),
    "flat mesh": (lambda: sr.Mesh(CUBE[:4]), sr.ParameterError, "not in one plane"),
    "dent": (lambda: sr.Mesh([*CUBE, (0.5, 0.5, 0.5)]), sr.ParameterError, "hull=True takes its convex hull"),
    "no file": (lambda: sr.Mesh("nowhere.stl"), sr.FileFormatError, "nowhere.stl is not found"),
    "moving obstacle in an evaluation": (lambda: obstacle_fields(WALL), sr.ParameterError, "Environment.at fixes it"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_says_why(case: str) -> None:
    call, error, words = REFUSED[case]
    with pytest.raises(error) as caught:
        call()  # type: ignore[operator]
    assert words in str(caught.value)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_a_mesh_file_is_read_and_must_be_convex(suffix: str, tmp_path: Path) -> None:
    """A wedge in millimetres; with a notch it is refused, or filled if asked. Files have 7 digits."""
    import trimesh

    corners = np.array([[0, 0, 0], [30, 0, 0], [0, 40, 0], [0, 0, 50], [30, 0, 50], [0, 40, 50]], dtype=float)
    hull = trimesh.convex.convex_hull(corners)
    hull.export(tmp_path / f"wedge.{suffix}")
    wedge = sr.Mesh(tmp_path / f"wedge.{suffix}", scale=0.001)
    assert np.allclose(sorted(wedge.vertices.tolist()), sorted((0.001 * corners).tolist()), atol=1e-8)
    assert sr.Environment.from_dict(sr.Environment([wedge]).to_dict()) == sr.Environment([wedge])
    points = np.vstack([hull.vertices, [[10.0, 13.0, 45.0]]])
    top = [i for i, normal in enumerate(hull.face_normals) if normal[2] > 0.9]
    fans = [[a, b, 6] for i in top for a, b in zip(hull.faces[i], np.roll(hull.faces[i], -1), strict=True)]
    notched = trimesh.Trimesh(points, [*np.delete(hull.faces, top, axis=0).tolist(), *fans], process=False)
    notched.export(tmp_path / f"notched.{suffix}")
    with pytest.raises(sr.ParameterError, match="enclose"):
        sr.Mesh(tmp_path / f"notched.{suffix}", scale=0.001)
    assert len(sr.Mesh(tmp_path / f"notched.{suffix}", scale=0.001, hull=True).vertices) == 6
    (tmp_path / f"bad.{suffix}").write_bytes(b"\x00" * 50)
    with pytest.raises(sr.FileFormatError):
        sr.Mesh(tmp_path / f"bad.{suffix}")


@pytest.mark.parametrize("kind", [kind for kind in OBSTACLES if kind != "mesh"])
@given(data=st.data())
@settings(max_examples=5)
def test_an_obstacle_is_shown_as_the_call_that_makes_it(kind: str, data: st.DataObject) -> None:
    obstacle = data.draw(OBSTACLES[kind])
    assert eval(repr(obstacle), dict(vars(sr))) == obstacle
    assert "pose" not in repr(obstacle)


def test_many_obstacles_are_shown_in_one_line() -> None:
    room = sr.Environment([sr.Sphere(0.1, name="ball"), sr.Box((1, 1, 1), pose=swing), *(sr.Sphere(1.0) for _ in range(8))])
    assert repr(room).startswith("Environment(ball: Sphere, box_1: Box, sphere_1: Sphere, ")
    assert repr(room).endswith(", 4 more)")
    assert repr(sr.Environment(self_contact=True)) == "Environment(self_contact)"
    assert repr(sr.Mesh(np.random.default_rng(1).normal(size=(40, 3)), hull=True)).endswith(" rows>)")


@law("Environment", "Sphere", "HalfSpace", "Box", "CompiledModel.equilibria")
@given(angle=st.floats(-3.0, 3.0), weight=st.floats(0.0, 30.0))
@settings(max_examples=6, deadline=None)
def test_compiled_equilibria_in_contact_turn_with_the_world(angle: float, weight: float) -> None:
    """Obstacles, on one side of the arm, and motor 1 turned about the vertical: the same springs to 1e-9, forces turned."""
    arm, turn = sr.load_model(sr.InflatableArm()), Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
    solver, found = sr.compile(arm, backend="python"), list[Any]()
    for about in (np.eye(3), turn):
        obstacles = [
            sr.HalfSpace(about @ (-1.0, 0.0, 0.0), -1.0),
            sr.Box((0.3, 0.2, 0.1), about @ (0.9, 0.05, 0.5), about),
            sr.Sphere(0.1, about @ (0.5, 0.04, 0.35)),
        ]
        motors = (angle if about is turn else 0.0, 0.9, -0.4)
        found.append(solver.equilibria(motors, [(0.0, 0.0, -weight)], environment=sr.Environment(obstacles)))
        assert found[-1].certified.all()
    still, turned = found
    assert np.abs(turned.q_springs - still.q_springs).max() < 1e-9
    assert np.abs(turned.obstacle_forces - still.obstacle_forces @ turn.T).max() < 1e-9 * max(weight, 1.0) * 10.0
