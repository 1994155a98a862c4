"""The arm of two links: pseudo-rigid arms against two beams with motors between."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from tqdm import tqdm

import softrobots as sr
from softrobots import inflated_beam
from softrobots.cli.tools.kinematics import pose_error
from softrobots.inflated_beam import MEAN_STIFFNESS
from studies.beam_validity.link import LENGTH, SHOWN, TUBE, TWISTING, Hinges, lumped

LARGEST_FORCE = 30.0
"""On the arm [N]; with a short lever it would take much more to wrinkle a link."""
FITTED = 40
"""Cases that the best single hinge is fitted to, at most."""
EVALUATIONS = 80
"""Robots tried for it, at most."""
RIGID = "rigid links: the deflection itself"
"""An arm that does not bend: its error is the deflection."""


class Case(NamedTuple):
    """A posture of the arm and a force on its tip."""

    motors: np.ndarray
    """Motor angles (3,) [rad]."""
    force: np.ndarray
    """In world axes (3,) [N]."""


def arm_rod(rods: ModuleType) -> Any:
    """A link of the arm; its modulus is such that (1) gives the paper's stiffness at the pressure of the arm."""
    young = inflated_beam.young_modulus_from_stiffness(MEAN_STIFFNESS, pressure=SHOWN, **TUBE)
    return rods.InflatedRod.tube(pressure=SHOWN, young_modulus=young, **TUBE)


def axes_of(motors: np.ndarray) -> np.ndarray:
    """Directions of the two links without load, shape (2, 3)."""
    turn, first, second = motors
    return np.array(
        [(math.cos(turn) * math.cos(up), math.sin(turn) * math.cos(up), math.sin(up)) for up in (first, first + second)]
    )


def beams(rods: ModuleType, rod: Any, case: Case) -> Any:
    """Equilibrium of the arm as two beams with motors between."""
    turn, first, second = case.motors
    base = rods.product(rods.turned((0, 0, 1), turn), rods.turned((0, -1, 0), first))
    return rods.solve_inflated_chain([rod] * 2, [base, rods.turned((0, -1, 0), second)], case.force, tol=1e-6)


def cases_of(rods: ModuleType, rod: Any, count: int, seed: int) -> Iterator[tuple[Case, Any]]:
    """Draw postures and forces, and solve the beams: motor angles over the whole turn, forces in all directions.

    The size of a force is uniform between 0 and what would bend the straight links at their clamps to the wrinkling moment, at
    most `LARGEST_FORCE`. Cases in which the bent beam is beyond that moment somewhere are drawn again. A case depends on the
    seed and its number alone.
    """
    limit = inflated_beam.wrinkling_moment(SHOWN, TUBE["radius"])
    for number in range(count):
        random = np.random.default_rng([seed, number])
        while True:
            motors, direction = random.uniform(-math.pi, math.pi, 3), random.normal(size=3)
            direction /= np.linalg.norm(direction)
            first, second = LENGTH * axes_of(motors)
            moments = [
                (np.cross(r, direction), axis / LENGTH)
                for r, axis in ((first + second, first), (second, first), (second, second))
            ]
            lever = max(float(np.linalg.norm(m - (m @ axis) * axis)) for m, axis in moments)
            case = Case(motors, random.uniform() * min(limit / max(lever, 1e-9), LARGEST_FORCE) * direction)
            found = beams(rods, rod, case)
            if found.bending_moments.max() <= limit:
                yield case, found
                break


def pose(solution: Any) -> np.ndarray:
    """Return the pose of the tip of the beams, shape (4, 4) [m]."""
    return np.array(pin.SE3(solution.rotation, solution.position).homogeneous)


def solved(model: sr.SoftModel, cases: Iterable[Case]) -> list[np.ndarray]:
    """Poses of the tip of a pseudo-rigid arm."""
    return [sr.solve_equilibrium(model, one.motors, one.force).transform_tip_to_world.homogeneous for one in cases]


def fitted(cases: Sequence[Case], exact: Sequence[np.ndarray], start: Hinges) -> Hinges:
    """The single hinge, place and stiffness, with the least squares of the tip error in these cases."""
    from scipy.optimize import minimize

    with tqdm(desc="best single hinge", unit="robot") as bar:

        def squares(x: np.ndarray) -> float:
            bar.update()
            if not 0.0 < x[0] < 1.0 or x[1] <= 0.0:
                return math.inf
            model = sr.load_model(Hinges((LENGTH * x[0],), 100.0 * x[1]).robot(2))
            tips = np.array([found[:3, 3] for found in solved(model, cases)])
            return float(np.sum((tips - [one[:3, 3] for one in exact]) ** 2))

        begin = np.array([start.places[0] / LENGTH, start.stiffness / 100.0])
        found = minimize(squares, begin, method="Nelder-Mead", options={"xatol": 2e-3, "fatol": 1e-9, "maxfev": EVALUATIONS})
    return Hinges((float(LENGTH * found.x[0]),), float(100.0 * found.x[1]))


def study_arm(rods: ModuleType, count: int, seed: int) -> tuple[dict[str, Any], dict[str, dict[str, np.ndarray]]]:
    """Compare the arms; also return the errors by kind of beam and by model, shape (cases, 2) [m, rad]."""
    rod = arm_rod(rods)
    drawn = list(tqdm(cases_of(rods, rod, count, seed), "beams that twist", count, unit="case"))
    cases = [case for case, _ in drawn]
    whole = [pose(found) for _, found in drawn]
    planar = []
    for case in tqdm(cases, "beams", unit="case"):
        found = beams(rods, rod.planar(), case)
        planar.append(pose(found))
    forms = lumped(rod)
    forms["one hinge, best fit"] = fitted(cases[:FITTED], planar[:FITTED], forms["one hinge by (1)"])
    answers: dict[str, list[np.ndarray]] = {}
    for name, hinges in forms.items():
        answers[name] = solved(sr.load_model(hinges.robot(2)), tqdm(cases, name, unit="case"))
    answers["beams that do not twist or stretch"] = planar
    rigid = sr.load_model(sr.InflatableArm(stiffness=1e9))
    answers["rigid links: the deflection itself"] = solved(rigid, cases)
    errors = {
        kind: {
            name: np.array([pose_error(one, other) for one, other in zip(found, truth, strict=True)])
            for name, found in answers.items()
            if found is not truth and (name != TWISTING or truth is whole)
        }
        for kind, truth in (("bend and shear", planar), ("also twist and stretch", whole))
    }
    result = {
        "cases": count,
        "seed": seed,
        "pressure_Pa": SHOWN,
        "hinges": {
            name: {"places_m": list(one.places), "stiffness_Nm": one.stiffness, "twist_Nm": one.twist}
            for name, one in forms.items()
        },
        "beams": {
            kind: {name: statistics(found, of) for name, found in rows.items()}
            for kind, rows in errors.items()
            for of in [rows[RIGID]]
        },
        "first": {kind: {name: found[:3].tolist() for name, found in rows.items()} for kind, rows in errors.items()},
    }
    return result, errors


def statistics(errors: np.ndarray, deflections: np.ndarray) -> dict[str, list[float]]:
    """Median, 95 % and largest, of the tip error [m], of its share of the deflection, and of the angle [rad]."""
    columns = {"error_m": errors[:, 0], "share": errors[:, 0] / deflections[:, 0], "error_rad": errors[:, 1]}
    return {name: np.percentile(column, [50.0, 95.0, 100.0]).tolist() for name, column in columns.items()}
