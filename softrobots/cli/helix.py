"""`softrobots helix`: helical actuation of an inflated tube in closed form, from the actuator to the helix and back."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from softrobots import helix
from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.reports.answers import Fact, add_json, answer_of, lines_of, print_answer
from softrobots.core.errors import ParameterError, SelfIntersection
from softrobots.core.files import new_file
from softrobots.core.result_file import save_result
from softrobots.helix.template import write_template
from softrobots.robots import HelixTube

_EXAMPLES = """examples:
  softrobots helix forward --contraction 0.66 --angle 0.0873       actuator -> helix
  softrobots helix inverse --outer-radius 0.0854 --inner-radius 0.0523 --pitch 0.02796
  softrobots helix measure --outer-arc 0.5647 --inner-arc 0.3727   arcs of one turn -> helix, actuator
  softrobots helix design --antenna 0.07 0.18 3 --template antenna.svg -o antenna.json

All lengths in m, all angles in rad (5 degrees are 0.0873 rad). Defaults are those of the robot helix_tube.
`softrobots solve helix_tube` knows its weight and loads; scripts/helix_tube.py makes all files of a tube at once.
"""

_JSON = """With --json: one object with the facts by their names in the library, their units under "units", and the files
that `design` has written under "files".
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "helix",
        help="helical actuation of a tube in closed form: shape, inverse, measurement, design",
        description="An inflated tube that an actuator around it bends into a helix, in closed form.",
        epilog=_EXAMPLES,
    )
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True, title="forms")

    forward = _form(forms, "forward", _forward, "actuator -> helix")
    help_text = "contracted over original length of the actuator, in (0, 1] [-] (%(default)s)"
    add_numbers(forward, "--contraction", "C", help_text, default=HelixTube.contraction)
    help_text = f"angle of the actuator to the axis of the tube, in [0, pi/2) [rad] ({HelixTube.angle:.6g})"
    add_numbers(forward, "--angle", "A", help_text, default=HelixTube.angle)
    _add_diameter(forward)

    inverse = _form(forms, "inverse", _inverse, "helix -> actuator")
    add_numbers(inverse, "--outer-radius", "R", "radius of the path opposite the actuator [m] (required)", required=True)
    help_text = "radius of the path of the actuator, negative beyond the axis of the helix [m] (required)"
    add_numbers(inverse, "--inner-radius", "R", help_text, required=True)
    rise = inverse.add_mutually_exclusive_group(required=True)
    add_numbers(rise, "--pitch", "B", "rise per turn angle [m/rad] (this or --turn-height is required)")
    add_numbers(rise, "--turn-height", "H", "rise of a whole turn, 2 pi times the pitch [m]")

    measure = _form(forms, "measure", _measure, "measured lengths of both paths -> helix, actuator")
    add_numbers(measure, "--outer-arc", "L", "length of the path opposite the actuator [m] (required)", required=True)
    add_numbers(measure, "--inner-arc", "L", "length of the actuator [m] (required)", required=True)
    add_numbers(measure, "--turns", "N", "turns that were measured [-] (%(default)g)", default=1.0)
    _add_diameter(measure)

    design = _form(forms, "design", _design, "purpose of the helix -> actuator and length of the tube")
    purpose, names = design.add_mutually_exclusive_group(required=True), "RADIUS RISE TURNS"
    help_text = (
        "helix whose centre line has this radius [m], rise per turn [m] and number of turns [-] (this or --grasp is required)"
    )
    add_numbers(purpose, "--antenna", names, help_text)
    help_text = "helix around an object of this radius [m], with this rise per turn [m] and number of turns [-]"
    add_numbers(purpose, "--grasp", names, help_text)
    help_text = "by how much the radius of the helix of --grasp is smaller than that of the object [m] (0)"
    add_numbers(design, "--squeeze", "S", help_text)
    help_text = "take the nearest helix without self-contact if the required one touches itself (an error)"
    design.add_argument("--nearest", action="store_true", help=help_text)
    _add_diameter(design)
    design.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="save the design in a new file (none)")
    help_text = "draw the unrolled tube to scale, with where to pinch it, into a new file (none)"
    design.add_argument("--template", type=Path, metavar="FILE.svg", help=help_text)
    design.add_argument("--overwrite", action="store_true", help="allow files to be replaced")
    help_text = "spacing of the pinches along the actuator, adjusted to a whole number of them [m] (%(default)s)"
    add_numbers(design, "--spacing", "S", help_text, default=0.02)
    help_text = "how the actuator is fabricated (%(default)s)"
    design.add_argument("--method", choices=helix.METHODS, default=helix.METHODS[0], help=help_text)


def _form(forms: Any, name: str, run: Callable[[argparse.Namespace], None], summary: str) -> argparse.ArgumentParser:
    """Add a form, with the options that all of them have."""
    parser: argparse.ArgumentParser = forms.add_parser(
        name, help=summary, description=f"Helical actuation in closed form: {summary}.", epilog=_JSON
    )
    if name != "design":
        help_text = "length of the uninflated tube, for turns, height and volume [m] (%(default)s)"
        add_numbers(parser, "--length", "L", help_text, default=HelixTube.length)
    help_text = "gauge pressure, for the tension of the actuator [Pa] (%(default)g)"
    add_numbers(parser, "--pressure", "P", help_text, default=HelixTube.pressure)
    help_text = "handedness of the helix (%(default)s)"
    parser.add_argument("--handedness", choices=helix.HANDEDNESS, default=HelixTube.handedness, help=help_text)
    add_json(parser)
    parser.set_defaults(run=run)
    return parser


def _add_diameter(parser: argparse.ArgumentParser) -> None:
    add_numbers(parser, "--diameter", "D", "diameter of the tube [m] (%(default)s)", default=HelixTube.diameter)


def _forward(arguments: argparse.Namespace) -> None:
    """Actuator to helix."""
    shape = helix.forward(arguments.contraction, arguments.angle, arguments.diameter)
    actuator = helix.Actuator(*map(np.asarray, (arguments.contraction, arguments.angle, arguments.diameter)))
    _answer(arguments, shape, actuator)


def _inverse(arguments: argparse.Namespace) -> None:
    """Helix to actuator."""
    pitch = arguments.turn_height / (2.0 * np.pi) if arguments.pitch is None else arguments.pitch
    shape = helix.HelixShape(*map(np.asarray, (arguments.outer_radius, arguments.inner_radius, pitch)))
    _answer(arguments, shape, helix.inverse(shape))


def _measure(arguments: argparse.Namespace) -> None:
    """Measured arcs to helix and actuator."""
    shape = helix.measure(arguments.outer_arc, arguments.inner_arc, arguments.diameter, arguments.turns)
    _answer(arguments, shape, helix.inverse(shape))


def _answer(arguments: argparse.Namespace, shape: helix.HelixShape, actuator: helix.Actuator) -> None:
    """Print the facts of a tube of the length that was given."""
    facts = _tube_facts(arguments, shape, actuator, arguments.length)
    print_answer(arguments, answer_of(facts), lines_of(facts))


def _design(arguments: argparse.Namespace) -> None:
    """Required helix to actuator and tube."""
    for path in (arguments.output, arguments.template):
        if path is not None:
            new_file(path, overwrite=arguments.overwrite)  # refused before the work
    if arguments.squeeze is not None and arguments.grasp is None:
        raise ParameterError("--squeeze", arguments.squeeze, "left out without --grasp")
    design = _designed(arguments)
    pattern = None
    if arguments.template is not None:
        pattern = helix.pinch_pattern(design, arguments.spacing, arguments.method)
    actuator = helix.Actuator(*map(np.asarray, (design.contraction, design.angle, design.diameter)))
    facts = _tube_facts(arguments, design.shape, actuator, design.tube_length)
    deviation = design.deviation
    if deviation is not None:
        radius, turn_height = (round(part, 12) + 0.0 for part in deviation[:2])  # without rounding errors
        facts += [
            Fact("radius_deviation", radius, "m", "radius, less the required"),
            Fact("turn_height_deviation", turn_height, "m", "rise of a turn, less the required"),
        ]
    files: list[Path] = []
    if arguments.output is not None:
        files.append(save_result(design, arguments.output, overwrite=arguments.overwrite))
    if pattern is not None:
        facts += [
            Fact("pinches", pattern.count, "-", f"pieces on the template ({pattern.method})"),
            Fact("spacing", pattern.spacing, "m", "from one to the next along the actuator"),
        ]
        files.append(write_template(pattern, arguments.template, overwrite=arguments.overwrite))
    print_answer(arguments, answer_of(facts), lines_of(facts), files)


def _designed(arguments: argparse.Namespace) -> helix.HelixDesign:
    """The design of --antenna or --grasp."""
    radius, rise, turns = arguments.antenna or arguments.grasp
    options: dict[str, Any] = {
        "diameter": arguments.diameter,
        "turns": turns,
        "handedness": arguments.handedness,
        "on_unrealisable": "nearest" if arguments.nearest else "error",
    }
    try:
        if arguments.antenna:
            return helix.design_antenna(radius, rise, **options)
        return helix.design_grasp(radius, rise, squeeze=arguments.squeeze or 0.0, **options)
    except SelfIntersection as error:
        message = f"{error.contact}; --nearest takes the nearest helix that does not touch itself"
        raise SelfIntersection(message, contact=error.contact) from error


def _tube_facts(arguments: argparse.Namespace, shape: helix.HelixShape, actuator: helix.Actuator, length: float) -> list[Fact]:
    """Facts of a tube of an uninflated length [m], by its helix and its actuator."""
    (contraction, angle, diameter), handedness = actuator, arguments.handedness
    tension = helix.actuator_tension(contraction, angle, diameter, arguments.pressure)
    turns, limit = helix.turns(shape, angle, length), helix.contraction_limit(angle)
    contact = helix.self_contact(shape, turns)
    facts = [
        Fact("contraction", contraction, "-", "contraction of the actuator"),
        Fact("angle", angle, "rad", "angle of the actuator"),
        Fact("diameter", diameter, "m", "diameter of the tube"),
        Fact("length", length, "m", "length of the uninflated tube"),
        Fact("handedness", handedness, "", "handedness"),
        Fact("outer_radius", shape.outer_radius, "m", "outer radius of the helix"),
        Fact("centre_radius", shape.centre_radius, "m", "radius of its centre line"),
        Fact("inner_radius", shape.inner_radius, "m", "inner radius"),
        Fact("pitch", shape.pitch, "m/rad", "pitch"),
        Fact("turn_height", shape.turn_height, "m", "rise of a turn"),
        Fact("turns", turns, "-", "turns"),
        Fact("height", helix.height(shape, angle, length), "m", "height"),
        Fact("centre_length", helix.centre_length(contraction, angle, length), "m", "length of the centre line"),
        Fact("volume", helix.volume(contraction, angle, diameter, length), "m^3", "volume"),
    ]
    for path in ("outer", "centre", "inner"):
        curvature, torsion = helix.actuator_curvature_torsion(contraction, angle, diameter, path, handedness)
        facts += [
            Fact(f"{path}_curvature", curvature, "1/m", f"curvature of the {path} path"),
            Fact(f"{path}_torsion", torsion, "1/m", f"torsion of the {path} path"),
        ]
    return [
        *facts,
        Fact("material_twist", helix.material_twist(contraction, angle, diameter, handedness), "rad/m", "twist of the wall"),
        Fact("pressure", arguments.pressure, "Pa", "gauge pressure"),
        Fact("actuator_tension", tension, "N", "tension of the actuator"),
        Fact("contraction_limit", limit, "-", "smallest contraction without self-contact, endless tube"),
        Fact("touches", contact.touches, "", "runs into itself"),
        Fact("contact", contact.describe(), "", "self-contact"),
    ]
