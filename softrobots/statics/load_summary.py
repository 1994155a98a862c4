"""Summary of an estimated force: the equilibrium, the force with its errors, and what the motors do not feel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.summary import Part, facts, force_text, formatted
from softrobots.model.actuators import joined_units, load_units


def load_parts(estimate: Any) -> list[Part]:
    """Return the parts of the summary of a `LoadEstimate`."""
    rows = [(f"force on {estimate.frame}", force_text(estimate.force))]
    if estimate.force_std is not None:
        rows.append(("  standard deviation", f"{formatted(estimate.force_std)} N"))
    if len(estimate.covariance_parts) > 1:
        for name, part in estimate.covariance_parts.items():
            rows.append((f"    by {name.replace('_', ' ')}", f"{formatted(np.sqrt(np.diag(part)))} N"))
    if estimate.friction_range is not None:
        low, high = estimate.friction_range.T
        rows.append(("  friction unknown", f"{formatted(low)} to {formatted(high)} N"))
    rows += [("  explained as well by", f"{formatted(other.force)} N") for other in estimate.alternatives]
    motors = estimate.equilibrium.model.actuators.units
    felt = f"{formatted(estimate.singular_values)} {unit_per_newton(motors)}"
    rows.append(("singular values", f"{felt} (condition number {estimate.condition_number:.3g})"))
    directions = [("NOT FELT along", formatted(direction)) for direction in estimate.unobservable_directions]
    rows += directions or [("not felt along", "no direction")]
    left = f"{estimate.residual:.2g} {joined_units(load_units(motors))}"
    rows.append(("torques unexplained", f"{left}, {estimate.iterations} iterations by {estimate.method}"))
    return [*estimate.equilibrium.summary_parts(), facts(rows)]


def unit_per_newton(motors: Sequence[str]) -> str:
    """Return the unit of what actuators of these units feel of a force, over the force."""
    return joined_units([{"N m": "m", "N": "-"}[unit] for unit in load_units(motors)])
