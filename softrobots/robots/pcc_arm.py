"""The arm of [PCC paper]: segments with pneumatic muscles, its parameters, checked, as xacro arguments and URDF text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softrobots.constant_curvature import AZIMUTHS, muscle_residual
from softrobots.core.checks import choice, finite_array, finite_number, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.robots.parameters import (
    Bounds,
    PerPart,
    at_least,
    check_fields,
    check_lengths,
    colours,
    expanded,
    numbers,
    xacro_arguments,
)

CHAINS = ("sections", "lumped")
"""Forms of the equivalent rigid chain."""

HINGE_RULES = ("corrected", "midpoint")
"""Where the hinges of the lumped chain stand."""


@dataclass(frozen=True, kw_only=True)
class PccArm:
    """A continuum arm of bending segments, each held by muscles: [PCC paper] has two segments of three muscles.

    It stands straight along +z at rest. As a rigid chain it has one of two forms:

    - "sections": `elastic_sections` sections of constant strain a segment, each six joints that follow four section
      coordinates. Exact arcs. Other tools load the geometry; only this package knows how the joints hang together.
    - "lumped": `hinges` pairs of orthogonal spring joints a segment. An approximation of second order that keeps its springs in
      every tool that knows joint springs.

    Every per-segment field accepts one number for all segments or one for each, and is stored as a tuple.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    segment_lengths: Sequence[float] = (0.524, 0.524)
    """Rest lengths of the segments, base to tip; their number is the number of segments [m]. PCC paper, section 3."""
    offset: PerPart = math.pi / 3
    """Turn about the backbone before each segment but the first, or one for each and the first [rad]. PCC paper, section 3."""
    muscle_azimuths: Sequence[float] = AZIMUTHS
    """Where the muscles of a segment run, from its x axis towards y; none: a passive rod [rad]. PCC paper, section 3."""
    muscle_distance: PerPart = 0.04
    """Distance of the muscles from the backbone [m]. Assumed; not published."""
    muscle_contraction: PerPart = 0.15
    """Largest contraction of a muscle, relative to its rest length [-], below 1. Assumed."""
    muscle_extension: PerPart = 0.15
    """Largest extension of a muscle, relative to its rest length [-]. Assumed."""
    muscle_force: PerPart = 400.0
    """Largest pull or push of a muscle [N]. Assumed."""
    bending_stiffness: PerPart = 1.92
    """Bending stiffness EI [N m^2]. Assumed, as of three muscles of 800 N a unit strain: 3/2 800 d^2."""
    torsional_stiffness: PerPart = 1.28
    """Torsional stiffness GJ [N m^2]. Assumed, as of an incompressible round rod: EI / 1.5."""
    axial_stiffness: PerPart = 2400.0
    """Axial stiffness EA [N]. Assumed, as of three muscles of 800 N a unit strain."""
    linear_density: PerPart = 0.6
    """Mass per rest length [kg/m]. Assumed."""
    radius: PerPart = 0.05
    """Radius of the body [m]; for inertia and pictures. Assumed."""
    chain: str = "sections"
    """Form of the equivalent rigid chain: "sections" or "lumped"."""
    elastic_sections: int = 4
    """Sections of constant strain a segment, for chain="sections"; 1 is pure constant curvature."""
    hinges: int = 12
    """Pairs of orthogonal springs a segment, for chain="lumped"."""
    hinge_rule: str = "corrected"
    """Where the hinges stand: in the middle of their sections ("midpoint"), or the first and the last of a segment 1/24 section
    nearer to its ends, which removes the boundary term of the midpoint rule's error ("corrected"). Both are of second order."""
    torsion: bool = True
    """Whether a lumped segment can twist: a torsional spring a hinge."""
    extension: bool = True
    """Whether a lumped segment can stretch: a sliding spring a hinge."""
    rgba: Sequence[float] | Sequence[Sequence[float]] = (0.55, 0.60, 0.65, 1.0)
    """Colour: red, green, blue, opacity in [0, 1]; one for all segments or one for each."""
    damping_time: float = 0.05
    """Damping of each spring joint over its stiffness, for simulators only [s]. Assumed."""
    base_mass: float = 2.0
    """Mass of the base, fixed to the world [kg]. Assumed; no effect on the statics."""

    XACRO: ClassVar[str] = "pcc_arm.urdf.xacro"
    """File in xacro/ that describes this robot."""

    def __post_init__(self) -> None:
        """Check every field and spread single numbers over the segments."""
        count = check_lengths(self, "segment_lengths", "segment")
        check_fields(self, _PER_SEGMENT, _SINGLE, count, "segments")
        if max(self._each("muscle_contraction")) >= 1.0:
            raise ParameterError("muscle_contraction", self.muscle_contraction, "below 1")
        object.__setattr__(self, "offset", self._offsets(count))
        object.__setattr__(self, "muscle_azimuths", self._azimuths())
        choice("chain", self.chain, CHAINS)
        choice("hinge_rule", self.hinge_rule, HINGE_RULES)
        for name in ("elastic_sections", "hinges"):
            object.__setattr__(self, name, positive_integer(name, getattr(self, name), max(1, min(1000, 2000 // count))))
        for name in ("torsion", "extension"):
            if not isinstance(getattr(self, name), bool):
                raise ParameterError(name, getattr(self, name), "True or False")
        object.__setattr__(self, "rgba", colours(self.rgba, count, "segments"))

    @classmethod
    def measured(cls, *, bending: PerPart, torsion: PerPart, axial: PerPart, **fields: Any) -> PccArm:
        """Make an arm from the stiffness of whole segments, as a bench measures it.

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
            raise ParameterError("segment_lengths", lengths, "at least one segment length [m]")
        stiffness = {}
        for name, field, value, unit in (
            ("bending", "bending_stiffness", bending, "N m/rad"),
            ("torsion", "torsional_stiffness", torsion, "N m/rad"),
            ("axial", "axial_stiffness", axial, "N/m"),
        ):
            if field in fields:
                raise ParameterError(field, fields[field], f"left out: {name} gives it")
            given = numbers(name, value, len(lengths), unit, "segments")
            at_least(name, given, 0.0, True, unit)
            stiffness[field] = tuple(k * length for k, length in zip(given, lengths, strict=True))
        return cls(**(stiffness | fields))

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self.segment_lengths)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain; above 300 Pinocchio's workspace is refused."""
        each = 6 * self.elastic_sections if self.chain == "sections" else self.hinges * (2 + self.torsion + self.extension)
        return self.n_segments * each

    @property
    def n_muscles(self) -> int:
        """Number of muscles of the whole arm."""
        return self.n_segments * len(self.muscle_azimuths)

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        return xacro_arguments(self)

    def urdf(self) -> str:
        """Return the robot as URDF text, with its sections or springs and its muscles inside.

        Raises:
            DescriptionError: If xacro refuses the parameters, e.g. sections too light to cut their tiny links from.
        """
        return expanded(self.XACRO, tuple(self.xacro_arguments().items()))

    def _each(self, name: str) -> tuple[Any, ...]:
        values: tuple[Any, ...] = getattr(self, name)
        return values

    def _offsets(self, count: int) -> tuple[float, ...]:
        if isinstance(self.offset, Sequence | np.ndarray) and np.ndim(self.offset) == 1:
            return numbers("offset", self.offset, count, "rad", "segments")
        turn = finite_number("offset", self.offset, "rad")
        return (0.0, *(turn,) * (count - 1))

    def _azimuths(self) -> tuple[float, ...]:
        if len(np.atleast_1d(self.muscle_azimuths)) == 0:
            return ()
        azimuths = finite_array("muscle_azimuths", self.muscle_azimuths, (None,), "rad")
        try:
            muscle_residual(np.ones(len(azimuths)), 1.0, azimuths)  # knows what azimuths fix an arc
        except ParameterError as error:
            requirement = "none, or three or more that differ (modulo a turn) and do not all lie close together [rad]"
            raise ParameterError("muscle_azimuths", self.muscle_azimuths, requirement) from error
        return tuple(azimuths.tolist())


_PER_SEGMENT: Bounds = {
    "muscle_distance": ("m", 0.0, True),
    "muscle_contraction": ("-", 0.0, True),
    "muscle_extension": ("-", 0.0, True),
    "muscle_force": ("N", 0.0, True),
    "bending_stiffness": ("N m^2", 0.0, True),
    "torsional_stiffness": ("N m^2", 0.0, True),
    "axial_stiffness": ("N", 0.0, True),
    "linear_density": ("kg/m", 0.0, True),
    "radius": ("m", 0.0, True),
}

_SINGLE: Bounds = {
    "damping_time": ("s", 0.0, False),
    "base_mass": ("kg", 1e-6, True),
}
