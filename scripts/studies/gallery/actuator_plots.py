"""Plots of the guide of actuators: what each kind exerts, and what dry friction does to a pull."""

from __future__ import annotations

from typing import Any

import numpy as np

import softrobots as sr
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import ActuatorLaws
from softrobots.view.figures import canvas

LENGTH = 0.2
"""Rest length of the actuators whose laws are drawn [m]."""


def actuator_kinds() -> Any:
    """Tension of each kind of actuator over its length, at an input that is told."""
    shares = np.linspace(-0.4, 0.12, 521)
    sizes = {"stiffness": 2000.0, "pretension": 10.0, "area": 3e-4, "diameter": 0.01, "braid_angle": np.radians(25.0)}
    inputs = {"tension": 40.0, "elastic": LENGTH, "pressure": 1e5, "mckibben": 1e5}
    words = {
        "tension": "tension: 40 N given",
        "elastic": "elastic: motor at 0.2 m, 2 N/mm, pretension 10 N",
        "pressure": "pressure: 100 kPa in 3 cm$^2$",
        "mckibben": "mckibben: 100 kPa, 10 mm, braid at 25 degrees",
    }
    texts = {"xlabel": "length of the actuator [m]", "ylabel": "tension [N]", "title": "What an actuator of 0.2 m exerts"}
    figure, axes = canvas.new_plot((canvas.WIDTH, 4.8), **texts)
    for number, (kind, given) in enumerate(inputs.items()):
        law = ActuatorLaws([ActuatorTag(name=kind, route=(), kind=kind, rest_length=LENGTH, **sizes)])
        tensions = [float(law.at(np.array([share * LENGTH]), np.array([given])).tension[0]) for share in shares]
        axes.plot(LENGTH * (1.0 + shares), tensions, label=words[kind], **canvas.line_style(number) | {"marker": None})
    axes.axvline(LENGTH, color="0.3", lw=2.0, label="length: 0.2 m given, any tension")
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.annotate("pulls", (0.1215, 2.0), fontsize=9, color="0.3")
    axes.annotate("pushes", (0.1215, -6.0), fontsize=9, color="0.3")
    axes.set(xlim=(0.12, 0.224), ylim=(-40.0, 100.0))
    axes.legend(fontsize=9, loc="upper left")
    return figure


def dry_friction() -> Any:
    """Tip of an arm over the pull of a tendon that goes there and back, without and with friction."""
    tensions = np.concatenate([np.linspace(0.0, 6.0, 31), np.linspace(5.8, 1.0, 25), np.linspace(1.2, 6.0, 25)])
    texts = {"xlabel": "tension of the tendon [N]", "ylabel": "tip aside [mm]", "title": "A tendon pulled and let go twice"}
    figure, axes = canvas.new_plot((canvas.WIDTH, 4.8), **texts)
    words: dict[str, dict[str, Any]] = {
        "no friction": {},
        "friction of bending: 2 N mm": {"bending_friction": 2e-3},
        "friction in the guides: 0.4": {"guide_friction": 0.4},
    }
    for number, (word, fields) in enumerate(words.items()):
        arm = sr.TendonArm(segment_lengths=(0.06,), bending_stiffness=2e-3, tendon_azimuths=(0.0,), kind="tension", **fields)
        model, found, aside = sr.load_model(arm), None, []
        for tension in tensions:
            found = sr.solve_equilibrium(model, (tension,), previous=found)
            aside.append(1e3 * found.tip_position[0])
        axes.plot(tensions, aside, label=word, **canvas.line_style(number) | {"marker": None})
    axes.legend(fontsize=9)
    return figure
