"""How each number in the description of a robot of this package follows from the parameters, as an expression in them.

`stiffness[0]` is the stiffness of the first link, `bending_stiffness[0] / section_lengths[0]` that of a lumped hinge. Lists
count from 0; pi, sqrt, sin, cos and the usual operators are those of Python. A few lengths and stiffnesses that come in between
have names of their own, `derived_numbers`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from softrobots.constant_curvature.strain_chain import JOINTS, STRAINS
from softrobots.core.errors import ParameterError
from softrobots.robots import HelixTube, InflatableArm, PccArm, XacroRobot

Rules = dict[tuple[str, str], str]
"""Expression by the name of a part (joint, section, muscle, link) and of one of its numbers."""

_STIFFNESS = {"bend_x": "EI", "bend_y": "EI", "twist": "GJ", "stretch": "EA"}
_BEND = ("-pi / 2", "pi / 2")


class DerivedNumber(NamedTuple):
    """A number that lies between the parameters and the description."""

    value: float | list[float]
    """Its value, or one a segment."""
    unit: str
    """Its unit."""
    meaning: str
    """What it is."""
    source: str
    """The expression; of the first segment, where there is one a segment."""


def check_robot(robot: Any) -> XacroRobot:
    """Return `robot` if it is one of this package.

    Raises:
        ParameterError: If it is something else.
    """
    if not isinstance(robot, XacroRobot):
        raise ParameterError("robot", robot, "an InflatableArm, a PccArm or a HelixTube, or left out")
    return robot


def number_rules(robot: XacroRobot) -> Rules:
    """Expression of every number in the description of a robot."""
    for kind, rules in _RULES:
        if isinstance(robot, kind):
            return rules(robot)
    return {}


def derived_numbers(robot: XacroRobot) -> dict[str, DerivedNumber]:
    """The numbers that expressions name besides the parameters."""
    if isinstance(robot, PccArm):
        count = robot.elastic_sections if robot.chain == "sections" else robot.hinges
        lengths = [length / count for length in robot.segment_lengths]
        name = "elastic_sections" if robot.chain == "sections" else "hinges"
        made = DerivedNumber(lengths, "m", "Rest length of a section, by segment", f"segment_lengths[0] / {name}")
        return {"section_lengths": made}
    return _helix_numbers(robot) if isinstance(robot, HelixTube) else {}


def _helix_numbers(robot: HelixTube) -> dict[str, DerivedNumber]:
    radius, wall = robot.radius, robot.wall_thickness
    _, curvature, torsion, _ = robot.strains.tolist()
    length = robot.centre_length / robot.n_sections
    count = "elastic_sections" if robot.chain == "sections" else "hinges"
    square = "((1 - contraction)**2 + 4 * contraction * cos(angle)**2)"
    sign = "" if robot.handedness == "right" else "-"
    walls = {
        "EI": (
            (robot.young_modulus + robot.pressure * radius / (2.0 * wall)) * math.pi * radius**3 * wall,
            "(young_modulus + pressure * radius / (2 * wall_thickness)) * pi * radius**3 * wall_thickness",
        ),
        "GJ": (
            robot.young_modulus / (2.0 * (1.0 + robot.poisson_ratio)) * 2.0 * math.pi * radius**3 * wall,
            "young_modulus / (2 * (1 + poisson_ratio)) * 2 * pi * radius**3 * wall_thickness",
        ),
        "EA": (robot.young_modulus * 2.0 * math.pi * radius * wall, "young_modulus * 2 * pi * radius * wall_thickness"),
    }
    made = {"radius": DerivedNumber(radius, "m", "Radius of the tube", "diameter / 2")}
    for name, kind in (("EI", "bending"), ("GJ", "torsional"), ("EA", "axial")):
        measured = getattr(robot, f"{kind}_stiffness")
        value, rule = walls[name] if measured is None else (measured, f"{kind}_stiffness")
        unit = "N" if name == "EA" else "N m2"
        made[name] = DerivedNumber(value, unit, f"{kind.capitalize()} stiffness", rule)
    made |= {
        "section_length": DerivedNumber(
            length, "m", "Rest length of a section", f"length * sqrt({square}) / (2 * cos(angle)) / {count}"
        ),
        "curvature": DerivedNumber(
            curvature, "rad/m", "Curvature of the centre line", f"2 * (1 - contraction**2) / (diameter * {square})"
        ),
        "torsion_rate": DerivedNumber(
            torsion, "rad/m", "Torsion of the centre line", f"{sign}4 * contraction * sin(2 * angle) / (diameter * {square})"
        ),
    }
    rate = math.hypot(curvature, torsion)
    if rate == 0.0:
        return made | {"chord": DerivedNumber(length, "m", "Chord of a section", "section_length")}
    chord = math.hypot(2.0 * curvature / rate**2 * math.sin(0.5 * rate * length), torsion * length / rate)
    rule = "sqrt((2 * curvature / rate**2 * sin(rate * section_length / 2))**2 + (torsion_rate * section_length / rate)**2)"
    return made | {
        "rate": DerivedNumber(rate, "rad/m", "Turning rate of the centre line", "sqrt(curvature**2 + torsion_rate**2)"),
        "chord": DerivedNumber(chord, "m", "Chord of a section", rule),
    }


def _inflatable_arm(robot: InflatableArm) -> Rules:
    rules: Rules = {}
    for motor in range(1, robot.n_links + 2):
        rules |= {(f"motor_{motor}", "lower"): "-motor_limit", (f"motor_{motor}", "upper"): "motor_limit"}
        rules[f"motor_{motor}", "damping"] = "0.0"
    for i in range(robot.n_links):
        for side in ("side", "up"):
            joint = f"spring_{i + 1}_{side}"
            rules[joint, "stiffness"], rules[joint, "rest"] = f"stiffness[{i}]", f"rest_{side}[{i}]"
            rules[joint, "lower"], rules[joint, "upper"] = _BEND
            rules[joint, "damping"] = f"spring_damping[{i}]"
        link = f"spring_{i + 1}_side spring_{i + 1}_up"
        rules |= {(link, name): f"{name}[{i}]" for name in ("radius", "pressure", "max_moment")}
        rules[link, "wrinkling_moment"] = f"pi**2 / 4 * pressure[{i}] * radius[{i}]**3"
    return rules


def _pcc_arm(robot: PccArm) -> Rules:
    rules: Rules = {}
    for s in range(robot.n_segments):
        names = {"EI": f"bending_stiffness[{s}]", "GJ": f"torsional_stiffness[{s}]", "EA": f"axial_stiffness[{s}]"}
        names |= {"length": f"section_lengths[{s}]", "radius": f"radius[{s}]", "chord": f"section_lengths[{s}]"}
        names["rest"] = "[0.0, 0.0, 0.0, 1.0]"
        rules |= _chain(robot, s + 1, names)
        for m in range(len(robot.muscle_azimuths)):
            muscle, rest = f"muscle_{s + 1}_{m + 1}", f"segment_lengths[{s}]"
            rules[muscle, "azimuth"], rules[muscle, "distance"] = f"muscle_azimuths[{m}]", f"muscle_distance[{s}]"
            rules[muscle, "rest_length"] = rest
            rules[muscle, "shortest"] = f"{rest} * (1 - muscle_contraction[{s}])"
            rules[muscle, "longest"] = f"{rest} * (1 + muscle_extension[{s}])"
            rules[muscle, "strongest"] = f"muscle_force[{s}]"
    return rules


def _helix_tube(robot: HelixTube) -> Rules:
    names = {name: name for name in ("EI", "GJ", "EA", "radius", "chord")}
    names |= {"length": "section_length", "rest": "[0.0, curvature, torsion_rate, 1.0]"}
    rules = _chain(robot, 1, names)
    for j in range(1, robot.n_sections + 1):
        link = f"section_1_{j}_bend_x section_1_{j}_bend_y"
        rules |= {(link, "radius"): "radius", (link, "pressure"): "pressure"}
        rules[link, "wrinkling_moment"] = "pi**2 / 4 * pressure * radius**3"
    return rules | {("actuator", "azimuth"): "0.0", ("actuator", "distance"): "radius"}


def _chain(robot: PccArm | HelixTube, segment: int, names: Mapping[str, str]) -> Rules:
    """Rules of the sections of a segment and of their joints; `names` are the expressions for what a section has."""
    rules: Rules = {}
    lumped = robot.chain == "lumped"
    count = robot.hinges if lumped else robot.elastic_sections
    for j in range(1, count + 1):
        section = f"section_{segment}_{j}"
        rules |= {(section, name): names[name] for name in ("length", "rest", "radius")}
        if lumped:
            shift = 0 if robot.hinge_rule == "midpoint" or count == 1 else (j == count) - (j == 1)
            rules[section, "hinge"] = f"{names['length']} * (1 / 2{('', ' + 1 / 24', ' - 1 / 24')[shift]})"
            rules |= _hinge(section, names)
        else:
            rules |= {(section, name): names[name] for name in ("EI", "GJ", "EA")}
            rules |= _section_joints(section, names)
    return rules


def _hinge(section: str, names: Mapping[str, str]) -> Rules:
    rules: Rules = {}
    for strain in STRAINS:
        joint = f"{section}_{strain}"
        stiffness = f"{names[_STIFFNESS[strain]]} / {names['length']}"
        travel = f"0.9 * {names['length']}"
        rules[joint, "stiffness"], rules[joint, "rest"] = stiffness, "0.0"
        rules[joint, "lower"], rules[joint, "upper"] = (f"-{travel}", travel) if strain == "stretch" else _BEND
        rules[joint, "damping"] = f"damping_time * {stiffness}"
    return rules


def _section_joints(section: str, names: Mapping[str, str]) -> Rules:
    rules: Rules = {}
    for kind in JOINTS:
        joint = f"{section}_{kind}"
        tag = {"c": "EA", "r3": "GJ"}.get(kind, "EI")
        limits = {"c": (f"-0.9 * {names['chord']}", names["chord"]), "r3": ("-pi", "pi")}.get(kind, _BEND)
        rules[joint, "lower"], rules[joint, "upper"] = limits
        rules[joint, "damping"] = f"damping_time * {names[tag]} / {names['length']}"
    return rules


_RULES: tuple[tuple[type, Callable[[Any], Rules]], ...] = (
    (InflatableArm, _inflatable_arm),
    (PccArm, _pcc_arm),
    (HelixTube, _helix_tube),
)
