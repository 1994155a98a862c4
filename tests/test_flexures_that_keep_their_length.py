"""Flexures without stretch: three coordinates each, of which the map, the statics, the motion and the files know."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.constant_curvature.strain_chain import SectionChain
from softrobots.description.tag_reader import read_tags
from softrobots.dynamics.damping import damping_matrix
from softrobots.identification.parameters import ParameterSet
from softrobots.model.soft_model import SoftModel
from tests.support.planar_rod import PlanarRod
from tests.support.rods import elastica_tip

GRAVITY = (1.0, -2.0, -9.0)
FORCE = (0.05, 0.03, 0.01)
ROD: dict[str, Any] = {
    "segment_lengths": (0.37, 0.2), "muscle_azimuths": (), "bending_stiffness": 0.021, "torsional_stiffness": 0.017,
    "linear_density": 0.083, "radius": 0.0043, "chain": "flexures", "hinges": 4, "rest_bend_x": 0.3, "rest_twist": -0.2,
}  # fmt: skip


def rod(**changes: Any) -> SoftModel:
    return sr.load_model(sr.PccArm(**ROD | changes))


KEPT = rod(extension=False)


def test_they_have_three_coordinates_each() -> None:
    assert KEPT.n_springs == 3 * 8
    assert [name for name in KEPT.spring_joints if name.endswith("stretch")] == []
    assert sr.PccArm(**ROD, extension=False).n_joints == KEPT.pinocchio.nv == 6 * 8  # the chord still changes
    found = sr.solve_equilibrium(KEPT, (), FORCE, gravity=GRAVITY)
    assert found.stable
    np.testing.assert_array_equal(found.strains[:, 3], 1.0)
    # of an arc of length h / 2 that turns by a, without much twist, the chord is h / 2 sin(a / 2) / (a / 2), less that at rest
    joints, length = found.q.reshape(-1, 6), np.repeat([0.37, 0.2], 4) / 8
    turn = np.linalg.norm(found.strains[:, :3], axis=1) * 2.0 * length
    straight = np.abs(found.strains[:, 2]) < 0.05 * np.linalg.norm(found.strains[:, :2], axis=1)
    assert straight.any()
    np.testing.assert_allclose((joints[:, 2] / length)[straight], np.sinc(turn / (2 * np.pi))[straight] - 1.0, rtol=1e-2)


def test_the_map_is_that_of_sections_whose_stretch_is_one(rng: np.random.Generator) -> None:
    """Values and slopes; its curvature and the products of velocities by central differences of the slopes."""
    z, rates, weights, length = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=(5, 6)), np.full(5, 0.1)
    kept, whole = SectionChain(z, length), SectionChain(np.pad(z, ((0, 0), (0, 1))), length)
    np.testing.assert_array_equal(kept.positions, whole.positions)
    np.testing.assert_array_equal(kept.lengths, length)
    np.testing.assert_allclose(kept.first, whole.first[..., :3], rtol=0, atol=1e-14)
    step, units = 1e-5, np.eye(3)
    around = [[SectionChain(z + sign * step * unit, length).first for unit in units] for sign in (1.0, -1.0)]
    slopes = np.einsum("bnja,nj->nab", (np.array(around[0]) - around[1]) / (2 * step), weights)
    np.testing.assert_allclose(kept.curvature(weights), slopes, rtol=0, atol=1e-8)
    ahead, behind = (SectionChain(z + sign * step * rates, length).first @ rates[..., None] for sign in (1.0, -1.0))
    np.testing.assert_allclose(kept.velocity_product(rates), ((ahead - behind) / (2 * step))[..., 0], rtol=0, atol=1e-7)


def test_they_are_the_limit_of_stiff_ones() -> None:
    """Tip and frequencies of an axial stiffness a hundred times as large differ by a hundredth."""
    found = sr.solve_equilibrium(KEPT, (), FORCE, gravity=GRAVITY, tolerance=1e-13)
    expected = sr.vibration_modes(KEPT, found)
    tips, rates = [], []
    for axial in (2.1e3, 2.1e5):
        stiff = rod(axial_stiffness=axial)
        near = sr.solve_equilibrium(stiff, (), FORCE, gravity=GRAVITY, tolerance=1e-13)
        tips.append(np.linalg.norm(near.tip_position - found.tip_position))
        rates.append(np.abs(sr.vibration_modes(stiff, near).frequencies[:6] / expected.frequencies[:6] - 1.0).max())
    assert tips[0] / tips[1] == pytest.approx(100.0, rel=0.01)
    assert rates[0] / rates[1] == pytest.approx(100.0, rel=0.05)
    assert tips[1] < 1e-6


def test_a_column_buckles_at_eulers_load() -> None:
    """`pi^2 EI / 4 l^2`, of a column that does not stretch: 2.3e-5 low at ten."""
    fields = {"segment_lengths": (0.57,), "rest_bend_x": 0.0, "rest_twist": 0.0, "hinges": 10, "extension": False}
    found = sr.critical_load(rod(**fields), (), direction=(0.0, 0.0, -1.0))
    assert found == pytest.approx(np.pi**2 * ROD["bending_stiffness"] / (4.0 * 0.57**2), rel=3e-5)


def test_a_cantilever_is_the_inextensible_elastica() -> None:
    """A tip that turns by 45 degrees: of order 3.5 in their number, also where stiff ones have a stretch of 1e-7."""
    bending, length, load = 0.02, 0.5, 2.0
    x, z, _ = elastica_tip(bending, length, load * bending / length**2)
    errors = []
    for count in (12, 48):
        fields = {"bending_stiffness": bending, "segment_lengths": (length,), "rest_bend_x": 0.0, "rest_twist": 0.0}
        one = rod(**fields, hinges=count, extension=False)
        tip = sr.solve_equilibrium(one, (), (load * bending / length**2, 0.0, 0.0), tolerance=1e-14).tip_position
        errors.append(np.linalg.norm(tip - (x, 0.0, z)))
    assert np.log2(errors[0] / errors[1]) / 2 == pytest.approx(3.55, abs=0.1), errors
    assert errors[1] < 1e-7, errors


@pytest.mark.parametrize(("order", "damping"), [(2, 1e-3), (4, 0.0)])
def test_compiled_motion_is_that_of_simulate(order: int, damping: float) -> None:
    """Out of all planes. What is undamped keeps its energy: to second order in the steps of the midpoint rule, to fourth."""
    start = sr.solve_equilibrium(KEPT, (), FORCE, gravity=GRAVITY)
    options: dict[str, Any] = {"start": start, "gravity": GRAVITY, "damping_time": damping, "time_step": 2.5e-3, "order": order}
    slow = sr.simulate(KEPT, 0.05, (), **options)
    fast = sr.compile(KEPT, backend="python").simulate(0.05, (), **options)
    assert np.ptp(slow.tip_position, axis=0).max() > 1e-3
    for name in ("q_springs", "tip_position"):
        size = np.abs(getattr(slow, name)).max()
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), rtol=0, atol=1e-9 * size)
    kept = slow.energy.kinetic + slow.energy.elastic + slow.energy.potential
    if damping == 0.0:
        assert np.ptp(kept) < 1e-3 * slow.energy.kinetic.max()


@pytest.mark.study
@pytest.mark.timeout(600)
def test_a_steel_rod_swings_as_the_planar_rod() -> None:
    """Eighteen of them by steps of 2 ms, undamped, released from 0.39 m aside: 0.2 mm off in a second, 0.5 mm in ten."""
    steel = PlanarRod(0.6, 0.8e-3, 200e9, 7850.0, gravity=(0.0, -9.81), bends=11)
    path = steel.tips(steel.equilibrium((0.6, 0.0)), 1.0, 20, 1300)
    model = rod(
        segment_lengths=(steel.length,), radius=steel.radius, linear_density=steel.density * steel.area, rest_bend_x=0.0,
        bending_stiffness=steel.bending, torsional_stiffness=steel.bending / 1.5, rest_twist=0.0, hinges=18, extension=False,
    )  # fmt: skip
    gravity = (0.0, 0.0, -9.81)
    start = sr.solve_equilibrium(model, (), (0.6, 0.0, 0.0), gravity=gravity)
    options: dict[str, Any] = {"gravity": gravity, "damping_time": 0.0, "time_step": 2e-3, "order": 4, "output_step": 0.05}
    moved = sr.compile(model).simulate(1.0, (), start=start, **options)
    assert np.linalg.norm(moved.tip_position[:, [0, 2]] - path, axis=1).mean() < 3e-4


def test_damping_of_the_file_is_the_damping_time() -> None:
    model = rod(extension=False, damping_time=0.02)
    np.testing.assert_allclose(damping_matrix(model), np.diag(0.02 * model.stiffness), rtol=1e-12)


def test_sensitivities_are_differences_of_equilibria() -> None:
    """By lengths, which the map of the sections depends on, too; axial stiffness has no effect."""
    of_first = [f"segment[1].{name}" for name in ("segment_lengths", "rest_twist", "linear_density", "axial_stiffness")]
    robot = sr.PccArm(**ROD | {"linear_density": (0.083, 0.09)}, extension=False)
    parameters = ParameterSet.of(robot, (*of_first, "segment[2].bending_stiffness"))
    load = {"force": FORCE, "gravity": GRAVITY, "tolerance": 1e-14}
    slopes = sr.sensitivity(parameters.present, sr.solve_equilibrium(parameters.present, (), **load), parameters)

    def tip(shift: np.ndarray) -> np.ndarray:
        return np.array(sr.solve_equilibrium(parameters.model(parameters.values + shift), (), **load).tip_position)

    for place, value in enumerate(parameters.values.tolist()):
        step = np.zeros(5)
        step[place] = 1e-4 * abs(value)
        expected = (8 * (tip(step) - tip(-step)) - tip(2 * step) + tip(-2 * step)) / (12 * step[place])
        np.testing.assert_allclose(slopes.tip_position[:, place], expected, rtol=0, atol=1e-7 * np.abs(expected).max() + 1e-14)
    assert np.all(slopes.tip_position[:, 3] == 0.0)
    assert np.abs(slopes.tip_position[:, 0]).max() > 0.1


def test_text_and_result_files_bring_them_back(tmp_path: Path) -> None:
    again = sr.load_model(KEPT.urdf)
    assert again.spring_joints == KEPT.spring_joints == sr.load_model(KEPT.urdf.replace('"inf"', '" INF"')).spring_joints
    found = sr.solve_equilibrium(again, (), FORCE, gravity=GRAVITY)
    sr.save_result(found, tmp_path / "found.npz")
    np.testing.assert_array_equal(sr.load_result(tmp_path / "found.npz").q_springs, found.q_springs)


def test_what_needs_stretch_is_refused() -> None:
    text = KEPT.urdf
    for changed, words in (
        (text.replace('EA="inf"', 'EA="2000.0"', 1), "EA inf of all sections"),
        (text.replace('EA="inf"', 'EA="-inf"', 1), "EA = '-inf'; a finite number"),
        (text.replace('rest="0.0 0.0 0.0 1.0"', 'rest="0.0 0.0 0.0 1.1"', 1), "the stretches 1.1, 1.0; required: 1"),
        (text.replace(' 1.0" rest', ' 0.9" rest', 1), "the stretches 1.0, 0.9; required: 1"),
        (
            text.replace(
                "</robot>",
                '<softrobots:inflated_link springs="section_1_1_bend_x" radius="0.1" pressure="1.0"/></robot>',
            ),
            "no inflated links with springs of sections",
        ),
        (
            text.replace(
                "</robot>",
                '<softrobots:muscle name="one" segment="1" azimuth="0.0" distance="0.01" rest_length="0.37" shortest="0.3" '
                'longest="0.4" weakest="-1.0" strongest="1.0"/></robot>',
            ),
            "no actuators",
        ),
    ):
        assert changed != text
        with pytest.raises(sr.DescriptionError, match=words):
            read_tags(changed)


def test_locked_strains_are_those_that_sections_have() -> None:
    with pytest.raises(sr.ParameterError, match="without sections that have such strains"):
        sr.compile(KEPT, backend="python", locked_strains=("stretch",))
    with pytest.raises(sr.ParameterError, match="rigid"):
        sr.compile(KEPT, backend="python", locked_strains=("bend_x", "bend_y", "twist"))
    planar = sr.compile(rod(extension=False, rest_twist=0.0), backend="python", locked_strains=("bend_x", "twist"))
    found = planar.equilibrium((), (0.05, 0.0, 0.0))
    assert np.all(np.delete(found.q_springs.reshape(-1, 3), 1, axis=1) == planar.model.rest.reshape(-1, 3)[:, [0, 2]])
