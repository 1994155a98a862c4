"""One contact of an equilibrium: where robot and obstacle touch, and the force between them."""

from __future__ import annotations

from dataclasses import dataclass

from softrobots.core.checks import FloatArray, read_only

PRESSED = "pressed"
"""Without friction, and a force."""

TOUCHING = "touching"
"""The surfaces touch, and there is no force."""

STICKS = "sticks"
"""The force is within the cone of friction: the point stays where it is."""

SLIPS = "slips"
"""The force is on the cone of friction, against the slip."""


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact between a link of the robot and an obstacle (or another link); vectors in world axes."""

    link: str
    """Link of the robot that touches."""
    obstacle: str
    """Name of the obstacle; of the other link, where the robot touches itself."""
    point: FloatArray
    """Point on the robot's surface, shape (3,) [m]."""
    obstacle_point: FloatArray
    """Point on the obstacle's surface, shape (3,) [m]."""
    normal: FloatArray
    """Unit normal from the obstacle to the robot, shape (3,)."""
    normal_force: float
    """Force along the normal, zero or more [N]."""
    force: FloatArray
    """Force that the obstacle applies to the robot, shape (3,) [N]."""
    gap: float
    """Distance of the surfaces, negative where they penetrate [m]."""
    strict: bool
    """Whether it is pressed with a force clear of rounding; the certificate of stability counts such contacts as held."""
    status: str
    """`PRESSED` or `TOUCHING` without friction, `STICKS` or `SLIPS` with it."""
    slip: FloatArray
    """Slip of the robot's point over the obstacle in this step, shape (3,) [m]; zero without friction."""

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (self.point, self.obstacle_point, self.normal, self.force, self.slip):
            read_only(array)
