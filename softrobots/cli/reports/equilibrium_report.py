"""A solved equilibrium as an answer of a command for a machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from softrobots.cli.reports.answers import Fact, answer_of, attributes
from softrobots.model.actuators import joined_units, load_units
from softrobots.model.link_limits import known_margins
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load


def equilibrium_answer(equilibrium: Equilibrium) -> dict[str, Any]:
    """Everything about an equilibrium by the names of its attributes, with `units`."""
    model, limits = equilibrium.model, equilibrium.link_limits
    motors, springs = model.actuators.units, model.springs.units
    facts = [
        *attributes(equilibrium, q_motors=joined_units(motors), motor_torques=joined_units(load_units(motors))),
        *attributes(equilibrium, q_springs=joined_units(springs), spring_torques=joined_units(load_units(springs))),
        Fact("tip_position", equilibrium.tip_position, "m"),
        Fact("transform_tip_to_world", equilibrium.tip_pose, "m"),
        Fact("link_moments", equilibrium.link_moments, "N m"),
        *attributes(limits, axial_forces="N", slack_moments="N m"),
        Fact("slack_margins", known_margins(limits.slack_margins), "-"),
        Fact("wrinkling_moments", limits.wrinkling_moments, "N m"),
        Fact("wrinkling_margins", known_margins(limits.wrinkling_margins), "-"),
        *attributes(equilibrium, wrinkled="", saturated="", muscle_lengths="m", muscle_forces="N", muscle_slack="", stable=""),
        Fact("stability", equilibrium.stability.kind),
        Fact("growth_rate", equilibrium.stability.growth_rate, "1/s"),
        *_contacts(equilibrium),
        *attributes(equilibrium, conservative="", within_limits="", residual="N m", tolerance="N m", iterations="-", method=""),
    ]
    return model_answer(model, equilibrium.load, facts)


def model_answer(model: SoftModel, load: Load, facts: Sequence[Fact]) -> dict[str, Any]:
    """Facts of a loaded robot after its names, its wrenches by frame [N, N m], force first, and gravity [m/s^2], if any."""
    names = {"motor_joints": model.motor_joints, "spring_joints": model.spring_joints, "tip": model.tip}
    loaded: dict[str, Any] = {"wrenches": dict(load.wrenches), "gravity": load.gravity}
    if load.environment is not None:
        loaded["environment"] = load.environment.to_dict()
    return {"robot": model.pinocchio.name, **names, "load": loaded, **answer_of(facts)}


def _contacts(equilibrium: Equilibrium) -> list[Fact]:
    """The contacts as plain data by the names of their attributes, if there are obstacles."""
    if equilibrium.environment is None:
        return []
    units = "normals and status without unit; points, gap and slip [m]; forces [N]"
    return [Fact("contacts", [vars(contact) for contact in equilibrium.contacts], units)]
