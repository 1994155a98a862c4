"""Mutants: small changes of the package, and which of them the tests notice.

mutmut writes each module with all its mutants, as functions `x_name__mutmut_1`, `x_name__mutmut_2`, and beside it a file with
what the tests made of each. A mutant that no test notices is explained in a table, by module, function and changed lines
(which stay when lines move), or is a fault of the tests. A changed wording of an error is explained by a rule.
"""

from __future__ import annotations

import ast
import difflib
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.errors import FileFormatError
from softrobots.core.json_text import read_json

KILLED, TIMED_OUT, SURVIVED, NOT_TESTED = "killed", "timed out", "survived", "not tested"
"""What became of a mutant."""

WORDING = "the wording of an error"
"""The rule: only a text in a `raise`, or of a check that raises (`instance_of`), differs, by upper or lower case or by
XX around it, and it is no name of a parameter."""

# Exit codes of the process that ran the tests: 1 and 3 of pytest, negative ones of a signal (24: out of time).
_STATUS = {0: SURVIVED, 5: SURVIVED, 33: SURVIVED, 1: KILLED, 3: KILLED, -9: KILLED, -11: KILLED, -6: KILLED}
_STATUS |= dict.fromkeys((-24, 24, 152, 36, 255), TIMED_OUT)
_LARGEST_FILE = 10_000_000  # bytes
_NAME = re.compile(r"(?P<module>.*)\.(?P<mangled>x(?:_|ǁ(?P<class>.*)ǁ)(?P<function>\w+?))__mutmut_(?P<number>\d+)")


class Mutant(NamedTuple):
    """A changed function."""

    name: str
    """Name that mutmut gives it."""
    module: str
    """Module, e.g. "softrobots.constant_curvature.screws"."""
    function: str
    """Function, or class and method."""
    old: str
    """Lines that differ, as they are, stripped and joined by spaces."""
    new: str
    """The same lines as changed."""
    status: str
    """`KILLED`, `TIMED_OUT`, `SURVIVED` or `NOT_TESTED`."""
    wording: bool
    """Whether the rule `WORDING` explains it."""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What an explanation names."""
        return self.module, self.function, self.old, self.new


class Explanation(NamedTuple):
    """Why a mutant does the same as the function, for whoever calls it."""

    module: str
    """Module."""
    function: str
    """Function, or class and method."""
    old: str
    """Lines that differ, as they are."""
    new: str
    """The same lines as changed."""
    reason: str
    """Why no test notices."""


class Verdict(NamedTuple):
    """What a run shows of one module."""

    module: str
    """Module."""
    mutants: int
    """How many there are."""
    killed: int
    """How many fail a test."""
    timed_out: int
    """How many take so long that the tests were ended."""
    explained: int
    """How many pass, with a reason in the table."""
    wording: int
    """How many pass, and change the wording of an error only."""
    unexplained: tuple[Mutant, ...]
    """Those that pass without a reason, or were not tested."""


def read_mutants(folder: Path, file: str) -> list[Mutant]:
    """Read what became of the mutants of a module.

    Args:
        folder: mutmut's folder `mutants`.
        file: Path of the module inside, e.g. "softrobots/constant_curvature/screws.py".

    Returns:
        The mutants, in mutmut's order.

    Raises:
        FileFormatError: If mutmut did not leave its files there, or left others than those that are known.
    """
    try:
        record = read_json(folder / f"{file}.meta", _LARGEST_FILE)
        text = (folder / file).read_text(encoding="utf-8")
        codes = record["exit_code_by_key"]
        functions = {node.name: node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)}
        lines = text.splitlines()
        return [_mutant(name, code, functions, lines) for name, code in codes.items()]
    except (OSError, ValueError, KeyError, TypeError, AttributeError, SyntaxError, FileFormatError) as error:
        raise FileFormatError(f"{folder / file} and {file}.meta are not what mutmut leaves: {error!r}") from error


def _mutant(name: str, code: int | None, functions: dict[str, ast.FunctionDef], lines: list[str]) -> Mutant:
    found = _NAME.fullmatch(name)
    if found is None:
        raise FileFormatError(f"{name} is no name of a mutant")
    mangled = found["mangled"]
    before, after = functions[f"{mangled}__mutmut_orig"], functions[f"{mangled}__mutmut_{found['number']}"]
    old, new = (_changed(_source(node, lines, found["function"])) for node in (before, after))
    pairs = [line for line in list(difflib.unified_diff(old, new, n=0, lineterm=""))[2:] if not line.startswith("@")]
    return Mutant(
        name=name,
        module=found["module"],
        function=f"{found['class']}.{found['function']}" if found["class"] else found["function"],
        old=" ".join(line[1:] for line in pairs if line[0] == "-"),
        new=" ".join(line[1:] for line in pairs if line[0] == "+"),
        status=NOT_TESTED if code is None else _STATUS.get(code, NOT_TESTED),
        wording=_unworded(before) == _unworded(after),
    )


def _source(node: ast.FunctionDef, lines: list[str], function: str) -> list[str]:
    """Lines of a function, under its own name."""
    own = lines[node.lineno - 1 : node.end_lineno]
    return [own[0].replace(node.name, function, 1), *own[1:]]


def _changed(lines: list[str]) -> list[str]:
    return [stripped for line in lines if (stripped := line.strip())]


def _unworded(function: ast.FunctionDef) -> str:
    """A function as text without its name, and without the case and the XX of words in errors."""
    words: set[int] = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and ast.unparse(node.func) == "instance_of"):
            words |= {id(part) for part in ast.walk(node) if isinstance(part, ast.Constant) and _is_wording(part.value)}

    class Blank(ast.NodeTransformer):
        def visit_Constant(self, node: ast.Constant) -> ast.Constant:
            if id(node) not in words:
                return node
            return ast.Constant(re.sub(r"\AXX(.*)XX\Z", r"\1", str(node.value), flags=re.DOTALL).casefold())

    copied = Blank().visit(function)
    return ast.dump(ast.Module([*copied.body, ast.Expr(copied.args)], []))


def _is_wording(value: object) -> bool:
    """Whether a constant is words: a single one may be the name of a parameter, which the error carries."""
    return isinstance(value, str) and not value.isidentifier()


def read_explanations(path: Path) -> list[Explanation]:
    """Read the table of explanations: groups of a reason and the mutants that it is the reason of.

    Args:
        path: A JSON file: `{"explanations": [{"reason": "...", "mutants": [...]}]}`, where a mutant is an object of `module`,
            `function`, `old` and `new`.

    Raises:
        FileFormatError: If it cannot be read, has other members, lacks a reason, or explains a mutant twice.
    """
    fields = {"module", "function", "old", "new"}
    try:
        found = []
        for group in read_json(path, _LARGEST_FILE)["explanations"]:
            if group.keys() != {"reason", "mutants"} or not _is_text(group["reason"]):
                raise FileFormatError(f"a group must have a reason and mutants, not {group!r:.200}")
            for entry in group["mutants"]:
                if entry.keys() != fields or not all(map(_is_text, entry.values())):
                    raise FileFormatError(f"a mutant must have texts for {', '.join(sorted(fields))}, not {entry!r:.200}")
                found.append(Explanation(**entry, reason=group["reason"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, FileFormatError) as error:
        raise FileFormatError(f"{path} is no table of explanations: {error}") from error
    twice = [key for key, count in Counter(entry[:4] for entry in found).items() if count > 1]
    if twice:
        raise FileFormatError(f"{path} explains a mutant twice: {twice[0]}")
    return found


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and bool(value.strip())


def judge(mutants: Sequence[Mutant], explanations: Sequence[Explanation]) -> tuple[list[Verdict], list[Explanation]]:
    """Match mutants that survived with their explanations.

    Args:
        mutants: All mutants of some modules.
        explanations: The whole table.

    Returns:
        A verdict for each module, and the explanations of these modules that explain nothing: the mutant is gone, or a test
        notices it now.
    """
    known = {entry[:4] for entry in explanations}
    verdicts = []
    for module in dict.fromkeys(mutant.module for mutant in mutants):
        own = [mutant for mutant in mutants if mutant.module == module]
        passed = [mutant for mutant in own if mutant.status in (SURVIVED, NOT_TESTED)]
        reasoned = [mutant for mutant in passed if mutant.key in known and mutant.status == SURVIVED]
        worded = [m for m in passed if m.wording and m.status == SURVIVED and m.key not in known]
        verdicts.append(
            Verdict(
                module=module,
                mutants=len(own),
                killed=sum(mutant.status == KILLED for mutant in own),
                timed_out=sum(mutant.status == TIMED_OUT for mutant in own),
                explained=len(reasoned),
                wording=len(worded),
                unexplained=tuple(mutant for mutant in passed if mutant not in reasoned and mutant not in worded),
            )
        )
    # One that takes longer may be ended on a slow machine, and is then not seen to do the same.
    present = {mutant.key for mutant in mutants if mutant.status in (SURVIVED, TIMED_OUT)}
    seen = {mutant.module for mutant in mutants}
    return verdicts, [entry for entry in explanations if entry.module in seen and entry[:4] not in present]
