"""Composition of two robots into one URDF: a soft arm mounted on a link of another robot.

xacro joins the two descriptions (`xacro/mounted.urdf.xacro`) after names have got a prefix and text that it would evaluate is
quoted.
"""

from __future__ import annotations

import glob
import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple
from xml.dom import minidom

import numpy as np
import pinocchio as pin

from softrobots.core.checks import finite_array, read_only
from softrobots.core.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.description.renaming import children, package_tags, prefix_names, shift_segments, used_names
from softrobots.description.rigid_tree import Joint, Placement, RigidTree, number_text
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.sources import Robot, read_source
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import NAMESPACE, RobotTags

_WORLD = "world"


def mount(
    parent_urdf: Robot | Path | str,
    link: str,
    robot: Robot | Path | str,
    *,
    prefix: str = "soft_",
    xyz: Any = (0.0, 0.0, 0.0),
    rpy: Any = (0.0, 0.0, 0.0),
    name: str | None = None,
) -> str:
    """Mount a robot on a link of another one.

    The carrier is not changed. All names of the mounted robot get the prefix; its segments are numbered after those of the
    carrier. If its root is a link `world` without mass and shape that carries one fixed joint, that link is removed and
    the joint starts at `link`. Its tip becomes the tip of the whole, by a tag that `load_model` reads
    (`<softrobots:tip link=../>`); a mounted robot with several ends and no `tip` leaves the tip of the carrier. Of two tags
    `<mujoco>` the carrier's is kept. Relative paths of meshes are made absolute.

    Args:
        parent_urdf: The carrier: a robot of this package or its name, the path of a URDF file, or URDF text (what `load_model`
            takes).
        link: Link of the carrier.
        robot: The robot to be mounted, likewise.
        prefix: Prefix of every name of the mounted robot; letters, digits and underscores.
        xyz: Position of the root of the mounted robot in the frame of `link`, shape (3,) [m].
        rpy: Its orientation there as roll, pitch, yaw, shape (3,) [rad].
        name: Name of the whole; by default `<carrier>_with_<robot>`.

    Returns:
        URDF text, for `load_model` and every tool that reads URDF.

    Raises:
        ParameterError: If an argument has the wrong type or shape or is not finite, or prefix or name is not of letters, digits
            and underscores.
        NameNotFound: If the carrier has no such link; lists its links.
        DescriptionError: If a description cannot be read or is no URDF, if a name is in both of them after prefixing, if they
            declare an XML namespace differently, or if one has sections of constant strain and the other lumped ones.
    """
    position, angles = finite_array("xyz", xyz, (3,), "m"), finite_array("rpy", rpy, (3,), "rad")
    if not isinstance(prefix, str) or not re.fullmatch(r"[A-Za-z0-9_]*", prefix):
        raise ParameterError("prefix", prefix, "text of letters, digits and underscores")
    carrier, child = _read(parent_urdf, "parent_urdf"), _read(robot, "robot")
    links = [body.name for body in carrier.tree.bodies]
    if link not in links:
        raise NameNotFound("link", str(link), links)
    whole = f"{carrier.tree.name or 'robot'}_with_{child.tree.name or 'robot'}" if name is None else name
    if not isinstance(whole, str) or (name is not None and not re.fullmatch(r"\w+", name, re.ASCII)):
        raise ParameterError("name", name, "text of letters, digits and underscores")
    _check_kinds(carrier, child)
    tip = child.tip
    pose = Placement(read_only(position), read_only(np.asarray(pin.rpy.rpyToMatrix(*angles))))
    base = _joint_on_world(child)
    if base is None:
        root, joint = child.tree.root, "mount"
    else:
        root, joint = base.child, base.name
        if np.any(base.placement.position) or np.any(base.placement.rotation != np.eye(3)):
            pose = pose @ base.placement
            position, angles = pose.position, pose.rpy
    prefix_names(child.dom, prefix)  # first, so that references to the joint on the world get its new name, too
    _prepare_child(child, base, carrier, prefix)
    for tag in package_tags(carrier.dom, "tip") if tip is not None else ():
        carrier.dom.removeChild(tag)
    _check_names(carrier, child, prefix, prefix + joint)
    _check_namespaces(carrier, child)
    arguments = {
        "name": whole,
        "link": link,
        "root": prefix + root,
        "joint": prefix + joint,
        "xyz": number_text(position),
        "rpy": number_text(angles),
        "tip": "" if tip is None else prefix + tip,
    }
    with tempfile.TemporaryDirectory() as folder:
        for argument, part in (("carrier", carrier), ("robot", child)):
            file = Path(folder) / f"{argument}.urdf"
            _quote(part.dom)
            # ASCII, because xacro reads in the encoding of the system; escaped, because it expands brackets in file names.
            file.write_bytes(part.dom.toxml().encode("ascii", "xmlcharrefreplace"))
            arguments[argument] = glob.escape(str(file))
        text = expand(xacro_folder() / "mounted.urdf.xacro", arguments)
    read_tags(text, f"{carrier.label} with {child.label} on {link}")
    return text


class _Part(NamedTuple):
    """A description as text, DOM, rigid tree and tags."""

    label: str
    document: minidom.Document
    dom: minidom.Element
    tree: RigidTree
    tags: RobotTags

    @property
    def tip(self) -> str | None:
        """Name of the tip link; None if there are several ends."""
        if self.tags.tip is not None:
            return self.tags.tip
        names = [body.name for body in self.tree.bodies]
        ends = [name for name in names if not self.tree.joints_of(name)]
        return "tip" if "tip" in names else ends[0] if len(ends) == 1 else None


def _read(source: Any, field: str) -> _Part:
    text, label = read_source(source, field)
    tags = read_tags(text, label)  # raises for anything but URDF
    document = minidom.parseString(text.encode("utf-8"))
    (dom,) = children(document)
    links, joints = ({e.getAttribute("name") for e in children(dom) if e.tagName == tag} for tag in ("link", "joint"))
    both = links & joints
    if both:
        raise DescriptionError(f"{label} has links and joints that have the same name: {', '.join(sorted(both))}")
    return _Part(label, document, dom, read_rigid_tree(text, label), tags)


def _joint_on_world(part: _Part) -> Joint | None:
    """The only joint on a root `world` without mass and shapes, if it is fixed; None otherwise."""
    root = part.tree.body(part.tree.root)
    joints = part.tree.joints_of(root.name)
    empty = root.name == _WORLD and root.mass == 0.0 and not root.visuals and not root.collisions
    empty = empty and part.tip != root.name
    return joints[0] if empty and len(joints) == 1 and not joints[0].movable else None


def _prepare_child(child: _Part, base: Joint | None, carrier: _Part, prefix: str) -> None:
    """Remove what the whole has only once (tip, world, `<mujoco>`); names have their prefix already."""
    removed, elements = package_tags(child.dom, "tip"), children(child.dom)
    if base is not None:
        world = (("link", "name", _WORLD), ("joint", "name", base.name), ("gazebo", "reference", _WORLD))
        for tag, attribute, name in world:
            removed += [e for e in elements if e.tagName == tag and e.getAttribute(attribute) == prefix + name]
    if any(element.tagName == "mujoco" for element in children(carrier.dom)):
        removed += [element for element in elements if element.tagName == "mujoco"]
    for element in removed:
        child.dom.removeChild(element)
    sections = (*carrier.tags.sections, *carrier.tags.lumped_sections)
    shift_segments(child.dom, max((tag.segment for tag in sections), default=0))


def _check_kinds(carrier: _Part, child: _Part) -> None:
    for one, other in ((carrier, child), (child, carrier)):
        if one.tags.sections and other.tags.lumped_sections:
            raise DescriptionError(
                f"{one.label} has sections of constant strain and {other.label} has lumped ones; a robot has one kind: make "
                'both with chain="sections", or both with chain="lumped"'
            )


def _check_names(carrier: _Part, child: _Part, prefix: str, joint: str) -> None:
    above, below = used_names(carrier.dom), used_names(child.dom)
    below["link or joint"][joint] = "joint"
    for kind, names in below.items():
        for name in names:
            if name in above.get(kind, {}) and not (kind == "material" and above[kind][name] == names[name]):
                holder = "a material of another colour" if kind == "material" else f"a {kind}"
                raise DescriptionError(
                    f"{carrier.label} already has {holder} called {name!r}, as {child.label} with the prefix {prefix!r}; "
                    "choose another prefix"
                )


def _check_namespaces(carrier: _Part, child: _Part) -> None:
    declared = {"xmlns:softrobots": NAMESPACE}
    for part in (carrier, child):
        for attribute, value in part.dom.attributes.items():
            if attribute.startswith("xmlns:") and attribute != "xmlns:xacro" and declared.setdefault(attribute, value) != value:
                raise DescriptionError(
                    f"{part.label} declares {attribute}={value!r}, already declared as {declared[attribute]!r}; rename it"
                )


def _quote(node: Any) -> None:
    """Quote dollar signs in attributes and texts, which xacro would evaluate, and drop comments with instructions to it."""
    for inner in list(node.childNodes):
        if inner.nodeType == inner.ELEMENT_NODE:
            _quote(inner)
        elif inner.nodeType == inner.TEXT_NODE:
            inner.data = _quoted(inner.data)
        elif inner.nodeType == inner.COMMENT_NODE and "xacro:eval-comments" in inner.data:
            node.removeChild(inner)
    for attribute, value in list(node.attributes.items()):
        node.setAttribute(attribute, _quoted(value))


def _quoted(text: str) -> str:
    return text.replace("$", "${'$'}")
