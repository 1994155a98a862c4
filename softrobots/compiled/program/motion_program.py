"""Generated module of the motion of a robot: constants, straight-line functions and drivers as one text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from softrobots.compiled import motion_settings, settings
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.drivers import motion_drivers, motion_lane_drivers, rubbing_motion_drivers
from softrobots.compiled.drivers.lane_drivers import load_block, load_case, store_case
from softrobots.compiled.motion.held_motion import in_motion
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.time_step import step_blocks
from softrobots.compiled.program.generated_module import Program, functions_of, lane_count, lane_text, module_text
from softrobots.compiled.program.looped_motion_program import looped_motion
from softrobots.compiled.program.manual import Place, inputs_of, motor_names, on_a_line, place_table, strain_names
from softrobots.compiled.program.motion_parts import unrolled_motion
from softrobots.compiled.statuses import Status

_STATUSES = {
    Status.CERTIFIED: "the step was taken",
    Status.UNSETTLED: "the step does not converge, even in small parts",
}


def make_motion_program(unknowns: Unknowns, *, full_damping: bool = False, order: int = 2) -> Program:
    """Generate the code of the motion of a robot; `full_damping`: whether the damping is a matrix; `order`: of the steps."""
    plan = MotionPlan(in_motion(unknowns), full_damping, order, unknowns.chain.guides)
    layout = plan.layout
    parts = unrolled_motion(plan) if plan.unknowns.is_unrolled else looped_motion(plan)
    blocks = [*parts.blocks, *step_blocks(layout)]
    docstring, places = _manual(plan)
    values: dict[str, object] = {name: value for name, value in vars(motion_settings).items() if name.isupper()}
    values |= layout.constants()
    if layout.coasting:
        values["STIFFNESS"] = tuple(plan.unknowns.chain.stiffness[list(plan.unknowns.strains)].tolist())
    values |= {"WORKSPACE_SIZE": parts.size, "LANE_SIZE": parts.size, "LANES": lane_count(parts.size)}
    values["ALONE"] = int(plan.couples and 8 * parts.size * settings.MIN_LANES > motion_settings.LANE_CACHE)
    values |= {status.name: status.value for status in _STATUSES} | parts.constants
    functions = functions_of(motion_drivers)
    lane_functions: list[Callable[..., Any]] = [load_block, load_case, *functions_of(motion_lane_drivers)]
    lanes, lane_loops = blocks, parts.lane_loops
    if layout.rubbing:  # cases are done one by one
        *own, batch = functions_of(rubbing_motion_drivers)
        names = [one.__name__ for one in own]
        functions = own + [one for one in functions if one.__name__ not in names]
        lanes, lane_loops, lane_functions = [], [], [load_case, store_case, motion_lane_drivers.move_alone, batch]
    text = module_text(docstring, values, blocks, parts.loops, functions)
    batches = lane_text(lanes, lane_loops, lane_functions)
    entries = ("motion_step", "motion_run", "place_at", "WORKSPACE_SIZE", "N", "N_MOTORS", *places)
    entries = (*entries, *(status.name for status in _STATUSES))
    return Program(text, batches, layout, parts.size, None, entries)


def _manual(plan: MotionPlan) -> tuple[str, list[str]]:
    """Return the docstring, and the names of all places in it."""
    unknowns, layout = plan.unknowns, plan.layout
    n, m = layout.unknowns, layout.motors
    muscles, looped = inputs_of(unknowns), layout.strains is not None
    names = f"motor joints [rad or m]: {motor_names(unknowns)}{f', then {muscles}' if muscles else ''}"
    coordinates = "the free coordinates" if unknowns.held_lengths else strain_names(unknowns)
    damping = "damping of each strain" if looped else "damping of each unknown"
    damping = "damping matrix, row by row" if layout.full_damping and not looped else damping
    given = [Place("TIME_STEP", 1, "length of the step [s]")]
    if m:
        given.append(Place("MOTORS_BEGIN", m, f"at the beginning of the step, {names}"))
        given.append(Place("MOTORS_MIDDLE", m, "the same in the middle of the step"))
        given.append(Place("MOTORS_END", m, "the same at the end of the step"))
    given.append(Place("FORCE", 3, "force on the tip in the middle of the step [N], world axes"))
    given.append(Place("GRAVITY", 3, "gravity [m/s^2], world axes"))
    given.append(Place("DAMPING", layout.mass_damping - layout.damping, f"{damping} [N m s/rad or N s/m]"))
    if looped and layout.full_damping:
        given.append(Place("MASS_DAMPING", n * n, "Rayleigh's factor times the mass matrix of the unknowns, row by row"))
        given.append(Place("MASS_RATE", 1, "Rayleigh's factor [1/s]"))
    given.append(Place("POSITION", n, f"unknowns at the beginning [rad or m]: {coordinates}"))
    given.append(Place("VELOCITY", n, "their velocities [rad/s or m/s]"))
    if layout.guides:
        given.append(Place("ANCHORS", layout.guides, "length beyond each guide at its slider, from rest, after a step [m]"))
    if layout.rubbing:
        count, carried = layout.strains or 0, "; the next step begins there"
        given.append(Place("SLIDERS", count, "bending that friction holds, as a step leaves it, of every strain [rad]"))
        given.append(
            Place("STRAIN_BEGIN", count, f"strains at the beginning, at its end those there{carried}: {strain_names(unknowns)}")
        )
        given.append(Place("RATE_BEGIN", count, f"their rates, likewise{carried}"))
    found = [
        Place("POSITION", n, "unknowns at the end [rad or m]"),
        Place("VELOCITY", n, "their velocities [rad/s or m/s]"),
        Place("ACCELERATION", n, "their accelerations in the middle [rad/s^2 or m/s^2]"),
        Place("UNKNOWN", n, "unknowns [rad or m]; of place_at"),
        Place("RATE", n, "their velocities [rad/s or m/s]; of place_at"),
        Place("TIP", 3, "the tip [m], world axes; of place_at"),
    ]
    lines = [
        f"Motion of {on_a_line(unknowns.chain.name)}: generated code.",
        "",
        "Functions work on an array of WORKSPACE_SIZE numbers, initially zero, one array for each robot.",
        "It holds the state, and accelerations of the steps before, from which the next one is guessed.",
        "motion_step and motion_run return a status; the results are valid only if it is 0:",
        "",
        *(f"    {status.value}  {status.name:<14} {meaning}" for status, meaning in _STATUSES.items()),
        *place_table(given, found, layout.constants()),
    ]
    return "\n".join(lines), list(dict.fromkeys(row.name for row in (*given, *found)))
