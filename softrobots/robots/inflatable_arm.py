"""The inflatable arm of [Troise 2021]."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from softrobots import inflated_beam
from softrobots.core.errors import ParameterError
from softrobots.robots.fields import PerPart, XacroRobot, check_parameters, numbers, parameter, per_part


@dataclass(frozen=True, kw_only=True)
class InflatableArm(XacroRobot):
    """The inflatable arm of [Troise 2021]: N inflated links, N + 1 motors, two springs a link; on demand a wrist.

    The wrist has three more motors whose axes meet in one point, base to tip: pitch about -y, yaw about +z, roll about +x, the
    axis of the hand. It is regular when straight, and singular at a yaw of a quarter turn, where pitch and roll turn about
    parallel axes.

    Every per-link field accepts one number for all links or one for each, and is stored as a tuple with one number a link.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    link_lengths: Sequence[float] = per_part(
        (0.6, 0.6),
        "m",
        "Lengths of the links, base to tip; their number is the number of links",
        "Troise 2021, section 3 (0.600)",
        above=0.0,
    )
    hinge_offset: PerPart = per_part(
        0.03,
        "m",
        "Distance of the two springs of a link from its motor, l1; below the length of the link",
        "Troise 2021, section 4 (first wrinkle at 0.030)",
        above=0.0,
    )
    radius: PerPart = per_part(0.055, "m", "Radius of a link", "Troise 2021, section 3 (0.055)", above=0.0)
    wall_thickness: PerPart = per_part(
        0.0005, "m", "Wall thickness of a link, at most a tenth of the radius", "Troise 2021, section 3 (0.0005)", above=0.0
    )
    stiffness: PerPart = per_part(
        inflated_beam.MEAN_STIFFNESS,
        "N m/rad",
        "Stiffness of each of the two springs of a link",
        "Troise 2021, section 4 (mean of Table 3, 172.71)",
        above=0.0,
    )
    rest_side: PerPart = per_part(
        0.0,
        "rad",
        "Angle at which the sideways spring is relaxed",
        "Troise 2021, equation 2 (0: the link is straight at rest)",
        at_least=-math.pi / 2,
        at_most=math.pi / 2,
    )
    rest_up: PerPart = per_part(
        0.0,
        "rad",
        "Angle at which the upward spring is relaxed",
        "Troise 2021, equation 2 (0: the link is straight at rest)",
        at_least=-math.pi / 2,
        at_most=math.pi / 2,
    )
    pressure: PerPart = per_part(
        50e3,
        "Pa",
        "Gauge pressure in a link; sets the wrinkling moment",
        "Troise 2021, section 4 (50 kPa for the paper's example)",
        at_least=0.0,
    )
    max_moment: PerPart | None = per_part(
        None,
        "N m",
        "Largest moment of a link, in any direction, beyond wrinkling; without it, springs are linear",
        "Troise 2021, section 4",
        above=0.0,
    )
    density: PerPart = per_part(1300.0, "kg/m^3", "Density of the wall", "assumed, PVC-coated fabric; not published", above=0.0)
    cap_mass: PerPart = per_part(
        0.1,
        "kg",
        "Mass of one end cap; a link has two",
        "assumed; not published. The gas is neglected (about 10 g a link)",
        at_least=0.0,
    )
    rgba: Sequence[float] | Sequence[Sequence[float]] = parameter(
        (0.95, 0.62, 0.22, 1.0), "", "Colour of a link: red, green, blue, opacity in 0 to 1", form="colour"
    )
    spring_damping: PerPart = per_part(
        1.0, "N m s/rad", "Damping of each spring joint, for simulators only", "assumed", at_least=0.0
    )
    motor_limit: float = parameter(
        math.pi, "rad", "Motors turn between minus and plus this angle", "assumed, half a turn each way", above=0.0
    )
    motor_effort: float = parameter(50.0, "N m", "Largest torque of a motor", "assumed; above the paper's 17.51 N m", above=0.0)
    motor_velocity: float = parameter(2.0, "rad/s", "Largest speed of a motor", "assumed", above=0.0)
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
    wrist_mass: float = parameter(0.3, "kg", "Mass of the wrist, spread evenly over its lengths", "assumed", above=0.0)
    wrist_limits: Sequence[float] = parameter(
        (2.0, 2.0, math.pi),
        "rad",
        "Pitch, yaw and roll of the wrist turn between minus and plus these angles",
        "assumed",
        above=0.0,
        form="special",
    )

    XACRO = "inflatable_arm.urdf.xacro"

    def __post_init__(self) -> None:
        """Check every field and repeat single numbers for all links."""
        check_parameters(self, "links", "link_lengths")
        lengths = self._each("link_lengths")
        for offset, length in zip(self._each("hinge_offset"), lengths, strict=True):
            if offset >= length:
                raise ParameterError("hinge_offset", self.hinge_offset, f"below the link lengths {lengths} m")
        for radius, wall in zip(self._each("radius"), self._each("wall_thickness"), strict=True):
            if wall > 0.1 * radius:
                raise ParameterError("wall_thickness", self.wall_thickness, f"thin: at most a tenth of the radius {radius} m")
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

    @property
    def n_links(self) -> int:
        """Number of links."""
        return len(self.link_lengths)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain."""
        return 3 * self.n_links + (1 if self.wrist is None else 4)

    @property
    def volume(self) -> float:
        """Volume of all links together [m^3]."""
        return float(inflated_beam.volume(self.link_lengths, self._each("radius")).sum())

    def tank_volume(self, tank_pressure: float, *, ambient_pressure: float = 0.0) -> float:
        """Volume of the tank that inflates the whole arm once, isothermally [m^3]; see `inflated_beam.tank_volume`.

        A tank serves all links at once, so they must have the same pressure.

        Args:
            tank_pressure: Gauge pressure of the full tank [Pa].
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

        Raises:
            ParameterError: If the links differ in pressure or a pressure is out of range.
        """
        return float(
            inflated_beam.tank_volume(self.volume, self._one_pressure(), tank_pressure, ambient_pressure=ambient_pressure)
        )

    def tank_pressure(self, tank_volume: float, *, ambient_pressure: float = 0.0) -> float:
        """Gauge pressure of a full tank that inflates the whole arm once [Pa]; see `inflated_beam.tank_pressure`.

        Args:
            tank_volume: Volume of the tank [m^3].
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

        Raises:
            ParameterError: If the links differ in pressure or a value is out of range.
        """
        return float(
            inflated_beam.tank_pressure(self.volume, self._one_pressure(), tank_volume, ambient_pressure=ambient_pressure)
        )

    def _one_pressure(self) -> float:
        pressures = self._each("pressure")
        if len(set(pressures)) != 1:
            raise ParameterError("pressure", pressures, "the same in all links to be filled from one tank")
        return float(pressures[0])
