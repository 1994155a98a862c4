"""The subcommands of `softrobots`, one module each.

A module has `add_parser(subparsers)`, which adds its parser and sets `run` on it: a function of the parsed arguments that does
the job, raises errors of `softrobots.errors`, and returns None, or whether all that it looked at is well.
"""

from softrobots.commands import bench, completion, doctor, export, helix, ik, load, pcc, solve, urdf, view

COMMANDS = (urdf, export, solve, load, ik, pcc, helix, view, bench, doctor, completion)
"""Modules of the subcommands, in the order of the help."""

__all__ = ["COMMANDS"]
