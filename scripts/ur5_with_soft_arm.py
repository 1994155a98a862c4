"""A UR5 that carries a soft arm with a payload: sag under gravity, and its compensation by the joints of the UR5.

Mounts a soft arm on the flange of a UR5 (its URDF comes with the extra `robots`), holds the arm's own motors, solves the
equilibrium with gravity and a payload at the soft tip, and finds UR5 joint angles that bring the loaded tip back to where it is
without load, or that move it along a straight line. Prints a table of sag, tip error and joint torques, and writes it with the
URDF, the result (NPZ), a picture and a self-contained HTML scene into a new folder.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

import softrobots as sr
from softrobots.cli.options.command_line import exit_status, serve, tell_written
from softrobots.core.checks import FloatArray, finite_array, non_negative_number, positive_integer, positive_number, read_only
from softrobots.core.files import free_folder, make_folder, write_text
from softrobots.description.composition import fix_joints
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.third_party import UR5, robot_file
from softrobots.view.figures import canvas, trajectories

UR5_PAYLOAD = 5.0
"""What a UR5 may carry, by its maker [kg]."""
POSE = (0.0, -2.1, 1.9, 0.2, math.pi / 2, 0.0)
"""UR5 joints, base to flange [rad]: the flange points forward, level."""
PAYLOAD = {"inflatable_arm": 1.0, "helix_tube": 0.001, "pcc_arm": 0.05}
"""Payload of each arm, well below wrinkling [kg]."""

SoftArm = sr.InflatableArm | sr.HelixTube | sr.PccArm
"""What can be carried."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument(
        "--robot",
        choices=tuple(PAYLOAD),
        default="inflatable_arm",
        help="the soft arm, with its default parameters, a PCC arm without muscles (%(default)s)",
    )
    told = " ".join(f"{angle:.4g}" for angle in POSE)
    made.add_argument(
        "--pose", type=float, nargs=6, metavar="Q", default=POSE, help=f"UR5 joints, base to flange [rad] ({told})"
    )
    made.add_argument(
        "--arm-angles", type=float, nargs=3, metavar="A",
        help="motors of the inflatable arm, held there [rad] (0 pi/2 0: straight on from the flange)",
    )  # fmt: skip
    given = ", ".join(f"{name}: {mass:g}" for name, mass in PAYLOAD.items())
    made.add_argument("--payload", type=float, metavar="M", help=f"point mass at the soft tip [kg] ({given})")
    made.add_argument("--pressure", type=float, metavar="P", help="gauge pressure in the soft arm [Pa] (as the robot has it)")
    made.add_argument(
        "--gravity", type=float, nargs=3, metavar="G", default=sr.EARTH_GRAVITY, help="gravity [m/s^2] (0 0 -9.81)"
    )
    made.add_argument(
        "--keep-orientation", action="store_true", help="bring the orientation of the tip back, too (takes all six joints)"
    )
    made.add_argument(
        "--to", type=float, nargs=3, metavar=("X", "Y", "Z"), help="move the loaded tip to this point on a line [m]"
    )
    made.add_argument("--duration", type=float, default=2.0, help="time of the motion [s] (%(default)s)")
    made.add_argument("--steps", type=int, default=40, help="intervals of the motion (%(default)s)")
    made.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder of the results (output/ur5_with_soft_arm_<time>)"
    )
    made.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    made.add_argument("--meshcat", action="store_true", help="serve the scene on loopback until Ctrl-C")
    return made


class Load(NamedTuple):
    """Gravity, and the payload as the force that it is."""

    payload: float
    """Mass at the tip [kg]."""
    gravity: FloatArray
    """Shape (3,) [m/s^2]."""

    @property
    def force(self) -> FloatArray:
        """Weight of the payload, shape (3,) [N]."""
        return self.payload * self.gravity


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    default = PAYLOAD[arguments.robot]
    payload = non_negative_number("--payload", default if arguments.payload is None else arguments.payload, "kg")
    load = Load(payload, finite_array("--gravity", arguments.gravity, (3,), "m/s^2"))
    positive_number("--duration", arguments.duration, "s")
    positive_integer("--steps", arguments.steps)
    if arguments.keep_orientation and arguments.to is not None:
        raise sr.ParameterError(
            "--keep-orientation", True, "left out with --to: a line is followed with the position of the tip"
        )
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    ur5 = robot_file(UR5)
    arm, held = soft_arm(arguments)
    urdf = mounted(ur5, arm, held)
    model = sr.load_model(urdf)
    within_limits("--pose", arguments.pose, model.motor_limits)
    folder = free_folder(arguments.output or Path("output") / f"ur5_with_soft_arm_{datetime.now():%Y%m%d_%H%M%S}")

    rigid = sr.solve_equilibrium(model, arguments.pose)  # without load
    follow = compensate if arguments.to is None else follow_line
    before, after = follow(model, arguments, load, rigid)
    summary = summarise(before, after, rigid, load, arm)
    figure = None if arguments.no_plots else trajectories.poses(after, shown=2 if arguments.to is None else 6)
    with sr.view(model, after) as viewer:
        make_folder(folder)
        sr.save_result(after, folder / "result.npz")
        sr.save_csv(after, folder / "result.csv")
        write_text(folder / f"{model.pinocchio.name}.urdf", urdf, overwrite=False)
        write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n", overwrite=False)
        write_text(folder / "table.txt", table(summary) + "\n", overwrite=False)
        if figure is not None:
            canvas.write_png(figure, folder / "poses.png", overwrite=False)
        viewer.write_html(folder / "scene.html", title=f"UR5 with a soft arm, {load.payload:g} kg at its tip")
        print(table(summary))
        tell_written(folder)
        if arguments.meshcat:
            serve(viewer)
    return folder


def soft_arm(arguments: argparse.Namespace) -> tuple[SoftArm, dict[str, float]]:
    """The soft arm, and the positions at which its own motors are held."""
    name, pressure = arguments.robot, {} if arguments.pressure is None else {"pressure": arguments.pressure}
    if name != "inflatable_arm" and arguments.arm_angles is not None:
        raise sr.ParameterError("--arm-angles", arguments.arm_angles, f"left out with --robot {name}, which has no motors")
    if name != "pcc_arm" and pressure:
        positive_number("--pressure", arguments.pressure, "Pa")  # without it there is no wrinkling margin
    if name == "pcc_arm":
        if pressure:
            raise sr.ParameterError("--pressure", arguments.pressure, "left out with --robot pcc_arm, which is not inflated")
        return sr.PccArm(muscle_azimuths=()), {}
    if name == "helix_tube":
        return sr.HelixTube(**pressure), {}
    arm, angles = sr.InflatableArm(**pressure), arguments.arm_angles or (0.0, math.pi / 2, 0.0)
    within_limits("--arm-angles", angles, np.array([[-arm.motor_limit, arm.motor_limit]] * 3))
    return arm, {f"motor_{i + 1}": float(angle) for i, angle in enumerate(angles)}


def within_limits(option: str, angles: Sequence[float], limits: FloatArray) -> None:
    """Refuse angles that are not finite or beyond limits, shape (n, 2) [rad]."""
    checked = finite_array(option, angles, (len(limits),), "rad")
    if np.any((checked < limits[:, 0]) | (checked > limits[:, 1])):
        told = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in limits)
        raise sr.ParameterError(option, list(angles), f"within the limits of the joints, {told} rad")


def mounted(ur5: Path, arm: SoftArm, held: dict[str, float]) -> str:
    """URDF of the UR5 with the arm on its flange, the motors of the arm held; the foot of the arm stands on the flange."""
    text = fix_joints(arm, held)
    foot = read_rigid_tree(text).body("base_link").visuals[0]  # a cylinder along z below the origin of the arm
    height = foot.size[1] / 2.0 - float(foot.placement.position[2])
    return sr.mount(ur5, "tool0", text, xyz=(0.0, 0.0, height))


def compensate(
    model: sr.SoftModel, arguments: argparse.Namespace, load: Load, rigid: sr.Equilibrium
) -> tuple[sr.Trajectory, sr.Trajectory]:
    """Bring the loaded tip back to where it is without load; the way there is even in the joints of the UR5."""
    solution = sr.solve_ik(
        model, rigid.tip_position, load.force, gravity=load.gravity, q_motors0=rigid.q_motors, starts=4,
        orientation=np.array(rigid.transform_tip_to_world.rotation) if arguments.keep_orientation else None,
    )  # fmt: skip
    shares = np.linspace(0.0, 1.0, arguments.steps + 1)
    way = rigid.q_motors + sr.quintic(shares)[:, None] * (solution.q_motors - rigid.q_motors)
    way[-1] = solution.q_motors
    targets = read_only(np.tile(rigid.tip_position, (len(way), 1)))
    times = read_only(arguments.duration * shares)
    after = settled(model, way, load, times, targets, "compensation")
    return settled(model, way[:1], load, times[:1], targets[:1], "uncompensated"), after


def follow_line(
    model: sr.SoftModel, arguments: argparse.Namespace, load: Load, rigid: sr.Equilibrium
) -> tuple[sr.Trajectory, sr.Trajectory]:
    """Move the loaded tip from where it is without load along a line; beside it what rigid inverse kinematics would do."""
    path = sr.straight_line(rigid.tip_position, arguments.to, arguments.duration, arguments.steps)

    def follow(label: str, force: object, gravity: object) -> sr.Trajectory:
        return sr.follow_trajectory(
            model, path.positions, force, gravity=gravity, q_motors0=rigid.q_motors, times=path.times, progress=label
        )

    after = follow("compensated", load.force, load.gravity)
    unloaded = follow("rigid", None, None)
    return settled(model, unloaded.q_motors, load, path.times, path.positions, "rigid"), after


def settled(
    model: sr.SoftModel, motors: FloatArray, load: Load, times: FloatArray, targets: FloatArray, label: str
) -> sr.Trajectory:
    """The loaded robot at given joint angles."""
    equilibria = tuple(sr.solve_equilibrium(model, q, load.force, gravity=load.gravity) for q in motors)
    return sr.Trajectory(times, targets, equilibria, label)


def summarise(
    before: sr.Trajectory, after: sr.Trajectory, rigid: sr.Equilibrium, load: Load, arm: SoftArm
) -> dict[str, object]:
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
        "wrinkling_margin": after.wrinkling_margin,
        "all_stable": all(e.stable for e in after.equilibria),
        "within_limits": all(e.within_limits for e in after.equilibria),
    }


def turned(one: sr.Equilibrium, other: sr.Equilibrium) -> float:
    """Angle between the tips of two equilibria [rad]."""
    away = one.transform_tip_to_world.actInv(other.transform_tip_to_world)
    return float(np.linalg.norm(pin.log3(away.rotation)))


def table(summary: dict[str, object]) -> str:
    """Format the numbers for a person."""
    rows = zip(
        *(
            summary[name]
            for name in (
                "joints", "start_rad", "end_rad", "largest_torque_before_N_m", "largest_torque_after_N_m", "effort_limit_N_m",
            )
        ),
        strict=True,
    )  # type: ignore[call-overload]  # fmt: skip
    lines = ["", f"{'UR5 joint':<20}{'start':>12}{'end':>12}{'torque before':>17}{'torque after':>15}{'limit':>12}"]
    lines += [
        f"{name:<20}{start:>8.4f} rad{round(end, 4) + 0.0:>8.4f} rad{before:>13.2f} N m{after:>11.2f} N m{limit:>8.0f} N m"
        for name, start, end, before, after, limit in rows
    ]
    carried, mass = float(summary["carried_mass_kg"]), float(summary["payload_kg"])  # type: ignore[arg-type]
    way = (" (rigid IK, largest)", " (largest)") if summary["path"] else ("", "")
    facts = [
        ("carried by the flange", f"{carried:.3f} kg, {mass:g} kg of it at the tip (a UR5 may carry {UR5_PAYLOAD:g} kg)"),
        ("sag of the tip against the rigid arm", f"{1e3 * float(summary['sag_m']):.2f} mm"),  # type: ignore[arg-type]
        (f"tip error before{way[0]}", f"{1e3 * float(summary['tip_error_before_m']):.2f} mm"),  # type: ignore[arg-type]
        (f"tip error after compensation{way[1]}", f"{1e3 * float(summary['tip_error_after_m']):.1e} mm"),  # type: ignore[arg-type]
        ("tip turned before", f"{float(summary['tip_turned_before_rad']):.4f} rad"),  # type: ignore[arg-type]
        ("tip turned after compensation", f"{float(summary['tip_turned_after_rad']):.4f} rad"),  # type: ignore[arg-type]
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
    ]  # type: ignore[call-overload]
    if over:
        lines.append(f"WARNING: {', '.join(over)} cannot hold this load.")
    if carried > UR5_PAYLOAD:
        lines.append("WARNING: the arm and its payload are heavier than what a UR5 may carry.")
    if summary["wrinkling_margin"] is not None and float(summary["wrinkling_margin"]) <= 0.0:  # type: ignore[arg-type]
        lines.append("WARNING: a link wrinkles; linear springs no longer hold there. Raise the pressure or lower the payload.")
    return "\n".join(lines)


def wrinkling(summary: dict[str, object]) -> str:
    """How near the arm comes to wrinkling, for a person."""
    if summary["wrinkling_margin"] is None:
        return "none: it has no inflated link"
    return (
        f"{summary['largest_moment_N_m']:.3g} N m (wrinkles at {summary['wrinkling_moment_N_m']:.3g} N m, "
        f"margin {100 * summary['wrinkling_margin']:.1f} %)"  # type: ignore[operator]
    )


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, a target that cannot be reached with 1."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
