r"""Frequencies and damping ratios from the record of a free vibration.

A robot that is plucked, or let go, and left alone moves as

.. math:: x(t) = c + \sum_i e^{-\sigma_i t} (a_i \cos \omega_i t + b_i \sin \omega_i t)

with the natural angular frequency :math:`|s_i| = \sqrt{\sigma_i^2 + \omega_i^2}` and the damping ratio :math:`\sigma_i / |s_i|`
of each mode. :math:`\sigma` and :math:`\omega`, which all signals share, are fitted by least squares with the amplitudes
eliminated (variable projection: Golub and Pereyra 1973, with the Jacobian of Kaufman 1975). Modes are added one by one, each
where the spectrum of what is left has its peak, as long as they stand out of the noise (Schwarz 1978).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_integer, read_only
from softrobots.core.errors import NotConverged, ParameterError
from softrobots.core.summary import summarised

_SAMPLES = 8  # least number of times a mode
_ROUNDING = 1e-12  # of the range of a signal
_DECAYS = np.geomspace(0.1, 1e3, 9)  # tried at first, times the length of the record


@summarised
class RingDown(NamedTuple):
    """Modes of a free vibration, slowest first; made by `ring_down`."""

    frequencies: FloatArray
    """Natural frequencies, as `VibrationModes.frequencies`, shape (n_modes,) [Hz]."""
    damping_ratios: FloatArray
    """Damping ratios, shape (n_modes,) [-]."""
    frequency_std: FloatArray
    """Standard deviations of the frequencies, shape (n_modes,) [Hz]."""
    damping_ratio_std: FloatArray
    """Standard deviations of the damping ratios, shape (n_modes,) [-]."""
    amplitudes: FloatArray
    """Amplitude of each mode in each signal at the first time, shape (n_modes, n_signals), in the units of the signals."""
    noise: FloatArray
    """Root mean square of what is left of each signal, shape (n_signals,)."""


class _Projection:
    """Vibrations of given decays and angular frequencies, fitted linearly to signals."""

    def __init__(self, shape: FloatArray, t: FloatArray, x: FloatArray) -> None:
        (rates, angular), self.t = shape.reshape(-1, 2).T, t[:, None]
        with np.errstate(over="ignore", invalid="ignore"):
            waves = np.exp(-rates * self.t + 1j * angular * self.t)
        self.ok = bool(np.isfinite(waves).all())
        waves = waves if self.ok else np.zeros_like(waves)
        self._waves, basis = waves, np.concatenate([np.ones_like(self.t), waves.real, waves.imag], axis=1)
        left, values, right = np.linalg.svd(basis, full_matrices=False)
        kept = values > _ROUNDING * values[0]
        self._left = left[:, kept]
        parts = (right[kept].T / values[kept]) @ (self._left.T @ x)
        self.amplitudes = parts[1 : 1 + len(rates)] - 1j * parts[1 + len(rates) :]
        """Complex amplitudes, shape (n_modes, n_signals): real part of amplitude times wave."""
        self.left = self._without(x)
        """What is left of the signals, shape (n, n_signals)."""

    def _without(self, x: FloatArray) -> FloatArray:
        return np.asarray(x - self._left @ (self._left.T @ x))

    def rows(self) -> FloatArray:
        """What is left, flat; infinite where the vibrations are."""
        return self.left.ravel() if self.ok else np.full(self.left.size, np.inf)

    def jacobian(self) -> FloatArray:
        """Its derivative by the decay and the angular frequency of each mode."""
        columns = []
        for mode, amplitudes in enumerate(self.amplitudes):
            moved = self.t * self._waves[:, mode, None] * amplitudes
            columns += [self._without(moved.real).ravel(), self._without(moved.imag).ravel()]
        return np.column_stack(columns)


def ring_down(time: Any, values: Any, n_modes: Any = 1) -> RingDown:
    """Natural frequencies and damping ratios of a recorded free vibration, with standard deviations.

    The record begins after the robot is let go, while it swings little: frequencies are those of small vibrations. Give them to
    `Measurements` as a row's `frequencies` and `damping_ratios`, at the place of each mode, NaN where a slower mode was not
    seen: one pluck seldom moves all.

    Args:
        time: Times, ascending, at least 8 for each mode, that span a period or more, shape (n,) [s].
        values: What was measured then, any units: one signal, shape (n,), or several, shape (n, n_signals), e.g. coordinates of
            a marker, or loads on motors.
        n_modes: Number of modes.

    Returns:
        The modes. Standard deviations are those of independent errors, of one size for each signal.

    Raises:
        ParameterError: If shapes differ, times do not ascend, or no signal changes.
        NotConverged: If so many vibrations do not stand out of the noise; carries those that do.
    """
    count = positive_integer("n_modes", n_modes)
    t = finite_array("time", time, (None,), "s")
    x = finite_array("values", values, (len(t),) if np.ndim(values) == 1 else (len(t), None))
    if len(t) < _SAMPLES * count or not np.all(np.diff(t) > 0.0):
        raise ParameterError("time", time, f"at least {_SAMPLES * count} ascending times [s]")
    x = x.reshape(len(t), -1)
    ranges = np.ptp(x, axis=0) if x.size else np.zeros(0)
    if not np.any(ranges > _ROUNDING * np.abs(x).max(initial=0.0)):
        raise ParameterError("values", values, "signals of which at least one changes")
    scales = np.where(ranges > _ROUNDING * np.abs(x).max(axis=0), ranges, 1.0)
    span = float(t[-1] - t[0])
    moments, scaled = (t - t[0]) / span, (x - x.mean(axis=0)) / scales
    found, spent, enough = np.zeros(0), 0, True
    while enough and found.size < 2 * count:
        more, steps = _one_more(found, moments, scaled)
        spent += steps
        old, new = (float(np.sum(_Projection(one, moments, scaled).left ** 2)) for one in (found, more))
        noise = max(new / scaled.size, _ROUNDING**2)
        enough = old - new > noise * 2.0 * (1 + x.shape[1]) * math.log(scaled.size) and bool(np.all(more[1::2] > math.pi))
        found = more if enough else found
    weights = np.maximum(np.sqrt(np.mean(_Projection(found, moments, scaled).left ** 2, axis=0)), _ROUNDING)
    found, steps = _fit(found, moments, scaled / weights)
    result, rates_std = _result(found, moments, scaled / weights, span, scales * weights)
    grows = found[::2] < -4.0 * rates_std - 1e-9
    if not enough or np.any(grows):
        why = "one of them grows" if np.any(grows) else f"only {len(result.frequencies)} of them stand out of the noise"
        raise NotConverged(
            f"no {count} decaying vibrations of a period or more fit the record: {why} ({result.frequencies} Hz)",
            best=result,
            residual=float(np.linalg.norm(result.noise)),
            iterations=spent + steps,
        )
    return result


def _one_more(found: FloatArray, t: FloatArray, x: FloatArray) -> tuple[FloatArray, int]:
    """Add a vibration at the peak of the spectrum of what is left, and fit all."""
    even = np.linspace(0.0, 1.0, 2 * len(t))
    left = np.array([np.interp(even, t, one) for one in _Projection(found, t, x).left.T])
    power = np.sum(np.abs(np.fft.rfft(left, 4 * len(even))) ** 2, axis=0)
    angular = 0.5 * math.pi * (4 + int(power[4:].argmax()))
    starts = [np.append(found, (decay, angular)) for decay in _DECAYS]
    return _fit(min(starts, key=lambda start: float(np.sum(_Projection(start, t, x).left ** 2))), t, x)


def _fit(start: FloatArray, t: FloatArray, x: FloatArray) -> tuple[FloatArray, int]:
    """Best decays and angular frequencies nearby, flat, per length of the record; and the steps spent."""
    from scipy.optimize import least_squares

    if not start.size:
        return start, 0
    fit = least_squares(
        lambda shape: _Projection(shape, t, x).rows(), start, lambda shape: _Projection(shape, t, x).jacobian(),
        x_scale=np.repeat(np.maximum(np.abs(start[1::2]), 1.0), 2), xtol=1e-14, ftol=1e-14,
    )  # fmt: skip
    shape = fit.x.reshape(-1, 2)
    shape[:, 1] = np.abs(shape[:, 1])
    return shape[np.argsort(np.hypot(*shape.T))].ravel(), int(fit.nfev)


def _result(shape: FloatArray, t: FloatArray, x: FloatArray, span: float, scales: FloatArray) -> tuple[RingDown, FloatArray]:
    """Modes with standard deviations, and standard deviations of the decays per length of the record."""
    at, (rates, angular) = _Projection(shape, t, x), shape.reshape(-1, 2).T
    freedoms = x.size - x.shape[1] * (1 + shape.size) - shape.size
    sizes = np.hypot(rates, angular)
    spread: Any = np.zeros((shape.size, shape.size))
    if shape.size:
        spread = np.linalg.pinv(np.linalg.qr(at.jacobian(), mode="r")) * math.sqrt(float(np.sum(at.left**2)) / freedoms)
    by_rate, by_angular = spread[::2], spread[1::2]
    frequency_std = np.linalg.norm(rates[:, None] * by_rate + angular[:, None] * by_angular, axis=1) / sizes
    ratio_std = np.linalg.norm(angular[:, None] * by_rate - rates[:, None] * by_angular, axis=1) * angular / sizes**3
    result = RingDown(
        frequencies=read_only(sizes / (2.0 * math.pi * span)),
        damping_ratios=read_only(np.maximum(rates, 0.0) / sizes),
        frequency_std=read_only(frequency_std / (2.0 * math.pi * span)),
        damping_ratio_std=read_only(ratio_std),
        amplitudes=read_only(np.abs(at.amplitudes) * scales),
        noise=read_only(np.sqrt(np.mean(at.left**2, axis=0)) * scales),
    )
    return result, np.linalg.norm(by_rate, axis=1)
