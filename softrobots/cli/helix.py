"""`softrobots helix`: helical actuation of an inflated tube in closed form, from the actuator to the helix and back."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softrobots import helix
from softrobots.cli.options.plot_option import add_plot, check_plot, write_plot
from softrobots.cli.reports.answers import add_json, aligned, tell, written_lines
from softrobots.cli.reports.facts import Fact, answer_of, lines_of
from softrobots.cli.reports.tube_facts import tube_facts
from softrobots.core.errors import ParameterError, SelfIntersection
from softrobots.core.files import new_file
from softrobots.helix.template import write_template
from softrobots.robots import HelixTube

_EXAMPLES = """examples:
  softrobots helix forward --contraction 0.66 --angle 0.0873       actuator -> helix
  softrobots helix inverse --outer-radius 0.0854 --inner-radius 0.0523 --pitch 0.02796
  softrobots helix measure --outer-arc 0.5647 --inner-arc 0.3727   arcs of one turn -> helix, actuator
  softrobots helix design --antenna 0.07 0.18 3 --template antenna.svg -o antenna.json
  softrobots helix limit --angle 0.0436 0.0873 0.1745              smallest contraction without self-contact

All lengths in m, all angles in rad (5 degrees are 0.0873 rad). Defaults are those of the robot helix_tube.
`softrobots solve helix_tube` knows its weight and loads; scripts/helix_tube.py makes all files of a tube at once.
"""

_JSON = """With --json: one object with the facts by their names in the library, their units under "units", and the files
that were written under "files".
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "helix",
        help="helical actuation of a tube in closed form: shape, inverse, measurement, design, limit",
        description="An inflated tube that an actuator around it bends into a helix, in closed form.",
        epilog=_EXAMPLES,
    )
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True, title="forms")

    forward = _form(forms, "forward", _forward, "actuator -> helix")
    told = "contracted over original length of the actuator, in (0, 1] [-] (%(default)s)"
    forward.add_argument("--contraction", type=float, default=HelixTube.contraction, metavar="C", help=told)
    told = f"of the actuator to the axis of the tube, in [0, pi/2) [rad] ({HelixTube.angle:.6g})"
    forward.add_argument("--angle", type=float, default=HelixTube.angle, metavar="A", help=told)
    _add_diameter(forward)

    inverse = _form(forms, "inverse", _inverse, "helix -> actuator")
    told = "radius of the path opposite the actuator [m] (required)"
    inverse.add_argument("--outer-radius", type=float, required=True, metavar="R", help=told)
    told = "radius of the path of the actuator, negative beyond the axis of the helix [m] (required)"
    inverse.add_argument("--inner-radius", type=float, required=True, metavar="R", help=told)
    rise = inverse.add_mutually_exclusive_group(required=True)
    rise.add_argument(
        "--pitch", type=float, metavar="B", help="rise per turn angle [m/rad] (this or --turn-height is required)"
    )
    rise.add_argument("--turn-height", type=float, metavar="H", help="rise of a whole turn, 2 pi times the pitch [m]")

    measure = _form(forms, "measure", _measure, "lengths of both paths, as a tape measures them -> helix, actuator")
    told = "length of the path opposite the actuator [m] (required)"
    measure.add_argument("--outer-arc", type=float, required=True, metavar="L", help=told)
    measure.add_argument("--inner-arc", type=float, required=True, metavar="L", help="length of the actuator [m] (required)")
    measure.add_argument("--turns", type=float, default=1.0, metavar="N", help="turns that were measured [-] (%(default)g)")
    _add_diameter(measure)

    design = _form(forms, "design", _design, "what the helix is for -> actuator and length of the tube")
    wish, names = design.add_mutually_exclusive_group(required=True), ("RADIUS", "RISE", "TURNS")
    told = (
        "helix whose centre line has this radius [m], rise per turn [m] and number of turns [-] (this or --grasp is required)"
    )
    wish.add_argument("--antenna", type=float, nargs=3, metavar=names, help=told)
    told = "helix around an object of this radius [m], with this rise per turn [m] and number of turns [-]"
    wish.add_argument("--grasp", type=float, nargs=3, metavar=names, help=told)
    told = "how much thinner than the object the helix of --grasp is made [m] (0)"
    design.add_argument("--squeeze", type=float, metavar="S", help=told)
    told = "take the nearest helix that can be made if the wish cannot (refuse it)"
    design.add_argument("--nearest", action="store_true", help=told)
    _add_diameter(design)
    design.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="save the design in a new file (none)")
    told = "draw the unrolled tube to scale, with where to pinch it, into a new file (none)"
    design.add_argument("--template", type=Path, metavar="FILE.svg", help=told)
    told = "of the pinches along the actuator, changed a little so that whole ones fit [m] (%(default)s)"
    design.add_argument("--spacing", type=float, default=0.02, metavar="S", help=told)
    told = "how the actuator is made (%(default)s)"
    design.add_argument("--method", choices=helix.METHODS, default=helix.METHODS[0], help=told)

    limit = forms.add_parser(
        "limit",
        help="smallest contraction without self-contact",
        description="The smallest contraction of an actuator at which an endless tube does not run into itself: exact, and by "
        "the rule that a turn rises by a diameter. It does not depend on the diameter.",
        epilog=_JSON,
    )
    told = f"of the actuator to the axis of the tube, one or more, in [0, pi/2) [rad] ({HelixTube.angle:.6g})"
    limit.add_argument("--angle", type=float, nargs="+", default=[HelixTube.angle], metavar="A", help=told)
    _add_diameter(limit)
    add_plot(limit, "radius and pitch over contraction with the limits (up to three angles, above 0 and at most pi/4)")
    add_json(limit)
    limit.set_defaults(run=_limit)


def _form(forms: Any, name: str, run: Callable[[argparse.Namespace], None], told: str) -> argparse.ArgumentParser:
    """A parser with what all forms have that end in a helix."""
    parser: argparse.ArgumentParser = forms.add_parser(
        name, help=told, description=f"Helical actuation in closed form: {told}.", epilog=_JSON
    )
    if name != "design":
        told = "of the uninflated tube, for turns, height and volume [m] (%(default)s)"
        parser.add_argument("--length", type=float, default=HelixTube.length, metavar="L", help=told)
    told = "gauge pressure, for the tension of the actuator [Pa] (%(default)g)"
    parser.add_argument("--pressure", type=float, default=HelixTube.pressure, metavar="P", help=told)
    told = "which way the helix winds (%(default)s)"
    parser.add_argument("--handedness", choices=helix.HANDEDNESS, default=HelixTube.handedness, help=told)
    add_plot(parser, "the tube")
    add_json(parser)
    parser.set_defaults(run=run)
    return parser


def _add_diameter(parser: argparse.ArgumentParser) -> None:
    told = "of the tube [m] (%(default)s)"
    parser.add_argument("--diameter", type=float, default=HelixTube.diameter, metavar="D", help=told)


def _forward(arguments: argparse.Namespace) -> None:
    """Actuator to helix."""
    check_plot(arguments)
    shape = helix.forward(arguments.contraction, arguments.angle, arguments.diameter)
    actuator = helix.Actuator(*map(np.asarray, (arguments.contraction, arguments.angle, arguments.diameter)))
    _answer(arguments, tube_facts(shape, actuator, arguments.length, arguments.pressure, arguments.handedness))


def _inverse(arguments: argparse.Namespace) -> None:
    """Helix to actuator."""
    check_plot(arguments)
    pitch = arguments.turn_height / (2.0 * np.pi) if arguments.pitch is None else arguments.pitch
    shape = helix.HelixShape(*map(np.asarray, (arguments.outer_radius, arguments.inner_radius, pitch)))
    _of_shape(arguments, shape)


def _measure(arguments: argparse.Namespace) -> None:
    """Measured arcs to helix and actuator."""
    check_plot(arguments)
    _of_shape(arguments, helix.measure(arguments.outer_arc, arguments.inner_arc, arguments.diameter, arguments.turns))


def _of_shape(arguments: argparse.Namespace, shape: helix.HelixShape) -> None:
    facts = tube_facts(shape, helix.inverse(shape), arguments.length, arguments.pressure, arguments.handedness)
    _answer(arguments, facts)


def _design(arguments: argparse.Namespace) -> None:
    """A wish to actuator and tube."""
    check_plot(arguments)
    for path in (arguments.output, arguments.template):
        if path is not None:
            new_file(path, overwrite=arguments.overwrite)  # tells at once
    if arguments.squeeze is not None and arguments.grasp is None:
        raise ParameterError("--squeeze", arguments.squeeze, "left out without --grasp")
    design = _designed(arguments)
    pattern = None
    if arguments.template is not None:
        pattern = helix.pinch_pattern(design, arguments.spacing, arguments.method, remainder="respace")
    actuator = helix.Actuator(*map(np.asarray, (design.contraction, design.angle, design.diameter)))
    facts = tube_facts(design.shape, actuator, design.tube_length, arguments.pressure, design.handedness)
    deviation = design.deviation
    if deviation is not None:
        off = (round(part, 12) + 0.0 for part in deviation[:2])  # rounding is not worth telling
        told = {"radius_deviation": "radius, less the wish", "turn_height_deviation": "rise of a turn, less the wish"}
        facts += [Fact(name, part, "m", text) for part, (name, text) in zip(off, told.items(), strict=True)]
    files: list[Path] = []
    if arguments.output is not None:
        files.append(design.save(arguments.output, overwrite=arguments.overwrite))
    if pattern is not None:
        facts += [
            Fact("pinches", pattern.count, "-", f"pieces on the template ({pattern.method})"),
            Fact("spacing", pattern.spacing, "m", "from one to the next along the actuator"),
        ]
        files.append(write_template(pattern, arguments.template, overwrite=arguments.overwrite))
    _answer(arguments, facts, files)


def _designed(arguments: argparse.Namespace) -> helix.HelixDesign:
    """The design that the options ask for."""
    radius, rise, turns = arguments.antenna or arguments.grasp
    given: dict[str, Any] = {
        "diameter": arguments.diameter,
        "turns": turns,
        "handedness": arguments.handedness,
        "on_unrealisable": "nearest" if arguments.nearest else "error",
    }
    try:
        if arguments.antenna:
            return helix.design_antenna(radius, rise, **given)
        return helix.design_grasp(radius, rise, squeeze=arguments.squeeze or 0.0, **given)
    except SelfIntersection as error:
        told = f"{error.contact}; --nearest takes the nearest helix that can be made"
        raise SelfIntersection(told, contact=error.contact) from error


def _limit(arguments: argparse.Namespace) -> None:
    """Angles to the limits of contraction."""
    check_plot(arguments)
    exact = helix.contraction_limit(arguments.angle, arguments.diameter)
    simple = helix.simple_contraction_limit(arguments.angle)
    facts = [
        Fact("angle", arguments.angle, "rad", "angle of the actuator"),
        Fact("contraction_limit", exact, "-", "smallest contraction, exact"),
        Fact("simple_contraction_limit", simple, "-", "by the simple rule"),
    ]

    def draw() -> Any:
        from softrobots.view.figures import helices

        return helices.radius_and_pitch(arguments.angle, arguments.diameter)

    written = write_plot(arguments, draw)
    rows = [("angle [rad]", "smallest contraction [-]", "by the simple rule [-]")]
    rows += [tuple(f"{number:.6f}" for number in row) for row in zip(arguments.angle, exact, simple, strict=True)]  # type: ignore[misc]
    tell(arguments, answer_of(facts) | {"files": written}, [*aligned(rows), *written_lines(written)])


def _answer(arguments: argparse.Namespace, facts: list[Fact], files: Sequence[Path] = ()) -> None:
    """Print the facts, and draw the tube."""
    values = {fact.name: fact.value for fact in facts}

    def draw() -> Any:
        from softrobots.view.figures import helices

        tilt, share = [float(values["angle"])], [float(values["contraction"])]
        return helices.grid(share, tilt, float(values["diameter"]), values["length"], values["handedness"])

    written = [*files, *write_plot(arguments, draw)]
    tell(arguments, answer_of(facts) | {"files": written}, [*lines_of(facts), *written_lines(written)])
