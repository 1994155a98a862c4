"""Which parameters to fit: sets of them compared by the error on families of measurements that the fit did not see."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, finite_array, instance_of, non_negative_number, read_only
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.json_text import parse_json
from softrobots.core.progress import with_progress
from softrobots.core.result_file import KINDS, Kind, text
from softrobots.core.summary import Part, Summarised, Table
from softrobots.identification.fit import INTERRUPTED
from softrobots.identification.identification import UNITS, Identification
from softrobots.identification.identify import identify
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameters import ParameterSet


@dataclass(frozen=True, eq=False, repr=False)
class CrossValidation(Summarised):
    """Result of `cross_validate`; can be saved with `softrobots.save_result`."""

    sets: Mapping[str, tuple[str, ...]]
    """Names of the scalar parameters of each set."""
    families: tuple[str, ...]
    """The families, each left out once."""
    errors: FloatArray
    """Error on the family left out, shape (sets, families), in `unit`."""
    unit: str
    """Unit of the errors."""

    @property
    def means(self) -> FloatArray:
        """Mean error of each set over the families, shape (sets,)."""
        return np.asarray(self.errors.mean(axis=1))

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of these means, from the scatter between families, shape (sets,)."""
        return np.asarray(self.errors.std(axis=1, ddof=1) / np.sqrt(len(self.families)))

    @property
    def least(self) -> str:
        """The set with the least mean error."""
        return list(self.sets)[int(np.argmin(self.means))]

    @property
    def best(self) -> str:
        """The set with the fewest parameters whose mean error is within one standard error of the least.

        The rule of one standard error (Breiman et al. 1984, Classification and Regression Trees, section 3.4.3): a set that is
        larger than the data can justify would be chosen by chance as often as not.
        """
        least = int(np.argmin(self.means))
        within = self.means <= self.means[least] + self.standard_errors[least]
        names = [name for name, good in zip(self.sets, within, strict=True) if good]
        order = list(self.sets)
        return min(names, key=lambda name: (len(self.sets[name]), self.means[order.index(name)]))

    def summary_parts(self) -> list[Part]:
        """Return a table of the mean errors with their standard errors, and of the error on each family, a line a set."""
        rows: list[tuple[str, ...]] = [("set", "parameters", "mean", "+-", *self.families)]
        for row, (name, parameters) in enumerate(self.sets.items()):
            numbers = (self.means[row], self.standard_errors[row], *self.errors[row])
            rows.append((name, str(len(parameters)), *(f"{number:.4g}" for number in numbers)))
        words = f"errors in {self.unit} on the family left out; "
        words += f"least: {self.least}; best within one standard error: {self.best}"
        return [Table(rows, right=range(1, len(rows[0]))), words]


def cross_validate(
    robot: Any,
    measurements: Measurements,
    parameter_sets: Mapping[str, Sequence[str] | str],
    families: str | Callable[[str], str] | None = None,
    *,
    error: Callable[[Identification], float] | None = None,
    unit: str | None = None,
    progress: bool | str = False,
    **options: Any,
) -> CrossValidation:
    """Compare sets of parameters: fit each with every family of measurements left out in turn, and predict that one.

    A larger set always comes nearer to the data that it is fitted to; to what it has not seen only if the robot has the
    additional parameters. Rows of a family share what others do not have (a motion, a load, a day), so that leaving out single
    rows would tell too small errors.

    Args:
        robot: The robot, as for `identify`.
        measurements: Rows with labels; those that their mask leaves out do not count.
        parameter_sets: Names of parameters by name of the set.
        families: How a label tells its family: a function, or a regular expression that is found in each label (its first
            group, or all it matches); None: each label is a family.
        error: Error of a fit on its `validation`, the family left out; None: the root mean square, of distances [m] or in the
            unit of what was measured if that is a single quantity, else in standard deviations, which must be known then.
        unit: Unit of the errors that `error` returns, for the table.
        progress: Whether to show a progress bar, or its label.
        **options: Of `identify`, for all fits.

    Raises:
        ParameterError: If there is no set, a row has no label, a label does not have the regular expression, there are fewer
            than two families, or the errors have no common unit; and as `identify`.
        NameNotFound: If there is no such parameter or frame.
        DescriptionError: If the robot cannot be loaded.
    """
    if not isinstance(parameter_sets, Mapping) or not parameter_sets or not all(isinstance(one, str) for one in parameter_sets):
        raise ParameterError("parameter_sets", parameter_sets, "at least one set of names of parameters by its name")
    family_of = _families(instance_of("measurements", measurements, Measurements, "Measurements"), families)
    names = tuple(dict.fromkeys(family_of[measurements.mask].tolist()))
    if len(names) < 2:
        raise ParameterError("families", families, f"a way to tell at least two families (there is {', '.join(names)})")
    sets = {name: ParameterSet.of(robot, one, measurements.markers).names for name, one in parameter_sets.items()}
    measure, told = (error, unit or "-") if error is not None else _default_error(measurements)
    cases = [(name, family) for name in sets for family in names]
    errors = []
    for name, family in with_progress(cases, progress, label="cross-validation", unit="fit"):
        fit = identify(robot, measurements, parameter_sets[name], validation=family_of == family, **options)
        if fit.message == INTERRUPTED:
            raise KeyboardInterrupt
        errors.append(non_negative_number("error", measure(fit)))
    return CrossValidation(sets, names, read_only(np.reshape(errors, (len(sets), len(names)))), told)


def _default_error(measurements: Measurements) -> tuple[Callable[[Identification], float], str]:
    """Error of a fit on what was kept aside, and its unit."""
    (key, *others), known = measurements.measured, measurements.std.keys() >= measurements.measured.keys()
    unit = UNITS.get(key.partition(".")[0])
    if unit is not None and not others:
        return lambda fit: fit.validation.errors[key][0], unit
    if not known:
        raise ParameterError("measurements", measurements, "with standard deviations of all quantities, or with error given")

    def in_deviations(fit: Identification) -> float:
        residuals, std = fit.validation.residuals, fit.validation.measurements.std  # type: ignore[union-attr]
        parts = [(values / std[name]).ravel() for name, values in residuals.items()]
        return float(np.sqrt(np.nanmean(np.concatenate(parts) ** 2)))

    return in_deviations, "standard deviations"


def _families(measurements: Measurements, families: str | Callable[[str], str] | None) -> NDArray[Any]:
    """The family of each row."""
    if measurements.labels is None:
        raise ParameterError("measurements", measurements, "with labels")
    if families is None or callable(families):
        found = {one: one if families is None else str(families(one)) for one in set(measurements.labels)}
    else:
        try:
            matches = {one: re.search(families, one) for one in set(measurements.labels)}
        except (re.error, TypeError) as reason:
            raise ParameterError("families", families, f"a function or a regular expression ({reason})") from reason
        lacking = sorted(one for one, match in matches.items() if match is None)
        if lacking:
            raise ParameterError("families", families, f"found in every label; {lacking[0]!r} does not have it")
        found = {one: str(match[match.re.groups > 0]) for one, match in matches.items() if match is not None}
    return np.array([found[one] for one in measurements.labels])


def _pack(result: CrossValidation) -> dict[str, Any]:
    """Named arrays of a result."""
    facts = {"sets": dict(result.sets), "families": result.families, "unit": result.unit}
    return {"facts": json.dumps(facts), "errors": result.errors}


def _unpack(fields: Mapping[str, Any]) -> CrossValidation:
    """Result of named arrays; one that cannot be is refused."""
    facts = parse_json(text(fields, "facts"))
    sets = {name: tuple(map(_word, parameters)) for name, parameters in facts["sets"].items()}
    families = tuple(map(_word, facts["families"]))
    errors = finite_array("errors", fields["errors"], (len(sets), len(families)))
    if not sets or len(families) < 2 or errors.min() < 0.0:
        raise FileFormatError("its numbers are not errors of at least one set on at least two families")
    return CrossValidation(sets, families, read_only(errors), _word(facts["unit"]))


def _word(value: Any) -> str:
    if not isinstance(value, str):
        raise FileFormatError(f"{value!r} is no name")
    return value


KINDS["cross_validation"] = Kind(CrossValidation, _pack, _unpack)
