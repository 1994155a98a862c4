"""Collision shapes that overlap across a small link: no tool filters such pairs, and the springs between them feel the push.

MuJoCo and Drake let parent and child pass through each other, no other pair. With overlap across the tiny link of a hinge the
equilibrium in MuJoCo is off by 0.08 to 0.33 rad.
"""

from __future__ import annotations

import copy
import itertools
import xml.etree.ElementTree as ElementTree

import pinocchio as pin

from softrobots.description.mesh_files import remove_mesh_shapes
from softrobots.description.rigid_tree_urdf import link_at
from softrobots.description.urdf_document import Problems, UrdfDocument

_MAX_DOF = 300
"""Largest number of joint coordinates for which distances are computed: beyond, Pinocchio's `Data` costs gigabytes."""


def overlapping_shapes(document: UrdfDocument) -> Problems:
    """Pairs of shapes that overlap with all joints at zero, on two links that are not parent and child.

    Args:
        document: The file; shapes from mesh files are left out.

    Returns:
        What is wrong, with the name of the outer link of each pair.
    """
    text = _without_meshes(document)
    try:
        model = pin.buildModelFromXML(text)
        geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError):
        return  # what Pinocchio refuses is told by `checks`
    if model.nv > _MAX_DOF:  # `checks` tells of what is too large
        return
    owners = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    parents = {link: link_at(joint, "parent") for link, joint in document.carrier.items()}
    for (j, above), (i, link) in itertools.combinations(enumerate(owners), 2):
        if above != link and parents.get(link) != above and parents.get(above) != link:
            geometry.addCollisionPair(pin.CollisionPair(j, i))
    if not len(geometry.collisionPairs):
        return
    data = geometry.createData()
    pin.computeDistances(model, model.createData(), geometry, data, pin.neutral(model))
    for pair, result in zip(geometry.collisionPairs, data.distanceResults, strict=True):
        if result.min_distance <= 0.0:
            one, other = owners[pair.first], owners[pair.second]
            yield other, f"the collision shapes of {one} and {other} overlap with all joints at zero"


def _without_meshes(document: UrdfDocument) -> str:
    """The document without shapes from mesh files, which may not be there."""
    root = copy.deepcopy(document.root)
    remove_mesh_shapes(root)
    return ElementTree.tostring(root, encoding="unicode")
