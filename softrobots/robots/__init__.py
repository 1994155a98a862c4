"""The robots as frozen, checked parameters; a new one is a dataclass, a xacro file, and a line in `ROBOTS`."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from softrobots.core.errors import NameNotFound
from softrobots.description.sources import NAMED, Robot
from softrobots.robots.fields import XacroRobot
from softrobots.robots.helix_tube import HelixTube
from softrobots.robots.inflatable_arm import InflatableArm
from softrobots.robots.inflated_links import AssumedStiffnessWarning
from softrobots.robots.pcc_arm import PccArm
from softrobots.robots.routes import Route
from softrobots.robots.tendon_arm import TendonArm

ROBOTS: Mapping[str, Callable[..., XacroRobot]] = {
    "inflatable_arm": InflatableArm,
    "inflatable_arm_two_hinges": partial(InflatableArm, link_model="two_hinges"),
    "pcc_arm": PccArm,
    "pcc_arm_lumped": partial(PccArm, chain="lumped"),
    "tendon_arm": TendonArm,
    "tendon_arm_lumped": partial(TendonArm, chain="lumped", hinges=8),  # PyBullet takes at most 127 joints
    "helix_tube": HelixTube,
    "helix_tube_lumped": partial(HelixTube, chain="lumped"),
}
"""Constructor of each robot, by the name of its URDF file."""
NAMED.update(ROBOTS)


def robot_class(name: str) -> tuple[Any, Mapping[str, Any]]:
    """Return the class of a robot of `ROBOTS`, and the fields that its entry presets, or raise NameNotFound."""
    if name not in ROBOTS:
        raise NameNotFound("robot", name, ROBOTS)
    constructor = ROBOTS[name]
    return (constructor.func, constructor.keywords) if isinstance(constructor, partial) else (constructor, {})


__all__ = [
    "ROBOTS",
    "AssumedStiffnessWarning",
    "HelixTube",
    "InflatableArm",
    "PccArm",
    "Robot",
    "Route",
    "TendonArm",
    "XacroRobot",
    "robot_class",
]
