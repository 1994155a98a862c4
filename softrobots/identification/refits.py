"""What another fit tells of the measurements: mirrored axes and reversed loads that fitted parameters hide; and units of loads.

A fit with a free base hides most of a mirrored axis, and a free stiffness loads of wrong sign or unit. So the fit is done again
to the other numbers, and told by a chi-square test. With the sum of squares `S` of `n` numbers and `P` parameters,
:math:`(n - P) (S - S') / S'` is the gain in variances.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.core.progress import with_progress
from softrobots.identification.identification import Identification
from softrobots.identification.identify import identify, mounted
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor

UNEXPLAINED = 0.02
"""Share of the variance above which a fit is suspected: residuals of a seventh of the motion."""
STEPS = 20
"""Most steps of such a fit."""

_SIGNIFICANT = 30.0  # gain in variances: 5 standard deviations and what six trials add
_MIRRORED = {
    "y, x, z": ((1, 0, 2), (1, 1, 1)),
    "z, y, x": ((2, 1, 0), (1, 1, 1)),
    "x, z, y": ((0, 2, 1), (1, 1, 1)),
    "-x, y, z": ((0, 1, 2), (-1, 1, 1)),
    "x, -y, z": ((0, 1, 2), (1, -1, 1)),
    "x, y, -z": ((0, 1, 2), (1, 1, -1)),
}
"""Orders and signs of axes that no turn makes; each is its own inverse."""
_LOADS = (
    (1e3, 1.25, "g or mN", "kg or N"),
    (1e3 / 9.80665, 1.25, "g", "N"),
    (9.80665, 1.1, "N", "kg"),
    (1.0 / 9.80665, 1.1, "kg", "N"),
    (9.80665e-3, 1.25, "N", "g"),
    (1e-3, 1.25, "kg or N", "g or mN"),
)
"""Ratios of numbers of loads in one unit to those in another that it is mistaken for, and how near a ratio is to be."""
_TOLD = 0.2  # largest standard error of the logarithm of a stiffness that tells a unit
_FORCES = ("force", "wrench")
_TOLD_APART = 1e-3  # singular value, relative, of a combination of parameters in a linear step
_OFF = math.log(2.0)  # change of a stiffness, as a logarithm, above which loads are doubted


def other_axes(found: Identification, key: str, few: Any, progress: bool | str) -> list[str]:
    """The swap of two axes, or the mirrored axis, of positions with which a fit with a free base leaves far less."""
    if not key.startswith("positions.") or not any(name.startswith("base.rotation") for name in found.names):
        return []
    rows = found.fitted.measurements[few]
    changes: dict[str, Any] = {
        words: {"positions": {key.partition(".")[2]: rows.measured[key][:, order] * np.array(signs)}}
        for words, (order, signs) in _MIRRORED.items()
    }
    return [
        f"{key}: taking its x, y, z for {words}, and fitting again, leaves residuals of {size:.2g} of the size: are two axes "
        "swapped, or is one mirrored?"
        for words, size in _better(found, key, few, changes, progress)
    ]


def other_loads(found: Identification, key: str, few: Any, progress: bool | str) -> list[str]:
    """The sign of gravity, or sign or unit of the other loads, with which a fit leaves far less."""
    given = found.fitted.measurements[few].arguments()

    def times(factor: float, *names: str) -> dict[str, Any]:
        some = {name: given[name] for name in names if given.get(name) is not None}
        scaled = {name: {key: factor * one for key, one in own.items()} for name, own in some.items() if isinstance(own, dict)}
        return {name: factor * own for name, own in some.items() if name not in scaled} | scaled

    changes = {"changing the sign of gravity": times(-1.0, "gravity"), "changing the sign of forces": times(-1.0, *_FORCES)}
    for factor, _, wrong, right in _LOADS if rescaled(found) else ():
        changes[f"dividing the loads by {factor:.4g} ({wrong} taken for {right})"] = times(1.0 / factor, *_FORCES, "mass")
    return [
        f"{key}: {words}, and fitting again, leaves residuals of {size:.2g} of the size: a load is what acts on the robot"
        for words, size in _better(found, key, few, {words: one for words, one in changes.items() if one}, progress)
    ]


def reversed_actuators(found: Identification, key: str, few: Any, progress: bool | str) -> tuple[str, float, float]:
    """The signs of actuators that explain most of positions, and the share of the variance that they and those given leave.

    Each choice of signs counts by what one linear step of all parameters within their priors would leave, from where the fit
    started but for the pose of the base, and without dry friction. One sign after another is changed, or all of them at once
    (which looks like half a turn of the base until tendons go slack), for the change that leaves least.
    """
    rows = found.fitted.measurements[few]
    start, names, n = _at_start(found), found.names, rows.q_motors.shape[1]
    if Predictor(start, rows).by_differences:  # which would take minutes
        return "", 1.0, 1.0
    points, middle = rows.measured[key], 0.0 if rows.relative else start.present.relaxed_motors
    points = points[:, :3, 3] if points.ndim == 3 else points
    whole = float(np.nansum((points - np.nanmean(points, axis=0)) ** 2))
    noise = float(np.nanmedian(rows.std[key])) if key in rows.std else math.sqrt(float(np.nanmean(found.residuals[key] ** 2)))
    means, stds = np.reshape([found.priors.get(name, (0.0, np.inf)) for name in names], (-1, 2)).T
    known, slopes_known = noise * (means - start.values) / stds, -noise * np.diag(1.0 / stds)

    def left(signs: FloatArray) -> float:
        try:
            predictor = Predictor(
                start, Measurements(**rows.arguments() | {"q_motors": middle + (rows.q_motors - middle) * signs})
            )
            values = mounted(predictor, start.values, rows.mask)
            predictor.refresh(start.values)  # the pose of the base changes nothing of the robot
            one = predictor.at(values).seen[key]
            error, slopes = one.difference[:, :3], one.slopes()[:, :3]
        except SoftRobotsError:
            return math.inf
        error, slopes = np.append(error[np.isfinite(error)], known), np.vstack([slopes[np.isfinite(error)], slopes_known])
        slopes /= np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
        return float(np.sum((error - slopes @ np.linalg.lstsq(slopes, error, rcond=_TOLD_APART)[0]) ** 2)) / whole

    signs, shares = np.ones(n), [left(np.ones(n))]
    for _ in with_progress(range(n if shares[0] > UNEXPLAINED else 0), progress, label="signs of the actuators", unit="change"):
        tried = [-signs, *(signs * np.where(np.arange(n) == place, -1.0, 1.0) for place in range(n))]
        each = [left(one) for one in tried]
        if not min(each) < shares[-1]:
            break
        signs, shares = tried[int(np.argmin(each))], [*shares, min(each)]
    return ", ".join(str(int(number * sign)) for number, sign in enumerate(signs, start=1)), shares[-1], shares[0]


def load_units(found: Identification) -> list[str]:
    """The units of loads that all fitted stiffnesses tell, which are as many times what they were taken for."""
    known = dict(zip(found.names, found.by_rows.std <= _TOLD, strict=True))
    ratios = {name: ratio for name, ratio in _stiffness_ratios(found).items() if known[name]}
    loaded = any(np.any(values) for name, values in found.fitted.measurements.loads.items() if name != "gravity")
    for factor, near, given, wanted in _LOADS if ratios and loaded else ():
        if max(abs(math.log(ratio / factor)) for ratio in ratios.values()) < math.log(near):
            size = math.exp(sum(map(math.log, ratios.values())) / len(ratios))
            return [
                f"{', '.join(ratios)}: {size:.4g} times what it was taken for, about {factor:.4g}, the ratio of {given} to "
                f"{wanted}: are the loads, and that value, in the right unit?"
            ]
    return []


def value_units(found: Identification) -> list[str]:
    """The values that end about a thousand times, or a thousandth of, what they were taken for: that had another unit."""
    units = dict(zip(found.names, (one.unit for one in found.parameters), strict=True))
    ratios = {name: ratio for name, ratio in _ratios(found).items() if units[name] not in ("-", "rad")}
    return [
        f"{name}: {ratio:.3g} times the {found.values[name] / ratio:.4g} {units[name]} that it was taken for: was that in "
        "the right unit (N mm and N/mm, g, g/cm^3 and mm are a thousand to one of SI)?"
        for name, ratio in ratios.items()
        if abs(abs(math.log(ratio)) - math.log(1e3)) < _OFF
    ]


def rescaled(found: Identification) -> bool:
    """Whether a fitted stiffness is far from what it was taken for, as one of a robot under wrong loads is."""
    return any(abs(math.log(ratio)) > _OFF for ratio in _stiffness_ratios(found).values())


def _stiffness_ratios(found: Identification) -> dict[str, float]:
    """The ratios of stiffnesses and moduli."""
    return {name: ratio for name, ratio in _ratios(found).items() if re.search("stiffness|modulus", name)}


def _ratios(found: Identification) -> dict[str, float]:
    """Fitted positive values, over the means of their priors or, without, the values from which the fit started."""
    taken = {one.name: found.priors.get(one.name, (one.value,))[0] for one in found.parameters if one.lower >= 0.0}
    return {name: found.values[name] / value for name, value in taken.items() if min(value, found.values[name]) > 0.0}


def _better(
    found: Identification, key: str, few: Any, changes: Mapping[str, Mapping[str, Any]], progress: bool | str
) -> Iterator[tuple[str, float]]:
    """Yield the change of the measurements with which a fit leaves far less, if one does, and what it leaves, relative."""
    rows, start = found.fitted.measurements[few], _at_start(found)
    own = float(np.nansum(found.residuals[key][few] ** 2))
    freedoms = np.count_nonzero(np.isfinite(found.residuals[key][few])) - len(found.names)
    options: dict[str, Any] = {"priors": found.priors, "loss": found.loss, "max_iterations": STEPS}
    left = dict[str, float]()
    shown = progress if changes else False
    for words, change in with_progress(changes.items(), shown, label=f"other fits to {key}", unit="fit"):
        given = rows.arguments()
        given |= {name: given[name] | one if isinstance(one, dict) else one for name, one in change.items()}
        with contextlib.suppress(SoftRobotsError):
            fit = identify(start.present, Measurements(**given), start, **options)
            left[words] = float(np.nansum(fit.residuals[key] ** 2))
    words = min(left, key=left.__getitem__, default="")
    if left and own > 2.0 * left[words] and freedoms * (own - left[words]) > _SIGNIFICANT * left[words]:
        yield words, math.sqrt(left[words] / own)


def _at_start(found: Identification) -> ParameterSet:
    """The parameters of the robot from which a fit started, without dry friction, which would make each of many fits slow."""
    chosen = ParameterSet.of(found.model, found.names, found.fitted.measurements.markers)
    start = chosen.model([one.value for one in found.parameters])
    return ParameterSet.of(start, found.names, chosen.markers).frictionless()
