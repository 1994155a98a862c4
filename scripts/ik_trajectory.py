"""Move the loaded tip of the inflatable arm along a path, with its sag compensated.

Solves the elastostatic inverse kinematics at every waypoint, compares it with rigid inverse kinematics and with the method
of the paper (Troise et al. 2021, doi:10.3390/app11062558), prints a table, and writes plots, results (NPZ, CSV) and a
self-contained HTML scene into a new folder. The start and end of the paper's own example are not published; the default path
is ours, chosen so that the largest moment at link 1 is within 10 % of the paper's 17.51 N m. With --wrist the arm carries a
wrist, and the hand turns along the path: position and orientation are compensated, and compared with equilibria solved anew.
"""

from __future__ import annotations

import argparse
import json
import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pinocchio as pin

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import add_load, exit_status, gravity_of
from softrobots.core.checks import positive_number
from softrobots.core.files import make_folder, write_text
from softrobots.statics.loads import Load
from softrobots.statics.trajectory import METHODS
from softrobots.view.figures import canvas
from studies.papers import trajectory_pictures
from studies.papers.arm_path import DURATION, END, FORCE, GAIN, START, STEPS
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder

LINE = {"start": START, "end": END, "duration": DURATION, "steps": STEPS}
"""The default path."""

WRIST = (0.08, 0.12)
"""Lengths of the wrist that --wrist gives the arm without numbers [m]."""

TURN = {"start_rpy": (0.0, 0.3, -0.9), "end_rpy": (0.6, 1.1, 0.3)}
"""Roll, pitch and yaw of the hand at both ends of its default path [rad]; ours."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    numbers = {"type": float, "nargs": 3}
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--start", **numbers, metavar=("X", "Y", "Z"), help=f"first tip position [m] ({_words(START)})")
    result.add_argument("--end", **numbers, metavar=("X", "Y", "Z"), help=f"last tip position [m] ({_words(END)})")
    result.add_argument("--duration", type=float, help=f"time from start to end, quintic time law [s] ({DURATION})")
    result.add_argument("--steps", type=int, help=f"intervals between start and end ({STEPS})")
    help_text = f"the arm has a wrist: lengths to its centre and from there to the tip [m] ({_words(WRIST)}, if none are given)"
    result.add_argument("--wrist", type=float, nargs="*", metavar="L", help=help_text)
    for end, name in (("first", "start_rpy"), ("last", "end_rpy")):
        help_text = f"{end} roll, pitch and yaw of the hand, with --wrist [rad] ({_words(TURN[name])})"
        result.add_argument(f"--{name.replace('_', '-')}", **numbers, metavar=("R", "P", "Y"), help=help_text)
    help_text = "waypoints with columns t,x,y,z [s, m], with --wrist also roll,pitch,yaw [rad], instead of start and end"
    result.add_argument("--csv", type=Path, metavar="FILE", help=help_text)
    add_load(result, FORCE)
    result.add_argument(
        "--stiffness", type=float, default=inflated_beam.MEAN_STIFFNESS, help="of every spring [N m/rad] (%(default)s)"
    )
    result.add_argument("--pressure", type=float, default=50e3, help="gauge pressure in the links [Pa] (%(default)s)")
    result.add_argument("--elbow", choices=("up", "down"), default="up", help="side of the elbow at the start (%(default)s)")
    result.add_argument("--method", choices=METHODS, default="newton", help="how the path is followed (%(default)s)")
    result.add_argument("--gain", type=float, default=GAIN, help="gain of the paper's method [1/s] (%(default)s)")
    result.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder for the results (output/ik_trajectory_<time>)"
    )
    result.add_argument("--no-plots", action="store_true", help="do without the plots, which need matplotlib")
    result.add_argument("--meshcat", action="store_true", help="serve the animation on loopback until Ctrl-C")
    return result


def _words(point: tuple[float, ...]) -> str:
    """A point as it is typed."""
    return " ".join(str(number) for number in point)


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    gravity = gravity_of(arguments)
    path = _path(arguments)
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    wrist = None if arguments.wrist is None else tuple(arguments.wrist) or WRIST
    pressure = positive_number("--pressure", arguments.pressure, "Pa")  # without it there is no wrinkling margin
    model = sr.load_model(sr.InflatableArm(stiffness=arguments.stiffness, pressure=pressure, wrist=wrist))
    Load.of(model, arguments.force, gravity=gravity)
    folder = free_folder(arguments.output or Path("output") / f"ik_trajectory_{datetime.now():%Y%m%d_%H%M%S}")

    def follow(label: str, method: str, force: object, weight: object) -> sr.Trajectory:
        return sr.follow_trajectory(
            model, path.targets, force, gravity=weight, elbow=arguments.elbow, method=method, times=path.times,
            gain=arguments.gain, progress=label,
        )  # fmt: skip

    trajectory = follow(f"compensated ({arguments.method})", arguments.method, arguments.force, gravity)
    rigid = follow("rigid arm", "newton", None, None)  # without load the flexible arm is the rigid one
    sagging = [sr.solve_equilibrium(model, q, arguments.force, gravity=gravity) for q in rigid.q_motors]
    uncompensated = sr.Trajectory(path.times, path.positions, tuple(sagging), "rigid", path.orientations)
    paper: sr.Trajectory | None = None
    if path.orientations is None:  # the paper's method follows positions
        paper = trajectory if arguments.method == "paper" else _paper(follow, arguments, gravity)
    results = {"trajectory": trajectory, "rigid": rigid, "uncompensated": uncompensated}
    if paper is not None:
        results["paper"] = paper
    summary = summarise(trajectory, uncompensated, paper, arguments.gain)
    if path.orientations is not None:
        summary |= _turns(trajectory, uncompensated, arguments.force, gravity)
    figures = {} if arguments.no_plots else _figures(trajectory, rigid, uncompensated, paper)

    with sr.view(model, trajectory) as viewer:
        make_folder(folder)
        for name, result in results.items():
            sr.save_result(result, folder / f"{name}.npz")
        sr.save_csv(trajectory, folder / "trajectory.csv")
        write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n", overwrite=False)
        for name, figure in figures.items():
            canvas.write_png(figure, folder / f"{name}.png", overwrite=False)
        compensated = "sag compensated" if path.orientations is None else "sag and tilt compensated"
        viewer.write_html(folder / "scene.html", title=f"Inflatable arm, loaded, {compensated}")
        print(table(summary, trajectory.method))
        tell_written(folder)
        if arguments.meshcat:
            serve(viewer)
    return folder


def _path(arguments: argparse.Namespace) -> sr.Path3D:
    """Waypoints from a file, or a straight line; not both."""
    line = {name: getattr(arguments, name) for name in (*LINE, *TURN) if getattr(arguments, name) is not None}
    turned = next((name for name in TURN if name in line), None)
    if turned is not None and arguments.wrist is None:
        raise sr.ParameterError(f"--{turned.replace('_', '-')}", line[turned], "given with --wrist")
    if arguments.csv is None:
        whole = LINE | TURN | line
        ends = [(whole[name], whole.pop(f"{name}_rpy")) for name in ("start", "end")]
        if arguments.wrist is not None:
            poses = [pin.SE3(pin.rpy.rpyToMatrix(*angles), np.array(position)) for position, angles in ends]
            whole |= dict(zip(("start", "end"), poses, strict=True))
        return sr.straight_line(**whole)
    if line:
        raise sr.ParameterError(
            "--csv",
            str(arguments.csv),
            f"given without --{', --'.join(line).replace('_', '-')}, which describe a straight line",
        )
    return sr.read_waypoints(arguments.csv)


def _paper(follow: object, arguments: argparse.Namespace, gravity: object) -> sr.Trajectory | None:
    """The paper's method on the same path; None where its fixed point does not converge."""
    try:
        return follow("the paper's method", "paper", arguments.force, gravity)  # type: ignore[operator,no-any-return]
    except sr.EquilibriumNotFound as error:
        print(f"the paper's method fails: {error}", file=sys.stderr)
        return None


def _turns(trajectory: sr.Trajectory, uncompensated: sr.Trajectory, force: object, gravity: object) -> dict[str, object]:
    """Errors of the orientation, and those of both against equilibria solved anew from rest."""
    away, angle = [], []
    for motors, position, rotation in zip(trajectory.q_motors, trajectory.targets, trajectory.orientations, strict=True):
        pose = sr.solve_equilibrium(trajectory.model, motors, force, gravity=gravity).transform_tip_to_world
        away.append(float(np.linalg.norm(pose.translation - position)))
        angle.append(float(np.linalg.norm(pin.log3(pose.rotation.T @ rotation))))
    return {
        "orientation_error_compensated_rad": float(trajectory.orientation_error.max()),
        "orientation_error_uncompensated_rad": float(uncompensated.orientation_error.max()),
        "verified_tip_error_m": max(away),
        "verified_orientation_error_rad": max(angle),
    }


def summarise(
    trajectory: sr.Trajectory, uncompensated: sr.Trajectory, paper: sr.Trajectory | None, gain: float
) -> dict[str, object]:
    """Collect the numbers of the table."""
    moments = [float(moment) for moment in trajectory.link_moments.max(axis=0)]
    radius = trajectory.model.spring_groups[0].radius
    return {
        "waypoints": len(trajectory.times),
        "tip_error_compensated_m": float(trajectory.tip_error.max()),
        "tip_error_uncompensated_m": float(uncompensated.tip_error.max()),
        "tip_error_paper_m": None if paper is None else float(paper.tip_error.max()),
        "paper_gain_1_s": gain,
        "largest_moment_N_m": moments,
        "wrinkling_margin": trajectory.least_margin("wrinkling_margins"),
        "pressure_Pa": trajectory.model.spring_groups[0].pressure,
        "required_pressure_Pa": trajectory.required_pressure,
        "required_tabulated_pressure_Pa": inflated_beam.required_tabulated_pressure(max(moments), radius),
        "all_stable": all(equilibrium.stable for equilibrium in trajectory.equilibria),
        "within_limits": all(equilibrium.within_limits for equilibrium in trajectory.equilibria),
    }


def table(summary: dict[str, object], method: str) -> str:
    """Format the numbers for a person."""

    def distance(value: object) -> str:
        return "failed" if value is None else f"{1e3 * float(value):.4g} mm"  # type: ignore[arg-type]

    gain, tabulated = summary["paper_gain_1_s"], summary["required_tabulated_pressure_Pa"]
    compared = [(f"largest tip error, the paper's method (gain {gain:g} 1/s)", distance(summary["tip_error_paper_m"]))]
    if "orientation_error_compensated_rad" in summary:  # the paper's method follows positions
        compared = [
            ("largest angle, compensated", f"{summary['orientation_error_compensated_rad']:.3g} rad"),
            ("largest angle, rigid IK on the flexible arm", f"{summary['orientation_error_uncompensated_rad']:.3g} rad"),
            ("largest tip error, equilibria solved anew", distance(summary["verified_tip_error_m"])),
            ("largest angle, equilibria solved anew", f"{summary['verified_orientation_error_rad']:.3g} rad"),
        ]
    rows = [
        (f"largest tip error, compensated ({method})", distance(summary["tip_error_compensated_m"])),
        ("largest tip error, rigid IK on the flexible arm", distance(summary["tip_error_uncompensated_m"])),
        *compared,
        *((f"largest moment at link {i + 1}", f"{m:.2f} N m") for i, m in enumerate(summary["largest_moment_N_m"])),  # type: ignore[arg-type]
        (f"wrinkling margin at {summary['pressure_Pa'] / 1e3:g} kPa", f"{100 * summary['wrinkling_margin']:.1f} %"),  # type: ignore[operator]
        ("smallest pressure without wrinkles, exact", f"{summary['required_pressure_Pa'] / 1e3:.2f} kPa"),  # type: ignore[operator]
        ("smallest pressure of the paper's Table 3", "above the table" if tabulated is None else f"{tabulated / 1e3:g} kPa"),  # type: ignore[operator]
        ("every equilibrium certified stable", "yes" if summary["all_stable"] else "NO"),
        ("motors and springs within limits", "yes" if summary["within_limits"] else "NO"),
    ]
    width = max(len(name) for name, _ in rows)
    lines = [f"{name:<{width}}  {value:>16}" for name, value in rows]
    if float(summary["wrinkling_margin"]) <= 0.0:  # type: ignore[arg-type]
        lines.append("WARNING: a link wrinkles; linear springs no longer hold there. Raise the pressure or lower the force.")
    return "\n".join(["", *lines])


def _figures(
    trajectory: sr.Trajectory, rigid: sr.Trajectory, uncompensated: sr.Trajectory, paper: sr.Trajectory | None
) -> dict[str, object]:
    errors = {
        f"compensated ({trajectory.method})": trajectory.tip_error,
        "rigid IK on the flexible arm": uncompensated.tip_error,
    }
    if paper is not None and paper is not trajectory:
        errors["the paper's method"] = paper.tip_error
    turns = {}
    if trajectory.orientation_error is not None and uncompensated.orientation_error is not None:
        angles = dict(zip(errors, (trajectory.orientation_error, uncompensated.orientation_error), strict=True))
        turns["orientation_errors"] = trajectory_pictures.tip_errors(angles, trajectory.times, angles=True)
    return turns | {
        "poses": trajectory_pictures.poses(trajectory),
        "motor_angles": trajectory_pictures.motor_angles(trajectory, rigid),
        "tip_errors": trajectory_pictures.tip_errors(errors, trajectory.times),
        "link_moments": trajectory_pictures.link_moments(trajectory),
    }


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, a path that cannot be followed with 1."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
