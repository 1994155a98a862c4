"""Maps between actuator and elastic coordinates and the workspace of generated code."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.settings import LARGEST_POSITION
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.actuator_laws import ActuatorLaws, Tensions
from softrobots.model.soft_model import SoftModel

_CLOSING_STEPS = 8  # of the sums to the muscle lengths, where segments are twisted; each leaves a hundredth


class Actuation:
    """Maps of motors and muscle tensions (identity) and of muscle lengths (start of the strains)."""

    def __init__(self, model: SoftModel, unknowns: Unknowns, numbers: FloatArray | None = None) -> None:
        """Prepare the linear maps; `numbers` are those of the robot that are inputs of its code, None without any."""
        self._numbers = numbers
        self.model, self._chain, self._strains = model, unknowns.chain, list(unknowns.strains)
        chain = unknowns.chain
        self._count = chain.n_motors
        self._plain = unknowns.n_constraints == 0 and len(self._strains) == len(chain.stiffness)
        self._tensions, self._least = (
            chain.muscle_input == "forces" and len(chain.actuators) > 0,
            np.array(unknowns.least_inputs),
        )
        self._lengths, self._held = unknowns.n_constraints > 0, unknowns.held_lengths
        self._relaxed = chain.free @ model.rest  # strains at rest of elastic coordinates and muscles
        self._shares = np.zeros((len(chain.constrained), len(chain.stiffness)))  # of each strain in the sums
        for row, group in zip(self._shares, map(list, chain.constrained), strict=True):
            row[group] = 1.0 / chain.stiffness[group] / float((1.0 / chain.stiffness[group]).sum())
        strains = [bending for *bending, _ in chain.friction]
        self.rest_bending = chain.rest[np.array(strains, dtype=np.intp).reshape(-1, 2)]
        """Bending at rest of the sections with dry friction, shape (n_sections, 2) [rad]."""
        self.n_guides = 0 if chain.guides is None else chain.guides.n_guides
        """Number of guides that rub."""
        pairs = [(row, side, unknowns.place.get(one)) for row, pair in enumerate(strains) for side, one in enumerate(pair)]
        rubbing = [one for one in pairs if one[2] is not None]
        self._rubbing = np.array(rubbing, dtype=np.intp).reshape(-1, 3).T  # section, side, and place among the unknowns

    def sliders(self, bending: FloatArray) -> FloatArray:
        """Return the sliders of dry friction, shape (n, n_unknowns), from their bending, shape (n, n_sections, 2) [rad]."""
        sections, sides, places = self._rubbing
        sliders = np.zeros((len(bending), len(self._strains)))
        sliders[:, places] = bending[:, sections, sides]
        return sliders

    def bending(self, sliders: FloatArray) -> FloatArray:
        """Return the opposite of `sliders`; locked strains are at rest."""
        sections, sides, places = self._rubbing
        bending = np.tile(self.rest_bending, (len(sliders), 1, 1))
        bending[:, sections, sides] = sliders[:, places]
        return bending

    def workspace(self, run: Any, motors: FloatArray, **numbers: FloatArray) -> Any:
        """Return a workspace of one case: actuators, start, and other numbers by the name of their place in the layout."""
        layout, w = run.layout, run.workspace()
        run.put(w, 0, motors[: self._count])
        if self._tensions or self._held:
            run.put(w, layout.actuators, motors[self._count :])
        if self._lengths or self._numbers is not None:
            run.put(w, layout.start, self._starts(motors[None]))
        if self._numbers is not None:
            run.put(w, layout.numbers, self._numbers)
        for name, values in numbers.items():
            run.put(w, getattr(layout, name), values)
        return w

    def jacobian(self, run: Any, w: Any) -> FloatArray:
        """Return the elastostatic Jacobian of all actuators after `look_at_tip`, shape (3, n_motors)."""
        tip, chain = run.program.tip, self._chain
        joints = _rows(w, tip.jacobian, self._count)
        if self._held:
            return np.concatenate([joints, _rows(w, tip.constraint_columns, tip.n_constraints)], axis=1)
        if self._lengths:
            return np.concatenate(
                [joints, _rows(w, tip.constraint_columns, tip.n_constraints) @ chain.constrained_slope], axis=1
            )
        if self._tensions:  # a tension loads the strains with its arms
            stretch, pull = self._pulled(run, w)
            return np.concatenate([joints, -stretch.T * pull.by_input], axis=1)
        return joints

    def feeling(self, run: Any, w: Any) -> FloatArray:
        """Return the derivative of the actuators' loads by a force on the tip after `look_at_tip`, shape (n_motors, 3)."""
        if not self._tensions:
            return self.jacobian(run, w).T
        stretch, pull = self._pulled(run, w)
        joints = _rows(w, run.program.tip.jacobian, self._count)
        return np.concatenate([joints.T, stretch * pull.by_length[:, None]])

    def _pulled(self, run: Any, w: Any) -> tuple[FloatArray, Tensions]:
        """Return the derivative of the lengths by a force on the tip, shape (n_muscles, 3), and the tensions."""
        tip, strains = run.program.tip, np.array(self._chain.rest)
        strains[self._strains] = _rows(w, run.layout.unknown, len(self._strains), 1)[0]
        paths = self._chain.muscle_paths.at(strains)
        inputs = _rows(w, run.layout.actuators, run.layout.muscles, 1)[0]
        stretch = paths.arms[:, self._strains] @ _rows(w, tip.tip_columns, tip.unknowns).T
        return stretch, ActuatorLaws(self._chain.actuators).at(paths.elongation, inputs)

    def loads(self, run: Any, w: Any) -> FloatArray:
        """Return the load on motor joints and muscles after `look_at_tip`, shape (n_motors,) [N m or N].

        The multipliers are the loads beyond those of the start, see `looped_chain`.
        """
        tip = run.program.tip
        joints = _rows(w, tip.motor_torques, self._count, 1)[0]
        if self._held:
            return np.concatenate([joints, _rows(w, run.layout.held, tip.n_constraints, 1)[0]])
        if self._lengths:
            start = _rows(w, run.layout.start, len(self._strains), 1)
            return np.concatenate([joints, self._of_sums(start, _rows(w, tip.constraint_loads, tip.n_constraints, 1))[0]])
        if self._tensions:
            return np.concatenate([joints, self._pulled(run, w)[1].tension])
        return np.asarray(joints)

    def held(self, motors: FloatArray, multipliers: FloatArray) -> FloatArray:
        """Return the loads on muscles of given length, shape (n, n_muscles), from the multipliers of many cases, (n, h)."""
        return multipliers if self._held else self._of_sums(self._starts(motors), multipliers)

    def _of_sums(self, starts: FloatArray, multipliers: FloatArray) -> FloatArray:
        chain = self._chain
        first = [self._strains.index(group[0]) for group in chain.constrained]
        at_start = (chain.stiffness[self._strains] * (starts - chain.rest[self._strains]))[:, first]
        return np.asarray((multipliers - at_start) @ chain.constrained_slope)

    def rows(self, motors: FloatArray, layout: Layout) -> list[tuple[int, FloatArray]]:
        """Return places in the workspace and values of many cases: motor joints, loads of tensions, starts at the lengths."""
        inputs = [(0, motors[:, : self._count])]
        if self._tensions or self._held:
            inputs.append((layout.actuators, np.ascontiguousarray(motors[:, self._count :])))
        if self._lengths:
            starts = self._starts(motors)
            inputs += [(layout.start, starts), (layout.unknown, starts)]
        elif self._numbers is not None:
            inputs.append((layout.start, self._starts(motors[:1])))
        if self._numbers is not None:
            inputs.append((layout.numbers, self._numbers[None]))
        return inputs

    def unsuited(self, motors: FloatArray) -> Any:
        """Return a mask of the rows that no shape of the robot has or that are too large to compute with.

        It asks once about all rows that look like another unit.
        """
        bad = np.zeros(len(motors), dtype=bool)
        joints = motors[:, : self._count]
        if joints.size and not (joints.min() >= -LARGEST_POSITION and joints.max() <= LARGEST_POSITION):
            bad |= ~np.all(np.abs(joints) <= LARGEST_POSITION, axis=1)
        if self._tensions:
            bad |= ~np.all(motors[:, self._count :] >= self._least, axis=1)
        if self._lengths:
            admitted = (np.all(np.isfinite(row)) and self.model.actuators.admit(row) for row in motors)
            bad |= ~np.fromiter(admitted, dtype=bool, count=len(motors))
        self.model.actuators.questioned(motors)
        return bad

    def checked(self, q_motors: Any, field: str = "q_motors") -> FloatArray:
        """Return actuators of one case as `SoftModel.checked_motors` does.

        Raises:
            ParameterError: If they are invalid, or a motor position is too large to compute with.
        """
        motors = self.model.actuators.checked(q_motors, field)
        if np.any(np.abs(motors[: self._count]) > LARGEST_POSITION):
            raise ParameterError(
                field, q_motors, f"within +-{LARGEST_POSITION:g} rad or m at motor joints, for compiled solvers"
            )
        return self.model.actuators.questioned(motors)

    def unknowns(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the unknown strains of one case from its elastic coordinates, shape (n,)."""
        return np.asarray(self.of_elastic(motors[None], elastic[None])[0])

    def of_elastic(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the unknown strains of many cases, shape (n, n_unknowns)."""
        if self._plain:
            return elastic
        if self._held:
            held: Any = self.model.structure.muscle_lengths
            return np.array([held.strains(q, y) for q, y in zip(motors, elastic, strict=True)]).reshape(-1, len(self._strains))
        strains = elastic @ self._chain.free.T
        if self._lengths:
            paths, slope = self._chain.muscle_paths, self._chain.constrained_slope
            straight = strains = strains + (motors[:, self._count :] - paths.rest) @ self._chain.spread.T
            for _ in range(_CLOSING_STEPS):
                last, strains = strains, straight - paths.at(strains).excess @ slope.T @ self._shares
                if np.array_equal(last, strains):  # at once where nothing is twisted
                    break
        return np.asarray(strains[:, self._strains])

    def elastic(self, unknowns: FloatArray) -> FloatArray:
        """Return elastic coordinates from the unknowns, shape (..., n_springs); locked strains are at rest."""
        if self._plain:
            return unknowns
        strains = np.tile(self._chain.rest, (*unknowns.shape[:-1], 1))
        strains[..., self._strains] = unknowns
        return np.asarray(strains @ self._chain.elastic.T)

    def _starts(self, motors: FloatArray) -> FloatArray:
        if not self._lengths:
            return self._chain.rest[None, self._strains]
        change = motors[:, self._count :] - self._chain.muscle_paths.rest
        return np.ascontiguousarray((self._relaxed + change @ self._chain.spread.T)[:, self._strains])


def _rows(w: Any, place: int, count: int, rows: int = 3) -> FloatArray:
    """Return part of a workspace as a matrix."""
    return np.array(w[place : place + rows * count], dtype=np.float64).reshape(rows, count)
