"""What Drake says of a file while it parses it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def warnings_of_drake(*, shown: bool) -> Iterator[list[str]]:
    """Collect Drake's warnings.

    Args:
        shown: Whether they go on to where logging sends them, too.

    Yields:
        The lines, as they come.
    """
    lines: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        lines.append(" ".join(record.getMessage().split()))
        return shown

    logger = logging.getLogger("drake")
    logger.addFilter(collect)
    try:
        yield lines
    finally:
        logger.removeFilter(collect)
