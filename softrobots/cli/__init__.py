"""The command `softrobots`, one module a subcommand.

A module has `add_parser(subparsers)`, which adds its parser and sets `run` on it: a function of the parsed arguments that does
the job, raises errors of `softrobots.core.errors`, and returns None, or whether all that it looked at is well.
"""
