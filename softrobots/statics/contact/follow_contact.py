"""Follow a robot in contact, with or without friction, while loads, motors, obstacles or the robot itself change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, increasing, non_negative_number, read_only
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.core.progress import with_progress
from softrobots.environment.environment import check_environment
from softrobots.environment.standing import standing_among
from softrobots.model.friction_coordinates import check_frictionless, untouched
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact_path import ContactJump, ContactPath
from softrobots.statics.contact.contact_walk import ContactWalk
from softrobots.statics.contact.last_state import Given
from softrobots.statics.contact.quasi_static import (
    Rest,
    at_rest,
    carried_over,
    change,
    energy_drop,
    move_to_rest,
    obstructed,
    step,
)
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.equilibrium_result import Equilibrium, check_same_model
from softrobots.statics.loads import Load

_JUMP = 1e-2  # way of the springs beyond which overdamped motion is a jump [rad]
_MOVES = 1e-6  # way of the springs within which a start is the equilibrium of the first row [rad]


def follow_contact(
    model: SoftModel | Callable[[float], SoftModel],
    q_motors: Any,
    force: Any = None,
    *,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    environment: Any,
    friction: float = 0.0,
    parameters: Any = None,
    start: Equilibrium | None = None,
    allow_jumps: bool = True,
    progress: bool | str = False,
) -> ContactPath:
    r"""Follow a robot in contact in quasi-static steps, each from the last, with Coulomb friction if asked.

    What changes has one row a parameter: motors, force, wrench, gravity; obstacles move by their poses at the parameter, and a
    robot that grows is a function of it, such as `lambda length: load_model(tube.grown(length))`. Between two parameters rows
    are interpolated; steps are halved where they do not converge, where contacts change, and where they are so long that
    something might pass through an obstacle. At every contact the friction sticks or slips within the cone
    :math:`|\lambda_t| \le \mu \lambda_n`, by the sliding since the last step, so that the answer depends on the path. Where
    the robot cannot follow it snaps, as overdamped motion would: `ContactPath.jumps`.

    Args:
        model: The robot; or a function `parameter -> SoftModel` of a robot that grows from its tip: of sections only, or with
            the same coordinates at every parameter.
        q_motors: Motor coordinates, shape (n_motors,) or (n, n_motors) [rad or m].
        force: Force at `frame`, shape (3,) or (n, 3) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) or (n, 6) [N, N m], world axes, force first; or `{frame: ...}` for several.
        frame: Frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) or (n, 3) [m/s^2], world axes; None: weightless.
        environment: The obstacles.
        friction: Friction coefficient of all contacts [-]; 0: frictionless.
        parameters: Increasing parameters of the rows, shape (n,); 0, 1, 2, ... by default.
        start: Equilibrium at the first parameter, whose contacts keep their friction. By default the one that is reached, with
            friction, while force, wrench and gravity of the first row grow from zero among the obstacles there.
        allow_jumps: Whether to go on after a jump; else the path ends before it.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The path, as far as it was followed if it is interrupted (Ctrl-C).

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, rows differ in number, `start` has
            other motors than the first row or is out of balance there, or the robot has dry friction of its own and grows.
        NameNotFound: If a frame does not exist.
        EquilibriumNotFound: If there is no equilibrium at the first parameter, or the robot comes to no rest; `best` is then
            the path so far.
    """
    course = Course(model, q_motors, {"force": force, "wrench": wrench, "gravity": gravity}, frame, environment, parameters)
    coefficient = non_negative_number("friction", friction)
    driven = _Driven(course.at, course.parameter, course.where, allow_jumps)
    walk, ended = ContactWalk(driven), ""
    rows: list[Equilibrium] = []
    worked: list[float] = []
    steps = with_progress(
        walk.rows(_first(course, coefficient, start), len(course.parameters)),
        progress,
        label="steps in contact",
        unit="step",
        total=len(course.parameters),
    )

    def path() -> ContactPath:
        return ContactPath(
            parameters=read_only(course.parameters[: len(rows)].copy()),
            equilibria=tuple(rows),
            friction=coefficient,
            dissipation=read_only(np.array(worked)),
            events=tuple(walk.events),
            jumps=tuple(driven.jumps),
            ended=ended or driven.ended,
        )

    try:
        for rest in steps:
            rows.append(rest.equilibrium())
            worked.append(walk.work)
    except KeyboardInterrupt:
        if not rows:
            raise
        ended = "interrupted"
    except EquilibriumNotFound as error:
        raise EquilibriumNotFound(str(error), best=path(), residual=error.residual, iterations=error.iterations) from error
    return path()


class Course:
    """What is given along a path, at any place between its rows."""

    def __init__(
        self, model: Any, q_motors: Any, loads: dict[str, Any], frame: str | None, environment: Any, parameters: Any
    ) -> None:
        """Check everything that is given; see `follow_contact`."""
        self._grown = None if isinstance(model, SoftModel) or not callable(model) else model
        self._environment, self._frame = check_environment(environment), frame
        given = None if parameters is None else increasing("parameters", finite_array("parameters", parameters, (None,)), "")
        if self._grown is not None and given is None:
            raise ParameterError("parameters", None, "given, for a robot that is a function of them")
        first = model if self._grown is None else self._grown_to(float(given[0]))  # type: ignore[index]
        self._model = untouched(first)
        rows = first.actuators.in_order(q_motors, "q_motors")
        columns: dict[str, Any] = {"q_motors": (rows, first.n_motors, first.actuators.described)}
        for name, value in loads.items():
            several = value if isinstance(value, Mapping) else {"": value}
            size, unit = {"force": (3, "N"), "wrench": (6, "N, N m"), "gravity": (3, "m/s^2")}[name]
            columns |= {
                f"{name}[{key!r}]" if key else name: (one, size, unit) for key, one in several.items() if one is not None
            }
        self._columns = {name: _rows(name, *column) for name, column in columns.items()}
        first.actuators.questioned(self._columns["q_motors"])
        counts = {name: len(rows) for name, rows in self._columns.items() if len(rows) > 1}
        count = len(given) if given is not None else max(counts.values(), default=1)
        for name, number in counts.items():
            if number != count:
                raise ParameterError(name, self._columns[name], f"one row, or {count}, one a parameter")
        self.parameters = np.arange(count, dtype=np.float64) if given is None else given
        """Parameter of each row, shape (n,)."""
        wrench = loads["wrench"]
        self._frames = {f"wrench[{key!r}]": key for key in wrench} if isinstance(wrench, Mapping) else {}
        for parameter in self.parameters.tolist():
            self._environment.at(parameter)
        self._last: tuple[Any, ...] = (None, None, None)

    def _grown_to(self, parameter: float) -> SoftModel:
        """Return the robot at a parameter, without dry friction of its own."""
        return check_frictionless(self._grown(parameter), "paths in contact of robots that grow")  # type: ignore[misc]

    def parameter(self, place: float) -> float:
        """Parameter at a place: a number of a row, or between two."""
        return float(np.interp(place, np.arange(len(self.parameters)), self.parameters))

    def where(self, place: float) -> str:
        """Return a place in words."""
        row = min(int(place), len(self.parameters) - 2)
        return f"between rows {row} and {row + 1}, at parameter {self.parameter(place):.6g},"

    def at(self, place: float) -> Given:
        """Return what is given at a place."""
        parameter = self.parameter(place)
        model = self._model if self._grown is None else self._grown_to(parameter)
        row = {name: _between(rows, place) for name, rows in self._columns.items()}
        wrench = {key: row[name] for name, key in self._frames.items()} or row.get("wrench")
        load = Load.of(model, row.get("force"), wrench=wrench, frame=self._frame, gravity=row.get("gravity"))
        environment = self._environment.at(parameter)
        if (model, environment) != self._last[:2]:
            self._last = (model, environment, standing_among(model, environment))
        motors = model.actuators.checked(row["q_motors"])
        return Given(model, motors, replace(load, environment=environment), environment, self._last[2])


class _Driven:
    """A robot that is driven from place to place, and snaps where it cannot follow; a `contact_walk.Way`."""

    def __init__(
        self,
        given_at: Callable[[float], Given],
        parameter: Callable[[float], float],
        where: Callable[[float], str],
        allow_jumps: bool,
    ) -> None:
        self._given_at, self.parameter, self._where, self._allow_jumps = given_at, parameter, where, allow_jumps
        self.jumps: list[ContactJump] = []
        self.ended = ""

    def step(self, place: float, here: Rest, small: bool = True) -> Rest | None:
        """Go to a place; None if there is no equilibrium that holds near the last one."""
        return step(self._given_at(place), here, patient=small)

    def blocked(self, place: float, here: Rest) -> Rest | None:
        """Where a robot comes to rest that has no equilibrium near; None if jumps are not allowed.

        Raises:
            EquilibriumNotFound: If it does not come to rest.
        """
        given, parameter = self._given_at(place), self.parameter(place)
        if not self._allow_jumps:
            self.ended = f"at parameter {parameter:.6g} the robot leaves its equilibrium (allow_jumps=True follows it)"
            return None
        rest = move_to_rest(given, here)
        if rest is None:
            raise EquilibriumNotFound(
                f"{self._where(place)} the robot leaves its equilibrium, and its overdamped motion comes to no rest"
                + obstructed(given, here),
                best=None,
                residual=float("nan"),
                iterations=0,
            )
        if change(given.model, rest.q_springs, carried_over(given, here)[1]) > _JUMP:
            lost = energy_drop(given, here, rest)
            self.jumps.append(ContactJump(parameter, here.equilibrium(), rest.equilibrium(), lost))
        return rest


def _first(course: Course, friction: float, start: Equilibrium | None) -> Rest:
    """The robot at rest at the first row.

    Raises:
        ParameterError: If `start` is of another model, has other motors than the first row or is out of balance there.
        EquilibriumNotFound: If there is no equilibrium that holds.
    """
    given = course.at(0.0)
    if start is None:
        here = solve_equilibrium(given.model, given.q_motors, environment=given.environment)

        def loaded(share: float) -> Given:
            return given._replace(load=given.load.scaled(share))

        rest = at_rest(loaded(0.0), here, friction)
        if rest is not None:
            there = _Driven(loaded, lambda _: course.parameter(0.0), "at the first row, under {:.3g} of its load,".format, True)
            rest = ContactWalk(there).go(rest, 0.0)
    else:
        check_same_model(given.model, start, "start")
        if not np.allclose(start.q_motors, given.q_motors, rtol=1e-9, atol=1e-9):
            requirement = f"an equilibrium with the motors of the first row, {given.q_motors.tolist()}"
            raise ParameterError("start", start.q_motors.tolist(), requirement)
        here, rest = start, at_rest(given, start, friction)
        if rest is not None and change(given.model, rest.q_springs, start.q_springs) > _MOVES:
            requirement = "in balance under the load, obstacles and friction of the first row: there its springs move"
            raise ParameterError("start", start.q_springs.tolist(), requirement)
    if rest is None:
        raise EquilibriumNotFound(
            "there is no equilibrium that holds at the first parameter", best=here, residual=here.residual, iterations=0
        )
    return rest


def _rows(name: str, value: Any, size: int, unit: str | Sequence[str]) -> FloatArray:
    """One row, or one a parameter, shape (1 or n, size)."""
    given = finite_array(name, value, None, unit)
    return finite_array(name, given[None] if given.ndim == 1 else given, (None, size), unit)


def _between(rows: FloatArray, place: float) -> FloatArray:
    """The row at a place, linear between two."""
    if len(rows) == 1:
        return np.asarray(rows[0])
    low = min(int(place), len(rows) - 2)
    return np.asarray(rows[low] + (place - low) * (rows[low + 1] - rows[low]))
