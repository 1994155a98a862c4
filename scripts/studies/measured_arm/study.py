"""The whole study: predictions, errors, repeatability and other assumptions, as one record of plain numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.robots import TendonArm
from studies.measured_arm.comparison import Compared
from studies.measured_arm.errors import best_pose, repeatability, rms
from studies.measured_arm.nominal import MARKER, Bar, Nominal, Predicted, predict
from studies.measured_arm.plain_kinematics import constant_curvature_tips
from studies.measured_arm.recordings import Recording

WITHIN = 2e-4
"""Largest difference of commands that count as the same, for the floor [m]."""
AWAY = 7e-4
"""Size of a command from which on the robot is away from rest [m]."""

PUBLISHED = "the source's simulator, calibrated to train (quoted)"
PUBLISHED_ERRORS = {"train": 6.68e-3, "val": 9.39e-3}
"""What the source's code and configuration give when they are run again, by the source's metric [m]."""

OTHERS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("nothing", "", {}),
    ("stiffness of a tendon", "3.5 N/mm", {"stiffness": 3.5e3}),
    ("stiffness of a tendon", "14 N/mm", {"stiffness": 14e3}),
    ("stiffness of a tendon", "50 N/mm", {"stiffness": 50e3}),
    ("pretension", "0 N", {"pretension": 0.0}),
    ("pretension", "2 N", {"pretension": 2.0}),
    ("pretension", "5 N", {"pretension": 5.0}),
    ("weight", "50 g, hanging", {"weight": "hanging"}),
    ("weight", "50 g, standing", {"weight": "standing"}),
    ("weight", "5.5 g, hanging", {"weight": "hanging", "mass": 0.0055}),
    ("weight", "5.5 g, standing", {"weight": "standing", "mass": 0.0055}),
    ("modulus of the backbone", "35 GPa", {"young_modulus": 35e9}),
    ("modulus of the backbone", "75 GPa", {"young_modulus": 75e9}),
    ("axial stiffness", "an eighth", {"axial_share": 0.125}),
    ("marker", "8 mm beyond the tip", {"marker": MARKER}),
    ("turns of the segments", "all as the first", {"turns": (-3.0589,) * 3}),
    ("sections a segment", "1", {"sections": 1}),
)
"""One assumption at a time: name, value, fields of `Nominal`."""


class Study(NamedTuple):
    """What is written and drawn."""

    record: dict[str, Any]
    """The numbers."""
    compared: list[Compared]
    """Elastic tendons, each set."""
    plain: list[Compared]
    """Constant curvature without forces."""
    floor: FloatArray
    """Distances of the repeated rows [m]."""


def study(whole: Mapping[str, Recording], nominal: Nominal, others: bool, bar: Bar, every: int = 1) -> Study:
    """Predict the rows, and tell how good it is.

    Args:
        whole: "train" and "val".
        nominal: The assumptions.
        others: Whether to try others, too.
        bar: `bar(steps, label)` shows progress.
        every: Only each so many-th row is predicted; the repeatability is always that of all rows.
    """
    recordings = {name: one.thinned(every) for name, one in whole.items()}
    predicted = {name: predict(one, nominal, bar, name) for name, one in recordings.items()}
    compared = posed(recordings, {name: one.tips for name, one in predicted.items()})
    robot = TendonArm()
    azimuths = np.array(nominal.turns)[:, None] + robot.tendon_azimuths
    sizes = np.array(robot.segment_lengths), float(np.atleast_1d(robot.tendon_distance)[0])
    plain = posed(recordings, {name: constant_curvature_tips(one.pulls, *sizes, azimuths) for name, one in recordings.items()})
    record: dict[str, Any] = {
        "nominal": nominal._asdict(),
        "models": models(compared, plain, whole),
        "pose": pose_record(compared[0]),
        "sets": {one.recording.name: set_record(one, predicted[one.recording.name]) for one in compared},
        "repeatability": repeated(whole),
        "sensitivity": [],
    }
    if others:
        record["sensitivity"] = sensitivity(recordings["train"], nominal, bar)
    return Study(record, compared, plain, repeatability(list(whole.values()), WITHIN).distances)


def models(compared: Sequence[Compared], plain: Sequence[Compared], whole: Mapping[str, Recording]) -> list[dict[str, Any]]:
    """The rows of the first table: ours, what others have, and the floor."""
    result: list[dict[str, Any]] = []
    for name, sets in (("elastic tendons, nominal", compared), ("constant curvature without forces, nominal", plain)):
        result.append(
            {"model": name, "fitted": "nothing here; turns by the source"} | {one.recording.name: one.summary() for one in sets}
        )
    published = {name: {"offset_m": value, "posed_m": None} for name, value in PUBLISHED_ERRORS.items()}
    result.append({"model": PUBLISHED, "fitted": "tendons and turns"} | published)
    scatter = {name: rms(repeatability([one], WITHIN).distances) for name, one in whole.items()}
    floor = {name: {"offset_m": value, "posed_m": value} for name, value in scatter.items()}
    result.append({"model": "floor: the robot against itself, without memory", "fitted": ""} | floor)
    return result


def posed(recordings: Mapping[str, Recording], tips: Mapping[str, FloatArray]) -> list[Compared]:
    """The sets with the pose of the base that suits the tips of train."""
    pose = best_pose(tips["train"], recordings["train"].tips)
    return [Compared(one, tips[name], pose) for name, one in recordings.items()]


def groups(recordings: Mapping[str, Recording]) -> dict[str, list[Recording]]:
    """Each set by itself, and both."""
    return {name: [one] for name, one in recordings.items()} | {"both": list(recordings.values())}


def pose_record(compared: Compared) -> dict[str, Any]:
    """The pose of the base as numbers."""
    cosine = (float(np.trace(compared.pose.rotation)) - 1.0) / 2.0
    return {
        "angle_deg": float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))),
        "rotation": compared.pose.rotation.tolist(),
        "translation_m": compared.pose.translation.tolist(),
    }


def set_record(compared: Compared, predicted: Predicted) -> dict[str, Any]:
    """Counts and errors of a set."""
    return {"rows": len(compared.tips), **predicted.counts(), "families": compared.by_family()}


def repeated(recordings: Mapping[str, Recording]) -> list[dict[str, Any]]:
    """The scatter of the robot by what counts as the same command."""
    result = []
    forms: tuple[tuple[str, dict[str, Any]], ...] = (
        ("all", {}),
        ("away from rest", {"moved": AWAY}),
        ("that came the same way", {"same_history": True}),
    )
    for which, options in forms:
        for within in (1e-4, WITHIN, 3e-4):
            row: dict[str, Any] = {"within_m": within, "which": which}
            for name, some in groups(recordings).items():
                distances = repeatability(some, within, **options).distances
                row[name] = {"rows": len(distances), "rms_m": rms(distances) if len(distances) else None}
            result.append(row)
    return result


def sensitivity(recording: Recording, nominal: Nominal, bar: Bar) -> list[dict[str, Any]]:
    """Errors on train under other assumptions, one at a time."""
    result = []
    for changed, value, fields in OTHERS:
        tips = predict(recording, nominal._replace(**fields), bar, f"{changed} {value}".strip()).tips
        errors = Compared(recording, tips, best_pose(tips, recording.tips)).summary()
        result.append({"changed": changed, "to": value, **errors})
    return result
