"""Pages of the documentation that solve by themselves: one for each robot, with the pose that it shows first."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from softrobots.model.loader import load_model
from softrobots.robots import HelixTube, InflatableArm, PccArm, TendonArm
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.interactive_page import interactive


class LivePage(NamedTuple):
    """A page that solves by itself."""

    robot: Any
    """The robot."""
    title: str
    """Title of the page."""
    start: dict[str, Any]
    """What it shows first, as arguments of `interactive`."""

    def write(self, file: Path) -> Path:
        """Write the page, in place of an older one."""
        return interactive(load_model(self.robot), title=self.title, **self.start).write_html(file, overwrite=True)


LIVE_PAGES = {
    "live_inflatable_arm": LivePage(
        InflatableArm(), "The inflatable arm", {"q_motors": (0.3, 0.6, -0.8), "force": (0.0, 10.0, -15.0)}
    ),
    "live_pcc_arm": LivePage(
        PccArm(),
        "The arm of pneumatic muscles",
        {"q_motors": (0.47, 0.53, 0.55, 0.50, 0.55, 0.53), "force": (2.0, 0.0, -1.0), "gravity": EARTH_GRAVITY},
    ),
    "live_tendon_arm": LivePage(
        TendonArm(),
        "An arm on tendons",
        {"q_motors": (0.060, 0.060, 0.060, 0.1225, 0.118, 0.1225, 0.180, 0.1865, 0.1865), "gravity": EARTH_GRAVITY},
    ),
    "live_helix_tube": LivePage(HelixTube(), "The helical tube", {"gravity": EARTH_GRAVITY}),
}
"""Each page by its name."""
