r"""Rates of equilibria along rates of the numbers of a model, for many states at once.

The counterpart in forward mode of `residual_derivatives`, where the cost does not grow with the number of outputs. At fixed
strains, rates of placements and of the maps of sections are a motion of the bodies. Dead loads have a potential, so that the
rate of the load that they put on the strains is the derivative of their work in that motion by the strains:

.. math:: \frac{\mathrm d}{\mathrm dt} \frac{\partial W}{\partial z} = \frac{\partial}{\partial z} \frac{\mathrm dW}{\mathrm dt}

Rates of masses, springs and tensions change the loads themselves, and those of routes the lengths of actuators and their arms.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.actuator_derivatives import ActuatorStates
from softrobots.identification.model_change import ModelChange
from softrobots.identification.residual_derivatives import OF_ACTUATORS, EquilibriumDerivatives

_OF_BODIES = {"placements", "frames", "masses", "section_lengths", "section_joints"}


class ResidualRates(NamedTuple):
    """Rates of N states at fixed coordinates, multipliers and actuators."""

    motors: FloatArray
    """Of the loads on the motor joints, shape (N, n_joint_motors)."""
    strains: FloatArray
    """Of the loads on the strains, springs and tensions included, shape (N, n_strains): minus those of the residual."""
    lengths: FloatArray
    """Of the lengths of actuators, shape (N, n_muscles) [m]."""
    point: FloatArray
    """Of the position of a frame, shape (N, 3) [m]."""


def residual_rates(at: EquilibriumDerivatives, change: ModelChange, rates: FloatArray, frame: str) -> ResidualRates:
    """Return the rates at those of the parameters.

    Args:
        at: The states.
        change: Derivatives of the numbers by the parameters.
        rates: Rates of the parameters, shape (N, P), or (1, P) for all.
        frame: Frame whose position is asked for.
    """
    count = len(at.strains)
    moved = {name: rates @ slope.T for name, slope in change.by_number.items()}
    moved = {name: one.reshape(len(rates), *_shape(at, name)) for name, one in moved.items() if np.any(one)}
    motors, point = np.zeros((count, at.n_joint_motors)), np.zeros((count, 3))
    strains, lengths = at.springs.rates(moved), np.zeros(at.inputs.shape)
    if moved.keys() & _OF_BODIES:
        tree = at.tree
        joints, bent = _of_sections(at, moved)
        twists = tree.motion(joints, moved.get("placements"))
        on_joints = tree.at_joints(tree.work_slopes(twists, np.zeros_like(twists)))
        if moved.keys() & {"masses", "frames"}:
            on_joints += tree.load_rates({}, moved.get("masses"), moved.get("frames"))[:, None]
        of_motors, of_strains = at.on_strains(on_joints)
        motors, strains = of_motors[:, 0], strains + of_strains[:, 0] + bent
        point = tree.point_speed(frame, twists, moved.get("frames"))
    if at.actuators is not None and moved.keys() & OF_ACTUATORS:
        tensions, apart = _of_held_directions(at, at.actuators, moved)
        lengths, pulled = at.actuators.rates(moved, tensions)
        lengths, strains = lengths + apart, strains + pulled
    return ResidualRates(motors, strains, lengths, point)


def _shape(at: EquilibriumDerivatives, name: str) -> tuple[int, ...]:
    """Shape of the rates of a number; placements and frames move by twists."""
    shape = at.numbers[name].shape
    return (shape[0], 6) if name in ("placements", "frames") else shape


def _of_sections(at: EquilibriumDerivatives, moved: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Rates of the joints, (N, n), by the map of the sections, and of the loads on the strains, (N, n_strains), as it turns."""
    joints, bent = np.zeros((len(at.strains), at.model.pinocchio.nv)), np.zeros(at.strains.shape)
    if "section_joints" in moved:
        joints[:, at.sections] -= moved["section_joints"]
    if "section_lengths" in moved:  # the chord is proportional to the length
        growth, chord, chords = moved["section_lengths"], at.chain.first[:, :, 2], at.sections[:, 2]
        lengths = at.chain.lengths
        joints[:, chords] += at.chain.positions[..., 2] / lengths * growth
        by_section = bent[:, at.n_singles :].reshape(*chord.shape)
        by_section[..., :3] = chord[..., :3] * (at.tree.torque[:, chords] * growth / lengths)[..., None]
    return joints, bent


def _of_held_directions(
    at: EquilibriumDerivatives, actuators: ActuatorStates, moved: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Rates of tensions and lengths, (N, n_muscles), as the sums of strains change that more lengths than needed hold."""
    if not at.is_held or "held_slopes" not in moved:
        return np.zeros(at.inputs.shape), np.zeros(at.inputs.shape)
    slopes, inverse = moved["held_slopes"], np.linalg.pinv(at.numbers["held_slopes"])
    sums = at.states.actuator_loads[:, at.n_joint_motors :] @ inverse
    missed = at.numbers["path_rest"] + actuators.changes - at.inputs
    return (sums[:, None] @ slopes)[:, 0], (slopes @ missed[..., None])[..., 0] @ inverse.T
