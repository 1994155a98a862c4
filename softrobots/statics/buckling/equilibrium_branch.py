"""A branch: equilibria of a robot under a force that grows or falls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.summary import Part, Summarised, Table, formatted
from softrobots.model.springs import POSITIVE
from softrobots.statics.elastic_state import scaled
from softrobots.statics.equilibrium import Equilibrium

FUNDAMENTAL = "fundamental"
"""Label of the path from zero force."""

RING = "ring"
"""Label of a branch out of a ring; the others are the same robot, bent in another direction."""


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBranch(Summarised):
    """A sequence of equilibria under a force that grows or falls."""

    label: str
    """`FUNDAMENTAL`; `RING`; or the springs that move most at its start, with their sign, e.g. "+spring_1_up".

    A branch that leaves another has its label in front, "+spring_1_up > -spring_1_side"; namesakes are numbered.
    """
    equilibria: tuple[Equilibrium, ...]
    """Equilibria from zero force, or from the critical point, on."""
    forces: FloatArray
    """Force along the direction at each of them, shape (n,) [N]."""
    amplitude: FloatArray
    """Distance of the springs from the critical point along the buckling modes, shape (n,) [rad or m]; 0 without a mode."""
    energy: FloatArray
    """Elastic energy and potential of the load, shape (n,) [J]."""
    crossings: FloatArray
    """Forces at which it crosses another path, or its stability jumps at a plateau, shape (k,) [N]."""
    ended: str
    """Why it ends: "largest force", "zero force", "end of range" of a section, "points" (too many), or "lost"."""

    def __post_init__(self) -> None:
        for array in (self.forces, self.amplitude, self.energy, self.crossings):
            read_only(array)

    @cached_property
    def softest(self) -> FloatArray:
        """Least real part of the eigenvalues of the tangent stiffness, relative to the springs, shape (n,)."""
        tangents = [scaled(one.tangent_stiffness, one.model.stiffness) for one in self.equilibria]
        with one_blas_thread(len(tangents[0])):
            return read_only(np.array([float(np.linalg.eigvalsh(tangent)[0]) for tangent in tangents]))

    @cached_property
    def stable(self) -> Any:
        """Which are certified stable, shape (n,), truth values."""
        return np.array([equilibrium.stable for equilibrium in self.equilibria])

    @cached_property
    def neutral(self) -> Any:
        """Which are neutral, shape (n,), truth values: all of a ring, and the critical point itself."""
        return np.abs(self.softest) <= POSITIVE

    def summary_parts(self) -> list[Part]:
        """Return its forces, stability and end, and where it is crossed."""
        return branch_parts([self])


def branch_parts(found: Sequence[EquilibriumBranch]) -> list[Part]:
    """Return a table of branches, and where they are crossed."""
    head = ("branch", "starts at [N]", "forces [N]", "stable points", "tip at the end [m]", "ends at")
    rows = [
        (
            branch.label,
            formatted(branch.forces[0]),
            f"{branch.forces.min():.6g} to {branch.forces.max():.6g}",
            "neutral" if branch.neutral.all() else f"{np.count_nonzero(branch.stable)} of {len(branch.stable)}",
            formatted(branch.equilibria[-1].tip_position.round(6)),
            branch.ended,
        )
        for branch in found
    ]
    crossed = [f"{branch.label} is crossed at {formatted(branch.crossings)} N" for branch in found if branch.crossings.size]
    return [Table([head, *rows]), "\n".join(crossed)]
