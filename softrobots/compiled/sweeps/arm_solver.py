"""A compiled arm with its postures and inflated links: searches motor angles, and tells the pressure that they need."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel, compile_model
from softrobots.compiled.statuses import Status
from softrobots.compiled.sweeps.load_case import SweepCase, package_version
from softrobots.compiled.sweeps.postures import Branch, branches, within_turns
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.workspace_map import BoolArray, required_pressures


class Found(NamedTuple):
    """What a batch of searches found, one row a lane."""

    solved: BoolArray
    """Whether the search arrived at a stable equilibrium."""
    reached: BoolArray
    """Whether it is within the limits of motors and springs, too."""
    required_pressure: FloatArray
    """Smallest pressure at which no link wrinkles [Pa]; infinite where not reached."""
    excess: FloatArray
    """How much of it is missing in the link that lacks most, negative if there is more than enough [Pa]; infinite likewise."""
    pose: FloatArray
    """Motor angles, within the limits if whole turns lead there, and then springs, shape (n, n_motors + n_springs) [rad].

    Where not solved, where the search began.
    """


class ArmSolver:
    """A compiled arm with its postures and its links: what a worker makes once and keeps."""

    def __init__(self, case: SweepCase) -> None:
        """Load and compile the robot.

        Raises:
            ParameterError: If the case comes from another version of softrobots.
            MissingDependency: If the back end of the case is not installed.
        """
        if case.version != package_version():
            raise ParameterError("version of softrobots", package_version(), f"{case.version}, the one that asks for maps")
        self.case = case
        self.model: SoftModel = case.model()
        self.compiled: CompiledModel = compile_model(case.free_model(), backend=case.backend)
        self.branches: tuple[Branch, ...] = branches(self.model, self.compiled)
        self.pressures = np.array([group.pressure for group in self.model.spring_groups])

    def search(self, targets: FloatArray, loads: FloatArray, start: FloatArray) -> Found:
        """Search poses that put the tip at targets under loads, each from a start of its own.

        The search knows no motor limits: a limit in its way would only keep it from a pose within them a whole turn away.

        Args:
            targets: Targets, shape (n, 3) [m].
            loads: Sizes of the load, shape (n,) [N].
            start: Poses to start from, shape (n, n_motors + n_springs) [rad].

        Returns:
            What was found.
        """
        answer = self.compiled.inverse_kinematics(
            targets,
            loads[:, None] * np.array(self.case.direction),
            q_motors0=start[:, : self.model.n_motors],
            q_springs0=start[:, self.model.n_motors :],
            gravity=self.case.gravity,
            tolerance=self.case.tolerance,
        )
        solved = np.asarray(answer.status == Status.CERTIFIED)
        motors, allowed = within_turns(self.model, np.where(solved[:, None], answer.q_motors, start[:, : self.model.n_motors]))
        springs = np.where(solved[:, None], answer.q_springs, start[:, self.model.n_motors :])
        low, high = self.model.spring_limits.T
        reached = solved & allowed & ((springs >= low) & (springs <= high)).all(axis=1)
        needed = required_pressures(self.model, springs)
        largest, excess = needed.max(axis=1), (needed - self.pressures).max(axis=1)
        pose = np.hstack([motors, springs])
        return Found(solved, reached, np.where(reached, largest, np.inf), np.where(reached, excess, np.inf), pose)


_making = threading.Lock()  # lru_cache would let two threads of a worker compile the same robot


@lru_cache(maxsize=4)
def _kept_solver(case: SweepCase) -> ArmSolver:
    return ArmSolver(case)


def solver(case: SweepCase) -> ArmSolver:
    """The solver of a case, made on first use in each process."""
    with _making:
        return _kept_solver(case)
