"""Tables and picture of the study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from softrobots.view.figures import canvas
from studies.control.shaping import SIZES
from studies.control.tracking import Followed
from studies.papers import arm_path
from studies.shared.markdown import line


def shaping_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Vibration after the move, a row for each shaper."""
    sizes = [f"{100 * size:g} % of the move" for size in SIZES]
    lines = [line(["shaper", "modes", "longer by [s]", *sizes]), "|---|---|---" + "|---:" * len(sizes) + "|"]
    for row in rows:
        bare = row["shaper"] == "none"
        amounts = [f"{1e3 * metres:.2f} mm" for metres in row["left_m"]] if bare else [f"{p:.2g} %" for p in row["percent"]]
        modes = ", ".join(map(str, row["modes"])) or "-"
        lines.append(line([row["shaper"], modes, f"{row['longer_s']:.3f}", *amounts]))
    return "\n".join(lines)


def tracking_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """What the tip does, a row for each controller."""
    keys = ("largest_m", "rms_m", "overshoot_m", "vibration_m", "end_m")
    head = ["largest error", "rms error", "overshoot", "residual vibration", "error at rest"]
    lines = [line(["controller", "load", *(f"{one} [mm]" for one in head)]), "|---|---:" + "|---:" * len(head) + "|"]
    for row in rows:
        numbers = [f"{1e3 * row[key]:.1f}" if row[key] >= 1e-3 else f"{1e3 * row[key]:.2f}" for key in keys]
        lines.append(line([row["controller"], "as assumed" if row["load"] == 1.0 else f"{row['load']:g} times", *numbers]))
    return "\n".join(lines)


def tracking_figure(followed: Sequence[Followed]) -> Any:
    """Error of the tip over time."""
    title = "The tip on the path of the arm, 2 s, then at rest"
    figure, axes = canvas.new_plot(
        (6.4, 5.6), xlabel="time [s]", ylabel="distance of the tip from its target [mm]", title=title
    )
    for number, one in enumerate(followed):
        style = canvas.line_style(number) | {"marker": None}
        load = "" if one.load == 1.0 else f", {one.load:g} times the load"
        axes.plot(one.motion.time, 1e3 * one.error, lw=1.8, label=one.name.replace("`", "") + load, **style)
    axes.axvline(arm_path.DURATION, color="0.45", lw=0.8, ls=":")
    axes.set_yscale("log")
    axes.set(xlim=(0.0, float(followed[0].motion.time[-1])), ylim=(1e-3, 1e3))
    figure.legend(fontsize=10, loc="outside lower center", ncols=1)
    return figure
