"""The helical tube of [Blumenschein 2018]: its parameters, checked, as xacro arguments and URDF text."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softrobots import helix
from softrobots.constant_curvature.strain_chain import LARGEST_BENDING, in_range
from softrobots.core.checks import FloatArray, choice, positive_integer, positive_number
from softrobots.core.errors import ParameterError, StraightTube
from softrobots.helix.shapes import checked_actuator
from softrobots.robots.parameters import Bounds, check_fields, colours, expanded, xacro_arguments
from softrobots.robots.pcc_arm import CHAINS, HINGE_RULES

UPRIGHT = ("tube", "axis")
"""What can stand along world z: the tube where it leaves the base, or the axis of the helix."""

MAX_JOINTS = 300
"""Joints of a designed tube; Pinocchio's workspace is refused above."""

MOST_SECTIONS = 1000
"""Sections or hinges that a chain may have."""

_LARGEST_RADIUS = 1e6  # of a helix whose axis stands in the origin, over the length of the tube
_SECTION_TURN = math.radians(40.0)  # of a section of a designed tube


@dataclass(frozen=True, kw_only=True)
class HelixTube:
    """An inflated tube that an actuator around it bends into a helix: [Blumenschein 2018].

    Its chain is at zero in the actuated shape. As a rigid chain it has one of two forms, as `PccArm` has; at zero the frames of
    either stand on the helix:

    - "sections": `elastic_sections` sections of constant strain, each six joints that follow four section coordinates.
    - "lumped": `hinges` pairs of orthogonal spring joints. Keeps its springs in every tool that knows joint springs.

    The frames follow the actuator around the tube (`helix.material_twist` tells how the wall turns against them).

    Raises:
        ParameterError: If a value is out of range, or there are too few sections; the message names the field. Sections are too
            few where one would bend by more than 170 degrees or twist by half a turn; hinges are not checked.
        SelfIntersection: If the tube would run into itself and `allow_self_contact` is false.
    """

    length: float = 1.5
    """Length of the uninflated tube [m]. Assumed; about 2.7 turns."""
    diameter: float = 0.0331
    """Diameter of the tube [m]. Blumenschein 2018, section III-B."""
    contraction: float = 0.66
    """Contracted over original length of the actuator, `lambda` in (0, 1] [-]. Blumenschein 2018, section III-B."""
    angle: float = math.radians(5.0)
    """Angle of the actuator to the axis of the tube, `theta` in [0, pi/2) [rad]. Blumenschein 2018, section III-B."""
    handedness: str = "right"
    """Which way the helix winds, "right" or "left"."""
    upright: str = "tube"
    """What stands along world z: the "tube" where it leaves the base, or the "axis" of the helix, through the world origin."""
    pressure: float = 10e3
    """Gauge pressure; stiffens the tube in bending and sets the wrinkling moment [Pa]. Assumed."""
    wall_thickness: float = 1e-4
    """Wall thickness [m], at most a tenth of the radius. Assumed (thin polyethylene)."""
    young_modulus: float = 200e6
    """Modulus of the wall [Pa]. Assumed (polyethylene of low density)."""
    poisson_ratio: float = 0.4
    """Poisson ratio of the wall, in (-1, 0.5] [-]. Assumed."""
    density: float = 920.0
    """Density of the wall [kg/m^3]. Assumed (polyethylene of low density)."""
    actuator_density: float = 0.0
    """Mass of actuator, tape or stoppers per length of the uninflated tube [kg/m]. Assumed (a bare tube)."""
    bending_stiffness: float | None = None
    """Bending stiffness EI as measured [N m^2]; None: of the inflated wall, `(E + P/S) pi r^3 t` as in [Troise 2021] (1)."""
    torsional_stiffness: float | None = None
    """Torsional stiffness GJ as measured [N m^2]; None: of the wall, `E / (2 (1 + nu)) 2 pi r^3 t`."""
    axial_stiffness: float | None = None
    """Axial stiffness EA as measured [N]; None: of the wall, `E 2 pi r t`."""
    chain: str = "sections"
    """Form of the equivalent rigid chain: "sections" or "lumped"."""
    elastic_sections: int = 20
    """Sections of constant strain, for chain="sections"; more than 20 make too many joints for PyBullet. They are too stiff by
    up to a twelfth of the squared angle that one of them turns, 6 % here: for sag take hinges, which err far less."""
    hinges: int = 24
    """Pairs of orthogonal springs, for chain="lumped"."""
    hinge_rule: str = "corrected"
    """Where the hinges stand, as in `PccArm`: in the middle of their sections ("midpoint"), or the first and the last 1/24 of a
    section nearer to the ends ("corrected")."""
    torsion: bool = True
    """Whether a lumped tube can twist: a torsional spring a hinge."""
    extension: bool = True
    """Whether a lumped tube can stretch: a sliding spring a hinge."""
    rgba: Sequence[float] | Sequence[Sequence[float]] = (0.30, 0.55, 0.75, 1.0)
    """Colour: red, green, blue, opacity in [0, 1]."""
    damping_time: float = 0.05
    """Damping of each spring joint over its stiffness, for simulators only [s]. Assumed."""
    base_mass: float = 0.5
    """Mass of the base, fixed to the world [kg]. Assumed; no effect on the statics."""
    allow_self_contact: bool = False
    """Whether a tube that runs into itself is accepted; `contact` tells where."""

    XACRO: ClassVar[str] = "helix_tube.urdf.xacro"
    """File in xacro/ that describes this robot."""

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, {}, _SINGLE, 1, "tubes")
        checked_actuator(self.contraction, self.angle, self.diameter)
        if self.wall_thickness > 0.05 * self.diameter:
            raise ParameterError("wall_thickness", self.wall_thickness, f"thin: at most a tenth of the radius, {self.radius} m")
        if not -1.0 < self.poisson_ratio <= 0.5:
            raise ParameterError("poisson_ratio", self.poisson_ratio, "in (-1, 0.5]")
        for name in ("bending_stiffness", "torsional_stiffness", "axial_stiffness"):
            if getattr(self, name) is not None:
                unit = "N" if name.startswith("axial") else "N m^2"
                object.__setattr__(self, name, positive_number(name, getattr(self, name), unit))
        choices = (("handedness", helix.HANDEDNESS), ("upright", UPRIGHT), ("chain", CHAINS), ("hinge_rule", HINGE_RULES))
        for name, options in choices:
            choice(name, getattr(self, name), options)
        for name in ("elastic_sections", "hinges"):
            object.__setattr__(self, name, positive_integer(name, getattr(self, name), MOST_SECTIONS))
        for name in ("torsion", "extension", "allow_self_contact"):
            if not isinstance(getattr(self, name), bool):
                raise ParameterError(name, getattr(self, name), "True or False")
        object.__setattr__(self, "rgba", colours(self.rgba, 1, "tubes"))
        if self.upright == "axis" and self.shape is not None and self.shape.centre_radius > _LARGEST_RADIUS * self.length:
            raise ParameterError("upright", self.upright, '"tube" for a helix so wide that the tube hardly bends')
        self._check_sections()
        if not self.allow_self_contact and self.shape is not None:
            helix.check_self_contact(self.shape, self.turns)

    @classmethod
    def from_design(cls, design: helix.HelixDesign, **fields: Any) -> HelixTube:
        """The tube of a design, with sections (and hinges) of about 40 degrees unless said otherwise, but at most 300 joints.

        Args:
            design: What `helix.design_grasp` or `helix.design_antenna` returns, or a `HelixDesign` of one's own.
            fields: The other fields.

        Returns:
            The tube.

        Raises:
            ParameterError: If `design` is something else, gives a field that is given too, or a value is out of range.
            SelfIntersection: If the tube would run into itself and `allow_self_contact` is not given.
        """
        if not isinstance(design, helix.HelixDesign):
            raise ParameterError("design", design, "a HelixDesign")
        given: dict[str, Any] = {name: getattr(design, name) for name in ("contraction", "angle", "diameter", "handedness")}
        given["length"] = design.tube_length
        twice = sorted(given.keys() & fields.keys())
        if twice:
            raise ParameterError(twice[0], fields[twice[0]], "left out: the design gives it")
        curvature, torsion = helix.actuator_curvature_torsion(design.contraction, design.angle, design.diameter)
        turning = math.hypot(curvature, torsion) * design.centre_length
        count = max(4, math.ceil(turning / _SECTION_TURN))
        counts = {"elastic_sections": min(count, MAX_JOINTS // 6), "hinges": min(count, MAX_JOINTS // 4)}
        return cls(**(counts | given | fields))

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
    def n_sections(self) -> int:
        """Sections of the chain, of constant strain or lumped."""
        return self.elastic_sections if self.chain == "sections" else self.hinges

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain; above 300 Pinocchio's workspace is refused."""
        return self.n_sections * (6 if self.chain == "sections" else 2 + self.torsion + self.extension)

    def grown(self, length: float) -> HelixTube:
        """The same tube grown to another length, with sections as long as before or a little shorter.

        Args:
            length: Length of the uninflated tube that has come out [m], positive.

        Returns:
            The tube; its `urdf()` is the robot of that length.

        Raises:
            ParameterError: If the length is not positive, or asks for more than 1000 sections.
            SelfIntersection: If the longer tube would run into itself.
        """
        share = positive_number("length", length, "m") / self.length
        each = {name: max(1, math.ceil(getattr(self, name) * share - 1e-9)) for name in ("elastic_sections", "hinges")}
        used = "elastic_sections" if self.chain == "sections" else "hinges"
        if each[used] > MOST_SECTIONS:
            raise ParameterError("length", length, f"so short that {MOST_SECTIONS} sections are enough, not {each[used]}")
        each = {name: min(count, MOST_SECTIONS) for name, count in each.items()}
        return dataclasses.replace(self, length=length, **each)

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        arguments = xacro_arguments(self)
        del arguments["allow_self_contact"]  # the description of such a tube is like any other
        return arguments

    def urdf(self) -> str:
        """Return the robot as URDF text, with its sections or springs inside.

        Raises:
            DescriptionError: If xacro refuses the parameters, e.g. sections too light to cut their tiny links from.
        """
        return expanded(self.XACRO, tuple(self.xacro_arguments().items()))

    def _check_sections(self) -> None:
        """Refuse sections of constant strain that the chain cannot carry."""
        if self.chain != "sections":
            return
        whole = (self.strains - [0.0, 0.0, 0.0, 1.0]) * self.centre_length
        turning = max(whole[1] / LARGEST_BENDING, abs(whole[2]) / math.pi)
        count, fewest = self.elastic_sections, max(1, math.ceil(turning))
        while fewest <= MOST_SECTIONS and not in_range(whole / fewest, self.centre_length / fewest):
            fewest += 1
        if fewest > MOST_SECTIONS:
            raise ParameterError("length", self.length, f"so short that {MOST_SECTIONS} sections are enough for its turns")
        if count < fewest:
            raise ParameterError("elastic_sections", count, f"at least {fewest} for this helix, rather more")


_SINGLE: Bounds = {
    "length": ("m", 0.0, True),
    "diameter": ("m", 0.0, True),
    "contraction": ("-", 0.0, True),
    "angle": ("rad", 0.0, False),
    "pressure": ("Pa", 0.0, False),
    "wall_thickness": ("m", 0.0, True),
    "young_modulus": ("Pa", 0.0, True),
    "poisson_ratio": ("-", -1.0, True),
    "density": ("kg/m^3", 0.0, True),
    "actuator_density": ("kg/m", 0.0, False),
    "damping_time": ("s", 0.0, False),
    "base_mass": ("kg", 1e-6, True),
}
