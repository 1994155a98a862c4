"""The command `softrobots`, one module for each subcommand.

A module has `add_parser(subparsers)`, which adds its parser and sets `run` on it: a function of the parsed arguments that
raises errors of `softrobots.core.errors` and returns False if a check found something wrong.
"""
