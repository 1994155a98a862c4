"""The panel beside a robot in the browser: sliders of its motors and tip force, and a report of the equilibrium."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.view.legend import LegendEntry
from softrobots.view.meshcat_page.page_text import legend_rows
from softrobots.view.slider_ranges import actuator_ends, slider_grid

_LISTED = 6  # most inflated links that are listed one by one

_STYLE = (
    "<style>#softrobots-panel{font:13px/1.5 sans-serif;padding:0 1em .5em} #softrobots-note{font-weight:bold;color:#8b0000}"
    "#softrobots-legend span{display:inline-block;width:1.1em;height:.8em;margin-right:.5em;border:1px solid #888}"
    "#softrobots-state td{padding-right:.8em;vertical-align:top}</style>"
)


class Setting(NamedTuple):
    """Values of all sliders."""

    q_motors: tuple[float, ...]
    """Actuator coordinates [rad, m, N or Pa]."""
    force: tuple[float, ...]
    """Force on the tip [N], world axes."""
    gravity: bool
    """Whether there is gravity."""


class SliderPanel:
    """The panel on a page of viser."""

    def __init__(self, gui: Any, model: SoftModel, start: Setting, full_force: float, *, changed: Callable[[], None]) -> None:
        """Add the panel.

        Args:
            gui: The `viser.GuiApi`.
            model: The robot.
            start: Initial values.
            full_force: Largest force of each slider, to both sides [N].
            changed: Called at every change, in the thread of the server; must not block.
        """
        self._gui, self._changed = gui, changed
        self._reset = False
        ends = actuator_ends(model)
        with gui.add_folder("actuators" if model.n_motors == len(model.muscles) > 0 else "motors", visible=model.n_motors > 0):
            rows = zip(model.motor_joints, model.actuators.units, ends, start.q_motors, strict=True)
            self._motors = [self._slider(name, unit, *between, value) for name, unit, between, value in rows]
        with gui.add_folder("load"):
            force = zip("xyz", start.force, strict=True)
            self._force = [self._slider(f"force {axis}", "N", -full_force, full_force, value) for axis, value in force]
            self._gravity = gui.add_checkbox("gravity", start.gravity)
            self._gravity.on_update(self._moved)
        button = gui.add_button("reset", hint="back to the start, with relaxed springs")

        button.on_click(self._pressed)
        self._text = gui.add_html(_STYLE)

    @property
    def setting(self) -> Setting:
        """The values now."""
        motors, force = (tuple(slider.value for slider in sliders) for sliders in (self._motors, self._force))
        return Setting(motors, force, self._gravity.value)

    def take_reset(self) -> bool:
        """Return whether the reset button was pressed since the last call."""
        pressed, self._reset = self._reset, False
        return pressed

    def move_to(self, setting: Setting) -> None:
        """Move the sliders."""
        values = (*setting.q_motors, *setting.force)
        for slider, value in zip((*self._motors, *self._force), values, strict=True):
            slider.value = value
        self._gravity.value = setting.gravity

    def report(self, equilibrium: Equilibrium, legend: Sequence[LegendEntry], problem: str = "") -> None:
        """Show facts of an equilibrium, the legend, and why there is no equilibrium for the values of the sliders, if so."""
        rows = "".join(f"<tr><td>{name}</td><td>{html.escape(text)}</td></tr>" for name, text in _facts(equilibrium))
        note = f'<div id="softrobots-note">NO EQUILIBRIUM; the picture shows the last one. {html.escape(problem)}</div>'
        self._text.content = (
            f'{_STYLE}<div id="softrobots-panel">{note if problem else ""}<table id="softrobots-state">{rows}</table>'
            f'<div id="softrobots-legend">{legend_rows(legend)}</div></div>'
        )

    def _slider(self, name: str, unit: str, low: float, high: float, value: float) -> Any:
        first, last, step = slider_grid(low, high)
        # Viser shows as many digits as the initial value has.
        handle = self._gui.add_slider(f"{name} [{unit}]", first, last, step, first)
        handle.value = value
        handle.on_update(self._moved)
        return handle

    # Coroutines run in the thread of the server; functions would each take another thread of a pool.
    async def _moved(self, _: Any) -> None:
        self._changed()

    async def _pressed(self, _: Any) -> None:
        self._reset = True
        self._changed()


def _facts(equilibrium: Equilibrium) -> list[tuple[str, str]]:
    """Name and value of each fact of an equilibrium."""
    x, y, z = equilibrium.tip_position.tolist()
    facts = [("tip [m]", f"{x:.4f}  {y:.4f}  {z:.4f}")]
    facts.append(("stability", "stable" if equilibrium.stable else equilibrium.stability.kind))
    for name in ("conservative", "within_limits"):
        facts.append((name.replace("_", " "), "yes" if getattr(equilibrium, name) else "no"))
    groups = equilibrium.model.spring_groups
    left = equilibrium.link_limits.wrinkling_margins.tolist()
    links = [
        f"{'link' if group.segment is None else 'section'} {number}: "
        + ("wrinkled" if share <= 0.0 or flat else f"{100.0 * share:.0f} %")
        for number, (group, share, flat) in enumerate(zip(groups, left, equilibrium.saturated, strict=True), start=1)
    ]
    if len(links) > _LISTED:
        links = [f"least of {len(links)}, {links[int(np.argmin(left))]}"]
    return facts + ([("left to wrinkling", "; ".join(links))] if links else [])
