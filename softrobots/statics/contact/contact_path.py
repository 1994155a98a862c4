"""The result of `follow_contact`: equilibria along a path of loads, motors and obstacles, with what happens at the contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.summary import Part, Summarised, Table, facts, formatted
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact import Contact
from softrobots.statics.equilibrium_result import Equilibrium

MADE, LOST, STUCK, SLIPPED = "made", "lost", "sticks", "slips"
"""What happens to a contact."""


@dataclass(frozen=True)
class ContactEvent:
    """A change of one contact along a path, located by steps that are halved."""

    parameter: float
    """Parameter at the end of the step in which it happened."""
    kind: str
    """`MADE` or `LOST`; with friction also `SLIPPED` where one that stuck begins to slip, and `STUCK`."""
    link: str
    """Link of the robot."""
    obstacle: str
    """Name of the obstacle, or of the other link."""

    def __str__(self) -> str:
        """Describe the event in one line."""
        return f"{self.parameter:.6g}: contact of {self.link} and {self.obstacle} {self.kind}"


@dataclass(frozen=True, eq=False)
class ContactJump:
    """A snap from one equilibrium to another under the same load: the first one lost its stability, or ceased to exist."""

    parameter: float
    """Parameter at which it happened."""
    before: Equilibrium
    """Last equilibrium before."""
    after: Equilibrium
    """Equilibrium to which overdamped motion leads from there."""
    energy_lost: float
    """Drop of the potential energy beyond the work of friction [J]; motion and damping take it. NaN under world-fixed moments,
    which have no energy."""

    @property
    def distance(self) -> float:
        """Distance between the positions of the tip before and after [m]."""
        return float(np.linalg.norm(self.after.tip_position - self.before.tip_position))

    def __repr__(self) -> str:
        """The jump in one line, instead of its equilibria."""
        return f"ContactJump({self})"

    def __str__(self) -> str:
        """Describe the jump in one line."""
        return f"{self.parameter:.6g}: jump of the tip by {self.distance:.4g} m, {self.energy_lost:.4g} J lost"


@dataclass(frozen=True, eq=False, repr=False)
class ContactPath(Summarised):
    """Equilibria in contact along a path, each reached from the last; can be saved with `softrobots.save_result`."""

    parameters: FloatArray
    """Parameter of each equilibrium, shape (n,)."""
    equilibria: tuple[Equilibrium, ...]
    """The robot at each parameter."""
    friction: float
    """Friction coefficient."""
    dissipation: FloatArray
    """Work of friction since the start, shape (n,) [J]."""
    events: tuple[ContactEvent, ...]
    """Contacts made and lost, and changes between stick and slip, in order."""
    jumps: tuple[ContactJump, ...]
    """Where the robot snapped."""
    ended: str = ""
    """Why the path ends before its last parameter; empty if it does not."""

    @property
    def model(self) -> SoftModel:
        """The robot, at the end of the path if it grows."""
        return self.equilibria[-1].model

    @property
    def contacts(self) -> tuple[tuple[Contact, ...], ...]:
        """Contacts of each equilibrium."""
        return tuple(equilibrium.contacts for equilibrium in self.equilibria)

    @cached_property
    def tip_positions(self) -> FloatArray:
        """Position of the tip, shape (n, 3) [m]."""
        return read_only(np.array([equilibrium.tip_position for equilibrium in self.equilibria]))

    @cached_property
    def forces(self) -> FloatArray:
        """Sum of the forces of all contacts on the robot, shape (n, 3) [N]."""
        rows = [np.sum([contact.force for contact in row] or np.zeros((1, 3)), axis=0) for row in self.contacts]
        return read_only(np.array(rows))

    def __repr__(self) -> str:
        """Robot, parameters, friction and what happens in one line, instead of all equilibria."""
        span = f"parameter {self.parameters[0]:.6g} to {self.parameters[-1]:.6g}"
        happens = f"{len(self.events)} events, {len(self.jumps)} jumps"
        steps = f"{len(self.equilibria)} equilibria, {span}, friction {self.friction:g}"
        return f"ContactPath({self.model.pinocchio.name}, {steps}, {happens})"

    def summary_parts(self) -> list[Part]:
        """Return steps, events, jumps, work of friction, and where the tip ends."""
        span = f"parameter {self.parameters[0]:.6g} to {self.parameters[-1]:.6g}"
        happened = [*map(str, self.events), *map(str, self.jumps)]
        ends = [
            ("work of friction", f"{self.dissipation[-1]:.6g} J"),
            ("tip at the end", f"{formatted(self.tip_positions[-1])} m"),
            *([("ended", self.ended)] if self.ended else []),
        ]
        head = f"{self.model.name}, {len(self.equilibria)} equilibria, {span}, friction coefficient {self.friction:g}"
        return [head, Table([(line,) for line in happened], head=False), facts(ends)]
