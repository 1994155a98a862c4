"""Summary of an equilibrium: tables of motors, actuators, springs, inflated links and contacts, then tip and certificates.

And of an estimated force: its equilibrium, the force with its errors, and what the motors do not feel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.summary import Part, Table, facts, force_text, formatted
from softrobots.model.actuators import joined_units, load_units
from softrobots.model.link_limits import slack_words
from softrobots.model.soft_model import SoftModel
from softrobots.statics.loads import Load
from softrobots.statics.stability import DIVERGENT, FLUTTER, NEUTRAL, STABLE, UNKNOWN


def equilibrium_parts(equilibrium: Any) -> list[Part]:
    """Return the parts of the summary of an `Equilibrium`; the last one is the facts about tip and certificates."""
    model = equilibrium.model
    names, units = model.structure.motor_joints, model.actuators.units
    n = len(names)
    motors = _table("motor", names, equilibrium.q_motors[:n], units[:n], equilibrium.motor_torques[:n])
    springs = _table("spring", model.spring_joints, equilibrium.q_springs, model.springs.units, equilibrium.spring_torques)
    parts = [loaded_robot(model, equilibrium.load), motors, _actuators(equilibrium), springs, _links(equilibrium)]
    return [*parts, *contact_parts(equilibrium), _certificates(equilibrium)]


def _certificates(equilibrium: Any) -> Table:
    """The pose of the tip, what is certified, and what is left until links wrinkle."""
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
    return facts(rows)


def stability_words(equilibrium: Any) -> str:
    """Whether an equilibrium is stable, and if not, what happens to it."""
    words = {
        STABLE: "yes, certified",
        NEUTRAL: "NO: neutral, it can be moved aside without a force",
        DIVERGENT: f"NO: divergent, a disturbance grows by {equilibrium.stability.growth_rate:.3g} 1/s",
        FLUTTER: f"NO: flutter grows by {equilibrium.stability.growth_rate:.3g} 1/s, which damping may suppress",
        UNKNOWN: "NO: not known, a moment acts without masses, or a section is out of range",
    }
    return words[equilibrium.stability.kind]


def _slack(equilibrium: Any) -> list[tuple[str, str]]:
    """Which tendons are slack; nothing without elastic tendons."""
    muscles = equilibrium.model.muscles
    slack = [muscle.name for muscle, hangs in zip(muscles, equilibrium.muscle_slack, strict=True) if hangs]
    return [("slack tendons", ", ".join(slack) or "none")] * any(muscle.kind == "elastic" for muscle in muscles)


def _walls(equilibrium: Any) -> list[tuple[str, str]]:
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


def loaded_robot(model: SoftModel, load: Load) -> Table:
    """Return the facts of the robot, of springs that the caller gave or took away, and of the load."""
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
            rows.append((f"load on {frame}", f"force {force_text(wrench[:3])}{moment}"))
    gravity = "none" if load.gravity is None else f"{formatted(np.array(load.gravity))} m/s^2"
    hinges = max((group.n_hinges for group in model.spring_groups), default=1)
    robot = ("robot", f"{model.pinocchio.name}{f', {hinges} hinges a link' if hinges > 1 else ''} (tip: {model.tip})")
    around = [] if load.environment is None else [("obstacles", ", ".join(load.environment.names) or "the robot itself")]
    return facts([robot, *springs, *(rows or [("load", "none")]), ("gravity", gravity), *around])


def _table(what: str, names: tuple[str, ...], values: Any, units: tuple[str, ...], loads: Any) -> Part:
    if not names:
        return ""
    rows = zip(names, values, units, loads, load_units(units), strict=True)
    cells = [(name, _fixed(value), unit, _fixed(load), load_unit) for name, value, unit, load, load_unit in rows]
    return Table([(what, "position", "", "load", ""), *cells], right=(1, 3))


def _actuators(equilibrium: Any) -> Part:
    """Kind and coordinate of each actuator, its length, tension, and whether it is slack."""
    model = equilibrium.model
    if not model.muscles:
        return ""
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
    return Table([("actuator", "kind", "given", "", "length", "", "tension", "", ""), *cells], right=(2, 4, 6))


def _links(equilibrium: Any) -> Part:
    """Table of the inflated links, with those on the plateau of their moment."""
    if not equilibrium.model.spring_groups:
        return ""
    table: Table = equilibrium.link_limits.table()
    marks = ["", *("plateau" * saturated for saturated in equilibrium.saturated)]
    return table._replace(rows=[(*row, mark) for row, mark in zip(table.rows, marks, strict=True)])


def contact_parts(equilibrium: Any) -> list[Part]:
    """Return a table of the contacts of an `Equilibrium`; nothing in free space."""
    if equilibrium.environment is None:
        return []
    if not equilibrium.contacts:
        return ["contacts  none: the robot touches nothing"]
    rows = [("contact of", "with", "", "force", "", "force x, y, z [N]", "at x, y, z [m]", "gap")]
    for one in equilibrium.contacts:
        vectors = formatted(one.force), formatted(one.point)
        rows.append((one.link, one.obstacle, one.status, _fixed(one.normal_force), "N", *vectors, f"{one.gap:.2g} m"))
    return [Table(rows, right=(3,))]


def _fixed(value: float) -> str:
    """A number with six decimals, or with an exponent if that would hide it; without a negative zero."""
    value = value + 0.0
    return f"{value:.6f}" if value == 0.0 or 1e-4 <= abs(value) < 1e6 else f"{value:.2e}" if abs(value) >= 1e-15 else "0.000000"


def load_parts(estimate: Any) -> list[Part]:
    """Return the parts of the summary of a `LoadEstimate`."""
    rows = [(f"force on {estimate.frame}", force_text(estimate.force))]
    if estimate.force_std is not None:
        rows.append(("  standard deviation", f"{formatted(estimate.force_std)} N"))
    if len(estimate.covariance_parts) > 1:
        for name, part in estimate.covariance_parts.items():
            rows.append((f"    by {name.replace('_', ' ')}", f"{formatted(np.sqrt(np.diag(part)))} N"))
    if estimate.friction_range is not None:
        low, high = estimate.friction_range.T
        rows.append(("  friction unknown", f"{formatted(low)} to {formatted(high)} N"))
    rows += [("  explained as well by", f"{formatted(other.force)} N") for other in estimate.alternatives]
    motors = estimate.equilibrium.model.actuators.units
    felt = f"{formatted(estimate.singular_values)} {unit_per_newton(motors)}"
    rows.append(("singular values", f"{felt} (condition number {estimate.condition_number:.3g})"))
    directions = [("NOT FELT along", formatted(direction)) for direction in estimate.unobservable_directions]
    rows += directions or [("not felt along", "no direction")]
    left = f"{estimate.residual:.2g} {joined_units(load_units(motors))}"
    rows.append(("torques unexplained", f"{left}, {estimate.iterations} iterations by {estimate.method}"))
    return [*estimate.equilibrium.summary_parts(), facts(rows)]


def unit_per_newton(motors: Sequence[str]) -> str:
    """Return the unit of what actuators of these units feel of a force, over the force."""
    return joined_units([{"N m": "m", "N": "-"}[unit] for unit in load_units(motors)])
