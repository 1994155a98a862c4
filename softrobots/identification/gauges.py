"""What a set of measurements cannot tell apart: combinations of parameters that change no prediction, in words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import ParameterError
from softrobots.identification.parameter_names import Parameter
from softrobots.identification.uncertainty import UNDETERMINED, information, scaled_directions

_STEP = 0.01  # largest change told, relative to what counts as large
_LEFT_OUT = 1e-3  # share of the effect of the largest member below which a parameter is left out at once
_SCALE = 1e-5  # change, relative to that of one member, above which noise hides a scale that a force does tell
_NAMED = 6  # members that are named, those of largest effect, where there are many more
_SAME = 0.05  # relative difference below which two steps count as equal

_FIX = "fix one of them or give it a prior"
_MEANING = {
    "scale": "the scale of the stiffness: no force is known that it could be compared with; measure under weights or other"
    " known forces, or measure motor torques or tensions, or fix one of them",
    "azimuths": f"the orientation of the base (its yaw, say) against angles of the actuators or at rest; {_FIX}",
    "place": f"the place of the base against the offsets of markers; {_FIX}, or measure in postures that turn the marker",
    "preloads": f"preloads, common and single ones, that are felt only together; {_FIX}, or measure tensions",
    "product": f"only as a product; {_FIX}",
    "ratio": f"only as a ratio; {_FIX}",
    "sum": f"only as a sum; {_FIX}",
    "difference": f"only as a difference; {_FIX}",
    "together": f"only together; {_FIX}",
    "alone": "almost no effect on what was measured; fix it, give it a prior, or measure where it matters",
}
"""What a kind of combinations is, and what helps."""


@dataclass(frozen=True)
class Gauge:
    """Parameters that only together change a prediction, and a change of them that does not."""

    members: tuple[int, ...]
    """Indices of the parameters, the one with the largest effect on predictions first."""
    names: tuple[str, ...]
    """Their names."""
    steps: FloatArray
    """The change: relative for logarithmic parameters, else in their unit."""
    change: float
    """Largest change of a prediction [standard deviations of its measurement]."""
    kind: str
    """"scale", "azimuths", "place", "preloads", "product", "ratio", "sum", "difference", "together" or "alone"."""
    text: str
    """The whole finding in words."""


def find_gauges(jacobian: Any, parameters: Sequence[Parameter], *, prior: Any = 0.0) -> tuple[Gauge, ...]:
    """Return the smallest groups of parameters that the measurements do not tell apart.

    A group is a null vector of the Jacobian from which no member can be left out: found from the singular vector of the
    smallest singular value by leaving out members as long as the others alone still are a null vector. Then one member counts
    as fixed, and the search goes on. A singular value is small below `UNDETERMINED` (columns of norm 1), or if one standard
    deviation along its vector is more than 100 % of a logarithmic parameter, or than the value of another or 1 in its unit.

    Args:
        jacobian: Derivative of the weighted residuals, in standard deviations, by the fitted coordinates (the logarithm of a
            logarithmic parameter), shape (rows, P).
        parameters: The P parameters.
        prior: Information of the priors, one over the square of their standard deviation, shape (P,); 0 where there is none.

    Raises:
        ParameterError: If a shape or number does not fit.
    """
    rows = finite_array("jacobian", jacobian, (None, len(parameters)))
    known = information(prior, len(parameters))
    if not all(np.isfinite(one.value) for one in parameters):
        raise ParameterError("parameters", [one.value for one in parameters], "of finite values")
    sizes = np.array([_size(one) for one in parameters])
    short = np.asarray(np.linalg.qr(rows, mode="r"))  # has the same singular values
    left, found = list(range(len(parameters))), []
    while left and (change := _null(short, known, sizes, left)) is not None:
        members, steps = _smallest(short, known, sizes, left, change)
        effects = _effects(short, known, members, steps)
        order = np.argsort(-np.round(effects / max(float(effects.max()), 1e-300), 6), kind="stable")  # equal ones as they come
        found.append(_told(rows, sizes, parameters, [members[place] for place in order], steps[order], left))
        left.remove(found[-1].members[0])
    return tuple(found)


def _size(parameter: Parameter) -> float:
    """A change of a parameter that counts as large."""
    return 1.0 if parameter.logarithmic or parameter.unit in ("m", "rad") else max(abs(parameter.value), 1.0)


def _null(rows: FloatArray, prior: FloatArray, sizes: FloatArray, some: list[int]) -> FloatArray | None:
    """The change of some parameters that changes predictions least, if it is as good as none."""
    scale, singular, right = scaled_directions(rows[:, some], prior[some])
    if not scale.all():  # the first parameter without any effect
        return np.where(np.arange(len(some)) == np.argmin(scale), 1.0, 0.0)
    if singular[-1] <= UNDETERMINED * singular[0]:
        return np.asarray(right[-1] * scale)
    _, singular, right = np.linalg.svd(np.vstack([rows[:, some], np.diag(np.sqrt(prior[some]))]) * sizes[some])
    return np.asarray(right[-1] * sizes[some]) if singular[-1] < 1.0 else None


def _smallest(
    rows: FloatArray, prior: FloatArray, sizes: FloatArray, some: list[int], steps: FloatArray
) -> tuple[list[int], FloatArray]:
    """The members of a change without any that can be left out, and their steps; those of small effect leave first."""
    effect = dict(zip(some, _effects(rows, prior, some, steps), strict=True))
    least = _LEFT_OUT * max(effect.values())
    small = [one for one, step in zip(some, steps, strict=True) if step == 0.0 or effect[one] < least]
    for leaving in (small, *([one] for one in sorted(some, key=lambda one: effect[one]) if one not in small)):
        others = [one for one in some if one not in leaving]
        if others and (found := _null(rows, prior, sizes, others)) is not None:
            some, steps = others, found
    return some, steps


def _effects(rows: FloatArray, prior: FloatArray, some: list[int], change: FloatArray) -> FloatArray:
    """How much each part of a change would change all predictions by itself."""
    return np.asarray(np.abs(change) * np.sqrt(np.sum(rows[:, some] ** 2, axis=0) + prior[some]))


def _told(
    rows: FloatArray, sizes: FloatArray, parameters: Sequence[Parameter], members: list[int], steps: FloatArray, left: list[int]
) -> Gauge:
    """The combination of some of the parameters that are left in words."""
    steps = steps * np.copysign(_STEP / np.max(np.abs(steps) / sizes[members]), steps[0])
    chosen = [parameters[member] for member in members]
    change = float(np.max(np.abs(rows[:, members] @ steps), initial=0.0))
    others = any(re.search(r"\b(N|Pa)\b", parameters[other].unit) for other in left if other not in members)
    effect = float(np.max(np.linalg.norm(rows[:, members] * steps, axis=0))) if len(members) > 1 else 0.0
    kind = _kind(chosen, steps, not others and change <= _SCALE * max(effect, 1e-6))
    names, few = [one.name for one in chosen], _NAMED if len(chosen) > _NAMED + 1 else len(chosen)
    told, more = names[:few], [f"{len(names) - few} more"] if few < len(names) else []
    raised = [_amounts(chosen[:few], steps[:few], sign) for sign in (1.0, -1.0)]
    moves = " and ".join(f"{verb} {words}" for verb, words in zip(("raising", "lowering"), raised, strict=True) if words)
    moves += f", and {more[0]} as they follow," if more else ""
    *first, last = told + more
    head = f"{', '.join(first)} and {last}" if first else last
    text = f"{head}: {_MEANING[kind]}: {moves} changes no prediction by more than {change:.1e} standard deviations"
    return Gauge(tuple(members), tuple(names), steps, change, kind, text)


def _amounts(chosen: Sequence[Parameter], steps: FloatArray, sign: float) -> str:
    """Names and sizes of the steps of one sign, those of the same size together."""
    together: dict[str, list[str]] = {}
    for one, step in zip(chosen, steps, strict=True):
        if step * sign > 0.0:
            amount = f"{100.0 * abs(step):.3g} %" if one.logarithmic else f"{abs(step):.3g} {one.unit.strip('-')}".strip()
            together.setdefault(amount, []).append(one.name)
    return " and ".join(f"{' and '.join(names)} by {amount}" for amount, names in together.items())


def _kind(chosen: Sequence[Parameter], steps: FloatArray, scale: bool) -> str:
    """The kind of a combination, from the names and units of its members, how they change, and whether it may be the scale."""
    names = [one.name for one in chosen]
    scales = [1.0 if one.logarithmic else one.value or np.inf for one in chosen]
    relative = steps / np.array(scales)
    forces = scale and all(re.search(r"\b(N|Pa|kg)\b", one.unit) for one in chosen)
    if len(chosen) > 1 and all(re.search(r"pretension|preload|slack|motor.*offset", name) for name in names):
        return "preloads"
    if forces and np.ptp(relative) <= _SAME * np.max(np.abs(relative)) and np.all(relative != 0.0):
        return "scale"
    if len(chosen) == 1:
        return "alone"
    if any("base.rotation" in name for name in names) and all(one.unit == "rad" for one in chosen):
        return "azimuths"
    if all(re.match(r"(base|marker)\.", name) for name in names):
        return "place"
    if len(chosen) == 2:
        logarithmic, opposite = chosen[0].logarithmic, steps[0] * steps[1] < 0.0
        alike = chosen[1].logarithmic == logarithmic and (logarithmic or chosen[0].unit == chosen[1].unit)
        if alike and abs(abs(steps[0]) - abs(steps[1])) <= _SAME * np.max(np.abs(steps)):
            return ("product" if opposite else "ratio") if logarithmic else ("sum" if opposite else "difference")
    return "together"
