"""Functions of actuators on routes in motion: straight-line functions, loops over elements and rows, and their tables."""

from __future__ import annotations

from dataclasses import dataclass

from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.motion_routes import MotionRoutes
from softrobots.compiled.program.looped_program import loop_text
from softrobots.compiled.routes.ends import keep_lengths
from softrobots.compiled.routes.loops import LENGTHS, PULLS, loops_of
from softrobots.compiled.routes.motion_border import border_blocks, border_text, factors_text
from softrobots.compiled.routes.motion_follow import FOLLOW, SWERVE, arms_text, find_tensions, form_blocks, frame_blocks
from softrobots.compiled.routes.motion_lengths import LENGTHS as HELD
from softrobots.compiled.routes.motion_lengths import held_blocks, keep_swerves, length_tables
from softrobots.compiled.routes.terms import form_of, length_blocks, route_forms
from softrobots.compiled.trace.blocks import Block

_PASSES = {
    "follow": "Find lengths and slopes of the actuators, from base to tip.",
    "pull": "Find the tensions of the actuators and their torques, from tip to base.",
    "swerve": "Find the accelerations of the lengths at constant rates.",
}
_NO_SWERVE = '''def swerve_FORM(w: Array, element: int, q: int) -> None:
    """Add nothing for an element without actuators beside it."""
    pass'''


@dataclass(frozen=True)
class ActuatorParts:
    """The functions."""

    blocks: list[Block]
    """Straight-line functions."""
    tables: dict[str, object]
    """Tables and places that they need."""
    before: list[tuple[str, str]]
    """Loops over the actuators beside an element, text and name of the form of elements."""
    calls: dict[str, list[tuple[int, str]]]
    """By pass: kind of step and call."""
    after: str
    """Functions that call the passes, and those over the rows of the border."""

    def loops(self, suffix: str) -> list[str]:
        """Return the functions that loop over elements before those of the chain, for one case or for lanes."""
        passes = [
            loop_text(name, _PASSES[name], calls, back=name == "pull", suffix=suffix, prefix="ROUTE_")
            for name, calls in self.calls.items()
        ]
        forms = [loops_of(text, form, suffix).replace("_SUFFIX", suffix) for text, form in self.before]
        return [*forms, *passes]


def actuator_parts(plan: MotionPlan, routes: MotionRoutes) -> ActuatorParts:
    """Trace the functions of the actuators of a looped chain."""
    unknowns, own, held = routes.unknowns, routes.routes, routes.held
    forms = route_forms(routes)
    numbers = {form: number for number, form in enumerate(forms.values())}
    strain, rate, *_ = plan.strains
    calls: dict[str, list[tuple[int, str]]] = {"follow": [], "swerve": []} if held else {"follow": [], "pull": []}
    blocks: list[Block] = []
    before: list[tuple[str, str]] = []
    tables: dict[str, object] = {}
    for number, (name, form) in enumerate(forms.items()):
        added, columns = length_blocks(routes, name, form, routes.swerving if held else None)
        blocks += [*added, *form_blocks(routes, name, form)]
        texts = [LENGTHS, SWERVE] if columns else [PULLS, _NO_SWERVE]
        texts = [text.replace("POINT_WIDTH", str(columns.width)) if columns else text for text in texts[: 1 + held]]
        before += [(text, name) for text in (*texts, arms_text(name))]
        if columns:
            tables |= own.tables() | {f"POINT_TABLE_{name}": tuple(columns.numbers)}
        element = "(w, ROUTE_ELEMENT[i]"
        calls["follow"] += [
            (number, f"follow_routes_{name}{element}, ROUTE_PLACE[i] + {strain})"),
            (number, f"keep_arms_{name}{element}, ROUTE_PLACE[i])"),
        ]
        if held:
            calls["swerve"].append((number, f"swerve_{name}{element}, ROUTE_PLACE[i] + {rate})"))
        else:
            calls["pull"] += [(number, f"pull_{name}{element})"), (number, f"give_pulls_{name}(w, ROUTE_PLACE[i])")]
    steps: list[tuple[int, int, int]] = []  # kind, element, first strain
    row_of = [0] * len(unknowns.chain.elements)
    first = 0
    for number, segment in enumerate(own.segments):
        for row in range(segment.first, segment.last + 1):
            if row in own.beside:
                row_of[row] = first
                steps.append((numbers[form_of(routes, row)], row, unknowns.place[unknowns.moving(row)[0]]))
        end = len(forms) + number
        steps.append((end, 0, 0))
        first += len(segment.stretched)
        blocks.append(keep_lengths(routes, number, segment))
        calls["follow"].append((end, f"keep_lengths_{number}(w)"))
        if held:
            blocks.append(keep_swerves(routes, number, segment))
            calls["swerve"].append((end, f"keep_swerves_{number}(w)"))
        else:
            blocks.append(find_tensions(routes, number, segment))
            calls["pull"].append((end, f"find_tensions_{number}(w)"))
    blocks += frame_blocks(routes, len(steps))
    tables |= dict(zip(("ROUTE_KIND", "ROUTE_ELEMENT", "ROUTE_PLACE"), zip(*steps, strict=True), strict=True))
    spans = routes.spans or [(0, 0)]
    tables |= {"ROUTE_N_ELEMENTS": len(steps), "ROUTE_COUNT": routes.bound, "ROW_OF": tuple(row_of), "N_BORDER": routes.rows}
    tables |= {"BORDER_FIRST": tuple(one for one, _ in spans), "BORDER_LAST": tuple(one for _, one in spans)}
    after = FOLLOW
    if held:
        tables |= length_tables(plan, routes)
        blocks += held_blocks(plan, routes)
        after = factors_text("closing") + HELD
    after += factors_text("system") + border_text(guides=plan.guides is not None)
    if plan.guides is not None:
        tables |= own.guide_tables(plan.guides) | {"SIDES": routes.sides, "MIDDLE": strain}
    return ActuatorParts([*blocks, *border_blocks(plan, routes)], tables, before, calls, after)
