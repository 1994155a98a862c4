"""Pendulums of point masses on rods, with springs in their hinges, and their equations of motion."""

from __future__ import annotations

from typing import Any

import numpy as np

import softrobots as sr
from softrobots.core.checks import FloatArray

LENGTH, MASS = 0.5, 0.3  # of each link of the pendulums


def pendulum(links: int, stiffness: float, springs: Any = None, **options: Any) -> sr.SoftModel:
    """Links with a point mass at the end of each, hinges about y with a spring; upright where all angles are zero."""
    parts = ['<robot name="pendulum"><link name="link_0"/>']
    for number in range(1, links + 1):
        parts.append(
            f'<link name="link_{number}"><inertial><origin xyz="0 0 {LENGTH}"/><mass value="{MASS}"/>'
            '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="hinge_{number}" type="revolute"><parent link="link_{number - 1}"/><child link="link_{number}"/>'
            f'<origin xyz="0 0 {LENGTH if number > 1 else 0}"/><axis xyz="0 1 0"/>'
            '<limit lower="-9" upper="9" effort="1" velocity="1"/><dynamics damping="0" friction="0"/></joint>'
        )
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="link_{links}"/><child link="tip"/>'
        f'<origin xyz="0 0 {LENGTH}"/></joint></robot>'
    )
    springs = springs or {f"hinge_{number}": stiffness for number in range(1, links + 1)}
    return sr.load_model("".join(parts), springs=springs, tip="tip", **options)


def double_pendulum(t: float, state: FloatArray, stiffness: float, gravity: float, push_tip: float = 0.0) -> FloatArray:
    """Two point masses on rods: Lagrange's equations in absolute angles from the vertical, upwards; a force along x."""
    first, second, rate_1, rate_2 = state
    difference = second - first
    mass = MASS * LENGTH**2 * np.array([[2.0, np.cos(difference)], [np.cos(difference), 1.0]])
    push = MASS * LENGTH**2 * np.sin(difference) * np.array([rate_2**2, -(rate_1**2)])
    weight = MASS * gravity * LENGTH * np.array([2.0 * np.sin(first), np.sin(second)])
    springs = stiffness * np.array([difference - first, -difference])
    pushed = push_tip * LENGTH * np.cos([first, second])
    return np.concatenate([[rate_1, rate_2], np.linalg.solve(mass, push + weight + springs + pushed)])


def tip_of(first: Any, second: Any) -> FloatArray:
    """Tip of the double pendulum at absolute angles, shape (..., 3)."""
    return LENGTH * np.stack([np.sin(first) + np.sin(second), 0.0 * first, np.cos(first) + np.cos(second)], axis=-1)
