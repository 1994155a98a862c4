"""Pictures of predicted and measured tips."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.view.figures import canvas
from studies.measured_arm.comparison import Compared
from studies.measured_arm.errors import rms

MM = 1e3
MOST = 20.0
"""End of the histogram [mm]."""
FLOOR = "the robot against itself"
TITLES = {"train": "train: one and two segments", "val": "validation: three segments"}
SHOWN = {
    "train": {"rep1_seg1_circle": "segment 1, circle", "rep1_pair13_opp_dir60": "segments 1 and 3, opposite ways, 60\u00b0"},
    "val": {
        "rep1_all3_same_dir60": "three segments, same way, 60\u00b0",
        "rep1_all3_spiral_dir120": "three segments, spiral, 120\u00b0",
    },
}
"""Movements whose paths are drawn, and their titles."""


def pictures(compared: Sequence[Compared], plain: Sequence[Compared], floor: FloatArray) -> dict[str, Any]:
    """All pictures by name.

    Args:
        compared: The sets, predicted with elastic tendons.
        plain: The same, predicted without forces.
        floor: Distances of tips at nearly the same commands over the root of two, shape (n,) [m].
    """
    return {
        "axes": by_axis(compared),
        "errors": errors(compared, plain, floor),
        "tips": tips(compared),
        "paths": paths(compared),
        "families": families(compared),
    }


def by_axis(compared: Sequence[Compared], told: str = "Nominal robot, nothing fitted here but the pose of the base") -> Any:
    """Predicted over measured, an axis a panel; the title says what is `told`."""
    figure, panels = canvas.new_panels(4, 0.5 * canvas.WIDTH, 3.5, 0.4)
    for number, axes in enumerate(panels[:3]):
        both = np.concatenate([np.stack([one.recording.tips[:, number], one.posed[:, number]]) for one in compared], axis=1)
        ends, apart = MM * np.array([both.min() - 0.005, both.max() + 0.005]), []
        axes.plot(ends, ends, color="black", lw=1.0, label="equal")
        for place, one in enumerate(compared):
            difference = MM * rms(one.posed[:, number] - one.recording.tips[:, number])
            apart.append(f"{TITLES[one.recording.name].partition(':')[0]} {difference:.1f} mm")
            style = {
                "color": canvas.COLOURS[place],
                "marker": canvas.MARKERS[place],
                "ls": "none",
                "ms": 3,
                "alpha": 0.55,
                "mew": 0,
            }
            measured, predicted = MM * one.recording.tips[:, number], MM * one.posed[:, number]
            axes.plot(measured, predicted, label=TITLES[one.recording.name], **style)
        axes.set(xlabel=f"measured {'xyz'[number]} [mm]", ylabel=f"predicted {'xyz'[number]} [mm]", xlim=ends, ylim=ends)
        axes.set_title(", ".join(apart), fontsize=canvas.SMALL)
        axes.set_aspect("equal")
        axes.grid(alpha=0.3)
    panels[3].axis("off")
    words = "Above each plot:\nroot mean square of the difference"
    panels[3].legend(*panels[0].get_legend_handles_labels(), loc="center", title=words, fontsize=canvas.SMALL, markerscale=2)
    figure.suptitle(told, fontsize=11)
    return figure


def errors(compared: Sequence[Compared], plain: Sequence[Compared], floor: FloatArray) -> Any:
    """How many rows have an error below a limit, how the errors are distributed, and in which movements they arise."""
    figure = canvas.new_figure((canvas.WIDTH, 11.5))
    share, counts, boxes = figure.subplots(3, 1, height_ratios=(1.0, 1.0, 1.3))
    bins = np.linspace(0.0, MOST, 21)
    for place, (one, other) in enumerate(zip(compared, plain, strict=True)):
        title, colour = TITLES[one.recording.name].partition(":")[0], canvas.COLOURS[place]
        share.plot(*cumulated(one.errors), color=colour, ls=canvas.LINES[place], lw=1.8, label=f"elastic tendons, {title}")
        share.plot(
            *cumulated(other.errors), color=colour, ls=canvas.LINES[2 + place], lw=1.8, label=f"constant curvature, {title}"
        )
        style = {"histtype": "step", "lw": 1.8, "color": colour, "ls": canvas.LINES[place]}
        counts.hist(**percent(one.errors, bins), label=f"elastic tendons, {title}", **style)
    share.plot(*cumulated(floor), color="black", ls=canvas.LINES[4], lw=1.8, label=FLOOR)
    counts.hist(**percent(floor, bins), color="0.8", label=FLOOR, zorder=0)
    _boxes(boxes, compared)
    share.set(
        xlabel="tip error [mm]", ylabel="rows below it [%]", xlim=(0.0, 30.0), ylim=(0.0, 101.0), title="Rows below an error"
    )
    counts.set(xlabel="tip error [mm]", ylabel="rows a millimetre [%]", xlim=(0.0, MOST), title="How errors are distributed")
    for axes in (share, counts):
        canvas.grid_and_legend(axes)
    return figure


def percent(values: FloatArray, bins: FloatArray) -> dict[str, FloatArray]:
    """What matplotlib's histogram takes: values [mm], those beyond in the last bin; bins; weights [%]."""
    return {"x": np.minimum(MM * values, bins[-1] - 0.1), "bins": bins, "weights": np.full(len(values), 100.0 / len(values))}


def drawn(compared: Sequence[Compared]) -> dict[str, Any]:
    """Pictures of a fit by name."""
    return {"axes": by_axis(compared, "Robot fitted to train; validation was not seen"), "movements": by_movement(compared)}


def by_movement(compared: Sequence[Compared]) -> Any:
    """Errors by family of movements."""
    figure = canvas.new_figure((canvas.WIDTH, 4.4))
    axes = figure.subplots()
    _boxes(axes, compared)
    for place, one in enumerate(compared):
        axes.plot([], [], color=canvas.COLOURS[place], lw=6, alpha=0.7, label=TITLES[one.recording.name].partition(":")[0])
    canvas.grid_and_legend(axes, loc="lower right")
    return figure


def _boxes(axes: Any, compared: Sequence[Compared]) -> None:
    """Errors by family of movements."""
    named = [(one, family) for one in compared for family in one.by_family()]
    values = [MM * one.errors[np.array(one.recording.families) == family] for one, family in named]
    labels = [f"{family} ({len(errors)})" for (_, family), errors in zip(named, values, strict=True)]
    drawn = axes.boxplot(values, vert=False, whis=(5, 95), showfliers=False, patch_artist=True, tick_labels=labels)
    for patch, (one, _) in zip(drawn["boxes"], named, strict=True):
        patch.set(facecolor=canvas.COLOURS[compared.index(one)], alpha=0.7)
    for line in drawn["medians"]:
        line.set(color="black", lw=1.6)
    axes.invert_yaxis()
    axes.tick_params(axis="y", labelsize=canvas.SMALL)
    axes.set(xlabel="tip error [mm]: median, middle half, 5 to 95 %", title="By movement (number of rows)", xlim=(0.0, None))
    axes.grid(alpha=0.3)


def cumulated(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sorted values [mm], and the share of them that is smaller [%]."""
    return MM * np.sort(values), 100.0 * np.arange(1, len(values) + 1) / len(values)


def tips(compared: Sequence[Compared]) -> Any:
    """Clouds of tips from two sides, measured and predicted, joined by lines."""
    figure = canvas.new_figure((canvas.WIDTH, 0.6 + 2.7 * len(compared)))
    rows = figure.subplots(len(compared), 2, squeeze=False)
    for line, one in zip(rows, compared, strict=True):
        for axes, side in zip(line, (0, 1), strict=True):
            joined = MM * np.stack([one.recording.tips[:, [side, 2]], one.posed[:, [side, 2]]], axis=1)
            gaps = np.full((len(joined), 1, 2), np.nan)
            axes.plot(*np.concatenate([joined, gaps], axis=1).reshape(-1, 2).T, color="0.5", lw=0.6, zorder=0)
            for place, (name, points) in enumerate((("measured", joined[:, 0]), ("predicted", joined[:, 1]))):
                style = {"color": canvas.COLOURS[place], "marker": canvas.MARKERS[place], "ms": 2.4, "mew": 0.0, "ls": "none"}
                axes.plot(*points.T, label=name, **style)
            axes.set(xlabel=f"{'xy'[side]} [mm]", ylabel="z [mm]", xlim=(-175.0, 175.0), ylim=(-5.0, 200.0))
            axes.set_title(TITLES[one.recording.name], fontsize=canvas.SMALL)
            axes.set_aspect("equal")
            axes.grid(alpha=0.3)
    figure.legend(*rows[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, markerscale=4)
    return figure


def paths(compared: Sequence[Compared]) -> Any:
    """Paths of the tip in some movements, from above, and the error along them."""
    shown = [(one, block) for one in compared for block in SHOWN[one.recording.name] if block in one.recording.blocks]
    figure = canvas.new_figure((canvas.WIDTH, 0.6 + 2.9 * max(1, len(shown))))
    rows = figure.subplots(max(1, len(shown)), 2, squeeze=False)
    for (axes, beside), (one, block) in zip(rows, shown, strict=False):
        chosen = np.array(one.recording.blocks) == block
        for place, (name, points) in enumerate((("measured", one.recording.tips), ("predicted", one.posed))):
            style = canvas.line_style(place) | {"ms": 3, "lw": 1.2}
            path = MM * points[chosen][:, :2]
            axes.plot(*path.T, label=name, **style)
            axes.plot(*path[0], color=canvas.COLOURS[place], marker="*", ms=12, ls="none", label=f"start, {name}")
        beside.plot(MM * one.errors[chosen], color="black", lw=1.2, marker="o", ms=3)
        axes.set(xlabel="x [mm]", ylabel="y [mm]")
        title = SHOWN[one.recording.name][block]
        axes.set_title(f"{title}\n({TITLES[one.recording.name].partition(':')[0]})", fontsize=canvas.SMALL)
        axes.set_aspect("equal", adjustable="datalim")
        beside.set(xlabel="row of the movement", ylabel="tip error [mm]", ylim=(0.0, None))
        axes.grid(alpha=0.3)
        beside.grid(alpha=0.3)
    figure.legend(*rows[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def families(compared: Sequence[Compared]) -> Any:
    """Tips by family of movements from above, before those of all rows in grey."""
    named = [(one, family) for one in compared for family in one.by_family()]
    figure, panels = canvas.new_panels(len(named), 0.5 * canvas.WIDTH, 3.0, 0.4)
    everything = MM * np.concatenate([one.recording.tips for one in compared])
    dots = {"mew": 0.0, "ls": "none"}
    for axes, (one, family) in zip(panels, named, strict=False):
        chosen = np.array(one.recording.families) == family
        axes.plot(*everything[:, :2].T, color="0.85", marker="o", ms=2, **dots)
        for place, (name, points) in enumerate((("measured", one.recording.tips), ("predicted", one.posed))):
            look = {"color": canvas.COLOURS[place], "marker": canvas.MARKERS[place], "label": name}
            axes.plot(*(MM * points[chosen, :2]).T, ms=2.4, **look, **dots)
        axes.set(xlabel="x [mm]", ylabel="y [mm]", xlim=(-175.0, 150.0), ylim=(-150.0, 150.0))
        axes.set_title(
            f"{family} ({'validation' if one.recording.name == 'val' else one.recording.name})", fontsize=canvas.SMALL
        )
        axes.set_aspect("equal")
        axes.grid(alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, markerscale=4)
    return figure
