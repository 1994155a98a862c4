"""The inflatable arm of [Troise 2021]."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.robots.field_values import numbers
from softrobots.robots.fields import PerPart, parameter, per_part, refuse_given
from softrobots.robots.inflated_links import InflatedLinks


@dataclass(frozen=True, kw_only=True)
class InflatableArm(InflatedLinks):
    """The inflatable arm of [Troise 2021]: N inflated links, N + 1 motors, two springs a link; on demand a wrist.

    The wrist has three more motors whose axes meet in one point, base to tip: pitch about -y, yaw about +z, roll about +x, the
    axis of the hand. It is regular when straight, and singular at a yaw of a quarter turn, where pitch and roll turn about
    parallel axes.

    With ``link_model="two_hinges"`` a link has four springs, two at each of two hinges, and with ``torsion=True`` a fifth that
    twists it: it then bends, shears and twists as a beam does.

    Every per-link field accepts one number for all links or one for each, and is stored as a tuple with one number a link.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    rgba: Sequence[float] | Sequence[Sequence[float]] = parameter(
        (0.95, 0.62, 0.22, 1.0), "", "Colour of a link: red, green, blue, opacity in 0 to 1", form="colour"
    )
    spring_damping: PerPart = per_part(
        1.0, "N m s/rad", "Damping of each spring joint; has no effect on the statics", "assumed", at_least=0.0
    )
    damping_time: PerPart | None = per_part(
        None,
        "s",
        "Damping of each spring joint over its stiffness, in place of spring_damping; the decay of a vibration tells it, "
        "damping_time_from_decrement",
        at_least=0.0,
    )
    motor_limit: float = parameter(
        math.pi, "rad", "Motors turn between minus and plus this angle", "assumed, half a turn each way", above=0.0
    )
    motor_effort: float = parameter(50.0, "N m", "Largest torque of a motor", "assumed; above the paper's 17.51 N m", above=0.0)
    motor_velocity: float = parameter(2.0, "rad/s", "Largest speed of a motor", "assumed", above=0.0)
    rotor_inertia: float = parameter(
        0.0,
        "kg m^2",
        "Inertia of the rotor of each motor at its joint: its own times the square of the gear ratio",
        "assumed; has no effect on the statics",
        at_least=0.0,
    )
    base_mass: float = parameter(
        2.0, "kg", "Mass of the base, fixed to the world", "assumed; has no effect on the statics", above=1e-6
    )
    wrist: Sequence[float] | None = parameter(
        None,
        "m",
        "Lengths of a wrist of three motors: from the end of the last link to its centre, and from there to the tip; "
        "without it, the tip is the end of the last link",
        "Troise 2021, section 1 (the arm places a 3-dof wrist; its lengths are not published)",
        at_least=0.0,
        form="special",
    )
    wrist_mass: float = parameter(
        0.3, "kg", "Mass of the wrist, spread evenly over its lengths; of no effect without", "assumed", above=0.0
    )
    wrist_limits: Sequence[float] = parameter(
        (2.0, 2.0, math.pi),
        "rad",
        "Pitch, yaw and roll of the wrist turn between minus and plus these angles; of no effect without",
        "assumed",
        above=0.0,
        form="special",
    )
    payload: float | Sequence[float] | None = parameter(
        None,
        "kg, m",
        "Load on the tip: its mass, or mass, x, y, z with its place in the frame of the tip; a ball of 2700 kg/m^3",
        form="special",
    )

    XACRO = "inflatable_arm.urdf.xacro"

    def __post_init__(self) -> None:
        """Check every field and repeat single numbers for all links."""
        super().__post_init__()
        if self.wrist is not None:
            lengths = numbers("wrist", self.wrist, None, "m")
            if len(lengths) != 2 or lengths[0] < 0.0 or lengths[1] <= 0.0:
                requirement = "two lengths: to the wrist centre, at least 0, and from there to the tip, above 0 [m]; or None"
                raise ParameterError("wrist", self.wrist, requirement)
            object.__setattr__(self, "wrist", lengths)
        limits = numbers("wrist_limits", self.wrist_limits, 3, "rad", "motors of the wrist")
        if min(limits) <= 0.0:
            raise ParameterError("wrist_limits", self.wrist_limits, "above 0 [rad]")
        object.__setattr__(self, "wrist_limits", limits)
        if self.wrist is None:
            refuse_given(self, ("wrist_mass", "wrist_limits"), "without a wrist")
        if self.damping_time is not None:
            refuse_given(self, ("spring_damping",), "where damping_time is given")
        if self.payload is not None:
            object.__setattr__(self, "payload", self._checked_payload(self.payload))

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain."""
        return (1 + self.springs_per_link) * self.n_links + (1 if self.wrist is None else 4)

    def _checked_payload(self, value: Any) -> tuple[float, ...]:
        single = not isinstance(value, str) and np.ndim(value) == 0
        payload = (*numbers("payload", value, 1, "kg"), 0.0, 0.0, 0.0) if single else numbers("payload", value, None, "kg, m")
        if len(payload) != 4 or payload[0] <= 1e-6:
            raise ParameterError(
                "payload", value, "a mass above 1e-6, or mass, x, y, z of it in the frame of the tip [kg, m]; or None"
            )
        return payload
