"""Knees of a robot: where the tangent of a law jumps, at the ends of a plateau of a link and where a tendon goes slack."""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel


def knees_between(model: SoftModel, motors: FloatArray, here: FloatArray, beyond: FloatArray) -> FloatArray:
    """Return by how much laws that change sides between two places go on beyond their knees along the springs.

    Args:
        model: The robot.
        motors: Actuators, shape (n_motors,).
        here: Elastic coordinates at one place, shape (n_springs,).
        beyond: The same at another place.

    Returns:
        Rows, shape (k, n_springs): bending of links that go onto or off their plateaus [rad], and derivative of the length of
        each tendon that goes slack or taut [m/rad]; empty if no law changes sides.
    """
    rows: list[FloatArray] = []
    places = sorted(model.springs.saturated(here) ^ model.springs.saturated(beyond))
    if places:
        rows.append(np.zeros(model.n_springs))
        rows[0][places] = (beyond - model.springs.rest)[places]
    laws, paths = model.structure.actuator_laws, model.structure.muscle_paths
    if laws is not None:
        inputs = motors[model.n_motors - len(model.muscles) :]
        pulls = [laws.at(paths.at(springs).elongation, inputs).by_length > 0.0 for springs in (here, beyond)]
        rows += list(paths.at(beyond).arms[np.flatnonzero(pulls[0] != pulls[1])])
    return np.array(rows).reshape(-1, model.n_springs)
