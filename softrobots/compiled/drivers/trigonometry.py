"""Sine and cosine in the kernel language, without branches, tables or integers, so that a compiler can vectorise them.

x = q pi/2 + r with q whole and |r| <= pi/4. The multiple is taken off in three parts (W. J. Cody and W. Waite, Software Manual
for the Elementary Functions, 1980): pi/2 = p1 + p2 + p3 with 33 bits each in p1 and p2, so that q p1 and q p2 are exact for
|q| < 2^20, with or without fused multiplication. On [-pi/4, pi/4] sine and cosine are the minimax polynomials of fdlibm (Sun
Microsystems 1993, k_sin.c and k_cos.c). Which of the two, and its sign, follow from q modulo 4.

The error is below 1.5 units in the last place for |x| <= 1e6, also where the answer is near zero. Beyond that q p1 is rounded,
and the error jumps to about |x| 1e-16; above 1e15 the result is meaningless and may lie outside [-1, 1]. NaN and infinity give
NaN (in plain Python `floor` refuses them). The functions share their helpers, so that a compiler does all but the last step
once for the sine and cosine of one number.
"""

from __future__ import annotations

from softrobots.compiled.drivers.intrinsics import floor, where


def quarter_turns(x: float) -> float:
    """Return the whole number q of quarter turns that is nearest to the angle x [rad]."""
    return floor(x * 0.6366197723675814 + 0.5)


def beyond_quarters(x: float, q: float) -> float:
    """Return r = x - q pi/2 [rad]; the rounding error of the second difference is added to the third."""
    first = x - q * 1.5707963267341256
    second = q * 6.077100506303966e-11
    difference = first - second
    return difference + (((first - difference) - second) - q * 2.0222662487959506e-21)


def is_odd(q: float) -> bool:
    """Tell whether the whole number q is odd."""
    return q - 2.0 * floor(q * 0.5) > 0.5


def sine_near_zero(r: float) -> float:
    """Return sin r for |r| <= pi/4."""
    z = r * r
    high = -1.984126982985795e-04 + z * (2.7557313707070068e-06 + z * (-2.5050760253406863e-08 + z * 1.58969099521155e-10))
    return r + r * z * (-0.16666666666666632 + z * (0.00833333333332249 + z * high))


def cosine_near_zero(r: float) -> float:
    """Return cos r for |r| <= pi/4; the rounding error of 1 - r^2/2 is added again."""
    z = r * r
    high = 2.480158728947673e-05 + z * (-2.7557314351390663e-07 + z * (2.087572321298175e-09 + z * -1.1359647557788195e-11))
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + z * z * (0.0416666666666666 + z * (-0.001388888888887411 + z * high)))


def sine(x: float) -> float:
    """Return the sine of the angle x [rad]."""
    q = quarter_turns(x)
    r = beyond_quarters(x, q)
    size = where(is_odd(q), cosine_near_zero(r), sine_near_zero(r))
    return where(is_odd(floor(q * 0.5)), -size, size)


def cosine(x: float) -> float:
    """Return the cosine of the angle x [rad]."""
    q = quarter_turns(x)
    r = beyond_quarters(x, q)
    size = where(is_odd(q), sine_near_zero(r), cosine_near_zero(r))
    return where(is_odd(floor((q + 1.0) * 0.5)), -size, size)
