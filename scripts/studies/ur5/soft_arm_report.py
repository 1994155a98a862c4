"""Sag, tip error and joint torques of a UR5 with a soft arm, as numbers and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import softrobots as sr
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from studies.ur5.soft_arm import Load, SoftArm

UR5_PAYLOAD = 5.0
"""What a UR5 may carry, by its maker [kg]."""


def summarise(before: sr.Trajectory, after: sr.Trajectory, rigid: sr.Equilibrium, load: Load, arm: SoftArm) -> dict[str, Any]:
    """Collect the numbers of the table."""
    model, last = after.model, after.equilibria[-1]
    joints = {joint.name: joint for joint in read_rigid_tree(model.urdf).joints}
    soft = sum(body.mass for body in read_rigid_tree(arm.urdf()).bodies)
    same = before.equilibria[0]
    return {
        "carried_mass_kg": soft + load.payload,
        "payload_kg": load.payload,
        "tip_without_load_m": rigid.tip_position.tolist(),
        "sag_m": float(np.linalg.norm(same.tip_position - sr.solve_equilibrium(model, same.q_motors).tip_position)),
        "path": len(before.times) > 1,
        "tip_error_before_m": float(before.tip_error.max()),
        "tip_error_after_m": float(after.tip_error[-1] if len(before.times) == 1 else after.tip_error.max()),
        "tip_turned_before_rad": turned(rigid, same),
        "tip_turned_after_rad": turned(rigid, last),
        "joints": list(model.motor_joints),
        "start_rad": same.q_motors.tolist(),
        "end_rad": last.q_motors.tolist(),
        "largest_torque_before_N_m": np.abs([e.motor_torques for e in before.equilibria]).max(axis=0).tolist(),
        "largest_torque_after_N_m": np.abs([e.motor_torques for e in after.equilibria]).max(axis=0).tolist(),
        "effort_limit_N_m": [joints[name].effort for name in model.motor_joints],
        "largest_moment_N_m": None if after.link_moments is None else float(after.link_moments.max()),
        "wrinkling_moment_N_m": min((group.wrinkling_moment for group in model.spring_groups), default=None),
        "wrinkling_margin": after.least_margin("wrinkling_margins"),
        "all_stable": all(e.stable for e in after.equilibria),
        "within_limits": all(e.within_limits for e in after.equilibria),
    }


def turned(one: sr.Equilibrium, other: sr.Equilibrium) -> float:
    """Angle between the tips of two equilibria [rad]."""
    away = one.transform_tip_to_world.actInv(other.transform_tip_to_world)
    return float(np.linalg.norm(pin.log3(away.rotation)))


def table(summary: dict[str, Any]) -> str:
    """Format the numbers for a person."""
    rows = zip(
        *(
            summary[name]
            for name in (
                "joints", "start_rad", "end_rad", "largest_torque_before_N_m", "largest_torque_after_N_m", "effort_limit_N_m",
            )
        ),
        strict=True,
    )  # fmt: skip
    lines = ["", f"{'UR5 joint':<20}{'start':>12}{'end':>12}{'torque before':>17}{'torque after':>15}{'limit':>12}"]
    lines += [
        f"{name:<20}{start:>8.4f} rad{round(end, 4) + 0.0:>8.4f} rad{before:>13.2f} N m{after:>11.2f} N m{limit:>8.0f} N m"
        for name, start, end, before, after, limit in rows
    ]
    carried, mass = float(summary["carried_mass_kg"]), float(summary["payload_kg"])
    way = (" (rigid IK, largest)", " (largest)") if summary["path"] else ("", "")
    facts = [
        ("carried by the flange", f"{carried:.3f} kg, {mass:g} kg of it at the tip (a UR5 may carry {UR5_PAYLOAD:g} kg)"),
        ("sag of the tip against the rigid arm", f"{1e3 * float(summary['sag_m']):.2f} mm"),
        (f"tip error before{way[0]}", f"{1e3 * float(summary['tip_error_before_m']):.2f} mm"),
        (f"tip error after compensation{way[1]}", f"{1e3 * float(summary['tip_error_after_m']):.1e} mm"),
        ("tip turned before", f"{float(summary['tip_turned_before_rad']):.4f} rad"),
        ("tip turned after compensation", f"{float(summary['tip_turned_after_rad']):.4f} rad"),
        ("largest moment of an inflated link", wrinkling(summary)),
        ("every equilibrium certified stable", "yes" if summary["all_stable"] else "NO"),
        ("joints within limits", "yes" if summary["within_limits"] else "NO"),
    ]
    lines += ["", *(f"{name:<40}{value}" for name, value in facts)]
    over = [
        name
        for name, torque, limit in zip(
            summary["joints"], summary["largest_torque_after_N_m"], summary["effort_limit_N_m"], strict=True
        )
        if torque > limit
    ]
    if over:
        lines.append(f"WARNING: {', '.join(over)} cannot hold this load.")
    if carried > UR5_PAYLOAD:
        lines.append("WARNING: the arm and its payload are heavier than what a UR5 may carry.")
    if summary["wrinkling_margin"] is not None and float(summary["wrinkling_margin"]) <= 0.0:
        lines.append("WARNING: a link wrinkles; linear springs no longer hold there. Raise the pressure or lower the payload.")
    return "\n".join(lines)


def wrinkling(summary: dict[str, Any]) -> str:
    """How near the arm comes to wrinkling, for a person."""
    if summary["wrinkling_margin"] is None:
        return "none: it has no inflated link"
    return (
        f"{summary['largest_moment_N_m']:.3g} N m (wrinkles at {summary['wrinkling_moment_N_m']:.3g} N m, "
        f"margin {100 * summary['wrinkling_margin']:.1f} %)"
    )
