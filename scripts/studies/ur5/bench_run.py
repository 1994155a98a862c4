"""A push on the bench of `studies.ur5.bench`: the UR5 imposes displacements, the link answers with a force."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, non_negative_number, positive_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.progress import with_progress
from softrobots.statics.imposed_displacement import ImposedDisplacement, solve_imposed_displacement
from softrobots.statics.inverse_kinematics import solve_ik
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.trajectory import Trajectory
from studies.ur5.bench import PROBE, TOUCH, UR5Bench

_PUSH = read_only(np.array([1.0, 0.0, 0.0]))  # the probe moves along the world's x, the link lies along y
_TOOL = read_only(np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]))  # tool axes: z along x
_ELBOW_UP = (0.1, -1.7, 1.9, -0.2, 1.7, 1.6)  # [rad], about where the UR5 starts


class Measurement(NamedTuple):
    """What the instruments of a push read, evaluated by `inflated_beam.BendingTest`."""

    force: FloatArray
    """Force on the load cell, shape (n,) [N]."""
    angle: FloatArray
    """Hinge angle, shape (n,) [rad]."""
    moment: FloatArray
    """Moment at the hinge, shape (n,) [N m]."""


@dataclass(frozen=True, eq=False)
class BenchRun:
    """A push of the link by the UR5."""

    bench: UR5Bench
    """The bench."""
    states: tuple[ImposedDisplacement, ...]
    """The link, and the UR5 that holds it, at every step."""
    ik_error: FloatArray
    """Distance of the probe from where it was meant to be, shape (n,) [m]."""
    ik_orientation_error: FloatArray
    """Angle between the probe and its orientation at the start, shape (n,) [rad]."""

    @cached_property
    def displacement(self) -> FloatArray:
        """Displacement that the UR5 really imposes, by its forward kinematics, shape (n,) [m]."""
        return read_only(np.array([state.displacement for state in self.states]))

    @cached_property
    def force(self) -> FloatArray:
        """Force on the link along the probe's line, shape (n,) [N]: what an ideal load cell reads."""
        return read_only(np.array([state.reaction for state in self.states]))

    @cached_property
    def q_ur5(self) -> FloatArray:
        """Joint angles of the UR5, shape (n, 6) [rad]."""
        return read_only(np.array([state.equilibrium.q_motors for state in self.states]))

    @cached_property
    def ur5_torques(self) -> FloatArray:
        """Load on the joints of the UR5 by the reaction of the link alone, minus what its motors exert, shape (n, 6) [N m]."""
        model = self.bench.model
        loads = [
            -(state.force @ frame_jacobian(model, state.q, PROBE)[:3])[model.motor_indices] for state in self.states
        ]  # fmt: skip
        return read_only(np.array(loads))

    @cached_property
    def ur5_effort(self) -> FloatArray:
        """Largest torques of the UR5's motors, shape (6,) [N m]."""
        return read_only(np.array(self.bench.model.pinocchio.upperEffortLimit)[self.bench.model.motor_indices])

    @property
    def stable(self) -> bool:
        """Whether every step is certified stable under the imposed displacement."""
        return all(state.stable for state in self.states)

    def measure(self, *, force_std: float = 0.0, angle_std: float = 0.0, seed: int = 0) -> Measurement:
        """What the instruments read: force and angle with normal noise, and the moment of that force.

        Args:
            force_std: Standard deviation of the force [N].
            angle_std: Standard deviation of the angle [rad].
            seed: Seed of the noise.

        Returns:
            Force, angle and moment.

        Raises:
            ParameterError: If a standard deviation is negative or not finite, or the seed is no whole number from 0.
        """
        deviations = (non_negative_number("force_std", force_std, "N"), non_negative_number("angle_std", angle_std, "rad"))
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise ParameterError("seed", seed, "a whole number from 0")
        random = np.random.default_rng(seed)
        noise = [deviation * random.normal(size=len(self.states)) for deviation in deviations]
        test, force = self.bench.test, self.force + noise[0]
        return Measurement(force, test.angle(self.displacement) + noise[1], test.moment(self.displacement, force))

    def trajectory(self, duration: float = 4.0) -> Trajectory:
        """The push as a trajectory of the probe, for the viewer and for files; steps without a force are left out.

        Args:
            duration: Time of the whole push [s].

        Raises:
            ParameterError: If the duration is not positive, or no step has a force.
        """
        seconds = positive_number("duration", duration, "s")
        pushed = [number for number, state in enumerate(self.states) if state.reaction > 1e-9]
        if not pushed:
            raise ParameterError("run", self.displacement, "one with a step at which the probe pushes")
        way = np.outer(self.displacement[pushed], _PUSH)
        return Trajectory(
            read_only(seconds * np.arange(1, len(pushed) + 1) / len(pushed)),
            read_only(np.array(self.bench.touch_position) + way),
            tuple(self.states[number].equilibrium for number in pushed),
            "bench",
        )


def push_link(bench: UR5Bench, displacements: Any, *, progress: bool | str = False) -> BenchRun:
    """Push the link of a bench step by step.

    Args:
        bench: The bench.
        displacements: Wanted displacements of the probe from where it first touches, shape (n,) [m], zero or positive.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The run.

    Raises:
        ParameterError: If there are none, one is negative or not finite, or the ball would leave the end of the link.
        TargetUnreachable: If the UR5 does not reach a step.
        EquilibriumNotFound: If the link finds no equilibrium at a step.
        MissingDependency: If example-robot-data is not installed.
    """
    wanted = finite_array("displacements", displacements, (None,), "m")
    most = float(bench.test.displacement(bench.largest_angle))
    if len(wanted) == 0 or wanted.min() < 0.0 or wanted.max() >= most:
        raise ParameterError(
            "displacements", displacements, f"at least one, from 0 to below {most:.6g} m, where the ball leaves the link"
        )
    model, start = bench.model, np.array(bench.touch_position)
    motors: Any = _ELBOW_UP
    first = solve_ik(model, start, orientation=_TOOL, q_motors0=motors)
    motors, held = first.q_motors, None
    steps = []
    for way in with_progress(wanted.tolist(), progress, label="push", unit="step"):
        found = solve_ik(model, start + way * _PUSH, orientation=_TOOL, q_motors0=motors, starts=1)
        motors = found.q_motors
        probe = np.array(frame_placement(model, found.equilibrium.q, PROBE).translation)
        held = solve_imposed_displacement(
            model, motors, float(_PUSH @ (probe - start)), direction=_PUSH, frame=TOUCH, along=(1.0, 0.0, 0.0), start=held
        )
        steps.append((held, found.error, found.orientation_error))
    states, errors, turns = zip(*steps, strict=True)
    return BenchRun(bench, states, read_only(np.array(errors)), read_only(np.array(turns)))
