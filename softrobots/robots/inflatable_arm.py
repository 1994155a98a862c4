"""The inflatable arm of [Troise 2021]: its parameters, checked, as xacro arguments and URDF text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from softrobots import inflated_beam
from softrobots.core.errors import ParameterError
from softrobots.robots.parameters import Bounds, PerPart, check_fields, check_lengths, colours, expanded, xacro_arguments


@dataclass(frozen=True, kw_only=True)
class InflatableArm:
    """The inflatable arm of [Troise 2021]: N inflated links, N + 1 motors, two springs a link.

    Every per-link field accepts one number for all links or one for each, and is stored as a tuple with one number a link.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    link_lengths: Sequence[float] = (0.6, 0.6)
    """Lengths of the links, base to tip; their number is the number of links [m]. Troise 2021, section 3."""
    hinge_offset: PerPart = 0.03
    """Distance of the two springs of a link from its motor, `l1` [m], below the length. Troise 2021, section 4."""
    radius: PerPart = 0.055
    """Radius of a link [m]. Troise 2021, section 3."""
    wall_thickness: PerPart = 0.0005
    """Wall thickness of a link [m]. Troise 2021, section 3."""
    stiffness: PerPart = inflated_beam.MEAN_STIFFNESS
    """Stiffness of each of the two springs of a link [N m/rad]. Troise 2021, section 4."""
    rest_side: PerPart = 0.0
    """Angle at which the sideways spring is relaxed [rad], within +-pi/2."""
    rest_up: PerPart = 0.0
    """Angle at which the upward spring is relaxed [rad], within +-pi/2."""
    pressure: PerPart = 50e3
    """Gauge pressure in a link; sets the wrinkling moment [Pa]. Troise 2021, section 4."""
    max_moment: PerPart | None = None
    """Largest moment of a link, in any direction, beyond wrinkling [N m]; None: springs are linear. Troise 2021, section 4."""
    density: PerPart = 1300.0
    """Density of the wall [kg/m^3]. Assumed (PVC-coated fabric)."""
    cap_mass: PerPart = 0.1
    """Mass of one end cap; a link has two [kg]. Assumed."""
    rgba: Sequence[float] | Sequence[Sequence[float]] = (0.95, 0.62, 0.22, 1.0)
    """Colour: red, green, blue, opacity in [0, 1]; one for all links or one for each."""
    spring_damping: PerPart = 1.0
    """Damping of each spring joint, for simulators only [N m s/rad]. Assumed."""
    motor_limit: float = math.pi
    """Motors turn between minus and plus this angle [rad]. Assumed."""
    motor_effort: float = 50.0
    """Largest torque of a motor [N m]. Assumed."""
    motor_velocity: float = 2.0
    """Largest speed of a motor [rad/s]. Assumed."""
    base_mass: float = 2.0
    """Mass of the base, fixed to the world [kg]. Assumed; no effect on the statics."""

    XACRO: ClassVar[str] = "inflatable_arm.urdf.xacro"
    """File in xacro/ that describes this robot."""

    def __post_init__(self) -> None:
        """Check every field and spread single numbers over the links."""
        count = check_lengths(self, "link_lengths", "link")
        given = {} if self.max_moment is None else {"max_moment": ("N m", 0.0, True)}
        check_fields(self, {**_PER_LINK, **given}, _SINGLE, count, "links")
        lengths = self._each("link_lengths")
        for offset, length in zip(self._each("hinge_offset"), lengths, strict=True):
            if offset >= length:
                raise ParameterError("hinge_offset", self.hinge_offset, f"below the link lengths {lengths} m")
        for radius, wall in zip(self._each("radius"), self._each("wall_thickness"), strict=True):
            if wall > 0.1 * radius:
                raise ParameterError("wall_thickness", self.wall_thickness, f"thin: at most a tenth of the radius {radius} m")
        for name in ("rest_side", "rest_up"):
            if max(map(abs, self._each(name))) > math.pi / 2:
                raise ParameterError(name, getattr(self, name), "within the spring limits +-pi/2 rad")
        object.__setattr__(self, "rgba", colours(self.rgba, count))

    @property
    def n_links(self) -> int:
        """Number of links."""
        return len(self.link_lengths)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain; above 300 Pinocchio's workspace is refused."""
        return 3 * self.n_links + 1

    @property
    def volume(self) -> float:
        """Volume of all links together [m^3]."""
        return sum(inflated_beam.volume(*size) for size in zip(self.link_lengths, self._each("radius"), strict=True))

    def tank_volume(self, tank_pressure: float, *, ambient_pressure: float = 0.0) -> float:
        """Volume of the tank that inflates the whole arm once, isothermally [m^3]; see `inflated_beam.tank_volume`.

        A tank serves all links at once, so they must have the same pressure.

        Args:
            tank_pressure: Gauge pressure of the full tank [Pa].
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

        Raises:
            ParameterError: If the links differ in pressure or a pressure is out of range.
        """
        return inflated_beam.tank_volume(self.volume, self._one_pressure(), tank_pressure, ambient_pressure=ambient_pressure)

    def tank_pressure(self, tank_volume: float, *, ambient_pressure: float = 0.0) -> float:
        """Gauge pressure of a full tank that inflates the whole arm once [Pa]; see `inflated_beam.tank_pressure`.

        Args:
            tank_volume: Volume of the tank [m^3].
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

        Raises:
            ParameterError: If the links differ in pressure or a value is out of range.
        """
        return inflated_beam.tank_pressure(self.volume, self._one_pressure(), tank_volume, ambient_pressure=ambient_pressure)

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        return xacro_arguments(self)

    def urdf(self) -> str:
        """Return the robot as URDF text, with its springs inside.

        Raises:
            DescriptionError: If xacro refuses the parameters, e.g. a link too light to cut its hinge from.
        """
        return expanded(self.XACRO, tuple(self.xacro_arguments().items()))

    def _one_pressure(self) -> float:
        pressures = self._each("pressure")
        if len(set(pressures)) != 1:
            raise ParameterError("pressure", pressures, "the same in all links to be filled from one tank")
        return float(pressures[0])

    def _each(self, name: str) -> tuple[Any, ...]:
        values: tuple[Any, ...] = getattr(self, name)
        return values


_PER_LINK: Bounds = {
    "hinge_offset": ("m", 0.0, True),
    "radius": ("m", 0.0, True),
    "wall_thickness": ("m", 0.0, True),
    "stiffness": ("N m/rad", 0.0, True),
    "rest_side": ("rad", -math.inf, False),
    "rest_up": ("rad", -math.inf, False),
    "pressure": ("Pa", 0.0, False),
    "density": ("kg/m^3", 0.0, True),
    "cap_mass": ("kg", 0.0, False),
    "spring_damping": ("N m s/rad", 0.0, False),
}

_SINGLE: Bounds = {
    "motor_limit": ("rad", 0.0, True),
    "motor_effort": ("N m", 0.0, True),
    "motor_velocity": ("rad/s", 0.0, True),
    "base_mass": ("kg", 1e-6, True),
}
