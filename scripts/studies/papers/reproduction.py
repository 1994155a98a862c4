"""The papers, and the rows of all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from softrobots.core.checks import choice
from softrobots.core.progress import with_progress
from studies.papers import arm_motion, helical_actuation, inflatable_arm, pcc_two_segments
from studies.papers.rows import Row


class Paper(NamedTuple):
    """A paper and what computes it again."""

    title: str
    """What it is called in tables."""
    jobs: tuple[Callable[[], list[Row]], ...]
    """What makes its rows, in the order of the paper."""


PAPERS: Mapping[str, Paper] = {
    "inflatable_arm": Paper(inflatable_arm.TITLE, inflatable_arm.JOBS + arm_motion.JOBS),
    "pcc_two_segments": Paper(pcc_two_segments.TITLE, pcc_two_segments.JOBS),
    "helical_actuation": Paper(helical_actuation.TITLE, helical_actuation.JOBS),
}
"""The papers, by short name."""


def reproduce(names: Iterable[str] = tuple(PAPERS), *, progress: bool = False) -> dict[str, tuple[Row, ...]]:
    """Compute what papers print.

    Args:
        names: Papers, of `PAPERS`.
        progress: Show a progress bar on stderr.

    Returns:
        The rows of each paper, by its name, in the order of `PAPERS`.

    Raises:
        ParameterError: If there is no such paper.
    """
    wanted = {choice("paper", name, tuple(PAPERS)) for name in names}
    jobs = [(name, job) for name, paper in PAPERS.items() if name in wanted for job in paper.jobs]
    found: dict[str, tuple[Row, ...]] = {name: () for name in PAPERS if name in wanted}
    for name, job in with_progress(jobs, progress, label="papers", unit="part"):
        found[name] += tuple(job())
    return found
