"""Design an inflated tube that becomes a helix: actuator, template, robot description, sag and growth.

Give the actuator (--contraction, --angle), or a requirement: an antenna (--antenna), or an object to wrap (--grasp). Prints a
table, and writes into a new folder: the design (JSON), the robot as URDF (sections and lumped), a template of the unrolled tube
to print to scale (SVG, whole and on pages) with its positions (CSV), the loaded shape of the lumped robot (NPZ, PNG, HTML
scene) and the growth as an animated page (HTML).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots import helix
from softrobots.cli.options.command_line import add_load, exit_status, gravity_of, refuse_too_large
from softrobots.core.files import make_folder, write_text
from softrobots.statics.loads import Load
from softrobots.view.figures import canvas, picture
from studies.shared.command_line import serve, tell_written
from studies.shared.folders import free_folder

PIECES = {"pinch": "pinches", "tape": "tapes", "stoppers": "gaps"}
"""Names of the repeated marks of the template, by method."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    purpose = options.add_mutually_exclusive_group()
    names = ("RADIUS", "RISE", "TURNS")
    help_text = "helix with a centre line of this radius [m], rise per turn [m] and number of turns"
    purpose.add_argument("--antenna", type=float, nargs=3, metavar=names, help=help_text)
    help_text = "helix around an object of this radius [m], with this rise per turn [m] and number of turns"
    purpose.add_argument("--grasp", type=float, nargs=3, metavar=names, help=help_text)
    purpose.add_argument("--design", type=Path, metavar="FILE", help="a design.json of an earlier run")
    options.add_argument("--nearest", action="store_true", help="take the nearest realisable helix instead of an error")
    options.add_argument("--contraction", type=float, help="contracted over original length of the actuator, in (0, 1] (0.66)")
    options.add_argument("--angle", type=float, metavar="DEG", help="of the actuator to the axis of the tube [degrees] (5)")
    options.add_argument("--length", type=float, help="of the uninflated tube [m] (1.5)")
    options.add_argument("--diameter", type=float, help="of the tube [m] (0.0331)")
    options.add_argument("--squeeze", type=float, help="radius of the object of --grasp minus that of the helix [m] (0)")
    options.add_argument("--handedness", choices=helix.HANDEDNESS, help="of the helix (right)")
    options.add_argument("--pressure", type=float, default=10e3, help="gauge pressure [Pa] (%(default)g)")
    options.add_argument("--upright", choices=("tube", "axis"), default="axis", help="which axis points along z (%(default)s)")
    options.add_argument("--sections", type=int, metavar="N", help="of the chains, or hinges (one for about 40 degrees)")
    add_load(options)
    help_text = "distributed force on the tube, e.g. of wind [N/m]"
    options.add_argument("--wind", type=float, nargs=3, metavar=("X", "Y", "Z"), help=help_text)
    options.add_argument(
        "--spacing",
        type=float,
        default=0.02,
        help="spacing of the pinches along the actuator, adjusted to a whole number [m] (%(default)s)",
    )
    options.add_argument("--method", choices=helix.METHODS, default="pinch", help="fabrication of the actuator (%(default)s)")
    options.add_argument(
        "--output", type=Path, metavar="FOLDER", help="new or empty folder of the results (output/helix_tube_<time>)"
    )
    options.add_argument("--no-plots", action="store_true", help="leave out the picture, which needs matplotlib")
    options.add_argument("--meshcat", action="store_true", help="serve the growth on loopback until Ctrl-C")
    return options


def run(arguments: argparse.Namespace) -> Path:
    """Design, solve and write all results; return their folder."""
    gravity = gravity_of(arguments)
    if not arguments.no_plots:
        canvas.require_matplotlib()  # raises at once if it is missing
    design = _design(arguments)
    count = {} if arguments.sections is None else {"elastic_sections": arguments.sections, "hinges": arguments.sections}
    tube = sr.HelixTube.from_design(design, pressure=arguments.pressure, upright=arguments.upright, **count)
    refuse_too_large(tube, "--sections", tube.elastic_sections)
    pattern = helix.pinch_pattern(design, arguments.spacing, arguments.method)
    # Hinges give the right sag with far fewer joints than sections, which are too stiff if the tube turns much along one.
    robots = {"helix_tube": tube, "helix_tube_lumped": dataclasses.replace(tube, chain="lumped")}
    model = sr.load_model(robots["helix_tube_lumped"])
    wind = None if arguments.wind is None else sr.distributed_force(model, arguments.wind)
    Load.of(model, arguments.force, wrench=wind, gravity=gravity)
    folder = free_folder(arguments.output or Path("output") / f"helix_tube_{datetime.now():%Y%m%d_%H%M%S}")
    with tqdm(total=5, desc="helix", unit="step") as bar:

        def step(text: str) -> None:
            bar.update()
            bar.set_postfix_str(text)

        loaded = sr.solve_equilibrium(model, (), arguments.force, wrench=wind, gravity=gravity)
        summary = summarise(tube, design, pattern, loaded)
        step("pictures")
        figure = None if arguments.no_plots else picture.plot(loaded)
        make_folder(folder)
        with sr.view(model, loaded) as viewer:
            viewer.write_html(folder / "scene.html", title="Helical tube under load")
        if figure is not None:
            canvas.write_png(figure, folder / "shape.png", overwrite=False)
        step("files")
        sr.save_result(loaded, folder / "equilibrium.npz")
        sr.save_result(design, folder / "design.json")
        helix.write_template(pattern, folder / "template.svg")
        helix.write_template_table(pattern, folder / "template.csv")
        for name, robot in robots.items():
            write_text(folder / f"{name}.urdf", robot.urdf(), overwrite=False)
        write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n", overwrite=False)
        step("growth")
        with sr.view(sr.load_model(tube)) as viewer:
            viewer.animate_growth(tube)
            step("growth")
            viewer.write_html(folder / "growth.html", title="Growth of the helical tube")
            step("done")
            bar.close()
            print(table(summary))
            tell_written(folder)
            if arguments.meshcat:
                serve(viewer)
    return folder


def _design(arguments: argparse.Namespace) -> helix.HelixDesign:
    """The design for the options; raises ParameterError for options without effect."""
    required = arguments.antenna or arguments.grasp
    source = "--design" if arguments.design else "--antenna" if arguments.antenna else "--grasp" if required else None
    idle = {"squeeze": arguments.grasp is None, "contraction": source is not None, "angle": source is not None}
    idle |= {"length": source is not None, "diameter": source == "--design", "handedness": source == "--design"}
    for name, has_no_effect in idle.items():
        if has_no_effect and getattr(arguments, name) is not None:
            requirement = f"left out with {source}" if source and name != "squeeze" else "left out without --grasp"
            raise sr.ParameterError(f"--{name}", getattr(arguments, name), requirement)
    if arguments.nearest and not required:
        raise sr.ParameterError("--nearest", True, "given with --antenna or --grasp")
    if arguments.design is not None:
        design = sr.load_result(arguments.design)
        if not isinstance(design, helix.HelixDesign):
            raise sr.ParameterError("--design", str(arguments.design), f"a saved helix design, not a {type(design).__name__}")
        return design
    if arguments.angle is not None and not 0.0 <= arguments.angle < 90.0:
        raise sr.ParameterError("--angle", arguments.angle, "in [0, 90) degrees")
    default = sr.HelixTube()
    diameter = default.diameter if arguments.diameter is None else arguments.diameter
    handedness = arguments.handedness or default.handedness
    given: dict[str, Any] = {"handedness": handedness, "on_unrealisable": "nearest" if arguments.nearest else "error"}
    if required:
        radius, rise, turns = required
        given |= {"turns": turns, "diameter": diameter}
        try:
            if arguments.antenna:
                return helix.design_antenna(radius, rise, **given)
            return helix.design_grasp(radius, rise, squeeze=arguments.squeeze or 0.0, **given)
        except sr.SelfIntersection as error:
            message = f"{error.contact}; --nearest takes the nearest helix that can be made"
            raise sr.SelfIntersection(message, contact=error.contact) from error
    contraction = default.contraction if arguments.contraction is None else arguments.contraction
    angle = default.angle if arguments.angle is None else math.radians(arguments.angle)
    length = default.length if arguments.length is None else arguments.length
    turns = float(helix.turns(helix.forward(contraction, angle, diameter), angle, length))
    return helix.HelixDesign(contraction, angle, diameter, turns, handedness)


def summarise(tube: sr.HelixTube, design: helix.HelixDesign, pattern: helix.Pattern, loaded: sr.Equilibrium) -> dict[str, Any]:
    """Return the numbers of the table."""
    model, shape = loaded.model, design.shape
    unloaded = sr.solve_equilibrium(model, ()).tip_position
    wrinkling = model.spring_groups[0].wrinkling_moment
    error = helix.shape_error(pattern)
    return {
        "contraction": design.contraction,
        "angle_deg": math.degrees(design.angle),
        "diameter_m": design.diameter,
        "tube_length_m": design.tube_length,
        "handedness": design.handedness,
        "outer_radius_m": float(shape.outer_radius),
        "inner_radius_m": float(shape.inner_radius),
        "centre_radius_m": float(shape.centre_radius),
        "turn_height_m": float(shape.turn_height),
        "turns": design.turns,
        "height_m": design.height,
        "self_contact": design.contact.describe(),
        "actuator_tension_N": float(helix.actuator_tension(design.contraction, design.angle, design.diameter, tube.pressure)),
        "material_twist_deg_per_m": math.degrees(
            float(helix.material_twist(design.contraction, design.angle, design.diameter, design.handedness))
        ),
        "pinches": pattern.count,
        "method": pattern.method,
        "pattern_error_m": error.largest_aligned,
        "weight_N": 9.81 * tube.mass,
        "tip_m": loaded.tip_position.tolist(),
        "sag_m": float(np.linalg.norm(loaded.tip_position - unloaded)),
        "largest_moment_N_m": float(loaded.link_moments.max()),
        "wrinkling_moment_N_m": wrinkling,
        "residual_N_m": loaded.residual,
        "stable": loaded.stable,
        "wrinkled": loaded.wrinkled,
    }


def table(summary: dict[str, Any]) -> str:
    """Return the numbers as a table of text."""

    def mm(name: str) -> str:
        return f"{1e3 * summary[name]:.1f} mm"

    pieces = f"{summary['pinches']} {PIECES[summary['method']]}"
    rows = [
        ("actuator", f"contraction {summary['contraction']:.4f} at {summary['angle_deg']:.3f} degrees"),
        ("tube", f"{mm('diameter_m')} wide, {mm('tube_length_m')} long uninflated"),
        (
            "helix",
            f"{summary['handedness']}-handed, {summary['turns']:.2f} turns of {mm('turn_height_m')}, {mm('height_m')} in all",
        ),
        ("radius", f"{mm('inner_radius_m')} inside, {mm('centre_radius_m')} centre line, {mm('outer_radius_m')} outside"),
        ("self-contact", summary["self_contact"]),
        ("actuator tension", f"{summary['actuator_tension_N']:.2f} N"),
        ("twist of the wall", f"{summary['material_twist_deg_per_m']:.1f} degrees per metre of tube"),
        ("template", f"{pieces}; deviation from the smooth helix up to {mm('pattern_error_m')}"),
        ("weight", f"{summary['weight_N']:.3f} N, without the base"),
        ("tip under load", "  ".join(f"{value + 0.0:.6f}" for value in summary["tip_m"]) + " m"),
        ("moved by the load", mm("sag_m")),
        (
            "largest moment",
            f"{summary['largest_moment_N_m']:.4f} N m of {summary['wrinkling_moment_N_m']:.4f} N m at the first wrinkle",
        ),
        ("certified stable", f"{'yes' if summary['stable'] else 'NO'}   (residual {summary['residual_N_m']:.1e} N m)"),
    ]
    lines = ["", *(f"{name:<18}{text}" for name, text in rows)]
    if summary["wrinkled"]:
        lines.append("WARNING: the tube wrinkles under this load; its linear stiffness no longer holds.")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
