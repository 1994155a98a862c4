"""Motion of robots with actuators of every kind: energy, the rest that it comes to, and small motion."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr

FORCE = (0.05, 0.02, 0.0)
INPUTS = {"elastic": -0.002, "tension": 4.0, "pressure": 5e4, "mckibben": 1e5}


def arm(kind: str) -> tuple[sr.SoftModel, np.ndarray]:
    """A short arm of one section a segment, and inputs of which the first differs from rest."""
    if kind in ("elastic", "tension"):
        robot = sr.TendonArm(segment_lengths=(0.06, 0.05), elastic_sections=1, kind=kind)
    else:
        robot = sr.PccArm(segment_lengths=(0.3,), elastic_sections=1, kind=kind)
    model = sr.load_model(robot)
    inputs = model.relaxed_motors + (2e4 if kind == "mckibben" else 0.0)
    inputs[0] += INPUTS[kind]
    return model, inputs


@pytest.mark.study
@pytest.mark.parametrize("kind", INPUTS)
def test_energy_is_kept_and_held_tendons_do_no_work(kind: str) -> None:
    """Released from a load without damping: 40 steps of the midpoint rule, which keeps energy to second order."""
    model, inputs = arm(kind)
    loaded = sr.solve_equilibrium(model, inputs, FORCE)
    balances = []
    for step in (2e-4, 1e-4):
        energy = sr.simulate(model, 8e-3, inputs, start=loaded, damping_time=0.0, time_step=step).energy
        balances.append(np.abs(energy.balance).max())
        assert energy.kinetic.max() > 1e3 * balances[-1]
        if kind == "elastic":
            assert not energy.motor_work.any()
        else:
            assert energy.motor_work.any()  # what keeps a tension or a pressure moves with the actuator
    assert balances[1] < 0.3 * balances[0] or balances[1] < 1e-7 * energy.kinetic.max()  # rounding


@pytest.mark.study
@pytest.mark.parametrize("kind", INPUTS)
def test_it_comes_to_rest_in_the_equilibrium(kind: str) -> None:
    model, inputs = arm(kind)
    if kind == "elastic":
        inputs[1:3] += 0.003  # slack at rest
    start = sr.solve_equilibrium(model, model.relaxed_motors)
    rest = sr.solve_equilibrium(model, inputs)
    motion = sr.simulate(model, 20.0, inputs, start=start, damping_time=2.0, time_step=0.1)
    assert motion.tip_position[-1] == pytest.approx(rest.tip_position, abs=2e-5)  # e^-(20 s / 2 s) of 0.02 to 0.2 m
    assert np.linalg.norm(rest.tip_position - start.tip_position) > 5e-3
    if kind == "elastic":
        assert (rest.muscle_forces[1:3] == 0.0).all()
        assert motion.motor_torques[-1] == pytest.approx(rest.motor_torques, abs=1e-2)


@pytest.mark.parametrize("kind", INPUTS)
def test_the_linear_model_at_rest_is_the_change_of_equilibria(kind: str) -> None:
    """`-A^-1 B` of each input, against differences of solved equilibria."""
    model, inputs = arm(kind)
    linear = sr.linearize(model, sr.solve_equilibrium(model, inputs, FORCE))
    gain = linear.D[:3] - linear.C[:3] @ np.linalg.solve(linear.A, linear.B)
    for actuator in range(model.n_motors):
        change = np.zeros(model.n_motors)
        change[actuator] = 1e-4 * INPUTS[kind]
        ends = [sr.solve_equilibrium(model, inputs + sign * change, FORCE).tip_position for sign in (1.0, -1.0)]
        expected = (ends[0] - ends[1]) / (2.0 * change[actuator])
        # Second order in the change; the equilibria are solved to 1e-10 of the load.
        assert gain[:, actuator] == pytest.approx(expected, rel=1e-4, abs=1e-4 * np.abs(gain).max())
    words = {"elastic": ("motor", "m"), "tension": ("tension", "N")}.get(kind, ("pressure", "Pa"))
    assert linear.input_names[0].endswith(f"_1_1_{words[0]}")
    assert linear.input_units[0] == words[1]
