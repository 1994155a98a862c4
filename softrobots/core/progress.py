"""Progress bars on stderr, for whoever asks for them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

Step = TypeVar("Step")


def with_progress(
    steps: Iterable[Step], progress: bool | str, *, label: str, unit: str, total: int | None = None, done: int = 0
) -> Iterable[Step]:
    """Go through steps with a progress bar, if one is asked for.

    Args:
        steps: The steps.
        progress: Whether to show one; a text is its label.
        label: Its label otherwise.
        unit: What a step is called.
        total: Number of steps, with those that are done; None: the steps know it.
        done: Number of steps before these, that are done.

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
