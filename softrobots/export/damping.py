r"""Damping of exported joints: the robot's own, as given, a ratio, or as much as lets a simulation settle.

- "file": the numbers of the description, with which the robot moves here, too (`softrobots.dynamics.damping`).
- a number: the damping time :math:`\beta` [s] of a material, :math:`D = \beta K`.
- numbers by joint [N m s/rad or N s/m]; other springs keep theirs.
- "critical", to settle where statics is wanted: with the mass matrix `M` and the stiffness `K` of the elastic joints at rest,
  motors held, the modes have the frequencies `w` of `K v = w^2 M v`, the lowest is `w_1`, and

  .. math:: D = \frac{2}{w_1} K

  is diagonal and leaves the modes as they are. A mode of frequency `w` then follows `x'' + 2 (w^2 / w_1) x' + w^2 x = 0`, whose
  damping ratio is `w / w_1 >= 1`: the slowest mode is critically damped and decays like `e^{-w_1 t}`, no mode oscillates, and
  each decays at the rate `(w^2 - w \sqrt{w^2 - w_1^2}) / w_1 > w_1 / 2` or more.
- a damping ratio :math:`\zeta`, to vibrate as measured: that times the `D` of "critical", so that a mode has the ratio
  :math:`\zeta w / w_1`, the slowest one :math:`\zeta`. Under a load that bends the robot much, `damping = zeta /
  vibration_modes(model, equilibrium, damping_time=1.0).damping_ratios[0]` is the damping time for the slowest loaded mode.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, non_negative_number
from softrobots.core.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.urdf_tags import SpringTag
from softrobots.model.soft_model import SoftModel

DampingRule = str | float | Mapping[str, float]
"""What `damping` of an exporter may be."""

DAMPING = ("file", "critical")
"""Words for the damping of spring joints."""


class Damping(NamedTuple):
    """Where the damping of the spring joints comes from: a time, a ratio, numbers of joints, or else the description."""

    time: float | None = None
    """Damping over stiffness [s]."""
    ratio: float | None = None
    """Damping ratio of the slowest mode at rest [-]; 1 for "critical"."""
    joints: Mapping[str, float] = MappingProxyType({})
    """Damping by spring joint [N m s/rad or N s/m]."""

    @staticmethod
    def of(model: SoftModel, damping: Any, ratio: Any) -> Damping:
        """Return what the arguments `damping` and `damping_ratio` of an exporter say.

        Raises:
            ParameterError: If a number is negative or not finite, a word is unknown, or both are given.
            NameNotFound: If a named joint has no spring.
        """
        if ratio is not None:
            if damping != "file":
                raise ParameterError("damping_ratio", ratio, "left out with damping=")
            return Damping(ratio=non_negative_number("damping_ratio", ratio, "-"))
        if isinstance(damping, Mapping):
            for name in damping:
                if name not in model.spring_table:
                    raise NameNotFound("spring joint", str(name), model.spring_table)
            numbers = {f"damping[{name!r}]": value for name, value in damping.items()}
            values = (non_negative_number(name, value, "N m s/rad or N s/m") for name, value in numbers.items())
            return Damping(joints=dict(zip(damping, values, strict=True)))
        if not isinstance(damping, str):
            return Damping(time=non_negative_number("damping", damping, "s"))
        if damping not in DAMPING:
            words = " or ".join(map(repr, DAMPING))
            raise ParameterError("damping", damping, f"{words}, or a damping time [s], or a mapping {{joint: N m s/rad}}")
        return Damping(ratio=1.0 if damping == "critical" else None)

    def text(self, frequency: float | None) -> str:
        """Return the rule as text for the head of a file, with the lowest frequency `w_1` [rad/s] if it sets the damping."""
        if self.time is not None:
            return f"Damping of the springs is {self.time!r} s times their stiffness."
        if self.ratio is None or frequency is None:
            whose = f" but for {', '.join(self.joints)}" if self.joints else ""
            return f"Damping of the springs is that of the description{whose}."
        rest = f"with the lowest frequency at rest w1 = {frequency!r} rad/s (motors held, weightless)"
        if self.ratio == 1.0:
            return f"Damping of the springs is 2 k / w1, {rest}: the slowest mode is critically damped, no mode oscillates."
        return (
            f"Damping of the springs is 2 * {self.ratio!r} k / w1, {rest}: the slowest mode has the damping ratio "
            f"{self.ratio!r}, one of frequency w has w / w1 times as much."
        )


def mass_matrix(model: SoftModel, q_motors: FloatArray) -> FloatArray:
    """Return the mass matrix with relaxed springs, in the order of Pinocchio's velocities, shape (nv, nv) [kg m^2, kg m, kg].

    Raises:
        DescriptionError: If the robot has more joints than Pinocchio supports.
    """
    structure = model.structure
    joints = np.zeros(model.pinocchio.nv)
    joints[structure.motor_indices] = q_motors[: len(structure.motor_joints)]
    joints[structure.spring_indices] = structure.strain_springs.rest
    return model.data.mass_matrix(model.embed(joints))


def lowest_frequency(model: SoftModel, mass: FloatArray) -> float:
    """Return the lowest natural frequency `w_1` [rad/s] of the spring joints, motors held, without gravity.

    Raises:
        DescriptionError: If the springs move no mass.
    """
    springs = model.structure.spring_indices
    root = 1.0 / np.sqrt(model.structure.strain_springs.stiffness)
    slowest = np.linalg.eigvalsh(root[:, None] * mass[np.ix_(springs, springs)] * root)[-1]  # 1 / w^2
    if not slowest > 0.0:
        raise DescriptionError(
            f"the springs of {model.pinocchio.name} move no mass, so that no natural frequency exists; give its links mass"
        )
    return float(1.0 / np.sqrt(slowest))


def damped(tree: RigidTree, springs: Mapping[str, SpringTag], time: float | None, joints: Mapping[str, float]) -> RigidTree:
    """Return the robot with a damping time [s] at its spring joints, None for what they have, and the damping of others."""
    chosen = {} if time is None else {name: time * tag.stiffness for name, tag in springs.items()}
    chosen |= joints
    changed = (replace(joint, damping=chosen[joint.name]) if joint.name in chosen else joint for joint in tree.joints)
    return replace(tree, joints=tuple(changed))
