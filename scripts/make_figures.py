"""Make the figures of the guides: plots of the inflated link and the arm, and the examples of docs/own_robot.md.

Needs matplotlib (extra `plot`); the pictures of robots also a Chromium and Playwright (extra `pictures`).
"""

from __future__ import annotations

import argparse
import runpy
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.options.command_line import exit_status
from softrobots.core.progress import with_progress
from softrobots.description.expansion import expand
from softrobots.inflated_beam import MEAN_STIFFNESS, TABLE_3
from softrobots.view.figures import canvas, equilibria, inflated_link, vibrations
from studies.contact.pictures import contact_grip, contact_margins, contact_peg_forces
from studies.gallery import load_plots
from studies.gallery.actuator_plots import actuator_kinds, dry_friction
from studies.gallery.your_robot import (
    your_robot_ellipses,
    your_robot_poses,
    your_robot_predicted,
    your_robot_residuals,
    your_robot_sets,
    your_robot_values,
)
from studies.motion.pictures import motion_energies, motion_gust, motion_release, motion_tip, motion_turn
from studies.papers import link_pictures
from studies.shared.browser import take_picture

DOCS = Path(__file__).resolve().parent.parent / "docs"
EXAMPLES = DOCS / "examples"
LINK = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005}
"""The prototype of Troise et al. 2021 [m]."""
PUSH = (-1.0, 0.0, 0.0)
"""Direction in which the straight arm is pushed."""


def link_deflection() -> Any:
    """Deflection along the link of the paper under 10 N at its end."""
    return link_pictures.deflection(10.0, stiffness=MEAN_STIFFNESS, hinge_offset=0.03, pressure=50e3, **LINK)


def link_pressure() -> Any:
    """Stiffness and largest moment over pressure, the paper's Table 3 beside its equations."""
    modulus = inflated_beam.young_modulus_from_stiffness(MEAN_STIFFNESS, pressure=30e3, **LINK)
    return link_pictures.pressure_effects(TABLE_3, young_modulus=modulus, **LINK)


def bending_test() -> Any:
    """The noisy bending test of docs/inflatable_arm.md, its fit and the limits of the moment."""
    angle, tube = np.linspace(0.005, 0.2, 40), {"pressure": 50e3, "radius": LINK["radius"]}
    exact = inflated_beam.moment(angle, stiffness=169.44, max_moment=21.76)
    data = inflated_beam.BendingData(angle, exact + np.random.default_rng(3).normal(0.0, 0.3, 40))
    return inflated_link.characterisation(data, inflated_beam.fit_characterisation(*data, **tube), **tube)


def link_laws() -> Any:
    """The laws of the moment of a link at 50 kPa, with the limits of its wall and what the paper measured."""
    row, radius = TABLE_3[4], LINK["radius"]
    limits = inflated_beam.moment_limits(row.pressure, radius)
    angles = np.linspace(0.0, 0.5, 501)
    slack = inflated_beam.slack_wall_moment(angles, stiffness=row.stiffness, slack_moment=limits.slack)
    laws = {
        "linear": row.stiffness * angles,
        "plateau, as the paper": inflated_beam.moment(angles, stiffness=row.stiffness, max_moment=row.max_moment),
        "slack wall, membrane theory": slack.moment,
    }
    title = f"Moment of a link at {row.pressure / 1e3:g} kPa, k = {row.stiffness:g} N m/rad"
    figure, axes = canvas.new_plot(
        (canvas.WIDTH, 4.8), xlabel="hinge angle [rad]", ylabel="moment at the hinge [N m]", title=title
    )
    for number, (label, moments) in enumerate(laws.items()):
        style = canvas.line_style(number) | {"marker": None}
        axes.plot(angles, moments, lw=2.0, label=label, **style)
    names = {"slack": "first slack fibre", "wrinkling": "half slack: wrinkling (3)", "collapse": "collapse"}
    for name, words in names.items():
        limit = float(getattr(limits, name))
        axes.axhline(limit, color="0.45", lw=0.8)
        axes.annotate(
            f"{words}, {limit:.2f} N m", (0.5, limit), (-4, -4), textcoords="offset points", ha="right", va="top", fontsize=9
        )
    axes.set(xlim=(0.0, 0.5), ylim=(0.0, 30.0))
    axes.legend(fontsize=9, loc="lower right")
    return figure


def one_pose() -> Any:
    """The arm of docs/watch.md."""
    return sr.plot(sr.solve_equilibrium(sr.load_model(sr.InflatableArm()), (0.3, 0.6, -0.8), (0, 10, -15)))


def arm_buckling() -> Any:
    """The straight arm pushed along its axis, exactly and a little beside."""
    arm = sr.load_model(sr.InflatableArm())
    critical = sr.critical_load(arm, (0, 0, 0), PUSH)
    forces = np.concatenate([np.linspace(0.0, 110.0, 23), critical + np.linspace(-2.0, 16.0, 46)])
    branches: dict[str, list[sr.Equilibrium]] = {}
    for sideways in (0.0, 0.1, 1.0):
        label = f"pushed with {sideways:g} N sideways" if sideways else "pushed exactly along the axis"
        branches[label] = [sr.solve_equilibrium(arm, (0, 0, 0), (-force, sideways, 0)) for force in forces]
    return load_plots.growing_load(branches, PUSH, critical=critical)


def arm_branches() -> Any:
    """Every branch of the straight arm pushed along its axis."""
    arm = sr.load_model(sr.InflatableArm())
    return equilibria.branches(sr.post_buckling_branches(arm, (0, 0, 0), PUSH, max_force=150.0), (0, 0, 1))


def link_reaction() -> Any:
    """A probe pushes links at 0.5 m, through wrinkling, at the pressures of the paper's Table 3 that have a plateau."""
    runs: dict[str, list[sr.ImposedDisplacement]] = {}
    for row in TABLE_3[:5:2]:
        fields = {"stiffness": row.stiffness, "pressure": row.pressure, "max_moment": row.max_moment}
        link = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), **fields))
        probe = {"direction": (0, 1, 0), "frame": "link_1", "point": (0.47, 0, 0), "along": (1, 0, 0)}
        held, run = None, []
        for way in np.linspace(0.004, 0.1, 25):
            held = sr.solve_imposed_displacement(link, (0, 0), way, start=held, **probe)
            run.append(held)
        runs[f"{row.pressure / 1e3:g} kPa"] = run
    return load_plots.reaction(runs)


def vibration_modes() -> Any:
    """The four modes of the arm of docs/motion.md."""
    arm = sr.load_model(sr.InflatableArm())
    return vibrations.mode_shapes(
        sr.vibration_modes(arm, sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY))
    )


def finger_grip() -> Any:
    """Closing angle and grip force of the pneumatic finger of docs/own_robot.md over its pressure."""
    finger, way_to_close = _example("soft_finger.py")["SoftFinger"](), _example("three_fingers.py")["way_to_close"]
    model = sr.load_model(finger)
    pressures = np.linspace(0.0, finger.max_pressure, 17)
    figure = canvas.new_figure((canvas.WIDTH, 7.6))
    upper, lower = figure.subplots(2, 1)
    free = [sr.solve_equilibrium(model, (p,)) for p in pressures]
    turned = [one.transform_tip_to_world.rotation for one in free]
    angles = np.degrees([np.arctan2(turn[0, 2], turn[2, 2]) for turn in turned])
    style = {"ls": "", "marker": canvas.MARKERS[0], "color": canvas.COLOURS[0]}
    closed_form = np.degrees([finger.closing_angle(p) for p in pressures])
    upper.plot(1e-3 * pressures, closed_form, color=canvas.COLOURS[1], label="p A d L / EI")
    upper.plot(1e-3 * pressures, angles, label="eight hinges", **style)
    upper.set(ylabel="closing angle [degrees]", title="Free finger")
    for number, radius in enumerate((0.010, 0.015, 0.020)):
        points = []
        for pressure, open_finger in zip(pressures, free, strict=True):
            way = way_to_close(finger, open_finger.tip_position[0], radius)
            if way >= 0.0:
                held = sr.solve_imposed_displacement(model, (pressure,), way, direction=PUSH)
                points.append((1e-3 * pressure, held.reaction))
        lower.plot(*np.transpose(points), label=f"cylinder of {2e3 * radius:g} mm", **canvas.line_style(number))
    lower.set(ylabel="force of a finger on the cylinder [N]", title="Grip of a hand of three fingers")
    for axes in (upper, lower):
        axes.set_xlabel("gauge pressure [kPa]")
        axes.set_xlim(0.0, None)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=9)
    return figure


def tool_arm() -> sr.Viewer:
    """The arm of docs/examples/tool_arm.urdf.xacro holds a load up with its tip on target."""
    model = sr.load_model(expand(EXAMPLES / "tool_arm.urdf.xacro", {"tool_stiffness": "60"}))
    start = (0.3, 1.2, -1.2, 0.3)
    viewer = sr.view(model, sr.solve_ik(model, (1.0, 0.5, 0.5), (0, 5, -8), gravity=sr.EARTH_GRAVITY, q_motors0=start))
    viewer.look_from((1.5, -1.3, 0.9), (0.5, 0.2, 0.3))
    return viewer


def three_fingers() -> sr.Viewer:
    """The hand of docs/examples/three_fingers.py around its cylinder."""
    example = _example("three_fingers.py")
    finger = _example("soft_finger.py")["SoftFinger"]()
    one, pressure = sr.load_model(finger), 60e3
    way = example["way_to_close"](finger, sr.solve_equilibrium(one, (pressure,)).tip_position[0])
    grip = sr.solve_imposed_displacement(one, (pressure,), way, direction=PUSH).reaction
    hand = sr.load_model(example["three_fingers"](finger), tip="a_tip")
    places = example["FINGERS"].items()
    pushed = {f"{name}tip": (grip * np.cos(angle), grip * np.sin(angle), 0, 0, 0, 0) for name, angle in places}
    viewer = sr.view(hand, sr.solve_equilibrium(hand, (pressure,) * 3, wrench=pushed))
    viewer.look_from((0.03, -0.17, 0.2), (0.0, 0.0, 0.06))
    return viewer


FIGURES: dict[str, Callable[[], Any]] = {
    function.__name__: function
    for function in (
        link_deflection,
        link_pressure,
        bending_test,
        link_laws,
        link_reaction,
        one_pose,
        arm_buckling,
        arm_branches,
        vibration_modes,
        finger_grip,
        actuator_kinds,
        dry_friction,
        motion_release,
        motion_tip,
        motion_energies,
        motion_turn,
        motion_gust,
        your_robot_residuals,
        your_robot_values,
        your_robot_ellipses,
        your_robot_predicted,
        your_robot_sets,
        your_robot_poses,
        contact_margins,
        contact_grip,
        contact_peg_forces,
    )
}
"""Plots by the name of their file."""
SCENES: dict[str, tuple[Callable[[], sr.Viewer], str]] = {
    "tool_arm": (tool_arm, "Three links that differ, tool on a leaf spring, 9.4 N"),
    "three_fingers": (three_fingers, "Three pneumatic fingers at 60 kPa"),
}
"""Pictures of robots with their titles, by the name of their file."""


def _example(name: str) -> dict[str, Any]:
    """What an example of the guide defines; it may import its neighbours."""
    sys.path.insert(0, str(EXAMPLES))
    try:
        return runpy.run_path(str(EXAMPLES / name))
    finally:
        sys.path.remove(str(EXAMPLES))


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = (*FIGURES, *SCENES)
    help_text = f"figures to make ({', '.join(names)})"
    result.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME", help=help_text)
    help_text = "folder of the figures (docs/images)"
    result.add_argument("--output", type=Path, default=DOCS / "images", metavar="FOLDER", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> None:
    """Make the figures that are asked for; existing ones are replaced."""
    canvas.require_matplotlib()
    for name in with_progress(arguments.only, True, label="figures", unit="figure"):
        target = arguments.output / f"{name}.png"
        if name in FIGURES:
            canvas.write_png(FIGURES[name](), target, overwrite=True)
        else:
            make, title = SCENES[name]
            with tempfile.TemporaryDirectory() as folder, make() as viewer:
                page = viewer.write_html(Path(folder) / "scene.html", title=title)
                take_picture(page, target, width=740, height=414, scale=1.5, aside=0.1)
        print(target)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
