"""Derivatives of robots with sections and actuators whose parameters differ from row to row, read from recorded expansions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.identification.model_change import model_change
from softrobots.identification.parameters import ParameterSet
from softrobots.learning import general_solver
from softrobots.learning.differentiable import Differentiable
from softrobots.learning.recorded_models import RecordedModels

DOWN = (0.0, 0.0, -9.81)
ROBOTS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "pcc": (
        sr.PccArm(elastic_sections=2),
        (
            "segment_lengths[*]",
            "bending_stiffness[*]",
            "torsional_stiffness",
            "muscle_distance",
            "linear_density",
            "rest_bend_x",
        ),
    ),
    "lumped pcc": (sr.PccArm(chain="lumped", elastic_sections=1), ("bending_stiffness", "rest_twist")),
    "pressure": (sr.PccArm(kind="pressure", elastic_sections=2), ("muscle_area", "muscle_distance")),
    "braided": (sr.PccArm(kind="mckibben", elastic_sections=2), ("muscle_diameter", "muscle_braid_angle")),
    "tendons": (
        sr.TendonArm(elastic_sections=2),
        ("segment_lengths[*]", "young_modulus", "tendon_distance", "tendon_stiffness", "tendon_pretension", "offset"),
    ),
    "tensions": (
        sr.TendonArm(kind="tension", elastic_sections=2),
        ("segment_lengths[*]", "young_modulus", "tendon_distance", "linear_density"),
    ),
    "given tensions": (sr.load_model(sr.PccArm(elastic_sections=2), muscles="forces"), ("radius", "muscle_azimuth_deviation")),
    "helix": (sr.HelixTube(elastic_sections=6), ("young_modulus", "length", "wall_thickness", "density")),
    "joint springs": (
        sr.load_model(sr.PccArm(chain="lumped", elastic_sections=1), muscles="forces"),
        ("joint[section_1_1_bend_x].stiffness", "joint[section_1_1_bend_y].rest", "linear_density"),
    ),
    "given spring": (
        sr.load_model(sr.PccArm(chain="lumped", elastic_sections=1), springs={"section_1_1_bend_x": 77.0}, muscles="forces"),
        ("bending_stiffness", "linear_density"),
    ),
    "plateau": (sr.InflatableArm(max_moment=30.0), ("link[*].max_moment", "radius", "cap_mass")),
    "slack wall": (sr.InflatableArm(moment_law="slack_wall", pressure=3e4), ("pressure", "radius", "density")),
    "springs of a file": (sr.load_model(sr.InflatableArm().urdf()), ("joint[*].stiffness", "joint[spring_1_up].rest")),
}


def _rows(given: Any, count: int) -> np.ndarray:
    present = np.where(given.values == 0.0, 0.1, given.values)
    return np.asarray(given.values + np.random.default_rng(3).uniform(-0.02, 0.02, (count, len(present))) * present)


@pytest.mark.parametrize("name", ROBOTS)
def test_numbers_of_robots_change_as_those_of_loaded_ones(name: str) -> None:
    """By Pinocchio's parser and the readers of tags, with differences of fourth order."""
    robot, names = ROBOTS[name]
    given = ParameterSet.of(robot, names)
    each = [tuple(row) for row in _rows(given, 1).tolist()]
    models = [given.model(values) for values in each]
    found = RecordedModels(given).changes(each, models)
    assert list(found) == each
    for values, model in zip(each, models, strict=True):
        loaded, told = model_change(given, values, fourth_order=True, model=model).by_number, found[values].by_number
        for number in loaded.keys() | told.keys():
            slopes = loaded.get(number, np.zeros(1))
            assert told.get(number, np.zeros(1)) == pytest.approx(
                slopes * np.ones_like(told.get(number, slopes)), rel=1e-8, abs=1e-9 * np.abs(slopes).max() + 1e-10
            )


def test_robots_that_no_tape_tells_are_loaded() -> None:
    """Where the recorded expansion is gone, and where a parameter has no room to either side."""
    given = ParameterSet.of(sr.PccArm(chain="lumped", elastic_sections=1), "linear_density")
    values = tuple((1.01 * given.values).tolist())
    model = given.model(values)
    assert RecordedModels(given).changes([values], [model])
    given.variants.expansions.tapes.clear()
    assert not RecordedModels(given).changes([values], [model])
    narrow = ParameterSet(given.present, (replace(given.parameters[0], lower=values[0], upper=values[0]),), {})
    assert not RecordedModels(narrow).changes([values], [narrow.model(values)])


@pytest.mark.parametrize("name", ["pcc", "tensions", "helix"])
def test_gradients_by_parameters_of_each_row_are_differences_of_equilibria(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In both modes, which are transposes of each other; no robot is loaded for derivatives."""
    robot, names = ROBOTS[name]
    solver = Differentiable("equilibrium", robot, names, gravity=DOWN, backend=None, threads=1, failed="raise")
    rows, random = _rows(solver._set, 2), np.random.default_rng(5)
    motors = solver.model.relaxed_motors + (2.0 if name == "tensions" else 0.0)
    inputs = [np.tile(motors, (2, 1)), 0.1 * random.normal(size=(2, 3)), rows]
    results = solver.solve(*inputs)
    monkeypatch.setattr(general_solver, "model_change", None)
    rates = random.uniform(-1.0, 1.0, rows.shape) * np.where(solver.present == 0.0, 0.1, solver.present)
    pushed = solver.push(inputs, results, [None, None, rates])
    weights = [random.normal(size=one.shape) for one in results]
    pulled = np.asarray(solver.pull(inputs, results, weights, [None, None, (2,)])[2])

    def solved(row: int, along: float) -> np.ndarray:
        model = solver._set.model(rows[row] + along * rates[row])
        found = sr.solve_equilibrium(model, inputs[0][row], inputs[1][row], gravity=DOWN, tolerance=1e-13)
        return np.concatenate([found.q_springs, found.tip_position])

    for row in range(2):
        near, far = (solved(row, one * 1e-3) - solved(row, -one * 1e-3) for one in (1.0, 2.0))
        slope = (8.0 * near - far) / 12e-3
        own = np.concatenate([one[row] for one in pushed])
        assert own == pytest.approx(slope, abs=1e-8 * np.abs(slope).max() + 1e-10)
        weighted = np.concatenate([one[row] for one in weights]) @ own
        assert pulled[row] @ rates[row] == pytest.approx(weighted, rel=1e-10, abs=1e-12)
