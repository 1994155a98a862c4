"""Plots of the guide of contact."""

from __future__ import annotations

from typing import Any

import numpy as np

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.view.figures import canvas
from studies.contact import examples
from studies.contact.force_picture import contact_forces

FRICTION = 0.5
"""Coefficient of friction for what a grip holds [-]."""


def margins(weights: FloatArray, leaning: sr.ContactPath) -> Any:
    """Share of the wrinkling moment that is left in each link over the weight, with the wall and without."""
    texts = {"xlabel": "weight on the tip [N]", "ylabel": "share of the wrinkling moment left [-]"}
    figure, axes = canvas.new_plot((canvas.WIDTH, 4.4), title="What the links have left", **texts)
    states = {"free": examples.free_arm(weights), "on the wall": leaning.equilibria}
    number = 0
    for name, shown in states.items():
        left = np.array([state.link_limits.wrinkling_margins for state in shown])
        for link in range(left.shape[1]):
            style = canvas.line_style(number) | {"markevery": max(len(weights) // 8, 1)}
            axes.plot(weights, left[:, link], label=f"{name}, link {link + 1}", **style)
            number += 1
    axes.axhline(0.0, color="black", lw=1.0, label="wrinkles")
    axes.set_ylim(-1.0, 1.05)
    axes.legend(fontsize=9)
    return figure


def grip_forces(path: sr.ContactPath) -> Any:
    """Sum of the normal forces of a helix on a rod over its depth, and the pull along the axis that friction holds."""
    texts = {"xlabel": "depth of the rod [m]", "ylabel": "force [N]", "title": "Grip of the helix"}
    figure, axes = canvas.new_plot((canvas.WIDTH, 4.4), **texts)
    every = max(len(path.parameters) // 10, 1)
    squeeze = [sum(contact.normal_force for contact in state) for state in path.contacts]
    axes.plot(path.parameters, squeeze, label="sum of the normal forces", **canvas.line_style(0) | {"markevery": every})
    held = [holding(state, (0.0, 0.0, 1.0)) for state in path.equilibria]
    words = f"pull that friction of {FRICTION:g} holds"
    axes.plot(path.parameters, held, label=words, **canvas.line_style(1) | {"markevery": every})
    axes.legend(fontsize=9)
    return figure


def holding(state: sr.Equilibrium, direction: Any) -> float:
    """Largest force on the object along a direction that the pressed contacts of a robot hold by friction [N]."""
    pressed = [contact for contact in state.contacts if contact.strict]
    return sr.pull_out_force(pressed, FRICTION, direction).force if pressed else 0.0


def contact_margins() -> Any:
    """The arm of docs/contact.md, free and on the wall."""
    weights = np.linspace(0.0, 60.0, 61)
    return margins(weights, examples.brace(weights))


def contact_grip() -> Any:
    """The helix of docs/contact.md around its rod."""
    return grip_forces(examples.grip(np.linspace(0.0, examples.DEPTH, 49)))


def contact_peg_forces() -> Any:
    """The forces of the pegs of docs/contact.md."""
    path = examples.snake(np.linspace(0.0, examples.STROKE, 61))
    return contact_forces(path, parameter="way of the pegs [m]")
