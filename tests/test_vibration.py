"""Vibration modes and linear models, against closed forms, the full equations of motion, and python-control."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli import main as cli
from softrobots.dynamics.damping import damping_matrix
from tests.support.law_robots import model
from tests.support.rods import cantilever_frequencies

LENGTH, BENDING, DENSITY = 0.6, 0.8, 0.3  # [m], [N m^2], [kg/m]


@cache
def rod(sections: int, chain: str, tip_mass: float = 0.0) -> sr.SoftModel:
    """A thin rod, so that turning its sections takes no part, and one that does not stretch; clamped, upright."""
    robot = sr.PccArm(
        segment_lengths=(LENGTH,),
        muscle_azimuths=(),
        bending_stiffness=BENDING,
        torsional_stiffness=0.5,
        axial_stiffness=1e5,
        linear_density=DENSITY,
        radius=1e-3,
        chain=chain,
        elastic_sections=sections,
        hinges=sections,
        damping_time=0.01,
    )
    ball = (
        '<joint name="ball_joint" type="fixed"><parent link="tip"/><child link="ball"/></joint><link name="ball"><inertial>'
        f'<mass value="{tip_mass}"/><inertia ixx="1e-12" iyy="1e-12" izz="1e-12" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )
    text = robot.urdf()
    return sr.load_model(text.replace("</robot>", f"{ball}</robot>") if tip_mass else text, tip="tip")


def rod_frequencies(tip_mass: float) -> np.ndarray:
    """First three of the rod with a mass at its end, in closed form [Hz]."""
    unit = np.sqrt(BENDING / (DENSITY * LENGTH**4)) / (2.0 * np.pi)
    return cantilever_frequencies(tip_mass / (DENSITY * LENGTH)) * unit


@pytest.mark.study
@pytest.mark.parametrize("tip_mass", [0.0, 0.09])
@pytest.mark.parametrize(("chain", "largest"), [("sections", 0.05), ("lumped", 5e-4), ("flexures", 5e-4)])
def test_a_clamped_rod_rings_at_its_closed_form_frequencies(chain: str, largest: float, tip_mass: float) -> None:
    """Three frequencies, each twice; errors of both signs fall with the length of the sections.

    At 16 the third is 2.8 % off in sections, whose curvature is constant, and 0.03 % between hinges or flexures; twice that
    is allowed.
    """
    exact, errors = np.repeat(rod_frequencies(tip_mass), 2), []
    for sections in (8, 16):
        robot = rod(sections, chain, tip_mass)
        modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, ()))
        across = np.linalg.norm(modes.tip_shapes[:2], axis=0)
        bending = modes.frequencies[across > 1e3 * np.abs(modes.tip_shapes[2])][:6]
        errors.append(np.abs(bending / exact - 1.0).max())
        plain = modes.damping_ratios[:4] / (0.01 * np.pi * modes.frequencies[:4])
        assert plain == pytest.approx(1.0, rel=1e-7)  # zeta = beta omega / 2 of a material with one damping time
    assert errors[1] < largest
    assert errors[0] / errors[1] > 2.0


def ritz_errors(count: int, mean: str) -> np.ndarray:
    """Errors of the first three frequencies of a clamped rod whose curvature is constant in each of `count` equal sections.

    Ritz's method: its mass is on the arcs, by Gauss points, or on the chords between their ends.
    """
    points, weights = np.polynomial.legendre.leggauss(4)
    start, share = np.arange(count)[:, None], 0.5 + 0.5 * points
    s = (start + share)[:, :, None] - np.arange(count)  # along the rod from the start of each section, in lengths of a section
    aside = np.where(s > 1.0, s - 0.5, 0.5 * np.maximum(s, 0.0) ** 2)  # by a unit of curvature of each
    if mean == "chords":
        ends = np.where(start > np.arange(count), start - np.arange(count) - 0.5, 0.0)
        ends = np.vstack([ends, count - np.arange(count) - 0.5])
        aside = ends[:-1, None] * (1.0 - share)[:, None] + ends[1:, None] * share[:, None]
    mass = np.einsum("ipj,p,ipk->jk", aside, 0.5 * weights, aside)
    found = np.sort(np.linalg.eigvals(mass).real)[::-1][:3] ** -0.5 * count**2
    return found / cantilever_frequencies(0.0) - 1.0


def test_sections_ring_as_a_rod_of_constant_curvatures_with_its_mass_on_chords() -> None:
    """The errors that docs/motion.md tells are of piecewise constant curvature; mass on the arcs would halve two of them."""
    robot = rod(16, "sections")
    found = sr.vibration_modes(robot, sr.solve_equilibrium(robot, ())).frequencies[:6:2] / rod_frequencies(0.0) - 1.0
    assert found == pytest.approx(ritz_errors(16, "chords"), abs=5e-5)  # of tiny links on the joints, and of rotary inertia
    assert ritz_errors(16, "chords") == pytest.approx([0.0005, 0.0097, 0.0280], abs=5e-5)
    assert ritz_errors(16, "arcs") == pytest.approx([0.0008, 0.0053, 0.0127], abs=5e-5)


@pytest.mark.parametrize("count", [1, 4])
def test_a_rod_of_sections_sags_exactly_under_a_small_weight(count: int) -> None:
    """The reason for its mass on chords: `w l^4 / 8 EI` at the tip, however few sections there are; 1 / 3 n^2 less on arcs."""
    robot, gravity = rod(count, "sections"), 1e-3
    tip = sr.solve_equilibrium(robot, (), gravity=(gravity, 0.0, 0.0)).tip_position
    sag = DENSITY * gravity * LENGTH**4 / (8.0 * BENDING)
    assert tip[0] == pytest.approx(sag, rel=2e-3 / count)  # links of 1e-4 kg on the joints


def test_twist_and_stretch_of_sections_are_of_second_order() -> None:
    """First frequencies in closed form, `sqrt(GJ / J) / 4 l` and `sqrt(EA / m) / 4 l`."""
    inertia = DENSITY * 1e-3**2 / 2.0
    exact = np.sqrt([0.5 / inertia, 1e5 / DENSITY]) / (4.0 * LENGTH)
    errors = []
    for count in (4, 8):
        robot = rod(count, "sections")
        modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, ()))
        found = [modes.frequencies[modes.effective_masses[:, axis].argmax()] for axis in (5, 2)]
        errors.append(np.abs(found / exact - 1.0))
    assert np.all(errors[1] < 2e-3)  # pi^2 / 96 n^2 of a sum instead of an integral
    assert np.all((errors[0] / errors[1] > 3.7) & (errors[0] / errors[1] < 4.3)), errors


def test_modes_of_a_round_rod_come_in_pairs_along_its_axes() -> None:
    robot = rod(6, "sections")
    modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, (), gravity=sr.EARTH_GRAVITY))
    for first in (0, 2):
        assert modes.frequencies[first] == pytest.approx(modes.frequencies[first + 1], rel=1e-7)  # but for its tiny links
        one, other = modes.tip_shapes[:3, first], modes.tip_shapes[:3, first + 1]
        assert min(one[0], other[1]) > 0.0
        assert np.abs([one[1], one[2], other[0], other[2]]).max() < 1e-6 * one[0]


@pytest.mark.parametrize(
    ("motors", "expected"), [((0, 0, 0), (3.504, 3.504, 18.66, 18.66)), ((0.3, 0.6, -0.8), (3.715, 3.869, 15.23, 16.82))]
)
def test_the_arm_of_the_paper(motors: tuple[float, ...], expected: tuple[float, ...]) -> None:
    """Frequencies of an independent prototype, to the digits that it printed."""
    arm = model("arm")
    modes = sr.vibration_modes(arm, sr.solve_equilibrium(arm, motors, gravity=sr.EARTH_GRAVITY))
    assert modes.frequencies == pytest.approx(expected, rel=4e-4)
    assert modes.damping_ratios == pytest.approx(
        np.einsum("ij,ij->j", modes.shapes, modes.shapes) / (4 * np.pi * modes.frequencies)
    )


SPRINGS = {"s0": 100.0, "s1": 200.0, "s2": 300.0}


def slides(body: str) -> str:
    """A body on three slides along x, y and z, with `SPRINGS`."""
    parts = []
    for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
        parts.append(
            f'<link name="l{i + 1}"/><joint name="s{i}" type="prismatic"><parent link="l{i}"/><child link="l{i + 1}"/>'
        )
        parts.append(f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>')
    fixed = '<joint name="f" type="fixed"><parent link="l3"/><child link="body"/></joint>'
    return f'<robot name="slides"><link name="l0"/>{"".join(parts)}{body}{fixed}</robot>'


@pytest.mark.study
def test_effective_masses_sum_to_the_mass_that_shakes() -> None:
    """A body on three slides gives way as a whole: its mass, in each direction; a rod on end: what does not move is missing."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    body = f'<link name="body"><inertial><origin xyz="0.1 0.2 0.3"/><mass value="1.7"/>{inertia}</inertial></link>'
    robot = sr.load_model(slides(body), springs=SPRINGS, tip="body")
    modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, ()))
    assert np.allclose(modes.effective_masses[:, :3], 1.7 * np.eye(3), rtol=1e-12, atol=1e-15)
    assert modes.frequencies == pytest.approx(np.sqrt(np.array([100.0, 200.0, 300.0]) / 1.7) / (2.0 * np.pi), rel=1e-13)
    shares = []
    for sections in (6, 12):
        upright = rod(sections, "sections")
        masses = sr.vibration_modes(upright, sr.solve_equilibrium(upright, ())).effective_masses
        first = masses[:2, :2].sum() / (2.0 * DENSITY * LENGTH)
        assert first == pytest.approx(0.6131, rel=0.3 / sections**2 + 2e-4)  # of the first bending mode, Blevins table 8-1
        shares.append(1.0 - masses[:, 0].sum() / (DENSITY * LENGTH))
    assert 0.0 < shares[1] < 0.6 * shares[0] < 0.1


def test_a_body_on_a_hinge_has_its_inertia_about_it() -> None:
    """Turning base about the hinge: all of it, by Steiner; shaken across its lever: `(m d)^2 / I`."""
    inertia = '<inertia ixx="0.3" iyy="0.2" izz="0.4" ixy="0" ixz="0" iyz="0"/>'
    text = (
        f'<robot name="pendulum"><link name="l0"/><link name="body"><inertial><origin xyz="0.5 0 0"/><mass value="2"/>{inertia}'
        '</inertial></link><joint name="turn" type="revolute"><parent link="l0"/><child link="body"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="1" velocity="1"/><dynamics damping="0.6" friction="0"/></joint></robot>'
    )
    robot = sr.load_model(text, springs={"turn": 7.0}, tip="body")
    modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, ()), mass_damping=0.25)
    about = 0.2 + 2.0 * 0.5**2
    assert modes.effective_masses[0] == pytest.approx([0, 0, 1.0 / about, 0, about, 0], abs=1e-14)
    omega = np.sqrt(7.0 / about)
    assert modes.frequencies[0] == pytest.approx(omega / (2.0 * np.pi), rel=1e-14)
    assert modes.damping_ratios[0] == pytest.approx((0.6 / about + 0.25) / (2.0 * omega), rel=1e-14)
    assert modes.eigenvalues.sum() == pytest.approx(-(0.6 / about + 0.25), rel=1e-12)


@pytest.mark.parametrize("kind", ["pcc", "pulled", "pcc_lumped", "helix", "helix_lumped"])
def test_the_file_of_a_robot_says_its_damping_time(kind: str) -> None:
    """0.05 s by default, in sections of constant strain, in hinges, and under muscles of given length."""
    robot = model(kind)
    assert np.allclose(damping_matrix(robot), 0.05 * np.diag(robot.stiffness), rtol=1e-12, atol=1e-12 * robot.stiffness.max())
    assert np.array_equal(damping_matrix(robot, 0.02), np.diag(0.02 * robot.stiffness))
    assert np.array_equal(damping_matrix(model("arm")), np.eye(4))


def test_stiff_servos_hold_and_soft_ones_do_not() -> None:
    """One motor, one spring, in closed form: two inertias on two springs, `det(K - w^2 M) = 0`."""
    arm = model("arm")
    found = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    held = sr.vibration_modes(arm, found)
    stiff = sr.vibration_modes(arm, found, servo_stiffness=1e9)
    assert stiff.frequencies[:4] == pytest.approx(held.frequencies, rel=1e-6)
    soft = sr.vibration_modes(arm, found, servo_stiffness=(500.0, 1000.0, 2000.0), rotor_inertia=0.02)
    assert (soft.shapes.shape, soft.motor_shapes.shape) == ((4, 7), (3, 7))
    assert np.all(soft.frequencies[:4] < held.frequencies)
    moved = np.concatenate([soft.motor_shapes, soft.shapes])
    assert np.allclose(moved.T @ soft.mass_matrix @ moved, np.eye(7), atol=1e-12)
    assert np.allclose(soft.stiffness_matrix[3:, 3:], found.tangent_stiffness)
    bare = sr.vibration_modes(arm, found, servo_stiffness=(500.0, 1000.0, 2000.0), rotor_inertia=0.0)
    assert np.allclose(soft.mass_matrix - bare.mass_matrix, np.diag([0.02] * 3 + [0.0] * 4), atol=1e-15)


REFUSED: list[tuple[dict[str, Any], dict[str, Any], type[Exception], str]] = [
    ({"wrench": (0, 0, 0, 1, 0, 0)}, {}, sr.ParameterError, "world-fixed moment modes are not orthogonal"),
    ({}, {"servo_stiffness": (1.0, 2.0)}, sr.ParameterError, r"shape \(3,\)"),
    ({}, {"servo_stiffness": -1.0}, sr.ParameterError, "zero or positive"),
    ({}, {"rotor_inertia": 1.0}, sr.ParameterError, "left out without servo_stiffness"),
    ({}, {"damping_time": -1.0}, sr.ParameterError, "zero or positive"),
    ({}, {"mass_damping": np.nan}, sr.ParameterError, "finite"),
    ({}, {"servo_stiffness": 0.0}, sr.NeutralEquilibrium, "mode without frequency"),
]


@pytest.mark.parametrize(("load", "options", "error", "told"), REFUSED)
def test_what_has_no_modes_is_refused(load: dict[str, Any], options: dict[str, Any], error: type[Exception], told: str) -> None:
    arm = model("arm")
    found = sr.solve_equilibrium(arm, (0.1, 0.2, 0.3), **load)
    with pytest.raises(error, match=told):
        sr.vibration_modes(arm, found, **options)


def test_an_unstable_equilibrium_and_massless_springs_are_refused_but_can_be_linearised() -> None:
    robot = rod(4, "sections")
    pushed = sr.solve_equilibrium(robot, (), (0, 0, -2.0 * BENDING * np.pi**2 / (4 * LENGTH**2)), method="fixed_point")
    assert not pushed.stable
    with pytest.raises(sr.ParameterError, match=r"least stiffness of the equilibrium = -0\.\d+: .* must be positive"):
        sr.vibration_modes(robot, pushed)
    assert np.linalg.eigvals(sr.linearize(robot, pushed).A).real.max() > 1.0
    bare = sr.load_model(slides('<link name="body"/>'), springs=SPRINGS, tip="body")
    for ask in (sr.vibration_modes, sr.linearize):
        with pytest.raises(sr.DescriptionError, match="moves no mass"):
            ask(bare, sr.solve_equilibrium(bare, ()))


# --- Linear models


@pytest.mark.study
def test_python_control_takes_it_and_steps_as_the_simulation(tool: Callable[[str], ModuleType]) -> None:
    """A force of 1 mN on the tip: the step response, linear, and the full motion by steps of 1 ms differ by its square."""
    control = tool("control")
    arm = model("arm")
    found = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    linear = sr.linearize(arm, found)
    system = linear.state_space()
    assert system.input_labels == list(linear.input_names)
    assert system.state_labels == list(linear.state_names)
    plain = control.ss(*linear)
    assert np.array_equal(plain.A, linear.A)
    assert np.array_equal(plain.D, linear.D)
    time = np.linspace(0.0, 0.5, 251)
    force = 1e-3
    place = linear.input_names.index("tip_force_z")
    moved = sr.simulate(
        arm, 0.5, (0.3, 0.6, -0.8), start=found, force=(0, 0, force), gravity=sr.EARTH_GRAVITY, time_step=1e-3, output_step=2e-3
    )
    response = control.step_response(system, T=time, input=place)
    expected = force * np.asarray(response.outputs).reshape(len(linear.C), -1)
    tip = (moved.tip_position - found.tip_position).T
    assert np.abs(tip - expected[:3]).max() < 2e-3 * np.abs(expected[:3]).max()  # the scheme at 1 ms: (omega h)^2 / 12
    torques = (moved.motor_torques - found.motor_torques).T
    assert np.abs(torques - expected[6:])[:, 1:].max() < 2e-2 * np.abs(expected[6:]).max()


@pytest.mark.study
def test_a_small_torque_moves_the_arm_as_its_linear_model(tool: Callable[[str], ModuleType]) -> None:
    """2 mN m more than what holds the arm: its motors accelerate, and its springs ring."""
    control = tool("control")
    arm = sr.load_model(sr.InflatableArm(rotor_inertia=0.02))
    found = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    linear = sr.linearize(arm, found, motors="torque")
    extra = np.array([0.0, 2e-3, 0.0])
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "time_step": 5e-4, "output_step": 2e-3}
    moved = sr.simulate(
        arm, 0.2, found.q_motors, start=found, motors="torque", torque=lambda t, q, qd: extra - found.motor_torques, **options
    )
    time = np.linspace(0.0, 0.2, len(moved.time))
    response = control.step_response(linear.state_space(), T=time, input=linear.input_names.index("motor_2_torque"))
    expected = extra[1] * np.asarray(response.outputs).reshape(len(linear.C), -1)
    assert np.abs((moved.tip_position - found.tip_position).T - expected[:3]).max() < 5e-3 * np.abs(expected[:3]).max()
    motors = np.abs((moved.q_motors - found.q_motors).T - expected[6:9]).max()
    assert motors < 5e-3 * np.abs(expected[6:9]).max()


# --- What users see of them


@pytest.mark.study
def test_modes_are_saved_drawn_and_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The command writes what the library finds; a saved result is computed again, and refused if it claims something else."""
    asked = ["modes", "inflatable_arm", "--motors", "0.3", "0.6", "-0.8", "--gravity", "--damping-time", "0.01"]
    asked += ["--servo-stiffness", "900", "--count", "2"]
    files = [str(tmp_path / name) for name in ("modes.npz", "modes.png", "modes.html")]
    assert cli.main([*asked, "-o", files[0], "--plot", files[1], "--page", files[2], "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    arm = model("arm")
    found = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    modes = sr.vibration_modes(arm, found, damping_time=0.01, servo_stiffness=900.0)
    assert answer["frequencies"] == modes.frequencies.tolist()
    assert [Path(file).name for file in answer["files"]] == ["modes.npz", "modes.png", "modes_1.html", "modes_2.html"]
    assert "mode 2" in (tmp_path / "modes_2.html").read_text(encoding="utf-8")
    assert cli.main(["view", "--result", files[0], "--html", str(tmp_path / "view.html")]) == 0
    assert f"mode 1 of 7, {modes.frequencies[0]:.4g} Hz" in capsys.readouterr().out
    saved = sr.load_result(files[0])
    assert np.array_equal(saved.shapes, modes.shapes)
    assert np.array_equal(saved.motor_shapes, modes.motor_shapes)
    arrays = dict(np.load(files[0]))
    np.savez(tmp_path / "other.npz", **arrays | {"frequencies": 1.001 * arrays["frequencies"]})
    with pytest.raises(sr.FileFormatError, match="not those of its equilibrium"):
        sr.load_result(tmp_path / "other.npz")
    rows = sr.save_csv(modes, tmp_path / "modes.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("mode,frequency [Hz],damping ratio [-]")
    assert [float(cell) for cell in rows[3].split(",")[:3]] == [3.0, modes.frequencies[2], modes.damping_ratios[2]]
    assert cli.main(["modes", "inflatable_arm", "--force", "-500", "0", "0.1", "--count", "0"]) == 2
    capsys.readouterr()
    assert cli.main(["modes", "inflatable_arm", "--servo-stiffness", "1", "2"]) == 2
    assert "motor_3 [N m/rad]" in capsys.readouterr().err


def test_a_swing_reaches_its_size_and_passes_the_equilibrium() -> None:
    robot = rod(4, "sections")
    modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, (), (0.3, 0, 0)))
    for mode in (1, 5, 9):
        swing = modes.swing(mode, 0.05)
        assert np.array_equal(swing.at(0.0)[1], modes.equilibrium.q_springs)
        moved, shape = swing.at(0.25)[1] - swing.at(0.0)[1], modes.shapes[:, mode - 1]
        assert np.linalg.norm(moved / np.linalg.norm(moved) - shape / np.linalg.norm(shape)) < 1e-12
        tip = swing.tip_position
        assert np.linalg.norm(tip[-1] - tip[16]) < 0.05 * 1.2
    with pytest.raises(sr.ParameterError, match="every section"):
        modes.swing(1, 50.0)
    with pytest.raises(sr.ParameterError, match="mode"):
        modes.swing(25, 0.1)


def test_the_figure_has_a_panel_for_each_mode(tool: Callable[[str], ModuleType]) -> None:
    """Titles tell the frequencies; the ends are on both sides of the equilibrium, and modes that only twist stay on it."""
    tool("matplotlib")
    from softrobots.view.figures.vibrations import mode_shapes

    robot = model("pcc")
    modes = sr.vibration_modes(robot, sr.solve_equilibrium(robot, robot.relaxed_motors))
    figure = mode_shapes(modes, shown=5)
    panels = figure.axes[:5]
    for panel, frequency in zip(panels, modes.frequencies, strict=False):
        assert f"{frequency:.4g} Hz" in panel.get_title()
        one, other, middle = (np.column_stack(line.get_data()) for line in panel.lines)
        aside = [np.linalg.norm(line - middle, axis=1).max() for line in (one, other)]
        assert aside[0] == pytest.approx(aside[1], rel=0.05, abs=1e-6)
        assert (aside[0] < 1e-3) == ("twists" in panel.get_title())
    with pytest.raises(sr.ParameterError, match="VibrationModes"):
        mode_shapes(robot)
    rigid = sr.load_model(sr.InflatableArm(), springs=dict.fromkeys(model("arm").spring_joints))
    with pytest.raises(sr.ParameterError, match="at least one"):
        mode_shapes(sr.vibration_modes(rigid, sr.solve_equilibrium(rigid, rigid.relaxed_motors)))
