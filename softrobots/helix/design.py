"""A helix design: actuator and tube, the resulting helix, its deviation from the requirement, and its JSON file."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_number, instance_of, listed, non_negative_number, positive_number
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import as_path, write_text
from softrobots.core.json_text import read_json
from softrobots.core.summary import Part, Summarised
from softrobots.helix.contact import BoolArray, SelfContact, self_contact
from softrobots.helix.shapes import HANDEDNESS, HelixShape, forward
from softrobots.helix.tube import centre_length, length_for_turns

Limits = tuple[float, float]
"""Smallest and largest value."""

LIMIT_ROUNDING = 1e-9
"""How far contraction [-] and angle [rad] may pass a limit by rounding."""

_FORMAT = 1
_SAVED = ("contraction", "angle", "diameter", "turns", "handedness", "contraction_limits", "angle_limits")
_LARGEST_FILE = 1_000_000  # bytes
_AGREEMENT = 1e-9  # relative: a saved length or radius against the one computed again


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
        design: The `HelixDesign`; see its `faults` and `contact`.
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
    contraction_limits: Limits | None = None
    """Smallest and largest contraction that the actuator can have, or None [-]."""
    angle_limits: Limits | None = None
    """Smallest and largest angle that the actuator can have, or None [rad]."""
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
            "contraction_limits": checked_limits("contraction_limits", self.contraction_limits, "-"),
            "angle_limits": checked_limits("angle_limits", self.angle_limits, "rad"),
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
    def faults(self) -> tuple[str, ...]:
        """Reasons why the design cannot be built, one sentence each; empty if it can."""
        sentences = [str(self.contact)] if bool(self.contact.touches) else []
        for name, unit, limits in (("contraction", "", self.contraction_limits), ("angle", " rad", self.angle_limits)):
            value = getattr(self, name)
            if limits is not None and not within(np.asarray(value), limits, LIMIT_ROUNDING):
                sentences.append(f"the {name} is {value:.4g}{unit}, which must be in [{limits[0]:.4g}, {limits[1]:.4g}]{unit}")
        return tuple(sentences)

    @property
    def realisable(self) -> bool:
        """Whether the tube is free of contact and the actuator within its limits."""
        return not self.faults

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
        lines += [f"CANNOT BE MADE: {fault}" for fault in self.faults]
        return ["\n".join(lines)]

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Save the design as JSON: numbers in SI units and radians, full precision.

        Args:
            path: File to write.
            overwrite: Replace an existing file.

        Returns:
            The path of the file.

        Raises:
            ParameterError: If `path` is not a path.
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If the file cannot be written.
        """
        document = {
            "softrobots_helix_design": _FORMAT,
            **{name: getattr(self, name) for name in _SAVED},
            "wish": None if self.wish is None else self.wish._asdict(),
            "computed": _computed(self),
        }
        return write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n", overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> HelixDesign:
        """Load a design saved by `save`; derived numbers are computed again and compared with those in the file.

        Args:
            path: The JSON file.

        Returns:
            The design.

        Raises:
            ParameterError: If `path` is not a path.
            FileFormatError: If the file cannot be read, was not written by `save`, or its derived numbers do not match.
        """
        file = as_path("path", path)
        document = read_json(file, _LARGEST_FILE)
        try:
            if document["softrobots_helix_design"] != _FORMAT:
                raise ValueError(f"it is in format {document['softrobots_helix_design']!r}; format {_FORMAT} is required")
            wish = document["wish"] and Wish(**document["wish"])
            design = cls(**{name: document[name] for name in _SAVED}, wish=wish)
            for name, number in _computed(design).items():
                claimed, rounding = document["computed"][name], _AGREEMENT * design.diameter
                if not math.isclose(number, claimed, rel_tol=_AGREEMENT, abs_tol=rounding):
                    raise ValueError(f"its {name} is {claimed}, but {number} follows from its other numbers")
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            reason = f"it has no {error}" if isinstance(error, KeyError) else error
            raise FileFormatError(f"cannot read a helix design from {file}: {reason}") from error
        return design


def _computed(design: HelixDesign) -> dict[str, float]:
    """Derived numbers that are written to the file of a design."""
    return {
        "tube_length": design.tube_length,
        "outer_radius": float(design.shape.outer_radius),
        "inner_radius": float(design.shape.inner_radius),
        "pitch": float(design.shape.pitch),
    }


def distance(radius_ratio: Any, height_ratio: Any) -> FloatArray:
    """Distance of two helices from the ratios of their radii and turn heights, positive: `hypot` of the logarithms."""
    return np.asarray(np.hypot(np.log(radius_ratio), np.log(height_ratio)))


def within(value: FloatArray, limits: Limits | None, rounding: float) -> BoolArray:
    """Whether values lie within limits, up to rounding; always if the limits are None."""
    if limits is None:
        return np.ones(np.shape(value), dtype=np.bool_)
    return np.asarray((value >= limits[0] - rounding) & (value <= limits[1] + rounding))


def checked_limits(name: str, limits: Any, unit: str) -> Limits | None:
    """Return limits as a pair in order and in range, or None if they are None, or raise ParameterError."""
    if limits is None:
        return None
    contraction = name == "contraction_limits"
    requirement = "a pair (low, high) " + ("in (0, 1]" if contraction else "in [0, pi/2) rad") + ", low not above high"
    low, high = (finite_number(name, value, unit) for value in listed(name, limits, 2, requirement))
    fits = 0.0 < low <= high <= 1.0 if contraction else 0.0 <= low <= high < 0.5 * math.pi
    if not fits:
        raise ParameterError(name, limits, requirement)
    return low, high


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
