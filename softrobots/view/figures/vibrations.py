"""Figures of vibration modes. Needs matplotlib (extra `plot`).

The functions return a `matplotlib.figure.Figure`; save it with `figure.savefig(path)`.
"""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, instance_of, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.dynamics.vibration import ModeSwing, VibrationModes
from softrobots.view.body import robot_line
from softrobots.view.figures.canvas import COLOURS, new_figure

SWING = 0.12
"""How far a mode swings in pictures, as a share of the reach."""

_STILL = 1e-3  # of the swing: a backbone that moves less only twists


def mode_shapes(modes: VibrationModes, *, shown: int = 6) -> Any:
    """Both ends of the swing in each mode, over the robot in equilibrium, seen square to the motion.

    Args:
        modes: The modes.
        shown: How many of them are drawn at most, slowest first.

    Returns:
        The figure.

    Raises:
        ParameterError: If there are no modes, or `shown` is not positive.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("modes", modes, VibrationModes, "VibrationModes (made by softrobots.vibration_modes)")
    if not len(modes.frequencies):
        raise ParameterError("modes", modes.model, "at least one; a robot without springs has none while its motors are held")
    count = min(positive_integer("shown", shown), len(modes.frequencies))
    columns = min(count, 2)
    rows = math.ceil(count / columns)
    figure = new_figure((3.4 * columns, 0.5 + 2.2 * rows))
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for panel in panels[count:]:
        panel.set_axis_off()
    for number, panel in enumerate(panels[:count], start=1):
        _draw(panel, _seen(modes, number))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=11)
    return figure


def _seen(modes: VibrationModes, mode: int) -> ModeSwing:
    """A swing of `SWING`, or up to three times that where the line of the robot moves less."""
    usual = SWING * modes.model.reach
    swing = modes.swing(mode, usual)
    one, other = (robot_line(modes.model, *swing.at(share)) for share in (0.25, -0.25))
    moved = 0.5 * float(np.linalg.norm(one - other, axis=1).max())
    with contextlib.suppress(ParameterError):  # a section beyond its range
        return modes.swing(mode, usual * float(np.clip(usual / max(moved, 1e-12), 1.0, 3.0)))
    return swing


def _draw(panel: Any, swing: ModeSwing) -> None:
    """Draw one mode into one pair of axes."""
    modes, model = swing.modes, swing.model
    middle, one, other = (robot_line(model, *swing.at(share)) for share in (0.0, 0.25, -0.25))
    way = one - other
    across, sizes = np.linalg.svd(way, full_matrices=False)[2][0], np.linalg.norm(way, axis=1)
    along = middle - middle.mean(axis=0)
    along -= np.outer(along @ across, across)
    first = np.linalg.svd(along, full_matrices=False)[2][0]
    first *= np.sign(float(first @ (middle[-1] - middle[0])) or 1.0)
    across *= np.sign(across[int(np.argmax(np.abs(across)))])
    flat = np.column_stack([first, across])
    for points, style, label in (
        (one, {"color": COLOURS[0], "lw": 3.0}, "one end of the swing"),
        (other, {"color": COLOURS[1], "lw": 3.0, "ls": "--"}, "the other"),
        (middle, {"color": "0.3", "lw": 1.6, "ls": ":"}, "equilibrium"),
    ):
        panel.plot(*(points @ flat).T, label=label, **style)
    place = swing.mode - 1
    motion = _words(across) if sizes.max(initial=0.0) > _STILL * swing.size else ", twists"
    damping = f"damping ratio {modes.damping_ratios[place]:.3g}"
    panel.set_title(f"{swing.mode}: {modes.frequencies[place]:.4g} Hz{motion}\n{damping}", fontsize=12)
    panel.set_aspect("equal", adjustable="datalim")
    panel.margins(0.1)
    panel.set(xticks=[], yticks=[])


def _words(direction: FloatArray) -> str:
    """The axis or plane of the world that a direction is in, within two degrees, for a title; nothing if it is in none."""
    small = np.abs(direction) < math.sin(math.radians(2.0))
    axes = "".join(axis for axis, none in zip("xyz", small, strict=True) if not none)
    return f", along {axes}" if len(axes) == 1 else f", in {axes}" if len(axes) == 2 else ""
