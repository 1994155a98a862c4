"""Names that a generated module declares before the text of the drivers: types only, for the type checker."""

from __future__ import annotations

from collections.abc import Callable

from softrobots.compiled.drivers.intrinsics import Array

# Values of `softrobots.compiled.statuses.Status`.
CERTIFIED: int
UNSTABLE: int
UNSETTLED: int
OUT_OF_RANGE: int
NOT_A_NUMBER: int
UNOBSERVABLE: int
NOT_REACHED: int
BEYOND_LIMITS: int
NEUTRAL: int

# Counts of the robot, and sizes of workspaces.
N: int
N_MOTORS: int
N_CONSTRAINTS: int
N_SLIDERS: int
N_GUIDES: int
N_RUBBING: int
N_STARTS: int
N_STRAINS: int
N_INPUTS: int
N_MUSCLES: int
N_MUSCLE_ROWS: int
N_VARIED: int
TARGET_SIZE: int
N_ERRORS: int
LANES: int
LANE_SIZE: int
NUMBER_WEIGHTS: int
WORKSPACE_SIZE: int

# Places in the workspace, see `softrobots.compiled.chain.layout`.
ACTUATORS: int
GRIPS: int
PULLED: int
CORRECTION: int
DAMPING: int
ENERGY: int
ERROR: int
FORCE: int
GRAVITY: int
HELD: int
ITERATIONS: int
LENGTH: int
LINE_DIRECTION: int
LINE_ORIGIN: int
MIN_PIVOT: int
MISSING: int
MODE: int
MUSCLE_PLACE: int
NEXT_POINT: int
NEXT_TARGET: int
N_NEGATIVE_PIVOTS: int
OBSERVED: int
PIVOT_SHIFT: int
PREDICTED: int
PREVIOUS: int
RANGE_MARGIN: int
ROUNDING: int
SIZE: int
SLOPE: int
START: int
STEP: int
TARGET: int
TOLERATED: int
TORQUES: int
TURNED: int
UNKNOWN: int

# Places in the workspace of motion, see `softrobots.compiled.motion.motion_layout`.
ACCELERATION: int
ANCHORS: int
BEGIN_POSITION: int
BEGIN_VELOCITY: int
BEYOND: int
CHANGE: int
COASTS: int
ALONE: int
COUPLED: int
DISPLACED: int
FAILED: int
GUIDE_SLOPE: int
INVERSE: int
LAG: int
LAST_CHANGE: int
LAST_STEP: int
LINE: int
LINE_STRAIN: int
MIDDLE: int
MOTORS: int
MOTORS_BEGIN: int
MOTORS_END: int
MOTORS_MIDDLE: int
MOST_PARTS: int
N_HISTORY: int
PARTS: int
POSITION: int
RATE: int
RATE_BEGIN: int
SETTLED: int
SHARE: int
SHARES: int
SIDES: int
SLIDERS: int
STRAIN_BEGIN: int
STRAIN_CORRECTION: int
TIME_STEP: int
TIP: int
VELOCITY: int
WHOLE_STEP: int

# Shape of the robot, see `softrobots.compiled.program.shape_program`.
ELASTIC_ROW: tuple[int, ...]
ELASTIC_SHARE: tuple[float, ...]
ELASTIC_STRAIN: tuple[int, ...]
LOADS: int
N_ELASTIC: int
N_PLACED: int
N_POINTS: int
N_SPRINGS: int
PLACED_COORDINATE: tuple[int, ...]
PLACED_KIND: tuple[int, ...]
PLACEMENTS: int
SPRINGS: int
STRAINS: int
STRAIN_REST: tuple[float, ...]
STRAIN_STIFFNESS: tuple[float, ...]
UNKNOWN_STRAIN: tuple[int, ...]

# Numbers of the robot: spring rounding [N m], reach [m], tables by unknown, motor or muscle.
FIRST_GUIDE: tuple[int, ...]
GROUP: tuple[int, ...]
GUIDE_AT: tuple[int, ...]
GUIDE_COEFFICIENT: tuple[float, ...]
GUIDE_LENGTH: tuple[float, ...]
GUIDE_LUMPED: tuple[float, ...]
GUIDE_REST: tuple[float, ...]
GUIDE_STICK: tuple[float, ...]
GUIDE_STRAIN: tuple[int, ...]
GUIDE_TURN: tuple[float, ...]
LEAST_INPUT: tuple[float, ...]
LOWER: tuple[float, ...]
MUSCLE_BASE: tuple[float, ...]
MUSCLE_REST: tuple[float, ...]
MUSCLE_SLOPE: tuple[float, ...]
REACH: float
REST: tuple[float, ...]
SOFTNESS: tuple[float, ...]
SPRING_ROUNDING: float
UPPER: tuple[float, ...]

# Straight-line functions.
evaluate: Callable[[Array], None]
first_force_pass: Callable[[Array], None]
first_force_pass_lanes: Callable[[Array], None]
first_pass: Callable[[Array], None]
first_pass_lanes: Callable[[Array], None]
force_pass: Callable[[Array], None]
force_pass_lanes: Callable[[Array], None]
look_for_force: Callable[[Array], None]
look_for_target: Callable[[Array], None]
newton_pass: Callable[[Array], None]
newton_pass_lanes: Callable[[Array], None]
prepare: Callable[[Array], None]
prepare_force: Callable[[Array], None]
respond_lanes: Callable[[Array], None]
target_pass_lanes: Callable[[Array], None]
target_step: Callable[[Array], None]

# Straight-line functions of the shape: place to write, row of the table, placement before, coordinate, number of the point.
bend_slack_walls: Callable[[Array], None]
place_section: Callable[[Array, int, int, int, int, int], None]
place_slide: Callable[[Array, int, int, int, int, int], None]
place_turn: Callable[[Array, int, int, int, int, int], None]

# Passes of motion over the chain.
correct_all: Callable[[Array], None]
reduce_all: Callable[[Array], None]
start_reduce: Callable[[Array], None]

# Straight-line functions of motion.
apply_correction: Callable[[Array, int], None]
apply_correction_lanes: Callable[[Array, int], None]
choose_order: Callable[[Array], None]
choose_order_lanes: Callable[[Array], None]
end_strains: Callable[[Array], None]
finish_unknown: Callable[[Array, int], None]
finish_unknown_lanes: Callable[[Array, int], None]
guess_unknown: Callable[[Array, int], None]
guess_unknown_lanes: Callable[[Array, int], None]
interpolate_unknown: Callable[[Array, int], None]
interpolate_unknown_lanes: Callable[[Array, int], None]
judge_corrections: Callable[[Array], None]
judge_corrections_lanes: Callable[[Array], None]
motion_coast: Callable[[Array], None]
motion_coast_lanes: Callable[[Array], None]
motion_correct: Callable[[Array], None]
motion_correct_lanes: Callable[[Array], None]
motion_factor: Callable[[Array], None]
motion_factor_lanes: Callable[[Array], None]
motion_prepare: Callable[[Array], None]
motion_prepare_lanes: Callable[[Array], None]
motion_tip: Callable[[Array], None]
motion_tip_lanes: Callable[[Array], None]
place_motor: Callable[[Array, int], None]
place_motor_lanes: Callable[[Array, int], None]
