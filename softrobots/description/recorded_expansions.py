"""Expansions of a xacro file that are recorded, so that the text of robots that differ in some numbers takes milliseconds.

The first text takes an expansion by xacro, and so does one in which a comparison in the xacro file comes out otherwise than in
those before (`softrobots.description.number_tape`).
"""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from softrobots.core.errors import DescriptionError
from softrobots.description.expansion import expand
from softrobots.description.number_tape import Tape, TracedNumber

MOST_TAPES = 16
"""Most expansions that are kept; they differ in how comparisons came out."""
Traced = Callable[[Sequence[TracedNumber]], Mapping[str, str]]
"""Arguments of a file, by name, from numbers that write on a tape."""
_TRACING = threading.Lock()


class RecordedExpansions:
    """Texts of one xacro file whose arguments depend on some numbers."""

    def __init__(self, xacro_file: Path) -> None:
        """Begin without a recorded expansion."""
        self._file = xacro_file
        self.tapes = deque[Tape](maxlen=MOST_TAPES)
        """The expansions, the last one first."""

    def text(self, numbers: Sequence[float], arguments: Mapping[str, str], traced: Traced) -> str | None:
        """Return the URDF text for the numbers and their arguments, digit for digit that of xacro.

        None where no tape can follow, or xacro refuses the numbers.
        """
        if (text := self._recorded(numbers, arguments)) is None:
            with _TRACING:  # another thread may have made the tape in the meantime
                if (text := self._recorded(numbers, arguments)) is None:
                    self._record(numbers, traced)
                    text = self._recorded(numbers, arguments)
        return text

    def _recorded(self, numbers: Sequence[float], arguments: Mapping[str, str]) -> str | None:
        all_texts = (tape.texts(numbers) for tape in tuple(self.tapes))
        return next((texts[0] for texts in all_texts if texts and texts[1:] == list(arguments.values())), None)

    def _record(self, numbers: Sequence[float], traced: Traced) -> None:
        tape = Tape(numbers)
        with contextlib.suppress(DescriptionError, ArithmeticError, ValueError, TypeError, AttributeError):  # as of xacro
            arguments = traced(tape.numbers)
            if tape.keep(expand(self._file, arguments, tape), *arguments.values()):
                self.tapes.appendleft(tape)
