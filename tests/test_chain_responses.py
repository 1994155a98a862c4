"""Compiled derivatives of looped chains: those of the solvers on Pinocchio, and differences of compiled equilibria."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.learning.chain_responses import ChainResponses
from softrobots.learning.differentiable import Differentiable
from tests.support.learning_cases import CASES, OPTIONS, changes
from tests.support.routed_robots import ROBOTS as ROUTED
from tests.support.serial_chains import ROBOTS

ALONE = ("given lengths", "tensions", "tendons", "winding lengths", "helix")
QUICK = ("given lengths", "tendons")


@pytest.mark.parametrize("kind", [one if one in QUICK else pytest.param(one, marks=pytest.mark.study) for one in ALONE])
def test_compiled_derivatives_are_those_of_pinocchio(kind: str) -> None:
    """Of robots with parameters, in both modes; of rows that share a force, and of one that failed."""
    case = CASES[kind]()
    compiled = sr.compile(sr.load_model(case.robot), backend="python")
    options = OPTIONS | {"failed": "nan"}
    solver, plain = (Differentiable("equilibrium", one, case.names, **options) for one in (compiled, case.robot))
    rates = changes(case, solver)
    motors = np.array(case.motors) + np.array([[0.0], [1.0], [0.5]]) * rates[0]
    motors[2, :1] = np.nan
    inputs = [motors, np.array(case.force), solver.present]
    results = plain.solve(*inputs)
    random = np.random.default_rng(3)
    weights = [random.normal(size=part.shape) for part in results]
    own, other = (one.pull(inputs, results, weights, [(3,), (), ()]) for one in (solver, plain))
    for a, b in zip(own, other, strict=True):  # the results are in balance to 1e-12, the numbers of winding lengths by it
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * np.abs(b).max(initial=0.0))
    for given in ([rates[0], rates[1], None], [None, rates[1], None], rates):
        own, other = (one.push(inputs, results, given) for one in (solver, plain))
        for a, b in zip(own, other, strict=True):
            assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * np.nanmax(np.abs(b)), nan_ok=True)


CHAINS: dict[str, Any] = {"stacked": ROBOTS["stacked"], "on_an_arm": ROUTED["on_an_arm"], "lumped": ROUTED["lumped"]}
CHAINS |= {name: ROUTED[name] for name in ("lumped_winding", "lumped_coils")}


@pytest.mark.parametrize("name", [one if "lumped" in one else pytest.param(one, marks=pytest.mark.study) for one in CHAINS])
def test_compiled_rates_are_differences(name: str) -> None:
    """Along a change of motor joints, actuators and force at once; reverse mode is the transpose."""
    model = CHAINS[name]()
    compiled, random = sr.compile(model, backend="python"), np.random.default_rng(7)
    q = model.relaxed_motors + 0.01 * np.maximum(np.abs(model.relaxed_motors), 1e-2)
    rates, force, push = 1e-3 * random.normal(size=q.size), random.normal(size=3), random.normal(size=3)

    def solved(step: float) -> np.ndarray:
        found = compiled.equilibria(q + step * rates, force + step * push, gravity=sr.EARTH_GRAVITY)
        assert found.certified.all()
        return np.concatenate([found.q_springs[0], found.tip_positions[0]])

    responses = ChainResponses(compiled, weight=True)
    springs = solved(0.0)[None, :-3]
    at = responses.at(q[None], force[None], springs, np.array(sr.EARTH_GRAVITY))
    pushed = np.concatenate(responses.push(at, rates[None], push[None], 1), axis=1)[0]
    step = 1e-2  # differences of fourth order; results are in balance to 1e-12 of the load
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ [solved(n * step) for n in (-2, -1, 1, 2)] / (12.0 * step)
    assert pushed == pytest.approx(slope, abs=1e-8 * (1.0 + np.abs(slope).max()))
    weights = random.normal(size=pushed.size)
    pulled = responses.pull(at, weights[None, :-3], weights[None, -3:], 1)
    assert pulled.motors[0] @ rates + pulled.force[0] @ push == pytest.approx(float(weights @ pushed), rel=1e-9)
