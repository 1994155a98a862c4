"""Results as messages of ROS 2, in YAML and in MCAP logs, read back by PyYAML and by the reader of mcap-ros2-support."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.export import to_ros2_yaml, write_mcap
from softrobots.export.ros_messages import stamp

Tool = Callable[[str], ModuleType]
TARGETS = np.array([(0.9, 0.1, 0.2), (0.9, 0.15, 0.2), (0.9, 0.2, 0.25), (0.9, 0.3, 0.25)])
TIMES = np.array([1.0, 1.5, 2.2, 3.0])


@cache
def followed() -> sr.Trajectory:
    return sr.follow_trajectory(sr.load_model(sr.InflatableArm()), TARGETS, (0, 0, -5), times=TIMES)


@cache
def swinging() -> sr.Motion:
    start = sr.solve_equilibrium(sr.load_model(sr.InflatableArm()), (0.3, 0.6, -0.8))
    return sr.simulate(start.model, 0.2, (0.3, 0.6, -0.8), start=start, gravity=sr.EARTH_GRAVITY, output_step=0.02)


def seconds(message: dict[str, int]) -> float:
    assert sorted(message) == ["nanosec", "sec"]
    assert 0 <= message["nanosec"] < 10**9  # uint32, less than a second
    return message["sec"] + 1e-9 * message["nanosec"]


def test_a_trajectory_is_a_message_with_every_digit() -> None:
    text = to_ros2_yaml(followed())
    assert text.startswith("# trajectory_msgs/msg/JointTrajectory\n")
    message = yaml.safe_load(text)
    assert list(message) == ["header", "joint_names", "points"]
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert message["joint_names"] == ["motor_1", "motor_2", "motor_3"]
    points = message["points"]
    assert all(list(point) == ["positions", "velocities", "time_from_start"] for point in points)
    np.testing.assert_array_equal([point["positions"] for point in points], followed().q_motors)
    np.testing.assert_allclose([seconds(point["time_from_start"]) for point in points], TIMES - 1.0, rtol=0, atol=1e-9)
    rates = np.array([point["velocities"] for point in points])
    assert not rates[[0, -1]].any()
    for row in (1, 2):  # slope there of the parabola through three waypoints
        near = slice(row - 1, row + 2)
        slopes = [np.polyfit(TIMES[near] - TIMES[row], q, 2)[1] for q in followed().q_motors[near].T]
        np.testing.assert_allclose(rates[row], slopes, atol=1e-12)


def test_a_motion_has_its_own_velocities() -> None:
    points = yaml.safe_load(to_ros2_yaml(swinging()))["points"]
    np.testing.assert_array_equal([point["velocities"] for point in points], swinging().motor_velocities)
    assert len(points) == len(swinging().time)


def test_joints_are_chosen_by_name_and_in_order() -> None:
    message = yaml.safe_load(to_ros2_yaml(followed(), joints=("motor_3", "motor_1")))
    assert message["joint_names"] == ["motor_3", "motor_1"]
    np.testing.assert_array_equal([point["positions"] for point in message["points"]], followed().q_motors[:, [2, 0]])
    with pytest.raises(sr.NameNotFound, match="no actuator is called 'motor_4'"):
        to_ros2_yaml(followed(), joints=["motor_4"])
    with pytest.raises(sr.NameNotFound, match="no joint is called 'motor_4'"):
        to_ros2_yaml(followed().equilibria[0], joints=["motor_4"])


@pytest.mark.parametrize("robot", [sr.InflatableArm(), sr.PccArm()], ids=["hinges", "sections"])
def test_a_state_has_the_positions_of_all_joints(robot: Any) -> None:
    """Pinocchio built anew from the URDF places the tip with them where the equilibrium has it."""
    model = sr.load_model(robot)
    held = sr.solve_equilibrium(model, model.relaxed_motors, (1.0, 2.0, -3.0))
    text = to_ros2_yaml(held)
    assert text.startswith("# sensor_msgs/msg/JointState\n")
    message = yaml.safe_load(text)
    assert list(message) == ["header", "name", "position", "velocity", "effort"]
    chain = pin.buildModelFromXML(robot.urdf())
    assert message["name"] == list(chain.names)[1:]
    data = chain.createData()
    pin.framesForwardKinematics(chain, data, np.array(message["position"]))
    assert np.abs(data.oMf[chain.getFrameId("tip")].translation - held.tip_position).max() < 1e-12
    pull = pin.computeFrameJacobian(
        chain, data, np.array(message["position"]), chain.getFrameId("tip"), pin.LOCAL_WORLD_ALIGNED
    )
    carried = dict(zip(message["name"], pull[:3].T @ (1.0, 2.0, -3.0), strict=True))
    for name, effort in zip(message["name"], message["effort"], strict=True):  # motors balance the load, springs have none
        assert effort == pytest.approx(-carried[name] if name in model.motor_joints else 0.0, abs=1e-12)


def test_an_ik_solution_is_the_state_of_its_equilibrium_and_others_are_refused() -> None:
    solution = sr.solve_ik(followed().model, TARGETS[0], (0, 0, -5))
    assert to_ros2_yaml(solution) == to_ros2_yaml(solution.equilibrium)
    with pytest.raises(sr.ParameterError, match="an equilibrium, an IK solution, a trajectory or a motion"):
        to_ros2_yaml(followed().model)


def test_times_are_whole_nanoseconds() -> None:
    assert [stamp(time) for time in (0.0, 0.1, 1.9999999999, 12.000000001)] == [
        {"sec": 0, "nanosec": 0}, {"sec": 0, "nanosec": 100_000_000}, {"sec": 2, "nanosec": 0}, {"sec": 12, "nanosec": 1},
    ]  # fmt: skip


def read(file: Path, tool: Tool) -> dict[str, list[tuple[int, Any]]]:
    """Messages by topic, with the time of the log [ns]."""
    found = defaultdict(list)
    for one in tool("mcap_ros2.reader").read_ros2_messages(str(file)):
        found[one.channel.topic].append((one.log_time_ns, one.ros_msg))
    return found


@cache
def bent() -> sr.Trajectory:
    model = sr.load_model(sr.PccArm(elastic_sections=1))
    held = sr.solve_equilibrium(model, model.relaxed_motors, (1.0, 2.0, -3.0))
    return sr.Trajectory(TIMES[:1], held.tip_position[None], (held,), "held")


@pytest.mark.parametrize("result", [followed, swinging, bent], ids=["trajectory", "motion", "muscles"])
def test_a_log_is_read_back_with_every_digit(tmp_path: Path, tool: Tool, result: Callable[[], Any]) -> None:
    tool("mcap_ros2")
    moved = result()
    times = moved.time if isinstance(moved, sr.Motion) else moved.times - 1.0
    topics = read(write_mcap(moved, tmp_path / "log.mcap"), tool)
    assert sorted(topics) == ["/actuators", "/joint_states", "/robot_description", "/tf", "/tip_pose"]
    assert topics["/robot_description"][0][1].data == moved.model.urdf
    for topic in ("/actuators", "/joint_states", "/tf", "/tip_pose"):
        assert [time for time, _ in topics[topic]] == np.round(1e9 * times).astype(int).tolist()
    np.testing.assert_array_equal([message.position for _, message in topics["/actuators"]], moved.q_motors)
    assert topics["/actuators"][0][1].name == list(moved.model.actuator_names)
    tensions = len(moved.model.muscles) > 0
    exerted = moved.motor_torques if tensions else -moved.motor_torques
    np.testing.assert_array_equal([message.effort for _, message in topics["/actuators"]], exerted)
    states = [dict(zip(message.name, message.position, strict=True)) for _, message in topics["/joint_states"]]
    if not tensions:  # joints are strains, of which elastic coordinates are combinations
        springs = [[state[name] for name in moved.model.spring_joints] for state in states]
        np.testing.assert_array_equal(springs, moved.q_springs)
    tips = [[getattr(message.pose.position, axis) for axis in "xyz"] for _, message in topics["/tip_pose"]]
    expected = moved.tip_position if isinstance(moved, sr.Motion) else moved.tip_positions
    np.testing.assert_allclose(tips, expected, rtol=0, atol=1e-12)
    last = {one.child_frame_id: one.transform for one in topics["/tf"][-1][1].transforms}
    turn, at = last["tip"].rotation, last["tip"].translation
    placed = pin.XYZQUATToSE3(np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]))
    own = moved.equilibria[-1].transform_tip_to_world if isinstance(moved, sr.Trajectory) else pin.SE3(moved.transforms()[-1])
    assert placed.isApprox(own, 1e-12)


def test_a_log_replaces_nothing_and_its_package_is_named(tmp_path: Path, tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    tool("mcap_ros2")
    file = write_mcap(followed().equilibria[0], tmp_path / "log.mcap")
    with pytest.raises(sr.OutputExists):
        write_mcap(followed(), file)
    assert write_mcap(followed(), file, overwrite=True) == file
    monkeypatch.setitem(__import__("sys").modules, "mcap_ros2.writer", None)
    with pytest.raises(sr.MissingDependency, match=r"softrobots\[mcap\]"):
        write_mcap(followed(), tmp_path / "other.mcap")
    assert not (tmp_path / "other.mcap").exists()


@pytest.mark.study
def test_the_commands_write_messages_and_logs(tmp_path: Path, tool: Tool, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["ik", "inflatable_arm", "--target", "0.9", "0.1", "0.2", "--force", "0", "0", "-5", "-o"]
    assert cli.main([*words, str(tmp_path / "pose.yaml")]) == 0
    solution = sr.solve_ik(followed().model, TARGETS[0], (0, 0, -5))
    assert (tmp_path / "pose.yaml").read_text() == to_ros2_yaml(solution)
    tool("mcap_ros2")
    words = ["simulate", "inflatable_arm", "--duration", "0.1", "--gravity", "-o", str(tmp_path / "fall.mcap")]
    assert cli.main(words) == 0
    assert len(read(tmp_path / "fall.mcap", tool)["/tip_pose"]) > 5
    capsys.readouterr()
