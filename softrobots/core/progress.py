"""Optional progress bars on stderr."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

Step = TypeVar("Step")


def with_progress(
    steps: Iterable[Step], progress: bool | str, *, label: str, unit: str, total: int | None = None, done: int = 0
) -> Iterable[Step]:
    """Wrap an iterable in a progress bar.

    Args:
        steps: The steps.
        progress: Whether to show a bar; a text replaces its label.
        label: Default label.
        unit: Name of a step.
        total: Number of steps including those done before; None for the length of `steps`.
        done: Number of steps done before.

    Returns:
        The same steps.
    """
    if not progress:
        return steps
    from tqdm import tqdm

    bar: Iterable[Step] = tqdm(
        steps, total=total, initial=done, desc=progress if isinstance(progress, str) else label, unit=unit
    )
    return bar
