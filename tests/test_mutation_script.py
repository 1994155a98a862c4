"""Mutants: what is read of mutmut's files, which explanations match, and what the script says and refuses."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import softrobots as sr
from studies.mutation.mutants import (
    KILLED,
    NOT_TESTED,
    SURVIVED,
    TIMED_OUT,
    Explanation,
    Mutant,
    judge,
    read_explanations,
    read_mutants,
)
from tests.conftest import CHECKOUT, load_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

GENERATED = '''
from mutmut.mutation.trampoline import wrap_in_trampoline as _mutmut_mutated

mutants_x_half__mutmut: dict = {}


def half(value: float) -> float:
    """The trampoline."""


def x_half__mutmut_orig(value: float, *, most: float = 3.0) -> float:
    """Half of a number."""
    if value > most:
        raise ParameterError(
            "value",
            value,
            "at most the limit",
        )
    return 0.5 * value


def x_half__mutmut_1(value: float, *, most: float = 4.0) -> float:
    """Half of a number."""
    if value > most:
        raise ParameterError(
            "value",
            value,
            "at most the limit",
        )
    return 0.5 * value


def x_half__mutmut_2(value: float, *, most: float = 3.0) -> float:
    """Half of a number."""
    if value > most:
        raise ParameterError(
            "value",
            value,
            "XXat most the limitXX",
        )
    return 0.5 * value


def x_half__mutmut_3(value: float, *, most: float = 3.0) -> float:
    """Half of a number."""
    if value > most:
        raise ParameterError(
            "VALUE",
            value,
            "at most the limit",
        )
    return 0.5 * value


def x_half__mutmut_4(value: float, *, most: float = 3.0) -> float:
    """Half of a number."""
    if value > most:
        raise ParameterError(
            "value",
            "at most the limit",
        )
    return 0.5 * value


class Case:
    def xǁCaseǁname__mutmut_orig(self) -> str:
        return "some words"

    def xǁCaseǁname__mutmut_1(self) -> str:
        return "SOME WORDS"
'''
CODES = {"x_half__mutmut_1": 1, "x_half__mutmut_2": 0, "x_half__mutmut_3": 33, "x_half__mutmut_4": -24}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A module as mutmut leaves it."""
    (tmp_path / "softrobots").mkdir()
    (tmp_path / "softrobots" / "halves.py").write_text(GENERATED, encoding="utf-8")
    codes = {f"softrobots.halves.{name}": code for name, code in CODES.items()} | {
        "softrobots.halves.xǁCaseǁname__mutmut_1": None
    }
    record = {"exit_code_by_key": codes, "durations_by_key": {}}
    (tmp_path / "softrobots" / "halves.py.meta").write_text(json.dumps(record), encoding="utf-8")
    return tmp_path


def test_mutants_are_read_with_their_changed_lines(folder: Path) -> None:
    found = read_mutants(folder, "softrobots/halves.py")
    assert [mutant.status for mutant in found] == [KILLED, SURVIVED, SURVIVED, TIMED_OUT, NOT_TESTED]
    assert [mutant.function for mutant in found] == ["half"] * 4 + ["Case.name"]
    assert {mutant.module for mutant in found} == {"softrobots.halves"}
    head = "def half(value: float, *, most: float = {}) -> float:"
    assert (found[0].old, found[0].new) == (head.format("3.0"), head.format("4.0"))
    assert (found[1].old, found[1].new) == ('"at most the limit",', '"XXat most the limitXX",')
    assert (found[3].old, found[3].new) == ("value,", "")
    assert (found[4].old, found[4].new) == ('return "some words"', 'return "SOME WORDS"')


def test_only_words_of_an_error_are_wording(folder: Path) -> None:
    """Neither the name of a parameter, nor an argument left out, nor words that are returned."""
    assert [mutant.wording for mutant in read_mutants(folder, "softrobots/halves.py")] == [False, True, False, False, False]


@each_row(
    ("name", "text"),
    [
        ("halves.py.meta", "{"),
        ("halves.py.meta", "[]"),
        ("halves.py.meta", "{}"),
        ("halves.py.meta", '{"exit_code_by_key": {"softrobots.halves.x_half__mutmut_7": 0}}'),
        ("halves.py.meta", '{"exit_code_by_key": {"half": 0}}'),
        ("halves.py", "def half(:"),
        ("halves.py", None),
    ],
)
def test_other_files_than_mutmuts_are_refused(folder: Path, name: str, text: str | None) -> None:
    (folder / "softrobots" / name).unlink()
    if text is not None:
        (folder / "softrobots" / name).write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=r"halves\.py.* not what mutmut leaves"):
        read_mutants(folder, "softrobots/halves.py")


ENTRY = {"module": "softrobots.halves", "function": "half", "old": "a < b", "new": "a <= b"}


def explained(reason: str = "both are right", **changes: str) -> Explanation:
    return Explanation(**(ENTRY | changes), reason=reason)


def mutant(status: str, wording: bool = False, **changes: str) -> Mutant:
    return Mutant(name="softrobots.halves.x_half__mutmut_1", **(ENTRY | changes), status=status, wording=wording)


def test_explanations_are_read(tmp_path: Path) -> None:
    file = tmp_path / "explained.json"
    groups = [{"reason": "both are right", "mutants": [ENTRY, ENTRY | {"new": "a > b"}]}, {"reason": "other", "mutants": []}]
    file.write_text(json.dumps({"explanations": groups}), encoding="utf-8")
    assert read_explanations(file) == [explained(), explained(new="a > b")]


@each_row(
    ("groups", "told"),
    [
        ([{"reason": " ", "mutants": []}], "a reason and mutants"),
        ([{"mutants": []}], "a reason and mutants"),
        ([{"reason": "r", "mutants": [], "more": 1}], "a reason and mutants"),
        ([{"reason": "r", "mutants": [{**ENTRY, "line": 3}]}], "function, module, new, old"),
        ([{"reason": "r", "mutants": [{**ENTRY, "old": ""}]}], "function, module, new, old"),
        ([{"reason": "r", "mutants": [{**ENTRY, "old": 3}]}], "function, module, new, old"),
        ([{"reason": "r", "mutants": [ENTRY]}, {"reason": "s", "mutants": [ENTRY]}], "explains a mutant twice"),
        ("text", "no table"),
        (None, "no table"),
    ],
)
def test_other_tables_are_refused(tmp_path: Path, groups: Any, told: str) -> None:
    file = tmp_path / "explained.json"
    file.write_text(json.dumps({"explanations": groups}), encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=told):
        read_explanations(file)


def test_a_survivor_is_explained_worded_or_neither() -> None:
    mutants = [
        mutant(KILLED, old="1"),
        mutant(KILLED, old="2"),
        mutant(TIMED_OUT, old="3"),
        mutant(SURVIVED),
        mutant(SURVIVED, old="4", wording=True),
        mutant(SURVIVED, old="5"),
        mutant(NOT_TESTED, old="6", wording=True),
        mutant(KILLED, module="softrobots.thirds"),
    ]
    (verdict, other), stale = judge(mutants, [explained()])
    assert (verdict.mutants, verdict.killed, verdict.timed_out, verdict.explained, verdict.wording) == (7, 2, 1, 1, 1)
    assert [left.old for left in verdict.unexplained] == ["5", "6"]
    assert (other.module, other.mutants, other.killed, other.unexplained) == ("softrobots.thirds", 1, 1, ())
    assert stale == []


def test_an_explanation_of_nothing_is_told() -> None:
    """Killed by now, changed by now, or gone; of a module that was not run nothing is known, nor of one that takes longer."""
    table = [explained(), explained(old="gone"), explained(old="longer"), explained(module="softrobots.thirds")]
    _, stale = judge([mutant(KILLED), mutant(TIMED_OUT, old="longer")], table)
    assert stale == table[:2]


def test_an_explanation_of_one_function_is_none_of_another() -> None:
    (verdict,), stale = judge([mutant(SURVIVED)], [explained(function="third")])
    assert len(verdict.unexplained) == 1
    assert len(stale) == 1


# --- The script, without mutmut


@pytest.fixture
def script() -> ModuleType:
    return load_script("mutation")


@pytest.fixture
def run(script: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run the script with given mutants and explanations instead of those of mutmut: status, stdout, stderr."""

    def call(mutants: list[Mutant], explanations: list[Explanation], *words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(script, "find_uv", lambda: "uv")
        monkeypatch.setattr(script, "test_changes", lambda *_, **__: mutants)
        monkeypatch.setattr(script, "read_explanations", lambda path: explanations)
        monkeypatch.chdir(tmp_path)
        return script.main(list(words)), *capsys.readouterr()

    return call


def test_the_script_tells_survivors_and_stale_explanations(run: Any, tmp_path: Path) -> None:
    status, out, _ = run([mutant(KILLED), mutant(SURVIVED, old="new one")], [explained()], "--output", "out")
    assert status == 1
    assert "softrobots.halves.x_half__mutmut_1: survived\n- new one\n+ a <= b" in out
    assert "softrobots.halves: half: nothing to explain: a < b -> a <= b" in out
    assert "| softrobots.halves | 2 | 1 | 0 | 0 | 0 | 1 |\n| all | 2 | 1 | 0 | 0 | 0 | 1 |" in out
    assert "- new one\n" in (tmp_path / "out" / "survivors.txt").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))["modules"][0]["unexplained"] == 1


def test_a_good_run_is_recorded_and_a_bad_one_is_not(run: Any, tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "validation.md"
    page.write_text("<!-- mutation:begin -->\n<!-- mutation:end -->\n", encoding="utf-8")
    status, _, err = run([mutant(SURVIVED)], [], "--output", "bad", "--docs", ".")
    assert (status, page.read_text(encoding="utf-8").count("\n")) == (1, 2)
    assert "a change is neither noticed nor explained" in err
    status, _, _ = run([mutant(SURVIVED), mutant(KILLED, old="other")], [explained()], "--output", "good", "--docs", ".")
    assert status == 0
    assert "| softrobots.halves | 2 | 1 | 0 | 0 | 1 | 0 |" in page.read_text(encoding="utf-8")
    assert "- 1: both are right" in page.read_text(encoding="utf-8")
    assert (
        json.loads((tmp_path / "docs" / "validation" / "mutation.json").read_text(encoding="utf-8"))["modules"][0]["killed"]
        == 1
    )


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--docs", ".", "--module", "elastostatics"], "--docs"),
        (["--docs", "."], "cannot read"),
        (["--processes", "0"], "--processes"),
        (["--resume", "nowhere"], "the folder of an earlier run"),
        (["--resume", "nowhere", "--output", "out"], "the folder of an earlier run"),
        (["--output", "full"], "not empty"),
    ],
)
def test_bad_options_are_refused_before_any_work(run: Any, tmp_path: Path, words: list[str], told: str) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").write_text("", encoding="utf-8")
    status, _, err = run([], [], *words)
    assert status == 2
    assert told in err


def test_modules_and_tests_of_the_script_exist(script: ModuleType) -> None:
    for part in script.PARTS.values():
        assert all((CHECKOUT / "softrobots" / file).is_file() for file in part.modules)
        assert all((CHECKOUT / "tests" / f"test_{name}.py").is_file() for name in part.tests)
    tests = "".join(file.read_text(encoding="utf-8") for file in (CHECKOUT / "tests").glob("test_*.py"))
    assert all(part in tests for part in script.LEFT_OUT)
    told = script.settings(list(script.PARTS.values()))
    assert told.count("tests/test_argument_errors.py") == 1


# --- The record


def test_the_table_of_explanations_is_sound() -> None:
    table = read_explanations(CHECKOUT / "docs" / "validation" / "mutants_explained.json")
    assert all(len(entry.reason) > 20 for entry in table)


def test_the_record_says_what_is_promised(script: ModuleType) -> None:
    """Every module of the script, none with a survivor that nobody explains; the page shows the same numbers."""
    record = json.loads((CHECKOUT / "docs" / "validation" / "mutation.json").read_text(encoding="utf-8"))
    files = {file for part in script.PARTS.values() for file in part.modules}
    names = {"softrobots." + file.removesuffix(".py").replace("/", ".") for file in files}
    recorded = {row["module"] for row in record["modules"]}
    assert recorded == names
    page = (CHECKOUT / "docs" / "validation.md").read_text(encoding="utf-8")
    for row in record["modules"]:
        assert row["unexplained"] == 0
        assert row["mutants"] == sum(row[name] for name in ("killed", "timed_out", "explained", "wording"))
        assert f"| {row['module']} | {row['mutants']} | {row['killed']} |" in page
