r"""Vibration modes: frequencies and shapes of the small free vibrations about a loaded equilibrium.

With the tangent stiffness `K` and the mass matrix `M` of the equilibrium,

.. math:: K \phi_i = \omega_i^2 M \phi_i, \qquad \phi_i^T M \phi_j = \delta_{ij}

Both are factorised, :math:`K = L L^T` and :math:`M = R^T R`, and the singular values of :math:`R L^{-T}` are the
:math:`1 / \omega_i`: the slow modes, which matter, are exact to rounding beside modes ten thousand times as fast.

Damping `D` does not change the modes: with :math:`d_{ij} = \phi_i^T D \phi_j` the damping ratio of a mode is :math:`\zeta_i =
d_{ii} / 2 \omega_i`. That is exact if damping does not couple the modes (a `damping_time` without load, `mass_damping` always),
and wrong by terms of second order in the coupling otherwise (Rayleigh, The Theory of Sound, 1894, section 102);
`VibrationModes.eigenvalues` are exact for any damping.

In contact the robot vibrates along its obstacles where there is no friction, and about the points that stick: `K` is the
Hessian of the Lagrangian, and the modes are those of :math:`Z^T K Z` and :math:`Z^T M Z`, with a basis `Z` of the motions that
contacts leave. What sticks may roll and spin at once, which makes `K` slightly unsymmetric (`softrobots.statics.contact.held`);
modes are those of its symmetric part, wrong by the square of the rest, or refused where that is above 1e-3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, one_each, positive_integer, positive_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Part, Summarised
from softrobots.dynamics.motion_summary import modes_parts
from softrobots.dynamics.small_motion import check_vibrates, mass_factor, small_motion
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.certificate import null_space
from softrobots.statics.elastic_state import scaled
from softrobots.statics.equilibrium import Equilibrium, check_same_model
from softrobots.statics.kinematics import frame_placement

_SAME = 1e-7  # frequencies this close, relative, are one: robots are round but for their tiny links
_NO_MOTION = 1e-6  # of the largest motion of the tip


@dataclass(frozen=True, eq=False, repr=False)
class VibrationModes(Summarised):
    """The vibration modes of an equilibrium, slowest first; made by `vibration_modes`, saved by `softrobots.save_result`.

    The sign of a mode is that with which the largest of the tip's ways along x, y and z is positive; if it only turns, of its
    turns about them. Of modes with one frequency, those of a round robot, the first moves the tip along the first axis along
    which any does, and the others do not.
    """

    equilibrium: Equilibrium
    """The equilibrium."""
    frequencies: FloatArray
    """Natural frequencies without damping, ascending, shape (n,) [Hz]; one less for each pressed contact, three if stuck."""
    shapes: FloatArray
    r"""Elastic coordinates of each mode per modal coordinate, a column a mode, mass-normalised, shape (n_springs, n)
    [rad/(sqrt(kg) m) or 1/sqrt(kg)]."""
    motor_shapes: FloatArray
    """Actuators of each mode in the same scale, shape (n_motors, n); zeros if they are held."""
    tip_shapes: FloatArray
    """Motion of the tip in each mode in the same scale, world axes: translation, then turn, shape (6, n)."""
    damping_ratios: FloatArray
    """Damping ratio of each mode, shape (n,) [-]; see `softrobots.vibration_modes`."""
    mass_matrix: FloatArray
    """Mass matrix of the elastic coordinates, actuators before them if they take part, shape (n, n) [kg m^2, kg m, kg]."""
    damping_matrix: FloatArray
    """Damping of the same coordinates, shape (n, n)."""
    stiffness_matrix: FloatArray
    """Stiffness of the same coordinates: the tangent stiffness, and that of the servos, shape (n, n)."""
    participation: FloatArray
    """Momentum per modal rate, and angular momentum about the world's origin, shape (6, n) [sqrt(kg), sqrt(kg) m]."""
    settings: dict[str, Any]
    """The arguments `damping_time`, `mass_damping`, `servo_stiffness` and `rotor_inertia`."""

    def summary_parts(self) -> list[Part]:
        """Return the slowest modes, and the mass that shakes with the base."""
        return modes_parts(self)

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.equilibrium.model

    @property
    def effective_masses(self) -> FloatArray:
        """Part of each mode in a shaking of the base along x, y, z, and about them, shape (n, 6) [kg, kg m^2].

        The square of its momentum. Their sum over the modes is the mass that shakes: all moving mass if the robot can give way
        as a whole in that direction, otherwise less.
        """
        return np.asarray(self.participation.T**2)

    @cached_property
    def eigenvalues(self) -> Any:
        r"""Exact eigenvalues of the damped vibrations :math:`e^{s t}`, complex, by size, shape (2 n,) [1/s].

        A pair of conjugates has the frequency `|s| / 2 pi` and the damping ratio `-Re s / |s|`; two real ones are an overdamped
        mode.
        """
        omega, n = 2.0 * math.pi * self.frequencies, len(self.frequencies)
        modes = np.concatenate([self.motor_shapes[: len(self.mass_matrix) - len(self.shapes)], self.shapes])
        state = np.block([[np.zeros((n, n)), np.diag(omega)], [-np.diag(omega), -modes.T @ self.damping_matrix @ modes]])
        with one_blas_thread(2 * n):
            values: Any = np.linalg.eigvals(state)
        return read_only(values[np.argsort(np.abs(values), kind="stable")])

    def swing(self, mode: int, size: float) -> ModeSwing:
        """The robot swinging in one mode, for pictures and animations: the linear motion of the mode, taken as far as `size`.

        Args:
            mode: Number of the mode, from 1.
            size: Largest motion of the tip and of any coordinate; of angles it times the reach [m].

        Returns:
            The swing; `Viewer.animate` plays it.

        Raises:
            ParameterError: If there is no such mode, or the size is not positive or bends a section beyond its range.
        """
        positive_integer("mode", mode, len(self.frequencies))
        swing = ModeSwing(self, mode, positive_number("size", size, "m"))
        if not all(self.model.coordinates.at(*swing.at(share)).valid for share in (0.25, -0.25)):
            raise ParameterError("size", size, "small enough for every section (see strain_chain.in_range)")
        return swing


@dataclass(frozen=True, eq=False)
class ModeSwing:
    """A robot that swings in one mode; made by `VibrationModes.swing`."""

    modes: VibrationModes
    """The modes."""
    mode: int
    """Number of the mode, from 1."""
    size: float
    """Largest motion [m]."""

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.modes.model

    @property
    def period(self) -> float:
        """Time of one swing [s]."""
        return 1.0 / float(self.modes.frequencies[self.mode - 1])

    def at(self, share: float) -> tuple[FloatArray, FloatArray]:
        """Actuators, shape (n_motors,), and elastic coordinates, shape (n_springs,) [rad or m], at a share of a period.

        At 0 the robot passes its equilibrium, at 0.25 it is at the end that the signs of the mode point to.
        """
        modes, place, reach = self.modes, self.mode - 1, self.model.reach
        turning = np.concatenate([np.repeat([False, True], 3), self.model.actuators.turning, self.model.springs.turning])
        moved = np.concatenate([one[:, place] for one in (modes.tip_shapes, modes.motor_shapes, modes.shapes)])
        scale = self.size * math.sin(2.0 * math.pi * share) / float(np.abs(moved * np.where(turning, reach, 1.0)).max())
        at = modes.equilibrium
        return at.q_motors + scale * modes.motor_shapes[:, place], at.q_springs + scale * modes.shapes[:, place]

    @property
    def tip_position(self) -> FloatArray:
        """Positions of the tip from one end of the swing to the other, shape (33, 3) [m]."""
        coordinates = (self.at(share) for share in np.linspace(-0.25, 0.25, 33).tolist())
        return np.array(
            [frame_placement(self.model, self.model.configuration(*at), self.model.tip).translation for at in coordinates]
        )


def vibration_modes(
    model: SoftModel,
    equilibrium: Equilibrium,
    *,
    damping_time: float | None = None,
    mass_damping: float = 0.0,
    servo_stiffness: Any = None,
    rotor_inertia: Any = None,
) -> VibrationModes:
    """Find the natural frequencies, shapes and damping ratios of a robot about a stable equilibrium under any load.

    Stiffness is the exact tangent with load and gravity, and the mass matrix that of the bent shape. The load does not change
    while the robot vibrates. In contact, pressed contacts stay pressed and slide without friction, so that there are as many
    modes less, or stick (`follow_contact`) and hold all three directions; where it touches without a force, nothing holds it.

    Args:
        model: The robot.
        equilibrium: An equilibrium of it, certified stable, under a load that has a potential (forces and gravity).
        damping_time: Damping over stiffness near rest [s]; None: the damping of the file (see `damping_time_from_decrement`).
        mass_damping: Damping over mass, Rayleigh's other term [1/s].
        servo_stiffness: Stiffness with which each actuator holds its place, or one for all [N m/rad or N/m]: their coordinates
            take part then, with the damping that the file has at their joints. None: they are held exactly. Muscles of given
            tension keep their tension.
        rotor_inertia: Inertia of the rotor of each actuator at its joint, or one for all [kg m^2 or kg], which take part with a
            servo; None: that of the file.

    Returns:
        The modes.

    Raises:
        ParameterError: If an argument is out of range, the equilibrium belongs to another model, its load has a moment (under
            which modes are not orthogonal; `linearize` takes it), a contact slips or rolls and spins under much friction,
            or it is unstable, with its servos.
        NeutralEquilibrium: If the stiffness is singular.
        DescriptionError: If the description has no masses, or the robot more joints than Pinocchio supports.
    """
    check_same_model(model, equilibrium)
    if not equilibrium.conservative:
        raise ParameterError(
            "equilibrium",
            equilibrium.load,
            "one under forces and gravity: under a world-fixed moment modes are not orthogonal (linearize takes such loads)",
        )
    small = small_motion(model, equilibrium, damping_time=damping_time, mass_damping=mass_damping, rotor_inertia=rotor_inertia)
    first, servos = small.n_placed, np.zeros(small.n_placed)
    if servo_stiffness is not None:
        first, servos = 0, one_each("servo_stiffness", servo_stiffness, small.n_placed, "N m/rad or N/m")
        if not model.actuators.independent:
            requirement = "None: the lengths of more than three muscles along a segment depend on each other"
            raise ParameterError("servo_stiffness", servo_stiffness, requirement)
    elif rotor_inertia is not None:
        raise ParameterError("rotor_inertia", rotor_inertia, "left out without servo_stiffness: actuators are held")
    tip, mass, damping = small.tip[:, first:], small.mass[first:, first:], small.damping[first:, first:]
    with one_blas_thread(len(mass)):
        stiffness = (small.stiffness + np.diag(np.concatenate([servos, np.zeros(model.n_springs)])))[first:, first:]
        whole, stiffness = stiffness, 0.5 * (stiffness + stiffness.T)
        own = np.concatenate([np.where(servos[first:] > 0.0, servos[first:], model.stiffest or 1.0), model.stiffness])
        if small.pressed is None:
            check_vibrates(scaled(stiffness, own))
            frequencies, modes = _modes(stiffness, mass, model)
        else:  # only motions that contacts leave
            soft = 1.0 / np.sqrt(own)
            free = soft[:, None] * null_space(small.pressed[:, first:] * soft)
            check_vibrates(free.T @ whole @ free)
            frequencies, modes = _modes(free.T @ stiffness @ free, free.T @ mass @ free, model)
            modes = free @ modes
        modes = _signed(model, tip, frequencies, modes)
    motors = np.zeros((model.n_motors, len(frequencies)))
    motors[: small.n_placed - first] = modes[: small.n_placed - first]
    along = np.einsum("ji,jk,ki->i", modes, damping, modes)
    return VibrationModes(
        equilibrium=equilibrium,
        frequencies=read_only(frequencies / (2.0 * math.pi)),
        shapes=read_only(modes[small.n_placed - first :]),
        motor_shapes=read_only(motors),
        tip_shapes=read_only(tip @ modes),
        damping_ratios=read_only(along / (2.0 * frequencies)),
        mass_matrix=read_only(mass),
        damping_matrix=read_only(damping),
        stiffness_matrix=read_only(stiffness),
        participation=read_only(small.momentum[:, first:] @ modes),
        settings={
            "damping_time": damping_time,
            "mass_damping": mass_damping,
            "servo_stiffness": servo_stiffness,
            "rotor_inertia": rotor_inertia,
        },
    )


def _modes(stiffness: FloatArray, mass: FloatArray, model: SoftModel) -> tuple[FloatArray, FloatArray]:
    """Angular frequencies, ascending [rad/s], and mass-normalised modes, a column each."""
    lower: Any = np.linalg.cholesky(stiffness)
    upper = mass_factor(model, mass).T
    _, periods, vectors = np.linalg.svd(np.linalg.solve(lower, upper.T).T)
    frequencies = 1.0 / periods
    return frequencies, np.asarray(np.linalg.solve(lower.T, vectors.T) * frequencies)


def _signed(model: SoftModel, tip: FloatArray, frequencies: FloatArray, modes: FloatArray) -> FloatArray:
    """The modes in the directions and with the signs that `VibrationModes` states; `tip` is the Jacobian of the tip."""
    tip, start = tip / np.repeat([1.0, 1.0 / model.reach], 3)[:, None], 0
    while start < len(frequencies):
        end = start + int(np.count_nonzero(frequencies[start:] - frequencies[start] <= _SAME * frequencies[start]))
        for first in range(start, end - 1):  # turn those that are left so that only one of them moves the tip along an axis
            moved = tip @ modes[:, first:end]
            sizes = np.linalg.norm(moved, axis=1)
            axis = int(np.argmax(sizes > _NO_MOTION * sizes.max()))
            if sizes[axis] > 0.0:
                turn: Any = np.linalg.qr(np.column_stack([moved[axis], np.eye(end - first)]))[0]
                modes[:, first:end] = modes[:, first:end] @ turn
        start = end
    moved = tip @ modes
    moved[3:, np.abs(moved[:3]).max(axis=0) > _NO_MOTION * np.abs(moved).max(axis=0)] = 0.0
    sizes = np.abs(moved)
    largest = np.argmax(sizes > (1.0 - _NO_MOTION) * sizes.max(axis=0), axis=0)
    signs = np.sign(np.take_along_axis(moved, largest[None], axis=0)[0])
    return np.asarray(modes * np.where(signs == 0.0, 1.0, signs))
