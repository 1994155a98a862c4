"""Checks of measured rows: what is missing, which rows are refused, and standard deviations in rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import LARGEST, FloatArray, by_column, finite_array, instance_of, stacked_columns
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel

TIP = "tip"
"""Name that stands for the tip of the robot where it has no frame or marker of that name."""

LONGEST_WORD = 200
"""Largest number of characters of a label or name."""

_ROTATION = 1e-3  # largest deviation of a measured rotation matrix from an orthogonal one


def by_name(name: str, values: Any) -> dict[str, Any]:
    """Return a mapping whose keys are words, empty for None, or raise ParameterError."""
    found = {} if values is None else dict(instance_of(name, values, Mapping, "a mapping by name"))  # type: ignore[type-abstract]
    words_of(name, list(found), len(found), str)
    return found


def columns_of(name: str, values: Any, names: Any) -> tuple[Any, Any]:
    """Return an array of actuators and the names of its columns, of columns by name or rows by name; others as they came.

    Args:
        name: Name of the parameter, for errors.
        values: Numbers, shape (n, m), columns by name, or a list of mappings, one a row.
        names: Names that the columns have, in the order wanted; None: of `values` in its own order, if it has names.

    Raises:
        ParameterError: If a column is missing, or is not made of numbers.
        NameNotFound: If there is another name.
    """
    columns = by_column(values)
    if not isinstance(columns, Mapping):
        return values, names
    own = list(columns)
    names = own if names is None else names
    for one in own:
        if one not in names:
            raise NameNotFound("actuator of q_motors", one, names)
    if len(own) < len(names):
        raise ParameterError(name, values, f"numbers of {', '.join(names)}")
    found = stacked_columns(name, columns, {one: "a column of numbers" for one in names})
    return np.atleast_2d(found), names


def words_of(name: str, values: Any, count: int, where: Callable[[int], str]) -> tuple[str, ...]:
    """Return printable words, `count` of them, or raise ParameterError with the place of another."""
    words = tuple(values) if isinstance(values, list | tuple | np.ndarray) else ()
    if len(words) != count:
        raise ParameterError(name, values, f"a list of {count} words")
    for row, word in enumerate(words):
        if not isinstance(word, str) or not 0 < len(word) <= LONGEST_WORD or not word.isprintable():
            raise ParameterError(f"{name} ({where(row)})", word, f"a word of 1 to {LONGEST_WORD} printable characters")
    return tuple(map(str, words))


def with_gaps(name: str, value: Any, shape: tuple[int | None, ...] | None, unit: str) -> FloatArray:
    """Return an array of finite numbers, as `finite_array`, in which NaN marks what is missing, or raise ParameterError."""
    given = np.asarray(value)
    if given.dtype.kind != "f":
        return finite_array(name, value, shape, unit)
    missing = np.isnan(given)
    found = finite_array(name, np.where(missing, 0.0, given), shape, unit)
    found[missing] = np.nan
    return found


def check_rows(loads: Mapping[str, FloatArray], measured: Mapping[str, FloatArray], where: Callable[[int], str]) -> None:
    """Check masses, frequencies, damping ratios and rotations, and that something was measured.

    Raises:
        ParameterError: If not; names the row.
    """
    if "mass" in loads:
        _refuse("mass", loads["mass"], loads["mass"] < 0.0, "zero or positive [kg]", where)
    if "frequencies" in measured:
        _refuse("frequencies", measured["frequencies"], measured["frequencies"] <= 0.0, "positive [Hz]", where)
    if "damping_ratios" in measured:
        ratios = measured["damping_ratios"]
        _refuse("damping_ratios", ratios, (ratios < 0.0) | (ratios >= 1.0), "zero or positive, and below 1 [-]", where)
    for key, poses in measured.items():
        if key.startswith("poses."):
            turns, gaps = poses[:, :3, :3], np.isnan(poses[:, :3, :3])
            _refuse(key, poses, gaps.any(axis=(1, 2)) & ~gaps.all(axis=(1, 2)), "a rotation that is missing as a whole", where)
            _refuse(key, poses, np.any(poses[:, 3] != (0.0, 0.0, 0.0, 1.0), axis=1), "with the last row 0, 0, 0, 1", where)
            turns = np.where(gaps, np.eye(3), turns)
            errors = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
            bad = (errors > _ROTATION) | (np.linalg.det(turns) < 0.0)
            _refuse(key, poses, bad, f"a pose with a rotation matrix, orthogonal within {_ROTATION:g}", where)
    if all(missing_in(values).all() for values in measured.values()):
        raise ParameterError("measured", list(measured), "at least one number of positions, poses, motor_torques, tensions, "
                             "frequencies or damping_ratios")  # fmt: skip


def check_modes(measured: Mapping[str, FloatArray], model: SoftModel) -> None:
    """Check that a robot has as many modes as were measured.

    Raises:
        ParameterError: If it has fewer, or dry friction.
    """
    for name in {"frequencies", "damping_ratios"} & measured.keys():
        check_frictionless(model, name)
        if measured[name].shape[1] > model.n_springs:
            raise ParameterError(name, measured[name].shape, f"of at most {model.n_springs} columns (this is its shape)")


def missing_in(values: FloatArray) -> Any:
    """Return which components are missing, shape (n, k); of poses, shape (n, 4, 4), those of position and rotation, (n, 6)."""
    if values.ndim == 2:
        return np.isnan(values)
    return np.isnan(np.concatenate([values[:, :3, 3], values[:, :3, 0]], axis=1))


def difference(measured: FloatArray, predicted: FloatArray) -> FloatArray:
    """Return measured minus predicted, shape (n, k), NaN where missing.

    Of poses, (n, 4, 4), it is that of positions, then the rotation vector of `R_measured R_predicted^T`.
    """
    if measured.ndim == 2:
        return measured - predicted
    turns = measured[:, :3, :3] @ np.swapaxes(predicted[:, :3, :3], 1, 2)
    angles = [pin.log3(turn) if np.isfinite(turn).all() else np.full(3, np.nan) for turn in turns]
    return np.concatenate([measured[:, :3, 3] - predicted[:, :3, 3], np.reshape(angles, (-1, 3))], axis=1)


def deviations_of(measured: Mapping[str, FloatArray], std: Any, where: Callable[[int], str]) -> dict[str, FloatArray]:
    """Return standard deviations by name of the quantity in rows, shape (n, k); 1 where the quantity is missing.

    Raises:
        ParameterError: If one is not positive, of another shape, or given without a name for several quantities.
        NameNotFound: If there is no such quantity.
    """
    if std is not None and not isinstance(std, Mapping):
        if len(measured) > 1:
            raise ParameterError("std", std, f"given by name, as several quantities are measured: {', '.join(measured)}")
        std = dict.fromkeys(measured, std)
    found = {}
    for name, given in (std or {}).items():
        key = f"positions.{TIP}" if name == "tip_position" else name
        if key not in measured:
            raise NameNotFound("measured quantity", str(name), measured)
        field, missing = f"std[{key!r}]", missing_in(measured[key])
        each = with_gaps(field, given, None, "")
        if measured[key].ndim == 3 and each.shape[-1:] == (2,):
            each = np.repeat(each, 3, axis=-1)
        if each.ndim > 2 or any(own not in (1, n) for own, n in zip(each.shape[::-1], missing.shape[::-1], strict=False)):
            raise ParameterError(field, given, f"one number, one for each component, or of shape {missing.shape}")
        found[key] = np.where(missing, 1.0, each)
        _refuse(field, found[key], ~(found[key] >= 1.0 / LARGEST), f"positive, at least {1.0 / LARGEST:g}", where)
    return found


def labelled(labels: Sequence[str], patterns: Sequence[str]) -> Any:
    """Return which rows have one of some labels, which may be patterns such as `rep1_*`, shape (n,).

    Raises:
        NameNotFound: If a label or pattern has no row.
    """
    known = sorted(set(labels))
    found = np.zeros(len(labels), dtype=bool)
    for pattern in patterns:
        fitting = [label for label in known if fnmatchcase(label, str(pattern))]
        if not fitting:
            raise NameNotFound("label", str(pattern), known)
        found |= np.isin(labels, fitting)
    return found


def each_row_of(function: Any, first: dict[str, Any], *others: dict[str, Any]) -> dict[str, Any]:
    """Return arguments of `Measurements` with a function of everything that has rows, e.g. one that selects some."""
    found: dict[str, Any] = {}
    for key, value in first.items():
        more = [one[key] for one in others if key in one]
        if key in ("actuators", "markers", "relative") or value is None:
            found[key] = value
        elif isinstance(value, dict):
            found[key] = {name: function(one, *(other[name] for other in more)) for name, one in value.items()}
        else:
            found[key] = function(value, *more)
    return found


def _refuse(name: str, values: FloatArray, bad: Any, requirement: str, where: Callable[[int], str]) -> None:
    """Raise ParameterError with the first row in which a condition holds."""
    if np.any(bad):
        row = int(np.argmax(np.asarray(bad).reshape(len(values), -1).any(axis=1)))
        raise ParameterError(f"{name} ({where(row)})", values[row].tolist(), requirement)
