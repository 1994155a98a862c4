"""What the text of an SDF file can say that bears on the statics and that Drake does not pass on, or does not survive."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree


def not_carried(root: ElementTree.Element) -> list[str]:
    """List what would be lost.

    Drake drops dry friction and mimic joints without a word, ends the process at a negative stiffness or a limit that is no
    number, and puts 1 kg where a mass is not positive.

    Args:
        root: The root of the document.

    Returns:
        A reason each.
    """
    found = []
    if next(root.iter("include"), None) is not None:
        found.append("included files (they cannot be checked before Drake reads them; `gz sdf -p` writes them out)")
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
    for tag, usual, why in (("gravity", "true", "every link has its weight"), ("kinematic", "false", "loads move every link")):
        said = link.findtext(tag, usual).strip().lower()
        if said not in (usual, "1" if usual == "true" else "0"):
            found.append(f"<{tag}>{said}</{tag}> of link {name} ({why})")
    return found


def _joint(joint: ElementTree.Element) -> list[str]:
    name, found = joint.get("name", ""), []
    if any((element.text or "").strip().lower().lstrip("+-").startswith("nan") for element in joint.iter()):
        found.append(f"a number of joint {name} that is none")
    for axis in (*joint.findall("axis"), *joint.findall("axis2")):
        stiffness, reference, friction = (
            _number(axis.find(f"dynamics/{name}")) for name in ("spring_stiffness", "spring_reference", "friction")
        )
        if not 0.0 <= stiffness < math.inf or not math.isfinite(reference):
            found.append(
                f"stiffness {stiffness:g} and rest {reference:g} of joint {name} (finite ones are required, not negative)"
            )
        elif stiffness > 0.0 and friction != 0.0:
            found.append(f"joint {name} with spring and dry friction (it rests anywhere within the friction)")
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
