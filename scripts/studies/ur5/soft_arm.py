"""A soft arm on the flange of a UR5: its description, and the compensation of its sag by the joints of the UR5."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import softrobots as sr
from softrobots.core.checks import FloatArray, finite_array, positive_number, read_only
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from studies.shared.held_motors import with_motors_held

PAYLOAD = {"inflatable_arm": 1.0, "helix_tube": 0.001, "pcc_arm": 0.05}
"""Payload of each arm, well below wrinkling [kg]."""
SoftArm = sr.InflatableArm | sr.HelixTube | sr.PccArm
"""What can be carried."""


class Load(NamedTuple):
    """Gravity, and the payload as the force that it is."""

    payload: float
    """Mass at the tip [kg]."""
    gravity: FloatArray
    """Shape (3,) [m/s^2]."""

    @property
    def force(self) -> FloatArray:
        """Weight of the payload, shape (3,) [N]."""
        return self.payload * self.gravity


def soft_arm(arguments: argparse.Namespace) -> tuple[SoftArm, dict[str, float]]:
    """The soft arm, and the positions at which its own motors are held."""
    name, pressure = arguments.robot, {} if arguments.pressure is None else {"pressure": arguments.pressure}
    if name != "inflatable_arm" and arguments.arm_angles is not None:
        raise sr.ParameterError("--arm-angles", arguments.arm_angles, f"left out with --robot {name}, which has no motors")
    if name != "pcc_arm" and pressure:
        positive_number("--pressure", arguments.pressure, "Pa")  # without it there is no wrinkling margin
    if name == "pcc_arm":
        if pressure:
            raise sr.ParameterError("--pressure", arguments.pressure, "left out with --robot pcc_arm, which is not inflated")
        return sr.PccArm(muscle_azimuths=()), {}
    if name == "helix_tube":
        return sr.HelixTube(**pressure), {}
    arm, angles = sr.InflatableArm(**pressure), arguments.arm_angles or (0.0, math.pi / 2, 0.0)
    within_limits("--arm-angles", angles, np.array([[-arm.motor_limit, arm.motor_limit]] * 3))
    return arm, {f"motor_{i + 1}": float(angle) for i, angle in enumerate(angles)}


def within_limits(option: str, angles: Sequence[float], limits: FloatArray) -> None:
    """Refuse angles that are not finite or beyond limits, shape (n, 2) [rad]."""
    checked = finite_array(option, angles, (len(limits),), "rad")
    if np.any((checked < limits[:, 0]) | (checked > limits[:, 1])):
        text = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in limits)
        raise sr.ParameterError(option, list(angles), f"within the limits of the joints, {text} rad")


def mounted(ur5: Path, arm: SoftArm, held: dict[str, float]) -> str:
    """URDF of the UR5 with the arm on its flange, the motors of the arm held; the foot of the arm stands on the flange."""
    text = with_motors_held(arm.urdf(), held)
    foot = read_rigid_tree(text).body("base_link").visuals[0]  # a cylinder along z below the origin of the arm
    height = foot.size[1] / 2.0 - float(foot.placement.position[2])
    return sr.mount(ur5, "tool0", text, xyz=(0.0, 0.0, height))


def compensate(
    model: sr.SoftModel, arguments: argparse.Namespace, load: Load, rigid: sr.Equilibrium
) -> tuple[sr.Trajectory, sr.Trajectory]:
    """Bring the loaded tip back to where it is without load; the way there is even in the joints of the UR5."""
    solution = sr.solve_ik(
        model, rigid.tip_position, load.force, gravity=load.gravity, q_motors0=rigid.q_motors, starts=4,
        orientation=np.array(rigid.transform_tip_to_world.rotation) if arguments.keep_orientation else None,
    )  # fmt: skip
    shares = np.linspace(0.0, 1.0, arguments.steps + 1)
    way = rigid.q_motors + sr.quintic(shares)[:, None] * (solution.q_motors - rigid.q_motors)
    way[-1] = solution.q_motors
    targets = read_only(np.tile(rigid.tip_position, (len(way), 1)))
    times = read_only(arguments.duration * shares)
    after = settled(model, way, load, times, targets, "compensation")
    return settled(model, way[:1], load, times[:1], targets[:1], "uncompensated"), after


def follow_line(
    model: sr.SoftModel, arguments: argparse.Namespace, load: Load, rigid: sr.Equilibrium
) -> tuple[sr.Trajectory, sr.Trajectory]:
    """Move the loaded tip from where it is without load along a line; beside it what rigid inverse kinematics would do."""
    path = sr.straight_line(rigid.tip_position, arguments.to, arguments.duration, arguments.steps)

    def follow(label: str, force: object, gravity: object) -> sr.Trajectory:
        return sr.follow_trajectory(
            model, path.positions, force, gravity=gravity, q_motors0=rigid.q_motors, times=path.times, progress=label
        )

    after = follow("compensated", load.force, load.gravity)
    unloaded = follow("rigid", None, None)
    return settled(model, unloaded.q_motors, load, path.times, path.positions, "rigid"), after


def settled(
    model: sr.SoftModel, motors: FloatArray, load: Load, times: FloatArray, targets: FloatArray, label: str
) -> sr.Trajectory:
    """The loaded robot at given joint angles."""
    equilibria = tuple(sr.solve_equilibrium(model, q, load.force, gravity=load.gravity) for q in motors)
    return sr.Trajectory(times, targets, equilibria, label)
