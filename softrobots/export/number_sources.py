"""Expressions by which the numbers in the description of a robot follow from its parameters.

`stiffness[0]` is the stiffness of the first link, `bending_stiffness[0] / section_lengths[0]` that of a lumped hinge. Lists are
counted from 0; pi, sqrt, sin, cos and the operators are those of Python. Names that are no parameters are in `derived_numbers`.
The xacro macros evaluate the same formulas; a test compares every expression with the number in the URDF.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from softrobots.constant_curvature.strain_chain import JOINTS, STRAINS
from softrobots.robots import HelixTube, InflatableArm, TendonArm, XacroRobot
from softrobots.robots.continuum_arm import ATTRIBUTES, ContinuumArm
from softrobots.robots.fields import facts_of

Rules = dict[tuple[str, str], str]
"""Expression by the name of a part (joint, section, muscle, link) and of one of its numbers."""

_Row = tuple[str, float | list[float], str, str, str]  # name, value or one a segment, unit, meaning, expression (of the first)
_BEND = ("-pi / 2", "pi / 2")
_LENGTHS = ("shortest", "longest")


def number_rules(robot: XacroRobot) -> Rules:
    """Return the expression of every number in the description of a robot."""
    if isinstance(robot, InflatableArm):
        return _inflatable_arm(robot)
    if isinstance(robot, ContinuumArm):
        return _continuum_arm(robot)
    return _helix_tube(robot) if isinstance(robot, HelixTube) else {}


def derived_numbers(robot: XacroRobot) -> dict[str, dict[str, Any]]:
    """Return value, unit, meaning and source of the numbers that expressions name besides the parameters."""
    rows: list[_Row] = []
    if isinstance(robot, InflatableArm):
        rows = _link_stiffness(robot)
    elif isinstance(robot, ContinuumArm):
        name = "elastic_sections" if robot.chain == "sections" else "hinges"
        lengths = [length / getattr(robot, name) for length in robot.segment_lengths]
        rows = [("section_lengths", lengths, "m", "Rest length of a section, by segment", f"segment_lengths[0] / {name}")]
        rows += _backbone(robot) if isinstance(robot, TendonArm) else []
    elif isinstance(robot, HelixTube):
        rows = [*_tube_stiffness(robot), *_tube_shape(robot)]
    keys = ("value", "unit", "meaning", "source")
    return {name: dict(zip(keys, facts, strict=True)) for name, *facts in rows}


def _link_stiffness(robot: InflatableArm) -> list[_Row]:
    two, springs = robot.link_model == "two_hinges", list(robot.spring_stiffness)
    meaning = "Stiffness of each spring that bends a link"
    if not two and robot.young_modulus is None:
        return [] if robot.stiffness else [("spring_stiffness", springs, "N m/rad", meaning, repr(springs[0]))]
    stress, second = "pressure[0] * radius[0] / (2 * wall_thickness[0])", "pi * radius[0]**3 * wall_thickness[0]"
    modulus = robot.wall_modulus
    source = "young_modulus[0]" if robot.young_modulus else repr(modulus[0])
    if robot.stiffness:
        source = f"stiffness[0] * link_lengths[0] / (2 * {second}) - {stress}"
    shear = "shear_modulus[0]" if robot.shear_modulus else "wall_modulus[0] / 2.6"
    bending, shearing, twisting = (stiffness.tolist() for stiffness in robot.beams)
    area = "pressure[0] * pi * radius[0]**2 + 0.5 * shear_of_wall[0] * 2 * pi * radius[0] * wall_thickness[0]"
    one = "1 / (link_lengths[0] / (3 * bending[0]) + 1 / (link_lengths[0] * shearing[0]))"
    rows: list[_Row] = [
        ("wall_modulus", list(modulus), "Pa", "Young's modulus of the wall", source),
        ("shear_of_wall", list(robot.wall_shear_modulus), "Pa", "Shear modulus of the wall", shear),
        ("bending", bending, "N m2", "Bending stiffness of a link", f"(wall_modulus[0] + {stress}) * {second}"),
        ("shearing", shearing, "N", "Shear stiffness of a link", area),
    ]
    if not robot.stiffness:
        rows.append(("spring_stiffness", springs, "N m/rad", meaning, "2 * bending[0] / link_lengths[0]" if two else one))
    if two:
        distance = "link_lengths[0] * sqrt(1 / 12 + bending[0] / (shearing[0] * link_lengths[0]**2))"
        rows.append(("hinge_distance", robot.hinges.distance.tolist(), "m", "Distance of the hinges from the middle", distance))
    if robot.torsion:
        torsion, twist = f"(shear_of_wall[0] + {stress}) * 2 * {second}", robot.hinges.twist_stiffness.tolist()
        rows.append(("twisting", twisting, "N m2", "Torsional stiffness of a link", torsion))
        rows.append(("twist_stiffness", twist, "N m/rad", "Stiffness of its spring", "twisting[0] / link_lengths[0]"))
    return rows


def _backbone(robot: TendonArm) -> list[_Row]:
    rods = {
        "EI": ("bending", "N m2", "young_modulus[0] * pi * backbone_radius[0]**4 / 4"),
        "GJ": ("torsional", "N m2", "young_modulus[0] / (2 * (1 + poisson_ratio[0])) * pi * backbone_radius[0]**4 / 2"),
        "EA": ("axial", "N", "young_modulus[0] * pi * backbone_radius[0]**2"),
    }
    rows: list[_Row] = []
    for name, (kind, unit, rule) in rods.items():
        source = rule if getattr(robot, f"{kind}_stiffness") is None else f"{kind}_stiffness[0]"
        values = list(getattr(robot, f"{kind}_in_force"))
        rows.append((name, values, unit, f"{kind.capitalize()} stiffness of a segment", source))
    return rows


def _tube_stiffness(robot: HelixTube) -> list[_Row]:
    r, t, modulus = robot.radius, robot.wall_thickness, robot.young_modulus
    walls = {
        "bending": (modulus + robot.pressure * r / (2.0 * t)) * math.pi * r**3 * t,
        "torsional": modulus / (2.0 * (1.0 + robot.poisson_ratio)) * 2.0 * math.pi * r**3 * t,
        "axial": modulus * 2.0 * math.pi * r * t,
    }
    rules = {
        "bending": "(young_modulus + pressure * radius / (2 * wall_thickness)) * pi * radius**3 * wall_thickness",
        "torsional": "young_modulus / (2 * (1 + poisson_ratio)) * 2 * pi * radius**3 * wall_thickness",
        "axial": "young_modulus * 2 * pi * radius * wall_thickness",
    }
    if robot.real:  # what wrinkles along the actuator resists contraction and bending alike
        bending = walls["bending"] if robot.bending_stiffness is None else robot.bending_stiffness
        walls["axial"], rules["axial"] = 2.0 * bending / r**2, "2 * EI / radius**2"
    rows: list[_Row] = [("radius", r, "m", "Radius of the tube", "diameter / 2")]
    for name, kind, unit in (("EI", "bending", "N m2"), ("GJ", "torsional", "N m2"), ("EA", "axial", "N")):
        measured, meaning = getattr(robot, f"{kind}_stiffness"), f"{kind.capitalize()} stiffness"
        value, rule = (walls[kind], rules[kind]) if measured is None else (measured, f"{kind}_stiffness")
        rows.append((name, value, unit, meaning, rule))
    return rows


def _tube_shape(robot: HelixTube) -> list[_Row]:
    strains, whole = robot.rest_chain
    _, curvature, torsion, _ = strains.tolist()
    length, rate = whole / robot.n_sections, math.hypot(curvature, torsion)
    count, sign = "elastic_sections" if robot.chain == "sections" else "hinges", "" if robot.handedness == "right" else "-"
    square = "((1 - contraction)**2 + 4 * contraction * cos(angle)**2)"
    line, length_rule = "centre line", f"length * sqrt({square}) / (2 * cos(angle))"
    bend_rule = f"2 * (1 - contraction**2) / (diameter * {square})"
    torsion_rule = f"{sign}4 * contraction * sin(2 * angle) / (diameter * {square})"
    if robot.real:
        line, length_rule, bend_rule = "line of the actuator", "length / cos(angle)", "(cos(2 * angle) - 1) / diameter"
        torsion_rule = f"{sign}sin(2 * angle) / diameter"
    rows: list[_Row] = [
        ("section_length", length, "m", "Rest length of a section", f"{length_rule} / {count}"),
        ("curvature", curvature, "rad/m", f"Curvature of the {line}", bend_rule),
        ("torsion_rate", torsion, "rad/m", f"Torsion of the {line}", torsion_rule),
    ]
    if rate == 0.0:
        return [*rows, ("chord", length, "m", "Chord of a section", "section_length")]
    chord = math.hypot(2.0 * curvature / rate**2 * math.sin(0.5 * rate * length), torsion * length / rate)
    rule = "sqrt((2 * curvature / rate**2 * sin(rate * section_length / 2))**2 + (torsion_rate * section_length / rate)**2)"
    return [
        *rows,
        ("rate", rate, "rad/m", f"Turning rate of the {line}", "sqrt(curvature**2 + torsion_rate**2)"),
        ("chord", chord, "m", "Chord of a section", rule),
    ]


def _inflatable_arm(robot: InflatableArm) -> Rules:
    motor = {"lower": "-motor_limit", "upper": "motor_limit", "damping": "0.0"}
    rules = {(f"motor_{i}", name): rule for i in range(1, robot.n_links + 2) for name, rule in motor.items()}
    stiffness = "spring_stiffness" if robot.stiffness is None else "stiffness"
    two = robot.link_model == "two_hinges"
    names, share = (("a_side", "a_up", "b_up", "b_side"), " / 2") if two else (("side", "up"), "")
    for i in range(robot.n_links):
        bending = {f"spring_{i + 1}_{name}": f"rest_{name.split('_')[-1]}[{i}]{share}" for name in names}
        twist = {f"spring_{i + 1}_twist": "0.0"} if robot.torsion else {}
        for joint, rest in (bending | twist).items():
            rules[joint, "stiffness"] = f"{'twist_stiffness' if joint in twist else stiffness}[{i}]"
            rules[joint, "rest"] = rest
            rules[joint, "lower"], rules[joint, "upper"] = _BEND
            rules[joint, "damping"] = f"spring_damping[{i}]"
            if robot.damping_time is not None:
                rules[joint, "damping"] = f"damping_time[{i}] * {rules[joint, 'stiffness']}"
        link = " ".join(bending)
        rules |= {(link, name): f"{name}[{i}]" for name in ("radius", "pressure", "max_moment")}
        rules[link, "wrinkling_moment"] = f"pi**2 / 4 * pressure[{i}] * radius[{i}]**3"
    return rules


_RELAXED = {"bend_x": "rest_bend_x", "bend_y": "rest_bend_y", "twist": "rest_twist"}
_FRICTION = {"bending": "bending_friction", "guides": "guide_friction"}


def _continuum_arm(robot: ContinuumArm) -> Rules:
    rules: Rules = {}
    kinds = ("EI", "GJ", "EA")
    stiffness = kinds if isinstance(robot, TendonArm) else ("bending_stiffness", "torsional_stiffness", "axial_stiffness")
    for s in range(robot.n_segments):
        names = {name: f"{rule}[{s}]" for name, rule in zip(kinds, stiffness, strict=True)}
        names |= {"length": f"section_lengths[{s}]", "radius": f"radius[{s}]", "chord": f"section_lengths[{s}]"}
        relaxed = [f"{name}[{s}] / segment_lengths[{s}]" for name in _RELAXED.values()]
        rules |= _chain(robot, s + 1, names | {"rest": "[0.0, 0.0, 0.0, 1.0]", "relaxed": f"[{', '.join(relaxed)}, 1.0]"})
        hinges = {(f"section_{s + 1}_{j + 1}_{kind}", name) for j in range(robot.hinges) for kind, name in _RELAXED.items()}
        rules |= {(joint, "rest"): f"{name}[{s}] / hinges" for joint, name in hinges if robot.chain == "lumped"}
        rules |= {(f"friction {s + 1}", name): f"{fact}[{s}]" for name, fact in _FRICTION.items()}
    owners = robot.actuator_segments
    for i, s in enumerate(owners):
        m, word = owners[:i].count(s), robot.ACTUATOR
        fields = [name for name, facts in facts_of(robot).items() if facts.form == "per_actuator" and getattr(robot, name)]
        own = {name.removeprefix(f"{word}_"): f"{name}[{robot.place_of(name, i)}]" for name in fields}
        rules |= _actuator(robot, f"{word}_{s + 1}_{m + 1}", s, own)
        if not robot.routes:  # the table of a route that is listed, and what follows from that, is in the URDF
            rules |= _straight_route(robot, s, m, own)
    return rules


def _actuator(robot: ContinuumArm, name: str, s: int, own: Mapping[str, str]) -> Rules:
    """Rules of an actuator of segment `s`, from 0, without those of its route; `own` are its values of the fields."""
    numbers = {fact: number for fact, number in ATTRIBUTES.items() if number not in _LENGTHS and fact in own}
    rules = {(name, number): own[fact] for fact, number in numbers.items()}
    if "least_tension" not in own:
        rules[name, "weakest"] = "0.0" if robot.kind[s] == "elastic" else f"-{own['force']}"
    return rules


def _straight_route(robot: ContinuumArm, s: int, m: int, own: Mapping[str, str]) -> Rules:
    """Rules of the route and of the lengths of actuator `m` of segment `s`, from 0."""
    word, start = robot.ACTUATOR, robot.starts[s]
    name = f"{word}_{s + 1}_{m + 1}"
    rest = " + ".join(f"segment_lengths[{k}]" for k in range(start, s + 1))
    rules = {(name, "rest_length"): rest}
    rules[name, "shortest"] = f"({rest}) * (1 - {own['contraction']})"
    rules[name, "longest"] = f"({rest}) * (1 + {own['extension']})"
    for k in range(start, s + 1):
        piece, turns = f"{name} {k + 1}", [f"offset[{turn}]" for turn in range(k + 1, s + 1)]
        azimuth = " + ".join([f"{word}_azimuths[{m}]", own["azimuth_deviation"], *turns])
        rules[piece, "at"] = f"[0.0, segment_lengths[{k}]]"
        rules[piece, "distance"], rules[piece, "azimuth"] = f"[{own['distance']}] * 2", f"[{azimuth}] * 2"
    return rules


def _helix_tube(robot: HelixTube) -> Rules:
    names = {name: name for name in ("EI", "GJ", "EA", "radius", "chord")}
    rest = "[0.0, curvature, torsion_rate, 1.0]"
    rules = _chain(robot, 1, names | {"length": "section_length", "rest": rest, "relaxed": rest})
    if robot.real:
        return rules | _tube_actuators()
    for j in range(1, robot.n_sections + 1):
        link = f"section_1_{j}_bend_x section_1_{j}_bend_y"
        rules |= {(link, "radius"): "radius", (link, "pressure"): "pressure"}
        rules[link, "wrinkling_moment"] = "pi**2 / 4 * pressure * radius**3"
    return rules | {("actuator", "azimuth"): "0.0", ("actuator", "distance"): "radius"}


def _tube_actuators() -> Rules:
    """Rules of the actuator, the line of the wall opposite and the air of a tube with a real actuator."""
    rules: Rules = {}
    line = "length / cos(angle)"
    for name, rest, distance in (("actuator", line, "0.0"), ("wall", line, "diameter"), ("air", "length", "radius")):
        rules |= {(name, bound): "0.0" for bound in ("shortest", "weakest", "pretension")}
        rules[name, "rest_length"] = rest
        rules[name, "stiffness"] = f"young_modulus * 2 * pi * radius * wall_thickness / ({line})"
        rules[name, "area"] = "pi * radius**2"
        rules[f"{name} 1", "at"] = f"[0.0, {line}]"
        rules[f"{name} 1", "distance"], rules[f"{name} 1", "azimuth"] = f"[{distance}] * 2", "[pi] * 2"
    return rules


def _chain(robot: ContinuumArm | HelixTube, segment: int, names: Mapping[str, str]) -> Rules:
    """Rules of the sections of a segment and of their joints; `names` are the expressions of the properties of a section."""
    rules: Rules = {}
    length, flexures = names["length"], robot.chain == "flexures"
    chord = f"{length} / 2" if flexures else names["chord"]
    if robot.chain == "lumped":
        count, travel = robot.hinges, {"stretch": (f"-0.9 * {length}", f"0.9 * {length}")}
        kinds = dict(zip(STRAINS, ("EI", "EI", "GJ", "EA"), strict=True))
    else:
        count = robot.hinges if flexures else robot.elastic_sections
        travel = {"c": (f"-0.9 * {chord}", chord), "r3": ("-pi", "pi")}
        kinds = {kind: {"c": "EA", "r3": "GJ"}.get(kind, "EI") for kind in JOINTS}
    place_of: dict[int, str] = {}  # of a hinge in its section, if not in the middle
    if robot.hinge_rule == "corrected" and count > 3:
        first, second = "(47 - sqrt(671)) / 48", "(sqrt(671) - 1) / 48"
        place_of = {1: first, 2: second, count - 1: f"1 - {second}", count: f"1 - {first}"}
    elif robot.hinge_rule == "corrected" and count > 1:
        place_of = {1: "11 / 24", count: "13 / 24"}
    for j in range(1, count + 1):
        section = f"section_{segment}_{j}"
        rules |= {(section, name): names[name] for name in ("length", "rest", "relaxed", "radius", "EI", "GJ", "EA")}
        rules[section, "hinge"] = f"{length} * ({place_of.get(j, '1 / 2')}{' - 1 / 4' if flexures else ''})"
        rules[section, "bends"] = chord
        for kind, tag in kinds.items():
            joint, stiffness = f"{section}_{kind}", f"{names[tag]} / {length}"
            rules[joint, "stiffness"], rules[joint, "rest"] = stiffness, "0.0"
            rules[joint, "lower"], rules[joint, "upper"] = travel.get(kind, _BEND)
            rules[joint, "damping"] = f"damping_time * {stiffness}"
    return rules
