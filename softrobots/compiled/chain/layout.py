"""Where the numbers of one case stand in the workspace of generated code."""

from __future__ import annotations

from dataclasses import dataclass

SINGLES = (
    "energy",
    "slope",
    "error",
    "length",
    "size",
    "softest",
    "negatives",
    "room",
    "mode",
    "bound",
    "guard",
    "rounding",
    "missing",
    "unexplained",
    "observed",
    "damping",
    "tolerated",
    "spent",
)
"""Single numbers of a case: energy [J]; derivative of the energy along the step; squared residual; squared length of the step;
squared size of the load; smallest pivot in size; number of pivots that are not positive; room of the sections in their range;
what is to become of the case (`softrobots.compiled.drivers.equilibrium_drivers`); largest energy that the next point may have;
whether pivots are guarded; rounding of the energy [J]; squared distance from the target [m^2] or squared motor torque that
another force would explain; squared motor torque that the force does not explain; squared smallest singular value of the
elastostatic Jacobian [m^2]; damping of a search [m]; largest distance from a target [m]; steps spent."""


@dataclass(frozen=True)
class Layout:
    """Places in the workspace, in this order; counts are those of the chain."""

    motors: int
    """Number of motor joints, whose positions come first [rad or m]."""
    unknowns: int
    """Number of unknown strains."""

    @property
    def force(self) -> int:
        """Force on the tip, world axes [N] (3)."""
        return self.motors

    @property
    def gravity(self) -> int:
        """Gravity, world axes [m/s^2] (3)."""
        return self.force + 3

    @property
    def pull(self) -> int:
        """Constant load on each unknown, of muscles with a given tension [N m or N]."""
        return self.gravity + 3

    @property
    def start(self) -> int:
        """Where to start from, if muscle lengths hold sums of the unknowns [rad or m]; others start at rest."""
        return self.pull + self.unknowns

    @property
    def unknown(self) -> int:
        """The unknown strains [rad or m]."""
        return self.start + self.unknowns

    @property
    def step(self) -> int:
        """The Newton step of each."""
        return self.unknown + self.unknowns

    @property
    def kept(self) -> int:
        """Where a line search started, of each."""
        return self.step + self.unknowns

    @property
    def way(self) -> int:
        """The direction of a line search, of each."""
        return self.kept + self.unknowns

    @property
    def tip(self) -> int:
        """The tip in the world [m] (3)."""
        return self.way + self.unknowns

    @property
    def torques(self) -> int:
        """Measured load on each motor [N m or N]."""
        return self.tip + 3

    @property
    def target(self) -> int:
        """Target of the tip [m] (3)."""
        return self.torques + self.motors

    @property
    def following(self) -> int:
        """The target after it (3)."""
        return self.target + 3

    @property
    def ahead(self) -> int:
        """Where a step leads: motors or force, then unknowns."""
        return self.following + 3

    @property
    def before(self) -> int:
        """Where a search was before its step: motors or force, then unknowns."""
        return self.ahead + max(self.motors, 3) + self.unknowns

    @property
    def foreseen(self) -> int:
        """Where the last step along a path led: motors, then unknowns."""
        return self.before + max(self.motors, 3) + self.unknowns

    @property
    def correction(self) -> int:
        """How far that was from the waypoint's solution: motors, then unknowns."""
        return self.foreseen + max(self.motors, 3) + self.unknowns

    def single(self, name: str) -> int:
        """One of `SINGLES`."""
        return self.correction + max(self.motors, 3) + self.unknowns + SINGLES.index(name)

    @property
    def prepared(self) -> int:
        """What depends on motors and load only; as many places as the code needs."""
        return self.single(SINGLES[0]) + len(SINGLES)

    def constants(self) -> dict[str, int]:
        """Names of the places for generated code."""
        made = {
            "MOTORS": 0,
            "FORCE": self.force,
            "GRAVITY": self.gravity,
            "PULL": self.pull,
            "START": self.start,
            "UNKNOWN": self.unknown,
            "STEP": self.step,
            "KEPT": self.kept,
            "WAY": self.way,
            "TIP": self.tip,
            "TORQUES": self.torques,
            "TARGET": self.target,
            "FOLLOWING": self.following,
            "AHEAD": self.ahead,
            "BEFORE": self.before,
            "FORESEEN": self.foreseen,
            "CORRECTION": self.correction,
        }
        made |= {name.upper(): self.single(name) for name in SINGLES}
        return made | {"N_MOTORS": self.motors, "N": self.unknowns}
