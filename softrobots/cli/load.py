"""`softrobots load`: the force at the tip from what the motors feel."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import add_gravity, gravity_of
from softrobots.cli.options.result_file import add_output, check_output, save
from softrobots.cli.options.robot_argument import add_model, check_one_each, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, aligned, tell, written_lines
from softrobots.cli.reports.coordinate_units import load_units, motor_units, together
from softrobots.cli.reports.equilibrium_report import equilibrium_answer, equilibrium_lines
from softrobots.cli.reports.facts import Fact, answer_of, spoken
from softrobots.statics.load_estimation import METHODS, LoadEstimate, check_feels, estimate_load

_EXAMPLES = """examples:
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 10.193 -16.605 -7.675
  softrobots load inflatable_arm --motors 0.3 0.6 -0.8 --torques 10.193 -16.605 -7.675 --torque-std 0.05 --json
  softrobots load inflatable_arm --motors 0 0 0 --torques 11.9 -17.8 -8.8 --torque-std 0.1    a straight elbow feels less
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "load",
        help="estimate the force at the tip from motor torques",
        description="Find the force at the tip, and the shape of the robot, from motor coordinates and torques. Directions in "
        "which the motors feel nothing are named. Exit status 0 if a force explains the torques, 1 if none does, 2 after bad "
        "input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    told = "motor joints, then muscles, base to tip [rad or m] (relaxed)"
    parser.add_argument("--motors", type=float, nargs="+", metavar="Q", help=told)
    told = "load on each motor, minus what it exerts, as motor_torques in the answer of softrobots solve [N m or N] (required)"
    parser.add_argument("--torques", type=float, nargs="+", metavar="TAU", required=True, help=told)
    told = "standard deviation of the torques, one for all or one for each [N m or N]: tells that of the force (unknown)"
    parser.add_argument("--torque-std", type=float, nargs="+", metavar="S", help=told)
    parser.add_argument("--frame", metavar="LINK", help="where the force acts (the tip)")
    add_gravity(parser)
    parser.add_argument(
        "--method", choices=METHODS, default="newton", help="the solver; alternation is the paper's (%(default)s)"
    )
    parser.add_argument("--max-iterations", type=int, metavar="N", help="most steps [-] (100 for newton, 1000 for alternation)")
    add_output(parser, "the estimate as NPZ, for softrobots.load_result")
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Estimate and tell."""
    check_output(arguments, ".npz")
    model = statics_model_of(arguments)
    check_feels(model)
    motors = motors_of(model, arguments.motors)
    units, noise = load_units(motor_units(model)), arguments.torque_std
    check_one_each("--torques", arguments.torques, model.motor_joints, units)
    if noise is not None and len(noise) > 1:
        check_one_each("--torque-std", noise, model.motor_joints, units)
    found = estimate_load(
        model,
        motors,
        arguments.torques,
        method=arguments.method,
        frame=arguments.frame,
        gravity=gravity_of(arguments),
        torque_std=noise[0] if noise is not None and len(noise) == 1 else noise,
        max_iterations=arguments.max_iterations,
    )
    files = save(arguments, found)
    lines = [*equilibrium_lines(found.equilibrium), "", *_lines(found), *written_lines(files)]
    tell(arguments, {**_answer(found), "files": files}, lines)


def _answer(found: LoadEstimate) -> dict[str, Any]:
    units = together(load_units(motor_units(found.equilibrium.model)))
    facts = [
        Fact("force", found.force, "N", ""),
        Fact("force_std", _deviations(found), "N", ""),
        Fact("covariance", found.covariance, "N^2", ""),
        Fact("singular_values", found.singular_values, "m", ""),
        Fact("condition_number", found.condition_number, "-", ""),
        Fact("unobservable_directions", found.unobservable_directions, "-", ""),
        Fact("measured_torques", found.measured_torques, units, ""),
        Fact("torque_std", found.torque_std, units, ""),
        Fact("residual", found.residual, units, ""),
        Fact("iterations", found.iterations, "-", ""),
        Fact("frame", found.frame, "", ""),
        Fact("method", found.method, "", ""),
    ]
    return {**answer_of(facts), "equilibrium": equilibrium_answer(found.equilibrium)}


def _deviations(found: LoadEstimate) -> Any:
    """Standard deviation of each component of the force, over the observable directions [N]; None without noise."""
    return None if found.covariance is None else np.sqrt(np.maximum(np.diag(found.covariance), 0.0))


def _lines(found: LoadEstimate) -> list[str]:
    deviations = _deviations(found)
    rows = [(f"force on {found.frame}", f"{spoken(found.force)} N")]
    if deviations is not None:
        rows.append(("  standard deviation", f"{spoken(deviations)} N"))
    rows += [("singular values", f"{spoken(found.singular_values)} m (condition number {found.condition_number:.3g})")]
    unfelt = [("NOT FELT along", spoken(direction)) for direction in found.unobservable_directions]
    rows += unfelt or [("not felt along", "no direction")]
    rows.append(("torques unexplained", f"{found.residual:.2g} N m, {found.iterations} iterations by {found.method}"))
    return aligned(rows)
