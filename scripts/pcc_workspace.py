"""Sample what the tip of the arm of pneumatic muscles can reach within the limits of its muscles.

Draws random muscle lengths, brings the arm to equilibrium under the load at each, and writes the reached tip positions with
their manipulability as a picture and an NPZ file (load it again with softrobots.load_result) into a new folder. Until then
finished samples are kept beside it: after an interruption --resume goes on from there, and the file is the same.
"""

from __future__ import annotations

import argparse
import sys
from datetime import datetime
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import add_load, exit_status, gravity_of, refuse_too_large
from softrobots.core.files import make_folder
from softrobots.view.figures import canvas, workspaces
from studies.shared.command_line import add_resume, blocks_beside, tell_written
from studies.shared.folders import free_folder


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--samples", type=int, default=5000, help="muscle lengths to draw (%(default)s)")
    result.add_argument("--seed", type=int, default=0, help="seed of the samples (%(default)s)")
    add_load(result)
    result.add_argument("--segments", type=int, default=2, help="number of segments (%(default)s)")
    result.add_argument("--length", type=float, default=0.524, help="rest length of a segment [m] (%(default)s)")
    result.add_argument(
        "--distance", type=float, default=0.04, help="distance of the muscles from the backbone [m] (%(default)s)"
    )
    result.add_argument("--contraction", type=float, default=0.15, help="largest contraction of a muscle [-] (%(default)s)")
    result.add_argument("--extension", type=float, default=0.15, help="largest extension of a muscle [-] (%(default)s)")
    result.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder for the results (output/pcc_workspace_<time>)"
    )
    add_resume(result)
    result.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    return result


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    gravity = gravity_of(arguments)
    if arguments.segments < 1:
        raise sr.ParameterError("--segments", arguments.segments, "at least 1")
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    robot = sr.PccArm(
        segment_lengths=(arguments.length,) * arguments.segments, muscle_distance=arguments.distance,
        muscle_contraction=arguments.contraction, muscle_extension=arguments.extension,
    )  # fmt: skip
    refuse_too_large(robot, "--segments", arguments.segments)
    model = sr.load_model(robot)
    folder = free_folder(arguments.output or Path("output") / f"pcc_workspace_{datetime.now():%Y%m%d_%H%M%S}")
    with blocks_beside(folder, arguments) as blocks:
        reach = sr.sample_workspace(
            model, arguments.samples, force=arguments.force, gravity=gravity, seed=arguments.seed, checkpoint=blocks,
            progress="muscle lengths",
        )  # fmt: skip
        make_folder(folder)
        sr.save_result(reach, folder / "workspace.npz")
    if not arguments.no_plots:
        canvas.write_png(workspaces.workspace(reach), folder / "workspace.png", overwrite=False)
    tips, radius = reach.tip_positions, np.linalg.norm(reach.tip_positions[:, :2], axis=1)
    rows = [
        ("samples reached", f"{len(tips)}"),
        ("samples left out (no such shape, or not stable)", f"{reach.refused}"),
        ("height of the tip [m]", f"{tips[:, 2].min():.4f} ... {tips[:, 2].max():.4f}"),
        ("distance of the tip from the z axis, at most [m]", f"{radius.max():.4f}"),
        ("manipulability [m^3/rad^3]", f"{reach.manipulability.min():.3g} ... {reach.manipulability.max():.3g}"),
    ]
    width = max(len(name) for name, _ in rows)
    print("\n".join(["", *(f"{name:<{width}}  {value:>18}" for name, value in rows)]))
    tell_written(folder)
    return folder


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
