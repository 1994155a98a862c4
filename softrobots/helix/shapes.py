r"""Helical actuation in closed form: from contraction and angle of the actuator to radii and pitch of the helix, and back.

An inflated tube of diameter `D` wrinkles along an actuator that runs around it at the angle `theta` to its axis and contracts
to the share `lambda` of its length; the line opposite keeps its length. Tube, actuator (inner path) and opposite line (outer
path) become helices about one axis with radii `Rc`, `Ri`, `Ro` and the common pitch `b` [m/rad]. With
:math:`\zeta = \lambda e^{2i\theta}`

.. math:: R_o + i b = \frac{D}{1 - \zeta}, \qquad R_i + i b = \frac{D\,\zeta}{1 - \zeta}, \qquad
   R_c + i b = \frac{D\,(1 + \zeta)}{2\,(1 - \zeta)}

which is (12) of the paper without its 0/0; `1 - zeta` is taken as `(1 - lambda) + 2 lambda sin^2 theta - i lambda sin 2theta`,
so that no digits are lost near straight. All is vectorised: numbers and arrays broadcast.

References:
    [Blumenschein 2018]: L. H. Blumenschein, N. S. Usevitch, B. H. Do, E. W. Hawkes, A. M. Okamura, Helical Actuation on a Soft
        Inflated Robot Body, RoboSoft 2018. Its (16) prints both radii one diameter too small; (12) and (15) hold as printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import LARGEST, FloatArray, choice, common_shape, finite_array, positive_array, read_only
from softrobots.core.errors import ParameterError, StraightTube
from softrobots.core.summary import Summarised

PATHS = ("inner", "centre", "outer")
"""The actuator, the centre line of the tube, and the line opposite the actuator."""

HANDEDNESS = ("right", "left")
"""Handedness of the helix; a right-handed one rises as it turns anticlockwise seen from above."""

CONTRACTION_RANGE = "in (0, 1]: contracted over original length"
"""Requirement on a contraction, for errors."""

ANGLE_RANGE = "in [0, pi/2) rad (5 degrees are 0.0873 rad)"
"""Requirement on the angle of an actuator, for errors."""

_ROUNDING = 1e-12  # of a radius, as a share of the diameter
_SMALLEST = LARGEST**-3  # radius or pitch [m]: `forward` returns none below it, and curvatures stay finite


@dataclass(frozen=True, eq=False, repr=False)
class HelixShape(Summarised):
    """Shape of a tube bent into a helix, or of several of them: three read-only arrays of one shape.

    Numbers and arrays are accepted; they are broadcast to their common shape.

    Raises:
        ParameterError: If a number is not finite or no actuator produces the shape: the outer radius must exceed the inner one,
            which must be at least minus the outer one; the pitch must not be negative, and must be positive if the inner radius
            is not; no positive length may be below 1e-90 m.
    """

    outer_radius: FloatArray
    """Radius `Ro` of the path opposite the actuator [m]."""
    inner_radius: FloatArray
    """Radius `Ri` of the actuator's path [m]; negative where that lies beyond the axis of the helix, opposite the outer one."""
    pitch: FloatArray
    """Normalised pitch `b`: rise per turn angle [m/rad], the same for all paths."""

    def __post_init__(self) -> None:
        """Check, broadcast and freeze the three arrays."""
        outer = finite_array("outer_radius", self.outer_radius, None, "m")
        inner = finite_array("inner_radius", self.inner_radius, None, "m")
        pitch = finite_array("pitch", self.pitch, None, "m/rad")
        shape = common_shape("pitch", outer.shape, inner.shape, pitch.shape)
        outer, inner, pitch = (np.array(np.broadcast_to(values, shape)) for values in (outer, inner, pitch))
        if np.any(outer - inner < _SMALLEST):
            raise ParameterError("inner_radius", self.inner_radius, f"below the outer radius {outer} m (they differ by D)")
        if np.any(outer + inner < -_ROUNDING * (outer - inner)):
            raise ParameterError("inner_radius", self.inner_radius, f"at least minus the outer radius {outer} m")
        if np.any(pitch < 0.0):
            raise ParameterError("pitch", self.pitch, "zero or positive; handedness is an argument of its own")
        if np.any((pitch < _SMALLEST) & (inner < _SMALLEST)):
            raise ParameterError("pitch", self.pitch, f"positive where the inner radius {inner} m is not")
        for name, values in (("outer_radius", outer), ("inner_radius", inner), ("pitch", pitch)):
            object.__setattr__(self, name, read_only(values))

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the three arrays; () for one helix."""
        return self.outer_radius.shape

    @property
    def diameter(self) -> FloatArray:
        """Diameter `D = Ro - Ri` of the tube [m], (7)."""
        return np.asarray(self.outer_radius - self.inner_radius)

    @property
    def centre_radius(self) -> FloatArray:
        """Radius `Rc = (Ro + Ri)/2` of the centre line [m], after (5); zero for a straight tube."""
        return np.asarray(np.maximum(0.5 * (self.outer_radius + self.inner_radius), 0.0))

    @property
    def turn_height(self) -> FloatArray:
        """Rise of a whole turn, `2 pi b` [m]."""
        return np.asarray(2.0 * np.pi * self.pitch)

    def radius(self, path: str) -> FloatArray:
        """Radius of one of `PATHS` [m].

        Raises:
            ParameterError: If there is no such path.
        """
        radii = {"inner": self.inner_radius, "centre": self.centre_radius, "outer": self.outer_radius}
        return radii[choice("path", path, PATHS)]


def forward(contraction: Any, angle: Any, diameter: Any) -> HelixShape:
    r"""Return the helix of an actuator: [Blumenschein 2018] (12).

    .. math:: R_o = D (1 - \lambda\cos 2\theta)/d, \quad R_i = D\lambda(\cos 2\theta - \lambda)/d, \quad
       b = D\lambda\sin 2\theta/d, \quad d = 1 + \lambda^2 - 2\lambda\cos 2\theta

    At contraction 1 the tube is straight and the outer path winds around it, `Ro = D/2`; at angle 0 the tube is a planar arc.

    Args:
        contraction: Contracted over original length of the actuator `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].

    Returns:
        The shape, of the common shape of the arguments.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
        StraightTube: At contraction 1 and angle 0, where no helix exists, or within rounding of it;
            `actuator_curvature_torsion` has a value there.
    """
    actuator = checked_actuator(contraction, angle, diameter)
    shrink, sine, size = _distance_from_straight(actuator)
    if np.any(size < 1.0 / LARGEST):
        raise StraightTube(
            f"contraction {actuator.contraction} at angle {actuator.angle} rad leaves the tube straight: no helix radius; "
            "a contraction below 1 or an angle above 0 is required (actuator_curvature_torsion gives (0, 0))"
        )
    contraction_part, angle_part = shrink / size / size, 0.5 * (sine / size) ** 2
    outer = actuator.diameter * (contraction_part + angle_part)
    inner = actuator.diameter * (actuator.contraction * contraction_part - angle_part)
    pitch = actuator.diameter * (actuator.contraction * np.sin(2.0 * actuator.angle) / size) / size
    if np.any(np.maximum(outer, pitch) > LARGEST) or np.any(outer <= inner):
        raise StraightTube(f"the helix has a radius of {outer} m and a pitch of {pitch} m/rad: the tube is straight")
    return HelixShape(outer, inner, pitch)


class Actuator(NamedTuple):
    """An actuator on a tube, as arrays that broadcast."""

    contraction: FloatArray
    """Contracted over original length `lambda` [-]."""
    angle: FloatArray
    """Angle `theta` to the axis of the tube [rad]."""
    diameter: FloatArray
    """Diameter `D` of the tube [m]."""


def inverse(shape: HelixShape) -> Actuator:
    r"""Return the actuator of a helix: [Blumenschein 2018] (6, 7, 11), with an arctangent instead of the arccosine.

    .. math:: \lambda = \frac{|R_i + i b|}{|R_o + i b|}, \qquad D = R_o - R_i, \qquad
       \theta = \tfrac12 \operatorname{atan2}(b\,D,\; R_i R_o + b^2)

    Args:
        shape: The helix.

    Returns:
        Contraction (positive) [-], angle [rad] and diameter [m].

    Raises:
        ParameterError: If `shape` is not a `HelixShape`, or the angle of its actuator is pi/2 up to rounding.
    """
    shape = checked_shape(shape)
    diameter, pitch = shape.diameter, shape.pitch
    scaled = (shape.inner_radius / diameter) * (shape.outer_radius / diameter) + (pitch / diameter) ** 2
    angle = 0.5 * np.arctan2(pitch / diameter, scaled)
    contraction = np.hypot(pitch, shape.inner_radius) / np.hypot(pitch, shape.outer_radius)
    if np.any(angle >= 0.5 * np.pi):
        raise ParameterError("shape", shape, "a helix with a pitch above rounding")
    return Actuator(np.minimum(contraction, 1.0), angle, diameter)


def measure(outer_arc: Any, inner_arc: Any, diameter: Any, turns: Any = 1.0) -> HelixShape:
    r"""Return the helix from measured lengths of its outer and inner path: [Blumenschein 2018] (16), corrected.

    .. math:: R_o = m + D/2, \quad R_i = m - D/2, \quad b = \sqrt{L_o^2/4\pi^2 - R_o^2}, \quad
       m = \frac{L_o^2 - L_i^2}{8\pi^2 D}

    The paper prints both radii one diameter too small.

    Args:
        outer_arc: Length `Lo` of the outer path over `turns` turns [m].
        inner_arc: Length `Li` of the inner path over the same turns [m].
        diameter: Diameter `D` of the tube, positive [m].
        turns: Number of measured turns, positive; e.g. 0.5 for a tube shorter than one turn [-].

    Returns:
        The shape.

    Raises:
        ParameterError: If a length is not positive, the inner one exceeds the outer one, or no helix explains them.
    """
    outer, inner = positive_array("outer_arc", outer_arc, "m"), positive_array("inner_arc", inner_arc, "m")
    tube, count = positive_array("diameter", diameter, "m"), positive_array("turns", turns, "-")
    outer, inner, tube, count = np.broadcast_arrays(outer, inner, tube, count)
    outer, inner = outer / (2.0 * np.pi * count), inner / (2.0 * np.pi * count)
    if np.any(inner > outer):
        raise ParameterError("inner_arc", inner_arc, f"at most the outer arc {outer_arc} m: the actuator is the shorter path")
    middle = (outer - inner) * (outer + inner) / (2.0 * tube)
    outer_radius = middle + 0.5 * tube
    rest = outer - outer_radius
    flat = np.abs(rest) <= _ROUNDING * outer  # a planar arc, up to rounding
    if np.any((rest < 0.0) & ~flat):
        requirement = f"at least a circle of the outer radius {outer_radius} m, which these arcs and diameter give"
        raise ParameterError("outer_arc", outer_arc, requirement)
    pitch = np.sqrt(np.where(flat, 0.0, np.maximum(rest, 0.0) * (outer + outer_radius)))
    if np.any((pitch == 0.0) & (middle <= 0.5 * tube)):
        raise ParameterError("inner_arc", inner_arc, "such that a helix explains both arcs at this diameter")
    return HelixShape(outer_radius, middle - 0.5 * tube, pitch)


def checked_actuator(contraction: Any, angle: Any, diameter: Any) -> Actuator:
    """Return contraction, angle and diameter as arrays that broadcast, or raise ParameterError."""
    actuator = Actuator(checked_contraction(contraction), checked_angle(angle), positive_array("diameter", diameter, "m"))
    common_shape("diameter", *(values.shape for values in actuator))
    return actuator


def checked_contraction(contraction: Any) -> FloatArray:
    """Return contractions in (0, 1] as an array, or raise ParameterError."""
    contractions = positive_array("contraction", contraction, "-")
    if np.any(contractions > 1.0):
        raise ParameterError("contraction", contraction, CONTRACTION_RANGE)
    return contractions


def checked_angle(angle: Any) -> FloatArray:
    """Return angles of actuators to the axis of the tube, in [0, pi/2) rad, as an array, or raise ParameterError."""
    angles = finite_array("angle", angle, None, "rad")
    if np.any(angles < 0.0):
        raise ParameterError("angle", angle, "in [0, pi/2) rad; handedness is an argument of its own")
    if np.any(angles >= 0.5 * np.pi):
        raise ParameterError("angle", angle, ANGLE_RANGE)
    return angles


def turning_sign(handedness: str) -> float:
    """Return +1 for "right", -1 for "left", or raise ParameterError."""
    return 1.0 if choice("handedness", handedness, HANDEDNESS) == "right" else -1.0


def length_ratio(contraction: FloatArray, angle: FloatArray) -> FloatArray:
    """Return `|1 + zeta|`, twice the length of the centre line over that of the outer path [-], without cancellation."""
    return np.asarray(np.hypot(1.0 - contraction, 2.0 * np.sqrt(contraction) * np.cos(angle)))


def checked_shape(shape: Any) -> HelixShape:
    """Return `shape` if it is a `HelixShape`, or raise ParameterError."""
    if not isinstance(shape, HelixShape):
        raise ParameterError("shape", shape, "a HelixShape (returned by helix.forward, or from its two radii and pitch)")
    return shape


def _distance_from_straight(actuator: Actuator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`1 - lambda`, `2 sqrt(lambda) sin theta` and their hypotenuse `|1 - zeta|`."""
    shrink = 1.0 - actuator.contraction
    sine = 2.0 * np.sqrt(actuator.contraction) * np.sin(actuator.angle)
    return shrink, sine, np.hypot(shrink, sine)
