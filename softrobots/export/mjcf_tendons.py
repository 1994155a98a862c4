"""Tendons in MJCF: sites, `<spatial>` elements, and an actuator or a spring for each."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence

from softrobots.core.checks import LARGEST, FloatArray
from softrobots.description.rigid_tree import number_text
from softrobots.export.tendons import Spring, Tendon

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


def write_tendons(element: ElementTree.Element, tendons: Sequence[Tendon]) -> None:
    """Write the courses of the tendons, and their springs."""
    for tendon in tendons:
        spatial = ElementTree.SubElement(element, "spatial", {"name": tendon.name, "width": "0.0005"})
        if isinstance(tendon.law, Spring):
            spring = tendon.law
            stiffness = (spring.linear, spring.square) if spring.square else (spring.linear,)
            spatial.set("stiffness", number_text(stiffness))
            spatial.set("springlength", number_text((0.0, spring.slack)))
            spatial.set("damping", repr(spring.damping))
        for number, leg in enumerate(tendon.legs):
            ElementTree.SubElement(spatial, "pulley", {"divisor": repr(leg.divisor)})
            for name in _names(tendon, number):
                ElementTree.SubElement(spatial, "site", {"site": name})


def write_drives(element: ElementTree.Element, tendons: Sequence[Tendon]) -> None:
    """Write the actuators of driven tendons; by a gear of -1 their force is the tension, and lengths are negative."""
    for tendon in tendons:
        law = tendon.law
        if isinstance(law, Spring):
            continue
        attributes = {"name": tendon.name, "tendon": tendon.name, "gear": "-1.0", "gainprm": repr(law.gain)}
        if law.stiffness:
            attributes |= {"biastype": "affine", "biasprm": number_text((law.constant, -law.stiffness, -law.damping))}
        if any(map(math.isfinite, law.limits)):
            attributes["forcerange"] = _range(law.limits)
        if any(map(math.isfinite, law.inputs)):
            attributes["ctrlrange"] = _range(law.inputs)
        ElementTree.SubElement(element, "general", attributes)


def _names(tendon: Tendon, number: int) -> tuple[str, str]:
    """Names of the sites of a leg, counted from 0."""
    return f"{tendon.name}_{2 * number + 1}", f"{tendon.name}_{2 * number + 2}"


def _range(bounds: tuple[float, float]) -> str:
    return number_text(min(max(bound, -LARGEST), LARGEST) for bound in bounds)
