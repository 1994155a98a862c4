"""Figures of trajectories, after Figures 10 and 11 of [Troise 2021]. Needs matplotlib (extra `plot`).

The functions return a `matplotlib.figure.Figure`; save it with `figure.savefig(path)` or `write_png`. Lines differ in style as
well as in colour, so that they can be told apart in grey.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_integer
from softrobots.core.errors import MissingDependency, ParameterError
from softrobots.core.files import write_bytes
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import backbone
from softrobots.statics.trajectory import Trajectory

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito
"""Line colours that colour-blind people can tell apart."""
MARKERS = ("o", "s", "^", "D", "v", "P")
"""Markers that tell lines apart in grey."""
LINES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
"""Styles of lines that tell them apart where they cross."""


def plain_words(name: str) -> str:
    """A name of a robot or a joint as a figure writes it: on one line, and without formulas, which begin with a dollar.

    Args:
        name: The name, out of somebody's file.
    """
    return (name if name.isprintable() else name.encode("unicode_escape").decode()).replace("$", r"\$")


def line_style(number: int) -> dict[str, Any]:
    """Colour, style and marker of a line among others, for matplotlib; they repeat after six lines.

    Args:
        number: Number of the line, from 0.
    """
    return {
        "color": COLOURS[number % len(COLOURS)],
        "ls": LINES[number % len(LINES)],
        "marker": MARKERS[number % len(MARKERS)],
        "ms": 5,
    }


def require_matplotlib() -> Any:
    """Return matplotlib's `Figure` class; call it early to learn whether plots can be made.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependency("matplotlib", "plot") from error
    return Figure


def poses(trajectory: Trajectory, *, shown: int = 6) -> Any:
    """Backbone of the arm at some waypoints, deformed and rigid, with the path: after [Troise 2021] Figure 10.

    Args:
        trajectory: The trajectory.
        shown: How many poses, evenly spaced.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no trajectory, or `shown` is not positive.
        MissingDependency: If matplotlib is not installed.
    """
    positive_integer("shown", shown)
    figure = _figure(trajectory, (8.0, 6.4))
    axes = figure.add_subplot(projection="3d")
    model = trajectory.model
    chosen = np.unique(np.linspace(0, len(trajectory.times) - 1, shown).round().astype(int))
    everything = [trajectory.tip_positions]
    for count, place in enumerate(chosen):
        equilibrium = trajectory.equilibria[place]
        shade = 0.75 - 0.65 * count / max(len(chosen) - 1, 1)
        loaded = backbone(model, equilibrium.q)
        rigid = backbone(model, model.configuration(equilibrium.q_motors))
        first = count == 0
        axes.plot(*rigid.T, color="#7f7f7f", lw=1.0, ls=":", label="rigid arm, same motor angles" if first else None)
        axes.plot(
            *loaded.T,
            color=(shade, shade, shade),
            lw=2.5,
            marker="o",
            ms=3.5,
            label="loaded arm, later is darker" if first else None,
        )
        everything.append(loaded)
    axes.plot(*trajectory.tip_positions.T, color=COLOURS[1], lw=2.0, ls="--", label="path of the tip")
    everything.append(force_arrow(axes, trajectory.equilibria[-1]))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="Loaded arm along the path")
    equal_box(axes, np.vstack(everything))
    axes.legend(loc="upper left", fontsize=9)
    return figure


def motor_angles(trajectory: Trajectory, rigid: Trajectory) -> Any:
    """Motor angles that compensate the sag beside those of rigid inverse kinematics: after [Troise 2021] Figure 11.

    Args:
        trajectory: The compensated trajectory.
        rigid: The trajectory of the unloaded arm through the same targets.

    Returns:
        The figure.

    Raises:
        ParameterError: If one of them is no trajectory, or they differ in length.
        MissingDependency: If matplotlib is not installed.
    """
    figure = _figure(trajectory, (8.0, 5.0))
    _check(rigid)
    if len(rigid.times) != len(trajectory.times):
        raise ParameterError("rigid", len(rigid.times), f"a trajectory with {len(trajectory.times)} waypoints")
    axes = figure.add_subplot()
    every = max(len(trajectory.times) // 10, 1)
    for number, name in enumerate(trajectory.model.motor_joints):
        colour, marker = COLOURS[number % 6], MARKERS[number % 6]
        style = {"color": colour, "marker": marker, "markevery": every, "ms": 5}
        axes.plot(trajectory.times, trajectory.q_motors[:, number], label=f"{plain_words(name)}, elastic", **style)
        axes.plot(rigid.times, rigid.q_motors[:, number], ls="--", mfc="white", label=f"{plain_words(name)}, rigid", **style)
    axes.set(xlabel="time [s]", ylabel="motor angle [rad]", title="Motor angles: elastic and rigid inverse kinematics")
    axes.grid(alpha=0.3)
    axes.legend(ncols=min(trajectory.model.n_motors, 3), fontsize=9, loc="upper center", bbox_to_anchor=(0.5, -0.14))
    return figure


def tip_errors(errors: dict[str, FloatArray], times: FloatArray) -> Any:
    """Distance of the tip from its target over time, one line a method, logarithmic.

    Args:
        errors: Distance by label, each shape (n,) [m].
        times: Times, shape (n,) [s].

    Returns:
        The figure.

    Raises:
        ParameterError: If shapes differ or a number is not finite.
        MissingDependency: If matplotlib is not installed.
    """
    moments = finite_array("times", times, (None,), "s")
    lines = {label: finite_array(f"errors[{label!r}]", error, moments.shape, "m") for label, error in errors.items()}
    figure = new_figure((8.0, 4.4))
    axes = figure.add_subplot()
    every = max(len(moments) // 10, 1)
    for number, (label, error) in enumerate(lines.items()):
        axes.semilogy(
            moments,
            np.maximum(error, 1e-16) * 1e3,
            markevery=every,
            label=label,
            **line_style(number),
        )
    axes.set(xlabel="time [s]", ylabel="tip error [mm]", title="Distance of the loaded tip from its target")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    return figure


def link_moments(trajectory: Trajectory) -> Any:
    """Moment at each inflated link over time, with the wrinkling moment at the pressure of the arm.

    Args:
        trajectory: A trajectory of a robot with inflated links.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no trajectory or its robot names no inflated links.
        MissingDependency: If matplotlib is not installed.
    """
    figure = _figure(trajectory, (8.0, 4.4))
    moments = trajectory.link_moments
    if moments is None:
        raise ParameterError("trajectory", trajectory.model, "of a robot with inflated links")
    axes = figure.add_subplot()
    every = max(len(trajectory.times) // 10, 1)
    for number, moment in enumerate(moments.T):
        axes.plot(trajectory.times, moment, markevery=every, label=f"link {number + 1}", **line_style(number))
    limits = {(group.wrinkling_moment, group.pressure) for group in trajectory.model.spring_groups}
    for limit, pressure in sorted(limits):
        axes.axhline(limit, color="black", lw=1.0)
        axes.annotate(
            f"wrinkling moment at {pressure / 1e3:g} kPa",
            (trajectory.times[0], limit),
            xytext=(4, 4),
            textcoords="offset points",
            fontsize=9,
        )
    top = 1.12 * max(float(moments.max()), *(limit for limit, _ in limits))
    axes.set(xlabel="time [s]", ylabel="moment [N m]", title="Moment at the springs of each link", ylim=(0.0, top))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    return figure


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
        Where the arrow ends, or nothing, shape (0 or 1, 3) [m]; for `equal_box`.
    """
    tip = equilibrium.tip_position
    wrench = equilibrium.load.wrenches.get(equilibrium.model.tip)
    if wrench is None or not wrench[:3].any():
        return np.zeros((0, 3))
    size = float(np.linalg.norm(wrench[:3]))
    arrow = 0.2 * equilibrium.model.reach * wrench[:3] / size
    axes.quiver(*tip, *arrow, color=COLOURS[2], lw=2.0, label=f"force, {size:.1f} N")
    return np.asarray(tip + arrow)[None]


def _figure(trajectory: Trajectory, size: tuple[float, float]) -> Any:
    _check(trajectory)
    return new_figure(size)


def _check(trajectory: Trajectory) -> None:
    if not isinstance(trajectory, Trajectory):
        raise ParameterError("trajectory", trajectory, "a Trajectory")


def write_png(figure: Any, path: str | Path, *, overwrite: bool) -> Path:
    """Write a figure as PNG, whole or not at all, and return its path.

    Raises:
        ParameterError: If the path is none.
        OutputExists: If the file exists and `overwrite` is false, or is a folder.
        OutputError: If the file cannot be written.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return write_bytes(path, picture.getvalue(), overwrite=overwrite)


def new_figure(size: tuple[float, float]) -> Any:
    """Make an empty figure of a size in inches.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    return require_matplotlib()(figsize=size, layout="constrained", dpi=120)
