"""Places of numbers in the workspace of generated code: of a case, of a looped recursion, of the response of its tip."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

SINGLES = (
    "energy",
    "slope",
    "error",
    "length",
    "size",
    "min_pivot",
    "n_negative_pivots",
    "range_margin",
    "mode",
    "bound",
    "pivot_shift",
    "rounding",
    "missing",
    "turned",
    "unexplained",
    "observed",
    "damping",
    "tolerated",
    "iterations",
)
"""Single numbers of a case: energy [J]; derivative of the energy along the step; squared residual; squared length of the step;
squared size of the load; smallest pivot in size; number of pivots that are not positive; margin of the sections to the end of
their range; state of the case (`softrobots.compiled.program.passes`); largest energy allowed at the next point; least relative
pivot of a step with shifted pivots, or 0; rounding of the energy [J]; squared distance from the target [m^2] or squared motor
torque that another force would explain; squared angle from the target orientation, see `motor_program` [rad^2]; squared motor
torque that the force does not explain; squared smallest singular value of the elastostatic Jacobian [m^2]; damping of a search
[m]; largest distance from a target [m]; number of steps."""


# No places for callers.
_COUNTS = ("unknowns", "conditions", "muscles", "constraints", "inputs", "rubbing", "guides", "singles", "numbers", "prepared")


def assign_places(layout: Any, first: int, **sizes: int) -> None:
    """Set attributes of a frozen layout to consecutive places from `first` on, one for each size."""
    for name, size in sizes.items():
        object.__setattr__(layout, name, first)
        first += size


@dataclass(frozen=True)
class Layout:
    """Places in the workspace, in this order; counts are those of the chain."""

    motors: int
    """Number of motor joints, whose positions come first [rad or m]."""
    unknowns: int
    """Number of unknown strains."""
    conditions: int = 3
    """Number of conditions of a target: 3 for a position, 6 for a pose."""
    muscles: int = 0
    """Number of muscles with an input: all but those that constrain sums of unknowns."""
    constraints: int = 0
    """Number of sums that muscle lengths constrain."""
    inputs: int = 0
    """Number of numbers of the robot that are inputs of its code, see `numbers.NumberInputs`."""
    rubbing: int = 0
    """Number of unknowns of a robot with dry friction; 0 for others."""
    guides: int = 0
    """Number of guides of actuators that rub."""
    force: int = field(init=False)
    """Force on the tip, world axes [N] (3)."""
    gravity: int = field(init=False)
    """Gravity, world axes [m/s^2] (3)."""
    held: int = field(init=False)
    """Multiplier of each constrained sum at the last point, beyond those of the start [N m or N]; of lengths, tensions [N]."""
    actuators: int = field(init=False)
    """Input of each muscle, without constrained sums: length, or that of the motor [m], tension [N] or pressure [Pa]."""
    start: int = field(init=False)
    """Start of the search where muscle lengths constrain sums of the unknowns, or rest is an input; others start at rest."""
    unknown: int = field(init=False)
    """The unknown strains [rad or m]."""
    step: int = field(init=False)
    """The Newton step of each."""
    line_origin: int = field(init=False)
    """Start of a line search, of each."""
    line_direction: int = field(init=False)
    """Direction of a line search, of each."""
    tip: int = field(init=False)
    """Tip in the world [m] (3)."""
    torques: int = field(init=False)
    """Measured load on each motor [N m or N]."""
    target: int = field(init=False)
    """Target of the tip [m] (3), and of poses its orientation, row by row (9)."""
    next_target: int = field(init=False)
    """The target after it."""
    next_point: int = field(init=False)
    """End of a step: motors or force, then unknowns."""
    previous: int = field(init=False)
    """Point before the step of a search: motors or force, then unknowns."""
    predicted: int = field(init=False)
    """End of the last step along a path: motors, then unknowns."""
    correction: int = field(init=False)
    """Difference of the waypoint's solution from that: motors, then unknowns."""
    singles: int = field(init=False)
    """The numbers of `SINGLES`."""
    numbers: int = field(init=False)
    """Numbers of the robot that are inputs."""
    sliders: int = field(init=False)
    """Where the sliders of dry friction stand before the step, at the places of the unknowns that they hold [rad]."""
    slid: int = field(init=False)
    """Where they stand after it [rad]."""
    anchors: int = field(init=False)
    """Length beyond each guide at which its slider stands before the step, beyond that at rest [m]."""
    anchored: int = field(init=False)
    """The same after it [m]."""
    grips: int = field(init=False)
    """Friction of each guide that slips [N]; then that which the last round led to, and by how much it was off."""
    prepared: int = field(init=False)
    """Values that depend on motors, load and numbers of the robot only; as many places as the code needs."""

    def __post_init__(self) -> None:
        """Compute the places."""
        motors, n = self.motors, self.unknowns
        point = self.varied + n
        before_tip = dict(
            held=self.constraints, actuators=self.muscles, start=n, unknown=n, step=n, line_origin=n, line_direction=n
        )
        points = dict(next_point=point, previous=point, predicted=point, correction=point)
        searches = dict(tip=3, torques=motors, target=self.target_size, next_target=self.target_size)
        guides = dict(anchors=self.guides, anchored=self.guides, grips=3 * self.guides)
        rest = dict(singles=len(SINGLES), numbers=self.inputs, sliders=self.rubbing, slid=self.rubbing, **guides, prepared=0)
        assign_places(self, motors, force=3, gravity=3, **before_tip, **searches, **points, **rest)

    @property
    def target_size(self) -> int:
        """Number of places of a target."""
        return 3 if self.conditions == 3 else 12

    @property
    def varied(self) -> int:
        """Number of motors, or of components of the force if there are fewer motors, before the unknowns of a point."""
        return max(self.motors, 3)

    def single(self, name: str) -> int:
        """Return the place of one of `SINGLES`."""
        return self.singles + SINGLES.index(name)

    def constants(self) -> dict[str, int]:
        """Return the places by their names in generated code."""
        absent = [*(() if self.rubbing else ("sliders", "slid")), *(() if self.guides else ("anchors", "anchored", "grips"))]
        places = {name.upper(): place for name, place in vars(self).items() if name not in (*_COUNTS, *absent)}
        places |= {name.upper(): self.single(name) for name in SINGLES}
        return places | {"MOTORS": 0, "N_MOTORS": self.motors, "N": self.unknowns}


@dataclass(frozen=True)
class RecursionLayout:
    """Places of the sums, behind the numbers of the case.

    Muscle lengths constrain at most three sums of a segment: bending about two axes, and elongation. So there are at most three
    multipliers.
    """

    first: int
    """First of the places."""
    muscles: int
    """Largest number of muscles of a segment."""
    axes: int = field(init=False)
    """Axes behind the last element of the outward pass (9)."""
    lever: int = field(init=False)
    """Levers of force and weight (6)."""
    matrix: int = field(init=False)
    """`P` of the elimination, upper triangle by columns (21)."""
    column: int = field(init=False)
    """`s` of the elimination (6)."""
    turn: int = field(init=False)
    """Turn of all elements nearer to the base, and multipliers (6)."""
    sums: int = field(init=False)
    """Elastic energy, squared weight, range margin, smallest pivot, number of negative pivots (5)."""
    steps: int = field(init=False)
    """Slope, squared residual, squared step (3)."""
    gaps: int = field(init=False)
    """Difference of the constrained sums of a segment from their given values (3)."""
    constraint_torques: int = field(init=False)
    """Sums of the torques of the constraints (3)."""
    multipliers: int = field(init=False)
    """Multipliers of the segment at the last point (3)."""
    tensions: int = field(init=False)
    """Tension of each muscle of the segment at the last point (`muscles`)."""
    preload: int = field(init=False)
    """Part of that at the start (`muscles`)."""
    force: int = field(init=False)
    """Force and gravity in the axes behind the leading motors (6)."""
    base: int = field(init=False)
    """Axes and origin of the frame behind the leading motors (12)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        sums = dict(sums=5, steps=3, gaps=3, constraint_torques=3)
        sums |= dict(multipliers=3, tensions=self.muscles, preload=self.muscles)
        assign_places(self, self.first, axes=9, lever=6, matrix=21, column=6, turn=6, **sums, force=6, base=12, end=0)


@dataclass(frozen=True)
class TipLayout:
    """Places of the response of the tip; `m` motor joints, `n` unknowns, `h` constraints, world axes, row by row."""

    first: int
    """First of the places."""
    motors: int
    """Number of motor joints."""
    unknowns: int
    """Number of unknowns."""
    n_constraints: int
    """Number of constrained sums."""
    given: bool = False
    """Whether loads and motions are given, one right-hand side, instead of unit forces on the tip, three of them."""
    jacobian: int = field(init=False)
    """Elastostatic Jacobian of the motor joints (3, m) [m/rad or m/m]; of given loads the rate of their loads (1, m)."""
    motor_torques: int = field(init=False)
    """Load on each motor joint (m) [N m or N]."""
    tip_columns: int = field(init=False)
    """Derivative of the unknowns with respect to a force on the tip, `K^-1 J_k^T` (3, n) [rad/N or m/N]."""
    constraint_loads: int = field(init=False)
    """Load on each constrained sum (h) [N m or N]."""
    constraint_columns: int = field(init=False)
    """Derivative of the tip with respect to the constrained sums (3, h) [m/rad or -]."""
    twists: int = field(init=False)
    """Turn per motor joint of all beyond it, in the axes behind the leading motors (3, m)."""
    column: int = field(init=False)
    """`s` of the elimination of the three right-hand sides (18); see `RecursionLayout`."""
    turn: int = field(init=False)
    """Their turns of all elements nearer to the base, and multipliers (18)."""
    bends: int = field(init=False)
    """Their sums of `c x` over the strains so far (9)."""
    moved: int = field(init=False)
    """Rate of the tip at given loads and motions, in the axes behind the leading motors, at the end in the world (3) [m]."""
    base_force: int = field(init=False)
    """Rate of the force in the axes behind the leading motors (3) [N]."""
    loads: int = field(init=False)
    """Given rates of the loads on the unknowns (n) [N m or N]."""
    force: int = field(init=False)
    """That of the force on the tip, world axes (3) [N]."""
    motions: int = field(init=False)
    """Those of the motor joints (m) [rad or m]."""
    sums: int = field(init=False)
    """Those of the constrained sums (h) [rad or m]."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        m, n, h, r = self.motors, self.unknowns, self.n_constraints, self.rows
        results = dict(jacobian=r * m, motor_torques=m, tip_columns=r * n, constraint_loads=h, constraint_columns=r * h)
        sums = dict(twists=3 * m, column=6 * r, turn=6 * r, bends=3 * r)
        given = dict(moved=3, base_force=3, loads=n, force=3, motions=m, sums=h)
        assign_places(self, self.first, **results, **sums, **(given if self.given else dict.fromkeys(given, 0)), end=0)

    @property
    def rows(self) -> int:
        """Number of right-hand sides, besides that of the balance."""
        return 1 if self.given else 3

    def each(self, first: int, size: int) -> list[int]:
        """Return the place of a part of each of these, of this size."""
        return [first + size * row for row in range(self.rows)]

    def constants(self) -> dict[str, int]:
        """Return the places of the results by their names in generated code."""
        names = ("jacobian", "motor_torques", "tip_columns", "constraint_loads", "constraint_columns")
        return {name.upper(): getattr(self, name) for name in names}
