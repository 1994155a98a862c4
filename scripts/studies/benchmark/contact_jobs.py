"""Jobs of contact: an arm that leans on a wall, a ball or a box, and a rod on ten pegs; MuJoCo settles on wall and pegs."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged, SoftRobotsError
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Cylinder, HalfSpace, Obstacle, Sphere
from softrobots.export import to_mjcf
from softrobots.export.mjcf_contact import steadying_armature
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.equilibrium_result import Equilibrium
from studies.benchmark.arm_baselines import GENERAL, MUJOCO, MUJOCO_ANY, batch_name, single_name
from studies.benchmark.cases import ROD_LENGTH, LoadCases, arm, random_forces, rod
from studies.benchmark.comparison import Comparison, Outcome, Settings, figure
from studies.benchmark.compiled_solvers import compiled
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.mujoco_settling import DAMPINGS, LARGE_STEPS, TIME_STEPS, SettlingArm, require_mujoco
from studies.benchmark.results import AT_LEAST, AT_MOST, Row
from studies.contact_forces.comparison import FORCE_TOLERANCE, forces_of
from studies.interop.mujoco_statics import obstacle_forces

PEGS, SECTIONS = 10, 30
"""Pegs under the rod, and its sections."""
AS_EXPORTED = "MuJoCo settling, file as exported"
LOOSELY = "MuJoCo settling, file as exported, forces within 0.001"
_LOOSE = tuple(10.0**-power for power in range(1, 11))  # out of balance over force times reach, to stop at
_MOTORS = (0.3, 0.6, -0.8)  # of the arm [rad]
_PUSH, _TOUCH = 18.03, 0.02  # force on the tip of the arm [N], and distance of the wall from it, unloaded [m]
_BALL = 0.3  # radius of the ball, and half an edge of the box, that the arm leans on [m]
_ASIDE = 9.81  # weight of the rod, across it [m/s^2]
_SHARE = 0.6  # of the deflection of the rod under its weight, at which the pegs stand
_TIP_FORCE = 0.05  # on the tip of the rod [N]
_ACROSS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # turns z to y
_PEG, _PEG_LENGTH = 0.01, 0.3  # radius and length of a peg [m]
_TUNED = 8  # cases that the simulator is tuned on, at most a fifth of all
_BATCH, _SINGLE = batch_name("numba"), single_name("numba")
_CHECKED = 10  # cases whose forces are compared before anything is timed


class Scene(NamedTuple):
    """A robot that rests on obstacles, and forces on its tip."""

    name: str
    """What is solved."""
    ours: SoftModel
    """The robot."""
    theirs: SoftModel
    """The robot as MuJoCo has it."""
    environment: Environment
    """The obstacles."""
    gravity: tuple[float, float, float]
    """Gravity, world axes [m/s^2]."""
    cases: LoadCases
    """Motors and forces."""
    dampings: Sequence[float]
    """Dampings of MuJoCo's joints to try [N m s/rad]."""
    target: float
    """Largest time of our call [s]."""

    hinges: str
    """What MuJoCo's robot is, for the notes."""

    def solve(self, model: SoftModel, q_motors: FloatArray, force: FloatArray) -> Equilibrium:
        """Our equilibrium of a case."""
        return solve_equilibrium(model, q_motors, force, gravity=self.gravity, environment=self.environment)


class SettlingSurroundings(SettlingArm):
    """A robot in MuJoCo that comes to rest on obstacles, motors welded; with the settings of the file until `set` is called."""

    def __init__(self, scene: Scene) -> None:
        """Make MuJoCo's model of the scene, at the motors of its first case.

        Raises:
            MissingDependency: If MuJoCo is not installed.
        """
        mujoco, theirs = require_mujoco(), scene.theirs
        self._mujoco = mujoco
        options = {"damping": "critical", "gravity": scene.gravity, "environment": scene.environment, "limits": False}
        self.model = mujoco.MjModel.from_xml_string(
            to_mjcf(theirs, scene.cases.q_motors[0], actuators="welded", **options)  # type: ignore[arg-type]  # of several types
        )
        self.data = mujoco.MjData(self.model)
        self._springs = [int(self.model.joint(name).qposadr[0]) for name in theirs.spring_joints]
        self._tip, self._reach = int(self.model.body(theirs.tip).id), theirs.reach
        self._weight = float(sum(body.mass for body in theirs.pinocchio.inertias)) * math.hypot(*scene.gravity)
        self.model.body_ipos[self._tip] = 0.0
        self.stride = 20

    def set(self, time_step: float, damping: float, stride: int) -> None:
        """Choose the settings, with the armature that keeps contacts from chattering."""
        super().set(time_step, damping, stride)
        self.model.dof_armature[:] = steadying_armature(damping, time_step)

    def _apply(self, q_motors: FloatArray, force: FloatArray) -> float:
        self.data.xfrc_applied[self._tip, :3] = force
        return (self._weight + math.sqrt(float(force @ force))) * self._reach

    def obstacle_forces(self, names: Sequence[str]) -> FloatArray:
        """Forces of obstacles on the robot where it has settled, shape (n, 3) [N]."""
        return stacked(obstacle_forces(self._mujoco, self.model, self.data), names)


def stacked(forces: Mapping[str, FloatArray], names: Sequence[str]) -> FloatArray:
    """Forces by name as rows, zero where there is none, shape (n, 3) [N]."""
    return np.array([forces.get(name, np.zeros(3)) for name in names])


@lru_cache(maxsize=1)
def leaning_arm(count: int, on: str = "wall") -> Scene:
    """The arm, weightless, pushed by forces in random directions on a wall, a ball or a box, that it touches in one place."""
    x, y, z = solve_equilibrium(arm(), _MOTORS).tip_position.tolist()
    surface = y + 0.055 + _TOUCH
    behind = (x, surface + _BALL, z)
    obstacles: dict[str, Obstacle] = {
        "wall": HalfSpace((0.0, -1.0, 0.0), -surface),
        "ball": Sphere(_BALL, behind),
        "box": Box((2.0 * _BALL,) * 3, behind),
    }
    forces = random_forces(4 * count, _PUSH)
    aside = forces[forces[:, 1] > 0.6 * _PUSH][:count]
    motors = np.tile(_MOTORS, (len(aside), 1))
    name, around = f"arm on a {on}, one contact", Environment([obstacles[on]])
    still = (0.0, 0.0, 0.0)
    return Scene(name, arm(), arm(), around, still, LoadCases(motors, aside), DAMPINGS, 5e-4, "the same arm")


@lru_cache(maxsize=1)
def lying_rod(count: int, sections: int) -> Scene:
    """A rod that lies on pegs under its weight, with small forces on its tip; the pegs follow its own deflection, flatter."""
    ours, theirs, gravity = rod(sections), rod(sections, "lumped"), (-_ASIDE, 0.0, 0.0)
    sag = _SHARE * float(solve_equilibrium(ours, (), gravity=gravity).tip_position[0])
    along = np.arange(1, PEGS + 1) / (PEGS + 0.5)
    below = sag * along**2 * (6.0 - 4.0 * along + along**2) / 3.0 - ours.structure.tags.capsules[0].radius - _PEG
    places = zip(below.tolist(), (ROD_LENGTH * along).tolist(), strict=True)
    pegs = Environment([Cylinder(_PEG, _PEG_LENGTH, (x, 0.0, z), _ACROSS) for x, z in places])
    forces = random_forces(count, _TIP_FORCE)
    cases = LoadCases(np.zeros((count, 0)), forces)
    name = f"rod of {sections} sections on {PEGS} pegs"
    hinges = f"a rod of {sections} pairs of hinges"
    return Scene(name, ours, theirs, pegs, gravity, cases, (0.3, 1.0, 3.0, 10.0, 30.0), 2e-2, hinges)


def contact(settings: Settings) -> Outcome:
    """Equilibria on obstacles one by one, checked, against MuJoCo's settling."""
    rows, notes = list[Row](), list[str]()
    for scene in (leaning_arm(settings.singles), lying_rod(max(2, settings.singles // 20), 3 if settings.quick else SECTIONS)):
        comparison = Comparison(settings, scene.name)
        comparison.add(GENERAL, partial(_ours, scene))
        comparison.add(_BATCH, partial(_batch, scene))
        comparison.add(_SINGLE, partial(_single, scene))
        for name in (AS_EXPORTED, LOOSELY, MUJOCO, MUJOCO_ANY):
            comparison.add(name, partial(_settling, name, settings, scene, notes))
        comparison.run()
        rows += [_time(comparison, scene, name) for name in (GENERAL, _SINGLE)]
        rows.append(comparison.cheaper(scene.name, GENERAL, AS_EXPORTED, AT_LEAST, 20.0))
        rows += [comparison.cheaper(scene.name, GENERAL, name) for name in (LOOSELY, MUJOCO, MUJOCO_ANY)]
        rows.append(comparison.cheaper(scene.name, _SINGLE, AS_EXPORTED, AT_LEAST, 20.0))
        rows += [comparison.cheaper(scene.name, _BATCH, name, AT_LEAST, 20.0) for name in (AS_EXPORTED, LOOSELY)]
    for on in ("ball", "box"):
        scene = leaning_arm(settings.singles, on)
        comparison = Comparison(settings, scene.name)
        comparison.add(GENERAL, partial(_ours, scene))
        comparison.run()
        rows.append(_time(comparison, scene, GENERAL))
    return Outcome(rows, notes=notes)


def _time(comparison: Comparison, scene: Scene, name: str) -> Row:
    """What an equilibrium of a scene takes."""
    values = comparison.seconds[name] if name in comparison.seconds else comparison.absent[name]
    return dataclasses.replace(figure(scene.name, name, "s", values, AT_MOST, scene.target), clock="CPU")


def _ours(scene: Scene) -> Workload:
    pairs = list(zip(*scene.cases, strict=True))
    return Workload(len(pairs), lambda: [scene.solve(scene.ours, *pair) for pair in pairs])


def _batch(scene: Scene) -> Workload:
    """Compiled equilibria of MuJoCo's robot, each from rest; forces are those of our solver.

    Raises:
        SoftRobotsError: If they are not.
    """
    options: Any = {"gravity": scene.gravity if any(scene.gravity) else None, "environment": scene.environment}
    solve: Any = partial(compiled(scene.theirs, "numba").equilibria, *scene.cases, **options)
    some = scene.cases.first(_CHECKED)
    found = solve().obstacle_forces[: len(some.forces)]
    expected = np.array(
        [stacked(forces_of(scene.solve(scene.theirs, *case)), scene.environment.names) for case in zip(*some, strict=True)]
    )
    require_agreement(_BATCH, found, expected, 1e-9 * float(np.abs(expected).max()), "N")
    return Workload(len(scene.cases.forces), solve)


def _single(scene: Scene) -> Workload:
    """The same one by one, each checked and certified."""
    solve = compiled(scene.theirs, "numba").equilibrium
    options: Any = {"gravity": scene.gravity if any(scene.gravity) else None, "environment": scene.environment}
    pairs = list(zip(*scene.cases, strict=True))
    return Workload(len(pairs), lambda: [solve(*pair, **options) for pair in pairs])


def _settling(name: str, settings: Settings, scene: Scene, notes: list[str]) -> Workload:
    """MuJoCo as the file says, or with the best settings of the grid; its forces are those of our solver on its robot.

    It stops where it is out of balance by less than 1e-10 of force times reach, as our solver does, or at the coarsest power of
    ten with which all forces of the cases that are checked are right.
    """
    simulator, said = SettlingSurroundings(scene), ""
    if name == AS_EXPORTED:
        steps, apart = _checked(simulator, scene, name)
    elif name == LOOSELY:
        for simulator.tolerance in _LOOSE:
            said = f", at {simulator.tolerance:g} of force times reach out of balance"
            with contextlib.suppress(SoftRobotsError):
                steps, apart = _checked(simulator, scene, name)
                break
        else:
            raise NotConverged(f"{name}: at no criterion", best=None, residual=math.inf, iterations=0)
    else:
        time_steps = TIME_STEPS if name == MUJOCO else (*TIME_STEPS, *LARGE_STEPS)
        some = scene.cases.first(max(1, min(_TUNED, len(scene.cases.forces) // 5)))
        for best in simulator.tune(*some, time_steps=time_steps, dampings=scene.dampings):
            simulator.set(*best[:3])
            said = f", time step {best.time_step:g} s, damping {best.damping:g} N m s/rad, the fastest whose forces are right"
            try:
                steps, apart = _checked(simulator, scene, name)
                break
            except SoftRobotsError:  # large steps and dampings make contact soft
                continue
        else:
            raise NotConverged(f"{name} has right forces with no settings", best=None, residual=math.inf, iterations=0)
    notes.append(
        f"{scene.name}, {name}{said}: {steps:.0f} steps a case; {scene.hinges}; forces within {apart:.1g} of ours there"
    )
    pairs = list(zip(*scene.cases, strict=True))
    return Workload(len(pairs), lambda: [simulator.settle(*pair) for pair in pairs])


def _checked(simulator: SettlingSurroundings, scene: Scene, name: str) -> tuple[float, float]:
    """Mean number of steps, and the largest difference of a force from ours on the same robot, relative to the largest force.

    Raises:
        SoftRobotsError: If it does not settle, or with other forces.
    """
    steps, names, apart = [], scene.environment.names, 0.0
    for case in zip(*scene.cases.first(_CHECKED), strict=True):
        steps.append(simulator.settle(*case)[1])
        expected = stacked(forces_of(scene.solve(scene.theirs, *case)), names)
        found, largest = simulator.obstacle_forces(names), float(np.abs(expected).max())
        require_agreement(name, found, expected, FORCE_TOLERANCE * largest, "N")
        apart = max(apart, float(np.abs(found - expected).max()) / largest)
    return float(np.mean(steps)), apart
