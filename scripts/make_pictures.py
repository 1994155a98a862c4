"""Make the pictures of the README and the guides: viewer pages photographed in a headless Chromium."""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

import softrobots as sr
from softrobots import inflated_beam
from softrobots.bench_run import push_link
from softrobots.browser import take_picture
from softrobots.command_line import exit_status
from softrobots.composition import fix_joints
from softrobots.third_party import UR5, robot_file
from softrobots.ur5_bench import UR5Bench


def loaded_inflatable_arm() -> sr.Viewer:
    """The default path of `ik_trajectory.py`, shown near its end."""
    model = sr.load_model(sr.InflatableArm())
    path = sr.straight_line((0.4, -0.5, 0.6), (1.0, 0.2, 0.2), 2.0, 100)
    return sr.view(
        model, sr.follow_trajectory(model, path.positions, (0, 10, -15), times=path.times, elbow="up", progress=True)
    )


def loaded_pcc_arm() -> sr.Viewer:
    """The arm of pneumatic muscles, bent and pulled."""
    model = sr.load_model(sr.PccArm())
    lengths = (0.47, 0.53, 0.55, 0.50, 0.55, 0.53)
    return sr.view(model, sr.solve_equilibrium(model, lengths, (6, 4, -3), gravity=sr.EARTH_GRAVITY))


def sagging_helix_tube() -> sr.Viewer:
    """A helical tube of three and a half turns that hangs out sideways under its own weight, near wrinkling at its base."""
    model = sr.load_model(sr.HelixTube(length=2.0, elastic_sections=32, pressure=6e3))
    return sr.view(model, sr.solve_equilibrium(model, (), gravity=sr.EARTH_GRAVITY))


def growing_helix_tube() -> sr.Viewer:
    """The same tube with the axis of the helix upright, as it grows."""
    tube = sr.HelixTube(length=2.0, elastic_sections=32, upright="axis")
    viewer = sr.view(sr.load_model(tube))
    viewer.animate_growth(tube)
    return viewer


def characterisation_bench() -> sr.Viewer:
    """A UR5 pushes an inflated link through wrinkling (needs example-robot-data)."""
    row = inflated_beam.TABLE_3[2]
    link = sr.InflatableArm(link_lengths=(0.6,), stiffness=row.stiffness, pressure=row.pressure, max_moment=row.max_moment)
    bench = UR5Bench(link=link)
    viewer = sr.view(bench.model, push_link(bench, np.linspace(0.0, bench.push_end(), 41)).trajectory())
    viewer.look_from(*bench.camera)
    return viewer


def ur5_with_soft_arm() -> sr.Viewer:
    """A UR5 carries the inflatable arm with 1 kg at its tip (needs example-robot-data)."""
    arm = fix_joints(sr.InflatableArm(), {"motor_1": 0.0, "motor_2": math.pi / 2, "motor_3": 0.0})
    model = sr.load_model(sr.mount(robot_file(UR5), "tool0", arm, xyz=(0.0, 0.0, 0.165)))
    pose, payload = (0.0, -2.1, 1.9, 0.2, math.pi / 2, 0.0), (0.0, 0.0, -9.81)
    return sr.view(model, sr.solve_equilibrium(model, pose, payload, gravity=sr.EARTH_GRAVITY))


PICTURES = {
    "inflatable_arm": (loaded_inflatable_arm, "Inflatable arm, 18 N on the tip", 0.85),
    "pcc_arm": (loaded_pcc_arm, "PCC arm, held muscle lengths, own weight and 8 N on the tip", 0.0),
    "helix_tube": (sagging_helix_tube, "Helical tube under its own weight", 0.0),
    "helix_growth": (growing_helix_tube, "Growth of the helical tube", 0.45),
    "ur5_bench": (characterisation_bench, "UR5 pushes an inflated link at 30 kPa", 0.8),
    "ur5_with_soft_arm": (ur5_with_soft_arm, "UR5 with a soft arm, 1 kg at its tip", 0.0),
}
"""What each picture shows, its title, and the share of its animation at which it is taken."""


def main(argv: list[str] | None = None) -> int:
    """Photograph each robot under load."""
    parser = argparse.ArgumentParser(description=__doc__)
    folder = Path(__file__).resolve().parent.parent / "docs" / "images"
    parser.add_argument("--output", type=Path, default=folder, metavar="FOLDER", help="folder of the pictures (docs/images)")
    parser.add_argument("--only", nargs="+", choices=tuple(PICTURES), default=tuple(PICTURES), help="pictures to make (all)")
    arguments = parser.parse_args(argv)

    def photograph() -> None:
        for name in arguments.only:
            make, title, share = PICTURES[name]
            with tempfile.TemporaryDirectory() as folder_name, make() as viewer:
                page = viewer.write_html(Path(folder_name) / "scene.html", title=title)
                print(take_picture(page, arguments.output / f"{name}.png", width=1000, height=560, share=share))

    return exit_status(photograph)


if __name__ == "__main__":
    sys.exit(main())
