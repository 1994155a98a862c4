"""The results as a figure: tip error over the number of segments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.view.figures import canvas
from studies.agreement.robots import AT_THE_START, CHAINS, IN_THE_MIDDLE

STYLES = (*CHAINS, IN_THE_MIDDLE, AT_THE_START)
"""Forms in the order of their line styles."""


def figure(results: Mapping[str, dict[str, Any]]) -> Any:
    """Draw the errors over the number of segments, a panel a study, with the slopes of orders one and two."""
    drawn, grid = canvas.new_panels(len(results), 0.5 * canvas.WIDTH, 3.3, 0.9)
    for axes, result in zip(grid, results.values(), strict=False):
        panel(axes, result)
    entries: dict[str, Any] = {}
    for axes in grid[: len(results)]:
        handles, labels = axes.get_legend_handles_labels()
        entries = dict(zip(labels, handles, strict=True)) | entries
    drawn.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=2, fontsize=canvas.SMALL)
    return drawn


def panel(axes: Any, result: dict[str, Any]) -> None:
    """Draw a study."""
    counts = np.array(result["counts"], dtype=float)
    for name, form in sorted(result["forms"].items(), key=lambda item: STYLES.index(item[0])):
        points = [(row["n"], 1e3 * row["error_m"]) for row in form["rows"]]
        axes.loglog(*zip(*points, strict=True), label=name, **canvas.line_style(STYLES.index(name)))
    if "mujoco" in result:
        points = [(row["n"], 1e3 * row["error_m"]) for row in result["mujoco"]["rows"]]
        style = {"ls": "none", "marker": "o", "ms": 10, "mfc": "none", "mec": "black", "mew": 0.9}
        axes.loglog(*zip(*points, strict=True), label="MuJoCo", **style)
    top = max(1e3 * row["error_m"] for form in result["forms"].values() for row in form["rows"])
    for order, dashes in ((1, ":"), (2, "-")):
        axes.loglog(counts, 1.5 * top * (counts[0] / counts) ** order, color="0.6", lw=1.0, ls=dashes, label=f"order {order}")
    axes.set_xticks(counts, [f"{n:g}" for n in counts])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    head, _, rest = result["title"].partition(", ")
    axes.set_title(f"{head}\n{rest.partition(';')[0]}", fontsize=canvas.SMALL)
    axes.set(xlabel="segments n [-]", ylabel="tip error [mm]")
