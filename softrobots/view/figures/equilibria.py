"""Figure of branches of equilibria, up to buckling and beyond. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, unit_vector
from softrobots.core.errors import ParameterError
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.view.figures.canvas import SMALL, WIDTH, line_style, new_figure


def branches(found: Sequence[EquilibriumBranch], across: Any = None) -> Any:
    """Displacement of the tip across a push and least eigenvalue over the force; a line for each branch, dashed if unstable.

    Args:
        found: Branches of `softrobots.post_buckling_branches`; displacements are relative to the first point of the first.
        across: Direction of the displacement that is drawn, shape (3,), any length but zero, world axes; by default the one
            across the push in which the ends of the branches lie farthest apart.

    Returns:
        The figure.

    Raises:
        ParameterError: If there is no branch, or something else.
        MissingDependency: If matplotlib is not installed.
    """
    unit = None if across is None else unit_vector("across", across)
    if not isinstance(found, Sequence) or not found or not all(isinstance(one, EquilibriumBranch) for one in found):
        raise ParameterError("found", found, "at least one EquilibriumBranch")
    unit = _across(found) if unit is None else unit
    origin = found[0].equilibria[0].tip_position
    figure = new_figure((WIDTH, 8.2))
    upper, lower = figure.subplots(2, 1)
    for number, branch in enumerate(found):
        ways = [1e3 * float(unit @ (one.tip_position - origin)) for one in branch.equilibria]
        style = line_style(number) | {"ls": "-", "ms": 4, "markevery": max(len(ways) // 5, 1)}
        dashed = ~branch.stable
        dashed[:-1] |= dashed[1:]  # up to the end of the solid line
        for axes, values in ((upper, ways), (lower, branch.softest)):
            axes.plot(branch.forces, np.where(branch.stable, values, np.nan), label=branch.label, **style)
            axes.plot(branch.forces, np.where(dashed, values, np.nan), **(style | {"ls": "--", "marker": ""}))
    for axes in (upper, lower):
        axes.set_xlabel("force [N]")
        axes.grid(alpha=0.3)
    figure.legend(*upper.get_legend_handles_labels(), fontsize=SMALL, loc="outside lower center", ncols=2)
    upper.set(ylabel="way of the tip across the push [mm]", title="Where the tip goes (dashed: not stable)")
    lower.set(ylabel="softest eigenvalue over stiffness [-]", title="How stable it is")
    return figure


def _across(found: Sequence[EquilibriumBranch]) -> FloatArray:
    """Direction across the push in which the ends of the branches lie farthest apart, shape (3,); any if they do not."""
    pushes = np.array([sum(one.load.wrenches.values(), np.zeros(6))[:3] for branch in found for one in branch.equilibria])
    push = np.linalg.svd(pushes - pushes[0], full_matrices=False)[2][0]  # what of the load grows
    ends = np.array([branch.equilibria[-1].tip_position for branch in found])
    spread = np.vstack([ends - ends.mean(axis=0), 1e-9 * np.eye(3)])
    across = np.linalg.svd(spread @ (np.eye(3) - np.outer(push, push)))[2][0]
    return np.asarray(across * np.sign(across[np.abs(across).argmax()]))
