"""Loops over the actuators beside an element and over the points of their routes, in the kernel language."""

from __future__ import annotations

LENGTHS = '''def follow_routes_FORM(w: Array, element: int, q: int) -> None:
    """Add an element to the lengths of the actuators beside it, and find the slopes of these."""
    for m in range(N_ROWS[element]):
        clear_slopes_FORM(w, SLOPES[element] + STRIDE * m)
    for r in range(FIRST_BESIDE[element], FIRST_BESIDE[element + 1]):
        for p in range(FIRST_POINT[r], FIRST_POINT[r + 1]):
            at = SLOPES[element] + STRIDE * NUMBER[r]
            add_length_FORM(w, POINT_WIDTH * p, q, at, NUMBER[r], POINTS + POINT_RECORD * p)


def pull_FORM(w: Array, element: int) -> None:
    """Add what tensions do to an element."""
    clear_pulls_FORM(w)
    for r in range(FIRST_BESIDE[element], FIRST_BESIDE[element + 1]):
        add_pull_FORM(w, SLOPES[element] + STRIDE * NUMBER[r], NUMBER[r])
        for p in range(FIRST_POINT[r], FIRST_POINT[r + 1]):
            add_curvature_FORM(w, POINT_WIDTH * p, NUMBER[r], POINTS + POINT_RECORD * p)'''
"""Outward pass, and tensions on the inward pass."""

COMPONENTS = '''def meet_FORM(w: Array, element: int) -> None:
    """Add what the lengths beside an element do to its elimination."""
    clear_meeting_FORM(w)
    for m in range(N_PAST[element]):
        to = MEETINGS[element] + STRIDE * m
        meet_turn_FORM(w, SLOPES[element] + STRIDE * m, to, m, 3 * m)
        for n in range(N_PAST[element]):
            meet_length_FORM(w, SLOPES[element] + STRIDE * n, to, N_COMPONENTS * m + n)
        meet_own_FORM(w, SLOPES[element] + STRIDE * m, to)


def hand_on_FORM(w: Array, element: int) -> None:
    """Eliminate an element from the sums of the lengths."""
    for m in range(N_PAST[element]):
        to = MEETINGS[element] + STRIDE * m
        hand_on_turn_FORM(w, to, m, 3 * m)
        for n in range(m + 1):
            hand_on_length_FORM(w, to, MEETINGS[element] + STRIDE * n, N_COMPONENTS * m + n, N_COMPONENTS * n + m)


def before_FORM(w: Array, element: int) -> None:
    """Add what steps nearer to the base do to an element through the lengths beside it."""
    clear_before_FORM(w)
    for m in range(N_PAST[element]):
        step_before_FORM(w, MEETINGS[element] + STRIDE * m, m)


def after_FORM(w: Array, element: int, q: int) -> None:
    """Add the steps of an element to the lengths beside it."""
    for m in range(N_PAST[element]):
        step_after_FORM(w, SLOPES[element] + STRIDE * m, m, q)'''
"""Lengths that change tensions, as components of the turn, on the inward and on the step pass."""


HOLD = '''def meet_FORM(w: Array, element: int) -> None:
    """Add the constraints of the lengths beside an element to its elimination."""
    clear_meeting_FORM(w)
    for m in range(N_PAST[element]):
        hold_length_FORM(w, SLOPES[element] + STRIDE * m, MEETINGS[element] + STRIDE * m)


'''
"""The first function of those, where the components are multipliers."""

PULLS = '''def follow_routes_FORM(w: Array, element: int, q: int) -> None:
    """Find the slopes of lengths without actuators beside an element."""
    for m in range(N_ROWS[element]):
        clear_slopes_FORM(w, SLOPES[element] + STRIDE * m)


def pull_FORM(w: Array, element: int) -> None:
    """Add nothing to an element without actuators beside it."""
    clear_pulls_FORM(w)'''
"""The same for elements between the parts of a route."""


def components_text(*, held: bool) -> str:
    """Return the loops over lengths; `held`: whether those are given, and steps do not change their multipliers."""
    if not held:
        return COMPONENTS
    text = HOLD + COMPONENTS[COMPONENTS.index("def hand_on_FORM") :]
    return text.replace("        step_after_FORM(w, SLOPES[element] + STRIDE * m, m, q)", "        pass")


def around(name: str, form: str, infix: str) -> tuple[list[str], list[str]]:
    """Return the calls before and after that of an element of a form on a pass."""
    element, both = f"{form}(w, ELEMENT[i]", f"{infix}{form}(w, ELEMENT[i]"
    if name == "outward":
        return [], [f"follow_routes_{element}, PLACE[i])"]
    if name == "inward":
        return [f"pull_{element})", f"meet_{both})"], [f"hand_on_{both})"]
    return [f"before_{both})"], [f"after_{both}, PLACE[i])"]


def loops_of(text: str, form: str, suffix: str) -> str:
    """Return loops for a form of elements; those of batches end in the suffix, `POINT_WIDTH` has been replaced."""
    return text.replace("_FORM", f"_{form}{suffix}")
