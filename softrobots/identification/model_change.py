r"""How the numbers of a model change with parameters, by differences of models loaded with other values.

Central differences at :math:`p \pm h`, with `h` of 1e-5 of the scale of the parameter, are exact to 1e-10, of fourth order to
1e-12, which a sensitivity needs where effects cancel: a thicker wall makes a tube heavier and stiffer by nearly the same share.
At a bound they are one-sided, of second order. All that follows from the numbers is in closed form. A change may serve many
states of a model, and those of models nearby while a fit is on its way.

Many parameters, as of single tendons, change different numbers. Those are moved at once, so that fewer models are loaded (A. R.
Curtis, M. J. D. Powell, J. K. Reid, IMA Journal of Applied Mathematics 13:117-119, 1974).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError, SoftRobotsError
from softrobots.identification.parameter_names import Parameter
from softrobots.identification.parameters import ParameterSet
from softrobots.model.numbers import Numbers, model_numbers
from softrobots.model.soft_model import SoftModel

Stencil = tuple[float, dict[int, float]]
"""Step, relative to the scale of a parameter, and weights of the changes after so many steps."""

CENTRAL: Stencil = (1e-5, {-1: -0.5, 1: 0.5})
_FOURTH_ORDER: Stencil = (1e-3, {-2: 1.0 / 12.0, -1: -2.0 / 3.0, 1: 2.0 / 3.0, 2: -1.0 / 12.0})
_UPWARDS: Stencil = (1e-5, {1: 2.0, 2: -0.5})
_DOWNWARDS: Stencil = (1e-5, {-1: -2.0, -2: 0.5})
_TYPICAL = {"m": 0.1, "Pa": 1e3}  # scales of parameters that may be zero, by unit; else 1
_PLACED = ("placements", "frames")
_ROUNDING = 1e-15  # change of a number that no parameter of a group changes, relative to the largest of its array
_ASIDE = 1e-3  # how far from the present values they are told, relative: by symmetry some change nothing there


@lru_cache(maxsize=64)
def numbers_of(model: SoftModel) -> Numbers:
    """Return `model_numbers`, read once."""
    return model_numbers(model)


@dataclass(frozen=True, eq=False)
class ModelChange:
    """Derivatives of the numbers of a model by parameters."""

    n_parameters: int
    """Number of parameters, P."""
    by_number: Mapping[str, FloatArray]
    """Derivative of each array of `model_numbers`, flat, shape (size, P); those that do not change are left out.

    `placements` and `frames` change by twists of six rows each, in the joint before: linear part at its origin, then angular.
    """
    _stacked: dict[tuple[str, ...], FloatArray] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, size: int, base: Numbers, slopes: Iterable[tuple[int, str, FloatArray]]) -> ModelChange:
        """Gather derivatives of arrays by number of the parameter and name of the array; `base` has the placements."""
        columns = dict[str, FloatArray]()
        for place, name, slope in slopes:
            column = _twists(base[name], slope) if name in _PLACED else slope.ravel()
            columns.setdefault(name, np.zeros((column.size, size)))[:, place] = column
        return cls(size, columns)

    def along(self, rows: Mapping[str, FloatArray]) -> FloatArray:
        """Return the change of rows of outputs, shape (N, L, P), from their derivatives by some numbers, shapes (N, L, ...)."""
        names, shape = tuple(name for name in rows if name in self.by_number), next(iter(rows.values())).shape[:2]
        if names not in self._stacked:
            self._stacked[names] = np.concatenate([self.by_number[name] for name in names])
        each = np.concatenate([rows[name].reshape(*shape, len(self.by_number[name])) for name in names], axis=-1)
        return np.asarray(each.reshape(-1, each.shape[2]) @ self._stacked[names]).reshape(*shape, self.n_parameters)


def model_change(
    parameters: ParameterSet, values: Any = None, *, fourth_order: bool = False, model: SoftModel | None = None
) -> ModelChange:
    """Differentiate the numbers of a model by parameters; those that do not change the model have zeros.

    Args:
        parameters: The parameters.
        values: Their values, shape (P,); the present ones by default.
        fourth_order: Whether to load four models for each rather than two.
        model: The robot with these values, if it is at hand.

    Raises:
        ParameterError: If the structure of the robot changes with a parameter about its value: a route that begins to wind, or
            friction that begins.
    """
    at = parameters.values if values is None else np.asarray(values, dtype=np.float64)
    return _change(parameters, tuple(at.tolist()), fourth_order, model)


@lru_cache(maxsize=4)
def _change(parameters: ParameterSet, values: tuple[float, ...], fourth_order: bool, model: SoftModel | None) -> ModelChange:
    at = np.array(values)
    base = numbers_of(parameters.model(at) if model is None else model)
    slopes = number_slopes(parameters, at, parameters.numbers, base, fourth_order=fourth_order)
    return ModelChange.of(len(at), base, slopes)


def number_slopes(
    parameters: ParameterSet,
    at: FloatArray,
    numbers: Callable[[FloatArray], Numbers],
    base: Numbers,
    *,
    fourth_order: bool = False,
) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield by number of the parameter and name of the array the derivatives that are not zero.

    Args:
        parameters: The parameters.
        at: Their values, shape (P,).
        numbers: Returns named arrays at values; a function that is asked again and again.
        base: These arrays there.
        fourth_order: Whether central differences are of fourth order.

    Raises:
        ParameterError: As `model_change` does.
    """
    least = _ROUNDING / (_FOURTH_ORDER if fourth_order else CENTRAL)[0]

    def each(group: Mapping[int, Numbers]) -> Iterator[tuple[int, str, FloatArray]]:
        places = list(group)
        scales = scales_of(parameters, at)[places]

        def moved(steps: float) -> Numbers:
            changed = at.copy()
            changed[places] += steps * scales
            return numbers(changed)

        slopes = _relative([parameters.parameters[place] for place in places], at[places], scales, base, moved, fourth_order)
        if len(group) > 1 and any(
            np.any(np.abs(slope[sum(one[name] for one in group.values()) == 0]) > least * np.abs(base[name]).max(initial=0.0))
            for name, slope in slopes.items()
        ):
            raise ParameterError("parameters", places, "of which each changes the numbers that it is known to change")
        for (place, touched), scale in zip(group.items(), scales.tolist(), strict=True):
            for name, slope in slopes.items():
                own = slope * touched[name] / scale if len(group) > 1 else slope / scale
                if np.any(own):
                    yield place, name, own

    places = np.flatnonzero(parameters.of_model).tolist()
    alone: list[dict[int, Numbers]] = [{place: {}} for place in places]
    groups = _apart(parameters, numbers) if len(places) > 1 else alone
    for group in groups or alone:
        try:
            yield from list(each(group))
        except ParameterError:  # one of them has no room on one side, or changes more here
            if len(group) == 1:
                raise
            for place, touched in group.items():
                yield from each({place: touched})


@lru_cache(maxsize=4)
def _apart(parameters: ParameterSet, numbers: Callable[[FloatArray], Numbers]) -> list[dict[int, Numbers]]:
    """Groups of parameters that change the model of which no two change the same number, by place, with what each changes."""
    groups: list[dict[int, Numbers]] = []
    random, step = np.random.default_rng(0), _ASIDE * scales_of(parameters, parameters.values)
    step = np.where(parameters.values + 2.0 * step < parameters.upper, step, -step)
    aside = parameters.values + random.uniform(0.5, 1.0, len(step)) * step * parameters.of_model
    try:
        base = numbers(aside)
        for place in np.flatnonzero(parameters.of_model).tolist():
            moved = numbers(aside + np.where(np.arange(len(step)) == place, step, 0.0))
            touched = {name: moved[name] != base[name] for name in base}
            for group in groups:
                if not any(np.any(touched[name] & other[name]) for other in group.values() for name in base):
                    group[place] = touched
                    break
            else:
                groups.append({place: touched})
    except (SoftRobotsError, ValueError):  # the robot refuses values there, or has numbers of other shapes
        return []
    return groups


@lru_cache(maxsize=32)
def present_change(parameters: ParameterSet) -> ModelChange:
    """Return `model_change` about the values that a robot has, found once, with the `direct_slopes` of its parameters.

    Raises:
        ParameterError: If a name is that of several parts whose values differ; or as `model_change` does.
    """
    present, loaded = numbers_of(parameters.present), numbers_of(parameters.model(parameters.values))
    if any(not np.allclose(present[name], loaded[name], rtol=1e-9, atol=1e-12) for name in present):
        requirement = "names of numbers with the values that the robot has: one name of several parts ties them to one value"
        raise ParameterError("parameters", parameters.names, requirement)
    change = model_change(parameters, fourth_order=True)
    return ModelChange(change.n_parameters, {**change.by_number, **parameters.direct_slopes})


def differences(
    parameter: Parameter, value: float, base: Numbers, at: Callable[[float], Numbers], *, fourth_order: bool = False
) -> Numbers:
    """Differentiate named arrays by a parameter: central differences, one-sided where it has no room on one side.

    Args:
        parameter: The parameter.
        value: Its value.
        base: The arrays there.
        at: Returns them at another value.
        fourth_order: Whether central differences are of fourth order.

    Raises:
        ParameterError: If the arrays have other shapes to both sides, or the robot refuses values there.
    """
    scale = _scale(parameter, value)
    slopes = _relative(
        [parameter], np.array([value]), np.array([scale]), base, lambda steps: at(value + steps * scale), fourth_order
    )
    return {name: slope / scale for name, slope in slopes.items()}


def _relative(
    some: Sequence[Parameter],
    values: FloatArray,
    scales: FloatArray,
    base: Numbers,
    at: Callable[[float], Numbers],
    fourth_order: bool,
) -> Numbers:
    """Derivatives by parameters that move at once, over their scales; `at` takes steps in these."""
    refusal = ""
    for step, weights in (*([_FOURTH_ORDER] if fourth_order else []), CENTRAL, _UPWARDS, _DOWNWARDS):
        tried = values + step * np.outer(list(weights), scales)
        if any(np.any(tried[:, k] < one.lower) or np.any(tried[:, k] > one.upper) for k, one in enumerate(some)):
            continue
        try:
            moved = [(weight / step, at(number * step)) for number, weight in weights.items()]
        except SoftRobotsError as error:
            refusal = f" ({error})"
            continue
        if all(other[name].shape == base[name].shape for _, other in moved for name in base):
            return {name: np.sum([weight * (other[name] - base[name]) for weight, other in moved], axis=0) for name in base}
    requirement = "a value about which the structure of the robot stays as it is, so that it has derivatives"
    raise ParameterError(some[0].name, float(values[0]), requirement + refusal)


def neighbours(parameters: ParameterSet, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return N rows of parameters and their neighbours, shape (1 + 2 P, N, P), and weights of the changes there, (2, N, P).

    Of each parameter two, in turn, for central differences; at a bound to one side; NaN without room.
    """
    scales = np.array([scales_of(parameters, row) for row in rows]) * parameters.of_model
    offsets, weights = np.full((2, 2, *rows.shape), np.nan)
    for step, some in (_DOWNWARDS, _UPWARDS, CENTRAL):
        each, shares = (np.array(list(one))[:, None, None] * parameters.of_model for one in (some, some.values()))
        there = rows + each * step * scales
        room = np.all((there >= parameters.lower) & (there <= parameters.upper), axis=0)
        offsets = np.where(room, each * step * scales, offsets)
        weights = np.where(room, shares / np.where(scales, step * scales, 1.0), weights)
    units = np.eye(rows.shape[1])[:, None]
    return rows + np.concatenate([np.zeros((1, *rows.shape)), *(units * one for one in offsets)]), weights


def _scale(parameter: Parameter, value: float) -> float:
    return abs(value) if parameter.logarithmic else max(abs(value), _TYPICAL.get(parameter.unit, 1.0))


def scales_of(parameters: ParameterSet, values: FloatArray) -> FloatArray:
    """Return the scales of parameters at values, shape (P,)."""
    return np.array([_scale(one, value) for one, value in zip(parameters.parameters, values.tolist(), strict=True)])


def _twists(placements: FloatArray, slopes: FloatArray) -> FloatArray:
    """Twists, flat, of the changes of placements, both of shape (n, 3, 4), seen from the frame that these are in."""
    spin = slopes[:, :, :3] @ np.swapaxes(placements[:, :, :3], -1, -2)
    angular = 0.5 * np.stack(
        [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]], axis=1
    )
    linear = slopes[:, :, 3] - np.cross(angular, placements[:, :, 3])
    return np.concatenate([linear, angular], axis=1).ravel()
