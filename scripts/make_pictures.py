"""Make the pictures of the README and the guides: viewer pages photographed in a headless Chromium."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import softrobots as sr
from softrobots.browser import take_picture


def main(argv: list[str] | None = None) -> int:
    """Photograph the loaded arm near the end of the default path of `ik_trajectory.py`."""
    parser = argparse.ArgumentParser(description=__doc__)
    folder = Path(__file__).resolve().parent.parent / "docs" / "images"
    parser.add_argument("--output", type=Path, default=folder, metavar="FOLDER", help="folder of the pictures (docs/images)")
    arguments = parser.parse_args(argv)
    model = sr.load_model(sr.InflatableArm())
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 100)
    trajectory = sr.follow_trajectory(model, path.positions, (0, 10, -15), times=path.times, elbow="up", progress=True)
    try:
        with tempfile.TemporaryDirectory() as folder_name, sr.view(model, trajectory) as viewer:
            page = viewer.write_html(Path(folder_name) / "scene.html", title="Inflatable arm, 18 N on the tip")
            print(take_picture(page, arguments.output / "inflatable_arm.png", width=1000, height=560, share=0.85))
    except sr.SoftRobotsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
