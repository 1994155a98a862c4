r"""Linear models of a robot about an equilibrium, :math:`\dot x = A x + B u, \; y = C x + D u`, for controllers.

All quantities are deviations from the equilibrium; the matrices are the derivatives of the equations of motion there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, choice, read_only
from softrobots.core.errors import MissingDependency, ParameterError
from softrobots.core.summary import Part, Summarised, Table, facts
from softrobots.dynamics.motor_torque import MOTORS
from softrobots.dynamics.small_motion import SmallMotion, independent_motion, mass_factor, small_motion
from softrobots.model.actuators import load_units
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, check_same_model

_GIVEN = {"N": "tension", "m": "motor", "Pa": "pressure"}  # what actuators of free length are given, by its unit
_TIP = ("tip_x", "tip_y", "tip_z", "tip_turn_x", "tip_turn_y", "tip_turn_z")
_TIP_UNITS = ("m",) * 3 + ("rad",) * 3


@dataclass(frozen=True, eq=False, repr=False)
class LinearModel(Summarised):
    """A linear model of a robot; made by `linearize`. `A, B, C, D = linear`, and `control.ss(*linear)` takes it as it is."""

    equilibrium: Equilibrium
    """The equilibrium from which all quantities deviate."""
    motors: str
    """What drives the motors: "prescribed", by given accelerations, or "torque"."""
    A: FloatArray
    """Rates of the states by states, shape (n, n)."""
    B: FloatArray
    """Rates of the states by inputs, shape (n, m)."""
    C: FloatArray
    """Outputs by states, shape (p, n)."""
    D: FloatArray
    """Outputs by inputs, shape (p, m)."""
    state_names: tuple[str, ...]
    """Actuators and elastic coordinates, but those that follow along contacts, then `<name>_rate` of each."""
    state_units: tuple[str, ...]
    """Unit of each."""
    input_names: tuple[str, ...]
    """`<motor>_acceleration`, or `<motor>_torque` [N m] and `<motor>_force` [N]; `<muscle>_tension`, `_motor` [m] (the
    length at the motor of an elastic tendon) or `_pressure` of those whose length is free; `tip_force_x`, `_y`, `_z`."""
    input_units: tuple[str, ...]
    """Unit of each."""
    output_names: tuple[str, ...]
    """`tip_x`, `_y`, `_z`, `tip_turn_x`, `_y`, `_z`, `<motor>_torque` and `<motor>_force`; driven by torques `<motor>`,
    `<motor>_rate`."""
    output_units: tuple[str, ...]
    """Unit of each."""
    settings: dict[str, Any]
    """The arguments `damping_time`, `mass_damping` and `rotor_inertia`."""

    def summary_parts(self) -> list[Part]:
        """Return how the motors are driven, then states, inputs and outputs with their units."""
        parts: list[Part] = [facts([("robot", self.equilibrium.model.name), ("motors", self.motors)])]
        for kind in ("state", "input", "output"):
            names = zip(getattr(self, f"{kind}_names"), getattr(self, f"{kind}_units"), strict=True)
            parts.append(Table([(kind, "unit"), *names]))
        return parts

    def __iter__(self) -> Iterator[FloatArray]:
        """A, B, C, D."""
        return iter((self.A, self.B, self.C, self.D))

    def state_space(self) -> Any:
        """Return it as a `control.StateSpace` of python-control, with the names of states, inputs and outputs.

        Raises:
            MissingDependency: If python-control is not installed (extra `control`).
        """
        with MissingDependency.of_imports("control", "control"):
            import control
        names = {"states": list(self.state_names), "inputs": list(self.input_names), "outputs": list(self.output_names)}
        return control.ss(*self, **names)


def linearize(
    model: SoftModel,
    equilibrium: Equilibrium,
    *,
    motors: str = "prescribed",
    damping_time: float | None = None,
    mass_damping: float = 0.0,
    rotor_inertia: Any = None,
) -> LinearModel:
    r"""Linearise the equations of motion about an equilibrium, stable or not, under any load.

    With the mass, damping and stiffness matrices of `softrobots.dynamics.small_motion`, actuators u and elastic coordinates y:

    - "prescribed": the motors go where they are told. States are u, y and their rates, inputs the accelerations of the
      motors, :math:`M_{yy} \ddot y = -M_{yu} \ddot u - D \dot y - K_{yu} u - K_{yy} y + J_y^T f`. Outputs are the motion of the
      tip and the torques that the motors carry, as `Equilibrium.motor_torques`.
    - "torque": inputs are the torques that the motors exert, positive along their coordinates,
      :math:`M \ddot x = -D \dot x - K x + (\tau, 0) + J^T f`. Outputs are the motion of the tip, and coordinates and rates of
      the motors.

    The force at the tip is an input of both. Turns of the tip are small, about the axes of the world. A muscle of given length
    is a motor, and what it exerts along its length is minus its tension; what the others are given are inputs.

    In contact what is pressed stays pressed, as in `vibration_modes`: it slides without friction, or sticks. Each contact makes
    one elastic coordinate follow the others, each one that sticks three, and these are no states
    (`softrobots.dynamics.small_motion.independent_motion`). Where the robot touches without a force, nothing holds it.

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.
        motors: "prescribed" or "torque".
        damping_time: Damping over stiffness near rest [s]; None: the damping of the file.
        mass_damping: Damping over mass, Rayleigh's other term [1/s].
        rotor_inertia: Inertia of the rotor of each motor at its joint, or one for all [kg m^2 or kg]; None: that of the file.

    Returns:
        The linear model.

    Raises:
        ParameterError: If an argument is out of range, the equilibrium belongs to another model or has a contact that
            slips or must as the motors move, or torques are to drive muscles whose lengths depend on each other.
        DescriptionError: If the description has no masses, or the robot more joints than Pinocchio supports.
    """
    check_same_model(model, equilibrium)
    driven = choice("motors", motors, MOTORS) == "torque"
    if driven and not model.actuators.independent:
        raise ParameterError("motors", motors, "'prescribed': more than three muscles of a segment have no independent lengths")
    small, springs = independent_motion(
        model,
        small_motion(model, equilibrium, damping_time=damping_time, mass_damping=mass_damping, rotor_inertia=rotor_inertia),
    )
    with one_blas_thread(2 * len(small.mass)):
        matrices = _driven(model, small) if driven else _prescribed(model, small)
    placed, units = model.motor_joints[: small.n_placed], model.actuators.units[: small.n_placed]
    torques = tuple(f"{name}_{'torque' if unit == 'rad' else 'force'}" for name, unit in zip(placed, units, strict=True))
    if driven:
        motor_inputs, motor_input_units = torques, load_units(units)
        motor_outputs, motor_output_units = _with_rates(placed, units)
    else:
        motor_inputs = tuple(f"{name}_acceleration" for name in placed)
        motor_input_units = tuple(f"{unit}/s^2" for unit in units)
        motor_outputs, motor_output_units = torques, load_units(units)
    given = model.actuators.units[small.n_placed :]
    inputs = tuple(f"{name}_{_GIVEN[unit]}" for name, unit in zip(model.motor_joints[small.n_placed :], given, strict=True))
    states, state_units = _with_rates(
        (*placed, *(model.spring_joints[place] for place in springs)),
        (*units, *(model.springs.units[place] for place in springs)),
    )
    a, b, c, d = map(read_only, matrices)
    return LinearModel(
        equilibrium=equilibrium,
        motors=motors,
        A=a,
        B=b,
        C=c,
        D=d,
        state_names=states,
        state_units=state_units,
        input_names=(*motor_inputs, *inputs, *(f"tip_force_{axis}" for axis in "xyz")),
        input_units=(*motor_input_units, *given, *("N" for _ in "xyz")),
        output_names=(*_TIP, *motor_outputs),
        output_units=(*_TIP_UNITS, *motor_output_units),
        settings={"damping_time": damping_time, "mass_damping": mass_damping, "rotor_inertia": rotor_inertia},
    )


def _with_rates(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of coordinates and of their rates."""
    return (*names, *(f"{name}_rate" for name in names)), (*units, *(f"{unit}/s" for unit in units))


def _driven(model: SoftModel, small: SmallMotion) -> tuple[FloatArray, ...]:
    """A, B, C, D of motors that exert torques."""
    m, n = small.n_placed, len(small.mass)
    forces = np.hstack([np.eye(n, m), small.by_tension, small.tip[:3].T])
    a, b = _first_order(_accelerations(model, small.mass, np.hstack([-small.stiffness, -small.damping, forces])), n)
    motors = np.zeros((2 * m, 2 * n))  # coordinates and rates of the motors by states
    motors[:m, :m] = motors[m:, n : n + m] = np.eye(m)
    c = np.vstack([np.hstack([small.tip, np.zeros((6, n))]), motors])
    return a, b, c, np.zeros((len(c), b.shape[1]))


def _prescribed(model: SoftModel, small: SmallMotion) -> tuple[FloatArray, ...]:
    """A, B, C, D of motors that go where they are told."""
    m, n = small.n_placed, len(small.mass)
    unforced = np.hstack([-small.stiffness, -small.damping])
    forces = np.hstack([small.by_tension, small.tip[:3].T])
    elastic = np.hstack([unforced[m:], -small.mass[m:, :m], forces[m:]])
    moved = np.zeros((n, 2 * n + m + forces.shape[1]))  # accelerations by states and inputs
    moved[:m, 2 * n : 2 * n + m] = np.eye(m)
    moved[m:] = _accelerations(model, small.mass[m:, m:], elastic)
    carried = np.hstack([unforced[:m], np.zeros((m, m)), forces[:m]]) - small.mass[:m] @ moved
    a, b = _first_order(moved, n)
    tip = np.hstack([small.tip, np.zeros((6, n + b.shape[1]))])
    c, d = np.hsplit(np.vstack([tip, carried]), [2 * n])
    return a, b, c, d


def _first_order(accelerations: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """A and B of n coordinates and their rates, from the accelerations by those 2 n states and by inputs."""
    rates = np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, accelerations.shape[1] - 2 * n))])
    a, b = np.hsplit(np.vstack([rates, accelerations]), [2 * n])
    return a, b


def _accelerations(model: SoftModel, mass: FloatArray, loads: FloatArray) -> FloatArray:
    """Accelerations by columns of loads; DescriptionError if a coordinate moves no mass."""
    mass_factor(model, mass)
    return np.asarray(np.linalg.solve(mass, loads))
