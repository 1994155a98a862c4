"""Tolerances and limits of the compiled solvers; those of the solvers on Pinocchio where these have the same."""

from __future__ import annotations

from softrobots.core import checks
from softrobots.model import friction_coordinates, springs
from softrobots.statics import elastic_state, elastostatics, tip_search
from softrobots.statics.tip_force import force_search

TOLERANCE = elastic_state.TOLERANCE
"""Largest residual of a result, relative to the size of the load."""

NEWTON_TOLERANCE = 1e-12
"""Relative residual at which Newton's method stops; one step leads there from `TOLERANCE`."""

LEAST_SIZE = elastic_state.MOMENT_FLOOR
"""Least size of a load [N m]."""

ANGLE_TOLERANCE = tip_search.ANGLE_TOLERANCE
"""Largest angle between the tip and its target orientation [rad]."""

LEVER = tip_search.LEVER
"""Weight of a radian of orientation as a distance, relative to the reach."""

LARGEST_NUMBER = checks.LARGEST
"""Largest component of a force [N] or of gravity [m/s^2]."""

LARGEST_POSITION = 1e9
"""Largest position of a motor joint [rad or m]; sines of larger angles lose digits."""

LARGEST_SIZE = 1e31
"""Largest size of motor torques [N m]; above it squares would soon overflow."""

POSITIVE_PIVOT = springs.POSITIVE
"""Smallest pivot that counts as positive, relative to the springs' own stiffness."""

CLEARLY_POSITIVE_PIVOT = elastostatics.CLEARLY * POSITIVE_PIVOT
"""Pivot beyond which the sign does not depend on the residual that is left."""

SMALL_PIVOT_SHIFT = 1e-3
"""Least pivot of a step with shifted pivots, relative to the spring's own stiffness; used by turns with the larger one."""

LARGE_PIVOT_SHIFT = 3.0
"""The larger one."""

LARGEST_STEP = elastostatics.LARGEST_STEP
"""Largest Newton step, as a norm [rad]."""

SHORT_STEP = 0.1 * LARGEST_STEP
"""Length below which a step with shifted pivots may be doubled [rad]."""

ARMIJO = elastostatics.ARMIJO
"""Share of the predicted decrease of the energy that a step must reach."""

ENERGY_ROUNDING = elastic_state.ENERGY_ROUNDING
"""Rounding of energies, relative to their terms."""

MAX_LANES = 16
"""Largest number of cases side by side."""

MIN_LANES = 8
"""Smallest number: two vectors of four numbers, so that one is computed while the other waits."""

LANE_MEMORY = 65_536
"""Workspace of all lanes together [bytes]."""

CHUNK = 8192
"""Cases that a thread takes at a time; few, as another program may slow one thread down."""

OBSERVABLE = force_search.OBSERVABLE
"""Smallest singular value of the elastostatic Jacobian at which every force is observable, relative to the reach."""

RANK_TOLERANCE = 1e-6
"""Singular value of the elastostatic Jacobian that counts as zero, relative to the reach."""

HIDDEN = force_search.HIDDEN
"""Share of the motor torques that may stay unexplained where a direction of the force is not observable."""

GUIDE_ROUNDS = friction_coordinates.MOST_ROUNDS
"""Most changes of the friction of guides on the way to the one that stays."""

SAME_GRIP = friction_coordinates.SAME_FRICTION
"""Change of that friction that is none, relative to the largest tension."""

GRIP_RUNAWAY = friction_coordinates.RUNAWAY
"""Change that it does not come back from, likewise."""

PASSES = 10
"""Newton passes before the descent or the search takes over a case."""

FORCE_PASSES = 5
"""The same in load estimation. Cases that take more are near a pose in which a direction of the force is not observable, and
plain Newton may find a force far from zero; the damped search finds that of `softrobots.estimate_load`."""

DESCENT_STEPS = 200
"""Largest number of steps of a descent."""

SEARCH_STEPS = 100
"""Largest number of steps of a search for a force or for motors."""

MAX_UNROLLED_JOINTS = 16
"""Largest number of joints of an unrolled chain; longer ones, and those with sections or muscles, are looped.

Unrolled code is a quarter faster than loops, and with twenty joints takes twice as long to compile."""
