"""Single equilibria of compiled code are certified, or an error."""

from __future__ import annotations

from softrobots.compiled.run.results import CompiledEquilibrium
from softrobots.compiled.statuses import Status
from softrobots.core.errors import EquilibriumNotFound


def certified(equilibrium: CompiledEquilibrium) -> CompiledEquilibrium:
    """Return an equilibrium that is stable or neutral.

    Raises:
        EquilibriumNotFound: If its status says that it is not; carries it.
    """
    status = equilibrium.status
    if status in (Status.CERTIFIED, Status.NEUTRAL):
        return equilibrium
    raise EquilibriumNotFound(
        f"no certified equilibrium at motors {equilibrium.q_motors.tolist()} under {equilibrium.force.tolist()} N: "
        f"{status.explanation}; {equilibrium.residual:.3g} N m are out of balance",
        best=equilibrium,
        residual=equilibrium.residual,
        iterations=equilibrium.iterations,
    )
