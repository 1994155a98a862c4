"""The HTML of a page with title and legend: self-contained and offline, served, or in a cell of a notebook."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

from softrobots.core.files import write_text
from softrobots.version import __version__
from softrobots.view.appearance import Colour, rgb
from softrobots.view.legend import LegendEntry
from softrobots.view.meshcat_page.page_commands import packed, read_page, tidied

_HINT = "Drag or arrow keys: turn. Wheel, two fingers, + or -: nearer or farther."


@dataclass(frozen=True)
class InlinePage:
    """A self-contained page that Jupyter shows if it is the last expression of a cell.

    It is an iframe that holds the whole page: it needs no server, Jupyter extension or network, and is saved with the
    notebook.
    """

    page: str
    """HTML text of the page."""
    height: int = 480
    """Height in the notebook [px]; it is as wide as the cell."""

    def write_html(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write the page to a file, and return its path.

        Raises:
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If it cannot be written; then nothing is changed.
        """
        return write_text(path, self.page, overwrite=overwrite)

    def _repr_html_(self) -> str:
        """Return the iframe for Jupyter."""
        return (
            f'<iframe title="softrobots" srcdoc="{html.escape(self.page)}" '
            f'style="width:100%;height:{self.height}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        """Return a short text for consoles; the page itself is a megabyte."""
        return f"InlinePage({len(self.page)} characters, height={self.height})"


def page_text(static: str, title: str, legend: Sequence[LegendEntry]) -> str:
    """Return a self-contained page of what a page of meshcat shows.

    The same scene gives the same text. The browser unpacks it with its own `DecompressionStream` and requests no other file.

    Args:
        static: Meshcat's page, from `static_html`.
        title: Title of the page.
        legend: Colour and meaning of each thing that is drawn.

    Returns:
        The page.

    Raises:
        ViewerError: If meshcat's page is not as meshcat 0.3.2 writes it.
    """
    script, commands = read_page(static)
    ordered = tidied(commands)
    moves = ordered and b"set_animation" in ordered[-1]
    hint = _HINT + (" Space or Controls: pause. Controls: time." if moves else "")
    scene = _filled("packed_scene.html", packed=packed(script, ordered))
    generator = f'\n<meta name="generator" content="softrobots {__version__}">'
    return _page(title, f"{legend_rows(legend)}\n", hint, scene, generator)


def live_page(title: str) -> str:
    """Return the page that the meshcat server serves: it follows the commands of the server and shows its legend."""
    return _page(title, '<div id="softrobots-rows"></div>', _HINT, _filled("served_scene.html"))


def legend_rows(legend: Sequence[LegendEntry]) -> str:
    """Return the HTML of a legend: one line for each colour and meaning, the colour as background of an empty `span`."""
    rows = (f'\n<div><span style="background:{_swatch(entry)}"></span>{html.escape(entry.meaning)}</div>' for entry in legend)
    return "".join(rows)


def _page(title: str, rows: str, hint: str, scene: str, head: str = "") -> str:
    """The frame that written and served pages share."""
    return _filled("page.html", title=html.escape(title), rows=rows, hint=hint, scene=scene, head=head) + "\n"


def _filled(template: str, **values: str) -> str:
    """Fill a template beside this module: `$fit` is the script that scales the robot to the window."""
    folder = Path(__file__).parent
    fit = folder.joinpath("fit.js").read_text(encoding="utf-8").rstrip("\n")
    return Template(folder.joinpath(template).read_text(encoding="utf-8").rstrip("\n")).substitute(values, fit=fit)


def _swatch(entry: LegendEntry) -> str:
    """The background of an entry of the legend in CSS."""
    colour = _css(entry.colour)
    return f"repeating-linear-gradient(90deg,{colour} 0 4px,#fff 4px 7px)" if entry.dashed else colour


def _css(colour: Colour) -> str:
    """A colour of the legend in CSS, with twice the opacity of transparent ones."""
    if isinstance(colour, int):
        return f"#{colour:06x}"
    red, green, blue = rgb(colour)
    opacity = min(1.0, 2.0 * colour[3]) if len(colour) == 4 and colour[3] < 1.0 else 1.0
    return f"rgba({red},{green},{blue},{opacity:g})"
