"""What measurements say of a certain robot: its actuator coordinates, the loads on it, and the frames they are told of."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.identification.measurement_checks import TIP
from softrobots.model.soft_model import SoftModel
from softrobots.statics.loads import Load


def frame_of(model: SoftModel, name: str, markers: Mapping[str, str]) -> str:
    """Return the frame of a robot that the name of a frame or marker stands for.

    Raises:
        NameNotFound: If there is no such frame.
    """
    frame = markers.get(name, name)
    if frame == TIP and frame not in model.data.frame_ids:
        return model.tip
    model.frame_id(frame)
    return frame


def wrenches_on(model: SoftModel, loads: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return all loads but gravity by frame, force, wrench and mass together, each shape (n, 6) [N, N m], measured axes.

    Raises:
        NameNotFound: If there is no such frame.
    """
    total: dict[str, FloatArray] = {}
    for key, values in loads.items():
        frame = frame_of(model, key.removeprefix("wrench."), {}) if key.startswith("wrench.") else model.tip
        if key in ("force", "mass"):
            force = values if key == "force" else values[:, None] * loads["gravity"]
            values = np.hstack([force, np.zeros_like(force)])
        if key != "gravity":
            total[frame] = total.get(frame, 0.0) + values
    return total


def loads_on(model: SoftModel, loads: Mapping[str, FloatArray], rotation: FloatArray) -> dict[str, FloatArray]:
    """Return all loads by frame, gravity by the empty name, in the axes of the robot, which stands turned by a rotation."""
    found = {name: np.asarray(wrench) for name, wrench in wrenches_on(model, loads).items()}
    if "gravity" in loads:
        found[""] = loads["gravity"]
    return {name: (load.reshape(-1, 3) @ rotation).reshape(load.shape) for name, load in found.items()}


def load_cases(loads: Mapping[str, FloatArray], count: int) -> list[Load]:
    """Return the loads of so many rows, from arrays by frame as `loads_on` returns them."""
    frames = [name for name in loads if name]
    gravities = [None] * count if "" not in loads else [tuple(one) for one in loads[""].tolist()]
    return [Load({name: loads[name][row] for name in frames}, one) for row, one in enumerate(gravities)]


def check_coordinates(model: SoftModel, motors: FloatArray, where: Callable[[int], str]) -> None:
    """Refuse actuator coordinates, shape (n, n_motors), that a robot cannot have.

    Raises:
        ParameterError: If a row is none; names it.
    """
    for row, one in enumerate(motors):
        try:
            model.actuators.checked(one, f"q_motors ({where(row)})")
        except ParameterError as error:
            raise ParameterError(error.field, error.value, f"{error.requirement}; are unit and sign right?") from error
