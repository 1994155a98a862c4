"""Springs with a plateau: the law itself, its way through the description, and the statics that rest on it."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softrobots as sr
from softrobots import inflated_beam
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.description.urdf_tags import InflatedLinkTag
from softrobots.model.springs import SpringGroup, Springs, spring_groups
from softrobots.view.scene import WRINKLING_COLOURS, wrinkling_level
from tests.support.tables import each_row

K, M = 187.30, 9.45  # [Troise 2021] Table 3 at 20 kPa
ARM = 0.57  # [m], hinge to tip of one link
KNEE = M / K


def saturating(stiffness: list[float], rest: list[float], plateaus: dict[tuple[int, ...], float]) -> Springs:
    """Springs of given plateaus by their places."""
    names = tuple("abcde"[: len(stiffness)])
    groups = tuple(SpringGroup(places, 0.05, 1e4, None, most) for places, most in plateaus.items())
    return Springs(names, np.array(stiffness), np.array(rest), np.ones(len(stiffness), dtype=bool), groups)


LAW = saturating([K, K, 80.0, 120.0, 120.0], [0.0, 0.02, 0.3, -0.1, 0.05], {(0, 1): M, (3, 4): 4.0})
"""Two saturating links with rest angles and a linear spring between them."""

ENERGY, TORQUE, TANGENT = range(3)
"""Places in what `at` answers."""


@pytest.fixture(scope="module")
def limp() -> sr.SoftModel:
    """The paper's arm with a plateau in both links, and links that differ."""
    return sr.load_model(sr.InflatableArm(max_moment=(21.76, 15.0)))


@pytest.fixture(scope="module")
def one() -> sr.SoftModel:
    """One link at 20 kPa."""
    return sr.load_model(sr.InflatableArm(link_lengths=(0.6,), stiffness=K, max_moment=M, pressure=20e3))


# the law


@given(st.lists(st.floats(-0.4, 0.4), min_size=5, max_size=5))
def test_torque_and_tangent_are_derivatives_of_the_energy(values: list[float]) -> None:
    """Central differences: errors are step^2 times the next derivative, and rounding over the step; ~1e-7 N m and N m/rad.

    Next to a knee the tangent jumps: angles within two steps of one are moved away.
    """
    y, step = np.array(values), 1e-6
    for group in LAW.groups:
        places = list(group.springs)
        bend = y[places] - LAW.rest[places]
        if abs(np.linalg.norm(bend) - group.max_moment / LAW.stiffness[places[0]]) < 1e-4:
            y[places] += 1e-3
    rows = step * np.eye(5)
    torque = [(LAW.at(y + row)[ENERGY] - LAW.at(y - row)[ENERGY]) / (2 * step) for row in rows]
    tangent = [(LAW.at(y + row)[TORQUE] - LAW.at(y - row)[TORQUE]) / (2 * step) for row in rows]
    assert np.allclose(LAW.at(y)[TORQUE], torque, rtol=1e-7, atol=1e-7)
    # On the plateau the tangent is M / bend across, at most k; its change over a step is relative to the bend.
    assert np.allclose(LAW.at(y)[TANGENT], tangent, rtol=1e-6, atol=1e-5)
    assert np.array_equal(LAW.at(y)[TANGENT], LAW.at(y)[TANGENT].T)


def test_the_knee_itself_is_below_the_plateau() -> None:
    """Exact numbers: 128 N m/rad times 0.625 rad is 80 N m."""
    law = saturating([128.0, 128.0], [0.0, 0.0], {(0, 1): 80.0})
    knee = np.array([0.375, -0.5])
    assert law.saturated(knee) == frozenset()
    assert np.array_equal(law.at(knee)[TANGENT], 128.0 * np.eye(2))
    beyond = np.nextafter(1.0, 2.0) * knee
    assert law.saturated(beyond) == {0, 1}
    assert np.linalg.norm(law.at(beyond)[TANGENT] @ knee) < 1e-10


@given(st.floats(0.0, 0.5), st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi))
def test_the_law_is_the_same_in_all_directions(bend: float, direction: float, turn: float) -> None:
    law = saturating([K, K], [0.0, 0.0], {(0, 1): M})
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    y = bend * np.array([np.cos(direction), np.sin(direction)])
    if abs(K * bend - M) < 1e-9:  # rounding decides there on which side of the knee the tangent is taken
        return
    assert law.at(rotation @ y)[ENERGY] == pytest.approx(law.at(y)[ENERGY], rel=1e-12, abs=1e-15)
    assert np.allclose(law.at(rotation @ y)[TORQUE], rotation @ law.at(y)[TORQUE], rtol=0.0, atol=1e-12)
    assert np.allclose(law.at(rotation @ y)[TANGENT], rotation @ law.at(y)[TANGENT] @ rotation.T, rtol=0.0, atol=1e-10)


def test_one_spring_bent_alone_follows_the_moment_angle_law_of_the_paper() -> None:
    law = saturating([K, K], [0.0, 0.0], {(0, 1): M})
    angles = np.linspace(-0.3, 0.3, 61)
    expected = inflated_beam.moment(angles, stiffness=K, max_moment=M)
    for place in (0, 1):
        torques = np.array([law.at(angle * np.eye(2)[place])[TORQUE] for angle in angles])
        assert np.allclose(torques[:, place], expected, rtol=1e-15, atol=0.0)
        assert not torques[:, 1 - place].any()


def test_below_the_knee_everything_is_that_of_linear_springs_to_the_last_bit(limp: sr.SoftModel, arm: sr.SoftModel) -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        motors, force = random.uniform(-1.5, 1.5, 3), random.uniform(-6.0, 6.0, 3)
        soft, linear = (sr.solve_equilibrium(model, motors, force, gravity=sr.EARTH_GRAVITY) for model in (limp, arm))
        assert linear.link_moments.max() < 15.0
        for name in ("q_springs", "spring_torques", "motor_torques", "tangent_stiffness", "residual", "iterations"):
            assert np.array_equal(getattr(soft, name), getattr(linear, name)), name
        assert soft.saturated == (False, False)


# the description


def test_the_plateau_travels_in_the_urdf(limp: sr.SoftModel, tmp_path: Path) -> None:
    robot = sr.InflatableArm(max_moment=(21.76, 15.0))
    assert limp == sr.load_model(robot.urdf())
    assert [group.max_moment for group in limp.spring_groups] == [21.76, 15.0]
    assert limp != sr.load_model(sr.InflatableArm())
    twin = pickle.loads(pickle.dumps(limp))
    assert twin.spring_groups == limp.spring_groups
    loaded = sr.solve_equilibrium(limp, (0.1, 0.2, 0.3), (0.0, 20.0, -30.0))
    assert any(loaded.saturated)
    again = sr.load_result(sr.save_result(loaded, tmp_path / "limp.npz"))
    assert np.array_equal(again.spring_torques, loaded.spring_torques)
    assert again.saturated == loaded.saturated


def test_one_number_holds_for_all_links_and_none_is_linear() -> None:
    assert sr.InflatableArm(max_moment=9.45).max_moment == (9.45, 9.45)
    linear = sr.load_model(sr.InflatableArm())
    assert "max_moment" not in linear.urdf
    assert linear.springs.linear
    assert linear.springs.saturated(np.full(4, 3.0)) == frozenset()
    by_number = sr.load_model(sr.InflatableArm(max_moment=9.45))
    assert by_number == sr.load_model(sr.InflatableArm(max_moment=(9.45, 9.45)))


@each_row("value", [0.0, -1.0, np.nan, np.inf, "9", (9.45,), (1.0, 2.0, 3.0), (9.45, None)])
def test_a_largest_moment_that_is_none_is_refused(value: object) -> None:
    with pytest.raises(sr.ParameterError, match="max_moment"):
        sr.InflatableArm(max_moment=value)


@each_row("text", ["0", "[9.45,-1]", "nan", "[1,2,3]"])
def test_xacro_refuses_it_too(text: str) -> None:
    with pytest.raises(sr.DescriptionError, match="max_moment"):
        expand(xacro_folder() / sr.InflatableArm.XACRO, {"max_moment": text})


@each_row("text", ["0.0", "-3", "inf", "stiff"])
def test_a_bad_attribute_is_refused(text: str, limp: sr.SoftModel) -> None:
    with pytest.raises(sr.DescriptionError, match=r"max_moment.*is required"):
        sr.load_model(limp.urdf.replace('max_moment="15.0"', f'max_moment="{text}"'))


def test_springs_of_a_link_with_a_plateau_must_be_alike(limp: sr.SoftModel) -> None:
    springs: dict[str, tuple[float, float] | None] = dict(limp.spring_table)
    with pytest.raises(sr.DescriptionError, match=r"same stiffness, not 172\.71, 100\.0"):
        sr.load_model(limp.urdf, springs=springs | {"spring_2_up": (100.0, 0.0)})
    springs["spring_2_up"] = None
    with pytest.raises(
        sr.DescriptionError,
        match=r"spring_2_side spring_2_up has max_moment 15\.0.*; spring_2_up is none; available: spring_1_side",
    ):
        sr.load_model(limp.urdf, springs=springs)
    springs["spring_2_side"] = None  # a link that the caller makes rigid has no plateau
    half = sr.load_model(limp.urdf, springs=springs, motors=limp.motor_joints)
    assert [group.max_moment for group in half.spring_groups] == [21.76]
    assert sr.load_model(limp.urdf, springs={}).springs.linear


def test_each_link_has_its_own_law() -> None:
    """Linear links before one with a plateau do not hide it; a link may have one spring; a list of no springs says so."""
    linear, names = saturating([50.0, 60.0, 60.0, 70.0], [0.0] * 4, {}), ["a", "b", "c", "d"]
    tags = [InflatedLinkTag(springs, 0.05, 1e4, most) for springs, most in ((("a",), None), (("x",), 1.0), (("b", "c"), 2.0))]
    groups = spring_groups([*tags, InflatedLinkTag(("d",), 0.05, 1e4, 3.0)], linear, names, {"a": 7})
    assert groups == (
        SpringGroup((0,), 0.05, 1e4, 7),
        SpringGroup((1, 2), 0.05, 1e4, None, 2.0),
        SpringGroup((3,), 0.05, 1e4, None, 3.0),
    )
    assert not replace(linear, groups=groups).linear
    assert replace(linear, groups=groups[:1]).linear
    assert linear.linear
    with pytest.raises(sr.DescriptionError, match=r"; e is constrained by muscle lengths; available: none$"):
        spring_groups([InflatedLinkTag(("e", "b"), 0.05, 1e4, 3.0)], linear, ["e", "b_"], {})


def test_sections_and_hinges_that_muscles_hold_have_no_plateau() -> None:
    tube = sr.HelixTube().urdf()
    assert "inflated_link" in tube
    with pytest.raises(sr.DescriptionError, match="must be joints with a spring each; section_1_1_bend_x is none; available"):
        sr.load_model(tube.replace("<softrobots:inflated_link ", '<softrobots:inflated_link max_moment="1.0" '))
    lumped = sr.PccArm(chain="lumped", hinges=2, segment_lengths=(0.5,))
    names = sr.load_model(lumped, muscles="forces").spring_joints[:2]
    tag = f'<softrobots:inflated_link springs="{" ".join(names)}" radius="0.03" pressure="1e4" max_moment="0.2"/></robot>'
    text = lumped.urdf().replace("</robot>", tag)
    assert sr.load_model(text, muscles="forces").spring_groups[-1].max_moment == 0.2
    with pytest.raises(sr.DescriptionError, match="is constrained by muscle lengths"):
        sr.load_model(text)


# the statics


@pytest.mark.parametrize("force", [17.0, 20.0, 50.0, 200.0])
def test_a_dead_force_beyond_the_plateau_turns_the_link_out_of_its_way(one: sr.SoftModel, force: float) -> None:
    """Balance of one link on the plateau: `F a cos(theta) = M`, stable, because the arm of the force shrinks."""
    found = sr.solve_equilibrium(one, (0.0, 0.0), (0.0, 0.0, force))
    theta = np.arccos(M / (force * ARM))
    assert np.allclose(found.q_springs, [0.0, theta], rtol=0.0, atol=1e-9)
    assert found.stable
    assert found.saturated == (True,)
    assert found.link_moments[0] == pytest.approx(M, rel=1e-14)
    assert found.tangent_stiffness[1, 1] == pytest.approx(force * ARM * np.sin(theta), rel=1e-9)
    assert found.tangent_stiffness[0, 0] > 0.0


def test_a_dead_moment_beyond_the_plateau_has_no_equilibrium(one: sr.SoftModel) -> None:
    held = sr.solve_equilibrium(one, (0.0, 0.0), wrench=(0.0, 0.0, 0.0, 0.0, -0.99 * M, 0.0))
    assert held.q_springs[1] == pytest.approx(0.99 * KNEE, rel=1e-12)
    with pytest.raises(sr.EquilibriumNotFound, match=r"spring_1_side, spring_1_up is on the plateau of its moment, 9\.45 N m"):
        sr.solve_equilibrium(one, (0.0, 0.0), wrench=(0.0, 0.0, 0.0, 0.0, -1.01 * M, 0.0))


def test_newton_settles_wherever_the_load_is(limp: sr.SoftModel) -> None:
    """The energy of dead forces grows with every angle: a minimum exists, and descent finds one that is certified."""
    random = np.random.default_rng(11)
    plateaus = 0
    for _ in range(60):
        force = random.normal(size=3)
        force *= random.uniform(20.0, 120.0) / np.linalg.norm(force)
        found = sr.solve_equilibrium(limp, random.uniform(-2.0, 2.0, 3), force)
        assert found.stable
        assert np.all(found.link_moments <= np.array([21.76, 15.0]) * (1.0 + 1e-14))
        plateaus += any(found.saturated)
    assert plateaus > 30


def test_a_link_on_its_plateau_counts_as_wrinkled_even_below_the_theoretical_moment() -> None:
    """A link that goes limp at 5 N m, a quarter of `M_w` at 50 kPa."""
    model = sr.load_model(sr.InflatableArm(max_moment=5.0))
    loaded = sr.solve_equilibrium(model, (0.0, 0.0, 0.0), (0.0, 0.0, -6.0))
    assert loaded.saturated == (True, False)
    assert loaded.link_moments[0] < 0.25 * model.spring_groups[0].wrinkling_moment
    assert loaded.wrinkled
    assert wrinkling_level(loaded, 0) == len(WRINKLING_COLOURS) - 1 > wrinkling_level(loaded, 1)
    light = sr.solve_equilibrium(model, (0.0, 0.0, 0.0), (0.0, 0.0, -3.0))
    assert not light.wrinkled


def test_the_recursion_of_the_paper_converges_below_the_plateau_and_says_so_beyond(one: sr.SoftModel) -> None:
    below = sr.solve_equilibrium(one, (0.0, 0.0), (0.0, 0.0, 12.0), method="fixed_point")
    assert np.allclose(below.q_springs, sr.solve_equilibrium(one, (0.0, 0.0), (0.0, 0.0, 12.0)).q_springs, rtol=0, atol=1e-10)
    with pytest.raises(sr.EquilibriumNotFound, match="method='newton'"):
        sr.solve_equilibrium(one, (0.0, 0.0), (0.0, 0.0, 20.0), method="fixed_point")


@pytest.mark.study
@pytest.mark.parametrize("force", [(3.0, 10.0, -15.0), (3.0, 25.0, -30.0)])
def test_load_estimation_finds_the_force_before_and_on_the_plateau(limp: sr.SoftModel, force: tuple[float, ...]) -> None:
    motors = (0.3, 0.6, -0.9)
    loaded = sr.solve_equilibrium(limp, motors, force)
    assert any(loaded.saturated) == (force[1] > 20.0)
    found = sr.estimate_load(limp, motors, loaded.motor_torques)
    assert np.allclose(found.force, force, rtol=0.0, atol=1e-6)
    assert np.allclose(found.equilibrium.q_springs, loaded.q_springs, rtol=0.0, atol=1e-8)


# buckling


def test_a_straight_arm_buckles_at_the_same_load(limp: sr.SoftModel, arm: sr.SoftModel) -> None:
    """At the bifurcation no spring is bent: the plateau plays no part."""
    assert sr.critical_load(limp, (0, 0, 0), (-1, 0, 0)) == pytest.approx(
        sr.critical_load(arm, (0, 0, 0), (-1, 0, 0)), rel=1e-12
    )


@pytest.mark.parametrize("aside", [0.01, 0.1, 0.5])
def test_an_oblique_push_collapses_the_link_at_its_knee(one: sr.SoftModel, aside: float) -> None:
    """At the knee `F a (u_z cos + -u_x sin) = M`; beyond it less force is needed: the largest force is there."""
    direction = np.array([-1.0, 0.0, aside])
    unit = direction / np.linalg.norm(direction)
    expected = M / (ARM * (unit[2] * np.cos(KNEE) - unit[0] * np.sin(KNEE)))
    assert sr.critical_load(one, (0.0, 0.0), direction) == pytest.approx(expected, rel=1e-8)


@pytest.mark.study
def test_two_links_collapse_where_displacement_control_finds_the_largest_force(limp: sr.SoftModel) -> None:
    """An oblique push of the arm, followed by the displacement of its tip across the push.

    The largest of 400 points of a curve with a corner lies below the corner by less than its slope times half a step.
    """
    direction = np.array([-1.0, 0.0, 0.2]) / np.hypot(1.0, 0.2)
    critical = sr.critical_load(limp, (0.0, 0.0, 0.0), direction)
    ways = np.linspace(0.02, 0.25, 400)
    held, forces = None, []
    for way in ways:
        held = sr.solve_imposed_displacement(limp, (0.0, 0.0, 0.0), way, direction=direction, start=held)
        forces.append(held.reaction)
    assert 0 < int(np.argmax(forces)) < 399
    assert max(forces) <= critical * (1.0 + 1e-9)
    assert max(forces) == pytest.approx(critical, abs=float(np.abs(np.diff(forces)).max()))


def test_a_transverse_push_never_loses_stability(one: sr.SoftModel) -> None:
    """Beyond the knee the link turns with the force: stable, if soft, and followed to the largest force wanted."""
    with pytest.raises(sr.NoCriticalLoad) as caught:
        sr.critical_load(one, (0.0, 0.0), (0.0, 0.0, 1.0), max_force=100.0)
    assert caught.value.max_force == 100.0
    assert "could not be followed" not in str(caught.value)
