"""Optional progress bars on stderr."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

Step = TypeVar("Step")


def with_progress(
    steps: Iterable[Step], progress: bool | str, *, label: str, unit: str, total: int | None = None, done: int = 0
) -> Iterable[Step]:
    """Return the same steps, with a progress bar if `progress` is true; a text replaces the label.

    Args:
        steps: The steps.
        progress: Whether to show a bar, or its label.
        label: Default label.
        unit: Name of a step.
        total: Number of steps including those done before; None for the length of `steps`.
        done: Number of steps done before.
    """
    if not progress:
        return steps
    from tqdm import tqdm

    description = progress if isinstance(progress, str) else label
    bar: Iterable[Step] = tqdm(steps, total=total, initial=done, desc=description, unit=unit)
    return bar
