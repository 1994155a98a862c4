"""Figures of workspaces: sampled tip positions, and maps of reach, payload and pressure. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_number, instance_of
from softrobots.core.errors import ParameterError
from softrobots.statics.workspace import Workspace
from softrobots.statics.workspace_map import WorkspaceMap
from softrobots.view.figures.canvas import SMALL, WIDTH, new_figure, plain_words, require_matplotlib

NOT_REACHED, LOST, WRINKLED, CARRIED = range(4)
"""Outcome of a target under a load: never reached, lost under the load, reached with a wrinkled link, carried."""

SHADES = ("#ffffff", "#7f7f7f", "#f3cc6b", "#17375e")
"""Colour of each outcome; they differ in lightness too."""
_LABELS = ("not reached", "reached with smaller loads only", "reached, a link wrinkles", "reached, no link wrinkles")


def workspace(samples: Workspace) -> Any:
    """Reached tip positions in three views, coloured by manipulability.

    Args:
        samples: The workspace.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no workspace.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("samples", samples, Workspace, "a Workspace")
    figure = new_figure((WIDTH, 7.0))
    tips, order = samples.tip_positions, np.argsort(samples.manipulability)
    scale = {"c": samples.manipulability[order], "cmap": "cividis", "s": 7, "rasterized": True}
    scale |= {"linewidths": 0.2, "edgecolors": "0.35"}  # so that the lightest are visible on white
    *all_axes, spare = figure.subplots(2, 2).ravel()
    spare.remove()
    centre, half = 0.5 * (tips.max(0) + tips.min(0)), 0.55 * max(float(np.ptp(tips, axis=0).max()), 1e-3)
    for axes, (one, two) in zip(all_axes, ((0, 2), (1, 2), (0, 1)), strict=True):
        dots = axes.scatter(tips[order, one], tips[order, two], **scale)
        axes.plot(0.0, 0.0, marker="+", color="k", ms=10, ls="none", label="base")
        axes.set(xlabel=f"{'xyz'[one]} [m]", ylabel=f"{'xyz'[two]} [m]", aspect="equal")
        axes.set_xlim(centre[one] - half, centre[one] + half)
        axes.set_ylim(centre[two] - half, centre[two] + half)
        axes.grid(alpha=0.3)
    all_axes[0].legend(loc="lower left", fontsize=SMALL)
    figure.colorbar(dots, ax=all_axes, label="manipulability of the tip [m³/rad³]", pad=0.01)
    force = sum((float(np.linalg.norm(wrench[:3])) for wrench in samples.load.wrenches.values()), 0.0)
    load = ([f"{force:.3g} N"] if force > 0.0 else []) + (["gravity"] if samples.load.gravity is not None else [])
    under = f" under {' and '.join(load)}" if load else ", no load"
    figure.suptitle(f"{len(tips)} tip position{'s' * (len(tips) != 1)} within the limits of the actuators{under}")
    return figure


def workspace_maps(result: WorkspaceMap, *, load: Any = None) -> Any:
    """Reach, payload and required pressure in the plane of the map, or in the middle slice of a box.

    Args:
        result: The map.
        load: Load of the first and the last panel [N]; the nearest of the map is shown. None: half of the largest.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no map, it has one radius or one height only, or the load is not finite.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("result", result, WorkspaceMap, "a WorkspaceMap")
    if len(result.grid.x) < 2 or len(result.grid.z) < 2:
        raise ParameterError("result", result.grid.shape, "a map with at least two coordinates x and z (this is its shape)")
    wanted = result.loads[-1] / 2.0 if load is None else finite_number("load", load, "N")
    level = int(np.abs(result.loads - wanted).argmin())
    require_matplotlib()
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    across, middle = result.grid.x, len(result.grid.y) // 2
    wide = float(np.ptp(across)) > 0.75 * float(np.ptp(result.grid.z))
    figure = new_figure((WIDTH, 6.6 if wide else 9.0))
    *all_axes, spare = figure.subplots(2, 2).ravel()
    reach_axes, payload_axes, pressure_axes = all_axes
    spare.axis("off")
    force = f"{result.loads[level]:.4g} N"

    outcomes = outcome(result, level)[:, middle]
    shades = ListedColormap(SHADES)
    _cells(reach_axes, result, outcomes, cmap=shades, norm=BoundaryNorm(np.arange(5) - 0.5, 4))
    shown = [number for number in (CARRIED, WRINKLED, LOST, NOT_REACHED) if (outcomes == number).any()]
    handles = [Patch(facecolor=SHADES[number], edgecolor="0.3", label=_LABELS[number]) for number in shown]
    spare.legend(handles=handles, loc="center", title=f"reach with {force}", fontsize=SMALL)
    reach_axes.set_title(f"Reach with {force} on the tip")

    payload = np.where(result.reached[:, middle, :, 0], result.payload[:, middle], np.nan)
    drawn = _cells(payload_axes, result, payload, cmap="cividis", vmin=0.0, vmax=float(result.loads[-1]))
    figure.colorbar(drawn, ax=payload_axes, label="largest load without wrinkling [N]")
    _contours(payload_axes, result, payload, set())
    payload_axes.set_title("Payload")

    needed = np.where(result.reached[:, middle, :, level], result.required_pressure[:, middle, :, level], np.nan) / 1e3
    drawn = _cells(pressure_axes, result, needed, cmap="cividis")
    figure.colorbar(drawn, ax=pressure_axes, label="gauge pressure at which no link wrinkles [kPa]")
    _contours(pressure_axes, result, needed, {group.pressure / 1e3 for group in result.model.spring_groups})
    pressure_axes.set_title(f"Required pressure with {force}")

    flat = len(result.grid.y) == 1 and result.grid.y[0] == 0.0
    for axes in all_axes:
        axes.plot(0.0, 0.0, marker="+", color="k", ms=10, ls="none")
        axes.set(
            aspect="equal", xlabel="distance from motor 1 [m]" if flat and across[0] > 0.0 else "x [m]", ylabel="height z [m]"
        )
    weight = "weightless arm" if result.gravity is None else f"arm under gravity {_components(result.gravity)} m/s²"
    where = "" if flat else f", slice at y = {result.grid.y[middle]:.4g} m"
    figure.suptitle(f"{plain_words(result.model.pinocchio.name)}: force along {_components(result.direction)}\n{weight}{where}")
    return figure


def outcome(result: WorkspaceMap, level: int) -> Any:
    """Return the outcome of each target at a load of the map: `NOT_REACHED`, `LOST`, `WRINKLED` or `CARRIED`, `grid.shape`."""
    here, wrinkled = result.reached[..., level], result.wrinkled[..., level]
    before = result.reached[..., :level].any(axis=-1)
    return np.where(here, np.where(wrinkled, WRINKLED, CARRIED), np.where(before, LOST, NOT_REACHED))


def _cells(axes: Any, result: WorkspaceMap, values: Any, **style: Any) -> Any:
    axes.set_facecolor("white")
    return axes.pcolormesh(result.grid.x, result.grid.z, values.T, shading="nearest", rasterized=True, **style)


def _contours(axes: Any, result: WorkspaceMap, values: FloatArray, levels: set[float]) -> None:
    """Lines of equal value with their numbers: some in white, or, thick and dashed, at given levels.

    Their edges have the other shade, so that they stand out from light and from dark.
    """
    finite = values[np.isfinite(values)]
    if not len(finite) or float(np.ptp(finite)) <= 0.0:
        return
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator

    own = sorted(level for level in levels if finite.min() < level < finite.max())
    plain = MaxNLocator(6).tick_values(finite.min(), finite.max())
    plain = [value for value in plain if finite.min() < value < finite.max() and value not in own]
    for chosen, style, edge, label in (
        (plain, {"colors": "white", "linewidths": 0.9}, "black", "{:g}"),
        (own, {"colors": "black", "linewidths": 1.8, "linestyles": "--"}, "white", "own: {:g}"),
    ):
        if chosen:
            lines = axes.contour(result.grid.x, result.grid.z, values.T, levels=chosen, **style)
            # One number for each level, on its longest line: steep places have many short ones.
            longest = [max(segments, key=len) for segments in lines.allsegs if segments]
            places = [segment[len(segment) // 2] for segment in longest if len(segment) > 1]
            for text in axes.clabel(lines, fmt=label.format, fontsize=SMALL, manual=places):
                text.set_path_effects([withStroke(linewidth=2.0, foreground=edge)])
            lines.set_path_effects([withStroke(linewidth=1.6, foreground=edge)])


def _components(vector: Any) -> str:
    return f"({', '.join(f'{number:.4g}' for number in vector)})"
