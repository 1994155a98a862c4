"""Results as logs in MCAP, the format of recordings of ROS 2 and Foxglove, written by mcap-ros2-support (extra `mcap`)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, Any

import numpy as np
import pinocchio as pin

from softrobots.core.errors import MissingDependency
from softrobots.core.files import new_file, write_atomically
from softrobots.export.ros_messages import JOINT_STATE, joint_state, nanoseconds, rows_of, stamp

WORLD = "world"
"""Frame of the poses."""

_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
}
_TYPES = {
    JOINT_STATE: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    "std_msgs/msg/String": "string data",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
}
"""Fields of the messages as in ROS 2."""


def require_mcap() -> Any:
    """Return the writer of mcap-ros2-support.

    Raises:
        MissingDependency: If it is not installed (extra `mcap`).
    """
    with MissingDependency.of_imports("mcap-ros2-support", "mcap"):
        from mcap_ros2.writer import Writer
    return Writer


def write_mcap(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a result as a log of ROS 2 messages in MCAP, for Foxglove, PlotJuggler and `ros2 bag play`.

    Topics: `/robot_description` (the URDF), `/joint_states` (every joint), `/actuators` (`q_motors` as positions), both with
    what the actuators exert as efforts, `/tf` (every link) and `/tip_pose`, both in the frame `world`. Times are those since
    the start [s], an equilibrium is at zero.

    Args:
        result: The equilibrium, IK solution, trajectory or motion.
        path: The file.
        overwrite: Whether a file that exists may be replaced.

    Returns:
        The path.

    Raises:
        ParameterError: If the result is something else, or the path is not one.
        MissingDependency: If mcap-ros2-support is not installed (extra `mcap`).
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If it cannot be written.
    """
    rows, writer_class = rows_of(result), require_mcap()
    model, data = rows.model, rows.model.pinocchio.createData()
    links = [
        frame for frame in model.pinocchio.frames if frame.type == pin.FrameType.BODY and frame.name not in ("universe", WORLD)
    ]

    def write(file: IO[bytes]) -> None:
        with writer_class(file) as writer:
            types = {name: writer.register_msgdef(name, _definition(text)) for name, text in _TYPES.items()}

            def add(topic: str, kind: str, seconds: float, message: dict[str, Any]) -> None:
                writer.write_message(topic, types[kind], message, log_time=nanoseconds(seconds))

            add("/robot_description", "std_msgs/msg/String", 0.0, {"data": model.urdf})
            for row, time in enumerate(rows.times.tolist()):
                head, positions = {"stamp": stamp(time), "frame_id": WORLD}, rows.joints(row)
                inputs = dict(zip(model.actuator_names, rows.q_motors[row].tolist(), strict=True))
                add("/joint_states", JOINT_STATE, time, joint_state(time, positions, rows.exerted(row)))
                add("/actuators", JOINT_STATE, time, joint_state(time, inputs, rows.exerted(row)))
                point = model.coordinates.at(rows.q_motors[row], rows.q_springs[row])
                pin.framesForwardKinematics(model.pinocchio, data, model.embed(point.joints))
                places = [_place(data.oMf[model.pinocchio.getFrameId(link.name, pin.FrameType.BODY)]) for link in links]
                moved = [
                    {"header": head, "child_frame_id": link.name, "transform": {"translation": at, "rotation": turn}}
                    for link, (at, turn) in zip(links, places, strict=True)
                ]
                add("/tf", "tf2_msgs/msg/TFMessage", time, {"transforms": moved})
                at, turn = _place(data.oMf[model.frame_id(model.tip)])
                tip = {"header": head, "pose": {"position": at, "orientation": turn}}
                add("/tip_pose", "geometry_msgs/msg/PoseStamped", time, tip)

    target = new_file(path, overwrite=overwrite)
    write_atomically(target, write, overwrite=overwrite)
    return target


def _place(placement: Any) -> tuple[dict[str, float], dict[str, float]]:
    """Position and quaternion as messages."""
    position, quaternion = placement.translation.tolist(), np.asarray(pin.SE3ToXYZQUAT(placement))[3:].tolist()
    return dict(zip("xyz", position, strict=True)), dict(zip("xyzw", quaternion, strict=True))


def _definition(text: str) -> str:
    """The definition of a message, with those of all that it consists of."""
    needed: dict[str, str] = {}
    waiting = [text]
    while waiting:
        for line in waiting.pop().splitlines():
            name = line.split()[0].removesuffix("[]")
            if name in _PARTS and name not in needed:
                needed[name] = _PARTS[name]
                waiting.append(_PARTS[name])
    return "".join([text, *(f"\n{'=' * 80}\nMSG: {name}\n{fields}" for name, fields in needed.items())]) + "\n"
