"""A copy of a checkout and its environment: what is copied, what is left alone, and what is told if something is missing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import softrobots as sr
from studies.shared.clean_checkout import copy_checkout, find_uv, make_environment

pytestmark = pytest.mark.study


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "checkout"
    (folder / "inner").mkdir(parents=True)
    for name in ("known", "new", "inner/\u00e4 b", "removed", "left_out"):
        (folder / name).write_text(name, encoding="utf-8")
    (folder / ".gitignore").write_text("left_out\n", encoding="utf-8")
    for words in (["init", "-q"], ["add", "known", "inner", "removed", ".gitignore"]):
        subprocess.run(["git", *words], cwd=folder, check=True)
    (folder / "removed").unlink()
    (folder / "known").chmod(0o755)
    return folder


def test_what_git_knows_or_would_is_copied(checkout: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy_checkout(checkout, copy)
    assert {str(file.relative_to(copy)) for file in copy.rglob("*") if file.is_file()} == {
        ".gitignore",
        "known",
        "new",
        "inner/\u00e4 b",
    }
    assert (copy / "inner" / "\u00e4 b").read_text(encoding="utf-8") == "inner/\u00e4 b"
    assert (copy / "known").stat().st_mode & 0o777 == 0o755


def test_a_second_copy_changes_what_has_changed(checkout: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy_checkout(checkout, copy)
    before = (copy / "known").stat().st_mtime_ns
    (checkout / "new").write_text("changed", encoding="utf-8")
    copy_checkout(checkout, copy)
    assert (copy / "new").read_text(encoding="utf-8") == "changed"
    assert (copy / "known").stat().st_mtime_ns == before


def test_a_folder_without_git_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.OutputError, match="cannot copy"):
        copy_checkout(tmp_path / "nowhere", tmp_path / "copy")


def test_without_uv_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uv", None)
    with pytest.raises(sr.MissingDependency, match="dev"):
        find_uv()


def test_an_environment_that_cannot_be_made_is_told_with_its_log(tmp_path: Path, tool) -> None:
    tool("uv")
    log = tmp_path / "log.txt"
    with (
        log.open("w", encoding="utf-8") as output,
        pytest.raises(sr.OutputError, match=r"venv .* failed with status \d+; see .*log"),
    ):
        make_environment(tmp_path, tmp_path / "no-python", ["pip"], output)
    assert "no-python" in log.read_text(encoding="utf-8")
