"""Sources of commands of a live view: keys of a terminal, lines of a pipe, a watched file."""

from __future__ import annotations

import contextlib
import os
import re
import select
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.view.live.commands import GRAMMAR, Wanted, changed, read_commands
from softrobots.view.live.keys import KEYS, KeyMoves
from softrobots.view.live.loop import Commands, LiveView

_WAIT = 0.2  # [s], for input, between checks whether the page is still served
_PERIOD = 0.1  # [s], between checks of a file
_RECENT = 2.0  # [s]: a file written less than this ago may be written again within one tick of its clock
_LARGEST = 1_000_000  # bytes of a file of commands, or of a line
_ESCAPE_WAIT = 0.1  # [s], for the rest of an escape sequence

_KEY = re.compile(r"\x1b[\[O](\d*)[\d;]*([A-Za-z~])|.", re.DOTALL)
_PART_OF_KEY = re.compile(r"\x1b([\[O][\d;]*)?$")
_NAMED = {"A": "up", "B": "down", "C": "right", "D": "left", "5~": "page up", "6~": "page down"}
_ENDING = ("SIGTERM", "SIGHUP", "SIGQUIT")

Tell = Callable[[str], object]
"""Prints a line for the user."""


class Lines:
    """Commands as lines on a file descriptor, e.g. a pipe; its end means `quit`. Text after the last newline is a line."""

    def __init__(self, descriptor: int, tell: Tell) -> None:
        """Read from a descriptor; `tell` prints help."""
        self._descriptor, self._tell = descriptor, tell
        self._text, self._open = b"", True

    def read(self, live: LiveView) -> Wanted | None:
        """See `softrobots.view.live.loop.Commands.read`: one line at a time."""
        if self._open and b"\n" not in self._text and select.select([self._descriptor], [], [], _WAIT)[0]:
            part = os.read(self._descriptor, 65536)
            self._text, self._open = self._text + part, bool(part)
        line, end, rest = self._text.partition(b"\n")
        if not end and self._open:
            if len(line) > _LARGEST:
                self._text = b""
                raise FileFormatError(f"a line must have at most {_LARGEST} bytes")
            return None
        if not end and not line:
            return live.wanted._replace(done=True)
        self._text = rest
        return _typed(line.decode("utf-8", "replace"), live.wanted, live, self._tell)


class WatchedFile:
    """A file of commands, checked ten times a second; what it does not name is as at the start."""

    def __init__(self, path: Path, tell: Tell) -> None:
        """Watch a file, which need not exist yet; `tell` prints that it does not.

        Raises:
            ParameterError: If the path is no file, e.g. a folder.
        """
        if path.exists() and not path.is_file():
            raise ParameterError("live", str(path), "a file, or the word keyboard")
        self._path, self._tell = path, tell
        self._mark: tuple[int, ...] | None = None
        self._text: bytes | None = None
        self._last = 0.0
        self._missed = False

    def read(self, live: LiveView) -> Wanted | None:
        """See `softrobots.view.live.loop.Commands.read`: the whole file, when its content is new."""
        time.sleep(max(0.0, self._last + _PERIOD - time.monotonic()))
        self._last = time.monotonic()
        text = self._new_text()
        if text is None:
            return None
        try:
            return read_commands(text.decode("utf-8"), live.start)
        except UnicodeDecodeError as error:
            raise FileFormatError(f"{self._path} is no text: {error}") from error

    def _new_text(self) -> bytes | None:
        """The content if it has changed, else None."""
        try:
            status = self._path.stat()
            mark = (status.st_mtime_ns, status.st_size, status.st_ino)
            if mark == self._mark and time.time() - status.st_mtime > _RECENT:
                return None
            text = None
            if stat.S_ISREG(status.st_mode):
                with self._path.open("rb") as file:
                    text = file.read(_LARGEST + 1)  # the size in `stat` may be wrong
            if mark != self._mark and (text is None or len(text) > _LARGEST):
                self._mark = mark
                raise FileFormatError(f"{self._path} must be a file of at most {_LARGEST} bytes")
        except OSError as error:
            if not self._missed:
                self._tell(f"waiting for {self._path}: {error.strerror}")
            self._missed, self._mark = True, None
            return None
        self._missed, self._mark = False, mark
        if text is None or len(text) > _LARGEST or text == self._text:
            return None
        self._text = text
        return text


class Keys:
    """Commands as single keys of a terminal; keys that arrive together are one command."""

    def __init__(self, descriptor: int, tell: Tell, terminal: Terminal, moves: KeyMoves) -> None:
        """Read from the descriptor of a terminal; `tell` prints help."""
        self._descriptor, self._tell, self._terminal, self._moves = descriptor, tell, terminal, moves
        self._text = ""
        tell(moves.hint)

    def read(self, live: LiveView) -> Wanted | None:
        """See `softrobots.view.live.loop.Commands.read`."""
        if not self._text and not self._more(_WAIT):
            return None
        while _PART_OF_KEY.search(self._text) and self._more(_ESCAPE_WAIT):
            pass
        wanted, text = live.wanted, _PART_OF_KEY.sub("", self._text)
        self._text = ""
        while text and not wanted.done:
            pressed = _KEY.match(text)
            key, text = _named(pressed), text[pressed.end() if pressed else 1 :]
            if key in ("q", "\x04"):
                return wanted._replace(done=True)
            if key == "?":
                self._tell(KEYS)
            elif key == ":":
                line, text = self._line(text)
                wanted = _typed(line, wanted, live, self._tell) or wanted
            elif key not in ("\n", "\r"):
                before, wanted = wanted, self._moves.press(key, wanted, live.start, live.equilibrium)
                if wanted is before and key != "r":
                    self._tell(self._moves.hint)
        return None if wanted is live.wanted else wanted

    def _more(self, seconds: float) -> bool:
        """Wait for keys; return whether there are any."""
        if not select.select([self._descriptor], [], [], seconds)[0]:
            return False
        part = os.read(self._descriptor, 4096).decode("utf-8", "replace")
        self._text += part or "\x04"
        return True

    def _line(self, text: str) -> tuple[str, str]:
        """The line typed after `:`, and the text after it."""
        with self._terminal.lines():
            sys.stdout.write(":")
            sys.stdout.flush()
            while "\n" not in text:
                part = os.read(self._descriptor, 4096).decode("utf-8", "replace")
                if not part:
                    return text, ""
                text += part
        line, _, rest = text.partition("\n")
        return line, rest


class Terminal(contextlib.ExitStack):
    """A terminal in single-key mode without echo; a context manager that restores it.

    It is restored at SIGTERM, SIGHUP and SIGQUIT too, which raise SystemExit, and set again when the program continues after
    Ctrl-Z.
    """

    def __init__(self, descriptor: int) -> None:
        """Use a terminal that is open for reading."""
        super().__init__()
        self._descriptor = descriptor

    def __enter__(self) -> Terminal:
        """Switch to single keys."""
        import termios

        saved = termios.tcgetattr(self._descriptor)

        def restore() -> None:
            with contextlib.suppress(termios.error):  # it may be gone
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, saved)

        self._restore = restore
        if threading.current_thread() is threading.main_thread():
            for name in _ENDING:
                self._handle(getattr(signal, name), _end)
            self._handle(signal.SIGCONT, lambda *_: self._single())
        self.callback(restore)
        self._single()
        return self

    @contextlib.contextmanager
    def lines(self) -> Iterator[None]:
        """Switch to whole lines, shown and edited as usual, for the time of the context."""
        self._restore()
        try:
            yield
        finally:
            self._single()

    def _single(self) -> None:
        import termios
        import tty

        with contextlib.suppress(termios.error):
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)

    def _handle(self, number: int, handler: Callable[..., object]) -> None:
        self.callback(signal.signal, number, signal.signal(number, handler))


@contextlib.contextmanager
def commands_from(where: str | Path, live: LiveView, tell: Tell) -> Iterator[Commands]:
    """Open a source of commands.

    Args:
        where: "keyboard": single keys if standard input is a terminal, else its lines; or a file to watch.
        live: The view that they are for.
        tell: Takes help and remarks.

    Yields:
        The source.

    Raises:
        ParameterError: If it is no file, or there is no standard input.
    """
    if where != "keyboard":
        yield WatchedFile(Path(where), tell)
        return
    if sys.stdin is None or sys.stdin.closed:
        raise ParameterError("live", where, "a file where there is no standard input")
    descriptor = sys.stdin.fileno()
    if not os.isatty(descriptor):
        yield Lines(descriptor, tell)
        return
    with Terminal(descriptor) as terminal:
        yield Keys(descriptor, tell, terminal, KeyMoves(live.equilibrium))


def _typed(line: str, now: Wanted, live: LiveView, tell: Tell) -> Wanted | None:
    """The state after a typed line; None if it has no effect."""
    if line.strip() in ("help", "?"):
        tell(GRAMMAR)
        return None
    wanted = changed(line, now, live.start)
    return None if wanted is now else wanted


def _named(pressed: re.Match[str] | None) -> str:
    """Name of the key of an escape sequence."""
    if pressed is None or not pressed[2]:
        return pressed[0] if pressed else ""
    return _NAMED.get(f"{pressed[1]}~" if pressed[2] == "~" else pressed[2], repr(pressed[0]))


def _end(number: int, _: object) -> NoReturn:
    raise SystemExit(128 + number)
