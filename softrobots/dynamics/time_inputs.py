"""Inputs of a motion over time: paths of motors, and loads, each constant, a table or a function of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, refuse_where
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.trajectory import Trajectory

_SAMPLES = 1000  # of a function of time, among which its jumps are searched
_NEAR = 1e-7  # of the duration: how far apart a function is compared for its velocity
_LEAST_KINK = 1e-3  # of the largest velocity: jumps of the velocity that count
MOST_KINKS = 200
"""Rows up to which steps end at each row of a table."""
_SHARP = 10.0  # times as much as a row of a longer table usually bends, at which steps end

Signal = Callable[[float], FloatArray]


class MotorPath:
    """Positions of the actuators over time."""

    def __init__(self, model: SoftModel, q_motors: Any, duration: float) -> None:
        """Take constants, a `Trajectory` (through its waypoints by a cubic spline, at rest at both ends), or a function.

        Raises:
            ParameterError: If a value has the wrong shape, is not finite, is one that the robot cannot have, or jumps.
        """
        self.breaks: FloatArray = np.zeros(0)
        """Times at which a tension or the slope of the path jumps, and the path begins or ceases to change [s]."""
        self.kicks: dict[float, FloatArray] = {}
        """Jump of the velocities of the actuators, shape (n_motors,), by time; at zero the velocities themselves."""
        self.constant = False
        """Whether nothing moves."""
        self._is_curve = isinstance(q_motors, Trajectory)
        if isinstance(q_motors, Trajectory):
            self._signal = waypoint_curve("q_motors", q_motors, model, q_motors.q_motors)
            self.breaks = q_motors.times[-1:] - q_motors.times[0]
        elif callable(q_motors):
            self._signal = motor_function("q_motors", q_motors, model)
            times = np.linspace(0.0, duration, 21).tolist()
            model.actuators.questioned(
                np.array([model.actuators.checked(self._signal(time), f"q_motors(t={time:.6g})") for time in times])
            )
            self._find_kicks(model, duration)
        else:
            values = model.checked_motors(q_motors)
            self.constant, self._signal = True, lambda _: values

    def __call__(self, time: float) -> FloatArray:
        """Return the positions, shape (n_motors,) [rad, m or N]."""
        return self._signal(time)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the positions at many times, shape (n,) [s], as shape (n, n_motors)."""
        if self._is_curve:
            return self._signal(times)
        return np.array([self._signal(time) for time in times.tolist()]).reshape(len(times), -1)

    @property
    def kick_times(self) -> FloatArray:
        """Times at which velocities of the actuators jump, shape (n,) [s]."""
        return np.array(list(self.kicks))

    def _find_kicks(self, model: SoftModel, duration: float) -> None:
        """Find the jumps of tensions and of velocities; positions have none."""
        placed, near = model.actuators.n_placed, _NEAR * duration
        signal = cache(self._signal)  # jumps, tensions and onsets look at the same times
        jumps = find_jumps(lambda time: signal(time)[:placed], duration)
        if len(jumps):
            text = f"a continuous function of time; it jumps at {jumps[0]:.6g} s"
            raise ParameterError("q_motors", signal(float(jumps[0])), text)

        def velocity(time: float) -> FloatArray:
            before, after = max(time - near, 0.0), min(time + near, duration)
            return np.asarray((signal(after) - signal(before))[:placed] / (after - before))

        fastest = float(np.abs([velocity(time) for time in np.linspace(0.0, duration, 101).tolist()]).max(initial=0.0))
        least = _LEAST_KINK * fastest
        kinks = find_jumps(velocity, duration, resolution=4.0 * near, least=least) if fastest > 0.0 else np.zeros(0)
        if len(kinks):  # one at a sample is found on both sides of it
            kinks = np.array([part.mean() for part in np.split(kinks, np.flatnonzero(np.diff(kinks) > 20.0 * near) + 1)])
        self.kicks = {0.0: velocity(0.0)} if np.abs(velocity(0.0)).max(initial=0.0) > least else {}
        for time in kinks.tolist():
            low, high = time - 8.0 * near, time + 8.0 * near
            before, after = velocity(low), velocity(high)
            most = int(np.abs(after - before).argmax())  # its tangents meet at the kink
            gap = (signal(high) - signal(low))[most] + before[most] * (low - time) - after[most] * (high - time)
            self.kicks[time - float(gap / (after - before)[most])] = after - before
        unplaced = np.zeros(model.n_motors - placed)
        self.kicks = {time: np.concatenate([change, unplaced]) for time, change in self.kicks.items()}
        kinks = self.kick_times
        tension_jumps = find_jumps(lambda time: signal(time)[placed:], duration)
        onsets = [time for time in find_onsets(signal, duration) if np.abs(kinks - time).min(initial=np.inf) > 100.0 * near]
        self.breaks = np.concatenate([kinks, tension_jumps, onsets])


class TimeLoad:
    """Dead wrenches by frame over time."""

    def __init__(self, model: SoftModel, force: Any, wrench: Any, duration: float) -> None:
        """Take a force on the tip and a wrench, or one by frame; each constant, a table `(times, values)`, or a function.

        Raises:
            ParameterError: If a value has the wrong shape or is not finite.
            NameNotFound: If a frame does not exist.
        """
        self._tip = model.tip
        given = [] if force is None else [("force", model.tip, force, 3)]
        if isinstance(wrench, Mapping):
            given += [(f"wrench[{frame!r}]", frame, value, 6) for frame, value in wrench.items()]
        elif wrench is not None:
            given.append(("wrench", model.tip, wrench, 6))
        self._constant: dict[str, FloatArray] = {}
        self._moving: list[tuple[str, int, Signal]] = []
        breaks = [np.zeros(0)]
        for name, frame, value, size in given:
            model.frame_id(frame)
            if callable(value):
                signal = checked_function(name, value, (size,), "N")
                known = cache(signal)  # both look at the same times
                breaks += [find_jumps(known, duration), find_onsets(known, duration)]
                self._moving.append((frame, size, signal))
            elif isinstance(value, tuple | list) and len(value) == 2:
                signal, kinks = _table(name, value, size)
                breaks.append(kinks)
                self._moving.append((frame, size, signal))
            else:
                self._add(self._constant, frame, finite_array(name, value, (size,), "N"))
        self.breaks: FloatArray = np.concatenate(breaks)
        """Times at which the load jumps, has a kink, or begins or ceases to change [s]."""
        self.constant = not self._moving
        """Whether the load stays the same."""
        self._last: dict[str, FloatArray] = self._constant

    def __call__(self, time: float) -> dict[str, FloatArray]:
        """Return the wrench by frame, shape (6,) [N, N m]; the same object as last time if nothing has changed."""
        if self.constant:
            return self._constant
        wrenches = dict(self._constant)
        for frame, _, signal in self._moving:
            self._add(wrenches, frame, signal(time))
        if wrenches.keys() != self._last.keys() or any(not np.array_equal(w, self._last[f]) for f, w in wrenches.items()):
            self._last = wrenches
        return self._last

    def tip_forces(self, times: FloatArray) -> FloatArray:
        """Return the force on the tip at many times, shape (n,) [s], as shape (n, 3) [N]."""
        if self.constant:
            return np.full((len(times), 3), self._constant.get(self._tip, np.zeros(6))[:3])
        return np.array([self(time).get(self._tip, np.zeros(6))[:3] for time in times.tolist()]).reshape(-1, 3)

    @staticmethod
    def _add(wrenches: dict[str, FloatArray], frame: str, value: FloatArray) -> None:
        total = np.array(wrenches.get(frame, np.zeros(6)))
        total[: len(value)] += value
        wrenches[frame] = total


def checked_function(name: str, function: Callable[[float], Any], shape: tuple[int, ...], unit: str | Sequence[str]) -> Signal:
    """Return a function of time whose values are checked; an error names the time.

    Raises:
        ParameterError: By the function returned, if a value has the wrong shape or is not finite.
    """

    def checked(time: float) -> FloatArray:
        return finite_array(f"{name}(t={time:.6g})", function(time), shape, unit)

    checked(0.0)
    return checked


def motor_function(name: str, function: Callable[[float], Any], model: SoftModel) -> Signal:
    """Return such a function for positions of the actuators, in order or by name."""
    actuators = model.actuators
    return checked_function(name, lambda time: actuators.in_order(function(time), name), (model.n_motors,), actuators.described)


def find_jumps(signal: Signal, duration: float, *, resolution: float = 0.0, least: float = 0.0) -> FloatArray:
    """Times at which a function of time jumps, found among 1000 samples and located by bisection, shape (n,) [s].

    Args:
        signal: The function.
        duration: End of the times that are searched [s].
        resolution: Width of a jump that counts as one [s].
        least: Height of the smallest jump that counts.
    """
    times = np.linspace(0.0, duration, _SAMPLES + 1).tolist()
    values = np.array([signal(time) for time in times])
    changes = np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0)
    jumps = []
    # Beside a jump of 0.3 of a change or more, which counts below, the changes differ by as much.
    bends = np.pad(np.abs(np.diff(values, 2, axis=0)).max(axis=1, initial=0.0), 1)
    apart = np.maximum(bends[:-1], bends[1:]) > 0.15 * changes
    for place in np.flatnonzero(apart & (changes > max(least, 1e-6 * np.ptp(values, axis=0).max(initial=0.0)))).tolist():
        before, after = times[place], times[place + 1]
        low, high = values[place], values[place + 1]
        rounds = 0
        while after - before > max(resolution, 4e-16 * duration):
            middle = 0.5 * (before + after)
            value = signal(middle)
            if np.abs(value - low).max() >= np.abs(high - value).max():
                after, high = middle, value
            else:
                before, low = middle, value
            rounds += 1
            if np.abs(high - low).max() < 0.5 * changes[place] * 0.7**rounds + 1e-12 * changes[place]:
                break
        if np.abs(high - low).max() > 0.3 * changes[place]:
            jumps.append(after)
    return np.array(jumps)


def find_onsets(signal: Signal, duration: float) -> FloatArray:
    """Times, among 1000 samples, at which a function of time begins or ceases to change, shape (n,) [s].

    A pulse in a long quiet time has a step of its own between them. None of a function that does so all the time.
    """
    times = np.linspace(0.0, duration, _SAMPLES + 1)
    changes = np.abs(np.diff([signal(time) for time in times.tolist()], axis=0)).max(axis=1, initial=0.0)
    onsets = times[1:-1][np.diff(changes > 1e-6 * changes.max(initial=0.0))]
    return onsets if len(onsets) <= MOST_KINKS else np.zeros(0)


def _table(name: str, value: Any, size: int) -> tuple[Signal, FloatArray]:
    """A table of values over time, linear between its rows and constant beyond; two rows at one time are a jump."""
    if np.isscalar(value[0]):
        required = f"of shape ({size},) [N], a table (times (n,), values (n, {size})), or a function of time"
        raise ParameterError(name, value, required)
    times = finite_array(f"times of {name}", value[0], (None,), "s")
    values = finite_array(f"values of {name}", value[1], (len(times), size), "N")
    if len(times) == 0:
        raise ParameterError(f"times of {name}", times, "at least one [s]")
    refuse_where(f"times of {name}", times[1:], np.diff(times) < 0.0, "not before the row above [s]")

    def signal(time: float) -> FloatArray:
        row = int(np.searchsorted(times, time, side="right"))
        if row == 0 or row == len(times):
            return np.asarray(values[min(row, len(times) - 1)])
        share = (time - times[row - 1]) / (times[row] - times[row - 1])
        return np.asarray(values[row - 1] + share * (values[row] - values[row - 1]))

    return signal, times if len(times) <= MOST_KINKS else times[_sharpest(times, values)]


def _sharpest(times: FloatArray, values: FloatArray) -> Any:
    """Rows of a long table at which it jumps, or bends much more than elsewhere, as at a short pulse."""
    gaps = np.diff(times)[:, None]
    slopes = np.diff(values, axis=0) / np.where(gaps > 1e-12 * (times[-1] - times[0]), gaps, 1.0)
    bends = np.abs(np.diff(slopes, axis=0, prepend=0.0, append=0.0)).max(axis=1)
    much = np.flatnonzero(bends > _SHARP * np.median(bends))
    much = much[np.argsort(bends[much], kind="stable")[-MOST_KINKS:]]
    return np.union1d(much, np.flatnonzero(gaps[:, 0] == 0.0) + 1)


def curve(times: FloatArray, values: FloatArray) -> Callable[[Any], FloatArray]:
    """Return the cubic spline through values, shape (n, m), at times, shape (n,), at rest at both ends and constant beyond.

    It takes a time, or several, shape (k,), and returns shape (m,), or (k, m).
    """
    if len(times) == 1:
        return partial(_constant, values[0])
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, values, bc_type="clamped")
    return partial(_along, spline, times[0], times[-1])


def _constant(values: FloatArray, time: Any) -> FloatArray:
    return np.broadcast_to(values, (*np.shape(time), len(values)))


def _along(spline: Any, first: float, last: float, time: Any) -> FloatArray:
    return np.asarray(spline(np.clip(time, first, last)))


def waypoint_curve(name: str, trajectory: Trajectory, model: SoftModel, values: FloatArray) -> Callable[[Any], FloatArray]:
    """Return the `curve` through values at the waypoints of a trajectory, shape (n, m); the first waypoint is at time zero.

    Raises:
        ParameterError: If the trajectory is not one of the model.
    """
    if trajectory.model != model:
        raise ParameterError(name, trajectory.model, f"a Trajectory of the model given, {model!r}")
    return curve(trajectory.times - trajectory.times[0], values)
