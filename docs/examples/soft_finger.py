"""A pneumatic finger as a robot of one's own: checked parameters that become xacro arguments and URDF text."""

from dataclasses import asdict, dataclass, fields
from pathlib import Path

from softrobots.core.checks import positive_integer, positive_number
from softrobots.description.expansion import expand

XACRO = Path(__file__).with_name("soft_finger.urdf.xacro")


@dataclass(frozen=True, kw_only=True)
class SoftFinger:
    """A finger that closes towards +x when its chamber is under pressure. SI units; numbers without a source are assumed."""

    length: float = 0.1
    """Length [m]."""
    radius: float = 0.008
    """Radius, for inertia and pictures [m]."""
    chamber_area: float = 1.5e-4
    """Section of the chamber [m^2]."""
    chamber_distance: float = 0.008
    """Distance of the middle of the chamber from the layer that does not stretch [m]."""
    max_pressure: float = 80e3
    """Largest gauge pressure [Pa]."""
    bending_stiffness: float = 4e-3
    """EI [N m^2]."""
    torsional_stiffness: float = 3e-3
    """GJ [N m^2]."""
    axial_stiffness: float = 5e3
    """EA [N]."""
    linear_density: float = 0.4
    """Mass per length [kg/m]."""
    hinges: int = 8
    """Hinges of the chain; best a multiple of 4."""

    def __post_init__(self) -> None:
        for field in fields(self):
            positive_number(field.name, getattr(self, field.name))
        positive_integer("hinges", self.hinges)

    def urdf(self) -> str:
        """The robot as URDF text: all that softrobots asks of a robot."""
        return expand(XACRO, {name: repr(value) for name, value in asdict(self).items()})

    def tension(self, pressure: float) -> float:
        """What the muscle `chamber` exerts at a gauge pressure [Pa]: minus pressure times section [N]."""
        return -pressure * self.chamber_area

    def closing_angle(self, pressure: float) -> float:
        """Angle of the tip without load [rad], in closed form: the moment p A d is the same in every section."""
        return pressure * self.chamber_area * self.chamber_distance * self.length / self.bending_stiffness
