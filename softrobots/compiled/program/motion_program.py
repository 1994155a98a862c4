"""Generated module of the motion of a robot: constants, straight-line functions and drivers as one text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from softrobots.compiled import motion_settings
from softrobots.compiled.chain.motion_layout import MotionPlan
from softrobots.compiled.chain.time_step import step_blocks
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.drivers import motion_drivers, motion_lane_drivers, trigonometry
from softrobots.compiled.drivers.lane_drivers import load_block, load_case
from softrobots.compiled.program.generated_module import Program, functions_of, lane_count, text_of
from softrobots.compiled.program.looped_motion_program import looped_motion
from softrobots.compiled.program.manual import Place, motor_names, on_a_line, place_table, strain_names
from softrobots.compiled.program.motion_parts import unrolled_motion
from softrobots.compiled.statuses import Status
from softrobots.core.errors import ParameterError

_STATUSES = (Status.CERTIFIED, Status.UNSETTLED)


def check_motion(unknowns: Unknowns, *, full_damping: bool = False) -> None:
    """Refuse robots whose motion is not compiled.

    Raises:
        ParameterError: If muscle lengths are given, or the damping of a long chain is a matrix.
    """
    if unknowns.chain.constrained or (full_damping and not unknowns.is_unrolled):
        what = "given muscle lengths" if unknowns.chain.constrained else "a damping matrix (mass_damping)"
        raise ParameterError("model", unknowns.chain.name, f"a robot without {what}, to have its motion compiled")


def make_motion_program(unknowns: Unknowns, *, full_damping: bool = False) -> Program:
    """Generate the code of the motion of a robot; `full_damping`: whether the damping is a matrix.

    Raises:
        ParameterError: If muscle lengths are given, or the damping of a long chain is a matrix.
    """
    check_motion(unknowns, full_damping=full_damping)
    plan = MotionPlan(unknowns, full_damping)
    layout = plan.layout
    parts = unrolled_motion(plan) if unknowns.is_unrolled else looped_motion(plan)
    blocks = [*parts.blocks, *step_blocks(layout)]
    docstring, places = _manual(plan)
    docstring = docstring.replace("\\", "\\\\").replace('"""', r"\"\"\"")  # a name could end the text
    values: dict[str, object] = {name: value for name, value in vars(motion_settings).items() if name.isupper()}
    values |= layout.constants()
    values |= {"WORKSPACE_SIZE": parts.size, "LANE_SIZE": parts.size, "LANES": lane_count(parts.size)}
    values |= {status.name: status.value for status in _STATUSES} | parts.constants
    head = "\n".join(f"{name} = {value!r}" for name, value in values.items())
    pieces = [
        f'"""{docstring}\n"""\n\n{head}',
        *map(text_of, functions_of(trigonometry)),
        *(block.text() for block in blocks),
        *([parts.loops] if parts.loops else []),
        *map(text_of, functions_of(motion_drivers)),
    ]
    lane_functions: list[Callable[..., Any]] = [load_block, load_case, *functions_of(motion_lane_drivers)]
    lane_pieces = [
        *(replace(block, name=f"{block.name}_lanes").text(lanes=True) for block in blocks),
        *([parts.lane_loops] if parts.lane_loops else []),
        *map(text_of, lane_functions),
    ]
    entries = ("motion_step", "motion_run", "place_at", "WORKSPACE_SIZE", "N", "N_MOTORS", *places)
    entries = (*entries, *(status.name for status in _STATUSES))
    text, lane_text = "\n\n\n".join(pieces) + "\n", "\n\n\n".join(lane_pieces) + "\n"
    return Program(text, lane_text, layout, parts.size, None, entries)


def _manual(plan: MotionPlan) -> tuple[str, list[str]]:
    """Return the docstring, and the names of all places in it."""
    unknowns, layout = plan.unknowns, plan.layout
    n, m = layout.unknowns, layout.motors
    muscles = f", and {unknowns.n_tensions} muscle tensions [N]" if unknowns.n_tensions else ""
    names = f"motor joints [rad or m]: {motor_names(unknowns)}{muscles}"
    damping = "damping matrix, row by row" if layout.full_damping else "damping of each unknown"
    given = [Place("TIME_STEP", 1, "length of the step [s]")]
    if m:
        given.append(Place("MOTORS_BEGIN", m, f"at the beginning of the step, {names}"))
        given.append(Place("MOTORS_MIDDLE", m, "the same in the middle of the step"))
        given.append(Place("MOTORS_END", m, "the same at the end of the step"))
    given.append(Place("FORCE", 3, "force on the tip in the middle of the step [N], world axes"))
    given.append(Place("GRAVITY", 3, "gravity [m/s^2], world axes"))
    given.append(Place("DAMPING", n * n if layout.full_damping else n, f"{damping} [N m s/rad or N s/m]"))
    given.append(Place("POSITION", n, f"unknowns at the beginning [rad or m]: {strain_names(unknowns)}"))
    given.append(Place("VELOCITY", n, "their velocities [rad/s or m/s]"))
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
        "    0  CERTIFIED      the step was taken",
        "    2  UNSETTLED      the step does not converge, even in small parts",
        *place_table(given, found, layout.constants()),
    ]
    return "\n".join(lines), list(dict.fromkeys(row.name for row in (*given, *found)))
