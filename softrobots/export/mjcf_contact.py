r"""Shapes and contact in MJCF: obstacles as geoms of the world, who collides with whom, and how stiff contact is.

MuJoCo has no rigid contact. At rest, the normal force `f` of a contact presses the shapes into each other by

.. math:: \delta = (1 - d)\, T^2 f / m

(MuJoCo's documentation, "Solver parameters", with no acceleration), with the impedance `d`, the time constant `T` of `solref`,
and the mass `m` that MuJoCo finds behind the contact in the unbent robot. `T` is two of MuJoCo's default time steps `h`, the
least that it allows, and `d` its largest: some 0.03 micrometres for 5 N on the last link of an inflatable arm.

MuJoCo computes contact forces with the masses alone, and moves the joints by the masses and `h D`, with the dampings `D` of the
springs. Where `h D` is larger than the masses, as in chains of light links, contacts then chatter and never rest (we found so
below an armature of `h D`). So the springs have the armature `2 h D`, which changes no equilibrium, and slows a mode of the
frequency `w` that the springs damp by :math:`\beta K` by the fraction :math:`h \beta w^2`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np

from softrobots.description.rigid_tree import Placement, Shape, number_text
from softrobots.export.contact_shapes import ContactShapes

_IMPEDANCE, _TIME_STEP = 0.9999, 0.002  # [-], [s]
_TIME_CONSTANT = 2.0 * _TIME_STEP
_OBSTACLES, _ROBOT = 1, 2  # bits of MuJoCo's contype and conaffinity

SOFTNESS = (
    f"Contact is as hard as it is stable with time steps of {1e3 * _TIME_STEP:g} ms or less: with the force f and the mass m "
    f"behind it, it gives way by {(1.0 - _IMPEDANCE) * _TIME_CONSTANT**2:.2g} s^2 f/m. The armature of the springs keeps it "
    "from chattering, and changes no equilibrium."
)
"""How stiff contact is, for the head of the file."""


def write_contact_defaults(root: ElementTree.Element, option: ElementTree.Element, friction: float) -> None:
    """Make contact hard and exact, with a coefficient of friction."""
    contact = {
        "solref": number_text((_TIME_CONSTANT, 1.0)),
        "solimp": number_text((_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0)),
        "condim": "1",
    }
    option.set("tolerance", "1e-14")  # of the solver; with that of 1e-8, light robots never rest
    if friction:
        contact |= {"condim": "3", "friction": number_text((friction, 0.0, 0.0))}
        option.attrib |= {"cone": "elliptic", "impratio": "100.0"}  # Coulomb's cone; sticking contacts hardly creep
    ElementTree.SubElement(ElementTree.SubElement(root, "default"), "geom", contact)


def capsule_bits(contact: ContactShapes) -> dict[str, str]:
    """Return the attributes by which a capsule of the robot touches obstacles, and other capsules if they are to."""
    among = 0 if contact.apart is None else _ROBOT
    return {"contype": str(among), "conaffinity": str(_OBSTACLES | among)}


def steadying_armature(damping: float, time_step: float = _TIME_STEP) -> float:
    """Return the armature of a joint with a damping [N m s/rad or N s/m] with which contacts rest, for a time step [s]."""
    return 2.0 * time_step * damping


def write_obstacles(world: ElementTree.Element, assets: ElementTree.Element, contact: ContactShapes) -> None:
    """Write the obstacles as geoms of the world with their names; corners of meshes stand in the file."""
    for name, shape in contact.obstacles.items():
        measure = solid_size(shape)
        if name in contact.meshes:
            measure = {"mesh": f"obstacle/{name}"}  # the name of no file
            corners = number_text(contact.meshes[name].vertices.ravel())
            ElementTree.SubElement(assets, "mesh", {"name": measure["mesh"], "vertex": corners})
        attributes = {"name": name, "type": shape.kind, **measure, **where(shape.placement)}
        bits = {"contype": str(_OBSTACLES), "conaffinity": "0"}
        ElementTree.SubElement(world, "geom", attributes | {"rgba": number_text(shape.rgba or ())} | bits)


def solid_size(shape: Shape) -> dict[str, str]:
    """Return the size of a shape that is no mesh; MuJoCo takes half lengths, and a spacing for the picture of a plane."""
    if shape.kind == "plane":
        return {"size": "0.0 0.0 0.1"}
    halves = (0.5, 0.5, 0.5) if shape.kind == "box" else (1.0, 0.5)
    return {"size": number_text(half * size for half, size in zip(halves, shape.size, strict=False))}


def where(placement: Placement) -> dict[str, str]:
    """Return position and rotation, left out where they are none."""
    attributes = {"pos": number_text(placement.position)} if np.any(placement.position) else {}
    if np.any(placement.rotation != np.eye(3)):
        attributes["quat"] = number_text(placement.quaternion)
    return attributes
