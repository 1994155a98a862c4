"""Meshes of robots that carry ours: found, copied, converted, and opened by the tools from another place."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType

import coal
import numpy as np
import pytest
import yourdfpy

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.description.mesh_files import find_mesh
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.third_party import UR5, robot_file
from softrobots.export import export_model, to_mjcf, to_sdf, to_urdf
from softrobots.export.meshes import MeshFiles, MeshFolder, mujoco_reads
from tests.conftest import missing

Tool = Callable[[str], ModuleType]
POSE = (0.4, -1.0, 0.7, 0.2, 0.3, -0.6, 0.1, 0.2, -0.3)


@cache
def carried() -> sr.SoftModel:
    """A UR5 that carries an inflatable arm; it names 14 meshes by `package://`, 7 of them COLLADA."""
    try:
        file = robot_file(UR5)
    except sr.MissingDependency:
        missing("example-robot-data is not installed")
    return sr.load_model(sr.mount(file, "tool0", sr.InflatableArm()))


def moved(tmp_path: Path, suffix: str) -> Path:
    """The robot in a file beside a folder of its meshes, moved to another place together."""
    export_model(carried(), tmp_path / "here" / f"whole{suffix}", mesh_folder=tmp_path / "here" / "meshes")
    shutil.move(tmp_path / "here", tmp_path / "there")
    return tmp_path / "there" / f"whole{suffix}"


def joint_values(model: sr.SoftModel, q: np.ndarray) -> dict[str, float]:
    return dict(zip(list(model.pinocchio.names)[1:], q.tolist(), strict=True))


def coal_bounds(file: Path) -> np.ndarray:
    box = coal.MeshLoader().load(str(file))
    box.computeLocalAABB()
    return np.array([np.ravel(box.aabb_local.min_), np.ravel(box.aabb_local.max_)])


@pytest.mark.study
@pytest.mark.parametrize("suffix", [".xml", ".urdf"])
def test_mujoco_opens_all_meshes_from_another_folder(tmp_path: Path, tool: Tool, suffix: str) -> None:
    mujoco = tool("mujoco")
    model = carried()
    held = sr.solve_equilibrium(model, POSE)
    file = moved(tmp_path, suffix)
    robot = mujoco.MjModel.from_xml_path(str(file))
    assert robot.nmesh == 14
    assert str(tmp_path) not in file.read_text(encoding="utf-8")
    assert "left out" not in file.read_text(encoding="utf-8")
    data = mujoco.MjData(robot)
    for name, value in joint_values(model, held.q).items():
        data.joint(name).qpos[0] = value
    mujoco.mj_kinematics(robot, data)
    assert np.abs(data.body("soft_tip").xpos - held.tip_position).max() < 1e-12


def test_a_converted_mesh_is_the_original(tmp_path: Path) -> None:
    """Coal reads the COLLADA file, and the OBJ file that trimesh's triangles became: the same box around them, to the rounding
    of COLLADA's own numbers in single precision."""
    for link in ("base", "wrist3"):
        name = f"package://example-robot-data/robots/ur_description/meshes/ur5/visual/{link}.dae"
        file, folder = find_mesh(name), MeshFolder.of(tmp_path)
        if file is None:
            missing("example-robot-data is not installed")
        copy = MeshFiles(folder).find(name, mujoco_reads)
        assert copy is not None
        assert copy.suffix == ".obj"
        assert np.abs(coal_bounds(copy) - coal_bounds(file)).max() < 1e-6


def test_drake_collides_with_copies_and_places_the_tip(tmp_path: Path, tool: Tool) -> None:
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    Parser(plant).AddModels(str(moved(tmp_path, ".sdf")))
    plant.Finalize()
    shapes = [shape.kind for body in read_rigid_tree(carried().urdf).bodies for shape in body.collisions]
    assert shapes.count("mesh") == 7
    assert plant.num_collision_geometries() == len(shapes)
    held, context = sr.solve_equilibrium(carried(), POSE), plant.CreateDefaultContext()
    for name, value in joint_values(carried(), held.q).items():
        plant.GetJointByName(name).set_angle(context, value)
    tip = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("soft_tip")).translation()
    assert np.abs(tip - held.tip_position).max() < 1e-12


@pytest.mark.study
def test_yourdfpy_opens_the_urdf_with_its_meshes(tmp_path: Path) -> None:
    """Copied or where they are, the meshes have the same corners; and the file is the same robot."""
    copied = moved(tmp_path, ".urdf")
    there = export_model(carried(), tmp_path / "there.urdf")
    first, second = (yourdfpy.URDF.load(str(file)).scene for file in (copied, there))
    assert len(first.geometry) >= 7
    assert np.abs(first.bounds - second.bounds).max() < 1e-6
    again = sr.load_model(copied)
    assert again.spring_table == carried().spring_table
    poses = [sr.solve_equilibrium(one, POSE, (0, 0, -2), gravity=sr.EARTH_GRAVITY) for one in (carried(), again)]
    np.testing.assert_array_equal(poses[0].q, poses[1].q)


def test_meshes_that_cannot_be_copied_keep_their_name_and_are_counted(tmp_path: Path) -> None:
    """No file of another kind is copied, whatever a description names, and none is written twice."""
    (tmp_path / "secret.txt").write_text("key")
    (tmp_path / "damaged.dae").write_text("<!DOCTYPE a><COLLADA/>")
    (tmp_path / "cube.stl").write_text("solid a\nendsolid a\n")
    shapes = "".join(
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("package://no/such.stl", *(str(tmp_path / name) for name in ("secret.txt", "damaged.dae", "cube.stl")))
    )
    model = sr.load_model(sr.InflatableArm().urdf().replace('<link name="link_1">', f'<link name="link_1">{shapes}'))
    folder = tmp_path / "meshes"
    for write, text in ((to_mjcf, "left out: 4"), (to_sdf, "left out: 2"), (to_urdf, "keep their name: 4")):
        assert text in " ".join(write(model, mesh_folder=folder).split())
    assert {file.suffix for file in folder.iterdir()} == {".dae", ".stl"}  # which Gazebo may draw
    assert "package://no/such.stl" in to_urdf(model)
    with pytest.raises(sr.ParameterError, match="mesh_folder must be a path"):
        to_urdf(model, mesh_folder=3)
    with pytest.raises(sr.ParameterError, match="formats that have it: mjcf, sdf, urdf"):
        export_model(model, tmp_path / "a.json", mesh_folder=folder)


@pytest.mark.study
def test_the_command_copies_meshes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "whole.urdf").write_text(carried().urdf)
    words = ["export", str(tmp_path / "whole.urdf"), "-o", str(tmp_path / "out" / "whole.xml"), "--mesh-folder"]
    assert cli.main([*words, str(tmp_path / "out" / "meshes")]) == 0
    assert len(list((tmp_path / "out" / "meshes").iterdir())) == 14
    assert (tmp_path / "out" / "whole.xml").read_text().count('file="meshes/') == 14
    assert capsys.readouterr().err == ""


def test_a_mass_without_moments_of_inertia_is_told_once(capfd: pytest.CaptureFixture[str]) -> None:
    """And not by urdfdom: it is a point mass, with its whole weight."""
    payload = '<robot name="load"><link name="payload"><inertial><mass value="0.5"/></inertial></link></robot>'
    with pytest.warns(UserWarning, match="1 links of the text have a mass and no <inertia>") as told:
        whole = sr.mount(sr.InflatableArm(), "tip", payload)
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = sr.load_model(whole)
    assert capfd.readouterr().err == ""
    weight = sum(one.mass for one in model.pinocchio.inertias) - sum(
        one.mass for one in sr.load_model(sr.InflatableArm()).pinocchio.inertias
    )
    assert abs(weight - 0.5) < 1e-12
    held = sr.solve_equilibrium(model, (0.1, 0.2, -0.3), gravity=sr.EARTH_GRAVITY)
    ours = sr.solve_equilibrium(
        sr.load_model(sr.InflatableArm()), (0.1, 0.2, -0.3), (0, 0, 0.5 * sr.EARTH_GRAVITY[2]), gravity=sr.EARTH_GRAVITY
    )
    assert np.abs(held.q - ours.q).max() < 1e-12  # the weight is a force at the tip
