"""The text of a page that solves by itself: drawing, solver and scripts in one HTML file without requests."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

from softrobots.version import __version__
from softrobots.view.legend import LegendEntry
from softrobots.view.meshcat_page.page_commands import packed
from softrobots.view.meshcat_page.page_text import legend_rows

_SCENE = ("shapes", "surroundings", "camera", "arrow", "robot_scene")
_PAGE = ("solutions", "showing", "status", "controls", "tensions", "dragging", "turning", "state", "api", "loop")


def interactive_text(data: dict[str, Any], solver: str, title: str, actuators: str, legend: Sequence[LegendEntry]) -> str:
    """Return the page. The same robot and the same version give the same text.

    Args:
        data: The robot, from `robot_data`, and the state that is shown first.
        solver: Text in JavaScript with a function `makeSolver`.
        title: Title of the page.
        actuators: What moves the robot, e.g. "motors".
        legend: Colour and meaning of what is drawn.
    """
    robot = f"const PAGE_DATA = {json.dumps(json.dumps(data, separators=(',', ':'), allow_nan=False))};\n"
    scripts = [robot, solver, _start_page()]
    values = {
        "title": html.escape(title),
        "actuators": actuators,
        "legend": legend_rows(legend),
        "style": _file("page.css").rstrip("\n"),
        "licence": _licence(),
        "packed": packed(_three(), [text.encode() for text in scripts]),
        "version": __version__,
    }
    return Template(_file("page.html")).substitute(values)


def _start_page() -> str:
    """The function that starts the page: the files beside this module, one behind the other, share its names."""
    pieces = [_file(f"{name}.js") for name in (*_SCENE, *_PAGE)]
    return "\n".join(["function startPage() {", '"use strict";', *pieces, "return window.softrobots;", "}"])


def _three() -> str:
    """Meshcat's script, which holds three.js."""
    import meshcat

    return (Path(meshcat.__file__).parent / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


def _licence() -> str:
    """The end of the notice of licence, as on the other pages."""
    notice = (Path(__file__).parent.parent / "meshcat_page" / "packed_scene.html").read_text(encoding="utf-8")
    return notice[notice.index("Authors, both") : notice.index("-->") + 3]


def _file(name: str) -> str:
    """A text beside this module."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")
