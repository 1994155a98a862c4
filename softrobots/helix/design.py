"""Designing a helix: from an object to grasp or an antenna to hold, to the actuator and the length of the tube.

A grasp wants the inner path on the object, an antenna the centre line on a cylinder; both want a rise per turn. Diameter of
the tube and turns are given. [Blumenschein 2018] (6, 7, 11) then tell contraction and angle of the actuator. Where such a tube
would run into itself, or nobody can make the actuator, the wish is refused, followed all the same, or moved to the nearest
helix that can be made (`softrobots.helix.nearest`): the caller chooses.
"""

from __future__ import annotations

import warnings

import numpy as np

from softrobots.core.checks import choice, non_negative_number, positive_number
from softrobots.core.errors import ParameterError, SelfIntersection
from softrobots.helix.helix_design import LIMIT_ROUNDING, DesignWarning, HelixDesign, Wish, checked_limits
from softrobots.helix.nearest import Limits, WantedHelix, nearest_realisable, within
from softrobots.helix.shapes import HelixShape, inverse

ON_UNREALISABLE = ("error", "nearest", "warn")
"""What a design function does about a wish that cannot be made."""

_EXTREME = 1e6  # beyond this many diameters, or below that part of one, rounding takes the helix


def design_grasp(
    object_radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    squeeze: float = 0.0,
    handedness: str = "right",
    on_unrealisable: str = "error",
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
        on_unrealisable: What to do if the tube would run into itself or a limit is passed: one of `ON_UNREALISABLE`. "error" to
            raise, "nearest" to take the nearest helix that can be made (see `softrobots.helix.nearest`), "warn" to return the
            wish with its `faults` and `contact`, and issue a `DesignWarning`.
        contraction_limits: Smallest and largest contraction that can be made, within (0, 1]; None for no limit [-].
        angle_limits: Smallest and largest angle that can be made, within [0, pi/2); None for no limit [rad].

    Returns:
        The design.

    Raises:
        ParameterError: If an argument is out of range; if a limit is passed and `on_unrealisable` is "error"; or if nothing
            within the limits can be made.
        SelfIntersection: If the tube would run into itself and `on_unrealisable` is "error".
        StraightTube: If the helix is straight within rounding.
    """
    thickness = positive_number("object_radius", object_radius, "m")
    pressed = non_negative_number("squeeze", squeeze, "m")
    if pressed >= thickness:
        raise ParameterError("squeeze", squeeze, f"less than the radius of the object, {thickness} m")
    wish = Wish("grasp", "inner", thickness - pressed, positive_number("turn_height", turn_height, "m"), pressed)
    return _design(wish, diameter, turns, handedness, on_unrealisable, contraction_limits, angle_limits)


def design_antenna(
    radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    handedness: str = "right",
    on_unrealisable: str = "error",
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
        on_unrealisable: As in `design_grasp`.
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
    return _design(wish, diameter, turns, handedness, on_unrealisable, contraction_limits, angle_limits)


def _design(
    wish: Wish,
    diameter: float,
    turns: float,
    handedness: str,
    on_unrealisable: str,
    contraction_limits: Limits | None,
    angle_limits: Limits | None,
) -> HelixDesign:
    """The design of a wish, or of what is nearest to it."""
    choice("on_unrealisable", on_unrealisable, ON_UNREALISABLE)
    shares = checked_limits("contraction_limits", contraction_limits, "-")
    angles = checked_limits("angle_limits", angle_limits, "rad")
    tube, count = positive_number("diameter", diameter, "m"), positive_number("turns", turns, "-")
    for name, length in (("radius", wish.radius), ("turn_height", wish.turn_height)):
        if not tube / _EXTREME <= length <= tube * _EXTREME:
            raise ParameterError(name, length, f"within a factor of {_EXTREME:g} of the diameter {tube} m")
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
    if on_unrealisable == "nearest":
        return of(nearest_realisable(wanted, shares, angles), clipped=True)
    if on_unrealisable == "warn":
        warnings.warn(DesignWarning("; ".join(design.faults), design=design), stacklevel=3)
        return design
    advice = "on_unrealisable='nearest' gives the nearest helix that can be made"
    if bool(design.contact.touches):
        raise SelfIntersection(f"{'; '.join(design.faults)}; {advice}", contact=design.contact)
    name = "angle_limits" if within(np.asarray(design.contraction), shares, LIMIT_ROUNDING) else "contraction_limits"
    raise ParameterError(name, getattr(design, name), f"wide enough for the wish ({'; '.join(design.faults)}); {advice}")
