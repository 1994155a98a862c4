"""Make the pictures of the README and the guides: viewer pages photographed in a headless Chromium."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import new_file
from studies.gallery.live_pages import LIVE_PAGES
from studies.gallery.moving_picture import take_animation
from studies.gallery.scenes import EXHIBITS
from studies.shared.browser import take_picture

PICTURES = (
    "inflatable_arm",
    "wrist",
    "pcc_arm",
    "tendon_arm",
    "helical_tendons",
    "helix_tube",
    "helix_growth",
    "helix_actuator",
    "ur5_bench",
    "ur5_with_soft_arm",
    "your_robot",
    "contact_arm",
    "contact_helix",
    "contact_pegs",
)
"""Exhibits of which there is a picture."""

ANIMATION = "inflatable_arm.gif"
"""The moving picture at the top of the README, of the exhibit of that name."""


WINDOW = {"width": 740, "height": 414, "scale": 1.5}
"""Where pages are photographed [px]: print of 13 px is 7 px high in a picture that is shown 400 px wide."""


def main(argv: list[str] | None = None) -> int:
    """Photograph each robot under load."""
    parser = argparse.ArgumentParser(description=__doc__)
    folder = Path(__file__).resolve().parent.parent / "docs" / "images"
    names = (*PICTURES, ANIMATION, *LIVE_PAGES)
    parser.add_argument(
        "--output", type=Path, default=folder, metavar="FOLDER", help="folder of the pictures, which are replaced (docs/images)"
    )
    parser.add_argument("--only", nargs="+", choices=names, default=names, help="pictures to make (all)")
    arguments = parser.parse_args(argv)

    def photograph() -> None:
        files = {name: name if name == ANIMATION else f"{name}.png" for name in arguments.only}
        targets = {name: new_file(arguments.output / file, overwrite=True) for name, file in files.items()}
        for name, target in targets.items():
            if name in LIVE_PAGES:
                with tempfile.TemporaryDirectory() as folder_name:
                    page = LIVE_PAGES[name].write(Path(folder_name) / "page.html")
                    print(take_picture(page, target, **WINDOW | {"height": 520}))
                continue
            exhibit = EXHIBITS[name.removesuffix(".gif")]
            with tempfile.TemporaryDirectory() as folder_name, exhibit.make() as viewer:
                page = viewer.write_html(Path(folder_name) / "scene.html", title=exhibit.title)
                if name == ANIMATION:
                    print(take_animation(page, target, width=720, height=400, progress=name))
                else:
                    print(take_picture(page, target, share=exhibit.share, aside=0.1, **WINDOW))

    return exit_status(photograph)


if __name__ == "__main__":
    sys.exit(main())
