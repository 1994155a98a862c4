"""`softrobots load`: the force at the tip from motor torques."""

from __future__ import annotations

import argparse
from typing import Any

from softrobots.cli.options.command_line import add_gravity, add_numbers, gravity_of
from softrobots.cli.options.load_argument import add_environment, environment_of
from softrobots.cli.options.output_files import add_output, check_files, save
from softrobots.cli.options.robot_argument import (
    add_model,
    add_motors,
    check_one_each,
    motors_of,
    one_or_each,
    statics_model_of,
)
from softrobots.cli.reports.answers import Fact, add_json, answer_of, attributes, print_answer
from softrobots.cli.reports.robot_answers import equilibrium_answer
from softrobots.model.actuators import joined_units, load_units
from softrobots.model.loader import with_points
from softrobots.statics.equilibrium_summary import unit_per_newton
from softrobots.statics.load_estimation import METHODS, LoadEstimate, check_feels, estimate_load

_EXAMPLES = """examples:
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 10.193 -16.605 -7.675
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 10.193 -16.605 -7.675 --torque-std 0.05 --json
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 10.2 -16.6 -7.7 --stiffness-std 0.0325 --motor-angle-std 0.009
  softrobots load inflatable_arm --motors 0 0 0 --torques 11.9 -17.8 -8.8 --torque-std 0.1    a straight elbow feels less
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 2.13 -5.02 0 --frame link_1 --point 0.4 0 0 --direction 0 1 -2
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "load",
        help="estimate the force at the tip from motor torques",
        description="Find the force at the tip, and the shape of the robot, from motor coordinates and torques. Directions of "
        "force that cause no motor torque are listed. Exit status 0 if a force explains the torques, 1 if none does, 2 after "
        "bad input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    add_motors(parser, "motor joints, then muscles, base to tip [rad or m] (relaxed)")
    help_text = "load on each motor, the negative of what it exerts, as motor_torques of softrobots solve [N m or N] (required)"
    add_numbers(parser, "--torques", "TAU", help_text, nargs="+", required=True)
    help_text = "standard deviation of the torques, one for all or one for each [N m or N]; gives that of the force (unknown)"
    add_numbers(parser, "--torque-std", "S", help_text, nargs="+")
    help_text = "standard deviation of the stiffness as a share of it, one for all springs or one for each [-] (unknown)"
    add_numbers(parser, "--stiffness-std", "S", help_text, nargs="+")
    help_text = "standard deviation of the motor coordinates, one for all or one for each [rad or m] (unknown)"
    add_numbers(parser, "--motor-angle-std", "S", help_text, nargs="+")
    parser.add_argument(
        "--no-restart",
        action="store_true",
        help="search once, from zero force: ten times as fast, but without other forces that explain the torques",
    )
    parser.add_argument("--frame", metavar="LINK", help="where the force acts (the tip)")
    add_numbers(parser, "--point", "X Y Z", "point where it acts, in the axes of the link of --frame [m] (its origin)")
    help_text = "direction that the force has, as at a contact without friction, world axes, of any length [-] (any)"
    add_numbers(parser, "--direction", "X Y Z", help_text)
    add_gravity(parser)
    add_environment(parser)
    parser.add_argument(
        "--method", choices=METHODS, default="newton", help="the solver; alternation is the paper's (%(default)s)"
    )
    parser.add_argument("--max-iterations", type=int, metavar="N", help="most steps [-] (100 for newton, 1000 for alternation)")
    add_output(parser, "the estimate")
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Estimate and print the answer."""
    check_files(arguments)
    model, frame = statics_model_of(arguments), arguments.frame
    check_feels(model)
    if arguments.point is not None:
        link = model.tip if frame is None else frame
        frame = f"point_of_{link}"
        model = with_points(model, {frame: (link, arguments.point)})
    motors = motors_of(model, arguments.motors)
    units = load_units(model.actuators.units)
    check_one_each("--torques", arguments.torques, model.motor_joints, units)
    deviations = {
        "torque_std": one_or_each("--torque-std", arguments.torque_std, model.motor_joints, units),
        "stiffness_std": one_or_each("--stiffness-std", arguments.stiffness_std, model.springs.names, ["-"] * model.n_springs),
        "motor_angle_std": one_or_each(
            "--motor-angle-std", arguments.motor_angle_std, model.motor_joints, model.actuators.units
        ),
    }
    estimate = estimate_load(
        model,
        motors,
        arguments.torques,
        method=arguments.method,
        frame=frame,
        directions=arguments.direction,
        gravity=gravity_of(arguments),
        environment=environment_of(arguments),
        restart=not arguments.no_restart,
        **deviations,
        max_iterations=arguments.max_iterations,
    )
    files = save(arguments, estimate)
    print_answer(arguments, _answer(estimate), estimate.summary(None), files)


def _answer(estimate: LoadEstimate) -> dict[str, Any]:
    motors = estimate.equilibrium.model.actuators.units
    torques = joined_units(load_units(motors))
    facts = [
        Fact("force", estimate.force, "N"),
        Fact("force_std", estimate.force_std, "N"),
        Fact("covariance", estimate.covariance, "N^2"),
        Fact("covariance_parts", dict(estimate.covariance_parts), "N^2"),
        *attributes(
            estimate,
            singular_values=unit_per_newton(motors),
            condition_number="-",
            unobservable_directions="-",
            measured_torques=torques,
        ),
        *attributes(estimate, torque_std=torques, stiffness_std="-", motor_angle_std=joined_units(motors)),
        *attributes(estimate, residual=torques, iterations="-", frame="", method=""),
    ]
    others = [
        answer_of([Fact("force", other.force, "N")]) | {"equilibrium": equilibrium_answer(other.equilibrium)}
        for other in estimate.alternatives
    ]
    return {**answer_of(facts), "equilibrium": equilibrium_answer(estimate.equilibrium), "alternatives": others}
