"""Runs the code of a page, README.md or docs/*.md, and holds what it prints against the page.

The rules, for whoever writes a page:

- ```` ```python ```` (or `py`) runs. All blocks of a page share one namespace, in order, and one folder, empty at first.
- ```` ```text ```` stands right behind such a block, or one of `sh`, and is its output, word for word. Numbers with a point or
  an exponent may differ by one in the last digit that is printed.
- ```` ```sh ```` is run line by line (a backslash joins lines), `softrobots ...` and `python scripts/...` in this process. Each
  must end with status 0; `# status 1` at the end of a line says otherwise.
- ```` ```console ```` holds `$ command` lines, each with its output.
- ```` ```math ```` must become MathML, ```` ```xml ```` must be well-formed, ```` ```c ```` and ```` ```html ```` are left to
  tests of their own.
- `<!-- not run: reason -->` in the line before a block keeps it from running. What it types is still parsed: options of
  `softrobots` and of our scripts, Python's grammar.
- `<!-- first: code -->` before a block of Python runs lines that readers need not see, e.g. to make a file that it reads.
- `<!-- file: NAME -->` before a block makes it that file of the folder, where programs and imports find it; it is not run.

Code runs as on a computer without numba, where `softrobots.compile` takes plain Python: nothing is compiled for minutes.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import io
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import pytest

from softrobots.cli import main as cli
from softrobots.core.errors import MissingDependency
from tests.conftest import CHECKOUT

LANGUAGES = ("python", "py", "text", "sh", "console", "math", "xml", "c", "html")
PROGRAMS = ("softrobots", "python", "cat", "ls", "head", "gcc", "mkdir")
"""What lines of a shell may start with."""
ROUNDING = 1e-11
"""Numbers of an output that are smaller differ from one processor to the next."""
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w])")

_FENCE = re.compile(r"^( *)(`{3,}|~{3,})(.*)$")
_NOT_RUN = re.compile(r"<!-- not run: (\S.*?) *-->")
_FILE = re.compile(r"<!-- file: ([\w.]+) -->")
_FIRST = re.compile(r"<!-- first:\s(.*?)\s-->", re.DOTALL)
_STATUS = re.compile(r"#.*\bstatus (\d+)\s*$")
_SHELL = re.compile(r"[|><;&$`]")


class PageError(AssertionError):
    """A page that does not keep its promise, with the place."""


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    language: str
    text: str
    line: int  # of its first line of text
    reason: str  # why it is not run; empty: it runs
    first: str  # code to run before it
    file: str  # name of the file that it is; empty: it is none
    follows: bool  # whether nothing but blank lines stands between it and the block before


def blocks(text: str, name: str) -> list[Block]:
    """The fenced blocks of a page.

    Raises:
        PageError: If a fence has no language, or one that no rule knows, or is not closed.
    """
    found: list[Block] = []
    lines = text.splitlines()
    place, between = 0, []
    while place < len(lines):
        opened = _FENCE.match(lines[place])
        if opened is None:
            between.append(lines[place])
            place += 1
            continue
        indent, mark, language = len(opened[1]), opened[2], opened[3].strip()
        if language not in LANGUAGES:
            raise PageError(f"{name}:{place + 1}: a fence of {language or 'no language'}; known: {', '.join(LANGUAGES)}")
        end = next((n for n in range(place + 1, len(lines)) if lines[n].strip() == mark), None)
        if end is None:
            raise PageError(f"{name}:{place + 1}: a fence that is not closed")
        before = "\n".join(between).rstrip()
        comments = before[before.rindex("<!--") :] if before.endswith("-->") else ""
        reason, first, file = (mark.fullmatch(comments) for mark in (_NOT_RUN, _FIRST, _FILE))
        inside = "\n".join(line[indent:] for line in lines[place + 1 : end]) + "\n"
        follows = bool(found) and not before
        told = (mark[1] if mark else "" for mark in (reason, first, file))
        found.append(Block(language, inside, place + 2, *told, follows))
        place, between = end + 1, []
    return found


def differences(told: str, printed: str) -> list[str]:
    """Lines of an output that are not as told; numbers may differ by one in their last digit, and rounding by itself."""
    expected, got = ([" ".join(line.split()) for line in text.strip().splitlines()] for text in (told, printed))
    if len(expected) != len(got):
        return [f"{len(expected)} lines are told, {len(got)} printed:\n{printed}"]
    return [f"told    {a}\nprinted {b}" for a, b in zip(expected, got, strict=True) if not _same_line(a, b)]


def _same_line(told: str, printed: str) -> bool:
    frames = [re.sub(r" ?([\[\](),]) ?", r"\1", NUMBER.sub("#", text)) for text in (told, printed)]
    pairs = zip(NUMBER.findall(told), NUMBER.findall(printed), strict=False)
    return frames[0] == frames[1] and all(_same_number(a, b) for a, b in pairs)


def _same_number(told: str, printed: str) -> bool:
    if told == printed:
        return True
    digits, _, exponent = told.lower().partition("e")
    if "." not in digits and not exponent:
        return False  # a count
    if 0.0 < abs(float(told)) < ROUNDING:
        return abs(float(printed)) < ROUNDING
    unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return abs(float(told) - float(printed)) <= 1.001 * unit  # both are rounded


class PageRunner:
    """Runs the blocks of one page."""

    def __init__(self, name: str, text: str, folder: Path) -> None:
        """Take a page; `folder` is an empty one to work in."""
        self.name, self.text, self.folder = name, text, folder
        self.module = ModuleType(f"page_{re.sub(r'[^a-z]', '_', name.lower())}")
        self.ran = 0
        """Blocks and lines of a shell that were run."""

    def run(self) -> dict[str, object]:
        """Run everything and return the names that the page has made.

        Raises:
            PageError: If the page breaks a rule, or says something else than what is printed.
        """
        printed: str | None = None
        sys.modules[self.module.__name__] = self.module
        try:
            with working_folder(self.folder):
                for block in blocks(self.text, self.name):
                    printed = self._run(block, printed)
        finally:
            del sys.modules[self.module.__name__]
        return vars(self.module)

    def _run(self, block: Block, printed: str | None) -> str | None:
        """Run one block; its output, or None if it has none to compare."""
        language = "python" if block.language == "py" else block.language
        if block.first and (language != "python" or block.reason):
            raise self._wrong(block, "only Python that runs may have something before it")
        if language == "text":
            if not block.reason:
                if printed is None or not block.follows:
                    raise self._wrong(block, "an output that does not stand right behind what prints it")
                self._compare(block, block.text, printed)
            return None
        if language == "xml":
            ElementTree.fromstring(block.text)
        if block.file:
            Path(block.file).write_text(block.text, encoding="utf-8")
            return None
        if language in ("math", "c", "xml", "html"):
            return None
        if block.reason:
            self._parse(block, language)
            return None
        if language == "python":
            if block.first:
                exec(block.first, vars(self.module))
            return self._python(block)
        return self._shell(block) if language == "sh" else self._console(block)

    def _wrong(self, block: Block, told: str) -> PageError:
        return PageError(f"{self.name}:{block.line}: {told}")

    def _compare(self, block: Block, told: str, printed: str) -> None:
        found = differences(told, printed)
        if found:
            raise self._wrong(block, "\n".join(["the output is another one", *found]))

    def _python(self, block: Block) -> str:
        code = compile("\n" * (block.line - 1) + block.text, self.name, "exec")  # a traceback names the line of the page
        self.ran += 1
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            exec(code, vars(self.module))
        return output.getvalue()

    def _shell(self, block: Block) -> str:
        return "".join(self._command(block, line) for line in commands(block.text))

    def _console(self, block: Block) -> None:
        head, *parts = re.split(r"^\$ ", block.text, flags=re.MULTILINE)
        if head.strip() or not parts:
            raise self._wrong(block, "a console begins with $")
        for part in parts:
            line, _, told = part.partition("\n")
            self._compare(block, told, self._command(block, line))

    def _command(self, block: Block, line: str) -> str:
        """Run a line of a shell and return what it prints on stdout."""
        ending = _STATUS.search(line)
        expected = int(ending[1]) if ending else 0
        for part in parts_of(line):
            program, *words = self._words(block, part)
            module = program == "python" and words[:1] == ["-m"]  # venv, pip, pytest, ...
            if program not in PROGRAMS or module:
                told = f"{program} -m" if module else program
                raise self._wrong(block, f"{told} is not run here (known: {', '.join(PROGRAMS)}); say why it is not run")
        program, *words = self._words(block, line)
        self.ran += 1
        ours = entry(program, words)
        if ours is not None and not _SHELL.search(line.partition("#")[0]):
            status, printed, errors = in_process(ours, words if program == "softrobots" else words[1:])
        else:
            status, printed, errors = in_shell(line)
        if status != expected:
            raise self._wrong(block, f"{line}: status {status} instead of {expected}\n{errors or printed}")
        return printed

    def _words(self, block: Block, line: str) -> list[str]:
        """The words of a line, with the names that programs have here."""
        words = shlex.split(line, comments=True)
        program = words[0].removeprefix(".venv/bin/")
        words = ["python" if program == "python3" else program, *words[1:]]
        return ["softrobots", *words[3:]] if words[:3] == ["python", "-m", "softrobots"] else words

    def _parse(self, block: Block, language: str) -> None:
        """See whether what is not run could be."""
        if language == "python":
            ast.parse(block.text)
            return
        text = block.text if language == "sh" else "\n".join(re.findall(r"^\$ (.*)$", block.text, flags=re.MULTILINE))
        for line in commands(text):
            for part in parts_of(line):
                program, *words = self._words(block, part)
                main = entry(program, words)
                if main is not None:
                    told = parse_only(main, words if program == "softrobots" else words[1:])
                    if told:
                        raise self._wrong(block, f"{part}: {told}")


def commands(text: str) -> Iterator[str]:
    """The commands of a shell block: lines with a backslash at the end go on in the next one."""
    for line in re.sub(r"\\\n", " ", text).splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            yield line.strip()


def parts_of(line: str) -> list[str]:
    """The single commands of a line, without what is written to files."""
    bare = re.sub(r"(^|\s)#.*$", "", line)
    return [re.sub(r"\d?>>?\s*\S+", "", part).strip() for part in re.split(r"&&|\|\||;|\|", bare)]


def entry(program: str, words: list[str]) -> Callable[[list[str]], int] | None:
    """The main function of a command of ours, or None if it is none."""
    if program == "softrobots":
        return cli.main
    if program == "python" and words and words[0].startswith("scripts/"):
        return runpy.run_path(str(CHECKOUT / words[0]), run_name="script")["main"]
    return None


class _Parsed(Exception):
    """The words of a command are good."""


def parse_only(main: Callable[[list[str]], int], words: list[str]) -> str:
    """Run a main function as far as to its options; what is wrong with them, or nothing."""
    errors = io.StringIO()

    def parse_args(self: argparse.ArgumentParser, *rest: object) -> None:
        unknown = self.parse_known_args(*rest)[1]
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        raise _Parsed

    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stderr(errors):
        patch.setattr(argparse.ArgumentParser, "parse_args", parse_args)
        try:
            main(words)
        except _Parsed:
            return ""
        except SystemExit:
            return errors.getvalue().strip()
    raise PageError("a command that does not parse its options first")


def in_process(main: Callable[[list[str]], int], words: list[str]) -> tuple[int, str, str]:
    """Run a main function; status, stdout and stderr."""
    output, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            status = main(words)
        except SystemExit as ended:
            status = ended.code
    return int(status or 0), output.getvalue(), errors.getvalue()


def in_shell(line: str) -> tuple[int, str, str]:
    """Run a line in bash, with the programs of this environment and the checkout's scripts; status, stdout and stderr."""
    if not Path("scripts").exists():
        Path("scripts").symlink_to(CHECKOUT / "scripts")
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": programs, "PYTHONPATH": str(CHECKOUT), "MPLBACKEND": "agg"}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", line], capture_output=True, text=True, env=environment, check=False
    )
    return done.returncode, done.stdout, done.stderr


@contextlib.contextmanager
def working_folder(folder: Path) -> Iterator[None]:
    """Work in a folder, where imports look first, without numba."""
    before, numba = Path.cwd(), sys.modules.get("numba")
    there = set(sys.modules)
    sys.modules["numba"] = None  # type: ignore[assignment]  # to importlib it is then not installed
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        os.chdir(before)
        sys.path.remove(str(folder))
        for name in set(sys.modules) - there:
            if str(getattr(sys.modules[name], "__file__", None)).startswith(str(folder)):
                del sys.modules[name]
        if numba is None:
            del sys.modules["numba"]
        else:
            sys.modules["numba"] = numba


def missing_package(error: BaseException) -> str | None:
    """What is not installed, if that is what an error says."""
    if isinstance(error, MissingDependency):
        return str(error)
    if isinstance(error, ModuleNotFoundError) and not str(error.name).startswith("softrobots"):
        return f"{error.name} is not installed"
    return None
