"""Jobs of the inflatable arm's motors: the force from their torques, and their angles along a path."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.inverse_kinematics import solve_ik
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.load_estimation import estimate_load
from studies.benchmark.arm_baselines import CHECKED, batch_name, one_by_one, single_name, together
from studies.benchmark.cases import LoadCases, arm, path_targets, standard_cases
from studies.benchmark.comparison import Comparison, Outcome, Settings
from studies.benchmark.compiled_solvers import BACKENDS, compiled
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.pink_kinematics import PinkArm
from studies.benchmark.pinocchio_solvers import PinocchioArm, estimate_force
from studies.benchmark.results import AT_LEAST
from studies.papers.arm_path import FORCE

ESTIMATE = "Python + Pinocchio, Newton 7x7"
PINK, PINK_LIMITS = "Pink, rigid arm, without limits", "Pink, rigid arm"

_SAME_FORCE = 1e-6  # [N], of forces from torques that are known to 1e-13, in poses with a condition number below `_CLEAR`
_CLEAR = 50.0
_ON_TARGET = 1e-9  # [m]


def load_estimation(settings: Settings) -> Outcome:
    """Force and springs from motor torques, in poses that show every direction of the force."""
    comparison, robot = Comparison(settings, "load estimation"), PinocchioArm(arm())
    motors, torques, forces = _measured(min(settings.batch, 2000))
    few = LoadCases(motors[: settings.singles], torques[: settings.singles])
    many = LoadCases(*(np.resize(array, (settings.batch, 3)) for array in (motors, torques)))
    checked: dict[str, Any] = {"expected": forces[: min(CHECKED, settings.singles)], "tolerance": _SAME_FORCE, "unit": "N"}
    one_by_one("estimate_load", partial(estimate_load, arm(), restart=False), few, read=_force, **checked)

    def batch() -> Workload:
        solve = compiled(arm(), "numba").estimate_loads
        return together(batch_name("numba"), solve, many, read=lambda found: found.forces, **checked)

    def single(backend: str) -> Workload:
        return one_by_one(single_name(backend), compiled(arm(), backend).estimate_load, few, read=_force, **checked)

    comparison.add(
        ESTIMATE, lambda: one_by_one(ESTIMATE, partial(estimate_force, robot), few, read=lambda found: found[0], **checked)
    )
    comparison.add(batch_name("numba"), batch)
    for backend in BACKENDS:
        comparison.add(single_name(backend), partial(single, backend))
    comparison.run()
    job = "load estimation, one call"
    rows = [
        comparison.cheaper(job, single_name("numba"), ESTIMATE, AT_LEAST, 130.0),
        comparison.cheaper("load estimation, batch", batch_name("numba"), ESTIMATE, AT_LEAST, 800.0),
        comparison.cheaper(job, single_name("python"), ESTIMATE),
    ]
    return Outcome(rows)


def trajectory(settings: Settings) -> Outcome:
    """Motor angles along a path: ours with the loaded, elastic arm, Pink with the rigid one."""
    comparison = Comparison(settings, "trajectory")
    targets, force = path_targets(settings.waypoints), np.array(FORCE)
    loaded, rigid = (solve_ik(arm(), targets[0], some, elbow="up").q_motors for some in (force, None))

    def ours(backend: str) -> Workload:
        solver = compiled(arm(), backend)
        found = solver.follow(targets, force, q_motors0=loaded, tolerance=_ON_TARGET).q_motors
        tips = [solve_equilibrium(arm(), q, force, tolerance=1e-13).tip_position for q in found]
        require_agreement(backend, np.array(tips), targets, 2.0 * _ON_TARGET, "m")
        return Workload(len(targets), lambda: solver.follow(targets, force, q_motors0=loaded, tolerance=_ON_TARGET))

    def pink(name: str, limits: bool) -> Workload:
        solver = PinkArm(arm(), limits=limits)
        found = solver.follow(targets, rigid, tolerance=_ON_TARGET)
        tips = [frame_placement(arm(), arm().configuration(q), arm().tip).translation for q in found]
        require_agreement(name, np.array(tips), targets, 2.0 * _ON_TARGET, "m")
        return Workload(len(targets), lambda: solver.follow(targets, rigid, tolerance=_ON_TARGET))

    for backend in BACKENDS:
        comparison.add(f"compiled, {backend}", partial(ours, backend))
    for name, limits in ((PINK, False), (PINK_LIMITS, True)):
        comparison.add(name, partial(pink, name, limits))
    comparison.run()
    job = f"trajectory, a waypoint of {settings.waypoints}"
    rows = [
        comparison.cheaper(job, "compiled, numba", PINK_LIMITS, AT_LEAST, 350.0),
        comparison.cheaper(job, "compiled, numba", PINK),
        comparison.cheaper(job, "compiled, python", PINK),
    ]
    return Outcome(rows)


def _measured(count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Motor angles, motor torques and the forces behind them, in poses whose motors feel every direction, (count, 3) each."""
    found = []
    for q_motors, force in zip(*standard_cases(4 * count), strict=True):
        known = solve_equilibrium(arm(), q_motors, force, tolerance=1e-13)
        felt = frame_jacobian(arm(), known.q, arm().tip)[:3, arm().motor_indices]
        if np.linalg.cond(felt) < _CLEAR:
            found.append((q_motors, known.motor_torques, force))
        if len(found) == count:
            break
    motors, torques, forces = (np.array(part) for part in zip(*found, strict=True))
    return motors, torques, forces


def _force(found: Any) -> FloatArray:
    return np.asarray(found.force)
