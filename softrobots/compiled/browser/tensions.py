"""Where the tensions of the muscles stand in the workspace, for `solver.js`."""

from __future__ import annotations

from typing import Any

from softrobots.compiled.chain.plan import Plan


def tension_places(plan: Plan) -> dict[str, Any]:
    """Return the place of the first tension, or with `sums` that of the first multiplier.

    Multipliers of constrained sums are loads beyond those of the start (`softrobots.compiled.chain.looped_chain`), which `sums`
    gives: place of an unknown in the sum, its rest and its stiffness. A tension is the sum of the loads times its `shares`.
    """
    unknowns, layout = plan.unknowns, plan.layout
    chain = unknowns.chain
    if unknowns.held_lengths:
        return {"place": layout.held, "sums": None}
    if not unknowns.n_constraints:
        return {"place": plan.routes.pulled if plan.routes.beside else layout.actuators, "sums": None}
    first = [group[0] for group in chain.constrained]
    sums = [
        {"unknown": unknowns.place[one], "rest": float(chain.rest[one]), "stiffness": float(chain.stiffness[one])}
        for one in first
    ]
    return {"place": layout.held, "sums": sums, "shares": chain.constrained_slope.T.tolist()}
