"""Derivatives of equilibria by parameters, against solved equilibria of robots loaded with other values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pytest

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.model_change import differences, model_change
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.model.numbers import model_numbers
from tests.support.foreign import BRANCHED, SPRINGS

FORCES = {"force": (0.0, 10.0, -11.0), "gravity": sr.EARTH_GRAVITY}
"""A load with a potential."""
MOMENTS = {"wrench": {"tip": (1.0, 5.0, -5.0, 0.5, -0.3, 0.8)}, "gravity": (1.0, -2.0, -9.0)}
"""A load without."""
LIGHT = {"wrench": {"tip": (0.5, 1.0, -1.0, 0.05, -0.03, 0.08)}, "gravity": sr.EARTH_GRAVITY}
"""A load for soft robots."""
WEAK = {"force": (0.2, 0.1, -0.1), "gravity": sr.EARTH_GRAVITY}
"""A load for thin ones."""

PCC = {"segment_lengths": (0.3, 0.25), "elastic_sections": 2}
THIN = {"segment_lengths": (0.06, 0.06), "elastic_sections": 2}


class Case(NamedTuple):
    """A robot at actuator coordinates under a load, and parameters of it."""

    robot: Any
    motors: tuple[float, ...] | None
    """Actuators; None: relaxed."""
    load: Mapping[str, Any]
    names: tuple[str, ...]


ARM = (0.3, 0.6, -0.8)
TWO_HINGES = {"link_model": "two_hinges", "torsion": True, "shear_modulus": 3e7, "rest_up": 0.1, "young_modulus": 1.4e8}
CASES = {
    "arm": lambda: Case(sr.InflatableArm(), ARM, MOMENTS, ("link_lengths[1]", "hinge_offset", "density", "link[2].rest_up")),
    "plateau": lambda: Case(sr.InflatableArm(max_moment=12.0), ARM, FORCES, ("max_moment", "link[2].stiffness")),
    "slack": lambda: Case(sr.InflatableArm(moment_law="slack_wall"), ARM, FORCES, ("pressure", "stiffness", "rest_side")),
    "two_hinges": lambda: Case(sr.InflatableArm(**TWO_HINGES), ARM, MOMENTS, ("link[1].young_modulus", "wall_thickness")),
    "wrist": lambda: Case(
        sr.InflatableArm(wrist=(0.1, 0.05), payload=0.5), (*ARM, 0.1, 0.2, 0.3), FORCES, ("wrist[1]", "wrist_mass", "payload")
    ),
    "given lengths": lambda: Case(sr.PccArm(**PCC), None, LIGHT, ("muscle_distance", "segment_lengths[1]", "axial_stiffness")),
    "four given lengths": lambda: Case(
        sr.PccArm(**PCC, muscle_azimuths=(0.0, 1.0, 3.0, 4.5)), None, LIGHT, ("muscle_azimuths[2]", "bending_stiffness")
    ),
    "given tensions": lambda: Case(
        sr.PccArm(chain="lumped", hinges=3, kind="tension"), (5, 20, 0, 10, 0, 3), LIGHT, ("offset[2]", "torsional_stiffness")
    ),
    "pressures": lambda: Case(
        sr.PccArm(**PCC, kind="mckibben"), (5e4, 1e5, 0, 1e4, 0, 3e4), LIGHT, ("muscle_braid_angle", "muscle_diameter")
    ),
    "chambers": lambda: Case(sr.PccArm(**PCC, kind="pressure"), (5e3, 2e4, 0, 1e4, 0, 3e3), LIGHT, ("muscle_area",)),
    "tendons": lambda: Case(
        sr.TendonArm(**THIN),  # the first is slack
        (0.058, 0.064, 0.062, 0.12, 0.118, 0.123),
        WEAK,
        ("tendon_pretension", "tendon_stiffness", "tendon_distance", "segment[1].young_modulus"),
    ),
    "stiff tendons": lambda: Case(sr.TendonArm(**THIN, kind="length"), None, WEAK, ("backbone_radius", "segment_lengths[2]")),
    "helix": lambda: Case(sr.HelixTube(length=0.3, elastic_sections=3), None, LIGHT, ("contraction", "diameter", "length")),
    "lumped helix": lambda: Case(sr.HelixTube(length=0.3, chain="lumped", hinges=4), None, LIGHT, ("angle", "density")),
    "foreign": lambda: Case(
        sr.load_model(BRANCHED, springs=SPRINGS, tip="finger"), None, FORCES, ("joint[*].stiffness", "joint[*].rest")
    ),
}  # fmt: skip
IN_SHORT = ("arm", "tendons", "foreign")


def answers(found: sr.Equilibrium) -> tuple[FloatArray, ...]:
    """What derivatives are compared of: position and rotation of the tip, strains, loads on the actuators."""
    pose, strains = found.transform_tip_to_world, found.model.structure.strains(found.q_motors, found.q_springs)
    return np.array(pose.translation), np.array(pose.rotation), np.asarray(strains), found.motor_torques


def solved_difference(parameters: ParameterSet, along: FloatArray, case: Case, at: sr.Equilibrium) -> list[FloatArray]:
    """Fourth-order difference of solved equilibria along a change of the parameters; rotation as a vector."""
    found, step = [], 3e-4
    for number in (-2, -1, 1, 2):
        model = parameters.model(parameters.values + number * step * along)
        solved = sr.solve_equilibrium(model, at.q_motors, **case.load, q_springs0=at.q_springs, tolerance=1e-13)
        found.append(answers(solved))
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)
    position, rotation, strains, loads = (
        sum(weight * one[part] for weight, one in zip(weights, found, strict=True)) for part in range(4)
    )
    spin = rotation @ answers(at)[1].T
    turn = 0.5 * np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])
    return [np.concatenate([position, turn]), strains, loads]


@pytest.mark.parametrize("kind", [name if name in IN_SHORT else pytest.param(name, marks=pytest.mark.study) for name in CASES])
def test_derivatives_are_those_of_solved_equilibria(kind: str) -> None:
    case = CASES[kind]()
    parameters = ParameterSet.of(case.robot, case.names)
    model, signs = parameters.present, np.random.default_rng(0).choice([-1.0, 1.0], len(parameters.names))
    motors = model.relaxed_motors if case.motors is None else case.motors
    found = sr.solve_equilibrium(model, motors, **case.load, tolerance=1e-13)
    along = signs * np.where(parameters.values == 0.0, 1.0, np.abs(parameters.values))
    at, change = EquilibriumDerivatives(model, States.of([found])), model_change(parameters)
    outputs = [
        Outputs(frame=model.tip, pose=np.eye(6)[None]),
        Outputs(strains=np.eye(at.strains.shape[1])[None]),
        Outputs(loads=np.eye(model.n_motors)[None]),
    ]
    counts = np.zeros(len(along), dtype=bool)
    for rows, solved in zip(outputs, solved_difference(parameters, along, case, found), strict=True):
        slopes = AdjointRows(at, rows).by_numbers(change)[0]
        counts |= np.any(slopes, axis=0)
        # the difference itself has errors of some 1e-9: 1e-13 of the solver, enlarged by the step, and terms of fourth order
        np.testing.assert_allclose(
            slopes @ along, solved, rtol=0.0, atol=1e-8 * max(float(np.abs(solved).max(initial=0.0)), 1e-3)
        )
    assert counts.all()


@pytest.mark.study
def test_parameters_that_move_at_once_have_the_derivatives_that_they_have_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of values of single tendons, away from those of the robot, with half as many robots loaded at most."""
    names = ("young_modulus", "tendon[*].tendon_stiffness", "tendon[*].tendon_distance", "tendon[*].tendon_azimuth_deviation")
    robot = sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=1)
    parameters = ParameterSet.of(robot, names)
    values = parameters.values + 0.02 * np.where(parameters.values == 0.0, 1.0, parameters.values)
    loads: list[float] = []
    load = ParameterSet.model
    monkeypatch.setattr(ParameterSet, "model", lambda self, at: loads.append(1.0) or load(self, at))
    model_change(parameters, 0.99 * values)  # the first tells which numbers each changes
    loads.clear()
    change = model_change(parameters, values)
    assert len(loads) <= len(values)  # twice as many and one where each moves alone
    base, at = model_numbers(parameters.model(values)), dict[str, FloatArray]()
    for place, one in enumerate(parameters.parameters):
        row = np.arange(len(values)) == place
        alone = differences(one, values[place], base, lambda v, row=row: parameters.numbers(np.where(row, v, values)))
        for name in ("laws", "path_arms", "stiffness", "path_rest"):
            at.setdefault(name, np.zeros((base[name].size, len(values))))[:, place] = alone[name].ravel()
    for name, slopes in at.items():  # the same two robots in both, of which numbers differ in rounding at most
        np.testing.assert_allclose(change.by_number.get(name, np.zeros_like(slopes)), slopes, rtol=1e-9, atol=1e-12)
