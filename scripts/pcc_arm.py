"""Bend the arm of pneumatic muscles: muscle lengths or tip targets in; pose, table and pictures out.

Given muscle lengths, solves for the shape under load. Given a target (or a CSV file of waypoints), solves for the muscle
lengths that put the loaded tip there. Prints a table, and writes results (NPZ, CSV for waypoints), a picture of the shape and a
self-contained HTML scene with the smooth tube, the muscles and the equivalent chain into a new folder.
"""

from __future__ import annotations

import argparse
import json
import sys
from datetime import datetime
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import add_load, exit_status, gravity_of, refuse_too_large
from softrobots.core.files import make_folder, write_text
from softrobots.robots.continuum_arm import CHAINS
from softrobots.statics.loads import Load
from softrobots.view.figures import canvas, picture
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder

LENGTHS = (0.50, 0.53, 0.55, 0.54, 0.51, 0.52)
"""The default muscle lengths [m]."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = result.add_mutually_exclusive_group()
    what.add_argument(
        "--lengths", type=float, nargs="+", metavar="L", help="muscle lengths, base to tip [m] (0.50 0.53 0.55 0.54 0.51 0.52)"
    )
    what.add_argument("--target", type=float, nargs=3, metavar=("X", "Y", "Z"), help="position of the loaded tip [m]")
    what.add_argument("--csv", type=Path, metavar="FILE", help="waypoints of the loaded tip, columns t,x,y,z [s, m]")
    result.add_argument(
        "--direction", type=float, nargs=3, metavar=("X", "Y", "Z"), help="direction in which the tip points at --target"
    )
    add_load(result)
    result.add_argument("--segments", type=int, default=2, help="number of segments (%(default)s)")
    result.add_argument("--length", type=float, default=0.524, help="rest length of a segment [m] (%(default)s)")
    result.add_argument(
        "--distance",
        type=float,
        default=0.04,
        help="of the muscles from the backbone; the body is drawn 1.25 times as wide [m] (%(default)s)",
    )
    result.add_argument("--chain", choices=CHAINS, default="sections", help="form of the equivalent rigid chain (%(default)s)")
    result.add_argument("--elastic-sections", type=int, metavar="N", help="sections a segment, for --chain sections (4)")
    result.add_argument("--hinges", type=int, metavar="N", help="hinges a segment, for --chain lumped (12)")
    result.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder of the results (output/pcc_arm_<time>)"
    )
    result.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    result.add_argument("--meshcat", action="store_true", help="serve the scene on loopback until Ctrl-C")
    return result


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    gravity = gravity_of(arguments)
    if arguments.segments < 1:
        raise sr.ParameterError("--segments", arguments.segments, "at least 1")
    if arguments.direction is not None and arguments.target is None:
        raise sr.ParameterError("--direction", arguments.direction, "given with --target")
    waypoints = None if arguments.csv is None else sr.read_waypoints(arguments.csv)
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    model = sr.load_model(_robot(arguments))
    Load.of(model, arguments.force, gravity=gravity)
    folder = free_folder(arguments.output or Path("output") / f"pcc_arm_{datetime.now():%Y%m%d_%H%M%S}")
    results: dict[str, object] = {}
    if waypoints is not None:
        shown = results["trajectory"] = sr.follow_trajectory(
            model, waypoints.positions, arguments.force, gravity=gravity, times=waypoints.times, progress="waypoints"
        )
        last = shown.equilibria[-1]
    elif arguments.target is not None:
        solution = results["ik_solution"] = sr.solve_ik(
            model, arguments.target, arguments.force, gravity=gravity, orientation=arguments.direction
        )
        shown = last = solution.equilibrium
    else:
        lengths = arguments.lengths or (LENGTHS if arguments.segments == 2 else model.relaxed_motors)
        shown = last = sr.solve_equilibrium(model, lengths, arguments.force, gravity=gravity)
    results["equilibrium"] = last
    summary = summarise(last)
    figure = None if arguments.no_plots else picture.plot(last)
    with sr.view(model, shown) as viewer:
        make_folder(folder)
        for name, result in results.items():
            sr.save_result(result, folder / f"{name}.npz")
        if waypoints is not None:
            sr.save_csv(shown, folder / "trajectory.csv")
        write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n", overwrite=False)
        if figure is not None:
            canvas.write_png(figure, folder / "shape.png", overwrite=False)
        viewer.write_html(folder / "scene.html", title="PCC arm")
        print(table(summary))
        if waypoints is not None:
            print(f"largest tip error on the way: {shown.tip_error.max():.3g} m at {len(shown.times)} waypoints")
        tell_written(folder)
        if arguments.meshcat:
            serve(viewer)
    return folder


def _robot(arguments: argparse.Namespace) -> sr.PccArm:
    """The robot, refused before it is made if it is too large to be solved."""
    wrong = "hinges" if arguments.chain == "sections" else "elastic_sections"
    if getattr(arguments, wrong) is not None:
        raise sr.ParameterError(
            f"--{wrong.replace('_', '-')}", getattr(arguments, wrong), f"left out with --chain {arguments.chain}"
        )
    count = {name: getattr(arguments, name) for name in ("hinges", "elastic_sections") if getattr(arguments, name) is not None}
    robot = sr.PccArm(
        segment_lengths=(arguments.length,) * arguments.segments, muscle_distance=arguments.distance,
        radius=1.25 * arguments.distance if arguments.distance > 0.0 else 0.05, chain=arguments.chain, **count,
    )  # fmt: skip
    refuse_too_large(robot, "--segments", arguments.segments)
    return robot


def summarise(equilibrium: sr.Equilibrium) -> dict[str, object]:
    """Collect the numbers of the table: muscles, the arcs that their lengths stand for, and the tip with and without load."""
    model = equilibrium.model
    lengths = equilibrium.muscle_lengths.reshape(model.structure.section_table[-1].segment, -1)
    azimuths = [muscle.azimuth for muscle in model.muscles[: lengths.shape[1]]]
    arcs = sr.constant_curvature.arc_from_muscles(lengths, model.muscles[0].distance, azimuths)
    section_table = model.structure.section_table
    rows = list(
        zip(section_table, model.structure.section_coordinates(equilibrium.q_motors, equilibrium.q_springs), strict=True)
    )
    unloaded = sr.constant_curvature.chain_transform(arcs)[:3, 3]
    twist = [float(sum(z[2] for row, z in rows if row.segment == segment + 1)) for segment in range(len(lengths))]
    return {
        "muscles": [muscle.name for muscle in model.muscles],
        "muscle_lengths_m": equilibrium.muscle_lengths.tolist(),
        "muscle_forces_N": equilibrium.muscle_forces.tolist(),
        "arc_length_m": arcs.length.tolist(),
        "arc_bending_deg": np.degrees(arcs.bending).tolist(),
        "arc_azimuth_deg": np.degrees(arcs.azimuth).tolist(),
        "twist_under_load_deg": np.degrees(twist).tolist(),
        "tip_m": equilibrium.tip_position.tolist(),
        "tip_direction": np.array(equilibrium.transform_tip_to_world.rotation)[:, 2].tolist(),
        "tip_without_load_m": unloaded.tolist(),
        "residual_N_m": equilibrium.residual,
        "stable": equilibrium.stable,
        "within_limits": equilibrium.within_limits,
    }


def table(summary: dict[str, object]) -> str:
    """Format the numbers for a person."""

    def vector(name: str, digits: int) -> str:
        return "  ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in summary[name])  # type: ignore[attr-defined]

    lines = ["", f"{'muscle':<14}{'length [m]':>12}{'tension [N]':>13}"]
    rows = zip(summary["muscles"], summary["muscle_lengths_m"], summary["muscle_forces_N"], strict=True)  # type: ignore[call-overload]
    lines += [f"{name:<14}{length:>12.6f}{force:>13.3f}" for name, length, force in rows]
    lines += ["", "arcs that these muscle lengths stand for, and the twist that the load adds:"]
    lines += [f"{'segment':<10}{'length [m]':>12}{'bending [deg]':>15}{'azimuth [deg]':>15}{'twist [deg]':>13}"]
    names = ("arc_length_m", "arc_bending_deg", "arc_azimuth_deg", "twist_under_load_deg")
    arcs = zip(*(summary[name] for name in names), strict=True)  # type: ignore[call-overload]
    lines += [
        f"{i:<10}{length:>12.6f}{bend:>15.3f}{azimuth:>15.3f}{round(turn, 3) + 0.0:>13.3f}"
        for i, (length, bend, azimuth, turn) in enumerate(arcs, start=1)
    ]
    lines += [
        "",
        f"tip [m]                 {vector('tip_m', 6)}",
        f"tip without load [m]    {vector('tip_without_load_m', 6)}   (of those arcs, in closed form)",
        f"tip points along        {vector('tip_direction', 4)}",
        f"certified stable        {'yes' if summary['stable'] else 'NO'}   (residual {summary['residual_N_m']:.1e} N m)",
        f"within limits           {'yes' if summary['within_limits'] else 'NO'}   (muscle lengths and tensions, joints)",
    ]
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2, a target that cannot be reached with 1."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
