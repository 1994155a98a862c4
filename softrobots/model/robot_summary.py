"""Summary of a robot: its actuators with their limits, its springs, its inflated links."""

from __future__ import annotations

from typing import Any

from softrobots.core.errors import short
from softrobots.core.summary import Part, Summarised, Table, facts


class SummarisedRobot(Summarised):
    """What a `SoftModel` tells of itself."""

    pinocchio: Any

    @property
    def name(self) -> str:
        """Name of the robot."""
        return str(self.pinocchio.name)

    def summary_parts(self) -> list[Part]:
        """Return the robot, its actuators with limits and units, and its springs."""
        return robot_parts(self)

    def __repr__(self: Any) -> str:
        """Name, numbers of actuators and springs, and tip in one line."""
        return f"SoftModel({short(self.name)}, {self.n_motors} actuators, {self.n_springs} springs, tip={short(self.tip)})"


def robot_parts(model: Any) -> list[Part]:
    """Return the parts of the summary of a `SoftModel`: the robot, its actuators, and its springs."""
    kinds = [*("motor" for _ in model.structure.motor_joints), *(muscle.kind for muscle in model.muscles)]
    actuators = [
        (name, kind, *(f"{value:.6g}" for value in (*limits, relaxed)), unit)
        for name, kind, limits, relaxed, unit in zip(
            model.actuators.names, kinds, model.motor_limits.tolist(), model.relaxed_motors, model.actuators.units, strict=True
        )
    ]
    stiffness_units = {"rad": "N m/rad", "m": "N/m"}
    springs = [
        (name, f"{stiffness:.6g}", stiffness_units[unit], f"{rest:.6g}", unit)
        for name, stiffness, rest, unit in zip(
            model.spring_joints, model.stiffness, model.rest, model.springs.units, strict=True
        )
    ]
    rows = [("robot", model.name), ("tip", model.tip), ("reach", f"{model.reach:.6g} m")]
    if groups := model.spring_groups:
        pressure, radius = (_range([getattr(group, name) for group in groups]) for name in ("pressure", "radius"))
        rows.append(("inflated links", f"{len(groups)}, pressure {pressure} Pa, radius {radius} m"))
    parts: list[Part] = [facts(rows)]
    if actuators:
        parts.append(Table([("actuator", "kind", "least", "largest", "relaxed", ""), *actuators], right=(2, 3, 4)))
    if springs:
        parts.append(Table([("spring", "stiffness", "", "rest", ""), *springs], right=(1, 3)))
    return parts


def _range(values: list[float]) -> str:
    """The value that all have, or the least and the largest."""
    return " to ".join(f"{value:.6g}" for value in sorted({min(values), max(values)}))
