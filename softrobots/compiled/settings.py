"""Tolerances of the compiled solvers: those of the solvers on Pinocchio, where they have them, and their own."""

from __future__ import annotations

from softrobots.core import checks
from softrobots.model import springs
from softrobots.statics import elastic_state, elastostatics, force_search

TOLERANCE = elastic_state.TOLERANCE
"""Largest residual of an answer, relative to the size of the load."""

NEWTON_TOLERANCE = 1e-12
"""Residual at which Newton stops; reached from one below `TOLERANCE` in one step."""

LEAST_SIZE = elastic_state.MOMENT_FLOOR
"""Least size of a load [N m]."""

LARGEST_NUMBER = checks.LARGEST
"""Largest component of a force [N] or of gravity [m/s^2]."""

LARGEST_POSITION = 1e9
"""Largest position of a motor joint [rad or m]: sines of larger angles lose digits, and beyond 1e15 mean nothing."""

LARGEST_SIZE = 1e31
"""Largest size of motor torques [N m]; above it squares would soon overflow."""

POSITIVE_PIVOT = springs.POSITIVE
"""Smallest pivot that counts as positive, relative to the springs' own stiffness."""

SMALL_PIVOT_SHIFT = 1e-3
"""Least pivot of a guarded step, relative to the spring's own stiffness; every second guarded step has the larger one."""

LARGE_PIVOT_SHIFT = 3.0
"""The larger one."""

LARGEST_STEP = elastostatics.LARGEST_STEP
"""Largest Newton step, as a norm [rad]."""

SHORT_STEP = 0.1 * LARGEST_STEP
"""A guarded step shorter than this may be doubled [rad]."""

ARMIJO = elastostatics.ARMIJO
"""Share of the predicted fall of the energy that a step must reach."""

ENERGY_ROUNDING = elastic_state.ENERGY_ROUNDING
"""Energies this close, relative to their terms, cannot be told apart."""

MAX_LANES = 16
"""Most cases that are worked on side by side."""

MIN_LANES = 8
"""Fewest: two vectors of four numbers, so that one is computed while the other waits."""

LANE_MEMORY = 65_536
"""Workspace of all lanes together [bytes]."""

OBSERVABLE = force_search.OBSERVABLE
"""Smallest singular value of the elastostatic Jacobian at which the motors feel every force, relative to the reach."""

RANK_TOLERANCE = 1e-6
"""Singular value of the elastostatic Jacobian that counts as none, relative to the reach."""

HIDDEN = force_search.HIDDEN
"""Share of the motor torques that may stay unexplained where the motors do not feel every force."""

PASSES = 10
"""Newton passes before a case is left to the descent or the search."""

FORCE_PASSES = 5
"""The same in load estimation. Cases that take more are near a pose in which the motors do not feel every force, and plain
Newton may find one far from zero; the damped search finds the one that `softrobots.estimate_load` does."""

DESCENT_STEPS = 200
"""Most steps of a descent."""

SEARCH_STEPS = 100
"""Most steps of a search for a force or for motors."""

MAX_UNROLLED_JOINTS = 16
"""Most joints of a robot that is traced in one straight line; longer ones and those with muscles get loops.

A straight line is a quarter faster than loops, and with twenty joints takes twice as long to compile."""
