"""Jobs of an arm that tendons bend: equilibria of nine elastic tendons under weight, for commands that a real arm was given."""

from __future__ import annotations

import dataclasses
from functools import lru_cache, partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import TendonArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import EARTH_GRAVITY
from studies.benchmark.arm_baselines import GENERAL, MUJOCO, MUJOCO_ANY, one_by_one, single_name
from studies.benchmark.cases import LoadCases
from studies.benchmark.comparison import Comparison, Outcome, Settings, figure
from studies.benchmark.compiled_solvers import compiled
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.mujoco_settling import LARGE_STEPS, TIME_STEPS, SettlingTendons
from studies.benchmark.results import AT_LEAST, AT_MOST, Row
from studies.measured_arm.nominal import motor_lengths
from studies.measured_arm.recordings import read_recording

GRAVITY = (0.0, 0.0, -EARTH_GRAVITY[2])
"""Of an arm that hangs down, in the frame of its base [m/s^2]."""
DAMPINGS = (0.003, 0.01, 0.02, 0.03, 0.06, 0.1, 0.2)
"""Dampings of MuJoCo's hinges to try [N m s/rad]."""
_SAME = 1e-8  # [m], of tips whose residuals are below 1e-10 of the load
_NEAR = 0.02  # share of the length by which the tip of four hinges a segment may miss that of four sections
_TUNED = 8  # cases that the simulator is tuned on


@lru_cache(maxsize=2)
def tendon_arm(chain: str) -> SoftModel:
    """Three segments of four sections, or of four pairs of hinges that only bend, what MuJoCo settles fastest with."""
    if chain == "sections":
        return load_model(TendonArm(elastic_sections=4))
    return load_model(TendonArm(chain=chain, hinges=4, torsion=False, extension=False))


def tendons(settings: Settings) -> Outcome:
    """Equilibria one by one, checked, against MuJoCo's settling."""
    comparison, cases, notes = Comparison(settings, "tendons"), commands(settings.singles), list[str]()
    arm = tendon_arm("sections")
    found = [solve_equilibrium(arm, q, gravity=GRAVITY, tolerance=1e-13) for q in cases.q_motors[:_TUNED]]
    tips = np.array([one.tip_position for one in found])

    def ours(name: str) -> Workload:
        solve: Any = compiled(arm, "numba").equilibrium if name != GENERAL else partial(solve_equilibrium, arm)
        solve = partial(solve, gravity=GRAVITY)
        return one_by_one(name, solve, cases, tips, read=lambda one: one.tip_position, tolerance=_SAME, unit="m")

    fast, job = single_name("numba"), "nine elastic tendons, weight, one checked call"
    for name in (GENERAL, fast):
        comparison.add(name, partial(ours, name))
    for name in (MUJOCO, MUJOCO_ANY):
        comparison.add(name, partial(_settling, name, settings, cases, tips, notes))
    comparison.run()
    rows = [
        _seconds(comparison, job, GENERAL, 5e-3),
        _seconds(comparison, job, fast, 1e-4),
        comparison.cheaper(job, fast, MUJOCO, AT_LEAST, 50.0),
        comparison.cheaper(job, fast, MUJOCO_ANY),
        comparison.cheaper(job, GENERAL, MUJOCO),
    ]
    return Outcome(rows, notes=notes)


def commands(count: int) -> LoadCases:
    """Motor lengths of rows of the recordings, evenly taken from all movements, without forces."""
    pulls = read_recording("train").pulls
    chosen = pulls[np.linspace(0, len(pulls) - 1, count).astype(int)]
    return LoadCases(motor_lengths(tendon_arm("sections"), chosen), np.zeros((count, 3)))


def _seconds(comparison: Comparison, job: str, name: str, target: float) -> Row:
    """CPU time of a call."""
    values = comparison.seconds[name] if name in comparison.seconds else comparison.absent[name]
    return dataclasses.replace(figure(job, name, "s", values, AT_MOST, target), clock="CPU")


def _settling(name: str, settings: Settings, cases: LoadCases, tips: FloatArray, notes: list[str]) -> Workload:
    """MuJoCo with the best settings of the grid."""
    arm = tendon_arm("lumped")
    simulator = SettlingTendons(arm, GRAVITY)
    time_steps = TIME_STEPS if name == MUJOCO else (*TIME_STEPS, *LARGE_STEPS)
    some = cases.first(1 if settings.quick else _TUNED)
    tried = simulator.tune(*some, time_steps=time_steps, dampings=DAMPINGS)
    best = tried[0]
    settled = [simulator.settle(*case)[0] for case in zip(*cases.first(len(tips)), strict=True)]
    poses = [frame_placement(arm, arm.configuration(q, y), arm.tip) for q, y in zip(cases.q_motors, settled, strict=False)]
    there = np.array([pose.translation for pose in poses])
    require_agreement(name, there, tips, _NEAR * arm.reach, "m")
    apart = 1e3 * float(np.linalg.norm(there - tips, axis=1).max())
    notes.append(
        f"tendons, {name}: time step {best.time_step:g} s, damping {best.damping:g} N m s/rad, {best.stride} steps "
        f"between two looks, {best.steps:.0f} steps a case, the best of {len(tried)} settings; four pairs of hinges a segment "
        f"that neither twist nor stretch, whose tip is {apart:.2g} mm or less from that of four sections"
    )
    pairs = list(zip(*cases, strict=True))
    return Workload(len(pairs), lambda: [simulator.settle(*pair) for pair in pairs])
