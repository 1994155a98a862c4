"""The robots: frozen, checked parameters that become xacro arguments and URDF text.

A robot is a dataclass here, a xacro file, and a line in `ROBOTS`.
"""

from collections.abc import Callable, Mapping
from functools import partial

from softrobots.description.sources import Robot
from softrobots.robots.helix_tube import HelixTube
from softrobots.robots.inflatable_arm import InflatableArm
from softrobots.robots.pcc_arm import PccArm

ROBOTS: Mapping[str, Callable[[], Robot]] = {
    "inflatable_arm": InflatableArm,
    "pcc_arm": PccArm,
    "pcc_arm_lumped": partial(PccArm, chain="lumped"),
    "helix_tube": HelixTube,
    "helix_tube_lumped": partial(HelixTube, chain="lumped"),
}
"""What makes each robot with its default parameters, by the name of its URDF file."""

__all__ = ["ROBOTS", "HelixTube", "InflatableArm", "PccArm", "Robot"]
