"""What a robot touches, in figures of loaded robots: obstacles, contact points and their forces."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.environment import Environment
from softrobots.statics.equilibrium import Equilibrium
from softrobots.view.appearance import CONTACT_COLOUR, OBSTACLE_COLOUR
from softrobots.view.figures.canvas import plain_words
from softrobots.view.legend import contact_entries
from softrobots.view.mesh_triangles import triangles
from softrobots.view.surroundings import drawn_contacts, drawn_obstacles

_SHEET = 0.5  # side of the sheet that stands for a half-space, of the reach
_ARROW = 0.2  # length of the largest arrow, of the reach


def draw_surroundings(axes: Any, equilibrium: Equilibrium, around: FloatArray) -> FloatArray:
    """Draw obstacles, contact points, and the force at each as an arrow that ends there.

    Args:
        axes: Matplotlib's axes in space.
        equilibrium: The robot that is drawn.
        around: Points of the robot, shape (n, 3) [m].

    Returns:
        Points for `equal_box`, shape (m, 3) [m]: arrows, and the obstacles that are not larger than the robot.
    """
    contacts, seen = drawn_contacts(equilibrium), [np.zeros((0, 3))]
    for number, surrounding in enumerate(equilibrium.load.environment or ()):
        touched = [contact.point for contact in contacts.values() if contact.obstacle == surrounding.name]
        centre = np.mean(touched or around, axis=0)  # of the sheet that stands for a half-space
        (obstacle,) = drawn_obstacles(Environment([surrounding]), centre, _SHEET * equilibrium.model.reach)
        corners, faces, _ = triangles(obstacle.geometry)
        placed = corners @ obstacle.pose[:3, :3].T + obstacle.pose[:3, 3]
        look = {"color": OBSTACLE_COLOUR[:3], "alpha": OBSTACLE_COLOUR[3], "lw": 0.0, "shade": True}
        axes.plot_trisurf(*placed.T, triangles=faces, label="" if number else "obstacle", **look)
        if np.ptp(placed, axis=0).max() <= equilibrium.model.reach:
            seen.append(placed)
    largest = max((float(np.linalg.norm(one.force)) for one in contacts.values()), default=0.0)
    colour = f"#{CONTACT_COLOUR:06x}"
    for one in contacts.values():
        axes.plot(*one.point[:, None], ls="", marker="o", ms=5, color=colour)
        if largest > 0.0:
            arrow = _ARROW * equilibrium.model.reach / largest * one.force
            axes.quiver(*(one.point - arrow), *arrow, color=colour, lw=2.0)
            seen.append((one.point - arrow)[None])
    for entry in contact_entries([contacts]):
        axes.plot([], [], ls="", marker="o", ms=5, color=colour, label=plain_words(entry.meaning))
    return np.concatenate(seen)
