"""The actuators of a robot, motor joints and then muscles: limits, scales and consistent positions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from operator import gt
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, by_column, finite_array, read_only, stacked_columns
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.core.suspicion import question_angle, question_length
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import (
    UNFELT,
    UNITS,
    ActuatorLaws,
    input_limits,
    input_scale,
    length_limits,
    relaxed_input,
    tension_limits,
    wanted_tension,
)
from softrobots.model.muscle_lengths import MuscleLengths

_TAUT = 1e-9  # tension of a tendon that is just taut, relative to what is worth a radian: it hardly moves a tip
_BEYOND = 2.5  # times the limit of an angle, from which on it is hardly in rad
_MOST_DEGREES = 3.6e4  # a hundred turns, beyond which a number is something else
_FAR = 30.0  # times the limit of a slide, from which on it is hardly in m
_LOAD_UNITS = {"rad": "N m", "m": "N", "N": "N", "Pa": "N"}  # by the unit of the coordinate


class Drives(NamedTuple):
    """What actuators add to the motion of their coordinates, arrays of shape (n_motors,); statics does not use it."""

    rotor_inertia: FloatArray
    """Inertia of the rotor at the joint, behind the gears [kg m^2, or kg for a slide]; 0 for muscles."""
    damping: FloatArray
    """Viscous friction [N m s/rad or N s/m]; 0 for muscles."""
    friction: FloatArray
    """Dry friction [N m or N]; 0 for muscles."""
    effort: FloatArray
    """Largest torque, force or tension [N m or N]; infinite where the file states none, or 0."""


class Actuators:
    """Motor joints, then muscles of any kind."""

    def __init__(
        self,
        joints: Sequence[str],
        joint_limits: FloatArray,
        turning: Sequence[bool],
        muscles: Sequence[ActuatorTag],
        worth: FloatArray,
        lengths: MuscleLengths | None,
        laws: ActuatorLaws | None,
        drives: FloatArray,
    ) -> None:
        """Collect names, limits and scales.

        Args:
            joints: Names of the motor joints.
            joint_limits: Their limits, shape (m, 2) [rad or m].
            turning: Which of them turn.
            muscles: The muscles.
            worth: Change of length of each per angle of bending [m/rad], and bending per tension [rad/N], shape (n, 2).
            lengths: The constraint of given muscle lengths; None if there is none.
            laws: The laws of muscles of other kinds; None if there are none.
            drives: The rows of `Drives` for the joints, shape (4, m).
        """
        self._lengths, self._laws = lengths, laws
        self.muscle_lengths = _pairs(map(length_limits, muscles))
        """Limits of the muscle lengths, infinite where only the input has some, shape (n_muscles, 2) [m]."""
        self.muscle_forces = _pairs(map(tension_limits, muscles))
        """Limits of the muscle tensions, infinite for pressures, shape (n_muscles, 2) [N]."""
        self.tension_scale = float(np.mean(1.0 / worth[:, 1])) if len(worth) else 1.0
        """Tension that is worth about a radian of motion, the mean of all muscles [N]."""
        inside = [0.0 if muscle.kind == "tension" else _TAUT * self.tension_scale for muscle in muscles]
        self.sought_tensions = read_only(self.muscle_forces + np.outer(inside, (1.0, -1.0)))
        """Limits of the tensions for a search, shape (n_muscles, 2) [N]; elastic tendons stay just taut, so that they act."""
        self.wanted_tensions = read_only(np.array([wanted_tension(muscle) for muscle in muscles]))
        """Least tensions that a search leaves, shape (n_muscles,) [N]."""
        self.least_tension = any(muscle.weakest >= 0.0 for muscle in muscles)
        """Whether a search keeps the limits of tensions and lessens them: of muscles that cannot both pull and push."""
        strongest = np.array([muscle.strongest for muscle in muscles])
        of_muscles = np.concatenate([np.zeros((3, len(muscles))), strongest[None]])
        self.drives = Drives(*map(read_only, np.concatenate([drives, of_muscles], axis=1)))
        """Rotors, friction and largest torques."""
        self.names = (*joints, *(muscle.name for muscle in muscles))
        """Name of each."""
        self.n_placed = len(joints) if lengths is None else len(self.names)
        """Number of those that have a place, which come first: all but muscles that pull by their laws."""
        self.limits = read_only(np.concatenate([joint_limits, _pairs(map(input_limits, muscles))]))
        """Lower and upper limits, shape (n_motors, 2) [rad, m, N or Pa]."""
        muscle_scale = [input_scale(tag, *pair) for tag, pair in zip(muscles, worth.tolist(), strict=True)]
        self.scale = read_only(np.concatenate([np.ones(len(joints)), muscle_scale]))
        """Change of each equivalent to about a radian of motion, shape (n_motors,) [rad, m, N or Pa]."""
        self.turning = np.array([*turning, *(False for _ in muscles)], dtype=bool)
        """Which of them turn rather than slide or pull, shape (n_motors,), truth values."""
        self.units = (*("rad" if turns else "m" for turns in turning), *(UNITS[muscle.kind] for muscle in muscles))
        """Unit of each."""
        self.basis = read_only(np.diag(self.scale) if lengths is None else lengths.basis(self.scale))
        """Independent changes, shape (n_motors, n), each equivalent to about a radian of motion."""
        self.independent = self.basis.shape[0] == self.basis.shape[1]
        """Whether each can be set by itself; the lengths of more than three muscles along a segment depend on each other."""
        relaxed = np.concatenate([np.zeros(len(joints)), [relaxed_input(muscle) for muscle in muscles]])
        self.relaxed = read_only(np.clip(relaxed, *self.limits.T))
        """Joints at zero, muscles at rest or without tension or pressure, as near as the limits allow, shape (n_motors,)."""
        kinds = [muscle.kind for muscle in muscles]
        self.feels = np.array([*(True for _ in joints), *(kind not in UNFELT for kind in kinds)], dtype=bool)
        """Which of them feel a load on the robot: all but given tensions and pressures, shape (n_motors,), truth values."""

    @cached_property
    def described(self) -> tuple[str, ...]:
        """Name, unit and limits of each, as errors tell them, e.g. "motor_1 [rad] (-3.14 to 3.14)"."""
        limits = ["" if np.isinf(pair).all() else " ({:.4g} to {:.4g})".format(*pair) for pair in self.limits]
        rows = zip(self.names, self.units, limits, strict=True)
        return tuple(f"{name} [{unit}]{pair}" for name, unit, pair in rows) or ("the robot has no actuators",)

    @cached_property
    def described_loads(self) -> tuple[str, ...]:
        """Name of each and the unit of its load, e.g. "motor_1 [N m]"."""
        return tuple(map("{} [{}]".format, self.names, load_units(self.units))) or ("the robot has no actuators",)

    def in_order(self, values: Any, field: str) -> Any:
        """Return values by name of actuator in the order of the actuators; anything else as it came.

        Args:
            values: Number of each actuator by its name, or its numbers in many cases: a mapping, a list of mappings, or a row
                or a table of pandas.
            field: Name of the parameter, for errors.

        Raises:
            NameNotFound: If there is no actuator of a name.
            ParameterError: If an actuator is missing; the errors list the actuators in order, with units and limits.
        """
        values = by_column(values)
        names = list(values.keys()) if callable(getattr(values, "keys", None)) else None
        if names is None or (hasattr(values, "__array__") and not any(isinstance(name, str) for name in names)):
            return values
        for name in names:
            if name not in self.names:
                raise NameNotFound("actuator", name, self.names, lines=self.described)
        missing = [name for name in self.names if name not in names]
        if missing:
            text = f"a number for each actuator; {', '.join(missing)} missing, of {', '.join(self.described)}"
            raise ParameterError(field, values, text)
        return stacked_columns(field, values, dict(zip(self.names, self.described, strict=False)))

    @cached_property
    def _unusual(self) -> tuple[float, ...]:
        """Size of each from which on it may be in another unit: an angle beyond its limits and a turn, or a far slide."""
        sizes = np.abs(self.limits).max(axis=1, initial=0.0)
        angles = np.where(np.isfinite(sizes), np.maximum(_BEYOND * sizes, 2.0 * np.pi), 4.0 * np.pi)
        slides = np.arange(len(sizes)) < len(sizes) - len(self.muscle_lengths)
        return tuple(np.where(self.turning, angles, np.where(slides & (sizes > 0.0), _FAR * sizes, np.inf)).tolist())

    def questioned(self, motors: FloatArray) -> FloatArray:
        """Return positions as they are; warn once (`SuspiciousInputWarning`) if they look like degrees or centimetres.

        Joints without limits may turn many times: they are asked about whole numbers only, as degrees are typed.

        Args:
            motors: Positions, shape (n_motors,), or those of many cases, (n, n_motors), of which the farthest are looked at.
        """
        one = motors if motors.ndim == 1 else _farthest(motors, min(self._unusual, default=np.inf))
        if not any(map(gt, map(abs, one.tolist()), self._unusual)):
            return motors
        for place in np.flatnonzero(np.abs(one) > self._unusual).tolist():
            value, usual, name = float(one[place]), float(np.abs(self.limits[place]).max()), self.names[place]
            if not self.turning[place]:
                question_length(name, value, usual)
            elif abs(value) <= _MOST_DEGREES and (math.isfinite(usual) or value == round(value)):
                question_angle(name, value)
            else:
                continue
            break
        return motors

    def checked(self, value: Any, field: str = "q_motors") -> FloatArray:
        """Return positions that the robot can have, as a new array; see `SoftModel.checked_motors`."""
        given = value if type(value) is np.ndarray else self.in_order(value, field)
        motors = finite_array(field, given, (len(self.names),), self.described)
        requirement = self._refusal(motors)
        if requirement is not None:
            raise ParameterError(field, motors, requirement)
        return motors

    @property
    def load_unit(self) -> str:
        """Unit of their loads: "N m", "N" or "N m or N"."""
        return " or ".join(dict.fromkeys(load_units(self.units)))

    def checked_loads(self, value: Any, field: str, std: Any = None) -> FloatArray:
        """Return loads of the actuators, given in order or by name, as a new array, shape (n_motors,) [N m or N].

        Raises:
            ParameterError: If the shape differs, a name is missing, a number is not finite, or an actuator that only pulls
                pushes by over five `std`, shape (n_motors,) [N m or N], or a tenth of the largest load; lists the actuators.
            NameNotFound: If there is no actuator of a name.
        """
        loads = finite_array(field, self.in_order(value, field), (len(self.names),), self.described_loads)
        at_most = loads + (0.1 * np.abs(loads).max(initial=0.0) if std is None else 5.0 * std)
        if self._laws is not None and (pushed := self._laws.pushed(at_most[self.n_placed :])):
            most = "5 torque_std" if std is not None else "a tenth of the largest"
            raise ParameterError(field, loads, f"0 or above, within {most}, of {', '.join(pushed)}, which only pull")
        return loads

    def _refusal(self, motors: FloatArray) -> str | None:
        if self._lengths is not None:
            return self._lengths.refusal(motors)
        return None if self._laws is None else self._laws.refusal(motors[self.n_placed :])

    def admit(self, motors: FloatArray) -> bool:
        """Return whether the robot can have these positions, shape (n_motors,)."""
        return self._refusal(motors) is None

    def draw(self, random: np.random.Generator) -> FloatArray | None:
        """Draw positions uniformly within the limits, shape (n_motors,); None if the robot cannot have them.

        Without a limit it is half a turn, or what is worth that, from the relaxed position. Muscle lengths are made consistent.
        """
        (low, high), far = self.limits.T, np.pi * self.scale
        sample = random.uniform(
            np.where(np.isfinite(low), low, self.relaxed - far), np.where(np.isfinite(high), high, self.relaxed + far)
        )
        if self._lengths is not None:
            sample = self._lengths.consistent(sample)
        return sample if self.admit(sample) and np.all((sample >= low) & (sample <= high)) else None

    def taken_up(self, motors: FloatArray, elongations: FloatArray) -> FloatArray:
        """Return the positions with slack elastic tendons just taut at lengths beyond those at rest, within the limits."""
        if self._laws is None:
            return motors
        taut, count = np.array(motors), len(motors) - len(elongations)
        taut[count:] = self._laws.taken_up(elongations, motors[count:], _TAUT * self.tension_scale)
        return np.clip(taut, *self.limits.T)

    def go(self, motors: FloatArray, step: FloatArray) -> FloatArray:
        """Return the positions after a step from within the limits that is shortened to them.

        Independent actuators are clipped one by one; muscle lengths that depend on each other share one factor. The bending of
        segments is limited to the range of their sections.
        """
        low, high = self.limits.T
        if self.independent:
            moved = np.clip(motors + step, low, high)
        else:
            ahead = np.where(step > 0.0, high - motors, motors - low)
            share = float(np.min(np.where(step == 0.0, np.inf, ahead / np.maximum(np.abs(step), 1e-300)), initial=1.0))
            moved = motors + max(share, 0.0) * step
        return np.asarray(moved if self._lengths is None else self._lengths.within_range(moved))

    def active_limits(self, motors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the limits that are reached: of actuators, and of the range of sections with given muscle lengths.

        Outward normals, and rows whose outer products are the second derivatives of the limited quantities (zero for
        actuators), each shape (n, n_motors).
        """
        low, high = self.limits.T
        slack, units = 1e-12 * self.scale, np.diag(1.0 / self.scale)
        rows = [-units[motors <= low + slack], units[motors >= high - slack]]
        curvatures = [np.zeros_like(row) for row in rows]
        if self._lengths is not None:
            normals, bends = self._lengths.reached_range(motors)
            rows.append(normals)
            curvatures.append(bends)
        return np.concatenate(rows), np.concatenate(curvatures)


def _farthest(rows: FloatArray, least: float) -> FloatArray:
    """The number of each column that is farthest from zero, shape (m,), NaN left out; nothing if none is beyond the least."""
    if not rows.size or (rows.min() >= -least and rows.max() <= least):
        return np.zeros(0)
    return np.array([max(np.fmin.reduce(column), np.fmax.reduce(column), key=abs) for column in rows.T])


def _pairs(limits: Iterable[tuple[float, float]]) -> FloatArray:
    """Lower and upper limits as rows, shape (n, 2)."""
    return read_only(np.array(list(limits), dtype=np.float64).reshape(-1, 2))


def load_units(units: Sequence[str]) -> tuple[str, ...]:
    """Return the units of the loads on coordinates of these units; the load on a given tension is the tension."""
    return tuple(_LOAD_UNITS[unit] for unit in units)


def joined_units(units: Sequence[str]) -> str:
    """Return the units of a row of numbers as one text: one unit if all have it, else one for each."""
    return units[0] if len(set(units)) == 1 else ", ".join(units)


def slack_tendons(actuators: Sequence[ActuatorTag], tensions: FloatArray) -> tuple[bool, ...]:
    """Return which of some actuators at these tensions, shape (n,) [N], are slack: elastic tendons without tension."""
    return tuple(one.kind == "elastic" and tension <= 0.0 for one, tension in zip(actuators, tensions.tolist(), strict=True))
