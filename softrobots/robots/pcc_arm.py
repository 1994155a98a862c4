"""The continuum arm of [PCC paper]: segments with pneumatic muscles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softrobots.constant_curvature import AZIMUTHS
from softrobots.core.checks import positive_array
from softrobots.core.errors import ParameterError
from softrobots.robots.continuum_arm import ContinuumArm
from softrobots.robots.field_values import numbers
from softrobots.robots.fields import PerPart, parameter, per_actuator, per_part


@dataclass(frozen=True, kw_only=True)
class PccArm(ContinuumArm):
    """A continuum arm of bending segments, each held by muscles: [PCC paper] has two segments of three muscles.

    It stands straight along +z at rest. As a rigid chain it has one of two forms:

    - "sections": `elastic_sections` sections of constant strain a segment, each six joints that follow four section
      coordinates. Exact arcs. Other tools load the geometry; only this package knows how the joints are coupled.
    - "lumped": `hinges` pairs of orthogonal spring joints a segment. An approximation of second order that keeps its springs in
      every tool that knows joint springs; `hinge_rule="corrected"` removes the boundary terms of the midpoint rule's error,
      which leaves an error of fourth order while it bends little.

    The muscles of a segment run along it, through segments before it, or on routes of their own (`routing`); `kind` says what
    is given of them. Every per-segment field accepts one number for all segments or one for each, and is stored as a tuple; a
    field of muscles also one for each muscle, in the order of the segments.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    muscle_azimuths: Sequence[float] = parameter(
        AZIMUTHS,
        "rad",
        "Where the muscles of a segment run, from its x axis towards y; an empty list for none (a passive rod)",
        "PCC paper, section 3 (120 degrees apart)",
        form="special",
    )
    muscle_distance: PerPart = per_actuator(
        0.04, "m", "Distance of the muscles from the backbone", "assumed; not published", above=0.0
    )
    muscle_azimuth_deviation: PerPart = per_actuator(
        0.0, "rad", "By how much a muscle is turned about the backbone from muscle_azimuths", at_least=-0.5, at_most=0.5
    )
    muscle_contraction: PerPart = per_actuator(
        0.15, "-", "Largest contraction of a muscle, relative to its rest length", "assumed", above=0.0, below=1.0
    )
    muscle_extension: PerPart = per_actuator(
        0.15, "-", "Largest extension of a muscle, relative to its rest length", "assumed", above=0.0
    )
    muscle_force: PerPart = per_actuator(400.0, "N", "Largest pull or push of a muscle", "assumed", above=0.0)
    muscle_least_tension: PerPart | None = per_actuator(
        None,
        "N",
        "Least tension of a muscle, negative where it may push; without it minus muscle_force, and 0 for kind = elastic",
    )
    muscle_stiffness: PerPart = per_actuator(10e3, "N/m", "Stiffness of a muscle, for kind = elastic", "assumed", above=0.0)
    muscle_pretension: PerPart = per_actuator(
        10.0, "N", "Tension of a muscle where all is at rest, for kind = elastic", "assumed", at_least=0.0
    )
    muscle_area: PerPart = per_actuator(
        3e-4, "m^2", "Section of a chamber, for kind = pressure", "assumed; a radian at max_pressure", above=0.0
    )
    muscle_diameter: PerPart = per_actuator(
        0.01, "m", "Diameter of a McKibben muscle at rest, for kind = mckibben", "assumed; a radian at max_pressure", above=0.0
    )
    muscle_braid_angle: PerPart = per_actuator(
        math.radians(25.0),
        "rad",
        "Angle of its braid to its axis at rest, below 0.9553, at which it does not pull; for kind = mckibben",
        "assumed",
        above=0.0,
        below=math.atan(math.sqrt(2.0)),
    )
    muscle_max_pressure: PerPart = per_actuator(
        3e5, "Pa", "Largest gauge pressure, for kind = pressure and mckibben", "assumed", above=0.0
    )
    bending_stiffness: PerPart = per_part(
        1.92,
        "N m^2",
        "Bending stiffness EI",
        "assumed, as of three muscles of 800 N a unit strain at 0.04 m (3/2 800 d^2)",
        above=0.0,
    )
    torsional_stiffness: PerPart = per_part(
        1.28, "N m^2", "Torsional stiffness GJ", "assumed, as of an incompressible round rod, EI / 1.5", above=0.0
    )
    axial_stiffness: PerPart = per_part(
        2400.0, "N", "Axial stiffness EA", "assumed, as of three muscles of 800 N a unit strain", above=0.0
    )

    XACRO = "pcc_arm.urdf.xacro"
    ACTUATOR = "muscle"
    KINDS = ("length", "tension", "elastic", "pressure", "mckibben")

    @classmethod
    def measured(cls, *, bending: PerPart, torsion: PerPart, axial: PerPart, **fields: Any) -> PccArm:
        """Return an arm with the stiffness of whole segments as measured on a bench.

        A moment at the end of a segment bends it by `moment / bending`, so `EI = bending l`; `GJ` and `EA` likewise.

        Args:
            bending: Bending moment at the end over the angle there [N m/rad], one number or one a segment.
            torsion: Torque over the angle of twist [N m/rad], likewise.
            axial: Pull over elongation [N/m], likewise.
            fields: The other fields.

        Returns:
            The arm.

        Raises:
            ParameterError: If a value is out of range or a list has the wrong length.
        """
        lengths = numbers("segment_lengths", fields.get("segment_lengths", cls.segment_lengths), None, "m")
        if not lengths:
            raise ParameterError("segment_lengths", lengths, "at least one length [m]")
        stiffness = {}
        for name, field, value, unit in (
            ("bending", "bending_stiffness", bending, "N m/rad"),
            ("torsion", "torsional_stiffness", torsion, "N m/rad"),
            ("axial", "axial_stiffness", axial, "N/m"),
        ):
            if field in fields:
                raise ParameterError(field, fields[field], f"left out: {name} gives it")
            measured = numbers(name, value, len(lengths), unit, "segments")
            positive_array(name, measured, unit)
            stiffness[field] = tuple(k * length for k, length in zip(measured, lengths, strict=True))
        return cls(**(stiffness | fields))
