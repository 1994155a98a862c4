"""Results as messages of ROS 2: a joint trajectory for a controller, or the joint states of one pose, as YAML.

The fields are those of `trajectory_msgs/msg/JointTrajectory`, `sensor_msgs/msg/JointState` and `builtin_interfaces/msg/Time` in
https://github.com/ros2/common_interfaces; all numbers are in rad, m and s, as there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.core.yaml_text import yaml_of
from softrobots.dynamics.motion import Motion
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.trajectory import Trajectory

JOINT_TRAJECTORY, JOINT_STATE = "trajectory_msgs/msg/JointTrajectory", "sensor_msgs/msg/JointState"
_BILLION = 1_000_000_000


class Rows(NamedTuple):
    """The robot over time, or at one instant."""

    model: SoftModel
    """The robot."""
    times: FloatArray
    """Since the first row, shape (n,) [s]."""
    q_motors: FloatArray
    """Actuators, shape (n, n_motors) [rad, m, N or Pa]."""
    velocities: FloatArray
    """Their rates, shape (n, n_motors)."""
    q_springs: FloatArray
    """Elastic coordinates, shape (n, n_springs) [rad or m]."""

    efforts: FloatArray
    """What each actuator exerts: the torque or force of a joint, the tension of a muscle, shape (n, n_motors) [N m or N]."""

    def joints(self, row: int) -> dict[str, float]:
        """Position of every joint that can move, by name [rad or m]; locked ones stand at zero."""
        chain = self.model.pinocchio
        values = self.model.coordinates.at(self.q_motors[row], self.q_springs[row]).joints.tolist()
        places = {name: chain.joints[chain.getJointId(name)].idx_v for name in list(chain.names)[1:]}  # the first is the world
        return {name: values[place] for name, place in places.items()} | dict.fromkeys(self.model.structure.locked_joints, 0.0)

    def exerted(self, row: int) -> dict[str, float]:
        """What each actuator exerts, by name [N m or N]."""
        return dict(zip(self.model.actuator_names, self.efforts[row].tolist(), strict=True))


def rows_of(result: Any) -> Rows:
    """Return the rows of an equilibrium, IK solution, trajectory or motion.

    A motion has its own velocities; those of a trajectory are differences of second order, zero at both ends.

    Raises:
        ParameterError: If it is something else.
    """
    if isinstance(result, IkSolution):
        result = result.equilibrium
    if isinstance(result, Equilibrium):
        times, rates = np.zeros(1), np.zeros((1, len(result.q_motors)))
    elif isinstance(result, Motion):
        times, rates = result.time, result.motor_velocities
    elif isinstance(result, Trajectory):
        times, rates = result.times, np.zeros_like(result.q_motors)
        if len(rates) > 2:
            rates[1:-1] = np.gradient(result.q_motors, times, axis=0)[1:-1]
    else:
        raise ParameterError("result", result, "an equilibrium, an IK solution, a trajectory or a motion")
    motors, springs, loads = map(np.atleast_2d, (result.q_motors, result.q_springs, result.motor_torques))
    signs = np.where(np.arange(motors.shape[1]) < motors.shape[1] - len(result.model.muscles), -1.0, 1.0)
    return Rows(result.model, times - times[0], motors, rates, springs, signs * loads + 0.0)


def nanoseconds(seconds: float) -> int:
    """Return a time in whole nanoseconds."""
    return round(seconds * _BILLION)


def stamp(seconds: float) -> dict[str, int]:
    """Return a time or a duration as a message."""
    whole, rest = divmod(nanoseconds(seconds), _BILLION)
    return {"sec": whole, "nanosec": rest}


def joint_state(seconds: float, positions: dict[str, float], efforts: dict[str, float]) -> dict[str, Any]:
    """Return positions by joint [rad or m], and what actuators exert there [N m or N], as a JointState message."""
    exerted = [efforts.get(name, 0.0) for name in positions]
    values = {"name": list(positions), "position": list(positions.values()), "velocity": [], "effort": exerted}
    return {"header": {"stamp": stamp(seconds), "frame_id": ""}, **values}


def to_ros2_yaml(result: Any, *, joints: Sequence[str] | None = None) -> str:
    """Write a result as a message of ROS 2 in YAML, as `ros2 topic pub` takes it.

    A trajectory or a motion becomes a JointTrajectory of the actuators with positions, velocities and times since its start;
    velocities of a trajectory are differences of its positions, zero at both ends, as controllers require. Waypoints without
    times are a second apart. An actuator that is no joint (a tension, a pressure) has its input as position [N or Pa]. An
    equilibrium or an IK solution becomes a JointState of all joints, springs too, for `robot_state_publisher`; its efforts are
    the torques that the motors exert, the negative of the loads that they carry, and zero at joints without a motor. A
    JointTrajectory has none, as controllers of positions refuse it with them.

    Args:
        result: The equilibrium, IK solution, trajectory or motion.
        joints: Names of the actuators of a trajectory, or of the joints of a state, in order; all by default.

    Returns:
        YAML text of one message, whose first line is a comment with its type.

    Raises:
        ParameterError: If the result is something else.
        NameNotFound: If there is no such actuator or joint.
    """
    rows = rows_of(result)
    if isinstance(result, Equilibrium | IkSolution):
        positions = rows.joints(0)
        shown = {name: positions[name] for name in _chosen("joint", joints, positions)}
        message = joint_state(0.0, shown, rows.exerted(0))
        return "".join([f"# {JOINT_STATE}\n", *(f"{field}: {yaml_of(value)}\n" for field, value in message.items())])
    names = rows.model.actuator_names
    chosen = _chosen("actuator", joints, names)
    places = [names.index(name) for name in chosen]
    lines = [f"# {JOINT_TRAJECTORY}", 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}']
    lines += [f"joint_names: {yaml_of(chosen)}", "points:"]
    for time, place, rate in zip(rows.times.tolist(), rows.q_motors[:, places], rows.velocities[:, places], strict=True):
        point = {"positions": place.tolist(), "velocities": rate.tolist(), "time_from_start": stamp(time)}
        lines.append(f"- {yaml_of(point)}")
    return "\n".join(lines) + "\n"


def _chosen(kind: str, wanted: Sequence[str] | None, available: Any) -> list[str]:
    for name in wanted or ():
        if name not in available:
            raise NameNotFound(kind, str(name), available)
    return list(available if wanted is None else wanted)
