"""A page without a server: sliders and dragging move a robot, and each equilibrium is solved and certified in the page."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import finite_array, positive_integer
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.view.appearance import LINE_COLOUR, RIGID_COLOUR, TUBE_COLOUR
from softrobots.view.interactive.robot_data import POINTS, robot_data
from softrobots.view.interactive.text import interactive_text
from softrobots.view.legend import LegendEntry
from softrobots.view.meshcat_page.page_text import InlinePage
from softrobots.view.scene import WRINKLING_COLOURS
from softrobots.view.slider_ranges import visible_force


def interactive(
    model: SoftModel,
    *,
    title: str | None = None,
    q_motors: Any = None,
    force: Any = None,
    gravity: Any = None,
    height: int = 560,
) -> InlinePage:
    """Return a page that solves the statics of a robot by itself, in any browser: HTML that requests nothing.

    A cell of a notebook shows it, without server or extension; `write_html` of the result writes it into a file. Sliders move
    motors or muscles, the force on the tip and gravity; the tip can be dragged. The solver in the page is that of
    `softrobots.compile`: each pose is in balance and certified stable. `window.softrobots.solve({motors, force, gravity})` in
    the page returns tip, springs and status. With dry friction a change is a way in small steps from what is shown, and a tip
    that is dragged moves no motors.

    Args:
        model: A robot that `softrobots.compile` takes.
        title: Title of the page; the name of the robot by default.
        q_motors: Actuator coordinates that are shown first, shape (n_motors,) [rad, m, N or Pa], or a mapping by name; relaxed
            by default.
        force: Force on the tip that is shown first, shape (3,) [N], world axes; none by default.
        gravity: Gravity that is shown first, shape (3,) [m/s^2], world axes; None: weightless.
        height: Height in the notebook [px].

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        DescriptionError: If the robot is not a serial chain with linear springs.
        EquilibriumNotFound: If there is no equilibrium at the start.
        ViewerError: If a shape cannot be drawn.
    """
    from softrobots.compiled.run.compiled_model import compile_model

    motors = check_model(model).checked_motors(model.relaxed_motors if q_motors is None else q_motors)
    push = finite_array("force", (0.0, 0.0, 0.0) if force is None else force, (3,), "N")
    weight = None if gravity is None else finite_array("gravity", gravity, (3,), "m/s^2").tolist()
    solver = compile_model(model, backend="python").js_source(points=POINTS)
    solve_equilibrium(model, motors, push, gravity=weight)  # refused here rather than on the page
    largest = max(visible_force(model), float(np.abs(push).max()))
    data = robot_data(solve_equilibrium(model, model.relaxed_motors), largest)
    data["start"] = {"motors": motors.tolist(), "force": push.tolist(), "gravity": weight}
    name = title or str(model.pinocchio.name).replace("_", " ")
    text = interactive_text(data, solver, name, _kinds(model), _legend(model, data))
    return InlinePage(text, positive_integer("height", height, 10_000))


def _kinds(model: SoftModel) -> str:
    """What moves a robot, in a word."""
    if model.n_motors > len(model.muscles) or not model.muscles:
        return "motors"
    return "tendons" if all(tag.name.startswith("tendon") for tag in model.muscles) else "muscles"


def _legend(model: SoftModel, data: dict[str, Any]) -> list[LegendEntry]:
    """Colour and meaning of what is drawn."""
    entries = [LegendEntry(RIGID_COLOUR, "the robot at rest")] * any(solid["elastic"] for solid in data["solids"])
    entries += [LegendEntry(TUBE_COLOUR, "body")] * any(tube["link"] is None for tube in data["tubes"])
    lines = [curve["name"] for curve in data["curves"] if curve["name"] not in model.actuator_names]
    entries += [LegendEntry(LINE_COLOUR, name) for name in lines]
    above = 1.0
    for least, colour in WRINKLING_COLOURS if model.spring_groups else ():
        words = f"{100 * least:.0f} - {100 * above:.0f} % left to wrinkling" if np.isfinite(least) else "wrinkled"
        entries.append(LegendEntry(colour, words))
        above = least
    return entries
