r"""Winches and pistons: slide joints beside the robot, through which MuJoCo drives tendons that its own actuators cannot.

*Winch*, for a given length. Statics holds the length exactly. A servo on the tendon would have to be stiff beside the springs
`K` along the route `A`, and a jump of its input would then accelerate links of a few grams beyond what MuJoCo accepts. So the
tendon, with the stiffness `k` and the damping `c`, runs on to a heavy winch, which a servo moves to the input smoothly:

.. math:: k = \frac{10^4}{A K^{-1} A^T}, \quad c = \theta k, \quad k_p = 10 k, \quad k_v = 2 k_p T, \quad m = k_p T^2

The winch is critically damped, with the time constant `T`, and the tendon follows it with the lag :math:`\theta`. At rest the
error is 1e-4 of the change of length by which the tension alone would bend the arm. As damping is integrated implicitly and
stiffness explicitly, a mass `M` on the tendon is stable for :math:`h^2 k < 4 M + 2 h c`: whatever `k` is, for time steps
:math:`h < 2 \theta`.

*Piston*, for a McKibben muscle, whose tension at a pressure is quadratic in its length `l`. It is the derivative of the volume
that the muscle takes in: the force of the pressure on a piston of the area :math:`S (a - b)` whose travel follows the length,

.. math:: z = \int_{l_0}^{l} \frac{a (x / l_0)^2 - b}{a - b} \, dx, \qquad S = \tfrac14 \pi D_0^2,

which MuJoCo has as an equality of tendons. That is soft, but at rest the force passes whole, whatever its error. Up to its
shortest length :math:`l_0 \sqrt{b / a}` the muscle pulls; shorter, where it should be slack, the piston would push.
"""

from __future__ import annotations

from typing import NamedTuple

from softrobots.core.suspicion import MOST_STRETCH
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import input_limits, pull_factors
from softrobots.model.soft_model import SoftModel

TENDON_LAG = 0.005
"""Lag of a tendon behind its winch [s]; half the largest time step."""
WINCH_TIME = 0.05
"""Time constant of a winch [s]."""

_STIFF, _STIFFER = 1e4, 10.0  # of the tendon over the springs along its route, of the servo over the tendon
_PISTON_MASS = 1e-3  # over that of the robot


class Winch(NamedTuple):
    """A slide joint whose position is the length of an actuator."""

    stiffness: float
    """Of the tendon to it [N/m]."""
    gain: float
    """Of its servo [N/m]."""
    spring_length: float
    """Length of the tendon to its anchor without tension, where the winch is at `rest` [m]."""
    anchor: float
    """Length of the leg from the winch to its anchor there [m]."""
    rest: float
    """Length of the actuator at rest [m]."""
    inputs: tuple[float, float]
    """Least and largest length [m]."""


class Piston(NamedTuple):
    """A slide joint that follows the length of a McKibben muscle: `z = e + square e^2 + cube e^3` at the elongation `e`."""

    area: float
    """Tension at rest length per pressure [m^2]."""
    square: float
    """[1/m]."""
    cube: float
    """[1/m^2]."""
    mass: float
    """[kg]."""
    inputs: tuple[float, float]
    """Least and largest pressure [Pa]."""


def winch(model: SoftModel, place: int, beyond: float) -> Winch:
    """Return the winch of the actuator at `place` among those along the body, longer than its tendon by `beyond` [m]."""
    tag, row = model.muscles[place], model.structure.muscle_paths.matrix[place]
    stiffness = _STIFF / float(row @ (row / model.structure.strain_springs.stiffness))
    rest = float(model.structure.muscle_paths.rest[place])
    anchor = min(tag.longest, MOST_STRETCH * rest)  # so that it stays ahead of the winch
    return Winch(stiffness, _STIFFER * stiffness, anchor + rest - beyond, anchor, rest, input_limits(tag))


def piston(tag: ActuatorTag, mass: float) -> Piston:
    """Return the piston of a McKibben muscle of a robot of a mass [kg]."""
    factor, least = pull_factors(tag)
    bend = factor / (factor - least)
    return Piston(
        factor - least, bend / tag.rest_length, bend / (3.0 * tag.rest_length**2), _PISTON_MASS * mass, input_limits(tag)
    )
