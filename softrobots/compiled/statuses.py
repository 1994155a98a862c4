"""Outcome of a case of a compiled solver."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Outcome of one case of a compiled solver; every value but `CERTIFIED` is a failure."""

    CERTIFIED = 0
    """In balance to 1e-10 of the load, and certified stable."""
    UNSTABLE = 1
    """In balance at a saddle that the descent did not leave: not stable."""
    UNSETTLED = 2
    """Not in balance after the largest number of steps; also where a load presses a section to the end of its range."""
    OUT_OF_RANGE = 3
    """A section is bent or twisted beyond its range."""
    NOT_A_NUMBER = 4
    """The input is not finite or too large to compute with, or no shape has the given muscle lengths."""
    UNOBSERVABLE = 5
    """Other forces explain the motor torques as well: one direction of the force is not observable in this pose."""
    NOT_REACHED = 6
    """No force was found that explains the motor torques; or the tip does not reach its target, or only by a jump."""
    BEYOND_LIMITS = 7
    """The tip reaches its target only with a motor beyond its limits."""
    NEUTRAL = 8
    """In balance, and neutral: the robot can be moved aside without a force, as a round rod that has buckled."""

    @property
    def explanation(self) -> str:
        """The status in words."""
        return _WORDS[self]


_WORDS = {
    Status.CERTIFIED: "certified stable",
    Status.UNSTABLE: "in balance, but not stable",
    Status.UNSETTLED: "not in balance",
    Status.OUT_OF_RANGE: "a section is at the end of its range",
    Status.NOT_A_NUMBER: "a number that is not finite, or too large to compute with, or lengths that no shape has",
    Status.UNOBSERVABLE: "the motors do not feel every direction of the force",
    Status.NOT_REACHED: "no force explains the torques, or the target is not reached",
    Status.BEYOND_LIMITS: "the target is reached only with a motor beyond its limits",
    Status.NEUTRAL: "in balance, but neutral: it can be moved aside without a force",
}
