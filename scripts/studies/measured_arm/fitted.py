"""What is fitted to the recordings, what is known of it before, and how well it predicts what it has not seen."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.identification.cross_validation import cross_validate
from softrobots.identification.identification import Comparison, Identification
from softrobots.identification.identify import identify
from softrobots.identification.measurements import Measurements
from softrobots.robots import TendonArm
from softrobots.robots.parameter_file import read_robot
from studies.measured_arm.comparison import Compared
from studies.measured_arm.errors import Pose, offset_errors, rms
from studies.measured_arm.recordings import FOLDER, family_of, read_recording

POSE = ("base.position", "base.rotation", "marker.tip.offset", "offset[2]", "offset[3]")
"""Where the base and the marker are; the turn of the first segment cannot be told from that of the base."""
ALIKE = (*POSE, "tendon_stiffness", "tendon_pretension", "axial_stiffness")
"""All tendons and all segments alike."""
OWN = (
    *POSE,
    "segment[2].bending_stiffness",
    "segment[3].bending_stiffness",
    "axial_stiffness",
    "segment[*].rest_bend_x",
    "segment[*].rest_bend_y",
    "tendon[*].tendon_stiffness",
    "tendon[*].tendon_distance",
    "tendon[*].tendon_azimuth_deviation",
    "motor[*].offset",
)
"""Values of their own; the stiffness of the first segment sets the scale of forces, of which none was measured."""
SETS: Mapping[str, tuple[str, ...]] = {
    "all tendons and segments alike": ALIKE,
    "values of their own": OWN,
    "values of their own, and dry friction": (*OWN, "bending_friction"),
}
"""Sets of parameters that are compared; the last is fitted."""
PRIORS: Mapping[str, tuple[float, float]] = {
    "marker.tip.offset": (0.0, 2.5e-3),
    "segment[2].bending_stiffness": (2.45e-3, 2.5e-4),
    "segment[3].bending_stiffness": (2.45e-3, 2.5e-4),
    "segment[*].rest_bend_x": (0.0, 0.05),
    "segment[*].rest_bend_y": (0.0, 0.05),
    "tendon[*].tendon_stiffness": (8e3, 2e3),
    "tendon[*].tendon_distance": (4.5e-3, 1e-4),
    "tendon[*].tendon_azimuth_deviation": (0.0, 0.025),
    "motor[*].offset": (0.0, 2.5e-4),
}
"""Nominal values and how far a robot that was built may be from them: mean and standard deviation, SI units."""


def command() -> str:
    """What a reader types to do the fit."""
    lines = [
        "cd docs/examples/tdcr_v4",
        "softrobots identify train.csv --robot robot.yaml --columns columns.yaml --validate val.csv -o fit/ \\",
        f"  --fit '{','.join(list(SETS.values())[-1])}' \\",
        *(f"  --prior '{name}={mean:g},{std:g}' \\" for name, (mean, std) in PRIORS.items()),
    ]
    return "\n".join(lines).removesuffix(" \\")


def start(*, rubs: bool) -> TendonArm:
    """The robot that a fit starts from, with the dry friction of the file or without."""
    robot: Any = read_robot(FOLDER / "robot.yaml")
    return robot if rubs else TendonArm(elastic_sections=1)


def rows_of(name: str) -> Measurements:
    """The rows of a file of recordings."""
    return Measurements.from_csv(FOLDER / f"{name}.csv", FOLDER / "columns.yaml")


def compare(progress: bool = False) -> dict[str, Any]:
    """Errors on families of movements of train that a fit has not seen, by set of parameters [m]."""
    rows, found = rows_of("train"), {}
    for name, parameters in SETS.items():
        priors = {key: value for key, value in PRIORS.items() if key in parameters}
        robot = start(rubs="bending_friction" in parameters)
        one = cross_validate(robot, rows, {name: parameters}, family_of, priors=priors, progress=progress)
        (scalars,) = one.sets.values()
        counts = [sum(family_of(label) == family for label in rows.labels or ()) for family in one.families]
        together = float(np.sqrt(np.average(one.errors[0] ** 2, weights=counts)))
        errors = dict(zip(one.families, one.errors[0].tolist(), strict=True))
        found[name] = {"parameters": len(scalars), "errors_m": errors, "rms_m": together}
    return {"sets": found}


def fit(progress: bool = False) -> tuple[dict[str, Any], list[Compared]]:
    """Fit train and predict validation, once: the record, and the rows of both."""
    train, began, spent = rows_of("train"), time.perf_counter(), time.process_time()
    parameters = list(SETS.values())[-1]
    found = identify(start(rubs=True), train, parameters, priors=PRIORS, validation=rows_of("val"), progress=progress)
    times = {"wall_s": time.perf_counter() - began, "cpu_s": time.process_time() - spent}
    parts: list[tuple[str, Comparison]] = [("train", found.fitted), ("val", found.validation)]  # type: ignore[list-item]
    unmoved = Pose(np.eye(3), np.zeros(3))
    compared = [Compared(read_recording(name), part.predicted["positions.tip"], unmoved) for name, part in parts]
    sets = {one.recording.name: errors_of(one) for one in compared}
    record = {"message": found.message, "steps": len(found.history.cost), **times, "sets": sets, "values": values_of(found)}
    return record | {"unidentifiable": list(found.unidentifiable), "n_parameters": len(found.names)}, compared


def errors_of(compared: Compared) -> dict[str, Any]:
    """Errors of a set [m]: by the source's metric, with the pose of the fit, and by family of movements."""
    offset = rms(offset_errors(compared.tips, compared.recording.tips))
    return {"rows": len(compared.tips), "offset_m": offset, "posed_m": rms(compared.errors), "families": compared.by_family()}


def values_of(found: Identification) -> dict[str, dict[str, Any]]:
    """Values, and their standard errors from rows and from blocks (of the logarithm, of positive parameters), by name."""
    by_rows, by_blocks = (
        [None] * len(found.names) if one is None else np.sqrt(np.diag(one.covariance)).tolist()
        for one in (found.by_rows, found.by_blocks)
    )
    return {
        one.name: {
            "unit": one.unit,
            "value": found.values[one.name],
            "logarithmic": one.logarithmic,
            "row": row,
            "block": block,
        }
        for one, row, block in zip(found.parameters, by_rows, by_blocks, strict=True)
    }
