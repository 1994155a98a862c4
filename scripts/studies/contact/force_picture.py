"""Figure of the forces along a path in contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import instance_of
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.view.figures.canvas import WIDTH, line_style, new_plot, plain_words


def contact_forces(path: ContactPath, *, parameter: str = "parameter [-]") -> Any:
    """Sum of the sizes of the forces of each obstacle on the robot along a path; vertical lines where the robot jumps.

    Args:
        path: The path.
        parameter: What its parameter is, for the axis.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no `ContactPath`.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("path", path, ContactPath, "a ContactPath")
    texts = {"xlabel": parameter, "ylabel": "force on the robot [N]", "title": "Forces of obstacles"}
    figure, axes = new_plot((WIDTH, 4.4), **texts)
    names = dict.fromkeys(contact.obstacle for state in path.contacts for contact in state)
    for number, name in enumerate(names):
        forces = [sum(float(np.linalg.norm(one.force)) for one in state if one.obstacle == name) for state in path.contacts]
        style = line_style(number) | {"markevery": max(len(forces) // 10, 1)}
        axes.plot(path.parameters, forces, label=plain_words(name), **style)
    for number, jump in enumerate(path.jumps):
        axes.axvline(jump.parameter, color="black", lw=1.0, label="" if number else "jump")
    if names or path.jumps:
        axes.legend(fontsize=9)
    return figure
