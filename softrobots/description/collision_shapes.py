"""Collision shapes that overlap across a small link, where their contact force loads the springs between them.

MuJoCo and Drake filter contacts of parent and child only. Overlap across the tiny link of a hinge makes the equilibrium in
MuJoCo wrong by 0.08 to 0.33 rad.
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
"""Most joint coordinates for which distances are computed; Pinocchio's `Data` takes gigabytes beyond."""


def overlapping_shapes(document: UrdfDocument) -> Problems:
    """Yield pairs of links, other than parent and child, whose shapes overlap with all joints at zero; meshes are left out."""
    root = copy.deepcopy(document.root)
    remove_mesh_shapes(root)
    text = ElementTree.tostring(root, encoding="unicode")
    try:
        model = pin.buildModelFromXML(text)
        geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    except (ValueError, RuntimeError):
        return  # `check_description` reports what Pinocchio refuses
    if model.nv > _MAX_DOF:  # `check_description` reports that
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
