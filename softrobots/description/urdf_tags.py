"""The tags of this package in a URDF as plain data: springs, sections, actuators and roles (`tag_reader` reads them)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

NAMESPACE = "urn:softrobots:urdf"
"""XML namespace of the tags."""

ROLES = ("motor", "spring", "section", "locked")
"""Roles of movable joints."""

COORDINATES = ("bend_x", "bend_y", "twist", "stretch")
"""The coordinates of a section, `softrobots.constant_curvature.strain_chain.STRAINS`."""

MOMENT_LAWS = ("linear", "plateau", "slack_wall")
"""Laws of the moment of an inflated link: `inflated_beam.moment` is that with a plateau, `slack_wall_moment` the last one."""


KINDS = ("length", "tension", "elastic", "pressure", "mckibben")
"""Kinds of actuators, by what is given: its length, its tension, the length of a motor behind a spring, or a pressure."""


@dataclass(frozen=True)
class SpringTag:
    """A linear joint spring, `torque = stiffness (q - rest)`."""

    stiffness: float
    """Stiffness [N m/rad], or [N/m] at a prismatic joint; positive."""
    rest: float
    """Coordinate at which the spring is relaxed [rad or m]."""


@dataclass(frozen=True)
class InflatedLinkTag:
    """The springs that represent one inflated link, with the properties that set its wrinkling moment."""

    springs: tuple[str, ...]
    """Names of the spring joints that bend it, hinge after hinge, or of coordinates of a section, `<section>_bend_x` etc."""
    radius: float
    """Tube radius [m]."""
    pressure: float
    """Gauge pressure [Pa]."""
    max_moment: float | None = None
    """Moment of the plateau, beyond wrinkling [N m]; None for the other laws."""
    hinges: int = 1
    """Number of hinges, each with as many of the springs."""
    twist: str | None = None
    """Name of the spring joint that twists it; None if it does not twist."""
    slack_wall: bool = False
    """Whether the moment is that of a wall that goes slack."""


@dataclass(frozen=True, kw_only=True)
class AnySectionTag:
    """What both kinds of sections have."""

    name: str
    """Name of the section; of constant strain, also of the link at its end."""
    segment: int
    """Number of the segment that it is part of, from 1."""
    length: float
    """Rest length [m]."""
    rest: tuple[float, ...]
    """Strains at rest, where every joint is at zero: kx, ky, twist [rad/m], stretch [-]."""
    radius: float
    """Radius of the body, for pictures [m]."""
    middle: tuple[float, float] = (0.0, 0.0)
    """Middle of the body beside the backbone, x and y in the section, for pictures [m]."""


@dataclass(frozen=True, kw_only=True)
class SectionTag(AnySectionTag):
    """A section of constant strain: six joints that follow its section coordinates."""

    joints: tuple[str, ...]
    """Its six joints, base to tip; `softrobots.constant_curvature.strain_chain.JOINTS` in that order."""
    bending_stiffness: float
    """EI [N m^2]."""
    torsional_stiffness: float
    """GJ [N m^2]."""
    axial_stiffness: float
    """EA [N]; infinite if it does not stretch."""
    relaxed: tuple[float, ...]
    """Strains where it carries nothing, as `rest`."""
    bends: float
    """Rest length of the part of it that bends, between straight rigid ones [m]."""
    hinge: float = 0.0
    """Length of rod from its start to that part [m]."""

    @property
    def strains(self) -> tuple[str, ...]:
        """Its coordinates, of `COORDINATES`."""
        return COORDINATES if math.isfinite(self.axial_stiffness) else COORDINATES[:3]


@dataclass(frozen=True, kw_only=True)
class LumpedSectionTag(AnySectionTag):
    """A section lumped into spring joints at its middle."""

    joints: Mapping[str, str]
    """Spring joint by section coordinate, `STRAINS`; `twist` and `stretch` may be missing."""
    hinge: float
    """Length of rod from the start of the section to the joints [m]."""


@dataclass(frozen=True, kw_only=True)
class LineTag:
    """A line along a segment, parallel to its backbone; one without effect, as the actuator of a helix, is drawn only."""

    name: str
    """Name of the line."""
    segment: int
    """Number of the segment, from 1."""
    azimuth: float
    """Azimuth, from the x axis of the segment towards y [rad]."""
    distance: float
    """Distance from the backbone [m]."""


@dataclass(frozen=True, kw_only=True)
class RouteTag:
    """The way of an actuator along one segment: offsets from the backbone at given places, linear between them."""

    segment: int
    """Number of the segment, from 1."""
    at: tuple[float, ...]
    """Places along its rest length, ascending, two or more [m]; what is beyond its ends only continues the table."""
    distance: tuple[float, ...]
    """Distance from the backbone at each [m]."""
    azimuth: tuple[float, ...]
    """Azimuth at each, from the x axis of the segment towards y, not wrapped: two that differ make a helix [rad]."""

    @property
    def straight(self) -> bool:
        """Whether distance and azimuth are the same everywhere."""
        return len(set(self.distance)) == 1 and len(set(self.azimuth)) == 1


@dataclass(frozen=True, kw_only=True)
class ActuatorTag:
    """An actuator along a route through the body; `softrobots.model.actuator_laws` has the laws of the kinds."""

    name: str
    """Name of the actuator."""
    route: tuple[RouteTag, ...]
    """Its way, base to tip."""
    kind: str = "length"
    """One of `KINDS`."""
    rest_length: float
    """Length with the robot at rest [m]."""
    shortest: float = 0.0
    """Lower limit of its length, or of that of its motor [m]."""
    longest: float = math.inf
    """Upper limit of the same [m]."""
    weakest: float = 0.0
    """Least tension; negative if it can push [N]."""
    strongest: float = math.inf
    """Largest tension [N]."""
    max_pressure: float = math.inf
    """Largest pressure [Pa]."""
    stiffness: float = 0.0
    """Stiffness between motor and anchor [N/m]."""
    pretension: float = 0.0
    """Tension where its length is that of the motor [N]."""
    area: float = 0.0
    """Cross-section of a chamber [m^2]."""
    diameter: float = 0.0
    """Diameter of a braided muscle at rest [m]."""
    braid_angle: float = 0.0
    """Angle between its braid and its axis at rest [rad]."""

    @property
    def straight(self) -> bool:
        """Whether it runs parallel to the backbone within each segment."""
        return all(piece.straight for piece in self.route)

    @property
    def segments(self) -> tuple[int, ...]:
        """Numbers of the segments that it runs along, base to tip."""
        return tuple(dict.fromkeys(piece.segment for piece in self.route))

    @property
    def distance(self) -> float:
        """Distance from the backbone where it begins; everywhere, if it is straight along one segment [m]."""
        return self.route[0].distance[0]

    @property
    def azimuth(self) -> float:
        """Azimuth where it begins, as for `distance` [rad]."""
        return self.route[0].azimuth[0]


@dataclass(frozen=True)
class CapsuleTag:
    """A capsule that holds a piece of the body closely, for contact with surroundings: all points near a segment, its core.

    Neighbours share the point between them, so capsules overlap, also across the tiny links of hinges: they are no collision
    shapes of URDF, whose overlap there would move the equilibrium in simulators.
    """

    link: str
    """Name of the link that carries it."""
    start: tuple[float, float, float]
    """Start of its core in the frame of the link [m]."""
    end: tuple[float, float, float]
    """End of its core there [m]; a sphere has both at one point."""
    radius: float
    """Radius of the body, the distance from the core [m]."""


@dataclass(frozen=True)
class FrictionTag:
    """Dry friction of a segment, which does not depend on the rate; `softrobots.model.dry_friction` has its law."""

    segment: int
    """Number of the segment, from 1."""
    bending: float
    """Moment that holds its bending [N m]."""
    guides: float
    """Coefficient of friction of actuators in its guides [-]."""


@dataclass(frozen=True)
class RobotTags:
    """All tags of this package in a URDF."""

    springs: Mapping[str, SpringTag]
    """Springs by joint name."""
    roles: Mapping[str, str]
    """Role by joint name, one of `ROLES`."""
    inflated_links: tuple[InflatedLinkTag, ...]
    """Inflated links, base to tip."""
    sections: tuple[SectionTag, ...]
    """Sections of constant strain, in the order of the file."""
    lumped_sections: tuple[LumpedSectionTag, ...]
    """Lumped sections, in the order of the file."""
    muscles: tuple[ActuatorTag, ...]
    """Actuators along the body, in the order of the file."""
    lines: tuple[LineTag, ...]
    """Lines, in the order of the file."""
    mimics: tuple[str, ...]
    """Names of the joints that mimic another joint."""
    tip: str | None = None
    """Name of the link that is the tip by default; None if the file names none."""
    friction: tuple[FrictionTag, ...] = ()
    """Dry friction of segments."""
    rotors: Mapping[str, float] = field(default_factory=dict)
    """Inertia of the rotor of a motor at its joint [kg m^2, or kg at a prismatic joint] by joint name."""
    capsules: tuple[CapsuleTag, ...] = ()
    """Capsules along the body, in the order of the file; empty if the file has none."""
