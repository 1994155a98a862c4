"""Generated module of the response of a looped chain to given loads and motions, for derivatives of batches."""

from __future__ import annotations

from softrobots.compiled import settings
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.drivers import response_drivers
from softrobots.compiled.drivers.lane_drivers import load_block, store_block
from softrobots.compiled.program.generated_module import Program, functions_of, lane_count, lane_text, module_text
from softrobots.compiled.program.looped_program import looped_response
from softrobots.compiled.program.manual import on_a_line
from softrobots.compiled.trace.numbers import TableInputs


def make_given_program(unknowns: Unknowns, *, weight: bool, inputs: TableInputs | None = None) -> Program:
    """Generate the code; see `softrobots.compiled.chain.looped_response`.

    Args:
        unknowns: The robot, whose chain is looped.
        weight: Whether there is gravity.
        inputs: Numbers of the robot that are inputs.
    """
    plan = Plan(unknowns, weight, inputs=inputs)
    parts = looped_response(plan)
    values: dict[str, object] = {name: value for name, value in vars(settings).items() if name.isupper()}
    values |= plan.layout.constants() | parts.constants
    values |= {"N_CONSTRAINTS": unknowns.n_constraints, "WORKSPACE_SIZE": parts.size, "LANE_SIZE": parts.size}
    values |= {"LANES": lane_count(parts.size), "NUMBER_WEIGHTS": 0}
    purpose = f"Response of {on_a_line(unknowns.chain.name)} to given loads and motions: generated code."
    text = module_text(purpose, values, parts.blocks, [parts.loops()], [])
    batches = lane_text(parts.blocks, [parts.loops("_lanes")], [load_block, store_block, *functions_of(response_drivers)])
    return Program(text, batches, plan.layout, parts.size, parts.tip, ())
