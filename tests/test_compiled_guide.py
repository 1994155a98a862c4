"""The tables and the C program of the guide to compiled solvers; its Python is run by `test_documentation.py`."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from tests.conftest import CHECKOUT, missing
from tests.support.documentation import PageRunner, blocks

pytestmark = pytest.mark.system

GUIDE = (CHECKOUT / "docs" / "compiled.md").read_text(encoding="utf-8")


def test_every_status_is_explained() -> None:
    assert re.findall(r"^\| `([A-Z_]+)` \|", GUIDE, flags=re.MULTILINE) == [status.name for status in Status]


def printed_by(program: str, folder: Path) -> list[str]:
    """What a program in C prints."""
    if shutil.which("gcc") is None:
        missing("gcc is not installed")
    (folder / "main.c").write_text(program)
    subprocess.run(["gcc", "-std=c99", "-O1", "-Wall", "-Werror", "main.c", "-o", "main"], cwd=folder, check=True)
    return subprocess.run(["./main"], cwd=folder, check=True, capture_output=True, text=True).stdout.split()


def test_the_c_program_of_the_guide_to_motion_moves_the_arm(tmp_path: Path, arm: sr.SoftModel) -> None:
    guide = (CHECKOUT / "docs" / "motion.md").read_text(encoding="utf-8")
    (program,) = (block for block in blocks(guide, "motion.md") if block.language == "c")
    (tmp_path / "arm_motion.c").write_text(sr.compile(arm, backend="python").c_source(motion=True, prefix="arm"))
    told = re.findall(r"^tip after 10 ms \[(.*)\]$", guide, flags=re.MULTILINE)[0].split()
    # The stiffness of the springs stands there with five digits.
    assert np.abs(np.array(printed_by(program.text, tmp_path), dtype=float) - np.array(told, dtype=float)).max() < 1e-7


def test_the_c_program_prints_the_springs_of_the_guide(tmp_path: Path) -> None:
    """The block of Python that writes the file, and the block of C that includes it, as they stand there."""
    writes = next(block for block in blocks(GUIDE, "compiled.md") if "c_source(" in block.text)
    (program,) = (block for block in blocks(GUIDE, "compiled.md") if block.language == "c")
    PageRunner("compiled.md", f"```python\n{writes.text}```\n", tmp_path).run()
    printed = printed_by(program.text, tmp_path)
    told = next(block.text for block in blocks(GUIDE, "compiled.md") if block.language == "text")
    springs = [float(number) for number in re.findall(r"-?\d+\.\d+", told)[:4]]
    assert np.abs(np.array(printed, dtype=float) - springs).max() < 1e-8  # as many digits as are printed
