"""Exporters: a robot as a file for MuJoCo, Drake, Gazebo, PyBullet or plain Pinocchio, as URDF or JSON; results for ROS 2."""

from softrobots.export.formats import FORMATS, export_model
from softrobots.export.mcap_log import write_mcap
from softrobots.export.mjcf import to_mjcf
from softrobots.export.ros_messages import to_ros2_yaml
from softrobots.export.sdf import to_sdf
from softrobots.export.sidecar import to_json
from softrobots.export.snippets import to_pinocchio, to_pybullet
from softrobots.export.urdf import to_urdf

__all__ = [
    "FORMATS", "export_model", "to_json", "to_mjcf", "to_pinocchio", "to_pybullet", "to_ros2_yaml", "to_sdf", "to_urdf",
    "write_mcap",
]  # fmt: skip
