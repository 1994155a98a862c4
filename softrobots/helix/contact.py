r"""Self-contact of a helical tube: neighbouring turns overlap, or the tube bends more sharply than it is thick.

Two points of the centre line, a turn angle `s` apart, have the distance

.. math:: d(s) = \sqrt{2 R_c^2 (1 - \cos s) + b^2 s^2}

Neighbouring turns are closest at its local minimum, a little below `s = 2 pi`. This minimum, and the maximum before it, exist
only if :math:`b^2 < 0.2172 R_c^2`: steeper helices have no neighbouring turns that could touch. An endless tube of circular
sections is in contact if :math:`d < D` at the minimum, or if its centre line bends with a radius below `D/2`; there are no
other critical pairs of points. The ends of a shorter tube count as hemispheres, as its everted tip is one.

[Blumenschein 2018] says of its Figure 7 that shapes of small pitch intersect themselves; the equations here are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, common_shape, positive_array, read_only
from softrobots.core.errors import ParameterError, SelfIntersection
from softrobots.helix.paths import curvature_torsion
from softrobots.helix.shapes import HelixShape, checked_angle, checked_shape

BoolArray = NDArray[np.bool_]

_ROUNDING = 1e-9  # of the diameter: a tube that just touches is not in contact
_MERGED = 1.789775849272223  # 2 pi minus the first root of tan s = s above pi, where minimum and maximum of d(s) merge
_STEEPEST = 0.21723362821122166  # (b/Rc)^2 there
_STEEPEST_ANGLE = 0.9760110449  # actuator angle where turns that just touch are that steep: 55.92 degrees [rad]
_HALVINGS = 64  # from any bracket here to the last digit


@dataclass(frozen=True, eq=False)
class SelfContact:
    """Clearance of a tube from itself, or of several tubes: read-only arrays of one shape."""

    diameter: FloatArray
    """Diameter of the tube [m]."""
    has_neighbours: BoolArray
    """Whether the tube has neighbouring turns: its helix is flat enough and the tube long enough."""
    turn_angle: FloatArray
    """Turn angle between the closest points of neighbouring turns [rad]; 2 pi where there are none."""
    turn_distance: FloatArray
    """Distance of the centre lines there [m]; without neighbouring turns the rise of a turn, which has no meaning then."""
    curvature: FloatArray
    """Curvature of the centre line [1/m]."""

    @property
    def turn_clearance(self) -> FloatArray:
        """Gap between the walls of neighbouring turns, `turn_distance - diameter` [m]: negative where they overlap."""
        return np.asarray(self.turn_distance - self.diameter)

    @property
    def fold_margin(self) -> FloatArray:
        """Ratio of innermost wall line to centre line in length, `1 - curvature D/2` [-]; negative in a fold."""
        return np.asarray(1.0 - 0.5 * self.diameter * self.curvature)

    @property
    def touching_turns(self) -> BoolArray:
        """Whether neighbouring turns overlap; turns that just touch do not."""
        return np.asarray(self.has_neighbours & (self.turn_clearance < -_ROUNDING * self.diameter))

    @property
    def folding(self) -> BoolArray:
        """Whether the centre line bends with a radius below half the diameter, so that neighbouring sections intersect."""
        return np.asarray(self.fold_margin < -_ROUNDING)

    @property
    def touches(self) -> BoolArray:
        """Whether the tube runs into itself in either way, so that it cannot be built."""
        return np.asarray(self.touching_turns | self.folding)

    def describe(self) -> str:
        """Return a sentence with place and amount; for several tubes, their number and the worst one."""
        margin = np.where(self.has_neighbours, self.turn_clearance / self.diameter, self.fold_margin)
        margin = np.minimum(margin, self.fold_margin)
        if margin.ndim == 0:
            return self._sentence(())
        if margin.size == 0:
            return "there are no tubes"
        worst = tuple(int(index) for index in np.unravel_index(int(np.argmin(margin)), margin.shape))
        count = f"{np.count_nonzero(self.touches)} of {margin.size} tubes run into themselves"
        return f"{count}; the tightest, at index {worst}: {self._sentence(worst)}"

    __str__ = describe

    def _sentence(self, index: tuple[int, ...]) -> str:
        """Sentence about one tube."""
        diameter, gap = f"{self.diameter[index]:.4g} m", float(self.turn_clearance[index])
        turns = f"the centre lines of neighbouring turns are {self.turn_distance[index]:.4g} m apart"
        faults = []
        if self.touching_turns[index]:
            faults.append(f"{turns}, {-gap:.3g} m less than the diameter of {diameter}")
        if self.folding[index]:
            radius = f"{1.0 / self.curvature[index]:.4g} m"
            faults.append(f"its centre line bends with a radius of {radius}, less than half the diameter of {diameter}")
        if faults:
            return "the tube runs into itself: " + ", and ".join(faults)
        if not self.has_neighbours[index]:
            return "the tube does not touch itself: it has no neighbouring turns"
        return f"the tube does not touch itself: {turns}, {abs(gap):.3g} m more than the diameter of {diameter}"


def self_contact(shape: HelixShape, turns: Any = math.inf) -> SelfContact:
    """Return the clearance of a tube from itself; see the module.

    Args:
        shape: The helix, shape (...).
        turns: Turns of the tube, positive, of a shape that broadcasts with that of the helix; infinite for an endless tube [-].

    Returns:
        The clearances, of the common shape.

    Raises:
        ParameterError: If `shape` is not a `HelixShape`, the turns are not positive, or the shapes do not broadcast.
    """
    shape = checked_shape(shape)
    available = 2.0 * np.pi * _checked_turns(turns)  # turn angle between the ends of the tube
    common = common_shape("turns", shape.shape, available.shape)
    radius, pitch = shape.centre_radius, shape.pitch
    flat = pitch < math.sqrt(_STEEPEST) * radius
    slope = np.where(flat, pitch / np.where(flat, radius, 1.0), 0.0) ** 2

    def missing(short: FloatArray) -> FloatArray:
        """Zero where d(s) is stationary, `s = 2 pi - short`; positive between its maximum and its minimum."""
        return np.asarray(np.sin(short) - slope * (2.0 * np.pi - short))

    merged = np.full(radius.shape, _MERGED)
    # x (sin(m)/m) <= sin x <= x up to m = _MERGED
    minimum = _bisect(missing, 2.0 * np.pi * slope / (1.0 + slope), np.minimum(11.6 * slope, merged))
    maximum = _bisect(lambda short: -missing(short), merged, np.full(radius.shape, np.pi))
    short = np.maximum(minimum, 2.0 * np.pi - available)
    neighbours = np.broadcast_to(flat, common) & (short <= maximum)
    short = np.where(neighbours, short, 0.0)
    angle = 2.0 * np.pi - short

    def broadcast(values: NDArray[Any]) -> NDArray[Any]:
        return read_only(np.array(np.broadcast_to(values, common)))

    return SelfContact(
        diameter=broadcast(shape.diameter),
        has_neighbours=broadcast(neighbours),
        turn_angle=broadcast(angle),
        turn_distance=broadcast(np.hypot(2.0 * radius * np.sin(0.5 * short), pitch * angle)),
        curvature=broadcast(curvature_torsion(shape)[0]),
    )


def check_self_contact(shape: HelixShape, turns: Any = math.inf) -> SelfContact:
    """Raise if a tube runs into itself; `self_contact` tells it without an error.

    Args:
        shape: The helix, shape (...).
        turns: Turns of the tube, as in `self_contact` [-].

    Returns:
        As `self_contact`.

    Raises:
        ParameterError: If `shape` is not a `HelixShape`, the turns are not positive, or the shapes do not broadcast.
        SelfIntersection: If any of the tubes runs into itself.
    """
    contact = self_contact(shape, turns)
    if np.any(contact.touches):
        raise SelfIntersection(f"{contact}; contraction_limit gives the smallest possible contraction", contact=contact)
    return contact


def contraction_limit(angle: Any, diameter: Any = 1.0) -> FloatArray:
    r"""Return the smallest contraction at which an endless tube does not run into itself; exact.

    Turns just touch where, with :math:`\epsilon = 2\pi - s` at the minimum of `d(s)`,

    .. math:: g = \frac{\sin\epsilon}{2\pi - \epsilon}, \quad
       u^2 = \sin^2\frac\epsilon2 + \frac{2\pi - \epsilon}{4}\sin\epsilon, \quad
       \lambda e^{2i\theta} = \frac{1 + i\sqrt g - u}{1 + i\sqrt g + u}

    a curve with one contraction at every angle up to 55.9 degrees. The tube folds where :math:`\lambda < -\cos 2\theta`, which
    is the stricter condition from 50.65 degrees on. At every angle, contractions above the limit are free of contact and those
    below it are not.

    Args:
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive; the limit does not depend on it [m].

    Returns:
        Contraction, the common shape of the arguments [-]; 1 at angle 0, where the endless tube lies on itself in a plane.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    angles, diameters = checked_angle(angle), positive_array("diameter", diameter, "m")
    shape = common_shape("diameter", angles.shape, diameters.shape)

    def beyond(short: FloatArray) -> FloatArray:
        """Angle of the actuator on the curve minus the given one."""
        steep, width = _just_touching(short)
        return np.asarray(0.5 * np.arctan2(2.0 * width * steep, 1.0 + steep**2 - width**2) - angles)

    # On the curve the angle is between 0.5 and 1.03 times epsilon.
    steep, width = _just_touching(_bisect(beyond, np.minimum(0.9 * angles, _MERGED), np.minimum(2.1 * angles, _MERGED)))
    turns_touch = np.hypot(1.0 - width, steep) / np.hypot(1.0 + width, steep)
    turns_touch = np.where(angles < _STEEPEST_ANGLE, turns_touch, 0.0)
    limit = np.maximum(turns_touch, -np.cos(2.0 * angles))
    return np.array(np.broadcast_to(limit, shape))


def simple_contraction_limit(angle: Any) -> FloatArray:
    r"""Return the smallest contraction at which a turn rises by a diameter: the rule :math:`2\pi b \ge D`.

    .. math:: \lambda \ge q - \sqrt{q^2 - 1} = \frac{1}{q + \sqrt{q^2 - 1}}, \qquad q = \cos 2\theta + \pi\sin 2\theta

    Turns are closer to each other than they rise, so the limit of the rule is a little too low: by 0.0011 at 2.5 degrees,
    0.0020 at 5, 0.0032 at 10 and 0.0115 at 45. It ignores folds, which decide from 50.65 degrees on.

    Args:
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].

    Returns:
        Contraction, the shape of `angle` [-]; 1 where every contraction below 1 violates the rule: at angle 0, and from
        `tan(theta) = pi` on (72.3 degrees), where the actuator of the straight tube rises by less than a diameter a turn.

    Raises:
        ParameterError: If the angle is out of range.
    """
    angles = checked_angle(angle)
    above = np.maximum(2.0 * np.sin(angles) * (np.pi * np.cos(angles) - np.sin(angles)), 0.0)  # q - 1
    return np.asarray(1.0 / (1.0 + above + np.sqrt(above * (above + 2.0))))


def _just_touching(short: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`b/Rc` and `D/(2 Rc)` of turns that just touch, where the distance has its minimum at `2 pi - short`."""
    steep = np.sqrt(np.sin(short) / (2.0 * np.pi - short))
    width = np.sqrt(np.sin(0.5 * short) ** 2 + 0.25 * (2.0 * np.pi - short) * np.sin(short))
    return np.asarray(steep), np.asarray(width)


def _bisect(function: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray) -> FloatArray:
    """Root of a function that increases from `low` to `high`, by bisection to the last digit."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        above = function(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray(0.5 * (low + high))


def _checked_turns(turns: Any) -> FloatArray:
    """Turns as an array: positive, or infinite."""
    try:
        endless = np.isposinf(np.asarray(turns))
        if not np.any(endless):
            return positive_array("turns", turns, "-")
        return positive_array("turns", np.where(endless, 2.0, turns), "-")  # a second turn is all that neighbours need
    except Exception as error:  # an object of the caller may raise anything; ParameterError shall show the original value
        raise ParameterError("turns", turns, "positive numbers, or infinite for an endless tube [-]") from error
