"""A wall that goes slack: the law against fibres that carry tension only, its way through the description, and its statics."""

from __future__ import annotations

import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

import softrobots as sr
from softrobots import inflated_beam
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.model.springs import SpringGroup, Springs
from tests.support.laws import law
from tests.support.membrane import hinge_moment, section_moment
from tests.support.tables import each_row

K, RADIUS, PRESSURE = 172.71, 0.055, 50e3
SLACK = 0.5 * math.pi * PRESSURE * RADIUS**3
LEVER = 0.57


@pytest.fixture(scope="module")
def one_link() -> sr.SoftModel:
    """One link of the paper that goes slack."""
    return sr.load_model(sr.InflatableArm(link_lengths=(0.6,), moment_law="slack_wall"))


@pytest.fixture(scope="module")
def two_links() -> sr.SoftModel:
    """Two links that go slack, of different pressure, bent at rest."""
    return sr.load_model(sr.InflatableArm(moment_law="slack_wall", pressure=(50e3, 30e3), rest_up=(0.05, -0.1), rest_side=0.02))


# the law


def test_the_limits_are_those_of_the_theory() -> None:
    """At 50 kPa and 55 mm: 13.07, 20.53 and 26.13 N m; 114 N of push is 24 % of the cap force, and takes as much from each."""
    found = inflated_beam.moment_limits(PRESSURE, RADIUS)
    assert [round(float(moment), 2) for moment in found] == [13.07, 20.53, 26.13]
    assert found.wrinkling == pytest.approx(inflated_beam.wrinkling_moment(PRESSURE, RADIUS), rel=1e-15)
    pushed = inflated_beam.moment_limits(PRESSURE, RADIUS, -114.0)
    assert float(pushed.slack / found.slack) == pytest.approx(0.76, abs=0.001)
    assert inflated_beam.moment_limits(PRESSURE, RADIUS, -500.0) == (0.0, 0.0, 0.0)


@each_row("axial", [0.0, -200.0, 300.0])
@each_row("ratio", [0.3, 1.0001, 1.05, 1.5, 3.0, 10.0, 60.0])
def test_the_moment_is_that_of_fibres_that_carry_tension_only(ratio: float, axial: float) -> None:
    """Quadrature around the circumference is good to 1e-11 of the moment, where the slack fibres cut it off."""
    limits = inflated_beam.moment_limits(PRESSURE, RADIUS, axial)
    curvature = ratio * float(limits.slack) / 40.0
    expected = section_moment(curvature, 40.0, RADIUS, PRESSURE * math.pi * RADIUS**2 + axial)
    found = inflated_beam.slack_wall_moment(curvature, stiffness=40.0, slack_moment=limits.slack)
    assert float(found.moment) == pytest.approx(expected, rel=1e-10)


def test_half_the_circumference_is_slack_at_the_wrinkling_moment() -> None:
    """`D` is 1 there: the angle is pi times that of the first slack fibre."""
    found = inflated_beam.slack_wall_moment(math.pi * SLACK / K, stiffness=K, slack_moment=SLACK)
    assert float(found.moment) == pytest.approx(inflated_beam.wrinkling_moment(PRESSURE, RADIUS), rel=1e-14)
    assert float(found.slack_half_angle) == pytest.approx(0.5 * math.pi, rel=1e-14)


def exact(ratio: float) -> tuple[float, float, float]:
    """Moment and tangent over those of the first slack fibre by 60 digits, and half the slack angle."""
    with mp.workdps(60):
        d = mp.pi / mp.mpf(ratio)
        low, high = mp.mpf(0), mp.pi  # half the taut angle; bisection, since the slope vanishes at both ends
        for _ in range(190):
            middle = (low + high) / 2
            low, high = (middle, high) if mp.sin(middle) - middle * mp.cos(middle) < d else (low, middle)
        tangent = (low + mp.sin(low) * mp.cos(low) - 2 * mp.sin(low) ** 2 / low) / mp.pi
        return float((low - mp.sin(low) * mp.cos(low)) / d), float(tangent), float(mp.pi - low)


@each_row("excess", [1e-12, 1e-9, 1e-6, 1e-4, 0.01, 0.3, 1.0, 2.14, 5.0, 30.0, 1e3, 1e6, 1e9, 1e14])
def test_rounding_is_all_that_is_wrong(excess: float) -> None:
    """From the first slack fibre to collapse; near the first the slack angle is a root of the excess, itself rounded."""
    ratio = 1.0 + excess
    moment, tangent, slack = exact(ratio)
    found = inflated_beam.slack_wall_moment(ratio, stiffness=1.0, slack_moment=1.0)
    near = 1e-15 / math.sqrt(excess)
    assert float(found.moment) == pytest.approx(moment, rel=2e-15)
    assert float(found.tangent) == pytest.approx(tangent, rel=5e-15 + 3.0 * near)
    assert float(found.slack_half_angle) == pytest.approx(slack, rel=0.0, abs=5e-15 + 3.0 * near)


@law("inflated_beam.slack_wall_moment", "inflated_beam.SlackWallMoment")
@given(st.floats(-3.0, 3.0), st.floats(0.3, 3.0), st.floats(0.3, 3.0), st.floats(0.1, 10.0))
@settings(max_examples=60)
def test_tangent_and_moment_are_slopes_of_moment_and_energy(angle: float, stiffness: float, slack: float, size: float) -> None:
    """Odd, even, below collapse, and of one shape: `M_1` scales moments and angles alike.

    Differences over 1e-4: the tangent falls as a root beyond the first slack fibre, so that there they are good to 1e-2 only.
    """
    at = inflated_beam.slack_wall_moment([angle - 1e-4, angle, angle + 1e-4], stiffness=stiffness, slack_moment=slack)
    assert isinstance(at, inflated_beam.SlackWallMoment)
    assert at.moment[1] == pytest.approx((at.energy[2] - at.energy[0]) / 2e-4, abs=1e-6)
    assert at.tangent[1] == pytest.approx((at.moment[2] - at.moment[0]) / 2e-4, abs=2e-2)
    assert 0.0 < at.tangent[1] <= stiffness
    assert abs(at.moment[1]) <= min(stiffness * abs(angle), 2.0 * slack) + 1e-12
    other = inflated_beam.slack_wall_moment(-angle * size, stiffness=stiffness, slack_moment=slack * size)
    assert other.moment == pytest.approx(-size * at.moment[1], rel=1e-12)
    assert other.tangent == pytest.approx(at.tangent[1], rel=1e-6)
    assert other.energy == pytest.approx(size**2 * at.energy[1], rel=1e-12)


@law("inflated_beam.MomentLimits", "inflated_beam.moment_limits", "inflated_beam.slack_wall_moment")
@given(st.floats(0.0, 1e6), st.floats(1e-3, 1.0), st.floats(-1e4, 1e4))
@settings(max_examples=30)
def test_limits_are_in_order_and_arrays_are_taken_element_by_element(pressure: float, radius: float, force: float) -> None:
    """Shares 1/2, pi/4 and 1 of the tension of the wall times the radius."""
    found = inflated_beam.moment_limits([[pressure], [0.0]], radius, [force, 0.0, -force])
    assert isinstance(found, inflated_beam.MomentLimits)
    tension = np.maximum(np.array([[pressure], [0.0]]) * np.pi * radius**2 + [force, 0.0, -force], 0.0)
    tension *= np.array([[pressure], [0.0]]) > 0.0  # without pressure nothing keeps the tube round
    for moments, share in zip(found, (0.5, np.pi / 4.0, 1.0), strict=True):
        assert moments == pytest.approx(share * tension * radius, rel=1e-14, abs=0.0)
    firsts = np.array([[1.0], [1e-3]])
    several = inflated_beam.slack_wall_moment([0.1, -0.2, 3.0], stiffness=K, slack_moment=firsts)
    for row, column in np.ndindex(2, 3):
        alone = inflated_beam.slack_wall_moment([0.1, -0.2, 3.0][column], stiffness=K, slack_moment=firsts[row, 0])
        assert [part[row, column] for part in several] == pytest.approx(list(alone), rel=1e-14)


def test_the_tangent_is_continuous_and_falls_as_a_root() -> None:
    """To first order by `(2/pi) sqrt(2 x)` of itself, `x` the share of the angle beyond the first slack fibre."""
    beyond = np.array([1e-8, 1e-6, 1e-4])
    found = inflated_beam.slack_wall_moment(1.0 + beyond, stiffness=1.0, slack_moment=1.0)
    assert (1.0 - found.tangent) == pytest.approx(2.0 / math.pi * np.sqrt(2.0 * beyond), rel=0.02)


@each_row("angle", [1e3, 1e15, 1e30])
@each_row("slack", [1e-30, 1e-12, 1.0, 1e12])
def test_nothing_is_not_a_number_near_collapse(angle: float, slack: float) -> None:
    for found in inflated_beam.slack_wall_moment([angle, -angle], stiffness=1e30, slack_moment=slack):
        assert np.isfinite(found).all()


@each_row(
    ("arguments", "field"),
    [
        ({"angle": math.nan}, "angle"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"slack_moment": 0.0}, "slack_moment"),
        ({"slack_moment": [1.0, 2.0, 3.0], "angle": [0.1, 0.2]}, "slack_moment"),
    ],
)
def test_arguments_that_are_none_are_refused(arguments: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        inflated_beam.slack_wall_moment(**{"angle": 0.1, "stiffness": K, "slack_moment": SLACK} | arguments)
    assert caught.value.field == field


# the springs of a link


def slack_springs(rest: tuple[float, ...] = (0.02, -0.05)) -> Springs:
    """Two springs of one link, and one alone."""
    groups = (SpringGroup((0, 1), RADIUS, PRESSURE, slack_wall=True),)
    return Springs(("side", "up", "other"), np.array([K, K, 50.0]), np.array([*rest, 0.1]), np.ones(3, dtype=bool), groups)


@given(st.floats(0.0, 1.5), st.floats(-np.pi, np.pi))
@settings(max_examples=40)
def test_torque_and_tangent_of_a_link_are_derivatives_of_its_energy(bend: float, direction: float) -> None:
    """By central differences of 1e-6; within 1e-4 of the first slack fibre the tangent bends like a root."""
    springs = slack_springs()
    if abs(bend - SLACK / K) < 1e-4:
        return
    y = springs.rest + [bend * np.cos(direction), bend * np.sin(direction), 0.3]
    _, torque, tangent = springs.at(y)
    assert torque[2] == pytest.approx(15.0, rel=1e-14)
    for place, step in enumerate(1e-6 * np.eye(3)):
        (high, up, _), (low, down, _) = springs.at(y + step), springs.at(y - step)
        assert torque[place] == pytest.approx((high - low) / 2e-6, abs=1e-7)
        assert tangent[place] == pytest.approx((up - down) / 2e-6, abs=1e-3)
    assert np.array_equal(tangent, tangent.T)
    assert np.linalg.eigvalsh(tangent)[0] > 0.0
    assert not springs.linear
    assert springs.saturated(y) == frozenset()


@given(st.floats(0.0, 1.5), st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi))
@settings(max_examples=40)
def test_a_link_is_the_same_in_all_directions(bend: float, direction: float, turn: float) -> None:
    """And alone it is the law of the closed form."""
    springs = slack_springs((0.0, 0.0))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    y = bend * np.array([np.cos(direction), np.sin(direction)])
    (energy, torque, tangent), (other, turned, _) = (springs.at(np.append(one, 0.1)) for one in (y, rotation @ y))
    assert other == pytest.approx(energy, rel=1e-12, abs=1e-15)
    assert turned[:2] == pytest.approx(rotation @ torque[:2], abs=1e-12)
    alone = inflated_beam.slack_wall_moment(bend, stiffness=K, slack_moment=SLACK)
    assert np.linalg.norm(torque[:2]) == pytest.approx(float(alone.moment), rel=1e-12, abs=1e-15)
    along = y / bend if bend > 0.0 else np.array([1.0, 0.0])
    if bend > 1e-6 and abs(bend - SLACK / K) > 1e-9:
        assert along @ tangent[:2, :2] @ along == pytest.approx(float(alone.tangent), rel=1e-6)


# the description


def test_the_law_travels_in_the_urdf(two_links: sr.SoftModel, tmp_path: Path) -> None:
    again = sr.load_model(two_links.urdf)
    assert again == two_links
    assert [group.slack_wall for group in again.spring_groups] == [True, True]
    assert again.spring_groups[0].largest_moment == pytest.approx(2.0 * SLACK, rel=1e-14)
    loaded = sr.solve_equilibrium(two_links, (0.1, 0.2, 0.3), (0.0, 20.0, -30.0))
    saved = sr.load_result(sr.save_result(loaded, tmp_path / "slack.npz"))
    assert np.array_equal(saved.spring_torques, loaded.spring_torques)


@each_row(("law_named", "most"), [(None, None), ("linear", None), (None, 20.0), ("plateau", 20.0)])
def test_the_other_laws_are_named_or_follow_from_the_plateau(law_named: str | None, most: float | None) -> None:
    """Their files are those without a name."""
    robot = sr.InflatableArm(moment_law=law_named, max_moment=most)
    assert robot.urdf() == sr.InflatableArm(max_moment=most).urdf()
    (group, _) = sr.load_model(robot).spring_groups
    assert (group.slack_wall, group.largest_moment) == (False, most)


@each_row(
    ("arguments", "field"),
    [
        ({"moment_law": "plateau"}, "moment_law"),
        ({"moment_law": "linear", "max_moment": 20.0}, "moment_law"),
        ({"moment_law": "slack_wall", "max_moment": 20.0}, "moment_law"),
        ({"moment_law": "slack"}, "moment_law"),
        ({"moment_law": "slack_wall", "pressure": (5e4, 0.0)}, "pressure"),
    ],
)
def test_contradictions_are_refused_by_robot_and_xacro(arguments: dict, field: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        sr.InflatableArm(**arguments)
    assert caught.value.field == field
    texts = {name: str(value).strip("()") for name, value in arguments.items()}
    with pytest.raises(sr.DescriptionError, match=field):
        expand(xacro_folder() / sr.InflatableArm.XACRO, texts)


@each_row(
    ("was", "becomes", "said"),
    [
        (
            'moment_law="slack_wall"',
            'moment_law="slack"',
            "moment_law 'slack' and no max_moment; required: one of linear",
        ),
        ('moment_law="slack_wall"', 'moment_law="plateau"', "moment_law 'plateau' and no max_moment"),
        ('moment_law="slack_wall"', 'moment_law="slack_wall" max_moment="20"', "'slack_wall' and max_moment 20.0"),
        ('pressure="50000.0"', 'pressure="0.0"', "'slack_wall' and no pressure; required > 0"),
    ],
)
def test_contradictions_in_a_file_are_refused(one_link: sr.SoftModel, was: str, becomes: str, said: str) -> None:
    with pytest.raises(sr.DescriptionError, match=said):
        sr.load_model(one_link.urdf.replace(was, becomes))


def test_springs_that_differ_cannot_have_one_law(one_link: sr.SoftModel) -> None:
    with pytest.raises(sr.DescriptionError, match=r"has moment_law slack_wall, the same in all directions; .* same stiffness"):
        sr.load_model(one_link.urdf, springs={"spring_1_side": 170.0, "spring_1_up": 180.0})


# statics


@each_row("force", [20.0, 24.0, 40.0, 200.0])
def test_one_link_hangs_as_the_fibres_say(one_link: sr.SoftModel, force: float) -> None:
    """`M(a) = F L cos(a)` with the moment of fibres by quadrature."""
    tension = PRESSURE * math.pi * RADIUS**2
    balance = lambda a: hinge_moment(a, K, RADIUS, tension) - force * LEVER * math.cos(a)  # noqa: E731
    angle = brentq(balance, 0.01, 1.57, xtol=1e-12)
    found = sr.solve_equilibrium(one_link, (0.0, 0.0), (0.0, 0.0, -force))
    assert found.stable
    assert found.q_springs == pytest.approx([0.0, -angle], abs=1e-9)


def test_a_dead_moment_beyond_collapse_has_no_answer_and_the_error_says_so(one_link: sr.SoftModel) -> None:
    held = sr.solve_equilibrium(one_link, (0.0, 0.0), wrench=(0, 0, 0, 0, 25.5, 0))
    assert held.link_moments == pytest.approx([25.5], rel=1e-10)
    with pytest.raises(sr.EquilibriumNotFound, match=r"near the collapse of its slack wall, 26\.13"):
        sr.solve_equilibrium(one_link, (0.0, 0.0), wrench=(0, 0, 0, 0, 26.5, 0))


def test_a_probe_pushes_it_as_the_fibres_say(one_link: sr.SoftModel) -> None:
    """The tip goes down by `L sin(a)`, and the reaction `M(a) / (L cos(a))` with the moment of fibres."""
    pushed = sr.solve_imposed_displacement(one_link, (0.0, 0.0), 0.4, direction=(0.0, 0.0, -1.0))
    angle = math.asin(0.4 / LEVER)
    moment = hinge_moment(angle, K, RADIUS, PRESSURE * math.pi * RADIUS**2)
    assert pushed.equilibrium.link_moments == pytest.approx([moment], rel=1e-9)
    assert pushed.reaction == pytest.approx(moment / (LEVER * math.cos(angle)), rel=1e-9)
    assert pushed.stable


def test_buckling_is_that_of_the_taut_arm(two_links: sr.SoftModel) -> None:
    """Straight links are taut; a link that is bent by a load across buckles earlier than a linear one."""
    straight = (sr.load_model(sr.InflatableArm(moment_law=name)) for name in (None, "slack_wall"))
    taut, slack = (sr.critical_load(model, (0, 0, 0), (-1, 0, 0)) for model in straight)
    assert slack == pytest.approx(taut, rel=1e-12)


@pytest.mark.study
@each_row("rest", [0.02, 0.05, 0.1])
def test_a_bent_link_gives_way_where_its_wall_has_softened(rest: float) -> None:
    """`F = M(a - rest) / (L sin a)` has a largest value, by quadrature; a linear link has none and never buckles."""
    tension = PRESSURE * math.pi * RADIUS**2
    moment = lambda a: hinge_moment(a - rest, K, RADIUS, tension)  # noqa: E731
    force = minimize_scalar(lambda a: -moment(a) / (LEVER * math.sin(a)), (rest + 0.03, rest + 0.09, rest + 0.3), tol=1e-9)
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), rest_up=rest, moment_law="slack_wall"))
    assert sr.critical_load(model, (0.0, 0.0), (-1.0, 0.0, 0.0)) == pytest.approx(-force.fun, rel=1e-7)
    linear = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), rest_up=rest))
    with pytest.raises(sr.NoCriticalLoad):
        sr.critical_load(linear, (0.0, 0.0), (-1.0, 0.0, 0.0))


@pytest.mark.study
def test_branches_fall_as_the_wall_softens(one_link: sr.SoftModel) -> None:
    """Beyond buckling `F = M(a) / (L sin a)` by quadrature: it falls, and rises when folded."""
    tension = PRESSURE * math.pi * RADIUS**2
    _, *bent = sr.post_buckling_branches(one_link, (0.0, 0.0), (-1.0, 0.0, 0.0), max_force=320.0)
    upright = [one for one in bent if max(abs(state.q_springs[0]) for state in one.equilibria) < 1e-6]
    assert len(upright) == 2  # upwards and downwards, in the plane of the outer spring
    for branch in upright:
        angles = np.array([abs(state.q_springs[1]) for state in branch.equilibria])
        expected = [hinge_moment(a, K, RADIUS, tension) / (LEVER * math.sin(a)) for a in angles[angles > 1e-3]]
        assert branch.forces[angles > 1e-3] == pytest.approx(np.array(expected), rel=1e-7)
        assert branch.forces.min() < 45.0


@pytest.mark.study
@each_row(("pressure", "links"), [(5e3, 1), (5e3, 2), (20e3, 3)])
def test_no_branch_is_lost_where_walls_go_slack_early(pressure: float, links: int) -> None:
    """From 8 mrad on, where a path turns within 1e-7 rad: four planes of the universal joints, both ways, to the end."""
    robot = sr.InflatableArm(link_lengths=(0.6,) * links, pressure=pressure, stiffness=K, moment_law="slack_wall")
    branches = sr.post_buckling_branches(sr.load_model(robot), (0.0,) * (links + 1), (-1.0, 0.0, 0.0))
    assert [branch.ended for branch in branches] == ["largest force"] * 9


@pytest.mark.study
def test_motors_and_loads_are_found_again(two_links: sr.SoftModel) -> None:
    """Inverse kinematics and load estimation go through slack walls: the tip is reached, the force found again."""
    force = (0.0, 8.0, -18.0)
    found = sr.solve_ik(two_links, (0.9, 0.2, 0.25), force)
    assert found.error < 1e-9
    assert (found.equilibrium.link_moments > [group.slack_moment for group in two_links.spring_groups]).any()
    estimate = sr.estimate_load(two_links, found.q_motors, found.equilibrium.motor_torques)
    assert estimate.force == pytest.approx(force, abs=1e-6)


def test_energy_along_a_path_is_the_work_of_the_springs(two_links: sr.SoftModel) -> None:
    """Quadrature of torques along a straight path, also from taut to slack."""
    rest, far = two_links.rest, two_links.rest + [0.3, -0.5, 0.1, 0.2]
    work = quad(lambda s: two_links.springs.at(rest + s * (far - rest))[1] @ (far - rest), 0.0, 1.0, epsabs=1e-11, limit=200)[0]
    assert two_links.springs.at(far)[0] == pytest.approx(work, rel=1e-9)


def test_each_hinge_of_a_link_with_two_goes_slack_by_itself() -> None:
    """The hinge near the clamp under a force at the tip; the moment of each is that of the closed form at its own bend."""
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), link_model="two_hinges", moment_law="slack_wall"))
    found = sr.solve_equilibrium(model, (0.0, 0.0), (0.0, 15.0, -28.0))
    assert found.stable
    ((near, far),) = (group.hinges for group in model.spring_groups)
    moments = []
    for hinge in (near, far):
        bend = np.linalg.norm(found.q_springs[list(hinge)])
        stiffness = model.stiffness[hinge[0]]
        moments.append(float(inflated_beam.slack_wall_moment(bend, stiffness=stiffness, slack_moment=SLACK).moment))
        assert np.linalg.norm(found.spring_torques[list(hinge)]) == pytest.approx(moments[-1], rel=1e-12)
    assert moments[0] > SLACK > moments[1]
    assert found.link_moments == pytest.approx(moments[:1], rel=1e-12)


@pytest.fixture(scope="module", params=["paper", "two_hinges"])
def compiled(request: pytest.FixtureRequest) -> tuple[sr.SoftModel, object]:
    """An arm whose walls go slack, bent at rest, and its compiled solvers."""
    arm = sr.load_model(sr.InflatableArm(moment_law="slack_wall", rest_up=(0.05, -0.1), link_model=request.param))
    return arm, sr.compile(arm, backend="python")


@pytest.mark.study
def test_compiled_solvers_find_the_same_equilibria(compiled: tuple) -> None:
    """Taut, slack and near collapse, with weight; 1e-9: both are in balance to 1e-10 of the load, the springs may be soft."""
    arm, fast = compiled
    random = np.random.default_rng(7)
    motors, sizes = random.uniform(-2.0, 2.0, (24, 3)), np.geomspace(0.5, 80.0, 24)
    forces = random.normal(size=(24, 3)) * sizes[:, None] / np.sqrt(3.0)
    many = fast.equilibria(motors, forces, gravity=sr.EARTH_GRAVITY)
    moments = []
    for case in range(24):
        one = sr.solve_equilibrium(arm, motors[case], forces[case], gravity=sr.EARTH_GRAVITY, q_springs0=many.q_springs[case])
        assert many.status[case] == 0
        assert many.q_springs[case] == pytest.approx(one.q_springs, abs=1e-9)
        assert many.tip_positions[case] == pytest.approx(one.tip_position, abs=1e-9)
        assert one.stable
        moments.append(one.link_moments.max())
    assert min(moments) < SLACK < 1.8 * SLACK < max(moments)


def test_compiled_searches_go_through_slack_walls(compiled: tuple) -> None:
    """The Newton steps of both searches have the coupling of the springs in them: load and motors are found to rounding."""
    arm, fast = compiled
    motors, force = np.array([0.4, 0.9, -1.3]), np.array([4.0, 14.0, -24.0])
    held = sr.solve_equilibrium(arm, motors, force)
    assert held.link_moments[0] > 1.3 * SLACK
    estimate = fast.estimate_load(motors, held.motor_torques)
    assert estimate.force == pytest.approx(force, abs=1e-8)
    reached = fast.inverse_kinematics(held.tip_position[None], force[None], q_motors0=motors[None] + 0.03)
    assert reached.q_motors[0] == pytest.approx(motors, abs=1e-9)


def test_compiled_solvers_refuse_by_name_what_they_cannot_have() -> None:
    with pytest.raises(
        sr.ParameterError, match="at most 16 joints, without muscles or dry friction, to be compiled with slack walls"
    ):
        sr.compile(sr.load_model(sr.InflatableArm(link_lengths=(0.3,) * 6, moment_law="slack_wall", stiffness=170.0)))
    one = sr.load_model(sr.InflatableArm(link_lengths=(0.6,), moment_law="slack_wall"))
    text = one.urdf.replace('springs="spring_1_side spring_1_up"', 'springs="spring_1_side"')
    with pytest.raises(sr.DescriptionError, match="slack_wall and 1 springs a hinge; compiled solvers need two"):
        sr.compile(sr.load_model(text))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_torques_of_many_states_are_those_of_each(seed: int) -> None:
    """Linear, on a plateau and slack, at rest too."""
    random = np.random.default_rng(seed)
    groups = (SpringGroup((0, 1), RADIUS, PRESSURE, slack_wall=True), SpringGroup((2, 3), RADIUS, PRESSURE, max_moment=15.0))
    springs = Springs(tuple("abcde"), np.full(5, K), random.normal(0.0, 0.1, 5), np.ones(5, dtype=bool), groups)
    states = np.concatenate([springs.rest[None], springs.rest + random.normal(0.0, 0.2, (4, 5))])
    each = [springs.at(state)[1] for state in states]
    assert springs.torques(states) == pytest.approx(np.array(each), rel=1e-12, abs=1e-12)


def test_tools_without_such_a_law_refuse_it_by_name(one_link: sr.SoftModel) -> None:
    for write in (sr.export.to_mjcf, sr.export.to_sdf):
        with pytest.raises(sr.ParameterError, match="moment_law slack_wall"):
            write(one_link)
