"""What a robot has at its contacts in a step with Coulomb friction: gaps, sliding, forces, and what each contact does."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from softrobots.core.checks import FloatArray


class NearContacts(NamedTuple):
    """Contacts that may press, at given elastic coordinates; `m` of them."""

    gaps: FloatArray
    """Gaps, shape (m,) [m]."""
    gradients: FloatArray
    """Derivative of the gaps, shape (m, n) [m/rad]."""
    sliding: FloatArray
    """Sliding since the last state along two unit vectors of each tangent plane, shape (m, 2) [m]."""
    jacobian: FloatArray
    """Motion of the touching points along them, shape (m, 2, n) [m/rad]."""


class Balance(NamedTuple):
    """Elastic coordinates and forces of contacts of a step, in equilibrium or not."""

    q_springs: FloatArray
    """Elastic coordinates, shape (n,) [rad or m]."""
    contacts: NearContacts
    """The contacts there."""
    normal: FloatArray
    """Normal forces, shape (m,) [N]."""
    friction: FloatArray
    """Friction along the vectors of `NearContacts.sliding`, shape (m, 2) [N]."""
    residual: FloatArray
    """Torque out of balance, shape (n,) [N m or N]."""
    tangent: FloatArray
    """Derivative of the residual at the forces given, shape (n, n)."""
    allowed: float
    """Residual that counts as none [N m]."""
    laws: Laws
    """What each contact does."""


class Laws(NamedTuple):
    """What each contact does at an iterate, in units in which springs and contacts have stiffness 1."""

    pressed: Any
    """Which contacts press, shape (m,), bool."""
    sticks: Any
    """Which of them stick, shape (m,), bool."""
    slips: Any
    """Which of them slip, shape (m,), bool."""
    way: FloatArray
    """Direction of the friction that was tried, shape (m, 2)."""
    held: FloatArray
    """Largest friction over the one tried, shape (m,)."""
    broken: FloatArray
    """Friction less that of its law, shape (m, 2) [N]."""
    root: FloatArray
    """Square root of the scale of stiffness of each spring, shape (n,)."""
    unit_normal: FloatArray
    """Unit of normal forces, shape (m,)."""
    unit_friction: FloatArray
    """Unit of friction, shape (m,)."""
    merit: float
    """Norm of all equations in these units."""


class Step(Protocol):
    """A robot in a step of a path."""

    stiffness: FloatArray
    """Stiffness of the springs, a scale, shape (n,) [N m/rad or N/m]."""
    reach: float
    """Length of the robot, a scale [m]."""

    def contacts(self, q_springs: FloatArray) -> NearContacts | None:
        """Return the near contacts; None out of the range of a section."""

    def first_turn(self, q_springs: FloatArray, change: FloatArray) -> float:
        """Return the share of a change of the coordinates up to which no dry friction of the robot's own turns round."""

    def mark(self) -> Any:
        """Return a mark of the place asked last."""

    def return_to(self, mark: Any) -> None:
        """Return to the place of a mark, as if it had been asked last."""

    def carried(self, normal: FloatArray, friction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the forces that these contacts had at the place asked before, shapes (m,) and (m, 2) [N]."""

    def residual(self, normal: FloatArray, friction: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return torque out of balance, its derivative and the torque that counts as none at the last place asked."""
