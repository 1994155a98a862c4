"""Compiled motion with dry friction: Coulomb's oscillator, `simulate` step by step, batches, what is remembered, and C."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.support.c_libraries import Controller
from tests.support.friction_bars import STICK, STIFFNESS, bar, bent, period, released, smooth

SAME = 1e-9  # relative: Newton's method of both engines ends at 1e-13 in a step, and friction halves what is left at each turn


def compiled(model: sr.SoftModel, **options: Any) -> CompiledModel:
    return sr.compile(model, backend="python", **options)


def assert_same(found: sr.Motion, expected: sr.Motion) -> None:
    """Coordinates, rates, loads and what friction takes."""
    for name in ("q_springs", "velocities", "motor_torques"):
        mine, theirs = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=SAME * np.abs(theirs).max(initial=0.0), err_msg=name)
    taken = expected.energy.dissipated
    np.testing.assert_allclose(found.energy.dissipated, taken, rtol=0, atol=SAME * taken[-1])


@pytest.mark.study
def test_the_swings_of_an_oscillator_fall_by_the_same_each_time_until_it_sticks() -> None:
    """From 9.5 times the friction over the stiffness it turns round at -7.5, 5.5, -3.5, 1.5, and stays at 0.5."""
    band = 0.01  # friction over stiffness [rad]
    model, swing = bar(band * STIFFNESS), period()
    options: dict[str, Any] = {"time_step": swing / 50.0, "output_step": swing / 50.0, "damping_time": 0.0}
    start = bent(model, 9.5 * band, band * STIFFNESS)
    motion = compiled(model).simulate(3.0 * swing, [], start=start, **options)
    angle = motion.q_springs[:, 1]
    slides = np.diff(angle[: int(2.6 * 50)])
    turns = angle[1 : len(slides)][slides[1:] * slides[:-1] < 0.0]
    # A part that turns round gives way by a stick, a hundredth of the band; the rows stand within (pi / 50)^2 / 2 of a turn.
    assert turns[:4] / band == pytest.approx([-7.5, 5.5, -3.5, 1.5], rel=0.003, abs=0.01)
    stuck = angle[int(2.6 * 50) :]
    assert stuck == pytest.approx(np.full(len(stuck), 0.5 * band), abs=2.0 * STICK)
    assert motion.energy.dissipated[-1] == pytest.approx(band * STIFFNESS * band * (17.0 + 13.0 + 9.0 + 5.0 + 1.0), rel=0.01)


BENDING = 0.02 * np.cos([0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0])  # of three muscles [m]
WINDING = [sr.Route(at=(0.01, 0.11), azimuth=(a, a + 2.0), distance=(0.0045, 0.004)) for a in (0.0, 2.1, 4.2)]
ROBOTS: dict[str, sr.PccArm | sr.TendonArm] = {
    "lengths": sr.PccArm(segment_lengths=(0.5,), elastic_sections=2, bending_friction=0.05),
    "lumped": sr.PccArm(segment_lengths=(0.5,), kind="tension", chain="lumped", hinges=2, bending_friction=0.05),
    "winding": sr.TendonArm(
        segment_lengths=(0.06, 0.06), elastic_sections=1, routing=WINDING, kind="elastic", bending_friction=(2e-3, 0.0)
    ),
    "guides": sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1, kind="elastic", guide_friction=0.3),
    "guides, lengths": sr.PccArm(segment_lengths=(0.5,), elastic_sections=2, guide_friction=0.3, bending_friction=0.05),
    "guides, lumped": sr.PccArm(segment_lengths=(0.5,), kind="tension", chain="lumped", hinges=2, guide_friction=0.3),
    "guides, winding": sr.TendonArm(
        segment_lengths=(0.06, 0.06), elastic_sections=1, routing=WINDING, kind="length", guide_friction=(0.3, 0.1)
    ),
}


def path(name: str, model: sr.SoftModel) -> Any:
    """Muscles that are pulled and let go, those of given lengths with jumps of their velocities."""
    if "lumped" in name:
        return lambda time: np.array([6.0, 1.0, 0.0]) * (smooth(time / 0.02) - smooth(time / 0.02 - 1.0))
    pull = BENDING if name.endswith("lengths") else np.array([-4e-3, 2e-3, 0.0])
    if name.endswith("lengths"):
        return lambda time: np.asarray(model.relaxed_motors + pull * min(time / 0.02, 1.0))
    return lambda time: np.asarray(model.relaxed_motors + pull * smooth(time / 0.02))


@pytest.mark.parametrize("name", ["lumped", *(pytest.param(one, marks=pytest.mark.study) for one in ROBOTS if one != "lumped")])
def test_motion_is_that_of_the_general_solver(name: str) -> None:
    model = sr.load_model(ROBOTS[name])
    options: dict[str, Any] = {"time_step": 5e-3, "output_step": 0.02, "gravity": (0.5, 0.0, -9.8), "force": (0.0, 0.1, 0.0)}
    driven = path(name, model)
    expected = sr.simulate(model, 0.04, driven, **options)
    fast = compiled(model)
    found = fast.simulate(0.04, driven, **options)
    assert_same(found, expected)
    loose = sr.load_model(replace(ROBOTS[name], bending_friction=0.0, guide_friction=0.0))
    free = sr.simulate(loose, 0.04, driven, **options)
    assert np.abs(free.q_springs - expected.q_springs).max() > 1e-3 * np.abs(expected.q_springs).max()  # friction is felt
    options["forces"] = [options.pop("force"), (0.0, 0.0, 0.0)]
    batch = fast.simulations(0.04, driven, **options)
    np.testing.assert_allclose(batch.q_springs[0], found.q_springs, rtol=0, atol=1e-12)


@pytest.mark.study
@pytest.mark.parametrize("fields", [{"bending_friction": 5e-4}, {"guide_friction": 0.1}])
def test_motions_go_on_from_others_and_from_files(fields: dict[str, float], tmp_path: Path) -> None:
    """Two halves are the whole, alone and in a batch: the second remembers where the sliders of the first are."""
    model, start = released(**fields)
    fast = compiled(model)
    options: dict[str, Any] = {"time_step": 1e-3, "output_step": 0.01}
    whole = fast.simulate(0.02, start.q_motors, start=start, **options)
    assert_same(whole, sr.simulate(model, 0.02, start.q_motors, start=start, **options))
    first = fast.simulate(0.01, start.q_motors, start=start, **options)
    for before in (first, sr.load_result(sr.save_result(first, tmp_path / "first.npz"))):
        second = fast.simulate(0.01, start.q_motors, start=before, **options)
        assert second.q_springs[-1] == pytest.approx(whole.q_springs[-1], abs=1e-9)
    at = sr.MotionState(model, 0.0, first.q_motors[-1], first.motor_velocities[-1], first.q_springs[-1], first.velocities[-1])
    forgot = fast.simulate(0.01, start.q_motors, start=at, **options)
    assert np.abs(forgot.q_springs[-1] - whole.q_springs[-1]).max() > 1e-6

    forces = np.array([(0.1, 0.2, 0.0), (0.0, -0.1, 0.0)])
    at_rest = fast.equilibria(start.q_motors, forces)
    together = fast.simulations(0.02, start.q_motors, starts=at_rest, **options)
    halves = fast.simulations(0.01, start.q_motors, starts=at_rest, **options)
    kept = sr.load_result(sr.save_result(halves, tmp_path / "batch.npz"))
    again = fast.simulations(0.01, start.q_motors, starts=kept, **options)
    np.testing.assert_allclose(again.q_springs[:, -1], together.q_springs[:, -1], rtol=0, atol=1e-12)
    for case, force in enumerate(forces):
        alone = fast.simulate(
            0.02, start.q_motors, start=sr.solve_equilibrium(model, start.q_motors, force.tolist()), **options
        )
        np.testing.assert_allclose(together.q_springs[case], alone.q_springs, rtol=0, atol=1e-8)


@pytest.mark.study
@pytest.mark.parametrize("guides", [0.0, 0.2])
def test_steps_in_c(guides: float, tmp_path: Path) -> None:
    """One step after the other, as a controller calls it, which keeps what friction remembers in the array."""
    model = sr.load_model(sr.PccArm(segment_lengths=(0.5,), elastic_sections=1, bending_friction=0.05, guide_friction=guides))
    fast, step = compiled(model), 5e-3

    def lengths(time: float) -> np.ndarray:
        return np.asarray(model.relaxed_motors + BENDING * (smooth(time / 0.05) - smooth(time / 0.05 - 1.0)))

    expected = fast.simulate(0.1, lengths, time_step=step, output_step=step, damping_time=1e-2)
    controller = Controller(fast, tmp_path, name="rubbing", motion=True)
    controller.put("DAMPING", 1e-2 * model.structure.strain_springs.stiffness)
    controller.put("TIME_STEP", [step])
    count = model.n_springs
    for row in range(20):
        motors = np.array([lengths(step * (row + share)) for share in (0.0, 0.5, 1.0)])
        for name, values in zip(("MOTORS_BEGIN", "MOTORS_MIDDLE", "MOTORS_END"), motors, strict=True):
            controller.put(name, values)
        assert controller.call("motion_step") == 0
        np.testing.assert_allclose(controller.get("POSITION", count), expected.q_springs[row + 1], rtol=0, atol=1e-11)
    assert np.abs(expected.motor_torques).max() > 0.5 * 0.05 / 0.04  # muscles 0.04 m aside work against friction


@pytest.mark.study
def test_machine_code_takes_chosen_steps() -> None:
    """numba, to a tolerance that a run with steps of a four hundredth of a swing confirms."""
    band = 0.02
    model, swing = bar(band * STIFFNESS), period()
    start = bent(model, 0.1, band * STIFFNESS)
    options: dict[str, Any] = {"start": start, "output_step": 0.7 * swing, "damping_time": 0.0}
    fast = sr.compile(model, backend="numba")
    motion = fast.simulate(0.7 * swing, [], tolerance=3e-4, **options)
    fine = sr.simulate(model, 0.7 * swing, [], time_step=swing / 400.0, **options)
    assert motion.tip_error is not None
    assert motion.tip_error <= 3e-4
    assert np.linalg.norm(motion.tip_position[-1] - fine.tip_position[-1]) < 3e-4
    again = fast.simulate(0.7 * swing, [], time_step=swing / 400.0, **options)
    assert_same(again, fine)
    assert fine.q_springs[-1, 1] < -band  # it has swung to the other side, and turned round


def test_single_steps_refuse_friction_by_name() -> None:
    fast = compiled(bar(1e-3))
    with pytest.raises(sr.ParameterError, match="without dry friction, for single steps"):
        fast.step(fast.model.rest, fast.model.rest, [])
