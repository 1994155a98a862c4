"""Figure of one loaded robot, whatever it is made of. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import backbone
from softrobots.view.figures import body_plots
from softrobots.view.figures.plots import equal_box, force_arrow, new_figure, plain_words

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
    if not isinstance(equilibrium, Equilibrium):
        raise ParameterError("equilibrium", equilibrium, "an Equilibrium")
    model = equilibrium.model
    if model.structure.section_table:
        return body_plots.shape(equilibrium)
    figure = new_figure((7.0, 6.4))
    axes = figure.add_subplot(projection="3d")
    loaded, relaxed = backbone(model, equilibrium.q), backbone(model, model.configuration(equilibrium.q_motors))
    axes.plot(*relaxed.T, color=_RELAXED, lw=1.2, ls=":", label="relaxed springs, same motors")
    axes.plot(*loaded.T, color=_LOADED, lw=2.5, marker="o", ms=4.0, label="loaded")
    arrow = force_arrow(axes, equilibrium)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{plain_words(model.pinocchio.name)} under load")
    equal_box(axes, np.vstack([loaded, relaxed, arrow]))
    axes.legend(loc="upper left", fontsize=9)
    return figure
