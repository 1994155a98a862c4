r"""Input shaping: motor paths that leave no vibration of chosen modes behind, [Singer and Seering 1990].

A shaper is a row of impulses `A_i` at `t_i` that sum to one. The shaped path is the given one convolved with them,
`u(t) = sum A_i q(t - t_i)`: a weighted mean of the path and of delayed copies of it. It ends where the path ends, later by the
last `t_i`. Of a mode of frequency `omega` and damping ratio `zeta`, `omega_d = omega sqrt(1 - zeta^2)`, it leaves the share

.. math:: V = \left| \sum A_i e^{-\zeta\omega (t_n - t_i)} e^{i \omega_d t_i} \right|
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import (
    FloatArray,
    choice,
    finite_array,
    finite_number,
    increasing,
    instance_of,
    non_negative_array,
    positive_array,
    read_only,
    refuse_where,
)
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.dynamics.time_inputs import curve

SHAPERS = ("zv", "zvd", "ei")
"""Kinds of shapers: zero vibration, zero vibration and derivative, extra insensitive."""

_NEGLIGIBLE = 0.005  # of the largest vibration that the bare path leaves in a mode
_MOST_SAMPLES = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class InputShaper(Summarised):
    """Impulses that a motor path is convolved with; made by `input_shaper`."""

    times: FloatArray
    """Times of the impulses, increasing from 0, shape (n,) [s]."""
    amplitudes: FloatArray
    """Their amplitudes, shape (n,) [-]; they sum to one."""

    @property
    def duration(self) -> float:
        """Time by which a shaped path ends later [s]."""
        return float(self.times[-1])


@dataclass(frozen=True, eq=False, repr=False)
class ShapedTrajectory(Summarised):
    """A shaped motor path: a function of time that `softrobots.simulate` takes as `q_motors`, with samples for everything else.

    Before its first and after its last time the motors rest.
    """

    times: FloatArray
    """Times of the samples, evenly spaced, at least as dense as those of the given path, shape (n,) [s]."""
    q_motors: FloatArray
    """Motor coordinates there, shape (n, n_motors) [rad, m or N]."""
    shaper: InputShaper
    """The impulses."""
    numbers: tuple[int, ...]
    """Numbers of the modes that it is shaped for, from 0."""
    path: Callable[[FloatArray], FloatArray]
    """The given path: positions, shape (n, n_motors), at times, shape (n,) [s]."""

    def __call__(self, time: float) -> FloatArray:
        """Return the motor coordinates at a time [s], shape (n_motors,) [rad, m or N].

        Raises:
            ParameterError: If the time is not finite.
        """
        now = finite_number("time", time, "s")
        return np.asarray(self.shaper.amplitudes @ self.path(now - self.shaper.times))


def input_shaper(frequencies: Any, damping_ratios: Any = 0.0, *, shaper: str = "zv", tolerance: float = 0.05) -> InputShaper:
    r"""Return the shaper of one mode, or of several: the convolution of one for each.

    With `T = pi / omega_d`, half a damped period, and `K = e^{-\zeta\omega T}`, the impulses are at `0, T, ...`:

    - "zv" leaves nothing at the frequency: `(1, K) / (1 + K)` [Singer and Seering 1990].
    - "zvd" also has the slope zero there: `(1, 2 K, K^2) / (1 + K)^2` [Singer and Seering 1990].
    - "ei" leaves `tolerance` at the frequency, nothing at one below and one above, and so serves the widest band:
      `(1, 2 c K, K^2) / (1 + 2 c K + K^2)`, undamped with `c = (1 - V) / (1 + V)` [Singhose et al. 1994]. With damping the
      two other frequencies have the same decay rate `zeta omega`, which gives
      `c = (2 K^2 - V (1 + K^2)) / (2 (K^2 + V K))`, exact at the frequency itself. A mode so damped that this is not positive
      takes "zvd".

    Args:
        frequencies: Frequency of the mode, or of several, shape (n,) [Hz].
        damping_ratios: Its damping ratio from 0 to below 1, or theirs, shape (n,) [-].
        shaper: "zv", "zvd" or "ei".
        tolerance: Share of the vibration that "ei" leaves at the frequency, above 0, at most 0.3 [-].

    Returns:
        The impulses.

    Raises:
        ParameterError: If an argument is out of range, or shapes do not fit.
    """
    rate, ratio = _modes(frequencies, damping_ratios)
    if rate.ndim > 1 or rate.size == 0:
        raise ParameterError("frequencies", frequencies, "one number or an array of shape (n,), n >= 1 [Hz]")
    return _convolved(rate.ravel(), ratio.ravel(), shaper, tolerance)


def residual_vibration(shaper: InputShaper, frequency: Any, damping_ratio: Any = 0.0) -> FloatArray:
    """Return the share of the vibration of a mode that a shaper leaves, [Singer and Seering 1990] (8); 1: all of it.

    It is the amplitude after the last impulse, over that after a single impulse at time zero which is as large as their sum.

    Args:
        shaper: The impulses.
        frequency: Frequency of the mode, any shape [Hz].
        damping_ratio: Its damping ratio from 0 to below 1, of a shape that broadcasts with `frequency` [-].

    Returns:
        The share, the common shape [-].

    Raises:
        ParameterError: If an argument is of another kind or out of range.
    """
    impulses = instance_of("shaper", shaper, InputShaper, "an InputShaper (made by softrobots.input_shaper)")
    rate, ratio = _modes(frequency, damping_ratio)
    return np.asarray(np.abs(_phasor(impulses.times, impulses.amplitudes, rate, ratio)))


def shape_input(
    trajectory: Any, modes: Any, *, shaper: str = "ei", numbers: Sequence[int] | None = None, tolerance: float = 0.05
) -> ShapedTrajectory:
    """Shape a motor path so that it leaves no vibration of the modes of a robot behind.

    All motors share one shaper, so that the shaped path is made of motor coordinates of the given one, and nearly follows it.
    Modes of a robot at large deflection depend on the pose: take those of the pose where the motion ends.

    Args:
        trajectory: A `Trajectory`, or anything with `times`, shape (n,) [s], and `q_motors`, shape (n, n_motors); between its
            waypoints the motors follow cubic splines that begin and end at rest. The shaped path begins at time zero.
        modes: The modes, `VibrationModes`, or anything with `frequencies`, shape (n,) [Hz], and `damping_ratios`, shape (n,).
        shaper: "zv", "zvd" or "ei"; see `input_shaper`. In a large move the modes change on the way, and "ei" leaves least of
            robots with modes in pairs, as arms have (5 % of 5 %); "zv" takes half the time.
        numbers: Numbers of the modes to shape for, from 0. By default the lowest that matter: from the lowest upwards those in
            which the path, as shaped so far, would leave more than 0.5 % of the largest vibration that the bare path leaves in
            any; modes with a damping ratio of 1 or more do not vibrate.
        tolerance: Of "ei"; see `input_shaper`.

    Returns:
        The shaped path.

    Raises:
        ParameterError: If an argument is of another kind or out of range.
    """
    times = increasing(
        "trajectory.times", finite_array("trajectory.times", getattr(trajectory, "times", None), (None,), "s"), "s"
    )
    motors = finite_array("trajectory.q_motors", getattr(trajectory, "q_motors", None), (len(times), None), "rad")
    if len(times) < 2:
        raise ParameterError("trajectory.times", times, "at least two times")
    times = times - times[0]
    path = curve(times, motors)
    frequencies = finite_array("modes.frequencies", getattr(modes, "frequencies", None), (None,), "Hz")
    ratios = finite_array("modes.damping_ratios", getattr(modes, "damping_ratios", None), (len(frequencies),))
    if numbers is None:
        chosen = _exciting(path, times, frequencies, ratios, shaper, tolerance)
    else:
        known = isinstance(numbers, tuple | list) and all(type(n) is int and 0 <= n < len(frequencies) for n in numbers)
        if not known or len(set(numbers)) < len(numbers):
            raise ParameterError("numbers", numbers, f"numbers of modes from 0 to {len(frequencies) - 1}, without repetition")
        chosen = list(numbers)
    impulses = _convolved(*_modes(frequencies[chosen], ratios[chosen]), shaper, tolerance)
    end = times[-1] + impulses.duration
    samples = np.linspace(0.0, end, math.ceil(end / np.diff(times).min() - 1e-9) + 1)
    delayed = [path(samples - t) for t in impulses.times]
    shaped = np.tensordot(impulses.amplitudes, delayed, axes=1).reshape(len(samples), motors.shape[1])
    return ShapedTrajectory(read_only(samples), read_only(shaped), impulses, tuple(chosen), path)


def _modes(frequency: Any, damping_ratio: Any) -> tuple[FloatArray, FloatArray]:
    """Angular frequencies [rad/s] and damping ratios of one common shape."""
    rate, ratio = positive_array("frequency", frequency, "Hz"), non_negative_array("damping_ratio", damping_ratio, "")
    refuse_where("damping_ratio", damping_ratio, ratio >= 1.0, "below 1: a mode damped more does not vibrate")
    try:
        first, second = np.broadcast_arrays(2.0 * math.pi * rate, ratio)
    except ValueError as error:
        raise ParameterError("damping_ratio", damping_ratio, f"of a shape that broadcasts with {rate.shape}") from error
    return first, second


def _convolved(rates: FloatArray, ratios: FloatArray, shaper: str, tolerance: float) -> InputShaper:
    """The shaper of modes by angular frequencies [rad/s] and damping ratios, each shape (n,); of none a single impulse."""
    choice("shaper", shaper, SHAPERS)
    share = finite_number("tolerance", tolerance)
    if not 0.0 < share <= 0.3:
        raise ParameterError("tolerance", tolerance, "above 0, at most 0.3")
    times, amplitudes = np.zeros(1), np.ones(1)
    for omega, zeta in zip(rates.tolist(), ratios.tolist(), strict=True):
        half = math.pi / (omega * math.sqrt(1.0 - zeta**2))
        k = math.exp(-zeta * omega * half)
        c = (2.0 * k**2 - share * (1.0 + k**2)) / (2.0 * (k**2 + share * k)) if shaper == "ei" else 1.0
        c = c if c > 0.0 else 1.0
        one = np.array([1.0, k] if shaper == "zv" else [1.0, 2.0 * c * k, k**2])
        times = np.add.outer(times, half * np.arange(len(one))).ravel()
        amplitudes = np.multiply.outer(amplitudes, one / one.sum()).ravel()
    order = np.argsort(times, kind="stable")
    times, amplitudes = times[order], amplitudes[order]
    first = np.concatenate([[True], np.diff(times) > 1e-12 * max(times[-1], 1e-300)])  # impulses at one time become one
    return InputShaper(read_only(times[first]), read_only(np.add.reduceat(amplitudes, np.flatnonzero(first))))


def _phasor(times: FloatArray, amplitudes: FloatArray, rate: FloatArray, ratio: FloatArray) -> Any:
    """Vibration after the last impulse as complex numbers, shape of `rate` and then that of one amplitude."""
    damped = rate * np.sqrt(1.0 - ratio**2)
    before = times[-1] - times
    turns = np.exp(-np.multiply.outer(rate * ratio, before) - 1j * np.multiply.outer(damped, before))
    return np.tensordot(turns, amplitudes, axes=([-1], [0]))


def _exciting(
    path: Callable[[Any], FloatArray],
    times: FloatArray,
    frequencies: FloatArray,
    ratios: FloatArray,
    shaper: str,
    tolerance: float,
) -> list[int]:
    """Numbers of the modes that the path excites, lowest first, each judged after shaping for those before it."""
    vibrating = [int(n) for n in np.argsort(frequencies, kind="stable") if 0.0 <= ratios[n] < 1.0]
    left = {}
    for n in vibrating:
        samples = math.ceil(16.0 * frequencies[n] * times[-1]) + 8 * len(times)
        instants = np.linspace(0.0, times[-1], min(samples, _MOST_SAMPLES))
        middles = 0.5 * (instants[1:] + instants[:-1])
        phasor = _phasor(middles, np.diff(path(instants), axis=0), 2.0 * math.pi * frequencies[n], ratios[n])
        left[n] = float(np.linalg.norm(phasor))
    least, chosen = _NEGLIGIBLE * max(left.values(), default=0.0), list[int]()
    for n in vibrating:
        so_far = _convolved(*_modes(frequencies[chosen], ratios[chosen]), shaper, tolerance)
        if float(residual_vibration(so_far, frequencies[n], ratios[n])) * left[n] > least:
            chosen.append(n)
    return chosen
