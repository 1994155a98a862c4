r"""Tube bent into a helix: turns, lengths, volume, material twist, and the tension of the actuator.

A tube of length `Lt` (uninflated, along its axis) has an outer path of constant length :math:`L_o = L_t/\cos\theta`; the
actuator contracts to :math:`\lambda L_o`, and the centre line becomes

.. math:: L_c = L_t\,\frac{|1 + \zeta|}{2\cos\theta}, \qquad \zeta = \lambda e^{2 i\theta}

The formulas follow from (12) of [Blumenschein 2018]; the volume, twist and tension are ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, common_shape, non_negative_array, positive_array
from softrobots.helix.shapes import HelixShape, checked_actuator, checked_angle, checked_shape, length_ratio, turning_sign


def turns(shape: HelixShape, angle: Any, length: Any) -> FloatArray:
    r"""Return the turns of a tube, :math:`L_t / (2\pi\cos\theta\sqrt{R_o^2 + b^2})`, as the outer path keeps its length.

    Args:
        shape: The helix, shape (...).
        angle: Angle `theta` of the actuator to the axis of the uninflated tube, in [0, pi/2) [rad].
        length: Length `Lt` of the uninflated tube, positive [m].

    Returns:
        Turns, the common shape [-].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    lengths, each = positive_array("length", length, "m"), _length_of_turn(shape, angle)
    common_shape("length", each.shape, lengths.shape)
    return np.asarray(lengths / each)


def height(shape: HelixShape, angle: Any, length: Any) -> FloatArray:
    """Return the rise of a tube along the axis of its helix, `turns 2 pi b` [m]; arguments, shapes and errors as in `turns`."""
    return np.asarray(turns(shape, angle, length) * shape.turn_height)


def length_for_turns(shape: HelixShape, angle: Any, turns: Any) -> FloatArray:
    """Return the length of the uninflated tube for a number of turns: the inverse of `turns`.

    Args:
        shape: The helix, shape (...).
        angle: Angle `theta` of the actuator to the axis of the uninflated tube, in [0, pi/2) [rad].
        turns: Turns, positive [-].

    Returns:
        Length, the common shape [m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    counts, each = positive_array("turns", turns, "-"), _length_of_turn(shape, angle)
    common_shape("turns", counts.shape, each.shape)
    return np.asarray(counts * each)


def _length_of_turn(shape: Any, angle: Any) -> FloatArray:
    """Length of uninflated tube for one turn [m]."""
    shape, angles = checked_shape(shape), checked_angle(angle)
    common_shape("angle", shape.shape, angles.shape)
    return np.asarray(2.0 * np.pi * np.cos(angles) * np.hypot(shape.outer_radius, shape.pitch))


def centre_length(contraction: Any, angle: Any, length: Any) -> FloatArray:
    """Return the length `Lc` of the centre line of the actuated tube; see the module.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        length: Length `Lt` of the uninflated tube, positive [m].

    Returns:
        Length, the common shape [m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    actuator, lengths = checked_actuator(contraction, angle, 1.0), positive_array("length", length, "m")
    ratio = length_ratio(actuator.contraction, actuator.angle) / (2.0 * np.cos(actuator.angle))
    common_shape("length", ratio.shape, lengths.shape)
    return np.asarray(lengths * ratio)


def volume(contraction: Any, angle: Any, diameter: Any, length: Any) -> FloatArray:
    r"""Return the volume of the actuated tube, :math:`V = (\pi D^2/4) L_c`.

    By Pappus: circular cross-sections normal to the centre line, through their centre.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        length: Length `Lt` of the uninflated tube, positive [m].

    Returns:
        Volume, the common shape [m^3].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    diameters, lengths = positive_array("diameter", diameter, "m"), centre_length(contraction, angle, length)
    common_shape("diameter", diameters.shape, lengths.shape)
    return np.asarray(0.25 * np.pi * diameters**2 * lengths)


def material_twist(contraction: Any, angle: Any, diameter: Any, handedness: str = "right") -> FloatArray:
    r"""Return the twist of the wall of the tube per length of the uninflated tube.

    .. math:: \sigma\,\frac{2}{D}\left(\frac{2\lambda\sin\theta}{|1 + \zeta|} - \tan\theta\right)

    The frames of the centre line follow the actuator, which winds around the tube by `2 tan(theta)/D` before it contracts; the
    difference of their twist from that is the twist of the wall, zero at contraction 1.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        handedness: "right" or "left".

    Returns:
        Twist, the common shape [rad/m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    contractions, angles, diameters = checked_actuator(contraction, angle, diameter)
    ratio = length_ratio(contractions, angles)
    cosine = np.cos(angles)
    # |1 + zeta| - 2 lambda cos theta, as the difference of the squares over the sum: exactly 0 at lambda = 1
    shrink = 1.0 - contractions
    difference = shrink * (shrink + 4.0 * contractions * cosine**2) / (ratio + 2.0 * contractions * cosine)
    return np.asarray(-2.0 * turning_sign(handedness) * np.sin(angles) * difference / (diameters * ratio * cosine))


def actuator_tension(contraction: Any, angle: Any, diameter: Any, pressure: Any) -> FloatArray:
    r"""Return the tension of the actuator that holds the inflated tube in its shape.

    .. math:: T = P\,\frac{dV}{dL_a} = P\,\frac{\pi D^2}{4}\,\frac{\lambda + \cos 2\theta}{2\,|1 + \zeta|}, \qquad
       L_a = \lambda L_t/\cos\theta

    Only the pressure does work: the wall is inextensible and wrinkles without resistance. At angle 0 the tension is half the
    cap force at any contraction, and `T D` is the collapse moment `pi P r^3` of an inflated beam.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        pressure: Gauge pressure `P`, zero or positive [Pa].

    Returns:
        Tension, the common shape [N]; negative (compression) beyond 45 degrees where `lambda + cos 2theta` is.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    contractions, angles, diameters = checked_actuator(contraction, angle, diameter)
    pressures = non_negative_array("pressure", pressure, "Pa")
    common_shape("pressure", contractions.shape, angles.shape, diameters.shape, pressures.shape)
    area = 0.25 * np.pi * diameters**2
    rate = 2.0 * np.cos(angles) ** 2 - (1.0 - contractions)  # lambda + cos(2 theta), exact at lambda = 1
    return np.asarray(pressures * area * rate / (2.0 * length_ratio(contractions, angles)))
