"""Small robots of slides and hinges as URDF, for contacts that can be reckoned by hand; they touch nothing at their bases."""

from __future__ import annotations

import math
from collections.abc import Sequence

import softrobots as sr


def joint(name: str, kind: str, parent: str, child: str, axis: str, stiffness: float = 0.0, origin: str = "") -> str:
    """A joint with a spring, or a motor without one; a fixed joint without an axis."""
    role = f'<softrobots:spring stiffness="{stiffness}" rest="0"/>' if stiffness else '<softrobots:role value="motor"/>'
    moves = f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="1" velocity="1"/>{role}' if axis else ""
    place = f"<origin {origin}/>" if origin else ""
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{place}{moves}</joint>'


def robot(links: Sequence[str], joints: Sequence[str], capsules: Sequence[tuple[str, str, str, float]]) -> sr.SoftModel:
    """A robot without masses; a capsule is link, start, end, radius."""
    tags = "".join(
        f'<softrobots:capsule link="{link}" start="{start}" end="{end}" radius="{radius}"/>'
        for link, start, end, radius in capsules
    )
    bodies = "".join(f'<link name="{link}"/>' for link in links)
    return sr.load_model(f'<robot name="planar" xmlns:softrobots="urn:softrobots:urdf">{bodies}{"".join(joints)}{tags}</robot>')


def block(stiffness: float = 100.0, upward: float = 50.0, radius: float = 0.1) -> sr.SoftModel:
    """A ball on the plane z = 0 that a motor pushes along x by a spring, and a soft spring keeps at its height."""
    joints = [
        joint("push", "prismatic", "base", "cart", "1 0 0", origin=f'xyz="0 0 {1.0 + radius}"'),
        joint("along", "prismatic", "cart", "slide", "1 0 0", stiffness),
        joint("up", "prismatic", "slide", "tip", "0 0 1", upward, 'xyz="0 0 -1"'),
    ]
    return robot(("base", "cart", "slide", "tip"), joints, [("tip", "0 0 0", "0 0 0", radius)])


def rail(angle: float, soft: float, stiff: float, radius: float = 0.1) -> sr.SoftModel:
    """A ball on the plane z = 0 that a motor pushes: by a soft spring up an inclined rail, by a stiff one across."""
    joints = [
        joint("push", "prismatic", "base", "cart", "1 0 0", origin=f'xyz="0 0 {1.0 + radius}"'),
        joint("along", "prismatic", "cart", "slide", "1 0 0", soft, f'rpy="0 {-angle} 0"'),
        joint("across", "prismatic", "slide", "held", "0 0 1", stiff),
        joint("end", "fixed", "held", "tip", "", origin=f'xyz="{-math.sin(angle)} 0 {-math.cos(angle)}"'),
    ]
    return robot(("base", "cart", "slide", "held", "tip"), joints, [("tip", "0 0 0", "0 0 0", radius)])


def ladder(length: float, angle: float, radius: float, soft: float) -> sr.SoftModel:
    """A ladder of an angle to the floor with its foot's centre at the radius above the origin, kept by very soft springs."""
    joints = [
        joint("x", "prismatic", "base", "a", "1 0 0", soft, f'xyz="0 0 {1.0 + radius}"'),
        joint("z", "prismatic", "a", "b", "0 0 1", soft, 'xyz="0 0 -1"'),
        joint("turn", "revolute", "b", "beam", "0 1 0", soft, f'xyz="0 0 0" rpy="0 {-angle} 0"'),
        joint("foot", "fixed", "beam", "foot", ""),
        joint("middle", "fixed", "beam", "middle", "", origin=f'xyz="{0.5 * length} 0 0"'),
        joint("top", "fixed", "beam", "tip", "", origin=f'xyz="{length} 0 0"'),
    ]
    capsules = [("foot", "0 0 0", "0 0 0", radius), ("tip", "0 0 0", "0 0 0", radius)]
    return robot(("base", "a", "b", "beam", "foot", "middle", "tip"), joints, capsules)


def rope(links: int, wrapped: float, radius: float, thickness: float, bending: float, guide: float) -> sr.SoftModel:
    """A chain of links that lie around the top of a cylinder along y below the origin, each touching it in its middle.

    Its start slides along x on a spring; hinges have the stiffness of a rod, which at rest is bent as the cylinder.
    """
    turn = wrapped / links
    length = 2.0 * (radius + thickness) * math.tan(0.5 * turn)
    names, joints = ["base", "link_0"], [joint("guide", "prismatic", "base", "link_0", "1 0 0", guide)]
    for number in range(1, links + 1):
        place = f'xyz="{(0.5 if number == 1 else 1.0) * length} 0 0" rpy="0 {turn} 0"'
        joints.append(joint(f"hinge_{number}", "revolute", names[-1], f"link_{number}", "0 1 0", bending / length, place))
        names.append(f"link_{number}")
    joints.append(joint("end", "fixed", names[-1], "tip", "", origin=f'xyz="{length} 0 0"'))
    return robot([*names, "tip"], joints, [(name, "0 0 0", f"{length} 0 0", thickness) for name in names[2:]])
