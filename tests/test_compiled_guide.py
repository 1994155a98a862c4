"""The tables and the C program of the guide to compiled solvers; its Python is run by `test_documentation.py`."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from softrobots.compiled import Status
from tests.conftest import CHECKOUT, missing
from tests.support.documentation import PageRunner, blocks

pytestmark = pytest.mark.system

GUIDE = (CHECKOUT / "docs" / "compiled.md").read_text(encoding="utf-8")


def test_every_status_is_explained() -> None:
    assert re.findall(r"^\| `([A-Z_]+)` \|", GUIDE, flags=re.MULTILINE) == [status.name for status in Status]


def test_the_c_program_prints_the_springs_of_the_guide(tmp_path: Path) -> None:
    """The block of Python that writes the file, and the block of C that includes it, as they stand there."""
    if shutil.which("gcc") is None:
        missing("gcc is not installed")
    writes = next(block for block in blocks(GUIDE, "compiled.md") if "c_source(" in block.text)
    (program,) = (block for block in blocks(GUIDE, "compiled.md") if block.language == "c")
    PageRunner("compiled.md", f"```python\n{writes.text}```\n", tmp_path).run()
    (tmp_path / "main.c").write_text(program.text)
    subprocess.run(["gcc", "-std=c99", "-O1", "-Wall", "-Werror", "main.c", "-o", "main"], cwd=tmp_path, check=True)
    printed = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    told = next(block.text for block in blocks(GUIDE, "compiled.md") if block.language == "text")
    springs = [float(number) for number in re.findall(r"-?\d+\.\d+", told)[:4]]
    assert np.abs(np.array(printed.split(), dtype=float) - springs).max() < 1e-8  # as many digits as are printed
