"""Closed forms under anything that a caller may pass: a finite answer, or an error of ours that can be told, and no warning."""

from __future__ import annotations

import dataclasses
import decimal
import fractions
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from tests.support.closed_form_calls import ARC, CALLS, DESIGN, PLAN, SHAPE
from tests.support.tables import each_row


class Thrower:
    """Something whose every conversion goes wrong."""

    def _fail(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("not a number")

    __float__ = __index__ = __array__ = __len__ = __repr__ = _fail


def _nested(depth: int) -> Any:
    made: Any = 1.0
    for _ in range(depth):
        made = [made]
    return made


EDGES = [
    0.0,
    -0.0,
    5e-324,
    1e-308,
    9.9e-31,
    1e-30,
    1e-29,
    1e-16,
    1e-8,
    0.5,
    1.0,
    1.5,
    math.pi / 2,
    30.0,
    1e10,
    1e29,
    1e30,
    1.1e30,
    1e308,
]
EDGES += [math.nextafter(edge, towards) for edge in (1.0, math.pi / 2, 1e30, 1e-30) for towards in (0.0, math.inf)]
NUMBERS = st.one_of(
    st.sampled_from(EDGES), st.floats(-29.9, 29.9).map(lambda power: 10.0**power), st.floats(0.0, 1.6), st.floats()
)

OTHERS = [
    math.nan, math.inf, 0, 1, 2, 2**63, 10**400, -(10**400), 10**5000, True, None, "", "0.5", "nan", b"1", 1j, [], [[]], (),
    {}, {1: 2}, {0.5}, [0.5], [0.5, 0.6], [0.5, [0.6]], [0.5, None], [0.5, "a"], [math.nan], [True], [1j], range(3),
    bytearray(b"ab"), slice(None), np.array(0.5), np.array([0.5]), np.array([[0.5], [0.6]]), np.zeros(0), np.zeros((0, 3)),
    np.zeros((3, 0)), np.zeros((2, 0, 2)), np.float16(0.5), np.float16(65504.0), np.float32(0.5), np.longdouble("1e400"),
    np.array([np.longdouble("1e400")]), np.int8(1), np.uint64(2**64 - 1), np.array([1, 2], dtype=np.uint8), np.array(["a"]),
    np.array([None]), np.array([0.5], dtype=object), np.datetime64("2020-01-01"), np.timedelta64(1, "s"),
    np.timedelta64(1, "ns"), np.array([1, 2], dtype="M8[s]"), np.bool_(True),
    np.ma.masked_array([0.5, 0.6], mask=[True, False]), np.ma.masked, np.array([(1.0, 2)], dtype=[("a", float), ("b", int)]),
    fractions.Fraction(1, 2), fractions.Fraction(10**400), decimal.Decimal("0.5"), decimal.Decimal("sNaN"),
    decimal.Decimal("1e400"), _nested(5), _nested(70), _nested(3000), object(), Thrower(), float, Ellipsis, lambda s: 0.5,
    lambda s: math.nan, lambda s: 1 / 0, [[0.0, 0.3], [0.5, 0.6]], "right", "inner", "nearest", "x" * 10_000, "\ud800",
    "\x00", [0.5] * 3, [0.5] * 4, [[0.5] * 3] * 2, [1e30] * 3, [1e-30] * 3, [1e-30, 1.0, 1e30], [1e30] * 4,
    [1e30, 1e30, 0.0, 1e30], [0.1, 0.2, -0.0, 0.5], ARC, SHAPE, DESIGN, PLAN,
]  # fmt: skip


def lost(value: Any) -> list[str]:
    """Places in an answer that hold no finite number."""
    if isinstance(value, float | np.floating):
        return [] if math.isfinite(value) else [str(value)]
    if isinstance(value, np.ndarray):
        return [] if value.dtype.kind != "f" or np.all(np.isfinite(value)) else [str(value)]
    if isinstance(value, tuple | list):
        return [f"[{place}] {told}" for place, part in enumerate(value) for told in lost(part)]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        names += [name for name, kind in vars(type(value)).items() if isinstance(kind, property)]
        return [f".{name} {told}" for name in names for told in lost(getattr(value, name))]
    return []


def answered(call: Callable[..., Any], arguments: dict[str, Any]) -> None:
    """Call, and fail unless the answer is finite or an error of ours that has words."""
    try:
        assert not lost(call(**arguments))
    except sr.SoftRobotsError as error:
        assert str(error)


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=8)
@given(data=st.data())
def test_any_numbers_give_finite_numbers_or_an_error(name: str, data: st.DataObject) -> None:
    """Some of the numbers replaced by the largest, the smallest, those next to a limit, or any float64 at all."""
    call, arguments = CALLS[name]
    numbers = [key for key, value in arguments.items() if isinstance(value, float)]
    if numbers:
        changed = data.draw(st.lists(st.sampled_from(numbers), min_size=1, unique=True))
        answered(call, arguments | {key: data.draw(NUMBERS) for key in changed})
    else:
        key = data.draw(st.sampled_from(sorted(arguments)))
        answered(call, arguments | {key: data.draw(st.lists(NUMBERS, min_size=1, max_size=4))})


@pytest.mark.study
@pytest.mark.filterwarnings("ignore::softrobots.SuspiciousInputWarning")  # sizes of any kind are meant
@each_row("name", CALLS)
def test_anything_else_gives_an_answer_or_an_error(name: str) -> None:
    """Every argument replaced by every thing that is no number, or one in an unusual form."""
    call, arguments = CALLS[name]
    assert not lost(call(**arguments))
    for key in arguments:
        for other in OTHERS:
            answered(call, arguments | {key: other})


def test_numbers_in_other_forms_are_the_same_numbers() -> None:
    """What is kept of them is a float, so that later arithmetic does not depend on who passed it."""
    half = [decimal.Decimal("0.5"), fractions.Fraction(1, 2), np.float16(0.5), np.float32(0.5), np.array(0.5)]
    for form in half:
        test = inflated_beam.BendingTest(probe_distance=form, hinge_offset=0.0)
        assert type(test.probe_distance) is float
        assert test == inflated_beam.BendingTest(probe_distance=0.5, hinge_offset=0.0)
        assert pickle.loads(pickle.dumps(test)) == test
    tube = {"pressure": 0.0, "radius": 1e4, "wall_thickness": 1.0}
    long = inflated_beam.stiffness_from_young_modulus(1e8, length=np.float16(60000.0), **tube)  # its square is beyond float16
    assert long == inflated_beam.stiffness_from_young_modulus(1e8, length=60000.0, **tube)
