"""What a bad fit smells of: wrong units or frames, swapped or mirrored axes, shifted rows, commands of wrong sign or order.

Each remedy is tried on the measured numbers, without solving the robot again, and told where it explains far more of them. A
fitted base hides most of a swapped axis, other parameters hide reversed commands. Then linear steps from the robot as it was
given tell the signs, and the fit is done again to other numbers, see `softrobots.identification.refits`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.identification.identification import Identification
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.identification.refits import (
    UNEXPLAINED,
    load_units,
    other_axes,
    other_loads,
    rescaled,
    reversed_actuators,
    value_units,
)
from softrobots.model.soft_model import SoftModel, check_model

FACTORS = (
    (1e3, "mm (N mm, g)", "m (N m, kg)"),
    (1e2, "cm", "m"),
    (1e1, "mm", "cm"),
    (180.0 / math.pi, "degrees", "radians"),
    (25.4, "mm", "inches"),
    (1.0 / 0.0254, "inches", "m"),
    (1e6, "um", "m"),
)
"""Ratios of units that are mistaken for each other: so many of the first are one of the second."""

FAR_LESS = 0.25
"""What a remedy must leave of it to be told: residuals of at most half the size."""

_FEWEST = 4  # rows
_MOST_SOLVED = 50  # rows in which other frames are tried
_SAME_FACTOR = math.log(1.5)  # a ratio of sizes this near to one of FACTORS; other parameters are not right yet either
_MUCH = 0.1  # share of the variance that no robot with the right columns leaves
_TO_STD = 1.4826  # standard deviation of normal numbers over the median of their size
_BADLY = 2.0  # times the standard deviation that was given, above which noise alone is no explanation
_FAR = 3.5  # standard deviations of its prior; of 50 parameters one is farther off in one of 40 fits
_MOST_ROLLED = 200  # rows of a robot with friction of guides that a fit goes through in minutes
_LOOSE = 0.5  # standard error of a logarithm, and a change, above which a value is no more than a bound
_EARTH = (9.76, 9.84)  # gravity on the ground [m/s^2]


def hints(found: Identification, *, progress: bool | str = False) -> list[str]:
    """Return what may be wrong with the measurements of a fit, in plain sentences; see `suspicions`. Empty if nothing is.

    Args:
        found: The fit.
        progress: Whether to show a bar where fits are tried, or its label.
    """
    rows = found.fitted.measurements
    texts, far, residuals = load_units(found), _far_from_priors(found), found.residuals.values()
    counted = np.flatnonzero(np.any([np.isfinite(one).any(axis=1) for one in residuals], axis=0))
    few = counted[:: -(-len(counted) // _MOST_SOLVED) or 1]
    for key, values in found.fitted.predicted.items():
        measured, predicted, before = _points(rows.measured[key]), _points(values), len(texts)
        others = np.setdiff1d(counted, found.outliers)  # single mistakes are no reason to fit again
        texts += suspicions(measured[counted], predicted[counted], rows.q_motors[counted], name=key)
        left = _unexplained(measured[others], predicted[others])
        placed, bad = key.startswith(("positions.", "poses.")), left > UNEXPLAINED
        if placed and bad:
            texts += _other_frame(found, key, rows[few], _unexplained(measured[few], predicted[few]))
        if placed and (bad or far) and len(texts) == before:  # values far from what was known may hide reversed actuators
            order, after, start = reversed_actuators(found, key, few, progress)
            if start > UNEXPLAINED and after < FAR_LESS * start:
                texts.append(f"{key}: taking the actuators as {order} {_words(after, start)}, after a linear step of the fit")
        if placed and bad:
            texts += other_axes(found, key, few, progress) if len(texts) == before else []
        if placed and (bad or rescaled(found)) and not texts:
            texts += other_loads(found, key, few, progress)
        share = _unexplained(measured[counted], predicted[counted])
        if len(texts) == before and left > _MUCH:
            texts.append(
                f"{key}: {100.0 * share:.2g} % of the variance are left unexplained: are order and signs of the actuators "
                "right, and is all fitted that may differ?"
            )
        elif len(texts) == before and found.loss == "linear" and share > _MUCH:
            texts.append(f'{key}: outliers leave {100.0 * share:.2g} % of the variance: mask them, or give a loss, "cauchy"')
        if key in rows.std:
            ratio = _TO_STD * float(np.nanmedian(np.abs(found.residuals[key] / rows.std[key])))
            if ratio > _BADLY:
                weight = "" if "gravity" in rows.loads else ", as its weight, since gravity is not given"
                texts.append(
                    f"{key}: what is left is {ratio:.2g} times the standard deviation that was given: the robot differs in "
                    f"what is not fitted{weight}, or the standard deviation is larger; the intervals by rows are too narrow"
                )
    return (texts or value_units(found) + _run_off(found)) + far + _tied(found)


def suspicions(
    measured: Any, predicted: Any, q_motors: Any = None, *, name: str = "measured", components: Sequence[str] = ("x", "y", "z")
) -> list[str]:
    """Return what may be wrong with measured numbers that a robot explains badly, in plain sentences; empty if nothing is.

    With m and p the measured and predicted numbers without their means, the unexplained share is |m - p|^2 / |m|^2. The best
    order and signs of columns minimise it exactly: they maximise the sum of |m_i . p_j| over pairs, an assignment problem. For
    commands the same is done with the slopes of m and p by the commands.

    Args:
        measured: Measured numbers, NaN where missing, shape (n, k).
        predicted: What the robot predicts, shape (n, k).
        q_motors: Commands, shape (n, m); None: they are not looked at.
        name: What is measured, for the sentences.
        components: Names of the columns; of others than three, their numbers from 1.
    """
    m, p = np.asarray(measured, dtype=float), np.asarray(predicted, dtype=float)
    known = _known(m, p)
    if np.count_nonzero(known) < _FEWEST:
        return []
    mine, theirs = _centred(m[known]), _centred(p[known])
    before = _share(mine, theirs)
    if not before > UNEXPLAINED or not np.any(theirs):
        return []
    found: list[str] = []

    def tell(after: float, text: str, start: float = before) -> bool:
        if after < FAR_LESS * start:
            found.append(f"{name}: {text} {_words(after, start)}")
        return after < FAR_LESS * start

    names = tuple(components) if len(components) == m.shape[1] else tuple(map(str, range(1, m.shape[1] + 1)))
    turned, axes = _reordered(mine, theirs, names)
    factor, words = _factor(mine, turned)
    scaled, swapped = f"dividing it by {factor:.4g} ({words})", f"taking its {', '.join(names)} for {axes}"
    if not tell(_share(mine, factor * theirs), scaled) and not tell(_share(mine, turned), swapped):
        tell(_share(mine, factor * turned), f"{scaled} and {swapped}")
    for late, text in ((1, "the row before"), (-1, "the row after")):
        rows = np.flatnonzero(known[max(late, 0) : len(m) + min(late, 0)] & known[max(-late, 0) : len(m) + min(-late, 0)])
        if len(rows) >= _FEWEST:
            here, there = _centred(m[rows + max(late, 0)]), _centred(p[rows + max(-late, 0)])
            tell(_share(here, there), f"comparing each row with {text}", _share(here, _centred(p[rows + max(late, 0)])))
    q = None if q_motors is None else _centred(np.asarray(q_motors, dtype=float)[known])
    if q is not None and np.linalg.matrix_rank(q) == q.shape[1] and len(q) > 2 * q.shape[1]:
        slopes, expected = (np.linalg.lstsq(q, values, rcond=None)[0].T for values in (mine, theirs))
        actuators = tuple(map(str, range(1, q.shape[1] + 1)))
        moved, order = _reordered(slopes, expected, actuators)
        tell(_share(mine, theirs + q @ (moved - expected).T), f"taking the actuators as {order}")
    return found


def doubtful_sizes(measurements: Measurements, model: SoftModel) -> list[str]:
    """Return what may be wrong with the size of measured numbers before any fit: positions, actuators, gravity."""
    found: list[str] = []
    reach = check_model(model).reach
    for name, values in measurements.measured.items():
        if not name.startswith(("positions.", "poses.")):
            continue
        points = values if values.ndim == 2 else values[:, :3, 3]
        points = points[np.isfinite(points).all(axis=1)]
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0
        if extent > 4.0 * reach or (len(points) > 1 and extent < 3e-3 * reach):
            found.append(f"{name} spreads over {extent:.3g} m, but the robot has a reach of {reach:.3g} m: is the unit right?")
    motors, units = measurements.motor_coordinates(model), model.actuators.units
    outside = (motors < model.motor_limits[:, 0]) | (motors > model.motor_limits[:, 1])
    for place, (joint, unit) in enumerate(zip(model.motor_joints, units, strict=True)):
        low, high = motors[:, place].min(), motors[:, place].max()
        if outside[:, place].any() or (unit == "rad" and max(-low, high) > 4.0 * math.pi):
            lower, upper = model.motor_limits[place]
            rows = np.count_nonzero(outside[:, place])
            found.append(
                f"{joint} goes from {low:.4g} to {high:.4g} {unit}, in {rows} rows outside of its limits {lower:.4g} to "
                f"{upper:.4g} {unit}: are unit, sign and order of the actuators right?"
            )
    if "gravity" in measurements.loads:
        size = float(np.linalg.norm(measurements.loads["gravity"], axis=1).max())
        if size and not _EARTH[0] < size < _EARTH[1]:
            found.append(f"gravity is {size:.4g} m/s^2, on the ground 9.81: is the unit right?")
    if model.structure.guided and len(measurements) > _MOST_ROLLED:
        found.append(
            f"with guide_friction a step of a fit rolls {len(measurements)} rows out twice a parameter, maybe for hours: "
            "leave it out, as bending_friction stands for much of it, or take fewer rows"
        )
    return found


def _far_from_priors(found: Identification) -> list[str]:
    """The parameters that end far from what was known of them before."""
    off = {name: (found.values[name] - mean) / std for name, (mean, std) in found.priors.items()}
    far = sorted((name for name in off if abs(off[name]) > _FAR), key=lambda name: -abs(off[name]))
    if not far:
        return []
    named = ", ".join(f"{name} {off[name]:+.2g}" for name in far[:6]) + (f" and {len(far) - 6} more" if far[6:] else "")
    weight = "" if "gravity" in found.fitted.measurements.loads else "; and does it feel its weight, since gravity is not given"
    return [
        f"far from what was known before, in standard deviations of the prior: {named}; are the sizes of the robot and the "
        f"priors right, and order and sign of the actuators{weight}?"
    ]


def _run_off(found: Identification) -> list[str]:
    """The positive parameters that ended far from their start, where the measurements tell no more than a bound."""
    return [
        f"{one.name} has gone from {one.value:.4g} to {found.values[one.name]:.4g} {one.unit}, with a standard error of "
        f"{100.0 * std:.0f} %: the measurements only tell that it is {'large' if ratio > 0.0 else 'small'}; give it a prior"
        for one, std in zip(found.parameters, found.by_rows.std.tolist(), strict=True)
        if one.logarithmic
        and one.name not in found.priors
        and std > _LOOSE
        and abs(ratio := math.log(max(found.values[one.name], 1e-300) / max(one.value, 1e-300))) > _LOOSE
    ]


def _tied(found: Identification) -> list[str]:
    """The parameters that gave one value to parts which had different ones."""
    rows = {one.name: [one.place.row[part] for part in one.place.parts] for one in found.parameters if one.place.row}
    return [
        f"{name}: one value for parts that had {', '.join(f'{value:.6g}' for value in row)}: [*] in its name fits one for each"
        for name, row in rows.items()
        if len(set(row)) > 1
    ]


def _other_frame(found: Identification, key: str, rows: Measurements, before: float) -> list[str]:
    """The frame whose predicted positions explain far more, if there is one."""
    own = rows.markers.get(key.partition(".")[2], key.partition(".")[2])
    prediction = Predictor(ParameterSet.of(found.model, found.names, rows.markers), rows, gaps=True).at(found.solution)
    links = [frame.name for frame in found.model.pinocchio.frames if frame.type == pin.FrameType.BODY and frame.name != own]
    shares = {link: _unexplained(_points(rows.measured[key]), prediction.frame(link)[0]) for link in links}
    best = min(shares, key=shares.__getitem__)
    if shares[best] >= FAR_LESS * before:
        return []
    return [f"{key}: taking it for the frame {best} {_words(shares[best], before)}"]


def _points(values: FloatArray) -> FloatArray:
    """Positions of poses; other numbers as they are."""
    return values[:, :3, 3] if values.ndim == 3 else values


def _unexplained(measured: FloatArray, predicted: FloatArray) -> float:
    """Unexplained share of the variance, of rows that are complete."""
    known = _known(measured, predicted)
    return _share(_centred(measured[known]), _centred(predicted[known])) if known.any() else 0.0


def _known(measured: FloatArray, predicted: FloatArray) -> Any:
    """Mask of the rows that are complete in both, shape (n,)."""
    return np.isfinite(measured).all(axis=1) & np.isfinite(predicted).all(axis=1)


def _words(after: float, before: float) -> str:
    return f"leaves {100.0 * after:.2g} % of the variance unexplained instead of {100.0 * before:.2g} %"


def _centred(values: FloatArray) -> FloatArray:
    return np.asarray(values - values.mean(axis=0))


def _share(measured: FloatArray, predicted: FloatArray) -> float:
    """Unexplained share of the variance."""
    whole = float(np.sum(measured**2))
    return float(np.sum((measured - predicted) ** 2)) / whole if whole > 0.0 else 0.0


def _factor(measured: FloatArray, predicted: FloatArray) -> tuple[float, str]:
    """The ratio of units nearest to the ratio of sizes, and which units; 1 if none is near."""
    ratio = math.sqrt(float(np.sum(measured**2)) / float(np.sum(predicted**2)))
    both = [*FACTORS, *((1.0 / factor, large, small) for factor, small, large in FACTORS)]
    factor, given, wanted = min(both, key=lambda one: abs(math.log(ratio / one[0])))
    if abs(math.log(ratio / factor)) > _SAME_FACTOR:
        return 1.0, ""
    return factor, f"{given} taken for {wanted}; measured over predicted size is {ratio:.4g}"


def _reordered(measured: Any, predicted: Any, names: Sequence[str]) -> tuple[Any, str]:
    """The columns of a prediction in the order and with the signs that explain most, and these in words."""
    from scipy.optimize import linear_sum_assignment

    products = measured.T @ predicted
    order = linear_sum_assignment(-np.abs(products))[1]
    signs = np.where(products[np.arange(len(order)), order] < 0.0, -1.0, 1.0)
    words = [f"{'-' if sign < 0.0 else ''}{names[column]}" for column, sign in zip(order.tolist(), signs.tolist(), strict=True)]
    return predicted[:, order] * signs, ", ".join(words)
