"""Run a soak in several processes, and format its table."""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, TypeVar

from softrobots.core.checks import positive_integer
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.core.progress import with_progress
from studies.soak.families import FAMILIES, Family, draw_cases
from studies.soak.jobs import STABLE, UNSTABLE
from studies.soak.verdicts import AnyTally, Tally, case_text, judge

_AHEAD = 4  # parts queued for each process
PATIENCE = 1800.0
"""If no part is done for this time, compiled code hangs, which its process cannot interrupt [s]."""


class Part(NamedTuple):
    """Some cases of one chunk."""

    family: str
    """Name of the family."""
    chunk: int
    """Number of the chunk."""
    rows: int
    """Number of rows, from the first."""


class Named(Protocol):
    """What has a name at the command line."""

    @property
    def name(self) -> str:
        """The name."""


AnyFamily = TypeVar("AnyFamily", bound=Named)


def family_among(families: Sequence[AnyFamily], name: str) -> AnyFamily:
    """Return the family of a name.

    Raises:
        NameNotFound: If there is none.
    """
    found = [family for family in families if family.name == name]
    if not found:
        raise NameNotFound("family", name, [family.name for family in families])
    return found[0]


def family_of(name: str) -> Family:
    """Return the family of a name among `FAMILIES`; errors as of `family_among`."""
    return family_among(FAMILIES, name)


def parts_of(cases: int, families: Sequence[Family]) -> list[Part]:
    """Spread a number of cases over families by their shares, at least one of each.

    Args:
        cases: Number of cases.
        families: The families.

    Returns:
        The parts, the expensive ones first, so that all processes end at about the same time.
    """
    whole = sum(family.share for family in families)
    result: list[Part] = []
    for family in sorted(families, key=lambda family: family.chunk):
        count = max(round(cases * family.share / whole), 1)
        for chunk in range(math.ceil(count / family.chunk)):
            result.append(Part(family.name, chunk, min(family.chunk, count - family.chunk * chunk)))
    return result


def soak(
    cases: int,
    *,
    seed: int = 0,
    processes: int = 1,
    families: Sequence[Family] = FAMILIES,
    compiler: bool = True,
    progress: bool = False,
) -> dict[str, Tally]:
    """Solve random cases and check every answer.

    Args:
        cases: Approximate number of cases.
        seed: Seed of all random numbers.
        processes: Number of processes; 1 is this one.
        families: The families.
        compiler: Whether compiled solvers may use numba.
        progress: Whether to show a progress bar.

    Returns:
        The count of each family, in the order of the families.

    Raises:
        ParameterError: If a number is not positive.
    """
    positive_integer("cases", cases)
    positive_integer("processes", processes)
    parts = parts_of(cases, families)
    tallies = {family.name: Tally() for family in families}
    total = sum(part.rows for part in parts)
    done = _judged(parts, processes, seed, compiler)
    for part, tally in with_progress(_each_row(done, progress), progress, label="soak", unit="case", total=total):
        if part is not None:
            tallies[part.family].add(tally)
    return tallies


def _each_row(done: Iterator[tuple[Part, Tally]], progress: bool) -> Iterator[tuple[Part | None, Tally]]:
    """Yield the parts as they are done, and for a progress bar one item per case."""
    for part, tally in done:
        yield part, tally
        for _ in range(part.rows - 1 if progress else 0):
            yield None, tally


def _judged(parts: Sequence[Part], processes: int, *arguments: Any) -> Iterator[tuple[Part, Tally]]:
    """Yield the parts with their tallies as they are done."""
    if processes == 1:
        for part in parts:
            yield part, _judge_part(part, *arguments)
        return
    waiting, running = iter(parts), dict[Future[Tally], Part]()
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        while True:
            for part in waiting:
                running[pool.submit(_judge_part, part, *arguments)] = part
                if len(running) >= _AHEAD * processes:
                    break
            if not running:
                return
            done = wait(running, PATIENCE, return_when=FIRST_COMPLETED).done
            for future in done:
                yield running.pop(future), future.result()
            if not done:
                for process in set(multiprocessing.active_children()) - others:
                    process.kill()
                yield from _hanging(running)
                return


def _hanging(running: Mapping[Future[Tally], Part]) -> Iterator[tuple[Part, Tally]]:
    """Yield a broken law for each part that was running or queued when the processes hung."""
    for part in running.values():
        law = (
            f"nothing was done for {PATIENCE:g} s: this case or one of the {part.rows} behind it hangs, and the soak ends here"
        )
        yield part, Tally(broken=[(part.chunk * family_of(part.family).chunk, law)])


def _judge_part(part: Part, seed: int, compiler: bool) -> Tally:
    family = family_of(part.family)
    return judge(replace(family, compiler=family.compiler and compiler), seed, part.chunk, range(part.rows))[0]


def again(name: str, number: int, *, seed: int = 0) -> tuple[Tally, str]:
    """Run one case again.

    Args:
        name: Its family.
        number: Its number in the family, as the laws name it.
        seed: Seed of all random numbers.

    Returns:
        Its tally, and the case, answer and model as text.

    Raises:
        NameNotFound: If there is no such family.
        ParameterError: If the number is negative.
    """
    family = family_of(name)
    if number < 0:
        raise ParameterError("number", number, "zero or above")
    chunk, row = divmod(number, family.chunk)
    tally, answers = judge(family, seed, chunk, [row])
    random = family.random(seed, chunk)
    model = family.robot(random)
    return tally, case_text(model, draw_cases(family, model, random), answers)


def table(tallies: Mapping[str, Tally]) -> str:
    """Return the tallies as a Markdown table."""
    head = "| cases | number | certified stable | in balance, said not to be stable | errors | tangents made anew | "
    head += "residual over tolerance | most iterations | slowest [s] | laws broken |"
    lines = [head, "|---|" + "---:|" * 3 + "---|" + "---:|" * 5]
    whole = Tally()
    for name, tally in tallies.items():
        whole.add(tally)
        lines.append(_row(family_of(name).description, tally))
    return "\n".join([*lines, _row("**all**", whole)])


def _row(text: str, tally: Tally) -> str:
    errors = {name: count for name, count in sorted(tally.outcomes.items()) if name not in (STABLE, UNSTABLE)}
    cells = [
        text,
        f"{tally.cases:,}".replace(",", " "),
        f"{tally.outcomes[STABLE]:,}".replace(",", " "),
        str(tally.outcomes[UNSTABLE]),
        ", ".join(f"{count} {name}" for name, count in errors.items()) or "none",
        f"{tally.tangents:,}".replace(",", " "),
        f"{tally.residual:.2g}",
        str(tally.iterations or "-"),
        f"{tally.slowest:.2g}",
        str(len(tally.broken)),
    ]
    return f"| {' | '.join(cells)} |"


def as_json(tallies: Mapping[str, AnyTally], *, seed: int) -> dict[str, Any]:
    """Return the tallies for JSON."""
    return {
        "seed": seed,
        "cases": sum(tally.cases for tally in tallies.values()),
        "broken": sum(len(tally.broken) for tally in tallies.values()),
        "families": {name: tally.as_json() for name, tally in tallies.items()},
    }
