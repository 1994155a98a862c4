r"""Parameters of a robot from measurements: weighted nonlinear least squares with exact derivatives.

The fit minimises :math:`\sum_i \rho(r_i^2) + \sum_j ((m_j - p_j) / s_j)^2` with :math:`r = (measured - predicted(p)) / std`, a
loss :math:`\rho` and priors of mean `m` and standard deviation `s`, by SciPy's trust region method (Branch, Coleman and Li
1999) within the bounds of the physics. Positive parameters are fitted by their logarithm. A step to values that the robot
refuses, or where a row has no equilibrium, is refused. A combination of parameters that changes no prediction keeps the
value that it starts with, and so does one of logarithms along which the search runs off, by a factor of 10 or more, where its
standard deviation is above 100 % and the fit gains less than two standard deviations; others that the measurements tell badly
are fitted. All are told in words (see `gauges`).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, choice, finite_array, instance_of, positive_array, positive_integer
from softrobots.core.errors import NameNotFound, ParameterError, SoftRobotsError
from softrobots.core.progress import with_progress
from softrobots.identification.fit import INTERRUPTED, Fit, Stage
from softrobots.identification.identification import Identification, identification_of
from softrobots.identification.measurement_checks import labelled
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import QUANTITIES, Predictor
from softrobots.identification.weights import Prior, Weights

LOSSES = ("linear", "soft_l1", "huber", "cauchy", "arctan")
"""Losses of `identify`."""

_PERFECT = 1e-18  # share of the squares at the start at which a fit leaves nothing but rounding
_FEW = 50  # rows, spread evenly, with which a search begins where there are more than twice as many
_FLAT = 1e-6  # spread across the line along which positions lie, relative, below which no turn about it shows
_SPREAD = 0.3  # of random starts, relative; for angles and rotations in rad, for lengths relative to the reach


def identify(
    robot: Any,
    measurements: Measurements,
    parameters: str | Sequence[str] | ParameterSet,
    *,
    loss: str = "linear",
    priors: Mapping[str, tuple[Any, Any]] | None = None,
    validation: Any = None,
    starts: int = 1,
    seed: int = 0,
    max_iterations: int = 100,
    progress: bool | str = False,
) -> Identification:
    """Fit parameters of a robot to measurements.

    Where the standard deviations of a quantity are not known, the robust spread of its residuals after a first fit stands for
    them, and the intervals are scaled by the reduced chi-square.

    Args:
        robot: A dataclass of parameters with the values to start from, or a `SoftModel`.
        measurements: What was measured; rows that its mask leaves out do not count.
        parameters: Names of what is unknown, see `softrobots.identification.parameters`, or a set of them of the robot.
        loss: "linear", or one in which outliers count less, from residuals of one standard deviation on: "soft_l1", "huber",
            "cauchy", "arctan".
        priors: `{name: (mean, standard deviation)}` in the unit of the parameter; for a name of several components numbers for
            all or arrays.
        validation: What is kept aside and told apart: a mask of rows, labels (or patterns of them), or other `Measurements`.
        starts: Number of starts: the present values, then random ones around them within the bounds; the best fit counts.
        seed: Seed of those.
        max_iterations: Limit of steps of each search.
        progress: Show a progress bar, or one with this label. Ctrl-C ends the fit with the best values up to then.

    Returns:
        The fit, whether or not it converged; see its `message`.

    Raises:
        ParameterError: If an argument is out of range, the measurements are not those of this robot, a parameter is one of
            derivatives only, or rows have no equilibrium at the values to start from; names the rows.
        NameNotFound: If there is no such parameter, frame or label.
        DescriptionError: If the robot cannot be loaded.
    """
    instance_of("measurements", measurements, Measurements, "Measurements(...), Measurements.from_csv or .from_dataframe")
    choice("loss", loss, LOSSES)
    for key in measurements.measured:
        if key.partition(".")[0] not in QUANTITIES:
            raise ParameterError("measurements", key, f"of quantities that are fitted: {', '.join(QUANTITIES)}")
    most, count = positive_integer("max_iterations", max_iterations), positive_integer("starts", starts)
    chosen = parameters if isinstance(parameters, ParameterSet) else ParameterSet.of(robot, parameters, measurements.markers)
    loads = [one.name for one in chosen.parameters if one.place.kind in ("motor", "force", "wrench", "gravity")]
    if loads:
        raise ParameterError("parameters", loads[0], "no load or actuator coordinate: measurements give those")
    prior = prior_of(chosen, priors or {})
    measurements = measurements.in_order_of(chosen.present)
    counted, aside = _split(measurements, validation)
    in_order = chosen.present.structure.friction is not None
    rows = measurements if in_order else measurements[counted]
    counted = counted if in_order else np.ones(len(rows), dtype=bool)
    others = aside if in_order or aside is None or isinstance(aside, Measurements) else measurements[aside]
    if isinstance(others, Measurements):
        others = others.in_order_of(chosen.present)
        others.check(chosen.present)
    import scipy.optimize  # noqa: F401  # before the limit, which counts for what is loaded; importing it takes a while

    steps = iter(with_progress(itertools.count(), progress, label="identify", unit=" steps"))
    values, message, every = (begin := _starts(chosen, seed, count)), "", len(rows) // _FEW
    calm, near = chosen.frictionless(), None
    weights: Any = None
    stages: list[tuple[ParameterSet, int, Stage]] = [(chosen, 1, "whole" if in_order else "last")]
    stages[:0] = [(calm, 1, "first")] * (calm is not chosen)
    stages[:0] = [(calm, every, "first")] * (every > 1 and _sees_all(rows, counted, every))
    stages = stages if len(stages) > 1 else [(chosen, 1, "whole")]
    with one_blas_thread(1000):
        for own, step, stage in stages:
            try:
                predictor, some = Predictor(own, rows[::step] if step > 1 else rows, near=near), counted[::step]
                if weights is None:
                    values[0] = mounted(predictor, values[0], some)
                weigh = Weights.of if weights is None else weights.of_more
                weights = weigh(predictor.measurements.std, predictor.at(values[0]).differences(), some)
                if not len(weights.rows()):
                    raise ParameterError("measurements", measurements, "with at least one number in a row that counts")
                robust, left = loss if weights.known else "linear", 0 if message == INTERRUPTED else most
                best = _best(predictor, weights, prior, robust, steps, values, left, stage)
                values, message = [best.values], message if message == INTERRUPTED else best.message
                near = best.at_end()[0].at.states.q_springs if step == 1 and own is not chosen else None
            except SoftRobotsError:
                if own is chosen and values is begin:
                    raise
                if own is chosen:  # a search before has gone where rows have no equilibrium
                    values, near = begin, None
                    stages.append((chosen, 1, "whole"))
        again = not weights.known and (loss != "linear" or len(weights.std) > 1)
        if again and message != INTERRUPTED and best.cost > _PERFECT * len(weights.rows()):
            weights = weights.estimated(best.at_end()[0].differences())
            best = _best(predictor, weights, prior, loss, steps, [best.values], most, stages[-1][2])
            message = best.message
        best.message = message
        return identification_of(best, others)


def _sees_all(rows: Measurements, counted: Any, every: int) -> bool:
    """Whether some rows have numbers of all that was measured."""
    measured = [np.isfinite(one.reshape(len(one), -1)).any(axis=1) & counted for one in rows.measured.values()]
    return all(one[::every].any() for one in measured)


def _best(
    predictor: Predictor,
    weights: Weights,
    prior: Prior,
    loss: str,
    steps: Iterator[Any],
    starts: Sequence[FloatArray],
    most: int,
    stage: Stage = "whole",
) -> Fit:
    """The best fit of several starts; those without equilibria but the first are passed over."""
    best: Fit | None = None
    for start in starts:
        fit = Fit(predictor, weights, prior, loss, steps, stage)
        try:
            fit.run(start, most)
        except SoftRobotsError:
            if best is None:
                raise
            continue
        if best is None or fit.cost < best.cost:
            best = fit
        if fit.message == INTERRUPTED:
            best.message = INTERRUPTED
            break
    return best  # type: ignore[return-value]


def mounted(predictor: Predictor, values: FloatArray, counted: Any) -> FloatArray:
    """Return values, shape (P,), with the pose of the base that brings predicted positions nearest to the measured ones.

    By the singular value decomposition of their covariance: W. Kabsch, Acta Crystallographica A32:922-923, 1976. A fit that
    starts with the base turned the wrong way ends beside the best one. The values stay as they are where position and rotation
    of the base are not both fitted from zero, or fewer than three positions, or positions along a line, were measured.

    Args:
        predictor: Predictions of the rows.
        values: Values to start from, shape (P,).
        counted: Rows that count, shape (n,), truth values.
    """
    from scipy.spatial.transform import Rotation

    pose = {one.name: number for number, one in predictor.parameters.places("base")}
    places = [pose.get(f"base.{what}.{axis}", -1) for what in ("position", "rotation") for axis in "xyz"]
    if min(places) < 0 or np.any(values[places]):
        return values
    prediction, seen, measured = predictor.at(values), [], []
    for key, positions in predictor.measurements.measured.items():
        if key.startswith("positions."):
            there = np.isfinite(positions).all(axis=1) & counted
            measured.append(positions[there])
            seen.append(prediction.seen[key].values[there])
    if sum(map(len, measured)) < 3:
        return values
    from_base, told = np.concatenate(seen), np.concatenate(measured)
    middle, centre = from_base.mean(axis=0), told.mean(axis=0)
    spread = np.linalg.svd((from_base - middle).T @ (told - centre), compute_uv=False)
    if spread[1] <= _FLAT * spread[0]:
        return values
    turn, _ = Rotation.align_vectors(told - centre, from_base - middle)
    start = values.copy()
    start[places] = *(centre - turn.apply(middle)), *turn.as_rotvec()
    return start


def _starts(chosen: ParameterSet, seed: int, count: int) -> list[FloatArray]:
    """The present values, and random ones around them within the bounds."""
    random = np.random.default_rng(seed)
    values, lower, upper = chosen.values, chosen.lower, chosen.upper
    scale = np.array([chosen.present.reach if unit == "m" else 1.0 for unit in chosen.units])
    found = [np.array(values)]
    for _ in range(count - 1):
        change = _SPREAD * random.standard_normal(len(values))
        other = np.where(chosen.logarithmic, values * np.exp(change), values + change * np.maximum(np.abs(values), scale))
        outside = (other <= lower) | (other >= upper)
        found.append(np.where(outside, values, other))
    return found


def prior_of(chosen: ParameterSet, priors: Mapping[str, tuple[Any, Any]]) -> Prior:
    """Return the priors by scalar parameter, from names of scalars, or of several as they were asked for.

    Raises:
        ParameterError: If one is no pair of finite numbers, or a parameter has two.
        NameNotFound: If there is no such parameter among those of the list.
    """
    places: list[int] = []
    means: list[float] = []
    stds: list[float] = []
    for name, pair in dict(priors).items():
        members = chosen.members.get(name, (name,))
        if not set(members) <= set(chosen.names):
            raise NameNotFound("fitted parameter", str(name), dict.fromkeys([*chosen.members, *chosen.names]))
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise ParameterError(f"priors[{name!r}]", pair, "a pair: mean and standard deviation")
        mean, std = (
            finite_array(f"priors[{name!r}]", pair[0], None),
            positive_array(f"priors[{name!r}]", pair[1], chosen.units[chosen.names.index(members[0])]),
        )
        if mean.shape not in ((), (len(members),)) or std.shape not in ((), (len(members),)):
            raise ParameterError(f"priors[{name!r}]", pair, f"numbers, or arrays of shape ({len(members)},)")
        places += [chosen.names.index(one) for one in members]
        means += np.broadcast_to(mean, len(members)).tolist()
        stds += np.broadcast_to(std, len(members)).tolist()
    if len(set(places)) < len(places):
        raise ParameterError("priors", list(priors), "one for each parameter")
    return Prior(np.array(places, dtype=np.intp), np.array(means), np.array(stds))


def _split(measurements: Measurements, validation: Any) -> tuple[Any, Any]:
    """Rows that are fitted, shape (n,), and what is kept aside: such rows, other measurements, or None."""
    counted = measurements.mask
    if validation is None or isinstance(validation, Measurements):
        return counted, validation
    words = [validation] if isinstance(validation, str) else validation
    if isinstance(words, list | tuple) and words and all(isinstance(one, str) for one in words):
        aside = labelled(measurements.labels or ("",) * len(measurements), words)
    else:
        aside = np.asarray(validation)
    if aside.dtype != bool or aside.shape != counted.shape or not np.any(counted & ~aside) or not np.any(counted & aside):
        requirement = f"a mask of shape {counted.shape} that leaves rows on both sides, labels, or Measurements"
        raise ParameterError("validation", validation, requirement)
    return counted & ~aside, counted & aside
