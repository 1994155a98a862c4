"""Robots in the surroundings that their files hold: MuJoCo and Drake press them on obstacles with the forces of our statics.

Oracles are the simulators' own contacts and distances, and levers by hand.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.export import export_model, to_json, to_mjcf, to_sdf
from studies.contact_forces.cases import CASES
from studies.contact_forces.comparison import SIMULATORS, compare
from studies.interop import drake_statics, mujoco_statics
from studies.interop.outcomes import Question
from tests.support.foreign import INERTIAL, joint

Tool = Callable[[str], ModuleType]

LENGTH, RADIUS, STIFFNESS, WALL = 0.5, 0.05, (40.0, 25.0), 0.15
PUSH = (0.0, 30.0, 0.0)
AT_ZERO = {"xyz": "0 0 0", "rpy": "0 0 0"}
LEVERS = (
    '<robot name="levers" xmlns:softrobots="urn:softrobots:urdf"><link name="base"/>'
    + joint("turn_1", "base", "rod_1", "0 0 1", **AT_ZERO)
    + joint("turn_2", "rod_1", "rod_2", "0 0 1", xyz=f"{LENGTH} 0 0", rpy="0 0 0")
    + '<joint name="end" type="fixed"><parent link="rod_2"/><child link="tip"/>'
    + f'<origin xyz="{LENGTH} 0 0"/></joint><link name="tip">{INERTIAL}</link>'
    + "".join(
        f'<softrobots:capsule link="rod_{number}" start="0 0 0" end="{LENGTH} 0 0" radius="{RADIUS}"/>' for number in (1, 2)
    )
    + "</robot>"
)
"""Two rods on hinges with springs, which turn about z; a force pushes the end on a wall at y = WALL."""
SKID = (
    '<robot name="skid" xmlns:softrobots="urn:softrobots:urdf"><link name="base"/>'
    + joint("rise", "base", "carrier", "0 0 1", "prismatic", **AT_ZERO)
    + joint("slide", "carrier", "runner", "1 0 0", "prismatic", **AT_ZERO)
    + f'<joint name="end" type="fixed"><parent link="runner"/><child link="tip"/></joint><link name="tip">{INERTIAL}</link>'
    + f'<softrobots:capsule link="runner" start="0 0 0" end="0 0 0" radius="{RADIUS}"/></robot>'
)
"""A ball on two slides with springs, whose weight and a force press it on the floor."""


def levers() -> sr.SoftModel:
    return sr.load_model(LEVERS, springs={"turn_1": STIFFNESS[0], "turn_2": STIFFNESS[1]}, tip="tip")


def by_hand() -> tuple[np.ndarray, float]:
    """Angles of the levers [rad] and the force of the wall [N]: two springs and one multiplier."""

    def balance(unknown: np.ndarray) -> list[float]:
        first, second, force = unknown
        both, push = first + second, PUSH[1] - force
        end = LENGTH * np.cos(both)
        return [
            STIFFNESS[0] * first - push * (LENGTH * np.cos(first) + end),
            STIFFNESS[1] * second - push * end,
            LENGTH * (np.sin(first) + np.sin(both)) + RADIUS - WALL,
        ]

    found = root(balance, (0.1, 0.1, 10.0), tol=1e-13)
    assert found.success
    return found.x[:2], float(found.x[2])


def asked(simulator: str, model: sr.SoftModel, force: tuple[float, float, float], seconds: float, **options: Any) -> Any:
    """Where a simulator settles."""
    if simulator == "MuJoCo":
        text = to_mjcf(model, damping="critical", gravity=sr.EARTH_GRAVITY, **options)
        return mujoco_statics.simulate(Question(text, "tip", force, sr.EARTH_GRAVITY), seconds)
    text = to_sdf(model, damping="critical", **options)
    return drake_statics.simulate(Question(text, "tip", force, sr.EARTH_GRAVITY), seconds)


@pytest.mark.parametrize(
    ("simulator", "module"), [("MuJoCo", "mujoco"), pytest.param("Drake", "pydrake", marks=pytest.mark.study)]
)
def test_two_levers_press_on_a_wall_as_by_hand(tool: Tool, simulator: str, module: str) -> None:
    """1e-5: MuJoCo gives way by 0.1 um for such masses, and Drake by 0.3 um, of the 6 mm that the wall holds back."""
    tool(module)
    wall = sr.Environment([sr.HalfSpace((0, -1, 0), -WALL, name="wall")])
    found = asked(simulator, levers(), PUSH, 4.0, environment=wall)
    angles, force = by_hand()
    assert found.speed < 1e-8
    assert set(found.forces) == {"wall"}
    assert np.abs(found.forces["wall"] - (0.0, -force, 0.0)).max() < 1e-4 * force
    assert np.abs(np.array([found.joints["turn_1"], found.joints["turn_2"]]) - angles).max() < 1e-5
