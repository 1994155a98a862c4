"""The description: xacro, the dataclass and the committed URDF say the same; what they say is physically consistent."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import xacro
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.expansion import XACRO_NAMESPACE, declared_arguments, expand
from softrobots.description.paths import urdf_folder, xacro_folder
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import NAMESPACE
from softrobots.robots import HelixTube, PccArm, TendonArm
from softrobots.robots.fields import argument_text, default_text, facts_of
from tests.conftest import CHECKOUT
from tests.support.laws import law
from tests.support.oracles import tube_points
from tests.support.tables import each_row

XACRO = xacro_folder() / sr.InflatableArm.XACRO
KINDS = (sr.InflatableArm, PccArm, TendonArm, HelixTube)
SHARED = {PccArm: "continuum_arm_macro.xacro", TendonArm: "continuum_arm_macro.xacro"}  # macros of several robots
SOURCES = {"Troise", "PCC", "Blumenschein", "OpenCR", "assumed", "chosen"}
ODD = {
    "link_lengths": (0.5, 0.4, 0.3),
    "hinge_offset": (0.03, 0.05, 0.02),
    "stiffness": (250.0, 120.0, 80.0),
    "rest_up": 0.1,
    "max_moment": (20.0, 15.5, 9.45),
    "wrist": (0.08, 0.12),
    "wrist_limits": (1.5, 1.2, 3.0),
}
ODD_WALLS = {
    "link_model": "two_hinges",
    "torsion": True,
    "young_modulus": (1.2e8, 1.4e8),
    "shear_modulus": 3e7,
    "pressure": (5e4, 4e4),
    "payload": (0.3, 0.0, 0.02, -0.01),
}
ODD_PCC = {
    "segment_lengths": (0.5, 0.4, 0.3),
    "offset": (0.1, -1.0, 2.0),
    "muscle_azimuths": (),
    "bending_stiffness": (2.0, 1.5, 0.5),
    "rgba": ((1.0, 0.5, 0.25, 1.0), (0.5, 0.25, 1.0, 1.0), (0.1, 0.2, 0.3, 0.4)),
    "elastic_sections": 2,
}
ODD_MUSCLES = {
    "segment_lengths": (0.5, 0.4),
    "elastic_sections": 1,
    "kind": ("mckibben", "elastic"),
    "routing": [
        sr.Route(at=(0.1, 0.9), azimuth=(0.2, 6.0), distance=(0.04, 0.03)),
        {"at": (0, 0.5), "azimuth": 0, "distance": 0.02},
    ],
    "muscle_braid_angle": 0.5,
    "muscle_pretension": (0.0, 3.0),
    "bending_friction": (0.1, 0.0),
    "guide_friction": 0.2,
    "muscle_least_tension": (0.0, -2.0),
}
ODD_TENDONS = {
    "segment_lengths": (0.1, 0.08, 0.05),
    "offset": (0.1, -1.0, 2.0),
    "routing": ("segment", "base", 2),
    "kind": ("tension", "elastic", "tension"),
    "tendon_azimuths": (0.0, 3.0),
    "backbone_radius": (1e-3, 8e-4, 5e-4),
    "axial_stiffness": (900.0, 800.0, 700.0),
}
ODD_LUMPED = {"chain": "lumped", "hinges": 3, "hinge_rule": "midpoint", "torsion": False, "radius": (0.05, 0.03)}
ODD_TUBE = {
    "length": 0.8,
    "diameter": 0.05,
    "contraction": 0.9,
    "angle": 0.3,
    "handedness": "left",
    "upright": "axis",
    "pressure": 0.0,
    "poisson_ratio": -0.2,
    "actuator_density": 0.02,
    "bending_stiffness": 0.4,
    "axial_stiffness": 900.0,
    "rgba": (1.0, 0.5, 0.25, 0.4),
    "elastic_sections": 5,
    "allow_self_contact": True,
}
LUMPED_TUBE = {"chain": "lumped", "hinges": 3, "hinge_rule": "midpoint", "extension": False, "torsional_stiffness": 0.2}


def without_banner(text: str) -> str:
    """Drop the four comments that the xacro command puts on top."""
    lines = text.splitlines(keepends=True)
    return "".join([lines[0], *lines[5:]])


@pytest.mark.parametrize("name", sr.ROBOTS)
def test_committed_urdf_is_what_xacro_generates(name: str) -> None:
    assert (urdf_folder() / f"{name}.urdf").read_bytes() == sr.ROBOTS[name]().urdf().encode("utf-8")


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        (sr.InflatableArm, {}),
        (sr.InflatableArm, ODD),
        (sr.InflatableArm, ODD_WALLS),
        (PccArm, ODD_LUMPED),
        *(pytest.param(PccArm, odd, marks=pytest.mark.study) for odd in ({}, ODD_PCC, ODD_MUSCLES)),
        *(pytest.param(TendonArm, odd, marks=pytest.mark.study) for odd in ({}, ODD_TENDONS)),
        *(pytest.param(HelixTube, odd, marks=pytest.mark.study) for odd in ({}, ODD_TUBE, LUMPED_TUBE)),
    ],
)
def test_xacro_command_alone_gives_the_same_urdf(kind: type, parameters: dict) -> None:
    robot = kind(**parameters)
    given_arguments = [f"{name}:={value}" for name, value in robot.xacro_arguments().items()] if parameters else []
    command = [str(Path(sys.executable).parent / "xacro"), str(xacro_folder() / kind.XACRO), *given_arguments]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert without_banner(printed) == robot.urdf()


@pytest.mark.parametrize("kind", KINDS)
def test_the_arguments_of_the_xacro_file_are_the_fields_of_the_dataclass(kind: type) -> None:
    """Name, order, default and comment: meaning, unit, source. What is allowed of a design is no part of its description."""
    expected = []
    for field in dataclasses.fields(kind):
        facts = field.metadata["facts"]
        if facts.in_xacro:
            expected.append(f"  <!-- {facts.what} [{facts.unit or '-'}]. Source: {facts.source}. -->")
            expected.append(f'  <xacro:arg name="{field.name}" default="{default_text(field)}"/>')
    lines = (xacro_folder() / kind.XACRO).read_text(encoding="utf-8").splitlines()
    first = next(number for number, line in enumerate(lines) if "<xacro:arg " in line) - 1
    assert lines[first : first + len(expected)] == expected
    assert sum("<xacro:arg " in line for line in lines) == len(expected) // 2
    assert list(kind().xacro_arguments()) == list(declared_arguments(xacro_folder() / kind.XACRO))
    assert {facts.source.split()[0].strip(",;") for facts in facts_of(kind).values()} <= SOURCES


@pytest.mark.parametrize("kind", KINDS)
def test_the_xacro_files_check_the_bounds_of_the_dataclass(kind: type) -> None:
    """Lower bounds, and upper ones where the macros state them; the xacro files are used alone, too."""
    macros = Path(str(xacro_folder() / kind.XACRO).replace(".urdf.xacro", "_macro.xacro")).read_text(encoding="utf-8")
    if kind in SHARED:
        macros += (xacro_folder() / SHARED[kind]).read_text(encoding="utf-8")
    bounded = {name for name, facts in facts_of(kind).items() if facts.unit and facts.bounds}
    assert {name for name in bounded if re.search(rf'<xacro:number(?:_list|_or)? name="{name}"', macros)} == bounded
    for name, facts in facts_of(kind).items():
        for attributes in re.findall(rf'<xacro:number(?:_list)? name="{name}"(.*?)/>', macros):
            texts = dict(re.findall(r'(\w+)="(?:\$\{)?([^"}]*)\}?"', attributes))
            low, high = (eval(texts.get(key, "None"), {"pi": math.pi}) for key in ("low", "high"))
            assert (None, low)[:: 1 if "strict" in texts else -1] == (facts.at_least, facts.above), name
            assert high in (None, facts.at_most), name


def test_the_table_of_the_guide_has_the_defaults_of_the_arm() -> None:
    """A cell has a value for each name, or one for all: `0.055 m, 0.5 mm`, `(0.6, 0.6) m`, `none: ...`."""
    page = (CHECKOUT / "docs" / "inflatable_arm.md").read_text(encoding="utf-8")
    facts, scales = facts_of(sr.InflatableArm), {"mm": (1e-3, "m"), "kPa": (1e3, "Pa")}
    defaults = {field.name: field.default for field in dataclasses.fields(sr.InflatableArm)}
    checked = []
    for names, cell in re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]*) \|", page, flags=re.MULTILINE)[:13]:
        values = re.findall(r"(\([\d., ]+\)|[\d.]+|pi|none|paper|false) ?([^,:]*)", cell)
        for name, (number, unit) in zip(re.findall(r"\w+", names), itertools.cycle(values), strict=False):
            scale, unit = scales.get(unit, (1.0, unit))
            if number in ("none", "paper", "false"):
                assert argument_text(defaults[name]) == number.replace("none", "")
            else:
                assert np.allclose(scale * np.array(eval(number, {"pi": math.pi})), defaults[name], rtol=1e-15), name
                assert unit == facts[name].unit, name
            checked.append(name)
    assert len(checked) == 17


def test_mass_centre_and_inertia_are_those_of_two_capped_tubes() -> None:
    """Cutting hinge, shoulder and tip out of the wall changes nothing: compared with a cloud of point masses.

    The cloud has 400 slices of 24 points: midpoint sums of x^2 err by 1/(4 400^2) = 1.6e-6 relative.
    """
    robot = sr.InflatableArm(link_lengths=(0.6, 0.4), radius=(0.055, 0.045), cap_mass=(0.1, 0.07))
    model = sr.load_model(robot)
    clouds = []
    for start, length, radius, cap in ((0.0, 0.6, 0.055, 0.1), (0.6, 0.4, 0.045, 0.07)):
        wall = 1300.0 * 2 * np.pi * radius * 0.0005 * length
        points, masses = tube_points(length, radius, wall, cap)
        clouds.append((points + [start, 0.0, 0.0], masses))
    points, masses = np.vstack([p for p, _ in clouds]), np.concatenate([m for _, m in clouds])
    total, centre = masses.sum(), masses @ points / masses.sum()
    arm = points - centre
    inertia = np.einsum(
        "i,ijk->jk", masses, np.einsum("i,jk->ijk", (arm**2).sum(1), np.eye(3)) - np.einsum("ij,ik->ijk", arm, arm)
    )
    data = model.pinocchio.createData()
    pin.ccrba(model.pinocchio, data, pin.neutral(model.pinocchio), np.zeros(model.pinocchio.nv))
    assert sum(body.mass for body in model.pinocchio.inertias[1:]) == pytest.approx(total, rel=1e-12)
    assert np.allclose(data.com[0], centre, atol=1e-12)
    assert np.allclose(np.array(data.Ig.inertia), inertia, rtol=5e-6, atol=1e-12)


link = st.fixed_dictionaries(
    {
        "link_lengths": st.floats(0.15, 2.0),
        "share": st.floats(0.02, 0.7),  # of the largest length below the offset that looks like one in centimetres
        "radius": st.floats(0.01, 0.1),
        "wall_thickness": st.floats(2e-4, 1e-3),
        "stiffness": st.floats(0.1, 1e5),
        "rest_side": st.floats(-1.5, 1.5, allow_subnormal=False),
        "rest_up": st.floats(-1.5, 1.5, allow_subnormal=False),
        "pressure": st.just(0.0) | st.floats(200.0, 1e5),
        "density": st.floats(500.0, 2000.0),
        "cap_mass": st.floats(0.0, 1.0, allow_subnormal=False),
    }
)


@pytest.mark.study
@law("InflatableArm")
@given(
    st.lists(link, min_size=1, max_size=6),
    st.none() | st.tuples(st.just(0.0) | st.floats(1e-3, 0.5), st.floats(1e-2, 0.5)),
)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_any_valid_arm_obeys_the_rules_of_portable_urdf(links: list[dict], wrist: tuple[float, float] | None) -> None:
    """Positive mass above 1e-6 kg, triangle inequality, finite limits, unique names, both copies of every spring."""
    columns = {name: [item[name] for item in links] for name in links[0] if name != "share"}
    offsets = [item["share"] * item["link_lengths"] for item in links]
    walls = [2 * np.pi * item["radius"] * item["wall_thickness"] * item["density"] * item["link_lengths"] for item in links]
    assume(min(wall * min(item["share"], 1 - item["share"]) for wall, item in zip(walls, links, strict=True)) > 2.1e-5)
    root = ElementTree.fromstring(sr.InflatableArm(**columns, hinge_offset=offsets, wrist=wrist).urdf())
    assert root.get("version") is None
    assert root[0].tag == "mujoco"
    assert root.find("link").get("name") == "world"
    names = [element.get("name") for element in root if element.tag in ("link", "joint")]
    assert len(set(names)) == len(names)
    assert all(name.isascii() for name in names)
    for body in root.findall("link")[1:]:
        mass = float(body.find("inertial/mass").get("value"))
        tensor = body.find("inertial/inertia")
        a, b, c = sorted(float(tensor.get(key)) for key in ("ixx", "iyy", "izz"))
        assert mass > 1e-6, body.get("name")
        assert a > 1e-15
        assert a + b >= c
    springs = {}
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed":
            continue
        assert joint.get("type") == "revolute"
        limit = {key: float(joint.find("limit").get(key)) for key in ("lower", "upper", "effort", "velocity")}
        assert limit["lower"] < limit["upper"]
        assert min(limit["effort"], limit["velocity"]) > 0.0
        assert np.isfinite(list(limit.values())).all()
        spring = joint.find(f"{{{NAMESPACE}}}spring")
        role = joint.find(f"{{{NAMESPACE}}}role").get("value")
        assert role == ("motor" if spring is None else "spring")
        if spring is not None:
            springs[joint.get("name")] = (spring.get("stiffness"), spring.get("rest"))
    copies = {
        gazebo.get("reference"): (gazebo.find("springStiffness").text, gazebo.find("springReference").text)
        for gazebo in root.findall("gazebo")
        if gazebo.find("springStiffness") is not None
    }
    assert copies == springs
    assert len(springs) == 2 * len(links)


@pytest.mark.study
def test_many_links_expand() -> None:
    """Recursion by halves: a linear one dies at about 300 links (measured), and costs more than in proportion."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.2,) * 90))
    assert model.n_motors == 91
    assert model.n_springs == 180


def test_collision_shapes_across_a_hinge_do_not_touch(arm: sr.SoftModel) -> None:
    """Links i and i + 2 around the tiny hinge link: with every spring at 0.4 rad no pair of shapes is nearer than 1 cm."""
    model = arm.pinocchio
    geometry = pin.buildGeomFromUrdfString(model, arm.urdf, pin.GeometryType.COLLISION)
    geometry.addAllCollisionPairs()
    data = geometry.createData()
    pin.computeDistances(model, model.createData(), geometry, data, arm.configuration([0.3, 0.4, -0.9], [0.4, 0.4, 0.4, 0.4]))
    assert min(result.min_distance for result in data.distanceResults) > 0.01


@each_row(
    ("arguments", "message"),
    [
        ({"radios": "0.05"}, "no argument 'radios'; declared: link_lengths, hinge_offset, radius"),
        ({"radius": 0.05}, "xacro arguments are text"),
        ({"radius": "abc"}, "abc.*declared: link_lengths"),
        ({"radius": "[0.05,0.05,0.05]"}, "radius has 3 values"),
        ({"radius": "nan"}, "finite numbers are required"),
        ({"stiffness": "-1"}, "stiffness .* required > 0"),
        ({"pressure": "-1"}, "pressure .* required >= 0"),
        ({"rest_up": "2.0"}, "rest_up .* required <="),
        ({"hinge_offset": "0.6"}, "hinge_offset .* required below link_lengths"),
        ({"hinge_offset": "1e-5"}, "too light"),
        ({"rgba": "1 0 0 1, 0 1 0 1, 0 0 1 1"}, "rgba has 3 colours"),
        ({"motor_limit": "[1,2]"}, "motor_limit has 2 values"),
        ({"rgba": "red"}, "could not convert"),
        ({"rgba": "1 0 0"}, "red, green, blue and opacity"),
        ({"rgba": "1 0 0 2"}, "red, green, blue and opacity"),
        ({"wall_thickness": "0.006"}, "at most a tenth of radius"),
        ({"link_lengths": ""}, "could not convert"),
        ({"density": "__import__('os')"}, "could not convert"),
    ],
)
def test_bad_arguments_of_the_xacro_file_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        expand(XACRO, arguments)


def test_texts_are_evaluated_as_by_xacro_itself(tmp_path: Path) -> None:
    """Escapes, lone dollars, several expressions, lazy properties, arguments, calls with other values of the same text.

    Blocks, conditions, calls by name, and elements and attributes with computed names; comments, and namespaces of macros.
    """
    texts = ("", " ", "a$b", "$", "$${x}", "$$$(arg size)", "${x}", "${x}${y}m", "$(arg size) m", "${'%.3f' % z} ${[x, y][1]}")
    links = "".join(f"<link name='${{tag}}_{number}' text=\"{text}\">{text}</link>" for number, text in enumerate(texts))
    file = tmp_path / "texts.xacro"
    file.write_text(
        f"<robot name='r' xmlns:xacro='{XACRO_NAMESPACE}'><xacro:arg name='size' default='2'/>"
        "<xacro:property name='z' value='${x / 7}'/><xacro:property name='x' value='$(arg size)'/>"
        f"<xacro:macro name='row' params='tag y:=${{z}}'><xacro:property name='x' value='${{y + 1}}'/>{links}</xacro:macro>"
        "<xacro:macro name='box' params='*one **all' xmlns:more='urn:more'><more:tag xacro:note='b' z='1' a='&lt;&quot;&amp;'>"
        "<xacro:insert_block name='one'/>\n\n<!-- kept -->\n<xacro:insert_block name='all'/>"
        "<!-- gone -->\n<xacro:if value='${x > 1}'>"
        "<xacro:element xacro:name='e${x}' c='${y}'><xacro:attribute name='d' value='s${x}'/></xacro:element></xacro:if>"
        "<xacro:unless value='${x > 1}'><!-- a word -->none</xacro:unless></more:tag></xacro:macro>"
        "<xacro:property name='y' value='${2 * x}'/>"
        "<xacro:box><one n='${x}'/><all>\n <inner/> text <inner m='${y}'> </inner></all></xacro:box>"
        '<xacro:call macro=\'${"bo" + "x"}\'><one/><all/></xacro:call>'
        "<xacro:row tag='a'/><xacro:row tag='b' y='3'/><!-- xacro:eval-comments --><!-- ${x} --></robot>",
        encoding="utf-8",
    )
    for size in ("2", "0.5", "2"):
        own = xacro.process_file(str(file), mappings={"size": size}).toprettyxml(indent="  ")
        assert expand(file, {"size": size}) == without_banner(own)
    file.write_text(file.read_text(encoding="utf-8").replace("${x / 7}", "${x.__class__}"), encoding="utf-8")
    for _ in range(2):
        with pytest.raises(sr.DescriptionError, match=r"invalid name.*__class__"):
            expand(file)


def test_files_that_are_no_robot_are_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.DescriptionError, match="without links; is it a file of macros"):
        expand(xacro_folder() / "macros" / "joints.xacro")
    with pytest.raises(sr.DescriptionError, match=r"cannot read .*: No such file"):
        expand(tmp_path / "missing.xacro")
    broken = tmp_path / "broken.xacro"
    broken.write_text("<robot", encoding="utf-8")
    with pytest.raises(sr.DescriptionError, match="not well-formed"):
        expand(broken)
    with pytest.raises(sr.DescriptionError, match="unexpanded xacro"):
        read_tags(XACRO.read_text(encoding="utf-8"))


def robot_with(joint: str = "", inside: str = "") -> str:
    return f'<robot name="r" xmlns:softrobots="{NAMESPACE}"><joint name="j" type="revolute">{joint}</joint>{inside}</robot>'


@each_row(
    ("text", "message"),
    [
        ("<mujoco/>", "root tag <mujoco>; <robot> is required"),
        (robot_with('<softrobots:spring stiffness="0" rest="0"/>'), "positive number is required"),
        (robot_with('<softrobots:spring stiffness="inf" rest="0"/>'), "finite number is required"),
        (robot_with('<softrobots:spring stiffness="10"/>'), "rest = None; a finite number"),
        (robot_with('<softrobots:role value="spring"/>'), "role 'spring' and no spring"),
        (
            robot_with('<softrobots:role value="motor"/><softrobots:spring stiffness="1" rest="0"/>'),
            "role 'motor' and a spring",
        ),
        (robot_with('<softrobots:spring stiffness="1" rest="0"/>' * 2), "more than one spring"),
        (
            robot_with(
                '<softrobots:spring stiffness="1" rest="0"/>',
                '<softrobots:inflated_link springs="j" radius="-1" pressure="1"/>',
            ),
            "radius -1.0 and pressure 1.0",
        ),
        (robot_with('<softrobots:role value="tendon"/>'), "role 'tendon'; one of motor, spring, section, locked"),
        (robot_with(inside='<softrobots:inflated_link springs="k" radius="1" pressure="1"/>'), "names the springs k"),
    ],
)
def test_malformed_tags_are_refused(text: str, message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        read_tags(text)


@each_row(
    ("parameters", "field"),
    [
        ({"link_lengths": ()}, "link_lengths"),
        ({"link_lengths": (0.6, -0.1)}, "link_lengths"),
        ({"link_lengths": (0.6, float("nan"))}, "link_lengths"),
        ({"link_lengths": "0.6"}, "link_lengths"),
        ({"hinge_offset": 0.6}, "hinge_offset"),
        ({"hinge_offset": 0.0}, "hinge_offset"),
        ({"hinge_offset": 0.05, "link_model": "two_hinges"}, "hinge_offset"),  # these have no effect
        ({"shear_modulus": 1e7}, "shear_modulus"),
        ({"shear_modulus": 1e7, "stiffness": 150.0}, "shear_modulus"),
        ({"wrist_mass": 0.4}, "wrist_mass"),
        ({"wrist_limits": 1.0}, "wrist_limits"),
        ({"hinge_offset": (0.03, 0.03, 0.03)}, "hinge_offset"),
        ({"radius": 0.0}, "radius"),
        ({"radius": None}, "radius"),
        ({"wall_thickness": -1e-4}, "wall_thickness"),
        ({"wall_thickness": 0.006}, "wall_thickness"),
        ({"stiffness": -172.0}, "stiffness"),
        ({"stiffness": (172.0, 0.0)}, "stiffness"),
        ({"stiffness": float("inf")}, "stiffness"),
        ({"rest_up": 1.6}, "rest_up"),
        ({"rest_side": (-1.6, 0.0)}, "rest_side"),
        ({"pressure": -1.0}, "pressure"),
        ({"density": 0.0}, "density"),
        ({"cap_mass": -0.1}, "cap_mass"),
        ({"spring_damping": -1.0}, "spring_damping"),
        ({"damping_time": -1.0}, "damping_time"),
        ({"damping_time": 0.1, "spring_damping": 2.0}, "spring_damping"),
        ({"rgba": (1.0, 0.0, 0.0)}, "rgba"),
        ({"rgba": (1.0, 0.0, 0.0, 2.0)}, "rgba"),
        ({"rgba": "red"}, "rgba"),
        ({"motor_limit": 0.0}, "motor_limit"),
        ({"motor_effort": "50"}, "motor_effort"),
        ({"motor_velocity": -2.0}, "motor_velocity"),
        ({"base_mass": 0.0}, "base_mass"),
    ],
)
def test_bad_parameters_of_the_arm_are_refused(parameters: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        sr.InflatableArm(**parameters)
    assert caught.value.field == field


def test_arm_computes_volume_and_tank() -> None:
    robot = sr.InflatableArm()
    assert robot.n_links == 2
    assert robot.volume == pytest.approx(2 * np.pi * 0.055**2 * 0.6, rel=1e-14)
    # The paper's tank of 30 MPa: p V / (p_t - p), in vacuum.
    assert robot.tank_volume(30e6) == pytest.approx(50e3 * robot.volume / (30e6 - 50e3), rel=1e-14)
    assert robot.tank_pressure(robot.tank_volume(30e6)) == pytest.approx(30e6, rel=1e-12)
    with pytest.raises(sr.ParameterError, match="the same in all links"):
        sr.InflatableArm(pressure=(50e3, 40e3)).tank_volume(30e6)
    with pytest.raises(sr.ParameterError, match="above the pressure 50000"):
        robot.tank_volume(50e3)
    with pytest.raises(sr.ParameterError, match="tank_volume"):
        robot.tank_pressure(0.0)
    with pytest.raises(sr.ParameterError, match="ambient_pressure"):
        robot.tank_pressure(1.0, ambient_pressure=-1.0)


def test_colours_may_be_arrays() -> None:
    assert sr.InflatableArm(rgba=np.array([1.0, 0.5, 0.25, 1.0])).rgba == ((1.0, 0.5, 0.25, 1.0),) * 2
    four = sr.InflatableArm(link_lengths=(0.5,) * 4, rgba=list(np.linspace(0, 1, 16).reshape(4, 4)))
    assert len(four.rgba) == 4


def test_parameters_are_frozen_and_keyword_only() -> None:
    with pytest.raises(TypeError):
        sr.InflatableArm((0.6, 0.6))
    with pytest.raises(dataclasses.FrozenInstanceError):
        sr.InflatableArm().radius = 0.1
