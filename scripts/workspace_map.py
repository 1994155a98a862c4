"""Map what the loaded tip of the inflatable arm reaches, what it carries, and the pressure that it needs.

Puts the tip at every target of a grid under every load, with the compiled solvers: by default a million cases in the half plane
through the axis of motor 1 (radius by height). Writes the maps as an NPZ file (load it again with softrobots.load_result) and a
picture beside it. With --scheduler the same blocks of targets run on a Dask cluster (extra `cluster`). Finished blocks are kept
beside the NPZ file until it is written: after an interruption --resume goes on from there, and the file is the same.
"""

from __future__ import annotations

import argparse
import sys
import time
from datetime import datetime
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import add_gravity, exit_status, gravity_of
from softrobots.compiled import sweeps
from softrobots.core.checks import finite_number, positive_integer, positive_number
from softrobots.core.files import new_file
from softrobots.view.figures import canvas, workspaces
from studies.shared.command_line import add_resume, blocks_beside

DOCS = Path(__file__).resolve().parent.parent / "docs" / "images" / "workspace_map.png"
CELLS = {"plane": 160, "box": 19}
"""Cells along the reach that make about a million cases with twenty loads."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--grid", choices=tuple(CELLS), default="plane", help="where the targets are (%(default)s)")
    help_text = ", ".join(f"{cells} for a {grid}" for grid, cells in CELLS.items())
    result.add_argument(
        "--cells", type=int, metavar="N", help=f"cells along the reach of the arm, twice as many across it ({help_text})"
    )
    result.add_argument(
        "--loads", type=int, default=20, metavar="N", help="number of loads, from 0 to the largest (%(default)s)"
    )
    result.add_argument("--max-load", type=float, default=40.0, help="largest force on the tip [N] (%(default)s)")
    result.add_argument(
        "--direction", type=float, nargs=3, metavar=("X", "Y", "Z"), default=(0.0, 0.0, -1.0), help="of the force (0 0 -1)"
    )
    add_gravity(result)
    result.add_argument(
        "--link-lengths", type=float, nargs=2, default=(0.6, 0.6), metavar=("L1", "L2"), help="of the links [m] (0.6 0.6)"
    )
    result.add_argument(
        "--stiffness", type=float, default=inflated_beam.MEAN_STIFFNESS, help="of every spring [N m/rad] (%(default)s)"
    )
    result.add_argument("--pressure", type=float, default=50e3, help="gauge pressure in the links [Pa] (%(default)g)")
    result.add_argument(
        "--motor-limit", type=float, default=180.0, help="motors turn this far either way [degrees] (%(default)g)"
    )
    result.add_argument("--shown-load", type=float, metavar="F", help="load of the picture [N] (half of the largest)")
    result.add_argument("--backend", choices=("numba", "python"), help="of the compiled solvers (numba if it is installed)")
    result.add_argument("--threads", type=int, default=1, help="threads of this process (%(default)s)")
    result.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler to do the work, e.g. tcp://127.0.0.1:8786")
    result.add_argument("--output", type=Path, metavar="FILE", help="new NPZ file (output/workspace_map_<time>.npz)")
    add_resume(result)
    result.add_argument("--overwrite", action="store_true", help="replace files that exist")
    result.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    help_text = "write only the picture of the guide, here (docs/images/workspace_map.png), replacing it"
    result.add_argument("--docs", type=Path, nargs="?", const=DOCS, metavar="FILE", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    if arguments.docs is not None and (arguments.output is not None or arguments.no_plots or arguments.resume):
        raise sr.ParameterError("--docs", str(arguments.docs), "given without --output, --resume and --no-plots")
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    largest = positive_number("--max-load", arguments.max_load, "N")
    shown = None if arguments.shown_load is None else finite_number("--shown-load", arguments.shown_load, "N")
    count = positive_integer("--loads", arguments.loads, 10_000)
    robot = sr.InflatableArm(
        link_lengths=arguments.link_lengths, stiffness=arguments.stiffness, pressure=arguments.pressure,
        motor_limit=np.radians(arguments.motor_limit),
    )  # fmt: skip
    model = sr.load_model(robot)
    cells = CELLS[arguments.grid] if arguments.cells is None else arguments.cells
    grid = getattr(sweeps.TargetGrid, arguments.grid)(model.reach, cells)
    output = arguments.output or Path("output") / f"workspace_map_{datetime.now():%Y%m%d_%H%M%S}.npz"
    if output.suffix != ".npz":
        raise sr.ParameterError("--output", str(output), "a file that ends in .npz")
    picture = arguments.docs or output.with_suffix(".png")
    wanted = ([] if arguments.docs else [output]) + ([] if arguments.no_plots else [picture])
    for file in wanted:
        new_file(file, overwrite=arguments.overwrite or arguments.docs is not None)
    began = time.perf_counter()

    def maps_with(blocks: Path | None) -> sweeps.WorkspaceMap:
        return sweeps.map_workspace(
            model, grid, np.linspace(0.0, largest, count), direction=arguments.direction, gravity=gravity_of(arguments),
            backend=arguments.backend, threads=arguments.threads, scheduler=arguments.scheduler, checkpoint=blocks,
            progress="blocks of targets",
        )  # fmt: skip

    if arguments.docs is None:
        with blocks_beside(output, arguments) as blocks:
            maps = maps_with(blocks)
            sr.save_result(maps, output, overwrite=arguments.overwrite)
    else:
        maps = maps_with(None)
    spent = time.perf_counter() - began
    if not arguments.no_plots:
        figure = workspaces.workspace_maps(maps, load=shown)
        canvas.write_png(figure, picture, overwrite=arguments.overwrite or arguments.docs is not None)
    print(summary(maps, spent))
    print(f"\nwritten: {', '.join(map(str, wanted))}")


def summary(maps: sweeps.WorkspaceMap, spent: float) -> str:
    """What was found, as a table."""
    levels = np.unique(np.linspace(0, len(maps.loads) - 1, 5).astype(int))
    sound = maps.reached & ~maps.wrinkled
    lines = ["", f"{'load [N]':>10}{'targets reached':>18}{'no link wrinkles':>18}{'largest pressure needed [kPa]':>32}"]
    for level in levels:
        reached = maps.reached[..., level]
        needed = maps.required_pressure[..., level][reached]
        most = f"{needed.max() / 1e3:.2f}" if len(needed) else "-"
        lines.append(f"{maps.loads[level]:>10.4g}{int(reached.sum()):>18}{int(sound[..., level].sum()):>18}{most:>32}")
    rate = f"{maps.reached.size} cases ({maps.payload.size} targets, {len(maps.loads)} loads) in {spent:.1f} s"
    return "\n".join([*lines, "", rate])


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
