"""Traced expressions: folding, sharing, slopes, text and hoisting never change a value."""

from __future__ import annotations

import ast
import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import (
    Expression,
    Trace,
    absolute,
    cosine,
    gradient,
    if_less,
    in_order,
    inverse_cube_root,
    larger,
    sine,
    smaller,
    square_root,
)
from softrobots.compiled.translate.kernel_language import read_module
from tests.support.traced import MANY_DIGITS, functions, operations, values

INPUTS = 4
CONSTANTS = (0.0, 1.0, -1.0, 2.0, -0.75)


# Text like `a + b + c` is put together from left to right, whatever was written: rounding may differ, values may not. So all
# is computed with 90 digits. What is a double exactly may be a constant in the code; its functions come from libm, and sums of
# constants are rounded to doubles where they fold: nine digits are asked for.


def with_digits(plain: Callable[[float], float], exact: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: mp.mpf(plain(float(value))) if value == float(value) else exact(value)


DIGITS = {
    "sine": with_digits(math.sin, mp.sin),
    "cosine": with_digits(math.cos, mp.cos),
    "sqrt": with_digits(math.sqrt, mp.sqrt),
    "fabs": abs,
}
TRACED = {"sine": sine, "cosine": cosine, "sqrt": square_root, "fabs": absolute}


def function(name: str, value: Any) -> Any:
    """A function of a number with many digits, or of what is traced or a constant."""
    return (DIGITS if isinstance(value, mp.mpf) else TRACED)[name](value)


def less(one: Any, other: Any, then: Any, otherwise: Any) -> Any:
    """`if_less`; what differs by the tenth digit only is not compared."""
    if isinstance(one, mp.mpf) or isinstance(other, mp.mpf):
        assume(one == other or abs(one - other) > 1e-9)
        return then if one < other else otherwise
    return if_less(one, other, then, otherwise)


# Quotients by constants are products with the reciprocal: exact for powers of two, which are all that is divided by here.
OPERATIONS: tuple[Callable[[Any, Any, Any, Any], Any], ...] = (
    lambda a, b, c, x: a + b,
    lambda a, b, c, x: a - b,
    lambda a, b, c, x: a * b,
    lambda a, b, c, x: a * 0.5 + b * c,
    lambda a, b, c, x: a - (b - c),
    lambda a, b, c, x: a + (b + c),
    lambda a, b, c, x: (a - b) - c,
    lambda a, b, c, x: a * (b / x),
    lambda a, b, c, x: (a + b) * (a - c),
    lambda a, b, c, x: -a,
    lambda a, b, c, x: -(a - b) + -(c * x),
    lambda a, b, c, x: -a * -b,
    lambda a, b, c, x: a / x - b / (1.0 + x * x),
    lambda a, b, c, x: a / -4.0 + 0.0 / x,
    lambda a, b, c, x: 2.0 / x - (1.5 - a),
    lambda a, b, c, x: 0.0 - a,
    lambda a, b, c, x: function("sine", a) * function("cosine", b),
    lambda a, b, c, x: function("sqrt", function("fabs", a) + 0.25),
    lambda a, b, c, x: less(a, b, c, x),
    lambda a, b, c, x: less(a, b, a, b) - less(b, c, c, b),
)
sizes = st.floats(0.1, 3.0)
inputs_ = st.lists(st.tuples(sizes, st.sampled_from((1.0, -1.0))).map(math.prod), min_size=INPUTS, max_size=INPUTS)
picks_ = st.integers(0, 12)
recipes_ = st.lists(
    st.tuples(st.integers(0, len(OPERATIONS) - 1), picks_, picks_, picks_, st.integers(0, INPUTS - 1)), min_size=4, max_size=14
)


def computed(recipe: list[tuple[int, int, int, int, int]], inputs: Sequence[Any]) -> list[Any]:
    """Follow a recipe, whatever the inputs are; each step takes what was made before, mostly the last."""
    made: list[Any] = [*inputs, *CONSTANTS]
    for operation, *picks, place in recipe:
        made.append(OPERATIONS[operation](*(made[-1 - pick % len(made)] for pick in picks), inputs[place]))
    return made[len(inputs) + len(CONSTANTS) :]


def traced(recipe: list[tuple[int, int, int, int, int]]) -> tuple[Block, list[Expression], list[Any]]:
    block = Block("compute", "Compute.")
    loads = block.loads(0, INPUTS)
    return block, loads, computed(recipe, loads)


# --- Values


@pytest.fixture(scope="module", autouse=True)
def many_digits() -> Iterator[None]:
    with mp.workdps(90):
        yield


def exactly(inputs: Sequence[float]) -> list[Any]:
    return [mp.mpf(one) for one in inputs]


def same(found: Sequence[Any], expected: Sequence[Any]) -> bool:
    """Whether numbers agree to nine digits of the largest that comes up."""
    largest = 1 + max(abs(one) for one in expected)
    return all(abs(one - other) < 1e-9 * largest for one, other in zip(found, expected, strict=True))


def moderate(numbers: Sequence[Any]) -> bool:
    return all(abs(one) < 1e6 for one in numbers)


@given(recipes_, inputs_)
@settings(max_examples=100)
def test_the_traced_code_computes_what_was_written(recipe: list, inputs: list[float]) -> None:
    """However its constants are folded, its parts shared and its text cut into lines."""
    expected = computed(recipe, exactly(inputs))
    assume(moderate(expected))
    block, _, made = traced(recipe)
    assert same(values(block, made, exactly(inputs), **DIGITS), expected)


@given(recipes_, st.lists(inputs_, min_size=3, max_size=3))
@settings(max_examples=40)
def test_lanes_compute_what_one_case_computes(recipe: list, cases: list[list[float]]) -> None:
    """They do not mix, and writing over the inputs does no harm."""
    expected = [computed(recipe, exactly(case)) for case in cases]
    assume(all(moderate(one) for one in expected))
    block, _, made = traced(recipe)
    block.store_all(0, made)
    size = max(INPUTS, len(made))
    one = functions(block.text(), **DIGITS)["compute"]
    many = functions(f"LANES = {len(cases)}\n\n{block.text(lanes=True)}", **DIGITS)["compute"]
    alone = [[*exactly(case), *[0.0] * (size - INPUTS)] for case in cases]
    lanes = [value for row in zip(*alone, strict=True) for value in row]
    many(lanes)
    for number, case in enumerate(alone):
        one(case)
        assert same(case[: len(made)], expected[number])
        assert same(lanes[number :: len(cases)], case)


def test_equal_expressions_are_one() -> None:
    trace = Trace()
    a, b = trace.load("w", "", 0), trace.load("w", "", 1)
    assert trace.load("w", "", 0) is a
    assert a + b is b + a
    assert a * b is b * a
    assert a - b is -(b - a)
    assert a - -b is a + b
    assert -a * b is -(a * b)
    assert (-a).__neg__() is a
    assert a - b is not b - a
    assert sine(a + 2.0) is sine(2.0 + a)
    assert trace.load("w", "i", 0) is not a
    assert trace.load("TABLE", "", 0) is not a


def test_what_is_known_costs_nothing() -> None:
    a = Trace().load("w", "", 0)
    assert (a + 0.0 is a, a * 1.0 is a, a - 0.0 is a, a / 1.0 is a) == (True,) * 4
    assert (a * 0.0, 0.0 * a, a - a, 0.0 / a) == (0.0,) * 4
    assert isinstance(a * 0.0, float)
    assert -1.0 * a is -a
    assert (sine(0.5), cosine(0.5), square_root(2.25), absolute(-2.0)) == (math.sin(0.5), math.cos(0.5), 1.5, 2.0)
    assert (smaller(1.0, 2.0), larger(1.0, 2.0), if_less(1.0, 1.0, 3.0, 4.0), if_less(0.0, 1.0, a, 4.0)) == (1.0, 2.0, 4.0, a)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], dtype=object)
    assert (turn @ np.array([a, 2.0, 0.0], dtype=object)).tolist() == [-2.0, a, 0.0]


def test_where_nothing_can_be_compared_the_other_value_is_taken() -> None:
    block = Block("compute", "Compute.")
    a, b = block.loads(0, 2)
    (found,) = values(block, [if_less(a, b, 1.0, 2.0)], [math.nan, 0.0])
    assert found == 2.0
    assert if_less(math.nan, 0.0, 1.0, 2.0) == 2.0


# --- Slopes


@given(recipes_, inputs_)
@settings(max_examples=60)
def test_slopes_are_those_of_differences_at_90_digits(recipe: list, inputs: list[float]) -> None:
    """Step 1e-25: truncation 1e-50, rounding 1e-65; one-sided differences tell kinks, where there is no slope."""
    block, loads, made = traced(recipe)
    assume(isinstance(made[-1], Expression))
    outputs = [made[-1], *gradient(made[-1], loads)]
    step = mp.mpf(10) ** -25
    at = exactly(inputs)
    assume(moderate(computed(recipe, at)))
    here, *slopes = values(block, outputs, at, **MANY_DIGITS)
    for place, slope in enumerate(slopes):
        ahead, behind = (
            values(block, [made[-1]], [*at[:place], at[place] + way * step, *at[place + 1 :]], **MANY_DIGITS)[0]
            for way in (1, -1)
        )
        assume(abs(ahead - 2 * here + behind) < 1e-10 * step)  # no kink, and no slope that changes within a step
        # Constants of double precision that come of others are the same in both.
        assert abs(slope - (ahead - behind) / (2 * step)) < 1e-20 * (1 + abs(slope))


@given(st.tuples(sizes, sizes, sizes))
@settings(max_examples=20)
def test_second_slopes_are_symmetric_and_right(at: tuple[float, float, float]) -> None:
    """Of a work as the kernels have it, with roots, quotients and turns: against 90 digits."""

    def work(x: Any, y: Any, z: Any, root: Any, sin: Any) -> Any:
        return sin(x * y) / root(1.0 + z * z) + x * x * y / (z + 2.0) - 3.0 * x

    block = Block("compute", "Compute.")
    loads = block.loads(0, 3)
    first = gradient(work(*loads, square_root, sine), loads)
    second = [gradient(one, loads) for one in first]
    found = np.reshape(values(block, [one for row in second for one in row], at), (3, 3))
    for i, j in itertools.product(range(3), repeat=2):
        orders = [int(place == i) + int(place == j) for place in range(3)]
        exact = mp.diff(lambda x, y, z: work(x, y, z, mp.sqrt, mp.sin), at, tuple(orders))
        # Some ten roundings of terms up to (|x| + |y|)^2.
        assert abs(found[i, j] - exact) < 1e-14 * (1.0 + at[0] + at[1]) ** 2


def test_slopes_with_respect_to_what_lies_between() -> None:
    """An expression that is varied stands for itself: what it is made of is not looked at through it."""
    block = Block("compute", "Compute.")
    (x,) = block.loads(0, 1)
    square = x * x
    value = square * 3.0 + x
    assert values(block, gradient(value, [square, x]), [5.0]) == [3.0, 1.0]
    assert values(block, gradient(value, [x]), [5.0]) == [31.0]
    assert gradient(2.0, [x]) == [0.0]
    assert gradient(square, [block.load(7)]) == [0.0]


# --- Text


def test_what_is_written_at_the_end_is_read_first() -> None:
    block = Block("rotate", "Rotate three elements, and two behind a base.", ("q",))
    a, b, c = block.loads(0, 3)
    d, e = block.loads(0, 2, "q")
    block.store_all(0, [b, c, a])
    block.store_all(0, [e, d + a], "q")
    w = [1.0, 2.0, 3.0, 4.0, 5.0]
    functions(block.text())["rotate"](w, 3)
    assert w == [2.0, 3.0, 1.0, 5.0, 5.0]


def test_tables_are_read_at_their_row() -> None:
    block = Block("pick", "Read a table.", ("row", "q"))
    block.store(1, block.table("TABLE", 1, "row") * 2.0 + block.load(0, "q"), "q")
    w, lanes = [0.0, 7.0, 0.0], [0.0, 0.0, 7.0, 8.0, 0.0, 0.0]
    table = "TABLE = (1.0, 2.0, 3.0, 4.0)\nLANES = 2\n\n"
    functions(table + block.text())["pick"](w, 2, 1)
    functions(table + block.text(lanes=True))["pick"](lanes, 2, 1)
    assert (w[2], lanes[4:]) == (15.0, [15.0, 16.0])


def test_long_expressions_are_cut_into_lines() -> None:
    block = Block("add", "Add up.")
    total, nested = block.load(0), block.load(1)
    for one in block.loads(0, 400):
        total, nested = total + one, one - sine(nested) * 0.5
    block.store_all(0, [total, nested])
    for lanes in (False, True):
        text = block.text(lanes=lanes)
        assert max(map(len, text.splitlines())) < 2 * 88 + 20  # two parts, each within the limit, and a name
        ast.parse(text)
    module = read_module(f'"""Sums."""\n\n{block.text()}\n')
    assert list(module.functions) == ["add"]
    w = [float(number % 7) for number in range(400)]
    expected = w[1]
    for one in w:
        expected = one - math.sin(expected) * 0.5
    total_of_all = w[0] + sum(w)
    functions(block.text())["add"](w)
    assert w[:2] == [total_of_all, expected]


def test_a_block_that_writes_nothing_is_a_function() -> None:
    block = Block("rest", "Do nothing.", ("i",))
    w = [1.0]
    functions(block.text())["rest"](w, 0)
    functions("LANES = 1\n\n" + block.text(lanes=True))["rest"](w, 0)
    assert w == [1.0]


def test_shared_parts_are_computed_once() -> None:
    block = Block("twice", "Use a sine twice.")
    (x,) = block.loads(0, 1)
    block.store_all(1, [sine(x * 2.0) + 1.0, sine(x * 2.0) - x, -sine(x * 2.0)])
    assert block.text().count("sine(") == 1
    assert operations(block) == 5  # product, sine, sum, difference, sign
    assert len(re.findall(r"^ +x\d+ = ", block.text(), re.MULTILINE)) == 2  # the sine, and x


# --- Hoisting


@given(
    recipes_,
    inputs_,
    inputs_,
    st.sets(st.integers(0, INPUTS - 1)),
    st.sets(st.integers(0, INPUTS - 1)),
    st.integers(1, 3),
    st.booleans(),
)
@settings(max_examples=150)
def test_what_is_hoisted_is_computed_before_and_nothing_changes(
    recipe: list, earlier: list[float], later: list[float], moving: set[int], gone: set[int], blocks: int, based: bool
) -> None:
    """Elements that vary have another value when the first block runs, and overwritten ones are no number afterwards."""
    gone -= moving
    inputs = [later[place] if place in moving else earlier[place] for place in range(INPUTS)]
    expected = computed(recipe, exactly(inputs))
    assume(moderate(expected) and moderate(computed(recipe, exactly(earlier))))
    block, loads, made = traced(recipe)
    parts = [Block(f"part_{number}", "Compute.", ("at",), block.trace) for number in range(blocks)]
    for place, value in enumerate(made):
        parts[place % blocks].store(INPUTS + place, value)
    before = Block("before", "Prepare.", ("at",), block.trace)
    first = INPUTS + len(made)
    varying = [loads[place] for place in sorted(moving)]
    overwritten = [loads[place] for place in sorted(gone)]
    count = hoist(parts, before, varying, 2 if based else first, "at" if based else "", overwritten)
    w = [*exactly(earlier), *[0.0] * len(made), *[math.nan] * count]
    text = functions("\n\n\n".join(one.text() for one in (before, *parts)), **DIGITS)
    text["before"](w, first - 2)
    for place in range(INPUTS):
        w[place] = math.nan if place in gone else mp.mpf(inputs[place])
    for part in parts:
        text[part.name](w, first - 2)
    assert same(w[INPUTS:first], expected)
    assert all(not mp.isnan(value) for value in w[first:])  # every place is used, and no more
    for one in in_order([value for part in parts for _, _, value in part.stores]):
        if one.operation not in ("load", "neg"):
            assert depends(one, varying), one


def depends(expression: Expression, loads: Sequence[Expression]) -> bool:
    return expression in loads or any(depends(one, loads) for one in expression.operands)


@pytest.mark.parametrize("lanes", [False, True])
def test_hoisting_takes_nothing_where_all_varies(lanes: bool) -> None:
    block = Block("compute", "Compute.")
    a, b = block.loads(0, 2)
    block.store(2, sine(a) * b)
    text = block.text(lanes=lanes)
    before = Block("before", "Prepare.", (), block.trace)
    assert hoist([block], before, [a, b], 3) == 0
    assert before.stores == []
    assert block.text(lanes=lanes) == text


@given(st.floats(0.0, 12.0))
def test_cube_roots_by_square_roots_are_a_start(exponent: float) -> None:
    """To 2e-6 up to 1e12; what is left of one near one keeps its share, which the start of `softening` needs."""
    value = 1.0 + 10.0 ** (exponent - 9.0) if exponent < 9.0 else 10.0**exponent
    root = inverse_cube_root(value)
    assert root == pytest.approx(value ** (-1.0 / 3.0), rel=2e-6)
    assert 1.0 - root == pytest.approx(1.0 - value ** (-1.0 / 3.0), rel=1e-5, abs=1e-15)
