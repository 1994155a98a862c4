"""The robot of a sweep as plain data for other processes, and compiled: search for motor angles, and the pressure they need."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple
from xml.dom import minidom

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel, compile_model
from softrobots.compiled.statuses import Status
from softrobots.compiled.sweeps.postures import Branch, branches, within_turns
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.description.renaming import children
from softrobots.model.loader import load_again
from softrobots.model.soft_model import SoftModel
from softrobots.statics.workspace_map import BoolArray, required_pressures
from softrobots.version import __version__

_FREE = 6.0 * math.pi  # [rad]


@dataclass(frozen=True)
class SweepCase:
    """Robot, loads and options of the solver; equal cases make equal solvers."""

    urdf: str
    """Description of the robot."""
    springs: tuple[tuple[str, float, float], ...]
    """Name, stiffness [N m/rad] and rest [rad] of the springs."""
    motors: tuple[str, ...]
    """Names of the motor joints."""
    tip: str
    """Frame that carries the load."""
    direction: tuple[float, float, float]
    """Unit vector of the load, world axes."""
    loads: tuple[float, ...]
    """Sizes of the load, increasing [N]."""
    gravity: tuple[float, float, float] | None
    """Gravity, world axes [m/s^2]; None: weightless."""
    tolerance: float
    """Largest distance of the tip from its target [m]."""
    backend: str
    """Back end of the compiled solver: the same one on all workers, because the last digits differ."""
    version: str = __version__
    """Version of softrobots that made the case."""

    @classmethod
    def of(cls, model: SoftModel, direction: FloatArray, loads: FloatArray, **fields: Any) -> SweepCase:
        """Take the robot from a model; the other arguments are the fields."""
        x, y, z = direction.tolist()
        springs = tuple((name, *tag) for name, tag in model.spring_table.items())
        return cls(model.urdf, springs, model.motor_joints, model.tip, (x, y, z), tuple(loads.tolist()), **fields)

    def model(self) -> SoftModel:
        """The robot."""
        return self._load(self.urdf)

    def free_model(self) -> SoftModel:
        """The robot with motor limits of several turns either way."""
        document = minidom.parseString(self.urdf)
        for joint in (part for robot in children(document) for part in children(robot)):
            if joint.tagName == "joint" and joint.getAttribute("name") in self.motors:
                for limit in joint.getElementsByTagName("limit"):
                    limit.setAttribute("lower", repr(-_FREE))
                    limit.setAttribute("upper", repr(_FREE))
        return self._load(document.toxml())

    def _load(self, urdf: str) -> SoftModel:
        springs = {name: (stiffness, rest) for name, stiffness, rest in self.springs}
        return load_again(urdf, springs=springs, motors=self.motors, tip=self.tip)


class SearchResult(NamedTuple):
    """Results of a batch of searches, one row a lane."""

    solved: BoolArray
    """Whether the search ended in a stable equilibrium at the target."""
    reached: BoolArray
    """Whether that is also within the limits of motors and springs."""
    required_pressure: FloatArray
    """Smallest pressure at which no link wrinkles [Pa]; infinite where not reached."""
    excess: FloatArray
    """Largest difference of it from the pressure of a link, negative if all suffice [Pa]; infinite likewise."""
    pose: FloatArray
    """Motor angles, turned by whole turns into the limits where possible, then springs, shape (n, n_motors + n_springs) [rad].

    The start of the search where not solved.
    """


class ArmSolver:
    """A compiled arm with its postures and links, made once in each worker."""

    def __init__(self, case: SweepCase) -> None:
        """Load and compile the robot.

        Raises:
            ParameterError: If the case was made by another version of softrobots.
            MissingDependency: If the back end of the case is not installed.
        """
        if case.version != __version__:
            raise ParameterError("version of softrobots", __version__, f"{case.version}, as in the process that maps")
        self.case = case
        self.model: SoftModel = case.model()
        self.compiled: CompiledModel = compile_model(case.free_model(), backend=case.backend)
        self.branches: tuple[Branch, ...] = branches(self.model, self.compiled)
        self.pressures = np.array([group.pressure for group in self.model.spring_groups])

    def search(self, targets: FloatArray, loads: FloatArray, start: FloatArray) -> SearchResult:
        """Search for poses that put the tip at targets under loads, each from a start of its own.

        The search has no motor limits: a limit could only keep it from a pose within the limits a whole turn away.

        Args:
            targets: Targets, shape (n, 3) [m].
            loads: Sizes of the load, shape (n,) [N].
            start: Poses to start from, shape (n, n_motors + n_springs) [rad].
        """
        batch = self.compiled.inverse_kinematics(
            targets,
            loads[:, None] * np.array(self.case.direction),
            q_motors0=start[:, : self.model.n_motors],
            q_springs0=start[:, self.model.n_motors :],
            gravity=self.case.gravity,
            tolerance=self.case.tolerance,
        )
        solved = np.asarray(batch.status == Status.CERTIFIED)
        motors, allowed = within_turns(self.model, np.where(solved[:, None], batch.q_motors, start[:, : self.model.n_motors]))
        springs = np.where(solved[:, None], batch.q_springs, start[:, self.model.n_motors :])
        low, high = self.model.spring_limits.T
        reached = solved & allowed & ((springs >= low) & (springs <= high)).all(axis=1)
        needed = required_pressures(self.model, springs)
        largest, excess = needed.max(axis=1), (needed - self.pressures).max(axis=1)
        pose = np.hstack([motors, springs])
        return SearchResult(solved, reached, np.where(reached, largest, np.inf), np.where(reached, excess, np.inf), pose)


_lock = threading.Lock()  # lru_cache would let two threads of a worker compile the same robot


@lru_cache(maxsize=4)
def _kept_solver(case: SweepCase) -> ArmSolver:
    return ArmSolver(case)


def solver(case: SweepCase) -> ArmSolver:
    """Return the solver of a case, made on first use in each process."""
    with _lock:
        return _kept_solver(case)
