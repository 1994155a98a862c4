"""Commands of a live view: lines and JSON objects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.json_text import parse_json
from softrobots.statics.loads import EARTH_GRAVITY

GRAMMAR = """\
target X Y Z        put the loaded tip there [m]; it stays there when the load changes
motors Q [Q ...]    actuator coordinates, base to tip [rad, m or N]
force FX FY FZ      force on the tip [N]
gravity on|off      the Earth's, or none; or three numbers [m/s^2]
reset               as at the start
quit                end
or a JSON object, e.g. {"motors": [0.3, 0.6, -0.8], "force": [0, 10, -15], "gravity": true}, with target instead of motors"""
"""Help on the lines."""


class Wanted(NamedTuple):
    """The state that a live view shows or shall show; arrays are read-only."""

    motors: FloatArray
    """Actuator coordinates, shape (n_motors,) [rad, m or N]; with a target, those found for it."""
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
        return _changed_by(_json_object(text), now)
    name, *words = text.split()
    if name in ("reset", "quit"):
        if words:
            raise ParameterError(name, " ".join(words), "given without anything else")
        return start if name == "reset" else now._replace(done=True)
    setter = _setter(name, (*_SETTERS, "reset", "quit"))
    return setter(now, words[0] if name == "gravity" and len(words) == 1 else _numbers(name, words))


def read_commands(text: str, start: Wanted) -> Wanted:
    """Return the state after all commands of a text: lines, or one JSON object, applied to the start.

    Args:
        text: The whole text.
        start: The state that the commands change.

    Returns:
        The state.

    Raises:
        NameNotFound: If there is no such command.
        ParameterError: If its numbers are wrong in kind or number.
        FileFormatError: If it starts with `{` and is no JSON object.
    """
    if text.lstrip().startswith("{"):
        return changed(text, start, start)
    wanted = start
    for line in text.splitlines():
        wanted = changed(line, wanted, start)
    return wanted


def _json_object(text: str) -> Mapping[str, Any]:
    try:
        return dict(parse_json(text))
    except FileFormatError as error:
        raise FileFormatError(f"this is no JSON object: {error}") from error


def _changed_by(values: Mapping[str, Any], now: Wanted) -> Wanted:
    if "motors" in values and "target" in values:
        raise ParameterError("motors", values["motors"], "left out where a target is given: they follow from it")
    wanted = now
    for name, value in values.items():
        wanted = _setter(name, tuple(_SETTERS))(wanted, value)
    return wanted


def _setter(name: str, available: tuple[str, ...]) -> Callable[[Wanted, Any], Wanted]:
    if name not in _SETTERS:
        raise NameNotFound("command", name, available)
    return _SETTERS[name]


def _numbers(name: str, words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise ParameterError(name, " ".join(words), "given in numbers") from error


def _set_motors(now: Wanted, value: Any) -> Wanted:
    return now._replace(motors=read_only(finite_array("motors", value, (None,), "rad, m or N")), target=None)


def _set_target(now: Wanted, value: Any) -> Wanted:
    return now._replace(target=read_only(finite_array("target", value, (3,), "m")))


def _set_force(now: Wanted, value: Any) -> Wanted:
    return now._replace(force=read_only(finite_array("force", value, (3,), "N")))


def _set_gravity(now: Wanted, value: Any) -> Wanted:
    if value is None or value is False or value == "off":
        return now._replace(gravity=None)
    if isinstance(value, str) and value != "on":
        raise ParameterError("gravity", value, "on, off or three numbers [m/s^2]")
    given = EARTH_GRAVITY if value is True or value == "on" else value
    return now._replace(gravity=read_only(finite_array("gravity", given, (3,), "m/s^2")))


_SETTERS: dict[str, Callable[[Wanted, Any], Wanted]] = {
    "target": _set_target,
    "motors": _set_motors,
    "force": _set_force,
    "gravity": _set_gravity,
}
