"""Files that stand alone: in PyBullet and on Pinocchio, without softrobots, robots rest where our statics says.

They are run in an empty folder by a Python that cannot import softrobots. PyBullet's own contact forces, joint limits and
masses are the oracles of what the file does around the springs.
"""

from __future__ import annotations

import ast
import json
import py_compile
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.export import to_pinocchio, to_pybullet
from softrobots.export.prepared import prepare
from softrobots.export.snippets import MOST_JOINTS
from softrobots.statics.kinematics import frame_placement
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint

Tool = Callable[[str], ModuleType]

ALONE = """
import json, runpy, sys
sys.modules["softrobots"] = None  # importing it fails
robot = runpy.run_path("robot.py")
result = {}
exec(sys.stdin.read(), {**robot, "result": result})
json.dump(result, sys.stdout)
"""

SETTLED = 1e-4
"""[rad or m]. The goal is 1e-3. `settle` stops at motions of 2e-5 in the time in which the slowest one decays by a factor e."""


@cache
def arm() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm())


@cache
def pcc() -> sr.SoftModel:
    """32 spring joints; the muscles pull."""
    return sr.load_model(sr.PccArm(chain="lumped", hinges=4), muscles="forces")


@cache
def helix() -> sr.SoftModel:
    return sr.load_model(sr.HelixTube(chain="lumped", hinges=8))


@cache
def foreign(locked: bool = False) -> sr.SoftModel:
    """A continuous motor, an elbow, a turning and a sliding spring, a side branch."""
    motors = ["elbow"] if locked else None
    return sr.load_model(BRANCHED, springs=SPRINGS, tip="finger", motors=motors)


CASES = {
    "arm": (arm, (0.3, 0.6, -0.8), (0.0, 10.0, -15.0)),
    "pcc_arm": (pcc, (30.0, -20.0, 10.0, 5.0, 0.0, 40.0), (1.0, -2.0, 1.5)),
    "helix_tube": (helix, (), (0.1, 0.2, -0.05)),
    "foreign": (foreign, (4.3, 0.5, 0.2), (3.0, 5.0, -10.0)),
    "locked": (lambda: foreign(locked=True), (0.5,), (3.0, 5.0, -10.0)),
}


def run_alone(folder: Path, text: str, code: str) -> Any:
    """Run code in the names of a file, in a folder that holds nothing else, and return its `result`."""
    folder.mkdir()
    (folder / "robot.py").write_text(text, encoding="utf-8")
    command = [sys.executable, "-W", "error", "-c", ALONE]
    done = subprocess.run(command, input=code, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


class InBullet:
    """A world of PyBullet with a robot in it."""

    def __init__(self, bullet: ModuleType, text: str, gravity: Any = None, time_step: float = 1 / 240) -> None:
        self.bullet, self.names = bullet, {"__name__": "robot"}
        exec(compile(text, "robot.py", "exec"), self.names)
        self.client = bullet.connect(bullet.DIRECT)
        bullet.setTimeStep(time_step, physicsClientId=self.client)
        bullet.setGravity(*(gravity or (0, 0, 0)), physicsClientId=self.client)
        self.robot = self.names["load"](self.client)

    def __enter__(self) -> InBullet:
        return self

    def __exit__(self, *_: object) -> None:
        self.bullet.disconnect(self.client)

    def settle(self, *args: Any) -> dict[str, float]:
        return self.names["settle"](self.robot, *args)


def distance(found: dict[str, float], equilibrium: sr.Equilibrium) -> float:
    """Largest difference of a spring joint [rad or m]."""
    names = equilibrium.model.spring_joints
    return float(np.abs(np.array([found[name] for name in names]) - equilibrium.q_springs).max())


# --- PyBullet


@pytest.mark.study
@pytest.mark.parametrize(
    ("name", "actuators"), [*((name, "driven") for name in CASES), ("arm", "welded"), ("foreign", "welded")]
)
def test_pybullet_rests_where_our_statics_says(bullet: ModuleType, name: str, actuators: str) -> None:
    make, motors, force = CASES[name]
    model = make()
    expected = sr.solve_equilibrium(model, motors, force, gravity=sr.EARTH_GRAVITY)
    with InBullet(bullet, to_pybullet(model, motors, actuators=actuators), sr.EARTH_GRAVITY) as world:
        found = world.settle(force)
        assert distance(found, expected) < SETTLED
        tip = bullet.getLinkState(world.robot.body, world.robot.links[model.tip], 0, True, physicsClientId=world.client)[4]
        assert np.allclose(tip, expected.tip_position, atol=10 * SETTLED)  # a chain of so many
    moving = {*model.spring_joints, *(model.structure.motor_joints if actuators == "driven" else ())}
    assert found.keys() == moving
    for motor, position in zip(model.structure.motor_joints, motors, strict=False):
        assert actuators == "welded" or found[motor] == pytest.approx(position, abs=SETTLED)


@pytest.mark.study
def test_the_file_is_enough(bullet: ModuleType, tmp_path: Path) -> None:
    """In another process, an empty folder, without softrobots; and when it is run by itself."""
    motors, force = (0.3, 0.6, -0.8), (0.0, 10.0, -15.0)
    text = to_pybullet(arm(), motors, gravity=sr.EARTH_GRAVITY)
    code = f"""
import pybullet
client = pybullet.connect(pybullet.DIRECT)
result.update(settle(load(client), {force}))
"""
    found = run_alone(tmp_path / "a", text, code)
    assert distance(found, sr.solve_equilibrium(arm(), motors, force)) < SETTLED
    done = subprocess.run([sys.executable, "robot.py"], cwd=tmp_path / "a", capture_output=True, text=True, check=True)
    printed = dict(line.split()[:2] for line in done.stdout.splitlines())
    under_weight = sr.solve_equilibrium(arm(), motors, gravity=sr.EARTH_GRAVITY)
    assert distance({name: float(value) for name, value in printed.items()}, under_weight) < SETTLED
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["robot.py"]


@pytest.mark.study
@pytest.mark.parametrize(("time_step", "damping"), [(1 / 60, "critical"), (1 / 500, "critical"), (1 / 240, "file")])
def test_neither_time_step_nor_damping_moves_the_rest(bullet: ModuleType, time_step: float, damping: str) -> None:
    _, motors, force = CASES["pcc_arm"]
    expected = sr.solve_equilibrium(pcc(), motors, force, gravity=sr.EARTH_GRAVITY)
    with InBullet(bullet, to_pybullet(pcc(), motors, damping=damping), sr.EARTH_GRAVITY, time_step) as world:
        assert distance(world.settle(force), expected) < SETTLED


def test_the_rest_is_found_from_far_away_and_motors_go_where_they_are_sent(bullet: ModuleType) -> None:
    with InBullet(bullet, to_pybullet(arm()), sr.EARTH_GRAVITY) as world:
        for name in arm().spring_joints:
            bullet.resetJointState(world.robot.body, world.robot.joints[name], 0.7, 3.0, physicsClientId=world.client)
        world.robot.last = None
        assert distance(world.settle(), sr.solve_equilibrium(arm(), (0, 0, 0), gravity=sr.EARTH_GRAVITY)) < SETTLED
        there = {"motor_1": 0.5, "motor_2": -0.4, "motor_3": 1.1}
        world.names["drive"](world.robot, there)
        world.names["step"](world.robot)
        assert np.abs(world.names["state"](world.robot)[1]).max() < 10.0  # at most 2 rad/s of the motors, and a swing
        found = world.settle((0.0, 5.0, 0.0))
        expected = sr.solve_equilibrium(arm(), tuple(there.values()), (0.0, 5.0, 0.0), gravity=sr.EARTH_GRAVITY)
        assert distance(found, expected) < SETTLED


def test_forces_of_others_and_contacts_reach_the_springs(bullet: ModuleType) -> None:
    """The arm is driven into a box, and pushed by somebody else; our statics under PyBullet's contact force agrees."""
    motors, push = (0.0, 0.3, -0.6), (0.0, 4.0, 0.0)
    with InBullet(bullet, to_pybullet(arm(), motors), sr.EARTH_GRAVITY) as world:
        world.settle()
        at = {"physicsClientId": world.client}
        box = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.1, 0.5, 0.05], **at)
        bullet.createMultiBody(0, box, basePosition=[0.9, 0.0, -0.12], **at)
        world.names["drive"](world.robot, {"motor_3": -0.9})
        body, hand = world.robot.body, world.robot.links["tip"]
        for _ in range(2000):
            where = bullet.getLinkState(body, hand, 0, True, **at)[4]
            bullet.applyExternalForce(body, hand, push, where, bullet.WORLD_FRAME, **at)
            world.names["step"](world.robot)
        (contact,) = bullet.getContactPoints(body, **at)
        positions, speeds = world.names["state"](world.robot)
        found = {name: positions[world.robot.moving.index(number)] for name, number in world.robot.joints.items()
                 if number in world.robot.moving}  # fmt: skip
    point, normal, pressing, *friction = (np.array(contact[i]) for i in (5, 7, 9, 10, 11, 12, 13))
    force = pressing * normal + friction[0] * friction[1] + friction[2] * friction[3]
    assert np.linalg.norm(force) > 5.0
    assert np.abs(speeds).max() < 1e-3  # it creeps along the box
    model, motors = arm(), (0.0, 0.3, -0.9)
    joints = np.array([found[name] for name in model.spring_joints])
    link = frame_placement(model, model.configuration(motors, joints), "link_2")
    wrench = np.concatenate([force, np.cross(point - link.translation, force)])
    load = {"link_2": wrench, "tip": np.array([*push, 0, 0, 0])}
    expected = sr.solve_equilibrium(model, motors, wrench=load, gravity=sr.EARTH_GRAVITY, q_springs0=joints)
    assert distance(found, expected) < 1e-3  # PyBullet keeps contact points in single precision


PENDULUM = (
    f'<robot name="pendulum"><link name="base">{INERTIAL}</link>'
    + joint("hinge", "base", "rod", "0 1 0").replace('lower="-2" upper="2"', 'lower="-0.1" upper="0.1"')
    + '<joint name="weld" type="fixed"><origin xyz="0.5 0 0"/><parent link="rod"/><child link="tool"/></joint>'
    '<link name="tool"><visual><geometry><mesh filename="package://nowhere/tool.stl"/></geometry></visual></link></robot>'
)
"""A hinge with narrow limits; at its end a link without mass whose mesh is nowhere."""


@pytest.mark.parametrize(("side_joint", "tip", "body"), [("finger", "finger", "finger"), ("gripper", "slider", "finger")])
def test_a_tip_is_a_link_or_else_the_link_of_a_joint(side_joint: str, tip: str, body: str) -> None:
    """In all formats, also where a joint elsewhere has the name of the link; and it is the one whose pose is told."""
    text = BRANCHED.replace('"gripper"', f'"{side_joint}"')
    model = sr.load_model(text, springs=SPRINGS, tip=tip, motors=["shoulder", "elbow", side_joint])
    for written in (to_pinocchio(model), to_pybullet(model)):
        assert f'TIP = "{body}"' in written.replace("'", '"')
    assert prepare(model).tip == body
    found = sr.solve_equilibrium(model, (0.3, 0.2, 0.1), (3.0, 5.0, -10.0))
    number = model.pinocchio.getFrameId(body, pin.FrameType.BODY)
    pin.framesForwardKinematics(model.pinocchio, data := model.pinocchio.createData(), found.q)
    assert np.allclose(found.tip_position, data.oMf[number].translation, rtol=0.0, atol=1e-14)


def test_limits_and_links_without_mass(bullet: ModuleType) -> None:
    model = sr.load_model(PENDULUM, springs={"hinge": 30.0}, tip="tool")
    expected = sr.solve_equilibrium(model, (), (0, 0, -20), gravity=sr.EARTH_GRAVITY)
    assert expected.q_springs[0] > 0.15
    text = to_pybullet(model, damping="critical", limits=False)
    assert "Meshes are left out: 1." in text
    with InBullet(bullet, text, sr.EARTH_GRAVITY) as world:
        assert distance(world.settle((0, 0, -20)), expected) < SETTLED
        masses = [bullet.getDynamicsInfo(world.robot.body, i, physicsClientId=world.client)[0] for i in range(2)]
        assert masses == [0.5, 1e-9]
    with InBullet(bullet, to_pybullet(model, damping="critical"), sr.EARTH_GRAVITY) as world:
        assert world.settle((0, 0, -20))["hinge"] == pytest.approx(0.1, abs=1e-3)  # PyBullet's limits give way a little


def test_a_robot_that_does_not_come_to_rest_says_so(bullet: ModuleType) -> None:
    """0.1 s is too short to fall anywhere."""
    text = to_pybullet(foreign(), damping="file")
    told = pytest.raises(RuntimeError, match=r"a joint is as fast as .* after 0.1 s")
    with InBullet(bullet, text, sr.EARTH_GRAVITY) as world, told:
        world.settle(None, "finger", 0.1)


def chain(count: int) -> sr.SoftModel:
    """Spring joints in a row."""
    links = "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", f"0 {i % 2} {(i + 1) % 2}", xyz="0.01 0 0") for i in range(count))
    return sr.load_model(
        f'<robot name="chain"><link name="l0"/>{links}</robot>', springs={f"j{i}": 1e3 for i in range(count)}, tip=f"l{count}"
    )


def test_as_many_joints_as_pybullet_takes(bullet: ModuleType) -> None:
    with InBullet(bullet, to_pybullet(chain(MOST_JOINTS))) as world:
        world.names["step"](world.robot)
        assert len(world.names["state"](world.robot)[0]) == 127
    with pytest.raises(sr.ParameterError, match=r"at most 127 joints.*this one has 128"):
        to_pybullet(chain(MOST_JOINTS + 1))


def test_names_that_python_must_quote(bullet: ModuleType) -> None:
    name = 'it\'s a \N{GREEK SMALL LETTER TAU} \\ "joint"'
    escaped = name.replace('"', "&quot;")
    urdf = f'<robot name="a &quot;&quot;&quot; b"><link name="base"/>{joint(escaped, "base", "end", "0 0 1")}</robot>'
    model = sr.load_model(urdf, springs={name: 2.0})
    expected = sr.solve_equilibrium(model, (), (0, 0.5, 0))
    text = to_pybullet(model)
    assert text.split("URDF = ")[0].isascii()
    with InBullet(bullet, text) as world:
        assert distance(world.settle((0, 0.5, 0)), expected) < SETTLED
    solved = names_of(to_pinocchio(model))["solve"]((), (0, 0.5, 0))
    assert solved == pytest.approx(expected.q_springs, abs=1e-12)


# --- Pinocchio


def names_of(text: str) -> dict[str, Any]:
    names: dict[str, Any] = {"__name__": "robot"}
    exec(compile(text, "robot.py", "exec"), names)
    return names


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), sr.EARTH_GRAVITY], ids=["weightless", "heavy"])
@pytest.mark.parametrize("name", CASES)
def test_pinocchio_alone_finds_the_same_equilibrium(name: str, gravity: Any) -> None:
    """To 1e-9: our solver stops at 1e-10 of the load, the file's where Newton's step is 1e-9 and the next its square."""
    make, motors, force = CASES[name]
    model = make()
    names = names_of(to_pinocchio(model))
    joints = names["solve"](motors, force, gravity)
    expected = sr.solve_equilibrium(model, motors, force, gravity=gravity)
    assert np.allclose(joints[names["SPRING"]], expected.q_springs, atol=1e-9, rtol=0.0)
    assert np.allclose(names["configuration"](joints), expected.q, atol=1e-9, rtol=0.0)
    assert names["stable"](joints, force, gravity) == expected.stable
    count = len(model.structure.motor_joints)
    out = names["residual"](joints, force, gravity, motors[count:])
    assert np.abs(out[names["SPRING"]]).max() < 1e-9
    assert out[names["MOTOR"]] == pytest.approx(-expected.motor_torques[:count], abs=1e-8)


def test_the_file_on_pinocchio_is_enough(tmp_path: Path) -> None:
    motors = (30.0, -20.0, 10.0, 5.0, 0.0, 40.0)
    text = to_pinocchio(pcc(), motors, gravity=sr.EARTH_GRAVITY)
    found = run_alone(tmp_path / "a", text, "result['joints'] = solve(gravity=GRAVITY).tolist()")
    expected = sr.solve_equilibrium(pcc(), motors, gravity=sr.EARTH_GRAVITY)
    assert np.allclose(found["joints"], expected.q_springs, atol=1e-9, rtol=0.0)
    done = subprocess.run([sys.executable, "robot.py"], cwd=tmp_path / "a", capture_output=True, text=True, check=True)
    assert [float(line.split()[1]) for line in done.stdout.splitlines()] == found["joints"]


@pytest.mark.parametrize("name", CASES)
def test_the_tangent_is_the_derivative_of_the_residual(name: str, rng: np.random.Generator) -> None:
    """Central differences err by 1e-10 of the third derivative and 1e-16 / 1e-5 of the torques."""
    make, _, force = CASES[name]
    names = names_of(to_pinocchio(make()))
    joints = rng.uniform(-0.3, 0.3, names["MODEL"].nv)
    load = (force, sr.EARTH_GRAVITY)
    tangent, step = names["tangent"](joints, *load), 1e-5 * np.eye(len(joints))
    for column, change in zip(tangent.T, step, strict=True):
        up, down = names["residual"](joints + change, *load), names["residual"](joints - change, *load)
        assert np.allclose(column, (up - down) / 2e-5, rtol=1e-6, atol=1e-6)


def test_a_column_that_buckles(arm: sr.SoftModel) -> None:
    """Newton's method stays on the straight arm beyond the critical load, and the file says that it is not stable."""
    names = names_of(to_pinocchio(arm))
    critical = sr.critical_load(arm, (0, 0, 0), (-1, 0, 0))
    for share, stable in ((0.9, True), (1.1, False)):
        force = (-share * critical, 0.0, 0.0)
        joints = names["solve"]((0, 0, 0), force)
        assert np.abs(joints).max() < 1e-12
        assert names["stable"](joints, force) is stable


def test_a_load_without_a_balance_is_an_error() -> None:
    """A force that is no number. (Whether the steps under an absurd force wander for ever is a matter of rounding.)"""
    with pytest.raises(RuntimeError, match=r"not balanced: .* N m are missing"):
        names_of(to_pinocchio(pcc()))["solve"](np.zeros(6), (np.nan, 3e6, 2e6))


# --- The text


@pytest.mark.study
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("tool_name", ["pybullet", "pinocchio"])
def test_the_files_are_good_python(tmp_path: Path, tool: Callable[[str], ModuleType], name: str, tool_name: str) -> None:
    tool("ruff")
    make, motors, _ = CASES[name]
    write = {"pybullet": to_pybullet, "pinocchio": to_pinocchio}[tool_name]
    text = write(make(), motors)
    assert text == write(make(), motors)
    file = tmp_path / "robot.py"
    file.write_text(text, encoding="utf-8")
    py_compile.compile(str(file), cfile=str(tmp_path / "robot.pyc"), doraise=True)
    imported = {alias.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)}
    assert imported <= {"numpy", "pybullet", "pinocchio", "tempfile", "pathlib"}
    for command in (["format", "--check"], ["check"]):
        subprocess.run([sys.executable, "-m", "ruff", *command, "--isolated", "--quiet", "--no-cache", str(file)], check=True)


def test_the_files_say_what_was_done() -> None:
    text = to_pybullet(arm(), (0.1, 0.2, 0.3), actuators="welded")
    assert "Motors are welded: their joints are fixed at [rad or m]: motor_1 0.1, motor_2" in text
    assert "MOTORS = {}" in text
    text = to_pybullet(pcc(), (30.0, 0, 0, 0, 0, 0), damping="file", limits=False)
    for line in ("Muscles pull with [N]: muscle_1_1 30.0,", "that of the description", "The springs have no limits."):
        assert line in text
    assert "Locked at zero: shoulder, gripper." in to_pybullet(foreign(locked=True))
    text = to_pinocchio(foreign(locked=True))
    assert "q_motors holds the positions of elbow [rad or m]." in text
    assert "Locked at zero: shoulder, gripper." in text
    assert "q_motors holds the tensions of muscle_1_1," in to_pinocchio(pcc())
    assert "q_motors is empty" in to_pinocchio(helix())


@pytest.mark.parametrize("write", [to_pybullet, to_pinocchio])
def test_what_cannot_be_written_is_refused(write: Callable[..., str]) -> None:
    for robot in (sr.PccArm(elastic_sections=1), sr.HelixTube(length=0.6, elastic_sections=4)):
        with pytest.raises(sr.ParameterError, match='chain="lumped"'):
            write(sr.load_model(robot))
    refused = {
        'muscles="forces"': sr.load_model(sr.PccArm(chain="lumped", hinges=1)),
        "linear springs, without max_moment": sr.load_model(sr.InflatableArm(max_moment=20.0)),
        "a robot with springs; a rigid robot": sr.load_model(BRANCHED, springs={}, tip="finger"),
        "SoftModel": sr.InflatableArm(),
    }
    for told, model in refused.items():
        with pytest.raises(sr.ParameterError, match=told):
            write(model)
    with pytest.raises(sr.ParameterError, match=r"q_motors.*shape \(3,\)"):
        write(arm(), (0.1, 0.2))
    with pytest.raises(sr.ParameterError, match=r"gravity.*shape \(3,\)"):
        write(arm(), gravity=9.81)
    with pytest.raises(sr.ParameterError, match="gravity"):
        write(arm(), gravity=(0, 0, np.nan))


def test_what_pybullet_cannot_do_is_refused() -> None:
    with pytest.raises(sr.ParameterError, match="one of 'driven', 'welded'"):
        to_pybullet(arm(), actuators="free")
    with pytest.raises(sr.ParameterError, match="'file' or 'critical', or a damping time"):
        to_pybullet(arm(), damping="none")
    assert "Damping of the springs is 1.0 s times their stiffness." in to_pybullet(arm(), damping=1)
    with pytest.raises(sr.ParameterError, match="limits of motor_2"):
        to_pybullet(arm(), (0.1, 3.2, 0.2))
    massless = f'<robot name="a"><link name="base"/>{joint("turn", "base", "end", "0 0 1")}</robot>'.replace(INERTIAL, "")
    with pytest.raises(sr.DescriptionError, match=r"without mass \(end\)"):
        to_pybullet(sr.load_model(massless, springs={"turn": 1.0}))
