"""A solved equilibrium as an answer of a command: tables and certificates for a person, and the same numbers for a machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.cli.reports.answers import Fact, aligned, answer_of, attributes, formatted
from softrobots.core.checks import FloatArray
from softrobots.model.actuators import load_units
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load
from softrobots.statics.stability import DIVERGENT, FLUTTER, NEUTRAL, STABLE, UNKNOWN


def equilibrium_answer(equilibrium: Equilibrium) -> dict[str, Any]:
    """Everything about an equilibrium by the names of its attributes, with `units`."""
    model, limits = equilibrium.model, equilibrium.link_limits
    motors, springs = model.actuators.units, model.springs.units
    facts = [
        *attributes(equilibrium, q_motors=joined_units(motors), motor_torques=joined_units(load_units(motors))),
        *attributes(equilibrium, q_springs=joined_units(springs), spring_torques=joined_units(load_units(springs))),
        Fact("tip_position", equilibrium.tip_position, "m"),
        Fact("transform_tip_to_world", equilibrium.transform_tip_to_world.homogeneous, "m"),
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


def equilibrium_lines(equilibrium: Equilibrium) -> list[str]:
    """The same for a person: tables of motors, actuators, springs and inflated links, then pose of the tip and certificates."""
    return [*coordinate_lines(equilibrium), "", *summary_lines(equilibrium)]


def coordinate_lines(equilibrium: Equilibrium) -> list[str]:
    """Tables of the load, of motors, actuators, springs and inflated links."""
    model = equilibrium.model
    names, units = model.structure.motor_joints, model.actuators.units
    n = len(names)
    motors = _table("motor", names, equilibrium.q_motors[:n], units[:n], equilibrium.motor_torques[:n])
    springs = _table("spring", model.spring_joints, equilibrium.q_springs, model.springs.units, equilibrium.spring_torques)
    parts = [motors, _actuators(equilibrium), springs, _links(equilibrium), contact_lines(equilibrium)]
    return [*head_lines(model, equilibrium.load), *(line for part in parts if part for line in ("", *part))]


def summary_lines(equilibrium: Equilibrium) -> list[str]:
    """Return lines with the pose of the tip and the certificates."""
    steps = f"{equilibrium.iterations} iteration{'s' * (equilibrium.iterations != 1)} by {equilibrium.method}"
    rpy = pin.rpy.matrixToRpy(equilibrium.transform_tip_to_world.rotation)
    rows = [
        ("tip position", f"{formatted(equilibrium.tip_position)} m"),
        ("tip roll, pitch, yaw", f"{formatted(np.where(abs(rpy) < 1e-15, 0.0, rpy))} rad"),
        ("stable", stability_words(equilibrium)),
        ("within limits", "yes" if equilibrium.within_limits else "NO: a motor, a muscle or a spring is beyond its limits"),
        *_slack(equilibrium),
        *_walls(equilibrium),
        ("conservative", "yes" if equilibrium.conservative else "no: a world-fixed moment has no potential"),
        ("residual", f"{equilibrium.residual:.2g} N m ({equilibrium.tolerance:.2g} N m allowed), {steps}"),
    ]
    return aligned(rows)


def stability_words(equilibrium: Equilibrium) -> str:
    """Whether an equilibrium is stable, and if not, what happens to it."""
    words = {
        STABLE: "yes, certified",
        NEUTRAL: "NO: neutral, it can be moved aside without a force",
        DIVERGENT: f"NO: divergent, a disturbance grows by {equilibrium.stability.growth_rate:.3g} 1/s",
        FLUTTER: f"NO: flutter grows by {equilibrium.stability.growth_rate:.3g} 1/s, which damping may suppress",
        UNKNOWN: "NO: not known, a moment acts without masses, or a section is out of range",
    }
    return words[equilibrium.stability.kind]


def known_margins(margins: FloatArray) -> list[float | None]:
    """Margins of inflated links as a list [-]; None for a link whose wall has no tension."""
    return [margin if math.isfinite(margin) else None for margin in margins.tolist()]


def _slack(equilibrium: Equilibrium) -> list[tuple[str, str]]:
    """Which tendons are slack; nothing without elastic tendons."""
    muscles = equilibrium.model.muscles
    slack = [muscle.name for muscle, hangs in zip(muscles, equilibrium.muscle_slack, strict=True) if hangs]
    return [("slack tendons", ", ".join(slack) or "none")] * any(muscle.kind == "elastic" for muscle in muscles)


def _walls(equilibrium: Equilibrium) -> list[tuple[str, str]]:
    """Whether a link is wrinkled, whether its wall is slack, and what is left to both; nothing without inflated links."""
    groups = equilibrium.model.spring_groups
    if not groups:
        return []
    limits, soft = equilibrium.link_limits, all(group.slack_wall for group in groups)
    actuated = bool(equilibrium.model.structure.lines) and any(group.segment is not None for group in groups)
    share = "at most" if actuated else "at least"
    least = float(limits.wrinkling_margins.min())
    wrinkled = "YES: half of a wall is slack" if soft else "YES: linear springs no longer hold"
    left = f"no, {share} {100.0 * least:.1f} % of the wrinkling moment is left"
    slack = slack_words(float(limits.slack_margins.min()), share)
    rows = [("wrinkled", wrinkled if equilibrium.wrinkled else left), ("first slack fibre", slack)]
    bounds = "upper bounds, of a straight tube: the wall along the actuator is slack before any load"
    return [*rows, ("limits of the wall", bounds)] if actuated else rows


def slack_words(margin: float, share: str = "at least") -> str:
    """Whether the wall of a link is slack, from the least margin to its first slack fibre [-]."""
    return f"no, {share} {100.0 * margin:.1f} % of its moment is left" if margin > 0.0 else "YES: by membrane theory"


def head_lines(model: SoftModel, load: Load) -> list[str]:
    """Return a line for the robot, one for springs that the caller gave or took away, and those of the load."""
    roles = model.joint_roles
    given = [name for name, role in roles.items() if role == "given spring"]
    kept = sum(role == "spring" for role in roles.values())
    taken = [name for name in model.structure.tags.springs if roles.get(name) in ("motor", "locked")]
    changes = [f"{what}: {', '.join(names)}" for what, names in (("given", given), ("taken away", taken)) if names]
    springs = [("springs", "; ".join([*changes, f"of the file: {kept or 'none'}"]))] if changes else []
    rows = []
    for frame, wrench in load.wrenches.items():
        if wrench.any():
            moment = f", moment {formatted(wrench[3:])} N m" if wrench[3:].any() else ""
            rows.append((f"load on {frame}", f"force {formatted(wrench[:3])} N{moment}"))
    gravity = "none" if load.gravity is None else f"{formatted(np.array(load.gravity))} m/s^2"
    hinges = max((group.n_hinges for group in model.spring_groups), default=1)
    robot = ("robot", f"{model.pinocchio.name}{f', {hinges} hinges a link' if hinges > 1 else ''} (tip: {model.tip})")
    around = [] if load.environment is None else [("obstacles", ", ".join(load.environment.names) or "the robot itself")]
    return aligned([robot, *springs, *(rows or [("load", "none")]), ("gravity", gravity), *around])


def joined_units(units: Sequence[str]) -> str:
    """The units of a row of numbers as one text: one unit if all have it, else one for each."""
    return units[0] if len(set(units)) == 1 else ", ".join(units)


def _table(what: str, names: tuple[str, ...], values: Any, units: tuple[str, ...], loads: Any) -> list[str]:
    if not names:
        return []
    rows = zip(names, values, units, loads, load_units(units), strict=True)
    cells = [(name, _fixed(value), unit, _fixed(load), load_unit) for name, value, unit, load, load_unit in rows]
    return aligned([(what, "position", "", "load", ""), *cells], right=(1, 3))


def _actuators(equilibrium: Equilibrium) -> list[str]:
    """Kind and coordinate of each actuator, its length, tension, and whether it is slack."""
    model = equilibrium.model
    if not model.muscles:
        return []
    first = model.n_motors - len(model.muscles)
    columns = (
        equilibrium.q_motors[first:],
        model.actuators.units[first:],
        equilibrium.muscle_lengths,
        equilibrium.muscle_forces,
    )
    cells = [
        (muscle.name, muscle.kind, _fixed(given), unit, _fixed(length), "m", _fixed(tension), "N", "slack" * slack)
        for muscle, given, unit, length, tension, slack in zip(model.muscles, *columns, equilibrium.muscle_slack, strict=True)
    ]
    return aligned([("actuator", "kind", "given", "", "length", "", "tension", "", ""), *cells], right=(2, 4, 6))


def _links(equilibrium: Equilibrium) -> list[str]:
    limits = equilibrium.link_limits
    if not equilibrium.model.spring_groups:
        return []
    rows = [("link", "moment", "axial", "slack from", "left", "wrinkles", "left", "")]
    left = [known_margins(margins) for margins in (limits.slack_margins, limits.wrinkling_margins)]
    for number, (values, *margins) in enumerate(zip(zip(*limits[:4], strict=True), *left, strict=True), start=1):
        moment, force, slack, wrinkling = (f"{value:#.4g}" for value in values)
        shares = ["-" if margin is None else f"{100.0 * margin:.1f} %" for margin in margins]
        cells = (f"{moment} N m", f"{force} N", f"{slack} N m", shares[0], f"{wrinkling} N m", shares[1])
        rows.append((str(number), *cells, "plateau" if equilibrium.saturated[number - 1] else ""))
    return [line.rstrip() for line in aligned(rows, right=(1, 2, 3, 4, 5, 6))]


def contact_lines(equilibrium: Equilibrium) -> list[str]:
    """Table of the contacts; nothing in free space."""
    if equilibrium.environment is None:
        return []
    rows = [("contact of", "with", "", "force", "", "force x, y, z [N]", "at x, y, z [m]", "gap")]
    for one in equilibrium.contacts:
        vectors = formatted(one.force), formatted(one.point)
        rows.append((one.link, one.obstacle, one.status, _fixed(one.normal_force), "N", *vectors, f"{one.gap:.2g} m"))
    return aligned(rows, right=(3,)) if equilibrium.contacts else ["contacts  none: the robot touches nothing"]


def _contacts(equilibrium: Equilibrium) -> list[Fact]:
    """The contacts as plain data by the names of their attributes, if there are obstacles."""
    if equilibrium.environment is None:
        return []
    units = "normals and status without unit; points, gap and slip [m]; forces [N]"
    return [Fact("contacts", [vars(contact) for contact in equilibrium.contacts], units)]


def _fixed(value: float) -> str:
    """A number with six decimals, or with an exponent if that would hide it; without a negative zero."""
    value = value + 0.0
    return f"{value:.6f}" if value == 0.0 or 1e-4 <= abs(value) < 1e6 else f"{value:.2e}" if abs(value) >= 1e-15 else "0.000000"
