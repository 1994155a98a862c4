"""Compiled motions of many cases, and what all results of many cases have in common: status, table, and of motions the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, finite_array, finite_number, increasing
from softrobots.core.errors import FileFormatError
from softrobots.core.result_file import KINDS, Kind, counts, vector_columns
from softrobots.core.summary import Summarised


class CaseResults(Summarised):
    """Results of many cases."""

    status: Any
    """`Status` of each case, shape (n,)."""

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    @property
    def certified(self) -> Any:
        """Mask of the valid cases, shape (n,)."""
        return self.status == Status.CERTIFIED


@dataclass(frozen=True, eq=False, repr=False)
class MotionBatch(CaseResults):
    """Motions of many cases, at the same times."""

    time: FloatArray
    """Times of the rows, shape (t,) [s]."""
    q_springs: FloatArray
    """Elastic coordinates, shape (n, t, n_springs) [rad or m]."""
    velocities: FloatArray
    """Their rates, shape (n, t, n_springs) [rad/s or m/s]."""
    tip_position: FloatArray
    """The tip, shape (n, t, 3) [m], world axes."""
    status: Any
    """`Status` of each case, shape (n,), small integers; only rows with `Status.CERTIFIED` are valid."""
    steps: FloatArray
    """Times at the ends of all steps, the first included, shape (m,) [s]."""
    tip_error: FloatArray | None = None
    """Measured error of the tip, the largest of all rows, with a safety factor of 1.2, shape (n,) [m]; None for fixed steps,
    where it is not measured."""
    tolerance: float | None = None
    """Largest `tip_error` that was asked for [m]; None for fixed steps."""
    interrupted: bool = False
    """Whether Ctrl-C ended the run: cases that were not at their end are `Status.UNSETTLED`, with zeros for what is missing."""
    friction_bending: FloatArray | None = None
    """Bending that dry friction remembers at the end, shape (n, n_sections, 2) [rad]; None without it."""
    friction_slip: FloatArray | None = None
    """Length of actuators beyond each guide at its slider, from rest, shape (n, n_guides) [m]; None without dry friction."""


_AXES = {"tip_positions": ("tip", "m"), "tip_position": ("tip", "m"), "forces": ("force", "N")}
_SINGLE = {"residual": "N m", "unexplained": "N m", "observability": "m", "tip_error": "m", "orientation_error": "rad"}
_NUMBERED = {
    "q_motors": ("motor", "rad or m"),
    "q_springs": ("spring", "rad or m"),
    "velocities": ("spring velocity", "rad/s or m/s"),
}


def table_of_cases(batch: CaseResults) -> dict[str, Any]:
    """Columns of a batch, a line a case, or an instant of a case; actuators and springs by number, in the model's order."""
    table, each, n = dict[str, Any](), 1, len(batch.status)
    if isinstance(batch, MotionBatch):
        each = len(batch.time)
        table = {"case": np.repeat(np.arange(n), each), "time [s]": np.tile(batch.time, n)}
    table["status"] = np.repeat(batch.status, each)
    for name, values in vars(batch).items():
        if name in _SINGLE and values is not None:
            table[f"{name.replace('_', ' ')} [{_SINGLE[name]}]"] = np.repeat(values, each)
        elif name in _AXES:
            table |= vector_columns(*_AXES[name], values.reshape(-1, 3))
        elif name in _NUMBERED:
            what, unit = _NUMBERED[name]
            rows = values.reshape(-1, values.shape[-1])
            table |= {f"{what} {number} [{unit}]": column for number, column in enumerate(rows.T, 1)}
    return table


def _pack(batch: MotionBatch) -> dict[str, Any]:
    arrays = {name: value for name, value in vars(batch).items() if value is not None}
    if batch.tip_error is not None:  # infinite where a case has failed; JSON has no such number
        arrays["tip_error"] = np.where(np.isfinite(batch.tip_error), batch.tip_error, -1.0)
    return arrays


def _unpack(fields: Mapping[str, Any]) -> MotionBatch:
    time, steps = (increasing(name, finite_array(name, fields[name], (None,), "s"), "s") for name in ("time", "steps"))
    status = np.array(counts(fields, "status"), dtype=np.uint8)
    if fields["interrupted"].dtype != bool or fields["interrupted"].shape or not set(status.tolist()) <= set(Status):
        raise FileFormatError("it must say of each case which status it has, and whether it was interrupted")
    rows = {name: finite_array(name, fields[name], (len(status), len(time), None)) for name in ("q_springs", "velocities")}
    if rows["q_springs"].shape != rows["velocities"].shape:
        raise FileFormatError("its velocities have another shape than its coordinates")
    error = finite_array("tip_error", fields["tip_error"], (len(status),), "m") if "tip_error" in fields else None
    bending, slip = None, None
    if "friction_bending" in fields:
        bending = finite_array("friction_bending", fields["friction_bending"], (len(status), None, 2), "rad")
        slip = finite_array("friction_slip", fields.get("friction_slip", np.zeros((len(status), 0))), (len(status), None), "m")
    return MotionBatch(
        time=time,
        **rows,
        tip_position=finite_array("tip_position", fields["tip_position"], (len(status), len(time), 3), "m"),
        status=status,
        steps=steps,
        tip_error=None if error is None else np.where(error < 0.0, np.inf, error),
        tolerance=finite_number("tolerance", fields["tolerance"], "m") if "tolerance" in fields else None,
        interrupted=bool(fields["interrupted"]),
        friction_bending=bending,
        friction_slip=slip,
    )


KINDS["motion_batch"] = Kind(MotionBatch, _pack, _unpack, many=True, to_table=table_of_cases)
