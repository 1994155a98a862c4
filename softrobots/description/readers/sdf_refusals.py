"""Features of SDF text that affect the statics and that Drake drops silently or does not survive."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree


def not_carried(root: ElementTree.Element) -> list[str]:
    """Return the unsupported features of a document, with reasons.

    Drake drops dry friction and mimic joints silently, ends the process at a negative stiffness or a NaN limit, and replaces a
    mass that is not positive by 1 kg.
    """
    found = []
    if next(root.iter("include"), None) is not None:
        found.append("included files (they cannot be checked before Drake reads them; `gz sdf -p` merges them)")
    for link in root.iter("link"):
        found += _link(link)
        if any(str(element.tag).endswith("deformable_properties") for element in link):
            found.append(f"the deformable link {link.get('name')} (a chain of joints with springs is supported)")
    for joint in root.iter("joint"):
        found += _joint(joint)
    return found


def _link(link: ElementTree.Element) -> list[str]:
    name, found = link.get("name", ""), []
    mass = link.find("inertial/mass")
    if mass is not None and not 0.0 < _number(mass) < math.inf:
        found.append(f"the mass {mass.text} of link {name} (a positive one is required)")
    for tag, usual, why in (
        ("gravity", "true", "every link has its full weight"),
        ("kinematic", "false", "loads move every link"),
    ):
        value = link.findtext(tag, usual).strip().lower()
        if value not in (usual, "1" if usual == "true" else "0"):
            found.append(f"<{tag}>{value}</{tag}> of link {name} ({why})")
    return found


def _joint(joint: ElementTree.Element) -> list[str]:
    name, found = joint.get("name", ""), []
    if any((element.text or "").strip().lower().lstrip("+-").startswith("nan") for element in joint.iter()):
        found.append(f"a NaN in joint {name}")
    for axis in (*joint.findall("axis"), *joint.findall("axis2")):
        stiffness, reference, friction = (
            _number(axis.find(f"dynamics/{name}")) for name in ("spring_stiffness", "spring_reference", "friction")
        )
        if not 0.0 <= stiffness < math.inf or not math.isfinite(reference):
            found.append(
                f"stiffness {stiffness:g} and rest {reference:g} of joint {name} (finite ones are required, not negative)"
            )
        elif stiffness > 0.0 and friction != 0.0:
            found.append(f"joint {name} with spring and dry friction (its equilibrium is not unique)")
        if axis.find("mimic") is not None:
            found.append(f"the mimic of joint {name} (couplings are not supported)")
    return found


def _number(element: ElementTree.Element | None) -> float:
    if element is None:
        return 0.0
    try:
        return float(element.text or "")
    except ValueError:
        return math.nan
