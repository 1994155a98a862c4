"""Robots in contact: an arm leans on a wall and carries twice the load, a helix grips a rod, a rod snakes between pegs.

Prints a table for each, and writes into a new folder: the last equilibrium (NPZ, without friction), forces along the way and
the loaded shape (PNG), and an animated page with obstacles and forces (HTML).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import non_negative_number, positive_integer, positive_number
from softrobots.core.files import make_folder
from softrobots.core.summary import aligned
from softrobots.view.figures import canvas, picture
from studies.contact import examples, pictures
from studies.contact.force_picture import contact_forces
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder


class Touch(NamedTuple):
    """One of the three."""

    follow: Callable[..., sr.ContactPath]
    """Follows it, given the values of its parameter and the coefficient of friction."""
    end: float
    """The last value of its parameter."""
    parameter: str
    """What the parameter is."""
    table: Callable[[sr.ContactPath], list[str]]
    """Describes the path."""
    eye: tuple[float, float, float]
    """Place of the camera of its page [m]."""
    centre: tuple[float, float, float]
    """Where the camera looks [m]."""


def brace_table(path: sr.ContactPath) -> list[str]:
    """What the arm carries free and on the wall, and its state at the last weight of both."""
    free, leaning = (examples.largest_weight(environment) for environment in (None, examples.WALL))
    weight = float(path.parameters[-1])
    rows: list[tuple[str, ...]] = [("arm", "weight", "tip x, z", "moment of links", "wrinkling moment left", "wall", "stable")]
    for name, load, world in (("free", free, None), ("free", weight, None), ("on the wall", weight, examples.WALL)):
        rows.append(_arm_row(name, load, world))
    rows.append(_arm_row("on the wall", leaning, examples.WALL))
    return [*aligned(rows, right=range(1, 6)), f"on the wall it carries {leaning / free:.2f} times what it carries free"]


def _arm_row(name: str, weight: float, world: sr.Environment | None) -> tuple[str, ...]:
    held = sr.solve_equilibrium(examples.arm(), examples.LEANING, (0.0, 0.0, -weight), environment=world)
    push = f"{held.contacts[0].normal_force:.2f} N" if held.contacts else "-"
    moments = "  ".join(f"{moment:.2f}" for moment in held.link_moments)
    left = "  ".join(f"{round(100.0 * margin) + 0:d} %" for margin in held.link_limits.wrinkling_margins)
    place = f"{held.tip_position[0]:.4f}  {held.tip_position[2]:.4f} m"
    return (name, f"{weight:.2f} N", place, f"{moments} N m", left, push, "yes" if held.stable else "NO")


def grip_table(path: sr.ContactPath) -> list[str]:
    """Contacts, squeeze and what friction holds at some depths of the rod."""
    words = f"holds with friction {pictures.FRICTION:g} along z"
    rows: list[tuple[str, ...]] = [("depth", "contacts", "normal forces", words, "closed", "stable")]
    for row in _some(path):
        state = path.equilibria[row]
        pressed = [contact for contact in state.contacts if contact.strict]
        closed = bool(sr.is_force_closure(pressed, pictures.FRICTION))
        squeeze, held = sum(one.normal_force for one in pressed), pictures.holding(state, (0.0, 0.0, 1.0))
        numbers = (f"{1e3 * path.parameters[row]:.0f} mm", str(len(pressed)), f"{squeeze:.3f} N", f"{held:.3f} N")
        rows.append((*numbers, "yes" if closed else "no", "yes" if state.stable else "NO"))
    return aligned(rows, right=range(4))


def snake_table(path: sr.ContactPath) -> list[str]:
    """Tip and forces of the pegs at some strokes."""
    names = path.equilibria[0].load.environment.names  # type: ignore[union-attr]
    rows: list[tuple[str, ...]] = [("stroke", "tip x, z", *names, "stable")]
    for row in _some(path):
        state = path.equilibria[row]
        forces = [sum(float(np.linalg.norm(one.force)) for one in state.contacts if one.obstacle == name) for name in names]
        tip = f"{1e3 * state.tip_position[0] + 0.0:.1f}  {1e3 * state.tip_position[2]:.1f} mm"
        told = (f"{force:.3f} N" for force in forces)
        rows.append((f"{1e3 * path.parameters[row]:.0f} mm", tip, *told, "yes" if state.stable else "NO"))
    return aligned(rows, right=range(2 + len(names)))


def _events(path: sr.ContactPath) -> str:
    """What happened along a path, in one line."""
    kinds = [event.kind for event in path.events]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds)) or "none"
    jumps = "; ".join(map(str, path.jumps)) or "none"
    return f"changes of contacts: {counts}; jumps: {jumps}; work of friction {path.dissipation[-1]:.3g} J"


def _some(path: sr.ContactPath) -> list[int]:
    """Six rows of a path, evenly spaced, with the first and the last."""
    return np.unique(np.linspace(0, len(path.equilibria) - 1, 6).round().astype(int)).tolist()


TOUCHES = {
    "brace": Touch(examples.brace, 41.0, "weight on the tip [N]", brace_table, (0.75, -1.45, 0.85), (0.52, 0.0, 0.38)),
    "grip": Touch(examples.grip, examples.DEPTH, "depth of the rod [m]", grip_table, (0.27, -0.33, 0.33), (0.0, 0.0, 0.2)),
    "pegs": Touch(examples.snake, examples.STROKE, "way of the pegs [m]", snake_table, (0.13, -0.32, 0.27), (0.0, 0.0, 0.2)),
}
"""What can be shown."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--only", nargs="+", choices=tuple(TOUCHES), default=tuple(TOUCHES), help="what to show (all)")
    result.add_argument("--steps", type=int, default=41, metavar="N", help="equilibria of each path (%(default)s)")
    help_text = "coefficient of friction of all contacts [-]; with it a path takes minutes (%(default)g)"
    result.add_argument("--friction", type=float, default=0.0, metavar="MU", help=help_text)
    result.add_argument("--duration", type=float, default=6.0, metavar="T", help="time of the animations [s] (%(default)g)")
    help_text = "new or empty folder of the results (output/contact_<time>)"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    result.add_argument("--no-plots", action="store_true", help="do without the pictures, which need matplotlib")
    result.add_argument("--meshcat", action="store_true", help="serve the last page on loopback until Ctrl-C")
    return result


def run(arguments: argparse.Namespace) -> Path:
    """Do the whole job and return the folder of the results."""
    steps = positive_integer("--steps", arguments.steps, 10_000)
    if steps < 2:
        raise sr.ParameterError("--steps", steps, "two or more")
    friction = non_negative_number("--friction", arguments.friction)
    duration = positive_number("--duration", arguments.duration, "s")
    if not arguments.no_plots:
        canvas.require_matplotlib()
    folder = free_folder(arguments.output or Path("output") / f"contact_{datetime.now():%Y%m%d_%H%M%S}")
    lines: list[str] = []
    for name in dict.fromkeys(arguments.only):
        touch = TOUCHES[name]
        path = touch.follow(np.linspace(0.0, touch.end, steps), friction)
        make_folder(folder)
        if friction == 0.0:  # files of equilibria hold no friction
            sr.save_result(path.equilibria[-1], folder / f"{name}.npz")
        if not arguments.no_plots:
            for word, figure in _figures(name, path).items():
                canvas.write_png(figure, folder / f"{name}_{word}.png", overwrite=False)
        lines += ["", name, *touch.table(path), *([_events(path)] if friction > 0.0 else [])]
        with sr.Viewer(path.model) as viewer:
            viewer.animate(path, duration=duration)
            viewer.look_from(touch.eye, touch.centre)
            viewer.write_html(folder / f"{name}.html", title=f"{path.model.pinocchio.name}: {name}")
            if name == arguments.only[-1]:
                print("\n".join(lines))
                tell_written(folder)
                if arguments.meshcat:
                    serve(viewer)
    return folder


def _figures(name: str, path: sr.ContactPath) -> dict[str, Any]:
    """The pictures of a path."""
    figures = {
        "forces": contact_forces(path, parameter=TOUCHES[name].parameter),
        "shape": picture.plot(path.equilibria[-1]),
    }
    if name == "brace":
        figures["margins"] = pictures.margins(path.parameters, path)
    if name == "grip":
        figures["pull"] = pictures.grip_forces(path)
    return figures


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
