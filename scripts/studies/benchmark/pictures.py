"""Pictures of a benchmark: cost over the number of sections, and over the size of the batch. Needs matplotlib (`plot`)."""

from __future__ import annotations

from typing import Any

from softrobots.view.figures import canvas
from studies.benchmark.results import Results

PICTURES = {
    "sizes": ("Equilibrium of a rod under a tip force", "sections, or pairs of hinges", "CPU time of one call [$\\mu$s]"),
    "batches": ("Equilibria of the inflatable arm", "cases in a batch", "CPU time a case [$\\mu$s]"),
}
"""Title and axes by the name of a picture."""

_MARKED = (10, 50)  # numbers of sections between which the growth has a limit
_MARKS = "the growth between these has a limit"


def picture(results: Results, name: str) -> Any:
    """Draw the curves of a picture, log-log.

    Args:
        results: The results.
        name: "sizes" or "batches".

    Returns:
        The figure.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    title, size, cost = PICTURES[name]
    figure = canvas.new_figure((canvas.WIDTH, 5.6))
    axes = figure.add_subplot()
    curves = [curve for curve in results.curves if curve.picture == name]
    for number, curve in enumerate(curves):
        axes.loglog(
            curve.sizes, [1e6 * seconds for seconds in curve.seconds], label=curve.label, **canvas.line_style(number),
        )  # fmt: skip
    if name == "sizes":
        largest = max((size for curve in curves for size in curve.sizes), default=0)
        for number, marked in enumerate(some for some in _MARKED if some <= largest):
            axes.axvline(marked, color="0.4", lw=1.2, ls=":", label=None if number else _MARKS)
        sizes = sorted({some for curve in curves for some in curve.sizes})
        axes.set_xticks(sizes, [str(some) for some in sizes], minor=False)
        axes.set_xticks([], minor=True)
    axes.set(xlabel=size, ylabel=cost, title=title)
    axes.grid(alpha=0.3, which="both")
    if curves:
        figure.legend(fontsize=canvas.SMALL, loc="outside lower center", ncols=2)
    return figure
