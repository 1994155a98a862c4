"""Generated module of a robot: constants, straight-line functions and drivers as one text in the kernel language."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from softrobots.compiled import settings
from softrobots.compiled.chain.layout import Layout, TipLayout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.drivers import equilibrium_drivers as drivers
from softrobots.compiled.drivers import (
    guide_drivers,
    lane_drivers,
    motor_drivers,
    muscle_drivers,
    path_drivers,
    response_drivers,
    trigonometry,
)
from softrobots.compiled.program.looped_program import looped_program, looped_response
from softrobots.compiled.program.manual import manual, on_a_line
from softrobots.compiled.program.motor_program import force_blocks, target_blocks
from softrobots.compiled.program.response_program import ResponsePlaces, response_blocks, response_functions
from softrobots.compiled.program.unrolled_program import equilibrium_blocks
from softrobots.compiled.statuses import Status
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.numbers import NumberInputs, TableInputs


@dataclass(frozen=True)
class Program:
    """A generated module."""

    text: str
    """Its text."""
    lane_text: str
    """Text that is appended to it for batches."""
    layout: Any
    """Places in the workspace: `Layout`, or `MotionLayout`."""
    size: int
    """Size of the workspace of one case."""
    tip: TipLayout | None
    """Places of the response of the tip; None for unrolled chains, which have searches of their own."""
    entry_points: tuple[str, ...]
    """Functions that solve a case, and constants that their callers need."""
    responses: ResponsePlaces | None = None
    """Places of rates and weights of derivatives; None in code without them."""


def make_program(
    unknowns: Unknowns, *, weight: bool, poses: bool = False, inputs: NumberInputs | TableInputs | None = None
) -> Program:
    """Generate the code of a robot.

    Args:
        unknowns: The robot.
        weight: Whether there is gravity.
        poses: Whether targets of the tip are poses.
        inputs: Numbers of the robot that are inputs, in unrolled chains of code with derivatives.
    """
    plan = Plan(unknowns, weight, poses, inputs=inputs)
    layout = plan.layout
    functions, lane_functions = functions_of(drivers), functions_of(lane_drivers)
    tables: dict[str, object] = {}
    loops, lane_loops, entries, names = [], [], ["settle", "settle_from"], ["WORKSPACE_SIZE", "N", "N_MOTORS"]
    tip = None
    if len(unknowns.chain.muscle_paths.rest):
        tables |= _muscle_tables(unknowns, layout)
        functions += functions_of(muscle_drivers)
        entries, names = [*entries, "put_muscles"], [*names, "N_MUSCLES"]
    if unknowns.is_unrolled:
        blocks, size = equilibrium_blocks(plan)
        lanes, lane_size = blocks[1:3], size
    else:
        parts = looped_program(plan)
        blocks, size, lanes, lane_size = parts.blocks + parts.tip_blocks, parts.size, parts.blocks, parts.lane_size
        tables |= parts.constants
        tip, entries = parts.tip, [*entries, "look_at_tip"]
        loops, lane_loops = [parts.loops()], [parts.loops("_lanes")]
    if layout.guides:  # cases are solved one by one
        own = functions_of(guide_drivers)
        names_of_own = [one.__name__ for one in own]
        functions = [one for one in functions if one.__name__ not in names_of_own] + own[:-1]
        lanes, lane_loops = [], []
        lane_functions = [lane_drivers.load_case, lane_drivers.store_case, guide_drivers.settle_batch]
    if unknowns.moved_by_motors:
        by_force, size = force_blocks(plan, size)
        by_target = target_blocks(plan)
        lane_size, entries = size, [*entries, "estimate", "reach", "follow"]
        blocks = blocks + by_force + by_target
        lanes = [*lanes, by_force[1], by_force[2], by_target[1]]
        functions += functions_of(motor_drivers) + functions_of(path_drivers)
    elif not layout.guides:
        lane_functions = [one for one in lane_functions if one not in lane_drivers.MOTOR_FUNCTIONS]
    responses = None
    if isinstance(inputs, NumberInputs):
        responses = ResponsePlaces(size, layout.motors, layout.unknowns, inputs.count)
        lane_size = size = responses.end
        tables |= {"NUMBER_WEIGHTS": responses.number}
        blocks_of_responses = response_blocks(plan, responses)
        blocks, lanes = blocks + blocks_of_responses, lanes + blocks_of_responses
        lane_loops += response_functions(blocks_of_responses)
    docstring, places = manual(plan, tip)
    names += [*places, *Status.__members__]
    text = module_text(docstring, _constants(unknowns, layout, size, lane_size, tables), blocks, loops, functions)
    lane_part = lane_text(lanes, lane_loops, lane_functions)
    return Program(text, lane_part, layout, size, tip, (*entries, *names), responses)


def make_given_program(unknowns: Unknowns, *, weight: bool, inputs: TableInputs | None = None) -> Program:
    """Generate the response of a looped chain to given loads and motions; see `softrobots.compiled.chain.looped_response`.

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
    functions = [lane_drivers.load_block, lane_drivers.store_block, *functions_of(response_drivers)]
    return Program(text, lane_text(parts.blocks, [parts.loops("_lanes")], functions), plan.layout, parts.size, parts.tip, ())


def module_text(
    docstring: str,
    values: Mapping[str, object],
    blocks: Sequence[Block],
    loops: Sequence[str],
    functions: Sequence[Callable[..., Any]],
) -> str:
    """Return the text of a module: docstring, constants, straight-line functions, loops over elements, drivers."""
    docstring = docstring.replace("\\", "\\\\").replace('"""', r"\"\"\"")  # a name could end the text
    head = "\n".join(f"{name} = {value!r}" for name, value in values.items())
    straight = [*map(text_of, functions_of(trigonometry)), *(block.text() for block in blocks)]
    return "\n\n\n".join([f'"""{docstring}\n"""\n\n{head}', *straight, *loops, *map(text_of, functions)]) + "\n"


def lane_text(blocks: Sequence[Block], loops: Sequence[str], functions: Sequence[Callable[..., Any]]) -> str:
    """Return the text that is appended for batches: straight-line functions of lanes, loops over elements, drivers."""
    straight = [replace(block, name=f"{block.name}_lanes").text(lanes=True) for block in blocks]
    return "\n\n\n".join([*straight, *loops, *map(text_of, functions)]) + "\n"


def lane_count(size: int) -> int:
    """Return the number of cases side by side, such that their workspaces fit in the cache of a core."""
    count = settings.MAX_LANES
    while count > settings.MIN_LANES and count * size * 8 > settings.LANE_MEMORY:
        count //= 2
    return count


def _constants(unknowns: Unknowns, layout: Layout, size: int, lane_size: int, tables: dict[str, object]) -> dict[str, object]:
    chain, strains = unknowns.chain, unknowns.strains
    min_pivot = min((float(chain.stiffness[strain]) for strain in strains), default=1.0)
    group = {strain: row for row, one in enumerate(chain.constrained) for strain in one}
    numbers = {name: value for name, value in vars(settings).items() if name.isupper()}
    values: dict[str, object] = numbers | layout.constants()
    values |= {
        "WORKSPACE_SIZE": size,
        "LANE_SIZE": lane_size,
        "LANES": lane_count(lane_size),
        "N_CONSTRAINTS": unknowns.n_constraints,
        "N_STARTS": layout.unknowns if unknowns.n_constraints or layout.inputs else 0,
        "N_SLIDERS": layout.rubbing,
        "N_GUIDES": layout.guides,
        "N_INPUTS": unknowns.n_tensions,
        "LEAST_INPUT": unknowns.least_inputs,
        **{status.name: status.value for status in Status},
        "REACH": float(chain.reach),
        "N_VARIED": layout.varied,
        "TARGET_SIZE": layout.target_size,
        "N_ERRORS": layout.conditions // 3,
        "LOWER": tuple(np.maximum(chain.limits[: layout.motors, 0], -1e300).tolist()),
        "UPPER": tuple(np.minimum(chain.limits[: layout.motors, 1], 1e300).tolist()),
        "SPRING_ROUNDING": unknowns.spring_rounding,
        "REST": unknowns.rest,
        "SOFTNESS": tuple((min_pivot / float(chain.stiffness[strain])) ** 0.5 for strain in strains),
        "GROUP": tuple(group.get(strain, -1) for strain in strains),
    }
    # Tables are not empty, even without motor joints or springs.
    return {name: (0.0,) if value == () else value for name, value in (values | tables).items()}


def _muscle_tables(unknowns: Unknowns, layout: Layout) -> dict[str, object]:
    """Return the tables of `muscle_drivers`: lengths set the start of the unknowns, tensions stay as they are."""
    chain, strains, rest = unknowns.chain, list(unknowns.strains), unknowns.chain.muscle_paths.rest
    slope, base = chain.spread[strains], (chain.free @ chain.elastic @ chain.rest)[strains]
    if unknowns.held_lengths:  # both follow one another
        slope, base = np.concatenate([np.eye(len(rest)), slope]), np.concatenate([rest, base])
    elif layout.muscles:
        slope, base, rest = np.eye(len(rest)), np.zeros(len(rest)), np.zeros(len(rest))
    return {
        "N_MUSCLES": len(rest),
        "N_MUSCLE_ROWS": len(base),
        "MUSCLE_PLACE": layout.actuators if layout.muscles else layout.start,
        "MUSCLE_REST": tuple(rest.tolist()),
        "MUSCLE_BASE": tuple(base.tolist()),
        "MUSCLE_SLOPE": tuple((slope + 0.0).ravel().tolist()),
    }


def functions_of(module: ModuleType) -> list[Callable[..., Any]]:
    """Return the functions that a module of drivers defines, in the order of its text: each behind those that it uses."""
    return [one for one in vars(module).values() if inspect.isfunction(one) and one.__module__ == module.__name__]


@cache
def text_of(function: Callable[..., Any]) -> str:
    """Return the text of a function of the drivers."""
    return inspect.getsource(function).rstrip()
