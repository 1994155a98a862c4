"""Forces in a robot by free bodies: what is beyond a cut, with its loads and its weight; from names and masses of the file."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

import softrobots as sr


def axes(robot: sr.SoftModel, state: sr.Equilibrium, link: str) -> np.ndarray:
    """Axes of a link in the world, shape (3, 3)."""
    data = robot.pinocchio.createData()
    pin.framesForwardKinematics(robot.pinocchio, data, state.q)
    return np.array(data.oMf[robot.frame_id(link)].rotation)


def bisector(robot: sr.SoftModel, state: sr.Equilibrium, link: int, before: str = "root", behind: str = "") -> np.ndarray:
    """Direction halfway between the x axes of the pieces of a link of the inflatable arm, shape (3,)."""
    pieces = [axes(robot, state, "_".join(filter(None, (f"link_{link}", piece))))[:, 0] for piece in (before, behind)]
    return (pieces[0] + pieces[1]) / np.linalg.norm(pieces[0] + pieces[1])


def bodies_beyond(urdf: str, first: str) -> set[str]:
    """Names of the link `first` and all links beyond it."""
    children: dict[str, list[str]] = {}
    for joint in ElementTree.fromstring(urdf).findall("joint"):
        children.setdefault(joint.find("parent").get("link"), []).append(joint.find("child").get("link"))
    found, pending = set(), [first]
    while pending:
        found.add(name := pending.pop())
        pending += children.get(name, [])
    return found


def force_beyond(urdf: str, first: str, wrenches: Mapping[str, Sequence[float]], gravity: Any = None) -> np.ndarray:
    """Sum of the forces on a link and all beyond it, and of their weight, shape (3,) [N]."""
    beyond = bodies_beyond(urdf, first)
    force = sum((np.array(wrench[:3], dtype=float) for name, wrench in wrenches.items() if name in beyond), np.zeros(3))
    if gravity is not None:
        links = {link.get("name"): link for link in ElementTree.fromstring(urdf).findall("link")}
        masses = [links[name].find("inertial/mass") for name in beyond]
        force += np.array(gravity) * sum(float(mass.get("value")) for mass in masses if mass is not None)
    return force
