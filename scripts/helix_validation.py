"""Validate the geometry of the helical tube: every section boundary of its chains against the analytic helix.

Three sets of tubes, each as sections of constant strain and as lumped hinges: the committed URDF files, a grid of actuators
(the paper's angles and contractions, two diameters, both hands, one and four turns), and random actuators. Each is written as
URDF, read by Pinocchio, and put at zero. The frames at the ends of the sections (lumped: at the hinges) and at the tip are
compared with the closed form of softrobots.helix, in position and orientation.

Prints a Markdown table, and writes it as JSON, every tube as a line of a CSV file, and a picture into a new folder; about two
minutes. Ends with status 1 if an error exceeds the tolerance.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots import helix
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import csv_text, free_folder, make_folder, write_text
from softrobots.description.paths import urdf_folder
from softrobots.robots import HelixTube
from softrobots.statics.kinematics import frame_placement
from softrobots.view.body import body_at
from softrobots.view.figures import canvas

ANGLES = (2.5, 5.0, 10.0)
CONTRACTIONS = (0.5, 0.6, 0.7, 0.8, 0.9)
DIAMETERS = (0.0331, 0.08275)
TURNS = (1.0, 4.0)
SECTIONS_A_TURN = 3
"""Sections or hinges a turn in the grid; for a turn by 120 degrees a section is long."""
FORMS = {
    "sections": {"chain": "sections"},
    "lumped": {"chain": "lumped"},
    "lumped, midpoint": {"chain": "lumped", "hinge_rule": "midpoint"},
}
"""Forms of the chain."""
FILES = ("helix_tube", "helix_tube_lumped")
"""The committed URDF files."""
NAMES = ("helix_validation.json", "helix_validation.csv", "helix_validation.png")
DOCS = Path(__file__).resolve().parent.parent / "docs" / "images"


class Case(NamedTuple):
    """A tube to validate."""

    group: str
    """The set that it is part of."""
    form: str
    """Key of `FORMS`."""
    tube: HelixTube
    """Its parameters."""
    file: Path | None = None
    """Its URDF; None: written afresh."""


class Row(NamedTuple):
    """Errors of a tube."""

    case: Case
    """The tube."""
    boundaries: int
    """Frames compared."""
    distance: float
    """Largest distance from the helix [m]."""
    angle: float
    """Largest angle between frames [rad]."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--cases", type=int, default=20, help="random actuators, each in every form of the chain (%(default)s)")
    made.add_argument("--seed", type=int, default=2026, help="seed of the random actuators (%(default)s)")
    made.add_argument("--no-grid", action="store_true", help="leave out the grid of 120 actuators")
    told = "largest error that passes, in metres and in radians (%(default)g)"
    made.add_argument("--tolerance", type=float, default=1e-12, help=told)
    told = "new or empty folder of the results (output/helix_validation_<time>)"
    made.add_argument("--output", type=Path, metavar="FOLDER", help=told)
    told = "write the picture into this folder (docs/images) too, replacing it"
    made.add_argument("--docs", type=Path, nargs="?", const=DOCS, metavar="FOLDER", help=told)
    made.add_argument("--no-plots", action="store_true", help="do without the picture, which needs matplotlib")
    return made


def committed() -> Iterator[Case]:
    """The tubes of the committed files."""
    for name, form in zip(FILES, ("sections", "lumped"), strict=True):
        tube = sr.ROBOTS[name]()
        if isinstance(tube, HelixTube):
            yield Case("committed file", form, tube, urdf_folder() / f"{name}.urdf")


def grid() -> Iterator[Case]:
    """The tubes of the grid; which end stands upright alternates."""
    actuators = itertools.product(ANGLES, CONTRACTIONS, DIAMETERS, helix.HANDEDNESS, TURNS)
    for number, (degrees, contraction, diameter, handedness, turns) in enumerate(actuators):
        angle = math.radians(degrees)
        length = float(helix.length_for_turns(helix.forward(contraction, angle, diameter), angle, turns))
        count = math.ceil(SECTIONS_A_TURN * turns)
        for form in ("sections", "lumped"):
            tube = HelixTube(
                length=length, diameter=diameter, contraction=contraction, angle=angle, handedness=handedness,
                upright=("tube", "axis")[number % 2], elastic_sections=count, hinges=count, **FORMS[form],
            )  # fmt: skip
            yield Case("grid", form, tube)


def drawn(cases: int, seed: int) -> Iterator[Case]:
    """Random tubes, self-contact or not, in every form: angle up to 60 degrees, contraction from 0.2, up to 4 turns."""
    rng = np.random.default_rng(seed)
    for _ in range(cases):
        angle, contraction = math.radians(rng.uniform(0.5, 60.0)), float(rng.uniform(0.2, 0.999))
        diameter, turns = float(10.0 ** rng.uniform(-2.0, -0.5)), float(rng.uniform(0.1, 4.0))
        length = float(helix.length_for_turns(helix.forward(contraction, angle, diameter), angle, turns))
        handedness, upright = (str(rng.choice(options)) for options in (helix.HANDEDNESS, ("tube", "axis")))
        count = math.ceil(SECTIONS_A_TURN * turns) + int(rng.integers(6))
        for form, fields in FORMS.items():
            tube = HelixTube(
                length=length, diameter=diameter, contraction=contraction, angle=angle, handedness=handedness, upright=upright,
                wall_thickness=0.01 * diameter, actuator_density=0.1 / length, allow_self_contact=True,
                elastic_sections=count, hinges=count, **fields,
            )  # fmt: skip
            yield Case("random", form, tube)


def boundaries(tube: HelixTube) -> dict[str, float]:
    """Lengths along the centre line at which the frames of the chain stand, by frame [m]."""
    count, whole = tube.n_sections, tube.centre_length
    if tube.chain == "sections":
        shares = np.arange(1.0, count + 1.0)
    else:  # in the middle of the sections, the outer ones 1/24 of a section nearer to the ends if corrected
        shares = np.arange(count) + 0.5
        if tube.hinge_rule == "corrected" and count > 1:
            shares[[0, -1]] += np.array([-1.0, 1.0]) / 24.0
    made = {f"section_1_{number}": float(share) * whole / count for number, share in enumerate(shares, start=1)}
    return made | {"segment_1": whole, "tip": whole}


def analytic(tube: HelixTube, lengths: Any) -> Any:
    """Frames of the helix at lengths along the centre line, in world axes, shape (n, 4, 4)."""
    shape = tube.shape
    if shape is None:
        raise sr.StraightTube("a straight tube has no helix")
    frames = helix.frames(shape, helix.turn_angle(shape, lengths), "centre", tube.handedness)
    if tube.upright == "axis":
        return frames
    return np.linalg.inv(helix.transform_base_to_axis(shape, tube.handedness)) @ frames


def chain_frames(model: sr.SoftModel, names: Any) -> Any:
    """Frames of the chain at zero, shape (n, 4, 4)."""
    q = np.zeros(model.pinocchio.nq)
    return np.array([frame_placement(model, q, name).homogeneous for name in names])


def measure(case: Case) -> Row:
    """Compare a tube with its helix."""
    places = boundaries(case.tube)
    found = chain_frames(sr.load_model(case.tube if case.file is None else case.file), places)
    exact = analytic(case.tube, np.array(list(places.values())))
    apart = np.linalg.norm(found[:, :3, 3] - exact[:, :3, 3], axis=1)
    turn = np.swapaxes(found[:, :3, :3], 1, 2) @ exact[:, :3, :3] - np.eye(3)
    askew = np.linalg.norm(turn, axis=(1, 2)) / math.sqrt(2.0)  # of a small angle
    return Row(case, len(places), float(apart.max()), float(askew.max()))


def summary(rows: list[Row]) -> list[dict[str, Any]]:
    """Largest errors by set and form."""
    made = []
    for group, form in dict.fromkeys((row.case.group, row.case.form) for row in rows):
        chosen = [row for row in rows if (row.case.group, row.case.form) == (group, form)]
        made.append(
            {
                "set": group,
                "chain": form,
                "tubes": len(chosen),
                "boundaries": sum(row.boundaries for row in chosen),
                "largest_distance_m": max(row.distance for row in chosen),
                "largest_angle_rad": max(row.angle for row in chosen),
            }
        )
    return made


def table(lines: list[dict[str, Any]]) -> str:
    """Format the largest errors as Markdown."""
    made = [
        "| set | chain | tubes | boundaries | largest distance [m] | largest angle [rad] |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for line in lines:
        distance, angle = f"{line['largest_distance_m']:.1e}", f"{line['largest_angle_rad']:.1e}"
        made.append(f"| {line['set']} | {line['chain']} | {line['tubes']} | {line['boundaries']} | {distance} | {angle} |")
    return "\n".join(made)


def csv_of(rows: list[Row]) -> str:
    """Every tube as a line."""
    names = ["set", "chain", "handedness", "upright", "contraction", "angle_deg", "diameter_m", "length_m", "turns", "sections"]
    lines = []
    for row in rows:
        tube = row.case.tube
        described = [row.case.group, row.case.form, tube.handedness, tube.upright, tube.contraction]
        sizes = [math.degrees(tube.angle), tube.diameter, tube.length, tube.turns, tube.n_sections]
        lines.append([*described, *sizes, row.boundaries, row.distance, row.angle])
    return csv_text([*names, "boundaries", "largest_distance_m", "largest_angle_rad"], lines)


def figure(rows: list[Row], tolerance: float) -> Any:
    """Draw the committed tube with the frames of its chain on the analytic helix, and the errors of all tubes."""
    made = canvas.new_figure((12.0, 6.2))
    grid_ = made.add_gridspec(1, 2, width_ratios=(1.0, 1.2))
    _draw_chain(made.add_subplot(grid_[0], projection="3d"))
    axes = made.add_subplot(grid_[1])
    groups = list(dict.fromkeys(row.case.group for row in rows))
    gap = 3.0 + 0.05 * len(rows)
    places = [i + gap * groups.index(row.case.group) for i, row in enumerate(rows)]
    heights = [max(row.distance, 1e-18) for row in rows]  # some are 0
    for number, form in enumerate(FORMS):
        for hand, face in zip(helix.HANDEDNESS, (canvas.COLOURS[number], "none"), strict=True):
            chosen = [i for i, row in enumerate(rows) if (row.case.form, row.case.tube.handedness) == (form, hand)]
            if chosen:
                style = {"s": 16, "marker": "os^"[number], "facecolors": face, "edgecolors": canvas.COLOURS[number], "lw": 0.9}
                dots = [places[i] for i in chosen], [heights[i] for i in chosen]
                axes.scatter(*dots, label=f"{form}, {hand}-handed", **style)
    axes.axhline(tolerance, color="black", lw=1.2)
    axes.annotate(
        f"tolerance {tolerance:g} m", (1.0, tolerance), (-4, 4), ("axes fraction", "data"), "offset points", ha="right"
    )
    for group in groups:
        start = next(places[i] for i, row in enumerate(rows) if row.case.group == group) - 0.4 * gap
        axes.axvline(start, color="0.6", lw=0.8, ls=":")
        axes.annotate(f"{group}:", (start, 0.02), (3, 0), ("data", "axes fraction"), "offset points", rotation=90, color="0.3")
    axes.set_yscale("log")
    axes.set_ylim(0.1 * min(*heights, tolerance), 100.0 * max(*heights, tolerance))
    axes.set(xlabel="tubes, one after another", ylabel="largest distance of a boundary from the helix [m]")
    axes.set_title("Chains against the closed form")
    axes.set_xticks([])
    axes.grid(alpha=0.3, axis="y")
    axes.legend(fontsize=8, ncols=2, loc="upper right")
    return made


def _draw_chain(axes: Any) -> None:
    """The committed tube: smooth surface, analytic centre line, and the frames of both chains on it."""
    first, second = (case.tube for case in committed())
    model = sr.load_model(urdf_folder() / f"{FILES[0]}.urdf")
    (segment,) = body_at(model, np.zeros(0), model.rest, 8)
    corners, triangles = segment.surface(18)
    surface = axes.plot_trisurf(*corners.T, triangles=triangles, color="#9db7cc", alpha=0.16, lw=0.0, shade=True)
    surface.set_edgecolor("none")
    line = analytic(first, np.linspace(0.0, first.centre_length, 400))[:, :3, 3]
    axes.plot(*line.T, color="black", lw=1.3, label="analytic centre line")
    axes_of_frames = (
        (0, {"color": canvas.COLOURS[3], "lw": 1.2}, "x axes of the sections, towards the helix axis"),
        (2, {"color": canvas.COLOURS[2], "lw": 3.0}, "z axes, along the tube"),
    )
    for number, (tube, name) in enumerate(((first, FILES[0]), (second, FILES[1]))):
        frames = chain_frames(sr.load_model(urdf_folder() / f"{name}.urdf"), boundaries(tube))
        style = {"color": canvas.COLOURS[number], "marker": "os"[number], "ms": 5.0 - number, "ls": "none"}
        axes.plot(*frames[:, :3, 3].T, label=f"{('ends of sections', 'hinges')[number]} ({name}.urdf)", **style)
        for frame in frames[:-1] if number == 0 else ():
            for column, style, _ in axes_of_frames:
                ends = np.array([frame[:3, 3], frame[:3, 3] + 0.03 * frame[:3, column]])
                axes.plot(*ends.T, **style)
    for _, style, told in axes_of_frames:
        axes.plot([], [], [], label=told, **style)
    low, high = corners.min(axis=0), corners.max(axis=0)
    for axis, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{axis}lim")(a, b)
    axes.set_box_aspect(high - low, zoom=0.92)
    axes.view_init(elev=18, azim=-68)
    axes.set_xticks([0.0, 0.1])
    axes.locator_params(axis="z", nbins=5)
    axes.yaxis.labelpad = axes.zaxis.labelpad = 9.0
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="Committed chains on the helix")
    axes.legend(fontsize=8, loc="upper left")


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; return whether every tube is on its helix."""
    for option, value in (("--cases", arguments.cases), ("--seed", arguments.seed)):
        if value < 0:
            raise sr.ParameterError(option, value, "zero or more")
    if not 0.0 < arguments.tolerance < math.inf:
        raise sr.ParameterError("--tolerance", arguments.tolerance, "positive")
    if arguments.docs is not None and arguments.no_plots:
        raise sr.ParameterError("--docs", arguments.docs, "given without --no-plots")
    if not arguments.no_plots:
        canvas.require_matplotlib()  # tells at once what is missing
    folder = free_folder(arguments.output or Path("output") / f"helix_validation_{datetime.now():%Y%m%d_%H%M%S}")
    cases = [*committed(), *([] if arguments.no_grid else grid()), *drawn(arguments.cases, arguments.seed)]
    rows = [measure(case) for case in tqdm(cases, desc="tubes", unit="tube")]
    lines = summary(rows)
    passed = all(max(row.distance, row.angle) <= arguments.tolerance for row in rows)
    print(f"\nDistance of the boundaries of the chains from the analytic helix; tolerance {arguments.tolerance:g} m and rad")
    print(f"\n{table(lines)}\n\n{'passed' if passed else 'FAILED: an error exceeds the tolerance'}")
    make_folder(folder)
    told = {"seed": arguments.seed, "tolerance": arguments.tolerance, "passed": passed, "table": lines}
    files = [write_text(folder / NAMES[0], json.dumps(told, indent=2) + "\n", overwrite=False)]
    files.append(write_text(folder / NAMES[1], csv_of(rows), overwrite=False))
    if not arguments.no_plots:
        drawing = figure(rows, arguments.tolerance)
        for place, overwrite in ((folder, False), *([(arguments.docs, True)] if arguments.docs else [])):
            files.append(canvas.write_png(drawing, place / NAMES[2], overwrite=overwrite))
    print(f"\nwritten: {', '.join(map(str, files))}")
    return passed


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0 if every tube is on its helix, 1 if not, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
