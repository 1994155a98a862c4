"""Variants of a robot have, digit for digit, the text that xacro writes for them."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.description import recorded_expansions
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.robots.fields import PerPart, XacroRobot, check_parameters, facts_of, parameter, per_part
from softrobots.robots.variants import Variants

HELIX = sr.Route(at=(0.02, 0.09, 0.17), azimuth=(0.0, 1.0, 3.0), distance=(0.004, 0.005, 0.0045))
SMALL: dict[str, Callable[[], XacroRobot]] = {
    "arm": lambda: sr.InflatableArm(stiffness=(200.0, 150.0), wrist=(0.04, 0.12), payload=(0.5, 0.01, 0.0, 0.0)),
    "arm that twists": lambda: sr.InflatableArm(
        link_lengths=(0.6,), link_model="two_hinges", torsion=True, young_modulus=1.5e8, shear_modulus=5e7, damping_time=0.1
    ),
    "plateau": lambda: sr.InflatableArm(link_lengths=(0.6,), young_modulus=1.4e8, shear_modulus=6e7, max_moment=8.0),
    "muscles": lambda: sr.PccArm(elastic_sections=1, kind="elastic", routing="base", muscle_least_tension=1.0),
    "chambers": lambda: sr.PccArm(
        segment_lengths=(0.5,), chain="lumped", hinges=2, torsion=False, kind="pressure", muscle_azimuths=(0.1, 2.0)
    ),
    "mckibben": lambda: sr.PccArm(segment_lengths=(0.5,), elastic_sections=1, kind="mckibben"),
    "tendons": lambda: sr.TendonArm(elastic_sections=1, bending_friction=1e-3, guide_friction=0.1, offset=(0.1, 0.2, 0.3)),
    "single tendons": lambda: sr.TendonArm(
        segment_lengths=(0.1, 0.08), elastic_sections=1, tendon_pretension=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), rest_bend_x=0.1
    ),
    "routes": lambda: sr.TendonArm(elastic_sections=1, routing=[HELIX], bending_stiffness=2e-3),
    "tube": lambda: sr.HelixTube(length=0.3, elastic_sections=5, axial_stiffness=900.0),
    "tube with hinges": lambda: sr.HelixTube(length=0.3, chain="lumped", hinges=3, upright="axis"),
    "real actuator": lambda: sr.HelixTube(length=0.3, actuator="elastic", elastic_sections=5),
}

Field = tuple[str, Any]


def fresh(robot: XacroRobot) -> str:
    """What xacro writes."""
    return expand(xacro_folder() / robot.XACRO, robot.xacro_arguments())


def number_of(robot: Any, field: Field) -> float:
    name, part = field
    value = getattr(robot, name)
    if isinstance(part, tuple):
        return float(getattr(value[part[0]], part[1])[part[2]])
    return float(value if part is None else value[part])


def changed(robot: Any, fields: Sequence[Field], numbers: Sequence[float]) -> Any:
    """The robot with other numbers, as a user would make it."""
    given: dict[str, Any] = {}
    for (name, part), number in zip(fields, numbers, strict=True):
        value = given.get(name, getattr(robot, name))
        if part is None:
            given[name] = number
        elif isinstance(part, int):
            given[name] = [number if place == part else item for place, item in enumerate(value)]
        else:
            routes = [item if isinstance(item, dict) else {key: list(row) for key, row in vars(item).items()} for item in value]
            routes[part[0]][part[1]][part[2]] = number
            given[name] = routes
    return dataclasses.replace(robot, **given)


def numbers_of(robot: XacroRobot) -> list[Field]:
    """All numbers of a robot that may change a little: some have no effect, and are refused."""
    fields: list[Field] = []
    for name in facts_of(robot):
        value = getattr(robot, name)
        items = value if isinstance(value, tuple) else ()
        fields += [(name, None)] if type(value) is float else []
        fields += [(name, place) for place, item in enumerate(items) if type(item) is float]
        for place, item in enumerate(items):
            if isinstance(item, sr.Route):
                fields += [(name, (place, key, row)) for key, numbers in vars(item).items() for row in range(len(numbers))]

    def may_change(field: Field) -> bool:
        try:
            changed(robot, [field], [number_of(robot, field) * 1.001 + 1e-9])
        except sr.ParameterError:
            return False
        return True

    return [field for field in fields if may_change(field)]


def check(robot: XacroRobot, random: np.random.Generator, count: int) -> None:
    """All numbers at once, and some of them."""
    fields = numbers_of(robot)
    variants = Variants(robot, fields)
    present = np.array([number_of(robot, field) for field in fields])
    assert variants.values.tolist() == present.tolist()
    for _ in range(count):
        share = random.choice([0.0, 1e-9, 0.01], len(fields), p=[0.4, 0.1, 0.5])
        values = present + share * np.where(present == 0.0, 0.1, present * random.uniform(-1.0, 1.0, len(fields)))
        other = changed(robot, fields, values.tolist())
        assert variants.robot(values) == other
        assert variants.robot(values).urdf() == fresh(other)


@pytest.mark.study
@pytest.mark.parametrize("name", ["arm", "arm that twists", "chambers", "routes", "real actuator"])
def test_a_variant_has_the_text_that_xacro_writes(name: str) -> None:
    check(SMALL[name](), np.random.default_rng(len(name)), 1)


@pytest.mark.study
@pytest.mark.parametrize("make", [*SMALL.values(), *sr.ROBOTS.values()], ids=[*SMALL, *sr.ROBOTS])
def test_variants_of_all_robots_have_the_text_that_xacro_writes(make: Callable[[], XacroRobot]) -> None:
    check(make(), np.random.default_rng(1), 2)


@pytest.fixture
def expansions(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Grows with each expansion by xacro that a variant makes."""
    made: list[str] = []

    def counted(path: Any, *rest: Any) -> str:
        made.append(Path(path).name)
        return expand(path, *rest)

    monkeypatch.setattr(recorded_expansions, "expand", counted)
    return made


@pytest.mark.study
def test_xacro_runs_again_only_where_a_comparison_comes_out_otherwise(expansions: list[str]) -> None:
    """A link has a shape for collisions if it is longer than 2.5 radii; both kinds are then known."""
    robot = sr.InflatableArm(link_lengths=(0.3,), stiffness=100.0, hinge_offset=0.03)
    variants = Variants(robot, [("link_lengths", 0), ("stiffness", 0)])
    shapes = []
    for length in (0.3, 0.15, 0.31, 0.14, 0.29, 0.16):
        text = variants.robot([length, 1e3 * length]).urdf()
        assert text == fresh(dataclasses.replace(robot, link_lengths=(length,), stiffness=1e3 * length))
        shapes.append(text.count("<collision>"))
    assert shapes == [1, 0] * 3
    assert len(expansions) == 2


def test_a_variant_is_loaded_without_xacro(expansions: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    robot = sr.InflatableArm(link_lengths=(0.3,), stiffness=100.0)
    variants = Variants(robot, [("stiffness", 0)])
    other = variants.robot([120.0])
    monkeypatch.setattr("softrobots.robots.fields.expand", lambda *_: pytest.fail("xacro runs"))
    loaded = sr.load_model(pickle.loads(pickle.dumps(other)))
    assert loaded.stiffness.tolist() == [120.0, 120.0]
    assert len(expansions) == 1
    with pytest.raises(pytest.fail.Exception, match="xacro runs"):
        dataclasses.replace(other, stiffness=121.0).urdf()  # what is made from a variant is a robot of its own


def test_what_a_robot_refuses_is_refused(expansions: list[str]) -> None:
    robot = sr.InflatableArm(link_lengths=(0.3,), stiffness=100.0)
    variants = Variants(robot, [("stiffness", 0), ("hinge_offset", 0)])
    for values, field in (
        ([-1.0, 0.03], "stiffness"),
        ([1.0, 0.4], "hinge_offset"),
        ([1.0], "values"),
        ([1.0, np.nan], "values"),
    ):
        with pytest.raises(sr.ParameterError) as caught:
            variants.robot(values)
        assert caught.value.field == field
    assert not expansions
    for bad in (
        [("mass", 0)],
        [("stiffness", 1)],
        [("stiffness", -1)],
        [("stiffness", None)],
        [("torsion", None)],
        [("payload", 0)],
    ):
        with pytest.raises(sr.ParameterError, match="name numbers of the robot"):
            Variants(robot, bad)
    with pytest.raises(sr.ParameterError, match="each once"):
        Variants(robot, [("stiffness", 0), ("stiffness", 0)])
    light = sr.TendonArm(elastic_sections=1)
    with pytest.raises(sr.DescriptionError, match="too light to cut"):  # only xacro knows
        Variants(light, [("linear_density", 0)]).robot([1e-5]).urdf()


def test_threads_share_variants() -> None:
    robot = sr.InflatableArm(link_lengths=(0.3,), stiffness=100.0)
    variants = Variants(robot, [("stiffness", 0), ("base_mass", None)])
    values = [(100.0 + place, 1.0 + place) for place in range(16)]
    with ThreadPoolExecutor(4) as pool:
        texts = list(pool.map(lambda row: variants.robot(row).urdf(), values))
    template = fresh(changed(robot, [("stiffness", 0), ("base_mass", None)], (4321.125, 8765.0625)))
    assert texts[3] == fresh(changed(robot, [("stiffness", 0), ("base_mass", None)], values[3]))
    assert len(set(texts)) == 16
    assert template.count("4321.125") == texts[3].count('"103.0"') + texts[3].count(">103.0<")


# --- Whatever an expression does with numbers

FOLLOWED = (
    """
a + b;a - 2;2 - a;a * b;3 * a;a / b;1 / b;a // b;7 // b;a % b;9 % b;a ** 2;2 ** a;b ** 0.3;-a;+a;python.abs(a);a < b
1 > a;a == b;a != 1;a <= 1 or b >= 2;not a;int(a);round(a);round(a, 2);floor(a);ceil(b);trunc(a);atan2(a, b)
math.sin(a);sqrt(b);log(b);pow(b, a);min(a, b);max(a, 1);min([a, b, 0]);min(c);fsum(c);python.sum(c);isfinite(a);float(a)
hypot(a, b, 1);float(str(b));python.sorted(c);'%r and %s' % (a, b);dict(k=a)['k'];1 if a in c else 2;c.index(b);a if a else b
a and b;bool(a);copysign(1, a);str([a, b]);[x * a for x in c];'' in c;a == '';len(c) * a;(-b) ** 2.0;xacro.arg('single')
c == [a, b, 1.0];python.any([x > 2 for x in c]);degrees(a);'$(arg single)';min(c, key=python.abs);min(2, 3)
""".replace("\n", ";")
    .strip(";")
    .split(";")
)
"""Expressions in a, b (positive) and c, a list of both and 1: a tape follows them."""

LOOKED_AT = (
    """
'%.3f' % a;'%d' % a;math.frexp(a);python.divmod(a, b);dict([(a, 1), (0, 2)])[a];a.is_integer();b.hex();python.complex(a, b)
math.comb(int(b), 2);(-b) ** 0.5
""".replace("\n", ";")
    .strip(";")
    .split(";")
)
"""Expressions that look at digits."""


def calculator(folder: Path, expressions: Sequence[str]) -> Any:
    """A robot whose description calculates."""
    path = folder / "calculator.urdf.xacro"
    texts = [escape(text) for text in expressions]
    rows = "".join(f'<link name="{i}"><t v="${{{text}}}" w="x${{{text}}}"/></link>' for i, text in enumerate(texts))
    path.write_text(
        '<robot name="calculator" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="single" default="1"/>'
        '<xacro:arg name="pair" default="[1,2]"/><xacro:property name="a" value="${xacro.arg(\'single\')}"/>'
        "<xacro:property name=\"items\" value=\"${xacro.arg('pair').strip('[]').split(',')}\"/>"
        '<xacro:property name="b" value="${fabs(float(items[0]))}"/><xacro:property name="c" value="${[a, b, 1.0]}"/>'
        f"{rows}</robot>",
        encoding="utf-8",
    )

    @dataclass(frozen=True, kw_only=True)
    class Calculator(XacroRobot):
        single: float = parameter(1.5, "-", "A number")
        pair: PerPart = per_part((1.25, 2.0), "-", "Two numbers")
        XACRO = path

        def __post_init__(self) -> None:
            check_parameters(self, "numbers", "pair")

    return Calculator


NUMBERS = st.one_of(st.floats(-9.0, 9.0), st.sampled_from([0.5, 1.0, 2.0, -3.0, 0.0, -0.0, 1e-7, 1e16, 0.1 + 0.2]))


@pytest.mark.study
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    expressions=st.lists(st.sampled_from(FOLLOWED + LOOKED_AT), min_size=1, max_size=12),
    rows=st.lists(st.tuples(NUMBERS, NUMBERS.filter(lambda b: abs(b) > 1e-9)), min_size=2, max_size=3),
)
def test_every_expression_is_followed_or_evaluated_anew(
    tmp_path: Path, expressions: list[str], rows: list[tuple[float, float]]
) -> None:
    robot = calculator(tmp_path, expressions)
    variants = Variants(robot(), [("single", None), ("pair", 0)])
    for single, first in (*rows, rows[0], (rows[0][0] + 1e-12, rows[0][1])):
        assert variants.robot([single, first]).urdf() == fresh(robot(single=single, pair=(first, 2.0)))


def test_expressions_are_followed_without_xacro(tmp_path: Path, expansions: list[str]) -> None:
    robot = calculator(tmp_path, FOLLOWED)
    variants = Variants(robot(), [("single", None), ("pair", 0)])
    for change in (0.0, 1e-3, 1e-12):
        expected = fresh(robot(single=1.5 + change, pair=(1.25 - change, 2.0)))
        assert variants.robot([1.5 + change, 1.25 - change]).urdf() == expected
    assert len(expansions) == 1


def test_arguments_may_be_computed_from_fields(tmp_path: Path, expansions: list[str]) -> None:
    """Python in `xacro_arguments` is followed as expressions are; NumPy is not."""
    robot = calculator(tmp_path, ["a", "b"])

    class Doubled(robot):  # type: ignore[misc]
        def xacro_arguments(self) -> dict[str, str]:
            return {"single": repr(2.0 * self.single), "pair": str(list(self.pair))}

    class Rooted(robot):  # type: ignore[misc]
        def xacro_arguments(self) -> dict[str, str]:
            return {"single": repr(float(np.sqrt(self.single))), "pair": str(list(self.pair))}

    for kind, count in ((Doubled, 1), (Rooted, 1)):
        variants = Variants(kind(), [("single", None)])
        for single in (1.5, 2.5, 3.5):
            assert variants.robot([single]).urdf() == fresh(kind(single=single))
        assert len(expansions) == count


def test_text_that_takes_a_number_apart_is_left_to_xacro(tmp_path: Path) -> None:
    robot = calculator(tmp_path, ["str(a)[:2]", "$(arg single) ** 2"])
    variants = Variants(robot(), [("single", None)])
    for single in (1.5, -2.5):
        assert variants.robot([single]).urdf() == fresh(robot(single=single))
