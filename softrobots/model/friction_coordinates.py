"""A robot with dry friction, at its coordinates: the load of friction, and what it remembers from step to step.

The law is in `softrobots.model.dry_friction`. A model carries the memory of the last state; a step is solved from there.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import ParameterError
from softrobots.model.coordinates import Coordinates, Point, ReducedLoad
from softrobots.model.dry_friction import DryFriction, FrictionMemory
from softrobots.model.joint_loads import JointLoad
from softrobots.model.soft_model import SoftModel, check_model

MOST_ROUNDS = 200
"""Most changes of the friction of guides on the way to the one that stays."""

SAME_FRICTION = 1e-13
"""Change of that friction that is none, relative to the largest load on an actuator."""

RUNAWAY = 1e6
"""Change that it does not come back from, likewise."""

FrictionLaw = Callable[[FloatArray], tuple[float, FloatArray, FloatArray]]
"""Energy [J], torque on the strains, shape (count,), and its derivative, of strains, shape (count,)."""


class FrictionCoordinates:
    """Coordinates of a robot with dry friction: those of the robot without it, and the memory of the last state."""

    def __init__(self, inner: Coordinates, friction: DryFriction, memory: FrictionMemory, grip: FloatArray) -> None:
        """Add friction to a robot without muscles, `inner`."""
        self.inner, self.friction = inner, friction
        self.memory = memory
        """What friction remembers."""
        self.grip = grip
        """Friction of each guide that slips, shape (n_guides,) [N]."""
        self.slides = False
        """Whether the derivatives are those of slip everywhere where nothing slips."""
        self.slips = False
        """Whether they always are."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> FrictionPoint:
        """Return the robot at given coordinates."""
        energy, torque, stiffness = self.friction.at(elastic, self.memory, self.grip)
        if self.slips or (self.slides and self.friction.sticks(elastic, self.memory)):
            stiffness = np.zeros_like(stiffness)
        return FrictionPoint(self.inner.at(motors, elastic), energy, torque, stiffness, float(self.grip.sum()))


class GivenFriction:
    """Coordinates of a robot whose friction is given as a function of its strains."""

    def __init__(self, inner: Coordinates, law: FrictionLaw) -> None:
        """Add friction to a robot without muscles."""
        self._inner, self._law = inner, law

    def at(self, motors: FloatArray, elastic: FloatArray) -> FrictionPoint:
        """Return the robot at given coordinates."""
        return FrictionPoint(self._inner.at(motors, elastic), *self._law(elastic), 0.0)


@dataclass(frozen=True, eq=False)
class FrictionPoint:
    """A robot with dry friction, at given coordinates."""

    inner: Point
    """The robot without it."""
    energy: float
    """What friction adds to the energy of the step [J]."""
    torque: FloatArray
    """Torque of friction on the strains, shape (count,) [N m or N]."""
    stiffness: FloatArray
    """Derivative of that, shape (count, count)."""
    grip: float
    """Friction of all guides that slip [N]."""

    @property
    def joints(self) -> FloatArray:
        """Joint positions."""
        return self.inner.joints

    @property
    def valid(self) -> bool:
        """Whether every section is within its range."""
        return self.inner.valid

    def reduce(self, load: JointLoad) -> ReducedLoad:
        """Add friction to the load."""
        bare = self.inner.reduce(load)
        return bare._replace(
            elastic=bare.elastic - self.torque,
            derivative=bare.derivative - self.stiffness,
            potential=bare.potential + self.energy,
            scale=bare.scale + self.grip,
        )

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Those of the robot without friction."""
        return self.inner.columns(jacobian)

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Those of the robot without friction."""
        return self.inner.motor_derivatives(load)

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add friction to the load on the strains."""
        motors, elastic = self.inner.loads(torque)
        return motors, elastic - self.torque

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Those of the robot without friction."""
        return self.inner.velocity(motors, elastic)

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Those of the robot without friction."""
        return self.inner.velocity_product(motors, elastic)


def check_frictionless(model: Any, what: str) -> SoftModel:
    """Return `model` if it is a `SoftModel` without dry friction, or raise ParameterError; `what` needs that, in words."""
    if check_model(model).structure.friction is not None:
        requirement = (
            f"a robot without dry friction, for {what}; solve_equilibrium, follow_trajectory, simulate and estimate_load "
            "have it, bending_friction and guide_friction of 0 leave it out"
        )
        raise ParameterError("model", model.pinocchio.name, requirement)
    return model  # type: ignore[no-any-return]


def memory_of(model: SoftModel) -> FrictionMemory:
    """Return what the friction of a robot remembers; only for a robot with friction."""
    return _rubbing(model.coordinates).memory


def after_step(model: SoftModel, motors: FloatArray, elastic: FloatArray) -> SoftModel:
    """Return a robot with what friction remembers of a step to given coordinates; the robot itself without friction."""
    friction = model.structure.friction
    if friction is None:
        return model
    return remembering(model, friction.after(model.structure.strains(motors, elastic), memory_of(model)))


def untouched(model: SoftModel) -> SoftModel:
    """Return the robot as it is before anything has moved it; the robot itself without friction."""
    friction = model.structure.friction
    return model if friction is None else remembering(model, friction.untouched)


def remembering(model: SoftModel, memory: FrictionMemory, grip: FloatArray | None = None) -> SoftModel:
    """Return the robot with another memory, and the friction of each guide that slips, shape (n_guides,) [N]; none if None."""
    friction = _rubbing(model.coordinates).friction
    return _rubbed(model, memory, np.zeros(friction.n_guides) if grip is None else grip)


def grip_of(model: SoftModel) -> FloatArray:
    """Return the friction of each guide that slips, shape (n_guides,) [N]; only for a robot with friction."""
    return _rubbing(model.coordinates).grip


def friction_of(model: SoftModel, strains: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return friction at strains, shape (count,), in parts, see `DryFriction.parts`; only for a robot with friction."""
    at = _rubbing(model.coordinates)
    return at.friction.parts(strains, at.memory, at.grip)


def slipping(model: SoftModel, *, always: bool = False) -> SoftModel:
    """Return the robot with the derivatives of slip where nothing slips, by which a search leaves such a state, or always."""
    last = _rubbing(model.coordinates)
    return _rubbed(model, last.memory, last.grip, slides=True, slips=always)


def with_given_friction(model: SoftModel, law: FrictionLaw) -> SoftModel:
    """Return the robot with its friction as a function of the strains, which remembers nothing; for a robot with friction."""
    inner = _rubbing(model.coordinates).inner
    return replace(model, coordinates=_around(model.coordinates, GivenFriction(inner, law)))


class GuideFriction:
    """Friction of guides on its way to that which stays: rounds of given friction, with a secant through the last two.

    Rounds alone go to and fro between two states where friction is strong; of the last two changes the combination of least
    squares vanishes at once along their line ([Anderson 1965] with a memory of one). No friction grows by more than the largest
    load in a round: a robot that coils up without it would have friction of thousands of times that.
    """

    def __init__(self) -> None:
        """Begin."""
        self._last: tuple[FloatArray, FloatArray] | None = None

    def after(self, model: SoftModel, motors: FloatArray, elastic: FloatArray, loads: FloatArray) -> tuple[SoftModel, float]:
        """Return the robot with the friction of its guides for the next round, and how far that of this round is off.

        The difference is relative to the largest load; infinite where friction runs away: that of given lengths answers to
        itself.

        Args:
            model: The robot, with friction of guides.
            motors: Actuators, shape (n_motors,).
            elastic: Elastic coordinates, shape (n_springs,).
            loads: Load on each actuator; of muscles the tension at the motor, shape (n_motors,) [N m or N].
        """
        last, tensions = _rubbing(model.coordinates), loads[len(model.structure.motor_joints) :]
        with np.errstate(over="ignore", invalid="ignore"):
            grip = last.friction.grip(model.structure.strains(motors, elastic), tensions, last.memory)
            change = grip - last.grip
            off = float(np.abs(change).max(initial=0.0))
        largest = float(np.abs(loads).max(initial=0.0))
        if not off <= RUNAWAY * largest:
            return model, math.inf
        aim = grip
        if self._last is not None:
            bent = change - self._last[1]
            share = float(bent @ change) / max(float(bent @ bent), 1e-300)
            aim = np.maximum(grip - share * (grip - self._last[0]), 0.0)
        aim = np.minimum(aim, last.grip + largest)
        self._last = grip, change
        return _rubbed(model, last.memory, aim), off / max(largest, 1e-300)


def packed_memories(models: Sequence[SoftModel]) -> dict[str, list[FloatArray]]:
    """Return what dry friction remembers in each of some states of a robot, in named arrays; none without friction."""
    if models[0].structure.friction is None:
        return {}
    memories = [memory_of(model)._asdict() for model in models]
    return {f"friction_{name}": [memory[name] for memory in memories] for name in FrictionMemory._fields}


def with_memories(fields: Mapping[str, Any], model: SoftModel, count: int) -> list[SoftModel]:
    """Return a robot with each of a number of memories of dry friction, from the arrays of `packed_memories`."""
    if model.structure.friction is None:
        return [model] * count
    shapes = [part.shape for part in memory_of(model)]
    columns = [
        finite_array(name, fields[name], (count, *shape))
        for name, shape in zip((f"friction_{name}" for name in FrictionMemory._fields), shapes, strict=True)
    ]
    return [remembering(model, FrictionMemory(*parts)) for parts in zip(*columns, strict=True)]


def _rubbing(coordinates: Any) -> FrictionCoordinates:
    """The coordinates with friction among those that muscles wrap around each other."""
    return coordinates if isinstance(coordinates, FrictionCoordinates) else _rubbing(coordinates.inner)


def _rubbed(model: SoftModel, memory: FrictionMemory, grip: FloatArray, slides: bool = False, slips: bool = False) -> SoftModel:
    """The robot with other coordinates with friction."""
    changed = copy.copy(_rubbing(model.coordinates))
    changed.memory, changed.grip, changed.slides, changed.slips = memory, grip, slides, slips
    return replace(model, coordinates=_around(model.coordinates, changed))


def _around(coordinates: Any, friction: Any) -> Any:
    """Coordinates with others in place of those with friction, around which muscles wrap them."""
    if isinstance(coordinates, FrictionCoordinates):
        return friction
    changed = copy.copy(coordinates)
    changed.inner = _around(changed.inner, friction)
    return changed
