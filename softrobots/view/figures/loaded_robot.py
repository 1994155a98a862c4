"""Figures of one loaded robot: the body of its sections, or the line through its joints. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, instance_of
from softrobots.core.errors import ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import backbone
from softrobots.view.actuator_curves import actuator_curves
from softrobots.view.body import BentSections, body_at
from softrobots.view.figures.canvas import COLOURS, equal_box, force_arrow, new_space, plain_words
from softrobots.view.figures.surroundings import draw_surroundings
from softrobots.view.legend import tension_entries
from softrobots.view.tension_scale import drawn_actuators, scale_end, tension_colour

_LINE = COLOURS[0]
_DASHED = (0, (2.5, 2))
_LOADED = "#303030"
_RELAXED = "#7f7f7f"


def loaded_shape(equilibrium: Equilibrium) -> Any:
    """A loaded robot beside itself with relaxed springs: of sections their smooth body, of others the line through the joints.

    Args:
        equilibrium: The loaded robot.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no equilibrium.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("equilibrium", equilibrium, Equilibrium, "an Equilibrium")
    model = equilibrium.model
    if model.structure.section_table:
        return shape(equilibrium)
    figure, axes = new_space((7.0, 6.4), f"{plain_words(model.pinocchio.name)} under load")
    loaded, relaxed = backbone(model, equilibrium.q), backbone(model, model.configuration(equilibrium.q_motors))
    axes.plot(*relaxed.T, color=_RELAXED, lw=1.2, ls=":", label="relaxed springs, same motors")
    axes.plot(*loaded.T, color=_LOADED, lw=2.5, marker="o", ms=4.0, label="loaded")
    arrow = force_arrow(axes, equilibrium)
    around = draw_surroundings(axes, equilibrium, loaded)
    equal_box(axes, np.vstack([loaded, relaxed, arrow, around]))
    axes.legend(loc="upper left", fontsize=9)
    return figure


def shape(equilibrium: Equilibrium) -> Any:
    """Backbone, outline and actuators of a loaded robot with sections; dotted: its backbone without load; dashed: slack.

    Args:
        equilibrium: The loaded robot.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no equilibrium of a robot with sections.
        MissingDependency: If matplotlib is not installed.
    """
    if not isinstance(equilibrium, Equilibrium) or not equilibrium.model.structure.section_table:
        raise ParameterError("equilibrium", equilibrium, "an Equilibrium of a robot with sections")
    figure, axes = new_space((7.0, 7.0), "Shape under load")
    from matplotlib.lines import Line2D

    model = equilibrium.model
    sections = BentSections(model, equilibrium.q_motors, equilibrium.q_springs)
    segments, curves = sections.segments(12), actuator_curves(sections, model.muscles)
    actuators = drawn_actuators(model.muscles, curves, equilibrium.muscle_forces)
    lengths_given = model.muscle_input == "lengths" or not model.muscles
    unloaded = body_at(model, equilibrium.q_motors, model.rest) if lengths_given else ()
    meaning = "without load, same muscle lengths" if model.muscles else "without load"
    for segment in unloaded:
        axes.plot(*segment.backbone.T, color="0.5", lw=1.5, ls=":", label=meaning)
    for segment in segments:
        axes.plot(*segment.backbone.T, color="0.15", lw=3.0, label="backbone")
        for name, points in segment.lines.items():
            axes.plot(*points.T, color=_LINE, lw=1.6, label=name)
        turned = float(np.arccos(np.clip(np.sum(segment.poses[1:, :3, 2] * segment.poses[:-1, :3, 2], axis=1), -1, 1)).sum())
        rings = max(6, round(turned / 0.7))
        for pose in segment.poses[:: max(1, len(segment.poses) // rings)]:
            axes.plot(*_circle(pose, segment.radius).T, color="0.7", lw=0.8)
        axes.plot(*_circle(segment.poses[-1], segment.radius).T, color="0.35", lw=1.6, label="end of a segment")
    end = scale_end(equilibrium.muscle_forces.tolist())
    for curve, tension, slack in actuators:
        axes.plot(*curve.shown.T, color=tension_colour(tension, end), lw=1.6, ls=_DASHED if slack else "-")
    arrow = force_arrow(axes, equilibrium)
    around = draw_surroundings(axes, equilibrium, np.concatenate([segment.backbone for segment in segments]))
    equal_box(axes, np.concatenate([arrow, around, *(segment.backbone for segment in (*segments, *unloaded))]))
    handles, labels = axes.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))  # one line of each meaning
    for colour, meaning, dashed in tension_entries([actuators]):
        named[plain_words(meaning)] = Line2D([], [], color=colour, lw=1.6, ls=_DASHED if dashed else "-")
    axes.legend(named.values(), named.keys(), loc="upper left", fontsize=9)
    return figure


def _circle(pose: FloatArray, radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    flat = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    return np.asarray(pose[:3, 3] + flat @ pose[:3, :3].T)
