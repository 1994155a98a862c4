"""A continuum arm that tendons drive: an elastic backbone with disks, and tendons through holes in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from softrobots.robots.continuum_arm import ROUTING, ContinuumArm
from softrobots.robots.fields import PerPart, parameter, per_actuator, per_part
from softrobots.robots.routes import Route


@dataclass(frozen=True, kw_only=True)
class TendonArm(ContinuumArm):
    """A continuum arm of a thin backbone with disks, bent by tendons that motors at its base pull.

    It stands straight along +z at rest and has the two rigid chains of `PccArm`. The tendons of a segment are fixed at its end
    and run from the base through the disks of all segments before it, parallel to the backbone (`routing`). They only pull.
    Backbone, tendons and sizes are those of a published robot with recordings, `docs/measured_arm.md`.

    The disks are mass, spread evenly along the backbone; one is drawn at the end of each section. Every per-segment field
    accepts one number for all segments or one for each, and is stored as a tuple; a field of tendons also one for each tendon,
    in the order of the segments.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    segment_lengths: Sequence[float] = per_part(
        (0.060, 0.0625, 0.064),
        "m",
        "Rest lengths of the segments, base to tip; their number is the number of segments",
        "OpenCR, published configuration",
        above=0.0,
    )
    offset: PerPart = parameter(
        0.0,
        "rad",
        "Turn about the backbone before each segment but the first, or a list with one for each and the first",
        form="special",
    )
    linear_density: PerPart = per_part(
        0.05 / 0.1865,
        "kg/m",
        "Mass per rest length, with the disks",
        "OpenCR, published configuration (50 g in all)",
        above=0.0,
    )
    radius: PerPart = per_part(0.006, "m", "Radius of the disks; for inertia and pictures", "assumed", above=0.0)
    routing: str | int | Sequence[str | int] | Sequence[Route] = parameter("base", "", ROUTING, form="special")
    kind: str | Sequence[str] = parameter(
        "elastic",
        "",
        "What the tendons of a segment are given, for all or one for each: elastic (the length at the motor), their tension, "
        "or their length, which is then exact and can push; length for all or for none",
        form="special",
    )
    tendon_azimuths: Sequence[float] = parameter(
        (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0),
        "rad",
        "Where the tendons of a segment run, from its x axis towards y; an empty list for none",
        "OpenCR, published configuration (120 degrees apart)",
        form="special",
    )
    tendon_distance: PerPart = per_actuator(
        0.0045, "m", "Distance of the tendons from the backbone", "OpenCR, published configuration", above=0.0
    )
    tendon_azimuth_deviation: PerPart = per_actuator(
        0.0, "rad", "By how much a tendon is turned about the backbone from tendon_azimuths", at_least=-0.5, at_most=0.5
    )
    tendon_contraction: PerPart = per_actuator(
        0.2, "-", "How far a motor can pull, relative to the rest length of the tendon", "assumed", above=0.0, below=1.0
    )
    tendon_extension: PerPart = per_actuator(
        0.2, "-", "How far a motor can let go, relative to the rest length of the tendon", "assumed", above=0.0
    )
    tendon_force: PerPart = per_actuator(60.0, "N", "Largest tension of a tendon", "assumed", above=0.0)
    tendon_least_tension: PerPart = per_actuator(0.0, "N", "Least tension of a tendon", at_least=0.0)
    tendon_stiffness: PerPart = per_actuator(
        8e3, "N/m", "Stiffness of a tendon with its motor, for kind = elastic", "assumed, as the recordings have it", above=0.0
    )
    tendon_pretension: PerPart = per_actuator(
        2.0, "N", "Tension of a tendon where all is at rest, for kind = elastic", "assumed; not published", at_least=0.0
    )
    backbone_radius: PerPart = per_part(
        0.0005, "m", "Radius of the backbone", "OpenCR, published configuration (nitinol)", above=0.0
    )
    young_modulus: PerPart = per_part(50e9, "Pa", "Modulus of the backbone", "OpenCR, published configuration", above=0.0)
    poisson_ratio: PerPart = per_part(
        0.3, "-", "Poisson ratio of the backbone", "OpenCR, published configuration", above=-1.0, at_most=0.5
    )
    bending_stiffness: PerPart | None = per_part(
        None,
        "N m^2",
        "Measured bending stiffness EI; without it, of the backbone, E pi r^4 / 4",
        above=0.0,
        in_force="bending_in_force",
    )
    torsional_stiffness: PerPart | None = per_part(
        None,
        "N m^2",
        "Measured torsional stiffness GJ; without it, of the backbone, E / (2 (1 + nu)) pi r^4 / 2",
        above=0.0,
        in_force="torsional_in_force",
    )
    axial_stiffness: PerPart | None = per_part(
        None, "N", "Measured axial stiffness EA; without it, of the backbone, E pi r^2", above=0.0, in_force="axial_in_force"
    )

    XACRO = "tendon_arm.urdf.xacro"
    ACTUATOR = "tendon"
    KINDS = ("elastic", "tension", "length")

    @property
    def bending_in_force(self) -> tuple[float, ...]:
        """Bending stiffness EI of each segment, as measured or of the backbone [N m^2]."""
        return self._in_force("bending_stiffness", lambda e, nu, r: e * math.pi * r**4 / 4.0)

    @property
    def torsional_in_force(self) -> tuple[float, ...]:
        """Torsional stiffness GJ of each segment, likewise [N m^2]."""
        return self._in_force("torsional_stiffness", lambda e, nu, r: e / (2.0 * (1.0 + nu)) * math.pi * r**4 / 2.0)

    @property
    def axial_in_force(self) -> tuple[float, ...]:
        """Axial stiffness EA of each segment, likewise [N]."""
        return self._in_force("axial_stiffness", lambda e, nu, r: e * math.pi * r**2)

    def _in_force(self, name: str, of_rod: Callable[[float, float, float], float]) -> tuple[float, ...]:
        if getattr(self, name) is not None:
            return self._each(name)
        rods = zip(*(self._each(fact) for fact in ("young_modulus", "poisson_ratio", "backbone_radius")), strict=True)
        return tuple(of_rod(*rod) for rod in rods)
