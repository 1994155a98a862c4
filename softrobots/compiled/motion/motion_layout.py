"""Places of numbers in the workspace of generated code for motion, and the inputs of the functions that trace it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.motion.held_motion import moving_coordinates
from softrobots.compiled.motion.motion_routes import MotionRoutes
from softrobots.compiled.motion_settings import KEPT_DIFFERENCES
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.complex_numbers import ComplexScalar
from softrobots.compiled.trace.expressions import Scalar
from softrobots.dynamics.gauss import EIGENVALUE, GaussRule
from softrobots.model.dry_friction import DryFriction

_COUNTS = ("unknowns", "full_damping", "order", "strains", "coasting", "rubbing", "guides", "prepared")  # no places for callers
_GUIDES = ("anchors", "shares", "grips", "guide_slope", "displaced", "inverse")
_RUBBING = ("sliders", "strain_begin", "rate_begin", "beyond", "lag", "line", "line_strain")
_INNER = ("stages", "forces", "mass_damping", "mass_rate", *_GUIDES, *_RUBBING)  # places that some robots do not have


@dataclass(frozen=True)
class MotionLayout:
    """Places in the workspace of a step of time, in this order.

    `n` unknowns, the strains or with given lengths the free coordinates, and `m` actuators. Straight-line functions read
    motors, force, gravity, damping, time step, `unknown`, `rate` and `acceleration`, and write `correction` and `tip`; all else
    is for the drivers.
    """

    motors: int
    """Number of actuators, motor joints and then muscles; their coordinates in the middle of the step come first (m)."""
    unknowns: int
    """Number of unknowns."""
    full_damping: bool = False
    """Whether the damping is a matrix rather than a number for each unknown."""
    order: int = 2
    """Order of the steps: 2 by the midpoint rule, 4 by the method of Gauss with two stages."""
    strains: int | None = None
    """Number of strains of a looped chain, each with a damper; None for unrolled ones."""
    coasting: bool = False
    """Whether steps are guessed from the linear equations of the step before, too."""
    rubbing: bool = False
    """Whether there is dry friction."""
    guides: int = 0
    """Number of guides of actuators that rub (G)."""
    motor_velocities: int = field(init=False)
    """Their velocities there (m) [rad/s or m/s]."""
    motor_accelerations: int = field(init=False)
    """Their accelerations there (m) [rad/s^2 or m/s^2]."""
    force: int = field(init=False)
    """Force on the tip in the middle of the step, world axes [N] (3)."""
    gravity: int = field(init=False)
    """Gravity, world axes [m/s^2] (3)."""
    damping: int = field(init=False)
    """Damping of each unknown (n) [N m s/rad or N s/m], or the matrix, row by row (n, n); of looped chains of each strain."""
    mass_damping: int = field(init=False)
    """The part of the damping of a looped chain that is a matrix, row by row (n, n): Rayleigh's factor times the mass."""
    mass_rate: int = field(init=False)
    """That factor [1/s]."""
    time_step: int = field(init=False)
    """Length of the step [s]."""
    unknown: int = field(init=False)
    """The unknowns in the middle of the step, or where the tip is asked for (n) [rad or m]."""
    rate: int = field(init=False)
    """Their velocities there (n)."""
    acceleration: int = field(init=False)
    """Their accelerations there (n)."""
    correction: int = field(init=False)
    """Newton's correction of the accelerations (n), or of those at both stages (2, n)."""
    tip: int = field(init=False)
    """Tip at `unknown` and the motors, world axes [m] (3)."""
    position: int = field(init=False)
    """The unknowns at the beginning of the step, behind it at its end (n)."""
    velocity: int = field(init=False)
    """Their velocities there (n)."""
    begin_position: int = field(init=False)
    """The unknowns at the beginning of the step that was taken last (n)."""
    begin_velocity: int = field(init=False)
    """Their velocities there (n)."""
    history: int = field(init=False)
    """Backward differences of the middles of equal steps (`KEPT_DIFFERENCES`, n), or at both stages (.., 2, n)."""
    sizes: int = field(init=False)
    """The largest of each order in the step that was taken last (`KEPT_DIFFERENCES`)."""
    weights: int = field(init=False)
    """Weight of each in the extrapolation: 1 for those that are used (`KEPT_DIFFERENCES`)."""
    n_history: int = field(init=False)
    """Number of equal steps before."""
    last_step: int = field(init=False)
    """Length of these steps [s]."""
    motors_begin: int = field(init=False)
    """Motors at the beginning of the step (m) [rad or m]."""
    motors_middle: int = field(init=False)
    """Motors in its middle (m)."""
    motors_end: int = field(init=False)
    """Motors at its end (m)."""
    whole_step: int = field(init=False)
    """Length of the step that these are of, of which `time_step` may be a part [s]."""
    share: int = field(init=False)
    """A moment of that step: 0 at its beginning, 1 at its end."""
    parts: int = field(init=False)
    """Number of steps and parts of steps that were tried."""
    most_parts: int = field(init=False)
    """Number of those after which a run ends as not settled; 0: any number."""
    coasts: int = field(init=False)
    """1 where a step is guessed from the linear equations of the step before, 0 where it is extrapolated."""
    scale: int = field(init=False)
    """What changes of the unknowns are multiplied by to compare them (n) [1/rad or 1/m]."""
    change: int = field(init=False)
    """Largest change of an unknown in the middle of the step by the last correction, by `scale`."""
    last_change: int = field(init=False)
    """The same of the correction before."""
    change_before: int = field(init=False)
    """The same of the one before that."""
    settled: int = field(init=False)
    """1 where the corrections have converged, 0 where they have not."""
    coupled: int = field(init=False)
    """1 where each stage has a matrix of its own, which couples both, 0 where both have that of the second."""
    failed: int = field(init=False)
    """1 after a step that has not converged as a whole: later ones are extrapolated only; of lanes, that one is done alone."""
    stages: int = field(init=False)
    """Accelerations of the unknowns at both stages (2, n)."""
    forces: int = field(init=False)
    """What is out of balance on them there (n, 2)."""
    shares: int = field(init=False)
    """Friction of each guide over its limit, from -1 to 1 (G); from here to `anchors` where guides rub only."""
    grips: int = field(init=False)
    """Friction of each guide that slips (G) [N]."""
    guide_slope: int = field(init=False)
    """Slopes of each piece of an actuator by the four strains there (4 G)."""
    displaced: int = field(init=False)
    """Strains from which friction acts in the middle of a step (N), see `softrobots.dynamics.friction_steps`."""
    inverse: int = field(init=False)
    """Inverse of the matrix of a step (N, N)."""
    anchors: int = field(init=False)
    """Length beyond each guide at which its slider stands before the step, beyond that at rest (G) [m]."""
    sliders: int = field(init=False)
    """The sliders of dry friction of each strain before the step (N) [rad]; from here to `line_strain` with friction only."""
    strain_begin: int = field(init=False)
    """The strains there (N)."""
    rate_begin: int = field(init=False)
    """Their rates there (N)."""
    beyond: int = field(init=False)
    """Four times the strains in the middle where friction is at rest (N), see `softrobots.dynamics.friction_steps`."""
    lag: int = field(init=False)
    """How far the strains are from the sliders at the end of the step (N)."""
    line: int = field(init=False)
    """The last whole correction of the accelerations of the unknowns (n)."""
    line_strain: int = field(init=False)
    """That of the accelerations of the strains (N)."""
    prepared: int = field(init=False)
    """Values that do not depend on the unknowns, factors, records: as many places as the code needs."""

    @property
    def in_stages(self) -> bool:
        """Whether a step has two stages."""
        return self.order == GaussRule.order

    def __post_init__(self) -> None:
        """Compute the places."""
        m, n, k = self.motors, self.unknowns, 2 if self.in_stages else 1
        full = n * n if self.full_damping else 0
        damping = dict(damping=full or n, mass_damping=0, mass_rate=0)
        if self.strains is not None:
            damping = dict(damping=self.strains, mass_damping=full, mass_rate=1 if full else 0)
        given = dict(motor_velocities=m, motor_accelerations=m, force=3, gravity=3) | damping
        middle = dict(time_step=1, unknown=n, rate=n, acceleration=n, correction=k * n, tip=3)
        state = dict(position=n, velocity=n, begin_position=n, begin_velocity=n)
        before = dict(
            history=KEPT_DIFFERENCES * k * n, sizes=KEPT_DIFFERENCES, weights=KEPT_DIFFERENCES, n_history=1, last_step=1
        )
        path = dict(motors_begin=m, motors_middle=m, motors_end=m, whole_step=1, share=1, parts=1, most_parts=1)
        search = dict(coasts=1, scale=n, change=1, last_change=1, change_before=1, settled=1, coupled=1, failed=1)
        stages = dict(stages=(k - 1) * 2 * n, forces=k * (self.strains or 0) if k == 2 or full or self.rubbing else 0)
        count = (self.strains or 0) * self.rubbing
        rubbing = {name: count for name in _RUBBING} | dict(line=n * self.rubbing)
        each, some = self.guides, count * (self.guides > 0)
        guides = dict(shares=each, grips=each, guide_slope=4 * each, displaced=some, inverse=some * count, anchors=each)
        parts = given | middle | state | before | path | search | stages | guides | rubbing
        assign_places(self, m, **parts, prepared=0)

    def constants(self) -> dict[str, int]:
        """Return the places by their names in generated code."""
        left_out = _COUNTS + _INNER
        places = {name.upper(): place for name, place in vars(self).items() if name not in left_out}
        if self.strains is not None and self.full_damping:
            places |= {"MASS_DAMPING": self.mass_damping, "MASS_RATE": self.mass_rate}
        for name in (*(_RUBBING if self.rubbing else ()), *(_GUIDES if self.guides else ())):
            places[name.upper()] = getattr(self, name)
        return places | {"MOTORS": 0, "N_MOTORS": self.motors, "N": self.unknowns}


@dataclass(frozen=True)
class MotionPlan:
    """A chain and its places in the workspace of a step of time."""

    unknowns: Unknowns
    """The chain."""
    full_damping: bool = False
    """Whether the damping is a matrix."""
    order: int = 2
    """Order of the steps."""
    guides: DryFriction | None = None
    """The friction of actuators in their guides."""

    @cached_property
    def layout(self) -> MotionLayout:
        """Places of the numbers of a case."""
        unknowns = self.unknowns
        count, strains = len(moving_coordinates(unknowns)), None if unknowns.is_unrolled else len(unknowns.strains)
        routed = replace(unknowns, chain=unknowns.chain.joined).routed
        coasting = self.order == GaussRule.order and strains is not None and not self.full_damping and not routed
        given = len(unknowns.chain.limits), count, self.full_damping, self.order, strains, coasting
        guides = 0 if self.guides is None else self.guides.n_guides
        return MotionLayout(*given, bool(unknowns.chain.friction) or guides > 0, guides)

    @cached_property
    def routes(self) -> MotionRoutes | None:
        """Places of actuators on routes and of the strains that they hold; None without any."""
        layout, joined = self.layout, replace(self.unknowns, chain=self.unknowns.chain.joined)
        return MotionRoutes(joined, layout.prepared, 2 if layout.in_stages else 1) if joined.routed else None

    @property
    def strains(self) -> tuple[int, int, int, int]:
        """Place of the unknown strains, their rates and accelerations, of one stage, and dampers."""
        layout, routes = self.layout, self.routes
        if routes is None or not routes.held:
            return layout.unknown, layout.rate, layout.acceleration, layout.damping
        return routes.strain, routes.strain_rate, routes.strain_change, layout.damping

    @property
    def correction(self) -> int:
        """Place of the correction of the accelerations of the strains."""
        return self.layout.correction if self.routes is None or not self.routes.held else self.routes.correction

    @property
    def reduces(self) -> bool:
        """Whether torques out of balance are written first, and eliminated in a pass of their own."""
        return self.layout.in_stages or self.routes is not None or self.layout.full_damping or self.layout.rubbing

    @property
    def couples(self) -> bool:
        """Whether each stage may have a matrix of its own; a border needs a complex one."""
        return self.layout.in_stages and self.routes is None

    def row(self, name: str) -> str:
        """Return the base of the numbers of an unknown or a strain at all stages, which stand side by side."""
        return f"2 * {name}" if self.layout.in_stages else name

    @property
    def torques(self) -> tuple[int, int]:
        """Where torques out of balance are written, and where they are read to be eliminated, at all stages."""
        return (self.layout.forces, self.layout.forces) if self.routes is None else (self.routes.torques, self.routes.sides)

    def massive(self, block: Block) -> Scalar:
        """Return the factor of the mass in the matrix of a step: one and that of a damper times Rayleigh's factor."""
        layout = self.layout
        if layout.strains is None or not layout.full_damping:
            return 1.0
        return self.factors(block)[0] * block.load(layout.mass_rate) + 1.0

    def factors(self, block: Block) -> tuple[Scalar, Scalar]:
        """Return the factors of damping and stiffness in the matrix of a step: `h/2` and `h^2/4`, or complex ones."""
        h = block.load(self.layout.time_step)
        if not self.layout.in_stages:
            return h * 0.5, h * h * 0.25
        once, twice = EIGENVALUE, EIGENVALUE * EIGENVALUE
        return ComplexScalar(h * once.real, h * once.imag), ComplexScalar(h * h * twice.real, h * h * twice.imag)
