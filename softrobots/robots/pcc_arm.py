"""The continuum arm of [PCC paper]: segments with pneumatic muscles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.constant_curvature import AZIMUTHS, muscle_residual
from softrobots.core.checks import finite_array, finite_number, positive_array
from softrobots.core.errors import ParameterError
from softrobots.robots.fields import PerPart, XacroRobot, check_parameters, numbers, parameter, per_part

CHAINS = ("sections", "lumped")
"""Forms of the equivalent rigid chain."""

HINGE_RULES = ("corrected", "midpoint")
"""Where the hinges of the lumped chain stand."""

MOST_SECTIONS = 1000
"""Sections or hinges that a segment may have; an arm has at most twice as many."""


@dataclass(frozen=True, kw_only=True)
class PccArm(XacroRobot):
    """A continuum arm of bending segments, each held by muscles: [PCC paper] has two segments of three muscles.

    It stands straight along +z at rest. As a rigid chain it has one of two forms:

    - "sections": `elastic_sections` sections of constant strain a segment, each six joints that follow four section
      coordinates. Exact arcs. Other tools load the geometry; only this package knows how the joints are coupled.
    - "lumped": `hinges` pairs of orthogonal spring joints a segment. An approximation of second order that keeps its springs in
      every tool that knows joint springs; `hinge_rule="corrected"` removes the boundary terms of the midpoint rule's error,
      which leaves an error of fourth order while it bends little.

    Every per-segment field accepts one number for all segments or one for each, and is stored as a tuple.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    segment_lengths: Sequence[float] = per_part(
        (0.524, 0.524),
        "m",
        "Rest lengths of the segments, base to tip; their number is the number of segments",
        "PCC paper, section 3 (52.4 cm)",
        above=0.0,
    )
    offset: PerPart = parameter(
        math.pi / 3,
        "rad",
        "Turn about the backbone before each segment but the first, or a list with one for each and the first",
        "PCC paper, section 3 (60 degrees)",
        form="special",
    )
    muscle_azimuths: Sequence[float] = parameter(
        AZIMUTHS,
        "rad",
        "Where the muscles of a segment run, from its x axis towards y; an empty list for none (a passive rod)",
        "PCC paper, section 3 (120 degrees apart)",
        form="special",
    )
    muscle_distance: PerPart = per_part(
        0.04, "m", "Distance of the muscles from the backbone", "assumed; not published", above=0.0
    )
    muscle_contraction: PerPart = per_part(
        0.15, "-", "Largest contraction of a muscle, relative to its rest length", "assumed", above=0.0, below=1.0
    )
    muscle_extension: PerPart = per_part(
        0.15, "-", "Largest extension of a muscle, relative to its rest length", "assumed", above=0.0
    )
    muscle_force: PerPart = per_part(400.0, "N", "Largest pull or push of a muscle", "assumed", above=0.0)
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
    linear_density: PerPart = per_part(0.6, "kg/m", "Mass per rest length", "assumed", above=0.0)
    radius: PerPart = per_part(0.05, "m", "Radius of the body; for inertia and pictures", "assumed", above=0.0)
    chain: str = parameter("sections", "", "Form of the equivalent rigid chain: sections or lumped", options=CHAINS)
    elastic_sections: int = parameter(
        4,
        "",
        "Sections of constant strain a segment, for chain = sections; 1 is pure constant curvature",
        at_least=1,
        at_most=MOST_SECTIONS,
    )
    hinges: int = parameter(
        12, "", "Pairs of orthogonal springs a segment, for chain = lumped", at_least=1, at_most=MOST_SECTIONS
    )
    hinge_rule: str = parameter(
        "corrected",
        "",
        "Where the hinges stand, for chain = lumped: midpoint (in the middle of their sections) or corrected (the outer ones "
        "of a segment moved so that it bends exactly under an end load and its own weight)",
        options=HINGE_RULES,
    )
    torsion: bool = parameter(True, "", "Whether a lumped segment can twist: a torsional spring a hinge")
    extension: bool = parameter(True, "", "Whether a lumped segment can stretch: a sliding spring a hinge")
    rgba: Sequence[float] | Sequence[Sequence[float]] = parameter(
        (0.55, 0.60, 0.65, 1.0), "", "Colour of a segment: red, green, blue, opacity in 0 to 1", form="colour"
    )
    damping_time: float = parameter(
        0.05, "s", "Damping of each joint over its stiffness; has no effect on the statics", "assumed", at_least=0.0
    )
    base_mass: float = parameter(
        2.0, "kg", "Mass of the base, fixed to the world", "assumed; has no effect on the statics", above=1e-6
    )

    XACRO = "pcc_arm.urdf.xacro"

    def __post_init__(self) -> None:
        """Check every field and repeat single numbers for all segments."""
        count = check_parameters(self, "segments", "segment_lengths")
        object.__setattr__(self, "offset", self._checked_offset(count))
        object.__setattr__(self, "muscle_azimuths", self._checked_azimuths())
        most = max(1, 2 * MOST_SECTIONS // count)
        for name in ("elastic_sections", "hinges"):
            if getattr(self, name) > most:
                raise ParameterError(name, getattr(self, name), f"a positive integer, at most {most} for {count} segments")

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

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self.segment_lengths)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain."""
        each = 6 * self.elastic_sections if self.chain == "sections" else self.hinges * (2 + self.torsion + self.extension)
        return self.n_segments * each

    @property
    def n_muscles(self) -> int:
        """Number of muscles of the whole arm."""
        return self.n_segments * len(self.muscle_azimuths)

    def _checked_offset(self, count: int) -> tuple[float, ...]:
        if isinstance(self.offset, Sequence | np.ndarray) and np.ndim(self.offset) == 1:
            return numbers("offset", self.offset, count, "rad", "segments")
        turn = finite_number("offset", self.offset, "rad")
        return (0.0, *(turn,) * (count - 1))

    def _checked_azimuths(self) -> tuple[float, ...]:
        if len(np.atleast_1d(self.muscle_azimuths)) == 0:
            return ()
        azimuths = finite_array("muscle_azimuths", self.muscle_azimuths, (None,), "rad")
        try:
            muscle_residual(np.ones(len(azimuths)), 1.0, azimuths)  # knows what azimuths fix an arc
        except ParameterError as error:
            requirement = "none, or three or more that differ (modulo a turn) and do not all lie close together [rad]"
            raise ParameterError("muscle_azimuths", self.muscle_azimuths, requirement) from error
        return tuple(azimuths.tolist())
