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


CLEAR_GUIDES = """    for m in range(N_ROWS[element]):
        clear_slopes_FORM(w, WEIGHTED + SLOPES[element] + STRIDE * m)"""
"""What `pull` clears, too, where actuators rub in their guides."""

GUIDES = """
    for r in range(FIRST_BESIDE[element], FIRST_BESIDE[element + 1]):
        for p in range(FIRST_POINT[r], FIRST_POINT[r + 1]):
            point = POINTS + POINT_RECORD * p
            add_curvature_FORM(w, POINT_WIDTH * p, NUMBER[r], point)
            add_guide_FORM(w, POINT_WIDTH * p, WEIGHTED + SLOPES[element] + STRIDE * NUMBER[r], point)"""
"""What these do to an element, in place of the loops of `pull`."""

RUB = '''def rub(w: Array, segment: int) -> None:
    """Find the friction of the guides of the actuators of a segment, from their lengths and the tensions of their motors."""
    for m in range(FIRST_RUBBING[segment], FIRST_RUBBING[segment + 1]):
        first = FIRST_GUIDE[RUBBING[m]]
        count = FIRST_GUIDE[RUBBING[m] + 1] - first
        number = m - FIRST_RUBBING[segment]
        beyond = 0.0
        for i in range(count):
            guide = first + count - 1 - i
            at = GUIDE_AT[guide]
            here = beyond + 0.5 * w[at]
            beyond += w[at]
            slip = w[ANCHORS + guide] + GUIDE_REST[guide] - here
            size = fabs(slip) / GUIDE_STICK[guide]
            share = slip / GUIDE_STICK[guide]
            work = 0.5 * size * size
            w[at + 2] = w[GRIPS + guide] / GUIDE_STICK[guide]
            if size > 1.0:
                share = slip / fabs(slip)
                work = size - 0.5
                w[at + 2] = 0.0
            w[at + 4] = share
            w[GUIDE_ENERGY] += w[GRIPS + guide] * GUIDE_STICK[guide] * work
            w[ANCHORED + guide] = here - GUIDE_REST[guide] + GUIDE_STICK[guide] * share
        tension = w[TENSIONS + number]
        stiffness = w[STRETCHING + number]
        for i in range(count):
            at = GUIDE_AT[first + i]
            friction = w[GRIPS + first + i] * w[at + 4]
            sticking = w[at + 2]
            w[at + 1] = tension - 0.5 * friction
            w[at + 2] = stiffness + 0.5 * sticking
            w[at + 3] = stiffness + 0.25 * sticking
            tension -= friction
            stiffness += sticking'''
"""Friction in guides, before the inward pass of a segment; see `softrobots.model.dry_friction`."""


def guided(text: str) -> str:
    """Return loops of lengths or of pulls for actuators that rub in their guides."""
    clear = "    clear_pulls_FORM(w)"
    head, tail = text.split(clear)
    return f"{head}{clear}\n{CLEAR_GUIDES}{GUIDES if tail else ''}"


def components_text(*, held: bool, rubbing: bool = False) -> str:
    """Return the loops over lengths.

    `held`: lengths are given, and steps do not change their multipliers; `rubbing`: in guides, by which they do.
    """
    if rubbing:
        slopes = "SLOPES[element] + STRIDE * m"
        begin = f"meet_own_FORM(w, WEIGHTED + {slopes}, to)"
        text = COMPONENTS.replace("SLOPES[element]", "WEIGHTED + SLOPES[element]")
        return text.replace(begin, f"{begin}\n        hold_length_FORM(w, {slopes}, to)")
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
