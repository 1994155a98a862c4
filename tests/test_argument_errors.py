"""What an error says of the argument it refuses: its name, what came, and the unit that this package has for it."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from tests.support.closed_form_calls import CALLS
from tests.support.tables import each_row

UNITS = {
    "m": "length radius wall_thickness position distance hinge_offset probe_distance offset displacement outer_radius "
    "inner_radius diameter outer_arc inner_arc arc arc_length object_radius deflection turn_height squeeze stopper gap spacing "
    "front lengths x y z reach positions tolerance",
    "m/rad": "pitch",
    "rad": "angle bending azimuth azimuths offsets",
    "Pa": "pressure young_modulus shear_modulus",
    "N": "force axial_force",
    "N m": "moment max_moment slack_moment",
    "N m/rad": "stiffness",
    "s": "times",
    "-": "contraction poisson_ratio turns s",
    "": "strains share",
}
"""SI and radians, by the name of the argument; none for rows of several units."""
UNIT_OF = {name: unit for unit, names in UNITS.items() for name in names.split()}
OTHER_UNITS = {(call, "s"): "rad" for call in ("points", "tangents", "normals", "binormals", "frames")}
"""Where a name means something else: the angle about the axis; a share of a length and a rotation at once."""
TOLD_AS = {("HelixShape", "outer_radius"): "inner_radius"}
"""Where the other of two numbers is named that do not fit each other."""


def refused(call: str, name: str, value: Any) -> sr.ParameterError:
    """The error that an argument of a call raises."""
    function, arguments = CALLS[call]
    with pytest.raises(sr.ParameterError) as caught:
        function(**arguments | {name: value})
    return caught.value


def arguments_of(kind: type | tuple[type, ...]) -> list[tuple[str, str]]:
    return [(call, name) for call, (_, given) in CALLS.items() for name, value in given.items() if isinstance(value, kind)]


def unit_of(call: str, name: str) -> str:
    """The unit of an argument in brackets; nothing if it has none."""
    unit = OTHER_UNITS.get((call, name), UNIT_OF[name])
    return f"[{unit}]" if unit else ""


@each_row(("call", "name"), arguments_of((float, list, np.ndarray)))
def test_a_number_that_is_none_is_told_with_its_name_and_unit(call: str, name: str) -> None:
    value = CALLS[call][1][name]
    if name == "arcs":
        return
    bad: Any = math.nan if isinstance(value, float) else np.array(value)
    if isinstance(bad, np.ndarray):
        bad.flat[-1] = math.nan
    error = refused(call, name, bad)
    assert error.field.removeprefix("wish.") == name
    assert error.value is bad
    assert "finite" in error.requirement
    assert unit_of(call, name) in error.requirement


@each_row(("call", "name"), arguments_of(float))
@each_row("factor", [-1.0, 0.0])
def test_a_number_out_of_range_is_told_with_its_name_and_what_came(call: str, name: str, factor: float) -> None:
    """Zero and below zero: taken, or refused with the name of this argument, the number and its unit."""
    function, given = CALLS[call]
    bad = factor * given[name]
    try:
        function(**given | {name: bad})
    except sr.ParameterError as error:
        assert error.field.removeprefix("wish.") == TOLD_AS.get((call, name), name)
        if error.field == name:
            assert np.all(np.asarray(error.value) == bad)
        assert set(re.findall(r"\[[^], ]*\]", error.requirement)) <= {unit_of(call, error.field.removeprefix("wish."))}


@each_row(("call", "name"), arguments_of((sr.constant_curvature.Arc, sr.helix.HelixShape)))
def test_something_else_than_an_arc_or_a_shape_is_told_with_its_name(call: str, name: str) -> None:
    error = refused(call, name, 0.5)
    assert error.field == name
    assert error.value == 0.5
    assert type(CALLS[call][1][name]).__name__ in error.requirement


@each_row(("call", "name"), arguments_of(str))
def test_an_unknown_word_is_told_with_the_words_that_there_are(call: str, name: str) -> None:
    """Each of the words is one that the call takes."""
    function, given = CALLS[call]
    error = refused(call, name, "no such word")
    assert error.field.removeprefix("wish.") == name
    assert error.value == "no such word"
    words = re.findall(r"'([^']*)'", error.requirement)
    assert given[name] in words
    for word in words:
        try:
            function(**given | {name: word})
        except sr.ParameterError as other:  # a word that goes with other arguments
            assert other.field.removeprefix("wish.") != name


def up(value: float) -> float:
    """The next number above."""
    return math.nextafter(value, math.inf)


def down(value: float) -> float:
    """The next number below."""
    return math.nextafter(value, -math.inf)


TUBE = {key: value for key, value in CALLS["young_modulus_from_stiffness"][1].items() if key != "stiffness"}
CAP, WALL = TUBE["pressure"] * math.pi * TUBE["radius"] ** 2, 2.0 * math.pi * TUBE["radius"] * TUBE["wall_thickness"]
BENDING = CAP / WALL * math.pi * TUBE["radius"] ** 3 * TUBE["wall_thickness"]
PRESSURE_ALONE = TUBE["length"] ** 2 / (TUBE["length"] ** 3 / (3.0 * BENDING) + TUBE["length"] / CAP)
"""Stiffness of the tube with a wall of modulus zero, from (1) of [Troise 2021] [N m/rad]."""
QUARTER = 0.5 * math.pi

# Call, argument, what is taken up to the limit, what is refused from there on, and how the limit is told.
LIMITS: list[tuple[str, str, list[Any], list[Any], str]] = [
    ("deflection", "poisson_ratio", [0.5, up(-1.0)], [up(0.5), -1.0, -1.5], "in (-1, 0.5]"),
    ("deflection", "position", [0.0, 0.6, [0.0, 0.6]], [up(0.6), -5e-324, [0.7, 0.1]], "within [0, 0.6] m, the length"),
    ("deflection", "wall_thickness", [0.1 * 0.055], [up(0.1 * 0.055)], "a thin wall, at most a tenth of the radius 0.055 m"),
    (
        "young_modulus_from_stiffness", "stiffness", [1.01 * PRESSURE_ALONE], [0.99 * PRESSURE_ALONE],
        f"above {PRESSURE_ALONE:.6g} N m/rad, the stiffness due to the pressure alone",
    ),
    ("BendingTest", "hinge_offset", [0.0, 0.43], [0.5, 0.6], "below the distance of the probe, 0.5 m"),
    ("BendingTest", "offset", [0.0, down(0.47)], [0.47, 0.6], "below the distance of the probe from the hinge, 0.47 m"),
    ("BendingTest", "angle", [down(QUARTER), -down(QUARTER)], [QUARTER, -QUARTER, 2.0], "within +-pi/2 rad, both excluded"),
    ("Arc", "length", [0.0], [-5e-324, [-1.0, 1.0]], "zero or positive"),
    ("Arc", "bending", [0.0], [-5e-324, [-1.0, 1.0]], "zero or positive"),
    ("backbone", "s", [[0.0, 1.0]], [[up(1.0)], [-5e-324, 0.5]], "within [0, 1], fractions of the length"),
    ("arc_from_strains", "strains", [[1.0, 2.0, 0.0, 0.0]], [[1.0, 2.0, 5e-324, 1.0], [1.0, 2.0, -1.0, 1.0]], "without twist"),
    ("strain_jacobian", "strains", [[1.0, 2.0, 0.0, 0.0]], [[1.0, 2.0, 0.0, -5e-324]], "of zero or positive length [m]"),
    ("muscles_from_arc", "azimuths", [[0.0, 2.0, 4.0, 2e-9]], [[0.0, 2.0, 4.0, 0.5e-9]], "distinct modulo a turn"),
    ("muscles_from_arc", "azimuths", [], [[0.0, 2.0, 4.0, 2.0 * math.pi - 0.5e-9]], "distinct modulo a turn"),
    ("muscles_from_arc", "azimuths", [[0.0, 2.0, 4.0]], [[0.0, 2.0], []], "at least three"),
    ("muscles_from_arc", "azimuths", [[0.0, 3e-3, 6e-3]], [[0.0, 2.8e-3, 5.6e-3]], "spread further around the backbone"),
    (
        "muscles_from_arc", "arc", [sr.constant_curvature.Arc(0.121, 3.0, 0.0)], [sr.constant_curvature.Arc(0.1, 3.0, 0.0)],
        "one whose muscles have positive lengths (the shortest has -0.02 m)",
    ),
    ("inverse", "shape", [], [sr.helix.HelixShape(0.03, -0.01, 1e-30)], "a helix with a pitch above rounding"),
    ("forward", "contraction", [1.0, 1e-30], [up(1.0)], "in (0, 1]: contracted over original length"),
    ("forward", "angle", [0.0, down(QUARTER)], [QUARTER, 2.0], "in [0, pi/2) rad (5 degrees are 0.0873 rad)"),
    ("forward", "angle", [], [-5e-324, [-1.0, 0.1]], "in [0, pi/2) rad; handedness is an argument of its own"),
    ("HelixShape", "pitch", [0.0], [-5e-324], "zero or positive; handedness is an argument of its own"),
    ("HelixShape", "inner_radius", [-0.08], [-0.081, 0.08, 0.09], " the outer radius 0.08 m"),
    ("measure", "inner_arc", [], [0.56, up(0.55)], "at most the outer arc 0.55 m: the actuator is the shorter path"),
]  # fmt: skip


@each_row(("call", "name", "taken", "out", "told"), LIMITS)
def test_a_limit_is_where_it_is_told(call: str, name: str, taken: list[Any], out: list[Any], told: str) -> None:
    """The last number inside is taken; the first one outside is refused, with its name, the number and the limit."""
    function, given = CALLS[call]
    for value in taken:
        function(**given | {name: value})
    for value in out:
        error = refused(call, name, value)
        assert error.field == name
        assert np.array_equal(error.value, value)
        assert told in error.requirement


# Call, argument, of a wrong form, and what is required.
FORMS: list[tuple[str, str, list[Any], str]] = [
    ("deflection", "force", [["1.0"], [None]], "an array of finite numbers [N]"),
    ("fit_characterisation", "angle", [[[0.1, 0.2, 0.3]]], "shape (n,) of finite numbers [rad] (it has shape (1, 3))"),
    ("fit_characterisation", "moment", [[1.0, 2.0]], "shape (12,) of finite numbers [N m] (it has shape (2,))"),
    ("backbone", "s", [0.5, [[0.5]]], "shape (n,) of finite numbers"),
    ("arc_from_strains", "strains", [0.5, [0.1, 0.2, 0.0], [[0.1]] * 4], "of shape (..., 4) (it has shape ("),
    ("muscles_from_arc", "azimuths", [0.5, [[0.0, 2.0, 4.0]]], "shape (n,) of finite numbers [rad]"),
    ("muscles_from_arc", "arc", [0.5, None], "an Arc"),
    ("arc_from_muscles", "lengths", [0.5, [0.5, 0.5], [[0.5]] * 3], "of shape (..., 3), one a muscle (not ("),
    ("muscle_residual", "lengths", [0.5, [0.5, 0.5]], "of shape (..., 3), one a muscle (not ("),
    ("chain_muscle_jacobian", "lengths", [0.5, [0.5, 0.5, 0.5]], "of shape (..., S, N), one row a segment"),
    ("chain_transform", "offsets", [0.5, [0.0], [0.0] * 3], "shape (2,) of finite numbers [rad]"),
    ("chain_transform", "arcs", [[], 0.5, [0.5], sr.constant_curvature.Arc(1.0, 0.0, 0.0)], "an Arc whose last axis is the"),
]  # fmt: skip


@each_row(("call", "name", "others", "told"), FORMS)
def test_a_wrong_form_is_told_with_the_right_one(call: str, name: str, others: list[Any], told: str) -> None:
    for value in others:
        error = refused(call, name, value)
        assert error.field == name
        assert error.value is value
        assert told in error.requirement


def test_the_derivative_of_muscles_tells_what_it_refuses() -> None:
    """It checks by itself what its callers have checked."""
    from softrobots.constant_curvature.muscles import strains_per_muscle

    for name, bad in (("distance", math.nan), ("distance", 0.0), ("azimuths", [0.0, 1.0, math.nan]), ("azimuths", [0.0, 1.0])):
        with pytest.raises(sr.ParameterError) as caught:
            strains_per_muscle(**{"distance": 0.03, "azimuths": [0.0, 2.0, 4.0]} | {name: bad})
        assert caught.value.field == name
        assert f"[{UNIT_OF[name]}]" in caught.value.requirement or bad == [0.0, 1.0]


@each_row("method", ["displacement", "angle", "contact", "moment", "small_angles"])
def test_each_method_of_a_bending_test_tells_what_it_refuses(method: str) -> None:
    test = sr.inflated_beam.BendingTest(probe_distance=0.5, hinge_offset=0.03, offset=0.06)
    names = {"displacement": ["angle"], "contact": ["angle"], "angle": ["displacement"]}.get(method, ["displacement", "force"])
    for name in names:
        with pytest.raises(sr.ParameterError) as caught:
            getattr(test, method)(**{other: [0.1, 0.2] for other in names} | {name: [0.1, math.nan]})
        assert caught.value.field == name
        assert f"[{UNIT_OF[name]}]" in caught.value.requirement
    if len(names) == 2:
        with pytest.raises(sr.ParameterError, match=r"force = \(\(2,\), \(3,\)\): force must be of a shape that broadcasts"):
            getattr(test, method)([0.1, 0.2], [0.1, 0.2, 0.3])


# Call, argument, shape of it, shape of the others that does not go with it.
NO_COMMON_SHAPE = [
    ("wrinkling_moment", "radius", "pressure"),
    ("required_pressure", "radius", "moment"),
    ("required_tabulated_pressure", "radius", "moment"),
    ("moment", "stiffness", "angle"),
    ("moment", "max_moment", "angle"),
    ("deflection", "position", "young_modulus"),
    ("deflection", "force", "radius"),
    ("deflection", "wall_thickness", "pressure"),
    ("stiffness_from_young_modulus", "young_modulus", "poisson_ratio"),
    ("young_modulus_from_stiffness", "stiffness", "length"),
    ("Arc", "azimuth", "length"),
    ("HelixShape", "pitch", "outer_radius"),
    ("forward", "diameter", "contraction"),
    ("forward", "diameter", "angle"),
    ("points", "s", "shape"),
    ("turn_angle", "arc_length", "shape"),
    ("check_self_contact", "turns", "shape"),
    ("contraction_limit", "diameter", "angle"),
    ("muscles_from_arc", "distance", "arc"),
    ("arc_from_muscles", "distance", "lengths"),
    ("muscle_residual", "distance", "lengths"),
]


@each_row(("call", "name", "other"), NO_COMMON_SHAPE)
def test_shapes_that_do_not_broadcast_are_told(call: str, name: str, other: str) -> None:
    function, given = CALLS[call]
    three = given[other]
    if other == "shape":
        three = sr.helix.forward([0.6] * 3, 0.1, 0.03)
    else:
        three = sr.constant_curvature.Arc([0.5] * 3, 0.1, 0.2) if other == "arc" else [three] * 3
    with pytest.raises(sr.ParameterError, match=r"\(3,\)") as caught:
        function(**given | {name: [given[name]] * 2, other: three})
    assert caught.value.field == name
    assert "broadcasts" in caught.value.requirement


@each_row(
    ("call", "name", "values", "told"),
    [
        ("wrinkling_moment", "pressure", [[1e4, 2e4], [3e4, -4e4]], "zero or positive [Pa] (entry (1, 1) is -40000)"),
        ("required_tabulated_pressure", "moment", [1.0, math.inf], "of finite numbers [N m] (entry 1 is inf)"),
        ("deflection", "position", [0.1, 0.2, 0.7], "within [0, 0.6] m, the length of the beam (entry 2 is 0.7)"),
        ("stiffness_from_young_modulus", "wall_thickness", [5e-4, 6e-3], "tenth of the radius 0.055 m (entry 1 is 0.006)"),
        ("stiffness_from_young_modulus", "radius", [0.055, 1e-3], "tenth of the radius 0.001 m (entry 1 is 0.0005)"),
        ("young_modulus_from_stiffness", "poisson_ratio", [0.3, 0.6], "in (-1, 0.5] (entry 1 is 0.6)"),
        (
            "young_modulus_from_stiffness",
            "stiffness",
            [170.0, 1e-3],
            "the stiffness due to the pressure alone (entry 1 is 0.001)",
        ),
        ("moment", "max_moment", [[20.0], [0.0]], "positive [N m] (entry (1, 0) is 0)"),
        ("BendingTest", "angle", [0.1, 2.0], "within +-pi/2 rad, both excluded (entry 1 is 2)"),
    ],
)
def test_a_bad_entry_of_an_array_is_told_with_its_place(call: str, name: str, values: Any, told: str) -> None:
    function, given = CALLS[call]
    with pytest.raises(sr.ParameterError) as caught:
        function(**given | {name: values})
    assert told in str(caught.value)


# Call, argument, the value that the documentation names as its default.
DEFAULTS = [
    ("deflection", "poisson_ratio", 0.3),
    ("stiffness_from_young_modulus", "poisson_ratio", 0.3),
    ("young_modulus_from_stiffness", "poisson_ratio", 0.3),
    ("transform", "frame", "torsion_free"),
    ("chain_transform", "frame", "torsion_free"),
    ("chain_transforms", "frame", "torsion_free"),
    ("chain_transforms", "offsets", [0.0, math.pi / 3.0]),
    ("chain_transform", "offsets", [0.0, math.pi / 3.0]),
    ("chain_arc_jacobian", "offsets", [0.0, math.pi / 3.0]),
    ("arc_jacobian", "frame", "torsion_free"),
    ("chain_arc_jacobian", "frame", "torsion_free"),
    ("muscle_jacobian", "frame", "torsion_free"),
    ("chain_muscle_jacobian", "frame", "torsion_free"),
    ("muscles_from_arc", "azimuths", [0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0]),
    ("measure", "turns", 1.0),
    ("points", "path", "centre"),
    ("points", "handedness", "right"),
    ("tangents", "path", "centre"),
    ("tangents", "handedness", "right"),
    ("normals", "path", "centre"),
    ("normals", "handedness", "right"),
    ("binormals", "path", "centre"),
    ("binormals", "handedness", "right"),
    ("frames", "path", "centre"),
    ("frames", "handedness", "right"),
    ("transform_base_to_axis", "handedness", "right"),
    ("turn_angle", "path", "centre"),
    ("curvature_torsion", "path", "centre"),
    ("curvature_torsion", "handedness", "right"),
    ("actuator_curvature_torsion", "path", "centre"),
    ("actuator_curvature_torsion", "handedness", "right"),
]


@each_row(("call", "name", "value"), DEFAULTS)
def test_the_default_is_the_one_that_is_documented(call: str, name: str, value: Any) -> None:
    function, given = CALLS[call]
    without = {key: other for key, other in given.items() if key != name}
    for left_out, said in zip(
        np.atleast_1d(function(**without)), np.atleast_1d(function(**given | {name: value})), strict=True
    ):
        assert repr(left_out) == repr(said)
