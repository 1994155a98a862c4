"""Functions of the motion of a looped chain that call its passes: evaluate, factor, correct, place the tip and end a step."""

from __future__ import annotations

from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.program.motion_parts import coast_text

_MOVE = """    start_move_SUFFIX(w)
BENDBENT    move_all_SUFFIX(w)
"""
_BEND = """    for i in range(N_BENDS):
        bend_SUFFIX(w, i)
"""
_FACTOR = "    articulate_all_SUFFIX(w)\n"
_ARTICULATE = "    start_articulate_SUFFIX(w)\n" + _FACTOR
_RESIST = """    start_resist_SUFFIX(w)
    resist_all_SUFFIX(w)
"""
_DAMP = """    for stage in range(N_STAGES):
        find_dampers_SUFFIX(w, stage)
"""
_FREE = """    for stage in range(N_STAGES):
        free_torques_SUFFIX(w, stage)
"""
_DISPLACE = "    displace(w)\n"
_HOLD = """    rub_guides(w, 1.0)
    find_multipliers_SUFFIX(w, 0)
    find_pulls_SUFFIX(w)
    rub_guides(w, -1.0)
"""
_RUB = """    grip_guides(w)
    rub_guides(w, 1.0)
"""
_STAGES = '''def resist_stages_SUFFIX(w: Array) -> None:
    """Evaluate both stages side by side."""
    for i in range(N):
        place_stages_SUFFIX(w, i, 2 * i)
EVALUATE

'''
_FOLLOW = """    for stage in range(N_STAGES):
        for i in range(N):
            take_stage_SUFFIX(w, i, N_STAGES * i + stage)
        follow_actuators_SUFFIX(w, stage)
        for i in range(N_STRAINS):
            keep_stage_SUFFIX(w, i, N_STAGES * i + stage)
"""
_MASSIVE = """    for i in range(N):
        for j in range(N):
            for stage in range(N_STAGES):
                add_mass_SUFFIX(w, N_STAGES * i + stage, N * i + j, N_STAGES * j + stage)
"""
_END = """


def end_strains_SUFFIX(w: Array) -> None:
    \"\"\"Keep the strains and their rates at the end of a step.\"\"\"
CLOSE    for i in range(N_STRAINS):
        w[STRAIN_BEGIN + i] = w[STRAINS_AT + i]
        w[RATE_BEGIN + i] = w[RATES_AT + i]
"""
_CLOSE = """    for i in range(N):
        w[UNKNOWN + i] = w[POSITION + i]
        w[RATE + i] = w[VELOCITY + i]
    follow_actuators_SUFFIX(w, 0)
"""
_CONTROL = '''def motion_factor_SUFFIX(w: Array) -> None:
    """Evaluate and factor; write the correction."""
FACTOR

def motion_correct_SUFFIX(w: Array) -> None:
    """Evaluate; write the correction with the factors that are there."""
CORRECT

def motion_tip_SUFFIX(w: Array) -> None:
    """Write the tip at motors and unknowns."""
CLOSE    start_place_SUFFIX(w)
    place_all_SUFFIX(w)
    finish_place_SUFFIX(w)'''


def control_text(plan: MotionPlan, bends: bool, bent: bool) -> str:
    """Return the functions that call the passes; `bends`: whether joints turn, `bent`: whether sections bend."""
    in_stages, routes = plan.layout.in_stages, plan.routes
    held = routes is not None and routes.held
    move, resist, articulate, solve = _MOVE, _RESIST, _ARTICULATE, "    correct_all_SUFFIX(w)\n"
    if routes is not None:
        move = (_FOLLOW if in_stages else "    follow_actuators_SUFFIX(w, 0)\n") + move
        articulate += "    factor_border_SUFFIX(w)\n"
        solve = "    correct_strains_SUFFIX(w)\n" + ("    free_corrections_SUFFIX(w)\n" if held else "")
    elif plan.reduces:
        solve = "    reduce_all_SUFFIX(w)\n" + solve
    if plan.couples:
        articulate = _either("    start_couple_SUFFIX(w)\n    couple_all_SUFFIX(w)\n", articulate)
        solve = _either(solve.replace("_all", "_coupled_all"), solve)
    massive = _MASSIVE if plan.layout.full_damping else ""
    rub = "" if plan.guides is None else _DISPLACE + (_HOLD if held else "") + _RUB
    resist += _DAMP + massive + rub + _FREE if held else massive + rub
    if plan.guides is not None:
        articulate = _ARTICULATE
        solve = "    hold_guides(w)\n    factor_border_SUFFIX(w)\n" + solve
    evaluate = ("    resist_stages_SUFFIX(w)\n", "") if in_stages else (move, resist)
    text = _CONTROL.replace("FACTOR", evaluate[0] + articulate + evaluate[1] + solve)
    text = text.replace("CORRECT", "".join(evaluate) + solve)
    text += "\n\n\n" + coast_text(plan, "    start_resist_SUFFIX(w)\n" + solve)
    text = text.replace("CLOSE", "    close_lengths_SUFFIX(w, 0)\n" if held else "")
    text = _STAGES.replace("EVALUATE", move + resist) + text if in_stages else text
    text = text.replace("BENT", "    bend_all_SUFFIX(w)\n" if bent else "").replace("BEND", _BEND if bends else "")
    text += _END.replace("CLOSE", _CLOSE if held else "") if plan.layout.rubbing else ""
    return text + ("    slide(w, STRAIN_BEGIN, 1.0)\n" if plan.guides else "")


def _either(coupled: str, otherwise: str) -> str:
    """Text of what is done where each stage has a matrix of its own, and otherwise."""
    one, other = (part.replace("    ", "        ") for part in (coupled, otherwise))
    return f"    if w[COUPLED] > 0.5:\n{one}    else:\n{other}"
