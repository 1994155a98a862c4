"""Compiled equilibria in contact against the solver on Pinocchio: distances, candidates, forces, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.compiled.contact import surfaces
from softrobots.compiled.run.contact_batches import bodies_of
from softrobots.compiled.statuses import Status
from softrobots.environment.obstacle_fields import obstacle_fields
from studies.soak.contact_cases import draw
from studies.soak.contact_running import family_of
from studies.soak.plain_contact import PlainBody
from studies.soak.plain_statics import PlainStatics

MOTORS, FORCE = (0.0, 0.9, -0.4), (0.0, 0.0, -41.0)
TURNED = Rotation.from_rotvec((0.3, -0.5, 0.8)).as_matrix()
WALL = sr.HalfSpace((-1, 0, 0), offset=-1.0, name="wall")
SCENES: dict[str, list[Any]] = {
    "wall": [WALL],
    "sphere": [sr.Sphere(0.2, (0.95, 0.02, 0.4))],
    "box": [sr.Box((0.2, 0.4, 0.3), (1.05, 0.0, 0.45), TURNED)],
    "cylinder": [sr.Cylinder(0.1, 0.4, (0.95, 0.0, 0.5), TURNED)],
    "capsule and wall": [sr.Capsule(0.05, 0.3, (0.6, 0.0, 0.55), TURNED), WALL],
    "inside of a sphere": [sr.Sphere(0.3, (1.0, 0.1, 0.6))],
}


def plain_forces(state: sr.Equilibrium, environment: sr.Environment) -> np.ndarray:
    forces = np.zeros((len(environment), 3))
    for contact in state.contacts:
        forces[environment.names.index(contact.obstacle)] += contact.force
    return forces


@pytest.mark.parametrize("obstacle", [each for scene in SCENES.values() for each in scene], ids=repr)
def test_distances_have_the_slopes_and_bends_of_those_of_the_environment(obstacle: Any, rng: np.random.Generator) -> None:
    """Distances to rounding; the Hessian by differences of normals, to their error."""
    ((field, _),), body = obstacle_fields(sr.Environment([obstacle])), bodies_of(sr.Environment([obstacle]))[0]
    which, found = np.zeros(1, dtype=np.intp), np.zeros(surfaces.FOUND)
    for point in rng.uniform(-0.5, 1.5, (40, 3)):
        surfaces.surface(body, point, True, found)
        distance, normal = field.at(point[None], which)
        assert found[0] == pytest.approx(distance[0], abs=1e-14)
        assert found[1:4] == pytest.approx(normal[0], abs=1e-12)
        steps = 1e-6 * np.eye(3)
        ahead, behind = (field.at(point + sign * steps, which.repeat(3))[1] for sign in (1.0, -1.0))
        # within a body, whose depth is not smooth, neither counts a curvature
        assert found[0] < 0.0 or np.abs(found[4:13].reshape(3, 3) - (ahead - behind) / 2e-6).max() < 1e-6


@pytest.mark.study
@pytest.mark.parametrize("scene", SCENES)
def test_equilibria_are_those_of_the_plain_solver(arm: sr.SoftModel, scene: str) -> None:
    """The same balance by other equations, both to 1e-10 of the load: springs to 1e-9, forces to 1e-9 of the load."""
    environment = sr.Environment(SCENES[scene])
    batch: Any = sr.compile(arm, backend="python").equilibria(MOTORS, [FORCE], gravity=(0, 0, -9.81), environment=environment)
    state = sr.solve_equilibrium(arm, MOTORS, FORCE, gravity=(0, 0, -9.81), environment=environment)
    assert batch.certified.all()
    assert state.contacts
    assert not batch.handed_over.any()
    assert batch.q_springs[0] == pytest.approx(state.q_springs, abs=1e-9)
    assert batch.tip_positions[0] == pytest.approx(state.tip_position, abs=1e-9)
    assert np.abs(batch.obstacle_forces[0] - plain_forces(state, environment)).max() < 1e-9 * 41.0
    assert batch.penetration[0] <= 1e-9 * arm.reach
    assert batch.residual[0] <= state.tolerance


def test_a_single_case_is_that_of_the_batch(arm: sr.SoftModel) -> None:
    """Certified, or an error with what was found; also after another environment, and where the plain solver takes it."""
    solver, gravity = sr.compile(arm, backend="python"), (0, 0, -9.81)
    for scene in ("wall", "capsule and wall", "wall"):
        environment = sr.Environment(SCENES[scene])
        batch: Any = solver.equilibria(MOTORS, [FORCE], gravity=gravity, environment=environment)
        one: Any = solver.equilibrium(MOTORS, FORCE, gravity=gravity, environment=environment)
        assert one.stable
        assert np.array_equal(one.obstacle_forces, batch.obstacle_forces[0])
        assert np.array_equal(one.q_springs, batch.q_springs[0])
        assert np.array_equal(one.tip_position, batch.tip_positions[0])
        assert one.residual == pytest.approx(batch.residual[0], rel=1e-12)
        assert (one.penetration, one.handed_over) == (batch.penetration[0], batch.handed_over[0])
    assert "obstacle forces" in one.summary()
    with pytest.raises(sr.ParameterError, match="the search starts from rest"):
        solver.equilibrium(MOTORS, FORCE, environment=environment, q_springs0=one.q_springs)
    between = sr.Environment([sr.HalfSpace((0, 0, 1)), sr.HalfSpace((0, 0, -1))])
    with pytest.raises(sr.EquilibriumNotFound, match="not in balance") as error:
        solver.equilibrium(MOTORS, FORCE, environment=between)
    assert error.value.best.handed_over


def test_obstacles_of_each_case_and_their_order(arm: sr.SoftModel) -> None:
    """A door that closes, a case a place: as one by one; in another order the forces come in that order."""
    doors = [sr.Environment([WALL, sr.Box((0.1, 0.4, 0.4), (x, 0.0, 0.6), name="door")]) for x in (1.3, 1.05, 1.0)]
    solver = sr.compile(arm, backend="python")
    together: Any = solver.equilibria(MOTORS, (0, 0, -10), environment=doors)
    for row, door in enumerate(doors):
        turned: Any = solver.equilibria(MOTORS, [(0, 0, -10)], environment=sr.Environment(list(door)[::-1]))
        assert np.array_equal(turned.obstacle_forces[0, ::-1], together.obstacle_forces[row])
    assert np.abs(together.obstacle_forces[:, 1, 0]).argmax() == 2
    assert not together.obstacle_forces[0, 1].any()


def test_hard_and_bad_cases_are_told(arm: sr.SoftModel) -> None:
    """Between two walls without a gap there is no way out: the plain solver says so; NaN is no number."""
    between = sr.Environment([sr.HalfSpace((0, 0, 1)), sr.HalfSpace((0, 0, -1))])
    batch: Any = sr.compile(arm, backend="python").equilibria(MOTORS, [FORCE, (np.nan, 0, 0)], environment=between)
    assert batch.handed_over.tolist() == [True, False]
    assert batch.status.tolist() == [Status.UNSETTLED, Status.NOT_A_NUMBER]
    assert np.isfinite(batch.q_springs).all()
    assert np.isfinite(batch.obstacle_forces).all()


def test_what_is_not_compiled_is_refused_by_name(arm: sr.SoftModel) -> None:
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], dtype=float)
    rock, wall = sr.Environment([sr.Mesh(corners, name="rock")]), sr.Environment([WALL])
    for model, environment, said in (
        (arm, rock, "rock"),
        (arm, sr.Environment([WALL], self_contact=True), "self_contact"),
        (arm, [wall, rock], "2 environments"),
        (sr.load_model(sr.PccArm()), wall, "sections"),
    ):
        with pytest.raises(sr.ParameterError, match=said):
            sr.compile(model, backend="python").equilibria(model.relaxed_motors, [FORCE], environment=environment)


@pytest.mark.study
def test_numba_finds_the_same_in_threads(arm: sr.SoftModel) -> None:
    """The same functions; rounding, as numba contracts products and sums."""
    environment, loads = sr.Environment(SCENES["capsule and wall"]), np.linspace((0, 0, -60), (5, 5, 0), 200)
    many, one = (
        sr.compile(arm, backend=name).equilibria(MOTORS, loads[::step], environment=environment, threads=threads)
        for name, step, threads in (("numba", 1, 2), ("python", 20, 1))
    )
    assert many.certified.all()
    assert np.abs(many.q_springs[::20] - one.q_springs).max() < 1e-9


@pytest.mark.study
@pytest.mark.shortened(200, 2000)
@pytest.mark.parametrize("name", ["arm", "two_hinges"])
def test_random_arms_among_random_obstacles_are_in_balance(name: str, cases: int) -> None:
    """Every compiled answer is one of the plain solver, started from there: springs to 1e-9, forces to 1e-7 of the largest.

    Less than 5 % are handed over, and less than 2 % are others than the plain solver finds from rest.
    """
    family = family_of(name)
    model = family.robot()
    body = PlainBody(PlainStatics(model))
    drawn = [draw(family, body, 0, number) for number in range(cases)]
    motors, forces = (np.concatenate([getattr(case, column) for case, _ in drawn]) for column in ("motors", "forces"))
    firsts = [next(iter(environment)) for _, environment in drawn]
    scenes = [
        sr.Environment([replace(one, name="one"), replace(other, name="other")])
        for one, other in zip(firsts, firsts[1:] + firsts[:1], strict=True)
    ]
    batch: Any = sr.compile(model).equilibria(motors, forces, gravity=sr.EARTH_GRAVITY, environment=scenes)
    assert batch.handed_over.mean() < 0.05
    own = np.flatnonzero(batch.certified & ~batch.handed_over)
    assert len(own) > 0.9 * cases
    others = 0
    for row in own:
        load = {"gravity": sr.EARTH_GRAVITY, "environment": scenes[row]}
        state = sr.solve_equilibrium(model, motors[row], forces[row], q_springs0=batch.q_springs[row], **load)
        assert state.stable
        assert np.abs(batch.q_springs[row] - state.q_springs).max() < 1e-9
        found = plain_forces(state, scenes[row])
        assert np.abs(batch.obstacle_forces[row, : len(found)] - found).max() < 1e-7 * max(1.0, np.abs(found).max())
        try:
            rest = sr.solve_equilibrium(model, motors[row], forces[row], **load)
        except sr.EquilibriumNotFound:
            continue
        others += bool(np.abs(rest.q_springs - batch.q_springs[row]).max() > 1e-6)
    assert others < 0.02 * cases
