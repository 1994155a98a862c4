"""Tolerances and limits of compiled motion."""

from __future__ import annotations

from softrobots.dynamics import friction_steps, midpoint

MOTION_TOLERANCE = midpoint.CHANGE
"""Change of an unknown in the middle of a step of time that ends the corrections, relative to 1 rad or m or its size."""

MOTION_NEXT = 0.1 * MOTION_TOLERANCE
"""Expected change by the next correction, below which that is left out: it is what a step leaves, and steps add up."""

MOTION_ROUNDING = midpoint.ROUNDED
"""Change that may be left where corrections no longer shrink."""

MOTION_CORRECTIONS = midpoint.ITERATIONS
"""Largest number of corrections of a step of time; then it is halved."""

MOTION_LEFT = midpoint.LEFT
"""Change by the last of them, below which it is not halved."""

RUBBING_CORRECTIONS = float(midpoint.RUBBING_ITERATIONS)
"""Largest number of evaluations of a step of a robot with dry friction; then it is halved."""

OVERSHOT = friction_steps.OVERSHOT
"""Slope of the energy of a step uphill at the end of a correction over that downhill at its start, above which it is cut."""

RENEW_SHARE = midpoint.SLOW
"""Share of the last change, above which the factors of a step are computed again: tendons go slack, or the body swings far."""

LEAST_PART = 2.0**-12
"""Smallest part of a step of time."""

COASTING_ERROR = 0.01
"""Error of what the linear equations of the step before tell of a step, over how far that goes from the step before."""

KEPT_DIFFERENCES = 8
"""Number of backward differences of the middles of equal steps from which the next middle is extrapolated."""

LANE_CACHE = 262_144
"""Workspace of all lanes together beyond which both stages of a step of one case are done faster than lanes [bytes]."""
