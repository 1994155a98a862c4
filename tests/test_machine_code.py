"""The kernel language by LLVM, called by functions that numba compiles, against the same text run by Python."""

from __future__ import annotations

import importlib.util
import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from softrobots.compiled.run.backends import numba_module
from tests.conftest import missing
from tests.support.kernel_texts import EVERYTHING, EXPORTED, PYTHON, TRIGONOMETRY, in_python

STAGES = f'''"""Functions with loops over both stages of a step, and over twelve components."""

TABLE = (0.25, -3.0)


{TRIGONOMETRY}


def both(w: Array, at: int, x: float) -> None:
    """All that such loops have: numbers of one stage and of both, a local, ints, every function."""
    y = x * TABLE[at - 1]
    for stage in range(2):
        a = w[at + stage] - w[at + 4 + stage] / (2 + w[8 + stage] * w[8 + stage])
        b = where(a < y, -a, sqrt(fabs(a)) + 1)
        w[at + 2 + stage] = floor(3.0 * a) - where(y > x, a, at)
        w[at + stage] = sine(a) * cosine(w[at + 4 + stage]) - y
        w[12 + stage] = b


def each(w: Array, x: float) -> None:
    """Call it."""
    both(w, 1, x)
    both(w, 2, -x)


def rows(w: Array, at: int, x: float) -> None:
    """Sums of rows, with what they have in common."""
    y = w[at]
    for part in range(12):
        a = w[at + part] * x - y / (3 + w[26 + part])
        w[at + part] = a - at
        w[14 + part] = -a
'''


@pytest.fixture(scope="module")
def in_machine_code(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str, list[str]], Any]]:
    """Functions of a text, in a folder of their own: what other versions of the package have left in caches is not taken."""
    if importlib.util.find_spec("numba") is None:
        missing("numba is not installed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOFTROBOTS_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield numba_module


@pytest.fixture(scope="module")
def everything(in_machine_code: Callable[[str, list[str]], Any]) -> Any:
    return in_machine_code(EVERYTHING, EXPORTED)


def assert_alike(module: Any, names: dict[str, Any], name: str, workspace: list[float], *rest: Any) -> None:
    """The same value, and the same numbers but for the rounding of products, which LLVM leaves out where sums follow."""
    found = np.array(workspace)
    assert getattr(module, f"{name}_alone")(found, *rest) == names[name](workspace, *rest)
    np.testing.assert_allclose(found, workspace, rtol=1e-14, atol=1e-14)


def test_ints_loops_and_returns(everything: Any, rng: np.random.Generator) -> None:
    for count in range(-3, 4):
        assert_alike(everything, PYTHON, "whole", [0.5] * 400, count)
    for count in (0, 1, 2, 7, 20):
        assert_alike(everything, PYTHON, "locals_and_loops", rng.uniform(-1.0, 1.0, 30).tolist(), count, 0.0)
    for n, least in itertools.product(range(-6, 6), (-1.0, 9.0)):
        assert everything.chosen_alone(n, least) == PYTHON["chosen"](n, least)
    for x in (0.5, -1.5, math.inf, math.nan):
        assert everything.is_large_alone(x) == (abs(x) > 1.0)


def test_operators_intrinsics_and_constants(everything: Any, rng: np.random.Generator) -> None:
    for n in range(8):
        for x, y in [(0.3, 0.3), (-0.0, 0.0), *rng.uniform(-1.0, 1.0, (10, 2)).tolist()]:
            assert_alike(everything, PYTHON, "operators", rng.uniform(-1.0, 1.0, 18).tolist(), x, y, n)
    for which in range(5):
        assert_alike(everything, PYTHON, "over", rng.uniform(0.0, 9.0, 40).tolist(), 40, which)


def test_both_stages_at_once(in_machine_code: Callable[[str, list[str]], Any], rng: np.random.Generator) -> None:
    """Pairs of numbers, and rows, are what the loop gives: no round reads what another one writes."""
    module, names = in_machine_code(STAGES, ["each", "rows"]), in_python(STAGES)
    for x in rng.uniform(-2.0, 2.0, 20):
        assert_alike(module, names, "each", rng.uniform(-2.0, 2.0, 14).tolist(), float(x))
        assert_alike(module, names, "rows", rng.uniform(-2.0, 2.0, 38).tolist(), 2, float(x))


def test_arrays_that_are_not_flat_are_refused(everything: Any) -> None:
    for wrong in (np.zeros(80)[::2], np.zeros((40, 2)), np.zeros(40, dtype=np.float32)):
        with pytest.raises(Exception, match="flat and contiguous"):  # numba's TypingError
            everything.whole_alone(wrong, 1)
