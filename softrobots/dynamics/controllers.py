"""Controllers of the motors of a robot, for `softrobots.simulate(motors="torque", torque=...)`.

Each is a function of time, and of positions and velocities of the motor joints, that returns their torques.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, instance_of, non_negative_number, one_each
from softrobots.core.errors import LoadNotFound, ParameterError
from softrobots.dynamics.time_inputs import checked_function, motor_function, waypoint_curve
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.equilibrium import Equilibrium, check_same_model
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.load_estimation import estimate_load
from softrobots.statics.loads import Load
from softrobots.statics.time_law import Path3D
from softrobots.statics.trajectory import Trajectory

_DIFFERENCE = 1e-5  # [s], of the velocity of a reference


class PD:
    r"""Proportional and derivative control of each motor joint, with a feed-forward of torques on demand.

    .. math:: \tau = k_p (u_d(t) - u) + k_d (\dot u_d(t) - \dot u) + \tau_f(t)

    Loaded joints come to rest where :math:`k_p (u_d - u)` carries the load. The trajectory that `follow_trajectory` finds
    for the loaded arm compensates load and weight twice: as reference its angles put the sagging tip on target ([Troise 2021]
    section 2.4), and as feed-forward the torques of its equilibria hold it there, so that no error is left at rest.
    """

    def __init__(self, model: SoftModel, reference: Any, kp: Any, kd: Any, *, feed_forward: Any = None) -> None:
        """Take reference and gains.

        Args:
            model: The robot, with at least one motor joint.
            reference: Positions of the actuators [rad, m or N], as `q_motors` of `softrobots.simulate`: constants, shape
                (n_motors,), a `Trajectory`, or a function of time, e.g. a `ShapedTrajectory`.
            kp: Proportional gain, a number or one for each motor joint, zero or positive [N m/rad or N/m].
            kd: Derivative gain, likewise [N m s/rad or N s/m].
            feed_forward: Torques that are added: constants, shape (n,) of the motor joints [N m or N], a function of time, or a
                `Trajectory`, whose equilibria then tell what the motors carry; None: none.

        Raises:
            ParameterError: If an argument is of another kind, out of range, or of another robot.
        """
        self.model = check_model(model)
        """The robot."""
        count = len(model.structure.motor_joints)
        if count == 0:
            raise ParameterError("model", model, "a robot with at least one motor joint")
        self._kp, self._kd = one_each("kp", kp, count, "N m/rad"), one_each("kd", kd, count, "N m s/rad")
        if callable(reference):
            reference = motor_function("reference", reference, model)
        else:
            reference = model.actuators.in_order(reference, "reference")
        kind = (model.n_motors, model.actuators.described)
        self._reference = _time_function(model, "reference", reference, kind, lambda one: one.q_motors)
        added = np.zeros(count) if feed_forward is None else feed_forward
        self._feed_forward = _time_function(model, "feed_forward", added, (count, "N m"), _exerted_torques)
        self._desired = lru_cache(maxsize=1)(self._desired_at)  # a step of time asks for many states at one time

    def __call__(self, time: float, q: FloatArray, qd: FloatArray) -> FloatArray:
        """Return the torques, shape (n,) [N m or N].

        Args:
            time: Time [s].
            q: Positions of the motor joints, shape (n,) [rad or m].
            qd: Their velocities, shape (n,) [rad/s or m/s].

        Raises:
            ParameterError: If a function of time returns something else than it must.
        """
        position, velocity, torque = self._desired(time)
        return np.asarray(self._kp * (position - q) + self._kd * (velocity - qd) + torque)

    def _desired_at(self, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions and velocities of the motor joints in the reference, and the feed-forward."""
        count = len(self._kp)
        before, here, after = (self._reference(time + shift)[:count] for shift in (-_DIFFERENCE, 0.0, _DIFFERENCE))
        return here, (after - before) / (2.0 * _DIFFERENCE), self._feed_forward(time)


class ClosedLoop:
    r"""The closed loop of [Troise 2021] on a moving arm: the tip is led along its path by what the motors feel.

    At each sample the load and the springs are estimated from positions and torques of the motors (Figure 5). That tells where
    the sagging tip is, `x_e`, without a sensor there. The commanded angles move by (8) and (9), and the motors hold them:

    .. math:: \dot u_c = [J^\#]_m (v_d + K (x_d - x_e)), \qquad \tau = k_p (u_c - u) + k_d (\dot u_c - \dot u) - \bar\tau_m

    with the motor rows of the right inverse of the position rows of the Jacobian: they are a part of the inverse, so that the
    tip lags behind a moving target in proportion to `1 / K`. The torque that the motors carry, :math:`\bar\tau_m`, is filtered
    by a first order, since the inertia of a moving arm looks like a load; the paper, which is about statics, has neither filter
    nor motors. A loop faster than the lowest mode of the arm shakes it.

    It remembers: give `simulate` a `sample_time`, of 1 ms or so, and a fixed `time_step`; time zero makes it forget.
    """

    def __init__(
        self,
        model: SoftModel,
        path: Path3D,
        kp: Any,
        kd: Any,
        *,
        start: Equilibrium,
        gain: float = 20.0,
        filter_time: float = 0.2,
        gravity: Any = None,
    ) -> None:
        """Take the path of the tip and gains.

        Args:
            model: The robot, with three motor joints or more, and no muscles.
            path: Target positions of the tip over time; the last one holds from then on.
            kp: Proportional gain of the motors, as for `PD`.
            kd: Derivative gain.
            start: The equilibrium in which the motion starts: its torques are what the motors feel before the first sample.
            gain: Gain `K` of the tip [1/s].
            filter_time: Time constant of the filter of the torques [s]; 0: none.
            gravity: Gravity, shape (3,) [m/s^2], world axes, which the estimation knows; None: weightless.

        Raises:
            ParameterError: If an argument is of another kind, out of range, or of another robot.
        """
        self.model = check_model(model)
        """The robot."""
        count = len(model.structure.motor_joints)
        if count < 3 or model.muscles:
            raise ParameterError("model", model, "a robot with three motor joints or more, and no muscles")
        self._path = instance_of("path", path, Path3D, "a Path3D, e.g. of softrobots.straight_line")
        self._kp, self._kd = one_each("kp", kp, count, "N m/rad"), one_each("kd", kd, count, "N m s/rad")
        check_same_model(model, start, "start")
        self._start = start
        self._gain = non_negative_number("gain", gain, "1/s")
        self._filter = non_negative_number("filter_time", filter_time, "s")
        self._gravity = Load.of(model, gravity=gravity).gravity
        self._forget()

    def _forget(self) -> None:
        self._time, self._command = 0.0, np.array(self._start.q_motors)
        self._exerted = self._felt = np.array(self._start.motor_torques)
        self._estimated = self._start

    @property
    def estimate(self) -> Equilibrium:
        """The robot under the load that was estimated last."""
        return self._estimated

    def __call__(self, time: float, q: FloatArray, qd: FloatArray) -> FloatArray:
        """Return the torques until the next sample, shape (n,) [N m or N].

        Args:
            time: Time [s], not before the last sample; 0 begins anew.
            q: Positions of the motor joints, shape (n,) [rad or m].
            qd: Their velocities, shape (n,) [rad/s or m/s].
        """
        if time <= 0.0:
            self._forget()
        passed, self._time = time - self._time, time
        if self._filter > 0.0:
            self._felt = self._felt + (1.0 - np.exp(-passed / self._filter)) * (self._exerted - self._felt)
        else:
            self._felt = self._exerted
        with contextlib.suppress(LoadNotFound):  # where inertia looks like no load: the last estimate
            self._estimated = estimate_load(self.model, q, self._felt, gravity=self._gravity, restart=False).equilibrium
        now = min(time, float(self._path.times[-1]))
        target, ahead = (
            np.array([np.interp(t, self._path.times, column) for column in self._path.positions.T])
            for t in (now, now + _DIFFERENCE)
        )
        wanted = (ahead - target) / _DIFFERENCE + self._gain * (target - self._estimated.tip_position)
        point = self.model.coordinates.at(self._estimated.q_motors, self._estimated.q_springs)
        columns = np.concatenate(point.columns(frame_jacobian(self.model, self._estimated.q, self.model.tip)[:3]), axis=1)
        rate = np.linalg.pinv(columns)[: len(q)] @ wanted
        self._command = np.clip(self._command + passed * rate, *self.model.motor_limits.T)
        torque = self._kp * (self._command - q) + self._kd * (rate - qd) - self._felt
        self._exerted = -torque
        return np.asarray(torque)


def _time_function(
    model: SoftModel, name: str, value: Any, kind: tuple[int, Any], values_of: Callable[[Trajectory], FloatArray]
) -> Callable[[float], FloatArray]:
    """A constant, a trajectory or a function as a function of time; `kind` is the number of values and their unit."""
    count, unit = kind
    if isinstance(value, Trajectory):
        return waypoint_curve(name, value, model, values_of(value))
    if callable(value):
        return checked_function(name, value, (count,), unit)
    constant = finite_array(name, value, (count,), unit)
    return lambda _: constant


def _exerted_torques(trajectory: Trajectory) -> FloatArray:
    """What the motor joints exert in the equilibria of a trajectory, shape (n, n_joints)."""
    count = len(trajectory.model.structure.motor_joints)
    return np.array([-equilibrium.motor_torques[:count] for equilibrium in trajectory.equilibria])
