"""The kernel language in C: compiled by gcc, and compared with the same text run by Python."""

from __future__ import annotations

import ctypes
import itertools
import math
import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled.translate.c import to_c
from tests.conftest import missing
from tests.support.c_libraries import build_library
from tests.support.kernel_texts import EVERYTHING, EXPORTED, PYTHON, in_python
from tests.support.tables import each_row

pytestmark = pytest.mark.system


def bits(numbers: Any) -> list[bytes]:
    """Every NaN alike."""
    return [b"nan" if math.isnan(x) else struct.pack("<d", x) for x in numbers]


@pytest.fixture(scope="module")
def library_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_library(tmp_path_factory.mktemp("c"), to_c(EVERYTHING, prefix="arm_", exported=EXPORTED), "everything")


@pytest.fixture(scope="module")
def library(library_file: Path) -> ctypes.CDLL:
    made = ctypes.CDLL(str(library_file))
    array, number = ctypes.POINTER(ctypes.c_double), ctypes.c_double
    made.arm_whole.argtypes = [array, ctypes.c_int]
    made.arm_locals_and_loops.argtypes = [array, ctypes.c_int, number]
    made.arm_operators.argtypes = [array, number, number, ctypes.c_int]
    made.arm_over.argtypes = [array, ctypes.c_int, ctypes.c_int]
    made.arm_is_large.argtypes = [number]
    made.arm_chosen.argtypes = [ctypes.c_int, number]
    for name in ("locals_and_loops", "operators", "over"):
        getattr(made, f"arm_{name}").restype = None
    return made


def assert_alike(function: Callable[..., Any], name: str, workspace: list[float], *rest: Any) -> None:
    """The same bits in the workspace, and the same value."""
    in_c = (ctypes.c_double * len(workspace))(*workspace)
    value = PYTHON[name](workspace, *rest)
    assert function(in_c, *rest) == value
    assert bits(in_c) == bits(workspace)


# --- Programs


def test_arithmetic_of_ints(library: ctypes.CDLL) -> None:
    for count in range(-3, 4):
        assert_alike(library.arm_whole, "whole", [0.5] * 400, count)


def test_locals_loops_and_arrays(library: ctypes.CDLL, rng: np.random.Generator) -> None:
    for count in (0, 1, 2, 7, 20):
        assert_alike(library.arm_locals_and_loops, "locals_and_loops", rng.uniform(-1.0, 1.0, 30).tolist(), count, 0.0)


def test_operators_calls_and_constants(library: ctypes.CDLL, rng: np.random.Generator) -> None:
    for n in range(8):
        for x, y in [(0.3, 0.3), (-0.0, 0.0), *rng.uniform(-1.0, 1.0, (10, 2)).tolist()]:
            assert_alike(library.arm_operators, "operators", rng.uniform(-1.0, 1.0, 18).tolist(), x, y, n)


def test_returns(library: ctypes.CDLL) -> None:
    for n, least in itertools.product(range(-6, 6), (-1.0, 9.0)):
        assert library.arm_chosen(n, least) == PYTHON["chosen"](n, least)
    for x in (0.5, -1.5, math.inf, math.nan):
        assert library.arm_is_large(x) == (abs(x) > 1.0)


# --- Intrinsics


def in_c(library: ctypes.CDLL, which: int, numbers: list[float]) -> list[float]:
    workspace = (ctypes.c_double * len(numbers))(*numbers)
    library.arm_over(workspace, len(numbers), which)
    return list(workspace)


def numbers_of_all_sizes(rng: np.random.Generator) -> list[float]:
    """Random bit patterns: every exponent, subnormal ones, infinities and NaN; and numbers next to squares and whole ones."""
    anything = rng.integers(0, 2**64, 40_000, dtype=np.uint64).view(np.float64)
    subnormal = rng.integers(0, 2**52, 4000, dtype=np.uint64).view(np.float64)
    squares = rng.uniform(1.0, 2.0, 20_000) ** 2 * 4.0 ** rng.integers(-500, 500, 20_000)
    beside = [np.nextafter(squares, 0.0), squares, np.nextafter(squares, np.inf)]
    whole = np.arange(-2000.0, 2000.0) * 2.0 ** rng.integers(-12, 50, 4000)
    special = [0.0, 5e-324, 2.2250738585072014e-308, 2.225073858507201e-308, 1.7976931348623157e308, math.inf, math.nan, 1.0]
    edges = [
        4.0,
        np.nextafter(4.0, 0.0),
        np.nextafter(1.0, 0.0),
        np.nextafter(1.0, 2.0),
        2.0**52,
        2.0**53 + 2.0,
        -(2.0**52),
        -0.5,
    ]
    return [*np.concatenate([anything, subnormal, *beside, whole]).tolist(), *special, *map(float, edges)]


def test_the_square_root_is_correctly_rounded(library: ctypes.CDLL, rng: np.random.Generator) -> None:
    """As IEEE 754 asks of the processor's."""
    numbers = numbers_of_all_sizes(rng)
    expected = [math.nan if math.isnan(x) or x < 0.0 else math.sqrt(x) for x in numbers]
    assert bits(in_c(library, 0, numbers)) == bits(expected)


def test_floor_and_fabs(library: ctypes.CDLL, rng: np.random.Generator) -> None:
    numbers = numbers_of_all_sizes(rng)
    with np.errstate(invalid="ignore"):  # some of the bit patterns are signalling NaNs
        expected = np.floor(numbers)
    assert np.array_equal(in_c(library, 1, numbers), expected, equal_nan=True)
    assert bits(in_c(library, 2, numbers)) == bits(np.abs(numbers))


@pytest.mark.parametrize(("which", "name"), [(3, "sine"), (4, "cosine")])
def test_sine_and_cosine_are_those_of_plain_python_to_the_last_bit(
    library: ctypes.CDLL, which: int, name: str, rng: np.random.Generator
) -> None:
    numbers = [*rng.uniform(-1e5, 1e5, 3000), *rng.uniform(-4.0, 4.0, 3000), 0.0, 1e-300, math.pi / 2]
    assert bits(in_c(library, which, numbers)) == bits(map(PYTHON[name], numbers))
    assert np.allclose(in_c(library, which, numbers), getattr(np, {"sine": "sin", "cosine": "cos"}[name])(numbers), rtol=5e-16)
    assert all(math.isnan(x) for x in in_c(library, which, [math.nan, math.inf, -math.inf]))


# --- The file


def test_the_library_needs_nothing_and_shows_exported_names_only(library_file: Path) -> None:
    if not shutil.which("nm"):
        missing("nm is not installed (Debian: apt-get install binutils)")
    listed = subprocess.run(["nm", str(library_file)], capture_output=True, text=True, check=True).stdout.split("\n")
    symbols = [line.split()[-2:] for line in listed if line]
    assert not [name for kind, name in symbols if kind in "Uw"]
    assert {name for kind, name in symbols if kind.isupper()} == {f"arm_{name}" for name in EXPORTED if name != "N"}
    assert not [name for kind, name in symbols if kind in "bBdD" and not name.startswith("_")]  # no variables


def test_the_file_tells_how_to_call_and_keeps_only_what_is_needed() -> None:
    source = to_c(EVERYTHING, prefix="arm_", exported=EXPORTED)
    head = source[: source.index("*/")]
    assert "All that the language has." in head
    assert "enum { arm_N = 6 };" in head
    assert "int arm_chosen(int n, double least);\n *         A return on every way." in head
    assert "void arm_operators(double *w, double x, double y, int n);" in head
    assert "never" not in source.lower()
    assert "static double arm_norm(const double *w, int first)" in source  # it writes nothing
    assert "arm_SCALE = 1e+22;" in source
    assert "arm_TABLE[4] = { 1.0, -2.5, 3e-05, 0.1 };" in source
    included = set(re.findall(r"#include (.*)", source))
    assert included == {"<float.h>", "<limits.h>", "<stdint.h>"}  # of those that C99, section 4, gives a freestanding program
    assert max(map(len, source.splitlines())) <= 120
    small = to_c(EVERYTHING, prefix="arm_", exported=["add"])
    assert "sqrt" not in small
    assert "TABLE" not in small


def test_long_lines_are_broken() -> None:
    text = f"TABLE = ({', '.join(map(str, np.arange(200.0)))})\n\ndef f(i: int) -> float:\n"
    text += f'    """{"word " * 60}"""\n    return {" + ".join(["TABLE[i]"] * 40)}\n'
    lines = to_c(text, prefix="p_", exported=["f"]).splitlines()
    assert max(map(len, lines)) <= 120
    assert len(lines) > 30


# --- Any expression

names = st.sampled_from(["x", "y", "w[0]", "w[n * n - n * n + 1]", "0.5", "3.0", "1e-3"])
counts = st.sampled_from(["n", "m", "2", "7", "(-3)"])


def ints(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    pairs = st.tuples(inner, inner)
    return st.one_of(
        pairs.map("({0[0]} - {0[1]})".format),
        pairs.map("{0[0]} + {0[1]}".format),
        inner.map("-{}".format),
        pairs.map("({0[0]}) * ({0[1]})".format),
    )


whole_expressions = st.recursive(counts, ints, max_leaves=5)


def floats(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    pairs = st.tuples(inner, inner)
    compared = st.tuples(inner, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), inner).map(" ".join)
    either = st.tuples(compared, st.sampled_from([" and ", " or ", " and not "]), compared).map("".join)
    triples = st.tuples(st.one_of(compared, either), inner, inner)
    return st.one_of(
        *(pairs.map(form.format) for form in ("({0[0]} - {0[1]})", "{0[0]} + {0[1]}", "{0[0]} * {0[1]}", "{0[0]} - ({0[1]})")),
        pairs.map("({0[0]}) / (1.0 + fabs({0[1]}))".format),
        pairs.map("({0[0]}) * ({0[1]})".format),
        inner.map("-({})".format),
        inner.map("-{}".format),
        inner.map("sqrt(fabs({}))".format),
        inner.map("floor(({}) / 1e3)".format),
        triples.map("where({0[0]}, {0[1]}, {0[2]})".format),
        whole_expressions.map("({}) / 4".format),
        whole_expressions.map("0.5 * ({})".format),
    )


expressions = st.recursive(names, floats, max_leaves=12)


@given(texts=st.lists(expressions, min_size=60, max_size=60), rows=st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 5), min_size=4))
@settings(max_examples=4, suppress_health_check=list(HealthCheck))
def test_any_expression_gives_the_same_bits(tmp_path: Path, texts: list[str], rows: list[tuple[float, ...]]) -> None:
    lines = [f"    w[{3 + place}] = {text}" for place, text in enumerate(texts)]
    text = "def all_of_them(w: Array, x: float, y: float, n: int, m: int) -> None:\n" + "\n".join(lines) + "\n"
    name = f"any{len(list(tmp_path.iterdir()))}"  # a library is loaded once under its name
    function = ctypes.CDLL(str(build_library(tmp_path, to_c(text, prefix="p_", exported=["all_of_them"]), name))).p_all_of_them
    number = ctypes.c_double
    function.argtypes = [ctypes.POINTER(number), number, number, ctypes.c_int, ctypes.c_int]
    function.restype = None
    same = in_python(text)["all_of_them"]
    for x, y, *numbers in rows:
        for n, m in ((3, -4), (-7, 2), (0, 0)):
            workspace = [*numbers, *[0.0] * len(texts)]
            found = (number * len(workspace))(*workspace)
            same(workspace, x, y, n, m)
            function(found, x, y, n, m)
            assert bits(found) == bits(workspace)


# --- What is refused

INSIDE = [
    ("x = [1.0, 2.0]", "numbers, names"),
    ("x = (1.0, 2.0)", "numbers, names"),
    ("x = 'text'", "numbers, names"),
    ("x = lambda: 1.0", "numbers, names"),
    ("x = [y for y in w]", "numbers, names"),
    ("x = w[0] ** 2", r"\+ - \* /"),
    ("x = 1 << 2", r"\+ - \* /"),
    ("x = n // 2", r"\+ - \* /"),
    ("x = 1.0 if n > 2 else 2.0", "numbers, names"),
    ("for i in range(3):\n        continue", "statements are"),
    ("x = +w[0]", "numbers, names"),
    ("x = 1.0 < w[0] < 2.0", "one comparison at a time"),
    ("x = w[0] is 1.0", "numbers, names"),
    ("x = None", "numbers, names"),
    ("x = 1j", "numbers, names"),
    ("x = w[0].real", "numbers, names"),
    ("x = (y := 1.0)", "numbers, names"),
    ("x = 1.0 + (w[0] < 1.0)", "arithmetic is on numbers"),
    ("x = -(w[0] < 1.0)", "a number; where"),
    ("x = w[0] and 1.0", "a condition is"),
    ("x = sin(w[0])", "a function that is defined above; here: floor, fabs, sqrt, where, helper, writes, fills"),
    ("x = f(w, 1)", "a function that is defined above"),
    ("x = later(1.0)", "a function that is defined above"),
    ("x = w.sum()", "a function that is defined above"),
    ("x = sqrt(x=1.0)", "by position"),
    ("x = helper(1.0, 2.0)", "helper takes 1 argument"),
    ("x = helper(*w)", "helper takes 1 argument"),
    ("x = where(w[0] < 1.0, 2.0)", "where takes 3 arguments"),
    ("x = writes(1.0)", "writes takes the name of an array"),
    ("x = writes(TABLE)", "the name of an array"),
    ("x = fills(w)", "returns None"),
    ("x = helper(w)", "given above in the text; 'w' is none"),
    ("fills(1)", "the name of an array"),
    ("w[0]", "statements are"),
    ("'a comment'", "statements are"),
    ("a = b = 1.0", "statements are"),
    ("a, b = 1.0, 2.0", "statements are"),
    ("a: float = 1.0", "statements are"),
    ("del w[0]", "statements are"),
    ("import math", "statements are"),
    ("from math import sin", "statements are"),
    ("global N", "statements are"),
    ("assert n > 0", "statements are"),
    ("raise ValueError", "statements are"),
    ("def g(x: float) -> float:\n        return x", "statements are"),
    ("class A:\n        pass", "statements are"),
    ("try:\n        pass\n    except ValueError:\n        pass", "statements are"),
    ("with w:\n        pass", "statements are"),
    ("while n > 0:\n        n -= 1\n    else:\n        pass", "statements are"),
    ("for i in range(3):\n        pass\n    else:\n        pass", "statements are"),
    ("for x in w:\n        pass", "statements are"),
    ("for w[0] in range(3):\n        pass", "statements are"),
    ("for i in range(0, 3, n):\n        pass", "one or two ints"),
    ("for i in range():\n        pass", "one or two ints"),
    ("for i in range(3.0):\n        pass", "of ints"),
    ("for i in range(3):\n        i += 1", "neither a parameter nor assigned in it"),
    ("for n in range(3):\n        pass", "neither a parameter nor assigned in it"),
    ("for i in range(3):\n        for i in range(2):\n            pass", "neither a parameter nor assigned in it"),
    ("for i in range(3):\n        pass\n    w[i] = 1.0", "used in such loops only"),
    ("while w[0]:\n        pass", "a condition is"),
    ("if x > 1.0:\n        x = 1.0", "given above in the text; 'x' is none"),
    ("x += 1.0", "given above in the text"),
    ("x = 1\n    x = 1.5", "x has one type, here int; this is of type float"),
    ("x = 1\n    x /= 2", "x has one type"),
    ("x = 1.0\n    x = w[0] < 1.0", "x has one type"),
    ("x = w[0] < 1.0\n    x = 1", "x has one type"),
    ("w = 1.0", "w has one type, here array"),
    ("x = w", "given above in the text"),
    ("w[0] = w[1] < 2.0", "one type, here float"),
    ("w[0:3] = 1.0", "numbers, names"),
    ("w[1.0] = 1.0", "an index is an int"),
    ("w[-1] = 1.0", "not negative"),
    ("x = w[N - 5]", "not negative"),
    ("x = TABLE[3]", "below 3"),
    ("x = w[0][1]", "name\\[index\\]"),
    ("TABLE[0] = 1.0", "an element of an array; 'TABLE'"),
    ("x = N[0]", "an array or a table; 'N'"),
    ("x = TABLE", "given above in the text"),
    ("x = N\n    N = 3", "N does not fit"),
    ("x = zeros(3)", "a function that is defined above"),
    ("x = 2147483648", "at most 2147483647"),
    ("x = 1e999", "a float is finite"),
    ("floor = 1.0", "floor does not fit"),
    ("größe = 1.0", "größe does not fit"),
    ("register = 1.0", "register does not fit"),
    ("__x = 1.0", "__x does not fit"),
    ("stop_1 = 1.0", "stop_1 does not fit"),
    ("p_f = 1.0", "p_f does not fit"),
    ("x = writes(w) + w[0]", "without other array accesses"),
    ("x = writes(w) + writes(w)", "without other array accesses"),
    ("w[0] += writes(w)", "without other array accesses"),
    ("while writes(w) > w[0]:\n        pass", "without other array accesses"),
    ("return 1.0", "f returns nothing"),
    ("x = " + " + ".join(["w[0]"] * 1500), "not as deep|subset of Python"),  # who finds it depends on Python's version
]
MODULE = '''N = 3
TABLE = (1.0, 2.0, 3.0)

def helper(x: float) -> float:
    return x

def writes(w: Array) -> float:
    w[0] = 1.0
    return 2.0

def fills(w: Array) -> None:
    writes(w)

def f(w: Array, n: int) -> None:
    """The function under test."""
    {}

def later(x: float) -> float:
    return x
'''


@each_row(("statement", "message"), INSIDE)
def test_a_function_outside_the_language_is_refused_with_its_line(statement: str, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=rf"(?s)line \d+: .*{message}"):
        to_c(MODULE.format(statement), prefix="p_", exported=["f"])


@each_row(
    ("text", "message"),
    [
        ("import math", "constants .* and functions only"),
        ("def f() -> None:\n    pass\nf()", "constants .* and functions only"),
        ("'''Doc.'''\n'''Another.'''", "constants .* and functions only"),
        ("N = 1 + 2", "written out"),
        ("N = True", "written out"),
        ("N = 'text'", "written out"),
        ("N = (1, 2.0)", "of floats or a tuple of ints"),
        ("N = ()", "of floats or a tuple of ints"),
        ("N = 1\nN = 2", "each name once"),
        ("sqrt = 1", "each name once"),
        ("N = -2147483648", "at most"),
        ("def f(x) -> None:\n    pass", "annotated Array"),
        ("def f(x: str) -> None:\n    pass", "annotated Array"),
        ("def f(x: bool) -> None:\n    pass", "annotated Array"),
        ("def f(sqrt: int) -> None:\n    pass", "sqrt does not fit"),
        ("def f(x: float):\n    pass", "-> None, int"),
        ("def f(x: float) -> Array:\n    pass", "-> None, int"),
        ("def f(x: float = 1.0) -> None:\n    pass", "without defaults"),
        ("def f(*x: float) -> None:\n    pass", "without defaults"),
        ("@property\ndef f() -> None:\n    pass", "no decorators"),
        ("async def f() -> None:\n    pass", "constants .* and functions only"),
        ("def f() -> int:\n    pass", "returns a value on every way"),
        ("def f() -> int:\n    return", r"returns a value \(int\)"),
        ("def f() -> int:\n    return 1.0", "here int; this is of type float"),
        ("def f(n: int) -> int:\n    if n > 1:\n        return 1", "on every way"),
        ("def f(:", "subset of Python"),
        ("f = \0", "subset of Python"),
    ],
)
def test_a_module_outside_the_language_is_refused(text: Any, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        to_c(text, prefix="p_", exported=["f"])
