"""The numbers of looped chains that may be inputs of their code, as the tables in which they stand."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.constrained_segments import sum_numbers
from softrobots.compiled.chain.looped_elements import kind_element, leading_elements, rows_of_kinds
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.looped_frame import tip_from_end
from softrobots.compiled.routes.ends import held_numbers, muscle_numbers
from softrobots.compiled.routes.terms import form_point, route_forms
from softrobots.compiled.trace.blocks import Block
from softrobots.core.checks import FloatArray


class ChainNumbers(NamedTuple):
    """The numbers of a chain."""

    structure: tuple[Any, ...]
    """What chains share that the same code serves, with the numbers of each as inputs."""
    tables: dict[str, FloatArray]
    """The numbers by table, shape (rows, numbers)."""


def chain_numbers(unknowns: Unknowns) -> ChainNumbers:
    """Return the numbers of a looped chain, without tracing its code."""
    plan, block = Plan(unknowns, weight=True), Block("numbers", "")
    unknowns, chain = plan.unknowns, plan.unknowns.chain
    kinds, forms = rows_of_kinds(unknowns), route_forms(plan)
    leading_elements(plan, block)
    tip_from_end(plan, block)
    for number, rows in enumerate(kinds.values()):
        kind_element(plan, number, rows, block)
    for name, form in forms.items():
        form_point(plan, name, form, block)
    for number, segment in enumerate(unknowns.segments):
        if unknowns.held_lengths:
            held_numbers(plan, block, number, segment)
        elif unknowns.routed:
            for muscle in segment.muscles:
                muscle_numbers(plan, block, muscle)
        elif segment.groups:
            sum_numbers(plan, block, number, segment)
    tables = {name: np.array(table.seen).T for name, table in plan.tables.items() if table.seen}
    laws = [one.kind for one in chain.actuators]
    routes = plan.routes.tables() if plan.routes.beside else {}
    shapes = {name: table.shape for name, table in tables.items()}
    return ChainNumbers((kinds, forms, chain.constrained, chain.muscle_input, laws, routes, shapes), tables)
