"""Inflated links end to end: sizes, walls, and the springs that stand for them, [Troise 2021] section 2.1."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray, non_negative_number, positive_number
from softrobots.core.errors import ParameterError
from softrobots.description.urdf_tags import MOMENT_LAWS
from softrobots.robots.field_values import questionable
from softrobots.robots.fields import PerPart, XacroRobot, check_parameters, parameter, per_part, refuse_given

LINK_MODELS = ("paper", "two_hinges")
"""Where an inflated link bends."""
PAPER_LINK = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005, "pressure": 50e3}
"""The link whose stiffness the paper gives [m, Pa]."""


class AssumedStiffnessWarning(UserWarning):
    """Links of other size or pressure than the paper's have its stiffness, because neither stiffness nor modulus is given."""


@dataclass(frozen=True, kw_only=True)
class InflatedLinks(XacroRobot):
    """Base of a robot of inflated links: their parameters, and what follows from them.

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
        "Distance of the two springs of a link from its motor, l1; below the length of the link; for link_model = paper",
        "Troise 2021, section 4 (first wrinkle at 0.030)",
        above=0.0,
    )
    radius: PerPart = per_part(0.055, "m", "Radius of a link", "Troise 2021, section 3 (0.055)", above=0.0)
    wall_thickness: PerPart = per_part(
        0.0005, "m", "Wall thickness of a link, at most a tenth of the radius", "Troise 2021, section 3 (0.0005)", above=0.0
    )
    link_model: str = parameter(
        "paper",
        "",
        "Where a link bends: paper (at one hinge, l1 from its motor) or two_hinges (at two, with the compliance of a beam)",
        "Troise 2021, section 2.1 (one hinge)",
        options=LINK_MODELS,
    )
    torsion: bool = parameter(
        False,
        "",
        "Whether a link twists, too, at a spring in its middle; for link_model = two_hinges",
        "Troise 2021, section 2.1 (torsion is neglected)",
    )
    stiffness: PerPart | None = per_part(
        None,
        "N m/rad",
        "Stiffness of each spring that bends a link; without it, that of young_modulus",
        "Troise 2021, section 4 (without both, the mean of Table 3, 172.71, or the modulus that it implies)",
        above=0.0,
        in_force="spring_stiffness",
    )
    young_modulus: PerPart | None = per_part(
        None,
        "Pa",
        "Young's modulus of the wall, from which length, radius, wall and pressure make the stiffness; instead of stiffness",
        "Troise 2021, section 2.1 (equation 1)",
        above=0.0,
    )
    shear_modulus: PerPart | None = per_part(
        None,
        "Pa",
        "Shear modulus of the wall, for young_modulus or link_model = two_hinges, else of no effect",
        "assumed, without it: that of an isotropic wall with a Poisson ratio of 0.3, young_modulus / 2.6; a weave has its own",
        above=0.0,
        in_force="wall_shear_modulus",
    )
    rest_side: PerPart = per_part(
        0.0,
        "rad",
        "Angle by which a link at rest is bent sideways; two hinges have half of it each",
        "Troise 2021, equation 2 (0: the link is straight at rest)",
        at_least=-math.pi / 2,
        at_most=math.pi / 2,
    )
    rest_up: PerPart = per_part(
        0.0,
        "rad",
        "Angle by which a link at rest is bent upwards; two hinges have half of it each",
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
    moment_law: str | None = parameter(
        None,
        "",
        "Law of the moment of a link: linear, plateau at max_moment, or slack_wall, which softens as the wall goes slack; "
        "without it, linear or, with max_moment, plateau",
        "chosen; slack_wall is membrane theory, Comer and Levy 1963",
        options=MOMENT_LAWS,
    )
    density: PerPart = per_part(1300.0, "kg/m^3", "Density of the wall", "assumed, PVC-coated fabric; not published", above=0.0)
    cap_mass: PerPart = per_part(
        0.1,
        "kg",
        "Mass of one end cap; a link has two",
        "assumed; not published. The gas is neglected (about 10 g a link)",
        at_least=0.0,
    )

    def __post_init__(self) -> None:
        """Check every field and repeat single numbers for all links."""
        check_parameters(self, "links", "link_lengths")
        for radius, wall in zip(self._each("radius"), self._each("wall_thickness"), strict=True):
            if wall > 0.1 * radius:
                raise ParameterError("wall_thickness", self.wall_thickness, f"thin: at most a tenth of the radius {radius} m")
        self._check_springs()
        if self.moment_law is not None and (self.moment_law == "plateau") != (self.max_moment is not None):
            requirement = "plateau with max_moment, linear or slack_wall without; or None, which is linear or plateau"
            raise ParameterError("moment_law", self.moment_law, f"{requirement} (max_moment is {self.max_moment})")
        if self.moment_law == "slack_wall" and min(self._each("pressure")) == 0.0:
            raise ParameterError("pressure", self.pressure, "above 0 [Pa] with a slack wall, which bears no moment without")

    @property
    def n_links(self) -> int:
        """Number of links."""
        return len(self.link_lengths)

    @property
    def springs_per_link(self) -> int:
        """Number of springs of a link."""
        return 2 if self.link_model == "paper" else 4 + self.torsion

    @property
    def spring_stiffness(self) -> tuple[float, ...]:
        """Stiffness of each spring that bends a link, one number a link [N m/rad]: as given, or by `inflated_beam`."""
        if self.stiffness is not None:
            return self._each("stiffness")
        if self.link_model == "two_hinges":
            return tuple(self.hinges.stiffness.tolist())
        if self.young_modulus is None:
            return (inflated_beam.MEAN_STIFFNESS,) * self.n_links
        beam, lengths = self.beams, np.array(self.link_lengths)
        return tuple((1.0 / (lengths / (3.0 * beam.bending) + 1.0 / (lengths * beam.shear))).tolist())  # F L^2 / v, by (1)

    @property
    def hinges(self) -> inflated_beam.TwoHinges:
        """The hinges that the links have with ``link_model="two_hinges"``: arrays with one number a link.

        Raises:
            ParameterError: If a link is too short, or its stiffness not above that of the pressure alone.
        """
        try:
            return inflated_beam.two_hinges(self.beams, self.link_lengths)
        except ParameterError as error:
            if error.field != "length":
                raise
            raise ParameterError("link_lengths", self.link_lengths, f"{error.requirement}, for two hinges") from error

    @property
    def beams(self) -> inflated_beam.BeamStiffness:
        """The links as beams: arrays with one number a link.

        Raises:
            ParameterError: If `wall_modulus` refuses the stiffness.
        """
        return inflated_beam.beam_stiffness(self.wall_modulus, shear_modulus=self.shear_modulus, **self._tubes())

    @property
    def wall_shear_modulus(self) -> tuple[float, ...]:
        """Shear modulus of the wall, one number a link [Pa]: as given, or that of an isotropic wall, an assumption."""
        if self.shear_modulus is not None:
            return self._each("shear_modulus")
        return tuple(modulus / (2.0 * (1.0 + inflated_beam.POISSON_RATIO)) for modulus in self.wall_modulus)

    @property
    def wall_modulus(self) -> tuple[float, ...]:
        """Young's modulus of the wall, one number a link [Pa]: as given, or what the stiffness implies; by default the paper's.

        Raises:
            ParameterError: If a stiffness is not above that of the pressure alone.
        """
        if self.young_modulus is not None:
            return self._each("young_modulus")
        if self.stiffness is None:
            modulus = inflated_beam.young_modulus_from_stiffness(inflated_beam.MEAN_STIFFNESS, **PAPER_LINK)
            return (float(modulus),) * self.n_links
        if self.link_model == "paper":
            modulus = inflated_beam.young_modulus_from_stiffness(self.stiffness, length=self.link_lengths, **self._tubes())
            return tuple(modulus.tolist())
        k, lengths = np.array(self.stiffness), np.array(self.link_lengths)
        pressure, radius, wall = self._tubes().values()
        modulus = 0.5 * k * lengths / (math.pi * radius**3 * wall) - 0.5 * pressure * radius / wall
        if modulus.min() <= 0.0:
            least = (math.pi * pressure * radius**4 / lengths).tolist()
            raise ParameterError("stiffness", self.stiffness, f"above that of the pressure alone, {least} N m/rad")
        return tuple(modulus.tolist())

    @property
    def volume(self) -> float:
        """Volume of all links together [m^3]."""
        return float(np.sum(np.pi * np.square(self._each("radius")) * self.link_lengths))

    def tank_volume(self, tank_pressure: float, *, ambient_pressure: float = 0.0) -> float:
        """Volume of the tank that inflates the whole arm once [m^3]: `(p_tank + p_a) V_tank = (p + p_a) (V_tank + V)` (Boyle).

        A tank serves all links at once, which are empty before, so they must have the same pressure.

        Args:
            tank_pressure: Gauge pressure of the full tank, above that of the links [Pa]. The paper mentions 30 MPa.
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default), 101325 on the ground.

        Raises:
            ParameterError: If the links differ in pressure or a pressure is out of range.
        """
        (pressure, ambient), full = self._pressures(ambient_pressure), positive_number("tank_pressure", tank_pressure, "Pa")
        if full <= pressure:
            raise ParameterError("tank_pressure", tank_pressure, f"above the pressure {pressure} Pa of the links")
        return (pressure + ambient) * self.volume / (full - pressure)

    def tank_pressure(self, tank_volume: float, *, ambient_pressure: float = 0.0) -> float:
        """Gauge pressure of a full tank that inflates the whole arm once, the inverse of `tank_volume` [Pa].

        Args:
            tank_volume: Volume of the tank [m^3].
            ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

        Raises:
            ParameterError: If the links differ in pressure or a value is out of range.
        """
        (pressure, ambient), tank = self._pressures(ambient_pressure), positive_number("tank_volume", tank_volume, "m^3")
        return pressure + (pressure + ambient) * self.volume / tank

    def _tubes(self) -> dict[str, FloatArray]:
        return {name: np.array(self._each(name)) for name in ("pressure", "radius", "wall_thickness")}

    def _pressures(self, ambient_pressure: float) -> tuple[float, float]:
        pressures = self._each("pressure")
        if len(set(pressures)) != 1:
            raise ParameterError("pressure", pressures, "the same in all links to be filled from one tank")
        return float(pressures[0]), non_negative_number("ambient_pressure", ambient_pressure, "Pa")

    def _check_springs(self) -> None:
        if self.stiffness is not None and self.young_modulus is not None:
            requirement = f"left out where stiffness = {self.stiffness} N m/rad is given, or stiffness left out"
            raise ParameterError("young_modulus", self.young_modulus, requirement)
        if self.link_model == "two_hinges":
            refuse_given(self, ("hinge_offset",), "for link_model = 'two_hinges'")
            _ = self.hinges
            return
        if self.torsion:
            raise ParameterError("torsion", True, "False for link_model = 'paper'; a link of 'two_hinges' can twist")
        lengths = self._each("link_lengths")
        for offset, length in zip(self._each("hinge_offset"), lengths, strict=True):
            if offset >= length:
                raise ParameterError("hinge_offset", self.hinge_offset, f"below the link lengths {lengths} m")
        if self.young_modulus is None:
            refuse_given(self, ("shear_modulus",), "for link_model = 'paper' without young_modulus")
        if self.stiffness is None and self.young_modulus is None:
            self._tell_assumed_stiffness()

    def _tell_assumed_stiffness(self) -> None:
        paper = {"link_lengths" if name == "length" else name: value for name, value in PAPER_LINK.items()}
        others = [f"{name} = {self._each(name)}" for name, value in paper.items() if set(self._each(name)) != {value}]
        if others and not any(questionable(one, self._each(one.name)) for one in fields(self) if one.name in paper):
            text = (
                f"{', '.join(others)}: the springs are still those of the paper's link, {inflated_beam.MEAN_STIFFNESS} N m/rad "
                "(length 0.6 m, radius 0.055 m, wall 0.0005 m, mean of 10 to 60 kPa); give stiffness, or young_modulus (its "
                "wall has 1.374e8 Pa)"
            )
            warnings.warn(text, AssumedStiffnessWarning, stacklevel=6)
