"""`softrobots pcc`: segments of constant curvature in closed form, from muscle lengths to arcs and poses and back."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softrobots import constant_curvature
from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.reports.answers import Fact, add_json, answer_of, print_answer
from softrobots.constant_curvature import Arc
from softrobots.constant_curvature.poses import FRAMES
from softrobots.core.checks import FloatArray, positive_array
from softrobots.core.errors import ParameterError
from softrobots.core.summary import aligned
from softrobots.core.suspicion import stretched_too_far
from softrobots.robots import PccArm

REST = float(PccArm.segment_lengths[0])
"""Default rest length of a segment [m]."""

_EXAMPLES = """examples:
  softrobots pcc forward 0.50 0.53 0.55  0.54 0.51 0.52            muscle lengths of two segments -> arcs, poses
  softrobots pcc forward 0.50 0.53 0.55 --distance 0.03
  softrobots pcc forward 0.5 0.52 0.5 0.48 --azimuths 0 1.5708 3.1416 -1.5708     one segment of four muscles
  softrobots pcc inverse --arc 0.52 0.7 -0.4 --arc 0.53 0.5 1.2    arcs -> muscle lengths

All lengths in m, all angles in rad. Defaults are those of the robot pcc_arm. These forms know no load and no weight;
`softrobots solve pcc_arm` and `softrobots ik pcc_arm`, which finds the lengths for a position of the tip, do.
"""

_JSON = """With --json: one object with these names, and their units under "units": muscle_lengths (segment, muscle),
muscle_extension (length over rest length, less 1), muscle_residual (segment), arc_length, arc_bending, arc_azimuth (segment),
transforms (segment, 4, 4; end of a segment to base), tip_position, tip_direction (its z axis), and frame.
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "pcc",
        help="constant curvature in closed form: muscle lengths, arcs, poses",
        description="Segments of constant curvature in closed form, without load: any number of segments and muscles.",
        epilog=_EXAMPLES,
    )
    forms = parser.add_subparsers(dest="form", metavar="FORM", required=True, title="forms")

    forward = _form(forms, "forward", _forward, "muscle lengths -> arcs and poses")
    help_text = "muscle lengths, segment by segment from the base, as many per segment as --azimuths has [m]"
    add_numbers(forward, "lengths", "L", help_text, nargs="+")
    help_text = "largest difference of more than three muscle lengths from those of an arc [m] (%(default)g)"
    add_numbers(forward, "--tolerance", "T", help_text, default=1e-6)

    inverse = _form(forms, "inverse", _inverse, "arcs -> muscle lengths and poses")
    help_text = (
        "an arc: length of the backbone [m], bending angle [rad], azimuth of its plane [rad]; once per segment, base to tip "
        "(required)"
    )
    add_numbers(inverse, "--arc", "LENGTH BENDING AZIMUTH", help_text, action="append", required=True, dest="arcs")


def _form(forms: Any, name: str, run: Callable[[argparse.Namespace], None], summary: str) -> argparse.ArgumentParser:
    """Add a form, with the options that all of them have."""
    parser: argparse.ArgumentParser = forms.add_parser(
        name, help=summary, description=f"Constant curvature in closed form: {summary}.", epilog=_JSON
    )
    help_text = f"distance of the muscles from the backbone, one number or one per segment [m] ({PccArm.muscle_distance})"
    add_numbers(parser, "--distance", "D", help_text, nargs="+", default=[PccArm.muscle_distance])
    azimuths = " ".join(f"{azimuth:.4f}".rstrip("0").rstrip(".") for azimuth in constant_curvature.AZIMUTHS)
    help_text = f"azimuths of the muscles of a segment in its base frame, from x towards y, three or more [rad] ({azimuths})"
    add_numbers(parser, "--azimuths", "A", help_text, nargs="+", default=list(constant_curvature.AZIMUTHS))
    help_text = "turn about the backbone before each segment, one per segment [rad] (0, then pi/3 each)"
    add_numbers(parser, "--offsets", "A", help_text, nargs="+")
    help_text = f"rest length of a segment and its muscles, one number or one per segment [m] ({REST})"
    add_numbers(parser, "--rest", "L", help_text, nargs="+")
    parser.set_defaults(run=run)
    help_text = "frame at the end of a segment: without torsion, or turning with the bending plane as the paper's (%(default)s)"
    parser.add_argument("--frame", choices=FRAMES, default=FRAMES[0], help=help_text)
    add_json(parser)
    return parser


def _forward(arguments: argparse.Namespace) -> None:
    """Muscle lengths to arcs."""
    lengths, count = np.array(arguments.lengths), len(arguments.azimuths)
    if len(lengths) % count:
        raise ParameterError("L", arguments.lengths, f"a multiple of {count} numbers, {count} muscles per segment [m]")
    lengths = lengths.reshape(-1, count)
    distance = _per_segment("--distance", arguments.distance, len(lengths))
    rest = np.repeat(_per_segment("--rest", arguments.rest or [REST], len(lengths)), count)
    names = [f"L{place}" for place in range(1, lengths.size + 1)]
    requirement = stretched_too_far(names, lengths.ravel().tolist(), rest.tolist())
    if requirement is not None:
        raise ParameterError("L", arguments.lengths, requirement)
    arcs = constant_curvature.arc_from_muscles(lengths, distance, arguments.azimuths, arguments.tolerance)
    _answer(arguments, lengths, arcs, distance)


def _inverse(arguments: argparse.Namespace) -> None:
    """Arcs to muscle lengths."""
    arcs = Arc(*np.array(arguments.arcs).T)
    distance = _per_segment("--distance", arguments.distance, len(arguments.arcs))
    lengths = constant_curvature.muscles_from_arc(arcs, distance, arguments.azimuths)
    _answer(arguments, lengths, arcs, distance)


def _per_segment(name: str, values: Sequence[float], count: int) -> FloatArray:
    """One positive number for each segment, from one for all or one for each."""
    if len(values) not in (1, count):
        raise ParameterError(name, values, f"one number, or one for each of the {count} segments [m]")
    return np.array(np.broadcast_to(positive_array(name, values, "m"), (count,)))


def _answer(arguments: argparse.Namespace, lengths: FloatArray, arcs: Arc, distance: FloatArray) -> None:
    """Print the facts of the segments.

    Args:
        arguments: The options.
        lengths: Muscle lengths, shape (segments, muscles) [m].
        arcs: Their arcs, shape (segments,).
        distance: Distance of the muscles from the backbone, shape (segments,) [m].
    """
    azimuths, offsets, frame = arguments.azimuths, arguments.offsets, arguments.frame
    rest = _per_segment("--rest", arguments.rest or [REST], len(lengths))
    transforms = constant_curvature.chain_transforms(arcs, offsets, frame)
    residual = constant_curvature.muscle_residual(lengths, distance, azimuths)
    facts = [
        Fact("muscle_lengths", lengths, "m", "muscle lengths"),
        Fact("muscle_extension", lengths / rest[:, None] - 1.0, "-", "extension of the muscles"),
        Fact("muscle_residual", residual, "m", "miss of the muscles"),
        Fact("arc_length", arcs.length, "m", "length of the backbone"),
        Fact("arc_bending", arcs.bending, "rad", "bending angle"),
        Fact("arc_azimuth", arcs.azimuth, "rad", "azimuth of the bending plane"),
        Fact("transforms", transforms, "m", "poses of the ends of the segments"),
        Fact("tip_position", transforms[-1, :3, 3], "m", "tip"),
        Fact("tip_direction", transforms[-1, :3, 2], "-", "tip points along"),
        Fact("frame", frame, "", "frame"),
    ]
    print_answer(arguments, answer_of(facts), _lines(facts))


def _lines(facts: list[Fact]) -> list[str]:
    """The answer for a person."""
    values = {fact.name: fact.value for fact in facts}
    arcs = zip(values["arc_length"], values["arc_bending"], values["arc_azimuth"], strict=True)
    rows: list[tuple[str, ...]] = [("segment", "backbone [m]", "bending [rad]", "azimuth [rad]")]
    rows += [(str(number), *map(_six, arc)) for number, arc in enumerate(arcs, start=1)]
    muscle_rows: list[tuple[str, ...]] = [("segment", "muscle lengths [m] (extension)")]
    for number, (lengths, shares) in enumerate(zip(values["muscle_lengths"], values["muscle_extension"], strict=True), start=1):
        muscles = (f"{length:.6f} ({100 * share:+.1f} %)" for length, share in zip(lengths, shares, strict=True))
        muscle_rows.append((str(number), "  ".join(muscles)))
    lines = [*aligned(rows), "", *aligned(muscle_rows), ""]
    lines += [f"pose of the tip in the base, {values['frame'].replace('_', '-')} frames [-, m]"]
    rows = [tuple(map(_six, row)) for row in values["transforms"][-1]]
    lines += aligned(rows, indent="  ", right=range(4))
    worst = float(np.max(values["muscle_residual"]))
    if worst > 1e-12:  # three muscles always fit, up to rounding
        lines += ["", f"the lengths miss those of the arcs by up to {worst:.3g} m"]
    return lines


def _six(number: float) -> str:
    return f"{round(float(number), 6) + 0.0:.6f}"
