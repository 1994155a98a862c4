r"""Derivatives of natural frequencies and damping ratios by parameters.

With a mass-normalised mode :math:`\phi` of the frequency :math:`\omega`,

.. math:: d\omega^2 = \phi^T (dK - \omega^2 dM)\,\phi

where stiffness and mass change with the parameter and with the equilibrium that follows it. `dK` and `dM` are differences of
both along the tangent of the equilibria, of fourth order, exact to 1e-10. The derivatives of frequencies that are the same,
those of round robots, are the eigenvalues of that matrix over their modes: the slopes with which they part.

The damping ratio :math:`\zeta = \phi^T D \phi / 2 \omega` changes with `D`, the frequency and the mode (Nelson 1976):

.. math:: d\phi_i = \sum_{j \ne i} \frac{\phi_j^T (dK - \omega_i^2 dM)\,\phi_i}{\omega_i^2 - \omega_j^2} \phi_j
    - \tfrac{1}{2} (\phi_i^T dM\,\phi_i)\,\phi_i
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.dynamics.small_motion import small_motion
from softrobots.dynamics.vibration import VibrationModes
from softrobots.identification.model_change import differences
from softrobots.identification.parameters import ParameterSet
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load

_SAME = 1e-7  # relative difference of frequencies that count as one, as in `softrobots.dynamics.vibration`


def frequency_slopes(
    modes: VibrationModes, parameters: ParameterSet, strains: FloatArray, slopes: FloatArray, tip: str
) -> FloatArray:
    """Differentiate natural frequencies, shape (n_modes, P) [Hz per unit].

    Args:
        modes: The modes of an equilibrium.
        parameters: The parameters.
        strains: Strains of the equilibrium, shape (n_strains,).
        slopes: Their derivatives by the parameters, shape (n_strains, P).
        tip: Frame of the loads among the parameters.
    """
    found = np.zeros((len(modes.frequencies), len(parameters.names)))
    for place, one in enumerate(parameters.parameters):

        def matrices(value: float, place: int = place) -> dict[str, FloatArray]:
            moved = strains + (value - parameters.parameters[place].value) * slopes[:, place]
            return mode_matrices(modes, neighbour(modes.equilibrium, parameters, place, value, moved, tip))

        change = differences(one, one.value, matrices(one.value), matrices, fourth_order=True)
        found[:, place] = mode_slopes(modes, change)["frequencies"]
    return found


def neighbour(
    at: Equilibrium, parameters: ParameterSet, place: int, value: float, strains: FloatArray, tip: str
) -> Equilibrium:
    """Return a robot with another value of one parameter at given strains, in equilibrium or not, with its load.

    The robot stands on its base: where that turns, the load turns the other way.

    Args:
        at: The equilibrium at the present values.
        parameters: The parameters.
        place: Number of the parameter.
        value: Its value.
        strains: Strains, shape (n_strains,).
        tip: Frame of the loads among the parameters.
    """
    one = parameters.parameters[place]
    shift, kind, parts = value - one.value, one.place.kind, list(one.place.parts)
    model, load, motors, axes = at.model, at.load, np.array(at.q_motors), np.zeros(6)
    axes[parts[:1]] = shift
    if parameters.of_model[place]:
        values = parameters.values.copy()
        values[place] = value
        model = parameters.model(values)
    elif kind in ("motor", "offset"):
        motors[parts] += shift
    elif kind in ("force", "wrench"):
        load = load.plus(tip, axes)
    elif kind == "gravity":
        x, y, z = (np.array(load.gravity or (0.0, 0.0, 0.0)) + axes[:3]).tolist()
        load = Load(load.wrenches, (x, y, z))
    elif kind == "base" and one.place.names[0] == "rotation":
        load = load.turned(pin.exp3(-axes[:3]))
    return moved(at, model, load, motors, strains)


def moved(at: Equilibrium, model: SoftModel, load: Load, motors: FloatArray, strains: FloatArray) -> Equilibrium:
    """Return a state near an equilibrium, in equilibrium or not: of a robot under a load, at actuators and strains."""
    held = model.structure.muscle_lengths
    springs = strains if held is None else held.elastic @ strains
    q = model.embed(model.coordinates.at(motors, springs).joints)
    return replace(at, model=model, load=load, q_motors=motors, q_springs=springs, q=q)


def mode_matrices(modes: VibrationModes, near: Equilibrium) -> dict[str, FloatArray]:
    """Stiffness, mass and damping of the coordinates of modes at a state nearby."""
    options = {name: modes.settings[name] for name in ("damping_time", "mass_damping", "rotor_inertia")}
    small = small_motion(near.model, near, **options)
    first = 0 if modes.settings["servo_stiffness"] is not None else small.n_placed
    return {name: getattr(small, name)[first:, first:] for name in ("stiffness", "mass", "damping")}


def mode_slopes(modes: VibrationModes, change: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Derivatives of frequencies and damping ratios, each shape (n_modes,), from those of `mode_matrices`; see the module."""
    omegas, count = 2.0 * np.pi * modes.frequencies, len(modes.frequencies) - len(modes.shapes)
    shapes, start = np.concatenate([modes.motor_shapes[:count], modes.shapes]), 0
    slopes, same = np.zeros(len(omegas)), np.zeros((len(omegas), len(omegas)), dtype=bool)
    while start < len(omegas):
        end = start + int(np.count_nonzero(omegas[start:] - omegas[start] <= _SAME * omegas[start]))
        some, square = shapes[:, start:end], float(np.mean(omegas[start:end] ** 2))
        by_mode = some.T @ (change["stiffness"] - square * change["mass"]) @ some
        squares, turn = np.linalg.eigh(0.5 * (by_mode + by_mode.T))
        slopes[start:end], shapes[:, start:end] = squares / (2.0 * omegas[start:end]), some @ turn
        same[start:end, start:end] = True
        start = end
    stiffness, mass, damping = (shapes.T @ change[name] @ shapes for name in ("stiffness", "mass", "damping"))
    present, squares = shapes.T @ modes.damping_matrix @ shapes, omegas**2
    apart = np.where(same, 1.0, squares - squares[:, None])
    turned = np.where(same, -0.5 * mass, (0.5 * (stiffness + stiffness.T) - squares * mass) / apart)
    along = np.diagonal(damping) + 2.0 * np.sum(turned * present, axis=0)
    ratios = (along - np.diagonal(present) * slopes / omegas) / (2.0 * omegas)
    return {"frequencies": slopes / (2.0 * np.pi), "damping_ratios": ratios}
