"""Figures of a trajectory, after Figures 10 and 11 of [Troise 2021]: poses, motor angles, tip errors, moments of links."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, instance_of, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import backbone
from softrobots.statics.trajectory import Trajectory
from softrobots.view.figures.canvas import COLOURS, MARKERS, WIDTH, equal_box, line_style, new_plot, new_space, plain_words


def poses(trajectory: Trajectory, *, shown: int = 6) -> Any:
    """Backbone of the arm at some waypoints, deformed and rigid, with the path: after [Troise 2021] Figure 10.

    Where the targets are poses, the axes of the tip are drawn, too.

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
    instance_of("trajectory", trajectory, Trajectory, "a Trajectory")
    figure, axes = new_space((WIDTH, 6.2), "Loaded arm along the path")
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
        label = "loaded arm, later is darker" if first else None
        axes.plot(*loaded.T, color=(shade, shade, shade), lw=2.5, marker="o", ms=3.5, label=label)
        everything.append(loaded)
        if trajectory.orientations is not None:
            pose = equilibrium.transform_tip_to_world
            for name, shape, axis in zip("xyz", ((0, "-"), (3, "--"), (4, ":")), pose.rotation.T, strict=True):
                line = np.array([pose.translation, pose.translation + 0.07 * model.reach * axis])
                label = f"{name} axis of the tip" if first else None
                axes.plot(*line.T, color=COLOURS[shape[0]], lw=2.0, ls=shape[1], label=label)
    axes.plot(*trajectory.tip_positions.T, color=COLOURS[1], lw=2.0, ls="--", label="path of the tip")
    everything.append(_force_arrow(axes, trajectory.equilibria[-1]))
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
    instance_of("trajectory", trajectory, Trajectory, "a Trajectory")
    instance_of("trajectory", rigid, Trajectory, "a Trajectory")
    if len(rigid.times) != len(trajectory.times):
        raise ParameterError("rigid", len(rigid.times), f"a trajectory with {len(trajectory.times)} waypoints")
    figure, axes = new_plot(
        (WIDTH, 5.0), xlabel="time [s]", ylabel="motor angle [rad]", title="Motor angles: elastic and rigid inverse kinematics"
    )
    every = max(len(trajectory.times) // 10, 1)
    for number, name in enumerate(trajectory.model.motor_joints):
        style = {"color": COLOURS[number % 6], "marker": MARKERS[number % 6], "markevery": every, "ms": 5}
        axes.plot(trajectory.times, trajectory.q_motors[:, number], label=f"{plain_words(name)}, elastic", **style)
        axes.plot(rigid.times, rigid.q_motors[:, number], ls="--", mfc="white", label=f"{plain_words(name)}, rigid", **style)
    axes.legend(ncols=min(trajectory.model.n_motors, 3), fontsize=9, loc="upper center", bbox_to_anchor=(0.5, -0.14))
    return figure


def tip_errors(errors: dict[str, FloatArray], times: FloatArray, *, angles: bool = False) -> Any:
    """Distance of the tip from its target over time, or the angle between them, one line a method, logarithmic.

    Args:
        errors: Distance or angle by label, each shape (n,) [m or rad].
        times: Times, shape (n,) [s].
        angles: Whether they are angles.

    Returns:
        The figure.

    Raises:
        ParameterError: If shapes differ or a number is not finite.
        MissingDependency: If matplotlib is not installed.
    """
    moments = finite_array("times", times, (None,), "s")
    lines = {label: finite_array(f"errors[{label!r}]", error, moments.shape) for label, error in errors.items()}
    title = f"{'Angle' if angles else 'Distance'} of the loaded tip from its target"
    figure, axes = new_plot((WIDTH, 4.4), xlabel="time [s]", ylabel=f"tip error [{'mrad' if angles else 'mm'}]", title=title)
    every = max(len(moments) // 10, 1)
    for number, (label, error) in enumerate(lines.items()):
        axes.semilogy(moments, np.maximum(error, 1e-16) * 1e3, markevery=every, label=label, **line_style(number))
    figure.legend(fontsize=9, loc="outside lower center", ncols=min(len(lines), 2))
    return figure


def link_moments(trajectory: Trajectory) -> Any:
    """Moment at each inflated link over time, with its wrinkling moment at its pressure and axial force.

    Args:
        trajectory: A trajectory of a robot with inflated links.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no trajectory or its robot names no inflated links.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("trajectory", trajectory, Trajectory, "a Trajectory")
    moments = trajectory.link_moments
    if moments is None:
        raise ParameterError("trajectory", trajectory.model, "of a robot with inflated links")
    title = "Moment at the springs of each link"
    figure, axes = new_plot((WIDTH, 4.4), xlabel="time [s]", ylabel="moment [N m]", title=title)
    every = max(len(trajectory.times) // 10, 1)
    for number, moment in enumerate(moments.T):
        axes.plot(trajectory.times, moment, markevery=every, label=f"link {number + 1}", **line_style(number))
    limits = np.array([equilibrium.link_limits.wrinkling_moments for equilibrium in trajectory.equilibria])
    for number, (limit, group) in enumerate(zip(limits.T, trajectory.model.spring_groups, strict=True)):
        label = f"link {number + 1}: wrinkling moment at {group.pressure / 1e3:g} kPa, with axial force"
        axes.plot(trajectory.times, limit, label=label, color=line_style(number)["color"], ls=":", lw=1.5)
    axes.set_ylim(0.0, 1.12 * max(float(moments.max()), float(limits.max())))
    axes.legend(fontsize=9)
    return figure


def _force_arrow(axes: Any, equilibrium: Equilibrium) -> FloatArray:
    """Draw the force at the tip as an arrow a fifth of the reach long; return its end, shape (1, 3) [m], (0, 3) without one."""
    tip = equilibrium.tip_position
    wrench = equilibrium.load.wrenches.get(equilibrium.model.tip)
    if wrench is None or not wrench[:3].any():
        return np.zeros((0, 3))
    size = float(np.linalg.norm(wrench[:3]))
    arrow = 0.2 * equilibrium.model.reach * wrench[:3] / size
    axes.quiver(*tip, *arrow, color=COLOURS[2], lw=2.0, label=f"force {size:.3g} N")
    return np.asarray(tip + arrow)[None]
