"""Tendons in MJCF: sites, `<spatial>` elements, and an actuator or a spring for each; winches and pistons beside the robot."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence

from softrobots.core.checks import LARGEST, FloatArray
from softrobots.description.rigid_tree import number_text
from softrobots.export.slides import TENDON_LAG, WINCH_TIME, Piston, Winch
from softrobots.export.tendons import Drive, Spring, Tendon

Sites = Mapping[str, Sequence[tuple[str, FloatArray]]]
"""Names of sites and their places [m] by body."""


def place_sites(tendons: Sequence[Tendon]) -> Sites:
    """Return two sites for each leg of the tendons."""
    sites: dict[str, list[tuple[str, FloatArray]]] = {}
    for tendon in tendons:
        for number, leg in enumerate(tendon.legs):
            for body, name, place in zip(leg.bodies, _names(tendon, number), (leg.below, leg.above), strict=True):
                sites.setdefault(body, []).append((name, place))
    return sites


def write_slides(world: ElementTree.Element, tendons: Sequence[Tendon]) -> list[float]:
    """Write winches and pistons into the world, along its z axis; return the positions of their joints at home [m]."""
    homes = []
    for name, law, home in ((tendon.name, tendon.law, tendon.home) for tendon in tendons):
        if isinstance(law, Winch):
            depth, mass, rest = -law.anchor, law.gain * WINCH_TIME**2, law.rest
            ElementTree.SubElement(world, "site", {"name": f"{name}_anchor", "size": "0.001"})
        elif isinstance(law, Piston):
            depth, mass, rest, home = 0.0, law.mass, 0.0, 0.0
        else:
            continue
        place = {"name": _slide(name), "pos": number_text((0.0, 0.0, depth)), "gravcomp": "1"}
        body = ElementTree.SubElement(world, "body", place)
        ElementTree.SubElement(body, "inertial", {"pos": "0 0 0", "mass": repr(mass), "diaginertia": number_text([mass] * 3)})
        ElementTree.SubElement(body, "joint", {"name": _slide(name), "type": "slide", "axis": "0 0 1", "ref": repr(rest)})
        ElementTree.SubElement(body, "site", {"name": _slide(name), "size": "0.001"})
        homes.append(home)
    return homes


def write_tendons(root: ElementTree.Element, tendons: Sequence[Tendon]) -> None:
    """Write the courses of the tendons, their springs, and what ties pistons to their lengths."""
    element = ElementTree.SubElement(root, "tendon")
    for tendon in tendons:
        name, law = tendon.name, tendon.law
        spatial = ElementTree.SubElement(element, "spatial", {"name": name, "width": "0.0005"})
        if isinstance(law, Spring):
            stiffness = (law.linear, law.square) if law.square else (law.linear,)
            _spring(spatial, stiffness, (0.0, law.slack), law.damping)
        elif isinstance(law, Winch):
            _spring(spatial, (law.stiffness,), (law.spring_length,), TENDON_LAG * law.stiffness)
            for end in (_slide(name), f"{name}_anchor"):
                ElementTree.SubElement(spatial, "site", {"site": end})
        for number, leg in enumerate(tendon.legs):
            ElementTree.SubElement(spatial, "pulley", {"divisor": repr(leg.divisor)})
            for site in _names(tendon, number):
                ElementTree.SubElement(spatial, "site", {"site": site})
    pistons = {tendon.name: tendon.law for tendon in tendons if isinstance(tendon.law, Piston)}
    equality = ElementTree.SubElement(root, "equality") if pistons else element
    for name, law in pistons.items():
        fixed = ElementTree.SubElement(element, "fixed", {"name": _slide(name)})
        ElementTree.SubElement(fixed, "joint", {"joint": _slide(name), "coef": "1"})
        travel = {"polycoef": number_text((0.0, 1.0, law.square, law.cube, 0.0)), "solref": "0.01 1", "solimp": "0.99 0.99"}
        ElementTree.SubElement(equality, "tendon", {"tendon1": _slide(name), "tendon2": name, **travel})


def _spring(spatial: ElementTree.Element, stiffness: Sequence[float], slack: Sequence[float], damping: float) -> None:
    spatial.attrib |= {"stiffness": number_text(stiffness), "springlength": number_text(slack), "damping": repr(damping)}


def write_drives(element: ElementTree.Element, tendons: Sequence[Tendon]) -> None:
    """Write the actuators of driven tendons; by a gear of -1 their force is the tension, and lengths are negative."""
    for tendon in tendons:
        law = tendon.law
        if isinstance(law, Spring):
            continue
        attributes = {"name": tendon.name, "gear": "-1.0", "biastype": "affine"}
        if isinstance(law, Drive):
            attributes |= {"tendon": tendon.name, "gainprm": repr(law.gain)}
            bias: Sequence[float] = (law.constant, -law.stiffness, -law.damping)
            if any(map(math.isfinite, law.limits)):
                attributes["forcerange"] = _range(law.limits)
        elif isinstance(law, Winch):
            attributes |= {"joint": _slide(tendon.name), "gainprm": repr(-law.gain)}
            bias = (0.0, -law.gain, -2.0 * law.gain * WINCH_TIME)
        else:
            attributes |= {"joint": _slide(tendon.name), "gainprm": repr(law.area)}
            bias = (0.0, 0.0, 0.0)
        attributes["biasprm"] = number_text(bias)
        if any(map(math.isfinite, law.inputs)):
            attributes["ctrlrange"] = _range(law.inputs)
        ElementTree.SubElement(element, "general", attributes)


def _slide(name: str) -> str:
    """Name of the winch or the piston of a tendon."""
    return f"{name}_slide"


def _names(tendon: Tendon, number: int) -> tuple[str, str]:
    """Names of the sites of a leg, counted from 0."""
    return f"{tendon.name}_{2 * number + 1}", f"{tendon.name}_{2 * number + 2}"


def _range(bounds: tuple[float, float]) -> str:
    return number_text(min(max(bound, -LARGEST), LARGEST) for bound in bounds)
