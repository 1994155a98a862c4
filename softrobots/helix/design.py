"""Designing a helix: from an object to grasp or an antenna to hold, to the actuator and the length of the tube.

A grasp wants the inner path on the object, an antenna the centre line on a cylinder; both want a rise per turn. Diameter of
the tube and turns are given. [Blumenschein 2018] (6, 7, 11) then tell contraction and angle of the actuator. Where such a tube
would run into itself, or nobody can make the actuator, the wish is refused, followed all the same, or moved to the nearest
helix that can be made (`softrobots.helix.nearest`): the caller chooses.
"""

from __future__ import annotations

import json
import math
import os
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.checks import choice, finite_number, non_negative_number, positive_number
from softrobots.errors import FileFormatError, ParameterError, SelfIntersection
from softrobots.files import as_path, new_file, write_atomically
from softrobots.helix.contact import SelfContact, self_contact
from softrobots.helix.nearest import Limits, WantedHelix, nearest_realisable, within
from softrobots.helix.shapes import HANDEDNESS, HelixShape, forward, inverse
from softrobots.helix.tube import centre_length, length_for_turns

ON_UNREALISABLE = ("error", "nearest", "warn")
"""What a design function does about a wish that cannot be made."""

_FORMAT = 1
_LARGEST_FILE = 1_000_000  # bytes
_LIMIT_ROUNDING = 1e-9  # how far contraction [-] or angle [rad] may pass a limit by rounding
_AGREEMENT = 1e-9  # relative: a saved length or radius against the one computed again


class Wish(NamedTuple):
    """What was asked for."""

    purpose: str
    """"grasp" or "antenna"."""
    path: str
    """Path whose radius was asked for: "inner" for a grasp, "centre" for an antenna."""
    radius: float
    """Radius of that path [m]."""
    turn_height: float
    """Rise of a turn [m]."""
    squeeze: float = 0.0
    """Radius of the object less `radius` [m]: how much thinner a grasp is made than what it holds."""


class Deviation(NamedTuple):
    """How far a design is from the wish."""

    radius: float
    """Radius of the path that was asked for, less the wish [m]."""
    turn_height: float
    """Rise of a turn, less the wish [m]."""
    distance: float
    """Both together, as `softrobots.helix.nearest` measures them: the relative change while it is small [-]."""


class DesignWarning(UserWarning):
    """A design that cannot be made, which the caller asked for all the same.

    Attributes:
        design: The `HelixDesign`; its `faults` and `contact` tell what is wrong.
    """

    def __init__(self, message: str, *, design: HelixDesign) -> None:
        """Say what is wrong, and keep the design."""
        super().__init__(message)
        self.design = design


@dataclass(frozen=True, eq=False)
class HelixDesign:
    """An actuator, a tube, the helix that they make, and how it differs from what was asked for.

    Raises:
        ParameterError: If a number is out of range, there is no such handedness, or there is a wish although the helix has no
            positive radius or rise.
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
    """What was asked for; None if the actuator itself was."""
    contraction_limits: Limits | None = None
    """Smallest and largest contraction that can be made, or None [-]."""
    angle_limits: Limits | None = None
    """Smallest and largest angle that can be made, or None [rad]."""
    shape: HelixShape = field(init=False)
    """The helix."""
    tube_length: float = field(init=False)
    """Length `Lt` of the uninflated tube [m]."""
    contact: SelfContact = field(init=False)
    """Where the tube comes nearest to itself."""

    def __post_init__(self) -> None:
        """Check the numbers and compute what follows from them."""
        numbers = {
            "contraction": positive_number("contraction", self.contraction, "-"),
            "angle": non_negative_number("angle", self.angle, "rad"),
            "diameter": positive_number("diameter", self.diameter, "m"),
            "turns": positive_number("turns", self.turns, "-"),
        }
        for name, number in numbers.items():
            object.__setattr__(self, name, number)
        choice("handedness", self.handedness, HANDEDNESS)
        object.__setattr__(self, "wish", _checked_wish(self.wish))
        object.__setattr__(self, "contraction_limits", _checked_limits("contraction_limits", self.contraction_limits, "-"))
        object.__setattr__(self, "angle_limits", _checked_limits("angle_limits", self.angle_limits, "rad"))
        shape = forward(self.contraction, self.angle, self.diameter)
        if self.wish is not None and not (shape.radius(self.wish.path) > 0.0 and shape.pitch > 0.0):
            raise ParameterError(
                "wish", self.wish, f"None for a helix without a radius or rise to compare it with, such as {shape}"
            )
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
        """How far the design is from the wish; None without a wish."""
        if self.wish is None:
            return None
        radius, rise = float(self.shape.radius(self.wish.path)), float(self.shape.turn_height)
        distance = math.hypot(math.log(radius / self.wish.radius), math.log(rise / self.wish.turn_height))
        return Deviation(radius - self.wish.radius, rise - self.wish.turn_height, distance)

    @property
    def faults(self) -> tuple[str, ...]:
        """Why the design cannot be made, one sentence each; empty if it can."""
        found = [str(self.contact)] if bool(self.contact.touches) else []
        return (*found, *_limits_passed(self))

    @property
    def realisable(self) -> bool:
        """Whether the tube is free of contact and the actuator within its limits."""
        return not self.faults

    def summary(self) -> str:
        """The design in words, one fact a line; lengths in millimetres, angles in degrees."""
        shape, degrees = self.shape, math.degrees(self.angle)
        lines = [
            f"Actuator: contraction {self.contraction:.4f}, angle {degrees:.3f} degrees, {self.handedness}-handed",
            f"Tube: diameter {_mm(self.diameter)}, length {_mm(self.tube_length)} uninflated",
            f"Helix: {self.turns:.3f} turns, rise {_mm(shape.turn_height)} a turn, {_mm(self.height)} in all",
            f"Radii: outer {_mm(shape.outer_radius)}, centre {_mm(shape.centre_radius)}, inner {_mm(shape.inner_radius)}",
            f"Centre line: {_mm(self.centre_length)} long",
            f"Contact: {self.contact}",
        ]
        if self.wish is not None and self.deviation is not None:
            wish, deviation = self.wish, self.deviation
            squeeze = f", {_mm(wish.squeeze)} less than the object" if wish.squeeze else ""
            lines += [
                f"Wish ({wish.purpose}): {wish.path} radius {_mm(wish.radius)}{squeeze}, rise {_mm(wish.turn_height)} a turn",
                f"Off the wish: radius {deviation.radius * 1e3:+.3f} mm, rise {deviation.turn_height * 1e3:+.3f} mm a turn, "
                f"{100.0 * deviation.distance:.3f} % together",
            ]
        lines += [f"CANNOT BE MADE: {fault}" for fault in self.faults]
        return "\n".join(lines)

    def __str__(self) -> str:
        """Return `summary()`."""
        return self.summary()

    def save(self, path: str | os.PathLike[str], overwrite: bool = False) -> Path:
        """Save the design as JSON: numbers in SI units and radians, full precision.

        Args:
            path: File to write.
            overwrite: Replace an existing file.

        Returns:
            The path of the file.

        Raises:
            ParameterError: If the path is none.
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If the file cannot be written.
        """
        target = new_file(path, overwrite=overwrite)
        document = {
            "softrobots_helix_design": _FORMAT,
            "contraction": self.contraction,
            "angle": self.angle,
            "diameter": self.diameter,
            "turns": self.turns,
            "handedness": self.handedness,
            "wish": None if self.wish is None else self.wish._asdict(),
            "contraction_limits": self.contraction_limits,
            "angle_limits": self.angle_limits,
            "computed": _computed(self),
        }
        text = json.dumps(document, indent=2, allow_nan=False) + "\n"
        write_atomically(target, lambda file: file.write(text.encode()))
        return target

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> HelixDesign:
        """Load a design saved by `save`; what follows from its numbers is computed again and compared.

        Args:
            path: The JSON file.

        Returns:
            The design.

        Raises:
            ParameterError: If the path is none.
            FileFormatError: If the file cannot be read, is not one of ours, or does not hold what it claims.
        """
        file = as_path("path", path)
        try:
            if file.stat().st_size > _LARGEST_FILE:
                raise ValueError(f"it has {file.stat().st_size} bytes; at most {_LARGEST_FILE} are read")
            document = json.loads(file.read_text(encoding="utf-8"))
            if document["softrobots_helix_design"] != _FORMAT:
                raise ValueError(f"it is in format {document['softrobots_helix_design']!r}; known: {_FORMAT}")
            names = ("contraction", "angle", "diameter", "turns", "handedness")
            limits = {name: document[name] and tuple(document[name]) for name in ("contraction_limits", "angle_limits")}
            design = cls(*(document[name] for name in names), wish=document["wish"] and Wish(**document["wish"]), **limits)
            for name, number in _computed(design).items():
                if not math.isclose(
                    number, document["computed"][name], rel_tol=_AGREEMENT, abs_tol=_AGREEMENT * design.diameter
                ):
                    raise ValueError(f"its {name} is {document['computed'][name]}, but its other numbers make {number}")
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            reason = f"it has no {error}" if isinstance(error, KeyError) else error
            raise FileFormatError(f"cannot read a helix design from {file}: {reason}") from error
        return design


def design_grasp(
    object_radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    squeeze: float = 0.0,
    handedness: str = "right",
    on_contact: str = "error",
    contraction_limits: Limits | None = None,
    angle_limits: Limits | None = None,
) -> HelixDesign:
    """Actuator and tube that wrap around an object: the inner path lies on it.

    Args:
        object_radius: Radius of the object, positive [m].
        turn_height: Rise of a turn along the object, positive [m].
        diameter: Diameter of the tube, positive [m].
        turns: Turns around the object, positive [-].
        squeeze: How much smaller the natural inner radius is made than the object, from 0 to below its radius [m]. A squeezed
            object is held (`grasp_force`), one that is just wrapped is not.
        handedness: "right" or "left".
        on_contact: What to do if the tube would run into itself or a limit is passed: "error" to raise, "nearest" to take the
            nearest helix that can be made (see `softrobots.helix.nearest`), "warn" to return the wish with its `faults` and
            `contact`, and issue a `DesignWarning`.
        contraction_limits: Smallest and largest contraction that can be made, within (0, 1]; None for no limit [-].
        angle_limits: Smallest and largest angle that can be made, within [0, pi/2); None for no limit [rad].

    Returns:
        The design.

    Raises:
        ParameterError: If an argument is out of range; if a limit is passed and `on_contact` is "error"; or if nothing within
            the limits can be made.
        SelfIntersection: If the tube would run into itself and `on_contact` is "error".
        StraightTube: If the helix is straight within rounding.
    """
    thickness = positive_number("object_radius", object_radius, "m")
    pressed = non_negative_number("squeeze", squeeze, "m")
    if pressed >= thickness:
        raise ParameterError("squeeze", squeeze, f"less than the radius of the object, {thickness} m")
    wish = Wish("grasp", "inner", thickness - pressed, positive_number("turn_height", turn_height, "m"), pressed)
    return _design(wish, diameter, turns, handedness, on_contact, contraction_limits, angle_limits)


def design_antenna(
    radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    handedness: str = "right",
    on_contact: str = "error",
    contraction_limits: Limits | None = None,
    angle_limits: Limits | None = None,
) -> HelixDesign:
    """Actuator and tube of a helical antenna: the centre line of the tube has the wanted radius.

    Args:
        radius: Radius of the centre line, positive [m].
        turn_height: Rise of a turn, positive [m].
        diameter: Diameter of the tube, positive [m].
        turns: Turns, positive [-].
        handedness: "right" or "left".
        on_contact: As in `design_grasp`.
        contraction_limits: As in `design_grasp` [-].
        angle_limits: As in `design_grasp` [rad].

    Returns:
        The design.

    Raises:
        ParameterError: As in `design_grasp`.
        SelfIntersection: As in `design_grasp`.
        StraightTube: As in `design_grasp`.
    """
    size = positive_number("radius", radius, "m")
    wish = Wish("antenna", "centre", size, positive_number("turn_height", turn_height, "m"))
    return _design(wish, diameter, turns, handedness, on_contact, contraction_limits, angle_limits)


def _design(
    wish: Wish,
    diameter: float,
    turns: float,
    handedness: str,
    on_contact: str,
    contraction_limits: Limits | None,
    angle_limits: Limits | None,
) -> HelixDesign:
    """The design of a wish, or of what is nearest to it."""
    choice("on_contact", on_contact, ON_UNREALISABLE)
    shares = _checked_limits("contraction_limits", contraction_limits, "-")
    angles = _checked_limits("angle_limits", angle_limits, "rad")
    tube, count = positive_number("diameter", diameter, "m"), positive_number("turns", turns, "-")
    wanted = WantedHelix(wish.path, wish.radius, wish.turn_height, tube, count)

    def of(shape: HelixShape, *, clipped: bool) -> HelixDesign:
        contraction, angle, _ = (float(value) for value in inverse(shape))
        if clipped:
            contraction = float(np.clip(contraction, *(shares or (contraction, contraction))))
            angle = float(np.clip(angle, *(angles or (angle, angle))))
        return HelixDesign(contraction, angle, tube, count, handedness, wish, shares, angles)

    design = of(wanted.shape, clipped=False)
    if design.realisable:
        return design
    if on_contact == "nearest":
        return of(nearest_realisable(wanted, shares, angles), clipped=True)
    if on_contact == "warn":
        warnings.warn(DesignWarning("; ".join(design.faults), design=design), stacklevel=3)
        return design
    advice = "on_contact='nearest' gives the nearest helix that can be made"
    if bool(design.contact.touches):
        raise SelfIntersection(f"{'; '.join(design.faults)}; {advice}", contact=design.contact)
    name = "angle_limits" if within(np.asarray(design.contraction), shares, _LIMIT_ROUNDING) else "contraction_limits"
    raise ParameterError(name, getattr(design, name), f"wide enough for the wish ({'; '.join(design.faults)}); {advice}")


def _computed(design: HelixDesign) -> dict[str, float]:
    """What follows from the numbers of a design, for the reader of its file."""
    return {
        "tube_length": design.tube_length,
        "outer_radius": float(design.shape.outer_radius),
        "inner_radius": float(design.shape.inner_radius),
        "pitch": float(design.shape.pitch),
    }


def _limits_passed(design: HelixDesign) -> list[str]:
    """One sentence for each limit that the actuator passes."""
    pairs = (
        (
            "contraction",
            design.contraction,
            design.contraction_limits,
            "the contraction is {:.4g}, which must be in [{:.4g}, {:.4g}]",
        ),
        ("angle", design.angle, design.angle_limits, "the angle is {:.4g} rad, which must be in [{:.4g}, {:.4g}] rad"),
    )
    return [
        sentence.format(value, *limits)
        for _, value, limits, sentence in pairs
        if limits is not None and not within(np.asarray(value), limits, _LIMIT_ROUNDING)
    ]


def _checked_limits(name: str, limits: Any, unit: str) -> Limits | None:
    """A pair of limits in order and in range, or None."""
    if limits is None:
        return None
    contraction = name == "contraction_limits"
    requirement = "a pair (low, high) " + ("in (0, 1]" if contraction else "in [0, pi/2)") + ", low not above high"
    if not isinstance(limits, tuple | list | np.ndarray) or len(limits) != 2:
        raise ParameterError(name, limits, requirement)
    low, high = (finite_number(name, value, unit) for value in limits)
    fits = 0.0 < low <= high <= 1.0 if contraction else 0.0 <= low <= high < 0.5 * math.pi
    if not fits:
        raise ParameterError(name, limits, requirement)
    return low, high


def _checked_wish(wish: Any) -> Wish | None:
    """A wish whose numbers are finite and positive, or None."""
    if wish is None:
        return None
    if not isinstance(wish, Wish):
        raise ParameterError("wish", wish, "a Wish, or None")
    purpose = choice("wish.purpose", wish.purpose, ("grasp", "antenna"))
    path = choice("wish.path", wish.path, ("inner" if purpose == "grasp" else "centre",))
    radius, rise = positive_number("wish.radius", wish.radius, "m"), positive_number("wish.turn_height", wish.turn_height, "m")
    return Wish(purpose, path, radius, rise, non_negative_number("wish.squeeze", wish.squeeze, "m"))


def _mm(length: Any) -> str:
    return f"{float(length) * 1e3:.2f} mm"
