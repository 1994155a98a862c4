"""Derivatives of the torques of springs by stiffness, rest and the moment laws of inflated links, for many states at once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray
from softrobots.model.numbers import strain_springs
from softrobots.model.soft_model import SoftModel


class SpringStates:
    r"""The springs of N states of a robot, at strains of shape (N, n_strains).

    Each law of the moment `M` at the angle `rho` has the form `M = M_1 f(k rho / M_1)`, so that with its tangent `M'`
    :math:`k\,\partial M/\partial k = \rho M'` and :math:`M_1\,\partial M/\partial M_1 = M - \rho M'`.
    """

    def __init__(self, model: SoftModel, numbers: Mapping[str, FloatArray], strains: FloatArray) -> None:
        """Evaluate the laws of inflated links."""
        stiffness, groups = numbers["stiffness"], strain_springs(model).groups
        self._stiffness, self._stretch, self._count = stiffness, strains - numbers["rest"], len(groups)
        self._by_stiffness, self._hinges = self._stretch.copy(), []
        for number, group in enumerate(groups):
            first = group.linear_up_to
            if first is None:
                continue
            for hinge in group.hinges:
                places, k = list(hinge), float(stiffness[hinge[0]])
                angles = self._stretch[:, places]
                bend = np.linalg.norm(angles, axis=-1)
                if group.slack_wall:
                    law = inflated_beam.slack_wall_moment(bend, stiffness=k, slack_moment=first)
                    moment, tangent = law.moment, law.tangent
                else:
                    moment, tangent = np.minimum(k * bend, first), np.where(k * bend <= first, k, 0.0)
                secant = np.where(bend > 0.0, moment / np.where(bend > 0.0, bend, 1.0), k)
                along = angles / np.where(bend > 0.0, bend, 1.0)[:, None]
                self._by_stiffness[:, places] *= (tangent / k)[:, None]
                by_moment = (moment - tangent * bend)[:, None] * along / first
                self._hinges.append((number, places, along, secant - k, tangent - secant, by_moment))

    def tangent(self, rates: FloatArray) -> FloatArray:
        """Rates of the torques at rates of the strains, both of shape (N, L, n_strains)."""
        torques = self._stiffness * rates
        for _, places, along, less, bending, _ in self._hinges:
            turned = rates[..., places]
            share = bending[:, None] * (turned * along[:, None]).sum(-1)
            torques[..., places] += less[:, None, None] * turned + share[..., None] * along[:, None]
        return torques

    def slopes(self, rates: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of minus the work of the torques in virtual rates, by the names of `model_numbers`."""
        moments = np.zeros((*rates.shape[:2], self._count))
        for number, places, *_, by_moment in self._hinges:
            moments[..., number] -= (rates[..., places] * by_moment[:, None]).sum(-1)
        return {"stiffness": -rates * self._by_stiffness[:, None], "rest": self.tangent(rates), "moments": moments}

    def rates(self, change: Mapping[str, FloatArray]) -> FloatArray:
        """Rates of minus the torques, shape (N, n_strains), at rates of the numbers, shape (N or 1, ...) by the same names."""
        loads: FloatArray = np.zeros(self._stretch.shape)
        if "stiffness" in change:
            loads -= self._by_stiffness * change["stiffness"]
        if "rest" in change:
            loads += self.tangent(np.broadcast_to(change["rest"], loads.shape)[:, None])[:, 0]
        if "moments" in change:
            for number, places, *_, by_moment in self._hinges:
                loads[:, places] -= by_moment * change["moments"][:, number, None]
        return loads
