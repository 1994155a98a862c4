"""Displacement control: closed forms of one link, load control, the Lagrangian by differences, files, refusals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space
from scipy.optimize import brentq

import softrobots as sr
from softrobots import inflated_beam
from softrobots.statics.displacement_control import DisplacementControl, Probe
from softrobots.statics.imposed_displacement import imposed_result
from softrobots.statics.loads import Load
from tests.support.tables import each_row

K, M = 169.44, 21.76  # [Troise 2021] Table 3 at 50 kPa
REACH = 0.47  # [m], from the hinge to the probe at h = 500 mm
BESIDE = 0.065  # [m], of the probe's centre from the axis of the link
KNEE = M / K


@pytest.fixture(scope="module")
def one() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm(link_lengths=(0.6,), stiffness=K, max_moment=M))


@pytest.fixture(scope="module")
def limp() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm(max_moment=(21.76, 15.0), rest_up=(0.05, -0.1), rest_side=0.02))


def law(angle: float) -> float:
    return float(inflated_beam.moment(angle, stiffness=K, max_moment=M))


def in_plane(angle: float, side: str) -> tuple[np.ndarray, np.ndarray, dict]:
    """Direction of the push, axis of the bent link, and options, for a push upwards or sideways."""
    if side == "up":
        options = {"direction": (0, 0, 2.0), "point": (REACH, 0.0, 0.0)}
        return np.array([0.0, 0.0, 1.0]), np.array([np.cos(angle), 0.0, np.sin(angle)]), options
    options = {"direction": (0, -0.5, 0), "point": (REACH, 0.0, 0.0)}
    return np.array([0.0, -1.0, 0.0]), np.array([np.cos(angle), -np.sin(angle), 0.0]), options


@pytest.mark.parametrize("side", ["up", "down"])
@pytest.mark.parametrize("share", [0.3, 0.999, 1.001, 1.8, 4.0])
def test_a_held_point_of_one_link_in_closed_form(one: sr.SoftModel, share: float, side: str) -> None:
    """`v = a sin(theta)` and `F a cos(theta) = M(theta)`, before and beyond the knee."""
    angle = share * KNEE
    push, axis, options = in_plane(angle, side)
    held = sr.solve_imposed_displacement(one, (0.0, 0.0), REACH * np.sin(angle), frame="link_1", **options)
    assert abs(held.q_springs[1 if side == "up" else 0]) == pytest.approx(angle, rel=1e-12)
    assert held.reaction == pytest.approx(law(angle) / (REACH * np.cos(angle)), rel=1e-9)
    assert np.allclose(held.force, held.reaction * push, rtol=1e-15, atol=0.0)
    assert np.allclose(held.contact, [0.03, 0.0, 0.0] + REACH * axis, rtol=0.0, atol=1e-12)
    assert held.stable
    assert held.equilibrium.saturated == (share > 1.0,)
    assert held.residual <= held.equilibrium.tolerance


@pytest.mark.parametrize("side", ["up", "down"])
@pytest.mark.parametrize("share", [0.3, 0.999, 1.001, 1.8, 4.0])
def test_a_probe_that_slides_on_the_face_of_a_link(one: sr.SoftModel, share: float, side: str) -> None:
    """Its centre stays on its line and at its distance from the axis, its force square to it; `M` is that of the law."""
    angle = share * KNEE
    push, axis, options = in_plane(angle, side)
    point = [REACH, 0.0, -BESIDE] if side == "up" else [REACH, BESIDE, 0.0]
    way = REACH * np.tan(angle) - BESIDE * (1.0 / np.cos(angle) - 1.0)
    held = sr.solve_imposed_displacement(
        one, (0.0, 0.0), way, frame="link_1", along=(3.0, 0.0, 0.0), **{**options, "point": point}
    )
    assert abs(held.q_springs[1 if side == "up" else 0]) == pytest.approx(angle, rel=1e-12)
    assert np.allclose(held.contact, [0.5, 0.0, 0.0] + (way - BESIDE) * push, rtol=0.0, atol=1e-12)
    from_hinge = held.contact - [0.03, 0.0, 0.0]
    assert np.linalg.norm(np.cross(from_hinge, axis)) == pytest.approx(BESIDE, rel=1e-11)
    assert abs(held.force @ axis) <= 1e-12 * np.linalg.norm(held.force)
    assert np.linalg.norm(np.cross(from_hinge, held.force)) == pytest.approx(law(angle), rel=1e-9)
    assert held.reaction == pytest.approx(float(held.force @ push), rel=1e-14)
    assert held.stable


def test_a_sliding_probe_agrees_with_a_root_of_the_geometry(one: sr.SoftModel) -> None:
    """The angle by SciPy from the distance of the probe's centre from the axis, not from the formula of the face."""
    way = 0.08

    def miss(angle: float) -> float:
        centre = np.array([REACH, way - BESIDE])
        return float(np.cos(angle) * centre[1] - np.sin(angle) * centre[0]) + BESIDE

    held = sr.solve_imposed_displacement(
        one, (0.0, 0.0), way, frame="link_1", direction=(0, 0, 1), point=(REACH, 0.0, -BESIDE), along=(1, 0, 0)
    )
    assert held.q_springs[1] == pytest.approx(brentq(miss, 0.0, 0.5, xtol=1e-15), abs=1e-13)


@pytest.mark.parametrize("way", [0.02, -0.03, 0.06])
def test_below_the_knee_it_is_load_control(limp: sr.SoftModel, way: float) -> None:
    """The reaction at the tip, given as a dead force, leads to the same springs."""
    direction = np.array([0.2, 0.6, 1.0])
    held = sr.solve_imposed_displacement(limp, (0.2, 0.3, -0.4), way, direction=direction, gravity=sr.EARTH_GRAVITY)
    assert not any(held.equilibrium.saturated)
    dead = sr.solve_equilibrium(limp, (0.2, 0.3, -0.4), held.force, gravity=sr.EARTH_GRAVITY, tolerance=1e-12)
    assert np.allclose(dead.q_springs, held.q_springs, rtol=0.0, atol=1e-9)
    free = sr.solve_equilibrium(limp, (0.2, 0.3, -0.4), gravity=sr.EARTH_GRAVITY)
    moved = dead.tip_position - free.tip_position
    assert moved @ direction / np.linalg.norm(direction) == pytest.approx(way, abs=1e-9)
    assert np.allclose(held.equilibrium.motor_torques, dead.motor_torques, rtol=0.0, atol=1e-7)


def test_loads_beside_the_probe_stay(limp: sr.SoftModel) -> None:
    """A force on the tip and a wrench on a link: with the reaction as one more dead force the springs are the same."""
    motors, weight, push = (0.2, 0.3, -0.4), np.array([0.0, 2.0, -3.0]), np.array([0.0, 0.0, 1.0])
    beside = {"link_1": (0.0, 0.0, -4.0, 0.0, 0.0, 0.0)}
    held = sr.solve_imposed_displacement(limp, motors, 0.04, direction=push, force=weight, wrench=beside)
    dead = sr.solve_equilibrium(limp, motors, weight + held.force, wrench=beside, tolerance=1e-12)
    assert np.allclose(dead.q_springs, held.q_springs, rtol=0.0, atol=1e-9)
    free = sr.solve_equilibrium(limp, motors, weight, wrench=beside)
    assert (dead.tip_position - free.tip_position) @ push == pytest.approx(0.04, abs=1e-9)
    with pytest.raises(sr.ParameterError, match="start"):
        sr.solve_imposed_displacement(limp, motors, 0.05, direction=push, start=held)


@pytest.mark.parametrize(("way", "pulls"), [(-0.05, True), (-1e-6, True), (0.0, False), (1e-6, False), (0.05, False)])
def test_a_probe_that_pulls_says_so(limp: sr.SoftModel, way: float, pulls: bool) -> None:
    """Where the springs are relaxed the reaction has the sign of the displacement."""
    held = sr.solve_imposed_displacement(limp, (0, 0.5, 0), way, direction=(0, 0, -1), gravity=sr.EARTH_GRAVITY)
    assert held.pulls is pulls
    assert held.stable


def test_the_displacement_counts_from_the_sagging_robot(limp: sr.SoftModel) -> None:
    still = sr.solve_imposed_displacement(limp, (0, 0.5, 0), 0.0, direction=(0, 0, 1), gravity=sr.EARTH_GRAVITY)
    free = sr.solve_equilibrium(limp, (0, 0.5, 0), gravity=sr.EARTH_GRAVITY)
    assert abs(still.reaction) < 1e-9
    assert np.array_equal(still.q_springs, free.q_springs)
    assert np.allclose(still.contact, free.tip_position, rtol=0.0, atol=1e-12)
    assert not np.allclose(still.contact, sr.solve_equilibrium(limp, (0, 0.5, 0)).tip_position, rtol=0.0, atol=1e-3)


def lagrangian(model: sr.SoftModel, motors: np.ndarray, probe: Probe, reaction: float, y: np.ndarray) -> tuple[float, float]:
    """Energy of springs and gravity minus reaction times displacement, and the displacement: from Pinocchio alone."""
    q = model.configuration(motors, y)
    heavy = model.pinocchio.copy()
    heavy.gravity.linear = np.array(sr.EARTH_GRAVITY)
    data = heavy.createData()
    pin.framesForwardKinematics(heavy, data, q)
    pose = data.oMf[heavy.getFrameId(probe.frame)]
    offset = pose.act(probe.point) - probe.origin
    way = float(probe.direction @ offset)
    if probe.normal is not None:
        normal = pose.rotation @ probe.normal
        way = float(normal @ offset) / float(normal @ probe.direction)
    return model.springs.at(y)[0] + pin.computePotentialEnergy(heavy, data, q) - reaction * way, way


@pytest.mark.parametrize("along", [None, (1.0, 0.1, 0.0)])
@pytest.mark.parametrize("way", [0.03, 0.25])
def test_the_certificate_is_that_of_the_lagrangian(limp: sr.SoftModel, way: float, along: object) -> None:
    """Gradient zero, Hessian the tangent stiffness, constraint gradient: by differences of energy and displacement.

    First differences with a step of 1e-5 err by 1e-10 times third derivatives and 1e-16 / 1e-5 times energies of 100 J; second
    ones with 1e-3 by 1e-6 times fourth derivatives (hundreds of N m).
    """
    motors = np.array([0.2, 0.3, -0.4])
    held = sr.solve_imposed_displacement(
        limp, motors, way, frame="link_2", point=(0.4, 0.03, -0.06), direction=(0.1, -0.3, 1.0), along=along,
        gravity=sr.EARTH_GRAVITY,
    )  # fmt: skip
    assert held.stable
    assert any(held.equilibrium.saturated) == (way > 0.1)

    def at(y: np.ndarray) -> np.ndarray:
        return np.array(lagrangian(limp, motors, held.probe, held.reaction, y))

    y, rows = held.q_springs, np.eye(4)
    assert at(y)[1] == pytest.approx(way, abs=1e-12)
    slopes = np.array([(at(y + 1e-5 * row) - at(y - 1e-5 * row)) / 2e-5 for row in rows])
    assert np.abs(slopes[:, 0]).max() < 1e-7
    assert np.allclose(held.gradient, slopes[:, 1], rtol=0.0, atol=1e-9)
    h = 1e-3
    hessian = [
        [(at(y + h * (a + b)) - at(y + h * (a - b)) - at(y - h * (a - b)) + at(y - h * (a + b)))[0] / (4 * h * h) for b in rows]
        for a in rows
    ]
    assert np.allclose(held.tangent_stiffness, hessian, rtol=0.0, atol=5e-3)
    assert np.allclose(held.tangent_stiffness, held.tangent_stiffness.T, rtol=0.0, atol=1e-10)


def test_stable_means_positive_definite_on_what_the_probe_leaves_free(limp: sr.SoftModel) -> None:
    """Against SciPy's null space, at random states and reactions of both kinds."""
    random, seen = np.random.default_rng(3), set()
    motors = np.zeros(3)
    probe = sr.solve_imposed_displacement(limp, motors, 0.01, direction=(0.3, 0.2, 1.0)).probe
    problem = DisplacementControl(limp, motors, Load.of(limp), probe, 1e-10)
    for _ in range(60):
        y, reaction = 0.3 * random.normal(size=4), float(random.uniform(-600.0, 600.0))
        held = imposed_result(problem, problem.at(y, reaction), 0.0, 0)
        free = null_space(held.gradient[None, :])
        smallest = float(np.linalg.eigvalsh(free.T @ held.tangent_stiffness @ free)[0])
        assert held.stable == (smallest > 0.0)
        seen.add(held.stable)
    assert seen == {True, False}


def test_a_sequence_goes_on_where_it_was(limp: sr.SoftModel) -> None:
    """Step by step, from zero, and backwards: one path."""
    options = {"direction": (0.0, 0.2, 1.0), "gravity": sr.EARTH_GRAVITY}
    held, ways = None, np.linspace(0.0, 0.4, 9)
    steps = []
    for way in ways:
        held = sr.solve_imposed_displacement(limp, (0.1, 0.2, 0.3), way, start=held, **options)
        steps.append(held)
    assert steps[-1].equilibrium.saturated[0]
    for way, step in zip(ways, steps, strict=True):
        direct = sr.solve_imposed_displacement(limp, (0.1, 0.2, 0.3), way, **options)
        back = sr.solve_imposed_displacement(limp, (0.1, 0.2, 0.3), way, start=steps[-1], **options)
        for other in (direct, back):
            assert np.allclose(other.q_springs, step.q_springs, rtol=0.0, atol=1e-8)
            assert other.reaction == pytest.approx(step.reaction, abs=1e-6)


@each_row(("name", "change"), [("q_springs", 1e-8), ("reaction", 1e-5), ("displacement", 1e-9), ("origin", 1e-9)])
def test_a_file_that_is_not_in_balance_is_refused(limp: sr.SoftModel, name: str, change: float, tmp_path: Path) -> None:
    held = sr.solve_imposed_displacement(limp, (0.1, 0.2, 0.3), 0.05, direction=(0, 0, 1))
    path = sr.save_result(held, tmp_path / "held.npz")
    with np.load(path) as file:
        fields = {key: file[key] for key in file.files}
    fields[name] = fields[name] + change
    np.savez(path, **fields)
    with pytest.raises(sr.FileFormatError, match="where it claims to be"):
        sr.load_result(path)


def test_a_way_that_the_link_does_not_have_is_told(one: sr.SoftModel) -> None:
    """The point is at most its arm away; the error carries how far the path could be followed."""
    with pytest.raises(sr.EquilibriumNotFound, match=r"displacement of 0\.5 m was not reached") as caught:
        sr.solve_imposed_displacement(one, (0, 0), 0.5, frame="link_1", point=(REACH, 0, 0), direction=(0, 0, 1))
    best = caught.value.best
    assert isinstance(best, sr.ImposedDisplacement)
    assert 0.4 < best.displacement < REACH
    assert best.residual <= best.equilibrium.tolerance
    with pytest.raises(sr.EquilibriumNotFound, match="was not reached in 3 evaluations"):
        sr.solve_imposed_displacement(one, (0, 0), 0.1, direction=(0, 0, 1), max_iterations=3)


@each_row(
    ("options", "message"),
    [
        ({"displacement": np.nan}, "displacement"),
        ({"displacement": "far"}, "displacement"),
        ({"direction": (0, 0, 0)}, "direction.*different from zero"),
        ({"direction": (0, 1)}, "direction"),
        ({"direction": (1, 0, 0)}, "direction.*can move the point"),
        ({"point": (0, np.inf, 0)}, "point"),
        ({"point": (-0.57, 0, 0)}, "direction.*can move the point"),  # the hinge itself
        ({"along": (0, 0, 0)}, "along.*different from zero"),
        ({"along": (0, 0, 1)}, "along.*does not run along the probe's line"),
        ({"gravity": (0, 0)}, "gravity"),
        ({"force": (0, 0)}, "force"),
        ({"wrench": (0, 0, 0)}, "wrench"),
        ({"q_motors": (0, 0, 0)}, "q_motors"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"start": 1.0}, "start.*ImposedDisplacement"),
    ],
)
def test_bad_input_is_refused(one: sr.SoftModel, options: dict, message: str) -> None:
    given = {"q_motors": (0.0, 0.0), "displacement": 0.01, "direction": (0, 0, 1)} | options
    with pytest.raises(sr.ParameterError, match=message):
        sr.solve_imposed_displacement(one, **given)


def test_a_start_of_another_case_is_refused(one: sr.SoftModel, limp: sr.SoftModel) -> None:
    held = sr.solve_imposed_displacement(one, (0, 0), 0.01, direction=(0, 0, 1))
    for change in (
        {"direction": (0, 1, 0)},
        {"frame": "link_1", "point": (0.5, 0, 0)},
        {"along": (1, 0, 0)},
        {"gravity": (0, 0, -1)},
    ):
        with pytest.raises(sr.ParameterError, match="start"):
            sr.solve_imposed_displacement(one, (0, 0), 0.01, start=held, **({"direction": (0, 0, 1)} | change))
    with pytest.raises(sr.ParameterError, match="start"):
        sr.solve_imposed_displacement(limp, (0, 0, 0), 0.01, direction=(0, 0, 1), start=held)
    turned = replace(held, load=Load.of(one, gravity=(0, 0, -1)))
    with pytest.raises(sr.ParameterError, match="start"):
        sr.solve_imposed_displacement(one, (0, 0), 0.01, direction=(0, 0, 1), start=turned)


def test_a_robot_without_springs_and_a_frame_that_is_not_there_are_refused(one: sr.SoftModel) -> None:
    rigid = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)).urdf(), springs={})
    with pytest.raises(sr.ParameterError, match="a robot with springs"):
        sr.solve_imposed_displacement(rigid, np.zeros(rigid.n_motors), 0.01, direction=(0, 0, 1))
    with pytest.raises(sr.NameNotFound, match="probe"):
        sr.solve_imposed_displacement(one, (0, 0), 0.01, direction=(0, 0, 1), frame="probe")
    with pytest.raises(sr.ParameterError, match="model"):
        sr.solve_imposed_displacement("arm", (0, 0), 0.01, direction=(0, 0, 1))


@pytest.mark.parametrize(
    ("motors", "direction", "displacement", "along"),
    [
        # At once, Newton lands where both links are limp (unstable), while on the path the second one unloads.
        ((0.90865768, 1.16468892, 1.21750246), (0.43418114, -0.88488188, -0.00938766), 0.4, (1.0, 0.0, 0.0)),
        ((0.67992841, 0.68332295, -0.99980484), (-2.73710131, -0.95061033, -1.41968199), 0.36, None),
        # From there no step led on.
        ((0.67992841, 0.68332295, -0.99980484), (-2.73710131, -0.95061033, -1.41968199), 0.69178, None),
    ],
)
def test_one_step_ends_on_the_path_of_many(
    motors: tuple[float, ...], direction: tuple[float, ...], displacement: float, along: tuple[float, ...] | None
) -> None:
    model = sr.load_model(sr.InflatableArm(max_moment=14.0, rest_up=0.05))
    at_once = sr.solve_imposed_displacement(model, motors, displacement, direction=direction, along=along)
    held = None
    for way in np.linspace(0.0, displacement, 101):
        held = sr.solve_imposed_displacement(model, motors, way, direction=direction, along=along, start=held)
    assert held is not None
    assert at_once.stable
    assert held.stable
    np.testing.assert_allclose(at_once.q_springs, held.q_springs, rtol=0.0, atol=1e-8)  # both solve to 1e-10 N m
