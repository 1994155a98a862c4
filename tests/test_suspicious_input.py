"""Numbers in another unit: what looks like degrees or centimetres is asked about once, what no muscle can be is refused."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.cli.main import main
from softrobots.constant_curvature import arc_from_muscles
from tests.support import law_robots
from tests.support.foreign import BRANCHED, SPRINGS
from tests.support.laws import law
from tests.support.tables import each_row

ARM = law_robots.model("arm")
MUSCLES = sr.load_model(sr.PccArm(elastic_sections=1))
TENDONS = law_robots.model("tendons")


def asked(call: Callable[[], Any]) -> list[str]:
    """Each question of a call, all of which are about the line of this file that asked for it."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        call()
    found = [one for one in told if issubclass(one.category, sr.SuspiciousInputWarning | sr.AssumedStiffnessWarning)]
    assert all(one.filename == __file__ for one in found)
    return [str(one.message) for one in found]


@law("SuspiciousInputWarning")
@settings(max_examples=40)
@given(st.lists(st.floats(-math.pi, math.pi), min_size=3, max_size=3))
def test_what_is_within_the_limits_is_not_asked_and_the_same_in_degrees_is(angles: list[float]) -> None:
    """A motor of half a turn each way is asked about beyond 2.5 times that, in one warning."""
    assert asked(lambda: ARM.checked_motors(angles)) == []
    degrees = np.degrees(angles)
    told = asked(lambda: ARM.checked_motors(degrees))
    beyond = np.flatnonzero(np.abs(degrees) > 2.5 * math.pi).tolist()
    assert len(told) == min(len(beyond), 1)
    if beyond:
        assert told[0].startswith(f"motor_{beyond[0] + 1} = {degrees[beyond[0]]:.6g} rad is")
        with pytest.warns(sr.SuspiciousInputWarning, match="looks like degrees"):
            ARM.checked_motors(degrees)


FAR_OUT = sr.Route(at=(0, 0.06), azimuth=0, distance=4.5)

CASES: list[tuple[Callable[[], Any], str]] = [
    (lambda: sr.solve_equilibrium(ARM, (17, 34, -46)), "motor_1 = 17 rad is 974 degrees; it looks like degrees (did you mean "),
    (lambda: sr.solve_equilibrium(ARM, dict.fromkeys(ARM.actuator_names, 40)), "radians(40) = 0.6981"),
    (lambda: sr.InflatableArm(link_lengths=(60, 60)), "link_lengths = 60 m is 100 times the usual 0.6 m"),
    (lambda: sr.InflatableArm(radius=55), "looks like millimetres (did you mean 0.055 m?)"),
    (lambda: sr.InflatableArm(motor_limit=180), "motor_limit = 180 rad is"),
    (
        lambda: sr.InflatableArm(stiffness=172.71, pressure=50),
        "pressure = 50 Pa is next to nothing; it looks like kPa, bar or MPa",
    ),
    (lambda: sr.InflatableArm(young_modulus=138), "young_modulus = 138 Pa is next to nothing"),
    (lambda: sr.TendonArm(tendon_distance=(4.5, 4.5, 4.5), radius=0.006), "tendon_distance = 4.5 m is 1e+03 times the usual"),
    (
        lambda: sr.TendonArm(tendon_azimuths=(0, 120, 240)),
        "tendon_azimuths = 240 rad is 1.375e+04 degrees; it looks like degrees",
    ),
    (lambda: sr.TendonArm(offset=60), "offset = 60 rad is 3438 degrees"),
    (lambda: sr.Route(at=(0, 0.06), azimuth=(0, 270), distance=0.0045), "azimuth = 270 rad is 1.547e+04 degrees"),
    (lambda: sr.TendonArm(kind="tension", routing=[FAR_OUT]), "distance of a route = 4.5 m is 1e+03 times the usual 0.0045 m"),
    (lambda: arc_from_muscles([50, 53, 55], 0.04), "72.65 rad, 11.6 turns: are lengths and distance in m?"),
]


@each_row(("call", "text"), CASES)
def test_another_unit_is_asked_about_once(call: Callable[[], Any], text: str) -> None:
    told = asked(call)
    assert len(told) == 1
    assert text in told[0]


ROWS = np.array([(0.1, 0.2, 0.3), (np.nan, 0.2, 0.3), (0.1, 0.2, -46.0), (0.1, 40.0, 0.3)])
COMPILED = sr.compile(ARM, backend="python")


@each_row(
    "call",
    [
        lambda: COMPILED.equilibria(ROWS, (0, 0, 0)),
        lambda: COMPILED.equilibria([dict(zip(ARM.actuator_names, row, strict=True)) for row in ROWS.tolist()], (0, 0, 0)),
        lambda: sr.simulate(ARM, 0.001, lambda time: np.array([0.0, 40e3 * time, 0.0]), time_step=0.0005),
        lambda: sr.follow_contact(ARM, np.linspace((0.1, 7.0, 0.0), (0.1, 8.0, 0.0), 3), environment=sr.Environment([])),
    ],
)
def test_many_cases_are_asked_about_once_and_as_a_whole(call: Callable[[], Any]) -> None:
    """The first row is in rad; of the others one angle is named, and one without a number (NaN) hides none."""
    (told,) = asked(call)
    assert told.startswith("motor_2 = ")
    assert "looks like degrees" in told


@each_row(
    "call",
    [
        lambda: COMPILED.equilibria(ROWS[:1], (0, 0, 0)),
        lambda: COMPILED.equilibria(np.zeros((0, 3)), (0, 0, 0)),
        lambda: sr.solve_equilibrium(ARM, (3.5, -4.0, 6.0)),  # beyond its limits, as a result says
        lambda: sr.load_model(BRANCHED, springs=SPRINGS, tip="finger").checked_motors(
            [100.5, 0.3, 0.0]
        ),  # turns without limits
        lambda: sr.InflatableArm(link_lengths=(5.0,), hinge_offset=0.1, radius=0.5, wall_thickness=0.001, stiffness=1e4),
        lambda: MUSCLES.checked_motors([1.2] * 6),
        lambda: sr.Route(at=(0, 0.06), azimuth=(0.0, 12.0 * math.pi), distance=0.0045),  # six times around
        lambda: arc_from_muscles([0.3, 0.5, 0.5], 0.04),
    ],
)
def test_what_is_only_unusual_is_not_asked(call: Callable[[], Any]) -> None:
    assert asked(call) == []


def test_a_joint_without_limits_is_asked_about_whole_numbers() -> None:
    """Degrees are typed as whole numbers; a wheel that has turned by 90.3 rad is no mistake."""
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    place = int(np.flatnonzero(np.isinf(model.motor_limits[:, 0]))[0])
    turned = np.zeros(model.n_motors)
    turned[place] = 90.0
    assert len(asked(lambda: model.checked_motors(turned))) == 1
    turned[place] = 90.3
    assert asked(lambda: model.checked_motors(turned)) == []


@each_row(("model", "usual"), [(MUSCLES, 0.524), (TENDONS, 0.06)])
@each_row(("scale", "unit"), [(100.0, "centimetres"), (1000.0, "millimetres")])
def test_lengths_that_no_muscle_has_are_refused(model: sr.SoftModel, usual: float, scale: float, unit: str) -> None:
    lengths = scale * model.relaxed_motors
    with pytest.raises(sr.ParameterError) as caught:
        sr.solve_equilibrium(model, lengths)
    length = f"{model.actuator_names[0]} = {scale * usual:.6g} m"
    assert f"{length} is {scale:.3g} times the usual {usual:g} m; it looks like {unit}" in str(caught.value)


@pytest.mark.filterwarnings("default")
def test_the_command_asks_in_one_line_and_refuses_centimetres(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "inflatable_arm", "--motors", "17", "34", "-46"]) == 0
    told = capsys.readouterr().err.splitlines()
    assert [line.partition(";")[0] for line in told] == ["warning: motor_1 = 17 rad is 974 degrees"]
    assert main(["pcc", "forward", "50", "53", "55", "54", "51", "52"]) == 2
    assert "L1 = 50 m is 95.4 times the usual 0.524 m; it looks like centimetres" in capsys.readouterr().err
    assert main(["pcc", "forward", "50", "53", "55", "54", "51", "52", "--rest", "52", "--distance", "4"]) == 0


@pytest.mark.study
@each_row(
    ("call", "text"),
    [
        (lambda: sr.load_model(sr.InflatableArm), "a robot, not its class: InflatableArm(), with parentheses"),
        (lambda: sr.solve_equilibrium(ARM, (0, 0, 0), gravity=9.81), "EARTH_GRAVITY is (0, 0, -9.81)"),
        (
            lambda: sr.solve_equilibrium(ARM, {"motor_1": 0.1, "motor_2": 0.2, "motor_3": "a"}),
            "q_motors['motor_3'] = 'a': q_motors['motor_3'] must be a number: motor_3 [rad] (-3.142 to 3.142)",
        ),
        (lambda: sr.follow_trajectory(ARM, sr.straight_line((0.9, -0.3, 0.2), (0.9, 0.3, 0.2), 2.0, 20)), "its .targets"),
        (lambda: sr.identify(sr.InflatableArm(), [1, 2], ("stiffness",)), "Measurements.from_csv"),
        (lambda: sr.solve_ik(ARM, (90, 30, 20)), "; its reach is 1.2 m"),
        (lambda: sr.plot(sr.linearize(ARM, sr.solve_equilibrium(ARM, (0, 0, 0)))), "softrobots.view.figures draws others"),
        (
            lambda: sr.InflatableArm(lengths=(0.6,)),
            "'lengths' (did you mean 'link_lengths'?); available:\n  link_lengths [m], ",
        ),
        (lambda: sr.PccArm(payload=0.5), "a load on the tip of any robot: force= or wrench= of the solvers, or a body by"),
        (lambda: sr.load_model(BRANCHED), "--spring JOINT=STIFFNESS"),
    ],
)
def test_errors_tell_the_cure_of_common_mistakes(call: Callable[[], Any], text: str) -> None:
    with pytest.raises(sr.SoftRobotsError) as caught:
        call()
    assert text in str(caught.value)


def test_gap_and_path_tell_what_they_hold_without_arrays() -> None:
    gap = sr.solve_equilibrium(ARM, (0, 0, 0)).clearance(sr.Environment([sr.Sphere(0.1, (0.9, 0.0, 0.5))]))
    path = sr.straight_line((0.9, -0.3, 0.2), (0.9, 0.3, 0.2), 2.0, 20)
    for told in (gap, path):
        assert "array" not in str(told) + repr(told)
        assert "<table" in told._repr_html_()
    assert "link_2" in gap.summary()
    assert "sphere_1" in gap.summary()
