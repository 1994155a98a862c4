"""Dry friction of bending and of guides: closed forms, hysteresis, and the energy that a cycle takes."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import softrobots as sr
from softrobots.environment.standing import standing_among
from softrobots.model.friction_coordinates import grip_of, memory_of
from softrobots.statics.elastic_state import ElasticProblem
from softrobots.statics.loads import Load

EI, LENGTH, DISTANCE = 2e-3, 0.06, 0.0045
MOMENT = 2e-3  # of friction [N m]
STICK = 1e-4  # [rad] that a section bends before its friction is whole, and relative slip of a tendon: see `dry_friction`


def one_segment(sections: int = 4, azimuths: Sequence[float] = (0.0,), **fields: object) -> sr.TendonArm:
    return sr.TendonArm(
        segment_lengths=(LENGTH,),
        tendon_azimuths=azimuths,
        tendon_distance=DISTANCE,
        kind="tension",
        bending_stiffness=EI,
        elastic_sections=sections,
        **fields,
    )


def path(model: sr.SoftModel, rows: Sequence[Sequence[float]], **load: object) -> list[sr.Equilibrium]:
    """Equilibria one after the other."""
    steps: list[sr.Equilibrium] = []
    for row in rows:
        steps.append(sr.solve_equilibrium(model, row, previous=steps[-1] if steps else None, **load))
    return steps


def bending(equilibrium: sr.Equilibrium) -> np.ndarray:
    """Curvature of each section towards the first tendon [rad/m]."""
    return equilibrium.strains[:, 1]


def test_the_bending_of_a_segment_plays_between_two_lines() -> None:
    """A tendon bends a segment by the constant moment `T d`; friction takes or gives up to its moment: a play operator."""
    model = sr.load_model(one_segment(bending_friction=MOMENT))
    tensions = [0.2, 0.4, 1.0, 2.0, 1.9, 1.5, 0.5, 0.0, 0.1, 2.0, 3.0]
    held, expected = 0.0, []
    for tension in tensions:
        free = tension * DISTANCE / EI
        held = min(max(held, free - MOMENT / EI), free + MOMENT / EI)
        expected.append(held)
    for equilibrium, curvature in zip(path(model, [[t] for t in tensions]), expected, strict=True):
        assert equilibrium.stable
        # Between whole friction one way and the other a section of LENGTH / 4 gives way by two sticks.
        assert bending(equilibrium) == pytest.approx(np.full(4, curvature), abs=2.02 * STICK / (LENGTH / 4))


@pytest.mark.study
def test_friction_does_not_depend_on_the_rate_nor_on_the_number_of_steps() -> None:
    """Moves in one plane: one step and ten steps to each point of return are alike, but for the stick."""
    model = sr.load_model(one_segment(bending_friction=MOMENT, guide_friction=0.2))
    ends = [3.0, 0.5, 2.0, 0.1]
    fine = np.concatenate([np.linspace(last, end, 11)[1:] for last, end in zip([0.0, *ends], ends, strict=False)])
    coarse = path(model, [[tension] for tension in ends])
    for one, other in zip(coarse, path(model, fine[:, None])[9::10], strict=True):
        # The stick: 1e-4 rad a section, at 0.03 m from the tip on average.
        assert one.tip_position == pytest.approx(other.tip_position, abs=1.2e-5)


def test_the_moment_of_friction_acts_against_the_bending_whatever_its_direction() -> None:
    """Twelve directions of one load, weightless: the bow is in the plane of the force, less the friction."""
    model = sr.load_model(one_segment(bending_friction=MOMENT, azimuths=()))
    bows = []
    for angle in np.arange(12) * np.pi / 6.0:
        moment = 0.01 * np.array([-np.sin(angle), np.cos(angle), 0.0])
        found = sr.solve_equilibrium(model, [], wrench=(0.0, 0.0, 0.0, *moment))
        rates = found.strains[:, :2]
        assert rates @ moment[:2] / 0.01 == pytest.approx(np.full(4, (0.01 - MOMENT) / EI), rel=1e-3)
        bows.append(np.linalg.norm(found.tip_position[:2]))
    assert np.ptp(bows) < 1e-9


def capstan(tension: float, coefficient: float, s: np.ndarray) -> np.ndarray:
    r"""Angle of the backbone at `s` under a tendon that slips towards its motor [rad].

    `EI theta' = T d exp(-mu theta)` gives `theta = log(1 + mu T d s / EI) / mu`.
    """
    return np.log1p(coefficient * tension * DISTANCE * s / EI) / coefficient


@pytest.mark.study
@pytest.mark.parametrize("tension", [2.0, 8.0])
def test_a_tendon_in_its_guides_follows_the_capstan(tension: float) -> None:
    coefficient, errors = 0.4, []
    for sections in (4, 8, 16):
        model = sr.load_model(one_segment(sections, guide_friction=coefficient))
        (found,) = path(model, [[tension]])
        ends = LENGTH * np.arange(1, sections + 1) / sections
        angles = np.cumsum(bending(found)) * LENGTH / sections
        errors.append(np.abs(angles - capstan(tension, coefficient, ends)).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8)  # second order in the sections
    assert errors[2] < 2e-3 * capstan(tension, coefficient, np.array(LENGTH))
    frictionless = tension * DISTANCE * LENGTH / EI
    assert capstan(tension, coefficient, np.array(LENGTH)) < 0.97 * frictionless


@pytest.mark.study
@pytest.mark.parametrize(("coefficient", "tensions"), [(0.4, (40.0, 20.0)), (1.0, (20.0, 10.0))])
def test_antagonists_with_strong_friction_hold_each_other(coefficient: float, tensions: tuple[float, float]) -> None:
    r"""Two tendons face each other; one slips towards its motor, the other away from it, and friction acts on both.

    `EI theta' = d (T_1 exp(-mu theta) - T_2 exp(mu theta))`, integrated by SciPy. Rounds of given friction alone go to and fro
    between two states here. Second order in the sections; compiled code finds the same.
    """
    errors = []
    for sections in (8, 16):
        model = sr.load_model(one_segment(sections, (0.0, np.pi), guide_friction=coefficient))
        found = sr.solve_equilibrium(model, tensions)
        assert found.stable
        errors.append(float(bending(found).sum()) * LENGTH / sections - bent_by_antagonists(coefficient, *tensions))
    compiled = sr.compile(model, backend="python").equilibrium(np.array(tensions))
    assert compiled.tip_position == pytest.approx(found.tip_position, abs=1e-10)
    assert abs(errors[1]) < 5e-4  # rad, of 0.8 and 0.3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.8)


def bent_by_antagonists(coefficient: float, first: float, second: float) -> float:
    """Angle at the tip [rad]."""

    def slope(_: float, angle: np.ndarray) -> np.ndarray:
        pulls = first * np.exp(-coefficient * angle) - second * np.exp(coefficient * angle)
        return np.asarray(DISTANCE / EI * pulls)

    return float(solve_ivp(slope, (0.0, LENGTH), [0.0], rtol=1e-10, atol=1e-12).y[0, -1])


def test_a_tendon_that_is_let_go_first_sticks_and_then_slips_back() -> None:
    """Let go, the segment keeps its bow until the tension at the base is that at the tip beyond the capstan, twice over."""
    model = sr.load_model(one_segment(8, guide_friction=0.4))
    tensions = [6.0, 5.8, 5.6, 2.0]
    pulled, stuck, still, slipped = (bending(e).sum() * LENGTH / 8 for e in path(model, [[t] for t in tensions]))
    assert pulled == pytest.approx(float(capstan(6.0, 0.4, np.array(LENGTH))), rel=3e-3)
    assert pulled > stuck >= still
    assert stuck == pytest.approx(pulled, rel=0.02)  # without friction it would lose 3.3 %
    # Slipping back everywhere: the sign of the coefficient changes.
    assert slipped == pytest.approx(float(capstan(2.0, -0.4, np.array(LENGTH))), rel=3e-3)


@pytest.mark.study
@pytest.mark.parametrize("fields", [{"bending_friction": MOMENT}, {"guide_friction": 0.3}])
def test_a_cycle_takes_energy_and_gives_none(fields: dict[str, object]) -> None:
    """Work of a tendon over closed cycles, `sum T dl`: positive, and the same each time; nothing is lost without friction."""
    model = sr.load_model(one_segment(**fields))
    up = np.linspace(0.0, 4.0, 21)
    cycle = np.concatenate([up, up[-2::-1]])
    steps = path(model, [[t] for t in np.concatenate([cycle, cycle[1:]])])
    lengths = np.array([float(e.muscle_lengths[0]) for e in steps])
    tensions = np.array([float(e.q_motors[0]) for e in steps])
    work = -0.5 * (tensions[1:] + tensions[:-1]) * np.diff(lengths)
    first, second = work[: len(cycle) - 1].sum(), work[len(cycle) - 1 :].sum()
    assert first > 0.0
    assert second > 0.0
    if "bending_friction" in fields:  # twice the moment times the angle that it slides, there and back
        angle = (4.0 * DISTANCE - 2.0 * MOMENT) / EI * LENGTH
        assert second == pytest.approx(2.0 * MOMENT * angle, rel=0.02)  # of the trapezoidal rule


def test_muscles_of_given_length_have_hysteresis_too() -> None:
    """The same lengths on the way out and back: bent alike where one section follows them, with other tensions."""
    arm = sr.PccArm(segment_lengths=(0.524,), elastic_sections=1, bending_friction=0.5)
    model, rest = sr.load_model(arm), np.full(3, 0.524)
    bend = 0.04 * np.cos([0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0])
    out, further, back = path(model, [rest - 0.5 * bend, rest - bend, rest - 0.5 * bend])
    assert out.tip_position == pytest.approx(back.tip_position, abs=1e-12)
    # The moment of the muscles about the axis of bending differs by twice the friction.
    assert (out.muscle_forces - back.muscle_forces) @ bend == pytest.approx(2.0 * 0.5, rel=1e-6)
    assert further.stable


@pytest.mark.study
def test_a_trajectory_remembers_its_way(tmp_path: Path) -> None:
    """Out and back along a line: other tensions at the same tip, as those of single steps from point to point."""
    arm = sr.TendonArm(segment_lengths=(0.09, 0.11), kind="tension", bending_friction=MOMENT, elastic_sections=1)
    model, pull = sr.load_model(arm), np.full(6, 1.0)
    start = sr.solve_equilibrium(model, pull)
    line = start.tip_position + np.linspace(0.3, 0.8, 2)[:, None] * (0.02, 0.01, -0.003)
    there = sr.follow_trajectory(model, np.concatenate([line, line[-2::-1]]), q_motors0=pull)
    assert there.tip_error.max() < 1e-6
    tensions = there.q_motors
    assert np.abs(tensions[0] - tensions[-1]).max() > 0.05
    for before, after in zip(there.equilibria, there.equilibria[1:], strict=False):
        again = sr.solve_equilibrium(model, after.q_motors, previous=before)
        assert again.tip_position == pytest.approx(after.tip_position, abs=1e-9)
    loaded = sr.load_result(sr.save_result(there, tmp_path / "there.npz"))
    again = sr.solve_equilibrium(model, tensions[0], previous=loaded.equilibria[-1])
    direct = sr.solve_equilibrium(model, tensions[0], previous=there.equilibria[-1])
    assert again.q_springs == pytest.approx(direct.q_springs, abs=1e-14)


@pytest.mark.study
@pytest.mark.parametrize("fields", [{"bending_friction": 3e-4}, {"bending_friction": 5e-4, "guide_friction": 0.2}], ids=str)
def test_a_search_gets_past_what_sticks(fields: dict[str, float]) -> None:
    """From one start, with both frictions, in less than its hundred steps; the motors put the tip there from rest."""
    model = sr.load_model(sr.TendonArm(kind="tension", elastic_sections=2, **fields))
    start = sr.solve_equilibrium(model, np.full(9, 1.0))
    target = start.tip_position + (0.006, 0.003, -0.0009)
    found = sr.solve_ik(model, target, q_motors0=np.full(9, 1.0), starts=1)
    assert found.iterations < 100
    assert found.equilibrium.within_limits
    again = sr.solve_equilibrium(model, found.q_motors)
    assert np.linalg.norm(again.tip_position - target) < 2e-9  # twice the tolerance of the search


@pytest.mark.study
def test_a_copy_of_a_result_remembers_what_the_result_does() -> None:
    """A small step back only sticks, so that what is remembered then is of the step before."""
    model = sr.load_model(sr.TendonArm(kind="tension", bending_friction=MOMENT, guide_friction=0.1, elastic_sections=2))
    pulled, stuck = path(model, [np.linspace(0.5, 4.0, 9), np.linspace(0.5, 3.9, 9)])
    direct = sr.solve_equilibrium(model, np.linspace(0.5, 2.0, 9), previous=stuck)
    for copied in (pickle.loads(pickle.dumps(stuck)), copy.deepcopy(stuck)):
        again = sr.solve_equilibrium(model, np.linspace(0.5, 2.0, 9), previous=copied)
        assert again.q_springs == pytest.approx(direct.q_springs, abs=1e-12)
    assert np.abs(pulled.q_springs - stuck.q_springs).max() > 1e-7


def test_the_robot_of_a_result_comes_from_rest_unless_a_result_is_given() -> None:
    model = sr.load_model(one_segment(bending_friction=MOMENT))
    back = path(model, [[2.0], [0.5]])[-1]
    fresh, again = (sr.solve_equilibrium(robot, [0.5]) for robot in (model, back.model))
    assert np.array_equal(fresh.q_springs, again.q_springs)
    assert np.abs(fresh.q_springs - back.q_springs).max() > 1e-3


@pytest.mark.study
@pytest.mark.parametrize(("moment", "guides"), [(0.1, 0.1), (1e3, 0.0)])
def test_friction_may_be_large_against_the_load(moment: float, guides: float) -> None:
    """Given lengths without a load: the friction of bending and guides has its own rounding, beyond the least tolerance."""
    for chain in ("sections", "lumped"):
        model = sr.load_model(sr.PccArm(chain=chain, bending_friction=moment, guide_friction=guides))
        held = sr.solve_equilibrium(model, model.relaxed_motors + (-0.02, 0.01, 0.01, 0.0, 0.0, 0.0))
        assert held.converged
        assert held.tolerance < 1e-6


def test_what_has_no_friction_refuses_it() -> None:
    model = sr.load_model(sr.TendonArm(bending_friction=MOMENT))
    rest = model.relaxed_motors
    found = sr.solve_equilibrium(model, rest)
    for call in (
        lambda: sr.vibration_modes(model, found),
        lambda: sr.critical_load(model, rest, (0.0, 0.0, -1.0)),
        lambda: sr.solve_imposed_displacement(model, rest, displacement=0.001, direction=(1.0, 0.0, 0.0)),
    ):
        with pytest.raises(sr.ParameterError, match="without dry friction, for"):
            call()


@pytest.mark.parametrize(("field", "value"), [("bending_friction", -1.0), ("guide_friction", -0.1), ("guide_friction", "much")])
def test_bad_friction_is_refused(field: str, value: object) -> None:
    with pytest.raises(sr.ParameterError, match=field):
        sr.TendonArm(**{field: value})


def test_a_file_with_negative_friction_is_refused() -> None:
    text = sr.TendonArm(bending_friction=MOMENT).urdf()
    for old, new, words in (
        ('bending="0.002"', 'bending="-1"', "has bending -1.0 and guides 0.0; required >= 0"),
        ('guides="0.0" segment="1"', 'guides="0.0" segment="7"', "that of segment 7; available: 1, 2, 3"),
        ('guides="0.0" segment="1"', 'guides="0.0" segment="2"', "friction of segment name twice"),
        ('guides="0.0" segment="1"', 'guides="no" segment="1"', "has guides = 'no'"),
    ):
        assert old in text
        with pytest.raises(sr.DescriptionError, match=words):
            sr.load_model(text.replace(old, new, 1))


@pytest.mark.study
@pytest.mark.parametrize("coefficient", [2.0, 50.0])
def test_friction_of_given_lengths_that_runs_away_is_no_equilibrium(coefficient: float) -> None:
    """Tensions of given lengths answer to their friction: beyond some coefficient they grow without end, and that is said."""
    model = sr.load_model(sr.PccArm(guide_friction=coefficient, elastic_sections=1))
    bend = np.array([-0.04, 0.02, 0.02, 0.02, -0.04, 0.02])
    with np.errstate(all="raise"), pytest.raises(sr.EquilibriumNotFound, match="does not settle") as caught:
        sr.solve_equilibrium(model, model.relaxed_motors + bend, (3.0, 2.0, -3.0))
    assert caught.value.residual == np.inf
    assert np.all(np.isfinite(caught.value.best.q_springs))


@pytest.mark.study
def test_both_frictions_in_contact_are_a_minimum_that_scipy_confirms() -> None:
    """Tendons of given length push an arm along a wall until it gives way sideways: SLSQP finds nothing lower beside the wall.

    Its energy is that of the arm without friction, plus what a step from the last state takes at the friction of the guides,
    which is that of the tensions found.
    """
    fields: dict[str, Any] = {"segment_lengths": (0.06, 0.0625), "kind": "length", "elastic_sections": 2}
    model = sr.load_model(sr.TendonArm(**fields, bending_friction=3e-4, guide_friction=0.2))
    smooth = sr.load_model(sr.TendonArm(**fields))
    wall = sr.Environment([sr.HalfSpace((-1, 0, 0), offset=-0.03)])
    friction, found = model.structure.friction, None
    for pull in (5e-4, 1e-3, 1.5e-3):
        motors = model.relaxed_motors + pull * np.array([-1.0, 0.5, 0.5, -2.0, 1.0, 1.0])
        found = sr.solve_equilibrium(model, motors, environment=wall, previous=found)
    assert found is not None
    assert found.stable
    assert found.contacts[0].normal_force > 1.0
    memory, grip = memory_of(found.model), grip_of(found.model)
    strains = model.structure.strains(motors, found.q_springs)
    assert friction.grip(strains, found.muscle_forces, memory) == pytest.approx(grip, abs=1e-9)
    problem, surroundings = ElasticProblem(smooth, motors, Load.of(smooth)), standing_among(smooth, wall)
    scale = 1.0 / np.sqrt(smooth.stiffness)

    def energy(scaled: np.ndarray) -> float:
        state = problem.state(scaled * scale)
        return 100.0 * (state.energy + friction.at(model.structure.strains(motors, scaled * scale), memory, grip)[0])

    def gap(scaled: np.ndarray) -> float:
        q = smooth.embed(smooth.coordinates.at(motors, scaled * scale).joints)
        return 100.0 * float(surroundings.at(q, smooth.reach).values.min())

    here = found.q_springs / scale
    for aside in np.random.default_rng(1).normal(scale=0.02, size=(2, len(here))):
        options = {"maxiter": 300, "ftol": 1e-13}
        least = minimize(energy, here + aside, method="SLSQP", constraints={"type": "ineq", "fun": gap}, options=options)
        # SLSQP keeps gaps to 1e-9 m, at about 1 N, and ends within its differences of 1e-8
        assert least.fun == pytest.approx(energy(here), abs=1e-6)
