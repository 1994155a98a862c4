"""Environments from files: the obstacles stand where MuJoCo, Drake and yourdfpy have them in the same file."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.environment.obstacle_fields import obstacle_fields
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from tests.support.laws import law

TETRAHEDRON = "v 0 0 0\nv 0.3 0 0\nv 0 0.4 0\nv 0 0 0.5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
NOTCHED = TETRAHEDRON.replace("f 2 3 4", "v 0.08 0.08 0.08\nf 2 3 5\nf 3 4 5\nf 4 2 5")

MJCF = """<mujoco model="scene"><compiler angle="degree"/><asset><mesh name="wedge" file="wedge.obj" scale="1 1 2"/></asset>
<worldbody><geom name="floor" type="plane" size="1 1 .1" pos="0 0 -1" euler="10 5 0"/>
<geom type="sphere" size=".3" pos="2 0 0"/><geom name="paint" type="box" size="9 9 9" contype="0" conaffinity="0"/>
<body name="post" pos="1 0 0" euler="0 30 0"><geom type="capsule" fromto="0 0 0 0 0 1" size=".1"/>
<geom name="top" type="box" size=".1 .2 .3" pos="0 0 1"/>
<body name="arm" pos="0 .5 0" euler="20 0 40"><geom type="cylinder" size=".1 .4" pos="0 .1 .2"/></body></body>
<body name="wedge" pos="-1 0 0" euler="0 0 50"><geom type="mesh" mesh="wedge" pos=".1 .2 0" euler="0 70 0"/></body>
<body name="probe" mocap="true"><geom name="probe" size="1e-3" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""

SDF = """<sdf version="1.9"><world name="w"><model name="ground"><static>true</static><link name="link">
<collision name="c"><pose>0 0 -1 0.2 0.1 0</pose><geometry><plane><normal>0 1 2</normal><size>1 1</size></plane></geometry>
</collision></link></model><model name="shelf"><static>true</static><pose>1 0 0.2 0.3 0.2 0.1</pose>
<link name="low"><pose>0 0.1 0 0 0 1</pose><collision name="c"><pose>0.1 0 0 0.5 0 0</pose>
<geometry><box><size>0.2 0.4 0.6</size></box>
</geometry></collision><visual name="v"><geometry><box><size>9 9 9</size></box></geometry></visual></link>
<link name="high"><pose relative_to="low">0 0 0.5 0 0.4 0</pose>
<collision name="ball"><geometry><sphere><radius>0.15</radius></sphere></geometry></collision>
<collision name="bar"><pose>0.3 0 0 0 1.2 0</pose>
<geometry><capsule><radius>0.05</radius><length>0.5</length></capsule></geometry>
</collision></link></model>
<model name="drum"><static>true</static><pose>-1 0 0 0.4 0 0</pose><link name="link"><collision name="c"><geometry><cylinder>
<radius>0.2</radius><length>0.5</length></cylinder></geometry></collision></link></model>
<model name="wedge"><static>true</static><pose>0 -1 0 0 0 0.5</pose><link name="link"><collision name="c"><geometry><mesh>
<uri>wedge.obj</uri><scale>1 1 2</scale></mesh></geometry></collision></link></model></world></sdf>"""

URDF = """<robot name="cell" xmlns:s="urn:softrobots:urdf"><link name="world"/><link name="table">
<collision><origin xyz="0 0 0.4" rpy="0 0 0.3"/><geometry><box size="1.0 0.6 0.8"/></geometry></collision>
<visual><geometry><box size="9 9 9"/></geometry></visual></link>
<joint name="a" type="fixed"><origin xyz="1 0.2 0" rpy="0.1 0 0.5"/><parent link="world"/><child link="table"/></joint>
<link name="pole"><collision name="stem"><origin xyz="0 0 0.3" rpy="0.2 0.1 0"/>
<geometry><cylinder radius="0.05" length="0.6"/></geometry>
</collision><collision><origin xyz="0 0 0.7"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="b" type="fixed"><origin xyz="0.1 0.2 0.8" rpy="0 0.3 0"/><parent link="table"/><child link="pole"/></joint>
<link name="wedge"><collision><geometry><mesh filename="wedge.obj" scale="1 1 2"/></geometry></collision></link>
<joint name="c" type="fixed"><origin xyz="0 -1 0" rpy="0.4 0 0"/><parent link="world"/><child link="wedge"/></joint>
<s:capsule link="wedge" start="0 0 0" end="0 0.3 0.4" radius="0.02"/></robot>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a mesh, and the worlds in three formats."""
    for name, text in (("wedge.obj", TETRAHEDRON), ("a.xml", MJCF), ("a.sdf", SDF), ("a.urdf", URDF)):
        (tmp_path / name).write_text(text)
    return tmp_path


def distances(environment: Environment, points: FloatArray) -> dict[str, FloatArray]:
    """Signed distances of points, shape (m, 3), from each obstacle by its name; from meshes without sign, by trimesh."""
    found = {}
    for field, places in obstacle_fields(environment):
        for body, place in enumerate(places.tolist()):
            found[environment.names[place]] = field.at(points, np.full(len(points), body))[0]
    for mesh in environment:
        if isinstance(mesh, Mesh):
            body = trimesh.Trimesh(mesh.vertices, mesh.triangles).apply_transform(mesh.transform_to_world)
            found[mesh.name] = trimesh.proximity.closest_point(body, points)[1]
    return found


def test_obstacles_of_mjcf_are_where_mujoco_has_them(folder: Path, rng: np.random.Generator, tool: Callable) -> None:
    """Distances of a small ball outside; 1e-6: MuJoCo's own collision tolerance."""
    mujoco = tool("mujoco")
    environment = Environment.from_file(folder / "a.xml")
    assert environment.names == ("floor", "sphere_1", "post_1", "post_top", "arm", "wedge")
    model = mujoco.MjModel.from_xml_path(str(folder / "a.xml"))
    data = mujoco.MjData(model)
    geoms = {name: i for i, name in enumerate(("floor", "sphere_1", "paint", *environment.names[2:])) if name != "paint"}
    points = rng.uniform(-2.0, 2.0, (30, 3))
    ours = distances(environment, points)
    compared = 0
    for row, point in enumerate(points):
        data.mocap_pos[0] = point
        mujoco.mj_forward(model, data)
        for name, geom in geoms.items():
            theirs = mujoco.mj_geomDistance(model, data, model.geom("probe").id, geom, 10.0, None) + 1e-3
            if theirs > 0.01:
                assert ours[name][row] == pytest.approx(theirs, abs=1e-6), name
                compared += 1
    assert compared > 100


def test_obstacles_of_sdf_are_where_drake_has_them(folder: Path, rng: np.random.Generator, tool: Callable) -> None:
    """Signed distances of points in Drake's own scene of the file; 1e-9: rounding, for a mesh its outside only."""
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    environment = Environment.from_file(folder / "a.sdf")
    assert environment.names == ("link", "shelf__low", "shelf__high_ball", "shelf__high_bar", "drum__link", "wedge__link")
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    Parser(plant).AddModels(str(folder / "a.sdf"))
    plant.Finalize()
    diagram = builder.Build()
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(diagram.CreateDefaultContext()))
    models = [plant.GetModelInstanceByName(model) for model in ("ground", "shelf", "drum", "wedge")]
    bodies = [plant.get_body(index) for model in models for index in plant.GetBodyIndices(model)]
    geometries = [geometry for body in bodies for geometry in plant.GetCollisionGeometriesForBody(body)]
    order = dict(zip(geometries, environment.names, strict=True))
    points = rng.uniform(-2.0, 2.0, (30, 3))
    ours, compared = distances(environment, points), 0
    for row, point in enumerate(points):
        for found in query.ComputeSignedDistanceToPoint(point):
            name = order[found.id_G]
            if name != "wedge__link" or found.distance > 0.0:
                assert ours[name][row] == pytest.approx(found.distance, abs=1e-9), name
                compared += 1
    assert compared >= 150


def test_obstacles_of_urdf_are_where_yourdfpy_has_them(folder: Path, tool: Callable) -> None:
    """Its transforms of links, with the origins of shapes as it reads them; 1e-12: rounding."""
    yourdfpy = tool("yourdfpy")
    environment = Environment.from_file(folder / "a.urdf")
    assert environment.names == ("table", "wedge_1", "wedge_2", "pole_stem", "pole_2")
    robot = yourdfpy.URDF.load(str(folder / "a.urdf"), load_meshes=False, build_scene_graph=True)
    shapes = [
        (link.name, shape)
        for name in ("table", "pole", "wedge")
        for link in [robot.link_map[name]]
        for shape in link.collisions
    ]
    table, wedge, rod, pole, ball = environment
    for obstacle, (link, shape) in zip((table, pole, ball, wedge), shapes, strict=True):
        origin = np.eye(4) if shape.origin is None else shape.origin
        expected = robot.get_transform(link) @ origin
        np.testing.assert_allclose(obstacle.transform_to_world[:3, 3], expected[:3, 3], atol=1e-12)
        if obstacle is not ball:
            np.testing.assert_allclose(obstacle.rotation, expected[:3, :3], atol=1e-12)
    assert isinstance(table, Box)
    np.testing.assert_array_equal(table.size, shapes[0][1].geometry.box.size)
    assert (type(pole), pole.radius, pole.length) == (Cylinder, 0.05, 0.6)
    assert (type(ball), ball.radius) == (Sphere, 0.1)
    np.testing.assert_allclose(sorted(map(tuple, wedge.vertices)), [(0, 0, 0), (0, 0, 1.0), (0, 0.4, 0), (0.3, 0, 0)])
    assert isinstance(rod, Capsule)
    ends = [rod.transform_to_world @ (0, 0, sign * 0.5 * rod.length, 1) for sign in (-1, 1)]
    np.testing.assert_allclose(
        ends, [robot.get_transform("wedge") @ (*end, 1) for end in ((0, 0, 0), (0, 0.3, 0.4))], atol=1e-12
    )


numbers = st.floats(-10.0, 10.0)
sizes = st.floats(1e-3, 1e3)
points = st.tuples(numbers, numbers, numbers)
obstacles = st.one_of(
    st.builds(HalfSpace, points.filter(any).filter(lambda v: np.linalg.norm(v) > 1e-3), numbers),
    st.builds(Sphere, sizes, points),
    st.builds(Box, st.tuples(sizes, sizes, sizes), points),
    st.builds(Cylinder, sizes, sizes, points, name=st.sampled_from([None])),
    st.builds(Capsule, sizes, sizes, points),
)


@law("Environment.from_file", "Environment.to_yaml")
@given(content=st.lists(obstacles, max_size=4), itself=st.booleans(), ending=st.sampled_from([".yaml", ".YML", ".json"]))
@settings(max_examples=25)
def test_plain_data_comes_back(content: list, itself: bool, ending: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    environment = Environment(content, self_contact=itself)
    file = tmp_path_factory.mktemp("plain") / f"a{ending}"
    file.write_text(json.dumps(environment.to_dict()) if ending == ".json" else environment.to_yaml())
    assert Environment.from_file(file) == environment
    if ending == ".yaml":
        assert yaml.safe_load(file.read_text()) == environment.to_dict()


@pytest.mark.parametrize("name", ["yes", "1e3", "~", "a: b", 'quote" \\', "Wände", "- x", "# y", "{z}"])
def test_names_come_back_from_yaml(name: str, tmp_path: Path) -> None:
    environment = Environment([Sphere(1.0, name=name)])
    (tmp_path / "a.yaml").write_text(environment.to_yaml(), encoding="utf-8")
    assert Environment.from_file(tmp_path / "a.yaml") == environment


def test_meshes_of_plain_data_are_beside_it(folder: Path) -> None:
    (folder / "a.yaml").write_text("obstacles:\n  - {kind: mesh, vertices: wedge.obj, position: [0, 0, 1]}\n")
    (mesh,) = Environment.from_file(folder / "a.yaml")
    assert mesh.vertices.max() == 0.5


def test_a_mesh_that_is_not_convex_needs_its_hull(folder: Path) -> None:
    (folder / "wedge.obj").write_text(NOTCHED)
    with pytest.raises(sr.DescriptionError, match=r"a.urdf: the collision shape 1 of wedge: .*convex.*hull=True"):
        Environment.from_file(folder / "a.urdf")
    assert len(Environment.from_file(folder / "a.urdf", hull=True)["wedge_1"].vertices) == 4


JOINT = """<link name="x"/><joint name="j" type="revolute"><parent link="world"/><child link="x"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
EGG = '<body name="egg"><geom name="e" type="ellipsoid" size=".1 .2 .3"/></body>'
BALL = '<geom size=".1"/>'


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.urdf", URDF.replace("</robot>", JOINT), "a.urdf has joints that move: j; obstacles are fixed"),
        ("a.urdf", URDF.replace("wedge.obj", "none.obj"), "a.urdf: the collision shape 1 of wedge: .*none.obj is not found"),
        ("a.urdf", URDF.replace('scale="1 1 2"', 'scale="1 1 -2"'), "the collision shape 1 of wedge: scale"),
        ("a.urdf", URDF.replace('radius="0.1"', 'radius="0"'), "the collision shape 2 of pole: radius"),
        ("a.urdf", URDF.replace('<sphere radius="0.1"/>', "<torus/>"), "a.urdf cannot be read: link pole has a shape torus"),
        (
            "a.urdf",
            URDF.replace('link="wedge" start', 'link="edge" start'),
            "a.urdf has a capsule of a link 'edge'; available: world",
        ),
        ("a.urdf", URDF.replace('start="0 0 0"', 'start="0 0 nan"'), "a capsule of link wedge has a number that is not finite"),
        ("a.urdf", URDF.replace('start="0 0 0"', 'start="0 0 1e200"'), "a capsule of link wedge has a number"),
        ("a.urdf", URDF.replace('start="0 0 0"', 'start="0 0"'), "a.urdf cannot be read: start = '0 0'; 3 numbers"),
        ("a.urdf", '<robot name="r"><link name="a"/></robot>', "a.urdf has no collision shapes; one or more"),
        ("a.urdf", "<!DOCTYPE x>" + URDF, "declares a document type"),
        ("a.urdf", "<html/>", "has the root tag <html>"),
        ("a.urdf", "nothing", "not well-formed XML"),
        ("a.xml", f'<mujoco><worldbody><body name="b"><freejoint/>{BALL}</body></worldbody></mujoco>', "free joints"),
        ("a.xml", f'<mujoco><worldbody><body><joint name="j"/>{BALL}</body></worldbody></mujoco>', "joints that move: j"),
        (
            "a.xml",
            f"<mujoco><worldbody>{BALL}{EGG}</worldbody></mujoco>",
            "collision shapes that are not read: ellipsoid 'e' of egg; required: box",
        ),
        (
            "a.xml",
            MJCF.replace('file="wedge.obj" scale="1 1 2"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 1"'),
            "not read: mesh '' of wedge",
        ),
        ("a.xml", f"<mujoco><worldbody>{BALL * 1001}</worldbody></mujoco>", "a.xml has 1001 collision shapes; at most 1000"),
        ("a.xml", "<mujoco><worldbody/></mujoco>", "has no bodies"),
        ("a.xml", MJCF.replace('size=".3"', 'size="nan"'), "MuJoCo"),
        ("a.xml", MJCF.replace('pos="2 0 0"', 'pos="-Infinity 0 0"'), "the collision shape 2 of world: position"),
        ("a.xml", MJCF.replace("<worldbody>", '<include file="/etc/passwd"/><worldbody>'), "not below the folder"),
        ("a.sdf", SDF.replace("<static>true</static><pose>-1 0 0", "<pose>-1 0 0"), "not fixed to the world"),
        ("a.sdf", SDF.replace("wedge.obj", "none.obj"), "mesh 'c' of wedge__link"),
        (
            "a.sdf",
            SDF.replace("<sphere><radius>0.15</radius></sphere>", "<ellipsoid><radii>1 1 2</radii></ellipsoid>"),
            "ellipsoid 'ball' of shelf__high",
        ),
        (
            "a.sdf",
            SDF.replace("0 1 2</normal>", "0 0 0</normal>"),
            "plane or one after it, which Drake refuses .*norm = 0.* 'c' of link",
        ),
    ],
)
def test_worlds_that_are_no_obstacles_are_refused(name: str, text: str, message: str, folder: Path) -> None:
    (folder / name).write_text(text)
    with pytest.raises(sr.DescriptionError, match=message):
        Environment.from_file(folder / name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("obstacles: [{kind: cone}]", "cannot read obstacles from .*a.yaml: .*kind of obstacle"),
        ("obstacles: [{kind: [sphere]}]", "kind of obstacle"),
        (f"obstacles: [{'{}, ' * 1001}]", "1001 obstacles; at most 1000 are read"),
        ("obstacles: [{kind: sphere, radius: -1}]", "radius"),
        ("obstacles: [{kind: sphere}]", "radius"),
        ("obstacles: [{kind: sphere, radius: 1, size: 2}]", "size"),
        ("obstacles: [{kind: sphere, radius: .inf}]", "radius"),
        ("obstacles: [{kind: sphere, radius: 1e999}]", "line 1: 1e999 is no finite number"),
        ("obstacles: &a [*a]", "anchors"),
        ("obstacles: !!python/object:os.system []", "tags"),
        ("walls: []", "as Environment.to_dict returns it"),
        ("[]", "as Environment.to_dict returns it"),
        ("", "as Environment.to_dict returns it"),
        ("obstacles: [[[[[[[]]]]]]]", "nested more than 6 deep"),
    ],
)
def test_plain_data_that_is_no_environment_is_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(sr.FileFormatError, match=message):
        Environment.from_file(tmp_path / "a.yaml")


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.ParameterError, match="path"):
        Environment.from_file(3)  # type: ignore[arg-type]
    with pytest.raises(sr.DescriptionError, match="cannot read"):
        Environment.from_file(tmp_path / "none.urdf")
    with pytest.raises(sr.FileFormatError, match="cannot read"):
        Environment.from_file(tmp_path / "none.yaml")
