"""Make the self-contained pages of the documentation, which turn robots and play animations in any browser, offline too.

The same version makes the same bytes: a page that is made again shows no difference. ur5_bench needs the extra `robots`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import new_file
from studies.gallery.live_pages import LIVE_PAGES
from studies.gallery.scenes import EXHIBITS

PAGES = {
    "helix_growth": "helix_growth",
    "pcc_arm": "pcc_arm",
    "tendon_arm": "moving_tendon_arm",
    "inflatable_arm": "wrinkling_arm",
    "wrist": "wrist",
    "ur5_bench": "ur5_bench",
    "motion_release": "released_arm",
    "motion_gust": "helix_in_a_gust",
    "your_robot": "your_robot",
    "contact_arm": "contact_arm",
    "contact_helix": "contact_helix",
    "contact_pegs": "contact_pegs",
}
"""Name of each page, and its exhibit; pages that solve by themselves are in `studies.gallery.live_pages`."""


def main(argv: list[str] | None = None) -> int:
    """Write each page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    folder = Path(__file__).resolve().parent.parent / "docs" / "pages"
    names = (*PAGES, *LIVE_PAGES)
    parser.add_argument(
        "--output", type=Path, default=folder, metavar="FOLDER", help="folder of the pages, which are replaced (docs/pages)"
    )
    parser.add_argument("--only", nargs="+", choices=names, default=names, help="pages to make (all)")
    arguments = parser.parse_args(argv)

    def write() -> None:
        targets = {name: new_file(arguments.output / f"{name}.html", overwrite=True) for name in arguments.only}
        for name, target in targets.items():
            if name in LIVE_PAGES:
                page = LIVE_PAGES[name].write(target)
            else:
                exhibit = EXHIBITS[PAGES[name]]
                with exhibit.make() as viewer:
                    page = viewer.write_html(target, title=exhibit.title, overwrite=True)
            print(f"{page} ({page.stat().st_size / 1e6:.2f} MB)")

    return exit_status(write)


if __name__ == "__main__":
    sys.exit(main())
