"""Plots of the guide of motion."""

from __future__ import annotations

from typing import Any

from softrobots.view.figures import motions
from studies.motion import examples


def motion_release() -> Any:
    """The arm of docs/motion.md that is let go, over its first swing."""
    return motions.strobe(examples.release(0.14), shown=7)


def motion_tip() -> Any:
    """Its tip over time."""
    return motions.tip_over_time(examples.release())


def motion_energies() -> Any:
    """Its energies."""
    return motions.energies(examples.release())


def motion_turn() -> Any:
    """The tip of the arm that turns fast, with and without shaping."""
    return motions.tip_over_time(examples.turns())


def motion_gust() -> Any:
    """The helix in a gust."""
    return motions.strobe(examples.gust(0.45), shown=7)
