"""The arm with nominal parameters, and the tips that it predicts: one equilibrium a row.

What is published is taken as published, what is not is assumed; nothing is fitted here. Published, in the source's
configuration `configs/generation/ftdcr_v4_sysid.json`: lengths, backbone, distance of the tendons, stiffness of a tendon with
its motor (7 N/mm), no weight, and the turns of the segments about the backbone (the source's fit to these recordings).
Assumed: a pretension of 1 N in each tendon.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import EquilibriumNotFound
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import TendonArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from studies.measured_arm.recordings import Recording

TURNS = (-3.0589, -2.5615, -2.0506)
"""Azimuth of the first tendon of each segment from the x axis of the base, the source's `seg_offsets` [rad]."""
STIFFNESS = 7000.0
"""Stiffness of a tendon with its motor, the source's `tendon_kp` [N/m]."""
PRETENSION = 1.0
"""Assumed tension of each tendon at zero commands [N]."""
MARKER = 0.008
"""Height of a marker above the tip, the source's `marker_transform` [m]; the nominal one stands on the tip."""
WEIGHTS: Mapping[str, tuple[float, float, float] | None] = {
    "none": None,
    "hanging": (0.0, 0.0, -EARTH_GRAVITY[2]),
    "standing": EARTH_GRAVITY,
}
"""Gravity in the frame of the base, whose z axis points to the tip, by how the arm is mounted [m/s^2]."""


class Nominal(NamedTuple):
    """What is assumed of the robot."""

    stiffness: float = STIFFNESS
    """Stiffness of a tendon with its motor [N/m]."""
    pretension: float = PRETENSION
    """Tension of each tendon at zero commands [N]."""
    weight: str = "none"
    """One of `WEIGHTS`."""
    mass: float = 0.05
    """Mass of the whole arm [kg]."""
    marker: float = 0.0
    """How far beyond the tip the marker stands [m]."""
    young_modulus: float = 50e9
    """Modulus of the backbone [Pa]."""
    axial_share: float = 1.0
    """Axial stiffness as a share of that of the backbone [-]."""
    turns: tuple[float, float, float] = TURNS
    """Azimuth of the first tendon of each segment [rad]."""
    sections: int = 4
    """Sections of constant strain a segment."""

    def robot(self) -> TendonArm:
        """The robot."""
        plain = TendonArm()
        area = math.pi * np.max(plain.backbone_radius) ** 2
        return TendonArm(
            offset=np.diff(self.turns, prepend=0.0).tolist(),
            linear_density=self.mass / sum(plain.segment_lengths),
            tendon_stiffness=self.stiffness,
            tendon_pretension=self.pretension,
            young_modulus=self.young_modulus,
            axial_stiffness=float(self.axial_share * self.young_modulus * area),
            elastic_sections=self.sections,
        )


class Predicted(NamedTuple):
    """Tips of a recording's commands in the frame of the base, and what is known of the equilibria."""

    tips: FloatArray
    """Shape (n, 3) [m]."""
    tensions: FloatArray
    """Shape (n, 9) [N]."""
    stable: FloatArray
    """Whether each equilibrium is certified as stable, shape (n,), 0 or 1."""

    def counts(self) -> dict[str, int]:
        """How many rows have an equilibrium, how many are stable, and with how many slack tendons in the mean row."""
        return {
            "equilibria": len(self.tips),
            "stable": int(self.stable.sum()),
            "tendons": int(self.tensions.size),
            "slack_tendons": int((self.tensions <= 0.0).sum()),
        }


Bar = Callable[[Iterable[Any], str], Iterable[Any]]
"""Shows the progress of an iterable under a label."""


def silent(steps: Iterable[Any], label: str) -> Iterable[Any]:
    """Shows nothing."""
    return steps


def predict(recording: Recording, nominal: Nominal, bar: Bar = silent, label: str = "") -> Predicted:
    """Find the equilibrium of each row, from that of the row before on.

    Args:
        recording: The commands.
        nominal: The robot.
        bar: What shows the progress.
        label: What it says.

    Returns:
        The tips.

    Raises:
        EquilibriumNotFound: If a row has none; the message tells which.
    """
    model = load_model(nominal.robot())
    start, found = None, []
    for number, motors in enumerate(bar(motor_lengths(model, recording.pulls), label)):
        try:
            one = solve_equilibrium(model, motors, gravity=WEIGHTS[nominal.weight], q_springs0=start)
        except EquilibriumNotFound as error:
            message = f"row {number + 1} of {recording.name} ({recording.patterns[number]}): {error}"
            raise EquilibriumNotFound(message, best=error.best, residual=error.residual, iterations=error.iterations) from error
        start = one.q_springs
        axis = np.array(one.transform_tip_to_world.rotation)[:, 2]
        found.append((one.tip_position + nominal.marker * axis, one.muscle_forces, one.stable))
    tips, tensions, stable = (np.array(part, dtype=float) for part in zip(*found, strict=True))
    return Predicted(tips, tensions, stable)


def motor_lengths(model: SoftModel, pulls: FloatArray) -> FloatArray:
    """Motor coordinates of commands: the rest length of each tendon less what its motor has pulled in.

    Args:
        model: The robot; its tendons are in the order of the columns of the commands, by segment.
        pulls: Shape (n, 9) [m].

    Returns:
        Shape (n, 9) [m].
    """
    return np.asarray([tag.rest_length for tag in model.muscles] - pulls)
