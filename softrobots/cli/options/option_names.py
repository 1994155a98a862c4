"""Errors about an argument of the library, told by the option that it came from."""

from __future__ import annotations

import argparse

from softrobots.core.errors import ParameterError

_ALIASES = {
    "model": "robot",
    "springs": "spring",
    "q_motors": "motors",
    "q_motors0": "start",
    "motor_torques": "torques",
    "direction": "critical_load",
    "orientation": "direction",
    "segment_lengths": "rest",
    "muscle_distance": "distance",
    "muscle_azimuths": "azimuths",
    "muscle_contraction": "contraction",
    "muscle_extension": "extension",
    "offset": "offsets",
    "length": "arcs",
    "bending": "arcs",
    "azimuth": "arcs",
}
"""Arguments of the library whose option is called otherwise, where a command has that option."""

_SPELLED = {"robot": "ROBOT", "lengths": "L", "arcs": "--arc"}
"""What stands in the help where that is not the name with dashes before it."""


def told_by_option(error: ParameterError, arguments: argparse.Namespace) -> ParameterError:
    """The error with the option in place of the library's argument; the same one if no option of the command is meant.

    Args:
        error: The error.
        arguments: The arguments of the command.
    """
    given = vars(arguments)
    field = error.field.partition("[")[0]  # without the key of an item
    name = field if field in given else _ALIASES.get(field, "")
    if name not in given or str(error) != str(ParameterError(error.field, error.value, error.requirement)):
        return error
    value = given[name] if name in _SPELLED else error.value
    return ParameterError(_SPELLED.get(name, f"--{name.replace('_', '-')}"), value, error.requirement)
