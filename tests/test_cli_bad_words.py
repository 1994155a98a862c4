"""Words that nobody meant: every subcommand answers or refuses them, with a status and without a traceback."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softrobots.cli.main import COMMANDS, main, parser

NAMES = [command.__name__.rpartition(".")[2] for command in COMMANDS]
LONG = {"bench", "doctor", "view"}
"""These measure, look at the whole installation, or serve until Ctrl-C: only their words are tried."""

NUMBERS = ("0", "1", "3", "-1", "0.1", "-1e-3", "-.5", "1e20", "1e29", "1e400", "nan", "-inf", "1" * 400, "1_0", "0x10")
SETS = ("radius=", "radius=nan", "radius=1e300", "motor_limit=-1", "link_lengths=[]", "stiffness=1e-20", "hinge_offset=0.5")
WORDS = (
    *("", " ", "-", "--", "=", ".", "..", "/", "\n", "\udcff", "é", "x" * 300, "a=b", "1,5", "spring_1_up=3", "motor_1=1,x"),
    *("inflatable_arm", "nobody.urdf", "new.npz", "new.png", "new.xml", "new.json", "tip", "link_1", "spring_1_up"),
)


def actions(command: argparse.ArgumentParser) -> list[argparse.Action]:
    """The options of a subcommand and of its own subcommands."""
    made = [action for action in command._actions if action.option_strings and action.dest != "help"]
    for action in command._actions:
        if isinstance(action, argparse._SubParsersAction):
            made += [inner for deeper in action.choices.values() for inner in actions(deeper)]
    return made


def words_of(action: argparse.Action) -> st.SearchStrategy[list[str]]:
    """An option with values that look like what it takes, or do not."""
    fitting = st.sampled_from(sorted(map(str, action.choices))) if action.choices else st.sampled_from(WORDS)
    if action.type in (int, float):
        fitting = st.sampled_from(NUMBERS)
    elif action.dest == "parameters":
        fitting = st.sampled_from(SETS)
    least, most = (action.nargs, action.nargs) if isinstance(action.nargs, int) else (1, 3)
    well = st.lists(fitting, min_size=least, max_size=1 if action.nargs is None else most)
    anyhow = st.lists(st.sampled_from(WORDS + NUMBERS), max_size=3)
    return st.one_of(well, well, anyhow).map(lambda values: [action.option_strings[-1], *values])


@pytest.mark.study
@pytest.mark.parametrize("command", NAMES)
def test_any_words_end_with_a_status_and_a_message(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if command in LONG:
        monkeypatch.setattr(importlib.import_module(f"softrobots.cli.{command}"), "run", lambda arguments: None)
    (subparsers,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    options = actions(subparsers.choices[command])
    first = st.sampled_from([["inflatable_arm"]] * 4 + [[], ["nobody"], [""], ["forward", "0.5"], ["inverse", "1"]])
    needed = st.just([])
    for action in options:
        if action.required:
            needed = st.builds(lambda before, words: before + words, needed, words_of(action))
    some = st.lists(st.one_of(*map(words_of, options)), max_size=3) if options else st.just([["--nothing"]])

    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(first, needed, some)
    def ends(start: list[str], must: list[str], rest: list[list[str]]) -> None:
        words = [command, *start, *must, *(word for group in rest for word in group)]
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = main(words)
            except SystemExit as ended:  # argparse's way out
                status = int(ended.code or 0)
        assert status in (0, 1, 2)
        assert "Traceback" not in err.getvalue()
        if status == 2:
            assert "error: " in err.getvalue()
            assert out.getvalue() == ""
        elif "--json" in words and status == 0 and command not in LONG:
            json.loads(out.getvalue(), parse_constant=pytest.fail)

    ends()


EXAMPLES = 15
