"""Draw the rooms of the package: folders of `softrobots/` as boxes in layers, with an arrow for each import between them.

Read from the imports of the source. A room stands above all rooms that it imports. An arrow that follows from others is left
out: `view` imports `core`, and `model`, which imports `core`. With --check nothing is written; status 1 if it shows other
rooms or imports than there are, or a room that has grown or shrunk by more than a fifth.
"""

from __future__ import annotations

import argparse
import ast
import io
import itertools
import json
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import write_bytes
from softrobots.view.figures.canvas import require_matplotlib

PACKAGE = Path(sr.__file__).resolve().parent
PICTURE = PACKAGE.parent / "docs" / "images" / "architecture.png"
KEY = "Rooms"
"""Entry of the PNG file that says as JSON what is drawn."""
WIDTH, HEIGHT, GAP, RISE, LANE = 3.3, 2.2, 0.4, 2.9, 0.35
"""Width and height of a box, gap between boxes, distance of layers, width of an arrow that passes a layer [inch]."""
TOLERANCE = 0.2
"""Share by which the lines of a room may differ from the picture."""


class Room(NamedTuple):
    """A folder of the package."""

    purpose: str
    """First line of its docstring."""
    modules: int
    lines: int
    imports: tuple[str, ...]
    """Rooms that its modules import."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--output", type=Path, default=PICTURE, metavar="FILE", help="PNG file (docs/images/architecture.png)")
    result.add_argument("--check", action="store_true", help="compare the file with the source instead of writing it")
    return result


def read_rooms(package: Path = PACKAGE) -> dict[str, Room]:
    """Read the rooms of a package, by name."""
    names = sorted(path.parent.name for path in package.glob("*/__init__.py"))
    rooms = {}
    for name in names:
        texts = [path.read_text(encoding="utf-8") for path in sorted((package / name).rglob("*.py"))]
        imported = {other for text in texts for other in imported_rooms(text)} & set(names) - {name}
        docstring = ast.get_docstring(ast.parse((package / name / "__init__.py").read_text(encoding="utf-8"))) or ""
        purpose = docstring.partition("\n")[0].partition(";")[0].rstrip(".").replace("`", "")
        rooms[name] = Room(purpose, len(texts), sum(text.count("\n") for text in texts), tuple(sorted(imported)))
    return rooms


def imported_rooms(text: str) -> Iterator[str]:
    """Second parts of the names `softrobots.ROOM...` that a module imports, also inside functions."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            yield from (f"{node.module}.{alias.name}".split(".")[1] for alias in node.names if within(node.module))
        elif isinstance(node, ast.Import):
            yield from (alias.name.split(".")[1] for alias in node.names if within(alias.name) and "." in alias.name)


def within(module: str) -> bool:
    """Whether a module is one of the package."""
    return module.partition(".")[0] == "softrobots"


def reached(rooms: dict[str, Room], name: str) -> set[str]:
    """Every room that a room imports, directly or through others."""
    direct = rooms[name].imports
    return {*direct, *(other for room in direct for other in reached(rooms, room))}


def arrows(rooms: dict[str, Room]) -> list[tuple[str, str]]:
    """Imports that do not follow from others."""
    pairs = [(name, other) for name, room in rooms.items() for other in room.imports]
    return [(a, b) for a, b in pairs if not any(b in reached(rooms, middle) for middle in rooms[a].imports)]


def level(rooms: dict[str, Room], name: str) -> int:
    """How many rooms stand below a room, one on another."""
    return max((1 + level(rooms, other) for other in rooms[name].imports), default=0)


class Layout:
    """Rooms in layers, with lanes for the arrows that pass a layer; ordered so that few arrows cross."""

    def __init__(self, rooms: dict[str, Room]) -> None:
        """Place the rooms."""
        self.levels = {name: level(rooms, name) for name in rooms}
        self.layers = [[name for name in rooms if self.levels[name] == n] for n in range(max(self.levels.values()) + 1)]
        self.routes = []
        for start, end in arrows(rooms):
            passed = range(self.levels[start] - 1, self.levels[end], -1)
            lanes = [f"{start} to {end} at {n}" for n in passed]
            for n, lane in zip(passed, lanes, strict=True):
                self.layers[n].append(lane)
                self.levels[lane] = n
            self.routes.append([start, *lanes, end])
        self.links = [link for route in self.routes for link in itertools.pairwise(route)]
        self.boxes = set(rooms)
        best = self.cost()
        while True:
            for n, layer in enumerate(self.layers):
                orders = itertools.permutations(layer)
                self.layers[n] = list(min(orders, key=lambda order, n=n: self.cost({n: list(order)})))
            if self.cost() >= best:
                break
            best = self.cost()
        self.x = self.places()

    def places(self, changed: dict[int, list[str]] | None = None) -> dict[str, float]:
        """Abscissa of every box and lane: each layer side by side, centred."""
        x = {}
        for n, layer in enumerate(self.layers):
            names = (changed or {}).get(n, layer)
            widths = [WIDTH if name in self.boxes else LANE for name in names]
            left = -(sum(widths) + GAP * (len(names) - 1)) / 2
            for name, width in zip(names, widths, strict=True):
                x[name] = left + width / 2
                left += width + GAP
        return x

    def cost(self, changed: dict[int, list[str]] | None = None) -> tuple[int, float]:
        """Crossings of arrows, then how far they lead sideways."""
        x = self.places(changed)
        crossings = sum(
            self.levels[a] == self.levels[c] and (x[a] - x[c]) * (x[b] - x[d]) < 0
            for (a, b), (c, d) in itertools.combinations(self.links, 2)
        )
        return crossings, round(sum((x[a] - x[b]) ** 2 for a, b in self.links), 9)


def draw(rooms: dict[str, Room]) -> Any:
    """Draw the rooms; a matplotlib figure."""
    from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
    from matplotlib.path import Path as Curve

    layout = Layout(rooms)
    right = max(abs(x) for x in layout.x.values()) + WIDTH / 2 + 0.2
    top = RISE * (len(layout.layers) - 1) + HEIGHT / 2 + 0.2
    bottom = -HEIGHT / 2 - 0.2
    figure = require_matplotlib()(figsize=(2 * right, top - bottom), dpi=120)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-right, right), ylim=(bottom, top))
    axes.axis("off")
    for route in layout.routes:
        points, codes = [], []
        for above, below in itertools.pairwise(route):
            start = (layout.x[above] + port(layout, above, below), layout.levels[above] * RISE - HEIGHT / 2)
            end = (layout.x[below] + port(layout, below, above), layout.levels[below] * RISE + HEIGHT / 2)
            middle = (start[1] + end[1]) / 2
            points += [start, (start[0], middle), (end[0], middle), end]
            codes += [Curve.LINETO if codes else Curve.MOVETO, Curve.CURVE4, Curve.CURVE4, Curve.CURVE4]
        style = {"arrowstyle": "-|>", "mutation_scale": 18, "shrinkA": 0, "shrinkB": 0, "color": "0.35", "lw": 1.6}
        axes.add_patch(FancyArrowPatch(path=Curve(points, codes), **style))
    for name, room in rooms.items():
        x, y = layout.x[name], layout.levels[name] * RISE
        corner = (x - WIDTH / 2, y - HEIGHT / 2)
        box = FancyBboxPatch(corner, WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08", fc="#eef3f8", ec="0.25", lw=1.2)
        axes.add_patch(box)
        axes.text(x, y + 0.84, name, ha="center", va="center", fontsize=17, weight="bold")
        axes.text(x, y + 0.0, textwrap.fill(room.purpose, 28), ha="center", va="center", fontsize=14.5, linespacing=1.2)
        size = f"{room.modules} modules, {room.lines} lines"
        axes.text(x, y - 0.88, size, ha="center", va="center", fontsize=14.5, color="0.35")
    return figure


def port(layout: Layout, name: str, other: str) -> float:
    """Where an arrow meets the edge of a box, from its middle: arrows side by side, in the order of their other ends."""
    if name not in layout.boxes:
        return 0.0
    down = layout.levels[other] < layout.levels[name]
    ends = [b for a, b in layout.links if a == name] if down else [a for a, b in layout.links if b == name]
    ends.sort(key=layout.x.__getitem__)
    return 0.45 * (ends.index(other) - (len(ends) - 1) / 2)


def differences(rooms: dict[str, Room], picture: Path) -> list[str]:
    """What a picture shows that is not so any more."""
    from PIL import Image

    try:
        with Image.open(picture) as image:
            recorded = json.loads(image.text[KEY])
        drawn = {name: Room(**{**fields, "imports": tuple(fields["imports"])}) for name, fields in recorded.items()}
    except (OSError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise sr.FileFormatError(f"{picture} is no picture of this script") from error
    result = [f"{name}: drawn {name in drawn}, there {name in rooms}" for name in sorted(drawn.keys() ^ rooms.keys())]
    for name in sorted(drawn.keys() & rooms.keys()):
        old, new = drawn[name], rooms[name]
        if (old.imports, old.purpose) != (new.imports, new.purpose):
            result.append(f"{name}: other imports or another purpose")
        if abs(old.lines - new.lines) > TOLERANCE * new.lines:
            result.append(f"{name}: {old.lines} lines drawn, {new.lines} there")
    return result


def run(arguments: argparse.Namespace) -> bool:
    """Write the picture, or compare it; whether it is current."""
    rooms = read_rooms()
    if arguments.check:
        found = differences(rooms, arguments.output)
        print("\n".join(found) or f"{arguments.output}: up to date")
        return not found
    require_matplotlib()
    text = json.dumps({name: room._asdict() for name, room in rooms.items()})
    picture = io.BytesIO()
    draw(rooms).savefig(picture, format="png", metadata={KEY: text, "Software": None})
    print(f"{write_bytes(arguments.output, picture.getvalue(), overwrite=True)}: written")
    return True


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; status 1 if --check finds a difference."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
