"""The helical tube of [Blumenschein 2018]."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots import helix
from softrobots.core.checks import FloatArray, instance_of, positive_number
from softrobots.core.errors import ParameterError, StraightTube
from softrobots.helix.shapes import turning_sign
from softrobots.robots.continuum_arm import CHAINS, HINGE_RULES, MOST_SECTIONS
from softrobots.robots.fields import XacroRobot, check_parameters, parameter
from softrobots.robots.helix_sections import actuator_strains, fewest_sections

UPRIGHT = ("tube", "axis")
"""What can stand along world z: the tube where it leaves the base, or the axis of the helix."""

ACTUATORS = ("drawn", "length", "elastic")
"""What the actuator of a tube can be: drawn only, or real, of given length, or elastic in a tube under pressure."""

MAX_JOINTS = 300
"""Most joints of a tube from a design; Pinocchio's workspace is refused above."""

_LARGEST_RADIUS = 1e6  # of a helix whose axis stands in the origin, over the length of the tube
_SECTION_TURN = math.radians(40.0)  # of a section of a tube from a design


@dataclass(frozen=True, kw_only=True)
class HelixTube(XacroRobot):
    """An inflated tube that an actuator around it bends into a helix: [Blumenschein 2018].

    Its chain is at zero in the actuated shape. As a rigid chain it has one of two forms, as `PccArm` has; at zero the frames of
    either stand on the helix:

    - "sections": `elastic_sections` sections of constant strain, each six joints that follow four section coordinates. They are
      too stiff by up to a twelfth of the squared angle that one of them turns, 6 % by default: use hinges for sag.
    - "lumped": `hinges` pairs of orthogonal spring joints. Keeps its springs in every tool that knows joint springs.

    Stiffness and wrinkling moment are those of a tube whose whole wall is under tension: upper bounds, because the wall along
    the actuator is slack before any load. Give `bending_stiffness` as measured where that matters.

    The frames follow the actuator around the tube (`helix.material_twist` is the turn of the wall against them).

    With `actuator="length"` or `"elastic"` the tube is straight at rest and its actuator, the backbone of the chain, bends it
    against EI, GJ and EA (2 EI / r^2 if not given). The line of the wall opposite keeps its length. As EI goes to 0 against GJ
    the shape tends to (12) of [Blumenschein 2018]; pressure untwists it, as `P r^4 / GJ` (the page of the helical tube).

    Raises:
        ParameterError: If a value is out of range, or there are too few sections; the message names the field. Sections are too
            few where one would bend by more than 170 degrees or twist by half a turn; hinges are not checked.
        SelfIntersection: If the tube would run into itself and `allow_self_contact` is false.
    """

    length: float = parameter(1.5, "m", "Length of the uninflated tube", "assumed; about 2.7 turns", above=0.0)
    diameter: float = parameter(0.0331, "m", "Diameter of the tube", "Blumenschein 2018, section III-B (3.31 cm)", above=0.0)
    contraction: float = parameter(
        0.66,
        "-",
        "Contracted over original length of the actuator, lambda",
        "Blumenschein 2018, section III-B",
        above=0.0,
        at_most=1.0,
    )
    angle: float = parameter(
        math.radians(5.0),
        "rad",
        "Angle of the actuator to the axis of the tube, theta",
        "Blumenschein 2018, section III-B (5 degrees)",
        at_least=0.0,
        below=math.pi / 2,
    )
    handedness: str = parameter("right", "", "Which way the helix winds: right or left", options=helix.HANDEDNESS)
    upright: str = parameter(
        "tube",
        "",
        "What stands along world z: tube (where it leaves the base) or axis (of the helix, through the world origin)",
        options=UPRIGHT,
    )
    actuator: str = parameter(
        "drawn",
        "",
        "What its actuator is: drawn (the tube is a helix at rest), or real, along a tube that is straight at rest: length "
        "(q_motors are the lengths of the actuator and of the wall opposite) or elastic (those lengths without tension, and "
        "the pressure)",
        options=ACTUATORS,
    )
    pressure: float = parameter(
        10e3,
        "Pa",
        "Gauge pressure; stiffens the tube in bending and sets the wrinkling moment, that of a straight tube: an upper bound",
        "assumed",
        at_least=0.0,
    )
    wall_thickness: float = parameter(
        1e-4, "m", "Wall thickness, at most a tenth of the radius", "assumed (thin polyethylene)", above=0.0
    )
    young_modulus: float = parameter(200e6, "Pa", "Modulus of the wall", "assumed (polyethylene of low density)", above=0.0)
    poisson_ratio: float = parameter(0.4, "-", "Poisson ratio of the wall", "assumed", above=-1.0, at_most=0.5)
    density: float = parameter(920.0, "kg/m^3", "Density of the wall", "assumed (polyethylene of low density)", above=0.0)
    actuator_density: float = parameter(
        0.0,
        "kg/m",
        "Mass of actuator, tape or stoppers per length of the uninflated tube",
        "assumed (a bare tube)",
        at_least=0.0,
    )
    bending_stiffness: float | None = parameter(
        None,
        "N m^2",
        "Measured bending stiffness EI; without it, of the whole inflated wall, (E + P/S) pi r^3 t as in Troise 2021, equation "
        "1: an upper bound, as the wall along the actuator is slack",
        above=0.0,
    )
    torsional_stiffness: float | None = parameter(
        None, "N m^2", "Measured torsional stiffness GJ; without it, of the wall, E / (2 (1 + nu)) 2 pi r^3 t", above=0.0
    )
    axial_stiffness: float | None = parameter(
        None, "N", "Measured axial stiffness EA; without it, of the wall, E 2 pi r t", above=0.0
    )
    chain: str = parameter("sections", "", "Form of the equivalent rigid chain: sections or lumped", options=CHAINS)
    elastic_sections: int = parameter(
        20,
        "",
        "Sections of constant strain, for chain = sections",
        "chosen; PyBullet takes fewer than 128 joints, fixed ones counted",
        at_least=1,
        at_most=MOST_SECTIONS,
    )
    hinges: int = parameter(24, "", "Pairs of orthogonal springs, for chain = lumped", at_least=1, at_most=MOST_SECTIONS)
    hinge_rule: str = parameter(
        "corrected",
        "",
        "Where the hinges stand, for chain = lumped: midpoint (in the middle of their sections) or corrected (the outer ones "
        "moved so that the error of the midpoint rule at the ends vanishes)",
        options=HINGE_RULES,
    )
    torsion: bool = parameter(True, "", "Whether a lumped tube can twist: a torsional spring a hinge")
    extension: bool = parameter(True, "", "Whether a lumped tube can stretch: a sliding spring a hinge")
    rgba: Sequence[float] | Sequence[Sequence[float]] = parameter(
        (0.30, 0.55, 0.75, 1.0), "", "Colour: red, green, blue, opacity in 0 to 1", form="colour"
    )
    damping_time: float = parameter(
        0.05, "s", "Damping of each joint over its stiffness; has no effect on the statics", "assumed", at_least=0.0
    )
    base_mass: float = parameter(
        0.5, "kg", "Mass of the base, fixed to the world", "assumed; has no effect on the statics", above=1e-6
    )
    allow_self_contact: bool = parameter(
        False, "", "Whether a tube that runs into itself is accepted; the property contact says where", in_xacro=False
    )

    XACRO = "helix_tube.urdf.xacro"

    def __post_init__(self) -> None:
        check_parameters(self)
        if self.wall_thickness > 0.05 * self.diameter:
            raise ParameterError("wall_thickness", self.wall_thickness, f"thin: at most a tenth of the radius, {self.radius} m")
        for name, required in (("chain", "sections"), ("upright", "tube")):
            if self.real and getattr(self, name) != required:
                raise ParameterError(name, getattr(self, name), f'"{required}" for actuator="{self.actuator}"')
        if self.upright == "axis" and self.shape is not None and self.shape.centre_radius > _LARGEST_RADIUS * self.length:
            raise ParameterError("upright", self.upright, '"tube" for a helix so wide that the tube hardly bends')
        if self.chain == "sections":
            chains = (self.rest_chain, *([self._chain_along_actuator(self.contraction)] if self.real else []))
            self._check_sections(max(itertools.starmap(fewest_sections, chains)))
        if not self.allow_self_contact and self.shape is not None:
            helix.check_self_contact(self.shape, self.turns)

    @classmethod
    def from_design(cls, design: helix.HelixDesign, **fields: Any) -> HelixTube:
        """Return the tube of a design, with sections (and hinges) of about 40 degrees by default, but at most 300 joints.

        Args:
            design: Result of `helix.design_grasp` or `helix.design_antenna`, or any `HelixDesign`.
            fields: The other fields.

        Raises:
            ParameterError: If `design` is no `HelixDesign`, `fields` has a field that it fixes, or a value is out of range.
            SelfIntersection: If the tube would run into itself and `allow_self_contact` is not given.
        """
        instance_of("design", design, helix.HelixDesign, "a HelixDesign")
        designed: dict[str, Any] = {name: getattr(design, name) for name in ("contraction", "angle", "diameter", "handedness")}
        designed["length"] = design.tube_length
        fixed_by_design = sorted(designed.keys() & fields.keys())
        if fixed_by_design:
            raise ParameterError(fixed_by_design[0], fields[fixed_by_design[0]], "left out: the design gives it")
        curvature, torsion = helix.actuator_curvature_torsion(design.contraction, design.angle, design.diameter)
        turning = math.hypot(curvature, torsion) * design.centre_length
        count = max(4, math.ceil(turning / _SECTION_TURN))
        counts = {"elastic_sections": min(count, MAX_JOINTS // 6), "hinges": min(count, MAX_JOINTS // 4)}
        return cls(**(counts | designed | fields))

    @property
    def real(self) -> bool:
        """Whether its actuator is real, and bends it."""
        return self.actuator != "drawn"

    @property
    def q_motors(self) -> FloatArray:
        """What its actuators have: lengths of actuator and wall [m], and pressure [Pa] if elastic; nothing if drawn."""
        wall = self.length / math.cos(self.angle)
        given = [self.contraction * wall, wall, self.pressure]
        return np.array(given[: {"drawn": 0, "length": 2, "elastic": 3}[self.actuator]])

    @property
    def radius(self) -> float:
        """Radius of the tube [m]."""
        return 0.5 * self.diameter

    @property
    def shape(self) -> helix.HelixShape | None:
        """Radii and pitch of the helix; None for a straight tube, at contraction 1 and angle 0."""
        try:
            return helix.forward(self.contraction, self.angle, self.diameter)
        except StraightTube:
            return None

    @property
    def contact(self) -> helix.SelfContact | None:
        """Whether and where the tube runs into itself; None for a straight tube."""
        shape = self.shape
        return None if shape is None else helix.self_contact(shape, self.turns)

    @property
    def turns(self) -> float:
        """Turns that the tube makes; 0 for a straight tube."""
        shape = self.shape
        return 0.0 if shape is None else float(helix.turns(shape, self.angle, self.length))

    @property
    def centre_length(self) -> float:
        """Length of the centre line of the actuated tube, which the chain has [m]."""
        return float(helix.centre_length(self.contraction, self.angle, self.length))

    @property
    def mass(self) -> float:
        """Mass of wall and actuator, without the base [kg]."""
        wall = self.density * math.pi * self.diameter * self.wall_thickness
        return (wall + self.actuator_density) * self.length

    @property
    def strains(self) -> FloatArray:
        """Strains of the actuated centre line `(kx, ky, tau, stretch)`, shape (4,) [rad/m, rad/m, rad/m, -]."""
        curvature, torsion = helix.actuator_curvature_torsion(
            self.contraction, self.angle, self.diameter, "centre", self.handedness
        )
        return np.array([0.0, curvature, torsion, 1.0])

    @property
    def rest_chain(self) -> tuple[FloatArray, float]:
        """Strains `(kx, ky, tau, stretch)`, shape (4,) [rad/m, rad/m, rad/m, -], and length [m] of the chain at rest."""
        return self._chain_along_actuator(1.0) if self.real else (self.strains, self.centre_length)

    @property
    def n_sections(self) -> int:
        """Sections of the chain, of constant strain or lumped."""
        return self.elastic_sections if self.chain == "sections" else self.hinges

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain."""
        return self.n_sections * (6 if self.chain == "sections" else 2 + self.torsion + self.extension)

    def grown(self, length: float) -> HelixTube:
        """Return the same tube grown to another length, with sections as long as before or a little shorter.

        Args:
            length: Length of the uninflated tube that has everted [m], positive.

        Raises:
            ParameterError: If the length is not positive, or needs more than 1000 sections.
            SelfIntersection: If the longer tube would run into itself.
        """
        share = positive_number("length", length, "m") / self.length
        each = {name: max(1, math.ceil(getattr(self, name) * share - 1e-9)) for name in ("elastic_sections", "hinges")}
        used = "elastic_sections" if self.chain == "sections" else "hinges"
        if each[used] > MOST_SECTIONS:
            raise ParameterError("length", length, f"so short that {MOST_SECTIONS} sections are enough, not {each[used]}")
        grown = dataclasses.replace(self, length=length, **{name: min(count, MOST_SECTIONS) for name, count in each.items()})
        object.__setattr__(grown, "_grows", True)
        return grown

    def _chain_along_actuator(self, contraction: float) -> tuple[FloatArray, float]:
        """Strains and rest length of the chain of a real actuator at a contraction."""
        strains = actuator_strains(contraction, self.angle, self.diameter, turning_sign(self.handedness))
        return strains, self.length / math.cos(self.angle)

    def _check_sections(self, fewest: int) -> None:
        if fewest > MOST_SECTIONS:
            raise ParameterError("length", self.length, f"so short that {MOST_SECTIONS} sections are enough for its turns")
        if self.elastic_sections < fewest:
            required = f"at least {fewest} for this helix; more are advisable"
            raise ParameterError("elastic_sections", self.elastic_sections, required)
