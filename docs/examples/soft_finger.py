"""A pneumatic finger as a robot of one's own: checked parameters that become xacro arguments and URDF text."""

from dataclasses import dataclass
from pathlib import Path

from softrobots.robots import XacroRobot
from softrobots.robots.fields import check_parameters, parameter


@dataclass(frozen=True, kw_only=True)
class SoftFinger(XacroRobot):
    """A finger that closes towards +x when its chamber is under pressure."""

    length: float = parameter(0.1, "m", "Length of the finger", "assumed", above=0.0)
    radius: float = parameter(0.008, "m", "Radius of the finger, for inertia and pictures", "assumed", above=0.0)
    chamber_area: float = parameter(1.5e-4, "m^2", "Section of the chamber", "assumed", above=0.0)
    chamber_distance: float = parameter(
        0.008, "m", "Distance of the middle of the chamber from the layer", "assumed", above=0.0
    )
    max_pressure: float = parameter(80e3, "Pa", "Largest gauge pressure", "assumed", above=0.0)
    bending_stiffness: float = parameter(4e-3, "N m^2", "Bending stiffness EI", "assumed", above=0.0)
    torsional_stiffness: float = parameter(3e-3, "N m^2", "Torsional stiffness GJ", "assumed", above=0.0)
    axial_stiffness: float = parameter(5e3, "N", "Axial stiffness EA, of the layer", "assumed", above=0.0)
    linear_density: float = parameter(0.4, "kg/m", "Mass per length", "assumed", above=0.0)
    hinges: int = parameter(8, "", "Hinges of the chain; best a multiple of 4", at_least=1)

    XACRO = Path(__file__).with_name("soft_finger.urdf.xacro")

    def __post_init__(self) -> None:
        check_parameters(self)

    def closing_angle(self, pressure: float) -> float:
        """Angle of the tip without load [rad], in closed form: the moment p A d is the same in every section."""
        return pressure * self.chamber_area * self.chamber_distance * self.length / self.bending_stiffness
