r"""Damping of the elastic coordinates: by a time of the material, by the numbers of the file, and as measured.

The damper beside each spring carries the load :math:`D \dot y`. A Kelvin-Voigt material has one time :math:`\beta` for all of
its stiffness, so that with Rayleigh's term :math:`\alpha` for the mass

.. math:: D = \beta K + \alpha M

and about the relaxed robot mode i of angular frequency :math:`\omega_i` has the damping ratio :math:`\zeta_i = (\beta \omega_i
+ \alpha / \omega_i) / 2` (Clough and Penzien, Dynamics of Structures, 1993, section 12-5). A robot's `damping_time` is written
into its file as `<dynamics damping>` of each joint, :math:`\beta` times the stiffness of that joint.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, non_negative_number, positive_number
from softrobots.model.assembly import velocity_indices
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.stability import mass_matrix

_SHARING = ((0, 3), (1, 4), (5, 5), (2, 2))  # of the six joints of a section, those of bend_x, bend_y, twist, stretch


def damping_matrix(
    model: SoftModel, damping_time: Any = None, mass_damping: Any = 0.0, mass: FloatArray | None = None
) -> FloatArray:
    r"""Damping of the elastic coordinates, constant: what their dampers carry per rate of the coordinates.

    Args:
        model: The robot.
        damping_time: Time :math:`\beta` of the material [s]: the damping is it times the stiffness near rest. None: the numbers
            of the file, `<dynamics damping>` of each spring joint. For a section of constant strain the number of each joint
            counts for the coordinate that it follows, the mean of two for bending, so that a file written with a damping time
            gives that time. If muscle lengths are given, their free coordinates take their part of the damping of the strains.
        mass_damping: Rayleigh's term :math:`\alpha` for the mass [1/s].
        mass: Mass matrix of the elastic coordinates that it multiplies, shape (n_springs, n_springs); that of the relaxed robot
            by default.

    Returns:
        Shape (n_springs, n_springs) [N m s/rad or N s/m], symmetric, no eigenvalue negative.

    Raises:
        ParameterError: If a number is negative or not finite.
        DescriptionError: If the robot has more joints than Pinocchio supports, and its mass is needed.
    """
    check_model(model)
    alpha = non_negative_number("mass_damping", mass_damping, "1/s")
    lengths = model.structure.muscle_lengths
    if damping_time is None and lengths is not None:
        damping = np.asarray(lengths.free.T @ (strain_damping(model)[:, None] * lengths.free))
    elif damping_time is None:
        damping = np.diag(strain_damping(model))
    else:
        damping = np.diag(non_negative_number("damping_time", damping_time, "s") * model.stiffness)
    if alpha == 0.0:
        return damping
    if mass is None:
        point = model.coordinates.at(model.relaxed_motors, model.rest)
        mass = mass_matrix(model, point, model.embed(point.joints))
    return damping + alpha * mass


def damping_time_from_decrement(decrement: Any, frequency: Any) -> float:
    r"""Damping time of a robot from the logarithmic decrement of one of its modes.

    A mode with damping ratio :math:`\zeta` has :math:`\delta = 2 \pi \zeta / \sqrt{1 - \zeta^2}` and is seen to vibrate at
    :math:`f = \omega \sqrt{1 - \zeta^2} / 2 \pi`; with :math:`\beta = 2 \zeta / \omega`

    .. math:: \beta = \frac{2 \delta}{(4 \pi^2 + \delta^2) f}

    Args:
        decrement: Logarithmic decrement, `ln(x_n / x_(n+1))` of peaks one period apart, `ln(x_0 / x_n) / n` of n periods [-].
        frequency: Frequency at which the mode was seen to vibrate [Hz].

    Returns:
        The `damping_time` [s] of robots, `vibration_modes` and `simulate`.

    Raises:
        ParameterError: If the decrement is negative, the frequency is not positive, or one of them is not finite.
    """
    delta, f = non_negative_number("decrement", decrement, "-"), positive_number("frequency", frequency, "Hz")
    return 2.0 * delta / ((4.0 * math.pi**2 + delta**2) * f)


def strain_damping(model: SoftModel, damping_time: float | None = None) -> FloatArray:
    """Damping of the strains, before muscle lengths constrain them, shape (n_strains,): by a time [s], or that of the file."""
    if damping_time is not None:
        return np.asarray(damping_time * model.structure.strain_springs.stiffness)
    structure, joints = model.structure, np.array(model.pinocchio.damping)
    strains = [joints[structure.spring_indices]]
    for row in structure.section_table if structure.constant_strain else ():
        of_section = joints[velocity_indices(model.pinocchio, row.joint_names)]
        strains.append(of_section[np.array(_SHARING[: len(row.places)])].mean(axis=1))
    return np.concatenate(strains)
