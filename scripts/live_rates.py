"""How fast the pages of the documentation that solve by themselves are in Chromium: equilibria and drawn frames a second.

Each equilibrium is solved from rest, at motors and forces that follow a circle; a frame is an equilibrium near the last one,
drawn. Chromium draws in software here, on all cores; a graphics card is faster.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from softrobots.cli.options.command_line import exit_status
from studies.gallery.live_pages import LIVE_PAGES
from studies.shared.browser import open_browser

PAGES = Path(__file__).resolve().parent.parent / "docs" / "pages"

_CASES = """
const {robot, solve} = softrobots, start = softrobots.shown, size = JSON.parse(PAGE_DATA).fullForce;
const given = k => ({
  motors: robot.actuators.map(({relaxed, unit}, place) =>
    start.motors[place] + (unit === "rad" ? 0.2 : 0.02 * relaxed) * Math.sin(0.1 * k + 0.2 * place)),
  force: [0.2 * size * Math.cos(0.1 * k), 0.2 * size * Math.sin(0.1 * k), 0], gravity: [0, 0, -9.81]});
"""
_SOLVE = (
    "seconds => {"
    + _CASES
    + """
  let count = 0, good = 0;
  const begin = performance.now();
  for (; performance.now() - begin < 1000 * seconds; count++) good += solve(given(count)).status === 0;
  return [1000 * count / (performance.now() - begin), good / count];
}"""
)
_DRAW = (
    "seconds => new Promise(done => {"
    + _CASES
    + """
  let count = 0;
  const begin = performance.now(), next = now => {
    if (now - begin > 1000 * seconds) { done(1000 * count / (now - begin)); return; }
    softrobots.set(given(count++));
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""
)


def measure(seconds: float) -> list[tuple[str, float, float, float, float]]:
    """Return name, size [MB], equilibria a second, their certified share, and frames a second of each page."""
    rows = []
    with open_browser() as browser:
        for name in LIVE_PAGES:
            file = PAGES / f"{name}.html"
            page: Any = browser.new_page(viewport={"width": 1000, "height": 560})
            page.goto(file.as_uri())
            page.evaluate("softrobots.ready.then(() => true)")
            rate, good = page.evaluate(_SOLVE, seconds)
            rows.append((name, file.stat().st_size / 1e6, rate, good, page.evaluate(_DRAW, seconds)))
            page.close()
    return rows


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0, help="time of each measurement [s] (%(default)s)")
    arguments = parser.parse_args(argv)

    def run() -> None:
        print("| page | size [MB] | equilibria a second | certified | frames a second |\n|---|---|---|---|---|")
        for name, size, rate, good, frames in measure(arguments.seconds):
            print(f"| [{name}](pages/{name}.html) | {size:.2f} | {rate:.0f} | {100 * good:.0f} % | {frames:.0f} |")

    return exit_status(run)


if __name__ == "__main__":
    sys.exit(main())
