"""The results as a Markdown table, as CSV and as a figure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import helix
from softrobots.core.files import csv_text
from softrobots.description.paths import urdf_folder
from softrobots.view.body import body_at
from softrobots.view.figures import canvas
from studies.helix_validation.comparison import Row, analytic, boundaries, chain_frames
from studies.helix_validation.tubes import FILES, FORMS, committed


def table(lines: list[dict[str, Any]]) -> str:
    """Format the largest errors as Markdown."""
    result = [
        "| set | chain | tubes | boundaries | largest distance [m] | largest angle [rad] |",
        "|---|---|---:|---:|---:|---:|",
    ]
    for line in lines:
        distance, angle = f"{line['largest_distance_m']:.1e}", f"{line['largest_angle_rad']:.1e}"
        result.append(f"| {line['set']} | {line['chain']} | {line['tubes']} | {line['boundaries']} | {distance} | {angle} |")
    return "\n".join(result)


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
    figure = canvas.new_figure((canvas.WIDTH, 11.0))
    grid_ = figure.add_gridspec(2, 1, height_ratios=(1.4, 1.0))
    _draw_chain(figure.add_subplot(grid_[0], projection="3d"))
    axes = figure.add_subplot(grid_[1])
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
    axes.legend(fontsize=canvas.SMALL, ncols=2, loc="upper right")
    return figure


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
    for _, style, text in axes_of_frames:
        axes.plot([], [], [], label=text, **style)
    low, high = corners.min(axis=0), corners.max(axis=0)
    for axis, a, b in zip("xyz", low, high, strict=True):
        getattr(axes, f"set_{axis}lim")(a, b)
    axes.set_box_aspect(high - low, zoom=1.1)
    axes.view_init(elev=18, azim=-68)
    axes.set_xticks([0.0, 0.1])
    axes.locator_params(axis="z", nbins=5)
    axes.yaxis.labelpad = axes.zaxis.labelpad = 9.0
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="Committed chains on the helix")
    axes.legend(fontsize=canvas.SMALL, loc="upper center", bbox_to_anchor=(0.5, -0.08))
