"""Records of slow proofs: what the page and the file say, and refusals before a long run is wasted."""

import json
import math
import platform
import re
from pathlib import Path

import pytest

import softrobots as sr
from studies.shared.recorded_run import check_page, write_record

pytestmark = pytest.mark.study


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "validation.md").write_text("before\n<!-- soak:begin -->\nold\n<!-- soak:end -->\nafter\n")
    return tmp_path


def test_the_page_shows_the_table_with_date_command_and_versions(checkout: Path) -> None:
    files = write_record(checkout, "soak", "| a |\n|---|\n| 1 |\n", {"solves": 7}, command="python scripts/soak.py")
    page = (checkout / "docs" / "validation.md").read_text()
    assert page.startswith("before\n")
    assert page.endswith("<!-- soak:end -->\nafter\n")
    assert "old" not in page
    python = re.escape(platform.python_version())
    assert re.search(rf"\*Run on \d{{4}}-\d\d-\d\d by `python scripts/soak.py`: Python {python}", page)
    assert "\n| a |\n|---|\n| 1 |\n" in page
    assert files == [checkout / "docs" / "validation.md", checkout / "docs" / "validation" / "soak.json"]
    record = json.loads(files[1].read_text())
    assert record["solves"] == 7
    assert record["machine"]["Python"] == platform.python_version()
    again = write_record(checkout, "soak", "second", {}, command="c")
    assert "| a |" not in again[0].read_text()


def test_a_page_without_the_marks_is_refused_before_and_after(checkout: Path) -> None:
    check_page(checkout, "soak")
    with pytest.raises(sr.FileFormatError, match="coverage:begin"):
        check_page(checkout, "coverage")
    with pytest.raises(sr.FileFormatError, match=r"cannot read .*other\.md"):
        write_record(checkout, "soak", "", {}, command="c", page="other.md")


def test_no_number_that_is_not_finite_is_recorded(checkout: Path) -> None:
    with pytest.raises(sr.ParameterError, match="finite"):
        write_record(checkout, "soak", "", {"worst": math.nan}, command="c")
    assert "old" in (checkout / "docs" / "validation.md").read_text()
