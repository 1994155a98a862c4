"""Run a soak of contacts in several processes, and format its table."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor

from softrobots.core.checks import positive_integer
from softrobots.core.progress import with_progress
from studies.soak.contact_cases import BLOCKED, CHUNK, FAMILIES, NOT_FOUND, Family, Tally, judge
from studies.soak.jobs import UNSTABLE
from studies.soak.running import family_among


def family_of(name: str) -> Family:
    """Return the family of a name among `FAMILIES`; errors as of `studies.soak.running.family_among`."""
    return family_among(FAMILIES, name)


def soak_contact(cases: int, *, seed: int = 0, processes: int = 1, progress: bool = False) -> dict[str, Tally]:
    """Solve random cases of all families, at least one of each, and check every answer.

    Returns:
        The count of each family.

    Raises:
        ParameterError: If a number is not positive.
    """
    positive_integer("cases", cases)
    positive_integer("processes", processes)
    parts = []
    for family in sorted(FAMILIES, key=lambda family: family.share):  # the slow ones first
        count = max(round(cases * family.share), 1)
        parts += [(family.name, seed, range(start, min(start + CHUNK, count))) for start in range(0, count, CHUNK)]
    tallies = {family.name: Tally() for family in FAMILIES}
    with contextlib.ExitStack() as stack:
        if processes == 1:
            done: Iterable[tuple[str, Tally]] = map(_part, parts)
        else:
            context = multiprocessing.get_context("spawn")
            done = stack.enter_context(ProcessPoolExecutor(processes, mp_context=context)).map(_part, parts)
        for name, tally in with_progress(done, progress, label="soak", unit="part", total=len(parts)):
            tallies[name].add(tally)
    return tallies


def _part(part: tuple[str, int, range]) -> tuple[str, Tally]:
    name, seed, numbers = part
    return name, judge(family_of(name), seed, numbers)


def table(tallies: Mapping[str, Tally]) -> str:
    """Return the tallies as a Markdown table."""
    head = (
        "| cases | number | certified, without contact | one contact | two | three and more | not stable | no room | not found "
    )
    head += "| errors | residual over tolerance | penetration over reach | slowest [s] | laws broken |"
    whole, lines = Tally(), [head, "|---|" + "---:|" * 13]
    for name, tally in tallies.items():
        whole.add(tally)
        lines.append(_row(family_of(name).description, tally))
    return "\n".join([*lines, _row("**all**", whole)])


def _row(text: str, tally: Tally) -> str:
    left = Counter(tally.outcomes)
    cells = [left.pop(name, 0) for name in ("0", "1", "2")]
    cells.append(sum(left.pop(name) for name in list(left) if name.isdecimal()))
    cells += [left.pop(name, 0) for name in (UNSTABLE, BLOCKED, NOT_FOUND)]
    numbers = [f"{tally.residual:.2g}", f"{tally.penetration:.1g}", f"{tally.slowest:.2g}", str(len(tally.broken))]
    return f"| {' | '.join([text, *(f'{n:,}'.replace(',', ' ') for n in (tally.cases, *cells, left.total())), *numbers])} |"
