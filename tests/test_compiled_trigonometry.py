"""Sine and cosine of the kernel language: against 40 digits, and as lanes of machine code."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from types import ModuleType
from typing import Any

import mpmath
import numpy as np
import pytest

from softrobots.compiled.drivers import intrinsics, trigonometry
from softrobots.compiled.drivers.trigonometry import cosine, sine
from softrobots.compiled.program.generated_module import functions_of

TEXT = "from __future__ import annotations\n" + "\n".join(map(inspect.getsource, functions_of(trigonometry)))


def angles(rng: np.random.Generator) -> np.ndarray:
    """Everywhere up to 1e5; at, and within some roundings of, whole and half quarter turns; tiny."""
    quarters = rng.integers(-63661, 63662, 800) * (np.pi / 2.0)
    near = quarters * (1.0 + rng.uniform(-1.0, 1.0, 800) * 1e-14)
    halves = (quarters + np.pi / 4.0) * (1.0 + rng.uniform(-1.0, 1.0, 800) * 1e-13)
    tiny = 10.0 ** rng.uniform(-320.0, 0.0, 400)
    special = [0.0, 1e5, -1e5, math.pi, -math.pi / 2.0, math.pi / 4.0, 5e-324]
    wide = [rng.uniform(-1e5, 1e5, 1500), rng.uniform(-7.0, 7.0, 1500)]
    return np.concatenate([special, *wide, quarters, near, halves, tiny, -tiny])


@pytest.mark.parametrize(("function", "exact"), [(sine, mpmath.sin), (cosine, mpmath.cos)])
def test_sine_and_cosine_are_right_to_less_than_two_units_in_the_last_place(
    function: Callable[[float], float], exact: Callable[[Any], Any], rng: np.random.Generator
) -> None:
    """Measured at 80 000 angles: 1.43 units, 1.13e-16; the units make it relative, also beside the zeros at multiples of pi."""
    worst = 0.0
    with mpmath.workdps(40):
        for angle in angles(rng).tolist():
            truth, found = exact(mpmath.mpf(angle)), function(angle)
            error = float(abs(truth - mpmath.mpf(found)))
            assert error <= 1.5 * math.ulp(float(truth)), angle
            worst = max(worst, error)
    assert worst <= 1.2e-16


@pytest.mark.parametrize(("largest", "error"), [(1e6, 2e-16), (1e8, 2e-8), (1e12, 2e-4)])
def test_far_out_the_error_is_what_the_docstring_says(largest: float, error: float, rng: np.random.Generator) -> None:
    with mpmath.workdps(40):
        for angle in rng.uniform(-largest, largest, 300).tolist():
            assert abs(sine(angle) - mpmath.sin(mpmath.mpf(angle))) <= error
            assert abs(cosine(angle) - mpmath.cos(mpmath.mpf(angle))) <= error


def test_the_text_of_the_functions_stands_on_its_own() -> None:
    """In the order given, with nothing but the intrinsics."""
    names: dict[str, Any] = dict(vars(intrinsics))
    exec(TEXT, names)
    assert names["sine"](1.0) == pytest.approx(math.sin(1.0), rel=2e-16)
    assert names["cosine"](1.0) == pytest.approx(math.cos(1.0), rel=2e-16)


def test_intrinsics_of_plain_python() -> None:
    assert [intrinsics.floor(x) for x in (1.5, -1.5, -2.0, 1e300)] == [1.0, -2.0, -2.0, 1e300]
    assert isinstance(intrinsics.floor(1.5), float)
    assert (intrinsics.fabs(-2.5), intrinsics.sqrt(2.25)) == (2.5, 1.5)
    assert (intrinsics.where(True, 1.0, 2.0), intrinsics.where(False, 1.0, 2.0)) == (1.0, 2.0)
    assert intrinsics.zeros(3) == [0.0, 0.0, 0.0]
    for function in (intrinsics.floor, sine):
        with pytest.raises(OverflowError):
            function(math.inf)


def test_numba_makes_lanes_of_them(tool: Callable[[str], ModuleType]) -> None:
    """Several numbers in one instruction ("packed double"), on x86 and on ARM; and the same numbers come out."""
    numba = tool("numba")

    def compiled(function: Callable[..., Any], *signature: str) -> Any:
        return numba.njit(*signature, fastmath={"contract", "arcp", "nsz"})(function)

    names: dict[str, Any] = {"floor": np.floor, "where": compiled(lambda condition, a, b: a if condition else b)}
    exec(TEXT, names)
    for function in functions_of(trigonometry):
        names[function.__name__] = compiled(names[function.__name__])
    exec("def lanes(w):\n    for lane in range(256):\n        w[256 + lane] = sine(w[lane])\n", names)
    lanes = compiled(names["lanes"], "void(float64[::1])")
    (machine_code,) = lanes.inspect_asm().values()
    packed = r"^\s*v?(mulpd|fn?madd\d+pd)\s|^\s*fm(ul|la)(\.2d\s|\s+v\d+\.2d)"
    assert len(re.findall(packed, machine_code, re.MULTILINE)) >= 10  # two polynomials of six terms each
    workspace = np.linspace(-10.0, 10.0, 512)
    workspace[:4] = math.nan, math.inf, -math.inf, 1e5
    expected = [math.sin(x) if math.isfinite(x) else math.nan for x in workspace[:256]]
    lanes(workspace)
    # Fused multiplication changes the last digit.
    assert np.allclose(workspace[256:], expected, rtol=0.0, atol=3e-16, equal_nan=True)
