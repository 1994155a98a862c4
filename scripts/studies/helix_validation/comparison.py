"""Frames of the chains at zero against the analytic helix."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from softrobots import helix
from softrobots.robots import HelixTube
from softrobots.statics.kinematics import frame_placement
from studies.helix_validation.tubes import Case


class Row(NamedTuple):
    """Errors of a tube."""

    case: Case
    """The tube."""
    boundaries: int
    """Frames compared."""
    distance: float
    """Largest distance from the helix [m]."""
    angle: float
    """Largest angle between frames [rad]."""


def boundaries(tube: HelixTube) -> dict[str, float]:
    """Lengths along the centre line at which the frames of the chain stand, by frame [m]."""
    count, whole = tube.n_sections, tube.centre_length
    if tube.chain == "sections":
        shares = np.arange(1.0, count + 1.0)
    else:  # in the middle of the sections, the outer ones moved if corrected
        shares = np.arange(count) + 0.5
        if tube.hinge_rule == "corrected" and count > 1:
            moved = (np.array([23.0, -25.0]) - [math.sqrt(671), -math.sqrt(671)]) / 48 if count > 3 else np.array([-1 / 24])
            shares[: len(moved)] += moved
            shares[count - len(moved) :] -= moved[::-1]
    result = {f"section_1_{number}": float(share) * whole / count for number, share in enumerate(shares, start=1)}
    return result | {"segment_1": whole, "tip": whole}


def analytic(tube: HelixTube, lengths: Any) -> Any:
    """Frames of the helix at lengths along the centre line, in world axes, shape (n, 4, 4)."""
    shape = tube.shape
    if shape is None:
        raise sr.StraightTube("a straight tube has no helix")
    frames = helix.frames(shape, helix.turn_angle(shape, lengths), "centre", tube.handedness)
    if tube.upright == "axis":
        return frames
    return np.linalg.inv(helix.transform_base_to_axis(shape, tube.handedness)) @ frames


def chain_frames(model: sr.SoftModel, names: Any) -> Any:
    """Frames of the chain at zero, shape (n, 4, 4)."""
    q = np.zeros(model.pinocchio.nq)
    return np.array([frame_placement(model, q, name).homogeneous for name in names])


def measure(case: Case) -> Row:
    """Compare a tube with its helix."""
    places = boundaries(case.tube)
    found = chain_frames(sr.load_model(case.tube if case.file is None else case.file), places)
    exact = analytic(case.tube, np.array(list(places.values())))
    apart = np.linalg.norm(found[:, :3, 3] - exact[:, :3, 3], axis=1)
    turn = np.swapaxes(found[:, :3, :3], 1, 2) @ exact[:, :3, :3] - np.eye(3)
    askew = np.linalg.norm(turn, axis=(1, 2)) / math.sqrt(2.0)  # of a small angle
    return Row(case, len(places), float(apart.max()), float(askew.max()))


def summary(rows: list[Row]) -> list[dict[str, Any]]:
    """Largest errors by set and form."""
    result = []
    for group, form in dict.fromkeys((row.case.group, row.case.form) for row in rows):
        chosen = [row for row in rows if (row.case.group, row.case.form) == (group, form)]
        result.append(
            {
                "set": group,
                "chain": form,
                "tubes": len(chosen),
                "boundaries": sum(row.boundaries for row in chosen),
                "largest_distance_m": max(row.distance for row in chosen),
                "largest_angle_rad": max(row.angle for row in chosen),
            }
        )
    return result
