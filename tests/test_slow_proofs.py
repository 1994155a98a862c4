"""Scripts of slow proofs: what they refuse, write and record, at little cost; and that the page names tests that exist."""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

import softrobots as sr
from studies.mutation.mutants import read_explanations
from studies.shared.clean_checkout import copy_checkout
from studies.shared.recorded_run import command_of
from tests.conftest import CHECKOUT, load_script
from tests.support.scripts import run_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study


def test_the_page_names_tests_that_exist() -> None:
    named = re.findall(r"`(test_\w+)::(\w*)`", (CHECKOUT / "docs" / "validation.md").read_text(encoding="utf-8"))
    assert len(named) > 50
    lacking = []
    for file, test in set(named) - {("test_x", "")}:  # an example
        path = CHECKOUT / "tests" / f"{file}.py"
        if not path.is_file() or (test and f"def {test}(" not in path.read_text(encoding="utf-8")):
            lacking.append(f"{file}::{test}")
    assert lacking == []


# --- What a record says


def test_a_record_names_the_options_of_its_run() -> None:
    parser = argparse.ArgumentParser()
    for option in ("--cases", "--seed"):
        parser.add_argument(option, type=int, default=5)
    told = [command_of("soak", parser, parser.parse_args(words), "cases", "seed") for words in ([], ["--cases", "7"])]
    assert told == ["python scripts/soak.py", "python scripts/soak.py --cases 7"]


def test_the_soak_writes_its_counts(tmp_path: Path) -> None:
    file = tmp_path / "soak.json"
    words = ["--cases", "2", "--processes", "1", "--families", "arm", "--json", str(file)]
    assert run_script("soak", words) == 0
    assert json.loads(file.read_text(encoding="utf-8"))["broken"] == 0


@pytest.mark.parametrize(("name", "words"), [("soak", ["--families", "arm"]), ("fuzz_readers", ["--reader", "URDF"])])
def test_a_part_of_the_work_is_not_recorded(
    name: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "docs").mkdir()
    assert run_script(name, [*words, "--cases", "1", "--docs", str(tmp_path)]) == 2
    assert f"given without {words[0]}" in capsys.readouterr().err


# --- Environments


def test_tests_that_end_early_have_not_passed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """pytest writes a report without a failure all the same."""
    environments = load_script("environments")
    monkeypatch.setattr(environments, "copy_checkout", lambda _, copy: copy.mkdir())
    monkeypatch.setattr(environments, "make_environment", lambda *_, **__: Path(sys.executable))
    report = '<testsuites><testsuite failures="0"><testcase classname="a" name="b"/></testsuite></testsuites>'

    def run(asked: list[str], **_: object) -> SimpleNamespace:
        for file in (word.partition("=")[2] for word in map(str, asked) if word.startswith("--junitxml=")):
            Path(file).write_text(report, encoding="utf-8")
        return SimpleNamespace(returncode=2, stdout="[]")  # 2 of pytest: interrupted

    monkeypatch.setattr(environments.subprocess, "run", run)
    with pytest.raises(sr.OutputError, match=r"the tests of plain ended early, with status 2; see .*plain\.log"):
        environments.run_tests(environments.ENVIRONMENTS["plain"], Path(sys.executable), [], tmp_path)
    assert (tmp_path / "plain.xml").is_file()


def test_a_machine_without_any_python_proves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    environments = load_script("environments")
    monkeypatch.setattr(environments, "interpreters", dict)
    assert environments.main(["--output", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()


# --- Studies with all their cases


REPORT = """<testsuites><testsuite>
<testcase classname="tests.test_b" name="test_y[0]"><properties>
<property name="gate" value="2"/><property name="all" value="10"/></properties></testcase>
<testcase classname="tests.test_b" name="test_y[1]"><properties>
<property name="gate" value="3"/><property name="all" value="20"/></properties><failure/></testcase>
<testcase classname="tests.test_a" name="test_x"><properties>
<property name="gate" value="1"/><property name="all" value="4"/></properties></testcase>
</testsuite></testsuites>"""


@pytest.mark.parametrize("status", [0, 1, 2])
def test_all_cases_are_counted_and_recorded_if_they_pass(
    status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    proofs = load_script("long_proofs")
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "validation.md"
    page.write_text("<!-- long_proofs:begin -->\n<!-- long_proofs:end -->\n", encoding="utf-8")

    def run(asked: list[str], **_: object) -> SimpleNamespace:
        assert "--all-cases" in asked
        file = next(word.partition("=")[2] for word in asked if word.startswith("--junitxml="))
        Path(file).write_text(REPORT if status else REPORT.replace("<failure/>", ""), encoding="utf-8")
        return SimpleNamespace(returncode=status)

    monkeypatch.setattr(proofs, "subprocess", SimpleNamespace(run=run))
    assert proofs.main(["--docs", str(tmp_path)]) == status
    out, err = capsys.readouterr()
    assert (f"| `test_b::test_y` | 5 | 30 | {status} |" in out) == (status < 2)
    assert ("| `test_a::test_x` | 1 | 4 | 0 |" in page.read_text(encoding="utf-8")) == (status == 0)
    assert ("" if status == 0 else "not recorded" if status == 1 else "ended early, with status 2") in err


def test_no_process_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_script("long_proofs", ["--processes", "0"]) == 2
    assert "at least 1" in capsys.readouterr().err


# --- Coverage


@pytest.mark.parametrize("comment", ["# pragma: no cover - why", "#pragma no cover - why", "# PRAGMA: NO BRANCH - why"])
def test_every_spelling_of_an_exclusion_is_seen(comment: str) -> None:
    found = load_script("measure_coverage").EXCLUDED.search(f"x = 1  {comment}\n")
    assert found is not None
    assert found["reason"].strip(" :-") == "why"


def test_settings_that_exclude_are_seen(tool: Callable[[str], ModuleType], tmp_path: Path) -> None:
    """In a process of its own: another instance of coverage.py would end the count of this one."""
    tool("coverage")
    bare, full = tmp_path / "bare.toml", tmp_path / "full.toml"
    bare.write_text("[tool.coverage.run]\nbranch = true\n", encoding="utf-8")
    full.write_text(
        '[tool.coverage.run]\nomit = [\n  "a.py", # drawn by hand\n  "b.py",\n]\n[tool.coverage.report]\n'
        'exclude_lines = ["# pragma: no cover"]\nexclude_also = ["if slow:"] # once a year\n',
        encoding="utf-8",
    )
    told = (
        "import json, pathlib, sys; sys.path.insert(0, 'scripts'); from measure_coverage import excluded_by_settings as seen;"
        "print(json.dumps([seen(pathlib.Path(file)) for file in sys.argv[1:]]))"
    )
    variables = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE")}
    asked = [sys.executable, "-c", told, str(bare), str(full), str(CHECKOUT / "pyproject.toml")]
    done = subprocess.run(asked, capture_output=True, text=True, check=True, cwd=CHECKOUT, env=variables)
    without, found, ours = json.loads(done.stdout)
    assert all(reason == "" for _, reason in without)  # whatever coverage.py leaves out by itself has no reason of ours
    assert [(value.split()[-1], reason) for value, reason in found][:2] == [("a.py", "drawn by hand"), ("b.py", "")]
    assert ["exclude_also if slow:", "once a year"] in found
    assert not any("pragma" in value for value, _ in found)
    assert ours == []


# --- A copy of the checkout


def test_a_copy_follows_the_checkout(tmp_path: Path) -> None:
    checkout, copy = tmp_path / "here", tmp_path / "here" / "runs" / "copy"
    (checkout / "package").mkdir(parents=True)
    subprocess.run(["git", "init", "-q", str(checkout)], check=True)
    for name in ("package/a.py", "package/b.py", "c.txt"):
        (checkout / name).write_text("old", encoding="utf-8")
    copy_checkout(checkout, copy)
    (copy / "setup.cfg").write_text("ours", encoding="utf-8")
    time_of_a = (copy / "package" / "a.py").stat().st_mtime_ns
    (checkout / "package" / "b.py").unlink()
    (checkout / "c.txt").write_text("new", encoding="utf-8")
    copy_checkout(checkout, copy)
    held = {file.relative_to(copy).as_posix(): file.read_text(encoding="utf-8") for file in copy.rglob("*") if file.is_file()}
    assert held == {"package/a.py": "old", "c.txt": "new", "setup.cfg": "ours"}  # b is gone, and the copy is not in itself
    assert (copy / "package" / "a.py").stat().st_mtime_ns == time_of_a
    (tmp_path / "plain").mkdir()
    with pytest.raises(sr.OutputError, match="cannot copy"):
        copy_checkout(tmp_path / "plain", tmp_path / "other")


# --- Explanations


@each_row(
    ("text", "told"),
    [
        ("{", "it is not JSON"),
        ("[]", "is no table"),
        ('{"explanations": [{"reason": " ", "mutants": []}]}', "a group must have a reason"),
        ('{"explanations": [{"reason": "a", "mutants": [{"module": "m"}]}]}', "a mutant must have texts"),
    ],
)
def test_a_table_without_reasons_is_refused(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "explained.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=told):
        read_explanations(file)
