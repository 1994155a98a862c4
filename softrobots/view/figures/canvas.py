"""What all figures share: empty figures, colours and line styles, axes in space, PNG files. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import MissingDependency
from softrobots.core.files import write_bytes
from softrobots.statics.equilibrium import Equilibrium

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito
"""Line colours that colour-blind readers can distinguish."""
MARKERS = ("o", "s", "^", "D", "v", "P")
"""Markers that distinguish lines in grey."""
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
"""Line styles that distinguish lines where they cross."""


def plain_words(name: str) -> str:
    """Return a name from a file for a figure: on one line, with the dollar sign of matplotlib's formulas escaped."""
    return (name if name.isprintable() else name.encode("unicode_escape").decode()).replace("$", r"\$")


def line_style(number: int) -> dict[str, Any]:
    """Return matplotlib's colour, style and marker of a line, numbered from 0; they repeat after six lines."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "ls": LINES[number % len(LINES)],
        "marker": MARKERS[number % len(MARKERS)],
        "ms": 5,
    }


def require_matplotlib() -> Any:
    """Return matplotlib's `Figure` class; call it early to refuse a plot before the work.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    with MissingDependency.of_imports("matplotlib", "plot"):
        from matplotlib.figure import Figure
    return Figure


def write_png(figure: Any, path: str | Path, *, overwrite: bool) -> Path:
    """Write a figure as PNG, whole or not at all, and return its path.

    Raises:
        ParameterError: If it is no path.
        OutputExists: If the file exists and `overwrite` is false, or is a folder.
        OutputError: If the file cannot be written.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return write_bytes(path, picture.getvalue(), overwrite=overwrite)


def new_figure(size: tuple[float, float]) -> Any:
    """Return an empty figure of a size in inches.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    return require_matplotlib()(figsize=size, layout="constrained", dpi=120)


def new_plot(size: tuple[float, float], **texts: str) -> tuple[Any, Any]:
    """Return a figure of a size in inches with one pair of axes and a grid, and its axes; `texts` are labels and title."""
    figure = new_figure(size)
    axes = figure.add_subplot(**texts)
    axes.grid(alpha=0.3)
    return figure, axes


def new_panels(count: int, width: float, height: float, margin: float) -> tuple[Any, Any]:
    """Return a figure of panels of a size in inches, at most three abreast, with a margin, and their axes; one at least."""
    across = min(max(count, 1), 3)
    down = -(-max(count, 1) // across)
    figure = new_figure((max(width * across, 4.0), margin + height * down))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes in panels[count:]:
        axes.axis("off")
    return figure, panels


def new_space(size: tuple[float, float], title: str) -> tuple[Any, Any]:
    """Return a figure of a size in inches with axes in space, in metres, and its axes."""
    figure = new_figure(size)
    return figure, figure.add_subplot(projection="3d", xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=title)


def grid_and_legend(axes: Any, **style: Any) -> None:
    """Draw a grid and a legend in small print; `style` is matplotlib's of a legend."""
    axes.grid(alpha=0.3)
    axes.legend(**{"fontsize": 9, **style})


def equal_box(axes: Any, points: FloatArray) -> None:
    """Give 3D axes equal scales around points, shape (n, 3) [m]."""
    centre, half = (points.max(0) + points.min(0)) / 2.0, max(float(np.ptp(points, axis=0).max()) / 2.0, 1e-3)
    for name, middle in zip("xyz", centre, strict=True):
        getattr(axes, f"set_{name}lim")(middle - half, middle + half)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=-62)


def force_arrow(axes: Any, equilibrium: Equilibrium) -> FloatArray:
    """Draw the force at the tip, if there is one, as an arrow a fifth of the reach long.

    Returns:
        The end of the arrow for `equal_box`, shape (1, 3) [m], or (0, 3) without a force.
    """
    tip = equilibrium.tip_position
    wrench = equilibrium.load.wrenches.get(equilibrium.model.tip)
    if wrench is None or not wrench[:3].any():
        return np.zeros((0, 3))
    size = float(np.linalg.norm(wrench[:3]))
    arrow = 0.2 * equilibrium.model.reach * wrench[:3] / size
    axes.quiver(*tip, *arrow, color=COLOURS[2], lw=2.0, label=f"force, {size:.1f} N")
    return np.asarray(tip + arrow)[None]
