"""Reader of the tags of this package in a URDF: springs, sections, actuators and roles."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import number_in
from softrobots.description.actuator_reader import read_actuators
from softrobots.description.expansion import XACRO_NAMESPACE
from softrobots.description.tag_numbers import described, number, numbers, positive, segment_number
from softrobots.description.urdf_structure import check_structure, urdf_root
from softrobots.description.urdf_tags import (
    COORDINATES,
    MOMENT_LAWS,
    NAMESPACE,
    ROLES,
    AnySectionTag,
    CapsuleTag,
    FrictionTag,
    InflatedLinkTag,
    LineTag,
    LumpedSectionTag,
    RobotTags,
    SectionTag,
    SpringTag,
)


def read_tags(urdf_text: str, source: str = "the URDF") -> RobotTags:
    """Read the tags of this package from URDF text; all are empty for a file that has none.

    Raises:
        DescriptionError: If the text is no URDF (see `softrobots.description.urdf_structure.check_structure`), or a tag is
            malformed.
    """
    root = urdf_root(urdf_text, source)
    if any(element.tag.startswith(f"{{{XACRO_NAMESPACE}}}") for element in root.iter()):
        raise DescriptionError(
            f"{source} is an unexpanded xacro file; expand it first (softrobots.description.expansion.expand)"
        )
    springs: dict[str, SpringTag] = {}
    roles: dict[str, str] = {}
    rotors: dict[str, float] = {}
    for joint in root.findall("joint"):
        _read_joint(joint, source, springs, roles, rotors)
    sections = tuple(_section(element, source, roles) for element in _ours(root, "section"))
    elastic = [*springs, *(f"{tag.name}_{strain}" for tag in sections for strain in tag.strains)]
    tags = RobotTags(
        springs=springs,
        roles=roles,
        inflated_links=tuple(_inflated_link(element, source, elastic) for element in _ours(root, "inflated_link")),
        sections=sections,
        lumped_sections=tuple(_lumped_section(element, source, springs) for element in _ours(root, "lumped_section")),
        muscles=(),
        lines=tuple(_line(element, source) for element in _ours(root, "line")),
        mimics=tuple(joint.get("name", "") for joint in root.findall("joint") if joint.find("mimic") is not None),
        tip=_tip(root, source),
        friction=tuple(_friction(element, source) for element in _ours(root, "friction")),
        rotors=rotors,
        capsules=tuple(_capsule(element, source) for element in _ours(root, "capsule")),
    )
    _check_together(tags, source)
    _check_capsules(tags.capsules, [link.get("name", "") for link in root.findall("link")], source)
    check_structure(root, source)
    muscles = read_actuators(root, _base_to_tip(root, tags), source)
    _unique("muscle", [*(tag.name for tag in muscles), *(tag.name for tag in tags.lines)], source)
    shared = sorted({tag.name for tag in muscles} & {joint.get("name", "") for joint in root.findall("joint")})
    if shared:
        raise DescriptionError(
            f"{source} has both a joint and an actuator called {', '.join(shared)}; names that differ are required"
        )
    tags = replace(tags, muscles=muscles)
    _check_lengths_kept(tags, source)
    return tags


def _ours(element: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return element.findall(f"{{{NAMESPACE}}}{name}")


def _read_joint(
    joint: ElementTree.Element, source: str, springs: dict[str, SpringTag], roles: dict[str, str], rotors: dict[str, float]
) -> None:
    name = joint.get("name", "")
    for tag_name in ("spring", "role", "rotor"):
        if len(_ours(joint, tag_name)) > 1:
            raise DescriptionError(f"joint {name} in {source} has more than one {tag_name}; one is required")
    for spring in _ours(joint, "spring"):
        where = f"the spring of joint {name} in {source}"
        springs[name] = SpringTag(positive(spring, "stiffness", where), number(spring, "rest", where))
    for rotor in _ours(joint, "rotor"):
        rotors[name] = positive(rotor, "inertia", f"the rotor of joint {name} in {source}")
    for role in _ours(joint, "role"):
        value = role.get("value", "")
        if value not in ROLES:
            raise DescriptionError(f"joint {name} in {source} has the role {value!r}; one of {', '.join(ROLES)} is required")
        if (value == "spring") != (name in springs):
            raise DescriptionError(
                f"joint {name} in {source} has the role {value!r} and {'a' if name in springs else 'no'} spring"
            )
        roles[name] = value


def _inflated_link(element: ElementTree.Element, source: str, springs: Sequence[str]) -> InflatedLinkTag:
    names, twist = tuple(element.get("springs", "").split()), element.get("twist")
    if not names or any(name not in springs for name in (*names, *([] if twist is None else [twist]))):
        raise DescriptionError(
            f"an inflated_link of {source} names the springs {' '.join(names) or '(none)'}"
            f"{'' if twist is None else f' and the twist {twist!r}'}; "
            f"springs that exist are required: {', '.join(springs) or 'none'}"
        )
    where, hinges = f"the inflated_link of {' '.join(names)} in {source}", element.get("hinges", "1")
    if hinges not in map(str, range(1, len(names) + 1)) or len(names) % int(hinges):
        raise DescriptionError(f"{where} has hinges = {hinges!r}; a divisor of {len(names)} is required")
    most = positive(element, "max_moment", where) if "max_moment" in element.attrib else None
    law = element.get("moment_law", "linear" if most is None else "plateau")
    if law not in MOMENT_LAWS or (law == "plateau") != (most is not None):
        raise DescriptionError(
            f"{where} has moment_law {law!r} and {'no max_moment' if most is None else f'max_moment {most}'}; required: one of "
            f"{', '.join(MOMENT_LAWS)}, with max_moment for a plateau only"
        )
    radius, pressure = number(element, "radius", where), number(element, "pressure", where)
    tag = InflatedLinkTag(names, radius, pressure, most, int(hinges), twist, law == "slack_wall")
    if tag.radius <= 0.0 or tag.pressure < 0.0:
        raise DescriptionError(f"{where} has radius {tag.radius} and pressure {tag.pressure}; required > 0 and >= 0")
    if tag.slack_wall and tag.pressure == 0.0:
        raise DescriptionError(f"{where} has moment_law 'slack_wall' and no pressure; required > 0: it bears no moment without")
    return tag


def _section(element: ElementTree.Element, source: str, roles: Mapping[str, str]) -> SectionTag:
    where = described(element, "section", source)
    joints = tuple(element.get("joints", "").split())
    if len(joints) != 6 or any(roles.get(joint) != "section" for joint in joints):
        raise DescriptionError(
            f"{where} names the joints {' '.join(joints) or '(none)'}; six joints with the role 'section' are required"
        )
    ei, gj = (positive(element, key, where) for key in ("EI", "GJ"))
    ea = math.inf if element.get("EA", "").strip().lower() == "inf" else positive(element, "EA", where)
    facts = _facts_of_section(element, where)
    relaxed = _strains(element, "relaxed", where) if "relaxed" in element.attrib else facts["rest"]
    facts["bends"] = positive(element, "bends", where) if "bends" in element.attrib else facts["length"]
    facts["hinge"] = number(element, "hinge", where) if "hinge" in element.attrib else 0.0
    if facts["bends"] > facts["length"] or facts["hinge"] < 0.0:
        raise DescriptionError(f"{where} has bends {facts['bends']}, hinge {facts['hinge']}; required: <= length and >= 0")
    if math.isinf(ea) and not facts["rest"][3] == relaxed[3] == 1.0:
        raise DescriptionError(f"{where} has EA inf and the stretches {facts['rest'][3]}, {relaxed[3]}; required: 1")
    return SectionTag(joints=joints, bending_stiffness=ei, torsional_stiffness=gj, axial_stiffness=ea, relaxed=relaxed, **facts)


def _lumped_section(element: ElementTree.Element, source: str, springs: Mapping[str, SpringTag]) -> LumpedSectionTag:
    where = described(element, "lumped section", source)
    joints = {key: element.get(key, "") for key in COORDINATES if element.get(key)}
    complete = {"bend_x", "bend_y"} <= joints.keys() and springs.keys() >= set(joints.values())
    if not complete or len(set(joints.values())) != len(joints):
        raise DescriptionError(
            f"{where} names the joints {joints}; different spring joints bend_x and bend_y are required; "
            "twist and stretch are optional"
        )
    return LumpedSectionTag(joints=joints, hinge=positive(element, "hinge", where), **_facts_of_section(element, where))


def _facts_of_section(element: ElementTree.Element, where: str) -> dict[str, Any]:
    """The fields of `AnySectionTag`."""
    rest = _strains(element, "rest", where)
    facts: dict[str, Any] = {key: positive(element, key, where) for key in ("length", "radius")}
    if "middle" in element.attrib:
        facts["middle"] = numbers(element, "middle", where)
        if len(facts["middle"]) != 2:
            raise DescriptionError(f"{where} has {len(facts['middle'])} numbers as its middle; x and y are required")
    return {"name": element.get("name", ""), "segment": segment_number(element, where), "rest": rest, **facts}


def _strains(element: ElementTree.Element, key: str, where: str) -> tuple[float, ...]:
    """The four strains of an attribute."""
    texts = element.get(key, "").split()
    strains = tuple(number_in(text) for text in texts)
    if len(strains) != 4 or not all(map(math.isfinite, strains)) or strains[3] <= 0.0:
        raise DescriptionError(
            f"{where} has {key} = {' '.join(texts)[:99]!r}; kx, ky, twist and a positive stretch are required"
        )
    return strains


def _line(element: ElementTree.Element, source: str) -> LineTag:
    where = described(element, "line", source)
    azimuth, distance = number(element, "azimuth", where), positive(element, "distance", where)
    return LineTag(name=element.get("name", ""), segment=segment_number(element, where), azimuth=azimuth, distance=distance)


def _friction(element: ElementTree.Element, source: str) -> FrictionTag:
    segment = segment_number(element, f"a friction of {source}")
    where = f"the friction of segment {segment} of {source}"
    tag = FrictionTag(segment, number(element, "bending", where), number(element, "guides", where))
    if tag.bending < 0.0 or tag.guides < 0.0:
        raise DescriptionError(f"{where} has bending {tag.bending} and guides {tag.guides}; required >= 0")
    return tag


def _capsule(element: ElementTree.Element, source: str) -> CapsuleTag:
    link = element.get("link", "")
    where = f"a capsule of link {link!r} in {source}"
    start, end = (_point(element, key, where) for key in ("start", "end"))
    return CapsuleTag(link, start, end, positive(element, "radius", where))


def _point(element: ElementTree.Element, key: str, where: str) -> tuple[float, float, float]:
    values = numbers(element, key, where)
    if len(values) != 3:
        raise DescriptionError(f"{where} has {len(values)} numbers as its {key}; x, y and z are required")
    return values[0], values[1], values[2]


def _check_capsules(capsules: Sequence[CapsuleTag], links: Sequence[str], source: str) -> None:
    known = set(links)
    for tag, count in Counter(capsules).items():
        if tag.link not in known:
            available = ", ".join(links) or "none"
            raise DescriptionError(
                f"{source} has a capsule of a link {tag.link!r}; a link that exists is required: {available}"
            )
        if count > 1:
            raise DescriptionError(f"{source} has {count} equal capsules of link {tag.link}; one of them is required")


def _tip(root: ElementTree.Element, source: str) -> str | None:
    named = [element.get("link", "") for element in _ours(root, "tip")]
    links = [link.get("name", "") for link in root.findall("link")]
    if len(named) > 1 or any(name not in links for name in named):
        raise DescriptionError(
            f"{source} names the tips {', '.join(map(repr, named))}; one link is required: {', '.join(links) or 'none'}"
        )
    return named[0] if named else None


def _check_together(tags: RobotTags, source: str) -> None:
    """Check that names are unique, no joint is in two sections, and lines run along segments that exist."""
    if tags.sections and tags.lumped_sections:
        raise DescriptionError(f"{source} has sections and lumped sections; one kind is required")
    sections = (*tags.sections, *tags.lumped_sections)
    _unique("section", [tag.name for tag in sections], source)
    used = [joint for tag in tags.sections for joint in tag.joints]
    used += [joint for lumped in tags.lumped_sections for joint in lumped.joints.values()]
    _unique("joint of a section", used, source)
    orphans = [name for name, role in tags.roles.items() if role == "section" and name not in used]
    if orphans:
        raise DescriptionError(f"{source} has joints with the role 'section' that no section names: {', '.join(orphans)}")
    segments = {tag.segment for tag in sections}
    placed = [(f"line {tag.name!r} of {source} runs along", tag.segment) for tag in tags.lines]
    for what, segment in (*placed, *((f"friction of {source} is that of", tag.segment) for tag in tags.friction)):
        if segment not in segments:
            available = ", ".join(map(str, sorted(segments))) or "none"
            raise DescriptionError(f"the {what} segment {segment}; available: {available}")
    _unique("friction of segment", [str(tag.segment) for tag in tags.friction], source)


def _check_lengths_kept(tags: RobotTags, source: str) -> None:
    """Refuse what needs the stretch of sections that keep their length."""
    kept = [tag.name for tag in tags.sections if math.isinf(tag.axial_stiffness)]
    linked = {name for link in tags.inflated_links for name in link.springs} - tags.springs.keys()
    if kept and (len(kept) < len(tags.sections) or linked or tags.muscles):
        raise DescriptionError(
            f"{source} has section {kept[0]} with EA inf; required: EA inf of all sections, no actuators, and no inflated "
            "links with springs of sections"
        )


def _base_to_tip(root: ElementTree.Element, tags: RobotTags) -> list[AnySectionTag]:
    """The sections in the order of their joints along the robot, which is a tree."""
    parents: dict[str, str] = {}  # links by joint
    joints: dict[str, str] = {}  # above each link
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        parents[name], child = ("" if end is None else end.get("link", "") for end in map(joint.find, ("parent", "child")))
        joints[child] = name

    def depth(joint: str) -> int:
        count = 0
        while joint in parents:
            joint, count = joints.get(parents[joint], ""), count + 1
        return count

    first = [(tag.joints[0], tag) for tag in tags.sections]
    lumped = [(tag.joints["bend_x"], tag) for tag in tags.lumped_sections]
    return [tag for _, tag in sorted([*first, *lumped], key=lambda pair: depth(pair[0]))]


def _unique(what: str, names: Sequence[str], source: str) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice or "" in names:
        raise DescriptionError(f"{source} has a {what} name twice or an empty one: {', '.join(sorted(twice)) or '(empty)'}")
