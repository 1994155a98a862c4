"""Independent statics, written plainly, to check answers of the solvers.

It takes from a model the rigid bodies (placements, axes, masses), the names and numbers of springs, sections and muscles as the
description has them, and nothing of the solvers: forces and moments are summed from the tip to the base, a section is the
matrix exponential of its strain, its joints come from that pose by the formulas of
`softrobots.constant_curvature.strain_chain`, and derivatives of those are complex steps. Where muscle lengths are given,
strains come from the model's elastic coordinates; the lengths, and the balance of what they leave free, are checked with the
muscle rows of this module. Whole batches of cases are evaluated at once, for any number of joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.description.tag_reader import read_tags
from softrobots.model.soft_model import SoftModel
from studies.soak.plain_muscles import PlainMuscles
from studies.soak.plain_sections import section_joints, section_slopes


class Case(NamedTuple):
    """Cases of one robot, one row each."""

    motors: FloatArray
    """Actuator coordinates, shape (n, n_motors) [rad, m or N]."""
    forces: FloatArray
    """Force on the tip, shape (n, 3) [N]."""
    gravity: FloatArray
    """Gravity, shape (n, 3) [m/s^2]."""
    moments: FloatArray
    """Moment on the tip, shape (n, 3) [N m]."""

    def row(self, number: int) -> Case:
        """One case, as a batch of one."""
        return Case(*(array[number : number + 1] for array in self))

    def repeated(self, count: int) -> Case:
        """A batch of one, many times."""
        return Case(*(np.repeat(array, count, axis=0) for array in self))


class Push(NamedTuple):
    """A force on a body, in every case."""

    body: int
    """Number of the body: that of its joint."""
    force: FloatArray
    """World axes, shape (3,) [N]."""
    point: FloatArray
    """Where it acts, in the world, shape (3,) [m]."""


class Balance(NamedTuple):
    """Robots under load, one row each."""

    residual: FloatArray
    """What is out of balance in the elastic coordinates, shape (n, n_springs) [N m or N]."""
    imbalance: FloatArray
    """Size of what is out of balance in all that given muscle lengths leave free, shape (n,) [N m]."""
    size: FloatArray
    """Size of the load, `|f| reach + |moment| + |g|`, with tensions times the reach, shape (n,) [N m]."""
    motor_torques: FloatArray
    """Load on the motor joints, shape (n, n_motor_joints) [N m or N]."""
    tip: FloatArray
    """The tip, shape (n, 3) [m]."""
    rounding: FloatArray
    """How exact the residual is, for stiff springs that are bent, shape (n,) [N m]."""
    held: FloatArray
    """How far muscles are from their given lengths at most, shape (n,) [m]; 0 without given lengths."""


class PlainStatics:
    """The statics of a robot, written plainly."""

    def __init__(self, model: SoftModel) -> None:
        """Take the constants."""
        self.model = model
        """The robot."""
        rigid = model.pinocchio
        self._count = rigid.njoints
        self._parents = [int(parent) for parent in rigid.parents]
        self._places = [int(rigid.joints[number].idx_v) if number else -1 for number in range(self._count)]
        self._rotations = [np.array(placement.rotation) for placement in rigid.jointPlacements]
        self._translations = [np.array(placement.translation) for placement in rigid.jointPlacements]
        self._axes = [(False, np.zeros(3)), *(_axis(rigid, number) for number in range(1, self._count))]
        self.inertias = [(float(body.mass), np.array(body.inertia)) for body in rigid.inertias]
        """Mass [kg] and inertia [kg m^2] of each body about its centre of mass, in its own axes."""
        self._masses = [(float(body.mass), np.array(body.lever)) for body in rigid.inertias]
        tip = rigid.frames[model.frame_id(model.tip)]
        self._tip_parent, self._tip = int(tip.parentJoint), np.array(tip.placement.translation)
        tags, table = read_tags(model.urdf), model.spring_table
        numbers = {str(name): number for number, name in enumerate(rigid.names)}
        column = {name: self._places[number] for name, number in numbers.items()}
        springs = sorted(table, key=lambda name: numbers[name])
        sections = sorted(tags.sections, key=lambda tag: numbers[tag.joints[0]])
        self._motor_columns = [column[name] for name in sorted(model.structure.motor_joints, key=lambda name: numbers[name])]
        self._spring_columns = [column[name] for name in springs]
        self._section_columns = np.array([[column[name] for name in tag.joints] for tag in sections], dtype=int).reshape(-1, 6)
        self._lengths = np.array([tag.bends for tag in sections])
        self._kept = any(np.isinf(tag.axial_stiffness) for tag in sections)  # sections keep their length
        moving = ("bend_x", "bend_y", "twist", "stretch")[: 4 - self._kept]
        rest = [[*(strain * tag.length for strain in tag.rest[:3]), (tag.rest[3] - 1.0) * tag.length] for tag in sections]
        self._rest_sections = np.array(rest).reshape(-1, 4)
        by_tag = [[tag.bending_stiffness] * 2 + [tag.torsional_stiffness, tag.axial_stiffness] for tag in sections]
        each = np.array([tag.length for tag in sections]).reshape(-1, 1)
        by_section = np.array(by_tag).reshape(-1, 4)[:, : len(moving)] / each
        self._stiffness = np.concatenate([[table[name][0] for name in springs], by_section.ravel()])
        self._rest = np.concatenate([[table[name][1] for name in springs], self._rest_sections[:, : len(moving)].ravel()])
        names = [*springs, *(f"{tag.name}_{strain}" for tag in sections for strain in moving)]
        self._plateaus = [
            ([names.index(names_of) for names_of in self._names(group)], group.max_moment)
            for group in model.spring_groups
            if group.max_moment is not None
        ]
        self._muscles = PlainMuscles(read_tags(model.urdf), names)
        self._lengths_given = len(model.muscles) > 0 and model.muscle_input == "lengths"
        held = model.structure.muscle_lengths
        self._free = np.eye(len(names)) if held is None else np.array(held.free.T)  # without twist
        self.stiffness = np.einsum("is,s,is->i", self._free, self._stiffness, self._free)
        """Stiffness of the elastic coordinates at rest, shape (n_springs,) [N m/rad or N/m]."""

    def _names(self, group: Any) -> list[str]:
        return [self.model.spring_joints[place] for place in group.springs]

    def balance(self, case: Case, springs: FloatArray, pushes: Sequence[Push] = ()) -> Balance:
        """Sum up the loads.

        Args:
            case: Actuators and loads, n rows.
            springs: Elastic coordinates, shape (n, n_springs).
            pushes: More forces, each on a point of a body.

        Returns:
            What is out of balance, n rows.
        """
        strains = self._strains(case.motors, springs)
        torques, size, tip = self._torques(case, strains, pushes)
        rows = self._spring_loads(strains)
        rounding = 16.0 * np.finfo(np.float64).eps * np.linalg.norm(rows, axis=1)
        count = len(self._spring_columns)
        rows[:, :count] -= torques[:, self._spring_columns]
        if len(self._lengths):
            slopes = section_slopes(self._by_section(strains), self._lengths)[..., : 4 - self._kept]
            rows[:, count:] -= np.einsum("nsj,nsjz->nsz", torques[:, self._section_columns], slopes).reshape(len(rows), -1)
        held = np.zeros(len(strains))
        residual = rows
        if len(self.model.muscles):
            lengths, slopes = self._muscles.at(strains)
            given = case.motors[:, len(self._motor_columns) :]
            if self._lengths_given:
                held = np.abs(lengths - given).max(axis=1)
                # The free coordinates move the springs of the sums so that the lengths stay.
                back = (self._muscles.rows / self._stiffness).T
                share = np.linalg.solve(slopes @ back, slopes @ self._free.T)
                residual = rows @ self._free.T - np.einsum("ns,sm,nmi->ni", rows, back, share)
                rows = rows - np.einsum("nm,nms->ns", np.einsum("ns,nsm->nm", rows, np.linalg.pinv(slopes)), slopes)
            else:
                tensions = self._muscles.tensions(lengths, given)
                residual = rows = rows + np.einsum("nm,nms->ns", tensions, slopes)
                size = size + np.abs(tensions).sum(axis=1) * self.model.reach
        imbalance = np.linalg.norm(rows, axis=1)
        return Balance(residual, imbalance, size, torques[:, self._motor_columns], tip, rounding, held)

    def _strains(self, motors: FloatArray, springs: FloatArray) -> FloatArray:
        if not self._lengths_given:
            return springs
        return np.array([self.model.structure.strains(*row) for row in zip(motors, springs, strict=True)])

    def _by_section(self, strains: FloatArray) -> FloatArray:
        z = strains[:, len(self._spring_columns) :].reshape(len(strains), len(self._lengths), -1)
        return np.pad(z, ((0, 0), (0, 0), (0, 4 - z.shape[2])))

    def _spring_loads(self, strains: FloatArray) -> FloatArray:
        loads = self._stiffness * (strains - self._rest)
        for places, largest in self._plateaus:
            moment = np.linalg.norm(loads[:, places], axis=1)
            loads[:, places] *= np.where(moment > largest, largest / np.maximum(moment, largest), 1.0)[:, None]
        return np.asarray(loads)

    def _torques(
        self, case: Case, strains: FloatArray, pushes: Sequence[Push] = ()
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Load on every joint, shape (n, nv); the size of the load; and the tip."""
        n = len(strains)
        turns, points = self._bodies(case.motors, strains)
        tip = points[self._tip_parent] + turns[self._tip_parent] @ self._tip
        pulled = self._carried(turns, points, tip, case.forces, case.moments, None, pushes)
        weighed = self._carried(turns, points, tip, np.zeros((n, 3)), np.zeros((n, 3)), case.gravity)
        norm = np.linalg.norm
        size = norm(case.forces, axis=1) * self.model.reach + norm(case.moments, axis=1) + norm(weighed, axis=1)
        return pulled + weighed, size, tip

    def bodies(self, motors: FloatArray, springs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotation, shape (n, b, 3, 3), and position of the centre of mass, shape (n, b, 3) [m], of every body.

        Args:
            motors: Actuators, n rows.
            springs: Elastic coordinates, shape (n, n_springs).
        """
        turns, points = self._bodies(motors, self._strains(motors, springs))
        centres = [point + turn @ lever for point, turn, (_, lever) in zip(points, turns, self._masses, strict=True)]
        return np.stack(turns, axis=1), np.stack(centres, axis=1)

    def frames(self, motors: FloatArray, springs: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """Rotation and origin of every body in the world, shapes (n, 3, 3) and (n, 3); arguments as of `bodies`."""
        return self._bodies(motors, self._strains(motors, springs))

    def _bodies(self, motors: FloatArray, strains: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """The same at strains."""
        joints = self._joints(motors, strains)
        n = len(joints)
        turns: list[FloatArray] = [np.tile(np.eye(3), (n, 1, 1))]
        points: list[FloatArray] = [np.zeros((n, 3))]
        for number in range(1, self._count):
            parent = self._parents[number]
            turn = turns[parent] @ self._rotations[number]
            point = points[parent] + turns[parent] @ self._translations[number]
            slides, axis = self._axes[number]
            coordinate = joints[:, self._places[number]]
            if slides:
                point = point + (turn @ axis) * coordinate[:, None]
            else:
                turn = turn @ _turns(axis, coordinate)
            turns.append(turn)
            points.append(point)
        return turns, points

    def _carried(
        self,
        turns: list[FloatArray],
        points: list[FloatArray],
        tip: FloatArray,
        force: FloatArray,
        moment: FloatArray,
        gravity: Any,
        pushes: Sequence[Push] = (),
    ) -> FloatArray:
        """Torque that each joint must carry, from the tip to the base."""
        n = len(tip)
        forces: list[FloatArray] = [np.zeros((n, 3)) for _ in range(self._count)]
        moments: list[FloatArray] = [np.zeros((n, 3)) for _ in range(self._count)]  # about the origin of the world
        forces[self._tip_parent] = np.array(force)
        moments[self._tip_parent] = moment + np.cross(tip, force)
        for push in pushes:
            forces[push.body] = forces[push.body] + push.force
            moments[push.body] = moments[push.body] + np.cross(push.point, push.force)
        torques = np.zeros((n, self.model.pinocchio.nv))
        for number in range(self._count - 1, 0, -1):
            if gravity is not None:
                mass, lever = self._masses[number]
                weight = mass * gravity
                forces[number] = forces[number] + weight
                moments[number] = moments[number] + np.cross(points[number] + turns[number] @ lever, weight)
            slides, axis = self._axes[number]
            carried = forces[number] if slides else moments[number] - np.cross(points[number], forces[number])
            torques[:, self._places[number]] = np.einsum("ni,ni->n", turns[number] @ axis, carried)
            parent = self._parents[number]
            forces[parent] = forces[parent] + forces[number]
            moments[parent] = moments[parent] + moments[number]
        return torques

    def _joints(self, motors: FloatArray, strains: FloatArray) -> FloatArray:
        """Joint positions in the order of Pinocchio's velocities, shape (n, nv)."""
        joints = np.zeros((len(strains), self.model.pinocchio.nv))
        count = len(self._spring_columns)
        joints[:, self._motor_columns] = motors[:, : len(self._motor_columns)]
        joints[:, self._spring_columns] = strains[:, :count]
        if len(self._lengths):
            z = self._by_section(strains)
            at_rest = section_joints(self._rest_sections, self._lengths)
            joints[:, self._section_columns] = (section_joints(z, self._lengths) - at_rest).real
        return joints


def _turns(axis: FloatArray, angles: FloatArray) -> FloatArray:
    """Rotations about an axis, shape (n, 3, 3)."""
    x, y, z = axis
    spin = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result = np.eye(3) + np.sin(angles)[:, None, None] * spin + (1.0 - np.cos(angles))[:, None, None] * (spin @ spin)
    return np.asarray(result)


def _axis(rigid: Any, number: int) -> tuple[bool, FloatArray]:
    """Whether a joint slides, and its axis in its own frame."""
    joint = rigid.joints[number]
    data = joint.createData()
    joint.calc(data, pin.neutral(rigid))
    motion = np.asarray(data.S, dtype=np.float64).reshape(6)
    slides = not np.any(motion[3:])
    return slides, np.array(motion[:3] if slides else motion[3:])
