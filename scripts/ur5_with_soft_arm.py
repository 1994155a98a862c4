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
from datetime import datetime
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import finite_array, non_negative_number, positive_integer, positive_number
from softrobots.core.files import make_folder, write_text
from softrobots.description.third_party import UR5, robot_file
from softrobots.view.figures import canvas
from studies.papers import trajectory_pictures
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder
from studies.ur5.soft_arm import PAYLOAD, Load, compensate, follow_line, mounted, soft_arm, within_limits
from studies.ur5.soft_arm_report import summarise, table

POSE = (0.0, -2.1, 1.9, 0.2, math.pi / 2, 0.0)
"""UR5 joints, base to flange [rad]: the flange points forward, level."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument(
        "--robot",
        choices=tuple(PAYLOAD),
        default="inflatable_arm",
        help="the soft arm, with its default parameters, a PCC arm without muscles (%(default)s)",
    )
    help_text = " ".join(f"{angle:.4g}" for angle in POSE)
    result.add_argument(
        "--pose", type=float, nargs=6, metavar="Q", default=POSE, help=f"UR5 joints, base to flange [rad] ({help_text})"
    )
    result.add_argument(
        "--arm-angles", type=float, nargs=3, metavar="A",
        help="motors of the inflatable arm, held there [rad] (0 pi/2 0: straight on from the flange)",
    )  # fmt: skip
    given = ", ".join(f"{name}: {mass:g}" for name, mass in PAYLOAD.items())
    result.add_argument("--payload", type=float, metavar="M", help=f"point mass at the soft tip [kg] ({given})")
    result.add_argument("--pressure", type=float, metavar="P", help="gauge pressure in the soft arm [Pa] (as the robot has it)")
    result.add_argument(
        "--gravity", type=float, nargs=3, metavar="G", default=sr.EARTH_GRAVITY, help="gravity [m/s^2] (0 0 -9.81)"
    )
    result.add_argument(
        "--keep-orientation", action="store_true", help="bring the orientation of the tip back, too (takes all six joints)"
    )
    result.add_argument(
        "--to", type=float, nargs=3, metavar=("X", "Y", "Z"), help="move the loaded tip to this point on a line [m]"
    )
    result.add_argument("--duration", type=float, default=2.0, help="time of the motion [s] (%(default)s)")
    result.add_argument("--steps", type=int, default=40, help="intervals of the motion (%(default)s)")
    result.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder of the results (output/ur5_with_soft_arm_<time>)"
    )
    result.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    result.add_argument("--meshcat", action="store_true", help="serve the scene on loopback until Ctrl-C")
    return result


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
    figure = None if arguments.no_plots else trajectory_pictures.poses(after, shown=2 if arguments.to is None else 6)
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


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, a target that cannot be reached with 1."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
