r"""Derivatives of equilibria by the numbers of a model, for many states at once, by adjoint rows.

An output `o` of an equilibrium (a component of a pose, of the load on an actuator) changes with a parameter `p` by

.. math:: \frac{do}{dp} = \frac{\partial o}{\partial p} - \lambda^T \frac{\partial r}{\partial p}, \qquad
          K_t^T \lambda = \Bigl(\frac{\partial o}{\partial y}\Bigr)^T

with the residual `r`, the tangent stiffness `K_t` and the elastic coordinates `y`. A row :math:`\lambda` is a virtual motion,
and :math:`-\lambda^T r` the virtual work of loads, springs and tensions in it; its derivatives at fixed coordinates by all
numbers of `softrobots.model.numbers` are closed forms, at a cost that does not grow with the number of parameters. Where
lengths `l` of actuators are given, their tensions `T` are the multipliers: the residual of the strains `z` has
:math:`T\,\partial l/\partial z` more, and an actuator that is longer at the same strains is like a shorter given length.

At a knee (the end of a plateau, a tendon that goes slack) they are the derivatives of the side that the state is on.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import SectionChain
from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.actuator_derivatives import ActuatorStates
from softrobots.identification.derivatives.contact_derivatives import ContactDerivatives
from softrobots.identification.derivatives.loaded_tree import LoadedTree, section_joints
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.derivatives.spring_derivatives import SpringStates
from softrobots.identification.model_change import ModelChange, numbers_of
from softrobots.identification.parameters import ParameterSet
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.sensitivity import inverse_stiffness

_OF_SECTIONS, _OF_SPRINGS = {"section_lengths", "section_joints"}, {"stiffness", "rest", "moments"}  # of `model_numbers`
OF_ACTUATORS = {"path_length", "path_arms", "path_across", "path_turned", "path_rest", "straightened", "laws"}


class EquilibriumDerivatives:
    """N equilibria of a robot without dry friction, and what the derivatives of all outputs need of them."""

    def __init__(self, model: SoftModel, states: States, contact: ContactDerivatives | None = None) -> None:
        """Evaluate the robot at the states; of a single one in contact, with its contacts."""
        self.contact = contact
        """The contacts of the only state; None in free space."""
        structure, held = model.structure, model.structure.muscle_lengths
        self.model, self.states, self.numbers, self.sections = model, states, numbers_of(model), section_joints(model)
        self.n_joint_motors, self.n_singles = len(structure.motor_joints), len(structure.spring_joints)
        self.each = 0 if self.sections is None else len(structure.section_table[0].places)
        """Number of coordinates of each section of constant strain (k)."""
        self.inputs = states.q_motors[:, self.n_joint_motors :]
        """Inputs of the actuators along the body, shape (N, n_muscles)."""
        self.is_held = held is not None
        """Whether lengths of actuators are given."""
        self.strains = states.q_springs if states.strains is None else states.strains
        """The strains, shape (N, n_strains)."""
        self.slopes: tuple[FloatArray, FloatArray] | None = None
        """Derivatives of the strains by given lengths, (N, n_strains, n_muscles), and by elastic coordinates; None: 0 and 1."""
        if held is not None and states.strains is None:
            points: list[Any] = [held.at(u, y) for u, y in zip(states.q_motors, states.q_springs, strict=True)]
            self.strains = np.array([point.strains for point in points])
            by_lengths, by_free = zip(*(point.strain_slopes for point in points), strict=True)
            self.slopes = np.array(by_lengths), np.array(by_free)
        self.springs = SpringStates(model, self.numbers, self.strains)
        """The springs."""
        self.actuators: ActuatorStates | None = None
        """The actuators along the body, if there are any."""
        if model.muscles:
            tensions = states.actuator_loads[:, self.n_joint_motors :]
            self.actuators = ActuatorStates(model, self.numbers, self.strains, self.inputs, tensions)

    @property
    def valid(self) -> bool:
        """Whether every section is in range; nothing else has a meaning otherwise."""
        return self.sections is None or self.chain.valid

    @cached_property
    def tree(self) -> LoadedTree:
        """The joints under the loads."""
        structure = self.model.structure
        joints = np.zeros((len(self.strains), self.model.pinocchio.nv))
        joints[:, structure.motor_indices] = self.states.q_motors[:, : self.n_joint_motors]
        joints[:, structure.spring_indices] = self.strains[:, : self.n_singles]
        if self.sections is not None:
            joints[:, self.sections] = self.chain.positions - self.numbers["section_joints"]
        return LoadedTree(self.model, self.numbers, joints, self.states.loads)

    @cached_property
    def chain(self) -> SectionChain:
        """The sections of constant strain."""
        return SectionChain(self.by_section(self.strains[:, None])[:, 0], self.numbers["section_lengths"])

    @cached_property
    def compliance(self) -> FloatArray:
        """Inverse of the tangent stiffness, shape (N, n_springs, n_springs).

        Raises:
            NeutralEquilibrium: If one is singular, see `inverse_stiffness`.
        """
        stiffness, tangent = self.model.stiffness, self.states.tangent
        with contextlib.suppress(np.linalg.LinAlgError):
            inverse: FloatArray = np.asarray(np.linalg.inv(tangent), dtype=np.float64)
            squares = stiffness @ (inverse * inverse) @ stiffness  # as in `inverse_stiffness`: far from neutral
            if (squares < POSITIVE**-2).all():
                return inverse
        return np.array([inverse_stiffness(self.model, one) for one in tangent])

    def joint_rates(self, motors: FloatArray, strains: FloatArray) -> FloatArray:
        """Rates of the joints, shape (N, L, n_joints), at those of motor joints and of the strains, shape (N, L, ...)."""
        structure = self.model.structure
        rates: FloatArray = np.zeros((*strains.shape[:2], self.model.pinocchio.nv))
        rates[..., structure.motor_indices] = motors
        rates[..., structure.spring_indices] = strains[..., : self.n_singles]
        if self.sections is not None:
            rates[..., self.sections] = (self.chain.first[:, None] @ self.by_section(strains)[..., None])[..., 0]
        return rates

    def on_strains(self, on_joints: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Loads on motor joints, (N, L, n_joint_motors), and strains, (N, L, n_strains), of those on joints, (N, L, n)."""
        structure = self.model.structure
        motors, strains = (on_joints.take(one, -1) for one in (structure.motor_indices, structure.spring_indices))
        if self.sections is None:
            return motors, strains
        by_section = (on_joints[..., self.sections][..., None, :] @ self.chain.first[:, None])[..., 0, :]
        by_section = by_section.reshape(*strains.shape[:2], self.each * len(self.sections))
        return motors, np.concatenate([strains, by_section], axis=-1)

    def by_coordinates(self, by_joint: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of rows that joints change by motor joints and strains, shapes (N, L, n_joint_motors), (N, L, n_strains).

        Args:
            by_joint: Derivatives by the joint positions, shape (N, L, n_joints).
            rates: The rates of the strains in which loads work, shape (N, L, n_strains): the map turns with the strains.
        """
        motors, strains = self.on_strains(by_joint)
        if self.sections is not None:
            bending = self.chain.curvature(self.tree.torque[:, self.sections])
            turned = (bending[:, None] @ self.by_section(rates)[..., None])[..., 0]
            strains[..., self.n_singles :] += turned.reshape(*strains.shape[:2], self.each * len(self.sections))
        return motors, strains

    def by_sections(self, by_twist: FloatArray, rates: FloatArray) -> dict[str, FloatArray]:
        """The same by what the map of the sections depends on, by the names of `model_numbers`.

        Of the joints of a section only the chord `c` depends on its length `l`, in proportion.
        """
        at_sections = self.tree.at_joints(by_twist)[..., self.sections]
        chord, torque = self.chain.first[:, None, :, 2], self.tree.torque[:, None, self.sections[:, 2]]
        turned = (chord[..., :3] * self.by_section(rates)[..., :3]).sum(-1)
        longer = at_sections[..., 2] * self.chain.positions[:, None, :, 2] + torque * turned
        return {"section_lengths": longer / self.chain.lengths[:, None], "section_joints": -at_sections}

    def by_section(self, strains: FloatArray) -> FloatArray:
        """Strains of sections, shape (N, L, n_sections, k), of all strains, shape (N, L, n_strains)."""
        return strains[..., self.n_singles :].reshape(*strains.shape[:2], len(self.sections), self.each)


class AdjointRows:
    """Rows of outputs of N equilibria, with their derivatives by everything, the equilibria following."""

    def __init__(
        self, at: EquilibriumDerivatives, outputs: Outputs, solved: tuple[FloatArray, FloatArray] | None = None
    ) -> None:
        """Solve for the rows.

        Args:
            at: The equilibria.
            outputs: The outputs, without loads on actuators if the rows are known.
            solved: The rows where they are known: `by_actuators`, and the strains of the virtual motion, (N, L, n_strains).

        Raises:
            NeutralEquilibrium: If the tangent stiffness of a state is singular.
        """
        self._at, self._outputs, count = at, outputs, at.n_joint_motors
        given = next(one for one in (outputs.pose, outputs.loads, outputs.strains, outputs.forces) if one is not None)
        shape = given.shape[:2]
        self._weights = np.zeros((*shape, at.model.n_motors)) if outputs.loads is None else outputs.loads
        self._lengths = np.zeros((*shape, at.model.n_motors - count))  # weights of the lengths of actuators at the same strains
        self.by_actuators, strains = self._solved() if solved is None else solved
        """Derivatives of the outputs by the actuators, shape (N, L, n_motors)."""
        if at.is_held:
            self._lengths = -self.by_actuators[..., count:]
        self._move(strains)

    def _solved(self) -> tuple[FloatArray, FloatArray]:
        at, outputs, count = self._at, self._outputs, self._at.n_joint_motors
        strains = np.zeros((*self._weights.shape[:2], at.strains.shape[1]))
        if at.slopes is not None:
            strains = self._weights[..., count:] @ np.swapaxes(at.slopes[0], -1, -2)
        self._move(strains, works=outputs.loads is not None)
        by_actuators = np.zeros(self._weights.shape)
        by_actuators[..., :count], elastic = self.by_coordinates()
        if outputs.strains is not None:
            elastic = elastic + outputs.strains
        if at.slopes is not None:
            by_actuators[..., count:], elastic = elastic @ at.slopes[0], elastic @ at.slopes[1]
        elif at.actuators is not None:
            by_actuators[..., count:] = self._weights[..., count:] * at.actuators.by_input[:, None]
        if at.contact is None:
            virtual = elastic @ at.compliance
        else:
            virtual, self._gaps = at.contact.rows_of(elastic, self._weights, outputs.forces)
            by_actuators += self._weights @ at.contact.loads_by_motors - self._gaps @ at.contact.by_motors
        strains = strains + (virtual if at.slopes is None else virtual @ np.swapaxes(at.slopes[1], -1, -2))
        return by_actuators + virtual @ at.states.coupling, strains

    def by_contacts(self, parameters: ParameterSet) -> FloatArray:
        """What the parameters of the model add through gaps and contact load at constant coordinates, shape (N, L, P)."""
        if self._at.contact is None:
            return np.zeros((*self.virtual.shape[:2], len(parameters.names)))
        return self._at.contact.along(parameters, self.virtual, self._weights, self._gaps)

    def _move(self, strains: FloatArray, *, works: bool = True) -> None:
        """Take virtual rates of strains, (N, L, n_strains), in which loads work; without `works` they are zero."""
        self.virtual, self._works = strains, works
        vars(self).pop("_motion", None)

    @cached_property
    def _pose(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the weighted pose by twists of what is from each joint on, and of the frame; see `pose_slopes`."""
        at, outputs, shape = self._at, self._outputs, self.virtual.shape[:2]
        if outputs.pose is None:
            return np.zeros((shape[0], at.model.pinocchio.nv, shape[1], 6)), np.zeros((*shape, 6))
        return at.tree.pose_slopes(outputs.frame, outputs.pose)

    @cached_property
    def _motion(self) -> tuple[FloatArray, FloatArray]:
        """Virtual twists of the bodies, and derivatives of pose and work by the twist of what is from each joint on."""
        at = self._at
        if not self._works:
            return np.zeros(0), self._pose[0]
        twists, each = at.tree.twists(at.joint_rates(self._weights[..., : at.n_joint_motors], self.virtual))
        return twists, self._pose[0] + at.tree.work_slopes(twists, each)

    def by_coordinates(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of pose and work by motor joints and strains, at fixed rates."""
        at = self._at
        motors, by_strains = at.by_coordinates(at.tree.at_joints(self._motion[1]), self.virtual)
        if self._works:
            by_strains = by_strains - at.springs.tangent(self.virtual)
        if self._works and at.actuators is not None:
            by_strains = by_strains + self._of_actuators(at.actuators)[0]
        return motors, by_strains

    def _of_actuators(self, actuators: ActuatorStates) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Derivatives of what actuators do, by strains, and by their numbers."""
        return actuators.slopes(self._lengths, self._weights[..., self._at.n_joint_motors :], self.virtual)

    def by_numbers(self, change: ModelChange, direct: Mapping[str, FloatArray] | None = None) -> FloatArray:
        """Derivatives of the outputs by the parameters of a change, (N, L, P), with those by what is set `direct`, by name."""
        at, found, changed = self._at, dict(direct or {}), change.by_number.keys()
        if changed & _OF_SECTIONS:
            found |= at.by_sections(self._motion[1], self.virtual)
        if at.actuators is not None and changed & OF_ACTUATORS:
            found |= self._of_actuators(at.actuators)[1]
        if at.is_held and at.actuators is not None and "held_slopes" in changed:
            found |= self._of_held_directions(at.actuators)
        if "masses" in changed and (by_masses := at.tree.by_masses(self._motion[0])) is not None:
            found["masses"] = np.swapaxes(by_masses, 1, 2)
        if changed & _OF_SPRINGS:
            found |= at.springs.slopes(self.virtual)
        if "placements" in changed:
            found["placements"] = np.swapaxes(at.tree.at_placements(self._motion[1]), 1, 2)
        total = change.along(found) if found else np.zeros((*self.virtual.shape[:2], change.n_parameters))
        if "frames" in changed:
            frames, by_frame = (
                change.by_number["frames"].reshape(-1, 6, change.n_parameters),
                at.tree.by_frames(self._motion[0]),
            )
            if self._outputs.pose is not None:
                by_frame[self._outputs.frame] = self._pose[1] + by_frame.get(self._outputs.frame, 0.0)
            for name, rows in by_frame.items():
                total += rows @ frames[at.model.frame_id(name)]
        return total

    def by_loads(self) -> dict[str, FloatArray]:
        """Derivatives of the outputs by the wrench at each frame, shape (N, L, 6), and by gravity, "", shape (N, L, 3)."""
        return self._at.tree.by_loads(self._motion[0])

    def by_base(self) -> FloatArray:
        """Derivatives of the outputs by a motion of the base (position, then rotation) while loads stay, shape (N, L, 6)."""
        tree = self._at.tree
        total: FloatArray = self._motion[1].take(np.flatnonzero(tree.topology.parents < 0), 1).sum(axis=1)
        if self._outputs.pose is not None and tree.frame(self._outputs.frame)[0] < 0:
            total += self._pose[1]
        return total

    def _of_held_directions(self, actuators: ActuatorStates) -> dict[str, FloatArray]:
        """By the numbers that tell which sums of strains more lengths than needed hold."""
        at, inverse = self._at, np.linalg.pinv(self._at.numbers["held_slopes"])
        missed = at.numbers["path_rest"] + actuators.changes - at.inputs
        sums = at.states.actuator_loads[:, at.n_joint_motors :] @ inverse
        felt = self._weights[..., at.n_joint_motors :] - actuators.arms(self.virtual)
        slopes = sums[:, None, :, None] * felt[..., None, :] + (self._lengths @ inverse)[..., None] * missed[:, None, None]
        return {"held_slopes": slopes}
