"""What all figures share: empty figures, colours and line styles, axes in space, PNG files. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import MissingDependency
from softrobots.core.files import write_bytes
from softrobots.view.appearance import CONTACT_COLOUR, FORCE_COLOUR, PATH_COLOUR

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito
"""Line colours that colour-blind readers can distinguish."""
MARKERS = ("o", "s", "^", "D", "v", "P")
"""Markers that distinguish lines in grey."""
INK = f"#{PATH_COLOUR:06x}"
"""Near black of what is drawn as the loaded robot, a path or a target."""
GREY = "#707070"
"""Grey of what the loaded robot is compared with: rigid, relaxed, at the beginning."""
FORCE, CONTACT = f"#{FORCE_COLOUR:06x}", f"#{CONTACT_COLOUR:06x}"
"""Colours of forces and of contacts, as on pages."""
WIDTH = 7.0
"""Largest width of a figure [in]."""
SMALL = 9.0
"""Smallest text [pt]: in a figure of the largest width that is shown 400 pixels wide it is seven pixels high."""
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
"""Line styles that distinguish lines where they cross."""
DASHED = (0, (2.5, 2))
"""Line style of an actuator that hangs slack."""


def plain_words(name: str) -> str:
    """Return a name from a file for a figure: on one line, with the dollar sign of matplotlib's formulas escaped."""
    return (name if name.isprintable() else name.encode("unicode_escape").decode()).replace("$", r"\$")


def line_style(number: int) -> dict[str, Any]:
    """Return matplotlib's colour, style and marker of a line, numbered from 0; from the seventh on markers are hollow."""
    hollow = {"mfc": "white"} if number >= len(COLOURS) else {}
    return hollow | {
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
    return write_bytes(path, png(figure), overwrite=overwrite)


def new_figure(size: tuple[float, float]) -> Any:
    """Return an empty figure of a size in inches, which a notebook shows as the last expression of a cell.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    figure = require_matplotlib()(figsize=size, layout="constrained", dpi=120)
    figure._repr_png_ = partial(png, figure)  # also where pyplot has not told the notebook how
    return figure


def png(figure: Any) -> bytes:
    """Return a figure as PNG."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()


def new_plot(size: tuple[float, float], **texts: str) -> tuple[Any, Any]:
    """Return a figure of a size in inches with one pair of axes and a grid, and its axes; `texts` are labels and title."""
    figure = new_figure(size)
    axes = figure.add_subplot(**texts)
    axes.grid(alpha=0.3)
    return figure, axes


def new_panels(count: int, width: float, height: float, margin: float) -> tuple[Any, Any]:
    """Return a figure of panels of a size in inches, as many abreast as fit, with a margin, and their axes; one at least."""
    across = min(max(count, 1), int(WIDTH / width))
    down = -(-max(count, 1) // across)
    figure = new_figure((max(width * across, 4.0), margin + height * down))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes in panels[count:]:
        axes.axis("off")
    return figure, panels


def new_space(size: tuple[float, float], title: str) -> tuple[Any, Any]:
    """Return a figure of a size in inches with axes in space, in metres, and its axes; what is drawn later is in front."""
    figure, labels = new_figure(size), {f"{axis}label": f"{axis} [m]" for axis in "xyz"}
    return figure, figure.add_subplot(projection="3d", title=title, computed_zorder=False, **labels)


def grid_and_legend(axes: Any, **style: Any) -> None:
    """Draw a grid and a legend in small print; `style` is matplotlib's of a legend."""
    axes.grid(alpha=0.3)
    axes.legend(**{"fontsize": SMALL, **style})


def equal_box(axes: Any, points: FloatArray, eye: Any = (0.44, -0.82, 0.38)) -> None:
    """Give 3D axes equal scales around points, shape (n, 3) [m], seen from the direction of an eye, shape (3,)."""
    middle, spans = (points.max(0) + points.min(0)) / 2.0, np.ptp(points, axis=0)
    half = np.maximum(0.52 * spans, max(0.3 * float(spans.max()), 1e-3))
    for name, low, high in zip("xyz", middle - half, middle + half, strict=True):
        getattr(axes, f"set_{name}lim")(low, high)
        getattr(axes, f"{name}axis").get_major_locator().set_params(nbins=max(2, round(5 * (high - low) / (2 * half.max()))))
    axes.zaxis.labelpad = 9.0
    axes.set_box_aspect(half / half.max(), zoom=0.9)
    x, y, z = np.asarray(eye) / np.linalg.norm(eye)
    axes.view_init(elev=np.degrees(np.arcsin(z)), azim=np.degrees(np.arctan2(y, x)))
