"""Where a robot stands, and markers on it, as a fit finds them: part of a file of parameters, and of the robot's description.

    base_position: [0.1, 0.0, 0.3]   # m
    base_rotation: [0.0, 0.0, 0.02]  # rotation vector [rad]
    markers: [{name: ball, frame: tip, offset: [0.015, 0.0, 0.04]}]

In the description the robot stands on the link `world`, in whose axes loads are then given and positions are told, and each
marker is a link without mass, which `softrobots urdf --check` tells, since some tools take such links for a kilogram.
"""

from __future__ import annotations

import os
import re
from collections.abc import MutableMapping
from dataclasses import dataclass
from typing import Any, NamedTuple
from xml.dom import minidom

from softrobots.core.checks import finite_array
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.description.composition import mount
from softrobots.description.rigid_tree import Placement, number_text
from softrobots.description.sources import Robot
from softrobots.robots.parameter_file import read_parameters, robot_of

WORLD = "world"
"""Name of the link on which the robot stands."""

_NOTHING = (0.0, 0.0, 0.0)


class Marker(NamedTuple):
    """A marker."""

    name: str
    """Its name, that of its link."""
    frame: str
    """Link that it sits on."""
    offset: tuple[float, ...]
    """Its place there, shape (3,) [m]."""


@dataclass(frozen=True)
class RobotPlacement:
    """Base and markers of a robot."""

    position: tuple[float, ...] = _NOTHING
    """Position of the base in the frame of the measurements, shape (3,) [m]."""
    rotation: tuple[float, ...] = _NOTHING
    """Its rotation vector there, shape (3,) [rad]."""
    markers: tuple[Marker, ...] = ()
    """The markers."""

    @classmethod
    def taken_from(cls, values: MutableMapping[str, Any]) -> RobotPlacement:
        """Take the placement out of the content of a file of parameters.

        Raises:
            ParameterError: If it has another form than in the head of this module.
        """
        position, rotation = (
            tuple(finite_array(name, values.pop(name, _NOTHING), (3,), unit).tolist())
            for name, unit in (("base_position", "m"), ("base_rotation", "rad"))
        )
        given = values.pop("markers", ())
        markers = []
        for one in given if isinstance(given, tuple) else (given,):
            named = isinstance(one, dict) and one.keys() == set(Marker._fields)
            if not named or not all(isinstance(one[key], str) and re.fullmatch(r"\w+", one[key]) for key in ("name", "frame")):
                raise ParameterError("markers", given, "a list of mappings {name: NAME, frame: LINK, offset: [x, y, z]}")
            offset = tuple(finite_array("markers", one["offset"], (3,), "m").tolist())
            markers.append(Marker(one["name"], one["frame"], offset))
        return cls(position, rotation, tuple(markers))

    def values(self) -> dict[str, Any]:
        """Return the content of a file of parameters; empty if the robot stands at zero and has no markers."""
        found: dict[str, Any] = {}
        if any((*self.position, *self.rotation)):
            found |= {"base_position": self.position, "base_rotation": self.rotation}
        return found | ({"markers": tuple(one._asdict() for one in self.markers)} if self.markers else {})

    def place(self, robot: Robot) -> Robot | str:
        """Return the robot itself if there is nothing to place, else URDF text with base and markers, for `load_model`.

        Raises:
            NameNotFound: If a marker sits on a link that does not exist.
            DescriptionError: If a marker has the name of a link.
        """
        if not self.values():
            return robot
        dom = minidom.parseString(robot.urdf())
        root: Any = dom.documentElement
        links = [link.getAttribute("name") for link in root.getElementsByTagName("link")]
        for marker in self.markers:
            if marker.frame not in links:
                raise NameNotFound("link", marker.frame, links)
            link, joint = dom.createElement("link"), dom.createElement("joint")
            link.setAttribute("name", marker.name)
            joint.setAttribute("name", f"{marker.name}_on_{marker.frame}")
            joint.setAttribute("type", "fixed")
            parts = {
                "parent": ("link", marker.frame),
                "child": ("link", marker.name),
                "origin": ("xyz", number_text(marker.offset)),
            }
            for tag, (attribute, value) in parts.items():
                joint.appendChild(dom.createElement(tag)).setAttribute(attribute, value)
            root.appendChild(link)
            root.appendChild(joint)
        angles = Placement.moved("revolute", finite_array("base_rotation", self.rotation, (3,), "rad"), 1.0).rpy
        base = f'<robot name="{WORLD}"><link name="{WORLD}"/></robot>'
        name = root.getAttribute("name")
        return mount(base, WORLD, dom.toxml(), prefix="", xyz=self.position, rpy=angles, name=name)


def read_placed_robot(path: str | os.PathLike[str], robot: str | None = None) -> Robot | str:
    """Return a robot with the parameters of a file, and with the base and the markers that the file has.

    Args:
        path: The file.
        robot: Name of the robot in `ROBOTS`; by default the one that the file names.

    Returns:
        The robot, or URDF text of it with base and markers; both are what `load_model` takes.

    Raises:
        ParameterError: If `path` is no path, the file is for another robot or names none, or a value is refused.
        FileFormatError: If the file cannot be read or holds something else.
        NameNotFound: If there is no such robot, parameter or link.
        DescriptionError: If a marker has the name of a link.
    """
    owner, values = read_parameters(path)
    placement = RobotPlacement.taken_from(values)
    return placement.place(robot_of(owner, values, robot))
