"""What a run of the simulation leaves: rows at the output times, energies, and what went in and out at each step."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.dynamics.gauss import GaussRule
from softrobots.dynamics.midpoint import MidpointRule, State, Step
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.model.friction_coordinates import remembering
from softrobots.statics.kinematics import frame_placement


class Recorder:
    """Collects the steps of one run."""

    def __init__(self, rule: MidpointRule, start: State, rows: FloatArray) -> None:
        """Take the rule, the first state, and the times of the rows, shape (n,) [s]."""
        self.rule, self._equations, self._times = rule, rule.equations, rows
        self.count = len(rows)
        """Number of rows in the end."""
        self.duration = float(rows[-1])
        """Time of the last row [s]."""
        self.state = start
        """The state reached."""
        self._x, self._rates = np.zeros((len(rows), len(start.x))), np.zeros((len(rows), len(start.x)))
        self._forces = rule.load.tip_forces(rows) if rule.load.constant else np.zeros((len(rows), 3))
        self.rows = 0
        """Number of rows so far."""
        self._memory = start.memory
        self.times, self.tips = [start.time], [self.tip(start.x)]
        """Times of the steps, and positions of the tip then, shape (3,) [m]."""
        self._middles: list[float] = []
        self._exerted: list[FloatArray] = []
        self._works = [(0.0, 0.0, 0.0)]
        self._motor_torques: FloatArray = np.zeros((len(rows), rule.torque.count if rule.torque else 0))

    def tip(self, x: FloatArray) -> FloatArray:
        """Position of the tip, shape (3,) [m]."""
        model = self._equations.model
        q = model.embed(self._equations.point(x).joints)
        return np.array(frame_placement(model, q, model.tip).translation)

    def add(self, step: Step) -> int:
        """Take a step; return how many more rows there are."""
        equations, middle, h = self._equations, step.middle, step.length
        dissipated, load_work, motor_work = self._works[-1]
        dissipated += h * step.friction_power
        stages = [(one.state, one.forces[: equations.n_motors]) for one in step.stages]
        for at, forces in stages or [(middle, step.actuator_forces)]:
            share = h / (len(stages) or 1)
            dissipated += share * float(at.rates @ equations.damping @ at.rates)
            if step.wrenches:
                load_work += share * float(equations.load(at.x, step.wrenches) @ at.rates)
            motor_work += share * float(forces @ equations.actuator_rates(at.x, at.rates))
        prescribed, tip = self.rule.prescribed, self.tip(step.end.x)
        last = int(np.searchsorted(self._times, step.end.time, "right"))
        for row in range(self.rows, last):
            time = float(self._times[row])
            x, rates = step.at(time)
            if len(prescribed):
                x[prescribed] = self.rule.path(time)[prescribed]
                rates[prescribed] = (middle.rates + (time - middle.time) * step.accelerations)[prescribed]
            self._x[row], self._rates[row] = x, rates
            if not self.rule.load.constant:
                self._forces[row] = self.rule.load.tip_forces(self._times[row : row + 1])[0]
            if self.rule.torque is not None:
                self._motor_torques[row] = self.rule.torque.exerted(time, x, rates)
        if last > self.rows:
            self._memory = step.end.memory
        self._middles.append(middle.time)  # all is known; where Ctrl-C comes now, what is longer than `times` does not count
        self._exerted.append(step.actuator_forces)
        self._works.append((dissipated, load_work, motor_work))
        self.tips.append(tip)
        self.times.append(step.end.time)
        more, self.state, self.rows = last - self.rows, step.end, last
        return more

    def kick(self, change: FloatArray) -> None:
        """The velocities of prescribed coordinates jump by `change`, shape (n_motors,); motors do the work."""
        after = self.rule.kicked(self.state, change)
        work = self._equations.energies(after.x, after.rates)[0] - self._equations.energies(after.x, self.state.rates)[0]
        dissipated, load_work, motor_work = self._works[-1]
        self.state, self._works[-1] = after, (dissipated, load_work, motor_work + work)

    def motion(self, **facts: Any) -> Motion:
        """Return the motion of the rows so far, with more of its fields."""
        equations, n = self._equations, self.rows
        m, times = equations.n_motors, self._times[:n]
        if n == 0:  # interrupted before the end of the first step
            times, n = self._times[:1], 1
            self._x[0], self._rates[0] = self.state.x, self.state.rates
        x, rates = self._x[:n], self._rates[:n]
        if isinstance(self.rule, GaussRule):
            exerted = np.array([self.rule.exerted(*row) for row in zip(x, rates, strict=True)])
        else:
            exerted = self._at_rows(times, m)
        exerted[:, : self._motor_torques.shape[1]] = self._motor_torques[:n]
        stored = np.array([equations.energies(*row) for row in zip(x, rates, strict=True)])
        works = np.array(self._works[: len(self.times)])
        exchanged = np.column_stack([np.interp(times, self.times, work) for work in works.T])
        columns = [read_only(np.ascontiguousarray(column)) for column in np.concatenate([stored, exchanged], axis=1).T]
        return Motion(
            model=equations.model if self._memory is None else remembering(equations.model, self._memory),
            time=read_only(np.array(times)),
            q_motors=read_only(np.array(x[:, :m])),
            motor_velocities=read_only(np.array(rates[:, :m])),
            q_springs=read_only(np.array(x[:, m:])),
            velocities=read_only(np.array(rates[:, m:])),
            motor_torques=read_only(-exerted),
            forces=read_only(self._forces[:n].copy()),
            gravity=equations.gravity,
            energy=MotionEnergy(*columns),
            steps=read_only(np.array(self.times)),
            **facts,
        )

    def _at_rows(self, times: FloatArray, m: int) -> FloatArray:
        """What actuators exert at the rows, from the middles of the steps, shape (n, m)."""
        steps = len(self.times) - 1
        if steps < 2:
            return np.tile(self._exerted[0] if steps else np.zeros(m), (len(times), 1))
        middles, exerted = np.array(self._middles[:steps]), np.array(self._exerted[:steps])
        place = np.clip(np.searchsorted(middles, times) - 1, 0, len(middles) - 2)
        share = ((times - middles[place]) / (middles[place + 1] - middles[place]))[:, None]
        return np.asarray(exerted[place] + share * (exerted[place + 1] - exerted[place]))
