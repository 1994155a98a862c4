"""Robots in the surroundings that their files hold: MuJoCo and Drake press them on obstacles with the forces of our statics.

Oracles are the simulators' own contacts and distances, and levers by hand.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Surroundings
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from softrobots.export import export_model, to_json, to_mjcf, to_pybullet, to_sdf
from studies.contact_forces.cases import CASES
from studies.contact_forces.comparison import compare, forces_of
from studies.interop import bullet_statics, drake_statics, mujoco_statics
from studies.interop.outcomes import Question
from tests.conftest import skip_without_bullet_wheels
from tests.support.foreign import INERTIAL, joint

Tool = Callable[[str], ModuleType]

LENGTH, RADIUS, STIFFNESS, WALL = 0.5, 0.05, (40.0, 25.0), 0.15
PUSH = (0.0, 30.0, 0.0)
AT_ZERO = {"xyz": "0 0 0", "rpy": "0 0 0"}
LEVERS = (
    '<robot name="levers" xmlns:softrobots="urn:softrobots:urdf"><link name="base"/>'
    + joint("turn_1", "base", "rod_1", "0 0 1", **AT_ZERO)
    + joint("turn_2", "rod_1", "rod_2", "0 0 1", xyz=f"{LENGTH} 0 0", rpy="0 0 0")
    + '<joint name="end" type="fixed"><parent link="rod_2"/><child link="tip"/>'
    + f'<origin xyz="{LENGTH} 0 0"/></joint><link name="tip">{INERTIAL}</link>'
    + "".join(
        f'<softrobots:capsule link="rod_{number}" start="0 0 0" end="{LENGTH} 0 0" radius="{RADIUS}"/>' for number in (1, 2)
    )
    + "</robot>"
)
"""Two rods on hinges with springs, which turn about z; a force pushes the end on a wall at y = WALL."""
SKID = (
    '<robot name="skid" xmlns:softrobots="urn:softrobots:urdf"><link name="base"/>'
    + joint("rise", "base", "carrier", "0 0 1", "prismatic", **AT_ZERO)
    + joint("slide", "carrier", "runner", "1 0 0", "prismatic", **AT_ZERO)
    + f'<joint name="end" type="fixed"><parent link="runner"/><child link="tip"/></joint><link name="tip">{INERTIAL}</link>'
    + f'<softrobots:capsule link="runner" start="0 0 0" end="0 0 0" radius="{RADIUS}"/></robot>'
)
"""A ball on two slides with springs, whose weight and a force press it on the floor."""


def levers() -> sr.SoftModel:
    return sr.load_model(LEVERS, springs={"turn_1": STIFFNESS[0], "turn_2": STIFFNESS[1]}, tip="tip")


def by_hand() -> tuple[np.ndarray, float]:
    """Angles of the levers [rad] and the force of the wall [N]: two springs and one multiplier."""

    def balance(unknown: np.ndarray) -> list[float]:
        first, second, force = unknown
        both, push = first + second, PUSH[1] - force
        end = LENGTH * np.cos(both)
        return [
            STIFFNESS[0] * first - push * (LENGTH * np.cos(first) + end),
            STIFFNESS[1] * second - push * end,
            LENGTH * (np.sin(first) + np.sin(both)) + RADIUS - WALL,
        ]

    found = root(balance, (0.1, 0.1, 10.0), tol=1e-13)
    assert found.success
    return found.x[:2], float(found.x[2])


def asked(simulator: str, model: sr.SoftModel, force: tuple[float, float, float], seconds: float, **options: Any) -> Any:
    """Where a simulator settles."""
    if simulator == "MuJoCo":
        text = to_mjcf(model, damping="critical", gravity=sr.EARTH_GRAVITY, **options)
        return mujoco_statics.simulate(Question(text, "tip", force, sr.EARTH_GRAVITY), seconds)
    text = to_sdf(model, damping="critical", **options)
    return drake_statics.simulate(Question(text, "tip", force, sr.EARTH_GRAVITY), seconds)


TOOLS = [("MuJoCo", "mujoco"), pytest.param("Drake", "pydrake", marks=pytest.mark.study)]


@pytest.mark.parametrize(("simulator", "module"), TOOLS)
def test_two_levers_press_on_a_wall_as_by_hand(tool: Tool, simulator: str, module: str) -> None:
    """1e-5 of the force, which grows by 0.5 % a millimetre: contacts give way by less than a micrometre."""
    tool(module)
    wall = Environment([HalfSpace((0, -1, 0), -WALL, name="wall")])
    found = asked(simulator, levers(), PUSH, 4.0, environment=wall)
    angles, force = by_hand()
    assert found.speed < 1e-8
    assert set(found.forces) == {"wall"}
    assert np.abs(found.forces["wall"] - (0.0, -force, 0.0)).max() < 1e-5 * force
    assert np.abs(np.array([found.joints["turn_1"], found.joints["turn_2"]]) - angles).max() < 1e-6


@pytest.mark.parametrize(("simulator", "module"), TOOLS)
def test_friction_is_that_of_the_file(tool: Tool, simulator: str, module: str) -> None:
    """A ball pressed on a floor slides to where its spring holds it, sticks at once, or slides until its friction is enough."""
    tool(module)
    skid = sr.load_model(SKID, springs={"rise": 100.0, "slide": 50.0}, tip="tip")
    weight = 9.81 * sum(body.mass for body in skid.pinocchio.inertias)
    floor = Environment([HalfSpace((0, 0, 1), -RADIUS, name="floor")])
    for friction in (0.0, 0.2, 0.5):
        found = asked(simulator, skid, (6.0, 0.0, -4.0), 6.0, environment=floor, friction=friction)
        along, _, normal = found.forces["floor"]
        assert abs(normal - weight - 4.0) < 1e-3
        assert abs(along + 6.0 - 50.0 * found.joints["slide"]) < 0.02  # creep, and the inertia of what is left
        assert -along <= friction * normal * (1.0 + 1e-3) + 1e-9
        slid = {0.0: 0.12, 0.2: (6.0 - 0.2 * normal) / 50.0, 0.5: 0.0}[friction]
        assert abs(found.joints["slide"] - slid) < 4e-3  # it begins before the floor bears all of the load


def around(reach: float) -> Environment:
    """An obstacle of every kind, beside the arm."""
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turned *= np.sign(np.linalg.det(turned))
    return Environment(
        [
            HalfSpace((0.1, -1.0, 0.2), -0.8 * reach),
            Sphere(0.1, (0.9, -0.6, 0.2)),
            Box((0.1, 0.2, 0.3), (0.4, 0.6, 0.5), turned),
            Cylinder(0.1, 0.3, (0.5, -0.6, -0.6), turned),
            Capsule(0.05, 0.3, (-0.6, 0.2, -0.6), turned, pose=np.eye(4)),
            Mesh(0.2 * turned[:, [0, 1, 2, 0]].T * [[1], [1], [1], [-1]], (-0.3, -0.6, 0.6)),
        ]
    )


def test_distances_to_obstacles_are_those_of_mujoco(tool: Tool, rng: np.random.Generator) -> None:
    """From the arm to each obstacle in random poses; 1e-6 m is MuJoCo's own tolerance."""
    mujoco = tool("mujoco")
    arm = sr.load_model(sr.InflatableArm())
    environment, pairs = around(arm.reach), 0
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm, environment=environment))
    data = mujoco.MjData(model)
    capsules = [geom for geom in range(model.ngeom) if model.geom_conaffinity[geom] and not model.geom(geom).name]
    assert len(capsules) == len(arm.structure.tags.capsules)
    for _ in range(5):
        q = arm.pinocchio.lowerPositionLimit + rng.uniform(size=arm.pinocchio.nq) * 2.0 * arm.pinocchio.upperPositionLimit
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        gaps = Surroundings(arm, environment).at(arm.embed(q), 10.0 * arm.reach)
        for number, name in enumerate(environment.names):
            obstacle = model.geom(name).id
            theirs = min(mujoco.mj_geomDistance(model, data, capsule, obstacle, 10.0, None) for capsule in capsules)
            ours = gaps.values[gaps.obstacles == number].min()
            if ours > 0.0:
                pairs += 1
                assert abs(ours - theirs) < 1e-6, name
    assert pairs > 20


@pytest.mark.study
@pytest.mark.parametrize("itself", [False, True])
def test_a_robot_touches_itself_where_it_is_folded_and_if_it_is_said(tool: Tool, itself: bool) -> None:
    """Neighbours overlap and never touch; a chain that is bent by 0.28 rad a hinge is a ring whose ends overlap."""
    mujoco = tool("mujoco")
    arm = sr.load_model(sr.PccArm(segment_lengths=(1.2,), muscle_azimuths=(), chain="lumped", hinges=24))
    far = Environment([HalfSpace((0, 0, 1), -9.0)], self_contact=itself)
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm, environment=far))
    data = mujoco.MjData(model)
    for bend, touches in ((0.0, False), (0.1, False), (0.28, True)):
        data.qpos[:] = [bend if "bend_x" in name else 0.0 for name in arm.spring_joints]
        mujoco.mj_forward(model, data)
        assert (data.ncon > 0) == (touches and itself)
    if itself:
        assert {"segment_1_start", "section_1_1"} & {model.body(model.geom_bodyid[geom]).name for geom in data.contact[0].geom}


def test_mujoco_presses_an_arm_on_a_wall_as_our_statics_does(tool: Tool) -> None:
    tool("mujoco")
    row = compare("arm on a wall", CASES["arm on a wall"](), "MuJoCo")
    assert row.agrees, row
    assert list(row.forces) == ["half_space_1"]


@pytest.mark.study
@pytest.mark.parametrize(("friction", "aside"), [(0.1, 3.0), (0.1, 6.0), (0.2, 6.0)])
def test_mujoco_slides_a_tip_along_a_wall_as_we_do(tool: Tool, friction: float, aside: float) -> None:
    """A force that grows for 24 s takes the tip along; the direction of sliding turns on the way.

    The contact of the file is so hard that it chatters where it slides: the tip leaves the wall for moments, and friction then
    opposes the chatter. Softened, it slides evenly; it sinks in by 0.1 mm, and the dampers hold the tip back by as much: both
    change the forces by 0.5 %, 1 % of the largest is allowed.
    """
    mujoco = tool("mujoco")
    arm, motors, pressed = sr.load_model(sr.InflatableArm()), (0.0, 0.9, -0.4), np.array([0.0, 0.0, -20.0])
    wall = Environment([HalfSpace((-1, 0, 0), -1.0, name="wall")])
    pushed = pressed + np.array([0.0, aside, 0.0])
    ours = sr.follow_contact(arm, motors, np.linspace(pressed, pushed, 49), environment=wall, friction=friction)
    text = to_mjcf(arm, motors, actuators="welded", damping="critical", environment=wall, friction=friction)
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep, model.opt.integrator = 0.001, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.geom_solref[:, 0], model.geom_solimp[:, :2] = 0.02, 0.99
    data, tip = mujoco.MjData(model), model.body("tip").id
    seen = []
    for force in [*np.linspace(np.zeros(3), pressed, 4000), *np.linspace(pressed, pushed, 24000)]:
        data.qfrc_applied[:] = 0.0
        mujoco.mj_applyFT(model, data, force, np.zeros(3), data.xpos[tip], tip, data.qfrc_applied)
        mujoco.mj_step(model, data)
        seen.append(mujoco_statics.obstacle_forces(mujoco, model, data).get("wall", np.zeros(3)))
    (contact,) = ours.equilibria[-1].contacts
    assert contact.status == "slips"
    assert np.abs(np.mean(seen[-4000:], axis=0) - contact.force).max() < 0.01 * contact.normal_force
    assert np.abs(data.xpos[tip] - ours.equilibria[-1].tip_position).max() < 5e-4  # of 16 to 50 mm along the wall


@pytest.mark.study
def test_pybullet_presses_an_arm_on_obstacles_nearly_as_our_statics_does(tool: Tool) -> None:
    """1 %: it rounds the corners of boxes and meshes, and ends where motion is small."""
    skip_without_bullet_wheels()
    tool("pybullet")
    for name in [one for one in CASES if one.startswith("arm on")]:
        case = CASES[name]()
        text = to_pybullet(
            case.model,
            case.q_motors,
            actuators="welded",
            damping="critical",
            environment=case.environment,
            gravity=case.gravity,
        )
        found = bullet_statics.simulate(Question(text, case.model.tip, case.force, case.gravity))
        for obstacle, force in forces_of(case.solve()).items():
            assert np.linalg.norm(found.forces[obstacle] - force) < 1e-2 * np.linalg.norm(force), name


@pytest.mark.study
@pytest.mark.parametrize(("simulator", "module"), [("MuJoCo", "mujoco"), ("Drake", "pydrake")])
def test_simulators_press_robots_on_obstacles_as_our_statics_does(tool: Tool, simulator: str, module: str) -> None:
    """Forces within 1e-3, tips within 1e-5 of the reach, at rest."""
    tool(module)
    for name, case in CASES.items():
        row = compare(name, case(), simulator)
        assert row.agrees, row
        assert row.forces


@pytest.mark.parametrize(
    ("told", "options"),
    [
        (
            "environment.at.*: ball would move",
            {"environment": Environment([Sphere(1.0, name="ball", pose=lambda _: np.eye(4))])},
        ),
        ("an Environment", {"environment": [Sphere(1.0)]}),
        ("given with an environment", {"friction": 0.3}),
        ("friction", {"friction": -0.3, "environment": Environment([Sphere(1.0)])}),
    ],
)
def test_surroundings_that_no_file_holds_are_refused(told: str, options: dict[str, Any]) -> None:
    arm = sr.load_model(sr.InflatableArm())
    for write in (to_mjcf, to_sdf, to_pybullet):
        with pytest.raises(sr.ParameterError, match=told):
            write(arm, **options)
    if "friction" not in options:
        with pytest.raises(sr.ParameterError, match=told):
            to_json(arm, **options)


def test_what_a_file_cannot_hold_is_refused() -> None:
    bare = sr.load_model(LEVERS.replace("softrobots:capsule", "other"), springs={"turn_1": 1.0, "turn_2": 1.0})
    for write in (to_mjcf, to_sdf):
        with pytest.raises(sr.DescriptionError, match="no capsules"):
            write(bare, environment=Environment([Sphere(1.0)]))
    with pytest.raises(sr.ParameterError, match="without self_contact"):
        to_pybullet(levers(), environment=Environment([Sphere(1.0)], self_contact=True))
    with pytest.raises(sr.DescriptionError, match="obstacles named world"):
        to_sdf(levers(), environment=Environment([Sphere(1.0, name="world")]))


def test_meshes_of_drake_stand_beside_its_file(tmp_path: Path) -> None:
    """Named by their content: the same mesh is one file, whose corners and number of triangles are those of a tetrahedron."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    twice = Environment([Mesh(corners), Mesh(corners, (2.0, 0.0, 0.0))])
    with pytest.raises(sr.ParameterError, match="a folder for the file of mesh_1"):
        to_sdf(levers(), environment=twice)
    for _ in range(2):
        text = export_model(levers(), tmp_path / "levers.sdf", environment=twice, overwrite=True).read_text()
    (file,) = tmp_path.glob("*.obj")
    assert text.count(file.as_uri()) == 4  # visual and collision of both
    rows = [line.split() for line in file.read_text().splitlines()]
    assert sorted(tuple(map(float, row[1:])) for row in rows if row[0] == "v") == sorted(map(tuple, corners.tolist()))
    assert sum(row[0] == "f" for row in rows) == 4


def test_the_command_takes_obstacles_from_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    environment = around(1.2)
    (tmp_path / "room.yaml").write_text(environment.to_yaml())
    words = ["export", "inflatable_arm", "--environment", str(tmp_path / "room.yaml"), "--friction", "0.4", "-o"]
    assert cli.main([*words, str(tmp_path / "arm.xml")]) == 0
    assert f"{len(environment)} obstacles" in capsys.readouterr().out
    arm = sr.load_model(sr.InflatableArm())
    assert (tmp_path / "arm.xml").read_text() == to_mjcf(arm, environment=environment, friction=0.4)
    assert cli.main([*words, str(tmp_path / "arm.json")]) == 2
    assert "--friction must be left out for json" in capsys.readouterr().err


@pytest.mark.study
def test_an_arm_with_driven_tendons_leans_in_mujoco(tool: Tool) -> None:
    """Elastic tendons as actuators: at rest, with our force within the error of their legs, of second order in the hinges."""
    mujoco = tool("mujoco")
    arm = sr.load_model(sr.TendonArm(chain="lumped", hinges=5))
    motors = arm.relaxed_motors - np.array([0, 0, 0, 2e-3, 0, 0, 4e-3, 0, 0])
    wall = sr.Environment([sr.HalfSpace((-1, 0, 0), -0.03, name="wall")])
    ours = sr.solve_equilibrium(arm, motors, gravity=sr.EARTH_GRAVITY, environment=wall)
    model = mujoco.MjModel.from_xml_string(to_mjcf(arm, motors, gravity=sr.EARTH_GRAVITY, environment=wall))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 3000)
    assert np.abs(data.qvel).max() < 1e-9
    force = mujoco_statics.obstacle_forces(mujoco, model, data)["wall"]
    assert np.abs(force - ours.contacts[0].force).max() < 3e-3 * ours.contacts[0].normal_force


def test_the_sidecar_holds_the_obstacles(tmp_path: Path) -> None:
    arm = sr.load_model(sr.InflatableArm())
    environment = around(arm.reach)
    file = export_model(arm, tmp_path / "arm.json", environment=environment)
    assert Environment.from_dict(json.loads(file.read_text())["environment"]) == environment
    assert "environment" not in json.loads(to_json(arm))
    with pytest.raises(sr.ParameterError, match="formats that have it: mjcf, sdf, pybullet, json"):
        export_model(arm, tmp_path / "arm.py", "pinocchio", environment=environment)
