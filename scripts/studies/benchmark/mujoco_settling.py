"""Equilibria by letting a simulation come to rest: MuJoCo with the file that softrobots exports. Needs MuJoCo (`interop`).

As good as it gets: motors are welded, and turned by writing the placements of their bodies, so that no case compiles a model
and only springs move; there are no joint limits; many steps are one call into C; the force stands at the centre of mass of the
tip, which is moved to the tip's origin, so that it need not follow the pose. Time step, damping and steps between two looks are
searched on a grid for the least CPU time. Contacts are on, as in the file.

With time steps far beyond those of a simulation and as much damping, MuJoCo's implicit damping becomes a relaxation method: the
motion on the way is nothing, the end is the equilibrium, and it is cheaper by half. It is timed, too.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import MissingDependency, NotConverged
from softrobots.export import to_mjcf
from softrobots.model.soft_model import SoftModel

TOLERANCE = 1e-10
"""It has settled where damping times speed is below this times force times reach: as much is out of balance, to first order."""

TIME_STEPS = (0.002, 0.005, 0.01)
"""Time steps to try, from MuJoCo's default on: of a simulation [s]."""
LARGE_STEPS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Time steps with which only the end is still that of the robot: MuJoCo as a relaxation method [s]."""
DAMPINGS = (4.0, 8.0, 12.0, 16.0, 24.0, 40.0, 80.0)
"""Dampings of the spring joints to try [N m s/rad]."""
STRIDES = (10, 20, 40)
"""Steps between two looks to try."""

_MOST = 20_000  # steps
_FASTEST = 1e3  # [rad/s], of a simulation that still goes anywhere


class Tuning(NamedTuple):
    """Settings of a simulation, and what settling costs with them."""

    time_step: float
    """Time step [s]."""
    damping: float
    """Damping of the spring joints [N m s/rad]."""
    stride: int
    """Steps between two looks whether it has settled."""
    seconds: float
    """CPU time a case; infinite if a case did not settle [s]."""
    steps: float
    """Mean number of steps a case."""


def require_mujoco() -> Any:
    """Import MuJoCo, or raise MissingDependency."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependency("mujoco", "interop") from error
    return mujoco


class SettlingArm:
    """A robot in MuJoCo, whose motors stand where they are put."""

    tolerance = TOLERANCE
    """See `TOLERANCE`."""

    def __init__(self, model: SoftModel) -> None:
        """Make MuJoCo's models.

        Args:
            model: A robot with revolute motors, without sections and muscles.

        Raises:
            MissingDependency: If MuJoCo is not installed.
        """
        mujoco = require_mujoco()
        self._mujoco = mujoco
        driven = mujoco.MjModel.from_xml_string(to_mjcf(model, limits=False))
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(model, actuators="welded", limits=False))
        self.data = mujoco.MjData(self.model)
        self._motors = []
        for name in model.motor_joints:
            joint = driven.joint(name)
            body = self.model.body(driven.body(int(joint.bodyid[0])).name)
            self._motors.append((int(body.id), np.array(joint.axis), np.array(body.quat)))
        self._springs = [int(self.model.joint(name).qposadr[0]) for name in model.spring_joints]
        self._tip, self._reach = int(self.model.body(model.tip).id), model.reach
        self.model.body_ipos[self._tip] = 0.0
        self.stride = STRIDES[0]

    def set(self, time_step: float, damping: float, stride: int) -> None:
        """Choose the settings; see `Tuning`."""
        self.model.opt.timestep, self.stride = time_step, stride
        self.model.dof_damping[:] = damping

    def settle(self, q_motors: FloatArray, force: FloatArray) -> tuple[FloatArray, int]:
        """Simulate from the relaxed springs at rest until nothing moves.

        Args:
            q_motors: Motor angles, shape (n_motors,) [rad].
            force: Force on the tip, world axes, shape (3,) [N].

        Returns:
            Spring angles, shape (n_springs,) [rad], and the steps taken.

        Raises:
            NotConverged: If it does not settle.
        """
        mujoco, model, data = self._mujoco, self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:] = model.qpos_spring
        moment = self._apply(q_motors, force)
        damping = float(model.dof_damping[0])
        slow = self.tolerance * moment / damping
        steps, speed = 0, math.inf
        while steps < _MOST:
            mujoco.mj_step(model, data, nstep=self.stride)
            steps += self.stride
            speed = float(np.abs(data.qvel).max())
            if data.time < (steps - 0.5) * model.opt.timestep or not speed < _FASTEST:  # MuJoCo starts anew what is unstable
                break
            if speed <= slow:
                return data.qpos[self._springs], steps
        message = f"MuJoCo did not settle in {steps} steps of {model.opt.timestep:g} s with damping {damping:g} N m s/rad"
        raise NotConverged(message, best=np.array(data.qpos[self._springs]), residual=damping * speed, iterations=steps)

    def _apply(self, q_motors: FloatArray, force: FloatArray) -> float:
        """Put motors and load in place; return the size of the moment of the load [N m]."""
        for (body, axis, placed), angle in zip(self._motors, q_motors.tolist(), strict=True):
            turn = np.zeros(4)
            self._mujoco.mju_axisAngle2Quat(turn, axis, angle)
            self._mujoco.mju_mulQuat(self.model.body_quat[body], placed, turn)
        self.data.xfrc_applied[self._tip, :3] = force
        return math.sqrt(float(force @ force)) * self._reach

    def tune(
        self,
        q_motors: FloatArray,
        forces: FloatArray,
        *,
        time_steps: Sequence[float] = TIME_STEPS,
        dampings: Sequence[float] = DAMPINGS,
        strides: Sequence[int] = STRIDES,
    ) -> list[Tuning]:
        """Try all combinations of settings, and choose the one that costs least of those that settle in all cases.

        Args:
            q_motors: Motor angles of the cases to try them on, shape (n, n_motors) [rad].
            forces: Their forces, shape (n, 3) [N].
            time_steps: Time steps to try [s].
            dampings: Dampings to try [N m s/rad].
            strides: Steps between two looks to try.

        Returns:
            What each costs, the best first.

        Raises:
            NotConverged: If none settles in all cases.
        """
        before = self._mujoco.get_mju_user_warning()
        self._mujoco.set_mju_user_warning(lambda message: None)  # of unstable simulations; MuJoCo would write a file of them
        try:
            tried = [self._try(setting, q_motors, forces) for setting in itertools.product(time_steps, dampings, strides)]
        finally:
            self._mujoco.set_mju_user_warning(before)
        tried.sort(key=lambda tuning: tuning.seconds)
        if not math.isfinite(tried[0].seconds):
            raise NotConverged("MuJoCo settles with none of the settings", best=tried, residual=math.inf, iterations=len(tried))
        self.set(*tried[0][:3])
        return tried

    def _try(self, setting: tuple[float, float, int], q_motors: FloatArray, forces: FloatArray) -> Tuning:
        """What settings cost."""
        self.set(*setting)
        began, steps = time.process_time(), 0
        try:
            for motors, force in zip(q_motors, forces, strict=True):
                steps += self.settle(motors, force)[1]
        except NotConverged:
            return Tuning(*setting, math.inf, math.inf)
        return Tuning(*setting, (time.process_time() - began) / len(forces), steps / len(forces))


class SettlingTendons(SettlingArm):
    """A robot of hinges in MuJoCo that tendons bend, with its weight; the inputs of its actuators are MuJoCo's `ctrl`."""

    def __init__(self, model: SoftModel, gravity: tuple[float, float, float]) -> None:
        """Make MuJoCo's model.

        Args:
            model: A robot with actuators along lumped sections, and no motor joints.
            gravity: Gravity, world axes [m/s^2].

        Raises:
            MissingDependency: If MuJoCo is not installed.
        """
        mujoco = require_mujoco()
        self._mujoco = mujoco
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(model, gravity=gravity, limits=False))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(self.model)
        self._springs = [int(self.model.joint(name).qposadr[0]) for name in model.spring_joints]
        weight = float(sum(body.mass for body in model.pinocchio.inertias)) * math.hypot(*gravity)
        self._moment, self.stride = float(weight * model.reach), STRIDES[0]

    def _apply(self, q_motors: FloatArray, force: FloatArray) -> float:
        self.data.ctrl[:] = q_motors
        return self._moment
