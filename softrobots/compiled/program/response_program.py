r"""Derivatives of equilibria and load estimates of an unrolled chain, traced: in reverse (`pull`) and forward (`push`).

At an equilibrium `r(q, x) = 0` with the inputs `x`, motors, force and numbers of the robot, a rate of `x` gives

.. math:: \dot q = -K^{-1} r_x \dot x, \quad \dot y = y_x \dot x + y_q \dot q

for results `y(q, x)` such as the tip, and weights `g` of `q` and `y` give the weights of the inputs

.. math:: \lambda = -K^{-1} (g_q + y_q^T g_y), \quad g_x = r_x^T \lambda + y_x^T g_y

(implicit function theorem). `K` is the tangent stiffness, factorised as for a Newton step. A load estimate has the force as a
further unknown and the condition `h = 0`: the motor torques are those measured, or, with more than three motors, their
difference is not a torque of any force, `h = E (tau_measured - tau)` with the elastostatic Jacobian `E`.
"""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, vector
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.small_systems import solve_small
from softrobots.compiled.chain.tip_motion import tip_motion
from softrobots.compiled.chain.unrolled_chain import evaluate, solve_again
from softrobots.compiled.drivers import response_drivers
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression, Scalar, pull_back, push_forward


@dataclass(frozen=True)
class ResponsePlaces:
    """Places of rates, or of weights, in the workspace: those of the inputs, and of the results behind them."""

    first: int
    """First of them: motors, force, torques of motors, and numbers of the robot."""
    motors: int
    """Number of motors."""
    unknowns: int
    """Number of unknowns."""
    numbers: int
    """Number of numbers of the robot that are inputs."""

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return 2 * self.motors + 3 + self.numbers

    @property
    def number(self) -> int:
        """Place of the first number of the robot."""
        return self.first + self.inputs - self.numbers

    @property
    def result(self) -> int:
        """Place of the results: unknowns, tip, force."""
        return self.first + self.inputs

    @property
    def results(self) -> int:
        """Number of results."""
        return self.unknowns + 6

    @property
    def of_results(self) -> tuple[int, int, int]:
        """Places of unknowns, tip and force."""
        return self.result, self.result + self.unknowns, self.result + self.unknowns + 3

    def load(self, kind: str) -> tuple[int, int]:
        """Return place behind the first, and size, of the load of an "equilibrium" or of an "estimate": force or torques."""
        return (self.motors, 3) if kind == "equilibrium" else (self.motors + 3, self.motors)

    @property
    def end(self) -> int:
        """The first place behind."""
        return self.result + self.results


def response_blocks(plan: Plan, places: ResponsePlaces) -> list[Block]:
    """Trace the responses of equilibria and, with three motors or more, of load estimates."""
    blocks = [
        _traced("pull_equilibrium", "Weights of the inputs of an equilibrium from those of its results.", plan, places),
        _traced("push_equilibrium", "Rates of the results of an equilibrium from those of its inputs.", plan, places),
    ]
    if plan.unknowns.moved_by_motors and plan.layout.motors >= 3:
        blocks += [
            _traced("pull_estimate", "Weights of the inputs of a load estimate from those of its results.", plan, places),
            _traced("push_estimate", "Rates of the results of a load estimate from those of its inputs.", plan, places),
        ]
    return blocks


def response_functions(blocks: Sequence[Block]) -> list[str]:
    """Return the texts of the batch functions of blocks."""
    text = inspect.getsource(response_drivers.respond_batch).rstrip()
    return [text.replace("respond", block.name) for block in blocks]


def _traced(name: str, purpose: str, plan: Plan, places: ResponsePlaces) -> Block:
    block = Block(name, purpose)
    response = _Response(plan, places, block, estimates=name.endswith("estimate"))
    if name.startswith("pull"):
        response.pull()
    else:
        response.push()
    return block


class _Response:
    """An equilibrium or a load estimate, and its inputs."""

    def __init__(self, plan: Plan, places: ResponsePlaces, block: Block, *, estimates: bool) -> None:
        layout = plan.layout
        self.plan, self.places, self.block = plan, places, block
        self.point = evaluate(plan, block, tip_columns=3 if estimates else 0)
        self.unknown: list[Expression] = list(self.point.unknown)  # type: ignore[arg-type]
        self.force = block.loads(layout.force, 3)
        motors, torques = block.loads(0, layout.motors), block.loads(layout.torques, layout.motors)
        numbers = block.loads(layout.numbers, places.numbers)
        self.inputs = [*motors, *self.force, *torques, *numbers]
        self.tip = (self.point.base + self.point.base_axes @ self.point.tip).tolist()
        self.condition: list[Scalar] = []
        if estimates:
            motion = tip_motion(plan.unknowns, self.point)
            left = vector(torques) - motion.motor_torques
            self.condition = (left if layout.motors == 3 else motion.jacobian @ left).tolist()

    def pull(self) -> None:
        """Write the weights of the inputs."""
        block, places, n = self.block, self.places, self.places.unknowns
        weights = block.loads(places.result, places.results)
        own, results, factors = vector(weights[:n]), self.tip, weights[n : n + 3]
        if self.condition:
            by_force, slope, tip_slope = self._force_slopes()
            of_force = vector(weights[n + 3 :]) + by_force.T @ own + tip_slope.T @ vector(factors)
            results, factors = results + self.condition, [*factors, *-solve_small(slope.T, of_force)]
        adjoint = self._solve(own + vector(pull_back(results, factors, self.unknown)))
        slopes = pull_back([*self.point.gradient, *results], [*adjoint, *factors], self.inputs)
        block.store_all(places.first, slopes)

    def push(self) -> None:
        """Write the rates of the results."""
        block, places = self.block, self.places
        rates: list[Scalar] = list(block.loads(places.first, places.inputs))
        force = vector(rates[places.motors : places.motors + 3])
        if self.condition:  # the force follows, too
            rates[places.motors : places.motors + 3] = [0.0] * 3
        unknown = self._solve(push_forward(self.point.gradient, self.inputs, rates))
        if self.condition:
            by_force, slope, _ = self._force_slopes()
            force = -solve_small(slope, self._rates(self.condition, rates, unknown))
            rates[places.motors : places.motors + 3] = force.tolist()
            unknown = unknown + by_force @ force
        block.store_all(places.result, [*unknown, *self._rates(self.tip, rates, unknown), *force])

    def _force_slopes(self) -> tuple[Any, Any, Any]:
        """Return the derivatives of unknowns, shape (n, 3), condition and tip, (3, 3), by the force, springs in balance."""
        columns = []
        for axis in range(3):
            rates = [0.0] * self.places.inputs
            rates[self.places.motors + axis] = 1.0
            unknown = self._solve(push_forward(self.point.gradient, self.inputs, rates))
            columns.append((unknown, self._rates(self.condition, rates, unknown), self._rates(self.tip, rates, unknown)))
        by_force, slope, tip_slope = (np.array(one, dtype=object).T for one in zip(*columns, strict=True))
        return by_force, slope, tip_slope

    def _rates(self, values: Sequence[Scalar], rates: Sequence[Scalar], unknown: Vector) -> Vector:
        """Return the rates of values from those of inputs and unknowns."""
        return vector(push_forward(values, [*self.inputs, *self.unknown], [*rates, *unknown]))

    def _solve(self, sides: Sequence[Scalar]) -> Vector:
        """Return `-K^-1` times a vector."""
        unknowns = self.plan.unknowns
        rows = range(len(self.point.inward_passes))
        by_element = [[sides[unknowns.place[strain]] for strain in unknowns.moving(row)] for row in rows]
        return vector(solve_again(unknowns, self.point, by_element))
