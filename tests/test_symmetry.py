"""What leaves the equilibria of the arm alone, on each engine: turning, mirroring, and scaling of stiffness with load."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softrobots as sr
from tests.conftest import missing
from tests.support.load_cases import cases

SAME = 1e-10
"""Two answers that meet 1e-10 of the load each [rad and m]."""
Engine = Callable[..., tuple[np.ndarray, np.ndarray]]


def pinocchio(model: sr.SoftModel) -> Engine:
    def solved(motors: np.ndarray, forces: np.ndarray, gravity: object = None) -> tuple[np.ndarray, np.ndarray]:
        rows = [
            sr.solve_equilibrium(model, *case, gravity=gravity, tolerance=1e-13) for case in zip(motors, forces, strict=True)
        ]
        return np.array([row.q_springs for row in rows]), np.array([row.tip_position for row in rows])

    return solved


def compiled(backend: str) -> Callable[[sr.SoftModel], Engine]:
    def of_model(model: sr.SoftModel) -> Engine:
        solver = sr.compile(model, backend=backend)

        def solved(motors: np.ndarray, forces: np.ndarray, gravity: object = None) -> tuple[np.ndarray, np.ndarray]:
            batch = solver.equilibria(motors, forces, gravity=gravity)
            assert np.all(batch.certified)
            return np.array(batch.q_springs), np.array(batch.tip_positions)

        return solved

    return of_model


@pytest.fixture(scope="module", params=["pinocchio", "python", "numba"])
def engine(request: pytest.FixtureRequest) -> Callable[[sr.SoftModel], Engine]:
    if request.param == "numba" and importlib.util.find_spec("numba") is None:
        missing("numba is not installed")
    return pinocchio if request.param == "pinocchio" else compiled(request.param)


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, sr.EARTH_GRAVITY])
def test_the_first_motor_turns_arm_and_load_alike(engine, gravity: object, arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """Motor 1 is vertical, as is gravity."""
    motors, forces = cases(rng, 300, 1.0, 60.0)
    yaw = rng.uniform(-np.pi, np.pi, 300)
    turns, solved = Rotation.from_euler("z", yaw[:, None]), engine(arm)
    springs, tips = solved(motors, forces, gravity)
    turned_springs, turned_tips = solved(motors + np.outer(yaw, (1.0, 0.0, 0.0)), turns.apply(forces), gravity)
    assert np.abs(springs - turned_springs).max() < SAME
    assert np.abs(turns.apply(tips) - turned_tips).max() < SAME


def test_the_mirrored_load_gives_the_mirrored_answer(engine, arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """The arm is symmetric about the x-z plane: turning and side springs change sign."""
    motors, forces = cases(rng, 300, 1.0, 60.0)
    solved = engine(arm)
    springs, tips = solved(motors, forces)
    mirrored_springs, mirrored_tips = solved(motors * (-1.0, 1.0, 1.0), forces * (1.0, -1.0, 1.0))
    assert np.abs(springs * (-1.0, 1.0, -1.0, 1.0) - mirrored_springs).max() < SAME
    assert np.abs(tips * (1.0, -1.0, 1.0) - mirrored_tips).max() < SAME


@pytest.mark.study
@pytest.mark.parametrize("factor", [0.01, 7.0, 100.0])
@pytest.mark.parametrize("engine", [pinocchio, compiled("python")])  # numba would compile each stiffness for some seconds
def test_stiffness_and_load_scale_together(engine, factor: float, arm: sr.SoftModel, rng: np.random.Generator) -> None:
    stiffer = sr.load_model(sr.InflatableArm(stiffness=factor * arm.stiffness[0]))
    motors, forces = cases(rng, 200, 1.0, 60.0)
    assert np.abs(engine(arm)(motors, forces)[0] - engine(stiffer)(motors, factor * forces)[0]).max() < SAME
