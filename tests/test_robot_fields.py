"""Fields with facts: a robot accepts what is within their bounds, and refuses the rest by name."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import softrobots as sr
from softrobots.robots.fields import Facts, PerPart, XacroRobot, check_parameters, facts_of, parameter, per_part
from tests.support.laws import law

numbers = st.floats(-1e6, 1e6)


def rod(**bounds: float) -> Any:
    """A robot class with a bounded field."""

    @dataclass(frozen=True, kw_only=True)
    class Rod(XacroRobot):
        lengths: PerPart = per_part((1.0, 2.0), "m", "Lengths of the pieces", above=0.0)
        offset: PerPart = per_part(0.0, "m", "Offset of a piece", "a book, page 3", **bounds)
        knots: int = parameter(3, "", "Knots", at_least=1, at_most=5)
        soft: bool = parameter(False, "", "Whether it is soft", in_xacro=False)
        kind: str = parameter("a", "", "Kind", options=("a", "b"))

        def __post_init__(self) -> None:
            assert check_parameters(self, "pieces", "lengths") == len(self.lengths)

    return Rod


@law(
    *(f"robots.fields.{name}" for name in ("parameter", "per_part", "check_parameters", "Facts")),
    "robots.fields.XacroRobot",
)
@given(limits=st.tuples(numbers, numbers).map(sorted), strict=st.tuples(st.booleans(), st.booleans()), value=numbers)
def test_values_within_the_bounds_are_accepted(limits: list[float], strict: tuple[bool, bool], value: float) -> None:
    low, high = limits
    bounds = {("above" if strict[0] else "at_least"): low, ("below" if strict[1] else "at_most"): high}
    kind = rod(**bounds)
    assert facts_of(kind)["offset"] == Facts("m", "Offset of a piece", "a book, page 3", form="per_part", **bounds)
    assert facts_of(kind)["offset"].description.endswith(f" {high:g}. A book, page 3.")
    if (low < value if strict[0] else low <= value) and (value < high if strict[1] else value <= high):
        robot = kind(offset=value)
        assert robot.offset == (value, value)
        assert robot == kind(offset=[value, value])
        assert dataclasses.replace(robot) == robot
        expected = {"lengths": "[1.0,2.0]", "offset": f"[{value!r},{value!r}]", "knots": "3", "kind": "a"}
        assert isinstance(robot, XacroRobot)
        assert robot.xacro_arguments() == expected
    else:
        with pytest.raises(sr.ParameterError, match=r"offset must be (above|at least) .* \[m\]"):
            kind(offset=value)


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"lengths": ()}, "lengths"),
        ({"lengths": (1.0, 0.0)}, "lengths"),
        ({"lengths": (1.0,) * 1001}, "lengths"),
        ({"offset": (1.0,)}, "offset"),
        ({"offset": "1"}, "offset"),
        ({"knots": 6}, "knots"),
        ({"knots": 2.0}, "knots"),
        ({"soft": 1}, "soft"),
        ({"kind": "c"}, "kind"),
    ],
)
def test_other_values_are_refused_by_name(values: dict[str, Any], field: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        rod()(**values)
    assert caught.value.field == field
