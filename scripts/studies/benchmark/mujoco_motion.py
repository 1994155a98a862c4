"""Motion of an exported robot in MuJoCo, with the integrator and the step that cost least at a given error of the tip."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.export import to_mjcf
from softrobots.statics.equilibrium import Equilibrium
from studies.benchmark.mujoco_settling import require_mujoco

INTEGRATORS = ("RK4", "implicitfast", "Euler")
"""Integrators to try, by MuJoCo's names."""
_LONGEST, _SHORTEST = 1e-2, 1e-5  # [s]


class Released(NamedTuple):
    """A robot that is let go: from an equilibrium, under gravity alone."""

    start: Equilibrium
    """Where it begins."""
    gravity: tuple[float, float, float]
    """Gravity [m/s^2]."""
    damping_time: float
    """Damping over stiffness [s]."""
    row_step: float
    """Time between two positions of the tip that are compared [s]."""
    rows: int
    """Number of them after the first."""

    @property
    def duration(self) -> float:
        """Time that is simulated [s]."""
        return self.row_step * self.rows


class MujocoMotion:
    """A released robot in MuJoCo, motors welded, no limits, no contacts.

    Raises:
        MissingDependency: If MuJoCo is not installed.
    """

    def __init__(self, released: Released) -> None:
        mujoco = require_mujoco()
        start = released.start
        text = to_mjcf(start.model, start.q_motors, actuators="welded", damping=released.damping_time, limits=False)
        self._mujoco, self._released = mujoco, released
        self.model = mujoco.MjModel.from_xml_string(text)
        self.model.opt.gravity[:] = released.gravity
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self._data = mujoco.MjData(self.model)
        self._springs = [int(self.model.joint(name).qposadr[0]) for name in start.model.spring_joints]
        self._tip = int(self.model.body(start.model.tip).id)
        self._per_row = 1

    def set(self, integrator: str, per_row: int) -> None:
        """Choose the integrator, and the number of steps between two rows."""
        self.model.opt.integrator = getattr(self._mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        self.model.opt.timestep = self._released.row_step / per_row
        self._per_row = per_row

    def path(self) -> FloatArray:
        """The tip at all rows, shape (rows + 1, 3) [m]; not a number after a simulation that broke down."""
        mujoco, data = self._mujoco, self._data
        mujoco.mj_resetData(self.model, data)
        data.qpos[self._springs] = self._released.start.q_springs
        tips = np.full((self._released.rows + 1, 3), np.nan)
        for row in range(len(tips)):
            mujoco.mj_kinematics(self.model, data)
            tips[row] = data.xpos[self._tip]
            mujoco.mj_step(self.model, data, nstep=self._per_row)
            if data.time < (row + 0.5) * self._released.row_step:  # MuJoCo starts anew what is unstable
                return np.full_like(tips, np.nan)
        return tips

    def tune(self, expected: FloatArray, error: float) -> str:
        """Choose what costs least of all that keep the mean error of the tip; return what it is.

        Raises:
            SoftRobotsError: If no step down to 10 us is enough.
        """
        before = self._mujoco.get_mju_user_warning()
        self._mujoco.set_mju_user_warning(lambda message: None)
        found = []
        try:
            for integrator in INTEGRATORS:
                per_row = max(1, round(self._released.row_step / _LONGEST))
                while self._released.row_step / per_row >= _SHORTEST:
                    self.set(integrator, per_row)
                    began = time.process_time()
                    tips = self.path()
                    seconds = time.process_time() - began
                    if tip_error(tips, expected) <= error:
                        found.append((seconds, integrator, per_row, tip_error(tips, expected)))
                        break
                    if found and seconds > 4.0 * min(found)[0]:
                        break
                    per_row = max(per_row + 1, round(per_row * 1.1))
        finally:
            self._mujoco.set_mju_user_warning(before)
        if not found:
            raise SoftRobotsError(f"MuJoCo has no step that keeps the tip within {1e3 * error:.3g} mm")
        _, integrator, per_row, reached = min(found)
        self.set(integrator, per_row)
        return f"{integrator}, steps of {1e3 * self._released.row_step / per_row:.3g} ms, {1e3 * reached:.2g} mm"


def tip_error(tips: FloatArray, expected: FloatArray) -> float:
    """Mean distance of two paths [m]; infinite if one broke down."""
    error = float(np.linalg.norm(tips - expected, axis=1).mean())
    return error if np.isfinite(error) else np.inf
