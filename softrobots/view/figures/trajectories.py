"""Figure of a trajectory, after Figure 10 of [Troise 2021]. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import instance_of, positive_integer
from softrobots.statics.kinematics import backbone
from softrobots.statics.trajectory import Trajectory
from softrobots.view.figures.canvas import COLOURS, WIDTH, equal_box, force_arrow, new_space


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
    everything.append(force_arrow(axes, trajectory.equilibria[-1]))
    equal_box(axes, np.vstack(everything))
    axes.legend(loc="upper left", fontsize=9)
    return figure
