"""`softrobots characterise`: stiffness and largest moment of a link from a bending test."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.options.output_files import add_output, add_plot, check_files, save, write_plot
from softrobots.cli.reports.answers import Fact, add_json, answer_of, print_answer
from softrobots.core.summary import facts
from softrobots.inflated_beam import BendingTest, fit_characterisation, moment_limits, read_characterisation
from softrobots.view.figures.inflated_link import characterisation

_EXAMPLES = """examples:
  softrobots characterise bending.csv --pressure 50e3 --radius 0.055 --plot bending.png
  softrobots characterise probe.csv --pressure 50e3 --radius 0.055 --probe-distance 0.5 --hinge-offset 0.03 --json
  softrobots characterise bending.csv --pressure 50e3 --radius 0.055 --angle-offset 0     a zero that is known: as the paper
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "characterise",
        help="fit stiffness and largest moment of a link to a bending test",
        description="Fit the moment-angle law of an inflated link to the raw data of a bending test: a CSV file whose first "
        "line names columns with their unit, 'angle [deg]' (rad, mrad) and 'moment [N m]' (N mm), or 'displacement [mm]' (m) "
        "and 'force [N]' of a probe. Exit status 0 if there is a fit, 2 after bad input.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("data", type=Path, metavar="DATA.csv", help="measured points")
    add_numbers(parser, "--pressure", "P", "gauge pressure of the test [Pa] (required)", required=True)
    add_numbers(parser, "--radius", "R", "radius of the link [m] (required)", required=True)
    add_numbers(parser, "--angle-offset", "A", "zero error of the angle, where it is known [rad] (fitted)")
    rig = BendingTest()
    for name, what in (
        ("probe_distance", "distance of the probe's line from the clamp"),
        ("hinge_offset", "distance of the hinge from the clamp"),
        ("offset", "distance of the probe's centre from the axis of the link"),
    ):
        option = f"--{name.replace('_', '-')}"
        add_numbers(parser, option, "X", f"{what}, for displacement and force [m] (%(default)s)", default=getattr(rig, name))
    add_output(parser, "the fit", "as NPZ, for softrobots.load_result")
    add_plot(parser, "the points, the fit and the limits of the moment")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Read, fit and print the answer."""
    check_files(arguments, ".npz")
    tube = {"pressure": arguments.pressure, "radius": arguments.radius}
    rig = BendingTest(probe_distance=arguments.probe_distance, hinge_offset=arguments.hinge_offset, offset=arguments.offset)
    data = read_characterisation(arguments.data, rig)
    fit = fit_characterisation(*data, **tube, angle_offset=arguments.angle_offset)
    limits = moment_limits(**tube)
    answer = [
        Fact("stiffness", fit.stiffness, "N m/rad"),
        Fact("stiffness_std", fit.stiffness_std, "N m/rad"),
        Fact("stiffness_interval", np.array(fit.stiffness_interval), "N m/rad"),
        Fact("angle_offset", fit.angle_offset, "rad"),
        Fact("angle_offset_std", fit.angle_offset_std, "rad"),
        Fact("max_moment", fit.max_moment, "N m"),
        Fact("mean_moment_above_wrinkling", fit.mean_moment_above_wrinkling, "N m"),
        Fact("slack_moment", limits.slack, "N m"),
        Fact("wrinkling_moment", fit.wrinkling_moment, "N m"),
        Fact("collapse_moment", limits.collapse, "N m"),
        Fact("n_linear", fit.n_linear, "-"),
        Fact("n_saturated", fit.n_saturated, "-"),
        Fact("n_points", len(data.angle), "-"),
    ]
    files = save(arguments, fit) + write_plot(arguments, lambda: characterisation(data, fit, **tube))
    use = f"--set stiffness={fit.stiffness:.6g}" + ("" if fit.max_moment is None else f" max_moment={fit.max_moment:.6g}")
    others = [("first slack fibre at", f"{limits.slack:.6g} N m"), ("collapse at", f"{limits.collapse:.6g} N m")]
    table = facts([*fit.summary_facts(), *others, ("points in all", str(len(data.angle)))])
    lines = f"{table.text()}\n\nas a robot: softrobots solve inflatable_arm {use}"
    print_answer(arguments, answer_of(answer), lines, files)
