"""Export to JSON beside the URDF: springs, roles, sections and muscles, with unit and source of every number.

For tools that read URDF but not the tags of this package. Every number is an object `{"value", "unit", "source"}`.
"""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from softrobots.core.checks import instance_of
from softrobots.core.errors import ParameterError, SoftRobotsError
from softrobots.description.actuator_reader import NUMBERS
from softrobots.description.rigid_tree import Joint
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_tags import CapsuleTag, FrictionTag, LumpedSectionTag, SectionTag, SpringTag
from softrobots.environment.environment import Environment, fixed_environment
from softrobots.export.number_sources import Rules, derived_numbers, number_rules
from softrobots.inflated_beam import wrinkling_moment
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.robots import Route
from softrobots.robots.fields import XacroRobot, default_text
from softrobots.version import __version__

FORMAT = "softrobots sidecar"
"""Name of the format in the files."""

VERSION = 1
"""Version of the format."""

_WIDTH = 128
_CALLER = "given by the caller"
_ROUTE_UNITS = {"at": "m", "distance": "m", "azimuth": "rad"}
_ACTUATOR_UNITS = {
    **dict.fromkeys(("rest_length", "shortest", "longest", "diameter"), "m"),
    **dict.fromkeys(("weakest", "strongest", "pretension"), "N"),
    **{"stiffness": "N/m", "area": "m2", "braid_angle": "rad", "max_pressure": "Pa"},
}
_TURNING, _SLIDING = ("rad", "N m/rad", "N m s/rad"), ("m", "N/m", "N s/m")

_CONVENTIONS = {
    "units": "SI and radians",
    "numbers": "value, unit and source; a source in terms of names is an expression in `parameters` and `derived`, as Python "
    "writes it, lists counted from 0",
    "joints": "coordinates, axes, parents and children as in the URDF; roles: motor (held), spring (free, with a spring), "
    "section (follows the coordinates of a section), locked (held at zero)",
    "springs": "torque = stiffness (q - rest), the load that the spring carries, minus what it exerts; in equilibrium "
    "stiffness (q - rest) = J^T f - g(q), with dead forces f and the gravity torques g",
    "damping": "of motion; statics does not use it",
    "wrinkling_moment": "moment at the first wrinkle of an inflated link [Troise 2021] (3); the springs are good below it",
    "max_moment": "moment of an inflated link never above this, along its bend: min(stiffness |s|, max_moment) s / |s|, with "
    "s = q - rest of its springs",
    "moment_law": "slack_wall: along the bend s of an inflated link, whose wall goes slack at M1 = pi pressure radius**3 / 2, "
    "the moment is stiffness |s| up to M1, and M1 (u - sin u cos u) / D beyond, with the u in (0, pi) of D = sin u - u cos u = "
    "pi M1 / (stiffness |s|)",
    "sections": "the six joints of a section of constant strain follow four coordinates (bending about x and y, twist, "
    "elongation, which is zero without EA) with the stiffness EI / length, EI / length, GJ / length, EA / length; rest: "
    "strains kx, ky, twist, stretch where all joints are at zero",
    "lumped_sections": "spring joints that stand for a section, by coordinate; hinge: length of rod from its start to them",
    "muscles": "actuators; route: offsets from the backbone, distance (cos(azimuth), sin(azimuth)), at places along the rest"
    " length of segments, linear between; kind: what is given of it, length, tension, elastic (length of its motor: tension "
    "= max(0, pretension + stiffness (length - motor))), pressure (tension = -pressure area) or mckibben (tension = max(0, "
    "pressure pi diameter**2 / 4 (3 / tan(braid_angle)**2 (length / rest_length)**2 - 1 / sin(braid_angle)**2))); arms: "
    "change of the length by each coordinate at rest; along a straight route a section has hypot(length without twist, "
    "distance t) with a twist t, a lumped one distance^2 t^2 / (2 length) more; a tension adds the energy tension times "
    "length, so that it moves the rest of a joint spring by -arm tension / stiffness; muscle_input: lengths where those "
    "are given, forces for all other kinds",
    "friction": "dry friction of segments: moment that holds their bending, coefficient of actuators in their guides",
    "lines": "lines along a segment that are drawn and do nothing",
    "capsules": "hold the body closely, for contact with surroundings: all points at most radius away from the segment from "
    "start to end, in the frame of link; neighbours overlap",
    "environment": "obstacles, as Environment.from_dict of softrobots reads them: lengths in m, columns of rotation are axes, "
    "pose moves position and rotation; a half_space is free where normal . x >= offset; length of a capsule is its core's",
}


def to_json(model: SoftModel, robot: XacroRobot | None = None, *, environment: Environment | None = None) -> str:
    """Write as JSON what URDF readers ignore: springs, roles, sections and muscles.

    The source of a number is the tag of the URDF or the caller of `load_model`; given the robot, it is an expression in the
    robot's parameters, and each parameter has the source that its xacro file gives.

    Args:
        model: The robot.
        robot: The robot of this package that the model was loaded from, for its parameters.
        environment: Obstacles around the robot, which stand still.

    Returns:
        JSON text, with all that `load_model` needs besides the URDF: springs, motors, tip and muscle input.

    Raises:
        ParameterError: If `model` is not a `SoftModel`, or was not loaded from `robot`; or obstacles move.
    """
    checked = check_model(model)
    rules: Rules = {}
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "written_by": f"softrobots {__version__}",
        "robot": checked.pinocchio.name,
    }
    if robot is not None:
        instance_of("robot", robot, XacroRobot, "a robot of this package, or left out")
        if robot.urdf() != checked.urdf:
            raise ParameterError("robot", robot, "the robot that the model was loaded from; it has another description")
        rules = number_rules(robot)
        content |= {"made_by": type(robot).__name__, "xacro": robot.XACRO}
    content["conventions"] = _CONVENTIONS
    if robot is not None:
        content |= {"parameters": _parameters(robot), "derived": derived_numbers(robot)}
    content |= {"tip": checked.tip, "muscle_input": checked.muscle_input}
    content |= _Parts(checked, rules).all()
    if environment is not None:
        content |= {"environment": fixed_environment(environment).to_dict()}
    return _text(content, "") + "\n"


class _Parts:
    """The parts of a model as JSON objects."""

    def __init__(self, model: SoftModel, rules: Rules) -> None:
        self._model, self._rules = model, rules
        self._tags, self._springs, self._roles = model.structure.tags, model.spring_table, model.joint_roles

    def all(self) -> dict[str, Any]:
        """Return all of them by kind."""
        joints = [joint for joint in read_rigid_tree(self._model.urdf).joints if joint.movable]
        tags = self._tags
        return {
            "joints": [self._joint(joint) for joint in joints],
            "inflated_links": [self._inflated_link(tag) for tag in tags.inflated_links],
            "sections": [self._section(tag) for tag in tags.sections],
            "lumped_sections": [self._section(tag) for tag in tags.lumped_sections],
            "friction": [self._friction(tag) for tag in tags.friction],
            "muscles": self._muscles(),
            "lines": [
                {"name": tag.name, "segment": tag.segment, **self._numbers(tag, "line", azimuth="rad", distance="m")}
                for tag in tags.lines
            ],
            "capsules": [self._capsule(tag, number) for number, tag in enumerate(tags.capsules, start=1)],
        }

    def _number(self, part: str, name: str, value: Any, unit: str, tag: str) -> dict[str, Any]:
        return {"value": value, "unit": unit, "source": self._rules.get((part, name), f"<{tag}> of the URDF")}

    def _numbers(self, tag: Any, kind: str, **units: str) -> dict[str, Any]:
        return {
            name: self._number(tag.name, name, getattr(tag, name), unit, f"softrobots:{kind}") for name, unit in units.items()
        }

    def _joint(self, joint: Joint) -> dict[str, Any]:
        position, stiffness, damping = _SLIDING if joint.kind == "prismatic" else _TURNING
        entry: dict[str, Any] = {"name": joint.name, "type": joint.kind, "role": self._roles[joint.name].split()[-1]}
        entry |= {"parent": joint.parent, "child": joint.child}
        if joint.kind != "continuous":
            bounds = zip(("lower", "upper"), joint.limits, strict=True)
            for name, value in ((name, value) for name, value in bounds if math.isfinite(value)):  # JSON has no infinity
                entry[name] = self._number(joint.name, name, value, position, "limit")
        entry["damping"] = self._number(joint.name, "damping", joint.damping, damping, "dynamics")
        if joint.name in self._springs:
            spring = SpringTag(*self._springs[joint.name])
            for name, unit in (("stiffness", stiffness), ("rest", position)):
                entry[name] = self._number(joint.name, name, getattr(spring, name), unit, "softrobots:spring")
                if self._roles[joint.name] == "given spring":
                    entry[name]["source"] = _CALLER
        return entry

    def _inflated_link(self, tag: Any) -> dict[str, Any]:
        name = " ".join(tag.springs)
        values = {"radius": (tag.radius, "m"), "pressure": (tag.pressure, "Pa")}
        if tag.max_moment is not None:
            values["max_moment"] = (tag.max_moment, "N m")
        entry: dict[str, Any] = {"springs": list(tag.springs)}
        if tag.hinges > 1:
            entry["hinges"] = tag.hinges
        if tag.twist is not None:
            entry["twist"] = tag.twist
        entry |= {key: self._number(name, key, *value, "softrobots:inflated_link") for key, value in values.items()}
        if tag.slack_wall:
            entry["moment_law"] = "slack_wall"
        moment = wrinkling_moment(tag.pressure, tag.radius)
        source = self._rules.get((name, "wrinkling_moment"), "pi**2 / 4 * pressure * radius**3")
        return entry | {"wrinkling_moment": {"value": moment, "unit": "N m", "source": source}}

    def _section(self, tag: SectionTag | LumpedSectionTag) -> dict[str, Any]:
        entry: dict[str, Any] = {"name": tag.name, "segment": tag.segment}
        if isinstance(tag, SectionTag):
            kind, entry["joints"] = "softrobots:section", list(tag.joints)
            values = {"EI": (tag.bending_stiffness, "N m2"), "GJ": (tag.torsional_stiffness, "N m2")}
            values |= {"EA": (tag.axial_stiffness, "N")} if math.isfinite(tag.axial_stiffness) else {}
            values |= {"bends": (tag.bends, "m"), "hinge": (tag.hinge, "m")} if tag.bends < tag.length else {}
        else:
            kind, entry["joints"] = "softrobots:lumped_section", dict(tag.joints)
            values = {"hinge": (tag.hinge, "m")}
        values |= {"length": (tag.length, "m"), "radius": (tag.radius, "m")}
        entry |= {key: self._number(tag.name, key, *value, kind) for key, value in values.items()}
        for key in ("rest", "relaxed") if isinstance(tag, SectionTag) else ("rest",):
            entry[key] = self._number(tag.name, key, list(getattr(tag, key)), "rad/m, rad/m, rad/m, -", kind)
        return entry

    def _friction(self, tag: FrictionTag) -> dict[str, Any]:
        part, kind = f"friction {tag.segment}", "softrobots:friction"
        bending = self._number(part, "bending", tag.bending, "N m", kind)
        return {"segment": tag.segment, "bending": bending, "guides": self._number(part, "guides", tag.guides, "-", kind)}

    def _capsule(self, tag: CapsuleTag, number: int) -> dict[str, Any]:
        values: dict[str, Any] = {"start": list(tag.start), "end": list(tag.end), "radius": tag.radius}
        part, kind = f"capsule {number}", "softrobots:capsule"
        return {"link": tag.link} | {key: self._number(part, key, value, "m", kind) for key, value in values.items()}

    def _muscles(self) -> list[dict[str, Any]]:
        arms, entries = self._model.structure.moment_arms, []
        for tag in self._model.structure.muscles:
            pieces = [
                {"segment": piece.segment}
                | {
                    key: self._number(f"{tag.name} {piece.segment}", key, list(getattr(piece, key)), unit, "softrobots:route")
                    for key, unit in _ROUTE_UNITS.items()
                }
                for piece in tag.route
            ]
            stated = ("rest_length", *NUMBERS[tag.kind])
            units = {key: unit for key, unit in _ACTUATOR_UNITS.items() if key in stated and math.isfinite(getattr(tag, key))}
            numbers = self._numbers(tag, "actuator", **units)
            entries.append({"name": tag.name, "kind": tag.kind, "route": pieces, **numbers, "arms": arms[tag.name]})
        return entries


def _parameters(robot: XacroRobot) -> dict[str, Any]:
    entries = {}
    for field in dataclasses.fields(robot):
        facts = field.metadata["facts"]
        if facts.in_xacro:
            source = facts.source
            if not _is_default(robot, field.name):
                source = f"{_CALLER} (default {default_text(field) or 'none'}: {source})"
            unit = facts.unit.replace("^", "") or "-"
            value = getattr(robot, field.name)
            if isinstance(value, tuple):
                value = [vars(item) if isinstance(item, Route) else item for item in value]
            entries[field.name] = {"value": value, "unit": unit, "meaning": facts.what, "source": source}
    return entries


def _is_default(robot: Any, name: str) -> bool:
    """Return whether a parameter has its default value."""
    default = next(field.default for field in dataclasses.fields(robot) if field.name == name)
    try:
        other: Any = dataclasses.replace(robot, **{name: default})
    except SoftRobotsError:  # the default does not fit the other parameters
        return False
    return bool(getattr(other, name) == getattr(robot, name))


def _text(value: Any, indent: str) -> str:
    """Return JSON with all digits; what fits into a line is on one line."""
    line = json.dumps(value, allow_nan=False)
    if not isinstance(value, dict | list | tuple) or len(indent) + len(line) <= _WIDTH:
        return line
    inner = indent + "  "
    if isinstance(value, dict):
        items = [f"{json.dumps(key)}: {_text(item, inner)}" for key, item in value.items()]
    else:
        items = [_text(item, inner) for item in value]
    opening, closing = ("{", "}") if isinstance(value, dict) else ("[", "]")
    return f"{opening}\n{inner}" + f",\n{inner}".join(items) + f"\n{indent}{closing}"
