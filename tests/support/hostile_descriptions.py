"""Readers of descriptions and meshes, with valid files of each to be damaged; and what is to be true of what they read."""

from __future__ import annotations

import struct
import warnings
from functools import cache
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots.description.expansion import expand
from softrobots.description.mesh_files import MissingMeshWarning
from softrobots.description.third_party import UR5, robot_file
from softrobots.export import to_mjcf, to_sdf
from softrobots.view.robot_shapes import RobotShapes
from tests.support.foreign import BRANCHED, INERTIAL, LIMIT

SDF = """<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="m">
<link name="a"><inertial><mass>1</mass><inertia><ixx>.1</ixx><iyy>.1</iyy><izz>.1</izz></inertia></inertial></link>
<joint name="w" type="fixed"><parent>world</parent><child>a</child></joint>
<link name="b"><pose relative_to="a">0 0 .2 .1 0 0</pose><inertial><pose>0 0 .1 0 0 0</pose><mass>.5</mass>
<inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>
<visual name="v"><geometry><cylinder><radius>.1</radius><length>.2</length></cylinder></geometry></visual></link>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 1 0</xyz><limit><lower>-1</lower>
<upper>1</upper><effort>5</effort></limit><dynamics><spring_stiffness>20</spring_stiffness>
<spring_reference>.1</spring_reference></dynamics></axis></joint>
<model name="n"><link name="c"><pose relative_to="__model__">0 0 .4 0 0 0</pose><inertial><mass>.1</mass></inertial>
<collision name="k"><geometry><mesh><uri>none.obj</uri></mesh></geometry></collision></link></model>
<joint name="p" type="prismatic"><pose>0 .1 0 0 0 .2</pose><parent>b</parent><child>n::c</child><axis>
<xyz expressed_in="a">1 0 0
</xyz></axis></joint><frame name="tip" attached_to="b"><pose>0 0 .3 0 0 0</pose></frame></model></sdf>"""
"""A sprung hinge on the world, with a frame for its tip."""

MJCF = """<mujoco model="much"><size nkey="2" nuserdata="3" memory="20M"/><custom><numeric name="n" size="4" data="1"/></custom>
<compiler angle="degree"><lengthrange inttotal="1" timestep=".01"/></compiler>
<default><default class="a"><joint stiffness="3" damping=".1"/><geom density="500"/></default></default>
<asset>
<texture name="t" type="2d" builtin="checker" width="8" height="8" rgb1="1 0 0"/><material name="m" texture="t"/>
<hfield name="h" nrow="3" ncol="3" size="1 1 .1 .1" elevation="0 0 0 0 1 0 0 0 0"/>
<mesh name="s" builtin="sphere" params="1"/><mesh name="v" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
<worldbody><geom type="hfield" hfield="h"/><camera name="c" resolution="4 4" pos="0 0 2"/><light pos="0 0 3"/>
<body name="one" pos="0 0 1"><joint name="j" axis="0 1 0" class="a" springref="5" range="-90 90"/>
<geom type="mesh" mesh="s" material="m"/>
<replicate count="3" offset=".1 0 0"><geom size=".01" rgba="0 0 1 1"/></replicate>
<body name="two" pos=".2 0 0"><joint name="k" type="slide" axis="1 0 0" stiffness="50"/><joint name="l" axis="0 0 1"/>
<geom type="mesh" mesh="v" mass=".1"/><site name="tip" pos=".1 0 0"/></body></body></worldbody>
<sensor><jointpos joint="j"/><user dim="2"/></sensor><actuator><motor joint="l" gear="2"/></actuator>
<keyframe><key qpos="0 0 .1"/></keyframe></mujoco>"""
"""What makes MuJoCo set memory aside or compute: sizes, generated meshes and textures, replicas, sensors, keys."""

XACRO = """<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"
 xmlns:softrobots="urn:softrobots:urdf"><xacro:arg name="length" default="0.3"/><xacro:property name="l"
 value="$(arg length)"/><xacro:macro name="part" params="n p *o"><link name="l${n}"><xacro:insert_block name="o"/></link>
<joint name="j${n}" type="revolute"><parent link="${p}"/><child link="l${n}"/><origin xyz="0 0 ${l * 2}"/>
<axis xyz="0 1 0"/>LIMIT
</joint></xacro:macro><link name="base"/><xacro:part n="1" p="base">INERTIAL</xacro:part><xacro:if value="${l > 0.1}">
<xacro:part n="2" p="l1">INERTIAL</xacro:part></xacro:if></robot>""".replace("LIMIT", LIMIT).replace("INERTIAL", INERTIAL)
"""An argument, a property, a macro with a block, and a condition."""


def check_model(model: sr.SoftModel) -> None:
    """A valid model solves to finite numbers, or says why not."""
    try:
        found = sr.solve_equilibrium(model, model.relaxed_motors, (0.1, 0.2, -0.3), gravity=sr.EARTH_GRAVITY)
    except sr.SoftRobotsError:
        return
    for numbers in (found.tip_position, found.q_springs, found.tangent_stiffness, found.motor_torques, found.residual):
        if not np.all(np.isfinite(numbers)):
            raise ArithmeticError("an equilibrium with a number that is not finite")


def _pcc(**options: object) -> sr.PccArm:
    return sr.PccArm(segment_lengths=(0.5,), elastic_sections=1, hinges=2, **options)


def _ur5() -> list[bytes]:
    try:
        return [robot_file(UR5).read_bytes()]
    except sr.MissingDependency:
        return []


@cache
def urdf_corpus() -> list[bytes]:
    """Our arm, sections, lumped sections, a helix, somebody's tree, and the UR5 where it is installed."""
    helix = sr.HelixTube(length=0.3, elastic_sections=4)
    texts = [sr.InflatableArm().urdf(), _pcc().urdf(), _pcc(chain="lumped").urdf(), helix.urdf(), BRANCHED]
    return [*(text.encode() for text in texts), *_ur5()]


@cache
def mjcf_corpus() -> list[bytes]:
    """Exports, and what other people write: degrees, classes, frames, several joints a body."""
    from tests.support.foreign import ARM

    return [ARM.encode(), MJCF.encode(), to_mjcf(sr.load_model(sr.InflatableArm())).encode()]


@cache
def sdf_corpus() -> list[bytes]:
    """An export, and what other people write."""
    return [SDF.encode(), to_sdf(sr.load_model(sr.InflatableArm())).encode()]


def mounted_corpus() -> list[bytes]:
    """Small robots with a link `base`."""
    small = sr.InflatableArm(link_lengths=(0.5,)).urdf().replace('"world"', '"base"')
    return [BRANCHED.replace("gripper", "grip}er$(arg x)").encode(), small.encode()]


def xacro_corpus() -> list[bytes]:
    """A xacro file of somebody."""
    return [XACRO.encode()]


def read_description(file: Path) -> None:
    """Load a description as a file and solve; without springs of its own it is rigid."""
    text = file.read_bytes()
    ours = any(word in text for word in (b"softrobots:spring", b"softrobots:section", b"stiffness"))
    check_model(sr.load_model(file, springs=None if ours else {}, tip=_tip_of(text)))


def _tip_of(text: bytes) -> str | None:
    """The tip of the robots of somebody else in the corpus, which have several ends."""
    return next((name.decode() for name in (b"finger", b"tool0") if b'name="%s"' % name in text), None)


def read_text(file: Path) -> None:
    """The same from text, as a caller would have it."""
    text = file.read_bytes()
    springs = {} if b"lumped_section" not in text else None
    description = "<" + text.decode("utf-8", "surrogateescape").partition("<")[2]
    check_model(sr.load_model(description, springs=springs, tip=_tip_of(text)))


def world_corpus() -> list[bytes]:
    """A table with a post, and a robot that stands still."""
    return [
        b'<robot name="w" xmlns:s="urn:softrobots:urdf"><link name="a"><collision><geometry><box size="1 1 .1"/></geometry>'
        b'</collision><collision name="c"><origin xyz="0 0 .4" rpy="0 .1 0"/><geometry><cylinder radius=".1" length=".5"/>'
        b'</geometry></collision></link><link name="b"><collision><geometry><sphere radius=".2"/></geometry></collision></link>'
        b'<joint name="j" type="fixed"><origin xyz="1 0 0" rpy="0 0 .5"/><parent link="a"/><child link="b"/></joint>'
        b'<s:capsule link="b" start="0 0 0" end="0 0 1" radius=".1"/></robot>'
    ]


def mjcf_world_corpus() -> list[bytes]:
    """Every kind of shape that is read, and one that is not seen."""
    return [
        b'<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1" euler="10 0 0"/>'
        b'<geom type="sphere" size=".3" pos="2 0 0"/>'
        b'<body name="post" pos="1 0 0" euler="0 30 0"><geom type="capsule" fromto="0 0 0 0 0 1" size=".1"/>'
        b'<geom type="box" size=".1 .2 .3" contype="0"/><body pos="0 .5 0"><geom type="cylinder" size=".1 .4"/></body></body>'
        b"</worldbody></mujoco>"
    ]


def sdf_world_corpus() -> list[bytes]:
    """A ground and a shelf."""
    return [
        b'<sdf version="1.9"><world name="w"><model name="g"><static>true</static><link name="l"><collision name="c"><geometry>'
        b"<plane><normal>0 0 1</normal></plane></geometry></collision></link></model>"
        b'<model name="s"><static>true</static><pose>1 0 0 0 .1 0</pose><link name="l"><collision name="c">'
        b"<pose>0 0 1 0 0 0</pose><geometry><box><size>1 1 .1</size></box></geometry></collision>"
        b'<collision name="d"><geometry><capsule><radius>.1</radius>'
        b"<length>.5</length></capsule></geometry></collision></link></model></world></sdf>"
    ]


def read_world(file: Path) -> None:
    """Its obstacles, all finite."""
    for obstacle in sr.Environment.from_file(file):
        transform = obstacle.transform_to_world
        if not np.all(np.isfinite(transform)) or abs(np.linalg.det(transform) - 1.0) > 1e-6:
            raise RuntimeError(f"an obstacle {obstacle}")


def read_xacro(file: Path) -> None:
    """Expand and load."""
    sr.load_model(expand(file), springs={})


def read_mounted(file: Path) -> None:
    """Somebody's robot carries ours, and is carried by it."""
    sr.load_model(sr.mount(file, "base", sr.InflatableArm(link_lengths=(0.5,))))
    sr.load_model(sr.mount(sr.InflatableArm(link_lengths=(0.5,)), "tip", file))


def drawn(mesh: str) -> str:
    """A URDF that draws a mesh."""
    return f'<robot name="r"><link name="a"><visual><geometry><mesh filename="{mesh}"/></geometry></visual></link></robot>'


def read_mesh(file: Path) -> None:
    """Draw the mesh, or leave it out with a warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scene = RobotShapes(sr.load_model(drawn(str(file)), springs={}))
        scene.transforms(np.zeros(0))
    if any(not issubclass(warning.category, MissingMeshWarning) for warning in caught):
        raise RuntimeError(f"a warning of another kind: {[str(warning.message) for warning in caught]}")
    if caught:
        raise sr.DescriptionError(str(caught[0].message))
    if not scene.shapes:
        raise RuntimeError("neither drawn nor left out")


def stl() -> list[bytes]:
    """A tetrahedron, binary and as text."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    binary = b"tetrahedron".ljust(80, b" ") + struct.pack("<I", 4)
    binary += b"".join(np.zeros(3, "<f4").tobytes() + corners[list(face)].tobytes() + b"\0\0" for face in faces)
    lines = ["solid t"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {} {} {}".format(*corners[k]) for k in face]
        lines += ["endloop", "endfacet"]
    return [binary, "\n".join([*lines, "endsolid t\n"]).encode()]


def obj() -> list[bytes]:
    """A tetrahedron with texture coordinates and normals, one in groups."""
    corners = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n"
    return [
        corners + b"f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n",
        b"mtllib none.mtl\no a\n" + corners + b"usemtl m\ng one\nf 1/1/1 3/1/1 2/1/1\ng two\nf 1//1 2//1 4//1\nf -3 -2 -1\n",
    ]


def dae() -> list[bytes]:
    """A triangle in COLLADA."""
    return [
        b"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit name="m" meter="1"/>
<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g" name="g"><mesh><source id="p">
<float_array id="pa" count="12">0 0 0 1 0 0
0 1 0 0 0 1</float_array><technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y"
type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION"
source="#p"/></vertices><triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 1 2 3 0 3 2</p>
</triangles></mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s" name="s"><node id="n" name="n">
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""
    ]
