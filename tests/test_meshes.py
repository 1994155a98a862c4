"""Robots with meshes: their files are found, drawn whole and in their colours, and a missing one is no disaster."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.description.mesh_files import MissingMeshWarning, find_mesh, with_absolute_paths
from softrobots.description.third_party import UR5, robot_file
from softrobots.view.mesh_triangles import Triangles
from softrobots.view.robot_shapes import RobotShapes, Shape
from softrobots.view.viewer import Viewer
from studies.shared.held_motors import with_motors_held
from tests.conftest import missing
from tests.support.foreign import INERTIAL, joint

CORNERS = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
FACES = [(1, 4, 3, 2), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8)]


def write_cube(folder: Path) -> None:
    """A unit cube, three faces red and three blue, as OBJ with its materials."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    lines = ["mtllib two.mtl", *(f"v {x} {y} {z}" for x, y, z in CORNERS)]
    for number, (a, b, c, d) in enumerate(FACES):
        lines += [f"usemtl {'red' if number < 3 else 'blue'}"] * (number % 3 == 0) + [f"f {a} {b} {c}", f"f {a} {c} {d}"]
    (folder / "cube.obj").write_text("\n".join(lines) + "\n")


def with_mesh(name: str, scale: str = "1 1 1", material: str = "") -> str:
    """A carrier of one mesh and one box, and a joint with a spring."""
    shapes = f'<mesh filename="{name}" scale="{scale}"/></geometry>{material}</visual><visual><geometry><box size="1 1 1"/>'
    return (
        f'<robot name="meshed"><link name="base">{INERTIAL}<visual><origin xyz="0 0 2" rpy="0 0 0"/><geometry>{shapes}'
        f"</geometry></visual></link>" + joint("elbow", "base", "arm", "0 1 0") + "</robot>"
    )


def load(source: str | Path) -> sr.SoftModel:
    return sr.load_model(source, springs={"elbow": 10.0})


def area(shape: Shape) -> float:
    corners = shape.geometry.corners[np.asarray(shape.geometry.faces)]
    sides = corners[:, 1:] - corners[:, :1]
    return float(0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())


@pytest.fixture(autouse=True)
def no_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def meshes(scene: RobotShapes) -> list[Shape]:
    return [shape for shape in scene.shapes if isinstance(shape.geometry, Triangles)]


def test_a_relative_mesh_is_found_and_drawn_in_its_two_colours(tmp_path: Path) -> None:
    """Half the surface of a box each; Coal alone would draw the second half at the corners of the first."""
    write_cube(tmp_path / "a & b")
    file = tmp_path / "robot.urdf"
    file.write_text(with_mesh("a &amp; b/cube.obj", "2 1 1"))
    scene = RobotShapes(load(file))
    parts = {shape.colour: area(shape) for shape in meshes(scene)}
    assert parts == pytest.approx({(1.0, 0.0, 0.0, 1.0): 2 + 2 + 2, (0.0, 0.0, 1.0, 1.0): 1 + 2 + 1}, rel=1e-6)  # float32
    assert len(scene.shapes) == 3
    assert len({shape.name for shape in scene.shapes}) == 3
    assert scene.ground() == pytest.approx(-0.5)  # the box reaches lower than the mesh
    moved = dict(zip((shape.name for shape in scene.shapes), scene.transforms(np.zeros(1)), strict=True))
    assert [float(moved[shape.name][2, 3]) for shape in scene.shapes] == [2.0, 2.0, 0.0]


def test_a_colour_in_the_description_goes_first(tmp_path: Path) -> None:
    write_cube(tmp_path)
    (tmp_path / "robot.urdf").write_text(
        with_mesh("cube.obj", material='<material name="g"><color rgba="0 1 0 0.5"/></material>')
    )
    assert {shape.colour for shape in meshes(RobotShapes(load(tmp_path / "robot.urdf")))} == {(0.0, 1.0, 0.0, 0.5)}


def test_a_mounted_robot_keeps_the_meshes_of_both_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in ("one", "two"):
        write_cube(tmp_path / folder)
        (tmp_path / folder / "robot.urdf").write_text(with_mesh("cube.obj"))
    monkeypatch.chdir(tmp_path / "one")  # a path relative to the working folder
    text = sr.mount(Path("robot.urdf"), "arm", tmp_path / "two" / "robot.urdf")
    monkeypatch.chdir("/")
    model = sr.load_model(text, springs={"soft_elbow": 1.0})
    assert len(meshes(RobotShapes(model))) == 4
    assert [shape.elastic for shape in RobotShapes(model).shapes] == [False] * 6  # both stand before the spring


@pytest.mark.parametrize("name", ["package://bench/cube.obj", "file://{folder}/bench/cube.obj", "{folder}/bench/cube.obj"])
def test_packages_and_whole_paths_are_found(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    share = tmp_path / "share"
    write_cube(share / "bench")
    text = with_mesh(name.format(folder=share))
    assert with_absolute_paths(text, Path("/other")) == text
    if name.startswith("package"):
        with pytest.warns(MissingMeshWarning, match="ROS_PACKAGE_PATH"):
            RobotShapes(load(text))
    for variable, value in (("ROS_PACKAGE_PATH", f"/nowhere:{share}"), ("AMENT_PREFIX_PATH", f"{tmp_path}:/nowhere")):
        with monkeypatch.context() as patch:
            patch.setenv(variable, value)
            assert len(meshes(RobotShapes(load(text)))) == 2


@pytest.mark.parametrize("name", ["no/such.stl", "package://nowhere/such.dae", "http://example.org/such.stl", "broken.stl"])
def test_a_missing_or_broken_mesh_is_left_out_with_a_warning(name: str, tmp_path: Path) -> None:
    (tmp_path / "broken.stl").write_text("version https://git-lfs.github.com/spec/v1\n")
    file = tmp_path / "robot.urdf"
    file.write_text(with_mesh(name))
    with pytest.warns(MissingMeshWarning, match="drawn without 1 mesh files") as caught:
        scene = RobotShapes(load(file))
    assert [type(shape.geometry).__name__ for shape in scene.shapes] == ["Box"]
    (remark,) = (warning.message for warning in caught)
    assert [Path(mesh).name for mesh in remark.meshes] == [Path(name).name]


def test_without_trimesh_the_mesh_is_still_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_cube(tmp_path)
    (tmp_path / "robot.urdf").write_text(with_mesh("cube.obj"))
    monkeypatch.setitem(sys.modules, "trimesh", None)
    (shape,) = meshes(RobotShapes(load(tmp_path / "robot.urdf")))
    assert len(shape.geometry.faces) == 12
    assert shape.colour == (0.9, 0.9, 0.9, 1.0)  # Pinocchio's own


def test_find_mesh_wants_a_file(tmp_path: Path) -> None:
    assert find_mesh(str(tmp_path)) is None
    assert find_mesh("model://a.dae") is None


@pytest.fixture(scope="module")
def carried() -> sr.SoftModel:
    """A UR5 that carries the inflatable arm, whose motors are held."""
    try:
        ur5 = robot_file(UR5)
    except sr.MissingDependency as error:
        missing(str(error))
    arm = with_motors_held(sr.InflatableArm().urdf(), {"motor_1": 0.0, "motor_2": 1.5, "motor_3": 0.0})
    return sr.load_model(sr.mount(ur5, "tool0", arm))


@pytest.mark.study
def test_a_ur5_is_drawn_whole_without_warnings(carried: sr.SoftModel) -> None:
    """The surface of its meshes is that of the files, and the rigid robot is drawn beside it only where springs move it."""
    scene = RobotShapes(carried)
    with Viewer(carried) as viewer:
        page = viewer.html()
    drawn = meshes(scene)
    assert {shape.name.split("_0")[0] for shape in drawn} == {
        "base_link", "shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link",
    }  # fmt: skip
    assert not any(shape.elastic for shape in drawn)
    assert sum(shape.elastic for shape in scene.shapes) == 4  # from the first spring on
    # Two housings of less than 0.1 m; torn as Coal reads them, the triangles reach across and add up to 0.6 m^2.
    total = sum(area(shape) for shape in drawn if shape.name.startswith("wrist_1_link"))
    assert total < 0.06
    assert scene.ground() == pytest.approx(-0.003, abs=1e-4)  # the base of the file reaches 3 mm below its origin
    assert len(page) < 6e6


def test_held_motors_do_not_mix_up_the_colours_of_the_links(carried: sr.SoftModel) -> None:
    links = {shape.name: shape.inflated_link for shape in RobotShapes(carried).shapes if shape.inflated_link is not None}
    assert links == {"soft_link_1_root_1": 0, "soft_link_1_0": 0, "soft_link_2_root_1": 1, "soft_link_2_0": 1}


def test_what_is_mounted_on_an_inflated_link_is_not_coloured_as_one() -> None:
    hand = '<robot name="hand"><link name="palm"><visual><geometry><box size=".1 .1 .1"/></geometry></visual></link></robot>'
    model = sr.load_model(sr.mount(sr.InflatableArm(), "tip", hand, prefix=""))
    links = {shape.name: shape.inflated_link for shape in RobotShapes(model).shapes}
    assert links["palm_0"] is None
    assert links["link_2_0"] == 1


def test_packages_are_those_of_example_robot_data(carried: sr.SoftModel) -> None:
    assert find_mesh("package://example-robot-data/robots/ur_description/meshes/ur5/visual/base.dae") is not None
