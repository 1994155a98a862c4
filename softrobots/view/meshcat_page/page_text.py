"""The HTML of a page with title and legend: self-contained and offline, or served."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from softrobots.core.errors import ViewerError
from softrobots.version import __version__
from softrobots.view.meshcat_page.page_commands import packed, read_page, tidied, unpacked

Colour = tuple[float, ...] | int
"""Red, green, blue and perhaps opacity in [0, 1], or a number as in HTML."""

_SCENE = re.compile(r'<script id="softrobots-scene" type="text/plain">([^<]*)</script>')

_STYLE = """
  body { margin: 0; }
  #meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
  #softrobots-legend, #softrobots-hint { position: absolute; left: 12px; z-index: 1; pointer-events: none; color: #222;
    font: 13px/1.5 sans-serif; }
  #softrobots-legend { top: 10px; }
  #softrobots-legend b { display: block; }
  #softrobots-legend span { display: inline-block; width: 1.1em; height: 0.8em; margin-right: 0.5em; border: 1px solid #888; }
  #softrobots-hint { bottom: 8px; color: #555; }
  @media (max-width: 640px) { #softrobots-legend { top: 30px; font-size: 12px; } }
""".strip("\n")

_HINT = "Drag: turn. Wheel or two fingers: nearer."

_NOTICE = """
Packed below with what they draw are MeshCat, Copyright (c) 2018 Robin Deits, and three.js, Copyright (c) 2010-2021 Three.js
Authors, both under the MIT License: Permission is hereby granted, free of charge, to any person obtaining a copy of this
software and associated documentation files (the "Software"), to deal in the Software without restriction, including without
limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to
permit persons to whom the Software is furnished to do so, subject to the following conditions: The above copyright notice and
this permission notice shall be included in all copies or substantial portions of the Software. THE SOFTWARE IS PROVIDED "AS
IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS
FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM,
DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE
SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
""".strip()

# A window narrower than seven to five is scaled down, so that it shows the same width.
_FIT = """
    const fit = () => { viewer.camera.zoom = Math.min(1, innerWidth / innerHeight / 1.4); viewer.set_dirty(); };
    addEventListener("resize", fit);
""".strip("\n")

_LOADER = """
  (async () => {
    const text = document.getElementById("softrobots-scene").textContent;
    const stream = new Blob([Uint8Array.from(atob(text), letter => letter.charCodeAt(0))]).stream();
    const unpacked = await new Response(stream.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
    const bytes = new Uint8Array(unpacked), end = bytes.indexOf(10), decoder = new TextDecoder();
    const {lengths, commands} = JSON.parse(decoder.decode(bytes.subarray(0, end)));
    let from = end + 1;
    const pieces = lengths.map(length => bytes.subarray(from, from += length));
    const script = document.createElement("script");
    script.textContent = decoder.decode(pieces[0]);
    document.head.append(script);
    const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
FIT
    for (const numbers of commands) {
      const parts = numbers.map(number => pieces[number]);
      const command = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
      parts.reduce((at, part) => { command.set(part, at); return at + part.length; }, 0);
      viewer.handle_command_bytearray(command);
    }
    viewer.gui.__folders.Scene.close();
    fit();
    window.viewer = viewer;
  })().catch(error => {
    document.getElementById("softrobots-hint").textContent = "This page needs WebGL and a browser of 2023 or newer: " + error;
    throw error;
  });
""".strip("\n").replace("FIT", _FIT)

# Meshcat's script handles the commands of the server, except that of the legend, which it does not know.
_FOLLOWER = """
  {
    const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
FIT
    const draw = viewer.handle_command.bind(viewer), legend = document.getElementById("softrobots-rows");
    viewer.handle_command = command => { command.type === "legend" ? legend.innerHTML = command.text : draw(command); };
    viewer.connect();
    viewer.connection.addEventListener("close", () => {
      document.getElementById("softrobots-hint").textContent = "The program that showed this robot has ended.";
    });
    viewer.gui.__folders.Scene.close();
    fit();
    window.viewer = viewer;
  }
""".strip("\n").replace("FIT", _FIT)


def page_text(static: str, title: str, legend: Sequence[tuple[Colour, str]]) -> str:
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
    hint = _HINT + (" Controls: pause, time." if moves else "")
    scene = f"""<!-- {_NOTICE} -->
<script id="softrobots-scene" type="text/plain">{packed(script, ordered)}</script>
<script>
{_LOADER}
</script>"""
    generator = f'\n<meta name="generator" content="softrobots {__version__}">'
    return _page(title, f"{legend_rows(legend)}\n", hint, scene, generator)


def live_page(title: str) -> str:
    """Return the page that the meshcat server serves: it follows the commands of the server and shows its legend.

    Args:
        title: Title of the page.

    Returns:
        The page.
    """
    follower = f'<script src="main.min.js"></script>\n<script>\n{_FOLLOWER}\n</script>'
    return _page(title, '<div id="softrobots-rows"></div>', _HINT, follower)


def legend_rows(legend: Sequence[tuple[Colour, str]]) -> str:
    """Return the HTML of a legend: one line for each colour and meaning, the colour as background of an empty `span`."""
    rows = (f'\n<div><span style="background:{_css(colour)}"></span>{html.escape(text)}</div>' for colour, text in legend)
    return "".join(rows)


def scene_of(page: str) -> tuple[str, list[bytes]]:
    """Return script and drawing commands of a page of `page_text`, for comparisons.

    Raises:
        ViewerError: If it is no such page.
    """
    match = _SCENE.search(page)
    if match is None:
        raise ViewerError("this page was not made by softrobots: it holds no packed scene")
    return unpacked(match[1])


def _page(title: str, rows: str, hint: str, scene: str, head: str = "") -> str:
    """The frame that written and served pages share."""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">{head}
<title>{html.escape(title)}</title>
<style>
{_STYLE}
</style>
</head>
<body>
<div id="softrobots-legend"><b>{html.escape(title)}</b>{rows}</div>
<div id="softrobots-hint">{hint}</div>
<div id="meshcat-pane"></div>
{scene}
</body>
</html>
"""


def _css(colour: Colour) -> str:
    """A colour of the legend in CSS, with twice the opacity of transparent ones."""
    if isinstance(colour, int):
        return f"#{colour:06x}"
    red, green, blue = (round(255 * value) for value in colour[:3])
    opacity = min(1.0, 2.0 * colour[3]) if len(colour) == 4 and colour[3] < 1.0 else 1.0
    return f"rgba({red},{green},{blue},{opacity:g})"
