"""Let robots move: a sagging arm is let go, an arm turns fast with and without shaping, a gust blows on a helix.

Prints a table, and writes into a new folder, for each motion: the result (NPZ), a table (CSV), the tip over time, the energies
and the robot at several times (PNG), and an animated page (HTML).
"""

from __future__ import annotations

import argparse
import sys
from datetime import datetime
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import positive_number
from softrobots.core.files import make_folder
from softrobots.core.summary import aligned
from softrobots.view.figures import canvas, motions
from studies.motion import examples
from studies.shared.command_line import tell_written
from studies.shared.folders import free_folder

MOTIONS = {"release": "the sagging arm is let go", "turn": "the arm turns fast", "gust": "a gust blows on the helix"}
"""What can be shown."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--only", nargs="+", choices=tuple(MOTIONS), default=tuple(MOTIONS), help="motions to simulate (all)")
    result.add_argument("--duration", type=float, metavar="T", help="how long each takes [s] (2; the gust: 1.5)")
    result.add_argument("--speed", type=float, default=0.5, help="of the pages, relative to real time [-] (%(default)s)")
    help_text = "new or empty folder of the results (output/motion_<time>)"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    result.add_argument("--no-plots", action="store_true", help="do without the pictures, which need matplotlib")
    return result


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    positive_number("--speed", arguments.speed)
    lasting = {} if arguments.duration is None else {"duration": positive_number("--duration", arguments.duration, "s")}
    if not arguments.no_plots:
        canvas.require_matplotlib()
    folder = free_folder(arguments.output or Path("output") / f"motion_{datetime.now():%Y%m%d_%H%M%S}")
    found: dict[str, sr.Motion] = {}
    together: dict[str, sr.Motion] = {}
    if "release" in arguments.only:
        found["release"] = examples.release(**lasting)
    if "turn" in arguments.only:
        together = examples.turns(**lasting)
        found |= {f"turn_{name.split()[-1].lower()}": motion for name, motion in together.items()}
    if "gust" in arguments.only:
        found["gust"] = examples.gust(**lasting)
    make_folder(folder)
    for name, motion in found.items():
        _write(folder, name, motion, arguments)
    if together and not arguments.no_plots:
        canvas.write_png(motions.tip_over_time(together), folder / "turn_tip.png", overwrite=False)
    print("\n".join(_table(found)))
    tell_written(folder)
    return folder


def _write(folder: Path, name: str, motion: sr.Motion, arguments: argparse.Namespace) -> None:
    """Write everything of one motion."""
    sr.save_result(motion, folder / f"{name}.npz")
    sr.save_csv(motion, folder / f"{name}.csv")
    with sr.Viewer(motion.model) as viewer:
        viewer.animate(motion, speed=arguments.speed)
        viewer.write_html(folder / f"{name}.html", title=f"{motion.model.pinocchio.name}: {name.replace('_', ' ')}")
    if not arguments.no_plots:
        for what in (motions.tip_over_time, motions.energies, motions.strobe):
            canvas.write_png(what(motion), folder / f"{name}_{what.__name__}.png", overwrite=False)


def _table(found: dict[str, sr.Motion]) -> list[str]:
    """A row for each motion."""
    rows: list[tuple[str, ...]] = [("motion", "time", "steps", "tip error", "way of the tip", "swing at the end", "balance")]
    for name, motion in found.items():
        way = float(np.linalg.norm(np.ptp(motion.tip_position, axis=0)))
        swing = f"{1e3 * examples.swing(motion):.2f} mm" if name.startswith("turn") else "-"
        error = "-" if motion.tip_error is None else f"{1e3 * motion.tip_error:.2g} mm"
        balance = f"{np.abs(motion.energy.balance).max():.1g} J"
        rows.append((name, f"{motion.time[-1]:g} s", str(len(motion.steps) - 1), error, f"{1e3 * way:.0f} mm", swing, balance))
    return aligned(rows, right=range(1, 7))


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
