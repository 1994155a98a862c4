"""Which poses to measure next: those of a list of candidates that make the errors of the parameters smallest together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, finite_array, positive_integer, read_only, read_only_mapping
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.core.summary import Part, Summarised, Table
from softrobots.identification.gauges import find_gauges
from softrobots.identification.identify import prior_of
from softrobots.identification.measurement_checks import columns_of
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor
from softrobots.identification.uncertainty import Uncertainty, uncertainty_from_rows

_RIDGE = 1e-9  # information that stands for none while there are fewer rows than parameters, relative to a mean candidate
_BETTER = 1e-9  # gain of the logarithm of the determinant from which poses are exchanged
_SWEEPS = 50  # limit of rounds of exchange; 3 to 6 are usual
_TIP = {"tip_position": 1e-3}  # measured where nothing is told, to 1 mm
_DRAWS = 200  # random choices of which the median is told


@dataclass(frozen=True, eq=False, repr=False)
class InformativePoses(Summarised):
    """Result of `informative_poses`."""

    names: tuple[str, ...]
    """Names of the parameters."""
    units: tuple[str, ...]
    """Their units."""
    values: FloatArray
    """The values at which the errors are predicted, shape (P,)."""
    logarithmic: NDArray[np.bool_]
    """Which are fitted by their logarithm, shape (P,)."""
    indices: NDArray[np.int_]
    """The chosen candidates, the one that helps most first, shape (n,)."""
    log_det: float
    """Logarithm of the determinant of the information `J^T J` of the fitted coordinates, priors and given rows included."""
    intervals: FloatArray
    """Expected intervals of 95 % at these values, shape (P, 2)."""
    margins: Mapping[str, FloatArray]
    """Half widths of the intervals, shape (P,), relative for logarithmic parameters: with the "chosen" poses, with as many at
    "random" and with "random, twice as many" (medians of 200 choices), and with "all" candidates."""

    def summary_parts(self) -> list[Part]:
        """Return a table of the half widths of the intervals, a line a parameter."""
        rows: list[tuple[str, ...]] = [("half width", *self.margins)]
        for one, name in enumerate(self.names):
            scale, unit = (100.0, "%") if self.logarithmic[one] else (1.0, self.units[one])
            rows.append((name, *(f"{scale * margin[one]:.3g} {unit}" for margin in self.margins.values())))
        return [Table(rows, right=range(1, len(rows[0])))]


def informative_poses(
    robot: Any,
    parameters: str | Sequence[str],
    candidates: Any,
    n: int,
    *,
    std: Mapping[str, Any] | None = None,
    measured: Measurements | None = None,
    priors: Mapping[str, tuple[Any, Any]] | None = None,
    seed: int = 0,
    **loads: Any,
) -> InformativePoses:
    r"""Choose the poses to measure so that the errors of parameters become small together, before anything is measured.

    The information of a set of poses is :math:`J^T J`, with derivatives of what would be measured by the parameters, in
    standard deviations; the volume of the confidence ellipsoid falls as its determinant rises (D-optimal design; see
    `d_optimal` in this module for how they are chosen). The derivatives are those at the present values of the robot.

    Args:
        robot: A dataclass of parameters with the values as they are known now, or a `SoftModel`.
        parameters: Names of what is to be identified, as for `identify`.
        candidates: What could be measured: `Measurements` with standard deviations, whose measured values do not matter (cells
            that are missing would be missing) and whose mask leaves out rows; or actuator coordinates, shape (candidates, m),
            or by name, as `Measurements` takes them, with `std` and `loads`.
        n: Number of poses to choose.
        std: With actuator coordinates: what is measured, with its standard deviation: "tip_position", "positions.NAME",
            "poses.NAME", "motor_torques"; by default the position of the tip to 1 mm.
        measured: What has been measured already, with standard deviations.
        priors: `{name: (mean, standard deviation)}` as for `identify`.
        seed: Seed of the random choices for comparison.
        **loads: With actuator coordinates: further arguments of `Measurements`, as `force`, `mass`, `gravity`, `markers`.

    Returns:
        The choice, with the intervals to expect.

    Raises:
        ParameterError: If there are fewer than `n` candidates, a standard deviation is missing, a candidate has no equilibrium,
            or all candidates together cannot tell the parameters apart; says which, so that a prior can be given.
        NameNotFound: If there is no such parameter, quantity or frame.
        DescriptionError: If the robot cannot be loaded.
    """
    if not isinstance(candidates, Measurements):
        candidates = _unmeasured(candidates, _TIP if std is None else std, loads)
    elif std is not None or loads:
        raise ParameterError("candidates", candidates, "actuator coordinates where std or loads are given beside them")
    chosen = ParameterSet.of(robot, parameters, candidates.markers)
    counted = np.flatnonzero(candidates.mask)
    if positive_integer("n", n) > len(counted):
        raise ParameterError("n", n, f"at most the number of candidates, {len(counted)}")
    prior = prior_of(chosen, priors or {})
    rates = np.where(chosen.logarithmic, chosen.values, 1.0)
    known = np.zeros(len(rates))
    known[prior.places] = (rates[prior.places] / prior.std) ** 2
    rows = _rows(chosen, candidates) * rates
    before = rows[:0, 0] if measured is None else (_rows(chosen, measured) * rates).reshape(-1, len(rates))
    random = np.random.default_rng(seed)

    def uncertainty(some: Any) -> Uncertainty:
        jacobian = np.concatenate([before, rows[some].reshape(-1, len(rates))])
        return uncertainty_from_rows(jacobian, np.zeros(len(jacobian)), prior=known)

    def half(found: Uncertainty) -> FloatArray:
        """Half widths of the intervals."""
        return found.intervals(np.zeros(len(rates)))[:, 1]

    def at_random(count: int) -> FloatArray:
        """Medians of the half widths of random choices."""
        draws = (random.choice(len(rows), min(count, len(rows)), replace=False) for _ in range(_DRAWS))
        return np.asarray(np.median([half(uncertainty(some)) for some in draws], axis=0))

    everything = uncertainty(...)
    if not everything.determined.all():
        (first, *_) = find_gauges(np.concatenate([before, *rows]), chosen.parameters, prior=known)
        raise ParameterError("parameters", chosen.names, f"such that the candidates tell them apart; not so {first.text}")
    start = before.T @ before + np.diag(known)
    indices = d_optimal(rows, n, start)
    best, doubled = uncertainty(indices), "random, twice as many"
    widths = {"chosen": half(best), "random": at_random(n), doubled: at_random(2 * n), "all": half(everything)}
    inside = rows[indices].reshape(-1, len(rates))
    return InformativePoses(
        names=chosen.names,
        units=chosen.units,
        values=chosen.values,
        logarithmic=chosen.logarithmic,
        indices=counted[indices],
        log_det=float(np.linalg.slogdet(start + inside.T @ inside)[1]),
        intervals=read_only(best.intervals(chosen.values, chosen.logarithmic)),
        margins=read_only_mapping({name: read_only(width) for name, width in widths.items()}),
    )


def _unmeasured(q_motors: Any, std: Mapping[str, Any], loads: Mapping[str, Any]) -> Measurements:
    """Candidates of actuator coordinates: what would be measured has the value 0."""
    q_motors, names = columns_of("candidates", q_motors, None)
    motors = finite_array("candidates", q_motors, (None, None), "rad, m, N or Pa")
    zero: dict[str, Any] = {"positions": {}, "poses": {}}
    for key in std:
        quantity, _, name = ("positions.tip" if key == "tip_position" else key).partition(".")
        if quantity == "motor_torques":
            zero[key] = np.zeros(motors.shape)
        elif quantity == "positions":
            zero[quantity][name] = np.zeros((len(motors), 3))
        elif quantity == "poses":
            zero[quantity][name] = np.tile(np.eye(4), (len(motors), 1, 1))
        else:
            raise NameNotFound("measured quantity", str(key), ["tip_position", "positions.NAME", "poses.NAME", "motor_torques"])
    return Measurements(motors, **zero, std=std, **loads, actuators=names)


def _rows(chosen: ParameterSet, measurements: Measurements) -> FloatArray:
    """Derivatives of what each row that counts would measure, in standard deviations, shape (rows, k, P); 0 if missing."""
    lacking = [key for key in measurements.measured if key not in measurements.std]
    if lacking:
        raise ParameterError("std", dict(measurements.std), f"given for all that is measured; it lacks {', '.join(lacking)}")
    rubs = chosen.present.structure.friction is not None  # the others happen then, too
    measurements = measurements if rubs else measurements[measurements.mask]
    predictor = Predictor(chosen, measurements.in_order_of(chosen.present))
    predictor.refresh(chosen.values)
    prediction = predictor.at(chosen.values)
    parts = []
    for key, difference in prediction.differences().items():
        kind, _, name = key.partition(".")  # of a pose the measured rotation does not matter
        slopes = prediction.slopes()[key] if kind != "poses" or predictor.by_differences else -prediction.frame_slopes(name)
        parts.append(np.where(np.isfinite(difference)[..., None], slopes / measurements.std[key][..., None], 0.0))
    return np.concatenate(parts, axis=1)[measurements.mask]


def d_optimal(rows: FloatArray, n: int, known: FloatArray) -> NDArray[np.int_]:
    r"""Return the indices of n candidates with a large determinant of the information, the one that helps most first.

    The information of a set `S` is :math:`M = M_0 + \sum_{c \in S} J_c^T J_c`; one candidate more multiplies its determinant by
    :math:`\det(1 + J_c M^{-1} J_c^T)`. The best is added n times; then each in turn is exchanged for the best other one until
    no exchange helps (Fedorov 1972, Theory of Optimal Experiments; Cook and Nachtsheim 1980, doi:10.2307/1268315).

    Args:
        rows: Weighted Jacobian of each candidate, shape (candidates, rows of one, P).
        n: How many to choose.
        known: :math:`M_0`, the information of priors and of what was measured before, shape (P, P).
    """
    size = np.sqrt(np.mean(np.sum(rows**2, axis=1), axis=0) + np.diag(known))
    size = np.where(size > 0.0, size, 1.0)
    rows, start = rows / size, known / np.outer(size, size) + _RIDGE * np.eye(len(size))

    def information(some: Sequence[int]) -> FloatArray:
        inside = rows[list(some)].reshape(-1, len(size))
        return np.asarray(start + inside.T @ inside)

    def added(some: list[int], among: Any) -> int:
        """The candidate that helps some others most."""
        gains = np.full(len(rows), -np.inf)
        free = np.setdiff1d(among, some)
        gains[free] = _gains(rows[free], information(some))
        return int(np.argmax(gains))

    chosen: list[int] = []
    for _ in range(n):
        chosen.append(added(chosen, np.arange(len(rows))))
    for _ in range(_SWEEPS):
        before = list(chosen)
        for place in range(n):
            others = chosen[:place] + chosen[place + 1 :]
            new = added(others, np.arange(len(rows)))
            old_gain, new_gain = _gains(rows[[chosen[place], new]], information(others))
            if new_gain > old_gain + _BETTER:
                chosen[place] = new
        if chosen == before:
            break
    ordered: list[int] = []
    for _ in range(n):
        ordered.append(added(ordered, chosen))
    return np.array(ordered)


def _gains(rows: FloatArray, information: FloatArray) -> FloatArray:
    """How much each candidate adds to the logarithm of the determinant."""
    whitened = rows @ np.linalg.inv(np.linalg.cholesky(information)).T
    inner = whitened @ np.swapaxes(whitened, 1, 2)
    return np.asarray(np.linalg.slogdet(np.eye(inner.shape[1]) + inner)[1])
