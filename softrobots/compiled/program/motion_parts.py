"""Generated functions of motion, in the parts that a module is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

from softrobots.compiled.trace.blocks import Block


@dataclass(frozen=True)
class MotionParts:
    """The functions of a chain that `softrobots.compiled.drivers.motion_drivers` calls, each also for lanes.

    `motion_prepare` computes what depends on motors, force, gravity and time step only; `motion_factor` evaluates the residual
    `r` at `unknown`, `rate` and `acceleration`, factors `A = M + h/2 D + h^2/4 K`, and writes the correction `-A^-1 r`;
    `motion_correct` does so with the factors that are there; `motion_tip` writes the tip at motors and `unknown`.
    """

    blocks: list[Block]
    """Straight-line functions."""
    size: int
    """Size of the workspace."""
    constants: dict[str, object] = field(default_factory=dict)
    """Tables and places that they need."""
    loops: str = ""
    """Text of the functions that loop over elements."""
    lane_loops: str = ""
    """Text of those for lanes."""
