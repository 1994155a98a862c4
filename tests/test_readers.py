"""Other people's MJCF and SDF: same places, same balance of forces as in MuJoCo and Drake, and what is refused."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description.readers.shared_mass import give_mass
from softrobots.description.rigid_tree import Body, Placement
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.export import to_mjcf, to_sdf
from softrobots.statics.kinematics import frame_placement
from softrobots.view.meshcat_page.stage import Stage
from softrobots.view.robot_shapes import RobotShapes
from studies.interop.newton import balance_point
from tests.conftest import missing
from tests.support.foreign import ARM
from tests.support.tables import each_row

Tool = Callable[[str], ModuleType]

FORCE = np.array([1.0, 2.0, -1.0])


class InMujoco:
    """A model in MuJoCo, with the forces that it computes itself."""

    def __init__(self, mujoco: ModuleType, text: str, site: str) -> None:
        self.mujoco, self.model = mujoco, mujoco.MjModel.from_xml_string(text)
        self.data, self.site = mujoco.MjData(self.model), site

    def places(self, names: tuple[str, ...], field: str = "qposadr") -> list[int]:
        return [int(getattr(self.model.joint(name), field)[0]) for name in names]

    def forces(self, qpos: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Springs, weight and the force at the site, shape (nv,)."""
        self.data.qpos[:], self.data.qvel[:] = qpos, 0.0
        self.mujoco.mj_forward(self.model, self.data)
        jacobian = np.zeros((3, self.model.nv))
        self.mujoco.mj_jacSite(self.model, self.data, jacobian, None, self.model.site(self.site).id)
        return np.asarray(self.data.qfrc_passive - self.data.qfrc_bias + jacobian.T @ force)

    def rest(self, held: dict[str, float], free: tuple[str, ...], force: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Coordinates of the free joints where MuJoCo's forces vanish."""
        qpos, at, dofs = np.zeros(self.model.nq), self.places(free), self.places(free, "dofadr")
        qpos[self.places(tuple(held))] = list(held.values())

        def balance(y: np.ndarray) -> np.ndarray:
            qpos[at] = y
            return self.forces(qpos, force)[dofs]

        return balance_point(balance, start)[0]


@pytest.fixture
def arm_in_mujoco(tool: Tool) -> InMujoco:
    return InMujoco(tool("mujoco"), ARM, "tip")


def values_of(model: sr.SoftModel, rng: np.random.Generator) -> dict[str, float]:
    return {name: float(rng.uniform(-1, 1)) for name in (*model.motor_joints, *model.spring_joints)}


def configured(model: sr.SoftModel, values: dict[str, float]) -> np.ndarray:
    return model.configuration(*([values[name] for name in names] for names in (model.motor_joints, model.spring_joints)))


# --- MJCF


def test_bodies_and_sites_are_where_mujoco_has_them(arm_in_mujoco: InMujoco, rng: np.random.Generator) -> None:
    model, there = sr.load_model(ARM), arm_in_mujoco
    for _ in range(5):
        values = values_of(model, rng)
        there.data.qpos[there.places(tuple(values))] = list(values.values())
        there.mujoco.mj_forward(there.model, there.data)
        q = configured(model, values)
        for name in ("base", "upper", "fore", "hand", "finger"):
            pose = frame_placement(model, q, name)
            assert np.allclose(pose.translation, there.data.body(name).xpos, atol=1e-14)
            assert np.allclose(pose.rotation, there.data.body(name).xmat.reshape(3, 3), atol=1e-14)
        pose = frame_placement(model, q, "tip")
        assert np.allclose(pose.translation, there.data.site("tip").xpos, atol=1e-14)
        assert np.allclose(pose.rotation, there.data.site("tip").xmat.reshape(3, 3), atol=1e-14)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_any_tree_has_mujocos_places_and_weights(seed: int) -> None:
    """Bodies with up to three hinges and slides in any order, anchors together or apart: the weight that each joint carries."""
    try:
        import mujoco
    except ImportError:
        missing("mujoco is not installed")
    random = np.random.default_rng(seed)
    text = random_tree(random, 4)
    model = sr.load_model(text, tip="b0")
    there = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(there)
    values = values_of(model, random)
    names = tuple(values)
    data.qpos[[there.joint(name).qposadr[0] for name in names]] = list(values.values())
    mujoco.mj_forward(there, data)
    q = configured(model, values)
    for number in range(1, there.nbody):
        pose = frame_placement(model, q, there.body(number).name)
        assert np.allclose(pose.translation, data.xpos[number], atol=1e-13)
        assert np.allclose(pose.rotation, data.xmat[number].reshape(3, 3), atol=1e-13)
    pinocchio = model.pinocchio
    carried = pin.computeGeneralizedGravity(pinocchio, pinocchio.createData(), q)
    for name in names:
        ours = carried[pinocchio.joints[pinocchio.getJointId(name)].idx_v]
        assert ours == pytest.approx(data.qfrc_bias[there.joint(name).dofadr[0]], abs=1e-12)


def random_tree(random: np.random.Generator, count: int) -> str:
    """MJCF of bodies b0, b1, ... , each hanging on an earlier one."""

    def numbers(size: int, scale: float = 1.0) -> str:
        return " ".join(map(repr, random.uniform(-scale, scale, size).tolist()))

    def body(number: int) -> str:
        together = numbers(3, 0.1)
        joints = ""
        for place in range(random.integers(1, 4) if number == 0 else random.integers(0, 4)):
            kind = random.choice(["hinge", "hinge", "slide"])
            anchor = random.choice([together, "0 0 0", numbers(3, 0.1)])
            joints += (
                f'<joint name="j{number}_{place}" type="{kind}" pos="{anchor}" axis="{random.choice([together, numbers(3)])}" '
                f'ref="{numbers(1)}" springref="{numbers(1)}" stiffness="{random.choice([0, 2.5])}"/>'
            )
        below = "".join(body(child) for child in range(number + 1, count) if parents[child] == number)
        shape = f'<geom type="box" size=".05 .03 .02" pos="{numbers(3, 0.1)}" euler="{numbers(3)}"/>'
        return f'<body name="b{number}" pos="{numbers(3)}" quat="{numbers(4)}">{joints}{shape}{below}</body>'

    parents = [0, *(int(random.integers(0, number)) for number in range(1, count))]
    compiler = '<compiler angle="radian"/><default><joint armature="1"/></default>'  # slides may be parallel
    made = body(0)
    if 'stiffness="2.5"' not in made:
        made = made.replace('stiffness="0.0"', 'stiffness="2.5"', 1)
    return f"<mujoco>{compiler}<worldbody>{made}</worldbody></mujoco>"


def test_coordinates_are_qpos(arm_in_mujoco: InMujoco) -> None:
    """`ref` does not move the numbers: rest, limits and coordinates are those that MuJoCo prints."""
    model, there = sr.load_model(ARM), arm_in_mujoco.model
    assert model.motor_joints == ("yaw",)
    assert model.spring_joints == ("pitch", "bend", "turn", "slide", "h1", "h2", "h3")
    for name, (stiffness, rest) in model.spring_table.items():
        joint = there.joint(name)
        assert stiffness == there.jnt_stiffness[joint.id]
        assert rest == there.qpos_spring[joint.qposadr[0]]
    assert model.spring_table["pitch"] == pytest.approx((30.0, np.radians(25)))
    assert model.spring_table["slide"] == (300.0, 0.07)
    assert np.allclose(model.motor_limits, [[-np.pi, np.pi]])
    assert np.allclose(model.spring_limits[2], [-np.pi / 2, np.pi / 2])
    assert np.all(np.isinf(np.delete(model.spring_limits, 2, axis=0)))  # a slide without limits has none, too
    assert model.reach < 5.0
    assert 'limit effort="40.0"' in model.urdf
    assert sum(inertia.mass for inertia in model.pinocchio.inertias) == pytest.approx(there.body_mass.sum(), rel=1e-14)


def test_equilibrium_is_where_mujocos_forces_vanish(arm_in_mujoco: InMujoco) -> None:
    model, there = sr.load_model(ARM), arm_in_mujoco
    found = sr.solve_equilibrium(model, [0.4], FORCE, gravity=sr.EARTH_GRAVITY)
    springs = model.spring_joints
    start = there.model.qpos_spring[there.places(springs)]
    rest = there.rest({"yaw": 0.4}, springs, FORCE, start)
    assert found.stable
    assert np.allclose(found.q_springs, rest, rtol=0, atol=1e-8)  # both Newton methods end below 1e-10
    qpos = np.zeros(there.model.nq)
    qpos[there.places(("yaw", *springs))] = [0.4, *rest]
    torque = there.forces(qpos, FORCE)[there.places(("yaw",), "dofadr")]
    assert np.allclose(found.motor_torques, torque, rtol=0, atol=1e-8)
    assert np.allclose(found.tip_position, there.data.site("tip").xpos, rtol=0, atol=1e-9)


# MuJoCo's own cable (model/plugin/elasticity/cable.xml up to version 3, then a flex): 41 points on 1 m, 10 mm thick, 4 MPa.
# Here half of it in 10 pieces, clamped at one end, as a chain of hinges.
PIECES, RADIUS, BEND = 10, 0.005, 4e6
PIECE = 0.5 / PIECES
CABLE_COMPOSITE = """
<mujoco model="Cable">
  <extension> <plugin plugin="mujoco.elasticity.cable"/> </extension>
  <worldbody>
    <composite type="cable" curve="s" count="21 1 1" size="1" offset="-.3 0 .6" initial="none">
      <plugin plugin="mujoco.elasticity.cable"> <config key="bend" value="4e6"/> </plugin>
      <joint kind="main" damping=".015"/> <geom type="capsule" size=".005"/>
    </composite>
  </worldbody>
</mujoco>
"""
CABLE_FLEX = """
<mujoco model="Cable"> <worldbody> <body name="clamp">
  <flexcomp name="cable" dim="1" type="grid" count="5 1 1" spacing=".05 .05 .05" radius=".005" mass="0.1">
    <edge equality="true"/> <pin id="0"/> <elasticity young="4e6" shear="1e6"/>
  </flexcomp>
</body> </worldbody> </mujoco>
"""


def cable(joints: str) -> str:
    body = ""
    for number in reversed(range(PIECES)):
        here = f'pos="{PIECE} 0 0"' if number else ""
        body = (
            f'<body name="B_{number}" {here}>{joints.format(number) if number else ""}'
            f'<geom type="capsule" size="{RADIUS}" fromto="0 0 0 {PIECE} 0 0" rgba=".8 .2 .1 1"/>{body}</body>'
        )
    stiffness = BEND * np.pi * RADIUS**4 / 4.0 / PIECE
    return (
        f'<mujoco model="Cable"><option integrator="implicitfast" timestep="0.01"><flag contact="disable"/></option>'
        f'<default><joint stiffness="{stiffness!r}" damping="0.01"/></default>'
        f'<worldbody><body pos="-.3 0 .6">{body}</body></worldbody></mujoco>'
    )


HINGES = '<joint name="y_{0}" axis="0 1 0"/><joint name="z_{0}" axis="0 0 1"/>'


def test_the_cable_itself_is_refused_with_the_reason(tool: Tool) -> None:
    """MuJoCo 4 knows the composite no more, MuJoCo 3 makes ball joints and plugins of it."""
    tool("mujoco")
    with pytest.raises(sr.DescriptionError, match=r"MuJoCo [\d.]+ refuses the text: .*composite|ball joints .* plugins"):
        sr.load_model(CABLE_COMPOSITE)
    with pytest.raises(sr.DescriptionError, match=r"ball joints ball_1 of body B_1, .* and 4 more \(hinges and slides"):
        sr.load_model(cable('<joint name="ball_{0}" type="ball"/>'))


def test_a_cable_of_vertices_is_refused(tool: Tool) -> None:
    mujoco = tool("mujoco")
    if int(mujoco.__version__.split(".")[0]) < 4:
        pytest.skip("cables are flexes from MuJoCo 4 on")
    with pytest.raises(sr.DescriptionError, match=r"1 flexes .*chain of hinges with stiffness is supported"):
        sr.load_model(CABLE_FLEX)


def test_a_cable_of_hinges_settles_as_in_mujoco(tool: Tool) -> None:
    """A minute of MuJoCo's dynamics with a force at the end, which hangs far below."""
    mujoco, force, last = tool("mujoco"), np.array([0.0, 0.1, 0.02]), f"B_{PIECES - 1}"
    text = cable(HINGES)
    model = sr.load_model(text)
    assert (model.n_motors, model.n_springs, model.tip) == (0, 2 * PIECES - 2, last)
    found = sr.solve_equilibrium(model, (), force, gravity=sr.EARTH_GRAVITY)
    assert found.stable
    there = InMujoco(mujoco, text, "")
    body = there.model.body(last).id
    for _ in range(750):
        arm = there.data.xpos[body] - there.data.xipos[body]
        there.data.xfrc_applied[body] = np.concatenate([force, np.cross(arm, force)])
        mujoco.mj_step(there.model, there.data, nstep=8)
    assert np.abs(there.data.qvel).max() < 1e-12
    at = there.places(model.spring_joints)
    assert np.allclose(there.data.qpos[at], found.q_springs, rtol=0, atol=1e-10)  # 4e-12 measured
    assert np.abs(there.data.qpos).max() > 0.3
    assert np.allclose(there.data.xpos[body], found.tip_position, rtol=0, atol=1e-10)


def bodies(inside: str, rest: str = "", joint: str = '<joint name="j" stiffness="2"/>') -> str:
    return (
        f'<mujoco><worldbody><body name="b" pos="0 0 1">{joint}<geom type="box" size=".1 .2 .3"/>{inside}</body></worldbody>'
        f"{rest}</mujoco>"
    )


SLIDE = '<body name="c"><joint name="s" type="slide"{}/><geom size=".1"/></body>'
TENDON = '<tendon><fixed name="t" {}><joint joint="j" coef="1"/></fixed></tendon>'


@each_row(
    ("text", "reason"),
    [
        (bodies("", joint='<freejoint name="f"/>'), "free joints f of body b .a floating base is not at rest"),
        (bodies("", joint='<joint type="ball"/>'), "ball joints joint_0 of body b"),
        (bodies("", joint='<joint name="j" stiffness="2" frictionloss="1"/>'), "spring and dry friction j of body b"),
        (bodies("", joint='<joint name="j" stiffness="-2"/>'), "spring of joint j in the text has stiffness -2.0; a positive"),
        (bodies("", TENDON.format('stiffness="3"')), "tendons with stiffness t"),
        (bodies("", TENDON.format('limited="true" range="0 1"')), "tendons with limits t"),
        (bodies("", TENDON.format('frictionloss="1"')), "tendons with dry friction t"),
        (bodies("", TENDON.format("") + '<actuator><position name="a" tendon="t"/></actuator>'), "force of their own a"),
        (bodies("", '<actuator><position joint="j"/></actuator>'), "force of their own actuator 0 .only joints without"),
        (bodies("", '<actuator><general joint="j" biastype="affine" biasprm="1"/></actuator>'), "force of their own"),
        (bodies("", '<equality><joint joint1="j" polycoef="1"/></equality>'), "equality constraints mjEQ_JOINT"),
        (bodies("").replace('name="b"', 'name="b" gravcomp="1"'), "gravity compensation of bodies b"),
        (bodies("", '<option wind="1 0 0" density="1.2"/>'), r"wind .loads are given to the solvers"),
        (bodies("", '<option><flag SPRINGS="disable"/></option>'), "springs that are disabled"),
        (bodies("<body><joint/></body>"), r"MuJoCo [\d.]+ refuses the text: .*mass and inertia of moving bodies"),
        ("<mujoco><worldbody><body", "not well-formed XML"),
        ("<mujoco/>", "the text has no bodies"),
        (
            bodies("", joint='<joint name="j" stiffness="2" pos="1e200 0 0"/>'),
            "the body b has a number that is not finite or above 1e",
        ),
        (bodies("", joint='<joint name="j"/>'), "the text has no joint springs; give springs="),
        (
            bodies(SLIDE.format("") + SLIDE.format("").replace('"c"', '"d"').replace('"s"', '"t"')),
            "has 2 ends .c, d.; give the name of the tip frame",
        ),
    ],
)
def test_what_bears_on_the_statics_and_is_not_ours_is_refused(tool: Tool, text: str, reason: str) -> None:
    mujoco = tool("mujoco")
    flag = "spring" if hasattr(mujoco.mjtDisableBit, "mjDSBL_SPRING") else "passive"  # springs had no flag of their own
    with pytest.raises(sr.DescriptionError, match=reason):
        sr.load_model(text.replace("SPRINGS", flag))


@pytest.mark.parametrize(
    ("attribute", "field", "reason"),
    [
        ('stiffness="2 0 1"', "jnt_stiffnesspoly", "nonlinear stiffness j"),
        ('stiffness="2" springyield="5"', "jnt_plasticadr", "plastic joint springs j"),
    ],
)
def test_springs_of_new_versions_of_mujoco_that_are_not_linear_are_refused(
    tool: Tool, attribute: str, field: str, reason: str
) -> None:
    mujoco = tool("mujoco")
    if not hasattr(mujoco.MjModel, field):
        pytest.skip(f"MuJoCo {mujoco.__version__} does not have them yet")
    with pytest.raises(sr.DescriptionError, match=reason):
        sr.load_model(bodies("", joint=f'<joint name="j" {attribute}/>'))


def test_all_reasons_are_told_at_once(tool: Tool) -> None:
    tool("mujoco")
    text = bodies('<body name="c"><joint type="ball"/><geom size=".1"/></body>', TENDON.format('stiffness="3"'))
    with pytest.raises(sr.DescriptionError, match=r"ball joints .*; tendons with stiffness"):
        sr.load_model(text)


def test_what_does_not_bear_on_the_statics_passes(tool: Tool) -> None:
    tool("mujoco")
    rest = (
        '<option density="1.2"/><equality><joint joint1="j" active="false"/></equality>'
        '<actuator><motor joint="j"/><velocity joint="j" kv="3"/><position joint="s" kp="9"/></actuator>'
        + TENDON.format('damping="2"')
    )
    model = sr.load_model(bodies(SLIDE.format(' damping="1" frictionloss="3" armature="2"'), rest))
    assert (model.motor_joints, model.spring_joints) == (("s",), ("j",))


def test_springs_and_motors_of_the_caller_go_before_those_of_the_file(tool: Tool) -> None:
    tool("mujoco")
    of_file = sr.load_model(ARM).spring_table
    model = sr.load_model(ARM, springs={"yaw": (7.0, 0.1), "pitch": None}, motors=["pitch"], tip="hand")
    kept = {name: spring for name, spring in of_file.items() if name != "pitch"}
    assert (model.spring_table, model.motor_joints, model.tip) == ({"yaw": (7.0, 0.1), **kept}, ("pitch",), "hand")
    assert model.joint_roles == {"pitch": "motor", "yaw": "given spring"} | dict.fromkeys(kept, "spring")
    alone = sr.load_model(ARM, springs=dict.fromkeys(of_file) | {"yaw": (7.0, 0.1)}, motors=["pitch"], tip="hand")
    assert (alone.spring_table, alone.motor_joints) == ({"yaw": (7.0, 0.1)}, ("pitch",))


def test_the_tip_is_the_one_moving_end(tool: Tool) -> None:
    tool("mujoco")
    scenery = bodies(SLIDE.format("")).replace("</worldbody>", '<body name="table"><geom size=".1"/></body></worldbody>')
    assert sr.load_model(scenery).tip == "c"
    marked = bodies(SLIDE.format("") + '<site name="tip" pos="0 0 .1"/>')
    assert sr.load_model(marked).tip == "tip"
    assert sr.load_model(bodies(SLIDE.format("") + '<site name="mark"/>')).tip == "c"
    taken = sr.load_model(bodies(SLIDE.format("") + '<site name="c" pos="0 0 5"/>'))  # the body goes first
    assert frame_placement(taken, taken.configuration([0.0]), "c").translation[2] == 1.0


def test_a_body_and_a_joint_of_one_name_are_two_things(tool: Tool) -> None:
    tool("mujoco")
    model = sr.load_model(bodies("", joint='<joint name="b" stiffness="2" pos=".3 0 0" axis="0 1 0"/>'))
    q = model.configuration((), [0.4])
    expected = [0.3 - 0.3 * np.cos(0.4), 0.0, 1.0 + 0.3 * np.sin(0.4)]  # turned about the anchor, 0.3 m away
    assert np.allclose(frame_placement(model, q, "b").translation, expected, atol=1e-15)


def test_links_between_the_hinges_of_a_body_have_mass_for_simulators(tool: Tool, arm_in_mujoco: InMujoco) -> None:
    """Where all hinges meet at one point; a link before a slide has none, which exporters refuse by name."""
    mujoco, model = tool("mujoco"), sr.load_model(ARM)
    with pytest.raises(sr.DescriptionError, match=r"moving links without mass \(fore_bend, fore_turn\)"):
        to_mjcf(model)
    plain = ARM.split('<joint name="slide"')[0] + ARM.split('springref=".07"/>')[1]
    plain = plain.replace('range="-90 90" pos="-.01 0 .02"', "")
    model = sr.load_model(plain)
    masses = {
        name: model.urdf.split(f'<link name="{name}">')[1].split("</link>")[0] for name in ("fore_bend", "hand_h1", "hand_h2")
    }
    assert all('<mass value="0.0001" />' in text for text in masses.values())
    mujoco.MjModel.from_xml_string(to_mjcf(model))  # refuses moving bodies without mass


@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.floats(1e-6, 10.0))
@settings(max_examples=50)
def test_a_body_gives_mass_and_stays_a_body(seed: int, count: int, mass: float) -> None:
    """Mass, first and second moments of body and points together are those of the body before."""
    random = np.random.default_rng(seed)
    moments = random.uniform(1e-6, 1e-2, 3) * mass  # second moments along the axes: any positive ones are those of a body
    centre = Placement.turned(random.uniform(-0.1, 0.1, 3), random.normal(size=4))
    body = Body("b", mass, centre, np.diag(moments.sum() - moments))
    point = random.uniform(-0.1, 0.1, 3)
    lighter, each = give_mass(body, point, count)
    assert lighter.mass + count * each == pytest.approx(mass, rel=1e-15)
    assert 0.95 * mass <= lighter.mass
    assert each <= 1e-4

    def about_origin(of: Body) -> np.ndarray:
        turned = of.centre.rotation @ of.inertia @ of.centre.rotation.T
        return turned + of.mass * (
            of.centre.position @ of.centre.position * np.eye(3) - np.outer(of.centre.position, of.centre.position)
        )

    points = Body("p", count * each, Placement(point), np.zeros((3, 3)))
    assert np.allclose(lighter.mass * lighter.centre.position + points.mass * point, mass * centre.position, atol=1e-15 * mass)
    assert np.allclose(about_origin(lighter) + about_origin(points), about_origin(body), rtol=1e-12, atol=1e-15 * mass)
    principal = np.linalg.eigvalsh(lighter.inertia)
    assert principal[0] > 0.0
    assert principal[0] + principal[1] > principal[2]


def test_a_body_that_is_too_light_or_flat_gives_nothing() -> None:
    for mass, moments in ((0.0, np.zeros(3)), (1e-9, np.full(3, 1e-12)), (1.0, np.array([1.0, 1.0, 2.0]))):
        body = Body("b", mass, Placement(), np.diag(moments))
        assert give_mass(body, np.array([0.1, 0.0, 0.0]), 1) == (body, 0.0)


def test_a_file_finds_what_it_includes(tool: Tool, tmp_path: Path) -> None:
    mujoco = tool("mujoco")
    (tmp_path / "meshes").mkdir()
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
    faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    (tmp_path / "meshes" / "wedge.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces)
    geom = '<geom type="mesh" mesh="wedge" pos=".1 .2 .3" euler="10 20 30" rgba="0 1 0 1"/>'
    hidden = '<geom type="box" size=".1 .1 .1" group="3"/>'
    (tmp_path / "part.xml").write_text(
        f'<mujocoinclude><body name="b"><joint name="j" stiffness="1"/>{geom}{hidden}</body></mujocoinclude>'
    )
    file = tmp_path / "robot.xml"
    file.write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="wedge.obj" scale=".1 .2 .3"/></asset>'
        '<worldbody><include file="part.xml"/></worldbody></mujoco>'
    )
    model = sr.load_model(file)
    assert model == sr.load_model(str(file))
    (shape,) = read_rigid_tree(model.urdf).body("b").visuals
    assert (shape.kind, shape.filename) == ("mesh", str(tmp_path / "meshes" / "wedge.obj"))
    assert shape.rgba == (0.0, 1.0, 0.0, 1.0)
    there = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(there)
    mujoco.mj_forward(there, data)
    expected = there.mesh_vert.astype(float) @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    placed = (corners * shape.size) @ shape.placement.rotation.T + shape.placement.position
    distances = np.linalg.norm(placed[:, None] - expected[None], axis=2)
    assert distances.min(axis=0).max() < 1e-6  # MuJoCo keeps vertices in single precision
    assert len(RobotShapes(model).shapes) == 1
    broken = tmp_path / "broken.xml"
    broken.write_text('<mujoco><worldbody><include file="nowhere.xml"/></worldbody></mujoco>')
    with pytest.raises(sr.DescriptionError, match=r"MuJoCo [\d.]+ refuses .*broken.xml: "):
        sr.load_model(broken)


def test_shapes_are_those_of_mujoco(tool: Tool) -> None:
    tool("mujoco")
    model = sr.load_model(ARM)
    kinds = [type(shape.geometry).__name__ for shape in RobotShapes(model).shapes]
    assert kinds == ["Box", "Cylinder", "Cylinder", "Sphere", "Sphere"]  # no plane, no ellipsoid
    assert RobotShapes(model).shapes[0].colour == (1.0, 0.0, 0.0, 1.0)


# --- SDF

INERTIA = "<inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia>"


def link(name: str, inside: str = "", pose: str = "") -> str:
    return f'<link name="{name}">{pose}<inertial><mass>1</mass>{INERTIA}</inertial>{inside}</link>'


def sdf_joint(name: str, parent: str, child: str, dynamics: str = "", kind: str = "revolute", axis: str = "0 1 0") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child><axis><xyz>{axis}</xyz>'
        f"<limit><lower>-2</lower><upper>2</upper></limit><dynamics>{dynamics}</dynamics></axis></joint>"
    )


SPRING = "<spring_stiffness>5</spring_stiffness><spring_reference>.1</spring_reference>"
FIXED = '<joint name="w" type="fixed"><parent>world</parent><child>a</child></joint>'


def sdf(inside: str, outside: str = "") -> str:
    return f'<sdf version="1.9"><model name="m" xmlns:drake="drake.mit.edu">{inside}</model>{outside}</sdf>'


def chain(dynamics: str = SPRING, more: str = "") -> str:
    return sdf(link("a") + link("b") + FIXED + sdf_joint("j", "a", "b", dynamics) + more)


def model_of(text: str, name: str = "m") -> str:
    return "<model" + text.split("<model", 1)[1].replace('"m"', f'"{name}"', 1).rsplit("</sdf>", 1)[0]


# Relative poses, joints beside their links, axes in other frames, a slide, and a joint written from the tip to the base.
SDF_ARM = """
<sdf version="1.9"><world name="w">
  <model name="ground"><static>true</static>
    <link name="a"><visual name="v"><geometry><box><size>1 1 .1</size></box></geometry></visual></link></model>
  <model name="m"><pose>.1 .2 .3 .1 .2 .3</pose>
    <frame name="F" attached_to="upper"><pose>0 0 0 .3 .4 .5</pose></frame>
    <frame name="tip" attached_to="fore"><pose>.2 0 .01 0 0 1</pose></frame>
    <link name="base"><inertial><mass>1</mass>INERTIA</inertial></link>
    <joint name="w" type="fixed"><pose>0 0 .1 .2 0 0</pose><parent>world</parent><child>base</child></joint>
    <link name="upper"><pose relative_to="base">0 0 .2 0 .5 0</pose>
      <inertial><pose>.1 0 0 .1 .2 .3</pose><mass>.5</mass>
        <inertia><ixx>.001</ixx><ixy>.0001</ixy><iyy>.003</iyy><izz>.003</izz></inertia></inertial>
      <visual name="v"><geometry><cylinder><radius>.02</radius><length>.2</length></cylinder></geometry>
        <material><diffuse>1 0 0 1</diffuse></material></visual></link>
    <joint name="motor" type="revolute"><parent>base</parent><child>upper</child>
      <axis><xyz>0 0 1</xyz>
        <limit><lower>-2</lower><upper>2</upper><effort>30</effort><velocity>3</velocity></limit></axis></joint>
    <link name="mid"><pose relative_to="upper">.2 0 0 0 0 .2</pose>
      <inertial><pose>.05 .01 0 0 0 0</pose><mass>.3</mass>INERTIA</inertial></link>
    <joint name="knee" type="revolute"><pose>.01 .02 .03 .1 0 0</pose><parent>upper</parent><child>mid</child>
      <axis><xyz expressed_in="F">0 1 .3</xyz><limit><lower>-2</lower><upper>2</upper></limit>
        <dynamics><spring_stiffness>6</spring_stiffness><spring_reference>.2</spring_reference><damping>.3</damping></dynamics>
      </axis></joint>
    <link name="rod"><pose relative_to="mid">.1 0 0 .3 0 0</pose><inertial><mass>.2</mass>INERTIA</inertial></link>
    <joint name="slide" type="prismatic"><pose>.01 .02 .03 .1 .4 0</pose><parent>mid</parent><child>rod</child>
      <axis><xyz expressed_in="base">1 .2 0</xyz>
        <dynamics><spring_stiffness>300</spring_stiffness><spring_reference>.02</spring_reference></dynamics></axis></joint>
    <link name="fore"><pose relative_to="rod">.1 0 0 .3 .2 .1</pose>
      <inertial><pose>.1 0 0 0 0 0</pose><mass>.2</mass>INERTIA</inertial></link>
    <joint name="turn" type="continuous"><parent>fore</parent><child>rod</child>
      <axis><xyz>0 .5 1</xyz>
        <dynamics><spring_stiffness>2</spring_stiffness><spring_reference>-.3</spring_reference></dynamics></axis></joint>
  </model>
</world></sdf>
""".replace("INERTIA", INERTIA)


def in_drake(text: str) -> tuple[Any, Any]:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text, "sdf")
    plant.Finalize()
    return plant, plant.CreateDefaultContext()


def test_sdf_is_in_the_balance_that_drake_computes(tool: Tool, rng: np.random.Generator) -> None:
    tool("pydrake")
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.tree import MultibodyForces

    model = sr.load_model(SDF_ARM)
    assert (model.motor_joints, model.spring_joints, model.tip) == (("motor",), ("knee", "slide", "turn"), "tip")
    assert model.spring_table == {"knee": (6.0, 0.2), "slide": (300.0, 0.02), "turn": (2.0, -0.3)}
    assert model.spring_limits.tolist() == [[-2.0, 2.0], [-np.inf, np.inf], [-np.inf, np.inf]]
    assert '<limit effort="30.0" velocity="3.0"' in model.urdf
    plant, context = in_drake(SDF_ARM)
    place = {name: plant.GetJointByName(name).position_start() for name in (*model.motor_joints, *model.spring_joints)}
    frame = plant.GetFrameByName("tip")

    def positions(values: dict[str, float]) -> np.ndarray:
        q = np.zeros(plant.num_positions())
        q[[place[name] for name in values]] = list(values.values())
        return q

    for _ in range(5):
        values = values_of(model, rng)
        plant.SetPositions(context, positions(values))
        q = configured(model, values)
        for name in ("base", "upper", "mid", "rod", "fore"):
            pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(name)).GetAsMatrix4()
            assert np.allclose(frame_placement(model, q, name).homogeneous, pose, atol=1e-14)
        assert np.allclose(
            frame_placement(model, q, "tip").homogeneous, frame.CalcPoseInWorld(context).GetAsMatrix4(), atol=1e-14
        )
    force, forces = np.array([1.0, 0.5, -2.0]), MultibodyForces(plant)

    def balance(y: np.ndarray) -> np.ndarray:
        plant.SetPositions(context, positions({"motor": 0.4, **dict(zip(model.spring_joints, y, strict=True))}))
        plant.CalcForceElementsContribution(context, forces)
        arm = frame.CalcPoseInWorld(context).translation() - plant.EvalBodyPoseInWorld(context, frame.body()).translation()
        frame.body().AddInForce(context, arm, SpatialForce(np.zeros(3), force), plant.world_frame(), forces)
        return -np.asarray(plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces))

    at = [place[name] for name in model.spring_joints]
    rest, _ = balance_point(lambda y: balance(y)[at], np.array(model.rest))
    found = sr.solve_equilibrium(model, [0.4], force, gravity=sr.EARTH_GRAVITY)
    assert found.stable
    assert np.allclose(found.q_springs, rest, rtol=0, atol=1e-8)  # both Newton methods end below 1e-10
    assert np.allclose(found.motor_torques, balance(rest)[place["motor"]], rtol=0, atol=1e-8)


def test_shapes_are_those_of_drake(tool: Tool, tmp_path: Path) -> None:
    tool("pydrake")
    colours = {type(shape.geometry).__name__: shape.colour for shape in RobotShapes(sr.load_model(SDF_ARM)).shapes}
    assert colours.keys() == {"Box", "Cylinder"}
    assert colours["Cylinder"] == (1.0, 0.0, 0.0, 1.0)
    mesh = '<visual name="v"><geometry><mesh><uri>wedge.obj</uri><scale>2 3 4</scale></mesh></geometry></visual>'
    text = chain().replace('<link name="b">', f'<link name="b">{mesh}')
    file = tmp_path / "arm.sdf"
    file.write_text(text)
    assert RobotShapes(sr.load_model(file)).shapes == ()  # the mesh is missing: the chain remains
    (tmp_path / "wedge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    assert len(RobotShapes(sr.load_model(file)).shapes) == 1


def test_a_robot_without_shapes_and_far_from_the_origin_can_be_viewed(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    tool("pydrake")
    cameras = []
    monkeypatch.setattr(Stage, "look_from", lambda self, eye, centre, *narrow: cameras.append((eye, centre)))
    far = np.array([3.0, 4.0, 0.5])
    arm = link("c", pose='<pose relative_to="b">0.4 0 0 0 0 0</pose>') + sdf_joint("k", "b", "c", SPRING)
    model = sr.load_model(chain(more=arm).replace("<link", "<pose>3 4 0.5 0 0 0</pose><link", 1))
    with sr.view(model, sr.solve_equilibrium(model, (), (0.0, 0.0, 1.0))) as viewer:
        assert "meshcat" in viewer.html().lower()
    eye, centre = cameras[-1]
    assert np.linalg.norm(centre - far) < 0.4  # between the ends of the robot, which is 0.4 m long
    assert 0.2 < np.linalg.norm(eye - centre) < 1.0


def test_names_of_nested_models(tool: Tool) -> None:
    tool("pydrake")
    inner = f'<model name="arm"><pose>0 0 1 0 0 0</pose>{link("a")}{link("b")}{sdf_joint("j", "a", "b", SPRING)}</model>'
    clamp = '<joint name="k" type="fixed"><parent>a</parent><child>arm::a</child></joint>'
    model = sr.load_model(sdf(link("a") + FIXED + inner + clamp))
    assert (model.spring_joints, model.tip) == (("arm__j",), "arm__b")
    assert frame_placement(model, model.configuration(()), "arm__b").translation[2] == 1.0


@each_row(
    ("text", "reason"),
    [
        (
            chain().replace(FIXED, ""),
            r"not fixed to the world .m::a, m::b.: a floating base .* fixed joint with the parent world",
        ),
        (chain(SPRING.replace(">5<", ">-5<")), "stiffness -5 and rest 0.1 of joint j .finite ones are required, not negative"),
        (chain(SPRING.replace(">5<", ">nan<")), "a NaN in joint j; stiffness nan"),
        (chain(SPRING.replace(">.1<", ">inf<")), "stiffness 5 and rest inf of joint j"),
        (chain().replace("<lower>-2", "<lower>nan"), "a NaN in joint j"),
        (chain().replace("<limit>", "<limit><velocity>NaN</velocity>"), "a NaN in joint j"),
        (chain(SPRING + "<damping>inf</damping>"), "the joint j has a number that is not finite"),
        (chain(more='<link name="d"><drake:deformable_properties/></link>'), "the deformable link d"),
        (chain(SPRING + "<friction>1</friction>"), "joint j with spring and dry friction"),
        (chain().replace("<mass>1", "<mass>0", 1), "the mass 0 of link a .a positive one is required"),
        (chain().replace("<ixx>.01", "<ixx>9", 1), "link named a has invalid inertia"),
        (chain().replace('<link name="b">', '<link name="b"><gravity>false</gravity>'), "<gravity>false</gravity> of link b"),
        (
            chain().replace('<link name="b">', '<link name="b"><kinematic>true</kinematic>'),
            "<kinematic>true</kinematic> of link b",
        ),
        (
            chain().replace("<limit>", '<mimic joint="k"><multiplier>1</multiplier></mimic><limit>').replace("1.9", "1.11"),
            "the mimic of joint j",
        ),
        (chain(more="<include><uri>model://x</uri></include>"), r"included files .*gz sdf -p"),
        (chain(more=link("c") + sdf_joint("k", "b", "c", kind="ball")), "joint k of kind ball_rpy .revolute, continuous"),
        (chain(more=link("c") + sdf_joint("k", "b", "c", kind="screw")), "joint k of kind screw"),
        (chain(more=link("c") + sdf_joint("k", "b", "c", kind="gearbox")), "Drake refuses the text: .*gearbox"),
        (
            chain(more=link("c") + sdf_joint("k", "b", "c") + sdf_joint("l", "a", "c")),
            "a loop of bodies that joint . closes; a tree is required",
        ),
        (
            chain(more=link("c") + sdf_joint("k", "b", "c") + link("d") + sdf_joint("l", "b", "d")),
            "has 2 ends .c, d.; give the name of the tip frame",
        ),
        (chain(""), "the text has no joint springs; give springs="),
        (sdf(""), "Drake refuses the text"),
        ('<sdf version="1.9"><world name="w"/></sdf>', "the text has no models with links"),
        (chain().replace("1.9", "1.99"), "Drake refuses the text: .*1.99"),
        (
            f'<sdf version="1.9"><world name="w">{model_of(chain())}{model_of(chain(), "n")}</world></sdf>',
            "2 models that move .m, n.;",
        ),
    ],
)
def test_what_sdf_says_and_we_do_not_have_is_refused(tool: Tool, text: str, reason: str) -> None:
    tool("pydrake")
    with pytest.raises(sr.DescriptionError, match=reason):
        sr.load_model(text)


def test_a_bushing_of_drake_is_refused(tool: Tool) -> None:
    tool("pydrake")
    constants = "".join(
        f"<drake:bushing_{what}>1 1 1</drake:bushing_{what}>"
        for what in ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping")
    )
    frames = '<frame name="f" attached_to="a"/><frame name="g" attached_to="b"/>'
    ends = "<drake:bushing_frameA>f</drake:bushing_frameA><drake:bushing_frameC>g</drake:bushing_frameC>"
    with pytest.raises(sr.DescriptionError, match=r"a force element LinearBushingRollPitchYaw .only joints have springs"):
        sr.load_model(chain(more=f"{frames}<drake:linear_bushing_rpy>{ends}{constants}</drake:linear_bushing_rpy>"))


def test_friction_of_a_motor_passes(tool: Tool) -> None:
    tool("pydrake")
    model = sr.load_model(chain(more=link("c") + sdf_joint("k", "b", "c", "<friction>1</friction><damping>2</damping>")))
    assert model.motor_joints == ("k",)


# --- Both


@pytest.mark.parametrize("text", [ARM, SDF_ARM], ids=["mjcf", "sdf"])
def test_models_survive_saving_and_pickling(tool: Tool, tmp_path: Path, text: str) -> None:
    for name in ("mujoco", "pydrake"):
        tool(name)
    model = sr.load_model(text)
    assert sr.load_model(model.urdf) == model  # the translation is a robot of its own
    assert pickle.loads(pickle.dumps(model)) == model
    found = sr.solve_equilibrium(model, [0.4], FORCE, gravity=sr.EARTH_GRAVITY)
    back = sr.load_result(sr.save_result(found, tmp_path / "found"))
    assert back.model == model
    assert np.array_equal(back.q_springs, found.q_springs)


@pytest.mark.parametrize("write", [to_mjcf, to_sdf])
def test_our_exports_come_back(tool: Tool, arm: sr.SoftModel, write: Callable[..., str]) -> None:
    for name in ("mujoco", "pydrake"):
        tool(name)
    motors, force = (0.3, 0.6, -0.8), (0.0, 10.0, -15.0)
    ours = sr.solve_equilibrium(arm, motors, force, gravity=sr.EARTH_GRAVITY)
    driven = sr.load_model(write(arm, motors))
    assert (driven.motor_joints, driven.spring_table, driven.tip) == (arm.motor_joints, arm.spring_table, "tip")
    back = sr.solve_equilibrium(driven, motors, force, gravity=sr.EARTH_GRAVITY)
    assert np.allclose(back.q_springs, ours.q_springs, rtol=0, atol=1e-12)
    assert np.allclose(back.motor_torques, ours.motor_torques, rtol=0, atol=1e-9)
    welded = sr.load_model(write(arm, motors, actuators="welded"))
    assert welded.motor_joints == ()
    back = sr.solve_equilibrium(welded, (), force, gravity=sr.EARTH_GRAVITY)
    assert np.allclose(back.q_springs, ours.q_springs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("text", [ARM, SDF_ARM], ids=["mjcf", "sdf"])
def test_translations_can_be_mounted(tool: Tool, text: str) -> None:
    for name in ("mujoco", "pydrake"):
        tool(name)
    whole = sr.load_model(sr.mount(sr.InflatableArm(), "tip", text))
    assert whole.tip == "soft_tip"
    assert whole.n_springs == 4 + sr.load_model(text).n_springs


@pytest.mark.parametrize(
    ("module", "text", "package"),
    [("mujoco", ARM, "mujoco"), ("pydrake", SDF_ARM, "drake"), ("pydrake.multibody.parsing", SDF_ARM, "drake")],
)
def test_a_missing_reader_says_what_to_type(monkeypatch: pytest.MonkeyPatch, module: str, text: str, package: str) -> None:
    for name in [name for name in sys.modules if name.startswith(f"{module}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(sr.MissingDependency, match=rf"{package} is not installed.*softrobots\[interop\]"):
        sr.load_model(text)


def test_other_kinds_are_refused_with_the_known_ones(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text("<mujocoinclude/>")
    with pytest.raises(sr.DescriptionError, match=r"robot.xml has the root tag <mujocoinclude>; one of <robot> \(URDF\), "):
        sr.load_model(file)
    with pytest.raises(sr.DescriptionError, match=r"<mujoco> \(MJCF\), <sdf> \(SDF\) is required"):
        sr.load_model("<html/>")
