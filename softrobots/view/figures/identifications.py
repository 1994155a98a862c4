"""Figures of parameters that were fitted to measurements. Needs matplotlib (extra `plot`).

Each function takes a fit and returns a `matplotlib.figure.Figure`; save it with `figure.savefig(path)`. Errors are
ParameterError for what is no fit, MissingDependency without matplotlib.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, instance_of
from softrobots.identification.identification import UNITS, Comparison, Identification
from softrobots.identification.uncertainty import CONFIDENCE, Uncertainty
from softrobots.view.figures import canvas
from softrobots.view.figures.canvas import COLOURS, grid_and_legend, line_style, new_figure, new_panels, new_plot, plain_words

_MOST_PANELS = 12  # panels of predicted against measured
_MOST_PAIRS = 6  # confidence ellipses
_MOST_NAMED = 5  # outliers
_MOST_BESIDE = 30  # names of parameters beside a matrix
_MOST_WRITTEN = 14  # parameters up to which correlations are written into their cells
_SMALL = {"m": (1e3, "mm"), "rad": (1e3, "mrad")}  # units of residuals


class _Part(NamedTuple):
    """Components of a measured quantity that share a unit; rows of arrays are rows of the measurements."""

    title: str
    unit: str
    axes: tuple[str, ...]
    columns: slice


def identification_figures(result: Identification) -> dict[str, Any]:
    """Return every figure of a fit by a name for its file; a figure with nothing to show is left out."""
    found = {"residuals": residuals(result), "predicted": predicted(result), "values": values(result)}
    determined = int(np.sum(result.by_rows.determined))
    return found | ({"correlation": correlation(result), "ellipses": ellipses(result)} if determined > 1 else {})


def residuals(result: Identification) -> Any:
    """Measured minus predicted by row, a panel for each quantity; blocks are shaded in turn, outliers are ringed."""
    instance_of("result", result, Identification, "an Identification")
    rows = result.fitted.measurements
    parts = [(key, part) for key in rows.measured for part in _parts(result.fitted, key)]
    figure = new_figure((canvas.WIDTH, 1.2 + 2.4 * len(parts)))
    panels = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (key, part) in zip(panels, parts, strict=True):
        scale, unit = _SMALL.get(part.unit, (1.0, part.unit))
        left = scale * result.residuals[key][:, part.columns]
        for number, name in enumerate(part.axes):
            axes.plot(left[:, number], label=name, **line_style(number) | {"ls": "", "ms": 4.5})
        for rank, row in enumerate(result.outliers):
            place = row, max(np.nan_to_num(left[row]), key=abs)
            axes.plot(*place, ls="", marker="o", ms=13, mfc="none", color="0.1")
            side = -1 if row > 0.7 * len(rows) else 1
            style: dict[str, Any] = {
                "textcoords": "offset points",
                "ha": "left" if side > 0 else "right",
                "va": "center",
                "fontsize": 10,
            }
            axes.annotate(rows.where(row) if rank < _MOST_NAMED else "", place, (11 * side, 0), **style)
        axes.axhline(0.0, color="0.3", lw=0.8)
        for begin, end in list(_blocks(rows.labels))[1::2]:
            axes.axvspan(begin - 0.5, end - 0.5, color="0.9", lw=0, zorder=0)
        axes.set(title=plain_words(part.title), ylabel=f"residual [{unit}]", xlim=(-0.5, len(rows) - 0.5))
        grid_and_legend(axes, fontsize=10, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    panels[-1].set_xlabel("row, counted from 0" + (" (shaded: every other block)" if rows.labels is not None else ""))
    return figure


def predicted(result: Identification) -> Any:
    """Predicted over measured numbers, a panel for each component of each quantity; hollow: rows kept aside."""
    instance_of("result", result, Identification, "an Identification")
    panels = [
        (key, part, number)
        for key in result.fitted.measurements.measured
        for part in _parts(result.fitted, key)
        if part.unit != "rad"
        for number in range(len(part.axes))
    ][:_MOST_PANELS]
    figure, grid = new_panels(len(panels), 2.33, 2.5, 0.7)
    for axes, (key, part, number) in zip(grid, panels, strict=False):
        shown = [_numbers(one, key)[:, :, number] for one in (result.fitted, result.validation) if one is not None]
        every = np.concatenate(shown, axis=None)
        axes.plot(*[[np.nanmin(every), np.nanmax(every)]] * 2, color="0.3", lw=0.8)
        for aside, numbers in enumerate(shown):
            style = line_style(aside) | {"ls": "", "ms": 4.5 + aside, "mfc": "white" if aside else None}
            axes.plot(*numbers, label="kept aside" if aside else "fitted", **style)
        title = plain_words(f"{part.title} {part.axes[number]}")
        axes.set(title=title, xlabel=f"measured [{part.unit}]", ylabel=f"predicted [{part.unit}]")
        axes.title.set_fontsize(10)
        axes.grid(alpha=0.3)
        axes.set_aspect("equal", adjustable="datalim")
    if result.validation is not None:
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=10)
    return figure


def values(result: Identification) -> Any:
    """Parameters before and after the fit with their intervals and priors, each on a scale of its own.

    The thick bar is the interval from rows, the thin one that from blocks; a grey band is the prior, two standard deviations
    to both sides. The numbers are value, and interval from rows. Beyond the scale, bars are cut.
    """
    instance_of("result", result, Identification, "an Identification")
    intervals, blocks = result.intervals, result.block_intervals
    figure, axes = new_plot((canvas.WIDTH, 1.5 + 0.42 * len(result.parameters)), title="Parameters before and after the fit")
    axes.grid(visible=False)
    for place, (one, value) in enumerate(zip(result.parameters, result.solution.tolist(), strict=True)):
        ends = intervals[one.name]
        known = result.priors.get(one.name, (value, 0.0))
        prior = known[0] - 2.0 * known[1], known[0] + 2.0 * known[1]
        shown = [value, one.value, *(end for end in (*ends, *prior) if np.isfinite(end))]
        low, size = min(shown), max(max(shown) - min(shown), 1e-9 * max(abs(value), 1.0))

        def at(number: float, low: float = low, size: float = size) -> float:
            return float(np.clip((number - low) / size, -0.06, 1.06))

        if one.name in result.priors:
            axes.barh(place, at(prior[1]) - at(prior[0]), left=at(prior[0]), height=0.72, color="0.87")
        for pair, width, colour in ((ends, 6.0, COLOURS[5]), (blocks.get(one.name), 1.8, COLOURS[1])):
            if pair is not None and np.isfinite(pair).all():
                axes.plot([at(pair[0]), at(pair[1])], [place, place], color=colour, lw=width, solid_capstyle="butt")
        axes.plot(at(one.value), place, ls="", marker="D", ms=7, mfc="white", color="0.35")
        axes.plot(at(value), place, ls="", marker="o", ms=7, color=COLOURS[0])
        words = f"{ends[0]:.4g} .. {ends[1]:.4g}" if np.isfinite(ends).all() else "not determined"
        axes.text(1.09, place, f"{value:.4g} ({words}) {one.unit}", va="center", fontsize=canvas.SMALL)
    handles = [
        axes.plot([], [], ls="", marker="D", ms=7, mfc="white", color="0.35", label="start")[0],
        axes.plot([], [], ls="", marker="o", ms=7, color=COLOURS[0], label="fitted")[0],
        axes.plot([], [], color=COLOURS[5], lw=6.0, label="95 %, rows")[0],
    ]
    handles += [axes.plot([], [], color=COLOURS[1], lw=1.8, label="95 %, blocks")[0]] * bool(blocks)
    handles += [axes.barh(0, 0, color="0.87", label="prior, 2 std")] * bool(result.priors)
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=10)
    names = [plain_words(name) for name in result.names]
    axes.set(xlim=(-0.08, 1.08), ylim=(len(names) - 0.4, -0.6), xticks=[], yticks=range(len(names)), yticklabels=names)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    return figure


def correlation(result: Identification) -> Any:
    """Correlation of the errors of the parameters, from rows; those that are not determined are left out."""
    instance_of("result", result, Identification, "an Identification")
    kept = np.flatnonzero(result.by_rows.determined)
    found = result.by_rows.correlation[np.ix_(kept, kept)]
    size = min(2.8 + 0.42 * len(kept), canvas.WIDTH - 0.9)
    figure = new_figure((size + 0.9, size))
    axes = figure.add_subplot(title="Correlation of the errors")
    image = axes.imshow(found, cmap="PuOr", vmin=-1.0, vmax=1.0)
    names = [plain_words(result.names[number]) for number in kept]
    every = -(-len(kept) // _MOST_BESIDE)  # names of more would lie upon each other
    axes.set_xticks(range(0, len(kept), every), names[::every], rotation=90, fontsize=canvas.SMALL)
    axes.set_yticks(range(0, len(kept), every), names[::every], fontsize=canvas.SMALL)
    if len(kept) <= _MOST_WRITTEN:
        for (row, column), number in np.ndenumerate(found):
            text = f"{number:.1f}".replace("-0.0", "0.0")
            style = {"fontsize": canvas.SMALL, "color": "white" if abs(number) > 0.7 else "0.1"}
            axes.text(column, row, text, ha="center", va="center", **style)
    figure.colorbar(image, ax=axes, shrink=0.7)
    return figure


def ellipses(result: Identification) -> Any:
    """Joint 95 % confidence regions of the pairs of parameters with the largest correlations, from rows and from blocks.

    The ellipse of the fitted coordinates, in which a positive parameter is its logarithm: all points within `2 F` of the value
    by the inverse of their covariance, with the quantile of the F distribution of 2 and as many degrees of freedom as the
    covariance has.
    """
    instance_of("result", result, Identification, "an Identification")
    rows, blocks = result.by_rows, result.by_blocks
    free = np.outer(rows.determined, rows.determined) & ~np.tri(len(rows.determined), dtype=bool)
    size = np.where(free, np.abs(rows.correlation), -1.0)
    order = np.argsort(-size, axis=None, kind="stable")[: min(_MOST_PAIRS, int(free.sum()))]
    pairs = [(int(i), int(j)) for i, j in zip(*np.unravel_index(order, size.shape), strict=True)]
    figure, grid = new_panels(len(pairs), 3.2, 3.0, 0.6)
    for axes, pair in zip(grid, pairs, strict=False):
        for one, colour, style, label in ((rows, COLOURS[0], "-", "rows"), (blocks, COLOURS[1], "--", "blocks")):
            if one is not None and one.determined[list(pair)].all():
                axes.plot(*_ellipse(result, one, pair), color=colour, ls=style, lw=2.0, label=f"95 %, from {label}")
        axes.plot(*result.solution[list(pair)], ls="", marker="+", ms=10, mew=2, color="0.1", label="fitted")
        names = [f"{plain_words(result.names[one])} [{result.parameters[one].unit or '-'}]" for one in pair]
        axes.set_xlabel(names[0], fontsize=10)
        axes.set_ylabel(names[1], fontsize=10)
        axes.set_title(f"correlation {rows.correlation[pair]:.2f}", fontsize=10)
        axes.locator_params(nbins=4)
        axes.grid(alpha=0.3)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=10)
    return figure


def _parts(comparison: Comparison, key: str) -> list[_Part]:
    """Components of a quantity with one unit; of poses those of the position, and those of the rotation."""
    kind, _, name = key.partition(".")
    if kind == "poses":
        turned = _Part(f"rotation of {name}", "rad", ("about x", "about y", "about z"), slice(3, 6))
        return [_Part(f"position of {name}", "m", ("x", "y", "z"), slice(0, 3)), turned]
    count = comparison.residuals[key].shape[1]
    if kind == "positions":
        return [_Part(f"position of {name}", "m", ("x", "y", "z"), slice(0, 3))]
    return [_Part(kind.replace("_", " "), UNITS[kind], tuple(map(str, range(1, count + 1))), slice(0, count))]


def _numbers(comparison: Comparison, key: str) -> FloatArray:
    """Measured and predicted numbers of the rows that count, of poses those of the position, shape (2, n, k)."""
    measured, predicted = comparison.measurements.measured[key], comparison.predicted[key]
    if measured.ndim == 3:
        measured, predicted = measured[:, :3, 3], predicted[:, :3, 3]
    counted = np.isfinite(comparison.residuals[key][:, : measured.shape[1]])
    return np.where(counted, np.stack([measured, predicted]), np.nan)


def _blocks(labels: tuple[str, ...] | None) -> Iterator[tuple[int, int]]:
    """First row, and the row after the last, of each run of one label."""
    begin = 0
    for row in range(1, len(labels or ()) + 1):
        if labels is not None and (row == len(labels) or labels[row] != labels[begin]):
            yield begin, row
            begin = row


def _ellipse(result: Identification, uncertainty: Uncertainty, pair: tuple[int, int]) -> FloatArray:
    """Points of the confidence region of two parameters, shape (2, n)."""
    from scipy.special import chdtri, fdtri

    freedoms = uncertainty.freedoms
    radius = np.sqrt(chdtri(2.0, 1.0 - CONFIDENCE) if np.isinf(freedoms) else 2.0 * fdtri(2.0, freedoms, CONFIDENCE))
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    lengths, axes = np.linalg.eigh(uncertainty.covariance[np.ix_(pair, pair)])
    around = radius * axes @ (np.sqrt(np.maximum(lengths, 0.0))[:, None] * np.stack([np.cos(angle), np.sin(angle)]))
    middle = result.solution[list(pair)][:, None]
    logarithmic = np.array([[result.parameters[one].logarithmic] for one in pair])
    return np.where(logarithmic, middle * np.exp(np.where(logarithmic, around, 0.0)), middle + around)
