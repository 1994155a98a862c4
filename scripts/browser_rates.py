"""Equilibria a second in Chromium, on one core: python scripts/browser_rates.py."""

from __future__ import annotations

import sys

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.compiled.run.compiled_model import compile_model
from softrobots.view.browser import open_browser

ROBOTS = {
    "InflatableArm()": (sr.InflatableArm(), 5.0, 1.0),
    "PccArm()": (sr.PccArm(), 0.5, 0.3),
    "TendonArm()": (sr.TendonArm(), 0.05, 0.3),
    "HelixTube()": (sr.HelixTube(), 0.1, 0.3),
}
"""Robots, size of the forces on their tips [N], and how far actuators go from relaxed to their limits [-]."""
MEASURE = """([text, cases]) => {
  const solver = new Function(`${text}; return makeSolver();`)();
  let count = 0, certified = 0;
  for (let round = 0; round < 5; round += 1) for (const one of cases) certified += solver.solve(one).status === 0;
  const begin = performance.now();
  while (performance.now() - begin < 2000) { for (const one of cases) solver.solve(one); count += cases.length; }
  return [count / (performance.now() - begin) * 1000, certified / (5 * cases.length)];
}"""


def main() -> None:
    """Print a row for each robot: 50 random cases under weight, each from rest, with placements and margins."""
    with open_browser() as browser:
        for name, (description, size, share) in ROBOTS.items():
            model, random = sr.load_model(description), np.random.default_rng(0)
            cases: list[dict[str, list[float]]] = []
            while len(cases) < 50:
                drawn = model.actuators.draw(random)
                if drawn is not None:
                    motors = model.relaxed_motors + share * (drawn - model.relaxed_motors)
                    force = size * random.normal(size=3)
                    cases.append({"motors": motors.tolist(), "force": force.tolist(), "gravity": list(sr.EARTH_GRAVITY)})
            page = browser.new_page()
            text = compile_model(model, backend="python").js_source()
            rate, certified = page.evaluate(MEASURE, [text, cases])
            page.close()
            print(f"{name:16} {rate:9.0f} a second, {certified:.0%} certified, {len(text) / 1e3:.0f} kB")


if __name__ == "__main__":
    sys.exit(exit_status(main))
