r"""Derivatives of the lengths and tensions of actuators by their constants, for many states at once.

The length of a path is that of its tangent, :math:`n = \sqrt{A^2 + |B|^2}` with `A` and `B` affine in the section coordinates
(`softrobots.model.muscle_paths`), or, of a straight path along a lumped section, :math:`a \cdot z + B^2 / 2 h`. A change of its
constants changes the length, and the moment arms :math:`\partial l / \partial z` that carry the tension to the strains.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.actuator_laws import ROUNDING, ActuatorLaws
from softrobots.model.numbers import LAW
from softrobots.model.soft_model import SoftModel


class ActuatorStates:
    """The actuators of N states of a robot."""

    def __init__(
        self, model: SoftModel, numbers: Mapping[str, FloatArray], strains: FloatArray, inputs: FloatArray, tensions: FloatArray
    ) -> None:
        """Take the strains, shape (N, n_strains), inputs and tensions, each shape (N, n_muscles)."""
        structure = model.structure
        self._paths, self._numbers, self._tags, self._tensions = structure.muscle_paths, numbers, structure.muscles, tensions
        self._z = self._at_paths(strains)
        places = structure.muscle_paths.places.ravel()
        self._to_strains = np.eye(strains.shape[1] + 1)[places, : strains.shape[1]]
        paths, (back, side) = self._paths, np.moveaxis(self._paths.across, 1, 0)
        self._along = paths.length + (self._z * paths.arms).sum(-1)
        self._around, self._radial = paths.turned + (self._z * back).sum(-1), (self._z * side).sum(-1)
        size = np.sqrt(self._along**2 + self._around**2 + self._radial**2)
        self._size = np.where(paths.separable, paths.length, size)
        self._by_size = np.where(paths.separable, 1.0, self._along / self._size)
        change = np.where(
            paths.separable,
            self._along - paths.length + (self._around**2 - paths.turned**2) / (2.0 * paths.length),
            size - paths.length,
        )
        self.changes = self._summed(change)
        """Lengths minus those where all strains are zero, shape (N, n_muscles) [m]."""
        self.by_law = structure.actuator_laws is not None
        """Whether the actuators pull by their laws; otherwise their lengths are given."""
        if self.by_law:
            self._differentiate_laws(inputs)
            self._tensions = self.pulls

    def _at_paths(self, strains: FloatArray) -> FloatArray:
        """Section coordinates of each path, shape (..., n_paths, 4), of strains, shape (..., n_strains)."""
        return np.concatenate([strains, np.zeros((*strains.shape[:-1], 1))], axis=-1)[..., self._paths.places]

    def _summed(self, values: FloatArray) -> FloatArray:
        """Sums over the paths of each actuator."""
        return np.asarray(np.add.reduceat(values, self._paths.starts, axis=-1))

    def arms(self, rates: FloatArray) -> FloatArray:
        """Rates of the lengths, shape (N, L, n_muscles), at rates of the strains, shape (N, L, n_strains)."""
        paths, turned = self._paths, self._at_paths(rates)
        across = self._around[:, None] * (turned * paths.across[:, 0]).sum(-1)
        across += self._radial[:, None] * (turned * paths.across[:, 1]).sum(-1)
        each = self._by_size[:, None] * (turned * paths.arms).sum(-1) + across / self._size[:, None]
        return self._summed(each)

    @cached_property
    def _pointing(self) -> FloatArray:
        """Derivative of the length of each path by `A` and both parts of `B`, shape (N, n_paths, 3)."""
        return np.stack([self._by_size, self._around / self._size, self._radial / self._size], axis=-1)

    def stiffness(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives by strains of lengths, (N, n_muscles, n_strains), and of the load of laws, (N, n_strains, n_strains)."""
        paths, pointing, count = self._paths, self._pointing, self._to_strains.shape[1]
        rows = np.concatenate([paths.arms[:, None], paths.across], axis=1)
        across = np.eye(3) - pointing[..., None] * pointing[..., None, :]
        across[:, paths.separable] = np.diag([0.0, 1.0, 1.0])
        turned = rows.swapaxes(1, 2) @ across @ rows * (self._tensions[:, paths.muscle] / self._size)[..., None, None]
        each, n = (pointing[..., None, :] @ rows)[..., 0, :], len(pointing)
        arms, loads = np.zeros((n, len(self._tags), count + 1)), np.zeros((n, count + 1, count + 1))
        for path, places in enumerate(paths.places):  # of what is no strain at the end
            arms[:, paths.muscle[path], places] += each[:, path]
            loads[:, places[:, None], places] += turned[:, path]
        arms = arms[..., :count]
        return arms, loads[:, :count, :count] + arms.swapaxes(1, 2) @ (self.by_length[..., None] * arms)

    def _differentiate_laws(self, inputs: FloatArray) -> None:
        kinds = np.array([tag.kind for tag in self._tags])
        stiffness, pretension, area, square, least, rest = self._numbers["laws"].T
        beyond = self._numbers["straightened"] + self.changes
        stretch = rest + beyond - inputs
        taut = (kinds == "elastic") & (pretension + stiffness * stretch > ROUNDING * stiffness * rest)
        share = 1.0 + beyond / rest
        braided = kinds == "mckibben"
        slack = np.sqrt(least / np.where(braided, square, 1.0))
        pulling = braided & (share > slack * (1.0 + ROUNDING))
        pulls = np.where(pulling, inputs, 0.0)
        slope = 2.0 * pulls * square * share / rest
        elastic = np.where(taut, stiffness, 0.0)
        self.by_length = elastic + slope
        """Derivative of the tensions by the lengths, shape (N, n_muscles) [N/m]."""
        pushes = np.where(kinds == "pressure", area, 0.0)
        pulled = np.where(pulling, square * share**2 - least, 0.0)
        self.by_input = np.where(kinds == "tension", 1.0, 0.0) - elastic - pushes + pulled
        """Derivative of the tensions by the inputs, the same shape."""
        self.pulls = ActuatorLaws(self._tags).at(beyond, inputs).tension
        """The tensions, the same shape."""
        by_number = {
            "stiffness": np.where(taut, stretch, 0.0),
            "pretension": np.where(taut, 1.0, 0.0),
            "area": np.where(kinds == "pressure", -inputs, 0.0),
            "square": pulls * share**2,
            "least": -pulls,
            "rest_length": elastic - slope * beyond / rest,
        }
        self._by_law = np.stack([by_number[name] for name in LAW], axis=-1)

    def slopes(self, lengths: FloatArray, tensions: FloatArray, rates: FloatArray) -> tuple[FloatArray, dict[str, FloatArray]]:
        r"""Derivatives of :math:`c_l \cdot l + c_T \cdot T - T \cdot (\partial l / \partial z) \lambda` by strains and numbers.

        Args:
            lengths: Weights of the lengths at fixed strains, shape (N, L, n_muscles).
            tensions: Weights of the tensions of laws, the same shape.
            rates: Virtual rates of the strains, shape (N, L, n_strains).

        Returns:
            By strains, shape (N, L, n_strains), and arrays of shape (N, L, ...) by the names of `model_numbers`.
        """
        found: dict[str, FloatArray] = {}
        if self.by_law:
            tensions = tensions - self.arms(rates)
            found["laws"] = tensions[..., None] * self._by_law[:, None]
            found["straightened"] = tensions * self.by_length[:, None]
            lengths = lengths + found["straightened"]
        else:
            found["path_rest"] = lengths
        paths, turned = self._paths, self._at_paths(rates)
        weight, pull = lengths[..., paths.muscle], -self._tensions[:, None, paths.muscle]
        separable, length = paths.separable, paths.length
        along, around, radial, size = (one[:, None] for one in (self._along, self._around, self._radial, self._size))
        a, b, c = (turned * paths.arms).sum(-1), (turned * paths.across[:, 0]).sum(-1), (turned * paths.across[:, 1]).sum(-1)
        rate = (around * b + radial * c + np.where(separable, 0.0, along * a)) / size
        inner = np.where(separable, 0.0, rate / size)
        by_along = np.where(separable, weight, (weight * along + pull * (a - along * inner)) / size)
        by_around = (weight * around + pull * (b - around * inner)) / size
        by_radial = (weight * radial + pull * (c - radial * inner)) / size
        by_rates = [pull * np.where(separable, 1.0, along / size), pull * around / size, pull * radial / size]
        of_lumped = -(weight * (around**2 - paths.turned**2) / 2.0 + pull * around * b) / length**2
        found["path_length"] = np.where(separable, of_lumped, by_along - weight)
        found["path_turned"] = by_around - np.where(separable, weight * paths.turned / length, 0.0)
        z = self._z[:, None]
        parts = [
            by[..., None] * z + rates_[..., None] * turned
            for by, rates_ in zip((by_along, by_around, by_radial), by_rates, strict=True)
        ]
        found["path_arms"], found["path_across"] = parts[0], np.stack(parts[1:], axis=-2)
        each = by_along[..., None] * paths.arms + by_around[..., None] * paths.across[:, 0]
        each += by_radial[..., None] * paths.across[:, 1]
        return each.reshape(*rates.shape[:2], each.shape[-2] * each.shape[-1]) @ self._to_strains, found

    def rates(self, change: Mapping[str, FloatArray], tensions: FloatArray) -> tuple[FloatArray, FloatArray]:
        r"""Rates of the lengths, and of the loads :math:`-T\,\partial l/\partial z`, at fixed strains.

        With :math:`u = (A, B)`, affine in the section coordinates by the rows `P`, a length is that of `u`, whose direction `n`
        gives :math:`\partial l/\partial z = n P`.

        Args:
            change: Rates of the numbers, shape (N or 1, ...) by the names of `model_numbers`.
            tensions: Rates of the tensions where lengths are given, shape (N, n_muscles).

        Returns:
            Shapes (N, n_muscles) [m] and (N, n_strains).
        """

        def of(name: str, like: FloatArray) -> FloatArray:
            return change.get(name, np.zeros((1, *like.shape)))

        paths, separable, z, size = self._paths, self._paths.separable, self._z, self._size[..., None]
        rows = np.concatenate([paths.arms[:, None], paths.across], axis=1)
        moved = np.concatenate([of("path_arms", paths.arms)[:, :, None], of("path_across", paths.across)], axis=2)
        length, turned = of("path_length", paths.length), of("path_turned", paths.turned)
        pointing = self._pointing
        tangent = (moved @ z[..., None])[..., 0]
        tangent[..., 0] += length
        tangent[..., 1] += turned
        growth = np.where(separable, length, (pointing * tangent).sum(-1))
        turning = (tangent - pointing * growth[..., None]) / size
        turning[..., 0] = np.where(separable, 0.0, turning[..., 0])
        rest, around = paths.turned / paths.length, pointing[..., 1]
        of_lumped = tangent[..., 0] + around * tangent[..., 1] - rest * turned - 0.5 * (around**2 - rest**2) * length
        lengths = self._summed(np.where(separable, of_lumped, growth) - length)
        if self.by_law:
            tensions = self.by_length * (lengths + of("straightened", paths.straightened))
            tensions = tensions + (self._by_law * of("laws", self._by_law[0])).sum(-1)
        else:
            lengths = lengths + of("path_rest", paths.rest)
        pulled = tensions[:, paths.muscle, None, None] * pointing[..., None, :] + (
            self._tensions[:, paths.muscle, None, None] * turning[..., None, :]
        )
        loads = pulled @ rows + (self._tensions[:, paths.muscle, None] * pointing)[..., None, :] @ moved
        return lengths, -loads.reshape(len(z), loads.shape[1] * loads.shape[-1]) @ self._to_strains
