"""Commands of a live view: lines and JSON objects."""

from __future__ import annotations

from typing import Any, NamedTuple

from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.json_text import parse_json
from softrobots.statics.loads import EARTH_GRAVITY

GRAMMAR = """\
target X Y Z        put the loaded tip there [m]; it stays there when the load changes
motors Q [Q ...]    actuator coordinates, base to tip [rad, m, N or Pa]
force FX FY FZ      force on the tip [N]
gravity on|off      the Earth's, or none; or three numbers [m/s^2]
reset               as at the start
quit                end
or a JSON object, e.g. {"motors": [0.3, 0.6, -0.8], "force": [0, 10, -15], "gravity": true}, with target instead of motors"""
"""Help on the lines."""

_ARRAYS: dict[str, tuple[tuple[int | None], str]] = {
    "target": ((3,), "m"),
    "motors": ((None,), "rad, m or N"),
    "force": ((3,), "N"),
    "gravity": ((3,), "m/s^2"),
}
"""What can be set: shape and unit."""


class Wanted(NamedTuple):
    """The state that a live view shows or shall show; arrays are read-only."""

    motors: FloatArray
    """Actuator coordinates, shape (n_motors,) [rad, m, N or Pa]; with a target, those found for it."""
    target: FloatArray | None
    """Target of the tip, shape (3,) [m]; None: the actuator coordinates are given instead."""
    force: FloatArray
    """Force on the tip, shape (3,) [N]."""
    gravity: FloatArray | None
    """Gravity, shape (3,) [m/s^2]; None: weightless."""
    done: bool = False
    """Whether the view is to end."""


def changed(line: str, now: Wanted, start: Wanted) -> Wanted:
    """Return the state after a command.

    Args:
        line: A line of `GRAMMAR`. One that is empty or starts with `#` has no effect.
        now: The state before it.
        start: The state that `reset` restores.

    Returns:
        The state; `now` itself if the line has no effect, `start` itself after `reset`.

    Raises:
        NameNotFound: If there is no such command.
        ParameterError: If its numbers are wrong in kind or number.
        FileFormatError: If it starts with `{` and is no JSON object.
    """
    text = line.strip()
    if not text or text.startswith("#"):
        return now
    if text.startswith("{"):
        return _changed_by_object(text, now)
    name, *words = text.split()
    if name in ("reset", "quit"):
        if words:
            raise ParameterError(name, " ".join(words), "given without anything else")
        return start if name == "reset" else now._replace(done=True)
    if name not in _ARRAYS:
        raise NameNotFound("command", name, (*_ARRAYS, "reset", "quit"))
    if name == "gravity" and len(words) == 1:
        return _set(now, name, words[0])
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise ParameterError(name, " ".join(words), "given in numbers") from error
    return _set(now, name, numbers)


def read_commands(text: str, start: Wanted) -> Wanted:
    """Return the state after all commands of a text: lines, or one JSON object, applied to the start; see `changed`."""
    if text.lstrip().startswith("{"):
        return changed(text, start, start)
    wanted = start
    for line in text.splitlines():
        wanted = changed(line, wanted, start)
    return wanted


def _changed_by_object(text: str, now: Wanted) -> Wanted:
    """The state after a JSON object."""
    try:
        values = parse_json(text)
    except FileFormatError as error:
        raise FileFormatError(f"this is no JSON object: {error}") from error
    if "motors" in values and "target" in values:
        raise ParameterError("motors", values["motors"], "left out where a target is given: they follow from it")
    for name, value in values.items():
        if name not in _ARRAYS:
            raise NameNotFound("command", name, tuple(_ARRAYS))
        now = _set(now, name, value)
    return now


def _set(now: Wanted, name: str, value: Any) -> Wanted:
    """The state with another target, other motors, force or gravity."""
    if name == "gravity":
        if value is None or value is False or value == "off":
            return now._replace(gravity=None)
        if isinstance(value, str) and value != "on":
            raise ParameterError("gravity", value, "on, off or three numbers [m/s^2]")
        value = EARTH_GRAVITY if value is True or value == "on" else value
    elif name == "motors":
        now = now._replace(target=None)
    changes: dict[str, Any] = {name: read_only(finite_array(name, value, *_ARRAYS[name]))}
    return now._replace(**changes)
