"""A helix design: actuator and tube, the resulting helix, its deviation from the requirement, and its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, choice, instance_of, non_negative_number, positive_number
from softrobots.core.errors import ParameterError
from softrobots.core.result_file import KINDS, Kind
from softrobots.core.summary import Part, Summarised
from softrobots.helix.contact import SelfContact, self_contact
from softrobots.helix.shapes import HANDEDNESS, HelixShape, forward
from softrobots.helix.tube import centre_length, length_for_turns

_SAVED = ("contraction", "angle", "diameter", "turns", "handedness")


class Wish(NamedTuple):
    """The requirement of a design: radius of a path and rise of a turn."""

    purpose: str
    """"grasp" or "antenna"."""
    path: str
    """Path with the required radius: "inner" for a grasp, "centre" for an antenna."""
    radius: float
    """Radius of that path [m]."""
    turn_height: float
    """Rise of a turn [m]."""
    squeeze: float = 0.0
    """Radius of the object minus `radius` [m]."""


class Deviation(NamedTuple):
    """Difference of a design from its requirement."""

    radius: float
    """Radius of the path minus the required one [m]."""
    turn_height: float
    """Rise of a turn minus the required one [m]."""
    distance: float
    """Both together, `m` of `softrobots.helix.inverse_design`: the relative change while it is small [-]."""


class DesignWarning(UserWarning):
    """A design that cannot be built, returned because of `on_unrealisable="warn"`.

    Attributes:
        design: The `HelixDesign`; see its `contact`.
    """

    def __init__(self, message: str, *, design: HelixDesign) -> None:
        super().__init__(message)
        self.design = design


@dataclass(frozen=True, eq=False, repr=False)
class HelixDesign(Summarised):
    """An actuator, a tube, the resulting helix, and its deviation from the requirement.

    Raises:
        ParameterError: If a number is out of range, the handedness is unknown, or a requirement is given although the helix has
            no positive radius or rise.
        StraightTube: If the actuator leaves the tube straight.
    """

    contraction: float
    """Contracted over original length of the actuator `lambda`, in (0, 1] [-]."""
    angle: float
    """Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad]."""
    diameter: float
    """Diameter `D` of the tube [m]."""
    turns: float
    """Turns of the helix [-]."""
    handedness: str = "right"
    """"right" or "left"."""
    wish: Wish | None = None
    """The requirement; None if the actuator was given instead."""
    shape: HelixShape = field(init=False)
    """The helix."""
    tube_length: float = field(init=False)
    """Length `Lt` of the uninflated tube [m]."""
    contact: SelfContact = field(init=False)
    """Clearance of the tube from itself."""

    def __post_init__(self) -> None:
        """Check the numbers and compute the derived ones."""
        checked = {
            "contraction": positive_number("contraction", self.contraction, "-"),
            "angle": non_negative_number("angle", self.angle, "rad"),
            "diameter": positive_number("diameter", self.diameter, "m"),
            "turns": positive_number("turns", self.turns, "-"),
            "handedness": choice("handedness", self.handedness, HANDEDNESS),
            "wish": _checked_wish(self.wish),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        shape = forward(self.contraction, self.angle, self.diameter)
        if self.wish is not None and not (shape.radius(self.wish.path) > 0.0 and shape.pitch > 0.0):
            raise ParameterError("wish", self.wish, f"None for a helix without radius or rise to compare it with: {shape!r}")
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "tube_length", float(length_for_turns(shape, self.angle, self.turns)))
        object.__setattr__(self, "contact", self_contact(shape, self.turns))

    @property
    def height(self) -> float:
        """Rise of the whole helix along its axis [m]."""
        return self.turns * float(self.shape.turn_height)

    @property
    def centre_length(self) -> float:
        """Length of the centre line of the actuated tube [m]."""
        return float(centre_length(self.contraction, self.angle, self.tube_length))

    @property
    def deviation(self) -> Deviation | None:
        """Difference from the requirement; None without a requirement."""
        if self.wish is None:
            return None
        radius, rise = float(self.shape.radius(self.wish.path)), float(self.shape.turn_height)
        relative = float(distance(radius / self.wish.radius, rise / self.wish.turn_height))
        return Deviation(radius - self.wish.radius, rise - self.wish.turn_height, relative)

    @property
    def realisable(self) -> bool:
        """Whether the tube is free of contact."""
        return not bool(self.contact.touches)

    def summary_parts(self) -> list[Part]:
        """Return a description, one fact a line; lengths in millimetres, angles in degrees."""
        shape, degrees = self.shape, math.degrees(self.angle)
        lines = [
            f"Actuator: contraction {self.contraction:.4f}, angle {degrees:.3f} degrees, {self.handedness}-handed",
            f"Tube: diameter {in_mm(self.diameter)}, length {in_mm(self.tube_length)} uninflated",
            f"Helix: {self.turns:.3f} turns, rise {in_mm(shape.turn_height)} a turn, {in_mm(self.height)} in all",
            f"Radii: outer {in_mm(shape.outer_radius)}, centre {in_mm(shape.centre_radius)}, inner {in_mm(shape.inner_radius)}",
            f"Centre line: {in_mm(self.centre_length)} long",
            f"Contact: {self.contact}",
        ]
        if self.wish is not None and self.deviation is not None:
            wish, deviation = self.wish, self.deviation
            squeeze = f", {in_mm(wish.squeeze)} less than the object" if wish.squeeze else ""
            lines += [
                f"Required ({wish.purpose}): {wish.path} radius {in_mm(wish.radius)}{squeeze}, "
                f"rise {in_mm(wish.turn_height)} a turn",
                f"Deviation: radius {deviation.radius * 1e3:+.3f} mm, rise {deviation.turn_height * 1e3:+.3f} mm a turn, "
                f"distance {deviation.distance:.4g}",
            ]
        lines += [] if self.realisable else [f"CANNOT BE MADE: {self.contact}"]
        return ["\n".join(lines)]


def distance(radius_ratio: Any, height_ratio: Any) -> FloatArray:
    """Distance of two helices from the ratios of their radii and turn heights, positive: `hypot` of the logarithms."""
    return np.asarray(np.hypot(np.log(radius_ratio), np.log(height_ratio)))


def _checked_wish(wish: Any) -> Wish | None:
    """A requirement with checked numbers, or None if that is given."""
    if wish is None:
        return None
    instance_of("wish", wish, Wish, "a Wish, or None")
    purpose = choice("wish.purpose", wish.purpose, ("grasp", "antenna"))
    path = choice("wish.path", wish.path, ("inner" if purpose == "grasp" else "centre",))
    radius, rise = positive_number("wish.radius", wish.radius, "m"), positive_number("wish.turn_height", wish.turn_height, "m")
    return Wish(purpose, path, radius, rise, non_negative_number("wish.squeeze", wish.squeeze, "m"))


def in_mm(length: Any) -> str:
    """Return a length [m] as text in millimetres."""
    return f"{float(length) * 1e3:.2f} mm"


def _packed(design: HelixDesign) -> dict[str, Any]:
    """What a file holds."""
    wish = {} if design.wish is None else {f"wish_{name}": value for name, value in design.wish._asdict().items()}
    return {name: np.array(value) for name, value in ({name: getattr(design, name) for name in _SAVED} | wish).items()}


def _unpacked(fields: Mapping[str, Any]) -> HelixDesign:
    """Design of named arrays."""
    wish = Wish(*(fields[f"wish_{name}"].item() for name in Wish._fields)) if "wish_purpose" in fields else None
    return HelixDesign(**{name: fields[name].item() for name in _SAVED}, wish=wish)


KINDS.update(helix_design=Kind(HelixDesign, _packed, _unpacked))
